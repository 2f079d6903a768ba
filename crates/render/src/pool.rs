//! The method `bssrdf`: what [`Bssrdf`] says of a point, with the light of lamps other than beams
//! drawn once a round for all pixels together.
//!
//! Where light enters does not depend on where it is looked at. Each round covers the solids with
//! points, more of them where there is more light, and asks once how much enters at each; a pixel then
//! sums over all of them. Far ones, for which R_d is alike, are stood for by one that is drawn by its
//! light: an estimate without bias in the place of an octree's mean. Near ones, where R_d has a peak
//! that is too narrow for the points, are left to the draws of [`Bssrdf`].

use crate::Vec3;
use crate::bssrdf::{Bssrdf, Diffusion, Local, Sampling};
use crate::method::{Method, Picture};
use crate::point_cloud::samples::Surface;
use crate::point_cloud::tree::{Lit, Tree};
use crate::point_cloud::{BySquare, entering};
use crate::scene::Scene;
use crate::surface::{Canvas, Point, Shader};
use physics::random::{Stream, stream};

/// Points for each pixel, all solids together, and at most and least of one of them.
const PER_PIXEL: f64 = 1.0;
const MOST: f64 = 262_144.0;
const LEAST: f64 = 4096.0;
/// A point may bring so many times the light of an even surface, at most; most bring much less.
const LARGEST: f64 = 4.0;
/// One point stands for all of a node if these bring little or are alike: if the square of their share of
/// the light of an evenly lit surface, times the area of the node over the square of the distance to its
/// sources, is less. That goes with what the node adds to the variance, which is least for so many nodes
/// where it is the same for all of them.
const SMALL: f64 = 3e-4;

/// A solid as it is covered with points.
struct Covered {
    surface: Surface,
    points: usize,
    /// R_d of each channel.
    spreads: Vec<BySquare>,
    /// Squares of the distance within which points are too few, mm², by channel.
    near: Vec<f64>,
    /// The least depth of a source, squared, mm².
    depth: f64,
    /// Mean of R_d of the channels over their totals, mm⁻².
    share: BySquare,
}

/// The method.
pub struct Pooled<'a> {
    bssrdf: Bssrdf,
    canvas: Canvas<'a>,
    /// The solids; none for one without an end or with a texture, and none where there is nothing
    /// but beams.
    solids: Vec<Option<Covered>>,
}

impl<'a> Pooled<'a> {
    /// Pictures of `scene` by `bssrdf`. Its own draws do it all on half-spaces and under textures,
    /// and if they are not those of [`Sampling::Axes`].
    pub fn new(scene: &'a Scene, bssrdf: Bssrdf, seed: u64, components: bool) -> Self {
        let wanted = bssrdf.sampling() == Sampling::Axes
            && scene.lamps.iter().any(|lamp| !lamp.light.is_beam());
        let share = PER_PIXEL * scene.pixels() as f64 / scene.objects.len() as f64;
        let points = share.clamp(LEAST, MOST) as usize;
        let covered = |(index, object): (usize, &crate::Object)| {
            // Under a texture each look at a point takes so long that draws of its own are cheaper.
            let even = object.material.texture.is_none();
            let surface = Surface::new(&object.shape).filter(|_| wanted && even)?;
            let surface = surface.by_light(scene, index);
            let area = surface.largest(points);
            let all = bssrdf.drawn_by(index);
            let near: Vec<f64> = all.iter().map(|d| too_near(d, area).powi(2)).collect();
            let depths = all.iter().map(|d| d.source_depth_mm);
            let least = depths.fold(f64::INFINITY, f64::min).powi(2);
            let nearest = near.iter().copied().fold(f64::INFINITY, f64::min);
            let ranges = all.iter().map(|d| d.profile.range());
            let whole = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
            let range = ranges.fold((f64::INFINITY, 0.0), whole);
            let share = BySquare::of(range, |radius| {
                let each = all
                    .iter()
                    .zip(&near)
                    .map(|(d, near)| d.profile.value(radius.max(near.sqrt())) / d.profile.total());
                each.sum::<f64>() / all.len() as f64
            });
            // Where nothing has a texture, the draws of a channel and its tables are one diffusion.
            let tables = all.iter().map(|d| BySquare::new(d, false));
            Some(Covered {
                surface,
                points,
                spreads: tables.collect(),
                near,
                depth: least.max(nearest),
                share,
            })
        };
        Self {
            solids: scene.objects.iter().enumerate().map(covered).collect(),
            bssrdf,
            canvas: Canvas::new(scene, seed, components),
        }
    }

    /// The points of a round.
    pub fn pool(&self, round: u64) -> Pool<'_> {
        let scene = self.canvas.scene;
        let tree = |(object, covered): (usize, &Option<Covered>)| {
            let Covered {
                surface, points, ..
            } = covered.as_ref()?;
            let mut rng = stream(self.canvas.seed, &[7, round, object as u64]);
            let (mut places, mut powers) = (vec![], vec![]);
            for (point, area) in surface.points(scene, object, *points, &mut rng) {
                places.push(Lit {
                    at: point.at,
                    normal: point.true_normal,
                    area,
                });
                powers.extend(entering(scene, &point, area, &mut rng));
            }
            let families = self.bssrdf.of_object(object);
            Some(Tree::new(&places, &powers, &[], families, &[]))
        };
        Pool {
            method: self,
            trees: self.solids.iter().enumerate().map(tree).collect(),
        }
    }
}

/// The radius within which a point that stands for an area, mm², may bring more than [`LARGEST`], mm.
fn too_near(diffusion: &Diffusion, area: f64) -> f64 {
    let profile = &diffusion.profile;
    let large = |radius: f64| profile.value(radius) * area > LARGEST * profile.total();
    let (mut low, mut high) = profile.range();
    if !large(low) {
        return 0.0;
    }
    while high > low * 1.001 {
        let middle = (low * high).sqrt();
        if large(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

impl Method for Pooled<'_> {
    fn scene(&self) -> &Scene {
        self.canvas.scene
    }

    fn empty(&self) -> Picture {
        self.canvas.empty()
    }

    fn round(&self, index: u64) -> (Vec<f64>, Vec<f64>) {
        self.canvas.round(&self.pool(index), index)
    }
}

/// Points of one round with the light that enters there.
pub struct Pool<'a> {
    method: &'a Pooled<'a>,
    trees: Vec<Option<Tree>>,
}

impl Pool<'_> {
    /// How many points a solid has.
    pub fn points(&self, object: usize) -> usize {
        self.trees[object].as_ref().map_or(0, Tree::len)
    }

    /// Adds to `out` the light that enters at the points, but not near, and leaves around one of the
    /// surface, per area and over the factor of the exit; in each channel.
    fn exitance(
        &self,
        point: &Point,
        covered: &Covered,
        tree: &Tree,
        rng: &mut Stream,
        out: &mut [f64],
    ) {
        let material = &self.method.canvas.scene.objects[point.object].material;
        let bssrdf = &self.method.bssrdf;
        let locals: Vec<Local> = bssrdf.at(point.object, &material.media).collect();
        let even = tree.irradiance();
        let small = |power: f64, area: f64, square: f64| {
            let share = power / even * covered.share.value(square);
            share * share * area < SMALL * (square + covered.depth)
        };
        tree.drawn(point.at, small, rng, |k, times| {
            let (from, powers) = tree.point(k);
            let offset: Vec3 = point.at - from.at;
            let (square, along) = (offset.length_squared(), offset.dot(from.normal));
            for (channel, out) in out.iter_mut().enumerate() {
                let (local, table) = (&locals[channel], &covered.spreads[channel]);
                let square = local.square_of_distance(square, along);
                if square >= covered.near[channel] {
                    let light = local.spread_by(square, |_, own| table.value(own));
                    *out += times * powers[channel] * light;
                }
            }
        });
    }
}

impl Shader for Pool<'_> {
    fn shaded(&self) -> u32 {
        // Where there is no pool, it costs as much to find what a ray meets as to shade it.
        let pools = self.trees.iter().all(Option::is_some);
        if pools {
            1
        } else {
            self.method.bssrdf.shaded()
        }
    }

    fn shade(
        &self,
        scene: &Scene,
        point: &Point,
        view: Vec3,
        rng: &mut Stream,
        single: &mut [f64],
        diffuse: &mut [f64],
    ) {
        let bssrdf = &self.method.bssrdf;
        let covered = self.method.solids[point.object].as_ref();
        let near = covered.map(|covered| &*covered.near);
        bssrdf.diffuse(scene, point, view, near, rng, diffuse);
        bssrdf.single(scene, point, view, rng, single);
        let Some((covered, tree)) = covered.zip(self.trees[point.object].as_ref()) else {
            return;
        };
        let mut exitance = vec![0.0; diffuse.len()];
        self.exitance(point, covered, tree, rng, &mut exitance);
        let cos_out = view.dot(point.normal).clamp(0.0, 1.0);
        let media = &scene.objects[point.object].material.media;
        for (channel, medium) in media.iter().enumerate() {
            diffuse[channel] +=
                exitance[channel] * bssrdf.leaves(point.object, channel, medium.eta, cos_out);
        }
    }
}

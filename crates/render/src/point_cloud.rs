//! The method `point-cloud`: light that enters is gathered once, at points evenly over the
//! surface, and every pixel then looks at the same points.
//!
//! Each round draws points of its own, so that the mean over rounds has no bias but that of the
//! gathering, and its spread is its error.

mod palette;
pub(crate) mod samples;
pub(crate) mod tree;

use crate::Vec3;
use crate::bssrdf::{Bssrdf, Diffusion, Local, square_of_distance};
use crate::method::{Method, Picture};
use crate::scene::{Scene, SceneError};
use crate::surface::{Canvas, Point, Shader, arrives};
use palette::Palette;
use physics::random::{Stream, stream};
use physics::{Medium, fresnel};
use samples::Surface;
use std::f64::consts::PI;
use tree::{Lit, Seen, Tree};

/// How a pixel gathers light from the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gather {
    /// Jensen and Buhler (2002): the BSSRDF from every point, far ones together in the nodes of
    /// an octree.
    Hierarchy {
        /// Solid angle, sr, which the surface of a node has to stay below to stand for its
        /// points, unless it brings next to nothing. 0 looks at every point.
        solid_angle: f64,
    },
    /// Marengo (2005), of *Finding Nemo*: a smooth bell over the points within a scatter radius,
    /// gathered at every point of the cloud and interpolated between the nearest of them.
    Smoothstep {
        /// The scatter radius, mm. If left out, that at which the mean distance of the light is
        /// the BSSRDF's own, in each channel.
        radius: Option<f64>,
    },
}

impl Gather {
    /// The hierarchy with a solid angle at which it is within 0.5 % of all points one by one.
    pub const HIERARCHY: Self = Self::Hierarchy {
        solid_angle: 0.0075,
    };
}

/// Side of the square that a point stands for, over the transport mean free path of the densest
/// channel. Jensen and Buhler ask for points not farther apart than the path; below it the bell of
/// R_d, which is as wide as the path, is met by several.
const SPACING: f64 = 0.6;
/// The same over the scatter radius: light under the bell is then within 0.5 % at every point.
const SPACING_OF_RADIUS: f64 = 0.045;
/// Most points of one solid, whatever the spacing asks for; and fewest.
const MOST: f64 = 1e6;
/// Most under the bell, which looks at all points within its radius from each of them.
const MOST_OF_BELL: f64 = 1.2e5;
const LEAST: f64 = 1e3;
/// Rays of a beam in one round.
const RAYS: usize = 256;
/// Times that nodes may be larger than the solid angle if they bring [`LITTLE`] of the light.
const LOOSE: f64 = 16.0;
/// This share of what comes from all, over those times: some hundreds of such nodes together are then
/// not more wrong than one that brings a fifth of the light.
const LITTLE: f64 = 5e-4;
/// Points between which the smooth bell is interpolated.
const NEAREST: usize = 16;

/// 1 − smoothstep over its integral over the plane: how much of the light that enters at a
/// distance leaves here, mm⁻², when it dies out at `radius` mm.
///
/// # Source
///
/// *Subsurface Scattering Explained*, after Marengo (2005): the integral of the bell is 3πD²/10.
pub fn bell(radius: f64, distance: f64) -> f64 {
    let t = (distance / radius).min(1.0);
    (1.0 - t * t * (3.0 - 2.0 * t)) / (0.3 * PI * radius * radius)
}

/// Mean distance under [`bell`] over its radius: ∫ r (1 − smoothstep) 2πr dr = 2πD³/15.
const MEAN_DISTANCE: f64 = 4.0 / 9.0;

/// The given scatter radius, or the one at which the mean distance is the diffusion's own, mm.
fn scatter_radius(given: Option<f64>, diffusion: &Local<'_>) -> f64 {
    given.unwrap_or_else(|| diffusion.mean_distance() / MEAN_DISTANCE)
}

/// One solid as a cloud sees it.
struct Solid {
    surface: Option<Surface>,
    points: usize,
    /// R_d of each channel, table by table of its family; under a texture their logarithms.
    spreads: Vec<Vec<BySquare>>,
    /// Under a texture, for each channel.
    palettes: Vec<Palette>,
}

/// A function of the distance as a table over its square, eight bits of which tell steps within an
/// octave apart: without logarithms, and on a line between steps within 2e-5 of a power law.
pub(crate) struct BySquare {
    first: u64,
    values: Vec<f64>,
    beyond: f64,
}

impl BySquare {
    /// Bits of a double below those that count.
    const SHIFT: u32 = 52 - 8;

    /// R_d with its share or, where it is to be found between several, its logarithm.
    pub(crate) fn new(diffusion: &Diffusion, logarithm: bool) -> Self {
        let of = |value: f64| {
            if logarithm {
                value.max(f64::MIN_POSITIVE).ln()
            } else {
                value
            }
        };
        let value = |radius| of(diffusion.share * diffusion.profile.value(radius));
        Self {
            beyond: of(0.0),
            ..Self::of(diffusion.profile.range(), value)
        }
    }

    /// A function of radii in a range, mm; what it has at the first of them below, and 0 beyond.
    pub(crate) fn of((low, high): (f64, f64), value: impl Fn(f64) -> f64) -> Self {
        let first = (low * low).to_bits() >> Self::SHIFT;
        let last = (high * high).to_bits() >> Self::SHIFT;
        let at = |index: u64| f64::from_bits(index << Self::SHIFT).sqrt();
        Self {
            first,
            values: (first..=last + 1).map(|index| value(at(index))).collect(),
            beyond: 0.0,
        }
    }

    #[inline]
    pub(crate) fn value(&self, square: f64) -> f64 {
        let bits = square.max(f64::MIN_POSITIVE).to_bits();
        let index = bits >> Self::SHIFT;
        let Some(place) = index.checked_sub(self.first) else {
            return self.values[0];
        };
        match self.values.get(place as usize..place as usize + 2) {
            Some(&[here, next]) => {
                let low = f64::from_bits(index << Self::SHIFT);
                let high = f64::from_bits((index + 1) << Self::SHIFT);
                here + (next - here) * (square - low) / (high - low)
            }
            _ => self.beyond,
        }
    }
}

/// Light that enters one of many media, ready to be looked at from any distance: what
/// [`Local::spread_by`] would have to work out for each look. Single precision is enough for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source {
    /// ln of the factor on what the tables have.
    ln_factor: f32,
    /// The table before, and how far on the way to the next.
    table: u32,
    part: f32,
    /// Squares of the tables for each mm².
    per_square: f32,
    source_depth_mm: f32,
}

impl Source {
    fn new(local: &Local<'_>, power: f64) -> Self {
        let (table, part) = local.between();
        Self {
            ln_factor: (local.factor() * power).ln() as f32,
            table: table as u32,
            part: part as f32,
            per_square: local.per_square() as f32,
            source_depth_mm: local.source_depth_mm() as f32,
        }
    }

    /// The light of it that leaves at a point whose offset has the square `square` and the part
    /// `along` the normal, by tables of logarithms.
    #[inline]
    fn light(&self, ln_tables: &[BySquare], square: f64, along: f64) -> f64 {
        let square = square_of_distance(square, along, f64::from(self.source_depth_mm));
        let own = square * f64::from(self.per_square);
        let table = self.table as usize;
        let mut ln_light = ln_tables[table].value(own);
        if self.part > 0.0 {
            ln_light += f64::from(self.part) * (ln_tables[table + 1].value(own) - ln_light);
        }
        (f64::from(self.ln_factor) + ln_light).exp()
    }
}

/// The method.
pub struct PointCloud<'a> {
    bssrdf: Bssrdf,
    gather: Gather,
    canvas: Canvas<'a>,
    solids: Vec<Solid>,
}

impl<'a> PointCloud<'a> {
    /// Pictures of `scene`, with the diffusion and the single scattering of `bssrdf`.
    ///
    /// # Errors
    ///
    /// [`SceneError::Coverless`]: a half-space, which no number of points covers, other than in the
    /// light of beams alone for the hierarchy.
    pub fn new(
        scene: &'a Scene,
        bssrdf: Bssrdf,
        gather: Gather,
        seed: u64,
        components: bool,
    ) -> Result<Self, SceneError> {
        // The bell is interpolated between points, whether there is light or not.
        let covered = matches!(gather, Gather::Smoothstep { .. })
            || scene.lamps.iter().any(|lamp| !lamp.light.is_beam());
        let solid = |(index, object): (usize, &crate::Object)| {
            let surface = Surface::new(&object.shape);
            if surface.is_none() && covered {
                return Err(SceneError::Coverless(object.name.clone()));
            }
            let families = bssrdf.of_object(index);
            let all = families.iter().enumerate().flat_map(|(channel, family)| {
                let media = object.material.representatives(channel).into_iter();
                media.map(move |medium| (family, medium))
            });
            let side = match gather {
                Gather::Hierarchy { .. } => {
                    let paths = all.map(|(_, m)| 1.0 / m.reduced().coefficients().sigma_t_prime());
                    SPACING * paths.fold(f64::INFINITY, f64::min)
                }
                Gather::Smoothstep { radius } => {
                    let radii = all.map(|(family, m)| scatter_radius(radius, &family.of(&m)));
                    SPACING_OF_RADIUS * radii.fold(f64::INFINITY, f64::min)
                }
            };
            let area = surface.as_ref().map_or(0.0, Surface::area);
            let most = match gather {
                Gather::Hierarchy { .. } => MOST,
                Gather::Smoothstep { .. } => MOST_OF_BELL,
            };
            let points = (area / (side * side)).clamp(LEAST, most) as usize;
            let textured = object.material.texture.is_some();
            let bounds = object.shape.bounds();
            let most = bounds.map_or(f64::INFINITY, |(low, high)| (high - low).length());
            let all = families.iter().enumerate().filter(|_| textured);
            let palettes = all.map(|(channel, family)| {
                let ends = object.material.representatives(channel);
                Palette::new(family, &ends, most)
            });
            let palettes = palettes.collect();
            Ok(Solid {
                surface: surface.filter(|_| covered),
                points,
                spreads: families
                    .iter()
                    .map(|f| {
                        let tables = f.tables().iter();
                        tables.map(|d| BySquare::new(d, textured)).collect()
                    })
                    .collect(),
                palettes,
            })
        };
        let solids = scene.objects.iter().enumerate().map(solid);
        Ok(Self {
            solids: solids.collect::<Result<_, _>>()?,
            bssrdf,
            gather,
            canvas: Canvas::new(scene, seed, components),
        })
    }

    /// The cloud of a round.
    pub fn cloud(&self, round: u64) -> Cloud<'_> {
        let mut points = vec![vec![]; self.solids.len()];
        let mut powers: Vec<Vec<f64>> = vec![vec![]; self.solids.len()];
        let mut media: Vec<Vec<Medium>> = vec![vec![]; self.solids.len()];
        let mut remember = |point: &Point| {
            if point.coordinates.is_some() {
                media[point.object].extend(&*self.canvas.scene.media(point));
            }
        };
        for (object, solid) in self.solids.iter().enumerate() {
            let Some(surface) = &solid.surface else {
                continue;
            };
            let mut rng = stream(self.canvas.seed, &[5, round, object as u64]);
            for (point, area) in surface.points(self.canvas.scene, object, solid.points, &mut rng) {
                points[object].push(Lit {
                    at: point.at,
                    normal: point.true_normal,
                    area,
                });
                powers[object].extend(entering(self.canvas.scene, &point, area, &mut rng));
                remember(&point);
            }
        }
        // A beam lights a spot that may lie between all points: its own rays are some more.
        for (index, lamp) in self.canvas.scene.lamps.iter().enumerate() {
            let Some(spot) = lamp.light.spot() else {
                continue;
            };
            let mut rng = stream(self.canvas.seed, &[6, round, index as u64]);
            let extent = spot.extent();
            for _ in 0..RAYS {
                let ray = lamp.light.emit(self.canvas.scene.reach(), &mut rng);
                let Some((object, hit)) = self.canvas.scene.enter(ray.origin, ray.direction) else {
                    continue;
                };
                let at = ray.origin + hit.distance * ray.direction;
                let point = Point::new(self.canvas.scene, object, at, &hit);
                let cos_in = (-ray.direction.dot(point.normal)).clamp(0.0, 1.0);
                points[object].push(Lit {
                    at,
                    normal: point.true_normal,
                    area: PI * extent * extent / RAYS as f64,
                });
                let media = self.canvas.scene.objects[object].material.media.iter();
                powers[object].extend(media.zip(&lamp.strength).map(|(medium, strength)| {
                    ray.power / RAYS as f64 * strength * fresnel::entry_factor(medium.eta, cos_in)
                }));
                remember(&point);
            }
        }
        let each = points.iter().zip(&powers).zip(&media).enumerate();
        let trees: Vec<Tree> = each
            .map(|(object, ((points, powers), media))| {
                let families = self.bssrdf.of_object(object);
                let palettes = &self.solids[object].palettes;
                Tree::new(points, powers, media, families, palettes)
            })
            .collect();
        let gathered = match self.gather {
            Gather::Hierarchy { .. } => vec![],
            Gather::Smoothstep { radius } => {
                let all = trees.iter().enumerate();
                all.map(|(object, tree)| self.gathered(object, tree, radius))
                    .collect()
            }
        };
        Cloud {
            method: self,
            trees,
            gathered,
        }
    }

    /// Radius of the widest bell, mm, and the light that leaves under the bells around every point of a
    /// tree, in each channel, W mm⁻².
    fn gathered(&self, object: usize, tree: &Tree, radius: Option<f64>) -> (f64, Vec<f64>) {
        let even = &self.canvas.scene.objects[object].material.media;
        let channels = even.len();
        let of_media = |media: &[Medium]| -> Vec<(f64, f64)> {
            let all = self.bssrdf.at(object, media);
            all.map(|local| (scatter_radius(radius, &local), local.total()))
                .collect()
        };
        // Radius and share of the light of every point, or once for all of them.
        let bells: Vec<Vec<(f64, f64)>> = if self.is_textured(object) {
            (0..tree.len()).map(|k| of_media(tree.media(k))).collect()
        } else {
            vec![of_media(even)]
        };
        let bell_of = |k: usize| &bells[k.min(bells.len() - 1)];
        let widest = bells.iter().flatten().map(|(r, _)| *r).fold(0.0, f64::max);
        let mut sums = vec![0.0; tree.len() * channels];
        for (k, sums) in sums.chunks_exact_mut(channels).enumerate() {
            let from = tree.point(k).0.at;
            tree.within(from, widest, |other, square| {
                let powers = tree.point(other).1;
                let distance = square.sqrt();
                let bells = bell_of(other).iter().zip(powers);
                for (sum, (&(radius, total), power)) in sums.iter_mut().zip(bells) {
                    *sum += power * total * bell(radius, distance);
                }
            });
        }
        (widest, sums)
    }

    fn is_textured(&self, object: usize) -> bool {
        self.canvas.scene.objects[object].material.texture.is_some()
    }
}

/// Power that enters from all lamps but beams around a point that stands for `area` mm², in each
/// channel.
pub(crate) fn entering(scene: &Scene, point: &Point, area: f64, rng: &mut Stream) -> Vec<f64> {
    let media = &scene.objects[point.object].material.media;
    let mut power = vec![0.0; media.len()];
    for (index, lamp) in scene.lamps.iter().enumerate() {
        if lamp.light.is_beam() {
            continue;
        }
        let Some(incident) = arrives(scene, index, point, rng) else {
            continue;
        };
        let cos_in = incident.toward.dot(point.normal).min(1.0);
        for ((power, medium), strength) in power.iter_mut().zip(media).zip(&lamp.strength) {
            *power += area
                * incident.irradiance
                * cos_in
                * strength
                * fresnel::entry_factor(medium.eta, cos_in);
        }
    }
    power
}

impl Method for PointCloud<'_> {
    fn scene(&self) -> &Scene {
        self.canvas.scene
    }

    fn empty(&self) -> Picture {
        self.canvas.empty()
    }

    fn round(&self, index: u64) -> (Vec<f64>, Vec<f64>) {
        self.canvas.round(&self.cloud(index), index)
    }
}

/// Points with the light that enters there, ready to be looked at from any place.
pub struct Cloud<'a> {
    method: &'a PointCloud<'a>,
    trees: Vec<Tree>,
    /// For each solid the widest bell, mm, and by point and channel the light under all of them.
    gathered: Vec<(f64, Vec<f64>)>,
}

impl Cloud<'_> {
    /// How many points a solid has.
    pub fn points(&self, object: usize) -> usize {
        self.trees[object].len()
    }

    /// Adds to `out` the diffuse light that leaves around a point, per area: its radiance over
    /// 1/π and the factor of the exit; in each channel, W mm⁻².
    pub fn exitance(&self, point: &Point, out: &mut [f64]) {
        match self.method.gather {
            Gather::Hierarchy { solid_angle } => self.by_hierarchy(point, solid_angle, out),
            Gather::Smoothstep { .. } => self.by_bell(point, out),
        }
    }

    fn by_hierarchy(&self, point: &Point, solid_angle: f64, out: &mut [f64]) {
        let solid = &self.method.solids[point.object];
        let tables = &solid.spreads;
        let tree = &self.trees[point.object];
        let offset = |from: &Lit| {
            let offset = point.at - from.at;
            (offset.length_squared(), offset.dot(from.normal))
        };
        if self.method.is_textured(point.object) {
            let light = |from: &Lit, seen, channel: usize| {
                let (square, along) = offset(from);
                match seen {
                    Seen::Point(k) => {
                        tree.source(k, channel)
                            .light(&tables[channel], square, along)
                    }
                    Seen::Node(k) => {
                        let mixture = tree.mixture(k, channel);
                        let depth = f64::from(mixture.source_depth_mm);
                        let square = square_of_distance(square, along, depth);
                        solid.palettes[channel].light(&mixture, square)
                    }
                }
            };
            gathered(tree, point.at, solid_angle, light, out);
            return;
        }
        let even = &self.method.canvas.scene.objects[point.object]
            .material
            .media;
        let even: Vec<Local> = self.method.bssrdf.at(point.object, even).collect();
        let light = |from: &Lit, seen, channel: usize| {
            let (square, along) = offset(from);
            let (local, tables) = (&even[channel], &tables[channel]);
            let square = local.square_of_distance(square, along);
            tree.powers(seen)[channel]
                * local.spread_by(square, |table, own| tables[table].value(own))
        };
        gathered(tree, point.at, solid_angle, light, out);
    }

    fn by_bell(&self, point: &Point, out: &mut [f64]) {
        let tree = &self.trees[point.object];
        let (widest, gathered) = &self.gathered[point.object];
        let channels = out.len();
        // What lies on the other side of a thin sheet is near, but another surface.
        let near = tree.nearest(point.at, *widest, NEAREST, |other| {
            other.normal.dot(point.true_normal) > 0.0
        });
        let Some((_, last)) = near.last() else {
            return;
        };
        // The last one fades out, so that nothing jumps where another takes its place.
        let reach = last.sqrt() * (1.0 + 1e-6) + f64::MIN_POSITIVE;
        let (mut weights, mut sums) = (0.0, vec![0.0; channels]);
        for (k, square) in near {
            let weight = bell(reach, square.sqrt()).max(0.0);
            weights += weight;
            for (sum, light) in sums.iter_mut().zip(&gathered[k * channels..]) {
                *sum += weight * light;
            }
        }
        if weights > 0.0 {
            for (out, sum) in out.iter_mut().zip(sums) {
                *out += sum / weights;
            }
        }
    }
}

/// Adds to `out` what comes to `at` from all of a tree, `light` being that of one point or node in a
/// channel.
#[inline]
fn gathered(
    tree: &Tree,
    at: Vec3,
    solid_angle: f64,
    light: impl Fn(&Lit, Seen, usize) -> f64,
    out: &mut [f64],
) {
    // What it is about, to know what counts.
    let mut about = vec![0.0; out.len()];
    let mut found = about.clone();
    if solid_angle > 0.0 {
        tree.offered(at, LOOSE * solid_angle, 1.0, |from, seen, _| {
            for (channel, about) in about.iter_mut().enumerate() {
                *about += light(from, seen, channel);
            }
            true
        });
    }
    tree.offered(at, solid_angle, LOOSE, |from, seen, times| {
        for (channel, (found, about)) in found.iter_mut().zip(&about).enumerate() {
            *found = light(from, seen, channel);
            if times > 1.0 && *found * times > LITTLE * about {
                return false;
            }
        }
        for (out, found) in out.iter_mut().zip(&found) {
            *out += found;
        }
        true
    });
}

impl Shader for Cloud<'_> {
    fn shaded(&self) -> u32 {
        1
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
        let mut exitance = vec![0.0; diffuse.len()];
        self.exitance(point, &mut exitance);
        let cos_out = view.dot(point.normal).clamp(0.0, 1.0);
        let media = &scene.objects[point.object].material.media;
        for (channel, medium) in media.iter().enumerate() {
            diffuse[channel] +=
                exitance[channel] * bssrdf.leaves(point.object, channel, medium.eta, cos_out);
        }
        bssrdf.single(scene, point, view, rng, single);
    }
}

//! The method `bssrdf`: diffusion from all over the surface, and light that scattered once.

use crate::Vec3;
use crate::boundary::part;
use crate::light::{Light, Spot};
use crate::scene::{Object, Scene};
use crate::shape::{Hit, Mesh, Shape};
use crate::surface::{Point, Shader, Weighted, arrives, in_triangle, through_surface};
use physics::fresnel;
use physics::random::{Stream, uniform};
use physics::{HenyeyGreenstein, Medium, PhaseFunction};
use std::f64::consts::{PI, TAU};
use std::sync::OnceLock;

/// Points of a tabulated profile.
const RADII: usize = 1024;

/// R_d of one medium, as a table between logarithmic radii, and how to draw radii from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// ln of the first radius in mm, and the step.
    start: f64,
    step: f64,
    /// ln R_d, mm⁻².
    ln_value: Vec<f64>,
    /// Light within each radius, as a share of that within the last.
    within: Vec<f64>,
    /// Light within the last radius.
    total: f64,
    /// σₜᵣ, mm⁻¹.
    sigma_tr: f64,
}

impl Profile {
    /// Tabulates `diffuse_reflectance`, which fills R_d in mm⁻² for radii in mm.
    pub fn new(medium: &Medium, diffuse_reflectance: impl FnOnce(&[f64], &mut [f64])) -> Self {
        let reduced = medium.reduced();
        let path = 1.0 / reduced.coefficients().sigma_t_prime();
        let sigma_tr = (3.0 * reduced.sigma_a / path).sqrt();
        // From far below a transport length to where nothing is left, but not beyond what a
        // solid could measure where nothing absorbs.
        let start = (1e-3 * path).ln();
        let end = (40.0 / sigma_tr.max(1e-4 / path)).max(100.0 * path).ln();
        let step = (end - start) / (RADII - 1) as f64;
        let radii: Vec<f64> = (0..RADII)
            .map(|k| (start + k as f64 * step).exp())
            .collect();
        let mut values = vec![0.0; RADII];
        diffuse_reflectance(&radii, &mut values);
        let ln_value: Vec<f64> = values
            .iter()
            .map(|v| v.max(f64::MIN_POSITIVE).ln())
            .collect();
        let mut table = Self {
            start,
            step,
            ln_value,
            within: vec![],
            total: 0.0,
            sigma_tr,
        };
        // Between two radii ln(r² R_d) is a line in ln r: its integral is a closed form, and the
        // draws follow the very function that `value` returns.
        let mut sum = PI * radii[0] * radii[0] * values[0];
        table.within.push(sum);
        for k in 0..RADII - 1 {
            sum += table.piece(k, 1.0);
            table.within.push(sum);
        }
        table.total = sum;
        for share in &mut table.within {
            *share /= sum;
        }
        table
    }

    /// Power of the radius that r² R_d follows in a piece, and its first value.
    fn law(&self, k: usize) -> (f64, f64) {
        let slope = 2.0 + (self.ln_value[k + 1] - self.ln_value[k]) / self.step;
        let first = (2.0 * (self.start + k as f64 * self.step) + self.ln_value[k]).exp();
        (slope, first)
    }

    /// Light in the first `part` of a piece, in ln r.
    fn piece(&self, k: usize, part: f64) -> f64 {
        let (slope, first) = self.law(k);
        let x = slope * self.step * part;
        let factor = if x.abs() < 1e-8 { 1.0 } else { x.exp_m1() / x };
        TAU * first * self.step * part * factor
    }

    /// R_d, mm⁻².
    pub fn value(&self, radius: f64) -> f64 {
        let place = (radius.ln() - self.start) / self.step;
        if place <= 0.0 {
            return self.ln_value[0].exp();
        }
        let k = place as usize;
        if k >= RADII - 1 {
            return 0.0;
        }
        let f = place - k as f64;
        (self.ln_value[k] * (1.0 - f) + self.ln_value[k + 1] * f).exp()
    }

    /// ∫ R_d 2πr dr of the table.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// The same light where all lengths are shorter by a factor of `per_mm`.
    fn scaled(&self, per_mm: f64) -> Self {
        let shift = per_mm.ln();
        Self {
            start: self.start - shift,
            step: self.step,
            ln_value: self.ln_value.iter().map(|v| v + 2.0 * shift).collect(),
            within: self.within.clone(),
            total: self.total,
            sigma_tr: self.sigma_tr * per_mm,
        }
    }

    /// First and last radius of the table, mm: R_d is the same below, and 0 beyond.
    pub(crate) fn range(&self) -> (f64, f64) {
        let last = self.start + (RADII - 1) as f64 * self.step;
        (self.start.exp(), last.exp())
    }

    /// Mean distance between where light enters and where it leaves, mm.
    pub fn mean_distance(&self) -> f64 {
        let first = 2.0 / 3.0 * self.start.exp() * self.within[0];
        // The middle of a piece, which is short, stands for it.
        let pieces = self.within.windows(2).enumerate();
        let middle = |k: usize| (self.start + (k as f64 + 0.5) * self.step).exp();
        first + pieces.map(|(k, w)| middle(k) * (w[1] - w[0])).sum::<f64>()
    }

    /// A radius whose density is R_d 2πr over the total.
    fn draw(&self, xi: f64) -> f64 {
        let k = self.within.partition_point(|share| *share <= xi);
        if k == 0 {
            return self.start.exp() * (xi / self.within[0]).sqrt();
        }
        let k = (k - 1).min(RADII - 2);
        let share = (xi - self.within[k]) * self.total;
        let (slope, first) = self.law(k);
        let y = share / (TAU * first);
        let along = if (slope * y).abs() < 1e-8 {
            y
        } else {
            (slope * y).ln_1p() / slope
        };
        (self.start + k as f64 * self.step + along.min(self.step)).exp()
    }
}

/// How points are drawn from which light may come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// The paper's: distance from the density σₜᵣ e^(−σₜᵣ d), in the plane of the surface.
    Exponential,
    /// Distance from R_d itself or the exponential, by halves, in planes across the normal and two
    /// axes beside it, and every point that the line across the plane meets; beside them, on
    /// meshes, a point drawn by how much light falls on its triangle. All of their densities
    /// count at each point.
    Axes,
    /// Evenly over the whole surface: the yardstick of the others.
    Area,
}

/// What happens to light at the surface and what each term holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Jensen's S_d: F_t/π, which loses F_dr,ext of the light.
    Paper,
    /// F_t/π over its own cosine integral, which loses none.
    Balanced,
}

/// What one medium does.
#[derive(Clone, Debug, PartialEq)]
pub struct Diffusion {
    /// R_d.
    pub profile: Profile,
    /// Factor on it: 1, or what single scattering leaves of the energy.
    pub share: f64,
    /// How far below the surface the light is thought to come from, mm: the distance to there
    /// counts on curved surfaces. 0 for a profile that has no such source.
    pub source_depth_mm: f64,
}

/// The diffusion of every medium that a channel of a solid has.
///
/// A medium is a scale of lengths, 1/σₜ′, and α′: under a texture there are tables over α′, of media
/// with a σₜ′ of 1 mm⁻¹, and what is asked for lies between two of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Family {
    /// √(1 − α′) of each table, increasing; none where there is but one medium.
    roots: Vec<f64>,
    /// The tables; under a texture over α′.
    tables: Vec<Diffusion>,
}

impl From<Diffusion> for Family {
    /// That of a medium that is the same everywhere.
    fn from(diffusion: Diffusion) -> Self {
        Self {
            roots: vec![],
            tables: vec![diffusion],
        }
    }
}

/// Ratio of √(1 − α′) between tables: far from the source, at ten times 1/σₜᵣ, what lies between is
/// 0.3 % off, and less where there is more light.
const ROOT_RATIO: f64 = 1.05;
/// Below this √(1 − α′) the next table is that of a medium without absorption.
const LEAST_ROOT: f64 = 1e-3;
/// Media with a smaller α′ are taken to be as this one, but for α′ itself: all is single scattering.
const LEAST_ALBEDO: f64 = 1e-3;

impl Family {
    /// The α′ of which [`Self::between`] needs tables so that those between `ends` are met.
    pub fn albedos(ends: [f64; 2]) -> Vec<f64> {
        let root = |albedo: f64| (1.0 - albedo.clamp(LEAST_ALBEDO, 1.0)).sqrt();
        let [first, last] = [root(ends[1]), root(ends[0])];
        let mut roots = vec![first];
        if first < LEAST_ROOT && last > first {
            roots = vec![0.0, LEAST_ROOT.min(last)];
        }
        let start = roots[roots.len() - 1];
        let count = ((last / start).ln() / ROOT_RATIO.ln()).ceil().max(0.0) as usize;
        let ratio = (last / start).powf(1.0 / count.max(1) as f64);
        roots.extend((1..=count).map(|k| start * ratio.powi(k as i32)));
        roots.into_iter().map(|root| 1.0 - root * root).collect()
    }

    /// From the diffusion of media with a σₜ′ of 1 mm⁻¹ and these α′, which decrease.
    ///
    /// # Panics
    ///
    /// If the lists are not of one length.
    pub fn between(albedos: &[f64], mut tables: Vec<Diffusion>) -> Self {
        assert_eq!(albedos.len(), tables.len());
        for (table, albedo) in tables.iter_mut().zip(albedos) {
            table.share /= albedo;
        }
        Self {
            roots: albedos.iter().map(|a| (1.0 - a).max(0.0).sqrt()).collect(),
            tables,
        }
    }

    /// Its tables.
    pub(crate) fn tables(&self) -> &[Diffusion] {
        &self.tables
    }

    /// The diffusion of one of its media.
    pub(crate) fn of(&self, medium: &Medium) -> Local<'_> {
        if self.roots.is_empty() {
            return self.local(0, 0.0, 1.0, 1.0);
        }
        let coefficients = medium.reduced().coefficients();
        let albedo = coefficients.albedo_prime();
        let root = (1.0 - albedo).max(0.0).sqrt();
        let last = self.roots.len() - 1;
        let next = self.roots.partition_point(|r| *r <= root);
        let (table, part) = match next {
            0 => (0, 0.0),
            next if next > last => (last, 0.0),
            next => {
                let (low, high) = (self.roots[next - 1], self.roots[next]);
                (next - 1, (root - low) / (high - low))
            }
        };
        self.local(table, part, coefficients.sigma_t_prime(), albedo)
    }

    fn local(&self, table: usize, part: f64, per_mm: f64, albedo: f64) -> Local<'_> {
        Local {
            family: self,
            table,
            part,
            per_mm,
            albedo,
            per_square: per_mm * per_mm,
            source_depth_mm: self.tables[table].source_depth_mm / per_mm,
        }
    }
}

/// Square of the distance at which R_d of a plane is taken between where light enters and a
/// point whose offset from there has the square `square` and the part `along` the normal.
///
/// The real source is a transport length below where light enters; it is never nearer than
/// that, as the paper has it for curved surfaces. On a plane this is the distance along it.
#[inline]
pub(crate) fn square_of_distance(square: f64, along: f64, source_depth_mm: f64) -> f64 {
    (square + 2.0 * source_depth_mm * along).max(0.0)
}

/// The diffusion of one medium of a [`Family`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Local<'a> {
    family: &'a Family,
    /// The table before, and how far on the way to the next.
    table: usize,
    part: f64,
    /// Lengths of the tables for each mm.
    per_mm: f64,
    /// Factor on the tables.
    albedo: f64,
    per_square: f64,
    source_depth_mm: f64,
}

impl Local<'_> {
    /// Between the values of the two tables, on a line in the logarithms if there is light in both.
    #[inline]
    fn mixed(&self, of_table: impl Fn(usize) -> f64) -> f64 {
        let here = of_table(self.table);
        if self.part == 0.0 {
            return here;
        }
        let next = of_table(self.table + 1);
        if here > 0.0 && next > 0.0 {
            here.powf(1.0 - self.part) * next.powf(self.part)
        } else {
            here + self.part * (next - here)
        }
    }

    /// R_d with its share at the square of a distance, mm⁻², `of_table` being that of a table at
    /// the square of a distance in its own lengths.
    #[inline]
    pub(crate) fn spread_by(&self, square: f64, of_table: impl Fn(usize, f64) -> f64) -> f64 {
        let own = square * self.per_square;
        self.factor() * self.mixed(|table| of_table(table, own))
    }

    /// [`Self::spread_by`] from the tables themselves.
    pub(crate) fn spread(&self, square: f64) -> f64 {
        let tables = &self.family.tables;
        self.spread_by(square, |table, square| {
            tables[table].share * tables[table].profile.value(square.sqrt())
        })
    }

    /// [`square_of_distance`] for its own source.
    #[inline]
    pub(crate) fn square_of_distance(&self, square: f64, along: f64) -> f64 {
        square_of_distance(square, along, self.source_depth_mm)
    }

    /// The table before, and how far on the way to the next.
    pub(crate) fn between(&self) -> (usize, f64) {
        (self.table, self.part)
    }

    /// Factor on what the tables have.
    pub(crate) fn factor(&self) -> f64 {
        self.albedo * self.per_square
    }

    /// Squares of the lengths of the tables for each mm².
    pub(crate) fn per_square(&self) -> f64 {
        self.per_square
    }

    /// How far below the surface the light is thought to come from, mm.
    pub(crate) fn source_depth_mm(&self) -> f64 {
        self.source_depth_mm
    }

    /// All that leaves of the light that enters.
    pub(crate) fn total(&self) -> f64 {
        let tables = &self.family.tables;
        self.albedo * self.mixed(|table| tables[table].share * tables[table].profile.total)
    }

    /// Mean distance between where light enters and where it leaves, mm.
    pub(crate) fn mean_distance(&self) -> f64 {
        let tables = &self.family.tables;
        self.mixed(|table| tables[table].profile.mean_distance()) / self.per_mm
    }

    /// It by itself.
    fn alone(&self) -> Diffusion {
        let nearest = self.table + usize::from(self.part > 0.5);
        let Diffusion {
            ref profile, share, ..
        } = self.family.tables[nearest];
        Diffusion {
            profile: profile.scaled(self.per_mm),
            share: share * self.albedo,
            source_depth_mm: self.source_depth_mm,
        }
    }
}

/// The BSSRDF of all solids of a scene.
///
/// Under a texture the diffusion is that of the medium where light enters, and light that scattered
/// once meets on its way out the medium where it leaves, and on its way in that where it enters
/// (Jensen et al. 2001, section 4).
pub struct Bssrdf {
    of_object: Vec<Vec<Family>>,
    /// Of each solid: the diffusions by which points are drawn, all together.
    drawn_by: Vec<Vec<Diffusion>>,
    /// Of each solid and channel: what F_t of the way out is multiplied by.
    leaving: Vec<Vec<f64>>,
    single: bool,
    sampling: Sampling,
    /// Of each mesh, from the first draw on.
    triangles: Vec<OnceLock<Weighted>>,
}

/// Share of the radii that are drawn evenly from the disk in which a source may be right below.
const CURVED: f64 = 0.3;
/// Share of the radii that are drawn from the exponential.
const FAR: f64 = 0.3;
/// A drawn point that may bring this share of the light of an even surface looks for lamps.
const SURE_SHARE: f64 = 0.1;
/// Lengths that are drawn for light that scattered once.
const PARTS: u32 = 2;
/// Optical thickness from which it hardly comes through.
const THICK: f64 = 16.0;

impl Bssrdf {
    /// From the diffusion of each solid and channel; `single` says whether light that scattered
    /// once is added, or is in the diffusion already.
    ///
    /// # Panics
    ///
    /// If the lists do not fit the scene.
    pub fn new(
        scene: &Scene,
        of_object: Vec<Vec<impl Into<Family>>>,
        exit: Exit,
        single: bool,
        sampling: Sampling,
    ) -> Self {
        let families = |list: Vec<_>| list.into_iter().map(Into::into).collect();
        let of_object: Vec<Vec<Family>> = of_object.into_iter().map(families).collect();
        scene.assert_one_each(&of_object);
        let drawn_by = |(object, families): (&Object, &Vec<Family>)| {
            let families = families.iter().enumerate();
            families
                .flat_map(|(channel, family)| {
                    let media = object.material.representatives(channel);
                    media.into_iter().map(|m| family.of(&m).alone())
                })
                .collect()
        };
        let drawn_by = scene.objects.iter().zip(&of_object).map(drawn_by).collect();
        let leaving = |object: &Object| {
            let of_medium = |medium: &Medium| match exit {
                Exit::Paper => 1.0 / PI,
                Exit::Balanced => {
                    let eta = medium.eta;
                    fresnel::exit_factor(eta, 1.0) / fresnel::entry_factor(eta, 1.0) / PI
                }
            };
            object.material.media.iter().map(of_medium).collect()
        };
        let leaving = scene.objects.iter().map(leaving).collect();
        Self {
            of_object,
            drawn_by,
            leaving,
            single,
            sampling,
            triangles: vec![OnceLock::new(); scene.objects.len()],
        }
    }

    /// Shares of the radii that are drawn from R_d itself, evenly from the disk in which a source
    /// may be right below, and from the exponential.
    fn shares(&self, model: &Diffusion) -> [f64; 3] {
        // On a curved surface the source may be nearer than the plane of the axis has it: the
        // other two fall more slowly and keep the weights bounded there.
        match self.sampling {
            Sampling::Axes => {
                let curved = if model.source_depth_mm > 0.0 {
                    CURVED
                } else {
                    0.0
                };
                let far = if model.profile.sigma_tr > 0.0 {
                    FAR
                } else {
                    0.0
                };
                [1.0 - curved - far, curved, far]
            }
            Sampling::Exponential | Sampling::Area => [0.0, 0.0, 1.0],
        }
    }

    /// Points from which diffuse light may come to `to`, each with one over the density per area
    /// in which such points are drawn; at least those whose [`square_of_distance`] is below `near`.
    fn draw(&self, scene: &Scene, to: &Point, near: f64, rng: &mut Stream) -> Vec<(Point, f64)> {
        let object = &scene.objects[to.object];
        let triangles = |new: &dyn Fn(&Mesh) -> Weighted| match &object.shape {
            Shape::Mesh(mesh) => {
                let triangles = self.triangles[to.object].get_or_init(|| new(mesh));
                Some((mesh, triangles))
            }
            _ => None,
        };
        let lit = match self.sampling {
            Sampling::Area => {
                triangles(&|mesh| Weighted::new(mesh.len(), |k| mesh.corners(k), |_| 1.0))
            }
            Sampling::Axes if near.is_infinite() => triangles(&|mesh| {
                Weighted::by_light(scene, to.object, mesh.len(), |k| (mesh.corners(k), k))
            }),
            Sampling::Axes | Sampling::Exponential => None,
        };
        let drawn = |mesh: &Mesh, triangles: &Weighted, rng: &mut Stream| {
            let face = triangles.draw(rng);
            let corners = mesh.corners(face);
            let at = in_triangle(corners, rng);
            (
                Point::on_triangle(scene, to.object, face, corners, at),
                face,
            )
        };
        if self.sampling == Sampling::Area {
            return match (&object.shape, lit) {
                (_, Some((mesh, triangles))) => {
                    let (point, face) = drawn(mesh, triangles, rng);
                    vec![(point, 1.0 / triangles.density(face))]
                }
                (Shape::Sphere(ball), _) => {
                    let normal = crate::light::on_sphere(rng);
                    let hit = Hit {
                        distance: 0.0,
                        normal,
                        face: 0,
                    };
                    let place = ball.center + ball.radius * normal;
                    let area = 4.0 * PI * ball.radius * ball.radius;
                    vec![(Point::new(scene, to.object, place, &hit), area)]
                }
                // Nothing else has to be a yardstick.
                _ => vec![],
            };
        }
        let (u, v) = to.true_normal.any_orthonormal_pair();
        let axes: &[(Vec3, f64)] = match self.sampling {
            Sampling::Exponential | Sampling::Area => &[(to.true_normal, 1.0)],
            Sampling::Axes => &[(to.true_normal, 0.7), (u, 0.15), (v, 0.15)],
        };
        let mut found = vec![];
        if let Some((through, axis)) = self.line(to, axes, rng)
            && (through - to.at).length() < self.within(to.object, near)
        {
            for (place, hit) in crossings(&object.shape, through, axis) {
                found.push((Point::new(scene, to.object, place, &hit), hit.face));
            }
        }
        if let Some((mesh, triangles)) = lit {
            found.push(drawn(mesh, triangles, rng));
        }
        // All points that are drawn together have the sum of their densities (Campbell's theorem):
        // nothing has to be known of how many a line meets.
        let per_density = |(point, face): (Point, usize)| {
            let by_light = lit.map_or(0.0, |(_, triangles)| triangles.density(face));
            let density = by_light + self.density(to, &point, axes);
            (density > 0.0).then(|| (point, 1.0 / density))
        };
        found.into_iter().filter_map(per_density).collect()
    }

    /// A line across the plane of one of the axes, at a distance from `to` that is drawn.
    fn line(&self, to: &Point, axes: &[(Vec3, f64)], rng: &mut Stream) -> Option<(Vec3, Vec3)> {
        let drawn_by = &self.drawn_by[to.object];
        let pick = uniform(rng);
        let mut sum = 0.0;
        let &(axis, _) = axes.iter().find(|(_, share)| {
            sum += share;
            pick < sum
        })?;
        // One profile serves all, with the mean of their densities.
        let one = ((uniform(rng) * drawn_by.len() as f64) as usize).min(drawn_by.len() - 1);
        let xi = uniform(rng);
        let model = &drawn_by[one];
        let [own, curved, _] = self.shares(model);
        let way = uniform(rng);
        let radius = if way < own {
            model.profile.draw(xi)
        } else if way < own + curved {
            2.0 * model.source_depth_mm * xi.sqrt()
        } else {
            -(1.0 - xi).ln() / model.profile.sigma_tr
        };
        if !radius.is_finite() {
            return None;
        }
        let (a, b) = axis.any_orthonormal_pair();
        let (sin, cos) = (TAU * uniform(rng)).sin_cos();
        Some((to.at + radius * (cos * a + sin * b), axis))
    }

    /// How many points [`Self::line`] finds at `from`, mm⁻².
    fn density(&self, to: &Point, from: &Point, axes: &[(Vec3, f64)]) -> f64 {
        let drawn_by = &self.drawn_by[to.object];
        let of_radius = |radius: f64| {
            let of_one = |d: &Diffusion| {
                let [own, curved, far] = self.shares(d);
                let s = d.profile.sigma_tr;
                let most = 2.0 * d.source_depth_mm;
                let mut density = 0.0;
                if own > 0.0 {
                    density += own * d.profile.value(radius) / d.profile.total;
                }
                if curved > 0.0 && radius < most {
                    density += curved / (PI * most * most);
                }
                if far > 0.0 {
                    density += far * s * (-s * radius).exp() / (TAU * radius);
                }
                density
            };
            drawn_by.iter().map(of_one).sum::<f64>() / drawn_by.len() as f64
        };
        let offset = from.at - to.at;
        let of_axis = |(axis, share): &(Vec3, f64)| {
            let across = (offset - offset.dot(*axis) * axis).length();
            share * of_radius(across) * from.true_normal.dot(*axis).abs()
        };
        axes.iter().map(of_axis).sum()
    }

    /// Length within which all points are whose [`square_of_distance`] is below `near`: of the
    /// offset o the part along a normal is at least −|o|.
    fn within(&self, object: usize, near: f64) -> f64 {
        let depths = self.drawn_by[object].iter().map(|d| d.source_depth_mm);
        let depth = depths.fold(0.0, f64::max);
        (depth + (depth * depth + near).sqrt()) * (1.0 + 1e-9)
    }

    /// The diffusions by which points of a solid are drawn, those of all its media or of the ones
    /// that are farthest apart.
    pub(crate) fn drawn_by(&self, object: usize) -> &[Diffusion] {
        &self.drawn_by[object]
    }

    /// How points are drawn.
    pub(crate) fn sampling(&self) -> Sampling {
        self.sampling
    }

    /// The diffusion of the medium at a point, by channel.
    pub(crate) fn at<'a>(
        &'a self,
        object: usize,
        media: &'a [Medium],
    ) -> impl Iterator<Item = Local<'a>> {
        let families = self.of_object[object].iter();
        families
            .zip(media)
            .map(|(family, medium)| family.of(medium))
    }

    /// The diffusion of a solid, by channel.
    pub(crate) fn of_object(&self, object: usize) -> &[Family] {
        &self.of_object[object]
    }

    /// Radiance toward a cosine for each unit of exitance.
    pub(crate) fn leaves(&self, object: usize, channel: usize, eta: f64, cos_out: f64) -> f64 {
        fresnel::entry_factor(eta, cos_out) * self.leaving[object][channel]
    }

    /// Light that scattered once, if it is not in the diffusion already.
    pub(crate) fn single(
        &self,
        scene: &Scene,
        point: &Point,
        view: Vec3,
        rng: &mut Stream,
        out: &mut [f64],
    ) {
        if self.single {
            self.once(scene, point, view, rng, out);
        }
    }

    /// Diffuse light of beams and, of other lamps, all or that which enters `near`: where the square
    /// of the distance that [`square_of_distance`] has is below that of the channel, mm².
    pub(crate) fn diffuse(
        &self,
        scene: &Scene,
        point: &Point,
        view: Vec3,
        near: Option<&[f64]>,
        rng: &mut Stream,
        out: &mut [f64],
    ) {
        let media = &scene.objects[point.object].material.media;
        let cos_out = view.dot(point.normal).clamp(0.0, 1.0);
        let leaves = media.iter().enumerate();
        let leaves: Vec<f64> = leaves
            .map(|(channel, medium)| self.leaves(point.object, channel, medium.eta, cos_out))
            .collect();
        let mut add = |index: usize, from: &Point, spread: &[f64], toward: Vec3, power: f64| {
            let cos_in = toward.dot(from.normal).clamp(0.0, 1.0);
            for (channel, medium) in media.iter().enumerate() {
                out[channel] += power
                    * scene.lamps[index].strength[channel]
                    * fresnel::entry_factor(medium.eta, cos_in)
                    * spread[channel]
                    * leaves[channel];
            }
        };
        // Diffuse radiance for each unit of power that enters there, over π times the factor of
        // exit, mm⁻², and what share of all that leaves of it this is, per area.
        let mut spread = vec![0.0; media.len()];
        let reach = |from: &Point, near: Option<&[f64]>, spread: &mut [f64]| {
            let offset = point.at - from.at;
            let (square, along) = (offset.length_squared(), offset.dot(from.true_normal));
            let media = scene.media(from);
            let mut most = 0.0_f64;
            let channels = spread.iter_mut().zip(self.at(point.object, &media));
            for (channel, (spread, local)) in channels.enumerate() {
                let square = local.square_of_distance(square, along);
                let wanted = near.is_none_or(|near| square < near[channel]);
                *spread = if wanted { local.spread(square) } else { 0.0 };
                most = most.max(*spread / local.total());
            }
            most
        };
        // A beam lights a spot that no drawing of points would find: its rays are drawn instead.
        let mut others = false;
        for (index, lamp) in scene.lamps.iter().enumerate() {
            if !lamp.light.is_beam() {
                others = true;
                continue;
            }
            let ray = lamp.light.emit(scene.reach(), rng);
            if let Some((object, hit)) = scene.enter(ray.origin, ray.direction)
                && object == point.object
            {
                let at = ray.origin + hit.distance * ray.direction;
                let from = Point::new(scene, object, at, &hit);
                reach(&from, None, &mut spread);
                add(index, &from, &spread, -ray.direction, ray.power);
            }
        }
        let farthest = near.map_or(f64::INFINITY, |near| {
            near.iter().copied().fold(0.0, f64::max)
        });
        if others && farthest > 0.0 {
            for (from, per_density) in self.draw(scene, point, farthest, rng) {
                // How much of the light that the point gives back this is, at most over the
                // channels. Lamps are not looked for in vain: roulette takes what is little.
                let share = reach(&from, near, &mut spread) * per_density;
                let kept = (share / SURE_SHARE).min(1.0);
                if uniform(rng) >= kept {
                    continue;
                }
                for (index, lamp) in scene.lamps.iter().enumerate() {
                    if lamp.light.is_beam() {
                        continue;
                    }
                    if let Some(incident) = arrives(scene, index, &from, rng) {
                        let cos_in = incident.toward.dot(from.normal).min(1.0);
                        let power = per_density / kept * incident.irradiance * cos_in;
                        add(index, &from, &spread, incident.toward, power);
                    }
                }
            }
        }
    }

    /// Light that scattered once on the refracted ray, its way from the lamp taken as straight
    /// and its length inside as Snell's law would have it.
    fn once(&self, scene: &Scene, point: &Point, view: Vec3, rng: &mut Stream, out: &mut [f64]) {
        let object = &scene.objects[point.object];
        let media = &*scene.media(point);
        // Indices differ little between channels; the ray is that of the first.
        let inside = part(-view, point.normal, media[0].eta).refracted;
        if inside.dot(point.true_normal) >= 0.0 {
            return;
        }
        let Some(far) = object.shape.leave(point.at, inside).or(Some(Hit {
            distance: f64::INFINITY,
            normal: Vec3::ZERO,
            face: 0,
        })) else {
            return;
        };
        let cos_out = view.dot(point.normal).clamp(0.0, 1.0);
        if far.distance <= 0.0 {
            return;
        }
        for nth in 0..PARTS {
            // One length from each part of what is drawn.
            let share = (f64::from(nth) + uniform(rng)) / f64::from(PARTS);
            let drawn = length_inside(media, far.distance, share);
            for lamp in &scene.lamps {
                // Where a beam crosses the ray is known.
                let (s, per_density) = match lamp.light {
                    Light::Beam {
                        from,
                        direction,
                        spot,
                    } => {
                        let Some((first, last)) =
                            within_beam(point.at, inside, from, direction, spot)
                        else {
                            continue;
                        };
                        let (first, last) = (first.max(0.0), last.min(far.distance));
                        if first >= last {
                            continue;
                        }
                        (first + (last - first) * share, last - first)
                    }
                    _ => drawn,
                };
                let place = point.at + s * inside;
                let Some(incident) = lamp.light.shine(place, None, rng) else {
                    continue;
                };
                let found = through_surface(scene, point.object, place, &incident);
                let Some((at, hit)) = found else {
                    continue;
                };
                let entry = Point::new(scene, point.object, at, &hit);
                let normal = entry.normal;
                let cos_in = incident.toward.dot(normal);
                if cos_in <= 0.0 {
                    continue;
                }
                let entered = scene.media(&entry);
                for (channel, (medium, entered)) in media.iter().zip(&*entered).enumerate() {
                    let &Medium {
                        sigma_s, eta, g, ..
                    } = medium;
                    let arriving = part(-incident.toward, normal, eta);
                    let Some(inner) = fresnel::refracted_cos(eta, cos_in.min(1.0)) else {
                        continue;
                    };
                    let length = hit.distance * cos_in / inner;
                    let phase = HenyeyGreenstein { g }.density(-arriving.refracted.dot(inside));
                    let depth = medium.sigma_t() * s + entered.sigma_t() * length;
                    out[channel] += lamp.strength[channel] * incident.irradiance * per_density
                        / f64::from(PARTS)
                        * (1.0 - arriving.reflectance)
                        * (cos_in / inner)
                        * sigma_s
                        * phase
                        * (-depth).exp()
                        * fresnel::entry_factor(eta, cos_out)
                        / (eta * eta);
                }
            }
        }
    }
}

impl Shader for Bssrdf {
    fn shade(
        &self,
        scene: &Scene,
        point: &Point,
        view: Vec3,
        rng: &mut Stream,
        single: &mut [f64],
        diffuse: &mut [f64],
    ) {
        self.diffuse(scene, point, view, None, rng, diffuse);
        self.single(scene, point, view, rng, single);
    }
}

/// A length of the way inside at which light may have scattered once, of a draw between 0 and 1, and
/// one over its density, mm: as light that comes from the front falls off in one of the media or,
/// where the solid is not much thicker than a few mean free paths and light may come through it,
/// evenly.
fn length_inside(media: &[Medium], far: f64, share: f64) -> (f64, f64) {
    let count = media.len() as f64;
    let thickness = far * media.iter().map(Medium::sigma_t).sum::<f64>() / count;
    let even = 0.5 / (1.0 + (thickness / THICK).powi(2));
    // What of an exponential is within.
    let inside = |m: &Medium| -(-m.sigma_t() * far).exp_m1();
    let length = if share < even {
        far * share / even
    } else {
        let place = (share - even) / (1.0 - even) * count;
        let medium = &media[(place as usize).min(media.len() - 1)];
        -(-place.fract() * inside(medium)).ln_1p() / medium.sigma_t()
    };
    let falling = |m: &Medium| m.sigma_t() * (-m.sigma_t() * length).exp() / inside(m);
    let falling = media.iter().map(falling).sum::<f64>() / count;
    let evenly = if even > 0.0 { even / far } else { 0.0 };
    (length, 1.0 / (evenly + (1.0 - even) * falling))
}

/// Where a ray is inside a beam: first and last length.
fn within_beam(
    origin: Vec3,
    direction: Vec3,
    from: Vec3,
    axis: Vec3,
    spot: Spot,
) -> Option<(f64, f64)> {
    let offset = origin - from;
    let start = offset - offset.dot(axis) * axis;
    let along = direction - direction.dot(axis) * axis;
    let (a, b) = (along.length_squared(), start.dot(along));
    let c = start.length_squared() - spot.extent().powi(2);
    if a < 1e-18 {
        return (c < 0.0).then_some((0.0, f64::MAX));
    }
    let square = b * b - a * c;
    (square > 0.0).then(|| ((-b - square.sqrt()) / a, (-b + square.sqrt()) / a))
}

/// Every point in which a line crosses the surface of a solid.
fn crossings(shape: &Shape, through: Vec3, axis: Vec3) -> Vec<(Vec3, Hit)> {
    if let Shape::Mesh(mesh) = shape {
        return mesh.crossings(through, axis);
    }
    let Some((low, high)) = shape.bounds() else {
        // A half-space: once, from the outside.
        let hit = [axis, -axis].into_iter().find_map(|direction| {
            let far = through - 1e4 * direction;
            let hit = shape.enter(far, direction)?;
            Some((far + hit.distance * direction, hit))
        });
        return hit.into_iter().collect();
    };
    let size = (high - low).length();
    let back = (through - 0.5 * (low + high)).length() + size;
    let mut at = through - back * axis;
    let mut found = vec![];
    let mut outside = true;
    // Twice: the solid is convex.
    while found.len() < 2 {
        let hit = if outside {
            shape.enter(at, axis)
        } else {
            shape.leave(at, axis)
        };
        let Some(hit) = hit else { break };
        at += hit.distance * axis;
        found.push((at, hit));
        outside = !outside;
    }
    found
}

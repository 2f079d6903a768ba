//! How wrong a closed form is: its error against the transport equation, carried as a correlated
//! discrepancy.
//!
//! `data/discrepancy.csv` holds, for each model, the relative error of R_d and of the light within
//! a radius at nodes of η, g, k = √(3(1 − α′)) and ln ρ, ρ = σₜ′r: the training set. At a medium
//! between its nodes the error is taken as
//!
//! s·Σ_g z_g δ_g(ρ) + l·a(ρ)·(a Gaussian process in ln ρ of unit variance),
//!
//! with one unknown z_g of mean 0 and variance 1 for each g of the training set, since a closed
//! form knows no g, and a(ρ) the root mean square of δ_g over g. The first terms are the shapes
//! that the error has; the last lets it be another one: a phase function that is not Henyey and
//! Greenstein's, a medium between the nodes. The total has the same terms, and a loose one of its
//! own.
//!
//! The example `discrepancy` fills the file, and the example `coverage` judges it on media that
//! are not in it.

use crate::library::ModelChoice;
use fit::{Direction, DirectionKind};
use physics::{Coefficients, ProfilePoint, RadialProfile, TotalReflectance};
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// The line of a budget that it becomes.
const SOURCE: &str = "model error";

const TABLE: &str = include_str!("../../../data/discrepancy.csv");

/// Relative indices of the training set.
pub const ETA: [f64; 4] = [1.0, 1.2, 1.4, 1.6];
/// Mean cosines of the training set.
pub const G: [f64; 3] = [0.0, 0.7, 0.93];
/// √(3(1 − α′)) of the training set.
pub const K: [f64; 13] = [
    0.003, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0, 1.2, 1.45, 1.65,
];
/// First and last node of ln ρ, and how many there are.
pub const LN_RADIUS: (f64, f64, usize) = (-3.0, 6.0, 25);
/// Knots of the loose part in ln ρ, over the same stretch.
const KNOTS: usize = 13;
/// Length of its correlation in ln ρ.
const LENGTH: f64 = 0.7;
/// How the errors of a model are spread around those of the training set.
#[derive(Clone, Copy, Debug)]
struct Spread {
    /// Standard deviation of the shapes' coefficients, of which each of the training set's own
    /// errors has one that is 1.
    shape: f64,
    /// Standard deviation of the loose part over that of the shapes that the training set has, in
    /// bright media and in dark ones, where the shapes themselves move fast with medium and radius.
    loose: (f64, f64),
    /// What is left of the error from one ring to the next, relative.
    grain: f64,
}

/// Forms whose error is tens of percent where diffusion begins.
const ROUGH: Spread = Spread {
    shape: 1.5,
    loose: (0.25, 0.6),
    grain: 0.002,
};
/// Forms whose error is a few percent there, and smooth from one medium to the next: what ROUGH
/// says covers them always.
const FINE: Spread = Spread {
    shape: 1.0,
    loose: (0.025, 0.06),
    grain: 0.001,
};
/// √(3(1 − α′)) halfway between the two.
const DARK: f64 = 0.7;
/// Least standard deviation of the loose part, relative: the transport table's own error, and
/// what lies between nodes.
const LEAST: f64 = 0.003;
/// Far out a dark medium's R_d is wrong by powers of ten, and weighs nothing from here on.
const LARGEST: f64 = 5.0;

/// Numbers of one medium of the training set: R_d's at every node, then those of the light within.
const PER_MEDIUM: usize = 2 * LN_RADIUS.2;
const WAYS: usize = G.len() + KNOTS + 1;

/// Radii of the nodes in units of 1/σₜ′.
pub fn radii() -> impl Iterator<Item = f64> {
    let (first, last, count) = LN_RADIUS;
    (0..count).map(move |i| (first + (last - first) * i as f64 / (count - 1) as f64).exp())
}

/// The relative error of `found` as a model of `truth`, as the table holds it.
pub fn relative_error(truth: f64, found: f64) -> f64 {
    (truth / found - 1.0).clamp(-1.0, LARGEST)
}

/// Errors by model; each by η, then k, then g.
type Tables = BTreeMap<&'static str, Vec<[f64; PER_MEDIUM]>>;

fn tables() -> &'static Tables {
    static TABLES: OnceLock<Tables> = OnceLock::new();
    TABLES.get_or_init(|| {
        let mut tables = Tables::new();
        for line in TABLE.lines().skip(1) {
            let mut cells = line.split(',');
            let model = cells.next().expect("a line has a first cell");
            let numbers: Vec<f64> = cells
                .skip(3)
                .map(|cell| cell.parse().expect("the tests read the shipped table"))
                .collect();
            let numbers = numbers
                .try_into()
                .expect("the tests read the shipped table");
            tables.entry(model).or_default().push(numbers);
        }
        tables
    })
}

/// What the table calls a model. One that uses g has another error where it is not told it.
pub fn entry(model: &ModelChoice) -> &str {
    match (model.name.as_str(), model.g) {
        ("photon-beam-diffusion", None) => "photon-beam-diffusion without g",
        (name, _) => name,
    }
}

fn spread(model: &ModelChoice) -> Spread {
    match model.name.as_str() {
        "better-dipole" | "photon-beam-diffusion" => FINE,
        _ => ROUGH,
    }
}

/// The node below `x` among ascending `nodes`, and the place from there to the next, 0 to 1.
fn locate(nodes: &[f64], x: f64) -> (usize, f64) {
    let below = nodes.partition_point(|n| *n <= x).clamp(1, nodes.len() - 1) - 1;
    let place = (x - nodes[below]) / (nodes[below + 1] - nodes[below]);
    (below, place.clamp(0.0, 1.0))
}

/// The place of ln ρ among `count` even nodes: the first of four, and their weights in the cubic
/// of Catmull and Rom; constant beyond the ends.
fn cubic(ln_radius: f64, count: usize) -> [(usize, f64); 4] {
    let (first, last, _) = LN_RADIUS;
    let place = (ln_radius - first) / (last - first) * (count - 1) as f64;
    let place = place.clamp(0.0, (count - 1) as f64);
    let below = (place as usize).min(count - 2);
    let t = place - below as f64;
    let weights = [
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (0.5 * t - 0.5),
    ];
    let node = |i: usize| (below + i).saturating_sub(1).min(count - 1);
    [0, 1, 2, 3].map(|i| (node(i), weights[i]))
}

/// The error that a closed form has near a medium.
#[derive(Clone, Debug)]
pub struct Discrepancy {
    near: Coefficients,
    spread: Spread,
    /// By g: R_d's relative error at every node, then that of the light within.
    errors: [[f64; PER_MEDIUM]; G.len()],
    /// Factor of the correlation matrix of the loose part between its knots.
    factor: [[f64; KNOTS]; KNOTS],
}

impl Discrepancy {
    /// Whether the error of the model was found.
    pub fn is_known(model: &ModelChoice) -> bool {
        tables().contains_key(entry(model))
    }

    /// That of the model at relative index `eta` near a medium; `None` where none was found for it.
    ///
    /// It is taken there wherever a fit looks: a form that is wrong by tens of percent does not
    /// find the medium whose error it has.
    pub fn of(model: &ModelChoice, eta: f64, near: Coefficients) -> Option<Self> {
        let table = tables().get(entry(model))?;
        let (eta, in_eta) = locate(&ETA, eta);
        let k = (3.0 * (1.0 - near.albedo_prime())).max(0.0).sqrt();
        let (k, in_k) = locate(&K, k);
        let medium = |eta: usize, k: usize, g: usize| &table[(eta * K.len() + k) * G.len() + g];
        let mix = |place: f64, low: f64, high: f64| low + place * (high - low);
        let error = |g: usize, i: usize| {
            let at = |k: usize| mix(in_eta, medium(eta, k, g)[i], medium(eta + 1, k, g)[i]);
            mix(in_k, at(k), at(k + 1))
        };
        Some(Self {
            near,
            spread: spread(model),
            errors: std::array::from_fn(|g| std::array::from_fn(|i| error(g, i))),
            factor: correlation_factor(),
        })
    }

    /// How many independent ways there are in which the model may be wrong.
    pub const WAYS: usize = WAYS;

    fn ln_radius(&self, radius: f64) -> f64 {
        (self.near.sigma_t_prime() * radius).max(1e-9).ln()
    }

    /// Standard deviation of the loose part beside errors of these sizes.
    fn loose(&self, errors: &[f64]) -> f64 {
        let mean = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        let k2 = 3.0 * (1.0 - self.near.albedo_prime());
        let dark = k2 / (k2 + DARK * DARK);
        let (bright, in_dark) = self.spread.loose;
        LEAST.hypot((bright + dark * (in_dark - bright)) * mean.sqrt())
    }

    /// R_d's relative error, or that of the light within, for each g.
    fn errors(&self, ln_radius: f64, within: bool) -> [f64; G.len()] {
        let offset = if within { LN_RADIUS.2 } else { 0 };
        let terms = cubic(ln_radius, LN_RADIUS.2);
        std::array::from_fn(|g| {
            let terms = terms.iter();
            terms.map(|(i, w)| w * self.errors[g][offset + i]).sum()
        })
    }

    /// The relative error of R_d at `radius` mm for one standard deviation of each way.
    pub fn relative(&self, radius: f64) -> [f64; WAYS] {
        let ln_radius = self.ln_radius(radius);
        let errors = self.errors(ln_radius, false);
        let mut ways = [0.0; WAYS];
        for (way, error) in ways.iter_mut().zip(&errors) {
            *way = self.spread.shape * error;
        }
        let size = self.loose(&errors);
        for (knot, weight) in cubic(ln_radius, KNOTS) {
            for (way, factor) in ways[G.len()..].iter_mut().zip(&self.factor[knot]) {
                *way += size * weight * factor;
            }
        }
        ways
    }

    /// The relative error of the light within `radius` mm for one standard deviation of each way.
    pub fn relative_within(&self, radius: f64) -> [f64; WAYS] {
        let errors = self.errors(self.ln_radius(radius), true);
        let mut ways = [0.0; WAYS];
        for (way, error) in ways.iter_mut().zip(&errors) {
            *way = self.spread.shape * error;
        }
        ways[WAYS - 1] = self.loose(&errors);
        ways
    }

    /// The same for a fit of data of which the model says `profile` and `total` near the medium:
    /// in their own units, since an error of several times the model's value must not grow as a
    /// fit makes that value grow.
    pub(crate) fn directions(
        &self,
        points: &[ProfilePoint],
        profile: &[f64],
        total: Option<(f64, f64)>,
    ) -> Vec<Direction> {
        let relative: Vec<[f64; WAYS]> =
            points.iter().map(|p| self.relative(p.radius_mm)).collect();
        let total = total.map_or([0.0; WAYS], |(radius, value)| {
            self.relative_within(radius).map(|way| way * value)
        });
        let ways = total.iter().enumerate();
        ways.map(|(way, &total)| Direction {
            source: SOURCE,
            kind: DirectionKind::Absolute,
            profile: relative
                .iter()
                .zip(profile)
                .map(|(r, f)| r[way] * f)
                .collect(),
            total,
        })
        .collect()
    }
}

/// `profile` and `total` with what the discrepancy leaves of the model's error from ring to ring.
pub(crate) fn with_grain(
    model: &ModelChoice,
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
) -> (RadialProfile, Option<TotalReflectance>) {
    let circle = total.and_then(|t| t.radius_max_mm).unwrap_or(0.0) * (1.0 + 1e-9);
    let share = spread(model).grain;
    let (mut profile, mut added) = (profile.clone(), 0.0);
    for p in &mut profile.points {
        let grain = share * p.reflectance_per_mm2;
        p.u_reflectance_per_mm2 = p.u_reflectance_per_mm2.hypot(grain);
        if p.ring_mm.is_some_and(|ring| ring.1 <= circle) {
            added += (p.area_mm2() * grain).powi(2);
        }
    }
    let total = total.map(|t| TotalReflectance {
        u_total_reflectance: (t.u_total_reflectance.powi(2) + added).sqrt(),
        ..t.clone()
    });
    (profile, total)
}

/// Cholesky's factor of the correlation of the loose part.
fn correlation_factor() -> [[f64; KNOTS]; KNOTS] {
    let (first, last, _) = LN_RADIUS;
    let step = (last - first) / (KNOTS - 1) as f64 / LENGTH;
    let mut factor = [[0.0; KNOTS]; KNOTS];
    for i in 0..KNOTS {
        for j in 0..=i {
            let distance = (i - j) as f64 * step;
            let mut rest = (-0.5 * distance * distance).exp();
            for (a, b) in factor[i][..j].iter().zip(&factor[j][..j]) {
                rest -= a * b;
            }
            factor[i][j] = if i == j {
                rest.max(1e-12).sqrt()
            } else {
                rest / factor[j][j]
            };
        }
    }
    factor
}

//! A fit whose data are off in a way that it was told of is neither biased nor too sure.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test"
)]

use fit::{Constraint, Direction, DirectionKind, Fit, FitError, FitOptions, fit};
use physics::{
    Coefficients, DiffuseFresnel, DipoleModel, ForwardModel, Gradient, ProfilePoint, RadialProfile,
    TotalReflectance, profile::mean_radius,
};
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

const SKIN: Coefficients = Coefficients {
    sigma_a: 0.032,
    sigma_s_prime: 0.74,
};
const REACH_MM: f64 = 20.0;
const PEDESTAL_PER_MM2: f64 = 2e-6;

/// The dipole, off by `z` standard deviations of a smooth wave in ln(σₜ′r), which it owns up to
/// or not.
struct Wavy {
    dipole: DipoleModel,
    z: f64,
    known: bool,
}

impl Wavy {
    fn phi(at: Coefficients, radius: f64) -> f64 {
        0.06 * (1.5 * (at.sigma_t_prime() * radius).max(1e-3).ln()).cos()
    }

    fn rings() -> Vec<(f64, f64)> {
        let mut edges: Vec<f64> = vec![0.0];
        while *edges.last().unwrap() < REACH_MM {
            let last = edges.last().unwrap();
            edges.push((last + (0.06 * last).max(0.1)).min(REACH_MM));
        }
        edges.windows(2).map(|w| (w[0], w[1])).collect()
    }

    /// The share of the light of every ring, by the closed form.
    fn light(&self, at: Coefficients) -> impl Iterator<Item = (f64, f64)> {
        Self::rings().into_iter().map(move |(inner, outer)| {
            let light = self.dipole.beyond(at, inner) - self.dipole.beyond(at, outer);
            (mean_radius(inner, outer), light)
        })
    }
}

impl ForwardModel for Wavy {
    fn name(&self) -> &'static str {
        "wavy"
    }
    fn eta(&self) -> f64 {
        self.dipole.eta()
    }
    fn diffuse_reflectance(&self, at: Coefficients, radius: &[f64], out: &mut [f64]) {
        self.dipole.diffuse_reflectance(at, radius, out);
    }
    fn diffuse_reflectance_gradient(&self, at: Coefficients, radius: &[f64], out: &mut [Gradient]) {
        self.dipole.diffuse_reflectance_gradient(at, radius, out);
    }
    fn within(&self, at: Coefficients, radius: f64) -> Gradient {
        self.dipole.within(at, radius)
    }
    fn beyond(&self, at: Coefficients, radius: f64) -> f64 {
        self.dipole.beyond(at, radius)
    }
    fn discrepancies(&self) -> usize {
        usize::from(self.known)
    }
    fn discrepancy(&self, at: Coefficients, radius: &[f64], columns: &mut [f64]) {
        for (out, &r) in columns.iter_mut().zip(radius) {
            *out = Self::phi(at, r);
        }
    }
    fn discrepancy_within(&self, at: Coefficients, _radius: f64, out: &mut [f64]) {
        let (mut sum, mut off) = (0.0, 0.0);
        for (radius, light) in self.light(at) {
            sum += light;
            off += light * Self::phi(at, radius);
        }
        out[0] = off / sum;
    }
}

/// A photograph of skin by `truth`, on a pedestal of stray light, with a scale of its own.
fn capture(
    truth: &Wavy,
    scale: f64,
    pedestal: f64,
    rng: &mut impl Rng,
) -> (RadialProfile, TotalReflectance) {
    let (mut points, mut total, mut variance) = (vec![], 0.0, 0.0);
    for ((radius_mm, light), ring) in truth.light(SKIN).zip(Wavy::rings()) {
        let mut point = ProfilePoint {
            ring_mm: Some(ring),
            radius_mm,
            reflectance_per_mm2: 0.0,
            u_reflectance_per_mm2: 0.0,
            pixels: None,
        };
        let area = point.area_mm2();
        let exact = light / area * (1.0 + truth.z * Wavy::phi(SKIN, radius_mm));
        let u = (2e-3 * exact + 1e-7) / area.sqrt();
        let noise: f64 = StandardNormal.sample(rng);
        point.reflectance_per_mm2 = scale * exact + pedestal + u * noise;
        point.u_reflectance_per_mm2 = u;
        total += area * point.reflectance_per_mm2;
        variance += (area * u).powi(2);
        points.push(point);
    }
    let channel = "R".to_owned();
    let total = TotalReflectance {
        channel: channel.clone(),
        total_reflectance: total,
        u_total_reflectance: variance.sqrt(),
        radius_max_mm: Some(REACH_MM),
        u_scale_relative: 0.0,
        u_offset_per_mm2: 0.0,
    };
    (RadialProfile { channel, points }, total)
}

#[test]
fn a_known_way_of_being_wrong_neither_biases_nor_goes_uncovered() {
    let dipole = DipoleModel::new(1.3, DiffuseFresnel::Exact);
    let data = Wavy::rings().len();
    let pedestal = Direction {
        source: "pedestal",
        kind: DirectionKind::Absolute,
        profile: vec![PEDESTAL_PER_MM2; data],
        total: PEDESTAL_PER_MM2 * std::f64::consts::PI * REACH_MM * REACH_MM,
    };
    for constraint in [Constraint::Joint, Constraint::None] {
        for known in [true, false] {
            let mut rng = Pcg64::seed_from_u64(23);
            let (mut inside, mut pulls, mut pulls2) = ([0_u32; 2], [0.0; 2], [0.0; 2]);
            let runs = 200;
            for _ in 0..runs {
                let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
                let (z, scale, stray) = (draw(), 1.0 + 0.01 * draw(), PEDESTAL_PER_MM2 * draw());
                let model = Wavy { dipole, z, known };
                let (profile, total) = capture(&model, scale, stray, &mut rng);
                let options = FitOptions {
                    constraint,
                    range_mm: Some((1.0, REACH_MM)),
                    u_scale_relative: 0.01,
                    directions: if known {
                        vec![pedestal.clone()]
                    } else {
                        vec![]
                    },
                    ..FitOptions::default()
                };
                let found = fit(&profile, Some(&total), &model, &options).unwrap();
                let truth = [SKIN.sigma_a, SKIN.sigma_s_prime];
                for (i, e) in [found.sigma_a, found.sigma_s_prime].iter().enumerate() {
                    inside[i] += u32::from(e.ci95.0 <= truth[i] && truth[i] <= e.ci95.1);
                    let pull = (e.value - truth[i]) / e.u;
                    pulls[i] += pull / f64::from(runs);
                    pulls2[i] += pull * pull / f64::from(runs);
                }
            }
            println!("{constraint:?} known {known}: {inside:?}, mean {pulls:?}, square {pulls2:?}");
            for i in 0..2 {
                let share = f64::from(inside[i]) / f64::from(runs);
                if known {
                    // 200 runs at 95 % scatter by 1.5 %, the mean pull by 0.07.
                    assert!(
                        (0.90..=0.99).contains(&share),
                        "{constraint:?} {i}: {share}"
                    );
                    assert!(pulls[i].abs() < 0.25, "{constraint:?} {i}: {pulls:?}");
                } else {
                    assert!(share < 0.8, "{constraint:?} {i}: {share}");
                }
            }
        }
    }
}

fn one(constraint: Constraint, options: FitOptions, z: f64, known: bool) -> Result<Fit, FitError> {
    let dipole = DipoleModel::new(1.3, DiffuseFresnel::Exact);
    let model = Wavy { dipole, z, known };
    let mut rng = Pcg64::seed_from_u64(5);
    let (profile, _) = capture(&model, 1.0, 0.0, &mut rng);
    let true_model = Wavy { z: 0.0, ..model };
    let (_, total) = capture(&true_model, 1.0, 0.0, &mut rng);
    let options = FitOptions {
        constraint,
        range_mm: Some((1.0, REACH_MM)),
        ..options
    };
    fit(&profile, Some(&total), &model, &options)
}

/// Under the hard constraint the profile's own directions stay: the fit leans on its noise less.
#[test]
fn exact_keeps_the_directions_of_the_profile() {
    let plain = one(Constraint::Exact, FitOptions::default(), 0.0, false).unwrap();
    let known = one(Constraint::Exact, FitOptions::default(), 0.0, true).unwrap();
    assert!(
        known.sigma_s_prime.u > 2.0 * plain.sigma_s_prime.u,
        "{known:?}"
    );
    let off = one(Constraint::Exact, FitOptions::default(), 2.0, true).unwrap();
    let r = &off.residuals[20];
    let told = r.nuisances_per_mm2 / r.model_per_mm2;
    let blind = one(Constraint::Exact, FitOptions::default(), 2.0, false).unwrap();
    assert!(
        told.abs() > 1e-3 && off.reduced_chi2 < 2.0,
        "{told}, {off:?}"
    );
    assert!(blind.reduced_chi2 > 50.0, "{blind:?}");
}

#[test]
fn a_direction_of_another_length_is_refused() {
    let short = Direction {
        source: "pedestal",
        kind: DirectionKind::Relative,
        profile: vec![0.1; 3],
        total: 0.0,
    };
    let options = FitOptions {
        directions: vec![short],
        ..FitOptions::default()
    };
    let refused = one(Constraint::Joint, options, 0.0, false).unwrap_err();
    assert!(
        matches!(refused, FitError::BadDirection { found: 3, .. }),
        "{refused}"
    );
}

//! The optimum against another solver on the same problem: argmin's Nelder-Mead, on objectives
//! written here from their definition.

use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::{brent::BrentOpt, neldermead::NelderMead};
use fit::{Constraint, FitOptions, fit};
use physics::{
    DiffuseFresnel, Dipole, DipoleModel, ProfilePoint, RadialProfile, ReducedMedium,
    TotalReflectance, dipole,
};

/// Point values of R_d with a ripple that no model explains, so that residuals are not zero.
fn profile(medium: ReducedMedium) -> RadialProfile {
    let dipole = Dipole::new(&medium, DiffuseFresnel::Exact);
    let points = (0..60)
        .map(|i| {
            let radius_mm = 0.8 * (15.0_f64 / 0.8).powf(f64::from(i) / 59.0);
            let value = dipole.diffuse_reflectance(radius_mm);
            ProfilePoint {
                ring_mm: None,
                radius_mm,
                reflectance_per_mm2: value * (1.0 + 0.01 * f64::from(i * i % 7 - 3)),
                u_reflectance_per_mm2: 0.01 * value + 1e-7,
                pixels: None,
            }
        })
        .collect();
    RadialProfile {
        channel: "G".to_owned(),
        points,
    }
}

fn total(value: f64, u: f64) -> TotalReflectance {
    TotalReflectance {
        channel: "G".to_owned(),
        total_reflectance: value,
        u_total_reflectance: u,
        radius_max_mm: None,
        u_scale_relative: 0.0,
        u_offset_per_mm2: 0.0,
    }
}

fn chi2(profile: &RadialProfile, medium: ReducedMedium, scale: f64) -> f64 {
    let dipole = Dipole::new(&medium, DiffuseFresnel::Exact);
    profile
        .points
        .iter()
        .map(|p| {
            let model = scale * dipole.diffuse_reflectance(p.radius_mm);
            ((p.reflectance_per_mm2 - model) / p.u_reflectance_per_mm2).powi(2)
        })
        .sum()
}

/// ln σₐ, ln σₛ′ and the scale factor as three free parameters.
struct Joint<'a> {
    profile: &'a RadialProfile,
    total: f64,
    u_total: f64,
    u_scale: f64,
    eta: f64,
}

impl CostFunction for Joint<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, p: &Self::Param) -> Result<f64, Error> {
        let medium = ReducedMedium {
            sigma_a: p[0].exp(),
            sigma_s_prime: p[1].exp(),
            eta: self.eta,
        };
        let model = p[2] * Dipole::new(&medium, DiffuseFresnel::Exact).total_reflectance();
        Ok(chi2(self.profile, medium, p[2])
            + ((self.total - model) / self.u_total).powi(2)
            + ((p[2] - 1.0) / self.u_scale).powi(2))
    }
}

/// The reduced problem of the exact constraint: ln σₜ′ alone.
struct Exact<'a> {
    profile: &'a RadialProfile,
    albedo_prime: f64,
    eta: f64,
}

impl Exact<'_> {
    fn medium(&self, ln_sigma_t_prime: f64) -> ReducedMedium {
        let t = ln_sigma_t_prime.exp();
        ReducedMedium {
            sigma_a: t * (1.0 - self.albedo_prime),
            sigma_s_prime: t * self.albedo_prime,
            eta: self.eta,
        }
    }
}

impl CostFunction for Exact<'_> {
    type Param = f64;
    type Output = f64;
    fn cost(&self, p: &f64) -> Result<f64, Error> {
        Ok(chi2(self.profile, self.medium(*p), 1.0))
    }
}

const MEDIA: [ReducedMedium; 3] = [
    ReducedMedium {
        sigma_a: 0.0041,
        sigma_s_prime: 2.62,
        eta: 1.5,
    },
    ReducedMedium {
        sigma_a: 0.032,
        sigma_s_prime: 0.74,
        eta: 1.3,
    },
    ReducedMedium {
        sigma_a: 0.48,
        sigma_s_prime: 1.01,
        eta: 1.3,
    },
];

#[test]
fn exact_agrees_with_brent_on_the_reduced_problem() {
    for medium in MEDIA {
        let profile = profile(medium);
        let model = DipoleModel::new(medium.eta, DiffuseFresnel::Exact);
        let measured = 0.99 * Dipole::new(&medium, DiffuseFresnel::Exact).total_reflectance();
        let options = FitOptions {
            constraint: Constraint::Exact,
            range_mm: Some((0.0, 20.0)),
            ..Default::default()
        };
        let found = fit(&profile, Some(&total(measured, 0.0)), &model, &options).unwrap();

        let a = DiffuseFresnel::Exact.a(medium.eta);
        let albedo_prime = dipole::albedo_prime_from_total(measured, a).unwrap();
        let problem = Exact {
            profile: &profile,
            albedo_prime,
            eta: medium.eta,
        };
        let start = (medium.sigma_a + medium.sigma_s_prime).ln();
        let brent = BrentOpt::new(start - 0.7, start + 0.7).set_tolerance(1e-12, 1e-12);
        let best = Executor::new(problem, brent)
            .configure(|s| s.max_iters(200))
            .run()
            .unwrap()
            .state
            .best_param
            .unwrap();
        let problem = Exact {
            profile: &profile,
            albedo_prime,
            eta: medium.eta,
        };
        let expected = problem.medium(best);
        // Brent sees χ² alone, so it places the minimum to the root of its rounding.
        let error = (found.sigma_a.value / expected.sigma_a - 1.0).abs();
        assert!(error < 1e-6, "{medium:?}: {found:?} for {expected:?}");
        let error = (found.sigma_s_prime.value / expected.sigma_s_prime - 1.0).abs();
        assert!(error < 1e-6, "{medium:?}: {found:?} for {expected:?}");
    }
}

#[test]
fn joint_agrees_with_nelder_mead_in_three_parameters() {
    for medium in MEDIA {
        let profile = profile(medium);
        let model = DipoleModel::new(medium.eta, DiffuseFresnel::Exact);
        let measured = 0.99 * Dipole::new(&medium, DiffuseFresnel::Exact).total_reflectance();
        let options = FitOptions {
            constraint: Constraint::Joint,
            range_mm: Some((0.0, 20.0)),
            u_scale_relative: 0.01,
            ..Default::default()
        };
        let found = fit(&profile, Some(&total(measured, 0.002)), &model, &options).unwrap();

        let problem = Joint {
            profile: &profile,
            total: measured,
            u_total: 0.002,
            u_scale: 0.01,
            eta: medium.eta,
        };
        let at = [medium.sigma_a.ln(), medium.sigma_s_prime.ln(), 1.0];
        let mut simplex = vec![at.to_vec(); 4];
        for (i, step) in [0.1, 0.1, 0.02].into_iter().enumerate() {
            simplex[i + 1][i] += step;
        }
        let solver = NelderMead::new(simplex).with_sd_tolerance(1e-13).unwrap();
        let best = Executor::new(problem, solver)
            .configure(|s| s.max_iters(2000))
            .run()
            .unwrap()
            .state
            .best_param
            .unwrap();
        for (name, found, expected) in [
            ("sigma_a", found.sigma_a.value, best[0].exp()),
            ("sigma_s_prime", found.sigma_s_prime.value, best[1].exp()),
            ("scale", found.scale, best[2]),
        ] {
            assert!(
                (found / expected - 1.0).abs() < 2e-6,
                "{medium:?} {name}: {found}, {expected}"
            );
        }
    }
}

/// The same with σₐ held.
struct Held<'a> {
    joint: Joint<'a>,
    sigma_a: f64,
}

impl CostFunction for Held<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, p: &Self::Param) -> Result<f64, Error> {
        self.joint.cost(&vec![self.sigma_a.ln(), p[0], p[1]])
    }
}

/// At the ends of an interval near 0 the least χ² has risen by 1.96², as Nelder and Mead find it
/// with σₐ held; where it never does, the interval begins at 0.
#[test]
fn an_interval_near_zero_is_that_of_the_profile_likelihood() {
    let mut at_zero = 0;
    for (sigma_a, sigma_s_prime) in [(4e-6, 2.0), (2e-5, 2.0), (6e-5, 2.0), (1e-4, 2.0)] {
        let medium = ReducedMedium {
            sigma_a,
            sigma_s_prime,
            eta: 1.3,
        };
        let profile = profile(medium);
        let model = DipoleModel::new(medium.eta, DiffuseFresnel::Exact);
        let measured = Dipole::new(&medium, DiffuseFresnel::Exact).total_reflectance();
        let options = FitOptions {
            constraint: Constraint::Joint,
            range_mm: Some((0.0, 20.0)),
            u_scale_relative: 0.03,
            ..Default::default()
        };
        let found = fit(&profile, Some(&total(measured, 0.03)), &model, &options).unwrap();
        let least = |sigma_a: f64| {
            let held = Held {
                joint: Joint {
                    profile: &profile,
                    total: measured,
                    u_total: 0.03,
                    u_scale: 0.03,
                    eta: medium.eta,
                },
                sigma_a,
            };
            let at = [medium.sigma_s_prime.ln(), 1.0];
            let mut simplex = vec![at.to_vec(); 3];
            for (i, step) in [0.1, 0.02].into_iter().enumerate() {
                simplex[i + 1][i] += step;
            }
            let solver = NelderMead::new(simplex).with_sd_tolerance(1e-9).unwrap();
            let run = Executor::new(held, solver).configure(|s| s.max_iters(2000));
            run.run().unwrap().state.best_cost
        };
        let best = least(found.sigma_a.value);
        // The ripple is more than noise, which widens the interval.
        let rise = |sigma_a: f64| (least(sigma_a) - best) / found.reduced_chi2;
        let (low, high) = found.sigma_a.ci95;
        println!(
            "{medium:?} {:?} {} {}",
            found.sigma_a,
            rise(low),
            rise(high)
        );
        // 1.96² and 1.645².
        assert!((rise(high) / 3.8415 - 1.0).abs() < 1e-3, "{found:?}");
        if low > 0.0 {
            assert!((rise(low) / 3.8415 - 1.0).abs() < 1e-3, "{found:?}");
            assert_eq!(found.upper_limit, None);
        } else {
            at_zero += 1;
            assert!(rise(0.0) < 3.8415, "{found:?}");
            let limit = found.upper_limit.unwrap();
            assert!((rise(limit) / 2.7055 - 1.0).abs() < 1e-3, "{found:?}");
        }
    }
    assert!((1..4).contains(&at_zero), "{at_zero}");
}

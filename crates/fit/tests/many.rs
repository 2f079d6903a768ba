//! Many profiles at once are the same as one after the other.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test"
)]

use fit::{Constraint, FitError, FitOptions, ManyFits, Profiles, Totals, Warning, fit, fit_many};
use physics::{
    DiffuseFresnel, Dipole, DipoleModel, ProfilePoint, RadialProfile, ReducedMedium,
    TotalReflectance,
};

const N: usize = 150;

struct Many {
    points: Vec<ProfilePoint>,
    values: Vec<f64>,
    u: Vec<f64>,
    totals: Vec<f64>,
    u_totals: Vec<f64>,
}

/// Materials from milk to ink with a ripple; number 7 has a NaN, number 70 nothing but noise,
/// number 100 is in cm⁻².
fn many() -> Many {
    let points: Vec<ProfilePoint> = (0..80)
        .map(|i| ProfilePoint {
            ring_mm: None,
            radius_mm: 0.5 + 0.25 * f64::from(i),
            reflectance_per_mm2: 0.0,
            u_reflectance_per_mm2: 0.0,
            pixels: None,
        })
        .collect();
    let (mut values, mut u, mut totals) = (vec![], vec![], vec![]);
    for n in 0..N {
        let sigma_t_prime = 0.3 * 1.02_f64.powi(n as i32);
        let absorbed = 0.0005 * 1.04_f64.powi(n as i32);
        let medium = ReducedMedium {
            sigma_a: sigma_t_prime * absorbed,
            sigma_s_prime: sigma_t_prime * (1.0 - absorbed),
            eta: 1.4,
        };
        let dipole = Dipole::new(&medium, DiffuseFresnel::Exact);
        for (i, p) in points.iter().enumerate() {
            let value = dipole.diffuse_reflectance(p.radius_mm);
            let ripple = 1.0 + 0.005 * ((i * (n + 3)) as f64).sin();
            let unit = if n == 100 { 100.0 } else { 1.0 };
            values.push(match n {
                7 if i == 3 => f64::NAN,
                70 => 1e-9,
                _ => unit * value * ripple,
            });
            u.push(0.005 * value + 1e-8);
        }
        totals.push(dipole.total_reflectance());
    }
    Many {
        points,
        values,
        u,
        u_totals: vec![2e-3; N],
        totals,
    }
}

fn run(many: &Many, options: &FitOptions) -> ManyFits {
    let profiles = Profiles {
        points: &many.points,
        reflectance_per_mm2: &many.values,
        u_reflectance_per_mm2: &many.u,
        totals: Some(Totals {
            total_reflectance: &many.totals,
            u_total_reflectance: &many.u_totals,
            radius_max_mm: None,
        }),
    };
    let model = DipoleModel::new(1.4, DiffuseFresnel::Exact);
    fit_many(&profiles, &model, options).unwrap()
}

#[test]
fn many_at_once_are_the_same_as_one_by_one_and_the_broken_ones_stop_nobody() {
    let many = many();
    let model = DipoleModel::new(1.4, DiffuseFresnel::Exact);
    for (constraint, range_mm) in [
        (Constraint::Joint, None),
        (Constraint::Exact, Some((1.0, 15.0))),
        (Constraint::None, None),
    ] {
        let options = FitOptions {
            constraint,
            range_mm,
            u_scale_relative: 0.01,
            ..FitOptions::default()
        };
        let found = run(&many, &options);
        let mut warned = 0;
        let broken: Vec<usize> = found.errors.iter().map(|e| e.0).collect();
        assert_eq!(broken, [7, 70, 100]);
        assert!(matches!(&found.errors[0].1, FitError::BadPoint { channel, .. } if channel == "7"));
        assert!(matches!(found.errors[1].1, FitError::NoSignal { .. }));
        assert!(matches!(
            found.errors[2].1,
            FitError::ImpossibleIntegral { .. }
        ));
        for n in 0..N {
            let data = n * many.points.len()..(n + 1) * many.points.len();
            let pairs = many.values[data.clone()].iter().zip(&many.u[data]);
            let profile = RadialProfile {
                channel: n.to_string(),
                points: many
                    .points
                    .iter()
                    .zip(pairs)
                    .map(|(p, (&value, &u))| ProfilePoint {
                        reflectance_per_mm2: value,
                        u_reflectance_per_mm2: u,
                        ..*p
                    })
                    .collect(),
            };
            let total = TotalReflectance {
                channel: n.to_string(),
                total_reflectance: many.totals[n],
                u_total_reflectance: many.u_totals[n],
                radius_max_mm: None,
                u_scale_relative: 0.0,
                u_offset_per_mm2: 0.0,
            };
            match fit(&profile, Some(&total), &model, &options) {
                Ok(one) => {
                    assert_eq!(found.sigma_a[n], one.sigma_a.value, "{n}");
                    assert_eq!(found.u_sigma_s_prime[n], one.sigma_s_prime.u, "{n}");
                    assert_eq!(found.sigma_a_high[n], one.sigma_a.ci95.1, "{n}");
                    assert_eq!(found.scale[n], one.scale, "{n}");
                    assert_eq!(found.start_mm[n], one.range_mm.0, "{n}");
                    assert_eq!(found.termination[n], Some(one.termination), "{n}");
                    let said = found.warnings.iter().filter(|w| w.0 == n);
                    let said: Vec<Warning> = said.map(|w| w.1).collect();
                    assert_eq!(said, one.warnings, "{n}");
                    warned += said.len();
                }
                Err(error) => {
                    assert!(found.sigma_a[n].is_nan() && found.termination[n].is_none());
                    assert_eq!(error.to_string(), {
                        let (_, error) = found.errors.iter().find(|e| e.0 == n).unwrap();
                        error.to_string()
                    });
                }
            }
        }
        assert!(found.warnings.is_sorted_by_key(|w| w.0));
        assert_eq!(found.warnings.len(), warned);
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let many = many();
    let options = FitOptions {
        u_scale_relative: 0.01,
        ..FitOptions::default()
    };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| format!("{:?}", run(&many, &options)))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn arrays_that_do_not_belong_together_are_refused() {
    let many = many();
    let model = DipoleModel::new(1.4, DiffuseFresnel::Exact);
    let good = Profiles {
        points: &many.points,
        reflectance_per_mm2: &many.values,
        u_reflectance_per_mm2: &many.u[..80],
        totals: None,
    };
    let options = FitOptions {
        constraint: Constraint::None,
        ..FitOptions::default()
    };
    assert!(fit_many(&good, &model, &options).is_ok());
    let short = |wrong: Profiles| fit_many(&wrong, &model, &options).unwrap_err().to_string();
    let wrong = Profiles {
        reflectance_per_mm2: &many.values[..81],
        ..good
    };
    assert!(short(wrong).contains("the number of reflectances"));
    let wrong = Profiles {
        u_reflectance_per_mm2: &many.u[..79],
        ..good
    };
    assert!(short(wrong).contains("the number of uncertainties"));
    let wrong = Profiles {
        totals: Some(Totals {
            total_reflectance: &many.totals[..3],
            u_total_reflectance: &many.u_totals,
            radius_max_mm: None,
        }),
        ..good
    };
    assert!(short(wrong).contains("the number of totals must be that of the profiles, got 3"));
    let wrong = Profiles {
        points: &[],
        ..good
    };
    assert!(short(wrong).contains("the number of points"));
}

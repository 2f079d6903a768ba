//! Broken and strange profiles: a clear answer each, never a silent number.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test"
)]

use fit::{Constraint, Fit, FitError, FitOptions, Warning, another_unit, fit};
use physics::{
    DiffuseFresnel, Dipole, DipoleModel, ProfilePoint, RadialProfile, ReducedMedium,
    TotalReflectance,
};

const MARBLE: ReducedMedium = ReducedMedium {
    sigma_a: 0.0041,
    sigma_s_prime: 2.62,
    eta: 1.5,
};

fn profile() -> RadialProfile {
    let dipole = Dipole::new(&MARBLE, DiffuseFresnel::Exact);
    let points = (0..60)
        .map(|i| {
            let radius_mm = 0.8 + 0.3 * f64::from(i);
            let value = dipole.diffuse_reflectance(radius_mm);
            ProfilePoint {
                ring_mm: None,
                radius_mm,
                reflectance_per_mm2: value,
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

/// The total of what [`profile`] is one of.
fn total() -> TotalReflectance {
    let dipole = Dipole::new(&MARBLE, DiffuseFresnel::Exact);
    TotalReflectance {
        channel: "G".to_owned(),
        total_reflectance: dipole.total_reflectance(),
        u_total_reflectance: 0.002,
        radius_max_mm: None,
        u_scale_relative: 0.0,
        u_offset_per_mm2: 0.0,
    }
}

fn run_with(profile: &RadialProfile, options: &FitOptions) -> Result<Fit, FitError> {
    let total = total();
    let model = DipoleModel::new(1.5, DiffuseFresnel::Exact);
    fit(profile, Some(&total), &model, options)
}

fn run(change: impl Fn(&mut Vec<ProfilePoint>)) -> Result<Fit, FitError> {
    let mut profile = profile();
    change(&mut profile.points);
    let options = FitOptions {
        u_scale_relative: 0.01,
        ..FitOptions::default()
    };
    run_with(&profile, &options)
}

fn message(change: impl Fn(&mut Vec<ProfilePoint>)) -> String {
    run(change).unwrap_err().to_string()
}

#[test]
fn what_is_no_measurement_is_refused_by_name() {
    let nan = message(|p| p[4].reflectance_per_mm2 = f64::NAN);
    assert!(
        nan.contains("channel G, radius 2 mm: reflectance NaN"),
        "{nan}"
    );
    let sure = message(|p| p[4].u_reflectance_per_mm2 = 0.0);
    assert!(
        sure.contains("u 0 mm^-2; expected a finite value and u above 0"),
        "{sure}"
    );
    let two = message(|p| p.truncate(2));
    assert!(two.contains("a fit needs at least 3"), "{two}");
    let unsorted = message(|p| p.swap(3, 9));
    assert!(
        unsorted.contains("radius 2 mm follows 3.5 mm"),
        "{unsorted}"
    );
    let repeated = message(|p| p[5].radius_mm = p[4].radius_mm);
    assert!(repeated.contains("radius 2 mm follows 2 mm"), "{repeated}");
}

/// mm⁻² has a hundred cm⁻² in it; a lamp that is ten times brighter than its reference cannot be.
#[test]
fn units_that_make_too_much_light_are_recognised() {
    for factor in [10.0, 100.0] {
        let change = |p: &mut Vec<ProfilePoint>| {
            for p in p {
                p.reflectance_per_mm2 *= factor;
                p.u_reflectance_per_mm2 *= factor;
            }
        };
        let refused = run(change).unwrap_err();
        assert!(
            matches!(refused, FitError::ImpossibleIntegral { integral, .. } if integral > 3.0),
            "{refused}"
        );
        assert!(refused.to_string().contains("another unit"), "{refused}");
        // Where nobody claims to know the scale, there is nothing to contradict.
        let mut profile = profile();
        change(&mut profile.points);
        let free = FitOptions {
            constraint: Constraint::None,
            u_scale_relative: f64::INFINITY,
            ..FitOptions::default()
        };
        let found = run_with(&profile, &free).unwrap();
        assert!((found.scale / factor - 1.0).abs() < 1e-6, "{found:?}");
        assert!(
            (found.sigma_a.value / MARBLE.sigma_a - 1.0).abs() < 1e-5,
            "{found:?}"
        );
    }
}

/// Too little light is possible where the beam is left out; then fit and data disagree loudly.
#[test]
fn units_that_make_too_little_light_are_loud() {
    for factor in [0.1, 0.01] {
        let found = run(|p| {
            for p in p {
                p.reflectance_per_mm2 *= factor;
                p.u_reflectance_per_mm2 *= factor;
            }
        })
        .unwrap();
        let loud = found
            .warnings
            .iter()
            .any(|w| matches!(w, Warning::PoorFit { .. } | Warning::ScaleOff { .. }));
        assert!(loud, "{factor}: {found:?}");
    }
}

/// A profile that is dark by a power of ten has the shape of a medium whose light it has not.
#[test]
fn a_power_of_ten_between_shape_and_light_is_called_a_unit() {
    let model = DipoleModel::new(1.5, DiffuseFresnel::Exact);
    let total = total();
    for constraint in [Constraint::Joint, Constraint::Exact] {
        let options = FitOptions {
            constraint,
            u_scale_relative: if constraint == Constraint::Joint {
                0.01
            } else {
                0.0
            },
            ..FitOptions::default()
        };
        let told = |profile: &RadialProfile| {
            let found = fit(profile, Some(&total), &model, &options).unwrap();
            another_unit(profile, &found, |other, _| {
                fit(other, Some(&total), &model, &options).ok()
            })
        };
        // Radii in cm; values of which ten are one.
        let (mut short, mut dark, mut bent) = (profile(), profile(), profile());
        for p in &mut short.points {
            p.radius_mm /= 10.0;
        }
        for p in &mut dark.points {
            p.reflectance_per_mm2 /= 10.0;
            p.u_reflectance_per_mm2 /= 10.0;
        }
        // No unit does that.
        for p in &mut bent.points {
            p.reflectance_per_mm2 *= (-0.3 * p.radius_mm).exp();
            p.u_reflectance_per_mm2 *= (-0.3 * p.radius_mm).exp();
        }
        for (profile, power) in [(short, -2), (dark, -1)] {
            let Some(Warning::AnotherUnit {
                integral,
                expected,
                power: found,
            }) = told(&profile)
            else {
                panic!("{constraint:?}: 10^{power} was not recognised");
            };
            assert_eq!(found, power);
            assert!((integral / expected / 10.0_f64.powi(power) - 1.0).abs() < 1e-9);
        }
        assert_eq!(told(&profile()), None);
        assert_eq!(told(&bent), None, "{constraint:?}");
    }
}

#[test]
fn a_negative_tail_is_named_and_noise_about_zero_is_not() {
    let named = |found: &Fit| {
        found
            .warnings
            .iter()
            .any(|w| matches!(w, Warning::NegativeLight { .. }))
    };
    let noisy = run(|p| p[59].reflectance_per_mm2 = -2.0 * p[59].u_reflectance_per_mm2).unwrap();
    assert!(!named(&noisy), "{noisy:?}");
    let below = run(|p| {
        for p in &mut p[50..] {
            p.reflectance_per_mm2 = -1e-5;
        }
    })
    .unwrap();
    assert!(named(&below), "{below:?}");
}

#[test]
fn a_point_that_decides_alone_is_named() {
    let named = |found: &Fit| {
        found
            .warnings
            .iter()
            .any(|w| matches!(w, Warning::OnePointDecides { radius_mm, .. } if *radius_mm == 5.0))
    };
    assert!(!named(&run(|_| ()).unwrap()));
    let found = run(|p| p[14].u_reflectance_per_mm2 *= 1e-3).unwrap();
    assert!(named(&found), "{found:?}");
}

#[test]
fn a_scale_is_free_or_exact_but_not_both() {
    let options = FitOptions {
        constraint: Constraint::Exact,
        u_scale_relative: f64::INFINITY,
        ..FitOptions::default()
    };
    let refused = run_with(&profile(), &options).unwrap_err();
    assert_eq!(refused, FitError::ScaleIsExact);
}

#[test]
fn a_range_that_ends_before_it_starts_is_refused_by_its_name() {
    for range_mm in [(15.0, 1.0), (3.0, 3.0), (-1.0, 5.0), (f64::NAN, 5.0)] {
        let options = FitOptions {
            range_mm: Some(range_mm),
            u_scale_relative: 0.01,
            ..FitOptions::default()
        };
        let error = run_with(&profile(), &options).unwrap_err();
        assert!(matches!(error, FitError::BadRange { .. }), "{error}");
        assert!(
            error.to_string().starts_with("range_mm: expected"),
            "{error}"
        );
    }
}

//! Media come back from profiles that somebody else's photons made.

use fit::{Constraint, Fit, FitOptions, fit};
use physics::profile::mean_radius;
use physics::{ProfilePoint, RadialProfile, TotalReflectance, fresnel};
use pipeline::library::{ModelChoice, model};
use pipeline::measure::{Choices, measure};
use pipeline::{Silent, capture, synthesis};

/// A run of MCML (fixtures/monte-carlo/totals.csv): rings, total with its standard error, truth.
struct Run {
    name: &'static str,
    rings: &'static str,
    total: (f64, f64),
    eta: f64,
    g: f64,
    sigma_a: f64,
    sigma_s_prime: f64,
}

const RUNS: [Run; 4] = [
    Run {
        name: "marble",
        rings: include_str!("../fixtures/monte-carlo/marble_g.reflectance_r.csv"),
        total: (0.767481, 0.000120),
        eta: 1.5,
        g: 0.0,
        sigma_a: 0.0041,
        sigma_s_prime: 2.62,
    },
    Run {
        name: "marble, g = 0.9",
        rings: include_str!("../fixtures/monte-carlo/marble_g_g09.reflectance_r.csv"),
        total: (0.768084, 0.000293),
        eta: 1.5,
        g: 0.9,
        sigma_a: 0.0041,
        sigma_s_prime: 2.62,
    },
    Run {
        name: "skin1 red",
        rings: include_str!("../fixtures/monte-carlo/skin1_r.reflectance_r.csv"),
        total: (0.431996, 0.000065),
        eta: 1.3,
        g: 0.0,
        sigma_a: 0.032,
        sigma_s_prime: 0.74,
    },
    Run {
        name: "skin1 red, matched",
        rings: include_str!("../fixtures/monte-carlo/skin1_r_matched.reflectance_r.csv"),
        total: (0.565636, 0.000115),
        eta: 1.0,
        g: 0.0,
        sigma_a: 0.032,
        sigma_s_prime: 0.74,
    },
];

fn fitted(run: &Run, choice: &ModelChoice) -> Fit {
    let points = run
        .rings
        .lines()
        .skip(1)
        .filter_map(|line| {
            let cells: Vec<f64> = line
                .split(',')
                .map(|cell| cell.parse().unwrap_or(0.0))
                .collect();
            let [inner, outer, value, u] = [cells[0], cells[1], cells[2], cells[3]];
            (u > 0.0 && u < 0.1 * value).then_some(ProfilePoint {
                ring_mm: Some((inner, outer)),
                radius_mm: mean_radius(inner, outer),
                reflectance_per_mm2: value,
                u_reflectance_per_mm2: u,
                pixels: None,
            })
        })
        .collect();
    let channel = "Y".to_owned();
    let total = TotalReflectance {
        channel: channel.clone(),
        total_reflectance: run.total.0,
        u_total_reflectance: run.total.1,
        radius_max_mm: None,
        u_scale_relative: 0.0,
        u_offset_per_mm2: 0.0,
    };
    let profile = RadialProfile { channel, points };
    let model = model(choice, run.eta).unwrap();
    let options = FitOptions {
        constraint: Constraint::Joint,
        entry_factor: fresnel::entry_factor(run.eta, 1.0),
        ..FitOptions::default()
    };
    fit(&profile, Some(&total), &*model, &options).unwrap()
}

#[test]
fn the_transport_model_recovers_what_the_dipole_does_not() {
    println!("medium               model                  sigma_a        sigma_s'      chi2/dof");
    for run in &RUNS {
        let known = ModelChoice {
            g: Some(run.g),
            ..ModelChoice::default()
        };
        for choice in known.all(run.eta) {
            let found = fitted(run, &choice);
            let error_a = found.sigma_a.value / run.sigma_a - 1.0;
            let error_s = found.sigma_s_prime.value / run.sigma_s_prime - 1.0;
            println!(
                "{:20} {:21} {:+8.2} %    {:+8.2} %    {:8.2}",
                run.name,
                choice.name,
                100.0 * error_a,
                100.0 * error_s,
                found.reduced_chi2
            );
            if choice.name == "monte-carlo" {
                assert!(
                    error_a.abs() < 0.01 && error_s.abs() < 0.01,
                    "{}: {found:?}",
                    run.name
                );
                // The photons' own noise is all that is left.
                assert!(found.reduced_chi2 < 1.5, "{}: {found:?}", run.name);
            } else {
                assert!(error_s.abs() > 0.005, "{}: {found:?}", run.name);
            }
        }
    }
}

/// Side by side, every model gets the light that its own exit factor makes of the radiance, whichever
/// was asked for first.
#[test]
fn all_models_stand_beside_each_other_on_their_own_light() {
    let mut sample = synthesis::sample_of("skin1").unwrap();
    sample.channels.retain(|(name, _)| name == "R");
    let camera = synth::Camera {
        width: 256,
        height: 256,
        mm_per_pixel: 0.16,
        channels: synth::Channels::Mono,
        exposures_s: vec![0.001, 0.004, 0.016, 0.064, 0.25, 1.0, 4.0],
        ..synth::Camera::default()
    };
    let called = |name: &str| ModelChoice {
        name: name.to_owned(),
        g: (name == "monte-carlo").then_some(0.8),
        ..ModelChoice::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("capture");
    let light = called("monte-carlo");
    let manifest = synthesis::write(&sample, camera, &light, 1, &target, false, &Silent).unwrap();
    let loaded = capture::load(&manifest).unwrap();
    let measured = |model: ModelChoice, compare| {
        let choices = Choices {
            model,
            compare,
            confirm: false,
            ..Choices::default()
        };
        measure(&loaded, &choices, &Silent).unwrap()
    };
    // The dipole comes first where all are asked for, and its factor is the diffuse one.
    let all = measured(
        ModelChoice {
            g: Some(0.8),
            ..called("dipole")
        },
        true,
    );
    for name in ["monte-carlo", "dipole"] {
        let alone = &measured(called(name), false).fits[0];
        let beside = all.compared.iter().find(|c| c.name() == name).unwrap();
        let beside = &beside.fits()[0].1;
        for (a, b) in [
            (alone.sigma_a, beside.sigma_a),
            (alone.sigma_s_prime, beside.sigma_s_prime),
        ] {
            // The beam on the white is measured with the model that was asked for.
            assert!((a.value - b.value).abs() < 0.2 * a.u, "{name}: {a:?} {b:?}");
        }
    }
}

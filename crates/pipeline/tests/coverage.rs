//! Intervals hold the truth: a small part of the example `coverage`, which has the full studies.

#[path = "../examples/coverage/captures.rs"]
mod captures;

use captures::{given, noiseless, scale};
use physics::{Coefficients, fresnel};
use pipeline::bootstrap::Channel;
use pipeline::fitting::{Given, fit_channel, fit_many};
use pipeline::library::{self, ModelChoice};
use profile::Exit;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use transport::TransportModel;

/// Light that obeys transport, fitted by closed forms, on media that no discrepancy was trained on.
#[test]
fn a_closed_form_owns_up_to_its_error() {
    let media = [
        (0.032, 0.74, 1.3, 0.85),
        (0.0041, 2.62, 1.5, 0.5),
        (0.0015, 0.7, 1.36, 0.3),
        (0.17, 1.22, 1.25, 0.6),
        (0.003, 7.38, 1.33, 0.9),
    ];
    let forms = [
        "dipole",
        "kienle-patterson",
        "better-dipole",
        "photon-beam-diffusion",
    ];
    let mut lost = 0;
    let cases = media
        .iter()
        .flat_map(|medium| forms.map(|form| (*medium, form)));
    for ((sigma_a, sigma_s_prime, eta, g), name) in cases {
        let form = ModelChoice {
            name: name.to_owned(),
            ..ModelChoice::default()
        };
        let medium = Coefficients {
            sigma_a,
            sigma_s_prime,
        };
        let truth = TransportModel::new(eta, g).unwrap();
        let (profile, total) = noiseless(&truth, fresnel::entry_factor(eta, 1.0), medium);
        let fitted = |discrepancy| {
            let given = Given {
                discrepancy,
                ..given(form.clone(), eta)
            };
            fit_channel(&profile, Some(&total), &scale(0.005), &given).unwrap()
        };
        let (with, without) = (fitted(true), fitted(false));
        let off = |fit: &fit::Fit| {
            let of = |e: &fit::Estimate, truth: f64| ((e.value - truth) / e.u).abs();
            of(&fit.sigma_a, sigma_a).max(of(&fit.sigma_s_prime, sigma_s_prime))
        };
        assert!(off(&with) < 2.0, "{name}, {medium:?}, g {g}: {with:?}");
        // Nor is it bought with an interval that says nothing.
        assert!(with.sigma_s_prime.u < 0.1 * sigma_s_prime, "{with:?}");
        lost += u32::from(off(&without) > 2.0);
        assert!(with.budget.iter().any(|c| c.source == "model error"));
    }
    // Most of the twenty would be lost without.
    assert!(lost > 10, "{lost}");
}

/// The budget's lines sum to u, and replicas spread by it.
#[test]
fn replicas_spread_by_what_the_budget_says() {
    let medium = Coefficients {
        sigma_a: 0.0041,
        sigma_s_prime: 2.62,
    };
    let given = Given {
        u_eta: 0.01,
        u_length_relative: 0.005,
        ..given(ModelChoice::default(), 1.5)
    };
    let model = library::model(&given.model, 1.5).unwrap();
    let (profile, total) = noiseless(&*model, fresnel::entry_factor(1.5, 1.0), medium);
    let scale = scale(0.005);
    let channel = Channel {
        profile: &profile,
        total: Some(&total),
        scale: &scale,
        given: &given,
    };
    let (profile, total) = channel.drawn(medium, &mut Pcg64::seed_from_u64(2)).unwrap();
    let fit = fit_channel(&profile, total.as_ref(), &scale, &given).unwrap();
    let sum = |of: fn(&fit::Contribution) -> f64| {
        fit.budget.iter().map(|c| of(c).powi(2)).sum::<f64>().sqrt()
    };
    assert!(
        (sum(|c| c.u_sigma_a) / fit.sigma_a.u - 1.0).abs() < 1e-6,
        "{fit:?}"
    );
    assert!((sum(|c| c.u_sigma_s_prime) / fit.sigma_s_prime.u - 1.0).abs() < 1e-6);
    let found = channel.bootstrap(fit.coefficients(), 400, 1).unwrap();
    // 400 replicas tell a standard deviation to 3.5 %; three of those.
    let ratio = found.u_sigma_a_per_mm / fit.sigma_a.u;
    assert!((ratio - 1.0).abs() < 0.105, "{ratio}: {found:?} {fit:?}");
    let ratio = found.u_sigma_s_prime_per_mm / fit.sigma_s_prime.u;
    assert!((ratio - 1.0).abs() < 0.105, "{ratio}: {found:?} {fit:?}");
}

/// What η does to a profile no medium does: a fit that knows how far η may be off finds where it is,
/// and calls no residual of it noise.
#[test]
fn an_input_that_bends_the_profile_is_found_with_the_medium() {
    let medium = Coefficients {
        sigma_a: 0.032,
        sigma_s_prime: 0.74,
    };
    let (stated, off) = (1.3, 2.0);
    let given = Given {
        u_eta: 0.01,
        ..given(ModelChoice::default(), stated)
    };
    let eta = stated + off * given.u_eta;
    let model = library::model(&given.model, eta).unwrap();
    let (mut profile, mut total) = noiseless(&*model, fresnel::entry_factor(eta, 1.0), medium);
    // Radiance became exitance by the factor of the stated index.
    let Exit::Fresnel { angle, .. } = given.exit else {
        panic!("{given:?}");
    };
    let factor = |eta| Exit::Fresnel { eta, angle }.factor();
    let seen = factor(eta) / factor(stated);
    for p in &mut profile.points {
        p.reflectance_per_mm2 *= seen;
    }
    total.total_reflectance *= seen;
    let fitted = |given: &Given| fit_channel(&profile, Some(&total), &scale(0.005), given).unwrap();
    let fit = fitted(&given);
    let pull = |e: &fit::Estimate, truth: f64| (e.value - truth).abs() / e.u;
    // Without noise nothing is left but the prior of η itself: 2² of 43 data.
    assert!(pull(&fit.sigma_a, medium.sigma_a) < 0.1, "{fit:?}");
    assert!(
        pull(&fit.sigma_s_prime, medium.sigma_s_prime) < 0.1,
        "{fit:?}"
    );
    assert!(
        fit.reduced_chi2 < 0.11 && fit.warnings.is_empty(),
        "{fit:?}"
    );
    assert!((fit.nuisances[0] - off).abs() < 0.1, "{:?}", fit.nuisances);
    let line = |fit: &fit::Fit| {
        let of = fit.budget.iter().find(|c| c.source == "relative index eta");
        of.unwrap().u_sigma_a / fit.sigma_a.value
    };
    // The hard constraint takes η as true: off, but within what it says of η.
    let hard = fitted(&Given {
        constraint: fit::Constraint::Exact,
        ..given.clone()
    });
    assert!(
        hard.reduced_chi2 > 10.0 && line(&hard) > 3.0 * line(&fit),
        "{hard:?}"
    );
    // An index that is nowhere near what was stated is told.
    let far = fitted(&Given {
        u_eta: given.u_eta / 10.0,
        ..given.clone()
    });
    let told = |w: &fit::Warning| matches!(w, fit::Warning::InputOff { off, .. } if *off > 10.0);
    assert!(far.warnings.iter().any(told), "{far:?}");
}

/// Many at once are each alone, with a closed form's own error or without, on any number of threads.
#[test]
fn many_profiles_are_fitted_as_each_alone() {
    let (eta, count) = (1.4, 6);
    let truth = TransportModel::new(eta, 0.5).unwrap();
    let media = (0..count).map(|i| Coefficients {
        sigma_a: 0.01 * 1.5_f64.powi(i),
        sigma_s_prime: 1.0,
    });
    let captures: Vec<_> = media
        .map(|medium| noiseless(&truth, fresnel::entry_factor(eta, 1.0), medium))
        .collect();
    let column = |of: fn(&physics::ProfilePoint) -> f64| -> Vec<f64> {
        let points = captures.iter().flat_map(|c| &c.0.points);
        points.map(of).collect()
    };
    let mut values = column(|p| p.reflectance_per_mm2);
    let u = column(|p| p.u_reflectance_per_mm2);
    let points = captures[0].0.points.len();
    values[3 * points] = f64::NAN;
    let total = |of: fn(&physics::TotalReflectance) -> f64| -> Vec<f64> {
        captures.iter().map(|c| of(&c.1)).collect()
    };
    let (totals, u_totals) = (
        total(|t| t.total_reflectance),
        total(|t| t.u_total_reflectance),
    );
    let profiles = fit::Profiles {
        points: &captures[0].0.points,
        reflectance_per_mm2: &values,
        u_reflectance_per_mm2: &u,
        totals: Some(fit::Totals {
            total_reflectance: &totals,
            u_total_reflectance: &u_totals,
            radius_max_mm: captures[0].1.radius_max_mm,
        }),
    };
    for discrepancy in [false, true] {
        let given = Given {
            discrepancy,
            ..given(ModelChoice::default(), eta)
        };
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap();
            pool.install(|| fit_many(&profiles, &scale(0.005), &given).unwrap())
        };
        let (many, other) = (on(1), on(3));
        let failed: Vec<usize> = many.errors.iter().map(|e| e.0).collect();
        assert_eq!((failed, many.sigma_a[3].is_nan()), (vec![3], true));
        for (i, (profile, total)) in captures.iter().enumerate().filter(|c| c.0 != 3) {
            let one = fit_channel(profile, Some(total), &scale(0.005), &given).unwrap();
            let numbers = |m: &fit::ManyFits| (m.sigma_a[i], m.u_sigma_a[i], m.u_sigma_s_prime[i]);
            let (a, s) = (one.sigma_a, one.sigma_s_prime);
            assert_eq!(numbers(&many), (a.value, a.u, s.u), "{i} {discrepancy}");
            assert_eq!(numbers(&many), numbers(&other));
        }
    }
}

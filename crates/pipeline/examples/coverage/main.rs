//! Whether intervals hold the truth as often as they say.
//!
//! `cargo run --release -p beamspot-pipeline --example coverage -- STUDY [N [ONLY [SEED]]]`, where
//! ONLY is a part of the name of the cells to run, SEED shifts what is drawn, and STUDY is
//!
//! | `right` | N captures in each cell (material × u of the scale), every systematic drawn from its u |
//! | `wrong` | N captures of transport's light, of media that no discrepancy was trained on |
//! | `efficiency` | N captures of each of the 36 channels: rms error over the Cramér-Rao bound |
//! | `bootstrap` | N replicas of each of the 36 channels: their spread beside the budget's u |

#![expect(clippy::print_stdout, reason = "what it finds is for the terminal")]

mod captures;

use captures::{given, noiseless, scale};
use fit::{Constraint, Estimate, Fit};
use physics::footprint::Beam;
use physics::{Coefficients, Footprints, ForwardModel, fresnel};
use pipeline::bootstrap::Channel;
use pipeline::discrepancy::Discrepancy;
use pipeline::fitting::{Given, fit_channel};
use pipeline::library::{self, MODELS, ModelChoice};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use transport::TransportModel;

type Outcome = Result<(), Box<dyn std::error::Error + Send + Sync>>;

fn main() -> Outcome {
    let mut arguments = std::env::args().skip(1);
    let study = arguments.next().unwrap_or_default();
    let count = arguments.next().map(|n| n.parse()).transpose()?;
    let only = arguments.next().unwrap_or_default();
    let seed = arguments
        .next()
        .map(|n| n.parse())
        .transpose()?
        .unwrap_or(0);
    match study.as_str() {
        "right" => right(count.unwrap_or(400), &only, seed),
        "wrong" => wrong(count.unwrap_or(400), &only, seed),
        "efficiency" => efficiency(count.unwrap_or(400), &only),
        "bootstrap" => bootstrap(count.unwrap_or(2000), &only),
        _ => Err("name a study: right, wrong, efficiency, bootstrap".into()),
    }
}

fn dipole() -> ModelChoice {
    ModelChoice::default()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn holds(e: &Estimate, truth: f64) -> bool {
    e.ci95.0 <= truth && truth <= e.ci95.1
}

/// How a list of fits did against its truths, for one of the coefficients.
fn line(
    fits: &[(Fit, Coefficients)],
    of: impl Fn(&Fit, &Coefficients) -> (Estimate, f64),
) -> String {
    let pairs: Vec<(Estimate, f64)> = fits.iter().map(|(f, c)| of(f, c)).collect();
    let inside = pairs.iter().filter(|(e, t)| holds(e, *t)).count();
    let of = |f: fn(&Estimate, f64) -> f64| median(pairs.iter().map(|(e, t)| f(e, *t)).collect());
    format!(
        "{:5.1} % inside, median |error|/u {:.2}, median u {:.2} %, median error {:+.2} %, median |error| {:.2} %",
        100.0 * inside as f64 / pairs.len() as f64,
        of(|e, t| (e.value - t).abs() / e.u),
        100.0 * of(|e, t| e.u / t),
        100.0 * of(|e, t| e.value / t - 1.0),
        100.0 * of(|e, t| (e.value / t - 1.0).abs()),
    )
}

fn both(fits: &[(Fit, Coefficients)]) -> [String; 2] {
    [
        line(fits, |f, c| (f.sigma_a, c.sigma_a)),
        line(fits, |f, c| (f.sigma_s_prime, c.sigma_s_prime)),
    ]
}

/// From ketchup blue to cream red.
const MEDIA: [(&str, f64, f64, f64); 4] = [
    ("ketchup B", 0.97, 0.07, 1.3),
    ("skin1 R", 0.032, 0.74, 1.3),
    ("marble G", 0.0041, 2.62, 1.5),
    ("cream R", 0.0002, 7.38, 1.3),
];

fn right(count: usize, only: &str, seed: u64) -> Outcome {
    let (mut inside, mut of) = ([0; 2], 0);
    for (index, (name, sigma_a, sigma_s_prime, eta)) in (0..).zip(MEDIA) {
        let medium = Coefficients {
            sigma_a,
            sigma_s_prime,
        };
        for u_scale in [0.003, 0.01, 0.03] {
            let cell = format!("{name}, u of the scale {:.1} %", 100.0 * u_scale);
            if !cell.contains(only) {
                continue;
            }
            let given = Given {
                u_eta: 0.01,
                u_length_relative: 0.005,
                u_fwhm_mm: 0.02,
                beam: Beam::Gaussian { fwhm_mm: 0.3 },
                pixel_mm: 0.04,
                ..given(dipole(), eta)
            };
            let model = library::model(&given.model, eta)?;
            let (profile, total) = noiseless(&*model, fresnel::entry_factor(eta, 1.0), medium);
            let scale = scale(u_scale);
            let channel = Channel {
                profile: &profile,
                total: Some(&total),
                scale: &scale,
                given: &given,
            };
            let exact = Given {
                constraint: Constraint::Exact,
                ..given.clone()
            };
            let fits = (0..count as u64)
                .into_par_iter()
                .map(|i| {
                    // Draws of its own for every cell, or one capture's luck would count twelve times.
                    let cell = 4 * (u_scale * 1e3).round() as u64 + index;
                    let mut rng = Pcg64::seed_from_u64((seed << 40) + (cell << 20) + i);
                    let (profile, total) = channel.drawn(medium, &mut rng).ok()?;
                    let joint = fit_channel(&profile, total.as_ref(), &scale, &given).ok()?;
                    let exact = fit_channel(&profile, total.as_ref(), &scale, &exact).ok();
                    Some((joint, exact))
                })
                .collect::<Vec<_>>();
            let failed = fits.iter().filter(|f| f.is_none()).count();
            let (joint, exact): (Vec<_>, Vec<_>) = fits.into_iter().flatten().unzip();
            let joint: Vec<(Fit, Coefficients)> = joint.into_iter().map(|f| (f, medium)).collect();
            let exact: Vec<(Fit, Coefficients)> =
                exact.into_iter().flatten().map(|f| (f, medium)).collect();
            of += joint.len();
            inside[0] += joint
                .iter()
                .filter(|(f, c)| holds(&f.sigma_a, c.sigma_a))
                .count();
            inside[1] += joint
                .iter()
                .filter(|(f, c)| holds(&f.sigma_s_prime, c.sigma_s_prime))
                .count();
            println!("{cell}, {failed} failed");
            for (how, fits) in [("joint", &joint), ("exact", &exact)] {
                let [a, s] = both(fits);
                println!("  {how} σa:  {a}\n  {how} σs′: {s}");
            }
            // Data without noise and blurred as stated are fitted by the truth: the inverse of
            // Fisher's matrix there.
            let mut seen = vec![0.0; profile.points.len()];
            let blur = given.options(0.0).blur;
            Footprints::new(&profile.points, &blur).reflectance(&*model, medium, &mut seen);
            let mut clean = profile.clone();
            for (p, seen) in clean.points.iter_mut().zip(seen) {
                p.reflectance_per_mm2 = fresnel::entry_factor(eta, 1.0) * seen;
            }
            let bound = fit_channel(&clean, Some(&total), &scale, &given)?;
            let width = |of: fn(&Fit) -> &Estimate| {
                let found = joint.iter().map(|(f, _)| of(f).ci95.1 - of(f).ci95.0);
                median(found.collect()) / (2.0 * 1.96 * of(&bound).u)
            };
            println!(
                "  width of the joint intervals over the bound's: σa {:.3}, σs′ {:.3}",
                width(|f| &f.sigma_a),
                width(|f| &f.sigma_s_prime)
            );
        }
    }
    println!(
        "pooled, {of} captures: σa {:.2} %, σs′ {:.2} %",
        100.0 * inside[0] as f64 / of as f64,
        100.0 * inside[1] as f64 / of as f64
    );
    Ok(())
}

/// Media that the training set does not have: every number drawn between its nodes.
fn held_out(rng: &mut Pcg64) -> (Coefficients, f64, f64) {
    let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    // σₜ′ from 0.3 to 8 mm⁻¹, k from 0.01 (cream) to 1.2 (ketchup green).
    let sigma_t_prime = 0.3 * (8.0_f64 / 0.3).powf(uniform(0.0, 1.0));
    let k = 0.01 * 120.0_f64.powf(uniform(0.0, 1.0));
    let medium = Coefficients::from_sigma_tr(k * sigma_t_prime, sigma_t_prime);
    (medium, uniform(1.2, 1.6), uniform(0.0, 0.93))
}

fn wrong(count: usize, only: &str, seed: u64) -> Outcome {
    let choices = MODELS.map(|name| ModelChoice {
        name: name.to_owned(),
        ..ModelChoice::default()
    });
    // A form that uses g is judged with the medium's and without.
    let cases = choices.into_iter().flat_map(|choice| {
        let told = [false, true]
            .into_iter()
            .filter(|told| !told || choice.uses_g());
        told.map(|told| (told, choice.clone())).collect::<Vec<_>>()
    });
    for (told, choice) in cases {
        let name = format!("{}{}", choice.name, if told { ", told g" } else { "" });
        if !Discrepancy::is_known(&choice) || !name.contains(only) {
            continue;
        }
        let found = (0..count as u64)
            .into_par_iter()
            .filter_map(|i| {
                let mut rng = Pcg64::seed_from_u64(seed * 1_000_000 + 77_000 + i);
                let (medium, eta, g) = held_out(&mut rng);
                let truth = TransportModel::new(eta, g).ok()?;
                let choice = ModelChoice {
                    g: told.then_some(g),
                    ..choice.clone()
                };
                let (mut profile, mut total) =
                    noiseless(&truth, fresnel::entry_factor(eta, 1.0), medium);
                let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
                let u_scale = 0.005;
                let off = 1.0 + u_scale * normal();
                total.total_reflectance = 0.0;
                for p in &mut profile.points {
                    p.reflectance_per_mm2 =
                        off * p.reflectance_per_mm2 + p.u_reflectance_per_mm2 * normal();
                    total.total_reflectance += p.area_mm2() * p.reflectance_per_mm2;
                }
                let fitted = |discrepancy, constraint| {
                    let given = Given {
                        discrepancy,
                        constraint,
                        ..given(choice.clone(), eta)
                    };
                    fit_channel(&profile, Some(&total), &scale(u_scale), &given).ok()
                };
                let with = fitted(true, Constraint::Joint);
                Some((
                    medium,
                    with,
                    fitted(false, Constraint::Joint),
                    fitted(false, Constraint::Exact),
                ))
            })
            .collect::<Vec<_>>();
        println!("{name}, {} captures", found.len());
        type Choose = fn(&(Coefficients, Option<Fit>, Option<Fit>, Option<Fit>)) -> &Option<Fit>;
        let choices: [(&str, Choose); 3] = [
            ("joint with discrepancy", |f| &f.1),
            ("joint, noise only", |f| &f.2),
            ("exact, noise only", |f| &f.3),
        ];
        for (how, choose) in choices {
            let fits: Vec<(Fit, Coefficients)> = found
                .iter()
                .filter_map(|f| Some((choose(f).clone()?, f.0)))
                .collect();
            let [a, s] = both(&fits);
            println!(
                "  {how} ({} failed)\n    σa:  {a}\n    σs′: {s}",
                found.len() - fits.len()
            );
        }
    }
    Ok(())
}

/// The 36 channels of Jensen's table, or those of them with `only` in their name.
fn channels(only: &str) -> Vec<(String, Coefficients, f64)> {
    library::materials()
        .into_iter()
        .map(|m| {
            let name = format!("{} {}", m.material, m.channel);
            (name, m.medium.coefficients(), m.medium.eta)
        })
        .filter(|(name, _, _)| name.contains(only))
        .collect()
}

fn efficiency(count: usize, only: &str) -> Outcome {
    let mut ratios = vec![];
    for (name, medium, eta) in channels(only) {
        let given = given(dipole(), eta);
        let model = library::model(&given.model, eta)?;
        let (profile, total) = noiseless(&*model, fresnel::entry_factor(eta, 1.0), medium);
        let scale = scale(0.005);
        // Noise-free data are fitted by the truth: the inverse of Fisher's matrix there.
        let bound = fit_channel(&profile, Some(&total), &scale, &given)?;
        let channel = Channel {
            profile: &profile,
            total: Some(&total),
            scale: &scale,
            given: &given,
        };
        let errors: Vec<Coefficients> = (0..count as u64)
            .into_par_iter()
            .filter_map(|i| {
                let (profile, total) = channel.drawn(medium, &mut Pcg64::seed_from_u64(i)).ok()?;
                let fit = fit_channel(&profile, total.as_ref(), &scale, &given).ok()?;
                Some(fit.coefficients())
            })
            .collect();
        let rms = |f: fn(&Coefficients) -> f64| {
            let squares = errors.iter().map(|c| (f(c) - f(&medium)).powi(2));
            (squares.sum::<f64>() / errors.len() as f64).sqrt()
        };
        let a = rms(|c| c.sigma_a) / bound.sigma_a.u;
        let s = rms(|c| c.sigma_s_prime) / bound.sigma_s_prime.u;
        println!("{name}: rms error over the bound: σa {a:.3}, σs′ {s:.3}");
        ratios.push((a, s));
    }
    println!(
        "median: σa {:.3}, σs′ {:.3}",
        median(ratios.iter().map(|r| r.0).collect()),
        median(ratios.iter().map(|r| r.1).collect())
    );
    Ok(())
}

fn bootstrap(count: usize, only: &str) -> Outcome {
    let mut worst = 0.0_f64;
    for (name, medium, eta) in channels(only) {
        let given = Given {
            u_eta: 0.01,
            u_length_relative: 0.005,
            u_fwhm_mm: 0.02,
            beam: Beam::Gaussian { fwhm_mm: 0.3 },
            pixel_mm: 0.04,
            ..given(dipole(), eta)
        };
        let model: Box<dyn ForwardModel> = library::model(&given.model, eta)?;
        let (profile, total) = noiseless(&*model, fresnel::entry_factor(eta, 1.0), medium);
        let scale = scale(0.005);
        let channel = Channel {
            profile: &profile,
            total: Some(&total),
            scale: &scale,
            given: &given,
        };
        // One capture of it; what the budget says of that one, and what replicas of its result do.
        let (profile, total) = channel.drawn(medium, &mut Pcg64::seed_from_u64(5))?;
        let fit = fit_channel(&profile, total.as_ref(), &scale, &given)?;
        let found = channel.bootstrap(fit.coefficients(), count, 1)?;
        let (a, s) = (
            fit.sigma_a.u / found.u_sigma_a_per_mm,
            fit.sigma_s_prime.u / found.u_sigma_s_prime_per_mm,
        );
        let far = fit.sigma_a.value > 3.0 * fit.sigma_a.u;
        println!(
            "{name}: budget over bootstrap: σa {a:.3}, σs′ {s:.3}; correlation {:.3} and {:.3}{}",
            fit.correlation,
            found.correlation,
            if far { "" } else { "; within 3 u of the bound" }
        );
        if far {
            worst = worst.max((a - 1.0).abs()).max((s - 1.0).abs());
        }
    }
    println!(
        "worst of those farther than 3 u from a bound: {:.1} %",
        100.0 * worst
    );
    Ok(())
}

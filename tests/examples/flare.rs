//! What stray light does to σa and σs′, and what is left of it when it is measured on the white:
//! marble and skin through lenses that spread none of the light, a permille and a percent of it.
//!
//!     cargo run --release -p beamspot-tests --example flare -- 40

#![expect(clippy::print_stdout, reason = "it is what the example is for")]

use fit::Fit;
use pipeline::fitting::{Given, fit_channel};
use pipeline::library::{self, ModelChoice};
use pipeline::measure::{Choices, Measurement, measure};
use pipeline::{Silent, capture, synthesis};
use std::error::Error;
use synth::{Camera, Channels, Sample};

/// The same data with the veil left in, by a fit that knows of none.
fn blind(found: &Measurement) -> Result<Fit, Box<dyn Error>> {
    let offset = found.radiance.veils[0].offset;
    let seen = found.measured[0].clone().less(-offset);
    let given = Given {
        directions: vec![],
        range_mm: Some(found.fits[0].range_mm),
        ..found.given[0].clone()
    };
    let scale = &found.radiance.scale_inputs[0];
    Ok(fit_channel(
        &seen.profile,
        Some(&seen.total),
        scale,
        &given,
    )?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let count: u64 = std::env::args().nth(1).map_or(Ok(40), |n| n.parse())?;
    let choices = Choices {
        confirm: false,
        ..Choices::default()
    };
    for (material, channel) in [("marble", "G"), ("skin1", "R")] {
        let rows = library::material(material)?;
        let row = rows.iter().find(|r| r.channel == channel).ok_or("no row")?;
        let truth = row.medium.coefficients();
        for flare_relative in [0.0, 0.001, 0.01] {
            let (mut with, mut without) = (vec![], vec![]);
            for seed in 1..=count {
                let sample = Sample {
                    material: material.to_owned(),
                    eta: row.medium.eta,
                    channels: vec![(channel.to_owned(), truth)],
                };
                let camera = Camera {
                    width: 256,
                    height: 256,
                    mm_per_pixel: 0.16,
                    channels: Channels::Mono,
                    beam_fwhm_mm: 1.0,
                    flare_relative,
                    exposures_s: vec![0.001, 0.004, 0.016, 0.064, 0.25, 1.0, 4.0],
                    ..Camera::default()
                };
                let folder = tempfile::tempdir()?;
                let target = folder.path().join("capture");
                let model = ModelChoice::default();
                let manifest =
                    synthesis::write(&sample, camera, &model, seed, &target, false, &Silent)?;
                let found = measure(&capture::load(&manifest)?, &choices, &Silent)?;
                without.push(blind(&found)?);
                with.push(found.fits[0].clone());
            }
            println!(
                "{material} {channel}, {} % of the light",
                100.0 * flare_relative
            );
            for (way, fits) in [("taken out", &with), ("left in", &without)] {
                let n = fits.len() as f64;
                let mean = |f: &dyn Fn(&Fit) -> f64| fits.iter().map(f).sum::<f64>() / n;
                let off = |fit: &Fit| fit.sigma_a.value / truth.sigma_a - 1.0;
                let pull = |fit: &Fit| (fit.sigma_a.value - truth.sigma_a) / fit.sigma_a.u;
                let scatter = |fit: &Fit| {
                    (fit.sigma_s_prime.value - truth.sigma_s_prime) / fit.sigma_s_prime.u
                };
                let inside = |z: &dyn Fn(&Fit) -> f64| {
                    100.0 * mean(&|fit| f64::from(u8::from(z(fit).abs() < 1.96)))
                };
                println!(
                    "  {way:9}: sigma_a off by {:+.3} % in the mean, rms {:.3} %, u {:.3} %; rms \
                     pull {:.2}; within 1.96 u: sigma_a {:.0} %, sigma_s' {:.0} %",
                    100.0 * mean(&off),
                    100.0 * mean(&|fit| off(fit).powi(2)).sqrt(),
                    100.0 * mean(&|fit| fit.sigma_a.u) / truth.sigma_a,
                    mean(&|fit| pull(fit).powi(2)).sqrt(),
                    inside(&pull),
                    inside(&scatter),
                );
            }
        }
    }
    Ok(())
}

//! What the beam's width does to σₛ′ of marble, and what is left of it when the beam is measured on
//! the white reference: a beam of 1 mm, photographed again and again.
//!
//!     cargo run --release -p beamspot-tests --example beam -- 100

#![expect(clippy::print_stdout, reason = "it is what the example is for")]

use physics::footprint::Beam;
use pipeline::fitting::{Given, fit_channel};
use pipeline::library::ModelChoice;
use pipeline::measure::{Choices, measure};
use pipeline::{Silent, capture, synthesis};
use std::error::Error;
use synth::{Camera, Channels};

fn main() -> Result<(), Box<dyn Error>> {
    let count: u64 = std::env::args().nth(1).map_or(Ok(100), |n| n.parse())?;
    let sample = synthesis::sample_of("marble")?;
    let (_, truth) = sample
        .channels
        .iter()
        .find(|(name, _)| name == "G")
        .ok_or("no G")?;
    let camera = Camera {
        width: 512,
        height: 512,
        mm_per_pixel: 0.06,
        channels: Channels::Mono,
        beam_fwhm_mm: 1.0,
        exposures_s: vec![0.001, 0.004, 0.016, 0.064, 0.25, 1.0, 4.0],
        ..Camera::default()
    };
    let choices = Choices {
        confirm: false,
        ..Choices::default()
    };
    let ways = [
        "measured on the white",
        "width stated",
        "taken as a point",
        "white taken as ideal",
    ];
    let mut pulls = vec![vec![]; ways.len()];
    for seed in 1..=count {
        let folder = tempfile::tempdir()?;
        let manifest = synthesis::write(
            &sample,
            camera.clone(),
            &ModelChoice::default(),
            seed,
            &folder.path().join("capture"),
            false,
            &Silent,
        )?;
        let loaded = capture::load(&manifest)?;
        let found = measure(&loaded, &choices, &Silent)?;
        let mut ideal = loaded.clone();
        ideal.capture.beam.fwhm_mm = None;
        ideal.capture.reference.sigma_a_per_mm = None;
        ideal.capture.reference.sigma_s_prime_per_mm = None;
        let ideal = measure(&ideal, &choices, &Silent)?;
        let (measured, scale) = (&found.measured[0], &found.radiance.scale_inputs[0]);
        let told = |beam: Beam| {
            let given = Given {
                beam,
                variants: vec![],
                ..found.given[0].clone()
            };
            fit_channel(&measured.profile, Some(&measured.total), scale, &given)
        };
        let fits = [
            found.fits[0].clone(),
            told(Beam::Gaussian { fwhm_mm: 1.0 })?,
            told(Beam::Point)?,
            ideal.fits[0].clone(),
        ];
        for (way, (fit, pulls)) in fits.iter().zip(&mut pulls).enumerate() {
            if seed == 1 {
                println!(
                    "{}: from {:.2} mm, reduced chi2 {:.2}, sigma_s' {:.4} u {:.4}, sigma_a {:.5} u {:.5}",
                    ways[way],
                    fit.range_mm.0,
                    fit.reduced_chi2,
                    fit.sigma_s_prime.value,
                    fit.sigma_s_prime.u,
                    fit.sigma_a.value,
                    fit.sigma_a.u
                );
            }
            let of =
                |e: &fit::Estimate, truth: f64| (e.value / truth - 1.0, (e.value - truth) / e.u);
            pulls.push([
                of(&fit.sigma_s_prime, truth.sigma_s_prime),
                of(&fit.sigma_a, truth.sigma_a),
            ]);
        }
    }
    for (way, pulls) in ways.iter().zip(&pulls) {
        for (index, name) in ["sigma_s'", "sigma_a"].iter().enumerate() {
            let mean = |f: &dyn Fn(&(f64, f64)) -> f64| {
                pulls.iter().map(|p| f(&p[index])).sum::<f64>() / pulls.len() as f64
            };
            let inside = |limit: f64| mean(&|p| f64::from(u8::from(p.1.abs() < limit)));
            println!(
                "{way:22} {name:8}: mean off by {:+.3} %, {:+.2} u; within 1 u {:.0} %, within 2 u {:.0} %",
                100.0 * mean(&|p| p.0),
                mean(&|p| p.1),
                100.0 * inside(1.0),
                100.0 * inside(2.0)
            );
        }
    }
    Ok(())
}

//! Whether the uncertainties hold when everything goes through image files: captures photographed
//! with scale, index, pixel size and shutter drawn anew from their stated uncertainties, measured
//! from their frames. Prints how often the 95 % intervals hold the truth, and the standard
//! deviation of what was found over the median of the stated u.
//!
//!     cargo run --release -p beamspot-tests --example files -- 200 [white]
//!
//! With `white` the absorption of the white is drawn as well, from the u that it has where none is
//! stated.

#![expect(clippy::print_stdout, reason = "it is what the example is for")]

use formats::capture::PerChannel;
use physics::random::{stream, uniform};
use pipeline::library::ModelChoice;
use pipeline::measure::{Choices, measure};
use pipeline::{Silent, capture, synthesis};
use statrs::distribution::{ContinuousCDF, Normal};
use std::error::Error;
use synth::{Camera, Channels, WhiteReference};

/// What is stated of a white that absorbs as much as its reflectance of 0.99 has it, mm⁻¹.
const WHITE_SIGMA_A_PER_MM: f64 = 5e-5;

fn main() -> Result<(), Box<dyn Error>> {
    let count: u64 = std::env::args().nth(1).map_or(Ok(200), |n| n.parse())?;
    let white = match std::env::args().nth(2).as_deref() {
        None => false,
        Some("white") => true,
        Some(other) => return Err(format!("found `{other}`; expected `white` or nothing").into()),
    };
    let camera = Camera {
        width: 384,
        height: 384,
        mm_per_pixel: 0.08,
        u_mm_per_pixel: 0.0002,
        u_eta: 0.005,
        channels: Channels::Mono,
        exposures_s: vec![0.001, 0.004, 0.016, 0.064, 0.25, 1.0, 4.0],
        exposure_error_relative: 0.005,
        ..Camera::default()
    };
    let choices = Choices {
        confirm: false,
        ..Choices::default()
    };
    for (material, channel) in [("marble", "G"), ("skin1", "G")] {
        let mut sample = synthesis::sample_of(material)?;
        sample.channels.retain(|(name, _)| name == channel);
        let (_, truth) = sample.channels[0].clone();
        let truths = [truth.sigma_a, truth.sigma_s_prime];
        let mut found: [Vec<(f64, f64)>; 2] = [vec![], vec![]];
        let mut inside = [0_u64; 2];
        for seed in 1..=count {
            let folder = tempfile::tempdir()?;
            let target = folder.path().join("capture");
            let model = ModelChoice::default();
            let mut camera = camera.clone();
            if white {
                // By default u is half of what is stated; nothing absorbs less than nothing.
                let z = Normal::standard().inverse_cdf(uniform(&mut stream(seed, &[])));
                let truly = (WHITE_SIGMA_A_PER_MM * (1.0 + 0.5 * z)).max(0.0);
                camera.reference = WhiteReference {
                    sigma_a_per_mm: Some(vec![truly]),
                    ..camera.reference
                };
            }
            let manifest =
                synthesis::write(&sample, camera, &model, seed, &target, false, &Silent)?;
            let mut loaded = capture::load(&manifest)?;
            if white {
                let stated = &mut loaded.capture.reference;
                stated.sigma_a_per_mm = Some(PerChannel::All(WHITE_SIGMA_A_PER_MM));
                stated.u_sigma_a_per_mm = None;
            }
            let fits = measure(&loaded, &choices, &Silent)?.fits;
            let fit = &fits[0];
            for (k, e) in [&fit.sigma_a, &fit.sigma_s_prime].into_iter().enumerate() {
                found[k].push((e.value, e.u));
                inside[k] += u64::from(e.ci95.0 <= truths[k] && truths[k] <= e.ci95.1);
            }
        }
        for (k, name) in ["sigma_a", "sigma_s'"].into_iter().enumerate() {
            let n = found[k].len() as f64;
            let mean = found[k].iter().map(|f| f.0).sum::<f64>() / n;
            let squares: f64 = found[k].iter().map(|f| (f.0 - mean).powi(2)).sum();
            let deviation = (squares / (n - 1.0)).sqrt();
            let mut u: Vec<f64> = found[k].iter().map(|f| f.1).collect();
            u.sort_by(f64::total_cmp);
            let median = u[u.len() / 2];
            println!(
                "{material} {channel} {name:8}: {:.1} % of the intervals hold the truth; standard \
                 deviation over median u {:.3} ± {:.3}; mean off by {:+.2} u of one capture",
                100.0 * inside[k] as f64 / n,
                deviation / median,
                deviation / median / (2.0 * n).sqrt(),
                (mean - truths[k]) / median
            );
        }
    }
    Ok(())
}

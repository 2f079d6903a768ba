//! A camera of 8 bits that bends its counts, from files to coefficients.

use pipeline::library::ModelChoice;
use pipeline::measure::{Choices, Measurement, measure};
use pipeline::{Silent, capture, synthesis};
use std::fs;
use std::path::{Path, PathBuf};
use synth::{Camera, Channels, Sample};

/// The curve of sRGB.
fn encoded(light: f64) -> f64 {
    if light <= 0.003_130_8 {
        12.92 * light
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    }
}

/// A capture of linear 16-bit frames, and the same as a camera of 8 bits would have saved it.
fn photograph(folder: &Path, seed: u64) -> (Sample, PathBuf) {
    let mut sample = synthesis::sample_of("marble").unwrap();
    sample.channels = vec![sample.channels[1].clone()];
    let camera = Camera {
        width: 256,
        height: 256,
        mm_per_pixel: 0.16,
        channels: Channels::Mono,
        beam_fwhm_mm: 1.0,
        ..Camera::default()
    };
    let sensor = camera.sensor();
    let model = ModelChoice::default();
    let target = folder.join("capture");
    let manifest =
        synthesis::write(&sample, camera, &model, seed, &target, false, &Silent).unwrap();
    let text = fs::read_to_string(&manifest).unwrap();
    let loaded = capture::load(&manifest).unwrap();
    let range = sensor.white_level_dn - sensor.black_level_dn;
    for path in loaded
        .paths()
        .iter()
        .filter(|p| p.extension().is_some_and(|e| e == "tif"))
    {
        let frame = formats::decode_frame(&fs::read(path).unwrap())
            .unwrap()
            .frame;
        let mut bytes = format!("P5 {} {} 255\n", frame.width, frame.height).into_bytes();
        bytes.extend(frame.samples.to_f32().into_iter().map(|dn| {
            let light = (f64::from(dn) - sensor.black_level_dn) / range;
            (255.0 * encoded(light.clamp(0.0, 1.0))).round() as u8
        }));
        fs::write(path.with_extension("pgm"), bytes).unwrap();
    }
    let of_counts = ["gain_", "read_", "black_", "white_level", "prnu_"];
    let mut bent: Vec<String> = text
        .lines()
        .filter(|line| !of_counts.iter().any(|key| line.starts_with(key)))
        .map(|line| line.replace(".tif", ".pgm"))
        .collect();
    let at = bent.iter().position(|line| line == "[camera]").unwrap();
    bent.insert(at + 1, "response = \"recover\"".to_owned());
    let other = manifest.with_file_name("bent.toml");
    fs::write(&other, bent.join("\n")).unwrap();
    (sample, other)
}

fn measured(manifest: &Path) -> Measurement {
    let choices = Choices {
        confirm: false,
        ..Choices::default()
    };
    measure(&capture::load(manifest).unwrap(), &choices, &Silent).unwrap()
}

#[test]
fn a_camera_of_eight_bits_is_measured_with_what_that_costs() {
    for seed in 0..2 {
        let folder = tempfile::tempdir().unwrap();
        let (sample, manifest) = photograph(folder.path(), seed);
        let found = measured(&manifest);
        let straight = measured(&manifest.with_file_name("capture.toml"));
        let (truth, fit) = (sample.channels[0].1, &found.fits[0]);
        let pulls = [
            (fit.sigma_a.value - truth.sigma_a) / fit.sigma_a.u,
            (fit.sigma_s_prime.value - truth.sigma_s_prime) / fit.sigma_s_prime.u,
        ];
        let (curves, _) = found.radiance.curves.as_ref().unwrap();
        println!(
            "{seed}: sigma_a {:.6} u {:.6} ({:+.2} u), sigma_s' {:.4} u {:.4} ({:+.2} u), chi2 \
             {:.2}; linear u {:.6}; curve known to {:.4}, scatter {:.4}",
            fit.sigma_a.value,
            fit.sigma_a.u,
            pulls[0],
            fit.sigma_s_prime.value,
            fit.sigma_s_prime.u,
            pulls[1],
            fit.reduced_chi2,
            straight.fits[0].sigma_a.u,
            curves.channels[0].u_relative,
            curves.channels[0].scatter,
        );
        for line in &fit.budget {
            println!("  {} {:.2e}", line.source, line.u_sigma_a);
        }
        assert!(pulls.iter().all(|p| p.abs() < 3.0), "{pulls:?}");
        // Thousands of pixels in a ring make up for most of the rounding of each.
        let linear = &straight.fits[0].sigma_a;
        assert!(fit.sigma_a.u > linear.u && fit.sigma_a.u < 0.05 * truth.sigma_a);
        let curve = fit
            .budget
            .iter()
            .find(|l| l.source == "response of the camera");
        assert!(curve.is_some_and(|line| line.u_sigma_a > 0.0));
        let said = found.warnings.join("\n") + &found.assumptions.join("\n");
        for words in ["8 bits cost accuracy", "was recovered from"] {
            assert!(said.contains(words), "{said}");
        }
    }
}

#[test]
fn sixteen_bits_have_no_curve_to_recover() {
    let folder = tempfile::tempdir().unwrap();
    let (_, manifest) = photograph(folder.path(), 0);
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(&manifest, text.replace(".pgm", ".tif")).unwrap();
    let loaded = capture::load(&manifest).unwrap();
    let choices = Choices::default();
    let said = measure(&loaded, &choices, &Silent).unwrap_err().to_string();
    for words in [".tif", "16-bit", "camera.response"] {
        assert!(said.contains(words), "{said}");
    }
}

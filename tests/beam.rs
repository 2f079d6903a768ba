//! The beam measured on the white reference, from files to coefficients.

use fit::Fit;
use physics::Coefficients;
use physics::footprint::Beam;
use pipeline::beam::Source;
use pipeline::capture::{self, Loaded};
use pipeline::fitting::{Given, fit_channel};
use pipeline::library::ModelChoice;
use pipeline::measure::{Choices, Measurement, measure};
use pipeline::{Silent, synthesis};
use synth::{Camera, Channels};

/// A beam of 1 mm under a camera that sees 31 mm of marble.
fn camera() -> Camera {
    Camera {
        width: 256,
        height: 256,
        mm_per_pixel: 0.12,
        channels: Channels::Mono,
        beam_fwhm_mm: 1.0,
        exposures_s: vec![0.001, 0.004, 0.016, 0.064, 0.25, 1.0, 4.0],
        ..Camera::default()
    }
}

/// The capture of marble in green, and what made it.
fn photograph(camera: &Camera, seed: u64) -> (tempfile::TempDir, Loaded, Coefficients) {
    let sample = synthesis::sample_of("marble").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("capture");
    let model = ModelChoice::default();
    let manifest = synthesis::write(
        &sample,
        camera.clone(),
        &model,
        seed,
        &target,
        false,
        &Silent,
    )
    .unwrap();
    let loaded = capture::load(&manifest).unwrap();
    let green = sample
        .channels
        .iter()
        .find(|(name, _)| name == "G")
        .unwrap();
    (folder, loaded, green.1)
}

fn measured(loaded: &Loaded) -> Measurement {
    let choices = Choices {
        confirm: false,
        ..Choices::default()
    };
    measure(loaded, &choices, &Silent).unwrap()
}

/// (found − true)/u of σₐ and σₛ′.
fn pulls(fit: &Fit, truth: Coefficients) -> [f64; 2] {
    let pull = |e: &fit::Estimate, truth: f64| (e.value - truth) / e.u;
    [
        pull(&fit.sigma_a, truth.sigma_a),
        pull(&fit.sigma_s_prime, truth.sigma_s_prime),
    ]
}

#[test]
fn a_beam_of_a_millimetre_on_marble_is_taken_out() {
    let count = 6;
    let mut sums = [0.0; 2];
    for seed in 0..count {
        let (_folder, loaded, truth) = photograph(&camera(), 40 + seed);
        let found = measured(&loaded);
        let beam = &found.beams[0];
        assert_eq!(beam.source, Source::White);
        // The pixel's square widens a Gaussian by its second moment, 0.4 %.
        assert!(
            (beam.fwhm_mm / 1.0033 - 1.0).abs() < 3.0 * beam.u_fwhm_mm,
            "{beam:?}"
        );
        let fit = &found.fits[0];
        // Nearer than the four standard deviations, 1.7 mm, of a width that is only stated.
        assert!(fit.range_mm.0 < 1.1 && fit.reduced_chi2 < 1.6, "{fit:?}");
        let pulls = pulls(fit, truth);
        println!(
            "{seed}: beam {:.4} u {:.4}, pulls {pulls:.2?}",
            beam.fwhm_mm, beam.u_fwhm_mm
        );
        assert!(pulls.iter().all(|p| p.abs() < 3.5), "{pulls:?}");
        for (sum, pull) in sums.iter_mut().zip(pulls) {
            *sum += pull / count as f64;
        }
        if seed == 0 {
            // The same data by a fit that knows of no beam.
            let (data, scale) = (&found.measured[0], &found.radiance.scale_inputs[0]);
            let told = Given {
                beam: Beam::Point,
                variants: vec![],
                range_mm: Some(fit.range_mm),
                ..found.given[0].clone()
            };
            let blind = fit_channel(&data.profile, Some(&data.total), scale, &told).unwrap();
            let off = |fit: &Fit| (fit.sigma_a.value / truth.sigma_a - 1.0).abs();
            println!(
                "without: sigma_a off by {:.4}, with {:.4}",
                off(&blind),
                off(fit)
            );
            assert!(off(&blind) > 10.0 * off(fit) && blind.reduced_chi2 > 100.0);
        }
    }
    // Six means of unit pulls scatter by 0.41: this would see a bias of 1.2 u.
    assert!(sums.iter().all(|s| s.abs() < 1.2), "{sums:?}");
}

#[test]
fn the_sources_of_a_beam_have_an_order() {
    let (_folder, loaded, truth) = photograph(&camera(), 50);
    let document = |loaded: &Loaded| {
        let found = measured(loaded);
        let text = found.document().to_json().unwrap();
        (found, text)
    };
    // A stated width that the white contradicts is named, and the white believed.
    let mut wrong = loaded.clone();
    wrong.capture.beam.fwhm_mm = Some(0.7);
    let (found, text) = document(&wrong);
    assert_eq!(found.beams[0].source, Source::White);
    let said = found.warnings.join("\n");
    assert!(
        said.contains("where beam.fwhm_mm = 0.7 lets expect"),
        "{said}"
    );
    assert!(text.contains("\"source\": \"white\"") && text.contains("\"stated_fwhm_mm\": 0.7"));
    assert!(pulls(&found.fits[0], truth).iter().all(|p| p.abs() < 3.5));
    let (right, _) = document(&loaded);
    assert!(right.warnings.is_empty(), "{:?}", right.warnings);

    // A white of which nothing is known comes after a stated width,
    let mut unknown = loaded.clone();
    unknown.capture.reference.sigma_a_per_mm = None;
    unknown.capture.reference.sigma_s_prime_per_mm = None;
    let (found, _) = document(&unknown);
    assert_eq!(found.beams[0].source, Source::Stated);
    assert_eq!(found.given[0].beam, Beam::Gaussian { fwhm_mm: 1.0 });
    // and serves, with its glow in u and a warning, where there is none.
    unknown.capture.beam.fwhm_mm = None;
    let (found, _) = document(&unknown);
    let beam = &found.beams[0];
    assert_eq!(beam.source, Source::IdealWhite);
    assert!(
        beam.fwhm_mm > 1.0 && (beam.fwhm_mm - 1.0) < 3.0 * beam.u_fwhm_mm,
        "{} {}",
        beam.fwhm_mm,
        beam.u_fwhm_mm
    );
    let said = found.warnings.join("\n");
    assert!(said.contains("as if that were an ideal surface"), "{said}");
    let pulls = pulls(&found.fits[0], truth);
    assert!(pulls.iter().all(|p| p.abs() < 3.0), "{pulls:?}");
}

#[test]
fn a_white_that_is_poorly_known_widens_u() {
    let (_folder, mut loaded, truth) = photograph(&camera(), 51);
    let sure = measured(&loaded);
    // Ten percent off, and stated to be known to ten.
    loaded.capture.reference.u_sigma_s_prime_relative = Some(0.1);
    loaded.capture.reference.sigma_s_prime_per_mm =
        Some(formats::capture::PerChannel::All(1.1 * 20.4));
    let unsure = measured(&loaded);
    assert!(unsure.beams[0].u_fwhm_mm > 1.2 * sure.beams[0].u_fwhm_mm);
    let (a, b) = (&sure.fits[0], &unsure.fits[0]);
    println!("{:?} {:?}", pulls(a, truth), pulls(b, truth));
    assert!(b.sigma_s_prime.u > 1.2 * a.sigma_s_prime.u, "{a:?} {b:?}");
    assert!(pulls(b, truth).iter().all(|p| p.abs() < 3.0));
}

//! Views that are tilted, pixels that are not square: what made the pictures comes back.

use fit::Fit;
use pipeline::library::ModelChoice;
use pipeline::measure::{Choices, Measurement, measure};
use pipeline::{Silent, capture, synthesis};
use std::path::Path;
use synth::{Camera, Sample};

fn small() -> Camera {
    Camera {
        width: 320,
        height: 320,
        mm_per_pixel: 0.12,
        beam_fwhm_mm: 1.0,
        ..Camera::default()
    }
}

fn photograph(folder: &Path, camera: &Camera, seed: u64) -> (Sample, std::path::PathBuf) {
    let sample = synthesis::sample_of("marble").unwrap();
    let target = folder.join("capture");
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
    (sample, manifest)
}

fn measured(manifest: &Path) -> Measurement {
    let choices = Choices {
        confirm: false,
        ..Choices::default()
    };
    measure(&capture::load(manifest).unwrap(), &choices, &Silent).unwrap()
}

/// (measured − true)/u of every coefficient, which must lie within 3.
fn check(label: &str, sample: &Sample, fits: &[Fit]) -> String {
    let mut lines = vec![];
    for ((name, truth), fit) in sample.channels.iter().zip(fits) {
        let pulls = [
            (fit.sigma_a.value - truth.sigma_a) / fit.sigma_a.u,
            (fit.sigma_s_prime.value - truth.sigma_s_prime) / fit.sigma_s_prime.u,
        ];
        let off = [
            fit.sigma_a.value / truth.sigma_a - 1.0,
            fit.sigma_s_prime.value / truth.sigma_s_prime - 1.0,
        ];
        lines.push(format!(
            "{label} {name}: {:+.2} u, {:+.2} u ({:+.3} %, {:+.3} %), chi2 {:.2}",
            pulls[0],
            pulls[1],
            100.0 * off[0],
            100.0 * off[1],
            fit.reduced_chi2
        ));
        assert!(
            pulls.iter().all(|p| p.abs() < 3.0),
            "{label} {name}: {pulls:?}"
        );
        // The beam is known: nothing but noise and the white is uncertain.
        assert!(
            off.iter().all(|o| o.abs() < 0.02),
            "{label} {name}: {off:?}"
        );
    }
    lines.join("\n")
}

#[test]
fn a_tilted_capture_recovers_the_coefficients() {
    let folder = tempfile::tempdir().unwrap();
    for (label, camera) in [
        (
            "tilted by 30 degrees",
            Camera {
                camera_angle_deg: 30.0,
                camera_distance_mm: Some(150.0),
                ..small()
            },
        ),
        (
            "pixels higher than wide",
            Camera {
                pixel_aspect: 1.4,
                ..small()
            },
        ),
    ] {
        let (sample, manifest) = photograph(&folder.path().join(label), &camera, 3);
        let text = std::fs::read_to_string(&manifest).unwrap();
        let tilted = camera.camera_distance_mm.is_some();
        assert_eq!(text.contains("corners_mm"), tilted, "{text}");
        let measurement = measured(&manifest);
        println!("{}", check(label, &sample, &measurement.fits));
        let said = measurement.assumptions.join("\n");
        assert_eq!(
            said.contains("camera.angle_deg was not given; 30.0 was taken"),
            tilted,
            "{said}"
        );
    }
}

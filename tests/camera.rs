//! Cameras of which the manifest does not tell everything, or tells something wrong.

use fit::Fit;
use formats::parse_capture;
use physics::Sensor;
use pipeline::capture::{self, Loaded};
use pipeline::library::ModelChoice;
use pipeline::measure::{Choices, Measurement, measure};
use pipeline::{Silent, synthesis};
use std::path::Path;
use synth::{Camera, Sample};

/// A camera of 256 × 256 pixels that sees 41 mm of the sample.
fn small() -> Camera {
    Camera {
        width: 256,
        height: 256,
        mm_per_pixel: 0.16,
        beam_fwhm_mm: 1.0,
        ..Camera::default()
    }
}

fn photograph(folder: &Path, camera: &Camera, seed: u64) -> (Sample, Loaded) {
    let sample = synthesis::sample_of("marble").unwrap();
    let target = folder.join("capture");
    let manifest = synthesis::write(
        &sample,
        camera.clone(),
        &ModelChoice::default(),
        seed,
        &target,
        false,
        &Silent,
    )
    .unwrap();
    (sample, capture::load(&manifest).unwrap())
}

/// The manifest without what `drop` names.
fn without(loaded: &Loaded, drop: &[&str]) -> Loaded {
    let text = std::fs::read_to_string(&loaded.input.path).unwrap();
    let kept: Vec<&str> = text
        .lines()
        .filter(|line| !drop.iter().any(|key| line.starts_with(key)))
        .collect();
    Loaded {
        capture: parse_capture(&kept.join("\n")).unwrap(),
        ..loaded.clone()
    }
}

/// (measured − true)/u of every coefficient.
fn pulls(sample: &Sample, fits: &[Fit]) -> Vec<f64> {
    let truth = sample.channels.iter().map(|(_, c)| *c);
    let pull = |e: &fit::Estimate, truth: f64| (e.value - truth) / e.u;
    truth
        .zip(fits)
        .flat_map(|(c, f)| {
            [
                pull(&f.sigma_a, c.sigma_a),
                pull(&f.sigma_s_prime, c.sigma_s_prime),
            ]
        })
        .collect()
}

fn choices() -> Choices {
    Choices {
        confirm: false,
        ..Choices::default()
    }
}

fn measured(loaded: &Loaded) -> Measurement {
    measure(loaded, &choices(), &Silent).unwrap()
}

const NUMBERS: [&str; 4] = [
    "gain_e_per_dn",
    "read_noise_e",
    "black_level_dn",
    "white_level_dn",
];

#[test]
fn a_camera_without_numbers_is_estimated() {
    let twelve = Camera {
        bits: 12,
        ..small()
    };
    for (camera, seed) in [(small(), 1), (small(), 2), (twelve, 3)] {
        let folder = tempfile::tempdir().unwrap();
        let (sample, stated) = photograph(folder.path(), &camera, seed);
        let truth: Sensor = camera.sensor();
        let bare = without(
            &stated,
            &[
                "[camera]",
                "angle_deg = 0",
                "prnu",
                NUMBERS[0],
                NUMBERS[1],
                NUMBERS[2],
                NUMBERS[3],
            ],
        );
        assert_eq!(bare.capture.camera, formats::capture::Camera::default());
        let sensing = bare.sensing(&Silent).unwrap();
        let found = sensing.sensor;
        println!("{found:?} for {truth:?}");
        for f in &sensing.found {
            println!("  {}", f.line());
        }
        assert!(
            (found.gain_e_per_dn / truth.gain_e_per_dn - 1.0).abs() < 0.01,
            "{found:?}"
        );
        assert!(
            (found.read_noise_e / truth.read_noise_e - 1.0).abs() < 0.05,
            "{found:?}"
        );
        assert!(
            (found.black_level_dn - truth.black_level_dn).abs() < 0.2,
            "{found:?}"
        );
        // Never above what the camera itself states, but for the spread of the pile-up.
        assert!(
            (found.white_level_dn / truth.white_level_dn - 1.0).abs() < 0.01,
            "{found:?}"
        );
        for (field, want) in [
            ("gain_e_per_dn", truth.gain_e_per_dn),
            ("read_noise_e", truth.read_noise_e),
        ] {
            let f = sensing
                .found
                .iter()
                .find(|f| f.field.ends_with(field))
                .unwrap();
            let e = f.estimate.unwrap();
            assert!(
                (e.value - want).abs() < 4.0 * e.u,
                "{field}: {e:?} for {want}"
            );
        }
        let (with, out) = (measured(&stated), measured(&bare));
        let (a, b) = (pulls(&sample, &with.fits), pulls(&sample, &out.fits));
        println!("pulls stated {a:.2?}, estimated {b:.2?}");
        assert!(b.iter().all(|p| p.abs() < 4.0), "{b:?}");
        // The coefficients themselves hardly care.
        assert!(
            a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 0.5),
            "{a:?} {b:?}"
        );
        for number in NUMBERS {
            let line = format!("camera.{number} was not given;");
            assert!(
                out.assumptions.iter().any(|a| a.contains(&line)),
                "{:?}",
                out.assumptions
            );
            assert!(!with.assumptions.iter().any(|a| a.contains(number)));
        }
    }
}

#[test]
fn what_is_stated_stays_and_only_the_rest_is_estimated() {
    let folder = tempfile::tempdir().unwrap();
    let (_, stated) = photograph(folder.path(), &small(), 4);
    for missing in NUMBERS {
        let sensing = without(&stated, &[missing]).sensing(&Silent).unwrap();
        assert_eq!(sensing.found.len(), 1, "{missing}");
        assert_eq!(sensing.found[0].field, format!("camera.{missing}"));
        let truth = stated.sensing(&Silent).unwrap();
        assert!(truth.found.is_empty());
        let (a, b) = (sensing.sensor, truth.sensor);
        for (a, b, tolerance) in [
            (a.gain_e_per_dn, b.gain_e_per_dn, 0.01),
            (a.read_noise_e, b.read_noise_e, 0.05),
            (a.black_level_dn, b.black_level_dn, 0.001),
            (a.white_level_dn, b.white_level_dn, 0.001),
        ] {
            assert!((a / b - 1.0).abs() < tolerance, "{missing}: {sensing:?}");
        }
    }
}

#[test]
fn a_shutter_that_is_off_by_percents_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    for seed in 1..4 {
        let camera = Camera {
            exposure_error_relative: 0.03,
            ..small()
        };
        let name = format!("{seed}");
        let here = folder.path().join(name);
        let (sample, loaded) = photograph(&here, &camera, seed);
        let found = measured(&loaded);
        let pulls = pulls(&sample, &found.fits);
        println!("{pulls:.2?}");
        assert!(pulls.iter().all(|p| p.abs() < 4.0), "{pulls:?}");
        let scale = found.radiance.scales[0].u_relative;
        // 0.5 % of the certificate, and two medians of 13 draws of 3 %, which is 1.5 %.
        assert!((0.006..0.035).contains(&scale), "{scale}");
        let notes = found.radiance.merge_lines.join("\n");
        assert!(
            notes.contains("took the place of the stated ones"),
            "{notes}"
        );
        assert!(notes.contains("against what is stated"), "{notes}");
        assert!(
            found
                .assumptions
                .iter()
                .any(|a| a.starts_with("exposures are off"))
        );
        // The profile has its shape back: no jump where one exposure gives way to the next.
        for fit in &found.fits {
            assert!(fit.reduced_chi2 < 2.0, "{fit:?}");
        }
    }
}

#[test]
fn exact_exposures_are_used_as_stated() {
    let folder = tempfile::tempdir().unwrap();
    let (_, loaded) = photograph(folder.path(), &small(), 7);
    let notes = measured(&loaded).radiance.merge_lines;
    for subject in ["sample", "reference"] {
        let line = format!("{subject}: exposures measured from the overlap of the frames agree");
        assert!(notes.iter().any(|n| n.starts_with(&line)), "{notes:?}");
    }
}

fn refusal(loaded: &Loaded) -> String {
    measure(loaded, &choices(), &Silent)
        .unwrap_err()
        .to_string()
}

#[test]
fn an_exposure_thirty_percent_off_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (_, mut loaded) = photograph(folder.path(), &small(), 8);
    let sample = &mut loaded.capture.sample;
    for entry in sample.frames.iter_mut().chain(&mut sample.dark) {
        if entry.exposure_s == 0.032 {
            entry.exposure_s = 0.0416;
        }
    }
    let error = refusal(&loaded);
    for word in ["sample_06.tif: exposed 0.03", "exposure_s = 0.0416"] {
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn a_frame_that_was_shifted_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (_, loaded) = photograph(folder.path(), &small(), 9);
    let path = folder.path().join("capture/reference/reference_05.tif");
    let mut frame = formats::decode_frame(&std::fs::read(&path).unwrap())
        .unwrap()
        .frame;
    // Half a pixel to the right: the mean of each pixel and the one on its left.
    let before = frame.samples.to_f32();
    let smeared: Vec<u16> = (0..before.len())
        .map(|i| match i.checked_sub(frame.channels) {
            Some(left) => (0.5 * (before[i] + before[left])) as u16,
            None => before[i] as u16,
        })
        .collect();
    frame.samples = smeared.into();
    let mut bytes = std::io::Cursor::new(vec![]);
    formats::encode_tiff(&frame, &mut bytes).unwrap();
    std::fs::write(&path, bytes.into_inner()).unwrap();
    // Less than a pixel, which is not interpolated: named, and left in.
    let said = measured(&loaded).radiance.merge_lines.join("\n");
    for word in [
        "reference_05.tif: shifted by +0.",
        "right",
        "left as it is, as blur",
    ] {
        assert!(said.contains(word), "{said}");
    }
}

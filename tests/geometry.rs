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

/// A mask over a scratch and over what a label hides, a region and sectors: what is left of each ring stands for it.
#[test]
fn masks_regions_and_sectors_leave_out_what_they_cover() {
    let folder = tempfile::tempdir().unwrap();
    let (sample, manifest) = photograph(folder.path(), &small(), 5);
    let here = manifest.parent().unwrap();
    let original = std::fs::read_to_string(&manifest).unwrap();
    // A black label on every frame of the sample: columns 200 to 260, rows 40 to 130.
    let labelled = |x: usize, y: usize| (200..260).contains(&x) && (40..130).contains(&y);
    for file in std::fs::read_dir(here.join("sample")).unwrap() {
        let path = file.unwrap().path();
        if !path
            .file_name()
            .unwrap()
            .to_string_lossy()
            .starts_with("sample_")
        {
            continue;
        }
        let bytes = std::fs::read(&path).unwrap();
        let mut frame = formats::decode_frame(&bytes).unwrap().frame;
        let mut samples: Vec<u16> = frame.samples.to_f32().iter().map(|v| *v as u16).collect();
        for (i, sample) in samples.iter_mut().enumerate() {
            let pixel = i / frame.channels;
            if labelled(pixel % frame.width, pixel / frame.width) {
                *sample = 200;
            }
        }
        frame.samples = samples.into();
        let mut bytes = std::io::Cursor::new(vec![]);
        formats::encode_tiff(&frame, &mut bytes).unwrap();
        std::fs::write(&path, bytes.into_inner()).unwrap();
    }
    let mask: Vec<u16> = (0..320 * 320)
        .map(|i| u16::from(labelled(i % 320, i / 320)))
        .collect();
    let mask = physics::Frame {
        width: 320,
        height: 320,
        channels: 1,
        samples: mask.into(),
    };
    let mut bytes = std::io::Cursor::new(vec![]);
    formats::encode_tiff(&mask, &mut bytes).unwrap();
    std::fs::write(here.join("label.tif"), bytes.into_inner()).unwrap();
    let with = |keys: &str| {
        let text = original.replacen("[sample]", &format!("[sample]\n{keys}"), 1);
        std::fs::write(&manifest, text).unwrap();
        measured(&manifest)
    };
    let polygon = "leave_out = [{ polygon_px = [[199.5, 39.5], [259.5, 39.5], [259.5, 129.5], [199.5, 129.5]] }]";
    let masked = with("mask = \"label.tif\"");
    println!("{}", check("mask", &sample, &masked.fits));
    let said = masked.radiance.merge_lines.join("\n");
    assert!(
        said.contains("sample: 5400 px (5.27 %) left out by mask label.tif"),
        "{said}"
    );
    let inputs: Vec<&str> = masked
        .radiance
        .inputs
        .iter()
        .map(|i| i.name.as_str())
        .collect();
    assert!(inputs.contains(&"label.tif"), "{inputs:?}");
    let said = masked.assumptions.join("\n");
    assert!(
        said.contains("of the light inside the circle was left out"),
        "{said}"
    );
    // A polygon over the same pixels is the same.
    let outlined = with(polygon);
    assert_eq!(outlined.profiles(), masked.profiles());
    // The half of the picture that the label is not in: rows below the spot.
    let half = with("sectors_deg = [[5, 175]]");
    println!("{}", check("sectors", &sample, &half.fits));
    assert!(
        half.measured
            .iter()
            .all(|m| (0.4..0.65).contains(&m.unseen_share))
    );
    // Unmasked, the label is in the profile: the test would notice if nothing were left out.
    let whole = with("");
    let of = |m: &Measurement| m.measured[1].total.total_reflectance;
    println!(
        "{:.5} whole, {:.5} masked, {:.5} half",
        of(&whole),
        of(&masked),
        of(&half)
    );
    let worst = |m: &Measurement| m.fits.iter().map(|f| f.reduced_chi2).fold(0.0, f64::max);
    println!(
        "chi2 {:.2} whole, {:.2} masked",
        worst(&whole),
        worst(&masked)
    );
    assert_ne!(whole.profiles(), masked.profiles());
    // Whatever the label hides counts as the rest of its rings: totals agree with the half's.
    assert!((of(&half) / of(&masked) - 1.0).abs() < 1e-3);
}

#[test]
fn frames_that_moved_are_put_back() {
    let folder = tempfile::tempdir().unwrap();
    let camera = Camera {
        frame_shift_px: 1.5,
        ..small()
    };
    let (sample, manifest) = photograph(folder.path(), &camera, 11);
    let measurement = measured(&manifest);
    println!("{}", check("shifted frames", &sample, &measurement.fits));
    let said = measurement.radiance.merge_lines.join("\n");
    println!("{said}");
    let moved = said.matches("moved back by whole pixels").count();
    assert!(moved > 10, "{said}");
}

/// An oblique beam, from files: what enters at one place glows about another. The entry is a compact
/// spot of an ink, the glow that of marble photographed 12 px to the right, added count by count.
#[test]
fn an_oblique_beam_enters_at_one_place_and_glows_about_another() {
    let folder = tempfile::tempdir().unwrap();
    let camera = |offset: f64| Camera {
        channels: synth::Channels::Mono,
        beam_angle_deg: 45.0,
        spot_offset_px: [offset, 0.0],
        beam_fwhm_mm: 0.6,
        full_well_e: 12_000.0,
        ..small()
    };
    let one = |name: &str, sigma_a: f64, sigma_s_prime: f64, offset: f64| {
        let at = physics::Coefficients {
            sigma_a,
            sigma_s_prime,
        };
        let sample = Sample {
            material: name.to_owned(),
            eta: 1.5,
            channels: vec![("Y".to_owned(), at)],
        };
        let target = folder.path().join(name);
        let model = ModelChoice::default();
        synthesis::write(&sample, camera(offset), &model, 5, &target, false, &Silent).unwrap()
    };
    let manifest = one("marble", 0.004, 2.6, 12.0);
    let ink = one("ink", 0.5, 60.0, 0.0);
    let (glow, spot) = (
        capture::load(&manifest).unwrap(),
        capture::load(&ink).unwrap(),
    );
    let frame = |path: &Path| {
        formats::decode_frame(&std::fs::read(path).unwrap())
            .unwrap()
            .frame
    };
    for (a, b) in glow
        .capture
        .sample
        .frames
        .iter()
        .zip(&spot.capture.sample.frames)
    {
        let path = glow.folder.join(&a.file);
        let (mut sum, other) = (frame(&path), frame(&spot.folder.join(&b.file)));
        let both = sum.samples.to_f32().into_iter().zip(other.samples.to_f32());
        let counts: Vec<u16> = both
            .map(|(a, b)| (a + b - 200.0).clamp(0.0, 24_200.0) as u16)
            .collect();
        sum.samples = counts.into();
        let mut bytes = std::io::Cursor::new(vec![]);
        formats::encode_tiff(&sum, &mut bytes).unwrap();
        std::fs::write(&path, bytes.into_inner()).unwrap();
    }
    let found = measured(&manifest);
    let said = found.assumptions.join("\n");
    println!("{said}");
    // Both places are reported: the middle of the frame, and 12 px to its right.
    let words = [
        "the beam comes at 45 degrees and enters at (",
        "the glow is centred at (",
    ];
    let places = words.map(|word| {
        let rest = said.split(word).nth(1).unwrap();
        let column = rest.split(',').next().unwrap();
        column.parse::<f64>().unwrap()
    });
    assert!((places[0] - 159.5).abs() < 1.0, "{places:?}");
    assert!((places[1] - 171.5).abs() < 1.0, "{places:?}");
    let distance = 12.0 * 0.12;
    let apart = (places[1] - places[0]) * 0.12;
    assert!((apart - distance).abs() < 0.15, "{apart}");
    // The profile is that about the glow.
    assert!((found.measured[0].center_px[0] - places[1]).abs() < 0.01);
}

//! Cameras whose photosites see one colour each: measured as they are, nothing demosaiced.

use fit::Fit;
use pipeline::capture::{self, Loaded};
use pipeline::library::ModelChoice;
use pipeline::measure::{Choices, Measurement, measure, radiance};
use pipeline::{Silent, synthesis};
use std::path::Path;
use synth::{Camera, Sample};

const X_TRANS: &str = "GBGGRGRGRBGBGBGGRGGRGGBGBGBRGRGRGGBG";

fn camera(pattern: &str) -> Camera {
    Camera {
        // No whole number of cells, of either kind.
        width: 401,
        height: 399,
        mm_per_pixel: 0.08,
        beam_fwhm_mm: 0.6,
        spot_offset_px: [7.3, -5.6],
        mosaic: Some(pattern.parse().unwrap()),
        ..Camera::default()
    }
}

fn photograph(folder: &Path, camera: &Camera) -> (Sample, Loaded) {
    let sample = synthesis::sample_of("marble").unwrap();
    let manifest = synthesis::write(
        &sample,
        camera.clone(),
        &ModelChoice::default(),
        5,
        &folder.join("capture"),
        false,
        &Silent,
    )
    .unwrap();
    (sample, capture::load(&manifest).unwrap())
}

fn measured(loaded: &Loaded) -> Measurement {
    let choices = Choices {
        confirm: false,
        ..Choices::default()
    };
    measure(loaded, &choices, &Silent).unwrap()
}

/// Measured over true less 1, and that in standard uncertainties, of every coefficient.
fn errors(sample: &Sample, fits: &[Fit]) -> Vec<(f64, f64)> {
    let error = |e: &fit::Estimate, truth: f64| (e.value / truth - 1.0, (e.value - truth) / e.u);
    let truth = sample.channels.iter().map(|(_, c)| *c);
    truth
        .zip(fits)
        .flat_map(|(c, f)| {
            [
                error(&f.sigma_a, c.sigma_a),
                error(&f.sigma_s_prime, c.sigma_s_prime),
            ]
        })
        .collect()
}

#[test]
fn coefficients_come_back_from_a_mosaic() {
    for pattern in ["GRBG", X_TRANS] {
        let folder = tempfile::tempdir().unwrap();
        let camera = camera(pattern);
        let (sample, loaded) = photograph(folder.path(), &camera);
        let found = measured(&loaded);
        for (relative, in_u) in errors(&sample, &found.fits) {
            println!("{pattern}: {relative:+.2e}, {in_u:+.2} u");
            // Noise alone; a neighbour of another colour taken for one's own is off by percents.
            assert!(
                relative.abs() < 3e-3 && in_u.abs() < 3.0,
                "{pattern}: {relative} {in_u}"
            );
        }
        // The spot is found from photosites that lie on different pixels in each colour.
        let [x, y] = camera.spot_px();
        for m in &found.measured {
            let [found_x, found_y] = m.center_px;
            let off = (found_x - x).hypot(found_y - y);
            assert!(off < 0.02, "{pattern}, {}: {off} px", m.profile.channel);
            // Other colours are no lost pixels.
            assert!(m.unmeasured_pixels < 50, "{}", m.unmeasured_pixels);
        }
        let names: Vec<&str> = found.fits.iter().map(|f| f.channel.as_str()).collect();
        assert_eq!(names, ["R", "G", "B"]);
        let said = found.radiance.merge_lines.join("\n");
        for line in [
            format!("sample: mosaic {pattern}: each channel has its own photosites"),
            "sample: 401 x 399 px are no whole number of cells".to_owned(),
            "reference: hot pixels masked: R ".to_owned(),
            "sample, R: of the pixels about the spot, ".to_owned(),
        ] {
            assert!(said.contains(&line), "{line}: {said}");
        }
        // One plane with its pattern, in the file as in memory.
        let map = &found.radiance.map;
        assert_eq!(map.channels.len(), 1);
        let mut bytes = vec![];
        formats::write_radiance(&found.radiance.to_file(&loaded), &mut bytes).unwrap();
        let back = formats::read_radiance(std::io::Cursor::new(&bytes)).unwrap();
        assert_eq!(&*back.map, map);
        assert!(bytes.len() < 401 * 399 * 8 + 20_000, "{}", bytes.len());
    }
}

#[test]
fn a_pattern_that_contradicts_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let small = Camera {
        width: 64,
        height: 64,
        exposures_s: vec![0.01, 0.1],
        ..camera("RGGB")
    };
    let (_, loaded) = photograph(folder.path(), &small);
    // Colours in three planes are no mosaic.
    let colours = folder.path().join("rgb");
    let rgb = Camera {
        mosaic: None,
        ..small.clone()
    };
    let (_, mut rgb) = photograph(&colours, &rgb);
    rgb.capture.camera.mosaic = loaded.capture.camera.mosaic;
    let error = radiance(&rgb, &Silent).unwrap_err().to_string();
    assert!(
        error.contains("has 3 channels, and camera.mosaic is given"),
        "{error}"
    );
}

#[test]
fn a_shift_of_a_mosaic_is_in_its_own_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let still = Camera {
        exposures_s: vec![0.01, 0.02, 0.04, 0.08],
        ..camera("RGGB")
    };
    let (_, loaded) = photograph(folder.path(), &still);
    let moved = Camera {
        spot_offset_px: [8.3, -5.6],
        ..still
    };
    let other = folder.path().join("moved");
    photograph(&other, &moved);
    let file = "sample/sample_02.tif";
    std::fs::copy(other.join("capture").join(file), loaded.folder.join(file)).unwrap();
    let error = radiance(&loaded, &Silent).unwrap_err().to_string();
    assert!(error.contains("sample_02.tif: shifted against"), "{error}");
    let px: f64 = error.split("still off by ").nth(1).unwrap()[..4]
        .parse()
        .unwrap();
    assert!((px - 1.0).abs() < 0.1, "{error}");
}

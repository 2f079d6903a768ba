//! Stray light, from files to coefficients.

use fit::Fit;
use formats::capture::PerChannel;
use physics::Coefficients;
use pipeline::capture::Loaded;
use pipeline::library::{self, ModelChoice};
use pipeline::measure::{Choices, Measurement, measure};
use pipeline::{Silent, capture, fitting, synthesis};
use synth::{Camera, Channels, Sample, WhiteReference};

/// One channel of a shipped material, photographed through a lens that spreads `flare` of the
/// light, beside a white that absorbs `white_sigma_a`; the folder goes with the files.
fn photographed(
    material: &str,
    channel: &str,
    (flare, white_sigma_a): (f64, f64),
    seed: u64,
) -> (tempfile::TempDir, Loaded, Coefficients) {
    let rows = library::material(material).unwrap();
    let row = rows.iter().find(|r| r.channel == channel).unwrap();
    let truth = row.medium.coefficients();
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
        flare_relative: flare,
        exposures_s: vec![0.001, 0.004, 0.016, 0.064, 0.25, 1.0, 4.0],
        reference: WhiteReference {
            sigma_a_per_mm: Some(vec![white_sigma_a]),
            ..WhiteReference::default()
        },
        ..Camera::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("capture");
    let model = ModelChoice::default();
    let manifest =
        synthesis::write(&sample, camera, &model, seed, &target, false, &Silent).unwrap();
    let loaded = capture::load(&manifest).unwrap();
    (folder, loaded, truth)
}

fn measured_from(loaded: &Loaded) -> Measurement {
    let choices = Choices {
        confirm: false,
        ..Choices::default()
    };
    measure(loaded, &choices, &Silent).unwrap()
}

/// The same with a white that absorbs nothing, measured.
fn measured(material: &str, channel: &str, flare: f64, seed: u64) -> (Measurement, Coefficients) {
    let (_folder, loaded, truth) = photographed(material, channel, (flare, 0.0), seed);
    (measured_from(&loaded), truth)
}

fn pulls(fit: &Fit, truth: Coefficients) -> [f64; 2] {
    let pull = |e: &fit::Estimate, truth: f64| (e.value - truth) / e.u;
    [
        pull(&fit.sigma_a, truth.sigma_a),
        pull(&fit.sigma_s_prime, truth.sigma_s_prime),
    ]
}

/// The same data with the veil left in, by a fit that knows of none.
fn blind(found: &Measurement) -> Fit {
    let seen = found.measured[0]
        .clone()
        .less(-found.radiance.veils[0].offset);
    let given = fitting::Given {
        directions: vec![],
        range_mm: Some(found.fits[0].range_mm),
        ..found.given[0].clone()
    };
    let scale = &found.radiance.scale_inputs[0];
    fitting::fit_channel(&seen.profile, Some(&seen.total), scale, &given).unwrap()
}

#[test]
fn stray_light_is_measured_and_taken_out() {
    for (material, channel) in [("marble", "G"), ("skin1", "R")] {
        for (flare, seed) in [(0.0, 1), (0.001, 2), (0.01, 3)] {
            let (found, truth) = measured(material, channel, flare, seed);
            let veil = found.radiance.veils[0];
            let (share, u) = (veil.share, veil.u_share);
            let fit = &found.fits[0];
            let (with, blind) = (pulls(fit, truth), blind(&found));
            let off = |f: &Fit| f.sigma_a.value / truth.sigma_a - 1.0;
            println!(
                "{material} {flare}: share {share:.6} u {u:.6}, sigma_a off {:+.4} % ({:+.2} u, u \
                 {:.4} %), sigma_s' {:+.4} % ({:+.2} u); blind sigma_a {:+.3} % (u {:.4} %), chi2 \
                 {:.1} for {:.2}",
                100.0 * off(fit),
                with[0],
                100.0 * fit.sigma_a.u / truth.sigma_a,
                100.0 * (fit.sigma_s_prime.value / truth.sigma_s_prime - 1.0),
                with[1],
                100.0 * off(&blind),
                100.0 * blind.sigma_a.u / truth.sigma_a,
                blind.reduced_chi2,
                fit.reduced_chi2,
            );
            assert!(veil.measured && (share - flare).abs() < 3.0 * u, "{veil:?}");
            assert!(with.iter().all(|p| p.abs() < 3.0), "{with:?}");
            assert!(fit.reduced_chi2 < 1.6, "{}", fit.reduced_chi2);
            if flare > 0.0 {
                assert!(
                    off(&blind).abs() > 3.0 * off(fit).abs(),
                    "{:?}",
                    blind.sigma_a
                );
                assert!(fit.budget.iter().any(|line| line.source == "stray light"));
            } else {
                // What a clear lens costs: the possibility of stray light.
                assert!(
                    fit.sigma_a.u < 1.3 * blind.sigma_a.u,
                    "{:?} {:?}",
                    fit.sigma_a,
                    blind.sigma_a
                );
            }
        }
    }
}

#[test]
fn light_that_fills_the_picture_leaves_stray_light_open_and_says_so() {
    let (clear, _) = measured("chicken1", "R", 0.0, 4);
    let (found, truth) = measured("chicken1", "R", 0.05, 4);
    let (a, b) = (&clear.fits[0], &found.fits[0]);
    let pulls = pulls(b, truth);
    println!(
        "u of sigma_a {:.2e} and {:.2e}, pulls {pulls:.2?}, {:?}",
        a.sigma_a.u, b.sigma_a.u, found.warnings
    );
    assert!(
        b.sigma_a.u > 1.2 * a.sigma_a.u,
        "{:?} {:?}",
        a.sigma_a,
        b.sigma_a
    );
    assert!(pulls.iter().all(|p| p.abs() < 3.0), "{pulls:?}");
    let said = found.warnings.join("\n");
    assert!(
        said.contains("known by the white reference alone"),
        "{said}"
    );
    let text = found.document().to_json().unwrap();
    assert!(text.contains("\"stray_light\""), "{text}");
}

/// The light of skim milk fills the picture, so that stray light is known by the white alone; and
/// an absorption of the white that is stated too high by half, its u, looks like stray light, 28
/// times what noise leaves open.
#[test]
fn a_white_whose_absorption_is_stated_wrong_is_in_u() {
    let truly = 5e-5;
    let (_folder, mut loaded, truth) = photographed("skimmilk", "G", (0.0, truly), 5);
    let mut found_with = |u: f64| {
        let white = &mut loaded.capture.reference;
        white.sigma_a_per_mm = Some(PerChannel::All(1.5 * truly));
        white.u_sigma_a_per_mm = Some(PerChannel::All(u));
        measured_from(&loaded)
    };
    let (told, untold) = (found_with(0.5 * truly), found_with(0.0));
    let share = |found: &Measurement| {
        let veil = found.radiance.veils[0];
        veil.share / veil.u_share
    };
    let (of_told, of_untold) = (pulls(&told.fits[0], truth), pulls(&untold.fits[0], truth));
    println!(
        "pulls {of_told:.2?}, share {:.1} u; untold {of_untold:.2?}, {:.1} u",
        share(&told),
        share(&untold)
    );
    assert!(of_told.iter().all(|p| p.abs() < 2.5), "{of_told:?}");
    assert!(share(&told) < 2.0 && share(&untold) > 10.0);
    assert!(of_untold.iter().all(|p| p.abs() > 4.0), "{of_untold:?}");
    let budget = &told.fits[0].budget;
    assert!(
        budget
            .iter()
            .any(|line| line.source == "white reference: absorption"),
        "{budget:?}"
    );
}

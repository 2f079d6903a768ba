//! `brdf`, `sphere` and `figures`: what they promise, and their answers to bad input.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test"
)]

mod call;

use call::call;
use std::f64::consts::LN_2;
use std::fs;
use std::path::Path;

/// How many files `folder` holds.
fn count(folder: &Path) -> usize {
    fs::read_dir(folder).unwrap().count()
}

/// Second order of an isotropic half-space at normal incidence, per α²:
/// ¼ ∫∫ [μ′/((1 + μ′)(1 + μ)) + μ′²/((1 + μ′)(μ + μ′))] dμ dμ′, the inner integral in closed form.
fn second_order() -> f64 {
    let n = 100_000;
    let tail: f64 = (0..n)
        .map(|i| (f64::from(i) + 0.5) / f64::from(n))
        .map(|mu| mu * mu / (1.0 + mu) * ((1.0 + mu) / mu).ln())
        .sum::<f64>()
        / f64::from(n);
    0.25 * ((1.0 - LN_2) * LN_2 + tail)
}

#[test]
fn the_figures_show_what_can_be_known() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let (code, _, error) = call(
        path,
        &[
            "figures",
            "hk93",
            "-o",
            "f",
            "--photons",
            "3e5",
            "--threads",
            "1",
        ],
    );
    assert_eq!(code, Some(0), "{error}");
    assert_eq!(count(&path.join("f")), 12);
    let text = fs::read_to_string(path.join("f/figure8.csv")).unwrap();
    let value = |line: &str, albedo: &str| -> f64 {
        let row = text
            .lines()
            .find(|row| row.contains(line) && row.contains(&format!("\",{albedo},")))
            .unwrap();
        row.rsplit(',').next().unwrap().parse().unwrap()
    };
    let first = 0.5 * (1.0 - LN_2);
    let once = value("\"first order\"", "1e0");
    assert!((once / first - 1.0).abs() < 0.01, "{once} for {first}");
    let twice = value("\"up to second order\"", "1e0");
    let both = first + second_order();
    assert!((twice / both - 1.0).abs() < 0.01, "{twice} for {both}");
    // Same seed, same bytes, on any number of threads.
    let (code, _, error) = call(
        path,
        &[
            "figures",
            "hk93",
            "-o",
            "g",
            "--photons",
            "3e5",
            "--threads",
            "2",
        ],
    );
    assert_eq!(code, Some(0), "{error}");
    for entry in fs::read_dir(path.join("f")).unwrap() {
        let name = entry.unwrap().file_name();
        let [a, b] = ["f", "g"].map(|f| fs::read(path.join(f).join(&name)).unwrap());
        assert!(a == b, "{} differs", name.display());
    }
    let (code, _, error) = call(path, &["figures", "kajiya86", "-o", "h"]);
    assert_eq!(code, Some(2));
    assert!(error.contains("there are jensen2001, hk93"), "{error}");
}

#[test]
fn three_witnesses_of_a_leaf_agree() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let arguments = [
        "brdf",
        "leaf",
        "-o",
        "leaf",
        "--angle",
        "30",
        "--photons",
        "1e5",
        "--json",
    ];
    let (code, out, error) = call(path, &arguments);
    assert_eq!(code, Some(0), "{error}");
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    let angle = &document["angles"][0];
    for (exact, counted) in [
        ("reflectance", "reflectance_monte_carlo"),
        ("transmittance", "transmittance_monte_carlo"),
    ] {
        let number = |v: &serde_json::Value| v.as_f64().unwrap();
        let (value, u) = (
            number(&angle[counted]["value"]),
            number(&angle[counted]["u"]),
        );
        let exact = number(&angle[exact]);
        assert!((value - exact).abs() < 4.0 * u, "{value} ± {u} for {exact}");
    }
    assert_eq!(count(&path.join("leaf")), 6);
}

#[test]
fn bad_layers_and_angles_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let medium = |text: &str| fs::write(path.join("m.toml"), text).unwrap();
    let answer = |arguments: &[&str]| {
        let all = [
            &["brdf", "m.toml", "-o", "out", "--photons", "5000"],
            arguments,
        ]
        .concat();
        let (code, _, error) = call(path, &all);
        assert!(!path.join("out").exists(), "{error}");
        (code, error)
    };
    medium("[[layer]]\nsigma_a_per_mm = 1\nsigma_s_per_mm = 1\neta = 1.3\n");
    let (code, error) = answer(&["--angle", "90"]);
    assert_eq!(code, Some(2));
    assert!(error.contains("below 90 degrees, got 90"), "{error}");

    medium("[[layer]]\nsigma_a_per_mm = 1\neta = 1.3\n");
    let (code, error) = answer(&[]);
    assert_eq!(code, Some(3));
    assert!(
        error.contains("m.toml: layer 1: expected either"),
        "{error}"
    );

    medium(
        "[constituent.blood]\nsigma_a_per_mm = 1\nsigma_s_per_mm = 1\n\
         [[layer]]\neta = 1.3\nmixture = { bloood = 0.1 }\n",
    );
    let (code, error) = answer(&[]);
    assert_eq!(code, Some(3));
    assert!(
        error.contains("no [constituent.bloood]; there are blood"),
        "{error}"
    );

    medium(
        "[constituent.blood]\nsigma_a_per_mm = 1\nsigma_s_per_mm = 1\n\
         [[layer]]\neta = 1.3\nmixture = { blood = 1.5 }\n",
    );
    let (code, error) = answer(&[]);
    assert_eq!(code, Some(3));
    assert!(error.contains("add up to 1.5"), "{error}");
}

#[test]
fn a_sample_that_cannot_be_stops_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let table = "sample,thickness_mm,eta,reflectance,transmittance,g\n\
                 milk,1.0,1.34,0.40,0.30,0.8\n\
                 magic,1.0,1.34,0.65,0.50,0.8\n\
                 forgotten,1.0,1.34,0.40,0.30,\n";
    fs::write(path.join("s.csv"), table).unwrap();
    let (code, out, error) = call(path, &["sphere", "s.csv", "-o", "out"]);
    assert_eq!(code, Some(3));
    assert!(
        error.contains("magic: reflectance and transmittance add up to 1.15"),
        "{error}"
    );
    assert!(error.contains("forgotten: expected either g or"), "{error}");
    assert!(out.contains("milk"), "{out}");
    let csv = fs::read_to_string(path.join("out/sphere.csv")).unwrap();
    assert_eq!(csv.lines().count(), 4, "{csv}");

    fs::write(
        path.join("s.csv"),
        table.replace("0.40,0.30,0.8", "40,30,0.8"),
    )
    .unwrap();
    let (_, _, error) = call(path, &["sphere", "s.csv", "-o", "percent"]);
    assert!(error.contains("a share, not percent"), "{error}");
}

//! Bad input gets one clear error that names the file and the field, exit 3 (2 for usage), and
//! leaves nothing half-written.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test"
)]

mod common;

use common::{beamspot, capture, copy_capture, names};
use std::fs;
use std::path::Path;

/// Runs `beamspot` and asserts its exit code, the words of its error, silence on standard output
/// and that `folder` holds what it held.
fn refused(folder: &Path, arguments: &[&str], code: i32, words: &[&str]) {
    let before = names(folder);
    let output = beamspot()
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {error}");
    for word in words {
        assert!(
            error.contains(word),
            "{arguments:?}: no `{word}` in: {error}"
        );
    }
    assert!(!error.contains("panicked"), "{error}");
    assert!(
        output.stdout.is_empty(),
        "{}",
        String::from_utf8_lossy(&output.stdout)
    );
    assert_eq!(names(folder), before, "{arguments:?} left something behind");
}

/// A copy of the capture whose manifest went through `edit`, refused by `measure`.
fn manifest_refused(edit: impl Fn(&str) -> String, words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    copy_capture(folder.path());
    let path = folder.path().join("capture.toml");
    let text = fs::read_to_string(&path).unwrap();
    let edited = edit(&text);
    assert_ne!(edited, text, "the edit found nothing to change");
    fs::write(&path, edited).unwrap();
    refused(
        folder.path(),
        &["measure", "capture.toml", "-o", "result"],
        3,
        words,
    );
}

/// A copy of the capture with one file changed, refused by `measure`.
fn file_refused(file: &str, edit: impl Fn(Vec<u8>) -> Vec<u8>, words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    copy_capture(folder.path());
    let path = folder.path().join(file);
    fs::write(&path, edit(fs::read(&path).unwrap())).unwrap();
    refused(
        folder.path(),
        &["measure", "capture.toml", "-o", "result"],
        3,
        words,
    );
}

#[test]
fn a_missing_file() {
    let folder = tempfile::tempdir().unwrap();
    let nothing = ["measure", "nothing.toml", "-o", "result"];
    refused(folder.path(), &nothing, 3, &["nothing.toml"]);
    let nowhere = ["init", "nowhere"];
    refused(folder.path(), &nowhere, 3, &["nowhere", "no such folder"]);
    copy_capture(folder.path());
    fs::write(folder.path().join("noise"), [0x17, 0xb6, 0x75]).unwrap();
    let words = ["noise: ", "text in UTF-8 is expected"];
    refused(
        folder.path(),
        &["measure", "noise", "-o", "result"],
        3,
        &words,
    );
    let itself = ["measure", ".", "-o", "result"];
    let its_manifest = ["a folder, where a file is expected", "./capture.toml"];
    refused(folder.path(), &itself, 3, &its_manifest);
    fs::remove_file(folder.path().join("sample/dark_03.tif")).unwrap();
    let measure = ["measure", "capture.toml", "-o", "result"];
    refused(
        folder.path(),
        &measure,
        3,
        &["sample/dark_03.tif", "No such file"],
    );
}

#[test]
fn a_frame_of_another_size() {
    let other = tempfile::tempdir().unwrap();
    fs::write(other.path().join("camera.toml"), common::camera(120)).unwrap();
    let synth = [
        "synth",
        "--material",
        "marble",
        "--camera",
        "camera.toml",
        "-o",
        "other",
    ];
    assert!(
        beamspot()
            .current_dir(other.path())
            .args(synth)
            .output()
            .unwrap()
            .status
            .success()
    );
    let frame = fs::read(other.path().join("other/sample/sample_02.tif")).unwrap();
    file_refused(
        "sample/sample_02.tif",
        |_| frame.clone(),
        &["sample_02.tif", "120 x 120", "128 x 128"],
    );
}

#[test]
fn a_truncated_tiff() {
    for part in [0, 1, 5, 9] {
        let cut = |bytes: Vec<u8>| bytes[..bytes.len() * part / 10].to_vec();
        file_refused("reference/reference_01.tif", cut, &["reference_01.tif"]);
    }
}

#[test]
fn an_exposure_that_is_none() {
    for (bad, found) in [("0.0", "0"), ("nan", "NaN"), ("-0.001", "-0.001")] {
        let edit =
            |text: &str| text.replacen("exposure_s = 0.001", &format!("exposure_s = {bad}"), 1);
        manifest_refused(
            edit,
            &["capture.toml", "sample.frames[0].exposure_s", found],
        );
    }
}

#[test]
fn no_dark_for_an_exposure() {
    let edit = |text: &str| {
        let kept = |line: &&str| !line.contains("sample/dark_05.tif");
        text.lines()
            .filter(kept)
            .fold(String::new(), |all, line| all + line + "\n")
    };
    manifest_refused(edit, &["capture.toml", "sample_05.tif", "dark"]);
}

#[test]
fn an_unknown_key() {
    let edit = |text: &str| text.replacen("mm_per_pixel", "mm_per_pixl", 1);
    manifest_refused(edit, &["capture.toml", "mm_per_pixl", "mm_per_pixel"]);
}

#[test]
fn every_frame_saturated() {
    let edit = |text: &str| {
        let low = |line: &str| {
            if line.starts_with("white_level_dn") {
                "white_level_dn = 201.0".into()
            } else {
                line.to_owned()
            }
        };
        text.lines()
            .map(low)
            .fold(String::new(), |all, line| all + &line + "\n")
    };
    manifest_refused(
        edit,
        &[
            "capture.toml",
            "saturated in every frame",
            "shorter exposure",
        ],
    );
}

#[test]
fn a_reference_darker_than_the_sample() {
    // The reference in the place of the sample, and ketchup in the place of the reference.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("camera.toml"), common::camera(128)).unwrap();
    let synth = [
        "synth",
        "--material",
        "ketchup",
        "--camera",
        "camera.toml",
        "-o",
        "ketchup",
    ];
    assert!(
        beamspot()
            .current_dir(path)
            .args(synth)
            .output()
            .unwrap()
            .status
            .success()
    );
    let manifest = path.join("ketchup/capture.toml");
    let text = fs::read_to_string(&manifest).unwrap();
    let text = text
        .replace("\"sample/sample_", "\"x/")
        .replace("\"reference/reference_", "\"sample/sample_")
        .replace("\"x/", "\"reference/reference_");
    fs::write(manifest, text).unwrap();
    let measure = ["measure", "ketchup/capture.toml", "-o", "result"];
    refused(
        path,
        &measure,
        3,
        &["capture.toml", "channel R", "darker than the sample"],
    );
}

#[test]
fn a_spot_off_the_frame() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let camera = common::camera(128) + "spot_offset_px = [60.0, 0.0]\n";
    fs::write(path.join("camera.toml"), camera).unwrap();
    let synth = [
        "synth",
        "--material",
        "marble",
        "--camera",
        "camera.toml",
        "-o",
        "off",
    ];
    assert!(
        beamspot()
            .current_dir(path)
            .args(synth)
            .output()
            .unwrap()
            .status
            .success()
    );
    let measure = ["measure", "off/capture.toml", "-o", "result"];
    refused(path, &measure, 3, &["off/capture.toml", "spot", "edge"]);
}

#[test]
fn an_output_that_exists_or_is_an_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    copy_capture(path);
    fs::create_dir(path.join("result")).unwrap();
    fs::write(path.join("result/fit.json"), "mine").unwrap();
    let measure = ["measure", "capture.toml", "-o", "result"];
    refused(path, &measure, 3, &["fit.json", "exists", "--force"]);
    assert_eq!(
        fs::read_to_string(path.join("result/fit.json")).unwrap(),
        "mine"
    );
    let hdr = [
        "hdr",
        "capture.toml",
        "-o",
        "sample/sample_01.tif",
        "--force",
    ];
    refused(path, &hdr, 3, &["sample_01.tif", "input"]);
}

const PROFILE: &str = "channel,radius_min_mm,radius_max_mm,radius_mm,reflectance_per_mm2,\
                       u_reflectance_per_mm2,pixels\n";

#[test]
fn profiles_that_cannot_be_fitted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let with =
        |rows: &str| fs::write(path.join("profile.csv"), format!("{PROFILE}{rows}")).unwrap();
    let fit = ["fit", "profile.csv", "--eta", "1.5", "--constraint", "none"];
    with("");
    refused(path, &fit, 3, &["profile.csv", "no rows"]);
    with("G,,,1,0.03,0.0003,\nG,,,2,NaN,0.0003,\n");
    refused(
        path,
        &fit,
        3,
        &["profile.csv", "line 3", "reflectance_per_mm2", "NaN"],
    );
    with("G,,,2,0.03,0.0003,\nG,,,1,0.05,0.0003,\n");
    refused(path, &fit, 3, &["profile.csv", "line 3", "radius_mm"]);
    with("G,,,1,0.03,0.0003,\nG,,,2,0.01,0.0003,\n");
    refused(path, &fit, 3, &["profile.csv", "channel G", "2 points"]);
    with("G,,,1,0.03,0.0003,\nG,,,2,0.01,0,\nG,,,3,0.005,0.0003,\n");
    refused(path, &fit, 3, &["profile.csv", "channel G", "u 0"]);
}

#[test]
fn a_total_above_the_ceiling() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let rows: String = (1..9)
        .map(|r| format!("G,,,{r},{},{},\n", 0.03 / f64::from(r * r), 1e-5))
        .collect();
    fs::write(path.join("profile.csv"), format!("{PROFILE}{rows}")).unwrap();
    let with = |total: &'static str| ["fit", "profile.csv", "--eta", "1.5", "--total", total];
    refused(
        path,
        &with("G=1.05±0.01"),
        3,
        &["profile.csv", "channel G", "1.05", "0.96"],
    );
    // Within 3 u it is a limit, not an error.
    let output = beamspot()
        .current_dir(path)
        .args(with("G=0.97±0.01"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(String::from_utf8_lossy(&output.stdout).contains("above the ceiling"));
}

#[test]
fn a_frame_of_another_kind() {
    let slope = (0..900_u16).flat_map(|i| (1000 + 3 * i).to_le_bytes());
    let low_byte_first: Vec<u8> = b"P5 30 30 65535\n".iter().copied().chain(slope).collect();
    for (bytes, words) in [
        (&b"P5 2 2 255\n\x01\x02\x03\x04"[..], "16-bit"),
        (b"P5 2 2 65535\n\x01", "cut short"),
        (b"P5 2147483648 2147483648 65535\n\x01", "cut short"),
        (b"FUJIFILMCCD-RAW 0201", "camera RAW (RAF)"),
        (b"GIF89a", "expected TIFF, PNG"),
        (b"\xff\xd8\xff\xe0", "a JPEG"),
        (b"", "the file is empty"),
        (&low_byte_first, "expected the high byte first"),
        (b"\x89PNG\r\n\x1a\n\0\0", "PNG: the file ends before"),
        (
            b"\x76\x2f\x31\x01\x02\0\0\0",
            "OpenEXR: the file ends before",
        ),
    ] {
        let words = ["reference/reference_02.tif", words];
        file_refused("reference/reference_02.tif", |_| bytes.to_vec(), &words);
    }
}

/// The capture's manifest with more lines in its section `[name]`.
fn with_lines(text: &str, name: &str, lines: &str) -> String {
    let section = format!("[{name}]\n");
    text.replacen(&section, &format!("{section}{lines}\n"), 1)
}

#[test]
fn masks_and_regions_that_leave_nothing_or_fit_nothing() {
    let refused = |lines: &str, words: &[&str]| {
        manifest_refused(|text| with_lines(text, "sample", lines), words);
    };
    refused("mask = \"nothing.png\"", &["nothing.png"]);
    refused(
        "mask = \"capture.toml\"",
        &["capture.toml", "expected TIFF, PNG"],
    );
    refused(
        "leave_out = [ { circle_px = [64, 64, 500] } ]",
        &["capture.toml", "sample", "leave out every pixel"],
    );
    refused(
        "leave_out = [ { polygon_px = [[0, 0], [9, 9]] } ]",
        &["sample.leave_out[0].polygon_px", "at least 3 corners"],
    );
    refused(
        "sectors_deg = [[10, 10]]",
        &["sample.sectors_deg[0]", "that differ"],
    );
    // A mask of another size: a frame of 2 x 2 pixels.
    let folder = tempfile::tempdir().unwrap();
    copy_capture(folder.path());
    let path = folder.path().join("capture.toml");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, with_lines(&text, "sample", "mask = \"mask.pgm\"")).unwrap();
    fs::write(
        folder.path().join("mask.pgm"),
        b"P5 2 2 255\n\x01\x00\x00\x00",
    )
    .unwrap();
    let arguments = ["measure", "capture.toml", "-o", "result"];
    crate::refused(
        folder.path(),
        &arguments,
        3,
        &["mask.pgm", "a mask of 2 x 2 pixels", "128 x 128"],
    );
}

#[test]
fn corners_that_are_no_view() {
    let corners_refused = |px: &str, mm: &str, words: &[&str]| {
        let edit = |text: &str| {
            let own = ["mm_per_pixel", "u_mm_per_pixel"];
            let kept = |line: &&str| !own.iter().any(|key| line.starts_with(key));
            let text: Vec<&str> = text.lines().filter(kept).collect();
            let lines = format!("corners_px = {px}\ncorners_mm = {mm}");
            with_lines(&text.join("\n"), "geometry", &lines)
        };
        manifest_refused(edit, words);
    };
    let square = "[[0, 0], [5, 0], [5, 5], [0, 5]]";
    // Three in a line, two that cross, four on a spot, and one that is no number.
    for bad in [
        "[[0, 0], [60, 0], [120, 0], [0, 120]]",
        "[[0, 0], [120, 120], [120, 0], [0, 120]]",
        "[[7, 7], [7, 7], [7, 7], [7, 7]]",
    ] {
        corners_refused(bad, square, &["capture.toml", "geometry"]);
    }
    corners_refused(
        "[[0, 0], [nan, 0], [120, 120], [0, 120]]",
        square,
        &["geometry.corners_px", "NaN"],
    );
    corners_refused(square, "[[0, 0], [5, 0], [5, 5]]", &["corners_mm"]);
}

#[test]
fn a_copy_in_the_place_of_a_frame() {
    let copy = fs::read(capture().join("sample/sample_01.tif")).unwrap();
    file_refused(
        "sample/sample_03.tif",
        |_| copy.clone(),
        &[
            "capture.toml",
            "sample_03.tif",
            "very bytes of sample/sample_01.tif",
        ],
    );
}

#[test]
fn a_manifest_that_nobody_filled_in() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    refused(path, &["init", "."], 3, &["no frame found", "TIFF"]);
    refused(path, &["init", "nowhere"], 3, &["nowhere"]);
    copy_capture(path);
    refused(
        path,
        &["init", "."],
        3,
        &["capture.toml", "exists", "--force"],
    );
    let init = beamspot()
        .current_dir(path)
        .args(["init", ".", "--force"])
        .output();
    assert!(init.unwrap().status.success());
    let measure = ["measure", "capture.toml", "-o", "result"];
    let open = [
        "`eta`",
        "`geometry.mm_per_pixel`",
        "exposure_s",
        "is still \"?\"",
    ];
    refused(path, &measure, 3, &open);
}

#[test]
fn wrong_usage() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    refused(path, &["measure", "capture.toml"], 2, &["--output"]);
    refused(
        path,
        &["synth", "--material", "unobtainium", "-o", "x"],
        2,
        &["unobtainium", "Marble"],
    );
    fs::write(
        path.join("profile.csv"),
        format!("{PROFILE}G,,,1,0.03,0.0003,\n"),
    )
    .unwrap();
    let fit = |more: &[&'static str]| [&["fit", "profile.csv", "--eta", "1.5"], more].concat();
    refused(
        path,
        &fit(&["--constraint", "exact"]),
        2,
        &["exact needs a total"],
    );
    refused(
        path,
        &fit(&["--total", "B=0.5±0.1"]),
        2,
        &["channel B", "profile.csv has G"],
    );
    refused(path, &fit(&["--total", "0.5"]), 2, &["CHANNEL=R±U"]);
    refused(
        path,
        &fit(&["--model", "tripole"]),
        2,
        &[
            "tripole",
            "dipole, jensen2001, better-dipole, kienle-patterson",
        ],
    );
    refused(
        path,
        &fit(&["--g", "0.8"]),
        2,
        &["dipole", "does not use g"],
    );
    // Half an index would be a bubble: no such sample, and no transport to judge it by.
    for eta in ["0", "0.5", "15", "nan"] {
        refused(
            path,
            &["fit", "profile.csv", "--eta", eta],
            2,
            &["eta must be a relative refractive index from 1 to 5"],
        );
    }
}

/// One exposure alone does not show how the noise grows with the light.
#[test]
fn a_camera_that_the_frames_do_not_show() {
    let edit = |text: &str| {
        let kept: Vec<&str> = text
            .lines()
            .filter(|line| !line.starts_with("gain_e_per_dn"))
            .filter(|line| !line.contains("{ file") || line.contains("_01.tif"))
            .collect();
        kept.join("\n")
    };
    manifest_refused(
        edit,
        &["capture.toml", "camera.gain_e_per_dn", "two frames"],
    );
}

#[test]
fn media_that_cannot_be_simulated() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let good = "[[layer]]\nsigma_a_per_mm = 0.1\nsigma_s_per_mm = 1.0\ng = 0.5\neta = 1.4\n\
                thickness_mm = 1.0\n";
    let simulate = [
        "simulate",
        "medium.toml",
        "-o",
        "result",
        "--photons",
        "1e4",
    ];
    for (from, to, words) in [
        (
            "eta = 1.4",
            "eta = 0.9",
            ["layer 1", "refractive index", "0.9"],
        ),
        ("g = 0.5", "g = 1.0", ["layer 1", "mean cosine", "1"]),
        ("g = 0.5", "g = -1.0", ["layer 1", "mean cosine", "-1"]),
        (
            "sigma_s_per_mm = 1.0",
            "sigma_s_per_mm = -1.0",
            ["layer 1", "scattering", "-1"],
        ),
        (
            "thickness_mm = 1.0",
            "thickness_mm = 0.0",
            ["layer 1", "thickness", "0 mm"],
        ),
        (
            "sigma_s_per_mm = 1.0",
            "sigma_s_per_mm = 0.0",
            ["optical thickness", "Fresnel", "0"],
        ),
        (
            "thickness_mm = 1.0",
            "[tally]\nr_max_mm = -1",
            ["radius", "increase", "-"],
        ),
        (
            "thickness_mm = 1.0",
            "[tally]\nr_bins = 10000000",
            ["cells", "fewer", "limit"],
        ),
        (
            "thickness_mm = 1.0",
            "thicknes_mm = 1.0",
            ["thicknes_mm", "thickness_mm", "line"],
        ),
    ] {
        fs::write(path.join("medium.toml"), good.replace(from, to)).unwrap();
        let words: Vec<&str> = words.iter().copied().filter(|w| *w != "limit").collect();
        refused(path, &simulate, 3, &[&["medium.toml"], &words[..]].concat());
    }
    let clear = "[[layer]]\nsigma_a_per_mm = 0\nsigma_s_per_mm = 0\neta = 1.4\n";
    fs::write(path.join("medium.toml"), clear).unwrap();
    refused(
        path,
        &simulate,
        3,
        &["medium.toml", "neither absorbs nor scatters"],
    );
    fs::write(path.join("medium.toml"), good).unwrap();
    let call = |more: [&'static str; 2]| {
        [&["simulate", "medium.toml", "-o", "result"][..], &more].concat()
    };
    refused(path, &call(["--photons", "0"]), 2, &["photons above 0"]);
    refused(path, &call(["--until-u", "0"]), 2, &["--until-u"]);
    refused(path, &call(["--simd", "mmx"]), 2, &["mmx", "portable"]);
}

/// A file may not grow as far as an output has to, which is all the same as a full disk.
#[test]
#[cfg(unix)]
fn a_limit_of_file_sizes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    copy_capture(path);
    let before = names(path);
    let mut shell = std::process::Command::new("sh");
    let binary = env!("CARGO_BIN_EXE_beamspot");
    let output = shell
        .current_dir(path)
        .args([
            "-c",
            "ulimit -f 64; exec \"$0\" hdr capture.toml -o out.exr",
            binary,
        ])
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(
        error.contains("out.exr") && error.contains("too large"),
        "{error}"
    );
    assert_eq!(names(path), before);
}

#[test]
fn the_capture_itself_is_good() {
    let folder = tempfile::tempdir().unwrap();
    let output = beamspot()
        .current_dir(folder.path())
        .args([
            "measure",
            capture().join("capture.toml").to_str().unwrap(),
            "-o",
            "result",
            "--no-confirm",
        ])
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

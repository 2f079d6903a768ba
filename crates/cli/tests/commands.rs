//! The commands of the README, and what they promise.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test"
)]

mod common;

use common::{beamspot, capture, copy_capture, names};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Standard output of a call that must succeed.
fn stdout(folder: &Path, arguments: &[&str]) -> String {
    let output = beamspot()
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {error}");
    assert!(error.is_empty(), "{arguments:?}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(text: &str) -> serde_json::Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

#[test]
fn measure_writes_everything_and_the_truth_is_in_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    copy_capture(path);
    let table = stdout(path, &["measure", "capture.toml", "-o", "result"]);
    assert!(
        table.contains("sigma_a") && table.contains("wrote result/report.html"),
        "{table}"
    );
    let files = names(&path.join("result"));
    let files: Vec<&str> = files.iter().map(|f| f.to_str().unwrap()).collect();
    let expected = [
        "beam.csv",
        "fit.json",
        "materials.csv",
        "picture_B.svg",
        "picture_G.svg",
        "picture_R.svg",
        "profile.csv",
        "profile_B.svg",
        "profile_G.svg",
        "profile_R.svg",
        "radiance.exr",
        "report.html",
        "totals.csv",
    ];
    assert_eq!(files, expected);
    let document = json(&fs::read_to_string(path.join("result/fit.json")).unwrap());
    assert_eq!(document["schema_version"], 1);
    assert_eq!(document["material"], "Marble");
    // The manifest, and five exposures of sample, dark, reference, dark.
    assert_eq!(document["inputs"].as_array().unwrap().len(), 21);
    for (channel, sigma_a, sigma_s_prime) in
        [(0, 0.0021, 2.19), (1, 0.0041, 2.62), (2, 0.0071, 3.00)]
    {
        let channel = &document["channels"][channel];
        assert_eq!(channel["termination"], "converged");
        for (name, truth) in [
            ("sigma_a_per_mm", sigma_a),
            ("sigma_s_prime_per_mm", sigma_s_prime),
        ] {
            let [value, u] = ["value", "u"].map(|key| channel[name][key].as_f64().unwrap());
            assert!(
                (value - truth).abs() < 4.0 * u && u < 0.01 * truth,
                "{channel}"
            );
        }
    }
    // Photons confirm what diffusion gets wrong by percents, and count the totals to permilles.
    let photons = &document["channels"][1]["monte_carlo"];
    assert!(photons["photons"].as_u64().unwrap() >= 1_000_000);
    let error = photons["model_error"].as_f64().unwrap();
    assert!((0.02..0.2).contains(&error), "{photons}");
    let total = photons["total_reflectance"].as_f64().unwrap();
    // Of 0.767481 per incident power by MCML (fixtures/monte-carlo/totals.csv), 1 - 0.04 enters,
    // and a part in 500 leaves outside the picture.
    assert!((total - 0.767_481 / 0.96).abs() < 0.004, "{photons}");
    for file in ["fit.json", "report.html", "radiance.exr"] {
        let bytes = fs::read(path.join("result").join(file)).unwrap();
        let here = path.to_str().unwrap().as_bytes();
        assert!(
            !bytes.windows(here.len()).any(|w| w == here),
            "{file} holds an absolute path"
        );
    }
}

#[test]
fn the_same_bytes_on_one_thread_and_on_two() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = capture().join("capture.toml");
    let manifest = manifest.to_str().unwrap();
    for threads in ["1", "2"] {
        stdout(
            folder.path(),
            &["measure", manifest, "-o", threads, "--threads", threads],
        );
    }
    let [one, two] = ["1", "2"].map(|t| folder.path().join(t));
    for name in names(&one) {
        let [a, b] = [&one, &two].map(|f| fs::read(f.join(&name)).unwrap());
        assert!(a == b, "{} differs", name.display());
    }
}

#[test]
fn the_stages_one_by_one_give_what_measure_gives() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let manifest = capture().join("capture.toml");
    let manifest = manifest.to_str().unwrap();
    let whole = json(&stdout(
        path,
        &["measure", manifest, "-o", "whole", "--json", "--no-confirm"],
    ));
    stdout(path, &["hdr", manifest, "-o", "radiance.exr"]);
    stdout(
        path,
        &["profile", "radiance.exr", "-o", "stages/profile.csv"],
    );
    let fit = [
        "fit",
        "stages/profile.csv",
        "--eta",
        "1.5",
        "--beam",
        "whole/beam.csv",
        "--discrepancy",
        "false",
        "--json",
    ];
    let stages = json(&stdout(path, &fit));
    for file in ["profile.csv", "totals.csv"] {
        let [a, b] = ["whole", "stages"].map(|f| fs::read(path.join(f).join(file)).unwrap());
        assert!(a == b, "{file} differs");
    }
    for channel in 0..3 {
        for name in ["sigma_a_per_mm", "sigma_s_prime_per_mm"] {
            let [a, b] =
                [&whole, &stages].map(|d| d["channels"][channel][name]["value"].as_f64().unwrap());
            assert!((a / b - 1.0).abs() < 1e-9, "{name}: {a} and {b}");
        }
    }
    let slice = stdout(
        path,
        &[
            "profile",
            "radiance.exr",
            "-o",
            "slice/profile.csv",
            "--slice",
        ],
    );
    assert!(slice.contains("wrote slice/profile.csv"), "{slice}");
    let text = fs::read_to_string(path.join("slice/profile.csv")).unwrap();
    assert!(text.lines().nth(1).unwrap().starts_with("R,,,"), "{text}");
}

#[test]
fn the_papers_mode_switches_entry_and_exit_off_together() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let camera = common::camera(128) + "entry_loss = false\nexit = \"lambert\"\n";
    fs::write(path.join("camera.toml"), camera).unwrap();
    let synth = [
        "synth",
        "--material",
        "skin1",
        "--model",
        "jensen2001",
        "--camera",
        "camera.toml",
        "-o",
        "skin",
    ];
    stdout(path, &synth);
    let manifest = fs::read_to_string(path.join("skin/capture.toml")).unwrap();
    assert!(manifest.contains("entry_loss = false") && manifest.contains("exit = \"lambert\""));
    let measure = [
        "measure",
        "skin/capture.toml",
        "--model",
        "jensen2001",
        "-o",
        "result",
        "--json",
    ];
    let document = json(&stdout(path, &measure));
    for (channel, truth) in [(0, 0.032), (1, 0.17), (2, 0.48)] {
        let sigma_a = &document["channels"][channel]["sigma_a_per_mm"];
        let [value, u] = ["value", "u"].map(|key| sigma_a[key].as_f64().unwrap());
        // Pixels of 0.3 mm show a beam of 1 mm to a percent, and dark skin near it feels that.
        assert!(
            (value - truth).abs() < 4.0 * u && u < 0.05 * truth,
            "{sigma_a}"
        );
    }
}

/// A mono camera of 12 bits with a disk for a beam, at an angle.
#[test]
fn another_camera() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let camera = common::camera(128)
        + "channels = \"mono\"\nbits = 12\nbeam_profile = \"disk\"\nbeam_angle_deg = 30\ncamera_angle_deg = 20\n";
    fs::write(path.join("camera.toml"), camera).unwrap();
    let synth = [
        "synth",
        "--material",
        "marble",
        "--camera",
        "camera.toml",
        "-o",
        "mono",
    ];
    stdout(path, &synth);
    let document = json(&stdout(
        path,
        &[
            "measure",
            "mono/capture.toml",
            "-o",
            "result",
            "--json",
            "--no-confirm",
        ],
    ));
    let channel = &document["channels"][0];
    assert_eq!(channel["channel"], "Y");
    let sigma_s_prime = &channel["sigma_s_prime_per_mm"];
    let [value, u] = ["value", "u"].map(|key| sigma_s_prime[key].as_f64().unwrap());
    assert!(
        (value - 2.62).abs() < 4.0 * u && u < 0.01 * value,
        "{channel}"
    );
}

/// Photographs of laser beams against what PyPI laserbeamsize 2.5.0 makes of them with
/// `iso_noise=False`: centre, widths and angle. `tests/python/laser_beams.py` takes any folder.
#[test]
fn beams_are_as_wide_as_iso_11146_has_them() {
    for (file, center, widths, angle) in [
        (
            "TEM00_140mm.pgm",
            [699.93451, 394.73918],
            [105.27011, 91.29312],
            0.058147,
        ),
        (
            "t-210mm.pgm",
            [586.67228, 329.06832],
            [212.24977, 181.76583],
            0.657988,
        ),
    ] {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/frames/").to_owned() + file;
        let found = json(&stdout(Path::new("."), &["beam", &path, "--json"]));
        let beam = &found["channels"][0];
        for axis in 0..2 {
            let c = beam["center_px"][axis].as_f64().unwrap();
            let d = beam["d4sigma_px"][axis].as_f64().unwrap();
            // The same sums in another order.
            assert!((c - center[axis]).abs() < 1e-4, "{file}: {beam}");
            assert!((d - widths[axis]).abs() < 1e-4, "{file}: {beam}");
        }
        let turned = beam["angle_deg"].as_f64().unwrap().to_radians();
        assert!((turned - angle).abs() < 1e-5, "{file}: {beam}");
    }
}

#[test]
fn several_captures_go_into_a_folder_each_and_one_table() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let manifest = capture().join("capture.toml");
    let manifest = manifest.to_str().unwrap();
    stdout(
        path,
        &[
            "measure",
            manifest,
            manifest,
            "-o",
            "result",
            "--no-confirm",
        ],
    );
    let table = fs::read_to_string(path.join("result/materials.csv")).unwrap();
    assert_eq!(table.lines().count(), 7);
    assert!(path.join("result/Marble/fit.json").exists());
    assert!(path.join("result/Marble-2/fit.json").exists());
}

#[test]
fn tables_are_shown_converted_joined_and_audited() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let shown = stdout(path, &["table", "show"]);
    assert_eq!(shown.lines().count(), 37);
    let audit = stdout(path, &["table", "check"]);
    for row in ["Chicken1 B", "Skimmilk B", "Potato G", "Skin2 G"] {
        assert!(audit.contains(row), "{audit}");
    }
    assert!(
        audit.contains("36 rows checked, 4 do not hold together"),
        "{audit}"
    );
    let excess = json(&stdout(path, &["table", "check", "--json"]));
    let worst = excess["findings"]
        .as_array()
        .unwrap()
        .iter()
        .find(|f| f["material"] == "Chicken1");
    assert!((worst.unwrap()["excess"].as_f64().unwrap() - 0.018).abs() < 5e-4);

    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/materials.csv");
    let data = data.to_str().unwrap();
    stdout(
        path,
        &["table", "convert", data, "--to", "json", "-o", "m.json"],
    );
    stdout(
        path,
        &["table", "convert", "m.json", "--to", "csv", "-o", "m.csv"],
    );
    assert_eq!(stdout(path, &["table", "show", "m.csv"]), shown);
    let merged = stdout(
        path,
        &["table", "merge", "m.csv", "m.json", "-o", "all.csv"],
    );
    assert!(merged.contains("36 rows"), "{merged}");

    let convert = |from: &str, to: &str, name: &str, more: &[&str]| {
        let call = [&["table", "convert", from, "--to", to, "-o", name], more].concat();
        stdout(path, &call)
    };
    let warned = convert("m.csv", "blender", "m.py", &["--material", "spectralon"]);
    assert!(warned.starts_with("warning: Spectralon") && warned.contains("(3 rows)"));
    convert("m.csv", "pbrt", "m.pbrt", &["--scene-unit-mm", "10"]);
    convert("m.pbrt", "csv", "back.csv", &["--scene-unit-mm", "10"]);
    let back = fs::read_to_string(path.join("back.csv")).unwrap();
    assert!(
        back.contains("Marble,G,,2.62,,0.0041,,,,1.5,,,pbrt"),
        "{back}"
    );
    let unit = ["table", "show", "m.pbrt"];
    let output = beamspot().current_dir(path).args(unit).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--scene-unit-mm"));
    convert("m.csv", "datapackage", "datapackage.json", &[]);
    assert!(path.join("materials.csv").exists());

    let other = fs::read_to_string(path.join("m.csv"))
        .unwrap()
        .replacen("2.29", "2.92", 1);
    fs::write(path.join("other.csv"), other).unwrap();
    let merge = ["table", "merge", "m.csv", "other.csv", "-o", "conflict.csv"];
    let output = beamspot().current_dir(path).args(merge).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3));
    assert!(
        error.contains("other.csv") && error.contains("Apple") && error.contains("2.92"),
        "{error}"
    );
    assert!(!path.join("conflict.csv").exists());
    assert!(error.contains("--keep-all"), "{error}");
    let kept = [&merge[..], &["--keep-all"]].concat();
    assert!(stdout(path, &kept).contains("72 rows"));
    let kept = fs::read_to_string(path.join("conflict.csv")).unwrap();
    let apples: Vec<&str> = (kept.lines())
        .filter(|line| line.starts_with("Apple,R,"))
        .collect();
    assert!(
        apples.len() == 2
            && apples[0].ends_with(", m.csv\"")
            && apples[1].ends_with(", other.csv\""),
        "{apples:?}"
    );
}

/// An interrupt ends with 130 and leaves no file, hidden ones included.
#[cfg(unix)]
#[test]
fn an_interrupt_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    // The default camera takes seconds, so that the interrupt comes in the middle.
    let child = beamspot()
        .current_dir(folder.path())
        .args(["synth", "--material", "marble", "-o", "capture"])
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    while names(folder.path()).is_empty() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let kill = ["-INT", &child.id().to_string()].map(str::to_owned);
    assert!(
        std::process::Command::new("kill")
            .args(kill)
            .status()
            .unwrap()
            .success()
    );
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert!(String::from_utf8_lossy(&output.stderr).contains("interrupted"));
    assert_eq!(names(folder.path()), Vec::<std::path::PathBuf>::new());
}

const MARBLE: &str = "[[layer]]\nsigma_a_per_mm = 0.0041\nsigma_s_per_mm = 2.62\neta = 1.5\n\
                      [tally]\nangle_bins = 9\norders = 5\nz_max_mm = 10\nz_bins = 10\n\
                      path_max_mm = 100\npath_bins = 10\nradius_and_angle = true\n\
                      depth_and_radius = true\n";

#[test]
fn a_simulation_goes_on_where_it_stopped_with_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("marble.toml"), MARBLE).unwrap();
    let simulate = |target: &str, photons: &str, threads: &str| {
        stdout(
            path,
            &[
                "simulate",
                "marble.toml",
                "-o",
                target,
                "--photons",
                photons,
                "--threads",
                threads,
            ],
        );
    };
    simulate("at-once", "1e5", "2");
    simulate("in-two", "3e4", "1");
    simulate("in-two", "1e5", "1");
    let files = names(&path.join("at-once"));
    assert_eq!(files.len(), 15, "{files:?}");
    for name in files {
        let [a, b] = ["at-once", "in-two"].map(|f| fs::read(path.join(f).join(&name)).unwrap());
        assert!(a == b, "{} differs", name.display());
    }
    let totals = json(&fs::read_to_string(path.join("at-once/totals.json")).unwrap());
    let [value, u] = ["value", "u"].map(|k| totals["diffuse_reflectance"][k].as_f64().unwrap());
    assert!((value - 0.767_446).abs() < 4.0 * u && u < 2e-3, "{totals}");
    assert!(
        totals["energy_error"].as_f64().unwrap().abs() < 1e-6,
        "{totals}"
    );

    // A tally of two quantities, summed over one, is that of the other: to rounding of the shares.
    for (joint, single) in [
        ("reflectance_r_angle", "reflectance_angle"),
        ("absorbed_z_r", "absorbed_z"),
    ] {
        let by_second = if single == "absorbed_z" { 0 } else { 2 };
        let shares = |name: &str, key: usize| {
            let text = fs::read_to_string(path.join(format!("at-once/{name}.csv"))).unwrap();
            let share = text
                .lines()
                .next()
                .unwrap()
                .split(',')
                .position(|c| c == "share");
            let mut sums = BTreeMap::<String, f64>::new();
            for line in text.lines().skip(1) {
                let cells: Vec<&str> = line.split(',').collect();
                let value: f64 = cells[share.unwrap()].parse().unwrap();
                *sums.entry(cells[key].to_owned()).or_default() += value;
            }
            sums
        };
        let (joint, single) = (shares(joint, by_second), shares(single, 0));
        assert_eq!(joint.len(), single.len());
        assert!(single.values().sum::<f64>() > 0.1);
        for (edge, share) in single {
            assert!((joint[&edge] - share).abs() < 1e-9, "{edge}: {joint:?}");
        }
    }

    // The profile is one that `fit` takes.
    let fit = [
        "fit",
        "at-once/reflectance_r.csv",
        "--eta",
        "1.5",
        "--total",
        "Y=0.7674±0.001",
        "--json",
    ];
    let fit = json(&stdout(path, &fit));
    let sigma_s_prime = fit["channels"][0]["sigma_s_prime_per_mm"]["value"]
        .as_f64()
        .unwrap();
    assert!((sigma_s_prime / 2.62 - 1.0).abs() < 0.15, "{fit}");

    let enough = [
        "simulate",
        "marble.toml",
        "-o",
        "enough",
        "--photons",
        "1e9",
        "--until-u",
        "2e-3",
    ];
    let enough = json(&stdout(path, &[&enough[..], &["--json"]].concat()));
    assert!(
        enough["diffuse_reflectance"]["u"].as_f64().unwrap() <= 2e-3,
        "{enough}"
    );
    assert!(enough["photons"].as_u64().unwrap() < 1_000_000, "{enough}");

    let portable = [
        "simulate",
        "marble.toml",
        "-o",
        "portable",
        "--photons",
        "2e4",
        "--simd",
        "portable",
        "--json",
    ];
    let portable = json(&stdout(path, &portable));
    assert_eq!(portable["simd"], "portable");
    let other = [
        "simulate",
        "marble.toml",
        "-o",
        "at-once",
        "--photons",
        "1e5",
        "--seed",
        "2",
    ];
    let output = beamspot().current_dir(path).args(other).output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stderr).contains("another medium, seed"));
}

/// 10¹² photons: the call says how long that is, and an interrupt leaves a smaller result from
/// which the next call goes on.
#[cfg(unix)]
#[test]
fn more_photons_than_a_life_is_long_are_told_and_interrupted() {
    use std::io::{BufRead as _, BufReader};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("marble.toml"), MARBLE).unwrap();
    let simulate = ["simulate", "marble.toml", "-o", "long", "--photons"];
    let mut child = beamspot()
        .current_dir(path)
        .args([&simulate[..], &["1e12"]].concat())
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = String::new();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    stderr.read_line(&mut said).unwrap();
    assert!(
        said.contains("1000000000000 photons will take about") && said.contains("interrupt"),
        "{said}"
    );
    let id = child.id().to_string();
    let kill = std::process::Command::new("kill")
        .args(["-INT", &id])
        .status();
    assert!(kill.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let photons = |text: &str| json(text)["photons"].as_u64().unwrap();
    let done = photons(&fs::read_to_string(path.join("long/totals.json")).unwrap());
    assert!((1..1_000_000_000).contains(&done), "{done}");
    let more = (done + 1).to_string();
    let more = stdout(path, &[&simulate[..], &[&more, "--json"]].concat());
    assert!(photons(&more) > done, "{more}");
}

/// Every command in the README's `sh` blocks, in order, in one folder.
#[test]
fn the_readmes_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    let readme = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../README.md");
    let text = fs::read_to_string(readme).unwrap();
    let medium = text
        .split("# marble.toml\n")
        .nth(1)
        .unwrap()
        .split("```")
        .next()
        .unwrap();
    fs::write(folder.path().join("marble.toml"), medium).unwrap();
    let cube = text.split("# cube.toml\n").nth(1).unwrap();
    let cube = cube.split("```").next().unwrap();
    fs::write(folder.path().join("cube.toml"), cube).unwrap();
    let samples = text.split("```csv\n").nth(1).unwrap();
    let samples = samples.split("```").next().unwrap();
    fs::write(folder.path().join("samples.csv"), samples).unwrap();
    let mut ran = 0;
    for block in text.split("```sh\n").skip(1) {
        let block = block.split("```").next().unwrap();
        for line in block.lines() {
            // What follows is a remark.
            let words = line.split_whitespace().take_while(|word| *word != "#");
            let words: Vec<&str> = words.collect();
            assert_eq!(words[0], "beamspot", "{line}");
            stdout(folder.path(), &words[1..]);
            ran += 1;
        }
    }
    assert!(ran >= 15, "{ran}");
    assert!(text.contains("cargo run --release -- demo"));
    let demo = stdout(folder.path(), &["demo"]);
    assert!(demo.contains("recovered against true"), "{demo}");
    assert!(folder.path().join("beamspot-demo/report.html").exists());
}

//! Many captures: failures stay alone, and a kill costs nothing.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test"
)]

mod call;

use call::call;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// How many captures there are.
const COUNT: usize = 6;

/// A folder with small captures `series/1` … and `list.txt`, made once.
fn series() -> &'static Path {
    static SERIES: OnceLock<TempDir> = OnceLock::new();
    SERIES
        .get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path();
            let camera = "width = 96\nheight = 96\nmm_per_pixel = 0.4\nbeam_fwhm_mm = 1.0\n\
                          channels = \"mono\"\nexposures_s = [0.001, 0.03, 1.0]\n";
            fs::write(path.join("camera.toml"), camera).unwrap();
            let mut list = String::new();
            for seed in 1..=COUNT {
                let seed = seed.to_string();
                let output = format!("series/{seed}");
                let synth = ["synth", "--material", "marble", "--camera", "camera.toml"];
                let rest = ["--seed", &seed, "-o", &output];
                assert_eq!(call(path, &[&synth[..], &rest].concat()).0, Some(0));
                list.push_str(&format!("{output}/capture.toml\n"));
            }
            fs::write(path.join("list.txt"), list).unwrap();
            folder
        })
        .path()
}

/// A copy of the series.
fn copy() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files(series()) {
        let to = folder.path().join(name);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::write(to, bytes).unwrap();
    }
    folder
}

/// Every file below `folder`, hidden ones included.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_owned();
                found.insert(name, fs::read(path).unwrap());
            }
        }
    }
    found
}

/// When each finished capture was written.
fn written(results: &Path) -> BTreeMap<PathBuf, std::time::SystemTime> {
    let Ok(captures) = fs::read_dir(results.join("captures")) else {
        return BTreeMap::new();
    };
    captures
        .filter_map(|entry| {
            let path = entry.unwrap().path().join("batch.json");
            let time = fs::metadata(&path).ok()?.modified().unwrap();
            Some((path, time))
        })
        .collect()
}

const BATCH: [&str; 4] = ["batch", "list.txt", "--no-confirm", "-o"];

#[test]
fn killed_at_any_moment_and_gone_on_with_it_leaves_the_same_bytes() {
    let copy = copy();
    let path = copy.path();
    let start = Instant::now();
    let (code, out, error) = call(path, &[&BATCH[..], &["whole"]].concat());
    let whole_s = start.elapsed().as_secs_f64();
    assert_eq!((code, error.as_str()), (Some(0), ""), "{out}");
    assert!(out.contains("6 captures: 6 measured, 0 not"), "{out}");

    // A generator of Lehmer's, seeded: moments over the whole run, and a little beyond its start.
    let mut state = 20_010_812_u64;
    let mut before: BTreeMap<PathBuf, std::time::SystemTime> = BTreeMap::new();
    for _ in 0..5 {
        state = state * 48_271 % 0x7fff_ffff;
        let wait = whole_s * 0.5 * state as f64 / f64::from(0x7fff_ffff);
        let mut child = Command::new(env!("CARGO_BIN_EXE_beamspot"))
            .current_dir(path)
            .args(BATCH)
            .args(["killed", "--resume"])
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        sleep(Duration::from_secs_f64(wait));
        child.kill().unwrap();
        child.wait().unwrap();
        let now = written(&path.join("killed"));
        for (file, time) in &before {
            assert_eq!(
                now.get(file),
                Some(time),
                "{} was done twice",
                file.display()
            );
        }
        before = now;
    }
    let (code, out, _) = call(path, &[&BATCH[..], &["killed", "--resume"]].concat());
    assert_eq!(code, Some(0), "{out}");
    let now = written(&path.join("killed"));
    assert_eq!(now.len(), COUNT);
    assert!(before.iter().all(|(file, time)| now[file] == *time));
    let (whole, killed) = (files(&path.join("whole")), files(&path.join("killed")));
    let names: Vec<_> = whole.keys().collect();
    assert_eq!(killed.keys().collect::<Vec<_>>(), names);
    for (name, bytes) in &whole {
        assert!(killed[name] == *bytes, "{} differs", name.display());
    }
    let here = path.to_str().unwrap().as_bytes();
    for (name, bytes) in whole {
        let found = bytes.windows(here.len()).any(|w| w == here);
        assert!(!found, "{} holds an absolute path", name.display());
    }
}

#[test]
fn what_fails_stays_alone_and_what_was_mended_is_measured() {
    let copy = copy();
    let path = copy.path();
    let frame = path.join("series/2/sample/sample_01.tif");
    let good = fs::read(&frame).unwrap();
    fs::write(&frame, &good[..100]).unwrap();
    let manifest = path.join("series/4/capture.toml");
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(&manifest, text.replace("eta = 1.5", "eta = -1.5")).unwrap();
    let list = fs::read_to_string(path.join("list.txt")).unwrap();
    fs::write(path.join("list.txt"), list + "series/none/capture.toml\n").unwrap();

    let (code, out, error) = call(path, &[&BATCH[..], &["results"]].concat());
    assert_eq!(code, Some(5), "{error}");
    assert!(
        error.contains("3 of 7 captures were not measured"),
        "{error}"
    );
    assert!(
        error.contains("--resume") && !error.contains("panicked"),
        "{error}"
    );
    assert!(out.contains("2: failed: sample/sample_01.tif"), "{out}");
    let status = fs::read_to_string(path.join("results/status.csv")).unwrap();
    let lines: Vec<&str> = status.lines().collect();
    assert_eq!(lines[0], "capture,state,material,verdict,error");
    assert!(lines[1].starts_with("1,measured,Marble,"), "{status}");
    assert!(lines[2].starts_with("2,failed,Marble,,"), "{status}");
    assert!(lines[4].starts_with("4,failed,,,"), "{status}");
    assert!(
        lines[4].contains("capture.toml") && lines[4].contains("eta"),
        "{status}"
    );
    assert!(lines[7].starts_with("none,failed,,,"), "{status}");
    let table = fs::read_to_string(path.join("results/materials.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + 4, "{table}");
    assert!(table.contains(", capture 5"), "{table}");
    let page = fs::read_to_string(path.join("results/report.html")).unwrap();
    assert!(
        page.contains("3 not measured") && !page.contains("captures/2/"),
        "{page}"
    );
    assert!(page.contains("href=\"captures/1/report.html\""), "{page}");

    // Mended; and of one that stands a frame was taken again.
    fs::write(&frame, good).unwrap();
    fs::write(&manifest, text).unwrap();
    let other = path.join("series/6/sample/sample_01.tif");
    fs::copy(path.join("series/5/sample/sample_01.tif"), other).unwrap();
    let resume = [&BATCH[..], &["results", "--resume", "--json"]].concat();
    let (code, out, _) = call(path, &resume);
    assert_eq!(code, Some(5), "{out}");
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(document["measured"], 6);
    assert_eq!(document["measured_before"], 3);
    let before: Vec<bool> = (0..7)
        .map(|i| {
            document["captures"][i]["measured_before"]
                .as_bool()
                .unwrap()
        })
        .collect();
    assert_eq!(before, [true, false, true, false, true, false, false]);
}

/// `results` of the first two captures, and a call that is refused with these words.
#[test]
fn what_is_in_the_way_is_refused() {
    let copy = copy();
    let path = copy.path();
    let refused = |arguments: &[&str], code: i32, words: &[&str]| {
        let before = files(path);
        let (found, out, error) = call(path, &[&["batch", "--no-confirm"], arguments].concat());
        assert_eq!(found, Some(code), "{arguments:?}: {error}");
        for word in words {
            assert!(
                error.contains(word),
                "{arguments:?}: no `{word}` in {error}"
            );
        }
        assert!(out.is_empty(), "{out}");
        assert!(files(path) == before, "{arguments:?} left something behind");
    };
    refused(&["-o", "results"], 2, &["LIST|GLOB", "Usage"]);
    refused(
        &["series", "-o", "results"],
        3,
        &["is a folder", "series/*/capture.toml"],
    );
    refused(
        &["none/*.toml", "-o", "results"],
        3,
        &["none/*.toml", "no file"],
    );
    let monopole = ["list.txt", "-o", "results", "--model", "monopole"];
    refused(&monopole, 2, &["monopole", "there are dipole"]);
    refused(
        &["list.txt", "-o", "list.txt"],
        3,
        &["a file stands where a folder should"],
    );

    // A folder that no batch has left, and one that one has.
    fs::create_dir(path.join("mine")).unwrap();
    fs::write(path.join("mine/materials.csv"), "mine").unwrap();
    refused(
        &["list.txt", "-o", "mine"],
        3,
        &["mine/materials.csv: exists"],
    );
    refused(
        &["list.txt", "-o", "mine", "--resume"],
        3,
        &["no batch has left it"],
    );
    let two = ["series/[12]/capture.toml", "-o", "results"];
    assert_eq!(
        call(path, &[&["batch", "--no-confirm"], &two[..]].concat()).0,
        Some(0)
    );
    refused(&two, 3, &["exists", "--resume", "--force"]);

    // While another one writes there, and after it was killed.
    let lock = File::open(path.join("results/.beamspot-batch/lock")).unwrap();
    lock.lock().unwrap();
    let resume = [&two[..], &["--resume"]].concat();
    refused(
        &resume,
        3,
        &["results: another batch is writing to this folder"],
    );
    drop(lock);
    let (code, out, _) = call(path, &[&["batch", "--no-confirm"], &resume[..]].concat());
    assert_eq!(code, Some(0));
    assert!(
        out.contains("2 captures: 2 measured (2 of them before)"),
        "{out}"
    );

    // Results are no place for captures.
    fs::create_dir(path.join("results/captures/own")).unwrap();
    let own = path.join("results/captures/own/capture.toml");
    fs::copy(path.join("series/1/capture.toml"), own).unwrap();
    let own = [
        "results/captures/own/capture.toml",
        "-o",
        "results",
        "--force",
    ];
    refused(&own, 3, &["is an input, and would be written over"]);
}

#[cfg(unix)]
#[test]
fn an_interrupt_says_how_to_go_on() {
    let copy = copy();
    let child = Command::new(env!("CARGO_BIN_EXE_beamspot"))
        .current_dir(copy.path())
        .args(["batch", "list.txt", "-o", "results", "--bootstrap", "200"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // From when the lock is there, the key is answered by the work.
    let lock = copy.path().join("results/.beamspot-batch/lock");
    while !lock.exists() {
        sleep(Duration::from_millis(2));
    }
    let kill = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(kill.unwrap().success());
    let output = child.wait_with_output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{error}");
    assert!(
        error.contains("of 6 captures are measured") && error.contains("--resume"),
        "{error}"
    );
}

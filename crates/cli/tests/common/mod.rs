//! A small capture that every test of the command line starts from.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use tempfile::TempDir;

/// The binary under test.
pub(crate) fn beamspot() -> Command {
    Command::new(env!("CARGO_BIN_EXE_beamspot"))
}

/// A camera of `side` × `side` pixels that sees 38 mm of the sample.
pub(crate) fn camera(side: u32) -> String {
    let mm_per_pixel = 38.4 / f64::from(side);
    format!(
        "width = {side}\nheight = {side}\nmm_per_pixel = {mm_per_pixel}\nbeam_fwhm_mm = 1.0\n\
         exposures_s = [0.001, 0.008, 0.06, 0.5, 4.0]\n"
    )
}

/// A folder with a capture of marble, made once.
pub(crate) fn capture() -> PathBuf {
    static CAPTURE: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = CAPTURE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("camera.toml"), camera(128)).unwrap();
        let status = beamspot()
            .current_dir(folder.path())
            .args([
                "synth",
                "--material",
                "marble",
                "--camera",
                "camera.toml",
                "-o",
                "marble",
            ])
            .output()
            .unwrap()
            .status;
        assert!(status.success());
        let path = folder.path().join("marble");
        (folder, path)
    });
    path.clone()
}

/// Copies [`capture`] into `target`.
pub(crate) fn copy_capture(target: &Path) {
    for name in names(&capture()) {
        let to = target.join(&name);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(capture().join(&name), to).unwrap();
    }
}

/// Every file below `folder`, hidden ones included, by name relative to it, sorted.
pub(crate) fn names(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                found.push(path.strip_prefix(folder).unwrap().to_owned());
            }
        }
    }
    found.sort();
    found
}

//! A manifest to be filled in, from a folder of frames.

use crate::error::{Error, Kind, Result};
use crate::files;
use crate::reading::{RAW, READS_RAW, read_frame};
use formats::Depth;
use formats::capture::{Draft, DraftFrame};
use std::fs;
use std::path::Path;

/// Ends of the names of files that may hold a frame.
const ENDINGS: [&str; 11] = [
    "dng", "tif", "tiff", "png", "pgm", "ppm", "pnm", "exr", "fit", "fits", "fts",
];
/// How to have camera RAW read.
const GET_RAW: &str = "build beamspot with `--features raw`, or convert it to uncompressed DNG";
/// Folders below the one given that are looked into.
const DEPTH: usize = 3;

/// Parts of a name that mean a blocked beam, and the white reference.
const DARK: [&str; 3] = ["dark", "blocked", "black"];
const WHITE: [&str; 5] = ["reference", "white", "spectralon", "diffuser", "ptfe"];

/// A draft of a manifest, and what came of the folder.
#[derive(Clone, Debug)]
pub struct Init {
    /// The manifest.
    pub draft: Draft,
    /// What was found, in sentences.
    pub found: Vec<String>,
    /// What could not be known, in sentences.
    pub unknown: Vec<String>,
}

/// The draft that the frames in `folder` give.
///
/// Files are told apart by the words in the names of their folders and their own: `dark`,
/// `blocked`; `reference`, `ref`, `white`, `spectralon`; what has none of them is the sample.
///
/// # Errors
///
/// The folder cannot be read, or holds no frame.
pub fn draft(folder: &Path) -> Result<Init> {
    let mut names = vec![];
    let mut skipped = vec![];
    collect(folder, "", 0, &mut names, &mut skipped)?;
    names.sort();
    if names.is_empty() {
        let raw = match skipped.first() {
            Some(raw) => format!(" ({raw} is camera RAW: {GET_RAW})"),
            None => String::new(),
        };
        let message = format!(
            "{}: no frame found{raw}; expected TIFF, PNG, PGM, PPM, OpenEXR or FITS",
            folder.display()
        );
        return Err(Error::new(Kind::Input, message));
    }
    let mut init = Init {
        draft: Draft {
            material: material(folder),
            ..Draft::default()
        },
        found: vec![],
        unknown: vec![],
    };
    for name in skipped {
        let raw = format!("{name}: camera RAW: {GET_RAW}");
        init.unknown.push(raw);
    }
    for name in &names {
        init.add(folder, name)?;
    }
    init.finish();
    Ok(init)
}

/// Names of frames under `folder`/`below`, with `/` between folders, and those of RAW files.
fn collect(
    folder: &Path,
    below: &str,
    depth: usize,
    names: &mut Vec<String>,
    skipped: &mut Vec<String>,
) -> Result<()> {
    let place = folder.join(below);
    let blame = |e: std::io::Error| Error::new(Kind::Input, format!("{}: {e}", place.display()));
    if !place.is_dir() {
        let found = format!(
            "{}: no such folder: name that of the frames",
            place.display()
        );
        return Err(Error::new(Kind::Input, found));
    }
    for entry in fs::read_dir(&place).map_err(blame)? {
        let entry = entry.map_err(blame)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') {
            continue;
        }
        let whole = if below.is_empty() {
            name
        } else {
            format!("{below}/{name}")
        };
        let ending = whole.rsplit_once('.').map(|(_, end)| end.to_lowercase());
        let ending = ending.as_deref().unwrap_or_default();
        if entry.path().is_dir() {
            if depth < DEPTH {
                collect(folder, &whole, depth + 1, names, skipped)?;
            }
        } else if ENDINGS.contains(&ending) || (READS_RAW && RAW.contains(&ending)) {
            names.push(whole);
        } else if RAW.contains(&ending) {
            skipped.push(whole);
        }
    }
    skipped.sort();
    Ok(())
}

/// The folder's own name.
fn material(folder: &Path) -> String {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let name = whole
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| "sample".to_owned())
}

/// Whether a name has a word of the list, or of `exact` as a whole word.
fn says(name: &str, list: &[&str], exact: &[&str]) -> bool {
    let name = name.to_lowercase();
    list.iter().any(|word| name.contains(word))
        || name
            .split(|c: char| !c.is_alphabetic())
            .any(|word| exact.contains(&word))
}

impl Init {
    fn add(&mut self, folder: &Path, name: &str) -> Result<()> {
        let path = folder.join(name);
        let bytes = files::read(&path)?;
        let (decoded, metadata) = match read_frame(&bytes, Path::new(name), vec![]) {
            Ok(read) => read,
            Err(error) => {
                self.unknown.push(format!("left out: {error}"));
                return Ok(());
            }
        };
        self.draft.eight_bits |= decoded.depth == Depth::Bits(8);
        let file = name.rsplit('/').next().unwrap_or(name);
        let exposure = match metadata.exposure(file, None) {
            Ok(Some(found)) => {
                let field = match found.source {
                    formats::metadata::Source::FileName => String::new(),
                    _ => format!(", {}", found.field),
                };
                Ok((found.seconds, format!("from the {}{field}", found.source)))
            }
            Ok(None) => Err("neither its metadata nor its name tells".to_owned()),
            Err(error) => Err(error.to_string()),
        };
        let white = says(name, &WHITE, &["ref", "refs"]);
        let list = match (white, says(name, &DARK, &["off"])) {
            (false, false) => &mut self.draft.frames,
            (false, true) => &mut self.draft.dark,
            (true, false) => &mut self.draft.reference_frames,
            (true, true) => &mut self.draft.reference_dark,
        };
        list.push(DraftFrame {
            file: name.to_owned(),
            exposure,
        });
        Ok(())
    }

    fn finish(&mut self) {
        let Self {
            draft,
            found,
            unknown,
        } = self;
        if draft.reference_dark.is_empty() && !draft.dark.is_empty() {
            // Darks are of the camera and know nothing of what stands before it.
            let serves = |dark: &&DraftFrame| {
                let same = |frame: &DraftFrame| seconds(frame) == seconds(dark);
                draft.reference_frames.iter().any(same)
            };
            draft.reference_dark = draft.dark.iter().filter(serves).cloned().collect();
            if !draft.reference_dark.is_empty() {
                found.push("the darks of the sample serve the reference too".to_owned());
            }
        }
        let sets = [
            ("sample.frames", &mut draft.frames),
            ("sample.dark", &mut draft.dark),
            ("reference.frames", &mut draft.reference_frames),
            ("reference.dark", &mut draft.reference_dark),
        ];
        for (field, list) in sets {
            let by_time = |frame: &DraftFrame| seconds(frame).unwrap_or(f64::INFINITY);
            list.sort_by(|a, b| by_time(a).total_cmp(&by_time(b)));
            let times: Vec<f64> = list.iter().filter_map(seconds).collect();
            match (times.first(), times.last()) {
                _ if list.is_empty() => unknown.push(format!("{field}: no such frame")),
                (Some(first), Some(last)) => {
                    found.push(format!(
                        "{field}: {} frames, {first} to {last} s",
                        list.len()
                    ));
                }
                _ => found.push(format!("{field}: {} frames", list.len())),
            }
            let mut from: Vec<&str> = vec![];
            for frame in list.iter() {
                match &frame.exposure {
                    Err(reason) => {
                        let file = &frame.file;
                        unknown.push(format!("{file}: exposure_s: {reason}"));
                    }
                    Ok((_, source)) if !from.contains(&source.as_str()) => from.push(source),
                    Ok(_) => {}
                }
            }
            if !from.is_empty() {
                found.push(format!("{field}: exposure times {}", from.join(" and ")));
            }
        }
        for (field, frames, darks) in [
            ("sample.dark", &draft.frames, &draft.dark),
            (
                "reference.dark",
                &draft.reference_frames,
                &draft.reference_dark,
            ),
        ] {
            let mut missing: Vec<f64> = frames.iter().filter_map(seconds).collect();
            missing.retain(|time| !darks.iter().any(|dark| seconds(dark) == Some(*time)));
            missing.dedup();
            if !missing.is_empty() && !darks.is_empty() {
                let list: Vec<String> = missing.iter().map(f64::to_string).collect();
                unknown.push(format!("{field}: no dark of {} s", list.join(", ")));
            }
        }
        for line in [
            "eta: relative refractive index of the sample",
            "geometry.mm_per_pixel: what one pixel sees of the sample",
            "camera.gain_e_per_dn, read_noise_e, black_level_dn, white_level_dn: the sensor",
            "reference.reflectance: of the white, from its certificate",
            "reference.sigma_s_prime_per_mm, sigma_a_per_mm: of the white, which glows, so that its \
             picture shows the beam; else beam.fwhm_mm",
        ] {
            unknown.push(line.to_owned());
        }
        if draft.eight_bits {
            let line = "camera.response: the frames have 8 bits, which are seldom linear";
            unknown.push(line.to_owned());
        }
    }
}

fn seconds(frame: &DraftFrame) -> Option<f64> {
    frame.exposure.as_ref().ok().map(|(seconds, _)| *seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_told_apart_by_folder_and_name() {
        let here = tempfile::tempdir().unwrap();
        let names = [
            "sample/spot_10ms.pgm",
            "sample/dark_10ms.pgm",
            "White/spot_20ms.pgm",
            "White/blocked_20ms.pgm",
            "ref_40ms.pgm",
            "my_white.pgm",
            "notes.txt",
            ".hidden.pgm",
            "old.CR3",
        ];
        for (i, name) in names.iter().enumerate() {
            let path = here.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            // A build that reads camera RAW has to find that this is none.
            let bytes = match name.ends_with("CR3") {
                true => b"\0\0\0\x18ftypcrx ".to_vec(),
                false => [b"P5 1 1 65535\n\0", &[i as u8][..]].concat(),
            };
            fs::write(path, bytes).unwrap();
        }
        let init = draft(here.path()).unwrap();
        let files = |list: &[DraftFrame]| -> Vec<String> {
            list.iter().map(|frame| frame.file.clone()).collect()
        };
        let draft = &init.draft;
        assert_eq!(files(&draft.frames), ["sample/spot_10ms.pgm"]);
        assert_eq!(files(&draft.dark), ["sample/dark_10ms.pgm"]);
        assert_eq!(files(&draft.reference_dark), ["White/blocked_20ms.pgm"]);
        let whites = ["White/spot_20ms.pgm", "ref_40ms.pgm", "my_white.pgm"];
        assert_eq!(files(&draft.reference_frames), whites);
        let unknown = init.unknown.join("\n");
        for line in [
            "old.CR3: camera RAW",
            "my_white.pgm: exposure_s: neither",
            "reference.dark: no dark of 0.04 s",
            "eta: ",
        ] {
            assert!(unknown.contains(line), "{line}: {unknown}");
        }
        let empty = tempfile::tempdir().unwrap();
        let error = super::draft(empty.path()).unwrap_err();
        assert!(error.to_string().contains("no frame found"), "{error}");
    }
}

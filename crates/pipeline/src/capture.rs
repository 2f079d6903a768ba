//! A manifest with its frames: loading, hashing, merging.

use crate::error::{Blame, Error, Kind, Result};
use crate::files;
use crate::monitor::Monitor;
use formats::capture::FrameEntry;
use formats::{Capture, decode_frame, parse_capture};
use hdr::{DarkFrame, Merge, MergeReport};
use physics::{Frame, RadianceMap, Sensor};
use std::path::{Path, PathBuf};

/// A file that numbers came from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// As the manifest or the call names it; never an absolute path of the machine.
    pub name: String,
    /// BLAKE3 of its bytes.
    pub blake3: String,
    /// Where it is.
    pub path: PathBuf,
}

impl Input {
    /// The input `path`, whose bytes are `bytes`, under the name that was used for it.
    pub fn new(path: &Path, name: &str, bytes: &[u8]) -> Self {
        Self {
            name: name.to_owned(),
            blake3: blake3::hash(bytes).to_hex().to_string(),
            path: path.to_owned(),
        }
    }

    /// The input `path` under its own file name, wherever it stands.
    pub fn named_by_itself(path: &Path, bytes: &[u8]) -> Self {
        let name = path
            .file_name()
            .unwrap_or(path.as_os_str())
            .to_string_lossy();
        Self::new(path, &name, bytes)
    }
}

/// A manifest and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// What it says.
    pub capture: Capture,
    /// The folder that its files are relative to.
    pub folder: PathBuf,
    /// The manifest itself.
    pub input: Input,
}

/// Which of the two sets of frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// The sample.
    Sample,
    /// The white reference.
    Reference,
}

impl Subject {
    fn field(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::Reference => "reference",
        }
    }
}

/// A merged set of frames.
#[derive(Clone, Debug)]
pub struct Merged {
    /// In DN/s.
    pub map: RadianceMap,
    /// What was left out, and where.
    pub report: MergeReport,
    /// Every frame and dark.
    pub inputs: Vec<Input>,
}

/// Reads the manifest `path`.
///
/// # Errors
///
/// It cannot be read, or names the field that cannot be used.
pub fn load(path: &Path) -> Result<Loaded> {
    let text = files::read_text(path)?;
    let capture = parse_capture(&text).input(path.display())?;
    Ok(Loaded {
        capture,
        folder: path.parent().unwrap_or(Path::new("")).to_owned(),
        input: Input::named_by_itself(path, text.as_bytes()),
    })
}

impl Loaded {
    /// Every file that the manifest names, itself included.
    pub fn paths(&self) -> Vec<PathBuf> {
        let Capture {
            sample, reference, ..
        } = &self.capture;
        let sets = [
            &sample.frames,
            &sample.dark,
            &reference.frames,
            &reference.dark,
        ];
        let frames = sets
            .into_iter()
            .flatten()
            .map(|entry| self.folder.join(&entry.file));
        frames.chain([self.input.path.clone()]).collect()
    }

    /// What the manifest says of the sensor.
    ///
    /// # Errors
    ///
    /// A number that the noise model needs is missing.
    pub fn sensor(&self) -> Result<Sensor> {
        let camera = &self.capture.camera;
        let need = |value: Option<f64>, field: &str, how: &str| {
            value.ok_or_else(|| {
                let message = format!(
                    "{}: field `camera.{field}` is missing: {how}",
                    self.input.path.display()
                );
                Error::new(Kind::Input, message)
            })
        };
        Ok(Sensor {
            gain_e_per_dn: need(
                camera.gain_e_per_dn,
                "gain_e_per_dn",
                "expected the electrons per count, from the camera's data sheet",
            )?,
            read_noise_e: need(
                camera.read_noise_e,
                "read_noise_e",
                "expected the standard deviation of a read-out in electrons, from the data sheet",
            )?,
            black_level_dn: need(
                camera.black_level_dn,
                "black_level_dn",
                "expected the count of a short dark frame",
            )?,
            white_level_dn: need(
                camera.white_level_dn,
                "white_level_dn",
                "expected the count at which a pixel saturates",
            )?,
            prnu_relative: camera.prnu_relative,
        })
    }

    /// Merges the frames of `subject`, one exposure after the other.
    ///
    /// # Errors
    ///
    /// A frame is missing, damaged or of another size, or the merge has nothing to go by. The
    /// error names the file, or the field of the manifest.
    pub fn merge(&self, subject: Subject, monitor: &dyn Monitor) -> Result<Merged> {
        let sensor = self.sensor()?;
        let (frames, darks) = match subject {
            Subject::Sample => (&self.capture.sample.frames, &self.capture.sample.dark),
            Subject::Reference => (&self.capture.reference.frames, &self.capture.reference.dark),
        };
        let mut order: Vec<&FrameEntry> = frames.iter().collect();
        order.sort_by(|a, b| a.exposure_s.total_cmp(&b.exposure_s));
        let mut inputs = Vec::with_capacity(frames.len() + darks.len());
        let mut merge: Option<Merge> = None;
        let mut dark: Option<DarkFrame> = None;
        for entry in order {
            monitor.check()?;
            // Frames of one exposure share their dark.
            if dark
                .as_ref()
                .is_none_or(|d| d.exposure_s() != entry.exposure_s)
            {
                dark = Some(self.dark(entry, darks, &mut inputs, monitor)?);
            }
            let dark = dark.as_ref().expect("it was made just above");
            let frame = self.frame(entry, &mut inputs)?;
            let merge = match &mut merge {
                Some(merge) => merge,
                none => none.insert(
                    Merge::new(frame.width, frame.height, frame.channels, &sensor)
                        .input(self.place(&entry.file))?,
                ),
            };
            merge
                .add(&frame, dark, entry.exposure_s)
                .input(self.place(&entry.file))?;
            monitor.step();
        }
        let place = format!("{}: {}.frames", self.input.path.display(), subject.field());
        let merge = merge.ok_or_else(|| Error::new(Kind::Input, format!("{place}: empty")))?;
        let (map, report) = merge.finish().input(place)?;
        Ok(Merged {
            map,
            report,
            inputs,
        })
    }

    /// The mean of the darks that serve `entry`.
    fn dark(
        &self,
        entry: &FrameEntry,
        darks: &[FrameEntry],
        inputs: &mut Vec<Input>,
        monitor: &dyn Monitor,
    ) -> Result<DarkFrame> {
        let mut sum: Option<DarkFrame> = None;
        for dark in darks.iter().filter(|d| d.same_exposure(entry)) {
            let frame = self.frame(dark, inputs)?;
            let place = self.place(&dark.file);
            match &mut sum {
                Some(sum) => sum.add(&frame).input(place)?,
                none => *none = Some(DarkFrame::new(&frame, entry.exposure_s).input(place)?),
            }
            monitor.step();
        }
        sum.ok_or_else(|| {
            let message = format!("no dark frame of {} s for {}", entry.exposure_s, entry.file);
            Error::new(Kind::Input, message)
        })
    }

    fn frame(&self, entry: &FrameEntry, inputs: &mut Vec<Input>) -> Result<Frame> {
        let path = self.folder.join(&entry.file);
        let bytes = files::read(&path)?;
        let frame = decode_frame(&bytes).input(path.display())?;
        inputs.push(Input::new(&path, &entry.file, &bytes));
        Ok(frame)
    }

    fn place(&self, file: &str) -> String {
        self.folder.join(file).display().to_string()
    }

    /// How many frames of `subject` there are to read, darks included.
    pub fn frame_count(&self, subject: Subject) -> u64 {
        let (frames, dark) = match subject {
            Subject::Sample => (&self.capture.sample.frames, &self.capture.sample.dark),
            Subject::Reference => (&self.capture.reference.frames, &self.capture.reference.dark),
        };
        (frames.len() + dark.len()) as u64
    }
}

/// What was dropped in a merge, in sentences.
pub fn merge_lines(subject: Subject, merged: &Merged) -> Vec<String> {
    let names: Vec<&str> = merged
        .map
        .channels
        .iter()
        .map(|c| c.name.as_str())
        .collect();
    let pixels = (merged.map.width * merged.map.height) as f64;
    let per_channel = |numbers: &mut dyn Iterator<Item = String>| {
        let cells: Vec<String> = names
            .iter()
            .zip(numbers)
            .map(|(name, n)| format!("{name} {n}"))
            .collect();
        cells.join(", ")
    };
    let what = subject.field();
    let mut lines = vec![];
    for frame in &merged.report.frames {
        if frame.saturated.iter().any(|n| *n > 0) {
            let shares = &mut frame.saturated.iter().map(|n| {
                let percent = 100.0 * *n as f64 / pixels;
                format!("{percent:.2} %")
            });
            lines.push(format!(
                "{what}, {} s: saturated and left out: {}",
                frame.exposure_s,
                per_channel(shares)
            ));
        }
    }
    let hot = per_channel(&mut merged.report.channels.iter().map(|c| c.hot.to_string()));
    lines.push(format!("{what}: hot pixels masked: {hot}"));
    if merged
        .report
        .channels
        .iter()
        .any(|c| c.saturated_everywhere > 0)
    {
        let counts = &mut merged
            .report
            .channels
            .iter()
            .map(|c| c.saturated_everywhere.to_string());
        lines.push(format!(
            "{what}: saturated in every frame: {}",
            per_channel(counts)
        ));
    }
    lines
}

//! A manifest with its frames: loading, hashing, merging.

use crate::consistency::Consistency;
pub use crate::consistency::OfCamera;
use crate::error::{Blame, Error, Kind, Result};
use crate::monitor::{Monitor, Quiet};
use crate::reading::read_frame_of;
use crate::response::{self, Curves};
use crate::{exposures, files, geometry};
use formats::capture::FrameEntry;
use formats::metadata::Metadata;
use formats::{Capture, Decoded, parse_manifest};
use hdr::overlap::{Contradiction, Placed};
use hdr::{Comparison, DarkFrame, Merge, MergeReport, Overlap, registration};
use physics::{Frame, Mosaic, RadianceMap, Sensor};
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
    /// Where exposure times were found that it does not state, in sentences.
    pub notes: Vec<String>,
    /// The response of a camera of 8 bits, once it was recovered.
    pub curves: Option<Curves>,
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
    pub(crate) fn field(self) -> &'static str {
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
    /// What the files tell of the camera.
    pub of_camera: OfCamera,
    /// What the files themselves gave reason to say, in sentences.
    pub notes: Vec<String>,
    /// Every frame and dark.
    pub inputs: Vec<Input>,
    /// What the frames say of each other.
    pub comparison: Comparison,
    /// Whether the measured exposures took the place of the nominal ones.
    pub uses_measured: bool,
}

/// Memory in which one file after another is read and unpacked: fresh pages cost more than all
/// that is done with the samples of a plain file.
#[derive(Debug, Default)]
pub(crate) struct Room {
    file: Vec<u16>,
    samples: Vec<u16>,
}

impl Room {
    /// Takes the memory of a frame that has served.
    pub(crate) fn take_back(&mut self, frame: Frame) {
        self.give(frame.samples.into_memory());
    }

    fn give(&mut self, memory: Vec<u16>) {
        // A file that was left without its memory has its samples in there.
        let room = if self.file.capacity() == 0 {
            &mut self.file
        } else {
            &mut self.samples
        };
        *room = memory;
    }

    /// Keeps the memory of one frame: where files are packed, their bytes had one of their own.
    fn keep_one(&mut self) {
        if self.samples.capacity() > 0 {
            self.file = vec![];
        }
    }
}

/// Memory for the frames and their darks, and for the sums of a merge.
///
/// The last dark is not kept: its memory is wanted for the variance of the sum.
#[derive(Debug, Default)]
pub struct Workspace {
    frame: Room,
    dark: Room,
    /// For sums: the values of a picture that has served.
    sums: Vec<f32>,
}

impl Workspace {
    /// Takes the memory of a picture that has served, and leaves it without pixels.
    pub(crate) fn take_back(&mut self, map: &mut RadianceMap) {
        for channel in &mut map.channels {
            self.sums = std::mem::take(&mut channel.value);
            channel.variance = vec![];
        }
    }
}

/// A file of a frame and what it says.
struct ReadFrame {
    decoded: Decoded,
    metadata: Metadata,
    input: Input,
}

/// Relative deviation of an exposure that no shutter makes.
const WRONG_EXPOSURE: f64 = 0.2;

/// Relative deviation of an exposure from which it is named.
const NAMED_EXPOSURE: f64 = 0.02;

/// Shift of a frame from which it is named, px.
const SHIFTED_PX: f64 = 0.2;

/// Rounds of moving frames back: a shift of many pixels is measured too short at first.
const REGISTRATIONS: usize = 8;

/// What may be left of a shift after that, px: half a pixel along both axes.
const REMAINING_PX: f64 = 0.8;

/// What one pass over the frames gives.
type Pass = (RadianceMap, MergeReport, Vec<Input>, Consistency);

/// The same before the sum becomes a picture.
type Sum = (Merge, Vec<Input>, Consistency);

/// By how many whole pixels each frame has to move to be where the others are.
fn moves_back(comparison: &Comparison) -> Vec<[i32; 2]> {
    let frames = comparison.frames.iter();
    frames
        .map(|placed| match placed.shifted(SHIFTED_PX) {
            // A shift beyond any frame is no measurement.
            Some(length) if length < 1e4 => placed.shift_px.map(|s| -(s.value.round() as i32)),
            _ => [0; 2],
        })
        .collect()
}

/// Reads the manifest `path`.
///
/// # Errors
///
/// It cannot be read, or names the field that cannot be used; or a frame that is to tell its
/// exposure time does not.
pub fn load(path: &Path) -> Result<Loaded> {
    let text = files::read_text(path)?;
    let manifest = parse_manifest(&text).input(path.display())?;
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    let unit = manifest.camera.fits_exposure_unit;
    let mut notes = vec![];
    let capture = manifest
        .resolved(|field, frames| exposures::find(&folder, field, frames, unit, &mut notes))?;
    capture.check_frames().input(path.display())?;
    Ok(Loaded {
        capture,
        folder,
        input: Input::named_by_itself(path, text.as_bytes()),
        notes,
        curves: None,
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
        let masks = [&sample.mask, &sample.rendering, &reference.mask]
            .into_iter()
            .flatten();
        frames
            .chain(masks.map(|mask| self.folder.join(mask)))
            .chain([self.input.path.clone()])
            .collect()
    }

    /// Merges the frames of `subject`, one exposure after the other.
    ///
    /// # Errors
    ///
    /// A frame is missing, damaged or of another size, or the merge has nothing to go by. The
    /// error names the file, or the field of the manifest.
    pub fn merge(
        &self,
        subject: Subject,
        sensor: &Sensor,
        workspace: &mut Workspace,
        monitor: &dyn Monitor,
    ) -> Result<Merged> {
        let (frames, _) = self.entries(subject);
        let mut moves = vec![[0; 2]; frames.len()];
        let (mut merged, mut comparison) =
            self.compare(subject, sensor, workspace, monitor, &moves)?;
        let mosaic = merged.3.mosaic();
        if let Some(mosaic) = &mosaic {
            comparison = hdr::mosaic::in_pixels(mosaic, comparison);
        }
        // Photosites of one colour are more than a pixel apart: their frames are not moved.
        let rounds = if mosaic.is_none() { REGISTRATIONS } else { 0 };
        for _ in 0..rounds {
            let further = moves_back(&comparison);
            if further.iter().all(|step| *step == [0; 2]) {
                break;
            }
            for (all, [right, down]) in moves.iter_mut().zip(further) {
                *all = [all[0] + right, all[1] + down];
            }
            workspace.take_back(&mut merged.0);
            (merged, comparison) =
                self.compare(subject, sensor, workspace, &Quiet(monitor), &moves)?;
        }
        let limit_px = if mosaic.is_none() {
            REMAINING_PX
        } else {
            SHIFTED_PX
        };
        self.check_frames(subject, &comparison, limit_px)?;
        let uses_measured = comparison.prefers_measured();
        let (map, report, inputs, seen) = if uses_measured {
            // The frames once more, each as long as the others say that it was.
            let quiet = Quiet(monitor);
            workspace.take_back(&mut merged.0);
            let exposure_s =
                |_: &_, index: usize, _: &_, _: &_| Ok(comparison.frames[index].measured_s);
            let sum = self.sum(subject, sensor, workspace, &quiet, &moves, exposure_s)?;
            self.finished(subject, sum)?
        } else {
            merged
        };
        let (map, report) = match seen.mosaic() {
            Some(mosaic) => hdr::mosaic::unfolded(&mosaic, map, &report),
            None => (map, report),
        };
        let of_camera = seen.of_camera();
        let mut notes = seen.notes(frames, sensor.white_level_dn);
        notes.extend(self.shift_notes(subject, &comparison, &moves));
        Ok(Merged {
            map,
            report,
            of_camera,
            notes,
            inputs,
            comparison,
            uses_measured,
        })
    }

    /// One pass over the frames, each moved by its `moves`, that merges and compares them.
    fn compare(
        &self,
        subject: Subject,
        sensor: &Sensor,
        workspace: &mut Workspace,
        monitor: &dyn Monitor,
        moves: &[[i32; 2]],
    ) -> Result<(Pass, Comparison)> {
        let mut overlap = Overlap::new(sensor);
        let sum = self.sum(
            subject,
            sensor,
            workspace,
            monitor,
            moves,
            |entry, _, frame, dark| {
                overlap
                    .add(frame, dark, entry.exposure_s)
                    .input(self.place(&entry.file))?;
                Ok(entry.exposure_s)
            },
        )?;
        // First the end of the one: the variance of the other takes the memory.
        let comparison = overlap.finish();
        Ok((self.finished(subject, sum)?, comparison))
    }

    /// What became of frames that were shifted.
    fn shift_notes(
        &self,
        subject: Subject,
        comparison: &Comparison,
        moves: &[[i32; 2]],
    ) -> Vec<String> {
        let entries = by_exposure(self.entries(subject).0);
        let frames = entries.iter().zip(&comparison.frames).zip(moves);
        frames
            .filter_map(|((entry, placed), [right, down])| {
                let [x, y] = placed.shift_px;
                let rest = x.value.hypot(y.value);
                let file = &entry.file;
                if *right != 0 || *down != 0 {
                    let (across, along) = (x.value - f64::from(*right), y.value - f64::from(*down));
                    Some(format!(
                        "{file}: shifted by {across:+.2} px right and {along:+.2} down against the other \
                         frames; moved back by whole pixels, which keeps its noise as it is, and the {rest:.2} px \
                         that are left stay in the picture as blur"
                    ))
                } else {
                    placed.shifted(SHIFTED_PX).map(|_| {
                        format!(
                            "{file}: shifted by {:+.2} px right and {:+.2} down against the other frames, \
                             less than a pixel: left as it is, as blur",
                            x.value, y.value
                        )
                    })
                }
            })
            .collect()
    }

    /// One pass over the frames, each moved by its `moves`; `exposure` says how long each was
    /// exposed.
    fn sum(
        &self,
        subject: Subject,
        sensor: &Sensor,
        workspace: &mut Workspace,
        monitor: &dyn Monitor,
        moves: &[[i32; 2]],
        mut exposure: impl FnMut(&FrameEntry, usize, &Frame, &DarkFrame) -> Result<f64>,
    ) -> Result<Sum> {
        let mut merge: Option<Merge> = None;
        let mut sums = std::mem::take(&mut workspace.sums);
        let (inputs, seen) =
            self.with_darks(subject, workspace, monitor, |entry, frame, dark, index| {
                let merge = match &mut merge {
                    Some(merge) => merge,
                    none => none.insert(
                        Merge::new(frame.width, frame.height, frame.channels, sensor)
                            .input(self.place(&entry.file))?
                            .in_memory(std::mem::take(&mut sums)),
                    ),
                };
                let by = moves[index];
                let back = (by != [0; 2]).then(|| (registration::moved(frame, by), dark.moved(by)));
                let (frame, dark) = back.as_ref().map_or((frame, dark), |(f, d)| (f, d));
                let measured_s = exposure(entry, index, frame, dark)?;
                merge
                    .add_measured(frame, dark, entry.exposure_s, measured_s)
                    .input(self.place(&entry.file))
            })?;
        let empty = || Error::new(Kind::Input, format!("{}: empty", self.frames_of(subject)));
        Ok((merge.ok_or_else(empty)?, inputs, seen))
    }

    /// The picture that a sum makes, with its variance.
    fn finished(&self, subject: Subject, (merge, inputs, seen): Sum) -> Result<Pass> {
        let (map, report) = merge.finish().input(self.frames_of(subject))?;
        Ok((map, report, inputs, seen))
    }

    /// The field of the manifest that lists the frames of `subject`.
    fn frames_of(&self, subject: Subject) -> String {
        format!("{}: {}.frames", self.input.path.display(), subject.field())
    }

    /// Refuses a frame that does not belong to the others.
    fn check_frames(&self, subject: Subject, comparison: &Comparison, limit_px: f64) -> Result<()> {
        let entries = by_exposure(self.entries(subject).0);
        let off: Vec<String> = comparison
            .contradictions(WRONG_EXPOSURE)
            .into_iter()
            .map(|contradiction| self.contradicted(subject, &entries, comparison, contradiction))
            .collect();
        if !off.is_empty() {
            return Err(Error::new(Kind::Input, off.join("\n")));
        }
        for (entry, placed) in entries.iter().zip(&comparison.frames) {
            let place = self.place(&entry.file);
            if let Some(length) = placed.shifted(limit_px) {
                let [x, y] = placed.shift_px;
                let message = format!(
                    "{place}: shifted against the other frames of {}, and moved back as far as that could be measured it is still off by {length:.2} px ({:+.2} right, {:+.2} down): expected less than {limit_px} px; fix camera and sample, and leave the frame out",
                    subject.field(),
                    x.value,
                    y.value
                );
                return Err(Error::new(Kind::Input, message));
            }
        }
        Ok(())
    }

    /// What is wrong with stated exposures, in a sentence.
    fn contradicted(
        &self,
        subject: Subject,
        entries: &[&FrameEntry],
        comparison: &Comparison,
        contradiction: Contradiction,
    ) -> String {
        let what = subject.field();
        let percent = 100.0 * WRONG_EXPOSURE;
        let place = |k: usize| self.place(&entries[k].file);
        match contradiction {
            Contradiction::Frame(k) => {
                let placed = comparison.frames[k];
                format!(
                    "{}: exposed {:.4} s as compared with the other frames of {what}, and exposure_s = {}: expected the same within {percent:.0} %; correct exposure_s, or leave the frame out if light or aperture changed",
                    place(k),
                    placed.measured_s,
                    placed.nominal_s,
                )
            }
            Contradiction::Pair(k) => {
                let [short, long] = [comparison.frames[k], comparison.frames[k + 1]];
                let stated = long.nominal_s / short.nominal_s;
                let found = long.measured_s / short.measured_s;
                format!(
                    "{}, {}: the second has {found:.4} times the light of the first, and their exposure_s, {} and {}, make {stated:.4} times: expected the same within {percent:.0} %; either may be off, since no majority of the frames of {what} agrees with one of them; correct exposure_s, leave out the frame for which light or aperture changed, or add one of an exposure between",
                    place(k),
                    place(k + 1),
                    short.nominal_s,
                    long.nominal_s,
                )
            }
        }
    }

    /// Hands every frame of `subject` with its dark and its number to `each`, by increasing
    /// exposure, and returns what was read.
    pub(crate) fn with_darks(
        &self,
        subject: Subject,
        workspace: &mut Workspace,
        monitor: &dyn Monitor,
        mut each: impl FnMut(&FrameEntry, &Frame, &DarkFrame, usize) -> Result<()>,
    ) -> Result<(Vec<Input>, Consistency)> {
        let (frames, darks) = self.entries(subject);
        let mut inputs = Vec::with_capacity(frames.len() + darks.len());
        let mut seen = Consistency::default();
        let mut dark: Option<DarkFrame> = None;
        let Workspace {
            frame: frame_room,
            dark: dark_room,
            ..
        } = workspace;
        let mut sample_count = 0;
        for (index, entry) in by_exposure(frames).into_iter().enumerate() {
            monitor.check()?;
            // Frames of one exposure share their dark.
            let frame = if dark
                .as_ref()
                .is_none_or(|d| d.exposure_s() != entry.exposure_s)
            {
                if let Some(dark) = dark.take() {
                    dark_room.give(dark.into_memory());
                }
                let mut make_dark =
                    || self.dark(entry, darks, &mut inputs, &mut seen, dark_room, monitor);
                // To unpack a file keeps one thread busy, and its bytes are few. Plain ones come as
                // fast as memory is, and there may not be room for the bytes of two.
                let (new, frame) = if self.is_packed(entry, sample_count) {
                    rayon::join(make_dark, || self.read(entry, frame_room))
                } else {
                    (make_dark(), self.read(entry, frame_room))
                };
                dark = Some(new?);
                frame
            } else {
                self.read(entry, frame_room)
            };
            let frame = self.take(entry, frame?, &mut inputs, &mut seen)?;
            sample_count = frame.samples.len();
            let dark = dark.as_ref().expect("it was made just above");
            each(entry, &frame, dark, index)?;
            frame_room.take_back(frame);
            monitor.step();
        }
        // Next the sum gets its variance, for which there has to be room.
        frame_room.keep_one();
        *dark_room = Room::default();
        Ok((inputs, seen))
    }

    /// The frames and the darks of `subject`.
    pub(crate) fn entries(&self, subject: Subject) -> (&[FrameEntry], &[FrameEntry]) {
        let Capture {
            sample, reference, ..
        } = &self.capture;
        match subject {
            Subject::Sample => (&sample.frames, &sample.dark),
            Subject::Reference => (&reference.frames, &reference.dark),
        }
    }

    /// The mean of the darks that serve `entry`.
    fn dark(
        &self,
        entry: &FrameEntry,
        darks: &[FrameEntry],
        inputs: &mut Vec<Input>,
        seen: &mut Consistency,
        room: &mut Room,
        monitor: &dyn Monitor,
    ) -> Result<DarkFrame> {
        let mut sum: Option<DarkFrame> = None;
        for dark in darks.iter().filter(|d| d.same_exposure(entry)) {
            let read = self.read(dark, room)?;
            let frame = self.take(dark, read, inputs, seen)?;
            let place = self.place(&dark.file);
            match &mut sum {
                Some(sum) => {
                    sum.add(&frame).input(place)?;
                    room.take_back(frame);
                }
                none => *none = Some(DarkFrame::of(frame, entry.exposure_s).input(place)?),
            }
            monitor.step();
        }
        sum.ok_or_else(|| {
            let message = format!("no dark frame of {} s for {}", entry.exposure_s, entry.file);
            Error::new(Kind::Input, message)
        })
    }

    /// What the file of `entry` holds, whatever its counts mean.
    pub(crate) fn decoded(&self, entry: &FrameEntry) -> Result<Decoded> {
        Ok(self.read(entry, &mut Room::default())?.decoded)
    }

    pub(crate) fn frame(
        &self,
        entry: &FrameEntry,
        room: &mut Room,
        inputs: &mut Vec<Input>,
        seen: &mut Consistency,
    ) -> Result<Frame> {
        let read = self.read(entry, room)?;
        self.take(entry, read, inputs, seen)
    }

    /// Whether the file of `entry` is shorter than 16-bit samples are, of which it may hold
    /// `sample_count`.
    fn is_packed(&self, entry: &FrameEntry, sample_count: usize) -> bool {
        let length = std::fs::metadata(self.folder.join(&entry.file)).map_or(0, |m| m.len());
        length < 2 * sample_count as u64
    }

    /// Reads the file of `entry` in `room`.
    fn read(&self, entry: &FrameEntry, room: &mut Room) -> Result<ReadFrame> {
        let path = self.folder.join(&entry.file);
        let (mut file, hash) = files::read_into(&path, std::mem::take(&mut room.file))?;
        let (decoded, metadata) = read_frame_of(&mut file, &path, &mut room.samples)?;
        room.file = file.into_memory();
        let input = Input {
            name: entry.file.clone(),
            blake3: hash.to_hex().to_string(),
            path,
        };
        Ok(ReadFrame {
            decoded,
            metadata,
            input,
        })
    }

    /// The frame of `entry`, if it belongs to those that were `seen`.
    fn take(
        &self,
        entry: &FrameEntry,
        read: ReadFrame,
        inputs: &mut Vec<Input>,
        seen: &mut Consistency,
    ) -> Result<Frame> {
        let ReadFrame {
            mut decoded,
            metadata,
            input,
        } = read;
        let camera = &self.capture.camera;
        let path = self.folder.join(&entry.file);
        decoded.mosaic = self
            .mosaic(&decoded)
            .map_err(|e| e.within(path.display()))?;
        geometry::check_aspect(self.capture.geometry.mm_per_pixel, decoded.pixel_aspect)
            .map_err(|e| e.within(path.display()))?;
        let mosaic = decoded.mosaic;
        let unit = camera.fits_exposure_unit;
        seen.see(entry, &input.blake3, &decoded, &metadata, unit)
            .map_err(|error| error.within(self.input.path.display()))?;
        inputs.push(input);
        if let Some(curves) = &self.curves {
            response::check(&decoded).map_err(|e| e.within(path.display()))?;
            return curves
                .applied(&decoded.frame)
                .map_err(|e| e.within(path.display()));
        }
        let stated_linear = camera.response.is_some();
        let frame = decoded.linear(stated_linear).input(path.display())?;
        Ok(match mosaic {
            Some(mosaic) => mosaic.folded(&frame),
            None => frame,
        })
    }

    /// The pattern of a frame: what its file says, or else the manifest.
    fn mosaic(&self, decoded: &Decoded) -> Result<Option<Mosaic>> {
        let refuse = |message| Err(Error::new(Kind::Input, message));
        let stated = self.capture.camera.mosaic;
        match (stated, decoded.mosaic) {
            (Some(stated), Some(own)) if stated != own => refuse(format!(
                "is the mosaic {own} by its own tags, and camera.mosaic = \"{stated}\": expected \
                 the same, or no camera.mosaic"
            )),
            (Some(_), _) if decoded.frame.channels != 1 => refuse(format!(
                "has {} channels, and camera.mosaic is given: expected gray files, one sample a \
                 photosite",
                decoded.frame.channels
            )),
            (stated, own) => Ok(stated.or(own)),
        }
    }

    pub(crate) fn place(&self, file: &str) -> String {
        self.folder.join(file).display().to_string()
    }

    /// How many frames of `subject` there are to read, darks included.
    pub fn frame_count(&self, subject: Subject) -> u64 {
        let (frames, dark) = self.entries(subject);
        (frames.len() + dark.len()) as u64
    }
}

/// `frames` by increasing exposure.
pub(crate) fn by_exposure(frames: &[FrameEntry]) -> Vec<&FrameEntry> {
    let mut order: Vec<&FrameEntry> = frames.iter().collect();
    order.sort_by(|a, b| a.exposure_s.total_cmp(&b.exposure_s));
    order
}

/// What the frames say of each other's exposures, in sentences.
pub fn exposure_lines(subject: Subject, merged: &Merged) -> Vec<String> {
    let what = subject.field();
    let frames = &merged.comparison.frames;
    let percent = |f: &Placed| {
        let (found, u) = (100.0 * f.deviation().exp_m1(), 100.0 * f.u_relative);
        format!("{found:+.2} ± {u:.2} %")
    };
    let mut lines: Vec<String> = frames
        .iter()
        .filter(|f| f.is_off(NAMED_EXPOSURE))
        .map(|f| {
            let off = percent(f);
            format!(
                "{what}, {} s: exposed {off} against what is stated",
                f.nominal_s
            )
        })
        .collect();
    let list = |scale: &str| {
        let each: Vec<String> = frames
            .iter()
            .map(|f| format!("{} s {}", f.nominal_s, percent(f)))
            .collect();
        format!(
            "{what}: exposures measured from the overlap of the frames{scale}: {}",
            each.join(", ")
        )
    };
    if merged.uses_measured {
        lines.push(list(" took the place of the stated ones"));
    } else if merged.comparison.links.iter().any(|l| l.ratio.is_some()) {
        lines.push(list(" agree with the stated ones, which were used"));
    }
    let unseen = merged
        .comparison
        .links
        .iter()
        .filter(|l| l.ratio.is_none())
        .count();
    if unseen > 0 {
        lines.push(format!(
            "{what}: {unseen} of {} steps between exposures could not be measured: the frames do \
             not overlap enough",
            merged.comparison.links.len()
        ));
    }
    lines
}

/// What a profile leaves out of a channel, in a sentence, where it does.
pub fn left_out(subject: Subject, channel: &str, rejected: u64, unmeasured: u64) -> Option<String> {
    (rejected + unmeasured > 0).then(|| {
        format!(
            "{}, {channel}: of the pixels about the spot, {rejected} were rejected as outliers of \
             their ring and {unmeasured} had not been measured",
            subject.field()
        )
    })
}

/// What a frame gave to a merge.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameUse {
    /// Of which picture.
    pub subject: Subject,
    /// Its exposure, s.
    pub exposure_s: f64,
    /// Names of the channels, with the shares of their pixels that were used, and that were left out
    /// as saturated or beside what is.
    pub channels: Vec<(String, [f64; 2])>,
}

impl FrameUse {
    /// Every frame of a merge.
    pub fn of(subject: Subject, merged: &Merged) -> Vec<Self> {
        let names = merged.map.names();
        let of_frame = |frame: &hdr::merge::FrameReport| {
            let counts = frame.used.iter().zip(&frame.saturated);
            let shares = counts.enumerate().map(|(channel, (used, saturated))| {
                let all = merged.map.pixels(channel) as f64;
                [used, saturated].map(|n| *n as f64 / all)
            });
            let channels = names.iter().map(|name| (*name).to_owned());
            Self {
                subject,
                exposure_s: frame.exposure_s,
                channels: channels.zip(shares).collect(),
            }
        };
        merged.report.frames.iter().map(of_frame).collect()
    }

    /// What was left out of it, in a sentence, where anything was.
    pub fn sentence(&self) -> Option<String> {
        if self
            .channels
            .iter()
            .all(|(_, [_, saturated])| *saturated == 0.0)
        {
            return None;
        }
        let shares = self.channels.iter().map(|(name, [_, saturated])| {
            let percent = 100.0 * saturated;
            format!("{name} {percent:.2} %")
        });
        Some(format!(
            "{}, {} s: saturated, or beside what is, and left out: {}",
            self.subject.field(),
            self.exposure_s,
            shares.collect::<Vec<_>>().join(", ")
        ))
    }
}

/// What else was dropped in a merge, in sentences.
pub fn merge_lines(subject: Subject, merged: &Merged) -> Vec<String> {
    let names = merged.map.names();
    let per_channel = |numbers: &mut dyn Iterator<Item = String>| {
        let cells: Vec<String> = names
            .iter()
            .zip(numbers)
            .map(|(name, n)| format!("{name} {n}"))
            .collect();
        cells.join(", ")
    };
    let what = subject.field();
    let mut lines: Vec<String> = merged
        .notes
        .iter()
        .map(|note| format!("{what}: {note}"))
        .collect();
    let hot = per_channel(&mut merged.report.channels.iter().map(|c| c.hot.to_string()));
    lines.push(format!("{what}: hot pixels masked: {hot}"));
    if merged.report.channels.iter().any(|c| c.dead > 0) {
        let counts = &mut merged.report.channels.iter().map(|c| c.dead.to_string());
        lines.push(format!(
            "{what}: dead pixels masked, which see nothing amid light: {}",
            per_channel(counts)
        ));
    }
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

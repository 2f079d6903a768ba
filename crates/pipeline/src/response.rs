//! The response of a camera that gives 8 bits: recovered from the frames before they are merged.

use crate::capture::{Loaded, Subject, by_exposure};
use crate::error::{Blame, Error, Kind, Result};
use crate::monitor::Monitor;
use formats::Depth;
use formats::capture::{FrameEntry, Response};
use hdr::response::{Linear, recover};
use physics::{Frame, Samples, Sensor};
use std::borrow::Cow;
use std::collections::BTreeSet;

/// Samples of every frame and channel that show the curve.
const PER_FRAME: usize = 400;

/// Codes among which they are chosen: where a frame says most.
const CHOSEN: std::ops::RangeInclusive<u16> = 30..=225;

/// The recovered curve of every channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Curves {
    /// In the order of the camera.
    pub channels: Vec<Linear>,
    /// Pixels that they were found from, all channels together.
    pub pixels: usize,
}

impl Loaded {
    /// The same with the response of its camera, where the manifest wants it recovered.
    ///
    /// # Errors
    ///
    /// A frame cannot be read or has not 8 bits, or the frames do not show a curve.
    pub fn with_response(&self, monitor: &dyn Monitor) -> Result<Cow<'_, Self>> {
        if self.capture.camera.response != Some(Response::Recover) || self.curves.is_some() {
            return Ok(Cow::Borrowed(self));
        }
        let curves = self.curves(monitor)?;
        Ok(Cow::Owned(Self {
            curves: Some(curves),
            ..self.clone()
        }))
    }

    /// The curves that the frames of the sample show, and those of the white where it was exposed
    /// alike.
    fn curves(&self, monitor: &dyn Monitor) -> Result<Curves> {
        let place = || format!("{}: field `camera.response`", self.input.path.display());
        let times = |subject| -> Vec<f64> {
            let entries = by_exposure(self.entries(subject).0);
            entries.iter().map(|entry| entry.exposure_s).collect()
        };
        let exposures_s = times(Subject::Sample);
        let mut subjects = vec![Subject::Sample];
        if times(Subject::Reference) == exposures_s {
            subjects.push(Subject::Reference);
        }
        let steps = 2 * subjects.len() * exposures_s.len();
        monitor.begin("recovering the response", steps as u64);
        let mut codes: Vec<Vec<u8>> = vec![];
        for subject in subjects {
            let entries = by_exposure(self.entries(subject).0);
            let mut chosen: Vec<BTreeSet<usize>> = vec![];
            for entry in &entries {
                monitor.check()?;
                let frame = self.codes(entry)?;
                chosen.resize(frame.channels.max(chosen.len()), BTreeSet::new());
                for (channel, chosen) in chosen.iter_mut().enumerate().take(frame.channels) {
                    chosen.extend(clear(&frame, channel));
                }
                monitor.step();
            }
            let chosen: Vec<Vec<usize>> = (chosen.into_iter())
                .map(|places| places.into_iter().collect())
                .collect();
            codes.resize(chosen.len().max(codes.len()), vec![]);
            let from: Vec<usize> = codes.iter().map(Vec::len).collect();
            for (codes, places) in codes.iter_mut().zip(&chosen) {
                codes.resize(codes.len() + places.len() * entries.len(), 0);
            }
            for (number, entry) in entries.iter().enumerate() {
                monitor.check()?;
                let frame = self.codes(entry)?;
                for ((codes, places), from) in codes.iter_mut().zip(&chosen).zip(&from) {
                    for (pixel, at) in places.iter().enumerate() {
                        let code = sample(&frame, *at);
                        codes[from + pixel * entries.len() + number] = code.min(255) as u8;
                    }
                }
                monitor.step();
            }
        }
        let count = exposures_s.len().max(1);
        let pixels = codes.iter().map(|codes| codes.len() / count).sum();
        let curve = |codes: &Vec<u8>| {
            let response = recover(codes, &exposures_s).input(place())?;
            Ok(response.linear(codes, &exposures_s))
        };
        let channels = codes.iter().map(curve).collect::<Result<Vec<_>>>()?;
        Ok(Curves { channels, pixels })
    }

    /// The codes of a frame as its file holds them.
    fn codes(&self, entry: &FrameEntry) -> Result<Frame> {
        let decoded = self.decoded(entry)?;
        let place = self.place(&entry.file);
        check(&decoded).map_err(|e| e.within(place))?;
        Ok(decoded.frame)
    }
}

/// Refuses what has no curve of 8 bits.
pub(crate) fn check(decoded: &formats::Decoded) -> Result<()> {
    let found = match (decoded.depth, decoded.mosaic) {
        (Depth::Bits(..=8), None) => return Ok(()),
        (depth, None) => format!("{depth} samples"),
        (_, Some(mosaic)) => format!("the mosaic {mosaic}"),
    };
    let message = format!(
        "found {found}, and camera.response = \"recover\": a curve is recovered of codes of 8 bits, \
         gray or RGB; leave camera.response out for counts in proportion to light"
    );
    Err(Error::new(Kind::Input, message))
}

fn sample(frame: &Frame, at: usize) -> u16 {
    match &frame.samples {
        Samples::U16(samples) => samples.get(at).copied().unwrap_or(0),
        Samples::F32(_) => 0,
    }
}

/// Samples of a channel at codes that say most, evenly from all over the frame.
fn clear(frame: &Frame, channel: usize) -> Vec<usize> {
    let places = || {
        (channel..frame.samples.len())
            .step_by(frame.channels)
            .filter(|at| CHOSEN.contains(&sample(frame, *at)))
    };
    let count = places().count();
    let step = count.div_ceil(PER_FRAME).max(1);
    places().step_by(step).collect()
}

impl Curves {
    /// `frame`, of codes, in counts.
    ///
    /// # Errors
    ///
    /// It has other channels than the frames that showed the curves.
    pub(crate) fn applied(&self, frame: &Frame) -> Result<Frame> {
        if self.channels.len() != frame.channels {
            let message = format!(
                "found {} channels, and {} in the frames that the response was recovered from: \
                 expected one camera for all frames",
                frame.channels,
                self.channels.len()
            );
            return Err(Error::new(Kind::Input, message));
        }
        let mut counts = vec![0.0; frame.samples.len()];
        for (channel, curve) in self.channels.iter().enumerate() {
            for at in (channel..counts.len()).step_by(frame.channels) {
                let code = usize::from(sample(frame, at)).min(255);
                counts[at] = curve.counts[code];
            }
        }
        Ok(Frame {
            samples: Samples::F32(counts),
            ..*frame
        })
    }

    /// The sensor that gives such counts: the noisiest of the channels.
    pub(crate) fn sensor(&self, prnu_relative: f64) -> Sensor {
        let noisiest = (self.channels.iter().map(|curve| curve.sensor))
            .min_by(|a, b| a.gain_e_per_dn.total_cmp(&b.gain_e_per_dn));
        Sensor {
            prnu_relative,
            ..noisiest.expect("a curve has a channel")
        }
    }

    /// What was found, in a sentence.
    pub(crate) fn line(&self) -> String {
        let most = |of: fn(&Linear) -> f64| self.channels.iter().map(of).fold(0.0, f64::max);
        format!(
            "the response of the camera was recovered from {} pixels of its 8-bit frames (Debevec and \
             Malik 1997): known to {:.1} %, a sample of the middle code to {:.1} %",
            self.pixels,
            100.0 * most(|curve| curve.u_relative),
            100.0 * most(|curve| curve.scatter)
        )
    }

    /// What it costs, in a sentence.
    pub(crate) fn warning() -> String {
        "frames of 8 bits cost accuracy that no curve brings back: their rounding and the recovered \
         curve are in u, where a linear file of 12 bits or more has neither; photograph RAW or \
         16-bit linear frames if the camera has them"
            .to_owned()
    }
}

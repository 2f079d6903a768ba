//! What the frames of one set share: depth, camera, and that each is a picture of its own.

use crate::error::{Error, Kind, Result};
use formats::capture::FrameEntry;
use formats::metadata::{Metadata, TimeUnit};
use formats::{Decoded, Depth};
use physics::{Mosaic, Samples};
use std::collections::BTreeMap;

/// The largest count of 14 bits, the most that is looked for in files of 16.
const MOST_PACKED: u16 = 16383;

/// What files tell of the camera and of how it counts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OfCamera {
    /// How the samples are stored.
    pub depth: Option<Depth>,
    /// Maker, model and number.
    pub camera: Option<String>,
    /// Sensitivity, which stands for the gain.
    pub iso: Option<u64>,
}

impl OfCamera {
    /// Whether the other set may be of the same camera at the same gain: what a file does not say
    /// contradicts nothing.
    pub fn agrees(&self, other: &Self) -> bool {
        let differ = |a: bool, b: bool, same: bool| a && b && !same;
        self.depth == other.depth
            && !differ(
                self.camera.is_some(),
                other.camera.is_some(),
                self.camera == other.camera,
            )
            && !differ(
                self.iso.is_some(),
                other.iso.is_some(),
                self.iso == other.iso,
            )
    }
}

/// Watches the frames of a set as they are read.
#[derive(Debug, Default)]
pub(crate) struct Consistency {
    first: Option<(String, Depth)>,
    /// The pattern of the first frame, and its size.
    mosaic: Option<Mosaic>,
    size: (usize, usize),
    /// Where the first frame begins in the whole of which it says it is a part.
    origin: [i32; 2],
    /// The largest step between counts that can be stored beside each other, DN.
    step_dn: u16,
    /// The camera that a file names, and that file.
    camera: Option<(String, String)>,
    /// The sensitivity that a file names, and that file.
    iso: Option<(String, u64)>,
    /// Files by the hash of their bytes.
    seen: BTreeMap<String, String>,
    /// Every bit that was set in some sample, and the largest sample.
    bits: u16,
    largest: u16,
    /// The least white level that a file states, DN.
    white_level_dn: Option<f64>,
    notes: Vec<String>,
}

impl Consistency {
    /// Takes note of a frame, whose bytes have the hash `hash`.
    ///
    /// # Errors
    ///
    /// It is of another depth or camera than those before, or a copy of one of them.
    pub(crate) fn see(
        &mut self,
        entry: &FrameEntry,
        hash: &str,
        decoded: &Decoded,
        metadata: &Metadata,
        fits_unit: Option<TimeUnit>,
    ) -> Result<()> {
        let FrameEntry { file, exposure_s } = entry;
        let refuse = |message| Err(Error::new(Kind::Input, message));
        if let Some(before) = self.seen.insert(hash.to_owned(), file.clone()) {
            return refuse(format!(
                "{file}: holds the very bytes of {before}: a copy counts one exposure twice; give \
                 the frame that belongs here, or leave it out"
            ));
        }
        let depth = decoded.depth;
        match &self.first {
            Some((before, expected)) if *expected != depth => {
                return refuse(format!(
                    "{file}: has {depth} samples, and {before} has {expected} ones: expected the \
                     same counts in all frames, so save all alike"
                ));
            }
            Some((before, _)) if self.mosaic != decoded.mosaic => {
                let told = |mosaic: Option<Mosaic>| {
                    mosaic.map_or("no mosaic".to_owned(), |m| format!("the mosaic {m}"))
                };
                return refuse(format!(
                    "{file}: is {}, and {before} is {}: expected one camera for all frames, read \
                     out in one way",
                    told(decoded.mosaic),
                    told(self.mosaic)
                ));
            }
            Some((before, _)) if self.origin != decoded.origin => {
                let told = |[column, row]: [i32; 2]| format!("{column}, {row}");
                return refuse(format!(
                    "{file}: its data window begins at column and row {} of the display window, and \
                     that of {before} at {}: the same pixel is not the same place in both; save all \
                     frames with one data window",
                    told(decoded.origin),
                    told(self.origin)
                ));
            }
            Some(_) => {}
            None => {
                self.first = Some((file.clone(), depth));
                self.mosaic = decoded.mosaic;
                self.origin = decoded.origin;
                self.size = (decoded.frame.width, decoded.frame.height);
            }
        }
        if let Some(camera) = &metadata.camera {
            match &self.camera {
                Some((before, expected)) if expected != camera => {
                    return refuse(format!(
                        "{file}: was taken with `{camera}`, and {before} with `{expected}`: \
                         expected one camera for all frames"
                    ));
                }
                Some(_) => {}
                None => self.camera = Some((file.clone(), camera.clone())),
            }
        }
        if let Some(iso) = metadata.iso {
            match &self.iso {
                Some((before, expected)) if *expected != iso => {
                    return refuse(format!(
                        "{file}: was taken at ISO {iso}, and {before} at ISO {expected}: expected \
                         one gain for all frames"
                    ));
                }
                Some(_) => {}
                None => self.iso = Some((file.clone(), iso)),
            }
        }
        // The name was asked only where the file says nothing, and what cannot be read
        // contradicts nothing.
        let name = file.rsplit('/').next().unwrap_or(file);
        if let Ok(Some(found)) = metadata.exposure(name, fits_unit)
            && found.contradicts(*exposure_s)
        {
            self.notes.push(format!(
                "{file}: the manifest says {exposure_s} s and the {} {} s ({}): the manifest was \
                 believed",
                found.source, found.seconds, found.field
            ));
        }
        self.step_dn = self.step_dn.max(decoded.step_dn);
        if let Some(white) = decoded.white_level_dn {
            self.white_level_dn = Some(self.white_level_dn.map_or(white, |least| least.min(white)));
        }
        // A count that is odd and one beyond 14 bits leave nothing more to say.
        if let Samples::U16(samples) = &decoded.frame.samples
            && (self.bits & 1 == 0 || self.largest <= MOST_PACKED)
        {
            for sample in samples.iter() {
                self.bits |= sample;
                self.largest = self.largest.max(*sample);
            }
        }
        Ok(())
    }

    /// What one set has to have in common with another.
    pub(crate) fn of_camera(&self) -> OfCamera {
        OfCamera {
            depth: self.first.as_ref().map(|(_, depth)| *depth),
            camera: self.camera.as_ref().map(|(_, camera)| camera.clone()),
            iso: self.iso.as_ref().map(|(_, iso)| *iso),
        }
    }

    /// The least count at and above which a file says that samples are saturated.
    pub(crate) fn white_level_dn(&self) -> Option<f64> {
        self.white_level_dn
    }

    /// The pattern that all frames share.
    pub(crate) fn mosaic(&self) -> Option<Mosaic> {
        self.mosaic
    }

    /// What is to be said of the set, in sentences.
    pub(crate) fn notes(self, frames: &[FrameEntry], white_level_dn: f64) -> Vec<String> {
        let mut notes = self.notes;
        if let Some(mosaic) = self.mosaic {
            notes.push(format!(
                "mosaic {mosaic}: each channel has its own photosites, nothing was interpolated"
            ));
            let (width, height) = self.size;
            let whole = mosaic.whole(width, height);
            if whole != self.size {
                notes.push(format!(
                    "{width} x {height} px are no whole number of cells: {} x {} were used",
                    whole.0, whole.1
                ));
            }
        }
        let mut repeated: Vec<(f64, usize)> = vec![];
        for frame in frames {
            match repeated.iter_mut().find(|(s, _)| *s == frame.exposure_s) {
                Some((_, count)) => *count += 1,
                None => repeated.push((frame.exposure_s, 1)),
            }
        }
        for (exposure_s, count) in repeated.into_iter().filter(|(_, count)| *count > 1) {
            notes.push(format!("{count} frames of {exposure_s} s: all were used"));
        }
        if self.step_dn > 1 {
            notes.push(format!(
                "the files store counts by a table with steps of up to {} DN: that rounding is not in \
                 u; photograph without compression",
                self.step_dn
            ));
        }
        if matches!(self.first, Some((_, Depth::Half))) {
            notes.push(
                "the samples are floating-point numbers of 16 bits, which round counts beyond 2048 to \
                 11 bits: that rounding is in u; 32 bits, or whole numbers, would not have it"
                    .to_owned(),
            );
        }
        if matches!(self.first, Some((_, Depth::Bits(9..)))) && self.largest > 0 {
            let idle = self.bits.trailing_zeros();
            if idle > 0 {
                notes.push(format!(
                    "every count is a multiple of {}: {}-bit data in the high bits of 16",
                    1 << idle,
                    16 - idle
                ));
            }
            // A longest exposure that stops at the end of 10, 12 or 14 bits is saturated there.
            let full = f64::from(self.largest) + 1.0;
            if matches!(self.largest, 1023 | 4095 | MOST_PACKED) && white_level_dn >= full {
                notes.push(format!(
                    "the largest count is {}, the end of {} bits, and camera.white_level_dn = \
                     {white_level_dn}: saturated samples may have been taken for measured ones",
                    self.largest,
                    full.log2()
                ));
            }
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::Frame;

    fn decoded(bits: u16) -> Decoded {
        let frame = Frame {
            width: 2,
            height: 1,
            channels: 1,
            samples: vec![1_u16, 2].into(),
        };
        Decoded::plain(frame, Depth::Bits(bits))
    }

    fn of(camera: &str, iso: u64) -> Metadata {
        Metadata {
            camera: Some(camera.to_owned()),
            iso: Some(iso),
            ..Metadata::default()
        }
    }

    #[test]
    fn what_does_not_belong_together_is_named_with_both_files() {
        let entry = |file: &str| FrameEntry {
            file: file.to_owned(),
            exposure_s: 0.1,
        };
        for (hash, bits, metadata, words) in [
            (
                "b",
                16,
                of("Maker Two", 100),
                "`Maker Two`, and a.tif with `Maker One`",
            ),
            (
                "b",
                16,
                of("Maker One", 200),
                "ISO 200, and a.tif at ISO 100",
            ),
            (
                "b",
                8,
                of("Maker One", 100),
                "8-bit samples, and a.tif has 16-bit",
            ),
            ("a", 16, of("Maker One", 100), "the very bytes of a.tif"),
        ] {
            let mut seen = Consistency::default();
            let first = of("Maker One", 100);
            seen.see(&entry("a.tif"), "a", &decoded(16), &first, None)
                .unwrap();
            let refused = seen.see(&entry("b.tif"), hash, &decoded(bits), &metadata, None);
            let said = refused.unwrap_err().to_string();
            assert!(said.contains("b.tif") && said.contains(words), "{said}");
        }
        // A file that says nothing of its camera contradicts nothing.
        let mut seen = Consistency::default();
        let (first, silent) = (of("Maker One", 100), Metadata::default());
        seen.see(&entry("a.tif"), "a", &decoded(16), &first, None)
            .unwrap();
        seen.see(&entry("b.tif"), "b", &decoded(16), &silent, None)
            .unwrap();
    }

    #[test]
    fn windows_that_differ_and_tables_are_named() {
        let entry = |file: &str| FrameEntry {
            file: file.to_owned(),
            exposure_s: 0.1,
        };
        let at = |origin| Decoded {
            origin,
            step_dn: 7,
            ..decoded(16)
        };
        let mut seen = Consistency::default();
        let silent = Metadata::default();
        for (file, origin, fine) in [
            ("a.exr", [8, 4], true),
            ("b.exr", [8, 4], true),
            ("c.exr", [8, 5], false),
        ] {
            let found = seen.see(&entry(file), file, &at(origin), &silent, None);
            assert_eq!(found.is_ok(), fine, "{file}");
            if let Err(error) = found {
                let said = error.to_string();
                let words = "c.exr: its data window begins at column and row 8, 5";
                assert!(
                    said.contains(words) && said.contains("a.exr at 8, 4"),
                    "{said}"
                );
            }
        }
        let notes = seen.notes(&[], 65_535.0).join("\n");
        assert!(notes.contains("steps of up to 7 DN"), "{notes}");
    }

    #[test]
    fn two_sets_agree_where_neither_says_otherwise() {
        let set = |camera: Option<&str>, iso| OfCamera {
            depth: Some(Depth::Bits(16)),
            camera: camera.map(str::to_owned),
            iso,
        };
        let sample = set(Some("Maker One"), Some(100));
        assert!(sample.agrees(&set(Some("Maker One"), Some(100))));
        assert!(sample.agrees(&set(None, None)) && set(None, None).agrees(&sample));
        assert!(!sample.agrees(&set(Some("Maker Two"), Some(100))));
        // The same scene at another gain is brighter, and no exposure time says so.
        assert!(!sample.agrees(&set(Some("Maker One"), Some(400))));
        let halves = OfCamera {
            depth: Some(Depth::Half),
            ..sample.clone()
        };
        assert!(!sample.agrees(&halves));
    }
}

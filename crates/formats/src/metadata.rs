//! What a frame says of itself: exposure time and camera.
//!
//! Metadata that is damaged counts as absent: the pixels decide whether a file can be used. An
//! exposure time without a unit is reported as such and never guessed.

mod camera_raw;
mod file_name;
mod part;
pub(crate) mod tags;

pub use file_name::{NamedExposure, exposure_in_name};

use crate::fits_header::Header;
use crate::image::Format;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::io::{Cursor, Read};
use thiserror::Error;

/// Cards of FITS that hold an exposure time, at different observatories.
const FITS_EXPOSURES: [&str; 6] = [
    "EXPTIME", "EXPOSURE", "XPOSURE", "EXP_TIME", "ITIME", "OTIME",
];

/// Half of a third of a stop, the step in which cameras round the times that they write: 1/30 s
/// is 1/32 s.
const EXIF_ROUNDING: f64 = 0.1225;
/// Rounding of a decimal number in any other place.
const ROUNDING: f64 = 0.005;

/// A unit of exposure times.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum TimeUnit {
    /// Microseconds.
    #[serde(rename = "us")]
    Microseconds,
    /// Milliseconds.
    #[serde(rename = "ms")]
    Milliseconds,
    /// Seconds.
    #[serde(rename = "s")]
    Seconds,
    /// Minutes.
    #[serde(rename = "min")]
    Minutes,
}

impl TimeUnit {
    /// How many of it make a second, or for a minute, what share of one.
    fn per_second(self) -> f64 {
        match self {
            Self::Microseconds => 1e6,
            Self::Milliseconds => 1e3,
            Self::Seconds => 1.0,
            Self::Minutes => 1.0 / 60.0,
        }
    }

    /// `value` in seconds; a division, so that 1 ms is the number that 0.001 is.
    pub fn seconds(self, value: f64) -> f64 {
        match self {
            Self::Minutes => value * 60.0,
            other => value / other.per_second(),
        }
    }

    /// The spelling in a manifest.
    pub fn name(self) -> &'static str {
        match self {
            Self::Microseconds => "us",
            Self::Milliseconds => "ms",
            Self::Seconds => "s",
            Self::Minutes => "min",
        }
    }

    /// The unit that a word stands for.
    fn of(word: &str) -> Option<Self> {
        Some(match word.to_lowercase().as_str() {
            "us" | "µs" | "μs" | "usec" | "microsecond" | "microseconds" => Self::Microseconds,
            "ms" | "msec" | "msecs" | "millisecond" | "milliseconds" => Self::Milliseconds,
            "s" | "sec" | "secs" | "second" | "seconds" => Self::Seconds,
            "min" | "mins" | "minute" | "minutes" => Self::Minutes,
            _ => return None,
        })
    }
}

/// Where an exposure time was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Source {
    /// EXIF, in its own directory or in the first one of a TIFF.
    Exif,
    /// A card of a FITS header.
    Fits,
    /// The `expTime` of OpenEXR.
    Exr,
    /// OME-XML in a TIFF.
    Ome,
    /// Micro-Manager's JSON in a TIFF.
    MicroManager,
    /// The name of the file.
    FileName,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Exif => "EXIF",
            Self::Fits => "FITS header",
            Self::Exr => "OpenEXR header",
            Self::Ome => "OME-XML",
            Self::MicroManager => "Micro-Manager metadata",
            Self::FileName => "file name",
        })
    }
}

/// An exposure time as a file states it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stated {
    /// Where.
    pub source: Source,
    /// Its name there, as in `EXPTIME`.
    pub field: String,
    /// The number.
    pub value: f64,
    /// Its unit, where it is stated or fixed by the format.
    pub unit: Option<TimeUnit>,
}

/// An exposure time in seconds, and where it is from.
#[derive(Clone, Debug, PartialEq)]
pub struct Exposure {
    /// The time, s.
    pub seconds: f64,
    /// Where it was found.
    pub source: Source,
    /// Its name there.
    pub field: String,
}

impl Exposure {
    /// Whether a manifest that says `seconds` contradicts it, beyond the rounding of its source.
    pub fn contradicts(&self, seconds: f64) -> bool {
        let tolerance = match self.source {
            Source::Exif => EXIF_ROUNDING,
            _ => ROUNDING,
        };
        (self.seconds / seconds).ln().abs() > (1.0 + tolerance).ln()
    }
}

/// Why an exposure time that is there cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ExposureError {
    /// A number without a unit.
    #[error(
        "the {source_name} gives {field} = {value} and no unit (seconds, milliseconds and minutes \
         all occur): write exposure_s in the manifest, or state the unit under [camera], as in \
         `fits_exposure_unit = \"s\"`"
    )]
    NoUnit {
        /// Where it was found.
        source_name: Source,
        /// Its name there.
        field: String,
        /// The number.
        value: f64,
    },
    /// Two times in one file.
    #[error(
        "{} gives {first_s} s and {} gives {second_s} s: write exposure_s in the manifest",
        names.0, names.1
    )]
    Contradiction {
        /// The two fields.
        names: (String, String),
        /// The first time, s.
        first_s: f64,
        /// The second time, s.
        second_s: f64,
    },
    /// A file name that can be read in two ways.
    #[error("the file name can be read as {0} s or {1} s: write exposure_s in the manifest")]
    AmbiguousName(f64, f64),
}

/// What a frame says of itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    /// Every exposure time, the most trusted first.
    pub exposures: Vec<Stated>,
    /// Maker, model and serial number of the camera.
    pub camera: Option<String>,
    /// Sensitivity as EXIF has it, which stands for the gain.
    pub iso: Option<u64>,
}

impl Metadata {
    /// What the file `bytes` says.
    pub fn read(bytes: &[u8]) -> Self {
        match Format::of(bytes) {
            Some(Format::Tiff) => tags::read(bytes),
            Some(Format::Png) => png_chunk(bytes, *b"eXIf").map_or_else(Self::default, tags::read),
            Some(Format::Fits) => Header::read(bytes).map_or_else(Self::default, |h| fits(&h)),
            Some(Format::Exr) => exr(Cursor::new(bytes)),
            Some(Format::Pnm) => Self::default(),
            None => camera_raw::read(bytes),
        }
    }

    /// The exposure time that the file or else its `name` states; `fits_unit` is the unit of a
    /// FITS card that has none of its own.
    ///
    /// # Errors
    ///
    /// [`ExposureError`]: no unit, or two times that differ.
    pub fn exposure(
        &self,
        name: &str,
        fits_unit: Option<TimeUnit>,
    ) -> Result<Option<Exposure>, ExposureError> {
        let mut found: Option<Exposure> = None;
        for stated in &self.exposures {
            // A second number without a unit adds nothing where the first one has one.
            let Some(unit) = stated.unit.or(fits_unit) else {
                if found.is_some() {
                    continue;
                }
                return Err(ExposureError::NoUnit {
                    source_name: stated.source,
                    field: stated.field.clone(),
                    value: stated.value,
                });
            };
            let seconds = unit.seconds(stated.value);
            match &found {
                Some(first) if first.contradicts(seconds) => {
                    return Err(ExposureError::Contradiction {
                        names: (first.field.clone(), stated.field.clone()),
                        first_s: first.seconds,
                        second_s: seconds,
                    });
                }
                Some(_) => {}
                None => {
                    found = Some(Exposure {
                        seconds,
                        source: stated.source,
                        field: stated.field.clone(),
                    });
                }
            }
        }
        if found.is_some() {
            return Ok(found);
        }
        match exposure_in_name(name) {
            NamedExposure::None => Ok(None),
            NamedExposure::Seconds(seconds) => Ok(Some(Exposure {
                seconds,
                source: Source::FileName,
                field: name.to_owned(),
            })),
            NamedExposure::Ambiguous(a, b) => Err(ExposureError::AmbiguousName(a, b)),
        }
    }
}

/// The chunks of a PNG, each with its name and its body, and what stands behind it.
fn png_chunks(bytes: &[u8]) -> impl Iterator<Item = ([u8; 4], &[u8], &[u8])> {
    let mut rest = bytes.get(8..).unwrap_or_default();
    std::iter::from_fn(move || {
        let (length, behind) = rest.split_first_chunk::<4>()?;
        let (kind, behind) = behind.split_first_chunk::<4>()?;
        let length = u32::from_be_bytes(*length) as usize;
        let body = behind.get(..length)?;
        // Four bytes of checksum follow.
        rest = behind.get(length.checked_add(4)?..).unwrap_or_default();
        Some((*kind, body, rest))
    })
}

/// The first chunk of a PNG that is called `name`.
pub(crate) fn png_chunk(bytes: &[u8], name: [u8; 4]) -> Option<&[u8]> {
    let mut chunks = png_chunks(bytes);
    chunks
        .find(|(kind, ..)| *kind == name)
        .map(|(_, body, _)| body)
}

/// What follows the last chunk of a PNG.
pub(crate) fn behind_png(bytes: &[u8]) -> &[u8] {
    let mut chunks = png_chunks(bytes);
    let last = chunks.find(|(kind, ..)| kind == b"IEND");
    last.map_or(&[], |(.., behind)| behind)
}

fn fits(header: &Header<'_>) -> Metadata {
    let exposures = FITS_EXPOSURES.into_iter().filter_map(|field| {
        let card = header.card(field)?;
        let value = card.number().filter(|value| *value > 0.0)?;
        let words = card.comment.split(|c: char| !c.is_alphanumeric());
        let mut units = words.filter_map(TimeUnit::of);
        let first = units.next();
        let stated = first.filter(|first| units.all(|unit| unit == *first));
        // XPOSURE alone is in the standard (4.0, section 9.5), which fixes its unit.
        let standard = (field == "XPOSURE").then(|| {
            let unit = header.value("TIMEUNIT");
            unit.map_or(Some(TimeUnit::Seconds), TimeUnit::of)
        });
        Some(Stated {
            source: Source::Fits,
            field: field.to_owned(),
            value,
            unit: stated.or(standard.flatten()),
        })
    });
    Metadata {
        exposures: exposures.collect(),
        camera: camera(["INSTRUME", "CAMERA", "DETECTOR"].map(|key| header.value(key))),
        iso: None,
    }
}

fn exr(source: impl Read) -> Metadata {
    let meta = exr::meta::MetaData::read_from_buffered(source, false);
    let header = meta.ok().and_then(|meta| meta.headers.into_iter().next());
    let seconds = header.and_then(|header| header.own_attributes.exposure);
    let exposures = seconds
        .filter(|s| *s > 0.0 && s.is_finite())
        .map(|value| Stated {
            source: Source::Exr,
            field: "expTime".to_owned(),
            // 0.001 rather than 0.0010000000474974513.
            value: value.to_string().parse().unwrap_or(value.into()),
            unit: Some(TimeUnit::Seconds),
        });
    Metadata {
        exposures: exposures.into_iter().collect(),
        ..Metadata::default()
    }
}

/// The parts of a camera's name that there are.
fn camera<'a>(parts: impl IntoIterator<Item = Option<&'a str>>) -> Option<String> {
    let parts: Vec<&str> = parts
        .into_iter()
        .flatten()
        .map(str::trim)
        .filter(|part| !part.is_empty())
        .collect();
    (!parts.is_empty()).then(|| parts.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    const M6707: &[u8] = include_bytes!("../../../fixtures/frames/M6707HH.fits");
    const M51: &[u8] = include_bytes!("../../../fixtures/frames/M51.fits");
    const PNG: &[u8] = include_bytes!("../../../fixtures/frames/exif.png");

    fn fits(cards: &[&str]) -> Metadata {
        let mut text = format!("{:80}", "SIMPLE  =                    T");
        for card in cards.iter().chain(&["END"]) {
            text += &format!("{card:80}");
        }
        Metadata::read(text.as_bytes())
    }

    #[test]
    fn real_observatories_state_their_units_in_comments() {
        for (bytes, seconds, field) in [(M6707, 3000.0, "EXPOSURE"), (M51, 600.0, "ITIME")] {
            let found = Metadata::read(bytes).exposure("", None).unwrap().unwrap();
            assert_eq!((found.seconds, found.field.as_str()), (seconds, field));
        }
    }

    #[test]
    fn a_number_without_a_unit_is_not_guessed() {
        let bare = fits(&["EXPTIME =  2.5 / how long the shutter was open"]);
        let error = bare.exposure("frame_1s.fits", None).unwrap_err();
        assert!(
            error.to_string().contains("EXPTIME = 2.5 and no unit"),
            "{error}"
        );
        for (unit, seconds) in [
            (TimeUnit::Minutes, 150.0),
            (TimeUnit::Milliseconds, 0.0025),
            (TimeUnit::Seconds, 2.5),
        ] {
            let found = bare.exposure("x", Some(unit)).unwrap().unwrap();
            assert_eq!(found.seconds, seconds);
        }
        let standard = fits(&["XPOSURE = 2.5"])
            .exposure("x", None)
            .unwrap()
            .unwrap();
        assert_eq!(standard.seconds, 2.5);
        let days = fits(&["XPOSURE = 2.5", "TIMEUNIT= 'd'"]);
        assert!(days.exposure("x", None).is_err());
    }

    #[test]
    fn two_times_in_one_header_are_named() {
        let both = fits(&["EXPTIME = 2.0 / [s]", "EXPOSURE= 2000 / ms"]);
        assert_eq!(both.exposure("x", None).unwrap().unwrap().seconds, 2.0);
        let error = fits(&["EXPTIME = 2.0 / [s]", "EXPOSURE= 30 / s"])
            .exposure("x", None)
            .unwrap_err()
            .to_string();
        assert!(
            error.starts_with("EXPTIME gives 2 s and EXPOSURE gives 30 s"),
            "{error}"
        );
    }

    #[test]
    fn exif_may_be_rounded_by_half_a_third_of_a_stop() {
        let exif = Exposure {
            seconds: 1.0 / 30.0,
            source: Source::Exif,
            field: "ExposureTime".to_owned(),
        };
        assert!(!exif.contradicts(1.0 / 32.0));
        assert!(!exif.contradicts(1.0 / 27.0));
        assert!(exif.contradicts(1.0 / 40.0));
        let exact = Exposure {
            source: Source::Fits,
            ..exif
        };
        assert!(exact.contradicts(1.0 / 32.0));
    }

    #[test]
    fn exif_of_camera_raw_is_found() {
        let cr3 = include_bytes!("../../../fixtures/frames/raw/canon-r6.cr3");
        let raf = include_bytes!("../../../fixtures/frames/raw/fujifilm_x_t1_01.raf.meta");
        for (bytes, seconds, camera) in [
            (&cr3[..], 0.01, "Canon EOS R6"),
            (&raf[..], 0.4, "FUJIFILM X-T1"),
        ] {
            let metadata = Metadata::read(bytes);
            let found = metadata.exposure("", None).unwrap().unwrap();
            assert_eq!((found.source, found.seconds), (Source::Exif, seconds));
            assert!(matches!(metadata.iso, Some(25_600 | 200)));
            let named = metadata.camera.unwrap();
            assert!(named.contains(camera), "{named}");
            // Whatever is cut off, or twisted, counts as absent.
            for end in (0..bytes.len().min(4000)).chain([bytes.len() / 2]) {
                let _ = Metadata::read(&bytes[..end]);
                let mut damaged = bytes.to_vec();
                damaged[end] ^= 0xff;
                let _ = Metadata::read(&damaged[..bytes.len().min(6000)]);
            }
        }
    }

    #[test]
    fn exif_of_a_png_is_found() {
        let found = Metadata::read(PNG).exposure("", None).unwrap().unwrap();
        assert_eq!(
            (found.source, found.field.as_str()),
            (Source::Exif, "ExposureTime")
        );
    }
}

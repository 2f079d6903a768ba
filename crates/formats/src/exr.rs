//! `radiance.exr`: a [`RadianceMap`] with what must travel with it.
//!
//! One part, scan lines, uncompressed 32-bit floats: per channel a layer of its name and one of
//! its name with `.variance`. What is not pixels stands in attributes that begin with
//! `beamspot.`; [`RadianceFile`] says which.

mod read;
mod write;

pub use read::read_radiance;
pub use write::write_radiance;

use physics::RadianceMap;
use std::borrow::Cow;
use std::collections::BTreeMap;
use thiserror::Error;

/// Attribute with the unit of the values: `DN/s`, or `mm^-2` once a reference has set the scale.
const UNIT: &str = "beamspot.unit";
/// Attribute with the names of the channels in the order of the camera.
const CHANNELS: &str = "beamspot.channels";
/// Attribute with the pattern of a mosaic, row by row, as in `RGGB`: the file then has one layer
/// `mosaic` with its `.variance`, and its channels are R, G and B.
const MOSAIC: &str = "beamspot.mosaic";
/// Attribute with the nine numbers that map pixels to the surface, row by row, in text, where a
/// pixel is not the same square everywhere.
const VIEW: &str = "beamspot.view_mm";
/// Attribute with the length that a pixel sees, mm.
const MM_PER_PIXEL: &str = "beamspot.mm_per_pixel";
/// Followed by a channel's name: attribute with the uncertainty of its scale.
const U_SCALE: &str = "beamspot.u_scale_relative.";
const U_OFFSET: &str = "beamspot.u_offset_per_mm2.";
/// Followed by a key: attribute with a note on where the picture comes from.
const PROVENANCE: &str = "beamspot.provenance.";
/// Ending of the name of a variance layer.
const VARIANCE: &str = ".variance";

const COUNTS_PER_SECOND: &str = "DN/s";
const PER_SQUARE_MILLIMETRE: &str = "mm^-2";

/// The scale that a white reference gave to one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelScale {
    /// Name of the channel.
    pub channel: String,
    /// Relative standard uncertainty of the scale, which every pixel of the channel shares.
    pub u_scale_relative: f64,
    /// Standard uncertainty of an even light that every pixel has or lacks, mm⁻².
    pub u_offset_per_mm2: f64,
}

/// A merged picture and what must travel with it.
#[derive(Clone, Debug, PartialEq)]
pub struct RadianceFile<'a> {
    /// The picture; a writer borrows it, since there may not be room for two.
    pub map: Cow<'a, RadianceMap>,
    /// Length on the sample that a pixel sees, mm, where it is known (`beamspot.mm_per_pixel`).
    pub mm_per_pixel: Option<f64>,
    /// Where no such length is the same everywhere: the projective map from pixels to mm on the
    /// surface, row by row (`beamspot.view_mm`).
    pub view_mm: Option<[f64; 9]>,
    /// One scale for each channel, in the same order: values are in mm⁻². Empty: they are in
    /// DN/s, no reference applied.
    pub scale: Vec<ChannelScale>,
    /// Where the picture comes from, by key (`beamspot.provenance.KEY`).
    pub provenance: BTreeMap<String, String>,
}

/// A radiance file cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExrError {
    /// No EXR, a damaged one, or one that cannot be written.
    #[error("EXR: {0}")]
    Exr(#[from] ::exr::error::Error),
    /// Reading or writing failed.
    #[error("the radiance map cannot be read or written: {0}")]
    Io(#[from] std::io::Error),
    /// Several parts, deep data or subsampled layers.
    #[error(
        "the EXR file is {0}; expected one part of flat scan lines or tiles, as `beamspot hdr` writes it"
    )]
    Layout(&'static str),
    /// The header promises more pixels than the bytes can hold.
    #[error(
        "the header promises {width} x {height} pixels, which {bytes} bytes cannot hold: the file is damaged"
    )]
    Oversized {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// Length of the file, bytes.
        bytes: usize,
    },
    /// An attribute that must be there is not, or holds something else.
    #[error(
        "attribute `{name}`: expected {expected}; make the file with `beamspot hdr`, and keep its attributes when you edit it"
    )]
    Attribute {
        /// Name of the attribute.
        name: String,
        /// What it should hold.
        expected: &'static str,
    },
    /// A layer that must be there is not.
    #[error("no 32-bit float layer `{name}`; found {}", found.join(", "))]
    Layer {
        /// Name of the layer.
        name: String,
        /// The layers there are.
        found: Vec<String>,
    },
    /// A value that no merge makes.
    #[error("layer `{layer}`, pixel {column}, {row}: found {found}, expected {expected}")]
    Pixel {
        /// Name of the layer.
        layer: String,
        /// Column, from 0.
        column: usize,
        /// Row, from 0.
        row: usize,
        /// The value.
        found: f32,
        /// What it should be.
        expected: &'static str,
    },
    /// A map that contradicts itself cannot be written.
    #[error("channel `{channel}` cannot be written: {reason}")]
    Unwritable {
        /// Name of the channel, or of the note.
        channel: String,
        /// Why not.
        reason: &'static str,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::{ChannelMap, Mosaic};
    use proptest::prelude::*;

    pub(super) fn sample() -> RadianceFile<'static> {
        let channel = |name: &str, first: f32| ChannelMap {
            name: name.to_owned(),
            value: (0..6).map(|i| first - i as f32 * 0.1).collect(),
            variance: vec![0.0, 1e-12, f32::INFINITY, f32::MIN_POSITIVE, 1.0, f32::MAX],
        };
        let scale = |channel: &str| ChannelScale {
            channel: channel.to_owned(),
            u_scale_relative: 0.1 + 0.2,
            u_offset_per_mm2: 1e-7,
        };
        RadianceFile {
            map: Cow::Owned(RadianceMap {
                width: 3,
                height: 2,
                channels: vec![channel("R", 0.3), channel("G", -1e-9), channel("B", 7.0)],
                mosaic: None,
            }),
            mm_per_pixel: Some(1.0 / 3.0),
            view_mm: Some([0.1, 1e-3, 0.0, -1e-3, 0.2, 1.0 / 3.0, 1e-5, 0.0, 1.0]),
            scale: vec![scale("R"), scale("G"), scale("B")],
            provenance: [
                ("material", "Käse, reif"),
                (
                    "sha256 of a file with a name longer than thirty-one characters",
                    "00ff",
                ),
                ("empty", ""),
            ]
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .into(),
        }
    }

    pub(super) fn bytes(file: &RadianceFile<'_>) -> Vec<u8> {
        let mut out = Vec::new();
        write_radiance(file, &mut out).unwrap();
        out
    }

    pub(super) fn read(bytes: &[u8]) -> Result<RadianceFile<'static>, ExrError> {
        read_radiance(std::io::Cursor::new(bytes))
    }

    #[test]
    fn what_is_written_comes_back() {
        let file = sample();
        assert_eq!(read(&bytes(&file)).unwrap(), file);
        let bare = RadianceFile {
            mm_per_pixel: None,
            view_mm: None,
            scale: Vec::new(),
            provenance: BTreeMap::new(),
            ..file
        };
        assert_eq!(read(&bytes(&bare)).unwrap(), bare);
    }

    #[test]
    fn a_mosaic_is_one_plane_with_its_pattern() {
        let mut file = sample();
        let map = file.map.to_mut();
        map.channels.truncate(1);
        map.channels[0].name = Mosaic::PLANE.to_owned();
        map.mosaic = Some("GBRG".parse().unwrap());
        let whole = bytes(&file);
        assert_eq!(read(&whole).unwrap(), file);
        let at = whole.windows(4).position(|w| w == b"GBRG").unwrap();
        let mut damaged = whole.clone();
        damaged[at] = b'X';
        let error = read(&damaged).unwrap_err().to_string();
        assert!(
            error.contains("`beamspot.mosaic`: expected a pattern"),
            "{error}"
        );
        let again = file.map.channels[0].clone();
        file.map.to_mut().channels.push(again);
        assert!(write_radiance(&file, Vec::new()).is_err());
    }

    #[test]
    fn the_same_map_gives_the_same_bytes() {
        assert_eq!(bytes(&sample()), bytes(&sample()));
    }

    #[test]
    fn a_map_that_contradicts_itself_is_not_written() {
        let fails = |change: fn(&mut RadianceFile<'_>)| {
            let mut file = sample();
            change(&mut file);
            write_radiance(&file, Vec::new()).unwrap_err().to_string()
        };
        assert!(fails(|f| f.map.to_mut().width = 4).contains("channel `R` cannot be written"));
        assert!(fails(|f| f.map.to_mut().channels[1].name = "R".to_owned()).contains("twice"));
        assert!(
            fails(|f| f.map.to_mut().channels[1].name = "R.variance".to_owned())
                .contains(".variance")
        );
        assert!(fails(|f| f.scale.truncate(1)).contains("scale"));
        assert!(fails(|f| f.map.to_mut().channels.clear()).contains("no channel"));
    }

    proptest! {
        #[test]
        fn damage_does_not_panic(
            hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        ) {
            let mut bytes = bytes(&sample());
            for (index, value) in hits {
                let at = index.index(bytes.len());
                bytes[at] = value;
            }
            let _ = read(&bytes);
        }

        #[test]
        fn a_file_cut_short_is_an_error(share in 0.0..1.0_f64) {
            let bytes = bytes(&sample());
            prop_assert!(read(&bytes[..(bytes.len() as f64 * share) as usize]).is_err());
        }
    }
}

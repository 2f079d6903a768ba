//! What a file of a frame holds, camera RAW included where that is built in.

use crate::error::{Blame, Result};
use formats::metadata::Metadata;
use formats::{Decoded, FileWords, ImageError, decode_frame_into, decode_frame_of};
use std::path::Path;

/// Ends of the names of camera RAW that only its own decoder reads.
pub(crate) const RAW: [&str; 6] = ["cr2", "cr3", "nef", "arw", "raf", "orf"];

/// Whether that decoder is built in.
pub(crate) const READS_RAW: bool = cfg!(feature = "raw");

/// The frame in `bytes`, the file at `path`, in the memory of `spare` where that serves, and what
/// it says of itself.
///
/// # Errors
///
/// The bytes are no frame, or those of camera RAW that is not built in or cannot be used.
pub(crate) fn read_frame(
    bytes: &[u8],
    path: &Path,
    spare: Vec<u16>,
) -> Result<(Decoded, Metadata)> {
    let metadata = Metadata::read(bytes);
    let decoded = or_raw(decode_frame_into(bytes, spare), || bytes, path)?;
    Ok((decoded, metadata))
}

/// The same of a file whose memory may become that of the frame; see [`decode_frame_of`].
pub(crate) fn read_frame_of(
    file: &mut FileWords,
    path: &Path,
    spare: &mut Vec<u16>,
) -> Result<(Decoded, Metadata)> {
    let metadata = Metadata::read(file.bytes());
    let decoded = decode_frame_of(file, spare);
    let decoded = or_raw(decoded, || file.bytes(), path)?;
    Ok((decoded, metadata))
}

/// What was `decoded`, or else what the decoder of camera RAW makes of the bytes.
#[cfg_attr(not(feature = "raw"), expect(unused_variables))]
fn or_raw<'a>(
    decoded: std::result::Result<Decoded, ImageError>,
    bytes: impl FnOnce() -> &'a [u8],
    path: &Path,
) -> Result<Decoded> {
    match decoded {
        #[cfg(feature = "raw")]
        Err(ImageError::CameraRaw(_)) => {
            let bytes = bytes();
            let dng = formats::PackedDng::find(bytes);
            let hidden = dng.as_ref().and_then(|dng| dng.without_table(bytes));
            let raw = raw::decode(hidden.as_deref().unwrap_or(bytes)).input(path.display())?;
            let depth = formats::Depth::Bits(raw.bits);
            match dng {
                Some(dng) => {
                    let decoded = dng.counts(raw.frame, depth).input(path.display())?;
                    // The end of a table is not that of the stored numbers.
                    let stated = hidden.is_none().then_some(raw.white_level_dn);
                    Ok(Decoded {
                        white_level_dn: decoded.white_level_dn.or(stated),
                        ..decoded
                    })
                }
                None => Ok(Decoded {
                    mosaic: raw.mosaic,
                    white_level_dn: Some(raw.white_level_dn),
                    ..Decoded::plain(raw.frame, depth)
                }),
            }
        }
        other => other.input(path.display()),
    }
}

#[cfg(feature = "raw")]
#[cfg(test)]
mod tests {
    use super::*;
    use physics::Samples;

    const LOSSLESS: &[u8] = include_bytes!("../../../fixtures/frames/raw/lossless.dng");
    const WHITE_LEVEL: u16 = 50717;
    const LINEARIZATION: u16 = 50712;

    /// The file with a table of twice each number in place of its white level.
    fn with_table() -> Vec<u8> {
        let mut bytes = LOSSLESS.to_vec();
        let first = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
        let count = usize::from(u16::from_le_bytes([bytes[first], bytes[first + 1]]));
        let at = (0..count)
            .map(|k| first + 2 + 12 * k)
            .find(|at| bytes[*at..at + 2] == WHITE_LEVEL.to_le_bytes())
            .unwrap();
        let place = bytes.len() as u32;
        bytes.extend((0..16_384_u16).flat_map(|count| (2 * count).to_le_bytes()));
        bytes[at..at + 2].copy_from_slice(&LINEARIZATION.to_le_bytes());
        bytes[at + 2..at + 4].copy_from_slice(&3_u16.to_le_bytes());
        bytes[at + 4..at + 8].copy_from_slice(&16_384_u32.to_le_bytes());
        bytes[at + 8..at + 12].copy_from_slice(&place.to_le_bytes());
        bytes
    }

    /// The decoder fills the steps of a table with noise.
    #[test]
    fn a_table_is_applied_as_it_stands() {
        let path = Path::new("frame.dng");
        let (plain, _) = read_frame(LOSSLESS, path, vec![]).unwrap();
        assert_eq!(plain.white_level_dn, Some(16_383.0));
        let (found, _) = read_frame(&with_table(), path, vec![]).unwrap();
        let (Samples::U16(plain), Samples::U16(doubled)) =
            (&plain.frame.samples, &found.frame.samples)
        else {
            panic!("counts are whole numbers");
        };
        let expected: Vec<u16> = plain.iter().map(|count| 2 * count).collect();
        assert_eq!(doubled[..], expected[..]);
        assert_eq!(found.mosaic.unwrap().to_string(), "GRBG");
        assert_eq!((found.step_dn, found.white_level_dn), (2, None));
    }
}

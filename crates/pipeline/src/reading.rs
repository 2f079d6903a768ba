//! What a file of a frame holds, camera RAW included where that is built in.

use crate::error::{Blame, Result};
#[cfg(feature = "raw")]
use formats::ImageError;
use formats::metadata::Metadata;
use formats::{Decoded, decode_frame_into};
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
    match decode_frame_into(bytes, spare) {
        #[cfg(feature = "raw")]
        Err(ImageError::CameraRaw(_)) => {
            let raw = raw::decode(bytes).input(path.display())?;
            let decoded = Decoded {
                frame: raw.frame,
                depth: formats::Depth::Bits(raw.bits),
                mosaic: raw.mosaic,
                white_level_dn: Some(raw.white_level_dn),
                curve: false,
            };
            Ok((decoded, Metadata::read(bytes)))
        }
        other => Ok((other.input(path.display())?, Metadata::read(bytes))),
    }
}

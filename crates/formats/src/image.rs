//! Frames: 16-bit gray or RGB TIFF and PNG, counts in proportion to light.
//!
//! A frame is data, not a picture to look at: whatever a decoder would have to guess, convert or
//! leave out is refused with its reason ([`Oddity`]), and no size of a header is trusted with
//! memory before the length of the file has vouched for it.

mod png;
mod tiff;

pub use self::png::encode_png;
pub use self::tiff::encode_tiff;

use physics::Frame;
use thiserror::Error;

/// A frame cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ImageError {
    /// Neither TIFF nor PNG.
    #[error(
        "neither TIFF nor PNG: the file begins with {0:02x?}; expected 16-bit gray or RGB TIFF or \
         PNG, so convert it without changing its counts"
    )]
    UnknownFormat(Vec<u8>),
    /// Samples are not 16 bits wide.
    #[error(
        "found {0} bits per sample, expected 16: counts are wanted linear in 16 bits, so save the \
         frames from the camera as 16-bit gray or RGB"
    )]
    Depth(u32),
    /// Neither gray nor RGB.
    #[error("found {0} samples per pixel, expected 1 (gray) or 3 (RGB)")]
    Channels(u32),
    /// Something that would silently be read wrong.
    #[error("{0}")]
    Odd(Oddity),
    /// The file ends before its pixels do.
    #[error(
        "the file is cut short: its pixels reach to byte {needed}, it has {found}: copy it anew"
    )]
    Truncated {
        /// Bytes that the header speaks of.
        needed: u64,
        /// Bytes there are.
        found: u64,
    },
    /// The header promises more pixels than the bytes can hold.
    #[error(
        "the header promises {width} x {height} x {channels} samples, which {stored} bytes of \
         pixel data cannot hold: the file is damaged"
    )]
    Oversized {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Samples per pixel.
        channels: u32,
        /// Bytes of pixel data in the file.
        stored: u64,
    },
    /// A frame whose samples do not fill its size, or are neither gray nor RGB.
    #[error(
        "a frame of {width} x {height} x {channels} cannot be written from {samples} samples; \
         expected 1 or 3 channels and as many samples as they need"
    )]
    Inconsistent {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// Samples per pixel.
        channels: usize,
        /// Samples there are.
        samples: usize,
    },
    /// The TIFF decoder or encoder gave up.
    #[error("TIFF: {0}")]
    Tiff(#[from] ::tiff::TiffError),
    /// The PNG decoder gave up.
    #[error("PNG: {0}")]
    PngDecoding(#[from] ::png::DecodingError),
    /// The PNG encoder gave up.
    #[error("PNG: {0}")]
    PngEncoding(#[from] ::png::EncodingError),
}

/// Why a file, though in order, is no frame of counts.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum Oddity {
    /// Colours one after the other instead of pixel by pixel.
    #[error(
        "the colour planes are stored one after the other; expected them pixel by pixel: save the file with interleaved (chunky) samples"
    )]
    Planar,
    /// Indices into a palette.
    #[error(
        "the pixels are indices into a palette; expected counts: save the file as 16-bit gray or RGB"
    )]
    Palette,
    /// An alpha channel or other extra samples.
    #[error(
        "the pixels carry alpha or another extra sample; expected gray or RGB alone: save the file without it"
    )]
    Alpha,
    /// Large counts mean little light.
    #[error(
        "white is zero in this file; expected black to be zero: save the file with PhotometricInterpretation 1"
    )]
    WhiteIsZero,
    /// Another photometric interpretation: CMYK, YCbCr, Lab, …
    #[error(
        "PhotometricInterpretation is {0}; expected 1 (black is zero) or 2 (RGB): save the file as gray or RGB, without conversion of its colours"
    )]
    Photometric(u16),
    /// A colour filter array or linear RAW.
    #[error(
        "the file holds undeveloped RAW or an unknown kind of pixel; expected gray or RGB: develop it linearly to 16-bit TIFF first"
    )]
    Raw,
    /// Signed or floating-point samples.
    #[error("SampleFormat is {0}; expected 1 (unsigned whole numbers), the counts of the camera")]
    SampleFormat(u16),
    /// Lossy or rare compression.
    #[error(
        "Compression is {0}; expected none (1), LZW (5), Deflate (8, 32946) or PackBits (32773): save the file without compression"
    )]
    Compression(u16),
    /// Bits of a byte in reverse.
    #[error("FillOrder is {0}; expected 1: save the file anew")]
    FillOrder(u16),
    /// Pixels to be turned before they are looked at.
    #[error(
        "Orientation is {0}; expected 1, rows from top to bottom: turn the pixels themselves, so that positions in pixels have one meaning"
    )]
    Orientation(u16),
    /// The first image of the file is a small copy.
    #[error(
        "the first image of the file is a thumbnail or a mask; expected the frame itself: save the frame alone"
    )]
    Thumbnail,
    /// Several images in one file.
    #[error(
        "the file holds several images; expected one frame a file, each with its exposure time: split it"
    )]
    ManyImages,
    /// A transfer curve that is not a straight line.
    #[error(
        "the file declares a transfer curve (sRGB or a gamma other than 1); expected counts in proportion to light: save it linear, without the declaration"
    )]
    Curve,
}

/// Deflate packs at most 1032 bytes into one; LZW and PackBits fewer.
const LARGEST_RATIO: u64 = 1100;

/// The frame in `bytes`, TIFF or PNG by their first bytes.
///
/// # Errors
///
/// [`ImageError`]: another format, another kind of pixel, a damaged or truncated file.
pub fn decode_frame(bytes: &[u8]) -> Result<Frame, ImageError> {
    match bytes {
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => tiff::decode(bytes),
        [0x89, b'P', b'N', b'G', ..] => png::decode(bytes),
        _ => Err(ImageError::UnknownFormat(
            bytes.iter().take(4).copied().collect(),
        )),
    }
}

/// Number of samples of an image, if `stored` bytes with at most `ratio` to one can hold them.
fn sample_count(
    [width, height, channels]: [u32; 3],
    stored: u64,
    ratio: u64,
) -> Result<usize, ImageError> {
    let oversized = ImageError::Oversized {
        width,
        height,
        channels,
        stored,
    };
    // Two 32-bit numbers and a 3 overflow 64 bits only in sizes that no file holds.
    u64::from(width)
        .checked_mul(u64::from(height))
        .and_then(|pixels| pixels.checked_mul(u64::from(channels)))
        .filter(|samples| *samples <= stored.saturating_mul(ratio) / 2)
        .and_then(|samples| usize::try_from(samples).ok())
        .ok_or(oversized)
}

/// Width and height of a frame that can be written.
fn size_to_write(frame: &Frame) -> Result<(u32, u32), ImageError> {
    let Frame {
        width,
        height,
        channels,
        ref samples,
    } = *frame;
    let error = ImageError::Inconsistent {
        width,
        height,
        channels,
        samples: samples.len(),
    };
    let filled = width
        .checked_mul(height)
        .and_then(|pixels| pixels.checked_mul(channels))
        .is_some_and(|needed| needed == samples.len() && needed > 0);
    match (u32::try_from(width), u32::try_from(height)) {
        (Ok(width), Ok(height)) if filled && matches!(channels, 1 | 3) => Ok((width, height)),
        _ => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::io::Cursor;

    fn frame() -> impl Strategy<Value = Frame> {
        (
            1..40_usize,
            1..40_usize,
            prop_oneof![Just(1_usize), Just(3)],
        )
            .prop_flat_map(|(width, height, channels)| {
                prop::collection::vec(any::<u16>(), width * height * channels).prop_map(
                    move |samples| Frame {
                        width,
                        height,
                        channels,
                        samples,
                    },
                )
            })
    }

    fn tiff_of(frame: &Frame) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        encode_tiff(frame, &mut out).unwrap();
        out.into_inner()
    }

    fn png_of(frame: &Frame) -> Vec<u8> {
        let mut out = Vec::new();
        encode_png(frame, &mut out).unwrap();
        out
    }

    proptest! {
        #[test]
        fn what_is_written_comes_back(frame in frame()) {
            prop_assert_eq!(&decode_frame(&tiff_of(&frame)).unwrap(), &frame);
            prop_assert_eq!(&decode_frame(&png_of(&frame)).unwrap(), &frame);
        }

        #[test]
        fn a_file_cut_short_is_an_error(frame in frame(), share in 0.0..1.0_f64) {
            for bytes in [tiff_of(&frame), png_of(&frame)] {
                // The last 12 bytes of a PNG close a file whose pixels are whole already.
                let kept = ((bytes.len() - 12) as f64 * share) as usize;
                prop_assert!(decode_frame(&bytes[..kept]).is_err(), "{} of {}", kept, bytes.len());
            }
        }

        #[test]
        fn damage_does_not_panic(
            frame in frame(),
            hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        ) {
            for mut bytes in [tiff_of(&frame), png_of(&frame)] {
                for (index, value) in &hits {
                    // Half of the hits in the headers, where damage is worst.
                    let at = index.index(bytes.len());
                    bytes[at] = *value;
                    let near_the_end = bytes.len() - 1 - index.index(bytes.len().min(200));
                    bytes[near_the_end] = *value;
                }
                let _ = decode_frame(&bytes);
            }
        }
    }

    #[test]
    fn other_formats_are_told_by_their_first_bytes() {
        let message = decode_frame(b"P5 2 2 255\n").unwrap_err().to_string();
        assert!(message.contains("[50, 35, 20, 32]"), "{message}");
        assert!(matches!(
            decode_frame(b""),
            Err(ImageError::UnknownFormat(_))
        ));
    }

    #[test]
    fn a_frame_that_contradicts_itself_is_not_written() {
        let frame = Frame {
            width: 2,
            height: 2,
            channels: 1,
            samples: vec![0; 3],
        };
        let error = encode_png(&frame, Vec::new()).unwrap_err();
        assert!(matches!(error, ImageError::Inconsistent { samples: 3, .. }));
        let two = Frame {
            width: 1,
            height: 1,
            channels: 2,
            samples: vec![0; 2],
        };
        assert!(encode_tiff(&two, Cursor::new(Vec::new())).is_err());
    }

    /// Speed, by hand: `cargo test -p beamspot-formats --release -- --ignored --nocapture speed`.
    #[test]
    #[ignore = "a measurement, not a check"]
    fn speed() {
        let frame = Frame {
            width: 6000,
            height: 4000,
            channels: 1,
            samples: (0..24_000_000_u32)
                .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u16)
                .collect(),
        };
        for (name, encode) in [
            ("tiff", tiff_of as fn(&Frame) -> Vec<u8>),
            ("png", png_of as fn(&Frame) -> Vec<u8>),
        ] {
            let start = std::time::Instant::now();
            let bytes = encode(&frame);
            let written = start.elapsed();
            let start = std::time::Instant::now();
            assert!(decode_frame(&bytes).unwrap() == frame);
            println!(
                "{name}: write {written:?}, read {:?}, {} bytes",
                start.elapsed(),
                bytes.len()
            );
        }
    }
}

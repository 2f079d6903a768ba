//! Frames: TIFF, PNG, PGM/PPM, OpenEXR and FITS; gray or RGB, counts in proportion to light.
//!
//! A frame is data, not a picture to look at: whatever a decoder would have to guess, convert or
//! leave out is refused with its reason ([`Oddity`]), and no size of a header is trusted with
//! memory before the length of the file has vouched for it.

mod beginning;
mod exr;
mod fits;
mod icc;
mod png;
mod pnm;
mod tiff;
mod undeveloped;

pub use self::png::{encode_indexed_png, encode_png};
pub use self::tiff::encode_tiff;
pub use self::undeveloped::PackedDng;

use physics::{Counts, Frame, Mosaic, Samples};
use thiserror::Error;

/// How a file stores its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// Whole numbers of so many bits: 8 are widened to 16, 12 may have been packed.
    Bits(u16),
    /// Floating-point numbers of 16 bits, which hold whole counts up to 2048 and round larger ones
    /// to 11 bits.
    Half,
    /// Floating-point numbers.
    Float,
}

impl std::fmt::Display for Depth {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Bits(bits) => write!(f, "{bits}-bit"),
            Self::Half => write!(f, "half-precision floating-point"),
            Self::Float => write!(f, "floating-point"),
        }
    }
}

/// A frame as its file holds it.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// The frame.
    pub frame: Frame,
    /// How its samples were stored.
    pub depth: Depth,
    /// Which colour each sample is of, where the file says that it is the mosaic of a colour
    /// filter array; the frame then has one channel.
    pub mosaic: Option<Mosaic>,
    /// Count at and above which the file says that samples are saturated.
    pub white_level_dn: Option<f64>,
    /// Whether the file declares a transfer curve that is no straight line (sRGB, a gamma, an ICC profile).
    pub curve: bool,
    /// The compression, where it has changed the samples.
    pub loss: Option<&'static str>,
    /// The largest step between two counts that the file can hold beside each other, DN: 1 but
    /// for those of a table.
    pub step_dn: u16,
    /// Width of a pixel over its height, as the file states it.
    pub pixel_aspect: f64,
    /// Column and row of the first pixel in the whole of which the file says it is a part.
    pub origin: [i32; 2],
}

impl Decoded {
    /// A frame of whose file there is nothing more to say.
    pub fn plain(frame: Frame, depth: Depth) -> Self {
        Self {
            frame,
            depth,
            mosaic: None,
            white_level_dn: None,
            curve: false,
            loss: None,
            step_dn: 1,
            pixel_aspect: 1.0,
            origin: [0; 2],
        }
    }

    /// The frame, if its counts are in proportion to light as far as one can tell.
    ///
    /// Files of 8 bits almost never are, unless someone states it: `stated_linear`.
    ///
    /// # Errors
    ///
    /// [`ImageError::EightBits`], or [`Oddity::Curve`] and [`Oddity::ExrLoss`] whatever was stated.
    pub fn linear(self, stated_linear: bool) -> Result<Frame, ImageError> {
        if self.curve {
            return Err(ImageError::Odd(Oddity::Curve));
        }
        if let Some(loss) = self.loss {
            return Err(ImageError::Odd(Oddity::ExrLoss(loss)));
        }
        if !stated_linear && matches!(self.depth, Depth::Bits(..=8)) {
            return Err(ImageError::EightBits);
        }
        Ok(self.frame)
    }
}

/// Width of a pixel over its height, which are as these; 1 where they are no lengths.
fn aspect(width: f64, height: f64) -> f64 {
    let ratio = width / height;
    if width > 0.0 && height > 0.0 && ratio.is_normal() {
        ratio
    } else {
        1.0
    }
}

/// A frame cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ImageError {
    /// None of the formats.
    #[error(
        "no frame: {}; expected TIFF, PNG, binary PGM or PPM, OpenEXR or FITS: {}",
        beginning::found(.0), beginning::advice(.0)
    )]
    UnknownFormat(Vec<u8>),
    /// A camera's own RAW format.
    #[error(
        "camera RAW ({0}): build beamspot with `--features raw` to read it, or convert the file to \
         uncompressed DNG, which keeps its counts as they are"
    )]
    CameraRaw(&'static str),
    /// Samples of a width that no camera gives.
    #[error(
        "found {0} bits per sample, expected 8, 16, 10, 12 or 14 (packed, uncompressed TIFF), or 32 in \
         floating point: save the frames from the camera as 16-bit gray or RGB"
    )]
    Depth(u32),
    /// Eight bits, and nobody said that they are linear.
    #[error(
        "found 8 bits per sample, which are in proportion to light in hardly any file: save the \
         frames from the camera in 16 bits, or, where the camera wrote its counts as they are, \
         state it in the manifest: `response = \"linear\"` under `[camera]`; \
         `response = \"recover\"` finds the curve from the frames, at a cost in accuracy"
    )]
    EightBits,
    /// A text header that makes no sense.
    #[error(
        "{format}: {what}; the file is damaged or of another kind: copy it anew, or save the frame again"
    )]
    Header {
        /// Name of the format.
        format: &'static str,
        /// What was found and expected.
        what: &'static str,
    },
    /// A FITS card that the frame depends on.
    #[error(
        "FITS: {keyword} is {found}; expected {expected}: correct the header, or save the frame again"
    )]
    Fits {
        /// The keyword.
        keyword: &'static str,
        /// Its value, or `missing`.
        found: String,
        /// What a frame has there.
        expected: &'static str,
    },
    /// A sample that is no count.
    #[error("pixel {column}, {row}: found {found}, expected {expected}")]
    Sample {
        /// Column, from 0.
        column: usize,
        /// Row, from 0.
        row: usize,
        /// The sample.
        found: f64,
        /// What a count is.
        expected: &'static str,
    },
    /// A strip of packed samples that is not long enough.
    #[error(
        "the strip of row {row}, plane {plane}, does not hold the {needed} bytes of its rows: the \
         file is damaged: copy it anew"
    )]
    ShortStrip {
        /// First row of the strip.
        row: usize,
        /// Plane of the strip.
        plane: usize,
        /// Bytes that its rows need.
        needed: usize,
    },
    /// Bytes behind the pixels.
    #[error(
        "the file goes on for {0} bytes behind its pixels: expected one frame a file, each with \
         its exposure time: split it"
    )]
    Behind(usize),
    /// An EXR file without the channels of a frame.
    #[error(
        "OpenEXR: found the channels {0}; expected Y, or R, G and B, and nothing else: save the \
         frame with these alone"
    )]
    ExrChannels(String),
    /// The EXR decoder gave up.
    #[error("OpenEXR: {0}; {ANEW}")]
    Exr(::exr::error::Error),
    /// Neither gray nor RGB.
    #[error(
        "found {0} samples per pixel, expected 1 (gray) or 3 (RGB): save the frame as one of them"
    )]
    Channels(u32),
    /// Something that would silently be read wrong.
    #[error("{0}")]
    Odd(Oddity),
    /// The file ends before its pixels do.
    #[error(
        "the file is cut short or damaged: its data reach to byte {needed}, it has {found}: copy it anew"
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
         pixel data cannot hold: the file is damaged: copy it anew"
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
         expected 1 or 3 channels and as many 16-bit samples as they need"
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
    #[error("TIFF: {0}; {ANEW}")]
    Tiff(::tiff::TiffError),
    /// The file ends before what it speaks of.
    #[error(
        "{0}: the file ends before what its header speaks of: it is cut short or damaged: copy it anew"
    )]
    CutShort(&'static str),
    /// The PNG decoder gave up.
    #[error("PNG: {0}; {ANEW}")]
    PngDecoding(::png::DecodingError),
    /// Sixteen-bit samples in the order that their format does not have.
    #[error(
        "neighbouring counts differ by {found:.0} in the mean, and by {swapped:.0} with their bytes \
         exchanged: expected the high byte first, as the format has it: save the frame by a program \
         that writes it so"
    )]
    ByteOrder {
        /// Mean difference of neighbours as the file stands, DN.
        found: f64,
        /// The same with the two bytes of every sample exchanged, DN.
        swapped: f64,
    },
    /// The PNG encoder gave up.
    #[error("PNG: {0}")]
    PngEncoding(#[from] ::png::EncodingError),
}

/// What to do with a file that its decoder gave up.
const ANEW: &str = "the file is damaged, or of a kind that no camera writes: copy it anew, or save \
                    the frame as plain 16-bit TIFF";

impl From<::png::DecodingError> for ImageError {
    fn from(error: ::png::DecodingError) -> Self {
        match error {
            ::png::DecodingError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
                Self::CutShort("PNG")
            }
            other => Self::PngDecoding(other),
        }
    }
}

impl From<::exr::error::Error> for ImageError {
    fn from(error: ::exr::error::Error) -> Self {
        match error {
            // The crate's word for an end of the file that comes too soon.
            ::exr::error::Error::Invalid(what) if what == "reference to missing bytes" => {
                Self::CutShort("OpenEXR")
            }
            other => Self::Exr(other),
        }
    }
}

impl From<::tiff::TiffError> for ImageError {
    fn from(error: ::tiff::TiffError) -> Self {
        match error {
            ::tiff::TiffError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
                Self::CutShort("TIFF")
            }
            other => Self::Tiff(other),
        }
    }
}

/// Why a file, though in order, is no frame of counts.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum Oddity {
    /// Several pictures in a FITS cube.
    #[error(
        "the file is a cube of several planes and does not say that they are colours (CTYPE3 = 'RGB'); expected one frame a file, each with its exposure time: split it"
    )]
    Cube,
    /// A mosaic of other colours or in another arrangement.
    #[error(
        "the file is the mosaic of a colour filter array whose pattern is missing, or is no square of R, G and B: state it in the manifest, `mosaic = \"RGGB\"` under `[camera]`, and give gray files"
    )]
    Pattern,
    /// Rows of a FITS mosaic in an order that leaves its pattern open.
    #[error(
        "BAYERPAT stands beside ROWORDER = BOTTOM-UP, so that it may begin at either end: state the pattern of the first two rows in the file in the manifest, `mosaic = \"RGGB\"` under `[camera]`, and remove BAYERPAT"
    )]
    RowOrder,
    /// The part that light falls on does not lie inside the picture.
    #[error(
        "ActiveArea is no part of the picture (top, left, bottom, right): the file is damaged: copy it anew"
    )]
    ActiveArea,
    /// A table of counts that cannot be used.
    #[error(
        "LinearizationTable is no list of 1 to 65536 counts below 65536 for samples of whole numbers: the file is damaged: copy it anew, or convert it to DNG once more"
    )]
    Table,
    /// A DNG without a picture as the sensor counted it.
    #[error(
        "the DNG holds no picture of the sensor's own counts, only developed ones or small copies: convert the camera's file to DNG once more"
    )]
    NoCounts,
    /// Several samples a photosite.
    #[error(
        "the DNG has {0} samples a pixel: it was demosaiced already (LinearRaw); expected one a photosite, as the sensor counted: convert the camera's file without demosaicing"
    )]
    Developed(u16),
    /// Counts that were changed so that they pack better.
    #[error(
        "the counts are compressed with loss ({0}): photograph without it, or convert the camera's own file to uncompressed or losslessly compressed DNG"
    )]
    LossyRaw(Lossy),
    /// Counts that a reader is to bend.
    #[error(
        "an opcode list of the DNG asks for its counts to be bent ({0:?}), so that they are not in proportion to light as they stand: give the camera's own file, or a DNG without it"
    )]
    Opcode(Bending),
    /// Rows, columns or parts of tiles in another order.
    #[error(
        "the rows, columns or tiles of the DNG are interleaved; expected rows from top to bottom: convert it to DNG once more, uncompressed"
    )]
    Interleaved,
    /// A FITS file whose picture is not its first part.
    #[error(
        "the picture stands in an extension of the file; expected it in the first part: copy the extension to a file of its own"
    )]
    FitsExtension,
    /// Tile-compressed FITS.
    #[error("the picture is compressed inside a FITS table (ZIMAGE); unpack it first (funpack)")]
    CompressedFits,
    /// Packed 12-bit samples behind another coder.
    #[error(
        "packed samples are compressed; expected them as they are: save the file without compression"
    )]
    CompressedPacked,
    /// Packed 12-bit samples in tiles.
    #[error("packed samples stand in tiles; expected strips: save the file in strips")]
    PackedTiles,
    /// A picture that `beamspot hdr` or another merge made.
    #[error(
        "the file is a radiance map, merged already; expected the frame of one exposure, so give the map to `beamspot profile` instead"
    )]
    Merged,
    /// OpenEXR whose pixels are not those that were saved.
    #[error(
        "the pixels are compressed with loss ({0}); expected none, RLE, ZIP, ZIPS or PIZ: save the \
         frame so"
    )]
    ExrLoss(&'static str),
    /// A layout of OpenEXR that is no plain picture.
    #[error(
        "the file is deep, subsampled, or made of several parts; expected one plain picture: save the frame alone"
    )]
    ExrLayout,
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
    /// An unknown kind of pixel.
    #[error(
        "the file holds an unknown kind of pixel; expected gray, RGB or the mosaic of a colour filter array"
    )]
    Raw,
    /// Signed or floating-point samples.
    #[error(
        "SampleFormat is {0}; expected 1 (unsigned whole numbers) or, in 32 bits, 3 (floating point)"
    )]
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
        "the file declares a transfer curve (sRGB, a gamma other than 1, PQ or HLG, or an ICC profile that bends); expected counts in proportion to light: save it linear, without the declaration"
    )]
    Curve,
}

/// A correction that a DNG asks its reader for and that bends counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bending {
    /// By a table.
    MapTable,
    /// By a polynomial.
    MapPolynomial,
}

/// A coder of counts that changes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lossy {
    /// The JPEG of photographs.
    Jpeg,
    /// JPEG XL, unless its file says that nothing was lost.
    JpegXl,
}

impl std::fmt::Display for Lossy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Jpeg => "JPEG",
            Self::JpegXl => "JPEG XL whose JXLDistance is not stated to be 0",
        })
    }
}

/// Deflate packs at most 1032 bytes into one; LZW and PackBits fewer.
const LARGEST_RATIO: u64 = 1100;

/// The frame in `bytes`, whose first ones tell the format.
///
/// # Errors
///
/// [`ImageError`]: another format, another kind of pixel, a damaged or truncated file.
pub fn decode_frame(bytes: &[u8]) -> Result<Decoded, ImageError> {
    decode_frame_into(bytes, vec![])
}

/// The same in the memory of `spare`, as far as samples of 16 bits go: fresh memory costs more
/// than the samples of a plain file do.
///
/// # Errors
///
/// As [`decode_frame`].
pub fn decode_frame_into(bytes: &[u8], mut spare: Vec<u16>) -> Result<Decoded, ImageError> {
    if let Some(raw) = camera_raw(bytes) {
        return Err(ImageError::CameraRaw(raw));
    }
    match Format::of(bytes) {
        Some(Format::Tiff) => tiff::decode(bytes, &mut spare, false).map(|(decoded, _)| decoded),
        Some(Format::Png) => png::decode(bytes, spare),
        Some(Format::Pnm) => pnm::decode(bytes),
        Some(Format::Exr) => exr::decode(bytes),
        Some(Format::Fits) => fits::decode(bytes),
        None => Err(ImageError::UnknownFormat(beginning::of(bytes))),
    }
}

/// A file in memory that can become that of its samples.
#[derive(Clone, Debug, Default)]
pub struct FileWords {
    words: Vec<u16>,
    length: usize,
}

impl FileWords {
    /// A file of `length` bytes, two in each of `words`, the last of which may be half full.
    ///
    /// # Panics
    ///
    /// There are not as many words.
    pub fn new(words: Vec<u16>, length: usize) -> Self {
        assert_eq!(words.len(), length.div_ceil(2));
        Self { words, length }
    }

    /// The bytes of the file.
    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.length]
    }

    /// The memory, for the next file.
    pub fn into_memory(self) -> Vec<u16> {
        self.words
    }
}

/// The frame in `file`, whose memory becomes that of the frame where the samples stand in it as they
/// are, and is empty from then on; others come to stand in that of `spare`.
///
/// # Errors
///
/// As [`decode_frame`].
pub fn decode_frame_of(file: &mut FileWords, spare: &mut Vec<u16>) -> Result<Decoded, ImageError> {
    if camera_raw(file.bytes()).is_some() || Format::of(file.bytes()) != Some(Format::Tiff) {
        return decode_frame_into(file.bytes(), std::mem::take(spare));
    }
    let (mut decoded, place) = tiff::decode(file.bytes(), spare, true)?;
    if let Some(tiff::Place { words, swapped }) = place {
        let memory = std::mem::take(file).into_memory();
        let mut counts = Counts::within(memory, words);
        if swapped {
            for count in counts.iter_mut() {
                *count = count.swap_bytes();
            }
        }
        decoded.frame.samples = Samples::U16(counts);
    }
    Ok(decoded)
}

/// A format that frames come in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Tiff,
    Png,
    Pnm,
    Exr,
    Fits,
}

impl Format {
    /// The format that the first of `bytes` announce.
    pub(crate) fn of(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Some(Self::Tiff),
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            [b'P', b'5' | b'6', b' ' | b'\t'..=b'\r' | b'#', ..] => Some(Self::Pnm),
            [0x76, 0x2f, 0x31, 0x01, ..] => Some(Self::Exr),
            _ if bytes.starts_with(b"SIMPLE  =") => Some(Self::Fits),
            _ => None,
        }
    }
}

/// The camera's own format, where the first bytes say so and none of ours does.
fn camera_raw(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(b"FUJIFILMCCD-RAW") {
        Some("RAF")
    } else if bytes.get(4..12) == Some(b"ftypcrx ") {
        Some("CR3")
    } else if bytes.get(8..10) == Some(b"CR") && Format::of(bytes) == Some(Format::Tiff) {
        Some("CR2")
    } else {
        None
    }
}

/// Whether every sample is finite.
fn check_finite(frame: &Frame) -> Result<(), ImageError> {
    if let Samples::F32(samples) = &frame.samples
        && let Some(at) = samples.iter().position(|sample| !sample.is_finite())
    {
        let pixel = at / frame.channels;
        return Err(ImageError::Sample {
            column: pixel % frame.width,
            row: pixel / frame.width,
            found: samples[at].into(),
            expected: "a finite number: put the counts of the camera back where they were masked",
        });
    }
    Ok(())
}

/// Planes one after the other as pixels of three samples.
fn interleaved<T: Copy>(planes: &[T]) -> Vec<T> {
    let pixels = planes.len() / 3;
    (0..pixels)
        .flat_map(|i| [planes[i], planes[pixels + i], planes[2 * pixels + i]])
        .collect()
}

/// Number of samples of `bits` each in an image, if `stored` bytes, with at most `ratio` to one,
/// can hold them.
fn sample_count(
    [width, height, channels]: [u32; 3],
    stored: u64,
    ratio: u64,
    bits: u64,
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
        .filter(|samples| *samples <= stored.saturating_mul(8 * ratio) / bits)
        .and_then(|samples| usize::try_from(samples).ok())
        .ok_or(oversized)
}

/// Width, height and samples of a frame that can be written.
fn size_to_write(frame: &Frame) -> Result<(u32, u32, &[u16]), ImageError> {
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
    match (u32::try_from(width), u32::try_from(height), samples) {
        (Ok(width), Ok(height), Samples::U16(samples)) if filled && matches!(channels, 1 | 3) => {
            Ok((width, height, samples))
        }
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
                        samples: samples.into(),
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
            prop_assert_eq!(&decode_frame(&tiff_of(&frame)).unwrap().frame, &frame);
            prop_assert_eq!(&decode_frame(&png_of(&frame)).unwrap().frame, &frame);
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
        let message = decode_frame(b"Px 2 2 255\n").unwrap_err().to_string();
        assert!(message.contains("[50, 78, 20, 32]"), "{message}");
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
            samples: vec![0; 3].into(),
        };
        let error = encode_png(&frame, Vec::new()).unwrap_err();
        assert!(matches!(error, ImageError::Inconsistent { samples: 3, .. }));
        let two = Frame {
            width: 1,
            height: 1,
            channels: 2,
            samples: vec![0; 2].into(),
        };
        assert!(encode_tiff(&two, Cursor::new(Vec::new())).is_err());
    }
}

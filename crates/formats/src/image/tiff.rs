//! TIFF frames.

use super::{
    Decoded, Depth, ImageError, LARGEST_RATIO, Oddity, aspect, check_finite, icc, interleaved,
    sample_count, size_to_write,
    undeveloped::{self, Found, Patched},
};
use crate::metadata::tags::beyond_the_end;
use physics::{Frame, Samples};
use std::io::{Seek, Write};
use std::ops::Range;
use tiff::decoder::{Decoder, DecodingResult, Limits, ifd::Value};
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::Tag;
use tiff::{TiffError, TiffUnsupportedError};

type Reader<'a> = Decoder<Patched<'a>>;

/// The words of a file that are its samples.
pub(super) struct Place {
    /// Which ones.
    pub(super) words: Range<usize>,
    /// Whether their bytes stand in the other order than those of this machine.
    pub(super) swapped: bool,
}

/// Photometric interpretation of the mosaic of a colour filter array.
pub(super) const CFA: u16 = 32803;

/// The frame in `bytes`; where `in_place`, and its samples are words of the file as they are, it has
/// none yet, and they are at that place.
pub(super) fn decode(
    bytes: &[u8],
    spare: &mut Vec<u16>,
    in_place: bool,
) -> Result<(Decoded, Option<Place>), ImageError> {
    if let Some(needed) = beyond_the_end(bytes) {
        let found = bytes.len() as u64;
        return Err(ImageError::Truncated { needed, found });
    }
    let raw = match undeveloped::find(bytes) {
        Some(Found::Foreign(format)) => return Err(ImageError::CameraRaw(format)),
        Some(Found::Packed(_)) => return Err(ImageError::CameraRaw("DNG")),
        Some(Found::Odd(oddity)) => return Err(ImageError::Odd(oddity)),
        Some(Found::Picture(raw)) => Some(raw),
        None => None,
    };
    let file = match &raw {
        Some(raw) => raw.patched(bytes),
        None => Patched::plain(bytes),
    };
    let mut reader = Decoder::new(file).map_err(|error| match error {
        TiffError::UnsupportedError(TiffUnsupportedError::UnknownInterpretation) => {
            ImageError::Odd(Oddity::Raw)
        }
        other => other.into(),
    })?;
    let (channels, depth) = check_kind(&mut reader)?;
    let (width, height) = reader.dimensions()?;
    let profile = reader.find_tag_unsigned_vec::<u8>(Tag::IccProfile);
    let curve = profile?.is_some_and(|profile| icc::bends(&profile));
    let mut per_unit = |tag| match reader.find_tag(tag) {
        Ok(Some(Value::Rational(n, d))) => f64::from(n) / f64::from(d),
        _ => 0.0,
    };
    // Pixels per unit, whatever that is; of a DNG, those of the picture that it makes.
    let pixel_aspect = aspect(per_unit(Tag::YResolution), per_unit(Tag::XResolution));
    let planar = channels > 1 && tag(&mut reader, Tag::PlanarConfiguration, 1)? != 1;
    let stored = stored_bytes(&mut reader, bytes.len() as u64)?;
    let ratio = match tag(&mut reader, Tag::Compression, 1)? {
        1 => 1,
        _ if is_packed(depth) => return Err(ImageError::Odd(Oddity::CompressedPacked)),
        5 | 8 | 32946 | 32773 => LARGEST_RATIO,
        other => return Err(ImageError::Odd(Oddity::Compression(other))),
    };
    let bits = match depth {
        Depth::Bits(bits) => bits.into(),
        Depth::Half => 16,
        Depth::Float => 32,
    };
    let count = sample_count([width, height, channels], stored, ratio, bits)?;
    let mut place = None;
    let samples = if is_packed(depth) {
        let size = [width, height, channels].map(|n| n as usize);
        packed(&mut reader, bytes, bits as usize, size, planar)?.into()
    } else if let Some(strips) = plain(&mut reader, bytes, (ratio, depth, planar), count)? {
        let whole = Place::of(&strips, bytes).filter(|_| in_place && raw.is_none());
        if whole.is_none() {
            copied(&strips, bytes, count, spare);
            std::mem::take(spare).into()
        } else {
            place = whole;
            vec![].into()
        }
    } else {
        let mut limits = Limits::default();
        limits.decoding_buffer_size = count * bits as usize / 8;
        limits.intermediate_buffer_size = bytes.len();
        reader = reader.with_limits(limits);
        let mut result = DecodingResult::U16(std::mem::take(spare));
        reader.read_image_to_buffer(&mut result)?;
        // The decoder leaves planes out rather than exceed its limits.
        match result {
            DecodingResult::U8(samples) if samples.len() == count => {
                let samples: Vec<u16> = samples.into_iter().map(u16::from).collect();
                by_pixel(samples, planar).into()
            }
            DecodingResult::U16(samples) if samples.len() == count => {
                by_pixel(samples, planar).into()
            }
            DecodingResult::F16(samples) if samples.len() == count => {
                let samples = samples.into_iter().map(|sample| sample.to_f32()).collect();
                Samples::F32(by_pixel(samples, planar))
            }
            DecodingResult::F32(samples) if samples.len() == count => {
                Samples::F32(by_pixel(samples, planar))
            }
            _ => return Err(ImageError::Channels(channels)),
        }
    };
    // A small copy behind the frame does no harm; a second frame would be lost.
    while reader.more_images() {
        reader.next_image()?;
        if tag(&mut reader, Tag::NewSubfileType, 0)? == 0 {
            return Err(ImageError::Odd(Oddity::ManyImages));
        }
    }
    let frame = Frame {
        width: width as usize,
        height: height as usize,
        channels: channels as usize,
        samples,
    };
    check_finite(&frame)?;
    let decoded = match raw {
        Some(raw) => raw.developed_no_further(frame, depth)?,
        None => Decoded {
            pixel_aspect,
            ..Decoded::plain(frame, depth)
        },
    };
    Ok((Decoded { curve, ..decoded }, place))
}

/// Samples of fewer than 16 bits stand one after the other, without regard to bytes.
fn is_packed(depth: Depth) -> bool {
    matches!(depth, Depth::Bits(10 | 12 | 14))
}

fn by_pixel<T: Copy>(samples: Vec<T>, planar: bool) -> Vec<T> {
    if planar {
        interleaved(&samples)
    } else {
        samples
    }
}

/// Uncompressed samples of 10, 12 or 14 bits, the high bits first, each row from a byte of its own, which the
/// decoder does not unpack.
fn packed(
    reader: &mut Reader<'_>,
    bytes: &[u8],
    bits: usize,
    [width, height, channels]: [usize; 3],
    planar: bool,
) -> Result<Vec<u16>, ImageError> {
    let in_strips = reader.find_tag(Tag::TileWidth)?.is_none();
    let offsets = reader.find_tag_unsigned_vec::<u64>(Tag::StripOffsets)?;
    let counts = reader.find_tag_unsigned_vec::<u64>(Tag::StripByteCounts)?;
    let (Some(offsets), Some(counts), true) = (offsets, counts, in_strips) else {
        return Err(ImageError::Odd(Oddity::PackedTiles));
    };
    let rows = reader.find_tag_unsigned::<u32>(Tag::RowsPerStrip)?;
    let rows = rows.map_or(height, |rows| (rows as usize).clamp(1, height.max(1)));
    let (planes, in_row) = if planar {
        (channels, width)
    } else {
        (1, width * channels)
    };
    let row_bytes = (in_row * bits).div_ceil(8);
    let mut samples = Vec::with_capacity(width * height * channels);
    let mut strips = offsets.iter().zip(&counts);
    for plane in 0..planes {
        for first in (0..height).step_by(rows) {
            let needed = rows.min(height - first) * row_bytes;
            let strip = strips.next().and_then(|(offset, count)| {
                // `stored_bytes` has seen that the strip lies inside the file.
                let start = usize::try_from(*offset).ok()?;
                let count = usize::try_from(*count).ok()?.min(needed);
                bytes.get(start..start.checked_add(count)?)
            });
            let strip = strip.filter(|strip| strip.len() == needed);
            let strip = strip.ok_or(ImageError::ShortStrip {
                row: first,
                plane,
                needed,
            })?;
            for row in strip.chunks_exact(row_bytes) {
                let (mut held, mut left) = (0_u32, 0);
                let mut bytes = row.iter();
                samples.extend((0..in_row).map(|_| {
                    while left < bits {
                        held = held << 8 | u32::from(bytes.next().copied().unwrap_or_default());
                        left += 8;
                    }
                    left -= bits;
                    (held >> left & ((1 << bits) - 1)) as u16
                }));
            }
        }
    }
    Ok(by_pixel(samples, planar))
}

/// The strips of uncompressed 16-bit samples, as most cameras write them, in bytes; `None` where
/// there is anything more to it.
fn plain(
    reader: &mut Reader<'_>,
    bytes: &[u8],
    (ratio, depth, planar): (u64, Depth, bool),
    count: usize,
) -> Result<Option<Vec<Range<usize>>>, ImageError> {
    let in_strips = reader.find_tag(Tag::TileWidth)?.is_none();
    let straight = tag(reader, Tag::Predictor, 1)? == 1;
    if ratio != 1 || depth != Depth::Bits(16) || planar || !in_strips || !straight {
        return Ok(None);
    }
    let offsets = reader.find_tag_unsigned_vec::<u64>(Tag::StripOffsets)?;
    let counts = reader.find_tag_unsigned_vec::<u64>(Tag::StripByteCounts)?;
    let (Some(offsets), Some(counts)) = (offsets, counts) else {
        return Ok(None);
    };
    let (_, height) = reader.dimensions()?;
    let row_bytes = 2 * count / (height as usize).max(1);
    let rows = reader.find_tag_unsigned::<u32>(Tag::RowsPerStrip)?;
    let rows = rows.map_or(height, |rows| rows.clamp(1, height.max(1)));
    let mut stored = offsets.into_iter().zip(counts);
    let strips = (0..height).step_by(rows as usize).map(|first| {
        let needed = rows.min(height - first) as usize * row_bytes;
        let (offset, stored) = stored.next()?;
        let start = usize::try_from(offset).ok()?;
        let strip = start..start.checked_add(needed)?;
        (stored >= needed as u64 && strip.end <= bytes.len()).then_some(strip)
    });
    // What is short is the decoder's to judge.
    Ok(strips.collect())
}

/// The samples of the strips of a file, into `samples`.
fn copied(strips: &[Range<usize>], bytes: &[u8], count: usize, samples: &mut Vec<u16>) {
    samples.clear();
    samples.reserve_exact(count);
    for strip in strips {
        let (pairs, _) = bytes[strip.clone()].as_chunks::<2>();
        if bytes.starts_with(b"II") {
            samples.extend(pairs.iter().map(|pair| u16::from_le_bytes(*pair)));
        } else {
            samples.extend(pairs.iter().map(|pair| u16::from_be_bytes(*pair)));
        }
    }
}

impl Place {
    /// That of strips which follow one another from a word of the file on.
    fn of(strips: &[Range<usize>], bytes: &[u8]) -> Option<Self> {
        let (first, last) = (strips.first()?, strips.last()?);
        let joined = strips.windows(2).all(|pair| pair[0].end == pair[1].start);
        let little = bytes.starts_with(b"II");
        (joined && first.start % 2 == 0).then_some(Self {
            words: first.start / 2..last.end / 2,
            swapped: little != cfg!(target_endian = "little"),
        })
    }
}

fn tag(reader: &mut Reader<'_>, tag: Tag, default: u16) -> Result<u16, ImageError> {
    Ok(reader.find_tag_unsigned(tag)?.unwrap_or(default))
}

/// Samples per pixel, 1 or 3, and their depth, of an image that is a frame of counts.
fn check_kind(reader: &mut Reader<'_>) -> Result<(u32, Depth), ImageError> {
    let odd = |oddity| Err(ImageError::Odd(oddity));
    let samples = tag(reader, Tag::SamplesPerPixel, 1)?;
    let extra = reader.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples)?;
    let sample_format = reader.find_tag_unsigned_vec::<u16>(Tag::SampleFormat)?;
    if tag(reader, Tag::NewSubfileType, 0)? != 0 {
        return odd(Oddity::Thumbnail);
    }
    if extra.is_some_and(|extra| !extra.is_empty()) {
        return odd(Oddity::Alpha);
    }
    match (tag(reader, Tag::PhotometricInterpretation, 1)?, samples) {
        (0, _) => return odd(Oddity::WhiteIsZero),
        (3, _) => return odd(Oddity::Palette),
        (1, 1) | (2, 3) => {}
        (1 | 2, other) => return Err(ImageError::Channels(other.into())),
        (other, _) => return odd(Oddity::Photometric(other)),
    }
    let bits = reader
        .find_tag_unsigned_vec::<u16>(Tag::BitsPerSample)?
        .unwrap_or(vec![1]);
    let formats = sample_format.unwrap_or_default();
    let first = bits.first().copied().unwrap_or(1);
    if let Some(other) = bits.iter().find(|bits| **bits != first) {
        return Err(ImageError::Depth((*other).into()));
    }
    let format = formats.first().copied().unwrap_or(1);
    if let Some(other) = formats.iter().find(|other| **other != format) {
        return odd(Oddity::SampleFormat(*other));
    }
    let depth = match (format, first) {
        (1, 8 | 10 | 12 | 14 | 16) => Depth::Bits(first),
        (3, 16) => Depth::Half,
        (3, 32) => Depth::Float,
        (1 | 3, other) => return Err(ImageError::Depth(other.into())),
        (other, _) => return odd(Oddity::SampleFormat(other)),
    };
    match tag(reader, Tag::FillOrder, 1)? {
        1 => {}
        other => return odd(Oddity::FillOrder(other)),
    }
    match tag(reader, Tag::Orientation, 1)? {
        1 => Ok((samples.into(), depth)),
        other => odd(Oddity::Orientation(other)),
    }
}

/// Bytes of pixel data, all of them inside the file and none of them twice.
fn stored_bytes(reader: &mut Reader<'_>, length: u64) -> Result<u64, ImageError> {
    let mut list = |strips, tiles| {
        let values = match reader.find_tag_unsigned_vec::<u64>(strips)? {
            Some(values) => Some(values),
            None => reader.find_tag_unsigned_vec::<u64>(tiles)?,
        };
        Ok::<_, ImageError>(values.unwrap_or_default())
    };
    let offsets = list(Tag::StripOffsets, Tag::TileOffsets)?;
    let counts = list(Tag::StripByteCounts, Tag::TileByteCounts)?;
    let mut stored = 0_u64;
    for (offset, count) in offsets.iter().zip(&counts) {
        let needed = offset.saturating_add(*count);
        if needed > length {
            return Err(ImageError::Truncated {
                needed,
                found: length,
            });
        }
        stored = stored.saturating_add(*count);
    }
    // Strips that share bytes could promise any size; no camera writes them.
    if stored > length {
        return Err(ImageError::Truncated {
            needed: stored,
            found: length,
        });
    }
    Ok(stored)
}

/// Writes a frame as uncompressed 16-bit TIFF.
///
/// # Errors
///
/// [`ImageError`] for a frame that contradicts itself, or what the writer reports.
pub fn encode_tiff(frame: &Frame, out: impl Write + Seek) -> Result<(), ImageError> {
    let (width, height, samples) = size_to_write(frame)?;
    let mut encoder = TiffEncoder::new(out)?;
    if frame.channels == 1 {
        encoder.write_image::<colortype::Gray16>(width, height, samples)?;
    } else {
        encoder.write_image::<colortype::RGB16>(width, height, samples)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{FileWords, decode_frame, decode_frame_of};
    use super::*;
    use std::io::Cursor;
    use tiff::encoder::Rational;

    const SHORT: u16 = 3;
    const LONG: u16 = 4;

    /// A 2 x 1 gray TIFF by the letter of the specification, with `changes` to its tags.
    fn file(big_endian: bool, changes: &[(u16, u32)], data: &[u8]) -> Vec<u8> {
        let mut tags = vec![
            (256, LONG, 2),
            (257, LONG, 1),
            (258, SHORT, 16),
            (259, SHORT, 1),
            (262, SHORT, 1),
            (273, LONG, 8),
            (277, SHORT, 1),
            (278, LONG, 1),
            (279, LONG, data.len() as u32),
        ];
        for &(tag, value) in changes {
            tags.retain(|t| t.0 != tag);
            tags.push((
                tag,
                if tag == 256 || tag == 257 {
                    LONG
                } else {
                    SHORT
                },
                value,
            ));
        }
        tags.sort_unstable();
        let two = |v: u16| {
            if big_endian {
                v.to_be_bytes()
            } else {
                v.to_le_bytes()
            }
        };
        let four = |v: u32| {
            if big_endian {
                v.to_be_bytes()
            } else {
                v.to_le_bytes()
            }
        };
        let mut out = if big_endian {
            b"MM".to_vec()
        } else {
            b"II".to_vec()
        };
        out.extend(two(42));
        out.extend(four(8 + data.len() as u32));
        out.extend(data);
        out.extend(two(tags.len() as u16));
        for (tag, kind, value) in tags {
            out.extend(two(tag));
            out.extend(two(kind));
            out.extend(four(1));
            if kind == SHORT {
                out.extend(two(value as u16));
                out.extend(two(0));
            } else {
                out.extend(four(value));
            }
        }
        out.extend(four(0));
        out
    }

    #[test]
    fn both_byte_orders() {
        let little = file(false, &[], &[0x02, 0x01, 0x00, 0xff]);
        let samples: Samples = vec![0x0102, 0xff00].into();
        assert_eq!(decode_frame(&little).unwrap().frame.samples, samples);
        let big = file(true, &[], &[0x01, 0x02, 0xff, 0x00]);
        assert_eq!(decode_frame(&big).unwrap().frame.samples, samples);
    }

    #[test]
    fn pixels_that_are_not_square_say_so() {
        let found = |resolution: [[u32; 2]; 2]| {
            let mut bytes = vec![];
            let mut encoder = TiffEncoder::new(Cursor::new(&mut bytes)).unwrap();
            let mut image = encoder.new_image::<colortype::Gray16>(2, 1).unwrap();
            let [across, down] = resolution.map(|[n, d]| Rational { n, d });
            image.x_resolution(across);
            image.y_resolution(down);
            image.write_data(&[1, 2]).unwrap();
            decode_frame(&bytes).unwrap().pixel_aspect
        };
        // Twice as many to a unit across as down: half as wide as they are high.
        assert_eq!(found([[300, 1], [150, 1]]), 0.5);
        assert_eq!(found([[72, 1], [72, 1]]), 1.0);
        assert_eq!(found([[0, 0], [72, 1]]), 1.0);
        assert_eq!(
            decode_frame(&file(false, &[], &[0; 4]))
                .unwrap()
                .pixel_aspect,
            1.0
        );
    }

    #[test]
    fn samples_that_stand_in_the_file_as_they_are_stay_there() {
        let words = |bytes: &[u8]| {
            let pairs = bytes.chunks(2);
            let word = |pair: &[u8]| u16::from_ne_bytes([pair[0], *pair.get(1).unwrap_or(&0)]);
            FileWords::new(pairs.map(word).collect(), bytes.len())
        };
        let samples: Samples = vec![0x0102, 0xff00].into();
        // A byte ahead of the samples, and a gap between them: a row of its own is a strip.
        let odd = file(false, &[(273, 9)], &[0, 0x02, 0x01, 0x00, 0xff]);
        let mut apart = file(
            false,
            &[(256, 1), (257, 2), (273, 0), (279, 0)],
            &[0x02, 0x01, 7, 7, 0x00, 0xff],
        );
        for (tag, values) in [(273, [8_u16, 12]), (279, [2, 2])] {
            let entry = [u16::to_le_bytes(tag), u16::to_le_bytes(SHORT)].concat();
            let at = apart.windows(4).position(|bytes| bytes == entry).unwrap();
            apart[at + 4] = 2;
            apart[at + 8..at + 12].copy_from_slice(&values.map(u16::to_le_bytes).concat());
        }
        let cases = [
            (file(false, &[], &[0x02, 0x01, 0x00, 0xff]), true),
            (file(true, &[], &[0x01, 0x02, 0xff, 0x00]), true),
            (odd, false),
            (apart, false),
        ];
        for (bytes, in_place) in cases {
            let mut file = words(&bytes);
            assert_eq!(file.bytes(), bytes);
            let decoded = decode_frame_of(&mut file, &mut vec![5; 9]).unwrap();
            assert_eq!(decoded.frame.samples, samples);
            assert_eq!(decoded, decode_frame(&bytes).unwrap());
            assert_eq!(file.bytes().is_empty(), in_place);
            // The memory comes back whole.
            let memory = decoded.frame.samples.into_memory();
            assert_eq!(memory.len() > 2, in_place);
        }
    }

    #[test]
    fn what_is_no_frame_is_refused_with_its_reason() {
        let cases = [
            (vec![(258, 11)], "found 11 bits per sample"),
            (vec![(258, 32)], "found 32 bits per sample"),
            (vec![(258, 12), (259, 5)], "packed samples are compressed"),
            (vec![(262, 0)], "white is zero"),
            (vec![(262, 3), (258, 8)], "palette"),
            (vec![(262, 32803)], "colour filter array"),
            (vec![(262, 34892), (277, 3)], "has 3 samples a pixel"),
            (vec![(262, 6), (277, 3)], "PhotometricInterpretation is 6"),
            (vec![(277, 2)], "found 2 samples per pixel"),
            (vec![(277, 2), (338, 2)], "alpha"),
            (vec![(339, 3), (258, 8)], "found 8 bits per sample"),
            (vec![(339, 2)], "SampleFormat is 2"),
            (vec![(259, 7)], "Compression is 7"),
            (vec![(266, 2)], "FillOrder is 2"),
            (vec![(274, 6)], "Orientation is 6"),
            (vec![(254, 1)], "thumbnail"),
            (
                vec![(257, 3), (278, 3)],
                "promises 2 x 3 x 1 samples, which 4 bytes",
            ),
            (vec![(256, u32::MAX), (257, u32::MAX)], "TIFF: "),
            (vec![(279, 400)], "cut short"),
            (vec![(273, 40_000)], "cut short"),
        ];
        for (changes, expected) in cases {
            let found = decode_frame(&file(false, &changes, &[0; 4]))
                .unwrap_err()
                .to_string();
            assert!(found.contains(expected), "{expected}: {found}");
        }
    }

    #[test]
    fn planar_colours_are_read_in_full() {
        // Three strips, one for each plane, as a planar file has them.
        let mut out = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut out).unwrap();
        let mut directory = encoder.image_directory().unwrap();
        let offsets = [1_u16, 2, 3].map(|v| directory.write_data(&[v, v][..]).unwrap() as u32);
        for (tag, value) in [
            (Tag::Compression, 1_u16),
            (Tag::PhotometricInterpretation, 2),
            (Tag::SamplesPerPixel, 3),
            (Tag::PlanarConfiguration, 2),
        ] {
            directory.write_tag(tag, value).unwrap();
        }
        directory.write_tag(Tag::ImageWidth, 2_u32).unwrap();
        directory.write_tag(Tag::ImageLength, 1_u32).unwrap();
        directory.write_tag(Tag::RowsPerStrip, 1_u32).unwrap();
        directory
            .write_tag(Tag::BitsPerSample, &[16_u16; 3][..])
            .unwrap();
        directory
            .write_tag(Tag::StripOffsets, &offsets[..])
            .unwrap();
        directory
            .write_tag(Tag::StripByteCounts, &[4_u32; 3][..])
            .unwrap();
        directory.finish().unwrap();
        let frame = decode_frame(out.get_ref()).unwrap().frame;
        assert_eq!(frame.samples, vec![1, 2, 3, 1, 2, 3].into());
    }

    #[test]
    fn a_second_frame_is_refused_and_a_second_thumbnail_is_not() {
        for (subfile, fine) in [(0_u32, false), (1, true)] {
            let mut out = Cursor::new(Vec::new());
            let mut encoder = TiffEncoder::new(&mut out).unwrap();
            encoder
                .write_image::<colortype::Gray16>(2, 1, &[1, 2])
                .unwrap();
            let mut second = encoder.new_image::<colortype::Gray16>(1, 1).unwrap();
            second
                .encoder()
                .write_tag(Tag::NewSubfileType, subfile)
                .unwrap();
            second.write_data(&[3]).unwrap();
            assert_eq!(decode_frame(out.get_ref()).is_ok(), fine, "{subfile}");
        }
    }

    #[test]
    fn compressed_counts_are_the_same_counts() {
        use tiff::encoder::{Compression, DeflateLevel};
        let samples: Vec<u16> = (0..4096_u32).map(|i| (i * i % 65521) as u16).collect();
        for compression in [
            Compression::Lzw,
            Compression::Packbits,
            Compression::Deflate(DeflateLevel::Fast),
        ] {
            let mut out = Cursor::new(Vec::new());
            let mut encoder = TiffEncoder::new(&mut out)
                .unwrap()
                .with_compression(compression);
            encoder
                .write_image::<colortype::Gray16>(64, 64, &samples)
                .unwrap();
            let decoded = decode_frame(out.get_ref()).unwrap();
            assert_eq!(decoded.frame.samples, samples.clone().into());
        }
    }

    #[test]
    fn packed_samples_are_unpacked_row_by_row() {
        // Three samples a row: 5 bytes, of which the last four bits are idle.
        let rows = [0x12, 0x3a, 0xbc, 0xfe, 0xd0, 0x00, 0x1f, 0xff, 0x80, 0x00];
        let changes = [(258, 12), (256, 3), (257, 2), (278, 2)];
        let decoded = decode_frame(&file(false, &changes, &rows)).unwrap();
        assert_eq!(decoded.depth, Depth::Bits(12));
        let expected = vec![0x123, 0xabc, 0xfed, 0x001, 0xfff, 0x800];
        assert_eq!(decoded.frame.samples, expected.into());
    }

    #[test]
    fn fourteen_bits_are_unpacked_too() {
        let values = [0x3fff_u64, 0x0001, 0x2a5a];
        let joined = values.iter().fold(0, |bits, v| bits << 14 | v) << 6;
        let row = &joined.to_be_bytes()[2..];
        let changes = [(258, 14), (256, 3)];
        let decoded = decode_frame(&file(true, &changes, row)).unwrap();
        assert_eq!(decoded.depth, Depth::Bits(14));
        assert_eq!(
            decoded.frame.samples,
            values.map(|v| v as u16).to_vec().into()
        );
    }

    #[test]
    fn floating_point_comes_as_it_is_and_finite() {
        for (value, fine) in [(-1.5_f32, true), (f32::NAN, false)] {
            let mut out = Cursor::new(Vec::new());
            TiffEncoder::new(&mut out)
                .unwrap()
                .write_image::<colortype::Gray32Float>(1, 2, &[0.25, value])
                .unwrap();
            let decoded = decode_frame(out.get_ref());
            assert_eq!(decoded.is_ok(), fine);
            match decoded {
                Ok(decoded) => {
                    assert_eq!(decoded.depth, Depth::Float);
                    assert_eq!(decoded.frame.samples, Samples::F32(vec![0.25, value]));
                }
                Err(error) => assert!(error.to_string().contains("pixel 0, 1: found NaN")),
            }
        }
    }
}

//! PNG frames.

use super::{
    Decoded, Depth, ImageError, LARGEST_RATIO, Oddity, aspect, icc, sample_count, size_to_write,
};
use crate::metadata::{behind_png, png_chunk, tags};
use physics::Frame;
use png::{BitDepth, ColorType, Compression, Decoder, Encoder};
use std::io::{Cursor, Write};

/// Code of a transfer function that is a straight line (ITU-T H.273, table 3).
const STRAIGHT: u8 = 8;

pub(super) fn decode(bytes: &[u8], mut spare: Vec<u16>) -> Result<Decoded, ImageError> {
    let mut reader = Decoder::new(Cursor::new(bytes)).read_info()?;
    let info = reader.info();
    let channels = match info.color_type {
        ColorType::Grayscale => 1,
        ColorType::Rgb => 3,
        ColorType::Indexed => return Err(ImageError::Odd(Oddity::Palette)),
        ColorType::GrayscaleAlpha | ColorType::Rgba => {
            return Err(ImageError::Odd(Oddity::Alpha));
        }
    };
    let bits = match info.bit_depth {
        BitDepth::Eight => 8,
        BitDepth::Sixteen => 16,
        other => return Err(ImageError::Depth(other as u32)),
    };
    if info.trns.is_some() {
        return Err(ImageError::Odd(Oddity::Alpha));
    }
    if info.animation_control.is_some() {
        return Err(ImageError::Odd(Oddity::ManyImages));
    }
    let straight = info
        .gama_chunk
        .is_none_or(|gamma| (gamma.into_value() - 1.0).abs() < 1e-3);
    let profile = info.icc_profile.as_deref();
    let coded = info.coding_independent_code_points;
    let curve = info.srgb.is_some()
        || !straight
        || profile.is_some_and(icc::bends)
        || coded.is_some_and(|code| code.transfer_function != STRAIGHT);
    let turned = png_chunk(bytes, *b"eXIf").and_then(tags::orientation);
    if let Some(orientation) = turned.filter(|orientation| *orientation != 1) {
        return Err(ImageError::Odd(Oddity::Orientation(orientation)));
    }
    if behind_png(bytes).starts_with(b"\x89PNG") {
        return Err(ImageError::Odd(Oddity::ManyImages));
    }
    // Pixels per unit, whatever that is.
    let pixel_aspect = info.pixel_dims.map_or(1.0, |per_unit| {
        aspect(per_unit.yppu.into(), per_unit.xppu.into())
    });
    let (width, height) = (info.width, info.height);
    let size = [width, height, channels];
    let count = sample_count(size, bytes.len() as u64, LARGEST_RATIO, bits)?;
    spare.clear();
    spare.reserve_exact(count);
    let mut samples = spare;
    let mut widen = |stored: &[u8]| {
        if bits == 16 {
            let (pairs, _) = stored.as_chunks::<2>();
            samples.extend(pairs.iter().map(|pair| u16::from_be_bytes(*pair)));
        } else {
            samples.extend(stored.iter().copied().map(u16::from));
        }
    };
    if reader.info().interlaced {
        let mut stored = vec![0; count * bits as usize / 8];
        reader.next_frame(&mut stored)?;
        widen(&stored);
    } else {
        // Row by row: there need not be room for the frame twice.
        for _ in 0..height {
            let row = reader.next_row()?;
            widen(row.as_ref().map_or(&[], |row| row.data()));
        }
    }
    // The rest is read for its checksums alone: a file cut short behind its pixels is damaged.
    reader.finish()?;
    if samples.len() != count {
        return Err(ImageError::Truncated {
            needed: count as u64 * (bits / 8),
            found: samples.len() as u64 * (bits / 8),
        });
    }
    let frame = Frame {
        width: width as usize,
        height: height as usize,
        channels: channels as usize,
        samples: samples.into(),
    };
    Ok(Decoded {
        curve,
        pixel_aspect,
        ..Decoded::plain(frame, Depth::Bits(bits as u16))
    })
}

/// Writes a frame as 16-bit PNG, lightly compressed: noise does not pack.
///
/// # Errors
///
/// [`ImageError`] for a frame that contradicts itself, or what the writer reports.
pub fn encode_png(frame: &Frame, out: impl Write) -> Result<(), ImageError> {
    let (width, height, samples) = size_to_write(frame)?;
    let mut encoder = Encoder::new(out, width, height);
    encoder.set_color(if frame.channels == 1 {
        ColorType::Grayscale
    } else {
        ColorType::Rgb
    });
    encoder.set_depth(BitDepth::Sixteen);
    encoder.set_compression(Compression::Fast);
    let mut writer = encoder.write_header()?;
    let big_endian: Vec<u8> = samples.iter().flat_map(|s| s.to_be_bytes()).collect();
    writer.write_image_data(&big_endian)?;
    writer.finish()?;
    Ok(())
}

/// Writes a picture of at most 256 colours as PNG: `indices`, row by row, into `palette`.
///
/// # Errors
///
/// [`ImageError`] for a picture that contradicts itself, or what the writer reports.
pub fn encode_indexed_png(
    (width, height): (usize, usize),
    indices: &[u8],
    palette: &[[u8; 3]],
    out: impl Write,
) -> Result<(), ImageError> {
    let filled = width.checked_mul(height) == Some(indices.len()) && !indices.is_empty();
    let coloured = indices.iter().all(|i| usize::from(*i) < palette.len());
    let (Ok(columns), Ok(rows), true) = (
        u32::try_from(width),
        u32::try_from(height),
        filled && coloured && palette.len() <= 256,
    ) else {
        return Err(ImageError::Inconsistent {
            width,
            height,
            channels: 1,
            samples: indices.len(),
        });
    };
    let mut encoder = Encoder::new(out, columns, rows);
    encoder.set_color(ColorType::Indexed);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_palette(palette.concat());
    encoder.set_compression(Compression::Balanced);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(indices)?;
    writer.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::decode_frame;
    use super::*;

    fn file(color: ColorType, depth: BitDepth, data: &[u8]) -> Vec<u8> {
        tuned(color, depth, data, |_| {})
    }

    fn tuned(
        color: ColorType,
        depth: BitDepth,
        data: &[u8],
        tune: fn(&mut Encoder<'_, &mut Vec<u8>>),
    ) -> Vec<u8> {
        let mut out = Vec::new();
        let mut encoder = Encoder::new(&mut out, 2, 1);
        encoder.set_color(color);
        encoder.set_depth(depth);
        tune(&mut encoder);
        encoder
            .write_header()
            .unwrap()
            .write_image_data(data)
            .unwrap();
        out
    }

    fn message(bytes: &[u8]) -> String {
        decode_frame(bytes).unwrap_err().to_string()
    }

    #[test]
    fn samples_are_big_endian() {
        let bytes = file(
            ColorType::Grayscale,
            BitDepth::Sixteen,
            &[0x01, 0x02, 0xff, 0x00],
        );
        let samples = vec![0x0102, 0xff00].into();
        assert_eq!(decode_frame(&bytes).unwrap().frame.samples, samples);
    }

    #[test]
    fn what_is_no_frame_is_refused_with_its_reason() {
        use BitDepth::{Eight, Four, Sixteen};
        let cases = [
            (
                file(ColorType::Grayscale, Four, &[1]),
                "found 4 bits per sample",
            ),
            (file(ColorType::Rgba, Sixteen, &[0; 16]), "alpha"),
            (file(ColorType::GrayscaleAlpha, Sixteen, &[0; 8]), "alpha"),
            (
                tuned(ColorType::Indexed, Eight, &[0, 1], |e| {
                    e.set_palette(vec![0; 6]);
                }),
                "palette",
            ),
            (
                tuned(ColorType::Grayscale, Sixteen, &[0; 4], |e| {
                    e.set_trns(vec![0; 2]);
                }),
                "alpha",
            ),
        ];
        for (bytes, expected) in cases {
            let found = message(&bytes);
            assert!(found.contains(expected), "{expected}: {found}");
        }
    }

    #[test]
    fn a_curve_is_refused_whatever_was_stated_and_eight_bits_unless_it_was() {
        use BitDepth::{Eight, Sixteen};
        type Tune = fn(&mut Encoder<'_, &mut Vec<u8>>);
        let curves: [Tune; 2] = [
            |e| e.set_source_srgb(png::SrgbRenderingIntent::Perceptual),
            |e| e.set_source_gamma(png::ScaledFloat::new(0.4545)),
        ];
        for tune in curves {
            let bytes = tuned(ColorType::Grayscale, Sixteen, &[0; 4], tune);
            let error = decode_frame(&bytes).unwrap().linear(true).unwrap_err();
            assert!(error.to_string().contains("transfer curve"), "{error}");
        }
        let straight: Tune = |e| e.set_source_gamma(png::ScaledFloat::new(1.0));
        let bytes = tuned(ColorType::Grayscale, Sixteen, &[0; 4], straight);
        assert!(decode_frame(&bytes).unwrap().linear(false).is_ok());

        let decoded = decode_frame(&file(ColorType::Rgb, Eight, &[1, 2, 3, 4, 5, 255])).unwrap();
        assert_eq!(decoded.depth, Depth::Bits(8));
        let samples = vec![1, 2, 3, 4, 5, 255].into();
        assert_eq!(decoded.clone().linear(true).unwrap().samples, samples);
        assert!(matches!(decoded.linear(false), Err(ImageError::EightBits)));
    }

    /// The crate's own decoder, told to look colours up, finds those that went in.
    #[test]
    fn indexed_colours_come_back() {
        let palette = [[1, 2, 3], [40, 50, 60], [7, 0, 255]];
        let mut bytes = vec![];
        encode_indexed_png((3, 2), &[0, 1, 2, 2, 1, 0], &palette, &mut bytes).unwrap();
        let mut decoder = Decoder::new(Cursor::new(&bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut rgb = vec![0; 18];
        reader.next_frame(&mut rgb).unwrap();
        let expected = [0, 1, 2, 2, 1, 0].map(|i| palette[i]).concat();
        assert_eq!(rgb, expected);
        for (size, indices) in [((3, 2), vec![0; 5]), ((1, 1), vec![3]), ((0, 0), vec![])] {
            assert!(encode_indexed_png(size, &indices, &palette, vec![]).is_err());
        }
    }

    /// The same with a chunk before its pixels.
    fn with_chunk(bytes: &[u8], name: [u8; 4], body: &[u8]) -> Vec<u8> {
        // Behind the signature and IHDR.
        let (head, rest) = bytes.split_at(33);
        let named = [&name[..], body].concat();
        let mut out = head.to_vec();
        out.extend((body.len() as u32).to_be_bytes());
        out.extend(&named);
        out.extend(crc(&named).to_be_bytes());
        out.extend(rest);
        out
    }

    #[test]
    fn pixels_that_are_not_square_say_so() {
        let plain = file(ColorType::Grayscale, BitDepth::Sixteen, &[0; 4]);
        let found = |across: u32, down: u32| {
            let body = [&across.to_be_bytes()[..], &down.to_be_bytes(), &[1]].concat();
            let bytes = with_chunk(&plain, *b"pHYs", &body);
            decode_frame(&bytes).unwrap().pixel_aspect
        };
        // Twice as many to a metre across as down: half as wide as they are high.
        assert_eq!(found(200_000, 100_000), 0.5);
        assert_eq!(found(3937, 3937), 1.0);
        assert_eq!(found(0, 3937), 1.0);
    }

    #[test]
    fn what_a_viewer_would_heed_is_not_passed_over() {
        let plain = file(ColorType::Grayscale, BitDepth::Sixteen, &[0; 4]);
        let pq = decode_frame(&with_chunk(&plain, *b"cICP", &[9, 16, 0, 1])).unwrap();
        let straight = decode_frame(&with_chunk(&plain, *b"cICP", &[1, 8, 0, 1])).unwrap();
        assert!(pq.curve && !straight.curve);
        let mut exif = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".to_vec();
        exif.extend([6, 0, 0, 0, 0, 0, 0, 0]);
        let turned = message(&with_chunk(&plain, *b"eXIf", &exif));
        assert!(turned.contains("Orientation is 6"), "{turned}");
        exif[18] = 1;
        assert!(decode_frame(&with_chunk(&plain, *b"eXIf", &exif)).is_ok());
        let two = message(&[&plain[..], &plain].concat());
        assert!(two.contains("several images"), "{two}");
    }

    #[test]
    fn a_size_that_the_bytes_cannot_hold_allocates_nothing() {
        let mut bytes = file(ColorType::Grayscale, BitDepth::Sixteen, &[0; 4]);
        // IHDR: length, name, width, height, five bytes, checksum.
        bytes[16..20].copy_from_slice(&1_000_000_u32.to_be_bytes());
        bytes[20..24].copy_from_slice(&1_000_000_u32.to_be_bytes());
        let checksum = crc(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
        let found = message(&bytes);
        assert!(found.contains("promises 1000000 x 1000000 x 1"), "{found}");
    }

    /// CRC-32 bit by bit, as in the PNG specification, annex D.
    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |c, _| {
                if c & 1 == 1 {
                    0xedb8_8320 ^ (c >> 1)
                } else {
                    c >> 1
                }
            })
        })
    }
}

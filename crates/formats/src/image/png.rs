//! PNG frames.

use super::{ImageError, LARGEST_RATIO, Oddity, sample_count, size_to_write};
use physics::Frame;
use png::{BitDepth, ColorType, Compression, Decoder, Encoder};
use std::io::{Cursor, Write};

pub(super) fn decode(bytes: &[u8]) -> Result<Frame, ImageError> {
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
    if info.bit_depth != BitDepth::Sixteen {
        return Err(ImageError::Depth(info.bit_depth as u32));
    }
    if info.trns.is_some() {
        return Err(ImageError::Odd(Oddity::Alpha));
    }
    if info.animation_control.is_some() {
        return Err(ImageError::Odd(Oddity::ManyImages));
    }
    let straight = info
        .gama_chunk
        .is_none_or(|gamma| (gamma.into_value() - 1.0).abs() < 1e-3);
    if info.srgb.is_some() || !straight {
        return Err(ImageError::Odd(Oddity::Curve));
    }
    let (width, height) = (info.width, info.height);
    let count = sample_count([width, height, channels], bytes.len() as u64, LARGEST_RATIO)?;
    let mut big_endian = vec![0; 2 * count];
    reader.next_frame(&mut big_endian)?;
    // The rest is read for its checksums alone: a file cut short behind its pixels is damaged.
    reader.finish()?;
    let (pairs, _) = big_endian.as_chunks::<2>();
    Ok(Frame {
        width: width as usize,
        height: height as usize,
        channels: channels as usize,
        samples: pairs.iter().map(|pair| u16::from_be_bytes(*pair)).collect(),
    })
}

/// Writes a frame as 16-bit PNG, lightly compressed: noise does not pack.
///
/// # Errors
///
/// [`ImageError`] for a frame that contradicts itself, or what the writer reports.
pub fn encode_png(frame: &Frame, out: impl Write) -> Result<(), ImageError> {
    let (width, height) = size_to_write(frame)?;
    let mut encoder = Encoder::new(out, width, height);
    encoder.set_color(if frame.channels == 1 {
        ColorType::Grayscale
    } else {
        ColorType::Rgb
    });
    encoder.set_depth(BitDepth::Sixteen);
    encoder.set_compression(Compression::Fast);
    let mut writer = encoder.write_header()?;
    let big_endian: Vec<u8> = frame.samples.iter().flat_map(|s| s.to_be_bytes()).collect();
    writer.write_image_data(&big_endian)?;
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
        assert_eq!(decode_frame(&bytes).unwrap().samples, [0x0102, 0xff00]);
    }

    #[test]
    fn what_is_no_frame_is_refused_with_its_reason() {
        use BitDepth::{Eight, Sixteen};
        let cases = [
            (
                file(ColorType::Grayscale, Eight, &[1, 2]),
                "found 8 bits per sample",
            ),
            (
                file(ColorType::Rgb, Eight, &[0; 6]),
                "found 8 bits per sample",
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
            (
                tuned(ColorType::Grayscale, Sixteen, &[0; 4], |e| {
                    e.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
                }),
                "transfer curve",
            ),
            (
                tuned(ColorType::Grayscale, Sixteen, &[0; 4], |e| {
                    e.set_source_gamma(png::ScaledFloat::new(0.4545));
                }),
                "transfer curve",
            ),
        ];
        for (bytes, expected) in cases {
            let found = message(&bytes);
            assert!(found.contains(expected), "{expected}: {found}");
        }
        let linear = tuned(ColorType::Grayscale, Sixteen, &[0; 4], |e| {
            e.set_source_gamma(png::ScaledFloat::new(1.0));
        });
        assert!(decode_frame(&linear).is_ok());
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

//! PGM and PPM frames, binary.

use super::{Decoded, Depth, ImageError, sample_count};
use physics::Frame;

const FORMAT: &str = "PGM/PPM";

pub(super) fn decode(bytes: &[u8]) -> Result<Decoded, ImageError> {
    let channels = if bytes[1] == b'5' { 1 } else { 3 };
    let mut rest = &bytes[2..];
    let width = number(&mut rest)?;
    let height = number(&mut rest)?;
    let maximum = number(&mut rest)?;
    let maximum = match u16::try_from(maximum) {
        Ok(maximum @ 1..) => maximum,
        _ => return Err(header("the largest value is not from 1 to 65535")),
    };
    // One blank, and one only, stands before the pixels.
    let pixels = match rest {
        [b' ' | b'\t'..=b'\r', pixels @ ..] => pixels,
        _ => return Err(header("no blank stands before the pixels")),
    };
    let size = [width, height, channels];
    let (needed, count) = {
        let bits = if maximum > 255 { 16 } else { 8 };
        let samples = u64::from(width) * u64::from(height);
        let needed = samples.saturating_mul(u64::from(channels) * bits / 8);
        if needed > pixels.len() as u64 {
            let before = (bytes.len() - pixels.len()) as u64;
            return Err(ImageError::Truncated {
                needed: needed.saturating_add(before),
                found: bytes.len() as u64,
            });
        }
        let count = sample_count(size, pixels.len() as u64, 1, bits)?;
        (needed as usize, count)
    };
    if count == 0 {
        return Err(header("the picture has no pixel"));
    }
    if pixels.len() > needed {
        return Err(ImageError::Behind(pixels.len() - needed));
    }
    let samples: Vec<u16> = if maximum > 255 {
        let (pairs, _) = pixels.as_chunks::<2>();
        pairs.iter().map(|pair| u16::from_be_bytes(*pair)).collect()
    } else {
        pixels.iter().map(|sample| u16::from(*sample)).collect()
    };
    if let Some(at) = samples.iter().position(|sample| *sample > maximum) {
        let (pixel, width) = (at / channels as usize, width as usize);
        return Err(ImageError::Sample {
            column: pixel % width,
            row: pixel / width,
            found: samples[at].into(),
            expected: "at most the largest value that the header announces",
        });
    }
    if maximum > 255 {
        check_order(&samples)?;
    }
    let frame = Frame {
        width: width as usize,
        height: height as usize,
        channels: channels as usize,
        samples: samples.into(),
    };
    // As many as the largest value takes: counts up to 4095 are not those of 16 bits.
    let depth = Depth::Bits((u16::BITS - maximum.leading_zeros()).max(8) as u16);
    Ok(Decoded {
        white_level_dn: (255 < maximum && maximum < u16::MAX).then(|| f64::from(maximum)),
        ..Decoded::plain(frame, depth)
    })
}

/// How many times smoother a picture has to be with its bytes exchanged to be one of those.
const SMOOTHER: f64 = 4.0;

/// Refuses samples whose low byte comes first: some programs write them so, against the format. A
/// step of one count is then one of 256, and noise, which fills the low byte, most of the range.
fn check_order(samples: &[u16]) -> Result<(), ImageError> {
    // Counts of 8 bits in the high byte are as likely as their exchange.
    if samples.iter().all(|sample| sample & 0xff == 0) {
        return Ok(());
    }
    let mean = |of: fn(u16) -> u16| {
        let steps = samples.windows(2);
        let sum: u64 = steps.map(|s| u64::from(of(s[0]).abs_diff(of(s[1])))).sum();
        sum as f64 / samples.len() as f64
    };
    let (found, swapped) = (mean(|sample| sample), mean(u16::swap_bytes));
    if found > SMOOTHER * swapped {
        return Err(ImageError::ByteOrder { found, swapped });
    }
    Ok(())
}

fn header(what: &'static str) -> ImageError {
    ImageError::Header {
        format: FORMAT,
        what,
    }
}

/// The next number of the header, behind blanks and comments, which it takes off `rest`.
fn number(rest: &mut &[u8]) -> Result<u32, ImageError> {
    loop {
        match *rest {
            [b' ' | b'\t'..=b'\r', behind @ ..] => *rest = behind,
            [b'#', ..] => {
                let end = rest.iter().position(|b| matches!(b, b'\n' | b'\r'));
                *rest = &rest[end.unwrap_or(rest.len())..];
            }
            _ => break,
        }
    }
    let digits = rest.iter().take_while(|b| b.is_ascii_digit()).count();
    let (text, behind) = rest.split_at(digits);
    *rest = behind;
    std::str::from_utf8(text)
        .ok()
        .and_then(|text| text.parse().ok())
        .ok_or_else(|| header("width, height or largest value is no whole number"))
}

#[cfg(test)]
mod tests {
    use super::super::decode_frame;
    use super::*;

    #[test]
    fn gray_and_colour_in_both_widths() {
        let cases: [(&[u8], usize, &[u16], u16); 3] = [
            (
                b"P5 # a comment\n2 1\n# 9 9\n255\n\x01\xff",
                1,
                &[1, 255],
                8,
            ),
            (b"P5\n1 2\t4095\r\x01\x02\x0f\xff", 1, &[0x0102, 4095], 12),
            (b"P6 1 1 255 \x01\x02\x03", 3, &[1, 2, 3], 8),
        ];
        for (bytes, channels, samples, bits) in cases {
            let decoded = decode_frame(bytes).unwrap();
            assert_eq!(decoded.frame.channels, channels);
            assert_eq!(decoded.frame.samples, samples.to_vec().into());
            assert_eq!(decoded.depth, Depth::Bits(bits));
        }
    }

    #[test]
    fn the_low_byte_first_is_noticed() {
        // A slope with noise, in steps of 16 as of 12 bits in the high ones, and a flat dark.
        let noise = |i: u16| (i.wrapping_mul(40503) >> 12) % 7;
        let pictures: [Vec<u16>; 3] = [
            (0..900).map(|i| 40 * i + noise(i)).collect(),
            (0..900).map(|i| 16 * (2 * i + noise(i))).collect(),
            (0..900).map(|i| 252 + noise(i)).collect(),
        ];
        for picture in pictures {
            let of = |bytes: fn(u16) -> [u8; 2]| {
                let pixels = picture.iter().flat_map(|s| bytes(*s));
                let file: Vec<u8> = b"P5 30 30 65535\n".iter().copied().chain(pixels).collect();
                decode_frame(&file)
            };
            assert!(of(u16::to_be_bytes).is_ok());
            let found = of(u16::to_le_bytes).unwrap_err().to_string();
            assert!(found.contains("expected the high byte first"), "{found}");
        }
    }

    #[test]
    fn faults_are_named() {
        let cases: [(&[u8], &str); 8] = [
            (b"P5 2 1 255\n\x01", "its data reach to byte 13"),
            (b"P5 2 1 255\n\x01\x02\x03", "1 bytes behind"),
            (b"P5 2 1 70000\n\x01\x02", "not from 1 to 65535"),
            (b"P5 2 1 0\n\x01\x02", "not from 1 to 65535"),
            (b"P5 0 1 255\n", "no pixel"),
            (b"P5 x 1 255\n", "no whole number"),
            (b"P5 2 1 100\n\x64\x65", "pixel 1, 0: found 101"),
            (b"P6 4294967295 4294967295 65535\n\x01", "cut short"),
        ];
        for (bytes, expected) in cases {
            let found = decode_frame(bytes).unwrap_err().to_string();
            assert!(found.contains(expected), "{expected}: {found}");
        }
    }
}

//! FITS frames: the primary picture, integers with BZERO and BSCALE, or floating point.
//!
//! Rows stay in the order of the file, whose first row many programs show at the bottom.

use super::{Decoded, Depth, ImageError, Oddity, aspect, check_finite, interleaved, sample_count};
use crate::fits_header::{BLOCK, Header};
use physics::{Frame, Mosaic, Samples};

pub(super) fn decode(bytes: &[u8]) -> Result<Decoded, ImageError> {
    let header = Header::read(bytes).ok_or(ImageError::Header {
        format: "FITS",
        what: "the header has no END card",
    })?;
    if header.value("ZIMAGE").is_some() {
        return Err(ImageError::Odd(Oddity::CompressedFits));
    }
    let mosaic = mosaic(&header)?;
    let bits = whole(&header, "BITPIX", "8, 16, 32, -32 or -64")?;
    if !matches!(bits, 8 | 16 | 32 | -32 | -64) {
        return Err(wrong(&header, "BITPIX", "8, 16, 32, -32 or -64"));
    }
    let axes = whole(&header, "NAXIS", "2 (gray) or 3 (colours)")?;
    if axes == 0 && bytes[header.end.min(bytes.len())..].starts_with(b"XTENSION") {
        return Err(ImageError::Odd(Oddity::FitsExtension));
    }
    if !matches!(axes, 2 | 3) {
        return Err(wrong(&header, "NAXIS", "2 (gray) or 3 (colours)"));
    }
    let width = length(&header, "NAXIS1")?;
    let height = length(&header, "NAXIS2")?;
    let planes = if axes == 3 {
        length(&header, "NAXIS3")?
    } else {
        1
    };
    let colours = header
        .value("CTYPE3")
        .is_some_and(|kind| kind.eq_ignore_ascii_case("RGB"));
    match planes {
        1 => {}
        3 if colours => {}
        _ => return Err(ImageError::Odd(Oddity::Cube)),
    }
    let size = [width, height, planes];
    let bytes_per_sample = bits.unsigned_abs() / 8;
    let needed = size
        .iter()
        .map(|n| u64::from(*n))
        .try_fold(bytes_per_sample, u64::checked_mul)
        .and_then(|n| n.checked_add(header.end as u64))
        .unwrap_or(u64::MAX);
    if needed > bytes.len() as u64 {
        return Err(ImageError::Truncated {
            needed,
            found: bytes.len() as u64,
        });
    }
    let data = &bytes[header.end..needed as usize];
    let count = sample_count(size, data.len() as u64, 1, bits.unsigned_abs())?;
    if count == 0 {
        let empty = if width == 0 { "NAXIS1" } else { "NAXIS2" };
        return Err(wrong(&header, empty, "at least one pixel"));
    }
    // Blocks of zeros may follow, or an extension with another picture.
    let behind = bytes.get((needed as usize).div_ceil(BLOCK) * BLOCK..);
    if behind.is_some_and(|behind| behind.starts_with(b"XTENSION= 'IMAGE")) {
        return Err(ImageError::Odd(Oddity::ManyImages));
    }
    let zero = scaling(&header, "BZERO", 0.0)?;
    let scale = scaling(&header, "BSCALE", 1.0)?;
    if scale == 0.0 {
        return Err(wrong(&header, "BSCALE", "a number other than 0"));
    }
    // BLANK is a stored number, before it is scaled.
    let blank = match header.card("BLANK") {
        Some(_) if bits > 0 => {
            let stored = whole(&header, "BLANK", "a whole number")?;
            Some(stored as f64 * scale + zero)
        }
        _ => None,
    };

    let scaled = |stored: f64| stored * scale + zero;
    let samples = match bits {
        8 => read(data, blank, |[b]: [u8; 1]| scaled(b.into())),
        16 => read(data, blank, |b| scaled(i16::from_be_bytes(b).into())),
        32 => read(data, blank, |b| scaled(i32::from_be_bytes(b).into())),
        -32 => Ok(floats(data, |b| scaled(f32::from_be_bytes(b).into()))),
        _ => Ok(floats(data, |b| scaled(f64::from_be_bytes(b)))),
    };
    let samples = samples.map_err(|(at, found)| {
        let (at, width) = (at % (count / planes as usize), width as usize);
        ImageError::Sample {
            column: at % width,
            row: at / width,
            found,
            expected: "a count, and the header calls this value BLANK",
        }
    })?;
    let samples = match samples {
        Samples::U16(samples) if planes == 3 => interleaved(&samples).into(),
        Samples::F32(samples) if planes == 3 => Samples::F32(interleaved(&samples)),
        gray => gray,
    };
    let frame = Frame {
        width: width as usize,
        height: height as usize,
        channels: planes as usize,
        samples,
    };
    check_finite(&frame)?;
    let depth = if bits > 0 {
        Depth::Bits(bits as u16)
    } else {
        Depth::Float
    };
    Ok(Decoded {
        // Files of colours keep the card of the mosaic that they were made of.
        mosaic: mosaic.filter(|_| axes == 2),
        pixel_aspect: pixel_aspect(&header),
        ..Decoded::plain(frame, depth)
    })
}

/// Stored integers; those that a camera could have counted stay whole. Looked at twice, so that
/// no picture of 64-bit numbers stands between. The error is the place and value of a blank one.
fn read<const N: usize>(
    data: &[u8],
    blank: Option<f64>,
    value: impl Fn([u8; N]) -> f64,
) -> Result<Samples, (usize, f64)> {
    let (stored, _) = data.as_chunks::<N>();
    let mut counts = true;
    for (at, bytes) in stored.iter().enumerate() {
        let value = value(*bytes);
        if Some(value) == blank {
            return Err((at, value));
        }
        counts &= value.fract() == 0.0 && (0.0..=65535.0).contains(&value);
    }
    Ok(if counts {
        let counts: Vec<u16> = stored.iter().map(|bytes| value(*bytes) as u16).collect();
        counts.into()
    } else {
        floats(data, value)
    })
}

fn floats<const N: usize>(data: &[u8], value: impl Fn([u8; N]) -> f64) -> Samples {
    let (stored, _) = data.as_chunks::<N>();
    Samples::F32(stored.iter().map(|bytes| value(*bytes) as f32).collect())
}

fn wrong(header: &Header<'_>, keyword: &'static str, expected: &'static str) -> ImageError {
    ImageError::Fits {
        keyword,
        found: header.value(keyword).unwrap_or("missing").to_owned(),
        expected,
    }
}

fn whole(
    header: &Header<'_>,
    keyword: &'static str,
    expected: &'static str,
) -> Result<i64, ImageError> {
    let value = header.value(keyword).and_then(|value| value.parse().ok());
    value.ok_or_else(|| wrong(header, keyword, expected))
}

fn length(header: &Header<'_>, keyword: &'static str) -> Result<u32, ImageError> {
    let expected = "a number of pixels";
    let value = whole(header, keyword, expected)?;
    u32::try_from(value).map_err(|_| wrong(header, keyword, expected))
}

fn scaling(header: &Header<'_>, keyword: &'static str, default: f64) -> Result<f64, ImageError> {
    match header.card(keyword) {
        None => Ok(default),
        Some(card) => card
            .number()
            .ok_or_else(|| wrong(header, keyword, "a finite number")),
    }
}

/// The pattern of a colour filter array, as the programs of astronomers write it: from the first
/// row in the file on, or shifted by `XBAYROFF` and `YBAYROFF`.
fn mosaic(header: &Header<'_>) -> Result<Option<Mosaic>, ImageError> {
    let Some(pattern) = header.value("BAYERPAT") else {
        return Ok(None);
    };
    let text = |value: &str| value.trim_matches('\'').trim().to_uppercase();
    if header
        .value("ROWORDER")
        .is_some_and(|order| text(order) == "BOTTOM-UP")
    {
        return Err(ImageError::Odd(Oddity::RowOrder));
    }
    let pattern: Mosaic = text(pattern)
        .parse()
        .map_err(|_| ImageError::Odd(Oddity::Pattern))?;
    let offset = |card: &str| {
        let number = header.card(card).and_then(|card| card.number());
        number.map_or(0, |n| (n as i64).rem_euclid(pattern.side() as i64) as usize)
    };
    Ok(Some(
        pattern.shifted(offset("XBAYROFF"), offset("YBAYROFF")),
    ))
}

/// Width of a pixel over its height, from the size of the sensor's or else of what they show.
fn pixel_aspect(header: &Header<'_>) -> f64 {
    // Steps of a wavelength and an angle do not compare.
    let alike = header.value("CUNIT1") == header.value("CUNIT2");
    let number = |keyword| header.card(keyword).and_then(|card| card.number());
    [
        ("XPIXSZ", "YPIXSZ"),
        ("PIXSIZE1", "PIXSIZE2"),
        ("CDELT1", "CDELT2"),
    ]
    .into_iter()
    .filter(|(across, _)| alike || *across != "CDELT1")
    // Right ascension runs to the left: its step is negative.
    .find_map(|(across, down)| Some(aspect(number(across)?.abs(), number(down)?.abs())))
    .unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::super::decode_frame;
    use super::*;

    fn file(cards: &[&str], data: &[u8]) -> Vec<u8> {
        let mut out = format!("{:80}", "SIMPLE  =                    T");
        for card in cards.iter().chain(&["END"]) {
            out += &format!("{card:80}");
        }
        let mut out = out.into_bytes();
        out.resize(out.len().div_ceil(BLOCK) * BLOCK, b' ');
        out.extend(data);
        out.resize(out.len().div_ceil(BLOCK) * BLOCK, 0);
        out
    }

    const ROW: [&str; 3] = ["NAXIS   = 2", "NAXIS1  = 2", "NAXIS2  = 1"];

    fn row(cards: &[&str], data: &[u8]) -> Result<Decoded, ImageError> {
        decode_frame(&file(&[&ROW, cards].concat(), data))
    }

    #[test]
    fn integers_are_shifted_and_scaled() {
        let unsigned = row(
            &["BITPIX  = 16", "BZERO   = 32768"],
            &[0x80, 0x01, 0x7f, 0xff],
        )
        .unwrap();
        assert_eq!(unsigned.frame.samples, Samples::from(vec![1, 65535]));
        let signed = row(&["BITPIX  = 16"], &[0xff, 0xff, 0, 7]).unwrap();
        assert_eq!(signed.frame.samples, Samples::F32(vec![-1.0, 7.0]));
        let scaled = row(&["BITPIX  = 8", "BSCALE  = 0.5"], &[1, 2]).unwrap();
        assert_eq!(scaled.frame.samples, Samples::F32(vec![0.5, 1.0]));
        let long = row(&["BITPIX  = 32"], &[0, 1, 0, 0, 0, 0, 0, 1]).unwrap();
        assert_eq!(long.frame.samples, Samples::F32(vec![65536.0, 1.0]));
    }

    #[test]
    fn pixels_that_are_not_square_say_so() {
        let found = |cards: &[&str]| {
            let cards = [&["BITPIX  = 8"], cards].concat();
            row(&cards, &[1, 2]).unwrap().pixel_aspect
        };
        assert_eq!(found(&["XPIXSZ  = 7.5", "YPIXSZ  = 5.0"]), 1.5);
        assert_eq!(found(&["CDELT1  = -0.002", "CDELT2  = 0.001"]), 2.0);
        // The sensor's own size comes first.
        let both = ["CDELT1  = 3.0", "CDELT2  = 1.0", "PIXSIZE1= 6.0"];
        assert_eq!(found(&[&both[..], &["PIXSIZE2= 4.0"]].concat()), 1.5);
        // A spectrum along a slit, one step alone, and none that could be.
        let units = ["CUNIT1  = 'nm'", "CUNIT2  = 'arcsec'"];
        assert_eq!(found(&[&both[..2], &units].concat()), 1.0);
        assert_eq!(found(&["CDELT1  = 2.0"]), 1.0);
        assert_eq!(found(&["CDELT1  = 2.0", "CDELT2  = 0.0"]), 1.0);
    }

    #[test]
    fn floating_point_of_both_lengths() {
        let data: Vec<u8> = [1.5_f32, -2.0]
            .iter()
            .flat_map(|v| v.to_be_bytes())
            .collect();
        let short = row(&["BITPIX  = -32"], &data).unwrap();
        assert_eq!(short.frame.samples, Samples::F32(vec![1.5, -2.0]));
        let data: Vec<u8> = [1.5_f64, -2.0]
            .iter()
            .flat_map(|v| v.to_be_bytes())
            .collect();
        let long = row(&["BITPIX  = -64"], &data).unwrap();
        assert_eq!(long.frame.samples, Samples::F32(vec![1.5, -2.0]));
    }

    #[test]
    fn what_is_no_frame_is_refused_with_its_reason() {
        let nan = f32::NAN.to_be_bytes();
        let nan = [nan, nan].concat();
        let cases: [(&[&str], &[u8], &str); 9] = [
            (&["BITPIX  = 24"], &[0; 8], "BITPIX is 24"),
            (&[], &[0; 8], "BITPIX is missing"),
            (
                &["BITPIX  = 8", "BAYERPAT= 'CMYG'"],
                &[0; 8],
                "colour filter array",
            ),
            (&["BITPIX  = 8", "ZIMAGE  = T"], &[0; 8], "funpack"),
            (
                &["BITPIX  = 8", "BLANK   = 2"],
                &[1, 2],
                "pixel 1, 0: found 2",
            ),
            (&["BITPIX  = 8", "BZERO   = x"], &[1, 2], "BZERO is x"),
            (&["BITPIX  = 8", "BSCALE  = 0"], &[1, 2], "BSCALE is 0"),
            (&["BITPIX  = -32"], &nan, "pixel 0, 0: found NaN"),
            (&["BITPIX  = 16"], &[], "cut short"),
        ];
        for (cards, data, expected) in cases {
            let found = row(cards, data).unwrap_err().to_string();
            assert!(found.contains(expected), "{expected}: {found}");
        }
        let cube = [
            "BITPIX  = 8",
            "NAXIS   = 3",
            "NAXIS1  = 1",
            "NAXIS2  = 1",
            "NAXIS3  = 3",
        ];
        let found = decode_frame(&file(&cube, &[1, 2, 3]))
            .unwrap_err()
            .to_string();
        assert!(found.contains("cube"), "{found}");
        let rgb = file(&[&cube[..], &["CTYPE3  = 'RGB'"]].concat(), &[1, 2, 3]);
        assert_eq!(decode_frame(&rgb).unwrap().frame.channels, 3);
        let huge = [
            "BITPIX  = 16",
            "NAXIS   = 2",
            "NAXIS1  = 2147483648",
            "NAXIS2  = 2147483648",
        ];
        let found = decode_frame(&file(&huge, &[0; 8])).unwrap_err().to_string();
        assert!(found.contains("cut short"), "{found}");
    }
}

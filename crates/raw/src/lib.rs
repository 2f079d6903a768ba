//! Camera RAW (CR2, CR3, NEF, ARW, RAF, compressed DNG) as frames of counts.
//!
//! The decoders are those of `rawler`, the one dependency of ours under a copyleft licence (LGPL
//! 2.1), so they stand in a crate of their own behind a feature that is off by default. Nothing is
//! developed: what comes out are the counts of the active part of the sensor, with the pattern of
//! its colour filter array.
//!
//! `rawler` reads what cameras wrote and may panic on what they did not: every call is contained,
//! and no size of a picture is trusted before the length of the file has vouched for it. It believes
//! the counts of TIFF tags, though, so hand it what `formats` has looked through and named camera RAW.

#![cfg(feature = "rawler")]

use physics::{Frame, Mosaic, Samples};
use rawler::decoders::RawDecodeParams;
use rawler::rawimage::{RawImage, RawImageData, RawPhotometricInterpretation};
use rawler::rawsource::RawSource;
use std::panic::{AssertUnwindSafe, catch_unwind};
use thiserror::Error;

/// A RAW file as a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct RawFrame {
    /// The counts of the active part of the sensor, one a photosite.
    pub frame: Frame,
    /// The colours of the photosites; none for a sensor without a filter array.
    pub mosaic: Option<Mosaic>,
    /// Bits of a count, as the camera states them.
    pub bits: u16,
    /// Mean of the black levels that the camera states, DN.
    pub black_level_dn: f64,
    /// Least of the white levels that the camera states, DN.
    pub white_level_dn: f64,
}

/// A RAW file cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RawError {
    /// The decoder refused, or gave up.
    #[error("camera RAW: {0}")]
    Decoder(#[from] rawler::RawlerError),
    /// The decoder failed in a way that it should not.
    #[error(
        "camera RAW: the decoder failed; the file is damaged, or of a kind that it does not know: convert it to uncompressed DNG"
    )]
    Panic,
    /// The header promises more pixels than the bytes can hold.
    #[error(
        "camera RAW: the header promises {width} x {height} x {samples} samples, which {bytes} \
         bytes cannot hold: the file is damaged"
    )]
    Oversized {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// Samples per pixel.
        samples: usize,
        /// Length of the file.
        bytes: usize,
    },
    /// A roll of pictures.
    #[error(
        "camera RAW: the file holds {0} pictures; expected one frame a file, each with its exposure time: take them out of the roll"
    )]
    ManyImages(usize),
    /// Counts that are not one for each photosite.
    #[error("camera RAW: found {0} samples per pixel, expected 1: the file was demosaiced already")]
    Developed(usize),
    /// A filter array of other colours.
    #[error("camera RAW: the colour filter array is {0}, expected a square of R, G and B")]
    Pattern(String),
    /// The part that light falls on does not lie inside the picture, or holds nothing.
    #[error("camera RAW: the active part of the sensor lies outside of it: the file is damaged")]
    ActiveArea,
}

/// No coder of a camera stores a count in less than half of a bit.
const LARGEST_RATIO: usize = 32;

/// The counts in the RAW file `bytes`.
///
/// # Errors
///
/// [`RawError`]: a camera that is not known, a damaged file, one of several pictures, or one that
/// was developed.
pub fn decode(bytes: &[u8]) -> Result<RawFrame, RawError> {
    let source = RawSource::new_from_slice(bytes);
    let count = contained(|| rawler::get_decoder(&source)?.raw_image_count())?;
    if count > 1 {
        return Err(RawError::ManyImages(count));
    }
    // Without its pixels, so that a size is seen before memory is asked for it.
    let header = contained(|| rawler::decode_dummy(&source))?;
    check_size(&header, bytes.len())?;
    let image = contained(|| rawler::decode(&source, &RawDecodeParams::default()))?;
    check_size(&image, bytes.len())?;
    frame(&image)
}

/// What `decoder` gives, its panics turned into errors.
fn contained<T>(decoder: impl FnOnce() -> rawler::Result<T>) -> Result<T, RawError> {
    match catch_unwind(AssertUnwindSafe(decoder)) {
        Ok(result) => Ok(result?),
        Err(_) => Err(RawError::Panic),
    }
}

fn check_size(image: &RawImage, bytes: usize) -> Result<(), RawError> {
    let RawImage {
        width, height, cpp, ..
    } = *image;
    let fits = width
        .checked_mul(height)
        .and_then(|pixels| pixels.checked_mul(cpp))
        .is_some_and(|samples| samples <= bytes.saturating_mul(LARGEST_RATIO));
    if fits {
        Ok(())
    } else {
        Err(RawError::Oversized {
            width,
            height,
            samples: cpp,
            bytes,
        })
    }
}

fn frame(image: &RawImage) -> Result<RawFrame, RawError> {
    if image.cpp != 1 {
        return Err(RawError::Developed(image.cpp));
    }
    let mosaic = match &image.photometric {
        RawPhotometricInterpretation::Cfa(config) => {
            let cfa = &config.cfa;
            let pattern = Mosaic::from_colours(&cfa.flat_pattern()).ok();
            let square = pattern.filter(|p| p.side() == cfa.width && p.side() == cfa.height);
            Some(square.ok_or_else(|| RawError::Pattern(cfa.name.clone()))?)
        }
        _ => None,
    };
    let (width, height) = (image.width, image.height);
    let [left, top, right, bottom] = match image.active_area {
        Some(area) => [
            area.p.x,
            area.p.y,
            area.p.x.saturating_add(area.d.w),
            area.p.y.saturating_add(area.d.h),
        ],
        None => [0, 0, width, height],
    };
    if left >= right || top >= bottom || right > width || bottom > height {
        return Err(RawError::ActiveArea);
    }
    fn cut<T: Copy>(all: &[T], width: usize, columns: [usize; 2], rows: [usize; 2]) -> Vec<T> {
        all.chunks_exact(width)
            .take(rows[1])
            .skip(rows[0])
            .flat_map(|row| row[columns[0]..columns[1]].iter().copied())
            .collect()
    }
    let (columns, rows) = ([left, right], [top, bottom]);
    let samples = match &image.data {
        RawImageData::Integer(all) => cut(all, width, columns, rows).into(),
        RawImageData::Float(all) => Samples::F32(cut(all, width, columns, rows)),
    };
    let frame = Frame {
        width: right - left,
        height: bottom - top,
        channels: 1,
        samples,
    };
    if frame.samples.len() != frame.width * frame.height {
        return Err(RawError::ActiveArea);
    }
    let blacks = image.blacklevel.as_vec();
    let black = blacks.iter().map(|b| f64::from(*b)).sum::<f64>() / blacks.len().max(1) as f64;
    let whites = image.whitelevel.0.iter().copied();
    Ok(RawFrame {
        frame,
        mosaic: mosaic.map(|mosaic| {
            if image.camera.mode == "dng" {
                // That of a DNG begins with the active part; rawler shifts it by as much, which is
                // a step back for cells of 2 only, so that it has to be gone on to the whole cell.
                let on = |by: usize| (mosaic.side() - by % mosaic.side()) % mosaic.side();
                mosaic.shifted(on(left), on(top))
            } else {
                // Others of rawler's begin with the first photosite of the whole sensor.
                mosaic.shifted(left, top)
            }
        }),
        bits: image.bps.clamp(1, 16) as u16,
        black_level_dn: black,
        white_level_dn: whites.min().map_or(f64::from(u16::MAX), f64::from),
    })
}

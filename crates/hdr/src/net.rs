//! A frame less its dark, and what two of them say of each other.

use crate::dark::{DarkFrame, check_exposure, check_frame, size};
use crate::error::MergeError;
use crate::lanes::largest_of;
use physics::Frame;

/// Share of the range from black to white up to which two frames are compared: beyond it many a
/// sensor bends, and noise reaches the white level.
const FULL: f64 = 0.9;

/// Samples of a frame that are enough to compare it with another. Of a larger one, bands of rows
/// are taken, high enough for the gradients of a shift.
const ENOUGH: usize = 1 << 20;

/// Rows of a band.
const BAND: usize = 8;

/// At most so many bands are skipped between two: a small bright spot must not fall between.
const SKIP: usize = 7;

/// Samples of a row that are passed over together where all are dim.
const CHUNK: usize = 64;

/// The rows of a frame of this size by which it is compared.
pub(crate) fn rows(
    (width, height, channels): (usize, usize, usize),
) -> impl Iterator<Item = usize> {
    let samples = width * height * channels;
    let step = samples.div_ceil(ENOUGH).clamp(1, SKIP + 1);
    (0..height).filter(move |row| (row / BAND).is_multiple_of(step))
}

/// Memory of frames that were compared, for the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spare {
    value: Vec<f32>,
    dark: Vec<f32>,
}

impl Spare {
    /// That of a frame that is needed no more, without its dark.
    pub(crate) fn take_back(&mut self, net: Net) {
        self.value = net.value;
    }

    /// That of the dark of a frame which is to be the shorter one of a pair, of which nobody asks it.
    pub(crate) fn take_dark(&mut self, net: &mut Net) {
        self.dark = std::mem::take(&mut net.dark);
    }
}

/// A frame less its dark, in DN, and the dark itself, in the rows by which it is compared. A
/// saturated sample is NaN, which no comparison lets through.
#[derive(Clone, Debug)]
pub(crate) struct Net {
    pub(crate) size: (usize, usize, usize),
    pub(crate) exposure_s: f64,
    /// Row after row of [`rows`].
    value: Vec<f32>,
    /// Likewise; none once it was taken.
    dark: Vec<f32>,
    pub(crate) darks: u32,
}

impl Net {
    /// `frame` less `dark`, in the memory of `spare`; samples at or above `white_dn` are saturated.
    pub(crate) fn new(
        frame: &Frame,
        dark: &DarkFrame,
        exposure_s: f64,
        white_dn: f64,
        spare: Spare,
    ) -> Result<Self, MergeError> {
        check_exposure(exposure_s)?;
        check_frame(frame)?;
        let size = size(frame);
        if dark.size() != size {
            return Err(MergeError::DarkSize {
                dark: dark.size(),
                frame: size,
            });
        }
        let white = white_dn as f32;
        let length = frame.width * frame.channels;
        let samples = length * rows(dark.size()).count();
        let Spare {
            mut value,
            dark: mut level,
        } = spare;
        value.resize(samples, 0.0);
        level.resize(samples, 0.0);
        let into = value
            .chunks_exact_mut(length)
            .zip(level.chunks_exact_mut(length));
        for (row, (value, level)) in rows(dark.size()).zip(into) {
            let here = row * length..(row + 1) * length;
            frame.samples.copy_to(here.clone(), value);
            dark.copy_mean_to(here, level);
            for (value, level) in value.iter_mut().zip(level) {
                *value = if *value < white {
                    *value - *level
                } else {
                    f32::NAN
                };
            }
        }
        Ok(Self {
            size: dark.size(),
            exposure_s,
            value,
            dark: level,
            darks: dark.count(),
        })
    }
}

/// Two exposures of one scene, sample by sample.
#[derive(Clone, Copy)]
pub(crate) struct Pair<'a> {
    pub(crate) short: &'a Net,
    pub(crate) long: &'a Net,
    limit_dn: f32,
}

/// One sample of a pair.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Both {
    /// Its row.
    pub(crate) row: usize,
    /// Where it is among the interleaved samples of the row.
    pub(crate) at: usize,
    /// What the samples beside it in the row let expect of the long frame, DN over dark.
    pub(crate) expected: f32,
    /// The short frame, DN over dark.
    pub(crate) short: f32,
    /// The long frame, DN over dark.
    pub(crate) long: f32,
    /// The darks of both, DN; 0 for one that was taken.
    pub(crate) darks: [f32; 2],
}

impl<'a> Pair<'a> {
    /// Two frames of one size.
    pub(crate) fn new(
        short: &'a Net,
        long: &'a Net,
        black_dn: f64,
        white_dn: f64,
    ) -> Result<Self, MergeError> {
        if short.size != long.size {
            return Err(MergeError::Size {
                found: long.size,
                expected: short.size,
            });
        }
        Ok(Self {
            short,
            long,
            limit_dn: (black_dn + FULL * (white_dn - black_dn)) as f32,
        })
    }

    /// The long exposure over the short one, as stated.
    pub(crate) fn nominal_ratio(&self) -> f64 {
        self.long.exposure_s / self.short.exposure_s
    }

    /// Hands every sample that both frames measured, with room to the white level, and of which at
    /// least `dim` DN over dark are expected of the long one, to `each`.
    ///
    /// Which ones these are is judged by the neighbours in the row, never by the sample itself:
    /// a choice by its own noise would bias whatever is made of the chosen.
    pub(crate) fn for_each(&self, dim: f32, mut each: impl FnMut(Both)) {
        let (width, _, channels) = self.short.size;
        let length = width * channels;
        let share = (self.long.exposure_s / (self.long.exposure_s + self.short.exposure_s)) as f32;
        let mut both = vec![0.0_f32; length];
        for (number, row) in rows(self.short.size).enumerate() {
            let here = number * length..(number + 1) * length;
            let short = &self.short.value[here.clone()];
            let long = &self.long.value[here.clone()];
            let short_dark = self.short.dark.get(here.clone()).unwrap_or_default();
            let dark = &self.long.dark[here];
            for (both, (short, long)) in both.iter_mut().zip(short.iter().zip(long)) {
                *both = short + long;
            }
            let last = length.saturating_sub(channels);
            for start in (channels..last).step_by(CHUNK) {
                let end = (start + CHUNK).min(last);
                // Most of a picture is too dim in most pairs. What a rounding may be off counts.
                let most = largest_of(&both[start - channels..end + channels]);
                if 1.000_01 * share * most < dim {
                    continue;
                }
                for at in start..end {
                    let expected = 0.5 * share * (both[at - channels] + both[at + channels]);
                    // NaN fails here as well.
                    if expected >= dim && expected + dark[at] <= self.limit_dn && !both[at].is_nan()
                    {
                        each(Both {
                            row,
                            at,
                            expected,
                            short: short[at],
                            long: long[at],
                            darks: [short_dark.get(at).copied().unwrap_or(0.0), dark[at]],
                        });
                    }
                }
            }
        }
    }
}

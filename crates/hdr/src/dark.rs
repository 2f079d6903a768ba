//! What the sensor shows without light.

use crate::error::MergeError;
use crate::lanes::largest_sample;
use physics::{Frame, Samples};
use std::ops::Range;

/// Shutters repeat to far better than this; another exposure of a bracket is farther away.
const SAME_EXPOSURE: f64 = 0.01;

/// The sum of dark frames of one exposure.
#[derive(Clone, Debug, PartialEq)]
pub struct DarkFrame {
    size: (usize, usize, usize),
    exposure_s: f64,
    count: u32,
    /// The only frame, as it was stored; or the sum of several, which is exact in `f32` for the
    /// first 256 frames of 16-bit numbers.
    sum: Samples,
}

impl DarkFrame {
    /// A dark from its first frame.
    ///
    /// # Errors
    ///
    /// The exposure is not positive and finite, or the frame does not hold what its size says.
    pub fn new(frame: &Frame, exposure_s: f64) -> Result<Self, MergeError> {
        Self::of(frame.clone(), exposure_s)
    }

    /// The same for a frame that is needed for nothing else.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn of(frame: Frame, exposure_s: f64) -> Result<Self, MergeError> {
        check_exposure(exposure_s)?;
        check_frame(&frame)?;
        Ok(Self {
            size: size(&frame),
            exposure_s,
            count: 1,
            sum: frame.samples,
        })
    }

    /// Adds another frame of the same exposure.
    ///
    /// # Errors
    ///
    /// [`MergeError::Size`] for a frame of another size.
    pub fn add(&mut self, frame: &Frame) -> Result<(), MergeError> {
        check_frame(frame)?;
        check_size(frame, self.size)?;
        if let Samples::U16(_) = self.sum {
            self.sum = Samples::F32(self.sum.to_f32());
        }
        if let Samples::F32(sum) = &mut self.sum {
            let row = frame.width * frame.channels;
            let mut samples = vec![0.0; row];
            for (y, sums) in sum.chunks_exact_mut(row).enumerate() {
                frame.samples.copy_to(y * row..(y + 1) * row, &mut samples);
                for (sum, sample) in sums.iter_mut().zip(&samples) {
                    *sum += sample;
                }
            }
        }
        self.count += 1;
        Ok(())
    }

    /// How many frames were added up.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Their exposure, s.
    pub fn exposure_s(&self) -> f64 {
        self.exposure_s
    }

    /// The memory of its samples, for the next ones.
    pub fn into_memory(self) -> Vec<u16> {
        self.sum.into_memory()
    }

    /// The sum, DN.
    pub(crate) fn sum(&self) -> &Samples {
        &self.sum
    }

    /// The same with another sum.
    pub(crate) fn with_sum(&self, sum: Samples) -> Self {
        Self {
            size: self.size,
            exposure_s: self.exposure_s,
            count: self.count,
            sum,
        }
    }

    /// Width, height and channels.
    pub(crate) fn size(&self) -> (usize, usize, usize) {
        self.size
    }

    /// Copies the mean dark of the samples of `range`, DN, to `into`, which must be as long.
    #[inline(always)]
    pub(crate) fn copy_mean_to(&self, range: Range<usize>, into: &mut [f32]) {
        self.sum.copy_to(range, into);
        if self.count > 1 {
            let per_dark = 1.0 / self.count as f32;
            for level in into {
                *level *= per_dark;
            }
        }
    }

    /// The largest mean dark of the samples of `range`, DN, none below 0.
    #[inline(always)]
    pub(crate) fn largest_mean(&self, range: Range<usize>) -> f32 {
        let largest = largest_sample(&self.sum, range);
        if self.count > 1 {
            largest * (1.0 / self.count as f32)
        } else {
            largest
        }
    }

    /// The samples as they were stored, where one frame is all there is.
    #[inline(always)]
    pub(crate) fn one(&self) -> Option<&[u16]> {
        match &self.sum {
            Samples::U16(samples) => Some(samples),
            Samples::F32(_) => None,
        }
    }

    /// How many samples there are.
    pub(crate) fn len(&self) -> usize {
        self.sum.len()
    }

    /// Whether the dark serves a frame of `exposure_s`.
    pub(crate) fn serves(&self, exposure_s: f64) -> bool {
        same_exposure(self.exposure_s, exposure_s)
    }
}

fn same_exposure(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_EXPOSURE * b
}

pub(crate) fn size(frame: &Frame) -> (usize, usize, usize) {
    (frame.width, frame.height, frame.channels)
}

pub(crate) fn check_size(frame: &Frame, expected: (usize, usize, usize)) -> Result<(), MergeError> {
    let found = size(frame);
    if found == expected {
        Ok(())
    } else {
        Err(MergeError::Size { found, expected })
    }
}

pub(crate) fn check_frame(frame: &Frame) -> Result<(), MergeError> {
    let (width, height, channels) = size(frame);
    let expected = width.saturating_mul(height).saturating_mul(channels);
    if expected == 0 {
        Err(MergeError::EmptyFrame(width, height, channels))
    } else if frame.samples.len() != expected {
        Err(MergeError::Samples {
            found: frame.samples.len(),
            expected,
        })
    } else {
        Ok(())
    }
}

pub(crate) fn check_exposure(exposure_s: f64) -> Result<(), MergeError> {
    if exposure_s > 0.0 && exposure_s.is_finite() {
        Ok(())
    } else {
        Err(MergeError::Exposure(exposure_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn darks_add_up() {
        let frame = |level: u16| Frame {
            width: 2,
            height: 1,
            channels: 1,
            samples: vec![level, 2 * level].into(),
        };
        let mut dark = DarkFrame::new(&frame(100), 0.5).unwrap();
        dark.add(&frame(103)).unwrap();
        let mut mean = [0.0; 2];
        dark.copy_mean_to(0..2, &mut mean);
        assert_eq!((dark.count(), mean), (2, [101.5, 203.0]));
        let other = Frame {
            width: 1,
            height: 2,
            ..frame(1)
        };
        assert_eq!(
            dark.add(&other),
            Err(MergeError::Size {
                found: (1, 2, 1),
                expected: (2, 1, 1)
            })
        );
        assert_eq!(
            DarkFrame::new(&frame(1), f64::NAN)
                .map(|_| ())
                .unwrap_err()
                .to_string(),
            "exposure must be above 0 s and finite, got NaN s"
        );
    }
}

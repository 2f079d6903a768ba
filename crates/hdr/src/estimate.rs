//! What a camera does not say of itself, found from its frames.
//!
//! Darks give the black level ([`darks`]), the pile-up of saturated samples the white level
//! ([`white`]), and the spread of the difference between frames, as it grows with the light, gain
//! and read noise ([`transfer`]). A difference between two frames of the same pixel holds nothing
//! that is the pixel's own: neither its offset nor its sensitivity.

pub mod darks;
pub mod transfer;
pub mod white;

use crate::error::EstimateError;
use crate::median::median;
use physics::Frame;
use physics::frame::Samples;

/// A number found from the data, with its standard uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard uncertainty.
    pub u: f64,
}

/// The samples of a frame, if they are the counts of a converter.
fn counts(frame: &Frame) -> Result<&[u16], EstimateError> {
    match &frame.samples {
        Samples::U16(counts) => Ok(counts),
        Samples::F32(_) => Err(EstimateError::NotCounts),
    }
}

/// Standard deviations from the median beyond which a difference is no noise: a hot pixel, a
/// cosmic ray. Of a Gaussian this cuts off 8e-8 of the variance, and little of the longer tail of
/// a few electrons.
const CLIP: f32 = 6.0;

/// Mean, variance and number of `values`, which come of counts that are multiples of `step_dn`,
/// without outliers; `None` for fewer than two.
///
/// The order of `values` changes.
fn clipped_moments(values: &mut [f32], step_dn: u16) -> Option<(f64, f64, u64)> {
    if values.len() < 2 {
        return None;
    }
    let median = median(values, f32::total_cmp);
    let mut distances: Vec<f32> = values.iter().map(|v| (v - median).abs()).collect();
    // 1.4826 median absolute deviations are one standard deviation of a Gaussian. Counts that
    // hardly vary have a deviation of 0, though half of them may lie one step off.
    let spread = 1.4826 * self::median(&mut distances, f32::total_cmp);
    let limit = CLIP * spread.max(0.5 * f32::from(step_dn));
    let (mut n, mut sum, mut square) = (0_u64, 0.0, 0.0);
    for value in values.iter() {
        let distance = value - median;
        if distance.abs() <= limit {
            let distance = f64::from(distance);
            n += 1;
            sum += distance;
            square += distance * distance;
        }
    }
    let count = n as f64;
    let mean = sum / count;
    let variance = (square - count * mean * mean) / (count - 1.0);
    (n >= 2).then(|| (f64::from(median) + mean, variance.max(0.0), n))
}

#[cfg(test)]
mod tests;

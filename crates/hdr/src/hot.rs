//! What is ordinary in a dark frame, and from where on a pixel's dark current stands out.

use crate::dark::DarkFrame;
use crate::median::median;

/// Standard deviations above the median from which a pixel is hot. Of a million pixels with
/// Gaussian noise not one gets there.
pub(crate) const HOT: f32 = 8.0;

/// Standard deviations above the median from which a pixel's own dark says more of its current
/// than the median does.
pub(crate) const WARM: f32 = 3.0;

/// Samples of a channel that tell its level: the median to 0.5 % of the standard deviation, and
/// that to 0.5 %.
const ENOUGH: usize = 1 << 16;

/// The dark of the ordinary samples of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Level {
    /// The middle of the samples, DN: their median, or their mean where counts are coarse.
    pub(crate) middle: f32,
    /// Mean of the ordinary samples, DN: of whole counts it says more than the median does.
    pub(crate) mean: f64,
    /// Standard deviation, DN.
    pub(crate) spread: f32,
}

impl Level {
    /// The level at `deviations` above the middle, DN.
    pub(crate) fn beyond(&self, deviations: f32) -> f32 {
        self.middle + deviations * self.spread
    }
}

/// The level of each channel, by the median and the median absolute deviation; `noise` is what
/// the sensor's own noise makes of a sample at the median, DN, and is what a quantised dark
/// without any spread falls back on. Counts are multiples of `step_dn` (0 for others).
pub(crate) fn levels(
    dark: &DarkFrame,
    channels: usize,
    step_dn: u16,
    noise: impl Fn(f32) -> f32,
) -> Vec<Level> {
    let pixels = dark.len() / channels;
    // An odd step, so that it does not keep to the columns of an even width.
    let step = (pixels / ENOUGH) | 1;
    let mut values = Vec::with_capacity(pixels / step + 1);
    let of_channel = |channel: usize| {
        values.clear();
        for pixel in (0..pixels).step_by(step) {
            let at = pixel * channels + channel;
            let mut level = [0.0];
            dark.copy_mean_to(at..at + 1, &mut level);
            values.extend(level);
        }
        let median = median(&mut values, f32::total_cmp);
        let ordinary = HOT * noise(median);
        let (mut sum, mut count) = (0.0, 0.0_f64);
        for value in values.iter().filter(|v| (*v - median).abs() <= ordinary) {
            sum += f64::from(*value);
            count += 1.0;
        }
        let mean = sum / count.max(1.0);
        // The median of 12-bit counts in the high bits of 16 is one of them, up to 8 DN off.
        let middle = if step_dn > 1 { mean as f32 } else { median };
        for value in &mut values {
            *value = (*value - middle).abs();
        }
        // 1.4826 median absolute deviations are one standard deviation of a Gaussian.
        let spread = 1.4826 * self::median(&mut values, f32::total_cmp);
        Level {
            middle,
            mean,
            spread: spread.max(noise(middle)),
        }
    };
    (0..channels).map(of_channel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::Frame;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn an_outlier_stands_out_of_its_own_channel() {
        // Channel 0 about 100, channel 1 about 500 without any spread.
        let mut samples: Vec<u16> = (0..40).flat_map(|i| [100 + i % 5, 500]).collect();
        samples[20] = 300;
        samples[31] = 503;
        samples[33] = 510;
        let frame = Frame {
            width: 40,
            height: 1,
            channels: 2,
            samples: samples.clone().into(),
        };
        let dark = DarkFrame::new(&frame, 1.0).unwrap();
        let levels = levels(&dark, 2, 1, |_| 1.0);
        assert_eq!(
            levels[1],
            Level {
                middle: 500.0,
                // Without the one that is ten deviations off.
                mean: 500.0 + 3.0 / 39.0,
                spread: 1.0
            }
        );
        let found: Vec<usize> = (0..samples.len())
            .filter(|i| f32::from(samples[*i]) > levels[i % 2].beyond(HOT))
            .collect();
        assert_eq!(found, [20, 33]);
    }

    #[test]
    fn the_level_of_coarse_counts_lies_between_them() {
        // 12-bit counts in the high bits of 16, and a few hot pixels.
        let rng = &mut Pcg64Mcg::seed_from_u64(21);
        for level in [1001.0, 1004.0, 1007.0] {
            let samples: Vec<u16> = (0..40_000)
                .map(|i| {
                    let hot = if i % 1000 == 0 { 900.0 } else { 0.0 };
                    let seen = level + hot + 8.0 * rng.sample::<f64, _>(StandardNormal);
                    (seen / 16.0).round() as u16 * 16
                })
                .collect();
            let frame = Frame {
                width: 200,
                height: 200,
                channels: 1,
                samples: samples.into(),
            };
            let dark = DarkFrame::new(&frame, 1.0).unwrap();
            let found = levels(&dark, 1, 16, |_| 9.0)[0].middle;
            // Four standard errors, and the few hundredths that rounding to steps of 2σ may be off.
            assert!((f64::from(found) - level).abs() < 0.25, "{level}: {found}");
        }
    }
}

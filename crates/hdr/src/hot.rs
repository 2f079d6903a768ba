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
    /// DN.
    pub(crate) median: f32,
    /// Mean of the ordinary samples, DN: of whole counts it says more than the median does.
    pub(crate) mean: f64,
    /// Standard deviation, DN.
    pub(crate) spread: f32,
}

impl Level {
    /// The level at `deviations` above the median, DN.
    pub(crate) fn beyond(&self, deviations: f32) -> f32 {
        self.median + deviations * self.spread
    }
}

/// The level of each channel, by the median and the median absolute deviation; `noise` is what
/// the sensor's own noise makes of a sample at the median, DN, and is what a quantised dark
/// without any spread falls back on.
pub(crate) fn levels(dark: &DarkFrame, channels: usize, noise: impl Fn(f32) -> f32) -> Vec<Level> {
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
        for value in &mut values {
            *value = (*value - median).abs();
        }
        // 1.4826 median absolute deviations are one standard deviation of a Gaussian.
        let spread = 1.4826 * self::median(&mut values, f32::total_cmp);
        Level {
            median,
            mean: sum / count.max(1.0),
            spread: spread.max(noise(median)),
        }
    };
    (0..channels).map(of_channel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::Frame;

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
        let levels = levels(&dark, 2, |_| 1.0);
        assert_eq!(
            levels[1],
            Level {
                median: 500.0,
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
}

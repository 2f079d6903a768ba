//! Pixels whose dark current stands out.

/// Standard deviations above the median from which a pixel is hot. Of a million pixels with
/// Gaussian noise not one gets there.
const HOT: f32 = 8.0;

/// Which of `dark` (DN, interleaved `channels`) are hot, judged in each channel by the median
/// and the median absolute deviation; `noise[c]` is what the sensor's own noise makes of one
/// value at the median, DN, and is what a quantised dark without any spread falls back on.
pub(crate) fn hot_pixels(dark: &[f32], channels: usize, noise: impl Fn(f32) -> f32) -> Vec<bool> {
    let mut hot = vec![false; dark.len()];
    let mut values = Vec::with_capacity(dark.len() / channels);
    for channel in 0..channels {
        let of_channel = || dark.iter().skip(channel).step_by(channels);
        values.clear();
        values.extend(of_channel());
        let median = median(&mut values);
        for value in &mut values {
            *value = (*value - median).abs();
        }
        // 1.4826 median absolute deviations are one standard deviation of a Gaussian.
        let spread = 1.4826 * self::median(&mut values);
        let limit = median + HOT * spread.max(noise(median));
        for (hot, value) in hot
            .iter_mut()
            .skip(channel)
            .step_by(channels)
            .zip(of_channel())
        {
            *hot = *value > limit;
        }
    }
    hot
}

fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outlier_is_hot_in_its_own_channel() {
        // Channel 0 about 100, channel 1 about 500 without any spread.
        let mut dark: Vec<f32> = (0..40)
            .flat_map(|i| [100.0 + (i % 5) as f32, 500.0])
            .collect();
        dark[20] = 300.0;
        dark[31] = 503.0;
        dark[33] = 510.0;
        let hot = hot_pixels(&dark, 2, |_| 1.0);
        let found: Vec<usize> = (0..dark.len()).filter(|i| hot[*i]).collect();
        assert_eq!(found, [20, 33]);
    }
}

//! Where the beam enters.

use crate::error::ProfileError;
use physics::ChannelMap;

/// Standard deviations that the brightest place must have, or there is no spot.
const VISIBLE: f64 = 10.0;

/// Pixels that the mask must have: a spot narrower than a pixel gets a lower threshold instead
/// of a centre that jumps with the few pixels above half of the peak.
const ENOUGH: usize = 45;

/// Centre of the beam spot, px: the centroid of what rises above half of the peak.
///
/// The weight of a pixel is the square of its height above the threshold, so that it fades to
/// nothing at the mask's edge. Where fewer than 45 pixels reach half of the peak the threshold is lowered until
/// they do. Pixels that were not measured take the mean of their neighbours, and a single bright
/// pixel cannot be the peak.
///
/// At oblique incidence the glow is displaced from the point of entry; this is the centre of its
/// bright part.
///
/// # Errors
///
/// No pixel was measured, nothing stands out of the noise, or the spot touches the edge.
pub fn find_center(
    channel: &ChannelMap,
    width: usize,
    height: usize,
) -> Result<[f64; 2], ProfileError> {
    check_size(channel, width, height)?;
    let picture = Picture::new(channel, width, height);
    let peak = picture.peak()?;
    let mut threshold = 0.5 * peak.value;
    loop {
        let mask = picture.connected(peak.pixel, threshold);
        if mask.touches_edge {
            let [x, y] = mask.centroid();
            return Err(ProfileError::SpotAtEdge {
                x,
                y,
                width,
                height,
                needed: NEEDED_PX,
            });
        }
        // Below a few standard deviations the mask would be made of noise.
        if mask.pixels >= ENOUGH || 0.7 * threshold < 0.5 * VISIBLE * peak.u {
            return Ok(mask.centroid());
        }
        threshold *= 0.7;
    }
}

/// Room that a spot needs around its centre, px: fewer pixels make no profile.
pub(crate) const NEEDED_PX: f64 = 16.0;

/// Whether the channel holds what the size says, and numbers alone.
pub(crate) fn check_size(
    channel: &ChannelMap,
    width: usize,
    height: usize,
) -> Result<(), ProfileError> {
    let pixels = width.saturating_mul(height);
    let (values, variances) = (channel.value.len(), channel.variance.len());
    if values != pixels || variances != pixels {
        return Err(ProfileError::Size {
            values,
            variances,
            pixels,
        });
    }
    // An unmeasured pixel has an infinite variance; everything else has to be a number.
    let bad = channel
        .value
        .iter()
        .zip(&channel.variance)
        .position(|(value, variance)| !value.is_finite() || variance.is_nan() || *variance < 0.0);
    if let Some(pixel) = bad {
        return Err(ProfileError::Pixel {
            x: pixel % width,
            y: pixel / width,
            value: channel.value[pixel],
            variance: channel.variance[pixel],
        });
    }
    if channel.variance.iter().all(|v| !v.is_finite()) {
        return Err(ProfileError::Empty(pixels));
    }
    Ok(())
}

/// A channel with its size.
pub(crate) struct Picture<'a> {
    channel: &'a ChannelMap,
    width: usize,
    height: usize,
}

/// The brightest place.
pub(crate) struct Peak {
    pub(crate) pixel: usize,
    /// Mean over the neighbourhood, its brightest pixel left out.
    pub(crate) value: f64,
    /// The standard uncertainty of that.
    pub(crate) u: f64,
}

/// Sums over a connected region, each weighted by the square of the height above the
/// threshold.
struct Mask {
    pixels: usize,
    weight: f64,
    moment: [f64; 2],
    touches_edge: bool,
}

impl Mask {
    fn centroid(&self) -> [f64; 2] {
        self.moment.map(|m| m / self.weight)
    }
}

impl<'a> Picture<'a> {
    pub(crate) fn new(channel: &'a ChannelMap, width: usize, height: usize) -> Self {
        Self {
            channel,
            width,
            height,
        }
    }

    /// The value of every pixel, those that were not measured filled in.
    pub(crate) fn filled(&self) -> Vec<f64> {
        (0..self.width * self.height)
            .map(|pixel| self.value(pixel))
            .collect()
    }
}

impl Picture<'_> {
    /// The measured pixels in the 3 × 3 block about `pixel`, clipped at the frame.
    fn block(&self, pixel: usize) -> impl Iterator<Item = usize> + '_ {
        let (x, y) = (pixel % self.width, pixel / self.width);
        let rows = y.saturating_sub(1)..(y + 2).min(self.height);
        rows.flat_map(move |v| {
            let columns = x.saturating_sub(1)..(x + 2).min(self.width);
            columns.map(move |u| v * self.width + u)
        })
        .filter(|i| self.channel.variance[*i].is_finite())
    }

    /// The brightest place, if it stands out of the noise.
    pub(crate) fn peak(&self) -> Result<Peak, ProfileError> {
        let mut best: Option<Peak> = None;
        for pixel in 0..self.width * self.height {
            let (mut sum, mut variance, mut largest, mut count) = (0.0, 0.0, f64::MIN, 0.0);
            for i in self.block(pixel) {
                let value = f64::from(self.channel.value[i]);
                sum += value;
                variance += f64::from(self.channel.variance[i]);
                largest = value.max(largest);
                count += 1.0;
            }
            // At least half of a block, so that an island among unmeasured pixels is no peak.
            if count < 5.0 && count < (self.width * self.height) as f64 {
                continue;
            }
            let value = (sum - largest) / (count - 1.0_f64).max(1.0);
            if best.as_ref().is_none_or(|best| value > best.value) {
                let u = variance.sqrt() / count;
                best = Some(Peak { pixel, value, u });
            }
        }
        let Some(peak) = best else {
            return Err(ProfileError::Empty(self.width * self.height));
        };
        if peak.value > VISIBLE * peak.u {
            Ok(peak)
        } else {
            Err(ProfileError::NoSpot {
                x: (peak.pixel % self.width) as f64,
                y: (peak.pixel / self.width) as f64,
                peak: peak.value,
                u: peak.u,
            })
        }
    }

    /// Value of a pixel, or the mean of its neighbours where it was not measured.
    fn value(&self, pixel: usize) -> f64 {
        if self.channel.variance[pixel].is_finite() {
            return f64::from(self.channel.value[pixel]);
        }
        let (mut sum, mut count) = (0.0, 0.0_f64);
        for i in self.block(pixel) {
            sum += f64::from(self.channel.value[i]);
            count += 1.0;
        }
        sum / count.max(1.0)
    }

    /// What is above `threshold` and hangs together with `start` (eight neighbours).
    fn connected(&self, start: usize, threshold: f64) -> Mask {
        let mut seen = vec![false; self.width * self.height];
        seen[start] = true;
        let mut mask = Mask {
            pixels: 0,
            weight: 0.0,
            moment: [0.0; 2],
            touches_edge: false,
        };
        let mut front = vec![start];
        while let Some(pixel) = front.pop() {
            let (x, y) = (pixel % self.width, pixel / self.width);
            let height = self.value(pixel) - threshold;
            // The square meets zero smoothly, so that the centroid does not depend on which
            // pixels the mask's edge happens to take in.
            let weight = height * height;
            // The peak is found over a neighbourhood and may itself lie lower.
            if height <= 0.0 && pixel != start {
                continue;
            }
            if height > 0.0 {
                mask.pixels += 1;
                mask.weight += weight;
                mask.moment[0] += weight * x as f64;
                mask.moment[1] += weight * y as f64;
            }
            if x == 0 || y == 0 || x + 1 == self.width || y + 1 == self.height {
                mask.touches_edge = true;
                continue;
            }
            for v in y - 1..=y + 1 {
                for u in x - 1..=x + 1 {
                    let neighbour = v * self.width + u;
                    if !std::mem::replace(&mut seen[neighbour], true) {
                        front.push(neighbour);
                    }
                }
            }
        }
        mask
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Gaussian spot of `sigma` px and unit height, its pixels integrated on 8 × 8 points.
    fn spot(size: usize, center: [f64; 2], sigma: f64) -> ChannelMap {
        let value = (0..size * size)
            .map(|i| {
                let mut sum = 0.0;
                for k in 0..64 {
                    let sub = |k: usize| (k as f64 + 0.5) / 8.0 - 0.5;
                    let x = (i % size) as f64 + sub(k % 8) - center[0];
                    let y = (i / size) as f64 + sub(k / 8) - center[1];
                    sum += (-0.5 * (x * x + y * y) / (sigma * sigma)).exp() / 64.0;
                }
                sum as f32
            })
            .collect();
        ChannelMap {
            name: "Y".to_owned(),
            value,
            variance: vec![1e-6; size * size],
        }
    }

    #[test]
    fn the_centroid_is_the_centre() {
        // A spot of a pixel or two has few of them above any threshold.
        for (sigma, tolerance) in [(0.7, 0.02), (3.0, 2e-3), (8.0, 5e-4)] {
            for center in [[40.0, 40.0], [39.31, 40.83], [37.5, 41.08]] {
                let [x, y] = find_center(&spot(80, center, sigma), 80, 80).unwrap();
                let error = (x - center[0]).hypot(y - center[1]);
                println!("sigma {sigma} at {center:?}: {error:.1e}");
                assert!(error < tolerance, "sigma {sigma} at {center:?}: {x}, {y}");
            }
        }
    }

    #[test]
    fn a_bright_pixel_or_a_hole_does_not_move_it() {
        let center = [39.31, 40.83];
        let mut map = spot(80, center, 4.0);
        map.value[10 * 80 + 12] = 30.0;
        map.value[41 * 80 + 42] = 0.0;
        map.variance[41 * 80 + 42] = f32::INFINITY;
        let [x, y] = find_center(&map, 80, 80).unwrap();
        let error = (x - center[0]).hypot(y - center[1]);
        // The hole's neighbours are not quite its own value.
        assert!(error < 0.02, "{x}, {y}");
    }

    #[test]
    fn a_spot_off_the_frame_is_refused() {
        for center in [[1.0, 40.0], [-9.0, 40.0], [40.0, 83.0]] {
            let error = find_center(&spot(80, center, 6.0), 80, 80).unwrap_err();
            assert!(matches!(error, ProfileError::SpotAtEdge { .. }), "{error}");
        }
    }

    #[test]
    fn noise_is_no_spot() {
        let mut map = spot(80, [40.0, 40.0], 4.0);
        map.value = (0..6400).map(|i| ((i * 7919) % 613) as f32 / 3e5).collect();
        let error = find_center(&map, 80, 80).unwrap_err();
        assert!(matches!(error, ProfileError::NoSpot { .. }), "{error}");
    }
}

//! Where the beam enters.

use crate::error::ProfileError;
use physics::ChannelMap;
use physics::simd::{LaneLoop, SimdPath};
use rayon::prelude::*;
use std::array::from_fn;

/// Standard deviations that the brightest place must have, or there is no spot.
const VISIBLE: f64 = 10.0;

/// Pixels that the mask must have: a spot narrower than a pixel gets a lower threshold instead
/// of a centre that jumps with the few pixels above half of the peak.
const ENOUGH: usize = 45;

/// Pixels above half of the peak from which on a spot is wide enough for a Gaussian window.
const WIDE: usize = 16;

/// Width of that window over the width of the spot. The best for noise would be a wide one, which
/// finds the centre of a Gaussian with the least uncertainty that photons allow; this one has 1.2
/// times as much, and a slope under the spot moves it 5.95σ² slopes over the peak.
const WINDOW: f64 = 1.2;

/// Centre of the beam spot, px: where its light balances under a Gaussian window.
///
/// The search starts at the centroid of what rises above half of the peak. There the weight of a
/// pixel is the square of its height above the threshold, so that it fades to
/// nothing at the mask's edge. Where fewer than 45 pixels reach half of the peak the threshold is lowered until
/// they do; fewer than 16 leave it at that. Pixels that were not measured take the mean of their neighbours, and a
/// single bright pixel cannot be the peak. So do, for this purpose alone, the pixels between the
/// photosites of one colour.
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
    Picture::checked(channel, width, height)?.center()
}

/// Room that a spot needs around its centre, px: fewer pixels make no profile.
pub(crate) const NEEDED_PX: f64 = 16.0;

/// Rows that one thread checks at once.
const CHECK_ROWS: usize = 64;

/// Pixels of a row that are judged together before they are looked at one by one.
const CHUNK: usize = 64;

/// Pixels that are looked at at once.
const LANES: usize = 16;

/// Some rows of a picture, to be checked.
struct Check<'a> {
    value: &'a [f32],
    variance: &'a [f32],
    width: usize,
}

/// What is found in them.
struct Checked {
    /// How many pixels were measured.
    measured: u64,
    /// The largest value of each chunk of each row.
    largest: Vec<f32>,
    /// The first pixel that cannot be.
    bad: Option<usize>,
}

impl LaneLoop for Check<'_> {
    type Output = Checked;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Checked {
        let Self {
            value,
            variance,
            width,
        } = self;
        // An unmeasured pixel has an infinite variance, and a photosite of another colour no value
        // either; everything else has to be a number.
        let is_bad = |value: f32, variance: f32| {
            let absent = value.is_nan() & (variance == f32::INFINITY);
            !((value.abs() < f32::INFINITY) | absent) | variance.is_nan() | (variance < 0.0)
        };
        let larger = |a: f32, b: f32| if b > a { b } else { a };
        let (mut bad, mut finite) = ([0_u32; LANES], [0_u32; LANES]);
        let mut largest = Vec::with_capacity(value.len().div_ceil(width) * width.div_ceil(CHUNK));
        for (value, variance) in value.chunks(width).zip(variance.chunks(width)) {
            // Chunk by chunk: a search that may end at any pixel looks at one after the other.
            for (value, variance) in value.chunks(CHUNK).zip(variance.chunks(CHUNK)) {
                let mut most = [f32::NEG_INFINITY; LANES];
                let (values, rest) = value.as_chunks::<LANES>();
                let (variances, rest_of_variances) = variance.as_chunks::<LANES>();
                for (value, variance) in values.iter().zip(variances) {
                    for i in 0..LANES {
                        bad[i] |= u32::from(is_bad(value[i], variance[i]));
                        finite[i] += u32::from(variance[i] < f32::INFINITY);
                        most[i] = larger(most[i], value[i]);
                    }
                }
                for (i, (value, variance)) in rest.iter().zip(rest_of_variances).enumerate() {
                    bad[i] |= u32::from(is_bad(*value, *variance));
                    finite[i] += u32::from(*variance < f32::INFINITY);
                    most[i] = larger(most[i], *value);
                }
                // Halved and halved again: the compiler may not reorder maxima by itself.
                let most: [f32; LANES / 2] = from_fn(|i| larger(most[i], most[i + LANES / 2]));
                let most: [f32; LANES / 4] = from_fn(|i| larger(most[i], most[i + LANES / 4]));
                largest.push(most.into_iter().fold(f32::NEG_INFINITY, larger));
            }
        }
        let measured = finite.into_iter().map(u64::from).sum();
        let bad = if bad.iter().any(|bad| *bad != 0) {
            (0..value.len()).find(|i| is_bad(value[*i], variance[*i]))
        } else {
            None
        };
        Checked {
            measured,
            largest,
            bad,
        }
    }
}

/// Share of measured pixels below which a picture is one of scattered photosites.
pub(crate) const SPARSE: f64 = 0.6;

/// A channel with its size, checked.
pub(crate) struct Picture<'a> {
    channel: &'a ChannelMap,
    width: usize,
    height: usize,
    /// Share of the pixels that were measured. Of a colour of a mosaic it is a half or less.
    pub(crate) share: f64,
    /// The largest value of each chunk of each row.
    largest: Vec<f32>,
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
    /// Whether the channel holds what the size says, and numbers alone, some of them measured.
    pub(crate) fn checked(
        channel: &'a ChannelMap,
        width: usize,
        height: usize,
    ) -> Result<Self, ProfileError> {
        let pixels = width.saturating_mul(height);
        let (values, variances) = (channel.value.len(), channel.variance.len());
        if values != pixels || variances != pixels {
            return Err(ProfileError::Size {
                values,
                variances,
                pixels,
            });
        }
        if pixels == 0 {
            return Err(ProfileError::Empty(pixels));
        }
        let block = CHECK_ROWS * width;
        let values = channel.value.par_chunks(block);
        let blocks: Vec<Checked> = values
            .zip(channel.variance.par_chunks(block))
            .map(|(value, variance)| {
                SimdPath::best().run(Check {
                    value,
                    variance,
                    width,
                })
            })
            .collect();
        let bad = |(number, rows): (usize, &Checked)| Some(number * block + rows.bad?);
        if let Some(pixel) = blocks.iter().enumerate().find_map(bad) {
            return Err(ProfileError::Pixel {
                x: pixel % width,
                y: pixel / width,
                value: channel.value[pixel],
                variance: channel.variance[pixel],
            });
        }
        let measured: u64 = blocks.iter().map(|rows| rows.measured).sum();
        if measured == 0 {
            return Err(ProfileError::Empty(pixels));
        }
        Ok(Self {
            channel,
            width,
            height,
            share: measured as f64 / pixels as f64,
            largest: blocks.into_iter().flat_map(|rows| rows.largest).collect(),
        })
    }

    /// As [`find_center`] has it.
    pub(crate) fn center(&self) -> Result<[f64; 2], ProfileError> {
        let peak = self.peak()?;
        let mut threshold = 0.5 * peak.value;
        let mut above_half = None;
        loop {
            let mask = self.connected(peak.pixel, threshold);
            if mask.touches_edge {
                let [x, y] = mask.centroid();
                return Err(ProfileError::SpotAtEdge {
                    x,
                    y,
                    width: self.width,
                    height: self.height,
                    needed: NEEDED_PX,
                });
            }
            let pixels = *above_half.get_or_insert(mask.pixels);
            // Below a few standard deviations the mask would be made of noise.
            if mask.pixels >= ENOUGH || 0.7 * threshold < 0.5 * VISIBLE * peak.u {
                let center = mask.centroid();
                let refined = (pixels >= WIDE).then(|| self.balanced(center, pixels));
                return Ok(refined.flatten().unwrap_or(center));
            }
            threshold *= 0.7;
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
    /// The measured pixels in the block about `pixel` that goes `reach` to each side, clipped at
    /// the frame.
    fn block(&self, pixel: usize, reach: usize) -> impl Iterator<Item = usize> + '_ {
        let (x, y) = (pixel % self.width, pixel / self.width);
        let rows = y.saturating_sub(reach)..(y + reach + 1).min(self.height);
        rows.flat_map(move |v| {
            let columns = x.saturating_sub(reach)..(x + reach + 1).min(self.width);
            columns.map(move |u| v * self.width + u)
        })
        .filter(|i| self.channel.variance[*i].is_finite())
    }

    /// How far a block goes to each side that has enough pixels to be judged by.
    fn reach(&self) -> usize {
        if self.share < SPARSE { 2 } else { 1 }
    }

    /// The pixels, row by row, that may be the brightest place: of a picture of a spot, few.
    ///
    /// The mean of a block is no smaller than its smallest pixel and no larger than its largest.
    fn bright_pixels(&self) -> impl Iterator<Item = usize> + '_ {
        let (width, height, reach) = (self.width, self.height, self.reach());
        let (in_row, largest) = (width.div_ceil(CHUNK), &self.largest);
        let mut least = f32::NEG_INFINITY;
        for (number, chunk) in largest.iter().enumerate() {
            if *chunk <= least {
                continue;
            }
            let start = number / in_row * width + number % in_row * CHUNK;
            let end = (start + CHUNK).min((number / in_row + 1) * width);
            let at = (start..end).find(|i| self.channel.value[*i] == *chunk);
            if let Some(at) = at
                && self.block(at, 1).count() == 9
            {
                let smallest = self.block(at, 1).map(|i| self.channel.value[i]);
                least = least.max(smallest.fold(f32::INFINITY, f32::min));
            }
        }
        let mut may_hold = vec![false; largest.len()];
        for number in (0..largest.len()).filter(|number| largest[*number] >= least) {
            let (row, chunk) = (number / in_row, number % in_row);
            for row in row.saturating_sub(reach)..(row + reach + 1).min(height) {
                let chunks = chunk.saturating_sub(1)..(chunk + 2).min(in_row);
                may_hold[row * in_row..][chunks].fill(true);
            }
        }
        let numbers = may_hold.into_iter().enumerate();
        numbers
            .filter_map(|(number, may)| may.then_some(number))
            .flat_map(move |number| {
                let (row, first) = (number / in_row, number % in_row * CHUNK);
                row * width + first..row * width + (first + CHUNK).min(width)
            })
    }

    /// The brightest place, if it stands out of the noise.
    pub(crate) fn peak(&self) -> Result<Peak, ProfileError> {
        let mut best: Option<Peak> = None;
        let reach = self.reach();
        // At least half of a block, so that an island among unmeasured pixels is no peak.
        let enough = if self.share < SPARSE {
            (0.5 * self.share * (2 * reach + 1).pow(2) as f64).max(2.0)
        } else {
            5.0
        };
        for pixel in self.bright_pixels() {
            let (mut sum, mut variance, mut largest, mut count) = (0.0, 0.0, f64::MIN, 0.0);
            for i in self.block(pixel, reach) {
                let value = f64::from(self.channel.value[i]);
                sum += value;
                variance += f64::from(self.channel.variance[i]);
                largest = value.max(largest);
                count += 1.0;
            }
            if count < enough && count < (self.width * self.height) as f64 {
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
        let (mut sum, mut weight) = (0.0, 0.0);
        // Photosites of a pattern may lie farther away than the next pixel.
        for reach in 1..=self.reach() + 1 {
            for i in self.block(pixel, reach) {
                let dx = (i % self.width).abs_diff(pixel % self.width);
                let dy = (i / self.width).abs_diff(pixel / self.width);
                // Where a picture is dense all neighbours count alike.
                let w = if self.share < SPARSE {
                    1.0 / (dx * dx + dy * dy).pow(2) as f64
                } else {
                    1.0
                };
                sum += w * f64::from(self.channel.value[i]);
                weight += w;
            }
            if weight > 0.0 {
                return sum / weight;
            }
        }
        0.0
    }

    /// Where the light balances under a Gaussian window, near `start`, of a spot of which `pixels`
    /// are above half of the peak. Nothing where the window leaves the picture or the search the
    /// spot.
    fn balanced(&self, start: [f64; 2], pixels: usize) -> Option<[f64; 2]> {
        // A Gaussian is above half of its peak over 2π ln 2 σ².
        let sigma = (pixels as f64 / (std::f64::consts::TAU * std::f64::consts::LN_2)).sqrt();
        let window = WINDOW * sigma;
        let reach = 4.0 * window;
        let mut center = start;
        for _ in 0..30 {
            let [x, y] = center;
            let (right, below) = (self.width as f64 - 1.0 - x, self.height as f64 - 1.0 - y);
            if x.min(y).min(right).min(below) < reach {
                return None;
            }
            // The Gaussian is one of the column times one of the row.
            let along = |middle: f64| {
                ((middle - reach).ceil() as usize..=(middle + reach) as usize).map(move |at| {
                    let d = at as f64 - middle;
                    (at, d, (-0.5 * d * d / (window * window)).exp())
                })
            };
            let columns: Vec<(usize, f64, f64)> = along(x).collect();
            let (mut sum, mut moment) = (0.0, [0.0; 2]);
            for (v, dy, weight) in along(y) {
                let (mut light, mut to_the_right) = (0.0, 0.0);
                for (u, dx, across) in &columns {
                    let seen = across * self.value(v * self.width + u);
                    light += seen;
                    to_the_right += seen * dx;
                }
                sum += weight * light;
                moment[0] += weight * to_the_right;
                moment[1] += weight * light * dy;
            }
            // By so much the window holds the centroid of a Gaussian back.
            let step = moment.map(|m| m / sum * (1.0 + 1.0 / (WINDOW * WINDOW)));
            center = [x + step[0], y + step[1]];
            let moved = (center[0] - start[0]).hypot(center[1] - start[1]);
            if moved.is_nan() || moved >= 0.5 * sigma {
                return None;
            }
            if step[0].hypot(step[1]) < 1e-5 {
                break;
            }
        }
        Some(center)
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

    /// Root mean square of the distance from the true centre over many noisy pictures of a spot
    /// as `synth` makes one (a beam of 0.3 mm on marble is 4 px of standard deviation with wings),
    /// on light that rises by `slope` of the peak from one side of the picture to the other.
    fn scatter(slope: f64) -> f64 {
        use rand::{RngExt, SeedableRng};
        use rand_distr::StandardNormal;
        let count = 60;
        let mut square = 0.0;
        for seed in 0..count {
            let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
            let mut draw = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
            let center = [draw(78.0, 82.0), draw(78.0, 82.0)];
            let direction = draw(0.0, std::f64::consts::TAU);
            let mut map = spot(160, center, draw(3.0, 6.0));
            for (i, value) in map.value.iter_mut().enumerate() {
                let (x, y) = ((i % 160) as f64 / 160.0, (i / 160) as f64 / 160.0);
                let background = slope * (x * direction.cos() + y * direction.sin());
                let noise: f64 = rng.sample(StandardNormal);
                // Photon noise of 20,000 electrons at the peak.
                let u = (f64::from(*value) / 2e4 + 1e-8).sqrt();
                *value += (background + u * noise) as f32;
                map.variance[i] = (u * u) as f32;
            }
            let [x, y] = find_center(&map, 160, 160).unwrap();
            square += ((x - center[0]).powi(2) + (y - center[1]).powi(2)) / count as f64;
        }
        square.sqrt()
    }

    #[test]
    fn the_centre_is_found_within_thousandths_of_a_pixel() {
        let (clean, sloped) = (scatter(0.0), scatter(0.02));
        println!("{clean:.4} px clean, {sloped:.4} px with a slope of 2 %");
        assert!(clean < 0.005, "{clean}");
        assert!(sloped < 0.02, "{sloped}");
    }

    /// The photosites of one colour of a mosaic.
    fn photosites(map: &ChannelMap, width: usize, pattern: &str, colour: usize) -> ChannelMap {
        let mosaic: physics::Mosaic = pattern.parse().unwrap();
        let mut own = map.clone();
        for i in 0..own.value.len() {
            if mosaic.colour(i % width, i / width) != colour {
                own.value[i] = f32::NAN;
                own.variance[i] = f32::INFINITY;
            }
        }
        own
    }

    #[test]
    fn the_photosites_of_a_colour_have_the_same_centre() {
        // What lies between them is interpolated, which a spot of a few pixels bends with.
        const X_TRANS: &str = "GBGGRGRGRBGBGBGGRGGRGGBGBGBRGRGRGGBG";
        for (sigma, tolerance) in [(3.0, 0.02), (6.0, 0.008)] {
            for pattern in ["RGGB", X_TRANS] {
                for colour in 0..3 {
                    for center in [[40.0, 40.0], [39.31, 40.83], [37.5, 41.08]] {
                        let map = photosites(&spot(80, center, sigma), 80, pattern, colour);
                        let [x, y] = find_center(&map, 80, 80).unwrap();
                        let error = (x - center[0]).hypot(y - center[1]);
                        println!("{pattern}, colour {colour}, sigma {sigma}: {error:.1e}");
                        assert!(error < tolerance, "{pattern} {colour} {sigma}: {x}, {y}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_peak_is_found_wherever_it_is() {
        // Against a look at every block, in noise with holes and with single bright pixels.
        let (width, height) = (150, 70);
        for seed in 0..30_usize {
            let noise = |i: usize| ((i + 977 * seed) * 7919 % 1009) as f32 / 1009.0;
            let mut map = ChannelMap {
                name: "Y".to_owned(),
                value: (0..width * height).map(noise).collect(),
                variance: vec![1e-9; width * height],
            };
            let spot = (seed * 4231) % (width * height);
            for i in Picture::checked(&map, width, height)
                .unwrap()
                .block(spot, 1)
                .collect::<Vec<_>>()
            {
                map.value[i] += 0.3 * (seed % 4) as f32;
            }
            for k in 0..40 {
                let i = (k * 577 + seed * 31) % (width * height);
                if k % 2 == 0 {
                    map.value[i] = 9.0;
                } else {
                    map.value[i] = 0.0;
                    map.variance[i] = f32::INFINITY;
                }
            }
            let picture = Picture::checked(&map, width, height).unwrap();
            let mut best = (f64::MIN, 0);
            for pixel in 0..width * height {
                let mut block: Vec<f64> = picture
                    .block(pixel, 1)
                    .map(|i| map.value[i].into())
                    .collect();
                block.sort_by(f64::total_cmp);
                block.pop();
                let mean = block.iter().sum::<f64>() / block.len() as f64;
                if block.len() >= 4 && mean > best.0 + 1e-12 {
                    best = (mean, pixel);
                }
            }
            let peak = picture.peak().unwrap();
            assert_eq!(peak.pixel, best.1, "seed {seed}");
            assert!((peak.value - best.0).abs() < 1e-9);
        }
    }

    /// Rows end in a part of a chunk, and that in a part of all lanes.
    #[test]
    fn the_peak_is_found_in_every_column() {
        let (width, height) = (64 + 32 + 5, 19);
        for x in 2..width - 2 {
            let mut map = ChannelMap {
                name: "Y".to_owned(),
                value: vec![0.0; width * height],
                variance: vec![1e-6; width * height],
            };
            let middle = 4 * width + x;
            // A dimmer one says what is too dark.
            for (at, light) in [(middle, 1.0), (14 * width + 17, 0.5)] {
                for row in [at - width, at, at + width] {
                    map.value[row - 1..=row + 1].fill(light);
                }
                map.value[at] *= 1.2;
            }
            let picture = Picture::checked(&map, width, height).unwrap();
            assert_eq!(picture.peak().unwrap().pixel, middle);
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

//! The response of a camera that gives 8 bits, from several exposures of one scene.
//!
//! Such a camera bends its counts before it rounds them. Rounding to one of 256 codes costs
//! accuracy that no curve brings back: 1 % of the light and more at any one sample, where a
//! linear file of 16 bits is limited by photons alone.

use crate::median::median;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use physics::Sensor;
use std::f64::consts::FRAC_PI_2;
use std::ops::RangeInclusive;
use thiserror::Error;

/// Codes of 8 bits.
const CODES: usize = 256;

/// The code at which the curve is 0: a product of light and response shows no scale.
pub const MIDDLE: usize = 128;

/// By how much the slope of the curve over ln of the code, which is the gamma of a power law, is
/// expected to change when the code grows e-fold. For sRGB it goes from 1 to 2.3 over two e-folds.
///
/// The scale over which it is judged matters: exposures in equal steps leave a curve that repeats
/// itself with each step undetermined, which nothing but such a prior keeps away.
const BEND: f64 = 0.5;

/// Standard deviations beyond which a sample pulls no harder: a camera that moved, a lamp that
/// flickered.
const HUBER: f64 = 3.0;

/// By how much rounding makes the curve worse than the scatter of the samples says: two samples
/// of one code in one pair of exposures err alike. Measured on curves that are known.
const ALIKE: f64 = 2.0;

/// Rounds in which scatter, and with it smoothing and weights, settle.
const ROUNDS: usize = 12;

/// The inverse response of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// ln of the exposure (radiance times time) that gives each code, 0 at [`MIDDLE`]. Never
    /// falls with the code.
    pub ln_exposure: Vec<f64>,
    /// Its standard uncertainty. Codes that no sample had rest on their neighbours, and say so
    /// here; 0 and 255 hold whatever is darker and brighter, and are extrapolated. Where frames
    /// contradict any one curve, as in the fog of a film, it holds what they say.
    pub u: Vec<f64>,
    /// Standard deviation of a sample of the middle code about the curve, in ln of exposure.
    pub scatter: f64,
    /// The independent ways in which the curve may be off, each for one standard deviation, in ln
    /// of exposure at each code: those that matter most where codes say most.
    pub ways: Vec<Vec<f64>>,
}

/// A curve as counts in proportion to light, and the sensor that they would be of.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// The count of each code, DN; none at code 0.
    pub counts: Vec<f32>,
    /// As [`Response::ways`]: relative errors of the counts.
    pub ways: Vec<Vec<f64>>,
    /// What noise the counts have, and from where on they are saturated.
    pub sensor: Sensor,
    /// As [`Response::scatter`].
    pub scatter: f64,
    /// Largest standard uncertainty of the curve, relative, between codes 20 and 235.
    pub u_relative: f64,
}

/// Pixels that show no response.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ResponseError {
    /// There is nothing to compare.
    #[error("found {0} exposures, expected at least 2 of one scene")]
    Exposures(usize),
    /// An exposure time is zero, negative or not finite.
    #[error("exposure must be above 0 s and finite, got {0} s")]
    Exposure(f64),
    /// The codes are not a whole number of pixels.
    #[error(
        "found {codes} codes, expected one for each pixel at each of the {exposures} exposures"
    )]
    Codes {
        /// Codes given.
        codes: usize,
        /// Exposures given.
        exposures: usize,
    },
    /// Too few samples are between black and white.
    #[error(
        "only {found} samples between codes 1 and 254 can be compared with another exposure of \
         their pixel, expected at least {least}: take more pixels, or exposures closer together"
    )]
    TooFew {
        /// Such samples, less one for each pixel.
        found: usize,
        /// As many as there are codes.
        least: usize,
    },
    /// The samples leave the curve open.
    #[error("the samples do not determine a curve: are all exposures equal?")]
    Open,
}

/// Recovers the response from `codes`, pixel by pixel, each with one code for each of `exposures_s`.
///
/// Least squares over curve and light: Σ w²(g(z) − ln E − ln t)², w a hat that is 0 at codes 0 and
/// 255, with a prior on how far g bends whose strength follows from the scatter of the samples.
/// Take some thousand pixels that cover dark and bright, away from edges. Exposures in equal steps
/// leave a curve that repeats itself with each step almost open: it is off by up to 4 %, several
/// u, where a *linear* camera is exposed in exact doublings, and by about 1 % where the response
/// bends. The end of a film's shoulder, its last fifth of codes, is rounded off by up to 4 %.
///
/// # Errors
///
/// [`ResponseError`] says what is missing.
///
/// # Source
///
/// Debevec and Malik (1997), section 2.1, with the light of each pixel eliminated, the smoothing
/// tied to the noise, and isotonic regression at the end.
pub fn recover(codes: &[u8], exposures_s: &[f64]) -> Result<Response, ResponseError> {
    let count = exposures_s.len();
    if count < 2 {
        return Err(ResponseError::Exposures(count));
    }
    if let Some(bad) = exposures_s.iter().find(|t| !(**t > 0.0 && t.is_finite())) {
        return Err(ResponseError::Exposure(*bad));
    }
    if !codes.len().is_multiple_of(count) {
        return Err(ResponseError::Codes {
            codes: codes.len(),
            exposures: count,
        });
    }
    let ln_t: Vec<f64> = exposures_s.iter().map(|t| t.ln()).collect();
    let pixels: Vec<&[u8]> = codes
        .chunks_exact(count)
        .filter(|pixel| pixel.iter().filter(|z| hat(**z) > 0.0).count() > 1)
        .collect();
    let seen = |pixel: &&[u8]| pixel.iter().filter(|z| hat(**z) > 0.0).count() - 1;
    let found = pixels.iter().map(seen).sum();
    if found < CODES {
        return Err(ResponseError::TooFew {
            found,
            least: CODES,
        });
    }

    let mut curve = DVector::zeros(CODES);
    let mut variance: Option<f64> = None;
    let mut solved = None;
    for _ in 0..ROUNDS {
        let normal = Normal::new(&pixels, &ln_t, &curve, variance);
        let smoothing = variance.unwrap_or(1e-4) / (BEND * BEND);
        let decomposition = normal.smoothed(smoothing).ok_or(ResponseError::Open)?;
        curve = decomposition.solve(&normal.side);
        let scatter = residual_variance(&pixels, &ln_t, &curve, found);
        variance = Some(scatter);
        solved = Some((decomposition, scatter));
    }
    let (decomposition, scatter) = solved.ok_or(ResponseError::Open)?;
    let covariance = decomposition.inverse() * (ALIKE * ALIKE * scatter);
    let of = |covariance: &DMatrix<f64>| -> Vec<f64> {
        (0..CODES)
            .map(|z| covariance[(z, z)].max(0.0).sqrt())
            .collect()
    };
    let mut ln_exposure = monotone(curve.as_slice(), &of(&covariance));
    let misfit = DVector::from(misfit(&pixels, &ln_t, &ln_exposure));
    // One frame's toe is off as a whole, so its codes err together.
    let covariance = covariance + &misfit * misfit.transpose();
    let u = of(&covariance);
    let zero = ln_exposure[MIDDLE];
    for value in &mut ln_exposure {
        *value -= zero;
    }
    Ok(Response {
        ln_exposure,
        u,
        scatter: scatter.sqrt(),
        ways: ways(&covariance),
    })
}

/// Codes of which a sample tells the light of its pixel better than any other can.
const TELLING: RangeInclusive<u8> = 64..=191;

/// Samples of one frame, next to each other in light, whose median is one misfit.
const TOGETHER: usize = 25;

/// Misfits count where they are beyond what noise explains twice: there are few at each code.
const EXPLAINED: f64 = 2.0;

/// Samples that tell the misfit at a code, from as many of its neighbours as it takes.
const ENOUGH: usize = 4 * TOGETHER;

/// By how much the samples of each code contradict the curve beyond noise, as a standard deviation
/// in ln of exposure.
///
/// The light of a pixel is told by its samples of [`TELLING`] codes in other frames; the median of
/// what the curve makes of others of that light and frame beside it is a misfit, in which the
/// noise of samples has averaged out. It counts where rounding, the rest of that noise and the
/// misfits among telling codes (exposure times that are a little off) do not explain it: its rms,
/// and more where 1.96 of it would not hold 95 % of the samples. A ripple that repeats itself with
/// equal steps of exposure fits all pairs and stays unseen.
fn misfit(pixels: &[&[u8]], ln_t: &[f64], curve: &[f64]) -> Vec<f64> {
    let telling = |z: &u8| TELLING.contains(z);
    // And what noise and rounding explain of it.
    let mut squares: Vec<Vec<(f64, f64)>> = vec![vec![]; CODES];
    for frame in 0..ln_t.len() {
        // Light in the frame, the code it gave, and what the curve has beyond it.
        let mut seen: Vec<(f64, usize, f64)> = vec![];
        for pixel in pixels.iter().filter(|pixel| hat(pixel[frame]) > 0.0) {
            let others = pixel.iter().zip(ln_t).enumerate();
            let (sum, count) = others
                .filter(|(other, (z, _))| *other != frame && telling(z))
                .fold((0.0, 0.0), |(sum, count), (_, (z, t))| {
                    (sum + curve[usize::from(*z)] - t, count + 1.0)
                });
            if count > 0.0 {
                let light = sum / count + ln_t[frame];
                let code = usize::from(pixel[frame]);
                seen.push((light, code, curve[code] - light));
            }
        }
        seen.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        for group in seen.chunks(TOGETHER) {
            let mut off: Vec<f64> = group.iter().map(|(.., off)| *off).collect();
            let median = median(&mut off, f64::total_cmp);
            let mut apart: Vec<f64> = off.iter().map(|off| (off - median).abs()).collect();
            // The median of n Gaussians has pi/2 of the variance of their mean.
            let spread = 1.4826 * self::median(&mut apart, f64::total_cmp);
            let own = FRAC_PI_2 * spread.powi(2) / off.len() as f64;
            for (_, code, _) in group {
                let (lower, upper) = (code - 1, (code + 1).min(CODES - 1));
                let step = (curve[upper] - curve[lower]) / (upper - lower) as f64;
                squares[*code].push((median * median, own + step * step / 12.0));
            }
        }
    }
    let of = |codes: RangeInclusive<usize>| {
        let mut near = squares[codes].concat();
        if near.is_empty() {
            return (0.0, 0.0);
        }
        let (sum, explained) =
            (near.iter()).fold((0.0, 0.0), |all, one| (all.0 + one.0, all.1 + one.1));
        let count = near.len() as f64;
        // Of the squares of normal misfits, 95 % are within 1.96 squared.
        let place = (count * 0.95) as usize;
        let bound = near
            .select_nth_unstable_by(place, |a, b| a.0.total_cmp(&b.0))
            .1
            .0;
        (
            f64::max(sum / count, bound / 1.96_f64.powi(2)),
            explained / count,
        )
    };
    let [first, last] = [*TELLING.start(), *TELLING.end()].map(usize::from);
    let (all, explained) = of(first..=last);
    let common = f64::max(all - explained, 0.0);
    let near = |z: usize, reach: usize| z.saturating_sub(reach)..=(z + reach).min(CODES - 1);
    let enough =
        |codes: RangeInclusive<usize>| squares[codes].iter().map(Vec::len).sum::<usize>() >= ENOUGH;
    let misfit = |z| {
        let reach = (0..CODES).find(|reach| enough(near(z, *reach)));
        let (square, explained) = of(near(z, reach.unwrap_or(CODES)));
        if square > EXPLAINED * (explained + common) {
            square.sqrt()
        } else {
            0.0
        }
    };
    (0..CODES).map(misfit).collect()
}

/// Ways that are kept of the curve's covariance.
const WAYS: usize = 8;

/// The principal axes of `covariance`, every code weighing as much as its samples do.
fn ways(covariance: &DMatrix<f64>) -> Vec<Vec<f64>> {
    // A way at a code without weight, times no weight.
    let weight = |z: usize| hat(z as u8).max(1e-3);
    let weighted = DMatrix::from_fn(CODES, CODES, |i, j| {
        weight(i) * weight(j) * covariance[(i, j)]
    });
    let axes = weighted.symmetric_eigen();
    let mut order: Vec<usize> = (0..CODES).collect();
    order.sort_by(|a, b| axes.eigenvalues[*b].total_cmp(&axes.eigenvalues[*a]));
    let axis = |k: &usize| {
        let length = axes.eigenvalues[*k].max(0.0).sqrt();
        (0..CODES)
            .map(|z| length * axes.eigenvectors[(z, *k)] / weight(z))
            .collect()
    };
    order[..WAYS].iter().map(axis).collect()
}

/// Counts of codes 254 and 255, DN: what is brighter than the former is saturated.
const FULL_DN: f64 = 50_000.0;
const SATURATED_DN: f64 = 52_000.0;

/// Codes that show the noise of light rather than that of rounding or of the curve's ends.
const CLEAR: RangeInclusive<u8> = 20..=235;

impl Response {
    /// The curve as counts, and the noise of such counts among the `codes` that it was recovered
    /// from: in proportion to the light, as that of photons is, beside half a code at the dark end.
    pub fn linear(&self, codes: &[u8], exposures_s: &[f64]) -> Linear {
        let full = self.ln_exposure[CODES - 2];
        let mut counts: Vec<f64> = self
            .ln_exposure
            .iter()
            .map(|ln| FULL_DN * (ln - full).exp())
            .collect();
        counts[0] = 0.0;
        counts[CODES - 1] = SATURATED_DN;
        let mut squares = vec![];
        for pixel in codes.chunks_exact(exposures_s.len().max(1)) {
            let seen = pixel.iter().zip(exposures_s);
            let seen: Vec<_> = seen.filter(|(z, _)| hat(**z) > 0.0).collect();
            let count = |z: &u8| counts[usize::from(*z)];
            let (sum, time) = seen.iter().fold((0.0, 0.0), |(sum, time), (z, t)| {
                (sum + count(z), time + *t)
            });
            for (z, t) in seen.iter().filter(|(z, _)| CLEAR.contains(z)) {
                let expected = sum / time * *t;
                // What is left of a sample's own noise beside the mean that it is part of.
                let rest = 1.0 - *t / time;
                if rest > 0.1 && expected > 0.0 {
                    squares.push((count(z) - expected).powi(2) / (rest * expected));
                }
            }
        }
        let per_count = if squares.is_empty() {
            1.0
        } else {
            // The median of a squared Gaussian is 0.4549 of its variance.
            median(&mut squares, f64::total_cmp) / 0.454_9
        };
        let gain_e_per_dn = 1.0 / per_count.max(1e-6);
        let step = counts[2] - counts[1];
        let u_of_clear = self.u[usize::from(*CLEAR.start())..=usize::from(*CLEAR.end())].iter();
        Linear {
            ways: self.ways.clone(),
            sensor: Sensor {
                gain_e_per_dn,
                read_noise_e: step / 12.0_f64.sqrt() * gain_e_per_dn,
                black_level_dn: 0.0,
                white_level_dn: 0.5 * (FULL_DN + SATURATED_DN),
                prnu_relative: 0.0,
            },
            counts: counts.into_iter().map(|count| count as f32).collect(),
            scatter: self.scatter,
            u_relative: u_of_clear.copied().fold(0.0, f64::max),
        }
    }
}

impl Linear {
    /// Relative error that each of the ways leaves in the merged value of a pixel of
    /// `rate_dn_per_s`, from frames of `exposures_s`.
    pub fn relative_errors(&self, rate_dn_per_s: f64, exposures_s: &[f64]) -> Vec<f64> {
        let seen: Vec<(f64, f64)> = exposures_s
            .iter()
            .map(|t| (*t, rate_dn_per_s * t))
            .filter(|(_, count)| *count <= FULL_DN)
            .map(|(t, count)| (t, self.code(count)))
            .collect();
        let time: f64 = seen.iter().map(|(t, _)| t).sum();
        let of = |way: &Vec<f64>| {
            let error = |code: f64| {
                let below = (code as usize).min(CODES - 2);
                let place = code - below as f64;
                way[below] + place * (way[below + 1] - way[below])
            };
            let sum: f64 = seen.iter().map(|(t, code)| t * error(*code)).sum();
            if time > 0.0 { sum / time } else { 0.0 }
        };
        self.ways.iter().map(of).collect()
    }

    /// The code, between whole ones, that `count` would have.
    fn code(&self, count: f64) -> f64 {
        let above = self.counts.partition_point(|c| f64::from(*c) <= count);
        let above = above.clamp(2, CODES - 1);
        let [low, high] = [above - 1, above].map(|z| f64::from(self.counts[z]));
        let place = (count - low) / (high - low).max(f64::MIN_POSITIVE);
        // Below the first code there is nothing that a curve could say.
        (above - 1) as f64 + place.clamp(0.0, 1.0)
    }
}

/// The weight of a code, 1 in the middle: the step of a code in ln of exposure is about as the
/// inverse of it.
fn hat(code: u8) -> f64 {
    f64::from(code.min(255 - code)) / 127.0
}

/// The light of a pixel, ln, as its samples have it, and each sample's weight.
fn light(
    pixel: &[u8],
    ln_t: &[f64],
    curve: &DVector<f64>,
    variance: Option<f64>,
) -> (f64, Vec<f64>) {
    let mut weights: Vec<f64> = pixel.iter().map(|z| hat(*z).powi(2)).collect();
    let mean = |weights: &[f64]| {
        let sum: f64 = weights.iter().sum();
        let each = pixel.iter().zip(ln_t).zip(weights);
        each.map(|((z, t), w)| w * (curve[usize::from(*z)] - t))
            .sum::<f64>()
            / sum
    };
    let first = mean(&weights);
    let Some(variance) = variance else {
        return (first, weights);
    };
    let limit = HUBER * variance.sqrt();
    for ((w, z), t) in weights.iter_mut().zip(pixel).zip(ln_t) {
        let off = hat(*z) * (curve[usize::from(*z)] - t - first).abs();
        if off > limit {
            *w *= limit / off;
        }
    }
    (mean(&weights), weights)
}

/// The normal equations of the curve, with the light of every pixel eliminated.
struct Normal {
    matrix: DMatrix<f64>,
    side: DVector<f64>,
}

impl Normal {
    fn new(pixels: &[&[u8]], ln_t: &[f64], curve: &DVector<f64>, variance: Option<f64>) -> Self {
        let mut matrix = DMatrix::zeros(CODES, CODES);
        let mut side = DVector::zeros(CODES);
        for pixel in pixels {
            let (_, weights) = light(pixel, ln_t, curve, variance);
            let sum: f64 = weights.iter().sum();
            let time = weights.iter().zip(ln_t).map(|(w, t)| w * t).sum::<f64>() / sum;
            for ((a, wa), t) in pixel.iter().zip(&weights).zip(ln_t) {
                let a = usize::from(*a);
                side[a] += wa * (t - time);
                matrix[(a, a)] += wa;
                for (b, wb) in pixel.iter().zip(&weights) {
                    matrix[(a, usize::from(*b))] -= wa * wb / sum;
                }
            }
        }
        Self { matrix, side }
    }

    /// With the prior on the curvature, and the middle held at 0.
    fn smoothed(&self, smoothing: f64) -> Option<Cholesky<f64, Dyn>> {
        let mut matrix = self.matrix.clone();
        for middle in 1..CODES - 1 {
            let (weight, difference) = bend(middle);
            for (i, a) in difference.iter().enumerate() {
                for (j, b) in difference.iter().enumerate() {
                    matrix[(middle - 1 + i, middle - 1 + j)] += smoothing * weight * a * b;
                }
            }
        }
        let heaviest = matrix.diagonal().max();
        matrix[(MIDDLE, MIDDLE)] += 1e6 * heaviest;
        matrix.cholesky()
    }
}

/// The second derivative over ln of the code, from a code and its two neighbours, and the stretch
/// of ln of the code that it stands for.
fn bend(code: usize) -> (f64, [f64; 3]) {
    // The logarithm of code 0 is that of a quarter: any finite number will do for a code that
    // holds all darkness.
    let ln = |z: usize| (z as f64).max(0.25).ln();
    let (left, right) = (ln(code) - ln(code - 1), ln(code + 1) - ln(code));
    let width = 0.5 * (left + right);
    let (a, b) = (1.0 / (left * width), 1.0 / (right * width));
    (width, [a, -a - b, b])
}

/// Variance of a sample of weight 1 about the curve, with `freedom` samples beyond one for each
/// pixel.
///
/// Large residuals count as far as they pull.
fn residual_variance(pixels: &[&[u8]], ln_t: &[f64], curve: &DVector<f64>, freedom: usize) -> f64 {
    let mut squares = Vec::with_capacity(pixels.len() * ln_t.len());
    for pixel in pixels {
        let (light, _) = light(pixel, ln_t, curve, None);
        for (z, t) in pixel.iter().zip(ln_t) {
            if hat(*z) > 0.0 {
                squares.push((hat(*z) * (curve[usize::from(*z)] - t - light)).powi(2));
            }
        }
    }
    let median = median(&mut squares, f64::total_cmp);
    // Beyond three robust deviations a square counts as one of three: 1.4826² of the median of
    // squares is the variance of a Gaussian.
    let limit = 9.0 * 1.4826_f64.powi(2) * median;
    let sum: f64 = squares.iter().map(|s| s.min(limit.max(1e-12))).sum();
    // The curve itself takes some of the freedom: not more than one in ten here, where each
    // code has several samples.
    (sum / freedom as f64).max(1e-12)
}

/// The nearest curve that never falls, by pooling neighbours that do, each with its 1/u².
fn monotone(curve: &[f64], u: &[f64]) -> Vec<f64> {
    let mut pools: Vec<(f64, f64, usize)> = Vec::with_capacity(curve.len());
    for (value, u) in curve.iter().zip(u) {
        let mut pool = (*value, 1.0 / (u * u).max(1e-18), 1);
        while let Some(last) = pools.last().copied()
            && last.0 > pool.0
        {
            pools.pop();
            let weight = last.1 + pool.1;
            let mean = (last.0 * last.1 + pool.0 * pool.1) / weight;
            pool = (mean, weight, last.2 + pool.2);
        }
        pools.push(pool);
    }
    pools
        .into_iter()
        .flat_map(|(value, _, count)| std::iter::repeat_n(value, count))
        .collect()
}

#[cfg(test)]
mod tests;

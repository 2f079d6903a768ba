//! Gain and read noise, from how the noise grows with the light: the photon transfer curve.

use super::{Estimate, clipped_moments};
use crate::dark::DarkFrame;
use crate::error::EstimateError;
use crate::net::{Net, Pair, Spare};
use crate::overlap;
use physics::Frame;
use std::f64::consts::PI;

/// Bins of brightness in each doubling.
const PER_OCTAVE: f32 = 3.0;

/// Brightness of the first bin's end, DN; what is darker shares that bin. A wide first bin mixes
/// variances, and cutting off its outliers takes the tails of the brighter ones along.
const FIRST_DN: f32 = 1.0;

/// Fewest samples from which a variance is taken.
const LEAST: usize = 100;

/// Most samples of a bin that are kept: they give its variance to 0.6 %.
const MOST: usize = 1 << 16;

/// Two pairs of neighbouring frames share one. For exposures that double, the squares of their
/// differences correlate by 0.22 and have two neighbours each: the variance of their mean grows
/// by 1 + 2·0.22, and the standard error by the root of that.
const SHARED: f64 = 1.2;

/// Relative error that no number of samples averages away. Where rounding is as large as the
/// noise (12 bits), gains come out up to 0.4 % low; sensors are linear to no better than this.
const SYSTEMATIC: f64 = 0.003;

/// The variance of a difference between two frames, and what it is made of:
/// `variance_dn2` = `read_outs`·R + `charge_dn`/gain, R the variance of one read-out in DN².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoisePoint {
    /// Read-outs that the difference holds, each with the square of its factor.
    pub read_outs: f64,
    /// Charge that it holds, with the square of its factor, DN.
    pub charge_dn: f64,
    /// Its variance, DN².
    pub variance_dn2: f64,
    /// Differences that the variance is of.
    pub samples: u64,
}

/// What the noise of a sensor says of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Electrons per data number.
    pub gain_e_per_dn: Estimate,
    /// Standard deviation of one read-out, electrons.
    pub read_noise_e: Estimate,
    /// χ² of the straight line per degree of freedom; well above 1 for a sensor that bends.
    pub reduced_chi2: f64,
}

/// Frames that arrive one by one, by increasing exposure; those of another scene after
/// [`Transfer::restart`].
#[derive(Clone, Debug)]
pub struct Transfer {
    black_dn: f64,
    white_dn: f64,
    /// The largest step that the counts of a frame share, DN.
    step_dn: u16,
    previous: Option<Net>,
    points: Vec<NoisePoint>,
}

impl Transfer {
    /// Nothing yet, of a sensor with these levels.
    pub fn new(black_dn: f64, white_dn: f64) -> Self {
        Self {
            black_dn,
            white_dn,
            step_dn: 1,
            previous: None,
            points: vec![],
        }
    }

    /// Another scene begins.
    pub fn restart(&mut self) {
        self.previous = None;
    }

    /// Adds a frame of `exposure_s` and its dark.
    ///
    /// # Errors
    ///
    /// As [`crate::Merge::add`].
    pub fn add(
        &mut self,
        frame: &Frame,
        dark: &DarkFrame,
        exposure_s: f64,
    ) -> Result<(), EstimateError> {
        let net = Net::new(frame, dark, exposure_s, self.white_dn, Spare::default())?;
        self.step_dn = self.step_dn.max(frame.samples.rounding().step_dn);
        if let Some(previous) = &self.previous {
            let pair = Pair::new(previous, &net, self.black_dn, self.white_dn)?;
            let points = points(&pair, self.black_dn, self.white_dn, self.step_dn);
            self.points.extend(points);
        }
        self.previous = Some(net);
        Ok(())
    }

    /// Gain and read noise, with what pairs of darks say of the same.
    ///
    /// # Errors
    ///
    /// [`EstimateError::NoOverlap`] where no two frames show the same pixels well, and
    /// [`EstimateError::NoPhotonNoise`] where the noise does not grow with the light.
    pub fn noise(&self, darks: &[NoisePoint]) -> Result<Noise, EstimateError> {
        if self.points.is_empty() {
            return Err(EstimateError::NoOverlap);
        }
        let points: Vec<NoisePoint> = self.points.iter().chain(darks).copied().collect();
        fit(&points, f64::from(self.step_dn))
    }
}

/// The noise of one pair, in bins of brightness.
fn points(pair: &Pair<'_>, black_dn: f64, white_dn: f64, step_dn: u16) -> Vec<NoisePoint> {
    let ratio = overlap::ratio(pair, black_dn, white_dn).unwrap_or_else(|| pair.nominal_ratio());
    let factor = ratio as f32;
    let share = factor / (1.0 + factor);
    // Differences, and the sums of what each would be expected to hold.
    let mut bins: Vec<(Vec<f32>, f64)> = vec![];
    let (short_reads, long_reads) = (
        1.0 + 1.0 / f64::from(pair.short.darks),
        1.0 + 1.0 / f64::from(pair.long.darks),
    );
    pair.for_each(f32::NEG_INFINITY, |both| {
        let octaves = (both.expected / FIRST_DN).max(1.0).log2();
        let bin = (PER_OCTAVE * octaves).ceil() as usize;
        if bins.len() <= bin {
            bins.resize_with(bin + 1, Default::default);
        }
        let (differences, charge) = &mut bins[bin];
        if differences.len() < MOST {
            differences.push(both.long - factor * both.short);
            // The long signal, as both frames together have it: Poisson noise of the difference
            // does not correlate with that of the sum. The short one holds 1/ratio of it, and
            // comes in with the square of the ratio.
            let signal = f64::from(share * (both.long + both.short));
            let [short_dark, long_dark] = both.darks.map(|dark| f64::from(dark) - black_dn);
            *charge += (1.0 + ratio) * signal
                + long_reads * long_dark
                + ratio * ratio * short_reads * short_dark;
        }
    });
    bins.into_iter()
        .filter(|(differences, _)| differences.len() >= LEAST)
        .filter_map(|(mut differences, charge)| {
            let count = differences.len() as f64;
            let (_, variance_dn2, samples) = clipped_moments(&mut differences, step_dn)?;
            Some(NoisePoint {
                read_outs: long_reads + ratio * ratio * short_reads,
                charge_dn: charge / count,
                variance_dn2,
                samples,
            })
        })
        .collect()
}

/// The straight line through the points, of counts that are multiples of `step_dn`.
fn fit(points: &[NoisePoint], step_dn: f64) -> Result<Noise, EstimateError> {
    // Variance of one read-out and electrons per DN⁻¹, from a first guess that each point
    // knows its own variance best.
    let mut line: Option<(f64, f64)> = None;
    let mut covariance = [0.0; 3];
    let mut chi2 = 0.0;
    // The weights then follow from the line, never from a point itself: one whose variance
    // came out low must not count for more. Three rounds change them by less than rounding.
    for _ in 0..4 {
        let mut sums = [0.0; 5];
        chi2 = 0.0;
        for p in points {
            let (a, b, y) = (p.read_outs, p.charge_dn, p.variance_dn2);
            let expected = line
                .map_or(y, |(read, slope)| a * read + b * slope)
                .max(1e-6);
            // Variance of a variance of Gaussian numbers.
            let w = p.samples as f64 / (2.0 * expected * expected);
            if line.is_some() {
                chi2 += w * (y - expected).powi(2);
            }
            let terms = [w * a * a, w * a * b, w * b * b, w * a * y, w * b * y];
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum += term;
            }
        }
        let [aa, ab, bb, ay, by] = sums;
        let determinant = aa * bb - ab * ab;
        if determinant <= 1e-12 * aa * bb {
            return Err(EstimateError::NoPhotonNoise);
        }
        let read = (bb * ay - ab * by) / determinant;
        let slope = (aa * by - ab * ay) / determinant;
        covariance = [bb / determinant, -ab / determinant, aa / determinant];
        line = Some((read.max(0.0), slope.max(0.0)));
    }
    let (read_variance, slope) = line.unwrap_or_default();
    let reduced_chi2 = chi2 / (points.len() as f64 - 2.0).max(1.0);
    let widen = SHARED * reduced_chi2.max(1.0).sqrt();
    let u_slope = widen * covariance[2].sqrt();
    if slope <= 3.0 * u_slope {
        return Err(EstimateError::NoPhotonNoise);
    }
    let gain = 1.0 / slope;
    let read_dn = step_dn * before_rounding(read_variance / step_dn.powi(2)).sqrt();
    let read_noise_e = read_dn * gain;
    // d(read·gain) in terms of R and the slope, whose errors correlate. A read noise that
    // drowns in rounding is uncertain by what would show beside it.
    let u_read_variance = widen * covariance[0].sqrt();
    let by_read = gain / (2.0 * read_dn.max(u_read_variance.sqrt()));
    let by_slope = -read_noise_e * gain;
    let variance = by_read * by_read * covariance[0]
        + 2.0 * by_read * by_slope * covariance[1]
        + by_slope * by_slope * covariance[2];
    Ok(Noise {
        gain_e_per_dn: Estimate {
            value: gain,
            u: gain * (gain * u_slope).hypot(SYSTEMATIC),
        },
        read_noise_e: Estimate {
            value: read_noise_e,
            u: (widen * variance.max(0.0).sqrt()).hypot(SYSTEMATIC * read_noise_e),
        },
        reduced_chi2,
    })
}

/// The variance of an analog value that varies by `variance` when read again and again in whole
/// numbers, in units of their steps squared.
///
/// Rounding adds 1/12, less what stays the same in one pixel: a pixel with little noise is always
/// rounded the same way, and a difference of two frames does not show it. For pixels at any
/// offset that is Σ exp(−4π²m²σ²)/(2π²m²) over m ≥ 1, the variance of the mean rounding error.
fn before_rounding(variance: f64) -> f64 {
    let rounded = |analog: f64| {
        let constant: f64 = (1..=20)
            .map(|m| 2.0 * (PI * f64::from(m)).powi(2))
            .map(|k| (-2.0 * k * analog).exp() / k)
            .sum();
        analog + 1.0 / 12.0 - constant
    };
    let (mut low, mut high) = (0.0, variance.max(0.0));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if rounded(middle) < variance {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

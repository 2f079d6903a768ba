//! Black level, and the noise of a read-out, from frames without light.

use super::transfer::NoisePoint;
use super::{Estimate, clipped_moments};
use crate::dark::{check_exposure, check_frame, size};
use crate::error::EstimateError;
use physics::Frame;

/// Samples of a dark that are looked at; so many give its mean to 0.1 % of its spread.
const MOST: usize = 1 << 20;

/// Share of samples at 0 above which a black level is cut off.
const CLIPPED: f64 = 0.01;

/// By how much the dark current may differ from one dark to the next: sensors warm up.
const DRIFT: f64 = 0.05;

/// Darks that arrive one by one, by increasing exposure.
#[derive(Clone, Debug, Default)]
pub struct Darks {
    previous: Option<(Frame, f64)>,
    means: Vec<Mean>,
    pairs: Vec<DarkPair>,
}

#[derive(Clone, Copy, Debug)]
struct Mean {
    exposure_s: f64,
    dn: f64,
    u_dn: f64,
}

#[derive(Clone, Copy, Debug)]
struct DarkPair {
    same_exposure: bool,
    mean_dn: f64,
    variance_dn2: f64,
    samples: u64,
}

impl Darks {
    /// Nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a dark frame of `exposure_s`.
    ///
    /// # Errors
    ///
    /// The frame does not hold what its size says, its exposure is not positive and finite, or
    /// more than 1 % of it lies at 0 DN, so that neither its mean nor its noise can be seen.
    pub fn add(&mut self, frame: Frame, exposure_s: f64) -> Result<(), EstimateError> {
        check_exposure(exposure_s)?;
        check_frame(&frame)?;
        // A stride that no row length shares, so that all columns are seen.
        let step = (frame.samples.len() / MOST + 1) | 1;
        let counts = super::counts(&frame)?;
        let mut values: Vec<f32> = counts.iter().step_by(step).map(|s| f32::from(*s)).collect();
        let zero = values.iter().filter(|v| **v == 0.0).count() as f64 / values.len() as f64;
        if zero > CLIPPED {
            return Err(EstimateError::BlackClipped { share: zero });
        }
        // Of frames as even as these a step may be a chance, and then a wider limit does no harm.
        let bits = counts.iter().fold(0, |all, count| all | count);
        let step_dn = 1_u16.checked_shl(bits.trailing_zeros()).unwrap_or(1);
        if let Some((dn, variance, n)) = clipped_moments(&mut values, step_dn) {
            self.means.push(Mean {
                exposure_s,
                dn,
                u_dn: (variance / n as f64).sqrt(),
            });
            if let Some((before, before_s)) = &self.previous
                && size(before) == size(&frame)
            {
                let both = super::counts(before)?.iter().zip(counts).step_by(step);
                values.clear();
                values.extend(both.map(|(a, b)| f32::from(*b) - f32::from(*a)));
                let first = self.means.len() - 2;
                if let Some((_, variance_dn2, samples)) = clipped_moments(&mut values, step_dn) {
                    self.pairs.push(DarkPair {
                        same_exposure: *before_s == exposure_s,
                        mean_dn: 0.5 * (self.means[first].dn + dn),
                        variance_dn2,
                        samples,
                    });
                }
            }
        }
        self.previous = Some((frame, exposure_s));
        Ok(())
    }

    /// The count that no light and no dark current gives, DN: the mean dark, extrapolated to an
    /// exposure of 0.
    ///
    /// # Errors
    ///
    /// [`EstimateError::NoDarks`].
    pub fn black_level(&self) -> Result<Estimate, EstimateError> {
        let least = self
            .means
            .iter()
            .map(|m| m.dn)
            .fold(f64::INFINITY, f64::min);
        // A straight line, weighted so that long darks, whose current drifts, count little.
        let mut sums = [0.0; 5];
        for Mean {
            exposure_s: t,
            dn,
            u_dn,
        } in self.means.iter().copied()
        {
            let u = u_dn.hypot(DRIFT * (dn - least)).max(1e-3);
            let w = 1.0 / (u * u);
            let y = dn - least;
            for (sum, term) in sums.iter_mut().zip([w, w * t, w * t * t, w * y, w * t * y]) {
                *sum += term;
            }
        }
        let [w, wt, wtt, wy, wty] = sums;
        if w == 0.0 {
            return Err(EstimateError::NoDarks);
        }
        let determinant = w * wtt - wt * wt;
        // Darks of one exposure alone have no slope.
        let (value, u) = if determinant > 1e-9 * w * wtt {
            (
                (wtt * wy - wt * wty) / determinant,
                (wtt / determinant).sqrt(),
            )
        } else {
            (wy / w, (1.0 / w).sqrt())
        };
        Ok(Estimate {
            value: least + value,
            u,
        })
    }

    /// What pairs of darks say of the noise, for a sensor of this black level.
    ///
    /// Pairs of one exposure where there are any, since every pixel has a dark current of its
    /// own; else the two shortest.
    pub fn noise_points(&self, black_dn: f64) -> Vec<NoisePoint> {
        let same = self.pairs.iter().any(|p| p.same_exposure);
        self.pairs
            .iter()
            .filter(|p| p.same_exposure == same)
            .take(if same { usize::MAX } else { 1 })
            .map(|p| NoisePoint {
                read_outs: 2.0,
                charge_dn: 2.0 * (p.mean_dn - black_dn).max(0.0),
                variance_dn2: p.variance_dn2,
                samples: p.samples,
            })
            .collect()
    }
}

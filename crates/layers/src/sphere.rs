//! From what an integrating sphere measures to σₐ, σₛ and g.

use crate::stack::{CannotSolve, Resolution, solve_with};
use nalgebra::{DMatrix, DVector};
use physics::{Layer, LayeredMedium, Phase, first_order};
use thiserror::Error;

/// Thickness of the clear slides, which is without effect.
const SLIDE_MM: f64 = 1.0;
/// For the scan that looks for every solution.
const COARSE: Resolution = Resolution {
    nodes: 8,
    moments: 16,
};
/// Steps of that scan.
const SCAN: usize = 48;
const OPTICAL_THICKNESS: (f64, f64) = (1e-3, 3e3);
const MEAN_COSINE: (f64, f64) = (-0.95, 0.99);
/// 1 − albedo that counts as no absorption.
const LEAST_LOSS: f64 = 1e-9;
const NORMAL_95_TWO_SIDED: f64 = 1.959_963_984_540_054;
const NORMAL_95_ONE_SIDED: f64 = 1.644_853_626_951_472;

/// A measured share of the incident power and its standard uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The share.
    pub value: f64,
    /// Standard uncertainty; 0 where the share is taken as exact.
    pub u: f64,
}

/// What is known besides R and T, and lets three unknowns be found from them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Third {
    /// The mean cosine g, with its standard uncertainty.
    MeanCosine(Measured),
    /// The transmittance of light that was not scattered.
    Collimated(Measured),
}

/// A slab between the ports of an integrating sphere, lit along its normal (or at `cos_in`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereSample {
    /// Thickness, mm, with its standard uncertainty.
    pub thickness_mm: Measured,
    /// Refractive index of the sample.
    pub eta: f64,
    /// Refractive index of clear slides on both sides, if there are.
    pub eta_slide: Option<f64>,
    /// Cosine of the angle of incidence.
    pub cos_in: f64,
    /// Total reflectance, the specular part included.
    pub reflectance: Measured,
    /// Total transmittance, unscattered light included.
    pub transmittance: Measured,
    /// The third thing known.
    pub third: Third,
}

/// A number found, with its standard uncertainty and 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Best estimate.
    pub value: f64,
    /// Standard uncertainty.
    pub u: f64,
    /// 95 % interval.
    pub ci95: (f64, f64),
}

/// What a sample was found to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Inversion {
    /// Absorption coefficient, mm⁻¹.
    pub sigma_a: Found,
    /// Scattering coefficient, mm⁻¹.
    pub sigma_s: Found,
    /// Mean cosine; what was given, where it was.
    pub g: Found,
    /// Correlation of σₐ and σₛ.
    pub correlation: f64,
    /// Whether σₐ lies at 0, and its interval is an upper limit (one-sided, 95 %).
    pub at_bound: bool,
    /// Smallest σₐ that this measurement would tell from 0 (95 % in both errors), mm⁻¹.
    pub sigma_a_detectable: f64,
    /// Other media that give the same R and T: σₐ, σₛ (mm⁻¹) and g of each.
    pub others: Vec<(f64, f64, f64)>,
}

/// No medium can be found.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum CannotInvert {
    /// A number that is none, or out of its range.
    #[error("{name} must be {expected}, got {found}")]
    Value {
        /// Which number.
        name: &'static str,
        /// What it should be.
        expected: &'static str,
        /// What it is.
        found: f64,
    },
    /// More light comes out than went in.
    #[error(
        "reflectance and transmittance add up to {sum}, more than 1 by more than 3 u ({u}): \
         check the reference, and whether light was counted twice"
    )]
    MoreThanAll {
        /// R + T.
        sum: f64,
        /// Its standard uncertainty.
        u: f64,
    },
    /// R lies below what the surfaces alone reflect.
    #[error(
        "the reflectance {reflectance} lies below {surface}, which the first surface alone \
         reflects: it must include the specular part; add it, or mend the index"
    )]
    BelowSurface {
        /// As measured.
        reflectance: f64,
        /// Fresnel's.
        surface: f64,
    },
    /// No medium gives these shares.
    #[error(
        "no medium reflects {reflectance} and transmits {transmittance} here; the nearest reflects \
         {nearest_reflectance} and transmits {nearest_transmittance}: check thickness, indices and g"
    )]
    NoMedium {
        /// As measured.
        reflectance: f64,
        /// As measured.
        transmittance: f64,
        /// Of the nearest medium.
        nearest_reflectance: f64,
        /// Of the nearest medium.
        nearest_transmittance: f64,
    },
    /// The medium cannot be solved.
    #[error(transparent)]
    Solve(#[from] CannotSolve),
}

/// A trial medium: 1 − albedo, optical thickness, mean cosine.
#[derive(Clone, Copy, Debug)]
struct Trial {
    loss: f64,
    tau: f64,
    g: f64,
}

impl SphereSample {
    fn check(&self) -> Result<(), CannotInvert> {
        let bad = |name, expected, found| {
            Err(CannotInvert::Value {
                name,
                expected,
                found,
            })
        };
        let within = |x: f64, low: f64, high: f64| x >= low && x <= high;
        let mut shares = vec![
            ("reflectance", self.reflectance),
            ("transmittance", self.transmittance),
        ];
        if let Third::Collimated(collimated) = self.third {
            shares.push(("collimated_transmittance", collimated));
        }
        for (name, share) in shares {
            if !(share.value > 0.0 && share.value < 1.0) {
                return bad(
                    name,
                    "above 0 and below 1 (a share, not percent)",
                    share.value,
                );
            }
            if !within(share.u, 0.0, 1.0) {
                return bad("the uncertainty of a share", "between 0 and 1", share.u);
            }
        }
        let thickness = self.thickness_mm;
        if !(thickness.value > 0.0 && thickness.value.is_finite()) {
            return bad("thickness_mm", "above 0", thickness.value);
        }
        if !(thickness.u >= 0.0 && thickness.u < thickness.value) {
            return bad(
                "u_thickness_mm",
                "at least 0 and below the thickness",
                thickness.u,
            );
        }
        if !(self.cos_in > 0.0 && self.cos_in <= 1.0) {
            return bad(
                "the cosine of incidence",
                "above 0 and at most 1",
                self.cos_in,
            );
        }
        for eta in [self.eta, self.eta_slide.unwrap_or(1.0)] {
            if !within(eta, 1.0, 5.0) {
                return bad("a refractive index", "between 1 and 5", eta);
            }
        }
        match self.third {
            Third::MeanCosine(g) if !within(g.value, MEAN_COSINE.0, MEAN_COSINE.1) => {
                return bad("g", "between -0.95 and 0.99", g.value);
            }
            Third::MeanCosine(g) if !within(g.u, 0.0, 1.0) => {
                return bad("u_g", "between 0 and 1", g.u);
            }
            _ => {}
        }
        let (r, t) = (self.reflectance, self.transmittance);
        let (sum, u) = (r.value + t.value, r.u.hypot(t.u));
        if sum > 1.0 + 3.0 * u {
            return Err(CannotInvert::MoreThanAll { sum, u });
        }
        let outer = self.eta_slide.unwrap_or(self.eta);
        let surface = physics::fresnel::reflectance(outer, self.cos_in);
        if r.value + 3.0 * r.u < surface {
            return Err(CannotInvert::BelowSurface {
                reflectance: r.value,
                surface,
            });
        }
        Ok(())
    }

    fn medium(&self, trial: Trial) -> LayeredMedium {
        let thickness = self.thickness_mm.value;
        let sigma_t = trial.tau / thickness;
        let mut layers = vec![Layer {
            sigma_a: trial.loss * sigma_t,
            sigma_s: (1.0 - trial.loss) * sigma_t,
            phase: Phase::HenyeyGreenstein { g: trial.g },
            eta: self.eta,
            thickness_mm: Some(thickness),
        }];
        if let Some(eta) = self.eta_slide {
            let slide = Layer {
                sigma_a: 0.0,
                sigma_s: 0.0,
                phase: Phase::ISOTROPIC,
                eta,
                thickness_mm: Some(SLIDE_MM),
            };
            layers.insert(0, slide.clone());
            layers.push(slide);
        }
        LayeredMedium {
            layers,
            eta_above: 1.0,
            eta_below: 1.0,
        }
    }

    /// R and T of a trial.
    fn shares(&self, trial: Trial, resolution: Resolution) -> Result<[f64; 2], CannotInvert> {
        let response = solve_with(&self.medium(trial), &[self.cos_in], &[], resolution)?;
        Ok([response.reflectance[0], response.transmittance[0]])
    }

    fn collimated(&self, trial: Trial) -> f64 {
        first_order::unscattered(&self.medium(trial), self.cos_in).1
    }

    /// The optical thickness that lets `share` pass unscattered.
    fn optical_thickness(&self, share: f64) -> f64 {
        let passes = |tau: f64| {
            self.collimated(Trial {
                loss: 0.5,
                tau,
                g: 0.0,
            })
        };
        let (mut low, mut high) = (0.0, 800.0);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if passes(middle) > share {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }

    /// The albedo at which R + T is what was measured, and the excess of R there; the sum falls
    /// steadily with absorption.
    fn with_measured_sum(
        &self,
        at: impl Fn(f64) -> Trial,
        resolution: Resolution,
    ) -> Result<(f64, f64), CannotInvert> {
        let wanted = self.reflectance.value + self.transmittance.value;
        let excess = |x: f64| -> Result<(f64, f64), CannotInvert> {
            let [r, t] = self.shares(at(loss(x)), resolution)?;
            Ok((r + t - wanted, r - self.reflectance.value))
        };
        // x from no absorption to all of it; 1 − albedo = x² is near to linear in the sum.
        let (mut low, mut high) = (0.0, 1.0);
        let first = excess(low)?;
        if first.0 <= 0.0 {
            return Ok((loss(low), first.1));
        }
        let last = excess(high)?;
        if last.0 >= 0.0 {
            // So thin that even a black one passes more.
            return Ok((loss(high), last.1));
        }
        let mut ends = [first.0, last.0];
        let (mut x, mut here, mut side) = (low, first, 0);
        for _ in 0..60 {
            x = low + (high - low) * ends[0] / (ends[0] - ends[1]);
            here = excess(x)?;
            if here.0.abs() < 1e-8 || high - low < 1e-10 {
                break;
            }
            // Regula falsi; the Illinois rule halves an end that stays for a second time.
            let above = usize::from(here.0 <= 0.0);
            if above == 0 {
                (low, ends[0]) = (x, here.0);
            } else {
                (high, ends[1]) = (x, here.0);
            }
            if side == above + 1 {
                ends[1 - above] *= 0.5;
            }
            side = above + 1;
        }
        Ok((loss(x), here.1))
    }

    /// Finds the medium.
    ///
    /// # Errors
    ///
    /// [`CannotInvert`] names what cannot be: numbers that are none, more light than there was, or
    /// shares that no medium gives.
    ///
    /// # Source
    ///
    /// Prahl, van Gemert and Welch (1993), Appl. Opt. 32, 559, have the idea: adding-doubling inside
    /// an inversion. Here the sum R + T fixes the albedo at every optical thickness (or every g), so
    /// that one root in one unknown is left, and a scan sees all of them.
    pub fn invert(&self) -> Result<Inversion, CannotInvert> {
        self.check()?;
        let (low, high) = match self.third {
            Third::MeanCosine(_) => (OPTICAL_THICKNESS.0.ln(), OPTICAL_THICKNESS.1.ln()),
            Third::Collimated(_) => MEAN_COSINE,
        };
        let fixed_tau = match self.third {
            Third::MeanCosine(_) => 0.0,
            Third::Collimated(share) => self.optical_thickness(share.value),
        };
        let trial = |p: f64, loss: f64| match self.third {
            Third::MeanCosine(g) => Trial {
                loss,
                tau: p.exp(),
                g: g.value,
            },
            Third::Collimated(_) => Trial {
                loss,
                tau: fixed_tau,
                g: p,
            },
        };
        // Excess of R along the curve of the measured sum, at every step of the scan.
        let mut scan = Vec::with_capacity(SCAN + 1);
        for i in 0..=SCAN {
            let p = low + (high - low) * i as f64 / SCAN as f64;
            let (loss, excess) = self.with_measured_sum(|loss| trial(p, loss), COARSE)?;
            scan.push((p, loss, excess));
        }
        let mut solutions: Vec<Trial> = vec![];
        for pair in scan.windows(2) {
            let [(p, loss, excess), (next, other, after)] = [pair[0], pair[1]];
            if excess.signum() == after.signum() {
                continue;
            }
            let share = excess / (excess - after);
            let start = trial(
                p + share * (next - p),
                (loss + share * (other - loss)).max(0.0),
            );
            if let Some(solution) = self.refine(start)?
                && !solutions.iter().any(|s| same(s, &solution))
            {
                solutions.push(solution);
            }
        }
        let Some((best, others)) = solutions.split_first() else {
            // The nearest is where the excess is least.
            let nearest = scan
                .iter()
                .min_by(|a, b| a.2.abs().total_cmp(&b.2.abs()))
                .expect("a scan has steps");
            let start = trial(nearest.0, nearest.1);
            if let Some(solution) = self.refine(start)? {
                return self.conclude(solution, &[]);
            }
            let [r, t] = self.shares(start, Resolution::FINE)?;
            return Err(CannotInvert::NoMedium {
                reflectance: self.reflectance.value,
                transmittance: self.transmittance.value,
                nearest_reflectance: r,
                nearest_transmittance: t,
            });
        };
        self.conclude(*best, others)
    }

    /// Unknowns of a trial: loss·τ (absorption), (1 − loss)·τ (scattering), g.
    fn unknowns(&self, trial: Trial) -> DVector<f64> {
        let all = [
            trial.loss * trial.tau,
            (1.0 - trial.loss) * trial.tau,
            trial.g,
        ];
        let count = match self.third {
            Third::MeanCosine(_) => 2,
            Third::Collimated(_) => 3,
        };
        DVector::from_column_slice(&all[..count])
    }

    fn trial(&self, unknowns: &DVector<f64>) -> Trial {
        let (a, s) = (unknowns[0].max(0.0), unknowns[1].max(1e-12));
        let g = match self.third {
            Third::MeanCosine(g) => g.value,
            Third::Collimated(_) => unknowns[2].clamp(-0.999, 0.999),
        };
        Trial {
            loss: a / (a + s),
            tau: a + s,
            g,
        }
    }

    fn data(&self, trial: Trial) -> Result<DVector<f64>, CannotInvert> {
        let [r, t] = self.shares(trial, Resolution::FINE)?;
        Ok(match self.third {
            Third::MeanCosine(_) => DVector::from_column_slice(&[r, t]),
            Third::Collimated(_) => DVector::from_column_slice(&[r, t, self.collimated(trial)]),
        })
    }

    fn measured(&self) -> Vec<Measured> {
        let mut all = vec![self.reflectance, self.transmittance];
        if let Third::Collimated(collimated) = self.third {
            all.push(collimated);
        }
        all
    }

    /// Data and their derivatives by the unknowns, one-sided at the bound of no absorption.
    fn jacobian(&self, at: &DVector<f64>) -> Result<(DVector<f64>, DMatrix<f64>), CannotInvert> {
        let here = self.data(self.trial(at))?;
        let mut slopes = DMatrix::zeros(here.len(), at.len());
        for k in 0..at.len() {
            let step = match k {
                0 => 1e-4 * (at[0] + 1e-3 * at[1]),
                1 => 1e-4 * at[1],
                _ => 1e-4,
            };
            let mut ahead = at.clone();
            ahead[k] += step;
            let forward = self.data(self.trial(&ahead))?;
            let slope = if k == 0 && at[0] < step {
                (forward - &here) / step
            } else {
                let mut behind = at.clone();
                behind[k] -= step;
                (forward - self.data(self.trial(&behind))?) / (2.0 * step)
            };
            slopes.set_column(k, &slope);
        }
        Ok((here, slopes))
    }

    /// Newton's method from a start of the scan, absorption held at 0 or above. `None` where it
    /// leads nowhere.
    fn refine(&self, start: Trial) -> Result<Option<Trial>, CannotInvert> {
        let wanted = DVector::from_iterator(
            self.measured().len(),
            self.measured().iter().map(|m| m.value),
        );
        let mut at = self.unknowns(start);
        for _ in 0..30 {
            let (here, slopes) = self.jacobian(&at)?;
            let off = &wanted - here;
            let Some(mut step) = slopes.clone().lu().solve(&off) else {
                return Ok(None);
            };
            if at[0] + step[0] < 0.0 {
                // Along the bound the rest is a least-squares problem.
                let rest = slopes.columns(1, at.len() - 1).into_owned();
                let off = &off + slopes.column(0) * at[0];
                let Ok(free) = rest.svd(true, true).solve(&off, 1e-12) else {
                    return Ok(None);
                };
                step[0] = -at[0];
                step.rows_mut(1, free.len()).copy_from(&free);
            }
            // No step changes scattering more than twofold.
            let limit = (step[1].abs() / (0.5 * at[1])).max(1.0);
            step /= limit;
            at += &step;
            if limit == 1.0
                && step[1].abs() <= 1e-9 * at[1]
                && step[0].abs() <= 1e-9 * (at[0] + 1e-6)
            {
                let found = self.trial(&at);
                let rest = (&wanted - self.data(found)?).amax();
                // At the bound the data need not be met.
                let close = 1e-7 + 5.0 * self.reflectance.u.hypot(self.transmittance.u);
                let met = rest < 1e-7 || (at[0] <= 0.0 && rest < close);
                return Ok(met.then_some(found));
            }
        }
        Ok(None)
    }

    /// The inversion that ended in `best`.
    fn conclude(&self, best: Trial, others: &[Trial]) -> Result<Inversion, CannotInvert> {
        let at = self.unknowns(best);
        let (here, slopes) = self.jacobian(&at)?;
        let singular = || CannotInvert::NoMedium {
            reflectance: self.reflectance.value,
            transmittance: self.transmittance.value,
            nearest_reflectance: here[0],
            nearest_transmittance: here[1],
        };
        let inverse = slopes.clone().try_inverse().ok_or_else(singular)?;
        let measured = self.measured();
        let d = self.thickness_mm.value;
        // Columns: what one standard uncertainty of each input does to σₐ, σₛ and g.
        let mut columns: Vec<[f64; 3]> = vec![];
        let third = |shift: &DVector<f64>| if shift.len() > 2 { shift[2] } else { 0.0 };
        for (k, share) in measured.iter().enumerate() {
            let shift = inverse.column(k) * share.u;
            columns.push([shift[0] / d, shift[1] / d, third(&shift)]);
        }
        let relative = self.thickness_mm.u / d;
        columns.push([-at[0] / d * relative, -at[1] / d * relative, 0.0]);
        if let Third::MeanCosine(g) = self.third
            && g.u > 0.0
        {
            let step = 1e-3_f64.min(0.5 * (1.0 - g.value));
            let moved = self.data(Trial {
                g: g.value - step,
                ..best
            })?;
            let shift = &inverse * (moved - &here) * (g.u / step);
            columns.push([shift[0] / d, shift[1] / d, g.u]);
        }
        let sum = |i: usize, j: usize| columns.iter().map(|c| c[i] * c[j]).sum::<f64>();
        let found = |i: usize, value: f64| {
            let u = sum(i, i).sqrt();
            let reach = NORMAL_95_TWO_SIDED * u;
            Found {
                value,
                u,
                ci95: (value - reach, value + reach),
            }
        };
        let at_bound = best.loss <= LEAST_LOSS;
        // Where the data ask for less than no absorption, so does the linear estimate.
        let off = DVector::from_iterator(
            measured.len(),
            measured.iter().zip(here.iter()).map(|(m, h)| m.value - h),
        );
        let linear = (at[0] + (&inverse * off)[0]) / d;
        let mut sigma_a = found(0, at[0] / d);
        if at_bound {
            let limit = (linear + NORMAL_95_ONE_SIDED * sigma_a.u).max(0.0);
            sigma_a.ci95 = (0.0, limit.max(NORMAL_95_ONE_SIDED * sigma_a.u * 0.5));
        }
        sigma_a.ci95.0 = sigma_a.ci95.0.max(0.0);
        let mut sigma_s = found(1, at[1] / d);
        sigma_s.ci95.0 = sigma_s.ci95.0.max(0.0);
        let both = sigma_a.u * sigma_s.u;
        Ok(Inversion {
            correlation: if both > 0.0 { sum(0, 1) / both } else { 0.0 },
            at_bound,
            sigma_a_detectable: self.detectable(best)?,
            others: others
                .iter()
                .map(|t| (t.loss * t.tau / d, (1.0 - t.loss) * t.tau / d, t.g))
                .collect(),
            g: found(2, best.g),
            sigma_a,
            sigma_s,
        })
    }

    /// 3.29 standard uncertainties of σₐ where there is none (Currie 1968), mm⁻¹.
    fn detectable(&self, best: Trial) -> Result<f64, CannotInvert> {
        let white = Trial { loss: 0.0, ..best };
        let (_, slopes) = self.jacobian(&self.unknowns(white))?;
        let Some(inverse) = slopes.try_inverse() else {
            return Ok(f64::INFINITY);
        };
        let measured = self.measured();
        let shares = measured.iter().enumerate();
        let u2: f64 = shares.map(|(k, m)| (inverse[(0, k)] * m.u).powi(2)).sum();
        Ok(2.0 * NORMAL_95_ONE_SIDED * u2.sqrt() / self.thickness_mm.value)
    }
}

/// 1 − albedo of the coordinate of the inner root.
fn loss(x: f64) -> f64 {
    x * x
}

fn same(a: &Trial, b: &Trial) -> bool {
    (a.tau / b.tau - 1.0).abs() < 1e-4 && (a.g - b.g).abs() < 1e-4
}

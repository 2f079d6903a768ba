//! From a solution to numbers with their uncertainties.

use crate::budget::Contribution;
use crate::options::{Constraint, Direction, DirectionKind};
use crate::problem::{Level, Problem, jacobian};
use crate::result::{Estimate, Fit, Residual, Termination, TotalFit, Warning};
use crate::solve::Solution;
use nalgebra::{Matrix2, Vector2};
use statrs::distribution::{ChiSquared, ContinuousCDF};

const NORMAL_95_TWO_SIDED: f64 = 1.959_963_984_540_054;
const NORMAL_95_ONE_SIDED: f64 = 1.644_853_626_951_472;

/// Residuals beyond noise at this probability widen the uncertainties.
const POOR_FIT_PROBABILITY: f64 = 1e-3;
/// Lines of the budget that the fit itself propagates: the noise of profile and total,
pub(crate) const NOISE: &str = "photon, read and dark noise";
/// the scale that they share,
pub(crate) const SCALE: &str = "shared scale";
/// and the model's own discrepancy.
pub(crate) const MODEL: &str = "model error";
/// Standard uncertainties of the scale beyond which it is named.
const SCALE_OFF: f64 = 4.0;
/// The same of any other input that the fit carries along.
const INPUT_OFF: f64 = 4.0;
/// Standard uncertainties of v from 0 within which the interval of σₐ is that of its profile
/// likelihood: beyond, the other is as wide to a few percent.
const NEAR_ZERO: f64 = 8.0;
const MUCH_LIGHT_OUTSIDE: f64 = 0.05;

/// What a fit says in numbers, without what it takes memory to hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Summary {
    pub(crate) sigma_a: Estimate,
    pub(crate) sigma_s_prime: Estimate,
    pub(crate) correlation: f64,
    pub(crate) upper_limit: Option<f64>,
    pub(crate) total: Option<TotalFit>,
    pub(crate) scale: f64,
    pub(crate) range_mm: (f64, f64),
    pub(crate) share_outside: f64,
    pub(crate) reduced_chi2: f64,
    /// Factor by which χ² widened the uncertainties.
    pub(crate) widened: f64,
    pub(crate) evaluations: usize,
    pub(crate) termination: Termination,
    albedo_prime: f64,
    /// α′ below which the model is not to be trusted.
    least_albedo_prime: f64,
}

fn inverse(hessian: Matrix2<f64>) -> Matrix2<f64> {
    hessian
        .try_inverse()
        .unwrap_or_else(|| Matrix2::from_diagonal_element(f64::INFINITY))
}

impl Problem<'_> {
    /// What `solution` says in numbers.
    pub(crate) fn summary(&mut self, solution: &Solution) -> Summary {
        let &Solution {
            point,
            chi2,
            scale,
            evaluations,
            termination,
            ..
        } = solution;
        let data = self.data;
        let options = data.options;
        let at = point.coefficients(self.epsilon);
        let t = at.sigma_t_prime();
        let exact = options.constraint == Constraint::Exact;
        let covariance = self.covariance(solution);

        // A nuisance with a prior costs nothing: the prior is a datum. One without does.
        let unknown = usize::from(!exact && options.u_scale_relative == f64::INFINITY);
        let free = if exact { 1 } else { 2 } + unknown;
        let extra = usize::from(!exact && data.total.is_some());
        let freedom = (self.points + extra).saturating_sub(free) as f64;
        let reduced_chi2 = if freedom > 0.0 { chi2 / freedom } else { 0.0 };
        // Three standard deviations above its mean no chi-squared is that improbable yet.
        let probability = if chi2 > freedom + 3.0 * (2.0 * freedom).sqrt() {
            ChiSquared::new(freedom).map_or(1.0, |d| d.sf(chi2))
        } else {
            1.0
        };
        let widened = if probability < POOR_FIT_PROBABILITY {
            reduced_chi2.sqrt().max(1.0)
        } else {
            1.0
        };

        let covariance = covariance * (widened * widened);
        let (in_a, in_s) = jacobian(point.tau, self.epsilon, at);
        let u_s = in_s.dot(&(covariance * in_s)).max(0.0).sqrt();
        let variance_a = in_a.dot(&(covariance * in_a)).max(0.0);
        let mixed = in_a.dot(&(covariance * in_s));
        // The interval is symmetric in v = τ/√(3σₜ′), where the data are linear, and not in
        // σₐ = v(v + 2c): near 0 the two differ.
        let shrink = 1.0 / (3.0 * t).sqrt();
        let (v, c) = (point.tau * shrink, self.epsilon * shrink);
        let u_v = variance_a.sqrt() / (2.0 * (v + c));
        let sigma_a = |v: f64| v.max(0.0) * (v.max(0.0) + 2.0 * c);
        // Of a squared normal variate, whose curvature matters near 0 alone.
        let u_a = (variance_a + 2.0 * u_v.powi(4)).sqrt();
        // Near 0 no coordinate makes it symmetric. Under the hard constraint u is noise's alone.
        let near_zero = !exact && v < NEAR_ZERO * u_v;
        let mut end = |z: f64| {
            let likely = near_zero.then(|| self.likelihood_end(solution, z * widened));
            likely.flatten().unwrap_or_else(|| sigma_a(v + z * u_v))
        };
        let (low, high) = (end(-NORMAL_95_TWO_SIDED), end(NORMAL_95_TWO_SIDED));
        let above = data.total.is_some_and(|t| t.total > options.entry_factor);
        let upper_limit = (low == 0.0 || above).then(|| end(NORMAL_95_ONE_SIDED));
        // Noise that was estimated from the residuals is known as well as they tell it.
        let degrees_of_freedom = if widened > 1.0 {
            freedom
        } else {
            f64::INFINITY
        };
        let value_a = if termination == Termination::AtBound {
            0.0
        } else {
            at.sigma_a
        };
        let model = data.model;
        let share_outside = model.beyond(at, data.geometry.outer_mm) / model.beyond(at, 0.0);
        let total = data.total.map(|t| TotalFit {
            measured: t.total,
            u: t.u,
            model: self.enclosed(point).value,
            radius_max_mm: t.radius_max_mm,
        });
        Summary {
            sigma_a: Estimate {
                value: value_a,
                u: u_a,
                ci95: (low, high),
                degrees_of_freedom,
            },
            sigma_s_prime: Estimate {
                value: at.sigma_s_prime,
                u: u_s,
                ci95: (
                    (at.sigma_s_prime - NORMAL_95_TWO_SIDED * u_s).max(0.0),
                    at.sigma_s_prime + NORMAL_95_TWO_SIDED * u_s,
                ),
                degrees_of_freedom,
            },
            correlation: if variance_a > 0.0 && u_s > 0.0 {
                mixed / (u_a * u_s)
            } else {
                0.0
            },
            upper_limit,
            total,
            scale,
            range_mm: self.range,
            share_outside,
            reduced_chi2,
            widened,
            evaluations,
            termination,
            albedo_prime: at.albedo_prime(),
            least_albedo_prime: model.trust().least_albedo_prime,
        }
    }

    /// That of (τ, λ) at a solution.
    fn covariance(&mut self, solution: &Solution) -> Matrix2<f64> {
        if self.data.options.constraint != Constraint::Exact {
            return inverse(solution.hessian);
        }
        // At the bound both are free, for what the constraint says is no longer heeded.
        if solution.termination == Termination::AtBound {
            return inverse(self.normal(Level::Full, solution.point).hessian);
        }
        let along = Vector2::new(solution.tau_slope, 1.0);
        along * along.transpose() / along.dot(&(solution.hessian * along))
    }

    /// Leaves the model at the solution in the workspace.
    fn evaluate(&mut self, solution: &Solution) {
        match self.data.options.constraint {
            Constraint::Exact => self.along_constraint(Level::Full, solution.point),
            _ => self.normal(Level::Full, solution.point),
        };
    }

    /// The points that took part, beside the model of the last evaluation.
    fn residuals(&self, scale: f64) -> Vec<Residual> {
        let data = self.data;
        let fitted = self.span.clone().enumerate();
        fitted
            .filter(|&(row, _)| self.memory.full.weight[row] > 0.0)
            .map(|(row, i)| Residual {
                radius_mm: data.geometry.radii[i],
                measured_per_mm2: data.value[i],
                u_per_mm2: data.u[i],
                model_per_mm2: scale * self.memory.full.value[row],
                nuisances_per_mm2: self.memory.full.fitted(row, scale)
                    - scale * self.memory.full.value[row],
            })
            .collect()
    }

    /// What the fit itself propagates, line by line, at the last evaluation.
    fn budget(&self, solution: &Solution, summary: &Summary) -> Vec<Contribution> {
        let options = self.data.options;
        let exact = options.constraint == Constraint::Exact;
        let (u_a, u_s) = (summary.sigma_a.u, summary.sigma_s_prime.u);
        let one_way = exact && solution.termination != Termination::AtBound;
        // In units of the uncertainties themselves, so that nothing is small beside another.
        let basis = if one_way {
            let at = self.coefficients(solution);
            let (in_a, in_s) = jacobian(solution.point.tau, self.epsilon, at);
            let along = Vector2::new(solution.tau_slope, 1.0);
            let along = Vector2::new(in_a.dot(&along), in_s.dot(&along));
            vec![along * (u_s / along.y.abs().max(f64::MIN_POSITIVE))]
        } else {
            vec![Vector2::new(u_a, 0.0), Vector2::new(0.0, u_s)]
        };
        let precision =
            (!exact && options.u_scale_relative > 0.0).then(|| options.u_scale_relative.powi(-2));
        let shares = self.memory.full.shares(&basis, summary.scale, precision);
        let sum: Matrix2<f64> = shares.iter().sum();
        // Of σₐ near 0, where u holds the curvature as well, every line takes its part.
        let whole = |u: f64, sum: f64| if sum > 0.0 { u / sum.sqrt() } else { 0.0 };
        let (of_a, of_s) = (whole(u_a, sum[(0, 0)]), whole(u_s, sum[(1, 1)]));
        let of_kind = |kind| {
            let directions = options.directions.iter();
            directions.filter(move |d| d.kind == kind).map(|d| d.source)
        };
        let relative = of_kind(DirectionKind::Relative);
        let own = self.memory.full.relative_count - relative.clone().count();
        let sources = [NOISE, SCALE]
            .into_iter()
            .chain(std::iter::repeat_n(MODEL, own))
            .chain(relative)
            .chain(of_kind(DirectionKind::Absolute));
        let mut lines: Vec<(&str, Matrix2<f64>)> = vec![];
        for (source, share) in sources.zip(shares) {
            match lines.iter_mut().find(|line| line.0 == source) {
                Some(line) => line.1 += share,
                None => lines.push((source, share)),
            }
        }
        lines
            .into_iter()
            .map(|(source, share)| {
                let (a, s) = (share[(0, 0)].max(0.0).sqrt(), share[(1, 1)].max(0.0).sqrt());
                Contribution {
                    source: source.to_owned(),
                    u_sigma_a: of_a * a,
                    u_sigma_s_prime: of_s * s,
                    correlation: if a > 0.0 && s > 0.0 {
                        (share[(0, 1)] / (a * s)).clamp(-1.0, 1.0)
                    } else {
                        0.0
                    },
                    degrees_of_freedom: summary.sigma_a.degrees_of_freedom,
                }
            })
            .filter(|c| c.u_sigma_a > 0.0 || c.u_sigma_s_prime > 0.0)
            .collect()
    }

    /// Where the last evaluation has the directions of the options, in their order.
    fn nuisances(&self) -> Vec<f64> {
        let full = &self.memory.full;
        let directions = &self.data.options.directions;
        let relative = directions.iter().filter(|d| is_relative(d)).count();
        let (own, mut absolute) = full.directions().split_at(full.relative_count);
        let mut relative = &own[own.len() - relative..];
        directions
            .iter()
            .filter_map(|d| {
                let from = if is_relative(d) {
                    &mut relative
                } else {
                    &mut absolute
                };
                from.split_off_first().copied()
            })
            .collect()
    }

    /// The fit that `solution` stands for; `trusted` is what the choice of the range warned of.
    pub(crate) fn conclude(&mut self, solution: &Solution, trusted: Option<Warning>) -> Fit {
        let summary = self.summary(solution);
        self.evaluate(solution);
        let mut warnings: Vec<Warning> = trusted.into_iter().collect();
        let nuisances = self.nuisances();
        let options = self.data.options;
        summary.warn(
            options.u_scale_relative,
            options.entry_factor,
            &mut warnings,
        );
        warnings.extend(inputs_off(&options.directions, &nuisances));
        Fit {
            channel: (self.data.channel)(),
            sigma_a: summary.sigma_a,
            sigma_s_prime: summary.sigma_s_prime,
            correlation: summary.correlation,
            budget: self.budget(solution, &summary),
            upper_limit: summary.upper_limit,
            total: summary.total,
            scale: summary.scale,
            range_mm: summary.range_mm,
            share_outside: summary.share_outside,
            reduced_chi2: summary.reduced_chi2,
            evaluations: summary.evaluations,
            termination: summary.termination,
            warnings,
            residuals: self.residuals(summary.scale),
            nuisances,
        }
    }
}

fn is_relative(direction: &Direction) -> bool {
    direction.kind == DirectionKind::Relative
}

/// The inputs, each once, that the data want elsewhere than stated. That a model holds is what χ²
/// judges.
fn inputs_off(directions: &[Direction], nuisances: &[f64]) -> Vec<Warning> {
    let mut far: Vec<(&'static str, f64)> = vec![];
    let inputs = directions.iter().zip(nuisances);
    for (direction, off) in inputs.filter(|(d, _)| d.source != MODEL) {
        match far.iter_mut().find(|f| f.0 == direction.source) {
            Some(most) => most.1 = most.1.max(off.abs()),
            None => far.push((direction.source, off.abs())),
        }
    }
    far.retain(|f| f.1 > INPUT_OFF);
    far.into_iter()
        .map(|(input, off)| Warning::InputOff { input, off })
        .collect()
}

impl Summary {
    /// What a user should know of these numbers.
    pub(crate) fn warn(&self, u_scale: f64, ceiling: f64, warnings: &mut Vec<Warning>) {
        if self.widened > 1.0 {
            warnings.push(Warning::PoorFit {
                reduced_chi2: self.reduced_chi2,
                widened: self.widened,
            });
        }
        if u_scale > 0.0 && (self.scale - 1.0).abs() > SCALE_OFF * u_scale {
            warnings.push(Warning::ScaleOff {
                scale: self.scale,
                u: u_scale,
            });
        }
        if let Some(upper_limit) = self.upper_limit {
            warnings.push(Warning::UpperLimitOnly { upper_limit });
        }
        if self.share_outside > MUCH_LIGHT_OUTSIDE {
            warnings.push(Warning::LightOutside {
                percent: 100.0 * self.share_outside,
            });
        }
        if self.albedo_prime < self.least_albedo_prime {
            warnings.push(Warning::LowAlbedo {
                albedo_prime: self.albedo_prime,
            });
        }
        if let Some(total) = self.total.filter(|t| t.measured > ceiling) {
            warnings.push(Warning::TotalAtCeiling {
                total: total.measured,
                ceiling,
            });
        }
    }
}

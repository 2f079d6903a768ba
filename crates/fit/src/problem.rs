//! The weighted least-squares problem: which data, with which weight, against which model.

use crate::budget::Contribution;
use crate::options::{Constraint, FitOptions};
use crate::range;
use crate::result::{Estimate, Fit, FitError, Residual, Termination, TotalFit, Warning};
use crate::solve::Solution;
use nalgebra::{Matrix2, Vector2};
use physics::{Coefficients, Footprints, ForwardModel, Gradient, RadialProfile, TotalReflectance};
use statrs::distribution::{ChiSquared, ContinuousCDF};

const NORMAL_95_TWO_SIDED: f64 = 1.959_963_984_540_054;
const NORMAL_95_ONE_SIDED: f64 = 1.644_853_626_951_472;

/// Residuals beyond noise at this probability widen the uncertainties.
const POOR_FIT_PROBABILITY: f64 = 1e-3;
/// What the fit itself propagates: the data's noise, the total's, and the shared scale's.
const OWN: &str = "noise and shared scale";
const LOW_ALBEDO: f64 = 0.5;
/// Standard uncertainties of the scale beyond which it is named.
const SCALE_OFF: f64 = 4.0;
const MUCH_LIGHT_OUTSIDE: f64 = 0.05;

/// Where the search stands: the coordinates in which the data are nearly linear.
///
/// λ = ln σₜ′ is a pure scale of length. τ = √(σₜᵣ² + ε²) − ε stands for absorption, with ε the
/// inverse of the radius that the data reach: far from σₐ = 0 it is σₜᵣ itself, whose exponential
/// the tail follows; near it is σₜᵣ²/2ε ∝ σₐ, in which R_d within a finite picture is linear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub(crate) tau: f64,
    pub(crate) lambda: f64,
}

impl Point {
    pub(crate) fn sigma_tr(self, epsilon: f64) -> f64 {
        (self.tau * (self.tau + 2.0 * epsilon)).sqrt()
    }

    pub(crate) fn coefficients(self, epsilon: f64) -> Coefficients {
        Coefficients::from_sigma_tr(self.sigma_tr(epsilon), self.lambda.exp())
    }
}

/// A model value with its derivatives in τ and λ.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sensitivity {
    pub(crate) value: f64,
    pub(crate) in_tau: f64,
    pub(crate) in_lambda: f64,
}

/// How σₐ and σₛ′ change with (τ, λ).
fn jacobian(point: Point, epsilon: f64) -> (Vector2<f64>, Vector2<f64>) {
    let Coefficients { sigma_a, .. } = point.coefficients(epsilon);
    let t = point.lambda.exp();
    let a_in_tau = 2.0 / 3.0 * (point.tau + epsilon) / t;
    (
        Vector2::new(a_in_tau, -sigma_a),
        Vector2::new(-a_in_tau, t + sigma_a),
    )
}

/// One datum and its weight, the inverse variance.
#[derive(Clone, Copy, Debug)]
struct Datum {
    value: f64,
    weight: f64,
}

/// How the total takes part as a datum.
#[derive(Clone, Copy, Debug)]
enum TotalDatum {
    /// It was measured apart from the profile.
    Independent(Datum),
    /// It is the sum of the same picture: what remains of it outside the fitted rings, which is
    /// independent of them. Counting the pixels once this way is the same as carrying the
    /// covariance of total and rings.
    Remainder(Datum),
}

/// What the total says, and where.
#[derive(Clone, Debug)]
struct Total {
    measured: TotalReflectance,
    datum: TotalDatum,
}

/// χ² and what a Gauss-Newton step needs, with the scale factor eliminated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Normal {
    pub(crate) chi2: f64,
    /// Half the gradient of χ² in (τ, λ).
    pub(crate) gradient: Vector2<f64>,
    /// Half the Gauss-Newton Hessian of χ² in (τ, λ).
    pub(crate) hessian: Matrix2<f64>,
    pub(crate) scale: f64,
}

/// One channel's data beside one model.
pub(crate) struct Problem<'a> {
    profile: &'a RadialProfile,
    model: &'a dyn ForwardModel,
    pub(crate) options: &'a FitOptions,
    range: (f64, f64),
    footprints: Footprints,
    data: Vec<Datum>,
    areas: Vec<f64>,
    indices: Vec<usize>,
    total: Option<Total>,
    /// ε of [`Point`], mm⁻¹.
    pub(crate) epsilon: f64,
}

/// Refuses what no search could make sense of.
pub(crate) fn check(
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
    options: &FitOptions,
) -> Result<(), FitError> {
    let channel = || profile.channel.clone();
    let u_scale = options.u_scale_relative;
    if !(0.0..1.0).contains(&u_scale) {
        let expected = "at least 0 and below 1";
        return Err(FitError::BadOption {
            name: "u_scale_relative",
            found: u_scale,
            expected,
        });
    }
    let entry = options.entry_factor;
    if !(entry > 0.0 && entry <= 1.0) {
        let expected = "above 0 and at most 1";
        return Err(FitError::BadOption {
            name: "entry_factor",
            found: entry,
            expected,
        });
    }
    let mut previous_mm = f64::NEG_INFINITY;
    let mut best = f64::NEG_INFINITY;
    for p in &profile.points {
        let (value, u) = (p.reflectance_per_mm2, p.u_reflectance_per_mm2);
        if !(value.is_finite() && u.is_finite() && u > 0.0) {
            return Err(FitError::BadPoint {
                channel: channel(),
                radius_mm: p.radius_mm,
                value,
                u,
            });
        }
        if p.radius_mm <= previous_mm || !p.radius_mm.is_finite() || p.radius_mm < 0.0 {
            return Err(FitError::RadiiNotIncreasing {
                channel: channel(),
                radius_mm: p.radius_mm,
                previous_mm,
            });
        }
        previous_mm = p.radius_mm;
        best = best.max(value / u);
    }
    if profile.points.is_empty() {
        let (start_mm, end_mm) = options.range_mm.unwrap_or((0.0, 0.0));
        return Err(FitError::TooFewPoints {
            channel: channel(),
            points: 0,
            needed: needed(options.constraint),
            start_mm,
            end_mm,
        });
    }
    if best < 3.0 {
        return Err(FitError::NoSignal {
            channel: channel(),
            best,
        });
    }
    if options.constraint == Constraint::None {
        return Ok(());
    }
    let Some(t) = total else {
        return Err(FitError::NoTotal { channel: channel() });
    };
    let (total, u) = (t.total_reflectance, t.u_total_reflectance);
    let own_u_is_missing = options.constraint == Constraint::Joint && u == 0.0;
    if !(total.is_finite() && total > 0.0 && u.is_finite() && u >= 0.0) || own_u_is_missing {
        return Err(FitError::BadTotal {
            channel: channel(),
            total,
            u,
        });
    }
    let u = u.hypot(total * u_scale);
    if total > entry + 3.0 * u {
        return Err(FitError::TotalAboveCeiling {
            channel: channel(),
            total,
            u,
            ceiling: entry,
        });
    }
    Ok(())
}

/// Points it takes to leave a degree of freedom.
fn needed(constraint: Constraint) -> usize {
    if constraint == Constraint::Exact {
        2
    } else {
        3
    }
}

impl<'a> Problem<'a> {
    pub(crate) fn new(
        profile: &'a RadialProfile,
        total: Option<&TotalReflectance>,
        model: &'a dyn ForwardModel,
        options: &'a FitOptions,
        range: (f64, f64),
    ) -> Result<Self, FitError> {
        let edges = |i: usize| {
            let p = &profile.points[i];
            p.ring_mm.unwrap_or((p.radius_mm, p.radius_mm))
        };
        let indices: Vec<usize> = (0..profile.points.len())
            .filter(|&i| range::contains(range, edges(i)))
            .collect();
        if indices.len() < needed(options.constraint) {
            return Err(FitError::TooFewPoints {
                channel: profile.channel.clone(),
                points: indices.len(),
                needed: needed(options.constraint),
                start_mm: range.0,
                end_mm: range.1,
            });
        }
        let points: Vec<_> = indices.iter().map(|&i| profile.points[i]).collect();
        let data: Vec<Datum> = points
            .iter()
            .map(|p| Datum {
                value: p.reflectance_per_mm2,
                weight: p.u_reflectance_per_mm2.powi(-2),
            })
            .collect();
        // Rings outside the total's circle share no pixel with it.
        let reach = total.and_then(|t| t.radius_max_mm).unwrap_or(0.0) * (1.0 + 1e-9);
        let areas: Vec<f64> = points
            .iter()
            .map(|p| {
                if p.ring_mm.is_some_and(|r| r.1 <= reach) {
                    p.area_mm2()
                } else {
                    0.0
                }
            })
            .collect();
        let total = total
            .filter(|_| options.constraint != Constraint::None)
            .map(|measured| {
                let whole = measured.u_total_reflectance.powi(2);
                let (mut rest, mut variance) = (measured.total_reflectance, whole);
                for (datum, area) in data.iter().zip(&areas) {
                    rest -= area * datum.value;
                    variance -= area * area / datum.weight;
                }
                let datum = if variance > 1e-6 * whole && measured.radius_max_mm.is_some() {
                    TotalDatum::Remainder(Datum {
                        value: rest,
                        weight: 1.0 / variance,
                    })
                } else {
                    let value = measured.total_reflectance;
                    TotalDatum::Independent(Datum {
                        value,
                        weight: 1.0 / whole,
                    })
                };
                Total {
                    measured: measured.clone(),
                    datum,
                }
            });
        let footprints = Footprints::new(&points, &options.blur);
        let last = points
            .last()
            .map_or(0.0, |p| p.ring_mm.map_or(p.radius_mm, |r| r.1));
        let reach = match &total {
            Some(total) => total
                .measured
                .radius_max_mm
                .unwrap_or(f64::INFINITY)
                .max(last),
            None => last,
        };
        Ok(Self {
            profile,
            model,
            options,
            range,
            footprints,
            data,
            areas,
            indices,
            total,
            epsilon: 1.0 / reach,
        })
    }

    /// Bounds of τ at this λ: no absorption, and next to no scattering.
    pub(crate) fn tau_bounds(&self, lambda: f64) -> (f64, f64) {
        let highest = 3.0_f64.sqrt() * (1.0 - 1e-9) * lambda.exp();
        // On the whole plane the slope of the total in σₐ is infinite at 0 itself.
        let lowest = if self.epsilon > 0.0 {
            0.0
        } else {
            1e-9 * lambda.exp()
        };
        (lowest, highest.hypot(self.epsilon) - self.epsilon)
    }

    /// The model value whose derivatives in the coefficients are `gradient`.
    fn sensitivity(&self, gradient: Gradient, point: Point) -> Sensitivity {
        let (in_a, in_s) = jacobian(point, self.epsilon);
        let slope = in_a * gradient.in_sigma_a + in_s * gradient.in_sigma_s_prime;
        let factor = self.options.entry_factor;
        Sensitivity {
            value: factor * gradient.value,
            in_tau: factor * slope.x,
            in_lambda: factor * slope.y,
        }
    }

    /// Bounds of λ between which the data can mean anything: 1/σₜ′ from far wider than the
    /// picture to far finer than its first radius.
    pub(crate) fn lambda_bounds(&self) -> (f64, f64) {
        let radius = |i: usize| self.profile.points[i].radius_mm;
        let first = radius(0).max(1e-3 * radius(self.profile.points.len() - 1));
        let last = self
            .profile
            .points
            .last()
            .map_or(1.0, |p| p.radius_mm)
            .max(1e-9);
        ((0.02 / last).ln(), (50.0 / first.max(1e-9)).ln())
    }

    /// The measured total where the constraint takes it as exact.
    pub(crate) fn exact_total(&self) -> Option<f64> {
        self.total.as_ref().map(|t| t.measured.total_reflectance)
    }

    /// The least that the model's total may be while the measured one is not contradicted.
    pub(crate) fn least_total(&self) -> f64 {
        self.total.as_ref().map_or(0.0, |t| {
            let TotalReflectance {
                total_reflectance: total,
                u_total_reflectance: u,
                ..
            } = t.measured;
            total - 3.0 * u.hypot(total * self.options.u_scale_relative)
        })
    }

    /// The model's total inside the circle of the measured one.
    pub(crate) fn enclosed(&self, point: Point) -> Sensitivity {
        let radius = self
            .total
            .as_ref()
            .and_then(|t| t.measured.radius_max_mm)
            .unwrap_or(f64::INFINITY);
        let gradient = self.model.within(point.coefficients(self.epsilon), radius);
        self.sensitivity(gradient, point)
    }

    /// The model at every datum of the profile.
    fn rings(&self, point: Point) -> Vec<Sensitivity> {
        let at = point.coefficients(self.epsilon);
        let mut gradients = vec![Gradient::default(); self.data.len()];
        self.footprints
            .reflectance_gradient(self.model, at, &mut Vec::new(), &mut gradients);
        gradients
            .into_iter()
            .map(|g| self.sensitivity(g, point))
            .collect()
    }

    /// χ² of the profile alone along the constraint, where τ depends on λ with slope `tau_slope`,
    /// with half its gradient and half its Gauss-Newton curvature in λ.
    pub(crate) fn along_constraint(&self, point: Point, tau_slope: f64) -> (f64, f64, f64) {
        let (mut chi2, mut gradient, mut curvature) = (0.0, 0.0, 0.0);
        for (model, datum) in self.rings(point).iter().zip(&self.data) {
            let residual = datum.value - model.value;
            let slope = model.in_lambda + tau_slope * model.in_tau;
            chi2 += datum.weight * residual * residual;
            gradient -= datum.weight * residual * slope;
            curvature += datum.weight * slope * slope;
        }
        (chi2, gradient, curvature)
    }

    /// χ² of profile, total and prior of the scale, with the scale at its optimum.
    pub(crate) fn normal(&self, point: Point) -> Normal {
        let rings = self.rings(point);
        let mut pairs: Vec<(Sensitivity, Datum)> = rings
            .iter()
            .copied()
            .zip(self.data.iter().copied())
            .collect();
        if let Some(total) = &self.total {
            let mut model = self.enclosed(point);
            let datum = match total.datum {
                TotalDatum::Independent(datum) => datum,
                TotalDatum::Remainder(datum) => {
                    for (ring, area) in rings.iter().zip(&self.areas) {
                        model.value -= area * ring.value;
                        model.in_tau -= area * ring.in_tau;
                        model.in_lambda -= area * ring.in_lambda;
                    }
                    datum
                }
            };
            if datum.weight.is_finite() {
                pairs.push((model, datum));
            }
        }
        let u_scale = self.options.u_scale_relative;
        let (mut data_model, mut model_model) = (0.0, 0.0);
        for (model, datum) in &pairs {
            data_model += datum.weight * datum.value * model.value;
            model_model += datum.weight * model.value * model.value;
        }
        let prior = u_scale.powi(-2);
        let scale = if u_scale > 0.0 {
            (data_model + prior) / (model_model + prior)
        } else {
            1.0
        };
        let mut chi2 = if u_scale > 0.0 {
            prior * (scale - 1.0).powi(2)
        } else {
            0.0
        };
        let mut gradient = Vector2::zeros();
        let mut hessian = Matrix2::zeros();
        let mut with_scale = Vector2::zeros();
        for (model, datum) in &pairs {
            let residual = datum.value - scale * model.value;
            let slope = Vector2::new(model.in_tau, model.in_lambda) * scale;
            chi2 += datum.weight * residual * residual;
            gradient -= slope * (datum.weight * residual);
            hessian += slope * slope.transpose() * datum.weight;
            with_scale += slope * (datum.weight * model.value);
        }
        if u_scale > 0.0 {
            // Schur complement of the scale factor in the normal equations.
            hessian -= with_scale * with_scale.transpose() / (model_model + prior);
        }
        Normal {
            chi2,
            gradient,
            hessian,
            scale,
        }
    }

    /// σₐ and σₛ′ of a solution.
    pub(crate) fn coefficients(&self, solution: &Solution) -> Coefficients {
        solution.point.coefficients(self.epsilon)
    }

    /// The fit that `solution` stands for.
    pub(crate) fn conclude(&self, solution: Solution, mut warnings: Vec<Warning>) -> Fit {
        let Solution {
            point,
            evaluations,
            termination,
            ..
        } = solution;
        let at = point.coefficients(self.epsilon);
        let t = at.sigma_t_prime();
        let exact = self.options.constraint == Constraint::Exact;
        let at_bound = termination == Termination::AtBound;
        let scale = if exact { 1.0 } else { self.normal(point).scale };

        let free = if exact { 1 } else { 2 };
        let extra = usize::from(!exact && self.total.is_some());
        let freedom = (self.data.len() + extra).saturating_sub(free) as f64;
        let reduced_chi2 = if freedom > 0.0 {
            solution.chi2 / freedom
        } else {
            0.0
        };
        let probability = ChiSquared::new(freedom).map_or(1.0, |d| d.sf(solution.chi2));
        let widened = if probability < POOR_FIT_PROBABILITY {
            reduced_chi2.sqrt().max(1.0)
        } else {
            1.0
        };
        if widened > 1.0 {
            warnings.push(Warning::PoorFit {
                reduced_chi2,
                widened,
            });
        }

        let u_scale = self.options.u_scale_relative;
        if u_scale > 0.0 && (scale - 1.0).abs() > SCALE_OFF * u_scale {
            warnings.push(Warning::ScaleOff { scale, u: u_scale });
        }

        let covariance = self.covariance(&solution) * (widened * widened);
        let (in_a, in_s) = jacobian(point, self.epsilon);
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
        let (low, high) = (
            sigma_a(v - NORMAL_95_TWO_SIDED * u_v),
            sigma_a(v + NORMAL_95_TWO_SIDED * u_v),
        );
        let above = self
            .total
            .as_ref()
            .is_some_and(|t| t.measured.total_reflectance > self.options.entry_factor);
        let upper_limit = (low == 0.0 || above).then(|| sigma_a(v + NORMAL_95_ONE_SIDED * u_v));
        if let Some(upper_limit) = upper_limit {
            warnings.push(Warning::UpperLimitOnly { upper_limit });
        }
        let value_a = if at_bound { 0.0 } else { at.sigma_a };

        let last = self
            .profile
            .points
            .last()
            .map_or(0.0, |p| p.ring_mm.map_or(p.radius_mm, |r| r.1));
        let share_outside = self.model.beyond(at, last) / self.model.beyond(at, 0.0);
        if share_outside > MUCH_LIGHT_OUTSIDE {
            warnings.push(Warning::LightOutside {
                percent: 100.0 * share_outside,
            });
        }
        if at.albedo_prime() < LOW_ALBEDO {
            warnings.push(Warning::LowAlbedo {
                albedo_prime: at.albedo_prime(),
            });
        }
        let total = self.total.as_ref().map(|t| TotalFit {
            measured: t.measured.total_reflectance,
            u: t.measured.u_total_reflectance,
            model: self.enclosed(point).value,
            radius_max_mm: t.measured.radius_max_mm,
        });
        if let Some(total) = total.filter(|t| t.measured > self.options.entry_factor) {
            warnings.push(Warning::TotalAtCeiling {
                total: total.measured,
                ceiling: self.options.entry_factor,
            });
        }
        let residuals = self
            .rings(point)
            .iter()
            .zip(&self.indices)
            .map(|(model, &i)| {
                let p = &self.profile.points[i];
                Residual {
                    radius_mm: p.radius_mm,
                    measured_per_mm2: p.reflectance_per_mm2,
                    u_per_mm2: p.u_reflectance_per_mm2,
                    model_per_mm2: scale * model.value,
                }
            })
            .collect();
        let correlation = if variance_a > 0.0 && u_s > 0.0 {
            mixed / (u_a * u_s)
        } else {
            0.0
        };
        // Noise that was estimated from the residuals is known as well as they tell it.
        let freedom_of_u = if widened > 1.0 {
            freedom
        } else {
            f64::INFINITY
        };
        Fit {
            channel: self.profile.channel.clone(),
            sigma_a: Estimate {
                value: value_a,
                u: u_a,
                ci95: (low, high),
                degrees_of_freedom: freedom_of_u,
            },
            sigma_s_prime: Estimate {
                value: at.sigma_s_prime,
                u: u_s,
                ci95: (
                    (at.sigma_s_prime - NORMAL_95_TWO_SIDED * u_s).max(0.0),
                    at.sigma_s_prime + NORMAL_95_TWO_SIDED * u_s,
                ),
                degrees_of_freedom: freedom_of_u,
            },
            correlation,
            budget: vec![Contribution {
                source: OWN.to_owned(),
                u_sigma_a: u_a,
                u_sigma_s_prime: u_s,
                correlation,
                degrees_of_freedom: freedom_of_u,
            }],
            upper_limit,
            total,
            scale,
            range_mm: self.range,
            share_outside,
            reduced_chi2,
            evaluations,
            termination,
            warnings,
            residuals,
        }
    }

    /// Covariance of (τ, λ).
    fn covariance(&self, solution: &Solution) -> Matrix2<f64> {
        let &Solution {
            point,
            tau_slope,
            termination,
            ..
        } = solution;
        if self.options.constraint == Constraint::Exact && termination != Termination::AtBound {
            let (_, _, curvature) = self.along_constraint(point, tau_slope);
            let along = Vector2::new(tau_slope, 1.0);
            return along * along.transpose() / curvature;
        }
        let hessian = self.normal(point).hessian;
        hessian
            .try_inverse()
            .unwrap_or_else(|| Matrix2::from_diagonal_element(f64::INFINITY))
    }
}

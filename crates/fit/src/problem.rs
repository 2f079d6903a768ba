//! The weighted least-squares problem: which data, with which weight, against which model.

use crate::equations::{Terms, TotalRow, Workspace};
use crate::geometry::Geometry;
use crate::options::{Constraint, DirectionKind, FitOptions};
use crate::range;
use crate::result::{Fit, FitError, Residual, Warning};
use crate::solve::Solution;
use nalgebra::{Matrix2, Vector2};
use physics::{
    Coefficients, ForwardModel, Gradient, ProfilePoint, RadialProfile, Rows, TotalReflectance,
};
use std::ops::Range;

/// Where the search stands: the coordinates in which the data are nearly linear.
///
/// λ = ln σₜ′ is a pure scale of length. τ = √(σₜᵣ² + ε²) − ε stands for absorption, with ε the
/// inverse of the radius that the data reach: far from σₐ = 0 it is σₜᵣ itself, whose exponential
/// the tail follows; near it is σₜᵣ²/2ε ∝ σₐ, in which R_d within a finite picture is linear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub(crate) tau: f64,
    pub(crate) lambda: f64,
    /// σₜ′ = e^λ, mm⁻¹.
    pub(crate) sigma_t_prime: f64,
}

impl Point {
    /// No absorption yet, at this λ.
    pub(crate) fn at(lambda: f64) -> Self {
        Self {
            tau: 0.0,
            lambda,
            sigma_t_prime: lambda.exp(),
        }
    }

    pub(crate) fn with_tau(self, tau: f64) -> Self {
        Self { tau, ..self }
    }

    pub(crate) fn with_sigma_tr(self, sigma_tr: f64, epsilon: f64) -> Self {
        let square = sigma_tr * sigma_tr;
        // √(σₜᵣ² + ε²) − ε without its cancellation.
        let tau = if square > 0.0 {
            square / ((square + epsilon * epsilon).sqrt() + epsilon)
        } else {
            0.0
        };
        self.with_tau(tau)
    }

    pub(crate) fn sigma_tr(self, epsilon: f64) -> f64 {
        (self.tau * (self.tau + 2.0 * epsilon)).sqrt()
    }

    pub(crate) fn coefficients(self, epsilon: f64) -> Coefficients {
        Coefficients::from_sigma_tr(self.sigma_tr(epsilon), self.sigma_t_prime)
    }
}

/// A model value with its derivatives in τ and λ.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sensitivity {
    pub(crate) value: f64,
    pub(crate) in_tau: f64,
    pub(crate) in_lambda: f64,
}

/// How σₐ and σₛ′ change with (τ, λ) at this τ, where they are `at`.
pub(crate) fn jacobian(tau: f64, epsilon: f64, at: Coefficients) -> (Vector2<f64>, Vector2<f64>) {
    let t = at.sigma_t_prime();
    let a_in_tau = 2.0 / 3.0 * (tau + epsilon) / t;
    (
        Vector2::new(a_in_tau, -at.sigma_a),
        Vector2::new(-a_in_tau, t + at.sigma_a),
    )
}

/// How the total takes part as a datum.
#[derive(Clone, Copy, Debug)]
struct TotalDatum {
    value: f64,
    weight: f64,
    /// It is the sum of the same picture: the datum is what remains of it outside the fitted
    /// rings, which is independent of them. Counting the pixels once this way is the same as
    /// carrying the covariance of total and rings. Otherwise it was measured apart.
    remainder: bool,
}

/// The total as it was measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measured {
    pub(crate) total: f64,
    pub(crate) u: f64,
    /// `None` for the whole plane.
    pub(crate) radius_max_mm: Option<f64>,
}

impl From<&TotalReflectance> for Measured {
    fn from(t: &TotalReflectance) -> Self {
        Self {
            total: t.total_reflectance,
            u: t.u_total_reflectance,
            radius_max_mm: t.radius_max_mm,
        }
    }
}

/// χ² and what a Gauss-Newton step needs, with all nuisances eliminated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Normal {
    pub(crate) chi2: f64,
    /// Half the gradient of χ² in (τ, λ).
    pub(crate) gradient: Vector2<f64>,
    /// Half the Gauss-Newton Hessian of χ² in (τ, λ).
    pub(crate) hessian: Matrix2<f64>,
    pub(crate) scale: f64,
}

/// One channel's data, whatever part of them is fitted.
#[derive(Clone, Copy)]
pub(crate) struct Data<'a> {
    pub(crate) geometry: &'a Geometry,
    /// The values at the geometry's points, and their standard uncertainties.
    pub(crate) value: &'a [f64],
    pub(crate) u: &'a [f64],
    /// `None` where the constraint leaves the total out.
    pub(crate) total: Option<Measured>,
    pub(crate) model: &'a dyn ForwardModel,
    pub(crate) options: &'a FitOptions,
    /// The channel's name, for messages.
    pub(crate) channel: &'a dyn Fn() -> String,
}

/// What the coarse profile says of a model v at the known scale: sums over its residuals e.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Coarse {
    /// Σ w e².
    pub(crate) chi2: f64,
    /// Σ w v e.
    along: f64,
    /// Σ w v².
    norm: f64,
}

impl Coarse {
    /// χ² at the best scale, whose prior is 1 ± `u`.
    pub(crate) fn at_best_scale(&self, u: f64) -> f64 {
        let norm = self.norm + u.powi(-2);
        if norm > 0.0 {
            self.chi2 - self.along * self.along / norm
        } else {
            self.chi2
        }
    }

    /// ln of the factor that would bring the model to the data: about linear in λ where light dies
    /// out, above 0 for a medium too dense. NaN where there is none.
    pub(crate) fn ln_factor(&self) -> f64 {
        (1.0 + self.along / self.norm).ln()
    }
}

/// How many data, and how, an evaluation looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Level {
    /// A few points that stand for all, each without its ring and its beam, and without the
    /// directions but for the scale: good enough to find where the minimum is.
    Coarse,
    /// Everything.
    Full,
}

/// Memory that fits reuse.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    pub(crate) full: Workspace,
    coarse: Workspace,
    /// Radii of the coarse data, mm.
    coarse_mm: Vec<f64>,
    /// Model values there.
    coarse_values: Vec<f64>,
}

/// Points of the coarse data.
const COARSE: usize = 16;

/// One channel's data in one range beside one model.
pub(crate) struct Problem<'a> {
    pub(crate) data: Data<'a>,
    pub(crate) range: (f64, f64),
    /// The geometry's points from the first that is fitted to the last.
    pub(crate) span: Range<usize>,
    /// How many of them are fitted.
    pub(crate) points: usize,
    total: Option<TotalDatum>,
    /// ε of [`Point`], mm⁻¹.
    pub(crate) epsilon: f64,
    pub(crate) memory: Memory,
}

/// Refuses options outside their domain, for profiles of so many points.
pub(crate) fn check_options(options: &FitOptions, points: usize) -> Result<(), FitError> {
    let u_scale = options.u_scale_relative;
    if !((0.0..1.0).contains(&u_scale) || u_scale == f64::INFINITY) {
        let expected = "at least 0 and below 1 (or infinite: not known at all)";
        return Err(FitError::BadOption {
            name: "u_scale_relative",
            found: u_scale,
            expected,
        });
    }
    if u_scale == f64::INFINITY && options.constraint == Constraint::Exact {
        return Err(FitError::ScaleIsExact);
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
    if let Some((start_mm, end_mm)) = options.range_mm
        && !(start_mm >= 0.0 && start_mm < end_mm)
    {
        return Err(FitError::BadRange { start_mm, end_mm });
    }
    let footprints = options.footprints.as_ref().map(|f| f.len());
    if let Some(found) = footprints.filter(|found| *found != points) {
        return Err(FitError::BadOption {
            name: "the number of footprints",
            found: found as f64,
            expected: "that of the points",
        });
    }
    for direction in &options.directions {
        let found = direction.profile.len();
        let finite = direction.total.is_finite() && direction.profile.iter().all(|x| x.is_finite());
        if found != points || !finite {
            let expected = points;
            return Err(FitError::BadDirection { found, expected });
        }
    }
    Ok(())
}

/// Refuses radii that are none, and such that do not increase.
pub(crate) fn check_radii(
    channel: &dyn Fn() -> String,
    radii: impl Iterator<Item = f64>,
) -> Result<(), FitError> {
    let mut previous_mm = f64::NEG_INFINITY;
    for radius_mm in radii {
        if !radius_mm.is_finite() || radius_mm < 0.0 {
            return Err(FitError::NoRadius {
                channel: channel(),
                radius_mm,
            });
        }
        if radius_mm <= previous_mm {
            return Err(FitError::RadiiNotIncreasing {
                channel: channel(),
                radius_mm,
                previous_mm,
            });
        }
        previous_mm = radius_mm;
    }
    Ok(())
}

/// Times more light than can come back at which a profile must be in another unit: less could be
/// noise, or the coarseness of an integral over a few radii.
const IMPOSSIBLE: f64 = 3.0;

/// ∫ R 2πr dr of a profile, point by point: a sum over its rings, or trapezia between its radii.
#[derive(Default)]
pub(crate) struct Light {
    pub(crate) integral: f64,
    /// Radius of the last point, and 2πrR there.
    last: Option<(f64, f64)>,
}

impl Light {
    pub(crate) fn add(&mut self, p: &ProfilePoint, value: f64) {
        let around = 2.0 * std::f64::consts::PI * p.radius_mm * value;
        self.integral += match (p.ring_mm, self.last) {
            (Some(_), _) => p.area_mm2() * value,
            (None, Some((r, last))) => 0.5 * (around + last) * (p.radius_mm - r),
            (None, None) => 0.0,
        };
        self.last = Some((p.radius_mm, around));
    }
}

/// Refuses values that are no measurement, hold no signal, or more light than there is. `data`
/// are value and standard uncertainty of each point of `at`; `total` is the measured one.
pub(crate) fn check_values(
    channel: &dyn Fn() -> String,
    at: &[ProfilePoint],
    data: impl Iterator<Item = (f64, f64)>,
    total: Option<Measured>,
    options: &FitOptions,
) -> Result<(), FitError> {
    let mut best = f64::NEG_INFINITY;
    let mut light = Light::default();
    for (p, (value, u)) in at.iter().zip(data) {
        if !(value.is_finite() && u.is_finite() && u > 0.0) {
            return Err(FitError::BadPoint {
                channel: channel(),
                radius_mm: p.radius_mm,
                value,
                u,
            });
        }
        best = best.max(value / u);
        light.add(p, value);
    }
    let integral = light.integral;
    if at.is_empty() {
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
    let u_scale = options.u_scale_relative;
    // A circle smaller than the profile holds less than it.
    let whole = total.filter(|t| t.radius_max_mm.is_none());
    let most = whole.map_or(options.entry_factor, |t| t.total.min(options.entry_factor));
    if u_scale.is_finite() && most > 0.0 && integral > IMPOSSIBLE * most * (1.0 + 3.0 * u_scale) {
        return Err(FitError::ImpossibleIntegral {
            channel: channel(),
            integral,
            most,
        });
    }
    Ok(())
}

/// Refuses a total that is none, or more than can come back.
pub(crate) fn check_total(
    channel: &dyn Fn() -> String,
    total: Option<Measured>,
    options: &FitOptions,
) -> Result<(), FitError> {
    if options.constraint == Constraint::None {
        return Ok(());
    }
    let Some(Measured { total, u, .. }) = total else {
        return Err(FitError::NoTotal { channel: channel() });
    };
    let own_u_is_missing = options.constraint == Constraint::Joint && u == 0.0;
    if !(total.is_finite() && total > 0.0 && u.is_finite() && u >= 0.0) || own_u_is_missing {
        return Err(FitError::BadTotal {
            channel: channel(),
            total,
            u,
        });
    }
    let u = u.hypot(total * options.u_scale_relative);
    if total > options.entry_factor + 3.0 * u {
        return Err(FitError::TotalAboveCeiling {
            channel: channel(),
            total,
            u,
            ceiling: options.entry_factor,
        });
    }
    Ok(())
}

/// Standard uncertainties below 0 at which a value is more than noise.
const BELOW_ZERO: f64 = 5.0;
/// Share of all the weight at which one point decides alone.
const ALONE: f64 = 0.95;

/// The value furthest below 0, where noise cannot have done it: of (radius, value, u).
pub(crate) fn negative_light(
    measured: impl Iterator<Item = (f64, f64, f64)> + Clone,
) -> Option<Warning> {
    // Hardly any profile has one, and of many profiles each is asked.
    if !measured
        .clone()
        .any(|(_, value, u)| value < -BELOW_ZERO * u)
    {
        return None;
    }
    let lowest = measured.min_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)));
    lowest.map(|(radius_mm, value, u)| Warning::NegativeLight {
        radius_mm,
        value,
        u,
    })
}

/// What is possible, but strange, about the data behind a fit.
pub(crate) fn suspicions(profile: &RadialProfile, found: &Fit) -> Vec<Warning> {
    let points = profile.points.iter();
    let measured = points.map(|p| (p.radius_mm, p.reflectance_per_mm2, p.u_reflectance_per_mm2));
    let mut warnings: Vec<Warning> = negative_light(measured).into_iter().collect();
    let says = |r: &Residual| (r.model_per_mm2 / r.u_per_mm2).powi(2);
    let all: f64 = found.residuals.iter().map(says).sum();
    let most = found
        .residuals
        .iter()
        .max_by(|a, b| says(a).total_cmp(&says(b)));
    if let Some(r) = most.filter(|r| says(r) > ALONE * all && found.residuals.len() > 1) {
        warnings.push(Warning::OnePointDecides {
            radius_mm: r.radius_mm,
            percent: 100.0 * says(r) / all,
        });
    }
    warnings
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
    /// The data of `range`; the model's own discrepancy is that at `found`.
    pub(crate) fn new(
        data: Data<'a>,
        range: (f64, f64),
        found: Option<Coefficients>,
        mut memory: Memory,
    ) -> Result<Self, FitError> {
        let Data {
            geometry, options, ..
        } = data;
        // The geometry holds what its own range holds.
        let all_inside = range == geometry.range_mm;
        let inside = |i: usize| all_inside || range::contains(range, geometry.edges[i]);
        let all = 0..geometry.len();
        let first = all.clone().find(|&i| inside(i)).unwrap_or(0);
        let last = all.rev().find(|&i| inside(i)).map_or(first, |i| i + 1);
        let span = first..last;
        let points = span.clone().filter(|&i| inside(i)).count();
        if points < needed(options.constraint) {
            return Err(FitError::TooFewPoints {
                channel: (data.channel)(),
                points,
                needed: needed(options.constraint),
                start_mm: range.0,
                end_mm: range.1,
            });
        }
        let space = &mut memory.full;
        space.resize(span.len());
        // Whole columns first, then what takes no part: the loops stay without a branch.
        space.datum[..span.len()].copy_from_slice(&data.value[span.clone()]);
        for (weight, u) in space.weight.iter_mut().zip(&data.u[span.clone()]) {
            *weight = 1.0 / (u * u);
        }
        if points < span.len() {
            for (row, _) in span.clone().enumerate().filter(|&(_, i)| !inside(i)) {
                (space.datum[row], space.weight[row]) = (0.0, 0.0);
            }
        }
        // Rings outside the total's circle share no pixel with it.
        if let Some(circle) = data.total.and_then(|t| t.radius_max_mm) {
            let circle = circle * (1.0 + 1e-9);
            for (row, i) in span.clone().enumerate().filter(|&(_, i)| inside(i)) {
                if geometry.edges[i].1 <= circle {
                    space.area[row] = geometry.areas[i];
                }
            }
        }
        let total = data.total.map(|measured| {
            let whole = measured.u.powi(2);
            let (mut rest, mut variance) = (measured.total, whole);
            for ((value, area), weight) in space.datum.iter().zip(&space.area).zip(&space.weight) {
                if *area > 0.0 {
                    rest -= area * value;
                    variance -= area * area / weight;
                }
            }
            let remainder = variance > 1e-6 * whole && measured.radius_max_mm.is_some();
            let (value, variance) = if remainder {
                (rest, variance)
            } else {
                (measured.total, whole)
            };
            TotalDatum {
                value,
                weight: 1.0 / variance,
                remainder,
            }
        });
        let last = geometry.edges[span.end - 1].1;
        let reach = match &data.total {
            Some(total) => total.radius_max_mm.unwrap_or(f64::INFINITY).max(last),
            None => last,
        };
        let mut problem = Self {
            data,
            range,
            span,
            points,
            total,
            epsilon: 1.0 / reach,
            memory,
        };
        problem.add_directions(found);
        problem.choose_coarse();
        Ok(problem)
    }

    /// Writes the directions of model and options into the workspace.
    fn add_directions(&mut self, found: Option<Coefficients>) {
        let Data {
            geometry,
            model,
            options,
            total,
            ..
        } = self.data;
        let own = if found.is_some() {
            model.discrepancies()
        } else {
            0
        };
        let of_kind = |kind| options.directions.iter().filter(move |d| d.kind == kind);
        let relative = own + of_kind(DirectionKind::Relative).count();
        let absolute = of_kind(DirectionKind::Absolute).count();
        self.memory.full.resize_directions(relative, absolute);
        let (rings, stride) = (self.span.len(), self.memory.full.stride());
        if let Some(found) = found.filter(|_| own > 0) {
            let radii = &geometry.radii[self.span.clone()];
            let (mut columns, mut of_total) = (vec![0.0; own * rings], vec![0.0; own]);
            model.discrepancy(found, radii, &mut columns);
            if let Some(total) = total {
                let radius = total.radius_max_mm.unwrap_or(f64::INFINITY);
                model.discrepancy_within(found, radius, &mut of_total);
            }
            let rows = self.memory.full.relative.chunks_exact_mut(stride);
            for ((row, column), total) in rows.zip(columns.chunks_exact(rings)).zip(of_total) {
                row[..rings].copy_from_slice(column);
                row[rings] = total;
            }
        }
        let rows = self.memory.full.relative.chunks_exact_mut(stride).skip(own);
        let rows = rows.zip(of_kind(DirectionKind::Relative)).chain(
            self.memory
                .full
                .absolute
                .chunks_exact_mut(stride)
                .zip(of_kind(DirectionKind::Absolute)),
        );
        for (row, direction) in rows {
            for (x, i) in row.iter_mut().zip(self.span.clone()) {
                *x = direction.profile[geometry.indices[i]];
            }
            row[rings] = direction.total;
        }
    }

    /// From each of a few runs of neighbours the point that says most, with the weight of all.
    fn choose_coarse(&mut self) {
        let Memory {
            full,
            coarse,
            coarse_mm,
            coarse_values,
        } = &mut self.memory;
        let rings = self.span.len();
        let count = COARSE.min(rings);
        coarse.resize(count);
        coarse.resize_directions(0, 0);
        coarse_mm.clear();
        coarse_values.resize(count, 0.0);
        let radii = &self.data.geometry.radii[self.span.clone()];
        for group in 0..count {
            let rows = group * rings / count..(group + 1) * rings / count;
            let (mut best, mut most) = (rows.start, -1.0);
            let (mut all, mut weight) = (0.0, 0.0);
            for i in rows {
                let says = full.weight[i] * full.datum[i] * full.datum[i];
                if full.weight[i] > 0.0 && says > most {
                    (best, most) = (i, says);
                }
                all += says;
                weight += full.weight[i];
            }
            coarse_mm.push(radii[best]);
            coarse.datum[group] = full.datum[best];
            // What the directions leave of it where they are independent at every point.
            let ratio = if most > 0.0 { all / most } else { 1.0 };
            let stride = full.stride();
            let relative = full.relative.iter().skip(best).step_by(stride);
            let absolute = full.absolute.iter().skip(best).step_by(stride);
            let off = relative
                .map(|x| x * full.datum[best])
                .chain(absolute.copied());
            let variance: f64 = off.map(|x| x * x).sum();
            coarse.weight[group] = if full.weight[best] > 0.0 {
                1.0 / (1.0 / (full.weight[best] * ratio).min(weight.max(full.weight[best]))
                    + variance)
            } else {
                0.0
            };
        }
    }

    /// Bounds of τ at this λ: no absorption, and next to no scattering.
    pub(crate) fn tau_bounds(&self, at: Point) -> (f64, f64) {
        let t = at.sigma_t_prime;
        // On the whole plane the slope of the total in σₐ is infinite at 0 itself.
        let lowest = if self.epsilon > 0.0 { 0.0 } else { 1e-9 * t };
        let highest = at.with_sigma_tr(3.0_f64.sqrt() * (1.0 - 1e-9) * t, self.epsilon);
        (lowest, highest.tau)
    }

    /// The model value that is `gradient` in the coefficients, at this τ, where they are `at`.
    fn sensitivity(&self, gradient: Gradient, tau: f64, at: Coefficients) -> Sensitivity {
        let (in_a, in_s) = jacobian(tau, self.epsilon, at);
        let slope = in_a * gradient.in_sigma_a + in_s * gradient.in_sigma_s_prime;
        let factor = self.data.options.entry_factor;
        Sensitivity {
            value: factor * gradient.value,
            in_tau: factor * slope.x,
            in_lambda: factor * slope.y,
        }
    }

    /// Bounds of λ between which the data can mean anything: 1/σₜ′ from far wider than the
    /// picture to far finer than its first radius.
    pub(crate) fn lambda_bounds(&self) -> (f64, f64) {
        let geometry = self.data.geometry;
        let first = geometry.first_mm.max(1e-3 * geometry.last_mm);
        let last = geometry.last_mm.max(1e-9);
        ((0.02 / last).ln(), (50.0 / first.max(1e-9)).ln())
    }

    /// The measured total where the constraint takes it as exact.
    pub(crate) fn exact_total(&self) -> Option<f64> {
        self.data.total.map(|t| t.total)
    }

    /// The least that the model's total may be while the measured one is not contradicted.
    pub(crate) fn least_total(&self) -> f64 {
        let u_scale = self.data.options.u_scale_relative;
        self.data
            .total
            .map_or(0.0, |t| t.total - 3.0 * t.u.hypot(t.total * u_scale))
    }

    /// Radius of the circle of the total, mm.
    fn circle(&self) -> f64 {
        self.data
            .total
            .and_then(|t| t.radius_max_mm)
            .unwrap_or(f64::INFINITY)
    }

    /// The model's total inside the circle of the measured one.
    pub(crate) fn enclosed(&self, point: Point) -> Sensitivity {
        let at = point.coefficients(self.epsilon);
        let gradient = self.data.model.within(at, self.circle());
        self.sensitivity(gradient, point.tau, at)
    }

    /// The model at every ring of this level, into its workspace.
    fn rings(&mut self, level: Level, at: Coefficients) {
        let factor = self.data.options.entry_factor;
        let (space, rings) = match level {
            Level::Full => (&mut self.memory.full, self.span.len()),
            Level::Coarse => (&mut self.memory.coarse, self.memory.coarse_mm.len()),
        };
        let Workspace {
            nodes,
            value,
            in_sigma_a,
            in_sigma_s_prime,
            ..
        } = space;
        let rows = Rows {
            value: &mut value[..rings],
            in_sigma_a: &mut in_sigma_a[..rings],
            in_sigma_s_prime: &mut in_sigma_s_prime[..rings],
        };
        let model = self.data.model;
        match level {
            Level::Full => {
                let span = self.span.clone();
                let footprints = &self.data.geometry.footprints;
                footprints.reflectance_gradient(model, at, span, factor, nodes, rows);
            }
            Level::Coarse => {
                nodes.resize(rings, Gradient::default());
                model.diffuse_reflectance_gradient(at, &self.memory.coarse_mm, nodes);
                rows.fill(nodes, factor);
            }
        }
    }

    fn reduced(&mut self, level: Level, point: Point, terms: &Terms) -> Normal {
        let at = point.coefficients(self.epsilon);
        self.rings(level, at);
        let space = match level {
            Level::Full => &mut self.memory.full,
            Level::Coarse => &mut self.memory.coarse,
        };
        let reduced = space.reduce(terms);
        let (in_a, in_s) = jacobian(point.tau, self.epsilon, at);
        let jacobian = Matrix2::from_columns(&[in_a, in_s]).transpose();
        Normal {
            chi2: reduced.chi2,
            gradient: jacobian.transpose() * reduced.gradient,
            hessian: jacobian.transpose() * reduced.hessian * jacobian,
            scale: reduced.scale,
        }
    }

    /// The coarse profile alone beside the model at `point`, without derivatives.
    pub(crate) fn coarse(&mut self, point: Point) -> Coarse {
        let at = point.coefficients(self.epsilon);
        let factor = self.data.options.entry_factor;
        let Memory {
            coarse,
            coarse_mm,
            coarse_values,
            ..
        } = &mut self.memory;
        self.data
            .model
            .diffuse_reflectance(at, coarse_mm, coarse_values);
        let mut sums = Coarse::default();
        for ((w, d), v) in coarse.weight.iter().zip(&coarse.datum).zip(&*coarse_values) {
            let v = factor * v;
            let e = d - v;
            sums.chi2 += w * e * e;
            sums.along += w * v * e;
            sums.norm += w * v * v;
        }
        sums
    }

    /// The equations of the profile alone, as they are along the constraint. The scale is taken as
    /// known; the other nuisances stay.
    pub(crate) fn along_constraint(&mut self, level: Level, point: Point) -> Normal {
        let terms = Terms {
            total: None,
            scale_precision: None,
        };
        self.reduced(level, point, &terms)
    }

    /// χ² of profile, total and priors, with every nuisance at its optimum.
    pub(crate) fn normal(&mut self, level: Level, point: Point) -> Normal {
        let Data {
            model,
            options,
            total: measured,
            ..
        } = self.data;
        let datum = match level {
            Level::Full => self.total,
            // The rings are not there to be taken away.
            Level::Coarse => measured.map(|t| TotalDatum {
                value: t.total,
                weight: t.u.powi(-2),
                remainder: false,
            }),
        };
        let total = datum.filter(|t| t.weight.is_finite()).map(|t| {
            let enclosed = model.within(point.coefficients(self.epsilon), self.circle());
            TotalRow {
                model: enclosed * options.entry_factor,
                value: t.value,
                weight: t.weight,
                remainder: t.remainder,
            }
        });
        let u_scale = options.u_scale_relative;
        let terms = Terms {
            total,
            scale_precision: (u_scale > 0.0).then(|| u_scale.powi(-2)),
        };
        self.reduced(level, point, &terms)
    }

    /// σₐ and σₛ′ of a solution.
    pub(crate) fn coefficients(&self, solution: &Solution) -> Coefficients {
        solution.point.coefficients(self.epsilon)
    }
}

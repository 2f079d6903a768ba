//! The search: a scan that cannot miss, then safeguarded Gauss-Newton steps.

use crate::options::Constraint;
use crate::problem::{Coarse, Level, Normal, Point, Problem};
use crate::result::Termination;
use nalgebra::{Matrix2, Vector2};
use physics::Coefficients;

/// Points of the scan in λ = ln σₜ′.
const SCAN: usize = 17;
/// Points of the scan in absorption where no total ties it to λ.
const SCAN_ABSORPTION: usize = 16;
/// How often the steps of that scan are halved about the best.
const HALVINGS: usize = 4;
/// Places of that scan from which to descend.
const DESCENDED: usize = 8;
/// How far from the minimum a search may end, in λ or relative in τ. The last step is taken unseen.
const CLOSE: f64 = 1e-9;
/// The same on the coarse data, which only tell where to begin.
const CLOSE_COARSE: f64 = 1e-3;
/// How near the model's total comes to the measured one under the constraint, over it: rounding.
const EXACT: f64 = 8.0 * f64::EPSILON;
/// Places that are followed to the end on all data.
const FOLLOWED: usize = 4;

/// Where a search ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solution {
    pub(crate) point: Point,
    /// dτ/dλ along the constraint, where there is one.
    pub(crate) tau_slope: f64,
    pub(crate) chi2: f64,
    pub(crate) scale: f64,
    /// Half the Gauss-Newton Hessian of χ² in (τ, λ), one short step before the end.
    pub(crate) hessian: Matrix2<f64>,
    pub(crate) evaluations: usize,
    pub(crate) termination: Termination,
}

/// Counts model evaluations against the limit.
struct Budget {
    used: usize,
    limit: usize,
}

impl Budget {
    fn spend(&mut self) -> bool {
        self.used += 1;
        self.used <= self.limit
    }
}

/// A point to descend from, with the λ between which its minimum lies.
#[derive(Clone, Copy, Debug)]
struct Start {
    point: Point,
    /// Where along the constraint the minimum is thought to be.
    lambda: f64,
    low: f64,
    high: f64,
    chi2: f64,
}

/// Solves `problem` under its constraint: from `start` alone, or, without one, wherever the
/// minimum may be.
pub(crate) fn solve(problem: &mut Problem, start: Option<Coefficients>) -> Solution {
    let mut budget = Budget {
        used: 0,
        limit: problem.data.options.max_evaluations,
    };
    let best = match start {
        Some(start) => from(problem, start, &mut budget),
        None => anywhere(problem, &mut budget),
    };
    Solution {
        evaluations: budget.used,
        ..best
    }
}

/// The minimum in whose valley `start` is, on all data.
fn from(problem: &mut Problem, start: Coefficients, budget: &mut Budget) -> Solution {
    let point = Point::at(start.sigma_t_prime().ln());
    let point = point.with_sigma_tr(start.sigma_tr(), problem.epsilon);
    if problem.data.options.constraint != Constraint::Exact {
        return descend(problem, Level::Full, point, budget);
    }
    let (low, high) = problem.lambda_bounds();
    let start = Start {
        point,
        lambda: point.lambda.clamp(low, high),
        low,
        high,
        chi2: f64::INFINITY,
    };
    along_constraint(problem, Level::Full, &start, budget)
}

/// The best minimum that there is.
///
/// The scan and its refinement look at a few points that stand for all; what they find is then
/// followed on everything.
fn anywhere(problem: &mut Problem, budget: &mut Budget) -> Solution {
    let options = problem.data.options;
    // Without a scale the total says nothing about where to look.
    let tied = options.constraint != Constraint::None && options.u_scale_relative.is_finite();
    let mut starts = if tied {
        scan_constraint(problem, budget)
    } else {
        scan_plane(problem, budget)
    };
    for start in &mut starts {
        let refined = match options.constraint {
            Constraint::Exact => along_constraint(problem, Level::Coarse, start, budget),
            Constraint::Joint if tied => {
                let exact = along_constraint(problem, Level::Coarse, start, budget);
                descend(problem, Level::Coarse, exact.point, budget)
            }
            _ => descend(problem, Level::Coarse, start.point, budget),
        };
        (start.point, start.chi2) = (refined.point, refined.chi2);
        start.lambda = refined.point.lambda;
    }
    starts.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    // What the coarse data rule out by far needs no second look, nor what they find twice.
    let ruled_out = 3.0 * starts.first().map_or(0.0, |s| s.chi2) + 20.0 * problem.points as f64;
    let mut best: Option<Solution> = None;
    let mut followed: [Option<Point>; FOLLOWED] = [None; FOLLOWED];
    let mut count = 0;
    for start in &starts {
        let twin = |p: &Point| {
            (p.lambda - start.point.lambda).abs() < 0.02
                && (p.tau - start.point.tau).abs() < 0.02 * (p.tau + problem.epsilon)
        };
        let seen = followed.iter().flatten().any(twin);
        if best.is_some() && (seen || start.chi2 > ruled_out) || count == FOLLOWED {
            continue;
        }
        followed[count] = Some(start.point);
        count += 1;
        let solution = match options.constraint {
            Constraint::Exact => along_constraint(problem, Level::Full, start, budget),
            _ => descend(problem, Level::Full, start.point, budget),
        };
        if best.is_none_or(|b| solution.chi2 < b.chi2) {
            best = Some(solution);
        }
    }
    let near = options
        .near
        .filter(|_| options.constraint != Constraint::Exact);
    if let Some(near) = near {
        let solution = from(problem, near, budget);
        if best.is_none_or(|b| solution.chi2 < b.chi2) {
            best = Some(solution);
        }
    }
    best.expect("a scan has at least one smallest value")
}

/// The point of this λ at which the model's total is the measured one, and dτ/dλ along it.
///
/// The total falls with absorption, so a bracket always holds the root; where even a medium
/// without any returns too little, τ stays at its bound. It begins at the σₜᵣ/σₜ′ of `near`, which
/// on the whole plane is the root itself, since there the total depends on α′ alone.
fn on_constraint(problem: &Problem, lambda: f64, near: Option<Point>) -> (Point, f64) {
    let clear = Point::at(lambda);
    let (bound, mut high) = problem.tau_bounds(clear);
    let mut low = bound;
    let at = |tau| clear.with_tau(tau);
    let Some(total) = problem.exact_total() else {
        return (at(low), 0.0);
    };
    let guess = match near {
        Some(near) => {
            let denser = clear.sigma_t_prime / near.sigma_t_prime;
            let sigma_tr = near.sigma_tr(problem.epsilon) * denser;
            clear.with_sigma_tr(sigma_tr, problem.epsilon).tau
        }
        None => low + (1.0 - total).clamp(0.0, 1.0) * (high - low),
    };
    let mut tau = guess.clamp(low, high);
    let mut slope = 0.0;
    for _ in 0..100 {
        let model = problem.enclosed(at(tau));
        slope = -model.in_lambda / model.in_tau;
        let excess = model.value - total;
        if excess.abs() <= EXACT * total {
            break;
        }
        if excess > 0.0 {
            low = tau;
        } else if tau <= bound {
            return (at(bound), 0.0);
        } else {
            high = tau;
        }
        let newton = tau - excess / model.in_tau;
        if newton <= bound && low == bound && problem.enclosed(at(bound)).value <= total {
            return (at(bound), 0.0);
        }
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        let step = (next - tau).abs();
        tau = next;
        // To rounding, a hundred times as much of the total of dark media as of τ: near the bound,
        // and for those, Newton's steps shrink slowly.
        if step <= f64::EPSILON * tau || high - low <= f64::EPSILON * tau {
            break;
        }
    }
    (at(tau), slope)
}

/// The smallest λ between the bounds at which a medium without absorption returns `total`: a
/// sparser one loses too much light outside the picture. `None` where none does.
fn least_lambda(problem: &Problem, total: f64) -> Option<f64> {
    let (mut low, mut high) = problem.lambda_bounds();
    let returns = |lambda: f64| {
        let clear = Point::at(lambda);
        let clear = clear.with_tau(problem.tau_bounds(clear).0);
        problem.enclosed(clear).value >= total
    };
    if !returns(high) {
        return None;
    }
    if returns(low) {
        return Some(low);
    }
    // To a millionth of the range: it only separates two stretches of the scan.
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if returns(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(high)
}

/// Local minima of χ² along the constraint, best first, each with its bracket.
///
/// Where the measured total lies above what the medium can return, but by less than 3 u, the
/// constraint holds τ at its bound: so the scan covers that stretch, and the kink where it ends.
fn scan_constraint(problem: &mut Problem, budget: &mut Budget) -> Vec<Start> {
    let (low, high) = problem.lambda_bounds();
    let from = least_lambda(problem, problem.least_total()).unwrap_or(low);
    let mut lambdas: Vec<f64> = (0..SCAN)
        .map(|i| from + (high - from) * i as f64 / (SCAN - 1) as f64)
        .collect();
    // On the whole plane every medium can return the total, and there is no kink.
    let kink = problem
        .exact_total()
        .and_then(|t| least_lambda(problem, t))
        .filter(|kink| *kink > low);
    if let Some(kink) = kink {
        // Just above the kink absorption rises steeply from 0.
        lambdas.extend(
            [0.0, 0.02, 0.1, 0.3]
                .map(|above| kink + above)
                .into_iter()
                .filter(|l| *l < high),
        );
        lambdas.sort_by(f64::total_cmp);
    }
    let mut scanned: Vec<(Point, Coarse)> = Vec::with_capacity(lambdas.len());
    for &lambda in &lambdas {
        budget.spend();
        let near = scanned.last().map(|s| s.0);
        let (point, _) = on_constraint(problem, lambda, near);
        scanned.push((point, problem.coarse(point)));
    }
    let last = scanned.len() - 1;
    let chi2 = |i: usize| scanned[i].1.chi2;
    // Where the model would be as bright as the data, between this place and one beside it.
    let as_bright = |i: usize| {
        let here = scanned[i].1.ln_factor();
        let beside = if here > 0.0 {
            i.saturating_sub(1)
        } else {
            i + 1
        };
        let there = scanned.get(beside).map_or(here, |s| s.1.ln_factor());
        let place = here / (here - there);
        if (0.0..1.0).contains(&place) {
            lambdas[i] + place * (lambdas[beside] - lambdas[i])
        } else {
            lambdas[i]
        }
    };
    let mut starts: Vec<Start> = (0..=last)
        // Of a plateau its sparse end.
        .filter(|&i| (i == 0 || chi2(i) < chi2(i - 1)) && (i == last || chi2(i) <= chi2(i + 1)))
        .flat_map(|i| {
            // One step more than the coarse minimum lies between, since all data may shift it.
            let (below, above) = (lambdas[i.saturating_sub(2)], lambdas[(i + 2).min(last)]);
            let (point, Coarse { chi2, .. }) = scanned[i];
            let start = |low: f64, high: f64, lambda: f64| Start {
                point,
                lambda,
                low,
                high,
                chi2,
            };
            if kink == Some(lambdas[i]) {
                // χ² may have a minimum on either side.
                let middle = |a: f64, b: f64| 0.5 * (a + b);
                vec![
                    start(
                        below,
                        lambdas[i],
                        middle(lambdas[i.saturating_sub(1)], lambdas[i]),
                    ),
                    start(
                        lambdas[i],
                        above,
                        middle(lambdas[i], lambdas[(i + 1).min(last)]),
                    ),
                ]
            } else {
                vec![start(below, above, as_bright(i))]
            }
        })
        .collect();
    starts.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    starts
}

/// The best absorption at the best λ of a scan over both coordinates.
///
/// In media nearly black the valley is narrower than the scan's steps, and what stands beside it
/// may descend into another one: so absorption is then sought between the neighbours of the best.
fn scan_plane(problem: &mut Problem, budget: &mut Budget) -> Vec<Start> {
    let (low, high) = problem.lambda_bounds();
    let best_scale = problem.data.options.u_scale_relative > 0.0;
    let mut at = |lambda: f64, j: f64| {
        // σₜᵣ/σₜ′ from 0.002 to 1.72, denser toward 0: α′ from 0.999999 to 0.01.
        let k = 1.72 * (j / SCAN_ABSORPTION as f64).powf(2.5);
        let point = Point::at(lambda);
        let point = point.with_sigma_tr(k * point.sigma_t_prime, problem.epsilon);
        budget.spend();
        let coarse = problem.coarse(point);
        let chi2 = if best_scale {
            coarse.at_best_scale(problem.data.options.u_scale_relative)
        } else {
            coarse.chi2
        };
        let start = Start {
            point,
            lambda,
            low,
            high,
            chi2,
        };
        (j, start)
    };
    let better = |a: &(f64, Start), b: &(f64, Start)| a.1.chi2.total_cmp(&b.1.chi2);
    let mut best: Vec<(f64, Start)> = (0..SCAN)
        .filter_map(|i| {
            let lambda = low + (high - low) * i as f64 / (SCAN - 1) as f64;
            let scanned = (1..=SCAN_ABSORPTION).map(|j| at(lambda, j as f64));
            scanned.min_by(better)
        })
        .collect();
    best.sort_by(better);
    best.truncate(DESCENDED);
    for best in &mut best {
        let mut step = 0.5;
        for _ in 0..HALVINGS {
            for side in [-step, step] {
                let beside = best.0 + side;
                if beside < SCAN_ABSORPTION as f64 {
                    let beside = at(best.1.lambda, beside);
                    if better(&beside, best).is_lt() {
                        *best = beside;
                    }
                }
            }
            step *= 0.5;
        }
    }
    best.into_iter().map(|(_, start)| start).collect()
}

/// The minimum along the constraint: the zero of the gradient in λ inside the bracket.
///
/// The first step is Gauss and Newton's, with G = Σ w m′² for half the curvature of χ². What that
/// leaves out, Σ w (m − d) m″, moves by half as much as G does. So the secant of the gradient, which
/// is the mean curvature between the last two places, and ¾ of the change of G give the one from
/// here to the minimum, but for second order. Errors shrink as their products: two steps tell what
/// the next would be.
///
/// Where light dies out before the next point of the scan, the valley is a narrow one between a
/// plateau, of media too dense to return anything, and a wall: so no slope at all counts as one
/// that falls toward the sparser media.
fn along_constraint(
    problem: &mut Problem,
    level: Level,
    start: &Start,
    budget: &mut Budget,
) -> Solution {
    let close = close(level);
    let (mut low, mut high, mut lambda) = (start.low, start.high, start.lambda);
    let mut termination = Termination::OutOfEvaluations;
    let (mut point, mut tau_slope) = on_constraint(problem, lambda, Some(start.point));
    let mut chi2 = start.chi2;
    let mut hessian = Matrix2::zeros();
    // Gradient and G before, and the step that was taken there.
    let mut last: Option<(f64, f64, f64)> = None;
    while budget.spend() {
        let normal = problem.along_constraint(level, point);
        hessian = normal.hessian;
        let along = Vector2::new(tau_slope, 1.0);
        let gradient = along.dot(&normal.gradient);
        let gauss_newton = along.dot(&(hessian * along));
        if gradient >= 0.0 {
            high = lambda;
        } else {
            low = lambda;
        }
        let secant = last
            .map(|(g, was, step)| (gradient - g) / step + 0.75 * (gauss_newton - was))
            .filter(|c| (0.5..2.0).contains(&(c / gauss_newton)));
        let curvature = secant.unwrap_or(gauss_newton);
        let newton = lambda - gradient / curvature;
        let inside = (low..=high).contains(&newton);
        let next = if inside { newton } else { 0.5 * (low + high) };
        let step = next - lambda;
        let left = match last {
            Some((_, _, before)) if inside && secant.is_some() => step * step / before.abs(),
            _ => step.abs(),
        };
        // What the parabola at this place says of the next.
        chi2 = normal.chi2 + step * (2.0 * gradient + step * curvature);
        last = Some((gradient, gauss_newton, step));
        lambda = next;
        (point, tau_slope) = on_constraint(problem, lambda, Some(point));
        if left <= close || high - low <= close {
            termination = Termination::Converged;
            break;
        }
    }
    if point.tau <= problem.tau_bounds(point).0 && termination == Termination::Converged {
        termination = Termination::AtBound;
    }
    Solution {
        point,
        tau_slope,
        chi2,
        scale: 1.0,
        hessian,
        evaluations: budget.used,
        termination,
    }
}

fn close(level: Level) -> f64 {
    match level {
        Level::Coarse => CLOSE_COARSE,
        Level::Full => CLOSE,
    }
}

/// Levenberg-Marquardt in (τ, λ) from one start, τ held inside its bounds.
fn descend(problem: &mut Problem, level: Level, start: Point, budget: &mut Budget) -> Solution {
    let close = close(level);
    let (lambda_low, lambda_high) = problem.lambda_bounds();
    let mut at = start;
    let mut normal = problem.normal(level, at);
    let mut damping = 1e-4;
    let mut termination = Termination::OutOfEvaluations;
    while budget.spend() {
        let (lowest, highest) = problem.tau_bounds(at);
        // A bound that the gradient pushes against takes τ out of the step.
        let held = (at.tau <= lowest && normal.gradient.x > 0.0)
            || (at.tau >= highest && normal.gradient.x < 0.0);
        let step = damped_step(&normal, damping, held);
        if !(step.x.is_finite() && step.y.is_finite()) {
            // Nothing here depends on the coefficients: the light has died out.
            break;
        }
        let lambda = (at.lambda + step.y).clamp(lambda_low, lambda_high);
        let next = Point::at(lambda);
        let (lowest, highest) = problem.tau_bounds(next);
        let next = next.with_tau((at.tau + step.x).clamp(lowest, highest));
        let small = (next.lambda - at.lambda).abs() <= close
            && (next.tau - at.tau).abs() <= close * (at.tau + problem.epsilon);
        if small || damping > 1e12 {
            if damping < 1e-2 {
                at = next;
            }
            termination = Termination::Converged;
            break;
        }
        let trial = problem.normal(level, next);
        if trial.chi2 <= normal.chi2 {
            (at, normal) = (next, trial);
            damping = (damping * 0.1).max(1e-15);
        } else {
            damping *= 10.0;
        }
    }
    if at.tau <= problem.tau_bounds(at).0 && termination == Termination::Converged {
        termination = Termination::AtBound;
    }
    Solution {
        point: at,
        tau_slope: 0.0,
        chi2: normal.chi2,
        scale: normal.scale,
        hessian: normal.hessian,
        evaluations: budget.used,
        termination,
    }
}

/// One step of the damped normal equations (Marquardt's scaling, so that units do not matter).
fn damped_step(normal: &Normal, damping: f64, hold_tau: bool) -> Vector2<f64> {
    let hessian = normal.hessian;
    let downhill = -normal.gradient;
    let lambda_alone = Vector2::new(0.0, downhill.y / (hessian[(1, 1)] * (1.0 + damping)));
    if hold_tau {
        return lambda_alone;
    }
    let diagonal = Vector2::new(hessian[(0, 0)], hessian[(1, 1)]) * damping;
    (hessian + Matrix2::from_diagonal(&diagonal))
        .try_inverse()
        .map_or(lambda_alone, |inverse| inverse * downhill)
}

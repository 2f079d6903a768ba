//! The search: a scan that cannot miss, then safeguarded Gauss-Newton steps.

use crate::options::Constraint;
use crate::problem::{Normal, Point, Problem};
use crate::result::Termination;
use nalgebra::{Matrix2, Vector2};

/// Points of the scan in λ = ln σₜ′.
const SCAN: usize = 17;
/// Points of the scan in absorption where no total ties it to λ.
const SCAN_ABSORPTION: usize = 16;
/// Change of λ, or relative change of τ, below which a search has converged.
const CLOSE: f64 = 1e-11;

/// Where a search ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solution {
    pub(crate) point: Point,
    /// dτ/dλ along the constraint, where there is one.
    pub(crate) tau_slope: f64,
    pub(crate) chi2: f64,
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
    low: f64,
    high: f64,
    chi2: f64,
}

/// Solves `problem` under its constraint. Needs no start.
pub(crate) fn solve(problem: &mut Problem) -> Solution {
    let mut budget = Budget {
        used: 0,
        limit: problem.data.options.max_evaluations,
    };
    let starts = match problem.data.options.constraint {
        Constraint::Exact | Constraint::Joint => scan_constraint(problem, &mut budget),
        Constraint::None => scan_plane(problem, &mut budget),
    };
    let mut best: Option<Solution> = None;
    for start in &starts {
        let solution = match problem.data.options.constraint {
            Constraint::Exact => along_constraint(problem, start, &mut budget),
            Constraint::Joint => {
                // What the hard constraint gives is a start that is never far.
                let exact = along_constraint(problem, start, &mut budget);
                descend(problem, exact.point, &mut budget)
            }
            Constraint::None => descend(problem, start.point, &mut budget),
        };
        if best.is_none_or(|b| solution.chi2 < b.chi2) {
            best = Some(solution);
        }
    }
    let best = best.expect("a scan has at least one smallest value");
    Solution {
        evaluations: budget.used,
        ..best
    }
}

/// The point of this λ at which the model's total is the measured one, and dτ/dλ along it.
///
/// The total falls with absorption, so a bracket always holds the root; where even a medium
/// without any returns too little, τ stays at its bound.
fn on_constraint(problem: &Problem, lambda: f64) -> (Point, f64) {
    let (mut low, mut high) = problem.tau_bounds(lambda);
    let at = |tau| Point { tau, lambda };
    let Some(total) = problem.exact_total() else {
        return (at(low), 0.0);
    };
    if problem.enclosed(at(low)).value <= total {
        return (at(low), 0.0);
    }
    let mut tau = low + (1.0 - total).clamp(0.0, 1.0) * (high - low);
    for _ in 0..100 {
        let model = problem.enclosed(at(tau));
        let excess = model.value - total;
        if excess > 0.0 {
            low = tau;
        } else {
            high = tau;
        }
        let newton = tau - excess / model.in_tau;
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        let done = (next - tau).abs() <= 1e-15 * tau;
        tau = next;
        if done || high - low <= 1e-15 * tau {
            break;
        }
    }
    let model = problem.enclosed(at(tau));
    (at(tau), -model.in_lambda / model.in_tau)
}

/// The smallest λ between the bounds at which a medium without absorption returns `total`: a
/// sparser one loses too much light outside the picture. `None` where none does.
fn least_lambda(problem: &Problem, total: f64) -> Option<f64> {
    let (mut low, mut high) = problem.lambda_bounds();
    let returns = |lambda: f64| {
        let tau = problem.tau_bounds(lambda).0;
        problem.enclosed(Point { tau, lambda }).value >= total
    };
    if !returns(high) {
        return None;
    }
    if returns(low) {
        return Some(low);
    }
    for _ in 0..60 {
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
    let kink = problem.exact_total().and_then(|t| least_lambda(problem, t));
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
    let scanned: Vec<(Point, f64)> = lambdas
        .iter()
        .map(|&lambda| {
            budget.spend();
            let (point, slope) = on_constraint(problem, lambda);
            (point, problem.along_constraint(point, slope).0)
        })
        .collect();
    let last = scanned.len() - 1;
    let mut starts: Vec<Start> = (0..=last)
        .filter(|&i| {
            let chi2 = scanned[i].1;
            (i == 0 || chi2 <= scanned[i - 1].1) && (i == last || chi2 <= scanned[i + 1].1)
        })
        .flat_map(|i| {
            let (below, above) = (lambdas[i.saturating_sub(1)], lambdas[(i + 1).min(last)]);
            let (point, chi2) = scanned[i];
            let start = |low: f64, high: f64, lambda: f64| Start {
                point: Point { lambda, ..point },
                low,
                high,
                chi2,
            };
            if kink == Some(lambdas[i]) {
                // χ² may have a minimum on either side.
                let middle = |a: f64, b: f64| 0.5 * (a + b);
                vec![
                    start(below, lambdas[i], middle(below, lambdas[i])),
                    start(lambdas[i], above, middle(lambdas[i], above)),
                ]
            } else {
                vec![start(below, above, lambdas[i])]
            }
        })
        .collect();
    starts.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    starts.truncate(4);
    starts
}

/// The best absorption at every λ of a scan over both coordinates, best first.
fn scan_plane(problem: &mut Problem, budget: &mut Budget) -> Vec<Start> {
    let (low, high) = problem.lambda_bounds();
    let mut starts: Vec<Start> = (0..SCAN)
        .filter_map(|i| {
            let lambda = low + (high - low) * i as f64 / (SCAN - 1) as f64;
            (1..=SCAN_ABSORPTION)
                .map(|j| {
                    // σₜᵣ/σₜ′ from 0.002 to 1.72, denser toward 0: α′ from 0.999999 to 0.01.
                    let k = 1.72 * (j as f64 / SCAN_ABSORPTION as f64).powf(2.5);
                    let tau = (k * lambda.exp()).hypot(problem.epsilon) - problem.epsilon;
                    let point = Point { tau, lambda };
                    budget.spend();
                    Start {
                        point,
                        low,
                        high,
                        chi2: problem.normal(point).chi2,
                    }
                })
                .min_by(|a, b| a.chi2.total_cmp(&b.chi2))
        })
        .collect();
    starts.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    starts.truncate(8);
    starts
}

/// The minimum along the constraint: the zero of the gradient in λ inside the bracket.
fn along_constraint(problem: &mut Problem, start: &Start, budget: &mut Budget) -> Solution {
    let (mut low, mut high, mut lambda) = (start.low, start.high, start.point.lambda);
    let mut termination = Termination::OutOfEvaluations;
    let (mut point, mut tau_slope, mut chi2) = (start.point, 0.0, start.chi2);
    while budget.spend() {
        (point, tau_slope) = on_constraint(problem, lambda);
        let (value, gradient, curvature) = problem.along_constraint(point, tau_slope);
        chi2 = value;
        if gradient > 0.0 {
            high = lambda;
        } else {
            low = lambda;
        }
        let newton = lambda - gradient / curvature;
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        if (next - lambda).abs() <= CLOSE || high - low <= CLOSE || gradient == 0.0 {
            termination = Termination::Converged;
            break;
        }
        lambda = next;
    }
    if point.tau <= problem.tau_bounds(lambda).0 && termination == Termination::Converged {
        termination = Termination::AtBound;
    }
    Solution {
        point,
        tau_slope,
        chi2,
        evaluations: budget.used,
        termination,
    }
}

/// Levenberg-Marquardt in (τ, λ) from one start, τ held inside its bounds.
fn descend(problem: &mut Problem, start: Point, budget: &mut Budget) -> Solution {
    let (lambda_low, lambda_high) = problem.lambda_bounds();
    let mut at = start;
    let mut normal = problem.normal(at);
    let mut damping = 1e-4;
    let mut termination = Termination::OutOfEvaluations;
    while budget.spend() {
        let (lowest, highest) = problem.tau_bounds(at.lambda);
        // A bound that the gradient pushes against takes τ out of the step.
        let held = (at.tau <= lowest && normal.gradient.x > 0.0)
            || (at.tau >= highest && normal.gradient.x < 0.0);
        let step = damped_step(&normal, damping, held);
        if !(step.x.is_finite() && step.y.is_finite()) {
            // Nothing here depends on the coefficients: the light has died out.
            break;
        }
        let lambda = (at.lambda + step.y).clamp(lambda_low, lambda_high);
        let (lowest, highest) = problem.tau_bounds(lambda);
        let next = Point {
            tau: (at.tau + step.x).clamp(lowest, highest),
            lambda,
        };
        let trial = problem.normal(next);
        let small = (next.lambda - at.lambda).abs() <= CLOSE
            && (next.tau - at.tau).abs() <= CLOSE * (at.tau + problem.epsilon);
        if trial.chi2 <= normal.chi2 {
            (at, normal) = (next, trial);
            damping = (damping * 0.1).max(1e-15);
        } else {
            damping *= 10.0;
        }
        if small || damping > 1e12 {
            termination = Termination::Converged;
            break;
        }
    }
    if at.tau <= problem.tau_bounds(at.lambda).0 && termination == Termination::Converged {
        termination = Termination::AtBound;
    }
    let evaluations = budget.used;
    Solution {
        point: at,
        tau_slope: 0.0,
        chi2: normal.chi2,
        evaluations,
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

//! The profile likelihood of σₐ: how far it can go before χ², with everything else at its best,
//! says no.
//!
//! Near 0 the likelihood is no parabola, in whatever coordinate: the light that a little absorption
//! takes away shows far out alone, and below 0 there is nothing. The ends of the interval are then
//! looked for where they are defined (Venzon and Moolgavkar 1988; JCGM 101, 5.11.3 on intervals that
//! are not symmetric).

use crate::problem::{Level, Point, Problem};
use crate::solve::Solution;
use nalgebra::Matrix2;

/// Steps of one search. Newton's needs about four.
const STEPS: usize = 30;
/// Part of the rise of χ² by which an end may be off.
const NEAR: f64 = 1e-4;

impl Problem<'_> {
    /// The σₐ above (`z` > 0) or below (`z` < 0) a solution where the least χ² has risen by `z`²;
    /// 0 where it never does so on the way down. `None` where nothing holds σₐ.
    ///
    /// It walks in x, the τ that this σₐ has at the solution's σₜ′, and takes λ along: every step
    /// is Newton's toward the end, and toward the best λ at once.
    pub(crate) fn likelihood_end(&mut self, solution: &Solution, z: f64) -> Option<f64> {
        let (epsilon, rise) = (self.epsilon, z * z);
        let t = solution.point.sigma_t_prime;
        let sigma_a = |x: f64| x * (x + 2.0 * epsilon) / (3.0 * t);
        let (least, most) = self.tau_bounds(solution.point);
        let (mut x, mut lambda) = (solution.point.tau, solution.point.lambda);
        let (mut inside, mut outside) = (x, if z > 0.0 { most } else { least });
        // How far the parabola at the solution reaches, and where it takes λ.
        let turn = |point, x| turn(point, x, t, epsilon);
        let turned = turn(solution.point, x);
        let mut h = turned.transpose() * solution.hessian * turned;
        let reach = rise.sqrt() / (h[(0, 0)] - h[(0, 1)] * h[(0, 1)] / h[(1, 1)]).sqrt();
        if !reach.is_finite() {
            return None;
        }
        let mut next = (x + reach.copysign(z)).clamp(least, most);
        for _ in 0..STEPS {
            lambda -= h[(0, 1)] / h[(1, 1)] * (next - x);
            x = next;
            let point = Point::at(lambda);
            let sigma_tr = (3.0 * sigma_a(x) * point.sigma_t_prime).sqrt();
            let point = point.with_sigma_tr(sigma_tr, epsilon);
            let normal = self.normal(Level::Full, point);
            let turned = turn(point, x);
            h = turned.transpose() * normal.hessian * turned;
            let gradient = turned.transpose() * normal.gradient;
            // What is left once λ has gone to its best.
            let to_best = -gradient.y / h[(1, 1)];
            let chi2 = normal.chi2 + to_best * gradient.y;
            let slope = 2.0 * (gradient.x + h[(0, 1)] * to_best);
            let excess = chi2 - solution.chi2 - rise;
            if !excess.is_finite() {
                return None;
            }
            lambda += to_best;
            let settled = to_best.abs() * h[(1, 1)].sqrt() < NEAR.sqrt() * rise.sqrt();
            if settled && (excess.abs() < NEAR * rise || (x == outside && excess < 0.0)) {
                break;
            }
            if excess < 0.0 {
                inside = x;
            } else {
                outside = x;
            }
            let newton = x - excess / slope;
            let (low, high) = (inside.min(outside), inside.max(outside));
            next = if newton > low && newton < high {
                newton
            } else if excess < 0.0 {
                // Not there yet: the bound itself may be within.
                outside
            } else {
                0.5 * (low + high)
            };
        }
        Some(if x <= least { 0.0 } else { sigma_a(x) })
    }
}

/// How (τ, λ) at `point` change with (x, λ).
fn turn(point: Point, x: f64, t: f64, epsilon: f64) -> Matrix2<f64> {
    let at = point.tau + epsilon;
    let in_x = (x + epsilon) * (point.sigma_t_prime / t) / at;
    let in_lambda = 0.5 * point.sigma_tr(epsilon).powi(2) / at;
    Matrix2::new(in_x, in_lambda, 0.0, 1.0)
}

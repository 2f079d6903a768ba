//! Where the table has its values, and how one gets between them.

use std::f64::consts::PI;

/// Nodes of an interpolating polynomial on an interval: Chebyshev's, ends included.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Nodes {
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) count: usize,
}

impl Nodes {
    pub(crate) fn at(&self, i: usize) -> f64 {
        let x = (PI * i as f64 / (self.count - 1) as f64).cos();
        0.5 * (self.low + self.high) - 0.5 * (self.high - self.low) * x
    }

    /// The weight of every node's value in the value at `x`.
    ///
    /// The barycentric formula (Berrut and Trefethen 2004), whose weights for these nodes are
    /// ±1, and ±½ at the ends.
    pub(crate) fn weights(&self, x: f64) -> Vec<f64> {
        let n = self.count;
        if let Some(hit) = (0..n).find(|&i| (x - self.at(i)).abs() < 1e-13 * (self.high - self.low))
        {
            return (0..n).map(|i| f64::from(u8::from(i == hit))).collect();
        }
        let term = |i: usize| {
            let end = if i == 0 || i + 1 == n { 0.5 } else { 1.0 };
            (if i.is_multiple_of(2) { end } else { -end }) / (x - self.at(i))
        };
        let sum: f64 = (0..n).map(term).sum();
        (0..n).map(|i| term(i) / sum).collect()
    }
}

/// Equally spaced knots of a cubic spline.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Knots {
    pub(crate) first: f64,
    pub(crate) step: f64,
    pub(crate) count: usize,
}

impl Knots {
    pub(crate) fn at(&self, i: usize) -> f64 {
        self.first + self.step * i as f64
    }

    pub(crate) fn last(&self) -> f64 {
        self.at(self.count - 1)
    }

    /// The panel that holds `x`, or the nearest one, and the place in it from 0 to 1.
    pub(crate) fn locate(&self, x: f64) -> (usize, f64) {
        let place = (x - self.first) / self.step;
        let panel = (place.max(0.0) as usize).min(self.count - 2);
        (panel, place - panel as f64)
    }
}

/// What multiplies the values and the second derivatives at both ends of a panel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blend {
    /// For the value: y₀, y₁, y″₀, y″₁.
    pub(crate) value: [f64; 4],
    /// For the derivative by the place in the panel.
    pub(crate) slope: [f64; 4],
}

impl Blend {
    /// At the place `t` from 0 to 1; second derivatives are by the place as well.
    pub(crate) fn at(t: f64) -> Self {
        let s = 1.0 - t;
        Self {
            value: [s, t, (s * s * s - s) / 6.0, (t * t * t - t) / 6.0],
            slope: [
                -1.0,
                1.0,
                (1.0 - 3.0 * s * s) / 6.0,
                (3.0 * t * t - 1.0) / 6.0,
            ],
        }
    }
}

/// Second derivatives of the cubic spline through `values` at unit spacing, into `out`.
///
/// At its ends the third derivative is continuous over the first and last inner knots.
pub(crate) fn spline(values: &[f64], out: &mut [f64]) {
    let n = values.len();
    debug_assert!(n >= 5 && out.len() == n);
    let second = |i: usize| values[i - 1] - 2.0 * values[i] + values[i + 1];
    // Not-a-knot on a uniform grid makes the second derivatives next to the ends plain second
    // differences; between them the usual tridiagonal system stands.
    out[1] = second(1);
    out[n - 2] = second(n - 2);
    let mut scratch = vec![0.0; n];
    for i in 2..n - 2 {
        let diagonal = 4.0 - if i > 2 { scratch[i - 1] } else { 0.0 };
        let mut right = 6.0 * second(i);
        if i == 2 {
            right -= out[1];
        } else {
            right -= out[i - 1];
        }
        if i == n - 3 {
            right -= out[n - 2];
        }
        scratch[i] = 1.0 / diagonal;
        out[i] = right / diagonal;
    }
    for i in (2..n - 3).rev() {
        out[i] -= scratch[i] * out[i + 1];
    }
    out[0] = 2.0 * out[1] - out[2];
    out[n - 1] = 2.0 * out[n - 2] - out[n - 3];
}

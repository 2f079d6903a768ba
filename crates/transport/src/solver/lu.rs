//! One complex linear system.

use nalgebra::Complex;

type C = Complex<f64>;

/// Solves `matrix` x = `right` in place, by elimination with row pivots; `matrix` is by rows.
///
/// `right` holds x afterwards. A singular matrix gives numbers that are not finite.
pub(crate) fn solve(matrix: &mut [C], right: &mut [C]) {
    let n = right.len();
    for k in 0..n {
        let size = |i: usize| matrix[i * n + k].norm_sqr();
        let pivot = (k..n)
            .max_by(|&a, &b| size(a).total_cmp(&size(b)))
            .unwrap_or(k);
        if pivot != k {
            let (upper, lower) = matrix.split_at_mut(pivot * n);
            upper[k * n + k..(k + 1) * n].swap_with_slice(&mut lower[k..n]);
            right.swap(k, pivot);
        }
        let inverse = matrix[k * n + k].inv();
        let (upper, lower) = matrix.split_at_mut((k + 1) * n);
        let top = &upper[k * n + k + 1..(k + 1) * n];
        let pivot_right = right[k];
        for (row, right) in lower.chunks_exact_mut(n).zip(&mut right[k + 1..]) {
            let factor = row[k] * inverse;
            if factor == C::default() {
                continue;
            }
            for (x, t) in row[k + 1..].iter_mut().zip(top) {
                *x -= factor * t;
            }
            *right -= factor * pivot_right;
        }
    }
    for k in (0..n).rev() {
        let row = &matrix[k * n..(k + 1) * n];
        let known: C = row[k + 1..]
            .iter()
            .zip(&right[k + 1..])
            .map(|(a, x)| a * x)
            .sum();
        right[k] = (right[k] - known) / row[k];
    }
}

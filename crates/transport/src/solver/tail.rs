//! What the spectrum does beyond the frequencies at which it was solved.

use nalgebra::{Complex, DMatrix, DVector};

type C = Complex<f64>;

/// Share of the highest frequency solved from which the tail is fitted.
const START: f64 = 0.25;

/// High frequencies: Σ cₙ (1 + q²)^(−n/2), whose transforms are K₀(r), e^(−r), r K₁(r), …
///
/// Light that scattered at least twice grows like ln 1/r toward the beam.
pub(crate) struct Tail {
    coefficients: Vec<f64>,
}

impl Tail {
    const POWERS: std::ops::Range<i32> = 2..7;

    fn basis(q: C) -> impl Iterator<Item = C> {
        let root = (q * q + 1.0).sqrt().inv();
        Self::POWERS.map(move |n| root.powi(n))
    }

    /// The least-squares fit to the upper end of `solved`, pairs of frequency and value by
    /// rising frequency.
    pub(crate) fn fit(solved: &[(C, C)]) -> Self {
        let highest = solved.last().map_or(0.0, |(q, _)| q.norm());
        let first = solved.partition_point(|(q, _)| q.norm() < START * highest);
        let points = &solved[first..];
        let size = Self::POWERS.len();
        let mut matrix = DMatrix::zeros(2 * points.len(), size);
        let mut right = DVector::zeros(2 * points.len());
        for (i, &(q, value)) in points.iter().enumerate() {
            // A higher frequency says more of what follows.
            let weight = q.norm_sqr();
            for (j, basis) in Self::basis(q).enumerate() {
                matrix[(2 * i, j)] = weight * basis.re;
                matrix[(2 * i + 1, j)] = weight * basis.im;
            }
            right[2 * i] = weight * value.re;
            right[2 * i + 1] = weight * value.im;
        }
        let solution = matrix
            .svd(true, true)
            .solve(&right, 1e-9)
            .unwrap_or(DVector::zeros(size));
        Self {
            coefficients: solution.iter().copied().collect(),
        }
    }

    /// The spectrum at `q`.
    pub(crate) fn at(&self, q: C) -> C {
        Self::basis(q)
            .zip(&self.coefficients)
            .map(|(b, c)| b * *c)
            .sum()
    }
}

//! How light of one set of directions becomes light of another.

use nalgebra::{DMatrix, DVector};

/// Reflected share beyond which light of one direction never leaves: between two total reflections
/// in a clear slide. None gets there either, so that it may be left out of the sums.
const TRAPPED: f64 = 1.0 - 1e-14;

/// What a piece of matter does to light: the part that keeps its direction, and the part that does
/// not.
///
/// Acting on ℓ = L/n² it gives dᵢ ℓᵢ + Σⱼ Kᵢⱼ wⱼ ℓⱼ. Kept apart, the two are right also for
/// directions of no weight, and the unscattered beam never mixes with its neighbours.
#[derive(Clone, Debug)]
pub(crate) struct Operator {
    pub(crate) direct: DVector<f64>,
    pub(crate) kernel: DMatrix<f64>,
}

impl Operator {
    /// Nothing gets through.
    pub(crate) fn zero(count: usize) -> Self {
        Self::diagonal(DVector::zeros(count))
    }

    /// Everything keeps its direction.
    pub(crate) fn diagonal(direct: DVector<f64>) -> Self {
        let count = direct.len();
        Self {
            direct,
            kernel: DMatrix::zeros(count, count),
        }
    }

    /// This after `first`.
    pub(crate) fn after(&self, first: &Self, weights: &DVector<f64>) -> Self {
        let mut weighted = first.kernel.clone();
        scale_rows(&mut weighted, weights);
        let mut kernel = &self.kernel * &weighted;
        for (j, mut column) in kernel.column_iter_mut().enumerate() {
            let (through, from) = (first.direct[j], self.kernel.column(j));
            for (i, value) in column.iter_mut().enumerate() {
                *value += self.direct[i] * first.kernel[(i, j)] + from[i] * through;
            }
        }
        Self {
            direct: self.direct.component_mul(&first.direct),
            kernel,
        }
    }

    /// The sum of any number of bounces, 1 + A + A² + … = (1 − A)⁻¹.
    pub(crate) fn bounces(&self, weights: &DVector<f64>) -> Self {
        let count = self.direct.len();
        let mut system = -self.kernel.clone();
        scale_columns(&mut system, weights);
        let mut right = self.kernel.clone();
        let leaving = self.direct.map(|a| if a < TRAPPED { 1.0 - a } else { 1.0 });
        for i in 0..count {
            system[(i, i)] += leaving[i];
            right.column_mut(i).scale_mut(1.0 / leaving[i]);
        }
        // Σ Aᵏ converges for whatever matter can do, so that the system has a solution.
        let kernel = system
            .lu()
            .solve(&right)
            .unwrap_or_else(|| DMatrix::zeros(count, count));
        Self {
            direct: leaving.map(|kept| 1.0 / kept),
            kernel,
        }
    }

    pub(crate) fn plus(mut self, other: &Self, factor: f64) -> Self {
        self.direct.axpy(factor, &other.direct, 1.0);
        self.kernel += &other.kernel * factor;
        self
    }

    /// The same with in and out exchanged.
    pub(crate) fn adjoint(&self) -> Self {
        Self {
            direct: self.direct.clone(),
            kernel: self.kernel.transpose(),
        }
    }

    /// 1 − this.
    pub(crate) fn complement(&self) -> Self {
        Self {
            direct: self.direct.map(|a| 1.0 - a),
            kernel: -&self.kernel,
        }
    }

    /// Share of light from direction `j` that comes out in any direction but by the direct way.
    pub(crate) fn scattered(&self, j: usize, weights: &DVector<f64>) -> f64 {
        self.kernel.column(j).dot(weights)
    }
}

fn scale_rows(matrix: &mut DMatrix<f64>, factors: &DVector<f64>) {
    for mut column in matrix.column_iter_mut() {
        column.component_mul_assign(factors);
    }
}

fn scale_columns(matrix: &mut DMatrix<f64>, factors: &DVector<f64>) {
    for (mut column, factor) in matrix.column_iter_mut().zip(factors.iter()) {
        column.scale_mut(*factor);
    }
}

//! Phase functions, and how scattering angles are drawn from them.

use crate::error::InvalidSimulation;
use physics::{HenyeyGreenstein, PhaseFunction};
use std::f64::consts::PI;

/// How a layer redistributes light when it scatters.
#[derive(Clone, Debug, PartialEq)]
pub enum Phase {
    /// Henyey and Greenstein (1941); isotropic at g = 0.
    HenyeyGreenstein {
        /// Mean cosine, in (-1, 1).
        g: f64,
    },
    /// Rayleigh's, of unpolarised light: 3/(16π) (1 + cos²θ).
    Rayleigh,
    /// Given by a table.
    Tabulated(TabulatedPhase),
}

impl Phase {
    /// The same in all directions.
    pub const ISOTROPIC: Self = Self::HenyeyGreenstein { g: 0.0 };

    /// 1 − cos θ at the share `xi`, in [0, 1), of the distribution over cos θ from -1 upward.
    ///
    /// One minus the cosine, because a forward peak would lose its digits in the cosine itself.
    pub fn one_minus_cos(&self, xi: f64) -> f64 {
        match self {
            // Henyey and Greenstein's usual inverse, multiplied out: no division by g is left.
            Self::HenyeyGreenstein { g } => {
                let ratio = (1.0 - g) / (1.0 - g + 2.0 * g * xi);
                2.0 * ratio * ratio * (1.0 - xi) * (1.0 + g * xi)
            }
            // μ³ + 3μ = 8ξ − 4, by Cardano: μ = a − 1/a, written without cancellation.
            Self::Rayleigh => 1.0 - 2.0 * ((4.0 * xi - 2.0).asinh() / 3.0).sinh(),
            Self::Tabulated(table) => 1.0 - table.cos_theta(xi),
        }
    }
}

impl PhaseFunction for Phase {
    fn density(&self, cos_theta: f64) -> f64 {
        match self {
            Self::HenyeyGreenstein { g } => HenyeyGreenstein { g: *g }.density(cos_theta),
            Self::Rayleigh => 3.0 / (16.0 * PI) * (1.0 + cos_theta * cos_theta),
            Self::Tabulated(table) => table.density(cos_theta) / (2.0 * PI),
        }
    }

    fn g(&self) -> f64 {
        match self {
            Self::HenyeyGreenstein { g } => *g,
            Self::Rayleigh => 0.0,
            Self::Tabulated(table) => table.mean_cosine(),
        }
    }
}

/// A phase function linear in cos θ between the rows of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct TabulatedPhase {
    cos_theta: Vec<f64>,
    /// Per unit of cos θ, with integral 1.
    density: Vec<f64>,
    /// Share below each row.
    below: Vec<f64>,
}

impl TabulatedPhase {
    /// From cosines that increase from -1 to 1 and densities in any common unit.
    ///
    /// # Errors
    ///
    /// [`InvalidSimulation::PhaseTable`] with the first row that is out of order.
    pub fn new(rows: &[(f64, f64)]) -> Result<Self, InvalidSimulation> {
        let bad = |row, cos_theta, density| {
            Err(InvalidSimulation::PhaseTable {
                row,
                cos_theta,
                density,
            })
        };
        let ends = rows.first().zip(rows.last());
        let Some((first, last)) = ends.filter(|_| rows.len() >= 2) else {
            return bad(0, f64::NAN, f64::NAN);
        };
        for (row, &(cos, density)) in rows.iter().enumerate() {
            let increases = row == 0 || rows[row - 1].0 < cos;
            if !(increases && density >= 0.0 && density.is_finite()) {
                return bad(row + 1, cos, density);
            }
        }
        if first.0 != -1.0 {
            return bad(1, first.0, first.1);
        }
        if last.0 != 1.0 {
            return bad(rows.len(), last.0, last.1);
        }
        let mut below = vec![0.0];
        let mut total = 0.0;
        for pair in rows.windows(2) {
            total += 0.5 * (pair[1].0 - pair[0].0) * (pair[0].1 + pair[1].1);
            below.push(total);
        }
        if !(total > 0.0 && total.is_finite()) {
            return bad(0, f64::NAN, total);
        }
        Ok(Self {
            cos_theta: rows.iter().map(|row| row.0).collect(),
            density: rows.iter().map(|row| row.1 / total).collect(),
            below: below.into_iter().map(|share| share / total).collect(),
        })
    }

    /// Rows as they were given, up to the unit of density.
    pub fn rows(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.cos_theta
            .iter()
            .copied()
            .zip(self.density.iter().copied())
    }

    fn density(&self, cos_theta: f64) -> f64 {
        let k = self
            .cos_theta
            .partition_point(|&c| c <= cos_theta)
            .clamp(1, self.below.len() - 1);
        let (low, high) = (self.cos_theta[k - 1], self.cos_theta[k]);
        let share = (cos_theta - low) / (high - low);
        self.density[k - 1] + share * (self.density[k] - self.density[k - 1])
    }

    fn mean_cosine(&self) -> f64 {
        let panels = self.cos_theta.windows(2).zip(self.density.windows(2));
        panels
            .map(|(c, p)| {
                // Simpson's rule is exact for the product of two straight lines.
                let middle = 0.25 * (c[0] + c[1]) * (p[0] + p[1]);
                (c[1] - c[0]) / 6.0 * (c[0] * p[0] + 4.0 * middle + c[1] * p[1])
            })
            .sum()
    }

    fn cos_theta(&self, xi: f64) -> f64 {
        let k = self
            .below
            .partition_point(|&share| share <= xi)
            .clamp(1, self.below.len() - 1);
        let (low, high) = (self.cos_theta[k - 1], self.cos_theta[k]);
        let (p, q) = (self.density[k - 1], self.density[k]);
        let slope = (q - p) / (high - low);
        let rest = xi - self.below[k - 1];
        // The root of slope/2·t² + p·t = rest in the form that stands a slope of 0.
        let root = (p * p + 2.0 * slope * rest).max(0.0).sqrt();
        let t = if rest > 0.0 {
            2.0 * rest / (p + root)
        } else {
            0.0
        };
        (low + t).min(high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn haze() -> Phase {
        let rows = [(-1.0, 0.2), (0.0, 0.0), (0.4, 0.0), (0.8, 1.0), (1.0, 9.0)];
        Phase::Tabulated(TabulatedPhase::new(&rows).unwrap())
    }

    fn all() -> [Phase; 6] {
        let hg = |g| Phase::HenyeyGreenstein { g };
        [
            hg(-0.7),
            hg(0.0),
            hg(0.3),
            hg(0.95),
            Phase::Rayleigh,
            haze(),
        ]
    }

    /// The share of the density below the cosine drawn at `xi` is `xi`: inverse and density are
    /// two descriptions of one function, and were derived apart.
    #[test]
    fn the_inverse_inverts_the_integral_of_the_density() {
        for phase in all() {
            for xi in [0.0, 1e-6, 0.01, 0.2, 0.5, 0.77, 0.99, 0.999_999] {
                let cos = 1.0 - phase.one_minus_cos(xi);
                assert!(
                    (-1.0 - 1e-12..=1.0 + 1e-12).contains(&cos),
                    "{phase:?} {xi}: {cos}"
                );
                let n = 400_000;
                let step = (cos + 1.0) / f64::from(n);
                let share: f64 = (0..n)
                    .map(|k| phase.density(-1.0 + (f64::from(k) + 0.5) * step))
                    .sum::<f64>()
                    * step
                    * 2.0
                    * PI;
                // What the midpoint rule leaves at the steepest peak.
                assert!((share - xi).abs() < 1e-6, "{phase:?} {xi}: {share}");
            }
        }
    }

    #[test]
    fn the_mean_of_the_draws_is_g() {
        for phase in all() {
            let n = 200_000;
            let mean: f64 = (0..n)
                .map(|k| 1.0 - phase.one_minus_cos((f64::from(k) + 0.5) / f64::from(n)))
                .sum::<f64>()
                / f64::from(n);
            assert!(
                (mean - phase.g()).abs() < 1e-6,
                "{phase:?}: {mean} for {}",
                phase.g()
            );
        }
    }

    #[test]
    fn a_bad_table_names_its_row() {
        let bad_row = |rows: &[(f64, f64)]| match TabulatedPhase::new(rows) {
            Err(InvalidSimulation::PhaseTable { row, .. }) => row,
            other => panic!("{other:?}"),
        };
        assert_eq!(
            bad_row(&[(-1.0, 1.0), (0.5, 1.0), (0.5, 2.0), (1.0, 1.0)]),
            3
        );
        assert_eq!(bad_row(&[(-1.0, 1.0), (1.0, -1.0)]), 2);
        assert_eq!(bad_row(&[(-0.9, 1.0), (1.0, 1.0)]), 1);
        assert_eq!(bad_row(&[(-1.0, 1.0), (0.9, 1.0)]), 2);
        assert_eq!(bad_row(&[]), 0);
        assert_eq!(bad_row(&[(-1.0, 0.0), (1.0, 0.0)]), 0);
    }
}

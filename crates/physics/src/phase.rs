//! Phase functions: how light is redistributed in angle when it scatters once.

use gauss_quad::GaussLegendre;
use std::f64::consts::PI;
use std::num::NonZeroUsize;
use thiserror::Error;

/// A phase function that depends on the scattering angle alone, normalised over the sphere.
pub trait PhaseFunction: Sync {
    /// Share scattered per steradian, sr⁻¹; `cos_theta` is 1 for light that keeps its direction.
    fn density(&self, cos_theta: f64) -> f64;

    /// Mean cosine of the scattering angle.
    fn g(&self) -> f64;
}

/// Henyey and Greenstein (1941), as in Hanrahan and Krueger (1993), section 3. Isotropic at g = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HenyeyGreenstein {
    /// Mean cosine, in (-1, 1).
    pub g: f64,
}

impl PhaseFunction for HenyeyGreenstein {
    #[inline(always)]
    fn density(&self, cos_theta: f64) -> f64 {
        let g = self.g;
        // |1 − g e^{iθ}|², written so that it cannot turn negative by rounding.
        let chord2 = (1.0 - g) * (1.0 - g) + 2.0 * g * (1.0 - cos_theta);
        (1.0 - g * g) / (4.0 * PI * chord2 * chord2.sqrt())
    }

    fn g(&self) -> f64 {
        self.g
    }
}

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
    /// Of several kinds of scatterers side by side.
    Mixture(PhaseMixture),
}

impl Phase {
    /// The same in all directions.
    pub const ISOTROPIC: Self = Self::HenyeyGreenstein { g: 0.0 };

    /// 1 − cos θ at the share `xi`, in [0, 1), of the distribution over cos θ from -1 upward.
    ///
    /// One minus the cosine, because a forward peak would lose its digits in the cosine itself.
    #[inline]
    pub fn one_minus_cos(&self, xi: f64) -> f64 {
        match self {
            // What follows gives the same; isotropic walks are spared its division.
            Self::HenyeyGreenstein { g: 0.0 } => 2.0 * (1.0 - xi),
            // Henyey and Greenstein's usual inverse, multiplied out: no division by g is left.
            Self::HenyeyGreenstein { g } => {
                let ratio = (1.0 - g) / (1.0 - g + 2.0 * g * xi);
                2.0 * ratio * ratio * (1.0 - xi) * (1.0 + g * xi)
            }
            // μ³ + 3μ = 8ξ − 4, by Cardano: μ = a − 1/a, written without cancellation.
            Self::Rayleigh => 1.0 - 2.0 * ((4.0 * xi - 2.0).asinh() / 3.0).sinh(),
            Self::Tabulated(table) => 1.0 - table.cos_theta(xi),
            Self::Mixture(mixture) => mixture.one_minus_cos(xi),
        }
    }

    /// What is wrong with it, if anything.
    pub(crate) fn check(&self) -> Result<(), InvalidPhase> {
        match self {
            Self::HenyeyGreenstein { g } if !(*g > -1.0 && *g < 1.0) => Err(InvalidPhase::G(*g)),
            _ => Ok(()),
        }
    }

    /// Legendre moments χ₀ … of `out.len()` orders: p = Σ (2l + 1)/(4π) χₗ Pₗ(cos θ), χ₀ = 1,
    /// χ₁ = g.
    pub fn legendre_moments(&self, out: &mut [f64]) {
        match self {
            Self::HenyeyGreenstein { g } => {
                let mut power = 1.0;
                for moment in out {
                    *moment = power;
                    power *= g;
                }
            }
            Self::Rayleigh => {
                out.fill(0.0);
                for (moment, value) in out.iter_mut().zip([1.0, 0.0, 0.1]) {
                    *moment = value;
                }
            }
            Self::Tabulated(table) => table.legendre_moments(out),
            Self::Mixture(mixture) => mixture.legendre_moments(out),
        }
    }
}

impl PhaseFunction for Phase {
    fn density(&self, cos_theta: f64) -> f64 {
        match self {
            Self::HenyeyGreenstein { g } => HenyeyGreenstein { g: *g }.density(cos_theta),
            Self::Rayleigh => 3.0 / (16.0 * PI) * (1.0 + cos_theta * cos_theta),
            Self::Tabulated(table) => table.density(cos_theta) / (2.0 * PI),
            Self::Mixture(mixture) => mixture.mean(|phase| phase.density(cos_theta)),
        }
    }

    fn g(&self) -> f64 {
        match self {
            Self::HenyeyGreenstein { g } => *g,
            Self::Rayleigh => 0.0,
            Self::Tabulated(table) => table.mean_cosine(),
            Self::Mixture(mixture) => mixture.mean(Phase::g),
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
    /// [`InvalidPhase::Table`] with the first row that is out of order.
    pub fn new(rows: &[(f64, f64)]) -> Result<Self, InvalidPhase> {
        let bad = |row, cos_theta, density| {
            Err(InvalidPhase::Table {
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

    /// ∫ p Pₗ dμ, with Gauss's rule on every panel fine enough for the highest order.
    fn legendre_moments(&self, out: &mut [f64]) {
        out.fill(0.0);
        let points = NonZeroUsize::new(out.len() / 2 + 2).expect("at least 2");
        let rule = GaussLegendre::new(points);
        for ends in self.cos_theta.windows(2) {
            let (middle, half) = (0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]));
            for (node, weight) in rule.iter() {
                let mu = middle + half * node;
                let share = weight * half * self.density(mu);
                let (mut before, mut here) = (0.0, 1.0);
                for (l, moment) in out.iter_mut().enumerate() {
                    *moment += share * here;
                    let l = l as f64;
                    (before, here) = (here, ((2.0 * l + 1.0) * mu * here - l * before) / (l + 1.0));
                }
            }
        }
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

/// The phase function of several kinds of scatterers, each weighted with its scattering
/// coefficient.
///
/// # Source
///
/// Hanrahan and Krueger (1993), section 3: σₛ p = Σ wᵢ σₛ,ᵢ pᵢ.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseMixture {
    /// Share of the scattering and phase function of each part; the shares add up to 1.
    parts: Vec<(f64, Phase)>,
}

impl PhaseMixture {
    /// From parts with their shares of the scattering, in any common unit.
    ///
    /// # Errors
    ///
    /// [`InvalidPhase`] where a share is not above 0, a part is not a phase function, or there is
    /// none.
    pub fn new(parts: &[(f64, Phase)]) -> Result<Self, InvalidPhase> {
        if parts.is_empty() {
            return Err(InvalidPhase::NoPart);
        }
        for (part, (share, phase)) in parts.iter().enumerate() {
            if !(*share > 0.0 && share.is_finite()) {
                return Err(InvalidPhase::Share {
                    part: part + 1,
                    share: *share,
                });
            }
            phase.check()?;
        }
        let total: f64 = parts.iter().map(|part| part.0).sum();
        Ok(Self {
            parts: parts.iter().map(|(s, p)| (s / total, p.clone())).collect(),
        })
    }

    /// Shares of the scattering, and phase functions.
    pub fn parts(&self) -> &[(f64, Phase)] {
        &self.parts
    }

    fn mean(&self, of: impl Fn(&Phase) -> f64) -> f64 {
        self.parts.iter().map(|(share, p)| share * of(p)).sum()
    }

    /// The first digits of `xi` choose the part, what is left of it the angle.
    fn one_minus_cos(&self, xi: f64) -> f64 {
        let mut rest = xi;
        let (last, others) = self.parts.split_last().expect("`new` refuses no parts");
        for (share, phase) in others {
            if rest < *share {
                return phase.one_minus_cos(rest / share);
            }
            rest -= share;
        }
        // Rounding must not lead out of [0, 1).
        last.1
            .one_minus_cos((rest / last.0).clamp(0.0, 1.0 - f64::EPSILON))
    }

    fn legendre_moments(&self, out: &mut [f64]) {
        let mut part = vec![0.0; out.len()];
        out.fill(0.0);
        for (share, phase) in &self.parts {
            phase.legendre_moments(&mut part);
            for (sum, moment) in out.iter_mut().zip(&part) {
                *sum += share * moment;
            }
        }
    }
}

/// A phase function is not one.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum InvalidPhase {
    /// g is not inside (-1, 1).
    #[error("mean cosine g must lie between -1 and 1, both excluded, got {0}")]
    G(f64),
    /// A part of a mixture has no share.
    #[error("part {part} of the mixture: its share of the scattering must be above 0, got {share}")]
    Share {
        /// Which part, from 1.
        part: usize,
        /// What was given.
        share: f64,
    },
    /// A mixture of nothing.
    #[error("a mixture of phase functions needs at least one part")]
    NoPart,
    /// The table does not describe a phase function.
    #[error(
        "row {row} of the phase function: cosines must increase from -1 to 1, densities be at \
         least 0 and not all 0; got cosine {cos_theta}, density {density}"
    )]
    Table {
        /// The offending row, from 1; 0 if it is the table as a whole.
        row: usize,
        /// Cosine in that row.
        cos_theta: f64,
        /// Density in that row.
        density: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dipole::tests::{argument, reference};

    #[test]
    fn agrees_with_forty_digits() {
        let rows = reference("henyey_greenstein");
        assert_eq!(rows.len(), 16);
        for (arguments, expected) in rows {
            let phase = HenyeyGreenstein {
                g: argument(&arguments, "g"),
            };
            let got = phase.density(argument(&arguments, "cos"));
            assert!(
                (got / expected - 1.0).abs() < 1e-13,
                "{arguments}: {got} for {expected}"
            );
        }
    }

    #[test]
    fn integrates_to_one_with_mean_cosine_g() {
        let rule = GaussLegendre::new(NonZeroUsize::new(200).unwrap());
        for g in [-0.7, 0.0, 0.3, 0.9] {
            let phase = HenyeyGreenstein { g };
            let one = rule.integrate(-1.0, 1.0, |c| 2.0 * PI * phase.density(c));
            let mean = rule.integrate(-1.0, 1.0, |c| 2.0 * PI * c * phase.density(c));
            assert!(
                (one - 1.0).abs() < 1e-10 && (mean - g).abs() < 1e-10,
                "g = {g}: {one}, {mean}"
            );
        }
    }

    fn haze() -> Phase {
        let rows = [(-1.0, 0.2), (0.0, 0.0), (0.4, 0.0), (0.8, 1.0), (1.0, 9.0)];
        Phase::Tabulated(TabulatedPhase::new(&rows).unwrap())
    }

    fn skin() -> Phase {
        let parts = [
            (0.2, Phase::HenyeyGreenstein { g: 0.81 }),
            (0.6, Phase::Rayleigh),
            (1.2, haze()),
        ];
        Phase::Mixture(PhaseMixture::new(&parts).unwrap())
    }

    fn all() -> [Phase; 7] {
        let hg = |g| Phase::HenyeyGreenstein { g };
        [
            hg(-0.7),
            hg(0.0),
            hg(0.3),
            hg(0.95),
            Phase::Rayleigh,
            haze(),
            skin(),
        ]
    }

    /// The share of the density below the cosine drawn at `xi` is `xi`: inverse and density are
    /// two descriptions of one function, and were derived apart.
    #[test]
    fn the_inverse_inverts_the_integral_of_the_density() {
        let one_piece = |phase: &Phase| !matches!(phase, Phase::Mixture(_));
        for phase in all().into_iter().filter(one_piece) {
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
            Err(InvalidPhase::Table { row, .. }) => row,
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

    /// A mixture draws its parts one after the other: the mean of every Legendre polynomial over
    /// the draws is a moment, and so is its integral over the density.
    #[test]
    fn moments_are_means_of_draws_and_integrals_of_the_density() {
        let legendre = |l: usize, mu: f64| {
            let (mut before, mut here) = (0.0, 1.0);
            for k in 0..l {
                let k = k as f64;
                (before, here) = (here, ((2.0 * k + 1.0) * mu * here - k * before) / (k + 1.0));
            }
            here
        };
        for phase in all() {
            let mut moments = [0.0; 9];
            phase.legendre_moments(&mut moments);
            assert!((moments[0] - 1.0).abs() < 1e-12, "{phase:?}: {moments:?}");
            assert!(
                (moments[1] - phase.g()).abs() < 1e-12,
                "{phase:?}: {moments:?}"
            );
            let n = 200_000;
            let middle = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
            for l in [2, 5, 8] {
                let drawn: f64 = (0..n)
                    .map(|k| legendre(l, 1.0 - phase.one_minus_cos(middle(k))))
                    .sum::<f64>()
                    / f64::from(n);
                let integral: f64 = (0..n)
                    .map(|k| {
                        let mu = 2.0 * middle(k) - 1.0;
                        4.0 * PI / f64::from(n) * phase.density(mu) * legendre(l, mu)
                    })
                    .sum();
                let expected = moments[l];
                assert!(
                    (drawn - expected).abs() < 3e-5,
                    "{phase:?} {l}: {drawn} for {expected}"
                );
                assert!(
                    (integral - expected).abs() < 1e-5,
                    "{phase:?} {l}: {integral} for {expected}"
                );
            }
        }
    }

    #[test]
    fn a_bad_mixture_names_its_part() {
        assert_eq!(PhaseMixture::new(&[]), Err(InvalidPhase::NoPart));
        let parts = [(1.0, Phase::Rayleigh), (0.0, Phase::ISOTROPIC)];
        let share = InvalidPhase::Share {
            part: 2,
            share: 0.0,
        };
        assert_eq!(PhaseMixture::new(&parts), Err(share));
        let parts = [(1.0, Phase::HenyeyGreenstein { g: 1.0 })];
        assert_eq!(PhaseMixture::new(&parts), Err(InvalidPhase::G(1.0)));
    }
}

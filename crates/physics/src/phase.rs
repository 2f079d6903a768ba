//! Phase functions: how light is redistributed in angle when it scatters once.

use std::f64::consts::PI;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dipole::tests::{argument, reference};
    use gauss_quad::GaussLegendre;
    use std::num::NonZeroUsize;

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
}

//! The white reference as a medium that glows, and how well that is known.

use physics::ReducedMedium;

/// The lines of a budget that its coefficients become, in the order of [`White::off`].
pub const SOURCES: [&str; 2] = ["white reference: absorption", "white reference: scattering"];

/// The white as a medium, with the standard uncertainties of its coefficients, mm⁻¹.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct White {
    /// The medium.
    pub medium: ReducedMedium,
    /// Standard uncertainty of σₐ.
    pub u_sigma_a: f64,
    /// Standard uncertainty of σₛ′.
    pub u_sigma_s_prime: f64,
}

/// What a white makes of something when one coefficient is off to either side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sides {
    above: ReducedMedium,
    below: ReducedMedium,
    /// Standard uncertainties from the one to the other.
    span: f64,
}

impl White {
    /// A medium that is known exactly.
    pub fn exact(medium: ReducedMedium) -> Self {
        Self {
            medium,
            u_sigma_a: 0.0,
            u_sigma_s_prime: 0.0,
        }
    }

    /// The medium with the coefficient of [`SOURCES`] `which` off by `z` of its standard
    /// uncertainties, and how far it then is: none falls to 0 or below but σₐ, which stops there.
    pub fn off(&self, which: usize, z: f64) -> (ReducedMedium, f64) {
        let mut medium = self.medium;
        let (value, u, least) = if which == 0 {
            (&mut medium.sigma_a, self.u_sigma_a, 0.0)
        } else {
            let least = 0.1 * self.medium.sigma_s_prime;
            (&mut medium.sigma_s_prime, self.u_sigma_s_prime, least)
        };
        let before = *value;
        *value = (before + z * u).max(least);
        let moved = if u > 0.0 { (*value - before) / u } else { 0.0 };
        (medium, moved)
    }

    /// The media on either side, for each of [`SOURCES`].
    pub(crate) fn sides(&self) -> [Sides; 2] {
        [0, 1].map(|which| {
            let ((above, up), (below, down)) = (self.off(which, 1.0), self.off(which, -1.0));
            Sides {
                above,
                below,
                span: up - down,
            }
        })
    }
}

impl Sides {
    /// By how much `of` changes for one standard uncertainty.
    pub(crate) fn change(&self, of: impl Fn(&ReducedMedium) -> f64) -> f64 {
        if self.span > 0.0 {
            (of(&self.above) - of(&self.below)) / self.span
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_that_of_one_standard_uncertainty_also_at_the_end_of_the_range() {
        let medium = ReducedMedium {
            sigma_a: 0.0,
            sigma_s_prime: 20.0,
            eta: 1.3,
        };
        let white = White {
            medium,
            u_sigma_a: 1e-4,
            u_sigma_s_prime: 2.0,
        };
        let [absorption, scattering] = white.sides();
        assert_eq!(absorption.below.sigma_a, 0.0);
        let found = [
            absorption.change(|m| 3.0 * m.sigma_a) / 3e-4,
            scattering.change(|m| 3.0 * m.sigma_s_prime) / 6.0,
        ];
        assert!(found.iter().all(|f| (f - 1.0).abs() < 1e-12), "{found:?}");
        let exact = White::exact(medium).sides();
        assert!(exact.iter().all(|s| s.change(|m| m.sigma_a) == 0.0));
    }
}

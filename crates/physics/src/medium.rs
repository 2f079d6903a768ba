//! Media: as a photon meets them, and as diffusion theory sees them.

use std::ops::RangeInclusive;
use thiserror::Error;

/// Relative refractive indices that a sample can have, as it lies there to be measured.
pub const SAMPLE_INDEX: RangeInclusive<f64> = 1.0..=5.0;

/// A homogeneous medium, as a photon meets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Absorption coefficient σₐ, mm⁻¹.
    pub sigma_a: f64,
    /// Scattering coefficient σₛ, mm⁻¹.
    pub sigma_s: f64,
    /// Mean cosine of the scattering angle, in (-1, 1).
    pub g: f64,
    /// Index of the medium over that of its surroundings.
    pub eta: f64,
}

/// A medium as diffusion theory sees it: scattering made isotropic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReducedMedium {
    /// Absorption coefficient σₐ, mm⁻¹.
    pub sigma_a: f64,
    /// Reduced scattering coefficient σₛ′ = σₛ(1 − g), mm⁻¹.
    pub sigma_s_prime: f64,
    /// Index of the medium over that of its surroundings.
    pub eta: f64,
}

/// The two numbers that a fit looks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    /// Absorption coefficient σₐ, mm⁻¹.
    pub sigma_a: f64,
    /// Reduced scattering coefficient σₛ′, mm⁻¹.
    pub sigma_s_prime: f64,
}

/// A coefficient lies outside the domain of the model.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum InvalidMedium {
    /// σₐ is negative or not finite.
    #[error("absorption coefficient must be at least 0 mm^-1, got {0} mm^-1")]
    SigmaA(f64),
    /// σₛ is negative or not finite.
    #[error("scattering coefficient must be at least 0 mm^-1, got {0} mm^-1")]
    SigmaS(f64),
    /// σₛ′ is not positive or not finite.
    #[error("reduced scattering coefficient must be above 0 mm^-1, got {0} mm^-1")]
    SigmaSPrime(f64),
    /// g is not inside (-1, 1).
    #[error("mean cosine g must lie between -1 and 1, both excluded, got {0}")]
    G(f64),
    /// η is outside what a dielectric can have.
    #[error("relative refractive index must lie between 0.2 and 5, got {0}")]
    Eta(f64),
}

fn check_eta(eta: f64) -> Result<(), InvalidMedium> {
    // NaN fails the range test as well.
    if (0.2..=5.0).contains(&eta) {
        Ok(())
    } else {
        Err(InvalidMedium::Eta(eta))
    }
}

impl Medium {
    /// The same medium, or what is wrong with it.
    ///
    /// # Errors
    ///
    /// [`InvalidMedium`] names the first coefficient outside its domain.
    pub fn validated(self) -> Result<Self, InvalidMedium> {
        if !(self.sigma_a >= 0.0 && self.sigma_a.is_finite()) {
            return Err(InvalidMedium::SigmaA(self.sigma_a));
        }
        if !(self.sigma_s >= 0.0 && self.sigma_s.is_finite()) {
            return Err(InvalidMedium::SigmaS(self.sigma_s));
        }
        if !(self.g > -1.0 && self.g < 1.0) {
            return Err(InvalidMedium::G(self.g));
        }
        check_eta(self.eta)?;
        Ok(self)
    }

    /// The similarity relation, σₛ′ = σₛ(1 − g).
    pub fn reduced(&self) -> ReducedMedium {
        ReducedMedium {
            sigma_a: self.sigma_a,
            sigma_s_prime: self.sigma_s * (1.0 - self.g),
            eta: self.eta,
        }
    }

    /// Extinction coefficient σₜ = σₐ + σₛ, mm⁻¹.
    pub fn sigma_t(&self) -> f64 {
        self.sigma_a + self.sigma_s
    }

    /// Single-scattering albedo α = σₛ/σₜ.
    pub fn albedo(&self) -> f64 {
        self.sigma_s / self.sigma_t()
    }
}

impl ReducedMedium {
    /// The same medium, or what is wrong with it.
    ///
    /// # Errors
    ///
    /// [`InvalidMedium`] names the first coefficient outside its domain.
    pub fn validated(self) -> Result<Self, InvalidMedium> {
        self.coefficients().validated()?;
        check_eta(self.eta)?;
        Ok(self)
    }

    /// σₐ and σₛ′ alone.
    pub fn coefficients(&self) -> Coefficients {
        Coefficients {
            sigma_a: self.sigma_a,
            sigma_s_prime: self.sigma_s_prime,
        }
    }

    /// One of the many media that share this reduced medium: the one with mean cosine `g`.
    pub fn with_g(&self, g: f64) -> Medium {
        Medium {
            sigma_a: self.sigma_a,
            sigma_s: self.sigma_s_prime / (1.0 - g),
            g,
            eta: self.eta,
        }
    }
}

impl Coefficients {
    /// The same coefficients, or what is wrong with them.
    ///
    /// # Errors
    ///
    /// [`InvalidMedium`] names the first coefficient outside its domain.
    pub fn validated(self) -> Result<Self, InvalidMedium> {
        if !(self.sigma_a >= 0.0 && self.sigma_a.is_finite()) {
            return Err(InvalidMedium::SigmaA(self.sigma_a));
        }
        if !(self.sigma_s_prime > 0.0 && self.sigma_s_prime.is_finite()) {
            return Err(InvalidMedium::SigmaSPrime(self.sigma_s_prime));
        }
        Ok(self)
    }

    /// The coefficients with this effective transport coefficient σₜᵣ and this reduced
    /// extinction σₜ′, both mm⁻¹; σₜᵣ below √3 σₜ′.
    pub fn from_sigma_tr(sigma_tr: f64, sigma_t_prime: f64) -> Self {
        let sigma_a = sigma_tr * sigma_tr / (3.0 * sigma_t_prime);
        Self {
            sigma_a,
            sigma_s_prime: sigma_t_prime - sigma_a,
        }
    }

    /// Reduced extinction coefficient σₜ′ = σₐ + σₛ′, mm⁻¹.
    pub fn sigma_t_prime(&self) -> f64 {
        self.sigma_a + self.sigma_s_prime
    }

    /// Reduced albedo α′ = σₛ′/σₜ′.
    pub fn albedo_prime(&self) -> f64 {
        self.sigma_s_prime / self.sigma_t_prime()
    }

    /// Effective transport coefficient σₜᵣ = √(3 σₐ σₜ′), mm⁻¹.
    pub fn sigma_tr(&self) -> f64 {
        (3.0 * self.sigma_a * self.sigma_t_prime()).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reduction_and_its_way_back() {
        let medium = Medium {
            sigma_a: 0.01,
            sigma_s: 10.0,
            g: 0.9,
            eta: 1.4,
        };
        let back = medium.reduced().with_g(0.9);
        assert!((medium.reduced().sigma_s_prime - 1.0).abs() < 1e-15);
        assert!((back.sigma_s - medium.sigma_s).abs() < 1e-14);
    }

    #[test]
    fn sigma_tr_and_sigma_t_prime_give_the_coefficients_back() {
        let c = Coefficients {
            sigma_a: 0.0041,
            sigma_s_prime: 2.62,
        };
        let back = Coefficients::from_sigma_tr(c.sigma_tr(), c.sigma_t_prime());
        assert!((back.sigma_a / c.sigma_a - 1.0).abs() < 1e-13, "{back:?}");
        assert!(
            (back.sigma_s_prime / c.sigma_s_prime - 1.0).abs() < 1e-13,
            "{back:?}"
        );
    }

    #[test]
    fn each_bad_coefficient_is_named() {
        let good = Medium {
            sigma_a: 0.1,
            sigma_s: 1.0,
            g: 0.5,
            eta: 1.3,
        };
        assert_eq!(good.validated(), Ok(good));
        let bad = Medium {
            sigma_a: -0.1,
            ..good
        };
        assert_eq!(bad.validated(), Err(InvalidMedium::SigmaA(-0.1)));
        assert_eq!(
            Medium { g: 1.0, ..good }.validated(),
            Err(InvalidMedium::G(1.0))
        );
        assert_eq!(
            Medium { eta: 15.0, ..good }.validated(),
            Err(InvalidMedium::Eta(15.0))
        );
        let infinite = Medium {
            sigma_s: f64::INFINITY,
            ..good
        };
        assert_eq!(
            infinite.validated(),
            Err(InvalidMedium::SigmaS(f64::INFINITY))
        );
        let black = ReducedMedium {
            sigma_a: 0.1,
            sigma_s_prime: 0.0,
            eta: 1.3,
        };
        assert_eq!(black.validated(), Err(InvalidMedium::SigmaSPrime(0.0)));
    }
}

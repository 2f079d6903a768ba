//! How much light the BSSRDF of Jensen et al. returns, beside how much there is.

use crate::error::{Blame, Result};
use gauss_quad::GaussLegendre;
use physics::brdf::{BrdfApproximation, Directions};
use physics::{DiffuseFresnel, Layer, LayeredMedium, Medium, Phase, fresnel};
use std::f64::consts::PI;
use std::num::NonZeroUsize;

/// Light that a half-space returns under normal incidence, shares of the incident power, the
/// specular part left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    /// By adding-doubling: the truth for isotropic scattering.
    pub exact: f64,
    /// Jensen's S_d: the dipole between Fresnel's transmittances of both directions (eq. 5).
    pub diffuse: f64,
    /// Jensen's S⁽¹⁾ (eq. 6) with the 1/η² that radiance asks for: what photons do that scatter
    /// once and meet no surface from inside before they leave.
    pub single: f64,
    /// The same as printed, without it.
    pub single_as_printed: f64,
}

impl Energy {
    /// Both terms, the misprint mended. Single scattering is in it twice, since the dipole's α′
    /// has it already; that both Fresnel factors lose light on the way out hides it.
    pub fn both(&self) -> f64 {
        self.diffuse + self.single
    }

    /// Both terms as printed.
    pub fn both_as_printed(&self) -> f64 {
        self.diffuse + self.single_as_printed
    }
}

/// The audit of a half-space of albedo `albedo`, in (0, 1), that scatters isotropically, of index
/// `eta`.
///
/// # Errors
///
/// The medium is none.
pub fn energy(albedo: f64, eta: f64) -> Result<Energy> {
    let medium = Medium {
        sigma_a: 1.0 - albedo,
        sigma_s: albedo,
        g: 0.0,
        eta,
    };
    let layered = LayeredMedium {
        layers: vec![Layer {
            sigma_a: medium.sigma_a,
            sigma_s: medium.sigma_s,
            phase: Phase::ISOTROPIC,
            eta,
            thickness_mm: None,
        }],
        eta_above: 1.0,
        eta_below: 1.0,
    };
    let response = layers::solve(&layered, &[1.0], &[]).fault("energy")?;
    let brdf = BrdfApproximation::new(&medium, DiffuseFresnel::Exact);
    let rule = GaussLegendre::new(NonZeroUsize::new(64).expect("64 is not zero"));
    let leaving = |f: &dyn Fn(&Directions) -> f64| {
        rule.integrate(0.0, 1.0, |cos_out| {
            let directions = Directions {
                cos_in: 1.0,
                cos_out,
                cos_azimuth: 1.0,
            };
            2.0 * PI * cos_out * f(&directions)
        })
    };
    let single = leaving(&|d| brdf.single_scattering(d));
    Ok(Energy {
        exact: response.reflectance[0] - fresnel::reflectance(eta, 1.0),
        diffuse: leaving(&|d| brdf.diffuse(d)),
        single,
        single_as_printed: eta * eta * single,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact, diffuse, and with the single scattering as printed, as an independent program and
    /// photons have them.
    #[test]
    fn the_audit_is_known() {
        for (name, albedo, eta, expected) in [
            ("marble", 2.62 / 2.6241, 1.5, [0.768, 0.690, 0.805]),
            ("skin1 G", 0.88 / 1.05, 1.3, [0.210, 0.210, 0.315]),
            ("half", 0.5, 1.5, [0.044, 0.064, 0.122]),
        ] {
            let found = energy(albedo, eta).unwrap();
            println!("{name}: {found:?}");
            let got = [found.exact, found.diffuse, found.both_as_printed()];
            for (got, expected) in got.into_iter().zip(expected) {
                assert!(
                    (got - expected).abs() < 1e-3,
                    "{name}: {got} for {expected}"
                );
            }
        }
    }
}

//! The BSSRDF folded into a BRDF: what is left when the surface is lit evenly.

use crate::dipole::Dipole;
use crate::fresnel::{self, DiffuseFresnel};
use crate::medium::Medium;
use crate::phase::{HenyeyGreenstein, PhaseFunction};
use std::f64::consts::PI;

/// Directions of incidence and view outside a surface, against its normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directions {
    /// Cosine between normal and light, in (0, 1].
    pub cos_in: f64,
    /// Cosine between normal and view, in (0, 1].
    pub cos_out: f64,
    /// Cosine of the azimuth between the two; 1 where light and view stand on opposite sides of
    /// the normal (the side of the mirror direction).
    pub cos_azimuth: f64,
}

/// The BRDF approximation of a half-space: single scattering plus the dipole's total.
///
/// The paper's formula as it was meant. Corrected: the factor 1/η² that radiance loses on
/// leaving the denser medium, without which the single-scattering term does not close its
/// energy balance. Left as known approximations: the diffuse term already holds the light of the
/// first scattering (it is counted twice), and its two Fresnel factors lose 1 − F_dr,ext of it.
///
/// # Source
///
/// Jensen et al. (2001), section 2.4, f_r = f_r⁽¹⁾ + F R_d/π.
#[derive(Clone, Copy, Debug)]
pub struct BrdfApproximation {
    medium: Medium,
    total_reflectance: f64,
}

impl BrdfApproximation {
    /// The BRDF of `medium`, with a Henyey-Greenstein phase function.
    pub fn new(medium: &Medium, fresnel: DiffuseFresnel) -> Self {
        let total_reflectance = Dipole::new(&medium.reduced(), fresnel).total_reflectance();
        Self {
            medium: *medium,
            total_reflectance,
        }
    }

    /// The single-scattering part, sr⁻¹.
    pub fn single_scattering(&self, directions: &Directions) -> f64 {
        let Directions {
            cos_in,
            cos_out,
            cos_azimuth,
        } = *directions;
        let eta = self.medium.eta;
        let (Some(inner_in), Some(inner_out)) = (
            fresnel::refracted_cos(eta, cos_in),
            fresnel::refracted_cos(eta, cos_out),
        ) else {
            return 0.0;
        };
        let sines = ((1.0 - inner_in * inner_in) * (1.0 - inner_out * inner_out)).sqrt();
        // Light goes down before and up after the scattering.
        let cos_theta = sines * cos_azimuth - inner_in * inner_out;
        let phase = HenyeyGreenstein { g: self.medium.g };
        self.medium.albedo() * self.transmission(directions) * phase.density(cos_theta)
            / (eta * eta * (inner_in + inner_out))
    }

    /// The diffuse part, sr⁻¹.
    pub fn diffuse(&self, directions: &Directions) -> f64 {
        self.transmission(directions) * self.total_reflectance / PI
    }

    /// The whole BRDF, sr⁻¹.
    pub fn value(&self, directions: &Directions) -> f64 {
        self.single_scattering(directions) + self.diffuse(directions)
    }

    /// F: the product of the two Fresnel transmittances.
    fn transmission(&self, directions: &Directions) -> f64 {
        fresnel::entry_factor(self.medium.eta, directions.cos_in)
            * fresnel::entry_factor(self.medium.eta, directions.cos_out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dipole::tests::{argument, reference};

    /// The table's Hanrahan-Krueger slabs turn into this half-space when their finite depth is
    /// divided out.
    #[test]
    fn single_scattering_agrees_with_forty_digits() {
        let rows = reference("hk_first_order_brdf");
        assert_eq!(rows.len(), 18);
        for (arguments, expected) in rows {
            let [albedo, tau, g, eta, cos_in, cos_out, cos_azimuth] =
                ["albedo", "tau", "g", "eta", "cos_i", "cos_o", "cos_dphi"]
                    .map(|name| argument(&arguments, name));
            let medium = Medium {
                sigma_a: 1.0 - albedo,
                sigma_s: albedo,
                g,
                eta,
            };
            let brdf = BrdfApproximation::new(&medium, DiffuseFresnel::Exact);
            let half_space = brdf.single_scattering(&Directions {
                cos_in,
                cos_out,
                cos_azimuth,
            });
            let inner = |c: f64| (1.0 - (1.0 - c * c) / (eta * eta)).sqrt();
            let depth = 1.0 - (-tau * (1.0 / inner(cos_in) + 1.0 / inner(cos_out))).exp();
            let got = half_space * depth;
            assert!(
                (got / expected - 1.0).abs() < 1e-12,
                "{arguments}: {got} for {expected}"
            );
        }
    }

    #[test]
    fn is_reciprocal_and_the_diffuse_part_loses_what_the_paper_loses() {
        let medium = Medium {
            sigma_a: 0.1,
            sigma_s: 2.0,
            g: 0.4,
            eta: 1.4,
        };
        let brdf = BrdfApproximation::new(&medium, DiffuseFresnel::Exact);
        let there = Directions {
            cos_in: 0.3,
            cos_out: 0.8,
            cos_azimuth: -0.2,
        };
        let back = Directions {
            cos_in: 0.8,
            cos_out: 0.3,
            ..there
        };
        assert!((brdf.value(&there) / brdf.value(&back) - 1.0).abs() < 1e-14);

        let rule = gauss_quad::GaussLegendre::new(std::num::NonZeroUsize::new(80).unwrap());
        let albedo = rule.integrate(0.0, 1.0, |cos_out| {
            2.0 * PI
                * cos_out
                * brdf.diffuse(&Directions {
                    cos_in: 1.0,
                    cos_out,
                    cos_azimuth: 0.0,
                })
        });
        let expected = brdf.total_reflectance
            * fresnel::entry_factor(1.4, 1.0)
            * (1.0 - fresnel::diffuse_reflectance(1.4));
        assert!(
            (albedo / expected - 1.0).abs() < 1e-7,
            "{albedo} for {expected}"
        );
    }
}

//! The better dipole of d'Eon (2012): Grosjean's diffusion, with the weights of flux and fluence.

use crate::fresnel::Exitance;
use crate::image_sources::{Images, Pair, Rule, WeightedDipole};
use crate::medium::Coefficients;
use crate::model::{ForwardModel, Gradient};

/// The better dipole: Grosjean's diffusion coefficient in a dipole of Kienle and Patterson's form.
///
/// D = (2σₐ + σₛ′)/(3σₜ′²), σₜᵣ = √(σₐ/D), and a source of strength α′²: Grosjean splits the
/// fluence of a point source into light that has not scattered and α′ times a diffuse part, and
/// this is the diffuse part of a source that is itself of strength α′. What scattered once is thus
/// *not* in it. Where absorption is strong that light is missing (d'Eon adds it apart), and a fit
/// answers with too little absorption; photon beam diffusion has both parts.
///
/// Trust it where α′ is above 0.9 and `radius` above two transport lengths 1/σₜ′.
///
/// # Source
///
/// d'Eon, *A Better Dipole* (2012); Grosjean's approximation and the weights from d'Eon and
/// Irving, *A Quantized-Diffusion Model for Rendering Translucent Materials* (2011), section 5.
///
/// ```
/// use physics::{BetterDipoleModel, Coefficients, ForwardModel};
///
/// let marble = Coefficients { sigma_a: 0.0041, sigma_s_prime: 2.62 };
/// let total = BetterDipoleModel::new(1.5).within(marble, f64::INFINITY).value;
/// assert!((total - 0.794_344).abs() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BetterDipoleModel {
    eta: f64,
    exitance: Exitance,
    rule: Rule,
}

/// Grosjean's diffusion coefficient D, mm.
pub(crate) fn grosjean_diffusion(sigma_a: Gradient, sigma_s_prime: Gradient) -> Gradient {
    let sigma_t_prime = sigma_a + sigma_s_prime;
    (sigma_a * 2.0 + sigma_s_prime) / (sigma_t_prime * sigma_t_prime * 3.0)
}

impl BetterDipoleModel {
    /// The model at relative index `eta`.
    pub fn new(eta: f64) -> Self {
        Self {
            eta,
            exitance: Exitance::new(eta),
            rule: Rule::new(),
        }
    }

    fn at(&self, coefficients: Coefficients) -> WeightedDipole {
        let (sigma_a, sigma_s_prime) = Gradient::of(coefficients);
        let depth = Gradient::constant(1.0) / (sigma_a + sigma_s_prime);
        let diffusion = grosjean_diffusion(sigma_a, sigma_s_prime);
        let albedo = sigma_s_prime * depth;
        WeightedDipole {
            images: Images::new(sigma_a, diffusion, self.exitance),
            pair: Pair {
                source: depth,
                image: (depth + diffusion * (4.0 * self.exitance.a())) * -1.0,
            },
            power: albedo * albedo,
        }
    }
}

impl ForwardModel for BetterDipoleModel {
    fn name(&self) -> &'static str {
        "better-dipole"
    }

    fn eta(&self) -> f64 {
        self.eta
    }

    fn diffuse_reflectance_gradient(
        &self,
        coefficients: Coefficients,
        radius: &[f64],
        out: &mut [Gradient],
    ) {
        let dipole = self.at(coefficients);
        for (out, &r) in out.iter_mut().zip(radius) {
            *out = dipole.reflectance(r);
        }
    }

    fn within(&self, coefficients: Coefficients, radius: f64) -> Gradient {
        self.at(coefficients).within(radius, &self.rule)
    }

    fn beyond(&self, coefficients: Coefficients, radius: f64) -> f64 {
        self.at(coefficients).beyond(radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dipole::tests::argument;
    use crate::image_sources::tests::{
        MEDIA, check_against_integrals, check_gradients, check_integrals,
    };

    #[test]
    fn agrees_with_an_independent_integration() {
        check_against_integrals("better-dipole", 1e-9, |arguments| {
            BetterDipoleModel::new(argument(arguments, "eta"))
        });
    }

    #[test]
    fn gradients_are_central_differences() {
        for eta in [1.0, 1.3, 1.5] {
            let model = BetterDipoleModel::new(eta);
            check_gradients(&model, &[0.01, 0.3, 1.0, 4.0, 20.0], 3e-7);
        }
    }

    #[test]
    fn the_total_is_the_integral() {
        for eta in [1.0, 1.5] {
            check_integrals(&BetterDipoleModel::new(eta), 1e-10);
        }
    }

    /// The total in the albedo alone, as Hery, *Texture Mapping for the Better Dipole Model*
    /// (2013), writes it: 2C₁ and 3C₂ are moments of Fresnel's formula.
    #[test]
    fn the_total_is_the_printed_closed_form() {
        for eta in [1.0, 1.3, 1.5] {
            let Exitance { fluence, flux } = Exitance::new(eta);
            let (two_c1, three_c2) = (1.0 - 4.0 * fluence, 1.0 - 2.0 * flux);
            for c in MEDIA {
                let (w, dark) = (c.albedo_prime(), c.sigma_a / c.sigma_t_prime());
                let tr_d = (dark * (2.0 - w) / 3.0).sqrt();
                let depth = 4.0 * (1.0 + three_c2) / (1.0 - two_c1) * tr_d;
                let expected = 0.5
                    * w
                    * w
                    * (-(3.0 * dark / (2.0 - w)).sqrt()).exp()
                    * (0.5 * (1.0 - three_c2) * (1.0 + (-depth).exp())
                        + 0.25 * (1.0 - two_c1) / tr_d * -(-depth).exp_m1());
                let got = BetterDipoleModel::new(eta).within(c, f64::INFINITY).value;
                assert!(
                    (got / expected - 1.0).abs() < 1e-12,
                    "{eta}, {c:?}: {got} {expected}"
                );
            }
        }
    }
}

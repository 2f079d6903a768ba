//! The dipole of Kienle and Patterson (1997): flux and fluence, each with the weight that the
//! boundary gives it.

use crate::fresnel::Exitance;
use crate::image_sources::{Images, Pair, Rule, WeightedDipole};
use crate::medium::Coefficients;
use crate::model::{ForwardModel, Gradient};

/// The improved diffusion dipole of Kienle and Patterson.
///
/// A point source of strength α′ one transport length below the surface, the fluence zero on a
/// plane 2AD above it, D = 1/(3σₜ′), and as exitance not the flux alone but the light that
/// Fresnel's formula lets out of the radiance (φ + 3Eμ)/4π: 0.118 φ + 0.306 E at η = 1.4, by its
/// integrals at any other η ([`Exitance`]).
///
/// The paper writes a source of strength 1, for σₐ ≪ σₛ′; a share σₐ/σₜ′ of the first collisions
/// absorbs, so that the strength is α′ here as in Farrell et al. (1992), whose dipole this
/// improves. Without absorption all light comes back: the total is then 1 at any η.
///
/// Trust it where α′ is above 0.9 and `radius` above one transport length 1/σₜ′.
///
/// # Source
///
/// Kienle and Patterson, *Improved solutions of the steady-state and the time-resolved diffusion
/// equations for reflectance from a semi-infinite turbid medium*, J. Opt. Soc. Am. A 14, 246
/// (1997), the extrapolated boundary condition.
///
/// ```
/// use physics::{Coefficients, ForwardModel, KienlePattersonModel};
///
/// let marble = Coefficients { sigma_a: 0.0041, sigma_s_prime: 2.62 };
/// let total = KienlePattersonModel::new(1.5).within(marble, f64::INFINITY).value;
/// assert!((total - 0.795_638).abs() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KienlePattersonModel {
    eta: f64,
    exitance: Exitance,
    rule: Rule,
}

impl KienlePattersonModel {
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
        // Height of the image above the surface: z + 4AD with D = z/3.
        let image = depth * -(1.0 + 4.0 / 3.0 * self.exitance.a());
        WeightedDipole {
            images: Images::new(sigma_a, depth * (1.0 / 3.0), self.exitance),
            pair: Pair {
                source: depth,
                image,
            },
            power: sigma_s_prime * depth,
        }
    }
}

impl ForwardModel for KienlePattersonModel {
    fn name(&self) -> &'static str {
        "kienle-patterson"
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
        check_against_integrals("kienle-patterson", 1e-9, |arguments| {
            KienlePattersonModel::new(argument(arguments, "eta"))
        });
    }

    #[test]
    fn gradients_are_central_differences() {
        for eta in [1.0, 1.3, 1.5] {
            let model = KienlePattersonModel::new(eta);
            check_gradients(&model, &[0.01, 0.3, 1.0, 4.0, 20.0], 3e-7);
        }
    }

    #[test]
    fn the_total_is_the_integral() {
        for eta in [1.0, 1.5] {
            check_integrals(&KienlePattersonModel::new(eta), 1e-10);
        }
    }

    /// The paper's own symbols with its own numbers for η = 1.4.
    #[test]
    fn is_the_printed_formula() {
        let model = KienlePattersonModel::new(1.4);
        for c in MEDIA {
            let t = c.sigma_t_prime();
            let (z0, d, mu) = (1.0 / t, 1.0 / (3.0 * t), (3.0 * c.sigma_a * t).sqrt());
            let zb = 2.0 * d * (1.0 + 0.493) / (1.0 - 0.493);
            for rho in [0.5 / t, 2.0 / t, 10.0 / t] {
                let r1 = z0.hypot(rho);
                let r2 = (z0 + 2.0 * zb).hypot(rho);
                let fluence = ((-mu * r1).exp() / r1 - (-mu * r2).exp() / r2)
                    / (4.0 * std::f64::consts::PI * d);
                let flux = (z0 * (mu + 1.0 / r1) * (-mu * r1).exp() / (r1 * r1)
                    + (z0 + 2.0 * zb) * (mu + 1.0 / r2) * (-mu * r2).exp() / (r2 * r2))
                    / (4.0 * std::f64::consts::PI);
                let expected = c.albedo_prime() * (0.118 * fluence + 0.306 * flux);
                let mut got = [0.0];
                model.diffuse_reflectance(c, &[rho], &mut got);
                // 0.118, 0.306 and 0.493 are printed to three digits.
                assert!(
                    (got[0] / expected - 1.0).abs() < 4e-3,
                    "{c:?}, {rho}: {got:?}"
                );
            }
        }
    }

    #[test]
    fn without_absorption_all_light_comes_back() {
        let clear = Coefficients {
            sigma_a: 0.0,
            sigma_s_prime: 3.0,
        };
        for eta in [0.8, 1.0, 1.33, 1.5, 2.4] {
            let model = KienlePattersonModel::new(eta);
            let total = model.within(clear, f64::INFINITY);
            assert!((total.value - 1.0).abs() < 1e-12, "{eta}: {total:?}");
            assert_eq!(total.in_sigma_a, f64::NEG_INFINITY);
            assert!(total.in_sigma_s_prime.abs() < 1e-12, "{eta}: {total:?}");
            let mut near = [Gradient::default()];
            model.diffuse_reflectance_gradient(clear, &[2.0], &mut near);
            let step = 1e-9;
            let mut after = [0.0];
            let grey = Coefficients {
                sigma_a: step,
                ..clear
            };
            model.diffuse_reflectance(grey, &[2.0], &mut after);
            let slope = (after[0] - near[0].value) / step;
            assert!(
                (near[0].in_sigma_a / slope - 1.0).abs() < 1e-3,
                "{eta}: {near:?} {slope}"
            );
        }
    }
}

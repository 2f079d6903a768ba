//! Photon beam diffusion: sources along the whole refracted beam, and single scattering as such.

use crate::better_dipole::grosjean_diffusion;
use crate::fresnel::{self, Exitance};
use crate::image_sources::{Images, Pair, Parts, Rule, unit_rule};
use crate::medium::Coefficients;
use crate::model::{ForwardModel, Gradient, Trust};
use crate::phase::{HenyeyGreenstein, PhaseFunction};
use std::f64::consts::PI;

/// Beyond so many mean free paths along the beam 2e-16 of the light is left.
const PATHS: f64 = 36.0;
/// Nodes of the directions into which single scattering leaves.
const DIRECTIONS: usize = 40;
/// ln of the largest cot(θ/2) there; steeper light is 1e-8 of it.
const STEEPEST: f64 = 18.0;

/// Photon beam diffusion with exact single scattering, at normal incidence.
///
/// The multiple scattering is that of [`crate::BetterDipoleModel`], with its source spread along
/// the beam as α′σₜ′e^(−σₜ′t) instead of put at 1/σₜ′, and each source faded out near the beam by
/// the paper's empirical factor κ = 1 − e^(−2σₜ′(d + t)), d the distance from source to point.
/// Single scattering is the integral along the beam with Fresnel's formula at the exit, of the
/// medium with σₛ = σₛ′/(1 − g) and Henyey and Greenstein's phase function; g = 0 leaves it to the
/// similarity relation.
///
/// The two parts do not balance: κ takes away less than single scattering brings. With g = 0 and
/// no absorption the total is 1.023 at η = 1.5, 1.035 at 1.3 and 1.093 at a matched boundary; with
/// g = 0.8 it is 0.973, 0.965 and 0.953.
///
/// Trust it where α′ is above 0.5 and `radius` above half a transport length 1/σₜ′.
///
/// # Source
///
/// Habel, Christensen and Jarosz, *Photon Beam Diffusion: A Hybrid Monte Carlo Method for
/// Subsurface Scattering* (2013), sections 4 (beam, κ) and 5 (single scattering); the BSSRDF that
/// pbrt tabulates (Pharr, Jakob and Humphreys 2016, section 15.5) is the same.
///
/// ```
/// use physics::{Coefficients, ForwardModel, PhotonBeamDiffusionModel};
///
/// let medium = Coefficients { sigma_a: 0.2, sigma_s_prime: 1.0 };
/// let total = PhotonBeamDiffusionModel::new(1.5, 0.0).within(medium, f64::INFINITY).value;
/// assert!((total - 0.16561).abs() < 1e-5);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PhotonBeamDiffusionModel {
    eta: f64,
    g: f64,
    exitance: Exitance,
    rule: Rule,
    /// cot(θ/2) and weight of the directions of single scattering.
    directions: Vec<(f64, f64)>,
    /// Rules on [0, 1] for the beam, shortest first.
    beam: [Vec<(f64, f64)>; 4],
}

impl PhotonBeamDiffusionModel {
    /// The model at relative index `eta`, its single scattering with mean cosine `g` in (-1, 1).
    pub fn new(eta: f64, g: f64) -> Self {
        let phase = HenyeyGreenstein { g };
        // Toward the normal θ has the coordinate w = −ln tan(θ/2): cos θ = tanh w, dθ = −dw/cosh w.
        // Light leaves from the critical angle on, with a root in w there that y² = w − w_c takes.
        let sin = if eta > 1.0 { 1.0 / eta } else { 1.0 };
        let critical = ((1.0 + ((1.0 - sin) * (1.0 + sin)).sqrt()) / sin).ln();
        let end = (STEEPEST - critical).sqrt();
        let directions = unit_rule(DIRECTIONS)
            .into_iter()
            .map(|(x, weight)| {
                let y = end * x;
                let w = critical + y * y;
                let cos = w.tanh();
                let out = 1.0 - fresnel::reflectance(1.0 / eta, cos);
                let density = phase.density(-cos) * out * cos / w.cosh();
                (w.exp(), 2.0 * y * end * weight * density)
            })
            .collect();
        Self {
            eta,
            g,
            exitance: Exitance::new(eta),
            rule: Rule::new(),
            directions,
            beam: [16, 20, 28, 36].map(unit_rule),
        }
    }

    /// Mean cosine of single scattering.
    pub fn g(&self) -> f64 {
        self.g
    }

    fn at(&self, coefficients: Coefficients) -> Beam<'_> {
        let (sigma_a, sigma_s_prime) = Gradient::of(coefficients);
        let sigma_t_prime = sigma_a + sigma_s_prime;
        let diffusion = grosjean_diffusion(sigma_a, sigma_s_prime);
        let albedo = sigma_s_prime / sigma_t_prime;
        let sigma_s = sigma_s_prime * (1.0 / (1.0 - self.g));
        Beam {
            model: self,
            images: Images::new(sigma_a, diffusion, self.exitance),
            gap: diffusion * (-4.0 * self.exitance.a()),
            sigma_t_prime,
            power: albedo * albedo * sigma_t_prime,
            sigma_s,
            sigma_t: sigma_a + sigma_s,
        }
    }
}

/// The model of one medium.
struct Beam<'a> {
    model: &'a PhotonBeamDiffusionModel,
    images: Images,
    /// Height of an image above the surface less the depth of its source, −4AD.
    gap: Gradient,
    sigma_t_prime: Gradient,
    /// α′²σₜ′: sources per length of the beam.
    power: Gradient,
    sigma_s: Gradient,
    sigma_t: Gradient,
}

/// A sum along the beam.
#[derive(Default)]
struct Sum {
    parts: Parts,
    /// Through σₜ′ in the weights.
    in_sigma_t_prime: f64,
}

impl Sum {
    fn add(&mut self, weight: f64, in_sigma_t_prime: f64, parts: &Parts) {
        self.parts.add(weight, parts);
        self.in_sigma_t_prime += in_sigma_t_prime * parts.value;
    }
}

impl Beam<'_> {
    fn image(&self, depth: f64) -> f64 {
        self.gap.value - depth
    }

    /// Depths and weights for sources seen from `scale` mm away: t = scale·sinh u.
    fn depths(&self, scale: f64) -> impl Iterator<Item = (f64, f64)> {
        let end = (PATHS / (self.sigma_t_prime.value * scale)).asinh();
        let rule = &self.model.beam[match end {
            x if x < 2.5 => 0,
            x if x < 4.5 => 1,
            x if x < 7.0 => 2,
            _ => 3,
        }];
        rule.iter().map(move |&(x, w)| {
            let up = (end * x).exp();
            let down = 1.0 / up;
            (
                0.5 * scale * (up - down),
                0.5 * scale * (up + down) * end * w,
            )
        })
    }

    fn gradient(&self, sum: &Sum) -> Gradient {
        // The sources stay where they are while the coefficients change, the images do not.
        let pair = Pair {
            source: Gradient::constant(0.0),
            image: self.gap,
        };
        let parts = self.images.gradient(&sum.parts, &pair);
        self.power * (parts + self.sigma_t_prime.map(0.0, sum.in_sigma_t_prime))
    }

    fn reflectance(&self, radius: f64) -> Gradient {
        let t = self.sigma_t_prime.value;
        let mut sum = Sum::default();
        // On the axis itself R_d is infinite.
        let radius = radius.max(1e-9 / t);
        for (depth, weight) in self.depths(radius) {
            let parts = self.images.parts(depth, self.image(depth), radius);
            let way = (radius * radius + depth * depth).sqrt() + depth;
            let left = (-t * depth).exp();
            let faded = (-2.0 * t * way).exp();
            let kept = weight * left * (1.0 - faded);
            let slope = weight * left * 2.0 * way * faded - depth * kept;
            sum.add(kept, slope, &parts);
        }
        self.gradient(&sum) + self.single(radius)
    }

    /// Single scattering: (σₛ/r)∫ p (1 − F) cos θ e^(−σₜ r cot(θ/2)) dθ, mm⁻².
    ///
    /// With t = r cot θ the depth of the event, its way out is r/sin θ and dt = −r dθ/sin²θ.
    fn single(&self, radius: f64) -> Gradient {
        let depth = self.sigma_t.value * radius;
        let (mut value, mut slope) = (0.0, 0.0);
        for &(cot, weight) in &self.model.directions {
            let term = weight * (-depth * cot).exp();
            value += term;
            slope -= cot * term;
        }
        self.sigma_s * self.sigma_t.map(value / radius, slope)
    }

    /// Single scattering that leaves within `radius` mm, or beyond it.
    fn single_share(&self, radius: f64, beyond: bool) -> Gradient {
        let t = self.sigma_t.value;
        let (mut value, mut slope) = (0.0, 0.0);
        for &(cot, weight) in &self.model.directions {
            let term = weight / cot;
            let (share, per_depth) = if radius.is_infinite() {
                (1.0, 0.0)
            } else {
                let left = (-t * radius * cot).exp();
                (1.0 - left, radius * cot * left)
            };
            value += term * if beyond { 1.0 - share } else { share };
            slope += term * if beyond { -per_depth } else { per_depth };
        }
        let two_pi_albedo = self.sigma_s / self.sigma_t * (2.0 * PI);
        two_pi_albedo * self.sigma_t.map(value, slope)
    }

    /// What κ takes from the light that leaves within `radius` mm.
    ///
    /// In polar coordinates about the point of entry, d = s, t = s cos ψ and r = s sin ψ, where
    /// the near source is smooth.
    fn faded_within(&self, radius: f64) -> Sum {
        let t = self.sigma_t_prime.value;
        let mut sum = Sum::default();
        // Where e^(−3σₜ′t − 2σₜ′d) has died before the circle is reached.
        let reach = t * radius;
        let split = if reach < PATHS / 2.0 {
            (3.0 * reach).atan2(PATHS) + (2.0 * reach / PATHS.hypot(3.0 * reach)).asin()
        } else {
            0.5 * PI
        };
        let rule = &self.model.beam[2];
        for (low, high) in [(0.0, split), (split, 0.5 * PI)] {
            if low >= high {
                continue;
            }
            for &(x, w) in &self.model.beam[0] {
                let (sin, cos) = (low + (high - low) * x).sin_cos();
                let rate = t * (2.0 + 3.0 * cos);
                let end = (PATHS / rate).min(radius / sin);
                for &(y, v) in rule {
                    let s = end * y;
                    let parts = self.images.parts(s * cos, self.image(s * cos), s * sin);
                    let area = 2.0 * PI * s * s * sin * w * (high - low) * v * end;
                    let weight = area * (-rate * s).exp();
                    sum.add(weight, -weight * rate * s / t, &parts);
                }
            }
        }
        sum
    }

    fn within(&self, radius: f64) -> Gradient {
        if radius <= 0.0 {
            return Gradient::default();
        }
        let t = self.sigma_t_prime.value;
        let mut sum = self.faded_within(radius);
        sum.parts.negate();
        sum.in_sigma_t_prime *= -1.0;
        for (depth, weight) in self.depths(radius.min(1.0 / t)) {
            let kept = weight * (-t * depth).exp();
            let parts =
                self.images
                    .parts_within(depth, self.image(depth), radius, &self.model.rule);
            sum.add(kept, -depth * kept, &parts);
        }
        self.gradient(&sum) + self.single_share(radius, false)
    }

    fn beyond(&self, radius: f64) -> f64 {
        let t = self.sigma_t_prime.value;
        let faded = self.faded_within(f64::INFINITY).parts.value
            - if radius > 0.0 {
                self.faded_within(radius).parts.value
            } else {
                0.0
            };
        let whole: f64 = self
            .depths((1.0 / t).min(radius.max(1e-3 / t)))
            .map(|(depth, weight)| {
                let pair = Pair {
                    source: Gradient::constant(depth),
                    image: Gradient::constant(self.image(depth)),
                };
                weight * (-t * depth).exp() * self.images.pair_beyond(&pair, radius)
            })
            .sum();
        self.power.value * (whole - faded) + self.single_share(radius, true).value
    }
}

impl ForwardModel for PhotonBeamDiffusionModel {
    fn name(&self) -> &'static str {
        "photon-beam-diffusion"
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
        let beam = self.at(coefficients);
        for (out, &r) in out.iter_mut().zip(radius) {
            *out = beam.reflectance(r);
        }
    }

    fn within(&self, coefficients: Coefficients, radius: f64) -> Gradient {
        self.at(coefficients).within(radius)
    }

    fn beyond(&self, coefficients: Coefficients, radius: f64) -> f64 {
        self.at(coefficients).beyond(radius)
    }

    fn trust(&self) -> Trust {
        Trust {
            least_albedo_prime: 0.5,
            least_transport_lengths: 0.5,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dipole::tests::argument;
    use crate::image_sources::tests::{
        MEDIA, check_against_integrals, check_gradients, check_integrals,
    };
    use gauss_quad::GaussLegendre;
    use std::num::NonZeroUsize;

    #[test]
    fn agrees_with_an_independent_integration() {
        check_against_integrals("photon-beam-diffusion", 1e-6, |arguments| {
            PhotonBeamDiffusionModel::new(argument(arguments, "eta"), argument(arguments, "g"))
        });
    }

    #[test]
    fn gradients_are_central_differences() {
        for (eta, g) in [(1.0, 0.0), (1.3, 0.8), (1.5, 0.0)] {
            let model = PhotonBeamDiffusionModel::new(eta, g);
            check_gradients(&model, &[0.03, 0.3, 1.0, 4.0, 12.0], 2e-6);
        }
    }

    #[test]
    fn the_total_is_the_integral() {
        for (eta, g) in [(1.0, 0.0), (1.5, 0.8)] {
            check_integrals(&PhotonBeamDiffusionModel::new(eta, g), 1e-6);
        }
    }

    /// First order by the escape of a beam from a half-space, ∫ 2π α p (1 − F) μ/(1 + μ) dμ.
    #[test]
    fn single_scattering_alone_has_its_own_total() {
        for (eta, g) in [(1.0, 0.0), (1.3, 0.8), (1.5, -0.4)] {
            let model = PhotonBeamDiffusionModel::new(eta, g);
            let phase = HenyeyGreenstein { g };
            let critical = (1.0_f64 - 1.0 / (eta * eta)).sqrt();
            let rule = GaussLegendre::new(NonZeroUsize::new(60).unwrap());
            let expected = rule.integrate(0.0, (1.0 - critical).sqrt(), |y: f64| {
                let mu = critical + y * y;
                let out = 1.0 - fresnel::reflectance(1.0 / eta, mu);
                4.0 * PI * y * phase.density(-mu) * out * mu / (1.0 + mu)
            });
            for c in MEDIA {
                let beam = model.at(c);
                let albedo = beam.sigma_s.value / beam.sigma_t.value;
                let got = beam.single_share(f64::INFINITY, false).value;
                assert!(
                    (got / (albedo * expected) - 1.0).abs() < 1e-7,
                    "{eta} {g} {c:?}: {got} for {}",
                    albedo * expected
                );
            }
        }
    }
}

//! The multipole: diffuse reflectance and transmittance of a slab of known thickness.

use crate::fresnel::DiffuseFresnel;
use crate::image_sources::{Images, Pair, Rule, unit_rule};
use crate::medium::Coefficients;
use crate::model::{ForwardModel, Gradient};
use std::f64::consts::PI;

/// Images on either side of the slab before their sum goes on as an integral.
const IMAGES: u32 = 20;
/// Below this share of the distance between the extrapolated planes light is summed over images,
/// above it over waves across the slab.
const NEAR: f64 = 0.6;
/// e^-40 is nothing beside 1.
const NOTHING: f64 = 40.0;
/// Steps of the integral for K₀ and K₁, and their number.
const BESSEL_STEP: f64 = 0.25;
const BESSEL_STEPS: usize = 18;

/// A slab: how thick, and what lies below it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slab {
    /// Thickness, mm.
    pub thickness_mm: f64,
    /// Index of the slab over that of what lies below; 1 for a matched lower boundary.
    pub eta_below: f64,
}

/// The multipole of Donner and Jensen: the dipole mirrored to and fro between the two faces.
///
/// A source of strength α′ one transport length below the surface, the fluence zero on planes 2AD
/// above the upper and 2A_below D below the lower face. Light below the lower face is lost. A thick
/// slab is the dipole, to the last digit.
///
/// Trust it like the dipole, in slabs of at least two transport lengths 1/σₜ′: below that light
/// passes that has hardly scattered, and at one the source leaves the slab altogether (the formula
/// goes on, and reflects too little). A thickness has a scale: a slab twice as dense does not look
/// the same at half the distance.
///
/// # Source
///
/// Donner and Jensen, *Light Diffusion in Multi-Layered Translucent Materials* (2005), section 4,
/// for one layer; Contini, Martelli and Zaccanti (1997). The sum over images converges slowly
/// where `radius` exceeds the thickness; there the same solution is summed over waves across the
/// slab, Σ (nπ/L) cos(nπ z_b/L) sin(nπ(ℓ + z_b)/L) K₀(γₙr)/(πL), γₙ² = σₜᵣ² + (nπ/L)².
///
/// ```
/// use physics::{Coefficients, ForwardModel, MultipoleModel, Slab};
///
/// let medium = Coefficients { sigma_a: 0.0, sigma_s_prime: 1.37 };
/// let slab = Slab { thickness_mm: 3.0, eta_below: 1.43 };
/// let model = MultipoleModel::new(1.43, slab);
/// let reflected = model.within(medium, f64::INFINITY).value;
/// assert!((reflected + model.total_transmittance(medium).value - 1.0).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MultipoleModel {
    eta: f64,
    slab: Slab,
    a: f64,
    a_below: f64,
    rule: Rule,
    /// Rule on [0, 1] for the light of the images within a circle.
    ring: Vec<(f64, f64)>,
    /// cosh t − 1 at the steps of the integral for K₀ and K₁.
    excess: [f64; BESSEL_STEPS],
}

impl MultipoleModel {
    /// The slab `slab` at relative index `eta`, F_dr by its integral.
    pub fn new(eta: f64, slab: Slab) -> Self {
        let mut excess = [0.0; BESSEL_STEPS];
        for (step, excess) in excess.iter_mut().enumerate() {
            // cosh t − 1 = 2 sinh²(t/2).
            *excess = 2.0 * (0.5 * BESSEL_STEP * step as f64).sinh().powi(2);
        }
        Self {
            eta,
            slab,
            a: DiffuseFresnel::Exact.a(eta),
            a_below: DiffuseFresnel::Exact.a(slab.eta_below),
            rule: Rule::new(),
            ring: unit_rule(16),
            excess,
        }
    }

    /// The slab.
    pub fn slab(&self) -> Slab {
        self.slab
    }

    /// Diffuse transmittance at `radius` mm from the axis of the beam, on the lower face, mm⁻².
    pub fn transmittance(&self, coefficients: Coefficients, radius: f64) -> Gradient {
        self.face(coefficients, true).exitance(radius)
    }

    /// Diffuse light that leaves through the lower face, per power that enters.
    pub fn total_transmittance(&self, coefficients: Coefficients) -> Gradient {
        self.face(coefficients, true).total()
    }

    fn face(&self, coefficients: Coefficients, lower: bool) -> Face<'_> {
        let (sigma_a, sigma_s_prime) = Gradient::of(coefficients);
        let path = Gradient::constant(1.0) / (sigma_a + sigma_s_prime);
        let thickness = Gradient::constant(self.slab.thickness_mm);
        let (above, below) = (
            path * (2.0 / 3.0 * self.a),
            path * (2.0 / 3.0 * self.a_below),
        );
        let (gap, source) = if lower {
            (below, thickness - path)
        } else {
            (above, path)
        };
        let diffusion = path * (1.0 / 3.0);
        Face {
            model: self,
            images: Images::flux(sigma_a, diffusion),
            decays: Images::decay(sigma_a, diffusion),
            source,
            gap,
            between: above + thickness + below,
            power: sigma_s_prime * path,
        }
    }
}

/// One face of a slab of one medium, as light that leaves through it sees the rest.
struct Face<'a> {
    model: &'a MultipoleModel,
    images: Images,
    /// e^(−σₜᵣ d)/d in place of a source's exitance: its integral over the height.
    decays: Images,
    /// Distance of the source from this face.
    source: Gradient,
    /// Distance from this face to its extrapolated plane.
    gap: Gradient,
    /// L, from one extrapolated plane to the other.
    between: Gradient,
    power: Gradient,
}

impl Face<'_> {
    fn exitance(&self, radius: f64) -> Gradient {
        let sum = if radius < NEAR * self.between.value {
            self.images.pair(&self.nearest(), radius) + self.images_beyond(radius)
        } else {
            self.waves(radius, |gamma, [k0, k1]| gamma.map(k0, -radius * k1))
        };
        self.power * sum
    }

    /// The source and its image in the extrapolated plane of this face: the dipole.
    fn nearest(&self) -> Pair {
        Pair {
            source: self.source,
            image: (self.source + self.gap * 2.0) * -1.0,
        }
    }

    /// Exitance of all pairs but the nearest.
    fn images_beyond(&self, radius: f64) -> Gradient {
        let near = self.nearest();
        let period = self.between * 2.0;
        let mut sum = Gradient::default();
        for i in 1..=IMAGES {
            let shift = period * f64::from(i);
            if self.images.sigma_tr() * (shift.value + near.image.value) > NOTHING {
                return sum;
            }
            for shift in [shift, shift * -1.0] {
                let pair = Pair {
                    source: near.source + shift,
                    image: near.image + shift,
                };
                sum = sum + self.images.pair(&pair, radius);
            }
        }
        // Euler and Maclaurin: the sum from here is the integral from half a period before, and
        // h(1 + σₜᵣ d)e^(−σₜᵣ d)/d³ is the slope of −e^(−σₜᵣ d)/d in h.
        let edge = period * (f64::from(IMAGES) + 0.5);
        let above = Pair {
            source: edge + near.source,
            image: edge + near.image,
        };
        let below = Pair {
            source: edge - near.image,
            image: edge - near.source,
        };
        let rest = self.decays.pair(&above, radius) + self.decays.pair(&below, radius);
        sum + rest / period
    }

    /// Σ over waves across the slab of weight × `of`(γₙ, [K₀, K₁](γₙ `radius`)).
    fn waves(&self, radius: f64, of: impl Fn(Gradient, [f64; 2]) -> Gradient) -> Gradient {
        let wave = Gradient::constant(PI) / self.between;
        let square = self.images.sigma_tr_square();
        let mut sum = Gradient::default();
        let mut first = None;
        for n in 1..200 {
            let nu = wave * f64::from(n);
            let squared = square + nu * nu;
            let root = squared.value.sqrt();
            let gamma = squared.map(root, 0.5 / root);
            let exponent = root * radius;
            if exponent - *first.get_or_insert(exponent) > NOTHING || exponent > 700.0 {
                break;
            }
            let (out, into) = (nu * self.gap, nu * (self.source + self.gap));
            let (sin_out, cos_out) = out.value.sin_cos();
            let (sin_into, cos_into) = into.value.sin_cos();
            let weight = nu * out.map(cos_out, -sin_out) * into.map(sin_into, cos_into);
            sum = sum + weight * of(gamma, self.bessel(exponent));
        }
        sum / (self.between * PI)
    }

    /// K₀ and K₁ at `x`: ∫ e^(−x cosh t) (1, cosh t) dt by the trapezoidal rule, which has 15
    /// digits for x from 1 on.
    fn bessel(&self, x: f64) -> [f64; 2] {
        let (mut k0, mut k1) = (0.5, 0.5);
        for excess in &self.model.excess[1..] {
            let term = (-x * excess).exp();
            if term < 1e-17 {
                break;
            }
            k0 += term;
            k1 += term * (1.0 + excess);
        }
        let scale = BESSEL_STEP * (-x).exp();
        [scale * k0, scale * k1]
    }

    /// cosh(σₜᵣ z_b) sinh(σₜᵣ(L − z_b − s))/sinh(σₜᵣ L), with the strength of the source.
    fn total(&self) -> Gradient {
        let k = self.images.sigma_tr();
        let far = self.between - self.gap - self.source;
        let (gap, between) = (self.gap.value, self.between.value);
        let depth = far.value.abs();
        // (1 − e^(−2σₜᵣ x))/σₜᵣ, x coth x and tanh x/x in the form that 0 needs.
        let less = |x: f64| {
            if k * x > 1e-5 {
                -(-2.0 * k * x).exp_m1() / k
            } else {
                2.0 * x * (1.0 - k * x)
            }
        };
        let coth = |x: f64| {
            let y = k * x;
            if y.abs() < 0.05 {
                let y2 = y * y;
                x * x * (1.0 / 3.0 - y2 * (1.0 / 45.0 - y2 * (2.0 / 945.0 - y2 / 4725.0)))
            } else {
                (y / y.tanh() - 1.0) / (k * k)
            }
        };
        let tanh = |x: f64| {
            let y = k * x;
            if y < 1e-4 {
                x * x
            } else {
                x * x * y.tanh() / y
            }
        };
        let scale = 0.5 * (1.0 + (-2.0 * k * gap).exp()) / less(between)
            * (k * (depth + gap - between)).exp();
        let value = scale * less(depth) * far.value.signum();
        let in_far = scale * (1.0 + (-2.0 * k * depth).exp());
        let in_gap = value * k * (k * gap).tanh();
        let in_between = -value * (1.0 + k * k * coth(between)) / between;
        let in_half_square = value * (coth(far.value) - coth(between) + tanh(gap));
        self.power
            * (self.images.half_square().map(value, in_half_square)
                + far.map(0.0, in_far)
                + self.gap.map(0.0, in_gap)
                + self.between.map(0.0, in_between))
    }

    fn within(&self, radius: f64) -> Gradient {
        if radius <= 0.0 {
            return Gradient::default();
        }
        if radius >= NEAR * self.between.value {
            return self.total() - self.far_out(radius);
        }
        // The images are smooth over the thickness.
        let mut sum = self
            .images
            .pair_within(&self.nearest(), radius, &self.model.rule);
        for &(x, w) in &self.model.ring {
            let r = radius * x;
            sum = sum + self.images_beyond(r) * (2.0 * PI * r * radius * w);
        }
        self.power * sum
    }

    /// The light beyond a circle of `radius` mm, large enough for the sum over waves.
    fn far_out(&self, radius: f64) -> Gradient {
        if radius.is_infinite() {
            return Gradient::default();
        }
        self.power
            * self.waves(radius, |gamma, [k0, k1]| {
                // ∫ K₀(γr) 2πr dr = 2πR K₁(γR)/γ.
                let g = gamma.value;
                let slope = -radius * k0 / g - 2.0 * k1 / (g * g);
                gamma.map(k1 / g, slope) * (2.0 * PI * radius)
            })
    }
}

impl ForwardModel for MultipoleModel {
    fn name(&self) -> &'static str {
        "multipole"
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
        let face = self.face(coefficients, false);
        for (out, &r) in out.iter_mut().zip(radius) {
            *out = face.exitance(r);
        }
    }

    fn within(&self, coefficients: Coefficients, radius: f64) -> Gradient {
        self.face(coefficients, false).within(radius)
    }

    fn beyond(&self, coefficients: Coefficients, radius: f64) -> f64 {
        let face = self.face(coefficients, false);
        if radius >= NEAR * face.between.value {
            face.far_out(radius).value
        } else {
            face.total().value - face.within(radius).value
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dipole::DipoleModel;
    use crate::dipole::tests::argument;
    use crate::image_sources::tests::{
        MEDIA, check_against_integrals, check_gradient, check_gradients, check_integrals,
        integrated, medium,
    };

    const SLABS: [(f64, Slab); 3] = [
        (
            1.4,
            Slab {
                thickness_mm: 3.0,
                eta_below: 1.4,
            },
        ),
        (
            1.5,
            Slab {
                thickness_mm: 0.8,
                eta_below: 1.0,
            },
        ),
        (
            1.0,
            Slab {
                thickness_mm: 12.0,
                eta_below: 1.0,
            },
        ),
    ];

    /// The slab solved by spatial frequency, with neither images nor waves across it.
    #[test]
    fn agrees_with_an_independent_integration() {
        let model = |arguments: &str| {
            let slab = Slab {
                thickness_mm: argument(arguments, "thickness"),
                eta_below: argument(arguments, "eta_below"),
            };
            MultipoleModel::new(argument(arguments, "eta"), slab)
        };
        check_against_integrals("multipole", 3e-7, model);
        for (arguments, expected) in integrated("multipole_below") {
            let at = argument(&arguments, "r");
            let got = model(&arguments)
                .transmittance(medium(&arguments), at)
                .value;
            assert!(
                (got / expected - 1.0).abs() < 3e-7,
                "{arguments}: {got} {expected}"
            );
        }
        for (arguments, expected) in integrated("multipole_reflected") {
            let got = model(&arguments)
                .within(medium(&arguments), f64::INFINITY)
                .value;
            assert!(
                (got / expected - 1.0).abs() < 1e-11,
                "{arguments}: {got} {expected}"
            );
        }
        for (arguments, expected) in integrated("multipole_transmitted") {
            let got = model(&arguments)
                .total_transmittance(medium(&arguments))
                .value;
            assert!(
                (got / expected - 1.0).abs() < 1e-11,
                "{arguments}: {got} {expected}"
            );
        }
    }

    #[test]
    fn gradients_are_central_differences() {
        for (eta, slab) in SLABS {
            let model = MultipoleModel::new(eta, slab);
            check_gradients(&model, &[0.03, 0.3, 1.0, 3.0, 9.0], 1e-6);
            for c in MEDIA {
                let label = format!("below, {eta}, {slab:?}, {c:?}");
                check_gradient(c, 1e-6, &label, |c| model.transmittance(c, 1.3));
                check_gradient(c, 1e-6, &label, |c| model.total_transmittance(c));
            }
        }
    }

    #[test]
    fn the_total_is_the_integral() {
        for (eta, slab) in SLABS {
            check_integrals(&MultipoleModel::new(eta, slab), 1e-7);
        }
    }

    #[test]
    fn a_thick_slab_is_the_dipole() {
        for c in MEDIA {
            let slab = Slab {
                thickness_mm: 60.0 / c.sigma_tr(),
                eta_below: 1.3,
            };
            let (model, dipole) = (
                MultipoleModel::new(1.5, slab),
                DipoleModel::new(1.5, DiffuseFresnel::Exact),
            );
            for radius in [0.1, 1.0, 10.0].map(|paths| paths / c.sigma_t_prime()) {
                let (mut slab, mut half_space) = ([0.0], [0.0]);
                model.diffuse_reflectance(c, &[radius], &mut slab);
                dipole.diffuse_reflectance(c, &[radius], &mut half_space);
                assert!(
                    (slab[0] / half_space[0] - 1.0).abs() < 1e-13,
                    "{c:?} {radius}: {slab:?} for {half_space:?}"
                );
                let (inside, expected) = (model.within(c, radius), dipole.within(c, radius));
                assert!(
                    (inside.value / expected.value - 1.0).abs() < 1e-12,
                    "{c:?} {radius}: {inside:?} for {expected:?}"
                );
            }
        }
    }

    /// Images and waves are two sums of one solution.
    #[test]
    fn the_two_sums_meet() {
        for (eta, slab) in SLABS {
            let model = MultipoleModel::new(eta, slab);
            for c in MEDIA {
                let face = model.face(c, false);
                let at = NEAR * face.between.value;
                let (near, far) = (face.exitance(at * (1.0 - 1e-12)), face.exitance(at));
                let scale = face.exitance(0.1 * at).value.abs();
                assert!(
                    (near.value - far.value).abs() < 1e-8 * scale,
                    "{eta} {slab:?} {c:?}: {near:?} {far:?}"
                );
            }
        }
    }

    #[test]
    fn without_absorption_all_light_leaves() {
        let clear = Coefficients {
            sigma_a: 0.0,
            sigma_s_prime: 3.0,
        };
        for (eta, slab) in SLABS {
            let model = MultipoleModel::new(eta, slab);
            let up = model.within(clear, f64::INFINITY);
            let sum = up + model.total_transmittance(clear);
            assert!((sum.value - 1.0).abs() < 1e-13, "{sum:?}");
            assert!(
                sum.in_sigma_a.is_finite() && sum.in_sigma_a < 0.0,
                "{sum:?}"
            );
            let mut at = [Gradient::default(); 2];
            model.diffuse_reflectance_gradient(clear, &[0.5, 20.0], &mut at);
            assert!(at.iter().all(|g| g.in_sigma_a.is_finite()), "{at:?}");
        }
    }
}

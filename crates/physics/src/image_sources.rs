//! Point sources and their images: what every closed form of diffusion past the dipole is made of.

use crate::fresnel::Exitance;
use crate::model::Gradient;
use gauss_quad::GaussLegendre;
use std::f64::consts::PI;
use std::num::NonZeroUsize;

/// Nodes of the one integral that has no stable closed form, see [`Images::pair_within`].
const NODES: usize = 16;

/// The rule of [`Images::pair_within`] on [0, 1], made once for a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rule([(f64, f64); NODES]);

impl Rule {
    pub(crate) fn new() -> Self {
        let rule = GaussLegendre::new(NonZeroUsize::new(NODES).expect("it is not zero"));
        let mut pairs = [(0.0, 0.0); NODES];
        for (pair, (x, w)) in pairs.iter_mut().zip(rule.as_node_weight_pairs()) {
            *pair = (0.5 * (1.0 + x), 0.5 * w);
        }
        Self(pairs)
    }
}

/// A point source at a height, and its image of the opposite sign at another, in mm along the
/// axis *into* the medium, zero at the surface where the light is counted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair {
    pub(crate) source: Gradient,
    pub(crate) image: Gradient,
}

/// What the sources of one medium share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Images {
    /// σₜᵣ, mm⁻¹.
    sigma_tr: f64,
    /// σₜᵣ²/2, in which everything that leaves is smooth.
    half_square: Gradient,
    /// C_φ/D.
    fluence: Gradient,
    /// C_E.
    flux: f64,
}

impl Images {
    /// Sources in a medium of absorption `sigma_a` and diffusion coefficient `diffusion` (mm),
    /// whose light leaves as `exitance` says.
    pub(crate) fn new(sigma_a: Gradient, diffusion: Gradient, exitance: Exitance) -> Self {
        let square = sigma_a / diffusion;
        Self {
            sigma_tr: square.value.sqrt(),
            half_square: square * 0.5,
            fluence: Gradient::constant(exitance.fluence) / diffusion,
            flux: exitance.flux,
        }
    }

    /// ∫ e^(−σₜᵣ s) ds from `a` to `b`, without its cancellation where σₜᵣ is small.
    fn path(&self, a: f64, b: f64) -> f64 {
        let k = self.sigma_tr;
        let exponent = k * (b - a);
        if exponent.abs() > 1e-3 {
            ((-k * a).exp() - (-k * b).exp()) / k
        } else {
            let near = 1.0 - exponent * (0.5 - exponent * (1.0 / 6.0 - exponent / 24.0));
            (-k * a).exp() * (b - a) * near
        }
    }

    /// Exitance at `radius` mm from the axis of a pair of unit power, mm⁻².
    ///
    /// C_φ φ + C_E E of a source in an unbounded medium, φ = e^(−σₜᵣ d)/(4πD d) and
    /// E = h(1 + σₜᵣ d) e^(−σₜᵣ d)/(4π d³), less that of its image.
    pub(crate) fn pair(&self, pair: &Pair, radius: f64) -> Gradient {
        let k = self.sigma_tr;
        let at = |height: f64| {
            let d = radius.hypot(height);
            let per_d = 1.0 / d;
            let decay = (-k * d).exp() * per_d;
            let decay_2 = decay * per_d * per_d;
            let slope = (1.0 + k * d) * decay_2;
            let steep = (k * k * d * d + 3.0 * k * d + 3.0) * decay_2 * per_d * per_d;
            (d, decay, slope, steep)
        };
        let (h, i) = (pair.source.value, pair.image.value);
        let (d_h, decay_h, slope_h, steep_h) = at(h);
        let (d_i, decay_i, slope_i, steep_i) = at(i);
        let (fluence, flux) = (self.fluence.value, self.flux);
        let difference = decay_h - decay_i;
        // Derivatives in σₜᵣ²/2: each fluence alone has an infinite one where σₜᵣ is 0.
        let in_half_square = -fluence * self.path(d_h, d_i) - flux * (h * decay_h - i * decay_i);
        let in_height =
            |h: f64, slope: f64, steep: f64| -fluence * h * slope + flux * (slope - h * h * steep);
        self.combine(
            fluence * difference + flux * (h * slope_h - i * slope_i),
            difference,
            in_half_square,
            pair,
            in_height(h, slope_h, steep_h),
            -in_height(i, slope_i, steep_i),
            4.0 * PI,
        )
    }

    /// The light of a pair of unit power that leaves within `radius` mm of its axis; all of it
    /// for an infinite `radius`.
    ///
    /// Without absorption the slope in σₐ is finite for a finite `radius`, −∞ for the plane.
    pub(crate) fn pair_within(&self, pair: &Pair, radius: f64, rule: &Rule) -> Gradient {
        let k = self.sigma_tr;
        let (h, i) = (pair.source.value, pair.image.value);
        // Share of a source's flux, its derivatives in σₜᵣ²/2 and height, and its fluence's in
        // height.
        let at = |h: f64| {
            let a = h.abs();
            let near = (-k * a).exp();
            if radius.is_infinite() {
                let rest = if k > 0.0 { near / k } else { f64::INFINITY };
                return (near * h.signum(), -h * rest, -k * near, -near * h.signum());
            }
            let d = radius.hypot(h);
            let per_d = 1.0 / d;
            let far = (-k * d).exp() * per_d;
            let share = h * h * per_d * per_d;
            (
                near * h.signum() - h * far,
                -h * self.path(a, d),
                -k * near - far * (1.0 - share - share * k * d),
                -near * h.signum() + h * far,
            )
        };
        let ((t_h, q_h, s_h, f_h), (t_i, q_i, s_i, f_i)) = (at(h), at(i));
        let (fluence, flux) = (self.fluence.value, self.flux);
        let (near, far) = (h.abs(), i.abs());
        let beyond = if radius.is_infinite() {
            0.0
        } else {
            self.path(radius.hypot(h), radius.hypot(i))
        };
        let difference = self.path(near, far) - beyond;
        // −∫ s (e^(−σₜᵣ s) − e^(−σₜᵣ √(s² + R²)))/σₜᵣ ds between the two depths.
        let slope: f64 = rule
            .0
            .iter()
            .map(|&(x, w)| {
                let s = near + (far - near) * x;
                let path = if radius.is_infinite() {
                    if k > 0.0 {
                        (-k * s).exp() / k
                    } else {
                        f64::INFINITY
                    }
                } else {
                    self.path(s, radius.hypot(s))
                };
                -w * (far - near) * s * path
            })
            .sum();
        self.combine(
            fluence * difference + flux * (t_h - t_i),
            difference,
            fluence * slope + flux * (q_h - q_i),
            pair,
            fluence * f_h + flux * s_h,
            -fluence * f_i - flux * s_i,
            2.0,
        )
    }

    /// The light of a pair of unit power that leaves farther than `radius` mm from its axis.
    pub(crate) fn pair_beyond(&self, pair: &Pair, radius: f64) -> f64 {
        let (h, i) = (pair.source.value, pair.image.value);
        let share = |h: f64| {
            let d = radius.hypot(h);
            h / d * (-self.sigma_tr * d).exp()
        };
        let fluence = self.path(radius.hypot(h), radius.hypot(i));
        0.5 * (self.fluence.value * fluence + self.flux * (share(h) - share(i)))
    }

    /// The chain rule, for a value that depends on C_φ/D (with this `difference` as its slope),
    /// σₜᵣ²/2 and the two heights.
    #[expect(
        clippy::too_many_arguments,
        reason = "one partial derivative each, in the order of the sentence above"
    )]
    fn combine(
        &self,
        value: f64,
        difference: f64,
        in_half_square: f64,
        pair: &Pair,
        in_source: f64,
        in_image: f64,
        divisor: f64,
    ) -> Gradient {
        let parts = self.half_square.map(value, in_half_square)
            + self.fluence.map(0.0, difference)
            + pair.source.map(0.0, in_source)
            + pair.image.map(0.0, in_image);
        parts * (1.0 / divisor)
    }
}

/// One pair of some power: a dipole with the weights of flux and fluence.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeightedDipole {
    pub(crate) images: Images,
    pub(crate) pair: Pair,
    /// Power of the source per power that enters.
    pub(crate) power: Gradient,
}

impl WeightedDipole {
    pub(crate) fn reflectance(&self, radius: f64) -> Gradient {
        self.power * self.images.pair(&self.pair, radius)
    }

    pub(crate) fn within(&self, radius: f64, rule: &Rule) -> Gradient {
        self.power * self.images.pair_within(&self.pair, radius, rule)
    }

    pub(crate) fn beyond(&self, radius: f64) -> f64 {
        self.power.value * self.images.pair_beyond(&self.pair, radius)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::medium::Coefficients;
    use crate::model::ForwardModel;

    /// Coefficients from dark to almost clear.
    pub(crate) const MEDIA: [Coefficients; 5] = [
        Coefficients {
            sigma_a: 0.0041,
            sigma_s_prime: 2.62,
        },
        Coefficients {
            sigma_a: 0.97,
            sigma_s_prime: 0.07,
        },
        Coefficients {
            sigma_a: 1e-6,
            sigma_s_prime: 20.0,
        },
        Coefficients {
            sigma_a: 0.17,
            sigma_s_prime: 0.88,
        },
        Coefficients {
            sigma_a: 1.0,
            sigma_s_prime: 1.0,
        },
    ];

    /// Derivatives of R_d and of the light within a circle, by central differences of fourth
    /// order, for every medium of [`MEDIA`]; `tolerance` is relative.
    pub(crate) fn check_gradients(model: &dyn ForwardModel, radii: &[f64], tolerance: f64) {
        let rd = |c: Coefficients, r: f64| {
            let mut out = [Gradient::default()];
            model.diffuse_reflectance_gradient(c, &[r], &mut out);
            out[0]
        };
        for c in MEDIA {
            for &r in radii {
                let label = format!("{} {} {c:?}, r = {r}", model.name(), model.eta());
                check_gradient(c, tolerance, &label, |c| rd(c, r));
                check_gradient(c, tolerance, &format!("within, {label}"), |c| {
                    // Nearer, rounding of the total is all that the difference has.
                    model.within(c, r.max(0.3))
                });
                let mut value = [0.0];
                model.diffuse_reflectance(c, &[r], &mut value);
                let same = rd(c, r).value;
                assert!((value[0] / same - 1.0).abs() < 1e-13, "{label}");
            }
            let label = format!("total, {} {} {c:?}", model.name(), model.eta());
            check_gradient(c, tolerance, &label, |c| model.within(c, f64::INFINITY));
        }
    }

    pub(crate) fn check_gradient(
        c: Coefficients,
        tolerance: f64,
        label: &str,
        f: impl Fn(Coefficients) -> Gradient,
    ) {
        let at = |sigma_a, sigma_s_prime| {
            f(Coefficients {
                sigma_a,
                sigma_s_prime,
            })
        };
        let Coefficients {
            sigma_a: a,
            sigma_s_prime: s,
        } = c;
        let got = at(a, s);
        let slope = |f: &dyn Fn(f64) -> f64, x: f64| {
            let h = 1e-3 * x;
            (8.0 * (f(x + h) - f(x - h)) - (f(x + 2.0 * h) - f(x - 2.0 * h))) / (12.0 * h)
        };
        let in_a = slope(&|x| at(x, s).value, a);
        let in_s = slope(&|x| at(a, x).value, s);
        for (got, expected, of, name) in [
            (got.in_sigma_a, in_a, a, "sigma_a"),
            (got.in_sigma_s_prime, in_s, s, "sigma_s'"),
        ] {
            // Relative to the derivative, or to the value where the derivative passes zero.
            let scale = expected.abs().max(1e-2 * at(a, s).value.abs() / of);
            assert!(
                (got - expected).abs() < tolerance * scale,
                "{label}, by {name}: {got} for {expected}"
            );
        }
    }

    /// The light between circles is the integral of R_d, and within and beyond make the total.
    pub(crate) fn check_integrals(model: &dyn ForwardModel, tolerance: f64) {
        let rule = GaussLegendre::new(NonZeroUsize::new(30).unwrap());
        for c in MEDIA {
            let label = format!("{} {} {c:?}", model.name(), model.eta());
            let t = c.sigma_t_prime();
            let total = model.within(c, f64::INFINITY).value;
            for (from, to) in [(0.3 / t, 0.7 / t), (0.7 / t, 3.0 / t), (3.0 / t, 9.0 / t)] {
                let ring = rule.integrate(from, to, |r| {
                    let mut out = [0.0];
                    model.diffuse_reflectance(c, &[r], &mut out);
                    2.0 * PI * r * out[0]
                });
                let outside = model.beyond(c, from) - model.beyond(c, to);
                let inside = model.within(c, to).value - model.within(c, from).value;
                for got in [outside, inside] {
                    assert!(
                        (got - ring).abs() < tolerance * ring.abs() + 1e-13 * total,
                        "{label} from {from} to {to}: {got} for {ring}"
                    );
                }
                let sum = model.within(c, to).value + model.beyond(c, to);
                assert!(
                    (sum / total - 1.0).abs() < tolerance,
                    "{label}: {sum} {total}"
                );
            }
            assert!(model.within(c, 0.0).value.abs() < 1e-15, "{label}");
            let whole = model.beyond(c, 0.0);
            assert!((whole / total - 1.0).abs() < tolerance, "{label}: {whole}");
        }
    }
}

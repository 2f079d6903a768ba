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
        let mut pairs = [(0.0, 0.0); NODES];
        pairs.copy_from_slice(&unit_rule(NODES));
        Self(pairs)
    }
}

/// Nodes and weights of a Gauss-Legendre rule on [0, 1].
pub(crate) fn unit_rule(count: usize) -> Vec<(f64, f64)> {
    let count = NonZeroUsize::new(count).expect("no rule here is empty");
    GaussLegendre::new(count)
        .as_node_weight_pairs()
        .iter()
        .map(|(x, w)| (0.5 * (1.0 + x), 0.5 * w))
        .collect()
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
        Self {
            fluence: Gradient::constant(exitance.fluence) / diffusion,
            flux: exitance.flux,
            ..Self::flux(sigma_a, diffusion)
        }
    }

    /// Sources whose flux alone is counted, as the first papers do.
    pub(crate) fn flux(sigma_a: Gradient, diffusion: Gradient) -> Self {
        let square = sigma_a / diffusion;
        Self {
            sigma_tr: square.value.sqrt(),
            half_square: square * 0.5,
            fluence: Gradient::default(),
            flux: 1.0,
        }
    }

    /// e^(−σₜᵣ d)/(4π d) in place of exitance.
    pub(crate) fn decay(sigma_a: Gradient, diffusion: Gradient) -> Self {
        Self {
            fluence: Gradient::constant(1.0),
            flux: 0.0,
            ..Self::flux(sigma_a, diffusion)
        }
    }

    pub(crate) fn sigma_tr(&self) -> f64 {
        self.sigma_tr
    }

    /// σₜᵣ²/2, mm⁻².
    pub(crate) fn half_square(&self) -> Gradient {
        self.half_square
    }

    /// σₜᵣ², mm⁻².
    pub(crate) fn sigma_tr_square(&self) -> Gradient {
        self.half_square * 2.0
    }

    /// ∫ e^(−σₜᵣ s) ds from `a` to `b`, without its cancellation where σₜᵣ is small.
    pub(crate) fn path(&self, a: f64, b: f64) -> f64 {
        let k = self.sigma_tr;
        let exponent = k * (b - a);
        if exponent.abs() > 1e-2 {
            ((-k * a).exp() - (-k * b).exp()) / k
        } else {
            (-k * a).exp() * (b - a) * Self::expm1_over(exponent)
        }
    }

    /// (1 − e^(−x))/x for small x.
    fn expm1_over(x: f64) -> f64 {
        1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x / 720.0))))
    }

    /// Exitance at `radius` mm from the axis of a pair of unit power, mm⁻².
    ///
    /// C_φ φ + C_E E of a source in an unbounded medium, φ = e^(−σₜᵣ d)/(4πD d) and
    /// E = h(1 + σₜᵣ d) e^(−σₜᵣ d)/(4π d³), less that of its image.
    pub(crate) fn pair(&self, pair: &Pair, radius: f64) -> Gradient {
        self.gradient(
            &self.parts(pair.source.value, pair.image.value, radius),
            pair,
        )
    }

    /// [`Self::pair`] of the heights `h` and `i`, before the chain rule.
    pub(crate) fn parts(&self, h: f64, i: f64, radius: f64) -> Parts {
        const PER_SPHERE: f64 = 0.25 / PI;
        let k = self.sigma_tr;
        let at = |height: f64| {
            let d = (radius * radius + height * height).sqrt();
            let per_d = 1.0 / d;
            let decay = PER_SPHERE * (-k * d).exp() * per_d;
            let decay_2 = decay * per_d * per_d;
            let slope = (1.0 + k * d) * decay_2;
            let steep = (k * k * d * d + 3.0 * k * d + 3.0) * decay_2 * per_d * per_d;
            (d, decay, slope, steep)
        };
        let (d_h, decay_h, slope_h, steep_h) = at(h);
        let (d_i, decay_i, slope_i, steep_i) = at(i);
        let (fluence, flux) = (self.fluence.value, self.flux);
        // d_i − d_h, which vanishes far out, and ∫ e^(−σₜᵣ s) ds over it: each fluence alone has
        // an infinite slope in σₜᵣ²/2 where σₜᵣ is 0, the pair has not.
        let longer = (i - h) * (i + h) / (d_i + d_h);
        let path = if (k * longer).abs() > 1e-2 {
            (decay_h * d_h - decay_i * d_i) / k
        } else {
            decay_h * d_h * Self::expm1_over(k * longer) * longer
        };
        let difference = (decay_h * longer + k * path) / d_i;
        let in_height =
            |h: f64, slope: f64, steep: f64| -fluence * h * slope + flux * (slope - h * h * steep);
        Parts {
            value: fluence * difference + flux * (h * slope_h - i * slope_i),
            difference,
            in_half_square: -fluence * path - flux * (h * decay_h - i * decay_i),
            in_source: in_height(h, slope_h, steep_h),
            in_image: -in_height(i, slope_i, steep_i),
        }
    }

    /// The light of a pair of unit power that leaves within `radius` mm of its axis; all of it
    /// for an infinite `radius`.
    ///
    /// Without absorption the slope in σₐ is finite for a finite `radius`, −∞ for the plane.
    pub(crate) fn pair_within(&self, pair: &Pair, radius: f64, rule: &Rule) -> Gradient {
        let parts = self.parts_within(pair.source.value, pair.image.value, radius, rule);
        self.gradient(&parts, pair)
    }

    /// [`Self::pair_within`] of the heights `h` and `i`, before the chain rule.
    pub(crate) fn parts_within(&self, h: f64, i: f64, radius: f64, rule: &Rule) -> Parts {
        let k = self.sigma_tr;
        // ∫ e^(−σₜᵣ s) ds from `from` to infinity.
        let endless = |from: f64| {
            if k > 0.0 {
                (-k * from).exp() / k
            } else {
                f64::INFINITY
            }
        };
        // Share of a source's flux, its derivatives in σₜᵣ²/2 and height, and its fluence's in
        // height.
        let at = |h: f64| {
            let a = h.abs();
            let near = (-k * a).exp();
            if radius.is_infinite() {
                let upward = near * h.signum();
                return (upward, -h * endless(a), -k * near, -upward);
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
        let (fluence, flux) = (0.5 * self.fluence.value, 0.5 * self.flux);
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
                    endless(s)
                } else {
                    self.path(s, radius.hypot(s))
                };
                -w * (far - near) * s * path
            })
            .sum();
        Parts {
            value: fluence * difference + flux * (t_h - t_i),
            difference: 0.5 * difference,
            in_half_square: fluence * slope + flux * (q_h - q_i),
            in_source: fluence * f_h + flux * s_h,
            in_image: -fluence * f_i - flux * s_i,
        }
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

    /// The chain rule.
    pub(crate) fn gradient(&self, parts: &Parts, pair: &Pair) -> Gradient {
        self.half_square.map(parts.value, parts.in_half_square)
            + self.fluence.map(0.0, parts.difference)
            + pair.source.map(0.0, parts.in_source)
            + pair.image.map(0.0, parts.in_image)
    }
}

/// A value that a pair gives, with its derivatives in what the pair depends on.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Parts {
    pub(crate) value: f64,
    /// In C_φ/D.
    difference: f64,
    in_half_square: f64,
    in_source: f64,
    in_image: f64,
}

impl Parts {
    /// Turns the sign.
    pub(crate) fn negate(&mut self) {
        let whole = *self;
        self.add(-2.0, &whole);
    }

    /// Adds `weight` times `other`.
    pub(crate) fn add(&mut self, weight: f64, other: &Self) {
        self.value += weight * other.value;
        self.difference += weight * other.difference;
        self.in_half_square += weight * other.in_half_square;
        self.in_source += weight * other.in_source;
        self.in_image += weight * other.in_image;
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
    use crate::dipole::tests::argument;
    use crate::medium::Coefficients;
    use crate::model::ForwardModel;

    /// `(arguments, value)` of every row of `fixtures/models.csv` for `model`: what an independent
    /// program integrates from the papers' definitions.
    pub(crate) fn integrated(model: &str) -> Vec<(String, f64)> {
        let rows: Vec<(String, f64)> = include_str!("../../../fixtures/models.csv")
            .lines()
            .filter_map(|line| {
                let mut cells = line.split(',');
                (cells.next()? == model).then_some(())?;
                Some((cells.next()?.to_owned(), cells.next()?.parse().ok()?))
            })
            .collect();
        assert!(rows.len() >= 6, "{model}");
        rows
    }

    /// The coefficients of a row.
    pub(crate) fn medium(arguments: &str) -> Coefficients {
        Coefficients {
            sigma_a: argument(arguments, "sigma_a"),
            sigma_s_prime: argument(arguments, "sigma_s_prime"),
        }
    }

    /// Every row of R_d by `model`, which is made from the row's arguments.
    pub(crate) fn check_against_integrals<M: ForwardModel>(
        name: &str,
        tolerance: f64,
        model: impl Fn(&str) -> M,
    ) {
        for (arguments, expected) in integrated(name) {
            let mut got = [0.0];
            let radius = argument(&arguments, "r");
            model(&arguments).diffuse_reflectance(medium(&arguments), &[radius], &mut got);
            assert!(
                (got[0] / expected - 1.0).abs() < tolerance,
                "{name} {arguments}: {} for {expected}",
                got[0]
            );
        }
    }

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

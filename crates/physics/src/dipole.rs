//! The diffusion dipole: diffuse reflectance of a half-space under a pencil beam.

use crate::fresnel::{self, DiffuseFresnel};
use crate::medium::{Coefficients, ReducedMedium};
use crate::model::{ForwardModel, Gradient};
use crate::simd::{self, LaneLoop, SimdPath};
use std::f64::consts::PI;

/// The dipole of one medium: two point sources that together leave the boundary condition true.
///
/// # Source
///
/// Jensen et al. (2001), section 2.1, after Farrell et al. (1992). Equation 4 is taken as it
/// must have been meant: in print its second term carries both `z_v` and `1/σₜ′`, which has the
/// wrong unit and does not integrate to the total of section 2.4.
///
/// What the model leaves out, and no correction here puts in: single scattering as such (α′
/// counts it as if it were diffuse), the directions of the first scatterings within one or two
/// 1/σₜ′ of the beam, and absorption of the order of scattering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dipole {
    sigma_s_prime: f64,
    sigma_a: f64,
    sigma_t_prime: f64,
    sigma_tr: f64,
    albedo_prime: f64,
    z_real: f64,
    z_virtual: f64,
}

impl Dipole {
    /// The dipole of `medium`, with F_dr as `fresnel` says.
    ///
    /// [`DiffuseFresnel::RationalFit`] is the paper's model, `jensen2001`; the exact integral
    /// moves 1 − α′ by some 0.2 %.
    pub fn new(medium: &ReducedMedium, fresnel: DiffuseFresnel) -> Self {
        Self::with_a(medium.coefficients(), fresnel.a(medium.eta))
    }

    /// The dipole for an internal reflection parameter `a` that is known already.
    fn with_a(coefficients: Coefficients, a: f64) -> Self {
        let sigma_t_prime = coefficients.sigma_t_prime();
        let z_real = 1.0 / sigma_t_prime;
        Self {
            sigma_s_prime: coefficients.sigma_s_prime,
            sigma_a: coefficients.sigma_a,
            sigma_t_prime,
            sigma_tr: coefficients.sigma_tr(),
            albedo_prime: coefficients.albedo_prime(),
            z_real,
            // Depth of the image source, from the extrapolated boundary: z_r + 4AD, D = 1/(3σₜ′).
            z_virtual: z_real * (1.0 + 4.0 / 3.0 * a),
        }
    }

    /// Diffuse reflectance `R_d` at `radius` mm from a pencil beam, mm⁻².
    ///
    /// The power that leaves per unit area for each unit of power that enters:
    /// ∫ `R_d` 2πr dr = [`Self::total_reflectance`]. Falls with `radius`; like
    /// exp(−σₜᵣ r)/r² far out. Trust it where σₐ ≪ σₛ′ and `radius` is above
    /// one or two transport lengths 1/σₜ′.
    ///
    /// # Source
    ///
    /// Jensen et al. (2001), eq. 4 with its second term corrected, without the Fresnel factors.
    ///
    /// ```
    /// use physics::{DiffuseFresnel, Dipole, ReducedMedium};
    ///
    /// let marble = ReducedMedium { sigma_a: 0.0041, sigma_s_prime: 2.62, eta: 1.5 };
    /// let dipole = Dipole::new(&marble, DiffuseFresnel::RationalFit);
    /// assert!((dipole.diffuse_reflectance(1.0) - 0.034330026947).abs() < 1e-12);
    /// ```
    pub fn diffuse_reflectance(&self, radius: f64) -> f64 {
        let flux = |z: f64| {
            let d = radius.hypot(z);
            z * (1.0 + self.sigma_tr * d) * (-self.sigma_tr * d).exp() / (d * d * d)
        };
        self.albedo_prime / (4.0 * PI) * (flux(self.z_real) + flux(self.z_virtual))
    }

    /// [`Self::diffuse_reflectance`] with its derivatives in σₐ and σₛ′.
    pub fn diffuse_reflectance_gradient(&self, radius: f64) -> Gradient {
        let tr = self.sigma_tr;
        let mut sum = SourceSum::default();
        for z in [self.z_real, self.z_virtual] {
            let d = radius.hypot(z);
            let (d2, decay) = (d * d, (-tr * d).exp());
            let flux = (1.0 + tr * d) * decay / (d2 * d);
            let steepening = (tr * tr * d2 + 3.0 * tr * d + 3.0) * decay / (d2 * d2 * d);
            sum.value += z * flux;
            sum.in_sigma_tr_squared -= 0.5 * z * decay / d;
            sum.in_ln_depth += z * (flux - z * z * steepening);
        }
        self.gradient(&sum, 4.0 * PI)
    }

    /// The light that leaves within `radius` mm of the beam, with its derivatives:
    /// ∫ from 0 to `radius` of `R_d` 2πr dr. The total for an infinite `radius`.
    ///
    /// The closed form is the total less (α′/2) Σ z e^(−σₜᵣ d)/d, d = √(`radius`² + z²), over both
    /// sources. At σₐ = 0 its derivative in σₐ is finite for a finite `radius` and −∞ for the
    /// whole plane, whose total starts like 1 − √σₐ.
    pub fn within(&self, radius: f64) -> Gradient {
        let tr = self.sigma_tr;
        let mut sum = SourceSum::default();
        for z in [self.z_real, self.z_virtual] {
            let near = (-tr * z).exp();
            // The last is (1 − e^(−σₜᵣ (d − z)))/σₜᵣ.
            let (far, per_d, mean_path) = if radius.is_finite() {
                let d = radius.hypot(z);
                let path = if tr > 0.0 {
                    -(-tr * (d - z)).exp_m1() / tr
                } else {
                    d - z
                };
                ((-tr * d).exp() * z / d, 1.0 / d, path)
            } else {
                (0.0, 0.0, 1.0 / tr)
            };
            sum.value += near - far;
            sum.in_sigma_tr_squared -= 0.5 * z * near * mean_path;
            let slope = (z * per_d).powi(2) + z * z * tr * per_d;
            sum.in_ln_depth -= tr * z * near + far * (1.0 - slope);
        }
        self.gradient(&sum, 2.0)
    }

    /// The light that leaves farther than `radius` mm from the beam: the total less
    /// [`Self::within`], without their cancellation.
    pub fn beyond(&self, radius: f64) -> f64 {
        let share = |z: f64| {
            let d = radius.hypot(z);
            z * (-self.sigma_tr * d).exp() / d
        };
        0.5 * self.albedo_prime * (share(self.z_real) + share(self.z_virtual))
    }

    /// α′·`sum`/`divisor`, by the chain rule from σₜᵣ² = 3 σₐ σₜ′, depths ∝ 1/σₜ′ and
    /// α′ = σₛ′/σₜ′.
    fn gradient(&self, sum: &SourceSum, divisor: f64) -> Gradient {
        let t = self.sigma_t_prime;
        let scale = self.albedo_prime / divisor;
        let in_depth = -sum.in_ln_depth / t;
        let in_tr2 = 3.0 * sum.in_sigma_tr_squared;
        let in_albedo = sum.value / (divisor * t * t);
        Gradient {
            value: scale * sum.value,
            in_sigma_a: scale * (in_tr2 * (t + self.sigma_a) + in_depth)
                - in_albedo * self.sigma_s_prime,
            // σₐ = 0 leaves no way for σₛ′ to act through σₜᵣ, not even on the whole plane.
            in_sigma_s_prime: scale
                * (if self.sigma_a > 0.0 {
                    in_tr2 * self.sigma_a
                } else {
                    0.0
                } + in_depth)
                + in_albedo * self.sigma_a,
        }
    }

    /// [`Self::diffuse_reflectance`] at every `radius` (mm), into `out` of the same length, on
    /// the vector instructions of `path`.
    pub fn reflectances(&self, path: SimdPath, radius: &[f64], out: &mut [f64]) {
        path.run(Reflectances {
            dipole: self,
            radius,
            out,
        });
    }

    /// [`Self::diffuse_reflectance_gradient`] at every `radius` (mm), into `out` of the same
    /// length, on the vector instructions of `path`.
    pub fn gradients(&self, path: SimdPath, radius: &[f64], out: &mut [Gradient]) {
        path.run(Gradients {
            dipole: self,
            radius,
            out,
        });
    }

    /// Total diffuse reflectance per unit of power that enters, ∫ `R_d` 2πr dr.
    ///
    /// # Source
    ///
    /// Jensen et al. (2001), section 2.4: (α′/2)(1 + e^(−4A√(3(1−α′))/3)) e^(−√(3(1−α′))).
    pub fn total_reflectance(&self) -> f64 {
        self.beyond(0.0)
    }

    /// The diffuse BSSRDF S_d between two points `radius` mm apart on a plane, mm⁻² sr⁻¹.
    ///
    /// The cosines are those of the two directions outside. The paper's form is kept: its
    /// hemispherical integral over the outgoing cosine is 1 − F_dr,ext and not 1, so it loses
    /// 9 % of the light at η = 1.5 ([`fresnel::exit_factor`] is the form that does not).
    ///
    /// # Source
    ///
    /// Jensen et al. (2001), eq. 5.
    pub fn bssrdf(&self, radius: f64, eta: f64, cos_in: f64, cos_out: f64) -> f64 {
        fresnel::entry_factor(eta, cos_in)
            * self.diffuse_reflectance(radius)
            * fresnel::entry_factor(eta, cos_out)
            / PI
    }
}

/// A sum over both sources with its derivatives in what the sources depend on.
#[derive(Default)]
struct SourceSum {
    value: f64,
    in_sigma_tr_squared: f64,
    in_ln_depth: f64,
}

/// Radii in one pass of a loop: what one AVX-512 register holds.
const LANES: usize = 8;

/// [`Dipole::reflectances`] as a loop over lanes.
struct Reflectances<'a> {
    dipole: &'a Dipole,
    radius: &'a [f64],
    out: &'a mut [f64],
}

/// [`Dipole::gradients`] as a loop over lanes.
struct Gradients<'a> {
    dipole: &'a Dipole,
    radius: &'a [f64],
    out: &'a mut [Gradient],
}

/// `radius` in blocks; what the last lacks is filled with its first radius.
#[inline(always)]
fn blocks(radius: &[f64]) -> impl Iterator<Item = [f64; LANES]> {
    radius.chunks(LANES).map(|chunk| {
        let mut block = [chunk[0]; LANES];
        if chunk.len() == LANES {
            block.copy_from_slice(chunk);
        } else {
            block[..chunk.len()].copy_from_slice(chunk);
        }
        block
    })
}

impl LaneLoop for Reflectances<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let &Dipole {
            sigma_tr: tr,
            z_real,
            z_virtual,
            albedo_prime,
            ..
        } = self.dipole;
        let scale = albedo_prime / (4.0 * PI);
        for (radii, out) in blocks(self.radius).zip(self.out.chunks_mut(LANES)) {
            let mut values = [0.0; LANES];
            for (value, r) in values.iter_mut().zip(radii) {
                let source = |z: f64| {
                    let d = simd::fma::<FMA>(r, r, z * z).sqrt();
                    let x = tr * d;
                    (d, z * (1.0 + x) * simd::exp::<FMA>(-x))
                };
                let ((d, real), (e, image)) = (source(z_real), source(z_virtual));
                // One division serves both distances.
                let inverse = 1.0 / (d * e);
                let (per_d, per_e) = (inverse * e, inverse * d);
                *value = scale
                    * simd::fma::<FMA>(
                        real,
                        per_d * per_d * per_d,
                        image * (per_e * per_e * per_e),
                    );
            }
            out.copy_from_slice(&values[..out.len()]);
        }
    }
}

impl LaneLoop for Gradients<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let dipole = self.dipole;
        let (tr, zs) = (dipole.sigma_tr, [dipole.z_real, dipole.z_virtual]);
        // What each of the three sums contributes to value and derivatives.
        let unit = |value: f64, in_sigma_tr_squared: f64, in_ln_depth: f64| {
            let sum = SourceSum {
                value,
                in_sigma_tr_squared,
                in_ln_depth,
            };
            dipole.gradient(&sum, 4.0 * PI)
        };
        let (of_value, of_tr2, of_depth) = (
            unit(1.0, 0.0, 0.0),
            unit(0.0, 1.0, 0.0),
            unit(0.0, 0.0, 1.0),
        );
        for (radii, out) in blocks(self.radius).zip(self.out.chunks_mut(LANES)) {
            let (mut value, mut in_a, mut in_s) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
            for i in 0..LANES {
                let r = radii[i];
                let distance = |z: f64| simd::fma::<FMA>(r, r, z * z).sqrt();
                let d = zs.map(distance);
                // One division serves both distances.
                let inverse = 1.0 / (d[0] * d[1]);
                let per_d = [inverse * d[1], inverse * d[0]];
                let (mut sum, mut tr2, mut depth) = (0.0, 0.0, 0.0);
                for k in 0..2 {
                    let (z, x) = (zs[k], tr * d[k]);
                    let (per, per2) = (per_d[k], per_d[k] * per_d[k]);
                    // The source's strength times e^(−σₜᵣd)/d, and what multiplies it.
                    let near = z * per * simd::exp::<FMA>(-x);
                    let flux = near * per2 * (1.0 + x);
                    let steepening = near * per2 * per2 * simd::fma::<FMA>(x, x + 3.0, 3.0);
                    sum += flux;
                    tr2 = simd::fma::<FMA>(-0.5, near, tr2);
                    depth += simd::fma::<FMA>(-z * z, steepening, flux);
                }
                value[i] = of_value.value * sum;
                in_a[i] = simd::fma::<FMA>(
                    of_value.in_sigma_a,
                    sum,
                    simd::fma::<FMA>(of_tr2.in_sigma_a, tr2, of_depth.in_sigma_a * depth),
                );
                in_s[i] = simd::fma::<FMA>(
                    of_value.in_sigma_s_prime,
                    sum,
                    simd::fma::<FMA>(
                        of_tr2.in_sigma_s_prime,
                        tr2,
                        of_depth.in_sigma_s_prime * depth,
                    ),
                );
            }
            for (i, out) in out.iter_mut().enumerate() {
                *out = Gradient {
                    value: value[i],
                    in_sigma_a: in_a[i],
                    in_sigma_s_prime: in_s[i],
                };
            }
        }
    }
}

/// Total diffuse reflectance per entering power of a half-space of reduced albedo `albedo_prime`.
///
/// `a` is [`DiffuseFresnel::a`].
///
/// # Source
///
/// Jensen et al. (2001), section 2.4.
pub fn total_reflectance(albedo_prime: f64, a: f64) -> f64 {
    let c = Coefficients {
        sigma_a: 1.0 - albedo_prime,
        sigma_s_prime: albedo_prime,
    };
    Dipole::with_a(c, a).total_reflectance()
}

/// The reduced albedo whose total diffuse reflectance is `total`: the inverse of
/// [`total_reflectance`]. `None` outside [0, 1].
///
/// `a` is [`DiffuseFresnel::a`]. The total falls steadily with k = √(3(1 − α′)), so a Newton
/// step that leaves the bracket is replaced by a bisection and none can fail.
pub fn albedo_prime_from_total(total: f64, a: f64) -> Option<f64> {
    if !(0.0..=1.0).contains(&total) {
        return None;
    }
    let c = 1.0 + 4.0 / 3.0 * a;
    let (mut low, mut high) = (0.0, 3.0_f64.sqrt());
    let mut k = (1.0 - total) * high;
    for _ in 0..200 {
        let (near, far) = ((-k).exp(), (-c * k).exp());
        let albedo_prime = 1.0 - k * k / 3.0;
        let excess = 0.5 * albedo_prime * (near + far) - total;
        let slope = -k / 3.0 * (near + far) - 0.5 * albedo_prime * (near + c * far);
        if excess > 0.0 {
            low = k;
        } else {
            high = k;
        }
        let newton = k - excess / slope;
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        if (next - k).abs() <= 4.0 * f64::EPSILON * k {
            k = next;
            break;
        }
        k = next;
    }
    Some(1.0 - k * k / 3.0)
}

/// The dipole as a model that a fit can use: a relative index and a boundary, any coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DipoleModel {
    fresnel: DiffuseFresnel,
    eta: f64,
    a: f64,
}

impl DipoleModel {
    /// The dipole at relative index `eta`, with F_dr as `fresnel` says.
    pub fn new(eta: f64, fresnel: DiffuseFresnel) -> Self {
        Self {
            fresnel,
            eta,
            a: fresnel.a(eta),
        }
    }
}

impl ForwardModel for DipoleModel {
    fn name(&self) -> &'static str {
        match self.fresnel {
            DiffuseFresnel::Exact => "dipole",
            DiffuseFresnel::RationalFit => "jensen2001",
        }
    }

    fn eta(&self) -> f64 {
        self.eta
    }

    fn diffuse_reflectance(&self, coefficients: Coefficients, radius: &[f64], out: &mut [f64]) {
        Dipole::with_a(coefficients, self.a).reflectances(SimdPath::best(), radius, out);
    }

    fn diffuse_reflectance_gradient(
        &self,
        coefficients: Coefficients,
        radius: &[f64],
        out: &mut [Gradient],
    ) {
        Dipole::with_a(coefficients, self.a).gradients(SimdPath::best(), radius, out);
    }

    fn within(&self, coefficients: Coefficients, radius: f64) -> Gradient {
        Dipole::with_a(coefficients, self.a).within(radius)
    }

    fn beyond(&self, coefficients: Coefficients, radius: f64) -> f64 {
        Dipole::with_a(coefficients, self.a).beyond(radius)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use gauss_quad::GaussLegendre;
    use std::num::NonZeroUsize;

    /// `(arguments, value)` of every row of the 40-digit table that holds `quantity`.
    pub(crate) fn reference(quantity: &str) -> Vec<(String, f64)> {
        include_str!("../../../fixtures/analytic.csv")
            .lines()
            .filter_map(|line| {
                let mut cells = line.splitn(4, ',');
                (cells.next()? == quantity).then_some(())?;
                Some((cells.next()?.to_owned(), cells.next()?.parse().ok()?))
            })
            .collect()
    }

    /// The number behind `name=` in `a=1;b=2`.
    pub(crate) fn argument(arguments: &str, name: &str) -> f64 {
        arguments
            .split(';')
            .find_map(|pair| pair.strip_prefix(name)?.strip_prefix('='))
            .unwrap_or_else(|| panic!("no {name} in {arguments}"))
            .parse()
            .unwrap()
    }

    fn medium(arguments: &str) -> ReducedMedium {
        ReducedMedium {
            sigma_a: argument(arguments, "sigma_a"),
            sigma_s_prime: argument(arguments, "sigma_s_prime"),
            eta: argument(arguments, "eta"),
        }
    }

    #[test]
    fn agrees_with_forty_digits() {
        let rows = reference("dipole_rd");
        assert_eq!(rows.len(), 40);
        for (arguments, expected) in rows {
            let dipole = Dipole::new(&medium(&arguments), DiffuseFresnel::RationalFit);
            let got = dipole.diffuse_reflectance(argument(&arguments, "r"));
            assert!(
                (got / expected - 1.0).abs() < 1e-12,
                "{arguments}: {got} for {expected}"
            );
        }
        for quantity in ["dipole_total_closed_form", "dipole_total_integral"] {
            let rows = reference(quantity);
            assert_eq!(rows.len(), 5);
            for (arguments, expected) in rows {
                let dipole = Dipole::new(&medium(&arguments), DiffuseFresnel::RationalFit);
                let got = dipole.total_reflectance();
                assert!(
                    (got / expected - 1.0).abs() < 1e-12,
                    "{arguments}: {got} for {expected}"
                );
            }
        }
    }

    /// Both loops, on every path, against the formulas one radius at a time.
    #[test]
    fn loops_over_lanes_are_the_definition() {
        for medium in MEDIA {
            let dipole = Dipole::new(&medium, DiffuseFresnel::Exact);
            // From the beam itself to where light has died out, and a last block that is short.
            let mut radius = vec![0.0];
            radius.extend((0..202).map(|i| 1e-3 * 1.06_f64.powi(i)));
            let (mut values, mut gradients) = (vec![], vec![]);
            values.resize(radius.len(), 0.0);
            gradients.resize(radius.len(), Gradient::default());
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                dipole.reflectances(path, &radius, &mut values);
                dipole.gradients(path, &radius, &mut gradients);
                for ((&r, &value), got) in radius.iter().zip(&values).zip(&gradients) {
                    let expected = dipole.diffuse_reflectance_gradient(r);
                    if expected.value < 1e-290 {
                        continue;
                    }
                    // Where terms cancel, rounding is that of the terms: a derivative times its
                    // coefficient is of the order of the value, or of its exponent times it.
                    let terms = expected.value * (3.0 + dipole.sigma_tr * r);
                    let error = (value / expected.value - 1.0).abs();
                    let exponent = 1.0 + 1e-2 * dipole.sigma_tr * r;
                    assert!(error < 1e-13 * exponent, "{path:?} {medium:?} {r}: {value}");
                    for (got, expected, scale) in [
                        (got.value, expected.value, 1.0),
                        (got.in_sigma_a, expected.in_sigma_a, medium.sigma_a),
                        (
                            got.in_sigma_s_prime,
                            expected.in_sigma_s_prime,
                            medium.sigma_s_prime,
                        ),
                    ] {
                        let error = (got - expected).abs();
                        assert!(
                            error <= 1e-13 * expected.abs().max(terms / scale) * exponent,
                            "{path:?} {medium:?} {r}: {got} for {expected}"
                        );
                    }
                }
            }
        }
    }

    const MEDIA: [ReducedMedium; 4] = [
        ReducedMedium {
            sigma_a: 0.0041,
            sigma_s_prime: 2.62,
            eta: 1.5,
        },
        ReducedMedium {
            sigma_a: 0.97,
            sigma_s_prime: 0.07,
            eta: 1.3,
        },
        ReducedMedium {
            sigma_a: 1e-6,
            sigma_s_prime: 20.0,
            eta: 1.3,
        },
        ReducedMedium {
            sigma_a: 0.17,
            sigma_s_prime: 0.88,
            eta: 1.0,
        },
    ];

    fn check_gradient(medium: ReducedMedium, label: &str, f: impl Fn(&Dipole) -> Gradient) {
        let at = |sigma_a: f64, sigma_s_prime: f64| {
            f(&Dipole::new(
                &ReducedMedium {
                    sigma_a,
                    sigma_s_prime,
                    ..medium
                },
                DiffuseFresnel::Exact,
            ))
        };
        let ReducedMedium {
            sigma_a: a,
            sigma_s_prime: s,
            ..
        } = medium;
        let got = at(a, s);
        // Central differences of fourth order: the step is large enough for rounding.
        let slope = |f: &dyn Fn(f64) -> f64, x: f64| {
            let h = 1e-3 * x;
            (8.0 * (f(x + h) - f(x - h)) - (f(x + 2.0 * h) - f(x - 2.0 * h))) / (12.0 * h)
        };
        let in_a = slope(&|x| at(x, s).value, a);
        let in_s = slope(&|x| at(a, x).value, s);
        for (got, expected, of) in [(got.in_sigma_a, in_a, a), (got.in_sigma_s_prime, in_s, s)] {
            // Relative to the derivative, or to the value where the derivative passes zero.
            let scale = expected.abs().max(1e-3 * at(a, s).value / of);
            assert!(
                (got - expected).abs() < 1e-7 * scale,
                "{label}: {got} for {expected}"
            );
        }
    }

    #[test]
    fn gradients_are_central_differences() {
        for medium in MEDIA {
            for radius in [0.0, 0.05, 0.3, 1.0, 4.0, 20.0] {
                let label = format!("{medium:?}, r = {radius}");
                check_gradient(medium, &label, |d| d.diffuse_reflectance_gradient(radius));
                check_gradient(medium, &label, |d| d.within(radius.max(0.3)));
                check_gradient(medium, &label, |d| d.within(f64::INFINITY));
                let dipole = Dipole::new(&medium, DiffuseFresnel::Exact);
                let (a, b) = (
                    dipole.diffuse_reflectance(radius),
                    dipole.diffuse_reflectance_gradient(radius).value,
                );
                assert!((a / b - 1.0).abs() < 1e-13, "{label}: {a} and {b}");
            }
        }
    }

    #[test]
    fn without_absorption_the_slope_in_sigma_a_is_finite_but_for_the_whole_plane() {
        let at = |sigma_a| {
            let clear = ReducedMedium {
                sigma_a,
                sigma_s_prime: 5.0,
                eta: 1.3,
            };
            Dipole::new(&clear, DiffuseFresnel::Exact)
        };
        // One-sided difference; its own error is of the order of σₐ·r²σₜ′.
        let step = 1e-9;
        for radius in [0.5, 5.0] {
            let f = |a| at(a).diffuse_reflectance(radius);
            let slope = (f(step) - f(0.0)) / step;
            let got = at(0.0).diffuse_reflectance_gradient(radius).in_sigma_a;
            assert!(
                (got / slope - 1.0).abs() < 1e-3,
                "R_d at {radius}: {got} for {slope}"
            );
            let f = |a| at(a).within(radius).value;
            let slope = (f(step) - f(0.0)) / step;
            let got = at(0.0).within(radius).in_sigma_a;
            assert!(
                (got / slope - 1.0).abs() < 1e-3,
                "within {radius}: {got} for {slope}"
            );
        }
        assert_eq!(at(0.0).within(f64::INFINITY).in_sigma_a, f64::NEG_INFINITY);
        assert!(at(0.0).within(f64::INFINITY).in_sigma_s_prime.abs() < 1e-12);
    }

    #[test]
    fn beyond_is_the_integral() {
        let rule = GaussLegendre::new(NonZeroUsize::new(30).unwrap());
        for medium in MEDIA {
            let dipole = Dipole::new(&medium, DiffuseFresnel::Exact);
            let (from, to) = (0.7, 3.0);
            let ring = rule.integrate(from, to, |r| 2.0 * PI * r * dipole.diffuse_reflectance(r));
            let closed = dipole.beyond(from) - dipole.beyond(to);
            assert!(
                (closed / ring - 1.0).abs() < 1e-12,
                "{medium:?}: {closed} for {ring}"
            );
            let total = dipole.within(to).value + dipole.beyond(to);
            assert!(
                (total / dipole.total_reflectance() - 1.0).abs() < 1e-13,
                "{medium:?}"
            );
            let whole = dipole.within(f64::INFINITY).value;
            assert!(
                (whole / dipole.total_reflectance() - 1.0).abs() < 1e-15,
                "{medium:?}"
            );
        }
    }

    /// Total reflectance in the paper's own symbols, so that a wrong σₜᵣ or a
    /// wrong image depth in the code above cannot cancel against itself.
    fn total_from_albedo(albedo_prime: f64, a: f64) -> f64 {
        let s = (3.0 * (1.0 - albedo_prime)).sqrt();
        0.5 * albedo_prime * (1.0 + (-4.0 / 3.0 * a * s).exp()) * (-s).exp()
    }

    #[test]
    fn the_total_has_an_inverse() {
        for eta in [1.0, 1.3, 1.5] {
            let a = DiffuseFresnel::Exact.a(eta);
            for albedo_prime in [1e-6, 0.02, 0.3, 0.8, 0.99, 0.999_999, 1.0] {
                let total = total_from_albedo(albedo_prime, a);
                let forward = total_reflectance(albedo_prime, a);
                assert!(
                    (forward / total - 1.0).abs() < 1e-12,
                    "{albedo_prime}: {forward}"
                );
                let back = albedo_prime_from_total(total, a).unwrap();
                assert!(
                    (back - albedo_prime).abs() < 1e-12 * albedo_prime.max(1e-3),
                    "{back}"
                );
            }
            assert_eq!(albedo_prime_from_total(1.0 + 1e-9, a), None);
            assert_eq!(albedo_prime_from_total(f64::NAN, a), None);
            assert_eq!(albedo_prime_from_total(-0.1, a), None);
        }
    }

    #[test]
    fn twice_as_dense_looks_the_same_at_half_the_distance() {
        let marble = MEDIA[0];
        let dense = ReducedMedium {
            sigma_a: 2.0 * marble.sigma_a,
            sigma_s_prime: 2.0 * marble.sigma_s_prime,
            ..marble
        };
        let near = Dipole::new(&dense, DiffuseFresnel::Exact).diffuse_reflectance(0.6);
        let far = Dipole::new(&marble, DiffuseFresnel::Exact).diffuse_reflectance(1.2);
        assert!((near / (4.0 * far) - 1.0).abs() < 1e-13);
    }
}

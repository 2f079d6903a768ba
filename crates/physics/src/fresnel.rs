//! A smooth dielectric boundary: Fresnel reflectance, its hemispherical averages, and the
//! factors by which light that enters or leaves is diminished.

use gauss_quad::GaussLegendre;
use std::num::NonZeroUsize;

/// How the average reflectance of diffuse light inside the medium, F_dr, is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DiffuseFresnel {
    /// The integral of the Fresnel formula.
    Exact,
    /// The rational fit of Egan and Hilgeman that Jensen et al. (2001) use, off by up to 1e-3.
    RationalFit,
}

/// Cosine of the refracted direction, or `None` for total reflection.
///
/// `eta_ti` is the far index over the near one; `cos_incidence` in [0, 1].
pub fn refracted_cos(eta_ti: f64, cos_incidence: f64) -> Option<f64> {
    let sin2 = (1.0 - cos_incidence) * (1.0 + cos_incidence) / (eta_ti * eta_ti);
    (sin2 < 1.0).then(|| (1.0 - sin2).sqrt())
}

/// Fresnel reflectance of unpolarised light.
///
/// `eta_ti` is the far index over the near one; `cos_incidence` in [0, 1]. 1 under total
/// reflection.
///
/// ```
/// let water = physics::fresnel::reflectance(1.33, 1.0);
/// assert!((water - (0.33_f64 / 2.33).powi(2)).abs() < 1e-15);
/// ```
pub fn reflectance(eta_ti: f64, cos_incidence: f64) -> f64 {
    let Some(cos_t) = refracted_cos(eta_ti, cos_incidence) else {
        return 1.0;
    };
    if cos_incidence == 0.0 {
        // Grazing light is reflected whole; matched indices have no boundary at all.
        return if eta_ti == 1.0 { 0.0 } else { 1.0 };
    }
    reflectance_between(eta_ti, cos_incidence, cos_t)
}

/// Fresnel reflectance of unpolarised light whose cosines on both sides are known, the near one
/// not 0. Without a branch.
#[inline(always)]
pub fn reflectance_between(eta_ti: f64, cos_incidence: f64, cos_refracted: f64) -> f64 {
    let s = (cos_incidence - eta_ti * cos_refracted) / (cos_incidence + eta_ti * cos_refracted);
    let p = (eta_ti * cos_incidence - cos_refracted) / (eta_ti * cos_incidence + cos_refracted);
    0.5 * (s * s + p * p)
}

/// Average reflectance of diffuse light that meets a boundary, 2∫ F μ dμ.
///
/// `eta_ti` is the far index over the near one. The `1/π` that Jensen et al. (2001), section 2.1,
/// lost in print is here.
pub fn diffuse_reflectance(eta_ti: f64) -> f64 {
    if eta_ti < 1.0 {
        // From the denser side: reciprocity of the transmitted light,
        // 1 − F(1/η) = η²-weighted transmission from the rarer side.
        return 1.0 - eta_ti * eta_ti * (1.0 - diffuse_reflectance(1.0 / eta_ti));
    }
    if eta_ti == 1.0 {
        return 0.0;
    }
    from_rarer_side(eta_ti, |mu| 2.0 * mu * reflectance(eta_ti, mu))
}

/// ∫ `integrand` dμ over [0, 1], for an integrand that follows F for light from the rarer side.
fn from_rarer_side(eta_ti: f64, integrand: impl Fn(f64) -> f64) -> f64 {
    // F turns from 1 to its plateau where μ is about √(η² − 1): panels graded toward μ = 0.
    let rule = GaussLegendre::new(NonZeroUsize::new(16).expect("16 is not zero"));
    let turn = ((eta_ti - 1.0) * (eta_ti + 1.0)).sqrt().min(0.5);
    let (mut low, mut high, mut sum) = (0.0, turn / 8.0, 0.0);
    while low < 1.0 {
        sum += rule.integrate(low, high, &integrand);
        (low, high) = (high, (2.0 * high).min(1.0));
    }
    sum
}

/// What a boundary does to nearly isotropic light inside a medium, as diffusion theory needs it.
///
/// Light of fluence φ and downward flux −E (its mean direction, E toward the surface) has the
/// radiance (φ + 3 E μ)/4π at the cosine μ against the outward normal, and what of it gets out is
/// `fluence`·φ + `flux`·E. The two numbers are all that the boundary is to such light.
///
/// # Source
///
/// Kienle and Patterson (1997), the integral before their eq. 8, which gives 0.118 φ + 0.306 E
/// at η = 1.4; the same as C_φ and C_E of d'Eon and Irving (2011), section 5. The boundary
/// condition is Haskell et al. (1994): their (1 + R_eff)/(1 − R_eff) is [`Self::a`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exitance {
    /// C_φ = ½∫(1 − F)μ dμ = (1 − 2C₁)/4, F being that of light from inside.
    pub fluence: f64,
    /// C_E = (3/2)∫(1 − F)μ² dμ = (1 − 3C₂)/2.
    pub flux: f64,
}

impl Exitance {
    /// The boundary of a medium of relative index `eta`, by the integrals of Fresnel's formula.
    pub fn new(eta: f64) -> Self {
        let fluence = 0.25 * (1.0 - diffuse_reflectance(1.0 / eta));
        // Of light from the rarer side: its F has no kink.
        let flux = if eta > 1.0 {
            // η sin θ is the same on both sides, so μᵢ dμᵢ = μₒ dμₒ/η².
            let inner = |mu: f64| refracted_cos(eta, mu).unwrap_or(0.0);
            1.5 / (eta * eta)
                * from_rarer_side(eta, |mu| mu * inner(mu) * (1.0 - reflectance(eta, mu)))
        } else if eta < 1.0 {
            let eta_ti = 1.0 / eta;
            1.5 * from_rarer_side(eta_ti, |mu| mu * mu * (1.0 - reflectance(eta_ti, mu)))
        } else {
            0.5
        };
        Self { fluence, flux }
    }

    /// A = (1 + 3C₂)/(1 − 2C₁): the fluence vanishes on a plane 2AD above the surface.
    ///
    /// [`DiffuseFresnel::a`] is the same from the reflected flux alone, with both moments taken as
    /// that of diffuse light.
    pub fn a(&self) -> f64 {
        (1.0 - self.flux) / (2.0 * self.fluence)
    }
}

impl DiffuseFresnel {
    /// F_dr: the average reflectance of diffuse light *inside* a medium of relative index `eta`.
    ///
    /// # Source
    ///
    /// Jensen et al. (2001), section 2.1. The rational fit is for `eta` above 1; below, the one
    /// of the same source (Egan and Hilgeman 1979) for light in the rarer medium is taken. At
    /// `eta` = 1 the fit gives 0.0016 where there is no boundary.
    pub fn internal(self, eta: f64) -> f64 {
        match self {
            Self::Exact => diffuse_reflectance(1.0 / eta),
            Self::RationalFit if eta >= 1.0 => {
                -1.440 / (eta * eta) + 0.710 / eta + 0.668 + 0.0636 * eta
            }
            Self::RationalFit => {
                -0.4399 + 0.7099 / eta - 0.3319 / (eta * eta) + 0.0636 / (eta * eta * eta)
            }
        }
    }

    /// The internal reflection parameter A = (1 + F_dr)/(1 − F_dr) of the boundary condition.
    pub fn a(self, eta: f64) -> f64 {
        let f_dr = self.internal(eta);
        (1.0 + f_dr) / (1.0 - f_dr)
    }
}

/// Share of a collimated beam that enters the medium, 1 − R_specular.
///
/// `cos_incidence` is measured outside, between beam and normal.
pub fn entry_factor(eta: f64, cos_incidence: f64) -> f64 {
    1.0 - reflectance(eta, cos_incidence)
}

/// π·radiance over exitance for diffuse light that left through a smooth boundary.
///
/// `cos_view` is measured outside, between the line of sight and the normal. The average over
/// the hemisphere, weighted with the cosine, is 1: this is F_t(η, θ)/(1 − F_dr,ext), 1.057 at
/// η = 1.5 along the normal. Light inside is taken to be isotropic, as diffusion has it.
pub fn exit_factor(eta: f64, cos_view: f64) -> f64 {
    (1.0 - reflectance(eta, cos_view)) / (1.0 - diffuse_reflectance(eta))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dipole::tests::{argument, reference};
    use crate::image_sources::tests::integrated;

    #[test]
    fn agrees_with_forty_digits() {
        let rows = reference("fresnel_reflectance");
        assert_eq!(rows.len(), 30);
        for (arguments, expected) in rows {
            let got = reflectance(argument(&arguments, "eta"), argument(&arguments, "cos"));
            assert!(
                (got - expected).abs() < 1e-14,
                "{arguments}: {got} for {expected}"
            );
        }
        for (name, how) in [
            ("fdr_internal_exact", DiffuseFresnel::Exact),
            ("fdr_fit", DiffuseFresnel::RationalFit),
        ] {
            let rows = reference(name);
            assert_eq!(rows.len(), 7);
            for (arguments, expected) in rows {
                // These rows hold the bare `eta=…`.
                let got = how.internal(argument(&arguments, "eta"));
                assert!(
                    (got - expected).abs() < 1e-13,
                    "{name} {arguments}: {got} for {expected}"
                );
            }
        }
    }

    /// Walsh's closed form for light from the rarer side, as Duntley (1942) prints it.
    fn walsh(n: f64) -> f64 {
        let (n2, n4) = (n * n, n.powi(4));
        0.5 + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0).powi(2))
            + n2 * (n2 - 1.0).powi(2) / (n2 + 1.0).powi(3) * ((n - 1.0) / (n + 1.0)).ln()
            - 2.0 * n.powi(3) * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
            + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0).powi(2)) * n.ln()
    }

    #[test]
    fn the_average_is_walshs_closed_form() {
        for n in [1.1, 1.2, 1.3, 1.33, 1.45, 1.6, 2.0, 2.4, 4.0] {
            let (got, expected) = (diffuse_reflectance(n), walsh(n));
            assert!(
                (got - expected).abs() < 1e-12,
                "n = {n}: {got} for {expected}"
            );
        }
        assert_eq!(diffuse_reflectance(1.0), 0.0);
        let near = diffuse_reflectance(1.0 + 1e-6);
        assert!(near > 0.0 && near < 1e-4, "{near}");
    }

    /// Printed by Kienle and Patterson for η = 1.4, and R_eff = 0.493 by Haskell et al.
    #[test]
    fn what_gets_out_of_nearly_isotropic_light_is_as_printed() {
        let exitance = Exitance::new(1.4);
        assert!((exitance.fluence - 0.118).abs() < 5e-4, "{exitance:?}");
        assert!((exitance.flux - 0.306).abs() < 5e-4, "{exitance:?}");
        let a = exitance.a();
        let r_eff = (a - 1.0) / (a + 1.0);
        assert!((r_eff - 0.493).abs() < 5e-4, "{r_eff}");
        assert_eq!(
            Exitance::new(1.0),
            Exitance {
                fluence: 0.25,
                flux: 0.5
            }
        );
        assert_eq!(Exitance::new(1.0).a(), 1.0);
    }

    #[test]
    fn exitance_agrees_with_an_independent_integration() {
        for (name, of) in [
            ("exitance_fluence", (|e| e.fluence) as fn(&Exitance) -> f64),
            ("exitance_flux", |e| e.flux),
            ("exitance_a", Exitance::a),
        ] {
            for (arguments, expected) in integrated(name) {
                let got = of(&Exitance::new(argument(&arguments, "eta")));
                assert!(
                    (got / expected - 1.0).abs() < 1e-11,
                    "{name} {arguments}: {got}"
                );
            }
        }
    }

    /// The definition by brute force, with Fresnel's formula of light from inside.
    #[test]
    fn exitance_is_its_integral() {
        for eta in [0.7_f64, 0.95, 1.000_1, 1.05, 1.3, 1.5, 2.4] {
            let inside = 1.0 / eta;
            let critical = (1.0 - inside.min(1.0).powi(2)).sqrt();
            // μ = critical + y² takes the root out of the kink, and panels the rest.
            let integral = |power: i32| {
                let rule = GaussLegendre::new(NonZeroUsize::new(40).unwrap());
                let end = (1.0 - critical).sqrt();
                let panels = 60;
                (0..panels)
                    .map(|i| {
                        let edge = |i: i32| end * (f64::from(i) / f64::from(panels)).powi(3);
                        rule.integrate(edge(i), edge(i + 1), |y: f64| {
                            let mu: f64 = critical + y * y;
                            2.0 * y * mu.powi(power) * (1.0 - reflectance(inside, mu))
                        })
                    })
                    .sum::<f64>()
            };
            let got = Exitance::new(eta);
            let expected = (0.5 * integral(1), 1.5 * integral(2));
            assert!(
                (got.fluence - expected.0).abs() < 1e-9 && (got.flux - expected.1).abs() < 1e-9,
                "eta = {eta}: {got:?} for {expected:?}"
            );
        }
    }

    #[test]
    fn the_exit_factor_averages_to_one() {
        let rule = GaussLegendre::new(NonZeroUsize::new(60).unwrap());
        for eta in [1.0, 1.3, 1.5] {
            let mean = rule.integrate(0.0, 1.0, |mu| 2.0 * mu * exit_factor(eta, mu));
            assert!((mean - 1.0).abs() < 1e-6, "eta = {eta}: {mean}");
        }
        assert!((exit_factor(1.5, 1.0) - 1.057).abs() < 5e-4);
    }
}

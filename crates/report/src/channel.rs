//! What is shown of one channel, and what follows from its fit.

use crate::number::{at_least, at_most, exact, fixed, uncertain};
use fit::Fit;
use physics::{Coefficients, RadialProfile};

/// One channel of a measurement, measured and fitted.
#[derive(Clone, Debug)]
pub struct ChannelReport<'a> {
    /// The fit.
    pub fit: &'a Fit,
    /// Every measured point, also those outside the fitted range.
    pub profile: &'a RadialProfile,
    /// Wavelength, nm, where the channel has one.
    pub wavelength_nm: Option<f64>,
    /// The model at the optimum over all radii, by increasing radius, in the terms of the profile:
    /// per incident power, the fitted scale in it.
    pub model_curve: Vec<CurvePoint>,
    /// What the standard uncertainties of both coefficients, with their correlation, leave open of
    /// each point of `model_curve`, mm⁻²; empty where it is not known.
    pub u_model_per_mm2: Vec<f64>,
    /// The same medium by the transport equation, at the radii of `model_curve` and in its terms;
    /// empty where the model is that equation, or the equation's table does not reach.
    pub transport: Vec<CurvePoint>,
    /// The same medium by photon counting, in the same terms; empty where none were counted.
    pub monte_carlo: Vec<CurvePoint>,
    /// The model's total over the whole plane, per power that *enters* the medium.
    pub total_reflectance: f64,
    /// The coefficients that made the data, where they are known.
    pub truth: Option<Coefficients>,
}

/// What one of several models makes of a channel.
#[derive(Clone, Debug)]
pub struct ModelReport<'a> {
    /// Name of the model.
    pub name: &'a str,
    /// Its fit.
    pub fit: &'a Fit,
    /// Its curve, in the terms of [`ChannelReport::model_curve`].
    pub curve: Vec<CurvePoint>,
    /// Its total over the whole plane, per power that enters the medium.
    pub total_reflectance: f64,
}

/// A point of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Distance from the beam, mm.
    pub radius_mm: f64,
    /// Exitance per incident power, mm⁻².
    pub reflectance_per_mm2: f64,
}

impl ChannelReport<'_> {
    /// Name of the channel with its wavelength: `G`, `G, 532 nm`.
    pub(crate) fn name(&self) -> String {
        match self.wavelength_nm {
            Some(wavelength) => {
                format!("{}, {} nm", self.fit.channel, exact(wavelength))
            }
            None => self.fit.channel.clone(),
        }
    }

    /// The colour that the channel is drawn in, as a class.
    pub(crate) fn color_class(&self) -> &'static str {
        match (self.fit.channel.as_str(), self.wavelength_nm) {
            ("R", _) => "red",
            ("G", _) => "green",
            ("B", _) => "blue",
            (_, Some(wavelength)) if (380.0..490.0).contains(&wavelength) => "blue",
            (_, Some(wavelength)) if (490.0..590.0).contains(&wavelength) => "green",
            (_, Some(wavelength)) if (590.0..780.0).contains(&wavelength) => "red",
            _ => "gray",
        }
    }

    /// σₛ′ ± u, mm⁻¹.
    pub(crate) fn sigma_s_prime(&self) -> String {
        uncertain(self.fit.sigma_s_prime.value, self.fit.sigma_s_prime.u)
    }

    /// σₐ ± u, or its upper limit, mm⁻¹.
    pub(crate) fn sigma_a(&self) -> String {
        match self.fit.upper_limit {
            Some(limit) => at_most(limit),
            None => uncertain(self.fit.sigma_a.value, self.fit.sigma_a.u),
        }
    }

    /// Standard uncertainty of a quantity with these slopes in σₐ and σₛ′.
    fn propagated(&self, in_sigma_a: f64, in_sigma_s_prime: f64) -> f64 {
        let a = in_sigma_a * self.fit.sigma_a.u;
        let s = in_sigma_s_prime * self.fit.sigma_s_prime.u;
        (a * a + s * s + 2.0 * self.fit.correlation * a * s)
            .max(0.0)
            .sqrt()
    }

    /// Transport mean free path 1/σₜ′ ± u, mm.
    pub(crate) fn mean_free_path(&self) -> String {
        let path = 1.0 / self.fit.coefficients().sigma_t_prime();
        uncertain(path, self.propagated(path * path, path * path))
    }

    /// Decay length of diffuse light 1/σₜᵣ ± u, mm, or its lower limit.
    pub(crate) fn decay_length(&self) -> String {
        if let Some(limit) = self.at_upper_limit() {
            return at_least(1.0 / limit.sigma_tr());
        }
        let c = self.fit.coefficients();
        let length = 1.0 / c.sigma_tr();
        // σₜᵣ² = 3 σₐ (σₐ + σₛ′), and d(1/σₜᵣ) = −½ σₜᵣ⁻³ d(σₜᵣ²).
        let slope = -1.5 * length.powi(3);
        let in_sigma_a = slope * (2.0 * c.sigma_a + c.sigma_s_prime);
        uncertain(length, self.propagated(in_sigma_a, slope * c.sigma_a))
    }

    /// α′ ± u, or its lower limit.
    pub(crate) fn albedo_prime(&self) -> String {
        if let Some(limit) = self.at_upper_limit() {
            // Two digits of what is missing from 1, rounded to the safe side.
            let missing = 1.0 - limit.albedo_prime();
            let places = (1.0 - missing.max(1e-12).log10().floor()).max(1.0);
            let step = 10f64.powf(places);
            return format!(
                "> {}",
                fixed(1.0 - (missing * step).ceil() / step, places as i32)
            );
        }
        let c = self.fit.coefficients();
        let t = c.sigma_t_prime();
        let u = self.propagated(-c.sigma_s_prime / (t * t), c.sigma_a / (t * t));
        uncertain(c.albedo_prime(), u)
    }

    /// The coefficients with σₐ at its upper limit, where it has one.
    fn at_upper_limit(&self) -> Option<Coefficients> {
        let sigma_a = self.fit.upper_limit?;
        Some(Coefficients {
            sigma_a,
            ..self.fit.coefficients()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fit::{Estimate, Termination};

    fn green(sigma_a: f64, upper_limit: Option<f64>) -> Fit {
        let estimate = |value, u| Estimate {
            value,
            u,
            ci95: (value - 2.0 * u, value + 2.0 * u),
            degrees_of_freedom: f64::INFINITY,
        };
        Fit {
            channel: "G".to_owned(),
            sigma_a: estimate(sigma_a, 0.0001),
            sigma_s_prime: estimate(2.62, 0.02),
            correlation: -0.9,
            budget: vec![],
            upper_limit,
            total: None,
            scale: 1.0,
            range_mm: (1.0, 10.0),
            share_outside: 0.01,
            reduced_chi2: 1.0,
            evaluations: 20,
            termination: Termination::Converged,
            warnings: vec![],
            residuals: vec![],
            nuisances: vec![],
        }
    }

    fn shown<T>(fit: &Fit, show: impl Fn(&ChannelReport) -> T) -> T {
        let profile = RadialProfile {
            channel: "G".to_owned(),
            points: vec![],
        };
        show(&ChannelReport {
            fit,
            profile: &profile,
            wavelength_nm: None,
            model_curve: vec![],
            u_model_per_mm2: vec![],
            transport: vec![],
            total_reflectance: 0.79,
            monte_carlo: vec![],
            truth: None,
        })
    }

    /// Marble green: the figures that the field guide prints for it.
    #[test]
    fn what_follows_from_the_coefficients() {
        let fit = green(0.0041, None);
        assert_eq!(shown(&fit, |c| c.mean_free_path()), "0.3811 ± 0.0029");
        assert_eq!(shown(&fit, |c| c.decay_length()), "5.566 ± 0.050");
        assert_eq!(shown(&fit, |c| c.albedo_prime()), "0.998438 ± 0.000049");
    }

    /// Against differences of the definitions along the columns of a root of the covariance, for
    /// a medium that scatters and one that absorbs as much.
    #[test]
    fn uncertainties_propagate_with_their_correlation() {
        let (u_a, u_s, rho) = (0.0001, 0.02, -0.9_f64);
        let columns = [(u_a, rho * u_s), (0.0, (1.0 - rho * rho).sqrt() * u_s)];
        for (a, u_a_scale) in [(0.0041, 1.0), (2.5, 300.0)] {
            let mut fit = green(a, None);
            fit.sigma_a.u = u_a_scale * u_a;
            let spread = |quantity: &dyn Fn(f64, f64) -> f64| {
                let slope = |(da, ds): (f64, f64)| {
                    let (da, ds) = (1e-3 * u_a_scale * da, 1e-3 * ds);
                    (quantity(a + da, 2.62 + ds) - quantity(a - da, 2.62 - ds)) / 2e-3
                };
                columns.map(slope).iter().map(|s| s * s).sum::<f64>().sqrt()
            };
            for (text, expected) in [
                (
                    shown(&fit, |c| c.mean_free_path()),
                    spread(&|a, s| 1.0 / (a + s)),
                ),
                (
                    shown(&fit, |c| c.decay_length()),
                    spread(&|a, s| (3.0 * a * (a + s)).powf(-0.5)),
                ),
                (
                    shown(&fit, |c| c.albedo_prime()),
                    spread(&|a, s| s / (a + s)),
                ),
            ] {
                let u: f64 = text.split(" ± ").nth(1).unwrap().parse().unwrap();
                // Two digits are shown: half a unit of the second is at most 5 %.
                assert!((u / expected - 1.0).abs() < 0.05, "{a}: {text} {expected}");
            }
        }
    }

    #[test]
    fn an_upper_limit_bounds_what_follows_from_it() {
        let fit = green(0.0, Some(0.000_312));
        assert_eq!(shown(&fit, |c| c.sigma_a()), "< 0.00032");
        // 1/√(3 · 0.000312 · 2.620312) = 20.19 mm.
        assert_eq!(shown(&fit, |c| c.decay_length()), "> 20");
        // 1 − α′ = 0.00011907.
        assert_eq!(shown(&fit, |c| c.albedo_prime()), "> 0.99988");
    }
}

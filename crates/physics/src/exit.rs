//! What a camera sees of the light that leaves: radiance in one direction, not exitance.

use crate::fresnel;

/// π·radiance over exitance toward a camera, by radius; 1 for a Lambertian exit.
///
/// Averaged over the azimuth, as a ring about the beam is. Light that scattered once and leaves
/// straight back along the beam is seen at one point: its share is kept apart.
#[derive(Clone, Debug, PartialEq)]
pub struct ExitFactor {
    /// ln of the first radius in mm, and the step to the next.
    first: f64,
    step: f64,
    factors: Vec<f64>,
    /// π·intensity of the point where the beam enters, per power that enters.
    pub at_beam: f64,
    /// Over the whole plane: π·intensity over the power that leaves, the point included.
    pub mean: f64,
}

impl ExitFactor {
    /// The same factor everywhere.
    pub fn even(factor: f64) -> Self {
        Self {
            first: 0.0,
            step: 1.0,
            factors: vec![factor],
            at_beam: 0.0,
            mean: factor,
        }
    }

    /// The factor of light that is isotropic inside, at relative index `eta` and the cosine of
    /// the view with the normal: [`fresnel::exit_factor`].
    pub fn diffuse(eta: f64, cos_view: f64) -> Self {
        Self::even(fresnel::exit_factor(eta, cos_view))
    }

    /// Factors at radii whose logarithms (of mm) begin at `first` and are `step` apart; at least
    /// one. Before and behind them the outermost factor stands.
    pub fn by_radius(first: f64, step: f64, factors: Vec<f64>, at_beam: f64, mean: f64) -> Self {
        debug_assert!(!factors.is_empty() && step > 0.0);
        Self {
            first,
            step,
            factors,
            at_beam,
            mean,
        }
    }

    /// At `radius` mm.
    pub fn at(&self, radius: f64) -> f64 {
        let last = self.factors.len() - 1;
        let place = ((radius.ln() - self.first) / self.step).clamp(0.0, last as f64);
        let i = (place as usize).min(last.saturating_sub(1));
        let (low, high) = (self.factors[i], self.factors[(i + 1).min(last)]);
        low + (high - low) * (place - i as f64)
    }

    /// Whether it is the same everywhere.
    pub fn is_even(&self) -> bool {
        self.factors.len() == 1 && self.at_beam == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_radii_it_is_linear_in_the_logarithm_and_stays_outside() {
        let factor = ExitFactor::by_radius(0.0, 1.0, vec![1.0, 2.0, 4.0], 0.5, 1.0);
        for (ln_radius, expected) in [(-5.0, 1.0), (0.5, 1.5), (1.25, 2.5), (9.0, 4.0)] {
            assert!((factor.at(f64::exp(ln_radius)) - expected).abs() < 1e-12);
        }
        assert_eq!(factor.at(0.0), 1.0);
        let even = ExitFactor::diffuse(1.5, 1.0);
        assert!((even.at(0.3) - 1.057).abs() < 5e-4 && even.is_even());
    }
}

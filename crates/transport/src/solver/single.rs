//! Light that scattered once: exact, for the pencil beam itself.

use gauss_quad::GaussLegendre;
use physics::{HenyeyGreenstein, PhaseFunction, fresnel};
use std::f64::consts::PI;
use std::num::NonZeroUsize;

/// Below this angle from the normal a panel needs no further division, rad.
const SMALLEST_ANGLE: f64 = 1e-4;

/// Single scattering of one medium, in units of its mean free path.
pub(crate) struct Single {
    /// For each direction: its share of the light, and the length of beam and way back per radius.
    rays: Vec<(f64, f64)>,
    /// What is seen at the very point where the beam enters; see [`Self::toward`].
    pub(crate) at_beam: f64,
}

/// Below this sine of the direction inside, what scattered once is seen at one point.
const STRAIGHT_BACK: f64 = 1e-3;

impl Single {
    /// `albedo` is the share of the light lost from the beam that scatters.
    pub(crate) fn new(eta: f64, g: f64, albedo: f64) -> Self {
        let phase = HenyeyGreenstein { g };
        let rule = GaussLegendre::new(NonZeroUsize::new(16).expect("16 is not zero"));
        let critical = (1.0 / eta).min(1.0).asin();
        let mut rays = Vec::new();
        let mut panel = |low: f64, high: f64, from_critical: bool, power: i32| {
            for (x, w) in rule.as_node_weight_pairs() {
                let s = 0.5 * (1.0 + x);
                let offset = low + (high - low) * s.powi(power);
                let theta = if from_critical {
                    critical - offset
                } else {
                    offset
                };
                let weight = 0.5 * w * (high - low) * f64::from(power) * s.powi(power - 1);
                let cos = theta.cos();
                let entering = 1.0 - fresnel::reflectance(1.0 / eta, cos);
                let density = 2.0 * PI * albedo * phase.density(-cos);
                rays.push((weight * density * entering * cos, (1.0 + cos) / theta.sin()));
            }
        };
        // Light that leaves near the beam comes up along the normal, on the scale of the radius;
        // panels shrink toward it.
        let middle = 0.5 * critical;
        let mut high = middle;
        while high > SMALLEST_ANGLE {
            panel(0.25 * high, high, false, 1);
            high *= 0.25;
        }
        panel(0.0, high, false, 1);
        // The other half is measured from the critical angle, where the transmittance starts
        // like a square root and settles within the critical cosine.
        let settled = critical.cos().clamp(0.0, middle);
        let mut low = 0.0;
        let mut width = if settled > 1e-9 { settled } else { middle };
        let mut power = 2;
        while low < middle {
            let high = if low + 1.5 * width >= middle {
                middle
            } else {
                low + width
            };
            panel(low, high, true, power);
            (low, width, power) = (high, 2.0 * width, 1);
        }
        Self { rays, at_beam: 0.0 }
    }

    /// π·radiance in place of exitance, toward a camera that sees along the cosine `mu` inside.
    pub(crate) fn toward(eta: f64, g: f64, albedo: f64, mu: f64) -> Self {
        let phase = HenyeyGreenstein { g };
        let entering = 1.0 - fresnel::reflectance(1.0 / eta, mu);
        let seen = PI / (eta * eta) * albedo * phase.density(-mu) * entering;
        let sin = ((1.0 - mu) * (1.0 + mu)).max(0.0).sqrt();
        if sin < STRAIGHT_BACK {
            return Self {
                rays: Vec::new(),
                at_beam: seen / (1.0 + mu),
            };
        }
        Self {
            rays: vec![(seen / sin, (1.0 + mu) / sin)],
            at_beam: 0.0,
        }
    }

    /// Exitance at `radius`.
    pub(crate) fn reflectance(&self, radius: f64) -> f64 {
        let sum: f64 = self
            .rays
            .iter()
            .map(|(w, path)| w * (-path * radius).exp())
            .sum();
        sum / (2.0 * PI * radius)
    }

    /// What leaves farther than `radius`; the total for 0.
    pub(crate) fn beyond(&self, radius: f64) -> f64 {
        self.rays
            .iter()
            .map(|(w, path)| w * (-path * radius).exp() / path)
            .sum()
    }
}

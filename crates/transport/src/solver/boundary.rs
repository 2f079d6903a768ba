//! Quadrature over the directions that meet the boundary from inside.

use gauss_quad::GaussLegendre;
use physics::fresnel;
use std::num::NonZeroUsize;

/// One direction: its cosine with the normal, its quadrature weight, and the share reflected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ray {
    pub(crate) mu: f64,
    pub(crate) weight: f64,
    pub(crate) reflectance: f64,
}

/// Nodes over μ in [0, 1] at relative index `eta`, `per_panel` to each smooth piece.
///
/// The reflectance leaves 1 at the critical angle like a square root, which the first panel
/// takes up by substitution, and settles within a few times the critical cosine, which the
/// doubling panels follow.
pub(crate) fn rays(eta: f64, per_panel: usize) -> Vec<Ray> {
    let rule = GaussLegendre::new(NonZeroUsize::new(per_panel.max(1)).expect("at least 1"));
    let mut rays = Vec::new();
    let mut panel = |low: f64, high: f64, power: f64| {
        for (x, w) in rule.as_node_weight_pairs() {
            let s = 0.5 * (1.0 + x);
            let mu = low + (high - low) * s.powf(power);
            let weight = 0.5 * w * (high - low) * power * s.powf(power - 1.0);
            rays.push(Ray {
                mu,
                weight,
                reflectance: fresnel::reflectance(1.0 / eta, mu),
            });
        }
    };
    let critical = (1.0 - 1.0 / (eta * eta)).max(0.0).sqrt();
    if critical == 0.0 {
        panel(0.0, 1.0, 1.0);
        return rays;
    }
    panel(0.0, critical, 1.0);
    let mut low = critical;
    let mut width = critical;
    let mut power = 2.0;
    while low < 1.0 {
        // A sliver at the end would waste a panel.
        let high = if low + 1.5 * width >= 1.0 {
            1.0
        } else {
            low + width
        };
        panel(low, high, power);
        (low, width, power) = (high, 2.0 * width, 1.0);
    }
    rays
}

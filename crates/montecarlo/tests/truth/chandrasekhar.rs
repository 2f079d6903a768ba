//! Chandrasekhar's H, from its integral equation by iteration.

use gauss_quad::GaussLegendre;
use std::num::NonZeroUsize;

/// A Gauss-Legendre rule.
pub(crate) fn rule(points: usize) -> GaussLegendre {
    GaussLegendre::new(NonZeroUsize::new(points).expect("a rule has points"))
}

/// The function of one albedo.
pub(crate) struct H {
    albedo: f64,
    nodes: Vec<(f64, f64)>,
    values: Vec<f64>,
}

impl H {
    pub(crate) fn new(albedo: f64) -> Self {
        let rule = rule(64);
        let nodes: Vec<(f64, f64)> = rule
            .iter()
            .map(|&(x, w)| (0.5 * (x + 1.0), 0.5 * w))
            .collect();
        let mut h = Self {
            albedo,
            values: vec![1.0; nodes.len()],
            nodes,
        };
        for _ in 0..200 {
            // The mean of old and new: the bare iteration swings to and fro.
            let next = h
                .nodes
                .iter()
                .zip(&h.values)
                .map(|(&(mu, _), old)| 0.5 * (old + h.at(mu)));
            h.values = next.collect();
        }
        h
    }

    /// H at `mu`: 1/H = √(1 − α) + α/2 ∫ μ′ H(μ′)/(μ + μ′) dμ′: Chandrasekhar (1950), chapter V, eq. 16.
    pub(crate) fn at(&self, mu: f64) -> f64 {
        let terms = self.nodes.iter().zip(&self.values);
        let integral: f64 = terms.map(|(&(x, w), h)| w * x * h / (mu + x)).sum();
        1.0 / ((1.0 - self.albedo).sqrt() + 0.5 * self.albedo * integral)
    }
}

//! The directions in which light is followed.

use gauss_quad::GaussLegendre;
use std::num::NonZeroUsize;

/// Fewest directions on a panel, however narrow.
const FEWEST: usize = 6;

/// Directions named by what refraction keeps, s = n sin θ, so that each is one and the same in
/// every layer and a smooth surface mixes none of them.
///
/// What is followed in them is radiance over n², which refraction keeps as well; the power through
/// a plane is π Σ wᵢ Lᵢ/n² with the weights of an integral over s².
#[derive(Clone, Debug)]
pub(crate) struct Directions {
    /// s².
    square: Vec<f64>,
    /// Weights of ∫ ds²; 0 for directions that are only looked at.
    pub(crate) weights: Vec<f64>,
}

impl Directions {
    /// Quadrature over every direction of media with these indices, `nodes` to the widest panel,
    /// and behind it the directions `looked_at`, given as s².
    ///
    /// The panels meet where some medium is at its grazing angle: there the cosines of the medium
    /// turn, and so does Fresnel's reflectance.
    pub(crate) fn new(indices: &[f64], nodes: usize, looked_at: &[f64]) -> Self {
        let mut ends = indices.to_vec();
        ends.sort_by(f64::total_cmp);
        ends.dedup_by(|a, b| *a - *b < 1e-9 * *b);
        let (mut square, mut weights) = (vec![], vec![]);
        let mut inner = 0.0;
        for outer in ends {
            // In the cosine of the medium that ends here, on [0, widest].
            let widest = (1.0 - (inner / outer) * (inner / outer)).sqrt();
            let count = ((nodes as f64 * widest).ceil() as usize).max(FEWEST);
            let rule = GaussLegendre::new(NonZeroUsize::new(count).expect("at least FEWEST"));
            for (node, weight) in rule.iter() {
                let mu = 0.5 * widest * (1.0 + node);
                square.push(outer * outer * (1.0 - mu) * (1.0 + mu));
                weights.push(outer * outer * widest * weight * mu);
            }
            inner = outer;
        }
        square.extend_from_slice(looked_at);
        weights.resize(square.len(), 0.0);
        Self { square, weights }
    }

    pub(crate) fn count(&self) -> usize {
        self.square.len()
    }

    /// Cosine of direction `i` in a medium of this index, or `None` where it does not exist.
    pub(crate) fn cos(&self, i: usize, index: f64) -> Option<f64> {
        let sin2 = self.square[i] / (index * index);
        // A direction at its grazing angle carries no power.
        (sin2 < 1.0 - 1e-12).then(|| (1.0 - sin2).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_medium_has_its_etendue_and_its_hemisphere() {
        let indices = [1.0, 1.5, 1.33, 1.5];
        let directions = Directions::new(&indices, 16, &[0.25]);
        for index in [1.0, 1.33, 1.5] {
            let (mut etendue, mut hemisphere) = (0.0, 0.0);
            for (i, weight) in directions.weights.iter().enumerate() {
                if let Some(mu) = directions.cos(i, index) {
                    etendue += weight;
                    hemisphere += weight / (2.0 * index * index * mu);
                }
            }
            assert!(
                (etendue - index * index).abs() < 1e-12,
                "{index}: {etendue}"
            );
            assert!((hemisphere - 1.0).abs() < 1e-9, "{index}: {hemisphere}");
        }
    }
}

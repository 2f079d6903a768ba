//! A round spread of light over the surface, as it was measured.

use std::f64::consts::{LN_2, PI};

/// Light about a point, tabulated: what share of it falls into each of contiguous rings, even
/// within each. The shares are not negative and sum to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct RadialSpread {
    /// Edges, mm, increasing from 0; one more than there are rings.
    edges_mm: Vec<f64>,
    /// Share of the light inside each edge, from 0 to 1.
    within: Vec<f64>,
}

impl RadialSpread {
    /// The spread with `power` in the rings between `edges_mm`, brought to the sum of 1.
    ///
    /// `None` where the edges do not increase from 0, a power is negative or not finite, or there
    /// is none at all.
    pub fn new(edges_mm: Vec<f64>, power: &[f64]) -> Option<Self> {
        let increasing = edges_mm.first() == Some(&0.0)
            && edges_mm.windows(2).all(|e| e[0] < e[1])
            && edges_mm.iter().all(|e| e.is_finite());
        let sum: f64 = power.iter().sum();
        let light = sum > 0.0 && sum.is_finite() && power.iter().all(|p| *p >= 0.0);
        if !(increasing && light && edges_mm.len() == power.len() + 1) {
            return None;
        }
        let mut within = vec![0.0];
        let mut inside = 0.0;
        for p in power {
            inside += p / sum;
            // Rounding must not take it past the whole.
            within.push(inside.min(1.0));
        }
        // Rounding must not leave the last ring short.
        *within.last_mut()? = 1.0;
        Some(Self { edges_mm, within })
    }

    /// Each ring: inner and outer edge, mm, and its share of the light.
    pub fn rings(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        let edges = self.edges_mm.windows(2);
        let shares = self.within.windows(2);
        edges.zip(shares).map(|(e, w)| (e[0], e[1], w[1] - w[0]))
    }

    /// Variance along one axis, mm².
    pub fn variance_mm2(&self) -> f64 {
        // An even ring has the mean r² (a² + b²)/2, shared by two axes.
        self.rings()
            .map(|(a, b, share)| 0.25 * share * (a * a + b * b))
            .sum()
    }

    /// Radius of the circle that holds the share `share` of the light, mm.
    pub fn radius_holding(&self, share: f64) -> f64 {
        let share = share.clamp(0.0, 1.0);
        let ring = self
            .within
            .partition_point(|w| *w < share)
            .clamp(1, self.within.len() - 1);
        let (low, high) = (self.within[ring - 1], self.within[ring]);
        let (a, b) = (self.edges_mm[ring - 1], self.edges_mm[ring]);
        let part = if high > low {
            ((share - low) / (high - low)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (a * a + part * (b * b - a * a)).sqrt()
    }

    /// Full width of the Gaussian whose circles of 30, 50 and 70 % of the light have the same
    /// radii on average, mm: of a Gaussian its full width at half maximum, and of other shapes a
    /// width that neither noise at the centre nor a faint halo moves.
    pub fn fwhm_mm(&self) -> f64 {
        let mean = [0.3, 0.5, 0.7]
            .map(|share: f64| self.radius_holding(share) / (-(-share).ln_1p() / LN_2).sqrt())
            .iter()
            .sum::<f64>();
        2.0 * mean / 3.0
    }

    /// The same shape with every radius times `factor`, which must be above 0.
    pub fn stretched(&self, factor: f64) -> Self {
        debug_assert!(factor > 0.0);
        Self {
            edges_mm: self.edges_mm.iter().map(|e| e * factor).collect(),
            within: self.within.clone(),
        }
    }

    /// Light per area at `radius` mm, mm⁻².
    pub fn density(&self, radius: f64) -> f64 {
        self.rings()
            .find(|(inner, outer, _)| (*inner..*outer).contains(&radius))
            .map_or(0.0, |(a, b, share)| share / (PI * (b - a) * (b + a)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Gaussian of 1 mm in rings of 0.05 mm.
    fn gaussian() -> RadialSpread {
        let edges: Vec<f64> = (0..=50).map(|k| 0.05 * f64::from(k)).collect();
        let beyond = |r: f64| (-4.0 * LN_2 * r * r).exp();
        let power: Vec<f64> = edges
            .windows(2)
            .map(|e| beyond(e[0]) - beyond(e[1]))
            .collect();
        RadialSpread::new(edges, &power).unwrap()
    }

    #[test]
    fn a_gaussian_has_its_width_and_its_moment() {
        let spread = gaussian();
        // Rings of 0.05 mm that are even within.
        assert!(
            (spread.fwhm_mm() - 1.0).abs() < 1e-3,
            "{}",
            spread.fwhm_mm()
        );
        // Even rings add to r² what their width has beyond the density's own slope: h²/12.
        let variance = 1.0 / (8.0 * LN_2);
        assert!(
            (spread.variance_mm2() / variance - 1.0).abs() < 5e-3,
            "{}",
            spread.variance_mm2()
        );
        // Half of the light of a Gaussian lies within half of its width.
        assert!((spread.radius_holding(0.5) - 0.5).abs() < 1e-3);
        assert_eq!(spread.radius_holding(0.0), 0.0);
        assert_eq!(spread.radius_holding(1.0), 2.5);
        let peak = 4.0 * LN_2 / PI;
        assert!((spread.density(0.0) / peak - 1.0).abs() < 0.01);
        assert_eq!(spread.density(3.0), 0.0);
        let wide = spread.stretched(1.5);
        assert!((wide.fwhm_mm() / spread.fwhm_mm() - 1.5).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_spread_is_refused() {
        for (edges, power) in [
            (vec![0.1, 0.2], vec![1.0]),
            (vec![0.0, 0.2, 0.2], vec![1.0, 1.0]),
            (vec![0.0, 0.2], vec![-1.0]),
            (vec![0.0, 0.2], vec![0.0]),
            (vec![0.0, 0.2], vec![f64::NAN]),
            (vec![0.0, 0.2], vec![1.0, 1.0]),
            (vec![], vec![]),
        ] {
            assert_eq!(RadialSpread::new(edges.clone(), &power), None, "{edges:?}");
        }
    }
}

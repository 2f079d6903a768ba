//! A smooth curve through ring means.

use crate::rings::Rings;
use std::array::from_fn;

/// A smooth function of the distance from the spot: in each ring a cubic in the square of the
/// distance, scaled to τ in [−1, 1].
///
/// The pixels of a ring do not sample its area evenly, and where the profile is steep their mean
/// is off by up to percents. A curve that comes near to the profile takes that out: the mean of
/// pixel minus curve, plus the curve's mean over the area, is exact for whatever the curve
/// describes and leaves the statistics of the pixels as they are.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    cubics: Vec<[f64; 4]>,
}

/// The first four moments of τ over a ring, that of order 0 being 1.
pub(crate) type Moments = [f64; 4];

/// The moments of τ over the area of any ring.
pub(crate) const AREA: Moments = [1.0, 0.0, 1.0 / 3.0, 0.0];

/// Rounds of adjustment; each leaves a few percent of the error before, outside the core.
const ROUNDS: usize = 12;

impl Curve {
    /// The curve whose mean over each ring's pixels, with moments `moments`, is `means`.
    ///
    /// Where the means are large beside `floor` the curve is smooth in their logarithm, and
    /// below linear, so that it passes through zero and through noise.
    pub(crate) fn through(rings: &Rings, means: &[f64], moments: &[Moments], floor: f64) -> Self {
        let abscissa = |square: f64| (1.0 + square / CORE).ln();
        let chebyshev = Chebyshev::new();
        let squares = (0..rings.len()).map(|ring| rings.square(ring));
        let middles = squares.clone().map(|(middle, _)| abscissa(middle));
        let at_nodes = squares.map(|(middle, half)| {
            (chebyshev.nodes).map(|tau| abscissa((middle + half * tau).max(0.0)))
        });
        let places = Places {
            middles: middles.collect(),
            at_nodes: at_nodes.collect(),
            chebyshev,
        };
        let mut nodes = means.to_vec();
        let mut curve = Self::from_nodes(&places, &nodes, floor);
        for _ in 0..ROUNDS {
            for (ring, node) in nodes.iter_mut().enumerate() {
                *node += means[ring] - curve.mean(ring, &moments[ring]);
            }
            curve = Self::from_nodes(&places, &nodes, floor);
        }
        curve
    }

    fn from_nodes(places: &Places, nodes: &[f64], floor: f64) -> Self {
        let y: Vec<f64> = nodes.iter().map(|v| (v / floor).asinh()).collect();
        let spline = Spline::new(&places.middles, y);
        let cubic = |(ring, at_nodes): (usize, &[f64; 4])| {
            // The spline runs on past its last nodes; e^30 bounds it there.
            let value = |x: f64| floor * spline.at(x, ring).clamp(-LARGEST, LARGEST).sinh();
            places.chebyshev.cubic_through(at_nodes.map(value))
        };
        Self {
            cubics: places.at_nodes.iter().enumerate().map(cubic).collect(),
        }
    }

    /// The value at `tau` of `ring`.
    pub(crate) fn at(&self, ring: usize, tau: f64) -> f64 {
        let [a, b, c, d] = self.cubics[ring];
        a + tau * (b + tau * (c + tau * d))
    }

    /// Its coefficients in `ring`, by increasing power of τ.
    pub(crate) fn cubic(&self, ring: usize) -> [f64; 4] {
        self.cubics[ring]
    }

    /// Its derivative there by `tau`.
    pub(crate) fn slope(&self, ring: usize, tau: f64) -> f64 {
        let [_, b, c, d] = self.cubics[ring];
        b + tau * (2.0 * c + tau * 3.0 * d)
    }

    /// The mean over points of `ring` with these moments.
    pub(crate) fn mean(&self, ring: usize, moments: &Moments) -> f64 {
        self.cubics[ring]
            .iter()
            .zip(moments)
            .map(|(c, m)| c * m)
            .sum()
    }
}

/// Square of the radius below which the abscissa is r² rather than ln r, px²: a profile is even
/// in r and like a power of r far out.
const CORE: f64 = 9.0;

/// asinh of the largest value over the floor.
const LARGEST: f64 = 60.0;

/// Where the spline is looked at, whatever its values.
struct Places {
    /// In the middle of each ring.
    middles: Vec<f64>,
    /// At the nodes of its cubic.
    at_nodes: Vec<[f64; 4]>,
    chebyshev: Chebyshev,
}

/// The four Chebyshev nodes of [−1, 1], and the polynomials there.
struct Chebyshev {
    nodes: [f64; 4],
    /// By node and order, with the weight that makes a coefficient of values.
    weights: [[f64; 4]; 4],
}

impl Chebyshev {
    fn new() -> Self {
        let angle = |node: usize| std::f64::consts::PI * (node as f64 + 0.5) / 4.0;
        let weight = |node: usize, order: usize| {
            let weight = if order == 0 { 0.25 } else { 0.5 };
            weight * (order as f64 * angle(node)).cos()
        };
        Self {
            nodes: from_fn(|node| angle(node).cos()),
            weights: from_fn(|node| from_fn(|order| weight(node, order))),
        }
    }

    /// Coefficients of the cubic with these values at the nodes.
    fn cubic_through(&self, values: [f64; 4]) -> [f64; 4] {
        let mut chebyshev = [0.0; 4];
        for (value, weights) in values.iter().zip(&self.weights) {
            for (sum, weight) in chebyshev.iter_mut().zip(weights) {
                *sum += weight * value;
            }
        }
        let [a, b, c, d] = chebyshev;
        [a - c, b - 3.0 * d, 2.0 * c, 4.0 * d]
    }
}

/// A cubic spline with continuous curvature.
struct Spline<'a> {
    x: &'a [f64],
    y: Vec<f64>,
    /// Slopes at the nodes.
    slope: Vec<f64>,
}

impl<'a> Spline<'a> {
    /// Through at least four nodes, `x` increasing. The slopes at the ends are those of the
    /// cubic through the four nodes next to them.
    fn new(x: &'a [f64], y: Vec<f64>) -> Self {
        let n = x.len();
        let mut slope = vec![0.0; n];
        slope[0] = end_slope(&x[..4], &y[..4]);
        let last = [x, y.as_slice()].map(|v| [v[n - 1], v[n - 2], v[n - 3], v[n - 4]]);
        slope[n - 1] = end_slope(&last[0], &last[1]);
        // Continuous curvature ties each slope to its neighbours: a tridiagonal system.
        let mut upper = vec![0.0; n];
        for i in 1..n - 1 {
            let (left, right) = (x[i] - x[i - 1], x[i + 1] - x[i]);
            let (from_left, from_right) = ((y[i] - y[i - 1]) / left, (y[i + 1] - y[i]) / right);
            let wanted = 3.0 * (right * from_left + left * from_right);
            let pivot = 2.0 * (left + right) - right * upper[i - 1];
            upper[i] = left / pivot;
            slope[i] = (wanted - right * slope[i - 1]) / pivot;
        }
        for i in (1..n - 1).rev() {
            slope[i] -= upper[i] * slope[i + 1];
        }
        Self { x, y, slope }
    }

    /// The value at `x`, which lies next to node `node`.
    fn at(&self, x: f64, node: usize) -> f64 {
        let i = if x < self.x[node] {
            node.max(1) - 1
        } else {
            node
        };
        let i = i.min(self.x.len() - 2);
        let width = self.x[i + 1] - self.x[i];
        let t = (x - self.x[i]) / width;
        let (u, step) = (1.0 - t, self.y[i + 1] - self.y[i]);
        let (bend_left, bend_right) = (
            self.slope[i] * width - step,
            step - self.slope[i + 1] * width,
        );
        u * self.y[i] + t * self.y[i + 1] + t * u * (u * bend_left + t * bend_right)
    }
}

/// Slope at the first of four nodes of the cubic through them.
fn end_slope(x: &[f64], y: &[f64]) -> f64 {
    let mut table = [y[0], y[1], y[2], y[3]];
    let (mut slope, mut product) = (0.0, 1.0);
    // Newton's divided differences; the derivative of each term at the first node.
    for order in 1..4 {
        for i in (order..4).rev() {
            table[i] = (table[i] - table[i - 1]) / (x[i] - x[i - order]);
        }
        slope += table[order] * product;
        product *= x[0] - x[order];
    }
    slope
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_its_own_spline() {
        let f = |x: f64| 1.0 - 2.0 * x + 0.5 * x * x - 0.1 * x * x * x;
        let x: Vec<f64> = [0.0, 0.4, 1.0, 1.3, 2.1, 3.0].to_vec();
        let y = x.iter().map(|x| f(*x)).collect();
        let spline = Spline::new(&x, y);
        for (node, at) in [(0, -0.1), (0, 0.2), (1, 0.39), (3, 1.5), (5, 2.9), (5, 3.2)] {
            assert!((spline.at(at, node) - f(at)).abs() < 1e-12, "{at}");
        }
        let chebyshev = Chebyshev::new();
        let cubic = chebyshev.cubic_through(chebyshev.nodes.map(f));
        for (got, expected) in cubic.iter().zip([1.0, -2.0, 0.5, -0.1]) {
            assert!((got - expected).abs() < 1e-14, "{cubic:?}");
        }
    }

    #[test]
    fn a_power_law_is_followed_between_the_ring_means() {
        let rings = Rings::new(300.0, 0.025, 1.5);
        let f = |square: f64| (20.0 + square).powf(-1.5);
        // The mean over each ring in closed form: ∫ (a + s)^-3/2 ds = -2 (a + s)^-1/2.
        let means: Vec<f64> = (0..rings.len())
            .map(|ring| {
                let (middle, half) = rings.square(ring);
                let end = |s: f64| -2.0 / (20.0 + s).sqrt();
                (end(middle + half) - end(middle - half)) / (2.0 * half)
            })
            .collect();
        let curve = Curve::through(&rings, &means, &vec![AREA; rings.len()], 1e-12);
        for ring in 0..rings.len() {
            let (middle, half) = rings.square(ring);
            for tau in [-1.0, -0.3, 0.5, 1.0] {
                let (got, expected) = (curve.at(ring, tau), f(middle + half * tau));
                assert!(
                    (got / expected - 1.0).abs() < 2e-3,
                    "{ring}, {tau}: {got} {expected}"
                );
            }
        }
    }
}

//! One homogeneous layer: a thin start, doubled until it is as thick as it should be.

use crate::directions::Directions;
use crate::operator::Operator;
use nalgebra::{DMatrix, DVector};
use physics::Layer;

/// Optical thickness of the start along the most grazing direction. The series below then leaves
/// out less than 1e-12.
const START: f64 = 0.25;
/// Terms of the series.
const TERMS: usize = 5;
/// Doublings after which a layer without end has ended: 2⁶⁰ starts.
const MOST_DOUBLINGS: usize = 60;
/// Transmitted share below which more thickness changes nothing.
const OPAQUE: f64 = 1e-13;

/// What a homogeneous layer sends back and lets through, from either side alike.
#[derive(Clone, Debug)]
pub(crate) struct Slab {
    pub(crate) reflection: Operator,
    pub(crate) transmission: Operator,
}

impl Slab {
    /// `layer` without its surfaces, followed in `directions`, with `moments` Legendre moments of
    /// its phase function told apart.
    pub(crate) fn new(layer: &Layer, directions: &Directions, moments: usize) -> Self {
        let count = directions.count();
        let weights = DVector::from_column_slice(&directions.weights);
        let cosines: Vec<Option<f64>> = (0..count).map(|i| directions.cos(i, layer.eta)).collect();
        if layer.sigma_s == 0.0 {
            let tau = layer.optical_thickness();
            let through = |mu: &Option<f64>| mu.map_or(0.0, |mu| (-tau / mu).exp());
            let direct = DVector::from_iterator(count, cosines.iter().map(through));
            return Self {
                reflection: Operator::zero(count),
                transmission: Operator::diagonal(direct),
            };
        }
        let peak = Peakless::new(layer, moments);
        let tau = peak.optical_thickness;
        let grazing = cosines.iter().flatten().fold(1.0, |a: f64, b| a.min(*b));
        let (doublings, start) = if tau.is_finite() {
            let doublings = (tau / (START * grazing)).log2().ceil().max(0.0) as usize;
            (doublings, tau / 2.0_f64.powi(doublings as i32))
        } else {
            (MOST_DOUBLINGS, START * grazing)
        };
        let mut slab = Self::thin(&peak, &cosines, &weights, layer.eta, start);
        for _ in 0..doublings {
            slab = slab.doubled(&weights);
            if tau.is_infinite() && slab.most_transmitted(&weights) < OPAQUE {
                break;
            }
        }
        if tau.is_infinite() {
            slab.transmission = Operator::zero(count);
        }
        slab
    }

    /// A slab of optical thickness `tau` small against every cosine.
    ///
    /// With L± the light down and up, S = L₊ + L₋ and D = L₊ − L₋ obey S′ = −aD, D′ = −bS, so
    /// that both are power series in (τ² ab): the matrix exponential in half the size.
    fn thin(
        peak: &Peakless,
        cosines: &[Option<f64>],
        weights: &DVector<f64>,
        eta: f64,
        tau: f64,
    ) -> Self {
        let [along, across] = peak.redistribution(cosines, weights, eta);
        let inverse = |mu: &Option<f64>| mu.map_or(0.0, |mu| 1.0 / mu);
        let extinction = DVector::from_iterator(cosines.len(), cosines.iter().map(inverse));
        let alpha = Operator {
            direct: extinction,
            kernel: -along,
        };
        let beta = Operator {
            direct: DVector::zeros(cosines.len()),
            kernel: across,
        };
        let a = alpha.clone().plus(&beta, 1.0);
        let b = alpha.plus(&beta, -1.0);
        let step = a.after(&b, weights);
        let one = Operator::diagonal(DVector::from_element(cosines.len(), 1.0));
        let (mut power, mut cosh, mut sinh) = (one.clone(), one.clone(), one);
        let mut factor = 1.0;
        for k in 1..=TERMS {
            power = power.after(&step, weights);
            let even = 2.0 * k as f64;
            factor *= tau * tau / (even * (even - 1.0));
            cosh = cosh.plus(&power, factor);
            sinh = sinh.plus(&power, factor / (even + 1.0));
        }
        let by_a = sinh.after(&a, weights);
        let by_b = sinh.adjoint().after(&b, weights);
        let back = cosh.adjoint();
        // Of L₋ at the bottom: what comes of L₊ and of L₋ at the top.
        let half = |s: f64, t: f64| {
            let sum = Operator::zero(cosines.len());
            sum.plus(&cosh, 0.5)
                .plus(&back, 0.5 * s)
                .plus(&by_a, 0.5 * t * tau)
                .plus(&by_b, 0.5 * tau)
        };
        let (of_down, of_up) = (half(-1.0, -1.0), half(1.0, 1.0));
        let mut transmission = of_up.complement().bounces(weights);
        let reflection = transmission.after(&of_down, weights);
        for (through, cos) in transmission.direct.iter_mut().zip(cosines) {
            if cos.is_none() {
                *through = 0.0;
            }
        }
        Self {
            reflection: Operator {
                direct: DVector::zeros(cosines.len()),
                kernel: -reflection.kernel,
            },
            transmission,
        }
    }

    /// Two of them, one on the other.
    fn doubled(&self, weights: &DVector<f64>) -> Self {
        let Self {
            reflection,
            transmission,
        } = self;
        let between = reflection.after(reflection, weights).bounces(weights);
        let out = transmission.after(&between, weights);
        let back = out
            .after(reflection, weights)
            .after(transmission, weights)
            .plus(reflection, 1.0);
        Self {
            reflection: back,
            transmission: out.after(transmission, weights),
        }
    }

    fn most_transmitted(&self, weights: &DVector<f64>) -> f64 {
        (0..weights.len())
            .map(|j| self.transmission.direct[j] + self.transmission.scattered(j, weights))
            .fold(0.0, f64::max)
    }
}

/// A layer whose forward peak counts as light that was never scattered.
///
/// # Source
///
/// The δ-M method of Wiscombe (1977), J. Atmos. Sci. 34, 1408: f = χ_M goes forward, and the
/// moments below M are what is left.
struct Peakless {
    albedo: f64,
    optical_thickness: f64,
    /// Legendre moments of the rest, χ₀ = 1.
    moments: Vec<f64>,
}

impl Peakless {
    fn new(layer: &Layer, moments: usize) -> Self {
        let mut chi = vec![0.0; moments + 1];
        layer.phase.legendre_moments(&mut chi);
        let peak = chi.pop().expect("one more than `moments`");
        let albedo = layer.albedo();
        let kept = 1.0 - albedo * peak;
        for moment in &mut chi {
            *moment = (*moment - peak) / (1.0 - peak);
        }
        Self {
            albedo: albedo * (1.0 - peak) / kept,
            optical_thickness: layer.optical_thickness() * kept,
            moments: chi,
        }
    }

    /// Kernels of light scattered on along its way and back across it, per unit of optical
    /// thickness.
    fn redistribution(
        &self,
        cosines: &[Option<f64>],
        weights: &DVector<f64>,
        eta: f64,
    ) -> [DMatrix<f64>; 2] {
        let count = cosines.len();
        // Legendre polynomials of every cosine, order by order.
        let mut legendre = DMatrix::zeros(self.moments.len(), count);
        for (j, mu) in cosines.iter().enumerate() {
            let Some(mu) = *mu else { continue };
            let (mut before, mut here) = (0.0, 1.0);
            for l in 0..self.moments.len() {
                legendre[(l, j)] = here;
                let l = l as f64;
                (before, here) = (here, ((2.0 * l + 1.0) * mu * here - l * before) / (l + 1.0));
            }
        }
        let half = |odd: bool| {
            let mut weighted = legendre.clone();
            for (l, mut row) in weighted.row_iter_mut().enumerate() {
                let here = if (l % 2 == 1) == odd {
                    (l as f64 + 0.5) * self.moments[l]
                } else {
                    0.0
                };
                row.scale_mut(here);
            }
            legendre.tr_mul(&weighted)
        };
        let (even, odd) = (half(false), half(true));
        let (mut along, mut across) = (&even + &odd, even - odd);
        let solid = |j: usize| cosines[j].map_or(0.0, |mu| weights[j] / (2.0 * eta * eta * mu));
        for j in 0..count {
            if weights[j] > 0.0 && cosines[j].is_some() {
                // What quadrature loses or gains goes straight on (Wiscombe 1976).
                let sum: f64 = (0..count)
                    .map(|i| solid(i) * (along[(i, j)] + across[(i, j)]))
                    .sum();
                along[(j, j)] += (1.0 - sum) / solid(j);
            }
        }
        for j in 0..count {
            for i in 0..count {
                let scale = match (cosines[i], cosines[j]) {
                    (Some(out), Some(mu)) => self.albedo / (2.0 * eta * eta * out * mu),
                    _ => 0.0,
                };
                along[(i, j)] *= scale;
                across[(i, j)] *= scale;
            }
        }
        [along, across]
    }
}

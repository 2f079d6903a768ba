//! The table as a model that a fit can use.

use crate::grid::{Blend, spline};
use crate::reference::{Log, Reference};
use crate::solver::{Interior, Surface};
use crate::table::{
    BadTable, CHANNELS, ETA, G_COUNT, K, LARGEST_G, LEAST_G, LN_RADIUS, PER_MEDIUM, Table,
    g_weights,
};
use physics::{Coefficients, DiffuseFresnel, ExitFactor, ForwardModel, Gradient, Trust};
use thiserror::Error;

/// The table that ships with beamspot.
const TABLE: &[u8] = include_bytes!("../../../data/transport.bin");

const COUNT: usize = LN_RADIUS.count;
const REFLECTANCE: usize = 0;
const WITHIN: usize = 1;
const BEYOND: usize = 2;
/// Behind the channels: the total and the slowest rate.
const TOTAL: usize = CHANNELS * COUNT;
const RATE: usize = TOTAL + 1;

/// There is no table for what was asked.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum OutOfTable {
    /// η is outside the table.
    #[error(
        "the transport table covers relative indices from {low} to {high}, got {found}; use the dipole"
    )]
    Eta {
        /// What was asked for.
        found: f64,
        /// Smallest index in the table.
        low: f64,
        /// Largest index in the table.
        high: f64,
    },
    /// g is outside the table.
    #[error(
        "the transport table covers mean cosines g from {low} to {high}, got {found}; give a g inside"
    )]
    G {
        /// What was asked for.
        found: f64,
        /// Smallest mean cosine in the table.
        low: f64,
        /// Largest mean cosine in the table.
        high: f64,
    },
    /// The bytes are not a table.
    #[error(transparent)]
    Bytes(#[from] BadTable),
}

/// Where a [`TransportModel`] is read from its table, and not continued from its edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    /// Smallest reduced albedo α′.
    pub least_albedo_prime: f64,
    /// Smallest radius, in units of 1/σₜ′.
    pub least_radius: f64,
    /// Largest radius, in units of 1/σₜ′.
    pub largest_radius: f64,
}

/// The transport equation of a half-space with a smooth boundary and Henyey and Greenstein's
/// phase function, at one relative index and one mean cosine g, for any σₐ and σₛ′.
///
/// This is what a photon random walk converges to and what the dipole approximates. It is read
/// from a table of ln(R_d / closed form) that [`crate::build`] fills without noise. Where to trust
/// it say [`Self::domain`] and [`Self::relative_error`]; outside, the table's edge is continued
/// (toward the beam as 1/r, far out and in blacker media as a constant ratio to
/// the closed form).
///
/// ```
/// use physics::{Coefficients, ForwardModel};
/// use transport::TransportModel;
///
/// // Giovanelli's half-space: 0.259919, of which 0.04 at the surface.
/// let model = TransportModel::new(1.5, 0.0)?;
/// let medium = Coefficients { sigma_a: 0.1, sigma_s_prime: 0.9 };
/// let total = model.within(medium, f64::INFINITY).value;
/// assert!((0.04 + 0.96 * total - 0.259919).abs() < 3e-5);
/// # Ok::<(), transport::OutOfTable>(())
/// ```
#[derive(Clone, Debug)]
pub struct TransportModel {
    eta: f64,
    g: f64,
    /// Internal reflection parameter A of the closed form.
    a: f64,
    /// By knot of k, then by column: the correction, its bend over ln ρ, its bend over k, and
    /// the bend over both.
    knots: Vec<[f64; 4]>,
}

impl TransportModel {
    /// The table at relative index `eta` and mean cosine `g`.
    ///
    /// # Errors
    ///
    /// [`OutOfTable`] where the table does not reach.
    pub fn new(eta: f64, g: f64) -> Result<Self, OutOfTable> {
        Self::from_table(TABLE, eta, g)
    }

    /// The same from the bytes of another table that [`crate::build`] made.
    ///
    /// # Errors
    ///
    /// [`OutOfTable`] where the table does not reach, or is none.
    pub fn from_table(bytes: &[u8], eta: f64, g: f64) -> Result<Self, OutOfTable> {
        check_eta(eta)?;
        check_g(g)?;
        Ok(Self {
            eta,
            g,
            a: DiffuseFresnel::Exact.a(eta),
            knots: knots(&Table::from_bytes(bytes)?.reduced(eta, g)),
        })
    }

    /// Mean cosine that the model was made for.
    pub fn g(&self) -> f64 {
        self.g
    }

    /// Where the values are the table's own.
    pub fn domain(&self) -> Domain {
        Domain {
            least_albedo_prime: 1.0 - K.last() * K.last() / 3.0,
            least_radius: LN_RADIUS.first.exp(),
            largest_radius: LN_RADIUS.last().exp(),
        }
    }

    fn at(&self, coefficients: Coefficients) -> Point<'_> {
        let t = coefficients.sigma_t_prime();
        let (a, s) = (coefficients.sigma_a, coefficients.sigma_s_prime);
        let k = (3.0 * a / t).sqrt();
        let inside = k.clamp(K.first, K.last());
        let (row, place) = K.locate(inside);
        let blend = Blend::at(place);
        let mut point = Point {
            model: self,
            row,
            blend,
            clamped: inside != k,
            sigma_t_prime: t,
            k,
            rate_by_k: 1.0,
            rate_slope: 0.0,
            reference: Reference::new(k, self.a),
            ln_albedo: (s / t).ln(),
            ln_albedo_in: [-1.0 / t, a / (s * t)],
            half_k2_in: [1.5 * s / (t * t), -1.5 * a / (t * t)],
        };
        let (ln_rate, slope) = point.knot(RATE);
        point.rate_by_k = ln_rate[0].exp();
        point.rate_slope = slope[0];
        point.reference = Reference::new(k * point.rate_by_k, self.a);
        point
    }
}

/// The models of one relative index at every mean cosine g, for a fit that lets g vary.
///
/// ```
/// use transport::{TransportFamily, TransportModel};
///
/// let family = TransportFamily::new(1.4)?;
/// assert_eq!(family.at(0.8)?.g(), TransportModel::new(1.4, 0.8)?.g());
/// # Ok::<(), transport::OutOfTable>(())
/// ```
#[derive(Clone, Debug)]
pub struct TransportFamily {
    eta: f64,
    a: f64,
    /// What a model has of knots, at each node of g: splines are linear in their values.
    nodes: Vec<Vec<[f64; 4]>>,
}

impl TransportFamily {
    /// The table at relative index `eta`.
    ///
    /// # Errors
    ///
    /// [`OutOfTable`] where the table does not reach.
    pub fn new(eta: f64) -> Result<Self, OutOfTable> {
        check_eta(eta)?;
        let table = Table::from_bytes(TABLE)?;
        Ok(Self {
            eta,
            a: DiffuseFresnel::Exact.a(eta),
            nodes: (0..G_COUNT)
                .map(|node| knots(&table.at_node(eta, node)))
                .collect(),
        })
    }

    /// The smallest and the largest g.
    pub fn range(&self) -> (f64, f64) {
        (LEAST_G, LARGEST_G)
    }

    /// The model at `g`, smooth in it; a tenth of a millisecond or so.
    ///
    /// # Errors
    ///
    /// [`OutOfTable`] where the table does not reach.
    pub fn at(&self, g: f64) -> Result<TransportModel, OutOfTable> {
        check_g(g)?;
        let mut knots = vec![[0.0; 4]; K.count * PER_MEDIUM];
        for (node, weight) in self.nodes.iter().zip(g_weights(g)) {
            for (knot, of_node) in knots.iter_mut().zip(node) {
                for (x, y) in knot.iter_mut().zip(of_node) {
                    *x += weight * y;
                }
            }
        }
        Ok(TransportModel {
            eta: self.eta,
            g,
            a: self.a,
            knots,
        })
    }
}

fn check_eta(eta: f64) -> Result<(), OutOfTable> {
    if (ETA.low..=ETA.high).contains(&eta) {
        return Ok(());
    }
    Err(OutOfTable::Eta {
        found: eta,
        low: ETA.low,
        high: ETA.high,
    })
}

fn check_g(g: f64) -> Result<(), OutOfTable> {
    if (LEAST_G..=LARGEST_G).contains(&g) {
        return Ok(());
    }
    Err(OutOfTable::G {
        found: g,
        low: LEAST_G,
        high: LARGEST_G,
    })
}

/// The corrections `values` of every column at every knot of k, with their bends.
fn knots(values: &[f64]) -> Vec<[f64; 4]> {
    let mut knots: Vec<[f64; 4]> = values.iter().map(|&y| [y, 0.0, 0.0, 0.0]).collect();
    let mut bends = vec![0.0; COUNT];
    for row in 0..K.count {
        for channel in 0..CHANNELS {
            let start = row * PER_MEDIUM + channel * COUNT;
            spline(&values[start..start + COUNT], &mut bends);
            for (knot, &bend) in knots[start..].iter_mut().zip(&bends) {
                knot[1] = bend;
            }
        }
    }
    let mut bends = vec![0.0; K.count];
    for column in 0..PER_MEDIUM {
        for part in 0..2 {
            let along: Vec<f64> = knots
                .iter()
                .skip(column)
                .step_by(PER_MEDIUM)
                .map(|knot| knot[part])
                .collect();
            spline(&along, &mut bends);
            for (knot, &bend) in knots
                .iter_mut()
                .skip(column)
                .step_by(PER_MEDIUM)
                .zip(&bends)
            {
                knot[2 + part] = bend;
            }
        }
    }
    knots
}

/// One medium: what all radii share.
struct Point<'a> {
    model: &'a TransportModel,
    row: usize,
    blend: Blend,
    /// k is outside the table.
    clamped: bool,
    sigma_t_prime: f64,
    k: f64,
    /// κ/k, and d ln(κ/k)/dk.
    rate_by_k: f64,
    rate_slope: f64,
    reference: Reference,
    ln_albedo: f64,
    /// Derivatives of ln α′ and k²/2 in (σₐ, σₛ′).
    ln_albedo_in: [f64; 2],
    half_k2_in: [f64; 2],
}

impl Point<'_> {
    /// A column at this k: the correction and its bend over ln ρ, and both differentiated in k.
    fn knot(&self, column: usize) -> Knot {
        let below = self.model.knots[self.row * PER_MEDIUM + column];
        let above = self.model.knots[(self.row + 1) * PER_MEDIUM + column];
        let mix = |w: &[f64; 4], part: usize| {
            w[0] * below[part]
                + w[1] * above[part]
                + w[2] * below[part + 2]
                + w[3] * above[part + 2]
        };
        let value = [mix(&self.blend.value, 0), mix(&self.blend.value, 1)];
        if self.clamped {
            return (value, [0.0; 2]);
        }
        let slope = [mix(&self.blend.slope, 0), mix(&self.blend.slope, 1)];
        (value, slope.map(|x| x / K.step))
    }

    /// The correction of a channel at `ln_radius`: value, ∂/∂ln ρ, ∂/∂k.
    fn correction(&self, channel: usize, ln_radius: f64) -> [f64; 3] {
        along(ln_radius, |panel| self.knot(channel * COUNT + panel))
    }

    /// Every knot of a channel at this k, for many radii.
    fn knots(&self, channel: usize) -> [Knot; COUNT] {
        std::array::from_fn(|panel| self.knot(channel * COUNT + panel))
    }

    /// `scale` times the exponential of closed form and correction, with derivatives; `powers`
    /// is the power of σₜ′ in `scale`.
    fn gradient(&self, log: Log, correction: [f64; 3], powers: i32) -> Gradient {
        let [ln, in_ln_radius, in_k] = correction;
        let value = (log.value + ln + self.ln_albedo).exp() * self.sigma_t_prime.powi(powers);
        // ρ = σₜ′r, so that what acts through ln ρ acts through ln σₜ′.
        let in_scale = (f64::from(powers) + log.in_ln_radius + in_ln_radius) / self.sigma_t_prime;
        // κ = k·(κ/k): d(κ²/2) stays finite per d(k²/2) where k vanishes.
        let in_half_k2 =
            log.in_rate_by_rate * self.rate_by_k.powi(2) * (1.0 + self.k * self.rate_slope)
                + if in_k == 0.0 { 0.0 } else { in_k / self.k };
        let derivative = |i: usize| {
            // σₐ = 0 leaves no way for σₛ′ to act through k, not even on the whole plane.
            let through_k = if self.half_k2_in[i] == 0.0 {
                0.0
            } else {
                in_half_k2 * self.half_k2_in[i]
            };
            value * (in_scale + self.ln_albedo_in[i] + through_k)
        };
        Gradient {
            value,
            in_sigma_a: derivative(0),
            in_sigma_s_prime: derivative(1),
        }
    }

    /// R_d at each of `radius`, in mm.
    fn reflectance(&self, radius: &[f64]) -> impl Iterator<Item = Gradient> {
        let knots = self.knots(REFLECTANCE);
        radius.iter().map(move |r| {
            let rho = self.sigma_t_prime * r;
            let correction = along(rho.ln(), |panel| knots[panel]);
            self.gradient(self.reference.ln_reflectance(rho), correction, 2)
        })
    }

    fn total(&self) -> Gradient {
        let (ln, in_k) = self.knot(TOTAL);
        self.gradient(self.reference.ln_total(), [ln[0], 0.0, in_k[0]], 0)
    }
}

/// A correction and its bend over ln ρ, and both differentiated in k.
type Knot = ([f64; 2], [f64; 2]);

/// The spline over ln ρ through the knots that `knot` gives by number, at `ln_radius`: value,
/// ∂/∂ln ρ, ∂/∂k. Beyond the last knot it stays.
///
/// Nearer than the first knot only light that scattered once counts in the end: exitance and the
/// light within, over their closed forms, go like 1/ρ, and what is left of the slope dies like ρ.
fn along(ln_radius: f64, knot: impl Fn(usize) -> Knot) -> [f64; 3] {
    let (panel, place) = LN_RADIUS.locate(ln_radius);
    let ([y0, b0], [y0k, b0k]) = knot(panel);
    let ([y1, b1], [y1k, b1k]) = knot(panel + 1);
    if place > 1.0 {
        return [y1, 0.0, y1k];
    }
    let mix = |w: &[f64; 4], y: [f64; 4]| w[0] * y[0] + w[1] * y[1] + w[2] * y[2] + w[3] * y[3];
    let blend = Blend::at(place.max(0.0));
    let (y, yk) = ([y0, y1, b0, b1], [y0k, y1k, b0k, b1k]);
    let slope = mix(&blend.slope, y) / LN_RADIUS.step;
    let (value, in_k) = (mix(&blend.value, y), mix(&blend.value, yk));
    if place >= 0.0 {
        return [value, slope, in_k];
    }
    let inward = place * LN_RADIUS.step;
    let left = inward.exp_m1();
    [
        value - inward + (slope + 1.0) * left,
        (slope + 1.0) * inward.exp() - 1.0,
        in_k + mix(&blend.slope, yk) / LN_RADIUS.step * left,
    ]
}

impl ForwardModel for TransportModel {
    /// It leaves out neither absorption nor the first scatterings: where its table is less sure,
    /// [`Self::relative_error`] says by how much.
    fn trust(&self) -> Trust {
        Trust {
            least_albedo_prime: 0.0,
            least_transport_lengths: 0.0,
        }
    }

    /// Relative standard error of R_d at `radius` mm, of solver and interpolation together, as
    /// measured against Monte Carlo simulations.
    ///
    /// From two mean free paths 1/σₜ outward it is 0.04 % in bright media. Within them the
    /// harmonics do not resolve light that scattered forward a few times: about 1 % at g = 0.95,
    /// 0.4 % at 0.8, nothing below 0.6. Nearer to the beam than some thousandths of 1/σₜ′ the
    /// continuation of the table is off by 0.5 to 1 %; below α′ = 0.2 the last percent of the light, far out, is
    /// interpolated no better than to some percent.
    fn relative_error(&self, coefficients: Coefficients, radius: f64) -> f64 {
        let rho = radius * coefficients.sigma_t_prime();
        let dark = 1.0 - coefficients.albedo_prime();
        let mean_free_paths =
            radius * (coefficients.sigma_a + coefficients.sigma_s_prime / (1.0 - self.g));
        // Coefficients that cover 8 media near the beam and 12 simulations, see `tests`; the 40
        // of the example `forty_media` judge them.
        let near = 1.0 / (1.0 + (mean_free_paths / 1.5).powi(2));
        let beam = 1.0 / (1.0 + (rho / 0.002).powi(2));
        let far = rho * rho / (rho * rho + 4.0);
        4e-4 + 2e-3 * dark * dark
            + near * (5e-4 + 0.014 * self.g.max(0.0).powi(6))
            + 0.007 * beam
            + far * 0.08 * dark.powi(8)
    }

    /// Solves the equation for this medium, which takes a second.
    ///
    /// Where g is above 0.8, what harmonics lack within a mean free path of the beam they lack in
    /// radiance and exitance alike, and part of it in their ratio.
    fn exit_factor(&self, coefficients: Coefficients, cos_view: f64) -> ExitFactor {
        let t = coefficients.sigma_t_prime();
        let least = K.first * K.first / 3.0;
        let interior = Interior::new((coefficients.sigma_a / t).clamp(least, 0.999), self.g);
        let exitance = Surface::new(self.eta).solve(&interior);
        let radiance = Surface::toward(self.eta, cos_view).solve(&interior);
        let radii: Vec<f64> = (0..COUNT)
            .map(|i| LN_RADIUS.at(i).exp())
            .take_while(|&r| r < exitance.farthest_radius())
            .collect();
        let factors = radiance
            .profile(&radii)
            .iter()
            .zip(exitance.profile(&radii))
            .map(|(seen, all)| (seen.ln_reflectance - all.ln_reflectance).exp())
            .collect();
        ExitFactor::by_radius(
            LN_RADIUS.first - t.ln(),
            LN_RADIUS.step,
            factors,
            radiance.at_beam(),
            (radiance.total() + radiance.at_beam()) / exitance.total(),
        )
    }

    fn name(&self) -> &'static str {
        "monte-carlo"
    }

    fn eta(&self) -> f64 {
        self.eta
    }

    fn diffuse_reflectance_gradient(
        &self,
        coefficients: Coefficients,
        radius: &[f64],
        out: &mut [Gradient],
    ) {
        let point = self.at(coefficients);
        for (out, reflectance) in out.iter_mut().zip(point.reflectance(radius)) {
            *out = reflectance;
        }
    }

    fn within(&self, coefficients: Coefficients, radius: f64) -> Gradient {
        let point = self.at(coefficients);
        let rho = point.sigma_t_prime * radius;
        if rho <= 0.0 {
            return Gradient::default();
        }
        if rho.is_infinite() {
            return point.total();
        }
        point.gradient(
            point.reference.ln_within(rho),
            point.correction(WITHIN, rho.ln()),
            0,
        )
    }

    fn beyond(&self, coefficients: Coefficients, radius: f64) -> f64 {
        let point = self.at(coefficients);
        let rho = point.sigma_t_prime * radius;
        if rho.is_infinite() {
            return 0.0;
        }
        if rho < self.domain().least_radius {
            return point.total().value - self.within(coefficients, radius).value;
        }
        let log = Log {
            value: point.reference.ln_beyond(rho),
            ..Log::default()
        };
        point
            .gradient(log, point.correction(BEYOND, rho.ln()), 0)
            .value
    }
}

//! The table: what the solver says, as a correction to a closed form, for every medium.

use crate::grid::{Knots, Nodes};
use crate::reference::Reference;
use crate::solver::{At, Interior, Surface};
use physics::DiffuseFresnel;
use thiserror::Error;

/// First bytes of a table's file, with the version of its layout.
const MAGIC: &[u8; 8] = b"BSTRANS2";

/// Relative index, nodes of a polynomial.
pub(crate) const ETA: Nodes = Nodes {
    low: 1.0,
    high: 1.6,
    count: 9,
};
/// Smallest and largest mean cosine.
pub(crate) const LEAST_G: f64 = -0.3;
pub(crate) const LARGEST_G: f64 = 0.95;
/// Nodes of the mean cosine.
pub(crate) const G_COUNT: usize = 12;
/// √(3(1 − α′)), knots of a spline. Its lower end stands for no absorption at all.
pub(crate) const K: Knots = Knots {
    first: 0.002,
    step: 0.0714,
    count: 25,
};
/// ln of the radius in units of 1/σₜ′, knots of a spline.
pub(crate) const LN_RADIUS: Knots = Knots {
    first: -5.3,
    step: 0.2,
    count: 67,
};

/// What is kept over the radius: reflectance, the light within and the light beyond.
pub(crate) const CHANNELS: usize = 3;
/// Values of one medium: the logarithms of reflectance, of the light within and beyond every
/// radius, each less that of the closed form; then those of the total and of the slowest rate
/// over k.
pub(crate) const PER_MEDIUM: usize = CHANNELS * LN_RADIUS.count + 2;

/// Why bytes are not a table.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum BadTable {
    /// The file does not begin as a table of this version does.
    #[error(
        "a transport table begins with `BSTRANS2`; rebuild it with the command in data/README.md"
    )]
    Version,
    /// The file is shorter or longer than its grid.
    #[error(
        "a transport table of this version has {expected} bytes, got {found}; rebuild it with the command in data/README.md"
    )]
    Size {
        /// Bytes that were found.
        found: usize,
        /// Bytes that the grid takes.
        expected: usize,
    },
}

/// The corrections of every node, by η, then g, then k.
pub(crate) struct Table<'a> {
    bytes: &'a [u8],
}

/// Forwardness −ln(1 − g), nodes of a polynomial.
///
/// At one σₛ′ the mean free path goes with 1 − g, and with it every length near the beam: over g
/// itself a polynomial through as many nodes is off by percents there.
fn forwardness() -> Nodes {
    Nodes {
        low: -(1.0 - LEAST_G).ln(),
        high: -(1.0 - LARGEST_G).ln(),
        count: G_COUNT,
    }
}

/// The mean cosine of node number `node`.
fn g_at(node: usize) -> f64 {
    1.0 - (-forwardness().at(node)).exp()
}

/// The weight of every node of the mean cosine in a value at `g`.
pub(crate) fn g_weights(g: f64) -> Vec<f64> {
    forwardness().weights(-(1.0 - g).ln())
}

impl<'a> Table<'a> {
    /// A table in the bytes of its file.
    pub(crate) fn from_bytes(bytes: &'a [u8]) -> Result<Self, BadTable> {
        let expected = MAGIC.len() + 4 * ETA.count * G_COUNT * K.count * PER_MEDIUM;
        if !bytes.starts_with(MAGIC) {
            return Err(BadTable::Version);
        }
        if bytes.len() != expected {
            return Err(BadTable::Size {
                found: bytes.len(),
                expected,
            });
        }
        Ok(Self {
            bytes: &bytes[MAGIC.len()..],
        })
    }

    /// The corrections at one η and g for every node of k.
    pub(crate) fn reduced(&self, eta: f64, g: f64) -> Vec<f64> {
        self.mixed(eta, &g_weights(g))
    }

    /// The corrections at one η and the node number `node` of g, for every node of k.
    pub(crate) fn at_node(&self, eta: f64, node: usize) -> Vec<f64> {
        let mut weights = vec![0.0; G_COUNT];
        weights[node] = 1.0;
        self.mixed(eta, &weights)
    }

    fn mixed(&self, eta: f64, g_weights: &[f64]) -> Vec<f64> {
        let eta_weights = ETA.weights(eta);
        let row = K.count * PER_MEDIUM;
        let mut out = vec![0.0; row];
        let rows = self.bytes.chunks_exact(4 * row);
        let weights = eta_weights
            .iter()
            .flat_map(|a| g_weights.iter().map(move |b| a * b));
        for (bytes, weight) in rows.zip(weights).filter(|(_, weight)| *weight != 0.0) {
            for (x, bytes) in out.iter_mut().zip(bytes.as_chunks::<4>().0) {
                *x += weight * f64::from(f32::from_le_bytes(*bytes));
            }
        }
        out
    }
}

/// What the table holds of one medium, straight from the solver.
pub(crate) fn corrections(surface: &Surface, interior: &Interior, k: f64) -> Vec<f64> {
    let solution = surface.solve(interior);
    let rate = solution.slowest_rate();
    let reference = Reference::new(rate, DiffuseFresnel::Exact.a(surface.eta()));
    let ln_albedo = (1.0 - k * k / 3.0).ln();
    let radii: Vec<f64> = (0..LN_RADIUS.count)
        .map(|i| LN_RADIUS.at(i).exp())
        .collect();
    // Farther out the correction stays as it is.
    let far = radii
        .partition_point(|&r| r < solution.farthest_radius())
        .max(1);
    let profile = solution.profile(&radii[..far]);
    let mut out = Vec::with_capacity(PER_MEDIUM);
    let mut channel = |of: &dyn Fn(f64, &At) -> f64| {
        let known = radii
            .iter()
            .zip(&profile)
            .map(|(&r, at)| of(r, at) - ln_albedo);
        out.extend(known);
        let last = out[out.len() - 1];
        let first = out.len() - far;
        out.resize(first + LN_RADIUS.count, last);
        // Where the solver's near field fails, the power law from farther out goes on.
        let channel = &mut out[first..];
        for i in (0..LN_RADIUS.count - 2).rev() {
            if !channel[i].is_finite() {
                channel[i] = 2.0 * channel[i + 1] - channel[i + 2];
            }
        }
    };
    channel(&|r, at| at.ln_reflectance - reference.ln_reflectance(r).value);
    channel(&|r, at| at.ln_within - reference.ln_within(r).value);
    channel(&|r, at| at.ln_beyond - reference.ln_beyond(r));
    out.push(solution.total().ln() - reference.ln_total().value - ln_albedo);
    out.push((rate / k).ln());
    out
}

/// Computes the whole table; `progress` hears the share that is done.
pub fn build(mut progress: impl FnMut(f64)) -> Vec<u8> {
    let surfaces: Vec<Surface> = (0..ETA.count).map(|i| Surface::new(ETA.at(i))).collect();
    let mut values = vec![0.0_f32; ETA.count * G_COUNT * K.count * PER_MEDIUM];
    for j in 0..G_COUNT {
        for l in 0..K.count {
            let k = K.at(l);
            let interior = Interior::new(k * k / 3.0, g_at(j));
            for (i, surface) in surfaces.iter().enumerate() {
                let start = ((i * G_COUNT + j) * K.count + l) * PER_MEDIUM;
                let row = &mut values[start..start + PER_MEDIUM];
                for (x, value) in row.iter_mut().zip(corrections(surface, &interior, k)) {
                    *x = value as f32;
                }
            }
            progress((j * K.count + l + 1) as f64 / (G_COUNT * K.count) as f64);
        }
    }
    let mut bytes = MAGIC.to_vec();
    bytes.extend(values.into_iter().flat_map(f32::to_le_bytes));
    bytes
}

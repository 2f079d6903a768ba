//! A medium in the solver's own units, its phase function cut off and its modes found.

use super::harmonics::streaming;
use nalgebra::DMatrix;

/// Moments are scaled back where they grow beyond this.
const LARGE: f64 = 1e100;

/// A homogeneous medium whose lengths are in units of 1/σₜ*, the mean free path that is left
/// when scattering into the forward peak does not count (delta-M, Wiscombe 1977).
///
/// The moments of Henyey and Greenstein's phase function beyond `order` all become those of a
/// delta function of weight g^(order + 1).
#[derive(Clone, Debug)]
pub(crate) struct ScaledMedium {
    /// σₜ*/σₜ′.
    pub(crate) extinction: f64,
    /// Scattering albedo times the phase function's moments, l from 0 to `order`.
    pub(crate) scattering: Vec<f64>,
    /// 1 less `scattering`.
    pub(crate) removal: Vec<f64>,
    /// The albedo that goes with the uncut phase function, σₛ/σₜ*.
    pub(crate) single_albedo: f64,
}

impl ScaledMedium {
    /// `absorption` is 1 − α′, in (0, 1]; `order` is odd.
    pub(crate) fn new(absorption: f64, g: f64, order: usize) -> Self {
        let scattering = (1.0 - absorption) / (1.0 - g);
        let peak = g.powi(order as i32 + 1);
        let left = scattering * (1.0 - peak);
        let extinction = absorption + left;
        let moment = |l: usize| (g.powi(l as i32) - peak) / (1.0 - peak);
        let albedo = left / extinction;
        Self {
            extinction,
            scattering: (0..=order).map(|l| albedo * moment(l)).collect(),
            removal: (0..=order)
                .map(|l| (absorption + left * (1.0 - moment(l))) / extinction)
                .collect(),
            single_albedo: scattering / extinction,
        }
    }
}

/// A solution of the transport equation that decays along one axis like e^(−x/ν) and has one
/// azimuthal order about it.
#[derive(Clone, Debug)]
pub(crate) struct Mode {
    pub(crate) azimuth: usize,
    /// Decay length ν.
    pub(crate) length: f64,
    /// Coefficients of Y_lM about the axis, l from M to the order.
    pub(crate) moments: Vec<f64>,
}

/// Every mode that decays along the positive axis, of azimuthal orders up to `azimuths`.
pub(crate) fn modes(medium: &ScaledMedium, azimuths: usize) -> Vec<Mode> {
    let order = medium.removal.len() - 1;
    let mut modes = Vec::new();
    for azimuth in 0..=azimuths {
        let size = order + 1 - azimuth;
        let mut matrix = DMatrix::zeros(size, size);
        for i in 1..size {
            let l = azimuth + i;
            let coupling = streaming(l as f64, azimuth as f64)
                / (medium.removal[l] * medium.removal[l - 1]).sqrt();
            matrix[(i, i - 1)] = coupling;
            matrix[(i - 1, i)] = coupling;
        }
        let mut lengths: Vec<f64> = matrix.symmetric_eigenvalues().iter().copied().collect();
        lengths.sort_by(|a, b| b.total_cmp(a));
        // The spectrum is even: ±ν, and a zero where the size is odd.
        lengths.truncate(size / 2);
        modes.extend(lengths.into_iter().map(|length| Mode {
            azimuth,
            length,
            moments: moments(medium, azimuth, length),
        }));
    }
    modes
}

/// The rate of the mode that decays most slowly.
pub(crate) fn slowest_rate(medium: &ScaledMedium) -> f64 {
    1.0 / modes(medium, 0)
        .iter()
        .fold(0.0, |longest, mode| mode.length.max(longest))
}

/// The eigenvector that belongs to `length`, by recurrence from the highest order down.
///
/// Its high moments fall like (1/ν)^l, and the rotation of a plane wave with a steep transverse
/// frequency makes up for it: they must be right to their last digit, however small, which the
/// vector from an eigenvalue routine is not. Downward the recurrence grows, so errors do not.
fn moments(medium: &ScaledMedium, azimuth: usize, length: f64) -> Vec<f64> {
    let size = medium.removal.len() - azimuth;
    let coupling = |i: usize| streaming((azimuth + i) as f64, azimuth as f64);
    let mut moments = vec![0.0; size];
    moments[size - 1] = 1.0;
    for i in (1..size).rev() {
        let above = if i + 1 < size {
            coupling(i + 1) * moments[i + 1]
        } else {
            0.0
        };
        moments[i - 1] = (length * medium.removal[azimuth + i] * moments[i] - above) / coupling(i);
        if moments[i - 1].abs() > LARGE {
            moments.iter_mut().for_each(|x| *x /= LARGE);
        }
    }
    moments
}

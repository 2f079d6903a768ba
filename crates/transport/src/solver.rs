//! The transport equation of a half-space under a pencil beam, solved without noise.
//!
//! Light that scattered once is an integral over the direction of exit ([`single`]). The rest is
//! solved in transverse spatial frequency q by spherical harmonics (P_N) with Marshak's
//! conditions for a Fresnel boundary: its moments are a sum of modes ([`medium`], [`spectrum`])
//! that an eigenvalue problem without q gives, each turned into its complex direction
//! ([`harmonics`]). Where q is too steep for modes, the decaying fields come from a matrix square
//! root ([`steep`]). The light that leaves is the source function of those moments integrated
//! along each direction of exit, not the sum of harmonics at the boundary, whose convergence
//! is poor.
//!
//! The way back to radii runs along q = κ sinh(y + iπ/4), beside the cut of the spectrum that
//! starts at iκ: nothing oscillates there, forty nodes serve every radius, and the tail has
//! relative precision ([`solution`]).
//!
//! # Source
//!
//! The modes and their rotation: Markel (2004) and Liemert and Kienle (2013), *Exact and efficient
//! solution of the radiative transport equation for the semi-infinite medium*.

mod bessel;
mod boundary;
mod harmonics;
mod lu;
mod medium;
mod single;
mod solution;
mod spectrum;
mod steep;
mod tail;

use medium::ScaledMedium;
use nalgebra::Complex;
use single::Single;
pub use solution::{At, Solution};
use spectrum::{Boundary, Spectrum};
use std::f64::consts::FRAC_PI_4;
use steep::Decaying;
use tail::Tail;

type C = Complex<f64>;

/// Spacing of the contour's nodes: the trapezoidal rule is off by e^(−2π·(π/4)/step).
const STEP: f64 = 0.165;
/// No radius of interest asks for frequencies beyond this, in 1/σₜ*.
const END_FREQUENCY: f64 = 1e5;
/// Up to this frequency, in 1/σₜ*, modes are told apart in double precision.
const GENTLE_FREQUENCY: f64 = 1.0;
/// Up to this frequency times √(1 − g) the harmonics suffice: the more forward the scattering,
/// the sharper is the field of light that scattered once.
const STEEPEST_FREQUENCY: f64 = 6.0;
/// What harmonics of this order resolve however forward the scattering. At 2.8 the field of a beam
/// that scatters with g = 0.95 is off by a tenth within a mean free path, at 2 by 4 %.
const LEAST_STEEPEST_FREQUENCY: f64 = 2.4;

/// Up to this frequency, in 1/σₜ*, the field hardly depends on the azimuth: its order m falls like
/// the m-th power of the frequency, and these orders do.
const SMOOTH_FREQUENCY: f64 = 0.1;
const SMOOTH_AZIMUTHS: usize = 8;

/// Orders of the spherical harmonics: of the solution, and of the one without transverse
/// variation that gives the total.
const FINE_ORDER: usize = 21;
const FLAT_ORDER: usize = 201;

fn frequency(rate: f64, i: usize) -> C {
    C::new(STEP * i as f64, FRAC_PI_4).sinh() * rate
}

/// What goes on inside one medium, whatever its boundary.
pub struct Interior {
    g: f64,
    fine: ScaledMedium,
    flat: ScaledMedium,
    rate: f64,
    gentle: usize,
    steep: Vec<Decaying>,
}

impl Interior {
    /// The medium with 1 − α′ = `absorption`, in (0, 1), and mean cosine `g`, in (−1, 1).
    pub fn new(absorption: f64, g: f64) -> Self {
        let scaled = |order| ScaledMedium::new(absorption, g, order);
        let fine = scaled(FINE_ORDER);
        let rate = medium::slowest_rate(&fine);
        let below = |limit: f64| {
            (0..)
                .take_while(|&i| frequency(rate, i).norm() < limit)
                .count()
        };
        let gentle = below(GENTLE_FREQUENCY).max(3);
        let layout = harmonics::Layout::new(FINE_ORDER, FINE_ORDER);
        let steepest = STEEPEST_FREQUENCY * (1.0 - g.max(0.0)).sqrt();
        let steep = (gentle..below(steepest.max(LEAST_STEEPEST_FREQUENCY)))
            .map_while(|i| Decaying::new(&layout, &fine.removal, frequency(rate, i)))
            .collect();
        Self {
            g,
            flat: scaled(FLAT_ORDER),
            fine,
            rate,
            gentle,
            steep,
        }
    }
}

/// A smooth boundary at one relative index, for any medium below it.
pub struct Surface {
    eta: f64,
    /// Cosine inside of the direction in which light is seen, if it is not exitance.
    toward: Option<f64>,
    smooth: Boundary,
    fine: Boundary,
    flat: Boundary,
}

impl Surface {
    /// The boundary at relative index `eta`, at least 1.
    pub fn new(eta: f64) -> Self {
        Self::seen(eta, None)
    }

    /// The same boundary before a camera that sees along the cosine `cos_view`, outside, with the
    /// normal: every exitance of its [`Solution`] becomes π·radiance, averaged over the azimuth.
    pub fn toward(eta: f64, cos_view: f64) -> Self {
        let mu = physics::fresnel::refracted_cos(eta, cos_view).unwrap_or(1.0);
        Self::seen(eta, Some(mu))
    }

    fn seen(eta: f64, toward: Option<f64>) -> Self {
        Self {
            eta,
            toward,
            smooth: Boundary::new(eta, FINE_ORDER, SMOOTH_AZIMUTHS, toward),
            fine: Boundary::new(eta, FINE_ORDER, FINE_ORDER, toward),
            flat: Boundary::new(eta, FLAT_ORDER, 0, toward),
        }
    }

    /// Relative index.
    pub fn eta(&self) -> f64 {
        self.eta
    }

    /// The reflectance of the half-space that has this `interior` below this surface.
    pub fn solve(&self, interior: &Interior) -> Solution {
        let Interior { g, rate, .. } = *interior;
        let smooth = Spectrum::new(&self.smooth, &interior.fine);
        let fine = Spectrum::new(&self.fine, &interior.fine);
        let flat = Spectrum::new(&self.flat, &interior.flat);
        let once = |medium: &ScaledMedium| match self.toward {
            None => Single::new(self.eta, g, medium.single_albedo),
            Some(mu) => Single::toward(self.eta, g, medium.single_albedo, mu),
        };
        let single = once(&interior.fine);
        let zero = C::default();
        let total = flat.at(zero).re + once(&interior.flat).beyond(0.0);
        // The harmonics lack some 1e-4 of the light at every frequency that matters; the total
        // is exact. (Led on from two orders frequency by frequency they err by percents near the
        // beam where scattering is forward.)
        let scale = (total - single.beyond(0.0)) / smooth.at(zero).re;

        let mut solved: Vec<(C, C)> = (0..interior.gentle)
            .map(|i| frequency(rate, i))
            .map(|q| {
                let spectrum = if q.norm() < SMOOTH_FREQUENCY {
                    &smooth
                } else {
                    &fine
                };
                (q, spectrum.at(q) * scale)
            })
            .collect();
        solved.extend(
            interior
                .steep
                .iter()
                .map(|fields| (fields.frequency(), fine.at_steep(fields) * scale)),
        );
        let tail = Tail::fit(&solved);
        let beyond = (solved.len()..).map(|i| frequency(rate, i));
        solved.extend(
            beyond
                .take_while(|q| q.norm() < END_FREQUENCY)
                .map(|q| (q, tail.at(q))),
        );
        let nodes = solved
            .into_iter()
            .enumerate()
            .map(|(i, (q, value))| {
                // The left half of the contour is the mirror image: its first node counts half.
                let step = if i == 0 { 0.5 * STEP } else { STEP };
                (
                    q,
                    value * C::new(STEP * i as f64, FRAC_PI_4).cosh() * rate * step,
                )
            })
            .collect();
        Solution {
            extinction: interior.fine.extinction,
            single,
            rate,
            nodes,
            total,
        }
    }
}

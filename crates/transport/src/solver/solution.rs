//! From frequencies back to radii.

use super::bessel::k0_k1;
use super::single::Single;
use gauss_quad::GaussLegendre;
use nalgebra::Complex;
use std::f64::consts::PI;
use std::num::NonZeroUsize;

type C = Complex<f64>;

/// Radius below which the light within is summed from the beam outward, 1/σₜ′.
const NEAR_RADIUS: f64 = 1.0;
/// Steps of e from the first radius inward over which the light within is summed.
const INNERMOST: f64 = 7.0;
/// Decay e^(−κr) to which the sum over the contour holds, as κr.
const FARTHEST_DECAY: f64 = 18.5;

/// The diffuse reflectance of one medium, per entering power; radii in units of 1/σₜ′.
pub struct Solution {
    /// σₜ*/σₜ′.
    pub(super) extinction: f64,
    pub(super) single: Single,
    /// Slowest rate of decay, per 1/σₜ*.
    pub(super) rate: f64,
    /// Frequencies on the contour, and the spectrum there times weight.
    pub(super) nodes: Vec<(C, C)>,
    pub(super) total: f64,
}

/// One radius of a [`Solution`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct At {
    /// ln of the exitance, in units of σₜ′².
    pub ln_reflectance: f64,
    /// ln of what leaves nearer to the beam.
    pub ln_within: f64,
    /// ln of what leaves farther out.
    pub ln_beyond: f64,
}

impl Solution {
    /// Everything that leaves.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Of light seen toward a camera, the part at the very point where the beam enters, which
    /// neither the total nor the profile holds.
    pub fn at_beam(&self) -> f64 {
        self.single.at_beam
    }

    /// The rate κ of the slowest mode: far out R_d falls like e^(−κr)/r², per 1/σₜ′.
    pub fn slowest_rate(&self) -> f64 {
        self.rate * self.extinction
    }

    /// Beyond this radius, in 1/σₜ′, the light is less than the contour can tell.
    pub fn farthest_radius(&self) -> f64 {
        FARTHEST_DECAY / self.slowest_rate()
    }

    /// Exitance at `radius`, and what leaves beyond it, both times e^(κ · radius).
    fn grown(&self, radius: f64) -> (f64, f64) {
        let r = radius * self.extinction;
        let growth = self.rate * r;
        let (mut exitance, mut beyond) = (0.0, 0.0);
        for &(q, value) in &self.nodes {
            let w = C::new(0.0, -r) * q;
            if w.re > growth + 45.0 {
                break;
            }
            // H₀(qr) = 2/(πi) K₀(−iqr); its integral over the plane outside has K₁.
            let (k0, k1) = k0_k1(w, growth);
            exitance += (value * q * k0 * C::new(0.0, -2.0 / PI)).re;
            beyond += (value * k1).re;
        }
        let growth = growth.exp();
        (
            self.extinction.powi(2) * (exitance / (2.0 * PI) + self.single.reflectance(r) * growth),
            2.0 * r / PI * beyond + self.single.beyond(r) * growth,
        )
    }

    /// What leaves beyond `radius`.
    pub fn beyond(&self, radius: f64) -> f64 {
        if radius == 0.0 {
            return self.total;
        }
        self.grown(radius).1 * (-self.slowest_rate() * radius).exp()
    }

    /// The profile at radii that rise by steps of a fifth or so, up to
    /// [`Self::farthest_radius`].
    pub fn profile(&self, radii: &[f64]) -> Vec<At> {
        let rate = self.slowest_rate();
        let rule = GaussLegendre::new(NonZeroUsize::new(3).expect("3 is not zero"));
        let density = |ln_r: f64| {
            let r = ln_r.exp();
            2.0 * PI * r * r * self.grown(r).0 * (-rate * r).exp()
        };
        // Near the beam the light within is the sum of the exitance: as the total less what
        // leaves beyond it would be lost in their rounding.
        let mut near = Vec::new();
        let mut sum = 0.0;
        let mut last = f64::NEG_INFINITY;
        for &r in radii.iter().take_while(|&&r| r < NEAR_RADIUS) {
            let ln_r = r.ln();
            if last == f64::NEG_INFINITY {
                // Nearest to the beam the exitance is ∝ 1/r; what scattered twice, ∝ ln 1/r,
                // is a percent of it at the first radius of the table.
                last = ln_r - INNERMOST;
                sum = density(last);
                while last < ln_r - 1.0 {
                    sum += rule.integrate(last, last + 1.0, density);
                    last += 1.0;
                }
            }
            sum += rule.integrate(last, ln_r, density);
            near.push(sum);
            last = ln_r;
        }
        // What the near field lacks to the exact total is spread evenly over it.
        let missing = near.last().map_or(0.0, |sum| {
            let r = radii[near.len() - 1];
            (self.total - self.beyond(r) - sum) / (r * r)
        });
        radii
            .iter()
            .enumerate()
            .map(|(i, &r)| {
                let (reflectance, beyond) = self.grown(r);
                let within = match near.get(i) {
                    Some(sum) => sum + missing * r * r,
                    None => self.total - beyond * (-rate * r).exp(),
                };
                At {
                    ln_reflectance: reflectance.ln() - rate * r,
                    ln_within: within.ln(),
                    ln_beyond: beyond.ln() - rate * r,
                }
            })
            .collect()
    }
}

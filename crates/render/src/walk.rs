//! The random walk of a photon inside a solid: what both directions of transport share.
//!
//! A photon flies by the scattering coefficient alone; absorption is a weight that falls along
//! the way. Nothing limits the number of scatterings, and roulette takes only photons that hardly
//! weigh anything, and lets the survivors stand for them.

use crate::Vec3;
use crate::boundary::part;
use crate::shape::{Hit, Shape, Solid};
use physics::Medium;
use physics::random::{Stream, uniform};
use std::ops::ControlFlow;

/// A photon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Where it is.
    pub at: Vec3,
    /// Where it goes.
    pub direction: Vec3,
    /// −ln of its weight.
    pub depth: f64,
}

/// How a walk ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// The photon, as it is now, left through the surface.
    Left(Hit),
    /// Roulette took it, or the visitor had seen enough.
    Stopped,
    /// It fell through a hole of a mesh that is not closed.
    Lost,
}

/// Depth from which roulette is played: a weight of 1e-4.
const ROULETTE_DEPTH: f64 = 9.2;
/// Share that survives it, ten times as heavy.
const SURVIVAL: f64 = 0.1;

/// Walks from just inside the surface until the photon has left.
///
/// `visit` sees the photon at each scattering, before it is turned.
pub fn wander(
    shape: &Shape,
    medium: &Medium,
    photon: &mut Photon,
    rng: &mut Stream,
    visit: &mut impl FnMut(&Photon) -> ControlFlow<()>,
) -> End {
    match shape {
        Shape::HalfSpace(s) => within(s, medium, photon, rng, visit),
        Shape::Block(s) => within(s, medium, photon, rng, visit),
        Shape::Sphere(s) => within(s, medium, photon, rng, visit),
        Shape::Mesh(s) => within(s.as_ref(), medium, photon, rng, visit),
    }
}

#[inline]
fn within<S: Solid>(
    solid: &S,
    medium: &Medium,
    photon: &mut Photon,
    rng: &mut Stream,
    visit: &mut impl FnMut(&Photon) -> ControlFlow<()>,
) -> End {
    let &Medium {
        sigma_a,
        sigma_s,
        g,
        eta,
    } = medium;
    let mean_free_path = 1.0 / sigma_s;
    // What is left of a ball around the photon in which there is no surface.
    let mut clear = 0.0;
    loop {
        let free = -(1.0 - uniform(rng)).ln() * mean_free_path;
        if free >= clear {
            clear = solid.clearance(photon.at);
            if free >= clear {
                if clear == f64::NEG_INFINITY {
                    return End::Lost;
                }
                if let Some(hit) = solid.leave(photon.at, photon.direction, free) {
                    photon.at += hit.distance * photon.direction;
                    photon.depth += sigma_a * hit.distance;
                    clear = 0.0;
                    let parting = part(photon.direction, hit.normal, 1.0 / eta);
                    if parting.reflectance >= 1.0 || uniform(rng) < parting.reflectance {
                        photon.direction = parting.reflected;
                        continue;
                    }
                    photon.direction = parting.refracted;
                    return End::Left(hit);
                }
                if free == f64::INFINITY {
                    return End::Lost;
                }
            }
        }
        photon.at += free * photon.direction;
        photon.depth += sigma_a * free;
        clear -= free;
        if visit(photon).is_break() {
            return End::Stopped;
        }
        photon.direction = scatter(photon.direction, g, rng);
        if photon.depth > ROULETTE_DEPTH {
            if uniform(rng) >= SURVIVAL {
                return End::Stopped;
            }
            photon.depth += SURVIVAL.ln();
        }
    }
}

/// A new direction after a scattering by Henyey and Greenstein's phase function.
#[inline]
fn scatter(direction: Vec3, g: f64, rng: &mut Stream) -> Vec3 {
    // Marsaglia (1972): a point of the unit disk holds an even number, the square of its radius,
    // and an even azimuth that does not depend on it.
    let (x, y, xi) = loop {
        let x = 2.0 * uniform(rng) - 1.0;
        let y = 2.0 * uniform(rng) - 1.0;
        let square = x * x + y * y;
        if square < 1.0 && square > 0.0 {
            break (x, y, square);
        }
    };
    if g == 0.0 {
        let r = 2.0 * (1.0 - xi).sqrt();
        return Vec3::new(x * r, y * r, 1.0 - 2.0 * xi);
    }
    let turn = physics::Phase::HenyeyGreenstein { g }.one_minus_cos(xi);
    let sin = (turn * (2.0 - turn)).max(0.0).sqrt() / xi.sqrt();
    let (u, v) = direction.any_orthonormal_pair();
    ((1.0 - turn) * direction + sin * x * u + sin * y * v).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::random::stream;

    /// Mean cosine g, and its square (1 + 2g²)/3 by the second Legendre moment.
    #[test]
    fn scattering_has_the_moments_of_its_phase_function() {
        for g in [0.0, 0.6, -0.3] {
            let mut rng = stream(3, &[]);
            let start = Vec3::new(0.3, -0.5, 0.2).normalize();
            let n = 400_000;
            let (mut first, mut second) = (0.0, 0.0);
            for _ in 0..n {
                let c = scatter(start, g, &mut rng).dot(start);
                first += c;
                second += c * c;
            }
            let (first, second) = (first / f64::from(n), second / f64::from(n));
            // Three standard errors and a half of means of numbers below 1.
            assert!((first - g).abs() < 3.5e-3, "{g}: {first}");
            let expected = (1.0 + 2.0 * g * g) / 3.0;
            assert!((second - expected).abs() < 2.5e-3, "{g}: {second}");
        }
    }
}

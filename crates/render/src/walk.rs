//! The random walk of a photon inside a solid: what both directions of transport share.
//!
//! A photon flies by the scattering coefficient alone; absorption is a weight that falls along
//! the way. Nothing limits the number of scatterings, and roulette takes only photons that hardly
//! weigh anything, and lets the survivors stand for them.

use crate::Vec3;
use crate::boundary::part;
use crate::leap::Leaps;
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

/// Further depth from which roulette is played, unless the visitor sees to it: a weight of 1e-4.
pub const ROULETTE_DEPTH: f64 = 9.2;
/// Share that survives it, ten times as heavy.
const SURVIVAL: f64 = 0.1;

/// Who watches a walk.
pub trait Visitor {
    /// The photon has come to a scattering and is not turned yet; its weight may be changed.
    /// `in_ball` says that it is on a way for which [`Self::leaps`] said no.
    fn scatters(&mut self, photon: &mut Photon, in_ball: bool, rng: &mut Stream)
    -> ControlFlow<()>;

    /// Radius of a ball around a point in which scatterings may go unseen.
    fn unseen(&self, _at: Vec3) -> f64 {
        f64::INFINITY
    }

    /// The photon has scattered so often unseen.
    fn leapt(&mut self, scatterings: u32);

    /// Whether the photon may leave a ball of this radius at once. If not, it walks.
    fn leaps(&mut self, _photon: &Photon, _radius: f64) -> bool {
        true
    }
}

/// What a photon walks in.
pub struct Ground<'a> {
    /// Around it.
    pub shape: &'a Shape,
    /// In it.
    pub medium: &'a Medium,
    /// Long ways at once.
    pub leaps: &'a mut Leaps,
    /// Depth from which it plays roulette for its life.
    pub roulette: f64,
}

/// Walks from just inside the surface until the photon has left.
pub fn wander(
    ground: Ground<'_>,
    photon: &mut Photon,
    rng: &mut Stream,
    visitor: &mut impl Visitor,
) -> End {
    match ground.shape {
        Shape::HalfSpace(s) => within(s, ground, photon, rng, visitor),
        Shape::Block(s) => within(s, ground, photon, rng, visitor),
        Shape::Sphere(s) => within(s, ground, photon, rng, visitor),
        Shape::Mesh(s) => within(s.as_ref(), ground, photon, rng, visitor),
    }
}

#[inline]
fn within<S: Solid>(
    solid: &S,
    ground: Ground<'_>,
    photon: &mut Photon,
    rng: &mut Stream,
    visitor: &mut impl Visitor,
) -> End {
    let Ground {
        leaps, roulette, ..
    } = ground;
    let &Medium {
        sigma_a,
        sigma_s,
        g,
        eta,
    } = ground.medium;
    let mean_free_path = 1.0 / sigma_s;
    let least = leaps.radius(0);
    // What is left of a ball around the photon in which there is no surface.
    let mut clear = 0.0;
    // The ball that the photon was not let out of at once.
    let mut ball: Option<(Vec3, f64)> = None;
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
        ball = ball.filter(|(center, square)| (photon.at - center).length_squared() < *square);
        if visitor.scatters(photon, ball.is_some(), rng).is_break() {
            return End::Stopped;
        }
        photon.direction = scatter(photon.direction, g, rng);
        if photon.depth > roulette && !survives(photon, rng) {
            return End::Stopped;
        }
        if ball.is_some() {
            continue;
        }
        let reach = visitor.unseen(photon.at);
        if reach < least {
            continue;
        }
        clear = solid.clearance(photon.at);
        if let Some(size) = leaps.within(reach.min(clear)) {
            let radius = leaps.radius(size);
            if visitor.leaps(photon, radius) {
                visitor.leapt(leaps.leap(size, photon, rng));
                clear -= radius;
            } else {
                ball = Some((photon.at, radius * radius));
            }
        }
    }
}

/// Plays roulette for a photon's life.
pub(crate) fn survives(photon: &mut Photon, rng: &mut Stream) -> bool {
    photon.depth += SURVIVAL.ln();
    uniform(rng) < SURVIVAL
}

/// Walks on from the middle of a ball that holds no surface to where the photon leaves it; `false`
/// if the visitor had seen enough.
pub(crate) fn through_ball(
    medium: &Medium,
    radius: f64,
    photon: &mut Photon,
    rng: &mut Stream,
    visitor: &mut impl Visitor,
) -> bool {
    let center = photon.at;
    loop {
        let free = -(1.0 - uniform(rng)).ln() / medium.sigma_s;
        let out = way_out(photon.at - center, photon.direction, radius);
        let length = free.min(out);
        photon.at += length * photon.direction;
        photon.depth += medium.sigma_a * length;
        if free >= out {
            return true;
        }
        if visitor.scatters(photon, true, rng).is_break() {
            return false;
        }
        photon.direction = scatter(photon.direction, medium.g, rng);
    }
}

/// Length of the way out of a ball about the origin.
pub(crate) fn way_out(at: Vec3, direction: Vec3, radius: f64) -> f64 {
    let along = at.dot(direction);
    let missing = radius * radius - at.length_squared();
    (along * along + missing).max(0.0).sqrt() - along
}

/// A new direction after a scattering by Henyey and Greenstein's phase function.
#[inline]
pub(crate) fn scatter(direction: Vec3, g: f64, rng: &mut Stream) -> Vec3 {
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

    /// Counts, and leaps or not.
    struct Counter {
        leaps: bool,
        scatterings: u32,
    }

    impl Visitor for Counter {
        fn scatters(&mut self, _: &mut Photon, _: bool, _: &mut Stream) -> ControlFlow<()> {
            self.scatterings += 1;
            ControlFlow::Continue(())
        }

        fn leapt(&mut self, scatterings: u32) {
            self.scatterings += scatterings;
        }

        fn unseen(&self, _: Vec3) -> f64 {
            if self.leaps { f64::INFINITY } else { 0.0 }
        }
    }

    /// From the middle of a large ball: way, scatterings and last direction are the same with
    /// leaps and without.
    #[test]
    fn leaps_are_walks() {
        let ball = crate::Sphere {
            center: Vec3::ZERO,
            radius: 20.0,
        };
        let shape = Shape::Sphere(ball);
        for g in [0.0, 0.7] {
            let medium = Medium {
                sigma_a: 0.01,
                sigma_s: 1.0 / (1.0 - g),
                g,
                eta: 1.3,
            };
            let n = 6000;
            let found = [true, false].map(|leap| {
                let mut rng = stream(9, &[u64::from(leap)]);
                let mut leaps = Leaps::new(medium, 9, [0, 0]);
                let mut sums = [[0.0; 2]; 4];
                for _ in 0..n {
                    let mut photon = Photon {
                        at: Vec3::ZERO,
                        direction: Vec3::Z,
                        depth: 0.0,
                    };
                    let mut counter = Counter {
                        leaps: leap,
                        scatterings: 0,
                    };
                    let ground = Ground {
                        shape: &shape,
                        medium: &medium,
                        leaps: &mut leaps,
                        roulette: f64::INFINITY,
                    };
                    let end = wander(ground, &mut photon, &mut rng, &mut counter);
                    let End::Left(hit) = end else {
                        panic!("{end:?}");
                    };
                    let found = [
                        photon.depth,
                        f64::from(counter.scatterings),
                        photon.direction.dot(hit.normal),
                        photon.at.z / 20.0,
                    ];
                    for (sum, x) in sums.iter_mut().zip(found) {
                        sum[0] += x;
                        sum[1] += x * x;
                    }
                }
                sums.map(|[sum, square]| {
                    let mean = sum / f64::from(n);
                    let variance = square / f64::from(n) - mean * mean;
                    (mean, (variance / f64::from(n)).sqrt())
                })
            });
            let [leapt, walked] = found;
            for (x, y) in leapt.iter().zip(&walked) {
                // The walks of the balls are used again: up to twice the error.
                let u = (2.0 * x.1).hypot(y.1);
                assert!((x.0 - y.0).abs() < 3.5 * u, "{g}: {found:?}");
            }
            assert!(leapt[0].1 < 0.01 * leapt[0].0, "{g}: {found:?}");
        }
    }

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

//! Long ways at once: where a walk that begins in the middle of a ball comes out of it.
//!
//! Deep inside, where no surface is near, a photon needs (R/ℓ′)² scatterings to get a distance R
//! away. Walks from the middle of balls of a few sizes are remembered, turned at random and used
//! again (after Moon, Walter and Marschner 2007, who fit functions to them). Each is a walk like any
//! other, so no mean changes; what several photons of a round have in common is in the spread
//! between rounds, because every round remembers walks of its own.

use crate::Vec3;
use crate::scene::Scene;
use crate::walk::{Photon, scatter, way_out};
use physics::Medium;
use physics::random::{Stream, stream, uniform};
use std::f64::consts::TAU;

/// Radii of the balls in transport lengths.
pub(crate) const RADII: [f64; 4] = [3.0, 6.0, 12.0, 24.0];
/// Walks that are remembered of each.
const WALKS: usize = 1024;

/// How a walk that starts in the middle along the z axis leaves a ball, or how far it has got.
#[derive(Clone, Copy)]
pub(crate) struct Exit {
    pub(crate) at: Vec3,
    pub(crate) direction: Vec3,
    pub(crate) length: f64,
    pub(crate) scatterings: u32,
}

/// Walks of one medium; filled as they are asked for.
pub struct Leaps {
    medium: Medium,
    radii: [f64; RADII.len()],
    exits: Vec<Option<Exit>>,
    seed: u64,
    identity: [u64; 2],
}

impl Leaps {
    /// None yet. `seed` and `identity` say which walks they will be.
    pub fn new(medium: Medium, seed: u64, identity: [u64; 2]) -> Self {
        let path = 1.0 / (medium.sigma_s * (1.0 - medium.g));
        Self {
            medium,
            radii: RADII.map(|r| r * path),
            exits: vec![],
            seed,
            identity,
        }
    }

    /// The largest ball that fits in a radius.
    #[inline]
    pub(crate) fn within(&self, radius: f64) -> Option<usize> {
        // No medium that scatters: the radii are infinite or no numbers.
        (0..RADII.len()).rev().find(|k| self.radii[*k] <= radius)
    }

    /// Radii of the balls, mm.
    pub(crate) fn radii(&self) -> [f64; RADII.len()] {
        self.radii
    }

    /// Radius of a ball, mm.
    #[inline]
    pub(crate) fn radius(&self, ball: usize) -> f64 {
        self.radii[ball]
    }

    /// One of the remembered walks out of a ball.
    #[inline]
    pub(crate) fn walk(&mut self, ball: usize, which: usize) -> Exit {
        if self.exits.is_empty() {
            self.exits = vec![None; RADII.len() * WALKS];
        }
        let slot = ball * WALKS + which % WALKS;
        if let Some(exit) = self.exits[slot] {
            return exit;
        }
        let [round, index] = self.identity;
        let identity = [6, round, index, slot as u64];
        let exit = self.exit(ball, &mut stream(self.seed, &identity));
        self.exits[slot] = Some(exit);
        exit
    }

    /// Walks from the middle of a ball along z to its surface, by leaps out of smaller balls.
    fn exit(&mut self, ball: usize, rng: &mut Stream) -> Exit {
        let Medium { sigma_s, g, .. } = self.medium;
        let radius = self.radii[ball];
        let mut exit = Exit {
            at: Vec3::ZERO,
            direction: Vec3::Z,
            length: 0.0,
            scatterings: 0,
        };
        loop {
            let free = -(1.0 - uniform(rng)).ln() / sigma_s;
            let out = way_out(exit.at, exit.direction, radius);
            exit.at += free.min(out) * exit.direction;
            exit.length += free.min(out);
            if free >= out {
                return exit;
            }
            exit.scatterings += 1;
            exit.direction = scatter(exit.direction, g, rng);
            let smaller = self.within(radius - exit.at.length());
            if let Some(smaller) = smaller.filter(|smaller| *smaller < ball) {
                self.follow(smaller, &mut exit, rng);
            }
        }
    }

    /// Goes on with a walk out of a ball around where it is.
    fn follow(&mut self, ball: usize, so_far: &mut Exit, rng: &mut Stream) {
        let exit = self.walk(ball, (uniform(rng) * WALKS as f64) as usize);
        let axis = so_far.direction;
        let (u, v) = axis.any_orthonormal_pair();
        let (sin, cos) = (TAU * uniform(rng)).sin_cos();
        let (u, v) = (cos * u + sin * v, cos * v - sin * u);
        let turned = |w: Vec3| w.x * u + w.y * v + w.z * axis;
        so_far.at += turned(exit.at);
        so_far.direction = turned(exit.direction).normalize();
        so_far.length += exit.length;
        so_far.scatterings += exit.scatterings;
    }

    /// Takes a photon that has just been turned out of a ball around it, and says how often it
    /// scattered on the way.
    pub(crate) fn leap(&mut self, ball: usize, photon: &mut Photon, rng: &mut Stream) -> u32 {
        let mut exit = Exit {
            at: photon.at,
            direction: photon.direction,
            length: 0.0,
            scatterings: 0,
        };
        self.follow(ball, &mut exit, rng);
        photon.at = exit.at;
        photon.direction = exit.direction;
        photon.depth += self.medium.sigma_a * exit.length;
        exit.scatterings
    }
}

/// Those of a round, for each solid and, within it, channel.
pub fn of_scene(scene: &Scene, seed: u64, round: u64) -> Vec<Leaps> {
    let media = scene.objects.iter().flat_map(|o| &o.material.media);
    media
        .enumerate()
        .map(|(index, medium)| Leaps::new(*medium, seed, [round, index as u64]))
        .collect()
}

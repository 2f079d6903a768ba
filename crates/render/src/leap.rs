//! Long ways at once: where a walk that begins in the middle of a ball comes out of it.
//!
//! Deep inside, where no surface is near, a photon needs (R/ℓ′)² scatterings to get a distance R
//! away. Walks from the middle of balls of a few sizes are remembered, turned at random and used
//! again (after Moon, Walter and Marschner 2007, who fit functions to them). Each is a walk like any
//! other, so no mean changes; what several photons of a round have in common is in the spread
//! between rounds, because every round remembers walks of its own.

use crate::Vec3;
use crate::scene::Scene;
use crate::walk::{Photon, scatter};
use physics::Medium;
use physics::random::{Stream, stream, uniform};
use std::f64::consts::TAU;

/// Radii of the balls in transport lengths.
const RADII: [f64; 4] = [3.0, 6.0, 12.0, 24.0];
/// Walks that are remembered of each.
const WALKS: usize = 1024;

/// How a walk that starts in the middle along the z axis leaves a ball.
#[derive(Clone, Copy)]
struct Exit {
    at: Vec3,
    direction: Vec3,
    length: f64,
    scatterings: u32,
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

    /// Radius of a ball, mm.
    #[inline]
    pub(crate) fn radius(&self, ball: usize) -> f64 {
        self.radii[ball]
    }

    /// Takes a photon that has just been turned out of a ball around it, and says how often it
    /// scattered on the way.
    pub(crate) fn leap(&mut self, ball: usize, photon: &mut Photon, rng: &mut Stream) -> u32 {
        if self.exits.is_empty() {
            self.exits = vec![None; RADII.len() * WALKS];
        }
        let walk = (uniform(rng) * WALKS as f64) as usize;
        let slot = ball * WALKS + walk;
        let exit = self.exits[slot].unwrap_or_else(|| {
            let [round, index] = self.identity;
            let identity = [6, round, index, slot as u64];
            let mut own = stream(self.seed, &identity);
            exit(&self.medium, self.radii[ball], &mut own)
        });
        self.exits[slot] = Some(exit);
        let axis = photon.direction;
        let (u, v) = axis.any_orthonormal_pair();
        let (sin, cos) = (TAU * uniform(rng)).sin_cos();
        let (u, v) = (cos * u + sin * v, cos * v - sin * u);
        let turned = |w: Vec3| w.x * u + w.y * v + w.z * axis;
        photon.at += turned(exit.at);
        photon.direction = turned(exit.direction).normalize();
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

/// Walks from the middle of a ball along z to its surface.
fn exit(medium: &Medium, radius: f64, rng: &mut Stream) -> Exit {
    let mut at = Vec3::ZERO;
    let mut direction = Vec3::Z;
    let mut length = 0.0;
    let mut scatterings = 0;
    loop {
        let free = -(1.0 - uniform(rng)).ln() / medium.sigma_s;
        let along = at.dot(direction);
        let missing = radius * radius - at.length_squared();
        let out = (along * along + missing).max(0.0).sqrt() - along;
        if free >= out {
            return Exit {
                at: at + out * direction,
                direction,
                length: length + out,
                scatterings,
            };
        }
        at += free * direction;
        length += free;
        scatterings += 1;
        direction = scatter(direction, medium.g, rng);
    }
}

//! Weights that photons of a beam should have: the farther from the beam, the lighter and the
//! more.
//!
//! Photons as they come are as many as the picture is bright, and its dark parts, which are most
//! of it, are noise. Splitting photons on their way out and playing roulette on their way in
//! (weight windows; Booth and Hendricks 1984) makes them about as many everywhere near the surfaces
//! that are seen; the wanted weights are those of the dipole. They change no mean, whatever they
//! are.

use crate::Vec3;
use crate::light::Light;
use crate::scene::Scene;
use crate::walk::Photon;
use physics::random::{Stream, uniform};
use physics::{DiffuseFresnel, Dipole};
use std::f64::consts::LN_2;

/// Distances of a table.
pub(crate) const STEPS: usize = 4096;
/// -ln of the least weight that is wanted.
const LEAST: f64 = 11.5;
/// What a photon costs of what its path near the surface would, the way deep inside being rare.
const COST: f64 = 0.25;
/// Most photons that one becomes at a scattering.
const MOST: f64 = 50.0;

/// The wanted weights of one beam in one channel of the solid that it meets.
#[derive(Debug)]
pub(crate) struct Guide {
    object: usize,
    center: Vec3,
    per_mm: f64,
    /// -ln of the wanted weight at the distances k / `per_mm`, and the same for lanes.
    depth: Vec<f64>,
    lanes: Box<[f32; STEPS]>,
    /// How much more there is to do for one photon than without.
    effort: f64,
    /// A transport length, mm.
    path: f64,
}

impl Guide {
    /// For a beam that meets a solid; other lamps light so much that nothing has to be wanted.
    pub(crate) fn new(scene: &Scene, channel: usize, lamp: usize) -> Option<Self> {
        let Light::Beam {
            from,
            direction,
            spot,
        } = scene.lamps[lamp].light
        else {
            return None;
        };
        let (object, hit) = scene.enter(from, direction)?;
        let medium = &scene.objects[object].material.media[channel];
        let reduced = medium.reduced();
        let dipole = Dipole::new(&reduced, DiffuseFresnel::Exact);
        let path = 1.0 / reduced.coefficients().sigma_t_prime();
        let near = spot.extent().max(path);
        // Between as many in each ring and as many on each mm²: the former are more independent.
        let value = |r: f64| {
            let r = r.hypot(near);
            dipole.diffuse_reflectance(r) * r.sqrt()
        };
        let first = value(0.0);
        let wanted = |r: f64| (first / value(r)).ln().min(LEAST);
        // To where the least weight is reached, by halves and doublings.
        let mut reach = near;
        while wanted(reach) < LEAST && reach < 1e4 * near {
            reach *= 2.0;
        }
        let per_mm = STEPS as f64 / reach;
        let depth: Vec<f64> = (0..=STEPS).map(|k| wanted(k as f64 / per_mm)).collect();
        if !depth.iter().all(|d| d.is_finite()) {
            return None;
        }
        let solid = &scene.objects[object].shape;
        let size = solid
            .bounds()
            .map_or(reach, |(low, high)| (high - low).length());
        let (mut all, mut as_they_come) = (0.0, 0.0);
        for (k, depth) in depth.iter().enumerate() {
            let r = k as f64 / per_mm;
            if r < 0.5 * size {
                as_they_come += r * (-depth).exp();
                all += r;
            }
        }
        Some(Self {
            object,
            center: from + hit.distance * direction,
            per_mm,
            lanes: Box::new(std::array::from_fn(|k| depth[k] as f32)),
            depth,
            path,
            effort: (COST * all / as_they_come).max(1.0),
        })
    }

    /// Whether it knows the solid.
    pub(crate) fn holds(&self, object: usize) -> bool {
        self.object == object
    }

    /// What lanes need to know whether [`Self::split`] has anything to do: the middle, steps of the
    /// table in a mm, the table, and a transport length, mm.
    pub(crate) fn table(&self) -> (Vec3, f64, &[f32; STEPS], f64) {
        (self.center, self.per_mm, &self.lanes, self.path)
    }

    /// How many photons make about the effort of `photons` without guide.
    pub(crate) fn fewer(&self, photons: u64) -> u64 {
        ((photons as f64 / self.effort) as u64).clamp(1, photons)
    }

    /// How many photons are to go on from here, each with the weight that `photon` then has.
    /// What is `below` the nearest surface that the camera sees, mm, is wanted the heavier: it
    /// has a long way to where it shows, and can be split there.
    #[inline]
    pub(crate) fn split(&self, photon: &mut Photon, below: f64, rng: &mut Stream) -> u32 {
        let place = (photon.at - self.center).length() * self.per_mm;
        let wanted = self.depth[(place as usize).min(STEPS)] - (1.0 + below / self.path).ln();
        // ln of the weight over the wanted one.
        let heavy = wanted - photon.depth;
        if heavy.abs() < LN_2 {
            return 1;
        }
        let number = heavy.exp().min(MOST);
        photon.depth += number.ln();
        let whole = number.floor();
        whole as u32 + u32::from(uniform(rng) < number - whole)
    }
}

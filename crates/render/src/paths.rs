//! `monte-carlo` from the camera: for lights that a path can meet.

use crate::Vec3;
use crate::boundary::part;
use crate::leap::{self, Leaps};
use crate::scene::Scene;
use crate::walk::{End, Ground, Photon, ROULETTE_DEPTH, Visitor, wander};
use physics::random::{Stream, stream, uniform};
use std::ops::ControlFlow;

/// What one path found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Radiance.
    pub value: f64,
    /// How often the light scattered in the solid it came from last; 0 for none.
    pub order: u32,
}

/// Which lights count, and how far a path goes.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    /// One entry a light: whether a scattered path may count it.
    pub scattered: Vec<bool>,
    /// One entry a light: whether an unscattered path may.
    pub unscattered: Vec<bool>,
}

/// Counts scatterings.
struct Counter {
    order: u32,
    goes_on: bool,
}

impl Visitor for Counter {
    fn scatters(&mut self, _: &mut Photon, _: bool, _: &mut Stream) -> ControlFlow<()> {
        self.order += 1;
        if self.goes_on {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    }

    fn leapt(&mut self, scatterings: u32) {
        self.order += scatterings;
    }
}

/// Follows light back from the origin and direction of `ray`: what the first surface mirrors and what it lets in, each
/// with its share. `leaps` has those of each solid and, within it, channel; `add` is told what
/// either way found.
pub fn radiance(
    scene: &Scene,
    channel: usize,
    ray: (Vec3, Vec3),
    wanted: &Wanted,
    leaps: &mut [Leaps],
    rng: &mut Stream,
    mut add: impl FnMut(Found),
) {
    let (origin, direction) = ray;
    let entered = scene.enter(origin, direction);
    let within = entered.map_or(f64::INFINITY, |(_, hit)| hit.distance);
    if let Some(value) = scene.lit(channel, origin, direction, within, &wanted.unscattered) {
        return add(Found { value, order: 0 });
    }
    let Some((object, hit)) = entered else {
        return;
    };
    let at = origin + hit.distance * direction;
    let parting = part(direction, hit.normal, scene.eta(object, channel));
    let mut path = Path {
        scene,
        channel,
        wanted,
        depth: 0.0,
        order: 0,
        seen: 0,
    };
    // Both ways, not one by chance: a lamp in a mirror of a few per cent would be all noise.
    if parting.reflectance > 0.0 {
        let mut found = path.clone().outside(at, parting.reflected, leaps, rng);
        found.value *= parting.reflectance;
        add(found);
    }
    if parting.reflectance < 1.0 {
        let mut found = match path.inside(object, at, parting.refracted, leaps, rng) {
            Some((origin, direction)) => path.outside(origin, direction, leaps, rng),
            None => path.nothing(),
        };
        found.value *= 1.0 - parting.reflectance;
        add(found);
    }
}

/// A path so far.
#[derive(Clone)]
struct Path<'a> {
    scene: &'a Scene,
    channel: usize,
    wanted: &'a Wanted,
    /// -ln of its weight.
    depth: f64,
    /// How often it scattered.
    order: u32,
    /// The order seen by the camera: that of the first solid in which anything happened.
    seen: u32,
}

impl Path<'_> {
    fn nothing(&self) -> Found {
        Found {
            value: 0.0,
            order: self.seen,
        }
    }

    /// From a point outside of all solids to a lamp, or to nothing.
    fn outside(
        mut self,
        mut origin: Vec3,
        mut direction: Vec3,
        leaps: &mut [Leaps],
        rng: &mut Stream,
    ) -> Found {
        loop {
            let entered = self.scene.enter(origin, direction);
            let within = entered.map_or(f64::INFINITY, |(_, hit)| hit.distance);
            let lamps = if self.order > 0 {
                &self.wanted.scattered
            } else {
                &self.wanted.unscattered
            };
            let lit = self
                .scene
                .lit(self.channel, origin, direction, within, lamps);
            if let Some(value) = lit {
                return Found {
                    value: value * (-self.depth).exp(),
                    order: self.seen,
                };
            }
            let Some((object, hit)) = entered else {
                return self.nothing();
            };
            origin += hit.distance * direction;
            let parting = part(direction, hit.normal, self.scene.eta(object, self.channel));
            if parting.reflectance >= 1.0 || uniform(rng) < parting.reflectance {
                direction = parting.reflected;
                continue;
            }
            match self.inside(object, origin, parting.refracted, leaps, rng) {
                Some(out) => (origin, direction) = out,
                None => return self.nothing(),
            }
        }
    }

    /// Through a solid, from just inside its surface to where it leaves, if it does.
    fn inside(
        &mut self,
        index: usize,
        at: Vec3,
        direction: Vec3,
        leaps: &mut [Leaps],
        rng: &mut Stream,
    ) -> Option<(Vec3, Vec3)> {
        let object = &self.scene.objects[index];
        let mut photon = Photon {
            at,
            direction,
            depth: self.depth,
        };
        let ground = Ground {
            shape: &object.shape,
            medium: &object.material.media[self.channel],
            leaps: &mut leaps[index * self.scene.channels.len() + self.channel],
            roulette: photon.depth + ROULETTE_DEPTH,
        };
        let mut counter = Counter {
            order: self.order,
            goes_on: self.wanted.scattered.contains(&true),
        };
        let end = wander(ground, &mut photon, rng, &mut counter);
        self.order = counter.order;
        if self.seen == 0 {
            self.seen = self.order;
        }
        self.depth = photon.depth;
        matches!(end, End::Left(_)).then_some((photon.at, photon.direction))
    }
}

/// Adds a path of each pixel and channel to `round`: plane after plane, pixel after pixel.
///
/// `plane` says to which plane a channel and an order of scattering belong.
pub(crate) fn round(
    scene: &Scene,
    wanted: &Wanted,
    seed: u64,
    index: u64,
    plane: impl Fn(usize, u32) -> usize,
    round: &mut [f64],
) {
    let pixels = scene.pixels();
    let [width, _] = scene.camera.size();
    // A path that ends at the first scattering costs next to nothing.
    let samples = if wanted.scattered.contains(&true) {
        1
    } else {
        16
    };
    let mut leaps = leap::of_scene(scene, seed, index);
    for pixel in 0..pixels {
        let mut rng = stream(seed, &[1, index, pixel as u64]);
        for _ in 0..samples {
            let x = (pixel % width) as f64 + uniform(&mut rng);
            let y = (pixel / width) as f64 + uniform(&mut rng);
            let ray = scene.camera.ray(x, y);
            for channel in 0..scene.channels.len() {
                let add = |found: Found| {
                    let at = plane(channel, found.order) * pixels + pixel;
                    round[at] += found.value / f64::from(samples);
                };
                radiance(scene, channel, ray, wanted, &mut leaps, &mut rng, add);
            }
        }
    }
}

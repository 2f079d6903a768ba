//! `monte-carlo` from the camera: for lights that a path can meet.

use crate::Vec3;
use crate::boundary::part;
use crate::scene::Scene;
use crate::walk::{End, Photon, wander};
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

/// Follows one path from `origin` and returns the radiance that it brings back.
pub fn radiance(
    scene: &Scene,
    channel: usize,
    mut origin: Vec3,
    mut direction: Vec3,
    wanted: &Wanted,
    rng: &mut Stream,
) -> Found {
    let mut depth = 0.0;
    let mut order = 0;
    // The order seen by the camera is that of the first solid in which anything happened.
    let mut seen = 0;
    let goes_on = wanted.scattered.contains(&true);
    loop {
        let entered = scene.enter(origin, direction);
        let within = entered.map_or(f64::INFINITY, |(_, hit)| hit.distance);
        let lamps = if order > 0 {
            &wanted.scattered
        } else {
            &wanted.unscattered
        };
        if let Some(value) = scene.lit(channel, origin, direction, within, lamps) {
            return Found {
                value: value * f64::exp(-depth),
                order: seen,
            };
        }
        let nothing = Found {
            value: 0.0,
            order: seen,
        };
        let Some((object, hit)) = entered else {
            return nothing;
        };
        let object = &scene.objects[object];
        let medium = &object.material.media[channel];
        origin += hit.distance * direction;
        let parting = part(direction, hit.normal, medium.eta);
        if parting.reflectance >= 1.0 || uniform(rng) < parting.reflectance {
            direction = parting.reflected;
            continue;
        }
        let mut photon = Photon {
            at: origin,
            direction: parting.refracted,
            depth,
        };
        let end = wander(&object.shape, medium, &mut photon, rng, &mut |_| {
            order += 1;
            if goes_on {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        });
        if seen == 0 {
            seen = order;
        }
        match end {
            End::Left(_) => {
                origin = photon.at;
                direction = photon.direction;
                depth = photon.depth;
            }
            End::Stopped | End::Lost => return nothing,
        }
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
    for pixel in 0..pixels {
        let mut rng = stream(seed, &[1, index, pixel as u64]);
        for _ in 0..samples {
            let x = (pixel % width) as f64 + uniform(&mut rng);
            let y = (pixel / width) as f64 + uniform(&mut rng);
            let (origin, direction) = scene.camera.ray(x, y);
            for channel in 0..scene.channels.len() {
                let found = radiance(scene, channel, origin, direction, wanted, &mut rng);
                let at = plane(channel, found.order) * pixels + pixel;
                round[at] += found.value / f64::from(samples);
            }
        }
    }
}

//! Figure 8's cube under its laser, and the cube under an area lamp, by `monte-carlo` on one thread:
//! what error a given time buys.
//!
//! `cargo run --release -p beamspot-render --example cube [SECONDS]`
//!
//! For the laser, 512 x 512 pixels: half of the median difference of two pictures, over blocks of 4 x 4
//! pixels that are brighter than 1 % of the mean lit one, as it would be after 120 CPU seconds (the
//! mean of both pictures has that of one divided by √2, and so has half of their difference). For the
//! lamp, 64 x 64 pixels: the mean variance of a pixel times seconds, over the square of the mean.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a study that prints what it finds"
)]

use physics::Medium;
use render::camera::{Camera, Lens, View};
use render::{
    Block, Lamp, Light, Material, Method, MonteCarlo, Object, Options, Picture, Scene, Shape, Spot,
    Vec3,
};
use std::ops::ControlFlow;
use std::time::Instant;

/// Marble of Jensen et al. (2001), mm⁻¹: σₐ and σₛ′.
const MARBLE: [(f64, f64); 3] = [(0.0021, 2.19), (0.0041, 2.62), (0.0071, 3.00)];

fn scene(light: Light, pixels: usize) -> Scene {
    let medium = |(sigma_a, sigma_s)| Medium {
        sigma_a,
        sigma_s,
        g: 0.0,
        eta: 1.5,
    };
    let view = View {
        from: Vec3::new(0.0, -170.0, 75.0),
        to: Vec3::new(0.0, 0.0, -1.0),
        up: Vec3::Z,
        width: pixels,
        height: pixels,
    };
    let lens = Lens::Pinhole {
        field: 18.5_f64.to_radians(),
    };
    let scene = Scene {
        channels: ["R", "G", "B"].map(String::from).to_vec(),
        objects: vec![Object {
            name: "cube".into(),
            shape: Shape::Block(Block {
                min: Vec3::splat(-20.0),
                max: Vec3::splat(20.0),
            }),
            material: Material {
                media: MARBLE.map(medium).to_vec(),
                texture: None,
            },
        }],
        lamps: vec![Lamp {
            light,
            strength: vec![1.0; 3],
        }],
        camera: Camera::new(view, lens).unwrap(),
    };
    scene.validated().unwrap()
}

/// CPU seconds of this process where the system tells, in ticks of 10 ms; else those of the clock.
fn seconds_spent(since: Instant) -> f64 {
    let told = std::fs::read_to_string("/proc/self/stat").ok();
    let ticks = told.and_then(|text| {
        let after_name = text.rsplit(')').next()?;
        after_name.split_whitespace().nth(11)?.parse::<f64>().ok()
    });
    ticks.map_or(since.elapsed().as_secs_f64(), |ticks| 0.01 * ticks)
}

/// A picture of about so many seconds, and how many they were.
fn picture(scene: &Scene, seed: u64, photons: u64, seconds: f64) -> (Picture, f64) {
    let options = Options {
        seed,
        photons,
        ..Options::default()
    };
    let method = MonteCarlo::new(scene, options).unwrap();
    let mut picture = method.empty();
    let clock = Instant::now();
    let before = seconds_spent(clock);
    method.run(0..u64::MAX, &mut picture, &mut |_| {
        if seconds_spent(clock) - before < seconds {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    (picture, seconds_spent(clock) - before)
}

fn main() {
    let seconds: f64 = std::env::args().nth(1).map_or(10.0, |s| s.parse().unwrap());
    let photons: u64 = std::env::args()
        .nth(2)
        .map_or(40_000, |s| s.parse().unwrap());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
    pool.build().unwrap().install(|| {
        let laser = scene(
            Light::Beam {
                from: Vec3::new(0.0, -10.0, 60.0),
                direction: Vec3::NEG_Z,
                spot: Spot::Disk(0.5),
            },
            512,
        );
        let pair = [1, 2].map(|seed| picture(&laser, seed, photons, 0.5 * seconds));
        let spent = pair[0].1 + pair[1].1;
        for (channel, name) in laser.channels.iter().enumerate() {
            let blocks = pair.each_ref().map(|(picture, _)| blocks(picture, channel));
            let mean: Vec<f64> = blocks[0]
                .iter()
                .zip(&blocks[1])
                .map(|(a, b)| 0.5 * (a + b))
                .collect();
            let lit: Vec<f64> = mean.iter().copied().filter(|m| *m > 0.0).collect();
            let least = 0.01 * lit.iter().sum::<f64>() / lit.len() as f64;
            let mut off: Vec<f64> = (0..mean.len())
                .filter(|k| mean[*k] > least)
                .map(|k| 0.5 * (blocks[0][k] - blocks[1][k]).abs() / mean[k])
                .collect();
            off.sort_by(f64::total_cmp);
            let median = off[off.len() / 2] * (spent / 120.0).sqrt();
            println!(
                "laser, {name}: median of {} blocks after 120 s {:.2} % ({spent:.1} s, {} rounds)",
                off.len(),
                100.0 * median,
                pair[0].0.radiance.rounds()
            );
        }
        let lamp = scene(
            Light::Area {
                corner: Vec3::new(-20.0, -20.0, 60.0),
                u: Vec3::new(0.0, 40.0, 0.0),
                v: Vec3::new(40.0, 0.0, 0.0),
            },
            64,
        );
        let (picture, spent) = picture(&lamp, 1, photons, 0.5 * seconds);
        let all = 0..lamp.pixels();
        let estimates: Vec<_> = all
            .map(|k| picture.radiance.estimate(lamp.pixels() + k))
            .collect();
        let mean = estimates.iter().map(|e| e.value).sum::<f64>() / estimates.len() as f64;
        let variance = estimates.iter().map(|e| e.u * e.u).sum::<f64>() / estimates.len() as f64;
        println!(
            "lamp, G: mean {mean:.6}, variance x seconds over mean² {:.5}",
            variance * spent / (mean * mean)
        );
    });
}

/// Means of blocks of 4 x 4 pixels of a channel.
fn blocks(picture: &Picture, channel: usize) -> Vec<f64> {
    let pixels = 512;
    let mut blocks = vec![0.0; (pixels / 4) * (pixels / 4)];
    for k in 0..pixels * pixels {
        let (x, y) = (k % pixels / 4, k / pixels / 4);
        blocks[y * (pixels / 4) + x] += picture
            .radiance
            .estimate(channel * pixels * pixels + k)
            .value;
    }
    blocks
}

//! Million pixels per second of a radial profile, beside a pass that only reads the picture.
//!
//! `RAYON_NUM_THREADS=1 cargo bench -p beamspot-profile`, or with as many threads as there are. Each figure is the best of
//! 40 rounds in one process, in pixels of the frame, value and variance; a 24 MP frame of 6000 × 4000 has 52 % of
//! its pixels inside the largest full circle, and a square one 79 %. A round does everything in turn, so that
//! whatever else runs on the machine slows all alike.
#![expect(clippy::print_stdout, reason = "a bench prints")]

use physics::ChannelMap;
use profile::{ProfileOptions, find_center, radial_profile};
use std::hint::black_box;
use std::time::Instant;

const ROUNDS: usize = 40;

/// Sums in lanes, so that memory is the limit.
fn read_only(channel: &ChannelMap) -> f32 {
    let mut lanes = [0.0_f32; 16];
    for plane in [&channel.value, &channel.variance] {
        let (blocks, _) = plane.as_chunks::<16>();
        for block in blocks {
            for (lane, value) in lanes.iter_mut().zip(block) {
                *lane += value;
            }
        }
    }
    lanes.iter().sum()
}

fn main() {
    println!("threads: {}", rayon::current_num_threads());
    for (width, height) in [(6000, 4000), (4896, 4896)] {
        let center = [0.5 * width as f64 + 3.3, 0.5 * height as f64 - 2.1];
        let value: Vec<f32> = (0..width * height)
            .map(|i| {
                let (x, y) = (
                    (i % width) as f64 - center[0],
                    (i / width) as f64 - center[1],
                );
                let noise = ((i * 7919) % 1013) as f64 / 1013.0 - 0.5;
                (1e6 / (900.0 + x * x + y * y).powf(1.4) * (1.0 + 1e-3 * noise)) as f32
            })
            .collect();
        let variance = value.iter().map(|v| 1e-7 * v * v).collect();
        let channel = ChannelMap {
            name: "Y".to_owned(),
            value,
            variance,
        };
        let options = ProfileOptions {
            factor_per_mm2: 1e-9,
            ..ProfileOptions::default()
        };
        let around = ProfileOptions {
            center_px: Some(center),
            ..options
        };
        let pixels = (width * height) as f64 / 1e6;
        println!("{width} x {height}");
        let read = || {
            black_box(read_only(black_box(&channel)));
        };
        let find = || {
            black_box(find_center(&channel, width, height).expect("a spot"));
        };
        let profile = |options: &ProfileOptions| {
            black_box(radial_profile(&channel, width, height, options).expect("a profile"));
        };
        let tasks: [(&str, &dyn Fn()); 4] = [
            ("read value and variance once", &read),
            ("find the centre", &find),
            ("profile about a given centre", &|| profile(&around)),
            ("centre and profile", &|| profile(&options)),
        ];
        let mut best = [f64::INFINITY; 4];
        for _ in 0..ROUNDS {
            for (best, (_, task)) in best.iter_mut().zip(&tasks) {
                let clock = Instant::now();
                task();
                *best = clock.elapsed().as_secs_f64().min(*best);
            }
        }
        for ((what, _), seconds) in tasks.iter().zip(best) {
            println!(
                "{what:<34} {:>7.1} ms {:>6.0} MP/s {:>5.0} % of reading",
                1e3 * seconds,
                pixels / seconds,
                100.0 * best[0] / seconds
            );
        }
    }
}

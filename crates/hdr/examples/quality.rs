//! How near a merge comes to the best that its frames allow, and whether its variance is true.
//!
//!     cargo run --release -p beamspot-hdr --example quality            # 24 MP, 13 exposures
//!     cargo run --release -p beamspot-hdr --example quality -- 600 400
//!
//! A glow that falls by 1e5 from the middle to the corners is exposed 13 times from 1 ms to 4 s,
//! electron by electron, with a dark for each; 0.02 % of the pixels are hot, every pixel has an
//! offset of its own, and the ordinary dark current is 2 electrons per second. For each decade of
//! radiance: the root mean square of the relative error over that of the Cramér-Rao bound, and
//! the mean square of the residuals over their variance.
//!
//! The bound is that of all samples whose expectation is below the white level, each less its own
//! dark: 1/Σ t²/(variance of frame and dark).
#![expect(clippy::print_stdout, reason = "an example prints")]

#[path = "quality/scene.rs"]
mod scene;

use hdr::{DarkFrame, Merge};
use rayon::prelude::*;
use scene::{Decade, Scene};
use std::time::Instant;

fn main() {
    let given: Vec<usize> = std::env::args()
        .skip(1)
        .map(|size| size.parse().expect("width and height in pixels"))
        .collect();
    let [width, height] = given.as_slice().try_into().unwrap_or([6000, 4000]);
    let scene = Scene::new(width, height);
    let mut merge = Merge::new(width, height, 1, &scene.sensor).expect("a sensor in order");
    let mut merging = 0.0;
    for (k, exposure_s) in scene.exposures_s.iter().enumerate() {
        let dark = DarkFrame::new(&scene.expose(k, false), *exposure_s).expect("a dark in order");
        let frame = scene.expose(k, true);
        let clock = Instant::now();
        merge
            .add(&frame, &dark, *exposure_s)
            .expect("a frame in order");
        merging += clock.elapsed().as_secs_f64();
    }
    let clock = Instant::now();
    let (map, report) = merge.finish().expect("a picture");
    merging += clock.elapsed().as_secs_f64();
    let map = &map.channels[0];

    let decades = (0..height)
        .into_par_iter()
        .map(|y| {
            let mut decades = [Decade::default(); 6];
            for pixel in y * width..(y + 1) * width {
                scene.judge(pixel, map.value[pixel], map.variance[pixel], &mut decades);
            }
            decades
        })
        .reduce(Default::default, |a, b| {
            std::array::from_fn(|d| a[d] + b[d])
        });
    println!("radiance / peak      pixels   rms error / bound   mean square of z");
    for (d, decade) in decades.iter().enumerate().filter(|(_, d)| d.pixels > 0.0) {
        println!(
            "1e-{d} to 1e-{}  {:>12}   {:>17.4}   {:>16.4}",
            d + 1,
            decade.pixels,
            decade.over_bound(),
            decade.z_square()
        );
    }
    println!(
        "hot pixels: {} masked; {} of {} that are hot were not",
        report.channels[0].hot,
        scene.missed(map),
        scene.hot(),
    );
    let samples = (width * height * scene.exposures_s.len()) as f64;
    println!(
        "merge: {merging:.2} s wall, {:.0} million samples per second",
        samples / merging / 1e6
    );
}

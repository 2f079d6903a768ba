//! The hierarchy of `point-cloud` beside the sum over all points, and beside drawn points: on the
//! bust of Figure 9 in marble, and on the textured scene:
//!
//! `cargo run --release -p beamspot-tests --example point_cloud`

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a study that prints what it finds"
)]

use physics::random::{Stream, stream};
use pipeline::rendering::{BssrdfModel, bssrdf, load};
use render::bssrdf::Sampling;
use render::surface::{Point, Shader};
use render::{Gather, PointCloud, Vec3};
use std::path::Path;
use std::time::Instant;

fn main() {
    let scenes = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes");
    let text = std::fs::read_to_string(format!("{scenes}/jensen9.toml")).unwrap();
    let marble = text
        .replace(
            "medium = { sigma_a_per_mm = 0.06, sigma_s_per_mm = 0.06 }",
            "material = \"marble\"",
        )
        .replace("../data", &format!("{scenes}/../data"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("marble.toml");
    std::fs::write(&path, marble).unwrap();
    println!("Figure 9 in marble");
    study(
        &path,
        14,
        &[0.05, 0.025, 0.012, 0.009, 0.0082, 0.0075, 0.0068, 0.006],
    );
    println!("textured.toml");
    let path = Path::new(scenes).join("textured.toml");
    study(&path, 28, &[0.05, 0.012, 0.0075, 0.006]);
}

/// Points of view are so many pixels apart.
fn study(path: &Path, apart: usize, solid_angles: &[f64]) {
    let scene = load(path).unwrap().scene;
    let of_scene = || bssrdf(&scene, BssrdfModel::Jensen2001, Sampling::Axes).unwrap();
    let [width, height] = scene.camera.size();
    let mut points = vec![];
    for y in (5..height).step_by(apart) {
        for x in (5..width).step_by(apart) {
            let (origin, direction) = scene.camera.ray(x as f64, y as f64);
            if let Some((object, hit)) = scene.enter(origin, direction) {
                let at = origin + hit.distance * direction;
                points.push(Point::new(&scene, object, at, &hit));
            }
        }
    }
    let look = |solid_angle: f64, points: &[Point]| {
        let gather = Gather::Hierarchy { solid_angle };
        let method = PointCloud::new(&scene, of_scene(), gather, 1, false).unwrap();
        let start = Instant::now();
        let cloud = method.cloud(0);
        let built = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let found: Vec<[f64; 3]> = points
            .iter()
            .map(|point| {
                let mut out = [0.0; 3];
                cloud.exitance(point, &mut out);
                out
            })
            .collect();
        let seconds = start.elapsed().as_secs_f64() / points.len() as f64;
        let counts: Vec<usize> = (0..scene.objects.len()).map(|k| cloud.points(k)).collect();
        (found, seconds, built, counts)
    };
    let (whole, brute, _, count) = look(0.0, &points);
    let mean = [0, 1, 2].map(|c| whole.iter().map(|x| x[c]).sum::<f64>() / whole.len() as f64);
    println!(
        "{count:?} points of the cloud, {} points of view",
        points.len()
    );
    println!("all one by one: {:.3} ms a point of view", 1e3 * brute);
    println!(
        "solid angle, ms a point of view, times faster, worst and rms relative error (of at least 1 % of the mean)"
    );
    for &solid_angle in solid_angles {
        let (found, seconds, built, _) = look(solid_angle, &points);
        let errors: Vec<f64> = found
            .iter()
            .zip(&whole)
            .flat_map(|(a, b)| [0, 1, 2].map(|c| (a[c] - b[c]) / b[c].max(0.01 * mean[c])))
            .collect();
        let worst = errors.iter().map(|e| e.abs()).fold(0.0, f64::max);
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        println!(
            "{solid_angle}: {:.4} ms, {:.0} x, {:.3} %, {:.3} % (built in {built:.2} s)",
            1e3 * seconds,
            brute / seconds,
            100.0 * worst,
            100.0 * rms
        );
    }
    // Drawn points: how long until one point of view is known as well as by one cloud.
    let shader = of_scene();
    let mut rng: Stream = stream(2, &[]);
    let (mut relative, mut seconds) = (0.0, 0.0);
    let few: Vec<&Point> = points.iter().step_by(10).collect();
    for point in &few {
        let view: Vec3 = point.normal;
        let (mut sum, mut square, n) = (0.0, 0.0, 2000.0);
        let start = Instant::now();
        for _ in 0..2000 {
            let mut out = [0.0; 3];
            shader.shade(&scene, point, view, &mut rng, &mut [0.0; 3], &mut out);
            sum += out[1];
            square += out[1] * out[1];
        }
        seconds += start.elapsed().as_secs_f64() / n / few.len() as f64;
        if sum > 0.0 {
            relative += (square * n / (sum * sum) - 1.0) / few.len() as f64;
        }
    }
    println!(
        "drawn points: {:.4} ms a draw with a variance of {relative:.1} of the square of the mean: \
         {:.1} ms for 1 %",
        1e3 * seconds,
        1e3 * seconds * relative * 1e4
    );
}

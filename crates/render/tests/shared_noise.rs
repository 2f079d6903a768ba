//! The error of sums over many pixels, held against how such sums scatter.

use physics::Medium;
use render::camera::Lens;
use render::{
    Camera, HalfSpace, Lamp, Light, Material, Method, MonteCarlo, Object, Options, Scene, Shape,
    Spot, Vec3, View,
};
use std::ops::ControlFlow;

const SIDE: usize = 24;

/// A beam on a half-space, seen from above.
fn scene() -> Scene {
    let view = View {
        from: Vec3::new(0.0, 0.0, 100.0),
        to: Vec3::ZERO,
        up: Vec3::Y,
        width: SIDE,
        height: SIDE,
    };
    Scene {
        channels: vec!["Y".into()],
        objects: vec![Object {
            name: "sample".into(),
            shape: Shape::HalfSpace(HalfSpace {
                point: Vec3::ZERO,
                normal: Vec3::Z,
            }),
            material: Material {
                media: vec![Medium {
                    sigma_a: 0.02,
                    sigma_s: 1.0,
                    g: 0.0,
                    eta: 1.4,
                }],
                texture: None,
            },
        }],
        lamps: vec![Lamp {
            light: Light::Beam {
                from: Vec3::new(0.0, 0.0, 50.0),
                direction: Vec3::NEG_Z,
                spot: Spot::gaussian(1.0),
            },
            strength: vec![1.0],
        }],
        camera: Camera::new(view, Lens::Orthographic { height: 12.0 }).expect("a camera"),
    }
    .validated()
    .expect("a scene")
}

/// One photon is seen by many pixels: sums over regions scatter as the picture says of itself, and
/// not as independent pixels would.
#[test]
fn sums_scatter_as_the_picture_says() {
    let scene = scene();
    let within = |pixel: usize, radii: [f64; 2]| {
        let [x, y] = [pixel % SIDE, pixel / SIDE].map(|k| k as f64 + 0.5 - 0.5 * SIDE as f64);
        (radii[0]..radii[1]).contains(&x.hypot(y))
    };
    let regions = [[0.0, 4.0], [4.0, 8.0], [0.0, 99.0]];
    let count = regions.map(|radii| (0..scene.pixels()).filter(|p| within(*p, radii)).count());
    // Sums of each seed; variances that are said, and that independent pixels would have.
    let mut sums = [[0.0; 2]; 3];
    let (mut said, mut alone) = ([0.0; 3], [0.0; 3]);
    const SEEDS: u64 = 200;
    for seed in 0..SEEDS {
        let options = Options {
            seed,
            photons: 20,
            ..Options::default()
        };
        let method = MonteCarlo::new(&scene, options).unwrap();
        let mut picture = method.empty();
        method.run(0..16, &mut picture, &mut |_| ControlFlow::Continue(()));
        let shared = picture.blocks.shared_noise(&picture.radiance, 0);
        for (k, radii) in regions.into_iter().enumerate() {
            let pixels = (0..scene.pixels()).filter(|p| within(*p, radii));
            let estimates = pixels.map(|pixel| picture.radiance.estimate(pixel));
            let (sum, variance) = estimates.fold((0.0, 0.0), |(sum, variance), e| {
                (sum + e.value, variance + e.u * e.u)
            });
            sums[k][0] += sum;
            sums[k][1] += sum * sum;
            alone[k] += variance;
            said[k] += variance * shared.factor(count[k] as f64);
        }
    }
    let n = SEEDS as f64;
    for k in 0..3 {
        let true_variance = (sums[k][1] - sums[k][0] * sums[k][0] / n) / (n - 1.0);
        let [said, alone] = [said[k], alone[k]].map(|sum| sum / n / true_variance);
        // Regions near the beam share less than blocks on average, and their error is too large.
        let what = format!("{:?}: said {said:.3}, alone {alone:.3}", regions[k]);
        assert!((0.75..1.7).contains(&said), "{what}");
        assert!(alone < 0.65, "independent pixels would do: {what}");
    }
}

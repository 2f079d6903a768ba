//! Against what is known otherwise: closed forms, other programs.

use physics::Medium;
use physics::random::{stream, uniform};
use render::camera::Lens;
use render::leap;
use render::paths::{Wanted, radiance};
use render::{
    Block, Camera, Entry, HalfSpace, Lamp, Light, Material, Method, MonteCarlo, Object, Options,
    Rings, Scene, Shape, Sphere, Spot, Vec3, View,
};
use std::ops::ControlFlow;

const AIR: f64 = 100.0;

fn camera() -> Camera {
    let view = View {
        from: Vec3::new(0.0, 0.0, AIR),
        to: Vec3::ZERO,
        up: Vec3::Y,
        width: 4,
        height: 4,
    };
    Camera::new(view, Lens::Orthographic { height: 8.0 }).expect("a camera")
}

fn scene(shape: Shape, media: Vec<Medium>, light: Light) -> Scene {
    let strength = vec![1.0; media.len()];
    Scene {
        channels: (0..media.len()).map(|c| c.to_string()).collect(),
        objects: vec![Object {
            name: "sample".into(),
            shape,
            material: Material {
                media,
                texture: None,
            },
        }],
        lamps: vec![Lamp { light, strength }],
        camera: camera(),
    }
    .validated()
    .expect("a scene")
}

fn medium(sigma_s_prime: f64, sigma_a: f64, g: f64, eta: f64) -> Medium {
    Medium {
        sigma_a,
        sigma_s: sigma_s_prime / (1.0 - g),
        g,
        eta,
    }
}

/// Under an even sky nothing is darker or brighter than the sky, if nothing absorbs: every path
/// has to come out again, with all that it entered with.
#[test]
fn a_white_furnace_is_white() {
    let white = medium(1.5, 0.0, 0.3, 1.5);
    for shape in [
        Shape::Block(Block {
            min: Vec3::splat(-4.0),
            max: Vec3::splat(4.0),
        }),
        Shape::Sphere(Sphere {
            center: Vec3::ZERO,
            radius: 5.0,
        }),
    ] {
        let scene = scene(shape, vec![white], Light::Sky);
        let method = MonteCarlo::new(&scene, Options::default()).unwrap();
        let mut picture = method.empty();
        method.run(0..100, &mut picture, &mut |_| ControlFlow::Continue(()));
        for pixel in 0..scene.pixels() {
            let got = picture.radiance.estimate(pixel);
            assert_eq!(got.value, 1.0, "{pixel}");
        }
    }
}

/// By reciprocity the radiance of a half-space under an even sky of 1 is its reflectance of light
/// from where the camera is. Expected from adding-doubling, specular light included.
#[test]
fn five_half_spaces_reflect_what_adding_doubling_says() {
    for (name, medium, normal, diffuse) in [
        ("marble G", medium(2.62, 0.0041, 0.0, 1.5), 0.8076, 0.8228),
        (
            "whole milk G",
            medium(3.21, 0.0024, 0.0, 1.3),
            0.8897,
            0.9004,
        ),
        ("skin1 G", medium(0.88, 0.17, 0.0, 1.3), 0.2267, 0.2743),
        (
            "skin1 G, g 0.85",
            medium(0.88, 0.17, 0.85, 1.3),
            0.2071,
            0.2610,
        ),
        ("albedo 0.5", medium(1.0, 1.0, 0.0, 1.5), 0.0843, 0.1360),
    ] {
        let top = HalfSpace {
            point: Vec3::ZERO,
            normal: Vec3::Z,
        };
        let scene = scene(Shape::HalfSpace(top), vec![medium], Light::Sky);
        let wanted = Wanted {
            scattered: vec![true],
            unscattered: vec![true],
        };
        const PATHS: u64 = 20_000;
        let paths = effort(PATHS);
        let mean = |even: bool| {
            let mut rng = stream(4, &[u64::from(even)]);
            let mut leaps = leap::of_scene(&scene, 4, u64::from(even));
            let (mut sum, mut square) = (0.0, 0.0);
            for path in 0..paths {
                // Leaps are a sample, too, whose noise all paths of a round share.
                if path > 0 && path % PATHS == 0 {
                    leaps = leap::of_scene(&scene, 4, 2 * (path / PATHS) + u64::from(even));
                }
                let cos = if even { uniform(&mut rng).sqrt() } else { 1.0 };
                let down = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, -cos);
                let mut value = 0.0;
                radiance(
                    &scene,
                    0,
                    (Vec3::Z, down),
                    &wanted,
                    &mut leaps,
                    &mut rng,
                    |found| {
                        value += found.value;
                    },
                );
                sum += value;
                square += value * value;
            }
            let n = paths as f64;
            let mean = sum / n;
            (mean, ((square / n - mean * mean) / n).sqrt())
        };
        for (what, expected, (got, u)) in [
            ("normal", normal, mean(false)),
            ("diffuse", diffuse, mean(true)),
        ] {
            println!(
                "{name}, {what}: {got:.5} +- {u:.5} for {expected}: {:+.3} %",
                100.0 * (got / expected - 1.0)
            );
            // Four standard errors, and half of the last printed digit.
            assert!((got - expected).abs() < 4.0 * u + 5e-5, "{name} {what}");
        }
    }
}

/// A multiple of the effort of a test, for a study: `BEAMSPOT_EFFORT=100 cargo test …`.
fn effort(usual: u64) -> u64 {
    let more = std::env::var("BEAMSPOT_EFFORT").ok();
    usual * more.and_then(|m| m.parse::<u64>().ok()).unwrap_or(1)
}

/// Where the light of Jensen's Figure 8 leaves the marble cube; 4.1 million photons of another
/// program.
#[test]
fn a_marble_cube_sends_out_through_each_face_what_another_program_counted() {
    let media = [(2.19, 0.0021), (2.62, 0.0041), (3.00, 0.0071)]
        .map(|(s, a)| medium(s, a, 0.0, 1.5))
        .to_vec();
    let cube = Block {
        min: Vec3::new(-20.0, -20.0, -20.0),
        max: Vec3::new(20.0, 20.0, 20.0),
    };
    let beam = Light::Beam {
        from: Vec3::new(0.0, -10.0, 50.0),
        direction: Vec3::NEG_Z,
        spot: Spot::Disk(0.5),
    };
    let scene = scene(Shape::Block(cube), media, beam);
    let photons = effort(500);
    let method = MonteCarlo::new(
        &scene,
        Options {
            photons,
            ..Options::default()
        },
    )
    .unwrap();
    let mut picture = method.empty();
    method.run(0..40, &mut picture, &mut |_| ControlFlow::Continue(()));
    // Faces -x, +x, -y, +y, -z, +z.
    let sides = [0.005_504, 0.001_749, 0.000_432];
    let expected: [[f64; 3]; 6] = [
        sides,
        sides,
        [0.039_500, 0.020_855, 0.009_876],
        [0.001_334, 0.000_248, 0.000_032],
        [0.000_738, 0.000_102, 0.000_008],
        [0.785_035, 0.760_421, 0.728_023],
    ];
    for (face, expected) in expected.iter().enumerate() {
        for (channel, &flux) in expected.iter().enumerate() {
            let index = method
                .ledger()
                .index(channel, Entry::Face { object: 0, face });
            let got = picture.powers.estimate(index);
            let name = scene.objects[0].shape.face_names()[face];
            let u = got.u.hypot((flux / 4.1e6).sqrt());
            println!(
                "{name} {}: {:.6} +- {:.6} for {flux}: {:+.2} %, {:+.1} u",
                ["R", "G", "B"][channel],
                got.value,
                got.u,
                100.0 * (got.value / flux - 1.0),
                (got.value - flux) / u
            );
            // A face that one photon in a hundred thousand finds has no error yet to speak of.
            assert!(
                (got.value - flux).abs() < 4.0 * u + 4e-5,
                "{name} {channel}"
            );
        }
    }
}

/// The radial exitance of marble, traced by Mitsuba's plugins.
#[test]
fn a_beam_on_a_slab_spreads_as_another_program_says() {
    let text = include_str!("../../../fixtures/render/profile_marbleG_n1.5.json");
    let reference: serde_json::Value = serde_json::from_str(text).unwrap();
    let numbers = |key: &str| -> Vec<f64> {
        let list = reference[key].as_array().unwrap();
        list.iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let edges_mm = numbers("r_edges");
    let (values, errors) = (numbers("R"), numbers("R_se"));
    let top = HalfSpace {
        point: Vec3::ZERO,
        normal: Vec3::Z,
    };
    let pencil = Light::Beam {
        from: Vec3::Z,
        direction: Vec3::NEG_Z,
        spot: Spot::Disk(0.0),
    };
    let marble = medium(2.62, 0.0041, 0.0, 1.5);
    let scene = scene(Shape::HalfSpace(top), vec![marble], pencil);
    let rings = Rings {
        object: 0,
        face: 0,
        center: Vec3::ZERO,
        edges_mm: edges_mm.clone(),
    };
    let options = Options {
        photons: effort(1000),
        rings: Some(rings),
        ..Options::default()
    };
    let method = MonteCarlo::new(&scene, options).unwrap();
    let mut picture = method.empty();
    method.run(0..40, &mut picture, &mut |_| ControlFlow::Continue(()));
    let (mut chi2, mut n, mut beyond) = (0.0, 0, 0);
    for k in 0..values.len() {
        let area = std::f64::consts::PI * (edges_mm[k + 1].powi(2) - edges_mm[k].powi(2));
        let index = method.ledger().index(0, Entry::Ring(k));
        let got = picture.powers.estimate(index);
        let (value, u) = (got.value / area, (got.u / area).hypot(errors[k]));
        if edges_mm[k] >= 0.1 && edges_mm[k + 1] <= 20.0 {
            chi2 += ((value - values[k]) / u).powi(2);
            n += 1;
            let near = (value / values[k] - 1.0).abs() < 0.01;
            beyond += i32::from(!near && (value - values[k]).abs() > 2.0 * u);
        }
    }
    println!("chi2 {chi2:.1} of {n}; {beyond} neither within 1 % nor within 2 standard errors");
    let expected = f64::from(n);
    assert!(
        (chi2 - expected).abs() < 4.0 * (2.0 * expected).sqrt(),
        "{chi2} of {n}"
    );
}

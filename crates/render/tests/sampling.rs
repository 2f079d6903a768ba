//! The BSSRDF integrates to what it should, whichever way its points are drawn.

mod sample;

use physics::random::stream;
use physics::{Medium, fresnel};
use render::bssrdf::{Bssrdf, Diffusion, Exit, Profile, Sampling};
use render::surface::{Point, Shader};
use render::{HalfSpace, Light, Mesh, Scene, Shape, Sphere, Vec3};
use sample::{dipole, scene};
use std::f64::consts::PI;

fn marble() -> Medium {
    Medium {
        sigma_a: 0.0041,
        sigma_s: 2.62,
        g: 0.0,
        eta: 1.5,
    }
}

/// Mean and standard error of the diffuse radiance of a point, by channel.
fn shaded(scene: &Scene, shader: &Bssrdf, point: &Point, n: u32, seed: u64) -> Vec<(f64, f64)> {
    let channels = scene.channels.len();
    let mut rng = stream(seed, &[]);
    let mut sums = vec![[0.0; 2]; channels];
    for _ in 0..n {
        let (mut single, mut diffuse) = (vec![0.0; channels], vec![0.0; channels]);
        shader.shade(
            scene,
            point,
            point.normal,
            &mut rng,
            &mut single,
            &mut diffuse,
        );
        for (sum, x) in sums.iter_mut().zip(diffuse) {
            sum[0] += x;
            sum[1] += x * x;
        }
    }
    let n = f64::from(n);
    let estimate = |[sum, square]: [f64; 2]| {
        let mean = sum / n;
        (mean, ((square / n - mean * mean) / n).sqrt())
    };
    sums.into_iter().map(estimate).collect()
}

#[test]
fn the_table_is_the_dipole() {
    for medium in [
        marble(),
        Medium {
            sigma_a: 1.0,
            sigma_s: 1.0,
            ..marble()
        },
    ] {
        let (dipole, Diffusion { profile, .. }) = dipole(&medium);
        let ratio = profile.total() / dipole.total_reflectance();
        assert!((ratio - 1.0).abs() < 2e-4, "{ratio}");
        for r in [0.01, 0.3, 2.0, 10.0] {
            let ratio = profile.value(r) / dipole.diffuse_reflectance(r);
            assert!((ratio - 1.0).abs() < 6e-4, "{r}: {ratio}");
        }
    }
}

/// A plane under parallel light: what comes out is R_d, all of it.
#[test]
fn over_a_plane_the_bssrdf_integrates_to_the_total() {
    let media = vec![
        marble(),
        Medium {
            sigma_a: 0.5,
            ..marble()
        },
    ];
    let totals: Vec<f64> = media
        .iter()
        .map(|m| dipole(m).0.total_reflectance())
        .collect();
    let light = Light::Distant {
        direction: Vec3::NEG_Z,
        radius: 0.0,
    };
    let top = HalfSpace {
        point: Vec3::ZERO,
        normal: Vec3::Z,
    };
    let scene = scene(Shape::HalfSpace(top), media.clone(), light);
    let point = Point {
        object: 0,
        at: Vec3::ZERO,
        true_normal: Vec3::Z,
        normal: Vec3::Z,
        coordinates: None,
    };
    for (sampling, n) in [
        (Sampling::Axes, 1_500_000),
        (Sampling::Exponential, 1_500_000),
    ] {
        let diffusion = media.iter().map(|m| dipole(m).1);
        let of_object = vec![diffusion.collect()];
        let shader = Bssrdf::new(&scene, of_object, Exit::Paper, false, sampling);
        for (channel, (got, u)) in shaded(&scene, &shader, &point, n, 5)
            .into_iter()
            .enumerate()
        {
            let passes = fresnel::entry_factor(1.5, 1.0);
            let expected = passes * totals[channel] * passes / PI;
            println!(
                "{sampling:?} {channel}: {:+.3} % +- {:.3} %",
                100.0 * (got / expected - 1.0),
                100.0 * u / expected
            );
            assert!(
                (got - expected).abs() < 4.0 * u + 3e-4 * expected,
                "{sampling:?}"
            );
            assert!(u < 4e-3 * expected, "{sampling:?}: {u}");
        }
    }
}

/// A ball under an even sky looks the same from everywhere, whichever way points are drawn.
#[test]
fn on_a_ball_all_samplers_agree() {
    let medium = Medium {
        sigma_a: 0.05,
        ..marble()
    };
    let ball = Sphere {
        center: Vec3::new(1.0, 2.0, 3.0),
        radius: 4.0,
    };
    let scene = scene(Shape::Sphere(ball), vec![medium], Light::Sky);
    let normal = Vec3::new(0.3, -0.2, 0.9).normalize();
    let point = Point {
        object: 0,
        at: ball.center + ball.radius * normal,
        true_normal: normal,
        normal,
        coordinates: None,
    };
    let found: Vec<(f64, f64)> = [
        (Sampling::Axes, 1_500_000),
        (Sampling::Exponential, 1_500_000),
        (Sampling::Area, 4_000_000),
    ]
    .into_iter()
    .map(|(sampling, n)| {
        let diffusion = dipole(&medium).1;
        let shader = Bssrdf::new(&scene, vec![vec![diffusion]], Exit::Paper, false, sampling);
        let (mean, u) = shaded(&scene, &shader, &point, n, 6)[0];
        println!(
            "{sampling:?}: {mean:.6} +- {u:.6}, variance a draw {:.4}",
            (u / mean).powi(2) * f64::from(n)
        );
        (mean, u)
    })
    .collect();
    for (mean, u) in &found[1..] {
        let u = u.hypot(found[0].1);
        assert!((mean - found[0].0).abs() < 4.0 * u, "{found:?}");
        assert!(u < 5e-3 * mean, "{found:?}");
    }
}

/// A ball of triangles, its poles on the z axis.
fn faceted(radius: f64) -> Mesh {
    let (rings, sides) = (24_u32, 48_u32);
    let mut vertices = vec![];
    for ring in 0..=rings {
        let (sin, cos) = (PI * f64::from(ring) / f64::from(rings)).sin_cos();
        for side in 0..sides {
            let (y, x) = (2.0 * PI * f64::from(side) / f64::from(sides)).sin_cos();
            vertices.push(radius * Vec3::new(sin * x, sin * y, cos));
        }
    }
    let mut triangles = vec![];
    for ring in 0..rings {
        for side in 0..sides {
            let at = |r: u32, s: u32| (ring + r) * sides + (side + s) % sides;
            triangles.push([at(0, 0), at(1, 0), at(1, 1)]);
            triangles.push([at(0, 0), at(1, 1), at(0, 1)]);
        }
    }
    Mesh::new(vertices, triangles, vec![], vec![]).expect("a mesh")
}

/// A mesh lit from one side, seen where its shadow begins: with R_d that has no bound near the
/// source, too, drawing by distance and light finds what drawing evenly does.
#[test]
fn on_a_mesh_in_half_shadow_the_samplers_agree() {
    let medium = Medium {
        sigma_a: 0.05,
        sigma_s: 0.6,
        ..marble()
    };
    let light = Light::Distant {
        direction: Vec3::NEG_X,
        radius: 0.0,
    };
    let scene = scene(Shape::Mesh(Box::new(faceted(4.0))), vec![medium], light);
    let at = Vec3::new(-0.6, 0.2, 8.0);
    let (object, hit) = scene.enter(at, Vec3::NEG_Z).expect("a hit");
    let point = Point {
        object,
        at: at + hit.distance * Vec3::NEG_Z,
        true_normal: hit.normal,
        normal: hit.normal,
        coordinates: None,
    };
    let steep = Profile::new(&medium, |radii, out| {
        for (r, value) in radii.iter().zip(out) {
            *value = (-r).exp() / r;
        }
    });
    let steep = Diffusion {
        profile: steep,
        share: 1.0,
        source_depth_mm: 0.0,
    };
    for diffusion in [dipole(&medium).1, steep] {
        let found: Vec<(f64, f64)> = [(Sampling::Axes, 150_000), (Sampling::Area, 600_000)]
            .into_iter()
            .map(|(sampling, n)| {
                let of_object = vec![vec![diffusion.clone()]];
                let shader = Bssrdf::new(&scene, of_object, Exit::Paper, false, sampling);
                let (mean, u) = shaded(&scene, &shader, &point, n, 7)[0];
                println!(
                    "{sampling:?}: {mean:.6} +- {u:.6}, variance a draw {:.4}",
                    (u / mean).powi(2) * f64::from(n)
                );
                (mean, u)
            })
            .collect();
        let u = found[0].1.hypot(found[1].1);
        assert!((found[1].0 - found[0].0).abs() < 4.0 * u, "{found:?}");
        assert!(u < 8e-3 * found[0].0, "{found:?}");
    }
}

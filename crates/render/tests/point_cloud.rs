//! The point cloud: its bell, its hierarchy, and the same light as by drawing points.

mod sample;

use physics::random::stream;
use physics::{DiffuseFresnel, Dipole, Medium, fresnel};
use render::bssrdf::{Bssrdf, Exit, Sampling};
use render::point_cloud::bell;
use render::surface::{Point, Shader};
use render::{
    Block, Gather, Light, Mesh, PointCloud, Scene, SceneError, Shape, Sphere, Spot, Vec3,
};
use sample::{dipole, scene};
use std::f64::consts::{PI, TAU};

fn medium(sigma_a: f64) -> Medium {
    Medium {
        sigma_a,
        sigma_s: 2.62,
        g: 0.0,
        eta: 1.5,
    }
}

fn total(medium: &Medium) -> f64 {
    dipole(medium).0.total_reflectance()
}

fn bssrdf(scene: &Scene) -> Bssrdf {
    let media = &scene.objects[0].material.media;
    let of_object = vec![media.iter().map(|medium| dipole(medium).1).collect()];
    Bssrdf::new(scene, of_object, Exit::Paper, false, Sampling::Axes)
}

fn cloud(scene: &Scene, gather: Gather) -> PointCloud<'_> {
    PointCloud::new(scene, bssrdf(scene), gather, 3, false).expect("a cloud")
}

/// A slab so large that its top is a plane as seen from the middle.
fn slab() -> Shape {
    Shape::Block(Block {
        min: Vec3::new(-20.0, -20.0, -30.0),
        max: Vec3::new(20.0, 20.0, 0.0),
    })
}

const DOWN: Light = Light::Distant {
    direction: Vec3::NEG_Z,
    radius: 0.0,
};

fn on_top(x: f64, y: f64) -> Point {
    Point {
        object: 0,
        at: Vec3::new(x, y, 0.0),
        true_normal: Vec3::Z,
        normal: Vec3::Z,
        coordinates: None,
    }
}

/// Mean and standard error over rounds of the exitance of a point, in the first channel.
fn mean(method: &PointCloud<'_>, point: &Point, rounds: u64) -> (f64, f64) {
    let mut sums = [0.0; 2];
    for round in 0..rounds {
        let mut out = vec![0.0; 1];
        method.cloud(round).exitance(point, &mut out);
        sums[0] += out[0];
        sums[1] += out[0] * out[0];
    }
    let n = rounds as f64;
    let mean = sums[0] / n;
    (mean, ((sums[1] / n - mean * mean) / (n - 1.0)).sqrt())
}

/// The page's norm is the integral of its bell, and on a plane under even light the points of a
/// cloud add up to it: every point of the surface sees all light that enters.
#[test]
fn the_bell_integrates_to_one() {
    let steps = 4000;
    let integral: f64 = (0..steps)
        .map(|k| {
            let r = 2.0 * (f64::from(k) + 0.5) / f64::from(steps);
            bell(1.7, r) * TAU * r * 2.0 / f64::from(steps)
        })
        .sum();
    assert!((integral - 1.0).abs() < 1e-6, "{integral}");

    let medium = medium(0.05);
    let scene = scene(slab(), vec![medium], DOWN);
    let method = cloud(&scene, Gather::Smoothstep { radius: Some(6.0) });
    let expected = total(&medium) * fresnel::entry_factor(1.5, 1.0);
    let made = method.cloud(0);
    let places = (0..400).map(|k| on_top(f64::from(k % 20) - 9.5, f64::from(k / 20) - 9.5));
    let found: Vec<f64> = places
        .map(|point| {
            let mut out = [0.0];
            made.exitance(&point, &mut out);
            out[0] / expected
        })
        .collect();
    let mean = found.iter().sum::<f64>() / 400.0;
    let worst = found.iter().map(|x| (x - 1.0).abs()).fold(0.0, f64::max);
    println!(
        "{} points, mean {mean:.5}, worst {worst:.5}",
        made.points(0)
    );
    assert!((mean - 1.0).abs() < 1e-3, "{mean}");
    assert!(worst < 5e-3, "{worst}");
}

/// A plane under parallel light returns R_d, all of it; a beam, R_d at its distance.
#[test]
fn on_a_plane_it_is_the_dipole() {
    let medium = medium(0.05);
    let lit = scene(slab(), vec![medium], DOWN);
    let method = cloud(&lit, Gather::HIERARCHY);
    let enters = fresnel::entry_factor(1.5, 1.0);
    let (found, u) = mean(&method, &on_top(0.3, -0.4), 40);
    let expected = total(&medium) * enters;
    println!("even light: {:.5} +- {:.5}", found / expected, u / expected);
    assert!((found - expected).abs() < 4.0 * u + 1e-3 * expected);
    assert!(u < 5e-3 * expected, "{u}");

    let beam = Light::Beam {
        from: Vec3::new(1.0, 0.0, 50.0),
        direction: Vec3::NEG_Z,
        spot: Spot::Disk(0.02),
    };
    let scene = scene(slab(), vec![medium], beam);
    let method = cloud(&scene, Gather::HIERARCHY);
    let dipole = Dipole::new(&medium.reduced(), DiffuseFresnel::Exact);
    for r in [0.5, 2.0, 5.0] {
        let (found, u) = mean(&method, &on_top(1.0, r), 20);
        let expected = dipole.diffuse_reflectance(r) * enters;
        println!("r = {r}: {:.5} +- {:.5}", found / expected, u / expected);
        // The table of R_d is a line between logarithms; the spot is no point.
        assert!((found - expected).abs() < 4.0 * u + 5e-3 * expected, "{r}");
    }
}

/// On a ball under a sky, and on a block under a lamp from the side, it is what drawing points
/// finds.
#[test]
fn it_agrees_with_drawn_points() {
    let ball = Sphere {
        center: Vec3::new(1.0, 2.0, 3.0),
        radius: 4.0,
    };
    let block = Block {
        min: Vec3::splat(-3.0),
        max: Vec3::new(3.0, 4.0, 2.0),
    };
    let lamp = Light::Area {
        corner: Vec3::new(-6.0, -3.0, 9.0),
        u: Vec3::new(0.0, 4.0, 0.0),
        v: Vec3::new(4.0, 0.0, 2.0),
    };
    let normal = Vec3::new(0.3, -0.2, 0.9).normalize();
    let on_ball = ball.center + ball.radius * normal;
    for (name, shape, light, at, normal) in [
        ("ball", Shape::Sphere(ball), Light::Sky, on_ball, normal),
        (
            "block",
            Shape::Block(block),
            lamp,
            Vec3::new(3.0, 1.0, 1.0),
            Vec3::X,
        ),
    ] {
        let scene = scene(shape, vec![medium(0.05)], light);
        let point = Point {
            object: 0,
            at,
            true_normal: normal,
            normal,
            coordinates: None,
        };
        let method = cloud(&scene, Gather::HIERARCHY);
        let (found, u) = mean(&method, &point, 60);
        let shader = bssrdf(&scene);
        let mut rng = stream(7, &[]);
        let n = 400_000;
        let (mut sum, mut square) = (0.0, 0.0);
        for _ in 0..n {
            let mut out = [0.0];
            shader.shade(&scene, &point, normal, &mut rng, &mut [0.0], &mut out);
            sum += out[0];
            square += out[0] * out[0];
        }
        let leaves = fresnel::entry_factor(1.5, 1.0) / PI;
        let drawn = sum / f64::from(n) / leaves;
        let variance = (square / f64::from(n) / leaves.powi(2) - drawn * drawn) / f64::from(n);
        let all = variance.sqrt().hypot(u);
        println!(
            "{name}: cloud {found:.5} +- {u:.5}, drawn {drawn:.5} +- {:.5}",
            variance.sqrt()
        );
        assert!((found - drawn).abs() < 4.0 * all + 1e-3 * drawn, "{name}");
        assert!(all < 0.02 * drawn, "{name}");
    }
}

/// A ball with bumps, of triangles.
fn bumpy(steps: usize) -> Shape {
    let vertex = |i: usize, j: usize| {
        let polar = PI * i as f64 / steps as f64;
        let around = TAU * (j % (2 * steps)) as f64 / (2 * steps) as f64;
        let (x, y) = (polar.sin() * around.cos(), polar.sin() * around.sin());
        let bump = 1.0 + 0.15 * (6.0 * x).sin() * (5.0 * y).cos() * (4.0 * polar).cos();
        15.0 * bump * Vec3::new(x, y, polar.cos())
    };
    let across = 2 * steps + 1;
    let vertices = (0..=steps)
        .flat_map(|i| (0..across).map(move |j| vertex(i, j)))
        .collect();
    let at = |i: usize, j: usize| (i * across + j) as u32;
    let triangles = (0..steps)
        .flat_map(|i| {
            (0..2 * steps).flat_map(move |j| {
                let [a, b] = [at(i, j), at(i, j + 1)];
                let [c, d] = [at(i + 1, j), at(i + 1, j + 1)];
                [[a, c, d], [a, d, b]]
            })
        })
        .collect();
    Shape::Mesh(Box::new(
        Mesh::new(vertices, triangles, vec![], vec![]).expect("a mesh"),
    ))
}

/// What the hierarchy leaves out is below 0.5 %, where a surface is bright and where it is not.
#[test]
fn the_hierarchy_is_the_sum_over_all_points() {
    let media = vec![medium(0.002), medium(0.05), medium(1.0)];
    let light = Light::Distant {
        direction: Vec3::new(1.0, 0.2, -0.3).normalize(),
        radius: 0.0,
    };
    for shape in [bumpy(60), slab()] {
        let scene = scene(shape, media.clone(), light);
        let whole = cloud(&scene, Gather::Hierarchy { solid_angle: 0.0 });
        let method = cloud(&scene, Gather::HIERARCHY);
        let (whole, nodes) = (whole.cloud(0), method.cloud(0));
        let mut rng = stream(8, &[]);
        let mut worst = 0.0_f64;
        let mut mean = [0.0; 3];
        let mut found = vec![];
        for _ in 0..150 {
            let next = |rng: &mut _| 2.0 * physics::random::uniform(rng) - 1.0;
            let [x, y, z] = std::array::from_fn(|_| next(&mut rng));
            let from = 60.0 * Vec3::new(x, y, z).normalize();
            let Some((object, hit)) = scene.enter(from, -from.normalize()) else {
                continue;
            };
            let point = Point {
                object,
                at: from - hit.distance * from.normalize(),
                true_normal: hit.normal,
                normal: hit.normal,
                coordinates: None,
            };
            let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
            whole.exitance(&point, &mut a);
            nodes.exitance(&point, &mut b);
            for channel in 0..3 {
                mean[channel] += a[channel] / 150.0;
            }
            found.push((a, b));
        }
        let mut square = 0.0;
        for (a, b) in &found {
            for channel in 0..3 {
                // Of what is there, but not of what is a hundredth of the picture's mean.
                let relative = (b[channel] - a[channel]) / a[channel].max(0.01 * mean[channel]);
                worst = worst.max(relative.abs());
                square += relative * relative / (3 * found.len()) as f64;
            }
        }
        println!(
            "{} points: worst {:.3} %, rms {:.3} %",
            whole.points(0),
            100.0 * worst,
            100.0 * square.sqrt()
        );
        assert!(worst < 5e-3, "{worst}");
    }
}

#[test]
fn an_endless_surface_is_refused() {
    let half_space = Shape::HalfSpace(render::HalfSpace {
        point: Vec3::ZERO,
        normal: Vec3::Z,
    });
    let scene = scene(half_space, vec![medium(0.05)], DOWN);
    let refused = PointCloud::new(&scene, bssrdf(&scene), Gather::HIERARCHY, 1, false);
    assert_eq!(
        refused.err(),
        Some(SceneError::Coverless("sample".to_owned()))
    );
}

//! Light that is drawn once for all pixels is the light that each would draw.

mod sample;

use physics::Medium;
use physics::random::stream;
use render::bssrdf::{Bssrdf, Diffusion, Exit, Profile, Sampling};
use render::surface::{Point, Shader};
use render::{Block, Light, Mesh, Method, Pooled, Scene, Shape, Sphere, Vec3};
use sample::{dipole, scene};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

fn medium(sigma_s: f64) -> Medium {
    Medium {
        sigma_a: 0.02 * sigma_s,
        sigma_s,
        g: 0.0,
        eta: 1.5,
    }
}

/// Of each medium the dipole's; of the third, an R_d that has no bound.
fn bssrdf(scene: &Scene) -> Bssrdf {
    let media = &scene.objects[0].material.media;
    let mut of_object: Vec<Diffusion> = media.iter().map(|medium| dipole(medium).1).collect();
    if let (Some(medium), Some(third)) = (media.get(2), of_object.get_mut(2)) {
        let profile = Profile::new(medium, |radii, out| {
            for (r, value) in radii.iter().zip(out) {
                *value = (-r).exp() / r;
            }
        });
        *third = Diffusion {
            profile,
            share: 1.0,
            source_depth_mm: 0.0,
        };
    }
    Bssrdf::new(scene, vec![of_object], Exit::Paper, false, Sampling::Axes)
}

/// A ring about z, whose inner side is hollow along one direction and lies in its own shadow.
fn ring() -> Shape {
    let (radius, thickness) = (6.0, 2.5);
    const AROUND: usize = 36;
    const ACROSS: usize = 18;
    let vertex = |i: usize, j: usize| {
        let (sin, cos) = (TAU * i as f64 / AROUND as f64).sin_cos();
        let (high, out) = (TAU * j as f64 / ACROSS as f64).sin_cos();
        let r = radius + thickness * out;
        Vec3::new(r * cos, r * sin, thickness * high)
    };
    let vertices = (0..AROUND).flat_map(|i| (0..ACROSS).map(move |j| vertex(i, j)));
    let at = |i: usize, j: usize| ((i % AROUND) * ACROSS + j % ACROSS) as u32;
    let quads = (0..AROUND).flat_map(|i| (0..ACROSS).map(move |j| (i, j)));
    let triangles = quads.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    let mesh = Mesh::new(vertices.collect(), triangles.collect(), vec![], vec![]);
    let mesh = mesh.expect("a mesh");
    assert!(mesh.warnings().is_empty(), "{:?}", mesh.warnings());
    Shape::Mesh(Box::new(mesh))
}

fn ball() -> Shape {
    Shape::Sphere(Sphere {
        center: Vec3::new(1.0, 2.0, 3.0),
        radius: 4.0,
    })
}

fn block() -> Shape {
    Shape::Block(Block {
        min: Vec3::splat(-3.0),
        max: Vec3::new(3.0, 4.0, 2.0),
    })
}

const SLANTED: Light = Light::Area {
    corner: Vec3::new(-9.0, -3.0, 9.0),
    u: Vec3::new(0.0, 4.0, 0.0),
    v: Vec3::new(4.0, 0.0, 2.0),
};

/// Means and standard errors of each number that `draw` fills in.
fn mean(channels: usize, n: u64, mut draw: impl FnMut(u64, &mut [f64])) -> Vec<(f64, f64)> {
    let mut sums = vec![[0.0; 2]; channels];
    for index in 0..n {
        let mut out = vec![0.0; channels];
        draw(index, &mut out);
        for (sum, x) in sums.iter_mut().zip(out) {
            sum[0] += x;
            sum[1] += x * x;
        }
    }
    let n = n as f64;
    let estimate = |[sum, square]: [f64; 2]| {
        let mean = sum / n;
        (mean, ((square / n - mean * mean) / (n - 1.0)).sqrt())
    };
    sums.into_iter().map(estimate).collect()
}

/// What all pixels share is on the mean what a pixel draws for itself: on a ball, beside the edge of a
/// block between light and shadow, on a ring that shades itself; where R_d is wide, where it is so narrow that points
/// are too few, and where it has no bound.
#[test]
fn the_pool_is_what_drawing_finds() {
    let cases: [(_, fn() -> Shape, _, _, _, _); 3] = [
        (
            "ball",
            ball,
            Light::Sky,
            [9.0, 3.0, 9.0],
            [-8.0, -1.0, -6.0],
            5e-3,
        ),
        (
            "block",
            block,
            SLANTED,
            [-20.0, 0.4, 1.94],
            [20.0, 0.1, 0.0],
            1.2e-2,
        ),
        (
            "ring",
            ring,
            SLANTED,
            [0.5, 0.7, 5.0],
            [0.6, -0.3, -1.0],
            8e-3,
        ),
    ];
    for (name, shape, light, from, toward, sharp) in cases {
        let media = vec![medium(0.4), medium(8.0), medium(0.4)];
        let channels = media.len();
        let scene = scene(shape(), media, light);
        let (from, toward) = (Vec3::from(from), Vec3::from(toward).normalize());
        let (object, hit) = scene.enter(from, toward).expect("a hit");
        let point = Point::new(&scene, object, from + hit.distance * toward, &hit);
        let shader = bssrdf(&scene);
        let mut rng = stream(7, &[]);
        let shade = |shader: &dyn Shader, rng: &mut _, out: &mut [f64]| {
            let mut single = vec![0.0; channels];
            shader.shade(&scene, &point, point.normal, rng, &mut single, out);
        };
        let drawn = mean(channels, 1_200_000, |_, out| shade(&shader, &mut rng, out));
        let method = Pooled::new(&scene, shader, 3, false);
        let pooled = mean(channels, 1200, |round, out| {
            let pool = method.pool(round);
            for _ in 0..100 {
                shade(&pool, &mut rng, out);
            }
            out.iter_mut().for_each(|x| *x /= 100.0);
        });
        let pairs = pooled.iter().zip(&drawn).enumerate();
        for (channel, (&(a, u_a), &(b, u_b))) in pairs {
            let u = u_a.hypot(u_b);
            println!(
                "{name} {channel}: {:.5} +- {:.5} of what is drawn, +- {:.5}",
                a / b,
                u_a / b,
                u_b / b
            );
            assert!((a - b).abs() < 4.0 * u, "{name} {channel}: {a} {b} +- {u}");
            assert!(u < sharp * b, "{name} {channel}: {u}");
        }
    }
}

/// Of the points of a round a pixel looks at few, and yet its looks are nearly alike: where R_d is wide, and
/// where it is narrow.
#[test]
fn looks_at_one_pool_are_alike() {
    let media = vec![medium(0.4), medium(2.0)];
    let scene = scene(block(), media, SLANTED);
    let (from, toward) = (Vec3::new(-20.0, 0.4, 1.0), Vec3::new(1.0, 0.0, 0.0));
    let (object, hit) = scene.enter(from, toward).expect("a hit");
    let point = Point::new(&scene, object, from + hit.distance * toward, &hit);
    let method = Pooled::new(&scene, bssrdf(&scene), 3, false);
    let pool = method.pool(0);
    let mut rng = stream(7, &[]);
    const LOOKS: u64 = 2000;
    let found = mean(2, LOOKS, |_, out| {
        pool.shade(&scene, &point, point.normal, &mut rng, &mut [0.0; 2], out);
    });
    for (channel, (mean, u)) in found.into_iter().enumerate() {
        let scatter = u * (LOOKS as f64).sqrt() / mean;
        println!("{channel}: a look scatters by {scatter:.4}");
        assert!(scatter < 0.06, "{channel}: {scatter}");
    }
}

/// Rounds are the same whatever threads make them.
#[test]
fn threads_change_no_byte() {
    let scene = scene(block(), vec![medium(0.4)], SLANTED);
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().expect("threads").install(|| {
            let method = Pooled::new(&scene, bssrdf(&scene), 3, true);
            let mut picture = method.empty();
            method.run(0..4, &mut picture, &mut |_| ControlFlow::Continue(()));
            picture
        })
    });
    assert!(one.radiance.estimate(1).value > 0.0, "no diffuse light");
    assert_eq!(one, two);
}

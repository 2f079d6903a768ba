//! Textures: one that is the same everywhere is none, inside large cells the plain material is
//! seen, and no light is lost between them.

mod sample;

use physics::random::{stream, uniform};
use physics::{DiffuseFresnel, Dipole, Medium, ReducedMedium, fresnel};
use render::bssrdf::{Bssrdf, Exit, Family, Sampling};
use render::surface::{Point, Shader};
use render::{
    Block, Brdf, Gather, HalfSpace, Kind, Light, MonteCarlo, Options, PointCloud, Scene,
    SceneError, Shape, Sphere, Texture, Vec3,
};
use sample::{dipole, scene};
use std::f64::consts::PI;

/// Of numbers that single precision has, so that the spacing of points is the same, too.
const MARBLE: Medium = Medium {
    sigma_a: 0.03125,
    sigma_s: 5.25,
    g: 0.5,
    eta: 1.5,
};
const DARK: Medium = Medium {
    sigma_a: 0.6,
    sigma_s: 1.6,
    ..MARBLE
};
const SLANTED: f64 = 0.6;

fn slanted() -> Light {
    Light::Distant {
        direction: Vec3::new(-SLANTED.sin(), 0.0, -SLANTED.cos()),
        radius: 0.0,
    }
}

/// A texture of one channel, `width` texels a row.
fn texture(media: &[Medium], width: usize, size: [f64; 2]) -> Texture {
    Texture {
        width,
        height: media.len() / width,
        size,
        texels: vec![
            media
                .iter()
                .map(|m| [m.sigma_a as f32, m.sigma_s as f32])
                .collect(),
        ],
    }
}

fn textured(mut scene: Scene, texture: Texture) -> Scene {
    scene.objects[0].material.texture = Some(texture);
    scene.validated().expect("a scene")
}

/// The dipole's for all media of the texture of a scene, or of its one medium.
fn bssrdf(scene: &Scene) -> Bssrdf {
    let material = &scene.objects[0].material;
    let base = material.media[0];
    let family = if material.texture.is_none() {
        dipole(&base).1.into()
    } else {
        let media = material.representatives(0);
        let albedo = |m: &Medium| m.reduced().coefficients().albedo_prime();
        let ends = media.iter().map(albedo);
        let ends = ends.fold([1.0_f64, 0.0_f64], |[low, high], a| {
            [low.min(a), high.max(a)]
        });
        let albedos = Family::albedos(ends);
        let tables = albedos.iter().map(|albedo| {
            let medium = ReducedMedium {
                sigma_a: 1.0 - albedo,
                sigma_s_prime: *albedo,
                eta: base.eta,
            };
            dipole(&medium.with_g(base.g)).1
        });
        Family::between(&albedos, tables.collect())
    };
    Bssrdf::new(scene, vec![vec![family]], Exit::Paper, true, Sampling::Axes)
}

fn on_top(scene: &Scene, x: f64, y: f64) -> Point {
    let from = Vec3::new(x, y, 900.0);
    let (object, hit) = scene.enter(from, Vec3::NEG_Z).expect("a hit");
    let at = from + hit.distance * Vec3::NEG_Z;
    Point::new(scene, object, at, &hit)
}

/// Means of single and diffuse radiance along the normal and their standard errors.
fn shaded(scene: &Scene, shader: &dyn Shader, point: &Point, n: u32) -> [(f64, f64); 2] {
    let mut rng = stream(9, &[]);
    let mut sums = [[0.0; 2]; 2];
    for _ in 0..n {
        let (mut single, mut diffuse) = ([0.0], [0.0]);
        shader.shade(
            scene,
            point,
            point.normal,
            &mut rng,
            &mut single,
            &mut diffuse,
        );
        for (sum, [x]) in sums.iter_mut().zip([single, diffuse]) {
            sum[0] += x;
            sum[1] += x * x;
        }
    }
    let n = f64::from(n);
    sums.map(|[sum, square]| {
        let mean = sum / n;
        (mean, ((square / n - mean * mean).max(0.0) / n).sqrt())
    })
}

fn plane() -> Shape {
    Shape::HalfSpace(HalfSpace {
        point: Vec3::ZERO,
        normal: Vec3::Z,
    })
}

fn slab() -> Shape {
    Shape::Block(Block {
        min: Vec3::new(-30.0, -30.0, -10.0),
        max: Vec3::new(30.0, 30.0, 0.0),
    })
}

/// The same draws, and so the same light but for rounding: texels are in single precision.
#[test]
fn a_texture_that_is_the_same_everywhere_is_none() {
    let ball = || {
        Shape::Sphere(Sphere {
            center: Vec3::ZERO,
            radius: 5.0,
        })
    };
    for (shape, again, light, size) in [
        (plane(), plane(), slanted(), 3.0),
        (ball(), ball(), Light::Sky, 1.0),
    ] {
        let plain = scene(shape, vec![MARBLE], light);
        let base = scene(again, vec![DARK], light);
        let same = textured(base, texture(&[MARBLE; 6], 3, [size; 2]));
        let [here, there] = [&plain, &same].map(|s| on_top(s, 0.3, 0.1));
        assert!(here.coordinates.is_none() && there.coordinates.is_some());
        for kind in [Kind::Lambert, Kind::Jensen] {
            let a = shaded(&plain, &Brdf::new(&plain, kind), &here, 20);
            let b = shaded(&same, &Brdf::new(&same, kind), &there, 20);
            for (a, b) in a.iter().zip(b) {
                assert!((a.0 - b.0).abs() <= 1e-5 * a.0, "{a:?} {b:?}");
            }
        }
        let a = shaded(&plain, &bssrdf(&plain), &here, 3000);
        let b = shaded(&same, &bssrdf(&same), &there, 3000);
        for (a, b) in a.iter().zip(b) {
            assert!((a.0 - b.0).abs() <= 1e-4 * a.0, "{a:?} {b:?}");
        }
    }
    let plain = scene(slab(), vec![MARBLE], slanted());
    let base = scene(slab(), vec![DARK], slanted());
    let same = textured(base, texture(&[MARBLE; 6], 3, [7.0; 2]));
    for gather in [Gather::HIERARCHY, Gather::Smoothstep { radius: None }] {
        let exitance = |scene: &Scene| {
            let cloud = PointCloud::new(scene, bssrdf(scene), gather, 3, false).expect("a cloud");
            let mut out = [0.0];
            let cloud = cloud.cloud(0);
            cloud.exitance(&on_top(scene, 0.3, 0.1), &mut out);
            out[0]
        };
        let (a, b) = (exitance(&plain), exitance(&same));
        assert!((a - b).abs() <= 1e-4 * a, "{gather:?}: {a} {b}");
    }
}

/// A board of cells of 15 mm: 20 and more mean free paths of what light goes through.
#[test]
fn inside_large_cells_the_plain_materials_are_seen() {
    let bright = Medium {
        sigma_a: 0.2,
        ..MARBLE
    };
    const CELLS: usize = 30;
    let board: Vec<Medium> = (0..CELLS * CELLS)
        .map(|k| {
            let odd = (2 * (k % CELLS) / CELLS + 2 * (k / CELLS) / CELLS) % 2;
            [bright, DARK][odd]
        })
        .collect();
    let board = || texture(&board, CELLS, [30.0; 2]);
    let cases: [fn() -> Shape; 2] = [plane, slab];
    for shape in cases {
        let chequered = textured(scene(shape(), vec![MARBLE], slanted()), board());
        // The first row is the upper one, and the picture begins at the lowest corner.
        for (medium, x, y) in [(bright, 7.5, 22.5), (DARK, 7.5, 7.5)] {
            let plain = scene(shape(), vec![medium], slanted());
            let there = if chequered.objects[0].shape.bounds().is_some() {
                on_top(&chequered, x - 30.0, y - 30.0)
            } else {
                on_top(&chequered, x, y)
            };
            let here = on_top(&plain, 0.0, 0.0);
            let brdf = Kind::Jensen;
            let a = shaded(&plain, &Brdf::new(&plain, brdf), &here, 1);
            let b = shaded(&chequered, &Brdf::new(&chequered, brdf), &there, 1);
            assert!((a[1].0 / b[1].0 - 1.0).abs() < 1e-6, "{a:?} {b:?}");
            if chequered.objects[0].shape.bounds().is_none() {
                let a = shaded(&plain, &bssrdf(&plain), &here, 25_000);
                let b = shaded(&chequered, &bssrdf(&chequered), &there, 40_000);
                for (a, b) in a.iter().zip(b) {
                    let u = a.1.hypot(b.1);
                    println!("{:.5} +- {u:.5} for {:.5}", b.0, a.0);
                    assert!((a.0 - b.0).abs() < 4.0 * u + 2e-3 * a.0, "{a:?} {b:?}");
                    assert!(u < 0.02 * a.0, "{a:?} {b:?}");
                }
                continue;
            }
            let expected = dipole(&medium).0.total_reflectance()
                * fresnel::entry_factor(1.5, SLANTED.cos())
                * SLANTED.cos();
            for gather in [Gather::HIERARCHY, Gather::Smoothstep { radius: None }] {
                let method = PointCloud::new(&chequered, bssrdf(&chequered), gather, 3, false);
                let method = method.expect("a cloud");
                let cloud = method.cloud(0);
                let mut out = [0.0];
                for k in 0..25 {
                    let [dx, dy] = [k / 5, k % 5].map(|j| 0.7 * f64::from(j) - 1.4);
                    let at = there.at + Vec3::new(dx, dy, 0.0);
                    cloud.exitance(&on_top(&chequered, at.x, at.y), &mut out);
                }
                let found = out[0] / 25.0;
                println!("{gather:?}: {:.4}", found / expected);
                // The bells of the dark tiles are met by few points each.
                assert!((found / expected - 1.0).abs() < 0.015, "{gather:?}");
            }
        }
    }
}

/// Nodes stand for points of media that are alike, however finely these are mixed: a board of two
/// materials, and one whose texels are all a little, or much, apart.
#[test]
fn the_hierarchy_of_a_board_is_the_sum_over_all_points() {
    let board = texture(&[MARBLE, DARK, DARK, MARBLE], 2, [6.0; 2]);
    let mut rng = stream(11, &[]);
    let grain: Vec<Medium> = (0..400)
        .map(|k| {
            let base = [MARBLE, DARK][(k / 10 + k / 200) % 2];
            Medium {
                sigma_a: base.sigma_a * (-3.0 * uniform(&mut rng)).exp(),
                sigma_s: base.sigma_s * (1.0 + 0.5 * uniform(&mut rng)),
                ..base
            }
        })
        .collect();
    // On a ball the depth of the source counts, which is each medium's own.
    let ball = Shape::Sphere(Sphere {
        center: Vec3::ZERO,
        radius: 12.0,
    });
    let bands = texture(&grain, 20, [0.5, 1.0]);
    let grain = texture(&grain, 20, [6.0; 2]);
    for (shape, texture) in [(slab(), board), (slab(), grain), (ball, bands)] {
        let scene = textured(scene(shape, vec![MARBLE], slanted()), texture);
        let of = |gather| PointCloud::new(&scene, bssrdf(&scene), gather, 3, false);
        let all = of(Gather::Hierarchy { solid_angle: 0.0 }).expect("a cloud");
        let nodes = of(Gather::HIERARCHY).expect("a cloud");
        let (all, nodes) = (all.cloud(0), nodes.cloud(0));
        let mut worst = 0.0_f64;
        for k in 0..12 {
            let point = on_top(&scene, f64::from(k) - 6.2, 0.7 * f64::from(k));
            let (mut a, mut b) = ([0.0], [0.0]);
            all.exitance(&point, &mut a);
            nodes.exitance(&point, &mut b);
            worst = worst.max((b[0] / a[0] - 1.0).abs());
        }
        println!("{} points: worst {:.3} %", all.points(0), 100.0 * worst);
        assert!(worst < 5e-3, "{worst}");
    }
}

/// Stripes finer than a mean free path: what leaves a stripe comes from all, and together they
/// return what each returns of the light that enters there. R_d is that of where light enters.
#[test]
fn between_stripes_no_light_is_lost() {
    // Two texels: a line from one to the other and back.
    let stripes = texture(&[MARBLE, DARK], 2, [0.4, 0.4]);
    let steps = 200;
    let expected: f64 = (0..steps)
        .map(|k| {
            let part = (f64::from(k) + 0.5) / f64::from(steps);
            let between = |a: f64, b: f64| a + part * (b - a);
            let medium = ReducedMedium {
                sigma_a: between(MARBLE.sigma_a, DARK.sigma_a),
                sigma_s_prime: 0.5 * between(MARBLE.sigma_s, DARK.sigma_s),
                eta: 1.5,
            };
            Dipole::new(&medium, DiffuseFresnel::Exact).total_reflectance() / f64::from(steps)
        })
        .sum();
    let passes = [SLANTED.cos(), 1.0].map(|cos| fresnel::entry_factor(1.5, cos));
    let expected = expected * SLANTED.cos() * passes[0] * passes[1] / PI;
    let striped = textured(scene(plane(), vec![MARBLE], slanted()), stripes);
    let shader = bssrdf(&striped);
    let mut rng = stream(4, &[]);
    let n = 80_000;
    let (mut sum, mut square) = (0.0, 0.0);
    for _ in 0..n {
        let point = on_top(&striped, 0.4 * uniform(&mut rng), 0.0);
        let mut out = [0.0];
        shader.shade(&striped, &point, Vec3::Z, &mut rng, &mut [0.0], &mut out);
        sum += out[0];
        square += out[0] * out[0];
    }
    let n = f64::from(n);
    let mean = sum / n;
    let u = ((square / n - mean * mean) / n).sqrt();
    println!("{:.5} +- {:.5}", mean / expected, u / expected);
    assert!((mean - expected).abs() < 4.0 * u + 5e-4 * expected);
    assert!(u < 0.01 * expected);
    // And they blend: e^(-kz) of a wave of 0.4 mm from sources 0.4 mm deep is 2e-3. Were it the
    // medium where light leaves, the dark ones would have a third of the light.
    for x in [0.1, 0.3] {
        let [_, (found, u)] = shaded(&striped, &shader, &on_top(&striped, x, 0.0), 40_000);
        println!("{x}: {:.4} +- {:.4}", found / expected, u / expected);
        assert!((found - expected).abs() < 4.0 * u + 0.01 * expected, "{x}");
        assert!(u < 0.02 * expected);
    }
}

/// Light that scattered once meets the medium of its exit on the way out and that of its entry on
/// the way in: without a boundary an integral by hand, where one half of the plane is another.
#[test]
fn single_scattering_knows_both_ends() {
    let [out, into] = [(1e-3, 2e-3), (4e-3, 1e-3)].map(|(sigma_a, sigma_s)| Medium {
        sigma_a,
        sigma_s,
        g: 0.0,
        eta: 1.0,
    });
    // Texels of 5 mm, and mean free paths of hundreds: light comes in from the right, over the edge
    // beside the point.
    const TEXELS: usize = 8000;
    let halves: Vec<Medium> = (0..TEXELS)
        .map(|k| if k < TEXELS / 2 { out } else { into })
        .collect();
    let halves = texture(&halves, TEXELS, [5.0 * TEXELS as f64, 1.0]);
    let edge = 2.5 * TEXELS as f64;
    let scene = textured(scene(plane(), vec![out], slanted()), halves);
    let point = on_top(&scene, edge - 2.5, 0.0);
    let (found, u) = shaded(&scene, &bssrdf(&scene), &point, 100_000)[0];
    let expected = out.sigma_s / (4.0 * PI) / (out.sigma_t() + into.sigma_t() / SLANTED.cos());
    println!("{found:.6} +- {u:.6} for {expected:.6}");
    assert!((found - expected).abs() < 4.0 * u + 0.01 * expected);
    assert!(u < 0.01 * expected);
}

#[test]
fn what_no_texture_can_be_is_refused() {
    let with = |change: fn(&mut Texture)| {
        let mut scene = scene(plane(), vec![MARBLE], slanted());
        let mut found = texture(&[MARBLE; 6], 3, [1.0; 2]);
        change(&mut found);
        scene.objects[0].material.texture = Some(found);
        scene.validated()
    };
    assert!(with(|_| {}).is_ok());
    let missing = |t: Result<Scene, SceneError>| matches!(t, Err(SceneError::Texture { .. }));
    assert!(missing(with(|t| t.width = 4)));
    assert!(missing(with(|t| t.texels.clear())));
    assert!(missing(with(|t| t.size[1] = f64::NAN)));
    for bad in [[-1.0, 1.0], [1.0, f32::NAN], [0.0, 0.0]] {
        let mut scene = scene(plane(), vec![MARBLE], slanted());
        let mut found = texture(&[MARBLE; 6], 3, [1.0; 2]);
        found.texels[0][4] = bad;
        scene.objects[0].material.texture = Some(found);
        let error = scene.validated().expect_err("no medium");
        let at = matches!(
            error,
            SceneError::Texel {
                column: 1,
                row: 1,
                ..
            }
        );
        assert!(at, "{error}");
    }
    let scene = with(|_| {}).expect("a scene");
    assert_eq!(
        MonteCarlo::new(&scene, Options::default()).err(),
        Some(SceneError::Textured("sample".to_owned()))
    );
}

//! Lamps and their mirror images: as bright as they are, and with little noise at their edges.

use physics::Medium;
use physics::random::Stream;
use render::camera::Lens;
use render::surface::{Point, Shader};
use render::{
    Camera, HalfSpace, Lamp, Light, Material, Method, Object, Scene, Shaded, Shape, Vec3, View,
};
use std::ops::ControlFlow;

const PIXELS: usize = 8;
const SIDE_MM: f64 = 2.0;
/// The lamp's edges, mm: none on an edge of a pixel, and none in the middle.
const LOW: [f64; 2] = [-4.7, -2.6];
const HIGH: [f64; 2] = [3.4, 5.3];

/// A mirror from above, and a lamp over it whose lit side looks down: the camera sees its image
/// where it is.
fn scene() -> Scene {
    let view = View {
        from: Vec3::new(0.0, 0.0, 900.0),
        to: Vec3::ZERO,
        up: Vec3::Y,
        width: PIXELS,
        height: PIXELS,
    };
    let height = PIXELS as f64 * SIDE_MM;
    Scene {
        channels: vec!["Y".into()],
        objects: vec![Object {
            name: "mirror".into(),
            shape: Shape::HalfSpace(HalfSpace {
                point: Vec3::ZERO,
                normal: Vec3::Z,
            }),
            material: Material {
                media: vec![Medium {
                    sigma_a: 1.0,
                    sigma_s: 1.0,
                    g: 0.0,
                    eta: 1.5,
                }],
                texture: None,
            },
        }],
        lamps: vec![Lamp {
            light: Light::Area {
                corner: Vec3::new(LOW[0], LOW[1], 50.0),
                u: Vec3::new(0.0, HIGH[1] - LOW[1], 0.0),
                v: Vec3::new(HIGH[0] - LOW[0], 0.0, 0.0),
            },
            strength: vec![25.0],
        }],
        camera: Camera::new(view, Lens::Orthographic { height }).expect("a camera"),
    }
    .validated()
    .expect("a scene")
}

/// As bright as it is far to the right and up, and shaded so often.
struct Slope(u32);

impl Shader for Slope {
    fn shaded(&self) -> u32 {
        self.0
    }

    fn shade(
        &self,
        _: &Scene,
        point: &Point,
        _: Vec3,
        _: &mut Stream,
        single: &mut [f64],
        diffuse: &mut [f64],
    ) {
        single[0] += point.at.x;
        diffuse[0] += point.at.y;
    }
}

/// Of the square of a pixel, from `low` mm on, what is between the edges.
fn covered(low: f64, axis: usize) -> f64 {
    (HIGH[axis].min(low + SIDE_MM) - LOW[axis].max(low)).max(0.0) / SIDE_MM
}

#[test]
fn a_pixel_is_the_mean_over_its_square() {
    let scene = scene();
    for shaded in [1, 2, 4] {
        let method = Shaded::new(&scene, Slope(shaded), 3, true);
        let mut picture = method.empty();
        method.run(0..1000, &mut picture, &mut |_| ControlFlow::Continue(()));
        let half = 0.5 * PIXELS as f64;
        for pixel in 0..PIXELS * PIXELS {
            let x = SIDE_MM * ((pixel % PIXELS) as f64 - half);
            let y = SIDE_MM * (half - 1.0 - (pixel / PIXELS) as f64);
            let [part_x, part_y] = [covered(x, 0), covered(y, 1)];
            // At normal incidence a twenty-fifth is mirrored.
            let expected = [x + 0.5 * SIDE_MM, y + 0.5 * SIDE_MM, part_x * part_y];
            for (plane, expected) in expected.into_iter().enumerate() {
                let got = picture.radiance.estimate(plane * PIXELS * PIXELS + pixel);
                let error = (got.value - expected).abs();
                assert!(
                    error < 4.5 * got.u + 1e-9,
                    "{shaded} {pixel} {plane}: {got:?} {expected}"
                );
            }
            // Of four rays, two would find an edge that is in their column or row, or not.
            let found = picture.radiance.estimate(2 * PIXELS * PIXELS + pixel);
            let variance = 1000.0 * found.u * found.u;
            let in_half = |part: f64| {
                let part = (2.0 * part).fract();
                part * (1.0 - part)
            };
            let of_four = (in_half(part_x) * part_y + in_half(part_y) * part_x) / 8.0;
            assert!(variance <= of_four / 10.0 + 1e-12, "{pixel}: {variance}");
        }
    }
}

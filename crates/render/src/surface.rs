//! Pictures from models of the surface: what is common to `brdf`, `bssrdf` and `point-cloud`.
//!
//! A ray of the camera meets the first solid. What the smooth surface mirrors is followed on;
//! what comes out of the solid is for the model to say. Light goes from the lamp to the solid
//! without detours: what one solid throws on another is left out.

use crate::Vec3;
use crate::boundary::part;
use crate::light::Incident;
use crate::method::{Method, Picture, Planes};
use crate::scene::{Object, Scene};
use crate::shape::Hit;
use physics::random::{Stream, stream, uniform};
use rayon::prelude::*;
use std::sync::OnceLock;

/// A point of a surface as a model sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Index of the solid.
    pub object: usize,
    /// Where it is.
    pub at: Vec3,
    /// Normal of the true surface.
    pub true_normal: Vec3,
    /// Normal for shading.
    pub normal: Vec3,
    /// Texture coordinates, on a solid with a texture.
    pub coordinates: Option<[f64; 2]>,
}

impl Point {
    /// A place on a flat piece of the surface with these corners.
    pub(crate) fn on_triangle(
        scene: &Scene,
        object: usize,
        face: usize,
        [a, b, c]: [Vec3; 3],
        at: Vec3,
    ) -> Self {
        let hit = Hit {
            distance: 0.0,
            normal: (b - a).cross(c - a).normalize(),
            face,
        };
        Self::new(scene, object, at, &hit)
    }

    /// The place `at` which a ray met `hit`.
    pub fn new(scene: &Scene, object: usize, at: Vec3, hit: &Hit) -> Self {
        let Object {
            shape, material, ..
        } = &scene.objects[object];
        let textured = material.texture.is_some();
        Self {
            object,
            at,
            true_normal: hit.normal,
            normal: shape.shading_normal(at, hit),
            coordinates: textured
                .then(|| shape.texture_coordinates(at, hit))
                .flatten(),
        }
    }
}

/// What comes out of a solid at a point toward a camera.
pub trait Shader: Sync {
    /// How many of the rays of a pixel in a round are shaded where it is the same all over, at least 1:
    /// all of them if that does not cost much more than to find what they meet.
    fn shaded(&self) -> u32 {
        RAYS
    }

    /// Adds the radiance toward `view`, a unit vector away from the surface, to `single` and
    /// `diffuse`, which have one number a channel: an estimate without bias of what the model
    /// says.
    fn shade(
        &self,
        scene: &Scene,
        point: &Point,
        view: Vec3,
        rng: &mut Stream,
        single: &mut [f64],
        diffuse: &mut [f64],
    );
}

/// The method that a shader makes.
pub struct Shaded<'a, S> {
    shader: S,
    canvas: Canvas<'a>,
}

/// What all methods that shade a surface make their pictures of.
pub(crate) struct Canvas<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) seed: u64,
    planes: Planes,
    grain: Grain,
}

impl<'a> Canvas<'a> {
    pub(crate) fn new(scene: &'a Scene, seed: u64, components: bool) -> Self {
        Self {
            scene,
            seed,
            planes: Planes {
                channels: scene.channels.len(),
                components,
            },
            grain: Grain::default(),
        }
    }

    /// A picture without any light yet.
    pub(crate) fn empty(&self) -> Picture {
        Picture::empty(self.planes, self.scene, 0)
    }

    /// The round `index` by `shader`, as a [`Method`] makes it.
    pub(crate) fn round(&self, shader: &impl Shader, index: u64) -> (Vec<f64>, Vec<f64>) {
        let Self {
            scene,
            seed,
            planes,
            ref grain,
        } = *self;
        let pixels = scene.pixels();
        let [width, _] = scene.camera.size();
        let channels = scene.channels.len();
        let mut picture = vec![0.0; planes.len() * pixels];
        let all = vec![true; scene.lamps.len()];
        let (mut single, mut diffuse) = (vec![0.0; channels], vec![0.0; channels]);
        let mut weight = vec![1.0; channels];
        for pixel in 0..pixels {
            let mut rng = stream(seed, &[4, index, pixel as u64]);
            let mut add = |channel: usize, order: u32, value: f64| {
                picture[planes.of(channel, order) * pixels + pixel] += value;
            };
            let parts = grain.of(scene, pixel);
            let pick = |of: u32, rng: &mut Stream| (uniform(rng) * f64::from(of)) as u32;
            let turn = pick(RAYS, &mut rng);
            for quarter in 0..RAYS {
                // All places of a quarter are shaded alike often, and all quarters.
                let chosen = pick(parts * parts, &mut rng);
                let rank = (quarter + turn) % RAYS;
                for ray in 0..parts * parts {
                    let within = [ray % parts, ray / parts]
                        .map(|part| (f64::from(part) + uniform(&mut rng)) / f64::from(parts));
                    let x = (f64::from(quarter % SIDE) + within[0]) / f64::from(SIDE);
                    let y = (f64::from(quarter / SIDE) + within[1]) / f64::from(SIDE);
                    let (column, row) = ((pixel % width) as f64, (pixel / width) as f64);
                    let shade = |mirrors: usize, point: &Point, direction: Vec3, weight: &[f64]| {
                        // What little a mirror adds is worth no more than one.
                        let shaded = match (mirrors, parts) {
                            (0, 1) => shader.shaded(),
                            (0, _) => RAYS,
                            _ => 1,
                        };
                        if ray != chosen || rank >= shaded {
                            return;
                        }
                        single.fill(0.0);
                        diffuse.fill(0.0);
                        shader.shade(
                            scene,
                            point,
                            -direction,
                            &mut rng,
                            &mut single,
                            &mut diffuse,
                        );
                        for (channel, weight) in weight.iter().enumerate() {
                            let weight = weight / f64::from(shaded);
                            add(channel, 1, weight * single[channel]);
                            add(channel, 2, weight * diffuse[channel]);
                        }
                    };
                    let of_camera = scene.camera.ray(column + x, row + y);
                    if follow(scene, of_camera, &all, &mut weight, shade) {
                        for (channel, radiance) in weight.iter().enumerate() {
                            add(channel, 0, radiance / f64::from(RAYS * parts * parts));
                        }
                    }
                }
            }
        }
        (picture, vec![])
    }
}

/// Mirrors that a ray of the camera may meet before it is given up.
const MIRRORS: usize = 8;

/// Rays of a pixel in a round that may be shaded, one in each quarter of its square.
const SIDE: u32 = 2;
const RAYS: u32 = SIDE * SIDE;

/// Along a side, rays of a quarter that look for lamps and their mirror images where these, whose
/// edges are sharp and bright, or edges of solids are in the pixel or beside it.
const FINE: u32 = 4;
/// Light of a lamp is alike in the corners of a pixel if it differs by no more than this share.
const ALIKE: f64 = 0.1;

impl<'a, S: Shader> Shaded<'a, S> {
    /// Pictures of `scene` by `shader`.
    pub fn new(scene: &'a Scene, shader: S, seed: u64, components: bool) -> Self {
        Self {
            shader,
            canvas: Canvas::new(scene, seed, components),
        }
    }

    /// The shader.
    pub fn shader(&self) -> &S {
        &self.shader
    }
}

impl<S: Shader> Method for Shaded<'_, S> {
    fn scene(&self) -> &Scene {
        self.canvas.scene
    }

    fn empty(&self) -> Picture {
        self.canvas.empty()
    }

    fn round(&self, index: u64) -> (Vec<f64>, Vec<f64>) {
        self.canvas.round(&self.shader, index)
    }
}

/// How finely the pixels of a scene are looked at, once it is known.
///
/// It depends on the scene alone, and on no ray that a picture is made of: a picture that sent more
/// rays where the first of them differed would be biased.
#[derive(Debug, Default)]
pub(crate) struct Grain(OnceLock<Vec<bool>>);

impl Grain {
    /// Rays along the side of a quarter of a pixel.
    fn of(&self, scene: &Scene, pixel: usize) -> u32 {
        let fine = self.0.get_or_init(|| fine(scene));
        if fine[pixel] { FINE } else { 1 }
    }
}

/// Whether the corners of each pixel, or of one beside it, show different things.
fn fine(scene: &Scene) -> Vec<bool> {
    let [width, height] = scene.camera.size();
    let all = vec![true; scene.lamps.len()];
    // Which solids a ray meets one after the other and whether it ends at a lamp, and the light there.
    let seen = |x: usize, y: usize| {
        let mut weight = vec![1.0; scene.channels.len()];
        let mut met = vec![];
        let ray = scene.camera.ray(x as f64, y as f64);
        let lit = follow(scene, ray, &all, &mut weight, |_, point, _, _| {
            met.push(point.object);
        });
        (met, lit.then(|| weight.iter().sum::<f64>()))
    };
    let corners: Vec<_> = (0..(width + 1) * (height + 1))
        .into_par_iter()
        .map(|k| seen(k % (width + 1), k / (width + 1)))
        .collect();
    let differ = |x: usize, y: usize| {
        let at = |dx, dy| &corners[(y + dy) * (width + 1) + x + dx];
        let (met, light) = at(0, 0);
        [at(0, 1), at(1, 0), at(1, 1)].iter().any(|(m, l)| {
            let alike = match (light, l) {
                (Some(a), Some(b)) => (a - b).abs() <= ALIKE * a.max(*b),
                (None, None) => true,
                _ => false,
            };
            m != met || !alike
        })
    };
    let differ: Vec<bool> = (0..width * height)
        .map(|pixel| differ(pixel % width, pixel / width))
        .collect();
    // What is thinner than a pixel may lie between the corners of the one beside.
    let around = |k: usize, most: usize| k.saturating_sub(1)..(k + 2).min(most);
    (0..width * height)
        .map(|pixel| {
            let mut rows = around(pixel / width, height);
            rows.any(|y| around(pixel % width, width).any(|x| differ[y * width + x]))
        })
        .collect()
}

/// Follows a ray of the camera from mirror to mirror and shows `meet` each point of a solid: how many
/// mirrors were before it, the point, the direction of the ray and `weight`, what those mirrors have
/// left of the light of each channel. Returns whether there is a lamp at the end; then `weight` is the
/// radiance that comes from there.
fn follow(
    scene: &Scene,
    (mut origin, mut direction): (Vec3, Vec3),
    all: &[bool],
    weight: &mut [f64],
    mut meet: impl FnMut(usize, &Point, Vec3, &[f64]),
) -> bool {
    weight.fill(1.0);
    for mirrors in 0..MIRRORS {
        let entered = scene.enter(origin, direction);
        let within = entered.map_or(f64::INFINITY, |(_, hit)| hit.distance);
        let lit = |channel| scene.lit(channel, origin, direction, within, all);
        if lit(0).is_some() {
            for (channel, weight) in weight.iter_mut().enumerate() {
                *weight *= lit(channel).unwrap_or(0.0);
            }
            return true;
        }
        let Some((object, hit)) = entered else {
            return false;
        };
        let at = origin + hit.distance * direction;
        let mut point = Point::new(scene, object, at, &hit);
        if point.normal.dot(direction) >= -1e-3 {
            // Shading may not show a point from behind.
            point.normal = point.true_normal;
        }
        meet(mirrors, &point, direction, weight);
        let first = scene.eta(object, 0);
        let mirrored = part(direction, point.normal, first).reflected;
        for (channel, weight) in weight.iter_mut().enumerate() {
            let eta = scene.eta(object, channel);
            *weight *= part(direction, point.normal, eta).reflectance;
        }
        if mirrored.dot(point.true_normal) <= 0.0 {
            return false;
        }
        origin = at;
        direction = mirrored;
    }
    false
}

/// Light of a lamp at a point of a surface, if nothing is in the way and it comes from outside.
pub(crate) fn arrives(
    scene: &Scene,
    lamp: usize,
    point: &Point,
    rng: &mut Stream,
) -> Option<Incident> {
    let light = &scene.lamps[lamp].light;
    let incident = light.shine(point.at, Some(point.normal), rng)?;
    let open = point.normal.dot(incident.toward) > 0.0
        && point.true_normal.dot(incident.toward) > 0.0
        && unhidden(scene, point.at, &incident);
    open.then_some(incident)
}

/// mm².
pub(crate) fn area([a, b, c]: [Vec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

/// Triangles to be drawn by a weight that is even over each of them.
#[derive(Clone, Debug)]
pub(crate) struct Weighted {
    /// Weights of a triangle and all before it.
    below: Vec<f64>,
    /// Density of a draw at a point of each, mm⁻².
    density: Vec<f64>,
}

/// Draws of the light on all triangles together, and at least on each: enough to tell lit ones from
/// dark ones.
const ALL_LIGHT_DRAWS: usize = 4096;
const LIGHT_DRAWS: usize = 4;
/// Share of the draws by light that is even over the surface, for what those missed.
const EVEN: f64 = 0.2;

impl Weighted {
    /// By a weight for each mm² of each of `count` triangles.
    pub(crate) fn new(
        count: usize,
        corners: impl Fn(usize) -> [Vec3; 3],
        mut weight: impl FnMut(usize) -> f64,
    ) -> Self {
        let areas: Vec<f64> = (0..count).map(|k| area(corners(k))).collect();
        let weights = areas.iter().enumerate().map(|(k, area)| area * weight(k));
        let weights: Vec<f64> = weights.collect();
        let (all, surface) = (weights.iter().sum::<f64>(), areas.iter().sum::<f64>());
        let mut below = vec![];
        let mut density = vec![];
        let mut sum = 0.0;
        for (weight, area) in weights.iter().zip(&areas) {
            let even = area / surface;
            let share = if all > 0.0 {
                (1.0 - EVEN) * weight / all + EVEN * even
            } else {
                even
            };
            sum += share;
            below.push(sum);
            density.push(share / area);
        }
        Self { below, density }
    }

    /// By the light that falls on them from the lamps, but for beams, all channels together;
    /// `triangle` gives the corners of each, and its face.
    pub(crate) fn by_light(
        scene: &Scene,
        object: usize,
        count: usize,
        triangle: impl Fn(usize) -> ([Vec3; 3], usize),
    ) -> Self {
        let mut rng = stream(0, &[5, object as u64]);
        let draws = LIGHT_DRAWS.max(ALL_LIGHT_DRAWS / count.max(1));
        let light = |k: usize| {
            let (corners, face) = triangle(k);
            let mut sum = 0.0;
            for _ in 0..draws {
                let at = in_triangle(corners, &mut rng);
                let point = Point::on_triangle(scene, object, face, corners, at);
                for (index, lamp) in scene.lamps.iter().enumerate() {
                    if lamp.light.is_beam() {
                        continue;
                    }
                    if let Some(incident) = arrives(scene, index, &point, &mut rng) {
                        let strength: f64 = lamp.strength.iter().sum();
                        let cos_in = incident.toward.dot(point.normal);
                        sum += strength * incident.irradiance * cos_in;
                    }
                }
            }
            sum
        };
        Self::new(count, |k| triangle(k).0, light)
    }

    /// One of them.
    pub(crate) fn draw(&self, rng: &mut Stream) -> usize {
        let at = uniform(rng) * self.below.last().copied().unwrap_or(0.0);
        let drawn = self.below.partition_point(|sum| *sum <= at);
        drawn.min(self.below.len() - 1)
    }

    /// Density of a draw at a point of one, mm⁻².
    pub(crate) fn density(&self, triangle: usize) -> f64 {
        self.density[triangle]
    }
}

/// A draw from the even distribution over a triangle.
pub(crate) fn in_triangle([a, b, c]: [Vec3; 3], rng: &mut Stream) -> Vec3 {
    let root = uniform(rng).sqrt();
    let along = uniform(rng);
    a + root * ((1.0 - along) * (b - a) + along * (c - a))
}

/// Where light that arrives on a straight line at a point inside a solid comes through its surface,
/// if nothing is in the way outside.
pub(crate) fn through_surface(
    scene: &Scene,
    object: usize,
    inside: Vec3,
    incident: &Incident,
) -> Option<(Vec3, Hit)> {
    let hit = scene.objects[object].shape.leave(inside, incident.toward)?;
    let at = inside + hit.distance * incident.toward;
    let beyond = Incident {
        distance: incident.distance - hit.distance,
        ..*incident
    };
    (beyond.distance > 0.0 && unhidden(scene, at, &beyond)).then_some((at, hit))
}

/// Whether no solid is between a point of a surface and a lamp.
pub(crate) fn unhidden(scene: &Scene, at: Vec3, incident: &Incident) -> bool {
    scene
        .enter(at, incident.toward)
        .is_none_or(|(_, hit)| hit.distance >= incident.distance)
}

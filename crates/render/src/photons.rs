//! `monte-carlo` from the lights: each scattering is connected to the camera through the flat
//! faces of its solid.
//!
//! Light that a wall of a block reflects on its way to the face is followed in mirror images of
//! the scattering, of which a block has a lattice; so nothing is left out.

use crate::boundary::part;
use crate::camera::{Camera, Window};
use crate::light::Reach;
use crate::scene::Scene;
use crate::shape::{Block, Shape};
use crate::walk::{End, Photon, wander};
use crate::{Vec3, shape};
use physics::random::{Stream, stream, uniform};
use physics::{HenyeyGreenstein, Medium, PhaseFunction, fresnel};
use std::ops::ControlFlow;

/// Rings on a surface in which leaving light is counted.
#[derive(Clone, Debug, PartialEq)]
pub struct Rings {
    /// Index of the solid.
    pub object: usize,
    /// Face of it, of [`Shape::face_names`].
    pub face: usize,
    /// Middle.
    pub center: Vec3,
    /// Edges, mm, from the inside out.
    pub edges_mm: Vec<f64>,
}

/// Where the numbers of a round of powers stand: for each channel the faces of all solids one
/// after the other, then what a surface reflected before it entered, what had entered, what fell
/// through holes, what left into the open, and the rings.
#[derive(Clone, Debug, PartialEq)]
pub struct Ledger {
    faces: Vec<usize>,
    rings: usize,
    channels: usize,
}

/// One line of a [`Ledger`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// Power that left a solid through a face, W.
    Face {
        /// Index of the solid.
        object: usize,
        /// Face of it.
        face: usize,
    },
    /// Power that surfaces reflected from outside, W.
    Specular,
    /// Power that entered a solid, W.
    Entered,
    /// Power that fell through holes of meshes, W.
    Lost,
    /// Power that left a solid in this ring, W.
    Ring(usize),
}

impl Ledger {
    /// For a scene and perhaps rings.
    pub fn new(scene: &Scene, rings: Option<&Rings>) -> Self {
        let mut faces = vec![0];
        for object in &scene.objects {
            faces.push(faces.last().unwrap_or(&0) + object.shape.face_names().len());
        }
        Self {
            faces,
            rings: rings.map_or(0, |r| r.edges_mm.len().saturating_sub(1)),
            channels: scene.channels.len(),
        }
    }

    fn of_channel(&self) -> usize {
        self.faces.last().unwrap_or(&0) + 3 + self.rings
    }

    /// How many numbers there are.
    pub fn len(&self) -> usize {
        self.channels * self.of_channel()
    }

    /// Never.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where a number stands.
    pub fn index(&self, channel: usize, entry: Entry) -> usize {
        let after = self.faces.last().unwrap_or(&0);
        channel * self.of_channel()
            + match entry {
                Entry::Face { object, face } => self.faces[object] + face,
                Entry::Specular => *after,
                Entry::Entered => after + 1,
                Entry::Lost => after + 2,
                Entry::Ring(k) => after + 3 + k,
            }
    }
}

/// Photons of the lights of a scene.
pub(crate) struct Photons<'a> {
    pub(crate) scene: &'a Scene,
    /// One entry a light: whether its photons are followed.
    pub(crate) lamps: Vec<bool>,
    pub(crate) photons: u64,
    pub(crate) seed: u64,
    pub(crate) rings: Option<&'a Rings>,
    pub(crate) ledger: Ledger,
}

/// How much optical depth a connection may have before roulette begins.
const SURE_DEPTH: f64 = 3.0;

struct Splat<'a, F> {
    picture: &'a mut [f64],
    plane: F,
    pixels: usize,
}

impl Photons<'_> {
    /// Follows the photons of a round; adds radiances to `picture` and powers to `powers`.
    pub(crate) fn round(
        &self,
        index: u64,
        plane: impl Fn(usize, u32) -> usize,
        picture: &mut [f64],
        powers: &mut [f64],
    ) {
        let reach = self.scene.reach();
        let mut splat = Splat {
            picture,
            plane,
            pixels: self.scene.pixels(),
        };
        for channel in 0..self.scene.channels.len() {
            let windows = windows(self.scene, channel);
            for (lamp, followed) in self.lamps.iter().enumerate() {
                let strength = self.scene.lamps[lamp].strength[channel];
                if !followed || strength == 0.0 {
                    continue;
                }
                let mut rng = stream(self.seed, &[2, index, channel as u64, lamp as u64]);
                for _ in 0..self.photons {
                    let power = strength / self.photons as f64;
                    self.follow(
                        channel, lamp, power, reach, &windows, &mut rng, &mut splat, powers,
                    );
                }
            }
        }
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "all of it changes from photon to photon"
    )]
    fn follow(
        &self,
        channel: usize,
        lamp: usize,
        power: f64,
        reach: Reach,
        windows: &[Vec<Window<'_>>],
        rng: &mut Stream,
        splat: &mut Splat<'_, impl Fn(usize, u32) -> usize>,
        powers: &mut [f64],
    ) {
        let ray = self.scene.lamps[lamp].light.emit(reach, rng);
        let power = power * ray.power;
        if power == 0.0 {
            return;
        }
        let mut photon = Photon {
            at: ray.origin,
            direction: ray.direction,
            depth: 0.0,
        };
        let mut count = |entry, power: f64| powers[self.ledger.index(channel, entry)] += power;
        while let Some((index, hit)) = self.scene.enter(photon.at, photon.direction) {
            let object = &self.scene.objects[index];
            let medium = &object.material.media[channel];
            photon.at += hit.distance * photon.direction;
            let parting = part(photon.direction, hit.normal, medium.eta);
            let weight = power * (-photon.depth).exp();
            if parting.reflectance >= 1.0 || uniform(rng) < parting.reflectance {
                count(Entry::Specular, weight);
                photon.direction = parting.reflected;
                continue;
            }
            count(Entry::Entered, weight);
            photon.direction = parting.refracted;
            let mut order = 0;
            let mut own = stream_of(rng);
            let end = wander(&object.shape, medium, &mut photon, rng, &mut |photon| {
                order += 1;
                for window in &windows[index] {
                    let depth = window.depth(photon.at);
                    let limit = SURE_DEPTH / medium.sigma_t();
                    // The roulette of connections: none is tried beyond a random optical depth.
                    let least = window.least_length(depth);
                    // exp(-33) is never drawn.
                    if least > 12.0 * limit {
                        continue;
                    }
                    let most = limit - (1.0 - uniform(&mut own)).ln() / medium.sigma_t();
                    if least > most {
                        continue;
                    }
                    self.connect(index, medium, window, photon, most, |pixel, value| {
                        let plane = (splat.plane)(channel, order);
                        splat.picture[plane * splat.pixels + pixel] += power * value;
                    });
                }
                ControlFlow::Continue(())
            });
            match end {
                End::Left(hit) => {
                    let weight = power * (-photon.depth).exp();
                    let face = object.shape.counted_face(&hit);
                    count(
                        Entry::Face {
                            object: index,
                            face,
                        },
                        weight,
                    );
                    if let Some(rings) = self.rings
                        && rings.object == index
                        && rings.face == face
                    {
                        let radius = (photon.at - rings.center).length();
                        let above = rings.edges_mm.partition_point(|edge| *edge <= radius);
                        if above > 0 && above < rings.edges_mm.len() {
                            count(Entry::Ring(above - 1), weight);
                        }
                    }
                }
                End::Stopped => return,
                End::Lost => {
                    count(Entry::Lost, power * (-photon.depth).exp());
                    return;
                }
            }
        }
    }

    /// All ways from a scattering through one face to the camera, of at most `most` mm inside.
    #[inline]
    fn connect(
        &self,
        object: usize,
        medium: &Medium,
        window: &Window<'_>,
        photon: &Photon,
        most: f64,
        mut add: impl FnMut(usize, f64),
    ) {
        let shape = &self.scene.objects[object].shape;
        let mut one = |image: Image| {
            let depth = window.depth(image.at);
            if window.least_length(depth) > most {
                return false;
            }
            let Some(way) = window.connect(image.at, depth) else {
                return true;
            };
            if way.length > most || !on_face(shape, window, way.exit) {
                return true;
            }
            // The direction at the scattering itself, before the mirrors.
            let start = way.inner * image.signs;
            let cos_theta = start.dot(photon.direction);
            let phase = HenyeyGreenstein { g: medium.g }.density(cos_theta);
            let mut mirrors = 1.0;
            for axis in 0..3 {
                if image.reflections[axis] > 0 {
                    let r = fresnel::reflectance(1.0 / medium.eta, way.inner[axis].abs());
                    mirrors *= r.powi(image.reflections[axis] as i32);
                }
            }
            if mirrors == 0.0 {
                return true;
            }
            if self.hidden(object, way.exit, way.outer, way.outer_length) {
                return true;
            }
            let depth = medium.sigma_t() * way.length;
            // What roulette let through stands for what it took.
            let kept = (depth - SURE_DEPTH).max(0.0);
            let value = phase
                * mirrors
                * (kept - depth - photon.depth).exp()
                * way.transmittance
                * way.radiance_per_intensity;
            add(way.pixel, value);
            true
        };
        match shape {
            Shape::Block(block) => images(block, window, photon.at, most, &mut one),
            _ => {
                one(Image {
                    at: photon.at,
                    signs: Vec3::ONE,
                    reflections: [0; 3],
                });
            }
        }
    }

    fn hidden(&self, object: usize, exit: Vec3, outer: Vec3, length: f64) -> bool {
        // A flat-faced solid is convex: it does not hide itself.
        self.scene.objects.iter().enumerate().any(|(other, o)| {
            other != object
                && o.shape
                    .enter(exit, outer)
                    .is_some_and(|hit| hit.distance < length)
        })
    }
}

/// A second stream beside that of a walk, so that connections do not change the walk.
fn stream_of(rng: &mut Stream) -> Stream {
    stream((uniform(rng) * (1_u64 << 53) as f64) as u64, &[3])
}

/// The windows of each solid toward the camera.
fn windows(scene: &Scene, channel: usize) -> Vec<Vec<Window<'_>>> {
    let camera: &Camera = &scene.camera;
    let of_object = |object: &crate::scene::Object| {
        let eta = object.material.media[channel].eta;
        let faces: Vec<shape::Face> = object.shape.flat_faces().unwrap_or_default();
        faces
            .into_iter()
            .filter_map(|face| camera.window(face, eta))
            .collect()
    };
    scene.objects.iter().map(of_object).collect()
}

fn on_face(shape: &Shape, window: &Window<'_>, exit: Vec3) -> bool {
    match shape {
        Shape::Block(block) => {
            let across = window.axis();
            (0..3).all(|axis| {
                axis == across || (exit[axis] >= block.min[axis] && exit[axis] <= block.max[axis])
            })
        }
        _ => true,
    }
}

/// A mirror image of a scattering.
#[derive(Clone, Copy)]
struct Image {
    at: Vec3,
    /// By which the direction of arrival has to be multiplied to get that of departure.
    signs: Vec3,
    reflections: [u32; 3],
}

/// The images of a point in the walls of a block that may be seen through a window, nearest
/// first along each axis. `visit` says whether farther images along the window's own axis are
/// worth a look.
fn images(
    block: &Block,
    window: &Window<'_>,
    at: Vec3,
    most: f64,
    visit: &mut impl FnMut(Image) -> bool,
) {
    let across = window.axis();
    let sizes = block.max - block.min;
    // Coordinate of image `n` along an axis: even ones are shifted, odd ones mirrored.
    let image = |axis: usize, n: i64| {
        let local = at[axis] - block.min[axis];
        let within = if n % 2 == 0 {
            local
        } else {
            sizes[axis] - local
        };
        block.min[axis] + n as f64 * sizes[axis] + within
    };
    // Walls to the side: images from which a way of `most` can still reach the face.
    let sides: [std::ops::RangeInclusive<i64>; 3] = std::array::from_fn(|axis| {
        if axis == across {
            return 0..=0;
        }
        let (below, above) = (at[axis] - block.min[axis], block.max[axis] - at[axis]);
        let reach = match window.inner() {
            // Light goes one way along the axis: only images behind it.
            Some(inner) => {
                [(inner[axis] > 0.0, below), (inner[axis] < 0.0, above)].map(|(possible, wall)| {
                    if possible {
                        most * inner[axis].abs() - wall
                    } else {
                        -1.0
                    }
                })
            }
            None => [most - below, most - above],
        };
        let count = |reach: f64| {
            if reach < 0.0 {
                0
            } else {
                1 + (reach / sizes[axis]) as i64
            }
        };
        -count(reach[0])..=count(reach[1])
    });
    // Behind: from the face to the opposite one and back.
    let upper = window.faces_up();
    for n in 0_i64.. {
        let behind = if upper { -n } else { n };
        let mut worth = true;
        for i in sides[(across + 1) % 3].clone() {
            for j in sides[(across + 2) % 3].clone() {
                let mut numbers = [0; 3];
                numbers[across] = behind;
                numbers[(across + 1) % 3] = i;
                numbers[(across + 2) % 3] = j;
                let sign = |axis: usize| if numbers[axis] % 2 == 0 { 1.0 } else { -1.0 };
                worth = visit(Image {
                    at: Vec3::new(
                        image(0, numbers[0]),
                        image(1, numbers[1]),
                        image(2, numbers[2]),
                    ),
                    signs: Vec3::new(sign(0), sign(1), sign(2)),
                    reflections: numbers.map(|n| n.unsigned_abs() as u32),
                });
            }
        }
        // In a clear solid no distance is too long, but no face reflects for ever.
        if !worth || n > 60 {
            break;
        }
    }
}

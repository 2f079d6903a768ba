//! `monte-carlo` from the lights: each scattering is connected to the camera through the flat
//! faces of its solid.
//!
//! Light that a wall of a block reflects on its way to the face is followed in mirror images of
//! the scattering, of which a block has a lattice; so nothing is left out.

use crate::boundary::part;
use crate::camera::{Camera, Window};
use crate::guide::Guide;
use crate::lanes;
use crate::leap::{self, Leaps};
use crate::light::Reach;
use crate::scene::Scene;
use crate::shape::{Block, Hit, Shape};
use crate::walk::{End, Ground, Photon, ROULETTE_DEPTH, Visitor, scatter, wander};
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
    /// For each channel and, within it, light: how light its photons should be, if anything.
    pub(crate) guides: &'a [Option<Guide>],
    /// Optical depth within which no scattering is leapt over.
    pub(crate) seen_depth: f64,
}

/// How much optical depth a connection may have before roulette begins.
pub(crate) const SURE_DEPTH: f64 = 1.0;
/// Optical depth within which a scattering is best not leapt over.
pub(crate) const SEEN_DEPTH: f64 = 4.0;
/// Optical depth beyond the sure one that roulette never lets through: a share of 1e-14.
const NEVER: f64 = 33.0;

/// Photons that are sent together, at most.
const TOGETHER: u64 = 4096;

/// What the photons of a lamp in a channel have in common.
pub(crate) struct Source<'a> {
    channel: usize,
    lamp: usize,
    /// Of one photon, W.
    power: f64,
    reach: Reach,
    pub(crate) windows: &'a [Vec<Window>],
    guide: Option<&'a Guide>,
}

/// A photon in a solid, in which it has scattered so often.
pub(crate) struct Inside {
    pub(crate) photon: Photon,
    pub(crate) object: usize,
    pub(crate) order: u32,
}

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
        let mut leaps = leap::of_scene(self.scene, self.seed, index);
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
                let guide = self.guides[channel * self.lamps.len() + lamp].as_ref();
                let photons = guide.map_or(self.photons, |guide| guide.fewer(self.photons));
                let source = Source {
                    channel,
                    lamp,
                    power: strength / photons as f64,
                    reach,
                    windows: &windows,
                    guide,
                };
                self.follow(&source, photons, &mut leaps, &mut rng, &mut splat, powers);
            }
        }
    }

    fn follow(
        &self,
        source: &Source<'_>,
        photons: u64,
        leaps: &mut [Leaps],
        rng: &mut Stream,
        splat: &mut Splat<'_, impl Fn(usize, u32) -> usize>,
        powers: &mut [f64],
    ) {
        let mut crowds: Vec<Vec<Inside>> = self.scene.objects.iter().map(|_| vec![]).collect();
        let mut sent = 0;
        while sent < photons {
            let last = photons.min(sent + TOGETHER);
            for _ in sent..last {
                let ray = self.scene.lamps[source.lamp].light.emit(source.reach, rng);
                let photon = Photon {
                    at: ray.origin,
                    direction: ray.direction,
                    depth: -ray.power.ln(),
                };
                if ray.power > 0.0
                    && let Some(inside) = self.arrive(source, photon, rng, powers)
                {
                    crowds[inside.object].push(inside);
                }
            }
            sent = last;
            while let Some(index) = crowds.iter().position(|crowd| !crowd.is_empty()) {
                let object = &self.scene.objects[index];
                let watch = Watch {
                    photons: self,
                    source,
                    splat,
                    waiting: std::mem::take(&mut crowds[index]),
                    guide: source.guide.filter(|guide| guide.holds(index)),
                    index,
                    medium: &object.material.media[source.channel],
                    order: 0,
                    own: stream_of(rng),
                    ball: Ball::default(),
                };
                let leaps = &mut leaps[index * self.scene.channels.len() + source.channel];
                for out in watch.walk(leaps, rng, powers) {
                    crowds[out.object].push(out);
                }
            }
        }
    }

    /// Follows a photon outside of all solids to where it is just inside of one, if it gets there.
    fn arrive(
        &self,
        source: &Source<'_>,
        mut photon: Photon,
        rng: &mut Stream,
        powers: &mut [f64],
    ) -> Option<Inside> {
        let channel = source.channel;
        let weight = source.power * (-photon.depth).exp();
        let mut count = |entry| powers[self.ledger.index(channel, entry)] += weight;
        while let Some((object, hit)) = self.scene.enter(photon.at, photon.direction) {
            photon.at += hit.distance * photon.direction;
            let eta = self.scene.eta(object, channel);
            let parting = part(photon.direction, hit.normal, eta);
            if parting.reflectance >= 1.0 || uniform(rng) < parting.reflectance {
                count(Entry::Specular);
                photon.direction = parting.reflected;
                continue;
            }
            count(Entry::Entered);
            photon.direction = parting.refracted;
            return Some(Inside {
                photon,
                object,
                order: 0,
            });
        }
        None
    }

    /// Counts what left a solid, and follows it to where it is inside of one again.
    pub(crate) fn left(
        &self,
        source: &Source<'_>,
        object: usize,
        hit: &Hit,
        photon: Photon,
        rng: &mut Stream,
        powers: &mut [f64],
    ) -> Option<Inside> {
        let face = self.scene.objects[object].shape.counted_face(hit);
        let weight = source.power * (-photon.depth).exp();
        let mut count = |entry| powers[self.ledger.index(source.channel, entry)] += weight;
        count(Entry::Face { object, face });
        if let Some(rings) = self.rings
            && rings.object == object
            && rings.face == face
        {
            let radius = (photon.at - rings.center).length();
            let above = rings.edges_mm.partition_point(|edge| *edge <= radius);
            if above > 0 && above < rings.edges_mm.len() {
                count(Entry::Ring(above - 1));
            }
        }
        self.arrive(source, photon, rng, powers)
    }

    /// Counts what fell through a hole.
    pub(crate) fn lost(&self, source: &Source<'_>, photon: &Photon, powers: &mut [f64]) {
        let weight = source.power * (-photon.depth).exp();
        powers[self.ledger.index(source.channel, Entry::Lost)] += weight;
    }

    /// All ways from a scattering through one face to the camera, as far as roulette has it.
    #[inline]
    fn connect(
        &self,
        object: usize,
        medium: &Medium,
        window: &Window,
        photon: &Photon,
        reached: Reached,
        mut add: impl FnMut(usize, f64),
    ) {
        let Reached { most, sure } = reached;
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
            let kept = (depth - sure).max(0.0);
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

    pub(crate) fn hidden(&self, object: usize, exit: Vec3, outer: Vec3, length: f64) -> bool {
        // A flat-faced solid is convex: it does not hide itself.
        self.scene.objects.iter().enumerate().any(|(other, o)| {
            other != object
                && o.shape
                    .enter(exit, outer)
                    .is_some_and(|hit| hit.distance < length)
        })
    }
}

/// How far a connection may go.
#[derive(Clone, Copy)]
pub(crate) struct Reached {
    /// Length inside, mm.
    pub(crate) most: f64,
    /// Optical depth to which any would have been tried.
    pub(crate) sure: f64,
}

/// A way through a ball that was not leapt over, because its scatterings are to be seen.
#[derive(Clone, Copy)]
struct Ball {
    /// Optical depth up to which connections are sure.
    sure: f64,
    /// One over the probability of not leaping.
    factor: f64,
}

impl Default for Ball {
    fn default() -> Self {
        Self {
            sure: SURE_DEPTH,
            factor: 1.0,
        }
    }
}

/// Connects the scatterings of the photons in a solid to the camera, and splits them.
pub(crate) struct Watch<'a, 'b, F> {
    pub(crate) photons: &'a Photons<'a>,
    pub(crate) source: &'a Source<'a>,
    splat: &'a mut Splat<'b, F>,
    /// Those that have not started.
    pub(crate) waiting: Vec<Inside>,
    pub(crate) guide: Option<&'a Guide>,
    pub(crate) index: usize,
    pub(crate) medium: &'a Medium,
    /// How often the photon has scattered.
    pub(crate) order: u32,
    own: Stream,
    ball: Ball,
}

impl<F: Fn(usize, u32) -> usize> Watch<'_, '_, F> {
    pub(crate) fn windows(&self) -> &[Window] {
        &self.source.windows[self.index]
    }

    /// Follows those that wait, and all that they split into; returns those that left the solid
    /// and are in one again.
    fn walk(mut self, leaps: &mut Leaps, rng: &mut Stream, powers: &mut [f64]) -> Vec<Inside> {
        let shape = &self.photons.scene.objects[self.index].shape;
        if let Shape::Block(block) = shape
            && let Some(pool) = lanes::Pool::new(&self, block, leaps, rng)
        {
            return pool.walk(self, leaps, rng, powers);
        }
        let mut out = vec![];
        while let Some(Inside {
            mut photon, order, ..
        }) = self.waiting.pop()
        {
            self.order = order;
            self.ball = Ball::default();
            let ground = Ground {
                shape,
                medium: self.medium,
                leaps,
                roulette: self.roulette(&photon),
            };
            match wander(ground, &mut photon, rng, &mut self) {
                End::Left(hit) => {
                    let (photons, source) = (self.photons, self.source);
                    out.extend(photons.left(source, self.index, &hit, photon, rng, powers));
                }
                End::Stopped => {}
                End::Lost => self.photons.lost(self.source, &photon, powers),
            }
        }
        out
    }

    /// Depth from which a photon that has just entered plays roulette.
    pub(crate) fn roulette(&self, photon: &Photon) -> f64 {
        if self.guide.is_some() {
            f64::INFINITY
        } else {
            photon.depth + ROULETTE_DEPTH
        }
    }

    /// A ball around a photon that is walked through.
    fn ball(&self, photon: &Photon, radius: f64) -> Ball {
        let windows = self.windows().iter();
        let lengths = windows.map(|w| w.least_length(w.depth(photon.at) - radius));
        let nearest = self.medium.sigma_t() * lengths.fold(f64::INFINITY, f64::min);
        let sure = nearest.max(SURE_DEPTH);
        Ball {
            sure,
            factor: (sure - SURE_DEPTH).exp(),
        }
    }

    /// The photon walks through a ball around it, as one of many that leap.
    pub(crate) fn strolls(&mut self, photon: &Photon, radius: f64) {
        self.ball = self.ball(photon, radius);
    }

    /// Adds to the radiance of a pixel.
    #[inline]
    pub(crate) fn add(&mut self, pixel: usize, order: u32, value: f64) {
        let plane = (self.splat.plane)(self.source.channel, order);
        self.splat.picture[plane * self.splat.pixels + pixel] += self.source.power * value;
    }

    /// Lets a photon that scatters go on, with others beside it, or not.
    pub(crate) fn split(&mut self, guide: &Guide, photon: &mut Photon, rng: &mut Stream) -> bool {
        let depths = self.windows().iter().map(|w| w.depth(photon.at));
        let below = depths.fold(f64::INFINITY, f64::min).max(0.0);
        let number = guide.split(photon, below, rng);
        self.waiting.extend((1..number).map(|_| Inside {
            photon: Photon {
                direction: scatter(photon.direction, self.medium.g, rng),
                ..*photon
            },
            object: self.index,
            order: self.order,
        }));
        number > 0
    }

    /// Connects a scattering to the camera through one face.
    pub(crate) fn connect(
        &mut self,
        window: &Window,
        photon: &Photon,
        reached: Reached,
        factor: f64,
    ) {
        let (photons, index, medium, order) = (self.photons, self.index, self.medium, self.order);
        photons.connect(index, medium, window, photon, reached, |pixel, value| {
            self.add(pixel, order, factor * value);
        });
    }
}

impl<F: Fn(usize, u32) -> usize> Visitor for Watch<'_, '_, F> {
    #[inline]
    fn scatters(
        &mut self,
        photon: &mut Photon,
        in_ball: bool,
        rng: &mut Stream,
    ) -> ControlFlow<()> {
        self.order += 1;
        let Ball { sure, factor } = if in_ball { self.ball } else { Ball::default() };
        let sigma_t = self.medium.sigma_t();
        let source = self.source;
        for window in &source.windows[self.index] {
            let depth = window.depth(photon.at);
            // The roulette of connections: none is tried beyond a random optical depth.
            let least = sigma_t * window.least_length(depth);
            if least > sure + NEVER {
                continue;
            }
            let most = sure - (1.0 - uniform(&mut self.own)).ln();
            if least > most {
                continue;
            }
            let reached = Reached {
                most: most / sigma_t,
                sure,
            };
            self.connect(window, photon, reached, factor);
        }
        // What waits would not know of the ball.
        if let Some(guide) = self.guide.filter(|_| !in_ball)
            && !self.split(guide, photon, rng)
        {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }

    fn leapt(&mut self, scatterings: u32) {
        self.order += scatterings;
    }

    fn unseen(&self, at: Vec3) -> f64 {
        let seen = self.photons.seen_depth / self.medium.sigma_t();
        let windows = self.windows().iter();
        let depths = windows.map(|w| w.depth(at) - seen / w.least_length(1.0));
        depths.fold(f64::INFINITY, f64::min)
    }

    fn leaps(&mut self, photon: &Photon, radius: f64) -> bool {
        // Connections from within the ball are as rare as roulette would have them from its
        // nearest point: all of them, or none.
        let ball = self.ball(photon, radius);
        if uniform(&mut self.own) * ball.factor >= 1.0 {
            return true;
        }
        self.ball = ball;
        false
    }
}

/// A second stream beside that of a walk, so that connections do not change the walk.
fn stream_of(rng: &mut Stream) -> Stream {
    stream((uniform(rng) * (1_u64 << 53) as f64) as u64, &[3])
}

/// The windows of each solid toward the camera.
fn windows(scene: &Scene, channel: usize) -> Vec<Vec<Window>> {
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

fn on_face(shape: &Shape, window: &Window, exit: Vec3) -> bool {
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
    window: &Window,
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
        // How far along the axis a way may go, downward and upward: images lie the other way.
        let [down, up] = match window.inner() {
            Some(inner) => {
                let along = most * inner[axis].abs();
                [inner[axis] < 0.0, inner[axis] > 0.0].map(|possible| f64::from(possible) * along)
            }
            None => [most; 2],
        };
        // The second image is a mirror image of the first, so as far behind it as the far wall.
        let count = |reach: f64, wall: f64| {
            if reach < wall {
                0
            } else {
                1 + ((reach - below.min(above)) / sizes[axis]) as i64
            }
        };
        -count(up, below)..=count(down, above)
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

//! Photons in a block, many at once: the fast form of [`crate::walk`] for [`crate::photons`].
//!
//! A pool of lanes in single precision steps all its photons at once, and marks what is rare: a
//! wall, a split, roulette, a leap. That is done here, one photon at a time, by the very functions of
//! the plain walk. Connections to the camera wait until they fill the lanes, too; what happens near
//! an edge, where mirror images may be seen, is connected by the plain walk's.

use crate::Vec3;
use crate::boundary::part;
use crate::camera::{Parallel, Window};
use crate::guide::STEPS;
use crate::leap::{Leaps, RADII};
use crate::photons::{Inside, Reached, SURE_DEPTH, Watch};
use crate::shape::{Block, Solid};
use crate::walk::{Photon, survives, through_ball};
use physics::lanes::{
    Floats, Stream32, WIDTH, Words, along_axis, choose, fma, henyey_greenstein, ln, mask, minus_ln,
    random_direction, turned, turned_anyhow, uniform, unit,
};
use physics::random::{Stream, lane, uniform as draw};
use physics::simd::{LaneLoop, SimdPath, exp};
use physics::{HenyeyGreenstein, Medium, PhaseFunction};
use std::f32::consts::LN_2;

/// Chunks of a pool: enough to keep the processor's pipelines full, few enough for its nearest
/// cache.
const CHUNKS: usize = 8;
/// Faces of a block that a camera outside can see at once.
const PANES: usize = 3;
/// Mean free paths that a block may span: single precision knows where a photon is to a 1e-7 of the
/// block.
const LARGEST: f64 = 1e4;

// Marks of a lane.
const LEAVES: u32 = 1;
const CONNECTS: u32 = 2;
/// Connects where more than one way may lead to the camera.
const IN_CORNER: u32 = CONNECTS << PANES;
const SPLITS: u32 = IN_CORNER << PANES;
const EXPIRES: u32 = SPLITS << 1;
const LEAPS: u32 = SPLITS << 2;
/// Might leap, but walks through the ball.
const STROLLS: u32 = SPLITS << 3;

/// A face that the camera sees.
#[derive(Clone, Copy)]
struct Pane {
    normal: [f32; 3],
    /// Distance from the middle of the block, mm.
    offset: f32,
    /// Optical depth of the shortest way to the camera, for each mm below the face.
    per_mm: f32,
    /// How far a way of length 1 may go along an axis on the face, at most, mm.
    aside: [f32; 3],
    /// The way across the block, optical.
    across: f32,
    /// Depth below which a scattering may be leapt over, mm.
    seen: f32,
}

/// Wanted weights, for [`Guide::split`].
#[derive(Clone, Copy)]
struct Wanted<'a> {
    center: [f32; 3],
    per_mm: f32,
    table: &'a [f32; STEPS],
    per_path: f32,
}

/// What all lanes have in common.
#[derive(Clone, Copy)]
struct Field<'a> {
    half: [f32; 3],
    mean_free_path: f32,
    sigma_a: f32,
    g: f32,
    panes: [Pane; PANES],
    sigma_t: f32,
    /// Of leaps, mm.
    radii: [f32; RADII.len()],
    wanted: Option<Wanted<'a>>,
}

/// The photons of a chunk of lanes, by quantity. Lengths in mm, from the middle of the block.
#[repr(C, align(64))]
#[derive(Clone)]
struct Chunk {
    at: [Floats; 3],
    direction: [Floats; 3],
    /// Direction before the last scattering.
    before: [Floats; 3],
    /// -ln of the weight.
    depth: Floats,
    /// Depth beyond which roulette is played.
    roulette: Floats,
    /// Optical depth of the longest connection that is tried.
    most: Floats,
    /// Which leap it takes, if any; which of the walks; and how it is turned.
    ball: Words,
    walk: Words,
    turn: Words,
    /// Times scattered.
    order: Words,
    random: [Words; 4],
    marks: Words,
}

impl Chunk {
    const EMPTY: Self = Self {
        at: [[0.0; WIDTH]; 3],
        direction: [[0.0; WIDTH]; 3],
        before: [[0.0; WIDTH]; 3],
        depth: [0.0; WIDTH],
        roulette: [f32::INFINITY; WIDTH],
        most: [0.0; WIDTH],
        ball: [0; WIDTH],
        walk: [0; WIDTH],
        turn: [0; WIDTH],
        order: [0; WIDTH],
        random: [[0; WIDTH]; 4],
        marks: [0; WIDTH],
    };
}

/// One step and one scattering of every lane. One whose step would leave the block stays as it was.
///
/// A loop for each part of it, none of which reads what is not in the chunk or on the stack: only
/// so do they become vector instructions.
#[inline(always)]
fn advance<const FMA: bool, const EVEN: bool, const GUIDED: bool>(
    chunk: &mut Chunk,
    field: &Field<'_>,
) {
    let Field {
        half,
        mean_free_path,
        sigma_a,
        g,
        panes,
        sigma_t,
        radii,
        wanted,
    } = *field;
    let mut chance = [0.0; WIDTH];
    for (i, chance) in chance.iter_mut().enumerate() {
        let mut stream = Stream32([
            chunk.random[0][i],
            chunk.random[1][i],
            chunk.random[2][i],
            chunk.random[3][i],
        ]);
        let free = minus_ln::<FMA>(stream.bits()) * mean_free_path;
        let [ux, uy, uz] = [
            chunk.direction[0][i],
            chunk.direction[1][i],
            chunk.direction[2][i],
        ];
        let [x, y, z] = [chunk.at[0][i], chunk.at[1][i], chunk.at[2][i]];
        let [nx, ny, nz] = [
            fma::<FMA>(ux, free, x),
            fma::<FMA>(uy, free, y),
            fma::<FMA>(uz, free, z),
        ];
        let leaves = (nx.abs() > half[0]) | (ny.abs() > half[1]) | (nz.abs() > half[2]);
        let left = mask(leaves);
        chunk.at[0][i] = choose(left, x, nx);
        chunk.at[1][i] = choose(left, y, ny);
        chunk.at[2][i] = choose(left, z, nz);
        chunk.depth[i] = fma::<FMA>(sigma_a, choose(left, 0.0, free), chunk.depth[i]);
        chunk.order[i] = chunk.order[i].wrapping_add(1 & !left);
        // The roulette of connections: none is tried beyond a random optical depth.
        chunk.most[i] = SURE_DEPTH as f32 + minus_ln::<FMA>(stream.bits());
        *chance = minus_ln::<FMA>(stream.bits());
        chunk.walk[i] = stream.bits();
        chunk.turn[i] = stream.bits();

        chunk.before[0][i] = ux;
        chunk.before[1][i] = uy;
        chunk.before[2][i] = uz;
        let xi = uniform(stream.bits());
        let azimuth = random_direction::<FMA>(stream.bits());
        let (vx, vy, vz) = if EVEN {
            turned_anyhow(2.0 - 2.0 * xi, azimuth)
        } else {
            turned::<FMA>([ux, uy, uz], henyey_greenstein::<FMA>(g, xi), azimuth)
        };
        chunk.direction[0][i] = choose(left, ux, vx);
        chunk.direction[1][i] = choose(left, uy, vy);
        chunk.direction[2][i] = choose(left, uz, vz);
        for (word, state) in chunk.random.iter_mut().zip(stream.0) {
            word[i] = state;
        }
        chunk.marks[i] = left & LEAVES;
    }
    let mut below = [f32::MAX; WIDTH];
    for (i, below) in below.iter_mut().enumerate() {
        let [x, y, z] = [chunk.at[0][i], chunk.at[1][i], chunk.at[2][i]];
        let clear = [half[0] - x.abs(), half[1] - y.abs(), half[2] - z.abs()];
        let mut reach = least(least(clear[0], clear[1]), clear[2]);
        let (mut nearest, mut marks) = (f32::MAX, 0);
        let mut under = [0.0; PANES];
        for (k, pane) in panes.iter().enumerate() {
            let [a, b, c] = pane.normal;
            under[k] = pane.offset - fma::<FMA>(a, x, fma::<FMA>(b, y, c * z));
            let most = chunk.most[i];
            let connects = mask(under[k] * pane.per_mm <= most);
            let length = most / sigma_t;
            let [a, b, c] = pane.aside;
            let side = least(clear[0] - a * length, clear[1] - b * length);
            let alone = mask((least(side, clear[2] - c * length) > 0.0) & (most < pane.across));
            marks |= connects & ((CONNECTS << k & alone) | (IN_CORNER << k & !alone));
            reach = least(reach, under[k] - pane.seen);
            nearest = least(nearest, under[k]);
        }
        *below = nearest;
        // The largest ball that fits.
        let (mut radius, mut ball) = (0.0, 0_u32);
        for r in radii {
            let fits = mask(reach >= r);
            radius = choose(fits, r, radius);
            ball = ball.wrapping_add(1 & fits);
        }
        chunk.ball[i] = ball;
        // Connections from within it are as rare as roulette would have them from its nearest
        // point: all of them, or none.
        let mut sure = f32::MAX;
        for (k, pane) in panes.iter().enumerate() {
            sure = least(sure, (under[k] - radius) * pane.per_mm);
        }
        let leaps = mask(chance[i] <= sure - SURE_DEPTH as f32);
        let may = mask(ball > 0);
        marks |= may & ((leaps & LEAPS) | (!leaps & STROLLS));
        marks |= mask(chunk.depth[i] > chunk.roulette[i]) & EXPIRES;
        let stays = chunk.marks[i].wrapping_sub(LEAVES);
        chunk.marks[i] |= marks & stays;
    }
    if GUIDED && let Some(wanted) = wanted {
        let [a, b, c] = wanted.center;
        let mut place = [0_u32; WIDTH];
        for (i, place) in place.iter_mut().enumerate() {
            let (a, b, c) = (chunk.at[0][i] - a, chunk.at[1][i] - b, chunk.at[2][i] - c);
            let steps = fma::<FMA>(a, a, fma::<FMA>(b, b, c * c)).sqrt() * wanted.per_mm;
            // Adding 2^23 leaves a whole number in the lowest bits.
            *place = (least(steps, (STEPS - 1) as f32) + 8_388_608.0).to_bits();
        }
        let light = place.map(|place| wanted.table[place as usize % STEPS]);
        for i in 0..WIDTH {
            let paths = fma::<FMA>(below[i], wanted.per_path, 1.0);
            let paths = if paths > 1.0 { paths } else { 1.0 };
            let heavy = light[i] - ln::<FMA>(paths) - chunk.depth[i];
            let stays = (chunk.marks[i] & LEAVES).wrapping_sub(LEAVES);
            chunk.marks[i] |= mask(heavy.abs() >= LN_2) & SPLITS & stays;
        }
    }
}

/// Takes the lanes that leap out of their balls, as the walks in `exits` do; the others' are nothing.
#[inline(always)]
fn leap<const FMA: bool>(chunk: &mut Chunk, exits: &Exits, sigma_a: f32) {
    let exits = exits.clone();
    for i in 0..WIDTH {
        let (cos, sin) = random_direction::<FMA>(chunk.turn[i]);
        let turned = |v: &[Floats; 3]| {
            let (a, b) = (v[0][i], v[1][i]);
            [cos * a - sin * b, sin * a + cos * b, v[2][i]]
        };
        let axis = [
            chunk.direction[0][i],
            chunk.direction[1][i],
            chunk.direction[2][i],
        ];
        let (x, y, z) = along_axis::<FMA>(axis, turned(&exits.at));
        let (ux, uy, uz) = unit::<FMA>(along_axis::<FMA>(axis, turned(&exits.direction)));
        chunk.at[0][i] += x;
        chunk.at[1][i] += y;
        chunk.at[2][i] += z;
        let leaps = mask(exits.length[i] > 0.0);
        chunk.direction[0][i] = choose(leaps, ux, axis[0]);
        chunk.direction[1][i] = choose(leaps, uy, axis[1]);
        chunk.direction[2][i] = choose(leaps, uz, axis[2]);
        chunk.depth[i] = fma::<FMA>(sigma_a, exits.length[i], chunk.depth[i]);
        chunk.order[i] = chunk.order[i].wrapping_add(exits.order[i]);
    }
}

/// Walks out of balls about the origin, which begin along z.
#[repr(C, align(64))]
#[derive(Clone)]
struct Exits {
    at: [Floats; 3],
    direction: [Floats; 3],
    length: Floats,
    order: Words,
}

impl Exits {
    const NONE: Self = Self {
        at: [[0.0; WIDTH]; 3],
        direction: [[0.0; WIDTH]; 3],
        length: [0.0; WIDTH],
        order: [0; WIDTH],
    };
}

struct Leap<'a> {
    chunk: &'a mut Chunk,
    exits: &'a Exits,
    sigma_a: f32,
}

impl LaneLoop for Leap<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        leap::<FMA>(self.chunk, self.exits, self.sigma_a);
    }
}

#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

struct Pass<'a> {
    chunks: &'a mut [Chunk],
    field: &'a Field<'a>,
}

impl Pass<'_> {
    #[inline(always)]
    fn all<const FMA: bool, const EVEN: bool, const GUIDED: bool>(self) {
        for chunk in self.chunks {
            advance::<FMA, EVEN, GUIDED>(chunk, self.field);
        }
    }
}

impl LaneLoop for Pass<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        match (self.field.g == 0.0, self.field.wanted.is_some()) {
            (true, true) => self.all::<FMA, true, true>(),
            (true, false) => self.all::<FMA, true, false>(),
            (false, true) => self.all::<FMA, false, true>(),
            (false, false) => self.all::<FMA, false, false>(),
        }
    }
}

/// Scatterings that wait to be connected to the camera through one face, and what became of them,
/// by quantity.
#[repr(C, align(64))]
struct Batch {
    /// From the middle of the block.
    at: [Floats; 3],
    direction: [Floats; 3],
    depth: Floats,
    most: Floats,
    /// Radiance for each W; 0 where no pixel sees it.
    value: [f64; WIDTH],
    pixel: Words,
    exit: [[f64; WIDTH]; 3],
    outer: [[f64; WIDTH]; 3],
    outer_length: [f64; WIDTH],
    /// By how much the tangent of the way may be off.
    off: [f64; WIDTH],
    order: Words,
    filled: usize,
}

impl Batch {
    const EMPTY: Self = Self {
        at: [[0.0; WIDTH]; 3],
        direction: [[0.0; WIDTH]; 3],
        depth: [0.0; WIDTH],
        most: [0.0; WIDTH],
        value: [0.0; WIDTH],
        pixel: [0; WIDTH],
        exit: [[0.0; WIDTH]; 3],
        outer: [[0.0; WIDTH]; 3],
        outer_length: [0.0; WIDTH],
        off: [0.0; WIDTH],
        order: [0; WIDTH],
        filled: 0,
    };
}

struct Connect<'a> {
    window: Window,
    medium: Medium,
    center: Vec3,
    batch: &'a mut Batch,
}

impl Connect<'_> {
    #[inline(always)]
    fn each<const FMA: bool, const PARALLEL: bool>(self, parallel: &Parallel) {
        let Self {
            window,
            medium,
            center,
            batch,
        } = self;
        let sigma_t = medium.sigma_t();
        let phase = HenyeyGreenstein { g: medium.g };
        for i in 0..WIDTH {
            let [x, y, z] = [0, 1, 2].map(|axis| f64::from(batch.at[axis][i]));
            let at = Vec3::new(center.x + x, center.y + y, center.z + z);
            let depth = window.depth(at);
            let (way, place, off) = if PARALLEL {
                let (way, place) = window.straight(parallel, at, depth);
                (way, place, 0.0)
            } else {
                window.bent_in_steps::<STEPS_OF_NEWTON>(at, depth)
            };
            let [a, b, c] = [0, 1, 2].map(|axis| f64::from(batch.direction[axis][i]));
            let cos = way.inner.x * a + way.inner.y * b + way.inner.z * c;
            let depth = sigma_t * way.length;
            // What roulette let through stands for what it took.
            let kept = if depth > SURE_DEPTH {
                depth - SURE_DEPTH
            } else {
                0.0
            };
            let value = phase.density(cos)
                * exp::<FMA>(kept - depth - f64::from(batch.depth[i]))
                * way.transmittance
                * way.radiance_per_intensity;
            let (pixel, inside) = window.pixel_in_lanes(place);
            let seen = inside & (depth <= f64::from(batch.most[i]));
            batch.value[i] = if seen { value } else { 0.0 };
            batch.pixel[i] = pixel;
            (batch.exit[0][i], batch.exit[1][i], batch.exit[2][i]) =
                (way.exit.x, way.exit.y, way.exit.z);
            (batch.outer[0][i], batch.outer[1][i], batch.outer[2][i]) =
                (way.outer.x, way.outer.y, way.outer.z);
            batch.outer_length[i] = way.outer_length;
            batch.off[i] = off;
        }
    }
}

impl LaneLoop for Connect<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        match self.window.parallel() {
            Some(parallel) => self.each::<FMA, true>(&parallel),
            None => self.each::<FMA, false>(&Parallel::default()),
        }
    }
}

/// Newton's steps in lanes, which are enough where the depth is a small part of the way.
const STEPS_OF_NEWTON: usize = 2;
/// Newton's last step, as a tangent, after which what is left is nothing.
const SETTLED: f64 = 1e-5;

/// Photons on their way through a block.
pub(crate) struct Pool<'a> {
    block: &'a Block,
    center: Vec3,
    field: Field<'a>,
    path: SimdPath,
    chunks: Vec<Chunk>,
    /// Lanes with a photon are the first so many.
    live: usize,
    batches: Vec<Batch>,
}

impl<'a> Pool<'a> {
    /// For the photons of a watch; `None` where single precision or lanes are not enough.
    pub(crate) fn new<F: Fn(usize, u32) -> usize>(
        watch: &Watch<'a, '_, F>,
        block: &'a Block,
        leaps: &Leaps,
        rng: &mut Stream,
    ) -> Option<Self> {
        let medium = watch.medium;
        let windows = watch.windows();
        let size = block.max - block.min;
        let spans = size.max_element() * medium.sigma_t();
        if !(medium.sigma_s > 0.0 && spans < LARGEST && windows.len() <= PANES) {
            return None;
        }
        let center = 0.5 * (block.min + block.max);
        let single = |v: Vec3| v.to_array().map(|x| x as f32);
        let mut panes = [Pane {
            normal: [0.0; 3],
            offset: f32::MAX,
            per_mm: 1.0,
            aside: [0.0; 3],
            across: 0.0,
            seen: 0.0,
        }; PANES];
        let sigma_t = medium.sigma_t();
        for (pane, window) in panes.iter_mut().zip(windows) {
            let slope = window.least_length(1.0);
            *pane = Pane {
                normal: single(window.normal()),
                offset: window.depth(center) as f32,
                per_mm: (sigma_t * slope) as f32,
                aside: single(window.aside(block.min, block.max)),
                across: (sigma_t * size[window.axis()]) as f32,
                seen: (watch.photons.seen_depth / sigma_t / slope) as f32,
            };
        }
        let seed = [0; 2].map(|_: u64| (draw(rng) * (1_u64 << 53) as f64) as u64);
        let mut chunks = vec![Chunk::EMPTY; CHUNKS];
        for (c, chunk) in chunks.iter_mut().enumerate() {
            for i in 0..WIDTH {
                let stream = lane(seed[0], &[seed[1], (c * WIDTH + i) as u64]);
                for (word, state) in chunk.random.iter_mut().zip(stream.0) {
                    word[i] = state;
                }
            }
        }
        Some(Self {
            block,
            center,
            field: Field {
                half: single(0.5 * size),
                mean_free_path: (1.0 / medium.sigma_s) as f32,
                sigma_a: medium.sigma_a as f32,
                g: medium.g as f32,
                panes,
                sigma_t: sigma_t as f32,
                radii: leaps.radii().map(|r| r as f32),
                wanted: watch.guide.map(|guide| {
                    let (middle, per_mm, table, path) = guide.table();
                    Wanted {
                        center: single(middle - center),
                        per_mm: per_mm as f32,
                        table,
                        per_path: (1.0 / path) as f32,
                    }
                }),
            },
            path: SimdPath::best(),
            chunks,
            live: 0,
            batches: windows.iter().map(|_| Batch::EMPTY).collect(),
        })
    }

    /// Follows the photons of the watch to their ends; returns those that left the block and are in
    /// a solid again.
    pub(crate) fn walk<F: Fn(usize, u32) -> usize>(
        mut self,
        mut watch: Watch<'a, '_, F>,
        leaps: &mut Leaps,
        rng: &mut Stream,
        powers: &mut [f64],
    ) -> Vec<Inside> {
        let mut out = vec![];
        loop {
            while self.live < CHUNKS * WIDTH
                && let Some(inside) = watch.waiting.pop()
            {
                self.live += 1;
                self.start(self.live - 1, &inside, &watch);
            }
            if self.live == 0 {
                break;
            }
            let chunks = self.live.div_ceil(WIDTH);
            self.leap(leaps);
            self.path.run(Pass {
                chunks: &mut self.chunks[..chunks],
                field: &self.field,
            });
            // From the last lane to the first: a lane that falls empty is filled from the end,
            // with a photon that has had its turn.
            for lane in (0..self.live).rev() {
                let marks = self.chunks[lane / WIDTH].marks[lane % WIDTH];
                if marks & !LEAPS == 0 {
                    continue;
                }
                let goes_on = if marks & LEAVES != 0 {
                    self.meet_wall(lane, &watch, rng, powers, &mut out)
                } else {
                    self.scattered(lane, marks, &mut watch, leaps, rng)
                };
                if !goes_on {
                    if let Some(inside) = watch.waiting.pop() {
                        self.start(lane, &inside, &watch);
                    } else {
                        self.close_ranks(lane);
                    }
                }
            }
        }
        for k in 0..self.batches.len() {
            self.flush(k, &mut watch);
        }
        out
    }

    fn start<F: Fn(usize, u32) -> usize>(
        &mut self,
        lane: usize,
        inside: &Inside,
        watch: &Watch<'_, '_, F>,
    ) {
        let (chunk, i) = (&mut self.chunks[lane / WIDTH], lane % WIDTH);
        chunk.order[i] = inside.order;
        chunk.marks[i] = 0;
        chunk.roulette[i] = watch.roulette(&inside.photon) as f32;
        self.put(lane, &inside.photon);
    }

    /// The photon of a lane, where it is and as it goes on.
    fn photon(&self, lane: usize) -> Photon {
        let (chunk, i) = (&self.chunks[lane / WIDTH], lane % WIDTH);
        Photon {
            at: self.center + vector(&chunk.at, i),
            direction: vector(&chunk.direction, i),
            depth: chunk.depth[i].into(),
        }
    }

    fn put(&mut self, lane: usize, photon: &Photon) {
        let (chunk, i) = (&mut self.chunks[lane / WIDTH], lane % WIDTH);
        let at = photon.at - self.center;
        for axis in 0..3 {
            let half = self.field.half[axis];
            chunk.at[axis][i] = (at[axis] as f32).clamp(-half, half);
            chunk.direction[axis][i] = photon.direction[axis] as f32;
        }
        chunk.depth[i] = photon.depth as f32;
    }

    /// Moves the last photon of the pool into `lane`, which has fallen empty.
    fn close_ranks(&mut self, lane: usize) {
        self.live -= 1;
        let last = self.live;
        if lane == last {
            return;
        }
        let (from, j) = (self.chunks[last / WIDTH].clone(), last % WIDTH);
        let (chunk, i) = (&mut self.chunks[lane / WIDTH], lane % WIDTH);
        for axis in 0..3 {
            chunk.at[axis][i] = from.at[axis][j];
            chunk.direction[axis][i] = from.direction[axis][j];
        }
        chunk.depth[i] = from.depth[j];
        chunk.roulette[i] = from.roulette[j];
        chunk.order[i] = from.order[j];
        chunk.marks[i] = from.marks[j];
        chunk.ball[i] = from.ball[j];
        chunk.walk[i] = from.walk[j];
        chunk.turn[i] = from.turn[j];
    }

    /// Takes the photons that leap out of their balls.
    fn leap(&mut self, leaps: &mut Leaps) {
        for c in 0..self.live.div_ceil(WIDTH) {
            let chunk = &mut self.chunks[c];
            let mut exits = Exits::NONE;
            let mut any = false;
            for i in 0..WIDTH.min(self.live - c * WIDTH) {
                if chunk.marks[i] & LEAPS == 0 {
                    continue;
                }
                any = true;
                let exit = leaps.walk(chunk.ball[i] as usize - 1, chunk.walk[i] as usize);
                for axis in 0..3 {
                    exits.at[axis][i] = exit.at[axis] as f32;
                    exits.direction[axis][i] = exit.direction[axis] as f32;
                }
                exits.length[i] = exit.length as f32;
                exits.order[i] = exit.scatterings;
            }
            if any {
                self.path.run(Leap {
                    chunk,
                    exits: &exits,
                    sigma_a: self.field.sigma_a,
                });
            }
        }
    }

    /// Takes a photon to the wall that its step would have crossed; `false` if it is gone.
    fn meet_wall<F: Fn(usize, u32) -> usize>(
        &mut self,
        lane: usize,
        watch: &Watch<'_, '_, F>,
        rng: &mut Stream,
        powers: &mut [f64],
        out: &mut Vec<Inside>,
    ) -> bool {
        let mut photon = self.photon(lane);
        let Some(hit) = self.block.leave(photon.at, photon.direction, f64::INFINITY) else {
            watch.photons.lost(watch.source, &photon, powers);
            return false;
        };
        photon.at += hit.distance * photon.direction;
        photon.depth += watch.medium.sigma_a * hit.distance;
        let parting = part(photon.direction, hit.normal, 1.0 / watch.medium.eta);
        if parting.reflectance < 1.0 && draw(rng) >= parting.reflectance {
            photon.direction = parting.refracted;
            let (photons, source, index) = (watch.photons, watch.source, watch.index);
            out.extend(photons.left(source, index, &hit, photon, rng, powers));
            return false;
        }
        photon.direction = parting.reflected;
        self.put(lane, &photon);
        true
    }

    /// What a photon that has scattered does besides; `false` if it is gone.
    fn scattered<F: Fn(usize, u32) -> usize>(
        &mut self,
        lane: usize,
        marks: u32,
        watch: &mut Watch<'a, '_, F>,
        leaps: &mut Leaps,
        rng: &mut Stream,
    ) -> bool {
        let (c, i) = (lane / WIDTH, lane % WIDTH);
        watch.order = self.chunks[c].order[i];
        for k in 0..self.batches.len() {
            if marks & (CONNECTS << k) != 0 {
                self.connect(lane, k, watch);
            } else if marks & (IN_CORNER << k) != 0 {
                let photon = self.before(lane);
                let reached = reached(self.chunks[c].most[i], watch.medium);
                let source = watch.source;
                watch.connect(&source.windows[watch.index][k], &photon, reached, 1.0);
            }
        }
        if let Some(guide) = watch.guide
            && marks & SPLITS != 0
        {
            let mut photon = self.before(lane);
            let goes_on = watch.split(guide, &mut photon, rng);
            if !goes_on {
                return false;
            }
            self.chunks[c].depth[i] = photon.depth as f32;
        }
        if marks & EXPIRES != 0 {
            let mut photon = self.photon(lane);
            if !survives(&mut photon, rng) {
                return false;
            }
            self.chunks[c].depth[i] = photon.depth as f32;
        }
        if marks & STROLLS != 0 {
            let mut photon = self.photon(lane);
            let radius = leaps.radius(self.chunks[c].ball[i] as usize - 1);
            watch.strolls(&photon, radius);
            if !through_ball(watch.medium, radius, &mut photon, rng, watch) {
                return false;
            }
            self.chunks[c].order[i] = watch.order;
            self.put(lane, &photon);
        }
        true
    }

    /// The photon of a lane as it came to its scattering.
    fn before(&self, lane: usize) -> Photon {
        let (chunk, i) = (&self.chunks[lane / WIDTH], lane % WIDTH);
        Photon {
            direction: vector(&chunk.before, i),
            ..self.photon(lane)
        }
    }

    /// Connects a scattering through one face, when there are enough of them.
    fn connect<F: Fn(usize, u32) -> usize>(
        &mut self,
        lane: usize,
        k: usize,
        watch: &mut Watch<'a, '_, F>,
    ) {
        let (chunk, i) = (&self.chunks[lane / WIDTH], lane % WIDTH);
        let batch = &mut self.batches[k];
        let n = batch.filled;
        for axis in 0..3 {
            batch.at[axis][n] = chunk.at[axis][i];
            batch.direction[axis][n] = chunk.before[axis][i];
        }
        batch.depth[n] = chunk.depth[i];
        batch.most[n] = chunk.most[i];
        batch.order[n] = chunk.order[i];
        batch.filled += 1;
        if batch.filled == WIDTH {
            self.flush(k, watch);
        }
    }

    /// Connects all that wait at one face.
    fn flush<F: Fn(usize, u32) -> usize>(&mut self, k: usize, watch: &mut Watch<'a, '_, F>) {
        let source = watch.source;
        let window = source.windows[watch.index][k];
        let batch = &mut self.batches[k];
        self.path.run(Connect {
            window,
            medium: *watch.medium,
            center: self.center,
            batch,
        });
        let among_others = watch.photons.scene.objects.len() > 1;
        for i in 0..batch.filled {
            if batch.off[i] > SETTLED {
                let photon = Photon {
                    at: self.center + vector(&batch.at, i),
                    direction: vector(&batch.direction, i),
                    depth: batch.depth[i].into(),
                };
                let reached = reached(batch.most[i], watch.medium);
                let order = std::mem::replace(&mut watch.order, batch.order[i]);
                watch.connect(&window, &photon, reached, 1.0);
                watch.order = order;
                continue;
            }
            if batch.value[i] == 0.0 {
                continue;
            }
            if among_others {
                let vector = |of: &[[f64; WIDTH]; 3]| Vec3::new(of[0][i], of[1][i], of[2][i]);
                let (exit, outer) = (vector(&batch.exit), vector(&batch.outer));
                let length = batch.outer_length[i];
                if watch.photons.hidden(watch.index, exit, outer, length) {
                    continue;
                }
            }
            watch.add(batch.pixel[i] as usize, batch.order[i], batch.value[i]);
        }
        batch.filled = 0;
    }
}

/// The vector of a lane.
fn vector(of: &[Floats; 3], lane: usize) -> Vec3 {
    let [x, y, z] = [0, 1, 2].map(|axis| f64::from(of[axis][lane]));
    Vec3::new(x, y, z)
}

/// How far a connection goes that roulette lets go to the optical depth `most`.
fn reached(most: f32, medium: &Medium) -> Reached {
    Reached {
        most: f64::from(most) / medium.sigma_t(),
        sure: SURE_DEPTH,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Lens, View};
    use physics::random::stream;

    const HALF: [f32; 3] = [1.5, 2.0, 1.0];

    fn field(g: f32) -> Field<'static> {
        let pane = |normal: [f32; 3], offset: f32| Pane {
            normal,
            offset,
            per_mm: 9.0,
            aside: [0.5, 0.5, 0.0],
            across: 20.0,
            seen: 0.2,
        };
        Field {
            half: HALF,
            mean_free_path: 0.1,
            sigma_a: 0.05,
            g,
            panes: [
                pane([0.0, 0.0, 1.0], 1.0),
                pane([0.0, -1.0, 0.0], 2.0),
                pane([0.0; 3], f32::MAX),
            ],
            sigma_t: 9.0,
            radii: [0.3, 0.6, 1.2, 2.4],
            wanted: None,
        }
    }

    /// A few hundred steps on each path of the processor: the same photons, but for rounding, stay in
    /// the block, scatter by the phase function and fly as far as they should.
    #[test]
    fn every_path_walks_alike() {
        for g in [0.0, 0.7] {
            let mut start = Chunk::EMPTY;
            for i in 0..WIDTH {
                let random = lane(5, &[i as u64]);
                for (word, state) in start.random.iter_mut().zip(random.0) {
                    word[i] = state;
                }
                start.direction[2][i] = 1.0;
            }
            let field = field(g);
            let paths = SimdPath::ALL.into_iter().filter(|path| path.is_available());
            let ends: Vec<Chunk> = paths
                .map(|path| {
                    let mut chunks = [start.clone()];
                    let (mut cosines, mut flown, mut n) = (0.0, 0.0, 0.0);
                    for _ in 0..3000 {
                        let before = chunks[0].clone();
                        path.run(Pass {
                            chunks: &mut chunks,
                            field: &field,
                        });
                        let [chunk] = &mut chunks;
                        for i in 0..WIDTH {
                            if chunk.marks[i] & LEAVES != 0 {
                                assert_eq!(chunk.at[0][i], before.at[0][i]);
                                assert_eq!(chunk.order[i], before.order[i]);
                                // Back to the middle.
                                for axis in 0..3 {
                                    chunk.at[axis][i] = 0.0;
                                }
                                continue;
                            }
                            let dot: f32 = (0..3)
                                .map(|a| chunk.direction[a][i] * chunk.before[a][i])
                                .sum();
                            cosines += f64::from(dot);
                            flown += f64::from(chunk.depth[i] - before.depth[i]) / 0.05;
                            n += 1.0;
                            let z = 1.0 - chunk.at[2][i];
                            let seen = chunk.marks[i] & (CONNECTS | IN_CORNER) != 0;
                            assert_eq!(seen, z * 9.0 <= chunk.most[i], "{z}");
                            for (axis, half) in HALF.iter().enumerate() {
                                assert!(chunk.at[axis][i].abs() <= *half);
                            }
                        }
                    }
                    // Within four standard errors; flights that left are missing, the long ones.
                    let mean: f64 = cosines / n;
                    assert!(
                        (mean - f64::from(g)).abs() < 4.0 * (1.0 / n).sqrt(),
                        "{g}: {mean}"
                    );
                    let mean = flown / n;
                    assert!((0.085..0.1).contains(&mean), "{path:?}: {mean}");
                    let [chunk] = chunks;
                    chunk
                })
                .collect();
            // Streams do not depend on what rounding does.
            for end in &ends {
                assert_eq!(end.random, ends[0].random);
            }
        }
    }

    /// Connections in lanes are those of the plain walk.
    #[test]
    fn connections_in_lanes_are_the_plain_ones() {
        let view = View {
            from: Vec3::new(3.0, -4.0, 30.0),
            to: Vec3::new(0.2, 0.0, 0.0),
            up: Vec3::Y,
            width: 40,
            height: 30,
        };
        let medium = Medium {
            sigma_a: 0.1,
            sigma_s: 2.0,
            g: 0.6,
            eta: 1.4,
        };
        let block = Block {
            min: Vec3::new(-6.0, -6.0, -3.0),
            max: Vec3::new(6.0, 6.0, 1.0),
        };
        let center = 0.5 * (block.min + block.max);
        for lens in [
            Lens::Pinhole { field: 0.4 },
            Lens::Orthographic { height: 10.0 },
        ] {
            let camera = Camera::new(view, lens).unwrap();
            let window = camera.window(block.faces()[5], medium.eta).unwrap();
            let mut rng = stream(2, &[]);
            let mut seen = 0;
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                let mut batch = Batch::EMPTY;
                for i in 0..WIDTH {
                    let mut next = || 2.0 * draw(&mut rng) as f32 - 1.0;
                    let direction = Vec3::new(next().into(), next().into(), next().into());
                    let direction = direction.normalize();
                    for axis in 0..3 {
                        batch.direction[axis][i] = direction[axis] as f32;
                        batch.at[axis][i] = [7.0, 7.0, 2.0][axis] * next();
                    }
                    (batch.depth[i], batch.most[i]) = (1.0 + next(), 4.0);
                }
                path.run(Connect {
                    window,
                    medium,
                    center,
                    batch: &mut batch,
                });
                for i in 0..WIDTH {
                    let at = center + vector(&batch.at, i);
                    let way = window.connect(at, window.depth(at));
                    let way = way.filter(|way| way.length * medium.sigma_t() <= 4.0);
                    let Some(way) = way else {
                        assert_eq!(batch.value[i], 0.0);
                        continue;
                    };
                    seen += 1;
                    let cos = way.inner.dot(vector(&batch.direction, i));
                    let depth = way.length * medium.sigma_t();
                    let weight = (-depth.min(SURE_DEPTH) - f64::from(batch.depth[i])).exp();
                    let expected = HenyeyGreenstein { g: 0.6 }.density(cos)
                        * weight
                        * way.transmittance
                        * way.radiance_per_intensity;
                    assert!(
                        (batch.value[i] / expected - 1.0).abs() < 1e-7,
                        "{lens:?} {path:?}"
                    );
                    assert_eq!(batch.pixel[i] as usize, way.pixel);
                    assert!(batch.off[i] < SETTLED);
                    // No way goes farther to the side than it is said to.
                    let aside = window.aside(block.min, block.max);
                    let moved = (way.exit - at).abs();
                    assert!(moved.x <= aside.x * way.length + 1e-12);
                    assert!(moved.y <= aside.y * way.length + 1e-12);
                }
            }
            assert!(seen > 10, "{seen}");
        }
    }
}

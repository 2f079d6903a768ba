//! The walk in lanes of single precision: the fast form of [`crate::scalar`].
//!
//! A pool of lanes steps all its photons at once. What is rare is done here, one photon at a time
//! and in double precision: launches, boundaries, roulette and exits. A lane whose photon has come
//! to its end takes the next photon of the block; at the end of a block the photons that are left
//! close ranks.

use crate::beam::launch;
use crate::boundary::{Meeting, meet};
use crate::cells::{BlockCells, Exit, PHOTONS_PER_BLOCK};
use crate::kernel::{Chunk, Flight, Limits, Scattering};
use crate::path::Stepper;
use crate::problem::{Flown, Problem, ROULETTE_DEPTH, Trail, roulette};
use crate::random::{self, Uniform};
use physics::Phase;
use physics::lanes::{Stream32, WIDTH};
use physics::simd::SimdPath;
use std::ops::Range;

/// Chunks of a pool: enough to keep the processor's pipelines full, few enough for its nearest
/// cache.
const CHUNKS: usize = 8;
/// A mean free path for clear layers. No layer is so thick, and no product with it overflows.
const CLEAR: f32 = 1e30;

/// What the hot loop does not need to know about a photon.
#[derive(Clone, Copy, Debug, Default)]
struct Cold {
    layer: usize,
    /// Weight when its losses were last booked.
    booked: f64,
    absorbed: f64,
    specular: f64,
}

/// Photons on their way.
struct Pool<'p, 'c> {
    problem: &'p Problem,
    stepper: Stepper,
    chunks: Vec<Chunk>,
    flights: Vec<Flight>,
    cold: Vec<Cold>,
    /// Lanes with a photon are the first so many.
    live: usize,
    /// Photons of the block that have not started.
    waiting: Range<u64>,
    trail: Trail,
    cells: BlockCells<'c>,
}

/// How the scattering angles of a medium are drawn.
fn scattering(problem: &Problem) -> Scattering {
    let mut phases = problem
        .medium
        .layers
        .iter()
        .filter(|l| l.sigma_s > 0.0)
        .map(|l| &l.phase);
    if phases.clone().all(|phase| *phase == Phase::ISOTROPIC) {
        Scattering::Isotropic
    } else if phases.all(|phase| matches!(phase, Phase::HenyeyGreenstein { .. })) {
        Scattering::HenyeyGreenstein
    } else {
        Scattering::Given
    }
}

/// Follows the photons of a block, or returns early with `None` once `stop` says so.
pub(crate) fn walk_block<'c>(
    problem: &Problem,
    path: SimdPath,
    block: u64,
    cells: BlockCells<'c>,
    stop: &impl Fn() -> bool,
) -> Option<BlockCells<'c>> {
    let first = block * PHOTONS_PER_BLOCK;
    let flights = cells.follows_flights();
    let limits = Limits {
        depth: ROULETTE_DEPTH as f32,
        path: problem.path_cutoff as f32,
    };
    let mut pool = Pool {
        problem,
        stepper: Stepper::new(path, scattering(problem), flights, limits),
        chunks: vec![Chunk::EMPTY; CHUNKS],
        flights: vec![Flight::NONE; if flights { CHUNKS } else { 0 }],
        cold: vec![Cold::default(); CHUNKS * WIDTH],
        live: 0,
        waiting: first..first + PHOTONS_PER_BLOCK,
        trail: Trail::new(problem.seed, block),
        cells,
    };
    while pool.live < CHUNKS * WIDTH && pool.refill(pool.live) {
        pool.live += 1;
    }
    while pool.live > 0 {
        if stop() {
            return None;
        }
        pool.pass();
    }
    Some(pool.cells)
}

impl Pool<'_, '_> {
    /// One step and one scattering of every photon.
    fn pass(&mut self) {
        let chunks = self.live.div_ceil(WIDTH);
        if self.stepper.scattering() == Scattering::Given {
            self.draw_angles();
        }
        let flights = if self.stepper.records_flights() {
            chunks
        } else {
            0
        };
        self.stepper
            .advance(&mut self.chunks[..chunks], &mut self.flights[..flights]);
        self.cells.events += self.live as u64;
        if flights > 0 {
            self.follow_flights();
        }
        // From the last lane to the first: a lane that falls empty is filled from the end, with a
        // photon that has had its turn.
        for c in (0..chunks).rev() {
            let mut marked = self.chunks[c].marked;
            let lanes = (marked | (marked >> WIDTH)) & ((1 << WIDTH) - 1);
            self.cells.events -= u64::from((marked & ((1 << WIDTH) - 1)).count_ones());
            let mut lanes = lanes;
            while lanes != 0 {
                let i = lanes.ilog2() as usize;
                lanes ^= 1 << i;
                let leaves = (marked >> i) & 1 == 1;
                let expired = (marked >> (WIDTH + i)) & 1 == 1;
                marked &= !(1 << i);
                let lane = c * WIDTH + i;
                let goes_on =
                    (!leaves || self.meet_boundary(lane)) && (!expired || self.expire(lane));
                if !goes_on {
                    self.cells.absorb(self.cold[lane].absorbed);
                    if !self.refill(lane) {
                        self.close_ranks(lane);
                    }
                }
            }
        }
    }

    /// Starts the next photon that enters the medium in `lane`; `false` if none is left.
    fn refill(&mut self, lane: usize) -> bool {
        let (c, i) = (lane / WIDTH, lane % WIDTH);
        for photon in self.waiting.by_ref() {
            let mut random = random::lane(self.problem.seed, photon);
            let start = launch(&self.problem.incidence, &self.problem.medium, &mut random);
            self.cells.arrive(start.specular);
            if start.specular >= 1.0 {
                self.cells.absorb(0.0);
                continue;
            }
            let chunk = &mut self.chunks[c];
            [chunk.x[i], chunk.y[i]] = start.at.map(|x| x as f32);
            chunk.z[i] = 0.0;
            [chunk.ux[i], chunk.uy[i], chunk.uz[i]] = start.direction.map(|u| u as f32);
            let depth = -(-start.specular).ln_1p();
            chunk.depth[i] = depth as f32;
            chunk.path[i] = 0.0;
            chunk.order[i] = 0;
            set_stream(chunk, i, random);
            let booked = f64::from(-chunk.depth[i]).exp();
            self.cold[lane] = Cold {
                layer: 0,
                booked,
                absorbed: 0.0,
                specular: start.specular,
            };
            self.enter_layer(lane, 0);
            return true;
        }
        false
    }

    /// Moves the last photon of the pool into `lane`, which has fallen empty.
    fn close_ranks(&mut self, lane: usize) {
        self.live -= 1;
        let last = self.live;
        self.cold[lane] = self.cold[last];
        let (from, i) = (last / WIDTH, last % WIDTH);
        let photon = self.chunks[from].lane(i);
        self.chunks[lane / WIDTH].set_lane(lane % WIDTH, &photon);
        self.chunks[from].set_lane(i, &Chunk::EMPTY.lane(0));
    }

    fn enter_layer(&mut self, lane: usize, layer: usize) {
        let (chunk, i) = (&mut self.chunks[lane / WIDTH], lane % WIDTH);
        let here = &self.problem.medium.layers[layer];
        self.cold[lane].layer = layer;
        chunk.mean_free_path[i] = ((1.0 / here.sigma_s) as f32).min(CLEAR);
        chunk.sigma_a[i] = here.sigma_a as f32;
        chunk.thickness[i] = here.thickness() as f32;
        chunk.g[i] = match here.phase {
            Phase::HenyeyGreenstein { g } => g as f32,
            Phase::Rayleigh | Phase::Tabulated(_) | Phase::Mixture(_) => 0.0,
        };
    }

    /// Draws the next scattering angle of every photon, by its layer's phase function.
    fn draw_angles(&mut self) {
        for lane in 0..self.live {
            let (chunk, i) = (&mut self.chunks[lane / WIDTH], lane % WIDTH);
            let mut random = stream(chunk, i);
            let phase = &self.problem.medium.layers[self.cold[lane].layer].phase;
            chunk.one_minus_cos[i] = phase.one_minus_cos(random.uniform()) as f32;
            set_stream(chunk, i, random);
        }
    }

    /// Spreads over depth and radius what every photon has lost in this pass.
    fn follow_flights(&mut self) {
        for lane in 0..self.live {
            let (c, i) = (lane / WIDTH, lane % WIDTH);
            let (flight, chunk) = (&self.flights[c], &self.chunks[c]);
            let top = self.problem.tops[self.cold[lane].layer];
            let flown = Flown {
                from: [
                    f64::from(flight.x[i]),
                    f64::from(flight.y[i]),
                    top + f64::from(flight.z[i]),
                ],
                direction: [flight.ux[i], flight.uy[i], flight.uz[i]].map(f64::from),
                length: f64::from(flight.length[i]),
                depths: [flight.depth[i], chunk.depth[i]].map(f64::from),
                sigma_a: f64::from(chunk.sigma_a[i]),
            };
            self.trail.deposit(&flown, &mut self.cells);
        }
    }

    /// Books what the photon has lost in its layer since it was last booked.
    fn book(&mut self, lane: usize) {
        let cold = &mut self.cold[lane];
        let weight = f64::from(-self.chunks[lane / WIDTH].depth[lane % WIDTH]).exp();
        let lost = cold.booked - weight;
        cold.absorbed += lost;
        cold.booked = weight;
        self.cells.absorb_in_layer(cold.layer, lost);
    }

    /// Takes the photon to the boundary that its step would have crossed; `false` if that is its
    /// end.
    fn meet_boundary(&mut self, lane: usize) -> bool {
        let (c, i) = (lane / WIDTH, lane % WIDTH);
        let layer = self.cold[lane].layer;
        let chunk = &mut self.chunks[c];
        let [x, y, z] = [chunk.x[i], chunk.y[i], chunk.z[i]].map(f64::from);
        let [ux, uy, uz] = [chunk.ux[i], chunk.uy[i], chunk.uz[i]].map(f64::from);
        let down = uz > 0.0;
        let boundary = if down { chunk.thickness[i] } else { 0.0 };
        let length = ((f64::from(boundary) - z) / uz).max(0.0);
        let before = f64::from(chunk.depth[i]);
        chunk.depth[i] += (f64::from(chunk.sigma_a[i]) * length) as f32;
        chunk.path[i] += length as f32;
        let [x_there, y_there] = [x + ux * length, y + uy * length];
        [chunk.x[i], chunk.y[i]] = [x_there as f32, y_there as f32];
        chunk.z[i] = boundary;
        let (depth, path) = (f64::from(chunk.depth[i]), f64::from(chunk.path[i]));
        if self.stepper.records_flights() {
            let flown = Flown {
                from: [x, y, self.problem.tops[layer] + z],
                direction: [ux, uy, uz],
                length,
                depths: [before, depth],
                sigma_a: f64::from(chunk.sigma_a[i]),
            };
            self.trail.deposit(&flown, &mut self.cells);
        }
        self.book(lane);
        let weight = self.cold[lane].booked;
        if path > self.problem.path_cutoff {
            self.cells.cut_off(weight);
            return false;
        }

        let chunk = &mut self.chunks[c];
        let mut random = stream(chunk, i);
        let meeting = meet(
            &self.problem.medium,
            layer,
            down,
            uz.abs(),
            random.uniform(),
        );
        set_stream(chunk, i, random);
        match meeting {
            Meeting::Reflected => {
                chunk.uz[i] = -chunk.uz[i];
                true
            }
            Meeting::Entered {
                layer: next,
                cos,
                along,
            } => {
                chunk.ux[i] = (ux * along) as f32;
                chunk.uy[i] = (uy * along) as f32;
                chunk.uz[i] = cos.copysign(uz) as f32;
                self.enter_layer(lane, next);
                let chunk = &mut self.chunks[c];
                chunk.z[i] = if next > layer {
                    0.0
                } else {
                    chunk.thickness[i]
                };
                true
            }
            Meeting::Left { side, cos } => {
                let specular = self.cold[lane].specular;
                let (radius, order) = (x_there.hypot(y_there), chunk.order[i]);
                self.cells.leave(&Exit {
                    side,
                    weight,
                    radius,
                    cos,
                    along: [ux, uy],
                    path,
                    order,
                    specular,
                });
                false
            }
        }
    }

    /// Drops a photon that has gone too far, or plays roulette with one that is nearly absorbed;
    /// `false` if that is its end.
    fn expire(&mut self, lane: usize) -> bool {
        self.book(lane);
        let (chunk, i) = (&mut self.chunks[lane / WIDTH], lane % WIDTH);
        if f64::from(chunk.path[i]) > self.problem.path_cutoff {
            self.cells.cut_off(self.cold[lane].booked);
            return false;
        }
        let mut random = stream(chunk, i);
        let risen = roulette(f64::from(chunk.depth[i]), random.uniform(), &mut self.cells);
        set_stream(chunk, i, random);
        let Some(risen) = risen else { return false };
        chunk.depth[i] = risen as f32;
        // What single precision makes of the new weight is settled with roulette's account.
        let weight = f64::from(-chunk.depth[i]).exp();
        self.cells.roulette((-risen).exp() - weight);
        self.cold[lane].booked = weight;
        true
    }
}

fn stream(chunk: &Chunk, i: usize) -> Stream32 {
    Stream32(std::array::from_fn(|word| chunk.random[word][i]))
}

fn set_stream(chunk: &mut Chunk, i: usize, random: Stream32) {
    for (word, state) in chunk.random.iter_mut().zip(random.0) {
        word[i] = state;
    }
}

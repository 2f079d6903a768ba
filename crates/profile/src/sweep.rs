//! One pass over a picture of equal squares, sixteen pixels at a time: the fast form of what
//! [`crate::survey`] does pixel by pixel where they are not.

use crate::curve::Curve;
use crate::rings::{Rings, Run};
use crate::survey::Limit;
use physics::ChannelMap;
use physics::lanes::mask;
use physics::simd::{LaneLoop, SimdPath};
use rayon::prelude::*;
use std::array::from_fn;
use std::ops::Range;

/// Pixels that are handled at once: as many as the widest registers hold. Of fewer, the compiler
/// packs two different blocks into one register, and takes them apart again at every step.
const LANES: usize = 16;

/// Groups into which the pixels of a ring fall, by their columns.
pub(crate) const GROUPS: usize = 8;

type Lanes = [f32; LANES];

/// Rows that one thread takes at once. Within them sums are kept in single precision: a lane adds
/// up at most a few thousand pixels of a ring there.
const BLOCK_ROWS: usize = 128;

/// Pixels of a ring that are enough for a first mean or for its scatter.
const ENOUGH: f64 = 10_000.0;

/// One row in so many is looked at, at the least, where a ring has more than enough.
const MOST_STEP: usize = 16;

/// What a pass looks at and lets through.
pub(crate) struct Sweep<'a> {
    pub(crate) channel: &'a ChannelMap,
    pub(crate) size: (usize, usize),
    pub(crate) center: [f64; 2],
    pub(crate) rings: &'a Rings,
    /// What is taken from each value; nothing where there is no curve yet.
    pub(crate) curve: Option<&'a Curve>,
    /// How far from the curve a pixel of each ring may lie; `None` lets all through.
    pub(crate) limits: Option<&'a [Limit]>,
    /// Standard uncertainties as which the residual of a pixel counts at most in the scatter;
    /// `None` where the scatter is not asked for.
    pub(crate) far: Option<f64>,
    /// Whether a part of the rows is enough where rings have many pixels.
    pub(crate) thinned: bool,
}

/// Sums over the pixels of a ring, lane by lane.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally(Sums<f64>);

/// What is summed in each lane.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
struct Sums<T> {
    /// Pixels that a measured picture would have; a value that is no number is none.
    inside: [T; LANES],
    /// Those of them that were measured, and those of these that were let through.
    measured: [T; LANES],
    count: [T; LANES],
    /// What follows is of the pixels that were let through, but for the scatter.
    residual: [T; LANES],
    variance: [T; LANES],
    tau: [[T; LANES]; 3],
    scatter: [T; LANES],
}

impl Tally {
    /// Pixels, measured or not.
    pub(crate) fn inside(&self) -> f64 {
        self.0.inside.iter().sum()
    }

    pub(crate) fn measured(&self) -> f64 {
        self.0.measured.iter().sum()
    }

    pub(crate) fn count(&self) -> f64 {
        self.0.count.iter().sum()
    }

    /// Sum of what remains of the values without the curve.
    pub(crate) fn residual(&self) -> f64 {
        self.0.residual.iter().sum()
    }

    pub(crate) fn variance(&self) -> f64 {
        self.0.variance.iter().sum()
    }

    /// Sums of the first three powers of τ.
    pub(crate) fn tau(&self) -> [f64; 3] {
        self.0.tau.map(|lanes| lanes.iter().sum())
    }

    /// Sum of |residual|/u over all measured pixels.
    pub(crate) fn scatter(&self) -> f64 {
        self.0.scatter.iter().sum()
    }

    /// Count and sum of each group of pixels.
    pub(crate) fn groups(&self) -> [(f64, f64); GROUPS] {
        let Sums {
            count, residual, ..
        } = &self.0;
        from_fn(|group| {
            let sum = |lanes: &[f64; LANES]| lanes.iter().skip(group).step_by(GROUPS).sum();
            (sum(count), sum(residual))
        })
    }

    fn add(&mut self, from: &Sums<f32>) {
        let add = |to: &mut [f64; LANES], from: &[f32; LANES]| {
            for (to, from) in to.iter_mut().zip(from) {
                *to += f64::from(*from);
            }
        };
        let to = &mut self.0;
        add(&mut to.inside, &from.inside);
        add(&mut to.measured, &from.measured);
        add(&mut to.count, &from.count);
        add(&mut to.residual, &from.residual);
        add(&mut to.variance, &from.variance);
        add(&mut to.scatter, &from.scatter);
        for (to, from) in to.tau.iter_mut().zip(&from.tau) {
            add(to, from);
        }
    }
}

/// What the pixels of a ring have in common.
struct OfRing {
    /// Middle of the ring in r², and one over half of its width there.
    middle: f64,
    per_half: f64,
    /// Coefficients of the curve in τ.
    cubic: [f32; 4],
    /// How far a pixel may lie from the curve: the square in units of its variance, and what
    /// comes on top.
    relative_square: f32,
    slack: f32,
}

impl Sweep<'_> {
    /// The sums over each ring.
    pub(crate) fn tallies(&self) -> Vec<Tally> {
        let of_rings: Vec<OfRing> = (0..self.rings.len())
            .map(|ring| self.of_ring(ring))
            .collect();
        // Up to which ring each row of a cycle is looked at: rings grow outwards.
        let reach = |row: usize| {
            let beyond = (0..self.rings.len()).find(|ring| {
                let step = (self.rings.area(*ring) / ENOUGH) as usize;
                let step = step.clamp(1, MOST_STEP);
                // The power of two that is no larger.
                !row.is_multiple_of(1 << step.ilog2())
            });
            beyond.filter(|_| self.thinned).unwrap_or(self.rings.len())
        };
        let reach: [usize; MOST_STEP] = from_fn(reach);
        let (_, height) = self.size;
        let blocks: Vec<Vec<Sums<f32>>> = (0..height.div_ceil(BLOCK_ROWS))
            .into_par_iter()
            .map(|block| {
                let first = block * BLOCK_ROWS;
                SimdPath::best().run(Block {
                    sweep: self,
                    of_rings: &of_rings,
                    rows: first..(first + BLOCK_ROWS).min(height),
                    reach: &reach,
                })
            })
            .collect();
        // In the order of the rows, however many threads there were.
        let mut tallies = vec![Tally::default(); self.rings.len()];
        for block in &blocks {
            for (tally, block) in tallies.iter_mut().zip(block) {
                tally.add(block);
            }
        }
        tallies
    }

    fn of_ring(&self, ring: usize) -> OfRing {
        let (middle, half) = self.rings.square(ring);
        let limit = self.limits.map(|limits| limits[ring]);
        OfRing {
            middle,
            per_half: 1.0 / half,
            cubic: self
                .curve
                .map_or([0.0; 4], |curve| curve.cubic(ring).map(|c| c as f32)),
            relative_square: limit.map_or(0.0, |limit| limit.relative.powi(2) as f32),
            slack: limit.map_or(f32::MAX, |limit| limit.slack as f32),
        }
    }
}

/// Some rows, to be compiled for the instructions that there are. Each operation stands alone and
/// in the same order whichever they are, so that the sums are the same.
struct Block<'s, 'a> {
    sweep: &'s Sweep<'a>,
    of_rings: &'s [OfRing],
    rows: Range<usize>,
    /// How many rings are looked at in each row of a cycle.
    reach: &'s [usize; MOST_STEP],
}

impl LaneLoop for Block<'_, '_> {
    type Output = Vec<Sums<f32>>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Vec<Sums<f32>> {
        let Self {
            sweep,
            of_rings,
            rows,
            reach,
        } = self;
        let mut tallies = vec![Sums::default(); of_rings.len()];
        let mut room = vec![];
        for y in rows {
            let rings = reach[y % MOST_STEP];
            let (width, _) = sweep.size;
            let runs = (sweep.rings).runs_of_row(width, sweep.center, y, rings, &mut room);
            // Apart, so that each loop has its registers to itself.
            match sweep.far {
                Some(far) => {
                    for run in runs {
                        let tally = &mut tallies[run.ring];
                        sweep.add::<true>(&of_rings[run.ring], run, far as f32, tally);
                    }
                }
                None => {
                    for run in runs {
                        let tally = &mut tallies[run.ring];
                        sweep.add::<false>(&of_rings[run.ring], run, 0.0, tally);
                    }
                }
            }
        }
        tallies
    }
}

impl Sweep<'_> {
    /// Adds the pixels of a run.
    #[inline(always)]
    fn add<const SCATTER: bool>(&self, ring: &OfRing, run: &Run, far: f32, tally: &mut Sums<f32>) {
        // τ is a quadratic in the number of the pixel in its run.
        let square = run.dx * run.dx + run.dy * run.dy;
        let start = ((square - ring.middle) * ring.per_half) as f32;
        let linear = (2.0 * run.dx * ring.per_half) as f32;
        let quadratic = ring.per_half as f32;
        let path = Path {
            coefficients: [start, linear, quadratic],
            length: run.pixels.len() as f32,
        };
        // Lanes keep to columns of the picture, so that a run's ends are cut off by number.
        let before = run.pixels.start % LANES;
        let pixels = run.pixels.start - before..run.pixels.end.next_multiple_of(LANES);
        let [value, variance] = [&self.channel.value, &self.channel.variance];
        let sums = match (value.get(pixels.clone()), variance.get(pixels.clone())) {
            (Some(value), Some(variance)) => {
                let [value, variance] = [value, variance].map(|x| x.as_chunks().0);
                ring.sums::<SCATTER>(path, before, value, variance, far)
            }
            // The last pixels of the picture may be fewer.
            _ => {
                let [value, variance] =
                    [(value, 0.0), (variance, f32::INFINITY)].map(|(plane, none)| -> Vec<Lanes> {
                        let block = |at| from_fn(|i| plane.get(at + i).copied().unwrap_or(none));
                        pixels.clone().step_by(LANES).map(block).collect()
                    });
                ring.sums::<SCATTER>(path, before, &value, &variance, far)
            }
        };
        tally.add::<SCATTER>(&sums);
    }
}

impl Sums<f32> {
    /// Adds those of a run.
    #[inline(always)]
    fn add<const SCATTER: bool>(&mut self, run: &Self) {
        add(&mut self.inside, &run.inside);
        add(&mut self.measured, &run.measured);
        add(&mut self.count, &run.count);
        add(&mut self.residual, &run.residual);
        add(&mut self.variance, &run.variance);
        for (to, from) in self.tau.iter_mut().zip(&run.tau) {
            add(to, from);
        }
        if SCATTER {
            add(&mut self.scatter, &run.scatter);
        }
    }
}

/// τ along a run, and how long it is.
#[derive(Clone, Copy)]
struct Path {
    coefficients: [f32; 3],
    length: f32,
}

impl OfRing {
    /// Sums over a run, which begins `before` lanes into its first block.
    #[inline(always)]
    fn sums<const SCATTER: bool>(
        &self,
        path: Path,
        before: usize,
        value: &[Lanes],
        variance: &[Lanes],
        far: f32,
    ) -> Sums<f32> {
        let mut number: Lanes = from_fn(|i| i as f32 - before as f32);
        let mut sums = Sums::default();
        for (value, variance) in value.iter().zip(variance) {
            self.add::<SCATTER>(path, &number, value, variance, far, &mut sums);
            number = number.map(|number| number + LANES as f32);
        }
        sums
    }

    /// Adds the pixels of all lanes, each with its number in the run.
    ///
    /// One whole block after the other, which the compiler makes one instruction each.
    #[inline(always)]
    fn add<const SCATTER: bool>(
        &self,
        path: Path,
        number: &Lanes,
        value: &Lanes,
        variance: &Lanes,
        far: f32,
        sums: &mut Sums<f32>,
    ) {
        let [start, linear, quadratic] = path.coefficients;
        let [c0, c1, c2, c3] = self.cubic;
        let tau: Lanes = from_fn(|i| start + number[i] * (linear + quadratic * number[i]));
        let curve: Lanes = from_fn(|i| c0 + tau[i] * (c1 + tau[i] * (c2 + tau[i] * c3)));
        let residual: Lanes = from_fn(|i| value[i] - curve[i]);
        // Compared as squares: a root costs more than all the rest. No number is near to nothing.
        let beyond: Lanes = from_fn(|i| residual[i].abs() - self.slack);
        let within: Lanes = from_fn(|i| self.relative_square * variance[i]);
        let inside: Mask = from_fn(|i| {
            mask(number[i] >= 0.0) & mask(number[i] < path.length) & mask(!value[i].is_nan())
        });
        let measured: Mask = from_fn(|i| inside[i] & mask(variance[i] < f32::INFINITY));
        let good: Mask = from_fn(|i| {
            measured[i] & (mask(beyond[i] <= 0.0) | mask(beyond[i] * beyond[i] <= within[i]))
        });
        let tau = masked(&good, &tau);
        let square: Lanes = from_fn(|i| tau[i] * tau[i]);
        let cube: Lanes = from_fn(|i| square[i] * tau[i]);
        add(&mut sums.inside, &masked(&inside, &[1.0; LANES]));
        add(&mut sums.measured, &masked(&measured, &[1.0; LANES]));
        add(&mut sums.count, &masked(&good, &[1.0; LANES]));
        add(&mut sums.residual, &masked(&good, &residual));
        add(&mut sums.variance, &masked(&good, variance));
        for (sum, power) in sums.tau.iter_mut().zip([&tau, &square, &cube]) {
            add(sum, power);
        }
        if SCATTER {
            let z: Lanes = from_fn(|i| score(residual[i], variance[i], far));
            add(&mut sums.scatter, &masked(&measured, &z));
        }
    }
}

/// All ones where a lane counts, or 0.
type Mask = [u32; LANES];

/// `terms`, or 0 where the mask says so.
#[inline(always)]
fn masked(mask: &Mask, terms: &Lanes) -> Lanes {
    from_fn(|i| f32::from_bits(terms[i].to_bits() & mask[i]))
}

#[inline(always)]
fn add(to: &mut Lanes, terms: &Lanes) {
    for (to, term) in to.iter_mut().zip(terms) {
        *to += term;
    }
}

/// |residual|/u, at most `far`.
#[inline(always)]
fn score(residual: f32, variance: f32, far: f32) -> f32 {
    let z = residual.abs() / variance.sqrt().max(f32::MIN_POSITIVE);
    if z < far { z } else { far }
}

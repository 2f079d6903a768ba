//! One pass over a picture of equal squares, eight pixels at a time: the fast form of what
//! [`crate::survey`] does pixel by pixel where they are not.

use crate::curve::Curve;
use crate::rings::{Rings, Run};
use crate::survey::Limit;
use physics::ChannelMap;
use pulp::NullaryFnOnce;
use rayon::prelude::*;
use std::ops::Range;

/// Pixels that are handled at once, and groups into which the pixels of a ring fall.
pub(crate) const LANES: usize = 8;

/// Rows that one thread takes at once. Within them sums are kept in single precision: a lane adds
/// up at most a few thousand pixels of a ring there.
const BLOCK_ROWS: usize = 64;

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
struct Sums<T> {
    /// Pixels that a measured picture would have; a value that is no number is none.
    inside: [T; LANES],
    /// Those of them that were not measured, and those that were and were not let through.
    unmeasured: [T; LANES],
    rejected: [T; LANES],
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
        self.inside() - self.0.unmeasured.iter().sum::<f64>()
    }

    pub(crate) fn count(&self) -> f64 {
        self.measured() - self.0.rejected.iter().sum::<f64>()
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
    pub(crate) fn groups(&self) -> [(f64, f64); LANES] {
        let Sums {
            inside,
            unmeasured,
            rejected,
            residual,
            ..
        } = &self.0;
        std::array::from_fn(|lane| {
            let count = inside[lane] - unmeasured[lane] - rejected[lane];
            (count, residual[lane])
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
        add(&mut to.unmeasured, &from.unmeasured);
        add(&mut to.rejected, &from.rejected);
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
        let reach: [usize; MOST_STEP] = std::array::from_fn(reach);
        let (_, height) = self.size;
        let blocks: Vec<Vec<Sums<f32>>> = (0..height.div_ceil(BLOCK_ROWS))
            .into_par_iter()
            .map(|block| {
                let first = block * BLOCK_ROWS;
                pulp::Arch::new().dispatch(Block {
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

impl NullaryFnOnce for Block<'_, '_> {
    type Output = Vec<Sums<f32>>;

    #[inline(always)]
    fn call(self) -> Vec<Sums<f32>> {
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
        let begin = run.pixels.start / LANES * LANES;
        let number = |at: usize| (at as i64 - run.pixels.start as i64) as f32;
        // Most runs have nothing to leave out.
        let mut whole = Sums::default();
        let mut lost = [0_u32; LANES];
        for at in (begin..run.pixels.end).step_by(LANES) {
            let pixels = self.pixels(at);
            ring.add_whole::<SCATTER>(path, number(at), &pixels, far, &mut whole, &mut lost);
        }
        if lost.iter().fold(0, |any, lost| any | lost) == 0 {
            tally.add_whole::<SCATTER>(&whole);
            return;
        }
        for at in (begin..run.pixels.end).step_by(LANES) {
            let pixels = self.pixels(at);
            ring.add::<SCATTER>(path, number(at), &pixels, far, tally);
        }
    }

    /// Value and variance of eight pixels from number `at` on.
    #[inline(always)]
    fn pixels(&self, at: usize) -> [[f32; LANES]; 2] {
        let (values, variances) = (&self.channel.value[at..], &self.channel.variance[at..]);
        match (
            values.first_chunk::<LANES>(),
            variances.first_chunk::<LANES>(),
        ) {
            (Some(value), Some(variance)) => [*value, *variance],
            _ => {
                let mut padded = [[0.0; LANES], [f32::INFINITY; LANES]];
                padded[0][..values.len()].copy_from_slice(values);
                padded[1][..values.len()].copy_from_slice(variances);
                padded
            }
        }
    }
}

impl Sums<f32> {
    /// Adds those of a run that lost nothing.
    #[inline(always)]
    fn add_whole<const SCATTER: bool>(&mut self, run: &Self) {
        let add = |to: &mut [f32; LANES], from: &[f32; LANES]| {
            for (to, from) in to.iter_mut().zip(from) {
                *to += from;
            }
        };
        add(&mut self.inside, &run.inside);
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

/// What is known of a pixel.
struct Judged {
    tau: f32,
    residual: f32,
    in_run: bool,
    measured: bool,
    near: bool,
}

impl OfRing {
    /// The pixel that is number `number` of its run.
    #[inline(always)]
    fn judge(&self, path: Path, number: f32, value: f32, variance: f32) -> Judged {
        let [start, linear, quadratic] = path.coefficients;
        let [c0, c1, c2, c3] = self.cubic;
        let tau = start + number * (linear + quadratic * number);
        let residual = value - (c0 + tau * (c1 + tau * (c2 + tau * c3)));
        // Compared as squares: a root costs more than all the rest. No number is near to nothing.
        let beyond = residual.abs() - self.slack;
        Judged {
            tau,
            residual,
            in_run: (number >= 0.0) & (number < path.length),
            measured: variance < f32::INFINITY,
            near: (beyond <= 0.0) | (beyond * beyond <= self.relative_square * variance),
        }
    }

    /// Adds eight pixels, the first of which is number `first` of its run, as if none had to be left
    /// out; where one has, its lane of `lost` is not 0 any more.
    #[inline(always)]
    fn add_whole<const SCATTER: bool>(
        &self,
        path: Path,
        first: f32,
        [value, variance]: &[[f32; LANES]; 2],
        far: f32,
        sums: &mut Sums<f32>,
        lost: &mut [u32; LANES],
    ) {
        for lane in 0..LANES {
            let pixel = self.judge(path, first + lane as f32, value[lane], variance[lane]);
            let Judged { tau, residual, .. } = pixel;
            let in_run = pixel.in_run;
            lost[lane] |= u32::from(in_run & !(pixel.measured & pixel.near));
            sums.inside[lane] += if in_run { 1.0 } else { 0.0 };
            sums.residual[lane] += if in_run { residual } else { 0.0 };
            sums.variance[lane] += if in_run { variance[lane] } else { 0.0 };
            let tau = if in_run { tau } else { 0.0 };
            sums.tau[0][lane] += tau;
            sums.tau[1][lane] += tau * tau;
            sums.tau[2][lane] += tau * tau * tau;
            if SCATTER {
                let z = score(residual, variance[lane], far);
                sums.scatter[lane] += if in_run { z } else { 0.0 };
            }
        }
    }

    /// Adds eight pixels, the first of which is number `first` of its run.
    #[inline(always)]
    fn add<const SCATTER: bool>(
        &self,
        path: Path,
        first: f32,
        [value, variance]: &[[f32; LANES]; 2],
        far: f32,
        sums: &mut Sums<f32>,
    ) {
        for lane in 0..LANES {
            let pixel = self.judge(path, first + lane as f32, value[lane], variance[lane]);
            let Judged { tau, residual, .. } = pixel;
            let inside = pixel.in_run & !value[lane].is_nan();
            let measured = inside & pixel.measured;
            let good = measured & pixel.near;
            sums.inside[lane] += if inside { 1.0 } else { 0.0 };
            sums.unmeasured[lane] += if inside & !measured { 1.0 } else { 0.0 };
            sums.rejected[lane] += if measured & !good { 1.0 } else { 0.0 };
            sums.residual[lane] += if good { residual } else { 0.0 };
            sums.variance[lane] += if good { variance[lane] } else { 0.0 };
            let tau = if good { tau } else { 0.0 };
            sums.tau[0][lane] += tau;
            sums.tau[1][lane] += tau * tau;
            sums.tau[2][lane] += tau * tau * tau;
            if SCATTER {
                let z = score(residual, variance[lane], far);
                sums.scatter[lane] += if measured { z } else { 0.0 };
            }
        }
    }
}

/// |residual|/u, at most `far`.
#[inline(always)]
fn score(residual: f32, variance: f32, far: f32) -> f32 {
    let z = residual.abs() / variance.sqrt().max(f32::MIN_POSITIVE);
    if z < far { z } else { far }
}

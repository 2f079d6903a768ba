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
const ENOUGH: f64 = 40_000.0;

/// One row in so many is looked at where a ring has more than enough.
const STEP: usize = 4;

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
    measured: [T; LANES],
    /// What follows is of the pixels that were let through, but for the scatter.
    count: [T; LANES],
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
    pub(crate) fn groups(&self) -> [(f64, f64); LANES] {
        std::array::from_fn(|lane| (self.0.count[lane], self.0.residual[lane]))
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
    relative: f32,
    slack: f32,
}

impl Sweep<'_> {
    /// The sums over each ring.
    pub(crate) fn tallies(&self) -> Vec<Tally> {
        let of_rings: Vec<OfRing> = (0..self.rings.len())
            .map(|ring| self.of_ring(ring))
            .collect();
        // The first ring that has more than enough pixels.
        let many = (0..self.rings.len())
            .find(|ring| self.thinned && self.rings.area(*ring) > ENOUGH)
            .unwrap_or(self.rings.len());
        let (_, height) = self.size;
        let blocks: Vec<Vec<Sums<f32>>> = (0..height.div_ceil(BLOCK_ROWS))
            .into_par_iter()
            .map(|block| {
                let first = block * BLOCK_ROWS;
                pulp::Arch::new().dispatch(Block {
                    sweep: self,
                    of_rings: &of_rings,
                    rows: first..(first + BLOCK_ROWS).min(height),
                    many,
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
            relative: limit.map_or(0.0, |limit| limit.relative as f32),
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
    /// Rings from here on are looked at in one row of [`STEP`] alone.
    many: usize,
}

impl NullaryFnOnce for Block<'_, '_> {
    type Output = Vec<Sums<f32>>;

    #[inline(always)]
    fn call(self) -> Vec<Sums<f32>> {
        let Self {
            sweep,
            of_rings,
            rows,
            many,
        } = self;
        let mut tallies = vec![Sums::default(); of_rings.len()];
        for y in rows {
            let rings = if y % STEP == 0 { of_rings.len() } else { many };
            let visit = |run: &Run| {
                let tally = &mut tallies[run.ring];
                match sweep.far {
                    Some(far) => sweep.add::<true>(&of_rings[run.ring], run, far as f32, tally),
                    None => sweep.add::<false>(&of_rings[run.ring], run, 0.0, tally),
                }
            };
            sweep
                .rings
                .for_each_run_of_row(sweep.size.0, sweep.center, y, rings, visit);
        }
        tallies
    }
}

impl Sweep<'_> {
    /// Adds the pixels of a run.
    #[inline(always)]
    fn add<const SCATTER: bool>(&self, ring: &OfRing, run: &Run, far: f32, tally: &mut Sums<f32>) {
        let (values, variances) = (&self.channel.value, &self.channel.variance);
        // τ is a quadratic in the number of the pixel in its run.
        let square = run.dx * run.dx + run.dy * run.dy;
        let start = ((square - ring.middle) * ring.per_half) as f32;
        let linear = (2.0 * run.dx * ring.per_half) as f32;
        let quadratic = ring.per_half as f32;
        let length = run.pixels.len() as f32;
        let mut sums = *tally;
        // Lanes keep to columns of the picture, so that a run's ends are cut off by number.
        let mut at = run.pixels.start / LANES * LANES;
        while at < run.pixels.end {
            let mut padded = ([0.0; LANES], [f32::INFINITY; LANES]);
            let (value, variance) = match (
                values[at..].first_chunk::<LANES>(),
                variances[at..].first_chunk::<LANES>(),
            ) {
                (Some(value), Some(variance)) => (value, variance),
                _ => {
                    let rest = values.len() - at;
                    padded.0[..rest].copy_from_slice(&values[at..]);
                    padded.1[..rest].copy_from_slice(&variances[at..]);
                    (&padded.0, &padded.1)
                }
            };
            // Below 0 where the lanes begin to the left of the run.
            let first = (at as i64 - run.pixels.start as i64) as f32;
            ring.add::<SCATTER>(
                [start, linear, quadratic],
                [first, length],
                value,
                variance,
                far,
                &mut sums,
            );
            at += LANES;
        }
        *tally = sums;
    }
}

impl OfRing {
    /// Adds eight pixels, the first of which is number `first` of its run of `length`.
    #[inline(always)]
    fn add<const SCATTER: bool>(
        &self,
        [start, linear, quadratic]: [f32; 3],
        [first, length]: [f32; 2],
        value: &[f32; LANES],
        variance: &[f32; LANES],
        far: f32,
        sums: &mut Sums<f32>,
    ) {
        let [c0, c1, c2, c3] = self.cubic;
        for lane in 0..LANES {
            let number = first + lane as f32;
            let tau = start + number * (linear + quadratic * number);
            let residual = value[lane] - (c0 + tau * (c1 + tau * (c2 + tau * c3)));
            let inside = (number >= 0.0) & (number < length) & !value[lane].is_nan();
            let measured = inside & (variance[lane] < f32::INFINITY);
            let u = variance[lane].sqrt();
            let near = residual.abs() <= self.relative * u + self.slack;
            let good = measured & near;
            sums.inside[lane] += if inside { 1.0 } else { 0.0 };
            sums.measured[lane] += if measured { 1.0 } else { 0.0 };
            sums.count[lane] += if good { 1.0 } else { 0.0 };
            sums.residual[lane] += if good { residual } else { 0.0 };
            sums.variance[lane] += if good { variance[lane] } else { 0.0 };
            let tau = if good { tau } else { 0.0 };
            sums.tau[0][lane] += tau;
            sums.tau[1][lane] += tau * tau;
            sums.tau[2][lane] += tau * tau * tau;
            if SCATTER {
                let z = residual.abs() / u.max(f32::MIN_POSITIVE);
                let z = if z < far { z } else { far };
                sums.scatter[lane] += if measured { z } else { 0.0 };
            }
        }
    }
}

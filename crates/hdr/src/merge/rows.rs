//! One frame into the sums, row by row.

use super::sets::Tables;
use crate::dark::DarkFrame;
use crate::lanes::{largest_of, largest_sample};
use physics::Samples;
use pulp::NullaryFnOnce;
use std::ops::Range;

/// Samples of a row that are handled together where they belong to one set, as most do: as many as
/// a number has bits.
pub(super) const CHUNK: usize = u64::BITS as usize;

/// What the samples of a chunk have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Common {
    /// The set that all of them belong to; `None` where each has a number of its own.
    pub(super) set: Option<u16>,
    /// The largest of their estimates, DN/s, none below 0.
    pub(super) most: f32,
}

impl Common {
    /// Before the first frame.
    pub(super) const EMPTY: Self = Self {
        set: Some(0),
        most: 0.0,
    };
}

/// How samples of one channel lie in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    /// Samples in a row.
    pub(super) row: usize,
    /// Interleaved channels.
    pub(super) channels: usize,
    /// From one sample to the next of its channel in the row.
    pub(super) right: usize,
    /// From one row to the next that has the same channels.
    pub(super) down: usize,
}

/// What all rows of a frame share.
pub(super) struct Step<'a> {
    pub(super) layout: Layout,
    pub(super) samples: &'a Samples,
    pub(super) dark: &'a DarkFrame,
    pub(super) tables: &'a Tables,
    /// Exposure, s.
    pub(super) exposure: f32,
    /// Samples from here on are saturated, DN.
    pub(super) white: f32,
    /// The most that the neighbours may let expect of a sample, DN.
    pub(super) neighbours_limit: f32,
    /// The most that a sample's own estimate may.
    pub(super) own_limit: f32,
    /// Mean dark from which a sample of each channel is warm, DN.
    pub(super) warm: &'a [f32],
}

/// Sums and sets of some rows, before a frame or after it.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    pub(super) sum: &'a [f32],
    /// Of samples that have a number of their own.
    pub(super) set: &'a [u16],
    pub(super) common: &'a [Common],
}

impl<'a> Rows<'a> {
    /// Row `number`, of `length` samples, where there is one.
    #[inline(always)]
    fn row(self, number: usize, length: usize) -> Option<Self> {
        let at = number * length..(number + 1) * length;
        let chunks = length.div_ceil(CHUNK);
        Some(Self {
            sum: self.sum.get(at.clone())?,
            set: self.set.get(at)?,
            common: &self.common[number * chunks..(number + 1) * chunks],
        })
    }

    /// Calls `each` with the sums, the sets of their own and the common set of each part of a chunk in
    /// `range` of the row.
    #[inline(always)]
    fn parts(self, range: Range<usize>, mut each: impl FnMut(&[f32], &[u16], Option<u16>)) {
        let mut start = range.start;
        while start < range.end {
            let chunk = start / CHUNK;
            let end = ((chunk + 1) * CHUNK).min(range.end);
            let set = self.common[chunk].set;
            each(&self.sum[start..end], &self.set[start..end], set);
            start = end;
        }
    }
}

/// What a block of rows says of a frame.
pub(super) struct Outcome {
    /// Samples used, per channel.
    pub(super) used: Vec<u64>,
    /// Samples of each set afterwards.
    pub(super) of_set: Vec<u64>,
    /// Samples with a warm dark: where in the frame, and its level, DN.
    pub(super) warm: Vec<(usize, f32)>,
}

/// A block of rows, to be compiled for the instructions that there are. Each operation stands
/// alone and in the same order whichever they are, so that the bytes are the same.
pub(super) struct Block<'s, 'a> {
    pub(super) step: &'s Step<'a>,
    /// Number of the first row.
    pub(super) first: usize,
    pub(super) sum: &'s mut [f32],
    pub(super) set: &'s mut [u16],
    pub(super) common: &'s mut [Common],
    /// The `down` rows above the block as they were before this frame; none at the top.
    pub(super) above: Option<Rows<'s>>,
    /// Those below it; fewer or none at the bottom.
    pub(super) below: Option<Rows<'s>>,
}

/// What is known of three rows without a look at each of their samples, chunk by chunk.
struct Bounds {
    /// The largest estimate, DN/s, none below 0.
    estimate: Vec<f32>,
    /// The largest sample, DN, none below 0.
    sample: Vec<f32>,
}

/// Three rows over the reach of a chunk: from the left neighbour of its first sample to the right
/// one of its last. What lies outside the frame is empty and dark.
struct Reach {
    /// Estimates, DN/s.
    value: [Vec<f32>; 3],
    /// Whether there are any, 1 or 0.
    present: [Vec<f32>; 3],
    /// Samples of the frame, DN.
    seen: [Vec<f32>; 3],
    /// Over the three rows: sums of estimates and of whether there are any, and the largest sample.
    column: [Vec<f32>; 3],
}

impl NullaryFnOnce for Block<'_, '_> {
    type Output = Outcome;

    #[inline(always)]
    fn call(mut self) -> Outcome {
        let Layout {
            row,
            channels,
            right,
            down,
        } = self.step.layout;
        let count = self.sum.len() / row;
        let chunks = row.div_ceil(CHUNK);
        let mut outcome = Outcome {
            used: vec![0; channels],
            of_set: vec![0; self.step.tables.len()],
            warm: vec![],
        };
        // The largest sample of each chunk, DN, in rows y − down to y + down, row y at y mod their
        // number.
        let around = 2 * down + 1;
        let mut largest = vec![vec![0.0; chunks]; around];
        for ahead in 0..2 * down {
            self.find_largest(ahead, &mut largest[ahead % around]);
        }
        let mut bounds = Bounds {
            estimate: vec![0.0; chunks],
            sample: vec![0.0; chunks],
        };
        // Which samples count, a bit each, of the rows that wait to be added: those below still ask what
        // they were before.
        let mut weights = vec![vec![0_u64; chunks]; down + 1];
        let wide = || [(); 3].map(|()| vec![0.0; CHUNK + 2 * right]);
        let mut reach = Reach {
            value: wide(),
            present: wide(),
            seen: wide(),
            column: wide(),
        };
        for y in 0..count + down {
            if y < count {
                let next = y + 2 * down;
                self.find_largest(next, &mut largest[next % around]);
                let three = [y, y + down, next];
                let samples = three.map(|row| largest[row % around].as_slice());
                bounds.of_rows(three.map(|row| self.before(row)), samples);
                let weight = &mut weights[y % (down + 1)];
                self.weigh(y, &bounds, &mut reach, weight, &mut outcome.warm);
            }
            if let Some(done) = y.checked_sub(down) {
                self.add(done, &weights[done % (down + 1)], &mut outcome);
            }
        }
        outcome
    }
}

impl Bounds {
    /// Those of three rows, one of which may not be there, with the largest samples of each.
    #[inline(always)]
    fn of_rows(&mut self, rows: [Option<Rows<'_>>; 3], [a, b, c]: [&[f32]; 3]) {
        for (i, sample) in self.sample.iter_mut().enumerate() {
            let two = if a[i] > b[i] { a[i] } else { b[i] };
            *sample = if c[i] > two { c[i] } else { two };
        }
        self.estimate.fill(0.0);
        for row in rows.into_iter().flatten() {
            for (estimate, common) in self.estimate.iter_mut().zip(row.common) {
                let most = common.most;
                *estimate = if most > *estimate { most } else { *estimate };
            }
        }
    }

    /// The largest estimate and sample of a chunk and those beside it.
    #[inline(always)]
    fn about(&self, chunk: usize) -> [f32; 2] {
        let beside = chunk.saturating_sub(1)..(chunk + 2).min(self.sample.len());
        [&self.estimate, &self.sample].map(|of| {
            let chunks = of[beside.clone()].iter();
            chunks.fold(0.0, |most, value| if *value > most { *value } else { most })
        })
    }
}

/// The number that all of `set` are, if they are.
#[inline(always)]
fn only(set: &[u16]) -> Option<u16> {
    let first = set[0];
    let differs = set.iter().fold(0, |all, number| all | (number ^ first));
    (differs == 0).then_some(first)
}

/// Bits of the first `n` samples of a chunk.
#[inline(always)]
fn all_of(n: usize) -> u64 {
    u64::MAX >> (CHUNK - n)
}

impl Block<'_, '_> {
    /// Sums and sets, before this frame, of the row that is number `ahead` from the first of those
    /// above the block, where it has one.
    #[inline(always)]
    fn before(&self, ahead: usize) -> Option<Rows<'_>> {
        let Layout { row, down, .. } = self.step.layout;
        let count = self.sum.len() / row;
        match ahead.checked_sub(down) {
            None => {
                let above = self.above?;
                above.row((ahead + above.sum.len() / row).checked_sub(down)?, row)
            }
            Some(y) if y < count => {
                let own = Rows {
                    sum: self.sum,
                    set: self.set,
                    common: self.common,
                };
                own.row(y, row)
            }
            Some(y) => self.below?.row(y - count, row),
        }
    }

    /// Where the samples of the row that is number `ahead` from `down` rows above the block begin,
    /// where there is such a row.
    #[inline(always)]
    fn start(&self, ahead: usize) -> Option<usize> {
        let Layout { row, down, .. } = self.step.layout;
        let start = (self.first + ahead).checked_sub(down)? * row;
        (start + row <= self.step.samples.len()).then_some(start)
    }

    /// The largest sample of each chunk of the row that is number `ahead` from `down` rows above the
    /// block, DN, none below 0.
    #[inline(always)]
    fn find_largest(&self, ahead: usize, into: &mut [f32]) {
        match self.start(ahead) {
            Some(first) => {
                let row = self.step.layout.row;
                for (largest, start) in into.iter_mut().zip((0..row).step_by(CHUNK)) {
                    let end = (start + CHUNK).min(row);
                    *largest = largest_sample(self.step.samples, first + start..first + end);
                }
            }
            None => into.fill(0.0),
        }
    }

    /// Which samples of row `y` of the block count, a bit each into `weight`, and which are warm.
    ///
    /// The mean of a sample's eight neighbours predicts it, and its own estimate is left out on
    /// purpose. A frame is dropped where its prediction is too bright; were the pixel's own noise
    /// part of the prediction, a frame would be dropped more often where the sum so far is too
    /// high, and the merged value would keep that error: a bias of 0.2 standard deviations,
    /// permilles, wherever the radiance is near the limit.
    ///
    /// A saturated sample may have lost charge to its neighbours (blooming): they do not count
    /// either.
    #[inline(always)]
    fn weigh(
        &self,
        y: usize,
        bounds: &Bounds,
        reach: &mut Reach,
        weight: &mut [u64],
        warm: &mut Vec<(usize, f32)>,
    ) {
        let step = self.step;
        let Layout { row, channels, .. } = step.layout;
        let first = (self.first + y) * row;
        let least_warm = step.warm.iter().copied().fold(f32::INFINITY, f32::min);
        for (chunk, weight) in weight.iter_mut().enumerate() {
            let start = chunk * CHUNK;
            let end = (start + CHUNK).min(row);
            let dark_most = step.dark.largest_mean(first + start..first + end);
            if dark_most > least_warm {
                let mut dark = [0.0; CHUNK];
                let dark = &mut dark[..end - start];
                step.dark.copy_mean_to(first + start..first + end, dark);
                for (at, level) in (first + start..).zip(dark) {
                    if *level > least_warm && *level > step.warm[at % channels] {
                        warm.push((at, *level));
                    }
                }
            }
            // Most of a picture is far below the limit in most frames, and then no mean of
            // neighbours can be above it.
            let [brightest, largest] = bounds.about(chunk);
            // What a rounding may be off counts for the limit.
            let most = 1.000_01 * brightest * step.exposure + dark_most;
            *weight = if most <= 0.999_99 * step.neighbours_limit && largest < step.white {
                all_of(end - start)
            } else {
                self.weigh_each(y, start..end, reach)
            };
        }
    }

    /// The same for the samples of one chunk, one by one.
    #[inline(always)]
    fn weigh_each(&self, y: usize, chunk: Range<usize>, reach: &mut Reach) -> u64 {
        let step = self.step;
        let Layout {
            row, right, down, ..
        } = step.layout;
        let n = chunk.len();
        let wide = n + 2 * right;
        // The part of the reach that lies inside the frame, and where it begins in the reach.
        let inside = chunk.start.saturating_sub(right)..(chunk.end + right).min(row);
        let margin = right - (chunk.start - inside.start);
        let filled = margin..margin + inside.len();
        for (k, ahead) in [y, y + down, y + 2 * down].into_iter().enumerate() {
            let (value, present) = (&mut reach.value[k][..wide], &mut reach.present[k][..wide]);
            value.fill(0.0);
            present.fill(0.0);
            if let Some(rows) = self.before(ahead) {
                let mut at = filled.start;
                rows.parts(inside.clone(), |sums, sets, common| {
                    let value = &mut value[at..at + sums.len()];
                    let present = &mut present[at..at + sums.len()];
                    at += sums.len();
                    let per_time = |set: u16| step.tables.per_time[usize::from(set)];
                    if let Some(set) = common {
                        let per_time = per_time(set);
                        for (value, sum) in value.iter_mut().zip(sums) {
                            *value = sum * per_time;
                        }
                        present.fill(if per_time > 0.0 { 1.0 } else { 0.0 });
                        return;
                    }
                    let targets = value.iter_mut().zip(present);
                    for ((value, present), (sum, set)) in targets.zip(sums.iter().zip(sets)) {
                        let per_time = per_time(*set);
                        *value = sum * per_time;
                        *present = if per_time > 0.0 { 1.0 } else { 0.0 };
                    }
                });
            }
            let seen = &mut reach.seen[k][..wide];
            seen.fill(0.0);
            if let Some(start) = self.start(ahead) {
                let here = start + inside.start..start + inside.end;
                step.samples.copy_to(here, &mut seen[filled.clone()]);
            }
        }
        let [e, p, full] = reach.column.each_mut().map(|column| &mut column[..wide]);
        let [a, b, c] = reach.value.each_ref().map(|row| &row[..wide]);
        for (i, sum) in e.iter_mut().enumerate() {
            *sum = a[i] + b[i] + c[i];
        }
        let own = &b[right..];
        let [a, b, c] = reach.present.each_ref().map(|row| &row[..wide]);
        for (i, sum) in p.iter_mut().enumerate() {
            *sum = a[i] + b[i] + c[i];
        }
        let own_present = &b[right..];
        let [a, b, c] = reach.seen.each_ref().map(|row| &row[..wide]);
        for (i, most) in full.iter_mut().enumerate() {
            let above = if a[i] > b[i] { a[i] } else { b[i] };
            *most = if c[i] > above { c[i] } else { above };
        }
        let (f1, f2) = (&full[right..], &full[2 * right..]);
        let (e1, e2) = (&e[right..], &e[2 * right..]);
        let (p1, p2) = (&p[right..], &p[2 * right..]);
        let mut dark = [0.0; CHUNK];
        let here = (self.first + y) * row;
        let dark = &mut dark[..n];
        step.dark
            .copy_mean_to(here + chunk.start..here + chunk.end, dark);
        let mut good = [0_u8; CHUNK];
        for i in 0..n {
            let sum = e[i] + e1[i] + e2[i] - own[i];
            let count = (p[i] + p1[i] + p2[i] - own_present[i]).max(1.0);
            let room = step.neighbours_limit - dark[i];
            let counts = (full[i] < step.white)
                & (f1[i] < step.white)
                & (f2[i] < step.white)
                & (sum * step.exposure <= room * count)
                & (own[i] * step.exposure <= step.own_limit - dark[i]);
            good[i] = u8::from(counts);
        }
        (good.iter().enumerate()).fold(0, |bits, (i, good)| bits | u64::from(*good) << i)
    }

    /// Adds the samples of row `y` of the block that count, and moves them to their next set.
    #[inline(always)]
    fn add(&mut self, y: usize, weight: &[u64], outcome: &mut Outcome) {
        let step = self.step;
        let Layout { row, channels, .. } = step.layout;
        let first = (self.first + y) * row;
        let with_frame = &step.tables.with_frame;
        let per_time = &step.tables.per_time;
        let sums = self.sum[y * row..(y + 1) * row].chunks_mut(CHUNK);
        let sets = self.set[y * row..(y + 1) * row].chunks_mut(CHUNK);
        let chunks = weight.len();
        let commons = &mut self.common[y * chunks..(y + 1) * chunks];
        let rows = sums.zip(sets).zip(commons);
        for ((chunk, weight), ((sum, set), common)) in weight.iter().enumerate().zip(rows) {
            let start = first + chunk * CHUNK;
            let n = sum.len();
            let mut weight = *weight;
            let one = common.set.map(|one| (one, with_frame[usize::from(one)]));
            match one {
                Some((one, next)) if weight == all_of(n) && next != one => {
                    common.set = Some(next);
                    outcome.of_set[usize::from(next)] += n as u64;
                }
                Some((one, _)) if weight == 0 => outcome.of_set[usize::from(one)] += n as u64,
                _ => {
                    if let Some((one, _)) = one {
                        set.fill(one);
                    }
                    for (i, number) in set.iter_mut().enumerate() {
                        let next = with_frame[usize::from(*number)];
                        // A set that is its own successor takes no more frames.
                        if next == *number {
                            weight &= !(1 << i);
                        } else if weight >> i & 1 == 1 {
                            *number = next;
                        }
                        outcome.of_set[usize::from(*number)] += 1;
                    }
                    common.set = only(set);
                }
            }
            if weight == 0 {
                continue;
            }
            step.add_net(start..start + n, weight, sum);
            common.most = match common.set {
                Some(set) => largest_of(sum) * per_time[usize::from(set)],
                None => sum.iter().zip(&*set).fold(0.0, |most: f32, (sum, set)| {
                    most.max(sum * per_time[usize::from(*set)])
                }),
            };
            if let [used] = outcome.used.as_mut_slice() {
                *used += u64::from(weight.count_ones());
            } else if weight == all_of(n) {
                for (channel, used) in outcome.used.iter_mut().enumerate() {
                    let ahead = (channel + channels - start % channels) % channels;
                    *used += n.saturating_sub(ahead).div_ceil(channels) as u64;
                }
            } else {
                for i in (0..n).filter(|i| weight >> i & 1 == 1) {
                    outcome.used[(start + i) % channels] += 1;
                }
            }
        }
    }
}

impl Step<'_> {
    /// Adds the samples of `range` less their darks to `sum`, those that have a bit in `weight`.
    #[inline(always)]
    fn add_net(&self, range: Range<usize>, weight: u64, sum: &mut [f32]) {
        let n = range.len();
        let whole = weight == all_of(n);
        if let (true, Samples::U16(samples), Some(darks)) = (whole, self.samples, self.dark.one()) {
            // The difference of whole numbers is exact either way.
            let nets = samples[range.clone()].iter().zip(&darks[range]);
            for (sum, (sample, dark)) in sum.iter_mut().zip(nets) {
                *sum += (i32::from(*sample) - i32::from(*dark)) as f32;
            }
            return;
        }
        let (mut samples, mut darks) = ([0.0; CHUNK], [0.0; CHUNK]);
        self.samples.copy_to(range.clone(), &mut samples[..n]);
        self.dark.copy_mean_to(range, &mut darks[..n]);
        for (i, sum) in sum.iter_mut().enumerate() {
            // A sample that does not count may be no number.
            *sum += if weight >> i & 1 == 1 {
                samples[i] - darks[i]
            } else {
                0.0
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::merge::sets::{Set, Sets};
    use physics::Frame;

    /// What the neighbours of each sample let expect, the definition: the mean over those of its
    /// channel that were measured.
    fn expected(layout: Layout, height: usize, estimates: &[Option<f32>]) -> Vec<f32> {
        let columns = layout.row / layout.right;
        let mut all = vec![];
        for y in 0..height {
            for x in 0..layout.row {
                let (column, channel) = (x / layout.right, x % layout.right);
                let (mut sum, mut count) = (0.0, 0.0);
                for dy in [-1, 0, 1] {
                    for dx in [-1_isize, 0, 1] {
                        let v = y as isize + dy * layout.down as isize;
                        let u = column as isize + dx;
                        let inside =
                            (0..height as isize).contains(&v) && (0..columns as isize).contains(&u);
                        if (dx, dy) == (0, 0) || !inside {
                            continue;
                        }
                        let at = v as usize * layout.row + u as usize * layout.right + channel;
                        if let Some(value) = estimates[at] {
                            sum += value;
                            count += 1.0;
                        }
                    }
                }
                all.push(if count > 0.0 { sum / count } else { 0.0 });
            }
        }
        all
    }

    /// Which samples, `i % 900` at place `i`, are or touch one of their channel of at least `white`.
    fn near_saturated(layout: Layout, height: usize, white: f32) -> Vec<bool> {
        let columns = (layout.row / layout.right) as isize;
        let near = |i: usize| {
            let (y, x) = (i / layout.row, i % layout.row);
            let (column, channel) = ((x / layout.right) as isize, x % layout.right);
            (-1..=1).any(|dy| {
                (-1..=1).any(|dx| {
                    let (v, u) = (y as isize + dy * layout.down as isize, column + dx);
                    let inside = (0..height as isize).contains(&v) && (0..columns).contains(&u);
                    let at = || v as usize * layout.row + u as usize * layout.right + channel;
                    inside && (at() % 900) as f32 >= white
                })
            })
        };
        (0..layout.row * height).map(near).collect()
    }

    #[test]
    fn neighbours_decide_and_blocks_do_not_matter() {
        // Three channels side by side, and a mosaic whose colours repeat after two rows.
        for (channels, right, down) in [(1, 1, 1), (3, 3, 1), (1, 2, 2)] {
            let (width, height) = (84 / channels, 23);
            let layout = Layout {
                row: 84,
                channels,
                right,
                down,
            };
            let n = 84 * height;
            let mut sets = Sets::new();
            sets.extend(&Set {
                time: 0.5,
                ..Set::default()
            });
            // One sample in eleven was not measured yet.
            let set: Vec<u16> = (0..n).map(|i| u16::from(i % 11 != 3)).collect();
            let sum: Vec<f32> = (0..n)
                .map(|i| {
                    if set[i] == 0 {
                        0.0
                    } else {
                        ((i * 37) % 101) as f32
                    }
                })
                .collect();
            let tables = sets.extend(&Set {
                time: 1.0,
                ..Set::default()
            });
            let samples: Samples = (0..n).map(|i| (i % 900) as u16).collect::<Vec<_>>().into();
            let frame = Frame {
                width,
                height,
                channels,
                samples: vec![7; n].into(),
            };
            let dark = DarkFrame::new(&frame, 1.0).unwrap();
            let step = Step {
                layout,
                samples: &samples,
                dark: &dark,
                tables: &tables,
                exposure: 1.0,
                white: 880.0,
                neighbours_limit: 7.0 + 100.3,
                own_limit: 7.0 + 180.1,
                warm: &vec![50.0; channels],
            };
            let estimates: Vec<Option<f32>> = (0..n)
                .map(|i| (set[i] == 1).then(|| sum[i] * 2.0))
                .collect();
            let predicted = expected(layout, height, &estimates);
            for rows in [height, 5, 2] {
                let (mut sums, mut numbers) = (sum.clone(), set.clone());
                let estimate = |at: usize| sum[at] * tables.per_time[usize::from(set[at])];
                // A chunk where all are of one set is known by that alone.
                let common: Vec<Common> = (0..n)
                    .step_by(84)
                    .flat_map(|row| [row..row + CHUNK, row + CHUNK..row + 84])
                    .map(|chunk| Common {
                        set: only(&set[chunk.clone()]),
                        most: chunk.map(estimate).fold(0.0, f32::max),
                    })
                    .collect();
                let mut commons = common.clone();
                let mut used = 0;
                for first in (0..height).step_by(rows) {
                    let last = (first + rows).min(height);
                    let of = |from: usize, to: usize| {
                        (from < to).then(|| Rows {
                            sum: &sum[from * 84..to * 84],
                            set: &set[from * 84..to * 84],
                            common: &common[from * 2..to * 2],
                        })
                    };
                    let block = Block {
                        step: &step,
                        first,
                        sum: &mut sums[first * 84..last * 84],
                        set: &mut numbers[first * 84..last * 84],
                        common: &mut commons[first * 2..last * 2],
                        above: of(first.saturating_sub(down), first),
                        below: of(last, (last + down).min(height)),
                    };
                    let outcome = pulp::Arch::new().dispatch(block);
                    used += outcome.used.iter().sum::<u64>();
                    assert!(outcome.warm.is_empty());
                    let counted: u64 = outcome.of_set.iter().sum();
                    assert_eq!(counted, ((last - first) * 84) as u64);
                }
                let mut expected_used = 0;
                let bright = near_saturated(layout, height, 880.0);
                for i in 0..n {
                    let sample = (i % 900) as f32;
                    let good =
                        !bright[i] && predicted[i] <= 100.3 && estimates[i].unwrap_or(0.0) <= 180.1;
                    expected_used += u64::from(good);
                    let (value, number) = if good {
                        (
                            sum[i] + sample - 7.0,
                            tables.with_frame[usize::from(set[i])],
                        )
                    } else {
                        (sum[i], set[i])
                    };
                    let found = commons[i / 84 * 2 + i % 84 / CHUNK].set;
                    let found = found.unwrap_or(numbers[i]);
                    assert_eq!((sums[i], found), (value, number), "{layout:?} {i}");
                }
                assert_eq!(used, expected_used);
                assert!(used > n as u64 / 4 && used < n as u64);
            }
        }
    }
}

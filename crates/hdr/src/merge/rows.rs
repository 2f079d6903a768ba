//! One frame into the sums, row by row.

use super::sets::Tables;
use crate::dark::DarkFrame;
use physics::Samples;
use pulp::NullaryFnOnce;

/// Samples of a row that are handled together where they belong to one set, as most do.
const CHUNK: usize = 64;

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
    pub(super) set: &'a [u16],
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
    /// The `down` rows above the block as they were before this frame; none at the top.
    pub(super) above: Option<Rows<'s>>,
    /// Those below it; fewer or none at the bottom.
    pub(super) below: Option<Rows<'s>>,
}

/// Estimates of a row, DN/s, and whether there are any (1 or 0), with a margin at both ends.
#[derive(Clone)]
struct Estimates {
    value: Vec<f32>,
    present: Vec<f32>,
    /// The largest value of each chunk, none below 0.
    largest: Vec<f32>,
}

/// Over three rows: sums of estimates and of whether there are any, and the largest sample.
struct Columns {
    value: Vec<f32>,
    present: Vec<f32>,
    full: Vec<f32>,
}

/// Samples of a row of the frame, with a margin at both ends.
#[derive(Clone)]
struct Seen {
    value: Vec<f32>,
    /// The largest value of each chunk, none below 0.
    largest: Vec<f32>,
}

impl Seen {
    /// Takes row number `y`; what lies outside the frame is dark.
    #[inline(always)]
    fn load(&mut self, step: &Step<'_>, y: Option<usize>) {
        let Layout { row, right, .. } = step.layout;
        let value = &mut self.value[right..][..row];
        match y.filter(|y| (y + 1) * row <= step.samples.len()) {
            Some(y) => step.samples.copy_to(y * row..(y + 1) * row, value),
            None => value.fill(0.0),
        }
        for (chunk, largest) in value.chunks(CHUNK).zip(&mut self.largest) {
            *largest = largest_of(chunk);
        }
    }
}

impl NullaryFnOnce for Block<'_, '_> {
    type Output = Outcome;

    #[inline(always)]
    fn call(self) -> Outcome {
        let Self {
            step,
            first,
            sum,
            set,
            above,
            below,
        } = self;
        let Layout {
            row,
            channels,
            right,
            down,
        } = step.layout;
        let count = sum.len() / row;
        let mut outcome = Outcome {
            used: vec![0; channels],
            of_set: vec![0; step.tables.len()],
            warm: vec![],
        };
        let empty = Estimates {
            value: vec![0.0; row + 2 * right],
            present: vec![0.0; row + 2 * right],
            largest: vec![0.0; row.div_ceil(CHUNK)],
        };
        // Rows y − down to y + down; what lies outside the frame is empty.
        let mut window = vec![empty; 2 * down + 1];
        let mut column = Columns {
            value: vec![0.0; row + 2 * right],
            present: vec![0.0; row + 2 * right],
            full: vec![0.0; row + 2 * right],
        };
        let unseen = Seen {
            value: vec![0.0; row + 2 * right],
            largest: vec![0.0; row.div_ceil(CHUNK)],
        };
        let mut seen = vec![unseen; 2 * down + 1];
        for (k, seen) in seen.iter_mut().enumerate().skip(1) {
            // One row up: the loop takes the next before it looks.
            seen.load(step, (first + k).checked_sub(down + 1));
        }
        let mut dark = vec![0.0; row];
        let mut weight = vec![0.0; row];
        if let Some(above) = above {
            let rows = above.sum.len() / row;
            for k in 0..rows {
                let at = k * row..(k + 1) * row;
                let to = &mut window[down - rows + k + 1];
                estimate(
                    &above.sum[at.clone()],
                    &above.set[at],
                    step.tables,
                    right,
                    to,
                );
            }
        }
        for k in 0..down.min(count) {
            let at = k * row..(k + 1) * row;
            let to = &mut window[down + 1 + k];
            estimate(&sum[at.clone()], &set[at], step.tables, right, to);
        }
        for y in 0..count {
            window.rotate_left(1);
            let last = &mut window[2 * down];
            let next = y + down;
            if next < count {
                let at = next * row..(next + 1) * row;
                estimate(&sum[at.clone()], &set[at], step.tables, right, last);
            } else {
                let at = (next - count) * row..(next - count + 1) * row;
                match below.filter(|below| at.end <= below.sum.len()) {
                    Some(below) => {
                        estimate(
                            &below.sum[at.clone()],
                            &below.set[at],
                            step.tables,
                            right,
                            last,
                        );
                    }
                    None => {
                        last.value.fill(0.0);
                        last.present.fill(0.0);
                        last.largest.fill(0.0);
                    }
                }
            }
            let here = (first + y) * row..(first + y + 1) * row;
            seen.rotate_left(1);
            seen[2 * down].load(step, Some(first + y + down));
            step.dark.copy_mean_to(here.clone(), &mut dark);
            let three = [&window[0], &window[down], &window[2 * down]];
            let seen = [&seen[0], &seen[down], &seen[2 * down]];
            step.weigh(three, &mut column, seen, &dark, &mut weight);
            let at = y * row..(y + 1) * row;
            step.add(
                &seen[1].value[right..][..row],
                &dark,
                &mut weight,
                &mut sum[at.clone()],
                &mut set[at],
                &mut outcome,
            );
            step.find_warm(here.start, &dark, &mut outcome.warm);
        }
        outcome
    }
}

/// Fills the estimates of a row.
#[inline(always)]
fn estimate(sum: &[f32], set: &[u16], tables: &Tables, right: usize, into: &mut Estimates) {
    let value = &mut into.value[right..][..sum.len()];
    let present = &mut into.present[right..][..sum.len()];
    let sums = sum.chunks(CHUNK).zip(set.chunks(CHUNK));
    let targets = value.chunks_mut(CHUNK).zip(present.chunks_mut(CHUNK));
    for (((sum, set), (value, present)), largest) in sums.zip(targets).zip(&mut into.largest) {
        if let Some(set) = only(set) {
            let per_time = tables.per_time[usize::from(set)];
            for (value, sum) in value.iter_mut().zip(sum) {
                *value = sum * per_time;
            }
            present.fill(if per_time > 0.0 { 1.0 } else { 0.0 });
        } else {
            for i in 0..sum.len() {
                let per_time = tables.per_time[usize::from(set[i])];
                value[i] = sum[i] * per_time;
                present[i] = if per_time > 0.0 { 1.0 } else { 0.0 };
            }
        }
        *largest = largest_of(value);
    }
}

/// The largest of `values`, or 0 where all are below. In lanes, since the compiler may not
/// reorder maxima by itself.
#[inline(always)]
fn largest_of(values: &[f32]) -> f32 {
    let mut lanes = [0.0_f32; 16];
    let (blocks, rest) = values.as_chunks::<16>();
    for block in blocks {
        for (lane, value) in lanes.iter_mut().zip(block) {
            *lane = if *value > *lane { *value } else { *lane };
        }
    }
    let all = lanes.iter().chain(rest);
    all.fold(0.0, |most, value| if *value > most { *value } else { most })
}

/// The number that all of `set` are, if they are.
#[inline(always)]
fn only(set: &[u16]) -> Option<u16> {
    let first = set[0];
    let differs = set.iter().fold(0, |all, number| all | (number ^ first));
    (differs == 0).then_some(first)
}

impl Step<'_> {
    /// Which samples of a row count: 1 or 0 into `weight`.
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
        [above, middle, below]: [&Estimates; 3],
        column: &mut Columns,
        seen: [&Seen; 3],
        dark: &[f32],
        weight: &mut [f32],
    ) {
        let right = self.layout.right;
        let n = dark.len();
        let last = middle.largest.len() - 1;
        for (chunk, start) in (0..n).step_by(CHUNK).enumerate() {
            let end = (start + CHUNK).min(n);
            let dark = &dark[start..end];
            let weight = &mut weight[start..end];
            // Most of a picture is far below the limit in most frames, and then no mean of
            // neighbours can be above it.
            let beside = chunk.saturating_sub(1)..=(chunk + 1).min(last);
            let brightest = [above, middle, below]
                .into_iter()
                .flat_map(|row| &row.largest[beside.clone()])
                .fold(0.0, |most: f32, value| most.max(*value));
            // What a rounding may be off counts for the limit.
            let most = 1.000_01 * brightest * self.exposure + largest_of(dark);
            let largest = seen
                .into_iter()
                .flat_map(|row| &row.largest[beside.clone()])
                .fold(0.0, |most: f32, value| most.max(*value));
            if most <= 0.999_99 * self.neighbours_limit && largest < self.white {
                weight.fill(1.0);
                continue;
            }
            // From the left neighbour of the first sample to the right one of the last.
            let reach = start..end + 2 * right;
            let rows = [above, middle, below];
            let [a, b, c] = rows.map(|row| &row.value[reach.clone()]);
            let e = &mut column.value[..reach.len()];
            for (i, sum) in e.iter_mut().enumerate() {
                *sum = a[i] + b[i] + c[i];
            }
            let own = &b[right..];
            let [a, b, c] = rows.map(|row| &row.present[reach.clone()]);
            let p = &mut column.present[..reach.len()];
            for (i, sum) in p.iter_mut().enumerate() {
                *sum = a[i] + b[i] + c[i];
            }
            let own_present = &b[right..];
            let full = &mut column.full[..reach.len()];
            let [a, b, c] = seen.map(|row| &row.value[reach.clone()]);
            for (i, most) in full.iter_mut().enumerate() {
                let above = if a[i] > b[i] { a[i] } else { b[i] };
                *most = if c[i] > above { c[i] } else { above };
            }
            let (f1, f2) = (&full[right..], &full[2 * right..]);
            let (e1, e2) = (&e[right..], &e[2 * right..]);
            let (p1, p2) = (&p[right..], &p[2 * right..]);
            for i in 0..weight.len() {
                let sum = e[i] + e1[i] + e2[i] - own[i];
                let count = (p[i] + p1[i] + p2[i] - own_present[i]).max(1.0);
                let room = self.neighbours_limit - dark[i];
                let good = (full[i] < self.white)
                    & (f1[i] < self.white)
                    & (f2[i] < self.white)
                    & (sum * self.exposure <= room * count)
                    & (own[i] * self.exposure <= self.own_limit - dark[i]);
                weight[i] = if good { 1.0 } else { 0.0 };
            }
        }
    }

    /// Adds the samples that count, and moves them to their next set.
    #[inline(always)]
    fn add(
        &self,
        samples: &[f32],
        dark: &[f32],
        weight: &mut [f32],
        sum: &mut [f32],
        set: &mut [u16],
        outcome: &mut Outcome,
    ) {
        let n = samples.len();
        let (dark, weight, sum, set) = (&dark[..n], &mut weight[..n], &mut sum[..n], &mut set[..n]);
        let with_frame = &self.tables.with_frame;
        for start in (0..n).step_by(CHUNK) {
            let end = (start + CHUNK).min(n);
            let set = &mut set[start..end];
            let weight = &mut weight[start..end];
            let all = (end - start) as f32;
            let good: f32 = weight.iter().sum();
            let set_of_all = only(set).map(|one| (one, with_frame[usize::from(one)]));
            match set_of_all {
                _ if good == 0.0 => {
                    for number in &*set {
                        outcome.of_set[usize::from(*number)] += 1;
                    }
                }
                Some((one, next)) if good == all && next != one => {
                    set.fill(next);
                    outcome.of_set[usize::from(next)] += (end - start) as u64;
                }
                _ => {
                    for (number, weight) in set.iter_mut().zip(weight) {
                        let next = with_frame[usize::from(*number)];
                        // A set that is its own successor takes no more frames.
                        if next == *number {
                            *weight = 0.0;
                        } else if *weight != 0.0 {
                            *number = next;
                        }
                        outcome.of_set[usize::from(*number)] += 1;
                    }
                }
            }
        }
        for i in 0..n {
            // A weight of 0 must not let a sample through that is no number.
            sum[i] += if weight[i] == 0.0 {
                0.0
            } else {
                samples[i] - dark[i]
            };
        }
        if let [used] = outcome.used.as_mut_slice() {
            *used += weight.iter().map(|w| *w as u32).sum::<u32>() as u64;
        } else {
            for pixel in weight.chunks_exact(self.layout.channels) {
                for (used, weight) in outcome.used.iter_mut().zip(pixel) {
                    *used += *weight as u64;
                }
            }
        }
    }

    /// Notes the samples of a row, the first of which is number `start`, that are warm.
    #[inline(always)]
    fn find_warm(&self, start: usize, dark: &[f32], warm: &mut Vec<(usize, f32)>) {
        let least = self.warm.iter().copied().fold(f32::INFINITY, f32::min);
        for (chunk, levels) in dark.chunks(CHUNK).enumerate() {
            let any = levels
                .iter()
                .fold(0_u32, |n, level| n + u32::from(*level > least));
            if any > 0 {
                for (i, level) in levels.iter().enumerate() {
                    let at = start + chunk * CHUNK + i;
                    if *level > self.warm[at % self.layout.channels] {
                        warm.push((at, *level));
                    }
                }
            }
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
            sets.extend(Set {
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
            let tables = sets.extend(Set {
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
                let mut used = 0;
                for first in (0..height).step_by(rows) {
                    let last = (first + rows).min(height);
                    let of = |from: usize, to: usize| {
                        (from < to).then(|| Rows {
                            sum: &sum[from * 84..to * 84],
                            set: &set[from * 84..to * 84],
                        })
                    };
                    let block = Block {
                        step: &step,
                        first,
                        sum: &mut sums[first * 84..last * 84],
                        set: &mut numbers[first * 84..last * 84],
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
                    assert_eq!((sums[i], numbers[i]), (value, number), "{layout:?} {i}");
                }
                assert_eq!(used, expected_used);
                assert!(used > n as u64 / 4 && used < n as u64);
            }
        }
    }
}

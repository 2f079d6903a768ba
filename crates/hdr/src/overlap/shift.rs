//! How far one frame is shifted against another.

use crate::estimate::Estimate;
use crate::net::{self, Both};

/// Side of the blocks of pixels that are averaged before gradients are taken.
const SIDE: usize = 2;

/// Fewest blocks that make a shift.
const LEAST: u64 = 50;

/// Sums over blocks of pixels of two frames, in the rows by which they are compared.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    channels: usize,
    columns: usize,
    /// Which block of its row each sample of a row belongs to, channel by channel; none in a last
    /// odd column.
    of_sample: Vec<Option<u32>>,
    /// Rows of blocks, by their number in the picture.
    rows: Vec<usize>,
    /// Where the sums of each row of blocks of the picture begin, of those that there are.
    of_row: Vec<Option<u32>>,
    /// Sum of the short and of the long frame, and how many samples, for each block and channel.
    blocks: Vec<(f32, f32, u16)>,
}

impl Blocks {
    pub(super) fn new(size: (usize, usize, usize)) -> Self {
        let (width, height, channels) = size;
        let columns = width / SIDE;
        let of_sample = (0..width * channels)
            .map(|at| {
                let column = at / channels / SIDE;
                (column < columns).then_some((column * channels + at % channels) as u32)
            })
            .collect();
        let mut rows: Vec<usize> = net::rows(size).map(|row| row / SIDE).collect();
        rows.dedup();
        let mut of_row = vec![None; height / SIDE + 1];
        for (number, row) in rows.iter().enumerate() {
            of_row[*row] = Some((number * columns * channels) as u32);
        }
        Self {
            channels,
            columns,
            of_sample,
            blocks: vec![(0.0, 0.0, 0); columns * rows.len() * channels],
            rows,
            of_row,
        }
    }

    /// Forgets the samples of another pair.
    pub(super) fn clear(&mut self) {
        self.blocks.fill((0.0, 0.0, 0));
    }

    /// Adds a sample of both frames.
    pub(super) fn add(&mut self, both: &Both) {
        let place = self.of_row[both.row / SIDE].zip(self.of_sample[both.at]);
        if let Some((first, block)) = place
            && let Some((short, long, count)) = self.blocks.get_mut((first + block) as usize)
        {
            *short += both.short;
            *long += both.long;
            *count += 1;
        }
    }

    /// The shift of the long frame against the short one, right and down, px, for frames whose
    /// exposures have this `ratio`, over blocks brighter than `dim` DN in the long one.
    ///
    /// Where a picture I moves by δ, it changes by −∇I·δ. Least squares for δ with the gradients
    /// of one frame would come out too small, since their noise counts as slope; so the slopes
    /// of the short frame are the weights and those of the long frame, whose noise is another,
    /// the model. What a block itself holds is in neither.
    pub(super) fn shift(&self, ratio: f64, dim: f64) -> Option<[Estimate; 2]> {
        let full = (SIDE * SIDE) as u16;
        let (right, down) = (self.channels, self.columns * self.channels);
        let measured = |i: usize| self.blocks.get(i).filter(|b| b.2 == full);
        let mut matrix = [[0.0; 2]; 2];
        let mut side = [0.0; 2];
        let mut scatter = [[0.0; 2]; 2];
        let mut count = 0_u64;
        for (i, here) in self.blocks.iter().enumerate().skip(down) {
            if here.2 != full {
                continue;
            }
            let (row, column) = (i / down, i / self.channels % self.columns);
            // What follows in the list may stand elsewhere in the picture.
            let below = self.rows.get(row + 1) == Some(&(self.rows[row] + 1));
            let amid = below && self.rows[row - 1] + 1 == self.rows[row];
            if column == 0 || column + 1 == self.columns || !amid {
                continue;
            }
            let (Some(w), Some(e), Some(n), Some(s)) = (
                measured(i - right),
                measured(i + right),
                measured(i - down),
                measured(i + down),
            ) else {
                continue;
            };
            let samples = f64::from(full);
            let long = f64::from(here.1) / samples;
            let short = ratio * f64::from(here.0) / samples;
            let level = 0.5 * (long + short);
            if level < dim {
                continue;
            }
            let across = 2.0 * SIDE as f64 * samples;
            let slope = |a: f32, b: f32| f64::from(b - a) / across;
            let by_short = [ratio * slope(w.0, e.0), ratio * slope(n.0, s.0)];
            let by_long = [slope(w.1, e.1), slope(n.1, s.1)];
            let difference = long - short;
            // Photon noise is the most of it.
            let weight = 1.0 / level;
            count += 1;
            for a in 0..2 {
                side[a] -= weight * by_short[a] * difference;
                for b in 0..2 {
                    matrix[a][b] += weight * by_short[a] * by_long[b];
                    scatter[a][b] += (weight * difference).powi(2) * by_short[a] * by_short[b];
                }
            }
        }
        let [[a, b], [c, d]] = matrix;
        let determinant = a * d - b * c;
        if count < LEAST || determinant <= 1e-6 * a * d {
            return None;
        }
        let inverse = [
            [d / determinant, -b / determinant],
            [-c / determinant, a / determinant],
        ];
        let of = |axis: usize| {
            let row: [f64; 2] = inverse[axis];
            let mut variance = 0.0;
            for i in 0..2 {
                for j in 0..2 {
                    variance += row[i] * scatter[i][j] * row[j];
                }
            }
            Estimate {
                value: row[0] * side[0] + row[1] * side[1],
                u: variance.max(0.0).sqrt(),
            }
        };
        Some([of(0), of(1)])
    }
}

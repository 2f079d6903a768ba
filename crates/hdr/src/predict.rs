//! What the shorter exposures say of the next one.

/// For each sample of a row, the mean estimate of its eight neighbours, in DN/s.
///
/// The sample's own estimate is left out on purpose. A frame is dropped where its prediction is
/// too bright; were the pixel's own noise part of the prediction, a frame would be dropped more
/// often where the sum so far is too high, and the merged value would keep that error: a bias of
/// 0.2 standard deviations, permilles, wherever the radiance is near the limit.
pub(crate) struct Neighbours {
    channels: usize,
    /// Estimates and their presence (0 or 1) in three rows, each with a margin of one pixel.
    rows: [Row; 3],
    /// Sums over the three rows.
    column: Row,
}

#[derive(Clone)]
struct Row {
    estimate: Vec<f32>,
    present: Vec<f32>,
}

impl Row {
    fn empty(length: usize) -> Self {
        Self {
            estimate: vec![0.0; length],
            present: vec![0.0; length],
        }
    }
}

impl Neighbours {
    /// For rows of `samples` interleaved samples.
    pub(crate) fn new(samples: usize, channels: usize) -> Self {
        let row = Row::empty(samples + 2 * channels);
        Self {
            channels,
            rows: [row.clone(), row.clone(), row.clone()],
            column: row,
        }
    }

    /// Moves down one row: `below` is the sum and the time of the row that comes into view, or
    /// `None` below the last one.
    pub(crate) fn advance(&mut self, below: Option<(&[f32], &[f32])>) {
        self.rows.rotate_left(1);
        let last = &mut self.rows[2];
        match below {
            None => {
                last.estimate.fill(0.0);
                last.present.fill(0.0);
            }
            Some((sum, time)) => {
                let estimate = &mut last.estimate[self.channels..][..sum.len()];
                let present = &mut last.present[self.channels..][..sum.len()];
                let targets = estimate.iter_mut().zip(present);
                for ((estimate, present), (sum, time)) in targets.zip(sum.iter().zip(time)) {
                    let measured = *time > 0.0;
                    *estimate = if measured { sum / time } else { 0.0 };
                    *present = if measured { 1.0 } else { 0.0 };
                }
            }
        }
    }

    /// The mean of the neighbours of each sample of the middle row into `mean`, and the
    /// sample's own estimate into `own`; 0 where nothing was measured.
    pub(crate) fn means(&mut self, mean: &mut [f32], own: &mut [f32]) {
        let [above, middle, below] = &self.rows;
        for (column, rows) in [
            (
                &mut self.column.estimate,
                [&above.estimate, &middle.estimate, &below.estimate],
            ),
            (
                &mut self.column.present,
                [&above.present, &middle.present, &below.present],
            ),
        ] {
            let [a, b, c] = rows;
            for (((column, a), b), c) in column.iter_mut().zip(a).zip(b).zip(c) {
                *column = a + b + c;
            }
        }
        let (length, step) = (mean.len(), self.channels);
        let (e, p) = (&self.column.estimate, &self.column.present);
        let (e0, e1, e2) = (&e[..length], &e[step..][..length], &e[2 * step..][..length]);
        let (p0, p1, p2) = (&p[..length], &p[step..][..length], &p[2 * step..][..length]);
        let own_e = &middle.estimate[step..][..length];
        let own_p = &middle.present[step..][..length];
        own.copy_from_slice(own_e);
        for i in 0..length {
            let sum = e0[i] + e1[i] + e2[i] - own_e[i];
            let count = p0[i] + p1[i] + p2[i] - own_p[i];
            mean[i] = sum / count.max(1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_of_the_measured_neighbours_alone() {
        // Two channels, three pixels a row; channel 1 holds ten times channel 0.
        let both = |v: [f32; 3]| v.iter().flat_map(|v| [*v, 10.0 * v]).collect::<Vec<_>>();
        let time = |v: [f32; 3]| v.iter().flat_map(|v| [*v, *v]).collect::<Vec<_>>();
        let rows = [
            (both([1.0, 2.0, 3.0]), time([1.0; 3])),
            (both([4.0, 5.0, 6.0]), time([1.0, 0.0, 1.0])),
        ];
        let mut neighbours = Neighbours::new(6, 2);
        let (mut mean, mut own) = ([0.0; 6], [0.0; 6]);
        neighbours.advance(Some((&rows[0].0, &rows[0].1)));
        neighbours.advance(Some((&rows[1].0, &rows[1].1)));
        neighbours.means(&mut mean, &mut own);
        assert_eq!(mean[0], 3.0);
        assert_eq!(mean[2], (1.0 + 3.0 + 4.0 + 6.0) / 4.0);
        assert_eq!(mean[5], 40.0);
        neighbours.advance(None);
        neighbours.means(&mut mean, &mut own);
        assert_eq!(mean[2], (1.0 + 2.0 + 3.0 + 4.0 + 6.0) / 5.0);
        assert_eq!(own, [4.0, 40.0, 0.0, 0.0, 6.0, 60.0]);
    }
}

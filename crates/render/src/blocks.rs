//! Noise that neighbouring pixels share.
//!
//! One photon, or one lit point, adds to many pixels. The standard error of each is true, but that of a
//! sum is not the root of the sum of their squares. Sums over blocks of pixels, round by round, tell
//! how much more it is.

use crate::film::Film;

/// Sums of a picture over square blocks of a few sizes.
#[derive(Clone, Debug, PartialEq)]
pub struct Blocks {
    size: [usize; 2],
    planes: usize,
    /// Of each of [`sides`]: sums over blocks, plane after plane, each row by row.
    films: Vec<Film>,
}

/// Ratio of the side of a block to that of the next smaller one.
const STEP: usize = 4;

/// Sides of the blocks of a picture, pixels: from one step above a pixel to all of it.
fn sides([width, height]: [usize; 2]) -> impl Iterator<Item = usize> {
    let all = width.max(height);
    let mut last = 1;
    std::iter::from_fn(move || {
        (last < all).then(|| {
            last *= STEP;
            last
        })
    })
}

/// How much more the variance of a sum over pixels is than the sum of their variances.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedNoise {
    /// Mean number of pixels of a block and the factor of its variance, from the smallest blocks to
    /// the whole picture.
    pub factors: Vec<(f64, f64)>,
}

impl Blocks {
    /// Of a picture of so many columns and rows in so many planes, without light yet.
    pub fn new(size: [usize; 2], planes: usize) -> Self {
        let of_side = |side: usize| Film::new(planes * count(size, side));
        Self {
            size,
            planes,
            films: sides(size).map(of_side).collect(),
        }
    }

    /// Adds one round: the radiances of all pixels, plane after plane, each row by row.
    ///
    /// # Panics
    ///
    /// If it has not as many numbers as the picture.
    pub fn add(&mut self, round: &[f64]) {
        let [width, height] = self.size;
        assert_eq!(round.len(), self.planes * width * height);
        // Each size from the one before, whose blocks make up its own.
        let mut size = self.size;
        let mut values = round.to_vec();
        for film in &mut self.films {
            let next = size.map(|length| length.div_ceil(STEP));
            let mut sums = vec![0.0; self.planes * next[0] * next[1]];
            for (i, value) in values.iter().enumerate() {
                let (plane, pixel) = (i / (size[0] * size[1]), i % (size[0] * size[1]));
                let (column, row) = (pixel % size[0], pixel / size[0]);
                let block = row / STEP * next[0] + column / STEP;
                sums[plane * next[0] * next[1] + block] += value;
            }
            film.add(&sums);
            (size, values) = (next, sums);
        }
    }

    /// The sums over blocks of each size.
    pub fn films(&self) -> &[Film] {
        &self.films
    }

    /// The same, to be restored.
    pub fn films_mut(&mut self) -> &mut [Film] {
        &mut self.films
    }

    /// What neighbours share in one plane of the picture whose pixels are in `radiance`.
    ///
    /// Without noise, or before two rounds, there are no factors.
    pub fn shared_noise(&self, radiance: &Film, plane: usize) -> SharedNoise {
        let variance = |film: &Film| -> f64 {
            let len = film.len() / self.planes;
            let all = plane * len..(plane + 1) * len;
            all.map(|index| film.estimate(index).u.powi(2)).sum()
        };
        let pixels = self.size[0] * self.size[1];
        let alone = variance(radiance);
        if !(alone > 0.0 && alone.is_finite()) {
            return SharedNoise { factors: vec![] };
        }
        let factor = |(side, film): (usize, &Film)| {
            let of_block = pixels as f64 / count(self.size, side) as f64;
            (of_block, variance(film) / alone)
        };
        SharedNoise {
            factors: sides(self.size).zip(&self.films).map(factor).collect(),
        }
    }
}

/// How many blocks of this side a picture has.
fn count(size: [usize; 2], side: usize) -> usize {
    size.map(|length| length.div_ceil(side)).iter().product()
}

impl SharedNoise {
    /// Factor of the variance of a sum over so many pixels, at least 1: between two sizes of blocks on
    /// a line in the logarithms.
    ///
    /// Pixels of a thin ring share less than those of a block; the factor is then too large.
    pub fn factor(&self, pixels: f64) -> f64 {
        let mut last = (1.0_f64, 1.0_f64);
        for &(size, factor) in &self.factors {
            let factor = factor.max(1.0);
            if pixels <= size {
                let part = if size > last.0 {
                    (pixels.max(1.0) / last.0).ln() / (size / last.0).ln()
                } else {
                    1.0
                };
                return last.1 * (factor / last.1).powf(part);
            }
            last = (size, factor);
        }
        last.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::random::{stream, uniform};

    /// Noise that patches of 8 x 8 pixels have in common, beside that of each pixel: what the sums
    /// scatter by is told to a few percent, and independent pixels share nothing.
    #[test]
    fn shared_noise_is_found() {
        let size = [40, 24];
        let pixels = size[0] * size[1];
        let mut film = Film::new(2 * pixels);
        let mut blocks = Blocks::new(size, 2);
        for round in 0..400 {
            let mut rng = stream(1, &[round]);
            let mut draw = || (uniform(&mut rng) - 0.5) * 12.0_f64.sqrt();
            let patches: Vec<f64> = (0..15).map(|_| draw()).collect();
            let own: Vec<f64> = (0..2 * pixels).map(|_| draw()).collect();
            let value = |i: usize| {
                let (column, row) = (i % pixels % size[0], i % pixels / size[0]);
                let patch = patches[row / 8 * 5 + column / 8];
                own[i] + if i < pixels { 0.5 * patch } else { 0.0 }
            };
            let round: Vec<f64> = (0..2 * pixels).map(value).collect();
            film.add(&round);
            blocks.add(&round);
        }
        // A pixel has 1 + 0.25. In a block of 16 pixels the patch counts 16 times, in all 64 times.
        let shared = blocks.shared_noise(&film, 0);
        let sizes: Vec<f64> = shared.factors.iter().map(|f| f.0).collect();
        assert_eq!(sizes, [16.0, 160.0, 960.0]);
        let expected = [1.0 + 0.25 * 16.0, 1.0 + 0.25 * 64.0, 1.0 + 0.25 * 64.0].map(|x| x / 1.25);
        for ((_, found), expected) in shared.factors.iter().zip(expected) {
            assert!(
                (found / expected - 1.0).abs() < 0.15,
                "{shared:?} {expected}"
            );
        }
        assert!((shared.factor(16.0) / shared.factors[0].1 - 1.0).abs() < 1e-12);
        assert!(shared.factor(4.0) > 1.5 && shared.factor(4.0) < 2.5);
        assert_eq!(shared.factor(1.0), 1.0);
        assert_eq!(shared.factor(1e6), shared.factors[2].1);
        let alone = blocks.shared_noise(&film, 1);
        for (_, factor) in &alone.factors {
            assert!((factor - 1.0).abs() < 0.2, "{alone:?}");
        }
    }

    #[test]
    fn a_picture_without_noise_shares_none() {
        let mut film = Film::new(6);
        let mut blocks = Blocks::new([3, 2], 1);
        for _ in 0..3 {
            film.add(&[1.0; 6]);
            blocks.add(&[1.0; 6]);
        }
        assert_eq!(blocks.shared_noise(&film, 0).factor(6.0), 1.0);
    }
}

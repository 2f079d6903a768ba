//! A picture whose every pixel has a variance.

use crate::mosaic::{COLOURS, Mosaic};
use std::borrow::Cow;

/// One channel of a [`RadianceMap`].
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelMap {
    /// Name of the channel: `R`, `G`, `B`, `Y` or a wavelength.
    pub name: String,
    /// Value of each pixel, row by row; may be negative where noise outweighs light.
    pub value: Vec<f32>,
    /// Variance of each value, in the square of its unit; infinite where no frame measured the
    /// pixel, whose value is then 0, or NaN where it is a photosite of another colour.
    pub variance: Vec<f32>,
}

/// A merged picture: channels of one size.
///
/// In DN/s as merged; in mm⁻², the unit of R_d, once a reference has set its scale.
#[derive(Clone, Debug, PartialEq)]
pub struct RadianceMap {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The channels, in the order of the camera; of a mosaic the one plane that holds all its
    /// colours, [`Mosaic::PLANE`].
    pub channels: Vec<ChannelMap>,
    /// Which colour each pixel is of, where it is of one alone.
    pub mosaic: Option<Mosaic>,
}

impl ChannelMap {
    /// Mean of the measured pixels; 0 where none was.
    pub fn mean_measured(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0_f64);
        for (value, variance) in self.value.iter().zip(&self.variance) {
            if variance.is_finite() {
                sum += f64::from(*value);
                count += 1.0;
            }
        }
        sum / count.max(1.0)
    }
}

impl RadianceMap {
    /// Names of the channels, in the order of the camera: R, G and B of a mosaic.
    pub fn names(&self) -> Vec<&str> {
        match self.mosaic {
            Some(_) => COLOURS.to_vec(),
            None => self.channels.iter().map(|c| c.name.as_str()).collect(),
        }
    }

    /// Channel number `index`, as [`Self::names`] counts them. Of a mosaic it has the photosites
    /// of its colour alone; the others are NaN with an infinite variance.
    ///
    /// # Panics
    ///
    /// There is no such channel.
    pub fn channel(&self, index: usize) -> Cow<'_, ChannelMap> {
        let Some(mosaic) = &self.mosaic else {
            return Cow::Borrowed(&self.channels[index]);
        };
        let plane = &self.channels[0];
        let own = |row: usize, all: &[f32], other: f32| -> Vec<f32> {
            let pick = |(column, v): (usize, &f32)| {
                if mosaic.colour(column, row) == index {
                    *v
                } else {
                    other
                }
            };
            all.iter().enumerate().map(pick).collect()
        };
        let rows = |all: &[f32], other: f32| -> Vec<f32> {
            let mut picked = Vec::with_capacity(all.len());
            for (row, all) in all.chunks_exact(self.width.max(1)).enumerate() {
                picked.extend(own(row, all, other));
            }
            picked
        };
        Cow::Owned(ChannelMap {
            name: COLOURS[index].to_owned(),
            value: rows(&plane.value, f32::NAN),
            variance: rows(&plane.variance, f32::INFINITY),
        })
    }

    /// Pixels that channel `index` has; of a mosaic its photosites.
    pub fn pixels(&self, index: usize) -> usize {
        let all = self.width * self.height;
        self.mosaic.map_or(all, |mosaic| {
            let cell = mosaic.cell();
            let own = cell.iter().filter(|c| usize::from(**c) == index).count();
            all / cell.len() * own
        })
    }

    /// Mean of the measured pixels of each channel, in the order of [`Self::names`]; 0 where none
    /// was measured.
    pub fn means(&self) -> Vec<f64> {
        let (width, mosaic) = (self.width.max(1), self.mosaic);
        let mut sums = vec![(0.0, 0.0_f64); self.names().len()];
        for (index, channel) in self.channels.iter().enumerate() {
            let rows = channel
                .value
                .chunks(width)
                .zip(channel.variance.chunks(width));
            for (row, (values, variances)) in rows.enumerate() {
                for (column, (value, variance)) in values.iter().zip(variances).enumerate() {
                    let of = mosaic.map_or(index, |mosaic| mosaic.colour(column, row));
                    if variance.is_finite() {
                        sums[of].0 += f64::from(*value);
                        sums[of].1 += 1.0;
                    }
                }
            }
        }
        sums.into_iter()
            .map(|(sum, count)| sum / count.max(1.0))
            .collect()
    }

    /// Every measured pixel less the offset of its channel.
    pub fn less(mut self, offsets: &[f64]) -> Self {
        let (width, mosaic) = (self.width.max(1), self.mosaic);
        for (index, channel) in self.channels.iter_mut().enumerate() {
            let pixels = channel.value.iter_mut().zip(&channel.variance);
            for (at, (value, variance)) in pixels.enumerate() {
                let of = mosaic.map_or(index, |mosaic| mosaic.colour(at % width, at / width));
                if variance.is_finite() {
                    *value = (f64::from(*value) - offsets[of]) as f32;
                }
            }
        }
        self
    }

    /// Every channel times its factor.
    pub fn scaled(mut self, factors: &[f64]) -> Self {
        let (width, mosaic) = (self.width.max(1), self.mosaic);
        for (index, channel) in self.channels.iter_mut().enumerate() {
            let pixels = channel.value.iter_mut().zip(&mut channel.variance);
            for (at, (value, variance)) in pixels.enumerate() {
                let of = mosaic.map_or(index, |mosaic| mosaic.colour(at % width, at / width));
                let factor = factors[of];
                *value = (f64::from(*value) * factor) as f32;
                *variance *= (factor * factor) as f32;
            }
        }
        self
    }
}

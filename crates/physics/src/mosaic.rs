//! A sensor whose photosites see one colour each.

use crate::frame::{Frame, Samples};
use crate::radiance::{ChannelMap, RadianceMap};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Colours of a mosaic, in the order of its channels.
pub const COLOURS: [&str; 3] = ["R", "G", "B"];

/// Largest side of a cell.
const LARGEST: usize = 6;

/// The pattern of a colour filter array: a square cell of photosites that repeats.
///
/// Nothing is demosaiced. A mosaic is merged cell by cell: [`Mosaic::folded`] makes each
/// photosite of the cell a channel of its own, so that whatever looks at a neighbour of one
/// channel looks at the nearest photosite that has the same place in its cell, and the same
/// colour. [`Mosaic::unfolded`] puts what was merged back where it was measured.
///
/// ```
/// let bayer: physics::Mosaic = "RGGB".parse()?;
/// assert_eq!(bayer.side(), 2);
/// assert_eq!(bayer.colour(4, 7), 1);
/// assert_eq!(bayer.shifted(1, 0).to_string(), "GRBG");
/// # Ok::<(), physics::mosaic::InvalidMosaic>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Mosaic {
    side: usize,
    /// Row by row; what is beyond the cell is 0.
    colours: [u8; LARGEST * LARGEST],
}

/// A text that is no pattern.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum InvalidMosaic {
    /// Neither of the sizes.
    #[error(
        "a pattern has 4, 16 or 36 letters, row by row (a cell of 2 x 2, 4 x 4 or 6 x 6 \
         photosites), got {0}"
    )]
    Size(usize),
    /// A colour that is none of the three.
    #[error("a pattern is made of R, G and B, got `{0}`")]
    Colour(char),
    /// A colour that does not occur.
    #[error("a pattern has photosites of each colour, and {0} is missing")]
    Missing(&'static str),
}

impl Mosaic {
    /// The pattern with these colours, 0 to 2 for R, G and B, row by row.
    ///
    /// # Errors
    ///
    /// [`InvalidMosaic`] for another number of photosites, another colour, or a missing one.
    pub fn from_colours(colours: &[u8]) -> Result<Self, InvalidMosaic> {
        let side = match colours.len() {
            4 => 2,
            16 => 4,
            36 => 6,
            other => return Err(InvalidMosaic::Size(other)),
        };
        if let Some(other) = colours.iter().find(|c| usize::from(**c) >= COLOURS.len()) {
            return Err(InvalidMosaic::Colour(char::from(b'0'.wrapping_add(*other))));
        }
        for (colour, name) in COLOURS.iter().enumerate() {
            if !colours.iter().any(|c| usize::from(*c) == colour) {
                return Err(InvalidMosaic::Missing(name));
            }
        }
        let mut all = [0; LARGEST * LARGEST];
        all[..colours.len()].copy_from_slice(colours);
        Ok(Self { side, colours: all })
    }

    /// Photosites along each side of the cell.
    pub fn side(&self) -> usize {
        self.side
    }

    /// The colours of the cell, row by row: 0 to 2 for R, G and B.
    pub fn cell(&self) -> &[u8] {
        &self.colours[..self.side * self.side]
    }

    /// Colour of the photosite in this column and row: 0 to 2 for R, G and B.
    pub fn colour(&self, column: usize, row: usize) -> usize {
        let at = row % self.side * self.side + column % self.side;
        usize::from(self.colours[at])
    }

    /// The pattern of the picture that begins in this column and row of a larger one.
    pub fn shifted(&self, column: usize, row: usize) -> Self {
        let mut shifted = *self;
        for y in 0..self.side {
            for x in 0..self.side {
                shifted.colours[y * self.side + x] = self.colour(column + x, row + y) as u8;
            }
        }
        shifted
    }

    /// Width and height of the whole cells in a picture of this size; what is beyond them, on
    /// the right and at the bottom, is left out.
    pub fn whole(&self, width: usize, height: usize) -> (usize, usize) {
        (width - width % self.side, height - height % self.side)
    }

    /// The frame with a pixel for each cell, and a channel for each photosite of it.
    ///
    /// `frame` has one channel.
    pub fn folded(&self, frame: &Frame) -> Frame {
        debug_assert_eq!(frame.channels, 1);
        let samples = match &frame.samples {
            Samples::U16(samples) => self.fold(samples, frame.width, frame.height).into(),
            Samples::F32(samples) => Samples::F32(self.fold(samples, frame.width, frame.height)),
        };
        Frame {
            width: frame.width / self.side,
            height: frame.height / self.side,
            channels: self.side * self.side,
            samples,
        }
    }

    fn fold<T: Copy>(&self, samples: &[T], width: usize, height: usize) -> Vec<T> {
        let (side, whole) = (self.side, self.whole(width, height));
        let mut folded = Vec::with_capacity(whole.0 * whole.1);
        for rows in samples.chunks_exact(width.max(1) * side) {
            for x in (0..whole.0).step_by(side) {
                for row in rows.chunks_exact(width) {
                    folded.extend_from_slice(&row[x..x + side]);
                }
            }
        }
        folded
    }

    /// The one plane of a map whose channels are the photosites of a cell: the inverse of
    /// [`Self::folded`].
    pub fn unfolded(&self, map: RadianceMap) -> RadianceMap {
        let (width, height) = (map.width * self.side, map.height * self.side);
        let (values, variances): (Vec<_>, Vec<_>) = map
            .channels
            .into_iter()
            .map(|channel| (channel.value, channel.variance))
            .unzip();
        // One after the other, so that no more than one of the two is there twice.
        let value = self.unfold(&values, map.width, map.height);
        drop(values);
        let variance = self.unfold(&variances, map.width, map.height);
        RadianceMap {
            width,
            height,
            channels: vec![ChannelMap {
                name: Self::PLANE.to_owned(),
                value,
                variance,
            }],
            mosaic: Some(*self),
        }
    }

    fn unfold(&self, planes: &[Vec<f32>], width: usize, height: usize) -> Vec<f32> {
        let mut unfolded = Vec::with_capacity(width * height * self.side * self.side);
        for y in 0..height {
            for planes in planes.chunks_exact(self.side) {
                for x in 0..width {
                    unfolded.extend(planes.iter().map(|plane| plane[y * width + x]));
                }
            }
        }
        unfolded
    }

    /// Name of the plane of a map that holds all colours.
    pub const PLANE: &'static str = "mosaic";
}

impl FromStr for Mosaic {
    type Err = InvalidMosaic;

    fn from_str(text: &str) -> Result<Self, InvalidMosaic> {
        let colours = text.chars().map(|letter| match letter {
            'R' => Ok(0),
            'G' => Ok(1),
            'B' => Ok(2),
            other => Err(InvalidMosaic::Colour(other)),
        });
        Self::from_colours(&colours.collect::<Result<Vec<u8>, _>>()?)
    }
}

impl fmt::Display for Mosaic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.cell()
            .iter()
            .try_for_each(|colour| f.write_str(COLOURS[usize::from(*colour)]))
    }
}

impl Serialize for Mosaic {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Mosaic {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        String::deserialize(from)?
            .parse()
            .map_err(de::Error::custom)
    }
}

impl fmt::Debug for Mosaic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Mosaic({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const X_TRANS: &str = "GBGGRGRGRBGBGBGGRGGRGGBGBGBRGRGRGGBG";

    #[test]
    fn patterns_are_read_and_written() {
        for text in ["RGGB", "GRBG", "RRGGRRGGGGBBGGBB", X_TRANS] {
            let mosaic: Mosaic = text.parse().unwrap();
            assert_eq!(mosaic.to_string(), text);
        }
        let parse = |text: &str| text.parse::<Mosaic>().unwrap_err().to_string();
        assert!(parse("RGB").contains("got 3"));
        assert!(parse("RGEB").contains("got `E`"));
        assert!(parse("RGGR").contains("B is missing"));
        let bayer: Mosaic = "RGGB".parse().unwrap();
        assert_eq!(bayer.shifted(1, 1).to_string(), "BGGR");
        assert_eq!(bayer.shifted(2, 4), bayer);
    }

    #[test]
    fn folding_sorts_photosites_and_unfolding_puts_them_back() {
        for (text, width, height) in [("GRBG", 7, 5), (X_TRANS, 14, 13)] {
            let mosaic: Mosaic = text.parse().unwrap();
            let side = mosaic.side();
            let samples: Vec<u16> = (0..width * height).map(|i| i as u16).collect();
            let frame = Frame {
                width,
                height,
                channels: 1,
                samples: samples.into(),
            };
            let folded = mosaic.folded(&frame);
            let (whole, rows) = mosaic.whole(width, height);
            assert_eq!((folded.width * side, folded.height * side), (whole, rows));
            let channels = folded.channels;
            let Samples::U16(all) = &folded.samples else {
                panic!("16-bit numbers stay so");
            };
            assert_eq!(all.len(), whole * rows);
            let map = RadianceMap {
                width: folded.width,
                height: folded.height,
                channels: (0..channels)
                    .map(|c| {
                        let value: Vec<f32> = all
                            .iter()
                            .skip(c)
                            .step_by(channels)
                            .map(|s| f32::from(*s))
                            .collect();
                        // Every photosite of a channel has its colour.
                        for v in &value {
                            let (x, y) = (*v as usize % width, *v as usize / width);
                            assert_eq!(mosaic.colour(x, y), usize::from(mosaic.cell()[c]));
                        }
                        ChannelMap {
                            name: c.to_string(),
                            variance: value.clone(),
                            value,
                        }
                    })
                    .collect(),
                mosaic: None,
            };
            let back = mosaic.unfolded(map);
            assert_eq!((back.width, back.height), (whole, rows));
            let plane = &back.channels[0];
            for y in 0..rows {
                for x in 0..whole {
                    let expected = (y * width + x) as f32;
                    assert_eq!(plane.value[y * whole + x], expected);
                    assert_eq!(plane.variance[y * whole + x], expected);
                }
            }
        }
    }
}

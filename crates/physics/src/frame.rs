//! One exposure as the camera wrote it, and what is known of the sensor behind it.

use std::ops::{Deref, DerefMut, Range};

/// Raw counts of one exposure.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Interleaved channels: 1 (Y), 3 (R, G, B), or 4, 16 or 36 (the photosites of a cell,
    /// [`crate::Mosaic::folded`]).
    pub channels: usize,
    /// Data numbers, `width`·`height`·`channels` of them, row by row.
    pub samples: Samples,
}

/// Data numbers as they were stored.
///
/// Almost every frame is of whole numbers, which take half of the memory and whose rounding is a
/// part of their variance; frames of 8 bits are widened. Floating-point numbers come from files
/// that were averaged or calibrated already.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Whole numbers from 0 to 65535.
    U16(Counts),
    /// Finite numbers of any sign and size.
    F32(Vec<f32>),
}

impl Samples {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::U16(samples) => samples.len(),
            Self::F32(samples) => samples.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Copies `range` to `into`, which must be as long.
    #[inline]
    pub fn copy_to(&self, range: Range<usize>, into: &mut [f32]) {
        match self {
            Self::U16(samples) => {
                for (to, from) in into.iter_mut().zip(&samples[range]) {
                    *to = f32::from(*from);
                }
            }
            Self::F32(samples) => into.copy_from_slice(&samples[range]),
        }
    }

    /// All of them as `f32`, which holds every 16-bit number exactly.
    pub fn to_f32(&self) -> Vec<f32> {
        let mut all = vec![0.0; self.len()];
        self.copy_to(0..self.len(), &mut all);
        all
    }

    /// The memory of samples of 16 bits, for the next ones; none of others.
    pub fn into_memory(self) -> Vec<u16> {
        match self {
            Self::U16(samples) => samples.memory,
            Self::F32(_) => vec![],
        }
    }

    /// Variance that rounding to whole numbers adds, DN².
    pub fn rounding_variance(&self) -> f64 {
        match self {
            Self::U16(_) => 1.0 / 12.0,
            Self::F32(_) => 0.0,
        }
    }
}

impl From<Vec<u16>> for Samples {
    fn from(samples: Vec<u16>) -> Self {
        Self::U16(samples.into())
    }
}

/// Counts in a row, perhaps among the rest of the file that they came in: most files of plain
/// counts hold them as the machine does, and to copy them costs as much as to merge them.
#[derive(Clone, Debug)]
pub struct Counts {
    memory: Vec<u16>,
    place: Range<usize>,
}

impl Counts {
    /// The counts that stand at `place` of `memory`.
    ///
    /// # Panics
    ///
    /// The place reaches beyond the memory.
    pub fn within(memory: Vec<u16>, place: Range<usize>) -> Self {
        assert!(place.start <= place.end && place.end <= memory.len());
        Self { memory, place }
    }
}

impl From<Vec<u16>> for Counts {
    fn from(memory: Vec<u16>) -> Self {
        let place = 0..memory.len();
        Self { memory, place }
    }
}

impl Deref for Counts {
    type Target = [u16];

    #[inline]
    fn deref(&self) -> &[u16] {
        &self.memory[self.place.clone()]
    }
}

impl DerefMut for Counts {
    #[inline]
    fn deref_mut(&mut self) -> &mut [u16] {
        &mut self.memory[self.place.clone()]
    }
}

impl PartialEq for Counts {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

/// Names of the channels of a frame with `count` of them: `Y`, or `R`, `G`, `B`, or the photosites
/// of a [`crate::Mosaic`]'s cell.
pub fn channel_names(count: usize) -> &'static [&'static str] {
    match count {
        1 => &["Y"],
        4 | 16 | 36 => &PHOTOSITES[..count],
        _ => &["R", "G", "B"],
    }
}

/// The photosites of a cell, row by row.
const PHOTOSITES: [&str; 36] = [
    "site 1", "site 2", "site 3", "site 4", "site 5", "site 6", "site 7", "site 8", "site 9",
    "site 10", "site 11", "site 12", "site 13", "site 14", "site 15", "site 16", "site 17",
    "site 18", "site 19", "site 20", "site 21", "site 22", "site 23", "site 24", "site 25",
    "site 26", "site 27", "site 28", "site 29", "site 30", "site 31", "site 32", "site 33",
    "site 34", "site 35", "site 36",
];

/// How a linear sensor turns electrons into data numbers (DN).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Electrons per data number.
    pub gain_e_per_dn: f64,
    /// Standard deviation of one read-out, electrons.
    pub read_noise_e: f64,
    /// Data number that no light at all gives.
    pub black_level_dn: f64,
    /// Data number at and above which a sample is saturated.
    pub white_level_dn: f64,
    /// Standard deviation of the pixels' relative sensitivity (photo-response non-uniformity).
    pub prnu_relative: f64,
}

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

    /// How the samples were rounded when they were stored, as they show it themselves.
    ///
    /// They are looked through until some show that nothing was rounded, or not so coarsely.
    pub fn rounding(&self) -> Rounding {
        let samples = match self {
            Self::U16(counts) => return Rounding::of_counts(counts),
            Self::F32(samples) => samples,
        };
        let (mut whole, mut half, mut largest) = (true, true, 0.0_f32);
        for block in samples.chunks(4096) {
            for sample in block {
                whole &= *sample == sample.trunc();
                half &= sample.to_bits() & BELOW_HALF == 0;
                largest = largest.max(sample.abs());
            }
            if !whole && !half {
                break;
            }
        }
        Rounding {
            // The 0 and 1 of a mask, or of full and empty pixels, are no counts.
            step_dn: u16::from(whole && largest >= LEAST_COUNT),
            half: half && largest > 0.0,
        }
    }
}

/// Bits of an `f32` that a half-precision number does not have.
const BELOW_HALF: u32 = (1 << 13) - 1;

/// The least largest sample of a frame of counts, DN.
const LEAST_COUNT: f32 = 64.0;

/// How many counts there are, and how many steps lie between the smallest and the largest of them,
/// from where a step that they share is no chance.
const ENOUGH: usize = 256;
const LEAST_STEPS: u16 = 64;

/// What was taken off samples when they were stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rounding {
    /// All are multiples of it, DN: 1 for whole numbers, 16 for 12-bit counts in the high bits of
    /// 16, 0 for others.
    pub step_dn: u16,
    /// They have the 11 significant bits of a half-precision number (IEEE 754 binary16).
    pub half: bool,
}

impl Rounding {
    /// That of counts.
    pub const WHOLE: Self = Self {
        step_dn: 1,
        half: false,
    };

    fn of_counts(counts: &[u16]) -> Self {
        let mut bits = 0;
        for block in counts.chunks(4096) {
            bits |= block.iter().fold(0, |all, count| all | count);
            if bits & 1 == 1 {
                return Self::WHOLE;
            }
        }
        let step_dn = 1_u16.checked_shl(bits.trailing_zeros()).unwrap_or(1);
        let least = counts.iter().min().copied().unwrap_or(0);
        let most = counts.iter().max().copied().unwrap_or(0);
        // A few even numbers are no sign of coarse ones.
        if counts.len() < ENOUGH || (most - least) / step_dn < LEAST_STEPS {
            return Self::WHOLE;
        }
        Self {
            step_dn,
            half: false,
        }
    }

    /// Variance that it adds to a sample of about `level_dn`, DN²: that of a number which may lie
    /// anywhere between two that can be stored, a twelfth of their distance squared.
    pub fn variance(&self, level_dn: f64) -> f64 {
        let even = f64::from(self.step_dn);
        let step = if self.half {
            even.max(half_step(level_dn))
        } else {
            even
        };
        step * step / 12.0
    }
}

/// Distance of the half-precision numbers about `level`, which are as near at 0 as at 2⁻¹⁴.
fn half_step(level: f64) -> f64 {
    // The exponent stands in the bits of a float: no logarithm, which may be off by a rounding.
    let exponent = (level.to_bits() >> 52 & 0x7ff) as i32 - 1023;
    f64::from(exponent.max(-14) - 10).exp2()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_show_how_they_were_rounded() {
        let none = Rounding::default();
        let half = Rounding { half: true, ..none };
        let both = Rounding {
            step_dn: 1,
            half: true,
        };
        for (samples, expected) in [
            (vec![100.5, 0.1], none),
            (vec![100.5, 0.125], half),
            (vec![-0.5, 2050.0], half),
            (vec![0.0, 0.0], none),
            (vec![0.0, 1.0], half),
            (vec![1000.0, 2050.0], both),
            (vec![1000.0, 2049.0], Rounding::WHOLE),
        ] {
            let found = Samples::F32(samples.clone()).rounding();
            assert_eq!(found, expected, "{samples:?}");
        }
        let counts = |step: u16, most: u16| -> Samples {
            (0..=most).map(|k| k * step).collect::<Vec<_>>().into()
        };
        let sixteen = Rounding {
            step_dn: 16,
            ..none
        };
        for (samples, expected) in [
            (counts(1, 300), Rounding::WHOLE),
            (counts(16, 300), sixteen),
            (counts(16, 30), Rounding::WHOLE),
            (vec![0].into(), Rounding::WHOLE),
            (vec![4096; 500].into(), Rounding::WHOLE),
            (vec![0, 4096].into(), Rounding::WHOLE),
        ] {
            assert_eq!(samples.rounding(), expected, "{samples:?}");
        }
    }

    #[test]
    fn halves_are_farther_apart_where_they_are_larger() {
        let half = Rounding {
            step_dn: 0,
            half: true,
        };
        let step = |level: f64| (12.0 * half.variance(level)).sqrt();
        for (level, expected) in [
            (1.0, 2_f64.powi(-10)),
            (-1.99, 2_f64.powi(-10)),
            (2.0, 2_f64.powi(-9)),
            (2047.9, 1.0),
            (2048.0, 2.0),
            (65_504.0, 32.0),
            (0.0, 2_f64.powi(-24)),
        ] {
            let found = step(level);
            assert!((found / expected - 1.0).abs() < 1e-12, "{level}: {found}");
        }
        let both = Rounding {
            step_dn: 1,
            half: true,
        };
        assert_eq!((12.0 * both.variance(10.0)).sqrt(), 1.0);
        assert_eq!(Rounding::default().variance(1e4), 0.0);
    }
}

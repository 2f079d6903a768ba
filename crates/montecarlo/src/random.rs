//! Random numbers: one stream for each photon, named by the seed and the photon's number.
//!
//! No stream belongs to a thread, a lane or a block, so the assignment of randomness to photons
//! depends on nothing that a machine may choose.

use physics::lanes::Stream32;

/// A bijection of 64 bits whose output shows no trace of the order of its input.
///
/// # Source
///
/// `SplitMix64`, Steele, Lea and Flood (2014), with Stafford's constants (variant 13).
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Four words from which the stream of `photon` starts, different for every photon of a seed.
fn start(seed: u64, photon: u64) -> [u64; 4] {
    let first = mix(mix(seed.wrapping_add(GOLDEN)) ^ mix(photon.wrapping_add(GOLDEN)));
    [0_u64, 1, 2, 3].map(|k| mix(first.wrapping_add(k.wrapping_mul(GOLDEN))))
}

/// The generator of the scalar walk: 64 bits a draw.
///
/// # Source
///
/// xoshiro256++, Blackman and Vigna (2021).
pub(crate) struct Stream64([u64; 4]);

/// Uniform numbers in [0, 1).
pub(crate) trait Uniform {
    /// The next one.
    fn uniform(&mut self) -> f64;
}

impl Stream64 {
    pub(crate) fn new(seed: u64, photon: u64) -> Self {
        Self(start(seed, photon))
    }
}

impl Uniform for Stream64 {
    fn uniform(&mut self) -> f64 {
        let s = &mut self.0;
        let out = s[0].wrapping_add(s[3]).rotate_left(23).wrapping_add(s[0]);
        let t = s[1] << 17;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= t;
        s[3] = s[3].rotate_left(45);
        (out >> 11) as f64 * (0.5_f64).powi(53)
    }
}

/// The generator of a photon's lane.
pub(crate) fn lane(seed: u64, photon: u64) -> Stream32 {
    let [a, b, ..] = start(seed, photon);
    Stream32::new([a, b])
}

impl Uniform for Stream32 {
    fn uniform(&mut self) -> f64 {
        f64::from(self.bits()) * (0.5_f64).powi(32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first outputs of the authors' C program from the state 1, 2, 3, 4.
    #[test]
    fn the_generator_is_the_published_one() {
        let mut scalar = Stream64([1, 2, 3, 4]);
        let expected = [
            41_943_041_u64,
            58_720_359,
            3_588_806_011_781_223,
            3_591_011_842_654_386,
        ];
        for bits in expected {
            assert_eq!(scalar.uniform(), (bits >> 11) as f64 * 0.5_f64.powi(53));
        }
    }

    #[test]
    fn neighbouring_photons_have_nothing_in_common() {
        // Mean and correlation of the first numbers of neighbours, within four standard errors.
        let n = 100_000;
        let first: Vec<f64> = (0..n)
            .map(|photon| lane(1, photon).uniform() - 0.5)
            .collect();
        let mean = first.iter().sum::<f64>() / n as f64;
        let pairs = first.windows(2).map(|pair| pair[0] * pair[1] * 12.0);
        let correlation = pairs.sum::<f64>() / n as f64;
        assert!(
            mean.abs() < 0.004 && correlation.abs() < 0.013,
            "{mean}, {correlation}"
        );
    }
}

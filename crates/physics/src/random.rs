//! Random streams: one for each purpose, named by a seed and by what it is used for.
//!
//! No stream belongs to a thread, so what is drawn depends on nothing that a machine may choose.
//! (Photons of `montecarlo` name theirs by their number.)

use crate::lanes::Stream32;
use rand::Rng;
use rand_pcg::Pcg64Mcg;

/// A stream of random bits.
pub type Stream = Pcg64Mcg;

/// Finaliser of splitmix64 (Steele, Lea and Flood 2014): every input bit moves every output bit.
fn mix(word: u64) -> u64 {
    let word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}

/// Two words that `seed` and an `identity` name.
fn words(seed: u64, identity: &[u64]) -> [u64; 2] {
    let golden = 0x9e37_79b9_7f4a_7c15;
    [0, golden].map(|start| {
        identity.iter().fold(mix(seed ^ start), |state, word| {
            mix(state.wrapping_add(golden) ^ mix(word.wrapping_add(golden)))
        })
    })
}

/// The stream that belongs to `seed` and to the `identity` of what it is used for.
pub fn stream(seed: u64, identity: &[u64]) -> Stream {
    let [high, low] = words(seed, identity);
    Pcg64Mcg::new(u128::from(high) << 64 | u128::from(low))
}

/// The stream for a lane, by the same names.
pub fn lane(seed: u64, identity: &[u64]) -> Stream32 {
    Stream32::new(words(seed, identity))
}

/// A draw from the even distribution over [0, 1).
#[inline]
pub fn uniform(rng: &mut Stream) -> f64 {
    (rng.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_by_every_word() {
        let first = |seed, identity: &[u64]| stream(seed, identity).next_u64();
        let base = first(1, &[2, 3]);
        for other in [
            first(2, &[2, 3]),
            first(1, &[3, 2]),
            first(1, &[2, 4]),
            first(1, &[2, 3, 0]),
        ] {
            assert_ne!(base, other);
        }
        assert_eq!(base, first(1, &[2, 3]));
    }
}

//! Which instructions a loop over lanes runs on, chosen at run time.
//!
//! A loop is written once, over arrays of fixed length and without a branch, so that the compiler
//! turns it into vector instructions, and compiled for each instruction set.

use pulp::NullaryFnOnce;
use std::sync::LazyLock;

/// An instruction path of a loop over lanes.
///
/// Results on one path repeat to the byte, on any machine that has it; across paths they agree
/// statistically (fused multiply-adds round once where the portable path rounds twice).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SimdPath {
    /// What every processor of the target architecture has.
    Portable,
    /// AVX2 with FMA: 8 lanes a register.
    Avx2,
    /// AVX-512: 16 lanes a register.
    Avx512,
}

impl SimdPath {
    /// Every path, slowest first.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// Whether this processor has it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => pulp::x86::V3::try_new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => pulp::x86::V4::try_new().is_some(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// The fastest path that this processor has.
    pub fn best() -> Self {
        // Asked once: a loop over a few lanes is over before the question is.
        static BEST: LazyLock<SimdPath> = LazyLock::new(|| {
            let mut available = SimdPath::ALL.into_iter().rev();
            available
                .find(|path| path.is_available())
                .unwrap_or(SimdPath::Portable)
        });
        *BEST
    }

    /// Its name, as users type it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// The path of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|path| path.name() == name)
    }

    /// Runs a loop over lanes on this path, or on the portable one where the processor lacks it.
    pub fn run<L: LaneLoop>(self, lanes: L) -> L::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if let Some(simd) = pulp::x86::V4::try_new() => {
                simd.vectorize(Compiled::<_, true>(lanes))
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 if let Some(simd) = pulp::x86::V3::try_new() => {
                simd.vectorize(Compiled::<_, true>(lanes))
            }
            _ => Compiled::<_, false>(lanes).call(),
        }
    }
}

/// A loop over lanes, to be compiled for each path.
pub trait LaneLoop {
    /// What it returns.
    type Output;

    /// The loop, with fused multiply-adds if the path has them. Always inlined.
    fn run<const FMA: bool>(self) -> Self::Output;
}

/// The form that `pulp` compiles for an instruction set.
struct Compiled<L, const FMA: bool>(L);

impl<L: LaneLoop, const FMA: bool> NullaryFnOnce for Compiled<L, FMA> {
    type Output = L::Output;

    #[inline(always)]
    fn call(self) -> L::Output {
        self.0.run::<FMA>()
    }
}

/// `a`·`b` + `c`, in one rounding where the instruction set has it: without, a fused
/// multiply-add would be a call of the library.
#[inline(always)]
pub fn fma<const FMA: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

/// e^`x` for `x` from −708 to 709, which is what it is held to. Relative error below 3e-16.
///
/// Without a branch: 2^n · e^r with |r| at most ½ ln 2, and Taylor's polynomial of degree 13.
#[inline(always)]
pub fn exp<const FMA: bool>(x: f64) -> f64 {
    // Adding it rounds to a whole number, which its lowest bits then hold.
    const ROUNDING: f64 = 6_755_399_441_055_744.0;
    const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let x = if x > -708.0 { x } else { -708.0 };
    let x = if x < 709.0 { x } else { 709.0 };
    let shifted = fma::<FMA>(x, std::f64::consts::LOG2_E, ROUNDING);
    let n = shifted - ROUNDING;
    let r = fma::<FMA>(n, -LN_2_LOW, fma::<FMA>(n, -LN_2_HIGH, x));
    // Pairs and pairs of pairs, so that the chain is short.
    let r2 = r * r;
    let r4 = r2 * r2;
    let r8 = r4 * r4;
    let pair = |low: f64, high: f64| fma::<FMA>(high, r, low);
    let low = fma::<FMA>(
        fma::<FMA>(pair(1.0 / 120.0, 1.0 / 720.0), r, 1.0 / 24.0),
        r,
        1.0 / 6.0,
    );
    let low = fma::<FMA>(low, r, 0.5);
    let middle = fma::<FMA>(
        pair(1.0 / 362_880.0, 1.0 / 3_628_800.0),
        r2,
        pair(1.0 / 5_040.0, 1.0 / 40_320.0),
    );
    let high = fma::<FMA>(
        pair(1.0 / 6_227_020_800.0, 1.0 / 87_178_291_200.0),
        r2,
        pair(1.0 / 39_916_800.0, 1.0 / 479_001_600.0),
    );
    let tail = fma::<FMA>(middle, r4 * r, fma::<FMA>(high, r8 * r, low));
    let p = fma::<FMA>(tail, r2, r) + 1.0;
    f64::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 52))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_that_of_the_library() {
        let check = |x: f64| {
            let expected = x.exp();
            for got in [exp::<false>(x), exp::<true>(x)] {
                assert!(
                    (got / expected - 1.0).abs() < 5e-16,
                    "{x}: {got}, {expected}"
                );
            }
        };
        for i in 0..200_000 {
            check(-708.0 + 1416.0 * f64::from(i) / 200_000.0);
            check(-1.0 + f64::from(i) / 100_000.0);
        }
        assert!((exp::<true>(0.0) - 1.0).abs() == 0.0);
        assert!(exp::<true>(f64::NEG_INFINITY) < 1e-307);
    }
}

//! Random walks in lanes of single precision: what a loop over photons needs, without a branch.
//!
//! Each function is for one lane; called in a loop over arrays of [`WIDTH`] that [`crate::simd`] runs,
//! the compiler makes vector instructions of it.

/// Lanes in a chunk: what one AVX-512 register holds. A constant of the format of results, not of
/// the processor.
pub const WIDTH: usize = 16;

/// A number for each lane.
pub type Floats = [f32; WIDTH];
/// A word for each lane.
pub type Words = [u32; WIDTH];

/// The generator of one lane: 32 bits a draw.
///
/// # Source
///
/// xoshiro128++, Blackman and Vigna (2021).
#[derive(Clone, Copy, Debug)]
pub struct Stream32(pub [u32; 4]);

impl Stream32 {
    /// The stream that two words of good randomness name.
    pub fn new([a, b]: [u64; 2]) -> Self {
        // The lowest bit of the last word keeps the state away from all zeros.
        Self([a as u32, (a >> 32) as u32, b as u32, (b >> 32) as u32 | 1])
    }

    /// The next 32 bits.
    #[inline(always)]
    pub fn bits(&mut self) -> u32 {
        let s = &mut self.0;
        let out = s[0].wrapping_add(s[3]).rotate_left(7).wrapping_add(s[0]);
        let t = s[1] << 9;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= t;
        s[3] = s[3].rotate_left(11);
        out
    }
}

/// a·b + c, in one rounding where the instruction set has it.
#[inline(always)]
pub fn fma<const FMA: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

/// All bits of `condition`.
#[inline(always)]
pub fn mask(condition: bool) -> u32 {
    0_u32.wrapping_sub(u32::from(condition))
}

/// `a` where the mask is set, else `b`.
///
/// Bits instead of an `if`, which the compiler would make a branch around all that only one side
/// needs.
#[inline(always)]
pub fn choose(mask: u32, a: f32, b: f32) -> f32 {
    f32::from_bits((a.to_bits() & mask) | (b.to_bits() & !mask))
}

/// ln `x` of a normal positive number.
///
/// Relative error below 2e-7, near 1 that of ln x to x − 1.
///
/// # Source
///
/// The polynomial of `logf` in Moshier's Cephes library.
#[inline(always)]
pub fn ln<const FMA: bool>(x: f32) -> f32 {
    // x = m·2^e with m in [√½, √2).
    let shifted = x.to_bits().wrapping_sub(0x3f35_04f3) as i32;
    let e = shifted >> 23;
    let m = f32::from_bits(((shifted & 0x007f_ffff) as u32).wrapping_add(0x3f35_04f3)) - 1.0;
    let m2 = m * m;
    let mut p = 7.037_683_6e-2;
    p = fma::<FMA>(p, m, -1.151_461e-1);
    p = fma::<FMA>(p, m, 1.167_699_9e-1);
    p = fma::<FMA>(p, m, -1.242_014_1e-1);
    p = fma::<FMA>(p, m, 1.424_932_3e-1);
    p = fma::<FMA>(p, m, -1.666_805_8e-1);
    p = fma::<FMA>(p, m, 2.000_071_5e-1);
    p = fma::<FMA>(p, m, -2.499_999_4e-1);
    p = fma::<FMA>(p, m, 3.333_333e-1);
    let tail = fma::<FMA>(p * m, m2, -0.5 * m2);
    fma::<FMA>(e as f32, std::f32::consts::LN_2, m + tail)
}

/// −ln u for a uniform u in (0, 1), from 32 random bits. Never 0.
///
/// Relative error below 2e-7.
#[inline(always)]
pub fn minus_ln<const FMA: bool>(bits: u32) -> f32 {
    // Half a step above the lowest value, and never as high as 1: a step of length 0 would
    // scatter in a clear layer.
    let u = fma::<FMA>(
        (bits >> 1) as i32 as f32,
        1.0 / 2_147_483_648.0,
        0.25 / 2_147_483_648.0,
    );
    let u = if u < 0.999_999_94 { u } else { 0.999_999_94 };
    -ln::<FMA>(u)
}

/// Cosine and sine of a uniform angle, from 32 random bits.
///
/// The angle is drawn from half a circle; one more bit chooses the other half. Error below 2e-7.
///
/// # Source
///
/// The polynomials of `XMScalarSinCos` in Microsoft's DirectXMath.
#[inline(always)]
pub fn random_direction<const FMA: bool>(bits: u32) -> (f32, f32) {
    let t = bits as i32 as f32 * (std::f32::consts::FRAC_PI_2 / 2_147_483_648.0);
    let t2 = t * t;
    let mut s = fma::<FMA>(-2.388_985_9e-8, t2, 2.752_556_2e-6);
    s = fma::<FMA>(s, t2, -1.984_087_4e-4);
    s = fma::<FMA>(s, t2, 8.333_331e-3);
    s = fma::<FMA>(s, t2, -1.666_666_7e-1);
    s = fma::<FMA>(s * t2, t, t);
    let mut c = fma::<FMA>(-2.605_161_5e-7, t2, 2.476_049_5e-5);
    c = fma::<FMA>(c, t2, -1.388_837_8e-3);
    c = fma::<FMA>(c, t2, 4.166_663_8e-2);
    c = fma::<FMA>(c, t2, -0.5);
    c = fma::<FMA>(c, t2, 1.0);
    (f32::from_bits(c.to_bits() ^ (bits << 31)), s)
}

/// A uniform number in [0, 1), from 32 random bits.
#[inline(always)]
pub fn uniform(bits: u32) -> f32 {
    (bits >> 8) as i32 as f32 * (1.0 / 16_777_216.0)
}

/// 1 − cos θ of Henyey and Greenstein's phase function at the share `xi` of its distribution.
///
/// The usual inverse, multiplied out: it loses no digit forward, backward or at g = 0.
#[inline(always)]
pub fn henyey_greenstein<const FMA: bool>(g: f32, xi: f32) -> f32 {
    let back = 1.0 - g;
    let chord = fma::<FMA>(2.0 * g, xi, back);
    let ratio = back / chord;
    2.0 * ratio * ratio * (1.0 - xi) * fma::<FMA>(g, xi, 1.0)
}

/// The direction at 1 − cos θ = `turn` and cosine and sine of an azimuth from the z axis: as good as
/// from any, where light scatters evenly.
#[inline(always)]
pub fn turned_anyhow(turn: f32, azimuth: (f32, f32)) -> (f32, f32, f32) {
    let sin = (turn * (2.0 - turn)).sqrt();
    (sin * azimuth.0, sin * azimuth.1, 1.0 - turn)
}

/// The direction at 1 − cos θ = `turn` and cosine and sine of an azimuth from another.
#[inline(always)]
pub fn turned<const FMA: bool>(axis: [f32; 3], turn: f32, azimuth: (f32, f32)) -> (f32, f32, f32) {
    let (a, b, cos) = turned_anyhow(turn, azimuth);
    unit::<FMA>(along_axis::<FMA>(axis, [a, b, cos]))
}

/// A direction whose length is 1 but for rounding, made so again: one step of Newton's keeps rounding
/// from adding up over thousands of scatterings.
#[inline(always)]
pub fn unit<const FMA: bool>((x, y, z): (f32, f32, f32)) -> (f32, f32, f32) {
    let norm2 = fma::<FMA>(x, x, fma::<FMA>(y, y, z * z));
    let scale = fma::<FMA>(-0.5, norm2, 1.5);
    (x * scale, y * scale, z * scale)
}

/// A vector that is given in a frame whose third axis is `axis`.
///
/// # Source
///
/// Duff et al. (2017): an orthonormal basis without a special case at the poles.
#[inline(always)]
pub fn along_axis<const FMA: bool>([ux, uy, uz]: [f32; 3], [a, b, c]: [f32; 3]) -> (f32, f32, f32) {
    let sign = 1.0_f32.copysign(uz);
    let h = -1.0 / (sign + uz);
    let k = ux * uy * h;
    let p = fma::<FMA>(ux * ux * sign, h, 1.0);
    let q = fma::<FMA>(uy * uy, h, sign);
    (
        fma::<FMA>(a, p, fma::<FMA>(b, k, c * ux)),
        fma::<FMA>(a, sign * k, fma::<FMA>(b, q, c * uy)),
        fma::<FMA>(-a, sign * ux, fma::<FMA>(-b, uy, c * uz)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Phase;

    /// Bits from end to end of their range.
    fn bits() -> impl Iterator<Item = u32> {
        let ends = [0, 1, 2, 3, 1 << 31, u32::MAX - 1, u32::MAX];
        ends.into_iter()
            .chain((0..200_000_u32).map(|k| k.wrapping_mul(2_654_435_761)))
    }

    /// The first outputs of the authors' C program from the state 1, 2, 3, 4.
    #[test]
    fn the_generator_is_the_published_one() {
        let mut lane = Stream32([1, 2, 3, 4]);
        let expected = [641, 1_573_767, 3_222_811_527, 3_517_856_514, 836_907_274];
        assert_eq!(expected.map(|_| lane.bits()), expected);
    }

    #[test]
    fn the_logarithm_is_good_to_single_precision_and_never_zero() {
        for b in bits() {
            let u = (f64::from(b >> 1) as f32 + 0.25) / 2_147_483_648.0;
            let expected = -f64::from(u.min(0.999_999_94)).ln();
            for got in [minus_ln::<false>(b), minus_ln::<true>(b)] {
                assert!(got > 0.0, "{b}");
                let error = (f64::from(got) / expected - 1.0).abs();
                assert!(error < 3e-7, "{b}: {got} for {expected}");
            }
        }
    }

    #[test]
    fn directions_go_all_the_way_round() {
        let mut quadrants = [0_u32; 4];
        for b in bits() {
            let (cos, sin) = random_direction::<true>(b);
            let angle = f64::from(b as i32) * std::f64::consts::FRAC_PI_2 / 2_147_483_648.0;
            let sign = if b & 1 == 0 { 1.0 } else { -1.0 };
            let error = (f64::from(sin) - angle.sin()).hypot(f64::from(cos) - sign * angle.cos());
            assert!(error < 3e-7, "{b}: {cos}, {sin}");
            quadrants[usize::from(cos < 0.0) + 2 * usize::from(sin < 0.0)] += 1;
        }
        // A quarter of 200,000 each, within five standard errors.
        assert!(
            quadrants.iter().all(|&n| n.abs_diff(50_000) < 1_000),
            "{quadrants:?}"
        );
    }

    #[test]
    fn scattering_angles_are_those_of_the_definition() {
        for g in [-0.9, -0.3, 0.0, 0.5, 0.95] {
            for b in bits() {
                let xi = uniform(b);
                let phase = Phase::HenyeyGreenstein { g: f64::from(g) };
                let expected = phase.one_minus_cos(f64::from(xi));
                let got = f64::from(henyey_greenstein::<true>(g, xi));
                // 1 − g + 2gξ loses up to 1/(1 − |g|) of its precision.
                assert!(
                    (got - expected).abs() < 5e-6 * expected + 1e-12,
                    "{g}, {xi}: {got}"
                );
            }
        }
    }
}

//! The hot loop: one step and one scattering of every photon in a chunk of lanes.
//!
//! It is written once, over arrays of fixed length and without a branch, and compiled by
//! [`crate::path`] for each instruction set. Whatever is rare (a boundary, a roulette, an exit) is
//! only marked here and dealt with in [`crate::lanes`].

use crate::random::Stream32;

/// Lanes in a chunk: what one AVX-512 register holds. A constant of the format of results, not of
/// the processor.
pub(crate) const WIDTH: usize = 16;

pub(crate) type Floats = [f32; WIDTH];
type Words = [u32; WIDTH];

/// The mark of a lane whose photon would leave its layer, and of one past a limit. Tables, because
/// a checked shift in the hot loop would keep it out of vector registers.
const LEAVING: Words = marks(0);
const EXPIRING: Words = marks(WIDTH);

const fn marks(first: usize) -> Words {
    let mut marks = [0; WIDTH];
    let mut i = 0;
    while i < WIDTH {
        marks[i] = 1 << (first + i);
        i += 1;
    }
    marks
}

/// How the scattering angle is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scattering {
    /// Every layer scatters evenly: the old direction does not matter.
    Isotropic,
    /// Henyey and Greenstein, each lane with its g.
    HenyeyGreenstein,
    /// From [`Chunk::one_minus_cos`], which the caller has filled.
    Given,
}

/// The photons of a chunk of lanes, by quantity. Lengths in mm.
#[repr(C, align(64))]
#[derive(Clone)]
pub(crate) struct Chunk {
    pub(crate) x: Floats,
    pub(crate) y: Floats,
    /// Depth below the top of the photon's layer, which keeps it precise however deep that lies.
    pub(crate) z: Floats,
    pub(crate) ux: Floats,
    pub(crate) uy: Floats,
    pub(crate) uz: Floats,
    /// −ln of the photon's weight: absorption gathered on the way, and the loss on entry.
    pub(crate) depth: Floats,
    /// Path length so far, mm.
    pub(crate) path: Floats,
    /// 1/σₛ of the photon's layer, huge in a clear one.
    pub(crate) mean_free_path: Floats,
    pub(crate) sigma_a: Floats,
    pub(crate) thickness: Floats,
    pub(crate) g: Floats,
    /// Times scattered.
    pub(crate) order: Words,
    pub(crate) random: [Words; 4],
    /// 1 − cos θ of the next scattering, for [`Scattering::Given`].
    pub(crate) one_minus_cos: Floats,
    /// For lane i, bit i if its step would leave the layer, where it has not moved, and bit
    /// `WIDTH` + i if it is past a limit.
    marks: Words,
    /// The marks of all lanes.
    pub(crate) marked: u32,
}

/// Where photons were, and for how long they flew, for tallies along the way.
#[repr(C, align(64))]
#[derive(Clone)]
pub(crate) struct Flight {
    pub(crate) x: Floats,
    pub(crate) y: Floats,
    pub(crate) z: Floats,
    pub(crate) ux: Floats,
    pub(crate) uy: Floats,
    pub(crate) uz: Floats,
    pub(crate) depth: Floats,
    /// Length flown, mm; 0 if the step would have left the layer.
    pub(crate) length: Floats,
}

impl Flight {
    pub(crate) const NONE: Self = Self {
        x: [0.0; WIDTH],
        y: [0.0; WIDTH],
        z: [0.0; WIDTH],
        ux: [0.0; WIDTH],
        uy: [0.0; WIDTH],
        uz: [0.0; WIDTH],
        depth: [0.0; WIDTH],
        length: [0.0; WIDTH],
    };
}

impl Chunk {
    /// Lanes without a photon: black holes from which nothing ever comes.
    pub(crate) const EMPTY: Self = Self {
        x: [0.0; WIDTH],
        y: [0.0; WIDTH],
        z: [0.0; WIDTH],
        ux: [0.0; WIDTH],
        uy: [0.0; WIDTH],
        uz: [0.0; WIDTH],
        depth: [0.0; WIDTH],
        path: [0.0; WIDTH],
        mean_free_path: [0.0; WIDTH],
        sigma_a: [0.0; WIDTH],
        thickness: [f32::INFINITY; WIDTH],
        g: [0.0; WIDTH],
        order: [0; WIDTH],
        random: [[0; WIDTH]; 4],
        one_minus_cos: [0.0; WIDTH],
        marks: [0; WIDTH],
        marked: 0,
    };
}

/// One photon of a chunk.
#[derive(Clone, Copy)]
pub(crate) struct Lane {
    floats: [f32; 12],
    order: u32,
    random: [u32; 4],
}

impl Chunk {
    /// The photon in lane `i`.
    pub(crate) fn lane(&self, i: usize) -> Lane {
        let floats = [
            self.x[i],
            self.y[i],
            self.z[i],
            self.ux[i],
            self.uy[i],
            self.uz[i],
            self.depth[i],
            self.path[i],
            self.mean_free_path[i],
            self.sigma_a[i],
            self.thickness[i],
            self.g[i],
        ];
        Lane {
            floats,
            order: self.order[i],
            random: self.random.map(|word| word[i]),
        }
    }

    /// Puts a photon into lane `i`.
    pub(crate) fn set_lane(&mut self, i: usize, lane: &Lane) {
        [
            self.x[i],
            self.y[i],
            self.z[i],
            self.ux[i],
            self.uy[i],
            self.uz[i],
            self.depth[i],
            self.path[i],
            self.mean_free_path[i],
            self.sigma_a[i],
            self.thickness[i],
            self.g[i],
        ] = lane.floats;
        self.order[i] = lane.order;
        for (word, state) in self.random.iter_mut().zip(lane.random) {
            word[i] = state;
        }
    }
}

/// Limits beyond which a photon is no longer followed for nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// −ln of the weight below which roulette is played.
    pub(crate) depth: f32,
    /// Path length at which photons are dropped, mm.
    pub(crate) path: f32,
}

/// a·b + c, in one rounding where the instruction set has it.
#[inline(always)]
fn fma<const FMA: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

/// All bits of `condition`.
#[inline(always)]
fn mask(condition: bool) -> u32 {
    0_u32.wrapping_sub(u32::from(condition))
}

/// `a` where the mask is set, else `b`.
///
/// Bits instead of an `if`, which the compiler would make a branch around all that only one side
/// needs.
#[inline(always)]
fn choose(mask: u32, a: f32, b: f32) -> f32 {
    f32::from_bits((a.to_bits() & mask) | (b.to_bits() & !mask))
}

/// −ln u for a uniform u in (0, 1), from 32 random bits. Never 0.
///
/// Relative error below 2e-7.
///
/// # Source
///
/// The polynomial of `logf` in Moshier's Cephes library.
#[inline(always)]
pub(crate) fn minus_ln<const FMA: bool>(bits: u32) -> f32 {
    // Half a step above the lowest value, and never as high as 1: a step of length 0 would
    // scatter in a clear layer.
    let u = fma::<FMA>(
        (bits >> 1) as i32 as f32,
        1.0 / 2_147_483_648.0,
        0.25 / 2_147_483_648.0,
    );
    let u = if u < 0.999_999_94 { u } else { 0.999_999_94 };
    // u = m·2^e with m in [√½, √2).
    let shifted = u.to_bits().wrapping_sub(0x3f35_04f3) as i32;
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
    fma::<FMA>(e as f32, -std::f32::consts::LN_2, -(m + tail))
}

/// Cosine and sine of a uniform angle, from 32 random bits.
///
/// The angle is drawn from half a circle; one more bit chooses the other half. Error below 2e-7.
///
/// # Source
///
/// The polynomials of `XMScalarSinCos` in Microsoft's DirectXMath.
#[inline(always)]
pub(crate) fn random_direction<const FMA: bool>(bits: u32) -> (f32, f32) {
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
pub(crate) fn uniform(bits: u32) -> f32 {
    (bits >> 8) as i32 as f32 * (1.0 / 16_777_216.0)
}

/// 1 − cos θ of Henyey and Greenstein's phase function at the share `xi` of its distribution.
///
/// The usual inverse, multiplied out: it loses no digit forward, backward or at g = 0.
#[inline(always)]
fn henyey_greenstein<const FMA: bool>(g: f32, xi: f32) -> f32 {
    let back = 1.0 - g;
    let chord = fma::<FMA>(2.0 * g, xi, back);
    let ratio = back / chord;
    2.0 * ratio * ratio * (1.0 - xi) * fma::<FMA>(g, xi, 1.0)
}

/// One step and one scattering of every lane.
///
/// A lane whose step would leave its layer stays as it was and is marked: after the boundary it
/// draws a fresh step, which is the same law, since an exponential forgets.
#[inline(always)]
pub(crate) fn advance<const FMA: bool, const SCATTERING: u8, const FLIGHT: bool>(
    chunk: &mut Chunk,
    limits: Limits,
    flight: &mut Flight,
) {
    for i in 0..WIDTH {
        let mut stream = Stream32([
            chunk.random[0][i],
            chunk.random[1][i],
            chunk.random[2][i],
            chunk.random[3][i],
        ]);
        let free = minus_ln::<FMA>(stream.next()) * chunk.mean_free_path[i];
        let (ux, uy, uz) = (chunk.ux[i], chunk.uy[i], chunk.uz[i]);
        let z = fma::<FMA>(uz, free, chunk.z[i]);
        let leaves = (z < 0.0) | (z > chunk.thickness[i]);
        let left = mask(leaves);
        let length = choose(left, 0.0, free);

        if FLIGHT {
            flight.x[i] = chunk.x[i];
            flight.y[i] = chunk.y[i];
            flight.z[i] = chunk.z[i];
            flight.ux[i] = ux;
            flight.uy[i] = uy;
            flight.uz[i] = uz;
            flight.depth[i] = chunk.depth[i];
            flight.length[i] = length;
        }

        chunk.x[i] = fma::<FMA>(ux, length, chunk.x[i]);
        chunk.y[i] = fma::<FMA>(uy, length, chunk.y[i]);
        chunk.z[i] = choose(left, chunk.z[i], z);
        let path = chunk.path[i] + length;
        chunk.path[i] = path;
        let depth = fma::<FMA>(chunk.sigma_a[i], length, chunk.depth[i]);
        chunk.depth[i] = depth;
        let expired = (depth > limits.depth) | (path > limits.path);
        chunk.marks[i] = (left & LEAVING[i]) | (mask(expired) & EXPIRING[i]);
        chunk.order[i] = chunk.order[i].wrapping_add(1 & !left);

        let v = if SCATTERING == Scattering::Given as u8 {
            chunk.one_minus_cos[i]
        } else {
            let xi = uniform(stream.next());
            if SCATTERING == Scattering::Isotropic as u8 {
                2.0 - 2.0 * xi
            } else {
                henyey_greenstein::<FMA>(chunk.g[i], xi)
            }
        };
        let (cos_phi, sin_phi) = random_direction::<FMA>(stream.next());
        let cos = 1.0 - v;
        let sin = (v * (2.0 - v)).sqrt();
        let (a, b) = (sin * cos_phi, sin * sin_phi);
        let (vx, vy, vz);
        if SCATTERING == Scattering::Isotropic as u8 {
            (vx, vy, vz) = (a, b, cos);
        } else {
            // An orthonormal basis around the old direction without a special case at the poles:
            // Duff et al. (2017).
            let sign = 1.0_f32.copysign(uz);
            let h = -1.0 / (sign + uz);
            let k = ux * uy * h;
            let p = fma::<FMA>(ux * ux * sign, h, 1.0);
            let q = fma::<FMA>(uy * uy, h, sign);
            let nx = fma::<FMA>(a, p, fma::<FMA>(b, k, cos * ux));
            let ny = fma::<FMA>(a, sign * k, fma::<FMA>(b, q, cos * uy));
            let nz = fma::<FMA>(-a, sign * ux, fma::<FMA>(-b, uy, cos * uz));
            // One step of Newton's keeps rounding from adding up over thousands of scatterings.
            let norm2 = fma::<FMA>(nx, nx, fma::<FMA>(ny, ny, nz * nz));
            let scale = fma::<FMA>(-0.5, norm2, 1.5);
            (vx, vy, vz) = (nx * scale, ny * scale, nz * scale);
        }
        chunk.ux[i] = choose(left, ux, vx);
        chunk.uy[i] = choose(left, uy, vy);
        chunk.uz[i] = choose(left, uz, vz);
        for (word, state) in chunk.random.iter_mut().zip(stream.0) {
            word[i] = state;
        }
    }
    chunk.marked = chunk.marks.iter().fold(0, |all, mark| all | mark);
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::Phase;

    /// Bits from end to end of their range.
    fn bits() -> impl Iterator<Item = u32> {
        let ends = [0, 1, 2, 3, 1 << 31, u32::MAX - 1, u32::MAX];
        ends.into_iter()
            .chain((0..200_000_u32).map(|k| k.wrapping_mul(2_654_435_761)))
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

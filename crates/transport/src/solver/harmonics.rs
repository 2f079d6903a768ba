//! Spherical harmonics even in the azimuth, and their rotation about the y axis.
//!
//! The basis is Y_l0 and (Y_lm + (−1)^m Y_l,−m)/√2 for m > 0: real, orthonormal on the sphere,
//! ∝ cos mφ, with the Condon-Shortley sign. Coefficients are stored by m, then by l.

use nalgebra::Complex;

type C = Complex<f64>;

/// Where the coefficient of (l, m) stands, for l up to `n` and m up to `azimuths`.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) n: usize,
    pub(crate) azimuths: usize,
    starts: Vec<usize>,
}

impl Layout {
    pub(crate) fn new(n: usize, azimuths: usize) -> Self {
        let mut starts = vec![0];
        for m in 0..=azimuths {
            starts.push(starts[m] + n + 1 - m);
        }
        Self {
            n,
            azimuths,
            starts,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.starts[self.azimuths + 1]
    }

    /// The coefficients of azimuthal order `m`, l from `m` to `n`.
    pub(crate) fn block(&self, m: usize) -> std::ops::Range<usize> {
        self.starts[m]..self.starts[m + 1]
    }
}

/// Legendre functions Θ_lm(`mu`), ∫Θ² dμ = 1, in the order of `layout`.
pub(crate) fn legendre(layout: &Layout, mu: f64) -> Vec<f64> {
    let mut out = vec![0.0; layout.len()];
    let sin = ((1.0 - mu) * (1.0 + mu)).max(0.0).sqrt();
    let mut sectoral = 0.5_f64.sqrt();
    for m in 0..=layout.azimuths {
        let mf = m as f64;
        if m > 0 {
            sectoral *= -((2.0 * mf + 1.0) / (2.0 * mf)).sqrt() * sin;
        }
        let block = &mut out[layout.block(m)];
        block[0] = sectoral;
        let mut below = 0.0;
        for i in 1..block.len() {
            let l = mf + i as f64;
            let a = streaming(l, mf);
            block[i] = (mu * block[i - 1] - below) / a;
            below = a * block[i - 1];
        }
    }
    out
}

/// The coupling of l − 1 and l by the cosine with the axis: √((l² − m²)/(4l² − 1)).
pub(crate) fn streaming(l: f64, m: f64) -> f64 {
    ((l * l - m * m) / (4.0 * l * l - 1.0)).sqrt()
}

/// A rotation about y by an angle that may be complex, known by its sine and cosine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tilt {
    pub(crate) cos: C,
    pub(crate) sin: C,
}

/// Wigner's d functions for one layout: the square roots that its recurrence needs.
pub(crate) struct Rotations {
    n: usize,
    /// √(l² − m²) at `l * (n + 2) + m`.
    roots: Vec<f64>,
    /// √ of the binomial coefficient (2j over j + m) at `j * (2n + 1) + (j + m)`.
    binomials: Vec<f64>,
}

impl Rotations {
    pub(crate) fn new(n: usize) -> Self {
        let mut roots = vec![0.0; (n + 2) * (n + 2)];
        for l in 0..n + 2 {
            for m in 0..=l {
                roots[l * (n + 2) + m] = ((l * l - m * m) as f64).sqrt();
            }
        }
        let mut binomials = vec![0.0; (n + 1) * (2 * n + 1)];
        for j in 0..=n {
            let mut value = 1.0;
            for i in 0..=2 * j {
                binomials[j * (2 * n + 1) + i] = f64::sqrt(value);
                value *= (2 * j - i) as f64 / (i + 1) as f64;
            }
        }
        Self {
            n,
            roots,
            binomials,
        }
    }

    fn root(&self, l: usize, m: usize) -> f64 {
        self.roots[l * (self.n + 2) + m]
    }

    /// Calls `put(l, element)` for l from max(m, M) to n with the element (m, M) of the rotation
    /// of the even basis: a function that is the basis function (l, M) in the tilted frame has
    /// these coefficients in the upright one.
    pub(crate) fn column(&self, tilt: Tilt, m: usize, big_m: usize, mut put: impl FnMut(usize, C)) {
        let half_cos = ((tilt.cos + 1.0) * 0.5).sqrt();
        let half_sin = tilt.sin / (half_cos * 2.0);
        let j = m.max(big_m);
        let binomial = |i: usize| self.binomials[j * (2 * self.n + 1) + i];
        let (small, large) = (m.min(big_m), j);
        let power = |base: C, e: usize| base.powu(e as u32);
        // d^j with one index at its end, in closed form; s changes sign with the index order.
        let s = if m >= big_m { -half_sin } else { half_sin };
        let mut plus =
            power(half_cos, large + small) * power(s, large - small) * binomial(large + small);
        let mut minus = power(half_cos, large - small)
            * power(-half_sin, large + small)
            * binomial(large - small);
        let sign = if big_m.is_multiple_of(2) { 1.0 } else { -1.0 };
        let norm = match (m, big_m) {
            (0, 0) => 0.5,
            (0, _) | (_, 0) => std::f64::consts::FRAC_1_SQRT_2,
            _ => 1.0,
        };
        let (mut plus_below, mut minus_below) = (C::default(), C::default());
        let product = (m * big_m) as f64;
        let mut l = j;
        loop {
            put(l, (plus + minus * sign) * norm);
            if l == self.n {
                break;
            }
            let (next_plus, next_minus) = if l == 0 {
                (plus * tilt.cos, minus * tilt.cos)
            } else {
                let lf = l as f64;
                let scale = 1.0 / (lf * self.root(l + 1, m) * self.root(l + 1, big_m));
                let a = (2.0 * lf + 1.0) * scale;
                let b = (lf + 1.0) * self.root(l, m) * self.root(l, big_m) * scale;
                let along = tilt.cos * (lf * (lf + 1.0));
                (
                    (along - product) * plus * a - plus_below * b,
                    (along + product) * minus * a - minus_below * b,
                )
            };
            (plus_below, minus_below) = (plus, minus);
            (plus, minus) = (next_plus, next_minus);
            l += 1;
        }
    }
}

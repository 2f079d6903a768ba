//! The normal equations of one point of the search, with every nuisance eliminated.
//!
//! Datum i is dᵢ = mᵢ + Σₖ cₖᵢ zₖ + noise, where the columns cₖᵢ are φₖᵢ·mᵢ for a relative
//! direction (the scale factor is one, with φ = 1) and fixed numbers for an absolute one, and every
//! zₖ has a prior of mean 0 and precision pₖ: 1 for a direction, 1/u² for the scale, 0 for a scale
//! that is not known. At its best z solves (P + CᵀWC) z = CᵀW(d − m); what remains of χ² and of its
//! curvature is the Schur complement of z. It is the same as weighing the data by the inverse of
//! their full covariance (Woodbury), and the columns keep their dependence on the model.

use nalgebra::{DMatrix, Matrix2, Vector2};
use physics::simd::{self, LaneLoop, SimdPath};

/// Partial sums that run beside each other. Data are padded to blocks of as many, with weight 0.
const LANES: usize = 8;

/// Memory that a fit reuses from one evaluation to the next.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    /// How many data there are without the total.
    rings: usize,
    /// The model at the nodes of the data's footprints.
    pub(crate) nodes: Vec<physics::Gradient>,
    /// Inverse variances; 0 for a datum that takes no part. Like everything here that is one
    /// number a datum, the total comes last, behind the rings.
    pub(crate) weight: Vec<f64>,
    pub(crate) datum: Vec<f64>,
    /// What each ring takes away from the total's own datum.
    pub(crate) area: Vec<f64>,
    /// The model with its derivatives in σₐ and σₛ′.
    pub(crate) value: Vec<f64>,
    pub(crate) in_sigma_a: Vec<f64>,
    pub(crate) in_sigma_s_prime: Vec<f64>,
    /// φₖᵢ by direction, the rings' and the total's.
    pub(crate) relative: Vec<f64>,
    /// Fixed cₖᵢ by direction.
    pub(crate) absolute: Vec<f64>,
    /// How many directions there are of each kind, the scale left out.
    pub(crate) relative_count: usize,
    pub(crate) absolute_count: usize,
    /// Whether the scale was free in the last reduction: how many nuisances go before them.
    scales: usize,
    /// cₖᵢ by direction, the scale left out: its column is the model's value.
    column: Vec<f64>,
    /// What multiplies a ring's derivatives: 1 + Σ φₖᵢ zₖ.
    factor: Vec<f64>,
    residual: Vec<f64>,
    /// P + CᵀWC, then its Cholesky factor.
    gram: Vec<f64>,
    /// The nuisances at their best: the scale's first, if it is free.
    z: Vec<f64>,
    /// CᵀW times the derivatives in σₐ and σₛ′.
    mixed: [Vec<f64>; 2],
}

/// The total's own row, before the rings are taken away from it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TotalRow {
    pub(crate) value: f64,
    pub(crate) weight: f64,
    pub(crate) model: physics::Gradient,
    /// Whether the fitted rings are part of it, so that its datum is what remains of it.
    pub(crate) remainder: bool,
}

/// χ² and what a Gauss-Newton step needs, in (σₐ, σₛ′), with every nuisance eliminated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reduced {
    pub(crate) chi2: f64,
    /// Half the gradient.
    pub(crate) gradient: Vector2<f64>,
    /// Half the Gauss-Newton Hessian.
    pub(crate) hessian: Matrix2<f64>,
    /// The scale factor at its best.
    pub(crate) scale: f64,
}

/// Which terms of the equations take part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Terms {
    /// The total as a datum.
    pub(crate) total: Option<TotalRow>,
    /// Precision of the prior of the scale; `None` where it is known.
    pub(crate) scale_precision: Option<f64>,
}

impl Workspace {
    /// Makes room for `rings` data and a total.
    pub(crate) fn resize(&mut self, rings: usize) {
        self.rings = rings;
        for buffer in [
            &mut self.weight,
            &mut self.datum,
            &mut self.area,
            &mut self.value,
            &mut self.in_sigma_a,
            &mut self.in_sigma_s_prime,
            &mut self.factor,
            &mut self.residual,
        ] {
            buffer.clear();
            buffer.resize((rings + 1).next_multiple_of(LANES), 0.0);
        }
    }

    /// How far apart the columns of two directions are.
    pub(crate) fn stride(&self) -> usize {
        self.weight.len()
    }

    /// Makes room for the directions; the caller fills `relative` and `absolute`.
    pub(crate) fn resize_directions(&mut self, relative: usize, absolute: usize) {
        let data = self.weight.len();
        (self.relative_count, self.absolute_count) = (relative, absolute);
        self.relative.clear();
        self.relative.resize(relative * data, 0.0);
        self.absolute.clear();
        self.absolute.resize(absolute * data, 0.0);
        self.column.clear();
        self.column.resize((relative + absolute) * data, 0.0);
        let all = relative + absolute + 1;
        self.gram.resize(all * all, 0.0);
        let [in_a, in_s] = &mut self.mixed;
        for buffer in [&mut self.z, in_a, in_s] {
            buffer.resize(all, 0.0);
        }
    }

    /// The reduced equations, from the model's rows of the rings.
    pub(crate) fn reduce(&mut self, terms: &Terms) -> Reduced {
        self.add_total(terms.total);
        if self.relative_count + self.absolute_count == 0 {
            return self.reduce_scale(terms.scale_precision);
        }
        self.reduce_all(terms)
    }

    /// The last row: the total, less what its rings say already.
    fn add_total(&mut self, total: Option<TotalRow>) {
        let rings = self.rings;
        let rows = [
            &mut self.value,
            &mut self.in_sigma_a,
            &mut self.in_sigma_s_prime,
        ];
        let Some(total) = total else {
            self.weight[rings] = 0.0;
            for row in rows {
                row[rings] = 0.0;
            }
            return;
        };
        (self.datum[rings], self.weight[rings]) = (total.value, total.weight);
        let own = total.model;
        for (row, own) in rows
            .into_iter()
            .zip([own.value, own.in_sigma_a, own.in_sigma_s_prime])
        {
            row[rings] = own;
            if total.remainder {
                row[rings] -= dot(&row[..rings], &self.area[..rings]);
            }
        }
    }

    /// With the scale as the only nuisance, or none.
    fn reduce_scale(&mut self, precision: Option<f64>) -> Reduced {
        let rows = [
            &self.weight[..],
            &self.datum,
            &self.value,
            &self.in_sigma_a,
            &self.in_sigma_s_prime,
        ];
        let (mut scale, mut norm) = (1.0, 0.0);
        if let Some(precision) = precision {
            let [up, down] = SimdPath::best().run(ScaleSums { rows });
            norm = down + precision;
            scale += up / norm;
        }
        let sums = SimdPath::best().run(NormalSums { rows, scale });
        let [mut chi2, ea, es, aa, mixed, ss, va, vs] = sums;
        let mut hessian = Matrix2::new(aa, mixed, mixed, ss);
        if let Some(precision) = precision {
            chi2 += precision * (scale - 1.0).powi(2);
            let with_scale = Vector2::new(va, vs);
            hessian -= with_scale * with_scale.transpose() / norm;
        }
        Reduced {
            chi2,
            gradient: Vector2::new(ea, es) * -scale,
            hessian: hessian * (scale * scale),
            scale,
        }
    }

    fn reduce_all(&mut self, terms: &Terms) -> Reduced {
        let (data, rings) = (self.stride(), self.rings);
        let (relative, directions) = (
            self.relative_count,
            self.relative_count + self.absolute_count,
        );
        // The columns.
        for k in 0..directions {
            let column = &mut self.column[k * data..(k + 1) * data];
            if k < relative {
                let phi = &self.relative[k * data..(k + 1) * data];
                for (c, (phi, value)) in column.iter_mut().zip(phi.iter().zip(&self.value)) {
                    *c = phi * value;
                }
                column[rings] = terms.total.map_or(0.0, |t| phi[rings] * t.model.value);
            } else {
                let k = k - relative;
                column.copy_from_slice(&self.absolute[k * data..(k + 1) * data]);
                if terms.total.is_none() {
                    column[rings] = 0.0;
                }
            }
            if terms.total.is_some_and(|t| t.remainder) {
                let (rest, total) = column.split_at_mut(rings);
                total[0] -= dot(rest, &self.area[..rings]);
            }
        }
        for (r, (d, v)) in self
            .residual
            .iter_mut()
            .zip(self.datum.iter().zip(&self.value))
        {
            *r = d - v;
        }
        // The nuisances at their best.
        let scales = usize::from(terms.scale_precision.is_some());
        self.scales = scales;
        let count = directions + scales;
        let column = |k: usize| -> &[f64] {
            if k < scales {
                &self.value
            } else {
                &self.column[(k - scales) * data..(k - scales + 1) * data]
            }
        };
        let precision = |k: usize| match terms.scale_precision {
            Some(precision) if k == 0 => precision,
            _ => 1.0,
        };
        for k in 0..count {
            for l in 0..=k {
                self.gram[k * count + l] = weighted(&self.weight, column(k), column(l));
            }
            self.gram[k * count + k] += precision(k);
            self.z[k] = weighted(&self.weight, column(k), &self.residual);
        }
        let z = &mut self.z[..count];
        cholesky(&mut self.gram[..count * count], count);
        forward(&self.gram, count, z);
        backward(&self.gram, count, z);
        // What is left, and the derivatives at that z.
        let scale = 1.0 + if scales == 1 { z[0] } else { 0.0 };
        self.factor.fill(scale);
        for (k, z) in z.iter().enumerate() {
            for (r, c) in self.residual.iter_mut().zip(column(k)) {
                *r -= c * z;
            }
        }
        let mut total_factor = scale;
        for (k, &z) in z[scales..].iter().take(relative).enumerate() {
            let phi = &self.relative[k * data..(k + 1) * data];
            for (f, phi) in self.factor.iter_mut().zip(phi) {
                *f += phi * z;
            }
            total_factor += phi[rings] * z;
        }
        for (row, own) in [&mut self.in_sigma_a, &mut self.in_sigma_s_prime]
            .into_iter()
            .zip(
                terms
                    .total
                    .map_or([0.0; 2], |t| [t.model.in_sigma_a, t.model.in_sigma_s_prime]),
            )
        {
            for (row, factor) in row[..rings].iter_mut().zip(&self.factor) {
                *row *= factor;
            }
            row[rings] = total_factor * own;
            if terms.total.is_some_and(|t| t.remainder) {
                row[rings] -= dot(&row[..rings], &self.area[..rings]);
            }
        }
        let (a, s) = (&self.in_sigma_a, &self.in_sigma_s_prime);
        let mut chi2 = weighted(&self.weight, &self.residual, &self.residual);
        for (k, z) in z.iter().enumerate() {
            chi2 += precision(k) * z * z;
        }
        let w = &self.weight;
        let gradient = -Vector2::new(
            weighted(w, a, &self.residual),
            weighted(w, s, &self.residual),
        );
        let mixed = weighted(w, a, s);
        let mut hessian = Matrix2::new(weighted(w, a, a), mixed, mixed, weighted(w, s, s));
        // Schur complement: with L of the Cholesky factor, (L⁻¹y)ᵀ(L⁻¹y).
        let [in_a, in_s] = &mut self.mixed;
        for k in 0..count {
            let c = if k < scales {
                &self.value[..]
            } else {
                &self.column[(k - scales) * data..(k - scales + 1) * data]
            };
            in_a[k] = weighted(w, c, a);
            in_s[k] = weighted(w, c, s);
        }
        let (in_a, in_s) = (&mut in_a[..count], &mut in_s[..count]);
        forward(&self.gram, count, in_a);
        forward(&self.gram, count, in_s);
        let mixed = dot(in_a, in_s);
        hessian -= Matrix2::new(dot(in_a, in_a), mixed, mixed, dot(in_s, in_s));
        Reduced {
            chi2,
            gradient,
            hessian,
            scale,
        }
    }

    /// What the noise, the scale, and every direction add to the covariance of the coefficients
    /// (σₐ, σₛ′), which move along the columns of `basis` alone: of the last call of
    /// [`Self::reduce`], whose scale was `scale` with the prior `precision`.
    ///
    /// With A the derivatives of the data in all unknowns, nuisances included, and P the priors,
    /// the estimate answers an error e of the data by M⁻¹AᵀWe and one of a prior by M⁻¹Pe, with
    /// M = AᵀWA + P (JCGM 102, 6). All sum to the covariance itself.
    pub(crate) fn shares(
        &self,
        basis: &[Vector2<f64>],
        scale: f64,
        precision: Option<f64>,
    ) -> Vec<Matrix2<f64>> {
        let data = self.weight.len();
        let directions = self.relative_count + self.absolute_count;
        // The derivatives already hold the nuisances where there are any beside the scale.
        let factor = if directions == 0 { scale } else { 1.0 };
        let mut unknowns: Vec<Vec<f64>> = basis
            .iter()
            .map(|b| {
                let rows = self.in_sigma_a.iter().zip(&self.in_sigma_s_prime);
                rows.map(|(a, s)| factor * (b.x * a + b.y * s)).collect()
            })
            .collect();
        let mut priors = vec![0.0; basis.len()];
        if let Some(precision) = precision {
            unknowns.push(self.value.clone());
            priors.push(precision);
        }
        for k in 0..directions {
            unknowns.push(self.column[k * data..(k + 1) * data].to_vec());
            priors.push(1.0);
        }
        let n = unknowns.len();
        let noise = DMatrix::from_fn(n, n, |i, j| {
            weighted(&self.weight, &unknowns[i], &unknowns[j])
        });
        let prior = DMatrix::from_diagonal(&priors.into());
        let Some(inverse) = (&noise + &prior).try_inverse() else {
            return vec![];
        };
        let basis = DMatrix::from_fn(2, n, |i, j| basis.get(j).map_or(0.0, |b| b[i]));
        let answer = basis * inverse;
        let square = |m: DMatrix<f64>| Matrix2::new(m[(0, 0)], m[(0, 1)], m[(1, 0)], m[(1, 1)]);
        let of_prior = |k: usize| {
            let column = answer.column(k) * prior[(k, k)].sqrt();
            square(&column * column.transpose())
        };
        let first = n - directions;
        let scale = if precision.is_some() {
            of_prior(first - 1)
        } else {
            Matrix2::zeros()
        };
        let noise = square(&answer * &noise * answer.transpose());
        let mut shares = vec![noise, scale];
        shares.extend((first..n).map(of_prior));
        shares
    }

    /// The directions at their best, relative ones first: of the last call of [`Self::reduce`].
    pub(crate) fn directions(&self) -> &[f64] {
        let count = self.relative_count + self.absolute_count;
        if count == 0 {
            return &[];
        }
        &self.z[self.scales..][..count]
    }

    /// What the nuisances add to the model at their best, the rings' and then the total's own
    /// datum: of the last call of [`Self::reduce`] with the same `terms`.
    pub(crate) fn fitted(&self, i: usize, scale: f64) -> f64 {
        if self.relative_count + self.absolute_count == 0 {
            scale * self.value[i]
        } else {
            self.datum[i] - self.residual[i]
        }
    }
}

/// Weight, datum, value and derivatives of every row, in whole blocks.
type AllRows<'a> = [&'a [f64]; 5];

/// Σ w v (d − v) and Σ w v²: what the scale factor follows from.
struct ScaleSums<'a> {
    rows: AllRows<'a>,
}

impl LaneLoop for ScaleSums<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run<const FMA: bool>(self) -> [f64; 2] {
        let [w, d, v, _, _] = self.rows.map(|row| row.as_chunks::<LANES>().0);
        let mut sums = [[0.0; LANES]; 2];
        for ((w, d), v) in w.iter().zip(d).zip(v) {
            for i in 0..LANES {
                let wv = w[i] * v[i];
                sums[0][i] = simd::fma::<FMA>(wv, d[i] - v[i], sums[0][i]);
                sums[1][i] = simd::fma::<FMA>(wv, v[i], sums[1][i]);
            }
        }
        sums.map(|lanes| lanes.iter().sum())
    }
}

/// Sums over all rows of what χ², its gradient and its Hessian are made of, with the residual
/// e = d − scale·v: w·(e², a e, s e, a², a s, s², a v, s v).
struct NormalSums<'a> {
    rows: AllRows<'a>,
    scale: f64,
}

impl LaneLoop for NormalSums<'_> {
    type Output = [f64; 8];

    #[inline(always)]
    fn run<const FMA: bool>(self) -> [f64; 8] {
        let [w, d, v, a, s] = self.rows.map(|row| row.as_chunks::<LANES>().0);
        let mut sums = [[0.0; LANES]; 8];
        for ((((w, d), v), a), s) in w.iter().zip(d).zip(v).zip(a).zip(s) {
            // One whole block after the other, which the compiler makes one instruction each.
            let e: [f64; LANES] =
                std::array::from_fn(|i| simd::fma::<FMA>(-self.scale, v[i], d[i]));
            let [we, wa, ws] =
                [&e, a, s].map(|x| -> [f64; LANES] { std::array::from_fn(|i| w[i] * x[i]) });
            let terms = [
                (&we, &e),
                (&we, a),
                (&we, s),
                (&wa, a),
                (&wa, s),
                (&ws, s),
                (&wa, v),
                (&ws, v),
            ];
            for (sum, (x, y)) in sums.iter_mut().zip(terms) {
                for i in 0..LANES {
                    sum[i] = simd::fma::<FMA>(x[i], y[i], sum[i]);
                }
            }
        }
        sums.map(|lanes| lanes.iter().sum())
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Σ w a b over whole blocks.
struct Weighted<'a>([&'a [f64]; 3]);

impl LaneLoop for Weighted<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> f64 {
        let [w, a, b] = self.0.map(|row| row.as_chunks::<LANES>().0);
        let mut sums = [0.0; LANES];
        for ((w, a), b) in w.iter().zip(a).zip(b) {
            for i in 0..LANES {
                sums[i] = simd::fma::<FMA>(w[i] * a[i], b[i], sums[i]);
            }
        }
        sums.iter().sum()
    }
}

fn weighted(w: &[f64], a: &[f64], b: &[f64]) -> f64 {
    SimdPath::best().run(Weighted([w, a, b]))
}

/// The lower Cholesky factor of a positive definite matrix, in its place, row by row.
///
/// A direction that neither data nor prior hold (a free scale without light) leaves a pivot of 0:
/// it is made to stay at 0.
fn cholesky(matrix: &mut [f64], n: usize) {
    for i in 0..n {
        for j in 0..=i {
            let (above, row) = matrix.split_at_mut(i * n);
            let mut sum = row[j];
            if i == j {
                sum -= dot(&row[..j], &row[..j]);
                row[i] = if sum > 0.0 { sum.sqrt() } else { f64::INFINITY };
            } else {
                sum -= dot(&row[..j], &above[j * n..j * n + j]);
                row[j] = sum / above[j * n + j];
            }
        }
    }
}

/// L⁻¹ `x`, in its place.
fn forward(factor: &[f64], n: usize, x: &mut [f64]) {
    for i in 0..n {
        x[i] = (x[i] - dot(&factor[i * n..i * n + i], &x[..i])) / factor[i * n + i];
    }
}

/// L⁻ᵀ `x`, in its place.
fn backward(factor: &[f64], n: usize, x: &mut [f64]) {
    for i in (0..n).rev() {
        let mut sum = x[i];
        for j in i + 1..n {
            sum -= factor[j * n + i] * x[j];
        }
        x[i] = sum / factor[i * n + i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    /// The same by the full covariance of the data, with the derivatives at the best nuisances.
    #[test]
    fn eliminating_nuisances_is_weighing_by_the_full_covariance() {
        let n = 6;
        let wave = |i: usize, k: f64| (1.3 * k * (i as f64 + 1.0)).sin();
        let mut space = Workspace::default();
        space.resize(n);
        space.resize_directions(2, 1);
        for i in 0..=n {
            space.weight[i] = 1.0 + 0.5 * wave(i, 1.0);
            space.datum[i] = 2.0 + wave(i, 2.0);
            space.area[i] = 0.1;
            space.value[i] = 1.5 + 0.3 * wave(i, 3.0);
            space.in_sigma_a[i] = wave(i, 4.0);
            space.in_sigma_s_prime[i] = wave(i, 5.0);
        }
        let stride = space.stride();
        for (i, x) in space.relative.iter_mut().enumerate() {
            *x = 0.3 * wave(i, 6.0);
        }
        for (i, x) in space.absolute.iter_mut().enumerate() {
            *x = 0.3 * wave(i, 7.0);
        }
        let own = physics::Gradient {
            value: 3.0,
            in_sigma_a: -1.0,
            in_sigma_s_prime: 0.5,
        };
        let terms = Terms {
            total: Some(TotalRow {
                value: space.datum[n],
                weight: space.weight[n],
                model: own,
                remainder: true,
            }),
            scale_precision: Some(25.0),
        };
        let rows = [
            space.value.clone(),
            space.in_sigma_a.clone(),
            space.in_sigma_s_prime.clone(),
        ];
        let got = space.reduce(&terms);

        // Rings, and the total less its rings, as a linear map of rings and the whole total.
        let mut map = DMatrix::identity(n + 1, n + 1);
        for i in 0..n {
            map[(n, i)] = -0.1;
        }
        let whole = |row: &[f64], own: f64| {
            let mut all = DVector::from_row_slice(&row[..=n]);
            all[n] = own;
            all
        };
        let value = &map * whole(&rows[0], own.value);
        let mut columns = DMatrix::zeros(n + 1, 4);
        for k in 0..4 {
            let column = match k {
                0 => value.clone(),
                1 | 2 => {
                    let phi = &space.relative[(k - 1) * stride..][..=n];
                    let own = phi[n] * own.value;
                    let ring: Vec<f64> = phi.iter().zip(&rows[0]).map(|(p, v)| p * v).collect();
                    &map * whole(&ring, own)
                }
                _ => &map * DVector::from_row_slice(&space.absolute[..=n]),
            };
            columns.set_column(k, &column);
        }
        let prior = DMatrix::from_diagonal(&DVector::from_row_slice(&[1.0 / 25.0, 1.0, 1.0, 1.0]));
        let noise = DMatrix::from_diagonal(&DVector::from_iterator(
            n + 1,
            space.weight[..=n].iter().map(|w| 1.0 / w),
        ));
        let inverse = (noise + &columns * &prior * columns.transpose())
            .try_inverse()
            .unwrap();
        let residual = DVector::from_row_slice(&space.datum[..=n]) - &value;
        let chi2 = residual.dot(&(&inverse * &residual));
        assert!((got.chi2 / chi2 - 1.0).abs() < 1e-12, "{got:?}, {chi2}");
        let z = &prior * columns.transpose() * &inverse * &residual;
        let factor = |phi: &dyn Fn(usize) -> f64| 1.0 + z[0] + z[1] * phi(1) + z[2] * phi(2);
        let slope = |row: &[f64], own: f64| {
            let phi = |i: usize| move |k: usize| 0.3 * wave((k - 1) * stride + i, 6.0);
            let rings: Vec<f64> = (0..=n).map(|i| row[i] * factor(&phi(i))).collect();
            &map * whole(&rings, own * factor(&phi(n)))
        };
        let slopes = [
            slope(&rows[1], own.in_sigma_a),
            slope(&rows[2], own.in_sigma_s_prime),
        ];
        for i in 0..2 {
            let gradient = -slopes[i].dot(&(&inverse * &residual));
            assert!((got.gradient[i] - gradient).abs() < 1e-12 * chi2, "{i}");
            for j in 0..2 {
                let hessian = slopes[i].dot(&(&inverse * &slopes[j]));
                assert!(
                    (got.hessian[(i, j)] / hessian - 1.0).abs() < 1e-10,
                    "{i}{j}"
                );
            }
        }
    }
}

//! The same equations at steep frequencies, where the modes are too alike to be told apart.
//!
//! Every mode decays like e^(−qz) there and points along nearly the same complex direction, so
//! a sum over modes cancels beyond the last digit. The space that they span is well defined all
//! the same: it comes here from the square root of the matrix of the second-order equation for
//! the moments of odd parity, by a unitary (Schur) form that needs no single mode.

use super::harmonics::{Layout, streaming};
use super::lu;
use super::spectrum::Spectrum;
use nalgebra::{Complex, DMatrix, Schur};
use std::f64::consts::{PI, SQRT_2};

type C = Complex<f64>;

/// Azimuths of exit in half a turn.
const AZIMUTHS: usize = 28;

/// The decaying fields of a medium at one frequency: `basis`·exp(−`decay` z)·anything.
pub(crate) struct Decaying {
    q: C,
    /// By moments, in the order of the layout.
    basis: DMatrix<C>,
    /// Upper triangular.
    decay: DMatrix<C>,
}

impl Decaying {
    /// The fields that decay in a medium with these removals; `layout` holds every azimuth.
    pub(crate) fn new(layout: &Layout, removal: &[f64], q: C) -> Option<Self> {
        let moments: Vec<(usize, usize)> = (0..=layout.azimuths)
            .flat_map(|m| (m..=layout.n).map(move |l| (l, m)))
            .collect();
        let place = |l: usize, m: usize| layout.block(m).start + l - m;
        let (odd, even): (Vec<usize>, Vec<usize>) =
            (0..moments.len()).partition(|&i| (moments[i].0 + moments[i].1) % 2 == 1);
        let mut row = vec![0; moments.len()];
        for list in [&odd, &even] {
            for (i, &index) in list.iter().enumerate() {
                row[index] = i;
            }
        }
        let mut along = DMatrix::<C>::zeros(odd.len(), even.len());
        let mut within = [
            DMatrix::<C>::zeros(even.len(), even.len()),
            DMatrix::<C>::zeros(odd.len(), odd.len()),
        ];
        for (index, &(l, m)) in moments.iter().enumerate() {
            let parity = (l + m) % 2;
            within[parity][(row[index], row[index])] += C::new(removal[l], 0.0);
            if l > m {
                let other = place(l - 1, m);
                let (o, e) = if parity == 1 {
                    (index, other)
                } else {
                    (other, index)
                };
                along[(row[o], row[e])] = C::new(streaming(l as f64, m as f64), 0.0);
            }
            // sin θ cos φ couples (l, m) with (l ± 1, m + 1).
            let (lf, mf) = (l as f64, m as f64);
            let norm = if m == 0 { 0.5 * SQRT_2 } else { 0.5 };
            let mut couple = |other: usize, value: f64| {
                let value = C::new(0.0, value * norm) * q;
                within[parity][(row[index], row[other])] += value;
                within[parity][(row[other], row[index])] += value;
            };
            if l < layout.n {
                let x = (lf + mf + 1.0) * (lf + mf + 2.0);
                couple(
                    place(l + 1, m + 1),
                    -(x / ((2.0 * lf + 1.0) * (2.0 * lf + 3.0))).sqrt(),
                );
            }
            if l >= m + 2 {
                let x = (lf - mf) * (lf - mf - 1.0);
                couple(
                    place(l - 1, m + 1),
                    (x / ((2.0 * lf - 1.0) * (2.0 * lf + 1.0))).sqrt(),
                );
            }
        }
        let [even_within, odd_within] = within;
        let to_even = even_within.lu().solve(&along.transpose())?;
        let second = (&along * &to_even).lu().solve(&odd_within)?;
        let (unitary, triangle) = Schur::try_new(second, 1e-14, 10_000)?.unpack();
        let n = odd.len();
        let mut decay = DMatrix::<C>::zeros(n, n);
        for j in 0..n {
            decay[(j, j)] = triangle[(j, j)].sqrt();
            for i in (0..j).rev() {
                let known: C = (i + 1..j).map(|k| decay[(i, k)] * decay[(k, j)]).sum();
                decay[(i, j)] = (triangle[(i, j)] - known) / (decay[(i, i)] + decay[(j, j)]);
            }
        }
        let even_basis = to_even * &unitary * &decay;
        let mut basis = DMatrix::zeros(moments.len(), n);
        for (list, part) in [(&odd, &unitary), (&even, &even_basis)] {
            for (i, &index) in list.iter().enumerate() {
                basis.set_row(index, &part.row(i));
            }
        }
        Some(Self { q, basis, decay })
    }

    /// The frequency of these fields.
    pub(crate) fn frequency(&self) -> C {
        self.q
    }
}

impl Spectrum<'_> {
    /// [`Self::at`] from the fields that decay at that frequency.
    pub(crate) fn at_steep(&self, fields: &Decaying) -> C {
        let layout = &self.boundary.layout;
        let q = fields.q;
        let count = fields.decay.nrows();
        let beam = self.beam_response(q);
        let mut matrix = vec![C::default(); count * count];
        for (k, column) in fields.basis.column_iter().enumerate() {
            self.incoming(column.as_slice(), |row, value| {
                matrix[row * count + k] = value;
            });
        }
        let mut amplitudes = vec![C::default(); count];
        self.incoming(&beam, |row, value| amplitudes[row] = -value);
        lu::solve(&mut matrix, &mut amplitudes);

        let mut sum = self.leaving(q, &beam, C::new(1.0, 0.0));
        let mut decayed = vec![C::default(); count];
        let mut projected = vec![C::default(); count * (layout.azimuths + 1)];
        for ((ray, _), source) in self.boundary.exits.iter().zip(&self.sources) {
            for (k, column) in fields.basis.column_iter().enumerate() {
                let column = column.as_slice();
                for m in 0..=layout.azimuths {
                    let block = layout.block(m);
                    projected[m * count + k] = column[block.clone()]
                        .iter()
                        .zip(&source[block])
                        .map(|(x, s)| x * *s)
                        .sum();
                }
            }
            let sin = ((1.0 - ray.mu) * (1.0 + ray.mu)).max(0.0).sqrt();
            for step in 0..AZIMUTHS {
                let azimuth = PI * (step as f64 + 0.5) / AZIMUTHS as f64;
                let shift = C::new(0.0, sin * azimuth.cos()) * q + 1.0;
                // (shift + μ decay) x = amplitudes, from the last row up.
                decayed.copy_from_slice(&amplitudes);
                for k in (0..count).rev() {
                    let column = fields.decay.column(k);
                    let x = decayed[k] / (column[k] * ray.mu + shift);
                    decayed[k] = x;
                    let x = x * ray.mu;
                    for (d, c) in decayed[..k].iter_mut().zip(column.as_slice()) {
                        *d -= c * x;
                    }
                }
                for m in 0..=layout.azimuths {
                    let row = &projected[m * count..(m + 1) * count];
                    let value: C = row.iter().zip(&decayed).map(|(a, b)| a * b).sum();
                    sum += value * ((m as f64 * azimuth).cos() / AZIMUTHS as f64);
                }
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::medium::ScaledMedium;
    use crate::solver::spectrum::Boundary;

    /// Two solutions of one set of equations that share neither modes nor rotations.
    #[test]
    fn modes_and_matrix_root_agree_where_both_stand() {
        let order = 9;
        for (eta, g, absorption) in [(1.0, 0.0, 0.3), (1.4, 0.8, 0.01), (1.33, -0.3, 0.7)] {
            let medium = ScaledMedium::new(absorption, g, order);
            let boundary = Boundary::new(eta, order, order, None);
            let spectrum = Spectrum::new(&boundary, &medium);
            for q in [C::new(0.4, 0.0), C::new(0.5, 0.5), C::new(0.9, 1.3)] {
                let layout = Layout::new(order, order);
                let fields = Decaying::new(&layout, &medium.removal, q).unwrap();
                let (a, b) = (spectrum.at(q), spectrum.at_steep(&fields));
                assert!(
                    (a - b).norm() < 1e-8 * a.norm(),
                    "eta {eta}, g {g}, q {q}: {a} and {b}"
                );
            }
        }
    }
}

//! Light that scattered twice or more, as it leaves, for one transverse spatial frequency.

use super::boundary::{self, Ray};
use super::harmonics::{Layout, Rotations, Tilt, legendre, streaming};
use super::lu;
use super::medium::{Mode, ScaledMedium, modes};
use nalgebra::Complex;
use std::f64::consts::PI;

type C = Complex<f64>;

/// What depends on the order and the relative index alone.
pub(crate) struct Boundary {
    pub(super) layout: Layout,
    rotations: Rotations,
    /// For each m, the half-range products of rows l + m odd with columns l, by rows.
    marshak: Vec<Vec<f64>>,
    /// Directions that leave, with T μ w, and the harmonics of the upward direction.
    pub(super) exits: Vec<(Ray, Vec<f64>)>,
}

impl Boundary {
    /// Light that leaves is counted as exitance, or as π·radiance along the cosine `toward`
    /// inside.
    pub(crate) fn new(eta: f64, order: usize, azimuths: usize, toward: Option<f64>) -> Self {
        let layout = Layout::new(order, azimuths);
        let rays = boundary::rays(eta, order + 3);
        let mut marshak: Vec<Vec<f64>> = (0..=azimuths)
            .map(|m| vec![0.0; (order + 1 - m) / 2 * (order + 1 - m)])
            .collect();
        for ray in &rays {
            let theta = legendre(&layout, ray.mu);
            for (m, matrix) in marshak.iter_mut().enumerate() {
                let theta = &theta[layout.block(m)];
                let width = theta.len();
                for (row, chunk) in matrix.chunks_exact_mut(width).enumerate() {
                    let odd = ray.weight * theta[2 * row + 1];
                    for (i, (x, t)) in chunk.iter_mut().zip(theta).enumerate() {
                        // Y_lm of the mirrored direction is (−1)^(l + m) Y_lm.
                        let mirrored = if i % 2 == 0 {
                            ray.reflectance
                        } else {
                            -ray.reflectance
                        };
                        *x += odd * t * (1.0 - mirrored);
                    }
                }
            }
        }
        let exits = match toward {
            None => boundary::rays(eta, 12),
            // Radiance falls by η² on its way out; an exitance would be 2π∫ of it over μ dμ.
            Some(mu) => vec![Ray {
                mu,
                weight: 0.5 / (mu * eta * eta),
                reflectance: physics::fresnel::reflectance(1.0 / eta, mu),
            }],
        };
        let exits = exits
            .into_iter()
            .filter(|ray| ray.reflectance < 1.0)
            .map(|ray| (ray, legendre(&layout, -ray.mu)))
            .collect();
        Self {
            rotations: Rotations::new(order),
            layout,
            marshak,
            exits,
        }
    }
}

/// The light that leaves a medium after two scatterings or more, per entering power, as a
/// function of the transverse frequency.
pub(crate) struct Spectrum<'a> {
    pub(super) boundary: &'a Boundary,
    modes: Vec<Mode>,
    pub(super) medium: &'a ScaledMedium,
    /// Harmonics of the leaving directions weighted with T μ w and the scattering moments.
    pub(super) sources: Vec<Vec<f64>>,
}

impl<'a> Spectrum<'a> {
    pub(crate) fn new(boundary: &'a Boundary, medium: &'a ScaledMedium) -> Self {
        let layout = &boundary.layout;
        let sources = boundary
            .exits
            .iter()
            .map(|(ray, theta)| {
                let share = ray.weight * ray.mu * (1.0 - ray.reflectance);
                let mut out = theta.clone();
                for m in 0..=layout.azimuths {
                    // The azimuthal normalisation times that of ∫cos mφ/(a + ib cos φ)dφ.
                    let azimuth = if m == 0 {
                        (2.0 * PI).sqrt()
                    } else {
                        2.0 * PI.sqrt()
                    };
                    for (x, scattering) in
                        out[layout.block(m)].iter_mut().zip(&medium.scattering[m..])
                    {
                        *x *= share * azimuth * scattering;
                    }
                }
                out
            })
            .collect();
        Self {
            boundary,
            modes: modes(medium, layout.azimuths),
            medium,
            sources,
        }
    }

    /// The transform ∫R J₀(qr) 2πr dr at frequency `q`, off the cut.
    pub(crate) fn at(&self, q: C) -> C {
        let layout = &self.boundary.layout;
        let count = self.modes.len();
        let mut columns = vec![C::default(); count * layout.len()];
        let mut rates = Vec::with_capacity(count);
        for (mode, column) in self
            .modes
            .iter()
            .zip(columns.chunks_exact_mut(layout.len()))
        {
            let nu = mode.length;
            let rate = (q * q + 1.0 / (nu * nu)).sqrt();
            rates.push(rate);
            let tilt = Tilt {
                cos: rate * nu,
                sin: C::new(0.0, -nu) * q,
            };
            for m in 0..=layout.azimuths {
                let block = &mut column[layout.block(m)];
                self.boundary
                    .rotations
                    .column(tilt, m, mode.azimuth, |l, element| {
                        block[l - m] = element * mode.moments[l - mode.azimuth];
                    });
            }
            let largest = column.iter().fold(0.0_f64, |a, x| a.max(x.l1_norm()));
            column.iter_mut().for_each(|x| *x /= largest);
        }
        let beam = self.beam_response(q);

        let mut matrix = vec![C::default(); count * count];
        for (k, column) in columns.chunks_exact(layout.len()).enumerate() {
            self.incoming(column, |row, value| matrix[row * count + k] = value);
        }
        let mut amplitudes = vec![C::default(); count];
        self.incoming(&beam, |row, value| amplitudes[row] = -value);
        lu::solve(&mut matrix, &mut amplitudes);

        let mut sum = self.leaving(q, &beam, C::new(1.0, 0.0));
        for ((column, rate), amplitude) in columns
            .chunks_exact(layout.len())
            .zip(rates)
            .zip(amplitudes)
        {
            sum += amplitude * self.leaving(q, column, rate);
        }
        sum
    }

    /// What of a field at the boundary comes in without having been reflected, by moments.
    pub(super) fn incoming(&self, field: &[C], mut put: impl FnMut(usize, C)) {
        let layout = &self.boundary.layout;
        let mut row = 0;
        for (m, matrix) in self.boundary.marshak.iter().enumerate() {
            let field = &field[layout.block(m)];
            for weights in matrix.chunks_exact(field.len()) {
                put(row, weights.iter().zip(field).map(|(w, x)| x * *w).sum());
                row += 1;
            }
        }
    }

    /// What leaves of light that scatters from a field `field`·e^(−`rate` z): the source
    /// function integrated along every direction of exit, which is exact where the field is.
    pub(super) fn leaving(&self, q: C, field: &[C], rate: C) -> C {
        let layout = &self.boundary.layout;
        let mut total = C::default();
        for ((ray, _), source) in self.boundary.exits.iter().zip(&self.sources) {
            let a = rate * ray.mu + 1.0;
            let b = q * ((1.0 - ray.mu) * (1.0 + ray.mu)).max(0.0).sqrt();
            let mut root = (a * a + b * b).sqrt();
            // The root of the quadratic that lies inside the unit circle.
            if (a + root).norm_sqr() < (a - root).norm_sqr() {
                root = -root;
            }
            let step = b / (a + root) * C::new(0.0, -1.0);
            let mut sum = C::default();
            // Horner's rule over the azimuthal orders.
            for m in (0..=layout.azimuths).rev() {
                let block = layout.block(m);
                let inner: C = field[block.clone()]
                    .iter()
                    .zip(&source[block])
                    .map(|(x, s)| x * *s)
                    .sum();
                sum = sum * step + inner;
            }
            total += sum / root;
        }
        total
    }

    /// The field ∝ e^(−z) that light scattered first from the beam would make in an unbounded
    /// medium: the transport equation solved in a frame along its complex gradient, where the
    /// azimuthal orders part.
    pub(super) fn beam_response(&self, q: C) -> Vec<C> {
        let layout = &self.boundary.layout;
        let rotations = &self.boundary.rotations;
        let gradient = (-q * q + 1.0).sqrt();
        let tilt = Tilt {
            cos: gradient.inv(),
            sin: C::new(0.0, -1.0) * q / gradient,
        };
        let back = Tilt {
            sin: -tilt.sin,
            ..tilt
        };
        let mut field = vec![C::default(); layout.len()];
        for azimuth in 0..=layout.azimuths {
            let mut source = vec![C::default(); layout.n + 1 - azimuth];
            rotations.column(back, azimuth, 0, |l, element| {
                let moment = ((2 * l + 1) as f64 / (4.0 * PI)).sqrt() * self.medium.scattering[l];
                source[l - azimuth] = element * moment;
            });
            self.solve_along(gradient, azimuth, &mut source);
            for m in 0..=layout.azimuths {
                let block = &mut field[layout.block(m)];
                rotations.column(tilt, m, azimuth, |l, element| {
                    block[l - m] += element * source[l - azimuth];
                });
            }
        }
        field
    }

    /// Solves (removal − `gradient` · streaming) x = `right` for one azimuthal order, in place.
    fn solve_along(&self, gradient: C, azimuth: usize, right: &mut [C]) {
        let n = right.len();
        let removal = &self.medium.removal[azimuth..];
        let coupling = |i: usize| -gradient * streaming((azimuth + i) as f64, azimuth as f64);
        let mut diagonal = C::new(removal[0], 0.0);
        let mut diagonals = Vec::with_capacity(n);
        diagonals.push(diagonal);
        for i in 1..n {
            let c = coupling(i);
            let factor = c / diagonal;
            diagonal = -factor * c + removal[i];
            diagonals.push(diagonal);
            let above = right[i - 1];
            right[i] -= factor * above;
        }
        right[n - 1] /= diagonals[n - 1];
        for i in (0..n - 1).rev() {
            let below = right[i + 1];
            right[i] = (right[i] - coupling(i + 1) * below) / diagonals[i];
        }
    }
}

//! R_d with its gradient at 200 radii, ns a radius on every instruction path, beside the limit of
//! this machine in the same run: the two square roots, the one division and the two exponentials
//! that a radius needs, on the same path and with nothing else.
//!
//! `cargo bench -p beamspot-physics`

#![expect(clippy::print_stdout, reason = "a bench prints what it measured")]

use physics::simd::{self, LaneLoop, SimdPath};
use physics::{DiffuseFresnel, Dipole, Gradient, ReducedMedium};
use std::hint::black_box;
use std::time::Instant;

const RADII: usize = 200;

/// The roots, the division and the exponentials alone.
struct Limit<'a> {
    radius: &'a [f64],
    out: &'a mut [f64],
}

impl LaneLoop for Limit<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let (radii, outs) = (self.radius.chunks_exact(8), self.out.chunks_exact_mut(8));
        for (r, out) in radii.zip(outs) {
            let mut sums = [0.0; 8];
            for i in 0..8 {
                let (d, e) = ((r[i] + 1.0).sqrt(), (r[i] + 2.0).sqrt());
                sums[i] = 1.0 / (d * e) + simd::exp::<FMA>(-d) + simd::exp::<FMA>(-e);
            }
            out.copy_from_slice(&sums);
        }
    }
}

/// The least of many runs, ns a radius.
fn cost(mut run: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..200 {
        let start = Instant::now();
        for _ in 0..100 {
            run();
        }
        best = best.min(start.elapsed().as_secs_f64());
    }
    best / 100.0 / RADII as f64 * 1e9
}

fn main() {
    let marble = ReducedMedium {
        sigma_a: 0.0041,
        sigma_s_prime: 2.62,
        eta: 1.5,
    };
    let dipole = Dipole::new(&marble, DiffuseFresnel::Exact);
    let radius: Vec<f64> = (0..RADII).map(|i| 0.8 + 0.1 * i as f64).collect();
    let mut gradients = vec![Gradient::default(); RADII];
    let mut values = vec![0.0; RADII];
    let plain = cost(|| {
        for (out, &r) in gradients.iter_mut().zip(black_box(&radius)) {
            *out = dipole.diffuse_reflectance_gradient(r);
        }
        black_box(&mut gradients);
    });
    println!("path        gradient   value   roots, division and exp alone (ns a radius)");
    println!("definition  {plain:8.2}");
    for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
        let gradient = cost(|| {
            dipole.gradients(path, black_box(&radius), black_box(&mut gradients));
        });
        let value = cost(|| {
            dipole.reflectances(path, black_box(&radius), black_box(&mut values));
        });
        let limit = cost(|| {
            path.run(Limit {
                radius: black_box(&radius),
                out: black_box(&mut values),
            });
        });
        println!("{:10}  {gradient:8.2}{value:8.2}{limit:8.2}", path.name());
    }
}

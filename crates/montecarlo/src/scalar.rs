//! The walk, photon by photon, in double precision: the definition.
//!
//! Light is absorbed continuously along the way: a photon flies by the scattering coefficient
//! alone and its weight is exp(−∫ σₐ ds). This has no more variance than a loss at every
//! scattering, serves clear and absorbing layers alike, and ties the weight to the path length.

use crate::beam::launch;
use crate::boundary::{Meeting, meet};
use crate::cells::{BlockCells, Exit, PHOTONS_PER_BLOCK};
use crate::problem::{Flown, Problem, ROULETTE_DEPTH, Trail, roulette};
use crate::random::{Stream64, Uniform};
use std::f64::consts::TAU;

/// Follows the photons of a block, or returns early with `None` once `stop` says so.
pub(crate) fn walk_block<'a>(
    problem: &Problem,
    block: u64,
    mut cells: BlockCells<'a>,
    stop: &impl Fn() -> bool,
) -> Option<BlockCells<'a>> {
    let mut trail = Trail::new(problem.seed, block);
    let first = block * PHOTONS_PER_BLOCK;
    for photon in first..first + PHOTONS_PER_BLOCK {
        if stop() {
            return None;
        }
        walk(problem, photon, &mut trail, &mut cells);
    }
    Some(cells)
}

fn walk(problem: &Problem, photon: u64, trail: &mut Trail, cells: &mut BlockCells<'_>) {
    let medium = &problem.medium;
    let follows = cells.follows_flights();
    let mut random = Stream64::new(problem.seed, photon);

    let start = launch(&problem.incidence, medium, &mut random);
    let specular = start.specular;
    cells.arrive(specular);
    if specular >= 1.0 {
        cells.absorb(0.0);
        return;
    }
    let [mut x, mut y] = start.at;
    let [mut ux, mut uy, mut uz] = start.direction;
    // z is measured from the top of the layer.
    let (mut layer, mut z) = (0, 0.0);
    let (mut depth, mut path, mut order) = (-(-specular).ln_1p(), 0.0, 0_u32);
    let mut weight = (-depth).exp();
    let mut absorbed = 0.0;

    loop {
        let here = &medium.layers[layer];
        let free = -(1.0 - random.uniform()).ln() / here.sigma_s;
        let boundary = if uz > 0.0 { here.thickness() } else { 0.0 };
        let to_boundary = if uz == 0.0 || boundary == f64::INFINITY {
            f64::INFINITY
        } else {
            ((boundary - z) / uz).max(0.0)
        };
        let leaves = free > to_boundary;
        let length = if leaves { to_boundary } else { free };

        // Nothing is lost in a layer without absorption, however long the flight.
        let (before, heavier) = (depth, weight);
        if here.sigma_a > 0.0 {
            depth += here.sigma_a * length;
            weight = (-depth).exp();
        }
        let lost = heavier - weight;
        absorbed += lost;
        cells.absorb_in_layer(layer, lost);
        if follows {
            let flown = Flown {
                from: [x, y, problem.tops[layer] + z],
                direction: [ux, uy, uz],
                length,
                depths: [before, depth],
                sigma_a: here.sigma_a,
            };
            trail.deposit(&flown, cells);
        }
        x += ux * length;
        y += uy * length;
        z = if leaves { boundary } else { z + uz * length };
        path += length;
        if path > problem.path_cutoff {
            cells.cut_off(weight);
            break;
        }

        if leaves {
            match meet(medium, layer, uz > 0.0, uz.abs(), random.uniform()) {
                Meeting::Reflected => uz = -uz,
                Meeting::Entered {
                    layer: next,
                    cos,
                    along,
                } => {
                    (ux, uy, uz) = (ux * along, uy * along, cos.copysign(uz));
                    z = if next > layer {
                        0.0
                    } else {
                        medium.layers[next].thickness()
                    };
                    layer = next;
                }
                Meeting::Left { side, cos } => {
                    let radius = x.hypot(y);
                    cells.leave(&Exit {
                        side,
                        weight,
                        radius,
                        cos,
                        along: [ux, uy],
                        path,
                        order,
                        specular,
                    });
                    break;
                }
            }
        } else {
            order += 1;
            cells.events += 1;
            let v = here.phase.one_minus_cos(random.uniform());
            let (sin_phi, cos_phi) = (TAU * random.uniform()).sin_cos();
            (ux, uy, uz) = turned([ux, uy, uz], v, cos_phi, sin_phi);
            if depth > ROULETTE_DEPTH {
                match roulette(depth, random.uniform(), cells) {
                    Some(risen) => (depth, weight) = (risen, (-risen).exp()),
                    None => break,
                }
            }
        }
    }
    cells.absorb(absorbed);
}

/// `direction` turned by the angle θ, `v` = 1 − cos θ, about itself by φ.
///
/// # Source
///
/// The basis around the old direction is that of Duff et al. (2017).
fn turned([ux, uy, uz]: [f64; 3], v: f64, cos_phi: f64, sin_phi: f64) -> (f64, f64, f64) {
    let cos = 1.0 - v;
    let sin = (v * (2.0 - v)).max(0.0).sqrt();
    let (a, b) = (sin * cos_phi, sin * sin_phi);
    let sign = 1.0_f64.copysign(uz);
    let h = -1.0 / (sign + uz);
    let k = ux * uy * h;
    let (nx, ny, nz) = (
        a * (1.0 + sign * ux * ux * h) + b * k + cos * ux,
        a * sign * k + b * (sign + uy * uy * h) + cos * uy,
        -a * sign * ux - b * uy + cos * uz,
    );
    let scale = 1.5 - 0.5 * (nx * nx + ny * ny + nz * nz);
    (nx * scale, ny * scale, nz * scale)
}

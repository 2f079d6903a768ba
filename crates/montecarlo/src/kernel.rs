//! The hot loop: one step and one scattering of every photon in a chunk of lanes.
//!
//! It is written once, over arrays of fixed length and without a branch, and compiled by
//! [`crate::path`] for each instruction set. Whatever is rare (a boundary, a roulette, an exit) is
//! only marked here and dealt with in [`crate::lanes`].

use physics::lanes::{
    Floats, Stream32, WIDTH, Words, choose, fma, henyey_greenstein, mask, minus_ln,
    random_direction, turned, turned_anyhow, uniform,
};

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
        let free = minus_ln::<FMA>(stream.bits()) * chunk.mean_free_path[i];
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
            let xi = uniform(stream.bits());
            if SCATTERING == Scattering::Isotropic as u8 {
                2.0 - 2.0 * xi
            } else {
                henyey_greenstein::<FMA>(chunk.g[i], xi)
            }
        };
        let azimuth = random_direction::<FMA>(stream.bits());
        let (vx, vy, vz) = if SCATTERING == Scattering::Isotropic as u8 {
            turned_anyhow(v, azimuth)
        } else {
            turned::<FMA>([ux, uy, uz], v, azimuth)
        };
        chunk.ux[i] = choose(left, ux, vx);
        chunk.uy[i] = choose(left, uy, vy);
        chunk.uz[i] = choose(left, uz, vz);
        for (word, state) in chunk.random.iter_mut().zip(stream.0) {
            word[i] = state;
        }
    }
    chunk.marked = chunk.marks.iter().fold(0, |all, mark| all | mark);
}

//! What all methods have in common: rounds of equal effort, added up.

use crate::blocks::Blocks;
use crate::film::Film;
use crate::scene::Scene;
use rayon::prelude::*;
use std::ops::{ControlFlow, Range};

/// What `--components` tells apart: light that scattered once, more often, and never.
pub const COMPONENTS: [&str; 3] = ["single", "diffuse", "fresnel"];

/// A picture in the making.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Radiances: plane after plane, each row by row. Planes are the channels or, with
    /// components, for each of [`COMPONENTS`] the channels.
    pub radiance: Film,
    /// Powers of light that was followed from its lamp, as a [`crate::Ledger`] has them; of other
    /// methods none.
    pub powers: Film,
    /// How the noise of neighbours belongs together.
    pub blocks: Blocks,
}

impl Picture {
    /// No light yet; `powers` says how many numbers are known of light that is followed from its
    /// lamp.
    pub(crate) fn empty(planes: Planes, scene: &Scene, powers: usize) -> Self {
        Self {
            radiance: Film::new(planes.len() * scene.pixels()),
            powers: Film::new(powers),
            blocks: Blocks::new(scene.camera.size(), planes.len()),
        }
    }

    /// Adds one round.
    ///
    /// # Panics
    ///
    /// If it is one of another picture.
    pub fn add(&mut self, radiance: &[f64], powers: &[f64]) {
        self.radiance.add(radiance);
        self.powers.add(powers);
        self.blocks.add(radiance);
    }
}

/// Planes of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Planes {
    pub(crate) channels: usize,
    pub(crate) components: bool,
}

impl Planes {
    pub(crate) fn len(self) -> usize {
        self.channels * if self.components { COMPONENTS.len() } else { 1 }
    }

    /// The plane of light of a channel that scattered so often.
    pub(crate) fn of(self, channel: usize, order: u32) -> usize {
        let part = match order {
            1 => 0,
            0 => 2,
            _ => 1,
        };
        channel
            + if self.components {
                part * self.channels
            } else {
                0
            }
    }
}

/// A way to make a picture of a scene.
pub trait Method: Sync {
    /// The scene.
    fn scene(&self) -> &Scene;

    /// A picture without any light yet.
    fn empty(&self) -> Picture;

    /// Radiances and powers of the round `index`, which depend on nothing but the seed.
    fn round(&self, index: u64) -> (Vec<f64>, Vec<f64>);

    /// Adds the rounds of `range` to `picture`, in order, whatever thread made them. `after` is
    /// told of each and may stop; then the picture holds the rounds so far.
    fn run(
        &self,
        range: Range<u64>,
        picture: &mut Picture,
        after: &mut dyn FnMut(&Picture) -> ControlFlow<()>,
    ) {
        let together = rayon::current_num_threads() as u64;
        let mut next = range.start;
        while next < range.end {
            let end = range.end.min(next + together);
            let rounds: Vec<_> = (next..end)
                .into_par_iter()
                .map(|index| self.round(index))
                .collect();
            for (radiance, powers) in rounds {
                picture.add(&radiance, &powers);
                if after(picture).is_break() {
                    return;
                }
            }
            next = end;
        }
    }
}

//! A simulation, and how it is run.

use crate::beam::Incidence;
use crate::cells::{BlockCells, Layout, MOST_BLOCKS, PHOTONS_PER_BLOCK, TallySpec};
use crate::error::{CannotMerge, InvalidSimulation};
use crate::medium;
use crate::problem::Problem;
use crate::tally::{Tally, TallyState};
use crate::{lanes, scalar};
use physics::LayeredMedium;
use physics::simd::SimdPath;
use rayon::prelude::*;
use std::ops::{ControlFlow, Range};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Which walk follows the photons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Walk {
    /// The definition: one photon after another, in double precision.
    Scalar,
    /// The fast form, in lanes of single precision.
    Lanes(SimdPath),
}

/// A medium, its light, what is counted, and a seed: all that a result depends on.
#[derive(Clone, Debug)]
pub struct Simulation {
    problem: Problem,
    layout: Arc<Layout>,
    walk: Walk,
    fingerprint: u64,
}

impl Simulation {
    /// A simulation in lanes, on the fastest path of this processor.
    ///
    /// # Errors
    ///
    /// [`InvalidSimulation`] names the first thing that is wrong with medium, light or tallies.
    pub fn new(
        medium: LayeredMedium,
        incidence: Incidence,
        tally: &TallySpec,
        seed: u64,
    ) -> Result<Self, InvalidSimulation> {
        let medium = medium::walkable(medium)?;
        let incidence = incidence.validated()?;
        let path_cutoff = match tally.path_cutoff_mm {
            Some(path_mm) if !(path_mm > 0.0 && path_mm.is_finite()) => {
                return Err(InvalidSimulation::Cutoff { path_mm });
            }
            Some(path_mm) => path_mm,
            None => match medium::lossless_endless(&medium) {
                Some(layer) => return Err(InvalidSimulation::LosslessEndless { layer }),
                None => f64::INFINITY,
            },
        };
        let layout = Arc::new(Layout::new(tally, medium.layers.len())?);
        let question = fnv(&format!("{medium:?} {incidence:?} {tally:?} {seed}"));
        let tops = medium.tops();
        let problem = Problem {
            medium,
            tops,
            incidence,
            path_cutoff,
            seed,
        };
        let simulation = Self {
            problem,
            layout,
            walk: Walk::Scalar,
            fingerprint: question,
        };
        Ok(simulation.with_walk(Walk::Lanes(SimdPath::best())))
    }

    /// The same simulation by another walk. A path that this processor lacks falls back to the
    /// portable one.
    #[must_use]
    pub fn with_walk(self, walk: Walk) -> Self {
        let walk = match walk {
            Walk::Lanes(path) if !path.is_available() => Walk::Lanes(SimdPath::Portable),
            _ => walk,
        };
        // The walk goes into the low byte, so that it can be replaced.
        let code = match walk {
            Walk::Scalar => 0,
            Walk::Lanes(path) => 1 + path as u64,
        };
        Self {
            walk,
            fingerprint: self.fingerprint & !0xff | code,
            ..self
        }
    }

    /// The walk that it takes.
    pub fn walk(&self) -> Walk {
        self.walk
    }

    /// A result without photons.
    pub fn empty(&self) -> Tally {
        Tally::new(self.fingerprint, Arc::clone(&self.layout))
    }

    /// A result that was kept.
    ///
    /// # Errors
    ///
    /// [`CannotMerge`] if it belongs to another simulation or is damaged.
    pub fn restore(&self, state: TallyState) -> Result<Tally, CannotMerge> {
        self.empty().restored(state)
    }

    /// The blocks that hold at least `photons` photons, rounded up to a whole block.
    ///
    /// # Errors
    ///
    /// [`InvalidSimulation`] for no photons, or for more than a run can hold.
    pub fn blocks_for(photons: u64) -> Result<Range<u64>, InvalidSimulation> {
        let limit = MOST_BLOCKS * PHOTONS_PER_BLOCK;
        match photons {
            0 => Err(InvalidSimulation::NoPhotons),
            _ if photons > limit => Err(InvalidSimulation::TooManyPhotons { photons, limit }),
            _ => Ok(0..photons.div_ceil(PHOTONS_PER_BLOCK)),
        }
    }

    /// Follows the photons of `blocks`, on the threads of the current rayon pool.
    ///
    /// `progress` sees the result after every few blocks and may end the run, as `stop` does at
    /// any moment. What is returned then is a valid, smaller result: the blocks that were
    /// finished. Which photons are followed, and how, depends on seed and block alone, and so
    /// does the result. Blocks beyond the limit of [`Self::blocks_for`] are left out.
    pub fn run(
        &self,
        blocks: Range<u64>,
        stop: &AtomicBool,
        mut progress: impl FnMut(&Tally) -> ControlFlow<()>,
    ) -> Tally {
        let mut tally = self.empty();
        // Enough for threads to wait for one another little, few enough to report soon.
        let batch = 16 * rayon::current_num_threads() as u64;
        let (mut start, end) = (blocks.start, blocks.end.min(MOST_BLOCKS));
        while start < end && !stop.load(Ordering::Relaxed) {
            let next = (start + batch).min(end);
            let finished: Vec<_> = (start..next)
                .into_par_iter()
                .map(|block| self.block(block, stop))
                .collect();
            for (block, cells) in (start..next).zip(&finished) {
                if let Some(cells) = cells {
                    tally.push(block, cells);
                }
            }
            start = next;
            if progress(&tally).is_break() {
                break;
            }
        }
        tally
    }

    /// Follows `photons` photons, rounded up to a whole block, without a word on the way.
    ///
    /// # Errors
    ///
    /// As [`Self::blocks_for`].
    pub fn run_photons(&self, photons: u64) -> Result<Tally, InvalidSimulation> {
        let blocks = Self::blocks_for(photons)?;
        Ok(self.run(blocks, &AtomicBool::new(false), |_| {
            ControlFlow::Continue(())
        }))
    }

    fn block(&self, block: u64, stop: &AtomicBool) -> Option<BlockCells<'_>> {
        let cells = BlockCells::new(&self.layout);
        let stop = || stop.load(Ordering::Relaxed);
        match self.walk {
            Walk::Scalar => scalar::walk_block(&self.problem, block, cells, &stop),
            Walk::Lanes(path) => lanes::walk_block(&self.problem, path, block, cells, &stop),
        }
    }
}

/// The hash of Fowler, Noll and Vo (1a, 64 bits): the same in every version of every compiler.
fn fnv(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

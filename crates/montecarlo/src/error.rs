//! What can be wrong with a simulation that was asked for.

use crate::bins::Axis;
use physics::layered::InvalidLayers;
use thiserror::Error;

/// A simulation cannot be run as it was asked for.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum InvalidSimulation {
    /// The layers do not make a medium.
    #[error(transparent)]
    Layers(#[from] InvalidLayers),
    /// A layer without end that scatters and does not absorb: the mean path is infinite.
    #[error(
        "layer {layer} has no end and does not absorb: the mean path of its photons is \
         infinite; give a cut-off for the path length"
    )]
    LosslessEndless {
        /// Number of the layer, from 1 at the top.
        layer: usize,
    },
    /// No layer scatters, or hardly one photon in a billion would be scattered.
    #[error(
        "the medium scatters with optical thickness {optical_thickness:e} only: no photon would \
         scatter, and Fresnel's formulas are the answer"
    )]
    TooThin {
        /// Σ σₛ·thickness.
        optical_thickness: f64,
    },
    /// Layers so opaque or so thin that single precision cannot place a photon in them.
    #[error(
        "layer {layer}: a mean free path of {mean_free_path_mm:e} mm in a layer of \
         {thickness_mm:e} mm is too small a part to be followed; give at least a ten-millionth"
    )]
    TooDense {
        /// Number of the layer, from 1 at the top.
        layer: usize,
        /// 1/σₛ, mm.
        mean_free_path_mm: f64,
        /// Its thickness, mm.
        thickness_mm: f64,
    },
    /// The beam does not come from above.
    #[error("angle of incidence must be at least 0 and below 90 degrees, got {degrees} degrees")]
    Angle {
        /// What was given, degrees.
        degrees: f64,
    },
    /// The beam has no width.
    #[error("width of the beam must be above 0 mm, got {fwhm_mm} mm; a pencil beam has none")]
    BeamWidth {
        /// What was given, mm.
        fwhm_mm: f64,
    },
    /// The edges of bins do not increase from 0.
    #[error(
        "{axis}: edges of bins must start at 0 and increase, got {lower} followed by {upper} at \
         bin {bin}"
    )]
    Bins {
        /// The tally whose bins they are.
        axis: Axis,
        /// The offending bin, from 1.
        bin: usize,
        /// Its lower edge.
        lower: f64,
        /// Its upper edge.
        upper: f64,
    },
    /// More cells of tallies than memory should hold.
    #[error("the tallies have {cells} cells, more than {limit}: take fewer or coarser bins")]
    TooManyCells {
        /// Cells asked for.
        cells: usize,
        /// Cells allowed.
        limit: usize,
    },
    /// A tally of two quantities together, one of which has no bins.
    #[error("a tally by {rows} and {columns} together needs bins of both")]
    Joint {
        /// One quantity.
        rows: Axis,
        /// The other.
        columns: Axis,
    },
    /// A cut-off of the path that is not a positive length.
    #[error("the cut-off for the path length must be above 0 mm, got {path_mm} mm")]
    Cutoff {
        /// What was given, mm.
        path_mm: f64,
    },
    /// No photons were asked for.
    #[error("the number of photons must be at least 1")]
    NoPhotons,
    /// More photons than blocks can be counted.
    #[error("{photons} photons are more than {limit} that a run can hold")]
    TooManyPhotons {
        /// What was asked for.
        photons: u64,
        /// What is allowed.
        limit: u64,
    },
}

/// Two results cannot be put together.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum CannotMerge {
    /// The results are of different simulations: another medium, beam, tally, seed or path.
    #[error(
        "the results belong to different simulations (fingerprints {0:016x} and {1:016x}): \
         medium, beam, tallies, seed and instruction path must be the same"
    )]
    OtherSimulation(u64, u64),
    /// Both hold the same photons.
    #[error("both results hold block {block}: its photons would be counted twice")]
    SamePhotons {
        /// The first block that both hold.
        block: u64,
    },
    /// A stored result has another number of cells than the simulation.
    #[error("the stored result has {found} cells, the simulation {expected}: it is damaged")]
    Damaged {
        /// Cells in the stored result.
        found: usize,
        /// Cells of the simulation.
        expected: usize,
    },
}

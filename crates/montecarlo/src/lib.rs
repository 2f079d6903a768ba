//! Photons walking through layered media.
//!
//! The random walk is the truth that diffusion theory approximates. Layers have an index of their
//! own and may be clear; every interface follows Fresnel; beams have a width and an angle; every
//! number comes with a standard error. A plain walk in double precision is the definition, the one
//! in lanes its fast form, and tests tie the two together.
//!
//! It leaves out polarisation, fluorescence, time (path lengths are there), rough boundaries and
//! any shape but plane layers. It knows no files and prints nothing.
//!
//! | module | holds |
//! |---|---|
//! | [`beam`] | [`Incidence`]: how they come in |
//! | [`cells`] | [`TallySpec`]: what is counted, and exact sums of it |
//! | [`tally`] | [`Tally`]: what came of it, with standard errors |
//! | [`simulation`] | [`Simulation`]: all together, and how it is run |
//! | `path` | its loop on the instructions that [`SimdPath`] names |
//! | [`error`] | [`InvalidSimulation`], [`CannotMerge`] |
//!
//! ```
//! use montecarlo::{Incidence, LayeredMedium, Simulation, TallySpec};
//! use physics::Medium;
//!
//! // Giovanelli's half-space: total reflectance 0.2599, of which 0.04 at the surface.
//! let medium = Medium { sigma_a: 0.1, sigma_s: 0.9, g: 0.0, eta: 1.5 };
//! let half_space = LayeredMedium::half_space(&medium);
//! let simulation = Simulation::new(half_space, Incidence::PENCIL, &TallySpec::default(), 1)?;
//! let tally = simulation.run_photons(100_000)?;
//! let reflectance = tally.reflectance();
//! assert!((reflectance.value - 0.2199).abs() < 4.0 * reflectance.u);
//! # Ok::<(), montecarlo::InvalidSimulation>(())
//! ```

pub mod beam;
mod bins;
mod boundary;
pub mod cells;
pub mod error;
mod kernel;
mod lanes;
mod medium;
pub mod path;
#[doc(hidden)]
pub mod pieces;
mod problem;
mod random;
mod scalar;
pub mod simulation;
pub mod tally;

pub use beam::{Direction, Incidence};
pub use bins::Axis;
pub use boundary::Side;
pub use cells::{PHOTONS_PER_BLOCK, TallySpec};
pub use error::{CannotMerge, InvalidSimulation};
pub use physics::footprint::Beam;
pub use physics::layered::{InvalidLayers, Layer, LayeredMedium, Place};
pub use physics::phase::{Phase, PhaseMixture, TabulatedPhase};
pub use physics::simd::SimdPath;
pub use simulation::{Simulation, Walk};
pub use tally::{Binned, Binned2, Estimate, Tally, TallyState, ring_area, solid_angle};

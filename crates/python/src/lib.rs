//! beamspot for Python: doors onto the same functions that the command line opens.
//!
//! Arrays come in as anything that NumPy can read and go out as NumPy arrays; the interpreter is
//! let go of while beamspot works. What the command line answers with exit 2 or 3 is a
//! `ValueError` here, with the same sentence.

#![expect(
    clippy::needless_pass_by_value,
    reason = "arguments come from Python by value"
)]

mod arrays;
mod batch;
mod fitting;
mod frames;
mod measurement;
mod models;
mod simulation;
mod work;

use pipeline::{Error, Kind};
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::prelude::*;

/// The exception for an error of the pipeline.
fn raised(error: &Error) -> PyErr {
    let text = error.to_string();
    match error.kind() {
        Kind::Usage | Kind::Input => PyValueError::new_err(text),
        Kind::Interrupted => PyKeyboardInterrupt::new_err(text),
        Kind::Quality | Kind::Partial | Kind::Fault => PyRuntimeError::new_err(text),
    }
}

/// The same for an error of one of the stages: what it was given cannot be used.
fn refused(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

#[pymodule]
mod _beamspot {
    #[pymodule_export]
    use crate::batch::{Batch, OpenBatch, batch, measure_one, open_batch};
    #[pymodule_export]
    use crate::fitting::{Estimate, Fit, FitMany, fit, fit_many};
    #[pymodule_export]
    use crate::frames::{Profile, Radiance, merge, radial_profile};
    #[pymodule_export]
    use crate::measurement::{Measurement, measure};
    #[pymodule_export]
    use crate::models::{
        Material, better_dipole, dipole, directional, kienle_patterson, materials, monte_carlo,
        multipole, photon_beam_diffusion, total_reflectance,
    };
    #[pymodule_export]
    use crate::simulation::{Simulation, fastest_simd, read_medium, restore_simulation, simulate};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}

//! `measure`.

use crate::fitting::{Fit, objects};
use crate::frames::Profile;
use crate::models::{Material, choice};
use crate::work;
use crate::{raised, refused};
use pipeline::capture::{self, Loaded};
use pipeline::measure::{self as job, Choices};
use pipeline::{fitting, outputs};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// A capture measured.
#[pyclass(frozen, module = "beamspot")]
pub(crate) struct Measurement {
    loaded: Loaded,
    inner: job::Measurement,
}

#[pymethods]
impl Measurement {
    /// Name of the material.
    #[getter]
    fn material(&self) -> &str {
        &self.inner.material
    }

    /// The fit of each channel.
    #[getter]
    fn fits(&self) -> Vec<Fit> {
        let each = self.inner.fits.iter().zip(&self.inner.given);
        each.map(|(fit, given)| Fit::new(fit.clone(), given))
            .collect()
    }

    /// Profile and total of each channel.
    #[getter]
    fn profiles(&self) -> Vec<Profile> {
        self.inner
            .measured
            .iter()
            .cloned()
            .map(Profile::from)
            .collect()
    }

    /// The rows for a material table.
    #[getter]
    fn materials(&self) -> Vec<Material> {
        self.inner.materials.iter().map(Material::from).collect()
    }

    /// How far each channel can be trusted, in sentences.
    #[getter]
    fn verdicts(&self) -> Vec<String> {
        self.inner.verdict_lines()
    }

    /// What should be known of the measurement as a whole, in sentences.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.inner.warnings.clone()
    }

    /// What stood in for what the manifest left out, in sentences.
    #[getter]
    fn assumptions(&self) -> Vec<String> {
        self.inner.assumptions.clone()
    }

    /// Everything, as `fit.json` has it.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        objects(py, &self.inner.document().to_json().map_err(refused)?)
    }

    /// Writes what `beamspot measure` writes into `folder`: the picture, profiles, fit.json, the
    /// table and the report. Raises ValueError where a file is in the way and not `force`.
    #[pyo3(signature = (folder, *, force = false))]
    fn write(&self, py: Python<'_>, folder: PathBuf, force: bool) -> PyResult<()> {
        let written = py.detach(|| {
            let files = outputs::open(&self.loaded, &folder, force)?;
            outputs::write(files, &self.loaded, &self.inner)
        });
        written.map_err(|e| raised(&e))
    }

    fn __repr__(&self) -> String {
        let fits: Vec<String> = self.fits().iter().map(Fit::__repr__).collect();
        format!("Measurement({}: {})", self.inner.material, fits.join(", "))
    }
}

/// How to measure, as keyword arguments say it.
pub(crate) fn choices(
    model: &str,
    constraint: &str,
    g: Option<f64>,
    range_mm: Option<(f64, f64)>,
    confirm: bool,
    bootstrap: usize,
) -> PyResult<Choices> {
    Ok(Choices {
        model: choice(model, g, None, 0.0),
        constraint: fitting::constraint(constraint).map_err(|e| raised(&e))?,
        range_mm,
        confirm,
        bootstrap,
        ..Choices::default()
    })
}

/// Measures a capture: frames to coefficients, as `beamspot measure` does.
///
/// `path`: the capture.toml. `model`, `g`, `constraint`, `range_mm`: as for `fit`. `confirm`:
/// whether the fitted media are simulated with a million photons. `bootstrap`: replicas to draw
/// and fit. `threads`: at most so many; the same numbers on any. Raises ValueError with the file and
/// the field at fault; Ctrl-C stops it.
#[pyfunction]
#[pyo3(signature = (path, *, model = "dipole", constraint = "joint", g = None, range_mm = None,
    confirm = true, bootstrap = 0, threads = None))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn measure(
    py: Python<'_>,
    path: PathBuf,
    model: &str,
    constraint: &str,
    g: Option<f64>,
    range_mm: Option<(f64, f64)>,
    confirm: bool,
    bootstrap: usize,
    threads: Option<Bound<'_, PyAny>>,
) -> PyResult<Measurement> {
    let choices = choices(model, constraint, g, range_mm, confirm, bootstrap)?;
    let pool = work::pool(threads.as_ref())?;
    work::done(py, pool.as_ref(), |monitor| {
        let loaded = capture::load(&path)?;
        let inner = job::measure(&loaded, &choices, monitor)?;
        Ok(Measurement { loaded, inner })
    })
}

//! `batch`, and what `beamspot.distributed` makes of it.

use crate::fitting::objects;
use crate::measurement::choices;
use crate::models::Material;
use crate::work;
use crate::{raised, refused};
use pipeline::Kind;
use pipeline::batch::{self as job, Failure, List, Listed, Open, Options, Report};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::ffi::CString;
use std::path::PathBuf;

/// What became of many captures.
#[pyclass(frozen, module = "beamspot")]
pub(crate) struct Batch {
    inner: job::Batch,
}

#[pymethods]
impl Batch {
    /// Names of the captures, in the order of the list.
    #[getter]
    fn captures(&self) -> Vec<&str> {
        self.inner
            .captures
            .iter()
            .map(|c| c.name.as_str())
            .collect()
    }

    /// The rows of materials.csv, of all captures that were measured.
    #[getter]
    fn materials(&self) -> Vec<Material> {
        let found = self
            .inner
            .captures
            .iter()
            .filter_map(|c| c.found.as_ref().ok());
        found
            .flat_map(|f| &f.materials)
            .map(Material::from)
            .collect()
    }

    /// Why captures gave nothing, by their names.
    #[getter]
    fn errors(&self) -> BTreeMap<&str, &str> {
        let each = self.inner.captures.iter();
        each.filter_map(|c| Some((c.name.as_str(), c.found.as_ref().err()?.error.as_str())))
            .collect()
    }

    /// What the command prints: captures that want mending, and how many there are.
    #[getter]
    fn summary(&self) -> Vec<String> {
        self.inner.lines()
    }

    /// Everything, as `beamspot batch --json` prints it.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let text = serde_json::to_string(&self.inner.document());
        objects(py, &text.map_err(refused)?)
    }

    fn __len__(&self) -> usize {
        self.inner.captures.len()
    }

    fn __repr__(&self) -> String {
        let (all, failed) = (self.inner.captures.len(), self.inner.failed());
        format!("Batch({all} captures, {failed} not measured)")
    }
}

/// A batch as it is returned: what was not measured is warned of, since everything else is there.
fn told(py: Python<'_>, inner: job::Batch) -> PyResult<Batch> {
    if let Err(error) = inner.complete() {
        let text = CString::new(error.to_string()).map_err(refused)?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
    }
    Ok(Batch { inner })
}

/// One path, or many.
fn paths(captures: &Bound<'_, PyAny>) -> PyResult<Vec<PathBuf>> {
    match captures.extract() {
        Ok(path) => Ok(vec![path]),
        Err(_) => captures.try_iter()?.map(|path| path?.extract()).collect(),
    }
}

/// Measures many captures side by side, as `beamspot batch` does, and leaves the same files.
///
/// `captures`: manifests, patterns of them like "series/*/capture.toml", or files with one of these
/// on each line; one or a sequence. `folder`: holds a folder for each capture below captures/, and
/// materials.csv, status.csv and report.html of all. `resume`: goes on with what a batch into the
/// same folder left undone. `force`: replaces what stands there. `model`, `g`, `constraint`,
/// `range_mm`, `confirm`, `bootstrap`: as for `measure`.
///
/// A capture that cannot be measured stops no other: it is in `errors` of the result and in
/// status.csv, and a warning says how many there are. Raises ValueError where the call makes no
/// sense, something is in the way or another batch writes to the folder, RuntimeError where the
/// disk is full; Ctrl-C stops it. What was finished by then stays, for `resume`.
#[pyfunction]
#[pyo3(signature = (captures, folder, *, resume = false, force = false, model = "dipole",
    constraint = "joint", g = None, range_mm = None, confirm = true, bootstrap = 0))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn batch(
    py: Python<'_>,
    captures: Bound<'_, PyAny>,
    folder: PathBuf,
    resume: bool,
    force: bool,
    model: &str,
    constraint: &str,
    g: Option<f64>,
    range_mm: Option<(f64, f64)>,
    confirm: bool,
    bootstrap: usize,
) -> PyResult<Batch> {
    let captures = paths(&captures)?;
    let options = Options {
        choices: choices(model, constraint, g, range_mm, confirm, bootstrap)?,
        resume,
        force,
    };
    let inner = work::done(py, None, |monitor| {
        let list = List::read(&captures)?;
        job::run(&list, &folder, &options, monitor)
    })?;
    told(py, inner)
}

/// A batch whose captures other processes measure: it holds the lock of the folder.
#[pyclass(frozen, module = "beamspot._beamspot")]
pub(crate) struct OpenBatch {
    inner: Open,
}

/// Material, state, error, and whether it had been measured before: of one capture.
type Told = (Option<String>, Option<&'static str>, String, bool);

#[pymethods]
impl OpenBatch {
    /// Name and absolute path of each capture.
    #[getter]
    fn captures(&self) -> PyResult<Vec<(&str, PathBuf)>> {
        let each = self.inner.captures().iter();
        each.map(|c| Ok((c.name.as_str(), std::path::absolute(&c.manifest)?)))
            .collect()
    }

    /// Writes the tables, from what `measure_one` said of each capture, in their order.
    fn finish(
        &self,
        py: Python<'_>,
        reports: Vec<(Option<String>, Option<String>, String, bool)>,
    ) -> PyResult<Batch> {
        let report = |(material, state, error, stood): (_, Option<String>, _, _)| Report {
            material,
            stood: match state.as_deref() {
                None => Ok(stood),
                Some(state) => Err(Failure {
                    kind: if state == "fault" {
                        Kind::Fault
                    } else {
                        Kind::Input
                    },
                    error,
                }),
            },
        };
        let reports = reports.into_iter().map(report).collect();
        told(py, work::done(py, None, |_| self.inner.finish(reports))?)
    }
}

/// The keyword arguments of `batch`, as a dict that has all of them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Asked {
    resume: bool,
    force: bool,
    model: String,
    constraint: String,
    g: Option<f64>,
    range_mm: Option<(f64, f64)>,
    confirm: bool,
    bootstrap: usize,
}

impl Asked {
    fn options(&self) -> PyResult<Options> {
        Ok(Options {
            choices: choices(
                &self.model,
                &self.constraint,
                self.g,
                self.range_mm,
                self.confirm,
                self.bootstrap,
            )?,
            resume: self.resume,
            force: self.force,
        })
    }
}

/// Opens a folder for a batch; `options`: the other arguments of `batch`.
#[pyfunction]
pub(crate) fn open_batch(
    captures: Bound<'_, PyAny>,
    folder: PathBuf,
    options: Asked,
) -> PyResult<OpenBatch> {
    let options = options.options()?;
    let list = List::read(&paths(&captures)?).map_err(|e| raised(&e))?;
    let inner = Open::new(&list, &folder, &options).map_err(|e| raised(&e))?;
    Ok(OpenBatch { inner })
}

/// Measures one capture of a batch that is open in `folder`, on one thread; `options`: the other
/// arguments of `batch`.
#[pyfunction]
pub(crate) fn measure_one(
    py: Python<'_>,
    name: String,
    manifest: PathBuf,
    folder: PathBuf,
    options: Asked,
) -> PyResult<Told> {
    let options = options.options()?;
    let listed = Listed { name, manifest };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(refused)?;
    let report = work::done(py, Some(&pool), |monitor| {
        job::capture(&folder, &listed, &options, monitor)
    })?;
    Ok(match report.stood {
        Ok(stood) => (report.material, None, String::new(), stood),
        Err(failure) => (report.material, Some(failure.state()), failure.error, false),
    })
}

//! `simulate`.

use crate::fitting::objects;
use crate::work;
use crate::{raised, refused};
use formats::medium_toml::{self, MediumFile};
use montecarlo::Side;
use numpy::PyArray1;
use physics::ProfilePoint;
use physics::simd::SimdPath;
use pipeline::simulation::{self, Part, Photons};
use pipeline::tallies::tables;
use pipeline::{files, medium};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Photons followed through layers: shares of the incident power. Parts of one run add up to the
/// run, byte for byte: `simulate(m, n, part=(0, 2)) + simulate(m, n, part=(1, 2))`.
#[pyclass(frozen, module = "beamspot")]
pub(crate) struct Simulation {
    inner: Photons,
}

impl Simulation {
    fn column<'py>(
        &self,
        py: Python<'py>,
        side: Side,
        of: fn(&ProfilePoint) -> f64,
    ) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.inner.tally().profile(side).iter().map(of))
    }
}

#[pymethods]
impl Simulation {
    /// Photons followed: whole blocks of them, at least as many as were asked for.
    #[getter]
    fn photons(&self) -> u64 {
        self.inner.tally().photons()
    }

    /// Every total with its standard error, as `totals.json` has it: {"value", "u"} under
    /// "specular", "diffuse_reflectance", "transmittance", "absorbed" and others.
    #[getter]
    fn totals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let totals = self.inner.totals();
        objects(py, &serde_json::to_string(&totals).map_err(refused)?)
    }

    /// Mean radius of each ring, mm: (n,).
    #[getter]
    fn radius_mm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, Side::Above, |p| p.radius_mm)
    }

    /// Light that leaves on the lit side in each ring, mm^-2, the specular part left out: (n,).
    #[getter]
    fn reflectance_per_mm2<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, Side::Above, |p| p.reflectance_per_mm2)
    }

    /// Its standard error, mm^-2: (n,).
    #[getter]
    fn u_reflectance_per_mm2<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, Side::Above, |p| p.u_reflectance_per_mm2)
    }

    /// Light that leaves on the far side in each ring, mm^-2: (n,).
    #[getter]
    fn transmittance_per_mm2<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, Side::Below, |p| p.reflectance_per_mm2)
    }

    /// Its standard error, mm^-2: (n,).
    #[getter]
    fn u_transmittance_per_mm2<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, Side::Below, |p| p.u_reflectance_per_mm2)
    }

    /// Every other tally that the medium asks for, as `simulate` writes it to a file of that name:
    /// {"reflectance_angle": {"angle_min_deg": (n,), ..., "share": (n,), "u_share": (n,), ...}}.
    /// What lies beyond the last bin has rows of its own; NaN stands where the file is blank.
    #[getter]
    fn tables<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let out = PyDict::new(py);
        for table in tables(&self.inner.medium().tally, self.inner.tally()) {
            let columns = PyDict::new(py);
            for (i, name) in table.columns.iter().enumerate() {
                let column = table.rows.iter().map(|row| row[i].unwrap_or(f64::NAN));
                columns.set_item(name, PyArray1::from_iter(py, column))?;
            }
            out.set_item(table.name, columns)?;
        }
        Ok(out)
    }

    fn __add__(&self, other: &Self) -> PyResult<Self> {
        let inner = self.inner.merge(&other.inner).map_err(|e| raised(&e))?;
        Ok(Self { inner })
    }

    /// For pickle: the form of state.json, so that another version says that it is one.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let restore = slf.py().import("beamspot._beamspot")?;
        let state = slf.get().inner.to_json().map_err(|e| raised(&e))?;
        Ok((restore.getattr("restore_simulation")?, (state,)))
    }

    fn __repr__(&self) -> String {
        format!("Simulation({} photons)", self.inner.tally().photons())
    }
}

/// A simulation that was pickled.
#[pyfunction]
pub(crate) fn restore_simulation(state: &str) -> PyResult<Simulation> {
    let inner = Photons::from_json(state).map_err(|e| raised(&e))?;
    Ok(Simulation { inner })
}

/// The fastest instruction path of this machine.
#[pyfunction]
pub(crate) fn fastest_simd() -> &'static str {
    SimdPath::best().name()
}

/// The medium of a file, of a shipped name, or of a dict laid out like the file.
fn medium_of(py: Python<'_>, medium: &Bound<'_, PyAny>) -> PyResult<MediumFile> {
    if let Ok(dict) = medium.cast::<PyDict>() {
        let text: String = py
            .import("json")?
            .call_method1("dumps", (dict,))?
            .extract()?;
        return serde_json::from_str(&text).map_err(|e| refused(format!("medium: {e}")));
    }
    let path: PathBuf = medium.extract()?;
    let shipped = path.to_str().filter(|_| !path.exists());
    let text = match shipped.and_then(medium::shipped) {
        Some(text) => text.to_owned(),
        None => files::read_text(&path).map_err(|e| raised(&e))?,
    };
    medium_toml::parse(&text).map_err(|e| refused(format!("{}: {e}", path.display())))
}

/// The medium of a file, of a shipped name, or of a dict laid out like the file, as such a dict
/// with nothing left out.
#[pyfunction]
pub(crate) fn read_medium<'py>(
    py: Python<'py>,
    medium: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let file = medium_of(py, medium)?;
    objects(py, &serde_json::to_string(&file).map_err(refused)?)
}

/// Follows photons through layers.
///
/// `medium`: path of a MEDIUM.toml, "skin" or "leaf", or a dict laid out like the file, for example
/// {"layer": [{"sigma_a_per_mm": 0.0041, "sigma_s_per_mm": 2.62, "eta": 1.5}]}. `photons`: how many
/// at least. `seed`: the same gives the same numbers on any number of threads. `simd`: the
/// instruction path; the fastest where left out. `part`: (k, n) follows the k-th, from 0, of n parts
/// of the run, here or on another machine; all n added up, in any order, are the run to the byte.
/// `threads`: at most so many. Raises ValueError for a medium that is none; Ctrl-C stops it.
#[pyfunction]
#[pyo3(signature = (medium, photons = 1e6, seed = 1, *, simd = None, part = None, threads = None))]
pub(crate) fn simulate(
    py: Python<'_>,
    medium: &Bound<'_, PyAny>,
    photons: f64,
    seed: u64,
    simd: Option<&str>,
    part: Option<(u64, u64)>,
    threads: Option<Bound<'_, PyAny>>,
) -> PyResult<Simulation> {
    if !(1.0..=1e18).contains(&photons) {
        return Err(refused(format!(
            "photons: expected a number of at least 1, got {photons}"
        )));
    }
    let file = medium_of(py, medium)?;
    let part = part.map_or(Part::WHOLE, |(index, count)| Part { index, count });
    let pool = work::pool(threads.as_ref())?;
    let inner = work::done(py, pool.as_ref(), |monitor| {
        simulation::run(&file, photons as u64, part, seed, simd, monitor)
    })?;
    Ok(Simulation { inner })
}

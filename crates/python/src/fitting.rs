//! `fit` and `fit_many`.

use crate::arrays::{numbers, table};
use crate::models::choice;
use crate::work;
use crate::{raised, refused};
use ::fit::{Constraint, ManyFits, Profiles, Totals, Warning};
use numpy::ndarray::ArrayView2;
use numpy::{AllowTypeChange, PyArray1, PyArrayLike2};
use physics::{ProfilePoint, RadialProfile, TotalReflectance};
use pipeline::fit_json::{FitDocument, termination_name};
use pipeline::fitting::{self, Given, ScaleInput};
use pipeline::unknown_g;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ffi::CString;

/// Relative uncertainty of values that come without one.
const U_RELATIVE: f64 = 0.01;

/// A coefficient with its standard uncertainty and 95 % interval, mm^-1.
#[pyclass(frozen, get_all, module = "beamspot")]
#[derive(Clone, Copy)]
pub(crate) struct Estimate {
    /// Best estimate.
    value: f64,
    /// Standard uncertainty.
    u: f64,
    /// 95 % interval.
    ci95: (f64, f64),
}

#[pymethods]
impl Estimate {
    fn __repr__(&self) -> String {
        let Self { value, u, ci95 } = self;
        format!("Estimate({value} ± {u}, 95 % in [{}, {}])", ci95.0, ci95.1)
    }

    fn __float__(&self) -> f64 {
        self.value
    }
}

impl From<&::fit::Estimate> for Estimate {
    fn from(e: &::fit::Estimate) -> Self {
        Self {
            value: e.value,
            u: e.u,
            ci95: e.ci95,
        }
    }
}

/// What a fit found.
#[pyclass(frozen, module = "beamspot")]
pub(crate) struct Fit {
    inner: ::fit::Fit,
    eta: f64,
    model: String,
    constraint: Constraint,
    g: Option<f64>,
    u_g: Option<f64>,
}

impl Fit {
    pub(crate) fn new(inner: ::fit::Fit, given: &Given) -> Self {
        Self {
            inner,
            eta: given.eta,
            model: given.model.name.clone(),
            constraint: given.constraint,
            g: given.model.g,
            u_g: given.fitted_g().map(|(_, u)| u),
        }
    }

    fn column<'py>(
        &self,
        py: Python<'py>,
        of: fn(&::fit::Residual) -> f64,
    ) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.inner.residuals.iter().map(of))
    }
}

/// A serialized document as Python's own objects.
pub(crate) fn objects<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyDict>> {
    let loaded = py.import("json")?.call_method1("loads", (json,))?;
    Ok(loaded.cast_into::<PyDict>()?)
}

#[pymethods]
impl Fit {
    /// Absorption coefficient, mm^-1.
    #[getter]
    fn sigma_a_per_mm(&self) -> Estimate {
        (&self.inner.sigma_a).into()
    }

    /// Reduced scattering coefficient, mm^-1.
    #[getter]
    fn sigma_s_prime_per_mm(&self) -> Estimate {
        (&self.inner.sigma_s_prime).into()
    }

    /// Name of the channel.
    #[getter]
    fn channel(&self) -> &str {
        &self.inner.channel
    }

    /// Mean cosine that the model took, and its standard uncertainty where it was fitted along.
    #[getter]
    fn g(&self) -> (Option<f64>, Option<f64>) {
        (self.g, self.u_g)
    }

    /// Correlation of the errors of both coefficients.
    #[getter]
    fn correlation(&self) -> f64 {
        self.inner.correlation
    }

    /// Factor that the shared scale was found to be off by.
    #[getter]
    fn scale(&self) -> f64 {
        self.inner.scale
    }

    /// First and last radius that took part, mm.
    #[getter]
    fn range_mm(&self) -> (f64, f64) {
        self.inner.range_mm
    }

    /// Share of the light that leaves beyond the profile, by the model.
    #[getter]
    fn share_outside(&self) -> f64 {
        self.inner.share_outside
    }

    /// Chi-squared per degree of freedom.
    #[getter]
    fn reduced_chi2(&self) -> f64 {
        self.inner.reduced_chi2
    }

    /// How the search ended: "converged", "at_bound" or "out_of_evaluations".
    #[getter]
    fn termination(&self) -> &'static str {
        termination_name(self.inner.termination)
    }

    /// One-sided 95 % limit of sigma_a where it cannot be told from 0, mm^-1.
    #[getter]
    fn upper_limit_per_mm(&self) -> Option<f64> {
        self.inner.upper_limit
    }

    /// What should be known of these numbers, in sentences.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.inner
            .warnings
            .iter()
            .map(ToString::to_string)
            .collect()
    }

    /// Radii that took part, mm: (n,).
    #[getter]
    fn radius_mm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |r| r.radius_mm)
    }

    /// The model there, per incident power, mm^-2: (n,).
    #[getter]
    fn model_per_mm2<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |r| r.model_per_mm2)
    }

    /// Everything, as `fit.json` has it: the uncertainty budget is under "budget".
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let fits = std::slice::from_ref(&self.inner);
        let (eta, model) = (self.eta, self.model.as_str());
        let document = FitDocument::new(fits, None, eta, model, self.constraint, &[], &[]);
        objects(py, &document.to_json().map_err(refused)?)
    }

    pub(crate) fn __repr__(&self) -> String {
        let (a, s) = (&self.inner.sigma_a, &self.inner.sigma_s_prime);
        format!(
            "Fit({}: sigma_a {} ± {} mm^-1, sigma_s' {} ± {} mm^-1, {})",
            self.model,
            a.value,
            a.u,
            s.value,
            s.u,
            self.termination()
        )
    }
}

fn warn(py: Python<'_>, text: &str) -> PyResult<()> {
    let text = CString::new(text).map_err(refused)?;
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)
}

/// Refuses an array of another length.
fn same_length(name: &str, found: usize, other: &str, expected: usize) -> PyResult<()> {
    if found == expected {
        return Ok(());
    }
    Err(refused(format!(
        "{name}: expected as many numbers as {other} has ({expected}), got {found}"
    )))
}

/// One percent of each value, and something where a value is 0.
fn assumed_u(values: &[f64]) -> Vec<f64> {
    let largest = values.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
    let of = |v: &f64| U_RELATIVE * v.abs().max(1e-6 * largest);
    values.iter().map(of).collect()
}

/// Row by row, where it lies if it lies so.
fn rows<'a>(table: &'a ArrayView2<'_, f64>) -> Cow<'a, [f64]> {
    match table.as_slice() {
        Some(rows) => Cow::Borrowed(rows),
        None => Cow::Owned(table.iter().copied().collect()),
    }
}

fn points(radius_mm: &[f64], values: &[f64], u: &[f64]) -> Vec<ProfilePoint> {
    let rows = radius_mm.iter().zip(values).zip(u);
    rows.map(|((radius_mm, value), u)| ProfilePoint {
        ring_mm: None,
        radius_mm: *radius_mm,
        reflectance_per_mm2: *value,
        u_reflectance_per_mm2: *u,
        pixels: None,
    })
    .collect()
}

/// The scale with what is said of it.
fn scale(u_scale: Option<f64>) -> PyResult<[ScaleInput; 1]> {
    let u_relative = u_scale.unwrap_or(0.0);
    if u_relative < 0.0 {
        return Err(refused(format!(
            "u_scale: expected a number of at least 0, got {u_relative}"
        )));
    }
    Ok([ScaleInput {
        source: "scale",
        u_relative,
    }])
}

/// Without a total `joint` becomes `none`; `exact` cannot be kept.
fn settle(py: Python<'_>, constraint: &str, has_total: bool) -> PyResult<Constraint> {
    let constraint = fitting::constraint(constraint).map_err(|e| raised(&e))?;
    match constraint {
        Constraint::Exact if !has_total => Err(refused(
            "constraint \"exact\" needs a total: give total, over the whole plane per incident \
             power",
        )),
        Constraint::Joint if !has_total => {
            warn(
                py,
                "no total was given: fitted without (constraint \"none\")",
            )?;
            Ok(Constraint::None)
        }
        _ => Ok(constraint),
    }
}

/// Fits sigma_a and sigma_s' to one profile.
///
/// `radius_mm` (n,): radii, increasing, mm. `reflectance_per_mm2` (n,): exitance per incident
/// power, mm^-2, the specular part left out. `u` (n,): standard uncertainties, mm^-2; 1 % of each
/// value where left out, with a warning. `eta`: relative refractive index. `total`: total
/// reflectance over the whole plane per incident power, with `u_total`, its own standard
/// uncertainty. `u_scale`: relative standard uncertainty of the scale that profile and total
/// share. `model`: "dipole", "jensen2001", "better-dipole", "kienle-patterson",
/// "photon-beam-diffusion" (with `g`), "multipole" (with `thickness_mm`), "directional" or
/// "monte-carlo" (with `g`, which is fitted along where it is left out: `g` of the result). `constraint`: "joint", "exact" or "none". `range_mm`: first and last
/// radius of the fit. `entry_loss`: whether only 1 - R_specular of the beam enters.
/// `discrepancy`: whether a closed form's known error against transport takes part.
///
/// Raises ValueError where the data cannot constrain a medium. Source: Jensen et al. (2001),
/// section 3.
#[pyfunction]
#[pyo3(signature = (radius_mm, reflectance_per_mm2, u = None, *, eta, total = None, u_total = None,
    u_scale = None, model = "dipole", constraint = "joint", g = None, range_mm = None,
    thickness_mm = None, entry_loss = true, discrepancy = true))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn fit<'py>(
    py: Python<'py>,
    radius_mm: Bound<'py, PyAny>,
    reflectance_per_mm2: Bound<'py, PyAny>,
    u: Option<Bound<'py, PyAny>>,
    eta: f64,
    total: Option<f64>,
    u_total: Option<f64>,
    u_scale: Option<f64>,
    model: &str,
    constraint: &str,
    g: Option<f64>,
    range_mm: Option<(f64, f64)>,
    thickness_mm: Option<f64>,
    entry_loss: bool,
    discrepancy: bool,
) -> PyResult<Fit> {
    let radius_mm = numbers("radius_mm", &radius_mm)?;
    let values = numbers("reflectance_per_mm2", &reflectance_per_mm2)?;
    same_length(
        "reflectance_per_mm2",
        values.len(),
        "radius_mm",
        radius_mm.len(),
    )?;
    let u = match u {
        Some(u) => numbers("u", &u)?,
        None => {
            warn(py, "u was not given: 1 % of each value was assumed")?;
            assumed_u(&values)
        }
    };
    same_length("u", u.len(), "radius_mm", radius_mm.len())?;
    let constraint = settle(py, constraint, total.is_some())?;
    let profile = RadialProfile {
        channel: "Y".to_owned(),
        points: points(&radius_mm, &values, &u),
    };
    let scale = scale(u_scale)?;
    let total = total.map(|total_reflectance| TotalReflectance {
        channel: "Y".to_owned(),
        total_reflectance,
        u_total_reflectance: u_total.unwrap_or(0.0),
        radius_max_mm: None,
        u_scale_relative: scale[0].u_relative,
        u_offset_per_mm2: 0.0,
    });
    let given = Given {
        discrepancy,
        constraint,
        range_mm,
        entry_loss,
        ..Given::of(choice(model, g, thickness_mm, 0.0), eta)
    };
    let found = py.detach(|| {
        let given = unknown_g::settled(&profile, total.as_ref(), &scale, &given)?;
        let found = fitting::fit_channel(&profile, total.as_ref(), &scale, &given)?;
        Ok(Fit::new(found, &given))
    });
    found.map_err(|e| raised(&e))
}

/// What `fit_many` found: one array a quantity, one number a profile; NaN where a profile could
/// not be fitted, whose reason is in `errors`.
#[pyclass(frozen, module = "beamspot")]
pub(crate) struct FitMany {
    inner: ManyFits,
}

macro_rules! columns {
    ($($(#[$doc:meta])* $name:ident => $field:ident,)*) => {
        #[pymethods]
        impl FitMany {
            $(
                $(#[$doc])*
                #[getter]
                fn $name<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
                    PyArray1::from_slice(py, &self.inner.$field)
                }
            )*

            /// How each search ended, None where there was no fit.
            #[getter]
            fn termination(&self) -> Vec<Option<&'static str>> {
                let each = self.inner.termination.iter();
                each.map(|t| t.map(termination_name)).collect()
            }

            /// Why profiles could not be fitted, by their index.
            #[getter]
            fn errors(&self) -> BTreeMap<usize, String> {
                let each = self.inner.errors.iter();
                each.map(|(i, e)| (*i, e.to_string())).collect()
            }

            /// What should be known of which profile, in sentences, by its index: what `fit` warns
            /// of, but for a point that outweighs all others. Whether the profiles are in another
            /// unit is asked of a few of those that fit badly.
            #[getter]
            fn warnings(&self) -> BTreeMap<usize, Vec<String>> {
                let mut all: BTreeMap<usize, Vec<String>> = BTreeMap::new();
                for (i, warning) in &self.inner.warnings {
                    all.entry(*i).or_default().push(warning.to_string());
                }
                all
            }

            fn __len__(&self) -> usize {
                self.inner.sigma_a.len()
            }

            fn __repr__(&self) -> String {
                let (all, failed) = (self.inner.sigma_a.len(), self.inner.errors.len());
                format!("FitMany({all} profiles, {failed} could not be fitted)")
            }
        }
    };
}

columns! {
    /// Absorption coefficients, mm^-1: (n,).
    sigma_a_per_mm => sigma_a,
    /// Their standard uncertainties, mm^-1: (n,).
    u_sigma_a_per_mm => u_sigma_a,
    /// Lower ends of their 95 % intervals, mm^-1: (n,).
    sigma_a_low_per_mm => sigma_a_low,
    /// Upper ends of their 95 % intervals, mm^-1: (n,).
    sigma_a_high_per_mm => sigma_a_high,
    /// Reduced scattering coefficients, mm^-1: (n,).
    sigma_s_prime_per_mm => sigma_s_prime,
    /// Their standard uncertainties, mm^-1: (n,).
    u_sigma_s_prime_per_mm => u_sigma_s_prime,
    /// Lower ends of their 95 % intervals, mm^-1: (n,).
    sigma_s_prime_low_per_mm => sigma_s_prime_low,
    /// Upper ends of their 95 % intervals, mm^-1: (n,).
    sigma_s_prime_high_per_mm => sigma_s_prime_high,
    /// Correlations of the errors of both: (n,).
    correlation => correlation,
    /// Scale factors found: (n,).
    scale => scale,
    /// Chi-squared per degree of freedom: (n,).
    reduced_chi2 => reduced_chi2,
    /// Shares of the light that leave beyond the last radius: (n,).
    share_outside => share_outside,
}

/// Fits many profiles on the same radii, on all threads; the same answer on any number of them.
///
/// `radius_mm` (m,); `reflectance_per_mm2` (n, m); `u` (n, m) or (m,), 1 % of each value where left
/// out, with a warning; `total` and `u_total` (n,). Everything else as for `fit`, and every number
/// as its own. `discrepancy=False` leaves out the error of a closed form, and is a hundred times
/// faster. `threads`: at most so many. Raises ValueError where the arrays do not belong together; a
/// profile that cannot be fitted does not stop the others, and one that looks as if it were in
/// another unit is warned of.
///
/// With `reflectance_per_mm2` an `xarray.DataArray` the answer is an `xarray.Dataset`, with the
/// coordinates of the array and a variable for each quantity, units in its attributes.
/// `radius_mm` is then the coordinate of radii, `cube.radius_mm`, or as many numbers as there are
/// along the dimension "radius_mm"; a coordinate in another unit is refused. `u`, `total` and
/// `u_total` may be arrays with labels of their own, and so may `eta` and `g`, which may differ by
/// wavelength. An array in chunks (Dask) gives a Dataset in chunks, fitted when it is asked for.
#[pyfunction]
#[pyo3(signature = (radius_mm, reflectance_per_mm2, u = None, *, eta, total = None, u_total = None,
    u_scale = None, model = "dipole", constraint = "joint", g = None, range_mm = None,
    thickness_mm = None, entry_loss = true, discrepancy = true, threads = None))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn fit_many<'py>(
    py: Python<'py>,
    radius_mm: Bound<'py, PyAny>,
    reflectance_per_mm2: Bound<'py, PyAny>,
    u: Option<Bound<'py, PyAny>>,
    eta: f64,
    total: Option<Bound<'py, PyAny>>,
    u_total: Option<Bound<'py, PyAny>>,
    u_scale: Option<f64>,
    model: &str,
    constraint: &str,
    g: Option<f64>,
    range_mm: Option<(f64, f64)>,
    thickness_mm: Option<f64>,
    entry_loss: bool,
    discrepancy: bool,
    threads: Option<Bound<'py, PyAny>>,
) -> PyResult<FitMany> {
    let pool = work::pool(threads.as_ref())?;
    let radius_mm = numbers("radius_mm", &radius_mm)?;
    let given: PyArrayLike2<'py, f64, AllowTypeChange> =
        table("reflectance_per_mm2", &reflectance_per_mm2)?;
    // An array that lies in memory as it should is looked at where it lies.
    let given = given.as_array();
    let (n, columns) = given.dim();
    same_length(
        "a row of reflectance_per_mm2",
        columns,
        "radius_mm",
        radius_mm.len(),
    )?;
    let values = rows(&given);
    let values = &*values;
    let two: PyArrayLike2<'py, f64, AllowTypeChange>;
    let table_of_u: ArrayView2<'_, f64>;
    let (u_rows, made): (Cow<'_, [f64]>, Vec<f64>);
    let u: &[f64] = match u {
        None => {
            warn(py, "u was not given: 1 % of each value was assumed")?;
            let each = values.chunks(radius_mm.len().max(1));
            made = each.flat_map(assumed_u).collect();
            &made
        }
        Some(u) if u.getattr("ndim").is_ok_and(|n| n.eq(2).unwrap_or(false)) => {
            two = table("u", &u)?;
            let (found, expected) = (two.as_array().dim(), given.dim());
            if found != expected {
                return Err(refused(format!(
                    "u: expected the shape of reflectance_per_mm2 {expected:?}, got {found:?}"
                )));
            }
            table_of_u = two.as_array();
            u_rows = rows(&table_of_u);
            &u_rows
        }
        Some(u) => {
            made = numbers("u", &u)?;
            same_length("u", made.len(), "radius_mm", radius_mm.len())?;
            &made
        }
    };
    let constraint = settle(py, constraint, total.is_some())?;
    let totals = match &total {
        Some(total) => {
            let total = numbers("total", total)?;
            same_length("total", total.len(), "reflectance_per_mm2", n)?;
            let u_total = match &u_total {
                Some(u_total) => numbers("u_total", u_total)?,
                None => vec![0.0; n],
            };
            same_length("u_total", u_total.len(), "reflectance_per_mm2", n)?;
            Some((total, u_total))
        }
        None => None,
    };
    let given = Given {
        discrepancy,
        constraint,
        range_mm,
        entry_loss,
        ..Given::of(choice(model, g, thickness_mm, 0.0), eta)
    };
    let scale = scale(u_scale)?;
    let at: Vec<f64> = vec![0.0; radius_mm.len()];
    let points = points(&radius_mm, &at, &at);
    let fitted = || {
        let profiles = Profiles {
            points: &points,
            reflectance_per_mm2: values,
            u_reflectance_per_mm2: u,
            totals: totals.as_ref().map(|(total, u)| Totals {
                total_reflectance: total,
                u_total_reflectance: u,
                radius_max_mm: None,
            }),
        };
        fitting::fit_many(&profiles, &scale, &given)
    };
    let inner = work::done(py, pool.as_ref(), |_| fitted())?;
    let unit = |w: &&(usize, Warning)| matches!(w.1, Warning::AnotherUnit { .. });
    if let Some((i, warning)) = inner.warnings.iter().find(unit) {
        warn(py, &format!("profile {i}: {warning}"))?;
    }
    Ok(FitMany { inner })
}

//! Arrays as Python hands them over: what NumPy would quietly drop is refused by name.

use crate::refused;
use numpy::{AllowTypeChange, Element, PyArrayLike1, PyArrayLike2};
use pyo3::prelude::*;

/// The numbers of the argument `name`.
pub(crate) fn numbers(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = plain(name, given, 1)?;
    let array: PyArrayLike1<'_, f64, AllowTypeChange> = array.extract()?;
    Ok(array.as_array().iter().copied().collect())
}

/// The rows of the argument `name`.
pub(crate) fn table<'py, T>(
    name: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<PyArrayLike2<'py, T, AllowTypeChange>>
where
    T: Element + for<'a> FromPyObject<'a, 'py> + 'py,
{
    plain(name, given, 2)?.extract()
}

/// What was given as an array of real numbers in so many dimensions, none of them masked.
fn plain<'py>(
    name: &str,
    given: &Bound<'py, PyAny>,
    dimensions: usize,
) -> PyResult<Bound<'py, PyAny>> {
    unmasked(name, given)?;
    let array = laid(given, None)?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    // Objects may be numbers; what is not is refused on the way to one.
    if !["b", "i", "u", "f", "O"].contains(&kind.as_str()) {
        let found = array.getattr("dtype")?.str()?;
        return Err(refused(format!(
            "{name}: expected real numbers, got an array of {found}"
        )));
    }
    let found: Vec<usize> = array.getattr("shape")?.extract()?;
    if found.len() == dimensions {
        return Ok(array);
    }
    let expected = if dimensions == 1 { "(n,)" } else { "(n, m)" };
    Err(refused(format!(
        "{name}: expected an array of shape {expected}, got {}",
        array.getattr("shape")?.str()?
    )))
}

/// Refuses numbers that are masked: without the mask they would count.
pub(crate) fn unmasked(name: &str, given: &Bound<'_, PyAny>) -> PyResult<()> {
    let Some(mask) = given.getattr_opt("mask")? else {
        return Ok(());
    };
    let numpy = given.py().import("numpy")?;
    let masked: usize = numpy.call_method1("count_nonzero", (mask,))?.extract()?;
    if masked == 0 {
        return Ok(());
    }
    Err(refused(format!(
        "{name}: {masked} numbers are masked, which would be lost: leave them out"
    )))
}

/// As an array of `dtype`, copied only where it has to be: what came out of a message or the middle of a
/// file may start between two numbers, where it cannot be read in place.
pub(crate) fn laid<'py>(
    given: &Bound<'py, PyAny>,
    dtype: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let numpy = given.py().import("numpy")?;
    numpy.call_method1("require", (given, dtype, ["ALIGNED", "ENSUREARRAY"]))
}

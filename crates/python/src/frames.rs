//! `merge` and `radial_profile`.

use crate::arrays::{laid, table, unmasked};
use crate::refused;
use ::profile::{Measured, ProfileOptions, View};
use hdr::{DarkFrame, Merge};
use numpy::{
    AllowTypeChange, IntoPyArray, PyArray1, PyArrayDyn, PyArrayLike2, PyArrayMethods,
    PyUntypedArrayMethods,
};
use physics::frame::Samples;
use physics::{ChannelMap, Frame, ProfilePoint, Sensor};
use pyo3::prelude::*;

/// A merged picture.
#[pyclass(frozen, module = "beamspot")]
pub(crate) struct Radiance {
    shape: Vec<usize>,
    value: Vec<f32>,
    variance: Vec<f32>,
    /// Names of the channels, in the order of the last axis.
    #[pyo3(get)]
    channels: Vec<String>,
    /// Samples that each frame gave, by increasing exposure, and by channel.
    #[pyo3(get)]
    used: Vec<Vec<u64>>,
    /// Pixels that were masked as hot, by channel.
    #[pyo3(get)]
    hot: Vec<u64>,
    /// Other pixels that are saturated in every frame, by channel.
    #[pyo3(get)]
    saturated_everywhere: Vec<u64>,
}

impl Radiance {
    fn array<'py>(&self, py: Python<'py>, data: &[f32]) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        PyArray1::from_slice(py, data).reshape(self.shape.clone())
    }
}

#[pymethods]
impl Radiance {
    /// Counts per second less dark: (height, width) or (height, width, channels), float32. Noise
    /// may take it below 0.
    #[getter]
    fn value<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        self.array(py, &self.value)
    }

    /// Variance of each value; infinite where no frame measured the pixel.
    #[getter]
    fn variance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        self.array(py, &self.variance)
    }

    fn __repr__(&self) -> String {
        format!("Radiance({:?}, {} frames)", self.shape, self.used.len())
    }
}

/// The frame that an array is: whole numbers of 8 or 16 bits as counts, others as float32.
fn frame(array: &Bound<'_, PyAny>, name: &str) -> PyResult<Frame> {
    let untyped = array.cast::<numpy::PyUntypedArray>().map_err(|_| {
        refused(format!(
            "{name}: expected a NumPy array, got {}",
            array.get_type()
        ))
    })?;
    let (height, width, channels) = match *untyped.shape() {
        [height, width] => (height, width, 1),
        [height, width, channels] => (height, width, channels),
        _ => {
            return Err(refused(format!(
                "{name}: expected an array (height, width) or (height, width, channels), got the \
                 shape {:?}",
                untyped.shape()
            )));
        }
    };
    let kind: String = untyped.dtype().getattr("name")?.extract()?;
    unmasked(name, array)?;
    let samples = match kind.as_str() {
        "uint8" | "uint16" => {
            let counts = laid(array, Some("uint16"))?.cast_into::<PyArrayDyn<u16>>()?;
            Samples::from(
                counts
                    .readonly()
                    .as_array()
                    .iter()
                    .copied()
                    .collect::<Vec<u16>>(),
            )
        }
        "float32" | "float64" | "float16" => {
            let numbers = laid(array, Some("float32"))?.cast_into::<PyArrayDyn<f32>>()?;
            Samples::F32(numbers.readonly().as_array().iter().copied().collect())
        }
        _ => {
            return Err(refused(format!(
                "{name}: expected uint8, uint16 or a float type, got {kind}"
            )));
        }
    };
    Ok(Frame {
        width,
        height,
        channels,
        samples,
    })
}

/// Merges exposures into counts per second, with the variance of every pixel.
///
/// `frames`: arrays (height, width) or (height, width, 3) of raw, linear counts (uint8, uint16 or
/// float). `exposure_s`: one each, s. `dark`: frames of the same exposures without light, one for
/// each frame; without them `black_level_dn` is taken away. `gain_e_per_dn`, `read_noise_e`,
/// `black_level_dn`, `white_level_dn`: the sensor; `prnu_relative`: uneven sensitivity of its
/// pixels. Raises ValueError for frames that do not belong together and pictures that are
/// saturated everywhere.
#[pyfunction]
#[pyo3(signature = (frames, exposure_s, dark = None, *, gain_e_per_dn, read_noise_e, black_level_dn,
    white_level_dn, prnu_relative = 0.003))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn merge(
    py: Python<'_>,
    frames: Vec<Bound<'_, PyAny>>,
    exposure_s: Vec<f64>,
    dark: Option<Vec<Bound<'_, PyAny>>>,
    gain_e_per_dn: f64,
    read_noise_e: f64,
    black_level_dn: f64,
    white_level_dn: f64,
    prnu_relative: f64,
) -> PyResult<Radiance> {
    let counts = [
        ("exposure_s", exposure_s.len()),
        ("dark", dark.as_ref().map_or(frames.len(), Vec::len)),
    ];
    for (name, found) in counts {
        if found != frames.len() {
            return Err(refused(format!(
                "{name}: expected one for each of the {} frames, got {found}",
                frames.len()
            )));
        }
    }
    let mut order: Vec<usize> = (0..frames.len()).collect();
    order.sort_by(|a, b| exposure_s[*a].total_cmp(&exposure_s[*b]));
    let sensor = Sensor {
        gain_e_per_dn,
        read_noise_e,
        black_level_dn,
        white_level_dn,
        prnu_relative,
    };
    let mut merge: Option<(Merge, Vec<usize>)> = None;
    for k in order {
        let light = frame(&frames[k], &format!("frames[{k}]"))?;
        let without = match &dark {
            Some(dark) => frame(&dark[k], &format!("dark[{k}]"))?,
            None => Frame {
                samples: Samples::F32(vec![black_level_dn as f32; light.samples.len()]),
                ..light
            },
        };
        let (width, height, channels) = (light.width, light.height, light.channels);
        let (merge, _) = match &mut merge {
            Some(merge) => merge,
            None => {
                let shape = match channels {
                    1 => vec![height, width],
                    _ => vec![height, width, channels],
                };
                let new = Merge::new(width, height, channels, &sensor).map_err(refused)?;
                merge.insert((new, shape))
            }
        };
        let exposure = exposure_s[k];
        let place = |e: hdr::MergeError| refused(format!("frames[{k}]: {e}"));
        py.detach(|| {
            let dark = DarkFrame::of(without, exposure)?;
            merge.add(&light, &dark, exposure)
        })
        .map_err(place)?;
        py.check_signals()?;
    }
    let Some((merge, shape)) = merge else {
        return Err(refused("frames: expected at least one"));
    };
    let (map, report) = py.detach(|| merge.finish()).map_err(refused)?;
    let interleaved = |of: fn(&ChannelMap) -> &[f32]| -> Vec<f32> {
        let channels: Vec<&[f32]> = map.channels.iter().map(of).collect();
        let pixels = channels.first().map_or(0, |c| c.len());
        (0..pixels)
            .flat_map(|i| channels.iter().map(move |c| c[i]))
            .collect()
    };
    Ok(Radiance {
        shape,
        value: interleaved(|c| &c.value),
        variance: interleaved(|c| &c.variance),
        channels: map.channels.iter().map(|c| c.name.clone()).collect(),
        used: report.frames.iter().map(|f| f.used.clone()).collect(),
        hot: report.channels.iter().map(|c| c.hot).collect(),
        saturated_everywhere: report
            .channels
            .iter()
            .map(|c| c.saturated_everywhere)
            .collect(),
    })
}

/// A radial profile with its total.
#[pyclass(frozen, module = "beamspot")]
pub(crate) struct Profile {
    inner: Measured,
}

impl From<Measured> for Profile {
    fn from(inner: Measured) -> Self {
        Self { inner }
    }
}

impl Profile {
    fn column<'py>(
        &self,
        py: Python<'py>,
        of: fn(&ProfilePoint) -> f64,
    ) -> Bound<'py, PyArray1<f64>> {
        let points = self.inner.profile.points.iter().map(of);
        points.collect::<Vec<f64>>().into_pyarray(py)
    }
}

#[pymethods]
impl Profile {
    /// Name of the channel.
    #[getter]
    fn channel(&self) -> &str {
        &self.inner.profile.channel
    }

    /// Area-weighted mean radius of each ring, mm: (n,).
    #[getter]
    fn radius_mm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |p| p.radius_mm)
    }

    /// Inner radius of each ring, mm: (n,).
    #[getter]
    fn radius_min_mm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |p| p.ring_mm.map_or(p.radius_mm, |r| r.0))
    }

    /// Outer radius of each ring, mm: (n,).
    #[getter]
    fn radius_max_mm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |p| p.ring_mm.map_or(p.radius_mm, |r| r.1))
    }

    /// Mean over each ring, in the unit of the picture: mm^-2 once a reference set its scale: (n,).
    #[getter]
    fn reflectance_per_mm2<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |p| p.reflectance_per_mm2)
    }

    /// Its standard uncertainty, the part that each ring has for itself: (n,).
    #[getter]
    fn u_reflectance_per_mm2<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |p| p.u_reflectance_per_mm2)
    }

    /// Sum inside the largest full circle.
    #[getter]
    fn total_reflectance(&self) -> f64 {
        self.inner.total.total_reflectance
    }

    /// Its standard uncertainty.
    #[getter]
    fn u_total_reflectance(&self) -> f64 {
        self.inner.total.u_total_reflectance
    }

    /// Radius of that circle, mm.
    #[getter]
    fn total_radius_mm(&self) -> Option<f64> {
        self.inner.total.radius_max_mm
    }

    /// Centre of the spot, px, the middle of the first pixel being (0, 0): x, y.
    #[getter]
    fn center_px(&self) -> [f64; 2] {
        self.inner.center_px
    }

    /// Pixels that were rejected as outliers of their ring.
    #[getter]
    fn rejected_pixels(&self) -> u64 {
        self.inner.rejected_pixels
    }

    fn __len__(&self) -> usize {
        self.inner.profile.points.len()
    }

    fn __repr__(&self) -> String {
        let total = &self.inner.total;
        format!(
            "Profile({} rings, total {} ± {})",
            self.inner.profile.points.len(),
            total.total_reflectance,
            total.u_total_reflectance
        )
    }
}

/// The mean over rings about the spot of a picture, with uncertainties.
///
/// `image` (height, width): one channel. `variance` (height, width): of each pixel, infinite where
/// it was not measured. `mm_per_pixel`: what one pixel sees. `factor_per_mm2`: exitance per
/// incident power, mm^-2, for one unit of the picture; the profile is in the picture's own unit where
/// it is left out. `center_px`: x, y of the centre; found where
/// left out. `relative_width`, `min_width_px`: of the rings. `clip`: standard uncertainties from
/// the ring's curve beyond which a pixel is an outlier. Raises ValueError where there is no spot.
#[pyfunction]
#[pyo3(signature = (image, *, variance, mm_per_pixel, factor_per_mm2 = None, center_px = None,
    relative_width = 0.025, min_width_px = 1.5, clip = 5.0))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn radial_profile<'py>(
    py: Python<'py>,
    image: Bound<'py, PyAny>,
    variance: Bound<'py, PyAny>,
    mm_per_pixel: f64,
    factor_per_mm2: Option<f64>,
    center_px: Option<[f64; 2]>,
    relative_width: f64,
    min_width_px: f64,
    clip: f64,
) -> PyResult<Profile> {
    let image: PyArrayLike2<'py, f32, AllowTypeChange> = table("image", &image)?;
    let variance: PyArrayLike2<'py, f32, AllowTypeChange> = table("variance", &variance)?;
    let (image, variance) = (image.as_array(), variance.as_array());
    if image.dim() != variance.dim() {
        return Err(refused(format!(
            "variance: expected the shape of image {:?}, got {:?}",
            image.dim(),
            variance.dim()
        )));
    }
    let (height, width) = image.dim();
    let channel = ChannelMap {
        name: "Y".to_owned(),
        value: image.iter().copied().collect(),
        variance: variance.iter().copied().collect(),
    };
    let options = ProfileOptions {
        view: View::square(mm_per_pixel),
        center_px,
        factor_per_mm2: factor_per_mm2.unwrap_or(1.0),
        u_scale_relative: 0.0,
        relative_width,
        min_width_px,
        clip,
    };
    let found = py.detach(|| match factor_per_mm2 {
        Some(_) => ::profile::radial_profile(&channel, width, height, &options),
        None => ::profile::unscaled_profile(&channel, width, height, &options),
    });
    Ok(Profile::from(found.map_err(refused)?))
}

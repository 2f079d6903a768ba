//! Models at radii, and the tables that ship.

use crate::arrays::numbers;
use crate::{raised, refused};
use numpy::PyArray1;
use physics::{Coefficients, ObliqueBeam, ReducedMedium};
use pipeline::library::{self, ModelChoice, SlabChoice};
use pyo3::prelude::*;

/// The model of that name, with what it may know of the sample.
pub(crate) fn choice(
    name: &str,
    g: Option<f64>,
    thickness_mm: Option<f64>,
    angle_deg: f64,
) -> ModelChoice {
    ModelChoice {
        name: name.to_owned(),
        g,
        slab: thickness_mm.map(|thickness_mm| SlabChoice {
            thickness_mm,
            eta_below: None,
        }),
        beam: ObliqueBeam {
            angle: angle_deg.to_radians(),
            ..ObliqueBeam::NORMAL
        },
    }
}

fn medium(sigma_s_prime: f64, sigma_a: f64, eta: f64) -> PyResult<Coefficients> {
    let medium = ReducedMedium {
        sigma_a,
        sigma_s_prime,
        eta,
    };
    Ok(medium.validated().map_err(refused)?.coefficients())
}

/// R_d of one medium at radii.
fn evaluate<'py>(
    py: Python<'py>,
    radius_mm: &Bound<'py, PyAny>,
    at: Coefficients,
    eta: f64,
    choice: &ModelChoice,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let radius_mm = numbers("radius_mm", radius_mm)?;
    if let Some(bad) = radius_mm.iter().find(|r| !(**r >= 0.0 && r.is_finite())) {
        return Err(refused(format!(
            "radius_mm: expected numbers of at least 0, got {bad}"
        )));
    }
    let model = library::model(choice, eta).map_err(|e| raised(&e))?;
    let mut values = vec![0.0; radius_mm.len()];
    py.detach(|| model.diffuse_reflectance(at, &radius_mm, &mut values));
    Ok(PyArray1::from_vec(py, values))
}

macro_rules! model {
    ($(#[$doc:meta])* $function:ident, $name:literal,
        ($($third:ident)?) => $g:expr, $thickness_mm:expr, $angle_deg:expr) => {
        $(#[$doc])*
        #[pyfunction]
        #[pyo3(signature = (radius_mm, *, sigma_s_prime, sigma_a, eta $(, $third)?))]
        pub(crate) fn $function<'py>(
            py: Python<'py>,
            radius_mm: Bound<'py, PyAny>,
            sigma_s_prime: f64,
            sigma_a: f64,
            eta: f64,
            $($third: f64,)?
        ) -> PyResult<Bound<'py, PyArray1<f64>>> {
            let at = medium(sigma_s_prime, sigma_a, eta)?;
            let choice = choice($name, $g, $thickness_mm, $angle_deg);
            evaluate(py, &radius_mm, at, eta, &choice)
        }
    };
}

model! {
    /// The dipole's diffuse reflectance R_d(r), mm^-2, per power that enters.
    ///
    /// `radius_mm` (n,): distances from the beam, mm. `sigma_s_prime`, `sigma_a`: coefficients,
    /// mm^-1. `eta`: relative refractive index. Returns (n,). Raises ValueError for a medium that
    /// is none. Source: Jensen et al. (2001), eq. 4, with the exact diffuse Fresnel reflectance.
    dipole, "dipole", () => None, None, 0.0
}
model! {
    /// R_d(r) of the better dipole, mm^-2: as `dipole`. Source: d'Eon (2012).
    better_dipole, "better-dipole", () => None, None, 0.0
}
model! {
    /// R_d(r) from flux and fluence, mm^-2: as `dipole`. Source: Kienle and Patterson (1997).
    kienle_patterson, "kienle-patterson", () => None, None, 0.0
}
model! {
    /// R_d(r) of photon beam diffusion with single scattering, mm^-2: as `dipole`; `g` is the
    /// mean cosine of the scattering angle. Source: Habel, Christensen and Jarosz (2013).
    photon_beam_diffusion, "photon-beam-diffusion", (g) => Some(g), None, 0.0
}
model! {
    /// R_d(r) of a slab of `thickness_mm`, mm^-2: as `dipole`. Source: Donner and Jensen (2005).
    multipole, "multipole", (thickness_mm) => None, Some(thickness_mm), 0.0
}
model! {
    /// R_d(r) about a beam that falls in `angle_deg` off the normal, mean over azimuth, mm^-2: as
    /// `dipole`. Source: Frisvad, Hachisuka and Kjeldsen (2014).
    directional, "directional", (angle_deg) => None, None, angle_deg
}
model! {
    /// R_d(r) by the transport equation, mm^-2: as `dipole`; `g` is the mean cosine of the
    /// scattering angle (Henyey and Greenstein). Source: a table of a solution after Liemert and
    /// Kienle (2013), checked against Monte Carlo.
    monte_carlo, "monte-carlo", (g) => Some(g), None, 0.0
}

/// Total diffuse reflectance of a half-space (or slab), per power that enters.
///
/// `model`: as for `fit`; `g` and `thickness_mm` for the models that use them. Raises ValueError
/// for a medium or a model that is none.
#[pyfunction]
#[pyo3(signature = (*, sigma_s_prime, sigma_a, eta, model = "dipole", g = None, thickness_mm = None))]
pub(crate) fn total_reflectance(
    sigma_s_prime: f64,
    sigma_a: f64,
    eta: f64,
    model: &str,
    g: Option<f64>,
    thickness_mm: Option<f64>,
) -> PyResult<f64> {
    let at = medium(sigma_s_prime, sigma_a, eta)?;
    let choice = choice(model, g, thickness_mm, 0.0);
    let model = library::model(&choice, eta).map_err(|e| raised(&e))?;
    Ok(model.beyond(at, 0.0))
}

/// A row of a material table.
#[pyclass(frozen, get_all, module = "beamspot")]
#[derive(Clone)]
pub(crate) struct Material {
    /// Name of the material.
    material: String,
    /// Name of the channel.
    channel: String,
    /// Wavelength, nm, where the channel has one.
    wavelength_nm: Option<f64>,
    /// Reduced scattering coefficient, mm^-1.
    sigma_s_prime_per_mm: f64,
    /// Its standard uncertainty, mm^-1, where it is known.
    u_sigma_s_prime_per_mm: Option<f64>,
    /// Absorption coefficient, mm^-1.
    sigma_a_per_mm: f64,
    /// Its standard uncertainty, mm^-1, where it is known.
    u_sigma_a_per_mm: Option<f64>,
    /// Correlation of the errors of both.
    correlation: Option<f64>,
    /// Total diffuse reflectance per power that enters.
    total_reflectance: Option<f64>,
    /// Relative refractive index.
    eta: f64,
    /// Mean cosine of the scattering angle, where it is known.
    g: Option<f64>,
    /// The model whose fit gave the coefficients.
    model: String,
    /// Where the row comes from.
    source: String,
}

#[pymethods]
impl Material {
    fn __repr__(&self) -> String {
        format!(
            "Material({} {}: sigma_a {} mm^-1, sigma_s' {} mm^-1, eta {})",
            self.material, self.channel, self.sigma_a_per_mm, self.sigma_s_prime_per_mm, self.eta
        )
    }
}

impl From<&physics::Material> for Material {
    fn from(row: &physics::Material) -> Self {
        let row = row.clone();
        Self {
            material: row.material,
            channel: row.channel,
            wavelength_nm: row.wavelength_nm,
            sigma_s_prime_per_mm: row.medium.sigma_s_prime,
            u_sigma_s_prime_per_mm: row.u_sigma_s_prime_per_mm,
            sigma_a_per_mm: row.medium.sigma_a,
            u_sigma_a_per_mm: row.u_sigma_a_per_mm,
            correlation: row.correlation,
            total_reflectance: row.total_reflectance,
            eta: row.medium.eta,
            g: row.g,
            model: row.model,
            source: row.source,
        }
    }
}

/// The rows of the shipped table, or those of the material `name`, whatever its case.
///
/// Raises ValueError with the names that there are. Source: Jensen et al. (2001), Figure 5.
#[pyfunction]
#[pyo3(signature = (name = None))]
pub(crate) fn materials(name: Option<&str>) -> PyResult<Vec<Material>> {
    let rows = match name {
        Some(name) => library::material(name).map_err(|e| raised(&e))?,
        None => library::materials(),
    };
    Ok(rows.iter().map(Material::from).collect())
}

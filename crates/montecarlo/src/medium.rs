//! What of a layered medium a walk asks for, besides its being one.

use crate::error::InvalidSimulation;
use physics::LayeredMedium;

/// Scattering optical thickness below which no photon of any run would scatter.
const THINNEST: f64 = 1e-9;
/// Mean free paths in a layer beyond which single precision cannot place a photon.
const DENSEST: f64 = 1e7;

/// The same medium, if photons can be followed through it.
pub(crate) fn walkable(medium: LayeredMedium) -> Result<LayeredMedium, InvalidSimulation> {
    let medium = medium.validated()?;
    for (k, layer) in medium.layers.iter().enumerate() {
        if let Some(thickness_mm) = layer.thickness_mm
            && layer.sigma_s * thickness_mm > DENSEST
        {
            return Err(InvalidSimulation::TooDense {
                layer: k + 1,
                mean_free_path_mm: 1.0 / layer.sigma_s,
                thickness_mm,
            });
        }
    }
    let optical = medium.layers.iter().filter(|layer| layer.sigma_s > 0.0);
    let optical_thickness = optical.map(|layer| layer.sigma_s * layer.thickness()).sum();
    if optical_thickness < THINNEST {
        return Err(InvalidSimulation::TooThin { optical_thickness });
    }
    Ok(medium)
}

/// Number of the endless layer without absorption, in which the mean path is infinite.
pub(crate) fn lossless_endless(medium: &LayeredMedium) -> Option<usize> {
    let last = medium.layers.last()?;
    (last.thickness_mm.is_none() && last.sigma_a == 0.0).then_some(medium.layers.len())
}

//! `MEDIUM.toml`: layers, beam and tallies of a simulation.
//!
//! ```
//! let medium = formats::medium_toml::parse(r#"
//!     [[layer]]
//!     sigma_a_per_mm = 0.0041
//!     sigma_s_per_mm = 2.62
//!     eta = 1.5
//! "#)?;
//! assert_eq!(medium.layer[0].thickness_mm, None);
//! # Ok::<(), formats::TomlError>(())
//! ```

use crate::toml_text::{TomlError, parse_toml};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A layered medium, the light that falls on it and what is counted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MediumFile {
    /// Refractive index on the lit side. Default 1.
    #[serde(default = "one")]
    pub eta_above: f64,
    /// Refractive index behind the last layer. Default 1.
    #[serde(default = "one")]
    pub eta_below: f64,
    /// The layers from the lit side down.
    pub layer: Vec<LayerEntry>,
    /// What layers can be mixed of, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub constituent: BTreeMap<String, ConstituentEntry>,
    /// The beam; a pencil along the normal by default.
    #[serde(default)]
    pub beam: BeamEntry,
    /// What is counted besides the totals.
    #[serde(default)]
    pub tally: TallyEntry,
}

/// One layer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LayerEntry {
    /// Thickness, mm; semi-infinite where absent.
    pub thickness_mm: Option<f64>,
    /// Absorption coefficient, mm⁻¹. With `sigma_s_per_mm`, or else `mixture`.
    pub sigma_a_per_mm: Option<f64>,
    /// Scattering coefficient, mm⁻¹.
    pub sigma_s_per_mm: Option<f64>,
    /// Mean cosine of a Henyey-Greenstein phase function. Default 0, isotropic.
    pub g: Option<f64>,
    /// Refractive index.
    pub eta: f64,
    /// Another phase function than Henyey and Greenstein's.
    pub phase: Option<PhaseEntry>,
    /// Shares of the volume of constituents, by name; what is left of 1 is clear.
    pub mixture: Option<BTreeMap<String, f64>>,
}

/// Matter that layers can be mixed of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstituentEntry {
    /// Absorption coefficient where it fills the volume, mm⁻¹.
    pub sigma_a_per_mm: f64,
    /// Scattering coefficient where it fills the volume, mm⁻¹.
    pub sigma_s_per_mm: f64,
    /// Mean cosine of a Henyey-Greenstein phase function. Default 0, isotropic.
    #[serde(default)]
    pub g: f64,
}

/// A phase function other than Henyey and Greenstein's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected \"rayleigh\", or a list of [cosine, density] from cosine -1 to 1"
)]
pub enum PhaseEntry {
    /// By name.
    Named(PhaseName),
    /// Rows of cosine of the scattering angle and density, from -1 to 1.
    Table(Vec<[f64; 2]>),
}

/// A phase function with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PhaseName {
    /// Rayleigh's.
    Rayleigh,
}

/// `[beam]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BeamEntry {
    /// Its shape.
    pub kind: BeamKind,
    /// Full width at half maximum, mm, of a Gaussian; diameter of a disk.
    pub fwhm_mm: f64,
    /// Angle from the normal outside, degrees.
    pub angle_deg: f64,
    /// Light from all directions with equal radiance instead of one.
    pub diffuse: bool,
}

/// Shape of a beam.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BeamKind {
    /// Without width.
    #[default]
    Pencil,
    /// A Gaussian.
    Gaussian,
    /// An even disk.
    Disk,
}

/// `[tally]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TallyEntry {
    /// Radius of the outermost ring, mm. Default 20.
    pub r_max_mm: f64,
    /// Rings of equal width. Default 200.
    pub r_bins: usize,
    /// Bins of the angle of exit from 0 to 90 degrees. Default 0: none.
    pub angle_bins: usize,
    /// Also by radius and angle of exit together.
    pub radius_and_angle: bool,
    /// Deepest depth of the absorption tally, mm.
    pub z_max_mm: f64,
    /// Its bins. Default 0: none; it doubles the time.
    pub z_bins: usize,
    /// Also absorption by depth and radius together.
    pub depth_and_radius: bool,
    /// Highest order of scattering told apart. Default 0: none.
    pub orders: usize,
    /// Longest path told apart, mm.
    pub path_max_mm: f64,
    /// Bins of the path length. Default 0: none.
    pub path_bins: usize,
    /// Path length at which photons are dropped, mm; what they carried is told apart. Needed
    /// where nothing absorbs and the medium has no end.
    pub path_cutoff_mm: Option<f64>,
}

impl Default for TallyEntry {
    fn default() -> Self {
        Self {
            r_max_mm: 20.0,
            r_bins: 200,
            angle_bins: 0,
            radius_and_angle: false,
            z_max_mm: 0.0,
            z_bins: 0,
            depth_and_radius: false,
            orders: 0,
            path_max_mm: 0.0,
            path_bins: 0,
            path_cutoff_mm: None,
        }
    }
}

fn one() -> f64 {
    1.0
}

/// Reads a medium. Its numbers are for the simulation to judge.
///
/// # Errors
///
/// [`TomlError`] names line and key.
pub fn parse(text: &str) -> Result<MediumFile, TomlError> {
    parse_toml(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_and_unknown_keys() {
        let text = "[[layer]]\nsigma_a_per_mm = 1\nsigma_s_per_mm = 2\neta = 1.4\n";
        let medium = parse(text).unwrap();
        assert_eq!(
            (medium.eta_above, medium.layer[0].g, medium.tally.r_bins),
            (1.0, None, 200)
        );
        assert_eq!(medium.beam.kind, BeamKind::Pencil);
        let wrong = parse(&text.replace("eta", "etta")).unwrap_err().to_string();
        assert!(wrong.contains("etta"), "{wrong}");
    }

    #[test]
    fn phase_functions_by_name_and_by_table() {
        let layer = "[[layer]]\nsigma_a_per_mm = 1\nsigma_s_per_mm = 2\neta = 1.4\n";
        let rayleigh = parse(&format!("{layer}phase = \"rayleigh\"\n")).unwrap();
        assert_eq!(
            rayleigh.layer[0].phase,
            Some(PhaseEntry::Named(PhaseName::Rayleigh))
        );
        let table = parse(&format!("{layer}phase = [[-1.0, 1.0], [1.0, 3.0]]\n")).unwrap();
        assert_eq!(
            table.layer[0].phase,
            Some(PhaseEntry::Table(vec![[-1.0, 1.0], [1.0, 3.0]]))
        );
        let wrong = parse(&format!("{layer}phase = \"mie\"\n"))
            .unwrap_err()
            .to_string();
        assert!(wrong.contains("rayleigh"), "{wrong}");
    }
}

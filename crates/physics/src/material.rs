//! One row of a material table.

use crate::medium::ReducedMedium;

/// The coefficients of one material in one channel, with what is known of their uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name of the material.
    pub material: String,
    /// Name of the channel.
    pub channel: String,
    /// Wavelength, nm, where the channel has one.
    pub wavelength_nm: Option<f64>,
    /// σₐ, σₛ′ and η.
    pub medium: ReducedMedium,
    /// Standard uncertainty of σₐ, mm⁻¹.
    pub u_sigma_a_per_mm: Option<f64>,
    /// Standard uncertainty of σₛ′, mm⁻¹.
    pub u_sigma_s_prime_per_mm: Option<f64>,
    /// Correlation of the errors of σₐ and σₛ′.
    pub correlation: Option<f64>,
    /// Total diffuse reflectance per power that enters.
    pub total_reflectance: Option<f64>,
    /// Mean cosine of the scattering angle, where it is known.
    pub g: Option<f64>,
    /// Name of the model whose fit gave the coefficients.
    pub model: String,
    /// Where the row comes from.
    pub source: String,
}

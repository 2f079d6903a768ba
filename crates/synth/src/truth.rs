//! The numbers behind the pictures, for a comparison with what was measured.

use crate::camera::BeamProfile;
use serde::{Deserialize, Serialize};

/// What a measurement of a synthetic capture ought to find.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// Name of the material.
    pub material: String,
    /// Seed of every random number.
    pub seed: u64,
    /// Name of the model that made the light.
    pub model: String,
    /// Relative index that the manifest states.
    pub eta_stated: f64,
    /// Relative index that made the light.
    pub eta_true: f64,
    /// Scale that the manifest states.
    pub mm_per_pixel_stated: f64,
    /// Scale that made the pictures.
    pub mm_per_pixel_true: f64,
    /// Full width of the beam at half maximum, mm.
    pub beam_fwhm_mm: f64,
    /// Shape of the beam.
    pub beam_profile: BeamProfile,
    /// Share of the incident power that enters; 1 where entry loss was switched off.
    pub entry_factor: f64,
    /// Where the beam meets the sample: column and row, the middle of the first pixel being (0, 0).
    pub sample_center_px: [f64; 2],
    /// Where the beam meets the reference, likewise.
    pub reference_center_px: [f64; 2],
    /// Reflectance of the reference that the manifest states.
    pub reference_reflectance_stated: f64,
    /// The channels, in the order of the camera.
    pub channels: Vec<ChannelTruth>,
}

/// What is true of one channel.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelTruth {
    /// Name of the channel.
    pub channel: String,
    /// Absorption coefficient of the sample, mm⁻¹.
    pub sigma_a_per_mm: f64,
    /// Reduced scattering coefficient of the sample, mm⁻¹.
    pub sigma_s_prime_per_mm: f64,
    /// The model's total diffuse reflectance over the whole plane, per power that enters.
    pub total_reflectance: f64,
    /// π·radiance toward the camera over exitance, over the whole plane; 1 for a Lambertian exit.
    pub exit_factor: f64,
    /// Reflectance that the reference really had.
    pub reference_reflectance_true: f64,
    /// Electrons per second for an exitance, per incident power, of 1 mm⁻²: the K·Φ of the paper.
    pub signal_e_mm2_per_s: f64,
}

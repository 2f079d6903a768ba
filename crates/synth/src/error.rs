//! What can be wrong with a camera or a sample.

use physics::InvalidMedium;
use thiserror::Error;

/// A camera or a sample that no capture can be made of.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SynthError {
    /// A number of the camera lies outside what it can be.
    #[error("{key} must lie between {low} and {high}, got {found}")]
    OutOfRange {
        /// Key in the camera's description.
        key: &'static str,
        /// What stands there.
        found: f64,
        /// Least legal value.
        low: f64,
        /// Largest legal value.
        high: f64,
    },
    /// The sensor's converter is of an unknown kind.
    #[error("bits must be 12 or 16, got {0}")]
    Bits(u8),
    /// A mosaic of one colour.
    #[error("mosaic is given and channels = \"mono\"; a mosaic has R, G and B: channels = \"rgb\"")]
    GrayMosaic,
    /// There is no exposure.
    #[error("exposures_s is empty; list at least one exposure time in seconds")]
    NoExposures,
    /// The black level and the noise leave too little of the converter's range.
    #[error(
        "black_level_dn = {black_level_dn} DN and the noise leave {range_dn:.0} DN up to \
         saturation at gain_e_per_dn = {gain_e_per_dn}; at least {least_dn} DN are needed: lower \
         the black level, the gain or the noise"
    )]
    DynamicRange {
        /// Black level, DN.
        black_level_dn: f64,
        /// Gain, electrons per DN.
        gain_e_per_dn: f64,
        /// Data numbers between black and the white level.
        range_dn: f64,
        /// Least number that counts as a camera.
        least_dn: f64,
    },
    /// What is there without the beam saturates the shortest exposure.
    #[error(
        "stray light and dark current give {background_e:.0} electrons in the shortest exposure \
         of {exposure_s} s; with the beam's peak on top at most {room_e:.0} fit: lower \
         stray_e_per_s or dark_current_e_per_s, or add a shorter exposure"
    )]
    Background {
        /// Electrons of stray light and dark current.
        background_e: f64,
        /// The shortest exposure, s.
        exposure_s: f64,
        /// Electrons that fit beside the peak.
        room_e: f64,
    },
    /// The reference has coefficients for another number of channels.
    #[error("reference.{key} needs {expected} values, one per channel, and has {found}")]
    ReferenceChannels {
        /// Key in the reference's description.
        key: &'static str,
        /// Channels of the camera.
        expected: usize,
        /// Values given.
        found: usize,
    },
    /// The sample has another number of channels than the camera.
    #[error("the camera has {camera} channels and the sample has coefficients for {sample}")]
    ChannelCount {
        /// Channels of the camera.
        camera: usize,
        /// Channels of the sample.
        sample: usize,
    },
    /// The sample lacks one of the camera's channels.
    #[error("the sample has no coefficients for channel {0}")]
    MissingChannel(&'static str),
    /// A medium is outside the domain of the model.
    #[error("channel {channel} of the {of}")]
    Medium {
        /// `sample` or `reference`.
        of: &'static str,
        /// Name of the channel.
        channel: String,
        /// What is wrong with it.
        #[source]
        source: InvalidMedium,
    },
    /// The model gives no light, or more than a number can hold.
    #[error("the model's brightest pixel in channel {channel} of the {of} is {peak_per_mm2} mm^-2")]
    NoLight {
        /// `sample` or `reference`.
        of: &'static str,
        /// Name of the channel.
        channel: String,
        /// Exitance per incident power of the brightest pixel, mm⁻².
        peak_per_mm2: f64,
    },
    /// A picture from elsewhere has not what the camera asks for.
    #[error("{0}: a rendered picture is seen from straight above, without it; leave it out")]
    Pictured(&'static str),
}

//! What can be wrong with a set of exposures.

use thiserror::Error;

/// Exposures that cannot be merged.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MergeError {
    /// A frame without pixels or channels.
    #[error("a frame needs at least one pixel and one channel, got {0} x {1} with {2} channels")]
    EmptyFrame(usize, usize, usize),
    /// A number of channels that no camera of ours has.
    #[error("a frame has 1 channel (Y) or 3 (R, G, B), got {0}")]
    Channels(usize),
    /// A frame is of another size than the first.
    #[error(
        "frame is {} x {} with {} channels, expected {} x {} with {} as the first: leave it out, or save all alike",
        found.0, found.1, found.2, expected.0, expected.1, expected.2
    )]
    Size {
        /// Width, height and channels of this frame.
        found: (usize, usize, usize),
        /// Width, height and channels of the first.
        expected: (usize, usize, usize),
    },
    /// A dark is of another size than its frame.
    #[error(
        "its dark is {} x {} with {} channels, and the frame {} x {} with {}: take a dark of the same size, or save both alike",
        dark.0, dark.1, dark.2, frame.0, frame.1, frame.2
    )]
    DarkSize {
        /// Width, height and channels of the dark.
        dark: (usize, usize, usize),
        /// Width, height and channels of the frame.
        frame: (usize, usize, usize),
    },
    /// A frame holds another number of samples than its size says.
    #[error("frame holds {found} samples, its size says {expected}")]
    Samples {
        /// Samples in the frame.
        found: usize,
        /// Width times height times channels.
        expected: usize,
    },
    /// An exposure time is zero, negative or not finite.
    #[error("exposure must be above 0 s and finite, got {0} s")]
    Exposure(f64),
    /// A frame is shorter than the one before it.
    #[error("exposures must not decrease: {found_s} s came after {previous_s} s")]
    Order {
        /// Exposure of this frame, s.
        found_s: f64,
        /// Exposure of the frame before, s.
        previous_s: f64,
    },
    /// No dark was taken with the exposure of a frame.
    #[error(
        "no dark frame for the exposure of {exposure_s} s{}: take one with the beam blocked",
        nearest_s.map(|s| format!(" (the nearest has {s} s)")).unwrap_or_default()
    )]
    NoDark {
        /// Exposure of the frame, s.
        exposure_s: f64,
        /// The dark that comes nearest, s.
        nearest_s: Option<f64>,
    },
    /// A frame that is no light added to its dark.
    #[error(
        "{:.0} % of its samples lie below those of its own dark, farther than noise reaches: \
         expected counts of the same camera and offset in both (were the frame's scaled to 0..1, \
         shifted to other bits, or stored without their BZERO?); save frame and dark alike",
        100.0 * share
    )]
    BelowDark {
        /// Share of the samples that were looked at.
        share: f64,
    },
    /// Most of a channel is saturated in every frame.
    #[error(
        "{saturated} of {pixels} pixels of channel {channel} are saturated in every frame: \
         add a shorter exposure"
    )]
    Saturated {
        /// Name of the channel.
        channel: &'static str,
        /// Pixels that no frame measured.
        saturated: u64,
        /// Pixels of the channel.
        pixels: u64,
    },
    /// No frame was added.
    #[error("no frame to merge: at least one exposure is needed")]
    NoFrames,
    /// Electrons per data number are not positive.
    #[error("gain must be above 0 electrons per DN and finite, got {0}")]
    Gain(f64),
    /// The read noise is negative or not finite.
    #[error("read noise must be at least 0 electrons and finite, got {0}")]
    ReadNoise(f64),
    /// The white level is not above the black level.
    #[error("white level must be above the black level, got {white} DN over {black} DN")]
    Levels {
        /// Black level, DN.
        black: f64,
        /// White level, DN.
        white: f64,
    },
    /// The photo-response non-uniformity is negative or not finite.
    #[error("photo-response non-uniformity must be at least 0 and finite, got {0}")]
    Prnu(f64),
}

/// Frames that do not say what a sensor is like.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum EstimateError {
    /// A frame or a dark cannot be used.
    #[error(transparent)]
    Frame(#[from] MergeError),
    /// The samples are not counts of a converter.
    #[error(
        "frames of floating-point numbers show no rounding and no top: the camera cannot be \
         estimated from them; give gain_e_per_dn, read_noise_e, black_level_dn and white_level_dn"
    )]
    NotCounts,
    /// There is no dark.
    #[error("no dark frame: a black level needs at least one")]
    NoDarks,
    /// The black level is cut off at 0.
    #[error(
        "{:.1} % of a dark frame is 0 DN: black is cut off, so that its level and its noise cannot \
         be estimated; set an offset in the camera, or give all numbers of the camera",
        100.0 * share
    )]
    BlackClipped {
        /// Share of its samples at 0.
        share: f64,
    },
    /// No pixel is well exposed in two frames.
    #[error(
        "no two frames show the same pixels unsaturated: gain and read noise cannot be estimated; \
         take exposures that at most double, or give them"
    )]
    NoOverlap,
    /// The noise does not grow with the light.
    #[error(
        "the noise does not grow with the light: these frames are not what a linear sensor gave \
         (were they smoothed, resized or compressed?); give gain and read noise"
    )]
    NoPhotonNoise,
}

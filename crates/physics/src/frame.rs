//! One exposure as the camera wrote it, and what is known of the sensor behind it.

/// Raw counts of one exposure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Interleaved channels: 1 (Y) or 3 (R, G, B).
    pub channels: usize,
    /// Data numbers, `width`·`height`·`channels` of them, row by row.
    pub samples: Vec<u16>,
}

/// Names of the channels of a frame with `count` of them: `Y`, or `R`, `G`, `B`.
pub fn channel_names(count: usize) -> &'static [&'static str] {
    if count == 1 { &["Y"] } else { &["R", "G", "B"] }
}

/// How a linear sensor turns electrons into data numbers (DN).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Electrons per data number.
    pub gain_e_per_dn: f64,
    /// Standard deviation of one read-out, electrons.
    pub read_noise_e: f64,
    /// Data number that no light at all gives.
    pub black_level_dn: f64,
    /// Data number at and above which a sample is saturated.
    pub white_level_dn: f64,
    /// Standard deviation of the pixels' relative sensitivity (photo-response non-uniformity).
    pub prnu_relative: f64,
}

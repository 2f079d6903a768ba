//! Many exposures into one picture: radiance in DN/s with a variance for every pixel.
//!
//! Each exposure is diminished by a dark of the same exposure and added up, with the exposure
//! time as its weight; saturated samples and hot pixels have no weight. The variance comes from
//! the sensor's noise model and the merged value, never from a single sample, and values below
//! zero stay as they are: clipping either would bias the dark end of the picture.
//!
//! Frames pass one by one, so that memory does not grow with their number. This crate reads no
//! file and finds no exposure time. [`physics::Sensor`] says what is known of the camera;
//! [`estimate`] finds what is not.
//!
//! | module | holds |
//! |---|---|
//! | [`dark`] | [`DarkFrame`]: what the sensor shows without light |
//! | [`merge`] | [`Merge`]: the sum over exposures, and its [`MergeReport`] |
//! | [`estimate`] | gain, read noise, black and white level from the frames themselves |
//! | [`mosaic`] | a colour filter array, merged photosite by photosite |
//! | [`overlap`] | what frames say of each other: measured exposures, shifts |
//! | [`registration`] | frames that moved, put back |
//! | [`response`] | the curve of a camera that gives 8 bits |
//! | [`error`] | [`MergeError`], [`EstimateError`] |

pub mod dark;
pub mod error;
pub mod estimate;
mod hot;
mod lanes;
mod median;
pub mod merge;
pub mod mosaic;
mod net;
pub mod overlap;
pub mod registration;
pub mod response;

pub use dark::DarkFrame;
pub use error::{EstimateError, MergeError};
pub use merge::{ChannelReport, FrameReport, Merge, MergeReport};
pub use overlap::{Comparison, Overlap};

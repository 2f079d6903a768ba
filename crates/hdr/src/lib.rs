//! Many exposures into one picture: radiance in DN/s with a variance for every pixel.
//!
//! Each exposure is diminished by a dark of the same exposure and added up, with the exposure
//! time as its weight; saturated samples and hot pixels have no weight. The variance comes from
//! the sensor's noise model and the merged value, never from a single sample, and values below
//! zero stay as they are: clipping either would bias the dark end of the picture.
//!
//! Frames pass one by one, so that memory does not grow with their number. This crate reads no
//! file, finds no exposure time and estimates no gain: [`physics::Sensor`] says what is known.
//!
//! | module | holds |
//! |---|---|
//! | [`dark`] | [`DarkFrame`]: what the sensor shows without light |
//! | [`merge`] | [`Merge`]: the sum over exposures, and its [`MergeReport`] |
//! | [`error`] | [`MergeError`] |

pub mod dark;
pub mod error;
mod hot;
pub mod merge;
mod predict;

pub use dark::{DarkFrame, matching_dark};
pub use error::MergeError;
pub use merge::{ChannelReport, FrameReport, Merge, MergeReport};

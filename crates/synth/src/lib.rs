//! A camera in reverse: what a laboratory would photograph of a material whose coefficients are
//! known.
//!
//! A [`Capture`] is a material in front of a [`Camera`]. It lists its [`Shot`]s (the sample and a
//! white reference at every exposure, each with the beam on and with the beam blocked) and
//! exposes each into a [`physics::Frame`]. A shot depends on the seed and on its own identity
//! only, so shots may be exposed in any order, one or many at a time. [`Truth`] is what a
//! measurement ought to find.
//!
//! The light is a model of diffuse reflectance convolved with the beam and averaged over each
//! pixel. None of that is shared with the crates that measure: the convolution and the pixels are
//! computed here by other means than the fit's footprints, so the two check each other.
//!
//! Left out: the displacement and stretching of the glow under an oblique beam. Its angle changes the
//! factor of entry only. Codecs and file names are the caller's.
//!
//! | module | holds |
//! |---|---|
//! | [`camera`] | [`Camera`]: the bench, the sensor and the white reference, as a person types them |
//! | [`capture`] | [`Capture`], its [`Shot`]s and their frames |
//! | [`truth`] | [`Truth`]: the numbers behind the pictures |
//! | [`error`] | [`SynthError`] |
//! | `glow` | R_d convolved with the beam, tabulated |
//! | `picture` | its average over each pixel |
//! | `sensor` | from light to data numbers |
//! | `random` | streams and the Poisson distribution |

pub mod camera;
pub mod capture;
pub mod error;
mod glow;
mod picture;
mod random;
mod sensor;
pub mod truth;

pub use camera::{BeamProfile, Camera, Channels, Exit, WhiteReference};
pub use capture::{Capture, ModelAt, PictureOf, Role, Sample, Shot, Wanted};
pub use error::SynthError;
pub use truth::{ChannelTruth, Truth};

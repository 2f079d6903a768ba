//! From a merged picture of a beam spot to its radial profile and its total.
//!
//! The white reference sets the scale ([`reference_scale`]), the spot's centre is found
//! ([`find_center`]), and the picture is averaged over rings ([`radial_profile`]) or read along
//! a line ([`slice_profile`]), each value with the standard uncertainty that the pixels'
//! variances give it. Nothing is extrapolated: the total is the sum inside the largest full
//! circle.
//!
//! A ring's value is the mean over its *area* of the exitance that the pixels saw, that is of
//! R_d smeared by the beam and by one pixel's square.
//!
//! Positions are in px, column then row; the middle of the first pixel is at (0, 0).
//!
//! A tilted view or pixels that are not square ([`View`]) are averaged over rings on the surface,
//! each pixel with the area that it sees there; nothing is resampled.
//!
//! This crate fits nothing and corrects for no beam width; it measures beam and blur on the white
//! reference ([`measure_beam`]), for a fit to convolve its model with, and the stray light there
//! ([`stray_light`]).
//!
//! | module | holds |
//! |---|---|
//! | [`center`] | [`find_center`] |
//! | [`glow`] | [`glow_center`]: what a glow is round about, under an oblique beam |
//! | [`moments`] | [`beam_moments`]: centre and width after ISO 11146 |
//! | [`radial`] | [`radial_profile`] |
//! | [`mod@slice`] | [`slice_profile`] |
//! | [`scale`] | [`reference_scale`] |
//! | [`view`] | [`View`]: from pixels to millimetres |
//! | [`beam`] | [`measure_beam`] |
//! | [`stray`] | [`stray_light`]: what lens and housing spread evenly |
//! | [`white`] | [`White`]: the reference as a medium, and how well that is known |
//! | [`error`] | [`ProfileError`] |

pub mod beam;
pub mod center;
mod curve;
pub mod error;
pub mod glow;
pub mod moments;
pub mod radial;
mod rings;
pub mod scale;
pub mod slice;
pub mod stray;
mod survey;
mod sweep;
pub mod view;
pub mod white;

pub use beam::{Glow, MeasuredBeam, measure_beam};
pub use center::find_center;
pub use error::ProfileError;
pub use glow::{GlowCenter, glow_center};
pub use moments::{Background, BeamMoments, beam_moments};
pub use radial::{Measured, ProfileOptions, radial_profile, unscaled_profile};
pub use scale::{Exit, OffWhite, ReferenceOptions, Scale, reference_scale};
pub use slice::slice_profile;
pub use stray::{Stray, stray_light};
pub use view::View;
pub use white::White;

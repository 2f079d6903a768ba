//! From files to files: the stages of beamspot joined.
//!
//! The command line and Python are thin doors onto the functions here. This is where paths,
//! progress and provenance live; what is computed stands in the crates below.
//!
//! | module | holds |
//! |---|---|
//! | [`error`] | [`Error`] and what kind of trouble it is |
//! | [`monitor`] | progress out, interruption in |
//! | [`files`] | reading with names, writing whole or not at all |
//! | [`capture`] | a manifest with its frames: loading, hashing, merging |
//! | [`response`] | the curve of a camera of 8 bits, recovered |
//! | [`stray`] | stray light and what darks leave |
//! | [`sensing`] | the numbers of the camera, stated or found |
//! | [`init`] | a manifest to be filled in, from a folder of frames |
//! | [`geometry`] | from the manifest's geometry to a view |
//! | [`measure`] | the main job: frames to materials |
//! | [`fitting`] | the fit of every channel, with the uncertainty of what it took as given |
//! | [`unknown_g`] | a mean cosine that nobody knows, fitted along |
//! | [`confirm`] | a fit against counted photons |
//! | [`fit_json`] | `fit.json` |
//! | [`outputs`] | what a measurement leaves behind |
//! | `picture` | the merged picture of a channel for its page |
//! | `swatch` | the measured material, rendered for its page |
//! | [`batch`] | many captures, and what became of each |
//! | [`simulation`] | Monte Carlo simulations as files |
//! | [`tallies`] | the tallies of a simulation as tables |
//! | [`spot`] | centre and width of a beam |
//! | [`synthesis`] | synthetic captures as files |
//! | [`medium`] | layered media from their files |
//! | [`brdf`] | BRDF and BTDF of layers by three witnesses |
//! | [`sphere`] | what an integrating sphere measured, inverted |
//! | [`rendering`] | scenes as files, pictures as files |
//! | [`difference`] | two profiles or tables beside each other |
//! | [`export`] | material tables for other programs, and back |
//! | [`figures`] | the papers' figures |
//! | [`library`] | the tables that ship with beamspot |

pub mod batch;
pub mod beam;
pub mod bootstrap;
pub mod brdf;
pub mod capture;
pub mod comparison;
pub mod confirm;
mod consistency;
pub mod difference;
pub mod discrepancy;
pub mod energy;
pub mod error;
mod exit;
pub mod export;
mod exposures;
pub mod figures;
pub mod files;
pub mod fit_json;
pub mod fitting;
pub mod geometry;
pub mod init;
pub mod library;
pub mod measure;
pub mod medium;
pub mod monitor;
pub mod outputs;
mod picture;
mod reading;
mod regions;
mod rendered_noise;
pub mod rendering;
pub mod response;
pub mod sensing;
pub mod simulation;
pub mod sphere;
pub mod spot;
pub mod stray;
mod swatch;
pub mod synthesis;
pub mod tallies;
pub mod unknown_g;
pub mod verdict;

pub use error::{Error, Kind, Result};
pub use monitor::{Monitor, Silent};

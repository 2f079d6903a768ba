//! Codecs of beamspot: what its files hold, read from bytes and written to writers.
//!
//! Nothing here knows a path, a progress bar or a physical model: the roof opens files and adds
//! their names to the errors. Values from outside pass through here once and are checked on the
//! way; what comes out is a noun of [`physics`] or a plain struct with units in its names.
//! Numbers are written in their shortest form that reads back to the same bits.
//!
//! | module | file |
//! |---|---|
//! | [`image`] | frames: TIFF, PNG, PGM/PPM, OpenEXR and FITS, gray or RGB |
//! | [`metadata`] | exposure time and camera, as frames and their names state them |
//! | [`exr`] | `radiance.exr`: value and variance of every channel |
//! | [`capture`] | `capture.toml`: frames and exposure times, geometry, beam, camera, reference |
//! | [`sample_toml`] | a medium given by reduced coefficients, for `synth` |
//! | [`scene_toml`] | `SCENE.toml`: solids, lights and a camera |
//! | [`mesh`] | triangles: OBJ and PLY |
//! | [`sphere_csv`] | what an integrating sphere measured, for `sphere` |
//! | [`profile_csv`] | `profile.csv` |
//! | [`totals_csv`] | `totals.csv` |
//! | [`beam_csv`] | `beam.csv`: a measured beam |
//! | [`materials_csv`], [`materials_json`] | material tables |
//! | [`export`], [`pbrt`], [`mitsuba`] | materials as renderers and photon simulators read them |
//! | [`status_csv`] | `status.csv`: what became of each capture of a batch |
//! | [`layers_csv`] | `layers.csv`: constituents of layered media |
//! | [`toml_text`] | any TOML into any struct, with errors that name the nearest known key |

pub mod beam_csv;
pub mod capture;
mod csv_table;
pub mod export;
pub mod exr;
mod fits_header;
pub mod image;
pub mod layers_csv;
pub mod materials_csv;
pub mod materials_json;
pub mod medium_toml;
pub mod mesh;
pub mod metadata;
pub mod mitsuba;
mod nearest;
pub mod pbrt;
pub mod profile_csv;
pub mod sample_toml;
pub mod scene_toml;
pub mod sphere_csv;
pub mod status_csv;
pub mod toml_text;
pub mod totals_csv;

pub use capture::{Capture, CaptureError, parse_capture, parse_manifest};
pub use csv_table::{CsvError, Expected};
pub use exr::{ExrError, RadianceFile, read_radiance, write_radiance};
pub use image::{
    Decoded, Depth, FileWords, ImageError, PackedDng, decode_frame, decode_frame_into,
    decode_frame_of, encode_indexed_png, encode_png, encode_tiff,
};
pub use toml_text::{TomlError, parse_toml};

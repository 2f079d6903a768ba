//! One file per command.

pub(crate) mod batch;
pub(crate) mod beam;
pub(crate) mod brdf;
pub(crate) mod compare;
pub(crate) mod demo;
pub(crate) mod doctor;
pub(crate) mod figures;
pub(crate) mod fit;
pub(crate) mod hdr;
pub(crate) mod init;
pub(crate) mod measure;
pub(crate) mod profile;
pub(crate) mod render;
pub(crate) mod shell;
pub(crate) mod simulate;
pub(crate) mod sphere;
pub(crate) mod synth;
pub(crate) mod table;
pub(crate) mod validate;

mod print;

//! `beamspot synth`

use super::print;
use crate::args::{Common, SynthArgs};
use pipeline::library::ModelChoice;
use pipeline::synthesis::Light;
use pipeline::{Monitor, Result, synthesis};
use serde::Serialize;
use std::io::Write;

#[derive(Serialize)]
struct Document {
    schema_version: u32,
    capture: String,
    seed: u64,
}

/// Writes a synthetic capture and says where.
pub(crate) fn run(
    args: &SynthArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let SynthArgs {
        material,
        medium,
        model,
        g,
        camera,
        photons,
        seed,
        output,
    } = args;
    let sample = match (material, medium) {
        (Some(name), _) => synthesis::sample_of(name)?,
        (None, Some(path)) => synthesis::sample_from(path)?,
        (None, None) => unreachable!("clap asks for one of the two"),
    };
    let camera = match camera {
        Some(path) => synthesis::camera_from(path)?,
        None => synth::Camera::default(),
    };
    let light = if model == "render" {
        Light::Rendered {
            g: g.unwrap_or(0.0),
            photons: *photons,
        }
    } else {
        Light::Model(ModelChoice {
            name: model.clone(),
            g: *g,
            ..ModelChoice::default()
        })
    };
    let capture = synthesis::photograph(
        &sample,
        camera,
        &light,
        *seed,
        output,
        common.force,
        monitor,
    )?;
    let capture = capture.display().to_string();
    if common.json {
        let schema_version = pipeline::fit_json::SCHEMA_VERSION;
        return print::json(
            out,
            &Document {
                schema_version,
                capture,
                seed: *seed,
            },
        );
    }
    print::line(out, format!("wrote {capture}, its frames and truth.json"))
}

//! `beamspot hdr`

use super::print;
use crate::args::{Common, HdrArgs};
use pipeline::files::{Outputs, split};
use pipeline::{Monitor, Result, capture, measure};
use serde::Serialize;
use std::io::Write;

#[derive(Serialize)]
struct Document {
    schema_version: u32,
    output: String,
    width: usize,
    height: usize,
    channels: Vec<String>,
    notes: Vec<String>,
}

/// Merges a capture, scales it by its reference and writes the map.
pub(crate) fn run(
    args: &HdrArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let loaded = capture::load(&args.capture)?;
    let (folder, name) = split(&args.output)?;
    let outputs = Outputs::new(&folder, [&name], &loaded.paths(), common.force)?;
    let radiance = measure::radiance(&loaded, monitor)?;
    let file = radiance.to_file(&loaded);
    outputs.write(&name, |out| Ok(formats::write_radiance(&file, out)?))?;
    outputs.commit()?;
    let output = args.output.display().to_string();
    if common.json {
        let document = Document {
            schema_version: pipeline::fit_json::SCHEMA_VERSION,
            output,
            width: radiance.map.width,
            height: radiance.map.height,
            channels: radiance
                .map
                .names()
                .into_iter()
                .map(str::to_owned)
                .collect(),
            notes: radiance.left_out(),
        };
        return print::json(out, &document);
    }
    for note in &radiance.left_out() {
        print::line(out, note)?;
    }
    print::line(out, format!("wrote {output}"))
}

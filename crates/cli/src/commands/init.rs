//! `beamspot init`

use super::print;
use crate::args::{Common, InitArgs};
use pipeline::files::Outputs;
use pipeline::{Result, init};
use serde::Serialize;
use std::io::Write;

const NAME: &str = "capture.toml";

#[derive(Serialize)]
struct Document {
    schema_version: u32,
    output: String,
    found: Vec<String>,
    unknown: Vec<String>,
}

/// Writes a manifest into a folder of frames and says what it could not know.
pub(crate) fn run(args: &InitArgs, common: Common, out: &mut impl Write) -> Result<()> {
    let outputs = Outputs::new(&args.folder, [NAME], &[], common.force)?;
    let init = init::draft(&args.folder)?;
    let text = init.draft.to_toml();
    outputs.write(NAME, |out| Ok(out.write_all(text.as_bytes())?))?;
    outputs.commit()?;
    let output = args.folder.join(NAME).display().to_string();
    if common.json {
        let document = Document {
            schema_version: pipeline::fit_json::SCHEMA_VERSION,
            output,
            found: init.found,
            unknown: init.unknown,
        };
        return print::json(out, &document);
    }
    for line in &init.found {
        print::line(out, line)?;
    }
    print::line(out, "could not be known:")?;
    for line in &init.unknown {
        print::line(out, format!("  {line}"))?;
    }
    print::line(out, format!("wrote {output}: fill in every \"?\""))
}

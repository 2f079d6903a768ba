//! `beamspot figures`

use super::print;
use crate::args::{Common, FiguresArgs};
use pipeline::figures::figures;
use pipeline::{Monitor, Result};
use std::io::Write;

/// Computes the figures of a paper.
pub(crate) fn run(
    args: &FiguresArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let FiguresArgs {
        paper,
        output,
        photons,
    } = args;
    let files = figures(paper, output, *photons, common.force, monitor)?;
    if common.json {
        let document = serde_json::json!({
            "schema_version": pipeline::fit_json::SCHEMA_VERSION,
            "files": files,
        });
        return print::json(out, &document);
    }
    print::line(
        out,
        format!("wrote {} to {}", files.join(", "), output.display()),
    )
}

//! `beamspot validate`

use super::compare::differences_table;
use super::print;
use crate::args::{Common, ValidateArgs};
use pipeline::rendering::{MethodChoice, load, validate};
use pipeline::{Monitor, Result};
use report::significant;
use std::io::Write;

/// Renders a scene by every method and prints how far the models are from transport.
pub(crate) fn run(
    args: &ValidateArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let loaded = load(&args.scene)?;
    let options = args.effort.options(MethodChoice::MonteCarlo);
    let found = validate(&loaded, &options, &args.output, common.force, monitor)?;
    if common.json {
        return print::json(out, &found);
    }
    for line in &found.methods {
        print::line(
            out,
            format!(
                "{}: noise {} %, {} s",
                line.method,
                significant(100.0 * line.relative_error, 3),
                significant(line.seconds, 3)
            ),
        )?;
        if !line.differences.is_empty() {
            print::line(out, differences_table(&line.differences))?;
        }
    }
    for reason in &found.left_out {
        print::line(out, format!("left out: {reason}"))?;
    }
    let page = args.output.join("validation.html");
    print::line(out, format!("wrote {}", page.display()))
}

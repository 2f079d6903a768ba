//! `beamspot batch`

use super::print;
use crate::args::{BatchArgs, Common};
use pipeline::batch::{self, List, Options};
use pipeline::{Monitor, Result};
use std::io::Write;

/// Measures many captures, and says what became of them.
pub(crate) fn run(
    args: &BatchArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let options = Options {
        choices: args.choice.choices()?,
        resume: args.resume,
        force: common.force,
    };
    let list = List::read(&args.captures)?;
    let batch = batch::run(&list, &args.output, &options, monitor)?;
    if common.json {
        print::json(out, &batch.document())?;
    } else {
        for line in batch.lines() {
            print::line(out, line)?;
        }
        let page = args.output.join("report.html");
        print::line(out, format!("wrote {}", page.display()))?;
    }
    batch.complete()?;
    let found = batch.captures.iter().filter_map(|capture| {
        let fit = &capture.found.as_ref().ok()?.fit;
        Some((&capture.name, fit))
    });
    let bad: Vec<String> = found
        .flat_map(|(name, fit)| fit.bad().map(move |said| format!("{name}, {said}")))
        .collect();
    print::strict(args.choice.fit.strict, &bad)
}

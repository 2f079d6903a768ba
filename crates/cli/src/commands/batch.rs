//! `beamspot batch`

use super::print;
use crate::args::{BatchArgs, Common};
use pipeline::batch::{self, Batch, List, Options, Outcome};
use pipeline::fit_json::{ChannelSummary, SCHEMA_VERSION};
use pipeline::{Monitor, Result};
use serde::Serialize;
use std::io::Write;

#[derive(Serialize)]
struct Document<'a> {
    schema_version: u32,
    measured: usize,
    measured_before: usize,
    not_measured: usize,
    captures: Vec<Capture<'a>>,
}

#[derive(Serialize)]
struct Capture<'a> {
    capture: &'a str,
    state: &'static str,
    measured_before: bool,
    material: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<&'a str>,
    channels: &'a [ChannelSummary],
}

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
        print::json(out, &document(&batch))?;
    } else {
        summary(out, &batch)?;
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

/// What a person wants to see first: of many captures, those that want mending.
fn summary(out: &mut impl Write, batch: &Batch) -> Result<()> {
    for Outcome { name, found, .. } in &batch.captures {
        match found {
            Ok(found) => {
                for said in found.fit.bad() {
                    print::line(out, format!("{name}: verdict BAD, {said}"))?;
                }
            }
            Err(failure) => {
                let state = failure.state();
                print::line(out, format!("{name}: {state}: {}", failure.error))?;
            }
        }
    }
    let (all, failed, stood) = (batch.captures.len(), batch.failed(), batch.stood());
    let before = if stood > 0 {
        format!(" ({stood} of them before)")
    } else {
        String::new()
    };
    let measured = all - failed;
    print::line(
        out,
        format!("{all} captures: {measured} measured{before}, {failed} not"),
    )
}

fn document(batch: &Batch) -> Document<'_> {
    Document {
        schema_version: SCHEMA_VERSION,
        measured: batch.captures.len() - batch.failed(),
        measured_before: batch.stood(),
        not_measured: batch.failed(),
        captures: batch.captures.iter().map(Capture::from).collect(),
    }
}

impl<'a> From<&'a Outcome> for Capture<'a> {
    fn from(outcome: &'a Outcome) -> Self {
        let (state, error) = match &outcome.found {
            Ok(_) => ("measured", None),
            Err(failure) => (failure.state(), Some(failure.error.as_str())),
        };
        let found = outcome.found.as_ref().ok();
        Self {
            capture: &outcome.name,
            state,
            measured_before: found.is_some_and(|found| found.stood),
            material: outcome.material.as_deref(),
            error,
            channels: found.map_or(&[], |found| &found.fit.channels),
        }
    }
}

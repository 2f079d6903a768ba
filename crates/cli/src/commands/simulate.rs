//! `beamspot simulate`

use super::print;
use crate::args::{Common, SimulateArgs};
use pipeline::simulation::{Effort, simulate};
use pipeline::{Error, Kind, Monitor, Result};
use report::{text_table, uncertain};
use std::io::Write;

/// Follows photons through layers and prints the totals.
pub(crate) fn run(
    args: &SimulateArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let SimulateArgs {
        medium,
        output,
        photons,
        until_u,
        seed,
        simd,
    } = args;
    let effort = Effort {
        photons: *photons,
        until_u: *until_u,
    };
    let mut say = |text: &str| {
        // Nobody is left to tell if standard error is closed.
        let _ = writeln!(std::io::stderr(), "beamspot: {text}");
    };
    let run = simulate(
        medium,
        output,
        effort,
        *seed,
        simd.as_deref(),
        common.force,
        monitor,
        &mut say,
    )?;
    if common.json {
        print::json(out, &run.totals)?;
    } else {
        let rows: Vec<Vec<String>> = run
            .totals
            .rows()
            .into_iter()
            .map(|(name, value, u)| vec![name.to_owned(), uncertain(value, u)])
            .collect();
        print::line(
            out,
            text_table(&["share of the incident light", ""], &rows).trim_end(),
        )?;
        let (photons, events) = run.totals.counts();
        print::line(
            out,
            format!(
                "{photons} photons, {events} scatterings; wrote {}",
                output.display()
            ),
        )?;
    }
    if run.interrupted {
        let message = format!("interrupted; {} holds what was done", output.display());
        return Err(Error::new(Kind::Interrupted, message));
    }
    Ok(())
}

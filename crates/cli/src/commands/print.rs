//! What several commands print.

use fit::{Constraint, Fit, Termination};
use pipeline::library::ModelChoice;
use pipeline::{Error, Kind, Result};
use report::{at_most, significant, text_table, uncertain};
use serde::Serialize;
use std::io::Write;

use crate::args::{ConstraintArg, FitChoice};

impl From<ConstraintArg> for Constraint {
    fn from(arg: ConstraintArg) -> Self {
        match arg {
            ConstraintArg::Exact => Self::Exact,
            ConstraintArg::Joint => Self::Joint,
            ConstraintArg::None => Self::None,
        }
    }
}

impl FitChoice {
    /// The model that was asked for.
    pub(crate) fn model(&self) -> ModelChoice {
        ModelChoice {
            name: self.model.clone(),
            g: self.g,
            ..ModelChoice::default()
        }
    }
}

/// Writes to standard output; a reader that went away is no fault.
pub(crate) fn line(out: &mut impl Write, text: impl AsRef<str>) -> Result<()> {
    match writeln!(out, "{}", text.as_ref()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::new(Kind::Fault, format!("standard output: {e}")))
        }
        _ => Ok(()),
    }
}

/// One JSON document on standard output.
pub(crate) fn json(out: &mut impl Write, document: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(document).map_err(|e| Error::new(Kind::Fault, e))?;
    line(out, text)
}

/// The coefficients of each channel, for a person.
pub(crate) fn fits(out: &mut impl Write, fits: &[Fit]) -> Result<()> {
    let header = [
        "channel",
        "sigma_a [mm^-1]",
        "sigma_s' [mm^-1]",
        "mfp [mm]",
        "range [mm]",
        "outside",
        "chi2/dof",
        "search",
    ];
    let rows: Vec<Vec<String>> = fits
        .iter()
        .map(|fit| {
            let absorption = match fit.upper_limit {
                Some(limit) => at_most(limit),
                None => uncertain(fit.sigma_a.value, fit.sigma_a.u),
            };
            let search = match fit.termination {
                Termination::Converged => "converged",
                Termination::AtBound => "at bound",
                Termination::OutOfEvaluations => "gave up",
            };
            vec![
                fit.channel.clone(),
                absorption,
                uncertain(fit.sigma_s_prime.value, fit.sigma_s_prime.u),
                significant(1.0 / fit.coefficients().sigma_t_prime(), 3),
                format!("{:.2}-{:.2}", fit.range_mm.0, fit.range_mm.1),
                format!("{:.1} %", 100.0 * fit.share_outside),
                format!("{:.2}", fit.reduced_chi2),
                search.to_owned(),
            ]
        })
        .collect();
    line(out, text_table(&header, &rows).trim_end())?;
    for fit in fits {
        for warning in &fit.warnings {
            line(out, format!("{}: {warning}", fit.channel))?;
        }
    }
    Ok(())
}

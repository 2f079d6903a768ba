//! What several commands print.

use fit::{Constraint, Fit, Termination};
use physics::RadialProfile;
use pipeline::bootstrap::Bootstrap;
use pipeline::comparison::Compared;
use pipeline::library::ModelChoice;
use pipeline::verdict::Verdict;
use pipeline::{Error, Kind, Result};
use report::{at_most, preview_text, significant, text_table, uncertain};
use serde::Serialize;
use std::io::Write;

use crate::args::{Common, ConstraintArg, FitChoice};

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
        let default = ModelChoice::default();
        let name = if self.compares() {
            default.name.clone()
        } else {
            self.model.clone()
        };
        ModelChoice {
            name,
            g: self.g,
            ..default
        }
    }

    /// Whether all models were asked for.
    pub(crate) fn compares(&self) -> bool {
        self.model == "all"
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

/// Every model beside the others, channel by channel, and what each warns of.
pub(crate) fn comparison(out: &mut impl Write, compared: &[Compared]) -> Result<()> {
    if compared.is_empty() {
        return Ok(());
    }
    let header = [
        "channel",
        "model",
        "sigma_a [mm^-1]",
        "sigma_s' [mm^-1]",
        "R",
        "scale",
        "chi2/dof",
        "search",
    ];
    let mut rows: Vec<(usize, Vec<String>)> = vec![];
    let mut said = vec![];
    for model in compared {
        let name = model.name();
        let fits = match &model.outcome {
            Ok(fits) => fits,
            Err(why) => {
                said.push(format!("{name}: not fitted: {why}"));
                continue;
            }
        };
        for (index, ((given, fit), total)) in fits.iter().zip(model.totals()?).enumerate() {
            if let Some((g, u)) = given.fitted_g() {
                said.push(format!(
                    "{name}, {}: g was not given: the data want {g:.2} +- {u:.2}",
                    fit.channel
                ));
            }
            let row = vec![
                fit.channel.clone(),
                name.to_owned(),
                absorption(fit),
                uncertain(fit.sigma_s_prime.value, fit.sigma_s_prime.u),
                significant(total, 4),
                significant(fit.scale, 4),
                format!("{:.2}", fit.reduced_chi2),
                search(fit).to_owned(),
            ];
            rows.push((index, row));
            let warnings = fit.warnings.iter();
            said.extend(warnings.map(|w| format!("{name}, {}: {w}", fit.channel)));
        }
    }
    rows.sort_by_key(|(index, _)| *index);
    let rows: Vec<Vec<String>> = rows.into_iter().map(|(_, row)| row).collect();
    line(out, "models side by side:")?;
    line(out, text_table(&header, &rows).trim_end())?;
    said.iter().try_for_each(|text| line(out, text))
}

fn absorption(fit: &Fit) -> String {
    match fit.upper_limit {
        Some(limit) => at_most(limit),
        None => uncertain(fit.sigma_a.value, fit.sigma_a.u),
    }
}

fn search(fit: &Fit) -> &'static str {
    match fit.termination {
        Termination::Converged => "converged",
        Termination::AtBound => "at bound",
        Termination::OutOfEvaluations => "gave up",
    }
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
            vec![
                fit.channel.clone(),
                absorption(fit),
                uncertain(fit.sigma_s_prime.value, fit.sigma_s_prime.u),
                significant(1.0 / fit.coefficients().sigma_t_prime(), 3),
                format!("{:.2}-{:.2}", fit.range_mm.0, fit.range_mm.1),
                format!("{:.1} %", 100.0 * fit.share_outside),
                format!("{:.2}", fit.reduced_chi2),
                search(fit).to_owned(),
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

/// Where each channel's uncertainty comes from, and how far its numbers can be trusted.
pub(crate) fn verdicts(out: &mut impl Write, fits: &[Fit], verdicts: &[Verdict]) -> Result<()> {
    for (fit, verdict) in fits.iter().zip(verdicts) {
        let share = |u: f64, whole: f64| 100.0 * (u / whole).powi(2);
        let mut lines: Vec<_> = fit.budget.iter().collect();
        lines.sort_by(|a, b| b.u_sigma_a.total_cmp(&a.u_sigma_a));
        let parts: Vec<String> = lines
            .iter()
            .filter(|c| share(c.u_sigma_a, fit.sigma_a.u) >= 1.0)
            .map(|c| format!("{} {:.0} %", c.source, share(c.u_sigma_a, fit.sigma_a.u)))
            .collect();
        let (name, parts) = (&fit.channel, parts.join(", "));
        line(out, format!("{name}: u(sigma_a)^2 comes from: {parts}"))?;
        let word = if verdict.good { "good" } else { "BAD" };
        line(out, format!("{name}: verdict {word}"))?;
        for sentence in verdict.sentences() {
            line(out, format!("{name}:   {sentence}"))?;
        }
    }
    Ok(())
}

/// The spread of replicas beside the budget.
pub(crate) fn bootstraps(
    out: &mut impl Write,
    fits: &[Fit],
    bootstraps: &[Bootstrap],
) -> Result<()> {
    for (fit, b) in fits.iter().zip(bootstraps) {
        // Replicas are of light that the model itself makes.
        let lines = fit
            .budget
            .iter()
            .filter(|c| !c.source.starts_with("model "));
        let (u_a, u_s) = lines.fold((0.0_f64, 0.0_f64), |(a, s), c| {
            (a.hypot(c.u_sigma_a), s.hypot(c.u_sigma_s_prime))
        });
        line(
            out,
            format!(
                "{}: {} replicas ({} failed) spread by {} and {} mm^-1; the budget without model \
                 error says {} and {}",
                fit.channel,
                b.replicas,
                b.failed,
                significant(b.u_sigma_a_per_mm, 3),
                significant(b.u_sigma_s_prime_per_mm, 3),
                significant(u_a, 3),
                significant(u_s, 3)
            ),
        )?;
    }
    Ok(())
}

/// Profile and fit of every channel, for a person at a terminal; for a file or another program
/// nothing.
pub(crate) fn preview(
    out: &mut impl Write,
    fits: &[Fit],
    profiles: &[RadialProfile],
    common: Common,
) -> Result<()> {
    if !common.on_screen {
        return Ok(());
    }
    line(out, preview_text(fits, profiles).trim_end())
}

/// The first thing that speaks against each channel, if anything does.
pub(crate) fn bad_verdicts(fits: &[Fit], verdicts: &[Verdict]) -> Vec<String> {
    let pairs = fits.iter().zip(verdicts);
    pairs
        .filter_map(|(fit, v)| Some(format!("channel {}: {}", fit.channel, v.bad.first()?)))
        .collect()
}

/// Fails a strict call for a bad verdict.
pub(crate) fn strict(strict: bool, bad: &[String]) -> Result<()> {
    match bad {
        [first, ..] if strict => Err(Error::new(
            Kind::Quality,
            format!(
                "{first} (bad verdicts: {}; what was measured is written)",
                bad.len()
            ),
        )),
        _ => Ok(()),
    }
}

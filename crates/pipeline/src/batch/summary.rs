//! The tables and the page of all captures.

use super::{Batch, Outcome};
use crate::error::Result;
use crate::files::Outputs;
use formats::status_csv::Status;
use physics::Material;
use report::{BatchChannel, BatchPage, BatchRow};
use std::io::Write;
use std::path::Path;

/// The files of a batch, beside the captures' folders.
pub(super) const NAMES: [&str; 3] = ["materials.csv", "status.csv", "report.html"];

/// Writes them into `folder`.
pub(super) fn write(batch: &Batch, folder: &Path) -> Result<()> {
    let files = Outputs::new(folder, NAMES, &[], true)?;
    let rows: Vec<Material> = batch.captures.iter().flat_map(rows).collect();
    files.write("materials.csv", |out| {
        Ok(formats::materials_csv::write(&rows, out)?)
    })?;
    let statuses: Vec<Status> = batch.captures.iter().map(status).collect();
    files.write("status.csv", |out| {
        Ok(formats::status_csv::write(&statuses, out)?)
    })?;
    let page = BatchPage {
        rows: batch.captures.iter().map(row).collect(),
        tool: concat!("beamspot ", env!("CARGO_PKG_VERSION")),
    };
    files.write("report.html", |out| {
        Ok(out.write_all(report::batch_html(&page).as_bytes())?)
    })?;
    files.commit()
}

/// The rows of a capture, which say where they are from: many captures may be of one material.
fn rows(outcome: &Outcome) -> Vec<Material> {
    let Ok(found) = &outcome.found else {
        return vec![];
    };
    let mut rows = found.materials.clone();
    for row in &mut rows {
        row.source = format!("{}, capture {}", row.source, outcome.name);
    }
    rows
}

fn status(outcome: &Outcome) -> Status {
    let capture = outcome.name.clone();
    let material = outcome.material.clone().unwrap_or_default();
    match &outcome.found {
        Ok(found) => Status {
            capture,
            state: "measured".to_owned(),
            material,
            verdict: found.fit.bad().next().unwrap_or("good".to_owned()),
            error: String::new(),
        },
        Err(failure) => Status {
            capture,
            state: failure.state().to_owned(),
            material,
            verdict: String::new(),
            error: failure.error.clone(),
        },
    }
}

fn row(outcome: &Outcome) -> BatchRow<'_> {
    let found = match &outcome.found {
        Ok(found) => Ok(&found.fit.channels),
        Err(failure) => Err(failure.error.as_str()),
    };
    BatchRow {
        capture: &outcome.name,
        material: outcome.material.as_deref(),
        page: format!("{}/{}/report.html", super::CAPTURES, outcome.name),
        channels: found.map(|channels| {
            let shown = channels.iter().map(|c| BatchChannel {
                channel: &c.channel,
                sigma_s_prime: (c.sigma_s_prime_per_mm.value, c.sigma_s_prime_per_mm.u),
                sigma_a: (c.sigma_a_per_mm.value, c.sigma_a_per_mm.u),
                upper_limit: c.upper_limit,
                reduced_chi2: c.reduced_chi2,
                bad: c.verdict.as_ref().map_or(&[], |v| &v.bad),
            });
            shown.collect()
        }),
    }
}

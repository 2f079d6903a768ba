//! `beamspot measure`

use super::print;
use crate::args::{Common, MeasureArgs};
use physics::Material;
use pipeline::files::{self, Outputs};
use pipeline::fit_json::{FitDocument, SCHEMA_VERSION};
use pipeline::measure::{self, Measurement};
use pipeline::{Monitor, Result, capture, outputs};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct Document {
    schema_version: u32,
    captures: Vec<FitDocument>,
}

/// Measures captures, one after the other, and writes what each gives.
pub(crate) fn run(
    args: &MeasureArgs,
    common: Common,
    monitor: &dyn Monitor,
    out: &mut impl Write,
) -> Result<()> {
    let choices = args.choice.choices()?;
    let loaded = args
        .captures
        .iter()
        .map(|path| capture::load(path))
        .collect::<Result<Vec<_>>>()?;
    let folders = folders(args, &loaded);
    let mut documents = vec![];
    let mut verdicts = vec![];
    let mut tables: Vec<Vec<Material>> = vec![];
    // Refuse what is in the way before a minute of merging, not after.
    let collected = (loaded.len() > 1)
        .then(|| Outputs::new(&args.output, ["materials.csv"], &[], common.force))
        .transpose()?;
    for (loaded, folder) in loaded.iter().zip(&folders) {
        let opened = outputs::open(loaded, folder, common.force)?;
        let measurement = measure::measure(loaded, &choices, monitor)?;
        outputs::write(opened, loaded, &measurement)?;
        if !common.json {
            summary(out, &measurement, folder, common)?;
        }
        verdicts.extend(print::bad_verdicts(
            &measurement.fits,
            &measurement.verdicts,
        ));
        documents.push(measurement.document());
        tables.push(measurement.materials);
    }
    if let Some(collected) = collected {
        let rows = tables.concat();
        collected.write("materials.csv", |out| {
            Ok(formats::materials_csv::write(&rows, out)?)
        })?;
        collected.commit()?;
    }
    if !common.json {
        return print::strict(args.choice.fit.strict, &verdicts);
    }
    match documents.pop() {
        Some(only) if documents.is_empty() => print::json(out, &only)?,
        last => {
            documents.extend(last);
            print::json(
                out,
                &Document {
                    schema_version: SCHEMA_VERSION,
                    captures: documents,
                },
            )?;
        }
    }
    print::strict(args.choice.fit.strict, &verdicts)
}

/// One capture goes into the folder itself, several into one each, called by their material.
fn folders(args: &MeasureArgs, loaded: &[capture::Loaded]) -> Vec<PathBuf> {
    if let [_] = loaded {
        return vec![args.output.clone()];
    }
    let mut used: BTreeMap<String, u32> = BTreeMap::new();
    loaded
        .iter()
        .map(|l| {
            let name = files::safe_name(&l.capture.material);
            let count = used.entry(name.to_lowercase()).or_default();
            *count += 1;
            args.output.join(if *count > 1 {
                format!("{name}-{count}")
            } else {
                name
            })
        })
        .collect()
}

/// What a person wants to see first.
pub(crate) fn summary(
    out: &mut impl Write,
    measurement: &Measurement,
    folder: &Path,
    common: Common,
) -> Result<()> {
    let given = measurement.common();
    let constraint = pipeline::fit_json::constraint_name(given.constraint);
    let material = &measurement.material;
    print::line(
        out,
        format!(
            "{material}, eta {}, model {}, constraint {constraint}",
            given.eta, given.model.name
        ),
    )?;
    print::fits(out, &measurement.fits)?;
    print::comparison(out, &measurement.compared)?;
    print::verdicts(out, &measurement.fits, &measurement.verdicts)?;
    print::bootstraps(out, &measurement.fits, &measurement.bootstraps)?;
    for confirmation in measurement.confirmation_lines() {
        print::line(out, confirmation)?;
    }
    for warning in &measurement.warnings {
        print::line(out, format!("warning: {warning}"))?;
    }
    for assumption in &measurement.assumptions {
        print::line(out, format!("note: {assumption}"))?;
    }
    print::preview(out, &measurement.fits, &measurement.profiles(), common)?;
    print::line(
        out,
        format!("wrote {}", folder.join("report.html").display()),
    )
}

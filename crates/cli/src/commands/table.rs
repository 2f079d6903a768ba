//! `beamspot table`

use super::print;
use crate::args::{Common, TableCommand, TableFormat};
use formats::{materials_csv, materials_json};
use physics::{DiffuseFresnel, Material};
use pipeline::error::Blame;
use pipeline::files::{Outputs, read, split};
use pipeline::{Error, Kind, Result, library};
use report::{significant, text_table, uncertain};
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};
use tables::{Rounding, derived, fresnel_of};

/// Shows, converts, joins or audits tables.
pub(crate) fn run(command: &TableCommand, common: Common, out: &mut impl Write) -> Result<()> {
    match command {
        TableCommand::Show { files } => show(files, common, out),
        TableCommand::Convert { file, to, output } => write(
            &rows(file)?,
            *to,
            output,
            std::slice::from_ref(file),
            common,
            out,
        ),
        TableCommand::Merge { files, output } => {
            let read = files.iter().map(|f| rows(f)).collect::<Result<Vec<_>>>()?;
            let merged = tables::merge(&read).map_err(|conflict| {
                let name = |table: usize| files[table].display().to_string();
                let place = format!(
                    "{} and {}",
                    name(conflict.first.table),
                    name(conflict.second.table)
                );
                Error::new(Kind::Input, format!("{place}: {conflict}"))
            })?;
            write(&merged, TableFormat::Csv, output, files, common, out)
        }
        TableCommand::Check { files } => check(files, common, out),
    }
}

fn is_json(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("json"))
}

fn rows(path: &Path) -> Result<Vec<Material>> {
    let bytes = read(path)?;
    if is_json(path) {
        materials_json::read(&bytes[..]).input(path.display())
    } else {
        materials_csv::read(&bytes[..]).input(path.display())
    }
}

fn write(
    rows: &[Material],
    to: TableFormat,
    output: &Path,
    inputs: &[PathBuf],
    common: Common,
    out: &mut impl Write,
) -> Result<()> {
    let (folder, name) = split(output)?;
    let outputs = Outputs::new(&folder, [&name], inputs, common.force)?;
    outputs.write(&name, |out| {
        match to {
            TableFormat::Csv => materials_csv::write(rows, out)?,
            TableFormat::Json => materials_json::write(rows, out)?,
        }
        Ok(())
    })?;
    outputs.commit()?;
    print::line(
        out,
        format!("wrote {} ({} rows)", output.display(), rows.len()),
    )
}

fn show(files: &[PathBuf], common: Common, out: &mut impl Write) -> Result<()> {
    let all: Vec<Material> = if files.is_empty() {
        library::materials()
    } else {
        files
            .iter()
            .map(|f| rows(f))
            .collect::<Result<Vec<_>>>()?
            .concat()
    };
    if common.json {
        let mut text = vec![];
        materials_json::write(&all, &mut text).fault("standard output")?;
        return print::line(out, String::from_utf8_lossy(&text).trim_end());
    }
    let header = [
        "material",
        "channel",
        "sigma_a [mm^-1]",
        "sigma_s' [mm^-1]",
        "eta",
        "mfp [mm]",
        "1/sigma_tr [mm]",
        "albedo'",
        "R_d",
        "model",
    ];
    let lines: Vec<Vec<String>> = all
        .iter()
        .map(|row| {
            let number = |value: f64, u: Option<f64>| match u {
                Some(u) => uncertain(value, u),
                None => value.to_string(),
            };
            let fresnel = fresnel_of(&row.model).unwrap_or(DiffuseFresnel::Exact);
            let follows = derived(&row.medium, fresnel);
            vec![
                row.material.clone(),
                row.channel.clone(),
                number(row.medium.sigma_a, row.u_sigma_a_per_mm),
                number(row.medium.sigma_s_prime, row.u_sigma_s_prime_per_mm),
                row.medium.eta.to_string(),
                significant(follows.mean_free_path_mm, 3),
                follows
                    .diffusion_length_mm
                    .map_or("infinite".to_owned(), |l| significant(l, 3)),
                format!("{:.5}", follows.albedo_prime),
                format!("{:.3}", follows.total_reflectance),
                row.model.clone(),
            ]
        })
        .collect();
    print::line(out, text_table(&header, &lines).trim_end())
}

#[derive(Serialize)]
struct CheckDocument {
    schema_version: u32,
    rows: usize,
    findings: Vec<Finding>,
}

#[derive(Serialize)]
struct Finding {
    file: Option<String>,
    material: String,
    channel: String,
    fault: String,
    excess: f64,
}

fn check(files: &[PathBuf], common: Common, out: &mut impl Write) -> Result<()> {
    let mut document = CheckDocument {
        schema_version: pipeline::fit_json::SCHEMA_VERSION,
        rows: 0,
        findings: vec![],
    };
    if files.is_empty() {
        audit(
            library::materials_text().as_bytes(),
            None,
            "data/materials.csv",
            &mut document,
        )?;
    }
    for file in files {
        let mut bytes = read(file)?;
        if is_json(file) {
            // The digits as written are what the audit judges by, and csv keeps them.
            let rows = materials_json::read(&bytes[..]).input(file.display())?;
            bytes.clear();
            materials_csv::write(&rows, &mut bytes).fault(file.display())?;
        }
        let name = file.display().to_string();
        audit(&bytes, Some(&name), &name, &mut document)?;
    }
    if common.json {
        return print::json(out, &document);
    }
    for finding in &document.findings {
        let Finding {
            file,
            material,
            channel,
            fault,
            ..
        } = finding;
        let place = file.as_ref().map_or(String::new(), |f| format!("{f}: "));
        print::line(out, format!("{place}{material} {channel}: {fault}"))?;
    }
    let (rows, faults) = (document.rows, document.findings.len());
    print::line(
        out,
        format!("{rows} rows checked, {faults} do not hold together"),
    )
}

fn audit(
    bytes: &[u8],
    file: Option<&str>,
    place: &str,
    document: &mut CheckDocument,
) -> Result<()> {
    let printed = materials_csv::read_printed(bytes).input(place)?;
    let findings = tables::check(printed.iter().map(|p| {
        let rounding = Rounding {
            sigma_a_per_mm: p.half_unit_sigma_a_per_mm,
            sigma_s_prime_per_mm: p.half_unit_sigma_s_prime_per_mm,
            total_reflectance: p.half_unit_total_reflectance.unwrap_or(0.0),
        };
        (&p.material, rounding)
    }));
    document.rows += printed.len();
    document
        .findings
        .extend(findings.into_iter().map(|f| Finding {
            file: file.map(str::to_owned),
            material: f.material,
            channel: f.channel,
            excess: f.fault.excess(),
            fault: f.fault.to_string(),
        }));
    Ok(())
}

//! `beamspot table`

use super::print;
use crate::args::{Common, TableCommand, TableFormat};
use formats::export::datapackage;
use formats::{materials_csv, materials_json};
use physics::{DiffuseFresnel, Material};
use pipeline::error::Blame;
use pipeline::export::{Target, export, read_table};
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
        TableCommand::Show { files, unit } => show(files, unit.scene_unit_mm, common, out),
        TableCommand::Convert {
            file,
            to,
            output,
            unit,
            material,
        } => {
            let mut rows = read_table(file, unit.scene_unit_mm)?;
            if let Some(name) = material {
                rows.retain(|row| row.material.eq_ignore_ascii_case(name));
                if rows.is_empty() {
                    let message = format!("{}: no material is called `{name}`", file.display());
                    return Err(Error::new(Kind::Usage, message));
                }
            }
            let conversion = Conversion {
                to: *to,
                scene_unit_mm: unit.scene_unit_mm,
                inputs: std::slice::from_ref(file),
            };
            conversion.write(&rows, output, common, out)
        }
        TableCommand::Merge {
            files,
            output,
            keep_all,
        } => {
            let read = files
                .iter()
                .map(|f| read_table(f, None))
                .collect::<Result<Vec<_>>>()?;
            let names: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
            let merged = if *keep_all {
                tables::keep_all(read, &names)
            } else {
                tables::merge(&read).map_err(|conflict| {
                    let [first, second] =
                        [conflict.first, conflict.second].map(|c| &names[c.table]);
                    let place = format!("{first} and {second}");
                    let message = format!("{place}: {conflict}, or keep both with --keep-all");
                    Error::new(Kind::Input, message)
                })?
            };
            let conversion = Conversion {
                to: TableFormat::Csv,
                scene_unit_mm: None,
                inputs: files,
            };
            conversion.write(&merged, output, common, out)
        }
        TableCommand::Check { files, unit } => check(files, unit.scene_unit_mm, common, out),
    }
}

#[derive(Serialize)]
struct Written {
    schema_version: u32,
    output: String,
    rows: usize,
    warnings: Vec<String>,
}

/// A table on its way into another form.
struct Conversion<'a> {
    to: TableFormat,
    scene_unit_mm: Option<f64>,
    inputs: &'a [PathBuf],
}

impl Conversion<'_> {
    fn write(
        &self,
        rows: &[Material],
        output: &Path,
        common: Common,
        out: &mut impl Write,
    ) -> Result<()> {
        let (folder, name) = split(output)?;
        let table = "materials.csv";
        let with_table = self.to == TableFormat::Datapackage;
        let mut names = vec![name.clone()];
        if with_table {
            names.push(table.into());
        }
        if with_table && name.as_os_str() == table {
            let message = format!(
                "the description of {table} cannot have its name; call it datapackage.json"
            );
            return Err(Error::new(Kind::Usage, message));
        }
        let outputs = Outputs::new(&folder, names, self.inputs, common.force)?;
        let mut warnings = vec![];
        let text = |target| {
            let file = self.inputs[0]
                .file_name()
                .unwrap_or_default()
                .to_string_lossy();
            let unit = self.scene_unit_mm.unwrap_or(match target {
                // A unit of Blender's is a metre.
                Target::Blender => 1000.0,
                _ => 1.0,
            });
            export(rows, target, unit, &file)
        };
        let bytes = match self.to.target() {
            Some(target) => {
                let exported = text(target)?;
                warnings = exported.warnings;
                exported.text.into_bytes()
            }
            None => {
                let mut bytes = vec![];
                match self.to {
                    TableFormat::Json => {
                        materials_json::write(rows, &mut bytes).fault(output.display())?;
                    }
                    TableFormat::Datapackage => bytes = datapackage::write(table).into_bytes(),
                    _ => materials_csv::write(rows, &mut bytes).fault(output.display())?,
                }
                bytes
            }
        };
        outputs.write(&name, |file| Ok(file.write_all(&bytes)?))?;
        if with_table {
            outputs.write(table, |file| Ok(materials_csv::write(rows, file)?))?;
        }
        outputs.commit()?;
        if common.json {
            let document = Written {
                schema_version: pipeline::fit_json::SCHEMA_VERSION,
                output: output.display().to_string(),
                rows: rows.len(),
                warnings,
            };
            return print::json(out, &document);
        }
        for warning in warnings {
            print::line(out, format!("warning: {warning}"))?;
        }
        print::line(
            out,
            format!("wrote {} ({} rows)", output.display(), rows.len()),
        )
    }
}

fn show(
    files: &[PathBuf],
    scene_unit_mm: Option<f64>,
    common: Common,
    out: &mut impl Write,
) -> Result<()> {
    let all: Vec<Material> = if files.is_empty() {
        library::materials()
    } else {
        files
            .iter()
            .map(|f| read_table(f, scene_unit_mm))
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

fn check(
    files: &[PathBuf],
    scene_unit_mm: Option<f64>,
    common: Common,
    out: &mut impl Write,
) -> Result<()> {
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
        // The digits as written are what the audit judges by, and csv keeps them.
        let is_csv = file
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("csv"));
        let bytes = if is_csv {
            read(file)?
        } else {
            let rows = read_table(file, scene_unit_mm)?;
            let mut bytes = vec![];
            materials_csv::write(&rows, &mut bytes).fault(file.display())?;
            bytes
        };
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

//! Material tables as JSON: the columns of `materials.csv` as fields, absent where blank.

use physics::{Material, ReducedMedium};
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};
use thiserror::Error;

/// Version of the layout, in every document.
pub const SCHEMA_VERSION: u32 = 1;

/// A JSON material table cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MaterialsJsonError {
    /// Not JSON, or not of this form; the message gives line and column.
    #[error("not a material table in JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// Written by a version that we do not know.
    #[error(
        "field `schema_version`: found {0}, expected 1: convert the table with the beamspot that wrote it"
    )]
    SchemaVersion(u32),
    /// A number outside its domain.
    #[error("field `materials[{index}].{field}`: found {found}, expected {expected}")]
    Value {
        /// Position of the row, from 0.
        index: usize,
        /// Name of the field.
        field: &'static str,
        /// The number found.
        found: f64,
        /// Its domain.
        expected: crate::Expected,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    schema_version: u32,
    materials: Vec<Row>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    material: String,
    channel: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    wavelength_nm: Option<f64>,
    sigma_s_prime_per_mm: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    u_sigma_s_prime_per_mm: Option<f64>,
    sigma_a_per_mm: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    u_sigma_a_per_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    correlation: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    total_reflectance: Option<f64>,
    eta: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    g: Option<f64>,
    #[serde(default)]
    model: String,
    #[serde(default)]
    source: String,
}

/// The rows of a material table.
///
/// # Errors
///
/// [`MaterialsJsonError`] names the place or the field of the first fault.
pub fn read(input: impl Read) -> Result<Vec<Material>, MaterialsJsonError> {
    let document: Document = serde_json::from_reader(input)?;
    if document.schema_version != SCHEMA_VERSION {
        return Err(MaterialsJsonError::SchemaVersion(document.schema_version));
    }
    let checked = |(index, row): (usize, Row)| {
        check(index, &row)?;
        Ok(Material {
            material: row.material,
            channel: row.channel,
            wavelength_nm: row.wavelength_nm,
            medium: ReducedMedium {
                sigma_a: row.sigma_a_per_mm,
                sigma_s_prime: row.sigma_s_prime_per_mm,
                eta: row.eta,
            },
            u_sigma_a_per_mm: row.u_sigma_a_per_mm,
            u_sigma_s_prime_per_mm: row.u_sigma_s_prime_per_mm,
            correlation: row.correlation,
            total_reflectance: row.total_reflectance,
            g: row.g,
            model: row.model,
            source: row.source,
        })
    };
    document
        .materials
        .into_iter()
        .enumerate()
        .map(checked)
        .collect()
}

/// The domains of `materials.csv`; JSON itself has no NaN and no infinity.
fn check(index: usize, row: &Row) -> Result<(), MaterialsJsonError> {
    use crate::Expected::{MinusOneToOne, NotNegative, Positive};
    let fields = [
        ("wavelength_nm", row.wavelength_nm, Positive),
        (
            "u_sigma_s_prime_per_mm",
            row.u_sigma_s_prime_per_mm,
            NotNegative,
        ),
        ("u_sigma_a_per_mm", row.u_sigma_a_per_mm, NotNegative),
        ("correlation", row.correlation, MinusOneToOne),
        ("eta", Some(row.eta), Positive),
        ("g", row.g, MinusOneToOne),
    ];
    for (field, value, expected) in fields {
        if let Some(found) = value
            && !expected.admits(found)
        {
            return Err(MaterialsJsonError::Value {
                index,
                field,
                found,
                expected,
            });
        }
    }
    Ok(())
}

/// Writes the table, indented, with a line feed at its end.
///
/// # Errors
///
/// What the writer reports.
pub fn write(materials: &[Material], mut out: impl Write) -> Result<(), MaterialsJsonError> {
    let rows = materials.iter().map(|row| Row {
        material: row.material.clone(),
        channel: row.channel.clone(),
        wavelength_nm: row.wavelength_nm,
        sigma_s_prime_per_mm: row.medium.sigma_s_prime,
        u_sigma_s_prime_per_mm: row.u_sigma_s_prime_per_mm,
        sigma_a_per_mm: row.medium.sigma_a,
        u_sigma_a_per_mm: row.u_sigma_a_per_mm,
        correlation: row.correlation,
        total_reflectance: row.total_reflectance,
        eta: row.medium.eta,
        g: row.g,
        model: row.model.clone(),
        source: row.source.clone(),
    });
    let document = Document {
        schema_version: SCHEMA_VERSION,
        materials: rows.collect(),
    };
    serde_json::to_writer_pretty(&mut out, &document)?;
    out.write_all(b"\n").map_err(serde_json::Error::io)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_and_json_hold_the_same() {
        let csv = include_bytes!("../../../data/materials.csv");
        let mut rows = crate::materials_csv::read(csv.as_slice()).unwrap();
        rows[3].correlation = Some(-0.1 - 0.2);
        rows[4].u_sigma_a_per_mm = Some(1.2345678901234567e-5);
        let mut out = Vec::new();
        write(&rows, &mut out).unwrap();
        assert_eq!(read(out.as_slice()).unwrap(), rows);
    }

    #[test]
    fn faults_are_named() {
        let document = |version: u32, row: &str| {
            let text = format!("{{\"schema_version\": {version}, \"materials\": [{row}]}}");
            read(text.as_bytes()).unwrap_err().to_string()
        };
        let row = r#"{"material": "m", "channel": "G", "sigma_s_prime_per_mm": 1,
            "sigma_a_per_mm": 0.1, "eta": 1.3, "#;
        assert!(document(2, "").contains("schema_version"));
        let found = document(1, &format!("{row}\"u_sigma_a_per_mm\": -1}}"));
        assert!(
            found.contains("materials[0].u_sigma_a_per_mm`: found -1"),
            "{found}"
        );
        let found = document(1, &format!("{row}\"sigma\": 1}}"));
        assert!(
            found.contains("unknown field `sigma`") && found.contains("line 2"),
            "{found}"
        );
    }
}

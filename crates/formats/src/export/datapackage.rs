//! A `datapackage.json` (Frictionless Data Package) that says what the columns of a
//! `materials.csv` beside it are.

use crate::materials_csv;
use serde_json::{Value, json};

/// The document for a table called `file`.
pub fn write(file: &str) -> String {
    let fields: Vec<Value> = materials_csv::columns()
        .map(|(name, required)| {
            let (kind, description) = meaning(name);
            json!({
                "name": name,
                "type": kind,
                "description": description,
                "constraints": { "required": required },
            })
        })
        .collect();
    let document = json!({
        "name": "materials",
        "resources": [{
            "name": "materials",
            "path": file,
            "format": "csv",
            "mediatype": "text/csv",
            "encoding": "utf-8",
            "schema": { "fields": fields, "primaryKey": ["material", "channel"], "missingValues": [""] },
        }],
    });
    format!("{document:#}\n")
}

/// Type and meaning of a column of `materials.csv`.
fn meaning(column: &str) -> (&'static str, &'static str) {
    match column {
        "material" => ("string", "Name of the material"),
        "channel" => ("string", "Name of the channel, as R, G or B"),
        "wavelength_nm" => ("number", "Wavelength, nm"),
        "sigma_s_prime_per_mm" => ("number", "Reduced scattering coefficient, 1/mm"),
        "u_sigma_s_prime_per_mm" => (
            "number",
            "Standard uncertainty of the reduced scattering coefficient, 1/mm",
        ),
        "sigma_a_per_mm" => ("number", "Absorption coefficient, 1/mm"),
        "u_sigma_a_per_mm" => (
            "number",
            "Standard uncertainty of the absorption coefficient, 1/mm",
        ),
        "correlation" => (
            "number",
            "Correlation of the errors of the two coefficients",
        ),
        "total_reflectance" => (
            "number",
            "Total diffuse reflectance per power that enters, of the model",
        ),
        "eta" => ("number", "Refractive index relative to the outside"),
        "g" => ("number", "Mean cosine of the scattering angle"),
        "model" => ("string", "Model whose fit gave the coefficients"),
        "source" => ("string", "Where the row comes from"),
        other => unreachable!("column `{other}` has its meaning here"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_has_its_meaning() {
        let found: Value = serde_json::from_str(&write("m.csv")).unwrap();
        let fields = found["resources"][0]["schema"]["fields"]
            .as_array()
            .unwrap();
        assert_eq!(fields.len(), 13);
        assert_eq!(fields[5]["name"], "sigma_a_per_mm");
        assert_eq!(fields[5]["constraints"]["required"], true);
        assert_eq!(found["resources"][0]["path"], "m.csv");
    }
}

//! The samples of `beamspot sphere`: what an integrating sphere measured of each sample.

use crate::csv_table::{self, Column, CsvError, Expected, Row, optional, required};
use std::io::Read;

const COLUMNS: &[Column; 15] = &[
    required("sample"),
    optional("wavelength_nm"),
    required("thickness_mm"),
    optional("u_thickness_mm"),
    required("eta"),
    optional("eta_slide"),
    optional("angle_deg"),
    required("reflectance"),
    optional("u_reflectance"),
    required("transmittance"),
    optional("u_transmittance"),
    optional("collimated_transmittance"),
    optional("u_collimated_transmittance"),
    optional("g"),
    optional("u_g"),
];

/// One row: shares of the incident power, and what is known of the sample.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleRow {
    /// Its name.
    pub sample: String,
    /// Wavelength, nm.
    pub wavelength_nm: Option<f64>,
    /// Thickness, mm, and its standard uncertainty.
    pub thickness_mm: (f64, f64),
    /// Refractive index.
    pub eta: f64,
    /// Refractive index of the slides on both sides.
    pub eta_slide: Option<f64>,
    /// Angle of incidence, degrees.
    pub angle_deg: f64,
    /// Total reflectance with its standard uncertainty, the specular part included.
    pub reflectance: (f64, Option<f64>),
    /// Total transmittance with its standard uncertainty.
    pub transmittance: (f64, Option<f64>),
    /// Transmittance of unscattered light with its standard uncertainty.
    pub collimated_transmittance: Option<(f64, Option<f64>)>,
    /// Mean cosine with its standard uncertainty.
    pub g: Option<(f64, Option<f64>)>,
}

/// The rows of a table of samples.
///
/// # Errors
///
/// [`CsvError`] names line and column of the first fault.
pub fn read(input: impl Read) -> Result<Vec<SampleRow>, CsvError> {
    let rows = csv_table::read(input, COLUMNS)?;
    rows.iter().map(sample).collect()
}

fn sample(row: &Row) -> Result<SampleRow, CsvError> {
    let u = |column| row.number_or_blank(column, Expected::NotNegative);
    let share = |column| row.number(column, Expected::Finite);
    let blank_or = |column, expected| -> Result<_, CsvError> {
        let value = row.number_or_blank(column, expected)?;
        Ok(value.map(|value| (value, column + 1)))
    };
    let with_u = |found: Option<(f64, usize)>| -> Result<_, CsvError> {
        found.map(|(value, at)| Ok((value, u(at)?))).transpose()
    };
    Ok(SampleRow {
        sample: row.word(0)?,
        wavelength_nm: row.number_or_blank(1, Expected::Positive)?,
        thickness_mm: (row.number(2, Expected::Positive)?, u(3)?.unwrap_or(0.0)),
        eta: row.number(4, Expected::Positive)?,
        eta_slide: row.number_or_blank(5, Expected::Positive)?,
        angle_deg: row
            .number_or_blank(6, Expected::NotNegative)?
            .unwrap_or(0.0),
        reflectance: (share(7)?, u(8)?),
        transmittance: (share(9)?, u(10)?),
        collimated_transmittance: with_u(blank_or(11, Expected::NotNegative)?)?,
        g: with_u(blank_or(13, Expected::MinusOneToOne)?)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blanks_and_missing_columns_have_a_meaning() {
        let text = "sample,thickness_mm,eta,reflectance,u_reflectance,transmittance,g\n\
                    milk,1.0,1.34,0.4,0.002,0.3,0.8\n";
        let rows = read(text.as_bytes()).unwrap();
        assert_eq!(rows[0].reflectance, (0.4, Some(0.002)));
        assert_eq!(rows[0].transmittance, (0.3, None));
        assert_eq!(rows[0].g, Some((0.8, None)));
        assert_eq!((rows[0].eta_slide, rows[0].angle_deg), (None, 0.0));
        assert_eq!(rows[0].collimated_transmittance, None);
    }

    #[test]
    fn faults_name_line_and_column() {
        let text = "sample,thickness_mm,eta,reflectance,transmittance\nmilk,0,1.3,0.4,0.3\n";
        let message = read(text.as_bytes()).unwrap_err().to_string();
        assert!(
            message.starts_with("line 2, column `thickness_mm`: found `0`"),
            "{message}"
        );
    }
}

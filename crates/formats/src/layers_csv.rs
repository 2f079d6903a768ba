//! `layers.csv`: constituents of layered media, unreduced, as published.

use crate::csv_table::{self, Column, CsvError, Expected, number_or_blank, optional, required};
use std::io::{Read, Write};

const COLUMNS: &[Column; 8] = &[
    required("constituent"),
    optional("n_min"),
    optional("n_max"),
    optional("sigma_a_per_mm"),
    optional("sigma_s_per_mm"),
    optional("thickness_min_mm"),
    optional("thickness_max_mm"),
    optional("g"),
];

/// What is known of one constituent; `None` where the source is blank.
#[derive(Clone, Debug, PartialEq)]
pub struct Constituent {
    /// Name.
    pub constituent: String,
    /// Smallest refractive index.
    pub n_min: Option<f64>,
    /// Largest refractive index.
    pub n_max: Option<f64>,
    /// Absorption coefficient σₐ, mm⁻¹.
    pub sigma_a_per_mm: Option<f64>,
    /// Scattering coefficient σₛ, unreduced, mm⁻¹.
    pub sigma_s_per_mm: Option<f64>,
    /// Smallest thickness of its layer, mm.
    pub thickness_min_mm: Option<f64>,
    /// Largest thickness of its layer, mm.
    pub thickness_max_mm: Option<f64>,
    /// Mean cosine of the scattering angle.
    pub g: Option<f64>,
}

/// The constituents of a table.
///
/// # Errors
///
/// [`CsvError`] names line and column of the first fault.
pub fn read(input: impl Read) -> Result<Vec<Constituent>, CsvError> {
    let constituent = |row: &csv_table::Row| {
        Ok(Constituent {
            constituent: row.word(0)?,
            n_min: row.number_or_blank(1, Expected::Positive)?,
            n_max: row.number_or_blank(2, Expected::Positive)?,
            sigma_a_per_mm: row.number_or_blank(3, Expected::NotNegative)?,
            sigma_s_per_mm: row.number_or_blank(4, Expected::NotNegative)?,
            thickness_min_mm: row.number_or_blank(5, Expected::Positive)?,
            thickness_max_mm: row.number_or_blank(6, Expected::Positive)?,
            g: row.number_or_blank(7, Expected::MinusOneToOne)?,
        })
    };
    csv_table::read(input, COLUMNS)?
        .iter()
        .map(constituent)
        .collect()
}

/// Writes the table.
///
/// # Errors
///
/// What the writer reports.
pub fn write(constituents: &[Constituent], out: impl Write) -> Result<(), CsvError> {
    let rows = constituents.iter().map(|row| {
        let numbers = [
            row.n_min,
            row.n_max,
            row.sigma_a_per_mm,
            row.sigma_s_per_mm,
            row.thickness_min_mm,
            row.thickness_max_mm,
            row.g,
        ];
        let [a, b, c, d, e, f, g] = numbers.map(number_or_blank);
        [row.constituent.clone(), a, b, c, d, e, f, g]
    });
    csv_table::write(out, COLUMNS, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_2_is_blank_where_the_paper_is_and_comes_back() {
        let text = include_bytes!("../../../data/layers.csv");
        let rows = read(text.as_slice()).unwrap();
        let names: Vec<_> = rows.iter().map(|r| r.constituent.as_str()).collect();
        assert_eq!(names, ["epidermis", "dermis", "pigment", "blood"]);
        let pigment = &rows[2];
        assert_eq!((pigment.sigma_a_per_mm, pigment.g), (None, Some(0.79)));
        assert_eq!((rows[3].thickness_min_mm, rows[3].g), (None, Some(0.0)));
        assert_eq!(rows[0].thickness_min_mm, Some(0.001));
        let mut out = Vec::new();
        write(&rows, &mut out).unwrap();
        assert_eq!(read(out.as_slice()).unwrap(), rows);
    }
}

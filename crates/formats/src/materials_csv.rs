//! `materials.csv`: material tables, measured or published.

use crate::csv_table::{
    self, Column, CsvError, Expected, Row, number, number_or_blank, optional, required,
};
use physics::{Material, ReducedMedium};
use std::io::{Read, Write};

const COLUMNS: &[Column; 13] = &[
    required("material"),
    required("channel"),
    optional("wavelength_nm"),
    required("sigma_s_prime_per_mm").or_per_cm("sigma_s_prime_per_cm"),
    optional("u_sigma_s_prime_per_mm").or_per_cm("u_sigma_s_prime_per_cm"),
    required("sigma_a_per_mm").or_per_cm("sigma_a_per_cm"),
    optional("u_sigma_a_per_mm").or_per_cm("u_sigma_a_per_cm"),
    optional("correlation"),
    optional("total_reflectance"),
    required("eta"),
    optional("g"),
    optional("model"),
    optional("source"),
];
const SIGMA_S_PRIME: usize = 3;
const SIGMA_A: usize = 5;
const TOTAL: usize = 8;

/// A row with half a unit in the last printed place of its numbers, by which each may be off
/// for rounding alone: 0.00005 for `0.0030`, 0.5 for `12`.
///
/// A published table carries its precision in its trailing zeros, which an `f64` forgets.
#[derive(Clone, Debug, PartialEq)]
pub struct PrintedMaterial {
    /// The row itself.
    pub material: Material,
    /// Half a unit in the last place of σₐ, mm⁻¹.
    pub half_unit_sigma_a_per_mm: f64,
    /// Half a unit in the last place of σₛ′, mm⁻¹.
    pub half_unit_sigma_s_prime_per_mm: f64,
    /// Half a unit in the last place of the total reflectance, where there is one.
    pub half_unit_total_reflectance: Option<f64>,
}

/// The columns, and whether a table must have them.
pub(crate) fn columns() -> impl Iterator<Item = (&'static str, bool)> {
    COLUMNS.iter().map(|c| (c.name, c.required))
}

/// The rows of a material table.
///
/// The coefficients stand in columns that name their unit, mm⁻¹ or cm⁻¹; a column without one is
/// refused, since the two differ by ten and a number does not tell which it is in. Numbers are checked to be numbers of their kind (finite, uncertainties not negative); whether
/// a medium is possible is for an audit of the table, which wants to see the row.
///
/// # Errors
///
/// [`CsvError`] names line and column of the first fault.
pub fn read(input: impl Read) -> Result<Vec<Material>, CsvError> {
    csv_table::read(input, COLUMNS)?
        .iter()
        .map(material)
        .collect()
}

/// The rows of a material table, with the precision to which they are printed.
///
/// # Errors
///
/// As [`read`].
pub fn read_printed(input: impl Read) -> Result<Vec<PrintedMaterial>, CsvError> {
    let printed = |row: &Row| {
        let total = row.text(TOTAL);
        Ok(PrintedMaterial {
            material: material(row)?,
            half_unit_sigma_a_per_mm: half_unit(row.text(SIGMA_A)) / row.per_unit(SIGMA_A),
            half_unit_sigma_s_prime_per_mm: half_unit(row.text(SIGMA_S_PRIME))
                / row.per_unit(SIGMA_S_PRIME),
            half_unit_total_reflectance: (!total.is_empty()).then(|| half_unit(total)),
        })
    };
    csv_table::read(input, COLUMNS)?
        .iter()
        .map(printed)
        .collect()
}

fn material(row: &Row) -> Result<Material, CsvError> {
    Ok(Material {
        material: row.word(0)?,
        channel: row.word(1)?,
        wavelength_nm: row.number_or_blank(2, Expected::Positive)?,
        medium: ReducedMedium {
            sigma_a: row.number(SIGMA_A, Expected::Finite)?,
            sigma_s_prime: row.number(SIGMA_S_PRIME, Expected::Finite)?,
            eta: row.number(9, Expected::Positive)?,
        },
        u_sigma_s_prime_per_mm: row.number_or_blank(4, Expected::NotNegative)?,
        u_sigma_a_per_mm: row.number_or_blank(6, Expected::NotNegative)?,
        correlation: row.number_or_blank(7, Expected::MinusOneToOne)?,
        total_reflectance: row.number_or_blank(TOTAL, Expected::Finite)?,
        g: row.number_or_blank(10, Expected::MinusOneToOne)?,
        model: row.text(11).to_owned(),
        source: row.text(12).to_owned(),
    })
}

/// Half a unit in the last place of a decimal number as it is written.
fn half_unit(text: &str) -> f64 {
    let (digits, exponent) = match text.split_once(['e', 'E']) {
        Some((digits, exponent)) => (digits, exponent.parse().unwrap_or(0)),
        None => (text, 0),
    };
    let decimals = digits
        .split_once('.')
        .map_or(0, |(_, fraction)| fraction.len());
    let place = exponent - i32::try_from(decimals).unwrap_or(i32::MAX);
    // Read from text: 10^-2 by multiplication is not the f64 next to 0.01.
    format!("5e{}", place.saturating_sub(1))
        .parse()
        .unwrap_or(0.0)
}

/// Writes the table.
///
/// # Errors
///
/// What the writer reports.
pub fn write(materials: &[Material], out: impl Write) -> Result<(), CsvError> {
    let rows = materials.iter().map(|row| {
        [
            row.material.clone(),
            row.channel.clone(),
            number_or_blank(row.wavelength_nm),
            number(row.medium.sigma_s_prime),
            number_or_blank(row.u_sigma_s_prime_per_mm),
            number(row.medium.sigma_a),
            number_or_blank(row.u_sigma_a_per_mm),
            number_or_blank(row.correlation),
            number_or_blank(row.total_reflectance),
            number(row.medium.eta),
            number_or_blank(row.g),
            row.model.clone(),
            row.source.clone(),
        ]
    });
    csv_table::write(out, COLUMNS, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) const JENSEN: &str = include_str!("../../../data/materials.csv");

    #[test]
    fn the_published_table_is_whole() {
        let rows = read(JENSEN.as_bytes()).unwrap();
        assert_eq!(rows.len(), 36);
        assert!(
            rows.iter()
                .all(|r| r.model == "jensen2001" && r.u_sigma_a_per_mm.is_none())
        );
        let marble = rows
            .iter()
            .find(|r| r.material == "Marble" && r.channel == "G")
            .unwrap();
        assert_eq!(
            marble.medium,
            ReducedMedium {
                sigma_a: 0.0041,
                sigma_s_prime: 2.62,
                eta: 1.5
            }
        );
        assert_eq!(marble.total_reflectance, Some(0.79));
        // Sums that a script found in the text of the paper: a digit mistyped anywhere shows.
        let sum = |pick: fn(&Material) -> f64| rows.iter().map(pick).sum::<f64>();
        assert!((sum(|r| r.medium.sigma_s_prime) - 101.52).abs() < 1e-9);
        assert!((sum(|r| r.medium.sigma_a) - 4.231).abs() < 1e-9);
        assert!((sum(|r| r.total_reflectance.unwrap()) - 20.17).abs() < 1e-9);
    }

    #[test]
    fn trailing_zeros_are_precision() {
        let rows = read_printed(JENSEN.as_bytes()).unwrap();
        let row = |name, channel| {
            rows.iter()
                .find(|r| r.material.material == name && r.material.channel == channel)
                .unwrap()
        };
        assert_eq!(row("Apple", "R").half_unit_sigma_a_per_mm, 0.00005);
        assert_eq!(row("Skin2", "G").half_unit_sigma_a_per_mm, 0.0005);
        assert_eq!(row("Spectralon", "R").half_unit_sigma_a_per_mm, 0.005);
        assert_eq!(row("Spectralon", "R").half_unit_sigma_s_prime_per_mm, 0.05);
        assert_eq!(row("Marble", "B").half_unit_total_reflectance, Some(0.005));
        assert_eq!(half_unit("12"), 0.5);
        assert_eq!(half_unit("1.20e-3"), 5e-6);
        assert_eq!(half_unit("1E2"), 50.0);
    }

    #[test]
    fn what_is_written_comes_back() {
        let mut rows = read(JENSEN.as_bytes()).unwrap();
        rows[0].wavelength_nm = Some(632.8);
        rows[0].u_sigma_a_per_mm = Some(1.0 / 3.0);
        rows[0].u_sigma_s_prime_per_mm = Some(1e-7);
        rows[0].correlation = Some(-0.97);
        rows[0].g = Some(0.8);
        rows[1].source = "a \"quoted\", source".to_owned();
        rows[1].total_reflectance = None;
        let mut out = Vec::new();
        write(&rows, &mut out).unwrap();
        assert_eq!(read(out.as_slice()).unwrap(), rows);
        let header = out.split(|b| *b == b'\n').next().unwrap();
        assert_eq!(
            std::str::from_utf8(header).unwrap(),
            "material,channel,wavelength_nm,sigma_s_prime_per_mm,u_sigma_s_prime_per_mm,\
             sigma_a_per_mm,u_sigma_a_per_mm,correlation,total_reflectance,eta,g,model,source"
        );
    }

    #[test]
    fn coefficients_per_centimetre_say_so_in_their_name() {
        let text = "material,channel,sigma_s_prime_per_cm,u_sigma_s_prime_per_mm,sigma_a_per_cm,eta\n\
                    milk,G,10.0,0.1,0.5,1.3\n";
        let printed = read_printed(text.as_bytes()).unwrap().remove(0);
        let row = &printed.material;
        assert_eq!((row.medium.sigma_s_prime, row.medium.sigma_a), (1.0, 0.05));
        assert_eq!(row.u_sigma_s_prime_per_mm, Some(0.1));
        assert_eq!(printed.half_unit_sigma_s_prime_per_mm, 0.005);
        let both = text.replace("u_sigma_s_prime_per_mm", "sigma_s_prime_per_mm");
        let error = read(both.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("occurs twice"), "{error}");
        let wrong = read(text.replace("0.5", "x").as_bytes())
            .unwrap_err()
            .to_string();
        assert!(
            wrong.contains("column `sigma_a_per_cm`: found `x`"),
            "{wrong}"
        );
    }

    #[test]
    fn a_coefficient_without_its_unit_is_refused() {
        let text = "material,channel,sigma_s_prime,sigma_a_per_mm,eta\nmilk,G,1,0.1,1.3\n";
        let error = read(text.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("unknown column `sigma_s_prime`"), "{error}");
        assert!(
            error.contains("did you mean `sigma_s_prime_per_mm`"),
            "{error}"
        );
    }
}

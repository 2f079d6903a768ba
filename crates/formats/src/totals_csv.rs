//! `totals.csv`: the total reflectance of each channel inside a circle.

use crate::csv_table::{self, Column, CsvError, Expected, number, optional, required};
use physics::TotalReflectance;
use std::io::{Read, Write};

const COLUMNS: &[Column; 6] = &[
    required("channel"),
    required("total_reflectance"),
    required("u_total_reflectance"),
    optional("radius_max_mm"),
    required("u_scale_relative"),
    optional("u_offset_per_mm2"),
];

/// The totals of every channel; an empty radius means the whole plane.
///
/// # Errors
///
/// [`CsvError`] names line and column of the first fault.
pub fn read(input: impl Read) -> Result<Vec<TotalReflectance>, CsvError> {
    let mut totals: Vec<TotalReflectance> = Vec::new();
    for row in csv_table::read(input, COLUMNS)? {
        let channel = row.word(0)?;
        if totals.iter().any(|t| t.channel == channel) {
            return Err(CsvError::Repeated {
                line: row.line,
                column: "channel",
                found: channel,
            });
        }
        totals.push(TotalReflectance {
            channel,
            total_reflectance: row.number(1, Expected::Finite)?,
            u_total_reflectance: row.number(2, Expected::NotNegative)?,
            radius_max_mm: row.number_or_blank(3, Expected::Positive)?,
            u_scale_relative: row.number(4, Expected::NotNegative)?,
            u_offset_per_mm2: row
                .number_or_blank(5, Expected::NotNegative)?
                .unwrap_or(0.0),
        });
    }
    Ok(totals)
}

/// Writes the totals one after the other.
///
/// # Errors
///
/// What the writer reports.
pub fn write(totals: &[TotalReflectance], out: impl Write) -> Result<(), CsvError> {
    let rows = totals.iter().map(|total| {
        [
            total.channel.clone(),
            number(total.total_reflectance),
            number(total.u_total_reflectance),
            csv_table::number_or_blank(total.radius_max_mm),
            number(total.u_scale_relative),
            number(total.u_offset_per_mm2),
        ]
    });
    csv_table::write(out, COLUMNS, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_comes_back_and_reads_as_promised() {
        let total = TotalReflectance {
            channel: "G".to_owned(),
            total_reflectance: 0.1 + 0.2,
            u_total_reflectance: 1e-5,
            radius_max_mm: Some(20.48),
            u_scale_relative: 0.005,
            u_offset_per_mm2: 1e-8,
        };
        let whole = TotalReflectance {
            channel: "B".to_owned(),
            radius_max_mm: None,
            ..total.clone()
        };
        let mut out = Vec::new();
        write(&[total.clone(), whole.clone()], &mut out).unwrap();
        assert_eq!(
            String::from_utf8(out.clone()).unwrap(),
            "channel,total_reflectance,u_total_reflectance,radius_max_mm,u_scale_relative,\
             u_offset_per_mm2\n\
             G,0.30000000000000004,1e-5,20.48,0.005,1e-8\n\
             B,0.30000000000000004,1e-5,,0.005,1e-8\n"
        );
        assert_eq!(read(out.as_slice()).unwrap(), [total, whole]);
    }

    #[test]
    fn faults_name_line_and_column() {
        let header = "channel,total_reflectance,u_total_reflectance,radius_max_mm,\
                      u_scale_relative\n";
        let cases = [
            (
                "G,0.8,-1,,0\n",
                "line 2, column `u_total_reflectance`: found `-1`",
            ),
            ("G,0.8,1,0,0\n", "line 2, column `radius_max_mm`: found `0`"),
            (
                "G,0.8,1,,0\nG,0.8,1,,0\n",
                "line 3, column `channel`: `G` was given before",
            ),
            ("", "the table has no rows"),
        ];
        for (rows, expected) in cases {
            let found = read(format!("{header}{rows}").as_bytes())
                .unwrap_err()
                .to_string();
            assert!(found.starts_with(expected), "{rows}{found}");
        }
    }
}

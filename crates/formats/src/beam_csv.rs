//! `beam.csv`: the measured beam of each channel, as shares of its light in rings.

use crate::csv_table::{self, Column, CsvError, Expected, number, required};
use physics::RadialSpread;
use std::io::{Read, Write};

const COLUMNS: &[Column; 4] = &[
    required("channel"),
    required("radius_min_mm"),
    required("radius_max_mm"),
    required("share"),
];

/// The beams by channel, in the order of the file.
///
/// # Errors
///
/// [`CsvError`] names line and column of the first fault: the rings of a channel must follow one
/// another from 0 outward, and hold light.
pub fn read(input: impl Read) -> Result<Vec<(String, RadialSpread)>, CsvError> {
    let mut beams: Vec<(String, Vec<f64>, Vec<f64>)> = vec![];
    let mut last = None;
    for row in csv_table::read(input, COLUMNS)? {
        let channel = row.word(0)?;
        let inner = row.number(1, Expected::NotNegative)?;
        let outer = row.number(2, Expected::Positive)?;
        let share = row.number(3, Expected::NotNegative)?;
        if beams.last().is_none_or(|(name, ..)| *name != channel) {
            if beams.iter().any(|(name, ..)| *name == channel) {
                return Err(CsvError::Repeated {
                    line: row.line,
                    column: "channel",
                    found: channel,
                });
            }
            beams.push((channel, vec![0.0], vec![]));
        }
        if let Some((_, edges, shares)) = beams.last_mut() {
            if edges.last() != Some(&inner) {
                return Err(row.wrong(1, Expected::NotNegative));
            }
            if outer <= inner {
                return Err(row.wrong(2, Expected::Positive));
            }
            edges.push(outer);
            shares.push(share);
        }
        last = Some(row);
    }
    let mut found = vec![];
    for (channel, edges, shares) in beams {
        match (RadialSpread::new(edges, &shares), &last) {
            (Some(spread), _) => found.push((channel, spread)),
            (None, Some(row)) => return Err(row.wrong(3, Expected::Positive)),
            (None, None) => {}
        }
    }
    Ok(found)
}

/// Writes the beams one after the other.
///
/// # Errors
///
/// What the writer reports.
pub fn write<'a>(
    beams: impl IntoIterator<Item = (&'a str, &'a RadialSpread)>,
    out: impl Write,
) -> Result<(), CsvError> {
    let rows = beams.into_iter().flat_map(|(channel, spread)| {
        spread.rings().map(move |(inner, outer, share)| {
            [
                channel.to_owned(),
                number(inner),
                number(outer),
                number(share),
            ]
        })
    });
    csv_table::write(out, COLUMNS, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_comes_back_and_faults_are_named() {
        let spread = RadialSpread::new(vec![0.0, 0.25, 0.5], &[0.75, 0.25]).unwrap();
        let mut out = Vec::new();
        write([("G", &spread), ("B", &spread)], &mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        assert!(
            text.starts_with("channel,radius_min_mm,radius_max_mm,share\nG,0,0.25,0.75\n"),
            "{text}"
        );
        let beams = read(text.as_bytes()).unwrap();
        assert_eq!(
            beams,
            [("G".to_owned(), spread.clone()), ("B".to_owned(), spread)]
        );
        for (from, to, expected) in [
            ("G,0.25,0.5", "G,0.3,0.5", "line 3, column `radius_min_mm`"),
            ("G,0.25,0.5", "G,0.25,0.2", "line 3, column `radius_max_mm`"),
            ("0.75", "-1", "line 2, column `share`"),
            ("B,0,", "G,0,", "line 4, column `radius_min_mm`"),
        ] {
            let error = read(text.replacen(from, to, 1).as_bytes()).unwrap_err();
            assert!(error.to_string().starts_with(expected), "{error}");
        }
    }
}

//! `status.csv`: what became of each capture of a batch.

use crate::csv_table::{self, Column, CsvError, optional, required};
use std::io::Write;

const COLUMNS: &[Column; 5] = &[
    required("capture"),
    required("state"),
    optional("material"),
    optional("verdict"),
    optional("error"),
];

/// What became of one capture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Its name in the batch.
    pub capture: String,
    /// `measured`, `failed` (its input cannot be used) or `fault` (ours, or the machine's).
    pub state: String,
    /// The material, where the manifest could be read.
    pub material: String,
    /// `good`, or the first thing that speaks against a channel; empty where nothing was measured.
    pub verdict: String,
    /// Why nothing was measured, in a sentence; empty where something was.
    pub error: String,
}

/// Writes one row a capture.
///
/// # Errors
///
/// What the writer reports.
pub fn write(captures: &[Status], out: impl Write) -> Result<(), CsvError> {
    let rows = captures.iter().cloned().map(|status| {
        let Status {
            capture,
            state,
            material,
            verdict,
            error,
        } = status;
        [capture, state, material, verdict, error]
    });
    csv_table::write(out, COLUMNS, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_with_commas_and_quotes_stays_one_cell() {
        let row = Status {
            capture: "a".to_owned(),
            state: "failed".to_owned(),
            error: "sample: \"x\", and\nno more".to_owned(),
            ..Status::default()
        };
        let mut out = Vec::new();
        write(&[row], &mut out).unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "capture,state,material,verdict,error\na,failed,,,\"sample: \"\"x\"\", and\nno more\"\n"
        );
    }
}

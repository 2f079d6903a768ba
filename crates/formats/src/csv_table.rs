//! Comma-separated tables with named columns, and errors that name line and column.

use crate::nearest::nearest;
use std::fmt;
use std::io::{Read, Write};
use thiserror::Error;

/// What a cell of a table should hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Expected {
    /// Any finite number.
    Finite,
    /// A finite number of at least 0.
    NotNegative,
    /// A finite number above 0.
    Positive,
    /// A number from -1 to 1.
    MinusOneToOne,
    /// A whole number of at least 0.
    Count,
    /// A word.
    Text,
}

impl fmt::Display for Expected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Finite => "a finite number",
            Self::NotNegative => "a finite number of at least 0",
            Self::Positive => "a finite number above 0",
            Self::MinusOneToOne => "a number from -1 to 1",
            Self::Count => "a whole number of at least 0",
            Self::Text => "a word",
        })
    }
}

impl Expected {
    pub(crate) fn admits(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Self::NotNegative | Self::Count => value >= 0.0,
                Self::Positive => value > 0.0,
                Self::MinusOneToOne => (-1.0..=1.0).contains(&value),
                Self::Finite | Self::Text => true,
            }
    }
}

/// A table cannot be used. Lines count from 1, the header included.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CsvError {
    /// The text is no table, or cannot be read or written.
    #[error("not a readable table; expected comma-separated text in UTF-8")]
    Csv(#[from] csv::Error),
    /// Writing failed.
    #[error("the table cannot be written: {0}")]
    Write(#[from] std::io::Error),
    /// A column that must be there is not.
    #[error("line 1: no column `{column}`; found `{found}`: add the column")]
    MissingColumn {
        /// Name of the column.
        column: &'static str,
        /// The header as it was found.
        found: String,
    },
    /// A column that nobody knows.
    #[error(
        "line 1: unknown column `{column}`{}; known here: {}: rename or remove it",
        nearest.map(|n| format!(", did you mean `{n}`?")).unwrap_or_default(),
        known.join(", ")
    )]
    UnknownColumn {
        /// The name found.
        column: String,
        /// The known name next to it, where one is near.
        nearest: Option<&'static str>,
        /// Every column that is known in this table.
        known: Vec<&'static str>,
    },
    /// One column twice.
    #[error("line 1: column `{0}` occurs twice: remove one")]
    RepeatedColumn(&'static str),
    /// A line with too few or too many cells.
    #[error("line {line}: found {found} cells, expected {expected} as in the header")]
    Cells {
        /// The line.
        line: u64,
        /// Cells found.
        found: usize,
        /// Columns of the header.
        expected: usize,
    },
    /// A cell holds something else than it should.
    #[error("line {line}, column `{column}`: found `{found}`, expected {expected}")]
    Cell {
        /// The line.
        line: u64,
        /// Name of the column.
        column: &'static str,
        /// The cell as it was found.
        found: String,
        /// What it should be.
        expected: Expected,
    },
    /// A header and nothing else.
    #[error("the table has no rows; expected at least one line below the header")]
    Empty,
    /// Radii of a channel do not increase.
    #[error(
        "line {line}, column `radius_mm`: found {found} after {previous} in the same channel; \
         expected increasing radii: sort the rows and merge repeated radii"
    )]
    Order {
        /// The line.
        line: u64,
        /// Radius found, mm.
        found: f64,
        /// Radius before it, mm.
        previous: f64,
    },
    /// The edges of a ring do not hold its radius, or are not in order.
    #[error(
        "line {line}, column `radius_mm`: radius {radius} lies outside its ring, {inner} to \
         {outer}; expected radius_min_mm <= radius_mm <= radius_max_mm and radius_min_mm < \
         radius_max_mm"
    )]
    Ring {
        /// The line.
        line: u64,
        /// Radius found, mm.
        radius: f64,
        /// Inner edge found, mm.
        inner: f64,
        /// Outer edge found, mm.
        outer: f64,
    },
    /// A ring begins inside the one before it, so that some area would count twice.
    #[error(
        "line {line}, column `radius_min_mm`: the ring begins at {inner} inside the ring before \
         it, which ends at {previous_outer}; expected rings that do not overlap"
    )]
    Overlap {
        /// The line.
        line: u64,
        /// Inner edge found, mm.
        inner: f64,
        /// Outer edge of the ring before, mm.
        previous_outer: f64,
    },
    /// A key that must be unique occurs twice.
    #[error("line {line}, column `{column}`: `{found}` was given before: keep one row of it")]
    Repeated {
        /// The line.
        line: u64,
        /// Name of the column.
        column: &'static str,
        /// The value.
        found: String,
    },
}

/// A column that a table may have.
#[derive(Clone, Copy)]
pub(crate) struct Column {
    pub(crate) name: &'static str,
    pub(crate) required: bool,
    /// The name under which it holds cm⁻¹ where `name` holds mm⁻¹.
    pub(crate) per_cm: Option<&'static str>,
}

impl Column {
    /// The same, under another name also in cm⁻¹.
    pub(crate) const fn or_per_cm(self, name: &'static str) -> Self {
        Self {
            per_cm: Some(name),
            ..self
        }
    }
}

/// A column without which a table is of no use.
pub(crate) const fn required(name: &'static str) -> Column {
    Column {
        name,
        required: true,
        per_cm: None,
    }
}

/// A column whose absence has a meaning.
pub(crate) const fn optional(name: &'static str) -> Column {
    Column {
        name,
        required: false,
        per_cm: None,
    }
}

/// One line of a table, its cells by the position of their column in the list of columns.
pub(crate) struct Row {
    pub(crate) line: u64,
    columns: &'static [Column],
    cells: Vec<String>,
    per_cm: Vec<bool>,
}

impl Row {
    /// The cell as text, empty where the table has no such column.
    pub(crate) fn text(&self, column: usize) -> &str {
        &self.cells[column]
    }

    /// The cell as text that must not be empty.
    pub(crate) fn word(&self, column: usize) -> Result<String, CsvError> {
        let text = self.text(column);
        if text.is_empty() {
            return Err(self.wrong(column, Expected::Text));
        }
        Ok(text.to_owned())
    }

    /// The cell as a number.
    pub(crate) fn number(&self, column: usize, expected: Expected) -> Result<f64, CsvError> {
        self.text(column)
            .parse()
            .ok()
            .filter(|value| expected.admits(*value))
            .map(|value: f64| value / self.per_unit(column))
            .ok_or_else(|| self.wrong(column, expected))
    }

    /// How many of the table's units are one of ours: 10 cm⁻¹ are 1 mm⁻¹.
    pub(crate) fn per_unit(&self, column: usize) -> f64 {
        if self.per_cm[column] { 10.0 } else { 1.0 }
    }

    /// The cell as a number, or `None` where it is empty.
    pub(crate) fn number_or_blank(
        &self,
        column: usize,
        expected: Expected,
    ) -> Result<Option<f64>, CsvError> {
        if self.text(column).is_empty() {
            return Ok(None);
        }
        self.number(column, expected).map(Some)
    }

    /// The cell as a count, or `None` where it is empty.
    pub(crate) fn count_or_blank(&self, column: usize) -> Result<Option<u64>, CsvError> {
        if self.text(column).is_empty() {
            return Ok(None);
        }
        let count = self.text(column).parse();
        count
            .map(Some)
            .map_err(|_| self.wrong(column, Expected::Count))
    }

    /// The name of the column as it stands in the table.
    fn name(&self, column: usize) -> &'static str {
        let Column { name, per_cm, .. } = self.columns[column];
        per_cm.filter(|_| self.per_cm[column]).unwrap_or(name)
    }

    /// The error that this cell is not what was expected.
    pub(crate) fn wrong(&self, column: usize, expected: Expected) -> CsvError {
        CsvError::Cell {
            line: self.line,
            column: self.name(column),
            found: self.text(column).to_owned(),
            expected,
        }
    }
}

/// Every line of a table whose header may name `columns` in any order.
pub(crate) fn read(input: impl Read, columns: &'static [Column]) -> Result<Vec<Row>, CsvError> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(input);
    let header = reader.headers()?.clone();
    let mut position = vec![None; columns.len()];
    let mut per_cm = vec![false; columns.len()];
    for (at, name) in header.iter().enumerate() {
        let known = columns
            .iter()
            .position(|c| c.name == name || c.per_cm == Some(name))
            .ok_or_else(|| CsvError::UnknownColumn {
                column: name.to_owned(),
                nearest: nearest(name, columns.iter().map(|c| c.name)),
                known: columns.iter().map(|c| c.name).collect(),
            })?;
        per_cm[known] = columns[known].name != name;
        if position[known].replace(at).is_some() {
            return Err(CsvError::RepeatedColumn(columns[known].name));
        }
    }
    for (column, at) in columns.iter().zip(&position) {
        if column.required && at.is_none() {
            return Err(CsvError::MissingColumn {
                column: column.name,
                found: header.iter().collect::<Vec<_>>().join(","),
            });
        }
    }
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record?;
        let line = record.position().map_or(0, csv::Position::line);
        if record.len() != header.len() {
            return Err(CsvError::Cells {
                line,
                found: record.len(),
                expected: header.len(),
            });
        }
        let cell = |at: &Option<usize>| at.map_or(String::new(), |at| record[at].to_owned());
        rows.push(Row {
            line,
            columns,
            cells: position.iter().map(cell).collect(),
            per_cm: per_cm.clone(),
        });
    }
    if rows.is_empty() {
        Err(CsvError::Empty)
    } else {
        Ok(rows)
    }
}

/// Writes a header and rows, whose cells stand in the order of `columns`.
pub(crate) fn write<const N: usize>(
    out: impl Write,
    columns: &[Column; N],
    rows: impl IntoIterator<Item = [String; N]>,
) -> Result<(), CsvError> {
    let mut writer = csv::Writer::from_writer(out);
    writer.write_record(columns.map(|c| c.name))?;
    for row in rows {
        writer.write_record(row)?;
    }
    writer.flush()?;
    Ok(())
}

/// A number in its shortest form that reads back to the same bits; very small and very large
/// ones with an exponent.
pub(crate) fn number(value: f64) -> String {
    format!("{value:?}").trim_end_matches(".0").to_owned()
}

/// The number, or nothing.
pub(crate) fn number_or_blank(value: Option<f64>) -> String {
    value.map_or(String::new(), number)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: &[Column] = &[required("name"), optional("length_mm")];

    fn message(text: &str) -> String {
        match read(text.as_bytes(), COLUMNS) {
            Ok(rows) => rows[0]
                .number(1, Expected::Positive)
                .unwrap_err()
                .to_string(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn each_fault_is_named_with_its_place() {
        let cases = [
            (
                "length_mm\n1\n",
                "line 1: no column `name`; found `length_mm`: add the column",
            ),
            (
                "name,length_cm\na,1\n",
                "line 1: unknown column `length_cm`, did you mean `length_mm`?; known here: \
                 name, length_mm: rename or remove it",
            ),
            (
                "name,name\na,b\n",
                "line 1: column `name` occurs twice: remove one",
            ),
            (
                "name,length_mm\na\n",
                "line 2: found 1 cells, expected 2 as in the header",
            ),
            (
                "name,length_mm\na,-1\n",
                "line 2, column `length_mm`: found `-1`, expected a finite number above 0",
            ),
            (
                "name,length_mm\na,NaN\n",
                "line 2, column `length_mm`: found `NaN`, expected a finite number above 0",
            ),
            (
                "name\n",
                "the table has no rows; expected at least one line below the header",
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(message(text), expected, "{text}");
        }
    }

    #[test]
    fn columns_stand_in_any_order_and_spaces_do_not_count() {
        let rows = read("length_mm , name\r\n 2.5, a b \r\n".as_bytes(), COLUMNS).unwrap();
        assert_eq!(rows[0].text(0), "a b");
        assert_eq!(rows[0].number(1, Expected::Finite).unwrap(), 2.5);
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_the_first_name() {
        assert!(read("\u{feff}name\na\n".as_bytes(), COLUMNS).is_ok());
    }

    #[test]
    fn numbers_are_short_and_exact() {
        assert_eq!(number(0.1), "0.1");
        assert_eq!(number(3.0), "3");
        assert_eq!(number(-2.5e-9), "-2.5e-9");
        assert_eq!(number(1e300).parse::<f64>().unwrap(), 1e300);
        assert_eq!(number(0.1 + 0.2).parse::<f64>().unwrap(), 0.1 + 0.2);
    }
}

//! `profile.csv`: radial profiles of one or more channels.
//!
//! ```
//! let text = "channel,radius_mm,reflectance_per_mm2,u_reflectance_per_mm2,pixels
//! G,0.5,0.1,0.001,
//! G,1,0.02,0.0005,
//! ";
//! let profiles = formats::profile_csv::read(text.as_bytes())?;
//! assert_eq!(profiles[0].points[1].radius_mm, 1.0);
//! # Ok::<(), formats::CsvError>(())
//! ```

use crate::csv_table::{self, Column, CsvError, Expected, Row, number, optional, required};
use physics::{ProfilePoint, RadialProfile};
use std::io::{Read, Write};

const COLUMNS: &[Column; 7] = &[
    required("channel"),
    optional("radius_min_mm"),
    optional("radius_max_mm"),
    required("radius_mm"),
    required("reflectance_per_mm2"),
    required("u_reflectance_per_mm2"),
    optional("pixels"),
];
const CHANNEL: usize = 0;
const RADIUS_MIN: usize = 1;
const RADIUS_MAX: usize = 2;
const RADIUS: usize = 3;
const REFLECTANCE: usize = 4;
const U_REFLECTANCE: usize = 5;
const PIXELS: usize = 6;

/// Share of a ring's inner edge by which it may lie inside the ring before: rounding of other
/// programs, which write edges with a handful of digits.
const EDGE_ROUNDING: f64 = 1e-6;

/// The profiles of every channel, in the order in which the channels first occur.
///
/// A file without the two edge columns, or with both edges of a row empty, holds values at
/// `radius_mm`.
///
/// # Errors
///
/// [`CsvError`] names line and column of the first fault.
pub fn read(input: impl Read) -> Result<Vec<RadialProfile>, CsvError> {
    let mut profiles: Vec<RadialProfile> = Vec::new();
    for row in csv_table::read(input, COLUMNS)? {
        let channel = row.word(CHANNEL)?;
        let point = point(&row)?;
        match profiles.iter_mut().find(|p| p.channel == channel) {
            Some(profile) => {
                check_follows(&row, profile.points.last(), &point)?;
                profile.points.push(point);
            }
            None => profiles.push(RadialProfile {
                channel,
                points: vec![point],
            }),
        }
    }
    Ok(profiles)
}

fn point(row: &Row) -> Result<ProfilePoint, CsvError> {
    let radius = row.number(RADIUS, Expected::NotNegative)?;
    let ring_mm = if row.text(RADIUS_MIN).is_empty() && row.text(RADIUS_MAX).is_empty() {
        None
    } else {
        let inner = row.number(RADIUS_MIN, Expected::NotNegative)?;
        let outer = row.number(RADIUS_MAX, Expected::Positive)?;
        if !(inner < outer && (inner..=outer).contains(&radius)) {
            return Err(CsvError::Ring {
                line: row.line,
                radius,
                inner,
                outer,
            });
        }
        Some((inner, outer))
    };
    Ok(ProfilePoint {
        ring_mm,
        radius_mm: radius,
        reflectance_per_mm2: row.number(REFLECTANCE, Expected::Finite)?,
        u_reflectance_per_mm2: row.number(U_REFLECTANCE, Expected::NotNegative)?,
        pixels: row.count_or_blank(PIXELS)?,
    })
}

fn check_follows(
    row: &Row,
    previous: Option<&ProfilePoint>,
    point: &ProfilePoint,
) -> Result<(), CsvError> {
    let Some(previous) = previous else {
        return Ok(());
    };
    if point.radius_mm <= previous.radius_mm {
        return Err(CsvError::Order {
            line: row.line,
            found: point.radius_mm,
            previous: previous.radius_mm,
        });
    }
    if let (Some((_, previous_outer)), Some((inner, _))) = (previous.ring_mm, point.ring_mm)
        && inner < previous_outer * (1.0 - EDGE_ROUNDING)
    {
        return Err(CsvError::Overlap {
            line: row.line,
            inner,
            previous_outer,
        });
    }
    Ok(())
}

/// Writes the profiles one after the other.
///
/// # Errors
///
/// What the writer reports.
pub fn write(profiles: &[RadialProfile], out: impl Write) -> Result<(), CsvError> {
    let rows = profiles.iter().flat_map(|profile| {
        profile.points.iter().map(|point| {
            let edge =
                |pick: fn((f64, f64)) -> f64| csv_table::number_or_blank(point.ring_mm.map(pick));
            [
                profile.channel.clone(),
                edge(|ring| ring.0),
                edge(|ring| ring.1),
                number(point.radius_mm),
                number(point.reflectance_per_mm2),
                number(point.u_reflectance_per_mm2),
                point
                    .pixels
                    .map_or(String::new(), |pixels| pixels.to_string()),
            ]
        })
    });
    csv_table::write(out, COLUMNS, rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HEADER: &str = "channel,radius_min_mm,radius_max_mm,radius_mm,reflectance_per_mm2,\
                          u_reflectance_per_mm2,pixels\n";

    fn error(rows: &str) -> String {
        read(format!("{HEADER}{rows}").as_bytes())
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn the_header_is_the_one_that_is_promised() {
        let mut out = Vec::new();
        write(&[], &mut out).unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), HEADER);
    }

    #[test]
    fn faults_name_line_and_column() {
        let cases = [
            (
                "G,0,1,0.6,nan,0.1,3\n",
                "line 2, column `reflectance_per_mm2`: found `nan`",
            ),
            (
                "G,0,1,0.6,1,-0.1,3\n",
                "line 2, column `u_reflectance_per_mm2`: found `-0.1`",
            ),
            (
                "G,0,1,1.6,1,0.1,3\n",
                "line 2, column `radius_mm`: radius 1.6 lies outside",
            ),
            (
                "G,1,1,1,1,0.1,3\n",
                "line 2, column `radius_mm`: radius 1 lies outside",
            ),
            (
                "G,0,,0.6,1,0.1,3\n",
                "line 2, column `radius_max_mm`: found ``",
            ),
            (
                "G,0,1,0.6,1,0.1,-3\n",
                "line 2, column `pixels`: found `-3`",
            ),
            (
                ",0,1,0.6,1,0.1,3\n",
                "line 2, column `channel`: found ``, expected a word",
            ),
            (
                "G,,,2,1,1,\nG,,,1,1,1,\n",
                "line 3, column `radius_mm`: found 1 after 2",
            ),
            (
                "G,,,1,1,1,\nR,,,1,1,1,\nG,,,1,1,1,\n",
                "line 4, column `radius_mm`: found 1 after 1",
            ),
            (
                "G,0,2,1,1,1,\nG,1.5,3,2.5,1,1,\n",
                "line 3, column `radius_min_mm`: the ring begins",
            ),
            ("", "the table has no rows"),
        ];
        for (rows, expected) in cases {
            let found = error(rows);
            assert!(found.starts_with(expected), "{rows}{found}");
        }
    }

    proptest! {
        #[test]
        fn what_is_written_comes_back_bit_for_bit(
            steps in prop::collection::vec((1e-6..1e3_f64, -1e9..1e9_f64, 0.0..1e-3_f64), 1..20),
            with_rings: bool,
        ) {
            let mut radius = 0.0;
            let points = steps.iter().map(|&(step, value, u)| {
                let inner = radius;
                radius += step;
                ProfilePoint {
                    ring_mm: with_rings.then_some((inner, radius)),
                    radius_mm: physics::profile::mean_radius(inner, radius),
                    reflectance_per_mm2: value,
                    u_reflectance_per_mm2: u,
                    pixels: with_rings.then_some(7),
                }
            }).collect::<Vec<_>>();
            let profiles = ["R", "550, narrow"].map(|channel| RadialProfile {
                channel: channel.to_owned(),
                points: points.clone(),
            });
            let mut out = Vec::new();
            write(&profiles, &mut out).unwrap();
            prop_assert_eq!(read(out.as_slice()).unwrap(), profiles);
        }
    }
}

//! Two profiles or two material tables beside each other.

use crate::error::{Blame, Error, Kind, Result};
use crate::files::{Outputs, open, read_text, split};
use formats::{materials_csv, materials_json, profile_csv};
use physics::{Material, ProfilePoint, RadialProfile};
use report::{Chart, Line, Panel, Scale, Stroke, chart_svg};
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Two numbers that should be one.
#[derive(Clone, Debug, Serialize)]
pub struct Pair {
    /// Material and channel, or channel and radius.
    pub of: String,
    /// Of profiles the channel, of tables material and channel.
    pub series: String,
    /// Radius, mm; of profiles.
    pub radius_mm: Option<f64>,
    /// Name of the quantity, with its unit.
    pub quantity: &'static str,
    /// The first and the second.
    pub value: [f64; 2],
    /// First over second, less 1.
    pub relative: f64,
    /// Difference over the root of the sum of the squared uncertainties, where there are some.
    pub z: Option<f64>,
}

/// How far two files are apart.
#[derive(Clone, Debug, Serialize)]
pub struct FileDifference {
    schema_version: u32,
    /// `profiles` or `tables`.
    pub kind: &'static str,
    /// All that both have.
    pub pairs: Vec<Pair>,
    /// What only one has.
    pub unmatched: Vec<String>,
    /// Root of the mean square of the relative differences.
    pub relative_rms: f64,
    /// Mean of z², of pairs that have one.
    pub chi2_per_pair: Option<f64>,
}

/// A difference over its standard uncertainty, where that is known.
pub(crate) fn in_u(difference: f64, u: f64) -> Option<f64> {
    (u > 0.0 && u.is_finite()).then(|| difference / u)
}

fn pair(
    series: String,
    radius_mm: Option<f64>,
    quantity: &'static str,
    a: (f64, f64),
    b: (f64, f64),
) -> Pair {
    Pair {
        of: match radius_mm {
            Some(radius) => at_radius(&series, radius),
            None => series.clone(),
        },
        series,
        radius_mm,
        quantity,
        value: [a.0, b.0],
        relative: a.0 / b.0 - 1.0,
        z: in_u(a.0 - b.0, a.1.hypot(b.1)),
    }
}

fn at_radius(channel: &str, radius_mm: f64) -> String {
    format!("{channel} at {radius_mm} mm")
}

enum Read {
    Profiles(Vec<RadialProfile>),
    Tables(Vec<Material>),
}

fn read(path: &Path) -> Result<Read> {
    if path.extension().is_some_and(|e| e == "json") {
        let rows = materials_json::read(open(path)?).input(path.display())?;
        return Ok(Read::Tables(rows));
    }
    let text = read_text(path)?;
    let head = text.lines().next().unwrap_or_default();
    if head.contains("sigma_s_prime_per_mm") {
        let rows = materials_csv::read(text.as_bytes()).input(path.display())?;
        return Ok(Read::Tables(rows));
    }
    let profiles = profile_csv::read(text.as_bytes()).input(path.display())?;
    Ok(Read::Profiles(profiles))
}

/// Compares two profiles, or two material tables (csv or json).
///
/// Profiles are compared at the radii of the second; where those of the first are others, between
/// its two nearest, on a line in the logarithms.
///
/// # Errors
///
/// A file cannot be read, they are of two kinds, or they have nothing in common.
pub fn compare_files(a: &Path, b: &Path) -> Result<FileDifference> {
    let (kind, pairs, unmatched) = match (read(a)?, read(b)?) {
        (Read::Profiles(first), Read::Profiles(second)) => {
            let (pairs, unmatched) = profiles(&first, &second);
            ("profiles", pairs, unmatched)
        }
        (Read::Tables(first), Read::Tables(second)) => {
            let (pairs, unmatched) = tables(&first, &second);
            ("tables", pairs, unmatched)
        }
        _ => {
            let message = format!(
                "{} and {}: expected two profiles or two material tables, found one of each",
                a.display(),
                b.display()
            );
            return Err(Error::new(Kind::Input, message));
        }
    };
    if pairs.is_empty() {
        let message = format!(
            "{} and {} have nothing in common: {}",
            a.display(),
            b.display(),
            unmatched.join(", ")
        );
        return Err(Error::new(Kind::Input, message));
    }
    let squares: f64 = pairs.iter().map(|p| p.relative * p.relative).sum();
    let known: Vec<f64> = pairs.iter().filter_map(|p| p.z).collect();
    let chi2: f64 = known.iter().map(|z| z * z).sum();
    Ok(FileDifference {
        schema_version: crate::fit_json::SCHEMA_VERSION,
        kind,
        relative_rms: (squares / pairs.len() as f64).sqrt(),
        chi2_per_pair: (!known.is_empty()).then(|| chi2 / known.len() as f64),
        pairs,
        unmatched,
    })
}

/// What is drawn of two: a place, and the value of each there.
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) points: Vec<(f64, [f64; 2])>,
}

/// Values of two and the difference of the first in percent over something, a column of two panels for
/// each series; the differences along `stroke`.
pub(crate) fn beside(title: &str, x: &str, y: &str, series: &[Series], stroke: Stroke) -> Chart {
    let line = |name: &str, stroke, points: Vec<(f64, f64)>| Line {
        name: name.to_owned(),
        points,
        stroke,
    };
    let upper = series.iter().map(|Series { name, points }| Panel {
        title: name.clone(),
        x: x.to_owned(),
        y: y.to_owned(),
        x_range: None,
        scale: Scale::Logarithmic,
        lines: vec![
            line(
                "A",
                Stroke::Dots,
                points.iter().map(|(x, [a, _])| (*x, *a)).collect(),
            ),
            line(
                "B",
                Stroke::Full,
                points.iter().map(|(x, [_, b])| (*x, *b)).collect(),
            ),
        ],
    });
    let lower = series.iter().map(|Series { name, points }| {
        let relative = points.iter().filter(|(_, [_, b])| *b != 0.0);
        let relative = relative.map(|(x, [a, b])| (*x, 100.0 * (a / b - 1.0)));
        Panel {
            title: name.clone(),
            x: x.to_owned(),
            y: "A over B, less 1 (%)".to_owned(),
            x_range: None,
            scale: Scale::LogarithmicAcross,
            lines: vec![line("A over B", stroke, relative.collect())],
        }
    });
    Chart {
        title: title.to_owned(),
        columns: series.len(),
        panels: upper.chain(lower).collect(),
    }
}

impl FileDifference {
    /// Profiles: both and their difference over the radius, by channel. Tables: the first over the
    /// second, coefficient by coefficient, with a line where they agree.
    pub fn chart(&self) -> Chart {
        let mut names: Vec<&str> = vec![];
        let key = |pair: &'_ Pair| match pair.radius_mm {
            Some(_) => pair.series.clone(),
            None => pair.quantity.to_owned(),
        };
        let keys: Vec<String> = self.pairs.iter().map(key).collect();
        for key in &keys {
            if !names.contains(&key.as_str()) {
                names.push(key);
            }
        }
        let of = |name: &&str| {
            let all = self.pairs.iter().zip(&keys);
            let mut points: Vec<(f64, [f64; 2])> = all
                .filter(|(_, key)| key == name)
                .map(|(pair, _)| (pair.radius_mm.unwrap_or(pair.value[1]), pair.value))
                .collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            Series {
                name: (*name).to_owned(),
                points,
            }
        };
        let series: Vec<Series> = names.iter().map(of).collect();
        match self.kind {
            "profiles" => beside(
                "Two profiles",
                "radius (mm)",
                "reflectance (mm⁻²)",
                &series,
                Stroke::Full,
            ),
            // One material has nothing to do with the next.
            _ => beside("Two tables", "B (mm⁻¹)", "mm⁻¹", &series, Stroke::Dots),
        }
    }

    /// Writes [`Self::chart`] to `path`, an SVG.
    ///
    /// # Errors
    ///
    /// The file exists, or cannot be written; the name does not end in `.svg`.
    pub fn draw(&self, path: &Path, inputs: &[PathBuf], force: bool) -> Result<()> {
        let (folder, name) = split(path)?;
        if name.extension().is_none_or(|e| e != "svg") {
            let message = format!(
                "{}: expected a name that ends in .svg, of a plot of two profiles or tables",
                path.display()
            );
            return Err(Error::new(Kind::Usage, message));
        }
        let files = Outputs::new(&folder, [&name], inputs, force)?;
        files.write(&name, |out| {
            Ok(out.write_all(chart_svg(&self.chart()).as_bytes())?)
        })?;
        files.commit()
    }
}

/// Value and uncertainty of a profile at a radius.
fn at(points: &[ProfilePoint], radius: f64) -> Option<(f64, f64)> {
    let of = |p: &ProfilePoint| (p.reflectance_per_mm2, p.u_reflectance_per_mm2);
    let near = |p: &&ProfilePoint| (p.radius_mm - radius).abs() <= 1e-9 * radius.abs();
    if let Some(same) = points.iter().find(near) {
        return Some(of(same));
    }
    let next = points.partition_point(|p| p.radius_mm < radius);
    let (low, high) = (points.get(next.checked_sub(1)?)?, points.get(next)?);
    let along = (radius / low.radius_mm).ln() / (high.radius_mm / low.radius_mm).ln();
    let (a, b) = (of(low), of(high));
    if !(a.0 > 0.0 && b.0 > 0.0 && along.is_finite()) {
        return None;
    }
    let value = a.0.powf(1.0 - along) * b.0.powf(along);
    let relative = ((1.0 - along) * a.1 / a.0).hypot(along * b.1 / b.0);
    Some((value, value * relative))
}

fn profiles(first: &[RadialProfile], second: &[RadialProfile]) -> (Vec<Pair>, Vec<String>) {
    let (mut pairs, mut unmatched) = (vec![], vec![]);
    for profile in second {
        let channel = &profile.channel;
        let Some(other) = first.iter().find(|p| p.channel == *channel) else {
            unmatched.push(format!("channel {channel}"));
            continue;
        };
        for point in &profile.points {
            match at(&other.points, point.radius_mm) {
                Some(a) if point.reflectance_per_mm2 != 0.0 => {
                    let b = (point.reflectance_per_mm2, point.u_reflectance_per_mm2);
                    let radius = Some(point.radius_mm);
                    pairs.push(pair(channel.clone(), radius, "reflectance_per_mm2", a, b));
                }
                _ => unmatched.push(at_radius(channel, point.radius_mm)),
            }
        }
    }
    (pairs, unmatched)
}

fn tables(first: &[Material], second: &[Material]) -> (Vec<Pair>, Vec<String>) {
    let name = |row: &Material| format!("{} {}", row.material, row.channel);
    let same = |a: &&Material, b: &Material| {
        a.material.eq_ignore_ascii_case(&b.material) && a.channel == b.channel
    };
    let (mut pairs, mut unmatched) = (vec![], vec![]);
    for row in second {
        let Some(other) = first.iter().find(|a| same(a, row)) else {
            unmatched.push(name(row));
            continue;
        };
        let (a, b) = (other, row);
        let u = |x: Option<f64>| x.unwrap_or(0.0);
        if b.medium.sigma_a > 0.0 {
            pairs.push(pair(
                name(row),
                None,
                "sigma_a_per_mm",
                (a.medium.sigma_a, u(a.u_sigma_a_per_mm)),
                (b.medium.sigma_a, u(b.u_sigma_a_per_mm)),
            ));
        }
        if b.medium.sigma_s_prime > 0.0 {
            pairs.push(pair(
                name(row),
                None,
                "sigma_s_prime_per_mm",
                (a.medium.sigma_s_prime, u(a.u_sigma_s_prime_per_mm)),
                (b.medium.sigma_s_prime, u(b.u_sigma_s_prime_per_mm)),
            ));
        }
    }
    let missing = first
        .iter()
        .filter(|a| !second.iter().any(|b| same(a, b)))
        .map(name);
    unmatched.extend(missing);
    (pairs, unmatched)
}

//! Charts of lines in panels, for the figures of papers and for what comes of layers.

use crate::axis::Axis;
use crate::figure::STYLE;
use crate::markup::{escaped, svg};
use std::fmt::Write;

/// Width and height of a panel among others, and of one that stands alone.
const SMALL: (f64, f64) = (300.0, 240.0);
const LARGE: (f64, f64) = (620.0, 420.0);
const LEFT: f64 = 74.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 44.0;
const HEADING: f64 = 34.0;
const LEGEND_ROW: f64 = 18.0;

/// Panels in a grid, with one legend for all.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// What it shows.
    pub title: String,
    /// Panels beside one another.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

/// One panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Its own title; may be empty.
    pub title: String,
    /// What the horizontal axis shows, with its unit.
    pub x: String,
    /// What the vertical axis shows, with its unit.
    pub y: String,
    /// Ends of the horizontal axis; the data's where left out.
    pub x_range: Option<(f64, f64)>,
    /// How lengths on the two axes are made.
    pub scale: Scale,
    /// The lines.
    pub lines: Vec<Line>,
}

/// How numbers become lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Both axes linear, the vertical one from 0 where nothing is below.
    Linear,
    /// Both axes linear and a unit as long on the one as on the other: for diagrams of directions.
    Equal,
    /// Both axes logarithmic.
    Logarithmic,
    /// The horizontal axis logarithmic, the vertical one linear with 0 in it.
    LogarithmicAcross,
}

/// A line through points.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Its name in the legend; lines of one name look alike.
    pub name: String,
    /// The points; a gap where one is not finite.
    pub points: Vec<(f64, f64)>,
    /// How it is drawn.
    pub stroke: Stroke,
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stroke {
    /// As a line.
    Full,
    /// Dashed.
    Dashed,
    /// As dots at its points.
    Dots,
}

/// Classes of the colours of lines, by the order of their names.
const TONES: [&str; 6] = ["m0", "m4", "m3", "m7", "m6", "m5"];

/// The chart as an SVG that is complete in itself and follows the reader's choice of light or dark.
pub fn chart_svg(chart: &Chart) -> String {
    let names = names(chart);
    let columns = chart.columns.max(1);
    let rows = chart.panels.len().div_ceil(columns);
    let size = if columns == 1 { LARGE } else { SMALL };
    let width = size.0 * columns as f64;
    let legend = legend(&names, width);
    let top = HEADING + LEGEND_ROW * legend.len() as f64;
    let height = top + size.1 * rows as f64;
    let mut out = String::new();
    let _ = write!(
        out,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" \
         xml:space=\"preserve\" class=\"figure\" role=\"img\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" height=\"{height}\" aria-label=\"{0}\">\n<title>{0}</title>\n\
         <style>\n{STYLE}</style>\n\
         <rect class=\"back\" width=\"{width}\" height=\"{height}\"/>\n\
         <text class=\"heading\" x=\"14\" y=\"22\">{0}</text>\n",
        escaped(&chart.title)
    );
    for (row, entries) in legend.iter().enumerate() {
        let y = HEADING + LEGEND_ROW * (row as f64 + 0.5);
        for &(x, k) in entries {
            let (name, stroke) = names[k];
            let _ = writeln!(
                out,
                "<g transform=\"translate({x:.1} {y})\">{}<text class=\"quiet\" x=\"26\" \
                 y=\"4\">{}</text></g>",
                sample(k, stroke),
                svg(name)
            );
        }
    }
    for (k, panel) in chart.panels.iter().enumerate() {
        let at = (
            size.0 * (k % columns) as f64,
            top + size.1 * (k / columns) as f64,
        );
        draw(&mut out, panel, at, size, &names);
    }
    out.push_str("</svg>\n");
    out
}

/// Every name of a line, in the order of their first occurrence.
fn names(chart: &Chart) -> Vec<(&str, Stroke)> {
    let mut names: Vec<(&str, Stroke)> = vec![];
    for line in chart.panels.iter().flat_map(|panel| &panel.lines) {
        if !names.iter().any(|(name, _)| *name == line.name) {
            names.push((&line.name, line.stroke));
        }
    }
    names
}

/// Rows of entries: place and number of each name. Text cannot be measured here, so that each
/// character gets a generous width.
fn legend(names: &[(&str, Stroke)], width: f64) -> Vec<Vec<(f64, usize)>> {
    let mut rows: Vec<Vec<(f64, usize)>> = vec![];
    let mut x = f64::INFINITY;
    for (k, (name, _)) in names.iter().enumerate() {
        let wide = 46.0 + 6.6 * name.chars().count() as f64;
        if x + wide > width {
            rows.push(vec![]);
            x = 14.0;
        }
        if let Some(row) = rows.last_mut() {
            row.push((x, k));
        }
        x += wide;
    }
    rows
}

fn sample(k: usize, stroke: Stroke) -> String {
    let tone = TONES[k % TONES.len()];
    match stroke {
        Stroke::Full => format!("<path class=\"curve {tone}\" d=\"M0 0h20\"/>"),
        Stroke::Dashed => format!("<path class=\"curve beyond {tone}\" d=\"M0 0h20\"/>"),
        Stroke::Dots => format!("<path class=\"dot {tone}\" d=\"M10 0h0\"/>"),
    }
}

fn draw(
    out: &mut String,
    panel: &Panel,
    (left, top): (f64, f64),
    (width, height): (f64, f64),
    names: &[(&str, Stroke)],
) {
    let (from, to) = (left + LEFT, left + width - RIGHT);
    let (upper, lower) = (top + TOP, top + height - BOTTOM);
    let (x, y) = axes(panel, (from, to), (lower, upper));
    let (mut grid, mut labels) = (String::new(), String::new());
    for tick in x.ticks() {
        if let Some(label) = tick.label {
            let _ = write!(grid, "M{:.2} {upper}V{lower}", tick.at_px);
            let _ = writeln!(
                labels,
                "<text class=\"middle quiet\" x=\"{:.2}\" y=\"{}\">{}</text>",
                tick.at_px,
                lower + 16.0,
                svg(&label)
            );
        }
    }
    for tick in y.ticks() {
        if let Some(label) = tick.label {
            let _ = write!(grid, "M{from} {:.2}H{to}", tick.at_px);
            let _ = writeln!(
                labels,
                "<text class=\"end quiet\" x=\"{}\" y=\"{:.2}\">{}</text>",
                from - 6.0,
                tick.at_px + 4.0,
                svg(&label)
            );
        }
    }
    let _ = write!(
        out,
        "<path class=\"grid\" d=\"{grid}\"/>\n{labels}<path class=\"frame\" \
         d=\"M{from} {upper}H{to}V{lower}H{from}Z\"/>\n\
         <text class=\"middle quiet\" x=\"{0:.1}\" y=\"{1}\">{2}</text>\n\
         <text class=\"middle quiet\" x=\"{0:.1}\" y=\"{3}\">{4}</text>\n\
         <text class=\"middle quiet\" transform=\"translate({5} {6}) rotate(-90)\">{7}</text>\n",
        0.5 * (from + to),
        upper - 8.0,
        svg(&panel.title),
        lower + 33.0,
        svg(&panel.x),
        left + 14.0,
        0.5 * (upper + lower),
        svg(&panel.y),
    );
    // An inner svg cuts what leaves the panel.
    let _ = writeln!(
        out,
        "<svg x=\"{from}\" y=\"{upper}\" width=\"{0}\" height=\"{1}\" viewBox=\"{from} {upper} {0} \
         {1}\" overflow=\"hidden\">",
        to - from,
        lower - upper
    );
    for line in &panel.lines {
        let k = names.iter().position(|(name, _)| *name == line.name);
        let tone = TONES[k.unwrap_or(0) % TONES.len()];
        let mut path = String::new();
        let mut pen = 'M';
        for &(px, py) in &line.points {
            let Some((px, py)) = x.place(px).zip(y.place(py)) else {
                pen = 'M';
                continue;
            };
            if line.stroke == Stroke::Dots {
                let _ = writeln!(out, "<path class=\"dot {tone}\" d=\"M{px:.2} {py:.2}h0\"/>");
            } else {
                let _ = write!(path, "{pen}{px:.2} {py:.2}");
                pen = 'L';
            }
        }
        let dash = if line.stroke == Stroke::Dashed {
            " beyond"
        } else {
            ""
        };
        if !path.is_empty() {
            let _ = writeln!(out, "<path class=\"curve{dash} {tone}\" d=\"{path}\"/>");
        }
    }
    out.push_str("</svg>\n");
}

fn axes(panel: &Panel, across: (f64, f64), up: (f64, f64)) -> (Axis, Axis) {
    let points = || panel.lines.iter().flat_map(|l| &l.points);
    let finite = |v: &f64| v.is_finite();
    let xs: Vec<f64> = points().map(|p| p.0).filter(finite).collect();
    let ys: Vec<f64> = points().map(|p| p.1).filter(finite).collect();
    let extent = |values: &[f64]| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if low < high { (low, high) } else { (0.0, 1.0) }
    };
    if matches!(panel.scale, Scale::Logarithmic | Scale::LogarithmicAcross) {
        let x = match panel.x_range {
            Some((low, high)) => Axis::logarithmic([low, high], across),
            None => Axis::logarithmic(xs, across),
        };
        let y = if panel.scale == Scale::Logarithmic {
            Axis::logarithmic(ys, up)
        } else {
            let low = ys.iter().copied().fold(0.0, f64::min);
            let high = ys.iter().copied().fold(0.0, f64::max);
            let margin = if low < high { 0.05 * (high - low) } else { 1.0 };
            Axis::linear((low - margin, high + margin), up)
        };
        return (x, y);
    }
    let (mut x, mut y) = (panel.x_range.unwrap_or(extent(&xs)), extent(&ys));
    if y.0 >= 0.0 {
        y.0 = 0.0;
    }
    let margin = 0.05 * (y.1 - y.0);
    y = (if y.0 == 0.0 { 0.0 } else { y.0 - margin }, y.1 + margin);
    if panel.scale == Scale::Equal {
        let (wide, high) = ((across.1 - across.0).abs(), (up.1 - up.0).abs());
        let unit = ((x.1 - x.0) / wide).max((y.1 - y.0) / high) * 1.05;
        let middle = 0.5 * (x.0 + x.1);
        x = (middle - 0.5 * wide * unit, middle + 0.5 * wide * unit);
        let middle = if y.0 == 0.0 {
            0.5 * high * unit
        } else {
            0.5 * (y.0 + y.1)
        };
        y = (middle - 0.5 * high * unit, middle + 0.5 * high * unit);
    }
    (Axis::linear(x, across), Axis::linear(y, up))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(scale: Scale) -> Chart {
        let line = |name: &str, stroke, factor: f64| Line {
            name: name.to_owned(),
            points: (1..=10)
                .map(|i| (f64::from(i), factor * f64::from(i * i)))
                .chain([(11.0, f64::NAN)])
                .collect(),
            stroke,
        };
        Chart {
            title: "squares <&>".to_owned(),
            columns: 2,
            panels: vec![
                Panel {
                    title: "one".to_owned(),
                    x: "x (mm)".to_owned(),
                    y: "y".to_owned(),
                    x_range: None,
                    scale,
                    lines: vec![
                        line("full", Stroke::Full, 1.0),
                        line("dots", Stroke::Dots, 2.0),
                        line("dashed", Stroke::Dashed, 0.5),
                    ],
                };
                3
            ],
        }
    }

    #[test]
    fn is_xml_with_every_line_and_one_legend() {
        for scale in [
            Scale::Linear,
            Scale::Equal,
            Scale::Logarithmic,
            Scale::LogarithmicAcross,
        ] {
            let text = chart_svg(&chart(scale));
            let document = roxmltree::Document::parse(&text).unwrap();
            let count = |class: &str| {
                let has = |n: &roxmltree::Node<'_, '_>| {
                    n.has_tag_name("path")
                        && n.attribute("class").is_some_and(|c| c.contains(class))
                };
                document.descendants().filter(has).count()
            };
            // Two paths a panel and two in the legend; ten dots a panel and one in the legend.
            assert_eq!(count("curve"), 3 * 2 + 2, "{scale:?}");
            assert_eq!(count("dot"), 3 * 10 + 1, "{scale:?}");
            assert!(!text.contains("NaN"), "{scale:?}");
        }
    }

    #[test]
    fn equal_scales_are_equal() {
        let panel = &chart(Scale::Equal).panels[0];
        let (x, y) = axes(panel, (0.0, 200.0), (100.0, 0.0));
        let length = |a: Axis, u: f64, v: f64| (a.place(v).unwrap() - a.place(u).unwrap()).abs();
        assert!((length(x, 2.0, 3.0) - length(y, 2.0, 3.0)).abs() < 1e-9);
    }
}

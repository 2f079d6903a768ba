//! The figure of one channel: profile and fit above, residuals below, over one axis of radius.

pub(crate) mod comparison;

use crate::axis::Axis;
use crate::channel::{ChannelReport, CurvePoint};
use crate::markup::{escaped, svg};
use crate::number::{exact, fixed, significant, uncertain};
use fit::Fit;
use physics::ProfilePoint;
use std::fmt::Write;

/// Colours of the figure on white and on dark ground. Plain classes, since programs that place an
/// SVG in a document rarely know CSS variables.
pub(crate) const STYLE: &str = include_str!("figure.css");

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 598.0;
const LEFT: f64 = 80.0;
const RIGHT: f64 = 704.0;
/// Top and bottom of the panel of the profile.
const PROFILE: (f64, f64) = (76.0, 396.0);
/// Top and bottom of the panel of the residuals.
const RESIDUALS: (f64, f64) = (410.0, 544.0);
/// A curve may be this far from the corners of its line: nothing that an eye sees.
const FLAT: f64 = 0.04;

/// The arrow that stands for a value too low to show, from its tail down; and its length.
const ARROW_PATH: &str = "v9m-2.2 -3.2l2.2 3.2l2.2 -3.2";
const ARROW: f64 = 9.0;
/// Lines at 1 u and 2 u nearer to each other than this would be one thick line.
const LEAST_STEP: f64 = 3.0;
/// Residuals within this many u share one scale, so that good fits look alike.
const LEAST_RESIDUAL_SPAN: f64 = 3.5;

/// An SVG of `channel`: its profile with error bars, the model, and the residuals in units of u.
///
/// Both axes of the upper panel are logarithmic. A point that such an axis cannot hold, being at
/// or below 0 or under the panel's edge, is drawn as an arrow down from its value + 2 u. What took part
/// in the fit is filled and stands on a shaded ground; the model is dashed elsewhere. What transport and
/// photons make of the same medium lies beside the model.
///
/// The file is complete in itself, and follows the reader's choice of light or dark.
pub fn figure_svg(material: &str, channel: &ChannelReport) -> String {
    let drawing = drawing(material, channel, STYLE, true);
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{drawing}")
}

/// The same for a page that brings the style itself: `style` is what the element starts with.
/// `spoken`: whether a point says its numbers to the pointer.
pub(crate) fn drawing(
    material: &str,
    channel: &ChannelReport,
    style: &str,
    spoken: bool,
) -> String {
    let heading = format!("{material} · {}", channel.name());
    let mut out = String::new();
    // Without xml:space some viewers drop the spaces beside raised and lowered letters.
    let _ = write!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" xml:space=\"preserve\" class=\"figure\" role=\"img\" \
         viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" \
         aria-label=\"{0}: radial profile, fit and residuals\">\n\
         <title>{0}: radial profile, fit and residuals</title>\n",
        escaped(&heading)
    );
    if !style.is_empty() {
        let _ = write!(out, "<style>\n{style}</style>\n");
    }
    let _ = writeln!(
        out,
        "<rect class=\"back\" width=\"{WIDTH}\" height=\"{HEIGHT}\"/>"
    );
    let _ = writeln!(
        out,
        "<text class=\"heading\" x=\"{LEFT}\" y=\"24\">{}</text>",
        escaped(&heading)
    );

    let plot = Plot::new(channel, spoken);
    plot.ground(&mut out, PROFILE, &plot.reflectance, false);
    scaled(&mut out, PROFILE, |out| {
        plot.points(out);
        plot.model(out);
    });
    plot.legend(&mut out);
    plot.annotation(&mut out);
    plot.ground(&mut out, RESIDUALS, &plot.residual, true);
    scaled(&mut out, RESIDUALS, |out| plot.residuals(out));
    for (label, (top, bottom)) in [
        ("diffuse reflectance Rᵈ (mm⁻²)", PROFILE),
        ("residual / u", RESIDUALS),
    ] {
        let middle = 0.5 * (top + bottom);
        let _ = writeln!(
            out,
            "<text class=\"middle\" transform=\"translate(18 {middle}) rotate(-90)\">{}</text>",
            svg(label)
        );
    }
    let _ = writeln!(
        out,
        "<text class=\"middle\" x=\"{}\" y=\"{}\">distance from the beam r (mm)</text>\n</svg>",
        0.5 * (LEFT + RIGHT),
        HEIGHT - 12.0
    );
    out
}

/// One channel on its axes.
struct Plot<'a> {
    channel: &'a ChannelReport<'a>,
    radius: Axis,
    reflectance: Axis,
    residual: Axis,
    /// Radius of a marker.
    marker: f64,
    /// Whether a marker says its numbers to the pointer.
    spoken: bool,
}

/// How a point of the profile is drawn.
#[derive(Clone, Copy, PartialEq)]
enum Mark {
    Used,
    LeftOut,
    /// The panel cannot hold the value.
    Arrow,
}

impl<'a> Plot<'a> {
    fn new(channel: &'a ChannelReport<'a>, spoken: bool) -> Self {
        let points = &channel.profile.points;
        let radius = Axis::logarithmic(points.iter().map(|p| p.radius_mm), (LEFT, RIGHT));
        // What does not stand out of its noise must not stretch the axis by decades. Neither must
        // the model, which falls for ever.
        let clear = |p: &&ProfilePoint| p.reflectance_per_mm2 > 2.0 * p.u_reflectance_per_mm2;
        let anything = points.iter().any(|p| clear(&p));
        let values = points
            .iter()
            .filter(|p| !anything || clear(p))
            .flat_map(|p| [p.reflectance_per_mm2, 0.5 * p.reflectance_per_mm2]);
        let reflectance = Axis::logarithmic(values, (PROFILE.1, PROFILE.0));
        let largest = residuals(channel.fit)
            .map(|(_, z)| z.abs())
            .fold(0.0, f64::max);
        let residual = Axis::symmetric(
            (1.1 * largest).max(LEAST_RESIDUAL_SPAN),
            (RESIDUALS.1, RESIDUALS.0),
        );
        let marker = (0.42 * (RIGHT - LEFT) / points.len().max(1) as f64).clamp(1.4, 2.8);
        Self {
            channel,
            radius,
            reflectance,
            residual,
            marker,
            spoken,
        }
    }

    /// Left and right end of the fitted range.
    fn range(&self) -> (f64, f64) {
        let (start, end) = self.channel.fit.range_mm;
        let start = self.radius.place_inside(start);
        (start, self.radius.place_inside(end).max(start))
    }

    /// Shaded range, grid, ticks, tick labels and frame of a panel.
    fn ground(
        &self,
        out: &mut String,
        (top, bottom): (f64, f64),
        axis: &Axis,
        radius_labels: bool,
    ) {
        let (start, end) = self.range();
        scaled(out, (top, bottom), |out| {
            let _ = writeln!(
                out,
                "<rect class=\"range\" x=\"{start:.2}\" y=\"{top}\" width=\"{:.2}\" height=\"{}\"/>",
                end - start,
                bottom - top
            );
        });
        let (mut grid, mut ticks, mut labels) = (String::new(), String::new(), String::new());
        for tick in self.radius.ticks() {
            let x = tick.at_px;
            let length = if tick.label.is_some() { 6 } else { 3 };
            let _ = write!(ticks, "M{x:.2} {bottom}v-{length}M{x:.2} {top}v{length}");
            if let Some(label) = tick.label {
                let _ = write!(grid, "M{x:.2} {top}V{bottom}");
                if radius_labels {
                    let y = bottom + 18.0;
                    let _ = writeln!(
                        labels,
                        "<text class=\"middle\" x=\"{x:.2}\" y=\"{y}\">{}</text>",
                        svg(&label)
                    );
                }
            }
        }
        for tick in axis.ticks() {
            let y = tick.at_px;
            let length = if tick.label.is_some() { 6 } else { 3 };
            let _ = write!(ticks, "M{LEFT} {y:.2}h{length}M{RIGHT} {y:.2}h-{length}");
            if let Some(label) = tick.label {
                let _ = write!(grid, "M{LEFT} {y:.2}H{RIGHT}");
                let _ = writeln!(
                    labels,
                    "<text class=\"end\" x=\"{}\" y=\"{:.2}\">{}</text>",
                    LEFT - 8.0,
                    y + 4.5,
                    svg(&label)
                );
            }
        }
        let below = if radius_labels {
            " data-below=\"\""
        } else {
            ""
        };
        let _ = write!(
            out,
            "<g class=\"axes\" data-panel=\"{LEFT} {top} {} {}\" data-x=\"{}\" \
             data-y=\"{}\"{below}>\n<path class=\"grid\" d=\"{grid}\"/>\n<path class=\"frame\" \
             d=\"{ticks}M{LEFT} {top}H{RIGHT}V{bottom}H{LEFT}Z\"/>\n{labels}</g>\n",
            RIGHT - LEFT,
            bottom - top,
            self.radius.data(),
            axis.data()
        );
    }

    fn mark(&self, point: &ProfilePoint) -> Mark {
        let floor = PROFILE.1 - self.marker;
        if self
            .reflectance
            .place(point.reflectance_per_mm2)
            .is_none_or(|y| y > floor)
        {
            Mark::Arrow
        } else if self
            .channel
            .fit
            .residuals
            .iter()
            .any(|r| r.radius_mm == point.radius_mm)
        {
            Mark::Used
        } else {
            Mark::LeftOut
        }
    }

    /// The points that have a place on the axis of radius, with that place.
    fn placed(&self) -> impl Iterator<Item = (f64, &ProfilePoint)> {
        self.channel.profile.points.iter().filter_map(|p| {
            let usable = p.reflectance_per_mm2.is_finite() && p.u_reflectance_per_mm2.is_finite();
            self.radius
                .place(p.radius_mm)
                .filter(|_| usable)
                .map(|x| (x, p))
        })
    }

    fn points(&self, out: &mut String) {
        let color = self.channel.color_class();
        let (mut bars, mut arrows) = (String::new(), String::new());
        let (mut used, mut left_out) = (String::new(), String::new());
        let floor = PROFILE.1;
        for (x, point) in self.placed() {
            let (value, u) = (point.reflectance_per_mm2, point.u_reflectance_per_mm2);
            let mark = self.mark(point);
            if mark == Mark::Arrow {
                let y = self
                    .reflectance
                    .place_inside(value + 2.0 * u)
                    .min(floor - ARROW - 1.0);
                let half = self.marker + 0.5;
                // Each a path of its own: enlarging moves them and leaves their size.
                let _ = writeln!(
                    arrows,
                    "<path d=\"M{x:.2} {y:.2}m-{half:.2} 0h{:.2}m-{half:.2} 0{ARROW_PATH}\"/>",
                    2.0 * half
                );
                continue;
            }
            let top = self.reflectance.place_inside(value + u);
            let bottom = self.reflectance.place_inside(value - u);
            let y = self.reflectance.place_inside(value);
            // Bars inside their marker would only thicken it.
            if bottom - top > 2.0 * self.marker {
                let _ = write!(bars, "M{x:.2} {top:.2}V{bottom:.2}");
            }
            let marks = if mark == Mark::Used {
                &mut used
            } else {
                &mut left_out
            };
            self.mark_at(marks, (x, y), point.radius_mm, &uncertain(value, u), "mm⁻²");
        }
        let _ = write!(
            out,
            "<path class=\"{color} bar\" d=\"{bars}\"/>\n<g class=\"{color} bar \
             arrows\">\n{arrows}</g>\n{}{}",
            self.marks(&left_out, true),
            self.marks(&used, false)
        );
    }

    /// A line through the points that have a place on both axes.
    fn line(&self, points: &[CurvePoint]) -> String {
        line(points.iter().map(|point| {
            let x = self.radius.place(point.radius_mm);
            x.zip(self.reflectance.place(point.reflectance_per_mm2))
        }))
    }

    /// What the coefficients' u leaves open of the model.
    fn band(&self) -> String {
        let curve = &self.channel.model_curve;
        let edge = |sign: f64| -> Vec<CurvePoint> {
            let points = curve.iter().zip(&self.channel.u_model_per_mm2);
            points
                .map(|(p, u)| CurvePoint {
                    // Where an edge has no logarithm it goes down with the panel.
                    reflectance_per_mm2: (p.reflectance_per_mm2 + sign * u)
                        .max(1e-6 * p.reflectance_per_mm2),
                    ..*p
                })
                .collect()
        };
        let (upper, mut lower) = (edge(1.0), edge(-1.0));
        lower.reverse();
        let path = self.line(&[upper, lower].concat());
        if path.matches('M').count() == 1 {
            path + "Z"
        } else {
            String::new()
        }
    }

    /// The model, full inside the range and dashed outside, transport and the photons.
    fn model(&self, out: &mut String) {
        let curve = &self.channel.model_curve;
        // What lies between two places, and the corners that lead there.
        let part = |low: f64, high: f64| {
            let inside = |p: &CurvePoint| {
                let x = self.radius.place(p.radius_mm);
                x.is_some_and(|x| (low..=high).contains(&x))
            };
            let ends = curve
                .iter()
                .position(inside)
                .zip(curve.iter().rposition(inside));
            ends.map_or(String::new(), |(first, last)| {
                self.line(&curve[first.saturating_sub(1)..(last + 2).min(curve.len())])
            })
        };
        let band = self.band();
        let transport = self.line(&self.channel.transport);
        let (start, end) = self.range();
        let (top, bottom) = PROFILE;
        let photons = self.line(&self.channel.monte_carlo);
        for (from, to, class, path) in [
            (LEFT, RIGHT, "band", &band),
            (LEFT, start, "model beyond", &part(LEFT, start)),
            (start, end, "model", &part(start, end)),
            (end, RIGHT, "model beyond", &part(end, RIGHT)),
            (LEFT, RIGHT, "photons", &photons),
            (LEFT, RIGHT, "transport", &transport),
        ] {
            cut(out, (from, to), (top, bottom), class, path);
        }
    }

    /// What each mark means, for the marks that occur, in a line above the panel.
    fn legend(&self, out: &mut String) {
        const ROWS: [f64; 2] = [42.0, 62.0];
        let color = self.channel.color_class();
        let has = |mark| self.placed().any(|(_, p)| self.mark(p) == mark);
        let fitted = !self.channel.fit.residuals.is_empty();
        let circle =
            |class: &str| format!("<circle class=\"{class}\" cx=\"8\" cy=\"0\" r=\"2.8\"/>");
        let entries = [
            (has(Mark::Used), circle(color), "fitted ± u"),
            (
                has(Mark::LeftOut),
                circle(&format!("{color} out")),
                "left out",
            ),
            (
                has(Mark::Arrow),
                format!("<path class=\"{color} bar\" d=\"M5 -4.5h6m-3 0{ARROW_PATH}\"/>"),
                "too low: value + 2 u",
            ),
            (
                fitted,
                "<rect class=\"range\" y=\"-6\" width=\"16\" height=\"12\"/><rect \
                 class=\"level\" y=\"-6\" width=\"16\" height=\"12\"/>"
                    .to_owned(),
                "fitted range",
            ),
        ];
        let banded = !self.channel.u_model_per_mm2.is_empty();
        let lines = [
            (
                !self.channel.model_curve.is_empty(),
                if banded {
                    "<rect class=\"band\" y=\"-5\" width=\"16\" height=\"10\"/><path \
                     class=\"model\" d=\"M0 0h16\"/>"
                } else {
                    "<path class=\"model\" d=\"M0 0h16\"/>"
                }
                .to_owned(),
                if banded { "model ± u" } else { "model" },
            ),
            (
                !self.channel.transport.is_empty(),
                "<path class=\"transport\" d=\"M-2 0h20\"/>".to_owned(),
                "its medium by transport",
            ),
            (
                !self.channel.monte_carlo.is_empty(),
                "<path class=\"photons\" d=\"M0 0h16\"/>".to_owned(),
                "by counted photons (Monte Carlo)",
            ),
        ];
        for (y, row) in ROWS.into_iter().zip([&entries[..], &lines[..]]) {
            let mut x = LEFT;
            for (_, sign, text) in row.iter().filter(|(occurs, ..)| *occurs) {
                let _ = writeln!(
                    out,
                    "<g transform=\"translate({x:.2} {y})\">{sign}<text class=\"quiet\" x=\"22\" \
                     y=\"4\">{}</text></g>",
                    svg(text)
                );
                // Text cannot be measured here: a generous width for each of its characters.
                x += 40.0 + 6.6 * text.chars().count() as f64;
            }
        }
    }

    /// The numbers, in the corner that a falling curve leaves free.
    fn annotation(&self, out: &mut String) {
        let channel = self.channel;
        let fit = channel.fit;
        let relation = if fit.upper_limit.is_some() { "" } else { "= " };
        let mut lines = vec![
            format!("σₛ′ = {} mm⁻¹", channel.sigma_s_prime()),
            format!("σₐ {relation}{} mm⁻¹", channel.sigma_a()),
            format!(
                "reduced χ² = {}, {} points",
                shown_chi2(fit.reduced_chi2),
                fit.residuals.len()
            ),
        ];
        if let Some(truth) = channel.truth {
            lines.push(format!(
                "true: σₛ′ = {}, σₐ = {} mm⁻¹",
                exact(truth.sigma_s_prime),
                exact(truth.sigma_a)
            ));
        }
        let first = PROFILE.1 - 14.0 - 19.0 * (lines.len() - 1) as f64;
        for (i, line) in lines.iter().enumerate() {
            let _ = writeln!(
                out,
                "<text class=\"halo\" x=\"{}\" y=\"{:.2}\">{}</text>",
                LEFT + 14.0,
                first + 19.0 * i as f64,
                svg(line)
            );
        }
    }

    fn residuals(&self, out: &mut String) {
        let mut levels = String::new();
        let step = self.residual.place_inside(0.0) - self.residual.place_inside(1.0);
        for (z, class) in [(0.0, "level"), (1.0, "level dashed"), (2.0, "level dashed")] {
            if z > 0.0 && step < LEAST_STEP {
                continue;
            }
            for z in if z == 0.0 { vec![z] } else { vec![-z, z] } {
                let y = self.residual.place_inside(z);
                let _ = writeln!(
                    levels,
                    "<path class=\"{class}\" d=\"M{LEFT} {y:.2}H{RIGHT}\"/>"
                );
            }
        }
        let mut marks = String::new();
        for (radius, z) in residuals(self.channel.fit) {
            if let Some((x, y)) = self.radius.place(radius).zip(self.residual.place(z)) {
                self.mark_at(&mut marks, (x, y), radius, &format!("{z:+.2}"), "u");
            }
        }
        let _ = write!(out, "{levels}{}", self.marks(&marks, false));
        let path = self.transport_residuals();
        cut(out, (LEFT, RIGHT), RESIDUALS, "transport", &path);
    }

    /// (transport − model)/u at the fitted points: where data that are right would lie if the model is
    /// wrong.
    fn transport_residuals(&self) -> String {
        let ratios = self.channel.transport.iter().zip(&self.channel.model_curve);
        let ratios: Vec<(f64, f64)> = ratios
            .map(|(t, m)| (m.radius_mm, t.reflectance_per_mm2 / m.reflectance_per_mm2))
            .collect();
        line(self.channel.fit.residuals.iter().map(|r| {
            let found = ratios.iter().find(|(radius, _)| *radius == r.radius_mm);
            let z = found.map(|(_, ratio)| (ratio - 1.0) * r.model_per_mm2 / r.u_per_mm2);
            let x = self.radius.place(r.radius_mm);
            x.zip(z.and_then(|z| self.residual.place(z)))
        }))
    }

    /// A marker, and what it stands for, which a browser shows where the pointer rests.
    fn mark_at(&self, out: &mut String, (x, y): (f64, f64), radius: f64, number: &str, unit: &str) {
        if !self.spoken {
            let _ = write!(out, "M{x:.2} {y:.2}h0");
            return;
        }
        let _ = writeln!(
            out,
            "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{:.2}\"><title>r = {} mm: {} \
             {unit}</title></circle>",
            self.marker,
            significant(radius, 4),
            escaped(number)
        );
    }

    /// Markers in the colour of the channel, hollow where they are of what was left out. Silent ones
    /// are the round ends of lines without length.
    fn marks(&self, marks: &str, hollow: bool) -> String {
        let color = self.channel.color_class();
        let out = if hollow { " out" } else { "" };
        if self.spoken {
            return format!("<g class=\"{color}{out}\">\n{marks}</g>\n");
        }
        let dots = |class: &str, width: f64| {
            format!("<path class=\"{class} marks\" stroke-width=\"{width:.2}\" d=\"{marks}\"/>\n")
        };
        let mut found = dots(color, 2.0 * self.marker + 1.0);
        if hollow && !marks.is_empty() {
            found += &dots("hole", 2.0 * self.marker - 1.0);
        }
        found
    }
}

/// A line through the places that are there, without the corners that lie on it.
fn line(places: impl Iterator<Item = Option<(f64, f64)>>) -> String {
    let places: Vec<Option<(f64, f64)>> = places.collect();
    let mut path = String::new();
    for run in places.split(Option::is_none) {
        let run: Vec<(f64, f64)> = run.iter().copied().flatten().collect();
        for (k, (x, y)) in flat(&run).into_iter().enumerate() {
            let pen = if k == 0 { 'M' } else { 'L' };
            let _ = write!(path, "{pen}{x:.2} {y:.2}");
        }
    }
    path
}

/// The corners of a line that every other one is nearer to than [`FLAT`] (Ramer 1972; Douglas and
/// Peucker 1973), across the line between its neighbours.
fn flat(corners: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let Some((&first, &last)) = corners.first().zip(corners.last()) else {
        return vec![];
    };
    if corners.len() < 3 {
        return corners.to_vec();
    }
    let (dx, dy) = (last.0 - first.0, last.1 - first.1);
    let length = dx.hypot(dy);
    let away = |(x, y): (f64, f64)| {
        let (x, y) = (x - first.0, y - first.1);
        if length > 0.0 {
            (x * dy - y * dx).abs() / length
        } else {
            x.hypot(y)
        }
    };
    let inner = 1..corners.len() - 1;
    let farthest = inner.max_by(|&a, &b| away(corners[a]).total_cmp(&away(corners[b])));
    match farthest {
        Some(k) if away(corners[k]) > FLAT => {
            let mut kept = flat(&corners[..=k]);
            kept.pop();
            kept.extend(flat(&corners[k..]));
            kept
        }
        _ => vec![first, last],
    }
}

/// What follows the axes of a panel where the script of the page enlarges a part of it. An inner svg
/// cuts at its edges, and needs no name that another figure on the page might bear as well.
fn scaled(out: &mut String, (top, bottom): (f64, f64), content: impl FnOnce(&mut String)) {
    let (width, height) = (RIGHT - LEFT, bottom - top);
    let _ = writeln!(
        out,
        "<svg class=\"scaled\" x=\"{LEFT}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"{LEFT} {top} {width} {height}\" preserveAspectRatio=\"none\" \
         overflow=\"hidden\">"
    );
    content(out);
    out.push_str("</svg>\n");
}

/// A path cut at the edges of a part of a panel: from left to right, from top to bottom.
fn cut(
    out: &mut String,
    (from, to): (f64, f64),
    (top, bottom): (f64, f64),
    class: &str,
    path: &str,
) {
    if to - from < 0.01 || path.is_empty() {
        return;
    }
    let (width, height) = (to - from, bottom - top);
    let _ = writeln!(
        out,
        "<svg x=\"{from:.2}\" y=\"{top}\" width=\"{width:.2}\" height=\"{height}\" \
         viewBox=\"{from:.2} {top} {width:.2} {height}\" overflow=\"hidden\"><path \
         class=\"{class}\" d=\"{path}\"/></svg>"
    );
}

/// Radius, mm, and (measured − model)/u of every fitted point that has one.
pub(crate) fn residuals(fit: &Fit) -> impl Iterator<Item = (f64, f64)> {
    fit.residuals
        .iter()
        .map(|r| {
            (
                r.radius_mm,
                (r.measured_per_mm2 - r.model_per_mm2) / r.u_per_mm2,
            )
        })
        .filter(|(_, z)| z.is_finite())
}

/// Reduced χ² to the second decimal while that says something.
pub(crate) fn shown_chi2(reduced_chi2: f64) -> String {
    if (0.0..100.0).contains(&reduced_chi2) {
        fixed(reduced_chi2, 2)
    } else {
        significant(reduced_chi2, 3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every corner that is left out is nearer to the line than the promise, and a bend stays.
    #[test]
    fn a_line_loses_only_what_lies_on_it() {
        let bend = |k: u32| {
            let x = 0.5 * f64::from(k);
            (x, 3e-3 * x * x + if k == 700 { 5.0 } else { 0.0 })
        };
        let corners: Vec<(f64, f64)> = (0..1000).map(bend).collect();
        let kept = flat(&corners);
        assert!(kept.contains(&corners[700]));
        assert!((10..200).contains(&kept.len()), "{}", kept.len());
        for (x, y) in corners {
            let after = kept.iter().position(|c| c.0 >= x).unwrap();
            let ((x1, y1), (x0, y0)) = (kept[after], kept[after.saturating_sub(1)]);
            let line = if x1 > x0 {
                y0 + (y1 - y0) * (x - x0) / (x1 - x0)
            } else {
                y1
            };
            assert!((line - y).abs() < 12.0 * FLAT, "{x}");
        }
        assert_eq!(flat(&[(1.0, 1.0); 9]), [(1.0, 1.0); 2]);
        assert_eq!(flat(&[]), []);
        let gap = [Some((0.0, 0.0)), None, Some((1.0, 1.0)), Some((2.0, 2.0))];
        assert_eq!(line(gap.into_iter()), "M0.00 0.00M1.00 1.00L2.00 2.00");
    }
}

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
    let drawing = drawing(material, channel, STYLE);
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{drawing}")
}

/// The same for a page that brings the style itself: `style` is what the element starts with.
pub(crate) fn drawing(material: &str, channel: &ChannelReport, style: &str) -> String {
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

    let plot = Plot::new(channel);
    plot.ground(&mut out, PROFILE, &plot.reflectance, false);
    plot.profile(&mut out);
    plot.legend(&mut out);
    plot.annotation(&mut out);
    plot.ground(&mut out, RESIDUALS, &plot.residual, true);
    plot.residuals(&mut out);
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
    fn new(channel: &'a ChannelReport<'a>) -> Self {
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
        let _ = writeln!(
            out,
            "<rect class=\"range\" x=\"{start:.2}\" y=\"{top}\" width=\"{:.2}\" height=\"{}\"/>",
            end - start,
            bottom - top
        );
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
        let _ = write!(
            out,
            "<path class=\"grid\" d=\"{grid}\"/>\n<path class=\"frame\" d=\"{ticks}M{LEFT} \
             {top}H{RIGHT}V{bottom}H{LEFT}Z\"/>\n{labels}"
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

    fn profile(&self, out: &mut String) {
        self.points(out);
        self.model(out);
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
                let _ = write!(
                    arrows,
                    "M{:.2} {y:.2}h{:.2}M{x:.2} {y:.2}{ARROW_PATH}",
                    x - half,
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
            self.circle(marks, (x, y), point.radius_mm, &uncertain(value, u), "mm⁻²");
        }
        let _ = write!(
            out,
            "<path class=\"{color} bar\" d=\"{bars}\"/>\n<path class=\"{color} bar\" \
             d=\"{arrows}\"/>\n<g class=\"{color} out\">\n{left_out}</g>\n<g \
             class=\"{color}\">\n{used}</g>\n"
        );
    }

    /// A line through the points that have a place on both axes.
    fn line(&self, points: &[CurvePoint]) -> String {
        let mut path = String::new();
        let mut pen = 'M';
        for point in points {
            let x = self.radius.place(point.radius_mm);
            match x.zip(self.reflectance.place(point.reflectance_per_mm2)) {
                Some((x, y)) => {
                    let _ = write!(path, "{pen}{x:.2} {y:.2}");
                    pen = 'L';
                }
                None => pen = 'M',
            }
        }
        path
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
        let path = self.line(&self.channel.model_curve);
        let band = self.band();
        let transport = self.line(&self.channel.transport);
        let (start, end) = self.range();
        let (top, bottom) = PROFILE;
        let photons = self.line(&self.channel.monte_carlo);
        for (from, to, class, path) in [
            (LEFT, RIGHT, "band", &band),
            (LEFT, start, "model beyond", &path),
            (start, end, "model", &path),
            (end, RIGHT, "model beyond", &path),
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
        let _ = writeln!(out, "{levels}<g class=\"{}\">", self.channel.color_class());
        for (radius, z) in residuals(self.channel.fit) {
            if let Some((x, y)) = self.radius.place(radius).zip(self.residual.place(z)) {
                self.circle(out, (x, y), radius, &format!("{z:+.2}"), "u");
            }
        }
        out.push_str("</g>\n");
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
        let mut path = String::new();
        let mut pen = 'M';
        for r in &self.channel.fit.residuals {
            let found = ratios.iter().find(|(radius, _)| *radius == r.radius_mm);
            let z = found.map(|(_, ratio)| (ratio - 1.0) * r.model_per_mm2 / r.u_per_mm2);
            let x = self.radius.place(r.radius_mm);
            match x.zip(z.and_then(|z| self.residual.place(z))) {
                Some((x, y)) => {
                    let _ = write!(path, "{pen}{x:.2} {y:.2}");
                    pen = 'L';
                }
                None => pen = 'M',
            }
        }
        path
    }

    /// A marker, and what it stands for, which a browser shows where the pointer rests.
    fn circle(&self, out: &mut String, (x, y): (f64, f64), radius: f64, number: &str, unit: &str) {
        let _ = writeln!(
            out,
            "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{:.2}\"><title>r = {} mm: {} \
             {unit}</title></circle>",
            self.marker,
            significant(radius, 4),
            escaped(number)
        );
    }
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
    // An inner svg cuts at its edges, and needs no name that another figure on the page might bear
    // as well.
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

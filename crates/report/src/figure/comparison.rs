//! The figure of several models beside one profile.

use super::{HEIGHT, LEFT, PROFILE, Plot, RESIDUALS, RIGHT, WIDTH, line, scaled};
use crate::axis::Axis;
use crate::channel::{ChannelReport, CurvePoint, ModelReport};
use crate::markup::{escaped, svg};
use std::fmt::Write;

/// Height of a line of the legend, which stands below the axis of radius.
const LINE: f64 = 18.0;
const COLUMNS: usize = 3;
/// Percent that the lower panel shows at least and at most.
const SPAN: (f64, f64) = (5.0, 60.0);
/// Points whose own u exceeds this share say nothing about a model.
const NOISY: f64 = 0.1;

/// The profile of `channel` with the curves of `models` above, measured/model − 1 below.
///
/// Colours follow the order of the models; what a curve is called stands under the axis.
pub(crate) fn drawing(
    material: &str,
    channel: &ChannelReport,
    models: &[ModelReport],
    spoken: bool,
) -> String {
    let heading = format!("{material} · {}: models side by side", channel.name());
    let height = HEIGHT + LINE * models.len().div_ceil(COLUMNS) as f64;
    let mut out = String::new();
    let _ = write!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" xml:space=\"preserve\" class=\"figure\" \
         role=\"img\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" height=\"{height}\" \
         aria-label=\"{0}\">\n<title>{0}</title>\n<rect class=\"back\" width=\"{WIDTH}\" \
         height=\"{height}\"/>\n<text class=\"heading\" x=\"{LEFT}\" y=\"24\">{0}</text>\n",
        escaped(&heading)
    );
    let mut plot = Plot::new(channel, spoken);
    let deviations: Vec<Vec<(f64, f64)>> = models
        .iter()
        .map(|model| deviations(channel, &model.curve))
        .collect();
    let (start, end) = channel.fit.range_mm;
    let largest = deviations
        .iter()
        .flatten()
        .filter(|(r, _)| (start..=end).contains(r))
        .map(|(_, percent)| percent.abs())
        .fold(SPAN.0, f64::max);
    plot.residual = Axis::symmetric((1.1 * largest).min(SPAN.1), (RESIDUALS.1, RESIDUALS.0));

    plot.ground(&mut out, PROFILE, &plot.reflectance, false);
    let curve = |out: &mut String, i: usize, path: &str| {
        let _ = writeln!(out, "<path class=\"curve m{i}\" d=\"{path}\"/>");
    };
    scaled(&mut out, PROFILE, |out| {
        plot.points(out);
        for (i, model) in models.iter().enumerate() {
            curve(out, i, &plot.line(&model.curve));
        }
    });
    plot.ground(&mut out, RESIDUALS, &plot.residual, true);
    scaled(&mut out, RESIDUALS, |out| {
        let zero = plot.residual.place_inside(0.0);
        let _ = writeln!(
            out,
            "<path class=\"level\" d=\"M{LEFT} {zero:.2}H{RIGHT}\"/>"
        );
        for (i, deviation) in deviations.iter().enumerate() {
            let place = |&(radius, percent): &(f64, f64)| {
                plot.radius.place(radius).zip(plot.residual.place(percent))
            };
            curve(
                out,
                i,
                &line(deviation.iter().map(place).filter(Option::is_some)),
            );
        }
    });
    for (label, (top, bottom)) in [
        ("diffuse reflectance Rᵈ (mm⁻²)", PROFILE),
        ("measured/model − 1 (%)", RESIDUALS),
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
        "<text class=\"middle\" x=\"{}\" y=\"{}\">distance from the beam r (mm)</text>",
        0.5 * (LEFT + RIGHT),
        HEIGHT - 12.0
    );
    for (i, model) in models.iter().enumerate() {
        let x = LEFT + (RIGHT - LEFT) / COLUMNS as f64 * (i % COLUMNS) as f64;
        let y = HEIGHT + LINE * (i / COLUMNS) as f64;
        let _ = writeln!(
            out,
            "<g transform=\"translate({x:.2} {y})\"><path class=\"curve m{i}\" d=\"M0 0h24\"/><text \
             class=\"quiet\" x=\"30\" y=\"4\">{}</text></g>",
            escaped(model.name)
        );
    }
    out.push_str("</svg>\n");
    out
}

/// Radius, mm, and measured/model − 1, percent, wherever the datum stands out of its noise.
fn deviations(channel: &ChannelReport, curve: &[CurvePoint]) -> Vec<(f64, f64)> {
    channel
        .profile
        .points
        .iter()
        .zip(curve)
        .filter(|(p, _)| p.u_reflectance_per_mm2 < NOISY * p.reflectance_per_mm2)
        .map(|(p, model)| {
            let ratio = p.reflectance_per_mm2 / model.reflectance_per_mm2;
            (p.radius_mm, 100.0 * (ratio - 1.0))
        })
        .filter(|(_, percent)| percent.is_finite())
        .collect()
}

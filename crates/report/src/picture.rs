//! The merged picture of a channel in false colours, with what the profile took of it drawn over it.

use crate::figure::STYLE;
use crate::markup::{data_url, escaped, svg};
use crate::number::{power_of_ten, significant};
use std::fmt::Write;

/// Shades from dark to bright; the palette has one more colour, for what was not measured.
pub const SHADES: usize = 64;

const WIDTH: f64 = 720.0;
const LEFT: f64 = 14.0;
const TOP: f64 = 40.0;
/// Longer side of the picture.
const SIDE: f64 = 500.0;
/// Space between the picture and its colour bar, and the bar's width.
const GAP: f64 = 26.0;
const BAR: f64 = 18.0;
/// A line of the legend.
const LINE: f64 = 22.0;
/// Shortest colour bar that has room for its labels.
const LEAST_BAR: f64 = 110.0;
/// Share of the picture's longer side that the scale bar may take.
const SCALE_BAR: f64 = 0.3;

/// The colours: even steps of lightness from black over red to white, and a green that none of
/// them is like.
///
/// Nine stations of Smith and van der Walt's *magma* (matplotlib, CC0), straight lines between.
pub fn palette() -> Vec<[u8; 3]> {
    const STATIONS: [[u8; 3]; 9] = [
        [0, 0, 4],
        [28, 16, 68],
        [79, 18, 123],
        [129, 37, 129],
        [181, 54, 122],
        [229, 80, 100],
        [251, 135, 97],
        [254, 194, 135],
        [252, 253, 191],
    ];
    const UNMEASURED: [u8; 3] = [0, 190, 150];
    let shade = |k: usize| {
        let along = k as f64 / (SHADES - 1) as f64 * (STATIONS.len() - 1) as f64;
        let first = (along as usize).min(STATIONS.len() - 2);
        let part = along - first as f64;
        std::array::from_fn(|i| {
            let [a, b] = [first, first + 1].map(|s| f64::from(STATIONS[s][i]));
            (a + part * (b - a)).round() as u8
        })
    };
    (0..SHADES)
        .map(shade)
        .chain(std::iter::once(UNMEASURED))
        .collect()
}

/// The shade of `value`: the logarithm between `low` and `high`, the ends for what lies beyond
/// them, the darkest for what has no logarithm.
pub fn shade(value: f64, (low, high): (f64, f64)) -> u8 {
    let share = (value / low).ln() / (high / low).ln();
    let last = (SHADES - 1) as f64;
    // A share that is no number becomes 0 as well.
    (share * last).round().clamp(0.0, last) as u8
}

/// A merged picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Name of the channel.
    pub channel: String,
    /// A PNG of it in the colours of [`palette`], by [`shade`]. It may have fewer pixels than the
    /// camera.
    pub png: Vec<u8>,
    /// Columns and rows of the camera's picture, px.
    pub size_px: [f64; 2],
    /// The values of the darkest and of the brightest shade, mm⁻².
    pub range_per_mm2: (f64, f64),
    /// Where the profile has its centre, px.
    pub center_px: [f64; 2],
    /// Lines over the picture.
    pub outlines: Vec<Outline>,
    /// Pixels of a millimetre about the centre.
    pub px_per_mm: f64,
    /// Whether a pixel was not measured or left out.
    pub any_unmeasured: bool,
}

/// A closed line over a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// What it is.
    pub name: String,
    /// Whether it is dashed; lines of one name look alike.
    pub dashed: bool,
    /// Its corners, px: columns and rows from the middle of the first pixel.
    pub corners_px: Vec<[f64; 2]>,
}

/// An SVG of the picture with a scale of colours and of length, complete in itself.
pub fn picture_svg(material: &str, picture: &Picture) -> String {
    let drawing = drawing(material, picture, STYLE);
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{drawing}")
}

/// The same for a page that brings the style itself: `style` is what the element starts with.
pub(crate) fn drawing(material: &str, picture: &Picture, style: &str) -> String {
    let heading = format!("{material} · {}: merged picture", picture.channel);
    let [columns, rows] = picture.size_px;
    let longer = columns.max(rows).max(1.0);
    let per_px = SIDE / longer;
    let (wide, high) = (columns * per_px, rows * per_px);
    let legend = legend(picture);
    let least = LEAST_BAR + LINE * legend.len() as f64 + 24.0;
    let height = TOP + high.max(least) + 14.0;
    let mut out = String::new();
    let _ = write!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" xml:space=\"preserve\" class=\"figure\" \
         role=\"img\" viewBox=\"0 0 {WIDTH} {height:.1}\" width=\"{WIDTH}\" \
         height=\"{height:.1}\" aria-label=\"{0}\">\n<title>{0}</title>\n",
        escaped(&heading)
    );
    if !style.is_empty() {
        let _ = write!(out, "<style>\n{style}</style>\n");
    }
    let _ = write!(
        out,
        "<rect class=\"back\" width=\"{WIDTH}\" height=\"{height:.1}\"/>\n<text class=\"heading\" \
         x=\"{LEFT}\" y=\"24\">{}</text>\n<svg class=\"scaled\" x=\"{LEFT}\" y=\"{TOP}\" \
         width=\"{wide:.2}\" height=\"{high:.2}\" viewBox=\"0 0 {wide:.2} {high:.2}\" \
         preserveAspectRatio=\"none\" overflow=\"hidden\">\n<image \
         class=\"pixels\" width=\"{wide:.2}\" height=\"{high:.2}\" preserveAspectRatio=\"none\" \
         href=\"{}\"/>\n",
        escaped(&heading),
        data_url(&picture.png)
    );
    // The middle of the first pixel is at (0, 0).
    let place = |px: [f64; 2]| px.map(|v| ((v + 0.5) * per_px).clamp(-1e4, 1e4));
    for outline in &picture.outlines {
        let mut path = String::new();
        for (k, corner) in outline.corners_px.iter().enumerate() {
            let [x, y] = place(*corner);
            let pen = if k == 0 { 'M' } else { 'L' };
            if x.is_finite() && y.is_finite() {
                let _ = write!(path, "{pen}{x:.2} {y:.2}");
            }
        }
        if path.is_empty() {
            continue;
        }
        let _ = writeln!(
            out,
            "<g><title>{}</title>{}</g>",
            escaped(&outline.name),
            line(&format!("{path}Z"), outline.dashed)
        );
    }
    let [x, y] = place(picture.center_px);
    if x.is_finite() && y.is_finite() {
        let _ = writeln!(out, "{}", cross([x, y]));
    }
    out.push_str("</svg>\n");
    scale_bar(&mut out, picture, per_px, (wide, high));
    let (bar_left, bar_high) = (
        LEFT + wide + GAP,
        high.max(least) - LINE * legend.len() as f64 - 24.0,
    );
    colour_bar(&mut out, picture, bar_left, bar_high);
    for (k, (sign, text)) in legend.iter().enumerate() {
        let y = TOP + bar_high + 24.0 + LINE * (k as f64 + 0.5);
        let _ = writeln!(
            out,
            "<g transform=\"translate({bar_left:.2} {y:.2})\">{sign}<text class=\"quiet\" x=\"26\" \
             y=\"4\">{}</text></g>",
            svg(text)
        );
    }
    out.push_str("</svg>\n");
    out
}

/// White with a dark rim, which shows on every colour.
fn line(path: &str, dashed: bool) -> String {
    let dash = if dashed { " dashed" } else { "" };
    format!("<path class=\"rim\" d=\"{path}\"/><path class=\"outline{dash}\" d=\"{path}\"/>")
}

fn cross([x, y]: [f64; 2]) -> String {
    let path = format!("M{:.2} {y:.2}h12M{x:.2} {:.2}v12", x - 6.0, y - 6.0);
    line(&path, false)
}

/// A sign and a text for each thing that is drawn.
fn legend(picture: &Picture) -> Vec<(String, String)> {
    let mut entries = vec![(cross([10.0, 0.0]), "centre".to_owned())];
    for outline in &picture.outlines {
        let sign = line("M0 0h20", outline.dashed);
        if !entries.iter().any(|(_, name)| *name == outline.name) {
            entries.push((sign, outline.name.clone()));
        }
    }
    if picture.any_unmeasured {
        let [r, g, b] = palette()[SHADES];
        let sign = format!(
            "<rect x=\"4\" y=\"-6\" width=\"12\" height=\"12\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>"
        );
        entries.push((sign, "not measured, left out".to_owned()));
    }
    entries
}

/// A length that is easy to read, in the lower left corner.
fn scale_bar(out: &mut String, picture: &Picture, per_px: f64, (wide, high): (f64, f64)) {
    let per_mm = picture.px_per_mm * per_px;
    let most = SCALE_BAR * SIDE / per_mm;
    if !(most.is_normal() && (1e-6..1e6).contains(&most)) {
        return;
    }
    let decade = 10f64.powf(most.log10().floor());
    let steps = [5.0, 2.0, 1.0].map(|digit| digit * decade);
    let length = steps.into_iter().find(|l| *l <= most).unwrap_or(decade);
    let y = high - 12.0;
    let _ = writeln!(
        out,
        "<g class=\"axes\" transform=\"translate({LEFT} {TOP})\" data-panel=\"{LEFT} {TOP} \
         {wide:.2} {high:.2}\" data-mm=\"{per_mm}\">{}<text class=\"over\" x=\"12\" \
         y=\"{:.2}\">{} mm</text></g>",
        line(&format!("M12 {y:.2}h{:.2}", length * per_mm), false),
        y - 7.0,
        significant(length, 1)
    );
}

fn colour_bar(out: &mut String, picture: &Picture, left: f64, high: f64) {
    let step = high / SHADES as f64;
    // A little taller than a step, so that no gap shows between two.
    let _ = writeln!(out, "<g stroke-width=\"{:.2}\">", step + 1.0);
    for (k, [r, g, b]) in palette().iter().take(SHADES).enumerate() {
        let y = TOP + high - step * (k as f64 + 0.5);
        let _ = writeln!(
            out,
            "<path stroke=\"#{r:02x}{g:02x}{b:02x}\" d=\"M{left:.1} {y:.1}h{BAR}\"/>"
        );
    }
    let _ = writeln!(
        out,
        "</g><rect class=\"frame\" x=\"{left:.2}\" y=\"{TOP}\" width=\"{BAR}\" height=\"{high:.2}\"/>"
    );
    let (low, top) = picture.range_per_mm2;
    let decades = (top / low).log10();
    if decades.is_normal() && (0.0..40.0).contains(&decades) {
        let first = low.log10().ceil() as i32;
        let last = top.log10().floor() as i32;
        for decade in first..=last {
            let y = TOP + high * (1.0 - (f64::from(decade) - low.log10()) / decades);
            let _ = writeln!(
                out,
                "<path class=\"frame\" d=\"M{:.2} {y:.2}h5\"/><text class=\"quiet\" x=\"{:.2}\" \
                 y=\"{:.2}\">{}</text>",
                left + BAR,
                left + BAR + 9.0,
                y + 4.0,
                svg(&power_of_ten(decade))
            );
        }
    }
    let _ = writeln!(
        out,
        "<text class=\"quiet middle\" transform=\"translate({:.2} {:.2}) rotate(-90)\">{}</text>",
        left + BAR + 62.0,
        TOP + 0.5 * high,
        svg("radiance as Rᵈ (mm⁻²)")
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shades_are_even_in_the_logarithm() {
        let range = (1e-5, 1e-1);
        assert_eq!(shade(1e-5, range), 0);
        assert_eq!(shade(1e-3, range), 32);
        assert_eq!(shade(1e-1, range), 63);
        for (odd, expected) in [
            (0.0, 0),
            (-1.0, 0),
            (f64::NAN, 0),
            (1e-9, 0),
            (f64::INFINITY, 63),
        ] {
            assert_eq!(shade(odd, range), expected, "{odd}");
        }
    }

    /// Each is lighter than the one before: the scale reads without colours, too.
    #[test]
    fn the_palette_rises_in_lightness() {
        let light = |[r, g, b]: [u8; 3]| {
            0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
        };
        let colours = palette();
        assert_eq!(colours.len(), SHADES + 1);
        for pair in colours[..SHADES].windows(2) {
            assert!(light(pair[1]) > light(pair[0]), "{pair:?}");
        }
    }
}

//! Profile and fit in the characters of a terminal.

use crate::axis::{Axis, Tick};
use crate::figure::residuals;
use fit::{Fit, Residual};
use physics::RadialProfile;

/// Rows of a plot.
const ROWS: usize = 9;
/// Columns of a plot, where one has the line for itself, and where it has neighbours.
const COLUMNS: [usize; 2] = [56, 20];
/// Columns left of a plot.
const MARGIN: usize = 6;
/// Panels in a line: three fit into the 80 columns of a terminal.
const ABREAST: usize = 3;
/// Every so many columns a point of the data stands; the model shows between them.
const EVERY: usize = 3;
/// Standard uncertainties at the ends of the strip of residuals.
const LIMIT: f64 = 4.0;
/// Eight heights, the middle for a residual of 0.
const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// The first of the patterns of eight dots.
const BRAILLE: u32 = 0x2800;
/// The dots of a pattern, row by row.
const DOTS: [[u32; 2]; 4] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];

/// A small plot of every channel: data and model on logarithmic axes, and below it the residuals.
///
/// # Example
///
/// ```
/// assert_eq!(report::preview_text(&[], &[]), "");
/// ```
pub fn preview_text(fits: &[Fit], profiles: &[RadialProfile]) -> String {
    let columns = COLUMNS[usize::from(fits.len() > 1)];
    let panels: Vec<Vec<String>> = (fits.iter().zip(profiles))
        .map(|(fit, profile)| panel(fit, profile, columns))
        .collect();
    let mut text = String::new();
    for panels in panels.chunks(ABREAST) {
        for row in 0..panels[0].len() {
            let line: Vec<&str> = panels.iter().map(|panel| panel[row].as_str()).collect();
            text.push_str(line.concat().trim_end());
            text.push('\n');
        }
    }
    if !panels.is_empty() {
        text.push_str("o data, x left out, dots: model; below: residuals from -4 to +4 u\n");
    }
    text
}

/// Its lines, all equally wide.
fn panel(fit: &Fit, profile: &RadialProfile, columns: usize) -> Vec<String> {
    let (wide, high) = (2.0 * columns as f64, 4.0 * ROWS as f64);
    let points = &profile.points;
    let radii = Axis::logarithmic(points.iter().map(|p| p.radius_mm), (0.0, wide));
    // Neither what does not stand out of its noise nor the model, which falls for ever, may stretch
    // the axis by decades.
    let clear = points
        .iter()
        .filter(|p| p.reflectance_per_mm2 > 2.0 * p.u_reflectance_per_mm2);
    let light = Axis::logarithmic(clear.map(|p| p.reflectance_per_mm2), (high, 0.0));

    let mut cells = vec![vec![' '; columns]; ROWS];
    line(&mut cells, &fit.residuals, &radii, &light);
    let (start, end) = fit.range_mm;
    // The first point of each column, and not all: the model is to be seen between them.
    let mut last = None;
    for point in points {
        let (Some(x), Some(y)) = (
            radii.place(point.radius_mm),
            light.place(point.reflectance_per_mm2),
        ) else {
            continue;
        };
        let (column, row) = (x / 2.0, y / 4.0);
        if !(0.0..columns as f64).contains(&column) || !(0.0..ROWS as f64).contains(&row) {
            continue;
        }
        let (column, row) = (column as usize, row as usize);
        if column % EVERY == 0 && last != Some(column) {
            let fitted = (start..=end).contains(&point.radius_mm);
            cells[row][column] = if fitted { 'o' } else { 'x' };
            last = Some(column);
        }
    }

    let mut lines = vec![format!("{}: R_d [mm^-2]", fit.channel)];
    let labels = light.ticks();
    for (row, cells) in cells.iter().enumerate() {
        let here = |tick: &&Tick| (tick.at_px / 4.0) as usize == row && tick.label.is_some();
        let label = labels.iter().find(here);
        let label = label.and_then(|tick| tick.label.as_deref()).unwrap_or("");
        lines.push(format!("{label:>4} {}", cells.iter().collect::<String>()));
    }
    lines.push(format!("   r {}", below(&radii, columns)));
    lines.push(format!("   u {}", strip(fit, &radii, columns)));
    for line in &mut lines {
        let missing = (MARGIN + columns).saturating_sub(line.chars().count());
        line.extend(std::iter::repeat_n(' ', missing));
    }
    lines
}

/// Draws the model through the fitted radii, eight dots a cell.
fn line(cells: &mut [Vec<char>], residuals: &[Residual], radii: &Axis, light: &Axis) {
    let placed: Vec<(f64, f64)> = (residuals.iter())
        .filter_map(|r| Some((radii.place(r.radius_mm)?, light.place(r.model_per_mm2)?)))
        .collect();
    for pair in placed.windows(2) {
        let [(x, y), (next_x, next_y)] = [pair[0], pair[1]];
        let steps = (next_x - x).abs().max((next_y - y).abs()).ceil().max(1.0);
        for step in 0..=steps as usize {
            let share = step as f64 / steps;
            let (x, y) = (x + share * (next_x - x), y + share * (next_y - y));
            if x < 0.0 || y < 0.0 {
                continue;
            }
            let (x, y) = (x as usize, y as usize);
            let Some(cell) = cells.get_mut(y / 4).and_then(|row| row.get_mut(x / 2)) else {
                continue;
            };
            let dots = u32::from(*cell).saturating_sub(BRAILLE);
            let dots = dots | DOTS[y % 4][x % 2];
            *cell = char::from_u32(BRAILLE + dots).unwrap_or(' ');
        }
    }
}

/// The labels of the radii, as far as one leaves room for the next.
fn below(radii: &Axis, columns: usize) -> String {
    let mut text = String::new();
    let unit = " mm";
    for tick in radii.ticks() {
        let Some(label) = tick.label else { continue };
        let at = (tick.at_px / 2.0).max(0.0) as usize;
        let used = text.chars().count();
        let free = used == 0 || at > used;
        if free && at + label.chars().count() + unit.len() <= columns {
            text.extend(std::iter::repeat_n(' ', at - used));
            text.push_str(&label);
        }
    }
    text + unit
}

/// The mean residual of each column.
fn strip(fit: &Fit, radii: &Axis, columns: usize) -> String {
    let mut sums = vec![(0.0, 0_u32); columns];
    for (radius_mm, z) in residuals(fit) {
        let column = radii.place(radius_mm).map(|x| x / 2.0);
        let Some(column) = column.filter(|c| *c >= 0.0) else {
            continue;
        };
        if let Some((sum, count)) = sums.get_mut(column as usize) {
            *sum += z;
            *count += 1;
        }
    }
    let block = |(sum, count): &(f64, u32)| {
        if *count == 0 {
            return ' ';
        }
        let share = (sum / f64::from(*count) + LIMIT) / (2.0 * LIMIT);
        let height = share.clamp(0.0, 1.0) * (BLOCKS.len() - 1) as f64;
        BLOCKS[height.round() as usize]
    };
    sums.iter().map(block).collect()
}

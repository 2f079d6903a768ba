//! The merged picture of a channel for the report: small, in false colours, with what the profile took of it.

use crate::error::{Blame, Result};
use crate::regions;
use formats::encode_indexed_png;
use physics::ChannelMap;
use profile::{Measured, View};
use report::{Outline, Picture, SHADES, palette, shade};
use std::borrow::Cow;
use std::f64::consts::TAU;

/// Pixels that the pictures of a report may have together, and where they are many, so that the rest
/// of each wants room as well: noise takes 6 bits of each, and a third more as text.
const ALL_PIXELS: f64 = 500_000.0;
const MANY_PIXELS: f64 = 320_000.0;
/// Most pictures that are few.
const FEW: usize = 4;
/// Longer side of one at most.
const LONGEST: f64 = 400.0;
/// Share of the pixels that may be darker than the darkest shade.
const DARK: f64 = 0.02;
/// Least and most that the shades span.
const SPAN: (f64, f64) = (10.0, 1e8);
/// Corners of a circle.
const CORNERS: usize = 120;

/// What is drawn of a channel.
pub(crate) struct Seen<'a> {
    /// Name of the channel.
    pub(crate) name: String,
    /// Its pixels.
    pub(crate) channel: &'a ChannelMap,
    /// Columns and rows.
    pub(crate) size: (usize, usize),
    /// Where each pixel looks.
    pub(crate) view: &'a View,
    /// Its profile and total.
    pub(crate) measured: &'a Measured,
    /// Azimuths that took part, degrees; all where there is none.
    pub(crate) sectors_deg: &'a [[f64; 2]],
    /// The radii that were fitted, mm.
    pub(crate) range_mm: (f64, f64),
}

/// A picture that is one of `count`.
///
/// # Errors
///
/// A fault of ours.
pub(crate) fn picture(seen: &Seen, count: usize) -> Result<Picture> {
    let (width, height) = seen.size;
    let center = seen.measured.center_px;
    let channel = if seen.sectors_deg.is_empty() {
        Cow::Borrowed(seen.channel)
    } else {
        let found = regions::within_sectors(
            seen.channel,
            seen.size,
            seen.view,
            Some(center),
            seen.sectors_deg,
        );
        Cow::Owned(found.fault("sectors")?.0)
    };
    let all = if count > FEW { MANY_PIXELS } else { ALL_PIXELS };
    let side = (all / count.max(1) as f64).sqrt().min(LONGEST);
    let step = (width.max(height) as f64 / side).ceil().max(1.0) as usize;
    let (columns, rows) = (width.div_ceil(step), height.div_ceil(step));
    let blocks: Vec<Block> = (0..columns * rows)
        .map(|k| {
            let corner = (k % columns * step, k / columns * step);
            Block::of(&channel, seen.size, corner, step)
        })
        .collect();
    let range = range(&blocks);
    let indices: Vec<u8> = blocks
        .iter()
        .map(|block| match block {
            Block::Mean(value) => shade(*value, range),
            Block::Unmeasured => SHADES as u8,
        })
        .collect();
    let mut png = vec![];
    encode_indexed_png((columns, rows), &indices, &palette(), &mut png).fault("picture")?;
    // The last block of a row may reach beyond the picture.
    let size_px = [columns * step, rows * step].map(|px| px as f64);

    let spot = seen.view.at_mm(center);
    let circle = |name: &str, dashed, radius_mm: f64| {
        let corner = |k: usize| {
            let (sin, cos) = (TAU * k as f64 / CORNERS as f64).sin_cos();
            seen.view
                .at_px([spot[0] + radius_mm * cos, spot[1] + radius_mm * sin])
        };
        Outline {
            name: name.to_owned(),
            dashed,
            corners_px: (0..CORNERS).map(corner).collect(),
        }
    };
    let mut outlines = vec![
        circle("fitted range", false, seen.range_mm.0),
        circle("fitted range", false, seen.range_mm.1),
    ];
    let total = seen.measured.total.radius_max_mm;
    outlines.extend(total.map(|radius| circle("circle of the total", true, radius)));
    Ok(Picture {
        channel: seen.name.clone(),
        png,
        size_px,
        range_per_mm2: range,
        center_px: center,
        outlines,
        px_per_mm: 1.0 / seen.view.mm_per_pixel(center),
        any_unmeasured: indices.contains(&(SHADES as u8)),
    })
}

/// Some pixels of the camera as one of the report.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Block {
    Mean(f64),
    /// One of them was not measured: a single hot pixel shows.
    Unmeasured,
}

impl Block {
    fn of(
        channel: &ChannelMap,
        (width, height): (usize, usize),
        (left, top): (usize, usize),
        step: usize,
    ) -> Self {
        let (mut sum, mut count) = (0.0, 0_u32);
        for row in top..(top + step).min(height) {
            for column in left..(left + step).min(width) {
                let pixel = row * width + column;
                let value = channel.value[pixel];
                if value.is_nan() {
                    // A photosite of another colour.
                    continue;
                }
                if !channel.variance[pixel].is_finite() {
                    return Self::Unmeasured;
                }
                sum += f64::from(value);
                count += 1;
            }
        }
        // A block without any photosite of the colour is as dark as can be.
        Self::Mean(sum / f64::from(count.max(1)))
    }
}

/// The values of the darkest and the brightest shade.
fn range(blocks: &[Block]) -> (f64, f64) {
    let mut lit: Vec<f64> = blocks
        .iter()
        .filter_map(|block| match block {
            Block::Mean(value) if *value > 0.0 => Some(*value),
            _ => None,
        })
        .collect();
    lit.sort_by(f64::total_cmp);
    let high = lit.last().copied().unwrap_or(1.0);
    let low = lit.get((DARK * lit.len() as f64) as usize).copied();
    (
        low.unwrap_or(high).clamp(high / SPAN.1, high / SPAN.0),
        high,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::{RadialProfile, TotalReflectance};

    /// A glow like 1/r² of 90 px × 60 px with a pixel that was not measured; the picture may take
    /// 30 px across.
    #[test]
    fn a_picture_is_the_glow_with_its_holes() {
        let (width, height) = (90, 60);
        let center_px = [40.0, 30.0];
        let mut channel = ChannelMap {
            name: "G".to_owned(),
            value: (0..width * height)
                .map(|i| {
                    let x = (i % width) as f64 - center_px[0];
                    let y = (i / width) as f64 - center_px[1];
                    (1.0 / (1.0 + x * x + y * y)) as f32
                })
                .collect(),
            variance: vec![1e-6; width * height],
        };
        channel.variance[4 * width + 7] = f32::INFINITY;
        let measured = Measured {
            profile: RadialProfile {
                channel: "G".to_owned(),
                points: vec![],
            },
            total: TotalReflectance {
                channel: "G".to_owned(),
                total_reflectance: 0.5,
                u_total_reflectance: 0.01,
                radius_max_mm: Some(2.9),
                u_scale_relative: 0.0,
                u_offset_per_mm2: 0.0,
            },
            center_px,
            rejected_pixels: 0,
            unmeasured_pixels: 0,
            unseen_share: 0.0,
            relative_scatter: 0.0,
        };
        let seen = Seen {
            name: "G".to_owned(),
            channel: &channel,
            size: (width, height),
            view: &View::square(0.1),
            measured: &measured,
            sectors_deg: &[],
            range_mm: (0.5, 2.0),
        };
        let picture = picture(&seen, 350).unwrap();
        assert!(picture.any_unmeasured);
        assert_eq!(picture.size_px, [90.0, 60.0]);
        assert!((picture.px_per_mm - 10.0).abs() < 1e-9);
        let names: Vec<&str> = picture.outlines.iter().map(|o| o.name.as_str()).collect();
        assert_eq!(
            names,
            ["fitted range", "fitted range", "circle of the total"]
        );
        for (outline, radius_px) in picture.outlines.iter().zip([5.0, 20.0, 29.0]) {
            for [x, y] in &outline.corners_px {
                assert!(((x - 40.0).hypot(y - 30.0) - radius_px).abs() < 1e-9);
            }
        }
        let (low, high) = picture.range_per_mm2;
        // The mean of the brightest 3 px × 3 px, which are 39 to 41 and 30 to 32.
        let mean = [-1.0_f64, 0.0, 1.0]
            .iter()
            .flat_map(|x| [0.0_f64, 1.0, 2.0].map(|y| 1.0 / (1.0 + x * x + y * y)))
            .sum::<f64>()
            / 9.0;
        assert!((high / mean - 1.0).abs() < 1e-6, "{high} {mean}");
        assert!(low > 0.0 && low < 1e-3, "{low}");
    }

    #[test]
    fn sectors_are_what_is_left() {
        let size = (40, 40);
        let channel = ChannelMap {
            name: "G".to_owned(),
            value: vec![1.0; 1600],
            variance: vec![1.0; 1600],
        };
        let block = |channel: &ChannelMap, corner| Block::of(channel, size, corner, 1);
        let (kept, _) = regions::within_sectors(
            &channel,
            size,
            &View::square(1.0),
            Some([20.0, 20.0]),
            &[[-45.0, 45.0]],
        )
        .unwrap();
        assert_eq!(block(&kept, (35, 20)), Block::Mean(1.0));
        assert_eq!(block(&kept, (5, 20)), Block::Unmeasured);
    }
}

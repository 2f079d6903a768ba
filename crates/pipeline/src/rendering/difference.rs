//! Two pictures beside each other.

use crate::error::{Blame, Error, Kind, Result};
use crate::files::{Outputs, open, split};
use formats::{encode_png, read_radiance};
use physics::{Frame, RadianceMap, Samples};
use serde::Serialize;
use std::path::Path;

/// Side of the blocks whose relative differences are ranked, pixels.
const BLOCK: usize = 4;

/// How far one channel of two pictures is apart.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelDifference {
    /// Name of the channel.
    pub channel: String,
    /// Means of the first and the second picture, in their unit.
    pub mean: [f64; 2],
    /// Root mean square of first − second over all pixels, in their unit.
    pub rmse: f64,
    /// The same of what their own noise does not explain, over the mean of the second: the root
    /// of the mean square less the mean variance, or 0 where noise explains all.
    pub relative_beyond_noise: f64,
    /// `rmse` over the mean of the second.
    pub relative_rmse: f64,
    /// Mean of (first − second)²/(sum of variances), of pixels with some: 1 where noise alone
    /// tells them apart.
    pub chi2_per_pixel: Option<f64>,
    /// Median over blocks of 4 × 4 pixels of |first − second| over the second; of blocks above 1 %
    /// of the mean lit one.
    pub median_relative_by_block: Option<f64>,
}

/// Reads two pictures, as `render`, `hdr` and `measure` write them.
///
/// # Errors
///
/// One cannot be read, or they differ in size or channels.
pub fn read_pictures(a: &Path, b: &Path) -> Result<[RadianceMap; 2]> {
    let read = |path: &Path| -> Result<RadianceMap> {
        let file = read_radiance(open(path)?).input(path.display())?;
        Ok(file.map.into_owned())
    };
    let maps = [read(a)?, read(b)?];
    let size = |m: &RadianceMap| {
        format!(
            "{} x {} pixels of {}",
            m.width,
            m.height,
            m.names().join(", ")
        )
    };
    let [first, second] = maps.each_ref().map(size);
    if first != second {
        let message = format!(
            "{} has {first}, {} has {second}; only pictures of one size and with the same channels can be compared",
            a.display(),
            b.display()
        );
        return Err(Error::new(Kind::Input, message));
    }
    Ok(maps)
}

/// Compares two pictures of one size channel by channel.
pub fn differences(a: &RadianceMap, b: &RadianceMap) -> Vec<ChannelDifference> {
    let (width, height) = (a.width, a.height);
    let pairs = a.channels.iter().zip(&b.channels);
    pairs
        .map(|(a, b)| {
            let n = a.value.len() as f64;
            let (mut sums, mut square, mut noise) = ([0.0; 2], 0.0, 0.0);
            let (mut chi2, mut known) = (0.0, 0.0_f64);
            let mut blocks = vec![[0.0; 2]; width.div_ceil(BLOCK) * height.div_ceil(BLOCK)];
            for i in 0..a.value.len() {
                let [x, y] = [a.value[i], b.value[i]].map(f64::from);
                let variance = f64::from(a.variance[i]) + f64::from(b.variance[i]);
                let d2 = (x - y) * (x - y);
                sums[0] += x;
                sums[1] += y;
                square += d2;
                if variance > 0.0 && variance.is_finite() {
                    noise += variance;
                    chi2 += d2 / variance;
                    known += 1.0;
                }
                let block = i / width / BLOCK * width.div_ceil(BLOCK) + i % width / BLOCK;
                blocks[block][0] += x;
                blocks[block][1] += y;
            }
            let mean = sums.map(|s| s / n);
            let lit = blocks.iter().filter(|block| block[1] > 0.0);
            let mean_lit = lit.clone().map(|block| block[1]).sum::<f64>() / lit.count() as f64;
            let mut relative: Vec<f64> = blocks
                .iter()
                .filter(|block| block[1] > 0.01 * mean_lit)
                .map(|[x, y]| (x / y - 1.0).abs())
                .collect();
            relative.sort_by(f64::total_cmp);
            let rmse = (square / n).sqrt();
            ChannelDifference {
                channel: a.name.clone(),
                mean,
                rmse,
                relative_rmse: rmse / mean[1],
                relative_beyond_noise: ((square - noise).max(0.0) / n).sqrt() / mean[1],
                chi2_per_pixel: (known > 0.0).then(|| chi2 / known),
                median_relative_by_block: relative.get(relative.len() / 2).copied(),
            }
        })
        .collect()
}

/// First − second as a picture: gray where they agree, redder where the first is brighter and
/// bluer where it is darker; the full colour is `full`, and the sum of the channels counts.
pub(super) fn difference_frame(a: &RadianceMap, b: &RadianceMap) -> (Frame, f64) {
    let pixels = a.width * a.height;
    let sum = |map: &RadianceMap, pixel: usize| -> f64 {
        map.channels.iter().map(|c| f64::from(c.value[pixel])).sum()
    };
    let difference: Vec<f64> = (0..pixels).map(|p| sum(a, p) - sum(b, p)).collect();
    let mut sizes: Vec<f64> = difference.iter().map(|d| d.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let full = sizes[pixels * 99 / 100].max(f64::MIN_POSITIVE);
    let code = |x: f64| (x.clamp(0.0, 1.0) * f64::from(u16::MAX)).round() as u16;
    let samples = difference
        .iter()
        .flat_map(|d| {
            let t = 0.5 * (d / full).clamp(-1.0, 1.0);
            [0.5 + t, 0.5 - t.abs(), 0.5 - t].map(code)
        })
        .collect();
    let frame = Frame {
        width: a.width,
        height: a.height,
        channels: 3,
        samples: Samples::U16(samples),
    };
    (frame, full)
}

/// Compares two pictures and, where `picture` is given, draws their difference; returns with it
/// the difference that has the full colour.
///
/// # Errors
///
/// As [`read_pictures`]; the picture exists, or cannot be written.
pub fn compare_pictures(
    a: &Path,
    b: &Path,
    picture: Option<&Path>,
    force: bool,
) -> Result<(Vec<ChannelDifference>, Option<f64>)> {
    let [first, second] = read_pictures(a, b)?;
    let found = differences(&first, &second);
    let Some(picture) = picture else {
        return Ok((found, None));
    };
    let (folder, name) = split(picture)?;
    let inputs = [a.to_owned(), b.to_owned()];
    let files = Outputs::new(&folder, [&name], &inputs, force)?;
    let (frame, full) = difference_frame(&first, &second);
    files.write(&name, |out| Ok(encode_png(&frame, out)?))?;
    files.commit()?;
    Ok((found, Some(full)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::ChannelMap;

    fn map(value: impl Fn(usize) -> f32) -> RadianceMap {
        RadianceMap {
            width: 8,
            height: 8,
            channels: vec![ChannelMap {
                name: "Y".into(),
                value: (0..64).map(value).collect(),
                variance: vec![0.01; 64],
            }],
            mosaic: None,
        }
    }

    #[test]
    fn differences_are_what_they_say() {
        let a = map(|_| 2.2);
        let b = map(|i| if i % 2 == 0 { 1.8 } else { 2.2 });
        let found = &differences(&a, &b)[0];
        // Half of the pixels are off by 0.4: √0.08, over a mean of 2; noise of 0.02 each.
        assert!((found.rmse - 0.08_f64.sqrt()).abs() < 1e-6, "{found:?}");
        assert!((found.relative_rmse - 0.08_f64.sqrt() / 2.0).abs() < 1e-6);
        assert!((found.relative_beyond_noise - 0.06_f64.sqrt() / 2.0).abs() < 1e-6);
        assert!((found.chi2_per_pixel.unwrap() - 4.0).abs() < 1e-5);
        assert!((found.median_relative_by_block.unwrap() - 0.1).abs() < 1e-6);
        let (frame, full) = difference_frame(&a, &b);
        assert!((full - 0.4).abs() < 1e-6);
        // Redder where the first is brighter, gray where they agree.
        let samples = frame.samples.to_f32();
        assert_eq!(samples[..3], [65535.0, 0.0, 0.0]);
        assert_eq!(samples[3..6], [32768.0; 3]);
    }
}

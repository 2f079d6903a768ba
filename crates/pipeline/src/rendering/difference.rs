//! Two pictures beside each other.

use super::flip::{flip_frame, hdr_flip};
use crate::difference::{Series, beside, in_u};
use crate::error::{Blame, Error, Kind, Result};
use crate::files::{Outputs, open, split};
use crate::fit_json::SCHEMA_VERSION;
use formats::{encode_png, read_radiance};
use physics::{ChannelMap, Frame, RadianceMap};
use render::SharedNoise;
use report::{Chart, Stroke, chart_svg};
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

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

/// One ring of two pictures about where the light of the second is.
#[derive(Clone, Debug, Serialize)]
pub struct RingDifference {
    /// Name of the channel.
    pub channel: String,
    /// Its edges, pixels.
    pub radius_px: [f64; 2],
    /// The same in mm, of a picture by parallel rays.
    pub radius_mm: Option<[f64; 2]>,
    /// Means of the first and the second.
    pub mean: [f64; 2],
    /// Difference over its standard error, where the pictures have some: with what neighbouring
    /// pixels share, if that stands in the `NAME.json` beside the pictures.
    pub z: Option<f64>,
}

/// Light through one face, from the `NAME.json` beside the pictures.
#[derive(Clone, Debug, Serialize)]
pub struct FaceDifference {
    /// Solid, face and channel.
    pub of: String,
    /// Powers of the first and the second, W.
    pub power: [f64; 2],
    /// Difference over its standard error.
    pub z: Option<f64>,
}

/// How far two pictures are apart.
#[derive(Clone, Debug, Serialize)]
pub struct PictureDifference {
    schema_version: u32,
    /// Channel by channel.
    pub channels: Vec<ChannelDifference>,
    /// Mean of HDR-FLIP over the pixels, 0 to 1, the second being the reference. None of pictures
    /// told apart by components.
    pub flip: Option<f64>,
    /// Centre of the rings: that of the light of the second, pixels.
    pub center_px: [f64; 2],
    /// Rings of equal ratios.
    pub rings: Vec<RingDifference>,
    /// Faces, where both pictures have been made by following light from its lamp.
    pub faces: Vec<FaceDifference>,
}

/// Rings of [`PictureDifference`].
const RINGS: usize = 12;

fn center(map: &RadianceMap) -> [f64; 2] {
    let (mut sum, mut at) = (0.0, [0.0; 2]);
    for channel in &map.channels {
        for (i, value) in channel.value.iter().enumerate() {
            let light = f64::from(*value).max(0.0);
            sum += light;
            at[0] += light * ((i % map.width) as f64 + 0.5);
            at[1] += light * ((i / map.width) as f64 + 0.5);
        }
    }
    if sum > 0.0 {
        at.map(|x| x / sum)
    } else {
        [0.5 * map.width as f64, 0.5 * map.height as f64]
    }
}

/// Means of two pictures in rings about `center`, px.
fn rings(
    a: &RadianceMap,
    b: &RadianceMap,
    shared: &[Vec<SharedNoise>; 2],
    center: [f64; 2],
    mm_per_pixel: Option<f64>,
) -> Vec<RingDifference> {
    let far = [center[0], b.width as f64 - center[0]]
        .map(|x| x.hypot(center[1].max(b.height as f64 - center[1])));
    let far = far[0].max(far[1]).max(2.0);
    let edge = |k: usize| {
        if k == 0 {
            0.0
        } else {
            far.powf(k as f64 / RINGS as f64)
        }
    };
    let width = b.width;
    let ring_of = |pixel: usize| {
        let x = (pixel % width) as f64 + 0.5 - center[0];
        let y = (pixel / width) as f64 + 0.5 - center[1];
        let place = RINGS as f64 * x.hypot(y).max(1.0).ln() / far.ln();
        (place as usize).min(RINGS - 1)
    };
    let mut found = vec![];
    for (channel, (a, b)) in a.channels.iter().zip(&b.channels).enumerate() {
        // Pixels, first, second, variances of both.
        let mut sums = [[0.0; 5]; RINGS];
        for i in 0..b.value.len() {
            let sum = &mut sums[ring_of(i)];
            sum[0] += 1.0;
            sum[1] += f64::from(a.value[i]);
            sum[2] += f64::from(b.value[i]);
            sum[3] += f64::from(a.variance[i]);
            sum[4] += f64::from(b.variance[i]);
        }
        for (k, [n, first, second, alone @ ..]) in sums.into_iter().enumerate() {
            if n > 0.0 {
                let factor = |noise: &Vec<SharedNoise>| {
                    let of_channel = noise.get(channel);
                    of_channel.map_or(1.0, |noise| noise.factor(n))
                };
                let variance = alone[0] * factor(&shared[0]) + alone[1] * factor(&shared[1]);
                let radius_px = [edge(k), edge(k + 1)];
                found.push(RingDifference {
                    channel: a.name.clone(),
                    radius_px,
                    radius_mm: mm_per_pixel.map(|mm| radius_px.map(|r| mm * r)),
                    mean: [first / n, second / n],
                    z: in_u(first - second, variance.sqrt()),
                });
            }
        }
    }
    found
}

/// The `NAME.json` beside a picture: nothing where it was made by another program, or a camera.
fn beside_picture(path: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(path.with_extension("json")).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or_default()
}

/// What neighbours share in each channel of a picture.
fn shared_noise(all: &serde_json::Value, map: &RadianceMap) -> Vec<SharedNoise> {
    let numbers = |list: &serde_json::Value| -> Vec<f64> {
        let list = list.as_array().map_or(&[][..], Vec::as_slice);
        list.iter().filter_map(serde_json::Value::as_f64).collect()
    };
    let lines = all["shared_noise"].as_array();
    let of_channel = |channel: &ChannelMap| {
        let own = |line: &&serde_json::Value| line["channel"] == channel.name.as_str();
        let line = lines.and_then(|all| all.iter().find(own));
        let factors = line.map_or_else(Vec::new, |line| {
            let pixels = numbers(&line["pixels"]);
            pixels
                .into_iter()
                .zip(numbers(&line["variance_factor"]))
                .collect()
        });
        SharedNoise { factors }
    };
    map.channels.iter().map(of_channel).collect()
}

/// Powers through faces that both pictures have beside them.
fn faces([a, b]: &[serde_json::Value; 2]) -> Vec<FaceDifference> {
    let read = |all: &serde_json::Value| -> Vec<(String, f64, f64)> {
        let lines = all["faces"].as_array().cloned().unwrap_or_default();
        let line = |line: &serde_json::Value| {
            let name = |key: &str| line[key].as_str();
            let of = format!("{} {} {}", name("object")?, name("face")?, name("channel")?);
            let power = &line["power"];
            Some((of, power["value"].as_f64()?, power["u"].as_f64()?))
        };
        lines.iter().filter_map(line).collect()
    };
    let second = read(b);
    let both = read(a).into_iter().filter_map(|(of, x, u)| {
        let (_, y, v) = second.iter().find(|(name, ..)| *name == of)?;
        Some(FaceDifference {
            of,
            power: [x, *y],
            z: in_u(x - y, u.hypot(*v)),
        })
    });
    both.collect()
}

/// Reads two pictures, as `render`, `hdr` and `measure` write them, and the side of a pixel of the
/// second, mm, where it has one.
///
/// # Errors
///
/// One cannot be read, or they differ in size or channels.
pub fn read_pictures(a: &Path, b: &Path) -> Result<([RadianceMap; 2], Option<f64>)> {
    let read = |path: &Path| -> Result<(RadianceMap, Option<f64>)> {
        let file = read_radiance(open(path)?).input(path.display())?;
        Ok((file.map.into_owned(), file.mm_per_pixel))
    };
    let ((a_map, _), (b_map, mm_per_pixel)) = (read(a)?, read(b)?);
    let maps = [a_map, b_map];
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
    Ok((maps, mm_per_pixel))
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

/// Mean of HDR-FLIP over the pixels, and its picture.
pub(super) fn flip(test: &RadianceMap, reference: &RadianceMap) -> (f64, Frame) {
    let map = hdr_flip(test, reference);
    let mean = map.iter().sum::<f64>() / map.len() as f64;
    (mean, flip_frame(&map, reference.width))
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
    let samples: Vec<u16> = difference
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
        samples: samples.into(),
    };
    (frame, full)
}

/// Means over the rings of two pictures, and the difference, by channel.
fn rings_chart(found: &PictureDifference) -> Chart {
    let in_mm = found.rings.iter().all(|ring| ring.radius_mm.is_some());
    let x = if in_mm { "radius (mm)" } else { "radius (px)" };
    let of_channel = |channel: &ChannelDifference| {
        let rings = found.rings.iter().filter(|r| r.channel == channel.channel);
        let rings = rings.map(|ring| {
            let [low, high] = ring.radius_mm.unwrap_or(ring.radius_px);
            (0.5 * (low + high), ring.mean)
        });
        Series {
            name: channel.channel.clone(),
            points: rings.collect(),
        }
    };
    let series: Vec<Series> = found.channels.iter().map(of_channel).collect();
    let title = "Two pictures, in rings";
    beside(title, x, "mean radiance", &series, Stroke::Full)
}

/// What a comparison of pictures has drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// The difference that has the full colour in the picture.
    pub full: f64,
    /// The files: the difference, the rings and, where there is one, HDR-FLIP.
    pub files: Vec<PathBuf>,
}

/// Compares two pictures and, where `picture` is given, draws their difference there, and beside it
/// the rings as `NAME.svg` and HDR-FLIP as `NAME-flip.png`.
///
/// # Errors
///
/// As [`read_pictures`]; a file exists, or cannot be written; the name does not end in `.png`.
pub fn compare_pictures(
    a: &Path,
    b: &Path,
    picture: Option<&Path>,
    force: bool,
) -> Result<(PictureDifference, Option<Drawn>)> {
    let ([first, second], mm_per_pixel) = read_pictures(a, b)?;
    let center_px = center(&second);
    let beside = [a, b].map(beside_picture);
    let shared = [
        shared_noise(&beside[0], &first),
        shared_noise(&beside[1], &second),
    ];
    let shown = matches!(first.channels.len(), 1 | 3);
    let flip = shown.then(|| flip(&first, &second));
    let found = PictureDifference {
        schema_version: SCHEMA_VERSION,
        channels: differences(&first, &second),
        flip: flip.as_ref().map(|(mean, _)| *mean),
        center_px,
        rings: rings(&first, &second, &shared, center_px, mm_per_pixel),
        faces: faces(&beside),
    };
    let Some(picture) = picture else {
        return Ok((found, None));
    };
    let (folder, name) = split(picture)?;
    if name.extension().is_none_or(|e| e != "png") {
        let message = format!("{}: expected a name that ends in .png", picture.display());
        return Err(Error::new(Kind::Usage, message));
    }
    let flip = flip.map(|(_, frame)| {
        let stem = name.file_stem().unwrap_or_default().to_string_lossy();
        (PathBuf::from(format!("{stem}-flip.png")), frame)
    });
    let plot = name.with_extension("svg");
    let names: Vec<PathBuf> = [name.clone(), plot.clone()]
        .into_iter()
        .chain(flip.as_ref().map(|(name, _)| name.clone()))
        .collect();
    let inputs = [a.to_owned(), b.to_owned()];
    let files = Outputs::new(&folder, &names, &inputs, force)?;
    let (frame, full) = difference_frame(&first, &second);
    files.write(&name, |out| Ok(encode_png(&frame, out)?))?;
    files.write(&plot, |out| {
        Ok(out.write_all(chart_svg(&rings_chart(&found)).as_bytes())?)
    })?;
    if let Some((name, frame)) = &flip {
        files.write(name, |out| Ok(encode_png(frame, out)?))?;
    }
    files.commit()?;
    let files = names.iter().map(|name| folder.join(name)).collect();
    Ok((found, Some(Drawn { full, files })))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

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

    /// Rings about the light: what is brighter in one of them alone is found there.
    #[test]
    fn rings_are_about_the_light() {
        let spot = |i: usize| if i == 8 * 3 + 5 { 1.0 } else { 0.0 };
        let b = map(spot);
        assert_eq!(center(&b), [5.5, 3.5]);
        let a = map(|i| spot(i) + if i == 8 * 5 + 7 { 0.5 } else { 0.0 });
        let found = rings(&a, &b, &[vec![], vec![]], [5.5, 3.5], Some(0.1));
        let off: Vec<_> = found.iter().filter(|r| r.mean[0] != r.mean[1]).collect();
        let [ring] = off[..] else { panic!("{found:?}") };
        // √(2² + 2²) pixels away, which is no last ring.
        assert!(ring.radius_px[0] <= 8.0_f64.sqrt() && 8.0_f64.sqrt() <= ring.radius_px[1]);
        let pixels = 0.5 / (ring.mean[0] - ring.mean[1]);
        let z = 0.5 / (pixels * 0.02).sqrt();
        assert!((ring.z.unwrap() / z - 1.0).abs() < 1e-3, "{ring:?}");
        assert!((ring.radius_mm.unwrap()[1] - 0.1 * ring.radius_px[1]).abs() < 1e-12);
        // Where neighbours of the first share noise, its sum is known less well.
        let line = json!({"channel": "Y", "pixels": [1.0, 64.0], "variance_factor": [7.0, 7.0]});
        let beside = json!({ "shared_noise": [line] });
        let shared = [&beside, &json!(null)].map(|beside| shared_noise(beside, &a));
        let found = rings(&a, &b, &shared, [5.5, 3.5], Some(0.1));
        let less = found.iter().find(|r| r.mean[0] != r.mean[1]).unwrap();
        assert!(
            (ring.z.unwrap() / less.z.unwrap() - 2.0).abs() < 1e-6,
            "{less:?}"
        );
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

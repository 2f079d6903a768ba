//! HDR-FLIP: how different two pictures look when one is flipped to the other on a screen.
//!
//! # Source
//!
//! Andersson et al. (2020), *FLIP: A Difference Evaluator for Alternating Images*, for one exposure, and
//! Andersson et al. (2021), *Visualizing Errors in Rendered High Dynamic Range Images*, for all: the largest
//! over exposures from the brightest pixel of the reference to its median.

use physics::{Frame, RadianceMap};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Pixels in a degree of the eye: a screen of 3840 pixels and 0.7 m seen from 0.7 m.
const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;
/// Exponents of the colour and of the feature difference.
const COLOR_POWER: f64 = 0.7;
const FEATURE_POWER: f64 = 0.5;
/// Distances below this share of the largest go to values below [`KNEE_VALUE`].
const KNEE: f64 = 0.4;
const KNEE_VALUE: f64 = 0.95;
/// White point of D65.
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];
/// Linear sRGB to XYZ.
const TO_XYZ: [[f64; 3]; 3] = [
    [
        10_135_552.0 / 24_577_794.0,
        8_788_810.0 / 24_577_794.0,
        4_435_075.0 / 24_577_794.0,
    ],
    [
        2_613_072.0 / 12_288_897.0,
        8_788_810.0 / 12_288_897.0,
        887_015.0 / 12_288_897.0,
    ],
    [
        1_425_312.0 / 73_733_382.0,
        8_788_810.0 / 73_733_382.0,
        70_074_185.0 / 73_733_382.0,
    ],
];
/// And back.
const FROM_XYZ: [[f64; 3]; 3] = [
    [3.241_003_275, -1.537_398_934, -0.498_615_861],
    [-0.969_224_334, 1.875_930_071, 0.041_554_224],
    [0.055_639_423, -0.204_011_202, 1.057_148_933],
];

type Color = [f64; 3];

fn times(matrix: &[[f64; 3]; 3], color: Color) -> Color {
    matrix.map(|row| row[0] * color[0] + row[1] * color[1] + row[2] * color[2])
}

/// The filmic curve, as Narkowicz's fit of ACES has it, with its exposure taken back.
const CURVE: [f64; 5] = [0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14];

fn tone(x: f64) -> f64 {
    let [a, b, c, d, e] = CURVE;
    let x = x.clamp(0.0, 1e12);
    ((a * x + b) * x / ((c * x + d) * x + e)).clamp(0.0, 1.0)
}

/// Light that the curve shows as 0.85.
fn bright() -> f64 {
    let [a, b, c, d, e] = CURVE;
    let t = 0.85;
    let half = 0.5 * (b - d * t) / (a - c * t);
    -half + (half * half + e * t / (a - c * t)).sqrt()
}

/// A picture in a space of luminance and two opponent colours, linear in light.
struct Opponent {
    width: usize,
    planes: [Vec<f64>; 3],
}

/// An even kernel along a row and a column, from the middle out on both sides.
fn filtered(plane: &[f64], width: usize, along: &[f64], down: &[f64]) -> Vec<f64> {
    let height = plane.len() / width;
    let reach = (along.len() / 2) as isize;
    let near = |at: isize, count: usize| at.clamp(0, count as isize - 1) as usize;
    let mut rows = vec![0.0; plane.len()];
    for (line, out) in plane.chunks(width).zip(rows.chunks_mut(width)) {
        for (x, out) in out.iter_mut().enumerate() {
            let weights = along.iter().zip(-reach..);
            *out = weights
                .map(|(w, k)| w * line[near(x as isize + k, width)])
                .sum();
        }
    }
    let mut all = vec![0.0; plane.len()];
    for (y, out) in all.chunks_mut(width).enumerate() {
        for (w, k) in down.iter().zip(-reach..) {
            let row = near(y as isize + k, height) * width;
            for (out, x) in out.iter_mut().zip(&rows[row..row + width]) {
                *out += w * x;
            }
        }
    }
    all
}

/// Sensitivity of the eye to contrast: Gaussians of amplitude and width in the frequency, for
/// luminance, red and green, blue and yellow.
const SENSITIVITY: [&[(f64, f64)]; 3] = [
    &[(1.0, 0.0047)],
    &[(1.0, 0.0053)],
    &[(34.1, 0.04), (13.5, 0.025)],
];

fn sensed(plane: &[f64], width: usize, channel: usize) -> Vec<f64> {
    // As far as the widest of all reaches.
    let reach = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let part = |&(a, b): &(f64, f64)| {
        let line: Vec<f64> = (-reach..=reach)
            .map(|k| (-(PI * f64::from(k) / PIXELS_PER_DEGREE).powi(2) / b).exp())
            .collect();
        let sum: f64 = line.iter().sum();
        (a * (PI / b).sqrt() * sum * sum, line, sum)
    };
    let parts: Vec<_> = SENSITIVITY[channel].iter().map(part).collect();
    let all: f64 = parts.iter().map(|(weight, ..)| weight).sum();
    let mut out = vec![0.0; plane.len()];
    for (weight, line, sum) in parts {
        let line: Vec<f64> = line.iter().map(|x| x / sum).collect();
        let smooth = filtered(plane, width, &line, &line);
        for (out, x) in out.iter_mut().zip(smooth) {
            *out += weight / all * x;
        }
    }
    out
}

impl Opponent {
    /// The picture through the filmic curve at a factor on its light.
    fn new(map: &RadianceMap, factor: f64) -> Self {
        let mut planes = [vec![], vec![], vec![]];
        for pixel in 0..map.width * map.height {
            let shown = light(map, pixel).map(|x| tone(factor * x));
            let xyz = times(&TO_XYZ, shown);
            let [x, y, z] = [0, 1, 2].map(|k| xyz[k] / WHITE[k]);
            let color = [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)];
            for (plane, value) in planes.iter_mut().zip(color) {
                plane.push(value);
            }
        }
        Self {
            width: map.width,
            planes,
        }
    }

    /// Colours as the eye can tell them apart, in Hunt's correction of L*a*b*.
    fn colors(&self) -> Vec<Color> {
        let planes = [0, 1, 2].map(|k| sensed(&self.planes[k], self.width, k));
        (0..planes[0].len())
            .map(|pixel| {
                let [luminance, a, b] = [0, 1, 2].map(|k| planes[k][pixel]);
                let y = (luminance + 16.0) / 116.0;
                let xyz = [
                    (y + a / 500.0) * WHITE[0],
                    y * WHITE[1],
                    (y - b / 200.0) * WHITE[2],
                ];
                hunt(times(&FROM_XYZ, xyz).map(|x| x.clamp(0.0, 1.0)))
            })
            .collect()
    }

    /// Strength of edges and of points.
    fn features(&self) -> [Vec<f64>; 2] {
        let luminance: Vec<f64> = self.planes[0].iter().map(|y| (y + 16.0) / 116.0).collect();
        let sd = 0.5 * 0.082 * PIXELS_PER_DEGREE;
        let reach = (3.0 * sd).ceil() as i32;
        let gauss = |k: i32| (-f64::from(k * k) / (2.0 * sd * sd)).exp();
        let across: Vec<f64> = (-reach..=reach).map(gauss).collect();
        let sum: f64 = across.iter().sum();
        let across: Vec<f64> = across.iter().map(|x| x / sum).collect();
        let slope = |k: i32| -f64::from(k) * gauss(k);
        let bend = |k: i32| (f64::from(k * k) / (sd * sd) - 1.0) * gauss(k);
        let of = |shape: &dyn Fn(i32) -> f64| {
            let line: Vec<f64> = (-reach..=reach).map(shape).collect();
            let up: f64 = line.iter().filter(|x| **x > 0.0).sum();
            let down: f64 = -line.iter().filter(|x| **x < 0.0).sum::<f64>();
            let line: Vec<f64> = line
                .iter()
                .map(|x| if *x < 0.0 { x / down } else { x / up })
                .collect();
            let along = filtered(&luminance, self.width, &line, &across);
            let down = filtered(&luminance, self.width, &across, &line);
            let both = along.into_iter().zip(down);
            both.map(|(x, y)| x.hypot(y)).collect()
        };
        [of(&slope), of(&bend)]
    }
}

/// L*a*b* of linear sRGB, with colours that are the weaker the darker they are.
fn hunt(linear: Color) -> Color {
    let xyz = times(&TO_XYZ, linear);
    let f = |k: usize| {
        let t = xyz[k] / WHITE[k];
        let delta = 6.0 / 29.0_f64;
        if t > delta.powi(3) {
            t.cbrt()
        } else {
            t / (3.0 * delta * delta) + 4.0 / 29.0
        }
    };
    let [x, y, z] = [f(0), f(1), f(2)];
    let l = 116.0 * y - 16.0;
    [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
}

/// Distance of colours, as HyAB has it, to the power.
fn apart(a: Color, b: Color) -> f64 {
    let across = (a[1] - b[1]).hypot(a[2] - b[2]);
    ((a[0] - b[0]).abs() + across).powf(COLOR_POWER)
}

/// R, G and B of a pixel; the first channel where there are not three.
fn light(map: &RadianceMap, pixel: usize) -> Color {
    let of = |k: usize| f64::from(map.channels[k].value[pixel]).max(0.0);
    if map.channels.len() == 3 {
        [of(0), of(1), of(2)]
    } else {
        [of(0); 3]
    }
}

/// FLIP of every pixel at one exposure.
fn at_exposure(test: &RadianceMap, reference: &RadianceMap, factor: f64) -> Vec<f64> {
    let [test, reference] = [test, reference].map(|map| Opponent::new(map, factor));
    let largest = apart(hunt([0.0, 1.0, 0.0]), hunt([0.0, 0.0, 1.0]));
    let knee = KNEE * largest;
    let colors = test.colors().into_iter().zip(reference.colors());
    let colors = colors.map(|(a, b)| {
        let e = apart(a, b);
        if e < knee {
            KNEE_VALUE / knee * e
        } else {
            KNEE_VALUE + (e - knee) / (largest - knee) * (1.0 - KNEE_VALUE)
        }
    });
    let [a, b] = [test.features(), reference.features()];
    colors
        .enumerate()
        .map(|(pixel, color)| {
            let differ = |k: usize| (a[k][pixel] - b[k][pixel]).abs();
            let feature = (differ(0).max(differ(1)) / 2.0_f64.sqrt()).powf(FEATURE_POWER);
            color.powf(1.0 - feature).clamp(0.0, 1.0)
        })
        .collect()
}

/// FLIP of every pixel, 0 to 1: the largest over all exposures that show the reference.
///
/// Pictures of three channels are R, G and B; of others the first is shown in gray. The median
/// is that of the pixels with light where more than half have none.
pub fn hdr_flip(test: &RadianceMap, reference: &RadianceMap) -> Vec<f64> {
    let pixels = reference.width * reference.height;
    let mut luminance: Vec<f64> = (0..pixels)
        .map(|pixel| {
            let [r, g, b] = light(reference, pixel);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        })
        .collect();
    luminance.sort_by(f64::total_cmp);
    let dark = luminance.partition_point(|y| *y <= 0.0);
    let Some(most) = luminance.last().copied().filter(|y| *y > 0.0) else {
        // Nothing to expose for.
        return at_exposure(test, reference, 1.0);
    };
    let middle = |list: &[f64]| {
        let half = list.len() / 2;
        if list.len() % 2 == 1 || half == 0 {
            list[half]
        } else {
            0.5 * (list[half - 1] + list[half])
        }
    };
    let half = match middle(&luminance) {
        0.0 => middle(&luminance[dark..]),
        y => y,
    };
    let (start, stop) = ((bright() / most).log2(), (bright() / half).log2());
    let count = (stop - start).ceil().max(2.0) as usize;
    let step = (stop - start) / (count - 1) as f64;
    let maps: Vec<Vec<f64>> = (0..count)
        .into_par_iter()
        .map(|k| at_exposure(test, reference, (start + k as f64 * step).exp2()))
        .collect();
    (0..pixels)
        .map(|pixel| maps.iter().map(|map| map[pixel]).fold(0.0, f64::max))
        .collect()
}

/// FLIP of every pixel as a picture: from 0, black, through purple and red to 1, pale yellow, even in
/// lightness.
pub(super) fn flip_frame(flip: &[f64], width: usize) -> Frame {
    const COLORS: [[f64; 3]; 5] = [
        [0.0, 0.0, 0.02],
        [0.31, 0.07, 0.49],
        [0.72, 0.21, 0.47],
        [0.99, 0.53, 0.38],
        [0.99, 0.99, 0.75],
    ];
    let color = |value: &f64| {
        let place = value.clamp(0.0, 1.0) * (COLORS.len() - 1) as f64;
        let low = (place as usize).min(COLORS.len() - 2);
        let part = place - low as f64;
        [0, 1, 2].map(|k| {
            let shown = COLORS[low][k] + part * (COLORS[low + 1][k] - COLORS[low][k]);
            (shown * f64::from(u16::MAX)).round() as u16
        })
    };
    let samples: Vec<u16> = flip.iter().flat_map(color).collect();
    Frame {
        width,
        height: flip.len() / width,
        channels: 3,
        samples: samples.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::ChannelMap;

    const SIZE: (usize, usize) = (64, 48);

    fn map(of: impl Fn(usize, f64, f64) -> f64) -> RadianceMap {
        let channel = |k: usize| {
            let pixels = 0..SIZE.0 * SIZE.1;
            let value = pixels.map(|i| of(k, (i % SIZE.0) as f64, (i / SIZE.0) as f64) as f32);
            ChannelMap {
                name: ["R", "G", "B"][k].into(),
                value: value.collect(),
                variance: vec![0.0; SIZE.0 * SIZE.1],
            }
        };
        RadianceMap {
            width: SIZE.0,
            height: SIZE.1,
            channels: (0..3).map(channel).collect(),
            mosaic: None,
        }
    }

    fn reference(k: usize, x: f64, y: f64) -> f64 {
        let spot = |a: f64, b: f64, s: f64| (-((x - a).powi(2) + (y - b).powi(2)) / s).exp();
        match k {
            0 => 0.02 + 3.0 * spot(20.0, 24.0, 40.0) + if x > 40.0 { 0.3 } else { 0.0 },
            1 => 0.05 + 1.5 * spot(24.0, 20.0, 90.0) + if y > 30.0 { 0.2 } else { 0.0 },
            _ => 0.08 + 0.01 * x,
        }
    }

    fn test(k: usize, x: f64, y: f64) -> f64 {
        let red = if k == 0 { 1.15 } else { 1.0 };
        let within = (10.0..14.0).contains(&y) && (50.0..54.0).contains(&x);
        let board = k == 2 && (x + y) % 2.0 == 1.0;
        red * reference(k, x, y) + if within { 0.5 } else { 0.0 } + if board { 0.02 } else { 0.0 }
    }

    /// Against flip-evaluator 1.7 (PyPI, of the papers' authors) on the same pictures, which it
    /// has in single precision.
    #[test]
    fn it_is_that_of_the_papers() {
        let (test, reference) = (map(test), map(reference));
        let found = hdr_flip(&test, &reference);
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        assert!((mean - 0.138_063).abs() < 1e-5, "{mean}");
        for (y, x, expected) in [
            (24, 20, 0.075_389),
            (12, 52, 0.976_633),
            (5, 5, 0.122_638),
            (40, 45, 0.142_500),
            (24, 40, 0.094_608),
            (0, 63, 0.136_116),
        ] {
            let found = found[y * SIZE.0 + x];
            assert!((found - expected).abs() < 1e-5, "{x}, {y}: {found}");
        }
        assert!(hdr_flip(&reference, &reference).iter().all(|f| *f == 0.0));
    }

    /// The more different, the lighter.
    #[test]
    fn the_colours_of_a_picture_of_it_rise() {
        let frame = flip_frame(&[0.0, 0.2, 0.4, 0.6, 0.8, 1.0], 3);
        assert_eq!((frame.width, frame.height), (3, 2));
        let light: Vec<f32> = frame
            .samples
            .to_f32()
            .chunks(3)
            .map(|c| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2])
            .collect();
        assert!(
            light.is_sorted() && light[0] < 1e3 && light[5] > 6e4,
            "{light:?}"
        );
    }

    /// A black background has no exposure: the spot alone has.
    #[test]
    fn darkness_is_not_exposed_for() {
        let spot = |x: f64, y: f64| if x.hypot(y) < 9.0 { 1.0 } else { 0.0 };
        let (a, b) = (map(|_, x, y| 2.0 * spot(x, y)), map(|_, x, y| spot(x, y)));
        let found = hdr_flip(&a, &b);
        assert!(found.iter().all(|f| f.is_finite()));
        assert!(found[0] > 0.05 && found[SIZE.0 * SIZE.1 - 1] == 0.0);
        let black = map(|_, _, _| 0.0);
        assert!(hdr_flip(&black, &black).iter().all(|f| *f == 0.0));
    }
}

//! A merge against a sensor that is simulated electron by electron.

use super::*;
use physics::Samples;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal, Poisson, StandardNormal};
use rand_pcg::Pcg64Mcg;

const SENSOR: Sensor = Sensor {
    gain_e_per_dn: 0.5,
    read_noise_e: 3.0,
    black_level_dn: 300.0,
    white_level_dn: 60_000.0,
    prnu_relative: 0.0,
};

/// Thirteen exposures from 1 ms to 4 s, as a laboratory takes them.
fn exposures() -> Vec<f64> {
    (0..13)
        .map(|k| 1e-3 * 4000_f64.powf(f64::from(k) / 12.0))
        .collect()
}

fn poisson(mean: f64, rng: &mut Pcg64Mcg) -> f64 {
    if mean <= 0.0 {
        0.0
    } else if mean > 2000.0 {
        // The skewness that a Gaussian lacks is below 0.023 and shifts no mean.
        Normal::new(mean, mean.sqrt()).unwrap().sample(rng).max(0.0)
    } else {
        Poisson::new(mean).unwrap().sample(rng)
    }
}

/// One exposure of `radiance` (DN/s) with `dark_current` (electrons per second).
fn expose(
    sensor: &Sensor,
    (width, height): (usize, usize),
    radiance: impl Fn(usize) -> f64,
    dark_current: impl Fn(usize) -> f64,
    exposure_s: f64,
    rng: &mut Pcg64Mcg,
) -> Frame {
    let gain = sensor.gain_e_per_dn;
    let samples: Vec<u16> = (0..width * height)
        .map(|i| {
            let light = radiance(i) * gain * exposure_s;
            let electrons = poisson(light, rng)
                + poisson(dark_current(i) * exposure_s, rng)
                + sensor.read_noise_e * rng.sample::<f64, _>(StandardNormal);
            let dn = sensor.black_level_dn + electrons / gain;
            dn.round().clamp(0.0, sensor.white_level_dn) as u16
        })
        .collect();
    Frame {
        width,
        height,
        channels: 1,
        samples: samples.into(),
    }
}

fn simulate(
    sensor: &Sensor,
    size: (usize, usize),
    radiance: impl Fn(usize) -> f64,
    dark_current: impl Fn(usize) -> f64,
    darks: usize,
    seed: u64,
) -> (ChannelMap, MergeReport) {
    let rng = &mut Pcg64Mcg::seed_from_u64(seed);
    let mut merge = Merge::new(size.0, size.1, 1, sensor).unwrap();
    for t in exposures() {
        let none = |_| 0.0;
        let first = expose(sensor, size, none, &dark_current, t, rng);
        let mut dark = DarkFrame::new(&first, t).unwrap();
        for _ in 1..darks {
            dark.add(&expose(sensor, size, none, &dark_current, t, rng))
                .unwrap();
        }
        let frame = expose(sensor, size, &radiance, &dark_current, t, rng);
        merge.add(&frame, &dark, t).unwrap();
    }
    let (mut map, report) = merge.finish().unwrap();
    (map.channels.pop().unwrap(), report)
}

/// Mean of the relative error and its standard error, mean square of the normalised residual.
fn statistics(map: &ChannelMap, truth: impl Fn(usize) -> f64) -> (f64, f64, f64) {
    let (mut n, mut error, mut square, mut z) = (0.0, 0.0, 0.0, 0.0);
    for (i, (v, variance)) in map.value.iter().zip(&map.variance).enumerate() {
        if variance.is_finite() {
            let d = f64::from(*v) - truth(i);
            let relative = d / truth(i);
            n += 1.0;
            error += relative;
            square += relative * relative;
            z += d * d / f64::from(*variance);
        }
    }
    (error / n, square.sqrt() / n, z / n)
}

/// The radiance that fills the range in the shortest exposure, DN/s.
fn full() -> f64 {
    (SENSOR.white_level_dn - SENSOR.black_level_dn) / 1e-3
}

#[test]
fn unbiased_with_a_true_variance_over_five_decades() {
    let side = 300;
    for step in 0..11 {
        let radiance = 0.8 * full() * 10_f64.powf(-0.5 * f64::from(step));
        let (map, _) = simulate(
            &SENSOR,
            (side, side),
            |_| radiance,
            |_| 4.0,
            1,
            40 + step as u64,
        );
        let (bias, standard_error, z) = statistics(&map, |_| radiance);
        println!("{radiance:9.3e} DN/s: bias {bias:+.1e} ± {standard_error:.0e}, z² {z:.4}");
        assert!(
            bias.abs() < 4.0 * standard_error,
            "{radiance}: bias {bias} ± {standard_error}"
        );
        // Of 90,000 squares the mean has a standard error of 0.5 %.
        assert!((z - 1.0).abs() < 0.03, "{radiance}: {z}");
    }
}

#[test]
fn unbiased_where_a_frame_is_just_dropped() {
    // Radiances whose sample in one of the frames is within a percent of the limit of the
    // prediction and of white: there a selection by the sample's own noise would show.
    let side = 400;
    let t = exposures();
    for (k, seed) in [(3, 1), (8, 2)] {
        for level in [0.885, 0.897, 0.9, 0.903, 0.915, 0.957, 0.96, 0.997, 1.0] {
            let radiance = level * full() * t[0] / t[k];
            let (map, report) = simulate(&SENSOR, (side, side), |_| radiance, |_| 4.0, 1, seed);
            let (bias, standard_error, z) = statistics(&map, |_| radiance);
            let used = report.frames[k].used[0] as f64 / (side * side) as f64;
            println!("frame {k} at {level}: used {used:.3}, {bias:+.1e} ± {standard_error:.0e}");
            assert!(standard_error < 3e-5, "{standard_error}");
            assert!(
                bias.abs() < 4.0 * standard_error,
                "frame {k} at {level}: bias {bias} ± {standard_error}"
            );
            assert!((z - 1.0).abs() < 0.03, "frame {k} at {level}: {z}");
        }
    }
}

#[test]
fn darkness_keeps_its_negatives_and_its_mean() {
    let (map, _) = simulate(&SENSOR, (400, 400), |_| 0.0, |_| 4.0, 3, 7);
    let n = map.value.len() as f64;
    let mean = map.value.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
    let variance = map.variance.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
    let square = map.value.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / n;
    let negative = map.value.iter().filter(|v| **v < 0.0).count() as f64 / n;
    assert!(mean.abs() < 4.0 * (variance / n).sqrt(), "{mean}");
    assert!(
        (square / variance - 1.0).abs() < 0.02,
        "{square} {variance}"
    );
    assert!((negative - 0.5).abs() < 0.01, "{negative}");
}

#[test]
fn uneven_sensitivity_does_not_average_down() {
    let sensor = Sensor {
        prnu_relative: 0.01,
        ..SENSOR
    };
    let rng = &mut Pcg64Mcg::seed_from_u64(3);
    let sensitivity: Vec<f64> = (0..250 * 250)
        .map(|_| 1.0 + 0.01 * rng.sample::<f64, _>(StandardNormal))
        .collect();
    let radiance = 0.01 * full();
    let seen = |i: usize| radiance * sensitivity[i];
    let (map, _) = simulate(&sensor, (250, 250), seen, |_| 4.0, 1, 8);
    let (_, _, z) = statistics(&map, |_| radiance);
    assert!((z - 1.0).abs() < 0.03, "{z}");
}

#[test]
fn warm_pixels_are_noisier_and_a_fixed_pattern_is_not() {
    // Every tenth pixel has three times the dark current: 64 DN more, or five deviations, at 4 s.
    // Offsets that stay the same, here 6 DN, leave with the dark and have no noise.
    let side = 400;
    let warm = |i: usize| i.is_multiple_of(10);
    let rng = &mut Pcg64Mcg::seed_from_u64(5);
    let offset: Vec<f64> = (0..side * side)
        .map(|_| 6.0 * rng.sample::<f64, _>(StandardNormal))
        .collect();
    let radiance = 40.0;
    let mut merge = Merge::new(side, side, 1, &SENSOR).unwrap();
    for t in exposures() {
        // The pattern counts as light that needs no time, so it has no part in the noise.
        let mut shot = |light: f64| {
            let current = |i: usize| if warm(i) { 12.0 } else { 4.0 };
            let mut frame = expose(&SENSOR, (side, side), |_| light, current, t, rng);
            if let physics::Samples::U16(samples) = &mut frame.samples {
                for (sample, offset) in samples.iter_mut().zip(&offset) {
                    *sample = (f64::from(*sample) + offset.round()) as u16;
                }
            }
            frame
        };
        let dark = DarkFrame::new(&shot(0.0), t).unwrap();
        merge.add(&shot(radiance), &dark, t).unwrap();
    }
    let (map, _) = merge.finish().unwrap();
    let map = &map.channels[0];
    for (name, of_class, tolerance) in [("warm", true, 0.05), ("ordinary", false, 0.03)] {
        let (mut n, mut z) = (0.0, 0.0);
        for i in (0..side * side).filter(|i| warm(*i) == of_class) {
            if map.variance[i].is_finite() {
                n += 1.0;
                z += (f64::from(map.value[i]) - radiance).powi(2) / f64::from(map.variance[i]);
            }
        }
        println!("{name}: z² {:.4} of {n}", z / n);
        // 16,000 and 144,000 squares: 1.1 and 0.4 % of standard error; one in twenty of the warm
        // ones does not stand out in a single dark and is taken for ordinary.
        assert!((z / n - 1.0).abs() < tolerance, "{name}: {}", z / n);
    }
}

#[test]
fn hot_pixels_are_not_measured() {
    let side = 200;
    let hot = |i: usize| i % 5003 == 11;
    let current = |i: usize| if hot(i) { 2000.0 } else { 4.0 };
    let (map, report) = simulate(&SENSOR, (side, side), |_| 1e4, current, 1, 9);
    let masked: Vec<usize> = (0..side * side)
        .filter(|i| map.variance[*i].is_infinite())
        .collect();
    assert_eq!(
        masked,
        (0..side * side).filter(|i| hot(*i)).collect::<Vec<_>>()
    );
    assert!(masked.iter().all(|i| map.value[*i] == 0.0));
    assert_eq!(
        report.channels,
        [ChannelReport {
            hot: 8,
            dead: 0,
            saturated_everywhere: 0
        }]
    );
}

/// Rounds to whole DN are exact here, so that a tiny case can be done by hand.
fn tiny(samples: &[u16]) -> Frame {
    Frame {
        width: samples.len(),
        height: 1,
        channels: 1,
        samples: samples.to_vec().into(),
    }
}

#[test]
fn a_tiny_case_by_hand() {
    let sensor = Sensor {
        gain_e_per_dn: 2.0,
        read_noise_e: 4.0,
        black_level_dn: 100.0,
        white_level_dn: 1000.0,
        prnu_relative: 0.1,
    };
    let mut merge = Merge::new(3, 1, 1, &sensor).unwrap();
    let dark = |t| DarkFrame::new(&tiny(&[100, 102, 104]), t).unwrap();
    merge.add(&tiny(&[150, 90, 1000]), &dark(1.0), 1.0).unwrap();
    merge.add(&tiny(&[306, 105, 999]), &dark(4.0), 4.0).unwrap();
    let (map, report) = merge.finish().unwrap();
    let map = &map.channels[0];
    assert_eq!(map.name, "Y");
    // The last pixel was saturated in the first frame, where the one beside it may have more than
    // its own; and none of its neighbours lets expect it to be in the second, so that the one good
    // sample of each counts.
    let values = [(50.0 + 206.0) / 5.0, 3.0 / 4.0, 895.0 / 4.0];
    for (got, expected) in map.value.iter().zip(values) {
        assert!((got - expected).abs() < 1e-4, "{got} for {expected}");
    }
    // Two frames and two darks of (4/2)² + 1/12 each, one electron per half DN, squared time. The
    // ordinary dark is 102 DN after 4 s, half a DN per second, over 5 s of frames and as many of
    // darks.
    let read = 4.0 + 1.0 / 12.0;
    let charge = 0.5 * 10.0;
    let first = (4.0 * read + (256.0 + charge) / 2.0) / 25.0 + (0.1 * values[0]).powi(2);
    assert!(
        (map.variance[0] - first).abs() < 1e-4,
        "{}",
        map.variance[0]
    );
    let charge = 0.5 * 8.0;
    let last = (2.0 * read + (895.0 + charge) / 2.0) / 16.0 + (0.1 * values[2]).powi(2);
    assert!((map.variance[2] - last).abs() < 1e-2, "{}", map.variance[2]);
    assert_eq!(report.frames[0].used, [1]);
    assert_eq!(report.frames[0].saturated, [2]);
    assert_eq!(report.frames[1].used, [3]);
}

#[test]
fn three_channels_do_not_mix() {
    let sensor = Sensor {
        black_level_dn: 0.0,
        ..SENSOR
    };
    let frame = |scale: u16| Frame {
        width: 4,
        height: 3,
        channels: 3,
        samples: (0..36_u16)
            .map(|i| scale * (1 + i % 3) * 1000)
            .collect::<Vec<_>>()
            .into(),
    };
    let none = |t| {
        let mut dark = frame(1);
        dark.samples = vec![0; 36].into();
        DarkFrame::new(&dark, t).unwrap()
    };
    let mut merge = Merge::new(4, 3, 3, &sensor).unwrap();
    merge.add(&frame(1), &none(0.5), 0.5).unwrap();
    // Twenty times as long: only the first channel stays below 0.9 of white.
    merge.add(&frame(20), &none(10.0), 10.0).unwrap();
    let (map, report) = merge.finish().unwrap();
    for (channel, (name, value)) in
        map.channels
            .iter()
            .zip([("R", 2000.0), ("G", 4000.0), ("B", 6000.0)])
    {
        assert_eq!(channel.name, name);
        assert!(
            channel.value.iter().all(|v| (v - value).abs() < 1e-2),
            "{channel:?}"
        );
    }
    assert_eq!(report.frames[1].used, [12, 12, 0]);
    assert_eq!(report.frames[1].saturated, [0, 0, 12]);
}

#[test]
fn each_bad_input_is_named() {
    let dark = |t| DarkFrame::new(&tiny(&[300; 4]), t).unwrap();
    let new = || Merge::new(4, 1, 1, &SENSOR).unwrap();
    let good = tiny(&[400; 4]);
    let mut merge = new();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            merge.add(&good, &dark(1.0), bad),
            Err(MergeError::Exposure(_))
        ));
    }
    assert_eq!(
        merge.add(&tiny(&[400; 5]), &dark(1.0), 1.0),
        Err(MergeError::Size {
            found: (5, 1, 1),
            expected: (4, 1, 1)
        })
    );
    let short = Frame {
        samples: vec![1; 3].into(),
        ..good.clone()
    };
    assert_eq!(
        merge.add(&short, &dark(1.0), 1.0),
        Err(MergeError::Samples {
            found: 3,
            expected: 4
        })
    );
    assert_eq!(
        merge.add(&good, &dark(1.0), 2.0),
        Err(MergeError::NoDark {
            exposure_s: 2.0,
            nearest_s: Some(1.0)
        })
    );
    merge.add(&good, &dark(2.0), 2.0).unwrap();
    assert_eq!(
        merge.add(&good, &dark(1.0), 1.0),
        Err(MergeError::Order {
            found_s: 1.0,
            previous_s: 2.0
        })
    );
    assert_eq!(new().finish().map(|_| ()), Err(MergeError::NoFrames));
    let mut white = new();
    white.add(&tiny(&[60_000; 4]), &dark(1.0), 1.0).unwrap();
    assert_eq!(
        white.finish().map(|_| ()),
        Err(MergeError::Saturated {
            channel: "Y",
            saturated: 4,
            pixels: 4
        })
    );
    let refused = |sensor: Sensor| Merge::new(4, 1, 1, &sensor).map(|_| ()).unwrap_err();
    let gain = Sensor {
        gain_e_per_dn: 0.0,
        ..SENSOR
    };
    assert_eq!(refused(gain), MergeError::Gain(0.0));
    let levels = Sensor {
        white_level_dn: 300.0,
        ..SENSOR
    };
    assert_eq!(
        refused(levels),
        MergeError::Levels {
            black: 300.0,
            white: 300.0
        }
    );
    assert_eq!(
        Merge::new(0, 1, 1, &SENSOR).map(|_| ()).unwrap_err(),
        MergeError::EmptyFrame(0, 1, 1)
    );
    assert_eq!(
        Merge::new(4, 1, 2, &SENSOR).map(|_| ()).unwrap_err(),
        MergeError::Channels(2)
    );
}

#[test]
fn what_a_saturated_pixel_spills_over_does_not_count() {
    // One pixel saturates in the longer frame, and its neighbours get a fifth more there.
    let (side, bright) = (16, 8 * 16 + 8);
    let radiance = |i: usize| if i == bright { 100_000.0 } else { 10_000.0 };
    let mut merge = Merge::new(side, side, 1, &SENSOR).unwrap();
    for (t, spill) in [(0.1, 0.0), (1.0, 0.2)] {
        let near = |i: usize| (i % side).abs_diff(8) <= 1 && (i / side).abs_diff(8) <= 1;
        let samples: Vec<u16> = (0..side * side)
            .map(|i| {
                let more: f64 = if near(i) { 1.0 + spill } else { 1.0 };
                (300.0 + radiance(i) * t * more).clamp(0.0, 60_000.0) as u16
            })
            .collect();
        let frame = |samples: Vec<u16>| Frame {
            width: side,
            height: side,
            channels: 1,
            samples: samples.into(),
        };
        let dark = DarkFrame::new(&frame(vec![300; side * side]), t).unwrap();
        merge.add(&frame(samples), &dark, t).unwrap();
    }
    let (map, report) = merge.finish().unwrap();
    for (i, value) in map.channels[0].value.iter().enumerate() {
        let off = f64::from(*value) / radiance(i) - 1.0;
        assert!(off.abs() < 1e-3, "{i}: {value}");
    }
    assert_eq!(report.frames[1].saturated, [9]);
}

#[test]
fn a_frame_below_its_dark_is_refused_and_a_dim_one_is_not() {
    let rng = &mut Pcg64Mcg::seed_from_u64(8);
    let size = (60, 50);
    let dark = expose(&SENSOR, size, |_| 0.0, |_| 0.0, 0.1, rng);
    // A tenth of a count of light at most, a pedestal that has drifted by 5 %, and counts that
    // were divided by 16.
    let dim = expose(&SENSOR, size, |_| 1.0, |_| 0.0, 0.1, rng);
    let with = |change: fn(u16) -> u16| {
        let Samples::U16(counts) = &dim.samples else {
            unreachable!("a camera counts");
        };
        Frame {
            samples: counts.iter().map(|c| change(*c)).collect::<Vec<_>>().into(),
            ..dim
        }
    };
    let merge = |frame: &Frame| {
        let mut merge = Merge::new(size.0, size.1, 1, &SENSOR).unwrap();
        merge.add(frame, &DarkFrame::new(&dark, 0.1).unwrap(), 0.1)
    };
    assert_eq!(merge(&dim), Ok(()));
    assert_eq!(merge(&with(|count| count - 15)), Ok(()));
    let refused = merge(&with(|count| count / 16)).unwrap_err();
    assert_eq!(refused, MergeError::BelowDark { share: 1.0 });
    assert!(refused.to_string().starts_with("100 % of its samples"));
}

/// `value` with the 11 significant bits of a half, ties to even.
fn in_half(value: f64) -> f32 {
    let bits = (value as f32).to_bits();
    let even = bits >> 13 & 1;
    f32::from_bits((bits + 0x0fff + even) & !0x1fff)
}

/// Frames without any noise but that of 11 bits, with an offset of each pixel that is no stored
/// number: the variance is that of rounding alone.
#[test]
fn the_rounding_of_half_precision_is_in_the_variance() {
    let sensor = Sensor {
        gain_e_per_dn: 1e9,
        read_noise_e: 0.0,
        ..SENSOR
    };
    let (side, full) = (200, full());
    for channels in [1, 3] {
        let count = side * side * channels;
        let rng = &mut Pcg64Mcg::seed_from_u64(7);
        let offset: Vec<f64> = (0..count)
            .map(|_| 290.0 + 20.0 * rng.random::<f64>())
            .collect();
        // Three decades, so that every place between two powers of 2 occurs.
        let light: Vec<f64> = (0..count)
            .map(|i| 0.8 * full * 10_f64.powf(-3.0 * i as f64 / count as f64))
            .collect();
        let frame = |exposure_s: f64| Frame {
            width: side,
            height: side,
            channels,
            samples: Samples::F32(
                (0..count)
                    .map(|i| in_half((offset[i] + light[i] * exposure_s).min(60_000.0)))
                    .collect(),
            ),
        };
        let mut merge = Merge::new(side, side, channels, &sensor).unwrap();
        for exposure_s in exposures() {
            let dark = DarkFrame::new(&frame(1e-12), exposure_s).unwrap();
            merge.add(&frame(exposure_s), &dark, exposure_s).unwrap();
        }
        let (map, _) = merge.finish().unwrap();
        let (mut squares, mut pixels) = ([0.0; 3], [0.0; 3]);
        for (channel, map) in map.channels.iter().enumerate() {
            for (at, (value, variance)) in map.value.iter().zip(&map.variance).enumerate() {
                let i = at * channels + channel;
                let decade = (3 * i / count).min(2);
                let off = f64::from(*value) - light[i];
                squares[decade] += off * off / f64::from(*variance);
                pixels[decade] += 1.0;
            }
        }
        for (squares, pixels) in squares.into_iter().zip(pixels) {
            let z = squares / pixels;
            println!("{channels} channels: z² {z:.3}");
            // Of 13,000 squares of sums of few uniform errors the mean has a standard error of 1 %;
            // where light is less than a step, a frame is rounded as its dark was, and both errors
            // cancel: up to 3 %.
            assert!((z - 1.0).abs() < 0.05, "{z}");
        }
    }
}

/// Counts of 12 bits in the high bits of 16 are rounded to multiples of 16.
#[test]
fn the_rounding_of_fewer_bits_is_in_the_variance() {
    let sensor = Sensor {
        read_noise_e: 6.0,
        black_level_dn: 304.0,
        ..SENSOR
    };
    let (side, rng) = (200, &mut Pcg64Mcg::seed_from_u64(11));
    // Dim, so that reading it out is most of its noise, beside a bright edge.
    let light = |i: usize| {
        if i.is_multiple_of(side) {
            0.5 * full()
        } else {
            25.0
        }
    };
    let mut coarse = |lit: bool, exposure_s: f64| {
        let mut frame = expose(
            &sensor,
            (side, side),
            |i| if lit { light(i) } else { 0.0 },
            |_| 0.0,
            exposure_s,
            rng,
        );
        if let Samples::U16(counts) = &mut frame.samples {
            for count in counts.iter_mut() {
                *count = (*count + 8) / 16 * 16;
            }
        }
        frame
    };
    let mut merge = Merge::new(side, side, 1, &sensor).unwrap();
    for exposure_s in [0.001, 0.003, 0.01] {
        let dark = DarkFrame::new(&coarse(false, exposure_s), exposure_s).unwrap();
        let frame = coarse(true, exposure_s);
        merge.add(&frame, &dark, exposure_s).unwrap();
    }
    let (map, _) = merge.finish().unwrap();
    let map = &map.channels[0];
    let dim = (0..side * side).filter(|i| !i.is_multiple_of(side));
    let squares =
        dim.map(|i| (f64::from(map.value[i]) - 25.0).powi(2) / f64::from(map.variance[i]));
    let z = squares.sum::<f64>() / (side * (side - 1)) as f64;
    println!("z² {z:.3}");
    // Of 39,800 squares the mean has a standard error of 0.7 %.
    assert!((z - 1.0).abs() < 0.03, "{z}");
}

//! Comparisons of frames whose exposures and shifts are known.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Poisson, StandardNormal};
use rand_pcg::Pcg64Mcg;

const SIDE: usize = 200;

const SENSOR: Sensor = Sensor {
    gain_e_per_dn: 0.5,
    read_noise_e: 3.0,
    black_level_dn: 300.0,
    white_level_dn: 60_000.0,
    prnu_relative: 0.0,
};

/// A round glow that falls as one over the radius and exponentially, its middle shifted by
/// `shift`, with an uneven sensitivity of 1 % that stays where it is.
fn expose(
    side: usize,
    exposure: f64,
    shift: [f64; 2],
    rng: &mut Pcg64Mcg,
    pattern: &[f64],
) -> Frame {
    let samples: Vec<u16> = (0..side * side)
        .map(|i| {
            let (x, y) = (
                (i % side) as f64 - 98.3 - shift[0],
                (i / side) as f64 - 101.2 - shift[1],
            );
            let radius = (x * x + y * y + 9.0).sqrt();
            let light = 24_000.0 * 3.0 / radius * (-radius / 40.0).exp() * pattern[i] * exposure;
            let electrons = if light > 60_000.0 {
                light
            } else {
                Poisson::new(light.max(1e-9)).unwrap().sample(rng)
            };
            let read = SENSOR.read_noise_e * rng.sample::<f64, _>(StandardNormal);
            let dn =
                SENSOR.black_level_dn + (electrons.min(30_000.0) + read) / SENSOR.gain_e_per_dn;
            dn.round().clamp(0.0, SENSOR.white_level_dn) as u16
        })
        .collect();
    Frame {
        width: side,
        height: side,
        channels: 1,
        samples: samples.into(),
    }
}

/// Frames of 1, 2, 4 … whose true exposures and shifts are those given.
fn compare(errors: &[f64], shifts: &[[f64; 2]], seed: u64) -> Comparison {
    compare_at(SIDE, errors, shifts, seed)
}

fn compare_at(side: usize, errors: &[f64], shifts: &[[f64; 2]], seed: u64) -> Comparison {
    let rng = &mut Pcg64Mcg::seed_from_u64(seed);
    let pattern: Vec<f64> = (0..side * side)
        .map(|_| 1.0 + 0.01 * rng.sample::<f64, _>(StandardNormal))
        .collect();
    let dark = Frame {
        width: side,
        height: side,
        channels: 1,
        samples: vec![300; side * side].into(),
    };
    let mut overlap = Overlap::new(&SENSOR);
    for (k, (error, shift)) in errors.iter().zip(shifts).enumerate() {
        let nominal = f64::from(1_u32 << k);
        let frame = expose(side, nominal * (1.0 + error), *shift, rng, &pattern);
        let dark = DarkFrame::new(&dark, nominal).unwrap();
        overlap.add(&frame, &dark, nominal).unwrap();
    }
    overlap.finish()
}

#[test]
fn ratios_come_back_with_true_uncertainties() {
    let errors = [0.0, 0.02, -0.01, 0.0, 0.005, -0.03, 0.0];
    let mut squares = vec![];
    for seed in 0..6 {
        let found = compare(&errors, &[[0.0; 2]; 7], seed);
        assert!(found.prefers_measured());
        for (k, (link, errors)) in found.links.iter().zip(errors.windows(2)).enumerate() {
            let ratio = link.ratio.unwrap();
            let truth = (1.0 + errors[1]) / (1.0 + errors[0]);
            println!("{k}: {:.5} ± {:.5} for {truth:.5}", ratio.value, ratio.u);
            assert!(ratio.u < 2e-3, "{ratio:?}");
            squares.push(((ratio.value - truth) / ratio.u).powi(2));
        }
        // The median error is 0, so that the scale is the true one.
        for (frame, error) in found.frames.iter().zip(errors) {
            let off = frame.deviation() - (1.0 + error).ln();
            assert!(off.abs() < 5.0 * frame.u_relative + 1e-3, "{frame:?}");
        }
        let named: Vec<usize> = (0..7).filter(|k| found.frames[*k].is_off(0.015)).collect();
        assert_eq!(named, [1, 5]);
    }
    let n = squares.len() as f64;
    let mean = squares.iter().sum::<f64>() / n;
    println!("z² {mean:.3}");
    // Of 36 squares the mean has a standard error of 0.24.
    assert!((mean - 1.0).abs() < 0.75, "{mean}");
}

#[test]
fn true_exposures_are_left_alone() {
    for seed in 0..6 {
        let found = compare(&[0.0; 7], &[[0.0; 2]; 7], seed);
        assert!(!found.prefers_measured(), "{found:?}");
        assert!(found.frames.iter().all(|f| !f.is_off(0.0)), "{found:?}");
        assert!(
            found.frames.iter().all(|f| f.shifted(0.02).is_none()),
            "{found:?}"
        );
    }
}

#[test]
fn one_frame_of_thirty_percent_is_the_one_that_is_named() {
    for bad in [0, 3, 6] {
        let mut errors = [0.0; 7];
        errors[bad] = 0.3;
        let found = compare(&errors, &[[0.0; 2]; 7], 5);
        let off: Vec<usize> = (0..7).filter(|k| found.frames[*k].is_off(0.2)).collect();
        assert_eq!(off, [bad], "{found:?}");
    }
}

/// What each frame of a stack, 1 the shortest, sees of a scene that is 30 % darker meanwhile, in
/// every place and among every number of frames.
#[test]
fn whichever_frame_is_too_dark_is_the_one_that_is_named() {
    const SMALL: usize = 120;
    let mosaics = ["", "RGGB", "GBGGRGRGRBGBGBGGRGGRGGBGBGBRGRGRGGBG"];
    let nominal = |k: usize| f64::from(1_u32 << k) / 64.0;
    let (mut named, mut either, mut alone) = (0, 0, 0);
    for (seed, name) in (0..9).map(|seed| (seed, mosaics[seed as usize % 3])) {
        let rng = &mut Pcg64Mcg::seed_from_u64(100 + seed);
        let mosaic: Option<physics::Mosaic> = (!name.is_empty()).then(|| name.parse().unwrap());
        // What a filter lets through, and a pattern of 1 %.
        let pattern: Vec<f64> = (0..SMALL * SMALL)
            .map(|i| {
                let colour = mosaic.map_or(1, |m| m.colour(i % SMALL, i / SMALL));
                [0.5, 1.0, 0.3][colour] * (1.0 + 0.01 * rng.sample::<f64, _>(StandardNormal))
            })
            .collect();
        let folded = |frame: Frame| mosaic.map_or(frame.clone(), |m| m.folded(&frame));
        let mut stack = |light: f64| -> Vec<Frame> {
            let frames = (0..13).map(|k| {
                let shift = [-40.0; 2];
                folded(expose(SMALL, light * nominal(k), shift, rng, &pattern))
            });
            frames.collect()
        };
        let [good, dark] = [1.0, 0.7].map(&mut stack);
        let black = folded(Frame {
            width: SMALL,
            height: SMALL,
            channels: 1,
            samples: vec![300; SMALL * SMALL].into(),
        });
        for (count, first) in (3..=13).flat_map(|count| [(count, 0), (count, 13 - count)]) {
            for bad in 0..count {
                let mut overlap = Overlap::new(&SENSOR);
                for k in 0..count {
                    let frames = if k == bad { &dark } else { &good };
                    let exposure_s = nominal(first + k);
                    let black = DarkFrame::new(&black, exposure_s).unwrap();
                    overlap.add(&frames[first + k], &black, exposure_s).unwrap();
                }
                let found = overlap.finish();
                // As far as neighbours could be compared, one after the other.
                let measured = |k: &usize| found.links[*k].ratio.is_some();
                let after = (bad..count - 1).take_while(measured).count();
                let before = (0..bad).rev().take_while(measured).count();
                let expected = match (before, after) {
                    (0, 0) => vec![],
                    (1, 0) => vec![Contradiction::Pair(bad - 1)],
                    (0, 1) => vec![Contradiction::Pair(bad)],
                    _ => vec![Contradiction::Frame(bad)],
                };
                let of = format!("{name} {seed}: {bad} of {count} from {first}");
                assert_eq!(found.contradictions(0.2), expected, "{of}: {found:?}");
                match before + after {
                    0 => alone += 1,
                    1 => either += 1,
                    _ => named += 1,
                }
            }
        }
    }
    println!("{named} named, {either} of two, {alone} without a neighbour");
    // The shortest frames of a long stack show too little to be compared.
    assert!(named > 1000 && either > 0 && alone > 0);
}

#[test]
fn two_frames_alone_cannot_tell_which_is_off() {
    // At a factor beyond the limit's square, either would be off by itself.
    for errors in [[0.0, -0.3], [-0.3, 0.0], [0.0, -0.6]] {
        let found = compare(&errors, &[[0.0; 2]; 2], 4);
        assert_eq!(found.contradictions(0.2), [Contradiction::Pair(0)]);
    }
    let halves = compare(&[0.0, 0.0, 0.4, 0.4], &[[0.0; 2]; 4], 4);
    assert_eq!(halves.contradictions(0.2), [Contradiction::Pair(1)]);
    let fine = compare(&[0.0, 0.05], &[[0.0; 2]; 2], 4);
    assert_eq!(fine.contradictions(0.2), []);
}

#[test]
fn a_shift_is_found_and_its_frame_named() {
    let mut squares = vec![];
    for (bad, shift) in [
        (0, [0.25, 0.0]),
        (3, [-0.3, 0.2]),
        (6, [0.0, 1.5]),
        (2, [4.0, -3.0]),
    ] {
        let mut shifts = [[0.0; 2]; 7];
        shifts[bad] = shift;
        let found = compare(&[0.0; 7], &shifts, 9 + bad as u64);
        let moved: Vec<usize> = (0..7)
            .filter(|k| found.frames[*k].shifted(0.2).is_some())
            .collect();
        println!("{shift:?}: {:?}", found.frames[bad].shift_px);
        assert_eq!(moved, [bad], "{found:?}");
        // A shift below a pixel is measured; a larger one is beyond the linear range, and only seen.
        if shift[0].hypot(shift[1]) < 0.5 {
            for (found, truth) in found.frames[bad].shift_px.iter().zip(shift) {
                assert!((found.value - truth).abs() < 0.05, "{found:?} for {truth}");
                squares.push(((found.value - truth) / found.u).powi(2));
            }
        }
    }
    println!("{squares:.2?}");
}

/// Of a frame as large as this only bands of rows are looked at.
#[test]
fn a_large_frame_says_the_same() {
    let found = compare_at(
        1100,
        &[0.0, 0.03, 0.0],
        &[[0.0; 2], [0.3, -0.2], [0.0; 2]],
        3,
    );
    let middle = found.frames[1];
    assert!((middle.deviation() - 1.03_f64.ln()).abs() < 5.0 * middle.u_relative);
    for (found, truth) in middle.shift_px.iter().zip([0.3, -0.2]) {
        assert!(
            (found.value - truth).abs() < 5.0 * found.u && found.u < 0.06,
            "{found:?}"
        );
    }
}

#[test]
fn a_slow_drift_adds_up() {
    let shifts: Vec<[f64; 2]> = (0..7).map(|k| [0.12 * f64::from(k), 0.0]).collect();
    let found = compare(&[0.0; 7], &shifts, 3);
    let moved: Vec<usize> = (0..7)
        .filter(|k| found.frames[*k].shifted(0.2).is_some())
        .collect();
    // The middle frame is the measure; those two and three steps away are off.
    assert_eq!(moved, [0, 1, 5, 6], "{found:?}");
}

#[test]
fn a_shutter_that_repeats_its_errors_leaves_no_doubt_about_the_scale() {
    let errors = [0.0, 0.02, -0.01, 0.0, 0.005, -0.03, 0.0];
    let a = compare(&errors, &[[0.0; 2]; 7], 1);
    let b = compare(&errors, &[[0.0; 2]; 7], 2);
    let c = compare(
        &[0.01, -0.02, 0.02, 0.0, -0.015, 0.01, -0.01],
        &[[0.0; 2]; 7],
        3,
    );
    let (same, other) = (u_between(&a, &b), u_between(&a, &c));
    println!("{same:.5} {other:.5}");
    assert!(same < 1e-3 && other > 4e-3, "{same} {other}");
}

#[test]
fn a_dark_of_another_size_is_not_the_fault_of_its_frame() {
    let of = |width| Frame {
        width,
        height: 4,
        channels: 1,
        samples: vec![400; 4 * width].into(),
    };
    let dark = |width| DarkFrame::new(&of(width), 1.0).unwrap();
    let mut overlap = Overlap::new(&SENSOR);
    let error = overlap.add(&of(6), &dark(5), 1.0).unwrap_err().to_string();
    assert!(error.contains("its dark is 5 x 4 with 1"), "{error}");
    overlap.add(&of(6), &dark(6), 1.0).unwrap();
    let error = overlap.add(&of(6), &dark(5), 1.0).unwrap_err().to_string();
    assert!(error.contains("its dark is 5 x 4 with 1"), "{error}");
    let error = overlap.add(&of(5), &dark(6), 1.0).unwrap_err().to_string();
    assert!(error.contains("frame is 5 x 4 with 1"), "{error}");
}

#[test]
fn frames_without_overlap_say_nothing() {
    let rng = &mut Pcg64Mcg::seed_from_u64(1);
    let pattern = vec![1.0; SIDE * SIDE];
    let mut overlap = Overlap::new(&SENSOR);
    for exposure in [1.0, 1e5] {
        let frame = expose(SIDE, exposure, [0.0; 2], rng, &pattern);
        let dark = Frame {
            samples: vec![300; SIDE * SIDE].into(),
            ..frame.clone()
        };
        let dark = DarkFrame::new(&dark, exposure).unwrap();
        overlap.add(&frame, &dark, exposure).unwrap();
    }
    let found = overlap.finish();
    assert_eq!(
        found.links,
        [Link {
            ratio: None,
            shift_px: None
        }]
    );
    assert!(!found.prefers_measured());
    assert_eq!(Overlap::new(&SENSOR).finish().frames, []);
}

/// Frames of 1, 2 and 4 s, each link off by 10 u, of which the middle one is the median.
fn three_frames(u: f64) -> Comparison {
    let none = Estimate { value: 0.0, u: 1.0 };
    let off = 10.0 * u;
    let frames = [(1.0, -off), (2.0, 0.0), (4.0, off)].map(|(nominal_s, off): (f64, f64)| Placed {
        nominal_s,
        measured_s: nominal_s * off.exp(),
        u_relative: u,
        shift_px: [none; 2],
    });
    let link = Link {
        ratio: Some(Estimate {
            value: off.exp(),
            u: u * off.exp(),
        }),
        shift_px: None,
    };
    Comparison {
        frames: frames.to_vec(),
        links: vec![link; 2],
    }
}

#[test]
fn the_error_of_a_ratio_is_that_of_the_merged_values_it_moves() {
    let u = 1e-3;
    let found = three_frames(u);
    assert!(found.prefers_measured());
    let merged = |rate: f64, times: [f64; 3]| {
        let seen = found.frames.iter().zip(times);
        let seen = seen.filter(|(f, _)| rate * f.measured_s <= 950.0);
        let (light, time) = seen.fold((0.0, 0.0), |(light, time), (f, t)| {
            (light + rate * f.measured_s, time + t)
        });
        light / time
    };
    let times: [f64; 3] = std::array::from_fn(|k| found.frames[k].measured_s);
    // The median stays as stated: the first link moves the first frame, the second the last.
    for rate in [900.0, 450.0, 100.0] {
        let errors = found.relative_errors(rate, 1000.0);
        let first = [times[0] / (1.0 + u), times[1], times[2]];
        let second = [times[0], times[1], times[2] * (1.0 + u)];
        for (error, moved) in errors.iter().zip([first, second]) {
            let expected = merged(rate, moved) / merged(rate, times) - 1.0;
            assert!(
                (error - expected).abs() < 2e-3 * u,
                "{rate}: {error} for {expected}"
            );
        }
    }
    // Exposures that the overlap does not contradict are taken as stated.
    let mut agreed = three_frames(u);
    for link in &mut agreed.links {
        link.ratio = Some(Estimate { value: 1.0, u });
    }
    assert_eq!(agreed.relative_errors(100.0, 1000.0), [0.0, 0.0]);
}

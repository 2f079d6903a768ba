//! The pass in lanes against its definition.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const SIZE: (usize, usize) = (203, 157);
const CENTER: [f64; 2] = [101.37, 77.81];

/// A glow with noise, one pixel in 50 unmeasured, one in 200 far off, and a gap.
fn picture() -> ChannelMap {
    let rng = &mut Pcg64Mcg::seed_from_u64(11);
    let (mut value, mut variance) = (vec![], vec![]);
    for i in 0..SIZE.0 * SIZE.1 {
        let (x, y) = (
            (i % SIZE.0) as f64 - CENTER[0],
            (i / SIZE.0) as f64 - CENTER[1],
        );
        let light = 40.0 / (20.0 + x * x + y * y).powf(1.2);
        let u = 0.01 * light.sqrt();
        let mut seen = light + u * rng.sample::<f64, _>(StandardNormal);
        let mut square = u * u;
        if i % 199 == 5 {
            seen += 30.0 * u;
        }
        if i % 50 == 7 || (150..160).contains(&(i % SIZE.0)) {
            (seen, square) = (0.0, f64::INFINITY);
        }
        value.push(seen as f32);
        variance.push(square as f32);
    }
    ChannelMap {
        name: "Y".to_owned(),
        value,
        variance,
    }
}

#[test]
fn lanes_add_up_what_the_definition_does() {
    let channel = picture();
    let rings = Rings::new(76.5, 0.05, 1.5);
    let picture = Picture {
        channel: &channel,
        size: SIZE,
        center: CENTER,
        rings: &rings,
        places: None,
    };
    let first = picture.pass_by_pixel(None, Bounds::None);
    let moments: Vec<Moments> = first.sums.iter().map(Sums::moments).collect();
    let curve = Curve::through(&rings, &first.medians(), &moments, 1e-6);
    let slack = slacks(&rings, &first.medians());
    let limit = |slack: &f64| Limit {
        relative: 5.0,
        slack: *slack,
    };
    let limits: Vec<Limit> = slack.iter().map(limit).collect();
    let mut rejected = 0;
    for (curve, bounds) in [
        (None, Bounds::None),
        (Some(&curve), Bounds::Wide(&slack)),
        (Some(&curve), Bounds::Limits(&limits)),
    ] {
        let expected = picture.pass_by_pixel(curve, bounds);
        let found = picture.pass_in_lanes(curve, bounds, false);
        assert_eq!(found.measured, expected.measured);
        assert_eq!(found.inside, expected.inside);
        assert_eq!(found.unmeasured, expected.unmeasured);
        for ring in 0..rings.len() {
            let (got, wanted) = (&found.sums[ring], &expected.sums[ring]);
            assert_eq!(got.count, wanted.count, "ring {ring}");
            rejected += expected.measured[ring] - wanted.count;
            // Single precision within a ring: some 1e-7 of the light, and as much of τ.
            assert!(
                (got.mean() / wanted.mean() - 1.0).abs() < 1e-6,
                "ring {ring}"
            );
            assert!((got.u() / wanted.u() - 1.0).abs() < 1e-6, "ring {ring}");
            for (a, b) in got.moments().iter().zip(wanted.moments()) {
                assert!((a - b).abs() < 3e-6, "ring {ring}: {a} {b}");
            }
            let (a, b) = (found.scatter[ring], expected.scatter[ring]);
            assert!((a - b).abs() <= 1e-4 * b, "ring {ring}: {a} {b}");
            let (area, sum) = found.groups[ring]
                .iter()
                .fold((0.0, 0.0), |all, group| (all.0 + group.0, all.1 + group.1));
            assert_eq!(area, got.area);
            if curve.is_none() {
                assert!((sum / got.value - 1.0).abs() < 1e-9);
            }
        }
    }
    assert!(rejected > 50, "{rejected}");
}

#[test]
fn lanes_add_up_what_a_plain_double_loop_does() {
    // Odd sizes, rings of one pixel, centres on a pixel, on a corner, beside both, and so near to the
    // edge that the last pixels are inside; runs with and without something to leave out.
    let centers = [
        [15.0, 14.0],
        [15.5, 14.5],
        [14.21, 15.87],
        [16.99, 13.03],
        [25.2, 17.1],
    ];
    for (size, damaged) in [((31, 29), false), ((31, 29), true), ((37, 33), true)] {
        let (width, height) = size;
        let mut value: Vec<f32> = (0..width * height)
            .map(|i| ((i * 37) % 101) as f32 * 0.25 + 1.0)
            .collect();
        let mut variance: Vec<f32> = (value.iter()).map(|v| 0.01 * v).collect();
        for i in (0..width * height).filter(|i| damaged && i % 13 == 4) {
            if i % 2 == 0 {
                value[i] = f32::NAN;
            }
            variance[i] = f32::INFINITY;
        }
        let channel = ChannelMap {
            name: "Y".to_owned(),
            value,
            variance,
        };
        for center in centers {
            let rings = Rings::new(12.4, 0.1, 1.0);
            let picture = Picture {
                channel: &channel,
                size,
                center,
                rings: &rings,
                places: None,
            };
            let found = picture.pass_in_lanes(None, Bounds::None, false);
            for ring in 0..rings.len() {
                let (inner, outer) = rings.edges(ring);
                let (middle, half) = rings.square(ring);
                let (mut inside, mut count, mut sums) = (0, 0, [0.0; 4]);
                for y in 0..height {
                    for x in 0..width {
                        let [dx, dy] = [x as f64 - center[0], y as f64 - center[1]];
                        let square = dx * dx + dy * dy;
                        let i = y * width + x;
                        if square < inner * inner || square >= outer * outer {
                            continue;
                        }
                        if channel.value[i].is_nan() {
                            continue;
                        }
                        inside += 1;
                        if channel.variance[i].is_infinite() {
                            continue;
                        }
                        count += 1;
                        let tau = (square - middle) / half;
                        let [value, variance] =
                            [channel.value[i], channel.variance[i]].map(f64::from);
                        for (sum, term) in sums.iter_mut().zip([value, variance, tau, tau * tau]) {
                            *sum += term;
                        }
                    }
                }
                let place = format!("{size:?} {center:?} ring {ring}");
                let sum = &found.sums[ring];
                assert_eq!(sum.count, count, "{place}");
                assert_eq!(found.inside[ring], f64::from(inside), "{place}");
                let pairs = [sum.value, sum.variance, sum.tau[0], sum.tau[1]];
                for (found, expected) in pairs.into_iter().zip(sums) {
                    // Single precision over a run; τ is at most 1 in each pixel.
                    let most = 1e-5 * expected.abs().max(count as f64);
                    assert!(
                        (found - expected).abs() < most,
                        "{place}: {found} {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_part_of_the_rows_says_the_same_of_large_rings() {
    let (width, height) = (1600, 1500);
    let center = [799.2, 751.7];
    let rng = &mut Pcg64Mcg::seed_from_u64(12);
    let value = (0..width * height)
        .map(|_| (3.0 + 0.1 * rng.sample::<f64, _>(StandardNormal)) as f32)
        .collect();
    let channel = ChannelMap {
        name: "Y".to_owned(),
        value,
        variance: vec![0.01; width * height],
    };
    let rings = Rings::new(740.0, 0.05, 1.5);
    let picture = Picture {
        channel: &channel,
        size: (width, height),
        center,
        rings: &rings,
        places: None,
    };
    let whole = picture.pass_in_lanes(None, Bounds::None, false);
    let part = picture.pass_in_lanes(None, Bounds::None, true);
    let mut thinned = 0;
    for ring in 0..rings.len() {
        let (a, b) = (&whole.sums[ring], &part.sums[ring]);
        if a.count == b.count {
            assert_eq!(a.value, b.value);
            continue;
        }
        thinned += 1;
        assert!(
            // One row in sixteen at the least; a ring is left as it is or loses half of its rows.
            b.count * 17 > a.count && b.count * 3 < 2 * a.count && b.count > 9_000,
            "{} {}",
            a.count,
            b.count
        );
        // Four standard errors of the part.
        assert!((a.mean() - b.mean()).abs() < 4.0 * b.u());
    }
    assert!(thinned > 3, "{thinned}");
}

#[test]
fn zingers_do_not_reach_the_profile() {
    // One pixel in 1e5 struck by a cosmic ray of up to the full range, as FIELD has it.
    let (width, height) = (1200, 1200);
    let center = [600.0, 600.0];
    let light = |x: f64, y: f64| 1e3 / (100.0 + x * x + y * y).powf(1.5);
    let rng = &mut Pcg64Mcg::seed_from_u64(13);
    let (mut value, mut variance) = (vec![], vec![]);
    for i in 0..width * height {
        let (x, y) = (
            (i % width) as f64 - center[0],
            (i / width) as f64 - center[1],
        );
        let mean = light(x, y);
        let u = 0.03 * mean;
        let struck = if rng.random::<f64>() < 1e-5 {
            rng.random::<f64>()
        } else {
            0.0
        };
        value.push((mean + u * rng.sample::<f64, _>(StandardNormal) + struck) as f32);
        variance.push((u * u) as f32);
    }
    let struck = ChannelMap {
        name: "Y".to_owned(),
        value,
        variance,
    };
    let options = ProfileOptions {
        center_px: Some(center),
        ..ProfileOptions::default()
    };
    let survey = Survey::new(&struck, width, height, &options).unwrap();
    assert!(
        survey.rejected >= 5 && survey.rejected < 60,
        "{}",
        survey.rejected
    );
    let mut errors: Vec<f64> = (0..survey.rings.len())
        .map(|ring| {
            let (middle, _) = survey.rings.square(ring);
            let truth = light(middle.sqrt(), 0.0);
            // Rings are a fortieth of their radius wide: their mean is off the middle's value by
            // 2e-4 at most.
            (survey.means[ring] / truth - 1.0).abs() - 5.0 * survey.u[ring] / truth
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let at_99_percent = errors[errors.len() * 99 / 100];
    assert!(at_99_percent < 1e-3, "{at_99_percent}");
}

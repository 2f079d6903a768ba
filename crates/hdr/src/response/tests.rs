//! Curves of cameras that are known.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

fn srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

fn srgb_inverse(encoded: f64) -> f64 {
    if encoded <= 0.040_45 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

/// A film with a shoulder.
fn film(linear: f64) -> f64 {
    let x = linear.powf(0.9);
    1.02 * x / (x + 0.02)
}

fn film_inverse(encoded: f64) -> f64 {
    let y = encoded / 1.02;
    (0.02 * y / (1.0 - y)).powf(1.0 / 0.9)
}

/// Encode and decode, by name, and the exposures.
type Curve = (&'static str, fn(f64) -> f64, fn(f64) -> f64, [f64; 8]);

const CURVES: [Curve; 3] = [
    ("sRGB", srgb, srgb_inverse, DOUBLING),
    (
        "gamma 2.2",
        |x| x.powf(1.0 / 2.2),
        |x| x.powf(2.2),
        DOUBLING,
    ),
    ("film", film, film_inverse, UNEQUAL),
];

const DOUBLING: [f64; 8] = [1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625, 0.0078125];

/// Steps that differ, so that even a curve that is nearly straight is determined.
const UNEQUAL: [f64; 8] = [1.0, 0.6, 0.25, 0.13, 0.06, 0.035, 0.014, 0.008];

/// Codes of pixels whose light is even in the logarithm over three decades, with `noise` of it.
fn photograph((_, encode, _, exposures): Curve, pixels: usize, noise: f64, seed: u64) -> Vec<u8> {
    let rng = &mut Pcg64Mcg::seed_from_u64(seed);
    let mut codes = vec![];
    for _ in 0..pixels {
        let light = 10_f64.powf(2.5 - 3.5 * rng.random::<f64>());
        for t in exposures {
            let seen = light * t * (1.0 + noise * rng.sample::<f64, _>(StandardNormal));
            codes.push((255.0 * encode(seen.clamp(0.0, 1.0))).round() as u8);
        }
    }
    codes
}

#[test]
fn known_curves_come_back() {
    for curve in CURVES {
        let (name, _, decode, exposures) = curve;
        // The prior rounds off the end of a shoulder, by up to 4 %.
        let last = if name == "film" { 210 } else { 245 };
        for (pixels, noise) in [(2000, 0.0), (2000, 0.02), (300, 0.01)] {
            let mut worst = 0.0_f64;
            let mut pulls = vec![];
            for seed in 0..4 {
                let found = recover(&photograph(curve, pixels, noise, seed), &exposures).unwrap();
                let middle = decode(MIDDLE as f64 / 255.0).ln();
                for z in 10..=last {
                    let truth = decode(z as f64 / 255.0).ln() - middle;
                    let off = found.ln_exposure[z] - truth;
                    if z >= 20 {
                        worst = worst.max(off.abs());
                    }
                    if z != MIDDLE {
                        pulls.push(off / found.u[z]);
                    }
                }
                let rising = found.ln_exposure.windows(2).all(|w| w[1] >= w[0]);
                assert!(rising && found.ln_exposure[MIDDLE] == 0.0);
            }
            let n = pulls.len() as f64;
            let rms = (pulls.iter().map(|p| p * p).sum::<f64>() / n).sqrt();
            let beyond = pulls.iter().filter(|p| p.abs() > 4.0).count();
            println!(
                "{name}, {pixels} pixels, noise {noise}: worst {worst:.4}, rms pull {rms:.2}, beyond 4: {beyond}"
            );
            assert!(worst < 0.02, "{name}: off by {worst}");
            assert!(
                (0.3..1.3).contains(&rms) && beyond == 0,
                "{name}: rms pull {rms}, {beyond} beyond 4"
            );
        }
    }
}

#[test]
fn a_few_bad_samples_do_not_bend_the_curve() {
    let (_, _, decode, exposures) = CURVES[0];
    let rng = &mut Pcg64Mcg::seed_from_u64(7);
    let mut codes = photograph(CURVES[0], 2000, 0.01, 1);
    for code in &mut codes {
        if rng.random::<f64>() < 0.01 {
            *code = rng.random();
        }
    }
    let found = recover(&codes, &exposures).unwrap();
    for z in 20..=245 {
        let truth = (decode(z as f64 / 255.0) / decode(MIDDLE as f64 / 255.0)).ln();
        let off = found.ln_exposure[z] - truth;
        assert!(off.abs() < 0.03, "{z}: {off}");
    }
}

/// In unequal steps, whose pairs show any error of the curve.
const STEPS: Curve = ("sRGB", srgb, srgb_inverse, UNEQUAL);

/// Its name, what it makes of a code in a frame, and the frames that it fogs.
type Toe = (&'static str, fn(usize, f64) -> f64, fn(usize) -> bool);

/// Codes as [`photograph`], for which `toe` made the code of a frame of what it would have been.
fn with_toe(toe: fn(usize, f64) -> f64, seed: u64) -> Vec<u8> {
    let codes = photograph(STEPS, 3000, 0.01, seed);
    let count = UNEQUAL.len();
    let each = codes.iter().enumerate();
    each.map(|(at, z)| toe(at % count, f64::from(*z)).round() as u8)
        .collect()
}

/// What the fog of a film makes of a code.
fn fog(z: f64) -> f64 {
    z + 14.0 * (-z / 14.0).exp()
}

#[test]
fn toes_that_differ_from_frame_to_frame_are_in_u() {
    // By half of the frames, by one of them alone, and by none.
    let toes: [Toe; 3] = [
        (
            "half",
            |frame, z| {
                if frame % 2 == 0 { z } else { fog(z) }
            },
            |frame| frame % 2 == 1,
        ),
        (
            "one",
            |frame, z| {
                if frame == 6 { fog(z) } else { z }
            },
            |frame| frame == 6,
        ),
        ("none", |_, z| z, |_| false),
    ];
    let (_, _, decode, exposures) = STEPS;
    let ln = |z: f64| (decode(z / 255.0) / decode(MIDDLE as f64 / 255.0)).ln();
    // What a fogged code was before: by bisection.
    let cleared = |z: f64| {
        let (mut low, mut high) = (0.0, 255.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if fog(middle) > z {
                high = middle;
            } else {
                low = middle;
            }
        }
        low
    };
    for (name, toe, fogged) in toes {
        let (mut held, mut all, mut largest) = (0, 0, 0.0_f64);
        for seed in 0..4 {
            let found = recover(&with_toe(toe, seed), &exposures).unwrap();
            for frame in 0..exposures.len() {
                // From where fogged codes have light to where fog is a code, which rounding hides.
                for z in 18..35 {
                    let truth = ln(if fogged(frame) {
                        cleared(z as f64)
                    } else {
                        z as f64
                    });
                    let off = found.ln_exposure[z] - truth;
                    held += usize::from(off.abs() < 1.96 * found.u[z]);
                    all += 1;
                }
            }
            largest = found.u[18..35].iter().copied().fold(largest, f64::max);
        }
        let share = held as f64 / all as f64;
        println!("{name}: {share:.3} within 1.96 u, which is at most {largest:.4}");
        assert!(share > 0.95, "{name}: {share} of truths within 1.96 u");
        // One curve serves where the frames agree, to what rounding leaves.
        assert_eq!(name == "none", largest < 0.02, "{name}: u {largest}");
    }
}

#[test]
fn fog_that_hides_light_is_in_u() {
    // A scanner's black: whatever is darker has codes about 17.
    let black: fn(usize, f64) -> f64 = |_, z| z.max(17.0);
    let (_, _, decode, exposures) = STEPS;
    let codes = with_toe(black, 3);
    let clear = photograph(STEPS, 3000, 0.01, 3);
    let found = recover(&codes, &exposures).unwrap();
    let (mut held, mut all) = (0, 0);
    let count = exposures.len();
    for (seen, had) in codes.chunks(count).zip(clear.chunks(count)) {
        // Of the light of others no frame knows anything.
        if !had.iter().any(|z| TELLING.contains(z)) {
            continue;
        }
        for (_, had) in seen
            .iter()
            .zip(had)
            .filter(|(z, had)| **z == 17 && **had > 0)
        {
            let truth = (decode(f64::from(*had) / 255.0) / decode(MIDDLE as f64 / 255.0)).ln();
            // Light that was itself read to half a code.
            let off = (found.ln_exposure[17] - truth).abs() - 0.5 / f64::from(*had);
            held += usize::from(off < 1.96 * found.u[17]);
            all += 1;
        }
    }
    println!("{held} of {all} within 1.96 u, which is {}", found.u[17]);
    assert!(
        all > 500 && held as f64 > 0.94 * all as f64,
        "{held} of {all}, u {}",
        found.u[17]
    );
    assert!(
        found.u[60] < 0.02 && found.u[200] < 0.02,
        "{} {}",
        found.u[60],
        found.u[200]
    );
}

#[test]
fn pixels_that_show_no_curve_are_refused() {
    assert_eq!(recover(&[1, 2], &[1.0]), Err(ResponseError::Exposures(1)));
    assert!(matches!(
        recover(&[1, 2], &[1.0, f64::NAN]),
        Err(ResponseError::Exposure(_))
    ));
    let codes = ResponseError::Codes {
        codes: 3,
        exposures: 2,
    };
    assert_eq!(recover(&[1, 2, 3], &[1.0, 2.0]), Err(codes));
    let few = recover(&[100, 150].repeat(200), &[1.0, 2.0]);
    assert_eq!(
        few,
        Err(ResponseError::TooFew {
            found: 200,
            least: 256
        })
    );
    let black = recover(&[0, 255].repeat(2000), &[1.0, 2.0]);
    assert_eq!(
        black,
        Err(ResponseError::TooFew {
            found: 0,
            least: 256
        })
    );
    // Two codes alone give a straight line over ln of the code, through both and no better.
    let two = recover(&[100, 150].repeat(2000), &[1.0, 2.0]).unwrap();
    assert!(two.ln_exposure.iter().chain(&two.u).all(|v| v.is_finite()));
    assert!(two.u[20] > 0.1, "{}", two.u[20]);
}

#[test]
fn falling_neighbours_are_pooled() {
    assert_eq!(
        monotone(&[0.0, 2.0, 1.0, 3.0], &[1.0; 4]),
        [0.0, 1.5, 1.5, 3.0]
    );
    // The one that is known better decides.
    let pooled = monotone(&[2.0, 1.0], &[1.0, 0.01]);
    assert!((pooled[0] - 1.0001).abs() < 1e-6 && pooled[0] == pooled[1]);
}

#[test]
fn codes_become_counts_whose_noise_and_error_are_known() {
    let curve = CURVES[0];
    let (_, _, decode, exposures) = curve;
    let codes = photograph(curve, 4000, 0.0, 7);
    let linear = recover(&codes, &exposures)
        .unwrap()
        .linear(&codes, &exposures);
    assert_eq!([0, 255].map(|z| linear.counts[z]), [0.0, 52_000.0]);
    // In proportion to light within a few times what the curve is said to be known to.
    let ratio = |z: usize| f64::from(linear.counts[z]) / decode(z as f64 / 255.0);
    for z in 20..=235 {
        let off = ratio(z) / ratio(MIDDLE) - 1.0;
        assert!(
            off.abs() < 4.0 * linear.u_relative,
            "{z}: {off} {}",
            linear.u_relative
        );
    }
    // The ways together are the curve's u, where codes say much.
    let found = recover(&codes, &exposures).unwrap();
    for z in [40, 80, 200] {
        let all = linear
            .ways
            .iter()
            .map(|way| way[z] * way[z])
            .sum::<f64>()
            .sqrt();
        assert!(
            (0.6..1.05).contains(&(all / found.u[z])),
            "{z}: {all} {}",
            found.u[z]
        );
    }
    // One frame that sees the pixel at one code errs as the curve does there.
    let rate = f64::from(linear.counts[80]);
    for (error, way) in linear
        .relative_errors(rate, &[1.0])
        .iter()
        .zip(&linear.ways)
    {
        assert!((error - way[80]).abs() < 1e-6, "{error} {}", way[80]);
    }
    // Two frames as their counts weigh: twice as long, twice as much.
    let rate = f64::from(linear.counts[200]);
    let alone = linear.relative_errors(rate, &[1.0]);
    let other = linear.relative_errors(0.5 * rate, &[1.0]);
    let both = linear.relative_errors(rate, &[1.0, 0.5]);
    for ((alone, other), both) in alone.iter().zip(&other).zip(&both) {
        assert!((both - (alone + 0.5 * other) / 1.5).abs() < 1e-12);
    }
    // Rounding alone: (step of a code)²/12 over the count, at a code of the middle.
    let step = f64::from(linear.counts[129] - linear.counts[127]) / 2.0;
    let expected = step * step / 12.0 / f64::from(linear.counts[128]);
    let found = 1.0 / linear.sensor.gain_e_per_dn;
    assert!(
        (0.5..2.0).contains(&(found / expected)),
        "{found} {expected}"
    );
}

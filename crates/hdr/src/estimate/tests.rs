//! Estimates against a sensor that is simulated electron by electron.

use super::darks::Darks;
use super::transfer::Transfer;
use super::white::White;
use super::*;
use crate::DarkFrame;
use crate::error::EstimateError;
use physics::Frame;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Poisson, StandardNormal};
use rand_pcg::Pcg64Mcg;

const SIDE: usize = 160;

/// A sensor with everything that could be mistaken for noise.
struct Camera {
    gain: f64,
    read_e: f64,
    black: f64,
    full_e: f64,
    max_dn: f64,
    sensitivity: Vec<f64>,
    offset_dn: Vec<f64>,
    dark_e_per_s: Vec<f64>,
    /// Every count is a multiple of it, DN.
    step: u16,
    rng: Pcg64Mcg,
}

impl Camera {
    fn new(gain: f64, read_e: f64, full_e: f64, max_dn: f64, seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let pixels = SIDE * SIDE;
        let mut normal = |sigma: f64| -> Vec<f64> {
            (0..pixels)
                .map(|_| sigma * rng.sample::<f64, _>(StandardNormal))
                .collect()
        };
        let (sensitivity, offset_dn) = (normal(0.01), normal(3.0));
        let hot = |i: usize| if i.is_multiple_of(1999) { 2000.0 } else { 1.5 };
        Self {
            gain,
            read_e,
            black: 200.0,
            full_e,
            max_dn,
            sensitivity: sensitivity.iter().map(|s| 1.0 + s).collect(),
            offset_dn,
            dark_e_per_s: (0..pixels).map(hot).collect(),
            step: 1,
            rng,
        }
    }

    /// A spot that falls by five decades, 0.8 of the full well in 1 ms, or darkness.
    fn expose(&mut self, lit: bool, exposure_s: f64) -> Frame {
        let peak = if lit { 0.8 * self.full_e / 1e-3 } else { 0.0 };
        let samples: Vec<u16> = (0..SIDE * SIDE)
            .map(|i| {
                let (x, y) = ((i % SIDE) as f64 - 79.7, (i / SIDE) as f64 - 80.2);
                let light = peak * (-x.hypot(y) / 9.0).exp() * self.sensitivity[i];
                let mean = (light + self.dark_e_per_s[i]) * exposure_s;
                let electrons = if mean > 4.0 * self.full_e {
                    self.full_e
                } else {
                    Poisson::new(mean)
                        .unwrap()
                        .sample(&mut self.rng)
                        .min(self.full_e)
                };
                let read = self.read_e * self.rng.sample::<f64, _>(StandardNormal);
                let dn = self.black + self.offset_dn[i] + (electrons + read) / self.gain;
                dn.round().clamp(0.0, self.max_dn) as u16 * self.step
            })
            .collect();
        Frame {
            width: SIDE,
            height: SIDE,
            channels: 1,
            samples: samples.into(),
        }
    }
}

const EXPOSURES: [f64; 9] = [1e-3, 2e-3, 4e-3, 8e-3, 0.016, 0.064, 0.25, 1.0, 4.0];

struct Found {
    black: Estimate,
    white: Option<Estimate>,
    noise: transfer::Noise,
}

fn estimate(camera: &mut Camera) -> Found {
    let mut darks = Darks::new();
    for t in EXPOSURES {
        for _ in 0..2 {
            darks.add(camera.expose(false, t), t).unwrap();
        }
    }
    let black = darks.black_level().unwrap();
    let frames: Vec<Frame> = EXPOSURES.iter().map(|t| camera.expose(true, *t)).collect();
    let mut white = White::new(black.value);
    for (frame, t) in frames.iter().zip(EXPOSURES) {
        white.add(frame, t).unwrap();
    }
    let white = white.white_level();
    let white_dn = white.map_or(65_535.0, |w| w.value);
    let mut transfer = Transfer::new(black.value, white_dn);
    for (frame, t) in frames.iter().zip(EXPOSURES) {
        let dark = DarkFrame::new(&camera.expose(false, t), t).unwrap();
        transfer.add(frame, &dark, t).unwrap();
    }
    let noise = transfer.noise(&darks.noise_points(black.value)).unwrap();
    Found {
        black,
        white,
        noise,
    }
}

/// Gain, read noise and full well of a scientific camera, one with much noise, and one whose
/// read noise is far below its rounding.
const CAMERAS: [(f64, f64, f64, f64); 3] = [
    (0.5, 2.0, 30_000.0, 65_535.0),
    (1.6, 12.0, 80_000.0, 65_535.0),
    (7.7, 2.0, 30_000.0, 4095.0),
];

/// Rounding that is coarser than whole numbers is no read noise either.
#[test]
fn counts_in_the_high_bits_show_the_same_read_noise() {
    for seed in 0..3 {
        let mut camera = Camera::new(7.7, 2.0, 30_000.0, 4095.0, seed);
        camera.step = 16;
        let found = estimate(&mut camera);
        let (g, r) = (found.noise.gain_e_per_dn, found.noise.read_noise_e);
        assert!((16.0 * g.value / 7.7 - 1.0).abs() < 0.02, "{g:?}");
        assert!((r.value / 2.0 - 1.0).abs() < 0.1, "{r:?}");
    }
}

#[test]
fn gain_and_read_noise_come_back_with_true_uncertainties() {
    for (gain, read, full, max) in CAMERAS {
        let (mut pulls, mut read_pulls) = (vec![], vec![]);
        for seed in 0..8 {
            let found = estimate(&mut Camera::new(gain, read, full, max, seed));
            let (g, r) = (found.noise.gain_e_per_dn, found.noise.read_noise_e);
            println!(
                "gain {:.4} ± {:.4} for {gain}, read {:.3} ± {:.3} for {read}, black {:.3} ± {:.3}, {:?}, chi2 {:.2}",
                g.value,
                g.u,
                r.value,
                r.u,
                found.black.value,
                found.black.u,
                found.white,
                found.noise.reduced_chi2
            );
            assert!((g.value / gain - 1.0).abs() < 0.02, "{g:?} for {gain}");
            assert!((r.value / read - 1.0).abs() < 0.1, "{r:?} for {read}");
            assert!((found.black.value - 200.0).abs() < 0.1, "{:?}", found.black);
            assert!(g.u < 0.01 * gain && r.u < 0.05 * read, "{g:?} {r:?}");
            pulls.push((g.value - gain) / g.u);
            read_pulls.push((r.value - read) / r.u);
        }
        for pulls in [&pulls, &read_pulls] {
            let n = pulls.len() as f64;
            let square = pulls.iter().map(|p| p * p).sum::<f64>() / n;
            // Of eight squares the mean lies in these bounds with 99.8 %.
            assert!(
                (0.1..3.3).contains(&square),
                "{gain}: {square} of {pulls:?}"
            );
        }
    }
}

#[test]
fn the_white_level_is_found_where_samples_pile_up() {
    // A full well below the converter's end, blurred by noise and pattern.
    let found = estimate(&mut Camera::new(0.5, 2.0, 30_000.0, 65_535.0, 1))
        .white
        .unwrap();
    // 200 + 30000/0.5, less seven times √(4² + 3²); the spread is whole DN.
    assert!((found.value - 60_165.0).abs() < 15.0, "{found:?}");
    assert!((found.u - 5.0).abs() < 1.5, "{found:?}");
    // The converter's end, which is sharp.
    let found = estimate(&mut Camera::new(7.0, 2.0, 40_000.0, 4095.0, 1)).white;
    assert_eq!(
        found,
        Some(Estimate {
            value: 4095.0,
            u: 0.0
        })
    );
}

#[test]
fn an_evenly_lit_surface_is_not_saturated() {
    let rng = &mut Pcg64Mcg::seed_from_u64(4);
    let mut white = White::new(200.0);
    for t in [1.0, 2.0, 4.0] {
        let mut samples = vec![200_u16; 40_000];
        for sample in &mut samples[20_000..] {
            *sample += (5000.0 * t + 40.0 * rng.sample::<f64, _>(StandardNormal)) as u16;
        }
        let frame = Frame {
            width: 200,
            height: 200,
            channels: 1,
            samples: samples.into(),
        };
        white.add(&frame, t).unwrap();
    }
    assert_eq!(white.white_level(), None);
}

#[test]
fn what_cannot_be_estimated_is_said() {
    let mut camera = Camera::new(0.5, 2.0, 30_000.0, 65_535.0, 1);
    assert_eq!(Darks::new().black_level(), Err(EstimateError::NoDarks));
    camera.black = 0.0;
    let clipped = Darks::new()
        .add(camera.expose(false, 0.1), 0.1)
        .unwrap_err();
    assert!(
        clipped.to_string().contains("is 0 DN: black is cut off"),
        "{clipped}"
    );
    let transfer = Transfer::new(0.0, 60_000.0);
    assert_eq!(transfer.noise(&[]), Err(EstimateError::NoOverlap));
    // Frames without noise, as a rendering would be.
    let mut transfer = Transfer::new(200.0, 60_000.0);
    for t in [1.0, 2.0] {
        let ramp = |scale: f64| Frame {
            width: SIDE,
            height: SIDE,
            channels: 1,
            samples: (0..SIDE * SIDE)
                .map(|i| (200.0 + scale * i as f64) as u16)
                .collect::<Vec<u16>>()
                .into(),
        };
        let dark = DarkFrame::new(&ramp(0.0), t).unwrap();
        transfer.add(&ramp(t), &dark, t).unwrap();
    }
    assert_eq!(transfer.noise(&[]), Err(EstimateError::NoPhotonNoise));
}

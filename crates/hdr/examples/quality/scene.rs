//! A scene whose every pixel is known, and what a merge of it can be at best.

use physics::{ChannelMap, Frame, Sensor};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal, Poisson, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::ops::Add;

/// Decades that the glow falls by.
const DECADES: f64 = 5.0;

/// Share of hot pixels.
const HOT: f64 = 2e-4;

/// Dark current of an ordinary pixel, electrons per second.
const CURRENT: f64 = 2.0;

/// Standard deviation of a pixel's own offset, DN.
const PATTERN_DN: f64 = 3.0;

/// A glow before a camera.
pub(crate) struct Scene {
    pub(crate) sensor: Sensor,
    pub(crate) exposures_s: Vec<f64>,
    width: usize,
    height: usize,
    /// Dark current, electrons per second, and offset, DN, of each pixel.
    pixels: Vec<(f32, f32)>,
}

/// Sums over the pixels of a decade of radiance.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Decade {
    pub(crate) pixels: f64,
    error: f64,
    bound: f64,
    z: f64,
}

impl Add for Decade {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            error: self.error + other.error,
            bound: self.bound + other.bound,
            z: self.z + other.z,
        }
    }
}

impl Decade {
    /// Root mean square of the relative error over that of the bound.
    pub(crate) fn over_bound(&self) -> f64 {
        (self.error / self.bound).sqrt()
    }

    /// Mean square of the residuals, each over its standard uncertainty.
    pub(crate) fn z_square(&self) -> f64 {
        self.z / self.pixels
    }
}

fn poisson(mean: f64, rng: &mut Pcg64Mcg) -> f64 {
    if mean <= 0.0 {
        0.0
    } else if mean > 1000.0 {
        // The skewness that a Gaussian lacks is below 0.03 and shifts no mean.
        let normal = Normal::new(mean, mean.sqrt()).expect("a finite mean");
        normal.sample(rng).round().max(0.0)
    } else {
        Poisson::new(mean).expect("a positive mean").sample(rng)
    }
}

impl Scene {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        let sensor = Sensor {
            gain_e_per_dn: 0.5,
            read_noise_e: 2.0,
            black_level_dn: 200.0,
            white_level_dn: 60_000.0,
            prnu_relative: 0.0,
        };
        let pixel = |rng: &mut Pcg64Mcg| {
            let current = if rng.random::<f64>() < HOT {
                100.0 * 50_f64.powf(rng.random())
            } else {
                CURRENT
            };
            let offset = PATTERN_DN * rng.sample::<f64, _>(StandardNormal);
            (current as f32, offset.round() as f32)
        };
        let pixels = (0..height)
            .into_par_iter()
            .flat_map_iter(|y| {
                let mut rng = Pcg64Mcg::seed_from_u64(y as u64);
                (0..width).map(move |_| pixel(&mut rng))
            })
            .collect();
        Self {
            sensor,
            // As a laboratory takes them: each about twice the last.
            exposures_s: (0..13)
                .map(|k| 1e-3 * 4000_f64.powf(f64::from(k) / 12.0))
                .collect(),
            width,
            height,
            pixels,
        }
    }

    /// Radiance of a pixel over that of the peak: even in the logarithm along a radius.
    fn share(&self, pixel: usize) -> f64 {
        let middle = [0.5 * self.width as f64, 0.5 * self.height as f64];
        let x = (pixel % self.width) as f64 + 0.5 - middle[0];
        let y = (pixel / self.width) as f64 + 0.5 - middle[1];
        10_f64.powf(-DECADES * x.hypot(y) / middle[0].hypot(middle[1]))
    }

    /// Electrons per second: the peak fills 80 % of the range in the shortest exposure.
    fn light(&self, pixel: usize) -> f64 {
        let range = self.sensor.white_level_dn - self.sensor.black_level_dn;
        let peak = 0.8 * range * self.sensor.gain_e_per_dn / self.exposures_s[0];
        peak * self.share(pixel)
    }

    /// Frame number `k`, or its dark.
    pub(crate) fn expose(&self, k: usize, lit: bool) -> Frame {
        let Sensor {
            gain_e_per_dn: gain,
            read_noise_e: read,
            black_level_dn: black,
            white_level_dn: white,
            ..
        } = self.sensor;
        let time = self.exposures_s[k];
        let mut samples = vec![0_u16; self.width * self.height];
        samples
            .par_chunks_mut(self.width)
            .enumerate()
            .for_each(|(y, row)| {
                let seed = ((2 * k + usize::from(lit)) * self.height + y) as u64;
                let rng = &mut Pcg64Mcg::seed_from_u64(1 << 40 | seed);
                for (x, sample) in row.iter_mut().enumerate() {
                    let pixel = y * self.width + x;
                    let (current, offset) = self.pixels[pixel];
                    let light = if lit { self.light(pixel) } else { 0.0 };
                    let electrons = poisson((light + f64::from(current)) * time, rng)
                        + read * rng.sample::<f64, _>(StandardNormal);
                    let dn = black + f64::from(offset) + electrons / gain;
                    *sample = dn.round().clamp(0.0, white) as u16;
                }
            });
        Frame {
            width: self.width,
            height: self.height,
            channels: 1,
            samples: samples.into(),
        }
    }

    /// The least variance of a pixel's radiance, (DN/s)².
    fn bound(&self, pixel: usize) -> f64 {
        let gain = self.sensor.gain_e_per_dn;
        let (current, offset) = self.pixels[pixel];
        let (light, current) = (self.light(pixel), f64::from(current));
        let read = (self.sensor.read_noise_e / gain).powi(2) + 1.0 / 12.0;
        let information = self.exposures_s.iter().map(|t| {
            let level = (light + current) * t / gain + f64::from(offset);
            if self.sensor.black_level_dn + level >= self.sensor.white_level_dn {
                return 0.0;
            }
            let electrons = (light + 2.0 * current) * t;
            t * t / (electrons / (gain * gain) + 2.0 * read)
        });
        1.0 / information.sum::<f64>()
    }

    /// Adds a measured pixel to its decade.
    pub(crate) fn judge(&self, pixel: usize, value: f32, variance: f32, decades: &mut [Decade]) {
        if variance.is_infinite() {
            return;
        }
        let truth = self.light(pixel) / self.sensor.gain_e_per_dn;
        let error = f64::from(value) - truth;
        let one = Decade {
            pixels: 1.0,
            error: (error / truth).powi(2),
            bound: self.bound(pixel) / (truth * truth),
            z: error * error / f64::from(variance),
        };
        let decade = &mut decades[-self.share(pixel).log10() as usize];
        *decade = *decade + one;
    }

    fn is_hot(&self, pixel: usize) -> bool {
        f64::from(self.pixels[pixel].0) > CURRENT
    }

    /// How many pixels are hot.
    pub(crate) fn hot(&self) -> usize {
        (0..self.pixels.len()).filter(|p| self.is_hot(*p)).count()
    }

    /// How many of them `map` gives as measured.
    pub(crate) fn missed(&self, map: &ChannelMap) -> usize {
        let kept = |pixel: &usize| self.is_hot(*pixel) && map.variance[*pixel].is_finite();
        (0..self.pixels.len()).filter(kept).count()
    }
}

//! From light to data numbers.

use crate::camera::Camera;
use crate::random::{normal, poisson};
use physics::random::{stream, uniform};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Dark current of hot pixels, electrons per second: even in the logarithm between these.
const HOT_E_PER_S: (f64, f64) = (100.0, 5000.0);

/// Samples that share one stream of random numbers. Part of what a seed means: another size
/// gives other pictures.
const BLOCK: usize = 1 << 15;

/// First words of the identity of each use of the seed, so that none shares a stream.
#[derive(Clone, Copy)]
pub(crate) enum Purpose {
    Pixels = 1,
    Shot = 2,
    Reflectance = 3,
    Eta = 4,
    Scale = 5,
    Shutter = 6,
    Shift = 7,
}

/// One sensor with its own pixels: the same in every shot.
#[derive(Clone, Debug)]
pub(crate) struct Pixels {
    /// Sensitivity to light, relative to the mean.
    sensitivity: Vec<f32>,
    /// Offset from the black level, DN.
    offset_dn: Vec<f32>,
    /// Dark current, electrons per second.
    dark_e_per_s: Vec<f32>,
    /// The rest of what the sensor does.
    readout: Readout,
    stray_e_per_s: f64,
}

/// From electrons to a data number.
#[derive(Clone, Copy, Debug)]
struct Readout {
    full_well_e: f64,
    read_noise_e: f64,
    dn_per_e: f64,
    black_level_dn: f64,
    max_dn: f64,
}

impl Pixels {
    /// The pixels that `seed` gives to `camera`.
    pub(crate) fn new(camera: &Camera, seed: u64) -> Self {
        let count = camera.width * camera.height * camera.samples_per_pixel();
        let mut sensitivity = vec![0.0; count];
        let mut offset_dn = vec![0.0; count];
        let mut dark_e_per_s = vec![0.0; count];
        let (hot_from, hot_to) = HOT_E_PER_S;
        sensitivity
            .par_chunks_mut(BLOCK)
            .zip(offset_dn.par_chunks_mut(BLOCK))
            .zip(dark_e_per_s.par_chunks_mut(BLOCK))
            .enumerate()
            .for_each(|(block, ((sensitivity, offset), dark))| {
                let mut rng = stream(seed, &[Purpose::Pixels as u64, block as u64]);
                for ((sensitivity, offset), dark) in sensitivity.iter_mut().zip(offset).zip(dark) {
                    // A sensitivity below 0 is no sensor.
                    *sensitivity = (1.0 + camera.prnu_relative * normal(&mut rng)).max(0.0) as f32;
                    *offset = (camera.fixed_pattern_dn * normal(&mut rng)) as f32;
                    let hot = uniform(&mut rng) < camera.hot_pixel_share;
                    *dark = if hot {
                        (hot_from * (hot_to / hot_from).powf(uniform(&mut rng))) as f32
                    } else {
                        camera.dark_current_e_per_s as f32
                    };
                }
            });
        Self {
            sensitivity,
            offset_dn,
            dark_e_per_s,
            readout: Readout {
                full_well_e: camera.full_well_e,
                read_noise_e: camera.read_noise_e,
                dn_per_e: 1.0 / camera.gain_e_per_dn(),
                black_level_dn: camera.black_level_dn,
                max_dn: camera.max_dn(),
            },
            stray_e_per_s: camera.stray_e_per_s,
        }
    }

    /// One exposure of `exposure_s`, under `light_e_per_s` on each sample where the beam is on.
    ///
    /// `seed` and `shot` name the random numbers, one stream per block of samples, so the result
    /// does not depend on threads.
    pub(crate) fn expose(
        &self,
        light_e_per_s: Option<&[f32]>,
        exposure_s: f64,
        seed: u64,
        shot: [u64; 3],
    ) -> Vec<u16> {
        let mut samples = vec![0; self.sensitivity.len()];
        let [role, exposure, repeat] = shot;
        samples
            .par_chunks_mut(BLOCK)
            .enumerate()
            .for_each(|(block, samples)| {
                let identity = [Purpose::Shot as u64, role, exposure, repeat, block as u64];
                let mut rng = stream(seed, &identity);
                let range = block * BLOCK..block * BLOCK + samples.len();
                let sensitivity = &self.sensitivity[range.clone()];
                let offset = &self.offset_dn[range.clone()];
                let dark = &self.dark_e_per_s[range.clone()];
                let light = light_e_per_s.map(|light| &light[range]);
                for (i, sample) in samples.iter_mut().enumerate() {
                    let beam = light.map_or(0.0, |light| f64::from(light[i]));
                    let photons = (beam + self.stray_e_per_s) * f64::from(sensitivity[i]);
                    let mean_e = (photons + f64::from(dark[i])) * exposure_s;
                    *sample = self
                        .readout
                        .data_number(&mut rng, mean_e, f64::from(offset[i]));
                }
            });
        samples
    }
}

impl Readout {
    /// The data number of a sample that collects `mean_e` electrons on average.
    fn data_number(&self, rng: &mut Pcg64Mcg, mean_e: f64, offset_dn: f64) -> u16 {
        // Ten standard deviations above the full well no draw can miss it.
        let electrons = if mean_e - 10.0 * mean_e.sqrt() > self.full_well_e {
            self.full_well_e
        } else {
            poisson(rng, mean_e).min(self.full_well_e)
        };
        let analog = (electrons + self.read_noise_e * normal(rng)) * self.dn_per_e;
        let dn = self.black_level_dn + offset_dn + analog;
        // The cast cuts off: half a step up first makes that rounding.
        (dn + 0.5).clamp(0.0, self.max_dn) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Channels;

    const SIDE: usize = 512;

    fn camera() -> Camera {
        Camera {
            width: SIDE,
            height: SIDE,
            channels: Channels::Mono,
            ..Camera::default()
        }
    }

    fn mean(values: impl Iterator<Item = f64>) -> f64 {
        values.sum::<f64>() / (SIDE * SIDE) as f64
    }

    fn moments(samples: &[u16]) -> (f64, f64) {
        let mean_dn = mean(samples.iter().map(|s| f64::from(*s)));
        let variance = mean(samples.iter().map(|s| (f64::from(*s) - mean_dn).powi(2)));
        (mean_dn, variance)
    }

    #[test]
    fn frames_have_the_mean_and_variance_of_the_sensor_model() {
        let even = Camera {
            prnu_relative: 0.0,
            fixed_pattern_dn: 0.0,
            hot_pixel_share: 0.0,
            ..camera()
        };
        let n = (SIDE * SIDE) as f64;
        let pixels = Pixels::new(&even, 1);
        for (rate, exposure_s) in [
            (0.0, 0.001),
            (0.0, 4.0),
            (1.0, 4.0),
            (20.0, 0.5),
            (500.0, 1.0),
            (24_000.0, 1.0),
        ] {
            let light = vec![rate as f32; SIDE * SIDE];
            let samples = pixels.expose(Some(&light), exposure_s, 5, [0, 1, 2]);
            let (mean_dn, variance) = moments(&samples);
            let electrons = (rate + 2.0 + 0.5) * exposure_s;
            // Photons and read-out through the gain of 0.5 e/DN; rounding adds 1/12.
            let expected_mean = 200.0 + electrons / 0.5;
            let expected_variance = (electrons + 4.0) / 0.25 + 1.0 / 12.0;
            assert!(
                (mean_dn - expected_mean).abs() < 4.5 * (expected_variance / n).sqrt(),
                "{rate} e/s, {exposure_s} s: {mean_dn} DN for {expected_mean}"
            );
            // At few electrons the kurtosis adds to the spread of the variance; 3 covers it.
            assert!(
                (variance / expected_variance - 1.0).abs() < 4.5 * (3.0 / n).sqrt(),
                "{rate} e/s, {exposure_s} s: {variance} DN² for {expected_variance}"
            );
        }
    }

    /// A mean frame of many shots shows what is fixed.
    fn mean_frame(pixels: &Pixels, light: Option<&[f32]>, exposure_s: f64) -> Vec<f64> {
        let shots = 64;
        let mut sum = vec![0.0; SIDE * SIDE];
        for repeat in 0..shots {
            let samples = pixels.expose(light, exposure_s, 9, [0, 0, repeat]);
            for (sum, sample) in sum.iter_mut().zip(samples) {
                *sum += f64::from(sample) / shots as f64;
            }
        }
        sum
    }

    #[test]
    fn pixels_differ_and_stay_themselves() {
        let camera = Camera {
            prnu_relative: 0.02,
            read_noise_e: 0.5,
            ..camera()
        };
        let pixels = Pixels::new(&camera, 3);
        let dark = mean_frame(&pixels, None, 0.001);
        let light = vec![20_000.0; SIDE * SIDE];
        let lit = mean_frame(&pixels, Some(&light), 1.0);
        let level = mean(dark.iter().copied());
        let fixed = mean(dark.iter().map(|v| (v - level).powi(2))).sqrt();
        // 3 DN of pattern; the noise of 64 shots, 0.13 DN, adds 1e-3 of it.
        assert!((fixed / 3.0 - 1.0).abs() < 0.01, "{fixed} DN");
        // Hot pixels are out of the ordinary by more than sensitivity can explain.
        let signal: Vec<f64> = lit.iter().zip(&dark).map(|(l, d)| l - d).collect();
        let level = mean(signal.iter().copied());
        let cool: Vec<f64> = signal
            .iter()
            .map(|s| s / level - 1.0)
            .filter(|d| d.abs() < 0.1)
            .collect();
        let spread = (cool.iter().map(|d| d * d).sum::<f64>() / cool.len() as f64).sqrt();
        // The noise of 64 shots is 0.9e-3 beside 0.02: 1e-3 of it.
        assert!((spread / 0.02 - 1.0).abs() < 0.01, "{spread}");
    }

    #[test]
    fn some_pixels_are_hot() {
        let camera = Camera {
            hot_pixel_share: 0.01,
            ..camera()
        };
        let pixels = Pixels::new(&camera, 3);
        let hot: Vec<f64> = pixels
            .dark_e_per_s
            .iter()
            .filter(|d| **d > 1.0)
            .map(|d| f64::from(*d))
            .collect();
        let expected = 0.01 * (SIDE * SIDE) as f64;
        let count = hot.len() as f64;
        assert!((count - expected).abs() < 4.5 * expected.sqrt(), "{count}");
        assert!(hot.iter().all(|d| (100.0..=5000.0).contains(d)));
        // The median of a distribution that is even in the logarithm is the geometric mean.
        let below = hot
            .iter()
            .filter(|d| **d < (100.0_f64 * 5000.0).sqrt())
            .count() as f64;
        assert!((below / count - 0.5).abs() < 4.5 * 0.5 / count.sqrt());
        // They show in a dark frame of 4 s: 800 DN and more above their neighbours.
        let samples = pixels.expose(None, 4.0, 1, [1, 12, 0]);
        let bright = samples.iter().filter(|s| **s > 600).count() as f64;
        assert!((bright / count - 1.0).abs() < 0.01, "{bright} of {count}");
    }

    #[test]
    fn saturated_samples_reach_the_white_level_and_no_other_does() {
        for bits in [16, 12] {
            for gain_e_per_dn in [None, Some(1.0)] {
                let camera = Camera {
                    bits,
                    gain_e_per_dn,
                    ..camera()
                };
                let white = camera.sensor().white_level_dn;
                let pixels = Pixels::new(&camera, 3);
                let expose = |rate: f32| {
                    let light = vec![rate; SIDE * SIDE];
                    pixels.expose(Some(&light), 1.0, 2, [0, 0, 0])
                };
                for rate in [1.1e5, 1e9] {
                    for sample in expose(rate) {
                        let dn = f64::from(sample);
                        assert!(dn >= white && dn <= camera.max_dn(), "{bits} bits: {dn} DN");
                    }
                }
                // At 80 % of the range nothing saturates but what is hot.
                let (peak, hot) = (camera.peak_e(), 5000.0);
                let saturated = expose((peak - hot) as f32)
                    .into_iter()
                    .filter(|s| f64::from(*s) >= white)
                    .count();
                assert_eq!(saturated, 0, "{bits} bits, {gain_e_per_dn:?}");
            }
        }
    }

    #[test]
    fn nothing_falls_below_zero() {
        let camera = Camera {
            black_level_dn: 0.0,
            ..camera()
        };
        let samples = Pixels::new(&camera, 3).expose(None, 0.001, 2, [1, 0, 0]);
        let zero = samples.iter().filter(|s| **s == 0).count() as f64;
        assert!((zero / (SIDE * SIDE) as f64 - 0.5).abs() < 0.05, "{zero}");
        assert!(samples.iter().all(|s| *s < 100));
    }
}

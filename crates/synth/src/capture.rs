//! A capture: a material in front of a camera, and the shots of it.

use crate::camera::{Camera, Channels, Exit};
use crate::error::SynthError;
use crate::glow::Glow;
use crate::picture::{Tilt, View};
use crate::random::normal;
use crate::sensor::{Pixels, Purpose};
use crate::truth::{ChannelTruth, Truth};
use physics::random::stream;
use physics::{Coefficients, ExitFactor, ForwardModel, Frame, ReducedMedium, fresnel};

/// A material to be photographed.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Name of the material.
    pub material: String,
    /// Relative index that is stated.
    pub eta: f64,
    /// Coefficients by channel name. A mono camera takes one, whatever its name.
    pub channels: Vec<(String, Coefficients)>,
}

/// Four points.
pub type Corners = [[f64; 2]; 4];

/// Makes the model of diffuse reflectance for a relative index.
pub type ModelAt<'a> = &'a dyn Fn(f64) -> Box<dyn ForwardModel>;

/// A picture of the sample to be made otherwise than by the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Which channel of the camera, from 0.
    pub channel: usize,
    /// The sample in that channel.
    pub coefficients: Coefficients,
    /// Its true relative index.
    pub eta: f64,
    /// True side of a pixel, mm.
    pub mm_per_pixel: f64,
    /// Where the beam falls, the middle of the first pixel being (0, 0).
    pub spot_px: [f64; 2],
}

/// Makes such a picture: π times the radiance of every pixel per incident power, mm⁻², row by row.
pub type PictureOf<'a> = &'a dyn Fn(&Wanted) -> Vec<f32>;

/// What a shot shows.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub enum Role {
    /// The sample under the beam.
    Sample,
    /// The sample with the beam blocked.
    SampleDark,
    /// The white reference under the beam.
    Reference,
    /// The white reference with the beam blocked.
    ReferenceDark,
}

/// One press of the shutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// What it shows.
    pub role: Role,
    /// Which of the camera's exposures, from 0.
    pub exposure: usize,
    /// Exposure time, s.
    pub exposure_s: f64,
    /// Which of several equal shots, from 0.
    pub repeat: usize,
}

/// A material in front of a camera.
#[derive(Clone, Debug)]
pub struct Capture {
    camera: Camera,
    truth: Truth,
    pixels: Pixels,
    /// Electrons per second, channels interleaved.
    sample_e_per_s: Vec<f32>,
    reference_e_per_s: Vec<f32>,
    view: View,
    /// What makes the light of each channel of the sample and of the reference, where every frame
    /// is shifted by its own: the glow, and electrons per second for 1 mm⁻².
    glows: [Vec<(Glow, f64)>; 2],
}

impl Capture {
    /// The capture of `sample` by `camera`, every random number from `seed`.
    ///
    /// `model` makes the light of sample and reference alike, each at its own index.
    ///
    /// # Errors
    ///
    /// [`SynthError`] names what is wrong with the camera or the sample.
    pub fn new(
        sample: &Sample,
        camera: Camera,
        model: ModelAt,
        seed: u64,
    ) -> Result<Self, SynthError> {
        Self::pictured(sample, camera, model, None, seed)
    }

    /// As [`Self::new`], but with pictures of the sample from elsewhere, if there are some: the white
    /// is the model's all the same.
    ///
    /// # Errors
    ///
    /// As [`Self::new`]; [`SynthError::Pictured`] names what a picture has not.
    pub fn pictured(
        sample: &Sample,
        camera: Camera,
        model: ModelAt,
        pictures: Option<PictureOf>,
        seed: u64,
    ) -> Result<Self, SynthError> {
        let camera = camera.validated()?;
        if pictures.is_some() {
            for (key, plain) in [
                ("camera_angle_deg", camera.camera_angle_deg == 0.0),
                ("camera_distance_mm", camera.camera_distance_mm.is_none()),
                ("pixel_aspect", camera.pixel_aspect == 1.0),
                ("beam_angle_deg", camera.beam_angle_deg == 0.0),
                ("frame_shift_px", camera.frame_shift_px == 0.0),
                ("flare_relative", camera.flare_relative == 0.0),
                ("entry_loss", camera.entry_loss),
                ("exit", camera.exit == Exit::Fresnel),
            ] {
                if !plain {
                    return Err(SynthError::Pictured(key));
                }
            }
        }
        let coefficients = in_camera_order(sample, camera.channels)?;
        let draws = Draws::new(sample, &camera, seed);
        let whites = reference_coefficients(&camera);
        for (of, eta, all) in [
            ("sample", sample.eta, &coefficients),
            ("sample", draws.eta, &coefficients),
            ("reference", camera.reference.eta, &whites),
        ] {
            check(of, eta, all, camera.channels)?;
        }

        let view = View {
            spot_px: camera.spot_px(),
            ..view_of(&camera, draws.mm_per_pixel)
        };
        let (sample_model, reference_model) = (model(draws.eta), model(camera.reference.eta));
        let entry_factor = if camera.entry_loss {
            fresnel::entry_factor(draws.eta, camera.beam_angle_deg.to_radians().cos())
        } else {
            1.0
        };
        let cos_view = camera.camera_angle_deg.to_radians().cos();
        let exit_of = |at: Coefficients| match camera.exit {
            Exit::Fresnel => sample_model.exit_factor(at, cos_view),
            Exit::Lambert => ExitFactor::even(1.0),
        };

        let count = camera.channels.count();
        let samples = camera.width * camera.height * camera.samples_per_pixel();
        let mut sample_e_per_s = vec![0.0; samples];
        let mut reference_e_per_s = vec![0.0; samples];
        let mut channels = vec![];
        let mut glows = [vec![], vec![]];
        for (index, name) in camera.channels.names().iter().enumerate() {
            let picture = |of, model: &dyn ForwardModel, at, exit: &ExitFactor, factor: f64| {
                let glow = Glow::new(model, at, exit, camera.beam(), view.reach_mm());
                let pixels = seen(&view, &glow, &camera);
                let brightest = pixels.iter().fold(0.0_f32, |m, v| m.max(*v));
                let peak_per_mm2 = f64::from(brightest) * factor;
                if peak_per_mm2 > 0.0 && peak_per_mm2.is_finite() {
                    Ok((pixels, peak_per_mm2, factor, glow))
                } else {
                    Err(SynthError::NoLight {
                        of,
                        channel: (*name).to_owned(),
                        peak_per_mm2,
                    })
                }
            };
            let (at, white) = (coefficients[index], whites[index]);
            let reflectance = draws.reflectance[index];
            // Whatever the white absorbs or loses on its way is in its certified reflectance.
            let white_factor = reflectance / reference_model.beyond(white, 0.0);
            let exit = exit_of(at);
            let mut glow = picture("sample", &*sample_model, at, &exit, entry_factor)?;
            if let Some(pictures) = pictures {
                let pixels = pictures(&Wanted {
                    channel: index,
                    coefficients: at,
                    eta: draws.eta,
                    mm_per_pixel: draws.mm_per_pixel,
                    spot_px: view.spot_px,
                });
                assert_eq!(pixels.len(), camera.width * camera.height);
                // What enters, and how it leaves, is in the picture already.
                let brightest = pixels.iter().fold(0.0_f32, |m, v| m.max(*v));
                glow = (pixels, f64::from(brightest), 1.0, glow.3);
            }
            let lambert = ExitFactor::even(1.0);
            let white_glow = picture(
                "reference",
                &*reference_model,
                white,
                &lambert,
                white_factor,
            )?;
            let signal = camera.peak_e() / camera.shortest_s() / glow.1.max(white_glow.1);
            for ((out, (pixels, _, factor, glow)), glows) in [
                (&mut sample_e_per_s, glow),
                (&mut reference_e_per_s, white_glow),
            ]
            .into_iter()
            .zip(&mut glows)
            {
                if camera.frame_shift_px > 0.0 {
                    glows.push((glow, factor * signal));
                }
                let light = |pixel: f32| (f64::from(pixel) * factor * signal) as f32;
                if let Some(mosaic) = camera.mosaic {
                    for (at, (out, pixel)) in out.iter_mut().zip(pixels).enumerate() {
                        if mosaic.colour(at % camera.width, at / camera.width) == index {
                            *out = light(pixel);
                        }
                    }
                } else {
                    for (out, pixel) in out.iter_mut().skip(index).step_by(count).zip(pixels) {
                        *out = light(pixel);
                    }
                }
            }
            channels.push(ChannelTruth {
                channel: (*name).to_owned(),
                sigma_a_per_mm: at.sigma_a,
                sigma_s_prime_per_mm: at.sigma_s_prime,
                total_reflectance: sample_model.beyond(at, 0.0),
                exit_factor: exit.mean,
                reference_reflectance_true: reflectance,
                signal_e_mm2_per_s: signal,
            });
        }
        let truth = Truth {
            material: sample.material.clone(),
            seed,
            model: sample_model.name().to_owned(),
            eta_stated: sample.eta,
            eta_true: draws.eta,
            mm_per_pixel_stated: camera.mm_per_pixel,
            mm_per_pixel_true: draws.mm_per_pixel,
            beam_fwhm_mm: camera.beam_fwhm_mm,
            beam_profile: camera.beam_profile,
            entry_factor,
            sample_center_px: view.spot_px,
            reference_center_px: view.spot_px,
            reference_reflectance_stated: camera.reference.reflectance,
            channels,
        };
        Ok(Self {
            pixels: Pixels::new(&camera, seed),
            camera,
            truth,
            sample_e_per_s,
            reference_e_per_s,
            view,
            glows,
        })
    }

    /// The camera behind the pictures.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// What a measurement ought to find.
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// Four points of a tilted picture, px, and where on the surface they are, mm, by the scale
    /// that the manifest states; nothing for a camera above the sample.
    pub fn corners(&self) -> Option<(Corners, Corners)> {
        self.camera.camera_distance_mm?;
        let view = view_of(&self.camera, self.camera.mm_per_pixel);
        let at = |share: f64, size: usize| (share * size as f64).round();
        let (left, right) = (at(0.1, self.camera.width), at(0.9, self.camera.width));
        let (top, bottom) = (at(0.1, self.camera.height), at(0.9, self.camera.height));
        let px = [[left, top], [right, top], [right, bottom], [left, bottom]];
        Some((px, px.map(|[column, row]| view.place(column, row).0)))
    }

    /// Every shot, in the order in which a laboratory would take them.
    pub fn shots(&self) -> Vec<Shot> {
        let darks = self.camera.darks_per_exposure;
        let mut shots = vec![];
        for (role, repeats) in [
            (Role::Sample, 1),
            (Role::SampleDark, darks),
            (Role::Reference, 1),
            (Role::ReferenceDark, darks),
        ] {
            for (exposure, &exposure_s) in self.camera.exposures_s.iter().enumerate() {
                for repeat in 0..repeats {
                    shots.push(Shot {
                        role,
                        exposure,
                        exposure_s,
                        repeat,
                    });
                }
            }
        }
        shots
    }

    /// The frame of one shot: the same for the same shot, whatever was exposed before.
    pub fn expose(&self, shot: &Shot) -> Frame {
        let (still, glows) = match shot.role {
            Role::Sample => (Some(&self.sample_e_per_s[..]), &self.glows[0]),
            Role::Reference => (Some(&self.reference_e_per_s[..]), &self.glows[1]),
            Role::SampleDark | Role::ReferenceDark => (None, &self.glows[0]),
        };
        let shifted = (still.is_some() && !glows.is_empty()).then(|| self.shifted(glows, shot));
        let light = shifted.as_deref().or(still);
        let identity = [shot.role as u64, shot.exposure as u64, shot.repeat as u64];
        Frame {
            width: self.camera.width,
            height: self.camera.height,
            channels: self.camera.samples_per_pixel(),
            samples: self
                .pixels
                .expose(
                    light,
                    shot.exposure_s * self.shutter(shot),
                    self.truth.seed,
                    identity,
                )
                .into(),
        }
    }

    /// The light of a shot whose camera has moved, electrons per second.
    fn shifted(&self, glows: &[(Glow, f64)], shot: &Shot) -> Vec<f32> {
        let identity = [
            Purpose::Shift as u64,
            shot.role as u64,
            shot.exposure as u64,
        ];
        let mut rng = stream(self.truth.seed, &identity);
        let spot = self.view.spot_px;
        let shift = spot.map(|at| at + self.camera.frame_shift_px * normal(&mut rng));
        let view = View {
            spot_px: shift,
            ..self.view
        };
        let count = glows.len();
        let mut light = vec![0.0; self.camera.width * self.camera.height * count];
        for (index, (glow, signal)) in glows.iter().enumerate() {
            for (out, pixel) in
                light
                    .iter_mut()
                    .skip(index)
                    .step_by(count)
                    .zip(seen(&view, glow, &self.camera))
            {
                *out = (f64::from(pixel) * signal) as f32;
            }
        }
        light
    }

    /// How long the shutter really is open, over what is stated.
    fn shutter(&self, shot: &Shot) -> f64 {
        match shot.role {
            Role::Sample | Role::Reference => {
                let identity = [
                    Purpose::Shutter as u64,
                    shot.role as u64,
                    shot.exposure as u64,
                ];
                let mut rng = stream(self.truth.seed, &identity);
                1.0 + self.camera.exposure_error_relative * normal(&mut rng)
            }
            Role::SampleDark | Role::ReferenceDark => 1.0,
        }
    }
}

/// The picture of `glow` with what the lens spreads of it.
fn seen(view: &View, glow: &Glow, camera: &Camera) -> Vec<f32> {
    let mut pixels = view.picture(glow);
    if camera.flare_relative > 0.0 {
        let sum: f64 = pixels.iter().map(|v| f64::from(*v)).sum();
        let veil = (camera.flare_relative * sum / pixels.len() as f64) as f32;
        for pixel in &mut pixels {
            *pixel += veil;
        }
    }
    pixels
}

fn view_of(camera: &Camera, mm_per_pixel: f64) -> View {
    View {
        width: camera.width,
        height: camera.height,
        mm_per_pixel,
        aspect: camera.pixel_aspect,
        tilt: camera.camera_distance_mm.map(|distance_mm| Tilt {
            angle: camera.camera_angle_deg.to_radians(),
            distance_mm,
        }),
        spot_px: [0.0; 2],
    }
}

/// What is true where the manifest states a number with an uncertainty.
struct Draws {
    eta: f64,
    mm_per_pixel: f64,
    reflectance: Vec<f64>,
}

impl Draws {
    fn new(sample: &Sample, camera: &Camera, seed: u64) -> Self {
        let draw = |stated: f64, u: f64, purpose: Purpose, index: usize| {
            stated + u * normal(&mut stream(seed, &[purpose as u64, index as u64]))
        };
        let white = &camera.reference;
        Self {
            eta: draw(sample.eta, camera.u_eta, Purpose::Eta, 0),
            mm_per_pixel: draw(
                camera.mm_per_pixel,
                camera.u_mm_per_pixel,
                Purpose::Scale,
                0,
            ),
            // A certificate has a value of its own for every wavelength.
            reflectance: (0..camera.channels.count())
                .map(|channel| {
                    draw(
                        white.reflectance,
                        white.u_reflectance,
                        Purpose::Reflectance,
                        channel,
                    )
                })
                .collect(),
        }
    }
}

/// The sample's coefficients in the order of the camera's channels.
fn in_camera_order(sample: &Sample, channels: Channels) -> Result<Vec<Coefficients>, SynthError> {
    if sample.channels.len() != channels.count() {
        return Err(SynthError::ChannelCount {
            camera: channels.count(),
            sample: sample.channels.len(),
        });
    }
    if channels == Channels::Mono {
        return Ok(sample.channels.iter().map(|(_, at)| *at).collect());
    }
    channels
        .names()
        .iter()
        .map(|&name| {
            let found = sample.channels.iter().find(|(n, _)| n == name);
            found
                .map(|(_, at)| *at)
                .ok_or(SynthError::MissingChannel(name))
        })
        .collect()
}

fn reference_coefficients(camera: &Camera) -> Vec<Coefficients> {
    let white = &camera.reference;
    white
        .sigma_a_per_mm(camera.channels)
        .into_iter()
        .zip(white.sigma_s_prime_per_mm(camera.channels))
        .map(|(sigma_a, sigma_s_prime)| Coefficients {
            sigma_a,
            sigma_s_prime,
        })
        .collect()
}

fn check(
    of: &'static str,
    eta: f64,
    all: &[Coefficients],
    channels: Channels,
) -> Result<(), SynthError> {
    for (at, name) in all.iter().zip(channels.names()) {
        let medium = ReducedMedium {
            sigma_a: at.sigma_a,
            sigma_s_prime: at.sigma_s_prime,
            eta,
        };
        medium.validated().map_err(|source| SynthError::Medium {
            of,
            channel: (*name).to_owned(),
            source,
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::WhiteReference;
    use physics::{DiffuseFresnel, Dipole, DipoleModel, InvalidMedium};

    fn dipole(eta: f64) -> Box<dyn ForwardModel> {
        Box::new(DipoleModel::new(eta, DiffuseFresnel::Exact))
    }

    fn marble() -> Sample {
        let at = |sigma_a, sigma_s_prime| Coefficients {
            sigma_a,
            sigma_s_prime,
        };
        Sample {
            material: "Marble".into(),
            eta: 1.5,
            channels: vec![
                ("R".into(), at(0.0021, 2.19)),
                ("G".into(), at(0.0041, 2.62)),
                ("B".into(), at(0.0071, 3.00)),
            ],
        }
    }

    fn small() -> Camera {
        Camera {
            width: 96,
            height: 80,
            exposures_s: vec![0.001, 0.03, 1.0],
            ..Camera::default()
        }
    }

    fn capture(camera: Camera, seed: u64) -> Capture {
        Capture::new(&marble(), camera, &dipole, seed).unwrap()
    }

    #[test]
    fn any_order_and_any_number_of_threads_give_the_same_frames() {
        let first = capture(small(), 42);
        let frames: Vec<Frame> = first.shots().iter().map(|s| first.expose(s)).collect();
        assert_eq!(frames.len(), 12);
        for (i, a) in frames.iter().enumerate() {
            assert!(
                frames[..i].iter().all(|b| a.samples != b.samples),
                "shot {i}"
            );
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        pool.install(|| {
            let again = capture(small(), 42);
            assert_eq!(again.truth(), first.truth());
            for (shot, frame) in again.shots().iter().zip(&frames).rev() {
                assert_eq!(&again.expose(shot), frame, "{shot:?}");
            }
        });
        let other = capture(small(), 43);
        assert_ne!(other.expose(&other.shots()[0]), frames[0]);
        assert_ne!(
            other.truth().channels[0].reference_reflectance_true,
            first.truth().channels[0].reference_reflectance_true
        );
    }

    #[test]
    fn the_brightest_pixel_fills_four_fifths_of_the_range() {
        for (camera, range_e) in [
            (small(), 30_000.0),
            (
                Camera {
                    bits: 12,
                    ..small()
                },
                30_000.0,
            ),
            (
                Camera {
                    channels: Channels::Mono,
                    gain_e_per_dn: Some(0.25),
                    ..small()
                },
                16_333.75,
            ),
        ] {
            let mut sample = marble();
            sample.channels.truncate(camera.channels.count());
            let capture = Capture::new(&sample, camera, &dipole, 1).unwrap();
            let count = capture.camera.channels.count();
            for channel in 0..count {
                let brightest = |light: &[f32]| {
                    let of = light.iter().skip(channel).step_by(count);
                    f64::from(of.fold(0.0_f32, |m, v| m.max(*v)))
                };
                let peak =
                    brightest(&capture.sample_e_per_s).max(brightest(&capture.reference_e_per_s));
                assert!(
                    (peak * 0.001 / (0.8 * range_e) - 1.0).abs() < 1e-6,
                    "{peak}"
                );
            }
        }
    }

    /// Share of a frame's light over the same of the reference, against what the manifest's
    /// numbers and the physics say, the light outside the frame aside.
    #[test]
    fn sample_and_reference_share_one_scale() {
        // Media so dense that all of their light is in the frame.
        let at = Coefficients {
            sigma_a: 5.0,
            sigma_s_prime: 60.0,
        };
        let sample = Sample {
            material: "Ink".into(),
            eta: 1.4,
            channels: vec![("633 nm".into(), at)],
        };
        let white = WhiteReference {
            reflectance: 0.8,
            sigma_s_prime_per_mm: Some(vec![200.0]),
            sigma_a_per_mm: Some(vec![1.0]),
            ..WhiteReference::default()
        };
        for (entry_loss, exit, factor) in [
            // (1 − (0.4/2.4)²) twice, over 1 − F_dr,ext from Duntley's closed form at 1.4.
            (
                true,
                Exit::Fresnel,
                (35.0_f64 / 36.0).powi(2) / (1.0 - 0.076_812),
            ),
            (true, Exit::Lambert, 35.0 / 36.0),
            (false, Exit::Fresnel, 35.0 / 36.0 / (1.0 - 0.076_812)),
            (false, Exit::Lambert, 1.0),
        ] {
            let camera = Camera {
                width: 256,
                height: 256,
                channels: Channels::Mono,
                entry_loss,
                exit,
                reference: white.clone(),
                ..Camera::default()
            };
            let capture = Capture::new(&sample, camera, &dipole, 8).unwrap();
            let sum = |light: &[f32]| light.iter().map(|v| f64::from(*v)).sum::<f64>();
            let ratio = sum(&capture.sample_e_per_s) / sum(&capture.reference_e_per_s);
            let medium = ReducedMedium {
                sigma_a: 5.0,
                sigma_s_prime: 60.0,
                eta: 1.4,
            };
            let total = Dipole::new(&medium, DiffuseFresnel::Exact).total_reflectance();
            let truth = &capture.truth().channels[0];
            let expected = total * factor / truth.reference_reflectance_true;
            assert!(
                (ratio / expected - 1.0).abs() < 1e-5,
                "{entry_loss}, {exit:?}: {ratio} for {expected}"
            );
            assert_eq!(truth.total_reflectance, total);
            // The sum in mm⁻² is K·Φ times what leaves.
            let absolute = sum(&capture.reference_e_per_s) * 0.04 * 0.04;
            let expected = truth.signal_e_mm2_per_s * truth.reference_reflectance_true;
            assert!((absolute / expected - 1.0).abs() < 1e-5, "{absolute}");
        }
    }

    #[test]
    fn true_values_scatter_as_stated() {
        let camera = Camera {
            u_eta: 0.01,
            u_mm_per_pixel: 0.0002,
            ..Camera::default()
        };
        let (sample, captures) = (marble(), 4000);
        let draws: Vec<Draws> = (0..captures)
            .map(|s| Draws::new(&sample, &camera, s))
            .collect();
        type Pick = fn(&Draws) -> f64;
        let n = captures as f64;
        let standardised: [(&str, Pick); 4] = [
            ("eta", |d| (d.eta - 1.5) / 0.01),
            ("scale", |d| (d.mm_per_pixel - 0.04) / 0.0002),
            ("R", |d| (d.reflectance[0] - 0.99) / 0.005),
            ("B", |d| (d.reflectance[2] - 0.99) / 0.005),
        ];
        for (i, (name, pick)) in standardised.iter().enumerate() {
            let mean = draws.iter().map(pick).sum::<f64>() / n;
            let square = draws.iter().map(|d| pick(d).powi(2)).sum::<f64>() / n;
            assert!(mean.abs() < 4.5 / n.sqrt(), "{name}: mean {mean}");
            assert!(
                (square - 1.0).abs() < 4.5 * (2.0 / n).sqrt(),
                "{name}: variance {square}"
            );
            for (other_name, other) in &standardised[..i] {
                let product = draws.iter().map(|d| pick(d) * other(d)).sum::<f64>() / n;
                assert!(
                    product.abs() < 4.5 / n.sqrt(),
                    "{name}, {other_name}: {product}"
                );
            }
        }
        // Nothing is drawn where nothing is uncertain.
        let exact = Draws::new(&sample, &Camera::default(), 5);
        assert_eq!((exact.eta, exact.mm_per_pixel), (1.5, 0.04));
    }

    #[test]
    fn the_truth_survives_a_file() {
        let capture = capture(small(), 1);
        let text = toml::to_string(capture.truth()).unwrap();
        assert_eq!(&toml::from_str::<Truth>(&text).unwrap(), capture.truth());
        assert_eq!(capture.truth().sample_center_px, [47.8, 39.3]);
    }

    #[test]
    fn the_spot_is_where_the_truth_says() {
        let offset = [7.3, -5.6];
        let capture = capture(
            Camera {
                spot_offset_px: offset,
                ..small()
            },
            1,
        );
        // The centroid of a small window about the spot, of green light.
        let [x, y] = capture.truth().sample_center_px;
        let (mut sum, mut in_x, mut in_y) = (0.0, 0.0, 0.0);
        for row in 0..80 {
            for column in 0..96 {
                let (dx, dy) = (column as f64 - x, row as f64 - y);
                let light = f64::from(capture.sample_e_per_s[(row * 96 + column) * 3 + 1]);
                // A high power, so that the border cuts off nothing.
                let w = light.powi(12);
                sum += w;
                in_x += w * dx;
                in_y += w * dy;
            }
        }
        assert!((in_x / sum).abs() < 1e-3 && (in_y / sum).abs() < 1e-3);
    }

    #[test]
    fn bad_samples_are_named() {
        let new = |sample: &Sample| Capture::new(sample, small(), &dipole, 1).map(|_| ());
        let mut two = marble();
        two.channels.pop();
        assert_eq!(
            new(&two),
            Err(SynthError::ChannelCount {
                camera: 3,
                sample: 2
            })
        );
        let mut renamed = marble();
        renamed.channels[1].0 = "green".into();
        assert_eq!(new(&renamed), Err(SynthError::MissingChannel("G")));
        let mut gain = marble();
        gain.channels[2].1.sigma_a = -1.0;
        assert_eq!(
            new(&gain),
            Err(SynthError::Medium {
                of: "sample",
                channel: "B".into(),
                source: InvalidMedium::SigmaA(-1.0)
            })
        );
        let dense = Sample {
            eta: f64::NAN,
            ..marble()
        };
        assert!(matches!(new(&dense), Err(SynthError::Medium { .. })));
        let mut black = marble();
        black.channels[0].1 = Coefficients {
            sigma_a: 1e300,
            sigma_s_prime: 1e-300,
        };
        assert!(matches!(
            new(&black),
            Err(SynthError::NoLight { of: "sample", .. })
        ));
    }
}

//! The bench, the sensor and the white reference, as a person describes them.

use crate::error::SynthError;
use physics::footprint::Beam;
use physics::frame::channel_names;
use physics::{Mosaic, Sensor};
use serde::{Deserialize, Serialize};

/// Colour channels of the sensor.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Channels {
    /// R, G and B, each at every pixel.
    #[default]
    Rgb,
    /// One, called Y.
    Mono,
}

impl Channels {
    /// How many there are.
    pub fn count(self) -> usize {
        match self {
            Self::Rgb => 3,
            Self::Mono => 1,
        }
    }

    /// Their names, in order.
    pub fn names(self) -> &'static [&'static str] {
        channel_names(self.count())
    }
}

/// Power of the beam across the surface.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BeamProfile {
    /// A Gaussian.
    #[default]
    Gaussian,
    /// An even disk.
    Disk,
}

/// Directions in which light leaves the sample.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Exit {
    /// Isotropic inside, then refracted by a smooth surface.
    #[default]
    Fresnel,
    /// Equal radiance in all directions, as the paper has it.
    Lambert,
}

/// A white diffuser of known reflectance, which glows as any translucent matter does.
///
/// It is taken for a Lambertian surface; what its certificate states holds for the light that
/// falls on it, so no factor of entry or exit applies.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct WhiteReference {
    /// Reflectance on the certificate.
    pub reflectance: f64,
    /// Standard uncertainty of the reflectance. The true one is drawn from it, one draw per
    /// channel, without a bound at 1: a cut tail would make the stated uncertainty wrong.
    pub u_reflectance: f64,
    /// σₛ′ of each channel, mm⁻¹. Left out: Spectralon as Jensen et al. (2001) measured it, 11.6,
    /// 20.4 and 14.9 for R, G and B, and the green value for a mono camera.
    pub sigma_s_prime_per_mm: Option<Vec<f64>>,
    /// σₐ of each channel, mm⁻¹. Left out: 0.
    pub sigma_a_per_mm: Option<Vec<f64>>,
    /// Relative index.
    pub eta: f64,
}

impl Default for WhiteReference {
    fn default() -> Self {
        Self {
            reflectance: 0.99,
            u_reflectance: 0.005,
            sigma_s_prime_per_mm: None,
            sigma_a_per_mm: None,
            eta: 1.3,
        }
    }
}

impl WhiteReference {
    /// σₛ′ of each of `channels`, mm⁻¹, the default filled in.
    pub fn sigma_s_prime_per_mm(&self, channels: Channels) -> Vec<f64> {
        self.sigma_s_prime_per_mm
            .clone()
            .unwrap_or_else(|| match channels {
                Channels::Rgb => vec![11.6, 20.4, 14.9],
                Channels::Mono => vec![20.4],
            })
    }

    /// σₐ of each of `channels`, mm⁻¹, the default filled in.
    pub fn sigma_a_per_mm(&self, channels: Channels) -> Vec<f64> {
        self.sigma_a_per_mm
            .clone()
            .unwrap_or_else(|| vec![0.0; channels.count()])
    }
}

/// A bench with its beam, sensor and white reference.
///
/// Any key may be left out; the default is a cooled 16-bit RGB camera that looks straight down
/// at a beam of 0.3 mm. The power of the beam is no key: it is set so that the brightest pixel
/// of the sample and of the reference fills 80 % of the range in the shortest exposure.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Camera {
    /// Pixels in a row. Default 1024.
    pub width: usize,
    /// Rows. Default 1024.
    pub height: usize,
    /// Side of a pixel on the sample, mm. Default 0.04.
    pub mm_per_pixel: f64,
    /// Standard uncertainty of `mm_per_pixel`, mm: the true scale is drawn from it. Default 0.
    pub u_mm_per_pixel: f64,
    /// Standard uncertainty of the sample's index: the true one is drawn from it. Default 0.
    pub u_eta: f64,
    /// Channels: `rgb` (the default) or `mono`.
    pub channels: Channels,
    /// Pattern of a colour filter array, as in `RGGB`: each photosite then has the colour that the
    /// pattern gives it, and a frame one sample a pixel. Default: none.
    pub mosaic: Option<Mosaic>,
    /// Exposure times, s. Default: 13 from 1 ms to 4 s, each about twice the last.
    pub exposures_s: Vec<f64>,
    /// Standard deviation of the shutter: every frame with the beam on is exposed longer or
    /// shorter by its own draw, relative to what the manifest states. Default 0.
    pub exposure_error_relative: f64,
    /// Standard deviation, along each axis, of the camera's shift from frame to frame, px: every frame
    /// with the beam on has its own. Default 0.
    pub frame_shift_px: f64,
    /// Frames with the beam blocked for every frame with the beam on. Default 1.
    pub darks_per_exposure: usize,
    /// Bits of the converter: 16 (the default), or 12, right-aligned.
    pub bits: u8,
    /// Electrons per data number. Left out: 0.5, or what lets the full well just fit the
    /// converter where 0.5 is too little (7.7 at 12 bits).
    pub gain_e_per_dn: Option<f64>,
    /// Charge at which a pixel saturates, electrons. Default 30000.
    pub full_well_e: f64,
    /// Standard deviation of one read-out, electrons. Default 2.
    pub read_noise_e: f64,
    /// Dark current of an ordinary pixel, electrons per second. Default 0.5.
    pub dark_current_e_per_s: f64,
    /// Share of samples whose dark current is evenly distributed in the logarithm from 100 to
    /// 5000 electrons per second instead. Default 2e-4.
    pub hot_pixel_share: f64,
    /// Standard deviation of the pixels' offsets, DN. Default 3.
    pub fixed_pattern_dn: f64,
    /// Standard deviation of the pixels' relative sensitivity. Default 0.003.
    pub prnu_relative: f64,
    /// Data number that no light at all gives. Default 200.
    pub black_level_dn: f64,
    /// Light that is there with the beam blocked too, electrons per second. Default 2.
    pub stray_e_per_s: f64,
    /// Full width of the beam at half maximum, mm; 0 for a point. Default 0.3.
    pub beam_fwhm_mm: f64,
    /// Shape of the beam: `gaussian` (the default) or `disk`.
    pub beam_profile: BeamProfile,
    /// Between the surface normal and the beam, degrees. Default 0.
    pub beam_angle_deg: f64,
    /// Between the surface normal and the line of sight, degrees. Default 0.
    pub camera_angle_deg: f64,
    /// From the camera to the sample along its optical axis, mm: the angle then tilts the picture too,
    /// and the manifest gives four corners. Left out: a picture as from above.
    pub camera_distance_mm: Option<f64>,
    /// Height of a pixel over its width. Default 1.
    pub pixel_aspect: f64,
    /// Whether the beam loses its specular part on entry. Default true; false is the paper's mode.
    pub entry_loss: bool,
    /// How light leaves the sample: `fresnel` (the default) or `lambert`, the paper's mode.
    pub exit: Exit,
    /// Light that lens and housing spread evenly over the picture (veiling glare), as a share of
    /// what falls into the picture; on top of that. Default 0.
    pub flare_relative: f64,
    /// The spot, right of and below the middle of the frame, pixels. Default [0.3, -0.2].
    pub spot_offset_px: [f64; 2],
    /// The white reference.
    pub reference: WhiteReference,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            width: 1024,
            height: 1024,
            mm_per_pixel: 0.04,
            u_mm_per_pixel: 0.0,
            u_eta: 0.0,
            channels: Channels::Rgb,
            mosaic: None,
            exposures_s: vec![
                0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0,
            ],
            exposure_error_relative: 0.0,
            frame_shift_px: 0.0,
            darks_per_exposure: 1,
            bits: 16,
            gain_e_per_dn: None,
            full_well_e: 30_000.0,
            read_noise_e: 2.0,
            dark_current_e_per_s: 0.5,
            hot_pixel_share: 2e-4,
            fixed_pattern_dn: 3.0,
            prnu_relative: 0.003,
            black_level_dn: 200.0,
            stray_e_per_s: 2.0,
            beam_fwhm_mm: 0.3,
            beam_profile: BeamProfile::Gaussian,
            beam_angle_deg: 0.0,
            camera_angle_deg: 0.0,
            camera_distance_mm: None,
            pixel_aspect: 1.0,
            entry_loss: true,
            exit: Exit::Fresnel,
            flare_relative: 0.0,
            spot_offset_px: [0.3, -0.2],
            reference: WhiteReference::default(),
        }
    }
}

/// Share of the range that the brightest pixel fills in the shortest exposure.
const PEAK_SHARE: f64 = 0.8;

/// Data numbers between black and white below which nothing is worth measuring.
const LEAST_RANGE_DN: f64 = 64.0;

/// Standard deviations by which the stated white level stays below where samples saturate:
/// fewer than one saturated sample in 10¹¹ is read below it.
const WHITE_MARGIN: f64 = 7.0;

impl Camera {
    /// The same camera, or what is wrong with it.
    ///
    /// # Errors
    ///
    /// [`SynthError`] names the first key that is out of range or does not fit the others.
    pub fn validated(self) -> Result<Self, SynthError> {
        if self.bits != 12 && self.bits != 16 {
            return Err(SynthError::Bits(self.bits));
        }
        if self.mosaic.is_some() && self.channels != Channels::Rgb {
            return Err(SynthError::GrayMosaic);
        }
        if self.exposures_s.is_empty() {
            return Err(SynthError::NoExposures);
        }
        for (key, found, low, high) in self.ranges() {
            // NaN fails the range test as well.
            if !(low..=high).contains(&found) {
                return Err(SynthError::OutOfRange {
                    key,
                    found,
                    low,
                    high,
                });
            }
        }
        let range_dn = self.white_level_dn() - self.black_level_dn;
        if range_dn < LEAST_RANGE_DN {
            return Err(SynthError::DynamicRange {
                black_level_dn: self.black_level_dn,
                gain_e_per_dn: self.gain_e_per_dn(),
                range_dn,
                least_dn: LEAST_RANGE_DN,
            });
        }
        let exposure_s = self.shortest_s();
        let background_e = (self.stray_e_per_s + self.dark_current_e_per_s) * exposure_s;
        let room_e = self.range_e() - self.peak_e();
        if background_e > room_e {
            return Err(SynthError::Background {
                background_e,
                exposure_s,
                room_e,
            });
        }
        let expected = self.channels.count();
        for (key, values) in [
            ("sigma_s_prime_per_mm", &self.reference.sigma_s_prime_per_mm),
            ("sigma_a_per_mm", &self.reference.sigma_a_per_mm),
        ] {
            if let Some(values) = values
                && values.len() != expected
            {
                return Err(SynthError::ReferenceChannels {
                    key,
                    expected,
                    found: values.len(),
                });
            }
        }
        Ok(self)
    }

    /// Every number that has a range of its own: key, value, least and largest.
    fn ranges(&self) -> Vec<(&'static str, f64, f64, f64)> {
        let (width, height) = (self.width as f64, self.height as f64);
        let field_mm = width.min(height) * self.mm_per_pixel;
        let white = &self.reference;
        let mut ranges = vec![
            // The largest colour capture takes 4 GB; the smallest still has a spot.
            ("width", width, 16.0, 8192.0),
            ("height", height, 16.0, 8192.0),
            ("mm_per_pixel", self.mm_per_pixel, 1e-4, 100.0),
            // A scale five deviations off is still above 0.
            (
                "u_mm_per_pixel",
                self.u_mm_per_pixel,
                0.0,
                0.1 * self.mm_per_pixel,
            ),
            ("u_eta", self.u_eta, 0.0, 0.5),
            (
                "darks_per_exposure",
                self.darks_per_exposure as f64,
                0.0,
                1000.0,
            ),
            // An exposure seven deviations off is still above 0.
            (
                "exposure_error_relative",
                self.exposure_error_relative,
                0.0,
                0.1,
            ),
            ("frame_shift_px", self.frame_shift_px, 0.0, 10.0),
            ("full_well_e", self.full_well_e, 100.0, 1e7),
            ("gain_e_per_dn", self.gain_e_per_dn(), 1e-3, 1e5),
            ("read_noise_e", self.read_noise_e, 0.0, 1e4),
            ("dark_current_e_per_s", self.dark_current_e_per_s, 0.0, 1e6),
            ("hot_pixel_share", self.hot_pixel_share, 0.0, 1.0),
            ("fixed_pattern_dn", self.fixed_pattern_dn, 0.0, 1e4),
            // A sensitivity seven deviations off is still above 0.
            ("prnu_relative", self.prnu_relative, 0.0, 0.1),
            ("black_level_dn", self.black_level_dn, 0.0, self.max_dn()),
            ("stray_e_per_s", self.stray_e_per_s, 0.0, 1e9),
            // A beam wider than half of the field leaves no profile to see.
            ("beam_fwhm_mm", self.beam_fwhm_mm, 0.0, 0.5 * field_mm),
            ("flare_relative", self.flare_relative, 0.0, 0.5),
            ("beam_angle_deg", self.beam_angle_deg, 0.0, 80.0),
            ("camera_angle_deg", self.camera_angle_deg, 0.0, 80.0),
            ("pixel_aspect", self.pixel_aspect, 0.2, 5.0),
            (
                "spot_offset_px[0]",
                self.spot_offset_px[0],
                -0.5 * width,
                0.5 * width,
            ),
            (
                "spot_offset_px[1]",
                self.spot_offset_px[1],
                -0.5 * height,
                0.5 * height,
            ),
            ("reference.reflectance", white.reflectance, 0.01, 1.0),
            (
                "reference.u_reflectance",
                white.u_reflectance,
                0.0,
                0.1 * white.reflectance,
            ),
        ];
        if let Some(distance) = self.camera_distance_mm {
            // So far that the horizon of the sample stays out of the picture by a factor of 2.
            let reach = 0.5 * height * self.mm_per_pixel * self.pixel_aspect;
            let least = 2.0 * reach * self.camera_angle_deg.to_radians().tan();
            ranges.push(("camera_distance_mm", distance, least.max(1e-3), 1e6));
        }
        ranges.extend(
            self.exposures_s
                .iter()
                .map(|&s| ("exposures_s", s, 1e-7, 1e5)),
        );
        ranges
    }

    /// Electrons per data number, the default filled in.
    pub fn gain_e_per_dn(&self) -> f64 {
        let fits = self.full_well_e / (self.max_dn() - self.black_level_dn).max(1.0);
        self.gain_e_per_dn.unwrap_or(fits.max(0.5))
    }

    /// What the sensor states about itself, as a manifest would.
    pub fn sensor(&self) -> Sensor {
        Sensor {
            gain_e_per_dn: self.gain_e_per_dn(),
            read_noise_e: self.read_noise_e,
            black_level_dn: self.black_level_dn,
            white_level_dn: self.white_level_dn(),
            prnu_relative: self.prnu_relative,
        }
    }

    /// Samples that a pixel has.
    pub fn samples_per_pixel(&self) -> usize {
        match self.mosaic {
            Some(_) => 1,
            None => self.channels.count(),
        }
    }

    /// The beam on the surface.
    pub fn beam(&self) -> Beam {
        let fwhm_mm = self.beam_fwhm_mm;
        match self.beam_profile {
            _ if fwhm_mm == 0.0 => Beam::Point,
            BeamProfile::Gaussian => Beam::Gaussian { fwhm_mm },
            BeamProfile::Disk => Beam::Disk { fwhm_mm },
        }
    }

    /// Where the beam meets the surface: column and row, the middle of the first pixel being
    /// (0, 0).
    pub fn spot_px(&self) -> [f64; 2] {
        [
            0.5 * (self.width as f64 - 1.0) + self.spot_offset_px[0],
            0.5 * (self.height as f64 - 1.0) + self.spot_offset_px[1],
        ]
    }

    /// Largest data number that the converter gives.
    pub(crate) fn max_dn(&self) -> f64 {
        f64::from((1_u32 << self.bits.min(16)) - 1)
    }

    /// Charge at which the full well or the converter saturates, electrons.
    fn range_e(&self) -> f64 {
        let converter = (self.max_dn() - self.black_level_dn) * self.gain_e_per_dn();
        self.full_well_e.min(converter)
    }

    /// Data number at and above which a sample counts as saturated.
    ///
    /// A full well is read with the noise of any other charge, so the level stays below it by
    /// what noise and fixed pattern can take away.
    fn white_level_dn(&self) -> f64 {
        let gain = self.gain_e_per_dn();
        let noise_dn = (self.read_noise_e / gain).hypot(self.fixed_pattern_dn) + 0.5;
        (self.black_level_dn + self.range_e() / gain - WHITE_MARGIN * noise_dn).floor()
    }

    /// Electrons that the beam gives the brightest pixel in the shortest exposure.
    pub(crate) fn peak_e(&self) -> f64 {
        PEAK_SHARE * self.range_e()
    }

    /// The shortest exposure, s.
    pub(crate) fn shortest_s(&self) -> f64 {
        self.exposures_s
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_a_camera() {
        let camera = Camera::default().validated().unwrap();
        assert_eq!(camera.exposures_s.len(), 13);
        assert!((camera.exposures_s.iter().sum::<f64>() - 8.002).abs() < 1e-12);
        assert_eq!(camera.gain_e_per_dn(), 0.5);
        // 200 + 30000/0.5 = 60200 DN, less seven times √(4² + 3²) + ½.
        assert_eq!(camera.sensor().white_level_dn, 60_161.0);
        assert_eq!(camera.spot_px(), [511.8, 511.3]);
    }

    #[test]
    fn twelve_bits_hold_the_full_well() {
        let camera = Camera {
            bits: 12,
            ..Camera::default()
        };
        let camera = camera.validated().unwrap();
        assert!((camera.gain_e_per_dn() - 30_000.0 / 3895.0).abs() < 1e-12);
        assert!((camera.range_e() - 30_000.0).abs() < 1e-8);
        // At unity gain the converter saturates long before the well.
        let high_gain = Camera {
            gain_e_per_dn: Some(1.0),
            ..camera
        };
        assert_eq!(high_gain.validated().unwrap().range_e(), 3895.0);
    }

    #[test]
    fn a_few_keys_describe_a_camera() {
        let text = "width = 64\nchannels = \"mono\"\nbeam_profile = \"disk\"\n\
                    exit = \"lambert\"\n[reference]\nreflectance = 0.5\n";
        let camera: Camera = toml::from_str(text).unwrap();
        assert_eq!(camera.width, 64);
        assert_eq!(camera.height, 1024);
        assert_eq!(camera.channels, Channels::Mono);
        assert_eq!(camera.exit, Exit::Lambert);
        assert_eq!(camera.reference.u_reflectance, 0.005);
        assert_eq!(
            camera.reference.sigma_s_prime_per_mm(camera.channels),
            [20.4]
        );
        let back: Camera = toml::from_str(&toml::to_string(&camera).unwrap()).unwrap();
        assert_eq!(back, camera);
        for text in ["widht = 64", "[reference]\nrho = 1"] {
            let message = toml::from_str::<Camera>(text).unwrap_err().to_string();
            assert!(message.contains("unknown field"), "{message}");
        }
    }

    #[test]
    fn each_bad_key_is_named() {
        let good = Camera::default();
        let out_of_range = [
            (
                "width",
                Camera {
                    width: 4,
                    ..good.clone()
                },
            ),
            (
                "height",
                Camera {
                    height: 1 << 40,
                    ..good.clone()
                },
            ),
            (
                "mm_per_pixel",
                Camera {
                    mm_per_pixel: f64::NAN,
                    ..good.clone()
                },
            ),
            (
                "u_mm_per_pixel",
                Camera {
                    u_mm_per_pixel: 0.02,
                    ..good.clone()
                },
            ),
            (
                "u_eta",
                Camera {
                    u_eta: -0.1,
                    ..good.clone()
                },
            ),
            (
                "exposures_s",
                Camera {
                    exposures_s: vec![1.0, 0.0],
                    ..good.clone()
                },
            ),
            (
                "full_well_e",
                Camera {
                    full_well_e: f64::INFINITY,
                    ..good.clone()
                },
            ),
            (
                "gain_e_per_dn",
                Camera {
                    gain_e_per_dn: Some(0.0),
                    ..good.clone()
                },
            ),
            (
                "read_noise_e",
                Camera {
                    read_noise_e: -2.0,
                    ..good.clone()
                },
            ),
            (
                "hot_pixel_share",
                Camera {
                    hot_pixel_share: 2.0,
                    ..good.clone()
                },
            ),
            (
                "prnu_relative",
                Camera {
                    prnu_relative: 3.0,
                    ..good.clone()
                },
            ),
            (
                "black_level_dn",
                Camera {
                    black_level_dn: 70_000.0,
                    ..good.clone()
                },
            ),
            (
                "beam_fwhm_mm",
                Camera {
                    beam_fwhm_mm: 30.0,
                    ..good.clone()
                },
            ),
            (
                "camera_angle_deg",
                Camera {
                    camera_angle_deg: 90.0,
                    ..good.clone()
                },
            ),
            (
                "spot_offset_px[1]",
                Camera {
                    spot_offset_px: [0.0, 600.0],
                    ..good.clone()
                },
            ),
        ];
        for (expected, camera) in out_of_range {
            match camera.validated() {
                Err(SynthError::OutOfRange { key, .. }) => assert_eq!(key, expected),
                other => panic!("{expected}: {other:?}"),
            }
        }
        let white = |reference| Camera {
            reference,
            ..good.clone()
        };
        let brighter_than_white = WhiteReference {
            reflectance: 1.2,
            ..WhiteReference::default()
        };
        assert_eq!(
            white(brighter_than_white)
                .validated()
                .unwrap_err()
                .to_string(),
            "reference.reflectance must lie between 0.01 and 1, got 1.2"
        );
        let one_value = WhiteReference {
            sigma_s_prime_per_mm: Some(vec![20.0]),
            ..WhiteReference::default()
        };
        assert_eq!(
            white(one_value).validated(),
            Err(SynthError::ReferenceChannels {
                key: "sigma_s_prime_per_mm",
                expected: 3,
                found: 1
            })
        );
        assert_eq!(
            Camera {
                bits: 14,
                ..good.clone()
            }
            .validated(),
            Err(SynthError::Bits(14))
        );
        assert_eq!(
            Camera {
                exposures_s: vec![],
                ..good.clone()
            }
            .validated(),
            Err(SynthError::NoExposures)
        );
        let all_black = Camera {
            black_level_dn: 4090.0,
            bits: 12,
            ..good.clone()
        };
        assert!(matches!(
            all_black.validated(),
            Err(SynthError::DynamicRange { .. })
        ));
        let daylight = Camera {
            stray_e_per_s: 1e8,
            ..good.clone()
        };
        assert!(matches!(
            daylight.validated(),
            Err(SynthError::Background { .. })
        ));
    }
}

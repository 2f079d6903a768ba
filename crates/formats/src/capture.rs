//! `capture.toml`: which frames show what, exposed how long, and what is known of the set-up.
//!
//! What may be left out is an [`Option`], so that a report can tell what was stated from what
//! was assumed; [`Capture::assumptions`] lists the latter.

mod check;
mod draft;
mod frames;
mod write;

pub use check::{CaptureError, parse_capture, parse_manifest};
pub use draft::{Draft, DraftFrame};
pub use frames::{Frames, WrittenFrame};

use crate::metadata::TimeUnit;
use physics::dipole::albedo_prime_from_total;
use physics::{DiffuseFresnel, Mosaic, ReducedMedium};
use serde::{Deserialize, Serialize};

/// Standard uncertainty of a relative index that is given without one.
pub const DEFAULT_U_ETA: f64 = 0.01;
/// Relative standard uncertainty of `mm_per_pixel` given without one.
pub const DEFAULT_U_MM_PER_PIXEL_RELATIVE: f64 = 0.005;
/// Standard uncertainty of each coordinate of `corners_mm` given without one, over the mean side.
pub const DEFAULT_U_CORNERS_RELATIVE: f64 = 0.005;
/// Relative standard uncertainty of a beam's width given without one.
pub const DEFAULT_U_FWHM_RELATIVE: f64 = 0.05;
/// Standard uncertainty of an angle of beam or camera given without one, degrees.
pub const DEFAULT_U_ANGLE_DEG: f64 = 1.0;
/// Standard uncertainty of the white's reflectance given without one.
pub const DEFAULT_U_REFLECTANCE: f64 = 0.01;
/// Relative standard uncertainty of the white's own σₛ′ given without one: that of one white to
/// the next.
pub const DEFAULT_U_SIGMA_S_PRIME_RELATIVE: f64 = 0.1;
/// Standard uncertainty of the white's own σₐ given without one, as a share of σₐ, or of the
/// absorption that would take all the light which its certificate says is lost, if that is more:
/// a white whose σₐ is put at 0 absorbs all the same, and its lost light has nowhere else to go.
pub const DEFAULT_U_SIGMA_A_SHARE: f64 = 0.5;
/// Index of the white reference itself (sintered PTFE) where none is given.
pub const DEFAULT_REFERENCE_ETA: f64 = 1.3;

/// A capture: the frames of a sample and of a white reference, and the set-up they share.
///
/// As written, its lists are [`Frames`], which may be patterns and leave exposure times to the
/// files; [`Capture::resolved`] makes them lists of [`FrameEntry`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Capture<F = Vec<FrameEntry>> {
    /// Name of the material.
    pub material: String,
    /// Index of the sample over that of its surroundings, in [1, 5].
    pub eta: f64,
    /// Standard uncertainty of `eta`; [`DEFAULT_U_ETA`] where absent.
    pub u_eta: Option<f64>,
    /// Pixels in millimetres.
    pub geometry: Geometry,
    /// The beam.
    #[serde(default)]
    pub beam: Beam,
    /// The camera.
    #[serde(default)]
    pub camera: Camera,
    /// Choices of the measurement model.
    #[serde(default)]
    pub model: Model,
    /// The frames of the sample.
    pub sample: Sample<F>,
    /// The frames of the white reference.
    pub reference: Reference<F>,
}

/// `[geometry]`: pixels in millimetres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Geometry {
    /// Length on the sample that a pixel sees, mm, of a camera that looks along the normal; absent
    /// where there are corners.
    pub mm_per_pixel: Option<PixelSize>,
    /// Its standard uncertainty, mm; [`DEFAULT_U_MM_PER_PIXEL_RELATIVE`] where absent.
    pub u_mm_per_pixel: Option<f64>,
    /// Four points of the picture, pixels, in order around their quadrilateral: of a tilted view.
    pub corners_px: Option<Corners>,
    /// The same four points on the surface, mm.
    pub corners_mm: Option<Corners>,
    /// Standard uncertainty of each coordinate of these, mm; [`DEFAULT_U_CORNERS_RELATIVE`] where
    /// absent.
    pub u_corners_mm: Option<f64>,
    /// Column and row of the beam, pixels, (0, 0) the middle of the first pixel; found from the
    /// image where absent.
    pub center_px: Option<[f64; 2]>,
}

/// Length of a pixel on the sample, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a length in mm, or two for pixels that are not square: [across, down]"
)]
pub enum PixelSize {
    /// Of a square.
    Square(f64),
    /// Across and down.
    Rectangular([f64; 2]),
}

impl PixelSize {
    /// Across and down.
    pub fn sides(self) -> [f64; 2] {
        match self {
            Self::Square(side) => [side; 2],
            Self::Rectangular(sides) => sides,
        }
    }
}

/// Four points.
pub type Corners = [[f64; 2]; 4];

/// Shape of the beam on the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BeamProfile {
    /// A Gaussian, `fwhm_mm` wide at half of its maximum.
    #[default]
    Gaussian,
    /// Uniform inside a circle of diameter `fwhm_mm`.
    Disk,
}

/// `[beam]`: the light that falls on the sample.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Beam {
    /// Full width at half maximum, mm; 0 is a point. Measured on the white reference where absent.
    pub fwhm_mm: Option<f64>,
    /// Its standard uncertainty, mm; [`DEFAULT_U_FWHM_RELATIVE`] where absent.
    pub u_fwhm_mm: Option<f64>,
    /// Its shape.
    pub profile: BeamProfile,
    /// Angle between beam and surface normal, degrees; default 0.
    pub angle_deg: f64,
    /// Its standard uncertainty, degrees; [`DEFAULT_U_ANGLE_DEG`] where absent.
    pub u_angle_deg: Option<f64>,
}

/// How counts follow light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Response {
    /// In proportion.
    Linear,
    /// By a curve of 8 bits, which is recovered from the frames.
    Recover,
}

/// `[camera]`: what is absent is estimated from the frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {
    /// Angle between line of sight and surface normal, degrees; where absent that of the corners, or 0.
    pub angle_deg: Option<f64>,
    /// Its standard uncertainty, degrees; [`DEFAULT_U_ANGLE_DEG`] where absent.
    pub u_angle_deg: Option<f64>,
    /// Electrons per count.
    pub gain_e_per_dn: Option<f64>,
    /// Standard deviation of one read-out, electrons.
    pub read_noise_e: Option<f64>,
    /// Count that no light gives.
    pub black_level_dn: Option<f64>,
    /// Count at and above which a sample is saturated.
    pub white_level_dn: Option<f64>,
    /// Standard deviation of the pixels' relative sensitivity; default 0.
    pub prnu_relative: f64,
    /// The response; linear where absent, but 8-bit frames want it stated. [`Response::Recover`]
    /// excludes gain, read noise and levels, which are those of linear counts.
    pub response: Option<Response>,
    /// Pattern of the colour filter array, row by row from the first pixel, where gray files are
    /// mosaics and do not say so themselves; `RGGB` and the like, or the 36 letters of X-Trans.
    pub mosaic: Option<Mosaic>,
    /// Unit of the exposure times in FITS headers that give a number and no unit.
    pub fits_exposure_unit: Option<TimeUnit>,
}

/// How radiance at the camera's angle becomes exitance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Exit {
    /// By the Fresnel transmission of diffuse light.
    #[default]
    Fresnel,
    /// As from a Lambertian surface: the paper's mode.
    Lambert,
}

/// `[model]`: choices of the measurement model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Model {
    /// Whether only 1 − R_specular of the beam enters (default), or all of it: the paper's mode.
    pub entry_loss: bool,
    /// How radiance becomes exitance.
    pub exit: Exit,
    /// Mean cosine of the scattering angle, for the models that use it.
    pub g: Option<f64>,
    /// Whether the error of a closed form against transport is part of the uncertainty (default);
    /// false for light that the closed form itself has made.
    pub discrepancy: bool,
}

impl Default for Model {
    fn default() -> Self {
        Self {
            entry_loss: true,
            exit: Exit::Fresnel,
            g: None,
            discrepancy: true,
        }
    }
}

/// One frame: a file and its exposure time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameEntry {
    /// The file, relative to the folder of the manifest.
    pub file: String,
    /// Exposure time, s.
    pub exposure_s: f64,
}

impl FrameEntry {
    /// Whether the other frame was exposed as long, rounding of the manifest aside.
    pub fn same_exposure(&self, other: &Self) -> bool {
        (self.exposure_s - other.exposure_s).abs() <= 1e-9 * self.exposure_s
    }
}

/// A part of the picture to be left out, in pixels, (0, 0) the middle of the first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "expected { circle_px = [x, y, radius] } or { polygon_px = [[x, y], …] }"
)]
pub enum Region {
    /// Column and row of its middle, and its radius.
    Circle {
        /// The three.
        circle_px: [f64; 3],
    },
    /// What lies inside, counted even and odd.
    Polygon {
        /// Its corners, in order.
        polygon_px: Vec<[f64; 2]>,
    },
}

impl Region {
    /// Whether the middle of pixel (`x`, `y`) lies inside.
    pub fn contains(&self, x: f64, y: f64) -> bool {
        match self {
            Self::Circle {
                circle_px: [column, row, radius],
            } => (x - column).hypot(y - row) <= *radius,
            Self::Polygon { polygon_px } => {
                let after = polygon_px.iter().cycle().skip(1);
                let crossings = polygon_px.iter().zip(after).filter(|(a, b)| {
                    // To the right of the pixel, an edge that starts on one side of its row and ends on the other.
                    (a[1] > y) != (b[1] > y)
                        && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
                });
                crossings.count() % 2 == 1
            }
        }
    }
}

/// `[sample]`: the frames of the sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sample<F = Vec<FrameEntry>> {
    /// Thickness, mm; semi-infinite where absent.
    pub thickness_mm: Option<f64>,
    /// Index of the sample over that of what lies below a slab; `eta` where absent, 1 where the
    /// sample stands in something of its own index.
    pub eta_below: Option<f64>,
    /// A picture whose pixels above 0 are left out, relative to the folder of the manifest.
    pub mask: Option<String>,
    /// What else is left out.
    #[serde(default)]
    pub leave_out: Vec<Region>,
    /// Azimuths about the spot that take part, degrees, each from its first angle to its second:
    /// 0 is toward increasing columns, 90 toward increasing rows; with corners, toward increasing
    /// x and y on the surface. All where empty.
    #[serde(default)]
    pub sectors_deg: Vec<[f64; 2]>,
    /// The rendering that the frames are photographs of, an EXR of their size with its variance:
    /// its noise is in all of them.
    pub rendering: Option<String>,
    /// Frames with the beam on.
    pub frames: F,
    /// Frames with the beam blocked, at least one at each exposure of `frames`.
    pub dark: F,
}

/// A number for all channels, or one for each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number, or a list with one number for each channel"
)]
pub enum PerChannel {
    /// The same for all.
    All(f64),
    /// In the order of the camera: R, G, B.
    Each(Vec<f64>),
}

impl PerChannel {
    /// All the numbers there are.
    pub fn values(&self) -> &[f64] {
        match self {
            Self::All(value) => std::slice::from_ref(value),
            Self::Each(values) => values,
        }
    }

    /// The number of channel `index` of `channels` in this list, which stands in `field`.
    fn of_all(
        &self,
        field: &'static str,
        index: usize,
        channels: usize,
    ) -> Result<f64, CaptureError> {
        let found = self.values().len();
        let of_channel = match self {
            Self::All(value) => Some(*value),
            Self::Each(values) if found == channels => values.get(index).copied(),
            Self::Each(_) => None,
        };
        of_channel.ok_or(CaptureError::PerChannel {
            field,
            found,
            channels,
        })
    }
}

/// `[reference]`: the frames of a white diffuser in place of the sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference<F = Vec<FrameEntry>> {
    /// Its total diffuse reflectance.
    pub reflectance: f64,
    /// Standard uncertainty of `reflectance`; [`DEFAULT_U_REFLECTANCE`] where absent.
    pub u_reflectance: Option<f64>,
    /// Reduced scattering coefficient σₛ′ of the white itself, mm⁻¹; an ideal surface where
    /// absent.
    pub sigma_s_prime_per_mm: Option<PerChannel>,
    /// Relative standard uncertainty of `sigma_s_prime_per_mm`;
    /// [`DEFAULT_U_SIGMA_S_PRIME_RELATIVE`] where absent.
    pub u_sigma_s_prime_relative: Option<f64>,
    /// Absorption coefficient σₐ of the white itself, mm⁻¹.
    pub sigma_a_per_mm: Option<PerChannel>,
    /// Standard uncertainty of `sigma_a_per_mm`, mm⁻¹; [`DEFAULT_U_SIGMA_A_SHARE`] says what it is
    /// where absent.
    pub u_sigma_a_per_mm: Option<PerChannel>,
    /// Relative index of the white itself; [`DEFAULT_REFERENCE_ETA`] where absent.
    pub eta: Option<f64>,
    /// As that of the sample.
    pub mask: Option<String>,
    /// As that of the sample.
    #[serde(default)]
    pub leave_out: Vec<Region>,
    /// Frames with the beam on.
    pub frames: F,
    /// Frames with the beam blocked, at least one at each exposure of `frames`.
    pub dark: F,
}

/// A number that the manifest left out and a default stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assumption {
    /// The field, as in `reference.u_reflectance`.
    pub field: &'static str,
    /// The value assumed, in the unit of the field.
    pub value: f64,
}

impl<F> Capture<F> {
    /// Standard uncertainty of `eta`, stated or by default.
    pub fn u_eta(&self) -> f64 {
        self.u_eta.unwrap_or(DEFAULT_U_ETA)
    }

    /// Every default that stands for a number left out.
    ///
    /// What the camera leaves out is not assumed but estimated, and not listed.
    pub fn assumptions(&self) -> Vec<Assumption> {
        let (beam, camera, reference) = (&self.beam, &self.camera, &self.reference);
        let white = reference.sigma_s_prime_per_mm.is_some();
        [
            (self.u_eta.is_none(), "u_eta", self.u_eta()),
            (
                self.geometry.u_mm_per_pixel.is_none() && self.geometry.corners_mm.is_none(),
                "geometry.u_mm_per_pixel",
                self.geometry.u_mm_per_pixel(),
            ),
            (
                self.geometry.u_corners_mm.is_none() && self.geometry.corners_mm.is_some(),
                "geometry.u_corners_mm",
                self.geometry.u_corners_mm(),
            ),
            (
                beam.u_fwhm_mm.is_none() && beam.fwhm_mm.is_some_and(|width| width > 0.0),
                "beam.u_fwhm_mm",
                beam.u_fwhm_mm(),
            ),
            (
                beam.u_angle_deg.is_none() && beam.angle_deg > 0.0,
                "beam.u_angle_deg",
                beam.u_angle_deg(),
            ),
            (
                camera.u_angle_deg.is_none()
                    && (camera.angle_deg.is_some_and(|angle| angle > 0.0)
                        || self.geometry.corners_mm.is_some()),
                "camera.u_angle_deg",
                camera.u_angle_deg(),
            ),
            (
                reference.u_reflectance.is_none(),
                "reference.u_reflectance",
                reference.u_reflectance(),
            ),
            (
                white && reference.u_sigma_s_prime_relative.is_none(),
                "reference.u_sigma_s_prime_relative",
                reference.u_sigma_s_prime_relative(),
            ),
            (
                white && reference.u_sigma_a_per_mm.is_none(),
                "reference.u_sigma_a_per_mm",
                reference.largest_u_sigma_a_per_mm(),
            ),
            (
                white && reference.eta.is_none(),
                "reference.eta",
                reference.eta(),
            ),
        ]
        .into_iter()
        .filter(|(assumed, ..)| *assumed)
        .map(|(_, field, value)| Assumption { field, value })
        .collect()
    }
}

impl Geometry {
    /// Standard uncertainty of `mm_per_pixel`, mm, stated or by default; 0 where there is none.
    pub fn u_mm_per_pixel(&self) -> f64 {
        self.u_mm_per_pixel
            .unwrap_or(DEFAULT_U_MM_PER_PIXEL_RELATIVE * self.mean_side_mm())
    }

    /// Root of the area of a pixel, mm; 0 where there are corners instead.
    fn mean_side_mm(&self) -> f64 {
        self.mm_per_pixel.map_or(0.0, |size| {
            let [across, down] = size.sides();
            (across * down).sqrt()
        })
    }

    /// Standard uncertainty of `mm_per_pixel` over itself.
    pub fn u_mm_per_pixel_relative(&self) -> f64 {
        match self.u_mm_per_pixel {
            Some(u) if self.mm_per_pixel.is_some() => u / self.mean_side_mm(),
            _ => DEFAULT_U_MM_PER_PIXEL_RELATIVE,
        }
    }

    /// Standard uncertainty of each coordinate of `corners_mm`, mm, stated or by default; 0 where
    /// there are none.
    pub fn u_corners_mm(&self) -> f64 {
        let mean_side = self.corners_mm.map_or(0.0, |p| {
            let side = |i: usize| {
                let (a, b) = (p[i], p[(i + 1) % 4]);
                (a[0] - b[0]).hypot(a[1] - b[1])
            };
            0.25 * (0..4).map(side).sum::<f64>()
        });
        self.u_corners_mm
            .unwrap_or(DEFAULT_U_CORNERS_RELATIVE * mean_side)
    }
}

impl Camera {
    /// Standard uncertainty of the angle of view, degrees, stated or by default.
    pub fn u_angle_deg(&self) -> f64 {
        self.u_angle_deg.unwrap_or(DEFAULT_U_ANGLE_DEG)
    }
}

impl Beam {
    /// Standard uncertainty of the beam's angle, degrees, stated or by default.
    pub fn u_angle_deg(&self) -> f64 {
        self.u_angle_deg.unwrap_or(DEFAULT_U_ANGLE_DEG)
    }

    /// Standard uncertainty of `fwhm_mm`, mm, stated or by default; 0 where there is no width.
    pub fn u_fwhm_mm(&self) -> f64 {
        self.u_fwhm_mm
            .unwrap_or(DEFAULT_U_FWHM_RELATIVE * self.fwhm_mm.unwrap_or(0.0))
    }
}

impl<F> Reference<F> {
    /// Standard uncertainty of `reflectance`, stated or by default.
    pub fn u_reflectance(&self) -> f64 {
        self.u_reflectance.unwrap_or(DEFAULT_U_REFLECTANCE)
    }

    /// Relative standard uncertainty of the white's σₛ′, stated or by default.
    pub fn u_sigma_s_prime_relative(&self) -> f64 {
        self.u_sigma_s_prime_relative
            .unwrap_or(DEFAULT_U_SIGMA_S_PRIME_RELATIVE)
    }

    /// Relative index of the white, stated or by default.
    pub fn eta(&self) -> f64 {
        self.eta.unwrap_or(DEFAULT_REFERENCE_ETA)
    }

    /// The white as a medium that glows, in channel `index` of `channels`; `None` for an ideal
    /// surface.
    ///
    /// # Errors
    ///
    /// [`CaptureError::PerChannel`] where a list has a number for some channels only.
    pub fn medium(
        &self,
        index: usize,
        channels: usize,
    ) -> Result<Option<ReducedMedium>, CaptureError> {
        let (Some(absorption), Some(scattering)) =
            (&self.sigma_a_per_mm, &self.sigma_s_prime_per_mm)
        else {
            return Ok(None);
        };
        let of = |field, list: &PerChannel| list.of_all(field, index, channels);
        Ok(Some(ReducedMedium {
            sigma_a: of("reference.sigma_a_per_mm", absorption)?,
            sigma_s_prime: of("reference.sigma_s_prime_per_mm", scattering)?,
            eta: self.eta(),
        }))
    }

    /// Standard uncertainty of σₐ of the white in channel `index` of `channels`, mm⁻¹, stated or by
    /// default; 0 for an ideal surface.
    ///
    /// # Errors
    ///
    /// As [`Self::medium`].
    pub fn u_sigma_a_per_mm(&self, index: usize, channels: usize) -> Result<f64, CaptureError> {
        match (&self.u_sigma_a_per_mm, self.medium(index, channels)?) {
            (_, None) => Ok(0.0),
            (Some(stated), Some(_)) => stated.of_all("reference.u_sigma_a_per_mm", index, channels),
            (None, Some(medium)) => Ok(self.default_u_sigma_a_per_mm(&medium)),
        }
    }

    fn default_u_sigma_a_per_mm(&self, medium: &ReducedMedium) -> f64 {
        let a = DiffuseFresnel::Exact.a(medium.eta);
        let lost = albedo_prime_from_total(self.reflectance, a)
            .map_or(0.0, |albedo| medium.sigma_s_prime * (1.0 / albedo - 1.0));
        DEFAULT_U_SIGMA_A_SHARE * medium.sigma_a.max(lost)
    }

    /// The largest default of all channels, mm⁻¹.
    fn largest_u_sigma_a_per_mm(&self) -> f64 {
        let lists = [&self.sigma_a_per_mm, &self.sigma_s_prime_per_mm];
        let count = lists.map(|list| list.as_ref().map_or(0, |l| l.values().len()));
        let count = count.into_iter().max().unwrap_or(0);
        (0..count)
            .filter_map(|index| self.medium(index, count).ok()?)
            .map(|medium| self.default_u_sigma_a_per_mm(&medium))
            .fold(0.0, f64::max)
    }
}

//! The door through which a manifest enters.

use super::draft::PLACEHOLDER;
use super::{
    Capture, FrameEntry, Frames, Geometry, PerChannel, PixelSize, Reference, Region, Response,
    Sample,
};
use crate::toml_text::{TomlError, parse_toml};
use physics::medium::SAMPLE_INDEX;
use std::collections::BTreeMap;
use std::ops::{Bound, RangeBounds};
use thiserror::Error;
use toml::{Table, Value};

/// A manifest cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// A list with one number for each channel has too few or too many.
    #[error(
        "field `{field}`: found {found} numbers; expected one for all channels, or one for each of the {channels}"
    )]
    PerChannel {
        /// The field.
        field: &'static str,
        /// Numbers in the list.
        found: usize,
        /// Channels of the frames.
        channels: usize,
    },
    /// Neither a length of a pixel nor corners, both, or one list of corners.
    #[error(
        "field `geometry`: {found}; expected either mm_per_pixel, of a camera that looks along \
         the normal, or corners_px and corners_mm, four points [x, y] each"
    )]
    Geometry {
        /// What there is.
        found: &'static str,
    },
    /// The text does not fit.
    #[error(transparent)]
    Toml(#[from] TomlError),
    /// What `beamspot init` could not know and nobody has filled in.
    #[error(
        "field {} is still \"?\": fill in what is true of the set-up",
        .0.iter().map(|field| format!("`{field}`")).collect::<Vec<_>>().join(", ")
    )]
    Placeholder(Vec<String>),
    /// A frame whose exposure time is to be found in its file.
    #[error("field `{0}`: the exposure times are not written here; expected exposure_s")]
    ExposureElsewhere(&'static str),
    /// Something that the manifest may say one day.
    #[error("field `{field}` is not supported yet: {instead}")]
    NotSupported {
        /// The field.
        field: String,
        /// What to write in its place.
        instead: &'static str,
    },
    /// A number outside its domain.
    #[error("field `{field}`: found {found}, expected {expected}")]
    Value {
        /// The field, as in `sample.frames[3].exposure_s`.
        field: String,
        /// The number found.
        found: f64,
        /// Its domain and what to check.
        expected: &'static str,
    },
    /// A name that is empty.
    #[error("field `{field}`: found an empty text; expected a name")]
    EmptyText {
        /// The field.
        field: String,
    },
    /// A list without a frame.
    #[error("field `{field}`: found no frame; expected at least one {{ file, exposure_s }}")]
    NoFrames {
        /// The field.
        field: &'static str,
    },
    /// A frame without a dark of its exposure.
    #[error(
        "field `{field}`: no dark for {file}, exposed {exposure_s} s; there are darks of {} s: \
         add one of {exposure_s} s, taken with the beam blocked",
        available_s.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
    )]
    NoDark {
        /// The field that lacks a dark.
        field: &'static str,
        /// File of the frame.
        file: String,
        /// Its exposure time, s.
        exposure_s: f64,
        /// Exposure times of the darks there are, s.
        available_s: Vec<f64>,
    },
    /// One file in two places.
    #[error(
        "field `{field}`: {file} stands in `{before}` already; expected each file once (a dark \
         may serve sample and reference)"
    )]
    RepeatedFile {
        /// The second place.
        field: String,
        /// The first place.
        before: String,
        /// The file.
        file: String,
    },
    /// Black and white level out of order.
    #[error(
        "field `camera.white_level_dn`: found {white_dn}, expected above black_level_dn = \
         {black_dn}"
    )]
    Levels {
        /// Black level, DN.
        black_dn: f64,
        /// White level, DN.
        white_dn: f64,
    },
    /// A number of a linear camera for one whose response is recovered.
    #[error(
        "field `{field}`: holds for counts in proportion to light, and camera.response = \"recover\" \
         makes its own from codes of 8 bits: leave it out"
    )]
    Recovered {
        /// The field.
        field: &'static str,
    },
    /// One coefficient of the white without the other.
    #[error(
        "field `reference.{missing}` is missing: the white glows by both coefficients; give both \
         or neither"
    )]
    HalfAWhite {
        /// The one that is missing.
        missing: &'static str,
    },
}

/// The capture that `text` describes, checked.
///
/// ```
/// let capture = formats::parse_capture(r#"
///     material = "marble"
///     eta = 1.5
///     [geometry]
///     mm_per_pixel = 0.05
///     [sample]
///     frames = [ { file = "sample_01.tif", exposure_s = 0.001 } ]
///     dark   = [ { file = "dark_01.tif",  exposure_s = 0.001 } ]
///     [reference]
///     reflectance = 0.99
///     frames = [ { file = "white_01.tif", exposure_s = 0.001 } ]
///     dark   = [ { file = "dark_01.tif",  exposure_s = 0.001 } ]
/// "#)?;
/// assert_eq!(capture.u_eta(), formats::capture::DEFAULT_U_ETA);
/// assert!(capture.model.entry_loss);
/// # Ok::<(), formats::CaptureError>(())
/// ```
///
/// # Errors
///
/// [`CaptureError`] names the field of the first fault.
pub fn parse_capture(text: &str) -> Result<Capture, CaptureError> {
    let capture = parse_manifest(text)?.resolved(|field, frames| {
        frames
            .stated()
            .ok_or(CaptureError::ExposureElsewhere(field))
    })?;
    capture.check_frames()?;
    Ok(capture)
}

/// The manifest `text`, checked but for its frames, whose files and exposure times may have to
/// be looked up first.
///
/// # Errors
///
/// [`CaptureError`] names the field of the first fault.
pub fn parse_manifest(text: &str) -> Result<Capture<Frames>, CaptureError> {
    // A text that is no TOML at all is reported by the second pass, which shows the line.
    if let Ok(table) = text.parse::<Table>() {
        refuse_unsupported(&table)?;
        let mut open = vec![];
        placeholders("", &Value::Table(table), &mut open);
        if !open.is_empty() {
            return Err(CaptureError::Placeholder(open));
        }
    }
    let manifest: Capture<Frames> = parse_toml(text)?;
    manifest.check()?;
    Ok(manifest)
}

/// Adds every field of `value` that is yet to be filled in to `open`.
fn placeholders(field: &str, value: &Value, open: &mut Vec<String>) {
    match value {
        Value::String(text) if text == PLACEHOLDER => open.push(field.to_owned()),
        Value::Table(table) => {
            let dot = if field.is_empty() { "" } else { "." };
            for (key, value) in table {
                placeholders(&format!("{field}{dot}{key}"), value, open);
            }
        }
        Value::Array(list) => {
            for (i, value) in list.iter().enumerate() {
                placeholders(&format!("{field}[{i}]"), value, open);
            }
        }
        _ => {}
    }
}

/// What other versions of the manifest may say, and what to write today.
fn refuse_unsupported(table: &Table) -> Result<(), CaptureError> {
    let refuse = |field: String, instead| Err(CaptureError::NotSupported { field, instead });
    if table.get("channel").is_some() {
        return refuse(
            "channel".to_owned(),
            "give gray or RGB frames; channels follow from them",
        );
    }
    for section in ["sample", "reference"] {
        for list in ["frames", "dark"] {
            if let Some(Value::Array(frames)) = table.get(section).and_then(|s| s.get(list))
                && let Some(i) = frames.iter().position(|f| f.get("wavelength_nm").is_some())
            {
                let instead = "give one capture for each wavelength instead";
                return refuse(format!("{section}.{list}[{i}].wavelength_nm"), instead);
            }
        }
    }
    Ok(())
}

fn within(
    field: impl Into<String>,
    found: Option<f64>,
    domain: impl RangeBounds<f64>,
    expected: &'static str,
) -> Result<(), CaptureError> {
    match found {
        // NaN is in no range; infinity is in those without an end.
        Some(found) if !(found.is_finite() && domain.contains(&found)) => {
            Err(CaptureError::Value {
                field: field.into(),
                found,
                expected,
            })
        }
        _ => Ok(()),
    }
}

const POSITIVE: (Bound<f64>, Bound<f64>) = (Bound::Excluded(0.0), Bound::Unbounded);

impl Capture<Frames> {
    fn check(&self) -> Result<(), CaptureError> {
        const U: &str = "a standard uncertainty of at least 0, or leave it out for the default";
        const ANGLE: &str = "an angle from the normal of at least 0 and below 90 degrees";
        const INDEX: &str = "a relative refractive index from 1 to 5, as 1.3 for a wet tissue";
        const LEVEL: &str = "a count of at least 0";
        let Self {
            geometry,
            beam,
            camera,
            sample,
            reference,
            ..
        } = self;
        if self.material.is_empty() {
            return Err(CaptureError::EmptyText {
                field: "material".to_owned(),
            });
        }
        within("eta", Some(self.eta), SAMPLE_INDEX, INDEX)?;
        within("u_eta", self.u_eta, 0.0.., U)?;
        let length = "a length above 0 mm: what one pixel sees of the sample";
        for side in geometry.mm_per_pixel.into_iter().flat_map(PixelSize::sides) {
            within("geometry.mm_per_pixel", Some(side), POSITIVE, length)?;
        }
        within("geometry.u_mm_per_pixel", geometry.u_mm_per_pixel, 0.0.., U)?;
        within("geometry.u_corners_mm", geometry.u_corners_mm, 0.0.., U)?;
        geometry.check()?;
        for (index, pixel) in geometry.center_px.iter().flatten().enumerate() {
            let expected = "a position of at least 0 pixels, [column, row]";
            within(
                format!("geometry.center_px[{index}]"),
                Some(*pixel),
                0.0..,
                expected,
            )?;
        }
        let width = "a width of at least 0 mm, where 0 is a point";
        within("beam.fwhm_mm", beam.fwhm_mm, 0.0.., width)?;
        within("beam.u_fwhm_mm", beam.u_fwhm_mm, 0.0.., U)?;
        within("beam.angle_deg", Some(beam.angle_deg), 0.0..90.0, ANGLE)?;
        within("beam.u_angle_deg", beam.u_angle_deg, 0.0.., U)?;
        within("camera.angle_deg", camera.angle_deg, 0.0..90.0, ANGLE)?;
        within("camera.u_angle_deg", camera.u_angle_deg, 0.0.., U)?;
        let gain = "electrons per count, above 0, or leave it out to have it estimated";
        within("camera.gain_e_per_dn", camera.gain_e_per_dn, POSITIVE, gain)?;
        let noise = "electrons, at least 0, or leave it out to have it estimated";
        within("camera.read_noise_e", camera.read_noise_e, 0.0.., noise)?;
        within("camera.black_level_dn", camera.black_level_dn, 0.0.., LEVEL)?;
        within("camera.white_level_dn", camera.white_level_dn, 0.0.., LEVEL)?;
        if camera.response == Some(Response::Recover) {
            for (field, given) in [
                ("camera.gain_e_per_dn", camera.gain_e_per_dn.is_some()),
                ("camera.read_noise_e", camera.read_noise_e.is_some()),
                ("camera.black_level_dn", camera.black_level_dn.is_some()),
                ("camera.white_level_dn", camera.white_level_dn.is_some()),
                ("camera.mosaic", camera.mosaic.is_some()),
            ] {
                if given {
                    return Err(CaptureError::Recovered { field });
                }
            }
        }
        let prnu = "a relative spread of at least 0 and below 1, as 0.01";
        within(
            "camera.prnu_relative",
            Some(camera.prnu_relative),
            0.0..1.0,
            prnu,
        )?;
        if let (Some(black_dn), Some(white_dn)) = (camera.black_level_dn, camera.white_level_dn)
            && white_dn <= black_dn
        {
            return Err(CaptureError::Levels { black_dn, white_dn });
        }
        let thickness = "a thickness above 0 mm, or leave it out for a semi-infinite sample";
        within(
            "sample.thickness_mm",
            sample.thickness_mm,
            POSITIVE,
            thickness,
        )?;
        let index = "the index of the sample over that of what lies below, from 0.2 to 5";
        within("sample.eta_below", sample.eta_below, 0.2..=5.0, index)?;
        check_regions("sample", &sample.leave_out)?;
        check_regions("reference", &reference.leave_out)?;
        for (index, [from, to]) in sample.sectors_deg.iter().enumerate() {
            let field = format!("sample.sectors_deg[{index}]");
            let angles = "two angles from -360 to 360 degrees that differ, [from, to]";
            for angle in [from, to] {
                within(field.clone(), Some(*angle), -360.0..=360.0, angles)?;
            }
            if from == to {
                let (found, expected) = (*to, angles);
                return Err(CaptureError::Value {
                    field,
                    found,
                    expected,
                });
            }
        }
        let share = "a share above 0 and at most 1.05, as 0.99 for a white of 99 %";
        let whites = (Bound::Excluded(0.0), Bound::Included(1.05));
        within(
            "reference.reflectance",
            Some(reference.reflectance),
            whites,
            share,
        )?;
        let cosine = "a mean cosine above -1 and below 1";
        let cosines = (Bound::Excluded(-1.0), Bound::Excluded(1.0));
        within("model.g", self.model.g, cosines, cosine)?;
        within("reference.u_reflectance", reference.u_reflectance, 0.0.., U)?;
        let spread = "a relative uncertainty of at least 0 and below 1, as 0.1";
        within(
            "reference.u_sigma_s_prime_relative",
            reference.u_sigma_s_prime_relative,
            0.0..1.0,
            spread,
        )?;
        within("reference.eta", reference.eta, SAMPLE_INDEX, INDEX)?;
        let scattering = "a coefficient above 0 mm^-1";
        let white = reference.sigma_s_prime_per_mm.as_ref();
        for value in white.map_or(&[][..], PerChannel::values) {
            within(
                "reference.sigma_s_prime_per_mm",
                Some(*value),
                POSITIVE,
                scattering,
            )?;
        }
        let absorption = "a coefficient of at least 0 mm^-1";
        let dark_white = reference.sigma_a_per_mm.as_ref();
        for value in dark_white.map_or(&[][..], PerChannel::values) {
            within("reference.sigma_a_per_mm", Some(*value), 0.0.., absorption)?;
        }
        let u = reference.u_sigma_a_per_mm.as_ref();
        for value in u.map_or(&[][..], PerChannel::values) {
            within("reference.u_sigma_a_per_mm", Some(*value), 0.0.., U)?;
        }
        match (white, dark_white) {
            (Some(_), None) => Err(CaptureError::HalfAWhite {
                missing: "sigma_a_per_mm",
            }),
            (None, Some(_)) => Err(CaptureError::HalfAWhite {
                missing: "sigma_s_prime_per_mm",
            }),
            _ => Ok(()),
        }
    }

    /// The same with every file and its exposure time, as `find` tells for each list, which it is
    /// given with the name of its field.
    ///
    /// # Errors
    ///
    /// What `find` returns.
    pub fn resolved<E>(
        self,
        mut find: impl FnMut(&'static str, Frames) -> Result<Vec<FrameEntry>, E>,
    ) -> Result<Capture, E> {
        let (sample, reference) = (self.sample, self.reference);
        Ok(Capture {
            material: self.material,
            eta: self.eta,
            u_eta: self.u_eta,
            geometry: self.geometry,
            beam: self.beam,
            camera: self.camera,
            model: self.model,
            sample: Sample {
                thickness_mm: sample.thickness_mm,
                mask: sample.mask,
                leave_out: sample.leave_out,
                sectors_deg: sample.sectors_deg,
                rendering: sample.rendering,
                eta_below: sample.eta_below,
                frames: find("sample.frames", sample.frames)?,
                dark: find("sample.dark", sample.dark)?,
            },
            reference: Reference {
                reflectance: reference.reflectance,
                u_reflectance: reference.u_reflectance,
                sigma_s_prime_per_mm: reference.sigma_s_prime_per_mm,
                u_sigma_s_prime_relative: reference.u_sigma_s_prime_relative,
                sigma_a_per_mm: reference.sigma_a_per_mm,
                u_sigma_a_per_mm: reference.u_sigma_a_per_mm,
                eta: reference.eta,
                mask: reference.mask,
                leave_out: reference.leave_out,
                frames: find("reference.frames", reference.frames)?,
                dark: find("reference.dark", reference.dark)?,
            },
        })
    }
}

fn check_regions(section: &str, regions: &[Region]) -> Result<(), CaptureError> {
    for (index, region) in regions.iter().enumerate() {
        let field = |key: &str| format!("{section}.leave_out[{index}].{key}");
        match region {
            Region::Circle {
                circle_px: [x, y, radius],
            } => {
                for value in [x, y] {
                    within(
                        field("circle_px"),
                        Some(*value),
                        ..,
                        "[column, row, radius], pixels",
                    )?;
                }
                within(
                    field("circle_px"),
                    Some(*radius),
                    POSITIVE,
                    "a radius above 0 pixels",
                )?;
            }
            Region::Polygon { polygon_px } => {
                for value in polygon_px.iter().flatten() {
                    within(
                        field("polygon_px"),
                        Some(*value),
                        ..,
                        "corners [column, row], pixels",
                    )?;
                }
                let corners = polygon_px.len() as f64;
                within(
                    field("polygon_px"),
                    Some(corners),
                    3.0..,
                    "at least 3 corners",
                )?;
            }
        }
    }
    Ok(())
}

impl Geometry {
    /// One way to tell lengths, and that one whole.
    fn check(&self) -> Result<(), CaptureError> {
        let refuse = |found| Err(CaptureError::Geometry { found });
        match (self.mm_per_pixel, &self.corners_px, &self.corners_mm) {
            (Some(_), None, None) if self.u_corners_mm.is_some() => {
                refuse("u_corners_mm stands beside mm_per_pixel")
            }
            (Some(_), None, None) => Ok(()),
            (None, Some(px), Some(mm)) => {
                if self.u_mm_per_pixel.is_some() {
                    return refuse("u_mm_per_pixel stands beside corners, whose u is u_corners_mm");
                }
                for (field, corners) in [("corners_px", px), ("corners_mm", mm)] {
                    for value in corners.iter().flatten() {
                        within(
                            format!("geometry.{field}"),
                            Some(*value),
                            ..,
                            "a coordinate",
                        )?;
                    }
                }
                Ok(())
            }
            (None, None, None) => refuse("there is no length"),
            (None, Some(_), None) => refuse("corners_px stand without corners_mm"),
            (None, None, Some(_)) => refuse("corners_mm stand without corners_px"),
            (Some(_), ..) => refuse("mm_per_pixel and corners stand side by side"),
        }
    }
}

impl Capture {
    /// Checks the frames: each file once, exposure times above 0 and a dark for each.
    ///
    /// # Errors
    ///
    /// [`CaptureError`] names the field of the first fault.
    pub fn check_frames(&self) -> Result<(), CaptureError> {
        let (sample, reference) = (&self.sample, &self.reference);
        let mut seen: BTreeMap<&str, (String, &str)> = BTreeMap::new();
        for (list, frames) in [
            ("sample.frames", &sample.frames),
            ("sample.dark", &sample.dark),
            ("reference.frames", &reference.frames),
            ("reference.dark", &reference.dark),
        ] {
            if frames.is_empty() {
                return Err(CaptureError::NoFrames { field: list });
            }
            for (index, frame) in frames.iter().enumerate() {
                let field = format!("{list}[{index}].exposure_s");
                let expected = "an exposure time above 0 s";
                within(field, Some(frame.exposure_s), POSITIVE, expected)?;
                let field = format!("{list}[{index}].file");
                if frame.file.is_empty() {
                    return Err(CaptureError::EmptyText { field });
                }
                if let Some((before, first_list)) = seen.get(frame.file.as_str())
                    && !(list == "reference.dark" && *first_list == "sample.dark")
                {
                    let (before, file) = (before.clone(), frame.file.clone());
                    return Err(CaptureError::RepeatedFile {
                        field,
                        before,
                        file,
                    });
                }
                seen.insert(&frame.file, (field, list));
            }
        }
        every_frame_has_a_dark("sample.dark", &sample.frames, &sample.dark)?;
        every_frame_has_a_dark("reference.dark", &reference.frames, &reference.dark)
    }
}

fn every_frame_has_a_dark(
    field: &'static str,
    frames: &[FrameEntry],
    dark: &[FrameEntry],
) -> Result<(), CaptureError> {
    match frames
        .iter()
        .find(|frame| !dark.iter().any(|d| frame.same_exposure(d)))
    {
        None => Ok(()),
        Some(frame) => Err(CaptureError::NoDark {
            field,
            file: frame.file.clone(),
            exposure_s: frame.exposure_s,
            available_s: dark.iter().map(|d| d.exposure_s).collect(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{BeamProfile, Exit};
    use super::*;

    /// The manifest of the product page, its ellipses filled in.
    const GOOD: &str = r#"material = "marble"
eta = 1.5
u_eta = 0.01

[geometry]
mm_per_pixel = 0.05
u_mm_per_pixel = 0.0002
center_px = [512.0, 384.0]

[beam]
fwhm_mm = 0.3
u_fwhm_mm = 0.02
profile = "disk"
angle_deg = 10
u_angle_deg = 0.5

[camera]
angle_deg = 0
u_angle_deg = 0.2
gain_e_per_dn = 0.5
read_noise_e = 4
black_level_dn = 64
white_level_dn = 65000
prnu_relative = 0.01
response = "linear"

[model]
entry_loss = false
exit = "lambert"

[sample]
thickness_mm = 10
eta_below = 1.1
frames = [
  { file = "sample_01.tif", exposure_s = 0.001 },
  { file = "sample_02.tif", exposure_s = 0.002 },
]
dark   = [
  { file = "dark_01.tif",  exposure_s = 0.001 },
  { file = "dark_02.tif",  exposure_s = 0.002 },
]

[reference]
reflectance = 0.99
u_reflectance = 0.005
sigma_s_prime_per_mm = 11.6
u_sigma_s_prime_relative = 0.05
sigma_a_per_mm = 0
u_sigma_a_per_mm = 2e-5
eta = 1.35
frames = [ { file = "white_01.tif", exposure_s = 0.004 } ]
dark   = [ { file = "dark_04.tif", exposure_s = 0.004 } ]
"#;

    fn message(from: &str, to: &str) -> String {
        assert!(GOOD.contains(from), "{from}");
        parse_capture(&GOOD.replacen(from, to, 1))
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn every_documented_key_arrives() {
        let capture = parse_capture(GOOD).unwrap();
        assert_eq!(capture.eta, 1.5);
        assert_eq!(capture.geometry.center_px, Some([512.0, 384.0]));
        assert_eq!(capture.beam.profile, BeamProfile::Disk);
        assert_eq!(capture.camera.white_level_dn, Some(65000.0));
        assert_eq!(
            (capture.model.entry_loss, capture.model.exit),
            (false, Exit::Lambert)
        );
        assert_eq!(capture.sample.dark[1].exposure_s, 0.002);
        let white = capture.reference.medium(0, 1).unwrap().unwrap();
        assert_eq!(
            (white.sigma_s_prime, white.sigma_a, white.eta),
            (11.6, 0.0, 1.35)
        );
        assert!(capture.assumptions().is_empty());
    }

    #[test]
    fn the_white_has_one_number_for_all_channels_or_one_for_each() {
        let text = GOOD
            .replace("= 11.6", "= [11.6, 20.4, 14.9]")
            .replace("= 2e-5", "= [1e-5, 2e-5, 3e-5]");
        let capture = parse_capture(&text).unwrap();
        assert_eq!(parse_capture(&capture.to_toml()).unwrap(), capture);
        let u = |index, channels| capture.reference.u_sigma_a_per_mm(index, channels);
        assert_eq!(u(2, 3).unwrap(), 3e-5);
        assert!(u(0, 1).is_err());
        assert!(message("= 2e-5", "= -1").contains("reference.u_sigma_a_per_mm`: found -1"));
        let white = |index, channels| capture.reference.medium(index, channels);
        let green = white(1, 3).unwrap().unwrap();
        assert_eq!((green.sigma_s_prime, green.sigma_a), (20.4, 0.0));
        assert_eq!(
            white(0, 1).unwrap_err().to_string(),
            "field `reference.sigma_s_prime_per_mm`: found 3 numbers; expected one for all \
             channels, or one for each of the 1"
        );
        assert!(message("= 11.6", "= [11.6, 0]").contains("sigma_s_prime_per_mm`: found 0"));
    }

    #[test]
    fn a_response_that_is_recovered_has_its_own_counts() {
        let text = GOOD.replace("\"linear\"", "\"recover\"");
        let message = |text: &str| parse_capture(text).unwrap_err().to_string();
        assert!(message(&text).contains("field `camera.gain_e_per_dn`"));
        let alone: String = text
            .lines()
            .filter(|l| {
                !["gain_", "read_", "black_", "white_l"]
                    .iter()
                    .any(|k| l.starts_with(k))
            })
            .map(|l| format!("{l}\n"))
            .collect();
        let capture = parse_capture(&alone).unwrap();
        assert_eq!(capture.camera.response, Some(Response::Recover));
        assert_eq!(parse_capture(&capture.to_toml()).unwrap(), capture);
    }

    #[test]
    fn what_is_left_out_is_told() {
        let text = GOOD
            .lines()
            .filter(|line| !line.starts_with("u_") && !line.starts_with("eta = 1.35"))
            .collect::<Vec<_>>()
            .join("\n");
        let capture = parse_capture(&text).unwrap();
        let mut assumed: Vec<_> = capture
            .assumptions()
            .into_iter()
            .map(|a| (a.field, a.value))
            .collect();
        // Half of what loses 1 % of the light: by hand, 1 - R = (1 + 2A/3) k, A = 2.60 at 1.3 and
        // k = sqrt(3 sigma_a / 11.6), to first order.
        let at = assumed
            .iter()
            .position(|a| a.0 == "reference.u_sigma_a_per_mm");
        let (_, u) = assumed.remove(at.unwrap());
        let k: f64 = 0.01 / (1.0 + 2.0 / 3.0 * 2.60);
        let by_hand = 0.5 * 11.6 * k * k / 3.0;
        assert!((u / by_hand - 1.0).abs() < 0.03, "{u} {by_hand}");
        let expected = [
            ("u_eta", 0.01),
            ("geometry.u_mm_per_pixel", 0.00025),
            ("beam.u_fwhm_mm", 0.015),
            ("beam.u_angle_deg", 1.0),
            ("reference.u_reflectance", 0.01),
            ("reference.u_sigma_s_prime_relative", 0.1),
            ("reference.eta", 1.3),
        ];
        assert_eq!(assumed, expected);
    }

    #[test]
    fn a_number_outside_its_domain_names_its_field() {
        let cases = [
            ("eta = 1.5", "eta = 0.9", "field `eta`: found 0.9"),
            ("eta = 1.5", "eta = nan", "field `eta`: found NaN"),
            (
                "u_eta = 0.01",
                "u_eta = -0.01",
                "field `u_eta`: found -0.01",
            ),
            (
                "l = 0.05",
                "l = 0",
                "field `geometry.mm_per_pixel`: found 0",
            ),
            ("[512.0,", "[-3,", "field `geometry.center_px[0]`: found -3"),
            (
                "fwhm_mm = 0.3",
                "fwhm_mm = inf",
                "field `beam.fwhm_mm`: found inf",
            ),
            (
                "angle_deg = 10",
                "angle_deg = 90",
                "field `beam.angle_deg`: found 90",
            ),
            (
                "gain_e_per_dn = 0.5",
                "gain_e_per_dn = 0",
                "field `camera.gain_e_per_dn`: found 0",
            ),
            (
                "white_level_dn = 65000",
                "white_level_dn = 64",
                "above black_level_dn = 64",
            ),
            (
                "thickness_mm = 10",
                "thickness_mm = -1",
                "field `sample.thickness_mm`: found -1",
            ),
            (
                "s = 0.002",
                "s = 0",
                "field `sample.frames[1].exposure_s`: found 0",
            ),
            (
                "s = 0.002",
                "s = nan",
                "field `sample.frames[1].exposure_s`: found NaN",
            ),
            (
                "s = 0.002",
                "s = -1.5",
                "field `sample.frames[1].exposure_s`: found -1.5",
            ),
            (
                "reflectance = 0.99",
                "reflectance = 99",
                "field `reference.reflectance`: found 99",
            ),
            (
                "sigma_a_per_mm = 0",
                "",
                "field `reference.sigma_a_per_mm` is missing",
            ),
        ];
        for (from, to, expected) in cases {
            let found = message(from, to);
            assert!(found.contains(expected), "{to}: {found}");
        }
    }

    #[test]
    fn faults_in_the_lists_of_frames_are_named() {
        let found = message(
            "dark_02.tif\",  exposure_s = 0.002",
            "dark_02.tif\", exposure_s = 2",
        );
        assert_eq!(
            found,
            "field `sample.dark`: no dark for sample_02.tif, exposed 0.002 s; there are darks of \
             0.001, 2 s: add one of 0.002 s, taken with the beam blocked"
        );
        let found = message("[ { file = \"white_01.tif\", exposure_s = 0.004 } ]", "[]");
        assert!(
            found.contains("field `reference.frames`: found no frame"),
            "{found}"
        );
        let found = message("sample_02", "sample_01");
        assert!(
            found.contains("`sample.frames[1].file`: sample_01.tif stands in"),
            "{found}"
        );
        // A dark may serve both, but the beam is on in a frame.
        assert!(
            parse_capture(
                &GOOD
                    .replace("exposure_s = 0.004", "exposure_s = 0.002")
                    .replace("dark_04", "dark_02")
            )
            .is_ok()
        );
        assert!(message("white_01", "dark_02").contains("stands in `sample.dark[1].file`"));
    }

    #[test]
    fn unknown_and_future_keys_are_told_apart() {
        let cases = [
            (
                "mm_per_pixel",
                "mm_per_pixl",
                "line 6: unknown key `mm_per_pixl`, did you mean `mm_",
            ),
            (
                "[camera]",
                "[kamera]",
                "unknown key `kamera`, did you mean `camera`",
            ),
            ("u_eta", "u_n", "line 3: unknown key `u_n`"),
            (
                "\"linear\"",
                "\"recover\"",
                "field `camera.gain_e_per_dn`: holds for counts in proportion to light",
            ),
            (
                "mm_per_pixel = 0.05",
                "corners_px = [[0, 0], [9, 0], [9, 9], [0, 9]]",
                "field `geometry`: corners_px stand without corners_mm",
            ),
            (
                "mm_per_pixel = 0.05",
                "mm_per_pixel = [0.05, -0.05]",
                "field `geometry.mm_per_pixel`: found -0.05",
            ),
            ("[model]", "[model]\ng = 1.0", "field `model.g`"),
            (
                "[ { file = \"white_01.tif\", exposure_s = 0.004 } ]",
                "\"white/*.tif\"",
                "field `reference.frames`: the exposure times are not written here",
            ),
            (
                "[ { file = \"white_01.tif\", exposure_s = 0.004 } ]",
                "[ { file = \"white_01.tif\", exposure = 0.004 } ]",
                "unknown key `exposure`, did you mean `exposure_s`",
            ),
            (
                "white_01.tif\", exposure_s = 0.004",
                "white_01.tif\", exposure_s = \"?\"",
                "field `reference.frames[0].exposure_s` is still \"?\"",
            ),
            ("eta = 1.5", "eta = \"?\"", "field `eta` is still \"?\""),
            (
                "response = \"linear\"",
                "mosaic = \"RGB\"",
                "a pattern has 4, 16 or 36 letters",
            ),
            (
                "exposure_s = 0.004 }",
                "exposure_s = 0.004, wavelength_nm = 550 }",
                "field `reference.frames[0].wavelength_nm` is not supported yet",
            ),
            (
                "exit = \"lambert\"",
                "exit = \"lamberd\"",
                "unknown variant `lamberd`",
            ),
            ("eta = 1.5", "", "missing field `eta`"),
            ("eta = 1.5", "eta = ", "line 2"),
        ];
        for (from, to, expected) in cases {
            let found = message(from, to);
            assert!(found.contains(expected), "{to}: {found}");
        }
    }

    #[test]
    fn a_manifest_written_is_read_back() {
        let full = parse_capture(GOOD).unwrap();
        assert_eq!(parse_capture(&full.to_toml()).unwrap(), full);
        let mut bare = full;
        bare.material = "a \"quoted\"\nname ä".to_owned();
        bare.sample.frames[0].file = "dir\\frame \"1\".tif".to_owned();
        bare.geometry.center_px = None;
        bare.beam = Default::default();
        bare.camera = Default::default();
        bare.model = Default::default();
        bare.reference.sigma_a_per_mm = None;
        bare.reference.sigma_s_prime_per_mm = None;
        bare.sample.thickness_mm = None;
        bare.sample.frames[0].exposure_s = 1e-7;
        bare.sample.dark[0].exposure_s = 1e-7;
        assert_eq!(parse_capture(&bare.to_toml()).unwrap(), bare);
    }

    /// A fault of a frame is told by the line of that frame, not of its list or of the first one.
    #[test]
    fn a_fault_of_a_frame_is_told_by_its_own_line() {
        let second = "{ file = \"sample_02.tif\", exposure_s = 0.002 }";
        let line = 1 + GOOD.lines().position(|l| l.contains(second)).unwrap();
        for (wrong, words) in [
            ("{ file = \"b\", exposure_s = \"long\" }", "string \"long\""),
            ("{ file = 2, exposure_s = 0.002 }", "integer `2`"),
            ("{ exposure_s = 0.002 }", "missing field `file`"),
            ("{ file = \"b\", exposure = 0.002 }", "mean `exposure_s`?"),
            ("\"b\"", "expected { file, exposure_s }"),
        ] {
            let found = message(second, wrong);
            let here = found.contains(&format!("line {line}"));
            assert!(here && found.contains(words), "{line}: {found}");
        }
    }
}

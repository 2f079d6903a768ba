//! From the manifest's geometry to the view that a profile is taken through.

use crate::capture::Loaded;
use crate::error::{Blame, Error, Kind, Result};
use crate::measure::Radiance;
use formats::capture::{self as manifest, Exit, PixelSize};
use physics::{RadianceMap, fresnel};
use profile::{GlowCenter, ProfileOptions, View, find_center, glow_center};

/// By how much the sides of a pixel that is called square may differ.
const SQUARE: f64 = 1e-3;

/// Degrees by which a stated angle may differ from that of the corners before it is named.
const NAMED_ANGLE_DEG: f64 = 3.0;

/// Relative change of the exit factor across the picture from which it is named.
const NAMED_EXIT: f64 = 1e-3;

impl Loaded {
    /// Where each pixel looks.
    ///
    /// # Errors
    ///
    /// The corners are no quadrilaterals.
    pub fn view(&self) -> Result<View> {
        let geometry = &self.capture.geometry;
        match (
            &geometry.mm_per_pixel,
            &geometry.corners_px,
            &geometry.corners_mm,
        ) {
            (Some(size), ..) => Ok(View::rectangular(size.sides())),
            (None, Some(px), Some(mm)) => View::corners(px, mm)
                .input(format!("{}: field `geometry`", self.input.path.display())),
            _ => Err(Error::new(
                Kind::Fault,
                "a manifest without lengths passed its check",
            )),
        }
    }
}

/// Refuses pixels that are not square by their file, and are by the manifest.
pub(crate) fn check_aspect(size: Option<PixelSize>, aspect: f64) -> Result<()> {
    let square = matches!(size, Some(PixelSize::Square(_)));
    if !square || (aspect - 1.0).abs() <= SQUARE {
        return Ok(());
    }
    let message = format!(
        "its pixels are {aspect:.4} times as wide as they are high by its own tags (resolution of \
         a TIFF, pHYs of a PNG, XPIXSZ or CDELT of a FITS, DefaultScale, pixelAspectRatio), and geometry.mm_per_pixel is one length: expected [across, down] in mm, \
         or the same number twice where the tags are wrong"
    );
    Err(Error::new(Kind::Input, message))
}

/// Relative standard uncertainty of lengths at `px`.
pub(crate) fn u_length_relative(geometry: &manifest::Geometry, px: [f64; 2]) -> f64 {
    match (&geometry.corners_px, &geometry.corners_mm) {
        (Some(corners_px), Some(corners_mm)) => {
            let u = geometry.u_corners_mm();
            // The corners made a view before.
            View::u_length_relative(corners_px, corners_mm, u, px).unwrap_or(0.0)
        }
        _ => geometry.u_mm_per_pixel_relative(),
    }
}

/// The angle between normal and line of sight.
pub(crate) struct CameraAngle {
    /// At the spot, rad.
    pub(crate) angle: f64,
    /// What is to be said of it, in sentences.
    pub(crate) lines: Vec<String>,
}

/// The angle that the manifest states, or that its corners have where the spot is.
///
/// One angle serves the whole picture: up to 50 degrees a smooth surface lets the same share out
/// within percents.
///
/// # Errors
///
/// The `white` shows no spot.
pub(crate) fn camera_angle(
    loaded: &Loaded,
    view: &View,
    white: &RadianceMap,
) -> Result<CameraAngle> {
    let capture = &loaded.capture;
    let stated = capture.camera.angle_deg;
    if capture.geometry.corners_mm.is_none() {
        return Ok(CameraAngle {
            angle: stated.unwrap_or(0.0).to_radians(),
            lines: vec![],
        });
    }
    let (width, height) = (white.width, white.height);
    let spot = find_center(&white.channel(0), width, height)
        .input(format!("{}: reference", loaded.input.path.display()))?;
    let found = view.tilt(spot);
    let found_deg = found.to_degrees();
    let mut lines = vec![];
    let angle = match stated {
        None => {
            lines.push(format!(
                "camera.angle_deg was not given; {found_deg:.1} was taken, as the corners have it \
                 at the spot for square pixels"
            ));
            found
        }
        Some(stated) => {
            if (stated - found_deg).abs() > NAMED_ANGLE_DEG {
                lines.push(format!(
                    "camera.angle_deg = {stated} was used; the corners have {found_deg:.1} degrees \
                     at the spot, if pixels are square: check both"
                ));
            }
            stated.to_radians()
        }
    };
    if capture.model.exit == Exit::Fresnel {
        let factor = |angle: f64| fresnel::exit_factor(capture.eta, angle.cos());
        let (right, bottom) = (width as f64 - 1.0, height as f64 - 1.0);
        let change = [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]]
            .into_iter()
            .map(|px| (factor(view.tilt(px)) / factor(found) - 1.0).abs())
            .fold(0.0, f64::max);
        if change > NAMED_EXIT {
            lines.push(format!(
                "one angle of view was used for the whole picture; toward its corners it changes, \
                 and with it the light that leaves by {:.1} %",
                100.0 * change
            ));
        }
    }
    Ok(CameraAngle { angle, lines })
}

/// What the profiles are taken about.
#[derive(Clone, Debug)]
pub struct Centers {
    /// Of each channel, px; `None` has it found.
    pub px: Vec<Option<[f64; 2]>>,
    /// Under an oblique beam, where each channel's glow is centred.
    pub glow: Vec<GlowCenter>,
    /// What is to be said of it, in sentences.
    pub lines: Vec<String>,
}

/// Radii between which a glow's centre is looked for, over that of the largest circle: clear of the
/// beam, and not where noise is all.
const GLOW_RADII: (f64, f64) = (0.08, 0.6);

/// The centres about which profiles are taken: what the manifest states, or the spot; under an
/// oblique beam, the centre of the glow.
///
/// Light that enters at an angle is first scattered beside the point of entry, and what leaves far
/// away is round about the former. Taken about the entry, a ring would see the glow displaced,
/// which is wrong in second order of displacement over radius. A model that knows the beam's
/// angle takes it `about_entry` all the same.
///
/// # Errors
///
/// A channel shows no spot or no glow.
pub fn centers(loaded: &Loaded, radiance: &Radiance, about_entry: bool) -> Result<Centers> {
    let capture = &loaded.capture;
    let stated = capture.geometry.center_px;
    let map = &radiance.map;
    let mut centers = Centers {
        px: vec![stated; radiance.scales.len()],
        glow: vec![],
        lines: vec![],
    };
    if capture.beam.angle_deg == 0.0 {
        return Ok(centers);
    }
    for (index, center) in centers.px.iter_mut().enumerate() {
        let channel = &*map.channel(index);
        let place = || {
            let path = loaded.input.path.display();
            format!("{path}: sample, channel {}", channel.name)
        };
        let entry = match stated {
            Some(entry) => entry,
            None => find_center(channel, map.width, map.height).input(place())?,
        };
        let [x, y] = entry;
        let right = map.width as f64 - 0.5 - x;
        let below = map.height as f64 - 0.5 - y;
        let reach = right.min(below).min(x + 0.5).min(y + 0.5);
        let reach_mm = reach.max(0.0) * radiance.view.mm_per_pixel(entry);
        let options = ProfileOptions {
            view: radiance.view,
            center_px: Some(entry),
            ..ProfileOptions::default()
        };
        let (from, to) = GLOW_RADII;
        let radii = (from * reach_mm, to * reach_mm);
        let glow = glow_center(channel, map.width, map.height, &options, radii).input(place())?;
        let about = if stated.is_some() {
            "center_px, as stated"
        } else if about_entry {
            *center = Some(entry);
            "the entry, as the model wants it"
        } else {
            *center = Some(glow.px);
            "the glow"
        };
        let [right, down] = glow.displacement_mm;
        centers.lines.push(format!(
            "{}: the beam comes at {} degrees and enters at ({x:.2}, {y:.2}) px, as its bright part has \
             it; the glow is centred at ({:.2}, {:.2}) px, {:.4} ± {:.4} mm away; the profile was taken \
             about {about}",
            channel.name,
            capture.beam.angle_deg,
            glow.px[0],
            glow.px[1],
            right.hypot(down),
            glow.u_mm[0].max(glow.u_mm[1])
        ));
        centers.glow.push(glow);
    }
    Ok(centers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_are_not_square_need_two_lengths() {
        let square = Some(PixelSize::Square(0.05));
        assert!(check_aspect(square, 1.0).is_ok());
        let said = check_aspect(square, 2.0).unwrap_err().to_string();
        assert!(said.contains("2.0000 times as wide"), "{said}");
        let stated = Some(PixelSize::Rectangular([0.1, 0.05]));
        assert!(check_aspect(stated, 2.0).is_ok() && check_aspect(None, 2.0).is_ok());
    }
}

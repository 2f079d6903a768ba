//! From the manifest's geometry to the view that a profile is taken through.

use crate::capture::Loaded;
use crate::error::{Blame, Error, Kind, Result};
use formats::capture::{self as manifest, Exit};
use physics::{RadianceMap, fresnel};
use profile::{View, find_center};

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

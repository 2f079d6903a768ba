//! The mean over rings about the spot.

use crate::error::ProfileError;
use crate::survey::Survey;
use crate::view::View;
use physics::{ChannelMap, RadialProfile, TotalReflectance};

/// How a picture becomes a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileOptions {
    /// Where on the sample each pixel looks.
    pub view: View,
    /// Centre of the spot, px, the middle of the first pixel being (0, 0); `None` finds it.
    pub center_px: Option<[f64; 2]>,
    /// Exitance per incident power, mm⁻², for one unit of the picture: [`crate::Scale`] has it.
    /// 1 for a picture that is already in mm⁻².
    pub factor_per_mm2: f64,
    /// Relative standard uncertainty of that factor.
    pub u_scale_relative: f64,
    /// Width of a ring over its radius. Default 0.025, at most 0.25.
    pub relative_width: f64,
    /// Least width of a ring, px. Default 1.5, at least 1.
    pub min_width_px: f64,
    /// Standard uncertainties from the ring's curve beyond which a pixel is an outlier.
    /// Default 5, at least 3.
    pub clip: f64,
}

impl Default for ProfileOptions {
    /// Pixels of 0.04 mm; on a frame of 1024 × 1024 with the spot in the middle, 125 rings.
    fn default() -> Self {
        Self {
            view: View::square(0.04),
            center_px: None,
            factor_per_mm2: 1.0,
            u_scale_relative: 0.0,
            relative_width: 0.025,
            min_width_px: 1.5,
            clip: 5.0,
        }
    }
}

/// A channel's profile and total, and what was left out of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Mean over each ring, mm⁻².
    pub profile: RadialProfile,
    /// The sum inside the largest full circle.
    pub total: TotalReflectance,
    /// Centre of the spot, px.
    pub center_px: [f64; 2],
    /// Pixels inside the circle that were rejected as outliers.
    pub rejected_pixels: u64,
    /// Pixels inside the circle that no frame measured, or that were left out.
    pub unmeasured_pixels: u64,
    /// Share of the circle's light whose pixels were rejected, not measured or left out, so that
    /// the rest of their rings stands for them.
    pub unseen_share: f64,
    /// Scatter of the pixels about their ring's curve over what their variances say, median
    /// over the rings: 1 for a round picture, more where the glow is not round.
    pub relative_scatter: f64,
}

impl Measured {
    /// The same less an even light of `offset` per mm².
    #[must_use]
    pub fn less(mut self, offset: f64) -> Self {
        for point in &mut self.profile.points {
            point.reflectance_per_mm2 -= offset;
        }
        if let Some(radius) = self.total.radius_max_mm {
            self.total.total_reflectance -= offset * std::f64::consts::PI * radius * radius;
        }
        self
    }
}

/// The radial profile of `channel`, a picture of `width` × `height` px, and its total.
///
/// The value of a ring is the mean over its area on the surface of the exitance that pixels see (the model has
/// to be smeared by one pixel's square, [`physics::Blur`]), and its u the part that is
/// independent of every other ring. The total is Σ area·value, so that its covariance with a
/// ring's value is area·u². Unmeasured and rejected pixels are replaced by the rest of their
/// ring.
///
/// # Errors
///
/// The picture has no spot with enough room around it, a ring has no measured pixel, the total
/// is above 1 by more than three of its standard uncertainties (the reference's included), or an
/// option is out of its range.
pub fn radial_profile(
    channel: &ChannelMap,
    width: usize,
    height: usize,
    options: &ProfileOptions,
) -> Result<Measured, ProfileError> {
    Survey::new(channel, width, height, options)?.checked(channel, options)
}

/// The same of a picture in any unit, whose total is then no share of anything.
///
/// # Errors
///
/// As [`radial_profile`], but for the total.
pub fn unscaled_profile(
    channel: &ChannelMap,
    width: usize,
    height: usize,
    options: &ProfileOptions,
) -> Result<Measured, ProfileError> {
    Ok(Survey::new(channel, width, height, options)?.measured(channel, options))
}

/// Whether every option is in its range.
pub(crate) fn check_options(options: &ProfileOptions) -> Result<(), ProfileError> {
    let positive = |x: f64| x > 0.0 && x.is_finite();
    options.view.check()?;
    let checks = [
        (
            positive(options.factor_per_mm2),
            "factor_per_mm2",
            "above 0 and finite",
            options.factor_per_mm2,
        ),
        (
            options.u_scale_relative >= 0.0 && options.u_scale_relative.is_finite(),
            "u_scale_relative",
            "at least 0 and finite",
            options.u_scale_relative,
        ),
        (
            (0.001..=0.25).contains(&options.relative_width),
            "relative_width",
            "between 0.001 and 0.25",
            options.relative_width,
        ),
        (
            (1.0..=3.0).contains(&options.min_width_px),
            "min_width_px",
            "between 1 and 3 px",
            options.min_width_px,
        ),
        (
            options.clip >= 3.0 && options.clip.is_finite(),
            "clip",
            "at least 3 and finite",
            options.clip,
        ),
    ];
    for (good, name, expected, found) in checks {
        if !good {
            return Err(ProfileError::Option {
                name,
                expected,
                found,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;

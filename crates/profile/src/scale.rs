//! The absolute scale, from a picture of a white reference.

use crate::error::ProfileError;
use crate::radial::ProfileOptions;
use crate::stray::{Stray, stray_light};
use crate::survey::Survey;
use crate::view::View;
use crate::white::{SOURCES, White};
use physics::{ChannelMap, DiffuseFresnel, Dipole, RadialProfile, ReducedMedium, fresnel};

/// How light that leaves the sample spreads over directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exit {
    /// Through a smooth boundary: the radiance seen is exitance/π times
    /// [`fresnel::exit_factor`].
    Fresnel {
        /// Relative index of the sample.
        eta: f64,
        /// Angle between the normal and the line of sight, rad.
        angle: f64,
    },
    /// The same radiance in all directions, as the paper has it.
    Lambert,
}

impl Exit {
    /// π·radiance at the camera's angle over exitance.
    pub fn factor(&self) -> f64 {
        match *self {
            Self::Fresnel { eta, angle } => fresnel::exit_factor(eta, angle.cos()),
            Self::Lambert => 1.0,
        }
    }
}

/// What is known of the white reference and of how the sample is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceOptions {
    /// Where on the white each pixel looks.
    pub view: View,
    /// Centre of its spot, px; `None` finds it.
    pub center_px: Option<[f64; 2]>,
    /// Total reflectance of the white, per incident power.
    pub reflectance: f64,
    /// Standard uncertainty of that.
    pub u_reflectance: f64,
    /// The white as a medium, which spreads light too; `None` for an ideal surface.
    pub white: Option<White>,
    /// How the *sample* lets light out. The white itself is a Lambertian surface.
    pub exit: Exit,
}

/// What turns a picture of the sample into exitance per incident power.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// Exitance per incident power, mm⁻², for one DN/s.
    pub factor_per_mm2: f64,
    /// Relative standard uncertainty of the factor: the white's reflectance and coefficients, and
    /// noise and stray light of its picture.
    pub u_relative: f64,
    /// Its part that comes from the noise of the white's picture.
    pub u_noise_relative: f64,
    /// Sum of the reference's pixels inside the circle, DN/s, each times its area over that of a
    /// pixel at the centre.
    pub reference_sum: f64,
    /// Profile of the reference's spot, DN/s, less stray light.
    pub white: RadialProfile,
    /// Stray light in the reference's picture, DN/s: subtracted as far as it was measured.
    pub stray: Option<Stray>,
    /// The part of `u_relative` that comes from stray light.
    pub u_stray_relative: f64,
    /// Share of the white's light inside the circle that an even light of one unit of the picture
    /// would make.
    pub even_relative: f64,
    /// Centre of the reference's spot, px.
    pub center_px: [f64; 2],
    /// Radius of the circle, mm.
    pub radius_mm: f64,
    /// Share of the reference's light that leaves inside the circle; 1 for an ideal surface.
    pub share: f64,
    /// Pixels inside the circle that were rejected as outliers.
    pub rejected_pixels: u64,
    /// Pixels inside the circle that no frame measured.
    pub unmeasured_pixels: u64,
    /// Share of the circle's light for which the rest of the rings stands.
    pub unseen_share: f64,
    /// What the white's own coefficients, off by their standard uncertainty, change.
    pub by_white: [OffWhite; 2],
}

/// What one coefficient of the white changes that is larger by its standard uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffWhite {
    /// The coefficient, as a budget calls it.
    pub source: &'static str,
    /// Relative change of [`Scale::factor_per_mm2`]: by the light that leaves outside the circle,
    /// and by what is taken for stray light.
    pub factor_relative: f64,
    /// Change of the share of stray light.
    pub stray_share: f64,
}

/// The scale that the white reference in `channel`, in DN/s, sets.
///
/// The sum inside the largest full circle is KΦ·ρ·share over the area of a pixel, with ρ the
/// white's reflectance and KΦ what the paper calls so. Of a white that is a translucent medium
/// itself, part of the light leaves outside the circle: share is that of its dipole.
///
/// # Errors
///
/// As [`crate::radial_profile`], and [`ProfileError::DarkReference`] for one without light.
///
/// # Source
///
/// Jensen et al. (2001), section 3.
pub fn reference_scale(
    channel: &ChannelMap,
    width: usize,
    height: usize,
    options: &ReferenceOptions,
) -> Result<Scale, ProfileError> {
    let ReferenceOptions {
        reflectance,
        u_reflectance,
        ..
    } = *options;
    if !(reflectance > 0.0 && reflectance <= 1.0) {
        return Err(ProfileError::Option {
            name: "reflectance",
            expected: "above 0 and at most 1",
            found: reflectance,
        });
    }
    if !(u_reflectance >= 0.0 && u_reflectance.is_finite()) {
        return Err(ProfileError::Option {
            name: "u_reflectance",
            expected: "at least 0 and finite",
            found: u_reflectance,
        });
    }
    let exit = options.exit.factor();
    if !(exit > 0.0 && exit.is_finite()) {
        return Err(ProfileError::Option {
            name: "exit factor",
            expected: "above 0: the camera must not look along the surface",
            found: exit,
        });
    }
    let in_own_unit = ProfileOptions {
        view: options.view,
        center_px: options.center_px,
        ..ProfileOptions::default()
    };
    let survey = Survey::new(channel, width, height, &in_own_unit)?;
    let mut measured = survey.measured(channel, &in_own_unit);
    let mean = channel.mean_measured();
    let stray = stray_light(&measured.profile, options.white.as_ref(), mean);
    measured = measured.less(stray.map_or(0.0, |stray| stray.offset));
    let total = &measured.total;
    if total.total_reflectance <= 0.0 {
        return Err(ProfileError::DarkReference(total.total_reflectance));
    }
    let radius_mm = total.radius_max_mm.expect("a measured total has a radius");
    let inside = |medium: &ReducedMedium| {
        let dipole = Dipole::new(medium, DiffuseFresnel::Exact);
        1.0 - dipole.beyond(radius_mm) / dipole.beyond(0.0)
    };
    let share = options.white.map_or(1.0, |white| inside(&white.medium));
    let pixel = survey.unit_mm * survey.unit_mm;
    let u_noise_relative = total.u_total_reflectance / total.total_reflectance;
    let even_relative = std::f64::consts::PI * radius_mm * radius_mm / total.total_reflectance;
    let u_stray_relative = stray.map_or(0.0, |s| s.u * even_relative);
    let sides = options.white.map(|white| white.sides());
    let by_white = [0, 1].map(|which| {
        let shift = stray.map_or_else(Default::default, |stray| stray.by_white[which]);
        let inside = sides.map_or(0.0, |sides| sides[which].change(inside));
        OffWhite {
            source: SOURCES[which],
            // Light that is taken for stray light is missing in the white's own.
            factor_relative: inside / share + shift.offset * even_relative,
            stray_share: shift.share,
        }
    });
    Ok(Scale {
        factor_per_mm2: reflectance * share / (total.total_reflectance * exit),
        u_relative: (u_reflectance / reflectance)
            .hypot(u_noise_relative)
            .hypot(u_stray_relative)
            .hypot(by_white[0].factor_relative)
            .hypot(by_white[1].factor_relative),
        by_white,
        u_noise_relative,
        stray,
        u_stray_relative,
        even_relative,
        reference_sum: total.total_reflectance / pixel,
        center_px: measured.center_px,
        white: measured.profile,
        radius_mm,
        share,
        rejected_pixels: measured.rejected_pixels,
        unmeasured_pixels: measured.unmeasured_pixels,
        unseen_share: measured.unseen_share,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: ReducedMedium = ReducedMedium {
        sigma_a: 1e-4,
        sigma_s_prime: 11.6,
        eta: 1.3,
    };

    /// A spot of unit height, 2πσ² = 307.9 in all, with a tail beyond the frame left out.
    fn reference() -> ChannelMap {
        let value = (0..128 * 128)
            .map(|i| {
                let (x, y) = ((i % 128) as f64 - 63.2, (i / 128) as f64 - 64.1);
                (-0.5 * (x * x + y * y) / 49.0).exp() as f32
            })
            .collect();
        ChannelMap {
            name: "Y".to_owned(),
            value,
            variance: vec![1e-6; 128 * 128],
        }
    }

    fn options() -> ReferenceOptions {
        ReferenceOptions {
            view: View::square(0.1),
            center_px: None,
            reflectance: 0.99,
            u_reflectance: 0.005,
            white: None,
            exit: Exit::Lambert,
        }
    }

    #[test]
    fn an_ideal_surface_is_its_sum() {
        let scale = reference_scale(&reference(), 128, 128, &options()).unwrap();
        let sum = 2.0 * std::f64::consts::PI * 49.0;
        assert!((scale.reference_sum / sum - 1.0).abs() < 1e-5, "{scale:?}");
        let expected = 0.99 / (sum * 0.01);
        assert!(
            (scale.factor_per_mm2 / expected - 1.0).abs() < 1e-5,
            "{scale:?}"
        );
        // 12,700 pixels of 1e-3 make 0.113 of 307.9.
        let noise = (63.7_f64 * 63.7 * std::f64::consts::PI * 1e-6).sqrt() / sum;
        // What the noise leaves open of an even light in the circle is of the same size.
        let stray = scale.u_stray_relative;
        assert!(
            stray > 0.5 * noise && stray < 3.0 * noise,
            "{stray} {noise}"
        );
        let expected = (0.005 / 0.99_f64).hypot(noise).hypot(stray);
        assert!(
            (scale.u_relative / expected - 1.0).abs() < 1e-3,
            "{scale:?}"
        );
        assert_eq!(scale.share, 1.0);
    }

    #[test]
    fn the_white_glows_and_the_sample_is_seen_from_an_angle() {
        let plain = reference_scale(&reference(), 128, 128, &options()).unwrap();
        let full = ReferenceOptions {
            white: Some(White::exact(WHITE)),
            exit: Exit::Fresnel {
                eta: 1.5,
                angle: 0.0,
            },
            ..options()
        };
        let scale = reference_scale(&reference(), 128, 128, &full).unwrap();
        // The light of the dipole inside the circle, ring by ring.
        let dipole = Dipole::new(&WHITE, DiffuseFresnel::Exact);
        let step = scale.radius_mm / 40_000.0;
        let inside: f64 = (0..40_000)
            .map(|k| (f64::from(k) + 0.5) * step)
            .map(|r| 2.0 * std::f64::consts::PI * r * step * dipole.diffuse_reflectance(r))
            .sum();
        let share = inside / dipole.total_reflectance();
        assert!((scale.share - share).abs() < 1e-6, "{scale:?} {share}");
        // FIELD: 1.057 at 1.5 along the normal.
        let factor = scale.factor_per_mm2 / (plain.factor_per_mm2 * share);
        assert!((factor * 1.057 - 1.0).abs() < 5e-4, "{factor}");
    }

    #[test]
    fn each_bad_option_is_named() {
        for bad in [0.0, 1.2, f64::NAN] {
            let options = ReferenceOptions {
                reflectance: bad,
                ..options()
            };
            assert!(matches!(
                reference_scale(&reference(), 128, 128, &options),
                Err(ProfileError::Option {
                    name: "reflectance",
                    ..
                })
            ));
        }
    }
}

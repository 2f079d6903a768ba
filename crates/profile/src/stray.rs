//! Stray light: what lens and housing spread evenly over the picture.

use nalgebra::{Matrix3, Vector3};
use physics::{DiffuseFresnel, Dipole, ProfilePoint, RadialProfile, ReducedMedium};

/// Radii at half of the peak, and share of the picture's radius, beyond which the spot itself is
/// out of sight and the white's glow has its far form.
const SPOTS: f64 = 8.0;
const OUTER: f64 = 1.0 / 3.0;

/// Fewest rings in which an offset can be told from a glow.
const LEAST: usize = 8;

/// Outermost rings whose light bounds what is stray in it.
const LAST: usize = 4;

/// Relative standard uncertainty of a glow that was computed from the white's coefficients.
const GLOW: f64 = 0.1;

/// Standard uncertainties below 0 at which an offset is no stray light: the white absorbs what its
/// coefficients do not say, and its glow ends sooner.
const BELOW: f64 = 4.0;

/// Stray light in a picture of the white reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stray {
    /// What every pixel has of it, in the unit of the profile; 0 where it could only be bounded.
    pub offset: f64,
    /// Standard uncertainty of the offset.
    pub u: f64,
    /// The offset as a share of the mean light of the picture, less stray light.
    pub share: f64,
    /// Standard uncertainty of the share.
    pub u_share: f64,
    /// Whether the far field showed it; otherwise it lies between nothing and a bound.
    pub measured: bool,
}

/// Stray light in the picture of a white reference, whose profile is `white`: what is left in the
/// far field beside its own glow, or, where the picture ends too near to the spot, a bound.
///
/// Far from the beam a white that absorbs nothing glows as r⁻³ + c r⁻⁵ whatever its coefficients
/// and its beam are, and one whose coefficients are known as its dipole d(r) + c d(r)/r²; how
/// bright that is is found along with the offset. `mean` is the mean of all pixels of the picture,
/// in the unit of the profile. Of a picture without light nothing is found.
pub fn stray_light(
    white: &RadialProfile,
    medium: Option<&ReducedMedium>,
    mean: f64,
) -> Option<Stray> {
    let dipole = medium.map(|m| Dipole::new(m, DiffuseFresnel::Exact));
    let bound = bounded(&white.points, dipole.as_ref(), mean);
    let found = measured(&white.points, dipole.as_ref(), mean);
    match (found, bound) {
        (Some(found), Some(bound)) if found.u > bound.u => Some(bound),
        (found, bound) => found.or(bound),
    }
}

fn glow(dipole: Option<&Dipole>, radius: f64) -> f64 {
    dipole.map_or_else(|| radius.powi(-3), |d| d.diffuse_reflectance(radius))
}

/// The offset and the glow by weighted least squares.
fn measured(points: &[ProfilePoint], dipole: Option<&Dipole>, mean: f64) -> Option<Stray> {
    let peak = points.first()?.reflectance_per_mm2;
    let spot = points.iter().find(|p| p.reflectance_per_mm2 < 0.5 * peak)?;
    let (_, last) = points.last()?.ring_mm?;
    let start = (SPOTS * spot.radius_mm).max(OUTER * last);
    let far: Vec<_> = points
        .iter()
        .filter(|p| p.ring_mm.is_some_and(|r| r.0 >= start) && p.u_reflectance_per_mm2 > 0.0)
        .collect();
    if far.len() < LEAST {
        return None;
    }
    let unit = glow(dipole, start);
    let terms = |p: &ProfilePoint| {
        let near = glow(dipole, p.radius_mm) / unit;
        let ratio = start / p.radius_mm;
        Vector3::new(near, near * ratio * ratio, 1.0)
    };
    let (mut normal, mut side) = (Matrix3::zeros(), Vector3::zeros());
    for p in &far {
        let (row, weight) = (terms(p), p.u_reflectance_per_mm2.powi(-2));
        normal += weight * row * row.transpose();
        side += weight * p.reflectance_per_mm2 * row;
    }
    let covariance = normal.try_inverse()?;
    let found = covariance * side;
    let chi2: f64 = far
        .iter()
        .map(|p| {
            let off = p.reflectance_per_mm2 - terms(p).dot(&found);
            (off / p.u_reflectance_per_mm2).powi(2)
        })
        .sum();
    let widened = (chi2 / (far.len() - 3) as f64).sqrt().max(1.0);
    let offset = found[2];
    let u = widened * covariance[(2, 2)].sqrt();
    let direct = mean - offset;
    let sound = u.is_finite() && direct > 0.0 && offset > -BELOW * u;
    sound.then(|| Stray {
        offset,
        u,
        share: offset / direct,
        u_share: u / direct,
        measured: true,
    })
}

/// Between nothing and the light of the outermost rings, less the white's glow where that is known.
fn bounded(points: &[ProfilePoint], dipole: Option<&Dipole>, mean: f64) -> Option<Stray> {
    let last = &points[points.len().saturating_sub(LAST)..];
    let inside: f64 = (points.iter())
        .map(|p| p.area_mm2() * p.reflectance_per_mm2)
        .sum();
    let radius = points.last()?.ring_mm?.1;
    // As bright as its own total, to some percent.
    let bright = dipole.map(|d| inside / (d.beyond(0.0) - d.beyond(radius)));
    let (mut most, mut noise) = (0.0_f64, 0.0_f64);
    for p in last {
        let expected = dipole.zip(bright).map_or(0.0, |(d, bright)| {
            bright * d.diffuse_reflectance(p.radius_mm)
        });
        most += (p.reflectance_per_mm2 - expected).max(0.0) + GLOW * expected;
        noise = noise.hypot(p.u_reflectance_per_mm2);
    }
    let count = last.len() as f64;
    // Any value from nothing to the bound, nothing being the likeliest.
    let u = (most / count).hypot(noise / count) / 3.0_f64.sqrt();
    let sound = u.is_finite() && mean > 0.0;
    sound.then(|| Stray {
        offset: 0.0,
        u,
        share: 0.0,
        u_share: u / mean,
        measured: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::profile::mean_radius;

    const WHITE: ReducedMedium = ReducedMedium {
        sigma_a: 0.0,
        sigma_s_prime: 11.6,
        eta: 1.3,
    };

    /// The glow of a beam of some width, brighter than its model by a tenth, on an offset.
    fn white(offset: f64) -> RadialProfile {
        let dipole = Dipole::new(&WHITE, DiffuseFresnel::Exact);
        let points = (0..100)
            .map(|k| {
                let (inner, outer) = (0.2 * f64::from(k), 0.2 * f64::from(k + 1));
                let radius_mm = mean_radius(inner, outer);
                let glow = dipole.diffuse_reflectance(radius_mm.hypot(0.3));
                ProfilePoint {
                    ring_mm: Some((inner, outer)),
                    radius_mm,
                    reflectance_per_mm2: 1.1 * glow + offset,
                    u_reflectance_per_mm2: 1e-3 * glow + 1e-8,
                    pixels: Some(100),
                }
            })
            .collect();
        RadialProfile {
            channel: "Y".to_owned(),
            points,
        }
    }

    #[test]
    fn an_offset_is_told_from_the_glow() {
        for offset in [0.0, 5e-6] {
            // The white's coefficients need not be right, nor known.
            let other = ReducedMedium {
                sigma_s_prime: 25.0,
                ..WHITE
            };
            for medium in [Some(&WHITE), Some(&other), None] {
                let found = stray_light(&white(offset), medium, 6e-4 + offset).unwrap();
                assert!(found.measured && found.u < 1e-7, "{found:?}");
                // The data have no noise: what is off is the glow's form, and far below u.
                assert!(
                    (found.offset - offset).abs() < 0.3 * found.u,
                    "{offset}: {found:?}"
                );
                assert!((found.share - offset / 6e-4).abs() < 1e-4, "{found:?}");
            }
        }
    }

    #[test]
    fn a_picture_that_ends_near_the_spot_gives_a_bound() {
        for offset in [0.0, 1e-4] {
            let mut near = white(offset);
            near.points.truncate(12);
            for medium in [Some(&WHITE), None] {
                let found = stray_light(&near, medium, 0.1).unwrap();
                assert!(!found.measured && found.offset == 0.0, "{found:?}");
                // What the last rings hold at 2 mm.
                let last = near.points[11].reflectance_per_mm2;
                assert!(found.u > offset / 3.0 && found.u < last, "{found:?}");
            }
            let known = stray_light(&near, Some(&WHITE), 0.1).unwrap();
            let unknown = stray_light(&near, None, 0.1).unwrap();
            assert!(known.u < unknown.u, "{known:?} {unknown:?}");
        }
    }

    #[test]
    fn a_white_that_absorbs_more_than_is_known_is_not_called_stray_light() {
        let dark = ReducedMedium {
            sigma_a: 5e-4,
            ..WHITE
        };
        let dipole = Dipole::new(&dark, DiffuseFresnel::Exact);
        let mut profile = white(0.0);
        for p in &mut profile.points {
            p.reflectance_per_mm2 = dipole.diffuse_reflectance(p.radius_mm.hypot(0.3));
        }
        let found = stray_light(&profile, Some(&WHITE), 6e-4).unwrap();
        assert!(!found.measured && found.offset == 0.0, "{found:?}");
    }
}

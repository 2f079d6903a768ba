//! Stray light: what lens and housing spread evenly over the picture.

use crate::white::White;
use gauss_quad::GaussHermite;
use nalgebra::{Matrix3, Vector3};
use physics::{DiffuseFresnel, Dipole, ProfilePoint, RadialProfile, ReducedMedium};
use std::f64::consts::{PI, SQRT_2};
use std::num::NonZeroUsize;

/// Radii at half of the peak, and share of the picture's radius, beyond which the spot itself is
/// out of sight and the white's glow has its far form.
const SPOTS: f64 = 8.0;
const OUTER: f64 = 1.0 / 3.0;

/// Passes in which the width of the beam that the glow shows settles.
const PASSES: usize = 4;

/// Nodes of the rule for a Gaussian along an axis: exact to the ninth power.
const NODES: NonZeroUsize = NonZeroUsize::new(5).expect("five is not zero");

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
    /// By how much offset and share change where σₐ and σₛ′ of the white are larger by their own
    /// standard uncertainty; `u` and `u_share` leave it out.
    pub by_white: [Shift; 2],
}

/// A change of stray light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shift {
    /// Of the offset.
    pub offset: f64,
    /// Of the share.
    pub share: f64,
}

impl Stray {
    /// Whether it is light: a white that absorbs more than is stated ends below 0.
    fn is_sound(&self) -> bool {
        self.offset > -BELOW * self.u
    }

    /// Standard uncertainty of the offset with what the white's coefficients leave open.
    fn u_all(&self) -> f64 {
        let [a, s] = self.by_white;
        self.u.hypot(a.offset).hypot(s.offset)
    }
}

/// Stray light in the picture of a white reference, whose profile is `white`: what is left in the
/// far field beside its own glow, or, where the picture ends too near to the spot, a bound.
///
/// Far from the beam a white that absorbs nothing glows as r⁻³ + c r⁻⁵ whatever its coefficients
/// and its beam are, and one whose coefficients are known as its dipole d(r) + c d(r)/r²; how
/// bright that is is found along with the offset. What a Gaussian beam makes of r⁻³ goes on:
/// 1 + c/r² + 1.39 c²/r⁴ + …, which at a beam of 1 mm is worth twice the noise, so that c gives the width of a
/// beam over which the form is averaged. An absorption that is stated too high makes the form end
/// too soon, and what is left of the glow looks like stray light, many times its noise: what each
/// coefficient may be off is found by another one. `mean` is the mean of all pixels of the picture,
/// in the unit of the profile. Of a picture without light nothing is found.
pub fn stray_light(profile: &RadialProfile, white: Option<&White>, mean: f64) -> Option<Stray> {
    let points = &profile.points;
    let dipole_of = |medium: &ReducedMedium| Dipole::new(medium, DiffuseFresnel::Exact);
    let dipole = white.map(|white| dipole_of(&white.medium));
    let bound = bounded(points, dipole.as_ref(), mean);
    let found = measured(points, &Glow::of(dipole.as_ref()), mean);
    let found = found.filter(Stray::is_sound).map(|found| Stray {
        by_white: white.map_or([Shift::default(); 2], |white| {
            let otherwise = |medium: &ReducedMedium| {
                let dipole = dipole_of(medium);
                measured(points, &Glow::of(Some(&dipole)), mean).unwrap_or(found)
            };
            white.sides().map(|sides| Shift {
                offset: sides.change(|medium| otherwise(medium).offset),
                share: sides.change(|medium| otherwise(medium).share),
            })
        }),
        ..found
    });
    match (found, bound) {
        (Some(found), Some(bound)) if found.u_all() > bound.u => Some(bound),
        (found, bound) => found.or(bound),
    }
}

/// The form of a glow.
struct Glow<'a> {
    /// That of a point, where the medium is known.
    dipole: Option<&'a Dipole>,
    /// Places, in standard deviations, and weights that a Gaussian is along an axis.
    gaussian: Vec<(f64, f64)>,
}

impl<'a> Glow<'a> {
    fn of(dipole: Option<&'a Dipole>) -> Self {
        let rule = GaussHermite::new(NODES);
        let pairs = rule.as_node_weight_pairs().iter();
        let gaussian = pairs.map(|(x, w)| (SQRT_2 * x, w / PI.sqrt())).collect();
        Self { dipole, gaussian }
    }

    /// It at `radius`, of a Gaussian beam of this variance along an axis, mm².
    fn at(&self, radius: f64, variance: f64) -> f64 {
        let of_point = |radius: f64| {
            let far = || radius.powi(-3);
            self.dipole
                .map_or_else(far, |d| d.diffuse_reflectance(radius))
        };
        if variance == 0.0 {
            return of_point(radius);
        }
        let deviation = variance.sqrt();
        let across = |(x, weight): &(f64, f64)| {
            let along = self.gaussian.iter().map(|(y, other)| {
                let from = (radius + deviation * x).hypot(deviation * y);
                weight * other * of_point(from)
            });
            along.sum::<f64>()
        };
        self.gaussian.iter().map(across).sum()
    }
}

/// The offset and the glow, as wide as the beam makes it, by weighted least squares.
fn measured(points: &[ProfilePoint], glow: &Glow, mean: f64) -> Option<Stray> {
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
    let mut variance = 0.0;
    let mut pass = far_field(&far, glow, start, variance)?;
    for _ in 1..PASSES {
        // A beam adds 9/2 of its variance over r², and no light is nearer than that of a point.
        let wider = 2.0 / 9.0 * start * start * pass.found[1] / pass.found[0];
        let most = (start / SPOTS).powi(2);
        variance = f64::clamp(variance + wider, 0.0, most);
        pass = far_field(&far, glow, start, variance)?;
    }
    let FarField {
        found,
        covariance,
        chi2,
    } = pass;
    let widened = (chi2 / (far.len() - 3) as f64).sqrt().max(1.0);
    let offset = found[2];
    let u = widened * covariance[(2, 2)].sqrt();
    let direct = mean - offset;
    (u.is_finite() && direct > 0.0).then(|| Stray {
        offset,
        u,
        share: offset / direct,
        u_share: u / direct,
        measured: true,
        by_white: [Shift::default(); 2],
    })
}

/// The glow, what comes on top of it as r⁻², and the offset, as the far field has them.
struct FarField {
    found: Vector3<f64>,
    covariance: Matrix3<f64>,
    chi2: f64,
}

fn far_field(far: &[&ProfilePoint], glow: &Glow, start: f64, variance: f64) -> Option<FarField> {
    let unit = glow.at(start, variance);
    let terms = |p: &ProfilePoint| {
        let near = glow.at(p.radius_mm, variance) / unit;
        let ratio = start / p.radius_mm;
        Vector3::new(near, near * ratio * ratio, 1.0)
    };
    let rows: Vec<_> = far.iter().map(|p| terms(p)).collect();
    let (mut normal, mut side) = (Matrix3::zeros(), Vector3::zeros());
    for (p, row) in far.iter().zip(&rows) {
        let weight = p.u_reflectance_per_mm2.powi(-2);
        normal += weight * row * row.transpose();
        side += weight * p.reflectance_per_mm2 * row;
    }
    let covariance = normal.try_inverse()?;
    let found = covariance * side;
    let deviations = far.iter().zip(&rows).map(|(p, row)| {
        let off = p.reflectance_per_mm2 - row.dot(&found);
        (off / p.u_reflectance_per_mm2).powi(2)
    });
    Some(FarField {
        found,
        covariance,
        chi2: deviations.sum(),
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
        by_white: [Shift::default(); 2],
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
            for medium in [Some(WHITE), Some(other), None] {
                let medium = medium.map(White::exact);
                let found = stray_light(&white(offset), medium.as_ref(), 6e-4 + offset).unwrap();
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
    fn a_wide_beam_is_no_stray_light() {
        // A beam of 1 mm, convolved in polar coordinates, at the noise of a good capture: with c alone the
        // offset is half of its u off.
        let dipole = Dipole::new(&WHITE, DiffuseFresnel::Exact);
        let sigma = 1.0 / 2.354_820_045;
        let beamed = |radius: f64| {
            let (mut sum, mut all) = (0.0, 0.0);
            for i in 0..60 {
                let from = (f64::from(i) + 0.5) * 0.1 * sigma;
                let weight = from * (-0.5 * (from / sigma).powi(2)).exp();
                for k in 0..48 {
                    let angle = std::f64::consts::TAU * (f64::from(k) + 0.5) / 48.0;
                    let (x, y) = (radius + from * angle.cos(), from * angle.sin());
                    sum += weight * dipole.diffuse_reflectance(x.hypot(y));
                    all += weight;
                }
            }
            sum / all
        };
        for offset in [0.0, 2e-8] {
            let mut profile = white(0.0);
            for p in &mut profile.points {
                let light = beamed(p.radius_mm);
                p.reflectance_per_mm2 = light + offset;
                let electrons = 5e10 * p.area_mm2() * light;
                p.u_reflectance_per_mm2 = light / electrons.sqrt();
            }
            let found = stray_light(&profile, Some(&White::exact(WHITE)), 6e-4).unwrap();
            let off = (found.offset - offset) / found.u;
            assert!(found.measured && off.abs() < 0.1, "{off}: {found:?}");
        }
    }

    #[test]
    fn a_picture_that_ends_near_the_spot_gives_a_bound() {
        for offset in [0.0, 1e-4] {
            let mut near = white(offset);
            near.points.truncate(12);
            for medium in [Some(White::exact(WHITE)), None] {
                let found = stray_light(&near, medium.as_ref(), 0.1).unwrap();
                assert!(!found.measured && found.offset == 0.0, "{found:?}");
                // What the last rings hold at 2 mm.
                let last = near.points[11].reflectance_per_mm2;
                assert!(found.u > offset / 3.0 && found.u < last, "{found:?}");
            }
            let known = stray_light(&near, Some(&White::exact(WHITE)), 0.1).unwrap();
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
        let found = stray_light(&profile, Some(&White::exact(WHITE)), 6e-4).unwrap();
        assert!(!found.measured && found.offset == 0.0, "{found:?}");
    }
}

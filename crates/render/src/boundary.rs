//! A smooth dielectric surface met by a ray.

use crate::Vec3;
use physics::fresnel;

/// What becomes of a ray at a smooth surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parting {
    /// Share that is reflected.
    pub reflectance: f64,
    /// Direction of what is reflected.
    pub reflected: Vec3,
    /// Direction of what goes through; without meaning under total reflection.
    pub refracted: Vec3,
}

/// A ray meets a surface; `normal` is on either side, `eta_ti` the far index over the near one.
#[inline]
pub fn part(direction: Vec3, normal: Vec3, eta_ti: f64) -> Parting {
    let along = direction.dot(normal);
    let cos = along.abs().min(1.0);
    let reflected = direction - 2.0 * along * normal;
    let Some(cos_t) = fresnel::refracted_cos(eta_ti, cos) else {
        return Parting {
            reflectance: 1.0,
            reflected,
            refracted: direction,
        };
    };
    // What is along the surface shrinks by Snell's law, what is across is known from the cosine.
    let across = direction - along * normal;
    let refracted = across / eta_ti + normal * cos_t.copysign(along);
    Parting {
        reflectance: fresnel::reflectance(eta_ti, cos),
        reflected,
        refracted: refracted.normalize(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn snell_holds_and_the_way_back_is_the_way_there() {
        let normal = Vec3::new(0.2, -0.3, 1.0).normalize();
        for direction in [Vec3::NEG_Z, Vec3::new(1.0, 0.3, -0.4).normalize()] {
            let there = part(direction, normal, 1.5);
            let sine = |d: Vec3| d.cross(normal).length();
            assert!((sine(direction) - 1.5 * sine(there.refracted)).abs() < 1e-14);
            let back = part(-there.refracted, normal, 1.0 / 1.5);
            assert!((back.refracted + direction).length() < 1e-14);
            assert!((back.reflectance - there.reflectance).abs() < 1e-14);
            assert!((there.reflected.dot(normal) + direction.dot(normal)).abs() < 1e-14);
        }
        let grazing = Vec3::new(1.0, 0.0, 0.2).normalize();
        assert_eq!(part(grazing, Vec3::Z, 1.0 / 1.5).reflectance, 1.0);
    }
}

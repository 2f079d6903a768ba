//! Lights.

use crate::Vec3;
use physics::random::{Stream, uniform};
use std::f64::consts::{LN_2, PI, TAU};

/// How the power of a beam is spread over its cross-section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spot {
    /// Evenly over a disk of this radius, mm; 0 is a ray.
    Disk(f64),
    /// A Gaussian of this standard deviation along each axis, mm.
    Gaussian(f64),
}

/// Where light comes from; its power in each channel stands beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// A beam of parallel rays; the strength is its power, W.
    Beam {
        /// A point of its axis, in front of everything.
        from: Vec3,
        /// Unit direction.
        direction: Vec3,
        /// Its cross-section.
        spot: Spot,
    },
    /// Parallel light everywhere; the strength is the irradiance across it, W mm⁻².
    Distant {
        /// Unit direction in which the light goes.
        direction: Vec3,
        /// Angular radius of its source, radians; 0 is a point, which no path from the camera
        /// finds behind a curved surface.
        radius: f64,
    },
    /// A point; the strength is its power, W.
    Point {
        /// Where it is.
        at: Vec3,
    },
    /// An even parallelogram, lit on the side of `u` × `v`; the strength is its radiance,
    /// W mm⁻² sr⁻¹.
    Area {
        /// A corner.
        corner: Vec3,
        /// One side.
        u: Vec3,
        /// The other side.
        v: Vec3,
    },
    /// The same radiance from everywhere; the strength is the radiance, W mm⁻² sr⁻¹.
    Sky,
}

/// A direction and two across it.
pub(crate) fn frame(normal: Vec3) -> (Vec3, Vec3) {
    normal.any_orthonormal_pair()
}

/// A unit vector, even over the sphere.
pub(crate) fn on_sphere(rng: &mut Stream) -> Vec3 {
    let z = 2.0 * uniform(rng) - 1.0;
    let (sin, cos) = (TAU * uniform(rng)).sin_cos();
    let r = (1.0 - z * z).sqrt();
    Vec3::new(r * cos, r * sin, z)
}

/// A direction about `normal`, with a density proportional to its cosine.
pub(crate) fn cosine(normal: Vec3, rng: &mut Stream) -> Vec3 {
    let (u, v) = frame(normal);
    let square = uniform(rng);
    let (sin, cos) = (TAU * uniform(rng)).sin_cos();
    let r = square.sqrt();
    (r * cos * u + r * sin * v + (1.0 - square).sqrt() * normal).normalize()
}

/// A ball around all that can be lit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reach {
    pub(crate) center: Vec3,
    pub(crate) radius: f64,
}

/// A ray of light and the power that it stands for, of each unit of strength.
pub(crate) struct Emitted {
    pub(crate) origin: Vec3,
    pub(crate) direction: Vec3,
    pub(crate) power: f64,
}

impl Light {
    /// Whether a path from the camera can meet it.
    pub fn can_be_met(&self) -> bool {
        match self {
            Self::Sky | Self::Area { .. } => true,
            Self::Distant { radius, .. } => *radius > 0.0,
            Self::Beam { .. } | Self::Point { .. } => false,
        }
    }

    /// Whether it lights a spot so small that draws of surface points would miss it.
    pub(crate) fn is_beam(&self) -> bool {
        self.spot().is_some()
    }

    /// The cross-section of a beam.
    pub(crate) fn spot(&self) -> Option<Spot> {
        match *self {
            Self::Beam { spot, .. } => Some(spot),
            _ => None,
        }
    }

    /// A ray toward what lies within `reach`.
    pub(crate) fn emit(&self, reach: Reach, rng: &mut Stream) -> Emitted {
        match *self {
            Self::Beam {
                from,
                direction,
                spot,
            } => {
                let (u, v) = frame(direction);
                let (sin, cos) = (TAU * uniform(rng)).sin_cos();
                let r = match spot {
                    Spot::Disk(radius) => radius * uniform(rng).sqrt(),
                    Spot::Gaussian(sigma) => sigma * (-2.0 * (1.0 - uniform(rng)).ln()).sqrt(),
                };
                Emitted {
                    origin: from + r * (cos * u + sin * v),
                    direction,
                    power: 1.0,
                }
            }
            Self::Distant { direction, radius } => {
                let (u, v) = frame(direction);
                let (sin, cos) = (TAU * uniform(rng)).sin_cos();
                let r = reach.radius * uniform(rng).sqrt();
                let aside = r * (cos * u + sin * v);
                let tilted = if radius > 0.0 {
                    cone(direction, radius.cos(), rng)
                } else {
                    direction
                };
                // Across the ray, so that the irradiance is that across the light.
                let (u, v) = if radius > 0.0 { frame(tilted) } else { (u, v) };
                let aside = if radius > 0.0 {
                    r * (cos * u + sin * v)
                } else {
                    aside
                };
                Emitted {
                    origin: reach.center + aside - 2.0 * reach.radius * tilted,
                    direction: tilted,
                    power: PI * reach.radius * reach.radius,
                }
            }
            Self::Point { at } => {
                let toward = reach.center - at;
                let distance = toward.length();
                let cos = if distance > reach.radius {
                    (1.0 - (reach.radius / distance).powi(2)).sqrt()
                } else {
                    -1.0
                };
                Emitted {
                    origin: at,
                    direction: cone(toward.normalize_or(Vec3::Z), cos, rng),
                    power: 0.5 * (1.0 - cos),
                }
            }
            Self::Area { corner, u, v } => {
                let origin = corner + uniform(rng) * u + uniform(rng) * v;
                let across = u.cross(v);
                let (area, normal) = (across.length(), across.normalize());
                // Toward the ball, or all around where the lamp is within it.
                let toward = reach.center - origin;
                let distance = toward.length();
                if distance > reach.radius {
                    let cos = (1.0 - (reach.radius / distance).powi(2)).sqrt();
                    let direction = cone(toward / distance, cos, rng);
                    let along = direction.dot(normal).max(0.0);
                    Emitted {
                        origin,
                        direction,
                        power: area * along * TAU * (1.0 - cos),
                    }
                } else {
                    Emitted {
                        origin,
                        direction: cosine(normal, rng),
                        power: area * PI,
                    }
                }
            }
            Self::Sky => {
                // A chord of the ball: an even radiance crosses every disk through its centre.
                let direction = on_sphere(rng);
                let (u, v) = frame(direction);
                let (sin, cos) = (TAU * uniform(rng)).sin_cos();
                let r = reach.radius * uniform(rng).sqrt();
                Emitted {
                    origin: reach.center + r * (cos * u + sin * v) - 2.0 * reach.radius * direction,
                    direction,
                    power: 4.0 * PI * PI * reach.radius * reach.radius,
                }
            }
        }
    }

    /// Distance at which a ray from the camera meets the lamp, and the radiance for each unit of
    /// strength that it finds there.
    pub(crate) fn meet(&self, origin: Vec3, direction: Vec3) -> Option<(f64, f64)> {
        match *self {
            Self::Sky => Some((f64::INFINITY, 1.0)),
            Self::Distant {
                direction: down,
                radius,
            } if radius > 0.0 => {
                // Irradiance over ∫ cos dω of the disk.
                let radiance = 1.0 / (PI * radius.sin().powi(2));
                (-direction.dot(down) > radius.cos()).then_some((f64::INFINITY, radiance))
            }
            Self::Area { corner, u, v } => {
                let normal = u.cross(v);
                let along = direction.dot(normal);
                if along >= 0.0 {
                    return None;
                }
                let distance = (corner - origin).dot(normal) / along;
                if distance <= 0.0 {
                    return None;
                }
                let at = origin + distance * direction - corner;
                let square = normal.length_squared();
                let a = at.cross(v).dot(normal) / square;
                let b = u.cross(at).dot(normal) / square;
                let within = (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b);
                within.then_some((distance, 1.0))
            }
            Self::Distant { .. } | Self::Beam { .. } | Self::Point { .. } => None,
        }
    }
}

/// A direction within a cone about `axis`, even over its solid angle.
pub(crate) fn cone(axis: Vec3, cos_half: f64, rng: &mut Stream) -> Vec3 {
    let (u, v) = frame(axis);
    let z = 1.0 - uniform(rng) * (1.0 - cos_half);
    let (sin, cos) = (TAU * uniform(rng)).sin_cos();
    let r = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
    (r * cos * u + r * sin * v + z * axis).normalize()
}

/// Light that a lamp sends to a point.
pub(crate) struct Incident {
    /// Direction to the lamp.
    pub(crate) toward: Vec3,
    /// How far away it is, mm.
    pub(crate) distance: f64,
    /// Irradiance across the direction for each unit of strength, over the density with which
    /// the direction was drawn.
    pub(crate) irradiance: f64,
}

impl Light {
    /// Light from this lamp at a point, if nothing is in the way; at a surface, of outward normal
    /// `normal`, the directions of an even sky are drawn by their cosine.
    pub(crate) fn shine(
        &self,
        point: Vec3,
        normal: Option<Vec3>,
        rng: &mut Stream,
    ) -> Option<Incident> {
        match *self {
            Self::Beam {
                from,
                direction,
                spot,
            } => {
                let offset = point - from;
                let along = offset.dot(direction);
                let across = (offset - along * direction).length_squared();
                let density = spot.density(across);
                (along > 0.0 && density > 0.0).then_some(Incident {
                    toward: -direction,
                    distance: along,
                    irradiance: density,
                })
            }
            Self::Distant { direction, radius } => Some(Incident {
                toward: if radius > 0.0 {
                    cone(-direction, radius.cos(), rng)
                } else {
                    -direction
                },
                distance: f64::INFINITY,
                irradiance: 1.0,
            }),
            Self::Point { at } => {
                let toward = at - point;
                let distance = toward.length();
                Some(Incident {
                    toward: toward / distance,
                    distance,
                    irradiance: 1.0 / (4.0 * PI * distance * distance),
                })
            }
            Self::Area { corner, u, v } => {
                let toward = corner + uniform(rng) * u + uniform(rng) * v - point;
                let distance = toward.length();
                let toward = toward / distance;
                // Area times cosine.
                let seen = -u.cross(v).dot(toward);
                (seen > 0.0).then_some(Incident {
                    toward,
                    distance,
                    irradiance: seen / (distance * distance),
                })
            }
            Self::Sky => {
                let (toward, irradiance) = match normal {
                    Some(normal) => {
                        let toward = cosine(normal, rng);
                        (toward, PI / toward.dot(normal).max(f64::MIN_POSITIVE))
                    }
                    None => (on_sphere(rng), 4.0 * PI),
                };
                Some(Incident {
                    toward,
                    distance: f64::INFINITY,
                    irradiance,
                })
            }
        }
    }
}

impl Spot {
    /// Irradiance for each unit of power at the square of a distance from the axis, mm⁻².
    pub(crate) fn density(&self, square: f64) -> f64 {
        match *self {
            Self::Disk(radius) if square <= radius * radius && radius > 0.0 => {
                1.0 / (PI * radius * radius)
            }
            Self::Disk(_) => 0.0,
            Self::Gaussian(sigma) => {
                let variance = sigma * sigma;
                (-0.5 * square / variance).exp() / (TAU * variance)
            }
        }
    }

    /// The Gaussian of a full width at half maximum, mm: 2 √(2 ln 2) standard deviations.
    pub fn gaussian(fwhm_mm: f64) -> Self {
        Self::Gaussian(fwhm_mm / (8.0 * LN_2).sqrt())
    }

    /// Distance from the axis within which the beam has all its light, but for 1e-8 of it.
    pub(crate) fn extent(&self) -> f64 {
        match *self {
            Self::Disk(radius) => radius,
            Self::Gaussian(sigma) => 6.0 * sigma,
        }
    }
}

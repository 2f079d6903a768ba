//! Closed shapes: where a ray enters one, and where it leaves it.
//!
//! A ray outside meets only surface that faces it, a ray inside only surface that looks away: so
//! none needs an offset to get away from the surface it starts on.

mod block;
mod grid;
mod half_space;
mod mesh;
mod sphere;

pub use block::Block;
pub use half_space::HalfSpace;
#[cfg(test)]
pub(crate) use mesh::tests::ball as mesh_ball;
pub use mesh::{Mesh, MeshError, MeshWarning};
pub use sphere::Sphere;

use crate::Vec3;
use std::f64::consts::{PI, TAU};

/// A ray met a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Length of the way to it, mm.
    pub distance: f64,
    /// Unit normal of the true surface, out of the solid.
    pub normal: Vec3,
    /// Which face of a block, or which triangle of a mesh.
    pub face: usize,
}

/// A flat face of a solid, through which a camera can be seen by Snell's law alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// A point of it.
    pub point: Vec3,
    /// Unit normal out of the solid.
    pub normal: Vec3,
}

/// What a walk asks of the solid around it.
pub trait Solid: Sync {
    /// A lower bound of the distance from an inner point to the surface, mm; 0 is always right.
    /// Minus infinity for a point that got out through a hole.
    fn clearance(&self, point: Vec3) -> f64;

    /// Where a ray from inside leaves, if it does `within` a length.
    fn leave(&self, origin: Vec3, direction: Vec3, within: f64) -> Option<Hit>;

    /// Where a ray from outside enters.
    fn enter(&self, origin: Vec3, direction: Vec3) -> Option<Hit>;
}

/// Any shape.
#[derive(Debug)]
pub enum Shape {
    /// All that lies below a plane.
    HalfSpace(HalfSpace),
    /// A box along the axes.
    Block(Block),
    /// A ball.
    Sphere(Sphere),
    /// What triangles enclose.
    Mesh(Box<Mesh>),
}

impl Shape {
    /// The shape behind the name.
    pub(crate) fn solid(&self) -> &dyn Solid {
        match self {
            Self::HalfSpace(s) => s,
            Self::Block(s) => s,
            Self::Sphere(s) => s,
            Self::Mesh(s) => s.as_ref(),
        }
    }

    /// Where a ray from outside enters.
    pub fn enter(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.solid().enter(origin, direction)
    }

    /// Where a ray from inside leaves.
    pub fn leave(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.solid().leave(origin, direction, f64::INFINITY)
    }

    /// Whether a point lies inside.
    pub fn contains(&self, point: Vec3) -> bool {
        match self {
            Self::HalfSpace(s) => (point - s.point).dot(s.normal) < 0.0,
            Self::Block(s) => s.clearance(point) > 0.0,
            Self::Sphere(s) => s.clearance(point) > 0.0,
            Self::Mesh(s) => s.contains(point),
        }
    }

    /// Names of the faces that are told apart.
    pub fn face_names(&self) -> &'static [&'static str] {
        match self {
            Self::HalfSpace(_) => &["top"],
            Self::Block(_) => &["-x", "+x", "-y", "+y", "-z", "+z"],
            Self::Sphere(_) | Self::Mesh(_) => &["all"],
        }
    }

    /// Under which of [`Self::face_names`] light that met `hit` is counted.
    pub fn counted_face(&self, hit: &Hit) -> usize {
        match self {
            Self::Block(_) => hit.face,
            _ => 0,
        }
    }

    /// The faces, if all of them are flat and a camera can be seen through them.
    pub fn flat_faces(&self) -> Option<Vec<Face>> {
        match self {
            Self::HalfSpace(s) => Some(vec![Face {
                point: s.point,
                normal: s.normal,
            }]),
            Self::Block(s) => Some(s.faces().to_vec()),
            Self::Sphere(_) | Self::Mesh(_) => None,
        }
    }

    /// Corners of a box around it, or `None` if it has no end.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        match self {
            Self::HalfSpace(_) => None,
            Self::Block(s) => Some((s.min, s.max)),
            Self::Sphere(s) => {
                let r = Vec3::splat(s.radius);
                Some((s.center - r, s.center + r))
            }
            Self::Mesh(s) => Some(s.bounds()),
        }
    }

    /// The normal that shading uses: a mesh interpolates its own where it has some.
    pub fn shading_normal(&self, point: Vec3, hit: &Hit) -> Vec3 {
        match self {
            Self::Mesh(s) => s.shading_normal(point, hit),
            _ => hit.normal,
        }
    }

    /// Texture coordinates of a point of the surface, to the right and up as seen from outside: of a
    /// mesh its own, where it has some; of a ball longitude about z and latitude, each from 0 to 1;
    /// of a plane and of the faces of a block mm, from its point and its lowest corner.
    ///
    /// Up is +z as far as it lies in the face, and +y in a face that looks along z.
    pub fn texture_coordinates(&self, point: Vec3, hit: &Hit) -> Option<[f64; 2]> {
        let flat = |origin: Vec3| {
            let right = Vec3::Z.cross(hit.normal).try_normalize();
            let right = right.unwrap_or(Vec3::Y.cross(hit.normal));
            let up = hit.normal.cross(right);
            let offset = point - origin;
            [offset.dot(right), offset.dot(up)]
        };
        match self {
            Self::HalfSpace(s) => Some(flat(s.point)),
            Self::Block(s) => Some(flat(s.min)),
            Self::Sphere(_) => {
                let Vec3 { x, y, z } = hit.normal;
                Some([
                    y.atan2(x).rem_euclid(TAU) / TAU,
                    0.5 + z.clamp(-1.0, 1.0).asin() / PI,
                ])
            }
            Self::Mesh(s) => s.texture_coordinates(point, hit),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::random::{stream, uniform};

    fn shapes() -> Vec<Shape> {
        vec![
            Shape::Block(Block {
                min: Vec3::new(-1.0, -2.0, -3.0),
                max: Vec3::new(1.0, 0.5, 4.0),
            }),
            Shape::Sphere(Sphere {
                center: Vec3::new(0.3, 0.2, 0.1),
                radius: 1.7,
            }),
            Shape::Mesh(Box::new(mesh::tests::ball(3, 1.3))),
        ]
    }

    /// A ray from inside leaves where the ray back enters, and no step within the clearance does.
    #[test]
    fn the_way_out_is_the_way_in() {
        for shape in shapes() {
            let mut rng = stream(1, &[]);
            for _ in 0..2000 {
                let mut next = || 2.0 * uniform(&mut rng) - 1.0;
                let origin = 0.4 * Vec3::new(next(), next(), next());
                let direction = Vec3::new(next(), next(), next()).normalize();
                let out = shape.leave(origin, direction).expect("inside");
                assert!(out.normal.dot(direction) > 0.0);
                let clear = shape.solid().clearance(origin);
                assert!(clear <= out.distance, "{clear} {out:?}");
                let far = origin + 20.0 * direction;
                let back = shape.enter(far, -direction).expect("outside");
                let gap = out.distance + back.distance - 20.0;
                assert!(gap.abs() < 1e-9, "{shape:?}: {gap}");
                assert!(shape.contains(origin) && !shape.contains(far));
                assert!(shape.enter(far, direction).is_none());
            }
        }
    }
}

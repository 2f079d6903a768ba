//! Solids that share space, which no method can show: between solids there is air.

use crate::Vec3;
use crate::shape::{Block, MeshWarning, Shape, Sphere};
use std::f64::consts::PI;

/// How two solids share space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shared {
    /// The first is inside the second.
    Inside,
    /// Around this point.
    Around(Vec3),
}

/// Share of the size of a solid by which its surface may be inside another: what touches does not
/// overlap, and meshes of single precision are not where they should be.
const TOUCHING: f64 = 1e-5;
/// Steps along the edges of a block, and points on a ball, that are looked at.
const STEPS: usize = 24;
const ON_BALL: usize = 2000;
/// Most triangles of a mesh that are.
const TRIANGLES: usize = 20_000;

/// Whether the surface of `a` is inside `b`, if `b` is closed. Blocks, balls and planes are told
/// exactly; of meshes many points are looked at.
pub(crate) fn shared(a: &Shape, b: &Shape) -> Option<Shared> {
    let (low, high) = a.bounds()?;
    let size = (high - low).length();
    let (other_low, other_high) = b.bounds().unwrap_or((Vec3::NEG_INFINITY, Vec3::INFINITY));
    if low.cmpgt(other_high).any() || high.cmplt(other_low).any() {
        return None;
    }
    let wanted = match b {
        Shape::Mesh(mesh) => {
            let torn =
                |w: &MeshWarning| matches!(w, MeshWarning::Open(_) | MeshWarning::Disordered(_));
            if mesh.warnings().iter().any(torn) {
                // It has no inside, and there is a warning already.
                return None;
            }
            // A ray may slip through an edge once.
            2
        }
        _ => 1,
    };
    let mut points = vec![];
    match a {
        Shape::HalfSpace(_) => return None,
        Shape::Sphere(ball) => of_ball(ball, b, &mut points),
        Shape::Block(block) => of_block(block, b, &mut points),
        Shape::Mesh(mesh) => {
            for face in (0..mesh.len()).step_by(mesh.len().div_ceil(TRIANGLES)) {
                let [a, b, c] = mesh.corners(face);
                let normal = (b - a).cross(c - a).normalize_or_zero();
                let middle = (a + b + c) / 3.0;
                let all = [a, b, c].map(|corner| corner + 1e-3 * (middle - corner));
                points.extend(all.map(|point| (point, normal)));
                points.push((middle, normal));
            }
        }
    }
    let count = points.len();
    let inside = |(at, normal): (Vec3, Vec3)| {
        let at = at - TOUCHING * size * normal;
        b.contains(at).then_some(at)
    };
    let found: Vec<Vec3> = points.into_iter().filter_map(inside).collect();
    if found.len() < wanted {
        None
    } else if found.len() == count {
        Some(Shared::Inside)
    } else {
        Some(Shared::Around(found[0]))
    }
}

/// Points of a ball with their normals: first the one that is deepest in `b`, if `b` is simple.
fn of_ball(ball: &Sphere, b: &Shape, points: &mut Vec<(Vec3, Vec3)>) {
    let toward = match b {
        Shape::HalfSpace(plane) => ball.center - plane.normal,
        Shape::Sphere(other) => other.center,
        Shape::Block(block) => ball.center.clamp(block.min, block.max),
        Shape::Mesh(_) => ball.center,
    };
    let mut add = |normal: Vec3| points.push((ball.center + ball.radius * normal, normal));
    if let Some(normal) = (toward - ball.center).try_normalize() {
        add(normal);
    }
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    for k in 0..ON_BALL {
        let z = 1.0 - (2.0 * k as f64 + 1.0) / ON_BALL as f64;
        let (sin, cos) = (golden * k as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        add(Vec3::new(r * cos, r * sin, z));
    }
}

/// Points of the faces of a block, whose "normals" look away from its middle: so that those of
/// edges and corners move inward, too.
fn of_block(block: &Block, b: &Shape, points: &mut Vec<(Vec3, Vec3)>) {
    let middle = 0.5 * (block.min + block.max);
    match b {
        // What is nearest to its center is deepest in it.
        Shape::Sphere(ball) => {
            let nearest = ball.center.clamp(block.min, block.max);
            points.push((nearest, (nearest - middle).normalize_or_zero()));
        }
        Shape::Block(other) => {
            // All that both have is a block again.
            let (low, high) = (block.min.max(other.min), block.max.min(other.max));
            let size = (block.max - block.min).length();
            if (high - low).min_element() > TOUCHING * size {
                points.push((0.5 * (low + high), Vec3::ZERO));
            }
        }
        _ => {}
    }
    let mut add = |at: Vec3| points.push((at, (at - middle).normalize()));
    for axis in 0..3 {
        for (i, j) in (0..=STEPS).flat_map(|i| (0..=STEPS).map(move |j| (i, j))) {
            let mut share = Vec3::ZERO;
            share[(axis + 1) % 3] = i as f64 / STEPS as f64;
            share[(axis + 2) % 3] = j as f64 / STEPS as f64;
            for side in [0.0, 1.0] {
                share[axis] = side;
                add(block.min + share * (block.max - block.min));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::HalfSpace;

    fn block(min: [f64; 3], max: [f64; 3]) -> Shape {
        let [min, max] = [min, max].map(Vec3::from_array);
        Shape::Block(Block { min, max })
    }

    fn ball(center: [f64; 3], radius: f64) -> Shape {
        Shape::Sphere(Sphere {
            center: Vec3::from_array(center),
            radius,
        })
    }

    /// About the origin.
    fn mesh_ball(radius: f64) -> Shape {
        Shape::Mesh(Box::new(crate::shape::mesh_ball(2, radius)))
    }

    /// Either way round, as a scene asks.
    fn either(a: &Shape, b: &Shape) -> Option<Shared> {
        shared(a, b).or_else(|| shared(b, a))
    }

    #[test]
    fn what_touches_shares_nothing_and_what_overlaps_a_little_does() {
        let board_below = |z: f64| block([-5.0, -5.0, -3.0], [5.0, 5.0, z]);
        let board = || board_below(0.0);
        let plane_at = |z: f64| {
            Shape::HalfSpace(HalfSpace {
                point: z * Vec3::Z,
                normal: Vec3::Z,
            })
        };
        let plane = || plane_at(0.0);
        let mesh = mesh_ball(1.0);
        // Beside and upon each other.
        let apart = [
            (&ball([0.3, 0.2, 1.0], 1.0), &board()),
            (&ball([0.3, 0.2, 1.0], 1.0), &plane()),
            (&block([0.0; 3], [1.0; 3]), &board()),
            (
                &block([0.0; 3], [1.0; 3]),
                &block([1.0, 0.0, 0.0], [2.0, 1.0, 1.0]),
            ),
            (&ball([0.0; 3], 1.0), &ball([2.0, 0.0, 0.0], 1.0)),
            (&mesh, &board_below(-1.0)),
            (&mesh, &plane_at(-1.0)),
            // Boxes around them overlap.
            (
                &ball([0.0; 3], 1.0),
                &block([0.9, 0.9, -1.0], [2.0, 2.0, 1.0]),
            ),
            (&mesh, &ball([1.5, 1.5, 0.0], 1.0)),
        ];
        for (a, b) in apart {
            assert_eq!(either(a, b), None, "{a:?} {b:?}");
        }
        let overlapping = [
            (&ball([0.3, 0.2, 0.999], 1.0), &board()),
            (&ball([0.3, 0.2, 0.999], 1.0), &plane()),
            (&block([0.0, 0.0, -0.001], [1.0; 3]), &board()),
            (&ball([0.0; 3], 1.0), &ball([1.999, 0.0, 0.0], 1.0)),
            (
                &ball([0.0; 3], 1.0),
                &block([0.7, 0.7, -1.0], [2.0, 2.0, 1.0]),
            ),
            // A cross, none of whose corners is inside.
            (
                &block([-3.0, -1.0, -0.9], [3.0, 1.0, -0.1]),
                &block([-1.0, -3.0, -0.8], [1.0, 3.0, -0.2]),
            ),
            (&mesh, &board_below(-0.98)),
            (&mesh, &plane_at(-0.99)),
            (&mesh, &ball([1.3, 1.3, 0.0], 1.0)),
        ];
        for (a, b) in overlapping {
            let found = either(a, b);
            assert!(
                matches!(found, Some(Shared::Around(_))),
                "{a:?} {b:?}: {found:?}"
            );
        }
    }

    #[test]
    fn what_is_inside_is_told_apart() {
        let shell = ball([0.0; 3], 3.0);
        for core in [
            ball([0.5, 0.0, 0.0], 1.0),
            block([-1.0; 3], [1.0; 3]),
            mesh_ball(1.0),
        ] {
            assert_eq!(shared(&core, &shell), Some(Shared::Inside), "{core:?}");
            assert_eq!(shared(&shell, &core), None);
        }
        let inner = block([-1.0; 3], [1.0; 3]);
        let outer = block([-2.0; 3], [2.0; 3]);
        assert_eq!(shared(&inner, &outer), Some(Shared::Inside));
        let [inner, outer] = [1.0, 3.0].map(mesh_ball);
        assert_eq!(shared(&inner, &outer), Some(Shared::Inside));
        assert_eq!(shared(&outer, &inner), None);
    }
}

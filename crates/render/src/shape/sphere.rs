use super::{Hit, Solid};
use crate::Vec3;

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its centre.
    pub center: Vec3,
    /// Its radius, mm.
    pub radius: f64,
}

impl Sphere {
    fn hit(&self, origin: Vec3, direction: Vec3, distance: f64) -> Hit {
        Hit {
            distance: distance.max(0.0),
            normal: (origin + distance * direction - self.center).normalize(),
            face: 0,
        }
    }

    /// Minus half the sum of the roots, and the square of half their difference.
    fn roots(&self, origin: Vec3, direction: Vec3) -> (f64, f64) {
        let from_center = origin - self.center;
        let along = from_center.dot(direction);
        // The offset across the ray keeps its digits where the ball is far away.
        let across = from_center - along * direction;
        (along, self.radius * self.radius - across.length_squared())
    }
}

impl Solid for Sphere {
    #[inline]
    fn clearance(&self, point: Vec3) -> f64 {
        self.radius - (point - self.center).length()
    }

    #[inline]
    fn leave(&self, origin: Vec3, direction: Vec3, within: f64) -> Option<Hit> {
        let (along, square) = self.roots(origin, direction);
        let distance = square.max(0.0).sqrt() - along;
        (distance <= within).then(|| self.hit(origin, direction, distance))
    }

    fn enter(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        let (along, square) = self.roots(origin, direction);
        let distance = -along - square.max(0.0).sqrt();
        let ahead = along < 0.0 && square > 0.0 && distance > -1e-9 * self.radius;
        ahead.then(|| self.hit(origin, direction, distance))
    }
}

use super::{Hit, Solid};
use crate::Vec3;

/// All that lies below a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// A point of the plane.
    pub point: Vec3,
    /// Unit normal out of the solid.
    pub normal: Vec3,
}

impl HalfSpace {
    fn meet(&self, origin: Vec3, direction: Vec3) -> Hit {
        let distance = (self.point - origin).dot(self.normal) / direction.dot(self.normal);
        Hit {
            distance: distance.max(0.0),
            normal: self.normal,
            face: 0,
        }
    }
}

impl Solid for HalfSpace {
    #[inline]
    fn clearance(&self, point: Vec3) -> f64 {
        (self.point - point).dot(self.normal)
    }

    #[inline]
    fn leave(&self, origin: Vec3, direction: Vec3, within: f64) -> Option<Hit> {
        let out = direction.dot(self.normal) > 0.0;
        out.then(|| self.meet(origin, direction))
            .filter(|hit| hit.distance <= within)
    }

    fn enter(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        (direction.dot(self.normal) < 0.0).then(|| self.meet(origin, direction))
    }
}

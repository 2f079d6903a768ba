use super::{Face, Hit, Solid};
use crate::Vec3;

/// A box along the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Corner of the smallest coordinates.
    pub min: Vec3,
    /// Corner of the largest.
    pub max: Vec3,
}

/// The axis of a face, and whether it is that of the larger coordinate.
pub(crate) fn axis_of(face: usize) -> (usize, bool) {
    (face / 2, face % 2 == 1)
}

impl Block {
    /// The faces: -x, +x, -y, +y, -z, +z.
    pub fn faces(&self) -> [Face; 6] {
        std::array::from_fn(|face| {
            let (_, upper) = axis_of(face);
            Face {
                point: if upper { self.max } else { self.min },
                normal: normal(face),
            }
        })
    }
}

fn normal(face: usize) -> Vec3 {
    let (axis, upper) = axis_of(face);
    Vec3::AXES[axis] * if upper { 1.0 } else { -1.0 }
}

impl Solid for Block {
    #[inline]
    fn clearance(&self, point: Vec3) -> f64 {
        (point - self.min).min(self.max - point).min_element()
    }

    #[inline]
    fn leave(&self, origin: Vec3, direction: Vec3, within: f64) -> Option<Hit> {
        let mut found = (f64::INFINITY, 0);
        for axis in 0..3 {
            let d = direction[axis];
            if d != 0.0 {
                let upper = d > 0.0;
                let wall = if upper {
                    self.max[axis]
                } else {
                    self.min[axis]
                };
                let distance = (wall - origin[axis]) / d;
                if distance < found.0 {
                    found = (distance, 2 * axis + usize::from(upper));
                }
            }
        }
        (found.0 <= within).then(|| Hit {
            distance: found.0.max(0.0),
            normal: normal(found.1),
            face: found.1,
        })
    }

    fn enter(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        let (mut near, mut far) = ((f64::NEG_INFINITY, 0), f64::INFINITY);
        for axis in 0..3 {
            let (d, o) = (direction[axis], origin[axis]);
            let (low, high) = (self.min[axis], self.max[axis]);
            if d == 0.0 {
                if o <= low || o >= high {
                    return None;
                }
                continue;
            }
            let upper = d < 0.0;
            let (first, last) = if upper { (high, low) } else { (low, high) };
            let distance = (first - o) / d;
            if distance > near.0 {
                near = (distance, 2 * axis + usize::from(upper));
            }
            far = far.min((last - o) / d);
        }
        // A ray that starts on the surface it enters may have a distance of minus a rounding.
        let slack = -1e-9 * (self.max - self.min).length();
        (near.0 < far && near.0 > slack).then(|| Hit {
            distance: near.0.max(0.0),
            normal: normal(near.1),
            face: near.1,
        })
    }
}

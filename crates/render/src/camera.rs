//! Cameras, and how they are seen from inside a solid through a flat face.

use crate::Vec3;
use crate::shape::Face;
use physics::fresnel;

/// From where to where a camera looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where the camera stands.
    pub from: Vec3,
    /// What is in the middle of the picture.
    pub to: Vec3,
    /// What is up in the picture.
    pub up: Vec3,
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// How rays fall into the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// All through one point.
    Pinhole {
        /// Angle that the height of the picture spans, radians.
        field: f64,
    },
    /// All parallel.
    Orthographic {
        /// Length that the height of the picture spans, mm.
        height: f64,
    },
}

/// A camera: square pixels, evenly sensitive over their square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    view: View,
    lens: Lens,
    /// Along the line of sight, to the right, down the picture.
    ahead: Vec3,
    right: Vec3,
    down: Vec3,
    /// Side of a pixel: mm, or its part of the focal length.
    pixel: f64,
}

/// The way of light from a point inside a solid through a flat face into the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Connection {
    /// Pixel, counted along the rows.
    pub pixel: usize,
    /// Direction inside.
    pub inner: Vec3,
    /// Length of the way inside, mm.
    pub length: f64,
    /// Where it leaves the solid.
    pub exit: Vec3,
    /// Direction outside.
    pub outer: Vec3,
    /// Length outside, mm; infinite for parallel rays.
    pub outer_length: f64,
    /// Share that the face lets through.
    pub transmittance: f64,
    /// Radiance of the pixel for each unit of intensity at the point inside, mm⁻².
    pub radiance_per_intensity: f64,
}

impl Camera {
    /// A camera, or what is wrong with it.
    ///
    /// # Errors
    ///
    /// A sentence: no pixels, no line of sight, or a field that is none.
    pub fn new(view: View, lens: Lens) -> Result<Self, &'static str> {
        if view.width == 0 || view.height == 0 || view.width.saturating_mul(view.height) > 1 << 27 {
            return Err("expected a picture of at least 1 and at most 134 million pixels");
        }
        let ahead = (view.to - view.from)
            .try_normalize()
            .ok_or("expected `to` at another place than `from`")?;
        let right = ahead
            .cross(view.up)
            .try_normalize()
            .filter(|_| view.up.is_finite())
            .ok_or("expected `up` in another direction than the line of sight")?;
        let pixel = match lens {
            Lens::Pinhole { field } if field > 0.0 && field < std::f64::consts::PI => {
                2.0 * (0.5 * field).tan() / view.height as f64
            }
            Lens::Orthographic { height } if height > 0.0 && height.is_finite() => {
                height / view.height as f64
            }
            Lens::Pinhole { .. } => {
                return Err("expected a field of view between 0 and 180 degrees");
            }
            Lens::Orthographic { .. } => return Err("expected a height above 0 mm"),
        };
        Ok(Self {
            view,
            lens,
            ahead,
            right,
            down: ahead.cross(right),
            pixel,
        })
    }

    /// Pixels of a row and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.view.width, self.view.height]
    }

    /// Where the camera stands, if it stands anywhere.
    pub fn place(&self) -> Option<Vec3> {
        matches!(self.lens, Lens::Pinhole { .. }).then_some(self.view.from)
    }

    /// Side of a pixel of parallel rays, mm.
    pub fn mm_per_pixel(&self) -> Option<f64> {
        matches!(self.lens, Lens::Orthographic { .. }).then_some(self.pixel)
    }

    /// Origin and direction of the ray of a place in the picture, in pixels from its upper left.
    pub fn ray(&self, x: f64, y: f64) -> (Vec3, Vec3) {
        let across = (x - 0.5 * self.view.width as f64) * self.right
            + (y - 0.5 * self.view.height as f64) * self.down;
        match self.lens {
            Lens::Pinhole { .. } => {
                let direction = (self.ahead + self.pixel * across).normalize();
                (self.view.from, direction)
            }
            Lens::Orthographic { .. } => (self.view.from + self.pixel * across, self.ahead),
        }
    }

    /// Direction from anywhere to the camera, where all have the same.
    fn toward(&self) -> Option<Vec3> {
        matches!(self.lens, Lens::Orthographic { .. }).then_some(-self.ahead)
    }

    /// Where in the picture of parallel rays a point is, in pixels from its upper left.
    #[inline(always)]
    fn place_along_rays(&self, point: Vec3) -> [f64; 2] {
        let offset = point - self.view.from;
        self.shown(offset, 1.0 / self.pixel, offset.dot(self.ahead))
    }

    /// The same in that of a pinhole, and the cosine to the line of sight.
    #[inline(always)]
    fn place_through_pinhole(&self, point: Vec3) -> ([f64; 2], f64) {
        let offset = point - self.view.from;
        let depth = offset.dot(self.ahead);
        let place = self.shown(offset, 1.0 / (self.pixel * depth), depth);
        (place, depth / offset.length())
    }

    /// No numbers for what is behind the camera.
    #[inline(always)]
    fn shown(&self, offset: Vec3, scale: f64, depth: f64) -> [f64; 2] {
        let scale = if depth > 0.0 { scale } else { f64::NAN };
        let x = offset.dot(self.right) * scale + 0.5 * self.view.width as f64;
        let y = offset.dot(self.down) * scale + 0.5 * self.view.height as f64;
        [x, y]
    }

    /// The pixel at a place of the picture.
    #[inline]
    fn pixel_at(&self, place: [f64; 2]) -> Option<usize> {
        let (pixel, inside) = self.pixel_in_lanes(place);
        inside.then_some(pixel as usize)
    }

    /// The same, and whether there is one, without a branch.
    #[inline(always)]
    fn pixel_in_lanes(&self, [x, y]: [f64; 2]) -> (u32, bool) {
        let (width, height) = (self.view.width as f64, self.view.height as f64);
        let inside = (x >= 0.0) & (y >= 0.0) & (x < width) & (y < height);
        let pixel = (y as i32 as u32).wrapping_mul(self.view.width as u32);
        (pixel.wrapping_add(x as i32 as u32), inside)
    }

    /// What a face looks like to the camera from inside a medium of relative index `eta`; `None`
    /// if it turns its back on the camera.
    pub(crate) fn window(&self, face: Face, eta: f64) -> Option<Window> {
        let parallel = match self.toward() {
            Some(outer) => {
                let cos_out = outer.dot(face.normal);
                if cos_out <= 0.0 {
                    return None;
                }
                let cos_in = fresnel::refracted_cos(eta, cos_out)?;
                let along = outer - cos_out * face.normal;
                Some(Parallel {
                    outer,
                    inner: along / eta + cos_in * face.normal,
                    cos_in,
                    transmittance: fresnel::entry_factor(eta, cos_out),
                    // dω inside over dω outside: Snell's law squared.
                    radiance_per_intensity: cos_out
                        / (eta * eta * cos_in)
                        / (self.pixel * self.pixel),
                })
            }
            None => {
                if (self.view.from - face.point).dot(face.normal) <= 0.0 {
                    return None;
                }
                None
            }
        };
        Some(Window {
            camera: *self,
            face,
            eta,
            parallel,
        })
    }
}

/// A flat face between a medium and a camera.
#[derive(Clone, Copy)]
pub(crate) struct Window {
    camera: Camera,
    face: Face,
    eta: f64,
    /// What is the same for all points, where rays are parallel.
    parallel: Option<Parallel>,
}

#[derive(Clone, Copy, Default)]
pub(crate) struct Parallel {
    outer: Vec3,
    inner: Vec3,
    cos_in: f64,
    transmittance: f64,
    radiance_per_intensity: f64,
}

impl Window {
    /// Depth of a point below the face, mm.
    #[inline(always)]
    pub(crate) fn depth(&self, point: Vec3) -> f64 {
        (self.face.point - point).dot(self.face.normal)
    }

    /// Unit normal out of the solid.
    pub(crate) fn normal(&self) -> Vec3 {
        self.face.normal
    }

    /// The axis across which the face of a block lies.
    #[inline]
    pub(crate) fn axis(&self) -> usize {
        self.face.normal.abs().max_position()
    }

    /// Whether the face of a block is that of the larger coordinate.
    #[inline]
    pub(crate) fn faces_up(&self) -> bool {
        self.face.normal.element_sum() > 0.0
    }

    /// Direction inside toward the camera, where it is the same everywhere.
    pub(crate) fn inner(&self) -> Option<Vec3> {
        self.parallel.as_ref().map(|p| p.inner)
    }

    /// Length of the way inside from a depth, at least.
    #[inline]
    pub(crate) fn least_length(&self, depth: f64) -> f64 {
        self.parallel.as_ref().map_or(depth, |p| depth / p.cos_in)
    }

    /// The way from `point` at `depth` below the face to the camera, if a pixel sees it.
    #[inline]
    pub(crate) fn connect(&self, point: Vec3, depth: f64) -> Option<Connection> {
        let (way, place) = match &self.parallel {
            Some(parallel) => self.straight(parallel, point, depth),
            None => {
                let bend = self.bend(point, depth);
                let mut t = bend.start();
                for _ in 0..30 {
                    let step = bend.step(t);
                    t = (t - step).max(0.0);
                    if step.abs() <= 1e-13 * (1.0 + t) {
                        break;
                    }
                }
                self.bent(&bend, point, t)
            }
        };
        let pixel = self.camera.pixel_at(place)?;
        Some(Connection { pixel, ..way })
    }

    /// Of any way through the face, a part of a box, to the camera: how far it may go along each axis
    /// inside for each mm of its length, at most; nothing across the face.
    pub(crate) fn aside(&self, min: Vec3, max: Vec3) -> Vec3 {
        let mut aside = match &self.parallel {
            Some(parallel) => parallel.inner.abs(),
            None => {
                let camera = self.camera.view.from;
                let farthest = (camera - min).abs().max((camera - max).abs());
                let nearest = (camera - camera.clamp(min, max)).length();
                // Snell's law holds for each part along the face; no part is larger than the whole.
                (farthest / nearest / self.eta).min(Vec3::ONE)
            }
        };
        aside[self.axis()] = 0.0;
        aside
    }

    /// The pixel at a place of the picture, and whether there is one. Without a branch.
    #[inline(always)]
    pub(crate) fn pixel_in_lanes(&self, place: [f64; 2]) -> (u32, bool) {
        self.camera.pixel_in_lanes(place)
    }

    /// What is the same for all points, where rays are parallel.
    pub(crate) fn parallel(&self) -> Option<Parallel> {
        self.parallel
    }

    /// The way through the camera's point, by a fixed number of steps and without a branch: with it
    /// the place in the picture, and the last step in the tangent outside.
    #[inline(always)]
    pub(crate) fn bent_in_steps<const STEPS: usize>(
        &self,
        point: Vec3,
        depth: f64,
    ) -> (Connection, [f64; 2], f64) {
        let bend = self.bend(point, depth);
        let mut t = bend.start();
        let mut step = 0.0;
        for _ in 0..STEPS {
            step = bend.step(t);
            t = (t - step).max(0.0);
        }
        let (way, place) = self.bent(&bend, point, t);
        (way, place, step.abs())
    }

    /// The way along parallel rays, and the place in the picture.
    #[inline(always)]
    pub(crate) fn straight(&self, p: &Parallel, point: Vec3, depth: f64) -> (Connection, [f64; 2]) {
        let length = depth / p.cos_in;
        let exit = point + length * p.inner;
        let way = Connection {
            pixel: 0,
            inner: p.inner,
            length,
            exit,
            outer: p.outer,
            outer_length: f64::INFINITY,
            transmittance: p.transmittance,
            radiance_per_intensity: p.radiance_per_intensity,
        };
        (way, self.camera.place_along_rays(exit))
    }

    #[inline(always)]
    fn bend(&self, point: Vec3, depth: f64) -> Bend {
        let normal = self.face.normal;
        let offset = self.camera.view.from - point;
        let across = offset - offset.dot(normal) * normal;
        let distance = across.length();
        Bend {
            eta: self.eta,
            depth,
            height: (self.camera.view.from - self.face.point).dot(normal),
            distance,
            aside: across * if distance > 0.0 { 1.0 / distance } else { 0.0 },
        }
    }

    /// The way that leaves at the angle whose tangent is `t`.
    #[inline(always)]
    fn bent(&self, bend: &Bend, point: Vec3, t: f64) -> (Connection, [f64; 2]) {
        let &Bend {
            eta,
            depth,
            height,
            aside,
            ..
        } = bend;
        let normal = self.face.normal;
        let s = bend.inner_tan(t);
        let (cos_in, cos_out) = (1.0 / (1.0 + s * s).sqrt(), 1.0 / (1.0 + t * t).sqrt());
        let exit = point + depth * (normal + s * aside);
        let (place, cos) = self.camera.place_through_pinhole(exit);
        // A cone of dω inside covers this area across the ray at the camera.
        let meridian =
            depth / (cos_in * cos_in) + height / (cos_out * cos_out) * eta * cos_in / cos_out;
        let sagittal = depth / cos_in + height * eta / cos_out;
        let area = cos_out * meridian * sagittal;
        // And a pixel sees this solid angle.
        let solid_angle = self.camera.pixel * self.camera.pixel * (cos * cos * cos);
        let way = Connection {
            pixel: 0,
            inner: cos_in * (normal + s * aside),
            length: depth / cos_in,
            exit,
            outer: cos_out * (normal + t * aside),
            outer_length: height / cos_out,
            transmittance: 1.0 - fresnel::reflectance_between(eta, cos_out, cos_in),
            radiance_per_intensity: 1.0 / (area * solid_angle),
        };
        (way, place)
    }
}

/// Snell's law along a way from a point inside to the camera: depth tan θᵢ + height tan θₒ =
/// distance. In t = tan θₒ the left side grows and bends downward, so that Newton's method never
/// overshoots.
struct Bend {
    eta: f64,
    /// Of the point below the face, of the camera above it, and between the two along it, mm.
    depth: f64,
    height: f64,
    distance: f64,
    /// Direction along the face.
    aside: Vec3,
}

impl Bend {
    /// Where to begin: right near the normal.
    #[inline(always)]
    fn start(&self) -> f64 {
        let t = self.distance / (self.height + self.depth / self.eta);
        if self.eta < 1.0 {
            // Inside there is no total reflection then; t is limited instead.
            t.min(0.999_999 * self.eta / (1.0 - self.eta * self.eta).sqrt())
        } else {
            t
        }
    }

    #[inline(always)]
    fn inner_tan(&self, t: f64) -> f64 {
        t / (self.eta * self.eta + (self.eta * self.eta - 1.0) * t * t).sqrt()
    }

    /// By how much `t` is to be made smaller.
    #[inline(always)]
    fn step(&self, t: f64) -> f64 {
        let square = self.eta * self.eta + (self.eta * self.eta - 1.0) * t * t;
        let value = self.depth * self.inner_tan(t) + self.height * t - self.distance;
        let slope = self.depth * self.eta * self.eta / (square * square.sqrt()) + self.height;
        value / slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view() -> View {
        View {
            from: Vec3::new(3.0, -2.0, 50.0),
            to: Vec3::new(0.5, 0.0, 0.0),
            up: Vec3::Y,
            width: 40,
            height: 30,
        }
    }

    const TOP: Face = Face {
        point: Vec3::ZERO,
        normal: Vec3::Z,
    };

    /// Rays of a pixel, refracted into the solid down to a plane, give pixel and direction back,
    /// and the area that they cover there gives the weight.
    #[test]
    fn a_connection_finds_its_pixel_and_its_weight() {
        for lens in [
            Lens::Pinhole { field: 0.4 },
            Lens::Orthographic { height: 20.0 },
        ] {
            for eta in [1.0, 1.5, 0.8] {
                let camera = Camera::new(view(), lens).unwrap();
                let window = camera.window(TOP, eta).unwrap();
                let depth = 4.0;
                let down = |x: f64, y: f64| {
                    let (origin, direction) = camera.ray(x, y);
                    let surface = origin - origin.z / direction.z * direction;
                    let inside = crate::boundary::part(direction, Vec3::Z, eta).refracted;
                    (surface + depth / inside.z.abs() * inside, inside)
                };
                for (x, y) in [(3.3, 4.7), (20.5, 15.5), (36.0, 28.1)] {
                    let (point, inside) = down(x, y);
                    let found = window.connect(point, depth).unwrap();
                    assert!((found.inner + inside).length() < 1e-9, "{lens:?} {eta}");
                    assert_eq!(found.pixel, y as usize * 40 + x as usize);
                    // Area of a small square of the picture down there.
                    let h = 1e-3;
                    let (u, _) = down(x + h, y);
                    let (v, _) = down(x, y + h);
                    let area = (u - point).cross(v - point).length() / (h * h);
                    let across = area * found.inner.z;
                    let expected = match lens {
                        // Parallel rays: dω_in over the pixel's area, and by Snell's law
                        // η² cos_in dω_in = cos_out dω_out; a ray keeps its place in the picture.
                        Lens::Orthographic { .. } => {
                            let pixel = camera.pixel * camera.pixel;
                            found.outer.z / (eta * eta * found.inner.z * pixel)
                        }
                        Lens::Pinhole { .. } => {
                            // Intensity J at the point gives J dω_in/dA at the camera; radiance
                            // is that over the pixel's solid angle. Reciprocity of étendue,
                            // dω_out dA_cam = η² dω_in dA_point, gives dω_in/dA_cam.
                            1.0 / (eta * eta * across)
                        }
                    };
                    let ratio = found.radiance_per_intensity / expected;
                    assert!((ratio - 1.0).abs() < 2e-3, "{lens:?} {eta}: {ratio}");
                }
            }
        }
    }

    #[test]
    fn rays_and_pixels_agree() {
        let camera = Camera::new(view(), Lens::Pinhole { field: 0.4 }).unwrap();
        let (origin, direction) = camera.ray(12.5, 7.5);
        let (place, _) = camera.place_through_pinhole(origin + 9.0 * direction);
        assert_eq!(camera.pixel_at(place), Some(7 * 40 + 12));
        let (behind, _) = camera.place_through_pinhole(origin - 9.0 * direction);
        assert_eq!(camera.pixel_at(behind), None);
        // Up in space is up in the picture.
        let (_, high) = camera.ray(20.0, 0.0);
        let (_, low) = camera.ray(20.0, 30.0);
        assert!(high.y > low.y);
    }
}

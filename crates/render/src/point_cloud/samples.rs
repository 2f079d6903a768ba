//! Points over the surface of a solid, evenly or where there is more to find.

use crate::Vec3;
use crate::scene::Scene;
use crate::shape::{Hit, Shape};
use crate::surface::{Point, Weighted, area, in_triangle};
use physics::random::{Stream, uniform};
use std::f64::consts::{PI, TAU};

/// The surface of a solid, ready to be covered with points.
pub(crate) enum Surface {
    /// Triangles with the faces they belong to, one beside the other along a curve that fills
    /// space, how dense points are on each, and how many, on that scale, up to its end.
    Triangles {
        triangles: Vec<([Vec3; 3], usize)>,
        density: Vec<f64>,
        below: Vec<f64>,
    },
    /// A ball.
    Ball { center: Vec3, radius: f64 },
}

impl Surface {
    /// That of a shape; none of one without an end.
    pub(crate) fn new(shape: &Shape) -> Option<Self> {
        let mut triangles: Vec<([Vec3; 3], usize)> = match shape {
            Shape::HalfSpace(_) => return None,
            Shape::Sphere(ball) => {
                return Some(Self::Ball {
                    center: ball.center,
                    radius: ball.radius,
                });
            }
            Shape::Mesh(mesh) => (0..mesh.len()).map(|k| (mesh.corners(k), k)).collect(),
            Shape::Block(block) => {
                let (low, high) = (block.min, block.max);
                let halves = |face: usize| {
                    let (axis, upper) = (face / 2, face % 2 == 1);
                    let corner = |u: bool, v: bool| {
                        let mut at = low;
                        at[axis] = if upper { high[axis] } else { low[axis] };
                        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
                        at[a] = if u { high[a] } else { low[a] };
                        at[b] = if v { high[b] } else { low[b] };
                        at
                    };
                    let [a, b, c, d] = [
                        corner(false, false),
                        corner(true, false),
                        corner(true, true),
                        corner(false, true),
                    ];
                    // Counter-clockwise from outside.
                    let [b, d] = if upper { [b, d] } else { [d, b] };
                    [([a, b, c], face), ([a, c, d], face)]
                };
                (0..6).flat_map(halves).collect()
            }
        };
        if matches!(shape, Shape::Mesh(_)) {
            let middle = |t: &[Vec3; 3]| (t[0] + t[1] + t[2]) / 3.0;
            let (low, high) = shape.bounds()?;
            triangles.sort_by_cached_key(|(t, _)| morton(middle(t), low, high));
        }
        Some(Self::of(triangles, |_| 1.0))
    }

    fn of(triangles: Vec<([Vec3; 3], usize)>, density: impl Fn(usize) -> f64) -> Self {
        let density: Vec<f64> = (0..triangles.len()).map(density).collect();
        let mut sum = 0.0;
        let each = triangles.iter().zip(&density);
        let below = each.map(|((corners, _), density)| {
            sum += density * area(*corners);
            sum
        });
        Self::Triangles {
            below: below.collect(),
            triangles,
            density,
        }
    }

    /// The same with points where the lamps shine; on a ball evenly still.
    pub(crate) fn by_light(self, scene: &Scene, object: usize) -> Self {
        match self {
            Self::Ball { .. } => self,
            Self::Triangles { triangles, .. } => {
                let lit = Weighted::by_light(scene, object, triangles.len(), |k| triangles[k]);
                Self::of(triangles, |k| lit.density(k))
            }
        }
    }

    /// mm².
    pub(crate) fn area(&self) -> f64 {
        match self {
            Self::Triangles { triangles, .. } => triangles.iter().map(|(t, _)| area(*t)).sum(),
            Self::Ball { radius, .. } => 4.0 * PI * radius * radius,
        }
    }

    /// The largest area that one of `count` points stands for, mm².
    pub(crate) fn largest(&self, count: usize) -> f64 {
        let sparsest = match self {
            Self::Ball { .. } => 1.0 / self.area(),
            Self::Triangles { density, below, .. } => {
                let all = below.last().copied().unwrap_or(0.0);
                density.iter().copied().fold(f64::INFINITY, f64::min) / all
            }
        };
        1.0 / (count as f64 * sparsest)
    }

    /// `count` points with the area that each stands for, mm²: at even steps along a curve that
    /// fills the surface, so that they are nowhere denser and nowhere sparser than they should be.
    /// Where the steps begin is drawn: a place is as likely as it is dense.
    pub(crate) fn points(
        &self,
        scene: &Scene,
        object: usize,
        count: usize,
        rng: &mut Stream,
    ) -> Vec<(Point, f64)> {
        match self {
            Self::Ball { center, radius } => {
                // A spiral of equal areas, turned at random.
                let golden = PI * (3.0 - 5.0_f64.sqrt());
                let axis = crate::light::on_sphere(rng);
                let (u, v) = axis.any_orthonormal_pair();
                let (start, shift) = (TAU * uniform(rng), uniform(rng));
                let area = self.area() / count as f64;
                (0..count)
                    .map(|k| {
                        let z = 1.0 - 2.0 * (k as f64 + shift) / count as f64;
                        let (sin, cos) = (start + golden * k as f64).sin_cos();
                        let r = (1.0 - z * z).max(0.0).sqrt();
                        let normal = (r * cos * u + r * sin * v + z * axis).normalize();
                        let hit = Hit {
                            distance: 0.0,
                            normal,
                            face: 0,
                        };
                        let at = *center + *radius * normal;
                        (Point::new(scene, object, at, &hit), area)
                    })
                    .collect()
            }
            Self::Triangles {
                triangles,
                density,
                below,
            } => {
                let each = below.last().copied().unwrap_or(0.0) / count as f64;
                let mut here = 0;
                let shift = uniform(rng);
                (0..count)
                    .map(|k| {
                        let along = (k as f64 + shift) * each;
                        while here + 1 < below.len() && below[here] <= along {
                            here += 1;
                        }
                        let (corners, face) = triangles[here];
                        let before = if here > 0 { below[here - 1] } else { 0.0 };
                        let own = below[here] - before;
                        let share = ((along - before) / own).clamp(0.0, 1.0);
                        let at = inside(corners, share, own / each, rng);
                        let point = Point::on_triangle(scene, object, face, corners, at);
                        (point, each / density[here])
                    })
                    .collect()
            }
        }
    }
}

/// The point of a triangle, which holds so many `pieces`, at a share of its area along Sierpiński's
/// curve; within a small part of a piece it is drawn.
fn inside(corners: [Vec3; 3], mut share: f64, mut pieces: f64, rng: &mut Stream) -> Vec3 {
    let [a, b, c] = corners;
    let squares = [(c - b), (a - c), (b - a)].map(Vec3::length_squared);
    // The middle corner is opposite the longest side.
    let longest = (0..3).fold(
        0,
        |best, k| if squares[k] > squares[best] { k } else { best },
    );
    let [mut a, mut b, mut c] = match longest {
        0 => [b, a, c],
        1 => [c, b, a],
        _ => [a, c, b],
    };
    while pieces > 0.02 {
        let middle = 0.5 * (a + c);
        share *= 2.0;
        [a, b, c] = if share < 1.0 {
            [a, middle, b]
        } else {
            share -= 1.0;
            [b, middle, c]
        };
        pieces *= 0.5;
    }
    in_triangle([a, b, c], rng)
}

/// Place along a curve that fills a box.
pub(super) fn morton(at: Vec3, low: Vec3, high: Vec3) -> u64 {
    const STEPS: f64 = (1_u64 << 21) as f64;
    let size = (high - low).max_element().max(f64::MIN_POSITIVE);
    let spread = |x: f64| {
        let index = (x * STEPS).clamp(0.0, STEPS - 1.0) as u64;
        // Every bit at the third place of the one before.
        let mut word = index;
        for (shift, mask) in [
            (32, 0x001f_0000_0000_ffff),
            (16, 0x001f_0000_ff00_00ff),
            (8, 0x100f_00f0_0f00_f00f),
            (4, 0x10c3_0c30_c30c_30c3),
            (2, 0x1249_2492_4924_9249),
        ] {
            word = (word | (word << shift)) & mask;
        }
        word
    };
    let [x, y, z] = ((at - low) / size).to_array().map(spread);
    x | (y << 1) | (z << 2)
}

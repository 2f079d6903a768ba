//! The glow averaged over each pixel.

use crate::glow::Glow;
use gauss_quad::GaussLegendre;
use rayon::prelude::*;
use std::num::NonZeroUsize;

/// Where the camera looks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    /// Pixels in a row.
    pub(crate) width: usize,
    /// Rows.
    pub(crate) height: usize,
    /// Side of a pixel, mm; its width where the optical axis meets the sample.
    pub(crate) mm_per_pixel: f64,
    /// Height of a pixel over its width.
    pub(crate) aspect: f64,
    /// A camera that is not above the sample.
    pub(crate) tilt: Option<Tilt>,
    /// The centre of the glow, the middle of the first pixel being (0, 0).
    pub(crate) spot_px: [f64; 2],
}

/// A pinhole camera that looks at the sample from the side of the first rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tilt {
    /// Between the optical axis and the normal, rad.
    pub(crate) angle: f64,
    /// From the pinhole to the sample along that axis, mm.
    pub(crate) distance_mm: f64,
}

impl View {
    /// Where the ray through a point of the picture meets the sample: mm right of and beyond the
    /// optical axis, and the area that is seen there over what is seen at the axis.
    pub(crate) fn place(&self, column: f64, row: f64) -> ([f64; 2], f64) {
        let side = self.mm_per_pixel;
        let across = (column - 0.5 * (self.width as f64 - 1.0)) * side;
        let down = (row - 0.5 * (self.height as f64 - 1.0)) * side * self.aspect;
        let Some(Tilt { angle, distance_mm }) = self.tilt else {
            return ([across, down], 1.0);
        };
        let (sin, cos) = angle.sin_cos();
        // The ray leaves the pinhole, at height d·cos and d·sin to the side, in this direction.
        let (right, below) = (across / distance_mm, down / distance_mm);
        let length = distance_mm * cos / (cos - below * sin);
        let place = [
            length * right,
            length * (below * cos + sin) - distance_mm * sin,
        ];
        (place, (length / distance_mm).powi(3))
    }

    fn is_straight(&self) -> bool {
        self.tilt.is_none() && self.aspect == 1.0
    }

    /// Distance from the centre to the farthest corner of the frame, mm.
    pub(crate) fn reach_mm(&self) -> f64 {
        let farthest = |size: usize, spot: f64| (spot + 0.5).max(size as f64 - 0.5 - spot);
        let [x, y] = self.spot_px;
        if !self.is_straight() {
            let spot = self.place(x, y).0;
            let (right, bottom) = (self.width as f64 - 0.5, self.height as f64 - 0.5);
            return [[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]]
                .into_iter()
                .map(|[x, y]| {
                    let corner = self.place(x, y).0;
                    (corner[0] - spot[0]).hypot(corner[1] - spot[1])
                })
                .fold(0.0, f64::max);
        }
        self.mm_per_pixel * farthest(self.width, x).hypot(farthest(self.height, y))
    }

    /// The mean of `glow` over every pixel, mm⁻², row by row.
    pub(crate) fn picture(&self, glow: &Glow) -> Vec<f32> {
        let rules = [square_rule(2), square_rule(4), square_rule(8)];
        let mut pixels = vec![0.0; self.width * self.height];
        pixels
            .par_chunks_mut(self.width)
            .enumerate()
            .for_each(|(row, pixels)| {
                let y = (row as f64 - self.spot_px[1]) * self.mm_per_pixel;
                if !self.is_straight() {
                    for (column, pixel) in pixels.iter_mut().enumerate() {
                        *pixel = self.slanted_pixel(glow, &rules, column as f64, row as f64) as f32;
                    }
                    return;
                }
                for (column, pixel) in pixels.iter_mut().enumerate() {
                    let x = (column as f64 - self.spot_px[0]) * self.mm_per_pixel;
                    *pixel = self.pixel(glow, &rules, x, y) as f32;
                }
            });
        pixels
    }

    /// The mean of `glow` over what a pixel sees of the sample, where that is no square: every node
    /// of the pixel's rule has a place and an area of its own.
    fn slanted_pixel(
        &self,
        glow: &Glow,
        rules: &[Vec<(f64, f64, f64)>; 3],
        column: f64,
        row: f64,
    ) -> f64 {
        let [column_0, row_0] = self.spot_px;
        let spot = self.place(column_0, row_0).0;
        let from_spot = |column: f64, row: f64| {
            let (place, area) = self.place(column, row);
            let (x, y) = (place[0] - spot[0], place[1] - spot[1]);
            (x * x + y * y, area)
        };
        let radius = from_spot(column, row).0.sqrt();
        // The longer side of what is seen, at most.
        let longest = self.tilt.map_or(1.0, |tilt| 1.5 / tilt.angle.cos());
        let side = self.mm_per_pixel * self.aspect.max(1.0) * longest;
        let nearest = glow.length_at((radius - 0.71 * side).max(0.0));
        let length = nearest.min(glow.length_at(radius));
        let rule = if length < 4.0 * side {
            &rules[2]
        } else {
            &rules[1]
        };
        let cuts = (side / length).ceil().clamp(1.0, 64.0) as usize;
        let part = 1.0 / cuts as f64;
        let offset = |cut: usize| (cut as f64 + 0.5) * part - 0.5;
        let (mut sum, mut all) = (0.0, 0.0);
        for cut in 0..cuts * cuts {
            let (across, down) = (column + offset(cut % cuts), row + offset(cut / cuts));
            for (u, v, w) in rule {
                let (square, area) = from_spot(across + part * u, down + part * v);
                sum += w * area * glow.at_square(square);
                all += w * area;
            }
        }
        sum / all
    }

    /// The mean of `glow` over the pixel whose middle lies at (`x`, `y`) mm from the centre.
    ///
    /// Far out two Gauss nodes along each axis leave h⁴/4320 of the fourth derivative. Nearer,
    /// more nodes are taken, and a pixel wider than what it sees is cut.
    fn pixel(&self, glow: &Glow, rules: &[Vec<(f64, f64, f64)>; 3], x: f64, y: f64) -> f64 {
        let side = self.mm_per_pixel;
        let radius = x.hypot(y);
        let nearest = glow.length_at((radius - 0.71 * side).max(0.0));
        let length = nearest.min(glow.length_at(radius));
        let rule = if length < 4.0 * side {
            &rules[2]
        } else if radius < glow.flank_mm() + 16.0 * side {
            &rules[1]
        } else {
            &rules[0]
        };
        let average = |x: f64, y: f64, side: f64| {
            rule.iter()
                .map(|(u, v, w)| {
                    let (x, y) = (x + side * u, y + side * v);
                    w * glow.at_square(x * x + y * y)
                })
                .sum::<f64>()
        };
        let cuts = (side / length).ceil().clamp(1.0, 64.0) as usize;
        if cuts == 1 {
            return average(x, y, side);
        }
        let part = side / cuts as f64;
        let offset = |cut: usize| (cut as f64 + 0.5) * part - 0.5 * side;
        let mut sum = 0.0;
        for row in 0..cuts {
            for column in 0..cuts {
                sum += average(x + offset(column), y + offset(row), part);
            }
        }
        sum / (cuts * cuts) as f64
    }
}

/// The Gauss rule with `count` nodes along each axis of the unit square about the origin.
fn square_rule(count: usize) -> Vec<(f64, f64, f64)> {
    let rule = GaussLegendre::new(NonZeroUsize::new(count.max(1)).expect("at least 1"));
    let pairs = rule.as_node_weight_pairs();
    pairs
        .iter()
        .flat_map(|(u, a)| {
            pairs
                .iter()
                .map(move |(v, b)| (0.5 * u, 0.5 * v, 0.25 * a * b))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::glow::tests::{KETCHUP, MARBLE, WHITE, glow, plain_gaussian};
    use physics::footprint::Beam;
    use physics::{DiffuseFresnel, Dipole, ReducedMedium};
    use std::f64::consts::PI;

    fn view(size: usize, mm_per_pixel: f64) -> View {
        let middle = 0.5 * (size as f64 - 1.0);
        View {
            width: size,
            height: size,
            mm_per_pixel,
            aspect: 1.0,
            tilt: None,
            spot_px: [middle + 0.3, middle - 0.2],
        }
    }

    /// Light of a pencil beam that leaves outside the frame: beyond the border in every direction.
    fn outside(medium: &ReducedMedium, view: &View) -> f64 {
        let dipole = Dipole::new(medium, DiffuseFresnel::Exact);
        let [x, y] = view.spot_px;
        let side = |from: f64, size: usize, cos: f64| {
            let distance = if cos > 0.0 {
                size as f64 - 0.5 - from
            } else {
                from + 0.5
            };
            distance / cos.abs().max(1e-300)
        };
        let steps = 40_000;
        (0..steps)
            .map(|step| {
                let phi = 2.0 * PI * (f64::from(step) + 0.5) / f64::from(steps);
                let border = side(x, view.width, phi.cos()).min(side(y, view.height, phi.sin()));
                dipole.beyond(border * view.mm_per_pixel)
            })
            .sum::<f64>()
            / f64::from(steps)
    }

    #[test]
    fn the_picture_holds_the_models_light() {
        for (medium, beam, size, mm, tolerance) in [
            (MARBLE, Beam::Point, 512, 0.04, 1e-6),
            (WHITE, Beam::Point, 512, 0.04, 1e-6),
            (KETCHUP, Beam::Point, 512, 0.04, 1e-6),
            // A pixel of three source depths, and one of twenty.
            (WHITE, Beam::Point, 256, 0.15, 1e-6),
            (WHITE, Beam::Point, 64, 1.0, 1e-5),
            (KETCHUP, Beam::Gaussian { fwhm_mm: 0.3 }, 512, 0.04, 2e-6),
            (KETCHUP, Beam::Gaussian { fwhm_mm: 0.02 }, 512, 0.04, 2e-6),
            (KETCHUP, Beam::Disk { fwhm_mm: 1.0 }, 512, 0.04, 4e-6),
            // The beam's variance of 0.016 mm² carries 3σ²/2r² of what lies outside, 1.2 %, across
            // the border at r = 10 mm: 3e-6.
            (WHITE, Beam::Gaussian { fwhm_mm: 0.3 }, 512, 0.04, 4e-6),
            (WHITE, Beam::Disk { fwhm_mm: 0.5 }, 512, 0.04, 4e-6),
        ] {
            let view = view(size, mm);
            let picture = view.picture(&glow(&medium, beam.clone(), view.reach_mm()));
            let sum: f64 = picture.iter().map(|v| f64::from(*v)).sum::<f64>() * mm * mm;
            let total = Dipole::new(&medium, DiffuseFresnel::Exact).total_reflectance();
            let expected = total - outside(&medium, &view);
            assert!(
                (sum / expected - 1.0).abs() < tolerance,
                "{medium:?}, {beam:?}, {mm} mm: {sum} for {expected}"
            );
        }
    }

    /// One pixel by direct evaluation on a fine grid of nodes: no table and no choice of rules.
    #[test]
    fn each_pixel_is_its_average() {
        let rule = square_rule(10);
        for medium in [MARBLE, WHITE, KETCHUP] {
            let view = view(401, 0.04);
            let fwhm_mm = 0.3;
            let gaussian =
                view.picture(&glow(&medium, Beam::Gaussian { fwhm_mm }, view.reach_mm()));
            let point = view.picture(&glow(&medium, Beam::Point, view.reach_mm()));
            let dipole = Dipole::new(&medium, DiffuseFresnel::Exact);
            for (column, row) in [
                (200, 200),
                (201, 198),
                (206, 203),
                (215, 211),
                (230, 170),
                (3, 390),
            ] {
                let mean = |f: &dyn Fn(f64) -> f64, cuts: usize| {
                    let mut sum = 0.0;
                    for cut in 0..cuts * cuts {
                        let shift = |i: usize| (i as f64 + 0.5) / cuts as f64 - 0.5;
                        let (dx, dy) = (shift(cut % cuts), shift(cut / cuts));
                        for (u, v, w) in &rule {
                            let part = cuts as f64;
                            let x = column as f64 - view.spot_px[0] + dx + u / part;
                            let y = row as f64 - view.spot_px[1] + dy + v / part;
                            sum += w * f(0.04 * x.hypot(y));
                        }
                    }
                    sum / (cuts * cuts) as f64
                };
                let pixel = row * view.width + column;
                for (got, expected, beam) in [
                    (
                        point[pixel],
                        mean(&|r| dipole.diffuse_reflectance(r), 8),
                        "point",
                    ),
                    (
                        gaussian[pixel],
                        mean(&|r| plain_gaussian(&medium, r, fwhm_mm), 1),
                        "0.3 mm",
                    ),
                ] {
                    let got = f64::from(got);
                    assert!(
                        (got / expected - 1.0).abs() < 5e-6,
                        "{medium:?}, {beam}, ({column}, {row}): {got} for {expected}"
                    );
                }
            }
        }
    }
}

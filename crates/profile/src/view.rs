//! Where on the sample each pixel looks.

use crate::error::ProfileError;

/// A projective map from pixels to millimetres on the surface of the sample.
///
/// A camera that looks along the normal sees squares of one size; one that is tilted, or whose
/// pixels are not square, sees quadrilaterals, each with an area of its own. What it measures at
/// each is still radiance, so that a total is the sum of value times area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// `(x, y, 1)` px to mm, up to the last component.
    matrix: [[f64; 3]; 3],
}

impl View {
    /// Square pixels of `mm_per_pixel`, seen along the normal.
    pub fn square(mm_per_pixel: f64) -> Self {
        Self::rectangular([mm_per_pixel; 2])
    }

    /// Pixels of this width and height on the sample, mm.
    pub fn rectangular(mm_per_pixel: [f64; 2]) -> Self {
        let [x, y] = mm_per_pixel;
        Self {
            matrix: [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, 1.0]],
        }
    }

    /// The view in which four points of the picture, px, are four points of the surface, mm, in
    /// the same order around their quadrilateral.
    ///
    /// # Errors
    ///
    /// [`ProfileError::Corners`] where either quadrilateral is not convex.
    ///
    /// # Source
    ///
    /// The map of the unit square to a quadrilateral after Heckbert, *Fundamentals of Texture
    /// Mapping and Image Warping* (1989), section 2.2.3, once forward and once back.
    pub fn corners(px: &[[f64; 2]; 4], mm: &[[f64; 2]; 4]) -> Result<Self, ProfileError> {
        for (what, quadrilateral) in [("px", px), ("mm", mm)] {
            if !is_convex(quadrilateral) {
                return Err(ProfileError::Corners(what));
            }
        }
        let matrix = product(&from_square(mm), &adjugate(&from_square(px)));
        Self::from_matrix(matrix)
    }

    /// The view whose nine numbers, row by row, [`Self::to_rows`] gave.
    ///
    /// # Errors
    ///
    /// [`ProfileError::View`] where they are no such map.
    pub fn from_rows(rows: [f64; 9]) -> Result<Self, ProfileError> {
        Self::from_matrix(std::array::from_fn(|i| {
            std::array::from_fn(|j| rows[3 * i + j])
        }))
    }

    fn from_matrix(mut matrix: [[f64; 3]; 3]) -> Result<Self, ProfileError> {
        let scale = matrix[2][2];
        for value in matrix.iter_mut().flatten() {
            *value /= scale;
        }
        let good = matrix.iter().flatten().all(|v| v.is_finite()) && determinant(&matrix) != 0.0;
        if good {
            Ok(Self { matrix })
        } else {
            Err(ProfileError::View)
        }
    }

    /// Whether lengths are above 0 and finite.
    pub(crate) fn check(&self) -> Result<(), ProfileError> {
        let [across, down, divisor] = self.matrix;
        let along_the_normal = divisor == [0.0, 0.0, 1.0] && across[1] == 0.0 && down[0] == 0.0;
        let sides = [across[0], down[1]];
        let positive = |x: f64| x > 0.0 && x.is_finite();
        if along_the_normal && let Some(bad) = sides.into_iter().find(|x| !positive(*x)) {
            return Err(ProfileError::MmPerPixel(bad));
        }
        Self::from_matrix(self.matrix).map(|_| ())
    }

    /// The nine numbers of the map, row by row: of X, Y and the common divisor.
    pub fn to_rows(&self) -> [f64; 9] {
        std::array::from_fn(|k| self.matrix[k / 3][k % 3])
    }

    /// Side of a pixel, mm, where all are equal squares.
    pub fn square_mm(&self) -> Option<f64> {
        let side = self.matrix[0][0];
        (*self == Self::square(side)).then_some(side)
    }

    fn homogeneous(&self, px: [f64; 2]) -> [f64; 3] {
        self.matrix
            .map(|row| row[0] * px[0] + row[1] * px[1] + row[2])
    }

    /// Where the point `px` of the picture lies on the surface, mm.
    pub fn at_mm(&self, px: [f64; 2]) -> [f64; 2] {
        let [x, y, w] = self.homogeneous(px);
        [x / w, y / w]
    }

    /// The point of the picture at which `mm` on the surface is seen, px.
    pub fn at_px(&self, mm: [f64; 2]) -> [f64; 2] {
        let back = adjugate(&self.matrix);
        let [x, y, w] = back.map(|row| row[0] * mm[0] + row[1] * mm[1] + row[2]);
        [x / w, y / w]
    }

    /// Whether the surface is in front of the camera at `px`, as it is at the origin.
    pub(crate) fn is_in_front(&self, px: [f64; 2]) -> bool {
        // The origin has 1.
        self.homogeneous(px)[2] > 1e-3
    }

    /// Derivatives of the place on the surface by column and by row, mm per px.
    fn jacobian(&self, px: [f64; 2]) -> [[f64; 2]; 2] {
        let [x, y, w] = self.homogeneous(px);
        let [across, down, divisor] = self.matrix;
        let of = |row: [f64; 3], value: f64, k: usize| (row[k] - value / w * divisor[k]) / w;
        [
            [of(across, x, 0), of(across, x, 1)],
            [of(down, y, 0), of(down, y, 1)],
        ]
    }

    /// Area on the surface that a pixel at `px` sees, mm².
    pub fn area_mm2(&self, px: [f64; 2]) -> f64 {
        // The determinant of the Jacobian of a projective map.
        let w = self.homogeneous(px)[2];
        (determinant(&self.matrix) / (w * w * w)).abs()
    }

    /// Root of that area: the length of a pixel there, mm.
    pub fn mm_per_pixel(&self, px: [f64; 2]) -> f64 {
        self.area_mm2(px).sqrt()
    }

    /// Side, mm, of the square whose second moment, averaged over directions, is that of a pixel
    /// at `px`: what blurs a radial profile there.
    pub fn blur_mm(&self, px: [f64; 2]) -> f64 {
        let squares: f64 = self.jacobian(px).iter().flatten().map(|d| d * d).sum();
        (0.5 * squares).sqrt()
    }

    /// Angle between the normal and the line of sight at `px`, rad, as it follows from how much
    /// shorter the surface looks one way than the other. True for a sensor with square pixels, and a
    /// point not far from the optical axis.
    pub fn tilt(&self, px: [f64; 2]) -> f64 {
        let [[a, b], [c, d]] = self.jacobian(px);
        let (sum, product) = (a * a + b * b + c * c + d * d, (a * d - b * c).abs());
        // Singular values s ≥ t with s² + t² and st known; the cosine is t/s.
        let split = ((sum + 2.0 * product) * (sum - 2.0 * product))
            .max(0.0)
            .sqrt();
        let cos = ((sum - split) / (2.0 * product)).min(1.0);
        cos.acos()
    }

    /// Relative standard uncertainty of the length of a pixel at `px` for corners that are known
    /// to `u_mm` in each coordinate.
    ///
    /// # Errors
    ///
    /// As [`Self::corners`].
    pub fn u_length_relative(
        corners_px: &[[f64; 2]; 4],
        corners_mm: &[[f64; 2]; 4],
        u_mm: f64,
        px: [f64; 2],
    ) -> Result<f64, ProfileError> {
        let side = (corners_mm[0][0] - corners_mm[2][0]).hypot(corners_mm[0][1] - corners_mm[2][1]);
        let step = 1e-5 * side;
        let mut square = 0.0;
        for k in 0..8 {
            let at = |sign: f64| {
                let mut moved = *corners_mm;
                moved[k / 2][k % 2] += sign * step;
                Self::corners(corners_px, &moved).map(|view| view.mm_per_pixel(px).ln())
            };
            let slope = (at(1.0)? - at(-1.0)?) / (2.0 * step);
            square += (slope * u_mm).powi(2);
        }
        Ok(square.sqrt())
    }

    /// Pixels about `center_px` on the surface, in units of `unit_mm`.
    pub(crate) fn about(&self, center_px: [f64; 2], unit_mm: f64) -> Places {
        let [x, y] = self.at_mm(center_px);
        let [across, down, divisor] = self.matrix;
        let less = |row: [f64; 3], origin: f64| {
            std::array::from_fn(|k| (row[k] - origin * divisor[k]) / unit_mm)
        };
        Places {
            matrix: [less(across, x), less(down, y), divisor],
            area: determinant(&self.matrix).abs() / (unit_mm * unit_mm),
        }
    }
}

/// A view about its spot, in units of its own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Places {
    matrix: [[f64; 3]; 3],
    area: f64,
}

impl Places {
    /// The pixel's place, and the area that it sees.
    pub(crate) fn at(&self, x: f64, y: f64) -> ([f64; 2], f64) {
        let [across, down, divisor] = &self.matrix;
        let w = 1.0 / (divisor[0] * x + divisor[1] * y + divisor[2]);
        let place = [across, down].map(|row| (row[0] * x + row[1] * y + row[2]) * w);
        (place, self.area * w * w * w)
    }
}

/// The map of the unit square, anticlockwise from the origin, to a quadrilateral.
fn from_square(p: &[[f64; 2]; 4]) -> [[f64; 3]; 3] {
    let [p0, p1, p2, p3] = p;
    let sum = [0, 1].map(|k| p0[k] - p1[k] + p2[k] - p3[k]);
    let (a, b) = ([0, 1].map(|k| p1[k] - p2[k]), [0, 1].map(|k| p3[k] - p2[k]));
    let cross = |u: [f64; 2], v: [f64; 2]| u[0] * v[1] - u[1] * v[0];
    let g = cross(sum, b) / cross(a, b);
    let h = cross(a, sum) / cross(a, b);
    let row = |k: usize| [p1[k] - p0[k] + g * p1[k], p3[k] - p0[k] + h * p3[k], p0[k]];
    [row(0), row(1), [g, h, 1.0]]
}

/// Whether the corners turn the same way all around.
fn is_convex(p: &[[f64; 2]; 4]) -> bool {
    let turn = |i: usize| {
        let (a, b, c) = (p[i], p[(i + 1) % 4], p[(i + 2) % 4]);
        let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
        (u[0] * v[1] - u[1] * v[0]) / (u[0].hypot(u[1]) * v[0].hypot(v[1]))
    };
    let turns = [turn(0), turn(1), turn(2), turn(3)];
    turns.iter().all(|t| *t > 1e-6) || turns.iter().all(|t| *t < -1e-6)
}

fn cofactor(m: &[[f64; 3]; 3], i: usize, j: usize) -> f64 {
    let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
    m[a][c] * m[b][d] - m[a][d] * m[b][c]
}

fn determinant(m: &[[f64; 3]; 3]) -> f64 {
    (0..3).map(|j| m[0][j] * cofactor(m, 0, j)).sum()
}

/// The inverse, up to a factor.
fn adjugate(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| cofactor(m, j, i)))
}

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PX: [[f64; 2]; 4] = [[112.0, 80.0], [905.0, 96.0], [870.0, 700.0], [140.0, 655.0]];
    const MM: [[f64; 2]; 4] = [[0.0, 0.0], [40.0, 0.0], [40.0, 30.0], [0.0, 30.0]];

    #[test]
    fn corners_go_to_corners_and_lines_to_lines() {
        let view = View::corners(&PX, &MM).unwrap();
        for (px, mm) in PX.iter().zip(&MM) {
            let [x, y] = view.at_mm(*px);
            assert!((x - mm[0]).hypot(y - mm[1]) < 1e-10, "{px:?}: {x}, {y}");
            let [column, row] = view.at_px(*mm);
            assert!(
                (column - px[0]).hypot(row - px[1]) < 1e-9,
                "{mm:?}: {column}, {row}"
            );
        }
        let at = |t: f64| {
            view.at_mm([
                PX[0][0] + t * (PX[2][0] - PX[0][0]),
                PX[0][1] + t * (PX[2][1] - PX[0][1]),
            ])
        };
        for t in [0.1, 0.5, 0.8] {
            let [x, y] = at(t);
            assert!((x * 30.0 - y * 40.0).abs() < 1e-9, "{x}, {y}");
        }
        assert_eq!(View::from_rows(view.to_rows()).unwrap(), view);
    }

    #[test]
    fn areas_are_those_of_small_quadrilaterals_and_add_up() {
        let view = View::corners(&PX, &MM).unwrap();
        let quadrilateral = |px: [f64; 2], h: f64| {
            let corner = |dx: f64, dy: f64| view.at_mm([px[0] + h * dx, px[1] + h * dy]);
            let p = [
                corner(-0.5, -0.5),
                corner(0.5, -0.5),
                corner(0.5, 0.5),
                corner(-0.5, 0.5),
            ];
            let shoelace: f64 = (0..4)
                .map(|i| {
                    let (a, b) = (p[i], p[(i + 1) % 4]);
                    a[0] * b[1] - a[1] * b[0]
                })
                .sum();
            0.5 * shoelace.abs() / (h * h)
        };
        for px in [[300.0, 200.0], [700.0, 600.0], [0.0, 0.0]] {
            let (got, expected) = (view.area_mm2(px), quadrilateral(px, 0.1));
            assert!(
                (got / expected - 1.0).abs() < 1e-6,
                "{px:?}: {got} {expected}"
            );
            let ([x, y], area) = view.about([300.0, 200.0], 0.05).at(px[0], px[1]);
            let (origin, here) = (view.at_mm([300.0, 200.0]), view.at_mm(px));
            assert!((x * 0.05 - (here[0] - origin[0])).abs() < 1e-9);
            assert!((y * 0.05 - (here[1] - origin[1])).abs() < 1e-9);
            assert!((area * 0.0025 / expected - 1.0).abs() < 1e-6);
        }
    }

    /// A pinhole camera at a distance, tilted about the horizontal: its corners tell the tilt.
    #[test]
    fn the_tilt_of_a_pinhole_camera_is_found() {
        for tilt in [0.0_f64, 0.3, 0.8] {
            let (sin, cos) = tilt.sin_cos();
            let seen = |mm: [f64; 2]| {
                // Along the optical axis, the far side of the surface is farther away.
                let (right, up, away) = (mm[0], mm[1] * cos, 400.0 + mm[1] * sin);
                [500.0 + 8000.0 * right / away, 400.0 - 8000.0 * up / away]
            };
            let mm = [[-15.0, -12.0], [15.0, -12.0], [15.0, 12.0], [-15.0, 12.0]];
            let view = View::corners(&mm.map(seen), &mm).unwrap();
            let found = view.tilt([500.0, 400.0]);
            assert!((found - tilt).abs() < 1e-7, "{tilt}: {found}");
            let expected = 0.05 / cos.sqrt();
            assert!((view.mm_per_pixel([500.0, 400.0]) / expected - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn uncertain_corners_make_an_uncertain_length() {
        // Of a square of side s, each corner off by u: the area is a sum over the four corners of
        // half a diagonal times u, so that its root is off by u/s, divided by 2.
        let px = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]];
        let mm = px.map(|p| [0.1 * p[0], 0.1 * p[1]]);
        let scale = |view: &View| view.mm_per_pixel([50.0, 50.0]);
        let u = View::u_length_relative(&px, &mm, 0.02, [50.0, 50.0]).unwrap();
        // A whole side that moves out by u changes the length by u/(2s).
        let mut moved = mm;
        moved[1][0] += 0.02;
        moved[2][0] += 0.02;
        let grown =
            scale(&View::corners(&px, &moved).unwrap()) / scale(&View::corners(&px, &mm).unwrap());
        assert!((grown - (1.0_f64 + 0.002).sqrt()).abs() < 1e-5, "{grown}");
        // Eight independent coordinates, each with half of that.
        let expected = 8.0_f64.sqrt() * 0.5 * 0.02 / (2.0 * 10.0);
        assert!((u / expected - 1.0).abs() < 1e-3, "{u} for {expected}");
    }

    #[test]
    fn crossed_corners_are_refused() {
        let crossed = [PX[0], PX[2], PX[1], PX[3]];
        assert_eq!(
            View::corners(&crossed, &MM),
            Err(ProfileError::Corners("px"))
        );
        let flat = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 5.0]];
        assert_eq!(View::corners(&PX, &flat), Err(ProfileError::Corners("mm")));
        assert_eq!(View::from_rows([0.0; 9]), Err(ProfileError::View));
    }
}

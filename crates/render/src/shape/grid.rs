//! How far the surface of a mesh is, at least: a coarse grid of lower bounds.

use crate::Vec3;

/// Cells along the longest side.
const CELLS: f64 = 96.0;

/// Lower bounds of the distance to a surface, one for each cell.
#[derive(Debug)]
pub(crate) struct Grid {
    min: Vec3,
    cell: f64,
    counts: [usize; 3],
    /// mm.
    bounds: Vec<f32>,
}

impl Grid {
    /// Over a box, with the cells that hold surface marked by boxes around its pieces.
    pub(crate) fn new(min: Vec3, max: Vec3, pieces: impl Iterator<Item = [Vec3; 3]>) -> Self {
        let cell = ((max - min).max_element() / CELLS).max(f64::MIN_POSITIVE);
        let counts = ((max - min) / cell).to_array().map(|n| n as usize + 1);
        let [nx, ny, nz] = counts;
        let mut grid = Self {
            min,
            cell,
            counts,
            bounds: vec![],
        };
        // Squares of the gap between a cell and the nearest with surface, in cells.
        let mut gaps = vec![f32::INFINITY; nx * ny * nz];
        for triangle in pieces {
            let [a, b, c] = triangle;
            let low = grid.index(a.min(b).min(c));
            let high = grid.index(a.max(b).max(c));
            for z in low[2]..=high[2] {
                for y in low[1]..=high[1] {
                    for x in low[0]..=high[0] {
                        if grid.may_touch([x, y, z], &triangle) {
                            gaps[(z * ny + y) * nx + x] = 0.0;
                        }
                    }
                }
            }
        }
        // One axis after the other: the square of the whole is the sum of the squares of each.
        for (count, stride) in [(nx, 1), (ny, nx), (nz, nx * ny)] {
            widen(&mut gaps, count, stride);
        }
        let bound = |gap: f32| gap.sqrt() * (cell * (1.0 - 1e-6)) as f32;
        grid.bounds = gaps.into_iter().map(bound).collect();
        grid
    }

    /// A plane test: whether the box around the cell meets the plane of the triangle.
    fn may_touch(&self, at: [usize; 3], [a, b, c]: &[Vec3; 3]) -> bool {
        let half = 0.5 * self.cell * (1.0 + 1e-6);
        let index = Vec3::from_array(at.map(|i| i as f64));
        let center = self.min + (index + 0.5) * self.cell;
        let normal = (*b - *a).cross(*c - *a);
        normal.dot(center - *a).abs() <= half * normal.abs().element_sum()
    }

    fn index(&self, point: Vec3) -> [usize; 3] {
        let scaled = (point - self.min) / self.cell;
        std::array::from_fn(|axis| (scaled[axis].max(0.0) as usize).min(self.counts[axis] - 1))
    }

    /// The bound at a point, mm.
    #[inline]
    pub(crate) fn at(&self, point: Vec3) -> f64 {
        let [x, y, z] = self.index(point);
        f64::from(self.bounds[(z * self.counts[1] + y) * self.counts[0] + x])
    }
}

/// Lets every line of cells along one axis see what its other cells are near to.
fn widen(gaps: &mut [f32], count: usize, stride: usize) {
    let mut line = vec![0.0; count];
    for start in (0..gaps.len()).filter(|i| (i / stride).is_multiple_of(count)) {
        for (k, place) in line.iter_mut().enumerate() {
            *place = gaps[start + k * stride];
        }
        for k in 0..count {
            let gap = |other: usize| {
                // Cells that touch have no gap.
                let steps = k.abs_diff(other).saturating_sub(1) as f32;
                line[other] + steps * steps
            };
            gaps[start + k * stride] = (0..count).map(gap).fold(f32::INFINITY, f32::min);
        }
    }
}

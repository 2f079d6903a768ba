//! The media of a texture by a few that stand for all of them.
//!
//! R_d is linear in the light but not in the medium. Here every medium is a sum of media on a grid,
//! whose weights are those of interpolation: then any amount of light that enters any number of
//! media is a list of powers, one for each medium of the grid, and adds up like power itself.

use crate::bssrdf::Family;
use physics::Medium;

/// Step of the grid in ln(√(1 − α′) + [`CLEAR`]), which is ln σₜᵣ at a σₜ′. A cubic between steps is
/// then within 0.1 % of the light at 2.5/σₜᵣ, and within 0.02 % of all that leaves.
const STEP_OF_ROOTS: f64 = 0.2;
/// What keeps the steps of media that hardly absorb from becoming endlessly short: all that have
/// a smaller √(1 − α′) are alike for a hundred transport lengths.
const CLEAR: f64 = 0.01;
/// Step of the grid in ln σₜ′. The total does not depend on it; only where the light leaves.
const STEP_OF_PATHS: f64 = 0.25;
/// The last row over the first: a hundred thousand transport lengths, if the solid is that large.
const FAR: f64 = 1e6;
/// Rows of a table for each octave of the square of the distance.
const BITS: u32 = 6;
const SHIFT: u32 = 52 - BITS;

/// Steps between media along one of their measures.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Axis {
    first: f64,
    step: f64,
    count: usize,
}

impl Axis {
    /// Over all of `measures`, in steps of at most `most`: one alone where they are all the same, else
    /// enough for a cubic.
    fn new(measures: impl Iterator<Item = f64> + Clone, most: f64) -> Self {
        let first = measures.clone().fold(f64::INFINITY, f64::min);
        let last = measures.fold(f64::NEG_INFINITY, f64::max);
        let span = last - first;
        // Texels are in single precision: what is apart by less is the same.
        if span <= 1e-6 * last.abs().max(1.0) {
            return Self {
                first,
                step: 1.0,
                count: 1,
            };
        }
        let steps = ((span / most).ceil() as usize).max(3);
        Self {
            first,
            step: span / steps as f64,
            count: steps + 1,
        }
    }

    fn at(&self, index: usize) -> f64 {
        self.first + index as f64 * self.step
    }

    /// How many weights there are, and the first place of those of a measure with them: Lagrange's,
    /// of the cubic through the four places around it.
    fn weights(&self, measure: f64) -> (usize, [f64; 4]) {
        if self.count == 1 {
            return (0, [1.0, 0.0, 0.0, 0.0]);
        }
        let place = ((measure - self.first) / self.step).clamp(0.0, (self.count - 1) as f64);
        let start = (place as usize).saturating_sub(1).min(self.count - 4);
        let t = place - start as f64;
        let [a, b, c, d] = [t, t - 1.0, t - 2.0, t - 3.0];
        (
            start,
            [
                -b * c * d / 6.0,
                a * c * d / 2.0,
                -a * b * d / 2.0,
                a * b * c / 6.0,
            ],
        )
    }

    fn taken(&self) -> usize {
        self.count.min(4)
    }
}

/// Part of the grid: first and number of places along each of its axes, √(1 − α′) the faster one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Patch {
    paths: [u16; 2],
    roots: [u16; 2],
}

impl Patch {
    pub(super) fn len(&self) -> usize {
        usize::from(self.paths[1]) * usize::from(self.roots[1])
    }

    /// The least that holds both; one without places counts for nothing.
    pub(super) fn with(self, other: Self) -> Self {
        if self.len() == 0 {
            return other;
        }
        if other.len() == 0 {
            return self;
        }
        let both = |a: [u16; 2], b: [u16; 2]| {
            let first = a[0].min(b[0]);
            [first, (a[0] + a[1]).max(b[0] + b[1]) - first]
        };
        Self {
            paths: both(self.paths, other.paths),
            roots: both(self.roots, other.roots),
        }
    }

    /// Adds `powers` of this patch to those of one that holds it.
    pub(super) fn add_to(&self, powers: &[f32], whole: &Self, sums: &mut [f32]) {
        let width = usize::from(self.roots[1]);
        if width == 0 {
            return;
        }
        let across = usize::from(whole.roots[1]);
        let column = usize::from(self.roots[0] - whole.roots[0]);
        let row = usize::from(self.paths[0] - whole.paths[0]);
        for (k, powers) in powers.chunks_exact(width).enumerate() {
            let start = (row + k) * across + column;
            for (sum, power) in sums[start..start + width].iter_mut().zip(powers) {
                *sum += power;
            }
        }
    }
}

/// Light of one channel on its way from a node: powers of the media of a patch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mixture<'a> {
    pub(super) patch: Patch,
    pub(super) powers: &'a [f32],
    /// Mean of the light's own, mm.
    pub(super) source_depth_mm: f32,
}

/// The media of a channel that stand for all of a texture, and R_d of each of them.
pub(crate) struct Palette {
    roots: Axis,
    paths: Axis,
    /// Place of the first row.
    first: u64,
    /// R_d at the squares of distances, row by row, the media of the grid in each.
    rows: Vec<f32>,
    width: usize,
}

/// σₜ′ and √(1 − α′), on the scales of the grid.
fn measures(medium: &Medium) -> (f64, f64) {
    let coefficients = medium.reduced().coefficients();
    let root = (1.0 - coefficients.albedo_prime()).max(0.0).sqrt();
    (
        coefficients.sigma_t_prime().max(f64::MIN_POSITIVE).ln(),
        (root + CLEAR).ln(),
    )
}

impl Palette {
    /// Of a family whose media lie between `ends`, for distances up to `most` mm.
    pub(super) fn new(family: &Family, ends: &[Medium], most: f64) -> Self {
        let all = ends.iter().map(measures);
        let paths = Axis::new(all.clone().map(|(path, _)| path), STEP_OF_PATHS);
        let roots = Axis::new(all.map(|(_, root)| root), STEP_OF_ROOTS);
        let of_grid = |path: usize, root: usize| {
            let root = (roots.at(root).exp() - CLEAR).clamp(0.0, 1.0);
            let (sigma_t_prime, absorbed) = (paths.at(path).exp(), root * root);
            physics::ReducedMedium {
                sigma_a: sigma_t_prime * absorbed,
                sigma_s_prime: sigma_t_prime * (1.0 - absorbed),
                eta: ends[0].eta,
            }
            .with_g(ends[0].g)
        };
        let media: Vec<Medium> = (0..paths.count)
            .flat_map(|path| (0..roots.count).map(move |root| of_grid(path, root)))
            .collect();
        let locals: Vec<_> = media.iter().map(|medium| family.of(medium)).collect();
        // No node is nearer than a part of a path to what it stands for.
        let least = 0.1 / paths.at(paths.count - 1).exp();
        let place = |distance: f64| (distance * distance).to_bits() >> SHIFT;
        let (first, last) = (place(least), place(most.clamp(2.0 * least, FAR * least)));
        let rows = (first..=last + 1)
            .flat_map(|place| {
                let square = f64::from_bits(place << SHIFT);
                locals.iter().map(move |local| local.spread(square) as f32)
            })
            .collect();
        Self {
            roots,
            paths,
            first,
            rows,
            width: media.len(),
        }
    }

    /// The places of a medium and its weights there.
    pub(super) fn weights(&self, medium: &Medium) -> (Patch, [f32; 16]) {
        let (path, root) = measures(medium);
        let (path, of_paths) = self.paths.weights(path);
        let (root, of_roots) = self.roots.weights(root);
        let (rows, columns) = (self.paths.taken(), self.roots.taken());
        let mut weights = [0.0; 16];
        for (row, of_path) in of_paths[..rows].iter().enumerate() {
            for (column, of_root) in of_roots[..columns].iter().enumerate() {
                weights[row * columns + column] = (of_path * of_root) as f32;
            }
        }
        let patch = Patch {
            paths: [path as u16, rows as u16],
            roots: [root as u16, columns as u16],
        };
        (patch, weights)
    }

    /// The light of a mixture that leaves at a distance whose square is given, mm⁻².
    #[inline]
    pub(super) fn light(&self, mixture: &Mixture<'_>, square: f64) -> f64 {
        let bits = square.to_bits();
        let place = bits >> SHIFT;
        let row = place.saturating_sub(self.first) as usize;
        let start = row * self.width;
        let Some(rows) = self.rows.get(start..start + 2 * self.width) else {
            return 0.0;
        };
        let part = (bits & ((1 << SHIFT) - 1)) as f32 / (1_u64 << SHIFT) as f32;
        let (here, next) = rows.split_at(self.width);
        let Patch { paths, roots } = mixture.patch;
        let columns = usize::from(roots[1]);
        let mut start = usize::from(paths[0]) * self.roots.count + usize::from(roots[0]);
        let (mut sum, mut sum_next) = (0.0, 0.0);
        for powers in mixture.powers.chunks_exact(columns.max(1)) {
            let here = &here[start..start + columns];
            let next = &next[start..start + columns];
            for ((power, here), next) in powers.iter().zip(here).zip(next) {
                sum += power * here;
                sum_next += power * next;
            }
            start += self.roots.count;
        }
        f64::from(sum + part * (sum_next - sum))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cubic is met exactly, at the ends and between; the weights are a whole.
    #[test]
    fn the_weights_of_an_axis_are_those_of_a_cubic() {
        let ends = [0.3, 2.1];
        let axis = Axis::new(ends.into_iter(), 0.25);
        assert_eq!((axis.count, axis.at(axis.count - 1)), (9, 2.1));
        let cubic = |x: f64| 1.0 - 2.0 * x + 0.5 * x * x * x;
        for measure in [0.3, 0.31, 0.7, 1.37, 2.0, 2.1] {
            let (start, weights) = axis.weights(measure);
            let sum: f64 = weights.iter().sum();
            let all = weights.iter().enumerate();
            let found: f64 = all.map(|(k, w)| w * cubic(axis.at(start + k))).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{measure}");
            assert!((found - cubic(measure)).abs() < 1e-12, "{measure}: {found}");
        }
        let one = Axis::new([0.7; 3].into_iter(), 0.25);
        assert_eq!((one.taken(), one.weights(0.7).0), (1, 0));
    }

    /// Sums of patches are those of their powers, place by place.
    #[test]
    fn patches_add_up_where_they_belong() {
        let small = Patch {
            paths: [2, 1],
            roots: [4, 2],
        };
        let other = Patch {
            paths: [1, 2],
            roots: [3, 1],
        };
        let whole = small.with(other).with(Patch::default());
        let expected = Patch {
            paths: [1, 2],
            roots: [3, 3],
        };
        assert_eq!(whole, expected);
        let mut sums = [0.0; 6];
        small.add_to(&[1.0, 2.0], &whole, &mut sums);
        other.add_to(&[8.0, 16.0], &whole, &mut sums);
        assert_eq!(sums, [8.0, 0.0, 0.0, 16.0, 1.0, 2.0]);
    }
}

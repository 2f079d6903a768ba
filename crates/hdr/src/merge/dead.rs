//! Pixels that see nothing.

use rayon::prelude::*;

/// Share of its darkest neighbour up to which a pixel counts as dark: no lens makes a hole of one
/// pixel that deep, and no beam's speckle where it is resolved.
const DARK: f32 = 0.05;

/// Standard deviations that the darkest neighbour must be above it.
const SURE: f32 = 10.0;

/// Where pixels are dark whose eight neighbours were all measured and are all bright; those at the
/// edge of the picture are not judged.
pub(super) fn find(value: &[f32], variance: &[f32], width: usize) -> Vec<usize> {
    let height = value.len() / width.max(1);
    if width < 3 || height < 3 {
        return vec![];
    }
    let is_dead = |at: usize| {
        // Most pixels are as bright as the one to their left.
        let left = value[at - 1];
        if value[at] > DARK * left || variance[at] == f32::INFINITY {
            return false;
        }
        let rows = [at - width, at, at + width];
        let around = || rows.into_iter().flat_map(|row| row - 1..=row + 1);
        let neighbours = || around().filter(|n| *n != at);
        let least = neighbours().map(|n| value[n]).fold(f32::INFINITY, f32::min);
        let most = around().map(|n| variance[n]).fold(0.0, f32::max);
        value[at] <= DARK * least && (least - value[at]).powi(2) > SURE * SURE * most
    };
    (1..height - 1)
        .into_par_iter()
        .flat_map_iter(|row| {
            let start = row * width;
            (start + 1..start + width - 1).filter(|at| is_dead(*at))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_amid_light_is_dead_and_a_slope_is_not() {
        // A steep slope, a hole in its bright part and one in the dark of its noise.
        let width = 40;
        let mut value: Vec<f32> = (0..width * width)
            .map(|i| 1e5 * (-((i % width) as f32) / 2.0).exp())
            .collect();
        let variance = vec![25.0; value.len()];
        assert!(find(&value, &variance, width).is_empty());
        let (bright, dark) = (20 * width + 5, 20 * width + 38);
        value[bright] = 30.0;
        value[dark] = 0.0;
        assert_eq!(find(&value, &variance, width), [bright]);
        // Beside one that was not measured nothing is sure.
        let mut unmeasured = variance;
        unmeasured[bright + 1] = f32::INFINITY;
        assert!(find(&value, &unmeasured, width).is_empty());
    }
}

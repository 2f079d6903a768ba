//! Bins of a tally, with what lies beyond the last one kept apart.

use crate::error::InvalidSimulation;

/// What a tally is binned by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Distance from the middle of the beam along the surface, mm.
    Radius,
    /// Angle of exit outside, radians from the normal.
    Angle,
    /// Azimuth of exit, radians from the side to which an oblique beam travels.
    Azimuth,
    /// Depth below the top of the medium, mm.
    Depth,
    /// Length of the path inside, mm.
    Path,
}

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Radius => "radius",
            Self::Angle => "angle",
            Self::Azimuth => "azimuth",
            Self::Depth => "depth",
            Self::Path => "path length",
        })
    }
}

/// Bins between increasing edges that start at 0, and one cell for all beyond.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bins {
    edges: Vec<f64>,
    /// Bins per unit of length if all were of the same width: where the search starts.
    guess: f64,
}

impl Bins {
    /// Checks the edges. None at all makes no bin, and everything lies beyond.
    pub(crate) fn new(axis: Axis, edges: &[f64]) -> Result<Self, InvalidSimulation> {
        let bad = |bin, lower, upper| InvalidSimulation::Bins {
            axis,
            bin,
            lower,
            upper,
        };
        match edges {
            [] => {}
            [only] => return Err(bad(1, *only, f64::NAN)),
            [first, second, ..] if *first != 0.0 => return Err(bad(1, *first, *second)),
            _ => {
                for (bin, pair) in edges.windows(2).enumerate() {
                    if !(pair[0] < pair[1] && pair[1].is_finite()) {
                        return Err(bad(bin + 1, pair[0], pair[1]));
                    }
                }
            }
        }
        let guess = edges
            .last()
            .map_or(0.0, |last| (edges.len() - 1) as f64 / last);
        Ok(Self {
            edges: edges.to_vec(),
            guess,
        })
    }

    /// All edges; empty without bins.
    pub(crate) fn edges(&self) -> &[f64] {
        &self.edges
    }

    /// Bins without the one beyond.
    pub(crate) fn count(&self) -> usize {
        self.edges.len().saturating_sub(1)
    }

    /// Cells, the one beyond included.
    pub(crate) fn cells(&self) -> usize {
        self.count() + 1
    }

    /// The bin that holds `value`, or [`Self::count`] if it lies beyond. Lower edges belong to
    /// their bin.
    pub(crate) fn find(&self, value: f64) -> usize {
        let count = self.count();
        if count == 0 || value >= self.edges[count] {
            return count;
        }
        // One look when bins are even (give or take an edge's rounding), a search when not.
        let k = ((value * self.guess) as usize).min(count - 1);
        if self.edges[k] <= value && value < self.edges[k + 1] {
            return k;
        }
        self.edges
            .partition_point(|&edge| edge <= value)
            .saturating_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_falls_between_the_edges_of_its_bin() {
        let even: Vec<f64> = (0..=50).map(|k| f64::from(k) * 0.02).collect();
        let uneven = vec![0.0, 0.1, 0.15, 0.7, 2.0];
        for edges in [even, uneven] {
            let bins = Bins::new(Axis::Radius, &edges).unwrap();
            for value in edges
                .iter()
                .copied()
                .chain((0..400).map(|k| f64::from(k) * 0.0061))
            {
                let k = bins.find(value);
                let upper = edges.get(k + 1).copied().unwrap_or(f64::INFINITY);
                assert!(
                    edges[k] <= value && value < upper,
                    "{value} in {k} of {edges:?}"
                );
            }
            assert_eq!(bins.find(f64::INFINITY), edges.len() - 1);
        }
    }

    #[test]
    fn no_edges_put_everything_beyond() {
        let none = Bins::new(Axis::Path, &[]).unwrap();
        assert_eq!((none.count(), none.cells(), none.find(3.0)), (0, 1, 0));
    }

    #[test]
    fn edges_must_increase_from_zero() {
        let bad = |edges: &[f64]| {
            matches!(
                Bins::new(Axis::Depth, edges),
                Err(InvalidSimulation::Bins { .. })
            )
        };
        assert!(bad(&[0.0]) && bad(&[0.1, 0.2]) && bad(&[0.0, 1.0, 1.0]));
        assert!(bad(&[0.0, f64::NAN]) && bad(&[0.0, f64::INFINITY]));
    }
}

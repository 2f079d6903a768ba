//! Where the data lie: what every profile on the same radii shares.

use crate::options::FitOptions;
use crate::range;
use crate::result::FitError;
use physics::{Footprints, ProfilePoint};
use std::sync::Arc;

/// The points that a fit may use, with what each averages over.
pub(crate) struct Geometry {
    /// Index of each point in the profile.
    pub(crate) indices: Vec<usize>,
    /// Inner and outer edge of each ring, mm; twice the radius where there is no ring.
    pub(crate) edges: Vec<(f64, f64)>,
    /// Mean radius of each point, mm.
    pub(crate) radii: Vec<f64>,
    /// Area of each ring, mm²; 0 where there is none.
    pub(crate) areas: Vec<f64>,
    pub(crate) footprints: Arc<Footprints>,
    /// The range that holds them, mm.
    pub(crate) range_mm: (f64, f64),
    /// First and last radius of the whole profile, mm, and its outer edge.
    pub(crate) first_mm: f64,
    pub(crate) last_mm: f64,
    pub(crate) outer_mm: f64,
}

/// Inner and outer edge of a point, mm.
fn edges(point: &ProfilePoint) -> (f64, f64) {
    point.ring_mm.unwrap_or((point.radius_mm, point.radius_mm))
}

/// Where the profile ends, mm.
pub(crate) fn outer_mm(points: &[ProfilePoint]) -> f64 {
    points.iter().map(|p| edges(p).1).fold(0.0, f64::max)
}

impl Geometry {
    /// The points of a profile that lie in the range of `options`, or clear of the beam.
    pub(crate) fn new(
        points: &[ProfilePoint],
        channel: &dyn Fn() -> String,
        options: &FitOptions,
    ) -> Result<Self, FitError> {
        let outer_mm = outer_mm(points);
        let range_mm = match options.range_mm {
            Some(range) => range,
            None => range::widest(outer_mm, channel, options)?,
        };
        let indices: Vec<usize> = (0..points.len())
            .filter(|&i| range::contains(range_mm, edges(&points[i])))
            .collect();
        let inside: Vec<ProfilePoint> = indices.iter().map(|&i| points[i]).collect();
        Ok(Self {
            edges: inside.iter().map(edges).collect(),
            radii: inside.iter().map(|p| p.radius_mm).collect(),
            areas: inside.iter().map(ProfilePoint::area_mm2).collect(),
            footprints: match &options.footprints {
                Some(all) if indices.len() == points.len() => Arc::clone(all),
                Some(all) => Arc::new(all.of(&indices)),
                None => Arc::new(Footprints::new(&inside, &options.blur)),
            },
            first_mm: points.first().map_or(0.0, |p| p.radius_mm),
            last_mm: points.last().map_or(0.0, |p| p.radius_mm),
            range_mm,
            outer_mm,
            indices,
        })
    }

    pub(crate) fn len(&self) -> usize {
        self.radii.len()
    }
}

//! The line through the spot, as the paper reads it.

use crate::error::ProfileError;
use crate::radial::{Measured, ProfileOptions};
use crate::survey::Survey;
use physics::{ChannelMap, ProfilePoint};

/// The profile along the row of pixels through the spot, and the total of the whole picture.
///
/// The row is taken to be perpendicular to the camera's view direction. Both sides are averaged
/// in the bins that [`crate::radial_profile`] has for rings; the points are values at one
/// radius, the mean of their pixels' distances from the spot. Where a bin holds pixels of
/// unequal distance, what their ring's curve makes of the difference is taken out. The total and
/// its uncertainty are those of the whole picture, with which the few pixels of a line share
/// next to nothing.
///
/// # Errors
///
/// As [`crate::radial_profile`].
///
/// # Source
///
/// Jensen et al. (2001), section 3.
pub fn slice_profile(
    channel: &ChannelMap,
    width: usize,
    height: usize,
    options: &ProfileOptions,
) -> Result<Measured, ProfileError> {
    let survey = Survey::new(channel, width, height, options)?;
    let mut measured = survey.checked(channel, options)?;
    let center_y = survey.center[1];
    // A row of a mosaic may have no photosite of this colour: then the next one that does.
    let mut rows: Vec<usize> = (0..height).collect();
    let from_spot = |row: &usize| (*row as f64 - center_y).abs();
    rows.sort_by(|a, b| from_spot(a).total_cmp(&from_spot(b)));
    let measured_in = |row: &usize| {
        let variances = channel.variance.chunks_exact(width).nth(*row);
        variances.is_some_and(|row| row.iter().any(|v| v.is_finite()))
    };
    let row = rows.into_iter().find(measured_in).unwrap_or_default();

    #[derive(Clone, Default)]
    struct Bin {
        count: u64,
        radius: f64,
        residual: f64,
        variance: f64,
    }
    let mut bins = vec![Bin::default(); survey.rings.len()];
    survey.for_each_pixel(channel, (width, height), |p| {
        if p.index / width != row {
            return;
        }
        let residual = p.value - survey.curve.at(p.ring, p.tau);
        if survey.limits[p.ring].allows(residual, p.variance) {
            let (middle, half) = survey.rings.square(p.ring);
            let bin = &mut bins[p.ring];
            bin.count += 1;
            bin.radius += (middle + half * p.tau).max(0.0).sqrt();
            bin.residual += residual;
            bin.variance += p.variance;
        }
    });
    measured.profile.points = bins
        .iter()
        .enumerate()
        .filter(|(_, bin)| bin.count > 0)
        .map(|(ring, bin)| {
            let n = bin.count as f64;
            let radius = bin.radius / n;
            let (middle, half) = survey.rings.square(ring);
            let value = bin.residual / n + survey.curve.at(ring, (radius * radius - middle) / half);
            ProfilePoint {
                ring_mm: None,
                radius_mm: radius * survey.unit_mm,
                reflectance_per_mm2: value * options.factor_per_mm2,
                u_reflectance_per_mm2: bin.variance.sqrt() / n * options.factor_per_mm2,
                pixels: Some(bin.count),
            }
        })
        .collect();
    Ok(measured)
}

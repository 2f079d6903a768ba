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
    let [center_x, center_y] = survey.center;
    let row = center_y.round() as usize;
    let dy = row as f64 - center_y;

    #[derive(Clone, Default)]
    struct Bin {
        count: u64,
        radius: f64,
        residual: f64,
        variance: f64,
    }
    let mut bins = vec![Bin::default(); survey.rings.len()];
    survey
        .rings
        .for_each_run((width, height), survey.center, |run| {
            if run.dy != dy {
                return;
            }
            let (middle, half) = survey.rings.square(run.ring);
            for index in run.pixels.clone() {
                let dx = (index % width) as f64 - center_x;
                let square = dx * dx + dy * dy;
                let variance = f64::from(channel.variance[index]);
                let residual = f64::from(channel.value[index])
                    - survey.curve.at(run.ring, (square - middle) / half);
                if variance.is_finite() && survey.limits[run.ring].allows(residual, variance) {
                    let bin = &mut bins[run.ring];
                    bin.count += 1;
                    bin.radius += square.sqrt();
                    bin.residual += residual;
                    bin.variance += variance;
                }
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
                radius_mm: radius * options.mm_per_pixel,
                reflectance_per_mm2: value * options.factor_per_mm2,
                u_reflectance_per_mm2: bin.variance.sqrt() / n * options.factor_per_mm2,
                pixels: Some(bin.count),
            }
        })
        .collect();
    Ok(measured)
}

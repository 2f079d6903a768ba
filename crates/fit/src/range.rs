//! Which radii a diffusion model can speak for.

use crate::options::FitOptions;
use crate::result::{FitError, Warning};
use physics::{Coefficients, RadialProfile};

/// Radii closer than this many standard deviations of the blur see the beam itself.
const BLURS: f64 = 4.0;
/// Diffusion holds beyond this many transport lengths 1/σₜ′ (FIELD: bias figures start at 2).
const TRANSPORT_LENGTHS: f64 = 2.0;
/// However long the transport length, keep this share of the radii: a fit needs a lever.
const LATEST_START: f64 = 1.0 / 3.0;

fn edges(profile: &RadialProfile) -> impl Iterator<Item = (f64, f64)> {
    profile
        .points
        .iter()
        .map(|p| p.ring_mm.unwrap_or((p.radius_mm, p.radius_mm)))
}

/// Whether a point with these edges lies in `range`, rounding forgiven.
pub(crate) fn contains(range: (f64, f64), (inner, outer): (f64, f64)) -> bool {
    inner >= range.0 * (1.0 - 1e-9) && outer <= range.1 * (1.0 + 1e-9)
}

/// Everything that is clear of the beam.
pub(crate) fn widest(
    profile: &RadialProfile,
    options: &FitOptions,
) -> Result<(f64, f64), FitError> {
    let outer = edges(profile).fold(0.0, |m: f64, (_, outer)| m.max(outer));
    let start = BLURS * options.blur.standard_deviation_mm();
    if start >= outer {
        return Err(FitError::BeamWiderThanProfile {
            beam_mm: start,
            profile_mm: outer,
        });
    }
    Ok((start, outer))
}

/// The radii that the model can be trusted at, now that σₜ′ is known.
pub(crate) fn trusted(
    profile: &RadialProfile,
    options: &FitOptions,
    found: Coefficients,
) -> ((f64, f64), Option<Warning>) {
    let outer = edges(profile).fold(0.0, |m: f64, (_, outer)| m.max(outer));
    let clear = BLURS * options.blur.standard_deviation_mm();
    let wanted = TRANSPORT_LENGTHS / found.sigma_t_prime();
    let latest = LATEST_START * outer;
    let warning = (wanted > latest).then(|| Warning::StartsNear {
        start_mm: latest.max(clear),
        transport_lengths: latest.max(clear) * found.sigma_t_prime(),
    });
    ((wanted.min(latest).max(clear), outer), warning)
}

/// Whether two ranges hold the same points.
pub(crate) fn same_points(profile: &RadialProfile, a: (f64, f64), b: (f64, f64)) -> bool {
    edges(profile).all(|edges| contains(a, edges) == contains(b, edges))
}

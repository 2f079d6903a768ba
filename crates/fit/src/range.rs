//! Which radii a diffusion model can speak for.

use crate::options::FitOptions;
use crate::result::{FitError, Warning};
use physics::Coefficients;

/// Diffusion holds beyond this many transport lengths 1/σₜ′ (FIELD: bias figures start at 2).
const TRANSPORT_LENGTHS: f64 = 2.0;
/// However long the transport length, keep this share of the radii: a fit needs a lever.
const LATEST_START: f64 = 1.0 / 3.0;

/// Whether a point with these edges lies in `range`, rounding forgiven.
pub(crate) fn contains(range: (f64, f64), (inner, outer): (f64, f64)) -> bool {
    inner >= range.0 * (1.0 - 1e-9) && outer <= range.1 * (1.0 + 1e-9)
}

/// Everything that is clear of the beam, in a profile that ends at `outer_mm`.
pub(crate) fn widest(
    outer_mm: f64,
    channel: &dyn Fn() -> String,
    options: &FitOptions,
) -> Result<(f64, f64), FitError> {
    let start = options.blur.clear_mm();
    if start >= outer_mm {
        return Err(FitError::BeamWiderThanProfile {
            channel: channel(),
            beam_mm: start,
            profile_mm: outer_mm,
        });
    }
    Ok((start, outer_mm))
}

/// The radii that the model can be trusted at, now that σₜ′ is known.
pub(crate) fn trusted(
    outer_mm: f64,
    options: &FitOptions,
    found: Coefficients,
) -> ((f64, f64), Option<Warning>) {
    let clear = options.blur.clear_mm();
    let wanted = TRANSPORT_LENGTHS / found.sigma_t_prime();
    let latest = LATEST_START * outer_mm;
    let warning = (wanted > latest).then(|| Warning::StartsNear {
        start_mm: latest.max(clear),
        transport_lengths: latest.max(clear) * found.sigma_t_prime(),
    });
    ((wanted.min(latest).max(clear), outer_mm), warning)
}

/// Whether two ranges hold the same points.
pub(crate) fn same_points(edges: &[(f64, f64)], a: (f64, f64), b: (f64, f64)) -> bool {
    edges
        .iter()
        .all(|&edges| contains(a, edges) == contains(b, edges))
}

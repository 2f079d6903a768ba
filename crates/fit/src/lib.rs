//! Fits σₐ and σₛ′ to a radial profile and a total reflectance.
//!
//! A library on [`physics::RadialProfile`] and any [`physics::ForwardModel`]; it knows no files.
//!
//! | module | holds |
//! |---|---|
//! | `budget` | [`Contribution`]: what each input adds to the uncertainties |
//! | `options` | what the caller chooses: constraint, range, blur, entry loss |
//! | `result` | [`Fit`] with its uncertainties, [`Termination`], [`Warning`], [`FitError`] |
//! | `problem` | the weighted residuals, with pixels counted once |
//! | `solve` | the search: a scan that cannot miss, then Gauss-Newton |
//! | `range` | which radii a diffusion model can speak for |
//!
//! The search works in ln σₜ′, a pure scale of length, and in a coordinate of absorption in which
//! the data stay linear down to σₐ = 0. The total falls steadily with absorption, so the paper's
//! constraint leaves a problem in one dimension.

mod budget;
mod options;
mod problem;
mod range;
mod result;
mod solve;

pub use budget::Contribution;
pub use options::{Constraint, FitOptions};
pub use result::{Estimate, Fit, FitError, Residual, Termination, TotalFit, Warning};

use physics::{ForwardModel, RadialProfile, TotalReflectance};

/// Fits one channel.
///
/// `total` must be there for [`Constraint::Exact`] and [`Constraint::Joint`]. Where it has a
/// radius it is taken to be the sum over the profile's own picture: its pixels inside the fitted
/// rings are then counted once. Without one it is a measurement of its own.
///
/// # Errors
///
/// [`FitError`] where the profile cannot constrain a medium at all. A search that stops early is
/// not an error: see [`Termination`].
pub fn fit(
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
    model: &dyn ForwardModel,
    options: &FitOptions,
) -> Result<Fit, FitError> {
    problem::check(profile, total, options)?;
    if let Some(range) = options.range_mm {
        let problem = problem::Problem::new(profile, total, model, options, range)?;
        return Ok(problem.conclude(solve::solve(&problem), vec![]));
    }
    // The range depends on σₜ′, which the fit finds: a few rounds settle which points are in.
    let mut range = range::widest(profile, options)?;
    let mut rounds = 0;
    loop {
        let problem = problem::Problem::new(profile, total, model, options, range)?;
        let solution = solve::solve(&problem);
        rounds += 1;
        let (next, warning) = range::trusted(profile, options, problem.coefficients(&solution));
        // A step back and forth over one ring would never end: take the later start.
        if rounds >= 8 || range::same_points(profile, range, next) {
            return Ok(problem.conclude(solution, warning.into_iter().collect()));
        }
        range = if rounds > 4 {
            (next.0.max(range.0), next.1)
        } else {
            next
        };
    }
}

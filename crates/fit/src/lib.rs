//! Fits σₐ and σₛ′ to a radial profile and a total reflectance.
//!
//! A library on [`physics::RadialProfile`] and any [`physics::ForwardModel`]; it knows no files.
//!
//! | module | holds |
//! |---|---|
//! | `budget` | [`Contribution`]: what each input adds to the uncertainties |
//! | `options` | what the caller chooses: constraint, range, blur, entry loss |
//! | `result` | [`Fit`] with its uncertainties, [`Termination`], [`Warning`], [`FitError`] |
//! | `geometry` | where the data lie, and what each averages over |
//! | `problem` | which data with which weight, with pixels counted once |
//! | `equations` | the normal equations with every nuisance eliminated |
//! | `likelihood` | the ends of an interval of σₐ near 0, by the profile likelihood |
//! | `conclude` | from the optimum to numbers with uncertainties |
//! | `many` | [`fit_many`]: many profiles on the same radii, on all threads |
//! | `solve` | the search: a scan that cannot miss, then Gauss-Newton |
//! | `unit` | [`another_unit`]: a power of ten between shape and light |
//! | `range` | which radii a diffusion model can speak for |
//!
//! The search works in ln σₜ′, a pure scale of length, and in a coordinate of absorption in which
//! the data stay linear down to σₐ = 0. The total falls steadily with absorption, so the paper's
//! constraint leaves a problem in one dimension.

mod budget;
mod conclude;
mod equations;
mod geometry;
mod likelihood;
mod many;
mod options;
mod problem;
mod range;
mod result;
mod solve;
mod unit;

pub use budget::Contribution;
pub use many::{ManyFits, Profiles, Totals, fit_many};
pub use options::{Constraint, Direction, DirectionKind, FitOptions};
pub use result::{Estimate, Fit, FitError, Residual, Termination, TotalFit, Warning};
pub use unit::{another_unit, doubts_unit};

use geometry::Geometry;
use physics::{Coefficients, ForwardModel, ProfilePoint, RadialProfile, TotalReflectance};
use problem::{Data, Measured, Memory, Problem};
use solve::Solution;

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
    check(profile, total, options)?;
    let channel = || profile.channel.clone();
    let measured: Option<Measured> = total.map(Into::into);
    let geometry = Geometry::new(&profile.points, &channel, options)?;
    let of_points = |f: fn(&ProfilePoint) -> f64| -> Vec<f64> {
        let points = geometry.indices.iter();
        points.map(|&i| f(&profile.points[i])).collect()
    };
    let data = Data {
        geometry: &geometry,
        value: &of_points(|p| p.reflectance_per_mm2),
        u: &of_points(|p| p.u_reflectance_per_mm2),
        total: measured.filter(|_| options.constraint != Constraint::None),
        model,
        options,
        channel: &channel,
    };
    let (mut problem, solution, warning) = search(data, Memory::default())?;
    let mut found = problem.conclude(&solution, warning);
    found.warnings.extend(problem::suspicions(profile, &found));
    Ok(found)
}

/// Refuses what no fit can use, whatever the model.
///
/// # Errors
///
/// [`FitError`], as of [`fit`].
pub fn check(
    profile: &RadialProfile,
    total: Option<&TotalReflectance>,
    options: &FitOptions,
) -> Result<(), FitError> {
    let channel = || profile.channel.clone();
    let measured = total.map(Into::into);
    let points = &profile.points;
    problem::check_options(options, points.len())?;
    problem::check_radii(&channel, points.iter().map(|p| p.radius_mm))?;
    let pairs = points
        .iter()
        .map(|p| (p.reflectance_per_mm2, p.u_reflectance_per_mm2));
    problem::check_values(&channel, points, pairs, measured, options)?;
    problem::check_total(&channel, measured, options)
}

/// The radii, mm, at which a closed form can be trusted in the medium `found`: what a fit chooses
/// when it is not told a range, and finds that medium.
///
/// # Errors
///
/// The beam covers the profile.
pub fn trusted_range(
    profile: &RadialProfile,
    found: Coefficients,
    options: &FitOptions,
) -> Result<(f64, f64), FitError> {
    let outer_mm = geometry::outer_mm(&profile.points);
    range::widest(outer_mm, &|| profile.channel.clone(), options)?;
    Ok(range::trusted(outer_mm, options, found).0)
}

/// Rounds after which a range, or a discrepancy, that will not settle is taken as it is.
const ROUNDS: usize = 20;
/// Relative change of a coefficient below which the model's discrepancy there is settled.
const SETTLED: f64 = 1e-6;
/// The same below which the next fit is in the valley of the last.
const CLOSE: f64 = 0.01;

/// Solves again until the radii that the model can be trusted at, and the model's discrepancy
/// there, are those of the solution itself.
fn search(
    data: Data<'_>,
    mut memory: Memory,
) -> Result<(Problem<'_>, Solution, Option<Warning>), FitError> {
    let options = data.options;
    let mut found = options.last;
    let mut range = match found.filter(|_| options.range_mm.is_none()) {
        Some(last) => range::trusted(data.geometry.outer_mm, options, last).0,
        None => data.geometry.range_mm,
    };
    // Where to begin instead of looking everywhere.
    let mut start = found;
    let mut rounds = 0;
    loop {
        let mut problem = Problem::new(data, range, found, memory)?;
        let solution = solve::solve(&mut problem, start);
        rounds += 1;
        let next = problem.coefficients(&solution);
        let stayed = |within: f64| {
            found.is_some_and(|last| {
                let moved = |a: f64, b: f64| (a - b).abs() > within * b;
                !moved(last.sigma_t_prime(), next.sigma_t_prime())
                    && !moved(last.sigma_tr(), next.sigma_tr())
            })
        };
        let settled = data.model.discrepancies() == 0 || stayed(SETTLED);
        let close = stayed(CLOSE);
        found = Some(next);
        // The range depends on σₜ′, which the fit finds: a few rounds settle which points are in.
        let (trusted, warning) = match options.range_mm {
            Some(range) => (range, None),
            None => range::trusted(data.geometry.outer_mm, options, next),
        };
        let least = data.model.trust().least_transport_lengths;
        let warning = warning.filter(|w| {
            !matches!(w, Warning::StartsNear { transport_lengths, .. } if *transport_lengths >= least)
        });
        let same = range == trusted || range::same_points(&data.geometry.edges, range, trusted);
        if (same || rounds >= 8) && settled || rounds >= ROUNDS {
            return Ok((problem, solution, warning));
        }
        // The same points, and a discrepancy that hardly changes any more, have no other minimum.
        start = found.filter(|_| same && close || options.last.is_some());
        // A step back and forth over one ring would never end: take the later start.
        if rounds > 4 {
            range = (trusted.0.max(range.0), trusted.1);
        } else {
            range = trusted;
        }
        memory = problem.memory;
    }
}

//! What the caller of a fit chooses.

use physics::{Blur, Coefficients, Footprints};
use std::sync::Arc;

/// What the total reflectance does to the fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constraint {
    /// The paper's: the model's total equals the measured one, taken as exact, and so is the
    /// scale. Intervals are those of the noise alone.
    Exact,
    /// The total is one more datum with its own uncertainty, and profile and total share one
    /// unknown scale factor with prior 1 ± u.
    Joint,
    /// The profile alone, with the unknown scale factor.
    None,
}

/// A way in which the data may be off together: a nuisance of mean 0 and variance 1, independent
/// of all others, that a fit carries along and eliminates.
#[derive(Clone, Debug, PartialEq)]
pub struct Direction {
    /// What it comes from: a line of the budget, which directions of one name share.
    pub source: &'static str,
    /// What the numbers are relative to.
    pub kind: DirectionKind,
    /// For one standard deviation, the change of every point of the whole profile, in its order.
    pub profile: Vec<f64>,
    /// The change of the total.
    pub total: f64,
}

/// What the numbers of a [`Direction`] are relative to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DirectionKind {
    /// The model's value: a dimensionless share of it.
    Relative,
    /// Nothing: mm⁻² for the profile; the total's is dimensionless anyway.
    Absolute,
}

/// How to fit. Every value is legal by itself.
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// What the total does.
    pub constraint: Constraint,
    /// First and last radius, mm; `None` lets the fit choose from 2/σₜ′ outward, clear of the
    /// blur.
    pub range_mm: Option<(f64, f64)>,
    /// Share of the incident power that enters the medium (`physics::fresnel::entry_factor`);
    /// 1 is the paper's mode.
    pub entry_factor: f64,
    /// Relative standard uncertainty of the scale that profile and total share. 0 where it is
    /// known, infinite where it is not known at all: then the shape alone decides.
    pub u_scale_relative: f64,
    /// Ways beside the scale, and beside those of the model
    /// (`physics::ForwardModel::discrepancy`), in which the data may be off together.
    /// [`Constraint::Exact`] heeds what they do to the profile.
    pub directions: Vec<Direction>,
    /// Beam width and pixel that the profile was blurred by.
    pub blur: Blur,
    /// A medium near the one that is sought, where the caller knows of one: tried beside the
    /// search's own starts, which a model that is far off may mislead.
    pub near: Option<Coefficients>,
    /// What nearly the same data gave under nearly the same options: the search begins there, with
    /// the radii that are trusted there, and looks nowhere else.
    pub last: Option<Coefficients>,
    /// What every point of the profile averages over under `blur`, where the caller has it already
    /// for many fits; `None` finds it.
    pub footprints: Option<Arc<Footprints>>,
    /// Where the search gives up and returns its best so far.
    pub max_evaluations: usize,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            constraint: Constraint::Joint,
            range_mm: None,
            entry_factor: 1.0,
            u_scale_relative: 0.0,
            directions: vec![],
            blur: Blur::NONE,
            near: None,
            last: None,
            footprints: None,
            max_evaluations: 2000,
        }
    }
}

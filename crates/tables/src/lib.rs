//! Tables of materials: whether their rows agree with themselves, how several become one, and
//! what follows from a row.
//!
//! Rows are [`physics::Material`]; where they come from and go to is no concern of this crate.
//!
//! | module | does |
//! |---|---|
//! | [`mod@check`] | recomputes the printed totals and names the rows that do not follow |
//! | [`mod@merge`] | concatenates tables and refuses contradictions |
//! | [`mod@derived`] | lengths, albedo and total of a row |

pub mod check;
pub mod derived;
pub mod merge;

pub use check::{Fault, Finding, Rounding, check};
pub use derived::{Derived, albedo_without_surface, derived};
pub use merge::{Conflict, Place, keep_all, merge};

use physics::DiffuseFresnel;

/// The F_dr by which a model's total follows from its coefficients, or `None` for a model whose
/// total is not the dipole's.
pub fn fresnel_of(model: &str) -> Option<DiffuseFresnel> {
    match model {
        "jensen2001" => Some(DiffuseFresnel::RationalFit),
        "dipole" => Some(DiffuseFresnel::Exact),
        _ => None,
    }
}

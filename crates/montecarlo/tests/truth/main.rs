//! The walks against what others have found: closed forms, adding-doubling, MCML, and each other.

mod closed_forms;
mod engine;
mod mcml;
mod reference;
mod statistics;
mod totals;
mod walks;

//! Light in a half-space as the transport equation has it: exact, noiseless, and fast enough to
//! be fitted.
//!
//! [`TransportModel`] is the model: `monte-carlo` among the models of a fit, because a Monte Carlo
//! simulation of infinitely many photons would give it. It reads a table that ships with
//! beamspot. [`Surface`] and [`Interior`] are the solver that fills the table ([`build`]), and
//! answer for one medium in a tenth of a second.
//!
//! It leaves out layers, beams that are not a pencil along the normal, phase functions other
//! than Henyey and Greenstein's, and rough boundaries: `montecarlo` has those.
//!
//! | module | holds |
//! |---|---|
//! | `model` | [`TransportModel`]: the table as a [`physics::ForwardModel`] |
//! | `table` | what the table holds, and how it is made |
//! | `reference` | the closed form that the table corrects |
//! | `grid` | nodes and splines between them |
//! | `solver` | the equation solved: spherical harmonics in transverse frequency |

mod grid;
mod model;
mod reference;
mod solver;
mod table;

pub use model::{Domain, OutOfTable, TransportFamily, TransportModel};
pub use solver::{At, Interior, Solution, Surface};
pub use table::{BadTable, build};

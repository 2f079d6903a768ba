//! Plane layers solved without photons.
//!
//! [`solve`] gives reflectance and transmittance of a stack of layers, in total and by angle,
//! by adding and doubling: exact for plane layers but for the number of directions, without noise,
//! in milliseconds. It is a witness beside Monte Carlo and the first-order formulas.
//!
//! It leaves out everything that depends on position across the surface (that is what
//! `montecarlo` and `transport` are for) and on azimuth: what it says of an angle is the mean over
//! azimuth.
//!
//! | module | holds |
//! |---|---|
//! | `directions` | the directions in which light is followed |
//! | `operator` | how light of one set of directions becomes light of another |
//! | `slab` | one homogeneous layer: a thin start, doubled |
//! | `stack` | layers and surfaces added up: [`solve`], [`Response`] |
//! | `sphere` | the way back: [`SphereSample`] to σₐ, σₛ and g |
//!
//! ```
//! use physics::{LayeredMedium, Medium};
//!
//! // Giovanelli's half-space: 0.259919, of which 0.04 at the surface.
//! let medium = Medium { sigma_a: 0.1, sigma_s: 0.9, g: 0.0, eta: 1.5 };
//! let response = layers::solve(&LayeredMedium::half_space(&medium), &[1.0], &[])?;
//! assert!((response.reflectance[0] - 0.259919).abs() < 1e-5);
//! # Ok::<(), layers::CannotSolve>(())
//! ```

mod directions;
mod operator;
mod slab;
mod sphere;
mod stack;

pub use sphere::{CannotInvert, Found, Inversion, Measured, SphereSample, Third};
pub use stack::{CannotSolve, Response, solve};

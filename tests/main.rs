//! What crosses crates: the floors, the main job, the command line and its answers to bad input.

#![expect(
    clippy::unwrap_used,
    reason = "a failed step of a test is a failed test"
)]

mod beam;
mod camera;
mod floors;
mod geometry;
mod layers;
mod mosaic;
mod recovery;
mod response;
mod stray;
mod transport;

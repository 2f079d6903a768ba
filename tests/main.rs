//! What crosses crates: the floors, the main job, the command line and its answers to bad input.

mod recovery;

//! The tests themselves stand in `main.rs`.

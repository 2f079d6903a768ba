//! Progress out, interruption in.

use crate::error::{Error, Result};

/// Watches a long piece of work and may stop it.
pub trait Monitor: Sync {
    /// A stage of `steps` steps begins.
    fn begin(&self, stage: &str, steps: u64);

    /// One step of the stage is done.
    fn step(&self);

    /// Whether to stop as soon as possible.
    fn stopped(&self) -> bool;

    /// An error if the user wants to stop.
    ///
    /// # Errors
    ///
    /// [`Error::interrupted`].
    fn check(&self) -> Result<()> {
        if self.stopped() {
            Err(Error::interrupted())
        } else {
            Ok(())
        }
    }
}

/// Says nothing and never stops.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Monitor for Silent {
    fn begin(&self, _: &str, _: u64) {}
    fn step(&self) {}
    fn stopped(&self) -> bool {
        false
    }
}

/// Passes interruptions on and says nothing of its progress.
pub(crate) struct Quiet<'a>(pub(crate) &'a dyn Monitor);

impl Monitor for Quiet<'_> {
    fn begin(&self, _: &str, _: u64) {}
    fn step(&self) {}
    fn stopped(&self) -> bool {
        self.0.stopped()
    }
}

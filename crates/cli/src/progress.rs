//! A progress bar on standard error, and the interrupt key.

use indicatif::{ProgressBar, ProgressStyle};
use pipeline::{Error, Kind, Monitor, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Shows progress when standard error is a terminal, and stops when the user interrupts.
pub(crate) struct Bar {
    bar: ProgressBar,
    stop: Arc<AtomicBool>,
}

impl Bar {
    /// A bar with nothing to show yet. From here on an interrupt is answered by the work itself,
    /// which leaves no half-written output.
    pub(crate) fn new() -> Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed))
            .map_err(|e| Error::new(Kind::Fault, e))?;
        let bar = ProgressBar::new(0);
        let style = ProgressStyle::with_template("{msg:10} {wide_bar} {pos}/{len} {eta:>4}")
            .map_err(|e| Error::new(Kind::Fault, e))?;
        bar.set_style(style);
        Ok(Self { bar, stop })
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Monitor for Bar {
    fn begin(&self, stage: &str, steps: u64) {
        self.bar.reset();
        self.bar.set_length(steps);
        self.bar.set_message(stage.to_owned());
    }

    fn step(&self) {
        self.bar.inc(1);
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

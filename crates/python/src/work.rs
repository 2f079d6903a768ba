//! Long work beside an interpreter that stays free, and hears Ctrl-C.

use crate::{raised, refused};
use pipeline::{Kind, Monitor, Result};
use pyo3::exceptions::{PyKeyboardInterrupt, PyOverflowError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// How long a key waits to be heard.
const PATIENCE: Duration = Duration::from_millis(50);

/// Threads for the argument `threads`; those of all where nobody says.
pub(crate) fn pool(threads: Option<&Bound<'_, PyAny>>) -> PyResult<Option<ThreadPool>> {
    let Some(threads) = threads else {
        return Ok(None);
    };
    let number: u16 = threads.extract().map_err(|error: PyErr| {
        if error.is_instance_of::<PyOverflowError>(threads.py()) {
            refused(format!("threads: {threads} is not in 0..=65535"))
        } else {
            error
        }
    })?;
    let pool = ThreadPoolBuilder::new().num_threads(usize::from(number));
    pool.build().map(Some).map_err(refused)
}

/// Told by the thread that hears of signals.
#[derive(Default)]
struct Told(AtomicBool);

impl Monitor for Told {
    fn begin(&self, _: &str, _: u64) {}
    fn step(&self) {}
    fn stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Does `work` on a thread of its own, or in `pool`, while this one listens for Ctrl-C: only the
/// thread that runs Python hears of it.
pub(crate) fn done<T: Send>(
    py: Python<'_>,
    pool: Option<&ThreadPool>,
    work: impl FnOnce(&dyn Monitor) -> Result<T> + Send,
) -> PyResult<T> {
    let told = Told::default();
    let (found, interrupt) = py.detach(|| {
        std::thread::scope(|scope| {
            let (done, wait) = mpsc::channel::<()>();
            let told = &told;
            let worker = scope.spawn(move || {
                // Closed at the end, whatever that is.
                let _done = done;
                match pool {
                    Some(pool) => pool.install(|| work(told)),
                    None => work(told),
                }
            });
            let mut interrupt = None;
            while wait.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
                if interrupt.is_none() {
                    interrupt = Python::attach(|py| py.check_signals().err());
                    told.0.store(interrupt.is_some(), Ordering::Relaxed);
                }
            }
            let found = worker
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            (found, interrupt)
        })
    });
    match (found, interrupt) {
        // A key says how far the work has come; any other signal's exception stays what it is.
        (Err(error), Some(interrupt))
            if error.kind() != Kind::Interrupted
                || interrupt.is_instance_of::<PyKeyboardInterrupt>(py) =>
        {
            Err(raised(&error))
        }
        (_, Some(interrupt)) => Err(interrupt),
        (found, None) => found.map_err(|e| raised(&e)),
    }
}

//! Ctrl-C, while Rust runs.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// How often signals are looked for.
const INTERVAL: Duration = Duration::from_millis(50);

/// Looks for signals now and then, on the thread that calls it.
pub(crate) struct SignalCheck {
    last: Instant,
}

impl SignalCheck {
    /// Begins.
    pub(crate) fn begin() -> Self {
        Self {
            last: Instant::now(),
        }
    }

    /// Has Python handle the signals that came.
    pub(crate) fn look(&mut self) -> PyResult<()> {
        if self.last.elapsed() < INTERVAL {
            return Ok(());
        }
        self.last = Instant::now();
        Python::attach(|py| {
            py.check_signals()?;
            Ok(())
        })
    }
}

/// Does work on a thread of its own, while this one handles signals. What a handler raises calls `stop`, which is to end the work;
/// what a second one raises leaves the work alone.
pub(crate) fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
    stop: impl Fn() + Sync,
) -> PyResult<T> {
    let (done, mut is_done) = channel();
    let worker = thread::Builder::new().spawn(move || {
        // Nobody listens any more after a second interruption.
        let _unheard = done.send(work());
    })?;

    let mut interruption: Option<PyErr> = None;
    loop {
        // By a reference that no other thread has, so that the lock of Python can be released.
        let waiting = &mut is_done;
        match py.detach(move || waiting.recv_timeout(INTERVAL)) {
            Ok(result) => {
                let _joined = py.detach(|| worker.join());
                return interruption.map_or(Ok(result), Err);
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("it panicked; the message is above"));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        if let Err(error) = py.check_signals() {
            if interruption.is_some() {
                return Err(error);
            }
            // What it waits for may need the lock of Python.
            py.detach(&stop);
            interruption = Some(error);
        }
    }
}

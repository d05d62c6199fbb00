//! The simulation, lent to Python for a tick: robots of Python may keep `cars`, which is of use only while their tick runs.

use pyo3::PyResult;
use pyo3::exceptions::PyRuntimeError;

/// The simulation as a robot sees it, whatever its lifetime.
trait ScopedBorrow {
    fn lend(&mut self, borrow: &mut dyn FnMut(&mut robot::Cars<'_>));
}

impl ScopedBorrow for robot::Cars<'_> {
    fn lend(&mut self, borrow: &mut dyn FnMut(&mut robot::Cars<'_>)) {
        borrow(self);
    }
}

scoped_tls_hkt::scoped_thread_local!(
    /// What is lent on this thread, while a robot's tick runs on it.
    static mut LENT: for<'a> &'a mut (dyn ScopedBorrow + 'a)
);

/// Lends the simulation to what is called.
pub(crate) fn lend<T>(cars: &mut robot::Cars<'_>, call: impl FnOnce() -> T) -> T {
    LENT.set(cars, call)
}

/// Uses what is lent.
pub(crate) fn with_cars<T>(using: impl FnOnce(&mut robot::Cars<'_>) -> T) -> PyResult<T> {
    let outside = || {
        PyRuntimeError::new_err(
            "`cars` is lent to a robot for a tick: call it in the robot's methods, on the thread that calls these",
        )
    };
    if !LENT.is_set() {
        return Err(outside());
    }

    let mut using = Some(using);
    let mut result = None;
    LENT.with(|scoped_borrow| {
        scoped_borrow.lend(&mut |cars| result = using.take().map(|using| using(cars)));
    });
    result.ok_or_else(outside)
}

//! A robot of Python as a robot of the SDK.

use std::ffi::CString;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::PyRuntimeWarning;
use pyo3::prelude::*;
use robot::{Action, BadParameters, Panel, Robot, StateVariables};

use crate::cars::Cars;
use crate::error::Interrupted;
use crate::scoped_borrow::lend;
use crate::values::{read_action, variables};

/// The first exception that a robot of this process raised, or that ended what it takes part in.
#[derive(Clone, Default)]
pub(crate) struct FirstException(Arc<Mutex<Option<PyErr>>>);

impl FirstException {
    /// Keeps an exception, unless there is one.
    pub(crate) fn set(&self, error: PyErr) {
        let mut first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        first.get_or_insert(error);
    }

    /// Takes the exception.
    pub(crate) fn take(&self) -> Option<PyErr> {
        let mut first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        first.take()
    }

    /// The exception, which stays.
    pub(crate) fn get(&self) -> Option<PyErr> {
        // The lock of Python first, as where one is set.
        Python::attach(|py| {
            let first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            Some(first.as_ref()?.clone_ref(py))
        })
    }

    fn is_set(&self) -> bool {
        let first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        first.is_some()
    }
}

/// An object of a class of Python that is derived from `cars.Robot`.
pub(crate) struct PythonRobot {
    object: Py<PyAny>,
    senses_bodies: bool,
    senses_ranges: bool,
    is_quick: bool,
    /// What it is given in every tick of an epoch.
    cars: Option<Py<Cars>>,
    failure: FirstException,
}

impl PythonRobot {
    /// Takes a robot. What it raises is kept in `failure`.
    pub(crate) fn new(object: &Bound<'_, PyAny>, failure: &FirstException) -> PyResult<Self> {
        Ok(Self {
            senses_bodies: object.getattr("senses_bodies")?.is_truthy()?,
            senses_ranges: object.getattr("senses_ranges")?.is_truthy()?,
            is_quick: object.getattr("is_quick")?.is_truthy()?,
            object: object.clone().unbind(),
            cars: None,
            failure: failure.clone(),
        })
    }

    /// Calls Python in a tick; `None` if it raised something, with which the robot leaves the run.
    fn call<T>(
        &mut self,
        cars: &mut robot::Cars<'_>,
        call: impl FnOnce(&Bound<'_, PyAny>, &Bound<'_, Cars>) -> PyResult<T>,
    ) -> Option<T> {
        let called = Python::attach(|py| {
            let own = self.cars(py, cars)?;
            let object = self.object.bind(py);
            lend(cars, || call(object, &own))
        });
        match called {
            // What its panel raised, which is called without a way to leave.
            Ok(_) if self.failure.is_set() => cars.give_up("its panel() failed"),
            Ok(result) => return Some(result),
            Err(error) => {
                // The result of a tick that is over is thrown away: there is nothing to complain about.
                let is_over = Python::attach(|py| error.is_instance_of::<Interrupted>(py));
                if !is_over {
                    cars.give_up(error.to_string());
                    self.failure.set(error);
                }
            }
        }

        None
    }

    /// What it is given, made anew for each welcome.
    fn cars<'py>(&mut self, py: Python<'py>, cars: &robot::Cars<'_>) -> PyResult<Bound<'py, Cars>> {
        if let Some(own) = &self.cars {
            return Ok(own.bind(py).clone());
        }

        let text = serde_json::to_string(cars.welcome()).map_err(crate::error::plain)?;
        let read = py.import("cars._data")?.getattr("read_welcome")?;
        let welcome = read.call1((text,))?.unbind();
        let own = Bound::new(
            py,
            Cars::new(welcome, self.senses_bodies, self.senses_ranges),
        )?;
        self.cars = Some(own.clone().unbind());
        Ok(own)
    }
}

/// Warns as Python does. Where warnings are errors, this one is none: the robot goes on.
fn warn(text: &str) {
    Python::attach(|py| {
        let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
        let _is_an_error = PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &text, 0);
    });
}

impl Robot for PythonRobot {
    fn init(&mut self, cars: &mut robot::Cars<'_>) -> Result<(), BadParameters> {
        self.cars = None;
        let refuses = cars.has_earlier_parameters();
        let mut refused = None;
        self.call(cars, |object, own| {
            let begun = object.call_method1("init", (own,)).map(drop);
            match begun {
                Err(error) if refuses && !error.is_instance_of::<Interrupted>(object.py()) => {
                    refused = Some(error.to_string());
                    Ok(())
                }
                begun => begun,
            }
        });
        let Some(reason) = refused else {
            return Ok(());
        };
        let refusal = cars.bad_parameters(reason);
        warn(&format!("{refusal}; it keeps those before"));
        Err(refusal)
    }

    fn tick(&mut self, cars: &mut robot::Cars<'_>) -> Action {
        let action = self.call(cars, |object, cars| {
            read_action(&object.call_method1("tick", (cars,))?)
        });
        action.unwrap_or_else(|| Action::stay(cars))
    }

    fn resume(&mut self, cars: &mut robot::Cars<'_>, last: &StateVariables) {
        self.call(cars, |object, cars| {
            let last = variables(object.py(), last)?;
            object.call_method1("resume", (cars, last)).map(drop)
        });
    }

    fn reseed(&mut self, cars: &mut robot::Cars<'_>) {
        self.call(cars, |object, cars| {
            object.call_method1("reseed", (cars,)).map(drop)
        });
    }

    fn senses_bodies(&self) -> bool {
        self.senses_bodies
    }

    fn senses_ranges(&self) -> bool {
        self.senses_ranges
    }

    fn is_quick(&self) -> bool {
        self.is_quick
    }

    fn panel(&self) -> Panel {
        let panel = Python::attach(|py| {
            let panel = self.object.bind(py).call_method0("panel")?;
            let to_json = py.import("cars.panel")?.getattr("to_json")?;
            let text: String = to_json.call1((panel,))?.extract()?;
            serde_json::from_str(&text).map_err(crate::error::plain)
        });
        panel.unwrap_or_else(|error| {
            self.failure.set(error);
            Panel::default()
        })
    }
}

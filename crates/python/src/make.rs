//! Robots of a scenario: those of Python by their names, all others by their classes.

use std::collections::BTreeMap;

use pyo3::prelude::*;
use robot::{Robot, RobotName};
use scenario::Scenario;

use crate::error::UnknownRobot;
use crate::runner::{FirstException, PythonRobot};

/// What makes robots of Python, by their names: classes, or functions without arguments.
pub(crate) struct Makers {
    makers: BTreeMap<String, Py<PyAny>>,
    failure: FirstException,
}

impl Makers {
    /// Takes the makers. What they or their robots raise is kept in `failure`.
    pub(crate) fn new(makers: BTreeMap<String, Py<PyAny>>, failure: &FirstException) -> Self {
        Self {
            makers,
            failure: failure.clone(),
        }
    }

    /// Checks that all of them make robots of the scenario.
    pub(crate) fn check(&self, scenario: &Scenario) -> PyResult<()> {
        for name in self.makers.keys() {
            if !scenario.robots.keys().any(|robot| robot.as_str() == name) {
                let roster: Vec<&str> = scenario.robots.keys().map(RobotName::as_str).collect();
                return Err(UnknownRobot::new_err(format!(
                    "no robot is called {name:?}; the roster is {}",
                    roster.join(", ")
                )));
            }
        }
        Ok(())
    }

    /// Makes a robot; `None` if nothing makes it.
    pub(crate) fn make(&self, name: &RobotName, class: &str) -> Option<Box<dyn Robot>> {
        let Some(maker) = self.makers.get(name.as_str()) else {
            return robots::make(class);
        };

        let made = Python::attach(|py| {
            let object = maker.bind(py).call0()?;
            PythonRobot::new(&object, &self.failure)
        });
        match made {
            Ok(robot) => Some(Box::new(robot)),
            Err(error) => {
                self.failure.set(error);
                None
            }
        }
    }
}

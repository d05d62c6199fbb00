//! Robots of a scenario: those of Python by their names or patterns, all others by their classes.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;

use experiments::{OwnRobots, RobotSource, RunRobots};
use lab::run::RobotMaker;
use protocol::pattern::RobotPattern;
use pyo3::prelude::*;
use robot::{Robot, RobotName};

use crate::error::{UnknownRobot, argument};
use crate::runner::{FirstException, PythonRobot};

/// Longest part of a traceback that is the reason of a failure, bytes: its end.
const MAX_REASON: usize = 2000;

/// What makes robots of Python, by their names or patterns: classes, or functions without arguments.
#[derive(Clone)]
pub(crate) struct Makers(Arc<Vec<(RobotPattern, Py<PyAny>)>>);

impl fmt::Debug for Makers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list()
            .entries(self.0.iter().map(|(of, _)| of))
            .finish()
    }
}

/// Makes the robots of one run. What a maker or its robots raise is kept in `failure`.
pub(crate) struct RunMakers<'a> {
    makers: &'a Makers,
    failure: FirstException,
}

impl Makers {
    /// Takes the makers.
    pub(crate) fn new(makers: BTreeMap<String, Py<PyAny>>) -> PyResult<Self> {
        let mut parsed = Vec::new();
        for (name, maker) in makers {
            let pattern = RobotPattern::new(&name).map_err(|error| argument("robots", error))?;
            parsed.push((pattern, maker));
        }
        Ok(Self(Arc::new(parsed)))
    }

    /// Whether there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The robots of an experiment, with the digests of their programs.
    pub(crate) fn own(&self, digests: BTreeMap<String, String>) -> Option<OwnRobots> {
        (!self.is_empty()).then(|| OwnRobots {
            digests,
            source: Arc::new(self.clone()),
        })
    }

    /// Checks that all of them make robots of a roster, and that no robot is made by two patterns.
    pub(crate) fn check(&self, roster: &BTreeSet<RobotName>) -> PyResult<()> {
        for (of, _) in self.0.iter() {
            if !roster.iter().any(|robot| of.matches(robot)) {
                let names: Vec<&str> = roster.iter().map(RobotName::as_str).collect();
                let what = if of.is_open() {
                    format!("no robot's name matches {:?}", of.as_str())
                } else {
                    format!("no robot is called {:?}", of.as_str())
                };
                return Err(UnknownRobot::new_err(format!(
                    "{what}; the roster is {}",
                    names.join(", ")
                )));
            }
        }

        for robot in roster {
            let matching: Vec<&str> = self.matching(robot).map(|(of, _)| of.as_str()).collect();
            let is_named = matching.contains(&robot.as_str());
            if let [one, other, ..] = matching.as_slice()
                && !is_named
            {
                return Err(argument(
                    "robots",
                    format!(
                        "both {one:?} and {other:?} match {robot}: name it by itself, or make one of them narrower"
                    ),
                ));
            }
        }
        Ok(())
    }

    /// Prepares a run.
    pub(crate) fn of_run(&self, failure: &FirstException) -> RunMakers<'_> {
        RunMakers {
            makers: self,
            failure: failure.clone(),
        }
    }

    /// Prepares a run that goes on from another. What a robot or its maker raises is kept in `failure`.
    pub(crate) fn of_fork(&self, failure: &FirstException) -> RobotMaker {
        let makers = self.clone();
        let failure = failure.clone();
        Arc::new(move |name, class| makers.of_run(&failure).make(name, class))
    }

    /// Prepares a run and its branches. What a robot raises ends its branch only; what a maker raises is kept in `failure`.
    pub(crate) fn of_branches(&self, failure: &FirstException) -> RobotMaker {
        let makers = self.clone();
        let failure = failure.clone();
        Arc::new(move |name, class| {
            let own = FirstException::default();
            let robot = makers.of_run(&own).make(name, class);
            if let (None, Some(error)) = (&robot, own.take()) {
                failure.set(error);
            }
            robot
        })
    }

    fn matching(&self, robot: &RobotName) -> impl Iterator<Item = &(RobotPattern, Py<PyAny>)> {
        self.0.iter().filter(|(of, _)| of.matches(robot))
    }

    /// What makes a robot: a name goes before a pattern.
    fn of(&self, robot: &RobotName) -> Option<&Py<PyAny>> {
        let named = self.matching(robot).find(|(of, _)| !of.is_open());
        let found = named.or_else(|| self.matching(robot).next());
        found.map(|(_, maker)| maker)
    }
}

impl RobotSource for Makers {
    fn begin(&self) -> Box<dyn RunRobots + '_> {
        Box::new(self.of_run(&FirstException::default()))
    }
}

impl RunRobots for RunMakers<'_> {
    fn make(&self, name: &RobotName, class: &str) -> Option<Box<dyn Robot>> {
        let Some(maker) = self.makers.of(name) else {
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

    fn failure(&self) -> Option<String> {
        let error = self.failure.get()?;
        let text = Python::attach(|py| traceback(py, &error));
        Some(text.unwrap_or_else(|_| error.to_string()))
    }
}

/// The end of what Python prints of an exception that is not caught.
fn traceback(py: Python<'_>, error: &PyErr) -> PyResult<String> {
    let lines = py.import("traceback")?.call_method1(
        "format_exception",
        (error.get_type(py), error.value(py), error.traceback(py)),
    )?;
    let lines: Vec<String> = lines.extract()?;
    let text = lines.concat();
    let text = text.trim();

    let mut begin = text.len().saturating_sub(MAX_REASON);
    while !text.is_char_boundary(begin) {
        begin += 1;
    }
    Ok(text[begin..].to_owned())
}

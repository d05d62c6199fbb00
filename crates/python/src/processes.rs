//! Runs whose robots are processes.

use std::path::{Path, PathBuf};
use std::time::Duration;

use bus::runtime::{ONE_THREAD, OWN_SENDER, RUNTIME_VARIABLE};
use config::shipped::{self, LAUNCHES, SCENARIOS};
use experiments::{LaunchText, LaunchUse, Launches, Robots, TICK_PATIENCE};
use launch::child::{self, AtExit};
use launch::{find_sibling, is_launch_file};
use pyo3::prelude::*;

use crate::error::{Error, argument, reported};

/// How processes are used: a launch file instead of that of the scenario, whether each run gets fresh ones, and how long a tick may
/// take, seconds.
#[derive(FromPyObject)]
pub(crate) struct ProcessArguments(Option<PathBuf>, bool, Option<f64>);

impl ProcessArguments {
    /// How the robots of a scenario or launch file are played.
    pub(crate) fn robots(&self, file: &Path) -> PyResult<Robots> {
        let file = self.0.as_deref().unwrap_or(file);
        let file = shipped::find(file, &[LAUNCHES, SCENARIOS]);
        if is_launch_file(&file).unwrap_or(false) {
            let launch = LaunchText::read(&file).map_err(reported)?;
            return Ok(Robots::Launched(launch));
        }
        if self.0.is_some() {
            let place = file.display();
            return Err(argument(
                "processes",
                format!("{place} is not a launch file"),
            ));
        }
        Ok(Robots::Programs)
    }

    /// The launches of an experiment or a hunt.
    pub(crate) fn launches(&self, py: Python<'_>) -> PyResult<Launches> {
        use_one_thread(py)?;
        let cars = find_sibling("cars").ok_or_else(|| {
            Error::new_err(
                "there is no program `cars` beside the interpreter, nor in the folders of PATH",
            )
        })?;
        let tick_patience = match self.2 {
            None => TICK_PATIENCE,
            Some(time_s) => Duration::try_from_secs_f64(time_s)
                .ok()
                .filter(|time| !time.is_zero())
                .ok_or_else(|| argument("tick_patience", "it is more than 0 s"))?,
        };
        let usage = LaunchUse {
            is_fresh: self.1,
            tick_patience,
        };
        let launcher = move || child::cars(AtExit::Terminate, &cars);
        Ok(Launches::new(Box::new(launcher), usage))
    }
}

/// Sets the middleware's threads up, before its first use in this process. The environment is changed through Python, which may.
pub(crate) fn use_one_thread(py: Python<'_>) -> PyResult<()> {
    let chosen = std::env::var(RUNTIME_VARIABLE);
    if chosen.is_err() || chosen.is_ok_and(|chosen| chosen == OWN_SENDER) {
        let environment = py.import("os")?.getattr("environ")?;
        environment.set_item(RUNTIME_VARIABLE, ONE_THREAD)?;
    }
    Ok(())
}

//! What decided a run: as `cars why` finds it, with robots of Python.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use causes::{WhyOptions, why as find_out};
use config::Changes;
use lab::folder::{recorded_epoch, run_name};
use pyo3::prelude::*;
use record::RunFolder;
use scenario::Scenario;

use crate::error::{read, reported};
use crate::interrupt::interruptible;
use crate::make::Makers;
use crate::runner::FirstException;

/// Finds out what decided the last epoch of a run, and writes the answer into its folder. Returns what was asked.
#[pyfunction]
#[pyo3(signature = (run, question, *, budget, jobs, robots))]
pub(crate) fn why(
    py: Python<'_>,
    run: PathBuf,
    question: Option<String>,
    budget: Option<&str>,
    jobs: Option<usize>,
    robots: BTreeMap<String, Py<PyAny>>,
) -> PyResult<String> {
    let makers = Makers::new(robots)?;
    let budget = read("budget", budget)?;
    let folder = RunFolder::at(run);
    let files = recorded_epoch(&folder, None).map_err(reported)?;
    let scenario = Scenario::load(&files.scenario, &Changes::default()).map_err(reported)?;
    makers.check(&scenario.robots.into_keys().collect())?;

    let failure = FirstException::default();
    let make = makers.of_branches(&failure);
    let stop = Arc::new(AtomicBool::new(false));
    let is_stopped = stop.clone();
    let jobs = jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let work = move || {
        let options = WhyOptions {
            what: question,
            budget,
            jobs,
            make,
            stop: &stop,
        };
        find_out(&folder, &run_name(&folder), &files, &options, &mut |_| {})
    };
    let found = interruptible(py, work, || is_stopped.store(true, Ordering::Relaxed))?;
    // What a maker raised is the reason why its robots are not there.
    if let Some(error) = failure.take() {
        return Err(error);
    }
    let (answer, _) = found.map_err(reported)?;
    Ok(answer.question.words().to_owned())
}

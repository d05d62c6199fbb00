//! Runs: as `cars run` and `cars export` do them.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ::export::{ExportError, tables};
use config::shipped::{self, LAUNCHES, SCENARIOS};
use config::units::Time;
use config::{Override, Speed, seed};
use experiments::RunRobots;
use lab::LabError;
use lab::folder::{find as find_folder, read_summary, recorded_epochs};
use lab::run::{check_faults, execute_with};
use launch::{RunOptions, scenario_file};
use pyo3::prelude::*;
use record::{IfTaken, RunFolder};
use scenario::Scenario;

use crate::error::{argument, plain, read, reported};
use crate::interrupt::SignalCheck;
use crate::make::Makers;
use crate::runner::FirstException;

/// Changes of a scenario, each as after `--set`.
pub(crate) fn overrides(set: &[String]) -> PyResult<Vec<Override>> {
    let mut changes = Vec::new();
    for change in set {
        changes.push(change.parse().map_err(|error| argument("set", error))?);
    }
    Ok(changes)
}

/// Runs a scenario in this process. Returns the folder of the run and its summary as JSON.
#[pyfunction]
#[pyo3(signature = (file, *, seed, set, duration, speed, name, replace, out, robots))]
#[expect(clippy::too_many_arguments, reason = "they are named in Python")]
pub(crate) fn run(
    py: Python<'_>,
    file: PathBuf,
    seed: Option<u64>,
    set: Vec<String>,
    duration: Option<&str>,
    speed: Option<&str>,
    name: Option<&str>,
    replace: bool,
    out: PathBuf,
    robots: BTreeMap<String, Py<PyAny>>,
) -> PyResult<(PathBuf, String)> {
    let options = RunOptions {
        run: read("name", name)?,
        if_taken: if replace {
            IfTaken::Replace
        } else {
            IfTaken::Number
        },
        seed: seed
            .map(seed::check)
            .transpose()
            .map_err(|error| argument("seed", error))?,
        duration: read::<Time>("duration", duration)?,
        speed: read::<Speed>("speed", speed)?,
        out,
        set: overrides(&set)?,
    };

    let failure = FirstException::default();
    let makers = Makers::new(robots)?;
    py.detach(|| play(&file, &options, &makers, &failure))
}

fn play(
    file: &Path,
    options: &RunOptions,
    makers: &Makers,
    failure: &FirstException,
) -> PyResult<(PathBuf, String)> {
    let scenario = scenario_of(file)?;
    let scenario = Scenario::load(&scenario, &options.changes()).map_err(reported)?;
    makers.check(&scenario.robots.keys().cloned().collect())?;
    check_faults(&scenario, 0).map_err(reported)?;
    let run = options.run_name(file).map_err(reported)?;
    let made = options.folder(&run, &scenario).map_err(reported)?;
    let folder = &made.folder;
    let speed = options.speed.and_then(|speed| speed.0);

    let watch = RefCell::new(SignalCheck::begin());
    let goes_on = || {
        watch.borrow_mut().look().map_err(|error| {
            failure.set(error);
            LabError::Interrupted
        })
    };
    let robots = makers.of_run(failure);
    let make = |name: &_, class: &_| robots.make(name, class);
    let played = execute_with(scenario, &made.run, folder, speed, &make, goes_on)
        .inspect_err(|_| made.undo_unless_begun());
    // What Python raised is the reason, whatever became of it on its way.
    if let Some(error) = failure.take() {
        return Err(error);
    }
    let summary = played.map_err(reported)?;
    let summary = serde_json::to_string(&summary).map_err(plain)?;
    Ok((folder.path().to_owned(), summary))
}

/// The scenario file that a person means by the path of a scenario or launch file, or by the name of one that comes with the
/// programs.
pub(crate) fn scenario_of(given: &Path) -> PyResult<PathBuf> {
    let file = shipped::find(given, &[LAUNCHES, SCENARIOS]);
    scenario_file(&file).map_err(reported)
}

/// Finds the folder of a run by its name under `out`, or by its path. Returns it, and its summary as JSON if it has one.
#[pyfunction]
pub(crate) fn find(out: PathBuf, run: PathBuf) -> PyResult<(PathBuf, Option<String>)> {
    let folder = find_folder(&out, &run).map_err(reported)?;
    recorded_epochs(&folder).map_err(reported)?;
    let summary = read_summary(&folder).map_err(reported)?;
    let summary = summary.map(|summary| serde_json::to_string(&summary));
    let summary = summary.transpose().map_err(plain)?;
    Ok((folder.path().to_owned(), summary))
}

/// Writes the tables of a run to a folder, as CSV. Returns what they leave out, a sentence each.
#[pyfunction]
pub(crate) fn export(py: Python<'_>, run: PathBuf, into: PathBuf) -> PyResult<Vec<String>> {
    let exported = py.detach(|| {
        let epochs = recorded_epochs(&RunFolder::at(run))?;
        tables::write(&epochs, &into).map_err(|error| match error {
            ExportError::Read(error) => error.into(),
            ExportError::File(error) => error.into(),
            ExportError::Write(error) => LabError::failed(error),
        })
    });
    let mut exported = exported.map_err(reported)?;
    exported.notes.append(&mut exported.damage);
    Ok(exported.notes)
}

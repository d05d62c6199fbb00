//! Forks: as `cars fork` makes them, with robots of Python.

use std::collections::BTreeMap;
use std::path::PathBuf;

use config::Changes;
use config::units::Time;
use lab::LabError;
use lab::folder::{is_same_place, recorded_epoch, run_name};
use lab::fork::Fork;
use lab::moment::Moment;
use launch::RunOptions;
use protocol::RunName;
use pyo3::prelude::*;
use record::{IfTaken, RunFolder};
use scenario::Scenario;

use crate::error::{argument, plain, read, reported};
use crate::interrupt::SignalCheck;
use crate::make::Makers;
use crate::run::overrides;
use crate::runner::FirstException;

/// What a fork changes: settings, its duration, and the seed and the kinds of what is drawn anew.
#[derive(FromPyObject)]
pub(crate) struct ForkChanges(Vec<String>, Option<String>, Option<u64>, Vec<String>);

/// Executes a recorded run up to a tick, and goes on with changes. Returns the folder of the fork and its summary as JSON.
#[pyfunction]
#[pyo3(signature = (run, at, changes, *, name, replace, out, robots))]
#[expect(clippy::too_many_arguments, reason = "they are named in Python")]
pub(crate) fn fork(
    py: Python<'_>,
    run: PathBuf,
    at: &str,
    changes: ForkChanges,
    name: Option<&str>,
    replace: bool,
    out: PathBuf,
    robots: BTreeMap<String, Py<PyAny>>,
) -> PyResult<(PathBuf, String)> {
    let makers = Makers::new(robots)?;
    let ForkChanges(set, duration, seed, reseed) = changes;
    let named: Option<RunName> = read("name", name)?;
    let duration: Option<Time> = read("duration", duration.as_deref())?;
    let moment: Moment = at.parse().map_err(|error| argument("at", error))?;
    let mut kinds = Vec::new();
    for kind in &reseed {
        kinds.push(kind.parse().map_err(|error| argument("reseed", error))?);
    }

    let parent_folder = RunFolder::at(run);
    let files = recorded_epoch(&parent_folder, None).map_err(reported)?;
    let recorded = Scenario::load(&files.scenario, &Changes::default()).map_err(reported)?;
    makers.check(&recorded.robots.into_keys().collect())?;
    let parent = run_name(&parent_folder);
    let fork = Fork {
        parent: &parent,
        files: &files,
        tick: moment.tick(recorded.tick_s),
        set: overrides(&set)?,
        duration_s: duration.map(|duration| duration.0),
        reseed: seed.map(|seed| (seed, kinds)),
    };

    py.detach(|| {
        let scenario = fork.scenario().map_err(reported)?;
        let run = named.unwrap_or_else(|| fork.name());
        if replace && is_same_place(&out.join(run.as_str()), parent_folder.path()) {
            let reason = format!("the fork would overwrite the run {parent}");
            return Err(argument("replace", reason));
        }
        let if_taken = if replace {
            IfTaken::Replace
        } else {
            IfTaken::Number
        };
        let options = RunOptions {
            run: None,
            if_taken,
            seed: None,
            duration,
            speed: None,
            out,
            set: Vec::new(),
        };
        let made = options.folder(&run, &scenario).map_err(reported)?;

        let failure = FirstException::default();
        let make = makers.of_fork(&failure);
        let mut watch = SignalCheck::begin();
        let goes_on = || {
            watch.look().map_err(|error| {
                failure.set(error);
                LabError::Interrupted
            })
        };
        let executed = fork
            .execute(scenario, &made.run, &made.folder, &make, goes_on)
            .inspect_err(|_| made.undo());
        if let Some(error) = failure.take() {
            return Err(error);
        }
        let summary = serde_json::to_string(&executed.map_err(reported)?).map_err(plain)?;
        Ok((made.folder.path().to_owned(), summary))
    })
}

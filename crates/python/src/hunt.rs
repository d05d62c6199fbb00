//! Hunts: as `cars hunt` makes them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use config::Changes;
use config::units::Time;
use experiments::{Launches, Robots};
use hunts::{FaultClass, HuntBudget, HuntOptions, HuntRobots, Subject, hunt as go};
use pyo3::prelude::*;
use scenario::Scenario;

use crate::error::{argument, plain, read, reported};
use crate::interrupt::interruptible;
use crate::make::Makers;
use crate::processes::ProcessArguments;
use crate::run::{overrides, scenario_of};

/// Draws fault plans until an expectation fails, and shrinks what it finds. Returns the report as JSON.
#[pyfunction]
#[pyo3(signature = (file, *, plans, time, seed, jobs, kinds, longest, expect, shrink_runs, set, out, robots, processes))]
#[expect(clippy::too_many_arguments, reason = "they are named in Python")]
pub(crate) fn hunt(
    py: Python<'_>,
    file: PathBuf,
    plans: Option<u64>,
    time: &str,
    seed: u64,
    jobs: Option<usize>,
    kinds: Vec<String>,
    longest: &str,
    expect: BTreeSet<String>,
    shrink_runs: u64,
    set: Vec<String>,
    out: PathBuf,
    robots: BTreeMap<String, Py<PyAny>>,
    processes: Option<ProcessArguments>,
) -> PyResult<(String, Vec<String>)> {
    let makers = Makers::new(robots)?;
    let time: Time = time.parse().map_err(|error| argument("time", error))?;
    let longest = read::<Time>("longest", Some(longest))?.map_or(0.0, |longest| longest.0);
    if longest <= 0.0 {
        return Err(argument("longest", "a fault lasts for more than 0 s"));
    }
    let budget = match plans {
        Some(plans) => HuntBudget::Plans(plans),
        None => HuntBudget::Time(Duration::try_from_secs_f64(time.0).unwrap_or(Duration::MAX)),
    };
    let mut chosen = Vec::new();
    for kind in &kinds {
        chosen.push(kind.parse().map_err(|error| argument("kinds", error))?);
    }
    if chosen.is_empty() {
        chosen = FaultClass::ALL.to_vec();
    }
    let changes = Changes {
        set: overrides(&set)?,
        ..Changes::default()
    };

    let launches = Arc::new(match &processes {
        None => Launches::none(),
        Some(processes) => processes.launches(py)?,
    });
    let hunted = match &processes {
        None => HuntRobots::InProcess(Arc::new(makers.clone())),
        Some(processes) => {
            let launch = match processes.robots(&file)? {
                Robots::Launched(launch) => Some(launch),
                Robots::InProcess | Robots::Programs => None,
            };
            HuntRobots::Processes(launches.clone(), launch)
        }
    };
    let file = scenario_of(&file)?;
    let scenario = Scenario::load(&file, &changes).map_err(reported)?;
    makers.check(&scenario.robots.into_keys().collect())?;
    let subject = py.detach(|| Subject::load_with(&file, &changes, hunted));
    let subject = subject.map_err(reported)?;

    let stop = Arc::new(AtomicBool::new(false));
    let is_stopped = stop.clone();
    let jobs = jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let work = move || {
        let options = HuntOptions {
            seed,
            budget,
            jobs,
            kinds: chosen,
            longest_s: longest,
            expect,
            shrink_runs,
            out,
            stop: &stop,
        };
        go(&subject, &options, &mut |_| {})
    };
    let report = interruptible(py, work, || is_stopped.store(true, Ordering::Relaxed))?;
    let report = serde_json::to_string(&report.map_err(reported)?).map_err(plain)?;
    Ok((report, launches.remarks()))
}

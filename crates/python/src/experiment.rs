//! Experiments: as `cars experiment run` plays them, with robots in this process.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use config::units::Time;
use experiments::engine::{self, EngineOptions, Queue};
use experiments::{Experiment, Launches, Plan, Provenance, Request, Results, Robots, Store};
use lab::LabError;
use protocol::random::MAX_SEED;
use pyo3::prelude::*;

use crate::error::{argument, read, reported};
use crate::interrupt::interruptible;
use crate::make::Makers;
use crate::processes::ProcessArguments;
use crate::run::{overrides, scenario_of};

/// Plays what has not been played of an experiment, and writes its results into its folder, which is returned with what people may
/// want to know, a sentence each.
#[pyfunction]
#[pyo3(signature = (file, *, out, scenario, seeds, duration, set, jobs, retry_failed, robots, digests, processes))]
#[expect(clippy::too_many_arguments, reason = "they are named in Python")]
pub(crate) fn experiment(
    py: Python<'_>,
    file: PathBuf,
    out: Option<PathBuf>,
    scenario: Option<PathBuf>,
    seeds: Option<Vec<u64>>,
    duration: Option<&str>,
    set: Vec<String>,
    jobs: Option<usize>,
    retry_failed: bool,
    robots: BTreeMap<String, Py<PyAny>>,
    digests: BTreeMap<String, String>,
    processes: Option<ProcessArguments>,
) -> PyResult<(PathBuf, Vec<String>)> {
    let makers = Makers::new(robots)?;
    let duration = read::<Time>("duration", duration)?;
    let set = overrides(&set)?;
    let mut experiment = Experiment::find(&file).map_err(reported)?;
    if let Some(Time(duration_s)) = duration {
        experiment.duration_s = duration_s;
        experiment.duration_span = None;
    }
    if let Some(seeds) = seeds {
        experiment.seeds = checked(seeds)?;
    }
    if let Some(scenario) = scenario {
        experiment.scenario = scenario;
    }
    let (robots, launches) = match &processes {
        None => (Robots::InProcess, Launches::none()),
        Some(processes) => (
            processes.robots(&experiment.scenario)?,
            processes.launches(py)?,
        ),
    };
    experiment.scenario = scenario_of(&experiment.scenario)?;

    let name = file
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let folder = out.unwrap_or_else(|| Path::new(engine::OUT).join(&name));
    let request = Request {
        name,
        experiment,
        set,
        robots,
        own: makers.own(digests),
    };
    let plan = py.detach(|| Plan::new(&request)).map_err(reported)?;
    makers.check(&plan.roster().map_err(reported)?)?;
    let jobs = jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));

    let stopper: Arc<Mutex<Option<Arc<AtomicBool>>>> = Arc::default();
    let is_stopped = stopper.clone();
    let own = folder.clone();
    let played = interruptible(
        py,
        move || play(plan, &launches, &own, jobs, retry_failed, &stopper),
        move || {
            let stopper = is_stopped.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(stopper) = stopper.as_ref() {
                stopper.store(true, Ordering::Relaxed);
            }
        },
    )?;
    Ok((folder, played.map_err(reported)?))
}

/// Seeds as they may be: two or more, each once.
fn checked(seeds: Vec<u64>) -> PyResult<Vec<u64>> {
    let mut sorted = seeds.clone();
    sorted.sort_unstable();
    sorted.dedup();
    let is_usable = sorted.len() == seeds.len() && (2..=100_000).contains(&seeds.len());
    if !is_usable || sorted.last().is_some_and(|last| *last > MAX_SEED) {
        return Err(argument(
            "seeds",
            format!("seeds are 2 to 100000 whole numbers from 0 to {MAX_SEED}, each once"),
        ));
    }
    Ok(seeds)
}

fn play(
    plan: Plan,
    launches: &Launches,
    folder: &Path,
    jobs: usize,
    retries_failed: bool,
    stopper: &Mutex<Option<Arc<AtomicBool>>>,
) -> Result<Vec<String>, LabError> {
    plan.check()?;
    plan.check_begins()?;
    plan.save(folder)?;

    let options = EngineOptions {
        units: 0..plan.units(),
        jobs,
        retries_failed,
    };
    let mut store = Store::open(folder)?;
    let mut queue = Queue::of(&plan, &store, &options);
    *stopper.lock().unwrap_or_else(PoisonError::into_inner) = Some(queue.stopper());
    engine::play(
        &plan,
        folder,
        &mut store,
        &mut queue,
        &options,
        launches,
        &|| {},
    )?;
    if !plan.is_in(folder)? {
        return Err(LabError::refused(format!(
            "another process has written another plan to {}",
            folder.display()
        )));
    }
    Results::of(plan, &store).write(folder)?;
    Provenance::here().write(folder)?;
    Ok(launches.remarks())
}

/// The fields of `cars.Verdict`.
type Judgment = (
    String,
    &'static str,
    Vec<usize>,
    Vec<usize>,
    Vec<usize>,
    Vec<usize>,
);

/// What an experiment expects of every run: name, verdict, and the numbers of the units that fail it, of those in which it is
/// undecided, of those in which it was not asked, and of those in which it was not reached.
#[pyfunction]
pub(crate) fn verdicts(folder: PathBuf) -> PyResult<Vec<Judgment>> {
    let results = Results::load(&folder).map_err(reported)?;
    let mut verdicts = Vec::new();
    for judged in results.judged() {
        let name = judged.expectation.to_owned();
        let verdict = judged.verdict().name();
        verdicts.push((
            name,
            verdict,
            judged.failed,
            judged.undecided,
            judged.not_asked,
            judged.unreached,
        ));
    }
    Ok(verdicts)
}

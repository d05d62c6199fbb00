//! Experiments: as `cars experiment run` plays them, with robots in this process.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use config::units::Time;
use experiments::engine::{self, EngineOptions, Queue};
use experiments::{Experiment, Plan, Provenance, Request, Results, Robots, Store};
use lab::LabError;
use protocol::random::MAX_SEED;
use pyo3::prelude::*;

use crate::error::{argument, read, reported};
use crate::interrupt::interruptible;
use crate::run::{overrides, scenario_of};

/// Plays what has not been played of an experiment, and writes its results into its folder, which is returned with the names of
/// units that cannot be trusted.
#[pyfunction]
#[pyo3(signature = (file, *, out, scenario, seeds, duration, set, jobs, retry_failed))]
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
) -> PyResult<PathBuf> {
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
        robots: Robots::InProcess,
    };
    let jobs = jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));

    let stopper: Arc<Mutex<Option<Arc<AtomicBool>>>> = Arc::default();
    let is_stopped = stopper.clone();
    let own = folder.clone();
    let played = interruptible(
        py,
        move || play(&request, &own, jobs, retry_failed, &stopper),
        move || {
            let stopper = is_stopped.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(stopper) = stopper.as_ref() {
                stopper.store(true, Ordering::Relaxed);
            }
        },
    )?;
    played.map_err(reported)?;
    Ok(folder)
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
    request: &Request,
    folder: &Path,
    jobs: usize,
    retries_failed: bool,
    stopper: &Mutex<Option<Arc<AtomicBool>>>,
) -> Result<(), LabError> {
    let plan = Plan::new(request)?;
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
    // No unit is launched: all robots are in this process.
    let launcher = || Command::new("cars");
    engine::play(
        &plan,
        folder,
        &mut store,
        &mut queue,
        &options,
        &launcher,
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
    Ok(())
}

/// The fields of `cars.Verdict`.
type Judgment = (String, &'static str, Vec<usize>, Vec<usize>, Vec<usize>);

/// What an experiment expects of every run: name, verdict, and the numbers of the units that fail it, of those in which it is
/// undecided, and of those in which it was not asked.
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
        ));
    }
    Ok(verdicts)
}

//! Plays the units of an experiment that have not been played, on this machine.

use std::collections::BTreeSet;
use std::fs::File;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use config::FileError;
use lab::LabError;
use record::folder::check_no_links;
use xxhash_rust::xxh3::xxh3_64;

use super::launches::Launches;
use super::plan::{FILE, PLAN, Plan, Robots, UNITS, Unit};
use super::provenance::PROVENANCE;
use super::results::{RESULTS, RUNS};
use super::store::Store;
use super::unit::{Played, UnitResult};
use export::draft::unwritable;

/// Name of the threads that play units.
pub const WORKER: &str = "units";
/// Where the folders of experiments are made.
pub const OUT: &str = "runs/experiments";
/// How often other processes' units are read.
const REFRESH: Duration = Duration::from_secs(2);
/// File that the first of several processes on a folder locks.
const LOCK: &str = "first.lock";

/// What is played, and how.
#[derive(Debug, Clone)]
pub struct EngineOptions {
    /// Numbers of the units.
    pub units: Range<usize>,
    /// Number of units at the same time; the results do not depend on it.
    pub jobs: usize,
    /// Whether units that failed are played again.
    pub retries_failed: bool,
}

/// Units to be played in the order of their numbers.
#[derive(Debug)]
pub struct Queue {
    units: Vec<usize>,
    next: AtomicUsize,
    is_stopped: Arc<AtomicBool>,
}

/// What the workers share.
struct Shared<'a> {
    plan: &'a Plan,
    queue: &'a Queue,
    retries_failed: bool,
    launches: &'a Launches,
    store: Mutex<Current<'a>>,
}

struct Current<'a> {
    store: &'a mut Store,
    refreshed: Instant,
    error: Option<FileError>,
}

impl Queue {
    /// The units that have not been played. Of units that are the same run, it has the first.
    #[must_use]
    pub fn of(plan: &Plan, store: &Store, options: &EngineOptions) -> Self {
        let mut units = Vec::new();
        let mut keys = BTreeSet::new();
        for number in options.units.clone() {
            let unit = plan.unit(number);
            let is_open = is_open(store, &unit, options.retries_failed);
            if is_open && keys.insert(unit.key) {
                units.push(number);
            }
        }

        Self {
            units,
            next: AtomicUsize::new(0),
            is_stopped: Arc::default(),
        }
    }

    /// The numbers of the units.
    #[must_use]
    pub fn units(&self) -> &[usize] {
        &self.units
    }

    /// What stops the playing of the queue from another thread: set to true, it lets no further unit begin. Those that are being
    /// played come to their end.
    #[must_use]
    pub fn stopper(&self) -> Arc<AtomicBool> {
        self.is_stopped.clone()
    }

    fn next(&self) -> Option<usize> {
        if self.is_stopped.load(Ordering::Relaxed) {
            return None;
        }
        let place = self.next.fetch_add(1, Ordering::Relaxed);
        self.units.get(place).copied()
    }
}

/// Plays the units of a queue, and calls `done` after each. Several processes may do so on one folder at the same time: each
/// leaves out what it sees that another one has played.
///
/// # Errors
/// If a unit cannot be noted. That a unit fails is noted, and is no error.
pub fn play(
    plan: &Plan,
    folder: &Path,
    store: &mut Store,
    queue: &mut Queue,
    options: &EngineOptions,
    launches: &Launches,
    done: &(impl Fn() + Sync),
) -> Result<(), LabError> {
    let _first = first(folder, queue)?;
    try_arms(plan, store, queue, launches, done)?;
    let shared = Shared {
        plan,
        queue,
        retries_failed: options.retries_failed,
        launches,
        store: Mutex::new(Current {
            store,
            refreshed: Instant::now(),
            error: None,
        }),
    };
    std::thread::scope(|scope| {
        let mut workers = Vec::new();
        for _ in 0..options.jobs.min(shared.queue.units.len()) {
            let worker = std::thread::Builder::new().name(WORKER.to_owned());
            let worker = worker.spawn_scoped(scope, || shared.work(done));
            workers.push(
                worker.map_err(|error| {
                    LabError::failed(format!("no thread can be started: {error}"))
                })?,
            );
        }
        for worker in workers {
            if worker.join().is_err() {
                return Err(LabError::failed(
                    "a worker panicked; the message of the panic is above",
                ));
            }
        }
        Ok(())
    })?;

    let current = shared.store.into_inner();
    let current = current.unwrap_or_else(PoisonError::into_inner);
    if let Some(error) = current.error {
        return Err(error.into());
    }
    current.store.refresh()?;
    Ok(())
}

/// Plays one unit of each arm before all others, if the robots are processes and no unit has been played: what they publish is known
/// only then. A measure that all of them miss is refused before the others are played.
fn try_arms(
    plan: &Plan,
    store: &mut Store,
    queue: &mut Queue,
    launches: &Launches,
    done: &impl Fn(),
) -> Result<(), LabError> {
    if *plan.robots() == Robots::InProcess || queue.units.len() < plan.units() {
        return Ok(());
    }

    let mut tried = Vec::new();
    let mut names = BTreeSet::new();
    for number in &queue.units {
        if names.insert(plan.unit(*number).arm.name.clone()) {
            tried.push(*number);
        }
    }
    let mut played = Vec::new();
    for number in &tried {
        if queue.is_stopped.load(Ordering::Relaxed) {
            return Ok(());
        }
        let unit = plan.unit(*number);
        let result = plan.play(&unit, launches);
        store.add(unit.key, result.clone())?;
        done();
        match result {
            Ok(one) => played.push(one),
            // Why it failed is said at the end.
            Err(_) => {
                queue
                    .units
                    .retain(|other| other > number || !tried.contains(other));
                return Ok(());
            }
        }
    }

    queue.units.retain(|number| !tried.contains(number));
    let played: Vec<&Played> = played.iter().collect();
    if let Some(first) = plan.missing_in_all(&played).first() {
        let (tried, all) = (tried.len(), plan.units());
        return Err(LabError::refused(format!(
            "{first}, in no arm; {tried} of {all} units have been played"
        ))
        .with_help(
            "a robot of a run that is recorded with `cars run` shows what it publishes: `cars export`",
        ));
    }
    Ok(())
}

/// Whether a unit is to be played.
fn is_open(store: &Store, unit: &Unit<'_>, retries_failed: bool) -> bool {
    match store.get(unit.key) {
        None => true,
        Some(Ok(_)) => false,
        Some(Err(_)) => retries_failed,
    }
}

/// Locks the folder for the first process on it. A further one begins elsewhere in the queue, so that they rarely play the same
/// unit at the same time; if they do, both give the same.
fn first(folder: &Path, queue: &mut Queue) -> Result<Option<File>, LabError> {
    if queue.units.is_empty() {
        return Ok(None);
    }

    let path = folder.join(LOCK);
    check_no_links(folder)?;
    let file = File::options().create(true).append(true).open(&path);
    let file = file.map_err(|error| unwritable(&path, &error))?;
    if file.try_lock().is_ok() {
        return Ok(Some(file));
    }

    let begin = xxh3_64(&std::process::id().to_le_bytes()) as usize % queue.units.len();
    queue.units.rotate_left(begin);
    Ok(None)
}

impl Shared<'_> {
    /// Plays units until the queue is empty, or a unit cannot be noted.
    fn work(&self, done: &impl Fn()) {
        while let Some(number) = self.queue.next() {
            let unit = self.plan.unit(number);
            match self.is_open(&unit) {
                None => return,
                Some(false) => {}
                Some(true) => {
                    let result = self.plan.play(&unit, self.launches);
                    self.note(&unit, result);
                }
            }
            done();
        }
    }

    /// Whether a unit is still to be played; `None` after an error.
    fn is_open(&self, unit: &Unit<'_>) -> Option<bool> {
        let mut current = self.store.lock().unwrap_or_else(PoisonError::into_inner);
        if current.error.is_some() {
            return None;
        }

        if current.refreshed.elapsed() >= REFRESH {
            current.refreshed = Instant::now();
            if let Err(error) = current.store.refresh() {
                current.error = Some(error);
                return None;
            }
        }
        Some(is_open(current.store, unit, self.retries_failed))
    }

    fn note(&self, unit: &Unit<'_>, result: UnitResult) {
        let mut current = self.store.lock().unwrap_or_else(PoisonError::into_inner);
        if let Err(error) = current.store.add(unit.key, result) {
            current.error.get_or_insert(error);
        }
    }
}

/// Whether a path is that of a file which an experiment makes in its folder.
#[must_use]
pub fn is_of_experiment(file: &Path) -> bool {
    let Some(folder) = file.parent() else {
        return false;
    };
    // Also of one whose plan is lost, which is made again from its file.
    let is_experiment = |folder: &Path| {
        [PLAN, FILE, LOCK]
            .iter()
            .any(|name| folder.join(name).exists())
    };
    let is_unit = folder.file_name().is_some_and(|name| name == UNITS)
        && folder.parent().is_some_and(is_experiment);
    let is_named = file.file_name().is_some_and(|name| {
        let own = [PLAN, FILE, LOCK, PROVENANCE, RESULTS, RUNS];
        own.iter().any(|own| name == *own)
    });

    is_unit || (is_named && is_experiment(folder))
}

//! Environments of learners: rows of numbers in, rows of numbers out.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use lab::LabError;
use lab::environment::{Design, Environment, RecordMaker, StepEnd};
use launch::RunOptions;
use protocol::RunName;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use record::IfTaken;
use scenario::Scenario;

use crate::error::{argument, read, reported};
use crate::make::Makers;
use crate::run::{overrides, scenario_of};
use crate::runner::FirstException;

/// What an environment says of its run in a step.
mod end {
    pub(super) const TERMINATED: u8 = 1;
    pub(super) const TRUNCATED: u8 = 2;
}

/// Copies of a scenario that are played step by step, on several threads. All rows are one array, of environments and of agents.
#[pyclass(module = "cars._cars", frozen)]
pub(crate) struct Environments {
    copies: Mutex<Vec<EnvironmentCopy>>,
    count: usize,
    threads: usize,
    row: usize,
    action_len: usize,
    agents: usize,
    labels: Vec<String>,
    failure: FirstException,
}

/// One of them, with what it gave last.
struct EnvironmentCopy {
    environment: Environment,
    observations: Vec<f32>,
    rewards: Vec<f32>,
    end: u8,
    /// The seed of the run that follows by itself; none follows without it.
    next_seed: Option<u64>,
    /// By how much it grows from run to run.
    seed_step: u64,
}

#[pymethods]
impl Environments {
    #[new]
    #[pyo3(signature = (file, *, set, duration, design, robots, count, threads))]
    #[expect(clippy::too_many_arguments, reason = "they are named in Python")]
    fn new(
        py: Python<'_>,
        file: PathBuf,
        set: Vec<String>,
        duration: Option<&str>,
        design: &str,
        robots: BTreeMap<String, Py<PyAny>>,
        count: usize,
        threads: usize,
    ) -> PyResult<Self> {
        let design: Design =
            serde_json::from_str(design).map_err(|error| argument("design", error))?;
        let options = RunOptions {
            run: None,
            if_taken: IfTaken::Number,
            seed: None,
            duration: read("duration", duration)?,
            speed: None,
            out: PathBuf::new(),
            set: overrides(&set)?,
        };
        let failure = FirstException::default();
        let makers = Makers::new(robots)?;
        let first = py.detach(|| {
            let scenario = scenario_of(&file)?;
            let scenario = Scenario::load(&scenario, &options.changes()).map_err(reported)?;
            makers.check(&scenario.robots.keys().cloned().collect())?;
            let others = makers.of_fork(&failure);
            let mut copies = Vec::new();
            for _ in 0..count {
                let environment =
                    Environment::new(scenario.clone(), design.clone(), others.clone());
                copies.push(EnvironmentCopy::new(environment.map_err(reported)?));
            }
            Ok::<_, PyErr>(copies)
        })?;

        let Some(EnvironmentCopy { environment, .. }) = first.first() else {
            return Err(argument("count", "at least one environment"));
        };
        Ok(Self {
            count,
            threads: threads.clamp(1, first.len()),
            row: environment.row(),
            action_len: environment.action_len(),
            agents: environment.agent_count(),
            labels: environment.labels(),
            copies: Mutex::new(first),
            failure,
        })
    }

    /// How many numbers an agent perceives.
    #[getter]
    fn row(&self) -> usize {
        self.row
    }

    /// What they are.
    #[getter]
    fn labels(&self) -> Vec<String> {
        self.labels.clone()
    }

    /// How many numbers say what an agent does.
    #[getter]
    fn action_len(&self) -> usize {
        self.action_len
    }

    /// Begins a run of each environment, with a seed for each. Where they follow by themselves, seeds grow by the number of environments.
    /// Returns what agents perceive, and the folders of records: with `out`, runs are recorded there under this name.
    #[pyo3(signature = (seeds, *, follows, out, name))]
    fn reset<'py>(
        &self,
        py: Python<'py>,
        seeds: Vec<u64>,
        follows: bool,
        out: Option<PathBuf>,
        name: Option<&str>,
    ) -> PyResult<(Bound<'py, PyBytes>, Vec<PathBuf>)> {
        let run: Option<RunName> = read("name", name)?;
        if seeds.len() != self.count {
            return Err(argument("seed", "one for each environment"));
        }
        let folders = Mutex::new(Vec::new());
        let record = |scenario: &Scenario| {
            let options = RunOptions {
                run: run.clone(),
                if_taken: IfTaken::Number,
                seed: None,
                duration: None,
                speed: None,
                out: out.clone().unwrap_or_default(),
                set: Vec::new(),
            };
            let name = run.clone().unwrap_or_else(RunName::unknown);
            let made = options.folder(&name, scenario)?;
            let path = made.folder.path().to_owned();
            folders
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .push(path);
            Ok(made)
        };
        let record: Option<&RecordMaker> = out.is_some().then_some(&record);

        let step = seeds.len() as u64;
        // Locked only while Python is let go: a thread that waits for the lock must not keep a robot of Python from running.
        let begun = py.detach(|| {
            let mut copies = self.lock();
            self.each(&mut copies, &|index, copy| {
                copy.seed_step = step;
                copy.next_seed = follows.then(|| seed_after(seeds[index], step));
                copy.reset(seeds[index], record)
            })?;
            Ok(numbers(&copies, |copy| &copy.observations))
        });
        let observations = PyBytes::new(py, &self.finish(begun)?);
        let folders = folders.into_inner();
        Ok((
            observations,
            folders.unwrap_or_else(PoisonError::into_inner),
        ))
    }

    /// The numbers that the measures of the scenario have so far in an environment.
    fn measures(&self, py: Python<'_>, index: usize) -> PyResult<BTreeMap<String, f64>> {
        let numbers = py.detach(|| {
            let copies = self.lock();
            let session = copies.get(index)?.environment.session()?;
            Some(session.simulation().measurements().numbers())
        });
        numbers.ok_or_else(not_begun)
    }

    /// Width and height of the field, the side of a body, and all bodies in an environment; lengths in meters.
    fn scene(&self, py: Python<'_>, index: usize) -> PyResult<(f64, f64, f64, Vec<SceneBody>)> {
        let scene = py.detach(|| {
            let copies = self.lock();
            let environment = &copies.get(index)?.environment;
            let simulation = environment.session()?.simulation();
            let hall = simulation.scenario().hall();
            let mut bodies = Vec::new();
            for at in &hall.obstacles {
                bodies.push(("obstacle", String::new(), at.x, at.y));
            }
            for (number, at) in simulation.shown_guests() {
                bodies.push(("guest", number.to_string(), at.x, at.y));
            }
            for robot in simulation.names() {
                let kind = if environment.is_agent(robot) {
                    "agent"
                } else {
                    "robot"
                };
                let at = simulation.location(robot)?;
                bodies.push((kind, robot.to_string(), at.x, at.y));
            }
            let (width_m, height_m) = hall.field.size_m;
            Some((width_m, height_m, hall.field.body_m, bodies))
        });
        scene.ok_or_else(not_begun)
    }

    /// Plays a step of each environment. `actions` are the numbers of all agents, float32. Returns what they perceive, their rewards
    /// (float32), and for each environment whether its run is terminated (1) or truncated (2).
    fn step<'py>(
        &self,
        py: Python<'py>,
        actions: &[u8],
    ) -> PyResult<(
        Bound<'py, PyBytes>,
        Bound<'py, PyBytes>,
        Bound<'py, PyBytes>,
    )> {
        let expected = self.count * self.agents * self.action_len;
        let numbers_of = actions.as_chunks().0.iter();
        let actions: Vec<f32> = numbers_of.map(|bytes| f32::from_le_bytes(*bytes)).collect();
        if actions.len() != expected {
            let given = actions.len();
            return Err(argument(
                "actions",
                format!("{expected} numbers are expected, not {given}"),
            ));
        }

        let own = self.agents * self.action_len;
        let stepped = py.detach(|| {
            let mut copies = self.lock();
            self.each(&mut copies, &|index, copy| {
                copy.step(&actions[index * own..][..own])
            })?;
            let ends: Vec<u8> = copies.iter().map(|copy| copy.end).collect();
            Ok((
                numbers(&copies, |copy| &copy.observations),
                numbers(&copies, |copy| &copy.rewards),
                ends,
            ))
        });
        let (observations, rewards, ends) = self.finish(stepped)?;
        Ok((
            PyBytes::new(py, &observations),
            PyBytes::new(py, &rewards),
            PyBytes::new(py, &ends),
        ))
    }
}

/// A body: what it is, its name if it is a robot, and its center, meters.
type SceneBody = (&'static str, String, f64, f64);

impl Environments {
    fn lock(&self) -> MutexGuard<'_, Vec<EnvironmentCopy>> {
        self.copies.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does something with each environment, on all threads. Which thread it is makes no difference: environments share nothing.
    fn each(
        &self,
        copies: &mut [EnvironmentCopy],
        what: &(dyn Fn(usize, &mut EnvironmentCopy) -> Result<(), LabError> + Sync),
    ) -> Result<(), LabError> {
        let part = copies.len().div_ceil(self.threads);
        if self.threads == 1 {
            return do_each(copies, 0, what);
        }

        std::thread::scope(|scope| {
            let mut threads = Vec::new();
            for (number, part_of) in copies.chunks_mut(part).enumerate() {
                threads.push(scope.spawn(move || do_each(part_of, number * part, what)));
            }
            // The error of the first environment that has one, whichever was first in time.
            let mut done = Ok(());
            for thread in threads {
                let part_done = thread
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
                done = done.and(part_done);
            }
            done
        })
    }

    /// What Python raised is the reason, whatever became of it on its way.
    fn finish<T>(&self, done: Result<T, LabError>) -> PyResult<T> {
        match self.failure.take() {
            Some(error) => Err(error),
            None => done.map_err(reported),
        }
    }
}

/// The seed that is this much later; after the last one, 2^53 - 1, comes 0, as in `cars.rl`.
fn seed_after(seed: u64, step: u64) -> u64 {
    seed.wrapping_add(step) % (1 << 53)
}

fn not_begun() -> PyErr {
    reported(LabError::refused("no run has begun").with_help("call reset() first"))
}

fn do_each(
    copies: &mut [EnvironmentCopy],
    first: usize,
    what: &(dyn Fn(usize, &mut EnvironmentCopy) -> Result<(), LabError> + Sync),
) -> Result<(), LabError> {
    for (index, copy) in copies.iter_mut().enumerate() {
        what(first + index, copy)?;
    }
    Ok(())
}

fn numbers(copies: &[EnvironmentCopy], of: impl Fn(&EnvironmentCopy) -> &Vec<f32>) -> Vec<u8> {
    let all = copies.iter().flat_map(of);
    all.flat_map(|number| number.to_le_bytes()).collect()
}

impl EnvironmentCopy {
    fn new(environment: Environment) -> Self {
        let agents = environment.agent_count();
        Self {
            observations: vec![0.0; agents * environment.row()],
            rewards: vec![0.0; agents],
            end: 0,
            next_seed: None,
            seed_step: 0,
            environment,
        }
    }

    fn reset(&mut self, seed: u64, record: Option<&RecordMaker>) -> Result<(), LabError> {
        self.end = 0;
        self.rewards.fill(0.0);
        self.environment.reset(seed, record, &mut self.observations)
    }

    /// Plays a step, or begins the run that follows one that is over.
    fn step(&mut self, actions: &[f32]) -> Result<(), LabError> {
        if let (true, Some(seed)) = (self.end != 0, self.next_seed) {
            self.next_seed = Some(seed_after(seed, self.seed_step));
            return self.reset(seed, None);
        }

        let end: StepEnd =
            self.environment
                .step(actions, &mut self.observations, &mut self.rewards)?;
        self.end = match end {
            StepEnd {
                is_terminated: true,
                ..
            } => end::TERMINATED,
            StepEnd {
                is_truncated: true, ..
            } => end::TRUNCATED,
            StepEnd { .. } => 0,
        };
        Ok(())
    }
}

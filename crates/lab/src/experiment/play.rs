//! Plays an experiment: every arm under every condition with every seed, and the estimates over the seeds.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use config::{Changes, Override};
use miette::{IntoDiagnostic, miette};
use protocol::RunName;
use serde::Serialize;
use simulator::{Scenario, Summary};

use super::file::{Arm, Condition, Experiment};
use super::measure::{Probe, as_json};
use crate::run::play;
use crate::statistics::Estimate;

/// Options of an experiment.
#[derive(Debug, Clone)]
pub struct Options {
    /// The scenario, which replaces the experiment's own.
    pub scenario: PathBuf,
    /// Number of runs of each arm under each condition.
    pub seeds: u64,
    /// Number of runs at the same time; the result does not depend on it.
    pub jobs: usize,
    /// Further changes of the scenario in every arm.
    pub set: Vec<Override>,
}

/// Measures of one run.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// Name of the condition.
    pub condition: String,
    /// Name of the arm.
    pub arm: String,
    /// Seed of the run.
    pub seed: u64,
    /// Digest of the run.
    pub digest: String,
    /// The measures, by name.
    #[serde(flatten)]
    pub measures: BTreeMap<String, f64>,
}

/// Estimates over all runs of an arm under one condition.
#[derive(Debug, Clone, Serialize)]
pub struct Cell {
    /// Name of the condition.
    pub condition: String,
    /// Name of the arm.
    pub arm: String,
    /// Estimates of the measures, by name.
    #[serde(flatten)]
    pub measures: BTreeMap<String, Estimate>,
}

/// One run to be played.
struct Unit<'a> {
    condition: &'a Condition,
    arm: &'a Arm,
    seed: u64,
}

/// The runs of an experiment; each is taken by one worker.
struct Queue<'a> {
    units: &'a [Unit<'a>],
    next: AtomicUsize,
}

impl<'a> Queue<'a> {
    /// The next run and its index.
    fn next(&self) -> Option<(usize, &'a Unit<'a>)> {
        let index = self.next.fetch_add(1, Ordering::Relaxed);
        let unit = self.units.get(index)?;
        Some((index, unit))
    }
}

impl Experiment {
    /// Number of runs that [`Self::play`] makes.
    #[must_use]
    pub fn runs(&self, options: &Options) -> u64 {
        let cells = self.factor.values.len() * self.arms.len();
        cells as u64 * options.seeds
    }

    /// Plays every run of the experiment and calls `played` after each. The order of the outcomes does not depend on the
    /// number of jobs.
    ///
    /// # Errors
    /// If a scenario cannot be used or a run fails; the first one in the order of the outcomes.
    pub fn play(
        &self,
        options: &Options,
        played: &(impl Fn() + Sync),
    ) -> miette::Result<Vec<Outcome>> {
        let conditions = self.conditions().map_err(|reason| miette!("{reason}"))?;
        let units = self.units(&conditions, options.seeds);

        // An error in the scenario is reported once, before anything starts.
        if let Some(unit) = units.first() {
            self.scenario(options, unit)?;
        }

        let queue = Queue {
            units: &units,
            next: AtomicUsize::new(0),
        };
        let mut done = std::thread::scope(|scope| {
            let mut workers = Vec::new();
            for _ in 0..options.jobs {
                workers.push(scope.spawn(|| self.work(options, &queue, played)));
            }

            let mut done = Vec::new();
            for worker in workers {
                done.extend(worker.join().map_err(|_| panicked())?);
            }
            miette::Result::<_>::Ok(done)
        })?;

        done.sort_by_key(|(index, _)| *index);
        done.into_iter().map(|(_, outcome)| outcome).collect()
    }

    fn units<'a>(&'a self, conditions: &'a [Condition], seeds: u64) -> Vec<Unit<'a>> {
        let mut units = Vec::new();
        for condition in conditions {
            for arm in &self.arms {
                for seed in 1..=seeds {
                    units.push(Unit {
                        condition,
                        arm,
                        seed,
                    });
                }
            }
        }
        units
    }

    /// Plays units of the queue until it is empty; returns outcomes with the indices of their units.
    fn work(
        &self,
        options: &Options,
        queue: &Queue<'_>,
        played: &impl Fn(),
    ) -> Vec<(usize, miette::Result<Outcome>)> {
        let mut done = Vec::new();
        while let Some((index, unit)) = queue.next() {
            done.push((index, self.one(options, unit)));
            played();
        }
        done
    }

    fn scenario(&self, options: &Options, unit: &Unit<'_>) -> miette::Result<Scenario> {
        let mut set = options.set.clone();
        set.extend(unit.arm.set.iter().cloned());
        set.extend(unit.condition.set.iter().cloned());
        let no_frames = "record.frames=false".parse();
        set.push(no_frames.map_err(|reason| miette!("{reason}"))?);

        let changes = Changes {
            seed: Some(unit.seed),
            duration_s: Some(self.duration_s),
            set,
        };

        Ok(Scenario::load(&options.scenario, &changes)?)
    }

    fn one(&self, options: &Options, unit: &Unit<'_>) -> miette::Result<Outcome> {
        let run = RunName::new("experiment").into_diagnostic()?;
        let mut summary = None;
        let mut probes = Vec::new();
        for measure in &self.measures {
            probes.push((&measure.name, Probe::new(measure, unit.condition.time_s)));
        }

        let scenario = self.scenario(options, unit)?;
        let simulation = play(scenario, &run, |simulation, record| {
            let summary = summary.get_or_insert_with(|| Summary::begin(&run, simulation));
            for line in record.lines() {
                summary.count(simulation, &line);
            }
            for (_, probe) in &mut probes {
                probe.tick(simulation, record);
            }
            Ok(())
        })?;
        let mut summary = summary.ok_or_else(|| miette!("the run has not begun"))?;
        summary.finish(&simulation);

        let json = as_json(&summary).into_diagnostic()?;
        let mut measures = BTreeMap::new();
        for (name, probe) in probes {
            let value = probe
                .value(&json)
                .map_err(|error| miette!("{}: {error}", options.scenario.display()))?;
            measures.insert(name.clone(), value);
        }
        Ok(Outcome {
            condition: unit.condition.name.clone(),
            arm: unit.arm.name.clone(),
            seed: unit.seed,
            digest: summary.digest.clone(),
            measures,
        })
    }

    /// Means and intervals over the seeds, one cell for each arm under each condition.
    #[must_use]
    pub fn estimate(&self, outcomes: &[Outcome]) -> Vec<Cell> {
        let mut cells = Vec::new();
        for value in &self.factor.values {
            for arm in &self.arms {
                cells.push(self.cell(value.to_string(), arm, outcomes));
            }
        }
        cells
    }

    fn cell(&self, condition: String, arm: &Arm, outcomes: &[Outcome]) -> Cell {
        let mut runs = Vec::new();
        for run in outcomes {
            if run.condition == condition && run.arm == arm.name {
                runs.push(run);
            }
        }

        let mut measures = BTreeMap::new();
        for measure in &self.measures {
            let values = runs.iter().map(|run| run.measures[&measure.name]);
            let values: Vec<f64> = values.collect();
            measures.insert(measure.name.clone(), Estimate::of(&values));
        }
        Cell {
            condition,
            arm: arm.name.clone(),
            measures,
        }
    }

    /// Describes the runs and the arms, for people.
    #[must_use]
    pub fn compared(&self, options: &Options) -> String {
        let seeds = options.seeds;
        let mut text = format!(
            "{}: {seeds} runs of {} s for each line, seeds 1 to {seeds}. Runs with the same seed begin alike\n\
             and have the same chance in every arm. {}\n\
             Mean and 95 % confidence interval over the seeds.\n\n",
            options.scenario.display(),
            self.duration_s,
            self.explained(),
        );
        for arm in &self.arms {
            text += &format!("  {:<13} {}\n", arm.name, arm.what);
        }

        text
    }
}

fn panicked() -> miette::Report {
    miette!("a run panicked; the message of the panic is above")
}

//! Playing an experiment: every arm under every condition with every seed, and what it came to.

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

/// How an experiment is played.
#[derive(Debug, Clone)]
pub struct Options {
    /// The scenario, instead of the experiment's own.
    pub scenario: PathBuf,
    /// Runs of each arm under each condition.
    pub seeds: u64,
    /// Runs at the same time; the result does not depend on it.
    pub jobs: usize,
    /// Further changes of the scenario, in every arm.
    pub set: Vec<Override>,
}

/// What came of one run.
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

/// What came of all runs of an arm under one condition.
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

impl Experiment {
    /// Number of runs that [`Self::play`] makes.
    #[must_use]
    pub fn runs(&self, options: &Options) -> u64 {
        let cells = self.factor.values.len() * self.arms.len();
        cells as u64 * options.seeds
    }

    /// Plays every run of the experiment; `played` is called after each. The outcomes are in a fixed order whatever the
    /// number of jobs.
    ///
    /// # Errors
    /// The first scenario that cannot be used, or run that fails, in that order.
    pub fn play(
        &self,
        options: &Options,
        played: &(impl Fn() + Sync),
    ) -> miette::Result<Vec<Outcome>> {
        let conditions = self.conditions().map_err(|reason| miette!("{reason}"))?;
        let mut units = Vec::new();
        for condition in &conditions {
            for arm in &self.arms {
                for seed in 1..=options.seeds {
                    units.push(Unit {
                        condition,
                        arm,
                        seed,
                    });
                }
            }
        }

        // A mistake in the scenario is reported once, before anything starts.
        if let Some(unit) = units.first() {
            self.scenario(options, unit)?;
        }

        let next = AtomicUsize::new(0);
        let work = || {
            let mut done = Vec::new();
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(unit) = units.get(index) else {
                    return done;
                };
                done.push((index, self.one(options, unit)));
                played();
            }
        };
        let mut done = std::thread::scope(|scope| {
            let workers: Vec<_> = (0..options.jobs).map(|_| scope.spawn(work)).collect();
            let mut done = Vec::new();
            for worker in workers {
                done.extend(worker.join().map_err(|_| broken())?);
            }
            miette::Result::<_>::Ok(done)
        })?;

        done.sort_by_key(|(index, _)| *index);
        done.into_iter().map(|(_, outcome)| outcome).collect()
    }

    fn scenario(&self, options: &Options, unit: &Unit<'_>) -> miette::Result<Scenario> {
        let mut set = options.set.clone();
        set.extend(unit.arm.set.iter().cloned());
        set.extend(unit.condition.set.iter().cloned());
        set.push(
            "record.frames=false"
                .parse()
                .map_err(|reason| miette!("{reason}"))?,
        );
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
            let condition = value.to_string();
            for arm in &self.arms {
                let runs: Vec<&Outcome> = outcomes
                    .iter()
                    .filter(|run| run.condition == condition && run.arm == arm.name)
                    .collect();
                let mut measures = BTreeMap::new();
                for measure in &self.measures {
                    let values: Vec<f64> =
                        runs.iter().map(|run| run.measures[&measure.name]).collect();
                    measures.insert(measure.name.clone(), Estimate::of(&values));
                }
                cells.push(Cell {
                    condition: condition.clone(),
                    arm: arm.name.clone(),
                    measures,
                });
            }
        }

        cells
    }

    /// What is compared with what, in words.
    #[must_use]
    pub fn compared(&self, options: &Options) -> String {
        let seeds = options.seeds;
        let mut text = format!(
            "{}: {seeds} runs of {} s for each line, seeds 1 to {seeds}. Runs with the same seed begin alike\nand have the same chance, whatever the arm. {}\nMean and 95 % confidence interval over the seeds.\n\n",
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

fn broken() -> miette::Report {
    miette!("a run ended in a panic; its message stands above")
}

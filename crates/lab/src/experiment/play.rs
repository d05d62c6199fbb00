//! Plays an experiment: every arm under every condition with every seed, and the estimates over the seeds.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use config::{Changes, FileError, Override};
use miette::{IntoDiagnostic, miette};
use protocol::RunName;
use serde::Serialize;
use simulator::{Scenario, Summary};

use super::condition::Condition;
use super::file::{Arm, Experiment};
use super::measure::{Probe, as_json};
use super::script::Script;
use crate::run::{check_faults, play};
use crate::statistics::{Estimate, Survival, TimeTo};

/// What the options of an experiment set, instead of a change of the scenario.
const OWN_OPTIONS: [&str; 2] = ["seed", "duration"];

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
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// Name of the condition.
    pub condition: String,
    /// Name of the arm.
    pub arm: String,
    /// Seed of the run.
    pub seed: u64,
    /// Seed of the run whose emotions its robots showed, in a yoked arm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yoked_to_seed: Option<u64>,
    /// Digest of the run.
    pub digest: String,
    /// Times to an event, seconds: of the event where the measure is 1, otherwise of the end of the run.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub times_s: BTreeMap<String, f64>,
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
    /// Times to an event, by measure.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub times: BTreeMap<String, Survival>,
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
    /// Number of outcomes of [`Self::play`].
    ///
    /// # Errors
    /// If a condition cannot be played.
    pub fn runs(&self, options: &Options) -> miette::Result<u64> {
        let conditions = self.list_conditions().map_err(|error| miette!("{error}"))?;
        let cells = conditions.len() * self.arms.len();
        Ok(cells as u64 * options.seeds)
    }

    /// Checks that every arm can be played under every condition.
    ///
    /// # Errors
    /// If a condition cannot be played, two of the changes set the same value, or a scenario cannot be used.
    pub fn check(&self, options: &Options) -> miette::Result<()> {
        let conditions = self.list_conditions().map_err(|error| miette!("{error}"))?;
        for change in &options.set {
            if OWN_OPTIONS.contains(&change.top()) {
                let option = change.top();
                return Err(miette!(
                    help = "use --seeds and --duration",
                    "--set {change} would have no effect: the {option} of a run is the experiment's"
                ));
            }
        }

        for unit in self.units(&conditions, 1) {
            let scenario = self.scenario(options, &unit, &[])?;
            check_faults(&scenario)?;
        }
        Ok(())
    }

    /// Plays every run of the experiment and calls `played` after each. The order of the outcomes does not depend on the
    /// number of jobs.
    ///
    /// # Errors
    /// As [`Self::check`], before anything starts, or if a run fails; the first one in the order of the outcomes.
    pub fn play(
        &self,
        options: &Options,
        played: &(impl Fn() + Sync),
    ) -> miette::Result<Vec<Outcome>> {
        self.check(options)?;
        let conditions = self.list_conditions().map_err(|error| miette!("{error}"))?;
        let units = self.units(&conditions, options.seeds);

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

    /// The scenario of a unit; `script` are the changes that make its robots show the emotions of another run.
    fn scenario(
        &self,
        options: &Options,
        unit: &Unit<'_>,
        script: &[Override],
    ) -> miette::Result<Scenario> {
        let Unit {
            condition,
            arm,
            seed,
        } = unit;
        let sources = [
            ("the option --set".to_owned(), options.set.as_slice()),
            (format!("the arm \"{}\"", arm.name), &arm.set),
            (
                format!("the condition \"{}\"", condition.name),
                &condition.set,
            ),
            (format!("the yoke of \"{}\"", arm.name), script),
        ];
        check_overlaps(&sources)?;

        let mut set = Vec::new();
        for (_, changes) in sources {
            set.extend_from_slice(changes);
        }
        let no_frames = "record.frames=false".parse();
        set.push(no_frames.map_err(|reason| miette!("{reason}"))?);
        let changes = Changes {
            seed: Some(*seed),
            duration_s: Some(self.duration_s),
            set,
        };

        let (arm, condition) = (&arm.name, &condition.name);
        Scenario::load(&options.scenario, &changes).map_err(|error: FileError| {
            miette::Report::new(error).wrap_err(format!("arm \"{arm}\", condition \"{condition}\""))
        })
    }

    fn one(&self, options: &Options, unit: &Unit<'_>) -> miette::Result<Outcome> {
        let mut script = Vec::new();
        let mut yoked_to_seed = None;
        if let Some(other) = &unit.arm.yoked_to {
            let seed = 1 + unit.seed % options.seeds;
            yoked_to_seed = Some(seed);
            script = self.script(options, unit, other, seed)?;
        }

        let run = RunName::new("experiment").into_diagnostic()?;
        let mut summary = None;
        let mut probes = Vec::new();
        let time_s = unit.condition.time_s.unwrap_or((0.0, self.duration_s));
        for measure in &self.measures {
            probes.push((&measure.name, Probe::new(measure, time_s)));
        }

        let scenario = self.scenario(options, unit, &script)?;
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
        let mut times_s = BTreeMap::new();
        for (name, probe) in probes {
            let value = probe
                .value(&json)
                .map_err(|error| miette!("{}: {error}", options.scenario.display()))?;
            measures.insert(name.clone(), value);
            if let Some(time) = probe.time() {
                times_s.insert(name.clone(), time.time_s);
            }
        }
        Ok(Outcome {
            condition: unit.condition.name.clone(),
            arm: unit.arm.name.clone(),
            seed: unit.seed,
            yoked_to_seed,
            digest: summary.digest.clone(),
            times_s,
            measures,
        })
    }

    /// Plays the run of another arm under the same condition, and returns its emotions as changes of a scenario. It is played
    /// again for each yoked run, so that the result does not depend on the order of the runs.
    fn script(
        &self,
        options: &Options,
        unit: &Unit<'_>,
        arm: &str,
        seed: u64,
    ) -> miette::Result<Vec<Override>> {
        let arm = self.arms.iter().find(|other| other.name == *arm);
        let other = Unit {
            condition: unit.condition,
            arm: arm.ok_or_else(|| miette!("the arm of the yoke is missing"))?,
            seed,
        };

        let run = RunName::new("experiment").into_diagnostic()?;
        let scenario = self.scenario(options, &other, &[])?;
        let mut script = Script::default();
        play(scenario, &run, |simulation, record| {
            script.tick(simulation, record);
            Ok(())
        })?;

        script.changes().map_err(|reason| miette!("{reason}"))
    }

    /// Means and intervals over the seeds, one cell for each arm under each condition.
    ///
    /// # Errors
    /// If a condition cannot be played.
    pub fn estimate(&self, outcomes: &[Outcome]) -> miette::Result<Vec<Cell>> {
        let conditions = self.list_conditions().map_err(|error| miette!("{error}"))?;
        let mut cells = Vec::new();
        for condition in conditions {
            for arm in &self.arms {
                cells.push(self.cell(condition.name.clone(), arm, outcomes));
            }
        }
        Ok(cells)
    }

    fn cell(&self, condition: String, arm: &Arm, outcomes: &[Outcome]) -> Cell {
        let mut runs = Vec::new();
        for run in outcomes {
            if run.condition == condition && run.arm == arm.name {
                runs.push(run);
            }
        }

        let mut measures = BTreeMap::new();
        let mut times = BTreeMap::new();
        for measure in &self.measures {
            let name = &measure.name;
            let values: Vec<f64> = runs.iter().map(|run| run.measures[name]).collect();
            measures.insert(name.clone(), Estimate::of(&values));

            let mut sample = Vec::new();
            for run in &runs {
                if let Some(time_s) = run.times_s.get(name) {
                    sample.push(TimeTo {
                        time_s: *time_s,
                        is_event: run.measures[name] > 0.0,
                    });
                }
            }
            if !sample.is_empty() {
                times.insert(name.clone(), Survival::of(&sample));
            }
        }
        Cell {
            condition,
            arm: arm.name.clone(),
            times,
            measures,
        }
    }

    /// Describes the runs, the arms and the conditions, for people.
    ///
    /// # Errors
    /// If a condition cannot be played.
    pub fn compared(&self, options: &Options) -> miette::Result<String> {
        let seeds = options.seeds;
        let mut text = format!(
            "{}: {seeds} runs of {} s for each line, seeds 1 to {seeds}. Runs with the same seed begin alike\n\
             and have the same chance in every arm. {}\n\
             Mean and 95 % confidence interval over the seeds.\n\n",
            options.scenario.display(),
            self.duration_s,
            self.explained(),
        );

        let conditions = self.list_conditions().map_err(|error| miette!("{error}"))?;
        let mut named = Vec::new();
        for arm in &self.arms {
            named.push((&arm.name, &arm.what));
        }
        for condition in &conditions {
            if !condition.what.is_empty() {
                named.push((&condition.name, &condition.what));
            }
        }
        let width = named.iter().map(|(name, _)| name.len()).max();
        let width = width.unwrap_or_default();
        for (name, what) in named {
            text += &format!("  {name:<width$}  {what}\n");
        }

        for measure in &self.measures {
            if let Some(meaning) = measure.explained() {
                text += &format!("\n{meaning}\n");
            }
        }
        Ok(text)
    }
}

/// Checks that no two of these sources set the same value: one would silently override the other.
fn check_overlaps(sources: &[(String, &[Override])]) -> miette::Result<()> {
    for (index, (name, changes)) in sources.iter().enumerate() {
        for (other, others) in &sources[index + 1..] {
            for change in *changes {
                if let Some(overridden) = others.iter().find(|own| own.overlaps(change)) {
                    return Err(miette!(
                        help = "an experiment sets each value in one place",
                        "{name} sets {change}, and {other} sets {overridden}"
                    ));
                }
            }
        }
    }
    Ok(())
}

fn panicked() -> miette::Report {
    miette!("a run panicked; the message of the panic is above")
}

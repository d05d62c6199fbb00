//! The results of an experiment: what was measured in each of its units, and the tables and estimates of them.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::Path;

use config::FileError;
use export::csv::{CsvTable, FieldValue};
use export::draft::{Draft, unwritable};
use lab::LabError;
use protocol::messages::Verdict;
use serde::Serialize;

use super::contrast::Contrast;
use super::estimate::ArmMeasure;
use super::outcome::{FailedUnit, UnitOutcome};
use super::plan::Plan;
use super::store::Store;
use super::unheard::MissingWords;

/// The table with a row for each unit.
pub(super) const RUNS: &str = "runs.csv";
/// The estimates.
pub(super) const RESULTS: &str = "results.json";

/// The results of an experiment, in the order of its units.
#[derive(Debug)]
pub struct Results {
    /// The plan, with the experiment.
    pub plan: Plan,
    /// The units that were played.
    pub outcomes: Vec<UnitOutcome>,
    /// The units that could not be played.
    pub failures: Vec<FailedUnit>,
    /// Numbers of the units that have not been played yet.
    pub missing: Vec<usize>,
    /// Lines of files that are not as they were written, for people: each with its unit, if that has to be played again.
    pub damages: Vec<String>,
    /// Numbers of units that were played several times and gave different runs.
    pub conflicts: Vec<usize>,
    /// Words of the measures and expectations that occurred in none of the units, and measures that all of them miss, for people.
    pub never_occurred: Vec<String>,
}

/// An expectation of an experiment, and the runs that do not meet it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExpectationResult<'a> {
    /// Its name.
    pub expectation: &'a str,
    /// Numbers of the units that fail it.
    pub failed: Vec<usize>,
    /// Numbers of the units that ended before it was certain.
    pub undecided: Vec<usize>,
    /// Numbers of the units in which what it is expected after did not happen.
    pub not_asked: Vec<usize>,
    /// Numbers of the units in which what is to be reached in some run was not.
    pub unreached: Vec<usize>,
    /// How many units were judged.
    pub judged: usize,
}

impl ExpectationResult<'_> {
    /// The worst verdict of a run.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if !self.failed.is_empty() {
            return Verdict::Fail;
        }
        if !self.undecided.is_empty() {
            return Verdict::Undecided;
        }
        if !self.not_asked.is_empty() && self.not_asked.len() == self.judged {
            return Verdict::NotAsked;
        }
        if !self.unreached.is_empty() && self.unreached.len() == self.judged {
            return Verdict::Unreached;
        }
        Verdict::Pass
    }
}

/// `results.json`.
#[derive(Debug, Serialize)]
struct WrittenResults<'a> {
    name: &'a str,
    question: &'a str,
    units: usize,
    missing: usize,
    failures: &'a [FailedUnit],
    never_occurred: &'a [String],
    estimates: Vec<ArmMeasure>,
    contrasts: Vec<Contrast>,
}

impl Results {
    /// Reads the results in the folder of an experiment.
    ///
    /// # Errors
    /// If it is not the folder of an experiment, or a file cannot be read.
    pub fn load(folder: &Path) -> Result<Self, LabError> {
        let plan = Plan::load(folder)?;
        let store = Store::open(folder)?;
        Ok(Self::of(plan, &store))
    }

    /// The results of the units that have been played.
    #[must_use]
    pub fn of(plan: Plan, store: &Store) -> Self {
        let mut outcomes = Vec::new();
        let mut failures = Vec::new();
        let mut missing = Vec::new();
        let mut conflicts = Vec::new();
        let mut unheard = MissingWords::default();
        let mut all_played = Vec::new();
        for number in 0..plan.units() {
            let unit = plan.unit(number);
            match store.get(unit.key) {
                None => missing.push(number),
                Some(Ok(played)) => {
                    unheard.add(played);
                    all_played.push(played);
                    outcomes.push(UnitOutcome::of(&unit, played));
                }
                Some(Err(reason)) => failures.push(FailedUnit {
                    unit: number,
                    condition: unit.condition.name.clone(),
                    arm: unit.arm.name.clone(),
                    seed: unit.seed,
                    reason: reason.clone(),
                }),
            }
            if store.conflicts().contains(&unit.key) {
                conflicts.push(number);
            }
        }

        let mut never_occurred = unheard.in_all();
        for missing in plan.missing_in_all(&all_played) {
            never_occurred.push(format!("{missing}, in any run"));
        }

        let damages = store.damages_of(&plan, &missing);
        Self {
            plan,
            outcomes,
            failures,
            missing,
            damages,
            conflicts,
            never_occurred,
        }
    }

    /// Estimates of every measure, for each arm under each condition.
    #[must_use]
    pub fn estimates(&self) -> Vec<ArmMeasure> {
        let experiment = &self.plan.experiment;
        experiment.estimate(&self.outcomes, &self.failures)
    }

    /// Differences of every arm to the baseline.
    #[must_use]
    pub fn contrasts(&self) -> Vec<Contrast> {
        let experiment = &self.plan.experiment;
        experiment.contrast(&self.outcomes, &self.failures)
    }

    /// How the runs have met each expectation of the experiment file, in its order. What the scenario expects is in the tables
    /// only: an experiment may be about how often that fails.
    #[must_use]
    pub fn judged(&self) -> Vec<ExpectationResult<'_>> {
        let mut all = Vec::new();
        for expectation in &self.plan.experiment.expectations {
            let mut judged = ExpectationResult {
                expectation: &expectation.name,
                failed: Vec::new(),
                undecided: Vec::new(),
                not_asked: Vec::new(),
                unreached: Vec::new(),
                judged: 0,
            };
            for outcome in &self.outcomes {
                let Some(verdict) = outcome.verdicts.get(&expectation.name) else {
                    continue;
                };

                judged.judged += 1;
                let units = match verdict {
                    verdict if verdict == Verdict::Fail.name() => &mut judged.failed,
                    verdict if verdict == Verdict::Undecided.name() => &mut judged.undecided,
                    verdict if verdict == Verdict::NotAsked.name() => &mut judged.not_asked,
                    verdict if verdict == Verdict::Unreached.name() => &mut judged.unreached,
                    _ => continue,
                };
                units.push(outcome.unit);
            }

            all.push(judged);
        }

        all
    }

    /// Writes the table and the estimates into the folder of the experiment. The same results give the same bytes.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), LabError> {
        let table = self.table(&folder.join(RUNS))?;
        let path = folder.join(RESULTS);
        let mut draft = Draft::create(&path)?;
        let written = WrittenResults {
            name: self.plan.name(),
            question: &self.plan.experiment.question,
            units: self.plan.units(),
            missing: self.missing.len(),
            failures: &self.failures,
            never_occurred: &self.never_occurred,
            estimates: self.estimates(),
            contrasts: self.contrasts(),
        };
        let text = serde_json::to_string_pretty(&written).map_err(LabError::failed)?;
        writeln!(draft, "{text}").map_err(|error| unwritable(&path, &error))?;

        table.publish()?;
        draft.publish()?;
        Ok(())
    }

    /// The table with a row for each unit.
    fn table(&self, path: &Path) -> Result<Draft, FileError> {
        let columns = UnitColumns::of(self);
        let mut table = CsvTable::create(path, columns.all.clone())?;

        let mut outcomes = self.outcomes.iter().peekable();
        let mut failures = self.failures.iter().peekable();
        for number in 0..self.plan.units() {
            if let Some(outcome) = outcomes.next_if(|outcome| outcome.unit == number) {
                table.add(columns.row(outcome))?;
            } else if let Some(failure) = failures.next_if(|failure| failure.unit == number) {
                let unit = self.plan.unit(number);
                let mut row = columns.unit(number, &unit.condition.levels);
                row.push(("condition", failure.condition.as_str().into()));
                row.push(("arm", failure.arm.as_str().into()));
                row.push(("seed", failure.seed.into()));
                row.push(("failed", failure.reason.as_str().into()));
                table.add(row)?;
            }
        }

        Ok(table.finish())
    }
}

/// The columns of the table of units.
struct UnitColumns {
    all: Vec<String>,
    /// Columns of factors, by the names of the factors, and whether all levels are numbers.
    levels: BTreeMap<String, (String, bool)>,
    /// Columns of measures: the number, and its state.
    measures: BTreeMap<String, (String, String)>,
    /// Columns of verdicts.
    verdicts: BTreeMap<String, String>,
}

impl UnitColumns {
    fn of(results: &Results) -> Self {
        let mut columns = Self {
            all: Vec::new(),
            levels: BTreeMap::new(),
            measures: BTreeMap::new(),
            verdicts: BTreeMap::new(),
        };
        columns.add("unit");
        columns.add("condition");
        let conditions = results.plan.conditions();
        for (name, _) in conditions.iter().flat_map(|condition| &condition.levels) {
            if !columns.levels.contains_key(name) {
                let column = columns.add_named(name, "factor");
                let are_numbers = are_numbers(results, name);
                columns.levels.insert(name.clone(), (column, are_numbers));
            }
        }
        for name in ["arm", "seed", "yoked_to_seed", "failed", "digest"] {
            columns.add(name);
        }

        for measure in &results.plan.experiment.measures {
            let number = columns.add_named(&measure.name, "measure");
            let state = columns.add_named(&format!("{number}_state"), "measure");
            columns
                .measures
                .insert(measure.name.clone(), (number, state));
        }
        let verdicts = results.outcomes.iter().flat_map(|run| run.verdicts.keys());
        for name in BTreeSet::from_iter(verdicts) {
            let column = columns.add_named(name, "verdict");
            columns.verdicts.insert(name.clone(), column);
        }
        columns
    }

    fn add(&mut self, name: &str) {
        self.all.push(name.to_owned());
    }

    /// Adds a column whose name the experiment gives, which may be that of another column.
    fn add_named(&mut self, name: &str, kind: &str) -> String {
        let mut unique = name.to_owned();
        while self.all.contains(&unique) {
            unique = format!("{unique} ({kind})");
        }
        self.add(&unique);
        unique
    }

    /// The cells that all units have.
    fn unit(&self, number: usize, levels: &[(String, String)]) -> Vec<(&str, FieldValue<'_>)> {
        let mut row = vec![("unit", FieldValue::from(number as u64))];
        for (name, level) in levels {
            let (column, are_numbers) = &self.levels[name];
            let level = match level.parse::<f64>() {
                Ok(number) if *are_numbers => number.into(),
                _ => level.clone().into(),
            };
            row.push((column, level));
        }
        row
    }

    fn row<'a>(&'a self, outcome: &'a UnitOutcome) -> Vec<(&'a str, FieldValue<'a>)> {
        let mut row = self.unit(outcome.unit, &outcome.levels);
        row.push(("condition", outcome.condition.as_str().into()));
        row.push(("arm", outcome.arm.as_str().into()));
        row.push(("seed", outcome.seed.into()));
        row.push(("yoked_to_seed", outcome.yoked_to_seed.into()));
        row.push(("digest", outcome.digest.as_str().into()));

        for (name, measured) in &outcome.measures {
            let (number, state) = &self.measures[name];
            let time = measured.time();
            let value = measured.value().or(time.map(|(time_s, _)| time_s));
            row.push((number, value.into()));
            row.push((state, measured.state().into()));
        }

        for (name, verdict) in &outcome.verdicts {
            row.push((&self.verdicts[name], verdict.as_str().into()));
        }

        row
    }
}

/// Whether all levels of a factor are numbers.
fn are_numbers(results: &Results, factor: &str) -> bool {
    let conditions = results.plan.conditions().iter();
    let mut levels = conditions.flat_map(|condition| &condition.levels);
    levels.all(|(name, level)| name != factor || level.parse::<f64>().is_ok())
}

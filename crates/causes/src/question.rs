//! What is asked of a run, and what its outcome is.

use config::Source;
use lab::LabError;
use lab::branch::Branch;
use observe::{Expectation, Measure, Measured, Probe, ScenarioMeasure};
use protocol::messages::Verdict;
use protocol::{Event, Tick};
use record::{EpochFiles, Record, Summary};
use scenario::Scenario;
use serde::{Deserialize, Serialize};

/// Name of the expectation or measure that stands for what has no name.
const ASKED: &str = "why";

/// What is asked of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Question {
    /// Why an expectation fails, or does not.
    Expectation {
        /// Its name.
        name: String,
        /// Whether a run in which it stays undecided counts as one in which it fails: it was undecided in this run.
        or_undecided: bool,
    },
    /// Why a condition holds in some tick, or in none.
    Condition {
        /// The condition as in a scenario, `{ robot = "Butler", behavior = "INTERCEPT" }`.
        condition: String,
    },
    /// Why a measure of the scenario has its value.
    Measure {
        /// Its name.
        name: String,
    },
    /// Why a number of the summary has its value.
    Summary {
        /// Its path.
        path: String,
    },
}

/// A question, and the scenario that answers it: with nothing else to be judged or measured.
pub(super) struct AskedRun {
    pub(super) question: Question,
    pub(super) scenario: Scenario,
    /// The measure of a number of the summary.
    summary: Option<Measure>,
}

impl AskedRun {
    /// Reads a question about a recorded epoch: the name of an expectation or a measure, a condition, or the path of a number of
    /// the summary. Without one it is about the first expectation that failed, or else about the last.
    ///
    /// # Errors
    /// If the run has nothing of that kind.
    pub(super) fn read(
        what: Option<&str>,
        scenario: &Scenario,
        files: &EpochFiles,
    ) -> Result<Self, LabError> {
        let Some(what) = what else {
            let name = failed_first(scenario, files)?;
            return Self::of_expectation(&name, scenario, files);
        };
        if scenario.expectations.iter().any(|one| one.name == what) {
            return Self::of_expectation(what, scenario, files);
        }
        if let Some(measure) = scenario.measures.iter().find(|one| one.name == what) {
            return Ok(Self::of_measure(&measure.name, scenario));
        }
        if what.trim_start().starts_with(['{', '[']) {
            return Self::of_condition(what, scenario);
        }
        if what.contains('.') {
            return Self::of_summary(what, scenario);
        }

        let expectations = scenario.expectations.iter().map(|one| one.name.clone());
        let measures = scenario.measures.iter().map(|one| one.name.clone());
        let known: Vec<String> = expectations.chain(measures).collect();
        let known = if known.is_empty() {
            "it has none".to_owned()
        } else {
            format!("it has \"{}\"", known.join("\", \""))
        };
        Err(LabError::refused(format!(
            "the run has no expectation and no measure called {what:?}: {known}"
        ))
        .with_help(
            "a condition is written as in a scenario: '{ robot = \"Butler\", behavior = \"INTERCEPT\" }'; a number of the \
             summary by its path: robots.Butler.blocked",
        ))
    }

    fn of_expectation(
        name: &str,
        scenario: &Scenario,
        files: &EpochFiles,
    ) -> Result<Self, LabError> {
        let or_undecided = verdicts(files)?
            .iter()
            .any(|(judged, _, verdict)| judged == name && *verdict == Verdict::Undecided);
        let mut asked = scenario.clone();
        asked.measures.clear();
        // What ends the run may depend on verdicts, so all stay then.
        if scenario.end_when.is_none() {
            asked.expectations.retain(|one| one.name == name);
        }
        Ok(Self {
            question: Question::Expectation {
                name: name.to_owned(),
                or_undecided,
            },
            scenario: asked,
            summary: None,
        })
    }

    fn of_condition(condition: &str, scenario: &Scenario) -> Result<Self, LabError> {
        let source = Source {
            name: "the question".to_owned(),
            // In one line, so that an error shows the condition.
            text: format!("expect = [{{ name = \"{ASKED}\", never = {condition} }}]\n"),
        };
        let mut expected: Vec<Expectation> = scenario::expectations(&source, &scenario.setting())?;

        let mut asked = scenario.clone();
        asked.measures.clear();
        if scenario.end_when.is_none() {
            asked.expectations.clear();
        }
        asked.expectations.append(&mut expected);
        Ok(Self {
            question: Question::Condition {
                condition: condition.trim().to_owned(),
            },
            scenario: asked,
            summary: None,
        })
    }

    fn of_measure(name: &str, scenario: &Scenario) -> Self {
        let mut asked = scenario.clone();
        let name = name.to_owned();
        // A ratio may be of other measures, and a count of verdicts.
        let until = asked.measures.iter().position(|one| one.name == name);
        asked.measures.truncate(until.map_or(0, |index| index + 1));

        Self {
            question: Question::Measure { name },
            scenario: asked,
            summary: None,
        }
    }

    fn of_summary(path: &str, scenario: &Scenario) -> Result<Self, LabError> {
        Summary::check_path(path).map_err(LabError::refused)?;
        if path.starts_with("wall.") {
            return Err(LabError::refused(format!(
                "{path} is wall clock: it says nothing about the run, and is another number whenever it is executed"
            )));
        }

        let mut table = toml::Table::new();
        table.insert("name".to_owned(), ASKED.into());
        table.insert("summary".to_owned(), path.into());
        let measure = ScenarioMeasure::try_from(table).map_err(LabError::refused)?;

        let mut asked = scenario.clone();
        asked.measures.clear();
        if scenario.end_when.is_none() {
            asked.expectations.clear();
        }
        Ok(Self {
            question: Question::Summary {
                path: path.to_owned(),
            },
            scenario: asked,
            summary: Some((*measure).clone()),
        })
    }

    /// Whether branches need a summary.
    pub(super) fn sums_up(&self) -> bool {
        self.summary.is_some()
    }

    /// Plays a branch as far as needed; returns its outcome, `None` if it has none.
    ///
    /// # Errors
    /// If the branch cannot be played.
    pub(super) fn outcome(&self, branch: &mut Branch) -> Result<Option<f64>, LabError> {
        let is_one = |is_one: bool| Some(f64::from(u8::from(is_one)));

        match &self.question {
            Question::Expectation { name, or_undecided } => {
                let verdict = branch.judge(name)?;
                Ok(is_one(match verdict {
                    Some(Verdict::Fail) => true,
                    Some(Verdict::Undecided) | None => *or_undecided,
                    Some(Verdict::Pass | Verdict::NotAsked | Verdict::Unreached) => false,
                }))
            }
            Question::Condition { .. } => Ok(is_one(branch.judge(ASKED)? == Some(Verdict::Fail))),
            Question::Measure { name } => {
                branch.play()?;
                Ok(branch.measured().get(name).and_then(number))
            }
            Question::Summary { .. } => {
                branch.play()?;
                let Some((measure, summary)) = self.summary.as_ref().zip(branch.summary()) else {
                    return Ok(None);
                };
                let setting = branch.simulation().scenario().setting();
                let probe = Probe::new(measure, &setting, (0.0, f64::INFINITY));
                let summary = serde_json::to_value(&summary).map_err(LabError::failed)?;
                Ok(number(&probe.measured(&summary, &branch.measured())))
            }
        }
    }
}

impl Question {
    /// Its words.
    #[must_use]
    pub fn words(&self) -> &str {
        match self {
            Self::Expectation { name, .. } | Self::Measure { name } => name,
            Self::Condition { condition } => condition,
            Self::Summary { path } => path,
        }
    }

    /// Whether outcomes are 1 or 0.
    #[must_use]
    pub fn is_share(&self) -> bool {
        matches!(self, Self::Expectation { .. } | Self::Condition { .. })
    }
}

/// The number of a measure. A time that was not reached counts as the time for which the run has waited: the mean is that of the
/// time up to the end of the run.
fn number(measured: &Measured) -> Option<f64> {
    match measured {
        Measured::NotReached { waited_s } => Some(*waited_s),
        Measured::Unfinished { at_least } => Some(*at_least),
        other => other.value(),
    }
}

/// The expectation that failed first, or else the last one of the scenario.
fn failed_first(scenario: &Scenario, files: &EpochFiles) -> Result<String, LabError> {
    let judged = verdicts(files)?;
    let mut failed = judged
        .into_iter()
        .filter(|(_, _, verdict)| *verdict == Verdict::Fail);
    if let Some((name, ..)) = failed.next() {
        return Ok(name);
    }
    let last = scenario.expectations.last();
    last.map(|one| one.name.clone()).ok_or_else(|| {
        LabError::refused("the run expects nothing ([[expect]]), so name what is asked")
            .with_help("for example cars why latest '{ robot = \"Butler\", variable = \"treats\", below = 1 }'")
    })
}

/// The verdicts of a record, in their order.
fn verdicts(files: &EpochFiles) -> Result<Vec<(String, Tick, Verdict)>, LabError> {
    let mut record = Record::of_events(&files.events)?;
    let mut judged = Vec::new();
    while let Some(entry) = record.next_entry()? {
        for event in entry.events {
            if let Event::Judged {
                expectation,
                verdict,
                ..
            } = event
            {
                judged.push((expectation, entry.tick, verdict));
            }
        }
    }
    Ok(judged)
}

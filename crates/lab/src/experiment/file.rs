//! The experiment file: read as written, then checked. Errors show the place in the file.

use std::path::{Path, PathBuf};

use config::units::Time;
use config::{FileError, Override, Source};
use serde::Deserialize;
use toml::Spanned;

use super::condition::{Condition, ConditionError, Conditions, Factor, Value, parse};
use super::measure::{Measure, RawMeasure};
use crate::statistics::MIN_SAMPLE;

/// Experiments that ship with the project, by name.
const SHIPPED: [(&str, &str); 3] = [
    (
        "configs/experiments/affect.toml",
        include_str!("../../../../configs/experiments/affect.toml"),
    ),
    (
        "configs/experiments/deadlock.toml",
        include_str!("../../../../configs/experiments/deadlock.toml"),
    ),
    (
        "configs/experiments/partition.toml",
        include_str!("../../../../configs/experiments/partition.toml"),
    ),
];

/// An experiment, checked.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// The question that the experiment answers.
    pub question: String,
    /// The procedure in a sentence, in which `{from}` is replaced by the begin of the factor.
    pub procedure: String,
    /// The scenario that is changed.
    pub scenario: PathBuf,
    /// Number of runs of each arm under each condition, with the seeds 1, 2, 3 and so on.
    pub seeds: u64,
    /// Simulated time of each run, seconds.
    pub duration_s: f64,
    /// The independent variable, the same for all arms.
    pub conditions: Conditions,
    /// The sets of changes that are compared.
    pub arms: Vec<Arm>,
    /// Name of the arm with which the others are compared; `None` if they are not.
    pub baseline: Option<String>,
    /// The numbers of each run.
    pub measures: Vec<Measure>,
}

/// A set of changes under comparison.
#[derive(Debug, Clone)]
pub struct Arm {
    /// Name in tables.
    pub name: String,
    /// Description for people.
    pub what: String,
    /// Changes of the scenario.
    pub set: Vec<Override>,
    /// The arm whose emotions its robots show: those of its run with the next seed under the same condition.
    pub yoked_to: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawExperiment {
    question: String,
    procedure: String,
    scenario: PathBuf,
    seeds: Spanned<u64>,
    duration: Time,
    baseline: Option<Spanned<String>>,
    factor: Option<Spanned<RawFactor>>,
    #[serde(default, rename = "condition")]
    conditions: Vec<Spanned<RawCondition>>,
    #[serde(rename = "arm")]
    arms: Vec<RawArm>,
    #[serde(rename = "measure")]
    measures: Vec<Spanned<RawMeasure>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFactor {
    name: String,
    values: Vec<RawValue>,
    begins: Option<Time>,
    set: Vec<String>,
    set_at_zero: Option<Vec<String>>,
}

/// A value as written in the file.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "a value is a number, or a time such as \"60 s\""
)]
enum RawValue {
    Number(f64),
    Time(Time),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCondition {
    name: String,
    what: String,
    from: Option<Time>,
    until: Option<Time>,
    set: Vec<Spanned<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawArm {
    name: Spanned<String>,
    what: String,
    set: Vec<Spanned<String>>,
    yoked_to: Option<Spanned<String>>,
}

/// Whether a file is an experiment file and not a scenario or a launch file.
///
/// # Errors
/// [`FileError`] if it cannot be read, or is not TOML.
pub fn is_experiment_file(path: &Path) -> Result<bool, FileError> {
    let table: toml::Table = Source::read(path)?.parse()?;
    Ok(table.contains_key("arm"))
}

impl Experiment {
    /// Reads an experiment file.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::parse(&Source::read(path)?, folder)
    }

    /// An experiment that ships with the project; `None` if there is none of this name. Its scenario is relative to the
    /// folder of the project.
    ///
    /// # Errors
    /// [`FileError`] if the program was built from a file that cannot be used.
    pub fn shipped(name: &str) -> Result<Option<Self>, FileError> {
        for (path, text) in SHIPPED {
            let path = Path::new(path);
            if path.file_stem().is_some_and(|stem| stem == name) {
                let source = Source {
                    name: path.display().to_string(),
                    text: text.to_owned(),
                };
                let folder = path.parent().unwrap_or(Path::new(""));
                let mut experiment = Self::parse(&source, folder)?;
                // The project has no symbolic links between these folders.
                experiment.scenario = without_dots(&experiment.scenario);
                return Ok(Some(experiment));
            }
        }

        Ok(None)
    }

    /// Reads the text of an experiment file; `folder` is where its relative paths begin.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn parse(source: &Source, folder: &Path) -> Result<Self, FileError> {
        let raw: RawExperiment = source.parse()?;

        if *raw.seeds.get_ref() < MIN_SAMPLE {
            let reason = format!("an experiment has at least {MIN_SAMPLE} seeds");
            return Err(FileError::at(source, Some(raw.seeds.span()), &reason));
        }

        let duration_s = raw.duration.0;
        let arms = parse_arms(source, raw.arms)?;
        let baseline = raw.baseline.map(|name| known(source, &arms, name));
        Ok(Self {
            question: raw.question,
            procedure: raw.procedure,
            scenario: folder.join(raw.scenario),
            seeds: raw.seeds.into_inner(),
            duration_s,
            conditions: parse_conditions(source, raw.factor, raw.conditions, duration_s)?,
            baseline: baseline.transpose()?,
            arms,
            measures: parse_measures(source, raw.measures)?,
        })
    }

    /// The conditions of the experiment in the order of the table.
    ///
    /// # Errors
    /// If one of them cannot be played, or is there twice.
    pub fn list_conditions(&self) -> Result<Vec<Condition>, ConditionError> {
        self.conditions.list(self.duration_s)
    }

    /// The procedure in a sentence.
    #[must_use]
    pub fn explained(&self) -> String {
        match &self.conditions {
            Conditions::Factor(Factor {
                begins_s: Some(from_s),
                ..
            }) => self.procedure.replace("{from}", &format!("{from_s} s")),
            _ => self.procedure.clone(),
        }
    }
}

/// A path in which `..` follows no other part.
fn without_dots(path: &Path) -> PathBuf {
    let mut short = PathBuf::new();
    for part in path {
        if part != ".." || !short.pop() {
            short.push(part);
        }
    }
    short
}

fn parse_conditions(
    source: &Source,
    factor: Option<Spanned<RawFactor>>,
    named: Vec<Spanned<RawCondition>>,
    duration_s: f64,
) -> Result<Conditions, FileError> {
    let refuse =
        |span, error: ConditionError| FileError::at(source, Some(span), &error.to_string());

    let Some(factor) = factor else {
        let mut conditions: Vec<Condition> = Vec::new();
        for raw in named {
            let span = raw.span();
            let condition = raw.into_inner().check(source, span.clone())?;
            let name = &condition.name;
            if conditions.iter().any(|other| other.name == *name) {
                return Err(refuse(span, ConditionError::Repeated(name.clone())));
            }
            condition
                .check_time(duration_s)
                .map_err(|error| refuse(span, error))?;
            conditions.push(condition);
        }
        if conditions.is_empty() {
            let reason = "an experiment has a [factor], or a [[condition]] or several";
            return Err(FileError::at(source, None, reason));
        }
        return Ok(Conditions::Named(conditions));
    };

    if let Some(condition) = named.first() {
        let reason = "an experiment has either a [factor] or conditions";
        return Err(FileError::at(source, Some(condition.span()), reason));
    }
    let span = factor.span();
    let conditions = Conditions::Factor(factor.into_inner().into());
    conditions
        .list(duration_s)
        .map_err(|error| refuse(span, error))?;
    Ok(conditions)
}

impl RawCondition {
    fn check(self, source: &Source, span: std::ops::Range<usize>) -> Result<Condition, FileError> {
        let time_s = match (self.from, self.until) {
            (None, None) => None,
            (Some(from), Some(until)) => Some((from.0, until.0)),
            _ => {
                let reason = "a condition has both `from` and `until`, or lasts for the whole run";
                return Err(FileError::at(source, Some(span), reason));
            }
        };

        let mut set = Vec::new();
        for change in self.set {
            let parsed = parse(change.get_ref(), time_s)
                .map_err(|error| FileError::at(source, Some(change.span()), &error.to_string()))?;
            set.push(parsed);
        }
        Ok(Condition {
            name: self.name,
            what: self.what,
            set,
            time_s,
        })
    }
}

fn parse_arms(source: &Source, raw: Vec<RawArm>) -> Result<Vec<Arm>, FileError> {
    let mut arms: Vec<Arm> = Vec::new();
    let mut yokes = Vec::new();
    for arm in raw {
        let mut set = Vec::new();
        for change in arm.set {
            let parsed = change
                .get_ref()
                .parse()
                .map_err(|reason: String| FileError::at(source, Some(change.span()), &reason))?;
            set.push(parsed);
        }

        let span = arm.name.span();
        let name = arm.name.into_inner();
        if arms.iter().any(|other| other.name == name) {
            let reason = format!("there are two arms \"{name}\"");
            return Err(FileError::at(source, Some(span), &reason));
        }
        let yoked_to = arm.yoked_to.as_ref().map(|to| to.get_ref().clone());
        yokes.extend(arm.yoked_to);
        arms.push(Arm {
            name,
            what: arm.what,
            set,
            yoked_to,
        });
    }

    for yoke in yokes {
        let span = yoke.span();
        let name = known(source, &arms, yoke)?;
        let other = arms.iter().find(|arm| arm.name == name);
        if other.is_some_and(|other| other.yoked_to.is_some()) {
            let reason = format!("\"{name}\" is yoked itself, and has no emotions of its own");
            return Err(FileError::at(source, Some(span), &reason));
        }
    }
    Ok(arms)
}

/// The name of an arm that there is.
fn known(source: &Source, arms: &[Arm], name: Spanned<String>) -> Result<String, FileError> {
    if arms.iter().any(|arm| arm.name == *name.get_ref()) {
        return Ok(name.into_inner());
    }

    let reason = format!("there is no arm \"{}\"", name.get_ref());
    Err(FileError::at(source, Some(name.span()), &reason))
}

fn parse_measures(
    source: &Source,
    raw: Vec<Spanned<RawMeasure>>,
) -> Result<Vec<Measure>, FileError> {
    let mut measures: Vec<Measure> = Vec::new();
    for measure in raw {
        let span = measure.span();
        let checked = measure.into_inner().check();
        let measure = checked
            .map_err(|error| FileError::at(source, Some(span.clone()), &error.to_string()))?;
        if measures.iter().any(|other| other.name == measure.name) {
            let reason = format!("there are two measures \"{}\"", measure.name);
            return Err(FileError::at(source, Some(span), &reason));
        }
        measures.push(measure);
    }
    Ok(measures)
}

impl From<RawFactor> for Factor {
    fn from(raw: RawFactor) -> Self {
        let mut values = Vec::new();
        for value in raw.values {
            values.push(match value {
                RawValue::Number(number) => Value::Number(number),
                RawValue::Time(time) => Value::Time(time.0),
            });
        }

        Self {
            name: raw.name,
            values,
            begins_s: raw.begins.map(|begins| begins.0),
            set: raw.set,
            set_at_zero: raw.set_at_zero,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_experiments_can_be_played() {
        for (name, conditions, arms) in [("affect", 9, 8), ("deadlock", 5, 5), ("partition", 4, 5)]
        {
            let experiment = Experiment::shipped(name).unwrap().unwrap();
            let found = experiment.list_conditions().unwrap().len();
            assert_eq!(found, conditions, "{name}");
            assert_eq!(experiment.arms.len(), arms, "{name}");
            let scenario = Path::new("configs/hors_doeuvres.toml");
            assert_eq!(experiment.scenario, scenario, "{name}");
        }
        assert!(Experiment::shipped("none").unwrap().is_none());
    }

    /// Checks that each change of a shipped file is refused for its reason.
    fn check_refused(name: &str, changes: &[(&str, &str, &str)]) {
        let shipped = SHIPPED.iter().find(|(path, _)| path.contains(name));
        let (path, text) = shipped.unwrap();
        for (from, to, reason) in changes {
            assert!(text.contains(from), "{from}");
            let source = Source {
                name: (*path).to_owned(),
                text: text.replacen(from, to, 1),
            };
            let error = Experiment::parse(&source, Path::new("")).unwrap_err();
            let error = error.in_words();
            assert!(error.contains(reason), "{error:?} does not say {reason:?}");
        }
    }

    #[test]
    fn errors_show_the_reason() {
        check_refused(
            "deadlock",
            &[
                ("seeds = 32", "seeds = 2", "at least 8 seeds"),
                ("question", "qestion", "unknown field"),
                ("network.commands=", "network.commands", "path=value"),
                ("params.resend=on", "params.resend", "path=value"),
                ("when = \"during\"", "", "needs `when`"),
                (
                    "summary = \"robots.*.sent.*\"",
                    "",
                    "either `summary` or `entered`",
                ),
                (
                    "values = [0,",
                    "begins = \"1 s\"\nvalues = [0,",
                    "lasts for a time",
                ),
                ("values = [0,", "values = [0.25,", "twice"),
                (
                    "[factor]",
                    "[[condition]]\nname = \"\"\nwhat = \"\"\nset = []\n[factor]",
                    "either a [factor] or conditions",
                ),
            ],
        );
        check_refused(
            "affect",
            &[
                (
                    "baseline = \"emotions\"",
                    "baseline = \"x\"",
                    "no arm \"x\"",
                ),
                (
                    "yoked_to = \"emotions\"",
                    "yoked_to = \"x\"",
                    "no arm \"x\"",
                ),
                (
                    "yoked_to = \"emotions\"",
                    "yoked_to = \"yoked\"",
                    "yoked itself",
                ),
                ("name = \"rules\"", "name = \"timer\"", "two arms \"timer\""),
                ("name = \"served\"", "name = \"messages\"", "two measures"),
                ("until = \"240 s\"\n", "", "both `from` and `until`"),
                (
                    "duration = \"600 s\"",
                    "duration = \"100 s\"",
                    "begins at 120 s",
                ),
                (
                    "duration = \"600 s\"",
                    "duration = \"200 s\"",
                    "lasts until 240 s",
                ),
                ("\"Butler.served\"", "\"served\"", "not a state variable"),
                ("for = \"120 s\"", "for = \"0 s\"", "more than zero"),
            ],
        );
    }
}

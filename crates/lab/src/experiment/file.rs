//! The experiment file: read as written, then checked. Errors show the place in the file.

use std::path::{Path, PathBuf};

use config::units::Time;
use config::{FileError, Override, Source};
use serde::Deserialize;
use toml::Spanned;

use super::measure::Measure;
use crate::statistics::MIN_SAMPLE;

/// Experiments that ship with the project, by name.
const SHIPPED: [(&str, &str); 2] = [
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
    pub factor: Factor,
    /// The sets of changes that are compared.
    pub arms: Vec<Arm>,
    /// The numbers of each run.
    pub measures: Vec<Measure>,
}

/// The independent variable of an experiment, the same for all arms.
#[derive(Debug, Clone)]
pub struct Factor {
    /// Head of the column with its values.
    pub name: String,
    /// Its values, in the order of the table.
    pub values: Vec<Value>,
    /// Begin, simulated seconds. The value of a factor with a begin is its duration; a factor without one lasts for the
    /// whole run.
    pub begins_s: Option<f64>,
    /// Changes of the scenario, in which `{value}`, `{from}` and `{until}` are replaced.
    set: Vec<String>,
    /// Changes of the scenario that replace `set` where the value is zero.
    set_at_zero: Option<Vec<String>>,
}

/// A value of a factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A number without a unit.
    Number(f64),
    /// A time, simulated seconds.
    Time(f64),
}

/// One value of the factor and its changes of the scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// The value as text.
    pub name: String,
    /// Changes of the scenario.
    pub set: Vec<Override>,
    /// Begin and end, simulated seconds.
    pub time_s: (f64, f64),
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
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawExperiment {
    question: String,
    procedure: String,
    scenario: PathBuf,
    seeds: Spanned<u64>,
    duration: Time,
    factor: Spanned<RawFactor>,
    #[serde(rename = "arm")]
    arms: Vec<RawArm>,
    #[serde(rename = "measure")]
    measures: Vec<Spanned<Measure>>,
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
struct RawArm {
    name: String,
    what: String,
    set: Vec<Spanned<String>>,
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

    /// An experiment that ships with the project; `None` if there is none of this name.
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
                return Self::parse(&source, folder).map(Some);
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

        let factor_span = raw.factor.span();
        let experiment = Self {
            question: raw.question,
            procedure: raw.procedure,
            scenario: folder.join(raw.scenario),
            seeds: raw.seeds.into_inner(),
            duration_s: raw.duration.0,
            factor: Factor::from(raw.factor.into_inner()),
            arms: Self::parse_arms(source, raw.arms)?,
            measures: Self::parse_measures(source, raw.measures)?,
        };

        experiment
            .conditions()
            .map_err(|reason| FileError::at(source, Some(factor_span), &reason))?;
        Ok(experiment)
    }

    fn parse_arms(source: &Source, raw: Vec<RawArm>) -> Result<Vec<Arm>, FileError> {
        let mut arms = Vec::new();
        for arm in raw {
            let mut set = Vec::new();
            for change in arm.set {
                let parsed = change.get_ref().parse().map_err(|reason: String| {
                    FileError::at(source, Some(change.span()), &reason)
                })?;
                set.push(parsed);
            }
            arms.push(Arm {
                name: arm.name,
                what: arm.what,
                set,
            });
        }
        Ok(arms)
    }

    fn parse_measures(
        source: &Source,
        raw: Vec<Spanned<Measure>>,
    ) -> Result<Vec<Measure>, FileError> {
        let mut measures = Vec::new();
        for measure in raw {
            let span = measure.span();
            let measure = measure.into_inner();
            measure
                .check()
                .map_err(|error| FileError::at(source, Some(span), &error.to_string()))?;
            measures.push(measure);
        }
        Ok(measures)
    }

    /// The conditions of the experiment in the order of the values.
    ///
    /// # Errors
    /// If a change is not of the form `path=value`, or a value does not fit the factor.
    pub fn conditions(&self) -> Result<Vec<Condition>, String> {
        let mut conditions = Vec::new();
        for value in &self.factor.values {
            conditions.push(self.factor.condition(*value, self.duration_s)?);
        }
        Ok(conditions)
    }

    /// The procedure in a sentence.
    #[must_use]
    pub fn explained(&self) -> String {
        match self.factor.begins_s {
            Some(from_s) => self.procedure.replace("{from}", &format!("{from_s} s")),
            None => self.procedure.clone(),
        }
    }
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

impl Factor {
    fn condition(&self, value: Value, duration_s: f64) -> Result<Condition, String> {
        let (from_s, until_s) = match (self.begins_s, value) {
            (Some(from_s), Value::Time(lasting_s)) => (from_s, from_s + lasting_s),
            (None, _) => (0.0, duration_s),
            (Some(_), Value::Number(number)) => {
                return Err(format!(
                    "a factor with `begins` lasts for a time, and {number} is not a time"
                ));
            }
        };

        let template = match &self.set_at_zero {
            Some(at_zero) if value.is_zero() => at_zero,
            _ => &self.set,
        };
        let mut set = Vec::new();
        for change in template {
            let change = change
                .replace("{value}", &value.in_toml())
                .replace("{from}", &format!("{from_s} s"))
                .replace("{until}", &format!("{until_s} s"));
            set.push(change.parse()?);
        }

        Ok(Condition {
            name: value.to_string(),
            set,
            time_s: (from_s, until_s),
        })
    }
}

impl Value {
    fn is_zero(self) -> bool {
        match self {
            Self::Number(value) | Self::Time(value) => value == 0.0,
        }
    }

    /// The value in a scenario file.
    fn in_toml(self) -> String {
        match self {
            Self::Number(number) => format!("{number:?}"),
            Self::Time(_) => self.to_string(),
        }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Time(time_s) => write!(f, "{time_s} s"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_experiments_can_be_played() {
        for (name, conditions) in [("deadlock", 5), ("partition", 4)] {
            let experiment = Experiment::shipped(name).unwrap().unwrap();
            assert_eq!(experiment.conditions().unwrap().len(), conditions, "{name}");
            assert_eq!(experiment.arms.len(), 4, "{name}");
        }
        assert!(Experiment::shipped("none").unwrap().is_none());
    }

    #[test]
    fn a_condition_says_what_is_changed_and_when() {
        let experiment = Experiment::shipped("partition").unwrap().unwrap();
        let conditions = experiment.conditions().unwrap();
        assert_eq!(conditions[0].set[0].to_string(), "network.partition=[]");
        assert_eq!(conditions[1].name, "60 s");
        assert_eq!(conditions[1].time_s, (120.0, 180.0));
        let change = conditions[1].set[0].to_string();
        assert!(change.contains("until = \"180 s\""), "{change}");
    }

    #[test]
    fn errors_show_the_reason() {
        let (path, text) = SHIPPED[0];

        for (from, to, reason) in [
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
        ] {
            assert!(text.contains(from), "{from}");
            let source = Source {
                name: path.to_owned(),
                text: text.replace(from, to),
            };
            let error = Experiment::parse(&source, Path::new("")).unwrap_err();
            let error = error.in_words();
            assert!(error.contains(reason), "{error:?} does not say {reason:?}");
        }
    }
}

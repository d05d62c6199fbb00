//! The experiment file: read as written, then checked. Errors show the place in the file.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

use config::units::Time;
use config::{FileError, Source, shipped};
use observe::expect::check_all;
use observe::measure::MeasureSource;
use observe::measure::check_name;
use observe::{Expectation, Measure, MeasureError};
use protocol::RobotName;
use protocol::pattern::matches;
use record::Summary;
use scenario::Scenario;
use serde::Deserialize;
use toml::Spanned;

use super::condition::{
    Condition, ConditionError, Conditions, Factor, FactorTarget, FactorValue, NAMED, check_apart,
    check_change, check_levels, parse,
};
use super::presentation::{Presentation, RawPresentation};
use super::setting::Setting;

/// Fewest runs of each arm under each condition; an interval needs two.
const MIN_SEEDS: usize = 2;
/// Most runs of an experiment.
pub const MAX_UNITS: u64 = 1_000_000;
/// Most factors.
const MAX_FACTORS: usize = 8;
/// Most values of a factor.
const MAX_VALUES: usize = 1_000;
/// Most bytes of a text for people.
const MAX_TEXT_BYTES: usize = 2_000;
/// Most measures of an experiment; a scenario has fewer, which are taken in every tick.
const MAX_EXPERIMENT_MEASURES: usize = 200;
/// Columns of tables and keys of results that no factor, measure or expectation has.
const RESERVED: [&str; 10] = [
    NAMED,
    "arm",
    "baseline",
    "digest",
    "failed",
    "seed",
    "times",
    "times_s",
    "unit",
    "yoked_to_seed",
];
/// How the columns end that a measure has beside its number.
const OF_MEASURE: [&str; 1] = ["_state"];

/// An experiment, checked.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// The question that the experiment answers.
    pub question: String,
    /// The procedure in a sentence, in which `{from}` is replaced by the begin of the factor; empty if there is none.
    pub procedure: String,
    /// The scenario that is changed.
    pub scenario: PathBuf,
    /// Seeds of the runs of each arm under each condition, each once.
    pub seeds: Vec<u64>,
    /// Simulated time of each run, seconds.
    pub duration_s: f64,
    /// Place of the duration in the file, bytes; `None` if an option gives it.
    pub duration_span: Option<Range<usize>>,
    /// The independent variables, the same for all arms.
    pub conditions: Conditions,
    /// The sets of changes that are compared.
    pub arms: Vec<Arm>,
    /// Name of the arm with which the others are compared; `None` if they are not.
    pub baseline: Option<String>,
    /// The numbers of each run.
    pub measures: Vec<Measure>,
    /// What is expected of every run, beside what the scenario expects.
    pub expectations: Vec<Expectation>,
    /// What its report shows.
    pub report: Presentation,
    /// Places of the expectations in the file, bytes.
    expectation_spans: Vec<Range<usize>>,
    /// The file, for errors that only the scenario shows.
    source: Source,
}

/// A set of changes under comparison.
#[derive(Debug, Clone)]
pub struct Arm {
    /// Name in tables.
    pub name: String,
    /// Description for people.
    pub what: String,
    /// Changes of the scenario.
    pub set: Vec<Setting>,
    /// The arm whose emotions its robots show: those of its run with the next seed under the same condition.
    pub yoked_to: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawExperiment {
    question: String,
    #[serde(default)]
    procedure: String,
    scenario: Spanned<PathBuf>,
    seeds: Spanned<RawSeeds>,
    duration: Spanned<Time>,
    baseline: Option<Spanned<String>>,
    #[serde(default, rename = "factor")]
    factors: Vec<Spanned<RawFactor>>,
    #[serde(default, rename = "condition")]
    conditions: Vec<Spanned<RawCondition>>,
    #[serde(rename = "arm")]
    arms: Spanned<Vec<RawArm>>,
    #[serde(rename = "measure")]
    measures: Spanned<Vec<Measure>>,
    #[serde(default, rename = "expect")]
    expectations: Vec<Spanned<Expectation>>,
    #[serde(default)]
    report: RawPresentation,
}

/// Seeds as written in the file.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "seeds are a count such as 64, a list such as [3, 5, 8], or a range such as \"65..=128\""
)]
enum RawSeeds {
    Count(u64),
    List(Vec<u64>),
    Range(String),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFactor {
    name: Spanned<String>,
    values: Spanned<Vec<Spanned<RawValue>>>,
    begins: Option<Spanned<Time>>,
    path: Option<Spanned<String>>,
    set: Option<Spanned<Vec<String>>>,
    set_at_zero: Option<Spanned<Vec<String>>>,
}

/// A value as written in the file.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "a value is a number, a time such as \"60 s\", a text, true or false"
)]
enum RawValue {
    Flag(bool),
    Integer(i64),
    Number(f64),
    Text(String),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCondition {
    name: Spanned<String>,
    #[serde(default)]
    what: String,
    from: Option<Time>,
    until: Option<Time>,
    #[serde(default)]
    set: Vec<Spanned<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawArm {
    name: Spanned<String>,
    #[serde(default)]
    what: String,
    #[serde(default)]
    set: Vec<Spanned<String>>,
    yoked_to: Option<Spanned<String>>,
}

/// Whether a file is an experiment file and not a scenario or a launch file.
///
/// # Errors
/// [`FileError`] if it cannot be read, or is not TOML.
pub fn is_experiment_file(path: &Path) -> Result<bool, FileError> {
    let table: toml::Table = Source::read(path)?.parse()?;
    Ok(table.contains_key("arm") || table.contains_key("question"))
}

impl Experiment {
    /// Reads an experiment file.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let source = Source::read(path)?;
        check_content(&source)?;
        let raw: RawExperiment = source.parse()?;
        let scenario = folder.join(raw.scenario.get_ref());
        source.check_named(raw.scenario.span(), &scenario)?;
        raw.check(source, folder)
    }

    /// The experiment at a path, or of this name among those that come with the programs.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn find(given: &Path) -> Result<Self, FileError> {
        Self::load(&shipped::find(given, &[shipped::EXPERIMENTS]))
    }

    /// Reads the text of an experiment file; `folder` is where its relative paths begin.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn parse(source: &Source, folder: &Path) -> Result<Self, FileError> {
        check_content(source)?;
        let raw: RawExperiment = source.parse()?;
        raw.check(source.clone(), folder)
    }

    /// The conditions of the experiment in the order of the table.
    ///
    /// # Errors
    /// If one of them cannot be played, or is there twice.
    pub fn list_conditions(&self) -> Result<Vec<Condition>, ConditionError> {
        self.conditions.list(self.duration_s)
    }

    /// The scenario of an arm under a condition, with the expectations of the experiment.
    ///
    /// # Errors
    /// [`FileError`] at a measure or an expectation that names a robot which the scenario does not have, or at an expectation
    /// with the name of another one.
    pub fn complete(&self, mut scenario: Scenario) -> Result<Scenario, FileError> {
        let mut experiment = self.clone();
        experiment.take_measures(&scenario)?;
        experiment.check_robots(&scenario)?;
        experiment.check_expectations(&scenario)?;
        experiment.check_summaries()?;

        let own = scenario.expectations.len();
        scenario.expectations.extend_from_slice(&self.expectations);
        check_all(&scenario.expectations, &scenario.setting()).map_err(|wrong| {
            let index = wrong.index.checked_sub(own);
            let span = index.and_then(|index| self.expectation_spans.get(index).cloned());
            FileError::at(&self.source, span, &wrong.to_string())
        })?;
        Ok(scenario)
    }

    /// Bounds the texts for people, which every report has.
    fn check_texts(&self) -> Result<(), FileError> {
        let mut texts = vec![
            ("`question`".to_owned(), self.question.as_str()),
            ("`procedure`".to_owned(), self.procedure.as_str()),
        ];
        for arm in &self.arms {
            texts.push((format!("`what` of the arm \"{}\"", arm.name), &arm.what));
        }
        for condition in &self.conditions.named {
            let name = format!("`what` of the condition \"{}\"", condition.name);
            texts.push((name, &condition.what));
        }
        for measure in &self.measures {
            let what = measure.what.as_deref().unwrap_or_default();
            texts.push((format!("`what` of the measure \"{}\"", measure.name), what));
        }

        for (name, text) in texts {
            if text.len() > MAX_TEXT_BYTES {
                let bytes = text.len();
                let reason =
                    format!("{name} has {bytes} bytes, more than the {MAX_TEXT_BYTES} allowed");
                return Err(FileError::at(&self.source, None, &reason));
            }
        }
        Ok(())
    }

    fn check_robots(&self, scenario: &Scenario) -> Result<(), FileError> {
        let roster: Vec<String> = scenario.roster().iter().map(ToString::to_string).collect();
        for measure in &self.measures {
            for robot in measure.robots() {
                let is_operator = robot == RobotName::operator().as_str();
                if !is_operator && !roster.iter().any(|name| matches(robot, name)) {
                    let reason = format!(
                        "the scenario has no robot \"{robot}\"; it has {}",
                        roster.join(", ")
                    );
                    return Err(FileError::at(&self.source, Some(measure.span()), &reason));
                }
            }
            measure
                .check(&scenario.setting())
                .map_err(|error| refuse(&self.source, measure.span(), error))?;
        }

        Ok(())
    }

    /// Checks that verdicts are measured of expectations that there are.
    fn check_expectations(&self, scenario: &Scenario) -> Result<(), FileError> {
        let all = scenario.expectations.iter().chain(&self.expectations);
        let known: Vec<&str> = all.map(|expectation| expectation.name.as_str()).collect();
        for measure in &self.measures {
            for name in measure.expectations() {
                if !known.contains(&name) {
                    let reason = format!(
                        "there is no expectation \"{name}\"; there are {}",
                        known.join(", ")
                    );
                    return Err(FileError::at(&self.source, Some(measure.span()), &reason));
                }
            }
        }
        Ok(())
    }

    /// Checks that the numbers of the summary that are measured can be there.
    fn check_summaries(&self) -> Result<(), FileError> {
        for measure in &self.measures {
            for source in measure.sources() {
                if let MeasureSource::Summary(path) = source
                    && let Err(reason) = Summary::check_path(path)
                {
                    return Err(FileError::at(&self.source, Some(measure.span()), &reason));
                }
            }
        }
        Ok(())
    }

    /// Takes the sources of the scenario's measures for those that have none of their own, or name one by `summary`.
    ///
    /// # Errors
    /// [`FileError`] at a measure that the scenario does not have, or that is made of others which the experiment does not have.
    pub fn take_measures(&mut self, scenario: &Scenario) -> Result<(), FileError> {
        for index in 0..self.measures.len() {
            let (before, rest) = self.measures.split_at_mut(index);
            let Some(measure) = rest.first_mut() else {
                break;
            };
            let (name, is_optional) = match &measure.kind {
                MeasureSource::OfScenario(name) => (name, false),
                MeasureSource::Summary(name) => (name, true),
                _ => continue,
            };
            let mut named = scenario.measures.iter();
            let Some(of_scenario) = named.find(|one| one.name == *name) else {
                if is_optional {
                    continue;
                }
                let known: Vec<&str> = scenario.measures.iter().map(|one| &*one.name).collect();
                let known = match known.is_empty() {
                    true => "none".to_owned(),
                    false => known.join(", "),
                };
                let reason = format!(
                    "{}; that has {known}, and not \"{name}\"",
                    MeasureError::NotOne
                );
                return Err(refuse(&self.source, measure.span(), reason));
            };
            measure.take_source(of_scenario);
            measure
                .check_after(before)
                .map_err(|error| refuse(&self.source, measure.span(), error))?;
        }
        Ok(())
    }

    /// Checks that its robots have the variables that are measured, in one arm under one condition at least.
    ///
    /// # Errors
    /// [`FileError`] at a measure of a variable that is not there.
    pub fn check_variables(
        &self,
        published: &BTreeMap<RobotName, BTreeSet<String>>,
    ) -> Result<(), FileError> {
        for measure in &self.measures {
            for (robot, name) in measure.variables() {
                let mut matching = published
                    .iter()
                    .filter(|(known, _)| matches(robot, known.as_str()))
                    .peekable();
                let reason = match matching.peek() {
                    None => Some(format!("{robot} has no state variables")),
                    Some(_) => matching.find_map(|(robot, known)| no_variable(robot, known, name)),
                };
                if let Some(reason) = reason {
                    return Err(FileError::at(&self.source, Some(measure.span()), &reason));
                }
            }
        }
        Ok(())
    }

    /// The file that it was read from.
    #[must_use]
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// The procedure in a sentence.
    #[must_use]
    pub fn explained(&self) -> String {
        let factors = self.conditions.factors.iter();
        match factors.filter_map(|factor| factor.begins_s).next() {
            Some(from_s) => self.procedure.replace("{from}", &format!("{from_s} s")),
            None => self.procedure.clone(),
        }
    }
}

/// What is wrong if a robot does not have a state variable.
fn no_variable(robot: &RobotName, known: &BTreeSet<String>, name: &str) -> Option<String> {
    if known.contains(name) {
        return None;
    }
    if known.is_empty() {
        return Some(format!("{robot} has no state variables"));
    }
    let known: Vec<&str> = known.iter().map(String::as_str).collect();
    Some(format!(
        "{robot} has no state variable `{name}`; it has {}",
        known.join(", ")
    ))
}

/// Checks that a file has more than blanks and comments: no line of an empty file is wrong.
fn check_content(source: &Source) -> Result<(), FileError> {
    let table: toml::Table = source.parse()?;
    if table.is_empty() {
        let reason = format!("{} is empty: it is not an experiment", source.name);
        return Err(FileError::new(reason).with_help(
            "an experiment has a question, a scenario, seeds, a duration, arms and measures",
        ));
    }
    Ok(())
}

/// The error of a part of the file.
fn refuse(source: &Source, span: Range<usize>, reason: impl std::fmt::Display) -> FileError {
    FileError::at(source, Some(span), &reason.to_string())
}

impl RawExperiment {
    fn check(self, source: Source, folder: &Path) -> Result<Experiment, FileError> {
        let duration_s = self.duration.get_ref().0;
        if duration_s <= 0.0 {
            let reason = "a run lasts for more than 0 s";
            return Err(refuse(&source, self.duration.span(), reason));
        }
        let seeds_span = self.seeds.span();
        let seeds = self.seeds.into_inner().list();
        let seeds = seeds.map_err(|reason| refuse(&source, seeds_span.clone(), reason))?;

        let conditions = parse_conditions(&source, self.factors, self.conditions, duration_s)?;
        let arms = parse_arms(&source, self.arms, &conditions, duration_s)?;
        let baseline = self.baseline.map(|name| known(&source, &arms, name));

        let cells = conditions.count().saturating_mul(arms.len() as u64);
        let units = cells.saturating_mul(seeds.len() as u64);
        if units > MAX_UNITS {
            let reason = format!(
                "{} conditions, {} arms and {} seeds are more than {MAX_UNITS} runs",
                conditions.count(),
                arms.len(),
                seeds.len()
            );
            return Err(refuse(&source, seeds_span, reason));
        }
        // Only now: there are not too many.
        conditions
            .list(duration_s)
            .map_err(|error| FileError::at(&source, None, &error.to_string()))?;

        let measures = check_measures(&source, self.measures, &conditions, &self.expectations)?;
        let report = self.report.check(&source, &measures, &conditions)?;

        let mut expectations = Vec::new();
        let mut expectation_spans = Vec::new();
        for expectation in self.expectations {
            expectation_spans.push(expectation.span());
            expectations.push(expectation.into_inner());
        }

        let experiment = Experiment {
            question: self.question,
            procedure: self.procedure,
            scenario: folder.join(self.scenario.into_inner()),
            seeds,
            duration_s,
            duration_span: Some(self.duration.span()),
            measures,
            expectations,
            report,
            expectation_spans,
            conditions,
            baseline: baseline.transpose()?,
            arms,
            source,
        };
        experiment.check_texts()?;
        Ok(experiment)
    }
}

impl RawSeeds {
    fn list(self) -> Result<Vec<u64>, String> {
        let seeds = match self {
            Self::Count(count) => list_range(1, count)?,
            Self::List(seeds) => seeds,
            Self::Range(text) => {
                let (first, last) = parse_range(&text)
                    .ok_or_else(|| format!("\"{text}\" is not a range such as \"65..=128\""))?;
                list_range(first, last)?
            }
        };

        if seeds.len() < MIN_SEEDS {
            return Err(format!("an experiment has at least {MIN_SEEDS} seeds"));
        }
        let mut seen = BTreeSet::new();
        for seed in &seeds {
            config::seed::check(*seed).map_err(|error| error.to_string())?;
            if !seen.insert(seed) {
                return Err(format!(
                    "the seed {seed} is there twice: the same runs would count as independent ones"
                ));
            }
        }
        Ok(seeds)
    }
}

fn parse_range(text: &str) -> Option<(u64, u64)> {
    let (first, last) = text.split_once("..=")?;
    let first = first.trim().parse().ok()?;
    let last = last.trim().parse().ok()?;
    (first <= last).then_some((first, last))
}

fn list_range(first: u64, last: u64) -> Result<Vec<u64>, String> {
    if last - first.min(last) >= MAX_UNITS {
        return Err(format!("an experiment has at most {MAX_UNITS} runs"));
    }
    Ok((first..=last).collect())
}

fn parse_conditions(
    source: &Source,
    factors: Vec<Spanned<RawFactor>>,
    named: Vec<Spanned<RawCondition>>,
    duration_s: f64,
) -> Result<Conditions, FileError> {
    let mut conditions = Conditions::default();
    for raw in named {
        let span = raw.span();
        conditions.named.push(raw.into_inner().check(source)?);
        check_levels(&conditions.named, duration_s).map_err(|error| refuse(source, span, error))?;
    }

    let mut parts = vec![conditions.named.clone()];
    let mut names = BTreeSet::new();
    for raw in factors {
        let span = raw.span();
        if parts.len() > MAX_FACTORS {
            let reason = format!("an experiment has at most {MAX_FACTORS} factors");
            return Err(refuse(source, span, reason));
        }

        let name_span = raw.get_ref().name.span();
        let values_span = raw.get_ref().values.span();
        let factor = raw.into_inner().check(source, span.clone())?;
        if !names.insert(factor.name.clone()) {
            let reason = format!("there are two factors \"{}\"", factor.name);
            return Err(refuse(source, name_span, reason));
        }
        let levels = factor
            .levels(duration_s)
            .map_err(|error| refuse(source, values_span, error))?;
        for part in &parts {
            check_apart(part, &levels).map_err(|error| refuse(source, span.clone(), error))?;
        }
        parts.push(levels);
        conditions.factors.push(factor);
    }
    Ok(conditions)
}

impl RawCondition {
    fn check(self, source: &Source) -> Result<Condition, FileError> {
        let name = named(source, self.name)?;
        let time_s = match (self.from, self.until) {
            (None, None) => None,
            (Some(from), Some(until)) => Some((from.0, until.0)),
            _ => {
                let reason = "a condition has both `from` and `until`, or lasts for the whole run";
                return Err(refuse(source, name.span(), reason));
            }
        };

        let mut set = Vec::new();
        for change in self.set {
            let span = change.span();
            let parsed = parse(change.get_ref(), time_s)
                .and_then(|parsed| check_change(&parsed, &set).map(|()| parsed))
                .map_err(|error| refuse(source, span.clone(), error))?;
            set.push(Setting::at(parsed, span));
        }
        let name = name.into_inner();
        Ok(Condition {
            levels: vec![(NAMED.to_owned(), name.clone())],
            name,
            what: self.what,
            set,
            time_s,
        })
    }
}

/// A name that can be printed in a table.
fn named(source: &Source, name: Spanned<String>) -> Result<Spanned<String>, FileError> {
    match check_name(name.get_ref()) {
        Ok(()) => Ok(name),
        Err(error) => Err(refuse(source, name.span(), error)),
    }
}

impl RawFactor {
    fn check(self, source: &Source, span: Range<usize>) -> Result<Factor, FileError> {
        let name = named(source, self.name)?;
        if RESERVED.contains(&name.get_ref().as_str()) {
            let reason = format!("results have a column \"{}\" already", name.get_ref());
            return Err(refuse(source, name.span(), reason));
        }

        let target = match (self.path, self.set) {
            (Some(path), None) => {
                if let Some(begins) = self.begins {
                    let reason = "a factor with `begins` has `set`, in which `{from}` and `{until}` are replaced";
                    return Err(refuse(source, begins.span(), reason));
                }
                if let Some(at_zero) = self.set_at_zero {
                    let reason = "`set_at_zero` replaces `set`, and the factor has a `path`";
                    return Err(refuse(source, at_zero.span(), reason));
                }
                if path.get_ref().contains('=') {
                    let reason = "`path` names a value of the scenario, such as \"guests.count\"";
                    return Err(refuse(source, path.span(), reason));
                }
                FactorTarget::Path(path.into_inner())
            }
            (None, Some(changes)) => FactorTarget::Set {
                changes: changes.into_inner(),
                at_zero: self.set_at_zero.map(Spanned::into_inner),
            },
            _ => {
                let reason = "a factor has either `path` or `set`";
                return Err(refuse(source, span, reason));
            }
        };

        let values_span = self.values.span();
        let raw = self.values.into_inner();
        if raw.is_empty() || raw.len() > MAX_VALUES {
            let reason = format!("a factor has 1 to {MAX_VALUES} values");
            return Err(refuse(source, values_span, reason));
        }
        let mut values = Vec::new();
        let mut spans = Vec::new();
        for value in raw {
            let span = value.span();
            let value = value.into_inner().check();
            values.push(value.map_err(|reason| refuse(source, span.clone(), reason))?);
            spans.push(span);
        }

        Ok(Factor {
            name: name.into_inner(),
            values,
            spans,
            begins_s: self.begins.map(|begins| begins.into_inner().0),
            target,
        })
    }
}

impl RawValue {
    fn check(self) -> Result<FactorValue, String> {
        match self {
            Self::Flag(is_set) => Ok(FactorValue::Flag(is_set)),
            Self::Integer(number) => Ok(FactorValue::Integer(number)),
            Self::Number(number) if number.is_finite() => Ok(FactorValue::Number(number)),
            Self::Number(number) => Err(format!("{number} is not a finite number")),
            Self::Text(text) => match check_name(&text) {
                Ok(()) => Ok(FactorValue::of_text(text)),
                Err(error) => Err(error.to_string()),
            },
        }
    }
}

fn parse_arms(
    source: &Source,
    raw: Spanned<Vec<RawArm>>,
    conditions: &Conditions,
    duration_s: f64,
) -> Result<Vec<Arm>, FileError> {
    if raw.get_ref().is_empty() {
        let reason = "an experiment has at least one arm";
        return Err(refuse(source, raw.span(), reason));
    }

    let mut done: Vec<Condition> = conditions.named.clone();
    for factor in &conditions.factors {
        let levels = factor.levels(duration_s);
        done.extend(levels.map_err(|error| FileError::at(source, None, &error.to_string()))?);
    }

    let mut arms: Vec<Arm> = Vec::new();
    let mut yokes = Vec::new();
    for arm in raw.into_inner() {
        let name = named(source, arm.name)?;
        if arms.iter().any(|other| other.name == *name.get_ref()) {
            let reason = format!("there are two arms \"{}\"", name.get_ref());
            return Err(refuse(source, name.span(), reason));
        }

        let mut set: Vec<Setting> = Vec::new();
        for change in arm.set {
            let span = change.span();
            let parsed = change.get_ref().parse();
            let parsed = parsed.map_err(|reason: String| refuse(source, span.clone(), reason))?;
            let others = done.iter().map(|condition| condition.set.as_slice());
            for others in others.chain([set.as_slice()]) {
                check_change(&parsed, others)
                    .map_err(|error| refuse(source, span.clone(), error))?;
            }
            set.push(Setting::at(parsed, span));
        }

        let yoked_to = arm.yoked_to.as_ref().map(|to| to.get_ref().clone());
        yokes.extend(arm.yoked_to);
        arms.push(Arm {
            name: name.into_inner(),
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
            return Err(refuse(source, span, reason));
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
    Err(refuse(source, name.span(), reason))
}

fn check_measures(
    source: &Source,
    measures: Spanned<Vec<Measure>>,
    conditions: &Conditions,
    expectations: &[Spanned<Expectation>],
) -> Result<Vec<Measure>, FileError> {
    let span = measures.span();
    let measures = measures.into_inner();
    if measures.is_empty() || measures.len() > MAX_EXPERIMENT_MEASURES {
        let reason = format!("an experiment has 1 to {MAX_EXPERIMENT_MEASURES} measures");
        return Err(refuse(source, span, reason));
    }

    let mut columns = ReservedColumns::of(conditions);
    for (index, measure) in measures.iter().enumerate() {
        let name = &measure.name;
        if measures[..index].iter().any(|other| other.name == *name) {
            let reason = format!("there are two measures \"{name}\"");
            return Err(refuse(source, measure.span(), reason));
        }

        columns
            .add(name)
            .map_err(|reason| refuse(source, measure.span(), reason))?;
        for ending in OF_MEASURE {
            columns
                .add(&format!("{name}{ending}"))
                .map_err(|reason| refuse(source, measure.span(), reason))?;
        }
        measure
            .check_after(&measures[..index])
            .map_err(|error| refuse(source, measure.span(), error))?;
        check_head(measure, &measures[..index], conditions)
            .map_err(|reason| refuse(source, measure.span(), reason))?;
    }
    for expectation in expectations {
        columns
            .add(&expectation.get_ref().name)
            .map_err(|reason| refuse(source, expectation.span(), reason))?;
    }
    Ok(measures)
}

/// The names of the columns of the table of units.
struct ReservedColumns(BTreeSet<String>);

impl ReservedColumns {
    /// Those without measures and expectations.
    fn of(conditions: &Conditions) -> Self {
        let mut columns: BTreeSet<String> = RESERVED.iter().map(ToString::to_string).collect();
        for factor in &conditions.factors {
            columns.insert(factor.name.clone());
        }
        Self(columns)
    }

    fn add(&mut self, name: &str) -> Result<(), String> {
        if self.0.insert(name.to_owned()) {
            return Ok(());
        }
        Err(format!("results have a column \"{name}\" already"))
    }
}

/// Checks that the head of the column of a measure is not that of another column of the same table.
fn check_head(
    measure: &Measure,
    others: &[Measure],
    conditions: &Conditions,
) -> Result<(), String> {
    let Some(column) = &measure.column else {
        return Ok(());
    };

    let title = measure.title();
    let mut others = others.iter().filter(|other| other.column.is_some());
    let is_taken = others.any(|other| other.title() == title)
        || column == "arm"
        || *column == conditions.head();
    if is_taken {
        return Err(format!("a table has a column \"{title}\" already"));
    }
    Ok(())
}

#[cfg(test)]
mod tests;

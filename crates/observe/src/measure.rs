//! Measures: the numbers that are taken of each run, as defined in a file.

use std::ops::Range;

use config::units::Time;
use protocol::pattern::path_parts;
use protocol::{RobotName, RobotPattern};
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use toml::Spanned;

use crate::combine::By;
use crate::comparison::{TestError, TestTable};
use crate::condition::TickCondition;
use crate::counter::Counter;
use crate::expression::Expression;
use crate::pattern::{Pattern, PatternError};
use crate::quantity::{
    OfRobot, OfValues, PlaceKind, PlaceTable, QuantityError, RunQuantity, StateNames, Team,
    WhoseVariable,
};
use crate::words::{self, Word};
use crate::{RunSetting, TickConditionError};

/// Longest name of a measure, bytes.
const MAX_NAME_BYTES: usize = 100;
/// Most measures of a scenario.
pub const MAX_MEASURES: usize = 64;
/// Most numbers that are added on one side of a ratio.
const MAX_PARTS: usize = 64;

/// Definition of one number of each run.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "RawMeasure")]
pub struct Measure {
    /// Key of the number in results.
    pub name: String,
    /// Head of its column in tables, without the unit; a measure without a column is in the results only.
    pub column: Option<String>,
    /// Its unit, for people.
    pub unit: Option<String>,
    /// What it means, for people.
    pub what: Option<String>,
    /// Whether arms are compared by it.
    pub contrast: bool,
    /// Where the number comes from.
    pub kind: MeasureSource,
    /// Place of the kind in the file, bytes.
    span: Range<usize>,
}

/// Where the number of a measure comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum MeasureSource {
    /// Path of a number in the summary, parts joined by `.`. A part `*` is the sum over all entries.
    Summary(String),
    /// Number of events.
    Count(Count),
    /// Time to an event.
    Time(TimeTo),
    /// Durations between pairs of events.
    Between(Between),
    /// Share of the simulated time in which robots have one of these emotions or behaviors, 0 to 1, or how many of them have.
    Share(RunQuantity),
    /// A number of robots, places or sites.
    Number(Number),
    /// Time of the last progress before the robots come to a standstill.
    Stalled(Stalled),
    /// One number over another one.
    Ratio(Box<Ratio>),
    /// A number that is made of those of earlier measures.
    Expression(Expression),
    /// That of the scenario's measure of this name, for which an experiment puts its source.
    OfScenario(String),
}

/// A count of events.
#[derive(Debug, Clone, PartialEq)]
pub struct Count {
    /// The events.
    pub pattern: Pattern,
    /// Part of the run in which they count; `None` is the whole run.
    pub when: Option<When>,
}

/// A part of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum When {
    /// While the condition lasts.
    During,
    /// From the end of the condition on.
    After,
}

/// A number of robots, places or sites, which has a value in each tick.
#[derive(Debug, Clone, PartialEq)]
pub struct Number {
    /// What has it.
    pub quantity: RunQuantity,
    /// The number of its values that is taken.
    pub taken: OfValues,
}

/// The time from one condition to another, seconds. The events of a tick happen at the same time.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeTo {
    /// The first tick in which this holds, that of `after` or a later one, ends the time.
    pub to: TickCondition,
    /// The first tick in which this holds begins the time; without it the time begins with the run.
    pub after: Option<TickCondition>,
}

/// Durations between pairs of events, seconds. Events of a tick are taken in the order of the record, and an event that is both
/// an end and a begin ends one pair and begins the next.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Between {
    /// Begins a pair, unless one is open.
    pub begin: Pattern,
    /// Ends the pair that is open.
    pub end: Pattern,
    /// The number of the durations that is taken.
    #[serde(rename = "as")]
    pub number: OfDurations,
    /// Whether a pair that is open at the end of the run counts as one that ends there. Otherwise its duration is not known.
    #[serde(default)]
    pub until_end: bool,
}

/// A number of several durations. Of none, their mean and the longest do not exist.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OfDurations {
    /// Their mean, seconds.
    Mean,
    /// The longest, seconds.
    Max,
    /// Their sum, seconds.
    Sum,
    /// How many have ended.
    Count,
}

/// A standstill: none of these numbers rises for a time that lasts until the end of the run.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "RawStalled")]
pub struct Stalled {
    /// State variables that rise with progress toward a robot's goal.
    pub progress: Vec<Counter>,
    /// Shortest time without progress that counts, seconds.
    pub lasting_s: f64,
}

/// One number over another one.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ratio {
    /// What is divided.
    pub of: Parts,
    /// What it is divided by.
    pub by: Parts,
}

/// The numbers that are added to one side of a ratio: one, or a list. None of them is a ratio.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts(pub Vec<MeasureSource>);

impl<'de> Deserialize<'de> for Parts {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(PartsVisitor)
    }
}

struct PartsVisitor;

impl<'de> Visitor<'de> for PartsVisitor {
    type Value = Parts;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a number of the run such as { summary = \"ticks\" }, or a list of them")
    }

    fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<Parts, A::Error> {
        let RatioTerm(source) = RatioTerm::deserialize(MapAccessDeserializer::new(table))?;
        Ok(Parts(vec![source]))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Parts, A::Error> {
        let mut sources = Vec::new();
        while let Some(RatioTerm(source)) = list.next_element()? {
            if sources.len() == MAX_PARTS {
                let reason = format!("more than {MAX_PARTS} numbers are added");
                return Err(serde::de::Error::custom(reason));
            }
            sources.push(source);
        }
        if sources.is_empty() {
            return Err(serde::de::Error::invalid_length(0, &self));
        }
        Ok(Parts(sources))
    }
}

/// A number of a ratio.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "RawRatioTerm")]
struct RatioTerm(MeasureSource);

/// What a measure gives for one run: a number, or why there is none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "state", rename_all = "snake_case")]
pub enum Measured {
    /// A number, which is finite.
    Value {
        /// The number.
        value: f64,
    },
    /// A time whose event came.
    Reached {
        /// The time, seconds.
        time_s: f64,
    },
    /// A time whose event did not come before the end of the run: it is censored.
    NotReached {
        /// How long the run waited for the event, seconds.
        waited_s: f64,
    },
    /// A time that never began, because what it begins after did not happen. The run says nothing about it.
    NotAtRisk,
    /// The mean or the longest of durations of which the run has none.
    NoPair,
    /// The mean, the longest or the sum of durations one of which had not ended at the end of the run.
    Unfinished {
        /// The number if that duration had ended at the end of the run: the real one is not smaller.
        at_least: f64,
    },
    /// The run has no such number.
    Missing {
        /// The reason, for people.
        reason: String,
    },
}

impl Measured {
    /// The number, or the time that came; `None` in all other states.
    #[must_use]
    pub fn value(&self) -> Option<f64> {
        match self {
            Self::Value { value } => Some(*value),
            Self::Reached { time_s } => Some(*time_s),
            _ => None,
        }
    }

    /// A time as an analysis of survival takes it, with whether its event came; `None` for a run that was not at risk, and for
    /// what is no time.
    #[must_use]
    pub fn time(&self) -> Option<(f64, bool)> {
        match self {
            Self::Reached { time_s } => Some((*time_s, true)),
            Self::NotReached { waited_s } => Some((*waited_s, false)),
            _ => None,
        }
    }

    /// The state in a word, for tables.
    #[must_use]
    pub fn state(&self) -> &'static str {
        match self {
            Self::Value { .. } => "value",
            Self::Reached { .. } => "reached",
            Self::NotReached { .. } => "not reached",
            Self::NotAtRisk => "not at risk",
            Self::NoPair => "no pair",
            Self::Unfinished { .. } => "unfinished",
            Self::Missing { .. } => "missing",
        }
    }
}

impl std::fmt::Display for Measured {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Value { value } => write!(f, "{value}"),
            Self::Reached { time_s } => write!(f, "{time_s}"),
            Self::NotReached { waited_s } => write!(f, "not reached within {waited_s}"),
            Self::Unfinished { at_least } => write!(f, "unfinished, at least {at_least}"),
            Self::Missing { reason } => write!(f, "missing: {reason}"),
            Self::NotAtRisk | Self::NoPair => f.write_str(self.state()),
        }
    }
}

impl From<f64> for Measured {
    /// A number, if it is finite.
    fn from(value: f64) -> Self {
        if value.is_finite() {
            return Self::Value { value };
        }
        Self::Missing {
            reason: "it is not a finite number".to_owned(),
        }
    }
}

/// A measure that cannot be taken of any run.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MeasureError {
    /// It has no kind, or several.
    #[error(
        "a measure has exactly one of `summary`, `count`, `time`, `between`, `share`, `variable`, `walked`, `distance`, `inside`, \
         `covered`, `components`, `layer`, `stalled`, `jain`, `ratio` and `expression`; a part of a ratio is neither ratio nor expression, \
         and in an experiment a measure without any of them is the scenario's one of its name"
    )]
    NotOne,
    /// It names a part of the run and counts no events.
    #[error("`when` is for `count` only")]
    NoEvents,
    /// Its name is empty, or too long, or has control characters or blanks around it.
    #[error(
        "a name has 1 to {MAX_NAME_BYTES} bytes, no control characters, and no blanks before or after it"
    )]
    Name,
    /// A share names no states.
    #[error("`share` names either `emotion` or `behavior`, with one word or several")]
    NoStates,
    /// Two events that may be those of different robots.
    #[error(
        "`{0}` and `{1}` leave open whose events they are, so those of different robots would make pairs: name `{2}` in both, or \
         write `{2} = \"*\"` for every robot"
    )]
    Open(&'static str, &'static str, &'static str),
    /// A number of robots, places or sites that cannot be taken.
    #[error(transparent)]
    RunQuantity(#[from] QuantityError),
    /// What a variable is compared with is wrong.
    #[error(transparent)]
    Test(#[from] TestError),
    /// A pattern of events that the run does not have.
    #[error(transparent)]
    Pattern(#[from] PatternError),
    /// A condition that no tick can have.
    #[error(transparent)]
    Condition(#[from] TickConditionError),
    /// An expression names what is no earlier measure.
    #[error("`expression` names \"{name}\", and {earlier}")]
    NotEarlier {
        /// The name.
        name: String,
        /// The measures that there are.
        earlier: String,
    },
    /// A kind that only experiments measure.
    #[error(
        "a measure of a scenario has no `{0}`, which is for experiments: `summary.json` has such numbers"
    )]
    NotLive(&'static str),
    /// Two measures have the same name.
    #[error("a second measure called \"{0}\"")]
    Twice(String),
    /// There are too many.
    #[error("more than {MAX_MEASURES} measures")]
    TooMany,
    /// It counts the verdicts about an expectation that there is not.
    #[error("there is no expectation \"{0}\"")]
    NoExpectation(String),
    /// A standstill without a duration or variables.
    #[error("`stalled` names the variables of progress, and a time that is more than zero")]
    NoProgress,
}

/// A measure as written in the file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMeasure {
    name: Spanned<String>,
    column: Option<String>,
    unit: Option<String>,
    what: Option<String>,
    #[serde(default)]
    contrast: bool,
    when: Option<When>,
    summary: Option<Spanned<String>>,
    count: Option<Spanned<Pattern>>,
    time: Option<Spanned<TimeTo>>,
    between: Option<Spanned<Between>>,
    share: Option<Spanned<RawShare>>,
    variable: Option<Spanned<RawVariable>>,
    walked: Option<Spanned<PlaceTable>>,
    distance: Option<Spanned<PlaceTable>>,
    inside: Option<Spanned<PlaceTable>>,
    covered: Option<Spanned<PlaceTable>>,
    components: Option<Spanned<PlaceTable>>,
    layer: Option<Spanned<PlaceTable>>,
    stalled: Option<Spanned<Stalled>>,
    jain: Option<Spanned<RawJain>>,
    ratio: Option<Spanned<Ratio>>,
    expression: Option<Spanned<Expression>>,
}

/// A part of a ratio as written in the file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRatioTerm {
    when: Option<When>,
    summary: Option<Spanned<String>>,
    count: Option<Spanned<Pattern>>,
    time: Option<Spanned<TimeTo>>,
    between: Option<Spanned<Between>>,
    share: Option<Spanned<RawShare>>,
    variable: Option<Spanned<RawVariable>>,
    walked: Option<Spanned<PlaceTable>>,
    distance: Option<Spanned<PlaceTable>>,
    inside: Option<Spanned<PlaceTable>>,
    covered: Option<Spanned<PlaceTable>>,
    components: Option<Spanned<PlaceTable>>,
    layer: Option<Spanned<PlaceTable>>,
    stalled: Option<Spanned<Stalled>>,
    jain: Option<Spanned<RawJain>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawShare {
    robot: Option<RobotName>,
    robots: Option<Team>,
    by: Option<By>,
    emotion: Option<OneOrMoreWords>,
    behavior: Option<OneOrMoreWords>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawVariable {
    robot: Option<RobotName>,
    robots: Option<Team>,
    site: Option<RobotName>,
    sites: Option<Team>,
    by: Option<By>,
    name: String,
    /// If it is given: the number of each is whether its variable passes.
    each: Option<TestTable>,
    #[serde(rename = "as")]
    taken: OfValues,
}

/// Short for a variable of robots by `jain` at the end.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawJain {
    robot: RobotPattern,
    name: String,
}

/// One word, or several.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "a word, or a list of words")]
enum OneOrMoreWords {
    One(String),
    Several(Vec<String>),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStalled {
    progress: Vec<Counter>,
    #[serde(rename = "for")]
    lasting: Time,
}

impl TryFrom<RawMeasure> for Measure {
    type Error = MeasureError;

    fn try_from(raw: RawMeasure) -> Result<Self, MeasureError> {
        check_name(raw.name.get_ref())?;
        let part = RawRatioTerm {
            when: raw.when,
            summary: raw.summary,
            count: raw.count,
            time: raw.time,
            between: raw.between,
            share: raw.share,
            variable: raw.variable,
            walked: raw.walked,
            distance: raw.distance,
            inside: raw.inside,
            covered: raw.covered,
            components: raw.components,
            layer: raw.layer,
            stalled: raw.stalled,
            jain: raw.jain,
        };
        let (kind, span) = match (raw.ratio, raw.expression, part.check()?) {
            (None, None, Some(kind)) => kind,
            (Some(ratio), None, None) => {
                spanned(ratio, |ratio| MeasureSource::Ratio(Box::new(ratio)))
            }
            (None, Some(expression), None) => spanned(expression, MeasureSource::Expression),
            (None, None, None) => spanned(raw.name.clone(), MeasureSource::OfScenario),
            _ => return Err(MeasureError::NotOne),
        };

        Ok(Self {
            name: raw.name.into_inner(),
            column: raw.column,
            unit: raw.unit,
            what: raw.what,
            contrast: raw.contrast,
            kind,
            span,
        })
    }
}

impl TryFrom<RawRatioTerm> for RatioTerm {
    type Error = MeasureError;

    fn try_from(raw: RawRatioTerm) -> Result<Self, MeasureError> {
        let (kind, _) = raw.check()?.ok_or(MeasureError::NotOne)?;
        Ok(Self(kind))
    }
}

impl RawRatioTerm {
    /// The kind and its place in the file; `None` if there is none.
    fn check(self) -> Result<Option<(MeasureSource, Range<usize>)>, MeasureError> {
        if self.when.is_some() && self.count.is_none() {
            return Err(MeasureError::NoEvents);
        }

        if let Some(time) = &self.time
            && let Some(after) = &time.get_ref().after
        {
            for begin in after.patterns() {
                for end in time.get_ref().to.patterns() {
                    check_pair(("after", begin), ("to", end), &["robot"])?;
                }
            }
        }
        if let Some(between) = &self.between {
            let Between { begin, end, .. } = between.get_ref();
            check_pair(("begin", begin), ("end", end), &["robot", "from", "to"])?;
        }

        let when = self.when;
        let kinds = [
            self.summary
                .map(|path| spanned(path, MeasureSource::Summary)),
            self.count.map(|pattern| {
                spanned(pattern, |pattern| {
                    MeasureSource::Count(Count { pattern, when })
                })
            }),
            self.time.map(|time| spanned(time, MeasureSource::Time)),
            self.between
                .map(|between| spanned(between, MeasureSource::Between)),
            checked(self.share, RawShare::check)?,
            checked(self.variable, RawVariable::check)?,
            place(PlaceKind::Walked, self.walked)?,
            place(PlaceKind::Distance, self.distance)?,
            place(PlaceKind::Inside, self.inside)?,
            place(PlaceKind::Covered, self.covered)?,
            place(PlaceKind::Components, self.components)?,
            place(PlaceKind::Layer, self.layer)?,
            self.stalled
                .map(|stalled| spanned(stalled, MeasureSource::Stalled)),
            self.jain.map(|jain| spanned(jain, RawJain::source)),
        ];
        let mut kinds = kinds.into_iter().flatten();
        let kind = kinds.next();
        if kinds.next().is_some() {
            return Err(MeasureError::NotOne);
        }
        Ok(kind)
    }
}

/// Checks that two patterns, each with its key, say whose events they are where the events of both have the field: events of
/// different robots make no pair unless that is wanted. One that names a robot makes pairs with any robot of one that does not.
fn check_pair(
    (key, one): (&'static str, &Pattern),
    (other_key, other): (&'static str, &Pattern),
    fields: &[&'static str],
) -> Result<(), MeasureError> {
    for field in fields {
        let is_in_both = one.has_robot(field) && other.has_robot(field);
        if is_in_both && (one.leaves_open(field) || other.leaves_open(field)) {
            return Err(MeasureError::Open(key, other_key, field));
        }
    }
    Ok(())
}

fn spanned<T>(
    raw: Spanned<T>,
    kind: impl FnOnce(T) -> MeasureSource,
) -> (MeasureSource, Range<usize>) {
    let span = raw.span();
    (kind(raw.into_inner()), span)
}

type Sourced = (MeasureSource, Range<usize>);

fn checked<T>(
    raw: Option<Spanned<T>>,
    check: impl FnOnce(T) -> Result<MeasureSource, MeasureError>,
) -> Result<Option<Sourced>, MeasureError> {
    let Some(raw) = raw else {
        return Ok(None);
    };
    let span = raw.span();
    Ok(Some((check(raw.into_inner())?, span)))
}

fn place(
    kind: PlaceKind,
    table: Option<Spanned<PlaceTable>>,
) -> Result<Option<Sourced>, MeasureError> {
    checked(table, |table| {
        let taken = table.number.unwrap_or_default();
        let quantity = table.check(kind)?;
        Ok(MeasureSource::Number(Number { quantity, taken }))
    })
}

/// Checks the name of a measure, of a factor, of an arm or of a condition: it is printed in tables.
///
/// # Errors
/// [`MeasureError::Name`].
pub fn check_name(name: &str) -> Result<(), MeasureError> {
    let is_short = (1..=MAX_NAME_BYTES).contains(&name.len());
    let is_bare = name.trim() == name;
    if is_short && is_bare && !name.chars().any(char::is_control) {
        return Ok(());
    }
    Err(MeasureError::Name)
}

/// The word that the path of a number in the summary of a robot ends with.
fn word_of(path: &str) -> Option<Word> {
    let parts = path_parts(path);
    let ["robots", robot, table, word @ ..] = &parts[..] else {
        return None;
    };
    // A word may have dots.
    let word = word.join(".");
    let kind = match *table {
        "emotions_s" => words::WordKind::Emotion,
        "behaviors_s" | "entered" => words::WordKind::Behavior,
        "sent" => words::WordKind::Command,
        _ => return None,
    };

    let is_any = *robot == "*";
    (word != "*" && !word.is_empty()).then(|| Word {
        kind,
        robots: if is_any {
            Vec::new()
        } else {
            vec![(*robot).to_owned()]
        },
        word,
    })
}

impl RawShare {
    fn check(self) -> Result<MeasureSource, MeasureError> {
        let states = match (self.emotion, self.behavior) {
            (Some(emotions), None) => StateNames::Emotions(emotions.list()?),
            (None, Some(behaviors)) => StateNames::Behaviors(behaviors.list()?),
            _ => return Err(MeasureError::NoStates),
        };
        let of = OfRobot::State(states);
        let quantity = RunQuantity::each("share", self.robot, self.robots, self.by, of)?;
        Ok(MeasureSource::Share(quantity))
    }
}

impl RawVariable {
    fn check(self) -> Result<MeasureSource, MeasureError> {
        let test = match self.each {
            Some(table) => Some(table.check()?.ok_or(TestError::Nothing)?),
            None => None,
        };
        let whose = WhoseVariable {
            robot: self.robot,
            robots: self.robots,
            site: self.site,
            sites: self.sites,
            by: self.by,
        };
        let quantity = RunQuantity::variable(whose, self.name, test)?;
        let taken = self.taken;
        Ok(MeasureSource::Number(Number { quantity, taken }))
    }
}

impl RawJain {
    fn source(self) -> MeasureSource {
        MeasureSource::Number(Number {
            quantity: RunQuantity::Each {
                team: Team::One(self.robot),
                by: Some(By::Jain),
                of: OfRobot::Variable(self.name, None),
            },
            taken: OfValues::End,
        })
    }
}

impl OneOrMoreWords {
    fn list(self) -> Result<Vec<String>, MeasureError> {
        match self {
            Self::One(word) => Ok(vec![word]),
            Self::Several(words) if words.is_empty() => Err(MeasureError::NoStates),
            Self::Several(words) => Ok(words),
        }
    }
}

impl TryFrom<RawStalled> for Stalled {
    type Error = MeasureError;

    fn try_from(raw: RawStalled) -> Result<Self, MeasureError> {
        if raw.progress.is_empty() || raw.lasting.0 <= 0.0 {
            return Err(MeasureError::NoProgress);
        }
        Ok(Self {
            progress: raw.progress,
            lasting_s: raw.lasting.0,
        })
    }
}

impl Measure {
    /// Whether it is a time to an event, which does not come in every run.
    #[must_use]
    pub fn is_time(&self) -> bool {
        matches!(
            self.kind,
            MeasureSource::Time(_) | MeasureSource::Stalled(_)
        )
    }

    /// Head of its column in tables, with the unit; its name if it has no column.
    #[must_use]
    pub fn title(&self) -> String {
        let column = self.column.as_ref().unwrap_or(&self.name);
        match &self.unit {
            Some(unit) => format!("{column}, {unit}"),
            None => column.clone(),
        }
    }

    /// What the measure means, where its name does not show it.
    #[must_use]
    pub fn explained(&self) -> Option<String> {
        if let Some(what) = &self.what {
            return Some(format!("{}: {what}", self.name));
        }
        let MeasureSource::Stalled(stalled) = &self.kind else {
            return None;
        };

        let variables: Vec<String> = stalled.progress.iter().map(Counter::to_string).collect();
        Some(format!(
            "{}: none of {} rises for {} s or more until the end of the run. The time to it is that of the last\n\
             rise; its median over the runs is by Kaplan and Meier, runs without it being censored at their end.",
            self.name,
            variables.join(", "),
            stalled.lasting_s
        ))
    }

    /// Takes the source of a scenario's measure, and what is said of that one and not of it.
    pub fn take_source(&mut self, of_scenario: &Self) {
        self.kind = of_scenario.kind.clone();
        self.unit = self.unit.take().or_else(|| of_scenario.unit.clone());
        self.what = self.what.take().or_else(|| of_scenario.what.clone());
    }

    /// Place in the file of what it measures, bytes.
    #[must_use]
    pub fn span(&self) -> Range<usize> {
        self.span.clone()
    }

    /// Checks that a run can have what it measures.
    ///
    /// # Errors
    /// [`MeasureError`].
    pub fn check(&self, setting: &RunSetting) -> Result<(), MeasureError> {
        for source in self.sources() {
            match source {
                MeasureSource::Share(quantity) | MeasureSource::Number(Number { quantity, .. }) => {
                    quantity.check(setting)?;
                }
                MeasureSource::Time(time) => {
                    for condition in time.after.iter().chain([&time.to]) {
                        condition.check(setting)?;
                    }
                }
                MeasureSource::Count(count) => count.pattern.check_sites(setting)?,
                MeasureSource::Between(between) => {
                    between.begin.check_sites(setting)?;
                    between.end.check_sites(setting)?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Checks it as a measure that follows others in a file: an expression names such ones only.
    ///
    /// # Errors
    /// [`MeasureError::NotEarlier`].
    pub fn check_after(&self, earlier: &[Self]) -> Result<(), MeasureError> {
        let MeasureSource::Expression(expression) = &self.kind else {
            return Ok(());
        };
        for name in expression.names() {
            if earlier.iter().any(|measure| measure.name == name) {
                continue;
            }
            let known: Vec<&str> = earlier
                .iter()
                .map(|measure| measure.name.as_str())
                .collect();
            return Err(MeasureError::NotEarlier {
                name: name.to_owned(),
                earlier: match known.is_empty() {
                    true => "no measure is before it".to_owned(),
                    false => format!("before it there are {}", known.join(", ")),
                },
            });
        }
        Ok(())
    }

    /// The sources that its number is made of: its own, or those of the parts of a ratio.
    #[must_use]
    pub fn sources(&self) -> Vec<&MeasureSource> {
        match &self.kind {
            MeasureSource::Ratio(ratio) => ratio.of.0.iter().chain(&ratio.by.0).collect(),
            source => vec![source],
        }
    }

    /// The words that robots choose and that it names.
    pub(crate) fn words(&self) -> Vec<Word> {
        let sources = self.sources().into_iter();
        sources.flat_map(MeasureSource::words).collect()
    }

    /// The expectations whose verdicts it counts or waits for.
    #[must_use]
    pub fn expectations(&self) -> Vec<&str> {
        let sources = self.sources().into_iter();
        sources.flat_map(MeasureSource::expectations).collect()
    }

    /// The state variables that it needs: robots, or patterns of them, and names.
    #[must_use]
    pub fn variables(&self) -> Vec<(&str, &str)> {
        let sources = self.sources().into_iter();
        sources.flat_map(MeasureSource::variables).collect()
    }

    /// The robots that it names, or patterns of them. A run has the number only if its roster has them.
    #[must_use]
    pub fn robots(&self) -> Vec<&str> {
        let sources = self.sources().into_iter();
        sources.flat_map(MeasureSource::robots).collect()
    }
}

impl MeasureSource {
    fn words(&self) -> Vec<Word> {
        match self {
            Self::Count(count) => count.pattern.words(),
            Self::Time(time) => {
                let mut named = time.to.words();
                named.extend(time.after.iter().flat_map(TickCondition::words));
                named
            }
            Self::Between(between) => {
                let mut named = between.begin.words();
                named.extend(between.end.words());
                named
            }
            Self::Share(quantity) => quantity.words(),
            Self::Summary(path) => word_of(path).into_iter().collect(),
            Self::Number(_)
            | Self::Stalled(_)
            | Self::Ratio(_)
            | Self::Expression(_)
            | Self::OfScenario(_) => Vec::new(),
        }
    }

    fn expectations(&self) -> Vec<&str> {
        let patterns = match self {
            Self::Count(count) => vec![&count.pattern],
            Self::Time(time) => {
                let conditions = time.after.iter().chain([&time.to]);
                conditions.flat_map(TickCondition::patterns).collect()
            }
            Self::Between(between) => vec![&between.begin, &between.end],
            Self::Summary(_)
            | Self::Share(_)
            | Self::Number(_)
            | Self::Stalled(_)
            | Self::Ratio(_)
            | Self::Expression(_)
            | Self::OfScenario(_) => Vec::new(),
        };
        let named = patterns.into_iter().flat_map(Pattern::expectations);
        named.collect()
    }

    fn variables(&self) -> Vec<(&str, &str)> {
        match self {
            Self::Number(number) => number.quantity.variables(),
            Self::Time(time) => {
                let conditions = time.after.iter().chain([&time.to]);
                conditions.flat_map(TickCondition::variables).collect()
            }
            Self::Stalled(stalled) => {
                let progress = stalled.progress.iter();
                progress
                    .map(|counter| (counter.robots.as_str(), counter.variable.as_str()))
                    .collect()
            }
            _ => Vec::new(),
        }
    }

    fn robots(&self) -> Vec<&str> {
        match self {
            Self::Summary(path) => match path_parts(path)[..] {
                ["robots", robot, ..] if robot != "*" => vec![robot],
                _ => Vec::new(),
            },
            Self::Count(count) => count.pattern.robots().collect(),
            Self::Time(time) => {
                let mut named = time.to.robots();
                named.extend(time.after.iter().flat_map(TickCondition::robots));
                named
            }
            Self::Between(between) => {
                let ends = between.end.robots();
                between.begin.robots().chain(ends).collect()
            }
            Self::Share(quantity) | Self::Number(Number { quantity, .. }) => {
                let patterns = quantity.patterns().iter();
                patterns.map(RobotPattern::as_str).collect()
            }
            Self::Stalled(stalled) => {
                let progress = stalled.progress.iter();
                progress.map(|counter| counter.robots.as_str()).collect()
            }
            Self::Ratio(_) | Self::Expression(_) | Self::OfScenario(_) => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measure(text: &str) -> Result<Measure, String> {
        let text = format!("name = 'x'\n{text}");
        toml::from_str(&text).map_err(|error| error.message().to_owned())
    }

    #[test]
    fn a_measure_knows_its_robots_and_its_title() {
        for (text, robots) in [
            ("summary = 'robots.Butler.missed'", &["Butler"][..]),
            ("summary = 'robots.*.missed'", &[]),
            ("summary = 'network.sent'", &[]),
            (
                "count = { event = 'behavior', robot = ['A', 'B'] }",
                &["A", "B"],
            ),
            (
                "time = { to = { event = 'lost', robot = 'A' }, after = { event = 'link_cut', to = 'B' } }",
                &["A", "B"],
            ),
            (
                "between = { begin = { event = 'lost', robot = 'A' }, end = { event = 'joined', robot = 'B' }, as = 'sum' }",
                &["A", "B"],
            ),
            ("share = { robot = 'A', emotion = 'HAPPY' }", &["A"]),
            (
                "variable = { robot = 'A', name = 'served', as = 'end' }",
                &["A"],
            ),
            (
                "stalled = { progress = ['A.x', 'B.y'], for = '1 s' }",
                &["A", "B"],
            ),
            ("jain = { robot = 'S*', name = 'trips' }", &["S*"]),
            ("summary = 'robots.S{1..20}.sent.*'", &["S{1..20}"]),
            (
                "stalled = { progress = ['S*.x', 'S{1..2}.y'], for = '1 s' }",
                &["S*", "S{1..2}"],
            ),
            (
                "ratio = { of = { summary = 'robots.A.missed' }, by = { jain = { robot = 'S*', name = 'x' } } }",
                &["A", "S*"],
            ),
        ] {
            assert_eq!(measure(text).unwrap().robots(), robots, "{text}");
        }

        let mut one = measure("summary = 'ticks'").unwrap();
        assert_eq!(one.title(), "x");
        one.column = Some("ticks".to_owned());
        one.unit = Some("1".to_owned());
        assert_eq!(one.title(), "ticks, 1");
    }

    #[test]
    fn what_cannot_be_measured_is_refused() {
        for (text, reason) in [
            (
                "between = { begin = { event = 'behavior', to = 'X' }, end = { event = 'behavior', from = 'X' }, as = 'sum' }",
                "name `robot` in both, or write `robot = \"*\"`",
            ),
            (
                "between = { begin = { event = 'command_sent', from = 'A' }, end = { event = 'command_delivered', from = 'A' }, \
                 as = 'sum' }",
                "name `to` in both",
            ),
            (
                "time = { after = { event = 'lost' }, to = { event = 'joined' } }",
                "`after` and `to` leave open whose events they are",
            ),
            // One of them is enough.
            (
                "time = { after = { event = 'lost', robot = 'A' }, to = { event = 'joined' } }",
                "`after` and `to` leave open whose events they are",
            ),
            (
                "between = { begin = { event = 'behavior', to = 'X' }, \
                 end = { event = 'behavior', robot = 'A', from = 'X' }, as = 'sum' }",
                "name `robot` in both",
            ),
            (
                "summary = 'a'\nstalled = { progress = ['A.x'], for = '1 s' }",
                "exactly one of",
            ),
            (
                "summary = 'a'\nratio = { of = { summary = 'a' }, by = { summary = 'b' } }",
                "exactly one of",
            ),
            ("ratio = { of = { summary = 'a' } }", "missing field `by`"),
            (
                "ratio = { of = [], by = { summary = 'b' } }",
                "or a list of them",
            ),
            (
                "ratio = { of = 'a', by = { summary = 'b' } }",
                "a number of the run such as",
            ),
            (
                "ratio = { of = { summary = 'a' }, by = {} }",
                "exactly one of",
            ),
            (
                "ratio = { of = { ratio = {} }, by = { summary = 'b' } }",
                "unknown field `ratio`",
            ),
            (
                "ratio = { of = { summary = 'a', when = 'during' }, by = { summary = 'b' } }",
                "`when` is for `count`",
            ),
            (
                "jain = { robot = 'S /', name = 'x' }",
                "is not a usable name",
            ),
            ("summary = 'a'\nwhen = 'during'", "`when` is for `count`"),
            (
                "count = { event = 'lost' }\nwhen = 'before'",
                "unknown variant",
            ),
            ("count = { event = 'loss' }", "no event \"loss\""),
            (
                "time = { after = { event = 'lost' } }",
                "missing field `to`",
            ),
            (
                "time = { to = { event = 'lost', who = 'A' } }",
                "no field `who`",
            ),
            (
                "between = { begin = { event = 'lost' }, end = { event = 'joined' }, as = 'median' }",
                "unknown variant `median`",
            ),
            (
                "between = { begin = { event = 'lost' }, as = 'sum' }",
                "missing field `end`",
            ),
            ("share = { robot = 'A' }", "either `emotion` or `behavior`"),
            (
                "share = { robot = 'A', emotion = [] }",
                "either `emotion` or `behavior`",
            ),
            (
                "share = { robot = 'A', emotion = 3 }",
                "a word, or a list of words",
            ),
            (
                "share = { robot = 'A', emotion = 'X', behavior = 'Y' }",
                "either `emotion` or `behavior`",
            ),
            (
                "variable = { robot = 'A', name = 'x' }",
                "missing field `as`",
            ),
            (
                "variable = { robot = 'A/B', name = 'x', as = 'end' }",
                "name",
            ),
            (
                "stalled = { progress = ['x'], for = '1 s' }",
                "not a state variable",
            ),
            (
                "stalled = { progress = ['A.x'], for = '0 s' }",
                "more than zero",
            ),
            (
                "stalled = { progress = [], for = '1 s' }",
                "variables of progress",
            ),
        ] {
            let error = measure(text).unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
        for name in ["", " ", "\u{a0}", " x", "x "] {
            let text = format!("name = '{name}'\nsummary = 'ticks'");
            assert!(toml::from_str::<Measure>(&text).is_err(), "{name:?}");
        }
        assert!(toml::from_str::<Measure>("name = \"a\\nb\"\nsummary = 'ticks'").is_err());
    }
}

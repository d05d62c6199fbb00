//! What holds in a tick, or happens in it.

use config::units::Time;
use protocol::messages::{Point, Variable};
use protocol::time::tick_seconds;
use protocol::{Event, RobotName, Tick};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::pattern::{Pattern, PatternError};
use crate::words::{self, Word};
use crate::{Observation, RobotState, Setting};

/// Kinds of events that a tick gets after its conditions are evaluated.
const AFTER_THE_TICK: [&str; 2] = ["tick", "end"];
/// Most alternatives of a condition.
const MAX_ALTERNATIVES: usize = 64;
/// How far two bodies may overlap and still count as touching, as in the environment.
const TOLERANCE_M: f64 = 1e-9;
/// Longest text of an event in a reason, characters.
const MAX_EVENT_CHARS: usize = 200;

/// What holds in a tick, or happens in it: one of these alternatives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Value", into = "Value")]
pub struct TickCondition(Vec<Alternative>);

/// A condition that cannot be checked.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TickConditionError {
    /// The pattern of its events cannot match.
    #[error(transparent)]
    Pattern(#[from] PatternError),
    /// It is not one of the conditions that there are.
    #[error(
        "a condition is an event (`event = …`), a state of a robot (`robot = …` with `behavior`, `emotion` or `variable`), \
         `overlap` or `stalled`"
    )]
    Unknown,
    /// A table that has the wrong fields.
    #[error("{0}")]
    Fields(String),
    /// It has no alternative, or too many.
    #[error("a list of conditions has 1 to {MAX_ALTERNATIVES} of them")]
    Count,
    /// `for` is not a time that passes.
    #[error("`for` is more than zero")]
    Lasting,
    /// A variable without a bound.
    #[error("`variable` needs `at_least`, `at_most`, `above` or `below`, with a finite number")]
    Bound,
    /// No number is within the bounds.
    #[error("no number is within the bounds of `variable`")]
    NoNumber,
    /// No behavior, or no emotion, is named.
    #[error("`{0}` names at least one")]
    NoName(&'static str),
    /// Fewer than two robots that could overlap.
    #[error("`overlap` is \"any\", or a list of at least two robots")]
    Overlap,
    /// A robot that the run does not have.
    #[error("no robot of this scenario is called {0}")]
    UnknownRobot(String),
    /// Events of this kind come after the end of a tick is decided.
    #[error("`end_when` cannot name the event \"{0}\": the end of the run is decided before it")]
    TooLate(String),
    /// No variable of progress, or one without its robot.
    #[error("`progress` is a list of state variables, each with its robot: \"Butler.served\"")]
    Progress,
}

#[derive(Debug, Clone, PartialEq)]
enum Alternative {
    Event(Pattern),
    State(LastingState),
    Overlap(Option<Vec<RobotName>>),
    Stalled(StalledCondition),
}

/// A state of a robot, which may have to last.
#[derive(Debug, Clone, PartialEq)]
struct LastingState {
    robot: RobotName,
    is: Is,
    lasting: Option<Time>,
}

#[derive(Debug, Clone, PartialEq)]
enum Is {
    Behavior(Vec<String>),
    Emotion(Vec<String>),
    Variable(String, ValueBounds),
}

/// The values of a variable; a flag is 1 or 0. All bounds that are given hold.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct ValueBounds {
    at_least: Option<f64>,
    at_most: Option<f64>,
    above: Option<f64>,
    below: Option<f64>,
}

/// That no state variable of progress has risen for a time.
#[derive(Debug, Clone, PartialEq)]
struct StalledCondition {
    progress: Vec<VariableOfRobot>,
    lasting: Time,
}

/// A state variable and its robot.
#[derive(Debug, Clone, PartialEq)]
struct VariableOfRobot {
    robot: RobotName,
    variable: String,
}

/// A condition on a state as written.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct ConditionTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    robot: Option<RobotName>,
    #[serde(skip_serializing_if = "Option::is_none")]
    behavior: Option<Names>,
    #[serde(skip_serializing_if = "Option::is_none")]
    emotion: Option<Names>,
    #[serde(skip_serializing_if = "Option::is_none")]
    variable: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    at_least: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    at_most: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    above: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    below: Option<f64>,
    #[serde(rename = "for", skip_serializing_if = "Option::is_none")]
    lasting: Option<Time>,
    #[serde(skip_serializing_if = "Option::is_none")]
    overlap: Option<Names>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stalled: Option<StalledTable>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StalledTable {
    progress: Vec<String>,
    #[serde(rename = "for")]
    lasting: Time,
}

/// A name, or a list of names.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(untagged, expecting = "a name or a list of names")]
enum Names {
    One(String),
    Several(Vec<String>),
}

impl From<Names> for Vec<String> {
    fn from(names: Names) -> Self {
        match names {
            Names::One(name) => vec![name],
            Names::Several(names) => names,
        }
    }
}

impl From<&Vec<String>> for Names {
    fn from(names: &Vec<String>) -> Self {
        match &names[..] {
            [name] => Self::One(name.clone()),
            names => Self::Several(names.to_vec()),
        }
    }
}

/// A list with one element is written as that element.
pub(crate) fn one_or_list(mut values: Vec<Value>) -> Value {
    if values.len() == 1 {
        return values.remove(0);
    }
    Value::Array(values)
}

impl TryFrom<Value> for TickCondition {
    type Error = TickConditionError;

    fn try_from(value: Value) -> Result<Self, TickConditionError> {
        let entries = match value {
            Value::Array(entries) => entries,
            one => vec![one],
        };
        if !(1..=MAX_ALTERNATIVES).contains(&entries.len()) {
            return Err(TickConditionError::Count);
        }

        let mut alternatives = Vec::new();
        for entry in entries {
            alternatives.push(Alternative::try_from(entry)?);
        }
        Ok(Self(alternatives))
    }
}

impl From<TickCondition> for Value {
    fn from(condition: TickCondition) -> Self {
        one_or_list(condition.0.iter().map(Alternative::to_value).collect())
    }
}

impl TryFrom<Value> for Alternative {
    type Error = TickConditionError;

    fn try_from(value: Value) -> Result<Self, TickConditionError> {
        let Value::Object(fields) = &value else {
            return Err(TickConditionError::Unknown);
        };
        if fields.contains_key("event") {
            return Ok(Self::Event(Pattern::try_from(value)?));
        }
        // JSON has no infinity: an infinite bound would not be there.
        if fields.values().any(Value::is_null) {
            return Err(TickConditionError::Bound);
        }

        let table: ConditionTable = serde_json::from_value(value)
            .map_err(|error| TickConditionError::Fields(error.to_string()))?;
        table.check()
    }
}

impl ConditionTable {
    fn check(self) -> Result<Alternative, TickConditionError> {
        if self.lasting.is_some_and(|lasting| lasting.0 <= 0.0) {
            return Err(TickConditionError::Lasting);
        }

        let bounds = ValueBounds {
            at_least: self.at_least,
            at_most: self.at_most,
            above: self.above,
            below: self.below,
        };
        let has_state =
            self.behavior.is_some() || self.emotion.is_some() || self.variable.is_some();
        let has_rest = has_state || self.lasting.is_some() || bounds != ValueBounds::default();
        match (self.robot, self.overlap, self.stalled) {
            (None, Some(overlap), None) if !has_rest => check_overlap(overlap),
            (None, None, Some(stalled)) if !has_rest => check_stalled(&stalled),
            (Some(robot), None, None) => {
                let is = match (self.behavior, self.emotion, self.variable) {
                    (Some(names), None, None) if bounds == ValueBounds::default() => {
                        Is::Behavior(at_least_one("behavior", names)?)
                    }
                    (None, Some(names), None) if bounds == ValueBounds::default() => {
                        Is::Emotion(at_least_one("emotion", names)?)
                    }
                    (None, None, Some(_)) if bounds == ValueBounds::default() => {
                        return Err(TickConditionError::Bound);
                    }
                    (None, None, Some(_)) if bounds.are_contradictory() => {
                        return Err(TickConditionError::NoNumber);
                    }
                    (None, None, Some(variable)) => Is::Variable(variable, bounds),
                    _ => return Err(TickConditionError::Unknown),
                };
                Ok(Alternative::State(LastingState {
                    robot,
                    is,
                    lasting: self.lasting,
                }))
            }
            _ => Err(TickConditionError::Unknown),
        }
    }
}

fn at_least_one(key: &'static str, names: Names) -> Result<Vec<String>, TickConditionError> {
    let names: Vec<String> = names.into();
    if names.is_empty() {
        return Err(TickConditionError::NoName(key));
    }
    Ok(names)
}

impl ValueBounds {
    /// Whether no number is within them.
    fn are_contradictory(&self) -> bool {
        let above = |low: f64| {
            self.at_most.is_some_and(|high| high < low)
                || self.below.is_some_and(|high| high <= low)
        };
        let strictly_above = |low: f64| {
            self.at_most.is_some_and(|high| high <= low)
                || self.below.is_some_and(|high| high <= low)
        };
        self.at_least.is_some_and(above) || self.above.is_some_and(strictly_above)
    }
}

fn check_overlap(names: Names) -> Result<Alternative, TickConditionError> {
    let names = match names {
        Names::One(any) if any == "any" => return Ok(Alternative::Overlap(None)),
        Names::One(_) => return Err(TickConditionError::Overlap),
        Names::Several(names) => names,
    };

    let mut robots = Vec::new();
    for name in names {
        let robot = RobotName::new(&name);
        robots.push(robot.map_err(|error| TickConditionError::Fields(error.to_string()))?);
    }
    robots.sort();
    robots.dedup();
    if robots.len() < 2 {
        return Err(TickConditionError::Overlap);
    }
    Ok(Alternative::Overlap(Some(robots)))
}

fn check_stalled(table: &StalledTable) -> Result<Alternative, TickConditionError> {
    if table.lasting.0 <= 0.0 {
        return Err(TickConditionError::Lasting);
    }
    if table.progress.is_empty() {
        return Err(TickConditionError::Progress);
    }

    let mut progress = Vec::new();
    for text in &table.progress {
        let (robot, variable) = text.split_once('.').ok_or(TickConditionError::Progress)?;
        let robot = RobotName::new(robot).map_err(|_| TickConditionError::Progress)?;
        progress.push(VariableOfRobot {
            robot,
            variable: variable.to_owned(),
        });
    }
    Ok(Alternative::Stalled(StalledCondition {
        progress,
        lasting: table.lasting,
    }))
}

impl Alternative {
    fn to_value(&self) -> Value {
        let mut table = ConditionTable::default();
        match self {
            Self::Event(pattern) => return pattern.clone().into(),
            Self::State(LastingState { robot, is, lasting }) => {
                table.robot = Some(robot.clone());
                table.lasting = *lasting;
                match is {
                    Is::Behavior(names) => table.behavior = Some(names.into()),
                    Is::Emotion(names) => table.emotion = Some(names.into()),
                    Is::Variable(name, bounds) => {
                        table.variable = Some(name.clone());
                        table.at_least = bounds.at_least;
                        table.at_most = bounds.at_most;
                        table.above = bounds.above;
                        table.below = bounds.below;
                    }
                }
            }
            Self::Overlap(None) => table.overlap = Some(Names::One("any".to_owned())),
            Self::Overlap(Some(robots)) => {
                let names = robots.iter().map(RobotName::to_string);
                table.overlap = Some(Names::Several(names.collect()));
            }
            Self::Stalled(stalled) => {
                let progress = stalled.progress.iter().map(VariableOfRobot::to_string);
                table.stalled = Some(StalledTable {
                    progress: progress.collect(),
                    lasting: stalled.lasting,
                });
            }
        }

        serde_json::to_value(table)
            .unwrap_or_else(|error| unreachable!("a condition is always JSON: {error}"))
    }
}

impl std::fmt::Display for VariableOfRobot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.robot, self.variable)
    }
}

impl TickCondition {
    /// Checks that a run of these robots can end when it holds.
    ///
    /// # Errors
    /// [`TickConditionError::UnknownRobot`], and [`TickConditionError::TooLate`] for events that a tick gets after its end is
    /// decided.
    pub fn check_end(&self, roster: &[RobotName]) -> Result<(), TickConditionError> {
        let mut kinds = self.patterns().map(Pattern::kind);
        if let Some(kind) = kinds.find(|kind| AFTER_THE_TICK.contains(kind)) {
            return Err(TickConditionError::TooLate(kind.to_owned()));
        }
        match self.unknown_robot(roster) {
            Some(name) => Err(TickConditionError::UnknownRobot(name)),
            None => Ok(()),
        }
    }

    /// The first robot that it names and a run of these robots does not have.
    pub(crate) fn unknown_robot(&self, roster: &[RobotName]) -> Option<String> {
        let mut named = self.robots().into_iter();
        let unknown = named.find(|name| !is_known(name, roster))?;
        Some(unknown.to_owned())
    }

    /// The patterns of its events.
    pub(crate) fn patterns(&self) -> impl Iterator<Item = &Pattern> {
        self.0.iter().filter_map(|alternative| match alternative {
            Alternative::Event(pattern) => Some(pattern),
            _ => None,
        })
    }

    /// The words that robots choose and that it names.
    pub(crate) fn words(&self) -> Vec<Word> {
        let mut named = Vec::new();
        for alternative in &self.0 {
            match alternative {
                Alternative::Event(pattern) => named.extend(pattern.words()),
                Alternative::State(state) => named.extend(state.words()),
                Alternative::Overlap(_) | Alternative::Stalled(_) => {}
            }
        }
        named
    }

    /// Whether it depends on anything but events.
    pub(crate) fn needs_states(&self) -> bool {
        let mut alternatives = self.0.iter();
        alternatives.any(|alternative| !matches!(alternative, Alternative::Event(_)))
    }

    /// The robots that it names.
    pub(crate) fn robots(&self) -> Vec<&str> {
        let mut robots = Vec::new();
        for alternative in &self.0 {
            match alternative {
                Alternative::Event(pattern) => robots.extend(pattern.robots()),
                Alternative::State(state) => robots.push(state.robot.as_str()),
                Alternative::Overlap(named) => {
                    robots.extend(named.iter().flatten().map(RobotName::as_str));
                }
                Alternative::Stalled(stalled) => {
                    robots.extend(
                        stalled
                            .progress
                            .iter()
                            .map(|counter| counter.robot.as_str()),
                    );
                }
            }
        }

        robots
    }
}

/// Whether a run of these robots has the robot, or the operator is meant.
pub(crate) fn is_known(name: &str, roster: &[RobotName]) -> bool {
    let is_operator = name == RobotName::operator().as_str();
    is_operator || roster.iter().any(|robot| robot.as_str() == name)
}

impl LastingState {
    fn words(&self) -> Vec<Word> {
        let (kind, states) = match &self.is {
            Is::Emotion(states) => (words::WordKind::Emotion, states),
            Is::Behavior(states) => (words::WordKind::Behavior, states),
            Is::Variable(..) => return Vec::new(),
        };

        let mut named = Vec::new();
        for state in states {
            named.push(Word {
                kind,
                robots: vec![self.robot.to_string()],
                word: state.clone(),
            });
        }
        named
    }
}

/// A condition while a run is observed.
#[derive(Debug, Clone)]
pub struct Evaluation {
    alternatives: Vec<Tracked>,
    tick_s: f64,
    body_m: f64,
    roster: Vec<RobotName>,
}

/// An alternative, and what is remembered of it from tick to tick.
#[derive(Debug, Clone)]
struct Tracked {
    alternative: Alternative,
    /// The first tick of those up to now in which a state has held without a break, or in which there was no progress.
    since: Option<Tick>,
    /// The last values of the variables of progress.
    before: Vec<Option<f64>>,
    /// What a robot would have to publish so that the alternative can hold, and has not published yet.
    unknown: Option<String>,
}

impl Evaluation {
    /// Begins to evaluate a condition in a run.
    #[must_use]
    pub fn new(condition: &TickCondition, setting: &Setting) -> Self {
        let mut alternatives = Vec::new();
        for alternative in &condition.0 {
            alternatives.push(Tracked {
                alternative: alternative.clone(),
                since: None,
                before: Vec::new(),
                unknown: None,
            });
        }

        Self {
            alternatives,
            tick_s: setting.tick_s,
            body_m: setting.body_m,
            roster: setting.roster.clone(),
        }
    }

    /// Evaluates the condition for a tick, each once and in their order. Returns why it holds, in words; `None` if it does not.
    pub fn holds(&mut self, seen: &Observation<'_>) -> Option<String> {
        let mut reason = None;
        for tracked in &mut self.alternatives {
            // All of them, because some depend on the ticks before.
            let held = match &tracked.alternative {
                Alternative::Event(pattern) => first_event(std::slice::from_ref(pattern), seen),
                Alternative::Overlap(named) => {
                    let robots = named.as_deref().unwrap_or(&self.roster);
                    overlap(robots, self.body_m, seen)
                }
                Alternative::State(_) => tracked.state(self.tick_s, seen),
                Alternative::Stalled(_) => tracked.stalled(self.tick_s, seen),
            };
            reason = reason.or(held);
        }

        reason
    }

    /// What is not known of the last tick, so that the condition cannot be said not to hold.
    #[must_use]
    pub fn unknown(&self) -> Option<&str> {
        self.alternatives
            .iter()
            .find_map(|tracked| tracked.unknown.as_deref())
    }
}

/// The first event of a tick that one of the patterns matches, in words.
pub(crate) fn first_event(patterns: &[Pattern], seen: &Observation<'_>) -> Option<String> {
    let mut events = seen.events.iter();
    let event = events.find(|event| patterns.iter().any(|pattern| pattern.matches(event)))?;
    Some(in_words(event))
}

/// An event in words, as in the log; those that the log leaves out by their kind and as JSON.
fn in_words(event: &Event) -> String {
    let text = match event.log_record(0, 0, 0.0) {
        Some(record) if record.source == "simulator" => record.text,
        Some(record) => format!("{} {}", record.source, record.text),
        None => serde_json::to_string(event).unwrap_or_else(|_| event.kind().to_owned()),
    };
    shortened(text, MAX_EVENT_CHARS)
}

/// The beginning of a text that is longer than `max` characters.
pub(crate) fn shortened(text: String, max: usize) -> String {
    if text.chars().count() <= max {
        return text;
    }
    let beginning: String = text.chars().take(max).collect();
    format!("{beginning}…")
}

/// The number of ticks in which a time has passed.
pub(crate) fn ticks_in(time: Time, tick_s: f64) -> Tick {
    // Times and lengths of ticks are read from decimal fractions: 0.3 s are three ticks of 0.1 s.
    (time.0 / tick_s - 1e-6).ceil().max(0.0) as Tick
}

impl Tracked {
    fn state(&mut self, tick_s: f64, seen: &Observation<'_>) -> Option<String> {
        let Alternative::State(condition) = &self.alternative else {
            return None;
        };
        let robot = &condition.robot;
        let known = (seen.state)(robot).and_then(|state| Some((state, condition.is.holds(state)?)));
        let Some((state, holds)) = known else {
            // Without a report, or such a number, nothing is known of the state, and a time without a
            // break begins anew.
            self.since = None;
            self.unknown
                .get_or_insert_with(|| condition.is.unknown(robot));
            return None;
        };
        self.unknown = None;
        if !holds {
            self.since = None;
            return None;
        }

        // The words are made only where they are needed: this runs in every tick.
        let since = *self.since.get_or_insert(seen.tick);
        let Some(lasting) = condition.lasting else {
            return Some(condition.is.in_words(robot, state));
        };
        // In the tick in which it begins a state has lasted for no time.
        if seen.tick - since < ticks_in(lasting, tick_s) {
            return None;
        }
        Some(format!(
            "{} for {} s, since {}",
            condition.is.in_words(robot, state),
            lasting.0,
            place(since, tick_s)
        ))
    }

    fn stalled(&mut self, tick_s: f64, seen: &Observation<'_>) -> Option<String> {
        let Alternative::Stalled(stalled) = &self.alternative else {
            return None;
        };

        let mut has_risen = false;
        let mut missing = None;
        // A counter that is lower than before, because its robot began anew, is no progress; the next
        // rise is.
        self.before.resize(stalled.progress.len(), None);
        for (counter, before) in stalled.progress.iter().zip(&mut self.before) {
            let state = (seen.state)(&counter.robot);
            let value = state.and_then(|state| number(state, &counter.variable));
            if let (Some(before), Some(value)) = (*before, value) {
                has_risen |= value > before;
            }
            if value.is_none() {
                missing = missing.or(Some(counter));
            }
            *before = value;
        }
        self.unknown =
            missing.map(|VariableOfRobot { robot, variable }| unpublished(robot, variable));

        if has_risen {
            self.since = Some(seen.tick);
        }
        let since = *self.since.get_or_insert(seen.tick);
        if seen.tick - since < ticks_in(stalled.lasting, tick_s) {
            return None;
        }
        let names: Vec<String> = stalled
            .progress
            .iter()
            .map(VariableOfRobot::to_string)
            .collect();
        Some(format!(
            "no progress ({}) for {} s, since {}",
            names.join(", "),
            stalled.lasting.0,
            place(since, tick_s)
        ))
    }
}

impl Is {
    /// Whether a robot is in the state; `None` if it publishes no such number.
    fn holds(&self, state: RobotState<'_>) -> Option<bool> {
        match self {
            Self::Behavior(names) => Some(names.iter().any(|name| name == state.behavior_state)),
            Self::Emotion(names) => Some(names.iter().any(|name| name == state.emotion_state)),
            Self::Variable(name, bounds) => Some(bounds.hold(number(state, name)?)),
        }
    }

    /// Why it is not known whether a robot is in the state.
    fn unknown(&self, robot: &RobotName) -> String {
        match self {
            Self::Behavior(_) | Self::Emotion(_) => format!("{robot} has not reported"),
            Self::Variable(name, _) => unpublished(robot, name),
        }
    }

    fn in_words(&self, robot: &RobotName, state: RobotState<'_>) -> String {
        match self {
            Self::Behavior(_) => format!("the behavior of {robot} is {}", state.behavior_state),
            Self::Emotion(_) => format!("the emotion of {robot} is {}", state.emotion_state),
            Self::Variable(name, _) => {
                let value = number(state, name).unwrap_or_default();
                format!("`{name}` of {robot} is {value}")
            }
        }
    }
}

fn unpublished(robot: &RobotName, variable: &str) -> String {
    format!("{robot} publishes no number `{variable}`")
}

/// A tick and its time, in words.
pub(crate) fn place(tick: Tick, tick_s: f64) -> String {
    format!("tick {tick} ({} s)", tick_seconds(tick, tick_s))
}

fn number(state: RobotState<'_>, variable: &str) -> Option<f64> {
    match state.state_variables.get(variable)? {
        Variable::Number(number) => Some(*number),
        Variable::Flag(flag) => Some(f64::from(*flag)),
        Variable::Text(_) => None,
    }
}

impl ValueBounds {
    fn hold(&self, value: f64) -> bool {
        self.at_least.is_none_or(|bound| value >= bound)
            && self.at_most.is_none_or(|bound| value <= bound)
            && self.above.is_none_or(|bound| value > bound)
            && self.below.is_none_or(|bound| value < bound)
    }
}

/// Two of these robots that overlap: the first pair from left to right.
fn overlap(robots: &[RobotName], body_m: f64, seen: &Observation<'_>) -> Option<String> {
    let mut placed: Vec<(Point, &RobotName)> = Vec::with_capacity(robots.len());
    for robot in robots {
        if let Some(state) = (seen.state)(robot) {
            placed.push((state.location, robot));
        }
    }
    placed.sort_by(|(one, _), (other, _)| one.x.total_cmp(&other.x));

    let apart_m = body_m - TOLERANCE_M;
    for (index, (one, robot)) in placed.iter().enumerate() {
        let near = placed[index + 1..]
            .iter()
            .take_while(|(other, _)| other.x - one.x < apart_m);
        for (other, name) in near {
            if (other.y - one.y).abs() < apart_m {
                let mut names = [robot, name];
                names.sort();
                let [first, second] = names;
                return Some(format!(
                    "{first} and {second} overlap near {:.2} m, {:.2} m",
                    one.x, one.y
                ));
            }
        }
    }
    None
}

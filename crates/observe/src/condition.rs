//! What holds in a tick, or happens in it.

use config::units::Time;
use protocol::messages::Point;
use protocol::pattern::matches;
use protocol::time::tick_seconds;
use protocol::{Event, RobotName, RobotPattern, Tick};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::combine::By;
use crate::comparison::{TestError, TestTable, ValueList, ValueTest};
use crate::counter::{self, Counter};
use crate::pattern::{Pattern, PatternError};
use crate::quantity::{
    OfRobot, PlaceKind, PlaceTable, QuantityError, QuantityGauge, RunQuantity, StateNames, Team,
    WhoseVariable, number,
};
use crate::words::{self, Word};
use crate::{Observation, RobotState, RunSetting};

/// Kinds of events that a tick gets after its conditions are evaluated.
const AFTER_THE_TICK: [&str; 2] = ["tick", "end"];
/// Most alternatives of a condition.
const MAX_ALTERNATIVES: usize = 64;
/// Most conditions of a condition, and how deep they may be in each other.
const MAX_PARTS: usize = 256;
const MAX_DEPTH: usize = 8;
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
        "a condition is an event (`event = …`), a state of a robot or of several (`robot = …` or `robots = …` with `behavior`, \
         `emotion` or `variable`), a state of a site or of several (`site = …` or `sites = …` with `variable`), a number of places (`walked`, `distance`, `inside`, `covered`, `components`) or of a `layer`, `overlap`, \
         `stalled`, or several conditions (`all = […]`)"
    )]
    Unknown,
    /// A number of robots, places or sites that cannot be taken.
    #[error(transparent)]
    RunQuantity(#[from] QuantityError),
    /// What a variable is compared with is wrong.
    #[error(transparent)]
    Test(#[from] TestError),
    /// `each` where nothing is combined, or where the other bounds are those of each.
    #[error(
        "`each` is for several robots or sites whose numbers become one, such as `by = \"count\"`: leave it out, and name what \
         one has beside `variable`"
    )]
    Each,
    /// A number of several robots or sites is compared with what is no number.
    #[error(
        "`is` beside `by = \"{0}\"` is of one number: what each has is named by `each = {{ is = … }}`"
    )]
    NoNumberOfAll(By),
    /// A condition has a number that is taken over the run.
    #[error("a condition is about each tick: leave `as` out")]
    OverTheRun,
    /// There are bounds where nothing is compared.
    #[error("`{0}` is true or false: leave the bounds out")]
    Truth(String),
    /// A number without a bound.
    #[error("{0} needs `at_least`, `at_most`, `above`, `below` or `is`, with a finite number")]
    Unbound(String),
    /// Too many conditions in a condition, or too deep in each other.
    #[error("a condition has at most {MAX_PARTS} conditions, {MAX_DEPTH} deep in each other")]
    TooMany,
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
    #[error(
        "`variable` needs `at_least`, `at_most`, `above` or `below`, with a finite number, or `is` with a value"
    )]
    Bound,
    /// No behavior, or no emotion, is named.
    #[error("`{0}` names at least one")]
    NoName(&'static str),
    /// Fewer than two robots that could overlap.
    #[error(
        "`overlap` is \"any\", a pattern such as \"S*\", or a list of names and patterns, of at least two robots"
    )]
    Overlap,
    /// A robot that the run does not have.
    #[error("no robot of this scenario is called {0}")]
    UnknownRobot(String),
    /// Events of this kind come after the end of a tick is decided.
    #[error("`end_when` cannot name the event \"{0}\": the end of the run is decided before it")]
    TooLate(String),
    /// No variable of progress, or one without its robot.
    #[error(
        "`progress` is a list of state variables, each with its robot or a pattern of robots: \"Butler.served\", \"S*.served\""
    )]
    Progress,
}

#[derive(Debug, Clone, PartialEq)]
enum Alternative {
    Event(Pattern),
    State(LastingState),
    Number(LastingNumber),
    All(LastingAll),
    Overlap(Option<Vec<RobotPattern>>),
    Stalled(StalledCondition),
}

/// A number of robots, places or sites that is compared, which may have to last. A truth is not.
#[derive(Debug, Clone, PartialEq)]
struct LastingNumber {
    quantity: RunQuantity,
    test: Option<ValueTest>,
    lasting: Option<Time>,
}

/// Conditions that hold at the same time, which may have to last.
#[derive(Debug, Clone, PartialEq)]
struct LastingAll {
    parts: Vec<TickCondition>,
    lasting: Option<Time>,
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
    Variable(String, ValueTest),
}

/// That no state variable of progress has risen for a time.
#[derive(Debug, Clone, PartialEq)]
struct StalledCondition {
    progress: Vec<Counter>,
    lasting: Time,
}

/// A condition on a state as written.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct ConditionTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    robot: Option<RobotName>,
    #[serde(skip_serializing_if = "Option::is_none")]
    robots: Option<Team>,
    #[serde(skip_serializing_if = "Option::is_none")]
    site: Option<RobotName>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sites: Option<Team>,
    #[serde(skip_serializing_if = "Option::is_none")]
    by: Option<By>,
    #[serde(skip_serializing_if = "Option::is_none")]
    behavior: Option<Names>,
    #[serde(skip_serializing_if = "Option::is_none")]
    emotion: Option<Names>,
    #[serde(skip_serializing_if = "Option::is_none")]
    variable: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    each: Option<TestTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    is: Option<ValueList>,
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
    walked: Option<PlaceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    distance: Option<PlaceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    inside: Option<PlaceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    covered: Option<PlaceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    components: Option<PlaceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    layer: Option<PlaceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    all: Option<Vec<TickCondition>>,
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
        let condition = Self(alternatives);
        if condition.parts() > MAX_PARTS || condition.depth() > MAX_DEPTH {
            return Err(TickConditionError::TooMany);
        }
        Ok(condition)
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
    fn check(mut self) -> Result<Alternative, TickConditionError> {
        if self.lasting.is_some_and(|lasting| lasting.0 <= 0.0) {
            return Err(TickConditionError::Lasting);
        }

        let place = self.take_place();
        let is_of_sites = self.site.is_some() || self.sites.is_some();
        let subjects = [
            self.robot.is_some() || self.robots.is_some() || is_of_sites,
            place.is_some(),
            self.all.is_some(),
            self.overlap.is_some(),
            self.stalled.is_some(),
        ];
        let is_one = subjects.iter().filter(|is_given| **is_given).count() == 1;
        let has_state =
            self.behavior.is_some() || self.emotion.is_some() || self.variable.is_some();
        let is_foreign = has_state || self.by.is_some() || self.each.is_some();
        if !is_one || (!subjects[0] && is_foreign) {
            return Err(TickConditionError::Unknown);
        }

        let test = self.take_test()?;
        let lasting = self.lasting;
        let is_plain = test.is_none();
        if let Some((kind, table)) = place {
            if table.number.is_some() {
                return Err(TickConditionError::OverTheRun);
            }
            let quantity = table.check(kind)?;
            return compared(format!("`{}`", kind.key()), quantity, test, lasting);
        }
        match (self.all.take(), self.overlap.take(), self.stalled.take()) {
            (Some(parts), None, None) if is_plain => {
                if !(1..=MAX_ALTERNATIVES).contains(&parts.len()) {
                    return Err(TickConditionError::Count);
                }
                Ok(Alternative::All(LastingAll { parts, lasting }))
            }
            (None, Some(overlap), None) if is_plain && lasting.is_none() => check_overlap(overlap),
            (None, None, Some(stalled)) if is_plain && lasting.is_none() => check_stalled(&stalled),
            (None, None, None) if is_of_sites => self.check_sites(test),
            (None, None, None) if self.robots.is_some() || self.by.is_some() => {
                self.check_team(test)
            }
            (None, None, None) => self.check_robot(test),
            _ => Err(TickConditionError::Unknown),
        }
    }

    fn take_test(&mut self) -> Result<Option<ValueTest>, TestError> {
        TestTable {
            is: self.is.take(),
            at_least: self.at_least,
            at_most: self.at_most,
            above: self.above,
            below: self.below,
        }
        .check()
    }

    /// The number of places that it has; `None` if it has none or several.
    fn take_place(&mut self) -> Option<(PlaceKind, PlaceTable)> {
        let tables = [
            self.walked.take(),
            self.distance.take(),
            self.inside.take(),
            self.covered.take(),
            self.components.take(),
            self.layer.take(),
        ];
        let mut places = PlaceKind::ALL
            .into_iter()
            .zip(tables)
            .filter_map(|(kind, table)| Some((kind, table?)));
        let place = places.next();
        place.filter(|_| places.next().is_none())
    }

    /// A state of one robot.
    fn check_robot(self, test: Option<ValueTest>) -> Result<Alternative, TickConditionError> {
        let Some(robot) = self.robot else {
            return Err(TickConditionError::Unknown);
        };
        if self.each.is_some() {
            return Err(TickConditionError::Each);
        }
        let is = match (self.behavior, self.emotion, self.variable, test) {
            (Some(names), None, None, None) => Is::Behavior(at_least_one("behavior", names)?),
            (None, Some(names), None, None) => Is::Emotion(at_least_one("emotion", names)?),
            (None, None, Some(variable), Some(test)) => Is::Variable(variable, test),
            (None, None, Some(_), None) => return Err(TickConditionError::Bound),
            _ => return Err(TickConditionError::Unknown),
        };
        Ok(Alternative::State(LastingState {
            robot,
            is,
            lasting: self.lasting,
        }))
    }

    /// A state of several robots.
    fn check_team(mut self, test: Option<ValueTest>) -> Result<Alternative, TickConditionError> {
        let (key, of) = match (
            self.behavior.take(),
            self.emotion.take(),
            self.variable.take(),
        ) {
            (Some(names), None, None) if self.each.is_none() => {
                let names = at_least_one("behavior", names)?;
                ("behavior", OfRobot::State(StateNames::Behaviors(names)))
            }
            (None, Some(names), None) if self.each.is_none() => {
                let names = at_least_one("emotion", names)?;
                ("emotion", OfRobot::State(StateNames::Emotions(names)))
            }
            (None, None, Some(variable)) => return self.check_variable(variable, test),
            _ => return Err(TickConditionError::Unknown),
        };
        let quantity = RunQuantity::each(key, self.robot, self.robots, self.by, of)?;
        compared(format!("`{key}`"), quantity, test, self.lasting)
    }

    /// A state of one site or of several.
    fn check_sites(mut self, test: Option<ValueTest>) -> Result<Alternative, TickConditionError> {
        match self.variable.take() {
            Some(variable) if self.behavior.is_none() && self.emotion.is_none() => {
                self.check_variable(variable, test)
            }
            _ => Err(TickConditionError::Unknown),
        }
    }

    /// A variable of a site, or of several robots or sites.
    fn check_variable(
        self,
        variable: String,
        test: Option<ValueTest>,
    ) -> Result<Alternative, TickConditionError> {
        let each = match self.each {
            Some(table) => Some(table.check()?.ok_or(TestError::Nothing)?),
            None => None,
        };
        // What is named beside all, or any, is of each, and so is what a single site has beside numbers.
        let (of_each, of_all) = match self.by {
            Some(By::All | By::Any) if each.is_some() && test.is_some() => {
                return Err(TickConditionError::Each);
            }
            Some(By::All | By::Any) => (each.or(test), None),
            None if each.is_some() => return Err(TickConditionError::Each),
            None if test.as_ref().is_some_and(|test| !test.is_of_numbers()) => (test, None),
            Some(by) if test.as_ref().is_some_and(|test| !test.is_of_numbers()) => {
                return Err(TickConditionError::NoNumberOfAll(by));
            }
            _ => (each, test),
        };
        let whose = WhoseVariable {
            robot: self.robot,
            robots: self.robots,
            site: self.site,
            sites: self.sites,
            by: self.by,
        };
        let quantity = RunQuantity::variable(whose, variable, of_each)?;
        compared("`variable`".to_owned(), quantity, of_all, self.lasting)
    }
}

/// A number that is compared. A truth is not, and any other number is.
fn compared(
    key: String,
    quantity: RunQuantity,
    test: Option<ValueTest>,
    lasting: Option<Time>,
) -> Result<Alternative, TickConditionError> {
    match (quantity.is_truth(), &test) {
        (true, Some(_)) => return Err(TickConditionError::Truth(key)),
        (false, None) => return Err(TickConditionError::Unbound(key)),
        (false, Some(test)) if !test.is_of_numbers() => {
            return Err(TickConditionError::Unbound(key));
        }
        _ => {}
    }
    Ok(Alternative::Number(LastingNumber {
        quantity,
        test,
        lasting,
    }))
}

fn at_least_one(key: &'static str, names: Names) -> Result<Vec<String>, TickConditionError> {
    let names: Vec<String> = names.into();
    if names.is_empty() {
        return Err(TickConditionError::NoName(key));
    }
    Ok(names)
}

fn check_overlap(names: Names) -> Result<Alternative, TickConditionError> {
    let names = match names {
        Names::One(any) if any == "any" => return Ok(Alternative::Overlap(None)),
        names => Vec::from(names),
    };

    let mut robots = Vec::new();
    for name in names {
        let robot = RobotPattern::new(&name);
        robots.push(robot.map_err(|error| TickConditionError::Fields(error.to_string()))?);
    }
    robots.sort();
    robots.dedup();
    // How many robots a pattern matches is known with the roster.
    if robots.len() < 2 && !robots.iter().any(RobotPattern::is_open) {
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
        let counter = Counter::try_from(text.clone());
        progress.push(counter.map_err(|_| TickConditionError::Progress)?);
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
                    Is::Variable(name, test) => {
                        table.variable = Some(name.clone());
                        table.set_test(Some(test));
                    }
                }
            }
            Self::Number(number) => table.set_number(number),
            Self::All(all) => {
                table.all = Some(all.parts.clone());
                table.lasting = all.lasting;
            }
            Self::Overlap(None) => table.overlap = Some(Names::One("any".to_owned())),
            Self::Overlap(Some(robots)) => {
                let names: Vec<String> = robots.iter().map(RobotPattern::to_string).collect();
                table.overlap = Some(Names::from(&names));
            }
            Self::Stalled(stalled) => {
                let progress = stalled.progress.iter().map(Counter::to_string);
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

impl ConditionTable {
    fn set_test(&mut self, test: Option<&ValueTest>) {
        let table = TestTable::of(test);
        self.is = table.is;
        self.at_least = table.at_least;
        self.at_most = table.at_most;
        self.above = table.above;
        self.below = table.below;
    }

    fn set_number(&mut self, number: &LastingNumber) {
        self.lasting = number.lasting;
        self.set_test(number.test.as_ref());
        if let Some((kind, table)) = PlaceTable::of(&number.quantity) {
            let place = match kind {
                PlaceKind::Walked => &mut self.walked,
                PlaceKind::Distance => &mut self.distance,
                PlaceKind::Inside => &mut self.inside,
                PlaceKind::Covered => &mut self.covered,
                PlaceKind::Components => &mut self.components,
                PlaceKind::Layer => &mut self.layer,
            };
            *place = Some(table);
            return;
        }

        match &number.quantity {
            RunQuantity::Each { team, by, of } => {
                self.robots = Some(team.clone());
                self.by = *by;
                match of {
                    OfRobot::State(StateNames::Behaviors(names)) => {
                        self.behavior = Some(names.into());
                    }
                    OfRobot::State(StateNames::Emotions(names)) => {
                        self.emotion = Some(names.into());
                    }
                    OfRobot::Variable(name, test) => self.set_variable(name, test.as_ref()),
                    OfRobot::Walked | OfRobot::DistanceTo(_) | OfRobot::Inside(_) => {}
                }
            }
            RunQuantity::Sites {
                sites,
                by,
                variable,
                test,
            } => {
                match (by, sites) {
                    (None, Team::One(name)) => self.site = RobotName::new(name.as_str()).ok(),
                    _ => self.sites = Some(sites.clone()),
                }
                self.by = *by;
                self.set_variable(variable, test.as_ref());
            }
            RunQuantity::Between { .. }
            | RunQuantity::Covered { .. }
            | RunQuantity::Components { .. }
            | RunQuantity::Layer { .. } => {}
        }
    }

    /// A variable of each, with what each is compared with.
    fn set_variable(&mut self, name: &str, of_each: Option<&ValueTest>) {
        self.variable = Some(name.to_owned());
        match self.by {
            _ if of_each.is_none() => {}
            Some(By::All | By::Any) | None => self.set_test(of_each),
            Some(_) => self.each = Some(TestTable::of(of_each)),
        }
    }
}

impl TickCondition {
    /// Checks that a run can end when it holds.
    ///
    /// # Errors
    /// As [`Self::check`], and [`TickConditionError::TooLate`] for events that a tick gets after its end is decided.
    pub fn check_end(&self, setting: &RunSetting) -> Result<(), TickConditionError> {
        let mut kinds = self.patterns().into_iter().map(Pattern::kind);
        if let Some(kind) = kinds.find(|kind| AFTER_THE_TICK.contains(kind)) {
            return Err(TickConditionError::TooLate(kind.to_owned()));
        }
        self.check(setting)
    }

    /// Checks that a run has what it names.
    ///
    /// # Errors
    /// [`TickConditionError::UnknownRobot`], or a number of robots or places that the run does not have.
    pub fn check(&self, setting: &RunSetting) -> Result<(), TickConditionError> {
        let mut numbers = Vec::new();
        self.visit(&mut |alternative| {
            if let Alternative::Number(number) = alternative {
                numbers.push(&number.quantity);
            }
        });
        for quantity in numbers {
            quantity.check(setting)?;
        }
        for pattern in self.patterns() {
            pattern.check_sites(setting)?;
        }

        for name in self.robots() {
            if !is_known(name, &setting.roster) {
                return Err(TickConditionError::UnknownRobot(name.to_owned()));
            }
        }
        let mut can_overlap = true;
        self.visit(&mut |alternative| {
            if let Alternative::Overlap(Some(named)) = alternative {
                can_overlap &= matching(named, &setting.roster).len() >= 2;
            }
        });
        if can_overlap {
            return Ok(());
        }
        Err(TickConditionError::Overlap)
    }

    /// The patterns of its events.
    pub(crate) fn patterns(&self) -> Vec<&Pattern> {
        let mut patterns = Vec::new();
        self.visit(&mut |alternative| {
            if let Alternative::Event(pattern) = alternative {
                patterns.push(pattern);
            }
        });
        patterns
    }

    /// The words that robots choose and that it names.
    pub(crate) fn words(&self) -> Vec<Word> {
        let mut named = Vec::new();
        self.visit(&mut |alternative| match alternative {
            Alternative::Event(pattern) => named.extend(pattern.words()),
            Alternative::State(state) => named.extend(state.words()),
            Alternative::Number(number) => named.extend(number.quantity.words()),
            Alternative::All(_) | Alternative::Overlap(_) | Alternative::Stalled(_) => {}
        });
        named
    }

    /// Whether it depends on anything but events and sites, whose states follow from events.
    pub(crate) fn needs_states(&self) -> bool {
        let mut needs = false;
        self.visit(&mut |alternative| {
            needs |= match alternative {
                Alternative::Event(_) | Alternative::All(_) => false,
                Alternative::Number(number) => !number.quantity.is_of_sites(),
                Alternative::State(_) | Alternative::Overlap(_) | Alternative::Stalled(_) => true,
            };
        });
        needs
    }

    /// The robots that it names, or patterns of them.
    pub(crate) fn robots(&self) -> Vec<&str> {
        let mut robots = Vec::new();
        self.visit(&mut |alternative| match alternative {
            Alternative::Event(pattern) => robots.extend(pattern.robots()),
            Alternative::State(state) => robots.push(state.robot.as_str()),
            Alternative::Number(number) => {
                let patterns = number.quantity.patterns().iter();
                robots.extend(patterns.map(RobotPattern::as_str));
            }
            Alternative::All(_) => {}
            Alternative::Overlap(named) => {
                robots.extend(named.iter().flatten().map(RobotPattern::as_str));
            }
            Alternative::Stalled(stalled) => {
                let progress = stalled.progress.iter();
                robots.extend(progress.map(|counter| counter.robots.as_str()));
            }
        });
        robots
    }

    /// The state variables that it needs: robots, or patterns of them, and names.
    pub(crate) fn variables(&self) -> Vec<(&str, &str)> {
        let mut variables = Vec::new();
        self.visit(&mut |alternative| match alternative {
            Alternative::State(state) => {
                if let Is::Variable(name, _) = &state.is {
                    variables.push((state.robot.as_str(), name.as_str()));
                }
            }
            Alternative::Number(number) => variables.extend(number.quantity.variables()),
            Alternative::Stalled(stalled) => {
                for Counter { robots, variable } in &stalled.progress {
                    variables.push((robots.as_str(), variable.as_str()));
                }
            }
            Alternative::Event(_) | Alternative::All(_) | Alternative::Overlap(_) => {}
        });
        variables
    }

    /// Shows each alternative, and those of the conditions in it.
    fn visit<'a>(&'a self, see: &mut impl FnMut(&'a Alternative)) {
        let mut open: Vec<&Self> = vec![self];
        while let Some(condition) = open.pop() {
            for alternative in &condition.0 {
                see(alternative);
                if let Alternative::All(all) = alternative {
                    open.extend(all.parts.iter().rev());
                }
            }
        }
    }

    /// Number of all conditions in it.
    fn parts(&self) -> usize {
        let mut parts = 0;
        self.visit(&mut |_| parts += 1);
        parts
    }

    /// How deep conditions are in each other.
    fn depth(&self) -> usize {
        let mut deepest = 0;
        for alternative in &self.0 {
            if let Alternative::All(all) = alternative {
                let parts = all.parts.iter().map(Self::depth);
                deepest = parts.fold(deepest, usize::max);
            }
        }
        deepest + 1
    }
}

/// Whether a run of these robots has the robot, or one that matches the pattern, or the operator is meant.
pub(crate) fn is_known(name: &str, roster: &[RobotName]) -> bool {
    let is_operator = name == RobotName::operator().as_str();
    is_operator || roster.iter().any(|robot| matches(name, robot.as_str()))
}

/// The robots that match one of the patterns.
fn matching(patterns: &[RobotPattern], roster: &[RobotName]) -> Vec<RobotName> {
    let is_named = |robot: &&RobotName| patterns.iter().any(|pattern| pattern.matches(robot));
    roster.iter().filter(is_named).cloned().collect()
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
}

/// An alternative, and what is remembered of it from tick to tick.
#[derive(Debug, Clone)]
struct Tracked {
    alternative: Alternative,
    /// The first tick of those up to now in which a state has held without a break, or in which there was no progress.
    since: Option<Tick>,
    /// The robots that could overlap, each with the radius of the largest disc within it if it has a shape of its own, meters.
    overlapping: Vec<(RobotName, Option<f64>)>,
    /// The variables of progress, each with its robot and its last value.
    progress: Vec<(RobotName, String, Option<f64>)>,
    /// What a robot would have to publish so that the alternative can hold, and has not published yet.
    unknown: Option<String>,
    /// The number that it compares.
    gauge: Option<QuantityGauge>,
    /// The conditions that hold together.
    parts: Vec<Evaluation>,
}

impl Evaluation {
    /// Begins to evaluate a condition in a run.
    #[must_use]
    pub fn new(condition: &TickCondition, setting: &RunSetting) -> Self {
        let mut alternatives = Vec::new();
        for alternative in &condition.0 {
            alternatives.push(Tracked {
                alternative: alternative.clone(),
                since: None,
                overlapping: match alternative {
                    Alternative::Overlap(None) => with_radii(&setting.roster, setting),
                    Alternative::Overlap(Some(named)) => {
                        with_radii(&matching(named, &setting.roster), setting)
                    }
                    _ => Vec::new(),
                },
                progress: match alternative {
                    Alternative::Stalled(stalled) => {
                        let each = counter::each(&stalled.progress, &setting.roster).into_iter();
                        each.map(|(robot, variable)| (robot, variable, None))
                            .collect()
                    }
                    _ => Vec::new(),
                },
                unknown: None,
                gauge: match alternative {
                    Alternative::Number(number) => {
                        Some(QuantityGauge::new(&number.quantity, setting))
                    }
                    _ => None,
                },
                parts: match alternative {
                    Alternative::All(all) => {
                        let parts = all.parts.iter();
                        parts.map(|part| Self::new(part, setting)).collect()
                    }
                    _ => Vec::new(),
                },
            });
        }

        Self {
            alternatives,
            tick_s: setting.tick_s,
            body_m: setting.body_m,
        }
    }

    /// Evaluates the condition for a tick, each once and in their order. Returns why it holds, in words; `None` if it does not.
    pub fn holds(&mut self, seen: &Observation<'_>) -> Option<String> {
        let mut reason = None;
        for tracked in &mut self.alternatives {
            // All of them, because some depend on the ticks before.
            let held = match &tracked.alternative {
                Alternative::Event(pattern) => first_event(std::slice::from_ref(pattern), seen),
                Alternative::Overlap(_) => overlap(&tracked.overlapping, self.body_m, seen),
                Alternative::State(_) => tracked.state(self.tick_s, seen),
                Alternative::Number(_) => tracked.number(self.tick_s, seen),
                Alternative::All(_) => tracked.all(self.tick_s, seen),
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
        let since = self.since_when(condition.lasting, tick_s, seen.tick)?;
        let Alternative::State(condition) = &self.alternative else {
            return None;
        };
        let words = condition.is.in_words(&condition.robot, state);
        Some(lasting_words(words, condition.lasting, since, tick_s))
    }

    fn number(&mut self, tick_s: f64, seen: &Observation<'_>) -> Option<String> {
        let Alternative::Number(condition) = &self.alternative else {
            return None;
        };
        let lasting = condition.lasting;
        let value = match self.gauge.as_mut()?.value(seen) {
            Ok(value) => value,
            Err(undefined) => {
                self.since = None;
                self.unknown.get_or_insert_with(|| undefined.to_string());
                return None;
            }
        };
        self.unknown = None;
        let holds = match &condition.test {
            Some(test) => test.hold_number(value),
            None => value != 0.0,
        };
        if !holds {
            self.since = None;
            return None;
        }

        let since = self.since_when(lasting, tick_s, seen.tick)?;
        let Alternative::Number(LastingNumber { quantity, test, .. }) = &self.alternative else {
            return None;
        };
        let words = match test {
            Some(_) => format!("{quantity} is {value}"),
            None if quantity.is_statement() => quantity.to_string(),
            None => format!("{quantity} holds"),
        };
        Some(lasting_words(words, lasting, since, tick_s))
    }

    fn all(&mut self, tick_s: f64, seen: &Observation<'_>) -> Option<String> {
        let Alternative::All(all) = &self.alternative else {
            return None;
        };
        let lasting = all.lasting;
        let mut reasons = Vec::new();
        let mut unknown = None;
        for part in &mut self.parts {
            // All of them, because some depend on the ticks before.
            match part.holds(seen) {
                Some(reason) => reasons.push(reason),
                None => unknown = unknown.or_else(|| part.unknown().map(str::to_owned)),
            }
        }
        self.unknown = unknown;
        if reasons.len() < self.parts.len() {
            self.since = None;
            return None;
        }

        let since = self.since_when(lasting, tick_s, seen.tick)?;
        let words = reasons.join(", and ");
        Some(lasting_words(words, lasting, since, tick_s))
    }

    /// Since when a state that holds has held, if it has held for long enough.
    fn since_when(&mut self, lasting: Option<Time>, tick_s: f64, tick: Tick) -> Option<Tick> {
        let since = *self.since.get_or_insert(tick);
        // In the tick in which it begins a state has lasted for no time.
        let least = lasting.map_or(0, |lasting| ticks_in(lasting, tick_s));
        (tick - since >= least).then_some(since)
    }

    fn stalled(&mut self, tick_s: f64, seen: &Observation<'_>) -> Option<String> {
        let Alternative::Stalled(stalled) = &self.alternative else {
            return None;
        };

        let mut has_risen = false;
        let mut missing = None;
        // A counter that is lower than before, because its robot began anew, is no progress; the next
        // rise is.
        for (robot, variable, before) in &mut self.progress {
            let state = (seen.state)(robot);
            let value = state.and_then(|state| number(state, variable));
            if let (Some(before), Some(value)) = (*before, value) {
                has_risen |= value > before;
            }
            if value.is_none() && missing.is_none() {
                missing = Some(unpublished(robot, variable));
            }
            *before = value;
        }
        self.unknown = missing;

        if has_risen {
            self.since = Some(seen.tick);
        }
        let since = *self.since.get_or_insert(seen.tick);
        if seen.tick - since < ticks_in(stalled.lasting, tick_s) {
            return None;
        }
        let names: Vec<String> = stalled.progress.iter().map(Counter::to_string).collect();
        Some(format!(
            "no progress ({}) for {} s, since {}",
            names.join(", "),
            stalled.lasting.0,
            place(since, tick_s)
        ))
    }
}

/// What has held, with the time for which it had to.
fn lasting_words(words: String, lasting: Option<Time>, since: Tick, tick_s: f64) -> String {
    match lasting {
        Some(lasting) => format!(
            "{words} for {} s, since {}",
            lasting.0,
            place(since, tick_s)
        ),
        None => words,
    }
}

impl Is {
    /// Whether a robot is in the state; `None` if it publishes no such number.
    fn holds(&self, state: RobotState<'_>) -> Option<bool> {
        match self {
            Self::Behavior(names) => Some(names.iter().any(|name| name == state.behavior_state)),
            Self::Emotion(names) => Some(names.iter().any(|name| name == state.emotion_state)),
            Self::Variable(name, test) => test.holds(state.state_variables.get(name)?),
        }
    }

    /// Why it is not known whether a robot is in the state.
    fn unknown(&self, robot: &RobotName) -> String {
        match self {
            Self::Behavior(_) | Self::Emotion(_) => format!("{robot} has not reported"),
            Self::Variable(name, test) if test.is_of_numbers() => unpublished(robot, name),
            Self::Variable(name, _) => format!("{robot} publishes no such `{name}`"),
        }
    }

    fn in_words(&self, robot: &RobotName, state: RobotState<'_>) -> String {
        match self {
            Self::Behavior(_) => format!("the behavior of {robot} is {}", state.behavior_state),
            Self::Emotion(_) => format!("the emotion of {robot} is {}", state.emotion_state),
            Self::Variable(name, _) => {
                let value = state.state_variables.get(name);
                let value = value.map(ToString::to_string).unwrap_or_default();
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

fn with_radii(robots: &[RobotName], setting: &RunSetting) -> Vec<(RobotName, Option<f64>)> {
    let radius_m = |robot| setting.inradius_m.get(robot).copied();
    robots
        .iter()
        .map(|robot| (robot.clone(), radius_m(robot)))
        .collect()
}

/// Two of these robots that overlap: the first pair from left to right. Where one has a shape of its own, the largest discs within both
/// are compared: how a rectangle has turned is not known of every robot.
fn overlap(
    robots: &[(RobotName, Option<f64>)],
    body_m: f64,
    seen: &Observation<'_>,
) -> Option<String> {
    let mut placed: Vec<(Point, &RobotName, Option<f64>)> = Vec::with_capacity(robots.len());
    for (robot, radius_m) in robots {
        if let Some(state) = (seen.state)(robot) {
            placed.push((state.location, robot, *radius_m));
        }
    }
    placed.sort_by(|(one, ..), (other, ..)| one.x.total_cmp(&other.x));

    let half_m = body_m * 0.5;
    let largest_m = robots
        .iter()
        .filter_map(|(_, radius_m)| *radius_m)
        .fold(half_m, f64::max);
    for (index, (one, robot, radius_m)) in placed.iter().enumerate() {
        let near = placed[index + 1..]
            .iter()
            .take_while(|(other, ..)| other.x - one.x < 2.0 * largest_m);
        for (other, name, other_radius_m) in near {
            let (x_m, y_m) = (other.x - one.x, (other.y - one.y).abs());
            let is_overlap = if radius_m.is_none() && other_radius_m.is_none() {
                let apart_m = body_m - TOLERANCE_M;
                x_m < apart_m && y_m < apart_m
            } else {
                let radii_m = radius_m.unwrap_or(half_m) + other_radius_m.unwrap_or(half_m);
                let apart_m = radii_m - TOLERANCE_M;
                x_m * x_m + y_m * y_m < apart_m * apart_m
            };
            if is_overlap {
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

//! An entry of `[[expect]]`, and whether it can be checked in a run.

use config::units::Time;
use serde::{Deserialize, Serialize};

use crate::RunSetting;
use crate::condition::{self, TickCondition};
use crate::pattern::Pattern;
use crate::words::Word;

/// Most expectations of a file.
pub const MAX_EXPECTATIONS: usize = 64;
/// Longest name of an expectation, characters.
pub const MAX_NAME_CHARS: usize = 100;
/// Longest explanation of an expectation, characters.
const MAX_WHAT_CHARS: usize = 1000;
/// Kinds of events that no expectation can name: it is judged before the tick gets them.
const NOT_OBSERVED: [&str; 3] = ["judged", "tick", "end"];

/// Something that a run is expected to do, an entry of `[[expect]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "RuleTable", into = "RuleTable")]
pub struct Expectation {
    /// Its name, under which its verdict is reported.
    pub name: String,
    /// Why it is expected, in words.
    pub what: Option<String>,
    /// When it is met.
    pub rule: Rule,
}

/// When an expectation is met.
#[derive(Debug, Clone, PartialEq)]
pub enum Rule {
    /// The condition holds in no tick.
    Never(TickCondition),
    /// The condition holds in every tick.
    Always(TickCondition),
    /// The condition holds in some tick, at the latest this time after the beginning.
    Eventually {
        /// What is waited for.
        condition: TickCondition,
        /// How long.
        within: Time,
    },
    /// The condition holds in some tick of some run: it is a goal of hunts and experiments, and no run fails for it.
    Reach(TickCondition),
    /// After each event that matches, the condition holds in some tick: in that of the event, or at the latest this time after it.
    After {
        /// Events from each of which on the condition is waited for; one of these patterns matches.
        trigger: Vec<Pattern>,
        /// What is waited for. It counts for all events before it.
        condition: TickCondition,
        /// How long.
        within: Time,
        /// Events that end the wait: the condition is not waited for any longer. Empty if there are none.
        unless: Vec<Pattern>,
    },
    /// In the ticks after each event that matches, the condition does not hold before the other one has.
    NeverUntil {
        /// Events from each of which on the condition must not hold; one of these patterns matches.
        trigger: Vec<Pattern>,
        /// What must not hold.
        condition: TickCondition,
        /// What ends the watch: from its tick on, the condition may hold.
        until: TickCondition,
    },
}

/// An expectation that cannot be checked, or of another run.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ExpectError {
    /// The name is empty, too long, or has control characters.
    #[error(
        "the name of an expectation has 1 to {MAX_NAME_CHARS} characters, and no control characters"
    )]
    Name,
    /// The explanation is too long.
    #[error("`what` has at most {MAX_WHAT_CHARS} characters")]
    What,
    /// Not exactly one of `never`, `always`, `eventually` and `reach` is given.
    #[error("an expectation has one of `never`, `always`, `eventually` and `reach`")]
    Rule,
    /// `eventually` without a time.
    #[error("`eventually` needs a time: `within = \"60 s\"`")]
    NoTime,
    /// `after` with `never`, without what ends the watch.
    #[error(
        "`never` with `after` needs what ends it: `until = …`; without `after` it is for the whole run"
    )]
    NoUntil,
    /// `after`, `within`, `unless` or `until` without the key that it belongs to.
    #[error("`{0}` belongs to `{1}`")]
    Alone(&'static str, &'static str),
    /// The time is negative.
    #[error("`within` is not negative")]
    Negative,
    /// `always` with an event.
    #[error(
        "`always` takes what holds in every tick: a state of a robot; an event happens in one tick"
    )]
    AlwaysEvent,
    /// No event of this kind can be observed.
    #[error(
        "an expectation cannot name the event \"{0}\": it is judged before the tick gets that event"
    )]
    NotObserved(String),
    /// A list of patterns is empty or too long.
    #[error("`{0}` has 1 to {MAX_EXPECTATIONS} patterns")]
    Patterns(&'static str),
    /// A condition about what the run does not have.
    #[error(transparent)]
    Condition(#[from] condition::TickConditionError),
    /// A robot that the run does not have.
    #[error("no robot of this scenario is called {0}")]
    UnknownRobot(String),
    /// Two expectations have the same name.
    #[error("a second expectation called \"{0}\"")]
    Twice(String),
    /// There are too many.
    #[error("more than {MAX_EXPECTATIONS} expectations")]
    TooMany,
}

/// An expectation as written.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RuleTable {
    name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    what: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    never: Option<TickCondition>,
    #[serde(skip_serializing_if = "Option::is_none")]
    always: Option<TickCondition>,
    #[serde(skip_serializing_if = "Option::is_none")]
    after: Option<Patterns>,
    #[serde(skip_serializing_if = "Option::is_none")]
    eventually: Option<TickCondition>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reach: Option<TickCondition>,
    #[serde(skip_serializing_if = "Option::is_none")]
    within: Option<Time>,
    #[serde(skip_serializing_if = "Option::is_none")]
    unless: Option<Patterns>,
    #[serde(skip_serializing_if = "Option::is_none")]
    until: Option<TickCondition>,
}

/// A pattern, or a list of which one has to match.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(try_from = "serde_json::Value", into = "serde_json::Value")]
struct Patterns(Vec<Pattern>);

impl TryFrom<serde_json::Value> for Patterns {
    type Error = crate::pattern::PatternError;

    fn try_from(value: serde_json::Value) -> Result<Self, Self::Error> {
        let entries = match value {
            serde_json::Value::Array(entries) => entries,
            one => vec![one],
        };
        let mut patterns = Vec::new();
        for entry in entries {
            patterns.push(Pattern::try_from(entry)?);
        }
        Ok(Self(patterns))
    }
}

impl From<Patterns> for serde_json::Value {
    fn from(patterns: Patterns) -> Self {
        condition::one_or_list(patterns.0.into_iter().map(Self::from).collect())
    }
}

impl TryFrom<RuleTable> for Expectation {
    type Error = ExpectError;

    fn try_from(table: RuleTable) -> Result<Self, ExpectError> {
        let length = table.name.chars().count();
        if !(1..=MAX_NAME_CHARS).contains(&length) || table.name.chars().any(char::is_control) {
            return Err(ExpectError::Name);
        }
        let what = table.what.as_deref().unwrap_or_default();
        if what.chars().count() > MAX_WHAT_CHARS {
            return Err(ExpectError::What);
        }

        Ok(Self {
            name: table.name.clone(),
            what: table.what.clone(),
            rule: table.rule()?,
        })
    }
}

impl RuleTable {
    fn rule(self) -> Result<Rule, ExpectError> {
        let within = self.within;
        if within.is_some_and(|within| within.0 < 0.0) {
            return Err(ExpectError::Negative);
        }

        let has_after = self.after.is_some();
        let has_never = self.never.is_some();
        let has_eventually = self.eventually.is_some();
        for (key, is_given, of, is_there) in [
            ("within", within.is_some(), "eventually", has_eventually),
            (
                "after",
                has_after,
                "eventually",
                has_eventually || has_never,
            ),
            ("unless", self.unless.is_some(), "after", has_after),
            (
                "unless",
                self.unless.is_some(),
                "eventually",
                has_eventually,
            ),
            ("until", self.until.is_some(), "after", has_after),
            ("until", self.until.is_some(), "never", has_never),
        ] {
            if is_given && !is_there {
                return Err(ExpectError::Alone(key, of));
            }
        }

        if let Some(condition) = self.reach {
            let has_other = has_never || has_eventually || self.always.is_some();
            return match has_other {
                true => Err(ExpectError::Rule),
                false => Ok(Rule::Reach(observed(condition)?)),
            };
        }

        match (self.never, self.always, self.eventually, self.after) {
            (Some(condition), None, None, None) => Ok(Rule::Never(observed(condition)?)),
            (Some(condition), None, None, Some(after)) => Ok(Rule::NeverUntil {
                trigger: patterns("after", after)?,
                condition: observed(condition)?,
                until: observed(self.until.ok_or(ExpectError::NoUntil)?)?,
            }),
            (None, Some(condition), None, None) => {
                if !condition.patterns().is_empty() {
                    return Err(ExpectError::AlwaysEvent);
                }
                Ok(Rule::Always(condition))
            }
            (None, None, Some(condition), None) => Ok(Rule::Eventually {
                condition: observed(condition)?,
                within: within.ok_or(ExpectError::NoTime)?,
            }),
            (None, None, Some(condition), Some(after)) => Ok(Rule::After {
                trigger: patterns("after", after)?,
                condition: observed(condition)?,
                within: within.ok_or(ExpectError::NoTime)?,
                unless: match self.unless {
                    Some(unless) => patterns("unless", unless)?,
                    None => Vec::new(),
                },
            }),
            _ => Err(ExpectError::Rule),
        }
    }
}

/// The condition, whose events can be observed.
fn observed(condition: TickCondition) -> Result<TickCondition, ExpectError> {
    for pattern in condition.patterns() {
        check_observed(pattern)?;
    }
    Ok(condition)
}

fn patterns(key: &'static str, patterns: Patterns) -> Result<Vec<Pattern>, ExpectError> {
    if !(1..=MAX_EXPECTATIONS).contains(&patterns.0.len()) {
        return Err(ExpectError::Patterns(key));
    }
    for pattern in &patterns.0 {
        check_observed(pattern)?;
    }
    Ok(patterns.0)
}

fn check_observed(pattern: &Pattern) -> Result<(), ExpectError> {
    let kind = pattern.kind();
    if NOT_OBSERVED.contains(&kind) {
        return Err(ExpectError::NotObserved(kind.to_owned()));
    }
    Ok(())
}

impl From<Expectation> for RuleTable {
    fn from(expectation: Expectation) -> Self {
        let mut table = Self {
            name: expectation.name,
            what: expectation.what,
            never: None,
            always: None,
            after: None,
            eventually: None,
            reach: None,
            within: None,
            unless: None,
            until: None,
        };

        match expectation.rule {
            Rule::Never(condition) => table.never = Some(condition),
            Rule::Always(condition) => table.always = Some(condition),
            Rule::Reach(condition) => table.reach = Some(condition),
            Rule::Eventually { condition, within } => {
                table.eventually = Some(condition);
                table.within = Some(within);
            }
            Rule::After {
                trigger,
                condition,
                within,
                unless,
            } => {
                table.after = Some(Patterns(trigger));
                table.eventually = Some(condition);
                table.within = Some(within);
                table.unless = (!unless.is_empty()).then_some(Patterns(unless));
            }
            Rule::NeverUntil {
                trigger,
                condition,
                until,
            } => {
                table.after = Some(Patterns(trigger));
                table.never = Some(condition);
                table.until = Some(until);
            }
        }
        table
    }
}

impl Expectation {
    /// Checks that a run can have what the expectation names.
    ///
    /// # Errors
    /// [`ExpectError::UnknownRobot`] and [`ExpectError::Condition`].
    pub fn check(&self, setting: &RunSetting) -> Result<(), ExpectError> {
        let (conditions, patterns) = self.parts();
        for condition in conditions {
            condition.check(setting)?;
        }
        for pattern in patterns {
            let mut robots = pattern.robots();
            if let Some(name) = robots.find(|name| !condition::is_known(name, &setting.roster)) {
                return Err(ExpectError::UnknownRobot(name.to_owned()));
            }
            pattern
                .check_sites(setting)
                .map_err(condition::TickConditionError::from)?;
        }
        Ok(())
    }

    /// Whether it is a goal of hunts and experiments, for which no single run fails.
    #[must_use]
    pub fn is_goal(&self) -> bool {
        matches!(self.rule, Rule::Reach(_))
    }

    /// Whether it depends on what robots report and where they are, and not on events, from which the states of sites follow.
    #[must_use]
    pub fn needs_states(&self) -> bool {
        let (conditions, _) = self.parts();
        conditions.iter().any(|condition| condition.needs_states())
    }

    /// Checks it as an entry that follows others.
    fn check_beside(&self, before: &[Self], setting: &RunSetting) -> Result<(), ExpectError> {
        if before.len() >= MAX_EXPECTATIONS {
            return Err(ExpectError::TooMany);
        }
        if before.iter().any(|other| other.name == self.name) {
            return Err(ExpectError::Twice(self.name.clone()));
        }
        self.check(setting)
    }

    /// Its conditions and its patterns.
    fn parts(&self) -> (Vec<&TickCondition>, Vec<&Pattern>) {
        match &self.rule {
            Rule::Never(condition)
            | Rule::Always(condition)
            | Rule::Reach(condition)
            | Rule::Eventually { condition, .. } => (vec![condition], Vec::new()),
            Rule::After {
                trigger,
                condition,
                unless,
                ..
            } => (vec![condition], trigger.iter().chain(unless).collect()),
            Rule::NeverUntil {
                trigger,
                condition,
                until,
            } => (vec![condition, until], trigger.iter().collect()),
        }
    }

    /// The words that robots choose and that it names.
    pub(crate) fn words(&self) -> Vec<Word> {
        let (conditions, patterns) = self.parts();
        let mut named = Vec::new();
        for condition in conditions {
            named.extend(condition.words());
        }
        for pattern in patterns {
            named.extend(pattern.words());
        }
        named
    }
}

/// Which expectation of a file is wrong, and why.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{error}")]
pub struct WrongEntry {
    /// Its index in the file.
    pub index: usize,
    /// What is wrong with it.
    pub error: ExpectError,
}

/// Checks the expectations of a file together, for a run.
///
/// # Errors
/// [`WrongEntry`], the first one.
pub fn check_all(expectations: &[Expectation], setting: &RunSetting) -> Result<(), WrongEntry> {
    for (index, expectation) in expectations.iter().enumerate() {
        let before = &expectations[..index];
        expectation
            .check_beside(before, setting)
            .map_err(|error| WrongEntry { index, error })?;
    }
    Ok(())
}

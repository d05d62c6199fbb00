//! What is done to every arm alike: the values of factors, named conditions, or every combination of both.

use std::collections::BTreeSet;
use std::ops::Range;

use config::Override;
use config::units::Time;

use super::setting::Setting;

/// Name of the factor whose values are the named conditions.
pub(super) const NAMED: &str = "condition";

/// The independent variables of an experiment. Its conditions are every combination of a named condition and a value of each
/// factor.
#[derive(Debug, Clone, Default)]
pub struct Conditions {
    /// Conditions that are written out.
    pub named: Vec<Condition>,
    /// The factors.
    pub factors: Vec<Factor>,
}

/// A factor: a change of the scenario with a value in it.
#[derive(Debug, Clone)]
pub struct Factor {
    /// Head of the column with its values.
    pub name: String,
    /// Its values, in the order of the table.
    pub values: Vec<FactorValue>,
    /// Places of the values in the file, bytes.
    pub(super) spans: Vec<Range<usize>>,
    /// Begin, simulated seconds. The value of a factor with a begin is its duration; a factor without one lasts for the
    /// whole run.
    pub begins_s: Option<f64>,
    /// What is changed.
    pub(super) target: FactorTarget,
}

/// What the values of a factor change.
#[derive(Debug, Clone)]
pub(super) enum FactorTarget {
    /// The value at this path of the scenario.
    Path(String),
    /// What these changes of the scenario set, in which `{value}`, `{from}` and `{until}` are replaced.
    Set {
        changes: Vec<String>,
        /// Changes that replace them where the value is zero.
        at_zero: Option<Vec<String>>,
    },
}

/// A value of a factor.
#[derive(Debug, Clone, PartialEq)]
pub enum FactorValue {
    /// A whole number.
    Integer(i64),
    /// A number without a unit.
    Number(f64),
    /// A time, simulated seconds.
    Time(f64),
    /// Yes or no.
    Flag(bool),
    /// A text.
    Text(String),
}

/// A set of changes of the scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// Name in tables.
    pub name: String,
    /// Description for people; empty for a value of a factor and for a combination.
    pub what: String,
    /// Names of the factors and their values in it; a named condition is a value of the factor "condition".
    pub levels: Vec<(String, String)>,
    /// Changes of the scenario.
    pub set: Vec<Setting>,
    /// Begin and end, simulated seconds; `None` if it lasts for the whole run. Several that are combined last from the first
    /// begin to the last end.
    pub time_s: Option<(f64, f64)>,
}

/// A condition that cannot be played.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConditionError {
    /// A change of the scenario that is not `path=value`.
    #[error("{0}")]
    Change(String),
    /// A change names a time, and the condition lasts for the whole run.
    #[error(
        "`{0}` has a time in it, and the condition has none: add `begins` to a factor, `from` and `until` to a condition"
    )]
    NoTime(String),
    /// A factor with a begin has a value that is not a time.
    #[error("a factor with `begins` lasts for a time, and {0} is not a time")]
    NotATime(FactorValue),
    /// A condition is there twice.
    #[error("the condition \"{0}\" is there twice: the same runs would count as independent ones")]
    Repeated(String),
    /// Two values of a factor change nothing differently.
    #[error(
        "{0} and {1} make the same changes: `set` contains `{{value}}`, or `{{until}}` of a factor with `begins`"
    )]
    Same(FactorValue, FactorValue),
    /// A change of what the experiment says itself.
    #[error("`{0}` would have no effect: `seeds` and `duration` of the experiment say it")]
    Own(Override),
    /// Two changes that are made together set the same value.
    #[error("`{0}` and `{1}` set the same value: an experiment sets each value in one place")]
    Overlap(Override, Override),
    /// It ends before it begins.
    #[error("the condition \"{0}\" ends before it begins: `until` comes after `from`")]
    Reversed(String),
    /// It begins after the end of the run.
    #[error(
        "the condition \"{name}\" begins at {from_s} s, and the run ends at {duration_s} s: it would not be played"
    )]
    TooLate {
        /// Name of the condition.
        name: String,
        /// Its begin, simulated seconds.
        from_s: f64,
        /// End of the run, simulated seconds.
        duration_s: f64,
    },
    /// It lasts beyond the end of the run.
    #[error(
        "the condition \"{name}\" lasts until {until_s} s, and the run ends at {duration_s} s: it would not be played to its end"
    )]
    TooLong {
        /// Name of the condition.
        name: String,
        /// Its end, simulated seconds.
        until_s: f64,
        /// End of the run, simulated seconds.
        duration_s: f64,
    },
}

impl Conditions {
    /// Names of the factors, "condition" for the named conditions; the head of the column of conditions.
    #[must_use]
    pub fn head(&self) -> String {
        let mut names = Vec::new();
        if !self.named.is_empty() || self.factors.is_empty() {
            names.push(NAMED);
        }
        for factor in &self.factors {
            names.push(&factor.name);
        }
        names.join(", ")
    }

    /// Number of conditions.
    #[must_use]
    pub fn count(&self) -> u64 {
        let mut count = self.named.len().max(1) as u64;
        for factor in &self.factors {
            count = count.saturating_mul(factor.values.len() as u64);
        }
        count
    }

    /// The conditions, in the order of the table: the last factor changes first.
    ///
    /// # Errors
    /// If a condition cannot be played in a run of this duration, or is there twice.
    pub fn list(&self, duration_s: f64) -> Result<Vec<Condition>, ConditionError> {
        let mut parts = Vec::new();
        if !self.named.is_empty() {
            check_levels(&self.named, duration_s)?;
            parts.push(self.named.clone());
        }
        for factor in &self.factors {
            parts.push(factor.levels(duration_s)?);
        }
        for (index, part) in parts.iter().enumerate() {
            for other in &parts[..index] {
                check_apart(other, part)?;
            }
        }

        let combined = combine(&parts);
        let mut names = BTreeSet::new();
        for condition in &combined {
            if !names.insert(&condition.name) {
                return Err(ConditionError::Repeated(condition.name.clone()));
            }
        }
        Ok(combined)
    }
}

/// Every combination of one condition of each part.
fn combine(parts: &[Vec<Condition>]) -> Vec<Condition> {
    if let [only] = parts {
        return only.clone();
    }

    let mut combined = vec![Condition::nothing()];
    for part in parts {
        let mut longer = Vec::new();
        for condition in &combined {
            for level in part {
                longer.push(condition.with(level));
            }
        }
        combined = longer;
    }
    for condition in &mut combined {
        condition.name_by_levels();
    }
    combined
}

/// Checks the values of a factor, or the named conditions.
pub(super) fn check_levels(levels: &[Condition], duration_s: f64) -> Result<(), ConditionError> {
    let mut names = BTreeSet::new();
    for level in levels {
        level.check_time(duration_s)?;
        check_each_apart(&level.set)?;
        if !names.insert(&level.name) {
            return Err(ConditionError::Repeated(level.name.clone()));
        }
    }
    Ok(())
}

/// Checks that no two of these changes set the same value.
fn check_each_apart(settings: &[Setting]) -> Result<(), ConditionError> {
    for (index, setting) in settings.iter().enumerate() {
        check_change(&setting.change, &settings[..index])?;
    }
    Ok(())
}

/// Checks that conditions that are combined set different values.
pub(super) fn check_apart(one: &[Condition], other: &[Condition]) -> Result<(), ConditionError> {
    for level in one {
        for combined in other {
            for setting in &combined.set {
                check_change(&setting.change, &level.set)?;
            }
        }
    }
    Ok(())
}

/// What the experiment says of every run.
pub(super) const OWN_OPTIONS: [&str; 2] = ["seed", "duration"];

/// Checks that a change sets something else than these, and than the experiment.
pub(super) fn check_change(change: &Override, others: &[Setting]) -> Result<(), ConditionError> {
    if OWN_OPTIONS.contains(&change.top()) {
        return Err(ConditionError::Own(change.clone()));
    }
    let mut others = others.iter().map(|other| &other.change);
    match others.find(|other| other.overlaps(change)) {
        Some(other) => Err(ConditionError::Overlap(other.clone(), change.clone())),
        None => Ok(()),
    }
}

impl Condition {
    /// The scenario without a change.
    fn nothing() -> Self {
        Self {
            name: "as it is".to_owned(),
            what: String::new(),
            levels: Vec::new(),
            set: Vec::new(),
            time_s: None,
        }
    }

    /// Both conditions at once.
    fn with(&self, other: &Self) -> Self {
        let mut both = self.clone();
        both.levels.extend_from_slice(&other.levels);
        both.set.extend_from_slice(&other.set);
        both.time_s = match (self.time_s, other.time_s) {
            (Some((from_s, until_s)), Some((other_from_s, other_until_s))) => {
                Some((from_s.min(other_from_s), until_s.max(other_until_s)))
            }
            (one, None) | (None, one) => one,
        };
        both
    }

    /// Whether both change the same values to the same.
    fn makes_the_changes_of(&self, other: &Self) -> bool {
        let own = self.set.iter().map(|setting| &setting.change);
        own.eq(other.set.iter().map(|setting| &setting.change))
    }

    /// Names a combination, for example "crash, loss 0.1, guests 50".
    fn name_by_levels(&mut self) {
        let mut parts = Vec::new();
        for (factor, value) in &self.levels {
            parts.push(if factor == NAMED {
                value.clone()
            } else {
                format!("{factor} {value}")
            });
        }
        if !parts.is_empty() {
            self.name = parts.join(", ");
        }
    }

    /// Checks that the condition begins and ends within a run of this duration.
    pub(super) fn check_time(&self, duration_s: f64) -> Result<(), ConditionError> {
        let Some((from_s, until_s)) = self.time_s else {
            return Ok(());
        };

        let name = self.name.clone();
        if until_s < from_s {
            return Err(ConditionError::Reversed(name));
        }
        if from_s >= duration_s {
            return Err(ConditionError::TooLate {
                name,
                from_s,
                duration_s,
            });
        }
        if until_s > duration_s {
            return Err(ConditionError::TooLong {
                name,
                until_s,
                duration_s,
            });
        }
        Ok(())
    }
}

impl Factor {
    /// The conditions that its values are, checked for a run of this duration.
    pub(super) fn levels(&self, duration_s: f64) -> Result<Vec<Condition>, ConditionError> {
        let mut levels: Vec<Condition> = Vec::new();
        for (value, span) in self.values.iter().zip(&self.spans) {
            levels.push(self.level(value, span)?);
        }
        check_levels(&levels, duration_s)?;

        for (index, level) in levels.iter().enumerate() {
            let same = levels[..index]
                .iter()
                .position(|other| other.makes_the_changes_of(level));
            if let Some(other) = same {
                let values = &self.values;
                return Err(ConditionError::Same(
                    values[other].clone(),
                    values[index].clone(),
                ));
            }
        }
        Ok(levels)
    }

    fn level(&self, value: &FactorValue, span: &Range<usize>) -> Result<Condition, ConditionError> {
        let time_s = match (self.begins_s, value) {
            (Some(from_s), FactorValue::Time(lasting_s)) => Some((from_s, from_s + lasting_s)),
            (None, _) => None,
            (Some(_), other) => return Err(ConditionError::NotATime(other.clone())),
        };

        let mut set = Vec::new();
        for change in self.target.changes(value, time_s)? {
            set.push(Setting::at(change, span.clone()));
        }
        let name = value.to_string();
        Ok(Condition {
            levels: vec![(self.name.clone(), name.clone())],
            name,
            what: String::new(),
            set,
            time_s,
        })
    }
}

impl FactorTarget {
    fn changes(
        &self,
        value: &FactorValue,
        time_s: Option<(f64, f64)>,
    ) -> Result<Vec<Override>, ConditionError> {
        let template = match self {
            Self::Path(path) => {
                let change = format!("{path}={}", value.in_toml());
                return Ok(vec![change.parse().map_err(ConditionError::Change)?]);
            }
            Self::Set {
                at_zero: Some(at_zero),
                ..
            } if value.is_zero() => at_zero,
            Self::Set { changes, .. } => changes,
        };

        let mut set = Vec::new();
        for change in template {
            let change = change.replace("{value}", &value.in_template());
            set.push(parse(&change, time_s)?);
        }
        Ok(set)
    }
}

/// Parses a change of the scenario in which `{from}` and `{until}` are replaced by the time of the condition.
pub(super) fn parse(
    template: &str,
    time_s: Option<(f64, f64)>,
) -> Result<Override, ConditionError> {
    let mut change = template.to_owned();
    match time_s {
        Some((from_s, until_s)) => {
            change = change
                .replace("{from}", &format!("{from_s} s"))
                .replace("{until}", &format!("{until_s} s"));
        }
        None if change.contains("{from}") || change.contains("{until}") => {
            return Err(ConditionError::NoTime(change));
        }
        None => {}
    }

    change.parse().map_err(ConditionError::Change)
}

impl FactorValue {
    /// A text, which is a time if it has a unit of time.
    #[must_use]
    pub fn of_text(text: String) -> Self {
        match text.parse::<Time>() {
            Ok(time) => Self::Time(time.0),
            Err(_) => Self::Text(text),
        }
    }

    fn is_zero(&self) -> bool {
        match self {
            Self::Integer(value) => *value == 0,
            Self::Number(value) | Self::Time(value) => *value == 0.0,
            Self::Flag(_) | Self::Text(_) => false,
        }
    }

    /// The value in a scenario file.
    fn in_toml(&self) -> toml::Value {
        match self {
            Self::Integer(number) => toml::Value::Integer(*number),
            Self::Number(number) => toml::Value::Float(*number),
            Self::Flag(is_set) => toml::Value::Boolean(*is_set),
            Self::Time(_) | Self::Text(_) => toml::Value::String(self.to_string()),
        }
    }

    /// The value where a change has `{value}`.
    fn in_template(&self) -> String {
        match self {
            Self::Number(number) => format!("{number:?}"),
            other => other.to_string(),
        }
    }
}

impl std::fmt::Display for FactorValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Integer(number) => write!(f, "{number}"),
            Self::Number(number) => write!(f, "{number}"),
            Self::Time(time_s) => write!(f, "{time_s} s"),
            Self::Flag(is_set) => write!(f, "{is_set}"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(values: &[f64]) -> Conditions {
        let partition = r#"network.partition=[{ from = "{from}", until = "{until}" }]"#;
        let factor = Factor {
            name: "cut for".to_owned(),
            values: values.iter().copied().map(FactorValue::Time).collect(),
            spans: vec![0..0; values.len()],
            begins_s: Some(120.0),
            target: FactorTarget::Set {
                changes: vec![partition.to_owned()],
                at_zero: Some(vec!["network.partition=[]".to_owned()]),
            },
        };
        Conditions {
            named: Vec::new(),
            factors: vec![factor],
        }
    }

    #[test]
    fn a_condition_says_what_is_changed_and_when() {
        let conditions = cut(&[0.0, 60.0]).list(600.0).unwrap();

        assert_eq!(
            conditions[0].set[0].change.to_string(),
            "network.partition=[]"
        );
        assert_eq!(conditions[1].name, "60 s");
        assert_eq!(conditions[1].time_s, Some((120.0, 180.0)));
        let change = conditions[1].set[0].change.to_string();
        assert!(change.contains("until = \"180 s\""), "{change}");
    }

    #[test]
    fn a_value_that_is_there_twice_is_refused() {
        let error = cut(&[60.0, 30.0, 60.0]).list(600.0).unwrap_err();
        assert_eq!(error, ConditionError::Repeated("60 s".to_owned()));
    }

    #[test]
    fn a_condition_that_the_run_does_not_play_to_its_end_is_refused() {
        let too_late = cut(&[0.0]).list(120.0).unwrap_err();
        assert!(matches!(too_late, ConditionError::TooLate { .. }));

        let too_long = cut(&[60.0]).list(179.0).unwrap_err();
        assert!(matches!(too_long, ConditionError::TooLong { .. }));

        assert!(cut(&[60.0]).list(180.0).is_ok());
    }

    fn at(path: &str, name: &str, values: Vec<FactorValue>) -> Factor {
        Factor {
            name: name.to_owned(),
            spans: vec![0..0; values.len()],
            values,
            begins_s: None,
            target: FactorTarget::Path(path.to_owned()),
        }
    }

    fn named(name: &str, change: &str, time_s: Option<(f64, f64)>) -> Condition {
        Condition {
            name: name.to_owned(),
            what: format!("what {name} is"),
            levels: vec![(NAMED.to_owned(), name.to_owned())],
            set: vec![Setting::at(change.parse().unwrap(), 0..0)],
            time_s,
        }
    }

    #[test]
    fn conditions_and_factors_are_combined() {
        let mut conditions = cut(&[0.0, 60.0]);
        conditions.named = vec![
            named("empty", "guests.count=0", None),
            named("crash", "on_late=continue", Some((100.0, 150.0))),
        ];
        let policies = ["emotion", "rules", "true"].map(|word| FactorValue::Text(word.to_owned()));
        let policy = at("robot.Butler.params.policy", "policy", policies.to_vec());
        conditions.factors.push(policy);

        assert_eq!(conditions.head(), "condition, cut for, policy");
        let all = conditions.list(600.0).unwrap();
        assert_eq!(all.len(), 12);
        assert_eq!(conditions.count(), 12);
        let names: Vec<&str> = all
            .iter()
            .map(|condition| condition.name.as_str())
            .collect();
        assert_eq!(names[0], "empty, cut for 0 s, policy emotion");
        assert_eq!(names[1], "empty, cut for 0 s, policy rules");
        assert_eq!(names[11], "crash, cut for 60 s, policy true");

        let last = &all[11];
        let level = |factor: &str, value: &str| (factor.to_owned(), value.to_owned());
        let levels = [
            level("condition", "crash"),
            level("cut for", "60 s"),
            level("policy", "true"),
        ];
        assert_eq!(last.levels, levels);
        assert_eq!(last.time_s, Some((100.0, 180.0)));
        let policy = "robot.Butler.params.policy=\"true\"";
        assert_eq!(
            last.set[2].change.to_string(),
            policy,
            "a text stays a text"
        );
    }

    #[test]
    fn without_factors_the_scenario_is_the_condition() {
        let all = Conditions::default().list(600.0).unwrap();
        assert_eq!(all.len(), 1);
        assert_eq!(all[0].name, "as it is");
        assert!(all[0].levels.is_empty());
    }

    #[test]
    fn values_that_change_the_same_are_refused() {
        let mut twice = Conditions::default();
        let counts = vec![FactorValue::Integer(1), FactorValue::Integer(2)];
        twice.factors = vec![
            at("guests.count", "guests", counts.clone()),
            at("guests", "more", counts),
        ];
        let error = twice.list(600.0).unwrap_err();
        assert!(matches!(error, ConditionError::Overlap(..)), "{error}");

        let mut conditions = cut(&[30.0, 60.0]);
        conditions.factors[0].target = FactorTarget::Set {
            changes: vec!["guests.count=3".to_owned()],
            at_zero: None,
        };
        let error = conditions.list(600.0).unwrap_err();
        let expected = ConditionError::Same(FactorValue::Time(30.0), FactorValue::Time(60.0));
        assert_eq!(error, expected);
    }
}

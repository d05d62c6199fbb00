//! What is done to every arm alike: the values of a factor, or named conditions.

use config::Override;

/// The independent variable of an experiment.
#[derive(Debug, Clone)]
pub enum Conditions {
    /// One condition for each value of a factor.
    Factor(Factor),
    /// Conditions that are written out.
    Named(Vec<Condition>),
}

/// A factor: a change of the scenario with a value in it.
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
    pub(super) set: Vec<String>,
    /// Changes of the scenario that replace `set` where the value is zero.
    pub(super) set_at_zero: Option<Vec<String>>,
}

/// A value of a factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A number without a unit.
    Number(f64),
    /// A time, simulated seconds.
    Time(f64),
}

/// A named set of changes of the scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// Name in tables.
    pub name: String,
    /// Description for people; empty for a value of a factor.
    pub what: String,
    /// Changes of the scenario.
    pub set: Vec<Override>,
    /// Begin and end, simulated seconds; `None` if it lasts for the whole run.
    pub time_s: Option<(f64, f64)>,
}

/// A condition that cannot be played.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConditionError {
    /// A change of the scenario that is not `path=value`.
    #[error("{0}")]
    Change(String),
    /// A factor with a begin has a value that is not a time.
    #[error("a factor with `begins` lasts for a time, and {0} is not a time")]
    NotATime(f64),
    /// A condition is there twice.
    #[error("the condition \"{0}\" is there twice: the same runs would count as independent ones")]
    Repeated(String),
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
    /// Head of their column.
    #[must_use]
    pub fn head(&self) -> &str {
        match self {
            Self::Factor(factor) => &factor.name,
            Self::Named(_) => "condition",
        }
    }

    /// The conditions, in the order of the table.
    ///
    /// # Errors
    /// If a condition cannot be played in a run of this duration, or is there twice.
    pub fn list(&self, duration_s: f64) -> Result<Vec<Condition>, ConditionError> {
        let mut conditions: Vec<Condition> = Vec::new();
        match self {
            Self::Named(named) => conditions.clone_from(named),
            Self::Factor(factor) => {
                for value in &factor.values {
                    conditions.push(factor.condition(*value)?);
                }
            }
        }

        for (index, condition) in conditions.iter().enumerate() {
            condition.check_time(duration_s)?;
            let before = &conditions[..index];
            if before.iter().any(|other| other.name == condition.name) {
                return Err(ConditionError::Repeated(condition.name.clone()));
            }
        }
        Ok(conditions)
    }
}

impl Condition {
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
    fn condition(&self, value: Value) -> Result<Condition, ConditionError> {
        let time_s = match (self.begins_s, value) {
            (Some(from_s), Value::Time(lasting_s)) => Some((from_s, from_s + lasting_s)),
            (None, _) => None,
            (Some(_), Value::Number(number)) => return Err(ConditionError::NotATime(number)),
        };

        let template = match &self.set_at_zero {
            Some(at_zero) if value.is_zero() => at_zero,
            _ => &self.set,
        };
        let mut set = Vec::new();
        for change in template {
            let change = change.replace("{value}", &value.in_toml());
            set.push(parse(&change, time_s)?);
        }

        Ok(Condition {
            name: value.to_string(),
            what: String::new(),
            set,
            time_s,
        })
    }
}

/// Parses a change of the scenario in which `{from}` and `{until}` are replaced by the time of the condition.
pub(super) fn parse(
    template: &str,
    time_s: Option<(f64, f64)>,
) -> Result<Override, ConditionError> {
    let mut change = template.to_owned();
    if let Some((from_s, until_s)) = time_s {
        change = change
            .replace("{from}", &format!("{from_s} s"))
            .replace("{until}", &format!("{until_s} s"));
    }

    change.parse().map_err(ConditionError::Change)
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

    fn cut(values: &[f64]) -> Conditions {
        let partition = r#"network.partition=[{ from = "{from}", until = "{until}" }]"#;
        Conditions::Factor(Factor {
            name: "cut for".to_owned(),
            values: values.iter().copied().map(Value::Time).collect(),
            begins_s: Some(120.0),
            set: vec![partition.to_owned()],
            set_at_zero: Some(vec!["network.partition=[]".to_owned()]),
        })
    }

    #[test]
    fn a_condition_says_what_is_changed_and_when() {
        let conditions = cut(&[0.0, 60.0]).list(600.0).unwrap();

        assert_eq!(conditions[0].set[0].to_string(), "network.partition=[]");
        assert_eq!(conditions[1].name, "60 s");
        assert_eq!(conditions[1].time_s, Some((120.0, 180.0)));
        let change = conditions[1].set[0].to_string();
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
}

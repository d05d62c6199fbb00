//! What a value of a state is compared with: bounds of a number, or values that it may be.

use std::fmt;
use std::mem::discriminant;

use protocol::messages::Variable;
use serde::{Deserialize, Serialize};

/// Most values that a variable may be.
const MAX_VALUES: usize = 64;
/// Most names that an error lists.
const MAX_LISTED: usize = 12;

/// What a value is compared with.
#[derive(Debug, Clone, PartialEq)]
pub enum ValueTest {
    /// A number within bounds; a flag is 1 or 0.
    Within(ValueBounds),
    /// One of these values, which are of one type.
    Is(Vec<Variable>),
}

/// The values of a number; all bounds that are given hold.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ValueBounds {
    pub(crate) at_least: Option<f64>,
    pub(crate) at_most: Option<f64>,
    pub(crate) above: Option<f64>,
    pub(crate) below: Option<f64>,
}

/// A test as written. Where all is left out, there is none.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct TestTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) is: Option<ValueList>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) at_least: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) at_most: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) above: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) below: Option<f64>,
}

/// A value, or a list of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "a number, a text, true or false, or a list of such values"
)]
pub(crate) enum ValueList {
    One(Variable),
    Several(Vec<Variable>),
}

/// A test that no value could pass, or that says nothing.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TestError {
    /// Values and bounds at once.
    #[error("`is` names values, and bounds are of numbers: leave one of them out")]
    Both,
    /// No number is within the bounds.
    #[error("no number is within the bounds")]
    NoNumber,
    /// A bound or a value is not finite.
    #[error("a number that is compared is finite")]
    NotFinite,
    /// No values, too many of them, or of several types.
    #[error("`is` has 1 to {MAX_VALUES} values, all of them numbers, or texts, or true and false")]
    Values,
    /// Nothing is compared.
    #[error("`each` needs `is`, or `at_least`, `at_most`, `above` or `below`")]
    Nothing,
}

impl TestTable {
    /// The test; `None` if there is none.
    pub(crate) fn check(self) -> Result<Option<ValueTest>, TestError> {
        let bounds = ValueBounds {
            at_least: self.at_least,
            at_most: self.at_most,
            above: self.above,
            below: self.below,
        };
        let given = [self.at_least, self.at_most, self.above, self.below];
        if given.into_iter().flatten().any(|bound| !bound.is_finite()) {
            return Err(TestError::NotFinite);
        }
        let is_plain = bounds == ValueBounds::default();
        match self.is {
            Some(_) if !is_plain => Err(TestError::Both),
            Some(ValueList::One(value)) => checked_values(vec![value]).map(Some),
            Some(ValueList::Several(values)) => checked_values(values).map(Some),
            None if is_plain => Ok(None),
            None if bounds.are_contradictory() => Err(TestError::NoNumber),
            None => Ok(Some(ValueTest::Within(bounds))),
        }
    }

    /// A test as it is written.
    pub(crate) fn of(test: Option<&ValueTest>) -> Self {
        match test {
            None => Self::default(),
            Some(ValueTest::Within(bounds)) => Self {
                is: None,
                at_least: bounds.at_least,
                at_most: bounds.at_most,
                above: bounds.above,
                below: bounds.below,
            },
            Some(ValueTest::Is(values)) => Self {
                is: Some(match &values[..] {
                    [value] => ValueList::One(value.clone()),
                    values => ValueList::Several(values.to_vec()),
                }),
                ..Self::default()
            },
        }
    }
}

fn checked_values(values: Vec<Variable>) -> Result<ValueTest, TestError> {
    let Some(first) = values.first() else {
        return Err(TestError::Values);
    };
    let is_one_type = values
        .iter()
        .all(|value| discriminant(value) == discriminant(first));
    if !is_one_type || values.len() > MAX_VALUES {
        return Err(TestError::Values);
    }
    if values
        .iter()
        .any(|value| value.as_f64().is_some_and(|number| !number.is_finite()))
    {
        return Err(TestError::NotFinite);
    }
    Ok(ValueTest::Is(values))
}

impl ValueTest {
    /// Whether a value passes; `None` for one of another type.
    pub(crate) fn holds(&self, value: &Variable) -> Option<bool> {
        match self {
            Self::Within(bounds) => Some(bounds.hold(number_of(value)?)),
            Self::Is(values) => {
                let first = values.first()?;
                let is_comparable = discriminant(first) == discriminant(value);
                is_comparable.then(|| values.contains(value))
            }
        }
    }

    /// Whether a number passes. Texts and flags are no numbers.
    pub(crate) fn hold_number(&self, number: f64) -> bool {
        self.holds(&Variable::Number(number)).unwrap_or(false)
    }

    /// Whether numbers can pass.
    pub(crate) fn is_of_numbers(&self) -> bool {
        match self {
            Self::Within(_) => true,
            Self::Is(values) => values.iter().all(|value| value.as_f64().is_some()),
        }
    }

    /// What is wrong with comparing a value of this type, in words; `None` if it can be compared.
    pub(crate) fn mismatch(&self, value: &Variable) -> Option<&'static str> {
        if self.holds(value).is_some() {
            return None;
        }
        Some(match (self, value) {
            (Self::Within(_), _) => "bounds are of numbers, and `is` names texts",
            (Self::Is(_), Variable::Number(_)) => "`is` has to name numbers",
            (Self::Is(_), Variable::Flag(_)) => "`is` has to be true or false",
            (Self::Is(_), Variable::Text(_)) => "`is` has to name texts",
        })
    }
}

impl ValueBounds {
    /// Whether no number is within them.
    pub(crate) fn are_contradictory(&self) -> bool {
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

    pub(crate) fn hold(&self, value: f64) -> bool {
        self.at_least.is_none_or(|bound| value >= bound)
            && self.at_most.is_none_or(|bound| value <= bound)
            && self.above.is_none_or(|bound| value > bound)
            && self.below.is_none_or(|bound| value < bound)
    }
}

/// A value as a number; a flag is 1 or 0.
pub(crate) fn number_of(value: &Variable) -> Option<f64> {
    match value {
        Variable::Number(number) => Some(*number),
        Variable::Flag(flag) => Some(f64::from(*flag)),
        Variable::Text(_) => None,
    }
}

/// The type of a value, in words.
pub(crate) fn type_in_words(value: &Variable) -> &'static str {
    match value {
        Variable::Number(_) => "a number",
        Variable::Flag(_) => "true or false",
        Variable::Text(_) => "a text",
    }
}

/// The first of some names after these words, or that there are none.
pub(crate) fn in_words<'a>(words: &str, names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.collect();
    if names.is_empty() {
        return format!("{words} none");
    }
    let more = if names.len() > MAX_LISTED {
        ", …"
    } else {
        ""
    };
    let listed = names.iter().take(MAX_LISTED).copied().collect::<Vec<_>>();
    format!("{words} {}{more}", listed.join(", "))
}

impl fmt::Display for ValueTest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bounds = match self {
            Self::Is(values) => {
                let values: Vec<String> = values.iter().map(ToString::to_string).collect();
                let values = protocol::plain::escape_line(&values.join(" or "));
                return write!(f, "is {values}");
            }
            Self::Within(bounds) => bounds,
        };
        let mut and = "";
        for (words, bound) in [
            ("at least", bounds.at_least),
            ("at most", bounds.at_most),
            ("above", bounds.above),
            ("below", bounds.below),
        ] {
            if let Some(bound) = bound {
                write!(f, "{and}{words} {bound}")?;
                and = " and ";
            }
        }
        Ok(())
    }
}

//! Sites: things at a place with a state, which robots sense and change.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::limits::{at_most, finite};
use super::point::Point;
use super::variables::{StateVariables, Variable, check_variables};
use crate::codec::{FieldError, MAX_MESSAGE_BYTES};
use crate::name::MAX_NAME_LEN;

/// Most sites of a scenario.
pub const MAX_SITES: usize = 1024;
/// Most sites that every robot knows of: with the longest names they are an eighth of a message.
pub const MAX_KNOWN_SITES: usize = 512;
/// Most variables of the state of a site.
pub const MAX_SITE_VARIABLES: usize = 16;
/// Longest text in the state of a site, in bytes.
pub const MAX_SITE_TEXT_BYTES: usize = 256;
/// Most bytes that the sites of a scenario may take together in a frame, by [`site_bytes`]: half of a message.
pub const MAX_SITES_BYTES: usize = MAX_MESSAGE_BYTES / 2;
/// Most actions on sites in a report.
pub const MAX_SITE_ACTIONS: usize = 64;

/// A site that every robot knows of: where it is, and not its state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct KnownSite {
    /// Its name.
    pub name: String,
    /// A word for what it is, from the scenario.
    pub kind: String,
    /// Where it is, meters.
    pub location: Point,
}

/// A site that a robot senses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SensedSite {
    /// Its name.
    pub name: String,
    /// A word for what it is, from the scenario.
    pub kind: String,
    /// Where it is sensed, meters.
    pub location: Point,
    /// Its state, after all actions of the tick before.
    #[serde(default)]
    pub state: StateVariables,
}

/// What a robot does to a site: all of it happens, or nothing.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SiteAction {
    /// Name of the site.
    pub site: String,
    /// New values of variables of its state.
    #[serde(default, skip_serializing_if = "StateVariables::is_empty")]
    pub set: StateVariables,
    /// What is added to numbers of its state.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub add: BTreeMap<String, f64>,
    /// Values that its state must have when the action is carried out. Otherwise the action is refused.
    #[serde(default, skip_serializing_if = "StateVariables::is_empty")]
    pub only_if: StateVariables,
}

impl SiteAction {
    /// An action that gives a variable of a site's state a new value.
    #[must_use]
    pub fn set(site: impl Into<String>, key: impl AsRef<str>, value: impl Into<Variable>) -> Self {
        Self::of(site).and_set(key, value)
    }

    /// An action that adds to a number of a site's state.
    #[must_use]
    pub fn add(site: impl Into<String>, key: impl Into<String>, number: f64) -> Self {
        Self::of(site).and_add(key, number)
    }

    fn of(site: impl Into<String>) -> Self {
        Self {
            site: site.into(),
            ..Self::default()
        }
    }

    /// The same action that also gives another variable a new value.
    #[must_use]
    pub fn and_set(mut self, key: impl AsRef<str>, value: impl Into<Variable>) -> Self {
        self.set.insert(key, value.into());
        self
    }

    /// The same action that also adds to another number.
    #[must_use]
    pub fn and_add(mut self, key: impl Into<String>, number: f64) -> Self {
        self.add.insert(key.into(), number);
        self
    }

    /// The same action, refused unless a variable has this value when it is carried out.
    #[must_use]
    pub fn only_if(mut self, key: impl AsRef<str>, value: impl Into<Variable>) -> Self {
        self.only_if.insert(key, value.into());
        self
    }

    /// The variables that the action changes.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        let set = self.set.iter().map(|(key, _)| key);
        set.chain(self.add.keys().map(String::as_str))
    }

    fn check(&self) -> Result<(), FieldError> {
        at_most(MAX_NAME_LEN, &self.site, "site_actions.site")?;
        check_variables(&self.set)?;
        check_variables(&self.only_if)?;
        for variables in [&self.set, &self.only_if] {
            at_most_variables(variables.len())?;
        }
        at_most_variables(self.add.len())?;
        for (key, number) in &self.add {
            at_most(MAX_NAME_LEN, key, "site_actions.add")?;
            finite(*number, "site_actions.add")?;
        }
        Ok(())
    }
}

fn at_most_variables(count: usize) -> Result<(), FieldError> {
    if count <= MAX_SITE_VARIABLES {
        return Ok(());
    }
    let reason = format!("{count} variables, more than the {MAX_SITE_VARIABLES} allowed");
    Err(FieldError::new("site_actions", reason))
}

/// Checks the actions of a report.
pub(super) fn check_site_actions(actions: &[SiteAction]) -> Result<(), FieldError> {
    if actions.len() > MAX_SITE_ACTIONS {
        let reason = format!(
            "{} actions, more than the {MAX_SITE_ACTIONS} allowed",
            actions.len()
        );
        return Err(FieldError::new("site_actions", reason));
    }
    actions.iter().try_for_each(SiteAction::check)
}

/// What became of an action on a site.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SiteResult {
    /// Name of the site, as the action had it.
    pub site: String,
    /// Why the action was refused; absent if it was carried out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<SiteRefusal>,
}

/// Why an action on a site was refused. The first reason that holds counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum SiteRefusal {
    /// The scenario has no site of this name.
    UnknownSite,
    /// The robot is farther away than the range of the site.
    OutOfRange,
    /// The state of the site has no such variable.
    UnknownKey,
    /// A variable of another kind: number, text and flag do not replace each other.
    OtherType,
    /// The text is longer than a site holds, or all sites together would be longer than [`MAX_SITES_BYTES`].
    TooLong,
    /// The state is not as `only_if` has it.
    Condition,
    /// The number would leave its bounds.
    Bound,
    /// Another robot changes the same variable in this tick, and the site refuses both.
    Conflict,
}

impl SiteRefusal {
    /// The word for it, as in messages and records.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::UnknownSite => "unknown_site",
            Self::OutOfRange => "out_of_range",
            Self::UnknownKey => "unknown_key",
            Self::OtherType => "other_type",
            Self::TooLong => "too_long",
            Self::Condition => "condition",
            Self::Bound => "bound",
            Self::Conflict => "conflict",
        }
    }
}

impl std::fmt::Display for SiteRefusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::UnknownSite => "there is no such site",
            Self::OutOfRange => "it is out of range",
            Self::UnknownKey => "its state has no such variable",
            Self::OtherType => "the variable has another type",
            Self::TooLong => "the text is too long",
            Self::Condition => "its state is not as the robot requires",
            Self::Bound => "the number would leave its bounds",
            Self::Conflict => "another robot changes it in the same tick",
        })
    }
}

/// An upper bound of the bytes of a site in a message.
#[must_use]
pub fn site_bytes(name: &str, kind: &str, state: &StateVariables) -> usize {
    /// Of a byte of a text, which JSON may escape.
    const ESCAPED: usize = 6;
    /// Of the names of fields, a place and their separators.
    const FIELDS: usize = 120;
    /// Of a number and its separators.
    const VARIABLE: usize = 30;

    let mut bytes = FIELDS + name.len() + kind.len();
    for (key, value) in state {
        let text = value.as_str().map_or(0, str::len);
        bytes += VARIABLE + key.len() + ESCAPED * text;
    }
    bytes
}

/// A site as observers see it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SiteFrame {
    /// Its name.
    pub name: String,
    /// A word for what it is.
    pub kind: String,
    /// Where, meters.
    pub location: Point,
    /// Its state.
    #[serde(default)]
    pub state: StateVariables,
}

//! Emotion schemata: the components that all instances of an emotion share, as data.
//!
//! A schema contains all components of an emotion except those that depend on the situation: the intensity, the
//! other agent, and the description of the goal. Together with these it produces an [`Emotion`]. The schemata of
//! [`StandardEmotion`] are in a TOML file of this crate, which marks each value as documented or chosen. A robot with
//! an emotion of its own defines a table for it and loads it with [`Schemata::from_toml`].
//!
//! [`StandardEmotion`]: crate::StandardEmotion

use crate::akr::{
    Account, ActionTendency, Agency, Certainty, Clause, Compatibility, Components, Degree,
    Duration, Emotion, FacialExpression, Focality, GoalStatus, Novelty, Refusal, Valence,
};
use crate::scalar::Intensity;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::OnceLock;

const STANDARD: &str = include_str!("schemata.toml");

/// Placeholders that a causal chain can contain: the goal, the other agent, and the amount left.
const SLOTS: [&str; 3] = ["g", "a", "n"];

/// Why schemata are invalid, or an emotion cannot be created from one.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SchemaError {
    /// The text is not valid TOML, or not a table of schemata.
    #[error("{0}")]
    Syntax(String),
    /// A causal chain contains an unknown placeholder.
    #[error(
        "unknown placeholder {{{slot}}} in the causal chain of {name}; expected {{g}}, {{a}} or {{n}}"
    )]
    UnknownSlot {
        /// Name of the emotion.
        name: String,
        /// The placeholder, without braces.
        slot: String,
    },
    /// A causal chain contains an unmatched brace.
    #[error("unmatched brace in the causal chain of {name}: {text}")]
    OpenBrace {
        /// Name of the emotion.
        name: String,
        /// The text of the clause.
        text: String,
    },
    /// There is no schema with this name.
    #[error("no schema for {0}")]
    Unknown(String),
    /// The components contradict each other.
    #[error(transparent)]
    Refused(#[from] Refusal),
}

/// The agent responsible, by role; the name is known only to an instance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AgencyRole {
    /// The agent that feels the emotion.
    #[serde(rename = "self")]
    Oneself,
    /// Another agent.
    Other,
}

/// The valence of all instances of an emotion, unless it depends on the situation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SchemaValence {
    /// Always pleasant.
    Positive,
    /// Always unpleasant.
    Negative,
    /// Depends on the circumstances; only valid for surprise [D: S].
    Either,
}

/// The components that all instances of one emotion share.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schema {
    /// Facial expression.
    pub facial_expression: FacialExpression,
    /// Valence, or that it can be either.
    pub valence: SchemaValence,
    /// How long the emotion lasts; minutes by default [D: S].
    #[serde(default = "minutes")]
    pub duration: Duration,
    /// The agent responsible for the eliciting event.
    pub agency: AgencyRole,
    /// What the emotion is about.
    pub focality: Focality,
    /// Whether the eliciting event was expected.
    pub novelty: Novelty,
    /// How much control the agent has over what happens.
    pub controllability: Degree,
    /// How much of what happens can be changed at all.
    pub modifiability: Degree,
    /// Whether the agent is certain of what happens.
    pub certainty: Certainty,
    /// Whether what happens agrees with the norms of others.
    pub external_norms: Compatibility,
    /// Whether what happens agrees with the agent's own standards.
    pub internal_standards: Compatibility,
    /// What the emotion inclines the agent to do.
    pub action_tendency: ActionTendency,
    /// Status of the goal.
    pub goal: GoalStatus,
    /// The clauses of the causal chain, with the placeholders `{g}` (goal), `{a}` (other agent) and `{n}` (amount).
    pub causal_chain: Vec<Clause>,
}

fn minutes() -> Duration {
    Duration::Minutes
}

/// The situation in which an emotion is felt. Every field may be unknown.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Circumstances<'a> {
    /// The other agent, `{a}` in the causal chain. Required if the schema holds another agent responsible.
    pub other: Option<&'a str>,
    /// The goal, `{g}` in the causal chain, in words that follow "I want", such as "to serve the guests".
    pub goal: Option<&'a str>,
    /// The amount left, `{n}` in the causal chain, such as "7 treats".
    pub amount: Option<&'a str>,
    /// The valence, for a schema that allows either.
    pub valence: Option<Valence>,
}

impl Circumstances<'_> {
    fn word(&self, slot: &str) -> Option<&str> {
        match slot {
            "g" => self.goal,
            "a" => self.other,
            "n" => self.amount,
            _ => None,
        }
    }
}

impl Schema {
    /// Creates an instance of this emotion with the given name.
    ///
    /// # Errors
    ///
    /// Returns a [`Refusal`] if the components contradict each other, or if the schema needs circumstances that are
    /// not given.
    pub fn emotion(
        &self,
        name: &str,
        intensity: Intensity,
        circumstances: &Circumstances<'_>,
    ) -> Result<Emotion, Refusal> {
        let agency = self.agency_in(circumstances);
        let agency = agency.ok_or_else(|| Refusal::AgentUnnamed {
            name: name.to_owned(),
        })?;

        let valence = self.valence_in(circumstances);
        let valence = valence.ok_or_else(|| Refusal::ValenceOpen {
            name: name.to_owned(),
        })?;

        Emotion::new(Components {
            name: name.to_owned(),
            facial_expression: self.facial_expression,
            valence,
            intensity,
            duration: self.duration,
            agency,
            focality: self.focality,
            novelty: self.novelty,
            controllability: self.controllability,
            modifiability: self.modifiability,
            certainty: self.certainty,
            external_norms: self.external_norms,
            internal_standards: self.internal_standards,
            action_tendency: self.action_tendency,
            causal_chain: self.account(circumstances),
        })
    }

    fn agency_in(&self, circumstances: &Circumstances<'_>) -> Option<Agency> {
        match self.agency {
            AgencyRole::Oneself => Some(Agency::Oneself),
            AgencyRole::Other => {
                let other = circumstances.other?;
                Some(Agency::Other(other.to_owned()))
            }
        }
    }

    fn valence_in(&self, circumstances: &Circumstances<'_>) -> Option<Valence> {
        match self.valence {
            SchemaValence::Positive => Some(Valence::Positive),
            SchemaValence::Negative => Some(Valence::Negative),
            SchemaValence::Either => circumstances.valence,
        }
    }

    /// The causal chain in words. Clauses that mention unknown circumstances are left out.
    pub fn account(&self, circumstances: &Circumstances<'_>) -> Account {
        let mut clauses = Vec::new();

        for clause in &self.causal_chain {
            if let Some(text) = fill(&clause.text, circumstances) {
                clauses.push(Clause {
                    kind: clause.kind,
                    text,
                });
            }
        }

        Account {
            goal: self.goal,
            clauses,
        }
    }

    /// Rejects schemata without any valid instance, so that errors are reported when a file is loaded.
    fn check(&self, name: &str) -> Result<(), SchemaError> {
        for clause in &self.causal_chain {
            check_slots(name, &clause.text)?;
        }

        let is_surprise = self.facial_expression == FacialExpression::Surprised;
        if self.valence == SchemaValence::Either && !is_surprise {
            let name = name.to_owned();
            return Err(Refusal::ValenceOpen { name }.into());
        }

        let example = Circumstances {
            other: Some("-"),
            valence: Some(Valence::Positive),
            ..Default::default()
        };
        self.emotion(name, Intensity::MIN, &example)?;

        Ok(())
    }
}

/// Replaces the placeholders of a template. Returns `None` if the circumstances lack one of them.
///
/// Text that has been inserted is not expanded again.
fn fill(template: &str, circumstances: &Circumstances<'_>) -> Option<String> {
    let mut text = String::new();
    let mut rest = template;

    while let Some((before, after)) = rest.split_once('{') {
        let (slot, tail) = after.split_once('}')?;
        text.push_str(before);
        text.push_str(circumstances.word(slot)?);
        rest = tail;
    }

    text.push_str(rest);
    Some(text)
}

fn check_slots(name: &str, text: &str) -> Result<(), SchemaError> {
    for slot in slots(text) {
        let Some(slot) = slot else {
            return Err(SchemaError::OpenBrace {
                name: name.to_owned(),
                text: text.to_owned(),
            });
        };

        if !SLOTS.contains(&slot) {
            return Err(SchemaError::UnknownSlot {
                name: name.to_owned(),
                slot: slot.to_owned(),
            });
        }
    }

    Ok(())
}

/// The placeholders in a text, in order, with `None` for an unmatched brace.
fn slots(text: &str) -> Vec<Option<&str>> {
    let mut slots = Vec::new();

    let mut pieces = text.split('{');
    if pieces.next().is_some_and(|before| before.contains('}')) {
        slots.push(None);
    }
    for piece in pieces {
        match piece.split_once('}') {
            Some((slot, after)) if !after.contains('}') => slots.push(Some(slot)),
            _ => slots.push(None),
        }
    }

    slots
}

/// A set of schemata, indexed by the name of the emotion.
///
/// ```
/// use affect::{Circumstances, Intensity, Schemata};
/// let circumstances = Circumstances {
///     other: Some("Leguin"),
///     goal: Some("to serve the guests"),
///     amount: Some("7 treats"),
///     ..Default::default()
/// };
/// let concerned = Schemata::standard().emotion("CONCERNED", Intensity::new(0.5)?, &circumstances)?;
/// assert_eq!(
///     concerned.components().causal_chain.spoken(),
///     "I want to serve the guests; 7 treats are left; Leguin is not here; something bad can happen soon; \
///      I do not want it; I do not know if it will happen; because of this I feel bad."
/// );
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Schemata {
    by_name: BTreeMap<String, Schema>,
}

impl Schemata {
    /// The schemata of the standard emotions.
    pub fn standard() -> &'static Self {
        static SCHEMATA: OnceLock<Schemata> = OnceLock::new();
        SCHEMATA.get_or_init(|| match Self::from_toml(STANDARD) {
            Ok(schemata) => schemata,
            Err(error) => {
                unreachable!("schemata.toml is part of this crate and tested, but invalid: {error}")
            }
        })
    }

    /// Parses and validates schemata from TOML text with one table per emotion.
    ///
    /// # Errors
    ///
    /// Returns an error if the text cannot be parsed or if a schema has no valid instance.
    pub fn from_toml(text: &str) -> Result<Self, SchemaError> {
        let by_name: BTreeMap<String, Schema> =
            toml::from_str(text).map_err(|error| SchemaError::Syntax(error.to_string()))?;

        for (name, schema) in &by_name {
            schema.check(name)?;
        }

        Ok(Self { by_name })
    }

    /// Adds the schemata of `other`, which replace those with the same name.
    #[must_use]
    pub fn with(mut self, other: Self) -> Self {
        self.by_name.extend(other.by_name);
        self
    }

    /// The schema with this name.
    pub fn get(&self, name: &str) -> Option<&Schema> {
        self.by_name.get(name)
    }

    /// All names, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.by_name.keys().map(String::as_str)
    }

    /// Creates an instance of the emotion with this name.
    ///
    /// # Errors
    ///
    /// Returns an error if there is no such schema, or if it does not fit the circumstances.
    pub fn emotion(
        &self,
        name: &str,
        intensity: Intensity,
        circumstances: &Circumstances<'_>,
    ) -> Result<Emotion, SchemaError> {
        let schema = self
            .get(name)
            .ok_or_else(|| SchemaError::Unknown(name.to_owned()))?;
        let emotion = schema.emotion(name, intensity, circumstances)?;

        Ok(emotion)
    }
}

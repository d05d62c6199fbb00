//! Emotion schemata: what is the same in every instance of an emotion, as data.
//!
//! A schema holds all components but those of the moment (intensity, who the other agent is, what the
//! goal is called); with these it gives an [`Emotion`]. The schemata of [`StandardEmotion`] are a TOML file
//! of this crate, in which every value says whether it is documented. A robot with an emotion of its
//! own writes a table for it and reads that with [`Schemata::from_toml`].
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

/// Words that a causal chain may ask for, with what they stand for.
const SLOTS: [&str; 3] = ["g", "a", "n"];

/// Why a text is no set of schemata, or an emotion cannot be made from one.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SchemaError {
    /// The text is not TOML, or not a table of schemata.
    #[error("{0}")]
    Syntax(String),
    /// A causal chain asks for a word that does not exist.
    #[error("the causal chain of {name} asks for {{{slot}}}; known are {{g}}, {{a}} and {{n}}")]
    UnknownSlot {
        /// The emotion.
        name: String,
        /// What it asks for.
        slot: String,
    },
    /// A brace without its counterpart.
    #[error("a brace is not closed in the causal chain of {name}: {text}")]
    OpenBrace {
        /// The emotion.
        name: String,
        /// The clause.
        text: String,
    },
    /// No schema has this name.
    #[error("there is no schema for {0}")]
    Unknown(String),
    /// The components contradict each other.
    #[error(transparent)]
    Refused(#[from] Refusal),
}

/// Who is responsible, before anybody has a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AgencyRole {
    /// The agent that feels it.
    #[serde(rename = "self")]
    Oneself,
    /// Another agent.
    Other,
}

/// The valence of every instance, or none in particular.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SchemaValence {
    /// Always pleasant.
    Positive,
    /// Always unpleasant.
    Negative,
    /// As the circumstances are; legal for surprise only [D: S].
    Either,
}

/// What is the same in every instance of one emotion.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schema {
    /// The face that goes with it.
    pub facial_expression: FacialExpression,
    /// Pleasant, unpleasant, or either.
    pub valence: SchemaValence,
    /// How long it lasts; minutes if absent [D: S].
    #[serde(default = "minutes")]
    pub duration: Duration,
    /// Who is responsible.
    pub agency: AgencyRole,
    /// What it is about.
    pub focality: Focality,
    /// Whether the event was expected.
    pub novelty: Novelty,
    /// How far the agent controls what happens.
    pub controllability: Degree,
    /// How far what happens can be changed at all.
    pub modifiability: Degree,
    /// Whether the agent is sure of what happens.
    pub certainty: Certainty,
    /// Whether it agrees with the norms of others.
    pub external_norms: Compatibility,
    /// Whether it agrees with the agent's own standards.
    pub internal_standards: Compatibility,
    /// What it inclines the agent to do.
    pub action_tendency: ActionTendency,
    /// How it stands with the goal.
    pub goal: GoalStatus,
    /// The account, with `{g}`, `{a}` and `{n}` where words of the moment belong.
    pub causal_chain: Vec<Clause>,
}

fn minutes() -> Duration {
    Duration::Minutes
}

/// What an instance of an emotion knows besides its schema. All of it may be unknown.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Circumstances<'a> {
    /// The other agent: who is responsible if the schema says other, and `{a}` in the causal chain.
    pub other: Option<&'a str>,
    /// The goal in words that follow "I want", `{g}`; for instance "to serve the guests".
    pub goal: Option<&'a str>,
    /// How much is left, `{n}`; for instance "7 treats".
    pub amount: Option<&'a str>,
    /// The valence, for a schema that leaves it open.
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
    /// An instance of this emotion, called `name`.
    ///
    /// # Errors
    /// The components contradict each other, or the emotion points to another agent who is not named.
    pub fn emotion(
        &self,
        name: &str,
        intensity: Intensity,
        circumstances: &Circumstances<'_>,
    ) -> Result<Emotion, Refusal> {
        let own = || name.to_owned();
        let agency = match (self.agency, circumstances.other) {
            (AgencyRole::Oneself, _) => Agency::Oneself,
            (AgencyRole::Other, Some(other)) => Agency::Other(other.to_owned()),
            (AgencyRole::Other, None) => return Err(Refusal::AgentUnnamed { name: own() }),
        };
        let valence = match self.valence {
            SchemaValence::Positive => Valence::Positive,
            SchemaValence::Negative => Valence::Negative,
            SchemaValence::Either => circumstances
                .valence
                .ok_or(Refusal::ValenceOpen { name: own() })?,
        };
        Emotion::new(Components {
            name: own(),
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

    /// The causal chain in words. A clause that speaks of something unknown is left out.
    pub fn account(&self, circumstances: &Circumstances<'_>) -> Account {
        let told = |clause: &Clause| {
            let text = fill(&clause.text, circumstances)?;
            Some(Clause {
                kind: clause.kind,
                text,
            })
        };
        Account {
            goal: self.goal,
            clauses: self.causal_chain.iter().filter_map(told).collect(),
        }
    }

    /// Refuses what no instance could ever be, so that a file is found wrong when it is read.
    fn check(&self, name: &str) -> Result<(), SchemaError> {
        for clause in &self.causal_chain {
            check_slots(name, &clause.text)?;
        }
        if self.valence == SchemaValence::Either
            && self.facial_expression != FacialExpression::Surprised
        {
            return Err(Refusal::ValenceOpen {
                name: name.to_owned(),
            }
            .into());
        }
        let anybody = Circumstances {
            other: Some("-"),
            valence: Some(Valence::Positive),
            ..Default::default()
        };
        self.emotion(name, Intensity::MIN, &anybody)?;
        Ok(())
    }
}

/// Puts words into a template, once: a word that looks like a slot stays as it is. None if one is unknown.
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
    let open_brace = || SchemaError::OpenBrace {
        name: name.to_owned(),
        text: text.to_owned(),
    };
    let mut pieces = text.split('{');
    if pieces.next().is_some_and(|before| before.contains('}')) {
        return Err(open_brace());
    }
    for piece in pieces {
        let (slot, after) = piece.split_once('}').ok_or_else(open_brace)?;
        if after.contains('}') {
            return Err(open_brace());
        }
        if !SLOTS.contains(&slot) {
            return Err(SchemaError::UnknownSlot {
                name: name.to_owned(),
                slot: slot.to_owned(),
            });
        }
    }
    Ok(())
}

/// Schemata by name.
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
                unreachable!(
                    "the crate's own schemata.toml, which its tests read, is wrong: {error}"
                )
            }
        })
    }

    /// Reads and checks schemata from TOML text: a table for each emotion.
    pub fn from_toml(text: &str) -> Result<Self, SchemaError> {
        let by_name: BTreeMap<String, Schema> =
            toml::from_str(text).map_err(|error| SchemaError::Syntax(error.to_string()))?;
        for (name, schema) in &by_name {
            schema.check(name)?;
        }
        Ok(Self { by_name })
    }

    /// These schemata with those of `other` added; where both have one, that of `other` counts.
    #[must_use]
    pub fn with(mut self, other: Self) -> Self {
        self.by_name.extend(other.by_name);
        self
    }

    /// The schema of this name.
    pub fn get(&self, name: &str) -> Option<&Schema> {
        self.by_name.get(name)
    }

    /// Every name, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.by_name.keys().map(String::as_str)
    }

    /// An instance of the emotion called `name`.
    pub fn emotion(
        &self,
        name: &str,
        intensity: Intensity,
        circumstances: &Circumstances<'_>,
    ) -> Result<Emotion, SchemaError> {
        let schema = self
            .get(name)
            .ok_or_else(|| SchemaError::Unknown(name.to_owned()))?;
        Ok(schema.emotion(name, intensity, circumstances)?)
    }
}

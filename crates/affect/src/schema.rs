//! Emotion schemata: the components that all instances of an emotion share, as data.
//!
//! Together with an urgency and an appraisal, which depend on the situation, a schema makes a [`AffectFrame`](crate::AffectFrame). The schemata of
//! [`StandardEmotion`] are in a TOML file of this crate, which marks each value as documented or chosen. A robot with
//! an emotion of its own defines a table for it and loads it with [`Schemata::from_toml`].
//!
//! [`StandardEmotion`]: crate::StandardEmotion

use crate::akr::{ActionTendency, FacialExpression, Valence};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::OnceLock;

const STANDARD: &str = include_str!("schemata.toml");

/// Placeholders that a causal chain can contain: the goal, the other agent, and the amount left.
const SLOTS: [&str; 3] = ["g", "a", "n"];

/// Why schemata are invalid.
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
    /// An emotion without a name.
    #[error("an emotion must have a name")]
    Unnamed,
    /// A facial expression that contradicts the valence.
    ///
    /// Surprise goes with either valence [D: S], and so does a neutral face.
    #[error("{name} has {valence:?} valence, which contradicts its {face:?} face")]
    FaceContradictsValence {
        /// Name of the emotion.
        name: String,
        /// Its valence.
        valence: Valence,
        /// Its facial expression.
        face: FacialExpression,
    },
}

/// The components that all instances of one emotion share.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schema {
    /// Facial expression.
    pub facial_expression: FacialExpression,
    /// Whether the emotion is pleasant.
    pub valence: Valence,
    /// What the emotion inclines the agent to do.
    pub action_tendency: ActionTendency,
    /// The clauses of the causal chain, in order, with the placeholders `{g}` (goal), `{a}` (other agent) and `{n}`
    /// (amount).
    ///
    /// That causal chains mention beliefs, goals and whether goals are achieved is documented, and that they can be
    /// spoken [D: S]; so is their form, short scripts of simple words, following Wierzbicka. The published scripts were
    /// not readable; those of this crate are newly written \[I\].
    pub causal_chain: Vec<String>,
}

/// The words that fill the placeholders of a causal chain. Every field may be unknown.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Circumstances<'a> {
    /// The other agent, `{a}` in the causal chain.
    pub other: Option<&'a str>,
    /// The goal, `{g}` in the causal chain, in words that follow "I want", such as "to serve the guests".
    pub goal: Option<&'a str>,
    /// The amount left, `{n}` in the causal chain, such as "7 treats".
    pub amount: Option<&'a str>,
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
    /// The causal chain as one sentence, for speech output or a panel.
    ///
    /// Clauses that mention unknown circumstances are left out.
    pub fn spoken(&self, circumstances: &Circumstances<'_>) -> String {
        let mut texts = Vec::new();
        for clause in &self.causal_chain {
            texts.extend(fill(clause, circumstances));
        }
        let mut sentence = texts.join("; ");

        if let Some(first) = sentence.chars().next() {
            let capital: String = first.to_uppercase().collect();
            sentence.replace_range(..first.len_utf8(), &capital);
            sentence.push('.');
        }

        sentence
    }

    /// Rejects contradictory schemata, so that errors are reported when a file is loaded.
    fn check(&self, name: &str) -> Result<(), SchemaError> {
        if name.is_empty() {
            return Err(SchemaError::Unnamed);
        }

        for clause in &self.causal_chain {
            check_slots(name, clause)?;
        }

        let face = self.facial_expression;
        match face.valence() {
            Some(shown) if shown != self.valence => Err(SchemaError::FaceContradictsValence {
                name: name.to_owned(),
                valence: self.valence,
                face,
            }),
            _ => Ok(()),
        }
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
/// use affect::{Circumstances, Schemata};
/// let circumstances = Circumstances {
///     other: Some("Leguin"),
///     goal: Some("to serve the guests"),
///     amount: Some("7 treats"),
/// };
/// let concerned = Schemata::standard().get("CONCERNED").ok_or("no schema")?;
/// assert_eq!(
///     concerned.spoken(&circumstances),
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
    /// Returns an error if the text cannot be parsed or if a schema contradicts itself.
    pub fn from_toml(text: &str) -> Result<Self, SchemaError> {
        let by_name: BTreeMap<String, Schema> =
            toml::from_str(text).map_err(|error| SchemaError::Syntax(error.to_string()))?;

        for (name, schema) in &by_name {
            schema.check(name)?;
        }

        Ok(Self { by_name })
    }

    /// The schema with this name.
    pub fn get(&self, name: &str) -> Option<&Schema> {
        self.by_name.get(name)
    }

    /// All names, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.by_name.keys().map(String::as_str)
    }

    /// The schema with this name, and the name as these schemata hold it.
    pub(crate) fn entry(&self, name: &str) -> Option<(&str, &Schema)> {
        let (name, schema) = self.by_name.get_key_value(name)?;

        Some((name, schema))
    }
}

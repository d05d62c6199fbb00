//! Causal chains: the beliefs and goals behind an emotion, as structure and as text.

use std::fmt;

use serde::Deserialize;

/// Placeholders that a causal chain can contain: the goal, the other agent, and the amount left.
const SLOTS: [&str; 3] = ["g", "a", "n"];
/// Separates the clauses of a chain in its published form.
const SEPARATOR: &str = "; ";

/// What a clause of a causal chain is. That chains describe "the beliefs, the goals, and their achievement or lack of" is
/// documented [D: S]; the kinds are chosen here \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ClauseKind {
    /// A goal that is not achieved.
    Goal,
    /// A goal that is achieved.
    AchievedGoal,
    /// A goal that has been given up.
    LostGoal,
    /// What the agent believes of its situation.
    Belief,
    /// What follows for the agent: what it feels or wants.
    Effect,
}

impl ClauseKind {
    /// Every kind.
    pub const ALL: [Self; 5] = [
        Self::Goal,
        Self::AchievedGoal,
        Self::LostGoal,
        Self::Belief,
        Self::Effect,
    ];

    /// The name with which a clause begins.
    pub fn name(self) -> &'static str {
        match self {
            Self::Goal => "goal",
            Self::AchievedGoal => "achieved goal",
            Self::LostGoal => "lost goal",
            Self::Belief => "belief",
            Self::Effect => "effect",
        }
    }
}

/// A clause of a causal chain: `goal: I want to serve the guests`.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Clause {
    /// What it is.
    pub kind: ClauseKind,
    /// Its words. In a schema they can contain the placeholders `{g}`, `{a}` and `{n}`.
    pub text: String,
}

/// Why the text of a clause is invalid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ClauseError {
    /// It does not begin with its kind.
    #[error(
        "the clause {0:?} does not begin with its kind: `goal: `, `achieved goal: `, `lost goal: `, `belief: ` or \
         `effect: `"
    )]
    Kind(String),
    /// It contains an unknown placeholder.
    #[error("unknown placeholder {{{slot}}} in {text:?}; expected {{g}}, {{a}} or {{n}}")]
    UnknownSlot {
        /// The placeholder, without braces.
        slot: String,
        /// The words of the clause.
        text: String,
    },
    /// It contains an unmatched brace.
    #[error("unmatched brace in {0:?}")]
    OpenBrace(String),
}

impl TryFrom<String> for Clause {
    type Error = ClauseError;

    fn try_from(text: String) -> Result<Self, ClauseError> {
        let Some(clause) = Self::read(&text) else {
            return Err(ClauseError::Kind(text));
        };

        clause.check_slots()?;
        Ok(clause)
    }
}

impl fmt::Display for Clause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.kind.name(), self.text)
    }
}

impl Clause {
    fn read(text: &str) -> Option<Self> {
        let (kind, text) = parts(text)?;

        Some(Self {
            kind,
            text: text.to_owned(),
        })
    }

    fn check_slots(&self) -> Result<(), ClauseError> {
        for slot in slots(&self.text) {
            let Some(slot) = slot else {
                return Err(ClauseError::OpenBrace(self.text.clone()));
            };

            if !SLOTS.contains(&slot) {
                return Err(ClauseError::UnknownSlot {
                    slot: slot.to_owned(),
                    text: self.text.clone(),
                });
            }
        }

        Ok(())
    }

    /// Replaces the placeholders. Returns `None` if the circumstances lack one of them.
    ///
    /// Text that has been inserted is not expanded again.
    fn fill(&self, circumstances: &Circumstances<'_>) -> Option<Self> {
        let mut text = String::new();
        let mut rest = self.text.as_str();

        while let Some((before, after)) = rest.split_once('{') {
            let (slot, tail) = after.split_once('}')?;
            text.push_str(before);
            text.push_str(circumstances.word(slot)?);
            rest = tail;
        }

        text.push_str(rest);
        Some(Self {
            kind: self.kind,
            text,
        })
    }
}

/// Kind and words of a clause in its published form.
fn parts(clause: &str) -> Option<(ClauseKind, &str)> {
    ClauseKind::ALL.into_iter().find_map(|kind| {
        let text = clause.strip_prefix(kind.name())?.strip_prefix(": ")?;
        Some((kind, text))
    })
}

/// The words of clauses as one sentence.
fn sentence<'a>(texts: impl IntoIterator<Item = &'a str>) -> String {
    let mut texts = texts.into_iter();
    let mut sentence = String::new();

    if let Some(first) = texts.next() {
        let mut letters = first.chars();
        sentence.extend(letters.next().into_iter().flat_map(char::to_uppercase));
        sentence.push_str(letters.as_str());
    }
    for text in texts {
        sentence.push_str(SEPARATOR);
        sentence.push_str(text);
    }
    if !sentence.is_empty() {
        sentence.push('.');
    }

    sentence
}

/// What a chain in its published form says, as [`CausalChain::spoken`]; empty if it is none.
pub(crate) fn spoken(published: &str) -> String {
    // Panels ask in every tick: nothing is copied before it is known to be said.
    let clauses = || published.split(SEPARATOR).map(parts);
    if clauses().any(|clause| clause.is_none()) {
        return String::new();
    }
    sentence(clauses().flatten().map(|(_, text)| text))
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

impl<'a> Circumstances<'a> {
    /// These circumstances with an amount left.
    #[must_use]
    pub fn with_amount(mut self, amount: &'a str) -> Self {
        self.amount = Some(amount);
        self
    }

    fn word(&self, slot: &str) -> Option<&str> {
        match slot {
            "g" => self.goal,
            "a" => self.other,
            "n" => self.amount,
            _ => None,
        }
    }
}

/// A causal chain: clauses in order.
///
/// Its published form has all of its structure, and the sentence that a robot speaks follows from it.
///
/// ```
/// use affect::{CausalChain, ClauseKind};
/// let chain = CausalChain::read("goal: I want to serve; belief: Leguin is not here").ok_or("no chain")?;
/// assert_eq!(chain.clauses()[1].kind, ClauseKind::Belief);
/// assert_eq!(chain.spoken(), "I want to serve; Leguin is not here.");
/// assert_eq!(chain.to_string(), "goal: I want to serve; belief: Leguin is not here");
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(transparent)]
pub struct CausalChain(Vec<Clause>);

impl CausalChain {
    /// Reads the published form; `None` if a clause does not begin with its kind.
    pub fn read(text: &str) -> Option<Self> {
        let clauses = text.split(SEPARATOR).map(Clause::read);
        clauses.collect::<Option<Vec<_>>>().map(Self)
    }

    /// The clauses, in order.
    pub fn clauses(&self) -> &[Clause] {
        &self.0
    }

    /// The chain under these circumstances. Clauses that mention unknown ones are left out.
    #[must_use]
    pub fn filled(&self, circumstances: &Circumstances<'_>) -> Self {
        let clauses = self.0.iter();
        Self(clauses.filter_map(|one| one.fill(circumstances)).collect())
    }

    /// The chain as one sentence, for speech output or a panel.
    pub fn spoken(&self) -> String {
        sentence(self.0.iter().map(|clause| clause.text.as_str()))
    }
}

impl fmt::Display for CausalChain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, clause) in self.0.iter().enumerate() {
            let separator = if index == 0 { "" } else { SEPARATOR };
            // A semicolon of a word would begin another clause.
            let clause = clause.to_string().replace(SEPARATOR, ", ");
            write!(f, "{separator}{clause}")?;
        }

        Ok(())
    }
}

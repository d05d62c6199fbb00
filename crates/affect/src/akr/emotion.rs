//! Emotion: the most differentiated affective state, a set of components.

use super::Refusal;
use super::affect::{Affect, Duration, Focality, Valence};
use super::appraisal::{Agency, Certainty, Compatibility, Degree, FacialExpression, Novelty};
use super::tendency::ActionTendency;
use crate::scalar::Intensity;
use serde::{Deserialize, Serialize};

/// What a clause of a causal chain speaks of. That chains speak of beliefs, goals and whether these are
/// achieved is documented [D: S]; the division into clauses is chosen here \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClauseKind {
    /// What happens or was done.
    Event,
    /// What the agent takes to be so.
    Belief,
    /// What it wants or does not want.
    Goal,
    /// What it feels and is inclined to do because of that.
    Feeling,
}

/// How it stands with the goal that an emotion is about \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GoalStatus {
    /// It is being reached.
    Achieved,
    /// It will be reached, the agent thinks.
    Expected,
    /// It may be missed.
    AtRisk,
    /// It cannot be reached in this way.
    Blocked,
    /// It is given up.
    Lost,
}

/// What an emotion signals about the course of action: to oneself, and to others, who can see it [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Signal {
    /// Go on in this direction.
    Continue,
    /// Reach the goal in another way.
    ChangeCourse,
    /// Leave the goal.
    Disengage,
}

impl GoalStatus {
    /// That an achieved goal signals to continue, and a lost one to change course or to disengage, is documented
    /// [D: S]; which of the two a blocked goal signals, and that one at risk still signals to continue, is chosen
    /// here \[I\].
    pub fn signal(self) -> Signal {
        match self {
            Self::Achieved | Self::Expected | Self::AtRisk => Signal::Continue,
            Self::Blocked => Signal::ChangeCourse,
            Self::Lost => Signal::Disengage,
        }
    }
}

/// One step of a causal chain, in words.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clause {
    /// What it speaks of.
    pub kind: ClauseKind,
    /// The words.
    pub text: String,
}

/// A causal chain: how the agent accounts for its emotion.
///
/// That it can be spoken is documented [D: S], as is the method: short scripts of simple words after
/// Wierzbicka. The published texts were not readable; those of this crate are its own \[I\].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Account {
    /// How it stands with the goal.
    pub goal: GoalStatus,
    /// The steps, in order.
    pub clauses: Vec<Clause>,
}

impl Account {
    /// The chain as one sentence for a voice or a panel.
    pub fn spoken(&self) -> String {
        let texts: Vec<&str> = self
            .clauses
            .iter()
            .map(|clause| clause.text.as_str())
            .collect();
        let mut sentence = texts.join("; ");
        if let Some(first) = sentence.chars().next() {
            let capital: String = first.to_uppercase().collect();
            sentence.replace_range(..first.len_utf8(), &capital);
            sentence.push('.');
        }
        sentence
    }
}

/// Everything that makes up an emotion, not yet checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Components {
    /// What it is called.
    pub name: String,
    /// The face that goes with it.
    pub facial_expression: FacialExpression,
    /// Pleasant or unpleasant.
    pub valence: Valence,
    /// How strongly it is felt.
    pub intensity: Intensity,
    /// How long it lasts: minutes.
    pub duration: Duration,
    /// Who is responsible.
    pub agency: Agency,
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
    /// How the agent accounts for it.
    pub causal_chain: Account,
}

/// An emotion with legal components [D: S].
///
/// ```
/// use affect::akr::{Duration, Emotion};
/// use affect::{Circumstances, Intensity, Schemata};
/// let circumstances = Circumstances { other: Some("Leguin"), ..Default::default() };
/// let angry = Schemata::standard().emotion("ANGRY", Intensity::MAX, &circumstances)?;
/// let mut components = angry.components().clone();
/// components.duration = Duration::Lifetime;
/// let refusal = Emotion::new(components).unwrap_err();
/// assert!(refusal.to_string().starts_with("ANGRY lasts minutes"));
/// # Ok::<(), affect::SchemaError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Components", into = "Components")]
pub struct Emotion {
    components: Components,
}

impl Emotion {
    /// Checks the components against each other.
    pub fn new(components: Components) -> Result<Self, Refusal> {
        let name = || components.name.clone();
        if components.name.is_empty() {
            return Err(Refusal::EmotionName);
        }
        if components.duration != Duration::Minutes {
            return Err(Refusal::EmotionDuration { name: name() });
        }
        if components.focality == Focality::Global {
            return Err(Refusal::EmotionFocality { name: name() });
        }
        if matches!(&components.agency, Agency::Other(agent) if agent.is_empty()) {
            return Err(Refusal::AgentUnnamed { name: name() });
        }
        let (face, valence) = (components.facial_expression, components.valence);
        if face.valence().is_some_and(|shown| shown != valence) {
            return Err(Refusal::FaceContradictsValence {
                name: name(),
                valence,
                face,
            });
        }
        Ok(Self { components })
    }

    /// The components.
    pub fn components(&self) -> &Components {
        &self.components
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.components.name
    }

    /// Its coarse part.
    pub fn affect(&self) -> Affect {
        Affect {
            valence: self.components.valence,
            intensity: self.components.intensity,
        }
    }
}

impl TryFrom<Components> for Emotion {
    type Error = Refusal;

    fn try_from(components: Components) -> Result<Self, Refusal> {
        Self::new(components)
    }
}

impl From<Emotion> for Components {
    fn from(emotion: Emotion) -> Self {
        emotion.components
    }
}

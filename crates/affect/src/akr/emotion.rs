//! Emotion: the most specific affective state, described by a set of components.

use super::appraisal::{Agency, Certainty, Compatibility, Degree, FacialExpression, Novelty};
use super::refusal::Refusal;
use super::tendency::ActionTendency;
use crate::affect::{Affect, Duration, Focality, Valence};
use crate::scalar::Intensity;
use serde::{Deserialize, Serialize};

/// The subject of a clause in a causal chain.
///
/// That causal chains mention beliefs, goals and whether goals are achieved is documented [D: S]. The division into
/// clauses is chosen here \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClauseKind {
    /// Something that happens or was done.
    Event,
    /// Something that the agent believes.
    Belief,
    /// Something that the agent wants or does not want.
    Goal,
    /// What the agent feels and is inclined to do as a consequence.
    Feeling,
}

/// Status of the goal that an emotion is about \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GoalStatus {
    /// The goal is being achieved.
    Achieved,
    /// The agent expects to achieve the goal.
    Expected,
    /// The goal may not be achieved.
    AtRisk,
    /// The goal cannot be achieved with the current strategy.
    Blocked,
    /// The goal has been given up.
    Lost,
}

/// What an emotion signals about the course of action, to the agent itself and to others who see it [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Signal {
    /// Continue with the current course of action.
    Continue,
    /// Pursue the goal in another way.
    ChangeCourse,
    /// Abandon the goal.
    Disengage,
}

impl GoalStatus {
    /// The signal that an emotion about a goal of this status sends.
    ///
    /// It is documented that an achieved goal signals to continue, and a lost goal to change course or to disengage
    /// [D: S]. The signals of blocked goals and of goals at risk are chosen here \[I\].
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
    /// The subject of the clause.
    pub kind: ClauseKind,
    /// The clause in words.
    pub text: String,
}

/// A causal chain: the agent's explanation of its emotion.
///
/// That the chain can be spoken is documented [D: S], and so is its form: short scripts of simple words, following
/// Wierzbicka. The published scripts were not readable; those of this crate are newly written \[I\].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Account {
    /// Status of the goal that the chain mentions.
    pub goal: GoalStatus,
    /// The clauses, in order.
    pub clauses: Vec<Clause>,
}

impl Account {
    /// The chain as one sentence, for speech output or a panel.
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

/// The components of an emotion, not yet validated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Components {
    /// Name of the emotion.
    pub name: String,
    /// Facial expression.
    pub facial_expression: FacialExpression,
    /// Pleasant or unpleasant.
    pub valence: Valence,
    /// Strength of the feeling.
    pub intensity: Intensity,
    /// How long it lasts; must be [`Duration::Minutes`].
    pub duration: Duration,
    /// The agent responsible for the eliciting event.
    pub agency: Agency,
    /// What the emotion is about; must not be [`Focality::Global`].
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
    /// How the agent explains the emotion.
    pub causal_chain: Account,
}

impl Components {
    fn check_attributes(&self) -> Result<(), Refusal> {
        if self.name.is_empty() {
            return Err(Refusal::EmotionName);
        }

        let name = self.name.clone();
        if self.duration != Duration::Minutes {
            return Err(Refusal::EmotionDuration { name });
        }
        if self.focality == Focality::Global {
            return Err(Refusal::EmotionFocality { name });
        }
        if matches!(&self.agency, Agency::Other(agent) if agent.is_empty()) {
            return Err(Refusal::AgentUnnamed { name });
        }

        Ok(())
    }

    fn check_face(&self) -> Result<(), Refusal> {
        let face = self.facial_expression;

        match face.valence() {
            Some(shown) if shown != self.valence => Err(Refusal::FaceContradictsValence {
                name: self.name.clone(),
                valence: self.valence,
                face,
            }),
            _ => Ok(()),
        }
    }
}

/// An emotion whose components are valid together [D: S].
///
/// ```
/// use affect::akr::{Duration, Emotion};
/// use affect::{Circumstances, Intensity, Schemata};
/// let circumstances = Circumstances { other: Some("Leguin"), ..Default::default() };
/// let angry = Schemata::standard().emotion("ANGRY", Intensity::MAX, &circumstances)?;
/// let mut components = angry.components().clone();
/// components.duration = Duration::Lifetime;
/// let refusal = Emotion::new(components).unwrap_err();
/// assert!(refusal.to_string().starts_with("ANGRY must last minutes"));
/// # Ok::<(), affect::SchemaError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Components", into = "Components")]
pub struct Emotion {
    components: Components,
}

impl Emotion {
    /// Validates the components against each other.
    ///
    /// # Errors
    ///
    /// Returns the first [`Refusal`] that applies.
    pub fn new(components: Components) -> Result<Self, Refusal> {
        components.check_attributes()?;
        components.check_face()?;

        Ok(Self { components })
    }

    /// The components.
    pub fn components(&self) -> &Components {
        &self.components
    }

    /// Name of the emotion.
    pub fn name(&self) -> &str {
        &self.components.name
    }

    /// Its valence and intensity.
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

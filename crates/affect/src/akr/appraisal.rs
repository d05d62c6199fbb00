//! Appraisal: how a robot judges what it perceives.

use serde::{Deserialize, Serialize};

/// The agent responsible for what elicited an emotion [D: S].
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Agency {
    /// The agent that feels the emotion.
    #[default]
    #[serde(rename = "self")]
    Oneself,
    /// Another agent or a thing, identified by name.
    Other(String),
}

impl Agency {
    /// The name under which it is published: `self`, or the name of the other.
    pub fn name(&self) -> &str {
        match self {
            Self::Oneself => "self",
            Self::Other(name) => name,
        }
    }
}

/// A robot's judgment of its present situation.
///
/// That emotions have these components is documented, and that valence follows from progress toward the goal [D: S]. No
/// values or formulas have been published; the scales are chosen here \[I\]. A robot computes each value from what it
/// perceives, so two episodes of the same emotion can differ in all of them. The last four are known only of robots that
/// compute them. Numbers out of range are clamped, and NaN becomes 0.
///
/// ```
/// use affect::akr::Appraisal;
/// let appraisal = Appraisal::new(-3.0, 0.5, f64::NAN).with_novelty(0.25);
/// assert_eq!(appraisal.goal_congruence(), -1.0);
/// assert_eq!(appraisal.certainty(), 0.0);
/// assert_eq!(appraisal.novelty(), Some(0.25));
/// assert_eq!(appraisal.modifiability(), None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Appraisal {
    goal_congruence: f64,
    controllability: f64,
    certainty: f64,
    novelty: Option<f64>,
    modifiability: Option<f64>,
    external_norms: Option<f64>,
    internal_standards: Option<f64>,
}

impl Default for Appraisal {
    /// The appraisal of a robot that has perceived nothing yet: nothing is in its way, and nothing is certain.
    fn default() -> Self {
        Self::new(1.0, 1.0, 0.0)
    }
}

impl Appraisal {
    /// Creates an appraisal of a goal congruence, a controllability and a certainty.
    pub fn new(goal_congruence: f64, controllability: f64, certainty: f64) -> Self {
        Self {
            goal_congruence: clamped(goal_congruence, -1.0),
            controllability: clamped(controllability, 0.0),
            certainty: clamped(certainty, 0.0),
            novelty: None,
            modifiability: None,
            external_norms: None,
            internal_standards: None,
        }
    }

    /// Adds how new the situation is: [`novelty`](Self::novelty).
    #[must_use]
    pub fn with_novelty(mut self, novelty: f64) -> Self {
        self.novelty = Some(clamped(novelty, 0.0));
        self
    }

    /// Adds whether the situation can change without the robot: [`modifiability`](Self::modifiability).
    #[must_use]
    pub fn with_modifiability(mut self, modifiability: f64) -> Self {
        self.modifiability = Some(clamped(modifiability, 0.0));
        self
    }

    /// Adds how far the robot does what it owes others, and what it expects of itself:
    /// [`external_norms`](Self::external_norms), [`internal_standards`](Self::internal_standards).
    #[must_use]
    pub fn with_standards(mut self, external_norms: f64, internal_standards: f64) -> Self {
        self.external_norms = Some(clamped(external_norms, 0.0));
        self.internal_standards = Some(clamped(internal_standards, 0.0));
        self
    }

    /// How well the situation fits the goal: from -1 (it prevents the goal) to 1 (nothing is in the way).
    pub fn goal_congruence(&self) -> f64 {
        self.goal_congruence
    }

    /// How much the robot can do about the situation, from 0 (nothing) to 1 (all that it ever could).
    pub fn controllability(&self) -> f64 {
        self.controllability
    }

    /// How certain the robot is of the situation, from 0 (it knows nothing) to 1 (its knowledge is of this moment).
    pub fn certainty(&self) -> f64 {
        self.certainty
    }

    /// How far the situation is from what was predicted, from 0 (as predicted) to 1.
    pub fn novelty(&self) -> Option<f64> {
        self.novelty
    }

    /// Whether the situation can change without the robot: 1 if another agent acts on it as far as is known, 0.5 if that is
    /// not known, and 0 if none does.
    pub fn modifiability(&self) -> Option<f64> {
        self.modifiability
    }

    /// How far the robot does what it owes others, from 0 (not at all) to 1 (compatible with external norms).
    pub fn external_norms(&self) -> Option<f64> {
        self.external_norms
    }

    /// How far the robot does what it expects of itself, from 0 (not at all) to 1 (compatible with internal standards).
    pub fn internal_standards(&self) -> Option<f64> {
        self.internal_standards
    }
}

/// The value between `least` and 1; 0 for NaN.
fn clamped(value: f64, least: f64) -> f64 {
    if value.is_nan() {
        0.0
    } else {
        value.clamp(least, 1.0)
    }
}

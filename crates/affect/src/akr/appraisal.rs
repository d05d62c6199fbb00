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
/// That emotions have controllability, certainty and agency is documented, and that valence follows from progress
/// toward the goal [D: S]. No values or formulas have been published; the scales are chosen here \[I\]. A robot computes
/// each value from what it perceives, so two episodes of the same emotion can differ in all of them.
///
/// ```
/// use affect::akr::{Agency, Appraisal};
/// let appraisal = Appraisal::new(-3.0, 0.5, f64::NAN, Agency::Other("Leguin".to_owned()));
/// assert_eq!(appraisal.goal_congruence(), -1.0);
/// assert_eq!(appraisal.certainty(), 0.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Appraisal {
    goal_congruence: f64,
    controllability: f64,
    certainty: f64,
    agency: Agency,
}

impl Default for Appraisal {
    /// The appraisal of a robot that has perceived nothing yet: nothing is in its way, and nothing is certain.
    fn default() -> Self {
        Self::new(1.0, 1.0, 0.0, Agency::Oneself)
    }
}

impl Appraisal {
    /// Creates an appraisal. Numbers out of range are clamped, and NaN becomes 0.
    pub fn new(goal_congruence: f64, controllability: f64, certainty: f64, agency: Agency) -> Self {
        Self {
            goal_congruence: clamped(goal_congruence, -1.0),
            controllability: clamped(controllability, 0.0),
            certainty: clamped(certainty, 0.0),
            agency,
        }
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

    /// The agent responsible for the situation.
    pub fn agency(&self) -> &Agency {
        &self.agency
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

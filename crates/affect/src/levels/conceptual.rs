//! The deliberative level: choose by the emotion that an action is expected to lead to.
//!
//! That this level reasons over past and present emotions and projects what an action may lead to is
//! documented [D: S, Table 3]. So is, in the decision-theoretic companion work, what an emotion does to the
//! decision itself [D: D1, D2]: a pressed agent drops outcomes of negligible probability and inferior actions,
//! becomes short-sighted, and has the action tendency of its emotion ready. How much of each is chosen
//! here \[I\]. Nothing is random: equal values go to the candidate that comes first.

use crate::akr::{ActionTendency, Affect, Personality, Valence};
use crate::label::{EmotionLabel, Feeling};
use crate::parameters::{ParameterError, not_negative, positive};
use serde::{Deserialize, Serialize};

/// Constants of a [`Conceptual`] level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConceptualParameters {
    /// Probability below which an agent under full pressure drops an outcome. Default 0.2 \[I\].
    pub negligible: f64,
    /// How far, in seconds, a calm agent looks ahead. Default 60 \[I\].
    pub horizon_s: f64,
    /// How far, in seconds, an agent under full pressure looks ahead. Default 10 \[I\].
    pub pressed_horizon_s: f64,
    /// How many actions an agent under full pressure weighs; a calm one weighs all. 0 counts as 1.
    /// Default 2 \[I\].
    pub pressed_actions: u32,
    /// What the action tendency of a fully felt emotion adds to the value of an action that follows it.
    /// Default 0.2 \[I\].
    pub readiness: f64,
    /// How many experiences an anticipation is worth. Default 3 \[I\].
    pub anticipation_n: f64,
}

impl Default for ConceptualParameters {
    fn default() -> Self {
        Self {
            negligible: 0.2,
            horizon_s: 60.0,
            pressed_horizon_s: 10.0,
            pressed_actions: 2,
            readiness: 0.2,
            anticipation_n: 3.0,
        }
    }
}

/// What an action may lead to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// How probable it is, in `[0, 1]`.
    pub probability: f64,
    /// In how many seconds it comes.
    pub after_s: f64,
    /// What the agent would feel then.
    pub anticipated: Affect,
}

/// Why a candidate is none.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CandidateError {
    /// A probability outside `[0, 1]`.
    #[error("a probability lies in [0, 1], not {0}")]
    Probability(f64),
    /// Outcomes that exclude each other cannot be more probable together than 1.
    #[error("the outcomes of an action are more probable than 1 together: {0}")]
    Sum(f64),
    /// An outcome in the past or at no time.
    #[error("an outcome comes after 0 or more seconds, not {0}")]
    Time(f64),
}

/// An action that could be taken, with its possible outcomes, which exclude each other. What is missing to
/// probability 1 changes nothing for the agent.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate<A> {
    action: A,
    tendency: Option<ActionTendency>,
    outcomes: Vec<Outcome>,
}

impl<A> Candidate<A> {
    /// Sums of probabilities such as 0.1 exceed what they mean by less than this.
    const SLACK: f64 = 1e-9;

    /// Checks the outcomes. `tendency` is the action tendency that the action follows, if it follows one.
    pub fn new(
        action: A,
        tendency: Option<ActionTendency>,
        outcomes: Vec<Outcome>,
    ) -> Result<Self, CandidateError> {
        for outcome in &outcomes {
            if !(0.0..=1.0).contains(&outcome.probability) {
                return Err(CandidateError::Probability(outcome.probability));
            }
            if outcome.after_s.is_nan() || outcome.after_s < 0.0 {
                return Err(CandidateError::Time(outcome.after_s));
            }
        }
        let sum: f64 = outcomes.iter().map(|outcome| outcome.probability).sum();
        if sum > 1.0 + Self::SLACK {
            return Err(CandidateError::Sum(sum));
        }
        Ok(Self {
            action,
            tendency,
            outcomes,
        })
    }

    /// The action.
    pub fn action(&self) -> &A {
        &self.action
    }
}

/// What followed an action that was taken under an emotion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experience<E, A> {
    /// What was felt when it was taken.
    pub emotion: E,
    /// The action.
    pub action: A,
    /// Mean of what was felt afterwards, intensity with the sign of the valence, in `[-1, 1]`.
    pub mean: f64,
    /// How often it was experienced.
    pub times: u32,
}

/// Past emotions, as experience with actions. It grows with the number of distinct pairs and not with time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Memory<E, A> {
    experiences: Vec<Experience<E, A>>,
}

impl<E, A> Default for Memory<E, A> {
    fn default() -> Self {
        Self {
            experiences: Vec::new(),
        }
    }
}

impl<E: EmotionLabel, A: Clone + PartialEq> Memory<E, A> {
    /// `action`, taken when `emotion` was felt, led to `felt`.
    pub fn remember(&mut self, emotion: E, action: &A, felt: Affect) {
        let same = |one: &&mut Experience<E, A>| one.emotion == emotion && one.action == *action;
        if let Some(experience) = self.experiences.iter_mut().find(same) {
            experience.times = experience.times.saturating_add(1);
            experience.mean += (felt.signed() - experience.mean) / f64::from(experience.times);
        } else {
            let action = action.clone();
            self.experiences.push(Experience {
                emotion,
                action,
                mean: felt.signed(),
                times: 1,
            });
        }
    }

    /// What is remembered of an action under an emotion.
    pub fn recall(&self, emotion: E, action: &A) -> Option<&Experience<E, A>> {
        self.experiences
            .iter()
            .find(|one| one.emotion == emotion && one.action == *action)
    }
}

/// What deliberation arrived at.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice<A> {
    /// The best action.
    pub action: A,
    /// Its value, about in `[-1, 1]`.
    pub value: f64,
    /// Every action that was weighed, with its value, in the order of the candidates.
    pub weighed: Vec<(A, f64)>,
    /// Actions that a first glance found inferior, and that were not weighed.
    pub dropped: Vec<A>,
}

/// The level that reasons.
#[derive(Debug, Clone, PartialEq)]
pub struct Conceptual {
    parameters: ConceptualParameters,
    counts_positive: bool,
    counts_negative: bool,
}

impl Conceptual {
    /// A level for an agent of this personality: affect of which it has no preference has no value to it.
    pub fn new(
        parameters: ConceptualParameters,
        personality: &Personality,
    ) -> Result<Self, ParameterError> {
        not_negative("negligible", parameters.negligible)?;
        not_negative("horizon_s", parameters.horizon_s)?;
        not_negative("pressed_horizon_s", parameters.pressed_horizon_s)?;
        not_negative("readiness", parameters.readiness)?;
        positive("anticipation_n", parameters.anticipation_n)?;
        Ok(Self {
            parameters,
            counts_positive: personality.cares_about(Valence::Positive),
            counts_negative: personality.cares_about(Valence::Negative),
        })
    }

    /// The best of the candidates for an agent that feels this, or none if there is no candidate.
    ///
    /// Under pressure only the actions that a first glance finds best are weighed: by experience and by the
    /// action tendency, without projecting where they lead.
    pub fn deliberate<E: EmotionLabel, A: Clone + PartialEq>(
        &self,
        feeling: Feeling<E>,
        tendency: Option<ActionTendency>,
        candidates: &[Candidate<A>],
        memory: &Memory<E, A>,
    ) -> Option<Choice<A>> {
        let pressure = pressure(feeling.affect());
        let readiness = |candidate: &Candidate<A>| {
            let follows = tendency.is_some() && candidate.tendency == tendency;
            if follows {
                self.parameters.readiness * feeling.intensity.value()
            } else {
                0.0
            }
        };
        let glance = |candidate: &Candidate<A>| {
            let experience = memory.recall(feeling.emotion, &candidate.action);
            self.temper(0.0, experience) + readiness(candidate)
        };
        let glances: Vec<f64> = candidates.iter().map(glance).collect();
        let kept = best_indices(&glances, self.weighable(candidates.len(), pressure));
        let (mut weighed, mut dropped) = (Vec::new(), Vec::new());
        for (index, candidate) in candidates.iter().enumerate() {
            let action = candidate.action.clone();
            if kept.contains(&index) {
                let experience = memory.recall(feeling.emotion, &action);
                let value = self.temper(self.prospect(candidate, pressure), experience);
                weighed.push((action, value + readiness(candidate)));
            } else {
                dropped.push(action);
            }
        }
        let (action, value) = first_best(&weighed)?;
        Some(Choice {
            action,
            value,
            weighed,
            dropped,
        })
    }

    /// How many of `count` actions an agent under this pressure weighs: all, down to `pressed_actions`.
    fn weighable(&self, count: usize, pressure: f64) -> usize {
        let least = (self.parameters.pressed_actions.max(1) as usize).min(count);
        let spared = ((count - least) as f64 * pressure).floor();
        // At most `count`, so nothing is cut off.
        count - spared as usize
    }

    /// What a candidate promises to an agent under pressure.
    ///
    /// An outcome that is dropped as negligible leaves its probability to the others; one beyond the horizon
    /// is not foreseen, and counts as no change.
    fn prospect<A>(&self, candidate: &Candidate<A>, pressure: f64) -> f64 {
        let ConceptualParameters {
            negligible,
            horizon_s,
            pressed_horizon_s,
            ..
        } = self.parameters;
        let least = negligible * pressure;
        let horizon_s = horizon_s + (pressed_horizon_s - horizon_s) * pressure;
        let (mut all, mut kept, mut sum) = (0.0, 0.0, 0.0);
        for outcome in &candidate.outcomes {
            all += outcome.probability;
            if outcome.probability < least {
                continue;
            }
            kept += outcome.probability;
            if outcome.after_s <= horizon_s {
                sum += outcome.probability * self.worth(outcome.anticipated);
            }
        }
        if kept > 0.0 { sum * all / kept } else { 0.0 }
    }

    fn worth(&self, anticipated: Affect) -> f64 {
        let counts = match anticipated.valence {
            Valence::Positive => self.counts_positive,
            Valence::Negative => self.counts_negative,
        };
        if counts { anticipated.signed() } else { 0.0 }
    }

    /// Anticipation, corrected by what was experienced.
    fn temper<E, A>(&self, anticipated: f64, experience: Option<&Experience<E, A>>) -> f64 {
        let Some(experience) = experience else {
            return anticipated;
        };
        let (times, prior_n) = (f64::from(experience.times), self.parameters.anticipation_n);
        (times * experience.mean + prior_n * anticipated) / (times + prior_n)
    }
}

/// How much an affect presses an agent: its intensity if it is negative, else not at all \[I\].
fn pressure(affect: Affect) -> f64 {
    (-affect.signed()).max(0.0)
}

/// Indices of the `count` greatest values; of equal ones, those that come first.
fn best_indices(values: &[f64], count: usize) -> Vec<usize> {
    let mut indices: Vec<usize> = (0..values.len()).collect();
    indices.sort_by(|&one, &other| values[other].total_cmp(&values[one]));
    indices.truncate(count);
    indices
}

fn first_best<A: Clone>(weighed: &[(A, f64)]) -> Option<(A, f64)> {
    let mut best: Option<&(A, f64)> = None;
    for one in weighed {
        if best.is_none_or(|best| one.1 > best.1) {
            best = Some(one);
        }
    }
    best.cloned()
}

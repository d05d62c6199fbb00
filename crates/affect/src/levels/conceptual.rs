//! The deliberative level, which chooses actions by the emotions that they are expected to lead to.
//!
//! It is documented that this level reasons about past and present emotions and projects the outcomes of actions
//! [D: S, Table 3]. The decision-theoretic companion papers document how an emotion affects the decision itself
//! [D: D1, D2]: an agent under pressure ignores outcomes of negligible probability and inferior actions, becomes
//! short-sighted, and favors the action tendency of its emotion. The extent of each effect is chosen here \[I\].
//! Decisions are deterministic: of candidates with equal values, the first one is chosen.

use crate::akr::{ActionTendency, Affect, Personality, Valence};
use crate::label::{EmotionLabel, Feeling};
use crate::parameters::{ParameterError, not_negative, positive};
use serde::{Deserialize, Serialize};

/// Constants of a [`Conceptual`] level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConceptualParameters {
    /// Probability below which an agent under full pressure ignores an outcome. Default 0.2 \[I\].
    pub negligible: f64,
    /// Planning horizon of a calm agent, in seconds. Default 60 \[I\].
    pub horizon_s: f64,
    /// Planning horizon of an agent under full pressure, in seconds. Default 10 \[I\].
    pub pressed_horizon_s: f64,
    /// Number of actions that an agent under full pressure evaluates; a calm agent evaluates all. 0 is treated as 1.
    /// Default 2 \[I\].
    pub pressed_actions: u32,
    /// Bonus at full intensity for an action that follows the action tendency of the emotion. Default 0.2 \[I\].
    pub readiness: f64,
    /// Weight of the anticipation, as a number of experiences. Default 3 \[I\].
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

/// A possible outcome of an action.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActionOutcome {
    /// Its probability, in `[0, 1]`.
    pub probability: f64,
    /// Time until the outcome, in seconds.
    pub after_s: f64,
    /// The affect that the agent expects to feel then.
    pub anticipated: Affect,
}

/// Why the outcomes of a candidate are invalid.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CandidateError {
    /// A probability outside `[0, 1]`.
    #[error("a probability must be in [0, 1], not {0}")]
    Probability(f64),
    /// The probabilities of mutually exclusive outcomes add up to more than 1.
    #[error(
        "the probabilities of an action's outcomes must not add up to more than 1, but are {0}"
    )]
    Sum(f64),
    /// The time of an outcome is negative or NaN.
    #[error("the time until an outcome must be 0 s or more, not {0}")]
    Time(f64),
}

/// An action that can be chosen, with its mutually exclusive outcomes.
///
/// If the probabilities add up to less than 1, the action has no effect with the remaining probability.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate<A> {
    action: A,
    tendency: Option<ActionTendency>,
    outcomes: Vec<ActionOutcome>,
}

impl<A> Candidate<A> {
    /// Allowance for rounding errors in sums of probabilities such as 0.1.
    const SLACK: f64 = 1e-9;

    /// Creates a candidate. `tendency` is the action tendency that the action follows, if any.
    ///
    /// # Errors
    ///
    /// Returns a [`CandidateError`] if a probability or a time is invalid.
    pub fn new(
        action: A,
        tendency: Option<ActionTendency>,
        outcomes: Vec<ActionOutcome>,
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

/// What an agent felt after an action that it took under an emotion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experience<E, A> {
    /// The emotion when the action was taken.
    pub emotion: E,
    /// The action.
    pub action: A,
    /// Mean of the affect afterwards, as intensity with the sign of the valence, in `[-1, 1]`.
    pub mean: f64,
    /// Number of experiences.
    pub times: u32,
}

impl<E: EmotionLabel, A: PartialEq> Experience<E, A> {
    fn is_of(&self, emotion: E, action: &A) -> bool {
        self.emotion == emotion && self.action == *action
    }

    fn add(&mut self, felt: Affect) {
        self.times = self.times.saturating_add(1);
        self.mean += (felt.signed() - self.mean) / f64::from(self.times);
    }
}

/// Memory of past emotions, as experience with actions.
///
/// Its size is bounded by the number of distinct pairs of emotion and action.
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
    /// Records that `action`, taken under `emotion`, led to the affect `felt`.
    pub fn remember(&mut self, emotion: E, action: &A, felt: Affect) {
        let known = self
            .experiences
            .iter_mut()
            .find(|experience| experience.is_of(emotion, action));

        match known {
            Some(experience) => experience.add(felt),
            None => self.experiences.push(Experience {
                emotion,
                action: action.clone(),
                mean: felt.signed(),
                times: 1,
            }),
        }
    }

    /// The experience with an action under an emotion, if any.
    pub fn recall(&self, emotion: E, action: &A) -> Option<&Experience<E, A>> {
        self.experiences
            .iter()
            .find(|experience| experience.is_of(emotion, action))
    }
}

/// The result of deliberation.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice<A> {
    /// The best action.
    pub action: A,
    /// Its value, approximately in `[-1, 1]`.
    pub value: f64,
    /// The actions that were evaluated, with their values, in the order of the candidates.
    pub weighed: Vec<(A, f64)>,
    /// The actions that were dismissed without evaluation because they looked inferior.
    pub dropped: Vec<A>,
}

/// The deliberative level.
#[derive(Debug, Clone, PartialEq)]
pub struct Conceptual {
    parameters: ConceptualParameters,
    counts_positive: bool,
    counts_negative: bool,
}

impl Conceptual {
    /// Creates a level for an agent of this personality.
    ///
    /// Affect about which the agent has no preference has no value for it.
    ///
    /// # Errors
    ///
    /// Returns an error if a parameter is invalid.
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

    /// Chooses the best candidate for an agent with this feeling. Returns `None` if there are no candidates.
    ///
    /// Under pressure, only the most promising candidates are evaluated. They are selected by experience and action
    /// tendency, without projecting their outcomes.
    pub fn deliberate<E: EmotionLabel, A: Clone + PartialEq>(
        &self,
        feeling: Feeling<E>,
        tendency: Option<ActionTendency>,
        candidates: &[Candidate<A>],
        memory: &Memory<E, A>,
    ) -> Option<Choice<A>> {
        let condition = DeliberationContext {
            feeling,
            tendency,
            pressure: pressure(feeling.affect()),
        };

        let mut glances = Vec::with_capacity(candidates.len());
        for candidate in candidates {
            // The first assessment does not project outcomes.
            glances.push(self.value(candidate, 0.0, &condition, memory));
        }
        let count = self.weighable(candidates.len(), condition.pressure);
        let kept = best_indices(&glances, count);

        let mut weighed = Vec::new();
        let mut dropped = Vec::new();
        for (index, candidate) in candidates.iter().enumerate() {
            let action = candidate.action.clone();
            if kept.contains(&index) {
                let prospect = self.prospect(candidate, condition.pressure);
                weighed.push((action, self.value(candidate, prospect, &condition, memory)));
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

    /// Number of actions, out of `count`, that an agent under this pressure evaluates.
    ///
    /// It decreases from `count` for a calm agent to `pressed_actions` under full pressure.
    fn weighable(&self, count: usize, pressure: f64) -> usize {
        let least = (self.parameters.pressed_actions.max(1) as usize).min(count);
        let dismissed = ((count - least) as f64 * pressure).floor();

        // The cast is exact: the number is whole and at most `count`.
        count - dismissed as usize
    }

    /// The value of a candidate from which the agent anticipates `anticipated`.
    fn value<E: EmotionLabel, A: Clone + PartialEq>(
        &self,
        candidate: &Candidate<A>,
        anticipated: f64,
        condition: &DeliberationContext<E>,
        memory: &Memory<E, A>,
    ) -> f64 {
        let experience = memory.recall(condition.feeling.emotion, &candidate.action);
        let follows = condition.tendency.is_some() && candidate.tendency == condition.tendency;
        let readiness = if follows {
            self.parameters.readiness * condition.feeling.intensity().value()
        } else {
            0.0
        };

        self.temper(anticipated, experience) + readiness
    }

    /// The expected affect after an action, for an agent under this pressure.
    ///
    /// The probability of outcomes that are ignored as negligible is distributed over the others. An outcome beyond
    /// the horizon is not foreseen and contributes nothing.
    fn prospect<A>(&self, candidate: &Candidate<A>, pressure: f64) -> f64 {
        let least = self.parameters.negligible * pressure;
        let horizon_s = self.horizon_s(pressure);

        let mut all = 0.0;
        let mut kept = 0.0;
        let mut sum = 0.0;
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

    fn horizon_s(&self, pressure: f64) -> f64 {
        let calm_s = self.parameters.horizon_s;
        let pressed_s = self.parameters.pressed_horizon_s;

        calm_s + (pressed_s - calm_s) * pressure
    }

    fn worth(&self, anticipated: Affect) -> f64 {
        let counts = match anticipated.valence {
            Valence::Positive => self.counts_positive,
            Valence::Negative => self.counts_negative,
        };
        if counts { anticipated.signed() } else { 0.0 }
    }

    /// The anticipation, corrected by experience.
    fn temper<E, A>(&self, anticipated: f64, experience: Option<&Experience<E, A>>) -> f64 {
        let Some(experience) = experience else {
            return anticipated;
        };

        let times = f64::from(experience.times);
        let prior_n = self.parameters.anticipation_n;
        (times * experience.mean + prior_n * anticipated) / (times + prior_n)
    }
}

/// The condition in which an agent deliberates.
struct DeliberationContext<E> {
    feeling: Feeling<E>,
    /// The action tendency of the emotion, if it has one.
    tendency: Option<ActionTendency>,
    /// From 0 (calm) to 1 (full pressure).
    pressure: f64,
}

/// How much pressure an affect puts on an agent: its intensity if it is negative, and otherwise 0 \[I\].
fn pressure(affect: Affect) -> f64 {
    (-affect.signed()).max(0.0)
}

/// Indices of the `count` greatest values. Of equal values, the first ones are taken.
fn best_indices(values: &[f64], count: usize) -> Vec<usize> {
    let mut indices: Vec<usize> = (0..values.len()).collect();
    indices.sort_by(|&one, &other| values[other].total_cmp(&values[one]));
    indices.truncate(count);
    indices
}

/// The action with the greatest value. Of equal values, the first one is taken.
fn first_best<A: Clone>(weighed: &[(A, f64)]) -> Option<(A, f64)> {
    let mut best: Option<&(A, f64)> = None;

    for candidate in weighed {
        if best.is_none_or(|best| candidate.1 > best.1) {
            best = Some(candidate);
        }
    }

    best.cloned()
}

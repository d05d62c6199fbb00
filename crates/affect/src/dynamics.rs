//! How an emotion changes with time: the intensity filter and the state machine over a [`Ladder`].
//!
//! Documented is the shape of the rule [D: S]: positive progress keeps a
//! robot HAPPY, negative progress worries it increasingly until it is FRUSTRATED, and from there a positive
//! input leads back as far as it is important. The numbers are parameters \[I\].
//!
//! [`Dynamics`] is the rule and never changes; [`EmotionState`] is all that does. Saving that one value and
//! restoring it continues identically.

use crate::label::{EmotionLabel, Feeling, StandardEmotion};
use crate::ladder::{Ladder, Place};
use crate::parameters::{DynamicsParameters, ParameterError};
use crate::scalar::{Caution, Intensity, has_elapsed};
use serde::{Deserialize, Serialize};

/// What presses on the robot during one step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Drive {
    /// A need ratio (dimensionless, 0 or more): how much later help comes than it is needed.
    Need(f64),
    /// Nothing presses, so intensity falls.
    Rest,
    /// No measure is to be had, so intensity stays. A need that is not a number counts as this.
    Hold,
}

/// Something that happens to a goal at one moment. The two classes are documented [D: S], as is that a
/// positive input counts by its importance; how much intensity each moves is chosen here \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProgressEvent {
    /// A step toward the goal: takes its importance from the intensity.
    Positive(Intensity),
    /// A setback: adds its importance times the gain to the intensity.
    Negative(Intensity),
    /// The goal is reached, the most important positive input: back to the start at once, intensity 0.
    GoalAchieved,
}

/// What the robot believes about its own ability [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Belief {
    /// It has not thought about it.
    #[default]
    Unstated,
    /// "I can do this."
    Can,
    /// "I cannot do this."
    Cannot,
}

/// Whether what presses now is better or worse than what is already felt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trend {
    /// Positive progress: intensity falls.
    Positive,
    /// Negative progress: intensity rises.
    Negative,
    /// Neither.
    Level,
}

/// Everything that acts on the emotion during one step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Stimulus {
    /// The continuous input.
    pub drive: Drive,
    /// What happened in this step.
    pub event: Option<ProgressEvent>,
    /// A belief formed in this step; the previous one stays if there is none.
    pub belief: Option<Belief>,
    /// Whether somebody else is to blame for the need (agency: other).
    pub blames_other: bool,
}

impl Stimulus {
    /// Only a continuous input.
    pub fn new(drive: Drive) -> Self {
        Self {
            drive,
            event: None,
            belief: None,
            blames_other: false,
        }
    }

    /// A need ratio (dimensionless).
    pub fn need(ratio: f64) -> Self {
        Self::new(Drive::Need(ratio))
    }

    /// Nothing presses.
    pub fn rest() -> Self {
        Self::new(Drive::Rest)
    }

    /// The same, with something that happened.
    #[must_use]
    pub fn with_event(self, event: Option<ProgressEvent>) -> Self {
        Self { event, ..self }
    }

    /// The same, with a belief.
    #[must_use]
    pub fn with_belief(self, belief: Belief) -> Self {
        Self {
            belief: Some(belief),
            ..self
        }
    }

    /// The same, saying whether somebody else is to blame.
    #[must_use]
    pub fn with_blame(self, blames_other: bool) -> Self {
        Self {
            blames_other,
            ..self
        }
    }
}

/// All that the dynamics remember from one step to the next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmotionState<E> {
    emotion: E,
    intensity: Intensity,
    /// Time since the emotion last changed, or since the start, in seconds.
    unchanged_s: f64,
    /// Time for which the condition of the next rung has held, in seconds.
    pressing_s: f64,
    belief: Belief,
}

impl<E: EmotionLabel> EmotionState<E> {
    /// What is felt.
    pub fn feeling(&self) -> Feeling<E> {
        Feeling {
            emotion: self.emotion,
            intensity: self.intensity,
        }
    }

    /// For how long, in seconds, this emotion has been felt.
    pub fn unchanged_s(&self) -> f64 {
        self.unchanged_s
    }

    /// What the robot believes about its ability.
    pub fn belief(&self) -> Belief {
        self.belief
    }

    fn change_to(&mut self, emotion: E) {
        if emotion != self.emotion {
            self.emotion = emotion;
            self.unchanged_s = 0.0;
            self.pressing_s = 0.0;
        }
    }

    fn has_lasted(&self, seconds: f64) -> bool {
        has_elapsed(self.unchanged_s, seconds)
    }
}

/// The rule by which an emotion changes, for one robot's parameters and caution.
#[derive(Debug, Clone, PartialEq)]
pub struct Dynamics<E> {
    ladder: Ladder<E>,
    parameters: DynamicsParameters,
    gain: f64,
}

impl Dynamics<StandardEmotion> {
    /// The dynamics of the documented robots.
    pub fn standard(
        parameters: &DynamicsParameters,
        caution: Caution,
    ) -> Result<Self, ParameterError> {
        Self::new(Ladder::standard(parameters)?, parameters, caution)
    }
}

impl<E: EmotionLabel> Dynamics<E> {
    /// Dynamics over a ladder of one's own. Of the parameters, the `th_` thresholds and `anger_s` are
    /// not used: the ladder brings its own.
    pub fn new(
        ladder: Ladder<E>,
        parameters: &DynamicsParameters,
        caution: Caution,
    ) -> Result<Self, ParameterError> {
        parameters.check()?;
        Ok(Self {
            ladder,
            gain: parameters.gain(caution),
            parameters: parameters.clone(),
        })
    }

    /// The emotions and their thresholds.
    pub fn ladder(&self) -> &Ladder<E> {
        &self.ladder
    }

    /// The constants.
    pub fn parameters(&self) -> &DynamicsParameters {
        &self.parameters
    }

    /// How strongly this robot reacts, g(caution).
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// The state at the beginning: the lowest emotion, intensity 0, no belief.
    pub fn start(&self) -> EmotionState<E> {
        EmotionState {
            emotion: self.ladder.start(),
            intensity: Intensity::MIN,
            unchanged_s: 0.0,
            pressing_s: 0.0,
            belief: Belief::Unstated,
        }
    }

    /// Whether `state` belongs to these dynamics, for instance after it was read from a file: its emotion is
    /// one of the ladder's, and its times are times. [`Dynamics::step`] takes any state, and moves one
    /// that does not belong to the rung its intensity names.
    pub fn accepts(&self, state: &EmotionState<E>) -> bool {
        let is_time = |seconds: f64| seconds >= 0.0 && seconds.is_finite();
        self.ladder.place(state.emotion) != Place::Elsewhere
            && is_time(state.unchanged_s)
            && is_time(state.pressing_s)
    }

    /// The intensity toward which `drive` pulls: `min(1, g * need / rho_max)`; none when it holds.
    pub fn target(&self, drive: Drive) -> Option<Intensity> {
        match drive {
            Drive::Need(ratio) if ratio.is_nan() => None,
            Drive::Need(ratio) => Some(Intensity::saturating(
                self.gain * ratio / self.parameters.rho_max,
            )),
            Drive::Rest => Some(Intensity::MIN),
            Drive::Hold => None,
        }
    }

    /// Whether `drive` is positive or negative progress for a robot that feels as `state` says.
    pub fn trend(&self, state: &EmotionState<E>, drive: Drive) -> Trend {
        match self.target(drive) {
            Some(target) if target > state.intensity => Trend::Negative,
            Some(target) if target < state.intensity => Trend::Positive,
            _ => Trend::Level,
        }
    }

    /// One step of `dt_s` seconds: the belief, then the intensity, then at most one change of emotion.
    pub fn step(&self, state: &mut EmotionState<E>, stimulus: &Stimulus, dt_s: f64) {
        state.belief = stimulus.belief.unwrap_or(state.belief);
        state.unchanged_s += dt_s;
        let place = self.ladder.place(state.emotion);
        if stimulus.event == Some(ProgressEvent::GoalAchieved) && place != Place::Discouraged {
            state.intensity = Intensity::MIN;
            state.pressing_s = 0.0;
            state.change_to(self.ladder.start());
            return;
        }
        self.feel(state, stimulus, dt_s);
        let next = match place {
            Place::Rung(index) => self.next_from_rung(index, state, stimulus, dt_s),
            Place::Discouraged => self.next_from_discouraged(state),
            Place::Hopeful => self.next_from_hopeful(state),
            Place::Elsewhere => self.rung_by_intensity(state, usize::MAX),
        };
        state.change_to(next);
    }

    /// First-order filter: rises with `tau_up_s / g`, falls with `tau_down_s`; events move it at once.
    fn feel(&self, state: &mut EmotionState<E>, stimulus: &Stimulus, dt_s: f64) {
        let mut intensity = state.intensity.value();
        if let Some(target) = self.target(stimulus.drive).map(Intensity::value) {
            let rises = target > intensity;
            let tau_s = if rises {
                self.parameters.tau_up_s / self.gain
            } else {
                self.parameters.tau_down_s
            };
            intensity += (target - intensity) * (1.0 - libm::exp(-dt_s / tau_s));
        }
        match stimulus.event {
            Some(ProgressEvent::Positive(importance)) => intensity -= importance.value(),
            Some(ProgressEvent::Negative(importance)) => {
                intensity += self.gain * importance.value()
            }
            Some(ProgressEvent::GoalAchieved) | None => {}
        }
        state.intensity = Intensity::saturating(intensity);
    }

    /// Up by one rung, or down by as many as intensity has fallen below; neither before the dwell time.
    fn next_from_rung(
        &self,
        index: usize,
        state: &mut EmotionState<E>,
        stimulus: &Stimulus,
        dt_s: f64,
    ) -> E {
        let may_climb = self.may_climb(index, state, stimulus, dt_s);
        if !state.has_lasted(self.parameters.dwell_s) {
            return state.emotion;
        }
        if let Some(beliefs) = self.ladder.beliefs() {
            let is_low_enough = self
                .ladder
                .discouraging_rung()
                .is_some_and(|from| index >= from);
            if state.belief == Belief::Cannot && is_low_enough {
                return beliefs.discouraged;
            }
        }
        let rungs = self.ladder.rungs();
        if may_climb {
            return rungs[index + 1].emotion;
        }
        let mut lower = index;
        while lower > 0 && state.intensity.value() < rungs[lower].enter - self.parameters.hysteresis
        {
            lower -= 1;
        }
        rungs[lower].emotion
    }

    /// Whether the next rung's condition holds, and has held as long as it asks. Keeps the time.
    fn may_climb(
        &self,
        index: usize,
        state: &mut EmotionState<E>,
        stimulus: &Stimulus,
        dt_s: f64,
    ) -> bool {
        let Some(next) = self.ladder.rungs().get(index + 1) else {
            return false;
        };
        let intensity = state.intensity.value();
        let is_blamed = stimulus.blames_other || !next.needs_blame;
        if next.hold_s == 0.0 {
            return is_blamed && intensity >= next.enter;
        }
        let is_pressing = is_blamed && intensity > next.enter;
        state.pressing_s = if is_pressing {
            state.pressing_s + dt_s
        } else {
            0.0
        };
        is_pressing && has_elapsed(state.pressing_s, next.hold_s)
    }

    /// Discouragement yields to one thing only, the belief that one can [D: S].
    fn next_from_discouraged(&self, state: &EmotionState<E>) -> E {
        match self.ladder.beliefs() {
            Some(beliefs) if state.belief == Belief::Can => beliefs.hopeful,
            _ => state.emotion,
        }
    }

    /// Hope ends with the belief or with time; the rung below the discouraging one is the worst it
    /// falls to \[I\].
    fn next_from_hopeful(&self, state: &EmotionState<E>) -> E {
        let Some(beliefs) = self.ladder.beliefs() else {
            return state.emotion;
        };
        if state.belief == Belief::Cannot && state.has_lasted(self.parameters.dwell_s) {
            return beliefs.discouraged;
        }
        if !state.has_lasted(self.parameters.hope_s.max(self.parameters.dwell_s)) {
            return state.emotion;
        }
        let limit = self
            .ladder
            .discouraging_rung()
            .map_or(0, |from| from.saturating_sub(1));
        self.rung_by_intensity(state, limit)
    }

    fn rung_by_intensity(&self, state: &EmotionState<E>, limit: usize) -> E {
        self.ladder.rungs()[self.ladder.rung_for(state.intensity.value(), limit)].emotion
    }
}

//! How an emotion changes over time: the filter of the urgency and the state machine over a [`Ladder`].
//!
//! The general behavior is documented [D: S]: positive progress keeps a robot HAPPY, negative progress worries it
//! more and more until it is FRUSTRATED, and only a positive input then leads back, by as much as the input is important.
//! The numbers are parameters \[I\].
//!
//! That only a positive input leads back is the *floor* of the urgency \[I\]. A rung that is left by positive inputs only
//! ([`Rung::needs_progress`](crate::Rung)) puts the floor where the rung would be left. A positive input of importance `i`
//! lowers it to `1 - i`, and the first pleasant emotion removes it.
//!
//! [`Dynamics`] holds the immutable rule, and [`EmotionState`] holds everything that changes. Saving and restoring
//! the state resumes the dynamics exactly.

use crate::affect::Valence;
use crate::label::{EmotionLabel, Feeling, StandardEmotion};
use crate::ladder::{Ladder, Place};
use crate::mood::MoodParameters;
use crate::parameters::{DynamicsParameters, ParameterError};
use crate::scalar::{Caution, Urgency, has_elapsed};
use serde::{Deserialize, Serialize};

/// The continuous input to the dynamics during one step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StepInput {
    /// The time until help arrives divided by the time until it is needed; dimensionless, 0 or more.
    Need(f64),
    /// The pressure itself, 0 to 1, as the robot measures it: the urgency moves toward it.
    Pressure(Urgency),
    /// No need: the urgency falls.
    Rest,
    /// No measure is available: the urgency stays the same. A need of NaN is treated the same way.
    Hold,
}

/// Something that brings the robot nearer to its goal, or farther from it.
///
/// The two classes are documented [D: S], and so is that the effect of a positive input depends on its importance.
/// How much each event changes the urgency is chosen here \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProgressEvent {
    /// A step toward the goal. The urgency falls to `1 - importance` at once if it is above that.
    Positive(Urgency),
    /// Progress that the drive measures. It counts only if the urgency is above its target: the urgency may then fall
    /// there, as fast as it otherwise does. So its importance is `1 - target`.
    Easing,
    /// A setback; its importance, multiplied by the gain, is added to the urgency.
    Negative(Urgency),
    /// The goal is achieved, the most important positive input: returns to the initial emotion with urgency 0.
    GoalAchieved,
}

/// What counted as progress in a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Progress {
    /// The importance with the sign of the class: above 0 for a positive input, below 0 for a negative one, -1 to 1.
    /// That of a drive whose target is above the urgency is the difference \[I\].
    pub signed: f64,
    /// Whether it was the event of the step, and not the drive.
    pub is_event: bool,
}

impl Progress {
    fn event(signed: f64) -> Self {
        Self {
            signed,
            is_event: true,
        }
    }
}

/// What the robot believes about its own ability [D: S].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Belief {
    /// The robot has not formed a belief.
    #[default]
    Unstated,
    /// The robot believes that it can achieve its goal.
    Can,
    /// The robot believes that it cannot achieve its goal.
    Cannot,
}

/// Everything that acts on the emotion during one step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Stimulus {
    /// The continuous input.
    pub drive: StepInput,
    /// The event that happened in this step, if any.
    pub event: Option<ProgressEvent>,
    /// The belief formed in this step. `None` keeps the previous one.
    pub belief: Option<Belief>,
    /// Whether another agent is to blame for the need (agency: other).
    pub blames_other: bool,
}

impl Stimulus {
    /// A stimulus with only a continuous input.
    pub fn new(drive: StepInput) -> Self {
        Self {
            drive,
            event: None,
            belief: None,
            blames_other: false,
        }
    }

    /// A stimulus with a need ratio (dimensionless).
    pub fn need(ratio: f64) -> Self {
        Self::new(StepInput::Need(ratio))
    }

    /// A stimulus without need.
    pub fn rest() -> Self {
        Self::new(StepInput::Rest)
    }

    /// Sets the event.
    #[must_use]
    pub fn with_event(self, event: Option<ProgressEvent>) -> Self {
        Self { event, ..self }
    }

    /// Sets the belief.
    #[must_use]
    pub fn with_belief(self, belief: Belief) -> Self {
        Self {
            belief: Some(belief),
            ..self
        }
    }

    /// Sets whether another agent is to blame.
    #[must_use]
    pub fn with_blame(self, blames_other: bool) -> Self {
        Self {
            blames_other,
            ..self
        }
    }
}

/// The state of the dynamics between steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmotionState<E> {
    emotion: E,
    urgency: Urgency,
    /// What the urgency does not fall below until there is a positive input.
    floor: Urgency,
    /// What counted as progress in the last step.
    progress: Option<Progress>,
    /// Time since the emotion last changed, or since the start, in seconds.
    unchanged_s: f64,
    /// Time for which the condition of the next rung has held without interruption, in seconds.
    pressing_s: f64,
    belief: Belief,
    /// The slow mean of what is felt, -1 to 1.
    mood: f64,
}

impl<E: EmotionLabel> EmotionState<E> {
    /// The current feeling.
    pub fn feeling(&self) -> Feeling<E> {
        Feeling {
            emotion: self.emotion,
            urgency: self.urgency,
        }
    }

    /// How long the current emotion has lasted, in seconds.
    pub fn unchanged_s(&self) -> f64 {
        self.unchanged_s
    }

    /// The robot's current belief about its ability.
    pub fn belief(&self) -> Belief {
        self.belief
    }

    /// The mood: intensity with the sign of its valence, -1 to 1.
    pub fn mood(&self) -> f64 {
        self.mood
    }

    /// The same state in another mood, which is limited to -1 to 1; NaN is no mood.
    #[must_use]
    pub fn with_mood(self, mood: f64) -> Self {
        let mood = if mood.is_nan() { 0.0 } else { mood };
        Self {
            mood: mood.clamp(-1.0, 1.0),
            ..self
        }
    }

    /// What counted as progress in the last step; `None` if nothing did.
    pub fn progress(&self) -> Option<Progress> {
        self.progress
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

/// The rule by which an emotion changes, for one robot with its parameters and caution.
#[derive(Debug, Clone, PartialEq)]
pub struct Dynamics<E> {
    ladder: Ladder<E>,
    parameters: DynamicsParameters,
    mood: MoodParameters,
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
    /// Creates dynamics over a custom ladder.
    ///
    /// The `th_` thresholds and `anger_s` of the parameters are ignored, because the ladder has its own.
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
            mood: MoodParameters::default(),
        })
    }

    /// The same dynamics with moods of these constants; without, a mood follows what is felt and acts on nothing.
    ///
    /// # Errors
    ///
    /// Returns the first [`ParameterError`] found.
    pub fn with_mood(self, mood: MoodParameters) -> Result<Self, ParameterError> {
        mood.check()?;
        Ok(Self { mood, ..self })
    }

    /// The emotions and their thresholds.
    pub fn ladder(&self) -> &Ladder<E> {
        &self.ladder
    }

    /// The constants.
    pub fn parameters(&self) -> &DynamicsParameters {
        &self.parameters
    }

    /// How strongly this robot reacts, `g(caution)`; dimensionless.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// The initial state: the lowest emotion, urgency 0, no belief, the mood of the parameters.
    pub fn start(&self) -> EmotionState<E> {
        EmotionState {
            emotion: self.ladder.start(),
            urgency: Urgency::MIN,
            floor: Urgency::MIN,
            progress: None,
            unchanged_s: 0.0,
            pressing_s: 0.0,
            belief: Belief::Unstated,
            mood: self.mood.start,
        }
    }

    /// The state of a robot that takes over a feeling of which nothing else is known; the initial one if no such emotion
    /// is on the ladder. An unpleasant emotion is left by a positive input only \[I\].
    pub fn taken_over(&self, feeling: Feeling<E>) -> EmotionState<E> {
        let place = self.ladder.place(feeling.emotion);
        if place == Place::Elsewhere {
            return self.start();
        }

        let floor = match place {
            Place::Rung(index) if feeling.emotion.valence() == Valence::Negative => {
                self.leave_below(index)
            }
            _ => 0.0,
        };
        EmotionState {
            emotion: feeling.emotion,
            urgency: feeling.urgency,
            floor: Urgency::saturating(floor),
            ..self.start()
        }
    }

    /// Whether `state` is valid for these dynamics: its emotion is on the ladder, its times are finite and not negative, and
    /// its mood is within -1 and 1.
    ///
    /// Use it to validate a state that was read from a file. [`Dynamics::step`] accepts any state, and moves an
    /// emotion that is not on the ladder to the rung for its urgency.
    pub fn accepts(&self, state: &EmotionState<E>) -> bool {
        let is_on_ladder = self.ladder.place(state.emotion) != Place::Elsewhere;

        let has_mood = (-1.0..=1.0).contains(&state.mood);
        is_on_ladder && has_mood && is_duration(state.unchanged_s) && is_duration(state.pressing_s)
    }

    /// The urgency that `drive` moves toward in a mood: `min(1, g * need / rho_max)`, shifted by the mood.
    ///
    /// `None` if the drive leaves the urgency unchanged.
    pub fn target(&self, drive: StepInput, mood: f64) -> Option<Urgency> {
        let pressure = match drive {
            StepInput::Need(ratio) if ratio.is_nan() => return None,
            StepInput::Need(ratio) => {
                Urgency::saturating(self.gain * ratio / self.parameters.rho_max)
            }
            StepInput::Pressure(pressure) => pressure,
            StepInput::Rest => Urgency::MIN,
            StepInput::Hold => return None,
        };

        Some(Urgency::saturating(
            pressure.value() + self.mood.shift(mood),
        ))
    }

    /// Advances the state by `dt_s` seconds: updates the belief, then the urgency, then the emotion at most once, then the mood.
    pub fn step(&self, state: &mut EmotionState<E>, stimulus: &Stimulus, dt_s: f64) {
        self.step_emotion(state, stimulus, dt_s);

        let felt = state.feeling().affect().signed();
        state.mood = self.mood.next(state.mood, felt, dt_s);
    }

    fn step_emotion(&self, state: &mut EmotionState<E>, stimulus: &Stimulus, dt_s: f64) {
        state.belief = stimulus.belief.unwrap_or(state.belief);
        state.unchanged_s += dt_s;

        let place = self.ladder.place(state.emotion);
        if stimulus.event == Some(ProgressEvent::GoalAchieved) && place != Place::Discouraged {
            *state = EmotionState {
                unchanged_s: state.unchanged_s,
                belief: state.belief,
                emotion: state.emotion,
                mood: state.mood,
                progress: Some(Progress::event(1.0)),
                ..self.start()
            };
            state.change_to(self.ladder.start());
            return;
        }

        self.update_urgency(state, stimulus, dt_s);

        let next = match place {
            Place::Rung(index) => self.next_from_rung(index, state, stimulus, dt_s),
            Place::Discouraged => self.next_from_discouraged(state),
            Place::Hopeful => self.next_from_hopeful(state),
            Place::Elsewhere => self.rung_by_urgency(state, usize::MAX),
        };
        self.update_floor(state, place, next);
        state.change_to(next);
    }

    /// Filters the drive into the urgency, then adds the effect of the event. The urgency does not fall below the floor.
    fn update_urgency(&self, state: &mut EmotionState<E>, stimulus: &Stimulus, dt_s: f64) {
        let before = state.urgency.value();
        let target = self.target(stimulus.drive, state.mood);
        let target = target.map(Urgency::value);
        let mut urgency = match target {
            Some(target) => self.filter(before, target, dt_s),
            None => before,
        };
        let mut floor = state.floor.value();
        let driven = target
            .filter(|target| *target > before)
            .map(|target| Progress {
                signed: before - target,
                is_event: false,
            });

        state.progress = match stimulus.event {
            Some(ProgressEvent::Positive(importance)) => {
                let limit = 1.0 - importance.value();
                urgency = urgency.min(limit);
                floor = floor.min(limit);
                Some(Progress::event(importance.value()))
            }
            Some(ProgressEvent::Negative(importance)) => {
                urgency += self.gain * importance.value();
                Some(Progress::event(-importance.value()))
            }
            Some(ProgressEvent::Easing) => match target {
                Some(target) if target < before => {
                    floor = floor.min(target);
                    Some(Progress::event(1.0 - target))
                }
                _ => driven,
            },
            Some(ProgressEvent::GoalAchieved) => Some(Progress::event(1.0)),
            None => driven,
        };

        state.floor = Urgency::saturating(floor);
        state.urgency = Urgency::saturating(urgency.max(before.min(floor)));
    }

    /// A rung that needs progress puts the floor where it would be left, if it is reached from below; the first pleasant
    /// emotion removes the floor.
    fn update_floor(&self, state: &mut EmotionState<E>, from: Place, next: E) {
        if next == state.emotion {
            return;
        }
        if next.valence() == Valence::Positive {
            state.floor = Urgency::MIN;
            return;
        }

        let Place::Rung(index) = self.ladder.place(next) else {
            return;
        };
        let comes_from_above = matches!(from, Place::Rung(before) if before > index);
        if self.ladder.rungs()[index].needs_progress && !comes_from_above {
            state.floor = Urgency::saturating(self.leave_below(index));
        }
    }

    /// The urgency below which a rung is left.
    fn leave_below(&self, index: usize) -> f64 {
        self.ladder.rungs()[index].enter - self.parameters.hysteresis
    }

    /// First-order filter with time constant `tau_up_s / g` when rising and `tau_down_s` when falling.
    fn filter(&self, urgency: f64, target: f64, dt_s: f64) -> f64 {
        let tau_s = if target > urgency {
            self.parameters.tau_up_s / self.gain
        } else {
            self.parameters.tau_down_s
        };
        let share = 1.0 - libm::exp(-dt_s / tau_s);

        urgency + (target - urgency) * share
    }

    /// Climbs by at most one rung, or falls by as many rungs as the urgency requires, but not before the dwell
    /// time is over.
    fn next_from_rung(
        &self,
        index: usize,
        state: &mut EmotionState<E>,
        stimulus: &Stimulus,
        dt_s: f64,
    ) -> E {
        // This also measures how long the next rung's condition has held, so it must run before the dwell time is over.
        let may_climb = self.may_climb(index, state, stimulus, dt_s);

        if !state.has_lasted(self.parameters.dwell_s) {
            return state.emotion;
        }

        if let Some(discouraged) = self.discouraged_from(index, state.belief) {
            return discouraged;
        }

        let reached = if may_climb {
            index + 1
        } else {
            self.fall_from(index, state.urgency.value())
        };
        self.ladder.rungs()[reached].emotion
    }

    /// The emotion that follows a rung because the robot believes that it cannot achieve its goal, if any.
    fn discouraged_from(&self, index: usize, belief: Belief) -> Option<E> {
        let beliefs = self.ladder.beliefs()?;
        let from = self.ladder.discouraging_rung()?;

        (belief == Belief::Cannot && index >= from).then_some(beliefs.discouraged)
    }

    /// The highest rung, not above `index`, that is not left at this urgency.
    fn fall_from(&self, index: usize, urgency: f64) -> usize {
        let mut lower = index;
        while lower > 0 && urgency < self.leave_below(lower) {
            lower -= 1;
        }

        lower
    }

    /// Whether the next rung's condition holds and has held for as long as required.
    ///
    /// Updates the time for which it has held.
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

        let urgency = state.urgency.value();
        let is_blamed = stimulus.blames_other || !next.needs_blame;
        if next.hold_s == 0.0 {
            return is_blamed && urgency >= next.enter;
        }

        let is_pressing = is_blamed && urgency > next.enter;
        state.pressing_s = if is_pressing {
            state.pressing_s + dt_s
        } else {
            0.0
        };

        is_pressing && has_elapsed(state.pressing_s, next.hold_s)
    }

    /// Discouragement only ends with the belief that the robot can achieve its goal [D: S].
    fn next_from_discouraged(&self, state: &EmotionState<E>) -> E {
        match self.ladder.beliefs() {
            Some(beliefs) if state.belief == Belief::Can => beliefs.hopeful,
            _ => state.emotion,
        }
    }

    /// Hope ends when the belief changes or after `hope_s`.
    ///
    /// After `hope_s`, the emotion follows from the urgency, up to the rung below the discouraging one \[I\].
    fn next_from_hopeful(&self, state: &EmotionState<E>) -> E {
        let Some(beliefs) = self.ladder.beliefs() else {
            return state.emotion;
        };

        let dwell_s = self.parameters.dwell_s;
        if state.belief == Belief::Cannot && state.has_lasted(dwell_s) {
            return beliefs.discouraged;
        }

        let hope_s = self.parameters.hope_s.max(dwell_s);
        if !state.has_lasted(hope_s) {
            return state.emotion;
        }

        let from = self.ladder.discouraging_rung().unwrap_or(0);
        let limit = from.saturating_sub(1);
        self.rung_by_urgency(state, limit)
    }

    fn rung_by_urgency(&self, state: &EmotionState<E>, limit: usize) -> E {
        let index = self.ladder.rung_for(state.urgency.value(), limit);

        self.ladder.rungs()[index].emotion
    }
}

fn is_duration(seconds: f64) -> bool {
    seconds >= 0.0 && seconds.is_finite()
}

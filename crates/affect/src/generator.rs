//! The emotion state generator (ESG), which turns progress measures into a feeling.
//!
//! It is documented that two separate modules generate emotion and behavior, and how they influence each other
//! [D: S]: emotion affects behavior directly, while behavior affects emotion only through the progress that it makes.
//! The types enforce this. An [`EmotionGenerator`] has shared references to measures and behavior, owns only its
//! emotion, and returns a [`Feeling`], which is a copy.
//!
//! [`DynamicGenerator`] is the generator of the documented robots.
//!
//! ```compile_fail,E0594
//! use affect::{EmotionGenerator, Feeling, Urgency, StandardEmotion};
//! enum Behavior { Serve, Rest }
//! struct Meddler;
//! impl EmotionGenerator for Meddler {
//!     type Measures = f64;
//!     type Behavior = Behavior;
//!     type Emotion = StandardEmotion;
//!     fn update(&mut self, _: &f64, behavior: &Behavior, _: f64) -> Feeling<StandardEmotion> {
//!         *behavior = Behavior::Rest; // does not compile: an ESG cannot change the behavior
//!         self.feeling()
//!     }
//!     fn feeling(&self) -> Feeling<StandardEmotion> {
//!         Feeling { emotion: StandardEmotion::Happy, urgency: Urgency::MIN }
//!     }
//! }
//! ```

use crate::dynamics::{Dynamics, EmotionState, Stimulus};
use crate::label::{EmotionLabel, Feeling};
use std::fmt;

/// Turns progress measures into a feeling.
pub trait EmotionGenerator {
    /// The progress measures of this robot.
    type Measures;
    /// The behavior states of this robot, which the generator only reads.
    type Behavior;
    /// The emotions of this robot.
    type Emotion: EmotionLabel;

    /// Advances by `dt_s` seconds and returns the resulting feeling.
    fn update(
        &mut self,
        measures: &Self::Measures,
        behavior: &Self::Behavior,
        dt_s: f64,
    ) -> Feeling<Self::Emotion>;

    /// The current feeling.
    fn feeling(&self) -> Feeling<Self::Emotion>;
}

/// A generator that appraises its measures and applies [`Dynamics`] to the result.
///
/// ```
/// use affect::{Caution, Dynamics, DynamicGenerator, DynamicsParameters, EmotionGenerator};
/// use affect::{StandardEmotion, Stimulus};
///
/// struct Measures { need_ratio: f64 }
/// #[derive(PartialEq)]
/// enum Behavior { Work, Break }
///
/// let dynamics = Dynamics::standard(&DynamicsParameters::default(), Caution::default())?;
/// let mut esg = DynamicGenerator::new(dynamics, |measures: &Measures, behavior| match behavior {
///     Behavior::Work => Stimulus::need(measures.need_ratio),
///     Behavior::Break => Stimulus::rest(),
/// });
/// for _ in 0..20 {
///     esg.update(&Measures { need_ratio: 5.0 }, &Behavior::Work, 0.5);
/// }
/// assert_eq!(esg.feeling().emotion, StandardEmotion::Frustrated);
/// # Ok::<(), affect::ParameterError>(())
/// ```
pub struct DynamicGenerator<M, B, E> {
    dynamics: Dynamics<E>,
    appraise: fn(&M, &B) -> Stimulus,
    state: EmotionState<E>,
}

impl<M, B, E: EmotionLabel> DynamicGenerator<M, B, E> {
    /// Creates a generator in the initial state of its dynamics.
    ///
    /// `appraise` evaluates measures and behavior from the robot's point of view.
    pub fn new(dynamics: Dynamics<E>, appraise: fn(&M, &B) -> Stimulus) -> Self {
        let state = dynamics.start();

        Self {
            dynamics,
            appraise,
            state,
        }
    }

    /// The dynamics that this generator follows.
    pub fn dynamics(&self) -> &Dynamics<E> {
        &self.dynamics
    }

    /// The state to save.
    pub fn state(&self) -> &EmotionState<E> {
        &self.state
    }

    /// Resumes from a saved state.
    pub fn restore(&mut self, state: EmotionState<E>) {
        self.state = state;
    }
}

impl<M, B, E: EmotionLabel> EmotionGenerator for DynamicGenerator<M, B, E> {
    type Measures = M;
    type Behavior = B;
    type Emotion = E;

    fn update(&mut self, measures: &M, behavior: &B, dt_s: f64) -> Feeling<E> {
        let stimulus = (self.appraise)(measures, behavior);

        self.dynamics.step(&mut self.state, &stimulus, dt_s);
        self.feeling()
    }

    fn feeling(&self) -> Feeling<E> {
        self.state.feeling()
    }
}

// Derived implementations would add bounds on measures and behaviors, although no value of them is stored.

impl<M, B, E: Clone> Clone for DynamicGenerator<M, B, E> {
    fn clone(&self) -> Self {
        Self {
            dynamics: self.dynamics.clone(),
            appraise: self.appraise,
            state: self.state.clone(),
        }
    }
}

impl<M, B, E: fmt::Debug> fmt::Debug for DynamicGenerator<M, B, E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DynamicGenerator")
            .field("state", &self.state)
            .finish_non_exhaustive()
    }
}

//! The multilevel process: three ways in which an emotion acts on behavior.
//!
//! | Level | Sees | Decides | Counterpart in a hybrid architecture |
//! | --- | --- | --- | --- |
//! | [`SensoryMotor`] | valence and intensity | how strongly the active behavior moves | reactive behavior |
//! | [`Schematic`] | the emotion | which behaviors are active | assemblage, script |
//! | [`Conceptual`] | past emotions, anticipated ones | which behavior is best | deliberative planning |
//!
//! The levels, what each may see and the correspondence are documented [D: S, Table 3; T], and so is that
//! they can be built and tested one by one. So each works alone, and [`MultilevelProcess`] puts them together
//! with a switch for each. The numbers are chosen here \[I\].

mod conceptual;
mod schematic;
mod sensory_motor;

pub use conceptual::{
    Candidate, CandidateError, Choice, Conceptual, ConceptualParameters, Experience, Memory,
    Outcome,
};
pub use schematic::Schematic;
pub use sensory_motor::{SensoryMotor, SensoryMotorParameters};

use crate::akr::ActionTendency;
use crate::label::{EmotionLabel, Feeling};
use serde::{Deserialize, Serialize};

/// Which levels take part. All by default; an experiment switches off what it wants to see without.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Levels {
    /// Emotion modifies motor output.
    pub sensory_motor: bool,
    /// Emotion controls which behaviors are active.
    pub schematic: bool,
    /// The robot deliberates about emotions.
    pub conceptual: bool,
}

impl Default for Levels {
    fn default() -> Self {
        Self {
            sensory_motor: true,
            schematic: true,
            conceptual: true,
        }
    }
}

/// What the levels together make of a feeling.
#[derive(Debug, Clone, PartialEq)]
pub struct Influence<B> {
    /// Factor on the motor output; 1 without the sensory-motor level.
    pub motor_gain: f64,
    /// Behaviors that may run; the neutral set without the schematic level.
    pub active: Vec<B>,
    /// What deliberation chose among them; none without the conceptual level or without a candidate.
    pub choice: Option<Choice<B>>,
}

/// The three levels together.
///
/// The schematic level says which behaviors may run, the conceptual level chooses among the candidates that
/// are of that set, and the sensory-motor level modifies whatever runs. A level that is off changes
/// nothing, so that any of the eight combinations is a robot that works \[I\].
#[derive(Debug, Clone, PartialEq)]
pub struct MultilevelProcess<E, B> {
    /// The automatic level.
    pub sensory_motor: SensoryMotor,
    /// The level of prototypes.
    pub schematic: Schematic<E, B>,
    /// The deliberative level.
    pub conceptual: Conceptual,
    /// Which of them take part.
    pub levels: Levels,
}

impl<E: EmotionLabel, B: Clone + PartialEq> MultilevelProcess<E, B> {
    /// What a feeling does to behavior. `tendency` is the action tendency of the emotion, if it has one.
    pub fn influence(
        &self,
        feeling: Feeling<E>,
        tendency: Option<ActionTendency>,
        candidates: &[Candidate<B>],
        memory: &Memory<E, B>,
    ) -> Influence<B> {
        let motor_gain = if self.levels.sensory_motor {
            self.sensory_motor.gain(feeling.affect())
        } else {
            1.0
        };
        let active = if self.levels.schematic {
            self.schematic.active(feeling.emotion)
        } else {
            self.schematic.neutral()
        };
        let choice = if self.levels.conceptual {
            let possible: Vec<Candidate<B>> = candidates
                .iter()
                .filter(|candidate| active.contains(candidate.action()))
                .cloned()
                .collect();
            self.conceptual
                .deliberate(feeling, tendency, &possible, memory)
        } else {
            None
        };
        Influence {
            motor_gain,
            active: active.to_vec(),
            choice,
        }
    }
}

//! The multilevel process: three ways in which emotion affects behavior.
//!
//! | Level | Sees | Decides | Counterpart in a hybrid architecture |
//! | --- | --- | --- | --- |
//! | [`SensoryMotor`] | valence and intensity | how strongly the active behavior moves | reactive behavior |
//! | [`Schematic`] | the emotion | which behaviors are active | assemblage, script |
//! | [`Conceptual`] | past emotions, anticipated ones | which behavior is best | deliberative planning |
//!
//! The levels, what each of them sees, and their counterparts are documented [D: S, Table 3; T], and so is that they
//! can be built and tested one by one. Each level therefore works alone, and [`MultilevelProcess`] combines them with
//! a switch for each. The numbers are chosen here \[I\].

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

/// The levels that are enabled, by default all of them. Experiments disable levels to measure their effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Levels {
    /// Whether emotion modifies motor output.
    pub sensory_motor: bool,
    /// Whether emotion selects the active behaviors.
    pub schematic: bool,
    /// Whether the robot deliberates about emotions.
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

/// The combined effect of the levels.
#[derive(Debug, Clone, PartialEq)]
pub struct Influence<B> {
    /// Factor on motor output (dimensionless); 1 without the sensory-motor level.
    pub motor_gain: f64,
    /// The active behaviors; the neutral set without the schematic level.
    pub active: Vec<B>,
    /// The choice among the active behaviors; `None` without the conceptual level or without candidates.
    pub choice: Option<Choice<B>>,
}

/// The combination of the three levels.
///
/// The schematic level selects the active behaviors, the conceptual level chooses among the candidates in that set,
/// and the sensory-motor level modifies the output of the chosen behavior. A disabled level has no effect, so all
/// eight combinations give a working robot \[I\].
#[derive(Debug, Clone, PartialEq)]
pub struct MultilevelProcess<E, B> {
    /// The level that modifies motor output.
    pub sensory_motor: SensoryMotor,
    /// The level that selects the active behaviors.
    pub schematic: Schematic<E, B>,
    /// The deliberative level.
    pub conceptual: Conceptual,
    /// The levels that are enabled.
    pub levels: Levels,
}

impl<E: EmotionLabel, B: Clone + PartialEq> MultilevelProcess<E, B> {
    /// The effect of a feeling on behavior. `tendency` is the action tendency of the emotion, if it has one.
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

//! The multilevel process: three ways in which emotion affects behavior.
//!
//! | Level | Sees | Decides | Counterpart in a hybrid architecture |
//! | --- | --- | --- | --- |
//! | [`SensoryMotor`] | valence and intensity | how strongly the active behavior moves | reactive behavior |
//! | schematic: guards of a [`behavior`](crate::behavior) table | the emotion | which behaviors are active | assemblage, script |
//! | [`Conceptual`] | past emotions, anticipated ones | which behavior is best | deliberative planning |
//!
//! The levels, what each of them sees, and their counterparts are documented [D: S, Table 3; T], and so is that they
//! can be built and tested one by one. Each level therefore works alone. The numbers are chosen here \[I\].

mod conceptual;
mod sensory_motor;

pub use conceptual::{
    ActionOutcome, Candidate, CandidateError, Choice, Conceptual, ConceptualParameters, Experience,
    Memory,
};
pub use sensory_motor::{SensoryMotor, SensoryMotorParameters};

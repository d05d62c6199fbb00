//! Experiments: one scenario in several arms under several conditions over many seeds. An experiment is a file
//! ([`Experiment::load`]); three ship with the project.

mod condition;
mod contrast;
mod file;
mod measure;
mod play;
mod script;

pub use condition::{Condition, ConditionError, Conditions, Factor, Value};
pub use contrast::Contrast;
pub use file::{Arm, Experiment, is_experiment_file};
pub use measure::{Kind, Measure, MeasureError, Stalled};
pub use play::{Cell, Options, Outcome};

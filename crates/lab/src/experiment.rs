//! Experiments: one scenario in several arms under several conditions over many seeds. An experiment is a file
//! ([`Experiment::load`]); two ship with the project.

mod file;
mod measure;
mod play;

pub use file::{Arm, Condition, Experiment, Factor, Value};
pub use measure::{Measure, MeasureError, Probe, When};
pub use play::{Cell, Options, Outcome};

//! The numbers that order a run.

/// Index of a simulation step. Tick 0 is the initial state.
pub type Tick = u64;
/// Number of an execution within a run, from 1; `init` starts the next one.
pub type Epoch = u32;
/// Number of a robot's incarnation, from 1; a robot that comes back has a higher one.
pub type Generation = u32;
/// Number of a command in the record, among those of its sender in an epoch, from 1. The simulator counts.
pub type Seq = u64;

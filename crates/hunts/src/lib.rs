//! Hunts for faults: plans of faults are drawn and played until an expectation of the scenario fails ([`hunt()`]); the plan is then
//! shrunk to a minimal scenario file ([`shrink()`]). A plan is played by the runs and launches of `experiments` ([`Subject`]).

mod case;
mod cause;
mod corpus;
mod coverage;
mod draw;
mod fault;
mod file;
mod hunt;
mod sent;
mod shrink;
mod trial;

pub use case::FaultCase;
pub use cause::{FailureSignature, Sign};
pub use coverage::{CommandFate, Coverage, Feature};
pub use draw::Ground;
pub use fault::{Effect, FaultClass, Messages, PlannedFault, TickSpan};
pub use hunt::{Finding, HuntBudget, HuntOptions, HuntProgress, HuntReport, hunt};
pub use sent::{Link, Onset, SentMessage};
pub use shrink::{Bounds, ScenarioParts, Shrunk, shrink};
pub use trial::{FailedExpectation, HuntRobots, RUNS, Subject, Trial, TrialResult};

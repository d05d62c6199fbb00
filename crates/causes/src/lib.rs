//! The causes of what happened in a run, for `cars why`: the probability of its outcome after each tick, from forks that are re-seeded there, and the events at which
//! that probability jumps. A jump is confirmed by forks in which exactly that event does not happen.

mod answer;
mod budget;
mod candidates;
mod forks;
mod plan;
mod question;
mod search;
mod sentence;

pub use answer::{FailedForks, Jump, KindEffect, PlannedEffect, TriedCause, WhyAnswer};
pub use budget::WhyBudget;
pub use forks::{WhyOptions, WhyProgress, why};
pub use plan::{Counterfactual, ForkPlan};
pub use question::Question;

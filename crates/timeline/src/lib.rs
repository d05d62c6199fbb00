//! What a run is made of, from its events: in which emotion and behavior each robot is and whether it takes part, faults, cuts
//! of links, and the fate of each command. One fold, for all that show, count or measure a run. Pure.
//!
//! [`Timeline`] takes the events of a run, tick by tick, and returns each [`Span`] when it is over; what is not over is
//! [`Timeline::in_progress`]. [`Counts`] counts events by robot and link. Both match every event by name, so that a new one is
//! noticed here. [`RunDecision`] is what `cars why` found of a run, for all that show it.
//!
//! A robot is in a state from the tick of its first report with it. A tick that it misses changes nothing: it takes part, and is in
//! the state that it reported last. From the tick in which it is lost on it takes no part, and is in no state; when it joins
//! again it is in the state that it had before, unless it reports another one.

mod counts;
mod decision;
mod fold;
mod names;
mod span;

pub use counts::{Counts, LinkCounts, RobotCounts, StateCounts};
pub use decision::{
    DecisionCause, DecisionJump, DecisionPoint, DecisionQuestion, ForkOutcomes, RunDecision,
    outcome_in_words,
};
pub use fold::Timeline;
pub use names::StateOrder;
pub use span::{
    Absence, ChangeSpan, CommandEnd, CommandSpan, CutSpan, ExpectationSpan, FaultSpan, GuestVisit,
    Joined, MissedTicks, Period, QueriesLost, Span, StateKind, StateSpan,
};

#[cfg(test)]
mod tests;

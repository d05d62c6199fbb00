//! How forks of a run begin, and what comes of them.

use std::sync::Arc;

use protocol::{RobotName, Seq, Tick};
use scenario::ChanceKind;
use serde::{Deserialize, Serialize};

/// How forks begin. Fork number n of a plan is re-seeded with the seed n + 1, as `cars fork --seed` does it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(tag = "fork", rename_all = "snake_case")]
pub enum ForkPlan {
    /// All chance after a tick is another one.
    After {
        /// The last tick that they share with the run.
        tick: Tick,
    },
    /// Only chance of a kind is another one after a tick.
    KindAfter {
        /// The last tick that they share with the run.
        tick: Tick,
        /// The kind.
        kind: ChanceKind,
    },
    /// Chance of a kind is another one from a tick on, and all chance after the tick.
    KindAt {
        /// The first tick that may differ.
        tick: Tick,
        /// The kind.
        kind: ChanceKind,
    },
    /// An event of a tick does not happen, and all chance after the tick is another one.
    Without {
        /// The tick of the event.
        tick: Tick,
        /// The event.
        event: Counterfactual,
    },
}

impl ForkPlan {
    /// The last tick that the forks share with the run.
    pub(super) fn shared(&self) -> Tick {
        match self {
            Self::After { tick } | Self::KindAfter { tick, .. } => *tick,
            Self::KindAt { tick, .. } | Self::Without { tick, .. } => tick.saturating_sub(1),
        }
    }
}

/// An event that does not happen, and what happens in its place.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(tag = "instead", rename_all = "snake_case")]
pub enum Counterfactual {
    /// A command that was lost or delayed, or came twice, arrives once.
    Arrives {
        /// Its sender.
        from: RobotName,
        /// Its target.
        to: RobotName,
        /// Its number.
        seq: Seq,
    },
    /// A command that arrived is lost.
    IsLost {
        /// Its sender.
        from: RobotName,
        /// Its target.
        to: RobotName,
        /// Its number.
        seq: Seq,
    },
    /// A query that was lost is answered.
    IsAnswered {
        /// Who queries.
        from: RobotName,
        /// The target.
        to: RobotName,
    },
    /// Guests leave the way of a robot free that was blocked: they walk otherwise in this tick, and only forks in which that is enough
    /// count.
    WayIsFree {
        /// The robot.
        robot: RobotName,
    },
    /// Nothing is done by hand before the tick: no command of the operator, no change, no fault.
    NothingByHand,
    /// A partition of the scenario is left out from the tick on, by its place among those that are known then.
    NoPartition {
        /// Its place.
        index: usize,
    },
    /// A fault of the scenario is left out.
    NoFault {
        /// Its place.
        index: usize,
    },
}

/// What came of a fork.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ForkOutcome {
    /// Its number: 1 or 0 where the question is whether something happens.
    Number(f64),
    /// It has none: a measure without a value, or what the plan is about has not come about.
    Nothing,
    /// A robot failed: why, and in which tick.
    Failed(Arc<str>),
}

impl ForkOutcome {
    /// Its number, if it has one.
    pub(super) fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Nothing | Self::Failed(_) => None,
        }
    }
}

impl From<Option<f64>> for ForkOutcome {
    fn from(number: Option<f64>) -> Self {
        number.map_or(Self::Nothing, Self::Number)
    }
}

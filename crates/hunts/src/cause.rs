//! What the faults of a case do, by which findings are told apart.

use std::collections::BTreeSet;

use protocol::RobotName;
use serde::Serialize;

use super::case::FaultCase;
use super::fault::{FaultClass, PlannedFault};

use super::sent::{Link, SentMessage};
use super::trial::TrialResult;

/// What the faults of a case do.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FailureSignature(BTreeSet<Sign>);

/// One thing that faults do.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sign {
    /// A command with this text is lost on this link.
    Lost {
        /// The link.
        link: Link,
        /// The text.
        text: String,
    },
    /// A command with this text is late on this link.
    Late {
        /// The link.
        link: Link,
        /// The text.
        text: String,
    },
    /// A command with this text arrives twice on this link.
    Doubled {
        /// The link.
        link: Link,
        /// The text.
        text: String,
    },
    /// This robot takes no part for a time.
    Absent(RobotName),
    /// There is a fault of this kind.
    Fault(FaultClass),
}

impl FailureSignature {
    /// What the faults of a shrunk case do, each of which is needed.
    pub(super) fn of_faults(case: &FaultCase, played: &TrialResult) -> Self {
        let mut signs = BTreeSet::new();
        for fault in &case.faults {
            if let Some((link, number)) = fault.command() {
                let mut sent = played.sent.iter();
                let message = sent.find(|message| message.is(link, number));
                signs.extend(message.map(|message| match fault {
                    PlannedFault::Late { .. } => late(message),
                    PlannedFault::Double { .. } => doubled(message),
                    _ => lost(message),
                }));
                continue;
            }
            match fault {
                PlannedFault::Absence { robot, .. } => {
                    signs.insert(Sign::Absent(robot.clone()));
                }
                other => {
                    signs.insert(Sign::Fault(other.kind()));
                }
            }
        }

        Self(signs)
    }

    /// All that the faults of a plan did in its run.
    pub(super) fn of_plan(case: &FaultCase, played: &TrialResult) -> Self {
        let mut cause = Self::of_faults(case, played);
        for message in &played.sent {
            if message.is_lost {
                cause.0.insert(lost(message));
            }
            if message.late > 0 {
                cause.0.insert(late(message));
            }
            if message.is_doubled {
                cause.0.insert(doubled(message));
            }
        }
        cause
    }

    /// Whether the other faults do all of this, too.
    pub(super) fn is_part_of(&self, other: &Self) -> bool {
        self.0.is_subset(&other.0)
    }
}

fn lost(message: &SentMessage) -> Sign {
    Sign::Lost {
        link: message.link.clone(),
        text: message.text.clone(),
    }
}

fn late(message: &SentMessage) -> Sign {
    Sign::Late {
        link: message.link.clone(),
        text: message.text.clone(),
    }
}

fn doubled(message: &SentMessage) -> Sign {
    Sign::Doubled {
        link: message.link.clone(),
        text: message.text.clone(),
    }
}

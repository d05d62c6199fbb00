//! What happened in the runs of a hunt, and in how many of them.

use std::collections::BTreeMap;

use protocol::event::Cause;
use protocol::{Event, RobotName};
use serde::Serialize;

use super::fault::FaultClass;

use super::sent::Link;

/// Most features that are told apart, because robots choose the texts of commands and states.
pub(super) const MAX_FEATURES: usize = 10_000;

/// Something that can happen in a run.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(tag = "feature", rename_all = "snake_case")]
pub enum Feature {
    /// The plan has a fault of this kind.
    Fault {
        /// The kind.
        kind: FaultClass,
    },
    /// A command had this fate.
    Message {
        /// The link.
        link: Link,
        /// Its text.
        text: String,
        /// What became of it.
        fate: CommandFate,
    },
    /// A query could not be made by chance.
    QueryLost {
        /// Who asks whom.
        link: Link,
    },
    /// A robot changed its behavior.
    Behavior {
        /// The robot.
        robot: RobotName,
        /// The behavior before.
        from: String,
        /// The behavior after.
        to: String,
    },
    /// A robot changed its emotion.
    Emotion {
        /// The robot.
        robot: RobotName,
        /// The emotion before.
        from: String,
        /// The emotion after.
        to: String,
    },
    /// What some run should reach was seen.
    Reached {
        /// Name of the expectation.
        expectation: String,
    },
}

impl Feature {
    /// The change of a robot's state, if the event is one.
    pub(super) fn transition(event: &Event) -> Option<Self> {
        match event {
            Event::Emotion {
                robot,
                from: Some(from),
                to,
            } => Some(Self::Emotion {
                robot: robot.clone(),
                from: from.clone(),
                to: to.clone(),
            }),
            Event::Behavior {
                robot,
                from: Some(from),
                to,
            } => Some(Self::Behavior {
                robot: robot.clone(),
                from: from.clone(),
                to: to.clone(),
            }),
            _ => None,
        }
    }

    /// Whether a run that shows it is in another state from then on, as far as its robots show: a transition, a command that
    /// arrives, a goal. What the faults of a plan do by themselves is none.
    pub(super) fn is_state(&self) -> bool {
        match self {
            Self::Behavior { .. } | Self::Emotion { .. } | Self::Reached { .. } => true,
            Self::Message { fate, .. } => *fate == CommandFate::Delivered,
            Self::Fault { .. } | Self::QueryLost { .. } => false,
        }
    }
}

/// What became of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CommandFate {
    /// It arrived.
    Delivered,
    /// It was delayed.
    Delayed,
    /// It arrived twice.
    Duplicated,
    /// It was lost.
    Dropped(Cause),
}

/// The features of a hunt, with the number of plans in whose runs each occurred.
#[derive(Debug, Clone, Default)]
pub struct Coverage {
    counts: BTreeMap<Feature, u64>,
}

/// One row of the coverage, as JSON.
#[derive(Debug, Serialize)]
struct CoverageRow<'a> {
    #[serde(flatten)]
    feature: &'a Feature,
    plans: u64,
}

impl Coverage {
    /// Adds the features of a run.
    pub(super) fn add<'a>(&mut self, features: impl Iterator<Item = &'a Feature>) {
        for feature in features {
            if self.counts.len() < MAX_FEATURES || self.counts.contains_key(feature) {
                *self.counts.entry(feature.clone()).or_default() += 1;
            }
        }
    }

    /// The features, with the number of plans in whose runs each occurred.
    pub fn features(&self) -> impl Iterator<Item = (&Feature, u64)> {
        self.counts.iter().map(|(feature, count)| (feature, *count))
    }
}

impl Serialize for Coverage {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let rows = self.counts.iter();
        serializer.collect_seq(rows.map(|(feature, plans)| CoverageRow {
            feature,
            plans: *plans,
        }))
    }
}

impl std::fmt::Display for CommandFate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Delivered => f.write_str("delivered"),
            Self::Delayed => f.write_str("delayed"),
            Self::Duplicated => f.write_str("duplicated"),
            Self::Dropped(because) => write!(f, "lost {because}"),
        }
    }
}

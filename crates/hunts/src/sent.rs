//! The commands that robots sent in a run.

use std::collections::BTreeMap;

use protocol::{RobotName, Tick};
use serde::Serialize;

/// A directed link between two robots.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Link {
    /// The sender.
    pub from: RobotName,
    /// The target.
    pub to: RobotName,
}

/// A command that a robot sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SentMessage {
    /// When.
    pub tick: Tick,
    /// The link.
    pub link: Link,
    /// Its number on the link, from 1.
    pub number: u64,
    /// Its text.
    pub text: String,
    /// Whether it was lost, as a whole or in part.
    pub is_lost: bool,
    /// How many ticks later it was to arrive than in the tick after it was sent.
    pub late: Tick,
    /// Whether it was to arrive twice.
    pub is_doubled: bool,
}

impl SentMessage {
    /// Whether it is the command with this number on a link.
    pub(super) fn is(&self, link: &Link, number: u64) -> bool {
        self.number == number && self.link == *link
    }
}

/// A moment of a run, from which on faults are drawn.
#[derive(Debug, Clone, Default)]
pub struct Onset {
    /// The last tick before them.
    pub(super) after: Tick,
    /// Of each link the number of commands on which is decided, and the number in the whole run.
    pub(super) links: BTreeMap<Link, (u64, u64)>,
}

impl Onset {
    /// The moment after a tick of a run in which these commands were sent.
    pub(super) fn of(sent: &[SentMessage], after: Tick) -> Self {
        let mut links: BTreeMap<Link, (u64, u64)> = BTreeMap::new();
        for message in sent {
            let (decided, all) = links.entry(message.link.clone()).or_default();
            *decided += u64::from(message.tick < after);
            *all += 1;
        }
        Self { after, links }
    }
}

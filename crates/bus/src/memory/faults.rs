//! Faults of a network, and counts of what it has done.

use std::time::Duration;

/// How bad the network is. The default delivers everything, in an order that the seed chooses.
#[derive(Debug, Clone, Copy, Default)]
pub struct Faults {
    /// Pause between two deliveries: the longer, the more messages are under way to choose from.
    pub pause: Duration,
    /// Chance that a link naps before it delivers a message.
    pub nap: f64,
    /// Chance that the link of a client breaks instead of delivering a message.
    pub cut: f64,
    /// Chance that a client's link loses a message that was put, and up to three after it.
    pub loss: f64,
    /// Chance that a message that was put comes again, after all that is on the link now.
    pub duplicate: f64,
    /// Longest nap, and longest time for which a link is cut.
    pub longest: Duration,
}

/// What a network has done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Messages delivered at the end of a link.
    pub delivered: u64,
    /// Messages lost.
    pub lost: u64,
    /// Messages that came twice.
    pub duplicated: u64,
    /// Links that broke.
    pub cuts: u64,
    /// Naps.
    pub naps: u64,
}

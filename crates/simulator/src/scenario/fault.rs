//! `[[fault]]`: what befalls the robots' processes. The launcher does it to the real process, at a tick at which the clock
//! is held for it.

use protocol::messages::FaultKind;
use protocol::{RobotName, Tick};

/// A fault of one robot's process.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Whose process.
    pub robot: RobotName,
    /// What befalls it.
    pub kind: FaultKind,
    /// Tick before whose clock it begins.
    pub at: Tick,
    /// When it is over.
    pub end: FaultEnd,
}

/// When a fault is over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FaultEnd {
    /// Before the clock of this tick; the clock is held until the robot is back.
    At(Tick),
    /// After this time of wall clock, seconds.
    After(f64),
    /// Not at all.
    Never,
}

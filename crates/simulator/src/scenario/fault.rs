//! `[[fault]]`: faults of the robots' processes. The simulator holds the clock at a tick while the launcher carries them out
//! on the real processes.

use protocol::messages::{FaultKind, ProcessOrder};
use protocol::{RobotName, Tick};

/// A fault of one robot's process.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Robot whose process has the fault.
    pub robot: RobotName,
    /// Crash, hang or slow.
    pub kind: FaultKind,
    /// It begins before the clock of this tick.
    pub at: Tick,
    /// End of the fault.
    pub end: FaultEnd,
}

impl Fault {
    /// The order to begin the fault.
    pub(crate) fn begin_order(&self) -> ProcessOrder {
        let for_s = match self.end {
            FaultEnd::After(wall_s) => Some(wall_s),
            FaultEnd::At(_) | FaultEnd::Never => None,
        };
        self.order(true, for_s)
    }

    /// The order to end the fault.
    pub(crate) fn end_order(&self) -> ProcessOrder {
        self.order(false, None)
    }

    /// Whether the process is gone or stopped before a tick, or takes part again from that tick on.
    pub(crate) fn is_absence_at(&self, tick: Tick) -> bool {
        let is_absence = matches!(self.kind, FaultKind::Crash | FaultKind::Hang);
        let lasts = match self.end {
            FaultEnd::At(end) => tick <= end,
            FaultEnd::After(_) => tick == self.at,
            FaultEnd::Never => true,
        };
        is_absence && self.at <= tick && lasts
    }

    fn order(&self, begins: bool, for_s: Option<f64>) -> ProcessOrder {
        ProcessOrder {
            robot: self.robot.clone(),
            kind: self.kind,
            begins,
            for_s,
        }
    }
}

/// The end of a fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FaultEnd {
    /// It ends before the clock of this tick, which is held until the robot has rejoined.
    At(Tick),
    /// It ends after this time of wall clock, seconds.
    After(f64),
    /// It does not end.
    Never,
}

//! `[[fault]]`: faults of the robots' processes. The simulator holds the clock at a tick while the launcher carries them out
//! on the real processes.

use protocol::messages::{FaultKind, ProcessOrder};
use protocol::{RobotName, Tick};

/// A fault of one robot's process.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Robot whose process has the fault.
    pub robot: RobotName,
    /// Which.
    pub kind: FaultKind,
    /// It begins before the clock of this tick.
    pub at: Tick,
    /// End of the fault.
    pub end: FaultEnd,
}

impl Fault {
    /// The order to begin the fault.
    pub fn begin_order(&self) -> ProcessOrder {
        let for_s = match self.end {
            FaultEnd::After(wall_s) => Some(wall_s),
            FaultEnd::At(_) | FaultEnd::Never => None,
        };
        self.order(true, for_s)
    }

    /// The order to end the fault.
    pub fn end_order(&self) -> ProcessOrder {
        self.order(false, None)
    }

    /// Whether the process is gone or stopped before a tick, or takes part again from that tick on.
    pub fn is_absence_at(&self, tick: Tick) -> bool {
        let is_absence = matches!(self.kind, FaultKind::Crash | FaultKind::Hang);
        let lasts = match self.end {
            FaultEnd::At(end) => tick <= end,
            FaultEnd::After(_) => tick == self.at,
            FaultEnd::Never => true,
        };
        is_absence && self.at <= tick && lasts
    }

    /// What is certain of the fault before a tick: one that has not ended by then may end in any way later.
    fn before(&self, tick: Tick) -> Self {
        let end = match self.end {
            FaultEnd::At(end) if end >= tick => FaultEnd::Never,
            end => end,
        };
        Self {
            end,
            ..self.clone()
        }
    }

    /// Whether a change before a tick can make this fault, which has begun, to another one.
    pub fn may_become(&self, other: &Self, tick: Tick) -> bool {
        let mut before = other.before(tick);
        // The wall clock has not ended it yet, and now a tick does.
        let is_ended_early = matches!(other.end, FaultEnd::At(end) if end >= tick);
        if matches!(self.end, FaultEnd::After(_)) && is_ended_early {
            before.end = self.end;
        }
        self.before(tick) == before
    }

    /// Whether the process is killed and started again at once.
    pub fn is_restart(&self) -> bool {
        self.kind == FaultKind::Restart
    }

    /// Whether the fault holds the process in a tick, which is complete or not. One that ends by the wall clock lasts until the
    /// tick is complete for which the clock waits.
    pub fn holds(&self, tick: Tick, is_complete: bool) -> bool {
        let is_over = match self.end {
            FaultEnd::At(end) => end <= tick,
            FaultEnd::After(_) => self.at < tick || is_complete,
            FaultEnd::Never => false,
        };
        self.at <= tick && !is_over && !self.is_restart()
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

/// What stops the process of a robot, or starts it again, in the course of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interruption {
    /// It happens before the clock of this tick.
    pub at: Tick,
    /// The fault, and its end; `None` for a change of the robot's parameters.
    pub fault: Option<(FaultKind, FaultEnd)>,
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

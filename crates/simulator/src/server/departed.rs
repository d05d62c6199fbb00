//! Robots whose processes have ended and are not started again, as the launcher reports it. The clock does not wait for them.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use protocol::RobotName;

/// A process that is refused because its name is taken asks again every 0.1 s. One that has asked within this time is a standby
/// that takes the place as soon as it is free.
pub(super) const STANDBY: Duration = Duration::from_secs(1);

/// Robots whose processes have ended, and processes that stand by.
#[derive(Debug, Default)]
pub(super) struct Departed {
    /// How the process of each robot ended.
    because: BTreeMap<RobotName, String>,
    /// When a process was last refused because the name of this robot is taken.
    refused: BTreeMap<RobotName, Instant>,
}

impl Departed {
    /// The process of a robot has ended, and no further one is started.
    pub(super) fn ended(&mut self, robot: &RobotName, because: &str) {
        self.because.insert(robot.clone(), because.to_owned());
    }

    /// A process takes the place of this robot.
    pub(super) fn forget(&mut self, robot: &RobotName) {
        // A process is here after all, started by hand or by another launcher.
        self.because.remove(robot);
        self.refused.remove(robot);
    }

    /// A process was refused because the name of this robot is taken.
    pub(super) fn refused(&mut self, robot: &RobotName) {
        self.refused.insert(robot.clone(), Instant::now());
    }

    /// Whether no process has ended for good.
    pub(super) fn is_empty(&self) -> bool {
        self.because.is_empty()
    }

    /// How the process of a robot ended, if none follows.
    pub(super) fn because(&self, robot: &RobotName) -> Option<&str> {
        self.because.get(robot).map(String::as_str)
    }

    /// How long a process may take that stands by for this robot; `None` if none has asked to join lately.
    pub(super) fn standby_left(&self, robot: &RobotName) -> Option<Duration> {
        let left = STANDBY.checked_sub(self.refused.get(robot)?.elapsed())?;
        (!left.is_zero()).then_some(left)
    }
}

/// Whether the clock waits for a robot that does not come.
pub(super) enum Wait {
    /// It does not.
    Bounded,
    /// It does, unless a process that stands by joins within this time.
    Standby(Duration),
    /// It does, and would do so for ever.
    Endless,
}

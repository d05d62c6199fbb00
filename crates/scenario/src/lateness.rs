//! What the clock does about late robots.

use std::collections::BTreeMap;

use protocol::RobotName;
use protocol::messages::OnLate;

/// Rules for late robots.
#[derive(Debug, Clone, PartialEq)]
pub struct Lateness {
    /// Rule for robots without one of their own.
    pub on_late: OnLate,
    /// Rules of single robots.
    pub own: BTreeMap<RobotName, OnLate>,
    /// Time without a report after which a robot is late, seconds of wall clock.
    pub deadline_s: f64,
    /// Number of consecutive missed ticks after which a robot is lost, if the clock continues without it.
    pub lose_after: u32,
}

impl Lateness {
    /// The rule for a robot.
    #[must_use]
    pub fn of(&self, robot: &RobotName) -> OnLate {
        self.own.get(robot).copied().unwrap_or(self.on_late)
    }

    /// The rules as the lock-step takes them.
    #[must_use]
    pub fn to_lockstep(&self) -> lockstep::LatePolicy {
        let deadline = std::time::Duration::try_from_secs_f64(self.deadline_s);

        lockstep::LatePolicy {
            on_late: self.on_late,
            own: self.own.clone(),
            deadline: deadline.unwrap_or(std::time::Duration::MAX),
            lose_after: self.lose_after,
        }
    }
}

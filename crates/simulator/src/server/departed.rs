//! Robots whose processes have ended and are not started again, as the launcher reports it. The clock does not wait for them.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use protocol::RobotName;
use protocol::event::WaitedFor;
use protocol::messages::Reason;

use super::process::Server;

/// A process that is refused because its name is taken asks again every 0.1 s. One that has asked within this time is a standby
/// that takes the place as soon as it is free.
const STANDBY: Duration = Duration::from_secs(1);

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
    pub(super) fn is_here(&mut self, robot: &RobotName) {
        self.because.remove(robot);
        self.refused.remove(robot);
    }

    /// A process was refused because the name of this robot is taken.
    pub(super) fn refused(&mut self, robot: &RobotName) {
        self.refused.insert(robot.clone(), Instant::now());
    }

    /// How long a process may take that stands by for this robot; `None` if none has asked to join lately.
    fn standby_left(&self, robot: &RobotName) -> Option<Duration> {
        let left = STANDBY.checked_sub(self.refused.get(robot)?.elapsed())?;
        (!left.is_zero()).then_some(left)
    }
}

/// Whether the clock waits for a robot that does not come.
pub(super) enum Wait {
    /// It does not.
    Sound,
    /// It does, unless a process that stands by joins within this time.
    Standby(Duration),
    /// It does, and would do so for ever.
    Endless,
}

impl Server {
    /// Whether the clock waits for a robot whose process has ended for good.
    pub(super) fn endless_wait(&self) -> Wait {
        let mut wait = Wait::Sound;
        if self.departed.because.is_empty() {
            return wait;
        }

        for (robot, reason) in self.barrier.awaited() {
            let is_gone = matches!(reason, Reason::Gone | Reason::NotJoined);
            if !is_gone || !self.departed.because.contains_key(&robot) {
                continue;
            }
            if self.barrier.is_reserved(&robot) {
                wait = Wait::Standby(STANDBY);
                continue;
            }
            match self.departed.standby_left(&robot) {
                None => return Wait::Endless,
                Some(left) => wait = Wait::Standby(left),
            }
        }
        wait
    }

    /// The robots for which the clock waits now, and why.
    pub(super) fn waited_for(&self) -> Vec<WaitedFor> {
        let mut waited_for = Vec::new();
        for (robot, reason) in self.barrier.awaited() {
            let is_gone = matches!(reason, Reason::Gone | Reason::NotJoined);
            let ended = self.departed.because.get(&robot).filter(|_| is_gone);
            let because = ended.cloned().map_or(reason, Reason::Ended);
            waited_for.push(WaitedFor { robot, because });
        }
        waited_for
    }
}

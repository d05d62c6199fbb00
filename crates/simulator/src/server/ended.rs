//! Whether the clock waits for robots whose processes have ended for good.

use protocol::event::WaitedFor;
use protocol::messages::Reason;

use super::departed::{STANDBY, Wait};
use super::process::Server;

impl Server {
    /// Whether the clock waits for a robot whose process has ended for good.
    pub(super) fn endless_wait(&self) -> Wait {
        let mut wait = Wait::Sound;
        if self.departed.is_empty() {
            return wait;
        }

        for (robot, reason) in self.barrier.awaited() {
            let is_gone = matches!(reason, Reason::Gone | Reason::NotJoined);
            if !is_gone || self.departed.because(&robot).is_none() {
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
            let ended = self.departed.because(&robot).filter(|_| is_gone);
            let because = ended.map_or(reason, |ended| Reason::Ended(ended.to_owned()));
            waited_for.push(WaitedFor { robot, because });
        }
        waited_for
    }
}

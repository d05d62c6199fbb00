//! Queries of the robot.

use bus::Reply;
use protocol::keys::STATE;
use protocol::{Epoch, Tick};

use super::Harness;
use crate::report::RuleFailure;

impl Harness<'_> {
    /// Queries the robot; `None` if there is no reply.
    pub fn ask(&self, what: &str, parameters: &str) -> Result<Option<Reply>, RuleFailure> {
        let key = self.keys.query(&self.kit.subject(), what);
        self.wire.ask(&key, parameters)
    }

    /// The state that the robot shows in a tick: the one of the tick before.
    pub fn state_in(&self, epoch: Epoch, tick: Tick) -> Result<Option<Reply>, RuleFailure> {
        self.ask(STATE, &format!("tick={tick};epoch={epoch}"))
    }

    /// Queries that state without waiting. Returns the number of the reply in [`crate::seen::Seen::replies`].
    pub fn begin_query(&mut self, epoch: Epoch, tick: Tick) -> Result<usize, RuleFailure> {
        let key = self.keys.query(&self.kit.subject(), STATE);
        self.wire
            .begin_query(&key, &format!("tick={tick};epoch={epoch}"))
    }

    /// The same for the kit's own queryable, which shows how fast a query is at this moment.
    pub fn begin_control(&mut self) -> Result<usize, RuleFailure> {
        self.wire.begin_query(&self.kit.control_key(), "")
    }

    /// Whether the robot subscribes to a key; what the kit subscribes to itself does not count.
    pub fn has_subscriber(&self, key: &str) -> Result<bool, RuleFailure> {
        Ok(self.kit.bus.is_subscribed_by_others(key)?)
    }
}

//! What a robot of a host needs from outside during a tick.

use std::sync::Arc;

use lockstep::{StateQuery, Turn};
use protocol::RobotName;
use protocol::messages::{News, PublicState};

use super::shared::Waited;
use super::{Host, HostError};
use crate::seat::{Network, Undelivered};

/// The bus, as a robot sees it that runs a tick: it waits here for other robots' answers, and the host goes on meanwhile.
pub(super) struct HostNetwork<'a> {
    host: &'a mut Host,
    name: &'a RobotName,
    query: StateQuery,
    /// Why the host cannot go on.
    pub(super) failed: Option<HostError>,
}

impl<'a> HostNetwork<'a> {
    pub(super) fn new(host: &'a mut Host, name: &'a RobotName, turn: &Turn<News>) -> Self {
        Self {
            host,
            name,
            query: StateQuery {
                tick: Some(turn.tick),
                epoch: Some(turn.epoch),
            },
            failed: None,
        }
    }
}

impl Network for HostNetwork<'_> {
    fn state_of(&mut self, target: &RobotName) -> Result<Arc<PublicState>, Undelivered> {
        let shared = self.host.shared.clone();
        if shared.has(target) {
            return shared
                .state(target, self.query)
                .map_err(|_| Undelivered::Lost);
        }

        loop {
            match shared.wait_for(self.name, target) {
                Waited::Found(state) => return Ok(state),
                Waited::Interrupted => return Err(Undelivered::Interrupted),
                Waited::Act(name, action) => {
                    if let Err(error) = self.host.carry_out_io(&name, action) {
                        self.failed = Some(error);
                        return Err(Undelivered::Interrupted);
                    }
                }
            }
        }
    }
}

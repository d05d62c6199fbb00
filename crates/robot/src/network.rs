//! The seam between a robot's tick and the network: what a query goes through.

use std::sync::Arc;

use protocol::RobotName;
use protocol::messages::PublicState;

/// What a robot needs from outside during a tick.
pub trait PeerNetwork {
    /// The state that `target` reported for the tick before.
    ///
    /// # Errors
    /// [`Undelivered`] says why there is none.
    fn state_of(&mut self, target: &RobotName) -> Result<Arc<PublicState>, Undelivered>;
}

/// Why a query has no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Undelivered {
    /// The other side is gone.
    Lost,
    /// The tick is over.
    Interrupted,
}

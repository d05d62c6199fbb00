//! Orders to the launcher: the faults of processes that are due.

use std::time::Instant;

use bus::Publisher;
use protocol::messages::{FaultOrder, ProcessOrder};
use protocol::{Epoch, Tick};

/// Orders to the launcher.
pub(super) struct Orders {
    pub(super) publisher: Publisher,
    /// The order that has been carried out last.
    pub(super) done: Option<(Epoch, Tick)>,
    pub(super) has_complained: bool,
}

impl Orders {
    pub(super) fn new(publisher: Publisher) -> Self {
        Self {
            publisher,
            done: None,
            has_complained: false,
        }
    }

    /// The launcher has carried out an order.
    pub(super) fn done(&mut self, epoch: Epoch, tick: Tick) {
        self.done = Some((epoch, tick));
    }
}

/// An order that is being carried out.
pub(super) struct Underway {
    pub(super) order: FaultOrder,
    /// What is ordered when it has been carried out.
    pub(super) then: Vec<ProcessOrder>,
    pub(super) begun: Instant,
    /// When it was put last; `None` while no launcher subscribes.
    pub(super) put: Option<Instant>,
    pub(super) nudged: Instant,
}

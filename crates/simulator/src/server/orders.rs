//! Orders to the launcher: the faults of processes that are due.

use std::time::Instant;

use bus::Publisher;
use protocol::messages::{FaultKind, FaultOrder, ProcessOrder};
use protocol::{Epoch, RobotName, Tick};

/// Orders to the launcher.
pub(super) struct Orders {
    pub(super) publisher: Publisher,
    /// The order that has been carried out last.
    pub(super) done: Option<(Epoch, Tick)>,
    pub(super) has_complained: bool,
    /// Orders that began a fault which no order has ended.
    in_effect: Vec<ProcessOrder>,
}

impl Orders {
    pub(super) fn new(publisher: Publisher) -> Self {
        Self {
            publisher,
            done: None,
            has_complained: false,
            in_effect: Vec::new(),
        }
    }

    /// Notes orders that are about to be put.
    pub(super) fn note(&mut self, orders: &[ProcessOrder]) {
        for order in orders {
            // Whether it begins or ends: of a robot and a kind of fault there is one order in effect at
            // most.
            self.in_effect
                .retain(|begun| (&begun.robot, begun.kind) != (&order.robot, order.kind));
            if order.begins {
                self.in_effect.push(order.clone());
            }
        }
    }

    /// A process has joined as this robot: if the launcher has killed one for a time, that time is over.
    pub(super) fn joined(&mut self, robot: &RobotName) {
        self.in_effect.retain(|begun| {
            let is_over = begun.kind == FaultKind::Crash && begun.for_s.is_some();
            !(is_over && begun.robot == *robot)
        });
    }

    /// The orders that end all faults in effect, in two steps. A process that is to be killed, and perhaps is not yet, is killed
    /// first: otherwise it may join the next epoch and die in it.
    pub(super) fn ending_all(&self) -> [Vec<ProcessOrder>; 2] {
        let mut kills = Vec::new();
        let mut ends = Vec::new();
        for begun in &self.in_effect {
            if begun.kind == FaultKind::Crash {
                kills.push(ProcessOrder {
                    for_s: None,
                    ..begun.clone()
                });
            }

            ends.push(ProcessOrder {
                begins: false,
                for_s: None,
                ..begun.clone()
            });
        }
        [kills, ends]
    }

    /// The launcher has carried out an order.
    pub(super) fn done(&mut self, epoch: Epoch, tick: Tick) {
        self.done = Some((epoch, tick));
    }
}

/// An order that is being carried out.
pub(super) struct PendingOrders {
    pub(super) order: FaultOrder,
    /// What is ordered when it has been carried out.
    pub(super) then: Vec<ProcessOrder>,
    pub(super) begun: Instant,
    /// When it was put last; `None` while no launcher subscribes.
    pub(super) put: Option<Instant>,
    /// When the clock was repeated last, so that robots join again.
    pub(super) repeated: Instant,
}

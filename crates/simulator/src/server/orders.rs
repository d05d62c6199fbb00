//! Orders to the launcher: the faults of processes that are due.

use std::time::{Duration, Instant};

use bus::{Query, WatchedPublisher};
use protocol::messages::{FaultKind, FaultOrder, ProcessOrder};
use protocol::{Epoch, RobotName, Tick};

/// How long requests for the launcher wait for the one that has started this simulator: it connects when the simulator listens,
/// and people may be faster.
const ARRIVAL: Duration = Duration::from_secs(4);

/// Orders to the launcher.
pub(super) struct Orders {
    pub(super) publisher: WatchedPublisher,
    /// The order that has been carried out last.
    pub(super) done: Option<(Epoch, Tick)>,
    pub(super) has_complained: bool,
    /// Orders that began a fault which no order has ended, and when they were noted.
    in_effect: Vec<(ProcessOrder, Instant)>,
    /// Until when a launcher may come for which requests wait; `None` if no launcher has started this simulator.
    launcher_until: Option<Instant>,
    /// Requests that wait for it.
    pub(super) early: Vec<Query>,
}

impl Orders {
    /// No orders yet; `is_launched` is whether a launcher has started this simulator.
    pub(super) fn new(publisher: WatchedPublisher, is_launched: bool) -> Self {
        Self {
            publisher,
            done: None,
            has_complained: false,
            in_effect: Vec::new(),
            launcher_until: is_launched.then(|| Instant::now() + ARRIVAL),
            early: Vec::new(),
        }
    }

    /// Whether a launcher is about to subscribe.
    pub(super) fn is_launcher_to_come(&self) -> bool {
        let until = self.launcher_until;
        !self.publisher.has_subscribers() && until.is_some_and(|until| Instant::now() < until)
    }

    /// Notes orders that are about to be put.
    pub(super) fn note(&mut self, orders: &[ProcessOrder]) {
        for order in orders {
            // Whether it begins or ends: of a robot and a kind of fault there is one order in effect at
            // most.
            self.in_effect
                .retain(|(begun, _)| (&begun.robot, begun.kind) != (&order.robot, order.kind));
            if order.begins {
                self.in_effect.push((order.clone(), Instant::now()));
            }
        }
    }

    /// The fault by which the launcher keeps the process of a robot killed or stopped for a time that is not over.
    pub(super) fn holding_for_a_time(&self, robot: &RobotName) -> Option<FaultKind> {
        let mut in_effect = self.in_effect.iter();
        let (begun, _) = in_effect.find(|(begun, noted)| {
            let wall = begun
                .for_s
                .and_then(|for_s| Duration::try_from_secs_f64(for_s).ok());
            begun.robot == *robot
                && matches!(begun.kind, FaultKind::Crash | FaultKind::Hang)
                && wall.is_some_and(|wall| noted.elapsed() < wall)
        })?;
        Some(begun.kind)
    }

    /// A process has joined as this robot: if the launcher has killed one for a time, that time is over.
    pub(super) fn joined(&mut self, robot: &RobotName) {
        self.in_effect.retain(|(begun, _)| {
            let is_over = begun.kind == FaultKind::Crash && begun.for_s.is_some();
            !(is_over && begun.robot == *robot)
        });
    }

    /// The orders that end all faults in effect, in two steps. A process that is to be killed, and perhaps is not yet, is killed
    /// first: otherwise it may join the next epoch and die in it.
    pub(super) fn ending_all(&self) -> [Vec<ProcessOrder>; 2] {
        let mut kills = Vec::new();
        let mut ends = Vec::new();
        for (begun, _) in &self.in_effect {
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

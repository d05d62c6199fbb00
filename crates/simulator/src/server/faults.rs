//! The faults that a scenario has in store for processes. The simulator says what and when; the launcher does it; the clock
//! is held meanwhile, so that it happens between the same two ticks every time.

use std::time::{Duration, Instant};

use bus::Publisher;
use protocol::encode;
use protocol::messages::{FaultKind, FaultOrder, ProcessOrder};
use protocol::{Epoch, Tick};

use super::{Interrupt, REPEAT_AFTER, Server};
use crate::simulation::Simulation;

/// Longest wait for a launcher to carry out an order, and for a robot to go or to be back; then the run goes on and says
/// so.
const PATIENCE: Duration = Duration::from_secs(30);
/// Longest wait for a launcher to listen at all: it starts the simulator first, and a fast run may be ahead of it.
const LAUNCHER_PATIENCE: Duration = Duration::from_secs(10);
/// While waiting, this often is looked whether what is waited for has come about.
const LOOK: Duration = Duration::from_millis(250);

/// Orders to the launcher.
pub(super) struct Orders {
    publisher: Publisher,
    /// The order that has been carried out last.
    done: Option<(Epoch, Tick)>,
    has_complained: bool,
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

impl Server {
    /// Has the faults carried out that are due before the next tick.
    pub(super) fn carry_out_faults(
        &mut self,
        simulation: &mut Simulation,
    ) -> Result<(), Interrupt> {
        let orders = simulation.faults_due();
        if orders.is_empty() {
            return Ok(());
        }
        simulation.note_faults(&orders);
        if !self.has_launcher(simulation)? {
            return Ok(());
        }
        let order = FaultOrder {
            epoch: simulation.epoch(),
            tick: simulation.tick() + 1,
            orders,
        };
        let message = encode(&order);
        self.orders.publisher.put(message.clone())?;
        let (begun, mut repeated) = (Instant::now(), Instant::now());
        while !self.is_carried_out(&order) {
            if begun.elapsed() > PATIENCE {
                tracing::error!(
                    "the faults before tick {} were not carried out in time",
                    order.tick
                );
                return Ok(());
            }
            if repeated.elapsed() > REPEAT_AFTER {
                repeated = Instant::now();
                self.orders.publisher.put(message.clone())?;
                // Who was stopped for long may have nothing left to answer, and is known to be back when it answers.
                self.repeat_clock()?;
            }
            if let Some(event) = self.receive(LOOK) {
                self.handle(event, simulation)?;
            }
        }
        Ok(())
    }

    /// Whether somebody hears the orders. It is waited for once; if nobody comes, the run goes on and has said so.
    fn has_launcher(&mut self, simulation: &mut Simulation) -> Result<bool, Interrupt> {
        let begun = Instant::now();
        while !self.orders.publisher.has_subscribers() {
            if self.orders.has_complained {
                return Ok(false);
            }
            if begun.elapsed() > LAUNCHER_PATIENCE {
                self.orders.has_complained = true;
                tracing::error!(
                    "the scenario has faults of processes, and no launcher is here to carry them out"
                );
            }
            if let Some(event) = self.receive(LOOK) {
                self.handle(event, simulation)?;
            }
        }
        Ok(true)
    }

    /// Whether the launcher has done its part, and the robots are as they must be: a killed one is gone, one whose fault is
    /// over is back.
    fn is_carried_out(&self, order: &FaultOrder) -> bool {
        let is_so = |order: &ProcessOrder| {
            let Some(member) = self.members.get(&order.robot) else {
                return true;
            };
            match (order.kind, order.begins) {
                (FaultKind::Crash, true) => !member.is_present,
                (_, true) => true,
                (_, false) => member.is_back(),
            }
        };
        self.orders.done == Some((order.epoch, order.tick)) && order.orders.iter().all(is_so)
    }
}

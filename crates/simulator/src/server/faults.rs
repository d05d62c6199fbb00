//! The faults that a scenario has in store for processes. The simulator orders them, the launcher carries them out, and the
//! clock is held meanwhile, so that each happens between the same two ticks every time.

use std::time::{Duration, Instant};

use bus::BusError;
use protocol::messages::{FaultKind, FaultOrder, ProcessOrder};
use protocol::{Epoch, RobotName, Tick, encode};

use super::live::{LiveRun, WaitsFor};
use super::orders::PendingOrders;

/// Longest wait for a launcher to carry out an order, and for a robot to go or to come back; then the run goes on and logs
/// that it did.
pub(super) const TIMEOUT: Duration = Duration::from_secs(30);
/// Longest wait for a launcher to subscribe: it starts the simulator first, and a fast run may be ahead of it.
const LAUNCHER_TIMEOUT: Duration = Duration::from_secs(10);
/// How often to check whether what the clock is held for has happened.
pub(super) const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// A robot whose hang is over is asked to join again this often, and counts as back when it has joined.
pub(super) const REJOIN_INTERVAL: Duration = Duration::from_millis(100);

impl LiveRun {
    /// Begins to have the faults carried out that are due before the next tick, and the restarts, if there are any.
    pub(super) fn order_faults(&mut self) -> Option<PendingOrders> {
        let simulation = &mut self.epoch.simulation;
        let mut orders = simulation.faults_due();
        let lateness = self.barrier.lateness();
        // Before the orders of restarts are added: a restart has events of its own kind, whatever the
        // launcher is told.
        simulation.note_faults(&orders, |robot| lateness.of(robot));

        // A restart takes two orders. The second one follows when the process is gone, so that its
        // successor finds the name free.
        let mut then = Vec::new();
        for robot in simulation.restarts_due() {
            orders.push(restart_order(&robot, true));
            then.push(restart_order(&robot, false));
        }
        let next = (simulation.epoch(), simulation.tick() + 1);
        (!orders.is_empty()).then(|| self.pending_orders(next, orders, then))
    }

    /// Begins to end the faults of an epoch that is over, before tick 0 of the next one, if there are any.
    pub(super) fn order_end_of_faults(&mut self, epoch: Epoch) -> Option<PendingOrders> {
        let [kills, ends] = self.orders.ending_all();
        if kills.is_empty() {
            return (!ends.is_empty()).then(|| self.pending_orders((epoch, 0), ends, Vec::new()));
        }
        Some(self.pending_orders((epoch, 0), kills, ends))
    }

    /// Has the fault of a robot ended for which the open tick waits. Only the wall clock would have ended it, so the record does
    /// not change.
    pub(super) fn recover_now(
        &mut self,
        robot: &RobotName,
        kind: FaultKind,
    ) -> Result<(), BusError> {
        let simulation = &self.epoch.simulation;
        let orders = vec![ProcessOrder {
            robot: robot.clone(),
            kind,
            begins: false,
            for_s: None,
        }];

        self.orders.note(&orders);
        self.orders.publisher.put(encode(&FaultOrder {
            epoch: simulation.epoch(),
            tick: simulation.tick() + 1,
            orders,
        }))
    }

    /// Begins to have orders carried out, and then others.
    fn pending_orders(
        &mut self,
        (epoch, tick): (Epoch, Tick),
        orders: Vec<ProcessOrder>,
        then: Vec<ProcessOrder>,
    ) -> PendingOrders {
        // Before the order is put, so that the barrier knows why a token goes.
        for order in &orders {
            self.barrier.fault(&order.robot, order.lasting());
        }
        self.orders.note(&orders);

        // An order that follows another one is of the same tick: the answer to the first must not count
        // for it.
        self.orders.done = None;
        let now = Instant::now();
        PendingOrders {
            order: FaultOrder {
                epoch,
                tick,
                orders,
            },
            then,
            begun: now,
            put: None,
            repeated: now,
        }
    }

    /// Goes on with the order that is pending. Returns how long to wait before looking again; `None` when it is carried out.
    pub(super) fn await_faults(&mut self) -> Result<Option<Duration>, BusError> {
        let WaitsFor::Faults(pending_orders) = &mut self.epoch.waits_for else {
            return Ok(None);
        };
        let Some(put) = pending_orders.put else {
            let begun = pending_orders.begun;
            return self.await_launcher(begun);
        };
        let tick = pending_orders.order.tick;
        if pending_orders.begun.elapsed() > TIMEOUT {
            tracing::error!("the faults before tick {tick} were not carried out in time");
            return Ok(None);
        }

        if put.elapsed() > self.repeat_after {
            pending_orders.put = Some(Instant::now());
            self.orders.publisher.put(encode(&pending_orders.order))?;
        }
        let is_done = self.orders.done == Some((pending_orders.order.epoch, tick));
        // Two things must hold: the launcher says that it has done its part, and the tokens show what
        // came of it.
        let mut is_carried_out = is_done;
        for order in &pending_orders.order.orders {
            // Before tick 0 robots are gathered, which waits for those whose faults are over.
            let is_gathered = tick == 0 && !order.begins;
            is_carried_out &= is_gathered || is_in_effect(&self.barrier, order);
        }
        if is_carried_out {
            let then = std::mem::take(&mut pending_orders.then);
            if then.is_empty() {
                return Ok(None);
            }
            let before = (pending_orders.order.epoch, tick);
            let pending_orders = self.pending_orders(before, then, Vec::new());
            self.epoch.waits_for = WaitsFor::Faults(pending_orders);
            return Ok(Some(Duration::ZERO));
        }
        // A robot whose hang is over finds in the clock that it is asked to join again.
        if is_done && pending_orders.repeated.elapsed() > REJOIN_INTERVAL {
            pending_orders.repeated = Instant::now();
            self.barrier.repeat(&mut self.outputs);
        }
        Ok(Some(POLL_INTERVAL))
    }

    /// Puts the order as soon as a launcher subscribes. If none does in time, the run goes on and has logged it.
    fn await_launcher(&mut self, begun: Instant) -> Result<Option<Duration>, BusError> {
        if self.orders.publisher.has_subscribers() {
            if let WaitsFor::Faults(pending_orders) = &mut self.epoch.waits_for {
                pending_orders.put = Some(Instant::now());
                self.orders.publisher.put(encode(&pending_orders.order))?;
            }
            return Ok(Some(POLL_INTERVAL));
        }

        // It is waited for once: without a launcher, later faults do not hold the clock.
        if self.orders.has_complained {
            return Ok(None);
        }
        if begun.elapsed() > LAUNCHER_TIMEOUT {
            self.orders.has_complained = true;
            tracing::error!(
                "the scenario has faults of processes, and there is no launcher to carry them out"
            );
        }

        Ok(Some(POLL_INTERVAL))
    }
}

/// The order that kills the process of a robot that starts again, or the one that starts it.
fn restart_order(robot: &RobotName, begins: bool) -> ProcessOrder {
    ProcessOrder {
        robot: robot.clone(),
        kind: FaultKind::Crash,
        begins,
        for_s: None,
    }
}

/// Whether a robot is as the order wants it: a killed one is disconnected, one whose fault is over can take part again.
fn is_in_effect<R: Clone, C: Clone>(
    barrier: &lockstep::Barrier<R, C>,
    order: &ProcessOrder,
) -> bool {
    match (order.kind, order.begins) {
        (FaultKind::Crash, true) => !barrier.is_present(&order.robot),
        (_, true) => true,
        (_, false) => barrier.is_back(&order.robot),
    }
}

//! Faults of processes: what is due before a tick, which processes are held, and the record of it.

use std::collections::BTreeSet;

use protocol::messages::{FaultKind, HeldProcess, OnLate, ProcessOrder};
use protocol::{Event, RobotName};
use scenario::{FaultEnd, Lateness};

use super::Simulation;

impl Simulation {
    /// The rules for late robots that a change makes before the next tick; `None` if there is no change.
    #[must_use]
    pub fn lateness_due(&self) -> Option<&Lateness> {
        let mut due = self.scenario.changes_at(self.tick + 1);
        due.next()?;
        Some(self.scenario.lateness_at(self.tick + 1))
    }

    /// The fault that may hold the process of a robot for which the open tick waits, until the wall clock ends it. A process
    /// that is told to stop may do another tick or two before it does.
    #[must_use]
    pub fn held_by_wall_clock(&self, robot: &RobotName) -> Option<FaultKind> {
        let faults = self.scenario.faults_at(self.now).iter();
        let mut begun = faults.filter(|fault| fault.robot == *robot && fault.at <= self.now);
        let last = begun.next_back()?;
        matches!(last.end, FaultEnd::After(_)).then_some(last.kind)
    }

    /// Robots whose processes a fault holds in the tick in progress, or in the last one; `late` are those for which the clock
    /// is held.
    #[must_use]
    pub fn held_processes(&self, late: &[RobotName]) -> Vec<HeldProcess> {
        let is_complete = self.now == self.tick;
        let mut held = Vec::new();

        for fault in self.scenario.faults_at(self.now) {
            if fault.holds(self.now, is_complete) {
                held.push(HeldProcess {
                    robot: fault.robot.clone(),
                    kind: fault.kind,
                });
            }
        }

        for robot in late {
            let is_told = held.iter().any(|held| held.robot == *robot);
            if let Some(kind) = self.held_by_wall_clock(robot).filter(|_| !is_told) {
                held.push(HeldProcess {
                    robot: robot.clone(),
                    kind,
                });
            }
        }

        held
    }

    /// The orders that the launcher must carry out before the next tick, in the order of the scenario.
    #[must_use]
    pub fn faults_due(&self) -> Vec<ProcessOrder> {
        let tick = self.tick + 1;
        let mut due = Vec::new();
        for fault in self.scenario.faults_at(tick) {
            if fault.at == tick && !fault.is_restart() {
                due.push(fault.begin_order());
            }
            if fault.end == FaultEnd::At(tick) {
                due.push(fault.end_order());
            }
        }
        due
    }

    /// Robots that start again before the next tick, as further incarnations.
    #[must_use]
    pub fn restarts_due(&self) -> BTreeSet<RobotName> {
        self.scenario.restarts_at(self.tick + 1)
    }

    /// Records orders that are carried out before the next tick, as part of it. A robot whose process they stop, and without
    /// which the clock goes on by its rule for late robots, cannot be queried in that tick.
    pub fn note_faults(&mut self, orders: &[ProcessOrder], on_late: impl Fn(&RobotName) -> OnLate) {
        let wanted = self.scenario.restarts_wanted_at(self.tick + 1);
        for robot in wanted.intersection(&self.restarts_due()) {
            for begins in [true, false] {
                self.between.push(Event::Fault {
                    robot: robot.clone(),
                    kind: FaultKind::Restart,
                    begins,
                });
            }
        }

        for order in orders {
            let is_stopped = matches!(order.lasting(), Some(FaultKind::Crash | FaultKind::Hang));
            if is_stopped && on_late(&order.robot) == OnLate::Continue {
                self.stop(&order.robot);
            }

            self.between.push(Event::Fault {
                robot: order.robot.clone(),
                kind: order.kind,
                begins: order.begins,
            });
        }
    }

    /// The scenario stops the process of a robot before the next tick, and the clock goes on without it.
    pub fn stop(&mut self, robot: &RobotName) {
        self.stopped.push(robot.clone());
    }
}

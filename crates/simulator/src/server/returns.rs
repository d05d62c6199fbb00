//! Who takes part while a run is executed again. The record has which robots missed which ticks, whatever the reason was, and
//! where they returned; their processes are here all the time. So a robot that was lost is asked to join again, as after a hang
//! of the scenario, and the clock is held before the tick of its return until it has. A robot that went on where it was does
//! not get the ticks that it did not do, and its answers to those that it did too late do not count, as then.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use lockstep::Outcome;
use protocol::RobotName;
use protocol::messages::{CommandText, Report};

use super::faults::{LOOK, NUDGE, PATIENCE};
use super::past::{RejoinWait, ReplayLog};
use super::process::{Server, Stage};
use crate::simulation::Simulation;

impl Server {
    /// Says who takes part in the tick that is opened next, while the run is executed again.
    pub(super) fn recall(&mut self) {
        let attendance = self.past.as_ref().map(ReplayLog::attendance);
        self.barrier.recall(attendance);
    }

    /// Takes the answers away that came too late when the tick was recorded.
    pub(super) fn take_late(
        &self,
        outcome: &mut Outcome<Arc<Report>, CommandText>,
        simulation: &mut Simulation,
    ) {
        let Some(past) = &self.past else { return };
        outcome.reports.retain(|robot, (report, _)| {
            let is_late = past.is_done_late(robot, report.tick);
            if is_late {
                simulation.done_late(robot, report.tick);
            }
            !is_late
        });
    }

    /// Holds the clock until the robots are back that take part in the next tick as further incarnations; after the last tick
    /// of the record, until all are back. Those whose processes the scenario keeps from running come back as it has it.
    pub(super) fn hold_for_returns(&mut self) {
        let mut robots: BTreeSet<RobotName> = match &self.past {
            Some(past) => past.joined().cloned().collect(),
            None => self.barrier.roster().cloned().collect(),
        };
        robots.retain(|robot| !self.barrier.is_stopped(robot));

        if self.is_repeating() {
            // One that is here, and was killed and replaced between two ticks then, has not been asked yet.
            for robot in &robots {
                self.barrier.ask_to_rejoin(robot);
            }
        }

        self.stage = Stage::Returns(RejoinWait {
            robots,
            begun: Instant::now(),
            asked: None,
        });
    }

    /// Looks whether the robots are back for which the clock is held. Returns how long to wait before looking again; `None` if
    /// they are, or have not come in time.
    pub(super) fn await_returns(&mut self) -> Option<Duration> {
        let Stage::Returns(returning) = &mut self.stage else {
            return None;
        };
        let barrier = &self.barrier;
        returning.robots.retain(|robot| !barrier.is_back(robot));
        if returning.robots.is_empty() {
            return None;
        }
        if returning.begun.elapsed() > PATIENCE {
            for robot in &returning.robots {
                tracing::error!("{robot} has not joined again in time");
            }
            return None;
        }

        if returning.asked.is_none_or(|asked| asked.elapsed() > NUDGE) {
            returning.asked = Some(Instant::now());
            self.barrier.repeat(&mut self.outputs);
        }
        Some(LOOK)
    }
}

//! Who takes part while a run is executed again. The record has which robots missed which ticks, whatever the reason was, and
//! where they returned; their processes are here all the time. So a robot that was lost is asked to join again, as after a hang
//! of the scenario, and the clock is held before the tick of its return until it has. A robot that went on where it was does
//! not get the ticks that it did not do, and its answers to those that it did too late do not count, as then.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bus::BusError;
use lockstep::TickOutcome;
use protocol::RobotName;
use protocol::messages::{CommandText, Report};

use super::faults::{POLL_INTERVAL, REJOIN_INTERVAL, TIMEOUT};
use super::live::{LiveRun, RejoinWait, WaitsFor};
use super::replay_log::ReplayLog;

impl LiveRun {
    /// Tells the barrier who takes part in the tick that is opened next, while the run is executed again.
    pub(super) fn recall_attendance(&mut self) {
        let attendance = self.epoch.record.replay_log().map(ReplayLog::attendance);
        self.barrier.recall(attendance);
    }

    /// Drops the answers that came too late when the tick was recorded.
    pub(super) fn drop_late(&mut self, outcome: &mut TickOutcome<Arc<Report>, CommandText>) {
        let Some(replay_log) = self.epoch.record.replay_log() else {
            return;
        };
        let simulation = &mut self.epoch.simulation;
        outcome.reports.retain(|robot, (report, _)| {
            let is_late = replay_log.is_done_late(robot, report.tick);
            if is_late {
                simulation.done_late(robot, report.tick);
            }
            !is_late
        });
    }

    /// Holds the clock until the robots are back that take part in the next tick as further incarnations. Only once its faults have
    /// been carried out: a robot that one has just killed, or brought back, then is not asked before, as a predecessor.
    ///
    /// # Errors
    /// [`BusError`] if an order cannot be put.
    pub(super) fn hold_for_rejoins(&mut self) -> Result<(), BusError> {
        let replay_log = self.epoch.record.replay_log();
        let joined = replay_log.iter().flat_map(|replay_log| replay_log.joined());
        let mut robots: BTreeSet<RobotName> = joined.cloned().collect();
        robots.retain(|robot| !self.barrier.is_stopped(robot));
        for robot in &robots {
            // One that is here, and was killed and replaced between two ticks then, has not been asked yet.
            self.barrier.ask_to_rejoin(robot);
        }
        // Whoever does this tick was not held any more, by whatever clock: that a person or a time of the launcher's ended a fault
        // while the clock waited is no event.
        let absent = replay_log.map(|replay_log| replay_log.attendance().absent);
        let absent = absent.unwrap_or_default();
        let held = self.barrier.roster().filter_map(|robot| {
            let kind = self.orders.holding_for_a_time(robot)?;
            (!absent.contains(robot)).then(|| (robot.clone(), kind))
        });
        for (robot, kind) in held.collect::<Vec<_>>() {
            self.recover_now(&robot, kind)?;
        }

        self.epoch.waits_for = WaitsFor::Rejoins(RejoinWait::begin(robots));
        Ok(())
    }

    /// Holds the clock after the last tick of the record until all robots are back whose processes no fault keeps from running.
    pub(super) fn hold_for_all(&mut self) {
        let mut robots: BTreeSet<RobotName> = self.barrier.roster().cloned().collect();
        robots.retain(|robot| {
            let is_killed = self.orders.holding_for_a_time(robot).is_some();
            !is_killed && !self.barrier.is_stopped(robot)
        });
        self.epoch.waits_for = WaitsFor::Rejoins(RejoinWait::begin(robots));
    }

    /// Checks whether the robots are back for which the clock is held. Returns how long to wait before looking again; `None` if
    /// they are, or have not come in time.
    pub(super) fn await_rejoins(&mut self) -> Option<Duration> {
        let WaitsFor::Rejoins(wait) = &mut self.epoch.waits_for else {
            return None;
        };
        let barrier = &self.barrier;
        // One that is back stays back: nothing is granted meanwhile that it could miss.
        wait.robots.retain(|robot| !barrier.is_back(robot));
        if wait.robots.is_empty() {
            return None;
        }
        if wait.begun.elapsed() > TIMEOUT {
            for robot in &wait.robots {
                tracing::error!("{robot} has not joined again in time");
            }
            return None;
        }

        if wait
            .asked
            .is_none_or(|asked| asked.elapsed() > REJOIN_INTERVAL)
        {
            wait.asked = Some(Instant::now());
            self.barrier.repeat(&mut self.outputs);
        }
        Some(POLL_INTERVAL)
    }
}

//! The end of a run: whether the clock waits for ever, what is written and put at the end, and how long the process stays.

use std::time::{Duration, Instant};

use bus::BusError;
use protocol::event::WaitedFor;
use protocol::messages::{Awaited, Clock, End, LogKind, Reason};
use protocol::{RobotName, encode};
use record::RecordError;
use record::summary::Summary;

use super::control::handle;
use super::departed::{STANDBY, Wait};
use super::event::{ServerError, ServerEvent, StopReason};
use super::frontend::{Frontend, refuse};
use super::live::LiveRun;
use super::options::KeepAlive;
use super::record::EpochRecord;
use super::source::{Next, TickSource};

/// How long the simulator waits at the end of a run for the robots to leave.
const LEAVE_TIMEOUT: Duration = Duration::from_secs(1);

impl LiveRun {
    /// Whether the clock waits for a robot whose process has ended for good.
    pub(super) fn endless_wait(&self) -> Wait {
        let mut wait = Wait::Bounded;
        // Nearly always so, and this is asked in every turn of the loop.
        if self.departed.is_empty() {
            return wait;
        }

        for (robot, reason) in self.barrier.awaited() {
            let is_gone = matches!(reason, Reason::Gone | Reason::NotJoined);
            if !is_gone || self.departed.because(&robot).is_none() {
                continue;
            }
            // Its successor declares its token, or a timer of the barrier ends the reservation.
            if self.barrier.is_reserved(&robot) {
                wait = Wait::Standby(STANDBY);
                continue;
            }
            // One robot that does not come is enough. The others only say when to look again.
            match self.departed.standby_left(&robot) {
                None => return Wait::Endless,
                Some(left) => wait = Wait::Standby(left),
            }
        }
        wait
    }

    /// The robots for which the clock waits now, and what is known of them.
    pub(super) fn awaiting(&self, since: Instant) -> Vec<Awaited> {
        let since_s = since.elapsed().as_secs_f64();
        let mut awaiting = Vec::new();
        for (name, because) in self.barrier.awaited() {
            awaiting.push(Awaited {
                name,
                since_s,
                because,
            });
        }

        awaiting
    }

    /// The robots for which the clock waits at the end, and why.
    fn waited_for(&self) -> Vec<WaitedFor> {
        let mut waited_for = Vec::new();
        for (robot, reason) in self.barrier.awaited() {
            let is_gone = matches!(reason, Reason::Gone | Reason::NotJoined);
            let ended = self.departed.because(&robot).filter(|_| is_gone);
            let because = ended.map_or(reason, |ended| Reason::Ended(ended.to_owned()));
            waited_for.push(WaitedFor { robot, because });
        }
        waited_for
    }

    /// Ends the run, if it has not ended yet, and writes what came of it.
    fn end(&mut self, end: End, frontend: &mut Frontend) -> Result<Summary, RecordError> {
        if let EpochRecord::Closed(summary) = &self.epoch.record {
            return Ok(summary.as_ref().clone());
        }
        frontend.pace.end();
        self.answer_stepping(frontend);

        let mut waited_for = Vec::new();
        let tick = self.epoch.simulation.tick();
        if end == End::Aborted {
            waited_for = self.waited_for();
            for robot in &waited_for {
                tracing::error!("the run is aborted after tick {tick}, because {robot}");
            }
        }
        let epoch = &mut self.epoch;
        let wall = std::mem::take(&mut epoch.wall);
        let (lines, summary) = epoch
            .record
            .close(end, waited_for, &mut epoch.simulation, wall)?;
        frontend.observers.log(&lines);
        self.put_frame(frontend);
        Ok(summary)
    }

    /// Whether the process stays now that the run is over.
    pub(super) fn stays(&self) -> bool {
        match self.stay {
            KeepAlive::Never => false,
            KeepAlive::Viewed => self.viewers.rest().is_none_or(|rest| !rest.is_zero()),
            KeepAlive::Always => true,
        }
    }

    /// Ends the run; the process stays.
    pub(super) fn end_and_stay(
        &mut self,
        end: End,
        frontend: &mut Frontend,
    ) -> Result<(), RecordError> {
        self.end(end, frontend)?;
        let status = self.status(frontend);
        frontend.observers.log_line(
            &status,
            LogKind::Run,
            "the run is over, and its processes stay: Init begins the next one, Stop ends them",
        );
        Ok(())
    }

    /// The run is over, and the process stays: it answers requests until one begins another epoch, or no browser shows the run
    /// any more.
    pub(super) fn linger(&mut self) -> Result<Next, StopReason> {
        // Nothing of the run is granted any more.
        self.outputs.clear();

        if !self.stays() {
            return Err(StopReason::End(End::Stopped));
        }
        let rest = self.viewers.rest();
        Ok(Next::Wait(rest.filter(|_| self.stay == KeepAlive::Viewed)))
    }

    /// Ends the run and this side of the contract. The end is put also if its record could not be written.
    pub(super) fn conclude(
        mut self,
        end: End,
        mut frontend: Frontend,
    ) -> Result<Summary, ServerError> {
        // Its failure is looked at last, so that the robots get to know the end in any case.
        let summary = self.end(end, &mut frontend);
        match (&summary, frontend.stopping.take()) {
            (Err(error), Some(query)) => refuse(&query, &error.to_string()),
            (_, query) => {
                frontend.stopping = query;
                self.answer_stopping(&mut frontend);
            }
        }
        self.leave(end, frontend)?;
        Ok(summary?)
    }

    /// Puts the end of the run, and ends this side of the contract when the robots have left.
    pub(super) fn leave(mut self, end: End, mut frontend: Frontend) -> Result<(), BusError> {
        let clock = self.barrier.end(end);
        let put = self.clock.put(encode(&clock));
        self.await_departures(&clock, &mut frontend);
        frontend.close();
        put
    }

    /// Waits for the robots to leave, for a limited time. A robot whose link has just lost the end of the run gets it again.
    fn await_departures(&mut self, clock: &Clock, frontend: &mut Frontend) {
        let deadline = Instant::now() + LEAVE_TIMEOUT;
        let simulation = &self.epoch.simulation;
        let mut awaited: Vec<RobotName> = Vec::new();
        for name in self.barrier.roster() {
            // Also one that has just reported and seems to be gone: its link may come back, and it
            // would wait for a further tick.
            let took_part = simulation
                .report(name)
                .is_some_and(|report| report.tick == simulation.tick());
            if self.barrier.is_present(name) || took_part {
                awaited.push(name.clone());
            }
        }

        while !awaited.is_empty() && Instant::now() < deadline {
            let until = deadline.min(Instant::now() + self.repeat_after);
            match frontend.inbox.take_until(until) {
                Some(ServerEvent::Token {
                    robot,
                    is_present: false,
                }) => awaited.retain(|name| name.as_str() != robot),
                Some(ServerEvent::Token { .. }) | None => {
                    if let Err(error) = self.clock.put(encode(clock)) {
                        tracing::debug!("{error}");
                    }
                }
                // The run is over: nothing else changes anything any more.
                Some(event) => {
                    drop(handle(event, self, frontend));
                    self.answer_stopping(frontend);
                }
            }
        }
    }
}

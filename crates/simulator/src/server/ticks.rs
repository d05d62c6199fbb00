//! The ticks of a run whose robots are in lock-step: when one is opened, and what comes of it.

use std::sync::Arc;
use std::time::Instant;

use bus::BusError;
use environment::static_world;
use lockstep::{BarrierOutput, IncarnationNotice, MissingCommand, TickOutcome};
use protocol::keys::STATE;
use protocol::messages::{Clock, CommandText, End, Reason, Report};
use protocol::{RobotName, Tick, encode};
use record::RecordError;

use super::control::on_control;
use super::event::{EpochStop, StopReason};
use super::frame::frame;
use super::frontend::Frontend;
use super::live::{LiveRun, WaitsFor};
use super::observers::TickVisibility;
use super::source::{Next, TickSource};
use super::watchdog::Activity;

impl LiveRun {
    /// Opens the next tick if it is due, or finds out how long to wait at most before looking again.
    pub(super) fn open_next_tick(&mut self, frontend: &mut Frontend) -> Result<Next, EpochStop> {
        match &self.epoch.waits_for {
            WaitsFor::Robots => return Ok(Next::Wait(self.timers.next(Instant::now()))),
            WaitsFor::Rejoins(_) => {
                if let Some(rest) = self.await_rejoins() {
                    return Ok(Next::Wait(Some(rest)));
                }
                // After the last tick of the record, the next one is not due yet.
                if !self.epoch.record.is_repeating() {
                    self.epoch.waits_for = WaitsFor::Pace;
                    return Ok(Next::GoOn);
                }
            }
            WaitsFor::Pace => {
                let tick_s = self.epoch.simulation.scenario().tick_s;
                // A run that is executed again goes as fast as its robots answer.
                if !self.epoch.record.is_repeating()
                    && let Err(rest) = frontend.pace.take_grant(tick_s)
                {
                    return Ok(Next::Wait(rest));
                }
                // Changes first: they may be about late robots, and about faults.
                self.repeat_changes();
                self.follow_lateness();
                if let Some(pending_orders) = self.order_faults() {
                    self.epoch.waits_for = WaitsFor::Faults(pending_orders);
                    return Ok(Next::GoOn);
                }
            }
            WaitsFor::Faults(pending_orders) => {
                let is_before_tick_zero = pending_orders.order.tick == 0;
                if let Some(rest) = self.await_faults()? {
                    return Ok(Next::Wait(Some(rest)));
                }
                if is_before_tick_zero {
                    self.gather();
                    return Ok(Next::GoOn);
                }
            }
        }

        // While a run is executed again, robots join again after the faults of the tick, whether it has any or not.
        let has_held = matches!(self.epoch.waits_for, WaitsFor::Rejoins(_));
        if self.epoch.record.is_repeating() && !has_held {
            self.hold_for_rejoins()?;
            return Ok(Next::GoOn);
        }

        // Nothing holds the clock any more. The operator's commands are sent between two ticks, so that
        // they arrive in the one that begins now.
        let epoch = &mut self.epoch;
        let commands = match epoch.record.replay_log() {
            Some(replay_log) => replay_log.commands(),
            None => std::mem::take(&mut epoch.operator),
        };
        for command in commands {
            epoch.simulation.command(command);
        }
        let tick = epoch.simulation.begin_tick();
        self.open_tick(tick, frontend);
        // Interventions that waited while faults were carried out: this tick has begun, so they are for the one after it.
        for query in std::mem::take(&mut self.epoch.deferred) {
            on_control(query, self, frontend)?;
        }
        Ok(Next::GoOn)
    }

    fn open_tick(&mut self, tick: Tick, frontend: &mut Frontend) {
        self.epoch.waits_for = WaitsFor::Robots;
        self.epoch.waiting_since = Instant::now();
        // Decided before the clock is put, which asks for the panels: then they are here before the tick is complete. The clock stops
        // after the last of the steps that are pending, and after the last tick of the run.
        let is_last = frontend.pace.is_held() || tick == self.epoch.simulation.scenario().ticks;
        let is_paced = frontend.pace.speed.is_some();
        self.epoch.visibility = frontend.observers.begin_tick(is_last, is_paced);
        // Before the barrier opens the tick, and by this decides for whom it waits.
        self.recall_attendance();
        let news = self.epoch.simulation.robots_with_news();
        self.barrier.open(tick, news, &mut self.outputs);
    }

    /// While a run is executed again, what was done by hand is done again.
    fn repeat_changes(&mut self) {
        let Some(replay_log) = self.epoch.record.replay_log() else {
            return;
        };
        let changes = replay_log.changes_by_hand();
        if let Err(reason) = self.epoch.simulation.repeat_changes(&changes) {
            // The tick differs from its record then, which ends the repetition.
            tracing::error!("what was done by hand cannot be done again: {reason}");
        }
    }

    /// What a change sets for late robots holds from its tick on.
    fn follow_lateness(&mut self) {
        let Some(due) = self.epoch.simulation.lateness_due() else {
            return;
        };
        let mut lateness = self.barrier.lateness().clone();
        lateness.on_late = due.on_late;
        lateness.own.clone_from(&due.own);
        self.barrier.set_lateness(lateness, &mut self.outputs);
    }

    /// Carries out what the barrier wants done, also what it wants because of that.
    pub(super) fn carry_out(&mut self, frontend: &mut Frontend) -> Result<(), StopReason> {
        // Until nothing is left: `Gathered`, for example, opens tick 0, which is granted by a further
        // output.
        while !self.outputs.is_empty() {
            for output in std::mem::take(&mut self.outputs) {
                match output {
                    // The faults of the epoch before are ended first, and then robots are gathered once more.
                    BarrierOutput::Gathered
                        if matches!(self.epoch.waits_for, WaitsFor::Faults(_)) => {}
                    BarrierOutput::Gathered => self.open_tick_zero(frontend),
                    BarrierOutput::Grant { news, clock } => self.put(&news, clock)?,
                    BarrierOutput::Complete(outcome) => self.complete(outcome, frontend)?,
                    BarrierOutput::StandIn(robot) => self.stand_in(&robot, frontend)?,
                    BarrierOutput::Held => self.report_held(frontend),
                    BarrierOutput::Released => self.report_released(frontend),
                    BarrierOutput::Aborted => return Err(StopReason::End(End::Aborted)),
                    BarrierOutput::SetTimer(timer, after) => {
                        self.timers.set(timer, after, Instant::now());
                    }
                    BarrierOutput::Ignored(reason, robot) => {
                        self.ignore(reason.as_str(), robot.as_str());
                    }
                }
            }
        }

        Ok(())
    }

    /// Puts what a robot would have answered: those that follow its state wait for it no longer.
    fn stand_in(&self, robot: &RobotName, frontend: &Frontend) -> Result<(), BusError> {
        let Some(state) = self.epoch.simulation.last_state(robot) else {
            return Ok(());
        };
        let key = frontend.keys.query(robot, STATE);
        frontend.bus.put(&key, encode(&state))
    }

    /// Every robot of the roster is connected.
    fn open_tick_zero(&mut self, frontend: &mut Frontend) {
        self.epoch.simulation.begin_init();
        self.open_tick(0, frontend);
    }

    /// News first, then the clock: on one session they arrive in this order.
    fn put(
        &mut self,
        news: &[(RobotName, IncarnationNotice)],
        clock: Clock,
    ) -> Result<(), BusError> {
        for (name, notice) in news {
            if let Some(publisher) = self.news.get(name) {
                publisher.put(encode(&self.epoch.simulation.news(name, *notice)))?;
            }
        }

        let panels = self.epoch.visibility != TickVisibility::Hidden;
        let clock = Clock { panels, ..clock };
        let is_same = |put: Clock| (put.epoch, put.tick) == (clock.epoch, clock.tick);
        if self.epoch.clock.is_some_and(is_same) {
            self.epoch.asked_again = Some(clock.tick);
        }
        self.epoch.clock = Some(clock);
        self.clock.put(encode(&clock))
    }

    /// Asks for the panels of the tick that is complete, if they were not asked for: the clock stops after it.
    fn ask_for_panels(&mut self) -> Result<(), BusError> {
        // Robots that are in the next tick already have no panel of this one any more.
        if self.barrier.is_open() {
            return Ok(());
        }
        let Some(clock) = self.epoch.clock.as_mut().filter(|clock| !clock.panels) else {
            return Ok(());
        };

        clock.panels = true;
        self.epoch.asked_again = Some(clock.tick);
        self.clock.put(encode(clock))
    }

    /// A tick is complete.
    fn complete(
        &mut self,
        mut outcome: TickOutcome<Arc<Report>, CommandText>,
        frontend: &mut Frontend,
    ) -> Result<(), StopReason> {
        // First, because it measures until now how long the tick was held.
        self.count_stragglers();
        // Before the tick ends: what does not count must not reach the events.
        self.drop_late(&mut outcome);
        let epoch = &mut self.epoch;
        let record = epoch.simulation.end_tick(outcome);
        frontend.observers.note(record.tick, &record.events);

        self.watchdog.note(Some(Activity::Record));
        // At full speed a tick is written while the robots run the next one: at the end of this work, after the next clock.
        let is_written = !frontend.pace.is_at_full_speed();
        let opened = epoch.waiting_since;
        let lines = epoch
            .record
            .note(&epoch.simulation, &record, opened, is_written)?;
        self.watchdog.note(Some(Activity::Work));
        frontend.observers.log(&lines);

        epoch.waits_for = WaitsFor::Pace;
        if epoch.record.is_repeating() {
            // After the last tick of the record the run goes on as a new one, at its pace.
            if epoch.record.compare(&record)? {
                frontend.pace.ready();
                tracing::info!("resumed after tick {}", record.tick);
                self.hold_for_all();
            }
        } else if record.tick == 0 {
            frontend.pace.ready();
        }

        self.answer_reached(record.tick, frontend);
        if self.epoch.visibility == TickVisibility::Frame || frontend.pace.is_held() {
            self.show(frontend);
        }
        Ok(())
    }

    /// Writes the tick that is complete and not written, if there is one.
    pub(super) fn write_noted(&mut self) -> Result<(), RecordError> {
        let Some(recorder) = self.epoch.record.pending() else {
            return Ok(());
        };
        self.watchdog.note(Some(Activity::Record));
        recorder.write_noted()
    }

    /// Shows observers how things stand.
    pub(super) fn put_frame(&mut self, frontend: &mut Frontend) {
        if let Err(error) = self.ask_for_panels() {
            tracing::debug!("{error}");
        }
        let status = self.status(frontend);
        let held = self.robots_held_for_a_time();
        let simulation = &self.epoch.simulation;
        let frame = frame(simulation, &status, held);
        frontend
            .observers
            .put(frame, || static_world(simulation.scenario()));
    }

    /// The clock is held: tells people for which robots, and answers a client that waits for a step.
    fn report_held(&mut self, frontend: &mut Frontend) {
        // Those for whom people were told first: who is awaited may change until the tick is complete.
        if self.epoch.stragglers.is_empty() && self.barrier.is_open() {
            for (name, reason) in self.barrier.awaited() {
                if !matches!(reason, Reason::WaitsFor(_)) {
                    self.epoch.stragglers.push(name);
                }
            }
        }

        let status = self.status(frontend);
        let line = frontend.observers.log_held(&status);
        let is_logged = line.is_some();
        if let Some(observed) = self.epoch.record.observed() {
            line.into_iter().for_each(|line| observed.late(line));
            observed.awaited = status.awaiting;
        }
        self.report_missing_commands(frontend);
        if is_logged {
            self.put_frame(frontend);
        }
        self.answer_stepping(frontend);
    }

    /// Tells people which commands the open tick waits for, once for each robot in an epoch. They may only be lost. But a robot that
    /// puts them with other numbers, or as another incarnation, does so again and again, and has reported as far as it knows.
    pub(super) fn report_missing_commands(&mut self, frontend: &mut Frontend) {
        for missing in self.barrier.missing_commands() {
            let MissingCommand {
                robot,
                counted,
                number,
            } = missing;
            if !self.epoch.told_missing.insert(robot.clone()) {
                continue;
            }

            let status = self.status(frontend);
            // The tick that is open, not the one that is complete.
            let tick = self.epoch.clock.map_or(status.tick, |clock| clock.tick);
            let text = format!(
                "{robot} counts {counted} in `commands` of its report of tick {tick}, but no command with the number {number} has \
                 arrived: if the clock waits on after it has been repeated, have the robot number its commands of a tick from 1 over all \
                 targets, and put each with the epoch, tick and generation of the report"
            );
            let line = frontend.observers.log_late(&status, &text);
            if let Some(observed) = self.epoch.record.observed() {
                observed.late(line);
            }
        }
    }

    fn report_released(&mut self, frontend: &mut Frontend) {
        let status = self.status(frontend);
        let line = frontend.observers.log_late(&status, "the clock goes on");
        if let Some(observed) = self.epoch.record.observed() {
            observed.late(line);
        }
        self.put_frame(frontend);
    }

    /// Counts the tick that is complete for the robots that held it up.
    fn count_stragglers(&mut self) {
        let epoch = &mut self.epoch;
        let held_s = epoch.waiting_since.elapsed().as_secs_f64();
        for name in std::mem::take(&mut epoch.stragglers) {
            let held = epoch.wall.held_up_by.entry(name).or_default();
            held.ticks += 1;
            held.waited_s += held_s;
            held.longest_s = held.longest_s.max(held_s);
        }
    }
}

//! A run whose ticks take place now: robots in lock-step ([`lockstep::Barrier`]), and the [`Simulation`].

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Publisher, Query};
use environment::Simulation;
use lockstep::{Barrier, BarrierOutput, Sent, Timer, Timing};
use protocol::keys::Keys;
use protocol::messages::{
    Clock, Command, CommandText, Control, End, MAX_ENTRIES, Report, RobotStatus, Status, Target,
};
use protocol::{Epoch, RobotName, Tick, decode};
use record::RunFolder;
use record::summary::{Summary, WallSummary};
use scenario::Scenario;

use super::departed::{Departed, Wait};
use super::event::{EpochStop, ServerError, ServerEvent, StopReason};
use super::frontend::{Frontend, refuse};
use super::observers::TickVisibility;
use super::options::{KeepAlive, ServerOptions};
use super::orders::{Orders, PendingOrders};
use super::process::{Server, run_to_exit};
use super::record::EpochRecord;
use super::replay_log::ReplayLog;
use super::source::{Next, TickSource};
use super::timers::Timers;
use super::viewers::Viewers;
use super::watchdog::{Activity, Watchdog};

/// Most ticks that wait for no robot and are granted in one go: the thread that does it may be the one that receives.
const MAX_TICKS_AT_ONCE: Tick = 16;

/// A run whose ticks take place now.
pub struct LiveRun {
    pub(super) stay: KeepAlive,
    pub(super) repeat_after: Duration,
    folder: RunFolder,
    pub(super) clock: Publisher,
    pub(super) news: BTreeMap<RobotName, Publisher>,
    /// The subscriber to panels, while they are recorded: robots put them only if there is one.
    panels: Option<Declared>,
    pub(super) viewers: Viewers,
    pub(super) watchdog: Watchdog,

    // The robots' processes outlive an epoch, and so does what is known of them: who is connected or has reserved its name, which
    // timers run, which faults are in effect.
    pub(super) barrier: Barrier<Arc<Report>, CommandText>,
    pub(super) outputs: Vec<BarrierOutput<Arc<Report>, CommandText>>,
    pub(super) timers: Timers,
    pub(super) departed: Departed,
    pub(super) orders: Orders,
    /// Robots whose news list the bodies around them.
    pub(super) with_bodies: BTreeSet<RobotName>,
    /// Robots with the ranges of their rays in their news.
    pub(super) with_ranges: BTreeSet<RobotName>,

    pub(super) epoch: LiveEpoch,
    /// The tick at which the thread that works now stops for a moment.
    pause_at: Tick,
}

/// What belongs to one epoch: nothing of it reaches into the next one.
pub(super) struct LiveEpoch {
    pub(super) simulation: Simulation,
    pub(super) record: EpochRecord,
    pub(super) waits_for: WaitsFor,
    /// Since when the clock waits for robots.
    pub(super) waiting_since: Instant,
    /// The clock that was put last.
    pub(super) clock: Option<Clock>,
    /// What observers see of its tick.
    pub(super) visibility: TickVisibility,
    /// The last tick whose clock was put once more: robots repeat their answers, also when the tick is complete.
    pub(super) asked_again: Option<Tick>,
    /// Robots that hold the clock up: awaited when people were told, and not waiting for another robot.
    pub(super) stragglers: Vec<RobotName>,
    /// Robots of which people were told that commands are missing.
    pub(super) told_missing: BTreeSet<RobotName>,
    pub(super) wall: WallSummary,
    /// Commands of the operator that are sent at the next tick boundary.
    pub(super) operator: Vec<Sent<CommandText>>,
    /// Requests that wait until the next tick has begun.
    pub(super) deferred: Vec<Query>,
}

/// What an epoch waits for.
pub(super) enum WaitsFor {
    /// The robots: to join, or to report.
    Robots,
    /// Robots that have to join again, before or after the last tick of a run that is executed again.
    Rejoins(RejoinWait),
    /// The next tick to be due.
    Pace,
    /// The launcher, to carry out the faults that are due before the next tick.
    Faults(PendingOrders),
}

/// The robots for which the clock is held until they have joined again.
pub(super) struct RejoinWait {
    pub(super) robots: BTreeSet<RobotName>,
    pub(super) begun: Instant,
    /// When they were asked last; `None` if they have not been.
    pub(super) asked: Option<Instant>,
}

impl RejoinWait {
    pub(super) fn begin(robots: BTreeSet<RobotName>) -> Self {
        Self {
            robots,
            begun: Instant::now(),
            asked: None,
        }
    }
}

impl LiveEpoch {
    fn begin(
        scenario: Scenario,
        epoch: Epoch,
        folder: &RunFolder,
        frontend: &Frontend,
        replay_log: Option<ReplayLog>,
    ) -> Result<Self, ServerError> {
        let simulation = Simulation::new(scenario, epoch)?;
        let record = EpochRecord::begin(folder, &frontend.run, &simulation, replay_log)?;

        Ok(Self {
            simulation,
            record,
            waits_for: WaitsFor::Robots,
            waiting_since: Instant::now(),
            clock: None,
            visibility: TickVisibility::Hidden,
            asked_again: None,
            stragglers: Vec::new(),
            told_missing: BTreeSet::new(),
            wall: WallSummary::default(),
            operator: Vec::new(),
            deferred: Vec::new(),
        })
    }
}

impl Server<LiveRun> {
    /// Declares the simulator's side of the contract on an open bus, and begins to gather the robots of a run. With a replay log
    /// the epoch of its record is executed again and then resumed.
    ///
    /// # Errors
    /// [`ServerError`] if something cannot be declared, or the first epoch cannot begin.
    pub fn open(
        bus: Bus,
        scenario: Scenario,
        options: ServerOptions,
        folder: &RunFolder,
        replay_log: Option<ReplayLog>,
    ) -> Result<Self, ServerError> {
        let mut frontend = Frontend::new(bus, options.run, options.speed, options.is_paused)?;
        let bus = &frontend.bus;
        let keys = &frontend.keys;
        let mut news = BTreeMap::new();
        for name in scenario.robots.keys() {
            news.insert(name.clone(), bus.publisher(&keys.news(name))?);
        }
        let timing = Timing {
            repeat: options.repeat_after,
            ..Timing::default()
        };
        let barrier = Barrier::new(
            scenario.robots.keys().cloned(),
            scenario.lateness.to_lockstep(),
            timing,
            u32::try_from(MAX_ENTRIES).unwrap_or(u32::MAX),
        );
        let number = replay_log.as_ref().map_or(1, ReplayLog::epoch);

        let mut source = LiveRun {
            stay: options.stay,
            repeat_after: options.repeat_after,
            folder: folder.clone(),
            clock: bus.publisher(&keys.clock())?,
            news,
            panels: None,
            viewers: Viewers::default(),
            watchdog: Watchdog::start(|line| tracing::warn!("{line}")),
            barrier,
            outputs: Vec::new(),
            timers: Timers::default(),
            departed: Departed::default(),
            orders: Orders::new(bus.watched_publisher(&keys.faults())?, options.is_launched),
            with_bodies: BTreeSet::new(),
            with_ranges: BTreeSet::new(),
            epoch: LiveEpoch::begin(scenario, number, folder, &frontend, replay_log)?,
            pause_at: 0,
        };
        source.declare(&mut frontend)?;
        source.begin_epoch(&mut frontend)?;
        Ok(Self { frontend, source })
    }

    /// Runs until the run ends: epoch after epoch, tick after tick.
    ///
    /// # Errors
    /// [`ServerError`] if it cannot go on; what was recorded until then is kept.
    pub fn run(self) -> Result<Summary, ServerError> {
        let (Self { frontend, source }, exit) = run_to_exit(self);
        match exit {
            StopReason::End(end) => source.conclude(end, frontend),
            StopReason::Failed(error) => {
                // So that its robots end, too.
                if let Err(error) = source.leave(End::Aborted, frontend) {
                    tracing::debug!("{error}");
                }
                Err(error)
            }
        }
    }
}

impl TickSource for LiveRun {
    type Interrupt = EpochStop;

    fn begin_work(&mut self) {
        self.watchdog.note(Some(Activity::Work));
        self.pause_at = self.epoch.simulation.tick() + MAX_TICKS_AT_ONCE;
    }

    fn end_work(
        &mut self,
        outcome: Result<Option<Duration>, EpochStop>,
        frontend: &mut Frontend,
    ) -> Result<Option<Duration>, StopReason> {
        // What was complete before the interruption is written whatever interrupts.
        let written = self.write_noted();
        self.watchdog.note(None);
        written?;

        match outcome {
            Ok(rest) => return Ok(rest),
            Err(EpochStop::Init { scenario, query }) => {
                let begun = self.begin_next_epoch(*scenario, frontend);
                match &begun {
                    Ok(()) => self.answer_status(&query, frontend),
                    Err(error) => refuse(&query, &error.to_string()),
                }
                begun?;
            }
            // A client that stops a run wants its processes to end.
            Err(EpochStop::Exit(StopReason::End(end))) if end != End::Stopped && self.stays() => {
                self.end_and_stay(end, frontend)?;
            }
            Err(EpochStop::Exit(exit)) => return Err(exit),
        }
        Ok(Some(Duration::ZERO))
    }

    fn advance(&mut self, frontend: &mut Frontend) -> Result<Next, EpochStop> {
        let early = self.handle_early(frontend)?;
        if self.epoch.record.is_closed() {
            return Ok(self.linger()?);
        }

        // Timers after events: an answer that has arrived counts, though its deadline has passed meanwhile.
        while let Some(timer) = self.timers.take_due(Instant::now()) {
            // After its deadline a robot is given up, and with it what has come from it.
            if timer == Timer::Deadline {
                self.report_missing_commands(frontend);
            }
            self.barrier.timer(&timer, &mut self.outputs);
        }
        self.carry_out(frontend)?;
        // Only now: what has arrived, and the timers, may have changed for whom the clock waits.
        let standby = match self.endless_wait() {
            Wait::Bounded => None,
            Wait::Standby(left) => Some(left),
            Wait::Endless => return Err(StopReason::End(End::Aborted).into()),
        };
        let simulation = &self.epoch.simulation;
        let is_waiting_for_robots = matches!(self.epoch.waits_for, WaitsFor::Robots);
        // Complete, not only granted: while robots are awaited, the last tick is open.
        if simulation.is_over() && !is_waiting_for_robots {
            return Err(StopReason::End(End::Finished).into());
        }

        // Its own thread goes on at once; this one, which may be the middleware's, receives what has come.
        if simulation.tick() >= self.pause_at {
            return Ok(Next::Wait(Some(Duration::ZERO)));
        }

        match self.open_next_tick(frontend)? {
            Next::Wait(rest) => {
                let looks = rest.into_iter().chain(standby).chain(early);
                Ok(Next::Wait(looks.min()))
            }
            next @ Next::GoOn => Ok(next),
        }
    }

    // The arms call; they do not decide.
    fn handle(&mut self, event: ServerEvent, frontend: &mut Frontend) -> Result<(), EpochStop> {
        match event {
            ServerEvent::Report(robot, report) => self.on_report(&robot, report),
            ServerEvent::Command { from, to, command } => self.on_command(&from, to, command),
            ServerEvent::Waiting(robot, waiting) => self.on_waiting(&robot, &waiting),
            ServerEvent::Panel(robot, panel) => self.on_panel(&robot, panel),
            ServerEvent::Malformed(error) => self.ignore("malformed", &error.to_string()),
            ServerEvent::Join(query) => self.on_join(&query, frontend),
            ServerEvent::Token { robot, is_present } => self.on_token(&robot, is_present),
            ServerEvent::Viewer { is_present } => self.viewers.note(is_present),
            ServerEvent::Offered {
                query,
                control,
                refusal: None,
            } => self.on_accepted(query, &control, frontend)?,
            ServerEvent::Offered {
                query,
                refusal: Some(reason),
                ..
            } => refuse(&query, &reason),
            ServerEvent::Control(_) | ServerEvent::Terminate | ServerEvent::State(..) => {
                unreachable!("the same for all sources, or of a recording")
            }
        }

        Ok(())
    }

    fn request(
        &mut self,
        query: Query,
        control: Control,
        frontend: &mut Frontend,
    ) -> Result<(), EpochStop> {
        let offers = self.offers(&control);
        if offers.is_empty() {
            return self.on_accepted(query, &control, frontend);
        }
        // Robots that it would give parameters are asked first.
        Self::offer(query, control, offers, frontend);
        Ok(())
    }

    fn act(&mut self, control: &Control, _: &mut Frontend) -> Result<(), String> {
        self.on_action(control)
    }

    fn check_next_tick(&self) -> Result<(), String> {
        Ok(())
    }

    fn tick_after(&self, ticks: u64) -> Option<Tick> {
        // People know already for whom the clock is held.
        if self.barrier.is_announced() {
            return None;
        }
        let simulation = &self.epoch.simulation;
        let until = simulation.tick() + ticks + u64::from(self.barrier.is_open());
        Some(until.min(simulation.scenario().ticks))
    }

    fn scenario(&self) -> Result<Scenario, String> {
        Ok(self.epoch.simulation.scenario().clone())
    }

    fn status(&self, frontend: &Frontend) -> Status {
        let simulation = &self.epoch.simulation;
        let scenario = simulation.scenario();
        let lateness = self.barrier.lateness();
        let mut robots = Vec::new();
        for name in self.barrier.roster() {
            let (generation, presence) = self.barrier.presence(name);
            robots.push(RobotStatus {
                name: name.clone(),
                generation,
                on_late: lateness.of(name),
                presence,
            });
        }

        Status {
            run: frontend.run.clone(),
            epoch: simulation.epoch(),
            tick: simulation.tick(),
            pending_steps: frontend.pace.pending_steps,
            time_s: simulation.time_s(simulation.tick()),
            duration_s: scenario.duration_s(),
            tick_s: scenario.tick_s,
            seed: scenario.seed,
            replay_of: None,
            phase: frontend.pace.phase,
            speed: frontend.pace.speed,
            on_late: lateness.on_late,
            deadline_s: lateness.deadline.as_secs_f64(),
            awaiting: self.awaiting(self.epoch.waiting_since),
            robots,
            ignored: self.epoch.wall.ignored.clone(),
        }
    }

    fn show(&mut self, frontend: &mut Frontend) {
        // In the middle of a tick there are no panels of the one before: the next one is shown with its own. A clock that is held
        // in a tick may have no next one, and people are to see why.
        if self.barrier.is_open() && !self.barrier.is_announced() {
            frontend.observers.show_next();
        } else if frontend.observers.has_subscribers() {
            self.put_frame(frontend);
        }
    }
}

impl LiveRun {
    /// Declares what the simulator subscribes to and answers, its token last.
    fn declare(&mut self, frontend: &mut Frontend) -> Result<(), BusError> {
        let keys = &frontend.keys;
        let reports = frontend.subscribe(&keys.reports(), ServerEvent::Report)?;
        let waiting = frontend.subscribe(&keys.all_waiting(), ServerEvent::Waiting)?;

        let outboxes = frontend.subscribe(&keys.outboxes(), |from, command: Command| {
            let to = command.to.clone();
            ServerEvent::Command { from, to, command }
        })?;

        let inbox = frontend.inbox.clone();
        let commands = frontend
            .bus
            .subscribe(&keys.commands(), move |key, bytes| {
                let to = Keys::robot_of(key).unwrap_or_default();
                let to = RobotName::new(to).ok().map(Target::Robot);
                let from = Keys::last_chunk(key).to_owned();
                inbox.send_and_work(match decode(key, &from, bytes) {
                    Ok(command) => ServerEvent::Command { from, to, command },
                    Err(error) => ServerEvent::Malformed(error),
                });
            })?;

        // The middleware calls back about tokens in the middle of its own work: these events are left to the own thread.
        let inbox = frontend.inbox.clone();
        let tokens = frontend
            .bus
            .liveliness(&keys.alive_robots(), move |key, is_present| {
                let robot = Keys::robot_of(key).unwrap_or_default().to_owned();
                inbox.send(ServerEvent::Token { robot, is_present });
            })?;
        let mut declared = vec![reports, outboxes, commands, waiting, tokens];

        if self.stay == KeepAlive::Viewed {
            let inbox = frontend.inbox.clone();
            let viewers = frontend
                .bus
                .liveliness(&keys.alive_viewer(), move |_, is_present| {
                    inbox.send(ServerEvent::Viewer { is_present });
                })?;
            declared.push(viewers);
        }

        declared.into_iter().for_each(|one| frontend.keep(one));
        frontend.declare_simulator()
    }

    /// Begins the epoch after this one.
    fn begin_next_epoch(
        &mut self,
        scenario: Scenario,
        frontend: &mut Frontend,
    ) -> Result<(), ServerError> {
        // The files of this epoch are finished before the next one renames them.
        self.epoch.record.supersede()?;
        let deferred = std::mem::take(&mut self.epoch.deferred);

        // The record of the new epoch begins here: what has to be answered from the old one was taken
        // out before.
        let number = self.epoch.simulation.epoch() + 1;
        self.epoch = LiveEpoch::begin(scenario, number, &self.folder, frontend, None)?;
        for query in deferred {
            refuse(
                &query,
                "the epoch is over, and another one begins from the scenario as it is",
            );
        }
        Ok(self.begin_epoch(frontend)?)
    }

    /// Begins to gather robots. Nothing of an epoch before may reach into this one.
    fn begin_epoch(&mut self, frontend: &mut Frontend) -> Result<(), BusError> {
        self.outputs.clear();
        let simulation = &mut self.epoch.simulation;
        // A robot says this when it joins, which may have been in an earlier epoch.
        for name in &self.with_bodies {
            simulation.list_bodies(name, true);
        }
        for name in &self.with_ranges {
            simulation.list_ranges(name, true);
        }

        if !simulation.scenario().record.has_panels() {
            self.panels = None;
        } else if self.panels.is_none() {
            let panels = frontend.subscribe(&frontend.keys.panels(), ServerEvent::Panel)?;
            self.panels = Some(panels);
        }

        frontend.pace.gather();
        self.gather();
        // A process that a fault keeps from running cannot join: faults of the epoch before are ended
        // first, and then robots are gathered once more (`open_next_tick`).
        let number = self.epoch.simulation.epoch();
        if let Some(pending_orders) = self.order_end_of_faults(number) {
            self.epoch.waits_for = WaitsFor::Faults(pending_orders);
        }
        Ok(())
    }

    /// Begins to wait for the robots of the roster.
    pub(super) fn gather(&mut self) {
        let epoch = &mut self.epoch;
        epoch.waits_for = WaitsFor::Robots;
        epoch.waiting_since = Instant::now();
        let lateness = epoch.simulation.scenario().lateness.to_lockstep();
        let number = epoch.simulation.epoch();
        self.barrier.gather(number, lateness, &mut self.outputs);
    }
}

//! The loop of a simulator process.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Publisher, Query};
use lockstep::{Barrier, IncarnationNotice, Outcome, Output, Sent, Stamp, Timing};
use protocol::keys::{Keys, STATE};
use protocol::messages::{
    Awaited, Clock, Command, CommandText, Control, End, LogKind, LogRecord, MAX_ENTRIES, Panel,
    Presence, Reason, Report, Waiting,
};
use protocol::{Generation, Malformed, RobotName, RunName, Tick, decode, encode};

use crate::recorder::{Observed, Recorder};
use crate::simulation::{Simulation, TickRecord};
use config::diagnostic::FileError;
use record::RunFolder;
use record::difference::Difference;
use record::summary::{Summary, Wall};
use scenario::Scenario;

use super::answer::refuse;
use super::departed::{Departed, Wait};
use super::inbox::{Events, Inbox, Work, inbox};
use super::observers::Observers;
use super::orders::{Orders, PendingOrders};
use super::pace::Pace;
use super::past::{Comparison, RejoinWait, ReplayLog};
use super::timers::Timers;
use super::viewers::Viewers;
use super::watchdog::{Activity, Watchdog};

/// While the clock is held it is repeated this often: what was lost on the wire is then sent again.
pub const REPEAT_AFTER: Duration = Duration::from_secs(2);
/// How long the simulator waits at the end of a run for the robots to leave.
const GOODBYE: Duration = Duration::from_secs(1);
/// Most ticks that wait for no robot and are granted in one go: the thread that does it may be the one that receives.
const MAX_TICKS_AT_ONCE: Tick = 16;
/// Most commands of the operator that wait for the next tick.
const MAX_OPERATOR_COMMANDS: usize = 1024;

/// How a simulator process runs.
#[derive(Debug, Clone)]
pub struct Options {
    /// Name of the run.
    pub run: RunName,
    /// Simulated seconds per second; `None` is as fast as the barrier goes.
    pub speed: Option<f64>,
    /// Whether the clock waits for `start` once every robot is connected.
    pub is_paused: bool,
    /// Whether the process stays when the run is over.
    pub stay: Stay,
    /// While the clock is held it is repeated this often; [`REPEAT_AFTER`] unless a test is in a hurry.
    pub repeat_after: Duration,
}

/// Whether a simulator process stays when a run ends without being stopped: then `init` begins another epoch, with the same
/// processes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stay {
    /// It ends.
    Never,
    /// It stays while a browser shows the run in a console.
    Viewed,
    /// It stays until it is stopped.
    Always,
}

/// Why a simulator process ended before its time.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The record cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The environment cannot be set up.
    #[error(transparent)]
    Hall(#[from] world::HallError),
    /// A run that is resumed does not go as its record.
    #[error(
        "the run cannot be resumed: executed again, it differs from its record at {0} (recorded: {recorded}; now: {now}). \
         The record is as it was",
        recorded = .0.value(0),
        now = .0.value(1)
    )]
    NotRepeated(Box<Difference>),
}

/// Everything that can happen to a simulator process.
pub enum Event {
    /// A robot has done its tick.
    Report {
        /// The robot that the key names.
        robot: String,
        /// What it put.
        report: Result<Report, Malformed>,
    },
    /// A robot, or the operator, sent a command.
    Command {
        /// The sender that the key names.
        from: String,
        /// The target that the key names.
        to: String,
        /// What was put.
        command: Result<Command, Malformed>,
    },
    /// A robot waits for another robot's answer.
    Waiting {
        /// The robot that the key names.
        robot: String,
        /// What it put.
        waiting: Result<Waiting, Malformed>,
    },
    /// A robot shows a panel.
    Panel {
        /// The robot that the key names.
        robot: String,
        /// What it put.
        panel: Result<Panel, Malformed>,
    },
    /// A robot asks to take part.
    Join(Query),
    /// An operator asks for something.
    Control(Query),
    /// Robots have been asked about the parameters that an operator wants to set.
    Offered {
        /// The request.
        query: Query,
        /// What it asks for.
        control: Box<Control>,
        /// Why a robot refuses its parameters, if one does.
        refusal: Option<String>,
    },
    /// A robot's liveliness token was declared or undeclared.
    Token {
        /// The robot that the key names.
        robot: String,
        /// Whether it is declared.
        is_present: bool,
    },
    /// A console declares, or declares no more, that a browser shows the run.
    Viewer {
        /// Whether one does.
        is_present: bool,
    },
    /// The process is asked to end.
    Terminate,
}

/// Why an epoch ended.
#[derive(Debug)]
pub enum Interrupt {
    /// Start the next epoch with this scenario.
    Init(Box<Scenario>),
    /// End the run.
    End(End),
    /// The process cannot go on.
    Failed(ServerError),
}

impl From<BusError> for Interrupt {
    fn from(error: BusError) -> Self {
        Self::Failed(error.into())
    }
}

impl From<FileError> for Interrupt {
    fn from(error: FileError) -> Self {
        Self::Failed(error.into())
    }
}

/// What the loop waits for.
pub(super) enum Stage {
    /// The robots: to join, or to report.
    Robots,
    /// Robots that have to join again, before or after the last tick of a run that is executed again.
    Returns(RejoinWait),
    /// The next tick to be due.
    Grant,
    /// The launcher, to carry out the faults that are due before the next tick.
    Faults(PendingOrders),
}

/// A simulator process.
pub struct Server {
    pub(super) options: Options,
    pub(super) bus: Bus,
    pub(super) keys: Keys,
    inbox: Inbox<Running>,
    events: Events<Running>,
    declared: Vec<Declared>,
    clock: Publisher,
    news: BTreeMap<RobotName, Publisher>,
    pub(super) observers: Observers,
    viewers: Viewers,
    pub(super) departed: Departed,
    pub(super) orders: Orders,
    pub(super) pace: Pace,
    pub(super) barrier: Barrier<Arc<Report>, CommandText>,
    pub(super) outputs: Vec<Output<Arc<Report>, CommandText>>,
    timers: Timers,
    watchdog: Watchdog,
    pub(super) stage: Stage,
    /// Robots whose news list the bodies around them.
    pub(super) with_bodies: BTreeSet<RobotName>,
    /// Since when the loop waits for robots.
    pub(super) waiting_since: Instant,
    /// Robots that hold the clock up: awaited when people were told, and not waiting for another robot.
    culprits: Vec<RobotName>,
    pub(super) wall: Wall,
    /// Commands from outside the roster that are sent at the next tick boundary.
    operator: Vec<(RobotName, String)>,
    /// Requests that wait until the next tick has begun.
    pub(super) deferred: Vec<Query>,
    /// The record of a run that is resumed, until it has been executed again.
    pub(super) past: Option<ReplayLog>,
    /// The subscriber to panels, while they are recorded: robots put them only if there is one.
    panel_subscriber: Option<Declared>,
    observing: Observing,
}

/// Most lines about one tick, of those for whom the clock is held, that are recorded: robots can cause any number.
const MAX_LATE_LINES: usize = 64;

/// What is observed of the tick in progress, for the recording.
#[derive(Default)]
struct Observing {
    /// Whether ticks are recorded. Otherwise nothing is observed.
    is_on: bool,
    /// The tick of the last report of each robot, and when the first of that tick arrived.
    reports: BTreeMap<RobotName, (Tick, Instant)>,
    awaited: Vec<Awaited>,
    /// What people were told of the robots for which the clock is held.
    late: Vec<LogRecord>,
    panels: BTreeMap<RobotName, Panel>,
}

impl Observing {
    fn report(&mut self, robot: &RobotName, tick: Tick) {
        let is_known = self.reports.get(robot).is_some_and(|last| last.0 == tick);
        if self.is_on && !is_known {
            self.reports.insert(robot.clone(), (tick, Instant::now()));
        }
    }

    fn late(&mut self, line: LogRecord) {
        if self.is_on && self.late.len() < MAX_LATE_LINES {
            self.late.push(line);
        }
    }

    /// Takes what was observed of a tick that is complete.
    fn take(&mut self, tick: Tick, opened: Instant) -> Observed {
        let mut reports = BTreeMap::new();
        for (robot, (reported, arrived)) in &self.reports {
            if *reported == tick {
                reports.insert(robot.clone(), *arrived);
            }
        }

        Observed {
            opened,
            reports,
            awaited: std::mem::take(&mut self.awaited),
            late: std::mem::take(&mut self.late),
            panels: std::mem::take(&mut self.panels),
        }
    }
}

impl Server {
    /// Declares the simulator's side of the contract on an open bus.
    ///
    /// # Errors
    /// [`BusError`] if something cannot be declared.
    pub fn open(bus: Bus, scenario: &Scenario, options: Options) -> Result<Self, BusError> {
        let keys = Keys::new(&options.run);
        let (inbox, events) = inbox();
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

        let mut server = Self {
            clock: bus.publisher(&keys.clock())?,
            news,
            observers: Observers::new(&bus, &keys)?,
            viewers: Viewers::default(),
            departed: Departed::default(),
            orders: Orders::new(bus.publisher(&keys.faults())?),
            pace: Pace::new(options.speed, options.is_paused),
            barrier,
            outputs: Vec::new(),
            timers: Timers::default(),
            watchdog: Watchdog::start(|line| tracing::warn!("{line}")),
            stage: Stage::Robots,
            with_bodies: BTreeSet::new(),
            waiting_since: Instant::now(),
            culprits: Vec::new(),
            wall: Wall::default(),
            operator: Vec::new(),
            deferred: Vec::new(),
            past: None,
            panel_subscriber: None,
            observing: Observing::default(),
            declared: Vec::new(),
            options,
            bus,
            keys,
            inbox,
            events,
        };
        server.declare()?;
        Ok(server)
    }

    /// What sends an event to this server, from any thread: a signal, for example.
    pub fn sender(&self) -> impl Fn(Event) + Clone + Send + Sync + 'static {
        let inbox = self.inbox.clone();
        move |event| inbox.send(event)
    }

    /// Declares what the simulator subscribes to and answers, its token last.
    fn declare(&mut self) -> Result<(), BusError> {
        let inbox = self.inbox.clone();
        let reports = self
            .bus
            .subscribe(&self.keys.reports(), move |key, bytes| {
                let robot = Keys::robot_of(key).unwrap_or_default().to_owned();
                let report = decode(key, &robot, bytes);
                inbox.send_and_work(Event::Report { robot, report });
            })?;

        let inbox = self.inbox.clone();
        let commands = self
            .bus
            .subscribe(&self.keys.commands(), move |key, bytes| {
                let to = Keys::robot_of(key).unwrap_or_default().to_owned();
                let from = Keys::last_chunk(key).to_owned();
                let command = decode(key, &from, bytes);
                inbox.send_and_work(Event::Command { from, to, command });
            })?;

        let inbox = self.inbox.clone();
        let waiting = self
            .bus
            .subscribe(&self.keys.all_waiting(), move |key, bytes| {
                let robot = Keys::robot_of(key).unwrap_or_default().to_owned();
                let waiting = decode(key, &robot, bytes);
                inbox.send_and_work(Event::Waiting { robot, waiting });
            })?;

        let inbox = self.inbox.clone();
        let tokens = self
            .bus
            .liveliness(&self.keys.alive_robots(), move |key, is_present| {
                let robot = Keys::robot_of(key).unwrap_or_default().to_owned();
                inbox.send(Event::Token { robot, is_present });
            })?;
        self.declared.extend([reports, commands, waiting, tokens]);

        if self.options.stay == Stay::Viewed {
            let inbox = self.inbox.clone();
            let viewers =
                self.bus
                    .liveliness(&self.keys.alive_viewer(), move |_, is_present| {
                        inbox.send(Event::Viewer { is_present });
                    })?;
            self.declared.push(viewers);
        }

        for (key, event) in [
            (self.keys.join(), Event::Join as fn(Query) -> Event),
            (self.keys.joins(), Event::Join),
            (self.keys.control(), Event::Control),
        ] {
            let inbox = self.inbox.clone();
            self.declared.push(self.bus.queryable(&key, move |query| {
                inbox.send(event(query));
            })?);
        }
        self.declared.push(self.bus.token(&self.keys.alive_sim())?);
        Ok(())
    }

    /// Runs until the run ends: epoch after epoch, tick after tick. With a past the epoch of its record is executed again and
    /// then resumed.
    ///
    /// # Errors
    /// [`ServerError`] if it cannot go on; what was recorded until then is kept.
    pub fn run(
        mut self,
        mut scenario: Scenario,
        folder: &RunFolder,
        past: Option<ReplayLog>,
    ) -> Result<Summary, ServerError> {
        let mut epoch = past.as_ref().map_or(1, ReplayLog::epoch);
        self.past = past;
        loop {
            let mut simulation = Simulation::new(scenario, epoch)?;
            let recorder = self.begin_record(folder, &simulation)?;
            self.begin_observing(&simulation)?;
            self.begin_epoch(&mut simulation);

            let inbox = self.inbox.clone();
            let running = Running {
                server: self,
                simulation,
                recorder: Recording::On(Box::new(recorder)),
            };
            let (running, interrupt) = inbox.run(running);
            let Running {
                server,
                mut simulation,
                recorder,
            } = running;
            self = server;
            match interrupt {
                Interrupt::Init(next) => {
                    if let Recording::On(mut recorder) = recorder {
                        recorder.supersede()?;
                    }
                    scenario = *next;
                    epoch += 1;
                }
                Interrupt::End(end) => {
                    let summary = match recorder {
                        Recording::On(mut recorder) => {
                            self.end(end, &mut simulation, &mut recorder)
                        }
                        Recording::Over(summary) => Ok(*summary),
                    };
                    self.leave(end, &mut simulation)?;
                    return Ok(summary?);
                }
                Interrupt::Failed(error) => {
                    self.abandon(&mut simulation);
                    return Err(error);
                }
            }
        }
    }

    /// Begins to observe for the recording what the scenario wants recorded. Nothing of an epoch before is kept.
    fn begin_observing(&mut self, simulation: &Simulation) -> Result<(), BusError> {
        let record = &simulation.scenario().record;
        self.observing = Observing {
            is_on: record.frames,
            ..Observing::default()
        };
        if !record.has_panels() {
            self.panel_subscriber = None;
            return Ok(());
        }
        if self.panel_subscriber.is_some() {
            return Ok(());
        }

        let inbox = self.inbox.clone();
        let panels = self.bus.subscribe(&self.keys.panels(), move |key, bytes| {
            let robot = Keys::robot_of(key).unwrap_or_default().to_owned();
            let panel = decode(key, &robot, bytes);
            inbox.send_and_work(Event::Panel { robot, panel });
        })?;
        self.panel_subscriber = Some(panels);
        Ok(())
    }

    /// Begins to gather robots. Nothing of an epoch before may reach into this one.
    fn begin_epoch(&mut self, simulation: &mut Simulation) {
        self.wall = Wall::default();
        self.operator.clear();
        self.outputs.clear();
        self.culprits.clear();
        for name in &self.with_bodies {
            simulation.list_bodies(name, true);
        }

        for query in std::mem::take(&mut self.deferred) {
            refuse(
                &query,
                "the epoch is over, and another one begins from the scenario as it is",
            );
        }

        self.pace.gather();
        self.gather(simulation);
        if let Some(pending_orders) = self.order_end_of_faults(simulation.epoch()) {
            self.stage = Stage::Faults(pending_orders);
        }
    }

    /// Begins to wait for the robots of the roster.
    fn gather(&mut self, simulation: &Simulation) {
        self.stage = Stage::Robots;
        self.waiting_since = Instant::now();
        let lateness = simulation.scenario().lateness.to_lockstep();
        self.barrier
            .gather(simulation.epoch(), lateness, &mut self.outputs);
    }

    /// Does all that can be done now, within bounds. Returns how long to wait at most before looking again.
    fn work(
        &mut self,
        simulation: &mut Simulation,
        recorder: &mut Recorder,
    ) -> Result<Option<Duration>, Interrupt> {
        let last = simulation.tick() + MAX_TICKS_AT_ONCE;
        loop {
            while let Some(event) = self.events.try_next() {
                self.handle(event, simulation)?;
            }
            while let Some(timer) = self.timers.take_due(Instant::now()) {
                self.barrier.timer(&timer, &mut self.outputs);
            }
            self.carry_out(simulation, recorder)?;
            let standby = match self.endless_wait() {
                Wait::Sound => None,
                Wait::Standby(left) => Some(left),
                Wait::Endless => return Err(Interrupt::End(End::Aborted)),
            };
            if simulation.tick() >= simulation.scenario().ticks && !self.is_waiting_for_robots() {
                return Err(Interrupt::End(End::Finished));
            }

            if simulation.tick() >= last {
                return Ok(Some(Duration::ZERO));
            }

            match self.advance(simulation)? {
                Next::Opened => {}
                Next::Wait(patience) => return Ok(patience.into_iter().chain(standby).min()),
            }
        }
    }

    fn is_waiting_for_robots(&self) -> bool {
        matches!(self.stage, Stage::Robots)
    }

    /// Opens the next tick if it is due, or finds out how long to wait at most before looking again.
    fn advance(&mut self, simulation: &mut Simulation) -> Result<Next, Interrupt> {
        match &self.stage {
            Stage::Robots => return Ok(Next::Wait(self.timers.next(Instant::now()))),
            Stage::Returns(_) => {
                if let Some(patience) = self.await_returns() {
                    return Ok(Next::Wait(Some(patience)));
                }
                self.stage = Stage::Grant;
                return Ok(Next::Opened);
            }
            Stage::Grant => {
                if self.past.is_none()
                    && let Err(patience) = self.pace.take_grant(simulation.scenario().tick_s)
                {
                    return Ok(Next::Wait(self.show_owed(simulation, patience)));
                }
                self.repeat_changes(simulation);
                self.follow_lateness(simulation);
                if let Some(pending_orders) = self.order_faults(simulation)? {
                    self.stage = Stage::Faults(pending_orders);
                    return Ok(Next::Opened);
                }
            }
            Stage::Faults(pending_orders) => {
                let is_before_tick_zero = pending_orders.order.tick == 0;
                if let Some(patience) = self.await_faults()? {
                    return Ok(Next::Wait(Some(patience)));
                }
                if is_before_tick_zero {
                    self.gather(simulation);
                    return Ok(Next::Opened);
                }
            }
        }

        let commands = match &self.past {
            Some(past) => past.commands(),
            None => std::mem::take(&mut self.operator),
        };
        for (to, command) in commands {
            simulation.command(&to, &command);
        }
        let tick = simulation.begin_tick();
        self.stage = Stage::Robots;
        self.waiting_since = Instant::now();
        self.recall();
        self.barrier
            .open(tick, simulation.robots_with_news(), &mut self.outputs);
        for query in std::mem::take(&mut self.deferred) {
            self.on_control(query, simulation)?;
        }
        Ok(Next::Opened)
    }

    /// While a run is executed again, what was done by hand is done again.
    fn repeat_changes(&self, simulation: &mut Simulation) {
        let Some(past) = &self.past else { return };
        if let Err(reason) = simulation.repeat_changes(&past.changes_by_hand()) {
            // The tick differs from its record then, which ends the repetition.
            tracing::error!("what was done by hand cannot be done again: {reason}");
        }
    }

    /// What a change says about late robots holds from its tick on.
    fn follow_lateness(&mut self, simulation: &Simulation) {
        let Some(due) = simulation.lateness_due() else {
            return;
        };
        let mut lateness = self.barrier.lateness().clone();
        lateness.on_late = due.on_late;
        lateness.own.clone_from(&due.own);
        self.barrier.set_lateness(lateness, &mut self.outputs);
    }

    /// Whether the run is executed again up to the end of its record.
    pub(super) fn is_repeating(&self) -> bool {
        self.past.is_some()
    }

    /// Carries out what the barrier wants done.
    fn carry_out(
        &mut self,
        simulation: &mut Simulation,
        recorder: &mut Recorder,
    ) -> Result<(), Interrupt> {
        while !self.outputs.is_empty() {
            for output in std::mem::take(&mut self.outputs) {
                match output {
                    // The faults of the epoch before are ended first, and then robots are gathered once more.
                    Output::Gathered if matches!(self.stage, Stage::Faults(_)) => {}
                    Output::Gathered => self.begin(simulation),
                    Output::Grant { news, clock } => self.put(simulation, &news, clock)?,
                    Output::Complete(outcome) => self.complete(outcome, simulation, recorder)?,
                    Output::StandIn(robot) => self.stand_in(&robot, simulation)?,
                    Output::Held => self.tell_held(simulation),
                    Output::Released => {
                        let status = self.status(simulation);
                        let line = self.observers.released(simulation, &status);
                        self.observing.late(line);
                    }
                    Output::Aborted => return Err(Interrupt::End(End::Aborted)),
                    Output::SetTimer(timer, after) => self.timers.set(timer, after, Instant::now()),
                    Output::Ignored(reason, robot) => self.ignore(reason.as_str(), robot.as_str()),
                }
            }
        }

        Ok(())
    }

    /// Puts what a robot would have answered: those that follow its state wait for it no longer.
    fn stand_in(&self, robot: &RobotName, simulation: &Simulation) -> Result<(), BusError> {
        let Some(state) = simulation.last_state(robot) else {
            return Ok(());
        };
        self.bus.put(&self.keys.query(robot, STATE), encode(&state))
    }

    /// Every robot of the roster is connected: tick 0.
    fn begin(&mut self, simulation: &mut Simulation) {
        simulation.begin_init();
        self.waiting_since = Instant::now();
        self.recall();
        self.barrier
            .open(0, simulation.robots_with_news(), &mut self.outputs);
    }

    /// News first, then the clock: on one session they arrive in this order.
    fn put(
        &mut self,
        simulation: &Simulation,
        news: &[(RobotName, IncarnationNotice)],
        clock: Clock,
    ) -> Result<(), BusError> {
        for (name, notice) in news {
            if let Some(publisher) = self.news.get(name) {
                publisher.put(encode(&simulation.news(name, *notice)))?;
            }
        }

        self.clock.put(encode(&clock))
    }

    /// A tick is complete.
    fn complete(
        &mut self,
        mut outcome: Outcome<Arc<Report>, CommandText>,
        simulation: &mut Simulation,
        recorder: &mut Recorder,
    ) -> Result<(), Interrupt> {
        self.record_stragglers();
        self.take_late(&mut outcome, simulation);
        let record = simulation.end_tick(outcome);
        self.observers.note(record.tick, &record.events);
        self.watchdog.note(Some(Activity::Record));
        if self.observing.is_on {
            recorder.observe(self.observing.take(record.tick, self.waiting_since));
        }
        let lines = recorder.note(simulation, &record)?;
        // At full speed a tick is written while the robots run the next one.
        if !self.pace.is_at_full_speed() {
            recorder.write_noted()?;
        }
        self.watchdog.note(Some(Activity::Work));
        self.observers.log(&lines);
        self.stage = Stage::Grant;
        if self.past.is_some() {
            self.compare(&record, recorder)?;
            self.hold_for_returns();
        } else if record.tick == 0 {
            self.pace.ready();
        }

        if let Some((query, _)) = self.pace.reached(simulation.tick()) {
            self.answer_status(&query, simulation);
        }
        self.observers.owe_frame();
        self.show_owed(simulation, None);
        Ok(())
    }

    /// Writes the tick that is complete and not written, if there is one.
    fn write_noted(&self, recorder: &mut Recorder) -> Result<(), FileError> {
        if !recorder.has_noted() {
            return Ok(());
        }
        self.watchdog.note(Some(Activity::Record));
        recorder.write_noted()
    }

    /// Shows a tick that observers have not seen, if it is time for a frame. Returns how long to wait at most before looking
    /// again, at most `patience`.
    fn show_owed(
        &mut self,
        simulation: &Simulation,
        patience: Option<Duration>,
    ) -> Option<Duration> {
        match self.observers.frame_due_in() {
            None => patience,
            Some(Duration::ZERO) => {
                let status = self.status(simulation);
                self.observers.frame(simulation, &status);
                patience
            }
            Some(rest) => Some(patience.map_or(rest, |patience| patience.min(rest))),
        }
    }

    /// Begins the record of an epoch, or to write that of an epoch that is resumed once more.
    fn begin_record(
        &mut self,
        folder: &RunFolder,
        simulation: &Simulation,
    ) -> Result<Recorder, FileError> {
        let run = &self.options.run;
        let Some(past) = &self.past else {
            return Recorder::begin(folder, run, simulation);
        };

        let mut recorder = Recorder::resume(folder, run, simulation)?;
        if past.is_empty() {
            self.past = None;
            recorder.supersede_record()?;
        }
        Ok(recorder)
    }

    /// Compares a tick of a run that is resumed with its record. Its last tick ends the repetition, and the clock is ready.
    fn compare(&mut self, record: &TickRecord, recorder: &mut Recorder) -> Result<(), Interrupt> {
        let Some(past) = &mut self.past else {
            return Ok(());
        };

        match past.compare(record)? {
            Comparison::Same => {}
            Comparison::Different(difference) => {
                return Err(Interrupt::Failed(ServerError::NotRepeated(difference)));
            }
            Comparison::Last => {
                self.past = None;
                recorder.supersede_record()?;
                self.pace.ready();
                tracing::info!("resumed after tick {}", record.tick);
            }
        }
        Ok(())
    }

    /// The clock is held: people are told for whom, and so is a client that waits for a step.
    fn tell_held(&mut self, simulation: &Simulation) {
        if self.culprits.is_empty() && self.barrier.is_open() {
            for (name, reason) in self.barrier.awaited() {
                if !matches!(reason, Reason::WaitsFor(_)) {
                    self.culprits.push(name);
                }
            }
        }

        let status = self.status(simulation);
        if self.observing.is_on {
            self.observing.awaited.clone_from(&status.awaiting);
        }
        if let Some(line) = self.observers.held(simulation, &status) {
            self.observing.late(line);
        }
        if let Some(query) = self.pace.give_up_stepping() {
            self.answer_status(&query, simulation);
        }
    }

    fn record_stragglers(&mut self) {
        let held_s = self.waiting_since.elapsed().as_secs_f64();
        for name in std::mem::take(&mut self.culprits) {
            let held = self.wall.held_up_by.entry(name).or_default();
            held.ticks += 1;
            held.waited_s += held_s;
            held.longest_s = held.longest_s.max(held_s);
        }
    }

    /// The run is over: writes what came of it.
    fn end(
        &mut self,
        end: End,
        simulation: &mut Simulation,
        recorder: &mut Recorder,
    ) -> Result<Summary, FileError> {
        self.pace.end();
        if let Some(query) = self.pace.give_up_stepping() {
            self.answer_status(&query, simulation);
        }
        self.record_end(end, simulation, recorder)
    }

    /// Puts the end of the run, also if its record could not be written, and ends this side of the contract.
    fn leave(mut self, end: End, simulation: &mut Simulation) -> Result<(), BusError> {
        let clock = self.barrier.end(end);
        self.clock.put(encode(&clock))?;
        self.say_goodbye(&clock, simulation);
        self.declared.clear();
        self.panel_subscriber = None;
        self.bus.close();
        Ok(())
    }

    /// Whether the process stays now that the run is over.
    fn stays(&self) -> bool {
        match self.options.stay {
            Stay::Never => false,
            Stay::Viewed => self.viewers.rest().is_none_or(|rest| !rest.is_zero()),
            Stay::Always => true,
        }
    }

    fn log_keep_alive(&mut self, simulation: &Simulation) {
        let tick = simulation.tick();
        self.observers.log(&[LogRecord {
            epoch: simulation.epoch(),
            tick,
            time_s: simulation.time_s(tick),
            tick_s: simulation.scenario().tick_s,
            source: "simulator".to_owned(),
            kind: LogKind::Run,
            text:
                "the run is over, and its processes stay: Init begins the next one, Stop ends them"
                    .to_owned(),
        }]);
    }

    /// The run is over, and the process stays: answers requests until one begins another epoch, or no browser shows the run any
    /// more.
    fn linger(&mut self, simulation: &mut Simulation) -> Result<Option<Duration>, Interrupt> {
        while let Some(event) = self.events.try_next() {
            self.handle(event, simulation)?;
        }
        // Nothing of the run is granted any more.
        self.outputs.clear();

        if !self.stays() {
            return Err(Interrupt::End(End::Stopped));
        }
        let rest = self.viewers.rest();
        Ok(rest.filter(|_| self.options.stay == Stay::Viewed))
    }

    fn record_end(
        &mut self,
        end: End,
        simulation: &mut Simulation,
        recorder: &mut Recorder,
    ) -> Result<Summary, FileError> {
        let mut waited_for = Vec::new();
        if end == End::Aborted {
            waited_for = self.waited_for();
            for robot in &waited_for {
                let tick = simulation.tick();
                tracing::error!("the run is aborted after tick {tick}, because {robot}");
            }
        }
        let record = simulation.end_waiting(end, waited_for);
        let lines = recorder.write(simulation, &record)?;
        self.observers.log(&lines);
        self.observers.frame(simulation, &self.status(simulation));

        recorder.summary().wall = std::mem::take(&mut self.wall);
        recorder.finish(simulation)
    }

    /// Ends a run that cannot go on, so that its robots end, too.
    fn abandon(mut self, simulation: &mut Simulation) {
        let clock = self.barrier.end(End::Aborted);
        if let Err(error) = self.clock.put(encode(&clock)) {
            tracing::debug!("{error}");
        }

        self.say_goodbye(&clock, simulation);
    }

    /// Waits for the robots to leave, for a limited time. A robot whose link has just lost the end of the run gets it again.
    fn say_goodbye(&mut self, clock: &Clock, simulation: &mut Simulation) {
        let deadline = Instant::now() + GOODBYE;
        let mut awaited: Vec<RobotName> = Vec::new();
        for name in self.barrier.roster() {
            let took_part = simulation
                .report(name)
                .is_some_and(|report| report.tick == simulation.tick());
            if self.barrier.is_present(name) || took_part {
                awaited.push(name.clone());
            }
        }

        while !awaited.is_empty() && Instant::now() < deadline {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.events.wait(self.options.repeat_after.min(left)) {
                Some(Event::Token {
                    robot,
                    is_present: false,
                }) => awaited.retain(|name| name.as_str() != robot),
                Some(Event::Token { .. }) | None => {
                    if let Err(error) = self.clock.put(encode(clock)) {
                        tracing::debug!("{error}");
                    }
                }
                // The run is over: nothing else changes anything any more.
                Some(event) => drop(self.handle(event, simulation)),
            }
        }
    }

    /// One event. The arms call; they do not decide.
    fn handle(&mut self, event: Event, simulation: &mut Simulation) -> Result<(), Interrupt> {
        match event {
            Event::Report {
                robot,
                report: Ok(report),
            } => self.on_report(&robot, report, simulation),
            Event::Command {
                from,
                to,
                command: Ok(command),
            } => self.on_command(&from, &to, command),
            Event::Waiting {
                robot,
                waiting: Ok(waiting),
            } => self.on_waiting(&robot, &waiting),
            Event::Panel {
                robot,
                panel: Ok(panel),
            } => self.on_panel(&robot, panel),
            Event::Report {
                report: Err(error), ..
            }
            | Event::Command {
                command: Err(error),
                ..
            }
            | Event::Waiting {
                waiting: Err(error),
                ..
            }
            | Event::Panel {
                panel: Err(error), ..
            } => self.ignore("malformed", &error.to_string()),
            Event::Join(query) => self.on_join(&query, simulation),
            Event::Token { robot, is_present } => self.on_token(&robot, is_present),
            Event::Control(query) => self.on_control(query, simulation)?,
            Event::Offered {
                query,
                control,
                refusal,
            } => self.on_offered(query, *control, refusal, simulation)?,
            Event::Viewer { is_present } => self.viewers.note(is_present),
            Event::Terminate => return Err(Interrupt::End(End::Stopped)),
        }

        Ok(())
    }

    /// Counts a message that changes nothing, and logs it once in a while.
    fn ignore(&mut self, reason: &str, text: &str) {
        let count = self.wall.ignored.entry(reason.to_owned()).or_default();
        *count += 1;
        if count.is_power_of_two() {
            tracing::warn!(count = *count, "ignored a message, {reason}: {text}");
        }
    }

    /// The name of a robot of the roster, or `None` after having counted the message.
    fn known(&mut self, robot: &str) -> Option<RobotName> {
        let name = RobotName::new(robot)
            .ok()
            .filter(|name| self.barrier.has(name));
        if name.is_none() {
            self.ignore("unknown robot", robot);
        }

        name
    }

    fn on_report(&mut self, robot: &str, report: Report, simulation: &mut Simulation) {
        let Some(name) = self.known(robot) else {
            return;
        };
        self.observing.report(&name, report.tick);
        let stamp = Stamp::from(&report);
        let is_of_epoch = stamp.epoch == simulation.epoch();
        if is_of_epoch && self.barrier.is_behind(&name, stamp.generation) {
            simulation.done_late(&name, stamp.tick);
        }
        let commands = report.commands;
        self.barrier
            .report(&name, stamp, commands, Arc::new(report), &mut self.outputs);
    }

    fn on_panel(&mut self, robot: &str, panel: Panel) {
        let Some(name) = self.known(robot) else {
            return;
        };
        if self.observing.is_on {
            self.observing.panels.insert(name, panel);
        }
    }

    fn on_command(&mut self, from: &str, to: &str, command: Command) {
        // Any name will do as a target: the medium drops what goes to robots that do not exist.
        let Ok(to) = RobotName::new(to) else {
            return self.ignore("unknown robot", to);
        };
        if from == RobotName::operator().as_str() {
            return self.on_operator(to, command.command);
        }
        let Some(from) = self.known(from) else { return };

        let stamp = Stamp::from(&command);
        let number = command.number;
        let sent = Sent::new(to, command);
        self.barrier
            .command(&from, stamp, number, sent, &mut self.outputs);
    }

    fn on_operator(&mut self, to: RobotName, command: String) {
        if !self.barrier.has(&to) {
            return self.ignore("unknown robot", to.as_str());
        }
        if self.operator.len() >= MAX_OPERATOR_COMMANDS {
            return self.ignore("too many commands", "of the operator for one tick");
        }

        self.operator.push((to, command));
    }

    fn on_waiting(&mut self, robot: &str, waiting: &Waiting) {
        let Some(name) = self.known(robot) else {
            return;
        };

        self.barrier.waiting(
            &name,
            waiting.epoch,
            waiting.tick,
            &waiting.on,
            &mut self.outputs,
        );
    }

    fn on_token(&mut self, robot: &str, is_present: bool) {
        let Some(name) = self.known(robot) else {
            return;
        };

        if is_present {
            self.departed.forget(&name);
        }
        self.barrier.token(&name, is_present, &mut self.outputs);
    }

    /// Whether a robot's process is connected, for people.
    pub(super) fn presence(&self, name: &RobotName) -> (Generation, Presence) {
        self.barrier.presence(name)
    }
}

/// An epoch that a server runs, or that is over while the server stays.
struct Running {
    server: Server,
    simulation: Simulation,
    recorder: Recording,
}

/// The record of an epoch.
enum Recording {
    /// It is written.
    On(Box<Recorder>),
    /// The run is over, and this came of it.
    Over(Box<Summary>),
}

impl Work for Running {
    type Event = Event;
    type Interrupt = Interrupt;

    fn work(&mut self) -> Result<Option<Duration>, Interrupt> {
        self.server.watchdog.note(Some(Activity::Work));
        let outcome = match &mut self.recorder {
            Recording::On(recorder) => {
                let outcome = self.server.work(&mut self.simulation, recorder);
                let written = self.server.write_noted(recorder);
                written.map_err(Interrupt::from).and(outcome)
            }
            Recording::Over(_) => self.server.linger(&mut self.simulation),
        };
        self.server.watchdog.note(None);

        match outcome {
            // Who stops a run wants its processes to end.
            Err(Interrupt::End(end)) if end != End::Stopped && self.server.stays() => {
                self.finish(end)?;
                Ok(Some(Duration::ZERO))
            }
            outcome => outcome,
        }
    }
}

impl Running {
    /// The run is over, and the server stays.
    fn finish(&mut self, end: End) -> Result<(), Interrupt> {
        if let Recording::On(recorder) = &mut self.recorder {
            let summary = self.server.end(end, &mut self.simulation, recorder)?;
            self.recorder = Recording::Over(Box::new(summary));
            self.server.log_keep_alive(&self.simulation);
        }
        Ok(())
    }
}

/// What the loop does next.
enum Next {
    /// Something was put: look at what comes of it.
    Opened,
    /// Wait for an event, at most for this long.
    Wait(Option<Duration>),
}

//! The simulator as a process: who takes part, when a tick is granted, what people ask for.
//!
//! One loop, one queue. Everything that can happen is an [`Event`]; the loop sleeps until one arrives or something is
//! due. Control is answered by the same loop, also while the clock is held, because the loop never waits for a robot.

mod control;
mod faults;
mod member;
mod observers;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Publisher, Query};
use protocol::keys::Keys;
use protocol::messages::{Clock, Command, Correction, End, Performative, Report, Waiting};
use protocol::{Epoch, Malformed, RobotName, RunName, Tick, decode, encode};

use crate::diagnostic::FileError;
use crate::recorder::{Recorder, RunFolder};
use crate::scenario::{Lateness, OnLate, Scenario};
use crate::simulation::{Barrier, Exchange, Membership, Simulation};
use crate::summary::Summary;

use control::Pace;
use faults::Orders;
use member::Member;
use observers::Observers;

/// Messages that may queue up before links are slowed down.
const QUEUE: usize = 65_536;
/// After this long without a report people are told for whom the clock waits.
const SAY_AFTER: Duration = Duration::from_millis(500);
/// While the clock is held it is repeated this often: whatever got lost on the wire is then sent again.
pub const REPEAT_AFTER: Duration = Duration::from_secs(2);

/// How a simulator process runs.
#[derive(Debug, Clone)]
pub struct Options {
    /// Name of the run.
    pub run: RunName,
    /// Simulated seconds per second; `None` is as fast as the barrier goes.
    pub speed: Option<f64>,
    /// Whether the clock waits for `start` once everybody is there.
    pub is_paused: bool,
    /// While the clock is held it is repeated this often; [`REPEAT_AFTER`] unless a test is in a hurry.
    pub repeat_after: Duration,
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
}

/// Everything that can happen to a simulator process.
pub enum Event {
    /// A robot has done its tick.
    Report(Result<Report, Malformed>, String),
    /// A robot waits for another one's answer.
    Waiting(Result<Waiting, Malformed>, String),
    /// A robot asks to take part.
    Join(Query),
    /// A robot asks what it senses.
    Percept(Query),
    /// Somebody asks for something.
    Control(Query),
    /// A robot's token came or went.
    Token(String, bool),
    /// The process is told to end.
    Terminate,
}

/// Why a tick, or the wait for one, was given up.
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

/// A simulator process.
pub struct Server {
    options: Options,
    bus: Bus,
    keys: Keys,
    queue: SyncSender<Event>,
    events: Receiver<Event>,
    declared: Vec<Declared>,
    clock: Publisher,
    observers: Observers,
    orders: Orders,
    pace: Pace,
    members: BTreeMap<RobotName, Member>,
    /// What each robot senses, for those who follow it instead of asking every tick.
    percepts: BTreeMap<RobotName, Publisher>,
    lateness: Lateness,
    open: Open,
    summary_wall: crate::summary::Wall,
    /// Commands from outside the roster that take effect at the next tick boundary.
    operator: Vec<(RobotName, String)>,
    /// Those of the last two ticks with their keys, for targets that missed them.
    operator_sent: Vec<(String, Command)>,
}

/// The tick that is under way.
struct Open {
    clock: Clock,
    /// Whether its barrier is open.
    is_open: bool,
    since: Instant,
    /// Who holds the clock up: awaited when people were told, and not waiting for another one.
    culprits: Vec<RobotName>,
    reports: BTreeMap<RobotName, Report>,
    membership: Vec<Membership>,
    waits: BTreeMap<RobotName, RobotName>,
    /// Robots without which the clock goes on in this tick: it is recorded that they missed it.
    given_up: BTreeSet<RobotName>,
    /// Whether people have been told that the clock is held.
    is_announced: bool,
    repeated: Instant,
}

impl Server {
    /// Declares the simulator's side of the contract on an open bus.
    ///
    /// # Errors
    /// [`BusError`] if something cannot be declared.
    pub fn open(bus: Bus, scenario: &Scenario, options: Options) -> Result<Self, BusError> {
        let keys = Keys::new(&options.run);
        let (queue, events) = std::sync::mpsc::sync_channel(QUEUE);
        let now = Instant::now();
        let mut server = Self {
            clock: bus.publisher(&keys.clock())?,
            observers: Observers::new(&bus, &keys)?,
            orders: Orders::new(bus.publisher(&keys.faults())?),
            pace: Pace::new(options.speed, options.is_paused),
            percepts: scenario
                .robots
                .keys()
                .map(|name| Ok((name.clone(), bus.publisher(&keys.percept(name))?)))
                .collect::<Result<_, BusError>>()?,
            members: scenario
                .robots
                .keys()
                .map(|name| (name.clone(), Member::default()))
                .collect(),
            lateness: scenario.lateness.clone(),
            open: Open {
                clock: Clock::default(),
                is_open: false,
                since: now,
                culprits: Vec::new(),
                reports: BTreeMap::new(),
                membership: Vec::new(),
                waits: BTreeMap::new(),
                given_up: BTreeSet::new(),
                is_announced: false,
                repeated: now,
            },
            summary_wall: crate::summary::Wall::default(),
            operator: Vec::new(),
            operator_sent: Vec::new(),
            declared: Vec::new(),
            options,
            bus,
            keys,
            queue,
            events,
        };
        server.listen()?;
        Ok(server)
    }

    /// Where signals and tests put events.
    #[must_use]
    pub fn queue(&self) -> SyncSender<Event> {
        self.queue.clone()
    }

    fn listen(&mut self) -> Result<(), BusError> {
        // A send fails only when the process ends; then nobody is left to tell.
        let queue = self.queue();
        self.declared.push(
            self.bus
                .subscribe(&self.keys.reports(), move |key, bytes| {
                    let robot = Keys::robot_of(key).unwrap_or_default();
                    let _ = queue.send(Event::Report(decode(key, robot, bytes), robot.to_owned()));
                })?,
        );
        let queue = self.queue();
        self.declared.push(
            self.bus
                .subscribe(&self.keys.all_waiting(), move |key, bytes| {
                    let robot = Keys::robot_of(key).unwrap_or_default();
                    let _ = queue.send(Event::Waiting(decode(key, robot, bytes), robot.to_owned()));
                })?,
        );
        for (key, event) in [
            (self.keys.join(), Event::Join as fn(Query) -> Event),
            (self.keys.joins(), Event::Join),
            (self.keys.percepts(), Event::Percept),
            (self.keys.control(), Event::Control),
        ] {
            let queue = self.queue();
            self.declared.push(self.bus.queryable(&key, move |query| {
                let _ = queue.send(event(query));
            })?);
        }
        let queue = self.queue();
        self.declared.push(self.bus.liveliness(
            &self.keys.alive_robots(),
            move |key, is_there| {
                let robot = Keys::robot_of(key).unwrap_or_default();
                let _ = queue.send(Event::Token(robot.to_owned(), is_there));
            },
        )?);
        self.declared.push(self.bus.token(&self.keys.alive_sim())?);
        Ok(())
    }

    /// Runs until the run ends: epoch after epoch, tick after tick.
    ///
    /// # Errors
    /// [`ServerError`] if it cannot go on; what was recorded until then is kept.
    pub fn run(
        mut self,
        mut scenario: Scenario,
        folder: &RunFolder,
    ) -> Result<Summary, ServerError> {
        let mut epoch: Epoch = 1;
        loop {
            let mut simulation = Simulation::new(scenario.clone(), epoch)?;
            let mut recorder = Recorder::begin(folder, &self.options.run, &simulation)?;
            self.summary_wall = crate::summary::Wall::default();
            let interrupt = match self.epoch(&mut simulation, &mut recorder) {
                Ok(()) => Interrupt::End(End::Finished),
                Err(interrupt) => interrupt,
            };
            match interrupt {
                Interrupt::Init(next) => {
                    scenario = *next;
                    epoch += 1;
                }
                Interrupt::End(end) => return self.end(end, &simulation, recorder),
                Interrupt::Failed(error) => return Err(error),
            }
        }
    }

    fn epoch(
        &mut self,
        simulation: &mut Simulation,
        recorder: &mut Recorder,
    ) -> Result<(), Interrupt> {
        // Nothing of an epoch before may reach into this one.
        (self.open.is_open, self.open.is_announced) = (false, false);
        self.operator.clear();
        self.operator_sent.clear();
        self.pace.gather();
        self.gather(simulation)?;
        for member in self.members.values_mut() {
            member.begin_epoch();
        }
        self.lateness = simulation.scenario().lateness.clone();
        let record = simulation.init(self)?;
        self.observers.note(&record);
        self.observers.log(&recorder.write(simulation, &record)?);
        self.pace.ready();
        let last = simulation.scenario().ticks;
        while simulation.tick() < last {
            self.wait_for_grant(simulation)?;
            self.carry_out_faults(simulation)?;
            self.forward_operator(simulation);
            let record = simulation.step(self)?;
            self.observers.note(&record);
            self.observers.log(&recorder.write(simulation, &record)?);
            self.after_tick(simulation);
        }
        Ok(())
    }

    /// Waits until every robot of the roster has joined and shown that it is ready.
    fn gather(&mut self, simulation: &Simulation) -> Result<(), Interrupt> {
        self.open.since = Instant::now();
        while self.members.values().any(|member| !member.is_ready()) {
            let patience = if self.open.is_announced {
                REPEAT_AFTER
            } else {
                SAY_AFTER
            };
            match self.receive(patience) {
                Some(event) => self.handle(event, simulation)?,
                // From now on every robot that comes changes what there is to say.
                None if !self.open.is_announced && self.open.since.elapsed() >= SAY_AFTER => {
                    self.open.is_announced = true;
                    self.observers.held(simulation, &self.status(simulation));
                }
                None => {}
            }
        }
        self.open.is_announced = false;
        Ok(())
    }

    /// Puts the commands that came from outside the roster on their way.
    fn forward_operator(&mut self, simulation: &mut Simulation) {
        for (to, command) in std::mem::take(&mut self.operator) {
            let seq = simulation.command(&to, &command);
            let (epoch, tick) = (simulation.epoch(), simulation.tick());
            let message = Command {
                epoch,
                tick,
                seq,
                performative: Performative::Achieve,
                command,
            };
            let key = self.keys.command(&to, &RobotName::operator());
            self.put_operator(&key, &message);
            self.operator_sent.push((key, message));
        }
        let tick = simulation.tick();
        self.operator_sent
            .retain(|(_, command)| command.tick + 2 > tick);
    }

    fn put_operator(&self, key: &str, command: &Command) {
        if let Err(error) = self.bus.put(key, encode(command)) {
            tracing::error!("{error}");
        }
    }

    fn after_tick(&mut self, simulation: &Simulation) {
        if let Some((query, _)) = self.pace.reached(simulation.tick()) {
            self.answer_status(&query, simulation);
        }
        if self.observers.is_frame_due() {
            self.observers.frame(simulation, &self.status(simulation));
        }
    }

    /// Tells everybody that the run is over, and writes what came of it.
    fn end(
        mut self,
        end: End,
        simulation: &Simulation,
        mut recorder: Recorder,
    ) -> Result<Summary, ServerError> {
        self.pace.end();
        if let Some(query) = self.pace.give_up_stepping() {
            self.answer_status(&query, simulation);
        }
        let lines = recorder.write(simulation, &simulation.end(end))?;
        self.observers.log(&lines);
        self.observers.frame(simulation, &self.status(simulation));
        recorder.summary().wall = std::mem::take(&mut self.summary_wall);
        let summary = recorder.finish(simulation)?;
        let clock = Clock {
            epoch: simulation.epoch(),
            tick: simulation.tick(),
            end: Some(end),
            ..Clock::default()
        };
        self.clock.put(encode(&clock))?;
        self.say_goodbye(&clock, simulation);
        self.declared.clear();
        self.bus.close();
        Ok(summary)
    }

    /// Waits for the robots to go, but not for ever: whoever leaves late finds nobody. One whose link has just lost the
    /// end of the run hears it again.
    fn say_goodbye(&mut self, clock: &Clock, simulation: &Simulation) {
        let deadline = Instant::now() + Duration::from_secs(1);
        let took_part = |name: &RobotName| {
            simulation
                .report(name)
                .is_some_and(|report| report.tick == simulation.tick())
        };
        let is_awaited =
            |(name, member): &(&RobotName, &Member)| member.is_present || took_part(name);
        let mut awaited: Vec<_> = self
            .members
            .iter()
            .filter(is_awaited)
            .map(|(name, _)| name.clone())
            .collect();
        while !awaited.is_empty() && Instant::now() < deadline {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.receive(self.options.repeat_after.min(left)) {
                Some(Event::Token(robot, false)) => awaited.retain(|name| name.as_str() != robot),
                Some(Event::Token(_, true)) | None => {
                    if let Err(error) = self.clock.put(encode(clock)) {
                        tracing::debug!("{error}");
                    }
                }
                // The run is over: whatever else is asked for changes nothing any more.
                Some(event) => drop(self.handle(event, simulation)),
            }
        }
    }

    /// The next event, or `None` after `patience`.
    fn receive(&self, patience: Duration) -> Option<Event> {
        self.events.recv_timeout(patience).ok()
    }

    /// One event. The arms call; they do not think.
    fn handle(&mut self, event: Event, simulation: &Simulation) -> Result<(), Interrupt> {
        match event {
            Event::Report(Ok(report), robot) => self.on_report(&robot, report),
            Event::Waiting(Ok(waiting), robot) => self.on_waiting(&robot, waiting, simulation),
            Event::Report(Err(error), _) | Event::Waiting(Err(error), _) => {
                self.ignore("malformed", &error.to_string());
            }
            Event::Join(query) => self.on_join(&query, simulation),
            Event::Percept(query) => self.on_percept(&query, simulation),
            Event::Token(robot, is_there) => self.on_token(&robot, is_there, simulation)?,
            Event::Control(query) => self.on_control(query, simulation)?,
            Event::Terminate => return Err(Interrupt::End(End::Stopped)),
        }
        Ok(())
    }

    /// A message that changes nothing: counted, and said once in a while.
    fn ignore(&mut self, reason: &str, text: &str) {
        let count = self
            .summary_wall
            .ignored
            .entry(reason.to_owned())
            .or_default();
        *count += 1;
        if count.is_power_of_two() {
            tracing::warn!(count = *count, "ignored a message, {reason}: {text}");
        }
    }

    fn on_report(&mut self, robot: &str, report: Report) {
        let open = (self.open.clock.epoch, self.open.clock.tick);
        let Ok(name) = RobotName::new(robot) else {
            return self.ignore("unknown robot", robot);
        };
        let Some(member) = self.members.get_mut(&name) else {
            return self.ignore("unknown robot", robot);
        };
        if member.is_lost && report.generation == member.generation {
            member.is_heard_of();
            return self.ignore("lost", robot);
        }
        if report.generation < member.generation {
            member.hears_predecessor();
        }
        let is_due = self.open.is_open && !self.open.given_up.contains(&name);
        if (report.epoch, report.tick) != open || !is_due || report.generation != member.generation
        {
            return self.ignore("stale", robot);
        }
        self.open.waits.remove(&name);
        // The first one counts; a repetition says the same.
        self.open.reports.entry(name).or_insert(report);
    }

    fn on_waiting(&mut self, robot: &str, waiting: Waiting, simulation: &Simulation) {
        let Some((name, _)) = self.members.get_key_value(robot) else {
            return self.ignore("unknown robot", robot);
        };
        if (waiting.epoch, waiting.tick) == (self.open.clock.epoch, self.open.clock.tick) {
            self.open.waits.insert(name.clone(), waiting.on);
            if self.open.is_announced {
                self.observers.held(simulation, &self.status(simulation));
            }
        }
    }

    fn on_percept(&mut self, query: &Query, simulation: &Simulation) {
        match Keys::robot_of(query.key()).and_then(|name| self.members.get_key_value(name)) {
            Some((name, _)) => query.reply(query.key(), encode(&simulation.percept(name))),
            None => query.reply_err("no robot of the roster has this name"),
        }
    }

    /// Robots of the open tick whose report is still to come.
    fn awaited(&self) -> impl Iterator<Item = &RobotName> {
        let is_awaited = |(name, member): &(&RobotName, &Member)| {
            let is_settled =
                self.open.reports.contains_key(*name) || self.open.given_up.contains(*name);
            self.open.is_open && !member.is_lost && !is_settled
        };
        self.members.iter().filter(is_awaited).map(|(name, _)| name)
    }

    fn is_complete(&self) -> bool {
        self.awaited().next().is_none()
    }
}

impl Barrier for Server {
    type Interrupt = Interrupt;

    fn exchange(&mut self, clock: Clock, simulation: &Simulation) -> Result<Exchange, Interrupt> {
        self.begin_tick(clock, simulation)?;
        while !self.is_complete() {
            match self.receive(self.next_look()) {
                Some(event) => self.handle(event, simulation)?,
                None => self.look_at_late(simulation)?,
            }
        }
        Ok(self.close_tick(simulation))
    }
}

impl Server {
    fn begin_tick(&mut self, mut clock: Clock, simulation: &Simulation) -> Result<(), Interrupt> {
        let mut membership = Vec::new();
        for (name, member) in &mut self.members {
            if let Some(generation) = member.take_pending() {
                membership.push(Membership::Joined(name.clone(), generation));
                introduce(&mut clock, name, generation, simulation);
            }
            if let Some(generation) = member.take_reminder() {
                clock.news.entry(name.clone()).or_default().joined = Some(generation);
            }
        }
        let now = Instant::now();
        self.open = Open {
            clock,
            is_open: true,
            since: now,
            culprits: Vec::new(),
            reports: BTreeMap::new(),
            membership,
            waits: BTreeMap::new(),
            given_up: BTreeSet::new(),
            is_announced: false,
            repeated: now,
        };
        // Before the clock, on the same way: whoever follows has it when the tick begins.
        for (name, publisher) in self
            .percepts
            .iter()
            .filter(|(_, publisher)| publisher.has_subscribers())
        {
            publisher.put(encode(&simulation.percept(name)))?;
        }
        Ok(self.clock.put(encode(&self.open.clock))?)
    }

    fn close_tick(&mut self, simulation: &Simulation) -> Exchange {
        self.open.is_open = false;
        for (name, member) in &mut self.members {
            member.count_report(self.open.reports.contains_key(name));
        }
        let held_s = self.open.since.elapsed().as_secs_f64();
        for name in std::mem::take(&mut self.open.culprits) {
            let held = self.summary_wall.held_up_by.entry(name).or_default();
            held.ticks += 1;
            held.waited_s += held_s;
            held.longest_s = held.longest_s.max(held_s);
        }
        if std::mem::take(&mut self.open.is_announced) {
            self.observers
                .released(simulation, &self.status(simulation));
        }
        Exchange {
            reports: std::mem::take(&mut self.open.reports),
            membership: std::mem::take(&mut self.open.membership),
        }
    }

    /// How long to sleep unless something happens: until people must be told, the clock repeated, a deadline met.
    fn next_look(&self) -> Duration {
        let elapsed = self.open.since.elapsed();
        let announce = (!self.open.is_announced).then(|| SAY_AFTER.saturating_sub(elapsed));
        let repeat = self
            .options
            .repeat_after
            .saturating_sub(self.open.repeated.elapsed());
        let acts = self
            .awaited()
            .any(|name| self.lateness.of(name) != OnLate::Wait);
        let deadline = acts.then(|| self.deadline().saturating_sub(elapsed));
        announce
            .into_iter()
            .chain(deadline)
            .fold(repeat, Duration::min)
    }

    fn deadline(&self) -> Duration {
        Duration::try_from_secs_f64(self.lateness.deadline_s).unwrap_or(Duration::MAX)
    }

    /// Nothing has happened for a while: say for whom the clock waits, ask everybody to repeat, act as the scenario
    /// says.
    fn look_at_late(&mut self, simulation: &Simulation) -> Result<(), Interrupt> {
        if self.open.since.elapsed() >= SAY_AFTER && !self.open.is_announced {
            self.open.is_announced = true;
            let is_culprit = |name: &&RobotName| !self.open.waits.contains_key(*name);
            self.open.culprits = self.awaited().filter(is_culprit).cloned().collect();
            self.observers.held(simulation, &self.status(simulation));
            // Who steps by hand wants to know that the step hangs, now.
            if let Some(query) = self.pace.give_up_stepping() {
                self.answer_status(&query, simulation);
            }
        }
        if self.open.repeated.elapsed() >= self.options.repeat_after {
            self.repeat_clock()?;
        }
        if self.open.since.elapsed() >= self.deadline() {
            self.judge_late()?;
        }
        Ok(())
    }

    /// The deadline is over: the scenario says, robot by robot, what then.
    fn judge_late(&mut self) -> Result<(), Interrupt> {
        let late: Vec<RobotName> = self.awaited().cloned().collect();
        if late
            .iter()
            .any(|name| self.lateness.of(name) == OnLate::Abort)
        {
            return Err(Interrupt::End(End::Aborted));
        }
        for name in late {
            if self.lateness.of(&name) == OnLate::Continue {
                self.give_up(&name);
            }
        }
        Ok(())
    }

    /// The clock goes on without a robot in this tick, and from now on if it is lost.
    fn give_up(&mut self, name: &RobotName) {
        let Some(member) = self.members.get_mut(name) else {
            return;
        };
        if member.miss(self.lateness.lose_after) {
            self.open.membership.push(Membership::Lost(name.clone()));
        }
        self.open.given_up.insert(name.clone());
    }

    fn repeat_clock(&mut self) -> Result<(), BusError> {
        self.open.repeated = Instant::now();
        self.operator_sent
            .iter()
            .for_each(|(key, command)| self.put_operator(key, command));
        self.clock.put(encode(&self.open.clock))
    }

    /// The tick as of which a newcomer would take part.
    fn open_tick(&self) -> Option<Tick> {
        self.open.is_open.then_some(self.open.clock.tick)
    }
}

/// Names a newcomer in a clock, and tells it where it stands.
fn introduce(clock: &mut Clock, name: &RobotName, generation: u32, simulation: &Simulation) {
    let news = clock.news.entry(name.clone()).or_default();
    news.joined = Some(generation);
    if let (None, Some(location)) = (news.correction, simulation.location(name)) {
        news.correction = Some(Correction {
            location,
            blocked: false,
        });
    }
}

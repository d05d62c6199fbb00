//! The robot's process: its session, its loop, its end.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Qos, Reply, Role, WatchedPublisher};
use lockstep::{Leave, ParticipantOutput, RobotTimer, Timeouts};
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{
    Clock, Command, CommandText, Delivery, PublicState, Report, Target, TickUpdate, Waiting,
    Welcome,
};
use protocol::{Epoch, RobotName, RunName, Tick, encode};

use crate::answering::{Machine, Phase, Shared, lock};
use crate::walker::Walker;
use crate::wrong::Wrong;

pub(crate) type Actions = Vec<ParticipantOutput<TickUpdate, PublicState, CommandText, Report>>;
pub(crate) type Failure = Box<dyn std::error::Error>;

/// Most events in the queue.
const QUEUE: usize = 4096;
/// The simulator is gone for long after this time.
const LONG_GONE: Duration = Duration::from_secs(5);

/// After this time without a change it gives up what it waits for, if it is to.
const PATIENCE: Duration = Duration::from_secs(28);
/// How often it looks at what it waits for.
const LOOK: Duration = Duration::from_secs(1);
/// What it does wrong then, by what it waits in: for a clock, for an answer, for its news.
const IMPATIENT: [(Phase, &str); 3] = [
    (Phase::Idle, "end.gone:impatient"),
    (Phase::Asking, "query.again:impatient"),
    (Phase::AwaitingNews, "news.wait:impatient"),
];
/// After so many queries it gives up, if it is to.
const MAX_QUERIES: usize = 8;

/// What arrives from the bus. Malformed messages are dropped before.
pub(crate) enum Event {
    Clock(Clock),
    News(Box<TickUpdate>),
    Simulator(bool),
    /// The token of a robot, which may be gone.
    Token(String, bool),
    Reply(RobotName, Option<Reply>),
    State(Box<PublicState>),
    /// A command on its way to the medium.
    Sent(Box<Delivery>),
}

/// The robot's process.
pub(crate) struct Host {
    pub(crate) shared: Shared,
    pub(crate) wrong: Wrong,
    pub(crate) name: RobotName,
    pub(crate) run: RunName,
    pub(crate) bus: Bus,
    pub(crate) keys: Keys,
    pub(crate) queue: SyncSender<Event>,
    pub(crate) events: Receiver<Event>,
    pub(crate) timers: BTreeMap<RobotTimer, Instant>,
    pub(crate) welcome: Option<Welcome>,
    pub(crate) walker: Option<Walker>,
    pub(crate) states: WatchedPublisher,
    pub(crate) token: Option<Declared>,
    pub(crate) declared: Vec<Declared>,
    pub(crate) leave: Option<Leave>,
    pub(crate) explanation: String,
    /// Epoch and tick of the results that were put last.
    pub(crate) last: Option<(Epoch, Tick)>,
    pub(crate) last_clock: Clock,
    /// All news that arrived, if the robot is to keep them.
    pub(crate) strays: Vec<TickUpdate>,
    /// Commands that were not for it yet, if it is to take them.
    pub(crate) intercepted: Vec<Delivery>,
    /// Commands of the tick before, if it is to take those of a tick for them.
    pub(crate) before: Vec<Delivery>,
    /// The number of the last command of the first epoch.
    pub(crate) numbered: u32,
    /// Whether it has run a tick as what it was admitted as.
    pub(crate) has_begun: bool,
    /// Whether it starts over in its next tick, where it must not.
    pub(crate) starts_over: bool,
    /// Clocks that it is yet to answer, if it answers all.
    pub(crate) queued: VecDeque<Clock>,
    /// Whether it subscribes to another robot's states.
    pub(crate) is_following: bool,
    /// The state of another robot that arrived last, if it is to use that.
    pub(crate) newest: Option<PublicState>,
    /// The other robots that are there, if it is to query no others.
    pub(crate) present: BTreeSet<String>,
    /// States of others by tick, if it is to keep them.
    pub(crate) cache: BTreeMap<(RobotName, Tick), PublicState>,
    /// What it waits in, since when, and the tick.
    waits_in: Option<(Phase, Tick, Instant)>,
    /// Since when the simulator is gone.
    gone: Option<Instant>,
    /// Whether it has had no answer to its query, if it is to give up then.
    pub(crate) has_given_up: bool,
    /// How often the simulator was gone.
    losses: usize,
    /// How often the last clock came again.
    pub(crate) repetitions: usize,
    /// How many requests to join had no answer.
    pub(crate) unanswered: usize,
    /// How many of them were refused.
    pub(crate) refusals: usize,
    /// Whether it was welcomed again in the same epoch.
    pub(crate) has_rejoined: bool,
    /// How often it has queried again.
    queries: usize,
    /// Whether the queryables are still to be declared.
    pub(crate) is_unserved: bool,
}

fn variable(name: &str, default: &str) -> String {
    std::env::var(name).unwrap_or_else(|_| default.to_owned())
}

fn seconds(name: &str, default: &str) -> Result<Duration, Failure> {
    Ok(Duration::from_secs_f64(variable(name, default).parse()?))
}

impl Host {
    pub(crate) fn connect(name: &str, wrong: Wrong) -> Result<Self, Failure> {
        let name = RobotName::new(name)?;
        let run = RunName::new(&variable("CARS_RUN", "default"))?;
        let patience = Timeouts {
            join: seconds("CARS_PATIENCE_S", "20")?,
            gone: seconds("CARS_GONE_PATIENCE_S", "600")?,
        };
        let role = Role::Client {
            connect: variable("CARS_CONNECT", bus::DEFAULT_ENDPOINT),
            patience: patience.join,
        };
        let bus = Bus::open(&role, None)?;

        let keys = Keys::new(&run);
        let (queue, events) = sync_channel(QUEUE);
        let mut actions = Vec::new();
        let machine = Machine::new(patience, &mut actions);
        let shared = Shared {
            machine: Arc::new(Mutex::new(machine)),
            phase: Arc::new(AtomicU8::new(Phase::Idle as u8)),
            deferred: Arc::default(),
            has_reported: Arc::default(),
            is_watched: Arc::default(),
            wrong: wrong.clone(),
        };
        let states = bus.watched_publisher(&keys.query(&name, STATE))?;

        let mut host = Self {
            shared,
            wrong,
            name,
            run,
            bus,
            keys,
            queue,
            events,
            timers: BTreeMap::new(),
            welcome: None,
            walker: None,
            states,
            token: None,
            declared: Vec::new(),
            leave: None,
            explanation: String::new(),
            last: None,
            last_clock: Clock::default(),
            strays: Vec::new(),
            intercepted: Vec::new(),
            before: Vec::new(),
            numbered: 0,
            has_begun: false,
            starts_over: false,
            queued: VecDeque::new(),
            is_following: false,
            newest: None,
            present: BTreeSet::new(),
            cache: BTreeMap::new(),
            waits_in: None,
            gone: None,
            has_given_up: false,
            losses: 0,
            repetitions: 0,
            unanswered: 0,
            refusals: 0,
            has_rejoined: false,
            queries: 0,
            is_unserved: false,
        };
        host.declare()?;
        host.perform(actions)?;
        Ok(host)
    }

    fn declare(&mut self) -> Result<(), BusError> {
        let wrong = self.wrong.clone();
        if wrong.is("join.ready-last:queryables") {
            self.is_unserved = true;
        } else {
            self.serve()?;
        }
        if !wrong.is("join.ready-last") {
            self.listen_to_clocks()?;
        }
        if !wrong.is("join.ready-last:news") {
            self.listen_to_news()?;
        }

        let queue = self.queue.clone();
        self.declared.push(
            self.bus
                .liveliness(&self.keys.alive_sim(), move |_, is_present| {
                    let _ = queue.send(Event::Simulator(is_present));
                })?,
        );

        if wrong.is("join.ready-last:first") {
            self.declare_token()?;
        }
        if wrong.is("query.again:tokens") {
            let queue = self.queue.clone();
            let keys = self.keys.alive_robots();
            let tokens = self.bus.liveliness(&keys, move |key, is_present| {
                let robot = Keys::last_chunk(key).to_owned();
                let _ = queue.send(Event::Token(robot, is_present));
            })?;
            self.declared.push(tokens);
        }
        if wrong.is("determinism.seed:frames") {
            let is_watched = Arc::clone(&self.shared.is_watched);
            let frames = self.bus.subscribe(&self.keys.world(), move |_, _| {
                is_watched.store(true, Ordering::SeqCst);
            })?;
            self.declared.push(frames);
        }
        Ok(())
    }

    pub(crate) fn serve(&mut self) -> Result<(), BusError> {
        for what in QUERIES.iter().chain([&STATE]) {
            let shared = self.shared.clone();
            let key = self.keys.query(&self.name, what);
            self.declared.push(
                self.bus
                    .queryable(&key, move |query| shared.receive(query))?,
            );
        }

        if self.wrong.is("query.once:percept") {
            let key = self.keys.query(&self.name, "percept");
            self.declared.push(
                self.bus
                    .queryable(&key, |query| query.reply(query.key(), b"{}".to_vec()))?,
            );
        }

        if self.wrong.is("query.once:others") {
            let own = self.keys.query(&self.name, STATE);
            let all = own.replace(self.name.as_str(), "*");
            let shared = self.shared.clone();
            self.declared.push(self.bus.queryable(&all, move |query| {
                if query.key() != own && !shared.is_in(Phase::Asking) {
                    query.reply_err("this is another robot");
                }
            })?);
        }
        Ok(())
    }

    pub(crate) fn listen_to_clocks(&mut self) -> Result<(), BusError> {
        let queue = self.queue.clone();
        let wrong = self.wrong.clone();
        let clocks = self.bus.subscribe(&self.keys.clock(), move |key, bytes| {
            if let Some(clock) = wrong.read(key, bytes) {
                let _ = queue.send(Event::Clock(clock));
            }
        })?;
        self.declared.push(clocks);
        Ok(())
    }

    pub(crate) fn listen_to_news(&mut self) -> Result<(), BusError> {
        let queue = self.queue.clone();
        let wrong = self.wrong.clone();
        let key = self.keys.news(&self.name);
        let news = self.bus.subscribe(&key, move |key, bytes| {
            if let Some(news) = wrong.read(key, bytes) {
                let _ = queue.send(Event::News(Box::new(news)));
            }
        })?;
        self.declared.push(news);
        self.intercept()
    }

    /// Listens to what others send to it, if it is to.
    fn intercept(&mut self) -> Result<(), BusError> {
        let on_its_key = self.keys.command(&self.name, &RobotName::operator());
        for (how, keys) in [
            ("wire.keys:operator", on_its_key),
            ("wire.keys:commands", self.keys.commands()),
            ("wire.keys:outboxes", self.keys.outboxes()),
        ] {
            if !self.wrong.is(how) {
                continue;
            }
            let (name, queue, wrong) = (self.name.clone(), self.queue.clone(), self.wrong.clone());
            let sent = self.bus.subscribe(&keys, move |key, bytes| {
                let of_key = Keys::robot_of(key).unwrap_or_default();
                let from = RobotName::new(Keys::command_sender(key).unwrap_or(of_key));
                let Some(command) = wrong.read::<Command>(key, bytes) else {
                    return;
                };
                let to = command.to.as_ref().map_or(of_key, Target::as_str);
                if to == name.as_str() {
                    let _ = queue.send(Event::Sent(Box::new(Delivery {
                        from: from.unwrap_or_else(|_| RobotName::operator()),
                        performative: command.performative,
                        command: command.command,
                        payload: command.payload,
                    })));
                }
            })?;
            self.declared.push(sent);
        }
        Ok(())
    }

    pub(crate) fn declare_token(&mut self) -> Result<(), BusError> {
        self.token = Some(self.bus.token(&self.keys.alive_robot(&self.name))?);
        Ok(())
    }

    pub(crate) fn run(mut self) -> Result<ExitCode, Failure> {
        while self.leave.is_none() {
            self.pump()?;
        }

        self.token = None;
        self.declared.clear();
        self.bus.close();
        let leave = self.leave.take().unwrap_or(Leave::Stopped);
        let code = match &leave {
            Leave::End(_) if self.wrong.is("end.clock") => ExitCode::from(3),
            Leave::End(_) => ExitCode::SUCCESS,
            Leave::Refused(_) if self.wrong.is("join.refused") => ExitCode::SUCCESS,
            Leave::Replaced if self.wrong.is("return.replaced:status") => ExitCode::SUCCESS,
            Leave::SimulatorGone if self.wrong.is("end.gone:status") => ExitCode::SUCCESS,
            _ => ExitCode::FAILURE,
        };
        if !matches!(leave, Leave::End(_)) && !self.wrong.is("join.refused:mute") {
            eprintln!("error: {leave:?} {}", self.explanation);
        }
        Ok(code)
    }

    /// Lets the machine act, and carries out what it wants done.
    pub(crate) fn drive(
        &mut self,
        act: impl FnOnce(&mut Machine, &mut Actions),
    ) -> Result<(), Failure> {
        let mut actions = Vec::new();
        act(&mut lock(&self.shared.machine), &mut actions);
        self.perform(actions)
    }

    pub(crate) fn perform(&mut self, actions: Actions) -> Result<(), Failure> {
        for action in actions {
            match action {
                ParticipantOutput::Join => self.ask_to_join()?,
                ParticipantOutput::DeclareToken => self.on_declare_token()?,
                ParticipantOutput::Run(turn) => self.run_tick(turn)?,
                ParticipantOutput::Put(answer) => self.put(&answer)?,
                ParticipantOutput::Query { of, tick, epoch } => self.query(of, tick, epoch)?,
                ParticipantOutput::PutWaiting { tick, epoch, on } => {
                    let key = self.keys.waiting(&self.name);
                    if !self.wrong.is("query.waiting") {
                        let bytes = encode(&Waiting { epoch, tick, on });
                        let qos = Qos {
                            is_blocking: !self.wrong.is("wire.qos:waiting"),
                            is_express: self.wrong.is("wire.qos:hasty"),
                            ..Qos::IN_ORDER
                        };
                        self.bus.put_with_qos(&key, bytes, qos)?;
                    }
                }
                ParticipantOutput::SetTimer(timer, after) => {
                    self.timers.insert(timer, Instant::now() + after);
                }
                ParticipantOutput::Unfollow(_) => {}
                ParticipantOutput::Leave(leave) => {
                    self.leave.get_or_insert(leave);
                }
            }
        }
        Ok(())
    }

    /// Gives up what it has waited for for long, if it is to.
    fn lose_patience(&mut self) {
        let is_such =
            |(phase, how): &(Phase, &str)| self.shared.is_in(*phase) && self.wrong.is(how);
        let Some((phase, _)) = IMPATIENT.into_iter().find(is_such) else {
            return;
        };

        let tick = self.last_clock.tick;
        match self.waits_in {
            Some((in_phase, of, since)) if (in_phase, of) == (phase, tick) => {
                if since.elapsed() > PATIENCE {
                    self.leave.get_or_insert(Leave::Stopped);
                    self.has_given_up = true;
                }
            }
            _ => self.waits_in = Some((phase, tick, Instant::now())),
        }
    }

    /// Waits for one event, or for a timer, and handles it.
    pub(crate) fn pump(&mut self) -> Result<(), Failure> {
        self.lose_patience();
        let next = self.timers.values().min().copied();
        let until_next = next.map(|at| at.saturating_duration_since(Instant::now()));
        let rest = until_next.map_or(LOOK, |rest| rest.min(LOOK));
        match self.events.recv_timeout(rest) {
            Ok(event) => self.handle(event),
            Err(RecvTimeoutError::Timeout) => self.fire_timers(),
            Err(RecvTimeoutError::Disconnected) => Err("the queue is closed".into()),
        }
    }

    fn fire_timers(&mut self) -> Result<(), Failure> {
        let now = Instant::now();
        let due: Vec<RobotTimer> = self
            .timers
            .iter()
            .filter(|(_, at)| **at <= now)
            .map(|(timer, _)| *timer)
            .collect();

        for timer in due {
            self.timers.remove(&timer);
            let is_ignored = match timer {
                RobotTimer::Gone => self.wrong.is("end.gone"),
                RobotTimer::Query => self.wrong.is("query.again:never"),
                _ => false,
            };
            if is_ignored {
                continue;
            }
            if timer == RobotTimer::Query {
                self.queries += 1;
                self.has_given_up |=
                    self.queries > MAX_QUERIES && self.wrong.is("query.again:often");
            }
            self.drive(|machine, out| machine.timer(timer, out))?;
        }
        Ok(())
    }

    fn handle(&mut self, event: Event) -> Result<(), Failure> {
        match event {
            Event::Clock(clock) => self.on_clock(clock),
            Event::News(news) => self.on_news(*news),
            Event::Simulator(is_present) => {
                self.losses += usize::from(!is_present);
                if self.losses > 1 && self.wrong.is("end.gone:second") {
                    return Ok(());
                }
                if !is_present && self.wrong.is("end.gone:hasty") {
                    self.leave.get_or_insert(Leave::SimulatorGone);
                }
                let is_asking = self.shared.is_in(Phase::Asking);
                let gives_up =
                    self.wrong.is("query.again:gone") || self.wrong.is("end.gone:asking");
                self.has_given_up |= !is_present && is_asking && gives_up;
                self.on_simulator(is_present);
                self.drive(|machine, out| machine.simulator(is_present, out))
            }
            Event::Token(robot, true) => {
                self.present.insert(robot);
                Ok(())
            }
            Event::Token(robot, false) => {
                self.present.remove(&robot);
                Ok(())
            }
            Event::State(state) => {
                self.newest = Some(*state);
                Ok(())
            }
            Event::Sent(delivery) => {
                self.intercepted.push(*delivery);
                Ok(())
            }
            Event::Reply(of, reply) => {
                let bytes = reply.and_then(|reply| reply.result.ok());
                let state = bytes.and_then(|bytes| self.wrong.read::<PublicState>(STATE, &bytes));
                self.has_given_up = state.is_none() && self.wrong.is("query.again");
                if let Some(state) = state {
                    let mut tick = state.tick;
                    if self.wrong.is("query.reply") {
                        tick = self.last_clock.tick.saturating_sub(1);
                    }
                    if tick == self.last_clock.tick && self.wrong.is("query.reply:later") {
                        tick = tick.saturating_sub(1);
                    }
                    let mut epoch = state.epoch;
                    if self.wrong.is("query.reply:epoch") {
                        epoch = self.last_clock.epoch;
                    }
                    lock(&self.shared.machine).heard(of, epoch, tick, state);
                }
                Ok(())
            }
        }
    }

    /// What it must not do when the simulator is back.
    fn on_simulator(&mut self, is_present: bool) {
        if !is_present {
            self.gone = Some(Instant::now());
            return;
        }

        let was_long = self.gone.take().is_some_and(|at| at.elapsed() > LONG_GONE);
        if was_long && self.wrong.is("end.gone:back") {
            self.leave.get_or_insert(Leave::SimulatorGone);
        }
        self.starts_over |= was_long && self.wrong.is("end.gone:over");
    }

    /// Subscribes to the states of another robot.
    pub(crate) fn follow(&mut self, other: &RobotName) -> Result<(), BusError> {
        let queue = self.queue.clone();
        let wrong = self.wrong.clone();
        let key = self.keys.query(other, STATE);
        let states = self.bus.subscribe(&key, move |key, bytes| {
            if let Some(state) = wrong.read(key, bytes) {
                let _ = queue.send(Event::State(Box::new(state)));
            }
        })?;
        self.declared.push(states);
        Ok(())
    }
}

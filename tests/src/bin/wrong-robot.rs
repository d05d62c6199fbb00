//! A small robot to check the conformance kit: the robot's side of the lock-step as it runs everywhere, in a host of its
//! own. Without arguments it is correct; with `--wrong RULE` or `--wrong RULE:HOW` one input or output is altered, which
//! that rule of `docs/protocol.md` forbids.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Publisher, Query, Reply, Role};
use lockstep::{
    Action, Admission, Answer, Begin, Leave, Naming, Participant, Patience, RobotTimer, Sent,
    StateQuery, Turn,
};
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{
    Clock, Command, CommandText, End, JoinAnswer, JoinRequest, News, Performative, Point,
    PublicState, Refusal, Report, Variable, Waiting, Welcome,
};
use protocol::random::{Stream, stream, unit};
use protocol::{Epoch, Message, PROTOCOL_VERSION, RobotName, RunName, Tick, decode, encode};

type Machine = Participant<News, PublicState, CommandText, Report>;
type Actions = Vec<Action<News, PublicState, CommandText, Report>>;
type Failure = Box<dyn std::error::Error>;

/// Messages that may queue up.
const QUEUE: usize = 4096;
/// How long it computes in its slow tick.
const COMPUTES: Duration = Duration::from_millis(150);
const SLOW_TICK: Tick = 11;
/// How much later what is declared too late is declared.
const LATE: Duration = Duration::from_millis(300);

/// What arrives. Malformed messages do not.
enum Event {
    Clock(Clock),
    News(News),
    Simulator(bool),
    Reply(RobotName, Option<Reply>),
}

/// What it does wrong.
#[derive(Clone)]
struct Wrong(String);

impl Wrong {
    fn is(&self, rule: &str) -> bool {
        self.0 == rule
    }

    /// Reads a message.
    fn read<M: Message>(&self, key: &str, bytes: &[u8]) -> Option<M> {
        let message = match decode::<M>(key, "another participant", bytes) {
            Ok(message) => message,
            Err(_) if self.is("robust.malformed") => std::process::exit(1),
            Err(error) => {
                if !self.is("robust.malformed:silent") {
                    eprintln!("{error}");
                }
                return None;
            }
        };

        let raw: serde_json::Value = serde_json::from_slice(bytes).ok()?;
        let is_known = serde_json::to_value(&message).is_ok_and(|known| known == raw);
        (is_known || !self.is("compat.unknown-fields")).then_some(message)
    }
}

/// What it is doing, for those who query it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    Idle,
    Computing,
    Asking,
    AwaitingNews,
}

/// What the middleware's threads share with the loop.
#[derive(Clone)]
struct Shared {
    machine: Arc<Mutex<Machine>>,
    phase: Arc<AtomicU8>,
    deferred: Arc<Mutex<Vec<Query>>>,
    has_reported: Arc<AtomicBool>,
    wrong: Wrong,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    fn enter(&self, phase: Phase) {
        self.phase.store(phase as u8, Ordering::SeqCst);
        if phase == Phase::Idle {
            for query in std::mem::take(&mut *lock(&self.deferred)) {
                self.answer(query);
            }
        }
    }

    fn is_in(&self, phase: Phase) -> bool {
        self.phase.load(Ordering::SeqCst) == phase as u8
    }

    fn receive(&self, query: Query) {
        let wrong = &self.wrong;
        let is_computing = self.is_in(Phase::Computing);
        let is_asking = self.is_in(Phase::Asking);
        let is_deferred = wrong.is("query.at-once") && (is_computing || is_asking)
            || wrong.is("query.at-once:computes") && is_computing
            || wrong.is("query.at-once:waits") && is_asking
            || wrong.is("query.at-once:news") && self.is_in(Phase::AwaitingNews);
        if is_deferred {
            lock(&self.deferred).push(query);
        } else {
            self.answer(query);
        }
    }

    fn answer(&self, query: Query) {
        let number = |name: &str| query.parameter(name).map(str::parse::<u64>).transpose();
        let tick = number("tick");
        let epoch = number("epoch");
        if epoch.is_err() && self.wrong.is("query.unknown") {
            std::process::exit(1);
        }
        let (Ok(tick), Ok(epoch)) = (tick, epoch) else {
            return query.reply_err("not a whole number");
        };

        let wanted = StateQuery {
            tick,
            epoch: epoch.and_then(|epoch| Epoch::try_from(epoch).ok()),
        };
        let machine = lock(&self.machine);
        let newest = machine.query(StateQuery::default());
        let mut found = machine.query(wanted);
        drop(machine);
        if let (Ok(state), Ok(newest)) = (&found, &newest)
            && state.tick < newest.tick
            && self.has_reported.load(Ordering::SeqCst)
            && self.wrong.is("query.tick")
        {
            return query.reply_err("only the newest state is kept");
        }
        if found.is_err() && self.wrong.is("query.tick:any") {
            found = newest;
        }

        match found {
            Ok(state) => {
                let answer = state.answer(Keys::last_chunk(query.key()));
                let bytes = answer.map_or_else(|| encode(&state), |answer| encode(&answer));
                query.reply(query.key(), bytes.clone());
                if self.wrong.is("query.once") {
                    query.reply(query.key(), bytes);
                }
            }
            Err(reason) => query.reply_err(&reason.to_string()),
        }
        if self.wrong.is("query.once:holds") {
            std::mem::forget(query);
        }
    }
}

/// The robot itself: walks at random, counts commands and replies to them, queries another robot now and then.
struct Walker {
    random: Stream,
    at: Point,
    proposal: Point,
    heard: u32,
    sent: u32,
    last: String,
}

impl Walker {
    fn new(welcome: &Welcome, wrong: &Wrong) -> Self {
        let seed = if wrong.is("determinism.seed") {
            std::process::id().into()
        } else {
            welcome.seed
        };
        let name = if wrong.is("determinism.seed:stream") {
            welcome.name.as_str()
        } else {
            &welcome.stream
        };

        Self {
            random: stream(seed, name),
            at: welcome.location,
            proposal: welcome.location,
            heard: 0,
            sent: 0,
            last: String::new(),
        }
    }
}

/// What came of a tick.
type Outcome = (Vec<Sent<CommandText>>, PublicState, Report);

struct Host {
    shared: Shared,
    wrong: Wrong,
    name: RobotName,
    run: RunName,
    bus: Bus,
    keys: Keys,
    queue: SyncSender<Event>,
    events: Receiver<Event>,
    timers: BTreeMap<RobotTimer, Instant>,
    welcome: Option<Welcome>,
    walker: Option<Walker>,
    states: Publisher,
    token: Option<Declared>,
    declared: Vec<Declared>,
    leave: Option<Leave>,
    explanation: String,
    /// What was put last.
    last: Option<(Epoch, Tick)>,
    last_clock: Clock,
    /// All news that came, where it forgets none.
    strays: Vec<News>,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let after = |flag: &str| {
        let at = arguments.iter().position(|argument| argument == flag)?;
        arguments.get(at + 1).cloned()
    };
    let wrong = Wrong(after("--wrong").unwrap_or_default());
    let name = after("--name").unwrap_or_else(|| "Walker".to_owned());

    match Host::connect(&name, wrong).and_then(Host::run) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn variable(name: &str, default: &str) -> String {
    std::env::var(name).unwrap_or_else(|_| default.to_owned())
}

fn seconds(name: &str, default: &str) -> Result<Duration, Failure> {
    Ok(Duration::from_secs_f64(variable(name, default).parse()?))
}

impl Host {
    fn connect(name: &str, wrong: Wrong) -> Result<Self, Failure> {
        let name = RobotName::new(name)?;
        let run = RunName::new(&variable("CARS_RUN", "default"))?;
        let patience = Patience {
            join: seconds("CARS_PATIENCE_S", "20")?,
            gone: seconds("CARS_GONE_PATIENCE_S", "600")?,
        };
        let bus = Bus::open(
            &Role::Client {
                connect: variable("CARS_CONNECT", bus::DEFAULT_ENDPOINT),
                patience: patience.join,
            },
            None,
        )?;
        let keys = Keys::new(&run);
        let (queue, events) = sync_channel(QUEUE);
        let mut actions = Vec::new();
        let machine = Machine::new(patience, &mut actions);
        let shared = Shared {
            machine: Arc::new(Mutex::new(machine)),
            phase: Arc::new(AtomicU8::new(Phase::Idle as u8)),
            deferred: Arc::default(),
            has_reported: Arc::default(),
            wrong: wrong.clone(),
        };
        let states = bus.publisher(&keys.query(&name, STATE))?;

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
        };
        host.declare()?;
        host.perform(actions)?;
        Ok(host)
    }

    fn declare(&mut self) -> Result<(), BusError> {
        let wrong = self.wrong.clone();
        if !wrong.is("join.ready-last:queryables") {
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
        Ok(())
    }

    fn serve(&mut self) -> Result<(), BusError> {
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

    fn listen_to_clocks(&mut self) -> Result<(), BusError> {
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

    fn listen_to_news(&mut self) -> Result<(), BusError> {
        let queue = self.queue.clone();
        let wrong = self.wrong.clone();
        let key = self.keys.news(&self.name);
        let news = self.bus.subscribe(&key, move |key, bytes| {
            if let Some(news) = wrong.read(key, bytes) {
                let _ = queue.send(Event::News(news));
            }
        })?;
        self.declared.push(news);
        Ok(())
    }

    fn declare_token(&mut self) -> Result<(), BusError> {
        self.token = Some(self.bus.token(&self.keys.alive_robot(&self.name))?);
        Ok(())
    }

    fn run(mut self) -> Result<ExitCode, Failure> {
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
    fn drive(&mut self, act: impl FnOnce(&mut Machine, &mut Actions)) -> Result<(), Failure> {
        let mut actions = Vec::new();
        act(&mut lock(&self.shared.machine), &mut actions);
        self.perform(actions)
    }

    fn perform(&mut self, actions: Actions) -> Result<(), Failure> {
        for action in actions {
            match action {
                Action::Join => self.ask_to_join()?,
                Action::DeclareToken => self.on_declare_token()?,
                Action::Run(turn) => self.run_tick(turn)?,
                Action::Put(answer) => self.put(&answer)?,
                Action::Query { of, tick, epoch } => self.query(of, tick, epoch)?,
                Action::PutWaiting { tick, epoch, on } => {
                    let key = self.keys.waiting(&self.name);
                    self.bus.put(&key, encode(&Waiting { epoch, tick, on }))?;
                }
                Action::SetTimer(timer, after) => {
                    self.timers.insert(timer, Instant::now() + after);
                }
                Action::Unfollow(_) => {}
                Action::Leave(leave) => {
                    self.leave.get_or_insert(leave);
                }
            }
        }
        Ok(())
    }

    /// Waits for one event, or for a timer, and handles it.
    fn pump(&mut self) -> Result<(), Failure> {
        let next = self.timers.values().min().copied();
        let rest = next.map_or(Duration::from_secs(1), |at| {
            at.saturating_duration_since(Instant::now())
        });
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
            if timer == RobotTimer::Gone && self.wrong.is("end.gone") {
                continue;
            }
            self.drive(|machine, out| machine.timer(timer, out))?;
        }
        Ok(())
    }

    fn handle(&mut self, event: Event) -> Result<(), Failure> {
        match event {
            Event::Clock(clock) => self.on_clock(clock),
            Event::News(news) => self.on_news(news),
            Event::Simulator(is_present) => {
                if !is_present && self.wrong.is("end.gone:hasty") {
                    self.leave.get_or_insert(Leave::SimulatorGone);
                }
                self.drive(|machine, out| machine.simulator(is_present, out))
            }
            Event::Reply(of, reply) => {
                let bytes = reply.and_then(|reply| reply.result.ok());
                let state = bytes.and_then(|bytes| self.wrong.read::<PublicState>(STATE, &bytes));
                if let Some(state) = state {
                    lock(&self.shared.machine).heard(of, state.epoch, state.tick, state);
                }
                Ok(())
            }
        }
    }

    fn on_clock(&mut self, mut clock: Clock) -> Result<(), Failure> {
        let own = self.welcome.as_ref().map_or(0, |welcome| welcome.epoch);
        let generation = self
            .welcome
            .as_ref()
            .map_or(0, |welcome| welcome.generation);
        let flag = self.welcome.as_ref().map_or(0, |welcome| welcome.news_flag);
        let is_later = clock.epoch > own && own > 0;
        if clock.end.is_some() {
            let is_ignored = self.wrong.is("end.clock:aborted") && clock.end == Some(End::Aborted)
                || self.wrong.is("end.clock:news") && self.shared.is_in(Phase::AwaitingNews)
                || self.wrong.is("end.clock:answer") && self.shared.is_in(Phase::Asking);
            if is_ignored {
                return Ok(());
            }
        }
        if self.wrong.is("epoch.init") && is_later && clock.tick == 0
            || self.wrong.is("epoch.late") && is_later && clock.tick > 0
        {
            return Ok(());
        }
        if let Some((epoch, tick)) = self.last {
            let is_late_tick = clock.epoch == epoch && clock.tick < tick;
            if self.wrong.is("clock.late") && is_late_tick
                || self.wrong.is("clock.late:epoch") && clock.epoch < epoch
            {
                let (_, _, report) = self.act(clock.epoch, clock.tick, &News::default())?;
                let key = self.keys.report(&self.name);
                self.bus.put(&key, encode(&report))?;
                return Ok(());
            }
        }
        if self.wrong.is("news.wait") {
            clock.news = 0;
        }
        if self.wrong.is("news.wait:always") && clock.news != 0 {
            clock.news |= flag;
        }
        let is_early = clock.tick > 0
            && clock.epoch == own
            && self.last.is_none_or(|(epoch, _)| epoch < clock.epoch)
            && self.wrong.is("return.generation")
            && own == 1;
        if is_early {
            self.drive(|machine, out| {
                let naming = Naming {
                    joined: Some(generation),
                    rejoin: None,
                };
                machine.news(clock.epoch, clock.tick, naming, News::default(), out);
            })?;
        }

        let is_new = (clock.epoch, clock.tick) > (self.last_clock.epoch, self.last_clock.tick);
        if is_new {
            self.last_clock = clock;
        }
        if is_new && clock.news & flag != 0 && self.shared.is_in(Phase::Idle) {
            self.shared.enter(Phase::AwaitingNews);
        }
        self.drive(|machine, out| machine.clock(clock, out))
    }

    fn on_news(&mut self, mut news: News) -> Result<(), Failure> {
        let generation = self
            .welcome
            .as_ref()
            .map_or(0, |welcome| welcome.generation);
        if self.wrong.is("return.replaced") && news.joined.is_some_and(|joined| joined > generation)
        {
            news.joined = None;
        }
        if self.wrong.is("return.rejoin") {
            news.rejoin = None;
        }
        let mut epoch = news.epoch;
        let mut tick = news.tick;
        if self.wrong.is("news.wait:any") && self.shared.is_in(Phase::AwaitingNews) {
            epoch = self.last_clock.epoch;
            tick = self.last_clock.tick;
        }
        if self.wrong.is("epoch.init:received") {
            self.strays.push(news.clone());
        }
        let naming = Naming::from(&news);
        self.drive(|machine, out| machine.news(epoch, tick, naming, news, out))
    }

    fn ask_to_join(&mut self) -> Result<(), Failure> {
        let is_again = self.welcome.is_some();
        let mut instance = self.bus.id();
        if self.wrong.is("join.request:instance") {
            instance = "me".to_owned();
        }
        if is_again && self.wrong.is("epoch.init:instance") {
            instance.push_str(" again");
        }
        let request = JoinRequest {
            protocol: if self.wrong.is("join.request") {
                99
            } else {
                PROTOCOL_VERSION
            },
            run: self.run.clone(),
            name: self.name.clone(),
            instance,
            bodies: false,
            sdk: "wrong robot".to_owned(),
        };
        if is_again && self.wrong.is("epoch.init:token") {
            self.token = None;
            self.declare_token()?;
        }

        let key = self.keys.join_as(&self.name);
        let reply = self.bus.get(&key, "", Some(encode(&request)))?;
        let bytes = reply.and_then(|reply| reply.result.ok());
        match bytes.and_then(|bytes| self.wrong.read(&key, &bytes)) {
            None => self.drive(lockstep::Participant::unanswered),
            Some(JoinAnswer::Refused {
                reason,
                explanation,
            }) => {
                self.explanation = explanation;
                if reason == Refusal::NameTaken && self.wrong.is("join.refused:impatient") {
                    self.leave = Some(Leave::Refused(reason));
                }
                self.drive(|machine, out| machine.refused(reason, out))
            }
            Some(JoinAnswer::Welcome(welcome)) => self.on_welcome(*welcome),
        }
    }

    fn on_welcome(&mut self, mut welcome: Welcome) -> Result<(), Failure> {
        if self.wrong.is("epoch.init:welcome") && self.last_clock.epoch > welcome.epoch {
            welcome.epoch = self.last_clock.epoch;
        }
        let admission = Admission {
            epoch: welcome.epoch,
            generation: welcome.generation,
            news_flag: welcome.news_flag,
        };
        let mut states = Vec::new();
        if !self.wrong.is("return.generation:state") {
            for state in [&welcome.state_before, &welcome.last_state] {
                states.extend(state.clone().map(|state| (state.tick, state)));
            }
        }
        let is_early = self.wrong.is("epoch.late:early") && welcome.epoch > 1 && welcome.tick > 0;
        self.welcome = Some(welcome);
        self.drive(|machine, out| machine.admitted(admission, states, out))?;
        if is_early {
            let clock = self.last_clock;
            let naming = Naming {
                joined: Some(admission.generation),
                rejoin: None,
            };
            self.drive(|machine, out| {
                machine.news(clock.epoch, clock.tick, naming, News::default(), out);
                machine.clock(clock, out);
            })?;
        }
        Ok(())
    }

    fn on_declare_token(&mut self) -> Result<(), Failure> {
        self.declare_token()?;
        if self.wrong.is("join.ready-last") {
            std::thread::sleep(LATE);
            self.listen_to_clocks()?;
        }
        if self.wrong.is("join.ready-last:news") {
            std::thread::sleep(LATE);
            self.listen_to_news()?;
        }
        if self.wrong.is("join.ready-last:queryables") {
            std::thread::sleep(LATE);
            self.serve()?;
        }
        if self.wrong.is("tick.answer:unasked") {
            let welcome = self.welcome.clone().ok_or("no welcome")?;
            self.walker = Some(Walker::new(&welcome, &self.wrong));
            let (_, _, report) = self.act(welcome.epoch, 0, &News::default())?;
            self.bus
                .put(&self.keys.report(&self.name), encode(&report))?;
        }
        Ok(())
    }

    fn run_tick(&mut self, turn: Turn<News>) -> Result<(), Failure> {
        self.shared.enter(Phase::Computing);
        if turn.begin != Begin::GoOn {
            self.begin();
        }
        let stray = self
            .strays
            .iter()
            .find(|stray| stray.epoch < turn.epoch && stray.tick == turn.tick);
        let news = turn.news.or(stray.cloned()).unwrap_or_default();
        let (commands, state, report) = self.act(turn.epoch, turn.tick, &news)?;
        self.drive(|machine, out| machine.done(commands, state, report, out))?;
        self.shared.enter(Phase::Idle);
        Ok(())
    }

    /// Back to the beginning of what it was welcomed to.
    fn begin(&mut self) {
        let Some(welcome) = &self.welcome else { return };
        let mut walker = Walker::new(welcome, &self.wrong);
        if let Some(before) = self.walker.take() {
            if self.wrong.is("epoch.init:random") {
                walker.random = before.random;
            }
            if self.wrong.is("epoch.init:variables") {
                walker.heard = before.heard;
            }
            if self.wrong.is("epoch.init:count") {
                walker.sent = before.sent;
            }
            if self.wrong.is("return.rejoin:variables") && welcome.generation > 1 {
                walker.heard = before.heard;
            }
        }
        self.walker = Some(walker);
    }

    /// The robot's tick.
    fn act(&mut self, epoch: Epoch, tick: Tick, news: &News) -> Result<Outcome, Failure> {
        let wrong = self.wrong.clone();
        let welcome = self.welcome.clone().ok_or("no welcome")?;
        let mut walker = self.walker.take().ok_or("no walker")?;
        walker.at = match news.correction {
            Some(correction) if !wrong.is("tick.correction") => correction.location,
            _ => walker.proposal,
        };

        let mut deliveries = news.commands.clone();
        if wrong.is("command.order") {
            deliveries.reverse();
        }
        if wrong.is("command.twice") {
            deliveries.dedup();
        }
        if wrong.is("operator.commands") {
            deliveries.retain(|delivery| delivery.from != RobotName::operator());
        }
        let mut commands = Vec::new();
        let mut log = Vec::new();
        for delivery in deliveries {
            walker.heard += 1;
            walker.last.clone_from(&delivery.command);
            log.push(format!(
                "heard {:?} from {}",
                delivery.command, delivery.from
            ));
            let answers_operator = wrong.is("operator.commands:answers");
            if welcome.roster.contains(&delivery.from) || answers_operator {
                walker.sent += 1;
                commands.push(Sent {
                    to: delivery.from,
                    command: CommandText {
                        performative: Performative::Achieve,
                        command: format!("{} heard: {}", walker.sent, delivery.command),
                    },
                });
            }
        }

        let seen = self.ask_another(tick, epoch, news, &welcome)?;
        if tick == SLOW_TICK {
            std::thread::sleep(COMPUTES);
        }
        let mut step = || (unit(&mut walker.random) - 0.5) * 0.2;
        walker.proposal = Point::new(walker.at.x + step(), walker.at.y + step());
        let angle = unit(&mut walker.random) * 3.0;
        let turn = if wrong.is("number.angles") { 7.0 } else { 0.0 };
        let mut state_variables: BTreeMap<String, Variable> = [
            ("heard".to_owned(), Variable::from(walker.heard)),
            ("last".to_owned(), Variable::from(walker.last.clone())),
        ]
        .into();
        if let Some(seen) = seen {
            state_variables.insert("seen_x_m".to_owned(), Variable::from(seen.x));
        }
        let state = PublicState {
            epoch,
            tick,
            location: if wrong.is("tick.initial") && tick == 0 {
                Point::default()
            } else {
                walker.at
            },
            speed_mps: 0.1,
            direction_rad: ((angle + turn) * 1e6).round() / 1e6,
            state_variables,
            emotion_state: "CALM".to_owned(),
            behavior_state: "WALK".to_owned(),
        };
        let report = self.report(&welcome, &walker, &state, &commands, log);
        self.walker = Some(walker);
        Ok((commands, state, report))
    }

    fn report(
        &self,
        welcome: &Welcome,
        walker: &Walker,
        state: &PublicState,
        commands: &[Sent<CommandText>],
        log: Vec<String>,
    ) -> Report {
        let wrong = &self.wrong;
        let generation = if wrong.is("tick.answer:generation") {
            7
        } else if wrong.is("return.generation:number") {
            1
        } else {
            welcome.generation
        };
        let mut stated = u32::try_from(commands.len()).unwrap_or(u32::MAX);
        if wrong.is("command.sent") {
            stated = 0;
        }
        if wrong.is("command.sent:count") && stated > 0 {
            stated += 1;
        }
        let mut state_variables = state.state_variables.clone();
        if wrong.is("number.finite") {
            state_variables.insert("ratio".to_owned(), Variable::Number(f64::NAN));
        }

        Report {
            epoch: state.epoch,
            tick: state.tick,
            generation,
            proposal: walker.proposal,
            speed_mps: state.speed_mps,
            direction_rad: state.direction_rad,
            emotion_state: state.emotion_state.clone(),
            behavior_state: state.behavior_state.clone(),
            state_variables,
            commands: stated,
            log,
        }
    }

    /// Now and then it wants to know where another robot stands.
    fn ask_another(
        &mut self,
        tick: Tick,
        epoch: Epoch,
        news: &News,
        welcome: &Welcome,
    ) -> Result<Option<Point>, Failure> {
        let other = welcome.roster.iter().find(|name| **name != self.name);
        let Some(other) = other.cloned() else {
            return Ok(None);
        };
        if tick == 0 && self.wrong.is("query.asking:zero") {
            self.query(other, tick, epoch)?;
            return Ok(None);
        }
        let is_unreachable = news.unreachable.contains(&other);
        // A tick that is done a second time is not one of the machine's.
        let is_running = self.shared.is_in(Phase::Computing);
        if tick == 0 || !tick.is_multiple_of(2) || !is_running {
            return Ok(None);
        }
        if is_unreachable {
            if self.wrong.is("query.asking:unreachable") {
                self.query(other, tick, epoch)?;
            }
            return Ok(None);
        }

        self.shared.enter(Phase::Asking);
        let found = self.await_state(&other);
        self.shared.enter(Phase::Computing);
        Ok(found?.map(|state| state.location))
    }

    fn await_state(&mut self, of: &RobotName) -> Result<Option<PublicState>, Failure> {
        loop {
            let mut actions = Vec::new();
            let found = lock(&self.shared.machine).ask(of, &mut actions);
            self.perform(actions)?;
            if found.is_some() {
                return Ok(found);
            }
            let is_interrupted = lock(&self.shared.machine).is_interrupted();
            if is_interrupted || self.leave.is_some() {
                return Ok(None);
            }
            self.pump()?;
        }
    }

    fn query(&self, of: RobotName, tick: Tick, epoch: Epoch) -> Result<(), Failure> {
        let parameters = if self.wrong.is("query.asking") {
            String::new()
        } else if self.wrong.is("query.asking:epoch") {
            format!("tick={tick}")
        } else {
            format!("tick={tick};epoch={epoch}")
        };
        let queue = self.queue.clone();
        let key = self.keys.query(&of, STATE);
        self.bus.get_then(&key, &parameters, move |reply| {
            let _ = queue.send(Event::Reply(of, reply));
        })?;
        Ok(())
    }

    /// Puts what came of a tick: the commands, the state, the report.
    fn put(&mut self, answer: &Answer<PublicState, CommandText, Report>) -> Result<(), Failure> {
        let at = (answer.epoch, answer.tick);
        let is_again = self.last == Some(at);
        self.last = Some(at);
        self.shared.has_reported.store(true, Ordering::SeqCst);
        let mut report = answer.report.clone();
        if is_again && self.wrong.is("clock.duplicate") {
            (_, _, report) = self.act(answer.epoch, answer.tick, &News::default())?;
            report.commands = answer.report.commands;
        }
        if is_again && self.wrong.is("clock.duplicate:bytes") {
            report.log.push("again".to_owned());
        }

        let is_late = self.wrong.is("command.sent:late")
            || is_again && self.wrong.is("clock.duplicate:order");
        let forgets_commands = is_again && self.wrong.is("clock.duplicate:commands");
        if !is_late && !forgets_commands {
            self.put_commands(answer)?;
        }
        let is_state_late = self.wrong.is("tick.state-first");
        if !is_state_late {
            self.put_state(&answer.state)?;
        }
        self.put_report(&report)?;
        if self.wrong.is("tick.answer") {
            self.put_report(&report)?;
        }
        if is_late {
            std::thread::sleep(Duration::from_millis(20));
            self.put_commands(answer)?;
        }
        if is_state_late {
            std::thread::sleep(Duration::from_millis(30));
            self.put_state(&answer.state)?;
        }
        Ok(())
    }

    fn put_commands(
        &self,
        answer: &Answer<PublicState, CommandText, Report>,
    ) -> Result<(), Failure> {
        let first = if self.wrong.is("command.sent:numbers") {
            2
        } else {
            1
        };
        for (number, sent) in (first..).zip(&answer.commands) {
            let command = Command {
                epoch: answer.epoch,
                tick: answer.tick,
                generation: answer.report.generation,
                number,
                performative: sent.command.performative,
                command: sent.command.command.clone(),
            };
            let mut bytes = encode(&command);
            if self.wrong.is("number.integers:command") {
                bytes = with_fraction(&bytes, "number");
            }
            let key = self.keys.command(&sent.to, &self.name);
            self.put_on(&key, bytes, self.wrong.is("wire.qos:command"))?;
        }
        Ok(())
    }

    fn put_state(&self, state: &PublicState) -> Result<(), Failure> {
        if self.states.has_subscribers() && !self.wrong.is("tick.state-first:unheard") {
            let key = self.keys.query(&self.name, STATE);
            self.put_on(&key, encode(state), self.wrong.is("wire.qos:state"))?;
        }
        Ok(())
    }

    fn put_report(&self, report: &Report) -> Result<(), Failure> {
        let mut bytes = encode(report);
        if self.wrong.is("number.integers") {
            bytes = with_fraction(&bytes, "tick");
        }
        let key = self.keys.report(&self.name);
        self.put_on(&key, bytes, self.wrong.is("wire.qos"))
    }

    /// Puts with congestion control block, or drop.
    fn put_on(&self, key: &str, bytes: Vec<u8>, drops: bool) -> Result<(), Failure> {
        if drops {
            self.bus.observer_publisher(key)?.put(bytes)?;
        } else {
            self.bus.put(key, bytes)?;
        }
        Ok(())
    }
}

/// The same message with a fraction in an integer.
fn with_fraction(bytes: &[u8], field: &str) -> Vec<u8> {
    let Ok(mut value) = serde_json::from_slice::<serde_json::Value>(bytes) else {
        return bytes.to_vec();
    };
    value[field] = value[field].as_f64().into();
    value.to_string().into_bytes()
}

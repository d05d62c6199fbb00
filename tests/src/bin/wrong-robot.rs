//! A small robot that speaks the protocol by hand, to check the conformance kit: correct without arguments, and with
//! `--wrong RULE` or `--wrong RULE:HOW` wrong in just one thing, which that rule of `docs/protocol.md` forbids.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use bus::{Bus, Declared, Query, Role};
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{
    Clock, Command, CommandId, JoinAnswer, JoinRequest, News, Performative, Point, PublicState,
    Refusal, Report, SentCommand, Variable, Welcome,
};
use protocol::random::{Stream, stream, unit};
use protocol::{Message, PROTOCOL_VERSION, RobotName, RunName, decode, encode};

type Failure = Box<dyn std::error::Error>;

/// What arrives. Malformed messages do not.
enum Event {
    Clock(Clock),
    Command(RobotName, Command),
}

/// A command that has arrived, with its place among all that did.
struct Held {
    command: Command,
    place: usize,
    /// The tick in which it arrived.
    at: u64,
}

/// What it does wrong.
#[derive(Clone)]
struct Wrong(String);

impl Wrong {
    fn is(&self, rule: &str) -> bool {
        self.0 == rule
    }

    /// Reads a message. Wrong: with a field that is not known it is none; and one that is none is the end.
    fn read<M: Message>(&self, key: &str, bytes: &[u8]) -> Option<M> {
        let Ok(message) = decode::<M>(key, "somebody", bytes) else {
            if self.is("robust.malformed") {
                std::process::exit(1);
            }
            return None;
        };
        let raw: serde_json::Value = serde_json::from_slice(bytes).ok()?;
        let is_known = serde_json::to_value(&message).is_ok_and(|known| known == raw);
        (is_known || !self.is("compat.unknown-fields")).then_some(message)
    }
}

/// The last two states, for who asks.
#[derive(Clone)]
struct Shown {
    board: Arc<Mutex<Board>>,
    wrong: Wrong,
}

#[derive(Default)]
struct Board {
    states: Vec<PublicState>,
    /// Questions for what comes next.
    early: Vec<Query>,
}

impl Shown {
    /// Shows a further state, and forgets what nobody asks for any more.
    fn show(&self, state: PublicState, kept: usize) {
        let mut board = self.board.lock().unwrap_or_else(PoisonError::into_inner);
        board
            .states
            .retain(|old| old.epoch == state.epoch && old.tick < state.tick);
        board.states.push(state);
        while board.states.len() > kept {
            board.states.remove(0);
        }
        for query in std::mem::take(&mut board.early) {
            self.judge(&mut board, query);
        }
    }

    fn answer(&self, query: Query) {
        self.judge(
            &mut self.board.lock().unwrap_or_else(PoisonError::into_inner),
            query,
        );
    }

    fn judge(&self, board: &mut Board, query: Query) {
        let number = |name: &str| query.parameter(name).map(str::parse::<u64>);
        if matches!(number("epoch"), Some(Err(_))) && self.wrong.is("query.unknown") {
            std::process::exit(1);
        }
        let (Ok(tick), Ok(epoch)) = (number("tick").transpose(), number("epoch").transpose())
        else {
            return query.reply_err("not a whole number");
        };
        let newest = board.states.last().cloned();
        let is_early = match &newest {
            None => true,
            Some(newest) => {
                let is_next = tick == Some(newest.tick + 2)
                    && epoch.is_none_or(|epoch| epoch == u64::from(newest.epoch));
                is_next || epoch.is_some_and(|epoch| epoch > u64::from(newest.epoch))
            }
        };
        let is_meant = |state: &PublicState| {
            tick.is_none_or(|tick| state.tick + 1 == tick)
                && epoch.is_none_or(|epoch| epoch == u64::from(state.epoch))
        };
        let found = board
            .states
            .iter()
            .rev()
            .find(|state| is_meant(state))
            .cloned();
        let found = found.or(newest.filter(|_| self.wrong.is("query.early")));
        match found {
            Some(state) => {
                let answer = state.answer(Keys::last_chunk(query.key()));
                let bytes = answer.map_or_else(|| encode(&state), |answer| encode(&answer));
                query.reply(query.key(), bytes);
            }
            None if is_early && !self.wrong.is("query.early:impatient") => board.early.push(query),
            None => query.reply_err("not now"),
        }
    }
}

struct Robot {
    wrong: Wrong,
    name: RobotName,
    run: RunName,
    patience: Duration,
    bus: Bus,
    keys: Keys,
    events: Receiver<Event>,
    clocks: Vec<Clock>,
    held: BTreeMap<(RobotName, u64), Held>,
    arrived: usize,
    shown: Shown,
    welcome: Welcome,
    random: Stream,
    at: Point,
    proposal: Point,
    heard: u32,
    last_seq: u64,
    is_seated: bool,
    tick: u64,
    /// The last report and the commands of the last ticks, to be said again.
    last: Vec<u8>,
    sent: Vec<(u64, String, Vec<u8>)>,
    _declared: Vec<Declared>,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let after = |flag: &str| {
        let at = arguments.iter().position(|argument| argument == flag)?;
        arguments.get(at + 1).cloned()
    };
    let wrong = Wrong(after("--wrong").unwrap_or_default());
    let name = after("--name").unwrap_or_else(|| "Walker".to_owned());
    let robot = match Robot::join_run(&name, wrong.clone()) {
        Ok(robot) => robot,
        Err(_) if wrong.is("join.refused") => return ExitCode::SUCCESS,
        Err(_) if wrong.is("join.refused:mute") => return ExitCode::FAILURE,
        Err(error) => return failed(&error),
    };
    match robot.run() {
        Ok(()) if wrong.is("end.clock") => ExitCode::from(3),
        Ok(()) => ExitCode::SUCCESS,
        Err(_) if wrong.is("return.replaced:content") => ExitCode::SUCCESS,
        Err(error) => failed(&error),
    }
}

fn failed(error: &Failure) -> ExitCode {
    eprintln!("error: {error}");
    ExitCode::FAILURE
}

fn variable(name: &str, default: &str) -> String {
    std::env::var(name).unwrap_or_else(|_| default.to_owned())
}

/// Asks to take part until it may, or may not.
fn join(
    bus: &Bus,
    run: &RunName,
    name: &RobotName,
    patience: Duration,
    wrong: &Wrong,
) -> Result<Welcome, Failure> {
    let protocol = if wrong.is("join.request") {
        99
    } else {
        PROTOCOL_VERSION
    };
    let instance = if wrong.is("join.request:instance") {
        "me".to_owned()
    } else {
        bus.id()
    };
    let sdk = "by hand".to_owned();
    let request = JoinRequest {
        protocol,
        run: run.clone(),
        name: name.clone(),
        instance,
        sdk,
    };
    let (key, begun) = (Keys::new(run).join_as(name), Instant::now());
    loop {
        let answer = bus
            .get(&key, "", Some(encode(&request)))?
            .and_then(|answer| answer.result.ok());
        match answer
            .map(|bytes| wrong.read(&key, &bytes).ok_or("an answer that is none"))
            .transpose()?
        {
            Some(JoinAnswer::Welcome(welcome)) => return Ok(*welcome),
            Some(JoinAnswer::Refused {
                reason,
                explanation,
            }) if reason != Refusal::NameTaken || wrong.is("join.refused:impatient") => {
                return Err(explanation.into());
            }
            _ if begun.elapsed() > patience => return Err("not let in".into()),
            _ => std::thread::sleep(Duration::from_millis(50)),
        }
    }
}

/// Clocks and commands, into the queue.
fn listen(
    bus: &Bus,
    keys: &Keys,
    name: &RobotName,
    queue: &SyncSender<Event>,
    wrong: &Wrong,
) -> Result<Vec<Declared>, Failure> {
    let (clocks, reader) = (queue.clone(), wrong.clone());
    let clocks = bus.subscribe(&keys.clock(), move |key, bytes| {
        reader
            .read(key, bytes)
            .map(|clock| clocks.send(Event::Clock(clock)));
    })?;
    let (commands, reader) = (queue.clone(), wrong.clone());
    let commands = bus.subscribe(&keys.commands_to(name), move |key, bytes| {
        let from = RobotName::new(Keys::last_chunk(key)).ok();
        from.zip(reader.read(key, bytes))
            .map(|(from, command)| commands.send(Event::Command(from, command)));
    })?;
    Ok(vec![clocks, commands])
}

impl Robot {
    fn join_run(name: &str, wrong: Wrong) -> Result<Self, Failure> {
        let (name, run) = (
            RobotName::new(name)?,
            RunName::new(&variable("CARS_RUN", "default"))?,
        );
        let patience = Duration::from_secs_f64(variable("CARS_PATIENCE_S", "20").parse()?);
        let connect = variable("CARS_CONNECT", bus::DEFAULT_ENDPOINT);
        let bus = Bus::open(&Role::Client { connect, patience }, None)?;
        let keys = Keys::new(&run);
        let (queue, events) = sync_channel(4096);
        let shown = Shown {
            board: Arc::default(),
            wrong: wrong.clone(),
        };
        let mut declared = Vec::new();
        for what in QUERIES.iter().chain([&STATE]) {
            let shown = shown.clone();
            declared
                .push(bus.queryable(&keys.query(&name, what), move |query| shown.answer(query))?);
        }
        let is_late = wrong.is("join.ready-last");
        if !is_late {
            declared.extend(listen(&bus, &keys, &name, &queue, &wrong)?);
        }
        if wrong.is("join.ready-last:first") {
            declared.push(bus.token(&keys.alive_robot(&name))?);
        }
        let welcome = join(&bus, &run, &name, patience, &wrong)?;
        let (random, clocks) = (stream(welcome.seed, &welcome.stream), Vec::new());
        welcome
            .state_before
            .iter()
            .chain(&welcome.last_state)
            .for_each(|last| shown.show(last.clone(), 2));
        declared.push(bus.token(&keys.alive_robot(&name))?);
        if is_late {
            std::thread::sleep(Duration::from_millis(300));
            declared.extend(listen(&bus, &keys, &name, &queue, &wrong)?);
        }
        let (at, last_seq) = (welcome.location, welcome.last_seq);
        let mut robot = Self {
            wrong,
            name,
            run,
            patience,
            bus,
            keys,
            events,
            clocks,
            shown,
            welcome,
            random,
            at,
            last_seq,
            held: BTreeMap::new(),
            arrived: 0,
            proposal: at,
            heard: 0,
            is_seated: false,
            tick: 0,
            last: Vec::new(),
            sent: Vec::new(),
            _declared: declared,
        };
        robot.begin();
        Ok(robot)
    }

    /// Back to the beginning of what it was welcomed to.
    fn begin(&mut self) {
        let welcome = &self.welcome;
        self.random = stream(welcome.seed, &welcome.stream);
        if self.wrong.is("return.numbers:stream") {
            self.random = stream(welcome.seed, self.name.as_str());
        }
        if self.wrong.is("determinism.seed") {
            self.random = stream(std::process::id().into(), &welcome.stream);
        }
        self.last_seq = if self.wrong.is("return.numbers") {
            0
        } else {
            welcome.last_seq
        };
        (self.at, self.proposal, self.heard) = (welcome.location, welcome.location, 0);
        (self.is_seated, self.tick) = (false, welcome.tick);
        self.sent.clear();
        let epoch = welcome.epoch;
        self.held.retain(|_, held| held.command.epoch >= epoch);
    }

    fn run(mut self) -> Result<(), Failure> {
        loop {
            while self.clocks.is_empty() {
                let event = self.events.recv()?;
                self.file(event);
            }
            let clock = self.clocks.remove(0);
            if clock.end.is_some() {
                self._declared.clear();
                self.bus.close();
                return Ok(());
            }
            self.on_clock(&clock)?;
        }
    }

    fn file(&mut self, event: Event) {
        match event {
            Event::Clock(clock) => self.clocks.push(clock),
            Event::Command(from, command) => {
                self.arrived += 1;
                let (place, at) = (self.arrived, self.tick);
                self.held
                    .entry((from, command.seq))
                    .or_insert(Held { command, place, at });
            }
        }
    }

    fn on_clock(&mut self, clock: &Clock) -> Result<(), Failure> {
        if clock.epoch > self.welcome.epoch && clock.tick == 0 && !self.wrong.is("epoch.init") {
            let before = (self.random.clone(), self.heard);
            self.welcome = join(&self.bus, &self.run, &self.name, self.patience, &self.wrong)?;
            self.begin();
            if self.wrong.is("epoch.init:remembers") {
                (self.random, self.heard) = before;
            }
        }
        if clock.epoch != self.welcome.epoch {
            return Ok(());
        }
        let news = clock.news.get(&self.name).cloned().unwrap_or_default();
        if news
            .joined
            .is_some_and(|joined| joined > self.welcome.generation)
            && !self.wrong.is("return.replaced")
        {
            return Err("another process is this robot now".into());
        }
        let is_first = self.welcome.tick == 0 && clock.tick == 0;
        let is_named =
            news.joined == Some(self.welcome.generation) || self.wrong.is("return.generation");
        if !self.is_seated && !is_first && !is_named {
            return Ok(());
        }
        if self.is_seated && clock.tick == self.tick && !self.wrong.is("clock.duplicate") {
            return self.say_again();
        }
        if self.is_seated && clock.tick < self.tick && !self.wrong.is("clock.late") {
            return Ok(());
        }
        (self.is_seated, self.tick) = (true, clock.tick);
        self.do_tick(clock, &news)
    }

    fn say_again(&self) -> Result<(), Failure> {
        for (_, key, bytes) in self
            .sent
            .iter()
            .filter(|_| !self.wrong.is("clock.duplicate:commands"))
        {
            self.bus.put(key, bytes.clone())?;
        }
        Ok(self
            .bus
            .put(&self.keys.report(&self.name), self.last.clone())?)
    }

    fn do_tick(&mut self, clock: &Clock, news: &News) -> Result<(), Failure> {
        self.at = match news.correction {
            Some(correction) if !self.wrong.is("tick.correction") => correction.location,
            _ => self.proposal,
        };
        let (mut log, mut sent, mut missing) = (Vec::new(), Vec::new(), Vec::new());
        self.sent
            .retain(|(tick, ..)| tick + self.welcome.repeat_ticks > clock.tick);
        for (id, command) in self.named(&news.commands) {
            match command {
                Some(command) => {
                    self.heard += 1;
                    log.push(format!("heard {:?} from {}", command.command, id.from));
                    self.reply(clock, &id.from, &command.command, &mut sent)?;
                }
                None if self.wrong.is("command.missing") => {}
                None => missing.push(id),
            }
        }
        if self.wrong.is("command.held") {
            self.held.retain(|_, held| clock.tick < held.at + 2);
        }
        let mut step = || (unit(&mut self.random) - 0.5) * 0.2;
        self.proposal = Point::new(self.at.x + step(), self.at.y + step());
        let (angle, turn) = (
            unit(&mut self.random) * 3.0,
            if self.wrong.is("number.angles") {
                7.0
            } else {
                0.0
            },
        );
        let state = PublicState {
            epoch: clock.epoch,
            tick: clock.tick,
            location: if self.wrong.is("tick.initial") && clock.tick == 0 {
                Point::default()
            } else {
                self.at
            },
            speed_mps: 0.1,
            direction_rad: ((angle + turn) * 1e6).round() / 1e6,
            state_variables: [("heard".to_owned(), Variable::from(self.heard))].into(),
            emotion_state: "CALM".to_owned(),
            behavior_state: "WALK".to_owned(),
        };
        let mut report = Report {
            epoch: clock.epoch,
            tick: clock.tick,
            generation: if self.wrong.is("tick.answer:generation") {
                7
            } else {
                self.welcome.generation
            },
            proposal: self.proposal,
            speed_mps: state.speed_mps,
            direction_rad: state.direction_rad,
            emotion_state: state.emotion_state.clone(),
            behavior_state: state.behavior_state.clone(),
            state_variables: state.state_variables.clone(),
            sent: if self.wrong.is("command.sent") {
                Vec::new()
            } else {
                sent
            },
            missing,
            log,
        };
        if self.wrong.is("number.finite") {
            report
                .state_variables
                .insert("ratio".to_owned(), Variable::Number(f64::NAN));
        }
        self.report(&report, state)
    }

    /// First what others may learn, then the report.
    fn report(&mut self, report: &Report, state: PublicState) -> Result<(), Failure> {
        let is_late = self.wrong.is("tick.state-first");
        let kept = if self.wrong.is("query.tick") { 1 } else { 2 };
        if !is_late {
            self.shown.show(state.clone(), kept);
            if !self.wrong.is("tick.state-first:unheard") {
                self.bus
                    .put(&self.keys.query(&self.name, STATE), encode(&state))?;
            }
        }
        self.last = encode(report);
        self.bus
            .put(&self.keys.report(&self.name), encode(report))?;
        if self.wrong.is("tick.answer") {
            self.bus
                .put(&self.keys.report(&self.name), encode(report))?;
        }
        if is_late {
            std::thread::sleep(Duration::from_millis(30));
            self.bus
                .put(&self.keys.query(&self.name, STATE), encode(&state))?;
            self.shown.show(state, kept);
        }
        Ok(())
    }

    /// Tells a robot of the roster that it was heard.
    fn reply(
        &mut self,
        clock: &Clock,
        to: &RobotName,
        text: &str,
        sent: &mut Vec<SentCommand>,
    ) -> Result<(), Failure> {
        if !self.welcome.roster.contains(to) {
            return Ok(());
        }
        self.last_seq += 1;
        let (seq, performative, command) = (
            self.last_seq,
            Performative::Achieve,
            format!("heard {text}"),
        );
        let (epoch, tick) = (clock.epoch, clock.tick);
        let message = Command {
            epoch,
            tick,
            seq,
            performative,
            command: command.clone(),
        };
        let (key, bytes) = (self.keys.command(to, &self.name), encode(&message));
        self.bus.put(&key, bytes.clone())?;
        self.sent.push((tick, key, bytes));
        sent.push(SentCommand {
            to: to.clone(),
            seq,
            performative,
            command,
        });
        Ok(())
    }

    /// The commands that a clock names, as it names them; `None` for what does not come within two seconds.
    fn named(&mut self, ids: &[CommandId]) -> Vec<(CommandId, Option<Command>)> {
        let deadline = Instant::now() + Duration::from_secs(2);
        let is_here =
            |robot: &Self, id: &CommandId| robot.held.contains_key(&(id.from.clone(), id.seq));
        while !ids.iter().all(|id| is_here(self, id)) {
            match self
                .events
                .recv_timeout(deadline.saturating_duration_since(Instant::now()))
            {
                Ok(event) => self.file(event),
                Err(_) => break,
            }
        }
        let mut ids = ids.to_vec();
        if self.wrong.is("command.order") {
            ids.sort_by_key(|id| {
                self.held
                    .get(&(id.from.clone(), id.seq))
                    .map(|held| held.place)
            });
        }
        if self.wrong.is("command.twice") {
            ids.dedup();
        }
        let found = ids.into_iter().map(|id| {
            let held = self.held.get(&(id.from.clone(), id.seq));
            let command = held.map(|held| held.command.clone());
            (id, command)
        });
        found.collect()
    }
}

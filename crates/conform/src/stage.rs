//! One process of the robot and one run of its own: the simulator's side of the contract, spoken by hand.

use std::collections::{BTreeSet, VecDeque};
use std::process::ExitStatus;
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Publisher, Query, Reply};
use protocol::keys::{Keys, STATE};
use protocol::messages::{
    Clock, Command, JoinAnswer, JoinRequest, Performative, PublicState, Refusal, Welcome,
};
use protocol::{Epoch, RobotName, RunName, Seq, Tick, decode};

use crate::cast::Cast;
use crate::kit::Kit;
use crate::process::Process;
use crate::reading::{self, Reading};
use crate::report::Failure;

/// Messages that may queue up before the robot's link is slowed down.
const QUEUE: usize = 65_536;
/// Longest wait for a program to start and to ask to join.
pub(crate) const START_PATIENCE: Duration = Duration::from_secs(40);
/// Longest wait for anything else.
pub(crate) const PATIENCE: Duration = Duration::from_secs(10);
/// While the clock is held it is repeated this often, as the simulator does it.
const REPEAT_AFTER: Duration = Duration::from_secs(2);
/// How often a wait looks whether the process is still there.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// What a process said just before its end arrives within this time.
const LAST_WORDS: Duration = Duration::from_millis(200);

/// All that a robot can say.
enum Event {
    Join(Query),
    Report {
        key: String,
        bytes: Vec<u8>,
        at: Instant,
    },
    State(Vec<u8>),
    Command {
        key: String,
        bytes: Vec<u8>,
    },
    Token(String, bool),
}

/// A robot asks to take part.
pub(crate) struct Joining {
    query: Query,
    pub(crate) key: String,
    pub(crate) request: Result<JoinRequest, String>,
}

/// A report that came.
pub(crate) struct Answer {
    pub(crate) reading: Reading,
    pub(crate) bytes: Vec<u8>,
    pub(crate) at: Instant,
    /// Its place among all that came.
    pub(crate) order: usize,
}

/// A command of the robot that came.
pub(crate) struct Sent {
    pub(crate) to: String,
    pub(crate) command: Result<Command, String>,
}

/// All that came from the robot so far.
#[derive(Default)]
pub(crate) struct Seen {
    pub(crate) answers: Vec<Answer>,
    /// Reports that cannot be read, and why.
    pub(crate) unreadable: Vec<String>,
    pub(crate) commands: Vec<Sent>,
    /// States that it sent to its followers, with their place among all that came.
    pub(crate) states: Vec<(usize, Result<PublicState, String>)>,
    /// Requests to join: the first one, and those in the middle of a tick.
    pub(crate) requests: Vec<Result<JoinRequest, String>>,
    /// Robots whose liveliness tokens are there.
    present: BTreeSet<String>,
    count: usize,
}

/// How a stage differs from the usual one.
pub(crate) struct Options {
    /// How long the robot is told to have patience, seconds.
    pub(crate) patience_s: u32,
    /// Whether everything said carries fields that nobody knows.
    pub(crate) has_extras: bool,
    /// Whether somebody follows the robot's state.
    pub(crate) is_followed: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            patience_s: 20,
            has_extras: false,
            is_followed: false,
        }
    }
}

/// A robot's process on a run of its own.
pub(crate) struct Stage<'k> {
    pub(crate) kit: &'k Kit,
    pub(crate) run: RunName,
    pub(crate) keys: Keys,
    pub(crate) cast: Cast,
    pub(crate) seen: Seen,
    pub(crate) process: Process,
    /// Clocks that were repeated while their answer was awaited.
    pub(crate) repeated: BTreeSet<(Epoch, Tick)>,
    /// What the robot is welcomed with, should it ask in the middle of a tick.
    pub(crate) rejoin: Option<Welcome>,
    options: Options,
    joins: VecDeque<Joining>,
    queue: SyncSender<Event>,
    events: Receiver<Event>,
    clock: Publisher,
    declared: Vec<Declared>,
}

impl From<BusError> for Failure {
    fn from(error: BusError) -> Self {
        Self::new("the kit's own bus works", error.to_string())
    }
}

impl<'k> Stage<'k> {
    /// Opens a run and starts the robot's program on it.
    pub(crate) fn open(kit: &'k Kit, options: Options) -> Result<Self, Failure> {
        let run = kit.next_run();
        let (bus, keys) = (&kit.bus, Keys::new(&run));
        let (queue, events) = std::sync::mpsc::sync_channel(QUEUE);
        let mut declared = Vec::new();
        // A send fails only when the stage is over; then nobody is left to tell.
        let events_of = || queue.clone();
        let sender = events_of();
        declared.push(bus.subscribe(&keys.reports(), move |key, bytes| {
            let _ = sender.send(Event::Report {
                key: key.into(),
                bytes: bytes.into(),
                at: Instant::now(),
            });
        })?);
        let sender = events_of();
        declared.push(bus.queryable(&keys.joins(), move |query| {
            let _ = sender.send(Event::Join(query));
        })?);
        let sender = events_of();
        declared.push(bus.liveliness(&keys.alive_robots(), move |key, is_there| {
            let _ = sender.send(Event::Token(Keys::last_chunk(key).to_owned(), is_there));
        })?);
        let clock = bus.publisher(&keys.clock())?;
        declared.push(bus.token(&keys.alive_sim())?);
        let environment = [
            ("CARS_RUN", run.to_string()),
            ("CARS_CONNECT", kit.endpoint.clone()),
            ("CARS_PATIENCE_S", options.patience_s.to_string()),
            ("CARS_GONE_PATIENCE_S", options.patience_s.to_string()),
        ];
        let process = Process::start(&kit.command, &environment)
            .map_err(|error| Failure::new("the command can be started", error.to_string()))?;
        let cast = Cast::new(std::collections::BTreeMap::new(), options.has_extras);
        let seen = Seen::default();
        let (joins, repeated) = (VecDeque::new(), BTreeSet::new());
        Ok(Self {
            kit,
            run,
            keys,
            cast,
            seen,
            process,
            repeated,
            options,
            rejoin: None,
            joins,
            queue,
            events,
            clock,
            declared,
        })
    }

    /// Waits for one event and files it. Returns whether there was one.
    fn pump(&mut self, patience: Duration) -> bool {
        let Ok(event) = self.events.recv_timeout(patience) else {
            return false;
        };
        let order = self.seen.count;
        self.seen.count += 1;
        match event {
            Event::Join(query) => {
                let joining = Joining::new(query);
                if let Some(welcome) = &self.rejoin {
                    self.answer_join(&joining, &JoinAnswer::Welcome(Box::new(welcome.clone())));
                    self.seen.requests.push(joining.request);
                } else {
                    self.joins.push_back(joining);
                }
            }
            Event::Report { key, bytes, at } => {
                match reading::read(&key, Keys::robot_of(&key).unwrap_or_default(), &bytes) {
                    Ok(reading) => self.seen.answers.push(Answer {
                        reading,
                        bytes,
                        at,
                        order,
                    }),
                    Err(error) => self.seen.unreadable.push(error.to_string()),
                }
            }
            Event::State(bytes) => {
                let state = decode(STATE, "the robot", &bytes).map_err(|error| error.to_string());
                self.seen.states.push((order, state));
            }
            Event::Command { key, bytes } => {
                let command = decode(&key, "the robot", &bytes).map_err(|error| error.to_string());
                let to = Keys::robot_of(&key).unwrap_or_default().to_owned();
                self.seen.commands.push(Sent { to, command });
            }
            Event::Token(robot, is_there) => {
                if is_there {
                    self.seen.present.insert(robot);
                } else {
                    self.seen.present.remove(&robot);
                }
            }
        }
        true
    }

    /// Files what comes until `found` finds something.
    pub(crate) fn until<T>(
        &mut self,
        expected: &str,
        patience: Duration,
        mut found: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<T, Failure> {
        let deadline = Instant::now() + patience;
        let mut last_words = None;
        loop {
            if let Some(found) = found(self) {
                return Ok(found);
            }
            if self.pump(LOOK_AGAIN) {
                continue;
            }
            if self.process.ended().is_some() {
                last_words.get_or_insert_with(Instant::now);
            }
            let is_over = last_words.is_some_and(|since| since.elapsed() > LAST_WORDS);
            if is_over || Instant::now() > deadline {
                return Err(Failure::new(
                    expected,
                    format!("it never came; {}", self.process.fate()),
                ));
            }
        }
    }

    /// Files what is here already.
    pub(crate) fn drain(&mut self) {
        while self.pump(Duration::ZERO) {}
    }

    /// Files what comes within a time, for what must not come.
    pub(crate) fn settle(&mut self, time: Duration) {
        let deadline = Instant::now() + time;
        while Instant::now() < deadline {
            self.pump(deadline.saturating_duration_since(Instant::now()));
        }
    }

    /// The next request to join.
    pub(crate) fn next_join(&mut self, patience: Duration) -> Result<Joining, Failure> {
        self.until("a request to join", patience, |stage| {
            stage.joins.pop_front()
        })
    }

    /// Whether the robot's token is there.
    pub(crate) fn is_present(&self) -> bool {
        self.seen.present.contains(self.kit.subject().as_str())
    }

    /// What the robot is welcomed with, unless a check wants it otherwise.
    pub(crate) fn welcome(&self) -> Welcome {
        self.kit.welcome(&self.run)
    }

    /// Sets the other robots up, so that everything is there when the robot is welcomed.
    pub(crate) fn prepare(&mut self) -> Result<(), Failure> {
        let kit = self.kit;
        let subject = kit.subject();
        self.cast = Cast::new(kit.others(), self.options.has_extras);
        self.declared
            .extend(self.cast.serve(&kit.bus, &self.keys, &subject)?);
        // To everybody from the robot: also to those whom it may have made up.
        let everybody = self
            .keys
            .command(&subject, &subject)
            .replace(&format!("/robot/{subject}/command/"), "/robot/*/command/");
        let sender = self.queue.clone();
        self.declared
            .push(kit.bus.subscribe(&everybody, move |key, bytes| {
                let _ = sender.send(Event::Command {
                    key: key.into(),
                    bytes: bytes.into(),
                });
            })?);
        if self.options.is_followed {
            let sender = self.queue.clone();
            self.declared.push(kit.bus.subscribe(
                &self.keys.query(&subject, STATE),
                move |_, bytes| {
                    let _ = sender.send(Event::State(bytes.into()));
                },
            )?);
        }
        Ok(())
    }

    /// Lets the robot in, and waits until it shows that it is ready.
    pub(crate) fn join(&mut self, welcome: &Welcome) -> Result<(), Failure> {
        self.prepare()?;
        let joining = self.next_join(START_PATIENCE)?;
        self.answer_join(&joining, &JoinAnswer::Welcome(Box::new(welcome.clone())));
        self.seen.requests.push(joining.request);
        self.until_ready()
    }

    /// Answers a request to join.
    pub(crate) fn answer_join(&self, joining: &Joining, answer: &JoinAnswer) {
        joining.query.reply(&joining.key, self.cast.dress(answer));
    }

    /// Refuses a request to join.
    pub(crate) fn refuse_join(&self, joining: &Joining, reason: Refusal, explanation: &str) {
        let explanation = explanation.to_owned();
        self.answer_join(
            joining,
            &JoinAnswer::Refused {
                reason,
                explanation,
            },
        );
    }

    pub(crate) fn until_ready(&mut self) -> Result<(), Failure> {
        self.until(
            "its liveliness token after the welcome",
            PATIENCE,
            |stage| stage.is_present().then_some(()),
        )
    }

    /// Puts a clock.
    pub(crate) fn put_clock(&self, clock: &Clock) -> Result<(), Failure> {
        Ok(self.clock.put(self.cast.dress(clock))?)
    }

    /// Puts something else where clocks are put.
    pub(crate) fn put_as_clock(&self, bytes: &[u8]) -> Result<(), Failure> {
        Ok(self.clock.put(bytes.to_vec())?)
    }

    /// Grants a tick and waits for its report: where it stands in [`Seen::answers`], and how long it took.
    pub(crate) fn tick(&mut self, clock: &Clock) -> Result<(usize, Duration), Failure> {
        self.tick_within(clock, PATIENCE)
    }

    /// The same with another limit.
    pub(crate) fn tick_within(
        &mut self,
        clock: &Clock,
        patience: Duration,
    ) -> Result<(usize, Duration), Failure> {
        self.cast.begin(clock.epoch, clock.tick);
        self.cast
            .tell_followers(&self.kit.bus, &self.keys, &self.kit.subject())?;
        let begun = Instant::now();
        self.put_clock(clock)?;
        let index = self.report(clock, patience)?;
        let took = self
            .seen
            .answers
            .get(index)
            .map(|answer| answer.at.saturating_duration_since(begun));
        Ok((index, took.unwrap_or_default()))
    }

    /// Waits for the report of a clock that was put.
    pub(crate) fn report(&mut self, clock: &Clock, patience: Duration) -> Result<usize, Failure> {
        let mut repeated = Instant::now();
        let expected = format!("a report for tick {} of epoch {}", clock.tick, clock.epoch);
        self.until(&expected, patience, |stage| {
            if repeated.elapsed() >= REPEAT_AFTER {
                repeated = Instant::now();
                stage.repeated.insert((clock.epoch, clock.tick));
                // The wait ends by itself if nothing can be put any more.
                let _ = stage.put_clock(clock);
            }
            stage.find_report(clock.epoch, clock.tick)
        })
        .map_err(|mut failure| {
            if let Some(unreadable) = self.seen.unreadable.last() {
                failure.came = format!("{}; {unreadable}", failure.came);
            }
            failure
        })
    }

    /// The first report of a tick. One that names another epoch counts as well: that is a flaw of its own.
    fn find_report(&self, epoch: Epoch, tick: Tick) -> Option<usize> {
        let of = |is_strict: bool| {
            self.seen.answers.iter().position(|answer| {
                let report = &answer.reading.report;
                report.tick == tick && (!is_strict || report.epoch == epoch)
            })
        };
        of(true).or_else(|| if epoch == 1 { of(false) } else { None })
    }

    /// Puts a command for the robot.
    pub(crate) fn put_command(
        &self,
        from: &RobotName,
        seq: Seq,
        (epoch, tick): (Epoch, Tick),
        text: &str,
    ) -> Result<(), Failure> {
        let (performative, command) = (Performative::Achieve, text.to_owned());
        let message = Command {
            epoch,
            tick,
            seq,
            performative,
            command,
        };
        let key = self.keys.command(&self.kit.subject(), from);
        Ok(self.kit.bus.put(&key, self.cast.dress(&message))?)
    }

    /// Asks the robot something; `None` if nobody answers.
    pub(crate) fn ask(&self, what: &str, parameters: &str) -> Result<Option<Reply>, Failure> {
        Ok(self.kit.bus.get(
            &self.keys.query(&self.kit.subject(), what),
            parameters,
            None,
        )?)
    }

    /// The state that the robot shows in a tick: the one of the tick before.
    pub(crate) fn state_in(&self, epoch: Epoch, tick: Tick) -> Result<Option<Reply>, Failure> {
        self.ask(STATE, &format!("tick={tick};epoch={epoch}"))
    }

    /// Waits for the end of the process.
    pub(crate) fn until_ended(
        &mut self,
        expected: &str,
        patience: Duration,
    ) -> Result<ExitStatus, Failure> {
        let deadline = Instant::now() + patience;
        loop {
            if let Some(status) = self.process.ended() {
                return Ok(status);
            }
            if Instant::now() > deadline {
                return Err(Failure::new(expected, self.process.fate()));
            }
            self.pump(LOOK_AGAIN);
        }
    }

    /// Waits until the robot's token is gone.
    pub(crate) fn until_gone(&mut self) -> Result<(), Failure> {
        let deadline = Instant::now() + PATIENCE;
        while self.is_present() {
            if Instant::now() > deadline {
                return Err(Failure::new(
                    "its liveliness token is gone",
                    "it is still there",
                ));
            }
            self.pump(LOOK_AGAIN);
        }
        Ok(())
    }

    /// Whether somebody subscribes to what is put on a key.
    pub(crate) fn is_heard(&self, bus: &Bus, key: &str) -> Result<bool, Failure> {
        Ok(bus.publisher(key)?.has_subscribers())
    }
}

impl Joining {
    fn new(query: Query) -> Self {
        let (key, body) = (query.key().to_owned(), query.body());
        let request = decode(&key, "a robot", &body).map_err(|error| error.to_string());
        Self {
            query,
            key,
            request,
        }
    }
}

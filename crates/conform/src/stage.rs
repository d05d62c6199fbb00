//! One process of the robot and one run of its own: translates between the bus and [`Barrier`], which is the simulator's
//! side of the lock-step, and keeps all that came from the robot for the checks.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::process::ExitStatus;
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Publisher, Qos, Query, Reply};
use lockstep::{
    Admission, Barrier, Lateness, Naming, Outcome, Output, Refused, Sent as Put, Stamp, Timer,
    Timing,
};
use protocol::keys::{Keys, STATE};
use protocol::messages::{
    Clock, Command, JoinAnswer, JoinRequest, MAX_ENTRIES, News, OnLate, PublicState, Refusal,
    Report, Waiting, Welcome,
};
use protocol::{Epoch, RobotName, RunName, Tick, decode};

use crate::cast::Cast;
use crate::kit::Kit;
use crate::process::Process;
use crate::reading::{self, Reading};
use crate::report::Failure;
use crate::script::Body;

/// Messages that may queue up before the robot's link is slowed down.
const QUEUE: usize = 65_536;
/// Longest wait for a program to start and to ask to join.
pub(crate) const START_PATIENCE: Duration = Duration::from_secs(40);
/// Longest wait for anything else.
pub(crate) const PATIENCE: Duration = Duration::from_secs(10);
/// How often a wait looks whether the process still runs.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// What a process put just before its end arrives within this time.
const LAST_WORDS: Duration = Duration::from_millis(200);
/// A robot that has put its report so often without all commands that it states does not put them at all.
const INCOMPLETE: usize = 3;
/// The instance of robots that the kit plays.
const OWN_INSTANCE: &str = "conformance kit";

/// All that a robot can put or ask.
enum Event {
    Join(Query),
    Report {
        key: String,
        bytes: Vec<u8>,
        at: Instant,
        qos: Qos,
    },
    State(Vec<u8>, Qos),
    Command {
        key: String,
        bytes: Vec<u8>,
        qos: Qos,
    },
    Waiting(String, Vec<u8>),
    Token(String, bool),
    /// A query of the kit, by its number, has its reply.
    Reply(usize, Option<Reply>),
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
#[derive(Debug, Clone)]
pub(crate) struct Sent {
    pub(crate) to: String,
    /// The sender that its key names.
    pub(crate) from: String,
    pub(crate) command: Result<Command, String>,
    pub(crate) bytes: Vec<u8>,
    /// Its place among all that came.
    pub(crate) order: usize,
}

/// All that came from the robot so far.
#[derive(Default)]
pub(crate) struct Seen {
    pub(crate) answers: Vec<Answer>,
    /// Reports that cannot be read, and why.
    pub(crate) unreadable: Vec<String>,
    pub(crate) commands: Vec<Sent>,
    /// Integers of commands that are written with a fraction.
    pub(crate) not_integers: Vec<String>,
    /// States that it put, with their place among all that came.
    pub(crate) states: Vec<(usize, Result<PublicState, String>)>,
    /// Requests to join.
    pub(crate) requests: Vec<Result<JoinRequest, String>>,
    /// How often its token was undeclared.
    pub(crate) tokens_lost: usize,
    /// Replies to the kit's queries, by their numbers, with their place among all that came.
    pub(crate) replies: BTreeMap<usize, (usize, Option<Reply>)>,
    /// Robots whose liveliness tokens are declared.
    present: BTreeSet<String>,
    /// Messages that were put in a way that may lose or reorder them.
    pub(crate) wrong_qos: Vec<String>,
    pub(crate) count: usize,
}

impl Seen {
    fn note_qos(&mut self, what: &str, qos: Qos) {
        if qos == Qos::IN_ORDER {
            return;
        }

        let congestion = if qos.is_blocking { "block" } else { "drop" };
        let express = if qos.is_express { ", express" } else { "" };
        let priority = if qos.has_default_priority {
            ""
        } else {
            ", another priority"
        };
        self.wrong_qos.push(format!(
            "{what} with congestion control {congestion}{express}{priority}"
        ));
    }
}

/// A complete tick.
pub(crate) struct Done {
    pub(crate) report: Report,
    pub(crate) commands: Vec<Sent>,
    /// The place of its report in [`Seen::answers`].
    pub(crate) index: usize,
    pub(crate) took: Duration,
}

/// How a stage differs from the usual one.
pub(crate) struct Options {
    /// How long the robot is to try to join, seconds.
    pub(crate) patience_s: u32,
    /// How long the robot is to wait for a simulator that is gone, seconds.
    pub(crate) gone_patience_s: u32,
    /// Whether everything that is put carries unknown fields.
    pub(crate) has_extras: bool,
    /// Whether the kit subscribes to the robot's state.
    pub(crate) is_followed: bool,
    /// Whether the other robots put their states, so that a robot that subscribes need not query.
    pub(crate) puts_states: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            patience_s: 20,
            gone_patience_s: 20,
            has_extras: false,
            is_followed: false,
            puts_states: true,
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
    pub(crate) body: Body,
    /// Clocks that were put more than once.
    pub(crate) repeated: BTreeSet<(Epoch, Tick)>,
    /// What the robot is welcomed with; epoch, tick, generation and news flag are the barrier's.
    pub(crate) template: Welcome,
    /// Requests to join are queued for the check instead of being answered.
    pub(crate) keeps_requests: bool,
    /// Nothing reaches the robot: neither news nor clocks are put.
    pub(crate) is_cut_off: bool,
    /// News are not put.
    pub(crate) withholds_news: bool,
    barrier: Barrier<usize, Sent>,
    timers: BTreeMap<Timer, Instant>,
    epoch: Epoch,
    next: Tick,
    is_gathered: bool,
    /// News of the open tick.
    news: News,
    granted: Option<(Epoch, Tick)>,
    begun: Instant,
    outcome: Option<Outcome<usize, Sent>>,
    queries: usize,
    options: Options,
    joins: VecDeque<Joining>,
    queue: SyncSender<Event>,
    events: Receiver<Event>,
    clock: Publisher,
    declared: Vec<Declared>,
    simulator: Option<Declared>,
}

impl From<BusError> for Failure {
    fn from(error: BusError) -> Self {
        Self::new("the kit's own bus works", error.to_string())
    }
}

/// The barrier for these robots: it waits, whatever happens.
fn barrier(roster: impl IntoIterator<Item = RobotName>) -> Barrier<usize, Sent> {
    Barrier::new(roster, patient(), Timing::default(), MAX_ENTRIES as u32)
}

fn patient() -> Lateness {
    Lateness {
        on_late: OnLate::Wait,
        own: BTreeMap::new(),
        deadline: Duration::from_millis(100),
        lose_after: 1,
    }
}

impl<'k> Stage<'k> {
    /// Opens a run and starts the robot's program on it.
    pub(crate) fn open_run(kit: &'k Kit, options: Options) -> Result<Self, Failure> {
        let run = kit.next_run();
        let bus = &kit.bus;
        let keys = Keys::new(&run);
        let (queue, events) = std::sync::mpsc::sync_channel(QUEUE);
        let declared = listen(bus, &keys, &queue)?;
        let clock = bus.publisher(&keys.clock())?;
        let simulator = bus.token(&keys.alive_sim())?;
        let environment = [
            ("CARS_RUN", run.to_string()),
            ("CARS_CONNECT", kit.endpoint.clone()),
            ("CARS_PATIENCE_S", options.patience_s.to_string()),
            ("CARS_GONE_PATIENCE_S", options.gone_patience_s.to_string()),
        ];
        let process = Process::start(&kit.command, &environment)
            .map_err(|error| Failure::new("the command can be started", error.to_string()))?;

        Ok(Self {
            kit,
            keys,
            cast: Cast::new(BTreeMap::new(), options.has_extras),
            seen: Seen::default(),
            process,
            body: Body::default(),
            repeated: BTreeSet::new(),
            template: kit.template(&run),
            run,
            keeps_requests: true,
            is_cut_off: false,
            withholds_news: false,
            barrier: barrier([]),
            timers: BTreeMap::new(),
            epoch: 1,
            next: 0,
            is_gathered: false,
            news: News::default(),
            granted: None,
            begun: Instant::now(),
            outcome: None,
            queries: 0,
            options,
            joins: VecDeque::new(),
            queue,
            events,
            clock,
            declared,
            simulator: Some(simulator),
        })
    }

    /// The epoch under way.
    pub(crate) fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// The tick that is granted next.
    pub(crate) fn next_tick(&self) -> Tick {
        self.next
    }

    /// Whether the robot takes part from the next tick on, in the middle of an epoch.
    pub(crate) fn takes_over(&self) -> bool {
        let (generation, _) = self.barrier.presence(&self.kit.subject());
        let has_answered = self.seen.answers.iter().any(|answer| {
            let report = &answer.reading.report;
            (report.epoch, report.generation) == (self.epoch, generation)
        });

        self.next > 0 && !has_answered
    }

    /// Waits for one event and files it, and lets timers fire that are due. Returns whether there was an event.
    fn pump(&mut self, patience: Duration) -> bool {
        self.fire_timers();
        let Ok(event) = self.events.recv_timeout(patience) else {
            return false;
        };

        let order = self.seen.count;
        self.seen.count += 1;
        match event {
            Event::Join(query) => {
                let joining = Joining::new(query);
                if self.keeps_requests {
                    self.joins.push_back(joining);
                } else {
                    self.admit(&joining);
                }
            }
            Event::Report {
                key,
                bytes,
                at,
                qos,
            } => {
                self.seen.note_qos("a report", qos);
                self.on_report(&key, bytes, at, order);
            }
            Event::State(bytes, qos) => {
                self.seen.note_qos("a state", qos);
                let state = decode(STATE, "the robot", &bytes).map_err(|error| error.to_string());
                self.seen.states.push((order, state));
            }
            Event::Command { key, bytes, qos } => {
                self.seen.note_qos("a command", qos);
                self.on_command(&key, bytes, order);
            }
            Event::Waiting(key, bytes) => {
                let robot = Keys::robot_of(&key).and_then(|name| RobotName::new(name).ok());
                let waiting: Option<Waiting> = decode(&key, "the robot", &bytes).ok();
                if let (Some(robot), Some(waiting)) = (robot, waiting) {
                    self.drive(|barrier, out| {
                        barrier.waiting(&robot, waiting.epoch, waiting.tick, waiting.on, out);
                    });
                }
            }
            Event::Token(robot, is_present) => self.on_token(&robot, is_present),
            Event::Reply(number, reply) => {
                self.seen.replies.insert(number, (order, reply));
            }
        }
        true
    }

    fn on_report(&mut self, key: &str, bytes: Vec<u8>, at: Instant, order: usize) {
        let robot = Keys::robot_of(key).unwrap_or_default();
        let reading = match reading::read(key, robot, &bytes) {
            Ok(reading) => reading,
            Err(error) => return self.seen.unreadable.push(error.to_string()),
        };

        let report = &reading.report;
        let stamp = Stamp {
            epoch: report.epoch,
            tick: report.tick,
            generation: report.generation,
        };
        let commands = report.commands;
        let index = self.seen.answers.len();
        self.seen.answers.push(Answer {
            reading,
            bytes,
            at,
            order,
        });
        if let Ok(name) = RobotName::new(robot) {
            self.drive(|barrier, out| barrier.report(&name, stamp, commands, index, out));
        }
    }

    fn on_command(&mut self, key: &str, bytes: Vec<u8>, order: usize) {
        let to = Keys::robot_of(key).unwrap_or_default().to_owned();
        let from = Keys::last_chunk(key).to_owned();
        let read = reading::read_command(key, &from, &bytes);
        let command = match read {
            Ok((command, not_integers)) => {
                self.seen.not_integers.extend(not_integers);
                Ok(command)
            }
            Err(error) => Err(error.to_string()),
        };
        let sent = Sent {
            to: to.clone(),
            from: from.clone(),
            command,
            bytes,
            order,
        };
        self.seen.commands.push(sent.clone());

        let (Ok(command), Ok(to), Ok(from)) =
            (&sent.command, RobotName::new(&to), RobotName::new(&from))
        else {
            return;
        };
        let stamp = Stamp {
            epoch: command.epoch,
            tick: command.tick,
            generation: command.generation,
        };
        let number = command.number;
        let put = Put { to, command: sent };
        self.drive(|barrier, out| barrier.command(&from, stamp, number, put, out));
    }

    fn on_token(&mut self, robot: &str, is_present: bool) {
        if is_present {
            self.seen.present.insert(robot.to_owned());
        } else {
            self.seen.present.remove(robot);
            self.seen.tokens_lost += 1;
        }
        if let Ok(name) = RobotName::new(robot)
            && self.barrier.has(&name)
        {
            self.drive(|barrier, out| barrier.token(&name, is_present, out));
        }
    }

    fn fire_timers(&mut self) {
        let now = Instant::now();
        let due: Vec<Timer> = self
            .timers
            .iter()
            .filter(|(_, at)| **at <= now)
            .map(|(timer, _)| timer.clone())
            .collect();

        for timer in due {
            self.timers.remove(&timer);
            self.drive(|barrier, out| barrier.timer(&timer, out));
        }
    }

    /// Lets the barrier act, and carries out what it wants done.
    fn drive(
        &mut self,
        act: impl FnOnce(&mut Barrier<usize, Sent>, &mut Vec<Output<usize, Sent>>),
    ) {
        let mut out = Vec::new();
        act(&mut self.barrier, &mut out);
        for output in out {
            match output {
                Output::Gathered => self.is_gathered = true,
                Output::Grant { news, clock } => self.grant(&news, &clock),
                Output::Complete(outcome) => self.outcome = Some(outcome),
                Output::SetTimer(timer, after) => {
                    self.timers.insert(timer, Instant::now() + after);
                }
                // Checks look at what came, not at what the barrier makes of it.
                Output::Held | Output::Released | Output::Aborted | Output::Ignored(..) => {}
            }
        }
    }

    /// Puts news and clock, and reports for the robots that the kit plays.
    fn grant(&mut self, news: &[(RobotName, Naming)], clock: &Clock) {
        let at = (clock.epoch, clock.tick);
        if self.granted == Some(at) {
            self.repeated.insert(at);
        }
        self.granted = Some(at);
        self.cast.begin(clock.epoch, clock.tick);
        if !self.is_cut_off {
            // Where nothing can be put any more, the wait for the report ends by itself.
            let _ = self.put_tick(news, clock);
        }

        let others: Vec<RobotName> = self.cast.names().cloned().collect();
        for name in others {
            let (generation, _) = self.barrier.presence(&name);
            let stamp = Stamp {
                epoch: clock.epoch,
                tick: clock.tick,
                generation,
            };
            self.drive(|barrier, out| barrier.report(&name, stamp, 0, usize::MAX, out));
        }
    }

    fn put_tick(&self, news: &[(RobotName, Naming)], clock: &Clock) -> Result<(), Failure> {
        if self.options.puts_states {
            self.cast.put_states(&self.kit.bus, &self.keys)?;
        }
        let subject = self.kit.subject();
        let own = news.iter().find(|(name, _)| *name == subject);
        if let Some((_, naming)) = own
            && !self.withholds_news
        {
            self.put_news(&News {
                epoch: clock.epoch,
                tick: clock.tick,
                joined: naming.joined,
                rejoin: naming.rejoin,
                ..self.news.clone()
            })?;
        }

        self.put_clock(clock)
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

    /// Files what comes within a time, for what must not come.
    pub(crate) fn settle(&mut self, time: Duration) {
        let deadline = Instant::now() + time;
        while Instant::now() < deadline {
            let rest = deadline.saturating_duration_since(Instant::now());
            self.pump(rest.min(LOOK_AGAIN));
        }
    }

    /// The next request to join.
    pub(crate) fn next_join(&mut self, patience: Duration) -> Result<Joining, Failure> {
        self.until("a request to join", patience, |stage| {
            stage.joins.pop_front()
        })
    }

    /// Whether the robot's token is declared.
    pub(crate) fn is_present(&self) -> bool {
        self.seen.present.contains(self.kit.subject().as_str())
    }

    /// Sets the other robots up and begins the first epoch, so that the robot can be admitted.
    pub(crate) fn prepare(&mut self) -> Result<(), Failure> {
        let kit = self.kit;
        let subject = kit.subject();
        self.template = kit.template(&self.run);
        self.cast = Cast::new(kit.others(), self.options.has_extras);
        self.declared.extend(self.cast.serve(&kit.bus, &self.keys)?);
        if self.options.is_followed {
            let sender = self.queue.clone();
            self.declared.push(kit.bus.subscribe_with_qos(
                &self.keys.query(&subject, STATE),
                move |_, bytes, qos| {
                    let _ = sender.send(Event::State(bytes.into(), qos));
                },
            )?);
        }

        let others: Vec<RobotName> = self.cast.names().cloned().collect();
        let roster = others.iter().cloned().chain([subject]);
        self.barrier = barrier(roster);
        for name in &others {
            self.play(name);
        }
        // A token that was declared before the welcome is a flaw of its own, and hides nothing else.
        if self.is_present() {
            let subject = kit.subject();
            self.drive(|barrier, out| barrier.token(&subject, true, out));
        }
        self.begin_epoch(1);
        Ok(())
    }

    /// The kit plays this robot: it joins at once.
    fn play(&mut self, name: &RobotName) {
        self.drive(|barrier, out| {
            let admission = barrier.join(name, OWN_INSTANCE, out);
            assert!(
                admission.is_ok(),
                "the name of a robot that is played is free"
            );
            barrier.token(name, true, out);
        });
    }

    /// `init`: begins an epoch.
    pub(crate) fn begin_epoch(&mut self, epoch: Epoch) {
        self.epoch = epoch;
        self.next = 0;
        self.is_gathered = false;
        self.outcome = None;
        self.drive(|barrier, out| barrier.gather(epoch, patient(), out));
    }

    /// The predecessor of the robot's process, played by the kit, takes part up to this tick and is gone.
    pub(crate) fn play_predecessor(&mut self, last: Tick) -> Result<(), Failure> {
        let subject = self.kit.subject();
        self.play(&subject);
        for tick in 0..=last {
            self.open(&News::default())?;
            let stamp = Stamp {
                epoch: self.epoch,
                tick,
                generation: 1,
            };
            self.drive(|barrier, out| barrier.report(&subject, stamp, 0, usize::MAX, out));
            self.outcome = None;
        }
        self.drive(|barrier, out| barrier.token(&subject, false, out));
        Ok(())
    }

    /// Another process, played by the kit, takes the place of the robot's.
    pub(crate) fn play_successor(&mut self) {
        let subject = self.kit.subject();
        self.drive(|barrier, out| barrier.token(&subject, false, out));
        self.play(&subject);
    }

    /// Admits the robot, and waits until its token is declared. From now on its requests are answered as they come.
    pub(crate) fn join(&mut self) -> Result<(), Failure> {
        self.prepare()?;
        self.admit_first()
    }

    /// The same where the other robots are set up.
    pub(crate) fn admit_first(&mut self) -> Result<(), Failure> {
        let joining = self.next_join(START_PATIENCE)?;
        self.admit(&joining);
        self.keeps_requests = false;
        self.until_ready()
    }

    /// Answers a request to join as the barrier decides.
    pub(crate) fn admit(&mut self, joining: &Joining) {
        self.seen.requests.push(joining.request.clone());
        let request = match &joining.request {
            Ok(request) => request.clone(),
            Err(error) => return self.refuse_join(joining, Refusal::Malformed, error),
        };

        let mut admitted = Err(Refused::Ended);
        self.drive(|barrier, out| admitted = barrier.join(&request.name, &request.instance, out));
        match admitted {
            Ok(admission) => self.welcome(joining, admission),
            Err(Refused::UnknownName) => self.refuse_join(
                joining,
                Refusal::UnknownName,
                "no robot of this run has this name",
            ),
            Err(Refused::NameTaken) => {
                self.refuse_join(joining, Refusal::NameTaken, "another process is this robot");
            }
            Err(Refused::Ended) => {
                self.refuse_join(joining, Refusal::Ended, "the run is over");
            }
        }
    }

    fn welcome(&self, joining: &Joining, admission: Admission) {
        let mut welcome = self.template.clone();
        welcome.epoch = admission.epoch;
        welcome.generation = admission.generation;
        welcome.news_flag = admission.news_flag;
        welcome.tick = self.next.saturating_sub(1);
        self.answer_join(joining, &JoinAnswer::Welcome(Box::new(welcome)));
    }

    /// Welcomes the robot to an epoch that is over.
    pub(crate) fn welcome_to(&mut self, joining: &Joining, epoch: Epoch) {
        self.seen.requests.push(joining.request.clone());
        self.welcome(
            joining,
            Admission {
                epoch,
                generation: 1,
                news_flag: self.flag(),
            },
        );
    }

    /// Answers a request to join.
    pub(crate) fn answer_join(&self, joining: &Joining, answer: &JoinAnswer) {
        joining.query.reply(&joining.key, self.cast.dress(answer));
    }

    /// Refuses a request to join.
    pub(crate) fn refuse_join(&self, joining: &Joining, reason: Refusal, explanation: &str) {
        self.answer_join(
            joining,
            &JoinAnswer::Refused {
                reason,
                explanation: explanation.to_owned(),
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

    /// Whether the tick that was granted last is open.
    pub(crate) fn is_open(&self) -> bool {
        self.barrier.is_open()
    }

    /// The robot's flag in clocks.
    pub(crate) fn flag(&self) -> u32 {
        let subject = self.kit.subject();
        let index = self.barrier.roster().position(|name| *name == subject);

        1 << (index.unwrap_or_default() % protocol::messages::NEWS_FLAGS)
    }

    /// Puts a clock.
    pub(crate) fn put_clock(&self, clock: &Clock) -> Result<(), Failure> {
        Ok(self.clock.put(self.cast.dress(clock))?)
    }

    /// Puts something else where clocks are put.
    pub(crate) fn put_as_clock(&self, bytes: &[u8]) -> Result<(), Failure> {
        Ok(self.clock.put(bytes.to_vec())?)
    }

    /// Puts news for the robot.
    pub(crate) fn put_news(&self, news: &News) -> Result<(), Failure> {
        self.put_as_news(&self.cast.dress(news))
    }

    /// Puts something else where its news are put.
    pub(crate) fn put_as_news(&self, bytes: &[u8]) -> Result<(), Failure> {
        let key = self.keys.news(&self.kit.subject());
        Ok(self.kit.bus.put(&key, bytes.to_vec())?)
    }

    /// Puts the last clock and its news again.
    pub(crate) fn repeat(&mut self) {
        self.drive(lockstep::Barrier::repeat);
    }

    /// The news of the open tick, as they are put.
    pub(crate) fn open_news(&self) -> News {
        News {
            epoch: self.epoch,
            tick: self.next.saturating_sub(1),
            ..self.news.clone()
        }
    }

    /// Grants the next tick with these news.
    pub(crate) fn open(&mut self, news: &News) -> Result<(), Failure> {
        self.until("all robots are connected", PATIENCE, |stage| {
            stage.is_gathered.then_some(())
        })?;

        let tick = self.next;
        let mut named = BTreeSet::new();
        if !news.is_empty() {
            named.insert(self.kit.subject());
        }
        self.news = news.clone();
        self.next += 1;
        self.outcome = None;
        self.begun = Instant::now();
        self.drive(|barrier, out| barrier.open(tick, named, out));
        Ok(())
    }

    /// Waits until the open tick is complete.
    pub(crate) fn complete(&mut self) -> Result<Done, Failure> {
        self.complete_within(PATIENCE)
    }

    /// The same with another limit.
    pub(crate) fn complete_within(&mut self, patience: Duration) -> Result<Done, Failure> {
        let subject = self.kit.subject();
        let tick = self.next.saturating_sub(1);
        let expected = format!("a report for tick {tick} of epoch {}", self.epoch);
        let came = self.until(&expected, patience, |stage| {
            if let Some(outcome) = stage.outcome.take() {
                return Some(Ok(outcome));
            }
            stage.hopeless(tick).map(Err)
        });
        let mut outcome = match came {
            Ok(came) => came?,
            Err(mut failure) => {
                if let Some(unreadable) = self.seen.unreadable.last() {
                    failure.came = format!("{}; {unreadable}", failure.came);
                }
                return Err(failure);
            }
        };

        let missing = || Failure::new(&expected, "the clock went on without one");
        let (index, commands) = outcome.reports.remove(&subject).ok_or_else(missing)?;
        let answer = self.seen.answers.get(index).ok_or_else(missing)?;
        Ok(Done {
            report: answer.reading.report.clone(),
            commands: commands.into_iter().map(|put| put.command).collect(),
            index,
            took: answer.at.saturating_duration_since(self.begun),
        })
    }

    /// Why the open tick will never be complete, if that is known.
    fn hopeless(&self, tick: Tick) -> Option<Failure> {
        let (generation, _) = self.barrier.presence(&self.kit.subject());
        let reports = self
            .seen
            .answers
            .iter()
            .map(|answer| &answer.reading.report);
        let wrong = reports
            .filter(|report| report.tick == tick)
            .find(|report| report.generation != generation && report.epoch == self.epoch);
        if let Some(report) = wrong {
            return Some(Failure::new(
                format!("a report of generation {generation} for tick {tick}"),
                format!("one of generation {}", report.generation),
            ));
        }

        let stated = self.incomplete()?;
        Some(Failure::new(
            format!("{stated} commands, put before the report of tick {tick} that states so many"),
            self.commands_of(tick),
        ))
    }

    /// How many commands the robot states for the open tick again and again, and does not put.
    pub(crate) fn incomplete(&self) -> Option<u32> {
        let at = (self.epoch, self.next.saturating_sub(1));
        if !self.barrier.is_open() {
            return None;
        }
        let of_tick: Vec<&Report> = self
            .seen
            .answers
            .iter()
            .map(|answer| &answer.reading.report)
            .filter(|report| (report.epoch, report.tick) == at && report.commands > 0)
            .collect();

        let stated = of_tick.first()?.commands;
        (of_tick.len() >= INCOMPLETE).then_some(stated)
    }

    /// The commands of a tick as they came, in words.
    fn commands_of(&self, tick: Tick) -> String {
        let of_tick = |sent: &&Sent| {
            sent.command
                .as_ref()
                .is_ok_and(|command| command.tick == tick)
        };
        let numbers: BTreeSet<u32> = self
            .seen
            .commands
            .iter()
            .filter(of_tick)
            .filter_map(|sent| Some(sent.command.as_ref().ok()?.number))
            .collect();

        format!("commands with the numbers {numbers:?}")
    }

    /// Grants the next tick while the robot is cut off, and goes on without it: it is lost.
    pub(crate) fn miss(&mut self) -> Result<(), Failure> {
        self.is_cut_off = true;
        let impatient = Lateness {
            on_late: OnLate::Continue,
            ..patient()
        };
        self.drive(|barrier, out| barrier.set_lateness(impatient, out));
        self.open(&News::default())?;
        self.until("the clock goes on", PATIENCE, |stage| stage.outcome.take())?;
        self.drive(|barrier, out| barrier.set_lateness(patient(), out));
        self.is_cut_off = false;
        Ok(())
    }

    /// Puts the clock that ends the run.
    pub(crate) fn put_end(&mut self, end: protocol::messages::End) -> Result<(), Failure> {
        let clock = self.barrier.end(end);
        self.put_clock(&clock)
    }

    /// Undeclares the simulator's liveliness token, or declares it again.
    pub(crate) fn show_simulator(&mut self, is_present: bool) -> Result<(), Failure> {
        self.simulator = None;
        if is_present {
            self.simulator = Some(self.kit.bus.token(&self.keys.alive_sim())?);
        }
        Ok(())
    }

    /// Queries the robot; `None` if there is no reply.
    pub(crate) fn ask(&self, what: &str, parameters: &str) -> Result<Option<Reply>, Failure> {
        let key = self.keys.query(&self.kit.subject(), what);
        Ok(self.kit.bus.get(&key, parameters, None)?)
    }

    /// The state that the robot shows in a tick: the one of the tick before.
    pub(crate) fn state_in(&self, epoch: Epoch, tick: Tick) -> Result<Option<Reply>, Failure> {
        self.ask(STATE, &format!("tick={tick};epoch={epoch}"))
    }

    /// Queries that state without waiting. Returns the number of the reply in [`Seen::replies`].
    pub(crate) fn begin_query(&mut self, epoch: Epoch, tick: Tick) -> Result<usize, Failure> {
        let number = self.queries;
        self.queries += 1;
        let sender = self.queue.clone();
        let key = self.keys.query(&self.kit.subject(), STATE);
        self.kit
            .bus
            .get_then(&key, &format!("tick={tick};epoch={epoch}"), move |reply| {
                let _ = sender.send(Event::Reply(number, reply));
            })?;
        Ok(number)
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

    /// Waits until the robot's token is undeclared.
    pub(crate) fn until_gone(&mut self) -> Result<(), Failure> {
        let deadline = Instant::now() + PATIENCE;
        while self.is_present() {
            if Instant::now() > deadline {
                return Err(Failure::new(
                    "its liveliness token is undeclared",
                    "it is still declared",
                ));
            }
            self.pump(LOOK_AGAIN);
        }
        Ok(())
    }

    /// Whether there is a subscriber to what is put on a key.
    pub(crate) fn is_heard(&self, key: &str) -> Result<bool, Failure> {
        Ok(self.kit.bus.publisher(key)?.has_subscribers())
    }
}

/// Subscribes to all that the robots of a run put, and answers their requests. A send fails only when the stage is over.
fn listen(bus: &Bus, keys: &Keys, queue: &SyncSender<Event>) -> Result<Vec<Declared>, BusError> {
    let sender = queue.clone();
    let reports = bus.subscribe_with_qos(&keys.reports(), move |key, bytes, qos| {
        let _ = sender.send(Event::Report {
            key: key.into(),
            bytes: bytes.into(),
            at: Instant::now(),
            qos,
        });
    })?;
    let sender = queue.clone();
    let commands = bus.subscribe_with_qos(&keys.commands(), move |key, bytes, qos| {
        let _ = sender.send(Event::Command {
            key: key.into(),
            bytes: bytes.into(),
            qos,
        });
    })?;
    let sender = queue.clone();
    let waiting = bus.subscribe(&keys.all_waiting(), move |key, bytes| {
        let _ = sender.send(Event::Waiting(key.into(), bytes.into()));
    })?;
    let sender = queue.clone();
    let joins = bus.queryable(&keys.joins(), move |query| {
        let _ = sender.send(Event::Join(query));
    })?;
    let sender = queue.clone();
    let tokens = bus.liveliness(&keys.alive_robots(), move |key, is_present| {
        let _ = sender.send(Event::Token(Keys::last_chunk(key).to_owned(), is_present));
    })?;

    Ok(vec![reports, commands, waiting, joins, tokens])
}

impl Joining {
    fn new(query: Query) -> Self {
        let key = query.key().to_owned();
        let request = decode(&key, "a robot", &query.body()).map_err(|error| error.to_string());
        Self {
            query,
            key,
            request,
        }
    }
}

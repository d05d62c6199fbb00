//! One process of the robot and one run of its own: translates between the bus and [`Barrier`], which is the simulator's
//! side of the lock-step, and keeps all that came from the robot for the checks.

mod joining;
mod queries;
mod ticks;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::process::ExitStatus;
use std::time::{Duration, Instant};

use bus::Declared;
use lockstep::{
    Barrier, BarrierOutput, IncarnationNotice, LatePolicy, Sent as Put, Stamp, TickOutcome, Timer,
    Timing,
};
use protocol::keys::Keys;
use protocol::messages::{
    Clock, MAX_ENTRIES, OnLate, Report, Target, TickUpdate, Waiting, Welcome,
};
use protocol::{Epoch, RobotName, RunName, Tick, decode};

use crate::body::RobotBody;
use crate::fake_peers::FakePeers;
use crate::kit::{Kit, KitRoster};
use crate::patience::{Limit, PATIENCE};
use crate::process::RobotProcess;
use crate::report::RuleFailure;
use crate::seen::{ReportedCommand, Seen};
use crate::stdio::STDIO_VARIABLE;
use crate::wire::{Joining, Wire, WireEvent};

/// How often a wait looks whether the process still runs.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// What a process put just before its end arrives within this time.
const LAST_WORDS: Duration = Duration::from_millis(200);
/// How often something is put again that may have been lost, as the clock of a run would.
const REPEAT: Duration = Duration::from_secs(2);
/// How soon a clock is repeated for a robot that was welcomed and does not answer: some drop it, which a run forgives.
const REPEAT_FOR_NEWCOMERS: Duration = Duration::from_millis(200);
/// A robot that still does not rest after this time never does.
const RESTLESS: Duration = Duration::from_secs(1);
/// How long a robot that was admitted has to declare its token. The checks demand that it does.
const TOKEN_PATIENCE: Duration = Duration::from_secs(120);

/// A complete tick.
pub struct CompleteTick {
    /// The report of the robot.
    pub report: Report,
    /// Its commands, by number.
    pub commands: Vec<ReportedCommand>,
    /// The place of its report in [`Seen::answers`].
    pub index: usize,
    /// From the clock to the report, wall clock.
    pub took: Duration,
}

/// How a harness differs from the usual one.
pub struct HarnessOptions {
    /// How long the robot is to try to join, seconds.
    pub patience_s: u32,
    /// How long the robot is to wait for a simulator that is gone, seconds.
    pub gone_patience_s: u32,
    /// Whether everything that is put carries unknown fields.
    pub has_extras: bool,
    /// Whether whole numbers are written without a fraction wherever a fraction is possible.
    pub writes_integers: bool,
    /// Whether the kit subscribes to the robot's state.
    pub is_followed: bool,
    /// Whether the other robots put their states, so that a robot that subscribes need not query.
    pub puts_states: bool,
    /// Which robots take part.
    pub roster: KitRoster,
}

impl Default for HarnessOptions {
    fn default() -> Self {
        Self {
            // So long that no machine uses it up.
            patience_s: 120,
            gone_patience_s: 120,
            has_extras: false,
            writes_integers: false,
            is_followed: false,
            puts_states: true,
            roster: KitRoster::Usual,
        }
    }
}

/// A robot's process on a run of its own.
pub struct Harness<'k> {
    /// The kit that it is of.
    pub kit: &'k Kit,
    /// The run, which no other harness has.
    pub run: RunName,
    /// The keys of the run.
    pub keys: Keys,
    /// The robots that the kit plays.
    pub fake_peers: FakePeers,
    /// All that came from the robot.
    pub seen: Seen,
    /// Its process.
    pub process: RobotProcess,
    /// Where it stands.
    pub body: RobotBody,
    /// Clocks that were put more than once.
    pub repeated: BTreeSet<(Epoch, Tick)>,
    /// What the robot is welcomed with; epoch, tick, generation and news flag are the barrier's.
    pub template: Welcome,
    /// Requests to join are queued for the check instead of being answered.
    pub keeps_requests: bool,
    /// Nothing reaches the robot: neither news nor clocks are put.
    pub is_cut_off: bool,
    /// News are put twice before each clock.
    pub doubles_news: bool,
    /// News are not put.
    pub withholds_news: bool,
    /// Flags that clocks have in addition to the barrier's.
    pub more_flags: u32,
    /// Clocks say that observers are shown their tick.
    pub shows_panels: bool,
    /// Further incarnations are welcomed as if they had asked a tick earlier, when the body stood elsewhere.
    pub asks_early: bool,
    wire: Wire,
    /// Tokens of the robots that the kit plays.
    tokens: Vec<Declared>,
    barrier: Barrier<usize, ReportedCommand>,
    timers: BTreeMap<Timer, Instant>,
    epoch: Epoch,
    next: Tick,
    is_gathered: bool,
    /// News of the open tick.
    news: TickUpdate,
    granted: Option<(Epoch, Tick)>,
    begun: Instant,
    outcome: Option<TickOutcome<usize, ReportedCommand>>,
    options: HarnessOptions,
    joins: VecDeque<Joining>,
}

/// Starts the robot's program on a run.
fn start(kit: &Kit, run: &RunName, options: &HarnessOptions) -> Result<RobotProcess, RuleFailure> {
    let environment = [
        ("CARS_RUN", run.to_string()),
        ("CARS_CONNECT", kit.endpoint.clone()),
        ("CARS_PATIENCE_S", options.patience_s.to_string()),
        ("CARS_GONE_PATIENCE_S", options.gone_patience_s.to_string()),
        (STDIO_VARIABLE, "true".to_owned()),
    ];
    RobotProcess::start(&kit.command, &environment)
        .map_err(|error| RuleFailure::new("the command can be started", error.to_string()))
}

/// The barrier for these robots: it waits, whatever happens.
fn barrier(roster: impl IntoIterator<Item = RobotName>) -> Barrier<usize, ReportedCommand> {
    let timing = Timing {
        token: TOKEN_PATIENCE,
        // Later than in a run, after any robot's answer: what it does with a clock that comes again is another rule's.
        repeat_for_newcomers: REPEAT_FOR_NEWCOMERS,
        ..Timing::default()
    };
    Barrier::new(roster, patient(), timing, MAX_ENTRIES as u32)
}

fn patient() -> LatePolicy {
    LatePolicy {
        on_late: OnLate::Wait,
        own: BTreeMap::new(),
        deadline: Duration::from_millis(100),
        lose_after: 1,
    }
}

impl<'k> Harness<'k> {
    /// Opens a run and starts the robot's program on it.
    pub fn open_run(kit: &'k Kit, options: HarnessOptions) -> Result<Self, RuleFailure> {
        let run = kit.next_run();
        let keys = Keys::new(&run);
        let wire = Wire::open(&kit.bus, &keys)?;
        let process = start(kit, &run, &options)?;

        Ok(Self {
            kit,
            keys,
            fake_peers: FakePeers::default(),
            seen: Seen::default(),
            process,
            body: RobotBody::default(),
            repeated: BTreeSet::new(),
            template: kit.template(&run, options.roster),
            run,
            keeps_requests: true,
            is_cut_off: false,
            doubles_news: false,
            withholds_news: false,
            more_flags: 0,
            shows_panels: false,
            asks_early: false,
            wire,
            tokens: Vec::new(),
            barrier: barrier([]),
            timers: BTreeMap::new(),
            epoch: 1,
            next: 0,
            is_gathered: false,
            news: TickUpdate::default(),
            granted: None,
            begun: Instant::now(),
            outcome: None,
            options,
            joins: VecDeque::new(),
        })
    }

    /// The epoch under way.
    pub fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// The tick that is granted next.
    pub fn next_tick(&self) -> Tick {
        self.next
    }

    /// Whether the robot's token is declared.
    pub fn is_present(&self) -> bool {
        self.seen.is_present(self.kit.subject().as_str())
    }

    /// The robot's token has been declared without a break since it joined, also when something happened that it was to bear.
    pub fn demand_token_kept(&self, when: &str) -> Result<(), RuleFailure> {
        if self.seen.tokens_lost == 0 {
            return Ok(());
        }
        let expected = format!("its token stays declared when {when}");
        Err(RuleFailure::maybe_of_load(expected, "it was undeclared"))
    }

    /// From now on the other robots put their states, or do not.
    pub fn set_puts_states(&mut self, puts_states: bool) {
        self.options.puts_states = puts_states;
    }

    /// The states of the others for the open tick, as they come to a robot that is slower than they.
    pub fn put_early_states(&self) -> Result<(), RuleFailure> {
        let tick = self.next.saturating_sub(1);
        Ok(self
            .fake_peers
            .put_states_of(tick, &self.kit.bus, &self.keys)?)
    }

    /// Waits for one event and files it, and lets timers fire that are due. Returns whether there was an event.
    fn pump(&mut self, patience: Duration) -> bool {
        // Also without an event: the clock is repeated for a robot that says nothing.
        self.fire_timers();
        let Some(event) = self.wire.receive(patience) else {
            return false;
        };

        // All that comes is numbered in one order, so that rules can say what comes before what.
        let order = self.seen.next_order();
        match event {
            WireEvent::Join(query) => self.on_join(Joining::new(query)),
            WireEvent::Report {
                key,
                bytes,
                at,
                qos,
            } => {
                self.seen.note_qos("a report", qos);
                self.on_report(&key, bytes, at, order);
            }
            WireEvent::State { bytes, qos } => {
                self.seen.note_qos("a state", qos);
                self.seen.file_state(&bytes, order);
            }
            WireEvent::Command { key, bytes, qos } => {
                self.seen.note_qos("a command", qos);
                self.on_command(&key, bytes, order);
            }
            WireEvent::Waiting { key, bytes, qos } => {
                self.seen.note_qos("waiting", qos);
                self.on_waiting(&key, &bytes);
            }
            WireEvent::Token { robot, is_present } => self.on_token(&robot, is_present),
            WireEvent::Foreign(key) => self.seen.foreign.push(key),
            WireEvent::Reply(number, reply) => {
                self.seen.replies.insert(number, (order, reply));
            }
        }
        true
    }

    fn on_join(&mut self, joining: Joining) {
        if self.keeps_requests {
            self.joins.push_back(joining);
        } else {
            self.admit(joining);
        }
    }

    fn on_report(&mut self, key: &str, bytes: Vec<u8>, at: Instant, order: usize) {
        let robot = Keys::robot_of(key);
        let is_of_other = |name: &RobotName| robot == Some(name.as_str());
        if self.fake_peers.names().any(is_of_other) {
            return self.seen.foreign.push(key.to_owned());
        }
        let Some(index) = self.seen.file_report(key, bytes, at, order) else {
            return;
        };
        let Some(robot) = Keys::robot_of(key).and_then(|name| RobotName::new(name).ok()) else {
            return;
        };

        let report = &self.seen.answers[index].reading.report;
        let commands = report.commands;
        let stamp = Stamp::from(report);
        self.drive(|barrier, out| barrier.report(&robot, stamp, commands, index, out));
    }

    fn on_command(&mut self, key: &str, bytes: Vec<u8>, order: usize) {
        let sent = self.seen.file_command(key, bytes, order);
        let Ok(command) = &sent.command else { return };
        let Some(to) = Target::parse(&sent.to) else {
            return;
        };
        let Ok(from) = RobotName::new(&sent.from) else {
            return;
        };

        let number = command.number;
        let stamp = Stamp::from(command);
        let put = Put { to, command: sent };
        self.drive(|barrier, out| barrier.command(&from, stamp, number, put, out));
    }

    fn on_waiting(&mut self, key: &str, bytes: &[u8]) {
        let Some(robot) = Keys::robot_of(key).and_then(|name| RobotName::new(name).ok()) else {
            return;
        };
        let Ok(waiting) = decode::<Waiting>(key, "the robot", bytes) else {
            return;
        };
        self.seen.waiting.push(waiting.clone());

        self.drive(|barrier, out| {
            barrier.waiting(&robot, waiting.epoch, waiting.tick, &waiting.on, out);
        });
    }

    fn on_token(&mut self, robot: &str, is_present: bool) {
        self.seen.file_token(robot, is_present);
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

    /// Lets the barrier act, and carries out its outputs.
    fn drive(
        &mut self,
        act: impl FnOnce(
            &mut Barrier<usize, ReportedCommand>,
            &mut Vec<BarrierOutput<usize, ReportedCommand>>,
        ),
    ) {
        let mut out = Vec::new();
        act(&mut self.barrier, &mut out);

        for output in out {
            match output {
                BarrierOutput::Gathered => self.is_gathered = true,
                BarrierOutput::Grant { news, clock } => self.grant(&news, &clock),
                BarrierOutput::Complete(outcome) => self.outcome = Some(outcome),
                BarrierOutput::SetTimer(timer, after) => {
                    self.timers.insert(timer, Instant::now() + after);
                }
                // Checks look at what came, not at what the barrier makes of it.
                BarrierOutput::StandIn(_)
                | BarrierOutput::Held
                | BarrierOutput::Released
                | BarrierOutput::Aborted
                | BarrierOutput::Ignored(..) => {}
            }
        }
    }

    /// Puts news and clock, and reports for the robots that the kit plays.
    fn grant(&mut self, news: &[(RobotName, IncarnationNotice)], clock: &Clock) {
        let at = (clock.epoch, clock.tick);
        // A robot that is slow may get its clock twice, and may answer it twice.
        if self.granted == Some(at) {
            self.repeated.insert(at);
        }
        self.granted = Some(at);

        self.fake_peers.begin(clock.epoch, clock.tick);
        if !self.is_cut_off {
            // Where nothing can be put any more, the wait for the report ends by itself.
            let _ = self.put_tick(news, clock);
        }

        // The played robots answer at once, so that the tick waits for the one that is checked alone.
        let others: Vec<RobotName> = self.fake_peers.names().cloned().collect();
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

    fn put_tick(
        &self,
        news: &[(RobotName, IncarnationNotice)],
        clock: &Clock,
    ) -> Result<(), RuleFailure> {
        if self.options.puts_states {
            self.fake_peers.put_states(&self.kit.bus, &self.keys)?;
        }

        let subject = self.kit.subject();
        let own = news.iter().find(|(name, _)| *name == subject);
        if let Some((_, notice)) = own
            && !self.withholds_news
        {
            let news = TickUpdate {
                epoch: clock.epoch,
                tick: clock.tick,
                joined: self.news.joined.or(notice.joined),
                rejoin: notice.rejoin,
                ..self.news.clone()
            };
            self.put_news(&news)?;
            if self.doubles_news {
                self.put_news(&news)?;
            }
        }

        self.put_clock(&Clock {
            news: clock.news | self.more_flags,
            panels: clock.panels || self.shows_panels,
            ..*clock
        })
    }

    /// Files what comes until `found` finds something.
    pub fn until<T>(
        &mut self,
        expected: &str,
        patience: Duration,
        mut found: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<T, RuleFailure> {
        let mut limit = Limit::new(patience);
        let mut last_words = None;
        loop {
            if let Some(found) = found(self) {
                return Ok(found);
            }
            if self.pump(LOOK_AGAIN) {
                continue;
            }

            // What it put last may still be on its way.
            if self.process.ended().is_some() {
                last_words.get_or_insert_with(Instant::now);
            }
            let has_ended = last_words.is_some_and(|since| since.elapsed() > LAST_WORDS);
            if has_ended || limit.is_over(&self.process) {
                // It may have come since it was looked for: where the kit itself stood still, all in one moment.
                return found(self).ok_or_else(|| {
                    let came = format!("it never came; {}", self.process.fate());
                    RuleFailure::maybe_of_load(expected, came)
                });
            }
        }
    }

    /// The same for what follows from something that was put and that a link may lose which breaks: it is put again.
    pub fn until_put<T>(
        &mut self,
        expected: &str,
        patience: Duration,
        mut put: impl FnMut(&Self) -> Result<(), RuleFailure>,
        mut found: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<T, RuleFailure> {
        put(self)?;
        let mut last_put = Instant::now();
        self.until(expected, patience, |harness| {
            if last_put.elapsed() > REPEAT {
                last_put = Instant::now();
                // Where nothing can be put any more, the wait ends by itself.
                let _ = put(harness);
            }
            found(harness)
        })
    }

    /// Files what comes within a time.
    pub fn pass(&mut self, time: Duration) {
        self.pass_while(time, |_| true);
    }

    /// Files what comes within a time, as long as a condition holds.
    pub fn pass_while(&mut self, time: Duration, mut holds: impl FnMut(&Self) -> bool) {
        let deadline = Instant::now() + time;
        while holds(self) {
            let rest = deadline.saturating_duration_since(Instant::now());
            if rest.is_zero() {
                return;
            }
            self.pump(rest.min(LOOK_AGAIN));
        }
    }

    /// Files what comes within a time, and until the robot rests: after that, it has put what it had to put, and it is in
    /// the wait that it was led to.
    pub fn settle(&mut self, time: Duration) {
        self.pass(time);
        let deadline = Instant::now() + RESTLESS;
        while !self.process.is_idle() && Instant::now() < deadline {
            self.pass(LOOK_AGAIN);
        }
    }

    /// Waits for the end of the process.
    pub fn until_ended(
        &mut self,
        expected: &str,
        patience: Duration,
    ) -> Result<ExitStatus, RuleFailure> {
        self.until(expected, patience, |harness| harness.process.ended())
            .map_err(|_| RuleFailure::new(expected, self.process.fate()))
    }

    /// The same for an end that this clock brings about.
    pub fn until_ended_by(
        &mut self,
        clock: &Clock,
        expected: &str,
    ) -> Result<ExitStatus, RuleFailure> {
        self.until_put(
            expected,
            PATIENCE,
            |harness| harness.put_clock(clock),
            |harness| harness.process.ended(),
        )
    }

    /// Waits until the robot's token is undeclared.
    pub fn until_gone(&mut self) -> Result<(), RuleFailure> {
        let mut limit = Limit::new(PATIENCE);
        while self.is_present() {
            if limit.is_over(&self.process) {
                return Err(RuleFailure::new(
                    "its liveliness token is undeclared",
                    "it is still declared",
                ));
            }
            self.pump(LOOK_AGAIN);
        }
        Ok(())
    }
}

impl Drop for Harness<'_> {
    fn drop(&mut self) {
        // Whatever the check was about: each line of a program counts.
        self.kit.stdio.take(&self.process.output());
    }
}

//! The robots' side of the bus: everything that arrives goes through one queue to the robots' loop, and a robot that
//! needs an answer in the middle of its tick keeps that queue moving while it waits.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::{Duration, Instant};

use bus::{Bus, Declared, Reply};
use protocol::keys::{Keys, STATE};
use protocol::messages::{Clock, Command, CommandId, Percept, PublicState, Waiting};
use protocol::{Epoch, Malformed, Message, RobotName, Tick, decode, encode};

use crate::board::Board;
use crate::held::Held;
use crate::seat::{Network, Undelivered};

/// Messages that may queue up before the link is slowed down.
pub(crate) const QUEUE: usize = 4096;
/// A command that a clock named is reported missing after this long. Meanwhile the simulator has asked everybody to
/// repeat several times, so only a command that really cannot come gets here.
const COMMAND_PATIENCE: Duration = Duration::from_secs(10);
/// A robot that waits looks this often at what else limits its wait; after one of them it tells whom it waits for.
const LOOK_AGAIN: Duration = Duration::from_millis(250);
/// How long to sleep where nothing is due: while the simulator is there its silence is its own affair.
const LOOK_FOR_SIMULATOR: Duration = Duration::from_secs(60);
/// Between two attempts to ask a robot that does not answer.
const ASK_AGAIN: Duration = Duration::from_millis(500);
/// For how many ticks commands are kept at most, whatever the simulator says.
const MAX_REPEAT_TICKS: Tick = 2000;
/// What was not asked for in so many ticks is followed no more.
const UNUSED_TICKS: Tick = 64;

/// All that can happen to a process of robots.
pub(crate) enum Event {
    /// A clock arrived.
    Clock(Result<Clock, Malformed>),
    /// A command arrived.
    Command {
        to: RobotName,
        from: RobotName,
        command: Result<Command, Malformed>,
    },
    /// Another robot let its state be known, asked or followed.
    State { of: RobotName, state: PublicState },
    /// The simulator let a robot know what it senses, asked or followed.
    Percept { of: RobotName, percept: Percept },
    /// The simulator came or went.
    Simulator(bool),
    /// The process wants to leave.
    Stop,
}

/// Epoch and tick of the state that was asked for.
pub(crate) type Asked = (Epoch, Tick);

/// Something that is asked for so often that it is sent without being asked.
struct Followed {
    _subscription: Declared,
    last_used: Tick,
}

pub(crate) struct Link {
    bus: Bus,
    keys: Keys,
    pub(crate) board: Board,
    queue: SyncSender<Event>,
    events: Receiver<Event>,
    /// Clocks that arrived and were not looked at yet.
    clocks: VecDeque<Clock>,
    /// The clock that is being answered: epoch and tick.
    current: Asked,
    /// Commands that arrived and were not named yet, by target.
    commands: BTreeMap<RobotName, Held>,
    /// States of other processes' robots.
    states: BTreeMap<(RobotName, Asked), Arc<PublicState>>,
    percepts: BTreeMap<(RobotName, Asked), Percept>,
    /// What is followed, by key.
    followed: BTreeMap<String, Followed>,
    /// Commands of the last ticks, for those who missed them.
    sent: VecDeque<(RobotName, RobotName, Command)>,
    /// For how many ticks they are kept.
    repeat_ticks: Tick,
    /// Since when the simulator is away.
    pub(crate) simulator_gone: Option<Instant>,
    /// How long to go on without a simulator.
    patience: Duration,
    /// Whether the process wants to leave.
    pub(crate) is_stopped: Arc<AtomicBool>,
}

impl Link {
    pub(crate) fn new(bus: Bus, keys: Keys, patience: Duration) -> Self {
        let (queue, events) = std::sync::mpsc::sync_channel(QUEUE);
        Self {
            bus,
            keys,
            board: Board::default(),
            queue,
            events,
            clocks: VecDeque::new(),
            current: (0, 0),
            commands: BTreeMap::new(),
            states: BTreeMap::new(),
            percepts: BTreeMap::new(),
            followed: BTreeMap::new(),
            sent: VecDeque::new(),
            repeat_ticks: 2,
            simulator_gone: None,
            patience,
            is_stopped: Arc::default(),
        }
    }

    /// Where callbacks put what arrives.
    pub(crate) fn queue(&self) -> SyncSender<Event> {
        self.queue.clone()
    }

    /// The next clock, or `None` once the simulator has been gone for longer than there is patience, or where the process
    /// wants to leave.
    pub(crate) fn next_clock(&mut self) -> Option<Clock> {
        loop {
            if self.is_stopped() {
                return None;
            }
            while let Some(clock) = self.clocks.pop_front() {
                // Where the simulator has gone on without us, only its last clock can still be answered; the first clock
                // of an epoch or of an incarnation must be seen all the same.
                let is_first =
                    clock.tick == 0 || clock.news.values().any(|news| news.joined.is_some());
                let is_later =
                    |later: &Clock| (later.epoch, later.tick) > (clock.epoch, clock.tick);
                let is_superseded = self.clocks.iter().any(is_later) && !is_first;
                if clock.end.is_some() || !is_superseded {
                    return Some(clock);
                }
            }
            let left = match self.simulator_gone {
                Some(since) => self.patience.saturating_sub(since.elapsed()),
                None => LOOK_FOR_SIMULATOR,
            };
            if !self.pump(left)
                && self
                    .simulator_gone
                    .is_some_and(|since| since.elapsed() >= self.patience)
            {
                return None;
            }
        }
    }

    /// The clock that is being answered: epoch and tick.
    pub(crate) fn current(&self) -> Asked {
        self.current
    }

    /// Whether the process wants to leave.
    pub(crate) fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::SeqCst)
    }

    /// A tick begins: what was known for the one before is of no use any more.
    pub(crate) fn begin(&mut self, epoch: Epoch, tick: Tick) {
        if epoch != self.current.0 {
            self.commands
                .values_mut()
                .for_each(|held| held.begin(epoch));
            self.sent.clear();
        }
        self.current = (epoch, tick);
        self.states
            .retain(|(_, asked), _| *asked >= (epoch, tick.saturating_sub(1)));
        self.percepts
            .retain(|(_, asked), _| *asked >= (epoch, tick));
        self.followed
            .retain(|_, followed| tick.saturating_sub(followed.last_used) < UNUSED_TICKS);
        self.sent
            .retain(|(_, _, command)| command.tick.saturating_add(self.repeat_ticks) > tick);
    }

    /// Sends again what others may have missed.
    pub(crate) fn repeat_commands(&self) {
        for (from, to, command) in &self.sent {
            self.put(&self.keys.command(to, from), command);
        }
    }

    /// Waits for one event and files it. Returns whether there was one.
    fn pump(&mut self, patience: Duration) -> bool {
        let Ok(event) = self.events.recv_timeout(patience) else {
            return false;
        };
        match event {
            Event::Clock(Ok(clock)) => self.file_clock(clock),
            Event::Command {
                to,
                from,
                command: Ok(command),
            } => self.file_command(to, from, command),
            Event::Clock(Err(error))
            | Event::Command {
                command: Err(error),
                ..
            } => {
                tracing::warn!("{error}");
            }
            Event::State { of, state } => {
                let asked = (state.epoch, state.tick);
                // Nobody asks for anything else, and an answer does not change within a tick.
                if asked.0 == self.current.0 && asked.1.abs_diff(self.current.1) <= 1 {
                    self.states
                        .entry((of, asked))
                        .or_insert_with(|| Arc::new(state));
                }
            }
            Event::Percept { of, percept } => {
                let asked = (percept.epoch, percept.tick);
                if asked.0.abs_diff(self.current.0) <= 1
                    && asked.1.saturating_sub(1) <= self.current.1
                {
                    self.percepts.entry((of, asked)).or_insert(percept);
                }
            }
            Event::Stop => {} // The flag says so.
            Event::Simulator(is_there) => self.note_simulator(is_there),
        }
        true
    }

    fn note_simulator(&mut self, is_there: bool) {
        if is_there {
            if let Some(since) = self.simulator_gone.take() {
                tracing::warn!(
                    "the simulator is back after {:.1} s",
                    since.elapsed().as_secs_f64()
                );
            }
        } else if self.simulator_gone.is_none() {
            let patience_s = self.patience.as_secs_f64();
            tracing::warn!(
                "the simulator, or the link to it, is gone: waiting for it up to {patience_s} s"
            );
            self.simulator_gone = Some(Instant::now());
        }
    }

    fn file_clock(&mut self, clock: Clock) {
        // The clock of the tick that is under way, again: somebody misses something, and waits.
        if (clock.epoch, clock.tick) == self.current && clock.end.is_none() {
            self.repeat_commands();
        }
        if self.clocks.len() < QUEUE {
            self.clocks.push_back(clock);
        }
    }

    fn file_command(&mut self, to: RobotName, from: RobotName, command: Command) {
        if command.epoch >= self.current.0 {
            self.commands.entry(to).or_default().hold(from, command);
        }
    }

    /// Whether the tick under way is of no use any more: a clock has arrived that ends the run, begins the next epoch or
    /// shows that the simulator has gone on without us, or the process wants to leave.
    fn is_interrupted(&self) -> bool {
        let ends_it =
            |clock: &Clock| (clock.epoch, clock.tick) > self.current || clock.end.is_some();
        self.is_stopped() || self.clocks.iter().any(ends_it)
    }

    /// Asks for a message once, and follows its key from then on: whoever serves it sends it without being asked, before
    /// what must come after it, so that the next query finds its answer here already.
    fn ask<M: Message + 'static>(
        &mut self,
        key: &str,
        tick: Tick,
        of: &RobotName,
        event: fn(RobotName, M) -> Event,
    ) {
        let (queue, sender) = (self.queue(), of.clone());
        let file = move |answer: Option<Reply>| {
            if let Some(message) = read(answer, &sender) {
                // The queue is closed only when the process ends; a full one drops the answer, and it is asked again.
                let _ = queue.try_send(event(sender, message));
            }
        };
        if let Err(error) =
            self.bus
                .get_then(key, &format!("tick={tick};epoch={}", self.current.0), file)
        {
            tracing::warn!("{error}");
        }
        if !self.followed.contains_key(key) {
            self.follow(key, of, event);
        }
    }

    fn follow<M: Message + 'static>(
        &mut self,
        key: &str,
        of: &RobotName,
        event: fn(RobotName, M) -> Event,
    ) {
        let (queue, sender) = (self.queue(), of.clone());
        let subscribed = self.bus.subscribe(key, move |key, bytes| {
            match decode(key, sender.as_str(), bytes) {
                Ok(message) => drop(queue.send(event(sender.clone(), message))),
                Err(error) => tracing::warn!("{error}"),
            }
        });
        match subscribed {
            Ok(subscription) => {
                let followed = Followed {
                    _subscription: subscription,
                    last_used: self.current.1,
                };
                self.followed.insert(key.to_owned(), followed);
            }
            Err(error) => tracing::warn!("{error}"),
        }
    }

    /// What `here` finds, asked for where it is not here yet.
    fn obtain<M: Message + 'static, T>(
        &mut self,
        key: &str,
        tick: Tick,
        of: &RobotName,
        event: fn(RobotName, M) -> Event,
        here: impl Fn(&Self) -> Option<T>,
    ) -> Result<T, Undelivered> {
        if let Some(followed) = self.followed.get_mut(key) {
            followed.last_used = self.current.1;
        }
        let mut asked_at: Option<Instant> = None;
        self.wait(of, None, |link| {
            let found = here(link);
            // A query that finds nobody ends at once and without an error: it is asked again.
            if found.is_none() && asked_at.is_none_or(|at| at.elapsed() >= ASK_AGAIN) {
                asked_at = Some(Instant::now());
                link.ask(key, tick, of, event);
            }
            found
        })
    }

    pub(crate) fn put<M: Message>(&self, key: &str, message: &M) {
        if let Err(error) = self.bus.put(key, encode(message)) {
            tracing::warn!("{error}");
        }
    }

    /// Keeps the queue moving until `ready` has something, the epoch is over, or `patience` is.
    fn wait<T>(
        &mut self,
        who: &RobotName,
        patience: Option<Duration>,
        mut ready: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<T, Undelivered> {
        let begun = Instant::now();
        let mut told = false;
        loop {
            if let Some(found) = ready(self) {
                return Ok(found);
            }
            if self.is_interrupted()
                || self
                    .simulator_gone
                    .is_some_and(|since| since.elapsed() > self.patience)
            {
                return Err(Undelivered::Interrupted);
            }
            if patience.is_some_and(|patience| begun.elapsed() > patience) {
                return Err(Undelivered::Lost);
            }
            let has_news = self.pump(LOOK_AGAIN);
            if !has_news && !told && !self.commands.contains_key(who) {
                told = true;
                self.tell_waiting(who);
            }
        }
    }

    fn tell_waiting(&self, on: &RobotName) {
        let (epoch, tick) = self.current;
        for robot in self.commands.keys() {
            self.put(
                &self.keys.waiting(robot),
                &Waiting {
                    epoch,
                    tick,
                    on: on.clone(),
                },
            );
        }
    }

    /// A robot of this process was told for how many ticks it must be able to repeat its commands.
    pub(crate) fn keep_commands(&mut self, ticks: Tick) {
        self.repeat_ticks = self.repeat_ticks.max(ticks.min(MAX_REPEAT_TICKS));
    }

    /// Names the robots of this process, so that their commands have a place.
    pub(crate) fn host(&mut self, robot: &RobotName) {
        self.commands.entry(robot.clone()).or_default();
    }
}

fn read<M: Message>(answer: Option<Reply>, sender: &RobotName) -> Option<M> {
    let answer = answer?;
    let bytes = answer
        .result
        .map_err(|reason| tracing::debug!(%sender, reason, "a query was refused"))
        .ok()?;
    decode(&answer.key, sender.as_str(), &bytes)
        .map_err(|error| tracing::warn!("{error}"))
        .ok()
}

impl Network for Link {
    fn state_of(
        &mut self,
        target: &RobotName,
        epoch: Epoch,
        tick: Tick,
    ) -> Result<Arc<PublicState>, Undelivered> {
        if self.commands.contains_key(target) {
            return self.board.get(target, epoch, tick).ok_or(Undelivered::Lost);
        }
        let (key, wanted) = (
            self.keys.query(target, STATE),
            (target.clone(), (epoch, tick)),
        );
        let event = |of, state| Event::State { of, state };
        // Asked during a tick, everybody answers with the state reported for the tick before.
        self.obtain(&key, tick + 1, target, event, |link| {
            link.states.get(&wanted).cloned()
        })
    }

    fn percept(
        &mut self,
        robot: &RobotName,
        epoch: Epoch,
        tick: Tick,
    ) -> Result<Percept, Undelivered> {
        let (key, wanted) = (self.keys.percept(robot), (robot.clone(), (epoch, tick)));
        let event = |of, percept| Event::Percept { of, percept };
        self.obtain(&key, tick, robot, event, |link| {
            link.percepts.get(&wanted).cloned()
        })
    }

    fn send(&mut self, from: &RobotName, to: &RobotName, command: &Command) {
        self.put(&self.keys.command(to, from), command);
        self.sent
            .push_back((from.clone(), to.clone(), command.clone()));
    }

    fn receive(&mut self, to: &RobotName, epoch: Epoch, id: &CommandId) -> Option<Command> {
        let found = self.wait(&id.from, Some(COMMAND_PATIENCE), |link| {
            link.commands.get_mut(to)?.take(id, epoch)
        });
        found.ok()
    }
}

//! The robots' side of the bus: everything that arrives goes through one queue to the robots' loop, and a robot that
//! needs an answer in the middle of its tick keeps that queue moving while it waits.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::{Duration, Instant};

use protocol::bus::{AnswerOf, Bus};
use protocol::keys::{Keys, STATE};
use protocol::messages::{Clock, Command, CommandId, Percept, PublicState, Waiting};
use protocol::{Epoch, Malformed, Message, RobotName, Tick, decode, encode};

use crate::board::Board;
use crate::seat::{Network, Undelivered};

/// Messages that may queue up before the link is slowed down.
pub(crate) const QUEUE: usize = 4096;
/// A command that a clock named is reported missing after this long. Meanwhile the simulator has asked everybody to
/// repeat several times, so only a command that really cannot come gets here.
const COMMAND_PATIENCE: Duration = Duration::from_secs(10);
/// A robot that waits looks this often at what else limits its wait; after one of them it tells whom it waits for.
const LOOK_AGAIN: Duration = Duration::from_millis(250);
/// Between two attempts to ask a robot that does not answer.
const ASK_AGAIN: Duration = Duration::from_millis(200);
/// Commands that are kept for a robot before a clock names them; the oldest make room.
const MAX_COMMANDS: usize = 4096;

/// All that can happen to a process of robots.
pub(crate) enum Event {
    /// A clock arrived.
    Clock(Result<Clock, Malformed>),
    /// A command arrived.
    Command { to: RobotName, from: RobotName, command: Result<Command, Malformed> },
    /// A robot answered a query, or did not.
    State { of: RobotName, asked: Asked, state: Option<PublicState> },
    /// The simulator answered a percept query, or did not.
    Percept { of: RobotName, asked: Asked, percept: Option<Percept> },
    /// The simulator came or went.
    Simulator(bool),
}

/// Epoch and tick of the state that was asked for.
pub(crate) type Asked = (Epoch, Tick);

/// What is known of a state that was asked for.
enum Known {
    Asked,
    Here(Arc<PublicState>),
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
    commands: BTreeMap<RobotName, BTreeMap<CommandId, Command>>,
    /// States of other processes' robots, as asked for.
    states: BTreeMap<(RobotName, Asked), Known>,
    /// Whom the robots asked in this tick, and so will probably ask in the next.
    asked: BTreeSet<RobotName>,
    percepts: BTreeMap<(RobotName, Asked), Percept>,
    /// Commands of the last two ticks, for those who missed them.
    sent: VecDeque<(RobotName, RobotName, Command)>,
    /// Since when the simulator is away.
    pub(crate) simulator_gone: Option<Instant>,
    pub(crate) simulator_seen: bool,
}

impl Link {
    pub(crate) fn new(bus: Bus, keys: Keys) -> Self {
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
            asked: BTreeSet::new(),
            percepts: BTreeMap::new(),
            sent: VecDeque::new(),
            simulator_gone: None,
            simulator_seen: false,
        }
    }

    /// Where callbacks put what arrives.
    pub(crate) fn queue(&self) -> SyncSender<Event> {
        self.queue.clone()
    }

    /// The next clock, or `None` after `patience` without one.
    pub(crate) fn next_clock(&mut self, patience: Duration) -> Option<Clock> {
        let deadline = Instant::now() + patience;
        loop {
            while let Some(clock) = self.clocks.pop_front() {
                // Where the simulator has gone on without us, only its last clock can still be answered; the first clock
                // of an epoch or of an incarnation must be seen all the same.
                let is_first = clock.tick == 0 || clock.news.values().any(|news| news.joined.is_some());
                let is_later = |later: &Clock| (later.epoch, later.tick) > (clock.epoch, clock.tick);
                let is_superseded = self.clocks.iter().any(is_later) && !is_first;
                if clock.end.is_some() || !is_superseded {
                    return Some(clock);
                }
            }
            if !self.pump(deadline.saturating_duration_since(Instant::now())) {
                return None;
            }
        }
    }

    /// A tick begins: what was known for the one before is of no use any more.
    pub(crate) fn begin(&mut self, epoch: Epoch, tick: Tick) {
        if epoch != self.current.0 {
            self.commands.values_mut().for_each(|held| held.retain(|_, command| command.epoch >= epoch));
            self.sent.clear();
        }
        self.current = (epoch, tick);
        self.asked.clear();
        self.states.retain(|(_, asked), _| *asked >= (epoch, tick.saturating_sub(1)));
        self.percepts.clear();
        self.sent.retain(|(_, _, command)| command.tick + 2 > tick);
    }

    /// A tick is done: ask now for what will be asked in the next one. The answer exists as soon as the other robot
    /// has reported, so it travels while the barrier closes and the clock comes back.
    pub(crate) fn ask_ahead(&mut self) {
        for robot in std::mem::take(&mut self.asked) {
            self.ask_state(&robot, self.current);
        }
    }

    /// Sends again what others may have missed.
    pub(crate) fn repeat_commands(&self) {
        for (from, to, command) in &self.sent {
            self.put(&self.keys.command(to, from), command);
        }
    }

    /// Waits for one event and files it. Returns whether there was one.
    fn pump(&mut self, patience: Duration) -> bool {
        let Ok(event) = self.events.recv_timeout(patience) else { return false };
        match event {
            Event::Clock(Ok(clock)) => self.file_clock(clock),
            Event::Command { to, from, command: Ok(command) } => self.file_command(to, from, command),
            Event::Clock(Err(error)) | Event::Command { command: Err(error), .. } => {
                tracing::warn!("{error}");
            }
            Event::State { of, asked, state } => self.file_state(of, asked, state),
            Event::Percept { of, asked, percept } => {
                if let Some(percept) = percept {
                    self.percepts.insert((of, asked), percept);
                }
            }
            Event::Simulator(true) => (self.simulator_gone, self.simulator_seen) = (None, true),
            Event::Simulator(false) => self.simulator_gone = Some(Instant::now()),
        }
        true
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
        let held = self.commands.entry(to).or_default();
        if command.epoch < self.current.0 {
            return;
        }
        if held.len() >= MAX_COMMANDS {
            tracing::warn!(%from, "too many commands are waiting; the oldest is dropped");
            held.pop_first();
        }
        held.insert(CommandId { from, seq: command.seq }, command);
    }

    fn file_state(&mut self, of: RobotName, asked: Asked, state: Option<PublicState>) {
        match state.filter(|state| (state.epoch, state.tick) == asked) {
            Some(state) => self.states.insert((of, asked), Known::Here(Arc::new(state))),
            None => self.states.remove(&(of, asked)),
        };
    }

    /// Whether a clock has arrived that ends the tick under way before it is done: the run is over, the next epoch
    /// begins, or the simulator has gone on without us.
    fn is_interrupted(&self) -> bool {
        self.clocks.iter().any(|clock| (clock.epoch, clock.tick) > self.current || clock.end.is_some())
    }

    fn ask_state(&mut self, of: &RobotName, asked: Asked) {
        let (queue, robot) = (self.queue(), of.clone());
        let file = move |answer: Option<AnswerOf>| {
            let state = read::<PublicState>(answer, &robot);
            // The loop is gone only when the process ends.
            let _ = queue.try_send(Event::State { of: robot, asked, state });
        };
        if self.ask(&self.keys.query(of, STATE), asked.1 + 1, asked.0, file) {
            self.states.entry((of.clone(), asked)).or_insert(Known::Asked);
        }
    }

    fn ask_percept(&mut self, of: &RobotName, asked: Asked) {
        let (queue, robot) = (self.queue(), of.clone());
        let file = move |answer: Option<AnswerOf>| {
            let percept = read::<Percept>(answer, &robot);
            let _ = queue.try_send(Event::Percept { of: robot, asked, percept });
        };
        self.ask(&self.keys.percept(of), asked.1, asked.0, file);
    }

    fn ask(
        &self,
        key: &str,
        tick: Tick,
        epoch: Epoch,
        then: impl FnOnce(Option<AnswerOf>) + Send + 'static,
    ) -> bool {
        let asked = self.bus.ask_then(key, &format!("tick={tick};epoch={epoch}"), then);
        if let Err(error) = &asked {
            tracing::warn!("{error}");
        }
        asked.is_ok()
    }

    pub(crate) fn put<M: Message>(&self, key: &str, message: &M) {
        if let Err(error) = self.bus.put(key, encode(message)) {
            tracing::warn!("{error}");
        }
    }

    /// Keeps the queue moving until `ready` has something, the epoch is over, or `patience` is.
    fn wait<T>(
        &mut self,
        who: Option<&RobotName>,
        patience: Option<Duration>,
        mut ready: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<T, Undelivered> {
        let begun = Instant::now();
        let mut told = false;
        loop {
            if let Some(found) = ready(self) {
                return Ok(found);
            }
            if self.is_interrupted() {
                return Err(Undelivered::Interrupted);
            }
            if patience.is_some_and(|patience| begun.elapsed() > patience) {
                return Err(Undelivered::Lost);
            }
            let has_news = self.pump(LOOK_AGAIN);
            if let (false, false, Some(who)) = (has_news, told, who) {
                told = true;
                self.tell_waiting(who);
            }
        }
    }

    fn tell_waiting(&self, on: &RobotName) {
        let (epoch, tick) = self.current;
        for robot in self.commands.keys() {
            self.put(&self.keys.waiting(robot), &Waiting { epoch, tick, on: on.clone() });
        }
    }

    /// Names the robots of this process, so that their commands have a place.
    pub(crate) fn host(&mut self, robot: &RobotName) {
        self.commands.entry(robot.clone()).or_default();
    }
}

fn read<M: Message>(answer: Option<AnswerOf>, sender: &RobotName) -> Option<M> {
    let answer = answer?;
    let bytes =
        answer.result.map_err(|reason| tracing::debug!(%sender, reason, "a query was refused")).ok()?;
    decode(&answer.key, sender.as_str(), &bytes).map_err(|error| tracing::warn!("{error}")).ok()
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
        self.asked.insert(target.clone());
        let key = (target.clone(), (epoch, tick));
        let mut asked_at: Option<Instant> = None;
        self.wait(Some(target), None, |link| match link.states.get(&key) {
            Some(Known::Here(state)) => Some(state.clone()),
            Some(Known::Asked) => None,
            // Not asked yet, or it did not answer: a query that finds nobody ends at once and without an error.
            None => {
                if asked_at.is_none_or(|at| at.elapsed() >= ASK_AGAIN) {
                    asked_at = Some(Instant::now());
                    link.ask_state(target, (epoch, tick));
                }
                None
            }
        })
    }

    fn percept(&mut self, robot: &RobotName, epoch: Epoch, tick: Tick) -> Result<Percept, Undelivered> {
        let key = (robot.clone(), (epoch, tick));
        let mut asked_at: Option<Instant> = None;
        self.wait(None, None, |link| {
            if let Some(percept) = link.percepts.get(&key) {
                return Some(percept.clone());
            }
            if asked_at.is_none_or(|at| at.elapsed() > Duration::from_secs(1)) {
                asked_at = Some(Instant::now());
                link.ask_percept(robot, (epoch, tick));
            }
            None
        })
    }

    fn send(&mut self, from: &RobotName, to: &RobotName, command: &Command) {
        self.put(&self.keys.command(to, from), command);
        self.sent.push_back((from.clone(), to.clone(), command.clone()));
    }

    fn receive(&mut self, to: &RobotName, epoch: Epoch, id: &CommandId) -> Option<Command> {
        let found = self.wait(Some(&id.from), Some(COMMAND_PATIENCE), |link| {
            let held = link.commands.get_mut(to)?;
            if held.get(id)?.epoch == epoch { held.remove(id) } else { None }
        });
        found.ok()
    }
}

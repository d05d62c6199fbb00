//! A robot's process: what `robot::Host` does with one robot, with simulated time and without threads. The host's thread
//! carries actions out one after the other; what arrives is fed to the participant at once.
//!
//! A robot's tick is one function call that may wait for other robots' states. Here it is called with the states of the
//! record, and then goes through the same queries over the star: the tick ends when all of them are answered, and each answer
//! must be what the robot has been given.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use lockstep::{
    Admission, Begin, IncarnationNotice, Leave, Participant, ParticipantOutput, RobotTimer,
    TickAnswer, Timeouts, Turn,
};
use protocol::messages::{
    CommandText, JoinAnswer, JoinRequest, PublicState, TickUpdate, Waiting, Welcome,
};
use protocol::{Epoch, PROTOCOL_VERSION, RobotName, RunName, Tick, decode, encode};
use robot::{PeerNetwork, Robot, Runner, TickResult, Undelivered};

use crate::hall::make;
use crate::plan::{Flaw, Micros, Point, S};
use crate::star::{Bytes, GetId, Message, Way};
use crate::world::{Event, Made, World};

/// A get without an answer is over after this time.
const GET_TIMEOUT: Micros = 2 * S;
/// How long a robot tries to join, and waits for a simulator that is gone.
pub(crate) const PATIENCE: std::time::Duration = std::time::Duration::from_secs(120);

type RobotParticipant = Participant<TickUpdate, Arc<PublicState>, CommandText, Bytes>;
type RobotAction = ParticipantOutput<TickUpdate, Arc<PublicState>, CommandText, Bytes>;

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Life {
    Alive,
    Hung,
    Dead,
    Left(Leave),
}

/// A tick under way.
struct Running {
    epoch: Epoch,
    tick: Tick,
    done: TickResult,
    /// The states that the robot has been given and that have not arrived yet.
    asked: VecDeque<(RobotName, Arc<PublicState>)>,
    /// What an answer had to be and was not.
    wrong: Option<String>,
    /// Whether the answers are here, and the robot computes.
    is_computing: bool,
    /// Whether it has computed for long enough, in a process that is stopped.
    is_overdue: bool,
}

pub(crate) struct Process {
    pub(crate) name: RobotName,
    pub(crate) life: Life,
    senses_bodies: bool,
    robot: Option<Box<dyn Robot>>,
    runner: Option<Runner>,
    welcome: Option<Welcome>,
    participant: RobotParticipant,
    actions: VecDeque<RobotAction>,
    timers: BTreeMap<RobotTimer, Micros>,
    /// The request to join that the host's thread waits for.
    joining: Option<GetId>,
    running: Option<Running>,
    pub(crate) followed: BTreeSet<RobotName>,
    pub(crate) has_token: bool,
    has_subscribers: bool,
}

/// The other robots, as the record has them.
struct Recorded<'a> {
    facts: &'a BTreeMap<(Epoch, Tick, RobotName), Arc<PublicState>>,
    epoch: Epoch,
    tick: Tick,
    asked: VecDeque<(RobotName, Arc<PublicState>)>,
}

impl PeerNetwork for Recorded<'_> {
    fn state_of(&mut self, target: &RobotName) -> Result<Arc<PublicState>, Undelivered> {
        let before = self.tick - 1;
        let state = self
            .facts
            .get(&(self.epoch, before, target.clone()))
            .ok_or(Undelivered::Interrupted)?;
        if !self.asked.iter().any(|(name, _)| name == target) {
            self.asked.push_back((target.clone(), state.clone()));
        }

        Ok(state.clone())
    }
}

impl Process {
    pub(crate) fn new(name: RobotName, class: &str) -> Self {
        let timeouts = Timeouts {
            join: PATIENCE,
            gone: PATIENCE,
        };
        let robot = make(class);
        let mut actions = Vec::new();
        let participant = Participant::new(timeouts, &mut actions);

        Self {
            name,
            life: Life::Alive,
            senses_bodies: robot.senses_bodies(),
            robot: Some(robot),
            runner: None,
            welcome: None,
            participant,
            actions: actions.into(),
            timers: BTreeMap::new(),
            joining: None,
            running: None,
            followed: BTreeSet::new(),
            has_token: false,
            has_subscribers: false,
        }
    }

    /// Whether the host's thread waits for an answer or computes.
    fn is_busy(&self) -> bool {
        let is_computing = self
            .running
            .as_ref()
            .is_some_and(|running| running.is_computing);

        self.joining.is_some() || is_computing
    }

    fn take_runner(&mut self) {
        let Some(welcome) = self.welcome.take() else {
            return;
        };
        match (&mut self.runner, self.robot.take()) {
            (Some(runner), _) => runner.start_over(welcome),
            (none, Some(robot)) => *none = Some(Runner::new(robot, welcome)),
            (None, None) => unreachable!("a robot that does not run is here"),
        }
    }
}

impl World {
    /// Feeds something to a participant.
    fn feed(
        &mut self,
        process: usize,
        feed: impl FnOnce(&mut RobotParticipant, &mut Vec<RobotAction>),
    ) {
        let mut actions = Vec::new();
        feed(&mut self.processes[process].participant, &mut actions);
        for action in actions {
            self.file(process, action);
        }
    }

    fn file(&mut self, process: usize, action: RobotAction) {
        let ParticipantOutput::SetTimer(timer, after) = action else {
            self.processes[process].actions.push_back(action);
            return;
        };
        let after = after.as_micros() as Micros;
        let due = self.now + after;
        self.processes[process].timers.insert(timer, due);
        self.schedule(after, Event::Wake { process });
    }

    /// Files the timers among the first actions of a new process.
    pub(crate) fn begin(&mut self, process: usize) {
        for action in std::mem::take(&mut self.processes[process].actions) {
            self.file(process, action);
        }
    }

    /// The host's thread goes on as far as it can.
    pub(crate) fn advance(&mut self, process: usize) {
        loop {
            let own = &self.processes[process];
            if own.life != Life::Alive || own.is_busy() {
                return;
            }
            self.fire(process);

            let own = &mut self.processes[process];
            let next = if own.running.is_some() {
                if self.has_all_answers(process) {
                    continue;
                }
                // Meanwhile the host carries out what neither runs a robot nor ends the process.
                let actions = &mut self.processes[process].actions;
                let is_io = |action: &RobotAction| {
                    !matches!(
                        action,
                        ParticipantOutput::Run(_) | ParticipantOutput::Leave(_)
                    )
                };
                let index = actions.iter().position(is_io);
                index.and_then(|index| actions.remove(index))
            } else {
                own.actions.pop_front()
            };
            let Some(action) = next else { return };
            self.carry_out(process, action);
        }
    }

    fn fire(&mut self, process: usize) {
        let now = self.now;
        loop {
            let timers = &mut self.processes[process].timers;
            let due = timers.iter().find(|(_, due)| **due <= now);
            let Some(timer) = due.map(|(timer, _)| *timer) else {
                return;
            };
            timers.remove(&timer);
            self.feed(process, |participant, out| participant.timer(timer, out));
        }
    }

    fn carry_out(&mut self, process: usize, action: RobotAction) {
        match action {
            ParticipantOutput::Join => self.join(process),
            ParticipantOutput::DeclareToken => {
                self.processes[process].has_token = true;
                self.send(process, Way::Up, Message::Token);
            }
            ParticipantOutput::Run(turn) => self.run_tick(process, &turn),
            ParticipantOutput::Put(answer) => self.put(process, &answer),
            ParticipantOutput::Query { of, tick, epoch } => {
                let query = lockstep::StateQuery {
                    tick: Some(tick),
                    epoch: Some(epoch),
                };
                let message = Message::Query {
                    asker: None,
                    of: of.clone(),
                    query,
                };
                self.send(process, Way::Up, message);
                if self.processes[process].followed.insert(of.clone()) {
                    self.send(process, Way::Up, Message::Follow(of));
                }
            }
            ParticipantOutput::Unfollow(of) => {
                self.processes[process].followed.remove(&of);
                self.send(process, Way::Up, Message::Unfollow(of));
            }
            ParticipantOutput::PutWaiting { tick, epoch, on } => {
                let waiting = Waiting { epoch, tick, on };
                self.send(process, Way::Up, Message::Waiting(encode(&waiting).into()));
            }
            ParticipantOutput::SetTimer(..) => unreachable!("timers are filed"),
            ParticipantOutput::Leave(leave) => {
                self.leave_star(process);
                self.processes[process].life = Life::Left(leave);
            }
        }
    }

    /// Asks the simulator to admit the robot, and waits for the answer.
    fn join(&mut self, process: usize) {
        if !self.links[process].is_open_below() {
            self.feed(process, lockstep::Participant::unanswered);
            return;
        }

        let own = &self.processes[process];
        let request = JoinRequest {
            protocol: PROTOCOL_VERSION,
            run: RunName::new("schedule").expect("a legal name"),
            name: own.name.clone(),
            instance: format!("process {process}"),
            bodies: own.senses_bodies,
            ranges: false,
            sdk: "schedules".to_owned(),
        };
        let get = self.next_id();
        self.processes[process].joining = Some(get);
        self.send(
            process,
            Way::Up,
            Message::Join(get, encode(&request).into()),
        );
        self.schedule(GET_TIMEOUT, Event::GetTimeout { process, get });
    }

    /// A get is over without an answer.
    pub(crate) fn time_out(&mut self, process: usize, get: GetId) {
        if self.processes[process].joining == Some(get) {
            self.processes[process].joining = None;
            self.feed(process, lockstep::Participant::unanswered);
        }
        self.advance(process);
    }

    fn run_tick(&mut self, process: usize, turn: &Turn<TickUpdate>) {
        if self.dies(process, turn.epoch, turn.tick, Point::BeforeRun) {
            return;
        }
        let own = &mut self.processes[process];
        if turn.begin != Begin::GoOn {
            own.take_runner();
        }
        let runner = own.runner.as_mut().expect("a robot runs after its welcome");
        let mut network = Recorded {
            facts: &self.facts,
            epoch: turn.epoch,
            tick: turn.tick,
            asked: VecDeque::new(),
        };

        let done = match runner.run(turn, &mut network) {
            Ok(done) => done,
            Err(error) => return self.fail_wrong(format!("a robot fails: {error}")),
        };
        own.running = Some(Running {
            epoch: turn.epoch,
            tick: turn.tick,
            done,
            asked: network.asked,
            wrong: None,
            is_computing: false,
            is_overdue: false,
        });
    }

    /// Goes on with the queries of the tick under way. Returns whether that has changed anything.
    fn has_all_answers(&mut self, process: usize) -> bool {
        loop {
            let own = &mut self.processes[process];
            let Some(running) = &mut own.running else {
                return true;
            };
            let Some((of, given)) = running.asked.pop_front() else {
                running.is_computing = true;
                let after = self.chance.below(self.plan.compute + 1);
                self.schedule(after, Event::Computed { process });
                return true;
            };

            let mut found = None;
            self.feed(process, |participant, out| {
                found = participant.ask(&of, out);
            });
            let own = &mut self.processes[process];
            let is_interrupted = own.participant.is_interrupted();
            let Some(running) = &mut own.running else {
                return true;
            };
            match found {
                Some(state) if state == given => {}
                Some(state) => {
                    let wrong = format!(
                        "{} is told of {of} {state:?} instead of {given:?}",
                        own.name
                    );
                    running.wrong.get_or_insert(wrong);
                }
                None if is_interrupted => running.asked.clear(),
                None => {
                    running.asked.push_front((of, given));
                    return false;
                }
            }
        }
    }

    /// The robot has computed its tick.
    pub(crate) fn computed(&mut self, process: usize) {
        let own = &mut self.processes[process];
        if own.life == Life::Hung {
            if let Some(running) = &mut own.running {
                running.is_overdue = true;
            }
            return;
        }
        let Some(running) = own.running.take_if(|running| running.is_computing) else {
            return;
        };
        if own.life != Life::Alive {
            return;
        }

        let Running {
            epoch,
            tick,
            done,
            wrong,
            ..
        } = running;
        let bytes = encode(done.report.as_ref());
        let made = Made {
            report: done.report.clone(),
            commands: done.commands.clone(),
            wrong,
        };
        let name = own.name.clone();
        self.made.entry((epoch, tick, name)).or_default().push(made);
        if self.dies(process, epoch, tick, Point::AfterRun) {
            return;
        }
        self.feed(process, |participant, out| {
            participant.done(done.commands, done.state, bytes.into(), out);
        });
        self.advance(process);
    }

    /// Puts what came of a tick: commands, state, report.
    fn put(&mut self, process: usize, answer: &TickAnswer<Arc<PublicState>, CommandText, Bytes>) {
        for (_, command) in answer.commands_from(1) {
            let bytes = encode(&command).into();
            self.send(process, Way::Up, Message::Command(bytes));
        }
        if self.dies(process, answer.epoch, answer.tick, Point::AfterCommands) {
            return;
        }
        if self.processes[process].has_subscribers {
            let name = self.processes[process].name.clone();
            let bytes = encode(answer.state.as_ref()).into();
            self.send(process, Way::Up, Message::State(name, bytes));
        }
        if self.dies(process, answer.epoch, answer.tick, Point::AfterState) {
            return;
        }
        self.send(process, Way::Up, Message::Report(answer.report.clone()));
    }

    /// The link is gone: so is the simulator's token, and the answer that the host waits for.
    pub(crate) fn on_disconnected(&mut self, process: usize) {
        let own = &mut self.processes[process];
        own.has_subscribers = false;
        if own.life != Life::Alive {
            return;
        }
        if own.joining.take().is_some() {
            self.feed(process, lockstep::Participant::unanswered);
        }
        self.feed(process, |participant, out| {
            participant.simulator(false, out);
        });
        self.advance(process);
    }

    /// A message arrives at a process.
    pub(crate) fn receive(&mut self, process: usize, message: Message) {
        if self.processes[process].life != Life::Alive {
            return;
        }

        match message {
            Message::News(bytes) => {
                let news: TickUpdate = self.read(&bytes);
                let notice = IncarnationNotice::from(&news);
                self.feed(process, |participant, out| {
                    participant.news(news.epoch, news.tick, notice, news, out);
                });
            }
            Message::Clock(bytes) => self.on_clock(process, &bytes),
            Message::JoinReply(get, bytes) => self.on_answer(process, get, &bytes),
            Message::Query { asker, of, query } => {
                let answer = self.processes[process].participant.query(query);
                let result = match answer {
                    Ok(state) => Ok(encode(state.as_ref()).into()),
                    Err(reason) => Err(reason.to_string()),
                };
                let asker = asker.expect("the router adds it");
                self.send(process, Way::Up, Message::QueryReply { asker, of, result });
            }
            Message::QueryReply {
                of,
                result: Ok(bytes),
                ..
            }
            | Message::State(of, bytes) => {
                let state: PublicState = self.read(&bytes);
                self.feed(process, |participant, _| {
                    participant.heard(of, state.epoch, state.tick, Arc::new(state));
                });
            }
            Message::QueryReply { .. } => {}
            Message::SimulatorToken(is_present) => {
                self.feed(process, |participant, out| {
                    participant.simulator(is_present, out);
                });
            }
            Message::Interest(is_followed) => {
                self.processes[process].has_subscribers = is_followed;
            }
            other => unreachable!("{other:?} is for the router"),
        }
        self.advance(process);
    }

    fn on_clock(&mut self, process: usize, bytes: &[u8]) {
        let clock: protocol::messages::Clock = self.read(bytes);
        let admission = self.processes[process].participant.admission();
        let is_later = admission.is_some_and(|admission| clock.epoch > admission.epoch);
        let is_missed = self.plan.flaw == Flaw::InitAtTickZeroOnly && is_later && clock.tick > 0;
        if !is_missed || clock.end.is_some() {
            self.feed(process, |participant, out| participant.clock(clock, out));
        }
    }

    fn on_answer(&mut self, process: usize, get: GetId, bytes: &[u8]) {
        let own = &mut self.processes[process];
        if own.joining.take_if(|joining| *joining == get).is_none() {
            return;
        }

        match self.read(bytes) {
            JoinAnswer::Welcome(welcome) => {
                let admission = Admission::from(welcome.as_ref());
                let states = welcome.states_before();
                self.processes[process].welcome = Some(*welcome);
                self.feed(process, |participant, out| {
                    participant.admitted(admission, states, out);
                });
            }
            JoinAnswer::Refused { reason, .. } => {
                self.feed(process, |participant, out| participant.refused(reason, out));
            }
        }
    }

    /// A message that the other side has encoded.
    pub(crate) fn read<M: protocol::Message>(&self, bytes: &[u8]) -> M {
        decode("a key", "a sender", bytes)
            .unwrap_or_else(|error| panic!("seed {}: {error}", self.plan.seed))
    }

    /// The process runs again after it was stopped.
    pub(crate) fn resume(&mut self, process: usize) {
        if self.processes[process].life != Life::Hung {
            return;
        }
        self.processes[process].life = Life::Alive;
        self.resume_link(process);
        let running = self.processes[process].running.as_ref();
        if running.is_some_and(|running| running.is_overdue) {
            self.computed(process);
        }
        self.advance(process);
    }

    /// The process dies, at once.
    pub(crate) fn stop_for_good(&mut self, process: usize, is_abrupt: bool) {
        let own = &mut self.processes[process];
        own.life = Life::Dead;
        own.running = None;
        own.joining = None;
        own.actions.clear();
        own.timers.clear();
        self.die(process, is_abrupt);
    }
}

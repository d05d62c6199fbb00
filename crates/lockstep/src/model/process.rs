//! A robot's process, and its link to the router: what [`ParticipantOutput`]s become on the bus, and nothing else.

use std::collections::VecDeque;

use protocol::messages::Clock;
use protocol::{Epoch, Generation, RobotName, Tick};

use super::mutants::{MaybeWrongRobot, Mutant};
use super::simulation::{self, ModelReport, ModelSimulation, ModelUpdate, Order, Violation};
use crate::{
    Admission, Begin, IncarnationNotice, Leave, ParticipantOutput, Refused, RobotTimer, Sent,
    Stamp, Timeouts, Turn,
};

/// From a process to the simulator, in order.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum Up {
    Join,
    /// Its token is declared or undeclared.
    Token(bool),
    Command(Stamp, u32, Sent<Order>),
    Report(Stamp, u32, ModelReport),
}

/// From the simulator to a process, in order.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum Down {
    Answer(Result<Admission, Refused>),
    News(Epoch, Tick, IncarnationNotice, ModelUpdate),
    Clock(Clock),
}

type Actions = Vec<ParticipantOutput<ModelUpdate, (), Order, ModelReport>>;

/// A process of a robot.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct ModelProcess {
    pub(super) name: RobotName,
    pub(super) robot: MaybeWrongRobot,
    pub(super) up: VecDeque<Up>,
    pub(super) down: VecDeque<Down>,
    pub(super) is_alive: bool,
    pub(super) is_connected: bool,
    /// Whether the scenario has stopped it.
    pub(super) is_stopped: bool,
    /// Whether its session has declared its token.
    pub(super) has_token: bool,
    /// Whether the router knows its token.
    pub(super) is_known: bool,
    /// Whether it waits for an answer to its request to join.
    pub(super) is_asking: bool,
    /// Whether the timer for a further request is set.
    pub(super) asks_again: bool,
    /// The tick that it runs.
    pub(super) running: Option<Turn<ModelUpdate>>,
    /// As what it runs, and its first tick as that: all that it knows is from this tick on.
    generation: Generation,
    since: Tick,
    /// Ghost: the tick that it ran last, and as what.
    last_run: Option<(Epoch, Tick)>,
    last_as: Option<(Epoch, Generation)>,
    /// Whether its link is dead and the router has not noticed.
    pub(super) is_unnoticed: bool,
    /// Ghost: whether its link was ever cut.
    pub(super) was_cut: bool,
}

/// What a process needs to know of its surroundings to be checked.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    pub(super) simulation: &'a ModelSimulation,
    /// Whether a tick takes time, so that things happen meanwhile.
    pub(super) is_slow: bool,
    pub(super) mutant: Option<Mutant>,
}

impl ModelProcess {
    /// A process that asks to join.
    pub(super) fn start(name: RobotName, around: Around) -> (Self, Option<Violation>) {
        let timeouts = Timeouts {
            join: std::time::Duration::MAX,
            gone: std::time::Duration::MAX,
        };
        let mut out = Vec::new();
        let robot = MaybeWrongRobot::new(timeouts, around.mutant, &mut out);
        let mut process = Self {
            name,
            robot,
            up: VecDeque::new(),
            down: VecDeque::new(),
            is_alive: true,
            is_connected: true,
            is_stopped: false,
            has_token: false,
            is_known: false,
            is_asking: false,
            asks_again: false,
            running: None,
            generation: 0,
            since: 0,
            last_run: None,
            last_as: None,
            is_unnoticed: false,
            was_cut: false,
        };
        let violation = process.carry_out(out, around);

        (process, violation)
    }

    /// Feeds its participant, and carries out what that wants done.
    pub(super) fn feed(
        &mut self,
        around: Around,
        input: impl FnOnce(&mut MaybeWrongRobot, &mut Actions),
    ) -> Option<Violation> {
        let mut out = Vec::new();
        input(&mut self.robot, &mut out);

        self.carry_out(out, around)
    }

    /// A message arrived.
    pub(super) fn receive(&mut self, message: Down, around: Around) -> Option<Violation> {
        if matches!(message, Down::Answer(_)) && !std::mem::replace(&mut self.is_asking, false) {
            return None;
        }

        self.feed(around, |robot, out| match message {
            Down::Answer(Ok(admission)) => robot.admitted(admission, out),
            Down::Answer(Err(refused)) => robot.refused(refused.into(), out),
            Down::News(epoch, tick, notice, news) => robot.news(epoch, tick, notice, news, out),
            Down::Clock(clock) => robot.clock(clock, out),
        })
    }

    /// It has done its tick.
    pub(super) fn finish(&mut self, around: Around) -> Option<Violation> {
        let turn = self.running.take()?;
        let generation = self.generation;
        let commands = simulation::commands(&self.name, turn.epoch, turn.tick, generation);
        let report = ModelReport {
            epoch: turn.epoch,
            tick: turn.tick,
            generation,
            since: self.since,
            orders: turn.news.map(|news| news.orders).unwrap_or_default(),
        };

        self.feed(around, |robot, out| robot.done(commands, report, out))
    }

    /// The process is no more: what it has sent still arrives, then its token is undeclared.
    pub(super) fn end(&mut self) {
        self.is_alive = false;
        self.is_asking = false;
        self.asks_again = false;
        self.running = None;
        self.down.clear();
        if self.has_token {
            self.send(Up::Token(false));
        }
    }

    /// All that is on its link is lost.
    pub(super) fn clear_link(&mut self) {
        self.was_cut = true;
        self.down.clear();
        self.up.clear();
    }

    /// Its link is back, and its session declares everything again.
    pub(super) fn heal(&mut self) {
        self.is_connected = true;
        if self.has_token {
            self.send(Up::Token(true));
        }
    }

    /// Whether nothing of it remains.
    pub(super) fn is_gone(&self) -> bool {
        !self.is_alive && self.up.is_empty() && !self.is_known
    }

    /// Whether its request to join, or the answer, was lost.
    pub(super) fn is_unanswered(&self) -> bool {
        let is_answer = |message: &Down| matches!(message, Down::Answer(_));

        self.is_asking && !self.up.contains(&Up::Join) && !self.down.iter().any(is_answer)
    }

    fn send(&mut self, message: Up) {
        if self.is_connected {
            self.up.push_back(message);
        }
    }

    fn carry_out(&mut self, out: Actions, around: Around) -> Option<Violation> {
        let mut violation = None;
        for action in out {
            let wrong = match action {
                ParticipantOutput::Join => {
                    self.is_asking = true;
                    self.send(Up::Join);
                    None
                }
                ParticipantOutput::DeclareToken => {
                    self.has_token = true;
                    self.send(Up::Token(true));

                    // A mutant does so on purpose, to see what follows.
                    let is_early = self.robot.admission().is_none()
                        && around.mutant != Some(Mutant::DeclaresTokenEarly);
                    is_early.then_some(Violation::TokenBeforeWelcome)
                }
                ParticipantOutput::Run(turn) => self.run(turn, around),
                ParticipantOutput::Put(answer) => {
                    let stamp = Stamp::from(answer.as_ref());
                    // How many were sent; a mutant may repeat fewer.
                    let count = simulation::commands(&self.name, 0, answer.tick, 0).len();

                    for (number, command) in (1..).zip(answer.commands) {
                        self.send(Up::Command(stamp, number, command));
                    }
                    self.send(Up::Report(stamp, count as u32, answer.report));
                    None
                }
                ParticipantOutput::SetTimer(RobotTimer::Join, _) => {
                    self.asks_again = true;
                    None
                }
                ParticipantOutput::Leave(leave) => {
                    self.end();
                    let is_wrong = leave == Leave::Replaced && !self.was_cut;
                    is_wrong.then_some(Violation::ReplacedConnected)
                }
                _ => None,
            };

            violation = violation.or(wrong);
        }

        violation
    }

    fn run(&mut self, turn: Turn<ModelUpdate>, around: Around) -> Option<Violation> {
        let at = (turn.epoch, turn.tick);
        let is_backwards = self.last_run.is_some_and(|last| at <= last);
        let generation = self.robot.admission().map_or(0, |own| own.generation);
        let is_first = self.last_as != Some((turn.epoch, generation));
        let violation = if is_backwards {
            Some(Violation::RanBackwards)
        } else if !self.has_its_news(&turn, around.simulation) {
            Some(Violation::WrongNews)
        } else if !self.begins_rightly(&turn, is_first, around.simulation) {
            Some(Violation::BeganEarly)
        } else {
            None
        };

        if turn.begin != Begin::GoOn {
            self.generation = generation;
            self.since = turn.tick;
        }
        self.last_run = Some(at);
        self.last_as = Some((turn.epoch, generation));
        self.running = Some(turn);
        if around.is_slow {
            return violation;
        }
        violation.or(self.finish(around))
    }

    fn has_its_news(&self, turn: &Turn<ModelUpdate>, simulation: &ModelSimulation) -> bool {
        let at = (turn.epoch, turn.tick);
        if let Some(news) = &turn.news
            && (news.epoch, news.tick) != at
        {
            return false;
        }
        if at != (simulation.epoch, simulation.tick) || simulation.next.is_some() {
            return true;
        }

        let orders = turn.news.as_ref().map(|news| &news.orders);
        match simulation.news.get(&self.name) {
            Some(expected) => orders == Some(expected),
            None => orders.is_none_or(Vec::is_empty),
        }
    }

    fn begins_rightly(
        &self,
        turn: &Turn<ModelUpdate>,
        is_first: bool,
        simulation: &ModelSimulation,
    ) -> bool {
        let generation = self.robot.admission().map_or(0, |own| own.generation);
        let named = simulation.parts[&self.name].named;

        match turn.begin {
            Begin::Init => is_first && turn.tick == 0,
            Begin::TakeOver => {
                let is_named = named.is_some_and(|(epoch, tick, of)| {
                    epoch == turn.epoch && tick >= turn.tick && of >= generation
                });
                is_first && turn.tick > 0 && (is_named || turn.epoch < simulation.epoch)
            }
            Begin::GoOn => !is_first,
        }
    }
}

//! A tiny simulation beside the barrier: it decides who has news, and knows what each robot must report.

use std::collections::BTreeMap;

use protocol::messages::{FaultKind, Target};
use protocol::{Epoch, Generation, RobotName, Tick};

use crate::exchange::{Membership, Sent, TickOutcome};

/// A command; its content identifies it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Order {
    pub(super) epoch: Epoch,
    pub(super) tick: Tick,
    pub(super) generation: Generation,
    pub(super) number: u32,
}

/// What is new for a robot: the commands that arrive in this tick.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct ModelUpdate {
    pub(super) epoch: Epoch,
    pub(super) tick: Tick,
    pub(super) orders: Vec<Order>,
}

/// What a robot reports: in which tick it ran, and with what news.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct ModelReport {
    pub(super) epoch: Epoch,
    pub(super) tick: Tick,
    pub(super) generation: Generation,
    /// The first tick of the incarnation: its state depends on what came from then on.
    pub(super) since: Tick,
    pub(super) orders: Vec<Order>,
}

/// What must never happen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Violation {
    /// The open tick waits for no robot.
    WaitsForNone,
    /// A tick is complete without a verdict on every robot.
    NoVerdict,
    /// A robot was given up in a tick, and its report counts all the same.
    VerdictChanged,
    /// A report counts that is not what the robot must report in this tick, epoch and incarnation.
    WrongReport,
    /// A report counts that depends on what came before the scenario's hang was over.
    OldState,
    /// The commands of a tick are not those that the robot sent in it.
    WrongCommands,
    /// A robot joined or was lost twice, or reports without taking part.
    WrongMembership,
    /// A process ran a tick twice, or an earlier one after a later one.
    RanBackwards,
    /// A tick was run without its news, or with those of another tick.
    WrongNews,
    /// A process began at a tick from which it does not take part.
    BeganEarly,
    /// The token was declared before the welcome.
    TokenBeforeWelcome,
    /// A process that was connected all the time has been replaced.
    ReplacedConnected,
    /// Two processes of one name are the same incarnation.
    SameIncarnation,
    /// A robot that the scenario has stopped was lost in another tick than the scenario's.
    LostByAccident,
}

/// How many commands A sends in a tick. B sends none.
fn commands_of(robot: &RobotName, tick: Tick) -> u32 {
    match (robot.as_str(), tick % 3) {
        ("A", 0) => 1,
        ("A", 1) => 2,
        _ => 0,
    }
}

/// The commands that this incarnation sends in this tick.
pub(super) fn commands(
    robot: &RobotName,
    epoch: Epoch,
    tick: Tick,
    generation: Generation,
) -> Vec<Sent<Order>> {
    let other = if robot.as_str() == "A" { "B" } else { "A" };

    (1..=commands_of(robot, tick))
        .map(|number| Sent {
            // A's second command goes to all others, which B is.
            to: if number == 2 {
                Target::Others
            } else {
                Target::Robot(super::name(other))
            },
            command: Order {
                epoch,
                tick,
                generation,
                number,
            },
        })
        .collect()
}

/// A fault that the scenario brings upon B.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Ordered {
    pub(super) kind: FaultKind,
    /// First tick of the fault.
    pub(super) from: Tick,
    /// First tick after it.
    pub(super) until: Tick,
}

/// A robot as the simulation knows it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub(super) struct ModelRobot {
    /// The incarnation that takes part, or took part last.
    pub(super) generation: Generation,
    pub(super) takes_part: bool,
    /// Whether the barrier was seen to wait no more for its report of the open tick, without having it.
    pub(super) is_given_up: bool,
    /// The last tick as of which the barrier named an incarnation.
    pub(super) named: Option<(Epoch, Tick, Generation)>,
}

/// The simulation.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct ModelSimulation {
    pub(super) epoch: Epoch,
    pub(super) tick: Tick,
    /// The tick that is to be granted next, when the faults before it are carried out.
    pub(super) next: Option<Tick>,
    pub(super) is_over: bool,
    /// Whether every robot reported in the last complete tick.
    pub(super) is_full: bool,
    /// Whether the deadline of the open tick is over.
    pub(super) is_late: bool,
    /// What arrives in the open tick.
    pub(super) news: BTreeMap<RobotName, Vec<Order>>,
    pub(super) parts: BTreeMap<RobotName, ModelRobot>,
}

impl ModelSimulation {
    pub(super) fn new(roster: &[RobotName]) -> Self {
        Self {
            epoch: 1,
            tick: 0,
            next: None,
            is_over: false,
            is_full: false,
            is_late: false,
            news: BTreeMap::new(),
            parts: roster
                .iter()
                .map(|name| (name.clone(), ModelRobot::default()))
                .collect(),
        }
    }

    /// `init`.
    pub(super) fn begin_epoch(&mut self) {
        self.epoch += 1;
        self.tick = 0;
        self.next = None;
        self.is_late = false;
        self.news.clear();
    }

    /// A tick is granted.
    pub(super) fn open(&mut self, tick: Tick) {
        self.tick = tick;
        self.next = None;
        self.is_late = false;
        for part in self.parts.values_mut() {
            part.is_given_up = false;
            part.takes_part |= tick == 0;
        }
    }

    /// What must not be about a complete tick. Then it becomes the past: commands turn into news.
    pub(super) fn record(
        &mut self,
        outcome: TickOutcome<ModelReport, Order>,
        is_excused: impl Fn(&RobotName) -> bool,
    ) -> Option<Violation> {
        let mut violation = None;
        for change in &outcome.membership {
            violation = violation.or(self.note(change));
        }
        for (name, part) in &self.parts {
            let report = outcome.reports.get(name);
            let wrong = match report {
                Some((report, sent)) => self.judge(name, part, report, sent),
                None if part.takes_part && !self.is_late && !is_excused(name) => {
                    Some(Violation::NoVerdict)
                }
                None => None,
            };
            violation = violation.or(wrong);
        }

        self.is_full = outcome.reports.len() == self.parts.len();
        self.next = Some(self.tick + 1);
        self.news.clear();
        for (from, (_, sent)) in outcome.reports {
            for Sent { to, command } in sent {
                let is_target = |name: &RobotName| match &to {
                    Target::Robot(robot) => robot == name,
                    Target::Others => *name != from,
                };
                for name in self.parts.keys().filter(|name| is_target(name)) {
                    self.news.entry(name.clone()).or_default().push(command);
                }
            }
        }
        violation
    }

    fn note(&mut self, change: &Membership) -> Option<Violation> {
        let name = match change {
            Membership::Joined(name, _) | Membership::Lost(name) => name,
        };
        let part = self.parts.get_mut(name)?;
        let is_wrong = match change {
            Membership::Joined(_, generation) => {
                let is_known = part.generation >= *generation;
                part.takes_part = true;
                part.generation = *generation;
                is_known
            }
            Membership::Lost(_) => !std::mem::replace(&mut part.takes_part, false),
        };

        is_wrong.then_some(Violation::WrongMembership)
    }

    fn judge(
        &self,
        name: &RobotName,
        part: &ModelRobot,
        report: &ModelReport,
        sent: &[Sent<Order>],
    ) -> Option<Violation> {
        let expected = ModelReport {
            epoch: self.epoch,
            tick: self.tick,
            generation: part.generation,
            since: report.since,
            orders: self.news.get(name).cloned().unwrap_or_default(),
        };
        let commands = commands(name, self.epoch, self.tick, part.generation);

        if !part.takes_part {
            Some(Violation::WrongMembership)
        } else if part.is_given_up {
            Some(Violation::VerdictChanged)
        } else if *report != expected {
            Some(Violation::WrongReport)
        } else if sent != commands {
            Some(Violation::WrongCommands)
        } else {
            None
        }
    }
}

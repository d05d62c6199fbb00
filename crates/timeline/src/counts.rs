//! How often things happened to each robot and on each link.

use std::collections::BTreeMap;

use protocol::event::Cause;
use protocol::{Event, RobotName, Tick};
use serde::{Deserialize, Serialize};

use crate::span::{Span, StateKind};

/// Counts of the events of a run. Memory is bounded by the names of robots, states and the texts of commands.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Counts {
    /// Counts of robots, and of others that sent commands or were to receive them: the operator, and robots that do not exist.
    pub robots: BTreeMap<RobotName, RobotCounts>,
    /// Counts of commands, by sender and target.
    pub links: BTreeMap<(RobotName, RobotName), LinkCounts>,
    /// How often a guest entered the field, those included that were there at the beginning.
    pub guests_entered: u64,
    /// How often a guest left the field.
    pub guests_left: u64,
}

/// Counts of one robot.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RobotCounts {
    /// Of emotions.
    pub emotions: StateCounts,
    /// Of behaviors.
    pub behaviors: StateCounts,
    /// Moves that were refused.
    pub blocked: u64,
    /// Commands that it sent, by text.
    pub sent: BTreeMap<String, u64>,
    /// Commands that it received.
    pub received: u64,
    /// Commands to it that were lost.
    pub dropped: u64,
    /// Ticks that it missed.
    pub missed: u64,
    /// Incarnations after the first.
    pub returns: u64,
}

/// Counts of one robot's states of one kind.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct StateCounts {
    /// How often each state was entered, the first one included.
    pub entered: BTreeMap<String, u64>,
    /// How often one state followed another.
    pub transitions: BTreeMap<(String, String), u64>,
    /// Ticks in each state; one that began in the last tick of the run is left out.
    pub ticks: BTreeMap<String, Tick>,
}

/// Counts of the commands from one robot to another.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LinkCounts {
    /// Commands that were sent.
    pub sent: u64,
    /// Copies of commands that arrived: a doubled command arrives twice.
    pub delivered: u64,
    /// Copies of commands that were lost, by cause.
    pub dropped: BTreeMap<Cause, u64>,
    /// Commands that were delayed.
    pub delayed: u64,
    /// Commands that were doubled.
    pub duplicated: u64,
}

impl Counts {
    /// Counts an event.
    pub fn add(&mut self, event: &Event) {
        match event {
            Event::Joined {
                robot, generation, ..
            } => self.robot(robot).returns += u64::from(generation.is_some()),
            Event::Missed { robot } => self.robot(robot).missed += 1,
            Event::Blocked { robot, .. } => self.robot(robot).blocked += 1,
            Event::Emotion { robot, from, to } => {
                self.robot(robot).emotions.enter(from.as_deref(), to);
            }
            Event::Behavior { robot, from, to } => {
                self.robot(robot).behaviors.enter(from.as_deref(), to);
            }
            Event::CommandSent {
                from, to, command, ..
            } => {
                increment(&mut self.robot(from).sent, command.clone());
                self.link(from, to).sent += 1;
            }
            Event::CommandDelivered { from, to, .. } => {
                self.robot(to).received += 1;
                self.link(from, to).delivered += 1;
            }
            Event::CommandDropped {
                from, to, because, ..
            } => {
                self.robot(to).dropped += 1;
                increment(&mut self.link(from, to).dropped, *because);
            }
            Event::CommandDelayed { from, to, .. } => self.link(from, to).delayed += 1,
            Event::CommandDuplicated { from, to, .. } => self.link(from, to).duplicated += 1,
            Event::GuestEntered { .. } => self.guests_entered += 1,
            Event::GuestLeft { .. } => self.guests_left += 1,
            Event::Init { .. }
            | Event::Lost { .. }
            | Event::DoneLate { .. }
            | Event::QueryLost { .. }
            | Event::LinkCut { .. }
            | Event::LinkHealed { .. }
            | Event::Fault { .. }
            | Event::Changed { .. }
            | Event::Say { .. }
            | Event::Guest { .. }
            | Event::SiteChanged { .. }
            | Event::SiteRefused { .. }
            | Event::LayerChanged { .. }
            | Event::LayerRefused { .. }
            | Event::Warned { .. }
            | Event::Judged { .. }
            | Event::Tick { .. }
            | Event::End { .. } => {}
        }
    }

    /// Adds the time in a state, if the span is one. One in progress is counted up to the tick `now`.
    pub fn add_span(&mut self, span: &Span, now: Tick) {
        let Span::Stay(stay) = span else {
            return;
        };
        let ticks = stay.period.ticks(now);
        if ticks > 0 {
            let robot = self.robot(&stay.robot);
            let states = match stay.kind {
                StateKind::Emotion => &mut robot.emotions,
                StateKind::Behavior => &mut robot.behaviors,
            };
            *states.ticks.entry(stay.name.clone()).or_default() += ticks;
        }
    }

    fn robot(&mut self, name: &RobotName) -> &mut RobotCounts {
        self.robots.entry(name.clone()).or_default()
    }

    fn link(&mut self, from: &RobotName, to: &RobotName) -> &mut LinkCounts {
        self.links.entry((from.clone(), to.clone())).or_default()
    }
}

impl RobotCounts {
    /// The counts of its states of a kind.
    #[must_use]
    pub fn states(&self, kind: StateKind) -> &StateCounts {
        match kind {
            StateKind::Emotion => &self.emotions,
            StateKind::Behavior => &self.behaviors,
        }
    }
}

impl StateCounts {
    fn enter(&mut self, from: Option<&str>, to: &str) {
        // An empty name is no state.
        if to.is_empty() {
            return;
        }
        increment(&mut self.entered, to.to_owned());
        if let Some(from) = from.filter(|from| !from.is_empty()) {
            increment(&mut self.transitions, (from.to_owned(), to.to_owned()));
        }
    }
}

impl LinkCounts {
    /// Adds the counts of another link or run.
    pub fn add(&mut self, other: &Self) {
        self.sent += other.sent;
        self.delivered += other.delivered;
        self.delayed += other.delayed;
        self.duplicated += other.duplicated;
        for (cause, count) in &other.dropped {
            *self.dropped.entry(*cause).or_default() += count;
        }
    }

    /// Copies of commands that were lost.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.dropped.values().sum()
    }
}

fn increment<K: Ord>(counts: &mut BTreeMap<K, u64>, key: K) {
    *counts.entry(key).or_default() += 1;
}

//! All that came from the robot, in the order in which it came.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

use bus::{Qos, Reply};
use protocol::keys::{Keys, STATE};
use protocol::messages::{Command, JoinRequest, PublicState, Waiting};
use protocol::{Tick, decode};

use crate::reading::{self, Reading};

/// A report that came.
pub struct ReceivedReport {
    /// The report, and what is noticed about its numbers.
    pub reading: Reading,
    /// The message as it came.
    pub bytes: Vec<u8>,
    /// When it came, wall clock.
    pub at: Instant,
    /// Its place among all that came.
    pub order: usize,
}

/// A command of the robot that came.
#[derive(Debug, Clone)]
pub struct ReportedCommand {
    /// Its target.
    pub to: String,
    /// The sender that its key names.
    pub from: String,
    /// The command, or why it cannot be read.
    pub command: Result<Command, String>,
    /// The message as it came.
    pub bytes: Vec<u8>,
    /// Its place among all that came.
    pub order: usize,
}

impl ReportedCommand {
    /// Its number in its tick, if it can be read.
    pub fn number(&self) -> Option<u32> {
        self.command.as_ref().ok().map(|command| command.number)
    }

    /// The tick that it is of, if it can be read.
    pub fn tick(&self) -> Option<Tick> {
        self.command.as_ref().ok().map(|command| command.tick)
    }
}

/// All that came from the robot so far.
#[derive(Default)]
pub struct Seen {
    /// Reports.
    pub answers: Vec<ReceivedReport>,
    /// Reports that cannot be read, and why.
    pub unreadable: Vec<String>,
    /// Commands.
    pub commands: Vec<ReportedCommand>,
    /// Integers of commands that are written with a fraction.
    pub not_integers: Vec<String>,
    /// States that it put, with their place among all that came.
    pub states: Vec<(usize, Result<PublicState, String>)>,
    /// Requests to join.
    pub requests: Vec<Result<JoinRequest, String>>,
    /// How often a token was undeclared.
    pub tokens_lost: usize,
    /// Replies to the kit's queries, by their numbers, with their place among all that came.
    pub replies: BTreeMap<usize, (usize, Option<Reply>)>,
    /// Messages that were put in a way that may lose or reorder them.
    pub wrong_qos: Vec<String>,
    /// Keys of others on which it put something.
    pub foreign: Vec<String>,
    /// What it put on `waiting`.
    pub waiting: Vec<Waiting>,
    /// How many messages, tokens and replies came: the place of the next one.
    pub count: usize,
    /// Robots whose liveliness tokens are declared.
    present: BTreeSet<String>,
}

impl Seen {
    /// The place of what came just now.
    pub fn next_order(&mut self) -> usize {
        let order = self.count;
        self.count += 1;
        order
    }

    /// Forgets all that came, but not which tokens are declared, nor the place of what comes next.
    pub fn forget(&mut self) {
        *self = Self {
            count: self.count,
            present: std::mem::take(&mut self.present),
            ..Self::default()
        };
    }

    /// Whether a robot's token is declared.
    pub fn is_present(&self, robot: &str) -> bool {
        self.present.contains(robot)
    }

    /// Files that a token was declared or undeclared.
    pub fn file_token(&mut self, robot: &str, is_present: bool) {
        if is_present {
            self.present.insert(robot.to_owned());
        } else {
            self.present.remove(robot);
            self.tokens_lost += 1;
        }
    }

    /// Files a report, and returns its place in [`Seen::answers`]; `None` if it cannot be read.
    pub fn file_report(
        &mut self,
        key: &str,
        bytes: Vec<u8>,
        at: Instant,
        order: usize,
    ) -> Option<usize> {
        let robot = Keys::robot_of(key).unwrap_or_default();
        let reading = match reading::read(key, robot, &bytes) {
            Ok(reading) => reading,
            Err(error) => {
                self.unreadable.push(error.to_string());
                return None;
            }
        };

        let index = self.answers.len();
        self.answers.push(ReceivedReport {
            reading,
            bytes,
            at,
            order,
        });
        Some(index)
    }

    /// Files a command of the robot.
    pub fn file_command(&mut self, key: &str, bytes: Vec<u8>, order: usize) -> ReportedCommand {
        let robot = Keys::robot_of(key).unwrap_or_default();
        let sender = Keys::command_sender(key).unwrap_or(robot).to_owned();
        let command = match reading::read_command(key, &sender, &bytes) {
            Ok((command, not_integers)) => {
                self.not_integers.extend(not_integers);
                Ok(command)
            }
            Err(error) => Err(error.to_string()),
        };

        let to = match (Keys::command_sender(key), &command) {
            (Some(_), _) => robot.to_owned(),
            (None, Ok(Command { to: Some(to), .. })) => to.to_string(),
            (None, _) => String::new(),
        };
        let sent = ReportedCommand {
            to,
            from: sender,
            command,
            bytes,
            order,
        };
        self.commands.push(sent.clone());
        sent
    }

    /// Files a state that the robot put.
    pub fn file_state(&mut self, bytes: &[u8], order: usize) {
        let state = decode(STATE, "the robot", bytes).map_err(|error| error.to_string());
        self.states.push((order, state));
    }

    /// Notes a message that was put in another way than ticks need.
    pub fn note_qos(&mut self, what: &str, qos: Qos) {
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

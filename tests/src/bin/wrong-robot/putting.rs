//! What the robot puts: commands, states, reports.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::time::Duration;

use bus::Qos;
use lockstep::TickAnswer;
use protocol::encode;
use protocol::keys::STATE;
use protocol::messages::{CommandText, PublicState, Report, Target, TickUpdate};

use crate::host::{Failure, Host};

/// More declarations than a robot has: a token of its own for each tick is bounded.
const MANY_DECLARED: usize = 20;

impl Host {
    /// Puts the results of a tick: the commands, the state, the report.
    pub(crate) fn put(
        &mut self,
        answer: &TickAnswer<PublicState, CommandText, Report>,
    ) -> Result<(), Failure> {
        let at = (answer.epoch, answer.tick);
        let is_again = self.last == Some(at);
        self.last = Some(at);
        self.shared.has_reported.store(true, Ordering::SeqCst);

        let mut report = answer.report.clone();
        if is_again && self.wrong.is("clock.duplicate") {
            (_, _, report) = self.act(answer.epoch, answer.tick, &TickUpdate::default())?;
            report.commands = answer.report.commands;
        }
        if is_again && self.wrong.is("clock.duplicate:bytes") {
            report.log.push("again".to_owned());
        }

        let is_late = self.wrong.is("command.sent:late")
            || is_again && self.wrong.is("clock.duplicate:order");
        let forgets_commands = is_again && self.wrong.is("clock.duplicate:commands");
        if !is_late && !forgets_commands {
            self.put_commands(answer)?;
        }

        let is_state_late = self.wrong.is("tick.state-first");
        if !is_state_late {
            self.put_state(&answer.state)?;
        }
        self.put_on_others_keys()?;
        self.put_report(&report)?;
        if self.wrong.is("tick.answer") {
            self.put_report(&report)?;
        }

        if is_late {
            std::thread::sleep(Duration::from_millis(20));
            self.put_commands(answer)?;
        }
        if is_state_late {
            std::thread::sleep(Duration::from_millis(30));
            self.put_state(&answer.state)?;
        }
        Ok(())
    }

    /// Puts something that is not its to put.
    fn put_on_others_keys(&mut self) -> Result<(), Failure> {
        let mut roster = self.welcome.iter().flat_map(|welcome| &welcome.roster);
        let other = roster.find(|name| **name != self.name);
        if let Some(other) = other {
            for (way, key) in [
                ("wire.keys", self.keys.log()),
                ("wire.keys:news", self.keys.news(other)),
                ("wire.keys:report", self.keys.report(other)),
                ("wire.keys:state", self.keys.query(other, STATE)),
            ] {
                if self.wrong.is(way) {
                    self.bus.put(&key, b"{}".to_vec())?;
                }
            }
        }
        for (way, key) in [
            ("wire.keys:viewer", self.keys.alive_viewer()),
            ("wire.keys:simulator", self.keys.alive_sim()),
        ] {
            if self.wrong.is(way) && self.declared.len() < MANY_DECLARED {
                self.declared.push(self.bus.token(&key)?);
            }
        }
        Ok(())
    }

    fn put_commands(
        &mut self,
        answer: &TickAnswer<PublicState, CommandText, Report>,
    ) -> Result<(), Failure> {
        let mut first = 1;
        if self.wrong.is("command.sent:numbers") {
            first = 2;
        }
        if self.wrong.is("epoch.init:numbers") && answer.epoch > 1 {
            first = self.numbered + 1;
        }

        let mut numbers: BTreeMap<String, u32> = BTreeMap::new();
        for (to, mut command) in answer.commands_from(first) {
            // If the report has a wrong generation, so do its commands.
            command.generation = answer.report.generation;
            if self.wrong.is("command.sent:generation") {
                command.generation = 1;
            }
            if self.wrong.is("command.sent:targets") {
                let number = numbers.entry(to.to_string()).or_insert(0);
                *number += 1;
                command.number = *number;
            }
            let mut bytes = encode(&command);
            if self.wrong.is("number.integers:command") {
                bytes = with_fraction(&bytes, "number");
            }
            // As robots do that do not know of outboxes.
            let Target::Robot(to) = to else {
                continue;
            };
            let key = self.keys.command(to, &self.name);
            self.put_on(&key, bytes, self.wrong.is("wire.qos:command"))?;

            if answer.epoch == 1 {
                self.numbered = command.number;
            }
        }
        Ok(())
    }

    fn put_state(&self, state: &PublicState) -> Result<(), Failure> {
        let is_silent = self.wrong.is("tick.state-first:unsubscribed")
            || self.last_clock.panels && self.wrong.is("tick.state-first:panels");
        if self.states.has_subscribers() && !is_silent {
            let key = self.keys.query(&self.name, STATE);
            self.put_on(&key, encode(state), self.wrong.is("wire.qos:state"))?;
        }
        Ok(())
    }

    fn put_report(&self, report: &Report) -> Result<(), Failure> {
        let mut bytes = encode(report);
        if self.wrong.is("number.integers") {
            bytes = with_fraction(&bytes, "tick");
        }
        let key = self.keys.report(&self.name);
        self.put_on(&key, bytes, self.wrong.is("wire.qos"))
    }

    /// Puts a message with the quality of service that the rules require, or with a wrong one.
    fn put_on(&self, key: &str, bytes: Vec<u8>, drops: bool) -> Result<(), Failure> {
        let qos = Qos {
            is_blocking: !drops,
            is_express: self.wrong.is("wire.qos:express"),
            ..Qos::IN_ORDER
        };
        self.bus.put_with_qos(key, bytes, qos)?;
        Ok(())
    }
}

/// The same message with a fraction in an integer.
fn with_fraction(bytes: &[u8], field: &str) -> Vec<u8> {
    let Ok(mut value) = serde_json::from_slice::<serde_json::Value>(bytes) else {
        return bytes.to_vec();
    };
    value[field] = value[field].as_f64().into();
    value.to_string().into_bytes()
}

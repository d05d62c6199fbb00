//! What robots send, and how it reaches the barrier.

use std::sync::Arc;

use lockstep::{Sent, Stamp};
use protocol::RobotName;
use protocol::messages::{Command, Panel, Report, Waiting};

use super::event::{Event, Interrupt};
use super::frontend::{Frontend, refuse};
use super::live::LiveRun;

/// Most commands of the operator that wait for the next tick.
const MAX_OPERATOR_COMMANDS: usize = 1024;

impl LiveRun {
    /// One event. The arms call; they do not decide.
    pub(super) fn on_event(
        &mut self,
        event: Event,
        frontend: &mut Frontend,
    ) -> Result<(), Interrupt> {
        match event {
            Event::Report { robot, report } => self.on_report(&robot, report),
            Event::Command { from, to, command } => self.on_command(&from, &to, command),
            Event::Waiting { robot, waiting } => self.on_waiting(&robot, &waiting),
            Event::Panel { robot, panel } => self.on_panel(&robot, panel),
            Event::Malformed(error) => self.ignore("malformed", &error.to_string()),
            Event::Join(query) => self.on_join(&query, frontend),
            Event::Token { robot, is_present } => self.on_token(&robot, is_present),
            Event::Viewer { is_present } => self.viewers.note(is_present),
            Event::Offered {
                query,
                control,
                refusal: None,
            } => self.on_accepted(query, &control, frontend)?,
            Event::Offered {
                query,
                refusal: Some(reason),
                ..
            } => refuse(&query, &reason),
            Event::Control(_) | Event::Terminate | Event::State(..) => {
                unreachable!("the same for all sources, or of a recording")
            }
        }

        Ok(())
    }

    /// Counts a message that changes nothing, and logs it once in a while.
    pub(super) fn ignore(&mut self, reason: &str, text: &str) {
        let ignored = &mut self.epoch.wall.ignored;
        let count = ignored.entry(reason.to_owned()).or_default();
        *count += 1;
        if count.is_power_of_two() {
            tracing::warn!(count = *count, "ignored a message, {reason}: {text}");
        }
    }

    /// The name of a robot of the roster, or `None` after having counted the message.
    fn known(&mut self, robot: &str) -> Option<RobotName> {
        let name = RobotName::new(robot)
            .ok()
            .filter(|name| self.barrier.has(name));
        if name.is_none() {
            self.ignore("unknown robot", robot);
        }

        name
    }

    fn on_report(&mut self, robot: &str, report: Report) {
        let Some(name) = self.known(robot) else {
            return;
        };
        let epoch = &mut self.epoch;
        epoch.record.observe_report(&name, report.tick);
        let stamp = Stamp::from(&report);
        let is_of_epoch = stamp.epoch == epoch.simulation.epoch();
        if is_of_epoch && self.barrier.is_behind(&name, stamp.generation) {
            epoch.simulation.done_late(&name, stamp.tick);
        }
        let commands = report.commands;
        self.barrier
            .report(&name, stamp, commands, Arc::new(report), &mut self.outputs);
    }

    fn on_panel(&mut self, robot: &str, panel: Panel) {
        if let Some(name) = self.known(robot) {
            self.epoch.record.observe_panel(name, panel);
        }
    }

    fn on_command(&mut self, from: &str, to: &str, command: Command) {
        // Any name will do as a target: the medium drops what goes to robots that do not exist.
        let Ok(to) = RobotName::new(to) else {
            return self.ignore("unknown robot", to);
        };
        if from == RobotName::operator().as_str() {
            return self.on_operator(to, command.command);
        }
        let Some(from) = self.known(from) else { return };

        let stamp = Stamp::from(&command);
        let number = command.number;
        let sent = Sent::new(to, command);
        self.barrier
            .command(&from, stamp, number, sent, &mut self.outputs);
    }

    fn on_operator(&mut self, to: RobotName, command: String) {
        if !self.barrier.has(&to) {
            return self.ignore("unknown robot", to.as_str());
        }
        if self.epoch.operator.len() >= MAX_OPERATOR_COMMANDS {
            return self.ignore("too many commands", "of the operator for one tick");
        }

        self.epoch.operator.push((to, command));
    }

    fn on_waiting(&mut self, robot: &str, waiting: &Waiting) {
        let Some(name) = self.known(robot) else {
            return;
        };

        self.barrier.waiting(
            &name,
            waiting.epoch,
            waiting.tick,
            &waiting.on,
            &mut self.outputs,
        );
    }

    fn on_token(&mut self, robot: &str, is_present: bool) {
        let Some(name) = self.known(robot) else {
            return;
        };

        if is_present {
            self.departed.forget(&name);
        }
        self.barrier.token(&name, is_present, &mut self.outputs);
    }
}

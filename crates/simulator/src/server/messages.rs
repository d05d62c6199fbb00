//! What robots send, and how it reaches the barrier.

use std::sync::Arc;

use lockstep::{Sent, Stamp};
use protocol::RobotName;
use protocol::messages::{Command, CommandText, Panel, Report, Target, TickPanel, Waiting};

use super::live::{LiveEpoch, LiveRun};

/// Most commands of the operator that wait for the next tick.
const MAX_OPERATOR_COMMANDS: usize = 1024;

impl LiveRun {
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

    pub(super) fn on_report(&mut self, robot: &str, report: Report) {
        let Some(name) = self.known(robot) else {
            return;
        };
        let stamp = Stamp::from(&report);
        if self.is_repeated(&name, stamp) {
            return;
        }
        // Observed first: the barrier may complete the tick with it.
        let epoch = &mut self.epoch;
        if let Some(observed) = epoch.record.observed() {
            observed.report(&name, report.tick);
        }

        // An answer that does not count is noted as well: the robot's state depends on the ticks that
        // it has done.
        let is_of_epoch = stamp.epoch == epoch.simulation.epoch();
        if is_of_epoch && self.barrier.is_behind(&name, stamp.generation) {
            epoch.simulation.done_late(&name, stamp.tick);
        }

        let commands = report.commands;
        self.barrier
            .report(&name, stamp, commands, Arc::new(report), &mut self.outputs);
    }

    /// Whether an answer is put again that has counted, because the clock was put again.
    fn is_repeated(&self, robot: &RobotName, stamp: Stamp) -> bool {
        let LiveEpoch {
            simulation,
            asked_again,
            ..
        } = &self.epoch;
        stamp.epoch == simulation.epoch()
            && Some(stamp.tick) == *asked_again
            && simulation.report(robot).is_some_and(|report| {
                (report.tick, report.generation) == (stamp.tick, stamp.generation)
            })
    }

    pub(super) fn on_panel(&mut self, robot: &str, panel: TickPanel) {
        // Of the tick in progress only: what comes after it is complete is seen by observers, and not recorded.
        if !self.barrier.is_open_at(panel.epoch, panel.tick) {
            return;
        }
        if let Some(name) = self.known(robot)
            && let Some(observed) = self.epoch.record.observed()
        {
            let TickPanel { widgets, .. } = panel;
            observed.panels.insert(name, Panel { widgets });
        }
    }

    pub(super) fn on_command(&mut self, from: &str, to: Option<Target>, command: Command) {
        // Any name will do as a target: the medium drops what goes to robots that do not exist.
        let Some(to) = to else {
            return self.ignore("unknown robot", "the target of a command");
        };
        if from == RobotName::operator().as_str() {
            return self.on_operator(Sent::new(to, command));
        }
        let Some(from) = self.known(from) else { return };

        let stamp = Stamp::from(&command);
        if self.is_repeated(&from, stamp) {
            return;
        }
        let number = command.number;
        let sent = Sent::new(to, command);
        self.barrier
            .command(&from, stamp, number, sent, &mut self.outputs);
    }

    fn on_operator(&mut self, command: Sent<CommandText>) {
        if let Target::Robot(to) = &command.to
            && !self.barrier.has(to)
        {
            return self.ignore("unknown robot", to.as_str());
        }
        if self.epoch.operator.len() >= MAX_OPERATOR_COMMANDS {
            return self.ignore("too many commands", "of the operator for one tick");
        }

        self.epoch.operator.push(command);
    }

    pub(super) fn on_waiting(&mut self, robot: &str, waiting: &Waiting) {
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

    pub(super) fn on_token(&mut self, robot: &str, is_present: bool) {
        let Some(name) = self.known(robot) else {
            return;
        };

        if is_present {
            self.departed.forget(&name);
        }
        self.barrier.token(&name, is_present, &mut self.outputs);
    }
}

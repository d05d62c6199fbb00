//! The second half of a tick: who takes part, what has arrived, and what each robot reported, as events in a fixed order.

use std::sync::Arc;

use lockstep::{Membership, Sent};
use protocol::event::Cause;
use protocol::messages::{CommandText, Report, Target};
use protocol::{Event, Generation, RobotName, Tick};

use crate::digest::TickDigest;
use crate::medium::{Arrival, SentCommand};
use crate::sites::SiteOrders;

use super::{NamedReport, ReportsByName, Simulation};

impl Simulation {
    pub(super) fn note_reports(&mut self, mut reports: ReportsByName, digest: &mut TickDigest) {
        self.silent.clear();

        // In the order of names, not in that of arrival.
        for name in self.names.clone() {
            if let Some((report, commands)) = reports.remove(&name) {
                let sent = self.number_commands(&name, commands);
                digest.report(&name, Some((&report, &sent)));
                self.note_done_late(&name);
                self.note_report(&name, &report, sent);
            } else {
                // That it has missed the tick is part of what the run is compared by.
                digest.report(&name, None);
                self.silent.push(name.clone());
                self.events.push(Event::Missed { robot: name });
            }
        }
    }

    /// Carries out what robots do to sites by their reports of the tick.
    pub(super) fn act_on_sites(&mut self, reports: &[NamedReport], digest: &mut TickDigest) {
        let mut orders = Vec::new();
        for (robot, report) in reports {
            if !report.site_actions.is_empty() {
                orders.push(SiteOrders {
                    robot,
                    at: self.location(robot).unwrap_or_default(),
                    actions: &report.site_actions,
                });
            }
        }

        let events = self.sites.carry_out(&orders);
        digest.sites(&events);
        self.events.extend(events);
    }

    /// Carries out what robots do to layers by their reports of the tick.
    pub(super) fn act_on_layers(&mut self, reports: &[NamedReport], digest: &mut TickDigest) {
        self.layers.begin_actions();
        // They are in the order of names.
        for (robot, report) in reports {
            if report.layer_actions.is_empty() {
                continue;
            }
            let at = self.location(robot).unwrap_or_default();
            let events = self.layers.carry_out(robot, at, &report.layer_actions);
            digest.layer_actions(&events);
            self.events.extend(events);
        }
        for (name, cells) in self.layers.digests() {
            digest.layer(name, cells);
        }
    }

    /// A robot has done a tick of which its report does not count, because the clock goes on without it.
    pub fn done_late(&mut self, robot: &RobotName, tick: Tick) {
        // A repetition of a report that has counted is not late.
        if tick <= self.now && self.has_not_reported_since(robot, tick) {
            self.late.entry(robot.clone()).or_default().insert(tick);
        }
    }

    /// Whether the last report of a robot is of an earlier tick.
    fn has_not_reported_since(&self, robot: &RobotName, tick: Tick) -> bool {
        let last = self.reports.get(robot);
        last.is_none_or(|report| report.tick < tick)
    }

    /// Records what a robot that takes part again has done of the ticks that it missed: its state depends on them.
    fn note_done_late(&mut self, robot: &RobotName) {
        let mut ticks = self.late.remove(robot).unwrap_or_default();
        // The report of the open tick is in time.
        ticks.remove(&self.now);
        if !ticks.is_empty() {
            self.events.push(Event::DoneLate {
                robot: robot.clone(),
                ticks: ticks.into_iter().collect(),
            });
        }
    }

    pub(super) fn note_membership(&mut self, membership: Vec<Membership>) {
        self.newcomers.clear();

        for change in membership {
            match change {
                Membership::Joined(robot, generation) => self.note_joined(robot, generation),
                Membership::Lost(robot) => self.events.push(Event::Lost { robot }),
            }
        }
    }

    fn note_joined(&mut self, robot: RobotName, generation: Generation) {
        let incarnation = self.incarnation(&robot, generation, None);
        // What a predecessor did is of no consequence.
        if let Some(ticks) = self.late.get_mut(&robot) {
            *ticks = ticks.split_off(&self.now);
        }
        // At tick 0 every incarnation publishes the same state.
        if self.now > 0 {
            self.newcomers.push(robot.clone());
        }

        self.events.push(Event::Joined {
            at: self.location(&robot).unwrap_or_default(),
            robot,
            generation: Some(incarnation),
        });
    }

    /// The incarnation in this epoch that a generation has if it takes part next. `open` is what the robot has reported for the
    /// open tick, perhaps by an incarnation that takes part from that tick on.
    pub(super) fn incarnation(
        &self,
        robot: &RobotName,
        generation: Generation,
        open: Option<&Report>,
    ) -> u32 {
        let mut last = self.incarnations.get(robot).copied();
        if let Some(report) = open {
            last = Some(follow(last, report.generation));
        }

        follow(last, generation).1
    }

    /// Records the commands that arrived in the tick. Those to a robot that did not take part are lost.
    pub(super) fn note_deliveries(&mut self, reports: &ReportsByName) {
        for (target, arrivals) in std::mem::take(&mut self.arriving) {
            let has_arrived = reports.contains_key(&target);

            for Arrival { seq, delivery } in arrivals {
                let to = target.clone();
                let from = delivery.from;
                self.events.push(if has_arrived {
                    Event::CommandDelivered { from, to, seq }
                } else {
                    Event::CommandDropped {
                        from,
                        to,
                        seq,
                        because: Cause::Missed,
                    }
                });
            }
        }
    }

    /// Numbers the commands of a sender for the record.
    fn number_commands(
        &mut self,
        from: &RobotName,
        commands: Vec<Sent<CommandText>>,
    ) -> Vec<SentCommand> {
        // On the wire the numbers begin with 1 in every tick. Those of the record go on through the
        // epoch, whichever incarnation sends.
        let count = self.sent.entry(from.clone()).or_default();
        let mut numbered = Vec::with_capacity(commands.len());

        let mut number = |to: &RobotName, text: CommandText| {
            *count += 1;
            numbered.push(SentCommand {
                to: to.clone(),
                from: from.clone(),
                seq: *count,
                text,
            });
        };
        for Sent { to, command } in commands {
            match to {
                Target::Robot(to) => number(&to, command),
                // From here on nothing tells a broadcast from one command to each; a payload is shared.
                Target::Others => {
                    for to in self.names.iter().filter(|name| *name != from) {
                        number(to, command.clone());
                    }
                }
            }
        }

        numbered
    }

    fn note_report(&mut self, robot: &RobotName, report: &Arc<Report>, sent: Vec<SentCommand>) {
        let last = self.incarnations.get(robot).copied();
        self.incarnations
            .insert(robot.clone(), follow(last, report.generation));
        let before = self.reports.insert(robot.clone(), report.clone());

        // The record has changes only, and before its first report a robot has no state.
        let emotion_before = before.as_ref().map(|report| report.emotion_state.clone());
        let behavior_before = before.as_ref().map(|report| report.behavior_state.clone());

        if emotion_before.as_ref() != Some(&report.emotion_state) {
            self.events.push(Event::Emotion {
                robot: robot.clone(),
                from: emotion_before,
                to: report.emotion_state.clone(),
            });
        }
        if behavior_before.as_ref() != Some(&report.behavior_state) {
            self.events.push(Event::Behavior {
                robot: robot.clone(),
                from: behavior_before,
                to: report.behavior_state.clone(),
            });
        }
        self.events.extend(SentCommand::events(&sent));
        self.send(sent);
        for text in &report.log {
            self.events.push(Event::Say {
                robot: robot.clone(),
                text: text.clone(),
            });
        }
    }

    /// The medium decides about commands at the beginning of the next tick.
    fn send(&mut self, sent: Vec<SentCommand>) {
        for command in sent {
            self.medium.accept(command);
        }
    }

    /// Sends a command of the operator, which arrives in the next tick.
    pub fn command(&mut self, command: Sent<CommandText>) {
        let sent = self.number_commands(&RobotName::operator(), vec![command]);
        self.between.extend(SentCommand::events(&sent));
        self.send(sent);
    }

    /// The reports for a tick that are wanted, of the robots that have not missed it.
    pub fn reports_of(&self, tick: Tick, wants: impl Fn(&Report) -> bool) -> Vec<NamedReport> {
        let mut reports = Vec::new();
        for (name, report) in &self.reports {
            if report.tick == tick && wants(report) {
                reports.push((name.clone(), report.clone()));
            }
        }
        reports
    }
}

/// The incarnation that `generation` has after the last one.
fn follow(last: Option<(Generation, u32)>, generation: Generation) -> (Generation, u32) {
    let incarnation = match last {
        Some((same, incarnation)) if same == generation => incarnation,
        Some((_, incarnation)) => incarnation + 1,
        None => 1,
    };

    (generation, incarnation)
}

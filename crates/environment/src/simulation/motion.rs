//! How bodies move in a tick: what robots propose, what guests do at their faces, and what was in the way.

use std::sync::Arc;

use protocol::Event;
use protocol::event::Blocker;
use scenario::{to_wire, to_world};
use world::{Body, MoveOutcome, Reaction};

use super::Simulation;

impl Simulation {
    /// The proposed location of each robot; `None` for a robot without a report of the last tick.
    pub(super) fn proposals(&self) -> Vec<Option<world::Point>> {
        let mut proposals = Vec::with_capacity(self.names.len());
        for name in &self.names {
            // What it proposed before counts no more: it stays where it is.
            let is_silent = self.silent.contains(name);
            let report = self.reports.get(name).filter(|_| !is_silent);
            proposals.push(report.map(|report| to_world(report.proposal)));
        }
        proposals
    }

    /// Has the robots with wheels drive as they reported.
    pub(super) fn drive_robots(&mut self) {
        for (index, name) in self.names.iter().enumerate() {
            let is_silent = self.silent.contains(name);
            let report = self.reports.get(name).filter(|_| !is_silent);
            let report = report.map(Arc::as_ref);
            let warning = self.driving.drive(&mut self.world, index, name, report);
            self.events.extend(warning);
        }
    }

    /// What guests do in the tick at the robots' faces, and at those that they asked.
    pub(super) fn reactions(&self) -> Vec<Reaction> {
        let mut reactions = Vec::new();
        if !self.guests.sees_faces() {
            return self.guests.own_reactions(self.now);
        }

        for (index, name) in self.names.iter().enumerate() {
            // Who has not reported shows nothing.
            if let Some(report) = self
                .reports
                .get(name)
                .filter(|_| !self.silent.contains(name))
            {
                reactions.extend(self.guests.reaction(index, report));
            }
        }
        // At the same robot a face counts more.
        reactions.extend(self.guests.own_reactions(self.now));
        reactions
    }

    /// Guests get what they asked for, or wait for it.
    pub(super) fn note_guests(&mut self) {
        let named = self.names.iter().enumerate();
        let reported = named.filter_map(|(index, name)| {
            let report = self
                .reports
                .get(name)
                .filter(|report| report.tick == self.now)?;
            Some((index, name, &**report))
        });
        let changes = self.guests.take(self.now, reported, &self.world);
        self.events.extend(changes);
        for &(guest, robot) in self.guests.served() {
            self.world.satisfy(guest, robot);
        }
    }

    /// Records who has entered the field and who has left it.
    pub(super) fn note_passages(&mut self) {
        for passage in self.world.passages() {
            let guest = u32::try_from(passage.guest).unwrap_or(u32::MAX);
            let at = to_wire(passage.at);
            self.events.push(if passage.enters {
                Event::GuestEntered { guest, at }
            } else {
                Event::GuestLeft { guest, at }
            });
        }
    }

    pub(super) fn note_moves(&mut self, verdicts: &[MoveOutcome]) {
        for (index, verdict) in verdicts.iter().enumerate() {
            let by = self.blocker(*verdict);
            self.blocked[index] = by.is_some();

            if let Some(by) = by {
                if by == Blocker::TooFast {
                    self.note_too_fast(index);
                }
                self.events.push(Event::Blocked {
                    robot: self.names[index].clone(),
                    by,
                    at: to_wire(self.world.robots()[index]),
                });
            }
        }
    }

    /// Warns of the first move of a robot that is too fast, and counts them.
    fn note_too_fast(&mut self, index: usize) {
        let robot = &self.names[index];
        let count = self.too_fast.entry(robot.clone()).or_default();
        *count += 1;
        if *count > 1 {
            return;
        }

        let at = to_wire(self.world.robots()[index]);
        let proposal = self.reports.get(robot).map_or(at, |report| report.proposal);
        let max_mps = self.scenario.max_speed_mps;
        self.events.push(Event::Warned {
            robot: robot.clone(),
            text: format!(
                "it proposed to move {:.3} m in a tick and stays: at most {max_mps} m/s, {:.3} m in {} s, is allowed \
                 (max_speed of the scenario)",
                at.distance_m(proposal),
                max_mps * self.scenario.tick_s,
                self.scenario.tick_s
            ),
        });
    }

    /// Says how often moves were too fast, where the first warning does not say all.
    pub(super) fn count_too_fast(&self, events: &mut Vec<Event>) {
        for (robot, count) in &self.too_fast {
            if *count > 1 {
                events.push(Event::Warned {
                    robot: robot.clone(),
                    text: format!("{count} of its moves were refused because they were too fast"),
                });
            }
        }
    }

    /// What has blocked a move; `None` if it was not blocked.
    fn blocker(&self, verdict: MoveOutcome) -> Option<Blocker> {
        let by = match verdict {
            MoveOutcome::Advanced | MoveOutcome::Stayed => return None,
            MoveOutcome::TooFast | MoveOutcome::NotFinite => return Some(Blocker::TooFast),
            MoveOutcome::Blocked { by } => by,
        };

        Some(match by {
            world::Blocker::Edge => Blocker::Edge,
            world::Blocker::Wall(_) => Blocker::Wall,
            world::Blocker::Body(Body::Obstacle(_)) => Blocker::Obstacle,
            world::Blocker::Body(Body::Guest(_)) => Blocker::Guest,
            world::Blocker::Body(Body::Robot(index)) => Blocker::Robot(self.names[index].clone()),
        })
    }
}

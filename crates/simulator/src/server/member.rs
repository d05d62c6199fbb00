//! Who takes part: joining, tokens, incarnations.

use std::time::{Duration, Instant};

use bus::Query;
use protocol::keys::Keys;
use protocol::messages::{JoinAnswer, JoinRequest, Phase, Presence, Refusal};
use protocol::{Generation, PROTOCOL_VERSION, decode, encode};

use super::{Interrupt, Server, introduce};
use crate::scenario::OnLate;
use crate::simulation::{Membership, Simulation, public_state, set_apart};

/// A robot that has joined shows its token within this time, or its place is free again.
const TOKEN_PATIENCE: Duration = Duration::from_secs(2);

/// A robot of the roster, as the simulator knows its processes.
#[derive(Debug, Default)]
pub(super) struct Member {
    /// The process that joined last.
    instance: Option<String>,
    /// Since when its token is awaited.
    joined_at: Option<Instant>,
    /// Its number; 0 before the first.
    pub(super) generation: Generation,
    /// Whether its token is there.
    pub(super) is_present: bool,
    /// Whether it is new in this epoch and no clock has named it yet.
    is_pending: bool,
    /// Whether it was seated in this epoch, so that a further process is a further incarnation.
    is_seated: bool,
    /// Whether the clock goes on without it.
    pub(super) is_lost: bool,
    /// Whether it was lost and has been heard of since.
    has_returned: bool,
    /// Whether an earlier incarnation still speaks, and must be told that it has been replaced.
    has_predecessor: bool,
    missed: u32,
}

impl Member {
    /// Whether it can take part in a new epoch.
    pub(super) fn is_ready(&self) -> bool {
        self.is_present && self.instance.is_some()
    }

    /// Whether it is there, for people.
    pub(super) fn presence(&self) -> Presence {
        match (self.is_lost, self.is_present) {
            (true, _) => Presence::Lost,
            (false, true) => Presence::Here,
            (false, false) => Presence::Gone,
        }
    }

    /// Whether the next clock finds it able to take part, or takes it in.
    pub(super) fn is_back(&self) -> bool {
        self.is_present && (!self.is_lost || self.has_returned || self.is_pending)
    }

    /// Everybody takes part in an epoch from its beginning.
    pub(super) fn begin_epoch(&mut self) {
        (self.is_seated, self.is_pending, self.is_lost, self.missed) = (true, false, false, 0);
        self.has_returned = false;
    }

    /// The incarnation that the next clock must name, if there is one and its process is ready.
    pub(super) fn take_pending(&mut self) -> Option<Generation> {
        if !((self.is_pending || self.has_returned) && self.is_present) {
            return None;
        }
        (
            self.is_pending,
            self.has_returned,
            self.is_lost,
            self.missed,
        ) = (false, false, false, 0);
        Some(self.generation)
    }

    /// A report came from it although the clock goes on without it.
    pub(super) fn is_heard_of(&mut self) {
        self.has_returned = true;
    }

    /// A report came from an incarnation that has been replaced and does not know it.
    pub(super) fn hears_predecessor(&mut self) {
        self.has_predecessor = true;
    }

    /// The generation that the next clock must repeat, so that a predecessor learns of it.
    pub(super) fn take_reminder(&mut self) -> Option<Generation> {
        std::mem::take(&mut self.has_predecessor).then_some(self.generation)
    }

    /// A tick is over in which it reported, or not.
    pub(super) fn count_report(&mut self, has_reported: bool) {
        if has_reported {
            self.missed = 0;
        }
    }

    /// It missed a tick. Returns whether it is lost now.
    pub(super) fn miss(&mut self, lose_after: u32) -> bool {
        self.missed += 1;
        self.is_lost = self.missed >= lose_after || !self.is_present;
        self.is_lost
    }

    /// Whether another process is this robot, or is about to show its token.
    fn is_taken_from(&self, instance: &str) -> bool {
        let is_other = self.instance.as_deref().is_some_and(|own| own != instance);
        is_other
            && (self.is_present
                || self
                    .joined_at
                    .is_some_and(|at| at.elapsed() < TOKEN_PATIENCE))
    }

    fn take_place(&mut self, instance: String) {
        if self.instance.as_ref() == Some(&instance) {
            return; // It joins a further epoch.
        }
        (self.instance, self.joined_at) = (Some(instance), Some(Instant::now()));
        if self.is_seated {
            self.generation += 1;
            self.is_pending = true;
        } else {
            self.generation = self.generation.max(1);
        }
    }
}

impl Server {
    pub(super) fn on_join(&mut self, query: &Query, simulation: &Simulation) {
        let answer = self
            .judge_join(query, simulation)
            .unwrap_or_else(|(reason, explanation)| {
                tracing::info!("refused a robot: {explanation}");
                JoinAnswer::Refused {
                    reason,
                    explanation,
                }
            });
        query.reply(query.key(), encode(&answer));
    }

    fn judge_join(
        &mut self,
        query: &Query,
        simulation: &Simulation,
    ) -> Result<JoinAnswer, (Refusal, String)> {
        let request: JoinRequest = decode(query.key(), "a robot", &query.body())
            .map_err(|error| (Refusal::Malformed, error.to_string()))?;
        let (name, run) = (&request.name, &self.options.run);
        // Access control looks at keys: whoever is in the key must be who is meant.
        if let Some(asker) = Keys::joins_as(query.key()).filter(|asker| *asker != name.as_str()) {
            return Err((Refusal::Malformed, format!("{asker} cannot join as {name}")));
        }
        if request.protocol != PROTOCOL_VERSION {
            let text = format!(
                "{name} speaks version {} of the protocol, this simulator version {PROTOCOL_VERSION}: update the older one",
                request.protocol
            );
            return Err((Refusal::OtherProtocol, text));
        }
        if request.run != *run {
            return Err((
                Refusal::OtherRun,
                format!("{name} means run {}, this is run {run}", request.run),
            ));
        }
        if self.pace.phase() == Phase::Ended {
            return Err((Refusal::Ended, format!("run {run} is over")));
        }
        let Some(member) = self.members.get_mut(name) else {
            let roster: Vec<&str> = self
                .members
                .keys()
                .map(protocol::RobotName::as_str)
                .collect();
            let text = format!(
                "no robot of this run is called {name}; its robots are {}",
                roster.join(", ")
            );
            return Err((Refusal::UnknownName, text));
        };
        if member.is_taken_from(&request.instance) {
            return Err((
                Refusal::NameTaken,
                format!("another living process is {name} already"),
            ));
        }
        member.take_place(request.instance.clone());
        let generation = member.generation;
        let mut welcome = simulation.welcome(run, name, generation);
        // Its predecessor had done the tick that is under way, in which others may still ask for the one before.
        if let (Some(welcome), Some(report)) = (&mut welcome, self.open.reports.get(name)) {
            welcome.state_before = welcome
                .last_state
                .replace(public_state(report, welcome.location));
            set_apart(welcome);
        }
        let unknown = || {
            (
                Refusal::UnknownName,
                format!("no robot of this run is called {name}"),
            )
        };
        welcome
            .map(|welcome| JoinAnswer::Welcome(Box::new(welcome)))
            .ok_or_else(unknown)
    }

    pub(super) fn on_token(
        &mut self,
        robot: &str,
        is_there: bool,
        simulation: &Simulation,
    ) -> Result<(), Interrupt> {
        let Some((name, _)) = self.members.get_key_value(robot) else {
            self.ignore("unknown robot", robot);
            return Ok(());
        };
        let name = name.clone();
        let is_open = self.open_tick().is_some() && !self.open.reports.contains_key(&name);
        let Some(member) = self.members.get_mut(&name) else {
            return Ok(());
        };
        member.is_present = is_there;
        if is_there {
            // It has been here: when its token goes, its place is free at once.
            member.joined_at = None;
        }
        if is_there && is_open {
            // It takes the place of one that was lost in this very tick, or it is back and may have missed the clock.
            if let Some(generation) = member.take_pending() {
                self.open
                    .membership
                    .push(Membership::Joined(name.clone(), generation));
                introduce(&mut self.open.clock, &name, generation, simulation);
            }
            self.repeat_clock()?;
        }
        let is_awaited = self.awaited().any(|awaited| *awaited == name);
        if !is_there && is_awaited && self.lateness.of(&name) == OnLate::Continue {
            // Who is gone will not be in time.
            self.give_up(&name);
        }
        if self.open.is_announced {
            self.observers.held(simulation, &self.status(simulation));
        }
        Ok(())
    }
}

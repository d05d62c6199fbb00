//! All robots in one process, without a network: for sweeps, tests and debugging. The two sides of the lock-step, joined by
//! function calls.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use lockstep::{
    Attendance, Barrier, BarrierOutput, Bulletin, Exchange, LatePolicy, Participant,
    ParticipantOutput, Stamp, StateQuery, TickOutcome, Timeouts, Timing, Turn,
};
use protocol::messages::{
    CommandText, FaultKind, MAX_ENTRIES, OnLate, Panel, Presence, PublicState, Report,
    StreamReseed, TickUpdate, Welcome,
};
use protocol::{Generation, RobotName, Tick};

use crate::cars::Cars;
use crate::cri::Robot;
use crate::error::RobotError;
use crate::network::{PeerNetwork, Undelivered};
use crate::runner::{Runner, TickResult};

type LocalParticipant = Participant<TickUpdate, Arc<PublicState>, CommandText, Arc<Report>>;
type LocalAction = ParticipantOutput<TickUpdate, Arc<PublicState>, CommandText, Arc<Report>>;

/// The robots of a run, all in this process.
pub struct LocalHost {
    barrier: Barrier<Arc<Report>, CommandText>,
    outputs: Vec<BarrierOutput<Arc<Report>, CommandText>>,
    names: Vec<RobotName>,
    runners: Vec<Runner>,
    participants: Vec<LocalParticipant>,
    /// Indices of the robots that are stopped and are not back.
    stopped: BTreeSet<usize>,
    timeouts: Timeouts,
}

/// A tick that robots are to run: what they perceive is decided, and none of them has acted.
pub struct OpenTick {
    tick: Tick,
    /// The robots that run it, by index.
    turns: Vec<(usize, Turn<TickUpdate>)>,
    /// What it comes to, if no robot runs it.
    outcome: Option<TickOutcome<Arc<Report>, CommandText>>,
}

/// The other robots of the process, as one of them queries them.
struct Others<'a> {
    names: &'a [RobotName],
    participants: &'a [LocalParticipant],
    query: StateQuery,
}

impl PeerNetwork for Others<'_> {
    fn state_of(&mut self, target: &RobotName) -> Result<Arc<PublicState>, Undelivered> {
        let index = self
            .names
            .iter()
            .position(|name| name == target)
            .ok_or(Undelivered::Lost)?;

        self.participants[index]
            .query(self.query)
            .map_err(|_| Undelivered::Lost)
    }
}

impl LocalHost {
    /// Makes the runners of robots with their welcomes. The order does not matter.
    #[must_use]
    pub fn new(robots: Vec<(Box<dyn Robot>, Welcome)>) -> Self {
        // No robot of this process is ever late, and no timer ever fires.
        let lateness = LatePolicy {
            on_late: OnLate::Wait,
            own: BTreeMap::new(),
            deadline: Duration::MAX,
            lose_after: 1,
        };
        let timeouts = Timeouts {
            join: Duration::MAX,
            gone: Duration::MAX,
        };
        let names: Vec<RobotName> = robots
            .iter()
            .map(|(_, welcome)| welcome.name.clone())
            .collect();
        let epoch = robots.first().map_or(1, |(_, welcome)| welcome.epoch);

        let mut outputs = Vec::new();
        let max_commands = u32::try_from(MAX_ENTRIES).unwrap_or(u32::MAX);
        let mut barrier = Barrier::new(
            names.iter().cloned(),
            lateness.clone(),
            Timing::default(),
            max_commands,
        );
        barrier.gather(epoch, lateness, &mut outputs);
        let mut runners = Vec::new();
        let mut participants = Vec::new();
        for (robot, welcome) in robots {
            let mut actions = Vec::new();
            let mut participant = Participant::new(timeouts, &mut actions);
            let admission = barrier
                .join(&welcome.name, "local", &mut outputs)
                .unwrap_or_else(|refused| unreachable!("it is of the roster: {refused:?}"));
            participant.admitted(admission, [], &mut actions);
            barrier.token(&welcome.name, true, &mut outputs);
            participants.push(participant);
            runners.push(Runner::new(robot, welcome));
        }
        outputs.clear();

        Self {
            barrier,
            outputs,
            names,
            runners,
            participants,
            stopped: BTreeSet::new(),
            timeouts,
        }
    }

    /// A copy that goes on as this one does, between two ticks.
    ///
    /// # Errors
    /// The first robot that cannot be copied ([`Robot::snapshot`]).
    pub fn snapshot(&self) -> Result<Self, RobotName> {
        let mut runners = Vec::with_capacity(self.runners.len());
        for (runner, name) in self.runners.iter().zip(&self.names) {
            runners.push(runner.snapshot().ok_or_else(|| name.clone())?);
        }

        Ok(Self {
            barrier: self.barrier.clone(),
            outputs: self.outputs.clone(),
            names: self.names.clone(),
            runners,
            participants: self.participants.clone(),
            stopped: self.stopped.clone(),
            timeouts: self.timeouts,
        })
    }

    /// Sets where a robot draws from other streams, from the next tick on. Without effect on a robot that is not of the roster.
    pub fn set_reseeds(&mut self, name: &RobotName, reseeds: Vec<StreamReseed>) {
        if let Some(index) = self.index(name) {
            self.runners[index].set_reseeds(reseeds);
        }
    }

    /// Crashes a robot between two ticks: the clock goes on without it, as without a process that was killed under
    /// `on_late = "continue"`. Without effect on a robot that is not of the roster.
    pub fn crash(&mut self, name: &RobotName) {
        self.stop(name, FaultKind::Crash);
        self.barrier.token(name, false, &mut self.outputs);
        self.outputs.clear();
    }

    /// Hangs a robot between two ticks, as a process that is stopped under `on_late = "continue"`: it misses ticks, and is lost
    /// after `lose_after` of them, which is the same for all robots. Without effect on a robot that is not of the roster.
    pub fn hang(&mut self, name: &RobotName, lose_after: u32) {
        let mut lateness = self.barrier.lateness().clone();
        lateness.lose_after = lose_after;
        self.barrier.set_lateness(lateness, &mut self.outputs);
        self.stop(name, FaultKind::Hang);
    }

    fn stop(&mut self, name: &RobotName, fault: FaultKind) {
        let Some(index) = self.index(name) else {
            return;
        };

        let mut lateness = self.barrier.lateness().clone();
        lateness.own.insert(name.clone(), OnLate::Continue);
        self.barrier.set_lateness(lateness, &mut self.outputs);
        self.barrier.fault(name, Some(fault));
        self.outputs.clear();
        self.stopped.insert(index);
    }

    /// Brings a robot back that is stopped, between two ticks, as a further incarnation that takes over from the state that it
    /// reported last. `welcome` is called with the number of that incarnation; it returns `None` for a robot that is not of the roster.
    pub fn bring_back(
        &mut self,
        name: &RobotName,
        robot: Box<dyn Robot>,
        welcome: impl FnOnce(Generation) -> Option<Welcome>,
    ) {
        if self
            .index(name)
            .is_some_and(|index| self.stopped.remove(&index))
        {
            self.join(name, robot, welcome);
        }
    }

    /// Says who takes part in the next tick, because it is executed again. Robots that are not absent run it.
    pub fn recall(&mut self, attendance: Attendance) {
        self.stopped.clear();
        for name in &attendance.absent {
            self.stopped.extend(self.index(name));
        }

        self.barrier.recall(Some(attendance));
    }

    /// From the next tick on nothing is executed again: all robots take part in it that are not stopped until then.
    pub fn end_recall(&mut self) {
        self.stopped.clear();
        self.barrier.recall(None);
    }

    /// Whether the clock goes on without a robot.
    #[must_use]
    pub fn is_lost(&self, name: &RobotName) -> bool {
        self.barrier.presence(name).1 == Presence::Lost
    }

    /// Puts another robot in the place of one that goes on as the same incarnation.
    pub fn replace_runner(&mut self, name: &RobotName, robot: Box<dyn Robot>) {
        if let Some(index) = self.index(name) {
            let welcome = self.runners[index].welcome().clone();
            self.runners[index] = Runner::new(robot, welcome);
        }
    }

    /// Lets a robot take part from the next tick on as a further incarnation. `welcome` is as in [`Self::bring_back`].
    pub fn join(
        &mut self,
        name: &RobotName,
        robot: Box<dyn Robot>,
        welcome: impl FnOnce(Generation) -> Option<Welcome>,
    ) {
        let Some(index) = self.index(name) else {
            return;
        };

        let next = self.barrier.presence(name).0 + 1;
        let instance = format!("local {next}");
        // Its predecessor is not there any more, and the fault is over only after that: it decides nothing by itself.
        self.barrier.token(name, false, &mut self.outputs);
        self.barrier.fault(name, None);
        let admission = self
            .barrier
            .join(name, &instance, &mut self.outputs)
            .unwrap_or_else(|refused| unreachable!("its place is free: {refused:?}"));
        let Some(welcome) = welcome(admission.generation) else {
            return;
        };

        let mut actions = Vec::new();
        let mut participant = Participant::new(self.timeouts, &mut actions);
        participant.admitted(admission, welcome.states_before(), &mut actions);
        self.barrier.token(name, true, &mut self.outputs);
        self.outputs.clear();
        self.participants[index] = participant;
        self.runners[index] = Runner::new(robot, welcome);
    }

    /// The panels of the robots that are not stopped.
    #[must_use]
    pub fn panels(&self) -> BTreeMap<RobotName, Panel> {
        let mut panels = BTreeMap::new();
        for (index, name) in self.names.iter().enumerate() {
            if !self.stopped.contains(&index) {
                panels.insert(name.clone(), self.runners[index].panel());
            }
        }
        panels
    }

    /// Warns of what was left out of the log in this epoch, as a robot's own process does at its end.
    pub fn report_left_out(&self) {
        for runner in &self.runners {
            runner.report_left_out();
        }
    }

    fn index(&self, name: &RobotName) -> Option<usize> {
        self.names.iter().position(|own| own == name)
    }

    /// Hands news and clock of a tick to every robot, and collects the ticks that they are to run.
    fn grant(&mut self, news: &dyn Bulletin<TickUpdate>) -> Vec<(usize, Turn<TickUpdate>)> {
        let mut turns = Vec::new();
        for output in std::mem::take(&mut self.outputs) {
            let BarrierOutput::Grant { news: to, clock } = output else {
                continue;
            };
            let mut actions: Vec<LocalAction> = Vec::new();
            for (name, notice) in to {
                let index = self.names.iter().position(|own| *own == name);
                let index = index.filter(|index| !self.stopped.contains(index));
                if let Some(index) = index {
                    // Robots that share a flag all get news, also those for which nothing is new.
                    let news = news.compose(&name, notice);
                    let participant = &mut self.participants[index];
                    participant.news(clock.epoch, clock.tick, notice, news, &mut actions);
                }
            }
            for (index, participant) in self.participants.iter_mut().enumerate() {
                if self.stopped.contains(&index) {
                    continue;
                }
                participant.clock(clock, &mut actions);
                for action in actions.drain(..) {
                    if let ParticipantOutput::Run(turn) = action {
                        turns.push((index, turn));
                    }
                }
            }
        }

        turns
    }

    /// Opens a tick: the first half of [`Exchange::exchange`].
    pub fn open(&mut self, tick: Tick, news: &dyn Bulletin<TickUpdate>) -> OpenTick {
        self.barrier.open(tick, news.robots(), &mut self.outputs);
        let outcome = self.take_outcome();
        let turns = if outcome.is_none() {
            self.grant(news)
        } else {
            // A run without robots, or all of them are stopped.
            self.outputs.clear();
            Vec::new()
        };
        OpenTick {
            tick,
            turns,
            outcome,
        }
    }

    /// Shows what a robot perceives in an open tick, before it acts: nothing that is done with it counts. `None` if the robot does not
    /// run the tick.
    pub fn perceive<T>(
        &self,
        open: &OpenTick,
        name: &RobotName,
        see: impl FnOnce(&mut Cars<'_>) -> T,
    ) -> Option<T> {
        let index = self.index(name)?;
        let (_, turn) = open.turns.iter().find(|(runs, _)| *runs == index)?;
        let mut others = self.others(turn);
        Some(self.runners[index].perceive(turn, &mut others, see))
    }

    /// Has the robots run an open tick: the second half of [`Exchange::exchange`].
    ///
    /// # Errors
    /// If a robot cannot go on.
    pub fn close(
        &mut self,
        open: OpenTick,
    ) -> Result<TickOutcome<Arc<Report>, CommandText>, RobotError> {
        if let Some(outcome) = open.outcome {
            return Ok(outcome);
        }

        for (index, turn) in &open.turns {
            self.run(*index, turn)?;
        }
        self.take_outcome().ok_or_else(|| self.no_report(open.tick))
    }

    fn others(&self, turn: &Turn<TickUpdate>) -> Others<'_> {
        Others {
            names: &self.names,
            participants: &self.participants,
            query: StateQuery {
                tick: Some(turn.tick),
                epoch: Some(turn.epoch),
            },
        }
    }

    /// Runs one tick of one robot, and hands what came of it to the barrier.
    fn run(&mut self, index: usize, turn: &Turn<TickUpdate>) -> Result<(), RobotError> {
        let mut others = Others {
            names: &self.names,
            participants: &self.participants,
            query: StateQuery {
                tick: Some(turn.tick),
                epoch: Some(turn.epoch),
            },
        };
        let TickResult {
            commands,
            state,
            report,
        } = self.runners[index].run(turn, &mut others)?;

        let mut actions = Vec::new();
        self.participants[index].done(commands, state, report, &mut actions);
        let name = self.names[index].clone();
        for action in actions {
            let ParticipantOutput::Put(answer) = action else {
                continue;
            };
            let stamp = Stamp::from(answer.as_ref());
            let count = answer.commands.len() as u32;
            for (number, command) in (1..).zip(answer.commands) {
                self.barrier
                    .command(&name, stamp, number, command, &mut self.outputs);
            }
            self.barrier
                .report(&name, stamp, count, answer.report, &mut self.outputs);
        }
        Ok(())
    }
}

impl Exchange<TickUpdate, Arc<Report>, CommandText> for LocalHost {
    type Error = RobotError;

    fn exchange(
        &mut self,
        tick: Tick,
        news: &dyn Bulletin<TickUpdate>,
    ) -> Result<TickOutcome<Arc<Report>, CommandText>, RobotError> {
        let open = self.open(tick, news);
        self.close(open)
    }
}

impl LocalHost {
    fn no_report(&self, tick: Tick) -> RobotError {
        let awaited = self.barrier.awaited();
        let names: Vec<&str> = awaited.iter().map(|(name, _)| name.as_str()).collect();
        RobotError::NoReport {
            robots: names.join(", "),
            tick,
        }
    }

    fn take_outcome(&mut self) -> Option<TickOutcome<Arc<Report>, CommandText>> {
        let index = self
            .outputs
            .iter()
            .position(|output| matches!(output, BarrierOutput::Complete(_)))?;

        match self.outputs.swap_remove(index) {
            BarrierOutput::Complete(outcome) => Some(outcome),
            _ => None,
        }
    }
}

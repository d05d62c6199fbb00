//! The robots' side of the bus, for one robot or several in a process: a loop that translates between the bus and the
//! lock-step ([`lockstep::Participant`]). Robots of one process share a session.
//!
//! What arrives is fed to the participants where it arrives, on the middleware's thread: so a query is answered at once,
//! also while a robot computes. What the participants want done goes through a [`bus::Inbox`], whose worker is the host: it is
//! carried out by the host's own thread, which also runs the robots; or, if all its robots are quick ([`Robot::is_quick`]), their
//! ticks are run by the middleware's thread, soon after the clock arrives there.

mod participants;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bus::{
    Bus, BusError, Declared, Inbox, OnArrival, Publisher, Role, WatchedPublisher, Worker,
    WorkerThread,
};
use lockstep::{
    Admission, Begin, IncarnationNotice, Leave, ParticipantOutput, StateQuery, Timeouts, Turn,
};
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{
    Clock, End, JoinAnswer, JoinRequest, ParametersAnswer, ParametersOffer, PublicState, Refusal,
    TickPanel, TickUpdate, Waiting, Welcome,
};
use protocol::{Malformed, PROTOCOL_VERSION, RobotName, RunName, decode, encode};

use crate::cri::Robot;
use crate::error::RobotError;
use crate::network::{PeerNetwork, Undelivered};
use crate::runner::{Runner, TickResult};
use participants::{Actions, Allowance, Asked, HostAction, HostAnswer, Participants};

/// How to reach a run.
#[derive(Debug, Clone)]
pub struct HostOptions {
    /// The run.
    pub run: RunName,
    /// Endpoint of its simulator or router.
    pub connect: String,
    /// How long to try to reach it and to join.
    pub patience: Duration,
    /// How long to wait for a simulator that is gone: it has ended, or the link to it is cut, which look the same from here.
    pub gone_patience: Duration,
    /// A configuration file of the middleware instead of the built-in settings.
    pub zenoh_config: Option<PathBuf>,
}

/// Why robots cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The simulator refused a robot.
    #[error("{name} may not join: {explanation}")]
    Refused {
        /// The robot.
        name: RobotName,
        /// Why, for programs.
        reason: Refusal,
        /// Why, for people.
        explanation: String,
    },
    /// An answer of the simulator cannot be understood.
    #[error(transparent)]
    Malformed(#[from] Malformed),
    /// A robot refuses its parameters, or gave up.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// The process wants to leave ([`Stopper::stop`]).
    #[error("stopped from within this process")]
    Stopped,
    /// No simulator executes the run.
    #[error(
        "no simulator of run {run} answers at {connect}; is it running, and is the run's name right?"
    )]
    NoSimulator {
        /// The run.
        run: RunName,
        /// Where it was looked for.
        connect: String,
    },
    /// The simulator of the run is there, and does not admit a robot.
    #[error(
        "the simulator of run {run} at {connect} has not admitted {name} in time: it is under load (--patience-s or \
         CARS_PATIENCE_S give it more time), or its access control does not know {name}"
    )]
    NotAdmitted {
        /// The robot.
        name: RobotName,
        /// The run.
        run: RunName,
        /// Where the simulator is.
        connect: String,
    },
    /// The simulator went away and did not come back.
    #[error("the simulator has been gone for {0:?}")]
    SimulatorGone(Duration),
    /// Another process has taken a robot's place.
    #[error("another process is {0} now")]
    Replaced(RobotName),
}

/// Robots of one process, connected.
pub struct Host {
    options: HostOptions,
    bus: Bus,
    keys: Keys,
    participants: Arc<Participants>,
    actions: Actions,
    members: BTreeMap<RobotName, HostedRobot>,
    declared: Vec<Declared>,
    /// Subscriptions to other robots' states, by subscriber and robot.
    followed: BTreeMap<(RobotName, RobotName), Declared>,
}

/// Ends [`Host::run`] from another thread: for a signal, or when what a robot needs is gone.
#[derive(Clone)]
pub struct Stopper {
    participants: Arc<Participants>,
}

impl Stopper {
    /// Ends the loop, where it waits or after the tick that is under way, with [`HostError::Stopped`]. Queries that the
    /// tick still makes are interrupted.
    pub fn stop(&self) {
        self.participants.each(lockstep::Participant::stop);
    }
}

/// One robot of the process.
struct HostedRobot {
    /// The robot, until its first welcome makes a runner of it.
    robot: Option<Box<dyn Robot>>,
    runner: Option<Runner>,
    /// The welcome of the epoch that it joined last, until its first tick.
    welcome: Option<Welcome>,
    /// Whether it perceives all bodies around it.
    senses_bodies: bool,
    senses_ranges: bool,
    explanation: String,
    report: Publisher,
    state: WatchedPublisher,
    panel: WatchedPublisher,
    /// For all commands, whatever their targets: a key for each pair of robots would cost more than the commands. Declared with the
    /// first one.
    outbox: Option<Publisher>,
    token: Option<Declared>,
}

impl Host {
    /// Connects.
    ///
    /// # Errors
    /// [`HostError::Bus`] if the run cannot be reached.
    pub fn connect(
        robots: Vec<(RobotName, Box<dyn Robot>)>,
        options: HostOptions,
    ) -> Result<Self, HostError> {
        let role = Role::Client {
            connect: options.connect.clone(),
            patience: options.patience,
        };
        let bus = Bus::open(&role, options.zenoh_config.as_ref())?;
        Self::join_over(bus, robots, options)
    }

    /// The same over a bus that is open already.
    ///
    /// # Errors
    /// [`HostError::Bus`] if something cannot be declared.
    pub fn join_over(
        bus: Bus,
        robots: Vec<(RobotName, Box<dyn Robot>)>,
        options: HostOptions,
    ) -> Result<Self, HostError> {
        let keys = Keys::new(&options.run);
        let timeouts = Timeouts {
            join: options.patience,
            gone: options.gone_patience,
        };
        let names: Vec<RobotName> = robots.iter().map(|(name, _)| name.clone()).collect();
        // One slow robot would keep the middleware's thread from everything else, so all have to be
        // quick.
        let are_quick = robots.iter().all(|(_, robot)| robot.is_quick());
        let actions = Inbox::new(if are_quick {
            OnArrival::WorkSoon
        } else {
            OnArrival::Wake
        });
        let participants = Arc::new(Participants::new(&names, timeouts, actions.clone()));
        let mut members = BTreeMap::new();
        for (name, robot) in robots {
            let member = HostedRobot {
                senses_bodies: robot.senses_bodies(),
                senses_ranges: robot.senses_ranges(),
                robot: Some(robot),
                runner: None,
                welcome: None,
                explanation: String::new(),
                report: bus.publisher(&keys.report(&name))?,
                state: bus.watched_publisher(&keys.query(&name, STATE))?,
                panel: bus.observer_publisher(&keys.panel(&name))?,
                outbox: None,
                token: None,
            };
            members.insert(name, member);
        }

        let mut host = Self {
            options,
            bus,
            keys,
            participants,
            actions,
            members,
            declared: Vec::new(),
            followed: BTreeMap::new(),
        };
        // Robots join, and declare their tokens, only in `run`: so what is declared here is in effect
        // before a token is seen.
        for name in &names {
            host.declare(name)?;
        }
        host.declare_common()?;
        Ok(host)
    }

    /// Declares what belongs to one robot: the subscriber to its news, and the queryables of its state.
    fn declare(&mut self, name: &RobotName) -> Result<(), BusError> {
        let participants = self.participants.clone();
        let own = name.clone();
        let news = self
            .bus
            .subscribe(&self.keys.news(name), move |key, bytes| {
                match decode::<TickUpdate>(key, "simulator", bytes) {
                    Ok(news) => participants.with(&own, |participant, actions| {
                        let notice = IncarnationNotice::from(&news);
                        participant.news(news.epoch, news.tick, notice, news, actions);
                    }),
                    Err(error) => tracing::warn!("{error}"),
                }
            })?;
        self.declared.push(news);

        for what in QUERIES.iter().chain([&STATE]) {
            let participants = self.participants.clone();
            let own = name.clone();
            let queryable = self
                .bus
                .queryable(
                    &self.keys.query(name, what),
                    move |query| match StateQuery::read(|name| query.parameter(name))
                        .and_then(|asked| participants.state(&own, asked))
                    {
                        Ok(state) => reply(&query, &state),
                        Err(reason) => query.reply_err(&reason),
                    },
                )?;
            self.declared.push(queryable);
        }
        self.declare_parameters_check(name)
    }

    /// Declares the queryable that checks whether a robot could work with other parameters, if the robot has such a check.
    fn declare_parameters_check(&mut self, name: &RobotName) -> Result<(), BusError> {
        let robot = self
            .members
            .get(name)
            .and_then(|member| member.robot.as_ref());
        let Some(check) = robot.and_then(|robot| robot.parameters_check()) else {
            return Ok(());
        };

        let key = self.keys.parameters(name);
        // On the middleware's thread. The check needs neither the robot nor its runner, so a robot that
        // computes can be asked as well.
        let queryable = self.bus.queryable(&key, move |query| {
            match decode::<ParametersOffer>(query.key(), "simulator", &query.body()) {
                Ok(offer) => {
                    let answer = match check(&offer.parameters) {
                        Ok(()) => ParametersAnswer::Accepted,
                        Err(reason) => ParametersAnswer::Refused { reason },
                    };
                    query.reply(query.key(), encode(&answer));
                }
                Err(error) => query.reply_err(&error.to_string()),
            }
        })?;
        self.declared.push(queryable);
        Ok(())
    }

    /// Declares what the robots of the process share: the subscriber to the clock, and to the simulator's token.
    fn declare_common(&mut self) -> Result<(), BusError> {
        let participants = self.participants.clone();
        let clock = self.bus.subscribe(&self.keys.clock(), move |key, bytes| {
            match decode::<Clock>(key, "simulator", bytes) {
                // In the order of names and under one lock: no other message comes between two robots.
                Ok(clock) => {
                    // Noted first: what the participants want done may be done at once.
                    if clock.panels {
                        participants.show(clock.epoch, clock.tick);
                    }
                    participants.each(|participant, actions| participant.clock(clock, actions));
                }
                Err(error) => tracing::warn!("{error}"),
            }
        })?;

        let participants = self.participants.clone();
        let patience_s = self.options.gone_patience.as_secs_f64();
        let simulator = self
            .bus
            .liveliness(&self.keys.alive_sim(), move |_, is_present| {
                if !is_present {
                    tracing::warn!(
                        "the simulator, or the link to it, is gone: waiting for it up to {patience_s} s"
                    );
                }
                participants.simulator(is_present);
            })?;
        self.declared.extend([clock, simulator]);
        Ok(())
    }

    /// What ends [`Host::run`] from another thread.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        Stopper {
            participants: self.participants.clone(),
        }
    }

    /// Runs until the run ends.
    ///
    /// # Errors
    /// [`HostError`] if it cannot go on.
    pub fn run(self) -> Result<End, HostError> {
        let actions = self.actions.clone();
        let (mut host, outcome) = actions.run(self);

        for member in host.members.values() {
            if let Some(runner) = &member.runner {
                runner.report_left_out();
            }
        }
        host.leave_bus();
        outcome
    }

    fn leave_bus(&mut self) {
        // The tokens first: the robots are seen to leave while everything else of them still works.
        for member in self.members.values_mut() {
            member.token = None;
        }
        self.followed.clear();
        self.declared.clear();
        self.bus.close();
    }

    /// Does what a participant wants done. Returns how the run ended, when it has.
    fn carry_out(
        &mut self,
        name: &RobotName,
        action: HostAction,
    ) -> Result<Option<End>, HostError> {
        match action {
            ParticipantOutput::Run(turn) => self.run_tick(name, &turn)?,
            ParticipantOutput::Leave(leave) => return self.leave(name, &leave).map(Some),
            other => self.carry_out_io(name, other)?,
        }

        Ok(None)
    }

    /// The same for everything that does not run a robot or end the process.
    fn carry_out_io(&mut self, name: &RobotName, action: HostAction) -> Result<(), HostError> {
        match action {
            ParticipantOutput::Join => self.join(name)?,
            ParticipantOutput::DeclareToken => {
                let token = self.bus.token(&self.keys.alive_robot(name))?;
                if let Some(member) = self.members.get_mut(name) {
                    member.token = Some(token);
                }
            }
            ParticipantOutput::Put(answer) => self.put(name, &answer)?,
            ParticipantOutput::Query { of, tick, epoch } => {
                let asked = format!("tick={tick};epoch={epoch}");
                self.query(name, &of, &asked)?;
            }
            ParticipantOutput::Unfollow(of) => drop(self.followed.remove(&(name.clone(), of))),
            ParticipantOutput::PutWaiting { tick, epoch, on } => {
                let waiting = Waiting { epoch, tick, on };
                self.bus.put(&self.keys.waiting(name), encode(&waiting))?;
            }
            // Timers are set by the participants' side, and the other two are the caller's.
            ParticipantOutput::SetTimer(..)
            | ParticipantOutput::Run(_)
            | ParticipantOutput::Leave(_) => {}
        }

        Ok(())
    }

    /// Runs one tick of a robot.
    fn run_tick(&mut self, name: &RobotName, turn: &Turn<TickUpdate>) -> Result<(), HostError> {
        let Some(member) = self.members.get_mut(name) else {
            return Ok(());
        };
        if turn.begin != Begin::GoOn {
            member.take_runner();
        }
        // While the robot waits for an answer, the host goes on carrying things out.
        let Some(mut runner) = member.runner.take() else {
            unreachable!("a robot runs after its welcome");
        };

        let mut network = HostNetwork {
            host: self,
            name,
            query: StateQuery {
                tick: Some(turn.tick),
                epoch: Some(turn.epoch),
            },
            failed: None,
        };
        let outcome = runner.run(turn, &mut network);
        // Before the outcome: because of this the robot was interrupted, and what it made of the tick
        // counts for nothing.
        if let Some(failed) = network.failed.take() {
            return Err(failed);
        }
        let TickResult {
            commands,
            state,
            report,
        } = outcome?;
        // Encoded once: a repetition of the report has the same bytes, also if the robot's panel or parameters change meanwhile.
        let bytes = encode(report.as_ref());
        // Before the participant gets the answer, which may want the next tick run at once.
        if let Some(member) = self.members.get_mut(name) {
            member.runner = Some(runner);
        }
        self.participants.file(name, |participant, actions| {
            participant.done(commands, state, bytes.into(), actions);
        });
        Ok(())
    }

    /// Asks the simulator to admit a robot.
    fn join(&mut self, name: &RobotName) -> Result<(), HostError> {
        let Some(member) = self.members.get_mut(name) else {
            return Ok(());
        };
        let request = JoinRequest {
            protocol: PROTOCOL_VERSION,
            run: self.options.run.clone(),
            name: name.clone(),
            instance: self.bus.id(),
            bodies: member.senses_bodies,
            ranges: member.senses_ranges,
            sdk: concat!("rust/", env!("CARGO_PKG_VERSION")).to_owned(),
        };
        let key = self.keys.join_as(name);
        // This waits for an answer, for a limited time. Meanwhile the middleware's thread feeds the
        // other participants, and queues what they want done.
        let Some(answer) = self.bus.get(&key, "", Some(encode(&request)))? else {
            self.participants
                .with(name, lockstep::Participant::unanswered);
            return Ok(());
        };

        let bytes = answer.result.unwrap_or_else(String::into_bytes);
        match decode(&key, "simulator", &bytes)? {
            JoinAnswer::Welcome(welcome) => {
                let admission = Admission::from(welcome.as_ref());
                let states = welcome.states_before();
                // Kept first: the turn that the participant wants next makes its runner of it.
                member.welcome = Some(*welcome);
                self.participants.with(name, |participant, actions| {
                    participant.admitted(admission, states, actions);
                });
            }
            JoinAnswer::Refused {
                reason,
                explanation,
            } => {
                member.explanation = explanation;
                self.participants.with(name, |participant, actions| {
                    participant.refused(reason, actions);
                });
            }
        }
        Ok(())
    }

    /// Puts what came of a tick: the commands, then the state for those that follow it, then the report. On one session they
    /// arrive in this order.
    fn put(&mut self, name: &RobotName, answer: &HostAnswer) -> Result<(), BusError> {
        let Some(member) = self.members.get_mut(name) else {
            return Ok(());
        };
        for (_, command) in answer.commands_from(1) {
            let outbox = match &mut member.outbox {
                Some(outbox) => outbox,
                none => none.insert(self.bus.publisher(&self.keys.outbox(name))?),
            };
            outbox.put(encode(&command))?;
        }
        // Without a robot that follows it, the state is not even encoded.
        if member.state.has_subscribers() {
            member.state.put(encode(answer.state.as_ref()))?;
        }

        // Before the report, which may complete the tick: observers have the panel before the frame. The robot has not run a tick
        // after this one, because what participants want is done in its order.
        if let Some(runner) = &member.runner
            && self.participants.shows(answer.epoch, answer.tick)
            && member.panel.has_subscribers()
        {
            let panel = TickPanel::new(answer.epoch, answer.tick, runner.panel());
            member.panel.put(encode(&panel))?;
        }
        member.report.put(answer.report.to_vec())?;
        Ok(())
    }

    /// Queries another robot's state once, and subscribes to it from then on: it is put before the clock that follows, so that
    /// the next query finds its answer here already.
    fn query(&mut self, name: &RobotName, of: &RobotName, asked: &str) -> Result<(), BusError> {
        let key = self.keys.query(of, STATE);
        let participants = self.participants.clone();
        let own = name.clone();
        let other = of.clone();
        self.bus.get_then(&key, asked, move |reply| {
            let Some(reply) = reply else { return };
            match reply.result {
                Ok(bytes) => file_state(&participants, &own, &other, &reply.key, &bytes),
                Err(reason) => tracing::debug!(%other, reason, "a query was refused"),
            }
        })?;

        // The query comes first: it answers for this tick, whatever the subscriber will see. A state that arrives by both ways is the
        // same, and the participant keeps one.
        let follows = (name.clone(), of.clone());
        if !self.followed.contains_key(&follows) {
            let participants = self.participants.clone();
            let (own, other) = follows.clone();
            let subscriber = self.bus.subscribe(&key, move |key, bytes| {
                file_state(&participants, &own, &other, key, bytes);
            })?;
            self.followed.insert(follows, subscriber);
        }
        Ok(())
    }

    fn leave(&self, name: &RobotName, leave: &Leave) -> Result<End, HostError> {
        Err(match leave {
            Leave::End(end) => return Ok(*end),
            Leave::Refused(reason) => HostError::Refused {
                name: name.clone(),
                reason: *reason,
                explanation: self
                    .members
                    .get(name)
                    .map(|member| member.explanation.clone())
                    .unwrap_or_default(),
            },
            Leave::NoSimulator if self.participants.has_simulator() => HostError::NotAdmitted {
                name: name.clone(),
                run: self.options.run.clone(),
                connect: self.options.connect.clone(),
            },
            Leave::NoSimulator => HostError::NoSimulator {
                run: self.options.run.clone(),
                connect: self.options.connect.clone(),
            },
            Leave::SimulatorGone => HostError::SimulatorGone(self.options.gone_patience),
            Leave::Replaced => HostError::Replaced(name.clone()),
            Leave::Stopped => HostError::Stopped,
        })
    }
}

impl Worker for Host {
    type Exit = Result<End, HostError>;

    fn work(&mut self, thread: WorkerThread) -> Result<Option<Duration>, Self::Exit> {
        let mut allowance = Allowance::of(thread);
        loop {
            // On a thread of arrival timers wait: most of what they want done is not for it.
            if thread == WorkerThread::Owner {
                self.participants.fire_timers();
            }
            // Both threads take actions in one order, with the worker in their hands: so actions are carried out in the order in
            // which participants wanted them. One that is not for this thread holds those after it back.
            let next = self.actions.take_if(|(_, action)| allowance.takes(action));
            let Some((name, action)) = next else { break };
            if let Some(outcome) = self.carry_out(&name, action).transpose() {
                return Err(outcome);
            }
        }

        let due = self.participants.next_timer();
        Ok(due.map(|due| due.saturating_duration_since(Instant::now())))
    }
}

impl HostedRobot {
    /// Makes the robot's runner with its newest welcome, or starts it over.
    fn take_runner(&mut self) {
        let Some(welcome) = self.welcome.take() else {
            return;
        };
        match (&mut self.runner, self.robot.take()) {
            (Some(runner), _) => runner.start_over(welcome),
            (none, Some(robot)) => *none = Some(Runner::new(robot, welcome)),
            (None, None) => unreachable!("a robot that does not run is here"),
        }
    }
}

/// The bus, as a robot sees it that runs a tick: it waits here for other robots' answers, and the host goes on meanwhile.
struct HostNetwork<'a> {
    host: &'a mut Host,
    name: &'a RobotName,
    query: StateQuery,
    /// Why the host cannot go on.
    failed: Option<HostError>,
}

impl PeerNetwork for HostNetwork<'_> {
    fn state_of(&mut self, target: &RobotName) -> Result<Arc<PublicState>, Undelivered> {
        let participants = self.host.participants.clone();
        // A robot of the same process has reported the tick before, or has missed it: there is nothing
        // to wait for.
        if participants.has(target) {
            return participants
                .state(target, self.query)
                .map_err(|_| Undelivered::Lost);
        }

        loop {
            // The loop of the host stands still meanwhile, so its timers fire here.
            participants.fire_timers();
            match participants.ask(self.name, target) {
                Asked::Found(state) => return Ok(state),
                Asked::Interrupted => return Err(Undelivered::Interrupted),
                Asked::Pending => {}
            }

            // Other robots of the process run later, on this thread.
            let next = self.host.actions.take_first(|(_, action)| {
                !matches!(
                    action,
                    ParticipantOutput::Run(_) | ParticipantOutput::Leave(_)
                )
            });
            let Some((name, action)) = next else {
                // What arrives after the look above ends the wait at once.
                self.host.actions.wait(participants.next_timer());
                continue;
            };
            let carried_out = bus::runtime::block(|| self.host.carry_out_io(&name, action));
            if let Err(error) = carried_out {
                self.failed = Some(error);
                return Err(Undelivered::Interrupted);
            }
        }
    }
}

/// Files another robot's state.
fn file_state(
    participants: &Participants,
    own: &RobotName,
    other: &RobotName,
    key: &str,
    bytes: &[u8],
) {
    match decode::<PublicState>(key, other.as_str(), bytes) {
        Ok(state) => participants.with(own, |participant, _| {
            participant.heard(other.clone(), state.epoch, state.tick, Arc::new(state));
        }),
        Err(error) => tracing::warn!("{error}"),
    }
}

/// Answers a query with a state, or with the one field of it that the key names.
fn reply(query: &bus::Query, state: &PublicState) {
    let what = Keys::last_chunk(query.key());
    match state.reply(what) {
        Some(reply) => query.reply(query.key(), reply),
        None => query.reply_err(&format!("there is no query called {what}")),
    }
}

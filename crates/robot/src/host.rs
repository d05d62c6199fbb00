//! The lock-step loop over the bus, for one robot or several in a process. They share one session: what several robots
//! say in a tick leaves in one batch.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Publisher, Role};
use protocol::codec::MAX_MESSAGE_BYTES;
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{
    Clock, End, JoinAnswer, JoinRequest, PublicState, Refusal, Report, Welcome,
};
use protocol::{Malformed, PROTOCOL_VERSION, RobotName, RunName, decode, encode};

use crate::cri::{Robot, RobotError};
use crate::link::{Event, Link};
use crate::seat::Seat;

/// How to reach a run.
#[derive(Debug, Clone)]
pub struct HostOptions {
    /// The run.
    pub run: RunName,
    /// Endpoint of its simulator or router.
    pub connect: String,
    /// How long to try to reach it and to be let in.
    pub patience: Duration,
    /// How long to wait for it once it is gone: it ended, or the link to it is cut, which look the same from here.
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
    /// The simulator did not let a robot in.
    #[error("{name} may not join: {explanation}")]
    Refused {
        /// Who.
        name: RobotName,
        /// Why, for programs.
        reason: Refusal,
        /// Why, for people.
        explanation: String,
    },
    /// The simulator said something that cannot be understood.
    #[error(transparent)]
    Malformed(#[from] Malformed),
    /// A robot refuses its parameters, or gave up.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// The process wants to leave ([`Stopper::stop`]).
    #[error("stopped from within this process")]
    Stopped,
    /// Nobody executes the run.
    #[error(
        "no simulator of run {run} answers at {connect}; is it running, and is the run's name right?"
    )]
    NoSimulator {
        /// The run.
        run: RunName,
        /// Where it was looked for.
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
    link: Link,
    members: BTreeMap<RobotName, Member>,
    declared: Vec<Declared>,
}

/// Lets another thread end [`Host::run`]: for a signal, or when what a robot needs is gone.
#[derive(Debug, Clone)]
pub struct Stopper {
    is_stopped: Arc<AtomicBool>,
    queue: SyncSender<Event>,
}

impl Stopper {
    /// Ends the loop, where it waits or after the tick that is under way, with [`HostError::Stopped`]. Questions that the
    /// tick still asks are interrupted.
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::SeqCst);
        // Wakes a loop that waits; one whose queue is full does not.
        let _woken = self.queue.try_send(Event::Stop);
    }
}

/// One robot of the process.
struct Member {
    seat: Seat,
    /// Whether the clock that names it has come, and it takes part.
    is_seated: bool,
    report: Publisher,
    state: Publisher,
    panel: Publisher,
    painted: Option<Instant>,
    /// The last report, for the case that it got lost.
    last: Option<(Clock, Vec<u8>)>,
}

/// A panel is for eyes: no more often than this.
const PANEL_INTERVAL: Duration = Duration::from_millis(50);
/// Between two attempts to join.
const JOIN_AGAIN: Duration = Duration::from_millis(100);

impl Host {
    /// Connects, joins with every robot, and shows that they are ready.
    ///
    /// # Errors
    /// [`HostError`] says what is in the way: nobody there, refused and why, or the bus itself.
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
    /// [`HostError`], as for [`Host::connect`].
    pub fn join_over(
        bus: Bus,
        robots: Vec<(RobotName, Box<dyn Robot>)>,
        options: HostOptions,
    ) -> Result<Self, HostError> {
        let keys = Keys::new(&options.run);
        let link = Link::new(bus.clone(), keys.clone(), options.gone_patience);
        let mut host = Self {
            options,
            bus,
            keys,
            link,
            members: BTreeMap::new(),
            declared: Vec::new(),
        };
        let names: Vec<RobotName> = robots.iter().map(|(name, _)| name.clone()).collect();
        host.listen(&names)?;
        for (name, robot) in robots {
            let welcome = host.join(&name)?;
            // Others may still ask for what the previous incarnation reported last.
            for last in welcome.state_before.iter().chain(&welcome.last_state) {
                host.link.board.show(&name, Arc::new(last.clone()));
            }
            let member = Member {
                seat: Seat::new(robot, welcome),
                is_seated: false,
                report: host.bus.publisher(&host.keys.report(&name))?,
                state: host.bus.publisher(&host.keys.query(&name, STATE))?,
                panel: host.bus.observer_publisher(&host.keys.panel(&name))?,
                painted: None,
                last: None,
            };
            host.members.insert(name, member);
        }
        // Last, so that who sees the token knows that everything above is in effect.
        for name in &names {
            host.declared
                .push(host.bus.token(&host.keys.alive_robot(name))?);
        }
        Ok(host)
    }

    fn listen(&mut self, names: &[RobotName]) -> Result<(), BusError> {
        let queue = self.link.queue();
        // A full queue holds the link: back-pressure instead of loss. A closed one means that the process ends.
        self.declared
            .push(self.bus.subscribe(&self.keys.clock(), move |key, bytes| {
                let _ = queue.send(Event::Clock(decode(key, "simulator", bytes)));
            })?);
        let queue = self.link.queue();
        self.declared.push(
            self.bus
                .liveliness(&self.keys.alive_sim(), move |_, there| {
                    let _ = queue.send(Event::Simulator(there));
                })?,
        );
        for name in names {
            self.link.host(name);
            self.link.board.host(name);
            let (queue, to) = (self.link.queue(), name.clone());
            self.declared.push(self.bus.subscribe(
                &self.keys.commands_to(name),
                move |key, bytes| {
                    let Ok(from) = RobotName::new(Keys::last_chunk(key)) else {
                        return;
                    };
                    let command = decode(key, from.as_str(), bytes);
                    let _ = queue.send(Event::Command {
                        to: to.clone(),
                        from,
                        command,
                    });
                },
            )?);
            for what in QUERIES.iter().chain([&STATE]) {
                let board = self.link.board.clone();
                self.declared.push(
                    self.bus
                        .queryable(&self.keys.query(name, what), move |query| board.ask(query))?,
                );
            }
        }
        Ok(())
    }

    fn join(&mut self, name: &RobotName) -> Result<Welcome, HostError> {
        let request = JoinRequest {
            protocol: PROTOCOL_VERSION,
            run: self.options.run.clone(),
            name: name.clone(),
            instance: self.bus.id(),
            sdk: concat!("rust/", env!("CARGO_PKG_VERSION")).to_owned(),
        };
        let (key, begun) = (self.keys.join_as(name), Instant::now());
        loop {
            let is_last_try = begun.elapsed() > self.options.patience;
            match self.bus.get(&key, "", Some(encode(&request)))? {
                Some(answer) => {
                    let bytes = answer.result.unwrap_or_else(String::into_bytes);
                    match decode(&key, "simulator", &bytes)? {
                        JoinAnswer::Welcome(welcome) => {
                            self.link.keep_commands(welcome.repeat_ticks);
                            return Ok(*welcome);
                        }
                        // A predecessor that was killed is noticed within its lease.
                        JoinAnswer::Refused {
                            reason: Refusal::NameTaken,
                            ..
                        } if !is_last_try => {}
                        JoinAnswer::Refused {
                            reason,
                            explanation,
                        } => {
                            return Err(HostError::Refused {
                                name: name.clone(),
                                reason,
                                explanation,
                            });
                        }
                    }
                }
                None if is_last_try => {
                    let (run, connect) = (self.options.run.clone(), self.options.connect.clone());
                    return Err(HostError::NoSimulator { run, connect });
                }
                None => {}
            }
            std::thread::sleep(JOIN_AGAIN);
        }
    }

    /// What ends [`Host::run`] from another thread.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        Stopper {
            is_stopped: self.link.is_stopped.clone(),
            queue: self.link.queue(),
        }
    }

    /// Runs until the run ends.
    ///
    /// # Errors
    /// [`HostError`] if it cannot go on.
    pub fn run(mut self) -> Result<End, HostError> {
        let outcome = loop {
            match self.link.next_clock() {
                Some(Clock { end: Some(end), .. }) => break Ok(end),
                Some(clock) => {
                    if let Err(error) = self.on_clock(&clock) {
                        break Err(error);
                    }
                }
                None if self.link.is_stopped() => break Err(HostError::Stopped),
                None => {}
            }
            if let Some(gone) = self.link.simulator_gone.map(|since| since.elapsed())
                && gone >= self.options.gone_patience
            {
                break Err(HostError::SimulatorGone(gone));
            }
        };
        self.declared.clear();
        self.bus.close();
        outcome
    }

    /// One tick of every robot of the process, in the order of their names.
    fn on_clock(&mut self, clock: &Clock) -> Result<(), HostError> {
        let (asked, current) = ((clock.epoch, clock.tick), self.link.current());
        if asked < current {
            return Ok(()); // An echo: the clock has gone on since.
        }
        if asked > current {
            self.link.begin(clock.epoch, clock.tick);
        }
        let names: Vec<RobotName> = self.members.keys().cloned().collect();
        for name in &names {
            self.rejoin_if_new_epoch(name, clock)?;
            if let Some(member) = self.members.get_mut(name) {
                member.answer(name, clock, &mut self.link)?;
            }
        }
        Ok(())
    }

    /// `init`: the same robot, with what holds for the new epoch.
    fn rejoin_if_new_epoch(&mut self, name: &RobotName, clock: &Clock) -> Result<(), HostError> {
        let is_new = |member: &Member| clock.tick == 0 && member.seat.welcome().epoch < clock.epoch;
        if !self.members.get(name).is_some_and(is_new) {
            return Ok(());
        }
        let welcome = self.join(name)?;
        if let Some(member) = self
            .members
            .get_mut(name)
            .filter(|_| welcome.epoch == clock.epoch)
        {
            member.seat.start_over(welcome);
            (member.is_seated, member.last) = (false, None);
        }
        Ok(())
    }
}

impl Member {
    fn answer(
        &mut self,
        name: &RobotName,
        clock: &Clock,
        link: &mut Link,
    ) -> Result<(), HostError> {
        let welcome = self.seat.welcome();
        if clock.epoch != welcome.epoch {
            return Ok(()); // An echo of an earlier epoch.
        }
        let joined = clock.news.get(name).and_then(|news| news.joined);
        if joined.is_some_and(|generation| generation > welcome.generation) {
            return Err(HostError::Replaced(name.clone()));
        }
        if let Some((last, report)) = &self.last
            && (last.epoch, last.tick) >= (clock.epoch, clock.tick)
        {
            if last.tick == clock.tick {
                link.repeat_commands();
                self.report.put(report.clone())?;
            }
            return Ok(());
        }
        let is_named = joined == Some(welcome.generation);
        let Some((report, state)) = self.tick(clock, is_named, link)? else {
            return Ok(());
        };
        let bytes = encode(&report);
        if bytes.len() > MAX_MESSAGE_BYTES {
            let reason = format!(
                "{} bytes, more than the {MAX_MESSAGE_BYTES} allowed",
                bytes.len()
            );
            let (robot, field) = (name.clone(), "its report".to_owned());
            return Err(RobotError::TooMuch {
                robot,
                field,
                reason,
            }
            .into());
        }
        // First what others may ask for, then the report: after it the clock may go on and they will ask.
        // Who follows has the state before the next clock, because both come the same way.
        if self.state.has_subscribers() {
            self.state.put(encode(&state))?;
        }
        link.board.show(name, Arc::new(state));
        self.report.put(bytes.clone())?;
        self.last = Some((
            Clock {
                epoch: clock.epoch,
                tick: clock.tick,
                ..Clock::default()
            },
            bytes,
        ));
        self.paint()
    }

    fn tick(
        &mut self,
        clock: &Clock,
        joins: bool,
        link: &mut Link,
    ) -> Result<Option<(Report, PublicState)>, HostError> {
        if self.is_seated {
            return Ok(Some(self.seat.tick(clock, link)?));
        }
        if clock.tick > 0 && !joins {
            return Ok(None); // Its turn has not come: the clock that names it is still to be granted.
        }
        self.is_seated = true;
        Ok(Some(if clock.tick == 0 {
            self.seat.init(clock, link)?
        } else {
            self.seat.resume(clock, link)?
        }))
    }

    fn paint(&mut self) -> Result<(), HostError> {
        let is_due = self.painted.is_none_or(|at| at.elapsed() >= PANEL_INTERVAL);
        if self.panel.has_subscribers() && is_due {
            self.painted = Some(Instant::now());
            self.panel.put(encode(&self.seat.panel()))?;
        }
        Ok(())
    }
}

//! One robot's place in the lock-step: from a clock to a report. Synchronous and without a network of its own, so that
//! the same code runs in one process and over the bus.

use std::sync::Arc;

use protocol::messages::{
    Clock, Command, CommandId, News, Percept, Point, PublicState, Report, Welcome,
};
use protocol::random::{Stream, stream};
use protocol::{Epoch, Message, RobotName, Tick};

use crate::cars::{Cars, Outbox, ReceivedCommand};
use crate::cri::{Action, Robot};
use crate::error::RobotError;

/// What a seat needs from outside during a tick.
pub trait Network {
    /// The state that `target` reported for `tick`.
    ///
    /// # Errors
    /// [`Undelivered`] says why there is none.
    fn state_of(
        &mut self,
        target: &RobotName,
        epoch: Epoch,
        tick: Tick,
    ) -> Result<Arc<PublicState>, Undelivered>;

    /// What `robot` senses around itself as of `tick`.
    ///
    /// # Errors
    /// [`Undelivered`] says why there is none.
    fn percept(
        &mut self,
        robot: &RobotName,
        epoch: Epoch,
        tick: Tick,
    ) -> Result<Percept, Undelivered>;

    /// Sends a command from one robot to another.
    fn send(&mut self, from: &RobotName, to: &RobotName, command: &Command);

    /// The command that a clock named; `None` if it never came.
    fn receive(&mut self, to: &RobotName, epoch: Epoch, id: &CommandId) -> Option<Command>;
}

/// Why a query has no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Undelivered {
    /// The other side is gone.
    Lost,
    /// The epoch is over.
    Interrupted,
}

/// How a robot begins a tick.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Begin {
    /// From its initial state.
    Afresh,
    /// From its initial state, with the variables that a lost process published last.
    TakeOver,
    /// From its state after the tick before.
    GoOn,
}

/// A robot that takes part in an epoch.
pub struct Seat {
    robot: Box<dyn Robot>,
    welcome: Arc<Welcome>,
    random: Stream,
    outbox: Outbox,
    proposal: Point,
    /// Why the robot cannot go on.
    gave_up: Option<String>,
}

impl Seat {
    /// Seats a robot that has been welcomed.
    #[must_use]
    pub fn new(robot: Box<dyn Robot>, welcome: Welcome) -> Self {
        let random = stream(welcome.seed, &welcome.stream);
        let proposal = welcome.location;
        let outbox = Outbox {
            last_seq: welcome.last_seq,
            ..Outbox::default()
        };
        Self {
            robot,
            welcome: Arc::new(welcome),
            random,
            outbox,
            proposal,
            gave_up: None,
        }
    }

    /// What it was told when it joined.
    #[must_use]
    pub fn welcome(&self) -> &Welcome {
        &self.welcome
    }

    /// The same robot in a new epoch.
    pub fn start_over(&mut self, welcome: Welcome) {
        self.random = stream(welcome.seed, &welcome.stream);
        self.outbox = Outbox {
            last_seq: welcome.last_seq,
            ..Outbox::default()
        };
        self.proposal = welcome.location;
        self.welcome = Arc::new(welcome);
    }

    /// What the robot chooses to display.
    #[must_use]
    pub fn panel(&self) -> protocol::messages::Panel {
        self.robot.panel()
    }

    /// The first tick of the epoch: the robot returns to its initial state and acts from its start.
    ///
    /// # Errors
    /// [`RobotError`] if the robot refuses its parameters, or gives up.
    pub fn init(
        &mut self,
        clock: &Clock,
        network: &mut dyn Network,
    ) -> Result<(Report, PublicState), RobotError> {
        self.proposal = self.welcome.location;
        self.act(clock, network, Begin::Afresh)
    }

    /// The first tick of an incarnation that takes over in the middle of an epoch.
    ///
    /// # Errors
    /// [`RobotError`] if the robot refuses its parameters, or gives up.
    pub fn resume(
        &mut self,
        clock: &Clock,
        network: &mut dyn Network,
    ) -> Result<(Report, PublicState), RobotError> {
        self.act(clock, network, Begin::TakeOver)
    }

    /// One tick.
    ///
    /// # Errors
    /// [`RobotError`] if the robot gives up.
    pub fn tick(
        &mut self,
        clock: &Clock,
        network: &mut dyn Network,
    ) -> Result<(Report, PublicState), RobotError> {
        self.act(clock, network, Begin::GoOn)
    }

    /// Lets the robot perceive and act, and reports what it did.
    fn act(
        &mut self,
        clock: &Clock,
        network: &mut dyn Network,
        begin: Begin,
    ) -> Result<(Report, PublicState), RobotError> {
        let welcome = self.welcome.clone();
        let news = clock.news.get(&welcome.name).cloned().unwrap_or_default();
        let location = news
            .correction
            .map_or(self.proposal, |correction| correction.location);
        let received = receive(&welcome, &news, network);

        let mut log = Vec::new();
        let mut cars = Cars {
            welcome: &welcome,
            tick: clock.tick,
            location,
            commands: &received.commands,
            news: &news,
            random: &mut self.random,
            outbox: &mut self.outbox,
            log: &mut log,
            gave_up: &mut self.gave_up,
            network,
        };
        if begin != Begin::GoOn {
            self.robot.init(&mut cars)?;
        }
        if begin == Begin::TakeOver
            && let Some(last) = &welcome.last_state
        {
            self.robot.resume(&mut cars, &last.state_variables);
        }
        let mut action = Action::default();
        if cars.gave_up.is_none() {
            action = self.robot.tick(&mut cars);
        }

        if let Some(reason) = self.gave_up.take() {
            return Err(RobotError::GaveUp {
                robot: welcome.name.clone(),
                reason,
            });
        }
        self.publish(clock.tick, location, action, received.missing, log)
    }

    /// Makes the report and the public state of an action, once they are fit to be sent.
    fn publish(
        &mut self,
        tick: Tick,
        location: Point,
        mut action: Action,
        missing: Vec<CommandId>,
        mut log: Vec<String>,
    ) -> Result<(Report, PublicState), RobotError> {
        // JSON has no NaN: a number that is not finite is replaced or dropped, and logged.
        let proposal = action.proposal;
        if !(proposal.x.is_finite() && proposal.y.is_finite()) {
            log.push("error: the projected location is not a number; staying".to_owned());
        }
        self.proposal = Point::new(
            finite_or(proposal.x, location.x),
            finite_or(proposal.y, location.y),
        );
        action.state_variables.retain(|name, value| {
            let is_finite = value.as_f64().is_none_or(f64::is_finite);
            if !is_finite {
                log.push(format!(
                    "error: state variable {name} is not a finite number; left out"
                ));
            }
            is_finite
        });

        let state = PublicState {
            epoch: self.welcome.epoch,
            tick,
            location,
            speed_mps: finite_or(action.speed_mps, 0.0),
            direction_rad: finite_or(crate::published_angle(action.direction_rad), 0.0),
            state_variables: action.state_variables,
            emotion_state: action.emotion_state,
            behavior_state: action.behavior_state,
        };
        let report = self.report(&state, missing, log);

        // The simulator would refuse a report beyond the limits, and wait for another one.
        match report.check() {
            Ok(()) => Ok((report, state)),
            Err((field, reason)) => Err(RobotError::TooMuch {
                robot: self.welcome.name.clone(),
                field,
                reason,
            }),
        }
    }

    fn report(&mut self, state: &PublicState, missing: Vec<CommandId>, log: Vec<String>) -> Report {
        Report {
            epoch: state.epoch,
            tick: state.tick,
            generation: self.welcome.generation,
            proposal: self.proposal,
            speed_mps: state.speed_mps,
            direction_rad: state.direction_rad,
            emotion_state: state.emotion_state.clone(),
            behavior_state: state.behavior_state.clone(),
            state_variables: state.state_variables.clone(),
            sent: std::mem::take(&mut self.outbox.sent),
            missing,
            log,
        }
    }
}

/// The commands that a clock named.
#[derive(Default)]
struct Received {
    commands: Vec<ReceivedCommand>,
    /// Those that never came.
    missing: Vec<CommandId>,
}

/// Takes the commands that the news name from the network.
fn receive(welcome: &Welcome, news: &News, network: &mut dyn Network) -> Received {
    let mut received = Received::default();
    let mut last: Option<(&CommandId, Command)> = None;
    for id in &news.commands {
        // A command that the medium has doubled is named twice in a row; the network holds it once.
        if last.as_ref().is_none_or(|(last_id, _)| *last_id != id) {
            last = network
                .receive(&welcome.name, welcome.epoch, id)
                .map(|command| (id, command));
        }
        match &last {
            Some((_, command)) => received.commands.push(ReceivedCommand {
                from: id.from.clone(),
                text: command.command.clone(),
            }),
            None => received.missing.push(id.clone()),
        }
    }
    received
}

fn finite_or(value: f64, fallback: f64) -> f64 {
    if value.is_finite() { value } else { fallback }
}

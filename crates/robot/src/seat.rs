//! One robot's place in the lock-step: from a clock to a report. Synchronous and without a network of its own, so that
//! the same code runs in one process and over the bus.

use std::sync::Arc;

use protocol::messages::{
    Clock, Command, CommandId, News, Percept, Point, PublicState, Report, Welcome,
};
use protocol::random::{Stream, stream};
use protocol::{Epoch, Message, RobotName, Tick};

use crate::cars::{Cars, Outbox};
use crate::cri::{Robot, RobotError};

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

    /// The first tick of the epoch: initialize, and propose where to go. Nobody has said anything yet.
    ///
    /// # Errors
    /// [`RobotError`] if the robot refuses its parameters, or gives up.
    pub fn init(
        &mut self,
        clock: &Clock,
        network: &mut dyn Network,
    ) -> Result<(Report, PublicState), RobotError> {
        let (mut log, welcome) = (Vec::new(), self.welcome.clone());
        let news = clock.news.get(&welcome.name).cloned().unwrap_or_default();
        self.proposal = welcome.location;
        let (robot, mut cars) = self.enter(&welcome, clock.tick, &news, &mut log, network);
        robot.init_robot(&mut cars)?;
        robot.set_current_location(&mut cars, welcome.location);
        self.leave(clock.tick, &news, Vec::new(), log, network)
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
        let (mut log, welcome) = (Vec::new(), self.welcome.clone());
        let news = clock.news.get(&welcome.name).cloned().unwrap_or_default();
        let (robot, mut cars) = self.enter(&welcome, clock.tick, &news, &mut log, network);
        robot.init_robot(&mut cars)?;
        if let Some(last) = &welcome.last_state {
            robot.resume(&mut cars, &last.state_variables);
        }
        let (mut report, state) = self.tick(clock, network)?;
        report.log.splice(0..0, log);
        Ok((report, state))
    }

    /// One tick, in the order of the seed's Figure 5.
    ///
    /// # Errors
    /// [`RobotError`] if the robot gives up.
    pub fn tick(
        &mut self,
        clock: &Clock,
        network: &mut dyn Network,
    ) -> Result<(Report, PublicState), RobotError> {
        let (mut log, mut missing, welcome) = (Vec::new(), Vec::new(), self.welcome.clone());
        let news = clock.news.get(&welcome.name).cloned().unwrap_or_default();
        let location = news
            .correction
            .map_or(self.proposal, |correction| correction.location);
        let (robot, mut cars) = self.enter(&welcome, clock.tick, &news, &mut log, network);

        robot.set_current_location(&mut cars, location);
        let mut received: Option<(&CommandId, Command)> = None;
        for id in &news.commands {
            // One that the medium has doubled is named twice in a row, and is here once.
            if received.as_ref().is_none_or(|(last, _)| *last != id) {
                received = cars
                    .network
                    .receive(&welcome.name, clock.epoch, id)
                    .map(|command| (id, command));
            }
            match &received {
                Some((_, command)) => robot.set_command(&mut cars, &id.from, &command.command),
                None => missing.push(id.clone()),
            }
        }
        robot.update_state_variables(&mut cars);
        robot.update_emotion_state(&mut cars);
        robot.update_behavior_state(&mut cars);

        self.leave(clock.tick, &news, missing, log, network)
    }

    /// The robot, and the simulation as it sees it in this tick.
    fn enter<'a>(
        &'a mut self,
        welcome: &'a Welcome,
        tick: Tick,
        news: &'a News,
        log: &'a mut Vec<String>,
        network: &'a mut dyn Network,
    ) -> (&'a mut dyn Robot, Cars<'a>) {
        let Self {
            robot,
            random,
            outbox,
            gave_up,
            ..
        } = self;
        (
            robot.as_mut(),
            Cars {
                welcome,
                tick,
                news,
                random,
                outbox,
                log,
                gave_up,
                network,
            },
        )
    }

    /// The end of every tick: where to go next, and what to tell.
    fn leave(
        &mut self,
        tick: Tick,
        news: &News,
        missing: Vec<CommandId>,
        mut log: Vec<String>,
        network: &mut dyn Network,
    ) -> Result<(Report, PublicState), RobotError> {
        let welcome = self.welcome.clone();
        let (robot, mut cars) = self.enter(&welcome, tick, news, &mut log, network);
        let location = robot.current_location();
        let projected = robot.project_location(&mut cars);
        let (speed_mps, direction_rad) = (robot.speed(), crate::published_angle(robot.direction()));
        let (emotion_state, behavior_state) = (
            robot.emotion_state().to_owned(),
            robot.behavior_state().to_owned(),
        );
        let mut state_variables = robot.state_variables();
        if let Some(reason) = self.gave_up.take() {
            return Err(RobotError::GaveUp {
                robot: welcome.name.clone(),
                reason,
            });
        }

        // A number that is none cannot travel. The run goes on, and its log says whose fault it is.
        if !(projected.x.is_finite() && projected.y.is_finite()) {
            log.push("error: the projected location is not a number; staying".to_owned());
        }
        state_variables.retain(|name, value| {
            let can_travel = value.as_f64().is_none_or(f64::is_finite);
            if !can_travel {
                log.push(format!(
                    "error: state variable {name} is not a finite number; left out"
                ));
            }
            can_travel
        });
        let finite_or = |value: f64, instead: f64| if value.is_finite() { value } else { instead };
        self.proposal = Point::new(
            finite_or(projected.x, location.x),
            finite_or(projected.y, location.y),
        );

        let state = PublicState {
            epoch: welcome.epoch,
            tick,
            location,
            speed_mps: finite_or(speed_mps, 0.0),
            direction_rad: finite_or(direction_rad, 0.0),
            state_variables,
            emotion_state,
            behavior_state,
        };
        let report = self.report(&state, missing, log);
        // A simulator would refuse it and wait for another one.
        match report.check() {
            Ok(()) => Ok((report, state)),
            Err((field, reason)) => Err(RobotError::TooMuch {
                robot: welcome.name.clone(),
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

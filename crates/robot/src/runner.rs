//! One robot's place in the lock-step: from a tick that it is to run to what came of it. Synchronous and without a network
//! of its own, so that the same code runs in one process and over the bus.

use std::sync::Arc;

use lockstep::{Begin, Sent, Turn};
use protocol::codec::MAX_MESSAGE_BYTES;
use protocol::messages::{
    CommandText, Panel, Point, PublicState, Report, StreamReseed, TickUpdate, Velocity, Welcome,
};
use protocol::random::{Stream, stream};
use protocol::{FieldError, Message, Tick, encode};

use crate::cars::{Cars, LeftOut, ReceivedCommand};
use crate::cri::{Action, Robot};
use crate::error::{BadParameters, RobotError};
use crate::network::PeerNetwork;

/// The line of the log for a change of parameters that a robot refuses. The log is part of the record, and a robot in another
/// language has other words for the reason: that is a diagnostic.
const KEPT: &str =
    "error: refuses its new parameters, and keeps those before; its output has the reason";
/// Most bytes that JSON has for a byte of a text: `\u001b`.
const MAX_ESCAPED: usize = 6;
/// Most bytes of an entry of a list or a map beside its texts: quotes, colon, comma, a number.
const MAX_ENTRY: usize = 40;
/// Most bytes of a report beside its texts and entries.
const MAX_REST: usize = 1024;

/// What came of a tick.
#[derive(Debug)]
pub struct TickResult {
    /// The commands that the robot sent, in this order.
    pub commands: Vec<Sent<CommandText>>,
    /// What the other robots may query.
    pub state: Arc<PublicState>,
    /// Its report.
    pub report: Arc<Report>,
}

/// A robot that takes part in an epoch.
pub struct Runner {
    robot: Box<dyn Robot>,
    welcome: Arc<Welcome>,
    random: Stream,
    proposal: Point,
    /// The commands of the tick that runs.
    outbox: Vec<Sent<CommandText>>,
    /// What was left out of the log in this epoch.
    left_out: LeftOut,
    /// Why the robot cannot go on.
    gave_up: Option<String>,
}

impl Runner {
    /// The runner of a robot that has been welcomed.
    #[must_use]
    pub fn new(robot: Box<dyn Robot>, welcome: Welcome) -> Self {
        Self {
            robot,
            random: stream(welcome.seed, &welcome.stream),
            proposal: welcome.location,
            welcome: Arc::new(welcome),
            outbox: Vec::new(),
            left_out: LeftOut::default(),
            gave_up: None,
        }
    }

    /// A copy that goes on as this one does; `None` if the robot cannot be copied.
    pub(crate) fn snapshot(&self) -> Option<Self> {
        Some(Self {
            robot: self.robot.snapshot()?,
            welcome: self.welcome.clone(),
            random: self.random.clone(),
            proposal: self.proposal,
            outbox: self.outbox.clone(),
            left_out: self.left_out,
            gave_up: self.gave_up.clone(),
        })
    }

    /// Where the robot draws from other streams from now on, as if its welcome had said so.
    pub(crate) fn set_reseeds(&mut self, reseeds: Vec<StreamReseed>) {
        Arc::make_mut(&mut self.welcome).reseeds = reseeds;
    }

    /// What it was told when it joined.
    #[must_use]
    pub fn welcome(&self) -> &Welcome {
        &self.welcome
    }

    /// The same robot in a new epoch, or as a further incarnation.
    pub fn start_over(&mut self, welcome: Welcome) {
        self.random = stream(welcome.seed, &welcome.stream);
        self.proposal = welcome.location;
        self.welcome = Arc::new(welcome);
        self.left_out = LeftOut::default();
    }

    /// Warns of what was left out of the log in this epoch; the log itself has the first of it only.
    pub(crate) fn report_left_out(&self) {
        if let Some(warning) = self.left_out.warning() {
            tracing::warn!("{}: {warning}", self.welcome.name);
        }
    }

    /// What the robot chooses to display.
    #[must_use]
    pub fn panel(&self) -> Panel {
        self.robot.panel()
    }

    /// Runs a tick: lets the robot perceive and act, and reports what it did.
    ///
    /// # Errors
    /// [`RobotError`] if the robot refuses its parameters, gives up, or goes beyond the limits of a message.
    pub fn run(
        &mut self,
        turn: &Turn<TickUpdate>,
        network: &mut dyn PeerNetwork,
    ) -> Result<TickResult, RobotError> {
        // Before anything has happened: a scenario whose changes a robot refuses does not begin.
        if turn.begin == Begin::Init {
            self.check_later_parameters()?;
        }

        let mut has_refused = false;
        // Each round but the first uses up parameters of the welcome, so there is a last one.
        loop {
            let mut log = Vec::new();
            if has_refused {
                log.push(KEPT.to_owned());
            }
            let acted = self.act(turn, network, &mut log);
            match acted {
                Err(RobotError::Parameters(error)) if self.has_earlier_parameters(turn) => {
                    tracing::warn!("{error}; it keeps those before");
                    has_refused = true;
                    self.take_earlier_parameters();
                }
                Err(error) => return Err(error),
                Ok((location, action)) => return self.publish(turn.tick, location, action, log),
            }
        }
    }

    /// Refuses what the scenario will change the parameters to.
    fn check_later_parameters(&self) -> Result<(), BadParameters> {
        let Some(check) = self.robot.parameters_check() else {
            return Ok(());
        };
        for later in &self.welcome.later_parameters {
            check(later).map_err(|reason| BadParameters {
                robot: self.welcome.name.clone(),
                reason: format!("as a change of the scenario sets them: {reason}"),
            })?;
        }

        Ok(())
    }

    /// Whether the robot begins in the middle of an epoch, after its parameters have changed.
    fn has_earlier_parameters(&self, turn: &Turn<TickUpdate>) -> bool {
        turn.begin == Begin::TakeOver && !self.welcome.earlier_parameters.is_empty()
    }

    /// Back to the parameters before, as if nothing had been drawn or sent with those that were refused.
    fn take_earlier_parameters(&mut self) {
        let welcome = Arc::make_mut(&mut self.welcome);
        welcome.parameters = welcome.earlier_parameters.remove(0);
        self.random = stream(welcome.seed, &welcome.stream);
        self.outbox.clear();
        self.gave_up = None;
    }

    /// Lets the robot perceive and act. Returns where it stands, and what it does.
    fn act(
        &mut self,
        turn: &Turn<TickUpdate>,
        network: &mut dyn PeerNetwork,
        log: &mut Vec<String>,
    ) -> Result<(Point, Action), RobotError> {
        let quiet = TickUpdate::default();
        let news = turn.news.as_ref().unwrap_or(&quiet);
        if turn.begin == Begin::Init {
            self.proposal = self.welcome.location;
        }
        let is_reseeded = self.take_reseeds(turn.tick);
        let location = self.location(news);
        if turn.begin == Begin::TakeOver {
            // When its process asked to join, before or after the moves of this tick or of an earlier one, is wall clock.
            let welcome = Arc::make_mut(&mut self.welcome);
            welcome.location = location;
            welcome.tick = turn.tick.saturating_sub(1);
        }
        let welcome = self.welcome.clone();
        let commands = received(news);

        let left_out_before = self.left_out;
        let mut cars = Cars {
            welcome: &welcome,
            tick: turn.tick,
            location,
            commands: &commands,
            news,
            senses_bodies: self.robot.senses_bodies(),
            senses_ranges: self.robot.senses_ranges(),
            random: &mut self.random,
            outbox: &mut self.outbox,
            log,
            left_out: &mut self.left_out,
            gave_up: &mut self.gave_up,
            network,
        };
        if turn.begin != Begin::GoOn {
            self.robot.init(&mut cars)?;
        }
        if turn.begin == Begin::TakeOver
            && let Some(last) = &welcome.last_state
        {
            self.robot.resume(&mut cars, &last.state_variables);
        }
        if turn.begin == Begin::GoOn && is_reseeded {
            self.robot.reseed(&mut cars);
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
        // Once an epoch, so that the warnings have a bound themselves.
        if left_out_before == LeftOut::default()
            && let Some(warning) = self.left_out.warning()
        {
            log.push(format!("warning: {warning}"));
        }
        Ok((location, action))
    }

    /// Where the robot stands in a tick.
    fn location(&self, news: &TickUpdate) -> Point {
        let told = news.correction.map(|correction| correction.location);
        let told = told.or(news.pose.map(|pose| pose.location));
        told.unwrap_or(self.proposal)
    }

    /// Shows what the robot perceives in a tick that it is to run. What is drawn, sent or logged then is dropped.
    pub(crate) fn perceive<T>(
        &self,
        turn: &Turn<TickUpdate>,
        network: &mut dyn PeerNetwork,
        see: impl FnOnce(&mut Cars<'_>) -> T,
    ) -> T {
        let quiet = TickUpdate::default();
        let news = turn.news.as_ref().unwrap_or(&quiet);
        let location = match turn.begin {
            Begin::Init => self.welcome.location,
            Begin::TakeOver | Begin::GoOn => self.location(news),
        };
        see(&mut Cars {
            welcome: &self.welcome,
            tick: turn.tick,
            location,
            commands: &received(news),
            news,
            senses_bodies: self.robot.senses_bodies(),
            senses_ranges: self.robot.senses_ranges(),
            random: &mut self.random.clone(),
            outbox: &mut Vec::new(),
            log: &mut Vec::new(),
            left_out: &mut LeftOut::default(),
            gave_up: &mut None,
            network,
        })
    }

    /// Draws from the last of the streams that are due. Returns whether one is.
    fn take_reseeds(&mut self, tick: Tick) -> bool {
        let due = self
            .welcome
            .reseeds
            .partition_point(|reseed| reseed.tick <= tick);
        if due == 0 {
            return false;
        }

        let welcome = Arc::make_mut(&mut self.welcome);
        let last = welcome.reseeds.drain(..due).next_back();
        if let Some(reseed) = last {
            welcome.seed = reseed.seed;
            self.random = stream(welcome.seed, &welcome.stream);
        }
        true
    }

    /// Makes the report and the public state of an action, once they are fit to be sent.
    fn publish(
        &mut self,
        tick: Tick,
        location: Point,
        mut action: Action,
        mut log: Vec<String>,
    ) -> Result<TickResult, RobotError> {
        // JSON has no NaN: a number that is not finite is replaced or dropped, and logged.
        let proposal = action.proposal;
        if !(proposal.x.is_finite() && proposal.y.is_finite()) {
            log.push("error: the projected location is not a number; staying".to_owned());
        }
        // It stays where it is: the next tick begins from what was reported, not from what the robot
        // meant.
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

        let velocity = action.velocity.map(|velocity| Velocity {
            linear_mps: finite_or(velocity.linear_mps, 0.0),
            angular_radps: finite_or(velocity.angular_radps, 0.0),
        });
        if velocity != action.velocity {
            log.push("error: the velocity is not a number; braking".to_owned());
        }

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
        let commands = std::mem::take(&mut self.outbox);
        let report = Report {
            epoch: state.epoch,
            tick: state.tick,
            generation: self.welcome.generation,
            proposal: self.proposal,
            speed_mps: state.speed_mps,
            direction_rad: state.direction_rad,
            emotion_state: state.emotion_state.clone(),
            behavior_state: state.behavior_state.clone(),
            state_variables: state.state_variables.clone(),
            commands: u32::try_from(commands.len()).unwrap_or(u32::MAX),
            log,
            site_actions: action.site_actions,
            layer_actions: action.layer_actions,
            velocity,
        };

        // The simulator would refuse a message beyond the limits, and wait for another one.
        let is_fit = report
            .check()
            .and_then(|()| check_size(&report))
            .and_then(|()| commands.iter().try_for_each(check_command));
        if let Err(FieldError { field, reason }) = is_fit {
            return Err(RobotError::TooMuch {
                robot: self.welcome.name.clone(),
                field,
                reason,
            });
        }
        Ok(TickResult {
            commands,
            state: Arc::new(state),
            report: Arc::new(report),
        })
    }
}

/// Whether a report fits into a message. Runs without messages have the same limit.
fn check_size(report: &Report) -> Result<(), FieldError> {
    if is_small(report) {
        return Ok(());
    }
    match encode(report).len() {
        0..=MAX_MESSAGE_BYTES => Ok(()),
        length => Err(FieldError::new(
            "its report",
            format!("{length} bytes, more than the {MAX_MESSAGE_BYTES} allowed"),
        )),
    }
}

/// Whether a report fits into a message for certain, without writing it: this runs in every tick.
fn is_small(report: &Report) -> bool {
    let mut texts: usize = report.log.iter().map(String::len).sum();
    texts += report.emotion_state.len() + report.behavior_state.len();
    for (name, value) in &report.state_variables {
        texts += name.len() + value.as_str().map_or(0, str::len);
    }

    let mut entries = report.log.len() + report.state_variables.len();
    for action in &report.site_actions {
        texts += action.site.len();
        entries += 1 + action.set.len() + action.add.len() + action.only_if.len();
        for (name, value) in action.set.iter().chain(&action.only_if) {
            texts += name.len() + value.as_str().map_or(0, str::len);
        }
        texts += action.add.keys().map(String::len).sum::<usize>();
    }
    for action in &report.layer_actions {
        texts += action.layer.len();
        entries += 1;
    }

    texts * MAX_ESCAPED + entries * MAX_ENTRY + MAX_REST <= MAX_MESSAGE_BYTES
}

/// Whether a command stays within the limits of a message.
fn check_command(sent: &Sent<CommandText>) -> Result<(), FieldError> {
    sent.command.check()
}

/// The commands that arrived.
fn received(news: &TickUpdate) -> Vec<ReceivedCommand> {
    let mut received = Vec::with_capacity(news.commands.len());
    for delivery in &news.commands {
        received.push(ReceivedCommand {
            from: delivery.from.clone(),
            text: delivery.command.clone(),
            payload: delivery.payload.clone(),
        });
    }

    received
}

fn finite_or(value: f64, fallback: f64) -> f64 {
    if value.is_finite() { value } else { fallback }
}

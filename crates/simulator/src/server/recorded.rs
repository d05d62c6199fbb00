//! A recorded run in the place of the simulator: what its observers saw is put again, on the same keys, and control also
//! seeks.
//!
//! No robot takes part, and no clock is put: a robot that receives a clock answers it, and ticks of a recording do not take
//! place.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Query, WatchedPublisher};
use lockstep::StateQuery;
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{
    Control, JoinAnswer, LogKind, OnLate, Phase, Presence, Refusal, RobotStatus, Status,
};
use protocol::time::time_s;
use protocol::{RobotName, Tick, encode};
use recording::{Recording, RecordingError};

use config::diagnostic::Source;
use scenario::Scenario;

use super::control::execute;
use super::event::{ServerError, ServerEvent, StopReason};
use super::frontend::{Frontend, refuse};
use super::observers::{FRAME_INTERVAL, put_lossy};
use super::options::ServerOptions;
use super::player::Player;
use super::process::{Server, run_to_exit};
use super::source::{Next, TickSource};

/// A recording whose ticks are shown.
pub struct RecordedRun {
    robots: BTreeMap<RobotName, ShownRobot>,
    player: Player,
    /// When frame and panels were put last.
    shown_at: Instant,
}

/// What is put in the place of a robot.
struct ShownRobot {
    state: WatchedPublisher,
    panel: WatchedPublisher,
    /// In ticks for which it reported.
    token: Option<Declared>,
}

impl Server<RecordedRun> {
    /// Declares on an open bus what the simulator and the robots of the recorded run declared for observers. It stays at the last
    /// tick until it is stopped, whatever the options say.
    ///
    /// # Errors
    /// [`ServerError`] if something cannot be declared, or the recording has no tick that can be read.
    pub fn replay(
        bus: Bus,
        recording: Recording,
        options: ServerOptions,
    ) -> Result<Self, ServerError> {
        if recording.is_empty() {
            return Err(ServerError::Empty(recording.header().run.clone()));
        }

        let mut frontend = Frontend::new(bus, options.run, options.speed, options.is_paused)?;
        let mut robots = BTreeMap::new();
        for name in recording.header().robots.clone() {
            let robot = ShownRobot::declare(&name, &mut frontend)?;
            robots.insert(name, robot);
        }
        let source = RecordedRun {
            player: Player::open(recording)?,
            robots,
            shown_at: Instant::now(),
        };
        frontend.pace.ready();
        // After the queryables of the robots: an observer that sees the token finds all of them.
        frontend.declare_simulator()?;
        Ok(Self { frontend, source })
    }

    /// Shows tick after tick until it is stopped. At the end of the recording its last tick stays.
    pub fn run_replay(mut self) {
        self.source.put_tick(&mut self.frontend);

        let (
            Self {
                mut frontend,
                mut source,
            },
            _,
        ) = run_to_exit(self);

        frontend.pace.end();
        source.answer_stepping(&mut frontend);
        source.answer_stopping(&mut frontend);
        source.put_frame(&mut frontend);
        drop(source);
        frontend.close();
    }
}

impl ShownRobot {
    /// Declares what is put for a robot, and where queries for its state are answered.
    fn declare(name: &RobotName, frontend: &mut Frontend) -> Result<Self, BusError> {
        for what in QUERIES.iter().chain([&STATE]) {
            let robot = name.clone();
            let key = frontend.keys.query(name, what);
            frontend
                .declare_queryable(&key, move |query| ServerEvent::State(robot.clone(), query))?;
        }

        let state = frontend.keys.query(name, STATE);
        Ok(Self {
            state: frontend.bus.observer_publisher(&state)?,
            panel: frontend
                .bus
                .observer_publisher(&frontend.keys.panel(name))?,
            token: None,
        })
    }
}

impl TickSource for RecordedRun {
    type Interrupt = StopReason;

    fn end_work(
        &mut self,
        outcome: Result<Option<Duration>, StopReason>,
        _: &mut Frontend,
    ) -> Result<Option<Duration>, StopReason> {
        outcome
    }

    fn advance(&mut self, frontend: &mut Frontend) -> Result<Next, StopReason> {
        if let Err(rest) = frontend.pace.take_grant(self.player.header().tick_s) {
            return Ok(Next::Wait(rest));
        }

        match self.player.advance() {
            Ok(()) => {
                self.put_tick(frontend);
                self.answer_reached(self.player.tick(), frontend);
                // The tick at which the replay holds is shown in any case, those on the way only as
                // often as people can see.
                let is_held = frontend.pace.is_held();
                if is_held || self.shown_at.elapsed() >= FRAME_INTERVAL {
                    self.put_frame(frontend);
                }
            }
            Err(error) => self.stay_before(&error, frontend),
        }
        Ok(Next::GoOn)
    }

    fn handle(&mut self, event: ServerEvent, _: &mut Frontend) -> Result<(), StopReason> {
        match event {
            ServerEvent::Join(query) => self.refuse_join(&query),
            ServerEvent::State(robot, query) => self.on_state(&robot, &query),
            _ => unreachable!("a replay subscribes to nothing else"),
        }
        Ok(())
    }

    fn request(
        &mut self,
        query: Query,
        control: Control,
        frontend: &mut Frontend,
    ) -> Result<(), StopReason> {
        execute(query, &control, self, frontend)
    }

    fn act(&mut self, control: &Control, frontend: &mut Frontend) -> Result<(), String> {
        match control {
            Control::Seek { tick } => {
                self.seek(*tick, frontend)?;
                if frontend.pace.phase == Phase::Ready {
                    frontend.pace.phase = Phase::Paused;
                }

                // The lines that follow do not continue those before.
                let text = format!("the replay continues at tick {tick}");
                // After the seek: the line belongs to the tick from which the replay goes on.
                let status = self.status(frontend);
                frontend.observers.log_line(&status, LogKind::Run, &text);
                self.put_tick(frontend);
            }
            Control::Init {
                seed: None,
                setup: None,
                ..
            } => {
                self.seek(0, frontend)?;
                self.put_tick(frontend);
                frontend.pace.phase = Phase::Ready;
            }
            _ => return Err(format!("{}: it cannot be changed", self.what_it_is())),
        }
        Ok(())
    }

    fn check_next_tick(&self) -> Result<(), String> {
        if self.player.is_at_end() {
            return Err(format!(
                "the replay is at the last tick of its recording, {}; `init` and `seek` go back",
                self.player.tick()
            ));
        }
        Ok(())
    }

    fn tick_after(&self, ticks: u64) -> Option<Tick> {
        Some((self.player.tick() + ticks).min(self.player.last()))
    }

    fn scenario(&self) -> Result<Scenario, String> {
        let text = self.player.scenario().map_err(|error| error.to_string())?;
        let source = Source {
            name: "the recorded scenario".to_owned(),
            text,
        };
        Scenario::parse_alone(&source).map_err(|error| error.in_words())
    }

    /// How things stand, as the simulator states it. A replay waits for no robot, and so its robots are never late.
    fn status(&self, frontend: &Frontend) -> Status {
        let header = self.player.header();
        let tick = self.player.tick();
        let mut robots = Vec::new();
        for robot in self.player.robots() {
            robots.push(RobotStatus {
                name: robot.name.clone(),
                generation: robot.generation,
                on_late: OnLate::Wait,
                presence: robot.presence,
            });
        }

        Status {
            run: frontend.run.clone(),
            epoch: header.epoch,
            tick,
            pending_steps: frontend.pace.pending_steps,
            time_s: time_s(tick, header.tick_s),
            duration_s: header.duration_s,
            tick_s: header.tick_s,
            seed: header.seed,
            replay_of: Some(header.run.clone()),
            phase: frontend.pace.phase,
            speed: frontend.pace.speed,
            on_late: OnLate::Wait,
            deadline_s: 0.0,
            awaiting: Vec::new(),
            robots,
            ignored: BTreeMap::new(),
        }
    }

    /// Shows the tick to observers that may not have seen it.
    fn show(&mut self, frontend: &mut Frontend) {
        self.put_frame(frontend);
    }
}

impl RecordedRun {
    /// The next tick cannot be read: the replay stays where it is.
    fn stay_before(&mut self, error: &RecordingError, frontend: &mut Frontend) {
        tracing::warn!("{error}");
        frontend.pace.hold();
        if let Some(query) = frontend.pace.give_up_stepping() {
            refuse(&query, &error.to_string());
        }
        self.put_frame(frontend);
    }

    /// Puts what observers receive of every tick.
    fn put_tick(&mut self, frontend: &mut Frontend) {
        let player = &self.player;
        frontend.observers.note(player.tick(), player.events());
        frontend.observers.log(&player.log());

        for (name, robot) in &self.robots {
            if robot.state.has_subscribers()
                && let Some(state) = player.new_state(name)
            {
                put_lossy(&robot.state, encode(&state));
            }
        }
        if let Err(error) = self.declare_presence(frontend) {
            tracing::debug!("{error}");
        }
        if self.player.is_at_end() {
            frontend.pace.hold();
        }
    }

    /// Declares the tokens of the robots that are present in the tick.
    fn declare_presence(&mut self, frontend: &Frontend) -> Result<(), BusError> {
        for (name, robot) in &mut self.robots {
            let mut shown = self.player.robots().iter();
            let is_present =
                shown.any(|shown| shown.name == *name && shown.presence == Presence::Here);
            if !is_present {
                // Dropping the declaration undeclares it, as the robot's process did.
                robot.token = None;
            } else if robot.token.is_none() {
                robot.token = Some(frontend.bus.token(&frontend.keys.alive_robot(name))?);
            }
        }
        Ok(())
    }

    /// Puts the panels of the tick, as far as they were recorded, and then its frame.
    fn put_frame(&mut self, frontend: &mut Frontend) {
        self.shown_at = Instant::now();
        for (name, robot) in &self.robots {
            if robot.panel.has_subscribers()
                && let Some(panel) = self.player.panel(name)
            {
                put_lossy(&robot.panel, encode(&panel));
            }
        }

        if frontend.observers.has_subscribers() {
            let frame = self.player.frame(&self.status(frontend));
            let header = self.player.header();
            frontend
                .observers
                .put(frame, || header.static_world.clone());
        }
    }

    fn refuse_join(&self, query: &Query) {
        let answer = JoinAnswer::Refused {
            reason: Refusal::Ended,
            explanation: format!("{}: no robot can join", self.what_it_is()),
        };
        query.reply(query.key(), encode(&answer));
    }

    fn what_it_is(&self) -> String {
        format!("this is a replay of run {}", self.player.header().run)
    }

    /// Answers a query for a robot's state, as the robot would.
    fn on_state(&self, robot: &RobotName, query: &Query) {
        let asked = StateQuery::read(|name| query.parameter(name));
        let state = asked.and_then(|asked| {
            let state = self.player.state(robot, asked);
            state.map_err(|reason| reason.to_string())
        });

        match state {
            Ok(state) => {
                if let Some(reply) = state.reply(Keys::last_chunk(query.key())) {
                    query.reply(query.key(), reply);
                }
            }
            Err(reason) => query.reply_err(&reason),
        }
    }

    /// Goes to a tick, from which it plays on if it was playing. Steps that are pending are given up.
    fn seek(&mut self, tick: Tick, frontend: &mut Frontend) -> Result<(), String> {
        let last = self.player.last();
        if tick > last {
            return Err(format!(
                "{}, which has no tick {tick}: its last one is {last}",
                self.what_it_is()
            ));
        }
        // Before anything is changed: where the tick cannot be read, the replay stays as it is.
        self.player.seek(tick).map_err(|error| error.to_string())?;

        let known = if frontend.observers.has_subscribers() {
            self.player.earlier_flights()
        } else {
            Vec::new()
        };
        frontend.observers.jump(known);
        frontend.pace.pending_steps = 0;
        frontend.pace.due = Instant::now();
        self.answer_stepping(frontend);
        Ok(())
    }
}

//! A recorded run in the place of the simulator: what its observers saw is put again, on the same keys, and control also
//! seeks.
//!
//! No robot takes part, and no clock is put: a robot that receives a clock answers it, and ticks of a recording do not take
//! place.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Publisher, Query};
use lockstep::StateQuery;
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{
    Control, ControlAnswer, JoinAnswer, LogKind, LogRecord, OnLate, Panel, Phase, Presence,
    Refusal, RobotStatus, Status,
};
use protocol::time::time_s;
use protocol::{RobotName, RunName, Tick, decode, encode};
use recording::{Recording, RecordingError};

use config::diagnostic::Source;
use scenario::Scenario;

use super::answer::refuse;
use super::control::answer_setup;
use super::inbox::{Events, Inbox, Work, inbox};
use super::observers::{FRAME_INTERVAL, Observers};
use super::pace::Pace;
use super::player::Player;

/// Most ticks that are shown in one go, before other requests are looked for.
const MAX_TICKS_AT_ONCE: usize = 16;

/// How a recording is replayed.
#[derive(Debug, Clone)]
pub struct ReplayOptions {
    /// Name of the run in the keys.
    pub run: RunName,
    /// Simulated seconds per second; `None` is as fast as possible.
    pub speed: Option<f64>,
    /// Whether it waits for `start` at tick 0.
    pub is_paused: bool,
}

/// Why a recording cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// It has no tick.
    #[error("the recording of run {0} has no complete tick")]
    Empty(RunName),
}

/// A replay: shows a recording on the keys of a run in progress.
pub struct Replay {
    options: ReplayOptions,
    bus: Bus,
    keys: Keys,
    inbox: Inbox<Self>,
    events: Events<Self>,
    declared: Vec<Declared>,
    robots: BTreeMap<RobotName, ShownRobot>,
    observers: Observers,
    pace: Pace,
    player: Player,
    /// When frame and panels were put last.
    shown_at: Instant,
}

/// What is put in the place of a robot.
struct ShownRobot {
    state: Publisher,
    panel: Publisher,
    /// In ticks for which it reported.
    token: Option<Declared>,
    /// When the panel arrived that is shown; none if none is.
    panel_arrived: Option<Tick>,
    /// Whether the panel has not been put since it, or the observers, changed.
    is_panel_due: bool,
}

/// What can happen to a replay.
pub(super) enum Event {
    /// A robot asks to take part.
    Join(Query),
    /// An operator asks for something.
    Control(Query),
    /// An observer asks for the state of a robot.
    State(RobotName, Query),
    /// The process is asked to end.
    Terminate,
}

/// The replay is over.
pub(super) struct Over;

impl Replay {
    /// Declares on an open bus what the simulator and the robots of the recorded run declared for observers.
    ///
    /// # Errors
    /// [`ReplayError`] if something cannot be declared, or the recording has no tick that can be read.
    pub fn open(
        bus: Bus,
        recording: Recording,
        options: ReplayOptions,
    ) -> Result<Self, ReplayError> {
        if recording.is_empty() {
            return Err(ReplayError::Empty(recording.header().run.clone()));
        }

        let keys = Keys::new(&options.run);
        let mut robots = BTreeMap::new();
        for name in &recording.header().robots {
            let robot = ShownRobot {
                state: bus.observer_publisher(&keys.query(name, STATE))?,
                panel: bus.observer_publisher(&keys.panel(name))?,
                token: None,
                panel_arrived: None,
                is_panel_due: true,
            };
            robots.insert(name.clone(), robot);
        }

        let (inbox, events) = inbox();
        let mut replay = Self {
            player: Player::open(recording)?,
            pace: Pace::new(options.speed, options.is_paused),
            observers: Observers::new(&bus, &keys)?,
            shown_at: Instant::now(),
            declared: Vec::new(),
            robots,
            options,
            bus,
            keys,
            inbox,
            events,
        };
        replay.pace.ready();
        replay.declare()?;
        Ok(replay)
    }

    /// What ends the replay, from any thread: a signal, for example.
    pub fn stopper(&self) -> impl Fn() + Clone + Send + Sync + 'static {
        let inbox = self.inbox.clone();
        move || inbox.send(Event::Terminate)
    }

    /// Declares what is answered; the simulator's token last.
    fn declare(&mut self) -> Result<(), BusError> {
        for (key, event) in [
            (self.keys.join(), Event::Join as fn(Query) -> Event),
            (self.keys.joins(), Event::Join),
            (self.keys.control(), Event::Control),
        ] {
            let inbox = self.inbox.clone();
            self.declared.push(self.bus.queryable(&key, move |query| {
                inbox.send(event(query));
            })?);
        }

        for name in self.robots.keys() {
            for what in QUERIES.iter().chain([&STATE]) {
                let inbox = self.inbox.clone();
                let robot = name.clone();
                let key = self.keys.query(name, what);
                self.declared.push(self.bus.queryable(&key, move |query| {
                    inbox.send(Event::State(robot.clone(), query));
                })?);
            }
        }

        self.declared.push(self.bus.token(&self.keys.alive_sim())?);
        Ok(())
    }

    /// Shows tick after tick until it is stopped. At the end of the recording its last tick stays.
    pub fn run(mut self) {
        self.put_tick();
        if self.player.is_at_end() {
            self.hold();
        }

        let inbox = self.inbox.clone();
        let (mut replay, Over) = inbox.run(self);

        replay.pace.end();
        replay.answer_stepping();
        replay.show();
        replay.declared.clear();
        replay.robots.clear();
        replay.bus.close();
    }

    /// Shows the next tick.
    fn advance(&mut self) {
        if let Err(error) = self.player.advance() {
            return self.fail(&error);
        }
        self.put_tick();
        if self.player.is_at_end() {
            self.hold();
        }

        if let Some((query, _)) = self.pace.reached(self.player.tick()) {
            self.answer_status(&query);
        }
        if self.is_held() || self.shown_at.elapsed() >= FRAME_INTERVAL {
            self.show();
        }
    }

    /// Whether the tick that is shown stays until a request.
    fn is_held(&self) -> bool {
        self.pace.phase != Phase::Running && self.pace.pending_steps == 0
    }

    /// The next tick cannot be read: the replay stays where it is.
    fn fail(&mut self, error: &RecordingError) {
        tracing::warn!("{error}");
        self.hold();
        if let Some(query) = self.pace.give_up_stepping() {
            refuse(&query, &error.to_string());
        }
        self.show();
    }

    fn hold(&mut self) {
        self.pace.phase = Phase::Paused;
        self.pace.pending_steps = 0;
    }

    /// Puts what observers receive of every tick.
    fn put_tick(&mut self) {
        let player = &self.player;
        self.observers.note(player.tick(), player.events());
        self.observers.log(&player.log());

        for (name, robot) in &mut self.robots {
            if robot.state.has_subscribers()
                && let Some(state) = player.new_state(name)
            {
                put(&robot.state, encode(&state));
            }
            let arrived = player.panel(name).map(|(arrived, _)| *arrived);
            if arrived != robot.panel_arrived {
                robot.panel_arrived = arrived;
                robot.is_panel_due = true;
            }
        }
        if let Err(error) = self.declare_presence() {
            tracing::debug!("{error}");
        }
    }

    /// Declares the tokens of the robots that are present in the tick.
    fn declare_presence(&mut self) -> Result<(), BusError> {
        for (name, robot) in &mut self.robots {
            let mut shown = self.player.robots().iter();
            let is_present =
                shown.any(|shown| shown.name == *name && shown.presence == Presence::Here);
            if !is_present {
                robot.token = None;
            } else if robot.token.is_none() {
                robot.token = Some(self.bus.token(&self.keys.alive_robot(name))?);
            }
        }
        Ok(())
    }

    /// Puts the frame of the tick, and the panels that have changed.
    fn show(&mut self) {
        self.shown_at = Instant::now();
        if self.observers.has_subscribers() {
            let frame = self.player.frame(&self.status());
            self.observers.put(frame);
        }

        for (name, robot) in &mut self.robots {
            if !robot.is_panel_due || !robot.panel.has_subscribers() {
                continue;
            }
            robot.is_panel_due = false;
            // A panel without widgets takes the place of one that is too old.
            let panel = match self.player.panel(name) {
                Some((_, panel)) => encode(panel),
                None => encode(&Panel::default()),
            };
            put(&robot.panel, panel);
        }
    }

    /// Shows the tick to observers that may not have seen it.
    fn show_again(&mut self) {
        for robot in self.robots.values_mut() {
            robot.is_panel_due = true;
        }
        self.show();
    }
}

/// Requests.
impl Replay {
    /// One event. The arms call; they do not decide.
    fn handle(&mut self, event: Event) -> Result<(), Over> {
        match event {
            Event::Join(query) => self.refuse_join(&query),
            Event::Control(query) => self.on_control(query)?,
            Event::State(robot, query) => self.on_state(&robot, &query),
            Event::Terminate => return Err(Over),
        }
        Ok(())
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

    fn on_control(&mut self, query: Query) -> Result<(), Over> {
        let control = match decode::<Control>(query.key(), "an operator", &query.body()) {
            Ok(control) => control,
            Err(error) => {
                refuse(&query, &error.to_string());
                return Ok(());
            }
        };

        match control {
            Control::Step { n } => self.on_step(n, query),
            Control::Setup => self.answer_setup(&query),
            Control::Log => self.observers.answer_log(&query),
            Control::Stop => {
                self.answer_status(&query);
                return Err(Over);
            }
            other => match self.act(&other) {
                Ok(()) => {
                    self.answer_status(&query);
                    self.show_again();
                }
                Err(explanation) => refuse(&query, &explanation),
            },
        }

        Ok(())
    }

    fn act(&mut self, control: &Control) -> Result<(), String> {
        match control {
            Control::Status => {}
            Control::Start if self.player.is_at_end() => return Err(self.at_end()),
            Control::Start => self.pace.start()?,
            Control::Pause => {
                self.pace.pause()?;
                self.answer_stepping();
            }
            Control::Speed { factor } => self.pace.set_speed(*factor)?,
            Control::Seek { tick } => {
                self.seek(*tick)?;
                if self.pace.phase == Phase::Ready {
                    self.pace.phase = Phase::Paused;
                }

                self.log_seek();
                self.put_tick();
            }
            Control::Init {
                seed: None,
                setup: None,
                ..
            } => {
                self.seek(0)?;
                self.pace.phase = Phase::Ready;
                self.put_tick();
            }
            Control::Init { .. }
            | Control::Load { .. }
            | Control::Late { .. }
            | Control::Intervene { .. }
            | Control::FaultsDone { .. }
            | Control::ProcessEnded { .. } => {
                return Err(format!("{}: it cannot be changed", self.what_it_is()));
            }
            Control::Step { .. } | Control::Setup | Control::Log | Control::Stop => {
                unreachable!("handled by on_control")
            }
        }

        Ok(())
    }

    /// Goes to a tick, from which it plays on if it was playing. Steps that are pending are given up.
    fn seek(&mut self, tick: Tick) -> Result<(), String> {
        let last = self.player.last();
        if tick > last {
            return Err(format!(
                "{}, which has no tick {tick}: its last one is {last}",
                self.what_it_is()
            ));
        }
        self.player.seek(tick).map_err(|error| error.to_string())?;

        self.observers.forget();
        self.pace.pending_steps = 0;
        self.pace.due = Instant::now();
        self.answer_stepping();
        if self.player.is_at_end() {
            self.hold();
        }
        Ok(())
    }

    /// Notes in the log that the lines that follow do not continue those before.
    fn log_seek(&mut self) {
        let header = self.player.header();
        let tick = self.player.tick();
        self.observers.log(&[LogRecord {
            epoch: header.epoch,
            tick,
            time_s: time_s(tick, header.tick_s),
            tick_s: header.tick_s,
            source: "simulator".to_owned(),
            kind: LogKind::Run,
            text: format!("the replay continues at tick {tick}"),
        }]);
    }

    fn on_step(&mut self, n: u64, query: Query) {
        if self.player.is_at_end() {
            return refuse(&query, &self.at_end());
        }
        if let Err(explanation) = self.pace.step(n) {
            return refuse(&query, &explanation);
        }

        let until = self.player.tick() + self.pace.pending_steps;
        let until = until.min(self.player.last());
        // Only the last client to step is kept waiting.
        if let Some((earlier, _)) = self.pace.stepping.replace((query, until)) {
            self.answer_status(&earlier);
        }
    }

    fn at_end(&self) -> String {
        format!(
            "the replay is at the last tick of its recording, {}; `init` and `seek` go back",
            self.player.tick()
        )
    }

    fn answer_stepping(&mut self) {
        if let Some(query) = self.pace.give_up_stepping() {
            self.answer_status(&query);
        }
    }

    fn answer_setup(&self, query: &Query) {
        let text = match self.player.scenario() {
            Ok(text) => text,
            Err(error) => return refuse(query, &error.to_string()),
        };
        let source = Source {
            name: "the recorded scenario".to_owned(),
            text,
        };
        match Scenario::parse_alone(&source) {
            Ok(scenario) => answer_setup(query, &scenario),
            Err(error) => refuse(query, &error.in_words()),
        }
    }

    fn answer_status(&self, query: &Query) {
        let answer = ControlAnswer::Done(Box::new(self.status()));
        query.reply(query.key(), encode(&answer));
    }

    /// How things stand, as the simulator states it. A replay waits for no robot, and so its robots are never late.
    fn status(&self) -> Status {
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
            run: self.options.run.clone(),
            epoch: header.epoch,
            tick,
            pending_steps: self.pace.pending_steps,
            time_s: time_s(tick, header.tick_s),
            duration_s: header.duration_s,
            tick_s: header.tick_s,
            seed: header.seed,
            replay_of: Some(header.run.clone()),
            phase: self.pace.phase,
            speed: self.pace.speed,
            on_late: OnLate::Wait,
            deadline_s: 0.0,
            awaiting: Vec::new(),
            robots,
            ignored: BTreeMap::new(),
        }
    }
}

impl Work for Replay {
    type Event = Event;
    type Interrupt = Over;

    fn work(&mut self) -> Result<Option<Duration>, Over> {
        for _ in 0..MAX_TICKS_AT_ONCE {
            while let Some(event) = self.events.try_next() {
                self.handle(event)?;
            }
            let tick_s = self.player.header().tick_s;
            if let Err(patience) = self.pace.take_grant(tick_s) {
                return Ok(patience);
            }
            self.advance();
        }
        Ok(Some(Duration::ZERO))
    }
}

/// What observers cannot receive is worth no more than a note.
fn put(publisher: &Publisher, message: Vec<u8>) {
    if let Err(error) = publisher.put(message) {
        tracing::debug!("{error}");
    }
}

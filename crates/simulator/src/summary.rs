//! What came of a run, as data: the table at the end of a run and every later report are made from it.

mod network;

use std::collections::BTreeMap;
use std::time::Instant;

use protocol::messages::{End, StateVariables};
use protocol::{Event, Line, RobotName, RunName, Tick};
use serde::{Deserialize, Serialize};

pub use network::{CutSummary, LinkSummary, NetworkSummary};

use crate::simulation::Simulation;

/// `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The run.
    pub run: RunName,
    /// Seed.
    pub seed: u64,
    /// Version of the simulator.
    pub version: String,
    /// How it ended; absent while it runs.
    pub end: Option<End>,
    /// Complete ticks after tick 0.
    pub ticks: Tick,
    /// Simulated time, seconds.
    pub time_s: f64,
    /// Number of guests.
    pub guests: usize,
    /// Digest of the run.
    pub digest: String,
    /// The robots.
    pub robots: BTreeMap<RobotName, RobotSummary>,
    /// What the network did.
    #[serde(default)]
    pub network: NetworkSummary,
    /// Wall-clock matters; they differ from run to run.
    pub wall: Wall,
    #[serde(skip)]
    begun: Option<Instant>,
    #[serde(skip)]
    since: BTreeMap<RobotName, Since>,
}

/// What came of one robot.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RobotSummary {
    /// Simulated seconds in each emotion.
    pub emotions_s: BTreeMap<String, f64>,
    /// Simulated seconds in each behavior.
    pub behaviors_s: BTreeMap<String, f64>,
    /// How often it entered each behavior, the first one included.
    pub entered: BTreeMap<String, u64>,
    /// Moves that were refused.
    pub blocked: u64,
    /// Commands it sent, by what they say.
    pub sent: BTreeMap<String, u64>,
    /// Commands that reached it.
    pub received: u64,
    /// Commands to it that the medium lost.
    pub dropped: u64,
    /// Ticks it missed.
    pub missed: u64,
    /// Incarnations after the first.
    pub returns: u64,
    /// What it published last.
    pub state_variables: StateVariables,
}

/// Wall-clock matters.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Wall {
    /// How long the run took, seconds.
    pub elapsed_s: f64,
    /// Who held up the run: robots for which the clock was held long enough for people to be told.
    pub held_up_by: BTreeMap<RobotName, HeldUp>,
    /// Messages that were ignored, by reason.
    pub ignored: BTreeMap<String, u64>,
}

/// How much a robot held up a run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct HeldUp {
    /// Ticks in which the clock was held for it.
    pub ticks: u64,
    /// Time that these ticks took, seconds.
    pub waited_s: f64,
    /// The longest of these waits, seconds.
    pub longest_s: f64,
}

/// The emotion and behavior that a robot is in, and from which tick on.
#[derive(Debug, Clone, PartialEq, Default)]
struct Since {
    emotion: Option<(String, Tick)>,
    behavior: Option<(String, Tick)>,
}

impl Summary {
    /// An epoch begins.
    #[must_use]
    pub fn begin(run: &RunName, simulation: &Simulation) -> Self {
        let robots = simulation
            .names()
            .iter()
            .map(|name| (name.clone(), RobotSummary::default()))
            .collect();

        Self {
            run: run.clone(),
            seed: simulation.scenario().seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            end: None,
            ticks: 0,
            time_s: 0.0,
            guests: simulation.scenario().guests.count,
            digest: String::new(),
            robots,
            network: NetworkSummary::default(),
            wall: Wall::default(),
            begun: None,
            since: BTreeMap::new(),
        }
    }

    /// Counts an event.
    pub fn count(&mut self, simulation: &Simulation, line: &Line) {
        let tick_s = simulation.scenario().tick_s;
        self.network.count(simulation, line.tick, &line.event);

        match &line.event {
            Event::Emotion { robot, to, .. } => self.enter_emotion(robot, to, line.tick, tick_s),
            Event::Behavior { robot, to, .. } => self.enter_behavior(robot, to, line.tick, tick_s),
            Event::Blocked { robot, .. } => self.robot(robot).blocked += 1,
            Event::CommandSent { from, command, .. } => {
                *self.robot(from).sent.entry(command.clone()).or_default() += 1;
            }
            Event::CommandDelivered { to, .. } => self.robot(to).received += 1,
            Event::CommandDropped { to, .. } => self.robot(to).dropped += 1,
            Event::Missed { robot } => self.robot(robot).missed += 1,
            Event::Joined {
                robot,
                generation: Some(_),
                ..
            } => self.robot(robot).returns += 1,
            Event::End { reason, digest } => {
                self.end = Some(*reason);
                self.digest.clone_from(digest);
            }
            // What came before, waiting for robots to join, is not part of the epoch.
            Event::Init { .. } => self.begun = Some(Instant::now()),
            _ => {}
        }
    }

    fn robot(&mut self, name: &RobotName) -> &mut RobotSummary {
        self.robots.entry(name.clone()).or_default()
    }

    fn enter_emotion(&mut self, robot: &RobotName, to: &str, tick: Tick, tick_s: f64) {
        let since = self.since.entry(robot.clone()).or_default();
        let left = since.emotion.replace((to.to_owned(), tick));
        add(&mut self.robot(robot).emotions_s, left, tick, tick_s);
    }

    fn enter_behavior(&mut self, robot: &RobotName, to: &str, tick: Tick, tick_s: f64) {
        let since = self.since.entry(robot.clone()).or_default();
        let left = since.behavior.replace((to.to_owned(), tick));
        let robot = self.robot(robot);
        add(&mut robot.behaviors_s, left, tick, tick_s);
        *robot.entered.entry(to.to_owned()).or_default() += 1;
    }

    /// The epoch is over.
    pub fn finish(&mut self, simulation: &Simulation) {
        (self.ticks, self.time_s) = (simulation.tick(), simulation.time_s(simulation.tick()));
        self.digest = simulation.digest();

        for (robot, since) in std::mem::take(&mut self.since) {
            let (ticks, tick_s) = (self.ticks, simulation.scenario().tick_s);
            let own = self.robot(&robot);
            add(&mut own.emotions_s, since.emotion, ticks, tick_s);
            add(&mut own.behaviors_s, since.behavior, ticks, tick_s);
            own.state_variables = simulation
                .state_variables(&robot)
                .cloned()
                .unwrap_or_default();
        }

        self.wall.elapsed_s = self
            .begun
            .map_or(0.0, |begun| begun.elapsed().as_secs_f64());
    }
}

fn add(times_s: &mut BTreeMap<String, f64>, left: Option<(String, Tick)>, now: Tick, tick_s: f64) {
    if let Some((state, since)) = left {
        *times_s.entry(state).or_default() += (now - since) as f64 * tick_s;
    }
}

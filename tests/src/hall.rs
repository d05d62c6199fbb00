//! The hall in this process, tick by tick, where a test must see what no record shows: who is where.

use std::path::Path;

use lab::run::Local;
use protocol::messages::Point;
use protocol::{RobotName, RunName};
use robot::LocalHost;
use simulator::scenario::Changes;
use simulator::{Event, Scenario, Simulation};

use crate::root;

/// A hall with its robots.
pub struct Hall {
    /// The simulation.
    pub simulation: Simulation,
    robots: LocalHost,
}

/// A shipped scenario with changes.
#[must_use]
pub fn scenario(file: &str, seed: u64, set: &[&str]) -> Scenario {
    let set = set
        .iter()
        .map(|change| change.parse().expect("a legal change"))
        .collect();
    let changes = Changes {
        seed: Some(seed),
        duration_s: None,
        set,
    };
    let file = root().join(Path::new(file));

    Scenario::load(&file, &changes).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

impl Hall {
    /// Sets a scenario up and initializes it.
    #[must_use]
    pub fn new(scenario: Scenario) -> Self {
        let run = RunName::new("hall").expect("a legal name");
        let Local {
            mut simulation,
            mut robots,
        } = Local::new(scenario, &run).expect("the hall can be set up");
        simulation
            .init(&mut robots)
            .expect("the parameters are good");
        Self { simulation, robots }
    }

    /// One tick; returns what happened.
    pub fn step(&mut self) -> Vec<Event> {
        self.simulation
            .step(&mut self.robots)
            .expect("only tick 0 can fail")
            .events
    }

    /// Simulated time, seconds.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.simulation.time_s(self.simulation.tick())
    }

    /// Where a robot is.
    #[must_use]
    pub fn at(&self, robot: &str) -> Point {
        self.simulation
            .location(&name(robot))
            .expect("it is of the roster")
    }

    /// A robot's emotion.
    #[must_use]
    pub fn emotion(&self, robot: &str) -> String {
        self.simulation
            .report(&name(robot))
            .map(|report| report.emotion_state.clone())
            .unwrap_or_default()
    }

    /// A robot's behavior.
    #[must_use]
    pub fn behavior(&self, robot: &str) -> String {
        self.simulation
            .report(&name(robot))
            .map(|report| report.behavior_state.clone())
            .unwrap_or_default()
    }

    /// A number that a robot publishes.
    #[must_use]
    pub fn number(&self, robot: &str, variable: &str) -> f64 {
        let variables = self
            .simulation
            .state_variables(&name(robot))
            .expect("it has reported");
        let value = variables
            .get(variable)
            .unwrap_or_else(|| panic!("{robot} does not publish {variable}"));

        value
            .as_f64()
            .unwrap_or_else(|| panic!("{variable} of {robot} is no number"))
    }
}

fn name(robot: &str) -> RobotName {
    RobotName::new(robot).expect("a legal name")
}

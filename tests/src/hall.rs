//! The hall in this process, tick by tick, for tests that need the locations of robots, which are not in the record.

use std::path::Path;

use environment::{Event, Simulation};
use lab::run::Local;
use protocol::messages::{Point, StateVariables};
use protocol::{RobotName, RunName};
use robot::LocalHost;
use scenario::Changes;
use scenario::Scenario;

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
    let set = set.iter();
    let set = set.map(|change| change.parse().expect("a legal change"));
    let changes = Changes {
        seed: Some(seed),
        set: set.collect(),
        ..Changes::default()
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

    /// Runs one tick; returns its events.
    pub fn step(&mut self) -> Vec<Event> {
        let record = self.simulation.step(&mut self.robots);
        record.expect("only tick 0 can fail").events.to_vec()
    }

    /// Simulated time, seconds.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.simulation.time_s(self.simulation.tick())
    }

    /// Location of a robot.
    #[must_use]
    pub fn at(&self, robot: &str) -> Point {
        let location = self.simulation.location(&name(robot));
        location.expect("it is in the roster")
    }

    /// Emotion of a robot; empty before its first report.
    #[must_use]
    pub fn emotion(&self, robot: &str) -> String {
        let report = self.simulation.report(&name(robot));
        report.map_or_else(String::new, |report| report.emotion_state.clone())
    }

    /// Speed of a robot as it reports it, m/s; 0 before its first report.
    #[must_use]
    pub fn speed_mps(&self, robot: &str) -> f64 {
        let report = self.simulation.report(&name(robot));
        report.map_or(0.0, |report| report.speed_mps)
    }

    /// Behavior of a robot; empty before its first report.
    #[must_use]
    pub fn behavior(&self, robot: &str) -> String {
        let report = self.simulation.report(&name(robot));
        report.map_or_else(String::new, |report| report.behavior_state.clone())
    }

    /// A state variable of a robot that is a number.
    #[must_use]
    pub fn number(&self, robot: &str, variable: &str) -> f64 {
        let value = self.variables(robot).get(variable);
        let number = value.and_then(protocol::messages::Variable::as_f64);
        number.unwrap_or_else(|| panic!("{robot} does not publish a number {variable}"))
    }

    /// State variables of a robot.
    #[must_use]
    pub fn variables(&self, robot: &str) -> &StateVariables {
        let variables = self.simulation.state_variables(&name(robot));
        variables.expect("it has reported")
    }

    /// Flag among the state variables of a robot.
    #[must_use]
    pub fn flag(&self, robot: &str, variable: &str) -> bool {
        let value = self.variables(robot).get(variable);
        let flag = value.and_then(protocol::messages::Variable::as_bool);
        flag.unwrap_or_else(|| panic!("{robot} does not publish a flag {variable}"))
    }
}

fn name(robot: &str) -> RobotName {
    RobotName::new(robot).expect("a legal name")
}

//! What several tests of the environment need.

use std::path::Path;

use environment::medium::{Medium, SentCommand};
use protocol::messages::{CommandText, Point, Report, StateVariables};
use protocol::{RobotName, Tick};
use scenario::Scenario;
use scenario::diagnostic::{FileError, Source};

pub(crate) fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

/// Reads a scenario file with this text.
pub(crate) fn parse(text: &str) -> Result<Scenario, FileError> {
    let source = Source {
        name: "test".to_owned(),
        text: text.to_owned(),
    };
    Scenario::parse(&source, Path::new("."))
}

/// The scenario of a file with this text, which is right.
pub(crate) fn scenario(text: &str) -> Scenario {
    parse(text).unwrap_or_else(|error| panic!("{}", error.in_words()))
}

/// The network of a scenario file with this text, by itself.
pub(crate) fn medium_of(text: &str) -> Medium {
    let scenario = scenario(text);
    let roster = scenario.roster();
    Medium::new(scenario.seed, scenario.tick_s, scenario.network, roster)
}

/// A command as a robot puts it.
pub(crate) fn command(from: &str, to: &str, seq: u64) -> SentCommand {
    SentCommand {
        to: name(to),
        from: name(from),
        seq,
        text: CommandText::named("refill"),
    }
}

/// The report of a robot of epoch 1 that does nothing but propose a place.
pub(crate) fn report(tick: Tick, proposal: Point) -> Report {
    Report {
        epoch: 1,
        tick,
        generation: 1,
        proposal,
        speed_mps: 0.0,
        direction_rad: 0.0,
        emotion_state: "CALM".to_owned(),
        behavior_state: "IDLE".to_owned(),
        state_variables: StateVariables::new(),
        commands: 0,
        log: Vec::new(),
        site_actions: Vec::new(),
        layer_actions: Vec::new(),
        velocity: None,
    }
}

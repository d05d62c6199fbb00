//! What the robots of a scenario do when it is played in this process.

use std::collections::{BTreeMap, BTreeSet};

use miette::IntoDiagnostic;
use protocol::messages::PublicState;
use protocol::{Event, RobotName, RunName, Tick};
use simulator::{Scenario, Simulation, TickRecord};

use crate::run::play;

/// What one robot did.
#[derive(Debug, Clone, Default)]
pub struct Performance {
    /// Its states, tick by tick, as far as it was asked to be kept.
    pub states: Vec<PublicState>,
    /// Commands that were sent to it, each once, in the order in which they first were.
    pub commands: Vec<String>,
}

/// Plays a scenario and keeps what its robots did, with their states up to tick `ticks`. `None` if a robot is of a class
/// that cannot run in this process.
///
/// # Errors
/// If the scenario cannot be played.
pub fn performances(
    scenario: Scenario,
    ticks: Tick,
) -> miette::Result<Option<BTreeMap<RobotName, Performance>>> {
    let classes: BTreeSet<&str> = scenario
        .robots
        .values()
        .map(|spec| spec.class.as_str())
        .collect();
    if classes.iter().any(|class| robots::make(class).is_none()) {
        return Ok(None);
    }

    let mut performances: BTreeMap<RobotName, Performance> = BTreeMap::new();
    for name in scenario.robots.keys() {
        performances.insert(name.clone(), Performance::default());
    }
    let run = RunName::new("conform").into_diagnostic()?;
    play(scenario, &run, |simulation, record| {
        keep(&mut performances, ticks, simulation, record);
        Ok(())
    })?;
    Ok(Some(performances))
}

/// Keeps what happened in a tick.
fn keep(
    performances: &mut BTreeMap<RobotName, Performance>,
    ticks: Tick,
    simulation: &Simulation,
    record: &TickRecord,
) {
    for event in &record.events {
        let Event::CommandSent { to, command, .. } = event else {
            continue;
        };
        if let Some(performance) = performances.get_mut(to)
            && !performance.commands.contains(command)
        {
            performance.commands.push(command.clone());
        }
    }

    if record.tick > ticks {
        return;
    }
    for (name, performance) in performances {
        let (Some(report), Some(location)) = (simulation.report(name), simulation.location(name))
        else {
            continue;
        };
        performance.states.push(PublicState {
            epoch: report.epoch,
            tick: record.tick,
            location,
            speed_mps: report.speed_mps,
            direction_rad: report.direction_rad,
            state_variables: report.state_variables.clone(),
            emotion_state: report.emotion_state.clone(),
            behavior_state: report.behavior_state.clone(),
        });
    }
}

//! States and commands of the robots of a scenario, from a run in this process.

use environment::{Simulation, TickRecord};
use protocol::messages::PublicState;
use protocol::{Event, RobotName, RunName, Tick};
use scenario::Scenario;
use std::collections::BTreeMap;

use crate::error::LabError;
use crate::run::play;

/// States and received commands of one robot.
#[derive(Debug, Clone, Default)]
pub struct Performance {
    /// Its state in each tick, up to the tick given to [`performances`].
    pub states: Vec<PublicState>,
    /// Commands sent to it, without duplicates, in the order of their first use.
    pub commands: Vec<String>,
}

/// Plays a scenario and returns the commands to its robots, and their states up to tick `ticks`. `None` if a class of
/// robots cannot run in this process.
///
/// # Errors
/// If the scenario cannot be played.
pub fn performances(
    mut scenario: Scenario,
    ticks: Tick,
) -> Result<Option<BTreeMap<RobotName, Performance>>, LabError> {
    let mut performances = BTreeMap::new();
    for (name, spec) in &scenario.robots {
        if robots::make(&spec.class).is_none() {
            return Ok(None);
        }
        performances.insert(name.clone(), Performance::default());
    }

    // What robots do while all processes run.
    scenario.faults.clear();
    scenario.changes.clear();
    let run = RunName::unknown();
    play(scenario, &run, |simulation, record| {
        add_commands(&mut performances, record);
        if record.tick <= ticks {
            add_states(&mut performances, simulation, record.tick);
        }
        Ok(())
    })?;
    Ok(Some(performances))
}

fn add_commands(performances: &mut BTreeMap<RobotName, Performance>, record: &TickRecord) {
    for event in record.events.iter() {
        let Event::CommandSent { to, command, .. } = event else {
            continue;
        };
        if let Some(performance) = performances.get_mut(to)
            && !performance.commands.contains(command)
        {
            performance.commands.push(command.clone());
        }
    }
}

fn add_states(
    performances: &mut BTreeMap<RobotName, Performance>,
    simulation: &Simulation,
    tick: Tick,
) {
    for (name, performance) in performances {
        let Some(report) = simulation.report(name) else {
            continue;
        };
        let Some(location) = simulation.location(name) else {
            continue;
        };

        performance.states.push(PublicState {
            epoch: report.epoch,
            tick,
            location,
            speed_mps: report.speed_mps,
            direction_rad: report.direction_rad,
            state_variables: report.state_variables.clone(),
            emotion_state: report.emotion_state.clone(),
            behavior_state: report.behavior_state.clone(),
        });
    }
}

//! The field of a run in progress, as observers see it.

use std::collections::BTreeMap;

use environment::Simulation;
use protocol::RobotName;
use protocol::messages::{DisplayUnit, Presence, RobotFrame, Status, WorldFrame};

/// In every tick the clock waits a short time for each robot.
const LATE_S: f64 = 0.5;

/// The field now, without flights. `held` are robots whose processes are killed or stopped for a time, and without which the clock
/// may have gone on.
pub(super) fn frame(
    simulation: &Simulation,
    status: &Status,
    held: impl IntoIterator<Item = RobotName>,
) -> WorldFrame {
    let world = simulation.world();
    let scenario = simulation.scenario();

    let mut late: Vec<RobotName> = held.into_iter().collect();
    for awaited in &status.awaiting {
        if awaited.since_s > LATE_S {
            late.push(awaited.name.clone());
        }
    }

    let mut robots = Vec::with_capacity(simulation.names().len());
    for name in simulation.names() {
        robots.push(robot_frame(simulation, status, name));
    }

    WorldFrame {
        robots,
        // In whole millimeters, as in the recording: a tick looks the same live and recorded.
        guests: simulation
            .shown_guests()
            .map(|(_, guest)| [millimeters(guest.x), millimeters(guest.y)])
            .collect(),
        guest_numbers: simulation.guest_numbers(),
        obstacles: world
            .obstacles()
            .iter()
            .map(|obstacle| [obstacle.x, obstacle.y])
            .collect(),
        guest_moods: simulation.guest_moods(),
        sites: simulation.sites().frames(),
        layers: simulation.layers().frames(),
        cuts: simulation.cuts(),
        faults: simulation.held_processes(&late),
        expectations: simulation.standings(),
        measures: simulation.measurements().numbers(),
        display_unit: scenario.display_unit,
        ..empty_frame(status, scenario.field_m, scenario.body_m)
    }
}

/// A frame of how things stand, with nothing on the field.
pub(super) fn empty_frame(status: &Status, field_m: [f64; 2], body_m: f64) -> WorldFrame {
    WorldFrame {
        run: status.run.clone(),
        epoch: status.epoch,
        tick: status.tick,
        time_s: status.time_s,
        duration_s: status.duration_s,
        tick_s: status.tick_s,
        seed: status.seed,
        replay_of: status.replay_of.clone(),
        jumps: 0,
        speed: status.speed,
        phase: status.phase,
        awaiting: status.awaiting.clone(),
        field_m,
        body_m,
        display_unit: DisplayUnit::default(),
        robots: Vec::new(),
        guests: Vec::new(),
        guest_numbers: Vec::new(),
        guest_moods: BTreeMap::new(),
        obstacles: Vec::new(),
        static_world: None,
        sites: Vec::new(),
        layers: Vec::new(),
        flights: Vec::new(),
        cuts: Vec::new(),
        faults: Vec::new(),
        expectations: Vec::new(),
        measures: BTreeMap::new(),
    }
}

/// A robot now.
fn robot_frame(simulation: &Simulation, status: &Status, name: &RobotName) -> RobotFrame {
    let report = simulation.report(name);
    let process = status.robots.iter().find(|robot| robot.name == *name);

    RobotFrame {
        name: name.clone(),
        location: simulation.location(name).unwrap_or_default(),
        speed_mps: report.map_or(0.0, |report| report.speed_mps),
        direction_rad: report.map_or(0.0, |report| report.direction_rad),
        heading_rad: simulation.pose(name).map(|pose| pose.heading_rad),
        blocked: simulation.is_blocked(name),
        emotion_state: report
            .map(|report| report.emotion_state.clone())
            .unwrap_or_default(),
        behavior_state: report
            .map(|report| report.behavior_state.clone())
            .unwrap_or_default(),
        state_variables: report
            .map(|report| report.state_variables.clone())
            .unwrap_or_default(),
        generation: process.map_or(0, |process| process.generation),
        presence: process.map_or(Presence::Gone, |process| process.presence),
    }
}

/// A length in meters, rounded to whole millimeters.
fn millimeters(length_m: f64) -> f64 {
    (length_m * 1000.0).round() / 1000.0
}

//! What a recording has of a simulation: its header, and the field after each tick.

use protocol::{PROTOCOL_VERSION, RunName};
use recording::content::Missed;
use recording::{Frame, Header, PlacedRobot};

use crate::layers::Layers;
use crate::simulation::{Simulation, TickRecord};
use crate::sites::Sites;
use crate::static_world::static_world;

/// The header of the recording of an epoch.
#[must_use]
pub fn header(run: &RunName, simulation: &Simulation) -> Header {
    let scenario = simulation.scenario();

    Header {
        run: run.clone(),
        epoch: simulation.epoch(),
        seed: scenario.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        commit: option_env!("CARS_COMMIT").map(str::to_owned),
        protocol: PROTOCOL_VERSION,
        tick_s: scenario.tick_s,
        duration_s: scenario.duration_s(),
        field_m: scenario.field_m,
        body_m: scenario.body_m,
        display_unit: scenario.display_unit,
        obstacles: scenario
            .obstacles
            .iter()
            .map(|obstacle| [obstacle.at.x, obstacle.at.y])
            .collect(),
        static_world: static_world(scenario),
        sites: Sites::new(scenario).frames(),
        layers: Layers::new(scenario).frames(),
        robots: simulation.names().to_vec(),
    }
}

/// The field after a tick that is complete.
#[must_use]
pub fn frame(simulation: &Simulation, record: &TickRecord) -> Frame {
    let mut frame = Frame::default();
    set_frame(&mut frame, simulation, record);
    frame
}

/// Sets the field after a tick. Its memory is used again, because what takes a kilobyte and more takes long to get.
pub fn set_frame(frame: &mut Frame, simulation: &Simulation, record: &TickRecord) {
    frame.robots.clear();
    for name in simulation.names() {
        let last = simulation.report(name);
        let is_missed = last.is_none_or(|report| report.tick != record.tick);
        frame.robots.push(PlacedRobot {
            name: name.clone(),
            location: simulation.location(name).unwrap_or_default(),
            heading_rad: simulation.pose(name).map(|pose| pose.heading_rad),
            blocked: simulation.is_blocked(name),
            missed: is_missed.then(|| Missed {
                last_report: last.map(|report| report.tick),
            }),
        });
    }

    frame.guests_mm.clear();
    for (_, guest) in simulation.shown_guests() {
        frame.guests_mm.push((guest.x * 1000.0).round() as i64);
        frame.guests_mm.push((guest.y * 1000.0).round() as i64);
    }

    frame.guest_numbers = simulation.guest_numbers();
    frame.guest_moods = simulation.guest_moods();
    frame.tick = record.tick;
    frame.sites = simulation.sites().changed();
    frame.layers = simulation.layers().changed();
    frame.cuts = simulation.cuts();
    frame.unreachable.clone_from(simulation.unreachable());
    frame.expectations = simulation.standings();
    frame.measures = simulation.measurements().numbers();
}

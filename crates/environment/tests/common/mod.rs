//! What several tests of the simulator need.

use protocol::Tick;
use protocol::messages::{Point, Report, StateVariables};

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

//! Rules that are local to one of the two types.

mod barrier;
mod edges;
mod missing;
mod participant;
mod queries;
mod welcomes;

use protocol::RobotName;
use protocol::messages::Clock;

use crate::{Admission, IncarnationNotice};

fn name(name: &str) -> RobotName {
    RobotName::new(name).expect("a name")
}
const ADMISSION: Admission = Admission {
    epoch: 1,
    generation: 1,
    news_flag: 1,
};

fn clock(epoch: u32, tick: u64) -> Clock {
    Clock {
        epoch,
        tick,
        ..Clock::default()
    }
}
fn joined(generation: u32) -> IncarnationNotice {
    IncarnationNotice {
        joined: Some(generation),
        rejoin: None,
    }
}

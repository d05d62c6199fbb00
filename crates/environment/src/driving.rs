//! Robots that drive like wheels: what they want, and what they are told.

use std::collections::BTreeSet;

use protocol::messages::{DriveLimits, Pose, Report, Velocity};
use protocol::{Event, RobotName, published_angle};
use scenario::to_wire;
use world::{Wheels, World};

/// Robots that propose what does not count.
#[derive(Debug, Clone, Default)]
pub(crate) struct Driving {
    /// Robots that have been warned.
    warned: BTreeSet<RobotName>,
}

impl Driving {
    /// Has a robot drive in the next tick as its report of the last one says. Without a report, or a velocity in it, it brakes.
    /// Returns a warning at the first report that proposes what does not count.
    pub(crate) fn drive<R>(
        &mut self,
        world: &mut World<R>,
        index: usize,
        name: &RobotName,
        report: Option<&Report>,
    ) -> Option<Event> {
        let wanted = report.and_then(|report| report.velocity);
        let drives = world.pose(index).is_some();
        if drives {
            let Velocity {
                linear_mps,
                angular_radps,
            } = wanted.unwrap_or_default();
            let wanted = world::Velocity {
                linear_mps,
                angular_radps,
            };
            world.drive(index, wanted);
        }

        let here = to_wire(world.robots()[index]);
        let proposes_place = report.is_some_and(|report| report.proposal != here);
        let because = match (drives, wanted) {
            (true, None) if proposes_place => {
                "it proposed a location, which is ignored: the scenario has it `drive`, so it must propose a velocity; it brakes"
            }
            (false, Some(_)) => {
                "it proposed a velocity, which is ignored: the scenario gives it no `drive`; the location that it proposed counts"
            }
            _ => return None,
        };
        let is_first = self.warned.insert(name.clone());
        is_first.then(|| Event::Warned {
            robot: name.clone(),
            text: because.to_owned(),
        })
    }
}

/// The limits of a robot in a field with this limit of speed, as it is told them.
#[must_use]
pub fn drive_limits(wheels: &Wheels, max_speed_mps: f64) -> DriveLimits {
    let limit = |number: f64| number.is_finite().then_some(number);
    DriveLimits {
        max_speed_mps: wheels.max_speed_mps.min(max_speed_mps),
        max_turn_radps: limit(wheels.max_turn_radps),
        max_acceleration_mps2: limit(wheels.max_acceleration_mps2),
        max_turn_acceleration_radps2: limit(wheels.max_turn_acceleration_radps2),
    }
}

/// The pose of a robot as its news and frames have it; `None` if it does not drive.
pub(crate) fn pose<R>(world: &World<R>, index: usize) -> Option<Pose> {
    let pose = world.pose(index)?;
    Some(Pose {
        location: to_wire(pose.center),
        heading_rad: published_angle(pose.heading_rad),
        velocity: Velocity {
            linear_mps: pose.velocity.linear_mps,
            angular_radps: pose.velocity.angular_radps,
        },
    })
}

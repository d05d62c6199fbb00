//! Robots that drive like wheels: a unicycle has a heading, and moves forward and turns within its limits.

use std::f64::consts::TAU;

use crate::point::Point;

/// The limits of a robot that drives like wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheels {
    /// Fastest turn, rad/s.
    pub max_turn_radps: f64,
    /// Largest change of the forward speed, m/s².
    pub max_acceleration_mps2: f64,
}

/// What such a robot proposes for a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    /// Speed along the heading, m/s; negative backward.
    pub forward_mps: f64,
    /// Turn, counter-clockwise, rad/s.
    pub turn_radps: f64,
}

/// Where such a robot stands, where it looks, and how fast it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Its center, m.
    pub center: Point,
    /// Its heading, counter-clockwise from +x, rad, in [-π, π] before it is rounded to
    /// whole millionths.
    pub heading_rad: f64,
    /// Its speed along the heading, m/s.
    pub forward_mps: f64,
}

/// Headings travel to robots in millionths of a radian, so that is what they are.
const HEADING_STEPS: f64 = 1e6;

impl Pose {
    /// A robot that stands still, with this heading.
    #[must_use]
    pub fn at_rest(center: Point, heading_rad: f64) -> Self {
        Self {
            center,
            heading_rad: whole_heading(heading_rad),
            forward_mps: 0.0,
        }
    }

    /// The pose after a tick of `tick_s` without a collision. The speed goes to the one that is wanted as far as the limits allow;
    /// the robot moves along the heading that it has in the middle of the tick. What is not finite counts as 0.
    #[must_use]
    pub fn driven(self, wheels: Wheels, wanted: Velocity, max_speed_mps: f64, tick_s: f64) -> Self {
        let turn_radps =
            finite(wanted.turn_radps).clamp(-wheels.max_turn_radps, wheels.max_turn_radps);
        let change_mps = wheels.max_acceleration_mps2 * tick_s;
        let forward_mps = finite(wanted.forward_mps)
            .clamp(self.forward_mps - change_mps, self.forward_mps + change_mps)
            .clamp(-max_speed_mps, max_speed_mps);

        let turned_rad = turn_radps * tick_s;
        let (sin, cos) = libm::sincos(self.heading_rad + turned_rad * 0.5);
        Self {
            center: self.center + Point::new(cos, sin) * (forward_mps * tick_s),
            heading_rad: whole_heading(self.heading_rad + turned_rad),
            forward_mps,
        }
    }

    /// The pose of a robot that was not advanced: it has turned all the same, and stands still.
    #[must_use]
    pub fn stopped_at(self, center: Point) -> Self {
        Self {
            center,
            forward_mps: 0.0,
            ..self
        }
    }
}

fn finite(number: f64) -> f64 {
    if number.is_finite() { number } else { 0.0 }
}

/// A heading in [-π, π], in whole millionths of a radian.
fn whole_heading(heading_rad: f64) -> f64 {
    let within_rad = libm::remainder(finite(heading_rad), TAU);

    (within_rad * HEADING_STEPS).round() / HEADING_STEPS
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::{Pose, Velocity, Wheels};
    use crate::point::Point;

    const WHEELS: Wheels = Wheels {
        max_turn_radps: 1.0,
        max_acceleration_mps2: 0.5,
    };

    fn drive(pose: Pose, forward_mps: f64, turn_radps: f64) -> Pose {
        let wanted = Velocity {
            forward_mps,
            turn_radps,
        };
        pose.driven(WHEELS, wanted, 1.0, 0.5)
    }

    #[test]
    fn speed_and_turn_stay_within_the_limits() {
        let mut pose = Pose::at_rest(Point::new(1.0, 1.0), 0.0);
        let mut speeds_mps = Vec::new();
        for _ in 0..6 {
            pose = drive(pose, 9.0, 0.0);
            speeds_mps.push(pose.forward_mps);
        }
        assert_eq!(speeds_mps, [0.25, 0.5, 0.75, 1.0, 1.0, 1.0]);
        assert_eq!(pose.center, Point::new(1.0 + 0.5 * 4.5, 1.0));

        let turned = drive(Pose::at_rest(Point::default(), 0.0), 0.0, -9.0);
        assert_eq!(turned.heading_rad, -0.5);
        assert_eq!(drive(pose, f64::NAN, f64::INFINITY).forward_mps, 0.75);
    }

    #[test]
    fn headings_are_whole_millionths_within_half_a_turn() {
        for (given, heading_rad) in [
            (0.0, 0.0),
            (1.0, 1.0),
            (-2.000_000_4, -2.0),
            (PI + 0.1, -3.041_593),
            (6.0 * PI, 0.0),
            (-13.0, -0.433_629),
            (f64::NAN, 0.0),
        ] {
            let pose = Pose::at_rest(Point::default(), given);
            assert_eq!(pose.heading_rad, heading_rad, "{given}");
        }
    }

    #[test]
    fn a_circle_closes() {
        let mut pose = Pose {
            forward_mps: 1.0,
            ..Pose::at_rest(Point::default(), 0.0)
        };
        // 2π at 1 rad/s and 1 m/s, in ticks of half a second: once around a circle of about 1 m.
        let mut width_m: f64 = 0.0;
        for _ in 0..13 {
            pose = drive(pose, 1.0, 4.0 * PI / 13.0);
            width_m = width_m.max(pose.center.y);
        }
        assert!(pose.center.length_squared_m2() < 1e-9, "{pose:?}");
        assert!((1.9..2.2).contains(&width_m), "{width_m}");
    }
}

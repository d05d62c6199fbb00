//! Robots that drive like wheels, as a unicycle does: such a robot has a heading, moves along it and turns.
//!
//! A robot wants a velocity. In each tick its speed changes at its limit of acceleration until it has the speed that it wants, and
//! stays the same after that; its turn rate does the same. It drives along the arc of a circle with the mean of both over the tick,
//! which is exact where neither changes, and on a straight line. All of this is chosen here.

use std::f64::consts::{PI, TAU};

use crate::point::Point;

/// Fastest turn of a robot without a limit of its own, rad/s: headings stay exact.
const TURN_MAX_RADPS: f64 = 1e6;

/// How a robot drives: its limits, which are infinite where it has none, and where it looks first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheels {
    /// Highest speed along the heading, forward and backward, m/s. That of the hall holds as well.
    pub max_speed_mps: f64,
    /// Fastest turn, rad/s.
    pub max_turn_radps: f64,
    /// Largest change of the speed, m/s².
    pub max_acceleration_mps2: f64,
    /// Largest change of the turn rate, rad/s².
    pub max_turn_acceleration_radps2: f64,
    /// First heading, rad, counter-clockwise from +x.
    pub heading_rad: f64,
}

/// A velocity in the robot's own frame: what `cmd_vel` is in ROS.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    /// Speed along the heading, m/s; negative backward.
    pub linear_mps: f64,
    /// Turn rate, rad/s, counter-clockwise.
    pub angular_radps: f64,
}

/// Where a robot with wheels stands, where it looks, and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Its center, m.
    pub center: Point,
    /// Its heading, rad, counter-clockwise from +x, in [-π, π].
    pub heading_rad: f64,
    /// Its velocity.
    pub velocity: Velocity,
}

/// Where a robot with wheels drives in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DriveStep {
    /// The pose at the end of the tick if nothing is in the way.
    pub(crate) pose: Pose,
    /// How far it turns, rad; more than a full turn if it turns fast.
    pub(crate) turn_rad: f64,
}

impl Wheels {
    /// The same with limits of the hall.
    pub(crate) fn within(self, max_speed_mps: f64) -> Self {
        Self {
            max_speed_mps: self.max_speed_mps.min(max_speed_mps),
            max_turn_radps: self.max_turn_radps.min(TURN_MAX_RADPS),
            ..self
        }
    }

    /// Whether the limits are more than zero, and the heading is finite.
    pub(crate) fn is_valid(&self) -> bool {
        let limits = [
            self.max_speed_mps,
            self.max_turn_radps,
            self.max_acceleration_mps2,
            self.max_turn_acceleration_radps2,
        ];
        limits.iter().all(|limit| *limit > 0.0) && self.heading_rad.is_finite()
    }
}

impl Pose {
    /// A robot that stands still.
    pub(crate) fn at_rest(center: Point, heading_rad: f64) -> Self {
        Self {
            center,
            heading_rad: wrapped(heading_rad),
            velocity: Velocity::default(),
        }
    }

    /// Where the robot drives in a tick if it wants this velocity. What is not finite counts as 0.
    pub(crate) fn drive(self, wheels: &Wheels, wanted: Velocity, tick_s: f64) -> DriveStep {
        let (linear_mps, mean_mps) = ramp(
            self.velocity.linear_mps,
            limited(wanted.linear_mps, wheels.max_speed_mps),
            wheels.max_acceleration_mps2,
            tick_s,
        );
        let (angular_radps, mean_radps) = ramp(
            self.velocity.angular_radps,
            limited(wanted.angular_radps, wheels.max_turn_radps),
            wheels.max_turn_acceleration_radps2,
            tick_s,
        );

        let turn_rad = mean_radps * tick_s;
        let chord_m = mean_mps * tick_s * chord_per_arc(turn_rad * 0.5);
        let (sin, cos) = libm::sincos(self.heading_rad + turn_rad * 0.5);
        let pose = Self {
            center: self.center + Point::new(cos, sin) * chord_m,
            heading_rad: wrapped(self.heading_rad + turn_rad),
            velocity: Velocity {
                linear_mps,
                angular_radps,
            },
        };
        DriveStep { pose, turn_rad }
    }
}

/// A number between the limits; 0 for one that is not finite.
fn limited(number: f64, limit: f64) -> f64 {
    if number.is_finite() {
        number.clamp(-limit, limit)
    } else {
        0.0
    }
}

/// What a rate is at the end of a tick in which it changes toward the wanted one by at most `limit` a second, and its mean over the
/// tick.
fn ramp(from: f64, wanted: f64, limit: f64, tick_s: f64) -> (f64, f64) {
    let most = limit * tick_s;
    let change = wanted - from;
    let to = if change.abs() <= most {
        wanted
    } else {
        from + most.copysign(change)
    };

    // Of the tick it changes for this share. Without a limit it changes at once.
    let share = ((to - from).abs() / most).min(1.0);
    (to, to - (to - from) * share * 0.5)
}

/// The chord of an arc as a share of the arc; `half_rad` is half of its angle.
fn chord_per_arc(half_rad: f64) -> f64 {
    if half_rad.abs() < 1e-4 {
        // The next term of the series is below the last bit.
        1.0 - half_rad * half_rad / 6.0
    } else {
        libm::sin(half_rad) / half_rad
    }
}

/// The same angle in [-π, π].
fn wrapped(angle_rad: f64) -> f64 {
    if (-PI..=PI).contains(&angle_rad) {
        angle_rad
    } else {
        libm::remainder(angle_rad, TAU)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::{Pose, Velocity, Wheels};
    use crate::point::Point;

    const FREE: Wheels = Wheels {
        max_speed_mps: f64::INFINITY,
        max_turn_radps: f64::INFINITY,
        max_acceleration_mps2: f64::INFINITY,
        max_turn_acceleration_radps2: f64::INFINITY,
        heading_rad: 0.0,
    };

    /// The poses of a robot that wants one velocity, tick by tick.
    fn drive(
        wheels: Wheels,
        from: Pose,
        wanted: (f64, f64),
        tick_s: f64,
        ticks: usize,
    ) -> Vec<Pose> {
        let wanted = Velocity {
            linear_mps: wanted.0,
            angular_radps: wanted.1,
        };
        let mut poses = vec![from];
        for _ in 0..ticks {
            let last = poses[poses.len() - 1];
            poses.push(last.drive(&wheels, wanted, tick_s).pose);
        }
        poses
    }

    fn last(poses: &[Pose]) -> Pose {
        poses[poses.len() - 1]
    }

    #[test]
    fn a_straight_line_is_speed_times_time() {
        let from = Pose::at_rest(Point::new(1.0, 2.0), 0.3);
        let to = last(&drive(FREE, from, (1.5, 0.0), 0.1, 1000));
        let expected = Point::new(1.0 + 150.0 * libm::cos(0.3), 2.0 + 150.0 * libm::sin(0.3));
        assert!(to.center.distance_m(expected) < 1e-9, "{to:?}");
        assert_eq!(to.heading_rad, 0.3);

        let back = last(&drive(FREE, to, (-1.5, 0.0), 0.1, 1000));
        assert!(back.center.distance_m(from.center) < 1e-9, "{back:?}");
    }

    #[test]
    fn a_circle_has_the_radius_of_speed_over_turn() {
        for (speed_mps, turn_radps, tick_s) in [
            (1.0, 0.7, 0.1),
            (0.3, -2.0, 0.5),
            (2.0, 3.0, 1.0),
            (-1.0, 0.1, 0.05),
            (1.0, 1e-5, 0.5),
        ] {
            let from = Pose::at_rest(Point::new(4.0, 5.0), 1.0);
            let radius_m: f64 = speed_mps / turn_radps;
            let left = Point::new(-libm::sin(1.0), libm::cos(1.0));
            let center = from.center + left * radius_m;
            for pose in drive(FREE, from, (speed_mps, turn_radps), tick_s, 500) {
                let off_m = pose.center.distance_m(center) - radius_m.abs();
                assert!(off_m.abs() < 1e-9, "{off_m} m off {radius_m} m at {pose:?}");
            }
        }
    }

    #[test]
    fn a_robot_stops_within_the_square_of_its_speed_over_twice_its_acceleration() {
        for (speed_mps, acceleration_mps2, tick_s) in
            [(1.0, 0.5, 0.1), (0.9, 0.4, 0.5), (2.0, 3.0, 0.5)]
        {
            let wheels = Wheels {
                max_acceleration_mps2: acceleration_mps2,
                ..FREE
            };
            let mut moving = Pose::at_rest(Point::default(), 0.0);
            moving.velocity.linear_mps = speed_mps;
            let stopped = last(&drive(wheels, moving, (0.0, 0.0), tick_s, 100));
            let distance_m = speed_mps * speed_mps / (2.0 * acceleration_mps2);
            assert_eq!(stopped.velocity, Velocity::default());
            assert!((stopped.center.x - distance_m).abs() < 1e-9, "{stopped:?}");

            // It needs as much to get there.
            let at_rest = Pose::at_rest(Point::default(), 0.0);
            let poses = drive(wheels, at_rest, (speed_mps, 0.0), tick_s, 100);
            let time_s = 100.0 * tick_s;
            let expected_m = speed_mps * time_s - distance_m;
            assert!((last(&poses).center.x - expected_m).abs() < 1e-9);
        }
    }

    #[test]
    fn a_turn_from_rest_to_rest_is_the_area_below_its_rate() {
        let wheels = Wheels {
            max_turn_radps: FRAC_PI_2,
            max_turn_acceleration_radps2: PI,
            ..FREE
        };
        let at_rest = Pose::at_rest(Point::default(), 0.0);
        let turning = drive(wheels, at_rest, (0.0, 9.0), 0.25, 4);
        let rates: Vec<f64> = turning
            .iter()
            .map(|pose| pose.velocity.angular_radps)
            .collect();
        assert_eq!(rates, [0.0, PI / 4.0, PI / 2.0, PI / 2.0, PI / 2.0]);
        let stopped = last(&drive(wheels, last(&turning), (0.0, 0.0), 0.25, 4));
        // Half a second each to speed up and to brake, and half a second between at π/2 rad/s.
        assert!(
            (stopped.heading_rad - FRAC_PI_2).abs() < 1e-12,
            "{stopped:?}"
        );
        assert_eq!(stopped.center, Point::default());
    }

    #[test]
    fn headings_stay_within_half_a_turn_and_what_is_not_finite_is_zero() {
        for (given_rad, heading_rad) in [
            (1.0, 1.0),
            (PI + 0.1, 0.1 - PI),
            (6.0 * PI, 0.0),
            (-13.0, 4.0 * PI - 13.0),
        ] {
            let pose = Pose::at_rest(Point::default(), given_rad);
            assert!(
                (pose.heading_rad - heading_rad).abs() < 1e-12,
                "{given_rad}"
            );
        }

        let at_rest = Pose::at_rest(Point::default(), 0.0);
        for wanted in [(f64::NAN, 0.0), (0.0, f64::INFINITY)] {
            assert_eq!(last(&drive(FREE, at_rest, wanted, 0.5, 1)), at_rest);
        }
        let wheels = FREE.within(1.0);
        let fast = last(&drive(wheels, at_rest, (1e300, -1e300), 0.5, 9));
        assert!(
            fast.center.is_finite() && fast.heading_rad.abs() <= PI,
            "{fast:?}"
        );
        assert_eq!(fast.velocity.linear_mps, 1.0);
    }
}

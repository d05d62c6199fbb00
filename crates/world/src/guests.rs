//! How the guests of the paper move: in a straight line for a while, then along a new one.

use crate::hall;
use crate::point::Point;
use crate::walk::{GuestFloor, GuestWalker};
use rand::{Rng, RngExt};
use std::f64::consts::TAU;

/// A guest's course: a direction, a speed, and how long the guest keeps them (paper, "Obstacles").
///
/// A blocked guest keeps its course, and the duration keeps counting down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// Direction of motion, counter-clockwise from +x, rad, in [0, 2π).
    pub direction_rad: f64,
    /// Speed, m/s.
    pub speed_mps: f64,
    /// The duration that was drawn, s.
    pub duration_s: f64,
    /// Remaining ticks. At 0, the next tick starts with a new course.
    pub ticks_left: u64,
    /// Displacement per tick, m.
    pub step_m: Point,
}

impl Course {
    /// Draws direction, speed and duration, in this order.
    fn draw(guests: &hall::Guests, tick_s: f64, mut rng: &mut dyn Rng) -> Self {
        let direction_rad = rng.random::<f64>() * TAU;
        let speed_mps = guests.speed_mps.sample(&mut rng);
        let duration_s = guests.duration_s.sample(&mut rng);

        Self {
            direction_rad,
            speed_mps,
            duration_s,
            ticks_left: whole_ticks(duration_s, tick_s),
            step_m: displacement(direction_rad, speed_mps * tick_s),
        }
    }
}

fn displacement(direction_rad: f64, distance_m: f64) -> Point {
    let (sin, cos) = libm::sincos(direction_rad);

    Point::new(cos, sin) * distance_m
}

/// The number of ticks after which a duration has passed; at least one, so that every course moves the guest.
///
/// Counting whole ticks up front, rather than subtracting `tick_s` from the remaining time, keeps rounding errors
/// from deciding when a course ends. For the same reason 1.1 s is 11 ticks of 0.1 s, although the floating-point
/// quotient is slightly more than 11.
fn whole_ticks(duration_s: f64, tick_s: f64) -> u64 {
    ((duration_s / tick_s - 1e-9).ceil() as u64).max(1)
}

/// The random walk of the paper: the guests' courses, by index.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RandomWalk {
    guests: hall::Guests,
    tick_s: f64,
    courses: Vec<Course>,
}

impl RandomWalk {
    /// Draws the first course of every guest, in index order.
    pub(crate) fn new(guests: hall::Guests, tick_s: f64, rng: &mut dyn Rng) -> Self {
        let courses = (0..guests.count)
            .map(|_| Course::draw(&guests, tick_s, rng))
            .collect();

        Self {
            guests,
            tick_s,
            courses,
        }
    }

    pub(crate) fn courses(&self) -> &[Course] {
        &self.courses
    }

    /// The course of a guest for the next tick. One whose course is over draws a new one first.
    pub(crate) fn next(&mut self, index: usize, rng: &mut dyn Rng) -> Course {
        let course = &mut self.courses[index];
        if course.ticks_left == 0 {
            *course = Course::draw(&self.guests, self.tick_s, rng);
        }

        course.ticks_left -= 1;
        *course
    }
}

impl GuestWalker for RandomWalk {
    fn advance(&mut self, floor: &mut GuestFloor<'_>, rng: &mut dyn Rng) {
        for index in 0..self.courses.len() {
            let course = self.next(index, rng);
            let step_m = match floor.direction(index) {
                Some(direction) => direction * (course.speed_mps * floor.tick_s()),
                None => course.step_m,
            };
            floor.step(index, step_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::whole_ticks;

    #[test]
    fn a_duration_is_over_when_it_has_passed() {
        let cases: [(f64, f64, u64); 8] = [
            (0.0, 0.1, 1),
            (0.1, 0.1, 1),
            (0.11, 0.1, 2),
            (0.3, 0.1, 3),
            (0.7, 0.1, 7),
            (1.1, 0.1, 11),
            (8.0, 1.0, 8),
            (1e300, 1e-6, u64::MAX),
        ];

        for (duration_s, tick_s, ticks) in cases {
            assert_eq!(
                whole_ticks(duration_s, tick_s),
                ticks,
                "{duration_s} s in ticks of {tick_s} s"
            );
        }
    }
}

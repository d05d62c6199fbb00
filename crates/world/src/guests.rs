//! How guests move: in a straight line for a while, then along a new one.

use crate::bodies::{Blocker, Bodies};
use crate::hall;
use crate::point::Point;
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
    fn draw(guests: &hall::Guests, tick_s: f64, rng: &mut impl Rng) -> Self {
        let direction_rad = rng.random::<f64>() * TAU;
        let speed_mps = guests.speed_mps.sample(rng);
        let duration_s = guests.duration_s.sample(rng);

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

/// The guests' courses and the results of their last steps, by index.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Crowd {
    guests: hall::Guests,
    tick_s: f64,
    courses: Vec<Course>,
    blockers: Vec<Option<Blocker>>,
}

impl Crowd {
    /// Draws the first course of every guest, in index order.
    pub(crate) fn new(guests: hall::Guests, tick_s: f64, rng: &mut impl Rng) -> Self {
        let courses = (0..guests.count)
            .map(|_| Course::draw(&guests, tick_s, rng))
            .collect();

        Self {
            guests,
            tick_s,
            courses,
            blockers: vec![None; guests.count],
        }
    }

    pub(crate) fn courses(&self) -> &[Course] {
        &self.courses
    }

    pub(crate) fn blockers(&self) -> &[Option<Blocker>] {
        &self.blockers
    }

    /// Moves every guest by one step, in index order. A guest whose course is over draws a new one first.
    ///
    /// `directions` are those of guests that react; guests without an entry walk on.
    pub(crate) fn advance(
        &mut self,
        bodies: &mut Bodies,
        directions: &[Option<Point>],
        rng: &mut impl Rng,
    ) {
        let guests = self.courses.iter_mut().zip(&mut self.blockers);

        for (index, (course, blocker)) in guests.enumerate() {
            if course.ticks_left == 0 {
                *course = Course::draw(&self.guests, self.tick_s, rng);
            }

            course.ticks_left -= 1;
            let step_m = match directions.get(index) {
                Some(Some(direction)) => *direction * (course.speed_mps * self.tick_s),
                _ => course.step_m,
            };
            *blocker = bodies.advance_guest(index, step_m).err();
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

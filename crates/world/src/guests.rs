//! How guests move: straight for a while, then anew.

use crate::bodies::{Blocker, Bodies};
use crate::hall;
use crate::point::Point;
use rand::{Rng, RngExt};
use std::f64::consts::TAU;

/// What a guest is up to: a direction, a speed and how long it keeps them (seed, "Obstacles").
///
/// A blocked guest keeps its course; the time runs on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// Counter-clockwise from +x, rad, in [0, 2π).
    pub direction_rad: f64,
    /// m/s.
    pub speed_mps: f64,
    /// How long the course was to last when it was drawn, s.
    pub duration_s: f64,
    /// How many ticks of it are still to come; at 0 the next tick begins with a new course.
    pub ticks_left: u64,
    /// The displacement of one tick, m.
    pub step_m: Point,
}

impl Course {
    /// Draws direction, speed and duration, in this order.
    fn draw(guests: &hall::Guests, tick_s: f64, rng: &mut impl Rng) -> Self {
        let direction_rad = rng.random::<f64>() * TAU;
        let speed_mps = guests.speed_mps.sample(rng);
        let duration_s = guests.duration_s.sample(rng);
        let (sin, cos) = libm::sincos(direction_rad);
        Self {
            direction_rad,
            speed_mps,
            duration_s,
            ticks_left: whole_ticks(duration_s, tick_s),
            step_m: Point::new(cos, sin) * (speed_mps * tick_s),
        }
    }
}

/// The number of ticks after which a duration has passed; one at least, so that every course is walked.
///
/// Counted once instead of subtracting each tick, which would let rounding decide when a course ends. For the
/// same reason 1.1 s are 11 ticks of 0.1 s, although the quotient is a little more than 11.
fn whole_ticks(duration_s: f64, tick_s: f64) -> u64 {
    ((duration_s / tick_s - 1e-9).ceil() as u64).max(1)
}

/// The guests' courses and what became of their last steps, by index.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Crowd {
    guests: hall::Guests,
    tick_s: f64,
    courses: Vec<Course>,
    blockers: Vec<Option<Blocker>>,
}

impl Crowd {
    /// Draws every guest's first course, in index order.
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

    /// Every guest's step of one tick, in index order; who has no time left draws a new course first.
    pub(crate) fn advance(&mut self, bodies: &mut Bodies, rng: &mut impl Rng) {
        for (index, (course, blocker)) in
            self.courses.iter_mut().zip(&mut self.blockers).enumerate()
        {
            if course.ticks_left == 0 {
                *course = Course::draw(&self.guests, self.tick_s, rng);
            }
            course.ticks_left -= 1;
            *blocker = bodies.advance_guest(index, course.step_m).err();
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

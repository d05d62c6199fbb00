//! The guests' courses: which numbers are drawn, in which order, and when.

use crate::halls::{overlap, reception, rng, triangular};
use rand::RngExt;
use rand_distr::Distribution;
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;
use world::{Blocker, Course, Hall, Point, World};

/// A second implementation of the documented order: positions, courses, then new courses as old ones end.
#[test]
fn draws_come_in_the_documented_order() {
    let hall = reception(60);
    let mut stream = rng(11);
    let mut world = World::new(&hall, rng(11)).unwrap();

    let mut places: Vec<Point> = Vec::new();
    while places.len() < 60 {
        let body_m = hall.field.body_m;
        let x = body_m / 2.0 + stream.random::<f64>() * (hall.field.size_m.0 - body_m);
        let y = body_m / 2.0 + stream.random::<f64>() * (hall.field.size_m.1 - body_m);
        let at = Point::new(x, y);
        if !places.iter().any(|&other| overlap(body_m, at, other)) {
            places.push(at);
        }
    }
    assert_eq!(world.guests(), places);

    let mut courses: Vec<DrawnCourse> = (0..60).map(|_| DrawnCourse::draw(&mut stream)).collect();
    let mut ends: Vec<f64> = courses.iter().map(DrawnCourse::ticks).collect();

    for tick in 0..500 {
        for guest in 0..60 {
            if f64::from(tick) == ends[guest] {
                courses[guest] = DrawnCourse::draw(&mut stream);
                ends[guest] = f64::from(tick) + courses[guest].ticks();
            }
        }

        world.advance(&[]);

        let actual: Vec<DrawnCourse> = world.courses().iter().map(DrawnCourse::from).collect();
        assert_eq!(actual, courses, "tick {tick}");
    }
}

/// The numbers drawn for a course of a guest of `reception`.
#[derive(Debug, PartialEq)]
struct DrawnCourse {
    direction_rad: f64,
    speed_mps: f64,
    duration_s: f64,
}

impl DrawnCourse {
    fn draw(stream: &mut Xoshiro256PlusPlus) -> Self {
        let speeds_mps = rand_distr::Triangular::new(0.2, 1.2, 0.6).unwrap();
        let durations_s = rand_distr::Triangular::new(1.0, 8.0, 3.0).unwrap();

        Self {
            direction_rad: stream.random::<f64>() * TAU,
            speed_mps: speeds_mps.sample(stream),
            duration_s: durations_s.sample(stream),
        }
    }

    /// Number of ticks of 0.1 s.
    fn ticks(&self) -> f64 {
        (self.duration_s / 0.1).ceil()
    }
}

impl From<&Course> for DrawnCourse {
    fn from(course: &Course) -> Self {
        Self {
            direction_rad: course.direction_rad,
            speed_mps: course.speed_mps,
            duration_s: course.duration_s,
        }
    }
}

/// The result of one seed when it was first run. A different result, on any machine or after any update, breaks
/// recorded runs.
#[test]
fn a_known_seed_gives_the_known_run() {
    let mut world = World::new(&reception(100), rng(2002)).unwrap();
    for _ in 0..1000 {
        world.advance(&[]);
    }

    let mut digest = 0u64;
    for at in world.guests() {
        digest = digest.rotate_left(7) ^ at.x.to_bits();
        digest = digest.rotate_left(7) ^ at.y.to_bits();
    }
    assert_eq!(format!("{digest:016x}"), "89b6465ddcc2f677");
}

#[test]
fn a_course_lasts_until_its_end_and_is_then_drawn_again() {
    let hall = reception(300);
    let mut world = World::new(&hall, rng(5)).unwrap();
    let mut redraws = 0;

    for _ in 0..400 {
        let before = world.courses().to_vec();
        world.advance(&[]);

        for (old, new) in before.iter().zip(world.courses()) {
            if old.ticks_left > 0 {
                let expected = Course {
                    ticks_left: old.ticks_left - 1,
                    ..*old
                };
                assert_eq!(*new, expected, "the course changed before its end");
            } else {
                redraws += 1;
                assert_ne!(new.direction_rad, old.direction_rad);

                let total_s = (new.ticks_left + 1) as f64 * hall.tick_s;
                assert!(new.duration_s <= total_s + 1e-6);
                assert!(total_s < new.duration_s + hall.tick_s);
            }
        }
    }

    // 300 guests, 40 s, courses of 4 s on average.
    assert!((2500..3500).contains(&redraws), "{redraws}");
}

#[test]
fn courses_follow_the_configured_distributions() {
    let hall = reception(100);
    let mut world = World::new(&hall, rng(6)).unwrap();
    let mut drawn = world.courses().to_vec();

    for _ in 0..20_000 {
        let before = world.courses().to_vec();
        world.advance(&[]);

        for (old, new) in before.iter().zip(world.courses()) {
            if old.ticks_left == 0 {
                drawn.push(*new);
            }
        }
    }

    let count = drawn.len() as f64;
    assert!(count > 45_000.0, "{count}");

    for course in &drawn {
        assert!((0.2..=1.2).contains(&course.speed_mps));
        assert!((1.0..=8.0).contains(&course.duration_s));
        assert!((0.0..TAU).contains(&course.direction_rad));
    }

    let mean_speed = drawn.iter().map(|course| course.speed_mps).sum::<f64>() / count;
    assert!((mean_speed - 2.0 / 3.0).abs() < 0.005, "{mean_speed}");

    let mean_duration = drawn.iter().map(|course| course.duration_s).sum::<f64>() / count;
    assert!((mean_duration - 4.0).abs() < 0.03, "{mean_duration}");

    let mut octants = [0.0; 8];
    for course in &drawn {
        let octant = (course.direction_rad / TAU * 8.0) as usize;
        octants[octant] += 8.0 / count;
    }
    assert!(
        octants.iter().all(|share| (share - 1.0).abs() < 0.06),
        "{octants:?}"
    );
}

#[test]
fn a_step_is_direction_times_speed_times_tick() {
    let hall = reception(1);
    let mut world = World::new(&hall, rng(8)).unwrap();

    for _ in 0..500 {
        let before = world.guests()[0];
        world.advance(&[]);

        let course = world.courses()[0];
        let direction = Point::new(
            libm::cos(course.direction_rad),
            libm::sin(course.direction_rad),
        );
        let step = direction * (course.speed_mps * hall.tick_s);
        assert!(step.distance_m(course.step_m) < 1e-15);

        let expected = if world.guest_blockers()[0].is_some() {
            before
        } else {
            before + course.step_m
        };
        assert_eq!(world.guests()[0], expected);
    }
}

#[test]
fn a_guest_that_fills_the_field_stays_and_still_draws_new_courses() {
    let hall = Hall {
        field: world::Field {
            size_m: (1.0, 1.0),
            body_m: 1.0,
        },
        ..reception(1)
    };
    let mut world = World::new(&hall, rng(9)).unwrap();
    let mut directions = Vec::new();

    for _ in 0..200 {
        world.advance(&[]);
        assert_eq!(world.guests(), [Point::new(0.5, 0.5)]);
        assert_eq!(world.guest_blockers(), [Some(Blocker::Edge)]);
        directions.push(world.courses()[0].direction_rad);
    }

    directions.dedup();
    assert!(
        (3..=20).contains(&directions.len()),
        "{} courses in 20 s",
        directions.len()
    );
}

#[test]
fn guests_follow_constant_and_extreme_courses() {
    let mut hall = reception(50);
    hall.guests.speed_mps = triangular(0.5, 0.5, 0.5);
    hall.guests.duration_s = triangular(0.0, 0.0, 0.0);
    let mut world = World::new(&hall, rng(10)).unwrap();

    for _ in 0..20 {
        let before = world.courses().to_vec();
        world.advance(&[]);

        for course in world.courses() {
            assert_eq!(course.speed_mps, 0.5);
            assert_eq!(course.ticks_left, 0);
        }

        // The first tick uses the courses drawn at the start; a duration of 0 lasts for that one tick.
        let expected = if before[0].ticks_left == 1 { 50 } else { 0 };
        let kept = before
            .iter()
            .zip(world.courses())
            .filter(|(old, new)| old.direction_rad == new.direction_rad)
            .count();
        assert_eq!(kept, expected);
    }

    hall.guests.speed_mps = triangular(0.0, 0.0, 1e308);
    hall.guests.duration_s = triangular(1e308, 1e308, 1e308);
    let mut world = World::new(&hall, rng(10)).unwrap();
    for _ in 0..20 {
        world.advance(&[]);
    }
    crate::halls::check_promises(&world);
}

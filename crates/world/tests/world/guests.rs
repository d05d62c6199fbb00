//! The guests' courses: what is drawn, in which order, and when.

use crate::halls::{overlap, reception, rng, triangular};
use rand::RngExt;
use rand_distr::Distribution;
use std::f64::consts::TAU;
use world::{Blocker, Hall, Point, World};

/// The documented order of draws, written down a second time: places, courses, then courses as they end.
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

    let mut course = || {
        let direction_rad = stream.random::<f64>() * TAU;
        let speed_mps = rand_distr::Triangular::new(0.2, 1.2, 0.6)
            .unwrap()
            .sample(&mut stream);
        let duration_s: f64 = rand_distr::Triangular::new(1.0, 8.0, 3.0)
            .unwrap()
            .sample(&mut stream);
        (direction_rad, speed_mps, duration_s)
    };
    let mut courses: Vec<_> = (0..60).map(|_| course()).collect();
    let mut ends: Vec<f64> = courses
        .iter()
        .map(|course| (course.2 / 0.1).ceil())
        .collect();
    for tick in 0..500 {
        for guest in 0..60 {
            if f64::from(tick) == ends[guest] {
                courses[guest] = course();
                ends[guest] = f64::from(tick) + (courses[guest].2 / 0.1).ceil();
            }
        }
        world.advance(&[]);
        let actual = world
            .courses()
            .iter()
            .map(|c| (c.direction_rad, c.speed_mps, c.duration_s));
        assert_eq!(actual.collect::<Vec<_>>(), courses, "tick {tick}");
    }
}

/// What one seed gave when it was first run; a difference on any machine or with any update breaks recorded
/// runs.
#[test]
fn a_known_seed_gives_the_known_run() {
    let mut world = World::new(&reception(100), rng(2002)).unwrap();
    (0..1000).for_each(|_| drop(world.advance(&[])));
    let digest = world.guests().iter().fold(0u64, |digest, at| {
        (digest.rotate_left(7) ^ at.x.to_bits()).rotate_left(7) ^ at.y.to_bits()
    });
    assert_eq!(format!("{digest:016x}"), "89b6465ddcc2f677");
}

#[test]
fn a_course_is_kept_to_its_end_and_then_drawn_anew() {
    let hall = reception(300);
    let mut world = World::new(&hall, rng(5)).unwrap();
    let mut redraws = 0;
    for _ in 0..400 {
        let before = world.courses().to_vec();
        world.advance(&[]);
        for (old, new) in before.iter().zip(world.courses()) {
            if old.ticks_left > 0 {
                let expected = world::Course {
                    ticks_left: old.ticks_left - 1,
                    ..*old
                };
                assert_eq!(
                    *new, expected,
                    "a course changed before its time, blocked or not"
                );
            } else {
                redraws += 1;
                assert_ne!(new.direction_rad, old.direction_rad);
                let walked_s = (new.ticks_left + 1) as f64 * hall.tick_s;
                assert!(
                    new.duration_s <= walked_s + 1e-6 && walked_s < new.duration_s + hall.tick_s
                );
            }
        }
    }
    // 300 guests, 40 s, courses of 4 s on average.
    assert!((2500..3500).contains(&redraws), "{redraws}");
}

#[test]
fn courses_are_distributed_as_asked() {
    let hall = reception(100);
    let mut world = World::new(&hall, rng(6)).unwrap();
    let mut drawn = world.courses().to_vec();
    for _ in 0..20_000 {
        let is_over: Vec<bool> = world
            .courses()
            .iter()
            .map(|course| course.ticks_left == 0)
            .collect();
        world.advance(&[]);
        let new = world
            .courses()
            .iter()
            .zip(is_over)
            .filter(|(_, is_over)| *is_over);
        drawn.extend(new.map(|(course, _)| *course));
    }
    let count = drawn.len() as f64;
    assert!(count > 45_000.0, "{count}");
    assert!(
        drawn
            .iter()
            .all(|course| (0.2..=1.2).contains(&course.speed_mps))
    );
    assert!(
        drawn
            .iter()
            .all(|course| (1.0..=8.0).contains(&course.duration_s))
    );
    assert!(
        drawn
            .iter()
            .all(|course| (0.0..TAU).contains(&course.direction_rad))
    );
    let mean_speed = drawn.iter().map(|course| course.speed_mps).sum::<f64>() / count;
    assert!((mean_speed - 2.0 / 3.0).abs() < 0.005, "{mean_speed}");
    let mean_duration = drawn.iter().map(|course| course.duration_s).sum::<f64>() / count;
    assert!((mean_duration - 4.0).abs() < 0.03, "{mean_duration}");
    let mut octants = [0.0; 8];
    drawn
        .iter()
        .for_each(|course| octants[(course.direction_rad / TAU * 8.0) as usize] += 8.0 / count);
    assert!(
        octants.iter().all(|share| (share - 1.0).abs() < 0.06),
        "{octants:?}"
    );
}

#[test]
fn a_step_is_direction_speed_and_tick() {
    let hall = reception(1);
    let mut world = World::new(&hall, rng(8)).unwrap();
    for _ in 0..500 {
        let before = world.guests()[0];
        world.advance(&[]);
        let course = world.courses()[0];
        let way = Point::new(
            libm::cos(course.direction_rad),
            libm::sin(course.direction_rad),
        );
        let step = way * (course.speed_mps * hall.tick_s);
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
fn who_fills_the_field_stays_and_still_changes_its_mind() {
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
fn constants_and_extremes_are_walked() {
    let mut hall = reception(50);
    (hall.guests.speed_mps, hall.guests.duration_s) =
        (triangular(0.5, 0.5, 0.5), triangular(0.0, 0.0, 0.0));
    let mut world = World::new(&hall, rng(10)).unwrap();
    for _ in 0..20 {
        let before = world.courses().to_vec();
        world.advance(&[]);
        assert!(
            world
                .courses()
                .iter()
                .all(|course| course.speed_mps == 0.5 && course.ticks_left == 0)
        );
        let kept = before
            .iter()
            .zip(world.courses())
            .filter(|(old, new)| old.direction_rad == new.direction_rad);
        // The first tick walks the courses drawn at the start; a duration of 0 lasts that one tick.
        assert!(kept.count() == if before[0].ticks_left == 1 { 50 } else { 0 });
    }
    (hall.guests.speed_mps, hall.guests.duration_s) =
        (triangular(0.0, 0.0, 1e308), triangular(1e308, 1e308, 1e308));
    let mut world = World::new(&hall, rng(10)).unwrap();
    (0..20).for_each(|_| drop(world.advance(&[])));
    crate::halls::check_promises(&world);
}

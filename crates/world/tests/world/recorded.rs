//! Guests who walk as recorded people did: where they are, when they come and go, and what they do at bodies in their way.

use std::num::NonZeroU64;
use std::sync::Arc;

use crate::halls::{reception, rng};
use world::{
    Blocker, Body, GuestWalk, Hall, MoveOutcome, Point, Recorded, Track, TrackPoint, World,
};

/// Speed back to the record, m/s: with ticks of 0.1 s, 0.2 m in a tick.
const CATCH_UP_MPS: f64 = 2.0;

fn track(waypoints: &[(f64, f64, f64)]) -> Track {
    let points = waypoints.iter().map(|&(at_s, x, y)| TrackPoint {
        at_us: (at_s * 1e6).round() as u64,
        at: Point::new(x, y),
    });
    Track::new(points.collect()).unwrap()
}

fn recorded(tracks: Vec<Track>) -> Recorded {
    Recorded {
        tracks: Arc::new(tracks),
        start_us: Some(0),
        period_us: None,
        catch_up_mps: CATCH_UP_MPS,
    }
}

/// A hall of 10 m by 10 m with bodies of 1 m and ticks of 0.1 s, without guests of its own.
fn hall(robots: &[Point], obstacles: &[Point]) -> Hall {
    let mut hall = reception(0);
    hall.field.size_m = (10.0, 10.0);
    hall.field.body_m = 1.0;
    hall.robots = robots.to_vec();
    hall.obstacles = obstacles.to_vec();
    hall.tick_s = 0.1;
    hall.max_speed_mps = 1e3;
    hall
}

fn world(hall: &Hall, recorded: Recorded) -> World<rand_xoshiro::Xoshiro256PlusPlus> {
    World::with_guests(hall, GuestWalk::Recorded(recorded), rng(1)).unwrap()
}

fn present<R>(world: &World<R>) -> Vec<usize> {
    world.present_guests().map(|(guest, _)| guest).collect()
}

/// Who entered (true) and left (false) in the last tick.
fn passages<R>(world: &World<R>) -> Vec<(usize, bool)> {
    let passages = world.passages().iter();
    passages
        .map(|passage| (passage.guest, passage.enters))
        .collect()
}

fn assert_close(point: Point, x: f64, y: f64) {
    assert!(
        point.distance_m(Point::new(x, y)) < 1e-9,
        "{point} is not {x}, {y}"
    );
}

#[test]
fn a_track_has_rising_finite_times_and_straight_lines() {
    let line = track(&[(1.0, 0.0, 0.0), (2.0, 4.0, 2.0), (4.0, 4.0, 0.0)]);
    let at = |time_s: f64| line.at((time_s * 1e6).round() as u64);
    assert_eq!(at(0.999), None);
    assert_eq!(at(1.0), Some(Point::new(0.0, 0.0)));
    assert_eq!(at(1.25), Some(Point::new(1.0, 0.5)));
    assert_eq!(at(2.0), Some(Point::new(4.0, 2.0)));
    assert_eq!(at(3.0), Some(Point::new(4.0, 1.0)));
    assert_eq!(at(4.0), Some(Point::new(4.0, 0.0)));
    assert_eq!(at(4.001), None);

    let waypoint = |at_us, x| TrackPoint {
        at_us,
        at: Point::new(x, 0.0),
    };
    assert_eq!(Track::new(vec![]), None);
    assert_eq!(Track::new(vec![waypoint(1, 0.0), waypoint(1, 1.0)]), None);
    assert_eq!(Track::new(vec![waypoint(2, 0.0), waypoint(1, 1.0)]), None);
    assert_eq!(Track::new(vec![waypoint(0, f64::INFINITY)]), None);
}

#[test]
fn people_enter_when_their_record_begins_and_leave_when_it_ends() {
    let tracks = vec![
        track(&[(0.0, 2.0, 5.0), (0.2, 2.2, 5.0)]),
        track(&[(0.1, 8.0, 5.0), (10.0, 8.0, 5.0)]),
        // On the field from the third tick on, and off it again: half a body from the edge is the limit.
        track(&[(0.0, 0.2, 2.0), (0.6, 0.8, 2.0), (1.2, 0.2, 2.0)]),
    ];
    let mut world = world(&hall(&[], &[]), recorded(tracks));
    assert!(world.has_passages());
    assert_eq!(present(&world), [0]);
    assert_eq!(passages(&world), [(0, true)]);

    let mut seen = Vec::new();
    for _ in 0..12 {
        world.advance(&[]);
        seen.push((present(&world), passages(&world)));
    }
    assert_eq!(seen[0], (vec![0, 1], vec![(1, true)]));
    assert_eq!(seen[1], (vec![0, 1], vec![]));
    assert_eq!(seen[2], (vec![1, 2], vec![(0, false), (2, true)]));
    assert_eq!(seen[8].0, [1, 2]);
    assert_eq!(seen[9], (vec![1], vec![(2, false)]));
    assert_eq!(seen[11], (vec![1], vec![]));
    assert_eq!(world.held_ticks(), 0);
    // Those who have left are not near anything.
    assert_eq!(world.near(Point::new(5.0, 5.0), 100.0).len(), 1);
}

#[test]
fn recorded_people_do_not_hinder_each_other_but_hinder_robots() {
    let tracks = vec![
        track(&[(0.0, 4.0, 5.0), (10.0, 4.0, 5.0)]),
        track(&[(0.0, 2.0, 5.0), (4.0, 6.0, 5.0)]),
    ];
    let mut world = world(&hall(&[Point::new(4.0, 8.0)], &[]), recorded(tracks));
    for _ in 0..20 {
        world.advance(&[None]);
    }
    assert_close(world.guests()[0], 4.0, 5.0);
    assert_close(world.guests()[1], 4.0, 5.0);

    let by = Blocker::Body(Body::Guest(0));
    let verdicts = world.advance(&[Some(Point::new(4.0, 5.5))]);
    assert_eq!(verdicts, [MoveOutcome::Blocked { by }]);
}

#[test]
fn a_person_waits_at_a_robot_and_then_goes_straight_to_where_the_record_is() {
    // At 1 m/s along y = 5; a robot stands across the way, from x = 3.5 on.
    let tracks = vec![track(&[(0.0, 2.0, 5.0), (6.0, 8.0, 5.0)])];
    let robot = Point::new(4.0, 5.0);
    let mut world = world(&hall(&[robot], &[]), recorded(tracks));
    for _ in 0..10 {
        world.advance(&[Some(robot)]);
    }
    // At x = 3 the bodies touch.
    assert_close(world.guests()[0], 3.0, 5.0);
    assert_eq!(world.held_ticks(), 0);

    for tick in 1..=10 {
        world.advance(&[Some(robot)]);
        assert_close(world.guests()[0], 3.0, 5.0);
        assert_eq!(
            world.guest_blockers(),
            [Some(Blocker::Body(Body::Robot(0)))]
        );
        assert_eq!(world.held_ticks(), tick);
    }

    // The robot makes way. The record is at x = 4.1; it is 0.1 m farther in each tick, and the person goes 0.2 m.
    let away = Point::new(4.0, 8.0);
    let mut places = Vec::new();
    for _ in 0..12 {
        world.advance(&[Some(away)]);
        places.push(world.guests()[0].x);
    }
    assert_eq!(world.held_ticks(), 10);
    for (tick, x) in (1..).zip(places) {
        let record = 4.0 + 0.1 * f64::from(tick);
        let expected = (3.0 + 0.2 * f64::from(tick)).min(record);
        assert!((x - expected).abs() < 1e-9, "{x} in tick {tick}");
    }
}

#[test]
fn a_person_whose_place_is_taken_enters_when_it_is_free() {
    let tracks = vec![track(&[(0.0, 5.0, 5.0), (1.0, 5.0, 5.0)])];
    let robot = Point::new(5.5, 5.0);
    let mut world = world(&hall(&[robot], &[]), recorded(tracks));
    world.advance(&[None]);
    assert_eq!(present(&world), []);
    assert_eq!(world.held_ticks(), 2);

    world.advance(&[Some(Point::new(6.0, 5.0))]);
    assert_eq!(present(&world), [0]);
    assert_eq!(passages(&world), [(0, true)]);
    assert_eq!(world.held_ticks(), 2);
}

#[test]
fn a_record_that_repeats_begins_again_and_nobody_jumps() {
    let mut recorded = recorded(vec![track(&[(0.0, 2.0, 5.0), (0.4, 6.0, 5.0)])]);
    recorded.period_us = NonZeroU64::new(500_000);
    recorded.start_us = Some(200_000);
    let mut world = world(&hall(&[], &[]), recorded);
    let mut places = vec![world.guests()[0].x];
    let mut events = Vec::new();
    for _ in 0..8 {
        world.advance(&[]);
        places.push(world.guests()[0].x);
        events.push(passages(&world));
    }
    let expected = [4.0, 5.0, 6.0, 2.0, 3.0, 4.0, 5.0, 6.0, 2.0];
    for (x, expected) in places.into_iter().zip(expected) {
        assert!((x - expected).abs() < 1e-6, "{x} is not {expected}");
    }
    let again = vec![(0, false), (0, true)];
    let quiet = Vec::new();
    assert_eq!(
        events,
        [
            quiet.clone(),
            quiet.clone(),
            again.clone(),
            quiet.clone(),
            quiet.clone(),
            quiet.clone(),
            quiet,
            again
        ]
    );
}

#[test]
fn a_start_that_is_drawn_is_one_of_the_record_and_of_the_seed() {
    let mut recorded = recorded(vec![track(&[(0.0, 2.0, 5.0), (6.0, 8.0, 5.0)])]);
    recorded.start_us = None;
    recorded.period_us = NonZeroU64::new(6_000_001);
    let hall = hall(&[], &[]);
    let place = |seed: u64| {
        let walk = GuestWalk::Recorded(recorded.clone());
        World::with_guests(&hall, walk, rng(seed)).unwrap().guests()[0].x
    };
    let places: Vec<f64> = (0..50).map(place).collect();
    assert_eq!(places[7], place(7));
    assert!(places.iter().all(|x| (2.0..=8.0).contains(x)), "{places:?}");
    for third in [2.0..4.0, 4.0..6.0, 6.0..8.0] {
        assert!(places.iter().any(|x| third.contains(x)), "{places:?}");
    }
}

#[test]
fn obstacles_and_walls_hold_people_as_robots_do() {
    let tracks = vec![track(&[(0.0, 2.0, 5.0), (6.0, 8.0, 5.0)])];
    let mut world = world(&hall(&[], &[Point::new(4.0, 5.0)]), recorded(tracks));
    for _ in 0..60 {
        world.advance(&[]);
    }
    // The record passes through the obstacle; the person waits at it to the end. Its line back is blocked as well.
    assert_close(world.guests()[0], 3.0, 5.0);
    assert_eq!(
        world.guest_blockers(),
        [Some(Blocker::Body(Body::Obstacle(0)))]
    );
    assert_eq!(world.held_ticks(), 50);
    world.advance(&[]);
    assert_eq!(present(&world), []);
}

#[test]
fn copies_walk_alike_and_nothing_is_drawn() {
    let tracks = vec![track(&[(0.0, 2.0, 5.0), (6.0, 8.0, 5.0)])];
    let mut first = world(&hall(&[], &[]), recorded(tracks.clone()));
    for _ in 0..7 {
        first.advance(&[]);
    }
    let mut copy = first.clone();
    assert_eq!(first, copy);
    first.reseed(rng(2));
    first.advance(&[]);
    copy.advance(&[]);
    assert_eq!(first.guests(), copy.guests());
}

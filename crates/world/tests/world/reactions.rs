//! Guests that react to robots: where they go, and that nothing else changes.

use crate::halls::{FT, TestWorld, check_promises, reception, rng, triangular};
use proptest::prelude::*;
use world::{Hall, Point, Reaction, Response, World};

/// A hall with one guest of 1 m/s and robots, as a world in which the guest stands at `guest`, up to the tries of the search.
fn hall(robots: &[Point]) -> Hall {
    Hall {
        robots: robots.to_vec(),
        guests: world::Guests {
            count: 1,
            speed_mps: triangular(1.0, 1.0, 1.0),
            duration_s: triangular(100.0, 100.0, 100.0),
        },
        ..reception(1)
    }
}

/// A world whose one guest fulfills a condition at the beginning: the first of many seeds.
fn world_where(robots: &[Point], is_right: impl Fn(Point) -> bool) -> TestWorld {
    let hall = hall(robots);
    (0..100_000)
        .map(|seed| World::new(&hall, rng(seed)).unwrap())
        .find(|world| is_right(world.guests()[0]))
        .unwrap()
}

fn reaction(robot: usize, response: Response) -> Reaction {
    Reaction {
        robot,
        range_m: 2.0,
        response,
        guest: None,
    }
}

const STEP_M: f64 = 0.1;
const MIDDLE: Point = Point::new(7.0, 7.0);

/// How far the guest moves in one tick, while the robot means to move by `heading`.
fn step(world: &mut TestWorld, heading: Point, reactions: &[Reaction]) -> Point {
    let before = world.guests()[0];
    world.advance_with(&[Some(MIDDLE + heading)], reactions);
    world.guests()[0] - before
}

fn assert_close(actual: Point, expected: Point) {
    assert!(
        actual.distance_m(expected) < 1e-12,
        "{actual} is not {expected}"
    );
}

#[test]
fn a_guest_comes_straight_until_two_bodies_are_between_the_centers() {
    let mut world = world_where(&[MIDDLE], |at| (1.7..1.99).contains(&at.distance_m(MIDDLE)));
    let approach = [reaction(0, Response::Approach)];
    let two_bodies_m = 4.0 * FT;

    for _ in 0..40 {
        let offset = world.guests()[0] - MIDDLE;
        let distance_m = world.guests()[0].distance_m(MIDDLE);
        let expected = if distance_m <= two_bodies_m {
            Point::default()
        } else {
            offset * (-STEP_M / distance_m)
        };
        assert_close(step(&mut world, Point::default(), &approach), expected);
    }
    let distance_m = world.guests()[0].distance_m(MIDDLE);
    assert!(
        (two_bodies_m - STEP_M..=two_bodies_m).contains(&distance_m),
        "{distance_m}"
    );
}

#[test]
fn a_guest_in_the_way_steps_aside_and_others_walk_on() {
    let way = [reaction(0, Response::MakeWay)];
    // The robot means to move to the right.
    let heading = Point::new(0.05, 0.0);
    let is_ahead = |at: Point| at.x - MIDDLE.x > 0.8 && at.distance_m(MIDDLE) < 1.9;

    let mut above = world_where(&[MIDDLE], |at| {
        is_ahead(at) && (0.1..1.0).contains(&(at.y - MIDDLE.y))
    });
    assert_close(step(&mut above, heading, &way), Point::new(0.0, STEP_M));
    let mut below = world_where(&[MIDDLE], |at| {
        is_ahead(at) && (-1.0..-0.1).contains(&(at.y - MIDDLE.y))
    });
    assert_close(step(&mut below, heading, &way), Point::new(0.0, -STEP_M));

    let is_behind =
        |at: Point| (0.8..1.5).contains(&(MIDDLE.x - at.x)) && (at.y - MIDDLE.y).abs() < 0.5;
    let is_beside = |at: Point| {
        (1.3..1.6).contains(&(at.y - MIDDLE.y)) && (0.1..0.5).contains(&(at.x - MIDDLE.x))
    };
    let is_far =
        |at: Point| (2.01..2.5).contains(&(at.x - MIDDLE.x)) && (at.y - MIDDLE.y).abs() < 0.3;
    let elsewhere: [&dyn Fn(Point) -> bool; 3] = [&is_behind, &is_beside, &is_far];
    for is_right in elsewhere {
        let mut world = world_where(&[MIDDLE], is_right);
        let course_m = world.courses()[0].step_m;
        assert_close(step(&mut world, heading, &way), course_m);
    }

    // From a robot that stays, straight away.
    let mut still = world_where(&[MIDDLE], |at| (0.9..1.5).contains(&at.distance_m(MIDDLE)));
    let offset = still.guests()[0] - MIDDLE;
    let away = offset * (STEP_M / still.guests()[0].distance_m(MIDDLE));
    assert_close(step(&mut still, Point::default(), &way), away);
}

#[test]
fn a_guest_reacts_to_the_nearest_robot() {
    let other = Point::new(9.0, 7.0);
    let mut world = world_where(&[MIDDLE, other], |at| {
        (7.9..7.95).contains(&at.x) && (at.y - 7.0).abs() < 0.3
    });
    let guest = world.guests()[0];
    let both = [
        reaction(1, Response::Approach),
        reaction(0, Response::MakeWay),
    ];
    world.advance_with(&[None, None], &both);
    let away = (guest - MIDDLE) * (STEP_M / guest.distance_m(MIDDLE));
    assert_close(world.guests()[0] - guest, away);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Whatever guests react to, no body leaves the field or overlaps another one, and what is drawn stays the same.
    #[test]
    fn reactions_keep_the_promises_and_draw_nothing(seed in any::<u64>(), range_m in 2.0..20.0) {
        let hall = Hall {
            robots: vec![Point::new(4.0, 4.0), Point::new(9.0, 9.0)],
            ..reception(80)
        };
        let mut calm = World::new(&hall, rng(seed)).unwrap();
        let mut moved = calm.clone();
        let responses = [Response::Approach, Response::MakeWay];
        for tick in 0..200_usize {
            let reactions = [0, 1].map(|robot| Reaction {
                robot,
                range_m,
                response: responses[(tick / 50 + robot) % 2],
                guest: None,
            });
            let drift = Point::new(0.01, if tick % 40 < 20 { 0.02 } else { -0.02 });
            let proposals: Vec<_> = moved.robots().iter().map(|&at| Some(at + drift)).collect();
            moved.advance_with(&proposals, &reactions);
            calm.advance(&proposals);
            check_promises(&moved);
            prop_assert_eq!(moved.courses(), calm.courses());
        }
        prop_assert_ne!(moved.guests(), calm.guests());
    }
}

#[test]
fn a_reaction_of_one_guest_moves_no_other_and_one_that_stays_stays() {
    let mut hall = reception(40);
    hall.robots = vec![MIDDLE];
    let mut world = World::new(&hall, rng(6)).unwrap();
    let start = world.guests().to_vec();
    let mut calm = world.clone();
    for _ in 0..10 {
        calm.advance(&[None]);
    }

    let walker = (0..40).find(|&guest| calm.guests()[guest] != start[guest]);
    let walker = walker.unwrap();
    let stay = Reaction {
        guest: Some(walker),
        range_m: 100.0,
        ..reaction(0, Response::Stay)
    };
    for _ in 0..10 {
        world.advance_with(&[None], &[stay]);
    }
    assert_eq!(world.guests()[walker], start[walker]);
    assert_eq!(world.courses(), calm.courses());
    let moved = world.guests().iter().zip(calm.guests());
    let others = moved.filter(|(at, other)| at != other).count();
    // That one, and those in whose way it stands.
    assert!((1..8).contains(&others), "{others}");
}

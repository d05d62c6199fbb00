//! Guests who want something: they go there, stay, and go on; what they want follows from their stream alone.

use crate::halls::{TestWorld, is_inside, overlap, reception, rng, triangular};
use proptest::prelude::*;
use world::{CrowdGuests, CrowdModel, GuestWalk, Hall, Point, Want, WantTarget, World};

const TABLE: Point = Point::new(3.0, 3.0);
const DOOR: Point = Point::new(15.24 - 0.3048, 7.62);

fn want(goal: WantTarget) -> Want {
    Want {
        goal,
        weight: 1.0,
        within_m: 1.5,
        stay_s: Some(triangular(5.0, 5.0, 5.0)),
        give_up: 1000,
    }
}

fn hall(guests: usize) -> Hall {
    let mut hall = reception(guests);
    hall.tick_s = 0.5;
    hall.robots = vec![Point::new(10.0, 10.0)];
    hall
}

fn world_of(hall: &Hall, wants: &[Want], seed: u64) -> TestWorld {
    let guests = CrowdGuests {
        model: CrowdModel::CollisionFree,
        wants: wants.to_vec(),
    };
    World::with_guests(hall, GuestWalk::Crowd(guests), rng(seed)).unwrap()
}

fn distance_m(world: &TestWorld, to: Point) -> f64 {
    world.guests()[0].distance_m(to)
}

/// Ticks until something holds.
fn ticks_until(world: &mut TestWorld, mut holds: impl FnMut(&TestWorld) -> bool) -> usize {
    for tick in 0..1000 {
        if holds(world) {
            return tick;
        }
        world.advance(&[None]);
    }
    panic!("it does not hold in 1000 ticks");
}

/// Advances until the guest has stood for a tick.
fn stand(world: &mut TestWorld) {
    let mut before = Point::default();
    ticks_until(world, |world| {
        std::mem::replace(&mut before, world.guests()[0]) == world.guests()[0]
    });
}

/// Advances by some ticks, in which the guest stands.
fn assert_stands(world: &mut TestWorld, ticks: usize) {
    let here = world.guests()[0];
    for tick in 0..ticks {
        world.advance(&[None]);
        assert_eq!(world.guests()[0], here, "{tick}");
    }
}

#[test]
fn a_guest_goes_to_a_place_stays_and_goes_to_the_next() {
    let corner = Point::new(12.0, 3.0);
    let wants = [
        want(WantTarget::Place(TABLE)),
        want(WantTarget::Place(corner)),
    ];
    let mut world = world_of(&hall(1), &wants, 4);
    let mut visits = [0, 0];
    for _ in 0..12 {
        stand(&mut world);
        let is_at = [TABLE, corner].map(|place| distance_m(&world, place) <= 1.5);
        assert!(is_at[0] || is_at[1], "{}", world.guests()[0]);
        visits[usize::from(is_at[1])] += 1;
        // It stays for 5 s, which are ten ticks after that of its arrival.
        let here = world.guests()[0];
        assert_stands(&mut world, 10);
        world.advance(&[None]);
        assert_ne!(world.guests()[0], here);
    }
    assert!(visits[0] > 1 && visits[1] > 1, "{visits:?}");
}

#[test]
fn who_leaves_by_an_exit_comes_back_only_with_a_time_to_stay_away() {
    let mut world = world_of(&hall(1), &[want(WantTarget::Exit(DOOR))], 2);
    assert!(world.has_passages());
    assert_eq!(world.passages(), [], "it is there at the beginning");
    ticks_until(&mut world, |world| !world.is_present(0));
    assert!(!world.passages()[0].enters);
    assert!(distance_m(&world, DOOR) <= 1.5);
    let away = ticks_until(&mut world, |world| world.is_present(0));
    assert_eq!(away, 11, "5 s");
    assert_eq!(world.guests()[0], DOOR);
    assert!(world.passages()[0].enters);

    let for_good = Want {
        stay_s: None,
        ..want(WantTarget::Exit(DOOR))
    };
    let mut world = world_of(&hall(1), &[for_good], 2);
    ticks_until(&mut world, |world| !world.is_present(0));
    for _ in 0..2000 {
        world.advance(&[None]);
        assert!(!world.is_present(0));
    }
}

/// The bound of what guests who never rest add to a record.
#[test]
fn with_no_time_outside_each_guest_leaves_or_comes_back_at_most_once_a_tick() {
    let restless = Want {
        stay_s: Some(triangular(0.0, 0.0, 0.0)),
        ..want(WantTarget::Exit(DOOR))
    };
    let mut world = world_of(&hall(3), &[restless], 2);
    let mut passages = 0;
    for _ in 0..300 {
        world.advance(&[None]);
        let mut guests: Vec<usize> = world.passages().iter().map(|one| one.guest).collect();
        passages += guests.len();
        guests.sort_unstable();
        guests.dedup();
        assert_eq!(guests.len(), world.passages().len());
    }
    assert!((300..=900).contains(&passages), "{passages}");
}

#[test]
fn who_wants_what_a_robot_gives_waits_at_it_until_it_has_it() {
    let treat = Want {
        stay_s: None,
        ..want(WantTarget::Robot(0))
    };
    let mut hall = hall(1);
    // In a corner, so that it is not in the way to the table.
    hall.robots = vec![Point::new(14.5, 14.5)];
    let mut world = world_of(&hall, &[treat, want(WantTarget::Place(TABLE))], 1);
    let robot = world.robots()[0];
    let mut served = 0;
    let mut tables = 0;
    for _ in 0..20 {
        stand(&mut world);
        if distance_m(&world, robot) <= 1.5 {
            assert_stands(&mut world, 50);
            // Of another robot it wants nothing.
            world.satisfy(0, 1);
            assert_stands(&mut world, 20);
            world.satisfy(0, 0);
            served += 1;
        } else {
            assert_stands(&mut world, 10);
            tables += 1;
        }
        world.advance(&[None]);
    }
    assert!(served > 1 && tables > 1, "{served} {tables}");
}

#[test]
fn who_does_not_come_to_it_gives_it_up() {
    let mut hall = hall(1);
    // Nobody comes to a table behind a wall of obstacles.
    for index in 0..25 {
        hall.obstacles
            .push(Point::new(7.62, 0.3048 + 0.6096 * f64::from(index)));
    }
    let (left, right) = (Point::new(2.0, 7.0), Point::new(13.0, 7.0));
    let short = |at| Want {
        give_up: 60,
        ..want(WantTarget::Place(at))
    };
    let mut world = world_of(&hall, &[short(left), short(right)], 3);
    let is_left = world.guests()[0].x < 7.62;
    let mut arrivals = 0;
    for _ in 0..2000 {
        world.advance(&[None]);
        arrivals += usize::from(distance_m(&world, if is_left { left } else { right }) <= 1.5);
    }
    assert_eq!(world.guests()[0].x < 7.62, is_left);
    assert!((10..2000).contains(&arrivals), "{arrivals}");
}

#[test]
fn weights_are_how_often_something_is_wanted() {
    let often = Want {
        weight: 3.0,
        ..want(WantTarget::Place(TABLE))
    };
    let seldom = want(WantTarget::Place(Point::new(12.0, 12.0)));
    let mut hall = hall(60);
    hall.field.body_m = 0.05;
    let mut world = world_of(&hall, &[often, seldom], 5);
    for _ in 0..60 {
        world.advance(&[None]);
    }
    let at_table = world
        .guests()
        .iter()
        .filter(|at| at.distance_m(TABLE) <= 2.0)
        .count();
    // The first want of each; 3 in 4 of them within five standard deviations, less those who are still on their way.
    assert!((28..=60).contains(&at_table), "{at_table}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn nobody_who_wants_something_is_in_a_body_and_robots_change_no_draw(seed: u64, drift in -0.2..0.2) {
        let mut hall = hall(40);
        hall.obstacles = vec![Point::new(5.0, 5.0)];
        hall.max_speed_mps = 1.0;
        let wants = [want(WantTarget::Place(Point::new(5.0, 5.0))), want(WantTarget::Exit(DOOR)), want(WantTarget::Robot(0))];
        let mut world = world_of(&hall, &wants, seed);
        let mut calm = world.clone();
        for tick in 0..200 {
            let to = world.robots()[0] + Point::new(drift, if tick % 20 < 10 { drift } else { -drift });
            world.advance(&[Some(to)]);
            calm.advance(&[None]);
            prop_assert_eq!(world.courses(), calm.courses());
            for (guest, at) in world.present_guests() {
                prop_assert!(is_inside(&hall.field, at), "guest {} at {}", guest, at);
                for &other in world.robots().iter().chain(world.obstacles()) {
                    prop_assert!(!overlap(hall.field.body_m, at, other), "guest {} at {} on {}", guest, at, other);
                }
            }
        }

        let mut again = world_of(&hall, &wants, seed);
        for _ in 0..200 {
            again.advance(&[None]);
        }
        prop_assert_eq!(&again, &calm);
        let mut other = calm.clone();
        other.reseed(rng(seed ^ 1));
        for _ in 0..200 {
            again.advance(&[None]);
            other.advance(&[None]);
        }
        prop_assert_ne!(again.guests(), other.guests());
    }
}

//! What is near a place.

use crate::halls::{any_hall, crowded, reception, rng};
use proptest::prelude::*;
use world::{Body, Near, Point, World};

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn near_is_what_brute_force_finds(
        mut hall in any_hall(),
        share in 0.0..=1.0,
        seed in any::<u64>(),
        at in (-0.5..1.5, -0.5..1.5),
        range_m in prop_oneof![Just(0.0), 0.0..30.0, Just(f64::INFINITY)],
    ) {
        let mut world = crowded(&mut hall, share, seed);
        (0..10).for_each(|_| drop(world.advance(&vec![None; hall.robots.len()])));
        let point = Point::new(at.0 * hall.field.size_m.0, at.1 * hall.field.size_m.1);
        let obstacles = world.obstacles().iter().enumerate().map(|(index, &at)| (Body::Obstacle(index), at));
        let robots = world.robots().iter().enumerate().map(|(index, &at)| (Body::Robot(index), at));
        let guests = world.guests().iter().enumerate().map(|(index, &at)| (Body::Guest(index), at));
        let expected: Vec<Near> = obstacles
            .chain(robots)
            .chain(guests)
            .filter(|(_, center)| {
                let way = *center - point;
                way.x * way.x + way.y * way.y <= range_m * range_m
            })
            .map(|(body, center)| Near { body, center })
            .collect();
        prop_assert_eq!(world.near(point, range_m), expected);
    }
}

#[test]
fn the_one_at_the_place_is_near_and_the_range_is_a_circle() {
    let mut hall = reception(0);
    hall.obstacles = vec![Point::new(8.0, 8.0), Point::new(5.0, 9.0)];
    hall.robots = vec![Point::new(5.0, 5.0)];
    let world = World::new(&hall, rng(0)).unwrap();
    let found = |range_m| {
        world
            .near(Point::new(5.0, 5.0), range_m)
            .into_iter()
            .map(|near| near.body)
            .collect::<Vec<_>>()
    };
    assert_eq!(found(0.0), [Body::Robot(0)]);
    assert_eq!(found(4.0), [Body::Obstacle(1), Body::Robot(0)]);
    assert_eq!(
        found(4.3),
        [Body::Obstacle(0), Body::Obstacle(1), Body::Robot(0)]
    );
}

#[test]
fn nonsense_finds_nothing() {
    let world = World::new(&reception(100), rng(0)).unwrap();
    assert_eq!(world.near(Point::new(f64::NAN, 1.0), 100.0), []);
    assert_eq!(
        world.near(Point::new(1.0, f64::INFINITY), f64::INFINITY),
        []
    );
    assert_eq!(world.near(Point::new(1.0, 1.0), f64::NAN), []);
    assert_eq!(world.near(Point::new(1.0, 1.0), -100.0), []);
    assert_eq!(
        world.near(Point::new(-1e300, 1.0), f64::INFINITY).len(),
        100
    );
}

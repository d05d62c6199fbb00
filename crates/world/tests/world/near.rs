//! Searching for bodies near a point.

use crate::halls::{TestWorld, any_hall, crowded, reception, rng};
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
        for _ in 0..10 {
            world.advance(&vec![None; hall.robots.len()]);
        }
        let point = Point::new(at.0 * hall.field.size_m.0, at.1 * hall.field.size_m.1);

        let mut expected = Vec::new();
        for (body, center) in bodies(&world) {
            let offset = center - point;
            if offset.x * offset.x + offset.y * offset.y <= range_m * range_m {
                expected.push(Near { body, center });
            }
        }

        prop_assert_eq!(world.near(point, range_m), expected);
    }
}

/// All bodies with their centers, in the order of [`Body`].
fn bodies(world: &TestWorld) -> Vec<(Body, Point)> {
    let mut bodies = Vec::new();

    for (index, &center) in world.obstacles().iter().enumerate() {
        bodies.push((Body::Obstacle(index), center));
    }
    for (index, &center) in world.robots().iter().enumerate() {
        bodies.push((Body::Robot(index), center));
    }
    for (index, &center) in world.guests().iter().enumerate() {
        bodies.push((Body::Guest(index), center));
    }

    bodies
}

#[test]
fn the_range_is_a_circle_that_includes_its_center() {
    let mut hall = reception(0);
    hall.obstacles = vec![Point::new(8.0, 8.0), Point::new(5.0, 9.0)];
    hall.robots = vec![Point::new(5.0, 5.0)];
    let world = World::new(&hall, rng(0)).unwrap();

    assert_eq!(found(&world, 0.0), [Body::Robot(0)]);
    assert_eq!(found(&world, 4.0), [Body::Obstacle(1), Body::Robot(0)]);
    assert_eq!(
        found(&world, 4.3),
        [Body::Obstacle(0), Body::Obstacle(1), Body::Robot(0)]
    );
}

/// The bodies within `range_m` of (5, 5).
fn found(world: &TestWorld, range_m: f64) -> Vec<Body> {
    let near = world.near(Point::new(5.0, 5.0), range_m);
    near.into_iter().map(|near| near.body).collect()
}

#[test]
fn meaningless_arguments_find_nothing() {
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

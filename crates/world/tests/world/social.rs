//! Guests who walk by a model of how people walk: what they want is the random walk's, and they are where bodies can be.

use crate::halls::{is_inside, overlap, reception, rng};
use world::{
    CrowdGuests, CrowdModel, GuestWalk, HallError, MoveOutcome, Point, Reaction, Response, World,
};

const MODELS: [CrowdModel; 2] = [CrowdModel::CollisionFree, CrowdModel::SocialForce];

fn walk(model: CrowdModel) -> GuestWalk {
    GuestWalk::Crowd(CrowdGuests {
        model,
        wants: Vec::new(),
    })
}

#[test]
fn wishes_are_those_of_the_random_walk_and_draw_the_same_numbers() {
    for model in MODELS {
        let hall = reception(100);
        let mut random = World::new(&hall, rng(5)).unwrap();
        let mut social = World::with_guests(&hall, walk(model), rng(5)).unwrap();
        assert_eq!(random.guests(), social.guests());
        for _ in 0..100 {
            random.advance(&[]);
            social.advance(&[]);
            assert_eq!(random.courses(), social.courses());
        }
        assert_ne!(random.guests(), social.guests());
        assert!(!social.has_passages());
    }
}

#[test]
fn guests_of_a_model_stay_off_robots_obstacles_and_the_edge_and_keep_apart() {
    for model in MODELS {
        let mut hall = reception(100);
        hall.tick_s = 0.5;
        hall.max_speed_mps = 1.0;
        hall.robots = vec![Point::new(7.6, 7.6), Point::new(2.0, 2.0)];
        hall.obstacles = vec![Point::new(5.0, 5.0), Point::new(10.0, 4.0)];
        let body_m = hall.field.body_m;
        let mut world = World::with_guests(&hall, walk(model), rng(3)).unwrap();
        let mut moved = 0;
        for tick in 0..200 {
            let before = world.guests().to_vec();
            // A robot drives through the hall.
            let to = world.robots()[0] + Point::new(if tick % 40 < 20 { 0.3 } else { -0.3 }, 0.0);
            let outcomes = world.advance(&[Some(to), None]);
            assert_ne!(outcomes[0], MoveOutcome::TooFast);

            let fixed: Vec<Point> = [world.robots(), world.obstacles()].concat();
            for (guest, &at) in world.guests().iter().enumerate() {
                assert!(is_inside(&hall.field, at), "guest {guest} at {at}");
                for &other in &fixed {
                    assert!(
                        !overlap(body_m, at, other),
                        "guest {guest} at {at} on {other}"
                    );
                }
                moved += usize::from(at.distance_m(before[guest]) > 0.01);
            }
        }
        // Most of them walk most of the time.
        assert!(moved > 200 * 50, "{model:?}: {moved}");

        // Discs of a body's breadth do not lie on each other by more than a fifth.
        let guests = world.guests();
        let mut nearest_m = f64::INFINITY;
        for (index, at) in guests.iter().enumerate() {
            for other in &guests[index + 1..] {
                nearest_m = nearest_m.min(at.distance_m(*other));
            }
        }
        assert!(nearest_m > 0.8 * body_m, "{model:?}: {nearest_m}");
    }
}

#[test]
fn copies_of_a_crowd_walk_alike() {
    for model in MODELS {
        let hall = reception(60);
        let mut world = World::with_guests(&hall, walk(model), rng(8)).unwrap();
        for _ in 0..20 {
            world.advance(&[]);
        }
        let mut copy = world.clone();
        assert_eq!(world, copy);
        for _ in 0..20 {
            world.advance(&[]);
            copy.advance(&[]);
        }
        assert_eq!(world, copy);
        copy.advance(&[]);
        assert_ne!(world, copy);
    }
}

#[test]
fn guests_of_a_model_react_to_robots() {
    for model in MODELS {
        let mut hall = reception(1);
        hall.robots = vec![Point::new(7.6, 7.6)];
        hall.tick_s = 0.5;
        let mut world = World::with_guests(&hall, walk(model), rng(4)).unwrap();
        let approach = Reaction {
            robot: 0,
            range_m: 100.0,
            response: Response::Approach,
            guest: None,
        };
        let distance_m =
            |world: &crate::halls::TestWorld| world.guests()[0].distance_m(world.robots()[0]);
        let before_m = distance_m(&world);
        for _ in 0..60 {
            world.advance_with(&[None], &[approach]);
        }
        let after_m = distance_m(&world);
        assert!(
            after_m < before_m - 2.0 || after_m < 1.5,
            "{before_m} m, then {after_m} m"
        );
    }
}

#[test]
fn bodies_that_no_person_has_are_refused() {
    let mut hall = reception(1);
    hall.field.body_m = 1.9;
    let error = World::with_guests(&hall, walk(CrowdModel::SocialForce), rng(1));
    assert!(
        matches!(error, Err(HallError::OutOfRange { .. })),
        "{error:?}"
    );
}

#[test]
fn a_large_crowd_is_the_same_for_any_number_of_threads() {
    let mut hall = reception(25_000);
    hall.field.size_m = (250.0, 250.0);
    hall.tick_s = 0.5;
    hall.robots = vec![Point::new(7.6, 7.6)];
    let mut alone = World::with_guests(&hall, walk(CrowdModel::CollisionFree), rng(2)).unwrap();
    let mut shared = alone.clone();
    shared.set_threads(3);
    for _ in 0..3 {
        alone.advance(&[None]);
        shared.advance(&[None]);
    }
    assert_eq!(alone, shared);
}

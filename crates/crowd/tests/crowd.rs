//! Crowds: what holds for every model.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use crowd::{
    AtEnd, CollisionFree, CrowdError, Disc, Itinerary, Pedestrian, Pedestrians, Premises,
    SocialForce, Surroundings, Vector, WalkingModel, WallLine, Waypoint,
};
use proptest::prelude::*;

fn line(from: (f64, f64), to: (f64, f64)) -> WallLine {
    WallLine::new(Vector::new(from.0, from.1), Vector::new(to.0, to.1))
}

/// A room of 20 m by 20 m with a wall in its middle that leaves doors at both ends.
fn room() -> Premises {
    Premises {
        walls: vec![
            line((0.0, 0.0), (20.0, 0.0)),
            line((20.0, 0.0), (20.0, 20.0)),
            line((20.0, 20.0), (0.0, 20.0)),
            line((0.0, 20.0), (0.0, 0.0)),
            line((10.0, 1.0), (10.0, 19.0)),
        ],
        columns: vec![Disc {
            center: Vector::new(5.0, 5.0),
            radius_m: 0.5,
            velocity: Vector::ZERO,
        }],
        period_m: None,
    }
}

/// A crowd of up to 1,600 in the left half of the room who want to the right.
fn crowd<M: WalkingModel>(model: M, count: usize) -> Pedestrians<M> {
    let mut crowd = Pedestrians::new(model, &room()).unwrap();
    let right = crowd
        .add_itinerary(Itinerary::along(Vector::new(1.0, 0.0)))
        .unwrap();
    let door = crowd
        .add_itinerary(Itinerary::leaving_by(&[
            line((10.0, 19.0), (10.0, 20.0)),
            line((19.0, 5.0), (19.0, 15.0)),
        ]))
        .unwrap();
    for index in 0..count {
        let place = Vector::new(
            0.3 + 0.24 * (index % 40) as f64,
            0.3 + 0.48 * (index / 40) as f64,
        );
        let person = Pedestrian {
            itinerary: if index % 3 == 0 { right } else { door },
            desired_mps: 1.0 + 0.01 * (index % 50) as f64,
            starts_s: 0.1 * (index % 7) as f64,
            radius_m: 0.12,
            ..Pedestrian::at(place)
        };
        crowd.add(person).unwrap();
    }
    crowd
}

fn bits<M: WalkingModel>(crowd: &Pedestrians<M>) -> Vec<(u32, [u64; 4])> {
    let mut bits: Vec<_> = crowd
        .iter()
        .map(|person| {
            let (at, by) = (person.position, person.velocity);
            (person.id, [at.x, at.y, by.x, by.y].map(f64::to_bits))
        })
        .collect();
    bits.sort_unstable();
    bits
}

#[test]
fn the_state_does_not_depend_on_the_number_of_threads() {
    fn check<M: WalkingModel + Clone>(model: &M) {
        let play = |threads| {
            let mut crowd = crowd(model.clone(), 1600);
            // More than one piece of work.
            for index in 0..1500 {
                let at = Vector::new(
                    11.0 + 0.2 * (index % 40) as f64,
                    0.5 + 0.5 * (index / 40) as f64,
                );
                let person = Pedestrian {
                    radius_m: 0.08,
                    ..Pedestrian::at(at)
                };
                crowd.add(person).unwrap();
            }
            for _ in 0..40 {
                crowd.step(model.longest_step_s(), threads);
            }
            bits(&crowd)
        };
        let one = play(1);
        assert_eq!(one, play(2));
        assert_eq!(one, play(7));
    }
    check(&CollisionFree::default());
    check(&SocialForce::default());
}

/// A crowd that is built from the state of another one goes on as the other one, although its people are stored in another order.
#[test]
fn the_state_is_a_function_of_the_state_before() {
    let mut first = crowd(CollisionFree::default(), 900);
    for _ in 0..100 {
        first.step(0.05, 1);
    }
    let mut second = crowd(CollisionFree::default(), 900);
    for id in 0..900 {
        match first.get(id).copied() {
            None => assert!(second.remove(id)),
            Some(person) => {
                let person = Pedestrian {
                    starts_s: 0.0,
                    ..person
                };
                assert_eq!(second.change(id, |other| *other = person), Ok(true));
            }
        }
    }
    for _ in 0..100 {
        first.step(0.05, 1);
        second.step(0.05, 1);
    }
    assert_eq!(bits(&first), bits(&second));
}

/// Walks as its seed says, whatever is in the way.
#[derive(Clone)]
struct Reckless(u64);

impl WalkingModel for Reckless {
    fn reach_m(&self) -> f64 {
        1.0
    }

    fn longest_step_s(&self) -> f64 {
        0.1
    }

    fn body_radius_m(&self) -> f64 {
        0.2
    }

    fn velocity(&self, seen: &Surroundings<'_>) -> Vector {
        let bits =
            seen.person.position.x.to_bits() ^ seen.person.position.y.to_bits().rotate_left(21);
        let mixed = (bits ^ self.0).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let part = |shift: u32| (mixed >> shift & 0xffff) as f64 / 32768.0 - 1.0;
        Vector::new(20.0 * part(10), 20.0 * part(40))
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]

    #[test]
    fn nobody_leaves_a_closed_room_whatever_the_model(seed in any::<u64>()) {
        let mut crowd = Pedestrians::new(Reckless(seed), &Premises {
            walls: room().walls,
            ..Premises::default()
        }).unwrap();
        crowd.add_itinerary(Itinerary::along(Vector::new(1.0, 0.0))).unwrap();
        // The wall in the middle has doors, so people may be on both sides.
        for index in 0..50_u32 {
            let at = Vector::new(1.0 + 0.17 * f64::from(index), 1.0 + 0.3 * f64::from(index));
            crowd.add(Pedestrian::at(at)).unwrap();
        }
        for _ in 0..100 {
            let before: Vec<Vector> = (0..50).map(|id| crowd.get(id).unwrap().position).collect();
            crowd.step(0.1, 1);
            for person in crowd.iter() {
                let (at, was) = (person.position, before[person.id as usize]);
                for wall in room().walls {
                    prop_assert!(at == was || !wall.is_met(was, at));
                }
                prop_assert!(at.x >= 0.17 && at.x <= 19.83 && at.y >= 0.17 && at.y <= 19.83);
            }
        }
        prop_assert!(crowd.through_walls() > 0, "the model tried");
    }
}

/// Sees: what a person has around them is what a search over all people finds.
#[derive(Clone)]
struct Counts;

impl WalkingModel for Counts {
    fn reach_m(&self) -> f64 {
        1.3
    }

    fn longest_step_s(&self) -> f64 {
        0.1
    }

    fn body_radius_m(&self) -> f64 {
        0.2
    }

    fn velocity(&self, seen: &Surroundings<'_>) -> Vector {
        let distances: f64 = seen.others.iter().map(|other| other.distance_m).sum();
        Vector::new(seen.others.len() as f64 / 1000.0, distances / 1000.0)
    }
}

#[test]
fn everybody_within_reach_is_seen_also_around_the_end_of_a_ring() {
    for period_m in [None, Some(3.0), Some(9.0), Some(26.0)] {
        let premises = Premises {
            period_m,
            ..Premises::default()
        };
        let mut crowd = Pedestrians::new(Counts, &premises).unwrap();
        crowd
            .add_itinerary(Itinerary::along(Vector::new(1.0, 0.0)))
            .unwrap();
        let mut places = Vec::new();
        for index in 0..300 {
            let x = f64::from(index * 37 % 101) * period_m.unwrap_or(20.0) / 101.0;
            let y = f64::from(index * 53 % 97) * 6.0 / 97.0 - 3.0;
            places.push(Vector::new(x, y));
            crowd.add(Pedestrian::at(Vector::new(x, y))).unwrap();
        }
        crowd.step(0.1, 1);

        for (id, place) in places.iter().enumerate() {
            let mut count = 0;
            for (other, at) in places.iter().enumerate() {
                let mut offset = *at - *place;
                if let Some(period_m) = period_m {
                    offset.x -= (offset.x / period_m).round() * period_m;
                }
                count += usize::from(other != id && offset.length() <= 1.3);
            }
            let seen = crowd.get(id as u32).unwrap().velocity.x * 1000.0;
            assert_eq!(seen.round() as usize, count, "{period_m:?}, {id}");
        }
    }
}

#[test]
fn a_wall_hides_who_is_behind_it() {
    let mut crowd = Pedestrians::new(Counts, &room()).unwrap();
    crowd.add_itinerary(Itinerary::default()).unwrap();
    for x in [9.5, 10.3, 9.0] {
        crowd.add(Pedestrian::at(Vector::new(x, 10.0))).unwrap();
    }
    crowd.step(0.1, 1);
    let seen = |id| (crowd.get(id).unwrap().velocity.x * 1000.0).round();
    assert_eq!([seen(0), seen(1), seen(2)], [1.0, 0.0, 1.0]);
}

#[test]
fn who_is_alone_walks_at_the_desired_speed_and_stands_at_the_end() {
    let mut crowd = Pedestrians::new(CollisionFree::default(), &Premises::default()).unwrap();
    let goal = Vector::new(13.4, 0.0);
    let way = Itinerary {
        waypoints: vec![Waypoint::Place {
            at: goal,
            within_m: 0.05,
        }],
        at_end: AtEnd::Stand,
    };
    let way = crowd.add_itinerary(way).unwrap();
    let person = Pedestrian {
        starts_s: 2.0,
        itinerary: way,
        ..Pedestrian::at(Vector::ZERO)
    };
    let id = crowd.add(person).unwrap();

    crowd.advance(2.0, 1);
    assert_eq!(crowd.get(id).unwrap().position, Vector::ZERO);
    crowd.advance(5.0, 1);
    assert!((crowd.get(id).unwrap().position.x - 6.7).abs() < 1e-9);
    crowd.advance(20.0, 1);
    assert!(crowd.has_arrived(id));
    assert!((crowd.get(id).unwrap().position - goal).length() < 0.1);
}

#[test]
fn nobody_walks_into_a_robot_that_stands_in_the_way() {
    for threads in [1, 2] {
        let mut crowd = Pedestrians::new(CollisionFree::default(), &Premises::default()).unwrap();
        crowd
            .add_itinerary(Itinerary::along(Vector::new(1.0, 0.0)))
            .unwrap();
        let id = crowd.add(Pedestrian::at(Vector::ZERO)).unwrap();
        let robot = Disc {
            center: Vector::new(3.0, 0.0),
            radius_m: 0.3,
            velocity: Vector::ZERO,
        };
        crowd.set_robots(&[robot]).unwrap();
        for _ in 0..200 {
            crowd.step(0.05, threads);
            let distance_m = (crowd.get(id).unwrap().position - robot.center).length();
            assert!(distance_m >= 0.48 - 1e-9, "{distance_m}");
        }
        crowd.set_robots(&[]).unwrap();
        crowd.advance(5.0, threads);
        assert!(crowd.get(id).unwrap().position.x > 5.0);
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let infinite = Premises {
        walls: vec![line((0.0, f64::INFINITY), (0.0, 0.0))],
        ..Premises::default()
    };
    let refused = Pedestrians::new(Counts, &infinite).map(|_| ());
    assert_eq!(refused, Err(CrowdError::NotFinite));

    let mut crowd = Pedestrians::new(Counts, &Premises::default()).unwrap();
    let person = Pedestrian::at(Vector::ZERO);
    assert_eq!(crowd.add(person), Err(CrowdError::NoItinerary));
    crowd.add_itinerary(Itinerary::default()).unwrap();
    let fast = Pedestrian {
        desired_mps: 11.0,
        ..person
    };
    assert_eq!(crowd.add(fast), Err(CrowdError::WrongPerson));
    assert_eq!(crowd.add(person), Ok(0));
    assert_eq!(crowd.change(7, |_| {}), Ok(false));
    assert!(crowd.remove(0) && !crowd.remove(0));
    assert!(crowd.is_empty());
    crowd.step(0.1, 2);
    assert_eq!(crowd.get(0), None);
}

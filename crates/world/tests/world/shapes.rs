//! Bodies of any shape among walls: nothing overlaps, and nothing passes through a wall, whatever is proposed.

use std::collections::BTreeMap;

use crate::halls::{FT, TestWorld, reception, rng, triangular};
use proptest::prelude::*;
use rand::{Rng, RngExt};
use world::{
    Blocker, Body, Field, Footprint, Guests, Hall, HallError, MoveOutcome, Placer, Point, Region,
    Shape, Shapes, WALLS_MAX, Wall, World,
};

/// Whether two shapes overlap by more than 2 nm, implemented independently: by the smallest distance from the center of the disc
/// to the rectangle that stands for the other, found by halving.
fn overlap(one: Shape, at: Point, other: Shape, other_at: Point) -> bool {
    let slack_m = 2e-9;
    let offset = other_at - at;
    match (one, other) {
        (Shape::Rectangle { .. }, Shape::Rectangle { .. }) => {
            let (a, b) = (one.half_m(), other.half_m());
            offset.x.abs() < a.0 + b.0 - slack_m && offset.y.abs() < a.1 + b.1 - slack_m
        }
        (Shape::Disc { radius_m }, _) => nearest_m(other, offset) < radius_m - slack_m,
        (_, Shape::Disc { radius_m }) => nearest_m(one, offset) < radius_m - slack_m,
    }
}

/// The distance from a shape at the origin to a point.
fn nearest_m(shape: Shape, point: Point) -> f64 {
    match shape {
        Shape::Disc { radius_m } => point.distance_m(Point::default()) - radius_m,
        Shape::Rectangle { .. } => {
            let (x_m, y_m) = shape.half_m();
            let nearest = Point::new(point.x.clamp(-x_m, x_m), point.y.clamp(-y_m, y_m));
            nearest.distance_m(point)
        }
    }
}

/// Whether a shape overlaps a wall by more than 2 nm: a point of the wall is in it. Found by walking along the wall.
fn is_on_wall(shape: Shape, at: Point, wall: &Wall) -> bool {
    let inner = match shape {
        Shape::Disc { radius_m } => Shape::Disc {
            radius_m: radius_m - 2e-9,
        },
        Shape::Rectangle { width_m, height_m } => Shape::Rectangle {
            width_m: width_m - 4e-9,
            height_m: height_m - 4e-9,
        },
    };
    // The distance to a convex shape has one minimum along a line.
    let (mut low, mut high) = (0.0, 1.0);
    let point = |share: f64| wall.from + (wall.to - wall.from) * share - at;
    for _ in 0..200 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if nearest_m(inner, point(a)) <= nearest_m(inner, point(b)) {
            high = b;
        } else {
            low = a;
        }
    }
    let depth_m = nearest_m(inner, point((low + high) / 2.0));
    match shape {
        Shape::Disc { .. } => depth_m < 0.0,
        // Within the rectangle the distance is 0, at its edge as well.
        Shape::Rectangle { .. } => {
            let (x_m, y_m) = inner.half_m();
            let nearest = point((low + high) / 2.0);
            depth_m == 0.0 && nearest.x.abs() < x_m - 1e-9 && nearest.y.abs() < y_m - 1e-9
        }
    }
}

/// Whether the straight way of a center crosses a wall.
fn crosses(from: Point, to: Point, wall: &Wall) -> bool {
    let side = |a: Point, b: Point, c: Point| (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    side(from, to, wall.from) * side(from, to, wall.to) < 0.0
        && side(wall.from, wall.to, from) * side(wall.from, wall.to, to) < 0.0
}

fn movers(world: &TestWorld) -> Vec<(Body, Point)> {
    let robots = world.robots().iter().enumerate();
    let guests = world.guests().iter().enumerate();
    robots
        .map(|(index, &at)| (Body::Robot(index), at))
        .chain(guests.map(|(index, &at)| (Body::Guest(index), at)))
        .collect()
}

fn check_promises(world: &TestWorld, before: &[(Body, Point)]) {
    let movers = movers(world);
    let (width_m, height_m) = world.field().size_m;

    for (index, &(body, at)) in movers.iter().enumerate() {
        let shape = world.shape(body);
        let (x_m, y_m) = shape.half_m();
        let slack_m = 2e-9;
        assert!(
            at.x - x_m >= -slack_m
                && at.y - y_m >= -slack_m
                && at.x + x_m <= width_m + slack_m
                && at.y + y_m <= height_m + slack_m,
            "{body:?} at {at} left the field"
        );

        for &(other, other_at) in &movers[..index] {
            let is_hit = overlap(shape, at, world.shape(other), other_at);
            assert!(!is_hit, "{body:?} at {at} overlaps {other:?} at {other_at}");
        }
        for (obstacle, &other_at) in world.obstacles().iter().enumerate() {
            let other = world.shape(Body::Obstacle(obstacle));
            let is_hit = overlap(shape, at, other, other_at);
            assert!(!is_hit, "{body:?} at {at} overlaps obstacle {obstacle}");
        }
        for (wall_index, wall) in world.walls().iter().enumerate() {
            assert!(
                !is_on_wall(shape, at, wall),
                "{body:?} at {at} stands on wall {wall_index} {wall:?}"
            );
            if let Some((_, from)) = before.get(index) {
                assert!(
                    !crosses(*from, at, wall),
                    "{body:?} passed from {from} to {at} through wall {wall_index} {wall:?}"
                );
            }
        }
    }
}

prop_compose! {
    fn any_shape()(is_disc in any::<bool>(), x_m in 0.05..2.0, y_m in 0.05..2.0) -> Shape {
        if is_disc {
            Shape::Disc { radius_m: x_m / 2.0 }
        } else {
            Shape::Rectangle { width_m: x_m, height_m: y_m }
        }
    }
}

type Share = (f64, f64);

prop_compose! {
    /// A field of 4 to 20 m with walls, obstacles, robots and guests; robots cross it in a tick.
    pub(crate) fn any_hall()(
        size_m in (4.0..20.0, 4.0..20.0),
        body_m in 0.1..1.0,
        walls in prop::collection::vec(((0.0..=1.0, 0.0..=1.0), (0.0..=1.0, 0.0..=1.0)), 0..8),
        obstacles in prop::collection::vec((prop::option::of(any_shape()), (0.0..=1.0, 0.0..=1.0)), 0..5),
        robots in prop::collection::vec(prop::option::of(any_shape()), 0..8),
        guests in 0_usize..6,
        seed in any::<u64>(),
    ) -> Option<Hall> {
        let at = |(x, y): Share| Point::new(x * size_m.0, y * size_m.1);
        let mut shapes = Shapes {
            walls: walls.into_iter().map(|(from, to)| Wall { from: at(from), to: at(to) }).collect(),
            ..Shapes::default()
        };
        shapes.walls.retain(|wall| wall.from.distance_m(wall.to) > 0.001);

        let mut centers = Vec::new();
        for (shape, share) in obstacles {
            let (x_m, y_m) = shape.unwrap_or(Shape::square(body_m)).half_m();
            centers.push(Point::new(
                x_m + share.0 * (size_m.0 - 2.0 * x_m),
                y_m + share.1 * (size_m.1 - 2.0 * y_m),
            ));
            if let Some(shape) = shape {
                shapes.obstacles.insert(centers.len() - 1, shape);
            }
        }
        let mut hall = Hall {
            field: Field { size_m, body_m },
            obstacles: centers,
            guests: Guests {
                count: 0,
                speed_mps: triangular(0.0, 1.0, 40.0),
                duration_s: triangular(0.0, 1.0, 4.0),
            },
            robots: Vec::new(),
            shapes,
            tick_s: 0.5,
            max_speed_mps: 100.0,
        };

        let mut placer = Placer::new(&hall).unwrap();
        for shape in robots {
            if let Some(at) = placer.place(shape.map(Footprint::from), Region::Field, &mut rng(seed ^ hall.robots.len() as u64)) {
                if let Some(shape) = shape {
                    hall.shapes.robots.insert(hall.robots.len(), shape);
                }
                hall.robots.push(at);
            }
        }
        hall.guests.count = guests;
        match World::new(&hall, rng(seed)) {
            Ok(_) => Some(hall),
            Err(HallError::NoRoom { .. }) => None,
            Err(error) => panic!("{error}"),
        }
    }
}

/// Proposals anywhere on the field, next to where the robot stands, and beside what it may touch.
fn proposals(world: &TestWorld, rng: &mut impl Rng) -> Vec<Option<Point>> {
    let (width_m, height_m) = world.field().size_m;
    let mut proposals = Vec::new();
    for (index, &at) in world.robots().iter().enumerate() {
        let anywhere = Point::new(
            rng.random::<f64>() * width_m,
            rng.random::<f64>() * height_m,
        );
        let near = at + (anywhere - Point::new(width_m, height_m) * 0.5) * 0.1;
        let (half_x_m, half_y_m) = world.shape(Body::Robot(index)).half_m();
        let walls = world.walls();
        proposals.push(Some(match rng.random_range(0..4) {
            0 => near,
            // Flush with a wall at one of its ends, where the tolerance counts.
            1 if !walls.is_empty() => {
                let wall = walls[rng.random_range(0..walls.len())];
                Point::new(wall.from.x + half_x_m, wall.to.y - half_y_m)
            }
            2 => Point::new(at.x, anywhere.y),
            _ => anywhere,
        }));
    }
    proposals
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_two_bodies_overlap_and_none_passes_through_a_wall(hall in any_hall(), seed in any::<u64>()) {
        let Some(hall) = hall else { return Ok(()) };
        // With another seed the guests of a crowded hall may not fit.
        let Ok(mut world) = World::new(&hall, rng(seed)) else { return Ok(()) };
        let mut twin = World::new(&hall, rng(seed)).unwrap();
        check_promises(&world, &[]);

        let mut random = rng(seed ^ 1);
        for _ in 0..30 {
            let before = movers(&world);
            let proposed = proposals(&world, &mut random);
            let verdicts = world.advance(&proposed);
            check_promises(&world, &before);

            // The same proposals give the same world, and who stays is told why.
            prop_assert_eq!(&verdicts, &twin.advance(&proposed));
            for (index, verdict) in verdicts.iter().enumerate() {
                let from = before[index].1;
                let to = match verdict {
                    MoveOutcome::Advanced => proposed[index].unwrap_or(from),
                    _ => from,
                };
                prop_assert_eq!(world.robots()[index], to);
            }
        }
        prop_assert!(world == twin);
    }

    #[test]
    fn squares_of_a_size_of_their_own_move_as_squares_of_the_field(hall in crate::halls::any_hall(), seed in any::<u64>()) {
        // Without walls, and where nothing is fast enough to jump over a body, the shape given by hand changes nothing.
        let mut hall = hall;
        hall.guests.count = 0;
        hall.max_speed_mps = hall.max_speed_mps.min(0.4 * hall.field.body_m / hall.tick_s);
        let mut shaped = hall.clone();
        let square = Shape::square(hall.field.body_m);
        shaped.shapes.robots = (0..hall.robots.len()).map(|index| (index, square)).collect();
        let mut plain = World::new(&hall, rng(seed)).unwrap();
        let mut shaped = World::new(&shaped, rng(seed)).unwrap();
        let mut random = rng(seed ^ 1);
        for _ in 0..30 {
            let mut proposed = Vec::new();
            for &at in plain.robots() {
                let step = Point::new(random.random::<f64>() - 0.5, random.random::<f64>() - 0.5);
                proposed.push(Some(at + step * plain.stride_m()));
            }
            prop_assert_eq!(plain.advance(&proposed), shaped.advance(&proposed));
            prop_assert_eq!(plain.robots(), shaped.robots());
        }
    }
}

/// A room of 4 m by 4 m in the middle of a hall of 10 m by 10 m, with one robot in it.
fn room(shape: Shape) -> TestWorld {
    let corners = [(3.0, 3.0), (7.0, 3.0), (7.0, 7.0), (3.0, 7.0), (3.0, 3.0)];
    let corners = corners.map(|(x, y)| Point::new(x, y));
    let walls = corners.windows(2).map(|ends| Wall {
        from: ends[0],
        to: ends[1],
    });
    let mut hall = reception(0);
    hall.field.size_m = (10.0, 10.0);
    hall.max_speed_mps = 1e6;
    hall.robots = vec![Point::new(5.0, 5.0)];
    hall.shapes = Shapes {
        walls: walls.collect(),
        robots: BTreeMap::from([(0, shape)]),
        ..Shapes::default()
    };
    World::new(&hall, rng(1)).unwrap()
}

#[test]
fn a_robot_in_a_closed_room_never_leaves_it() {
    for shape in [
        Shape::Disc { radius_m: 0.0005 },
        Shape::Disc { radius_m: 1.0 },
        Shape::square(0.001),
        Shape::Rectangle {
            width_m: 3.9,
            height_m: 0.001,
        },
    ] {
        let mut world = room(shape);
        let mut random = rng(7);
        let mut blocked = 0;
        for _ in 0..20_000 {
            // Also exactly at and beside corners.
            let step = Point::new(
                random.random_range(-40..=40) as f64 * 0.1,
                random.random::<f64>() * 8.0 - 4.0,
            );
            let to = match random.random_range(0..3) {
                0 => Point::new(5.0, 5.0) + step,
                1 => world.robots()[0] + step * 0.01,
                _ => world.robots()[0] + Point::new(step.x, 0.0),
            };
            let verdict = world.advance(&[Some(to)]);
            if let [MoveOutcome::Blocked { by }] = verdict[..] {
                assert!(matches!(by, Blocker::Wall(_) | Blocker::Edge), "{by:?}");
                blocked += 1;
            }
            let at = world.robots()[0];
            assert!(
                (3.0..=7.0).contains(&at.x) && (3.0..=7.0).contains(&at.y),
                "{shape:?} at {at}"
            );
        }
        assert!(blocked > 1000, "{blocked}");
    }
}

#[test]
fn thin_obstacles_with_a_size_of_their_own_are_not_jumped_over() {
    let mut hall = reception(0);
    hall.max_speed_mps = 1e6;
    hall.robots = vec![Point::new(2.0, 5.0)];
    hall.obstacles = vec![Point::new(5.0, 5.0)];
    hall.shapes.obstacles.insert(
        0,
        Shape::Rectangle {
            width_m: 0.01,
            height_m: 8.0,
        },
    );
    let mut world = World::new(&hall, rng(1)).unwrap();
    let over = Some(Point::new(8.0, 5.0));
    let by = Blocker::Body(Body::Obstacle(0));
    assert_eq!(world.advance(&[over]), [MoveOutcome::Blocked { by }]);
    // Around its end.
    for to in [(2.0, 9.4), (8.0, 9.4), (8.0, 5.0)] {
        let to = Some(Point::new(to.0, to.1));
        assert_eq!(world.advance(&[to]), [MoveOutcome::Advanced]);
    }

    // A square of the field is jumped over, as in the paper.
    hall.shapes = Shapes::default();
    let mut world = World::new(&hall, rng(1)).unwrap();
    assert_eq!(world.advance(&[over]), [MoveOutcome::Advanced]);
}

#[test]
fn guests_fill_a_hall_with_walls_and_stay_off_them() {
    let mut hall = reception(1_000_000);
    hall.shapes.walls = vec![
        Wall {
            from: Point::new(1.0, 1.0),
            to: Point::new(14.0, 9.0),
        },
        Wall {
            from: Point::new(3.0, 12.0),
            to: Point::new(9.0, 12.0),
        },
    ];
    hall.obstacles = vec![Point::new(11.0, 3.0)];
    hall.shapes
        .obstacles
        .insert(0, Shape::Disc { radius_m: 1.3 });
    let Err(HallError::NoRoom { room, .. }) = World::new(&hall, rng(1)) else {
        panic!("a million guests fit");
    };
    assert!((400..575).contains(&room), "{room}");

    hall.guests.count = room;
    let mut world = World::new(&hall, rng(1)).unwrap();
    for _ in 0..20 {
        let before = movers(&world);
        world.advance(&[]);
        check_promises(&world, &before);
    }
}

#[test]
fn what_cannot_be_is_refused_with_its_index() {
    let refused = |change: &dyn Fn(&mut Hall)| {
        let mut hall = reception(0);
        hall.robots = vec![Point::new(5.0, 5.0)];
        change(&mut hall);
        World::new(&hall, rng(1)).unwrap_err().to_string()
    };
    let wall = |from: (f64, f64), to: (f64, f64)| Wall {
        from: Point::new(from.0, from.1),
        to: Point::new(to.0, to.1),
    };

    assert_eq!(
        refused(&|hall| hall.shapes.walls = vec![wall((1.0, 1.0), (1.0, 99.0))]),
        "wall 1 has an end at (1, 99) m, which is not on the field"
    );
    assert_eq!(
        refused(&|hall| hall.shapes.walls = vec![wall((1.0, 1.0), (1.0, 1.0))]),
        "wall 1 at (1, 1) m is shorter than 0.001 m"
    );
    assert_eq!(
        refused(&|hall| hall.shapes.walls = vec![wall((5.0, 4.8), (9.0, 9.0))]),
        "robot 1 at (5, 5) m stands on wall 1"
    );
    let disc = |radius_m| Shape::Disc { radius_m };
    assert_eq!(
        refused(&|hall| hall.shapes.robots = BTreeMap::from([(0, disc(0.0))])),
        "robot 1 is 0.0 m wide or high; must be a number from 0.001 to 1000000.0"
    );
    assert_eq!(
        refused(&|hall| hall.shapes.robots = BTreeMap::from([(0, disc(6.0))])),
        "robot 1 at (5, 5) m is not entirely inside the field"
    );
    let many = vec![wall((1.0, 1.0), (1.0, 2.0)); WALLS_MAX + 1];
    assert_eq!(
        refused(&|hall| hall.shapes.walls.clone_from(&many)),
        "4097 walls are too many; at most 4096 are supported"
    );
}

#[test]
fn as_many_walls_as_allowed_do_not_slow_a_tick_down() {
    // Walls across the whole field: the index must not hold each in every cell.
    let mut hall = reception(20);
    hall.field.size_m = (1000.0, 1000.0);
    let step_m = 1000.0 / WALLS_MAX as f64;
    for index in 0..WALLS_MAX {
        let at_m = index as f64 * step_m;
        hall.shapes.walls.push(Wall {
            from: Point::new(at_m, 20.0),
            to: Point::new(1000.0, 1000.0 - at_m * 0.9),
        });
    }
    let region = Region::Rectangle(Point::new(1.0, 1.0), Point::new(999.0, 10.0));
    let mut placer = Placer::new(&hall).unwrap();
    for index in 0..5 {
        hall.robots
            .push(placer.place(None, region, &mut rng(index)).unwrap());
    }

    let mut world = World::new(&hall, rng(1)).unwrap();
    for _ in 0..100 {
        let before = movers(&world);
        let here = world.robots().to_vec();
        world.advance(
            &here
                .iter()
                .map(|&at| Some(at + Point::new(0.0, 0.05)))
                .collect::<Vec<_>>(),
        );
        assert_eq!(before.len(), 25);
    }
}

#[test]
fn places_are_drawn_within_their_region() {
    let hall = reception(0);
    let mut placer = Placer::new(&hall).unwrap();
    let center = Point::new(5.0, 5.0);
    let disc = Region::Disc {
        center,
        radius_m: 2.0,
    };
    let shape = Some(Footprint::from(Shape::Disc { radius_m: 0.1 }));
    let mut xs_m = Vec::new();
    for seed in 0..60 {
        let at = placer.place(shape, disc, &mut rng(seed)).unwrap();
        assert!(at.distance_m(center) <= 2.0);
        xs_m.push(at.x);
    }
    // Also in the outer half of it.
    assert!(xs_m.iter().any(|&x_m| x_m < 4.0) && xs_m.iter().any(|&x_m| x_m > 6.0));

    // A region without room, and one off the field.
    let spot = Region::Rectangle(Point::new(1.0, 1.0), Point::new(1.0, 1.0));
    assert_eq!(
        placer.place(None, spot, &mut rng(1)),
        Some(Point::new(1.0, 1.0))
    );
    assert_eq!(placer.place(None, spot, &mut rng(1)), None);
    let corner = Region::Rectangle(Point::new(0.0, 0.0), Point::new(FT, 0.2));
    assert_eq!(placer.place(None, corner, &mut rng(1)), None);
}

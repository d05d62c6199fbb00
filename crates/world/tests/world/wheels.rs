//! Robots with wheels among walls: bodies that turn overlap nothing, and pass through no wall, wherever they drive.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use crate::halls::{TestWorld, reception, rng};
use crate::shapes::any_hall;
use proptest::prelude::*;
use rand::RngExt;
use world::{
    Blocker, Body, Hall, HallError, MoveOutcome, Placer, Point, Pose, Region, Shape, Shapes,
    Velocity, Wall, Wheels, World,
};

/// Overlaps up to this are rounding, m.
const SLACK_M: f64 = 1e-8;

/// A body that lies somewhere.
#[derive(Clone, Copy, Debug)]
struct Lying {
    shape: Shape,
    at: Point,
    heading_rad: f64,
}

impl Lying {
    /// The corners of a rectangle, or of a polygon in a disc, a little smaller than the body, counter-clockwise.
    fn corners(self) -> Vec<Point> {
        let corners: Vec<(f64, f64)> = match self.shape {
            Shape::Rectangle { width_m, height_m } => {
                let (x_m, y_m) = (width_m / 2.0 - SLACK_M, height_m / 2.0 - SLACK_M);
                vec![(x_m, y_m), (-x_m, y_m), (-x_m, -y_m), (x_m, -y_m)]
            }
            Shape::Disc { radius_m } => (0..256)
                .map(|index| {
                    let angle_rad = TAU * f64::from(index) / 256.0;
                    let radius_m = radius_m - SLACK_M;
                    (
                        radius_m * libm::cos(angle_rad),
                        radius_m * libm::sin(angle_rad),
                    )
                })
                .collect(),
        };
        let (sin, cos) = libm::sincos(self.heading_rad);
        let turned =
            |(x, y): (f64, f64)| self.at + Point::new(x * cos - y * sin, x * sin + y * cos);
        corners.into_iter().map(turned).collect()
    }

    /// Whether two bodies overlap: what the edges of one leave of the other has an area.
    fn overlaps(self, other: Self) -> bool {
        let mut left = self.corners();
        let edges = other.corners();
        for (index, &from) in edges.iter().enumerate() {
            left = cut(&left, from, edges[(index + 1) % edges.len()]);
        }
        let twice_m2: f64 = (0..left.len())
            .map(|index| {
                let (a, b) = (left[index], left[(index + 1) % left.len()]);
                a.x * b.y - a.y * b.x
            })
            .sum();
        twice_m2.abs() > 1e-9
    }

    /// Whether a wall passes through the body: what its edges leave of the wall has a length.
    fn is_on(self, wall: &Wall) -> bool {
        let edges = self.corners();
        let (mut low, mut high) = (0.0_f64, 1.0_f64);
        for (index, &from) in edges.iter().enumerate() {
            let along = edges[(index + 1) % edges.len()] - from;
            let side = |point: Point| along.x * (point.y - from.y) - along.y * (point.x - from.x);
            let (a, b) = (side(wall.from), side(wall.to));
            if a < 0.0 && b < 0.0 {
                return false;
            }
            if a < 0.0 {
                low = low.max(a / (a - b));
            } else if b < 0.0 {
                high = high.min(a / (a - b));
            }
        }
        (high - low) * wall.from.distance_m(wall.to) > 1e-6
    }
}

/// What is left of a polygon on the left side of a line.
fn cut(polygon: &[Point], from: Point, to: Point) -> Vec<Point> {
    let along = to - from;
    let side = |point: Point| along.x * (point.y - from.y) - along.y * (point.x - from.x);
    let mut left = Vec::new();
    for (index, &a) in polygon.iter().enumerate() {
        let b = polygon[(index + 1) % polygon.len()];
        let (side_a, side_b) = (side(a), side(b));
        if side_a >= 0.0 {
            left.push(a);
        }
        if side_a * side_b < 0.0 {
            left.push(a + (b - a) * (side_a / (side_a - side_b)));
        }
    }
    left
}

fn lying(world: &TestWorld) -> Vec<Lying> {
    let robots = world.robots().iter().enumerate();
    let mut all: Vec<Lying> = robots
        .map(|(index, &at)| Lying {
            shape: world.shape(Body::Robot(index)),
            at,
            heading_rad: world.pose(index).map_or(0.0, |pose| pose.heading_rad),
        })
        .collect();
    for (index, &at) in world.guests().iter().enumerate() {
        all.push(Lying {
            shape: world.shape(Body::Guest(index)),
            at,
            heading_rad: 0.0,
        });
    }
    all
}

fn check_promises(world: &TestWorld, before: &[Lying]) {
    let all = lying(world);
    let (width_m, height_m) = world.field().size_m;
    for (index, &body) in all.iter().enumerate() {
        for corner in body.corners() {
            let is_inside =
                (0.0..=width_m).contains(&corner.x) && (0.0..=height_m).contains(&corner.y);
            assert!(is_inside, "{body:?} left the field");
        }
        for &other in &all[..index] {
            assert!(!body.overlaps(other), "{body:?} overlaps {other:?}");
        }
        for (obstacle, &at) in world.obstacles().iter().enumerate() {
            let other = Lying {
                shape: world.shape(Body::Obstacle(obstacle)),
                at,
                heading_rad: 0.0,
            };
            assert!(!body.overlaps(other), "{body:?} overlaps {other:?}");
        }

        // On its way as well.
        let from = before.get(index).copied().unwrap_or(body);
        let turn_rad = libm::remainder(body.heading_rad - from.heading_rad, TAU);
        for step in 0..=20 {
            let share = f64::from(step) / 20.0;
            let between = Lying {
                at: from.at + (body.at - from.at) * share,
                heading_rad: from.heading_rad + turn_rad * share,
                ..body
            };
            for wall in world.walls() {
                assert!(
                    !between.is_on(wall),
                    "{between:?} on {wall:?} from {from:?}"
                );
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn bodies_that_turn_overlap_nothing_and_pass_through_no_wall(
        hall in any_hall(),
        wheels in prop::collection::vec(prop::option::of((0.5..20.0, 0.1..5.0, 0.1..30.0)), 8),
        seed in any::<u64>(),
    ) {
        let Some(mut hall) = hall else { return Ok(()) };
        for (index, limits) in wheels.into_iter().enumerate().take(hall.robots.len()) {
            if let Some((max_speed_mps, max_turn_radps, max_acceleration_mps2)) = limits {
                hall.shapes.wheels.insert(index, Wheels {
                    max_speed_mps,
                    // Less than half a turn in a tick.
                    max_turn_radps,
                    max_acceleration_mps2,
                    max_turn_acceleration_radps2: max_acceleration_mps2,
                    heading_rad: 0.0,
                });
            }
        }
        let Ok(mut world) = World::new(&hall, rng(seed)) else { return Ok(()) };
        let mut twin = World::new(&hall, rng(seed)).unwrap();
        check_promises(&world, &[]);

        let mut random = rng(seed ^ 1);
        let mut signed = |limit: f64| (random.random::<f64>() - 0.5) * 2.0 * limit;
        for _ in 0..25 {
            let before = lying(&world);
            let mut proposals = Vec::new();
            for robot in 0..world.robots().len() {
                let wanted = Velocity { linear_mps: signed(10.0), angular_radps: signed(6.0) };
                world.drive(robot, wanted);
                twin.drive(robot, wanted);
                proposals.push(Some(world.robots()[robot] + Point::new(signed(2.0), signed(2.0))));
            }
            let verdicts = world.advance(&proposals);
            check_promises(&world, &before);
            prop_assert_eq!(&verdicts, &twin.advance(&proposals));

            for (&robot, wheels) in &hall.shapes.wheels {
                let pose = world.pose(robot).unwrap();
                prop_assert_eq!(pose.center, world.robots()[robot]);
                prop_assert!(pose.velocity.linear_mps.abs() <= wheels.max_speed_mps);
                prop_assert!(pose.velocity.angular_radps.abs() <= wheels.max_turn_radps);
                prop_assert_ne!(verdicts[robot], MoveOutcome::TooFast);
                if let MoveOutcome::Blocked { .. } = verdicts[robot] {
                    prop_assert_eq!(pose.velocity.linear_mps, 0.0);
                    prop_assert_eq!(pose.center, before[robot].at);
                }
            }
        }
        prop_assert!(world == twin);
    }
}

/// Whether a point is in a polygon: how often its border goes around it is odd.
fn is_within(polygon: &[Point], point: Point) -> bool {
    let mut is_in = false;
    for (index, a) in polygon.iter().enumerate() {
        let b = polygon[(index + 1) % polygon.len()];
        let is_between = (a.y > point.y) != (b.y > point.y);
        if is_between && point.x < a.x + (b.x - a.x) * (point.y - a.y) / (b.y - a.y) {
            is_in = !is_in;
        }
    }
    is_in
}

/// Places at which a body of this half extent touches a wall, or overlaps it by about as much as is allowed.
fn touching(wall: &Wall, half_m: f64, share: f64, off_m: f64) -> Point {
    let along = wall.to - wall.from;
    let length_m = along.length();
    let normal = Point::new(-along.y, along.x) * (1.0 / length_m);
    wall.from + along * share + normal * (half_m + off_m)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    #[ignore = "thorough: with `-- --include-ignored`"]
    fn nobody_leaves_a_closed_room_with_acute_corners(
        radii_m in prop::collection::vec(1.0..45.0, 3..12),
        shapes in prop::collection::vec((any::<bool>(), 0.001..2.0, 0.001..2.0, any::<bool>()), 1..5),
        is_turned in any::<bool>(),
        seed in any::<u64>(),
    ) {
        let middle = Point::new(50.0, 50.0);
        let corners: Vec<Point> = radii_m
            .iter()
            .enumerate()
            .map(|(index, radius_m)| {
                let angle_rad = TAU * index as f64 / radii_m.len() as f64 + 0.1;
                middle + Point::new(libm::cos(angle_rad), libm::sin(angle_rad)) * *radius_m
            })
            .collect();
        let mut hall = reception(0);
        hall.field.size_m = (100.0, 100.0);
        hall.field.body_m = 0.5;
        hall.tick_s = 0.5;
        hall.max_speed_mps = 1e6;
        hall.robots.clear();
        hall.obstacles.clear();
        for (index, &from) in corners.iter().enumerate() {
            let to = corners[(index + 1) % corners.len()];
            hall.shapes.walls.push(if is_turned { Wall { from: to, to: from } } else { Wall { from, to } });
        }
        let mut placer = Placer::new(&hall).unwrap();
        let region = Region::Disc { center: middle, radius_m: 6.0 };
        for (index, (is_disc, x_m, y_m, drives)) in shapes.into_iter().enumerate() {
            let shape = if is_disc {
                Shape::Disc { radius_m: x_m / 2.0 }
            } else {
                Shape::Rectangle { width_m: x_m, height_m: y_m }
            };
            let at = placer.place(Some(shape.into()), region, &mut rng(seed ^ index as u64));
            let Some(at) = at.filter(|at| is_within(&corners, *at)) else { continue };
            let robot = hall.robots.len();
            hall.shapes.robots.insert(robot, shape);
            if drives {
                hall.shapes.wheels.insert(robot, FREE);
            }
            hall.robots.push(at);
        }
        // One that was placed outside the room is solid in the placer only.
        let Ok(mut world) = World::new(&hall, rng(seed)) else { return Ok(()) };

        let mut random = rng(seed ^ 1);
        for _ in 0..60 {
            let mut proposals = Vec::new();
            for (robot, &at) in world.robots().to_vec().iter().enumerate() {
                let far_m: f64 = [0.1, 2.0, 50.0, 1e5][random.random_range(0..4)];
                let mut signed = |limit: f64| (random.random::<f64>() - 0.5) * 2.0 * limit;
                let step = Point::new(signed(1.0), signed(1.0)) * far_m.min(60.0);
                world.drive(robot, Velocity { linear_mps: signed(far_m), angular_radps: signed(6.0) });

                let (half_m, _) = world.shape(Body::Robot(robot)).half_m();
                let wall = world.walls()[random.random_range(0..corners.len())];
                let off_m = [0.0, 1e-9, -1e-9, -1.5e-9, -1e-6][random.random_range(0..5)];
                let side = [1.0, -1.0][random.random_range(0..2)];
                let beside = touching(&wall, side * half_m, random.random(), side * off_m);
                proposals.push(Some(if random.random() { at + step } else { beside }));
            }
            world.advance(&proposals);

            for (robot, &at) in world.robots().iter().enumerate() {
                prop_assert!(is_within(&corners, at), "robot {} at {}", robot, at);
            }
            // The turns of robots that are this fast are not told by their headings.
            check_promises(&world, &[]);
        }
    }
}

const FREE: Wheels = Wheels {
    max_speed_mps: f64::INFINITY,
    max_turn_radps: f64::INFINITY,
    max_acceleration_mps2: f64::INFINITY,
    max_turn_acceleration_radps2: f64::INFINITY,
    heading_rad: 0.0,
};

/// A plank of 2 m by 0.2 m with wheels, in a hall of 10 m by 10 m with these walls.
fn plank(walls: &[(f64, f64, f64, f64)], at: Point, wheels: Wheels) -> Hall {
    let mut hall = reception(0);
    hall.field.size_m = (10.0, 10.0);
    hall.tick_s = 1.0;
    hall.max_speed_mps = 100.0;
    hall.robots = vec![at];
    let shape = Shape::Rectangle {
        width_m: 2.0,
        height_m: 0.2,
    };
    hall.shapes = Shapes {
        walls: walls
            .iter()
            .map(|&(x1, y1, x2, y2)| Wall {
                from: Point::new(x1, y1),
                to: Point::new(x2, y2),
            })
            .collect(),
        robots: BTreeMap::from([(0, shape)]),
        wheels: BTreeMap::from([(0, wheels)]),
        ..Shapes::default()
    };
    hall
}

/// Drives for a tick.
fn drive(world: &mut TestWorld, linear_mps: f64, angular_radps: f64) -> (MoveOutcome, Pose) {
    let wanted = Velocity {
        linear_mps,
        angular_radps,
    };
    world.drive(0, wanted);
    let verdict = world.advance(&[None])[0];
    (verdict, world.pose(0).unwrap())
}

fn wall(index: usize) -> MoveOutcome {
    MoveOutcome::Blocked {
        by: Blocker::Wall(index),
    }
}

#[test]
fn a_blocked_robot_stands_still_and_turns_where_it_has_room() {
    let ahead = plank(&[(6.5, 0.0, 6.5, 10.0)], Point::new(5.0, 5.0), FREE);
    let mut world = World::new(&ahead, rng(1)).unwrap();
    // The wall is half a meter ahead of its front.
    let (verdict, pose) = drive(&mut world, 1.0, 0.5);
    assert_eq!(verdict, wall(0));
    assert_eq!(pose.center, Point::new(5.0, 5.0));
    assert_eq!(pose.heading_rad, 0.5);
    assert_eq!(
        (pose.velocity.linear_mps, pose.velocity.angular_radps),
        (0.0, 0.5)
    );

    // Between two walls it cannot turn, and keeps its heading; it can drive along them.
    let corridor = [(0.0, 4.7, 10.0, 4.7), (0.0, 5.3, 10.0, 5.3)];
    let corridor = plank(&corridor, Point::new(5.0, 5.0), FREE);
    let mut world = World::new(&corridor, rng(1)).unwrap();
    let (verdict, pose) = drive(&mut world, 0.0, FRAC_PI_2);
    assert_eq!(verdict, wall(0));
    assert_eq!(
        (pose.heading_rad, pose.velocity),
        (0.0, Velocity::default())
    );
    let (verdict, pose) = drive(&mut world, 2.0, 0.0);
    assert_eq!(verdict, MoveOutcome::Advanced);
    assert_eq!(pose.center, Point::new(7.0, 5.0));
}

#[test]
fn a_body_does_not_turn_through_a_wall() {
    // The stub of a wall between where the plank lies and where it would lie: its ends meet no wall.
    let stub = [(5.5, 5.6, 5.7, 5.4)];
    for (angular_radps, verdict) in [
        (FRAC_PI_2, wall(0)),
        // Away from it, and less far than to it.
        (-FRAC_PI_2, MoveOutcome::Advanced),
        (PI, wall(0)),
        (9.0, wall(0)),
        (0.3, MoveOutcome::Advanced),
    ] {
        let hall = plank(&stub, Point::new(5.0, 5.0), FREE);
        let mut world = World::new(&hall, rng(1)).unwrap();
        let (given, pose) = drive(&mut world, 0.0, angular_radps);
        let is_turned = verdict == MoveOutcome::Advanced;
        assert_eq!(given, verdict, "{angular_radps}");
        assert_eq!(pose.heading_rad != 0.0, is_turned, "{angular_radps}");
    }
}

#[test]
fn a_turned_plank_passes_where_a_lying_one_does_not() {
    let gate = [(5.0, 0.0, 5.0, 4.5), (5.0, 5.5, 5.0, 10.0)];
    let upright = Wheels {
        heading_rad: FRAC_PI_2,
        ..FREE
    };
    let mut world = World::new(&plank(&gate, Point::new(3.0, 5.0), upright), rng(1)).unwrap();
    // It lies across the gate, and drives along its heading only.
    assert_eq!(drive(&mut world, 0.0, -FRAC_PI_2).0, MoveOutcome::Advanced);
    let (verdict, pose) = drive(&mut world, 4.0, 0.0);
    assert_eq!(verdict, MoveOutcome::Advanced);
    assert!(pose.center.distance_m(Point::new(7.0, 5.0)) < 1e-12);

    // Across the gate it fits only if its heading does.
    let across = plank(&gate, Point::new(5.0, 5.0), upright);
    let refused = World::new(&across, rng(1));
    assert!(
        matches!(refused, Err(HallError::RobotOnWall { .. })),
        "{refused:?}"
    );
    assert!(World::new(&plank(&gate, Point::new(5.0, 5.0), FREE), rng(1)).is_ok());
}

#[test]
fn what_a_robot_with_wheels_proposes_beside_is_without_effect() {
    let mut world = World::new(&plank(&[], Point::new(5.0, 5.0), FREE), rng(1)).unwrap();
    let verdicts = world.advance(&[Some(Point::new(6.0, 6.0))]);
    assert_eq!(verdicts, [MoveOutcome::Stayed]);
    assert_eq!(world.robots()[0], Point::new(5.0, 5.0));

    // A square of the field turns as well, and a robot without wheels does not drive.
    let mut hall = reception(0);
    hall.robots = vec![Point::new(5.0, 5.0), Point::new(8.0, 8.0)];
    hall.shapes.wheels.insert(0, FREE);
    let mut world = World::new(&hall, rng(1)).unwrap();
    for robot in 0..2 {
        let wanted = Velocity {
            linear_mps: 0.1,
            angular_radps: FRAC_PI_4 / hall.tick_s,
        };
        world.drive(robot, wanted);
    }
    let here = world.robots()[1];
    world.advance(&[None, None]);
    let (half_m, _) = world.footprint(Body::Robot(0)).half_m();
    assert!((half_m - 0.5 * hall.field.body_m * 2.0_f64.sqrt()).abs() < 1e-12);
    assert_eq!((world.robots()[1], world.pose(1)), (here, None));
}

#[test]
fn limits_of_nothing_and_headings_of_none_are_refused() {
    for wheels in [
        Wheels {
            max_speed_mps: 0.0,
            ..FREE
        },
        Wheels {
            max_turn_acceleration_radps2: f64::NAN,
            ..FREE
        },
        Wheels {
            heading_rad: f64::INFINITY,
            ..FREE
        },
    ] {
        let refused = World::new(&plank(&[], Point::new(5.0, 5.0), wheels), rng(1));
        assert_eq!(refused.unwrap_err(), HallError::RobotWheels { index: 0 });
    }
}

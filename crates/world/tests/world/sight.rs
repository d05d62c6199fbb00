//! What hides what, and how far it is to the next body.

use proptest::prelude::*;
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use world::{
    Field, Footprint, Guests, Hall, Opaque, Point, Shape, Shapes, Triangular, Wall, World,
    is_hidden,
};

fn block(x: f64, y: f64, half_x: f64, half_y: f64) -> Opaque {
    Opaque::Body {
        footprint: Footprint::from(Shape::Rectangle {
            width_m: 2.0 * half_x,
            height_m: 2.0 * half_y,
        }),
        at: Point::new(x, y),
    }
}

fn disc(x: f64, y: f64, radius_m: f64) -> Opaque {
    Opaque::Body {
        footprint: Footprint::from(Shape::Disc { radius_m }),
        at: Point::new(x, y),
    }
}

#[test]
fn a_wall_hides_what_is_behind_it_and_nothing_beside_it() {
    let wall = [block(5.0, 5.0, 0.5, 2.0)];
    let eye = Point::new(1.0, 5.0);
    for (x, y, hidden) in [
        (9.0, 5.0, true),
        // Before it.
        (4.0, 5.0, false),
        // At its face, and within it.
        (4.5, 5.0, false),
        (4.6, 5.0, true),
        // That way is 6.75 m up at the face of the wall, which ends at 7 m.
        (9.0, 9.0, true),
        (5.0, 9.5, false),
        (1.0, 9.0, false),
        (0.0, 5.0, false),
    ] {
        assert_eq!(is_hidden(eye, Point::new(x, y), &wall), hidden, "{x}, {y}");
    }
    // A way along the face is hidden, and one that touches a corner is not.
    let (from, to) = (Point::new(4.5, 0.0), Point::new(4.5, 9.0));
    assert!(is_hidden(from, to, &wall));
    let (from, to) = (Point::new(3.5, 4.0), Point::new(5.5, 2.0));
    assert!(!is_hidden(from, to, &wall));
    assert!(!is_hidden(eye, eye, &wall));
}

#[test]
fn no_way_passes_between_blocks_side_by_side() {
    // Blocks of 2 ft on a grid of 1 ft, as people place them, and ways along the lines of the grid.
    let ft = |number: u32| f64::from(number) * 0.3048;
    for first in 1..40 {
        let wall: Vec<Opaque> = (0..5)
            .map(|index| block(ft(20), ft(first + 2 * index), 0.3048, 0.3048))
            .collect();
        for line in first..=first + 8 {
            for x in [1, 2, 3, 5, 7, 11] {
                let (from, to) = (
                    Point::new(ft(x), ft(line)),
                    Point::new(ft(40 - x), ft(line)),
                );
                assert!(is_hidden(from, to, &wall), "{from} {to}");
                assert!(is_hidden(to, from, &wall), "{to} {from}");
                // By rounding, a direction is never quite that of the grid.
                let direction = Point::new(
                    libm::cos(std::f64::consts::PI),
                    libm::sin(std::f64::consts::PI),
                );
                let to = to + Point::new(0.0, -direction.y);
                assert!(is_hidden(from, to, &wall), "{from} {to}");
            }
        }
    }
}

/// A field of 10 m by 10 m with bodies of 1 m.
fn world(obstacles: &[Point], robots: &[Point]) -> World<Xoshiro256PlusPlus> {
    shaped(obstacles, robots, Shapes::default())
}

fn shaped(obstacles: &[Point], robots: &[Point], shapes: Shapes) -> World<Xoshiro256PlusPlus> {
    let still = Triangular::new(0.0, 0.0, 0.0).unwrap();
    let hall = Hall {
        field: Field {
            size_m: (10.0, 10.0),
            body_m: 1.0,
        },
        obstacles: obstacles.to_vec(),
        guests: Guests {
            count: 0,
            speed_mps: still,
            duration_s: still,
        },
        robots: robots.to_vec(),
        tick_s: 1.0,
        max_speed_mps: 1.0,
        shapes,
    };
    World::new(&hall, Xoshiro256PlusPlus::seed_from_u64(1)).unwrap()
}

#[test]
fn a_line_between_robots_crosses_walls_and_bodies_that_are_on_it() {
    let wall = |x: f64| Wall {
        from: Point::new(x, 0.0),
        to: Point::new(x, 6.0),
    };
    let robots = [(1.0, 5.0), (9.0, 5.0), (5.0, 5.2), (5.0, 9.0), (1.0, 9.0)];
    let robots = robots.map(|(x, y)| Point::new(x, y));
    let shapes = Shapes {
        walls: vec![wall(3.0), wall(7.0)],
        ..Shapes::default()
    };
    // An obstacle is no body of a robot or guest.
    let world = shaped(&[Point::new(8.0, 5.0)], &robots, shapes);
    let crossed = |one, other| {
        let crossed = world.crossed(one, other);
        assert_eq!(crossed, world.crossed(other, one));
        (crossed.walls, crossed.bodies)
    };
    assert_eq!(crossed(0, 1), (2, 1));
    assert_eq!(crossed(0, 2), (1, 0), "neither end counts");
    assert_eq!(crossed(2, 3), (0, 0));
    assert_eq!(crossed(3, 4), (0, 0), "beside both walls");
    assert_eq!(crossed(0, 0), (0, 0));
}

#[test]
fn a_ray_ends_at_the_next_body_at_the_edge_or_at_its_range() {
    let robots = [Point::new(3.0, 5.0), Point::new(3.0, 8.0)];
    let world = world(&[Point::new(6.0, 5.0), Point::new(8.0, 5.0)], &robots);
    let directions = [
        (1.0, 0.0),
        (0.0, 1.0),
        (-1.0, 0.0),
        (0.0, -1.0),
        (0.6, -0.8),
    ];
    let directions = directions.map(|(x, y)| Point::new(x, y));

    // The faces of the obstacle at 6 and of the robot at 8 are half a meter before their centers.
    let ranges = world.ranges_m(0, &directions, 4.0);
    assert_eq!(ranges, [2.5, 2.5, 3.0, 4.0, 4.0]);
    assert_eq!(world.ranges_m(0, &directions, 2.0), [2.0; 5]);
    assert_eq!(
        world.opaque_near(robots[0], 4.9),
        [
            (Some(0), block(6.0, 5.0, 0.5, 0.5)),
            (Some(1), block(8.0, 5.0, 0.5, 0.5))
        ]
    );
    assert_eq!(world.opaque_near(robots[0], 3.9).len(), 1);
}

#[test]
fn discs_and_walls_hide_and_end_rays_where_they_are() {
    let eye = Point::new(1.0, 5.0);
    let all = [
        disc(5.0, 5.0, 1.0),
        Opaque::Wall(Wall {
            from: Point::new(4.0, 7.0),
            to: Point::new(6.0, 9.0),
        }),
    ];
    for (x, y, hidden) in [
        (9.0, 5.0, true),
        // On the rim, and past the disc on a tangent.
        (4.0, 5.0, false),
        (9.0, 6.0, true),
        (9.0, 8.0, false),
        (5.0, 8.0, false),
        (4.0, 9.5, false),
        // Beyond the wall, and past its end.
        (9.0, 11.0, true),
        (9.0, 11.6, false),
    ] {
        assert_eq!(is_hidden(eye, Point::new(x, y), &all), hidden, "{x}, {y}");
    }

    let shapes = Shapes {
        walls: vec![Wall {
            from: Point::new(0.0, 8.0),
            to: Point::new(9.0, 8.0),
        }],
        obstacles: [(0, Shape::Disc { radius_m: 1.5 })].into(),
        robots: [(0, Shape::Disc { radius_m: 0.25 })].into(),
        ..Shapes::default()
    };
    let world = shaped(&[Point::new(6.0, 5.0)], &[Point::new(3.0, 5.0)], shapes);
    let directions = [(1.0, 0.0), (0.0, 1.0), (0.6, 0.8)].map(|(x, y)| Point::new(x, y));
    let ranges = world.ranges_m(0, &directions, 5.0);
    let expected = [1.5, 3.0, 3.75];
    for (range, expected) in ranges.iter().zip(expected) {
        assert!((range - expected).abs() < 1e-12, "{ranges:?}");
    }
}

proptest! {
    #[test]
    fn a_ray_enters_a_disc_on_its_rim(
        from in (0.0..10.0, 0.0..10.0_f64),
        to in (0.0..10.0, 0.0..10.0_f64),
        at in (2.0..8.0, 2.0..8.0_f64),
        radius_m in 0.1..2.0_f64,
    ) {
        let (from, to) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
        let center = Point::new(at.0, at.1);
        let disc = disc(at.0, at.1, radius_m);
        if let Some(share) = disc.entered_after(from, to) {
            let rim_m = (from + (to - from) * share).distance_m(center) - radius_m;
            prop_assert!(rim_m <= 1e-6);
            prop_assert!(share == 0.0 || rim_m >= -1e-6);
        } else {
            for step in 0..=100 {
                let point = from + (to - from) * (f64::from(step) / 100.0);
                prop_assert!(point.distance_m(center) > radius_m - 1e-6);
            }
        }
    }

    #[test]
    fn hiding_is_mutual(
        from in (0.0..10.0, 0.0..10.0_f64),
        to in (0.0..10.0, 0.0..10.0_f64),
        at in (2.0..8.0, 2.0..8.0_f64),
        half in (0.1..2.0, 0.1..2.0_f64),
    ) {
        let (from, to) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
        let walls = [block(at.0, at.1, half.0, half.1)];
        prop_assert_eq!(is_hidden(from, to, &walls), is_hidden(to, from, &walls));
    }

    #[test]
    fn a_ray_enters_where_the_point_is_on_the_rectangle(
        from in (0.0..10.0, 0.0..10.0_f64),
        to in (0.0..10.0, 0.0..10.0_f64),
        at in (2.0..8.0, 2.0..8.0_f64),
        half in (0.1..2.0, 0.1..2.0_f64),
    ) {
        let (from, to) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
        let wall = block(at.0, at.1, half.0, half.1);
        if let Some(share) = wall.entered_after(from, to) {
            let point = from + (to - from) * share;
            let (x, y) = ((point.x - at.0).abs() - half.0, (point.y - at.1).abs() - half.1);
            prop_assert!(x.max(y) <= 1e-9);
            prop_assert!(share == 0.0 || x.max(y) >= -1e-9);
        } else {
            // No point of the way is inside.
            for step in 0..=100 {
                let point = from + (to - from) * (f64::from(step) / 100.0);
                let is_inside = (point.x - at.0).abs() < half.0 - 1e-9
                    && (point.y - at.1).abs() < half.1 - 1e-9;
                prop_assert!(!is_inside);
            }
        }
    }

    #[test]
    fn no_way_passes_where_two_walls_meet(
        eye in (0.0..10.0, 0.0..10.0_f64),
        joint in (0.0..10.0, 0.0..10.0_f64),
        ends in prop::collection::vec((0.0..10.0, 0.0..10.0_f64), 2),
        beyond in 1.01..5.0_f64,
        order in any::<(bool, bool)>(),
    ) {
        let point = |(x, y): (f64, f64)| Point::new(x, y);
        let (eye, joint) = (point(eye), point(joint));
        let side = |end: Point| {
            let (way, offset) = (joint - eye, end - joint);
            way.x * offset.y - way.y * offset.x
        };
        let (one, other) = (point(ends[0]), point(ends[1]));
        // The walls go to both sides of the way.
        prop_assume!(joint.distance_m(eye) > 0.1);
        prop_assume!(side(one) * side(other) < 0.0);
        prop_assume!(one.distance_m(joint).min(other.distance_m(joint)) > 0.1);

        let wall = |end: Point, is_turned: bool| Opaque::Wall(if is_turned {
            Wall { from: end, to: joint }
        } else {
            Wall { from: joint, to: end }
        });
        let walls = [wall(one, order.0), wall(other, order.1)];
        let to = eye + (joint - eye) * beyond;
        prop_assert!(is_hidden(eye, to, &walls));
        prop_assert!(is_hidden(to, eye, &walls));
        let entered = walls.iter().filter_map(|wall| wall.entered_after(eye, to));
        let first = entered.fold(1.0, f64::min);
        prop_assert!((first - 1.0 / beyond).abs() < 1e-6, "{}", first);
    }

    #[test]
    fn what_is_on_a_surface_is_seen_from_its_side(
        eye in (0.0..10.0, 0.0..10.0_f64),
        ends in ((0.0..10.0, 0.0..10.0_f64), (0.0..10.0, 0.0..10.0_f64)),
        half in (0.1..2.0, 0.1..2.0_f64),
        share in 0.0..=1.0_f64,
    ) {
        let point = |(x, y): (f64, f64)| Point::new(x, y);
        let (eye, one, other) = (point(eye), point(ends.0), point(ends.1));
        let side = |from: Point, to: Point| {
            let (along, offset) = (to - from, eye - from);
            (along.x * offset.y - along.y * offset.x) / along.length()
        };
        let on = one + (other - one) * share;
        prop_assume!(side(one, other).abs() > 0.01);
        let wall = [Opaque::Wall(Wall { from: one, to: other })];
        prop_assert!(!is_hidden(eye, on, &wall));

        // The face of a block that is to the right of the eye, and the rim of a disc around the same center.
        let block = [block(one.x, one.y, half.0, half.1)];
        let on = Point::new(one.x - half.0, one.y + half.1 * (2.0 * share - 1.0));
        prop_assert!(eye.x > on.x - 0.01 || !is_hidden(eye, on, &block));
        let disc = [disc(one.x, one.y, half.0)];
        let away = eye - one;
        let distance_m = eye.distance_m(one);
        prop_assume!(distance_m > half.0 + 0.01);
        let on = one + away * (half.0 / distance_m);
        prop_assert!(!is_hidden(eye, on, &disc));
    }
}

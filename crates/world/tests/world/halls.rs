//! Halls for tests, and the invariants of every world.

use proptest::prelude::*;
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use world::{Field, Guests, Hall, HallError, Point, Shapes, Triangular, World};

pub(crate) const FT: f64 = 0.3048;

pub(crate) type TestWorld = World<Xoshiro256PlusPlus>;

pub(crate) fn rng(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

pub(crate) fn triangular(min: f64, mode: f64, max: f64) -> Triangular {
    Triangular::new(min, mode, max).unwrap()
}

/// The hall of the paper: 50 ft by 50 ft, bodies of 2 ft, and `count` guests, without obstacles or robots.
pub(crate) fn reception(count: usize) -> Hall {
    Hall {
        field: Field {
            size_m: (50.0 * FT, 50.0 * FT),
            body_m: 2.0 * FT,
        },
        obstacles: Vec::new(),
        guests: Guests {
            count,
            speed_mps: triangular(0.2, 0.6, 1.2),
            duration_s: triangular(1.0, 3.0, 8.0),
        },
        robots: Vec::new(),
        tick_s: 0.1,
        shapes: Shapes::default(),
        max_speed_mps: 2.0 * FT,
    }
}

/// Positions of all bodies that must not overlap one another: robots, then guests.
pub(crate) fn movers(world: &TestWorld) -> Vec<Point> {
    world
        .robots()
        .iter()
        .chain(world.guests())
        .copied()
        .collect()
}

/// Whether squares with these centers overlap, implemented independently. Up to 1 nm counts as touching.
pub(crate) fn overlap(body_m: f64, a: Point, b: Point) -> bool {
    (a.x - b.x).abs().max((a.y - b.y).abs()) < body_m - 1e-9
}

pub(crate) fn is_inside(field: &Field, at: Point) -> bool {
    let half_m = field.body_m / 2.0;
    let left = at.x - half_m;
    let right = at.x + half_m;
    let bottom = at.y - half_m;
    let top = at.y + half_m;

    // Twice the tolerance, to allow for the rounding errors of this test.
    let slack_m = 2e-9;
    let (width_m, height_m) = field.size_m;

    left >= -slack_m
        && bottom >= -slack_m
        && right <= width_m + slack_m
        && top <= height_m + slack_m
}

/// Asserts the two invariants of the crate: no body leaves the field, and no two bodies overlap. Only obstacles may
/// overlap one another.
pub(crate) fn check_promises(world: &TestWorld) {
    let field = world.field();
    let movers = movers(world);

    for (index, &at) in movers.iter().enumerate() {
        assert!(is_inside(field, at), "body {index} at {at} left the field");

        let others = movers[..index].iter().chain(world.obstacles());
        let hit = others
            .copied()
            .find(|&other| overlap(field.body_m, at, other));
        assert_eq!(hit, None, "body {index} at {at} overlaps another");
    }
}

/// Builds a world filled to the given share of its capacity for guests, and sets `hall.guests.count` accordingly.
pub(crate) fn crowded(hall: &mut Hall, share: f64, seed: u64) -> TestWorld {
    hall.guests.count = 1_000_000;
    let Err(HallError::NoRoom { room, .. }) = World::new(hall, rng(seed)) else {
        panic!("a million guests fit");
    };

    hall.guests.count = (share * room as f64).round() as usize;
    World::new(hall, rng(seed)).unwrap()
}

/// The center at the given shares of the way across the floor that centers can reach.
fn place(field: &Field, share: (f64, f64)) -> Point {
    let Field { size_m, body_m } = *field;

    Point::new(
        body_m / 2.0 + share.0 * (size_m.0 - body_m),
        body_m / 2.0 + share.1 * (size_m.1 - body_m),
    )
}

prop_compose! {
    /// A hall of 3 to 14 bodies per side, with obstacles and robots anywhere, and guests of any speed.
    pub(crate) fn any_hall()(
        body_m in 0.1..2.0,
        sides in (3.0..14.0, 3.0..14.0),
        is_whole in any::<bool>(),
        obstacles in prop::collection::vec((0.0..=1.0, 0.0..=1.0), 0..8),
        robots in prop::collection::vec((0.0..=1.0, 0.0..=1.0), 0..6),
        bodies_a_tick in 0.0..1.5,
        tick_s in 0.01..1.0,
    ) -> Hall {
        let (columns, rows) = if is_whole {
            (f64::round(sides.0), f64::round(sides.1))
        } else {
            sides
        };
        let field = Field {
            size_m: (columns * body_m, rows * body_m),
            body_m,
        };

        let obstacles: Vec<Point> = obstacles.into_iter().map(|share| place(&field, share)).collect();
        let mut apart: Vec<Point> = Vec::new();
        for share in robots {
            let robot = place(&field, share);
            let mut others = obstacles.iter().chain(&apart);

            if !others.any(|&other| overlap(body_m, robot, other)) {
                apart.push(robot);
            }
        }

        let fastest_mps = bodies_a_tick * body_m / tick_s;
        Hall {
            field,
            obstacles,
            guests: Guests {
                count: 0,
                speed_mps: triangular(0.0, fastest_mps / 2.0, fastest_mps),
                duration_s: triangular(0.0, 3.0 * tick_s, 30.0 * tick_s),
            },
            robots: apart,
            tick_s,
            shapes: Shapes::default(),
            max_speed_mps: fastest_mps,
        }
    }
}

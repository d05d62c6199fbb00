//! Initial placement, and the errors for halls that cannot be built.

use crate::halls::{FT, any_hall, check_promises, crowded, reception, rng, triangular};
use proptest::prelude::*;
use std::collections::BTreeSet;
use world::{BODIES_MAX, Field, Hall, HallError, Point, World};

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any number of guests up to the capacity given in the error can be placed, without overlap.
    #[test]
    fn what_fits_is_placed(mut hall in any_hall(), share in 0.0..=1.0, seed in any::<u64>()) {
        for share in [share, 1.0] {
            let world = crowded(&mut hall, share, seed);
            prop_assert_eq!(world.guests().len(), hall.guests.count);
            prop_assert_eq!(world.robots(), &hall.robots[..]);
            prop_assert_eq!(world.obstacles(), &hall.obstacles[..]);
            check_promises(&world);
        }
    }

    /// The capacity in rows is that of the lattice, minus at most four cells for each obstacle or robot.
    #[test]
    fn the_capacity_is_that_of_the_lattice(mut hall in any_hall(), seed in any::<u64>()) {
        let world = crowded(&mut hall, 1.0, seed);
        let Field { size_m, body_m } = hall.field;
        let columns = (size_m.0 / body_m + 1e-6).floor() as usize;
        let rows = (size_m.1 / body_m + 1e-6).floor() as usize;
        let lattice = columns * rows;
        let in_the_way = hall.obstacles.len() + hall.robots.len();

        prop_assert!(world.guests().len() <= lattice);
        prop_assert!(world.guests().len() + 4 * in_the_way >= lattice);
        if in_the_way == 0 {
            prop_assert_eq!(world.guests().len(), lattice);
        }
    }
}

#[test]
fn the_reception_holds_any_number_of_guests_up_to_the_lattice() {
    for count in (0..=625).step_by(25).chain(620..=625) {
        for seed in 0..4 {
            let world = World::new(&reception(count), rng(seed)).unwrap();
            assert_eq!(world.guests().len(), count);
            check_promises(&world);
        }
    }

    assert_eq!(
        text(&reception(626)),
        "626 guests do not fit: obstacles and robots leave room for 625"
    );
}

#[test]
fn an_obstacle_on_the_lattice_costs_one_place() {
    let mut hall = reception(623);
    hall.obstacles = vec![Point::new(3.0 * FT, 3.0 * FT)];
    hall.robots = vec![Point::new(25.0 * FT, 25.0 * FT)];
    check_promises(&World::new(&hall, rng(1)).unwrap());

    hall.guests.count = 624;
    assert_eq!(
        World::new(&hall, rng(1)).unwrap_err(),
        HallError::NoRoom {
            count: 624,
            room: 623
        }
    );
}

#[test]
fn rows_close_up_behind_bodies_off_the_lattice() {
    // Robots at 0.9..1.9 and 2.9..3.9 of 5 m: one guest fits between them and one to the right. Only one cell of
    // the lattice is free.
    let field = Field {
        size_m: (5.0, 1.0),
        body_m: 1.0,
    };
    let mut hall = Hall {
        field,
        robots: vec![Point::new(1.4, 0.5), Point::new(3.4, 0.5)],
        ..reception(2)
    };
    check_promises(&World::new(&hall, rng(1)).unwrap());

    hall.guests.count = 3;
    assert_eq!(
        World::new(&hall, rng(1)).unwrap_err(),
        HallError::NoRoom { count: 3, room: 2 }
    );
}

#[test]
fn a_sparse_crowd_is_scattered_uniformly() {
    // Every sixteenth of the floor gets its share, and no two guests have the same x.
    let mut sixteenths = [0.0; 16];
    let mut columns = BTreeSet::new();

    for seed in 0..200 {
        let world = World::new(&reception(100), rng(seed)).unwrap();
        for at in world.guests() {
            sixteenths[quarter(at.x) * 4 + quarter(at.y)] += 1.0 / 1250.0;
            columns.insert(at.x.to_bits());
        }
    }

    assert_eq!(columns.len(), 20_000);
    // Positions at the edges have fewer neighbors and are slightly more likely.
    assert!(
        sixteenths.iter().all(|share| (0.85..1.2).contains(share)),
        "{sixteenths:?}"
    );
}

/// The quarter of the reachable floor, from 0 to 3, that a coordinate falls into.
fn quarter(along_m: f64) -> usize {
    ((along_m - FT) / (48.0 * FT) * 4.0) as usize
}

#[test]
fn a_dense_crowd_is_a_random_choice_of_the_lattice() {
    let mut taken = BTreeSet::new();
    let mut first = BTreeSet::new();

    for seed in 0..50 {
        let cells = cells_of_dense_crowd(seed);
        first.insert(cells[0]);

        if seed < 10 {
            let distinct = BTreeSet::from_iter(cells);
            assert_eq!(distinct.len(), 500, "one guest per cell");
            taken.extend(distinct);
        }
    }

    assert_eq!(taken.len(), 625, "every cell is used");
    assert!(
        first.len() > 40,
        "guest 0 is not placed at random: {} cells",
        first.len()
    );
}

/// Column and row of each of 500 guests at the reception.
fn cells_of_dense_crowd(seed: u64) -> Vec<(usize, usize)> {
    let world = World::new(&reception(500), rng(seed)).unwrap();
    let cell_m = 2.0 * FT;

    world
        .guests()
        .iter()
        .map(|at| ((at.x / cell_m) as usize, (at.y / cell_m) as usize))
        .collect()
}

#[test]
fn obstacles_may_touch_and_overlap() {
    let mut hall = reception(100);
    hall.obstacles = [(3.0, 3.0), (5.0, 3.0), (5.0, 4.0), (3.0, 3.0)]
        .map(|(x, y)| Point::new(x * FT, y * FT))
        .into();
    hall.robots = vec![Point::new(7.0 * FT, 3.0 * FT)];
    check_promises(&World::new(&hall, rng(1)).unwrap());
}

fn at(x: f64, y: f64) -> Point {
    Point::new(x, y)
}

fn text(hall: &Hall) -> String {
    World::new(hall, rng(0)).unwrap_err().to_string()
}

/// The error for a reception of 100 guests after `change`.
fn wrong(change: impl FnOnce(&mut Hall)) -> String {
    let mut hall = reception(100);
    change(&mut hall);
    text(&hall)
}

#[test]
fn misplaced_bodies_are_reported() {
    for (actual, expected) in [
        (
            wrong(|hall| hall.obstacles = vec![at(5.0, 5.0), at(0.2, 5.0)]),
            "obstacle 2 at (0.2, 5) m is not entirely inside the field",
        ),
        (
            wrong(|hall| hall.robots = vec![at(5.0, f64::NAN)]),
            "robot 1 at (5, NaN) m is not entirely inside the field",
        ),
        (
            wrong(|hall| hall.robots = vec![at(5.0, 5.0), at(7.0, 5.0), at(5.5, 5.0)]),
            "robot 3 at (5.5, 5) m overlaps robot 1",
        ),
        (
            wrong(|hall| {
                hall.obstacles = vec![at(1.0, 1.0), at(5.0, 5.0)];
                hall.robots = vec![at(5.0, 5.5)];
            }),
            "robot 1 at (5, 5.5) m overlaps obstacle 2",
        ),
    ] {
        assert_eq!(actual, expected);
    }
}

#[test]
fn numbers_out_of_range_are_reported() {
    for (actual, expected) in [
        (
            wrong(|hall| hall.field.size_m.0 = f64::NAN),
            "field width_m is NaN; must be a number from 0.001 to 1000000.0",
        ),
        (
            wrong(|hall| hall.field.size_m.1 = 2e6),
            "field height_m is 2000000.0; must be a number from 0.001 to 1000000.0",
        ),
        (
            wrong(|hall| hall.field.body_m = 0.0),
            "body_m is 0.0; must be a number from 0.001 to 1000000.0",
        ),
        (
            wrong(|hall| {
                hall.field = Field {
                    size_m: (1.0, 3.0),
                    body_m: 2.0,
                }
            }),
            "a field of 1 m by 3 m is too small for a body of 2 m",
        ),
        (
            wrong(|hall| hall.tick_s = -0.1),
            "tick_s is -0.1; must be a number from 1e-6 to 1000000.0",
        ),
        (
            wrong(|hall| hall.max_speed_mps = f64::INFINITY),
            "max_speed_mps is inf; must be a number from 0.0 to 1000000.0",
        ),
        (
            wrong(|hall| hall.guests.count = usize::MAX),
            "18446744073709551615 bodies are too many; at most 16777216 are supported",
        ),
    ] {
        assert_eq!(actual, expected);
    }
}

#[test]
fn halls_at_the_limits_are_handled() {
    // The most guests in the smallest field, then the smallest bodies in the largest field, must both finish quickly.
    let mut hall = Hall {
        field: Field {
            size_m: (1.0, 1.0),
            body_m: 1.0,
        },
        ..reception(BODIES_MAX)
    };
    assert_eq!(
        World::new(&hall, rng(0)).unwrap_err(),
        HallError::NoRoom {
            count: BODIES_MAX,
            room: 1
        }
    );

    hall.field = Field {
        size_m: (1e6, 1e6),
        body_m: 1e-3,
    };
    hall.guests.count = 1000;
    hall.guests.speed_mps = triangular(1e6, 1e6, 1e6);
    let mut world = World::new(&hall, rng(0)).unwrap();
    for _ in 0..100 {
        world.advance(&[]);
    }
    check_promises(&world);
}

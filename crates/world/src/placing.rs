//! Initial placement of the bodies.

use crate::bodies::{Bodies, Body};
use crate::error::HallError;
use crate::hall::{Field, Hall, TOLERANCE_M};
use crate::point::Point;
use rand::{Rng, RngExt};

/// Number of attempts to place a body at random before giving up on rejection sampling.
///
/// A thousand misses mean that about 99.5 % of the floor cannot take another body: at that share, the probability
/// of so many misses is 1 %. Beyond that point, arranging the guests in rows is much faster.
const TRIES: usize = 1000;

/// Places robots at random in a hall before it becomes a [`World`](crate::World), each from a random stream of its own.
#[derive(Clone, Debug)]
pub struct RobotPlacer {
    bodies: Bodies,
}

impl RobotPlacer {
    /// How often a place is drawn before a robot has none.
    pub const TRIES: usize = TRIES;

    /// The obstacles of a hall and its robots, which are those with a given place; its guests are placed later.
    ///
    /// # Errors
    ///
    /// Returns the first [`HallError`] found, as [`World::new`](crate::World::new).
    pub fn new(hall: &Hall) -> Result<Self, HallError> {
        hall.check()?;

        let mut bodies = Bodies::new(hall.field, hall.obstacles.len(), hall.robots.len(), 0);
        place_obstacles(&mut bodies, &hall.obstacles)?;
        place_robots(&mut bodies, &hall.robots)?;
        Ok(Self { bodies })
    }

    /// Places one more robot, uniformly where it overlaps no other body: draws x, then y, for each attempt. `None` if all
    /// [`Self::TRIES`] attempts overlap one.
    pub fn place(&mut self, rng: &mut impl Rng) -> Option<Point> {
        let at = random_free_place(&self.bodies, rng)?;
        self.bodies.push(at);
        Some(at)
    }
}

/// Places all bodies of the hall. The guests' positions are drawn from `rng`.
pub(crate) fn place(hall: &Hall, rng: &mut impl Rng) -> Result<Bodies, HallError> {
    let mut bodies = Bodies::new(
        hall.field,
        hall.obstacles.len(),
        hall.robots.len(),
        hall.guests.count,
    );

    place_obstacles(&mut bodies, &hall.obstacles)?;
    place_robots(&mut bodies, &hall.robots)?;
    place_guests(&mut bodies, hall.guests.count, rng)?;

    Ok(bodies)
}

fn place_obstacles(bodies: &mut Bodies, obstacles: &[Point]) -> Result<(), HallError> {
    for (index, &at) in obstacles.iter().enumerate() {
        if !bodies.field().contains(at) {
            return Err(HallError::ObstacleOffField { index, at });
        }

        bodies.push(at);
    }

    Ok(())
}

fn place_robots(bodies: &mut Bodies, robots: &[Point]) -> Result<(), HallError> {
    for (index, &at) in robots.iter().enumerate() {
        check_robot(bodies, index, at)?;
        bodies.push(at);
    }

    Ok(())
}

/// Checks that a robot can be placed at `at`.
fn check_robot(bodies: &Bodies, index: usize, at: Point) -> Result<(), HallError> {
    if !bodies.field().contains(at) {
        return Err(HallError::RobotOffField { index, at });
    }

    match bodies.hit(at) {
        None => Ok(()),
        Some(Body::Obstacle(obstacle)) => Err(HallError::RobotOnObstacle {
            index,
            at,
            obstacle,
        }),
        Some(Body::Robot(other)) => Err(HallError::RobotOnRobot { index, at, other }),
        Some(Body::Guest(_)) => unreachable!("guests are placed after the robots"),
    }
}

/// Places the guests at random positions, or in rows if the hall is too crowded for that.
fn place_guests(bodies: &mut Bodies, count: usize, rng: &mut impl Rng) -> Result<(), HallError> {
    // No arrangement of squares is denser than a lattice, so do not even try to scatter more guests than the
    // lattice of an empty field holds.
    let (columns, rows) = bodies.field().columns_and_rows();
    let may_fit = count as u64 <= columns * rows;

    if may_fit && scatter(bodies, count, rng) {
        return Ok(());
    }

    bodies.remove_guests();
    line_up(bodies, count, rng)
}

/// Places guests one by one, uniformly at random, without overlap. Returns `false` if no free position is found
/// for one of them.
fn scatter(bodies: &mut Bodies, guests: usize, rng: &mut impl Rng) -> bool {
    for _ in 0..guests {
        let Some(at) = random_free_place(bodies, rng) else {
            return false;
        };
        bodies.push(at);
    }

    true
}

fn random_free_place(bodies: &Bodies, rng: &mut impl Rng) -> Option<Point> {
    for _ in 0..TRIES {
        let at = random_place(bodies.field(), rng);
        if bodies.hit(at).is_none() {
            return Some(at);
        }
    }

    None
}

fn random_place(field: &Field, rng: &mut impl Rng) -> Point {
    let (width_m, height_m) = field.size_m;
    let body_m = field.body_m;

    let x = body_m * 0.5 + rng.random::<f64>() * (width_m - body_m);
    let y = body_m * 0.5 + rng.random::<f64>() * (height_m - body_m);

    Point::new(x, y)
}

/// Assigns each guest a random position of the layout in rows.
fn line_up(bodies: &mut Bodies, guests: usize, rng: &mut impl Rng) -> Result<(), HallError> {
    let mut places = free_places(bodies);
    if places.len() < guests {
        return Err(HallError::NoRoom {
            count: guests,
            room: places.len(),
        });
    }

    // A partial Fisher-Yates shuffle: each guest draws from the positions that are left.
    for guest in 0..guests {
        let chosen = rng.random_range(guest..places.len());
        places.swap(guest, chosen);
        bodies.push(places[guest]);
    }

    Ok(())
}

/// Free positions on the floor, arranged in rows from the bottom, each row filled from the left.
///
/// In an empty field, and around obstacles aligned to multiples of a body, the result is the lattice of body-sized
/// cells. Around other bodies, a row holds at least as many positions as the lattice would.
///
/// Only called for crowded halls and small fields, so the number of positions is proportional to the number of
/// bodies.
fn free_places(bodies: &Bodies) -> Vec<Point> {
    let body_m = bodies.field().body_m;
    let (_, rows) = bodies.field().columns_and_rows();

    let mut places = Vec::new();
    for row in 0..rows {
        let y_m = body_m * (row as f64 + 0.5);
        fill_row(bodies, y_m, &mut places);
    }

    places
}

/// Adds the free positions of the row at `y_m`.
fn fill_row(bodies: &Bodies, y_m: f64, places: &mut Vec<Point>) {
    let body_m = bodies.field().body_m;
    let (width_m, _) = bodies.field().size_m;
    let last_x_m = width_m - body_m * 0.5 + TOLERANCE_M;

    // Multiplying steps since the last obstruction, rather than summing them, keeps rounding errors from losing
    // the last position.
    let mut from_x_m = body_m * 0.5;
    let mut steps = 0.0;

    while from_x_m + steps * body_m <= last_x_m {
        let at = Point::new(from_x_m + steps * body_m, y_m);

        if let Some(hit_x_m) = bodies.rightmost_hit_x_m(at) {
            from_x_m = hit_x_m;
            steps = 0.0;
        } else {
            places.push(at);
        }
        steps += 1.0;
    }
}

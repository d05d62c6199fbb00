//! Where bodies stand at the start.

use crate::bodies::{Bodies, Body};
use crate::error::HallError;
use crate::hall::{Field, Hall, TOLERANCE_M};
use crate::point::Point;
use rand::{Rng, RngExt};

/// Places tried for one guest before the hall counts as jammed.
///
/// A thousand misses mean that about 99.5 % of the floor is out of reach for one more body (with that much
/// out of reach the chance of so many misses is 1 %); the rows need a fraction of the time from there on.
const TRIES: usize = 1000;

/// All bodies of the hall in their places; the guests' are drawn from `rng`.
pub(crate) fn place(hall: &Hall, rng: &mut impl Rng) -> Result<Bodies, HallError> {
    let guests = hall.guests.count;
    let mut bodies = Bodies::new(hall.field, hall.obstacles.len(), hall.robots.len(), guests);
    place_obstacles(&mut bodies, &hall.obstacles)?;
    place_robots(&mut bodies, &hall.robots)?;
    let (columns, rows) = hall.field.columns_and_rows();
    // No layout of squares beats the lattice in an empty field. Beyond that a search is in vain.
    let is_hopeless = guests as u64 > columns * rows;
    if is_hopeless || !scatter(&mut bodies, guests, rng) {
        bodies.remove_guests();
        line_up(&mut bodies, guests, rng)?;
    }
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
        if !bodies.field().contains(at) {
            return Err(HallError::RobotOffField { index, at });
        }
        match bodies.hit(at) {
            Some(Body::Obstacle(obstacle)) => {
                return Err(HallError::RobotOnObstacle {
                    index,
                    at,
                    obstacle,
                });
            }
            Some(Body::Robot(other)) => return Err(HallError::RobotOnRobot { index, at, other }),
            Some(Body::Guest(_)) => unreachable!("guests are placed after the robots"),
            None => bodies.push(at),
        }
    }
    Ok(())
}

/// Places guests uniformly at random, one after the other, each where it overlaps nobody; false if that jams.
fn scatter(bodies: &mut Bodies, guests: usize, rng: &mut impl Rng) -> bool {
    for _ in 0..guests {
        let field = *bodies.field();
        let free = (0..TRIES)
            .map(|_| anywhere(&field, rng))
            .find(|&at| bodies.hit(at).is_none());
        let Some(at) = free else { return false };
        bodies.push(at);
    }
    true
}

fn anywhere(field: &Field, rng: &mut impl Rng) -> Point {
    let mut along =
        |side_m: f64| field.body_m * 0.5 + rng.random::<f64>() * (side_m - field.body_m);
    let x = along(field.size_m.0);
    let y = along(field.size_m.1);
    Point::new(x, y)
}

/// Gives each guest a random one of the places in rows.
fn line_up(bodies: &mut Bodies, guests: usize, rng: &mut impl Rng) -> Result<(), HallError> {
    let mut places = free_places(bodies);
    if places.len() < guests {
        return Err(HallError::NoRoom {
            count: guests,
            room: places.len(),
        });
    }
    for guest in 0..guests {
        let chosen = rng.random_range(guest..places.len());
        places.swap(guest, chosen);
        bodies.push(places[guest]);
    }
    Ok(())
}

/// The places left on the floor, in rows from below, filled from the left.
///
/// In an empty field, and around obstacles that are set on multiples of a body, this is the lattice of
/// body-sized cells; around anything else a row takes no fewer bodies than the lattice would.
///
/// Called where the hall jammed or the field is small, so the number of places is in proportion to the bodies.
fn free_places(bodies: &Bodies) -> Vec<Point> {
    let Field {
        size_m: (width_m, _),
        body_m,
    } = *bodies.field();
    let (_, rows) = bodies.field().columns_and_rows();
    let last_x_m = width_m - body_m * 0.5 + TOLERANCE_M;
    let mut places = Vec::new();
    for row in 0..rows {
        let y = body_m * (row as f64 + 0.5);
        // Counted from the last obstacle and not summed up, so that rounding cannot cost the last place.
        let (mut from_x_m, mut steps) = (body_m * 0.5, 0.0);
        while from_x_m + steps * body_m <= last_x_m {
            let at = Point::new(from_x_m + steps * body_m, y);
            if let Some(until_x_m) = bodies.hit_until_x_m(at) {
                (from_x_m, steps) = (until_x_m, 0.0);
            } else {
                places.push(at);
            }
            steps += 1.0;
        }
    }
    places
}

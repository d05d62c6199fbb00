//! Initial placement of the bodies.

use crate::bodies::{Blocker, Bodies, Body};
use crate::error::HallError;
use crate::footprint::Footprint;
use crate::hall::{Field, Hall};
use crate::limits::TOLERANCE_M;
use crate::point::Point;
use crate::solids::Solids;
use rand::{Rng, RngExt};

/// Number of attempts to place a body at random before giving up on rejection sampling.
///
/// A thousand misses mean that about 99.5 % of the floor cannot take another body: at that share, the probability
/// of so many misses is 1 %. Beyond that point, arranging the guests in rows is much faster.
const TRIES: usize = 1000;

/// Where the center of a body is drawn, uniformly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// Anywhere on the field where the body is inside.
    Field,
    /// A rectangle with sides along the axes, between two of its corners, m.
    Rectangle(Point, Point),
    /// A disc.
    Disc {
        /// Its center, m.
        center: Point,
        /// Its radius, m.
        radius_m: f64,
    },
}

/// Places bodies at random in a hall before it becomes a [`World`](crate::World), each from a random stream of its own.
#[derive(Clone, Debug)]
pub struct Placer {
    bodies: Bodies,
}

impl Placer {
    /// How often a place is drawn before a body has none.
    pub const TRIES: usize = TRIES;

    /// The obstacles of a hall and its robots, which are those with a given place; its guests are placed later.
    ///
    /// # Errors
    ///
    /// Returns the first [`HallError`] found, as [`World::new`](crate::World::new).
    pub fn new(hall: &Hall) -> Result<Self, HallError> {
        hall.check()?;

        Ok(Self {
            bodies: place_given(hall, 0)?,
        })
    }

    /// Places one more body, uniformly in a region where it overlaps no other body: draws x, then y, for each attempt. `None` if
    /// all [`Self::TRIES`] attempts overlap one, or the edge. Without a footprint it is a square of the field.
    pub fn place(
        &mut self,
        footprint: Option<Footprint>,
        region: Region,
        rng: &mut impl Rng,
    ) -> Option<Point> {
        let at = self.find(footprint, region, rng)?;
        self.bodies.push_shaped(at, footprint);
        Some(at)
    }

    /// Finds a place as [`Self::place`] does, for something that is not solid: it hinders no other one.
    pub fn find(
        &self,
        footprint: Option<Footprint>,
        region: Region,
        rng: &mut impl Rng,
    ) -> Option<Point> {
        random_free_place(&self.bodies, footprint, region, rng)
    }
}

/// Places all bodies of the hall. The guests' positions are drawn from `rng`.
pub(crate) fn place(hall: &Hall, rng: &mut impl Rng) -> Result<Bodies, HallError> {
    let mut bodies = place_given(hall, hall.guests.count)?;
    place_guests(&mut bodies, hall.guests.count, rng)?;

    Ok(bodies)
}

/// Places all bodies of the hall but the guests, of which there are so many that enter later.
pub(crate) fn place_absent(hall: &Hall, guests: usize) -> Result<Bodies, HallError> {
    let mut bodies = place_given(hall, guests)?;
    for _ in 0..guests {
        bodies.push_absent_guest();
    }
    Ok(bodies)
}

/// Places the obstacles and robots of the hall, with room for guests.
fn place_given(hall: &Hall, guests: usize) -> Result<Bodies, HallError> {
    let (obstacles, robots) = (hall.obstacles.len(), hall.robots.len());
    let mut bodies = Bodies::new(hall.field, obstacles, robots, guests);

    for (index, &at) in hall.obstacles.iter().enumerate() {
        let shape = hall.shapes.obstacles.get(&index).copied();
        if !is_inside(&hall.field, shape.map(Footprint::from), at) {
            return Err(HallError::ObstacleOffField { index, at });
        }

        bodies.push(at);
    }
    if !hall.shapes.is_empty() {
        bodies.set_solids(Solids::new(hall.field, &hall.shapes, &hall.obstacles));
    }

    for (index, &at) in hall.robots.iter().enumerate() {
        let footprint = hall.shapes.robot(index, hall.field.body_m);
        check_robot(&bodies, index, footprint, at)?;
        bodies.push(at);
    }
    Ok(bodies)
}

fn is_inside(field: &Field, footprint: Option<Footprint>, at: Point) -> bool {
    match footprint {
        Some(footprint) => footprint.is_inside(at, field.size_m),
        None => field.contains(at),
    }
}

/// Checks that a robot can be placed at `at`.
fn check_robot(
    bodies: &Bodies,
    index: usize,
    footprint: Option<Footprint>,
    at: Point,
) -> Result<(), HallError> {
    if !is_inside(bodies.field(), footprint, at) {
        return Err(HallError::RobotOffField { index, at });
    }

    match bodies.hit(at, footprint) {
        None => Ok(()),
        Some(Blocker::Wall(wall)) => Err(HallError::RobotOnWall { index, at, wall }),
        Some(Blocker::Body(Body::Obstacle(obstacle))) => Err(HallError::RobotOnObstacle {
            index,
            at,
            obstacle,
        }),
        Some(Blocker::Body(Body::Robot(other))) => {
            Err(HallError::RobotOnRobot { index, at, other })
        }
        Some(Blocker::Edge | Blocker::Body(Body::Guest(_))) => {
            unreachable!("the edge is tested before, and guests are placed after the robots")
        }
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
        let Some(at) = random_free_place(bodies, None, Region::Field, rng) else {
            return false;
        };
        bodies.push(at);
    }

    true
}

fn random_free_place(
    bodies: &Bodies,
    footprint: Option<Footprint>,
    region: Region,
    rng: &mut impl Rng,
) -> Option<Point> {
    for _ in 0..TRIES {
        let at = match region {
            Region::Field => random_place(bodies.field(), footprint, rng),
            Region::Rectangle(from, to) => random_between(from, to, rng),
            Region::Disc { center, radius_m } => random_in_disc(center, radius_m, rng),
        };

        // On the field a place is inside by itself, and the first bodies of the paper's hall are drawn often.
        let is_on_field = region == Region::Field || is_inside(bodies.field(), footprint, at);
        if is_on_field && bodies.hit(at, footprint).is_none() {
            return Some(at);
        }
    }

    None
}

fn random_place(field: &Field, footprint: Option<Footprint>, rng: &mut impl Rng) -> Point {
    let (width_m, height_m) = field.size_m;
    let body_m = field.body_m;
    let square_m = (body_m * 0.5, body_m * 0.5);
    let (half_x_m, half_y_m) = footprint.map_or(square_m, Footprint::half_m);
    let (x_m, y_m) = footprint.map_or((body_m, body_m), |_| (half_x_m * 2.0, half_y_m * 2.0));

    let x = half_x_m + rng.random::<f64>() * (width_m - x_m);
    let y = half_y_m + rng.random::<f64>() * (height_m - y_m);

    Point::new(x, y)
}

fn random_between(from: Point, to: Point, rng: &mut impl Rng) -> Point {
    let x = from.x + rng.random::<f64>() * (to.x - from.x);
    let y = from.y + rng.random::<f64>() * (to.y - from.y);

    Point::new(x, y)
}

/// A place in the square around the disc, or its center if that place is outside the disc 64 times in a row.
fn random_in_disc(center: Point, radius_m: f64, rng: &mut impl Rng) -> Point {
    let half = Point::new(radius_m, radius_m);
    for _ in 0..64 {
        let at = random_between(center - half, center + half, rng);
        if (at - center).length_squared() <= radius_m * radius_m {
            return at;
        }
    }
    center
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

//! All bodies on the field, and the collision test that applies to each of them.
//!
//! Bodies share one sequence of numbers: obstacles first, then robots, then guests. The first body in the order
//! of [`Body`] is therefore the one with the smallest number, and every kind goes through the same test.

use crate::grid::Grid;
use crate::hall::Field;
use crate::point::Point;

/// A body, identified by its kind and its index among bodies of that kind.
///
/// Ordered by kind, in the order of the variants, then by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Body {
    /// A fixed obstacle.
    Obstacle(usize),
    /// A robot.
    Robot(usize),
    /// A guest.
    Guest(usize),
}

/// What prevented a body from moving to its proposed location.
///
/// When several obstructions apply, this is the edge if it is one of them, and otherwise the first body in the
/// order of [`Body`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Blocker {
    /// The edge of the field.
    Edge,
    /// A body that occupies part of the proposed location.
    Body(Body),
}

/// A body returned by [`World::near`](crate::World::near).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// The body's kind and index.
    pub body: Body,
    /// Its center, m.
    pub center: Point,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bodies {
    field: Field,
    /// Number of the first robot; obstacles are numbered below it.
    robots_from: usize,
    /// Number of the first guest.
    guests_from: usize,
    centers: Vec<Point>,
    grid: Grid,
}

impl Bodies {
    /// An empty field with room for the given number of bodies of each kind.
    ///
    /// Bodies must then be pushed in this order: obstacles, robots, guests.
    pub(crate) fn new(field: Field, obstacles: usize, robots: usize, guests: usize) -> Self {
        let count = obstacles + robots + guests;

        Self {
            field,
            robots_from: obstacles,
            guests_from: obstacles + robots,
            centers: Vec::with_capacity(count),
            grid: Grid::new(field.size_m, field.body_m, count),
        }
    }

    pub(crate) fn field(&self) -> &Field {
        &self.field
    }

    /// Adds the next body without a collision test; the caller has already made sure that it fits.
    pub(crate) fn push(&mut self, center: Point) {
        self.centers.push(center);
        self.grid.push(center);
    }

    /// Removes all guests.
    pub(crate) fn remove_guests(&mut self) {
        while self.centers.len() > self.guests_from {
            self.centers.pop();
            self.grid.pop();
        }
    }

    pub(crate) fn obstacles(&self) -> &[Point] {
        &self.centers[..self.robots_from]
    }

    pub(crate) fn robots(&self) -> &[Point] {
        &self.centers[self.robots_from..self.guests_from]
    }

    pub(crate) fn guests(&self) -> &[Point] {
        &self.centers[self.guests_from..]
    }

    /// The first body, in the order of [`Body`], that a new body at this center would overlap.
    pub(crate) fn hit(&self, center: Point) -> Option<Body> {
        self.first_hit(center, usize::MAX).map(|id| self.body(id))
    }

    /// The largest x, in meters, of the centers that a new body at this center would overlap.
    pub(crate) fn rightmost_hit_x_m(&self, center: Point) -> Option<f64> {
        let mut rightmost_x_m = None;

        self.grid.visit_around(center, self.field.body_m, |id| {
            let other = self.centers[id];
            let is_farther = rightmost_x_m.is_none_or(|x_m| x_m < other.x);

            if is_farther && self.field.overlap(center, other) {
                rightmost_x_m = Some(other.x);
            }
        });

        rightmost_x_m
    }

    /// Moves a robot to `to`, or leaves it in place and returns what blocks it.
    pub(crate) fn advance_robot(&mut self, index: usize, to: Point) -> Result<(), Blocker> {
        self.advance(self.robots_from + index, to)
    }

    /// Moves a guest by `step`, or leaves it in place and returns what blocks it.
    pub(crate) fn advance_guest(&mut self, index: usize, step: Point) -> Result<(), Blocker> {
        let id = self.guests_from + index;
        let to = self.centers[id] + step;

        self.advance(id, to)
    }

    /// The collision rule of the paper ("Obstacles"): a body that would collide is not advanced.
    fn advance(&mut self, id: usize, to: Point) -> Result<(), Blocker> {
        if !self.field.contains(to) {
            return Err(Blocker::Edge);
        }

        if let Some(other) = self.first_hit(to, id) {
            return Err(Blocker::Body(self.body(other)));
        }

        self.centers[id] = to;
        self.grid.relocate(id, to);
        Ok(())
    }

    /// The smallest number of a body, other than `except`, that a body at this center would overlap.
    fn first_hit(&self, center: Point, except: usize) -> Option<usize> {
        let mut first = usize::MAX;

        self.grid.visit_around(center, self.field.body_m, |id| {
            if id < first && id != except && self.field.overlap(center, self.centers[id]) {
                first = id;
            }
        });

        (first != usize::MAX).then_some(first)
    }

    fn body(&self, id: usize) -> Body {
        if id < self.robots_from {
            Body::Obstacle(id)
        } else if id < self.guests_from {
            Body::Robot(id - self.robots_from)
        } else {
            Body::Guest(id - self.guests_from)
        }
    }

    /// All bodies whose center is within `range_m` of `point`, in the order of [`Body`].
    pub(crate) fn near(&self, point: Point, range_m: f64) -> Vec<Near> {
        self.ids_near(point, range_m)
            .into_iter()
            .map(|id| Near {
                body: self.body(id),
                center: self.centers[id],
            })
            .collect()
    }

    fn ids_near(&self, point: Point, range_m: f64) -> Vec<usize> {
        let is_meaningful = point.is_finite() && range_m >= 0.0;
        if !is_meaningful {
            return Vec::new();
        }

        let mut ids = Vec::new();
        self.grid.visit_around(point, range_m, |id| {
            let offset = self.centers[id] - point;
            if offset.length_squared_m2() <= range_m * range_m {
                ids.push(id);
            }
        });

        // The grid visits bodies in no particular order.
        ids.sort_unstable();
        ids
    }
}

#[cfg(test)]
mod tests {
    use crate::hall::{Field, Guests, Hall};
    use crate::placing::place;
    use crate::triangular::Triangular;
    use rand::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// How many bodies the guests are compared with in one tick; each guest is also compared with itself.
    fn comparisons(guests: usize) -> usize {
        let side_m = (8.0 * guests as f64).sqrt();
        let still = Triangular::new(0.0, 0.0, 0.0).unwrap();

        let hall = Hall {
            field: Field {
                size_m: (side_m, side_m),
                body_m: 1.0,
            },
            obstacles: Vec::new(),
            guests: Guests {
                count: guests,
                speed_mps: still,
                duration_s: still,
            },
            robots: Vec::new(),
            tick_s: 0.1,
            max_speed_mps: 1.0,
        };
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
        let bodies = place(&hall, &mut rng).unwrap();

        let mut count = 0;
        for &center in bodies.guests() {
            bodies
                .grid
                .visit_around(center, hall.field.body_m, |_| count += 1);
        }
        count
    }

    #[test]
    fn work_grows_linearly_with_the_crowd() {
        for guests in [100, 1_000, 10_000, 100_000] {
            let per_guest = comparisons(guests) as f64 / guests as f64;

            assert!(
                (1.0..2.5).contains(&per_guest),
                "{per_guest} comparisons for each of {guests} guests"
            );
        }
    }
}

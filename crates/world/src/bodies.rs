//! Every body on the field, numbered, with the one test of collision.
//!
//! Obstacles come first, then robots, then guests, in one sequence of numbers. So "the first in the order of
//! kind and index" is "the smallest number", and all kinds obey the same test.

use crate::grid::Grid;
use crate::hall::Field;
use crate::point::Point;

/// A body, by its kind and its index in that kind's list. Ordered by kind as listed here, then by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Body {
    /// A fixed obstacle.
    Obstacle(usize),
    /// A robot.
    Robot(usize),
    /// A guest.
    Guest(usize),
}

/// What kept a body from its proposed location.
///
/// If several things did, the edge is named first, otherwise the first body in the order of [`Body`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Blocker {
    /// The edge of the field.
    Edge,
    /// A body that is there.
    Body(Body),
}

/// A body found by [`World::near`](crate::World::near).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Which one.
    pub body: Body,
    /// Its center, m.
    pub center: Point,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bodies {
    field: Field,
    /// Numbers below this are obstacles.
    robots_from: usize,
    /// Numbers from this on are guests.
    guests_from: usize,
    centers: Vec<Point>,
    grid: Grid,
}

impl Bodies {
    /// An empty field that will hold so many bodies of each kind, pushed in that order.
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

    /// Puts the next body here, unseen: the caller has tested that it may be here.
    pub(crate) fn push(&mut self, center: Point) {
        self.centers.push(center);
        self.grid.push(center);
    }

    /// Takes the guests off the field again.
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

    /// The body that a new body at this center would overlap, the first of them in the order of [`Body`].
    pub(crate) fn hit(&self, center: Point) -> Option<Body> {
        self.first_hit(center, usize::MAX).map(|id| self.body(id))
    }

    /// How far right the bodies reach that a new body at this center would overlap, by the center of the last.
    pub(crate) fn hit_until_x_m(&self, center: Point) -> Option<f64> {
        let mut until_x_m = None;
        self.grid.visit_around(center, self.field.body_m, |id| {
            let other = self.centers[id];
            if self.field.overlap(center, other) && until_x_m.is_none_or(|x_m| x_m < other.x) {
                until_x_m = Some(other.x);
            }
        });
        until_x_m
    }

    /// Moves a robot there, or leaves it where it is and says why.
    pub(crate) fn advance_robot(&mut self, index: usize, to: Point) -> Result<(), Blocker> {
        self.advance(self.robots_from + index, to)
    }

    /// Moves a guest on by this step, or leaves it where it is and says why.
    pub(crate) fn advance_guest(&mut self, index: usize, step: Point) -> Result<(), Blocker> {
        let id = self.guests_from + index;
        self.advance(id, self.centers[id] + step)
    }

    /// The rule of collision (seed, "Obstacles"): the offending body is not advanced.
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

    /// All bodies with their center within `range_m` of `point`, in the order of [`Body`].
    pub(crate) fn near(&self, point: Point, range_m: f64) -> Vec<Near> {
        let mut ids = Vec::new();
        if point.is_finite() && range_m >= 0.0 {
            self.grid.visit_around(point, range_m, |id| {
                if (self.centers[id] - point).length_squared_m2() <= range_m * range_m {
                    ids.push(id);
                }
            });
        }
        ids.sort_unstable();
        ids.into_iter()
            .map(|id| Near {
                body: self.body(id),
                center: self.centers[id],
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::hall::{Field, Guests, Hall};
    use crate::placing::place;
    use crate::triangular::Triangular;
    use rand::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// How many bodies the guests are compared with in one tick, each guest with itself included.
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
        let bodies = place(&hall, &mut Xoshiro256PlusPlus::seed_from_u64(3)).unwrap();
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
            let each = comparisons(guests) as f64 / guests as f64;
            assert!(
                (1.0..2.5).contains(&each),
                "{each} comparisons for each of {guests} guests"
            );
        }
    }
}

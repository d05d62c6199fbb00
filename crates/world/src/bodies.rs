//! All bodies on the field, and the collision test that applies to each of them.
//!
//! Bodies share one sequence of numbers: obstacles first, then robots, then guests. The first body in the order
//! of [`Body`] is therefore the one with the smallest number, and every kind goes through the same test.

use crate::footprint::Footprint;
use crate::grid::Grid;
use crate::hall::Field;
use crate::point::Point;
use crate::shape::{Shape, Wall};
use crate::shapes::Shapes;
use crate::solids::{SolidBlocker, Solids};
use crate::sweep::Sweep;

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
/// When several obstructions apply, this is the first of them in the order of this type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Blocker {
    /// The edge of the field.
    Edge,
    /// A wall in the way, by index.
    Wall(usize),
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
    /// Walls and shapes; `None` where all bodies are squares of one size, which are tested by their centers alone.
    solids: Option<Box<Solids>>,
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
            solids: None,
        }
    }

    /// Adds walls, and shapes of bodies. All obstacles have been pushed, and no robot.
    pub(crate) fn set_solids(&mut self, solids: Solids) {
        self.solids = Some(Box::new(solids));
    }

    /// Adds the next body, a robot with this footprint; see [`Self::push`].
    pub(crate) fn push_shaped(&mut self, center: Point, footprint: Option<Footprint>) {
        if let Some(footprint) = footprint {
            let id = self.centers.len();
            let field = self.field;
            let obstacles = &self.centers[..self.robots_from];
            let solids = self
                .solids
                .get_or_insert_with(|| Box::new(Solids::new(field, &Shapes::default(), obstacles)));
            solids.set_footprint(id, footprint);
        }
        self.push(center);
    }

    pub(crate) fn walls(&self) -> &[Wall] {
        self.solids.as_ref().map_or(&[], |solids| solids.walls())
    }

    /// The footprint of a body.
    pub(crate) fn footprint(&self, body: Body) -> Footprint {
        let id = match body {
            Body::Obstacle(index) => index,
            Body::Robot(index) => self.robots_from + index,
            Body::Guest(index) => self.guests_from + index,
        };
        self.footprint_of(id)
    }

    fn footprint_of(&self, id: usize) -> Footprint {
        match &self.solids {
            Some(solids) => solids.footprint(id),
            None => Shape::square(self.field.body_m).into(),
        }
    }

    pub(crate) fn half_max_m(&self) -> f64 {
        let solids = self.solids.as_ref();
        solids.map_or(self.field.body_m * 0.5, |solids| solids.half_max_m())
    }

    pub(crate) fn field(&self) -> &Field {
        &self.field
    }

    /// Adds the next body without a collision test; the caller has already made sure that it fits.
    pub(crate) fn push(&mut self, center: Point) {
        self.centers.push(center);
        self.grid.push(center);
    }

    /// Adds the next body, a guest that is not on the field.
    pub(crate) fn push_absent_guest(&mut self) {
        self.centers.push(Point::default());
        self.grid.push_absent();
    }

    /// Whether a guest is on the field.
    pub(crate) fn is_present(&self, guest: usize) -> bool {
        self.grid.contains(self.guests_from + guest)
    }

    /// Puts a guest on the field that is not there, or returns what is in its place. Other guests are not in its way.
    pub(crate) fn enter_guest(&mut self, index: usize, at: Point) -> Result<(), Blocker> {
        let id = self.guests_from + index;
        self.check_way_among_guests(id, at, at)?;

        self.centers[id] = at;
        self.grid.insert(id, at);
        Ok(())
    }

    /// Takes a guest off the field.
    pub(crate) fn leave_guest(&mut self, index: usize) {
        self.grid.remove(self.guests_from + index);
    }

    /// Moves a guest, or leaves it in place and returns what blocks it. Other guests are not in its way.
    pub(crate) fn move_guest_among_guests(
        &mut self,
        index: usize,
        to: Point,
    ) -> Result<(), Blocker> {
        let id = self.guests_from + index;
        self.check_way_among_guests(id, self.centers[id], to)?;

        self.centers[id] = to;
        self.grid.relocate(id, to);
        Ok(())
    }

    fn check_way_among_guests(&self, id: usize, from: Point, to: Point) -> Result<(), Blocker> {
        let blocker = if self.solids.is_some() {
            let way = Sweep::straight(self.footprint_of(id), from, to);
            if !way.footprint.is_inside(to, self.field.size_m) {
                return Err(Blocker::Edge);
            }
            self.first_blocker(&way, id)
        } else {
            if !self.field.contains(to) {
                return Err(Blocker::Edge);
            }
            let first = self.first_hit(to, id);
            first.map(|other| Blocker::Body(self.body(other)))
        };

        // Guests have the highest numbers, so where the first hit is one, there is no other body.
        match blocker {
            None | Some(Blocker::Body(Body::Guest(_))) => Ok(()),
            Some(other) => Err(other),
        }
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

    /// What a new body with this footprint at this center would overlap; a square of the field if it has none of its own.
    pub(crate) fn hit(&self, center: Point, footprint: Option<Footprint>) -> Option<Blocker> {
        if self.solids.is_none() && footprint.is_none() {
            let id = self.first_hit(center, usize::MAX)?;
            return Some(Blocker::Body(self.body(id)));
        }
        let footprint = footprint.unwrap_or(Shape::square(self.field.body_m).into());
        self.first_blocker(&Sweep::straight(footprint, center, center), usize::MAX)
    }

    /// The largest x, in meters, of the centers that a new square at this center would overlap. Anything but a square counts as
    /// one with the same right edge.
    pub(crate) fn rightmost_hit_x_m(&self, center: Point) -> Option<f64> {
        let mut rightmost_x_m = None;

        if let Some(solids) = &self.solids {
            return self.rightmost_solid_x_m(solids, center);
        }

        self.grid.visit_around(center, self.field.body_m, |id| {
            let other = self.centers[id];
            let is_farther = rightmost_x_m.is_none_or(|x_m| x_m < other.x);

            if is_farther && self.field.overlap(center, other) {
                rightmost_x_m = Some(other.x);
            }
        });

        rightmost_x_m
    }

    #[cold]
    #[inline(never)]
    fn rightmost_solid_x_m(&self, solids: &Solids, center: Point) -> Option<f64> {
        let square = Footprint::from(Shape::square(self.field.body_m));
        let half_m = self.field.body_m * 0.5;
        let mut rightmost_x_m = solids.rightmost_x_m(center).map(|x_m| x_m - half_m);

        self.grid
            .visit_around(center, solids.reach_m(square), |id| {
                let footprint = solids.footprint(id);
                let at = self.centers[id];
                if square.overlaps(center, footprint, at) {
                    let x_m = at.x + footprint.half_m().0 - half_m;
                    rightmost_x_m =
                        Some(rightmost_x_m.map_or(x_m, |other_m: f64| other_m.max(x_m)));
                }
            });

        rightmost_x_m
    }

    /// Moves a robot to `to`, or leaves it in place and returns what blocks it.
    pub(crate) fn advance_robot(&mut self, index: usize, to: Point) -> Result<(), Blocker> {
        self.advance(self.robots_from + index, to)
    }

    /// Moves a robot that turns to `to`, or leaves it in place and returns what blocks it. `footprint` is the robot as it lies after
    /// it has turned by `turn_rad`.
    pub(crate) fn turn_robot(
        &mut self,
        index: usize,
        to: Point,
        footprint: Footprint,
        turn_rad: f64,
    ) -> Result<(), Blocker> {
        let id = self.robots_from + index;
        let way = Sweep {
            from: self.centers[id],
            to,
            footprint,
            turn_rad,
        };
        self.advance_along(id, &way)?;

        if let Some(solids) = &mut self.solids {
            solids.set_footprint(id, footprint);
        }
        Ok(())
    }

    /// Moves a guest by `step`, or leaves it in place and returns what blocks it.
    pub(crate) fn advance_guest(&mut self, index: usize, step: Point) -> Result<(), Blocker> {
        let id = self.guests_from + index;
        let to = self.centers[id] + step;

        self.advance(id, to)
    }

    /// The collision rule of the paper ("Obstacles"): a body that would collide is not advanced.
    fn advance(&mut self, id: usize, to: Point) -> Result<(), Blocker> {
        if self.solids.is_some() {
            return self.advance_shaped(id, to);
        }

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

    /// The same rule among walls and shapes. The way to the proposed location counts as well, but only for walls and for
    /// obstacles with a shape of their own.
    ///
    /// Kept out of [`Self::advance`], whose speed is that of a hall without walls.
    #[cold]
    #[inline(never)]
    fn advance_shaped(&mut self, id: usize, to: Point) -> Result<(), Blocker> {
        let way = Sweep::straight(self.footprint_of(id), self.centers[id], to);
        self.advance_along(id, &way)
    }

    fn advance_along(&mut self, id: usize, way: &Sweep) -> Result<(), Blocker> {
        if !way.footprint.is_inside(way.to, self.field.size_m) {
            return Err(Blocker::Edge);
        }

        if let Some(by) = self.first_blocker(way, id) {
            return Err(by);
        }

        self.centers[id] = way.to;
        self.grid.relocate(id, way.to);
        Ok(())
    }

    /// What is in the way of a body other than `except`.
    fn first_blocker(&self, way: &Sweep, except: usize) -> Option<Blocker> {
        let &Sweep { to, footprint, .. } = way;
        let default = Footprint::from(Shape::square(self.field.body_m));
        let mut first = usize::MAX;
        let mut reach_m = 0.0;

        if let Some(solids) = &self.solids {
            match solids.blocker(way) {
                Some(SolidBlocker::Wall(index)) => return Some(Blocker::Wall(index)),
                Some(SolidBlocker::Obstacle(id)) => first = id,
                None => {}
            }
            reach_m = solids.reach_m(footprint);
        } else {
            let (half_x_m, half_y_m) = footprint.half_m();
            reach_m += half_x_m.max(half_y_m) + self.field.body_m * 0.5;
        }

        self.grid.visit_around(to, reach_m, |id| {
            let other = self
                .solids
                .as_ref()
                .map_or(default, |solids| solids.footprint(id));
            if id < first && id != except && footprint.overlaps(to, other, self.centers[id]) {
                first = id;
            }
        });

        (first != usize::MAX).then(|| Blocker::Body(self.body(first)))
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
            if offset.length_squared() <= range_m * range_m {
                ids.push(id);
            }
        });

        // What may be long, such as a wall of a building, is near where any part of it is.
        if let Some(solids) = &self.solids {
            ids.extend(solids.obstacles_near(point, range_m));
        }

        // The grid visits bodies in no particular order.
        ids.sort_unstable();
        ids.dedup();
        ids
    }
}

#[cfg(test)]
mod tests {
    use crate::hall::{Field, Guests, Hall};
    use crate::placing::place;
    use crate::shapes::Shapes;
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
            shapes: Shapes::default(),
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

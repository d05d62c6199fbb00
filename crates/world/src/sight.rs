//! What is seen from a place: what hides what, and how far it is to the next thing in a direction.

use crate::bodies::Body;
use crate::footprint::Footprint;
use crate::limits::TOLERANCE_M;
use crate::motion::World;
use crate::point::Point;
use crate::shape::{Shape, Wall};

/// Something that is not looked through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Opaque {
    /// A body.
    Body {
        /// Its shape, as it lies.
        footprint: Footprint,
        /// Its center, m.
        at: Point,
    },
    /// A wall.
    Wall(Wall),
}

impl Opaque {
    /// The share of the way from `from` to `to` after which the way enters it: 0 if it begins inside. `None` if it passes by, or
    /// touches a corner or a rim, or ends at it. A way along the side of a rectangle enters it.
    #[must_use]
    pub fn entered_after(&self, from: Point, to: Point) -> Option<f64> {
        let (enter, leave) = match *self {
            Self::Body { footprint, at } => match footprint.shape() {
                shape @ Shape::Rectangle { .. } if footprint.is_turned() => {
                    let one = footprint.to_local(from - at);
                    let other = footprint.to_local(to - at);
                    crossed_rectangle(one, other, Point::default(), shape.half_m())
                }
                shape @ Shape::Rectangle { .. } => crossed_rectangle(from, to, at, shape.half_m()),
                Shape::Disc { radius_m } => crossed_disc(from, to, at, radius_m)?,
            },
            Self::Wall(wall) => return crossed_wall(from, to, &wall),
        };
        let enter = enter.max(0.0);
        (enter < leave.min(1.0)).then_some(enter)
    }
}

/// The shares of a way between which it is in a rectangle; the first is not below the second if it never is.
fn crossed_rectangle(from: Point, to: Point, center: Point, half_m: (f64, f64)) -> (f64, f64) {
    let (enter_x, leave_x) = crossed(from.x, to.x, center.x, half_m.0);
    let (enter_y, leave_y) = crossed(from.y, to.y, center.y, half_m.1);
    (enter_x.max(enter_y), leave_x.min(leave_y))
}

/// The shares of a way between which it is in a disc; `None` if it never is.
fn crossed_disc(from: Point, to: Point, center: Point, radius_m: f64) -> Option<(f64, f64)> {
    let (step, offset) = (to - from, from - center);
    // |offset + share step| = radius is a quadratic equation in the share.
    let step_m2 = step.length_squared();
    let outside_m2 = offset.length_squared() - radius_m * radius_m;
    if step_m2 == 0.0 {
        return (outside_m2 < 0.0).then_some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let half_b = offset.dot(step);
    let discriminant = half_b * half_b - step_m2 * outside_m2;
    if discriminant <= 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    Some(((-half_b - root) / step_m2, (-half_b + root) / step_m2))
}

/// The share of a way at which it crosses a wall, both ends of the wall included.
fn crossed_wall(from: Point, to: Point, wall: &Wall) -> Option<f64> {
    let step = to - from;
    let one = wall.from - from;
    let other = wall.to - from;
    // Walls that meet have the same numbers here for the end that they share: no way passes between them by rounding.
    let one_side = step.cross(one);
    let other_side = step.cross(other);
    let apart = one_side - other_side;
    let is_between = one_side.min(other_side) <= 0.0 && one_side.max(other_side) >= 0.0;
    if !is_between || apart == 0.0 {
        // A wall has no thickness: it cannot be seen from its end.
        return None;
    }

    let crossing = one + (other - one) * (one_side / apart);
    let share = crossing.dot(step) / step.length_squared();
    (0.0..1.0).contains(&share).then_some(share)
}

/// The shares of a way between which one of its coordinates is within `half` of `center`; they are equal if it never is.
fn crossed(from: f64, to: f64, center: f64, half: f64) -> (f64, f64) {
    let step = to - from;
    // A way along the side of a body is in it, so that none passes between bodies side by side.
    if step.abs() <= TOLERANCE_M {
        let is_within = (from - center).abs() <= half + TOLERANCE_M;
        return if is_within {
            (f64::NEG_INFINITY, f64::INFINITY)
        } else {
            (0.0, 0.0)
        };
    }
    let one = (center - half - from) / step;
    let other = (center + half - from) / step;
    (one.min(other), one.max(other))
}

/// Whether one of these lies on the way from `from` to `to`. What is on the surface of one is seen from its side.
#[must_use]
pub fn is_hidden<'a>(from: Point, to: Point, opaque: impl IntoIterator<Item = &'a Opaque>) -> bool {
    let length_m = from.distance_m(to);
    opaque.into_iter().any(|opaque| {
        let entered = opaque.entered_after(from, to);
        // Rounding must not decide about a place on a surface.
        entered.is_some_and(|share| (1.0 - share) * length_m > TOLERANCE_M)
    })
}

/// What the straight line between two robots crosses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Crossed {
    /// Number of walls.
    pub walls: u32,
    /// Number of bodies of other robots and of guests.
    pub bodies: u32,
}

impl<R> World<R> {
    /// What the straight line between the centers of two robots crosses, the same in both directions. Obstacles do not count.
    #[must_use]
    pub fn crossed(&self, one: usize, other: usize) -> Crossed {
        let (first, second) = (one.min(other), one.max(other));
        let (from, to) = (self.robots()[first], self.robots()[second]);
        let middle = from + (to - from) * 0.5;
        // A little more, because the half of a distance is rounded.
        let range_m = from.distance_m(to) * 0.5 + TOLERANCE_M;
        let is_crossed = |opaque: &Opaque| opaque.entered_after(from, to).is_some();

        let walls = self.walls_near(middle, range_m).filter(is_crossed).count();
        let mut bodies = 0;
        for (body, opaque) in self.bodies_near(middle, range_m) {
            let is_between = match body {
                Body::Robot(index) => index != first && index != second,
                Body::Guest(_) => true,
                Body::Obstacle(_) => false,
            };
            bodies += u32::from(is_between && is_crossed(&opaque));
        }
        Crossed {
            walls: walls as u32,
            bodies,
        }
    }

    /// The walls and the fixed obstacles that may hide something within `range_m` of a place; obstacles with their index.
    #[must_use]
    pub fn opaque_near(&self, from: Point, range_m: f64) -> Vec<(Option<usize>, Opaque)> {
        let walls = self.walls_near(from, range_m).map(|wall| (None, wall));
        let bodies = self.bodies_near(from, range_m).into_iter();
        let obstacles = bodies.filter_map(|(body, opaque)| match body {
            Body::Obstacle(index) => Some((Some(index), opaque)),
            Body::Robot(_) | Body::Guest(_) => None,
        });
        walls.chain(obstacles).collect()
    }

    /// The distance from a robot's center in each of these directions to the next body, wall or edge of the field, m; at most
    /// `range_m`. Directions are vectors of length 1.
    #[must_use]
    pub fn ranges_m(&self, robot: usize, directions: &[Point], range_m: f64) -> Vec<f64> {
        let from = self.robots()[robot];
        let bodies = self.bodies_near(from, range_m).into_iter();
        let others = bodies.filter(|(body, _)| *body != Body::Robot(robot));
        let opaque: Vec<Opaque> = others
            .map(|(_, opaque)| opaque)
            .chain(self.walls_near(from, range_m))
            .collect();
        let (width_m, height_m) = self.field().size_m;
        let (center, half_m) = (
            Point::new(width_m * 0.5, height_m * 0.5),
            (width_m * 0.5, height_m * 0.5),
        );

        let mut ranges = Vec::with_capacity(directions.len());
        for direction in directions {
            let to = from + *direction * range_m;
            let (_, edge) = crossed_rectangle(from, to, center, half_m);
            let mut nearest = edge.clamp(0.0, 1.0);
            for opaque in &opaque {
                if let Some(share) = opaque.entered_after(from, to) {
                    nearest = nearest.min(share);
                }
            }
            ranges.push(nearest * range_m);
        }
        ranges
    }

    /// The walls of which a part may be within `range_m` of a place.
    fn walls_near(&self, from: Point, range_m: f64) -> impl Iterator<Item = Opaque> {
        let is_near = move |one_m: f64, other_m: f64, at_m: f64| {
            one_m.min(other_m) <= at_m + range_m && at_m - range_m <= one_m.max(other_m)
        };
        let walls = self.walls().iter().filter(move |wall| {
            is_near(wall.from.x, wall.to.x, from.x) && is_near(wall.from.y, wall.to.y, from.y)
        });
        walls.map(|wall| Opaque::Wall(*wall))
    }

    /// The bodies of which a part may be within `range_m` of a place.
    fn bodies_near(&self, from: Point, range_m: f64) -> Vec<(Body, Opaque)> {
        // No corner of a body is farther from its center than one and a half times its larger half.
        let reach_m = range_m + 1.5 * self.half_max_m();
        let near = self.near(from, reach_m).into_iter();
        near.map(|near| {
            let opaque = Opaque::Body {
                footprint: self.footprint(near.body),
                at: near.center,
            };
            (near.body, opaque)
        })
        .collect()
    }
}

//! What is seen from a place: what hides what, and how far it is to the next body in a direction.

use crate::bodies::Body;
use crate::motion::World;
use crate::point::Point;

/// A rectangle whose sides are parallel to the field's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Its center, m.
    pub center: Point,
    /// Half of its width and half of its height, m.
    pub half_m: (f64, f64),
}

impl Rectangle {
    /// The share of the way from `from` to `to` after which the way enters the rectangle: 0 if it begins inside. `None` if it
    /// passes by, or only touches an edge.
    #[must_use]
    pub fn entered_after(&self, from: Point, to: Point) -> Option<f64> {
        let along = [
            crossed(from.x, to.x, self.center.x, self.half_m.0),
            crossed(from.y, to.y, self.center.y, self.half_m.1),
        ];
        let [(enter_x, leave_x), (enter_y, leave_y)] = along;
        let enter = enter_x.max(enter_y).max(0.0);
        let leave = leave_x.min(leave_y).min(1.0);
        (enter < leave).then_some(enter)
    }
}

/// The shares of a way between which one of its coordinates is within `half` of `center`; they are equal if it never is.
fn crossed(from: f64, to: f64, center: f64, half: f64) -> (f64, f64) {
    let step = to - from;
    if step == 0.0 {
        let is_within = (from - center).abs() < half;
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

/// Whether one of these rectangles lies on the way from `from` to `to`.
#[must_use]
pub fn is_hidden<'a>(
    from: Point,
    to: Point,
    walls: impl IntoIterator<Item = &'a Rectangle>,
) -> bool {
    let mut walls = walls.into_iter();
    walls.any(|wall| wall.entered_after(from, to).is_some())
}

impl<R> World<R> {
    /// The fixed obstacles that may hide something within `range_m` of a place, by index.
    #[must_use]
    pub fn walls_near(&self, from: Point, range_m: f64) -> Vec<(usize, Rectangle)> {
        let mut walls = Vec::new();
        for (body, rectangle) in self.rectangles_near(from, range_m) {
            if let Body::Obstacle(index) = body {
                walls.push((index, rectangle));
            }
        }
        walls
    }

    /// The distance from a robot's center in each of these directions to the next body or the edge of the field, m; at most
    /// `range_m`. Directions are vectors of length 1.
    #[must_use]
    pub fn ranges_m(&self, robot: usize, directions: &[Point], range_m: f64) -> Vec<f64> {
        let from = self.robots()[robot];
        let bodies = self.rectangles_near(from, range_m);
        let (width_m, height_m) = self.field().size_m;
        let field = Rectangle {
            center: Point::new(width_m * 0.5, height_m * 0.5),
            half_m: (width_m * 0.5, height_m * 0.5),
        };

        let mut ranges = Vec::with_capacity(directions.len());
        for direction in directions {
            let to = from + *direction * range_m;
            let (_, leave_x) = crossed(from.x, to.x, field.center.x, field.half_m.0);
            let (_, leave_y) = crossed(from.y, to.y, field.center.y, field.half_m.1);
            let mut nearest = leave_x.min(leave_y).clamp(0.0, 1.0);
            for (body, rectangle) in &bodies {
                if *body != Body::Robot(robot)
                    && let Some(share) = rectangle.entered_after(from, to)
                {
                    nearest = nearest.min(share);
                }
            }
            ranges.push(nearest * range_m);
        }
        ranges
    }

    /// The bodies of which a part may be within `range_m` of a place.
    fn rectangles_near(&self, from: Point, range_m: f64) -> Vec<(Body, Rectangle)> {
        // The center of a square is less than a side from its corners.
        let half_m = self.field().body_m * 0.5;
        let near = self.near(from, range_m + 2.0 * half_m).into_iter();
        near.map(|near| {
            let rectangle = Rectangle {
                center: near.center,
                half_m: (half_m, half_m),
            };
            (near.body, rectangle)
        })
        .collect()
    }
}

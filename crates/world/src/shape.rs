//! Shapes of bodies, walls, and the tests between them: does one overlap the other, here or on a straight path.
//!
//! Bodies do not rotate: a rectangle keeps its sides along the axes. All tests are exact up to rounding and use nothing but
//! `+ - * /`, comparisons and the square root. Like every test of this crate they allow an overlap of [`TOLERANCE_M`].

use crate::limits::TOLERANCE_M;
use crate::point::Point;

/// The shape of a body around its center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A rectangle with sides along the axes.
    Rectangle {
        /// Along x, m.
        width_m: f64,
        /// Along y, m.
        height_m: f64,
    },
    /// A disc.
    Disc {
        /// From the center to the rim, m.
        radius_m: f64,
    },
}

/// A wall: a straight line without thickness that no body passes through or stands on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// One end, m.
    pub from: Point,
    /// The other end, m.
    pub to: Point,
}

/// How far a body may overlap a wall on its way from one place to another.
///
/// Twice what it may at the places themselves: rounding must not hold a body at a place that it was allowed to take.
const PATH_TOLERANCE_M: f64 = 2.0 * TOLERANCE_M;

impl Shape {
    /// The square with this side.
    #[must_use]
    pub const fn square(side_m: f64) -> Self {
        Self::Rectangle {
            width_m: side_m,
            height_m: side_m,
        }
    }

    /// Half of the extent along x and along y, m.
    #[must_use]
    pub fn half_m(self) -> (f64, f64) {
        match self {
            Self::Rectangle { width_m, height_m } => (width_m * 0.5, height_m * 0.5),
            Self::Disc { radius_m } => (radius_m, radius_m),
        }
    }

    /// Whether a body of this shape at `at` is entirely on a field of this size, within [`TOLERANCE_M`].
    #[must_use]
    pub fn is_inside(self, at: Point, size_m: (f64, f64)) -> bool {
        let (half_x_m, half_y_m) = self.half_m();
        let margin_x_m = half_x_m - TOLERANCE_M;
        let margin_y_m = half_y_m - TOLERANCE_M;

        margin_x_m <= at.x
            && at.x <= size_m.0 - margin_x_m
            && margin_y_m <= at.y
            && at.y <= size_m.1 - margin_y_m
    }

    /// Whether bodies of two shapes at these centers overlap by more than [`TOLERANCE_M`].
    #[must_use]
    pub fn overlaps(self, at: Point, other: Self, other_at: Point) -> bool {
        self.is_closer(other, other_at - at, Point::default(), TOLERANCE_M)
    }

    /// Whether a body of this shape that moves straight from one center to another overlaps a resting one on the way.
    #[must_use]
    pub fn sweeps(self, from: Point, to: Point, other: Self, other_at: Point) -> bool {
        self.is_closer(other, other_at - from, to - from, PATH_TOLERANCE_M)
    }

    /// Whether a body of this shape at `at` stands on a wall.
    #[must_use]
    pub fn stands_on(self, at: Point, wall: &Wall) -> bool {
        self.is_crossed(at, at, wall, TOLERANCE_M)
    }

    /// Whether a body of this shape that moves straight from one center to another meets a wall on the way, or stands on it at
    /// the end.
    #[must_use]
    pub fn meets(self, from: Point, to: Point, wall: &Wall) -> bool {
        self.is_crossed(from, to, wall, PATH_TOLERANCE_M) || self.stands_on(to, wall)
    }

    /// The distance from a body of this shape at `at` to a point, m; 0 within the body.
    #[must_use]
    pub fn distance_m(self, at: Point, point: Point) -> f64 {
        let offset = point - at;
        match self {
            Self::Rectangle { .. } => rectangle_to_point_m(self.half_m(), offset),
            Self::Disc { radius_m } => (offset.length_squared_m2().sqrt() - radius_m).max(0.0),
        }
    }

    /// Whether this shape, moved by `path` from the origin, overlaps `other` at `offset` by more than `slack_m`.
    ///
    /// A shape that moves past another is a point that moves past the sum of both.
    fn is_closer(self, other: Self, offset: Point, path: Point, slack_m: f64) -> bool {
        let sum = match (self, other) {
            (Self::Disc { radius_m: one_m }, Self::Disc { radius_m: other_m }) => {
                let reach_m = one_m + other_m - slack_m;
                return segment_to_point_m2(path, offset) < squared(reach_m);
            }
            (Self::Rectangle { .. }, Self::Rectangle { .. }) => {
                let (one, other) = (self.half_m(), other.half_m());
                let half_m = (one.0 + other.0, one.1 + other.1);
                return meets_rectangle(half_m, offset, path, slack_m);
            }
            (Self::Disc { radius_m }, rectangle) | (rectangle, Self::Disc { radius_m }) => {
                (rectangle.half_m(), radius_m)
            }
        };

        let (half_m, radius_m) = sum;
        meets_rectangle(half_m, offset, path, 0.0)
            || segment_to_rectangle_m(half_m, offset, path) < radius_m - slack_m
    }

    fn is_crossed(self, from: Point, to: Point, wall: &Wall, slack_m: f64) -> bool {
        // Relative to the start, so that rounding does not grow with the distance from the corner of the field.
        let path = to - from;
        let one = wall.from - from;
        let other = wall.to - from;

        match self {
            Self::Disc { radius_m } => {
                let reach_m = radius_m - slack_m;
                segments_cross(path, one, other)
                    || segments_to_ends_m2(path, one, other) < squared(reach_m)
            }
            Self::Rectangle { .. } => {
                let half_m = self.half_m();
                let along = other - one;
                let axes = [
                    Some(Point::new(1.0, 0.0)),
                    Some(Point::new(0.0, 1.0)),
                    normal(along),
                    normal(path),
                ];
                // Convex shapes overlap if and only if their shadows do along every normal of their edges.
                axes.into_iter().flatten().all(|axis| {
                    let reach_m = half_m.0 * axis.x.abs() + half_m.1 * axis.y.abs();
                    let ends = (dot(one, axis), dot(other, axis));
                    shadows_overlap(dot(path, axis), ends, reach_m, slack_m)
                })
            }
        }
    }
}

impl Wall {
    /// Whether the wall passes through a rectangle with this center, or comes closer to it than 1 µm.
    pub(crate) fn is_in(&self, center: Point, half_m: (f64, f64)) -> bool {
        let rectangle = Shape::Rectangle {
            width_m: half_m.0 * 2.0,
            height_m: half_m.1 * 2.0,
        };
        rectangle.is_crossed(center, center, self, -1e-6)
    }

    /// The largest x of the part of the wall between two heights, m; `None` if none of it is.
    pub(crate) fn rightmost_x_m(&self, bottom_m: f64, top_m: f64) -> Option<f64> {
        let (low, high) = if self.from.y <= self.to.y {
            (self.from, self.to)
        } else {
            (self.to, self.from)
        };
        if high.y < bottom_m || top_m < low.y {
            return None;
        }

        let rise_m = high.y - low.y;
        let x_at = |y_m: f64| {
            if rise_m > 0.0 {
                let share = ((y_m - low.y) / rise_m).clamp(0.0, 1.0);
                low.x + (high.x - low.x) * share
            } else {
                low.x.max(high.x)
            }
        };
        Some(x_at(bottom_m).max(x_at(top_m)))
    }
}

fn squared(length_m: f64) -> f64 {
    length_m.max(0.0) * length_m.max(0.0)
}

fn dot(a: Point, b: Point) -> f64 {
    a.x * b.x + a.y * b.y
}

fn cross(a: Point, b: Point) -> f64 {
    a.x * b.y - a.y * b.x
}

/// The direction at a right angle to a displacement, of length 1; `None` for a displacement that is none.
fn normal(displacement: Point) -> Option<Point> {
    let length_m = displacement.length_squared_m2().sqrt();
    (length_m > 0.0).then(|| Point::new(-displacement.y, displacement.x) * (1.0 / length_m))
}

/// Whether the shadow of a path from 0 overlaps that of a line between two ends, widened by `reach_m` on both sides, by more
/// than `slack_m`.
fn shadows_overlap(path_m: f64, ends_m: (f64, f64), reach_m: f64, slack_m: f64) -> bool {
    let low_m = ends_m.0.min(ends_m.1) - reach_m;
    let high_m = ends_m.0.max(ends_m.1) + reach_m;

    path_m.max(0.0) - low_m > slack_m && high_m - path_m.min(0.0) > slack_m
}

/// Whether a path from the origin enters a rectangle at `offset` by more than `slack_m`.
fn meets_rectangle(half_m: (f64, f64), offset: Point, path: Point, slack_m: f64) -> bool {
    let axes = [
        Some(Point::new(1.0, 0.0)),
        Some(Point::new(0.0, 1.0)),
        normal(path),
    ];
    axes.into_iter().flatten().all(|axis| {
        let reach_m = half_m.0 * axis.x.abs() + half_m.1 * axis.y.abs();
        let center_m = dot(offset, axis);
        shadows_overlap(dot(path, axis), (center_m, center_m), reach_m, slack_m)
    })
}

/// The distance from a rectangle around the origin to a point, m.
fn rectangle_to_point_m(half_m: (f64, f64), point: Point) -> f64 {
    let beside_m = (point.x.abs() - half_m.0).max(0.0);
    let above_m = (point.y.abs() - half_m.1).max(0.0);

    Point::new(beside_m, above_m).length_squared_m2().sqrt()
}

/// The distance from a path from the origin to a rectangle at `offset` that it does not enter, m.
fn segment_to_rectangle_m(half_m: (f64, f64), offset: Point, path: Point) -> f64 {
    let start_m = rectangle_to_point_m(half_m, offset);
    let end_m = rectangle_to_point_m(half_m, offset - path);
    let mut nearest_m = start_m.min(end_m);

    for (x, y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        let corner = offset + Point::new(half_m.0 * x, half_m.1 * y);
        nearest_m = nearest_m.min(segment_to_point_m2(path, corner).sqrt());
    }
    nearest_m
}

/// The squared distance from a path from the origin to a point, m².
fn segment_to_point_m2(path: Point, point: Point) -> f64 {
    let length_m2 = path.length_squared_m2();
    let share = if length_m2 > 0.0 {
        (dot(point, path) / length_m2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (point - path * share).length_squared_m2()
}

/// Whether a path from the origin crosses the line between two ends.
fn segments_cross(path: Point, one: Point, other: Point) -> bool {
    let along = other - one;
    let ends_differ = cross(path, one) * cross(path, other) < 0.0;
    let places_differ = cross(along, one) * cross(along, one - path) < 0.0;
    ends_differ && places_differ
}

/// The smallest squared distance between an end of a path from the origin, or of the line between two ends, and the other, m².
fn segments_to_ends_m2(path: Point, one: Point, other: Point) -> f64 {
    let along = other - one;
    let to_wall = segment_to_point_m2(along, one * -1.0);
    let end_to_wall = segment_to_point_m2(along, path - one);
    let to_path = segment_to_point_m2(path, one);
    let other_to_path = segment_to_point_m2(path, other);

    to_wall.min(end_to_wall).min(to_path).min(other_to_path)
}

#[cfg(test)]
mod tests {
    use super::{Shape, Wall};
    use crate::point::Point;

    fn wall(from: (f64, f64), to: (f64, f64)) -> Wall {
        Wall {
            from: Point::new(from.0, from.1),
            to: Point::new(to.0, to.1),
        }
    }

    const SHAPES: [Shape; 3] = [
        Shape::Disc { radius_m: 0.5 },
        Shape::square(1.0),
        Shape::Rectangle {
            width_m: 1.0,
            height_m: 0.2,
        },
    ];

    #[test]
    fn nothing_jumps_over_a_wall_and_everything_moves_along_it() {
        let wall = wall((0.0, 2.0), (10.0, 2.0));
        for shape in SHAPES {
            let (_, half_m) = shape.half_m();
            let below = Point::new(5.0, 2.0 - half_m);
            assert!(!shape.stands_on(below, &wall), "{shape:?}");
            assert!(!shape.meets(below, Point::new(9.0, below.y), &wall));
            assert!(!shape.meets(below, Point::new(5.0, -100.0), &wall));
            assert!(shape.meets(below, Point::new(5.0, 1e6), &wall));
            assert!(shape.meets(below, Point::new(5.0, below.y + 1e-6), &wall));
        }
    }

    #[test]
    fn corners_of_walls_are_met_exactly() {
        // A disc passes the end of a wall where a square of the same width does not.
        let end = wall((1.0, 0.0), (1.0, 5.0));
        let from = Point::new(0.0, -0.45);
        let to = Point::new(0.6, -0.45);
        let [disc, square, _] = SHAPES;
        assert!(!disc.meets(from, Point::new(0.75, -0.45), &end));
        assert!(square.meets(from, to, &end));

        // A diagonal wall is not met by a square beside it, only by its bounding box.
        let diagonal = wall((0.0, 0.0), (10.0, 10.0));
        assert!(!square.stands_on(Point::new(7.0, 5.9), &diagonal));
        assert!(square.stands_on(Point::new(7.0, 6.1), &diagonal));
        assert!(!disc.stands_on(Point::new(7.0, 6.2), &diagonal));
        assert!(disc.stands_on(Point::new(7.0, 6.4), &diagonal));
    }

    #[test]
    fn overlap_of_each_pair_of_shapes() {
        let [disc, square, slab] = SHAPES;
        let at = Point::new(0.0, 0.0);
        for (one, other, x, y, overlaps) in [
            (disc, disc, 0.8, 0.5, true),
            (disc, disc, 0.9, 0.5, false),
            (disc, square, 0.8, 0.8, true),
            (disc, square, 0.9, 0.9, false),
            (square, square, 0.9, 0.9, true),
            (square, slab, 0.9, 0.59, true),
            (square, slab, 0.9, 0.61, false),
            (slab, disc, 0.0, 0.0, true),
        ] {
            let other_at = Point::new(x, y);
            assert_eq!(one.overlaps(at, other, other_at), overlaps);
            assert_eq!(other.overlaps(other_at, one, at), overlaps);
            let far = Point::new(x * 50.0, y * 50.0);
            assert!(!overlaps || one.sweeps(far * -1.0, far, other, at));
        }
    }

    #[test]
    fn the_rightmost_point_of_a_wall_between_two_heights() {
        let slope = wall((4.0, 4.0), (0.0, 0.0));
        assert_eq!(slope.rightmost_x_m(1.0, 2.0), Some(2.0));
        assert_eq!(slope.rightmost_x_m(3.0, 9.0), Some(4.0));
        assert_eq!(slope.rightmost_x_m(5.0, 9.0), None);
        assert_eq!(
            wall((1.0, 1.0), (3.0, 1.0)).rightmost_x_m(0.0, 2.0),
            Some(3.0)
        );
    }
}

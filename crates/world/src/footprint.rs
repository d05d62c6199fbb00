//! Shapes as they lie on the floor, and the tests between them: does one overlap the other, here or on a straight path.
//!
//! The rectangle of a robot with wheels turns with it; all others keep their sides along the axes. All tests are exact up to rounding
//! and use nothing but `+ - * /`, comparisons and the square root. Like every test of this crate they allow an overlap of
//! [`TOLERANCE_M`].

use crate::limits::TOLERANCE_M;
use crate::point::Point;
use crate::shape::{Shape, Wall};
use crate::wheels::Wheels;

/// How far a body may overlap a wall on its way from one place to another.
///
/// Twice what it may at the places themselves: rounding must not hold a body at a place that it was allowed to take.
const PATH_TOLERANCE_M: f64 = 2.0 * TOLERANCE_M;

/// A shape, and where its width lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    shape: Shape,
    /// The direction of the width, of length 1.
    ahead: Point,
}

impl From<Shape> for Footprint {
    fn from(shape: Shape) -> Self {
        Self {
            shape,
            ahead: Point::new(1.0, 0.0),
        }
    }
}

impl Footprint {
    /// A shape whose width lies along this heading, rad, counter-clockwise from +x.
    #[must_use]
    pub fn turned(shape: Shape, heading_rad: f64) -> Self {
        let (sin, cos) = libm::sincos(heading_rad);
        Self {
            shape,
            ahead: Point::new(cos, sin),
        }
    }

    /// A robot as it lies at its start; `None` for one without a shape of its own and without wheels, which is a square of the
    /// field.
    #[must_use]
    pub fn of_robot(shape: Option<Shape>, wheels: Option<&Wheels>, body_m: f64) -> Option<Self> {
        let Some(wheels) = wheels else {
            return shape.map(Self::from);
        };
        let shape = shape.unwrap_or(Shape::square(body_m));
        Some(Self::turned(shape, wheels.heading_rad))
    }

    /// The shape.
    #[must_use]
    pub fn shape(self) -> Shape {
        self.shape
    }

    /// Whether its width does not lie along x.
    pub(crate) fn is_turned(self) -> bool {
        self.ahead != Point::new(1.0, 0.0)
    }

    /// Half of the extent along x and along y, m.
    #[must_use]
    pub fn half_m(self) -> (f64, f64) {
        match self.shape {
            Shape::Rectangle { .. } => (
                self.reach_m(Point::new(1.0, 0.0)),
                self.reach_m(Point::new(0.0, 1.0)),
            ),
            Shape::Disc { radius_m } => (radius_m, radius_m),
        }
    }

    /// The distance from the center to the farthest point, m.
    pub(crate) fn radius_m(self) -> f64 {
        match self.shape {
            Shape::Rectangle { .. } => {
                let (half_x_m, half_y_m) = self.shape.half_m();
                Point::new(half_x_m, half_y_m).length()
            }
            Shape::Disc { radius_m } => radius_m,
        }
    }

    /// The same, turned further by this, rad.
    pub(crate) fn rotated(self, by_rad: f64) -> Self {
        let (sin, cos) = libm::sincos(by_rad);
        Self {
            ahead: self.ahead * cos + self.left() * sin,
            ..self
        }
    }

    /// The same, larger by this on all sides, m.
    pub(crate) fn grown(self, by_m: f64) -> Self {
        let shape = match self.shape {
            Shape::Rectangle { width_m, height_m } => Shape::Rectangle {
                width_m: width_m + 2.0 * by_m,
                height_m: height_m + 2.0 * by_m,
            },
            Shape::Disc { radius_m } => Shape::Disc {
                radius_m: radius_m + by_m,
            },
        };
        Self { shape, ..self }
    }

    /// How far a rectangle extends from its center along a direction of length 1, m.
    fn reach_m(self, axis: Point) -> f64 {
        let (half_x_m, half_y_m) = self.shape.half_m();
        half_x_m * axis.dot(self.ahead).abs() + half_y_m * axis.dot(self.left()).abs()
    }

    /// The direction of the height.
    fn left(self) -> Point {
        Point::new(-self.ahead.y, self.ahead.x)
    }

    /// A displacement as seen along the width and the height.
    pub(crate) fn to_local(self, displacement: Point) -> Point {
        Point::new(displacement.dot(self.ahead), displacement.dot(self.left()))
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
        match self.shape {
            Shape::Rectangle { .. } => {
                rectangle_to_point_m(self.shape.half_m(), self.to_local(offset))
            }
            Shape::Disc { radius_m } => (offset.length() - radius_m).max(0.0),
        }
    }

    /// Whether this shape, moved by `path` from the origin, overlaps `other` at `offset` by more than `slack_m`.
    ///
    /// A shape that moves past another is a point that moves past the sum of both.
    fn is_closer(self, other: Self, offset: Point, path: Point, slack_m: f64) -> bool {
        let (rectangle, radius_m) = match (self.shape, other.shape) {
            (Shape::Disc { radius_m: one_m }, Shape::Disc { radius_m: other_m }) => {
                let reach_m = one_m + other_m - slack_m;
                return segment_to_point_m2(path, offset) < squared(reach_m);
            }
            (Shape::Rectangle { .. }, Shape::Rectangle { .. }) => {
                return self.meets_rectangle(other, offset, path, slack_m);
            }
            (Shape::Disc { radius_m }, Shape::Rectangle { .. }) => (other, radius_m),
            (Shape::Rectangle { .. }, Shape::Disc { radius_m }) => (self, radius_m),
        };

        let half_m = rectangle.shape.half_m();
        let offset = rectangle.to_local(offset);
        let path = rectangle.to_local(path);
        enters_rectangle(half_m, offset, path)
            || segment_to_rectangle_m(half_m, offset, path) < radius_m - slack_m
    }

    /// [`Self::is_closer`] of two rectangles. Convex shapes overlap if and only if their shadows do along every normal of their edges.
    fn meets_rectangle(self, other: Self, offset: Point, path: Point, slack_m: f64) -> bool {
        let axes = [
            Some(self.ahead),
            Some(self.left()),
            Some(other.ahead),
            Some(other.left()),
            normal(path),
        ];
        axes.into_iter().flatten().all(|axis| {
            let reach_m = self.reach_m(axis) + other.reach_m(axis);
            let center_m = offset.dot(axis);
            shadows_overlap(path.dot(axis), (center_m, center_m), reach_m, slack_m)
        })
    }

    fn is_crossed(self, from: Point, to: Point, wall: &Wall, slack_m: f64) -> bool {
        // Relative to the start, so that rounding does not grow with the distance from the corner of the field.
        let path = to - from;
        let one = wall.from - from;
        let other = wall.to - from;

        match self.shape {
            Shape::Disc { radius_m } => {
                let reach_m = radius_m - slack_m;
                segments_cross(path, one, other)
                    || segments_to_ends_m2(path, one, other) < squared(reach_m)
            }
            Shape::Rectangle { .. } => {
                let axes = [
                    Some(self.ahead),
                    Some(self.left()),
                    normal(other - one),
                    normal(path),
                ];
                axes.into_iter().flatten().all(|axis| {
                    let ends = (one.dot(axis), other.dot(axis));
                    shadows_overlap(path.dot(axis), ends, self.reach_m(axis), slack_m)
                })
            }
        }
    }
}

impl Wall {
    /// Whether the wall passes through a rectangle with this center, or comes closer to it than 1 µm.
    pub(crate) fn is_in(&self, center: Point, half_m: (f64, f64)) -> bool {
        let rectangle = Footprint::from(Shape::Rectangle {
            width_m: half_m.0 * 2.0,
            height_m: half_m.1 * 2.0,
        });
        rectangle.is_crossed(center, center, self, -1e-6)
    }
}

fn squared(length_m: f64) -> f64 {
    length_m.max(0.0) * length_m.max(0.0)
}

/// The direction at a right angle to a displacement, of length 1; `None` for a displacement of length 0.
fn normal(displacement: Point) -> Option<Point> {
    let length_m = displacement.length();
    (length_m > 0.0).then(|| Point::new(-displacement.y, displacement.x) * (1.0 / length_m))
}

/// Whether the shadow of a path from 0 overlaps that of a line between two ends, widened by `reach_m` on both sides, by more
/// than `slack_m`.
fn shadows_overlap(path_m: f64, ends_m: (f64, f64), reach_m: f64, slack_m: f64) -> bool {
    let low_m = ends_m.0.min(ends_m.1) - reach_m;
    let high_m = ends_m.0.max(ends_m.1) + reach_m;

    path_m.max(0.0) - low_m > slack_m && high_m - path_m.min(0.0) > slack_m
}

/// Whether a path from the origin enters a rectangle with sides along the axes at `offset`.
fn enters_rectangle(half_m: (f64, f64), offset: Point, path: Point) -> bool {
    let axes = [
        Some(Point::new(1.0, 0.0)),
        Some(Point::new(0.0, 1.0)),
        normal(path),
    ];
    axes.into_iter().flatten().all(|axis| {
        let reach_m = half_m.0 * axis.x.abs() + half_m.1 * axis.y.abs();
        let center_m = offset.dot(axis);
        shadows_overlap(path.dot(axis), (center_m, center_m), reach_m, 0.0)
    })
}

/// The distance from a rectangle around the origin to a point, m.
fn rectangle_to_point_m(half_m: (f64, f64), point: Point) -> f64 {
    let beside_m = (point.x.abs() - half_m.0).max(0.0);
    let above_m = (point.y.abs() - half_m.1).max(0.0);

    Point::new(beside_m, above_m).length()
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
    let length_m2 = path.length_squared();
    let share = if length_m2 > 0.0 {
        (point.dot(path) / length_m2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (point - path * share).length_squared()
}

/// Whether a path from the origin crosses the line between two ends.
fn segments_cross(path: Point, one: Point, other: Point) -> bool {
    let along = other - one;
    let ends_differ = path.cross(one) * path.cross(other) < 0.0;
    let places_differ = along.cross(one) * along.cross(one - path) < 0.0;
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
    use std::f64::consts::FRAC_PI_4;

    use super::{Footprint, Shape, Wall};
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
        for shape in SHAPES.map(Footprint::from) {
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
        let [disc, square, _] = SHAPES.map(Footprint::from);
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
        let [disc, square, slab] = SHAPES.map(Footprint::from);
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
    fn a_turned_rectangle_is_as_wide_as_its_diagonal() {
        let [disc, square, _] = SHAPES.map(Footprint::from);
        let diamond = Footprint::turned(Shape::square(1.0), FRAC_PI_4);
        let reach_m = 0.5_f64.sqrt();
        assert!((diamond.half_m().0 - reach_m).abs() < 1e-15);
        assert!(diamond.is_inside(Point::new(reach_m, 5.0), (10.0, 10.0)));
        assert!(!diamond.is_inside(Point::new(0.7, 5.0), (10.0, 10.0)));

        let at = Point::default();
        for (other, x, y, overlaps) in [
            (square, 1.20, 0.0, true),
            (square, 1.21, 0.0, false),
            // Corner beside corner: the bounding boxes overlap, the bodies do not.
            (square, 0.86, 0.86, false),
            (square, 0.85, 0.85, true),
            (diamond, 0.8, 0.8, false),
            (diamond, 0.7, 0.7, true),
            (diamond, 1.41, 0.0, true),
            (diamond, 1.42, 0.0, false),
            (disc, 1.2, 0.0, true),
            (disc, 1.21, 0.0, false),
            (disc, 0.71, 0.71, false),
            (disc, 0.70, 0.70, true),
        ] {
            let other_at = Point::new(x, y);
            assert_eq!(
                diamond.overlaps(at, other, other_at),
                overlaps,
                "{other:?} {x}"
            );
            assert_eq!(
                other.overlaps(other_at, diamond, at),
                overlaps,
                "{other:?} {x}"
            );
            let far = Point::new(x * 50.0, y * 50.0);
            assert!(!overlaps || diamond.sweeps(far * -1.0, far, other, at));
        }

        let wall = wall((0.0, 2.0), (10.0, 2.0));
        assert!(diamond.stands_on(Point::new(5.0, 1.3), &wall));
        assert!(!diamond.stands_on(Point::new(5.0, 1.29), &wall));
        assert!(diamond.meets(Point::new(5.0, 1.0), Point::new(5.0, 9.0), &wall));
        assert!((diamond.distance_m(at, Point::new(2.0, 0.0)) - (2.0 - reach_m)).abs() < 1e-15);
        assert_eq!(diamond.distance_m(at, Point::new(0.7, 0.0)), 0.0);
    }
}

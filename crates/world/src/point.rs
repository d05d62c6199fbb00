//! Positions and displacements in the plane.

use std::fmt;
use std::ops::{Add, Mul, Sub};

/// A position on the field, or the displacement between two positions.
///
/// Coordinates are in meters, with x to the right and y up (REP 103).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Distance from the left edge, m.
    pub x: f64,
    /// Distance from the lower edge, m.
    pub y: f64,
}

impl Point {
    /// The point (x, y), in meters.
    #[must_use]
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// Whether neither coordinate is NaN or infinite.
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite()
    }

    /// The squared distance to the origin, m². Comparing squared distances avoids the square root.
    #[must_use]
    pub fn length_squared_m2(self) -> f64 {
        self.x * self.x + self.y * self.y
    }

    /// The distance to `other`, m.
    #[must_use]
    pub fn distance_m(self, other: Self) -> f64 {
        (other - self).length_squared_m2().sqrt()
    }
}

/// The product of two lengths and the cosine of the angle between them, m².
pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a.x * b.x + a.y * b.y
}

/// The area between two displacements, m²; more than 0 where the second is to the left of the first.
pub(crate) fn cross(a: Point, b: Point) -> f64 {
    a.x * b.y - a.y * b.x
}

impl Add for Point {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y)
    }
}

impl Sub for Point {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y)
    }
}

impl Mul<f64> for Point {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self::new(self.x * factor, self.y * factor)
    }
}

/// Formats the point as `(1.5, 2)`, in meters, for error messages.
impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}, {})", self.x, self.y)
    }
}

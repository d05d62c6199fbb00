//! Places and displacements in the plane.

use std::fmt;
use std::ops::{Add, Mul, Sub};

/// A place on the field, or a displacement between two; metres, x to the right and y up (REP 103).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Metres from the left edge.
    pub x: f64,
    /// Metres from the lower edge.
    pub y: f64,
}

impl Point {
    /// The point (x, y), in metres.
    #[must_use]
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// Whether both coordinates are numbers, neither NaN nor infinite.
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite()
    }

    /// The square of the distance to the origin, in m². Enough to compare distances, without a root.
    #[must_use]
    pub fn length_squared_m2(self) -> f64 {
        self.x * self.x + self.y * self.y
    }

    /// The distance to `other`, in metres.
    #[must_use]
    pub fn distance_m(self, other: Self) -> f64 {
        (other - self).length_squared_m2().sqrt()
    }
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

/// `(1.5, 2)`, in metres, as error texts name a place.
impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}, {})", self.x, self.y)
    }
}

//! Shapes of bodies, and walls.

use crate::point::Point;

/// The shape of a body around its center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A rectangle with sides along the axes. That of a robot with wheels turns with it, see [`Footprint`](crate::Footprint).
    Rectangle {
        /// Along x, m; along the heading of a robot with wheels.
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

    /// Radius of the largest disc within it, m.
    #[must_use]
    pub fn inradius_m(self) -> f64 {
        let (half_x_m, half_y_m) = self.half_m();
        half_x_m.min(half_y_m)
    }
}

impl Wall {
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

#[cfg(test)]
mod tests {
    use super::Wall;
    use crate::point::Point;

    fn wall(from: (f64, f64), to: (f64, f64)) -> Wall {
        Wall {
            from: Point::new(from.0, from.1),
            to: Point::new(to.0, to.1),
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

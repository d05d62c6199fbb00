//! The description from which a world is built.

use crate::error::HallError;
use crate::limits::{
    BODIES_MAX, BODY_MIN_M, SIDE_MAX_M, SPEED_MAX_MPS, TICK_MAX_S, TICK_MIN_S, TOLERANCE_M,
};
use crate::point::Point;
use crate::shapes::Shapes;
use crate::triangular::Triangular;

/// The plane `[0, width] x [0, height]`, on which a body is an axis-aligned square given by its center, unless
/// [`Hall::shapes`] gives it another shape.
///
/// In the paper all objects occupy 2 ft by 2 ft ("Obstacles"). Making that size configurable is a choice of this
/// crate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Width and height, m; at most [`SIDE_MAX_M`].
    pub size_m: (f64, f64),
    /// Side of every body without a shape of its own, m; at least [`BODY_MIN_M`].
    pub body_m: f64,
}

impl Field {
    /// Whether a body with this center is entirely inside the field, within [`TOLERANCE_M`].
    ///
    /// Returns `false` if a coordinate is NaN or infinite.
    #[must_use]
    pub fn contains(&self, center: Point) -> bool {
        let margin_m = self.body_m * 0.5 - TOLERANCE_M;
        let (width_m, height_m) = self.size_m;

        margin_m <= center.x
            && center.x <= width_m - margin_m
            && margin_m <= center.y
            && center.y <= height_m - margin_m
    }

    /// Whether two bodies with these centers overlap by more than [`TOLERANCE_M`].
    #[must_use]
    pub fn overlap(&self, a: Point, b: Point) -> bool {
        let apart_m = self.body_m - TOLERANCE_M;

        (a.x - b.x).abs() < apart_m && (a.y - b.y).abs() < apart_m
    }

    /// How many bodies fit side by side along x and along y.
    pub(crate) fn columns_and_rows(&self) -> (u64, u64) {
        let (width_m, height_m) = self.size_m;

        (self.bodies_along(width_m), self.bodies_along(height_m))
    }

    fn bodies_along(&self, side_m: f64) -> u64 {
        ((side_m + TOLERANCE_M) / self.body_m) as u64
    }

    fn check(&self) -> Result<(), HallError> {
        in_range("field width_m", self.size_m.0, BODY_MIN_M, SIDE_MAX_M)?;
        in_range("field height_m", self.size_m.1, BODY_MIN_M, SIDE_MAX_M)?;
        in_range("body_m", self.body_m, BODY_MIN_M, SIDE_MAX_M)?;

        let (columns, rows) = self.columns_and_rows();
        if columns == 0 || rows == 0 {
            return Err(HallError::FieldTooSmall {
                size_m: self.size_m,
                body_m: self.body_m,
            });
        }

        Ok(())
    }
}

/// The moving obstacles: their number and how they move (paper, "Obstacles").
///
/// Guests are placed uniformly at random without overlap, by rejection sampling. Once that fails, which happens
/// when 40 to 60 % of the floor is covered, all guests are placed again, each in a random free position of a
/// layout in rows \[chosen here\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guests {
    /// Number of guests.
    pub count: usize,
    /// Distribution of a course's speed, m/s.
    pub speed_mps: Triangular,
    /// Distribution of a course's duration, s.
    pub duration_s: Triangular,
}

/// Everything that defines a [`World`](crate::World), apart from its random stream.
#[derive(Clone, Debug, PartialEq)]
pub struct Hall {
    /// The field and the size of bodies.
    pub field: Field,
    /// Centers of the fixed obstacles, m. Obstacles may touch and overlap one another to form larger shapes
    /// (paper, "Obstacles").
    pub obstacles: Vec<Point>,
    /// The moving obstacles.
    pub guests: Guests,
    /// Initial centers of the robots, m. Robots move in the order of this list.
    pub robots: Vec<Point>,
    /// Walls, and the bodies that are not squares of [`Field::body_m`].
    pub shapes: Shapes,
    /// Length of a tick, simulated seconds; from 1e-6 to 1e6.
    pub tick_s: f64,
    /// Speed limit of robots, m/s, from 0 (robots cannot move) to 1e6. It does not apply to guests.
    pub max_speed_mps: f64,
}

impl Hall {
    /// Number of obstacles, robots and guests; `usize::MAX` if it overflows.
    fn body_count(&self) -> usize {
        let fixed = self.obstacles.len();
        let robots = self.robots.len();

        fixed
            .saturating_add(robots)
            .saturating_add(self.guests.count)
    }

    /// Checks every number and count that can be validated without placing a body.
    pub(crate) fn check(&self) -> Result<(), HallError> {
        self.field.check()?;
        in_range("tick_s", self.tick_s, TICK_MIN_S, TICK_MAX_S)?;
        in_range("max_speed_mps", self.max_speed_mps, 0.0, SPEED_MAX_MPS)?;

        self.shapes.check(self.field.size_m)?;

        let count = self.body_count();
        if count > BODIES_MAX {
            return Err(HallError::TooManyBodies {
                count,
                max: BODIES_MAX,
            });
        }

        Ok(())
    }
}

fn in_range(name: &'static str, value: f64, min: f64, max: f64) -> Result<(), HallError> {
    if min <= value && value <= max {
        Ok(())
    } else {
        Err(HallError::OutOfRange {
            name,
            value,
            min,
            max,
        })
    }
}

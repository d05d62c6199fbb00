//! The hall as it is described before it becomes a world, and the limits within which its arithmetic holds.

use crate::error::HallError;
use crate::point::Point;
use crate::triangular::Triangular;

/// How deep two bodies may overlap, or a body stick out of the field, and still count as touching: 1 nm \[chosen
/// here\].
///
/// Places arrive from feet, from JSON and from sums of steps; squares that are meant to touch miss by a few
/// units in the last place, which stay below this for every field up to [`SIDE_MAX_M`]. It does not add up:
/// each test is against where the bodies are.
pub const TOLERANCE_M: f64 = 1e-9;

/// The longest side of a field, 1,000 km: beyond it the spacing of `f64` nears [`TOLERANCE_M`] \[chosen here\].
pub const SIDE_MAX_M: f64 = 1e6;

/// The smallest body, 1 mm: a million times [`TOLERANCE_M`] \[chosen here\].
pub const BODY_MIN_M: f64 = 1e-3;

/// The most bodies a world may hold, obstacles, robots and guests together \[chosen here\]: at most 2.5 GB.
pub const BODIES_MAX: usize = 1 << 24;

/// The shortest tick, 1 µs \[chosen here\].
const TICK_MIN_S: f64 = 1e-6;

/// The longest tick, 11 days \[chosen here\].
const TICK_MAX_S: f64 = 1e6;

/// The highest speed limit for robots: across the largest field in a second \[chosen here\].
const SPEED_MAX_MPS: f64 = 1e6;

/// The plane `[0, width] x [0, height]`, on which every body is an axis-aligned square given by its center.
///
/// One size for all bodies is the seed's ("Obstacles": all objects occupy 2 ft by 2 ft); that the size can be
/// set is chosen here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Width and height, m; at most [`SIDE_MAX_M`].
    pub size_m: (f64, f64),
    /// Side of every body, m; at least [`BODY_MIN_M`].
    pub body_m: f64,
}

impl Field {
    /// Whether a body with this center lies wholly inside the field, within [`TOLERANCE_M`]. Not so for a
    /// center that is not finite.
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
        let fit = |side_m: f64| ((side_m + TOLERANCE_M) / self.body_m) as u64;
        (fit(self.size_m.0), fit(self.size_m.1))
    }

    fn check(&self) -> Result<(), HallError> {
        in_range("field width_m", self.size_m.0, BODY_MIN_M, SIDE_MAX_M)?;
        in_range("field height_m", self.size_m.1, BODY_MIN_M, SIDE_MAX_M)?;
        in_range("body_m", self.body_m, BODY_MIN_M, SIDE_MAX_M)?;
        if self.columns_and_rows().0 == 0 || self.columns_and_rows().1 == 0 {
            return Err(HallError::FieldTooSmall {
                size_m: self.size_m,
                body_m: self.body_m,
            });
        }
        Ok(())
    }
}

/// The moving obstacles: how many and how they move (seed, "Obstacles").
///
/// They are placed uniformly at random without overlap, each by trying places until one is free. Where that
/// jams (it does somewhere between two fifths and three fifths of the floor covered) all are placed anew, on a
/// random choice among the free places of rows of bodies \[chosen here\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guests {
    /// How many.
    pub count: usize,
    /// Speed of a course, m/s.
    pub speed_mps: Triangular,
    /// Duration of a course, s.
    pub duration_s: Triangular,
}

/// Everything a [`World`](crate::World) is made from, but for the random stream.
#[derive(Clone, Debug, PartialEq)]
pub struct Hall {
    /// The field and the size of bodies.
    pub field: Field,
    /// Centers of the fixed obstacles, m; they may touch and overlap one another, so that larger shapes can be
    /// built (seed, "Obstacles").
    pub obstacles: Vec<Point>,
    /// The moving obstacles.
    pub guests: Guests,
    /// Centers of the robots at the start, m, in the caller's order; that order is the order of motion.
    pub robots: Vec<Point>,
    /// Length of a tick, simulated seconds; from 1e-6 to 1e6.
    pub tick_s: f64,
    /// The speed limit of robots, m/s; from 0, which means that none may move, to 1e6. It does not bind guests.
    pub max_speed_mps: f64,
}

impl Hall {
    /// Checks every number and count that can be judged without placing a body.
    pub(crate) fn check(&self) -> Result<(), HallError> {
        self.field.check()?;
        in_range("tick_s", self.tick_s, TICK_MIN_S, TICK_MAX_S)?;
        in_range("max_speed_mps", self.max_speed_mps, 0.0, SPEED_MAX_MPS)?;
        let count = self
            .obstacles
            .len()
            .saturating_add(self.robots.len())
            .saturating_add(self.guests.count);
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

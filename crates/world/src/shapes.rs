//! What a hall has beside squares of one size: walls, and bodies of a shape of their own.

use std::collections::BTreeMap;

use crate::error::HallError;
use crate::footprint::Footprint;
use crate::limits::{BODY_MIN_M, SIDE_MAX_M, TOLERANCE_M, WALLS_MAX};
use crate::shape::{Shape, Wall};
use crate::wheels::Wheels;

/// Walls, and the bodies of a [`Hall`](crate::Hall) that are not squares of [`Field::body_m`](crate::Field::body_m).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shapes {
    /// Walls; at most [`WALLS_MAX`].
    pub walls: Vec<Wall>,
    /// Obstacles of a shape of their own, by index; at most [`WALLS_MAX`].
    pub obstacles: BTreeMap<usize, Shape>,
    /// Robots of a shape of their own, by index.
    pub robots: BTreeMap<usize, Shape>,
    /// Robots that drive like wheels, by index. Their bodies turn with them.
    pub wheels: BTreeMap<usize, Wheels>,
}

impl Shapes {
    pub(crate) fn is_empty(&self) -> bool {
        self.walls.is_empty()
            && self.obstacles.is_empty()
            && self.robots.is_empty()
            && self.wheels.is_empty()
    }

    /// The footprint of a robot at its start; `None` for a square of the field along the axes.
    pub(crate) fn robot(&self, index: usize, body_m: f64) -> Option<Footprint> {
        let shape = self.robots.get(&index).copied();
        Footprint::of_robot(shape, self.wheels.get(&index), body_m)
    }

    /// Checks everything that needs no place.
    pub(crate) fn check(&self, size_m: (f64, f64)) -> Result<(), HallError> {
        for (name, count) in [
            ("walls", self.walls.len()),
            ("obstacles with a size of their own", self.obstacles.len()),
        ] {
            if count > WALLS_MAX {
                return Err(HallError::TooMany {
                    name,
                    count,
                    max: WALLS_MAX,
                });
            }
        }

        for (index, wall) in self.walls.iter().enumerate() {
            check_wall(index, wall, size_m)?;
        }
        for (&index, &shape) in &self.obstacles {
            check_size(shape).map_err(|value_m| HallError::ObstacleSize { index, value_m })?;
        }
        for (&index, &shape) in &self.robots {
            check_size(shape).map_err(|value_m| HallError::RobotSize { index, value_m })?;
        }
        for (&index, wheels) in &self.wheels {
            if !wheels.is_valid() {
                return Err(HallError::RobotWheels { index });
            }
        }
        Ok(())
    }
}

fn check_wall(index: usize, wall: &Wall, size_m: (f64, f64)) -> Result<(), HallError> {
    let (width_m, height_m) = size_m;
    for end in [wall.from, wall.to] {
        let is_on_field = (-TOLERANCE_M..=width_m + TOLERANCE_M).contains(&end.x)
            && (-TOLERANCE_M..=height_m + TOLERANCE_M).contains(&end.y);
        if !is_on_field {
            return Err(HallError::WallOffField { index, at: end });
        }
    }

    if wall.from.distance_m(wall.to) < BODY_MIN_M {
        return Err(HallError::WallTooShort {
            index,
            at: wall.from,
        });
    }
    Ok(())
}

/// Returns the extent of a shape that is too small or too large, m.
fn check_size(shape: Shape) -> Result<(), f64> {
    let (half_x_m, half_y_m) = shape.half_m();
    for half_m in [half_x_m, half_y_m] {
        let side_m = half_m * 2.0;
        if !(BODY_MIN_M..=SIDE_MAX_M).contains(&side_m) {
            return Err(side_m);
        }
    }
    Ok(())
}

//! Places on the field.

use serde::de::{Error, IgnoredAny, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use super::limits::finite;
use crate::codec::FieldError;

/// A place on the field: meters from its lower left corner.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Point {
    /// Meters to the right.
    pub x: f64,
    /// Meters up.
    pub y: f64,
}

impl Point {
    /// The place at `x`, `y` meters.
    #[must_use]
    pub fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// Straight distance, meters.
    #[must_use]
    pub fn distance_m(self, other: Self) -> f64 {
        let dx = other.x - self.x;
        let dy = other.y - self.y;

        (dx * dx + dy * dy).sqrt()
    }

    /// Refuses coordinates that are not finite; `field` is the point's path in the message.
    pub(super) fn check(self, field: &str) -> Result<(), FieldError> {
        // The path is written only for a point that is wrong: this runs for every report.
        if self.x.is_finite() && self.y.is_finite() {
            return Ok(());
        }

        finite(self.x, &format!("{field}.x"))?;
        finite(self.y, &format!("{field}.y"))
    }
}

/// A point is an object in every message. A derived implementation would also read a list, `[x, y]`, which no schema allows.
impl<'de> Deserialize<'de> for Point {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_struct("Point", &["x", "y"], PointVisitor)
    }
}

struct PointVisitor;

/// A field of a point.
#[derive(Deserialize)]
#[serde(field_identifier, rename_all = "snake_case")]
enum PointField {
    X,
    Y,
    #[serde(other)]
    Unknown,
}

impl<'de> Visitor<'de> for PointVisitor {
    type Value = Point;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("an object with the fields x and y")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Point, A::Error> {
        let mut x = None;
        let mut y = None;
        while let Some(field) = map.next_key()? {
            match field {
                PointField::X if x.is_some() => return Err(A::Error::duplicate_field("x")),
                PointField::Y if y.is_some() => return Err(A::Error::duplicate_field("y")),
                PointField::X => x = Some(map.next_value()?),
                PointField::Y => y = Some(map.next_value()?),
                PointField::Unknown => drop(map.next_value::<IgnoredAny>()?),
            }
        }

        Ok(Point {
            x: x.ok_or_else(|| A::Error::missing_field("x"))?,
            y: y.ok_or_else(|| A::Error::missing_field("y"))?,
        })
    }
}

//! `drive` of a robot: that it drives like wheels, with its limits and its first heading.

use config::units::{Acceleration, Angle, Speed, TurnAcceleration, TurnRate};
use config::{FileError, Source};
use serde::{Deserialize, Serialize};
use toml::Spanned;
use world::Wheels;

use super::numbers::positive;
use super::unplaced::unplaced;

/// The table. A limit that is left out is infinite, and the heading that of +x.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DriveTable {
    max_speed: Option<Spanned<Speed>>,
    max_turn: Option<Spanned<TurnRate>>,
    max_acceleration: Option<Spanned<Acceleration>>,
    max_turn_acceleration: Option<Spanned<TurnAcceleration>>,
    heading: Option<Angle>,
}

/// The limits of a robot; `None` if it does not drive.
pub(super) fn check(
    raw: Option<&DriveTable>,
    source: &Source,
) -> Result<Option<Wheels>, FileError> {
    let Some(raw) = raw else {
        return Ok(None);
    };

    Ok(Some(Wheels {
        max_speed_mps: limit(raw.max_speed.as_ref(), source, "max_speed")?,
        max_turn_radps: limit(raw.max_turn.as_ref(), source, "max_turn")?,
        max_acceleration_mps2: limit(raw.max_acceleration.as_ref(), source, "max_acceleration")?,
        max_turn_acceleration_radps2: limit(
            raw.max_turn_acceleration.as_ref(),
            source,
            "max_turn_acceleration",
        )?,
        heading_rad: raw.heading.map_or(0.0, |heading| heading.0),
    }))
}

/// A limit in SI units, infinite if there is none.
fn limit<T: Copy + Into<f64>>(
    raw: Option<&Spanned<T>>,
    source: &Source,
    key: &str,
) -> Result<f64, FileError> {
    let Some(written) = raw else {
        return Ok(f64::INFINITY);
    };
    Ok(positive(source, raw, *written.get_ref(), key)?.into())
}

impl DriveTable {
    pub(super) fn of(wheels: &Wheels) -> Self {
        let written = |limit: f64| limit.is_finite().then_some(limit);
        Self {
            max_speed: written(wheels.max_speed_mps).map(|limit| unplaced(Speed(limit))),
            max_turn: written(wheels.max_turn_radps).map(|limit| unplaced(TurnRate(limit))),
            max_acceleration: written(wheels.max_acceleration_mps2)
                .map(|limit| unplaced(Acceleration(limit))),
            max_turn_acceleration: written(wheels.max_turn_acceleration_radps2)
                .map(|limit| unplaced(TurnAcceleration(limit))),
            heading: Some(Angle(wheels.heading_rad)),
        }
    }
}

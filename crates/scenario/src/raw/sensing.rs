//! `[sensing]` as written in the file.

use config::units::{Angle, Length};
use config::{FileError, Source};
use protocol::messages::{MAX_RAYS, Rays};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::super::sensing::Sensing;
use super::numbers::positive;
use super::unplaced::unplaced;

/// Sensing range, 6 ft [I].
const RANGE: Length = Length(1.8288);
/// Number of rays [I].
const RAYS: u32 = 36;

#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SensingTable {
    range: Option<Spanned<Length>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    field_of_view: Option<Spanned<Angle>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    walls_hide: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    misses: Option<Spanned<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    noise: Option<Spanned<Length>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rays: Option<RaysTable>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct RaysTable {
    count: Option<Spanned<u32>>,
    range: Option<Spanned<Length>>,
}

/// The rules of sensing, or their defaults.
pub(super) fn check(raw: Option<&SensingTable>, source: &Source) -> Result<Sensing, FileError> {
    let default = SensingTable::default();
    let raw = raw.unwrap_or(&default);
    let refuse = |span, reason: &str| Err(FileError::at(source, Some(span), reason));

    let range = positive(source, raw.range.as_ref(), RANGE, "the range")?;
    let mut sensing = Sensing::within(range.0);
    sensing.walls_hide = raw.walls_hide.unwrap_or_default();
    if let Some(angle) = &raw.field_of_view {
        let angle_rad = angle.get_ref().0;
        let is_angle = angle_rad > 0.0 && angle_rad <= std::f64::consts::TAU;
        if !is_angle {
            return refuse(
                angle.span(),
                "the field of view is more than 0 and at most 360 deg",
            );
        }
        sensing.field_of_view_rad = Some(angle_rad);
    }
    if let Some(misses) = &raw.misses {
        let is_probability = (0.0..=1.0).contains(misses.get_ref());
        if !is_probability {
            return refuse(misses.span(), "a probability is between 0 and 1");
        }
        sensing.misses = *misses.get_ref();
    }
    if let Some(noise) = &raw.noise {
        let noise_m = noise.get_ref().0;
        if noise_m < 0.0 {
            return refuse(noise.span(), "noise cannot be less than 0 m");
        }
        sensing.noise_m = noise_m;
    }
    if let Some(rays) = &raw.rays {
        let count = positive(source, rays.count.as_ref(), RAYS, "the number of rays")?;
        let range = positive(source, rays.range.as_ref(), range, "the range of rays")?;
        if let Some(written) = rays.count.as_ref().filter(|_| count > MAX_RAYS) {
            let reason = format!("more than {MAX_RAYS} rays");
            return refuse(written.span(), &reason);
        }
        sensing.rays = Some(Rays {
            count,
            range_m: range.0,
        });
    }
    Ok(sensing)
}

impl From<&Sensing> for SensingTable {
    fn from(sensing: &Sensing) -> Self {
        let rays = sensing.rays.map(|rays| RaysTable {
            count: Some(unplaced(rays.count)),
            range: Some(unplaced(Length(rays.range_m))),
        });
        Self {
            range: Some(unplaced(Length(sensing.range_m))),
            field_of_view: sensing
                .field_of_view_rad
                .map(|angle| unplaced(Angle(angle))),
            walls_hide: sensing.walls_hide.then_some(true),
            misses: (sensing.misses > 0.0).then(|| unplaced(sensing.misses)),
            noise: (sensing.noise_m > 0.0).then(|| unplaced(Length(sensing.noise_m))),
            rays,
        }
    }
}

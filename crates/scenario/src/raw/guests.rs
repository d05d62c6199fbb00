//! The table `[guests]`.

use std::collections::BTreeSet;

use config::units::{Length, Speed, Time};
use config::{FileError, Source};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::numbers::{Range, positive, triangular};
use super::unplaced::unplaced;
use crate::checked::check_guests;
use crate::guests::{Faces, GuestRules, Requests};
use crate::network::ticks;

/// Speed of strolling guests [I]. The paper names the distributions but no numbers.
const SPEED: Range<Speed> = Range {
    min: Speed(0.06096),
    mode: Speed(0.3048),
    max: Speed(0.6096),
};
/// Duration of a guest's straight walk [I].
const DURATION: Range<Time> = Range {
    min: Time(2.0),
    mode: Time(5.0),
    max: Time(10.0),
};
/// How near guests react to a face, and ask: 6 ft, as far as robots sense [I].
const RANGE: Length = Length(1.8288);
/// How long a guest waits until it is annoyed [I].
const PATIENCE: Time = Time(30.0);
/// Most faces in a list.
const MAX_FACES: usize = 64;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GuestsTable {
    pub(super) count: Spanned<usize>,
    speed: Option<Spanned<Range<Speed>>>,
    duration: Option<Spanned<Range<Time>>>,
    faces: Option<Spanned<FacesTable>>,
    requests: Option<RequestsTable>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct FacesTable {
    range: Option<Spanned<Length>>,
    #[serde(default)]
    make_way: BTreeSet<String>,
    #[serde(default)]
    approach: BTreeSet<String>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct RequestsTable {
    range: Option<Spanned<Length>>,
    patience: Option<Spanned<Time>>,
}

/// How guests walk.
pub(super) fn walks(
    table: Option<&GuestsTable>,
    source: &Source,
) -> Result<world::Guests, FileError> {
    let mut count = 0;
    if let Some(table) = table {
        count = *table.count.get_ref();
        check_guests(count)
            .map_err(|reason| FileError::at(source, Some(table.count.span()), &reason))?;
    }

    let speed = table.and_then(|table| table.speed.as_ref());
    let duration = table.and_then(|table| table.duration.as_ref());
    Ok(world::Guests {
        count,
        speed_mps: triangular(source, speed, SPEED)?,
        duration_s: triangular(source, duration, DURATION)?,
    })
}

/// What guests do beside walking.
pub(super) fn rules(
    table: Option<&GuestsTable>,
    tick_s: f64,
    source: &Source,
) -> Result<GuestRules, FileError> {
    let Some(table) = table else {
        return Ok(GuestRules::default());
    };

    let mut rules = GuestRules::default();
    if let Some(spanned) = &table.faces {
        let faces = spanned.get_ref();
        let refused = |reason: &str| FileError::at(source, Some(spanned.span()), reason);
        if faces.make_way.len() + faces.approach.len() > MAX_FACES {
            return Err(refused(&format!("these are more than {MAX_FACES} faces")));
        }
        if let Some(both) = faces.make_way.intersection(&faces.approach).next() {
            return Err(refused(&format!(
                "guests cannot make way for a face \"{both}\" and approach it: name it once"
            )));
        }
        rules.faces = Some(Faces {
            range_m: range_m(source, faces.range.as_ref())?,
            make_way: faces.make_way.clone(),
            approach: faces.approach.clone(),
        });
    }
    if let Some(requests) = &table.requests {
        let patience = requests.patience.as_ref();
        let patience_s = positive(source, patience, PATIENCE, "the patience of a guest")?.0;
        rules.requests = Some(Requests {
            range_m: range_m(source, requests.range.as_ref())?,
            patience: ticks(patience_s, tick_s).max(1),
        });
    }
    Ok(rules)
}

fn range_m(source: &Source, range: Option<&Spanned<Length>>) -> Result<f64, FileError> {
    Ok(positive(source, range, RANGE, "a range")?.0)
}

impl GuestsTable {
    /// The table as it is written from a scenario.
    pub(super) fn of(guests: &world::Guests, rules: &GuestRules, tick_s: f64) -> Self {
        let speed = &guests.speed_mps;
        let duration = &guests.duration_s;
        let faces = rules.faces.as_ref().map(|faces| FacesTable {
            range: Some(unplaced(Length(faces.range_m))),
            make_way: faces.make_way.clone(),
            approach: faces.approach.clone(),
        });
        let requests = rules.requests.as_ref().map(|requests| RequestsTable {
            range: Some(unplaced(Length(requests.range_m))),
            patience: Some(unplaced(Time(requests.patience as f64 * tick_s))),
        });

        Self {
            count: unplaced(guests.count),
            speed: Some(unplaced(Range {
                min: Speed(speed.min()),
                mode: Speed(speed.mode()),
                max: Speed(speed.max()),
            })),
            duration: Some(unplaced(Range {
                min: Time(duration.min()),
                mode: Time(duration.mode()),
                max: Time(duration.max()),
            })),
            faces: faces.map(unplaced),
            requests,
        }
    }
}

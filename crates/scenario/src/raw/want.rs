//! `[[guests.wants]]` as written in the file.

use std::collections::BTreeMap;

use config::units::{Length, Time};
use config::{FileError, Source};
use protocol::RobotName;
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::numbers::{Range, positive, triangular};
use super::place::{Lengths, lengths, point};
use super::unplaced::unplaced;
use crate::checked::RobotSpec;
use crate::guests::{GuestWant, WantGoal};
use crate::network::ticks;
use crate::sites::SiteSpec;

/// Most things that guests want.
const MAX_WANTS: usize = 64;
/// Largest weight, beyond which the others are never drawn.
const MAX_WEIGHT: f64 = 1e6;
/// How near guests go to what they want [I]: about ten of the paper's bodies have room there.
const WITHIN: Length = Length(1.5);
/// How long a guest stays at a place [I].
const STAY: Range<Time> = Range {
    min: Time(20.0),
    mode: Time(60.0),
    max: Time(180.0),
};
/// How long a guest tries: at the usual speed it crosses the hall of the paper in 50 s [I].
const GIVE_UP: Time = Time(120.0);

/// One of the things that guests want; exactly one of the first four keys is given.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WantTable {
    site: Option<Spanned<String>>,
    at: Option<Spanned<Lengths>>,
    exit: Option<Spanned<Lengths>>,
    treat: Option<Spanned<RobotName>>,
    weight: Option<Spanned<f64>>,
    within: Option<Spanned<Length>>,
    stay: Option<Spanned<Range<Time>>>,
    give_up: Option<Spanned<Time>>,
}

/// What there is that guests can want.
pub(super) struct WantSetting<'a> {
    pub(super) sites: &'a BTreeMap<String, SiteSpec>,
    pub(super) robots: &'a BTreeMap<RobotName, RobotSpec>,
    pub(super) field_m: [f64; 2],
    /// Whether the scenario says when a guest is served.
    pub(super) has_requests: bool,
    pub(super) tick_s: f64,
    pub(super) source: &'a Source,
}

/// What guests want.
pub(super) fn check(
    wants: &[Spanned<WantTable>],
    setting: &WantSetting<'_>,
) -> Result<Vec<GuestWant>, FileError> {
    if let Some(last) = wants.get(MAX_WANTS) {
        let reason = format!("more than {MAX_WANTS} things to want");
        return Err(FileError::at(setting.source, Some(last.span()), &reason));
    }
    wants.iter().map(|want| setting.want(want)).collect()
}

impl WantSetting<'_> {
    fn want(&self, spanned: &Spanned<WantTable>) -> Result<GuestWant, FileError> {
        let source = self.source;
        let table = spanned.get_ref();
        let goal = self.goal(spanned)?;

        let weight = positive(source, table.weight.as_ref(), 1.0, "a weight")?;
        if weight > MAX_WEIGHT {
            let span = table.weight.as_ref().map(Spanned::span);
            let reason = format!("a weight is at most {MAX_WEIGHT}");
            return Err(FileError::at(source, span, &reason));
        }

        let stay_s = match (&goal, &table.stay) {
            (WantGoal::Treat(_), Some(stay)) => {
                let reason = "a guest who wants a treat waits at the robot until it is served: `give_up` says how long at most";
                return Err(FileError::at(source, Some(stay.span()), reason));
            }
            (WantGoal::Treat(_) | WantGoal::Exit(_), None) => None,
            (_, stay) => Some(triangular(source, stay.as_ref(), STAY)?),
        };
        let within = positive(source, table.within.as_ref(), WITHIN, "how near guests go")?;
        let give_up = table.give_up.as_ref();
        let give_up_s = positive(source, give_up, GIVE_UP, "how long a guest tries")?.0;
        Ok(GuestWant {
            goal,
            weight,
            within_m: within.0,
            stay_s,
            give_up: ticks(give_up_s, self.tick_s).max(1),
        })
    }

    fn goal(&self, spanned: &Spanned<WantTable>) -> Result<WantGoal, FileError> {
        let table = spanned.get_ref();
        match (&table.site, &table.at, &table.exit, &table.treat) {
            (Some(site), None, None, None) => {
                if !self.sites.contains_key(site.get_ref()) {
                    let reason = format!("there is no [[site]] called {:?}", site.get_ref());
                    return Err(FileError::at(self.source, Some(site.span()), &reason));
                }
                Ok(WantGoal::Site(site.get_ref().clone()))
            }
            (None, Some(at), None, None) => Ok(WantGoal::Place(self.place(at)?)),
            (None, None, Some(exit), None) => Ok(WantGoal::Exit(self.place(exit)?)),
            (None, None, None, Some(treat)) => {
                if !self.robots.contains_key(treat.get_ref()) {
                    let reason = format!("there is no robot called {}", treat.get_ref());
                    return Err(FileError::at(self.source, Some(treat.span()), &reason));
                }
                if !self.has_requests {
                    let reason = "guests take what a robot serves by the rules of [guests.requests]: add that table";
                    return Err(FileError::at(self.source, Some(treat.span()), reason));
                }
                Ok(WantGoal::Treat(treat.get_ref().clone()))
            }
            _ => {
                let reason = "each [[guests.wants]] has exactly one of these: `site`, a name; `at`, a place; `exit`, a place; `treat`, \
                              a robot's name";
                Err(FileError::at(self.source, Some(spanned.span()), reason))
            }
        }
    }

    fn place(&self, at: &Spanned<Lengths>) -> Result<world::Point, FileError> {
        let place = point(*at.get_ref());
        let [width_m, height_m] = self.field_m;
        if (0.0..=width_m).contains(&place.x) && (0.0..=height_m).contains(&place.y) {
            return Ok(place);
        }
        let reason = format!("{place} m is not on the field, which is {width_m} m by {height_m} m");
        Err(FileError::at(self.source, Some(at.span()), &reason))
    }
}

impl WantTable {
    /// The table as it is written from a scenario.
    pub(super) fn of(want: &GuestWant, tick_s: f64) -> Self {
        let mut table = Self {
            site: None,
            at: None,
            exit: None,
            treat: None,
            weight: Some(unplaced(want.weight)),
            within: Some(unplaced(Length(want.within_m))),
            stay: want.stay_s.map(|stay_s| {
                unplaced(Range {
                    min: Time(stay_s.min()),
                    mode: Time(stay_s.mode()),
                    max: Time(stay_s.max()),
                })
            }),
            give_up: Some(unplaced(Time(want.give_up as f64 * tick_s))),
        };
        match &want.goal {
            WantGoal::Site(site) => table.site = Some(unplaced(site.clone())),
            WantGoal::Place(at) => table.at = Some(unplaced(lengths(*at))),
            WantGoal::Exit(at) => table.exit = Some(unplaced(lengths(*at))),
            WantGoal::Treat(robot) => table.treat = Some(unplaced(robot.clone())),
        }
        table
    }
}

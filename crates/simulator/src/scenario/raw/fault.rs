//! `[[fault]]` as it is written.

use std::collections::BTreeMap;

use config::units::Time;
use config::{FileError, Source};
use protocol::RobotName;
use protocol::messages::{FaultKind, OnLate};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::super::checked::{Lateness, RobotSpec};
use super::super::fault::{Fault, FaultEnd};
use super::super::network::ticks;

/// Most faults of a scenario.
const MAX_FAULTS: usize = 10_000;
/// A fault that ends by the wall clock ends within this time, seconds.
const MAX_WALL_S: f64 = 3600.0;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FaultTable {
    robot: Spanned<RobotName>,
    #[serde(rename = "do")]
    kind: FaultKind,
    at: Time,
    until: Option<Time>,
    #[serde(rename = "for")]
    lasting: Option<Time>,
}

/// The faults, in the order in which they begin.
pub(super) fn check(
    raw: Vec<Spanned<FaultTable>>,
    robots: &BTreeMap<RobotName, RobotSpec>,
    lateness: &Lateness,
    tick_s: f64,
    source: &Source,
) -> Result<Vec<Fault>, FileError> {
    if let Some(extra) = raw.get(MAX_FAULTS) {
        return Err(FileError::at(
            source,
            Some(extra.span()),
            "more than 10000 faults",
        ));
    }

    let mut faults = Vec::new();
    for entry in raw {
        let span = entry.span();
        faults.push(
            one(entry.into_inner(), robots, lateness, tick_s)
                .map_err(|reason| FileError::at(source, Some(span), &reason))?,
        );
    }

    faults.sort_by_key(|fault| fault.at);

    Ok(faults)
}

fn one(
    raw: FaultTable,
    robots: &BTreeMap<RobotName, RobotSpec>,
    lateness: &Lateness,
    tick_s: f64,
) -> Result<Fault, String> {
    let robot = raw.robot.into_inner();
    if !robots.contains_key(&robot) {
        return Err(format!("no robot of this scenario is called {robot}"));
    }

    let at = ticks(raw.at.0, tick_s);
    if at < 1 {
        return Err("a fault begins after the first tick".to_owned());
    }

    let end = match (raw.until, raw.lasting) {
        (Some(_), Some(_)) => {
            return Err("`until` is simulated time, `for` is wall clock: say one".to_owned());
        }
        (Some(until), None) => FaultEnd::At(ticks(until.0, tick_s)),
        (None, Some(lasting)) if lasting.0 > 0.0 && lasting.0 <= MAX_WALL_S => {
            FaultEnd::After(lasting.0)
        }
        (None, Some(_)) => return Err("`for` is more than zero and at most an hour".to_owned()),
        (None, None) => FaultEnd::Never,
    };

    if let FaultEnd::At(until) = end
        && until <= at
    {
        return Err("it ends before it begins: `until` comes after `at`".to_owned());
    }

    // Where the clock waits for a robot, simulated time stands still until it is back.
    let needs_wall = raw.kind != FaultKind::Slow && lateness.of(&robot) == OnLate::Wait;
    if needs_wall && !matches!(end, FaultEnd::After(_)) {
        return Err(format!(
            "the clock waits for {robot} for ever: say `for` (wall clock), or on_late = \"continue\""
        ));
    }

    // Where the clock goes on without a robot, the wall clock would decide in which tick it is back.
    let goes_on = lateness.of(&robot) == OnLate::Continue;
    if goes_on && matches!(end, FaultEnd::After(_)) {
        return Err(format!(
            "`for` is wall clock, and with on_late = \"continue\" the clock goes on without {robot}: the same seed would \
             not give the same run; say `until` (simulated time)"
        ));
    }

    Ok(Fault {
        robot,
        kind: raw.kind,
        at,
        end,
    })
}

impl FaultTable {
    pub(super) fn of(fault: &Fault, tick_s: f64) -> Self {
        let time = |tick: u64| Time(tick as f64 * tick_s);
        let (until, lasting) = match fault.end {
            FaultEnd::At(tick) => (Some(time(tick)), None),
            FaultEnd::After(wall_s) => (None, Some(Time(wall_s))),
            FaultEnd::Never => (None, None),
        };
        let robot = Spanned::new(0..0, fault.robot.clone());

        Self {
            robot,
            kind: fault.kind,
            at: time(fault.at),
            until,
            lasting,
        }
    }
}

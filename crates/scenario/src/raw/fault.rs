//! The table `[[fault]]` as written in the file.

use std::collections::BTreeMap;

use config::units::Time;
use config::{FileError, Source};
use protocol::messages::{FaultKind, OnLate};
use protocol::{RobotName, Tick};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::super::checked::RobotSpec;
use super::super::fault::{Fault, FaultEnd};
use super::super::lateness::Lateness;
use super::super::network::ticks;
use super::times;
use super::times::Times;
use super::unplaced::unplaced;

/// Most faults of a scenario.
const MAX_FAULTS: usize = 10_000;
/// Longest fault that ends by the wall clock, seconds.
pub(crate) const MAX_WALL_S: f64 = 3600.0;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FaultTable {
    robot: Spanned<RobotName>,
    #[serde(rename = "do")]
    kind: FaultKind,
    at: Spanned<Time>,
    until: Option<Spanned<Time>>,
    #[serde(rename = "for")]
    lasting: Option<Time>,
}

/// Checks the faults; returns them in the order of their begins. Those that begin before tick `settled` were checked when other
/// rules for late robots held.
pub(super) fn check(
    raw: Vec<Spanned<FaultTable>>,
    robots: &BTreeMap<RobotName, RobotSpec>,
    lateness: &Lateness,
    tick_s: f64,
    settled: Tick,
    source: &Source,
) -> Result<Vec<Fault>, FileError> {
    if let Some(extra) = raw.get(MAX_FAULTS) {
        let span = Some(extra.span());
        return Err(FileError::at(source, span, "more than 10000 faults"));
    }

    let mut faults = Vec::new();
    for entry in raw {
        let span = Some(entry.span());
        let fault = check_fault(entry.into_inner(), robots, lateness, tick_s, settled);
        faults.push(fault.map_err(|reason| FileError::at(source, span, &reason))?);
    }

    faults.sort_by_key(|fault| fault.at);

    Ok(faults)
}

fn check_fault(
    raw: FaultTable,
    robots: &BTreeMap<RobotName, RobotSpec>,
    lateness: &Lateness,
    tick_s: f64,
    settled: Tick,
) -> Result<Fault, String> {
    let robot = raw.robot.into_inner();
    if !robots.contains_key(&robot) {
        return Err(format!("no robot of this scenario is called {robot}"));
    }

    let at_time = *raw.at.get_ref();
    let until_time = raw.until.as_ref().map(|until| *until.get_ref());
    let at = ticks(at_time.0, tick_s);
    if at < 1 {
        return Err("a fault begins after the first tick".to_owned());
    }

    let end = end(until_time, raw.lasting, tick_s)?;
    if let (FaultEnd::At(until), Some(until_time)) = (end, until_time)
        && until <= at
    {
        return Err(times::no_tick_between("at", at_time, until_time, tick_s));
    }
    if at >= settled {
        check_end(&robot, raw.kind, end, lateness.of(&robot))?;
    }

    Ok(Fault {
        robot,
        kind: raw.kind,
        at,
        end,
    })
}

/// The end of a fault. `until` is simulated time, `lasting` is wall clock.
fn end(until: Option<Time>, lasting: Option<Time>, tick_s: f64) -> Result<FaultEnd, String> {
    match (until, lasting) {
        (Some(_), Some(_)) => {
            Err("`until` is simulated time, `for` is wall clock: say one".to_owned())
        }
        (Some(until), None) => Ok(FaultEnd::At(ticks(until.0, tick_s))),
        (None, Some(lasting)) if lasting.0 > 0.0 && lasting.0 <= MAX_WALL_S => {
            Ok(FaultEnd::After(lasting.0))
        }
        (None, Some(_)) => Err("`for` is more than zero and at most an hour".to_owned()),
        (None, None) => Ok(FaultEnd::Never),
    }
}

/// Checks that the clock that ends the fault is running, and that the same seed gives the same run.
fn check_end(
    robot: &RobotName,
    kind: FaultKind,
    end: FaultEnd,
    on_late: OnLate,
) -> Result<(), String> {
    if kind == FaultKind::Restart {
        return match end {
            FaultEnd::Never => Ok(()),
            _ => Err("a restart is over at once: it has no `until` and no `for`".to_owned()),
        };
    }
    let is_by_wall = matches!(end, FaultEnd::After(_));

    // While the clock waits for a robot, simulated time does not advance.
    let is_held = kind != FaultKind::Slow && on_late == OnLate::Wait;
    if is_held && !is_by_wall {
        return Err(format!(
            "the clock waits for {robot} for ever: say `for` (wall clock), or on_late = \"continue\""
        ));
    }

    // If the clock continues without a robot, the wall clock would decide in which tick the robot returns.
    if on_late == OnLate::Continue && is_by_wall {
        return Err(format!(
            "`for` is wall clock, and with on_late = \"continue\" the clock continues without {robot}: the same seed would \
             not give the same run; say `until` (simulated time)"
        ));
    }
    Ok(())
}

impl FaultTable {
    /// Remarks about its times.
    pub(super) fn remark(&self, times: &mut Times<'_>) {
        times.begins("fault", &self.at);
        if let Some(until) = &self.until {
            times.on_tick(until);
        }
    }

    pub(super) fn of(fault: &Fault, tick_s: f64) -> Self {
        let mut table = Self {
            robot: unplaced(fault.robot.clone()),
            kind: fault.kind,
            at: unplaced(Time(fault.at as f64 * tick_s)),
            until: None,
            lasting: None,
        };

        match fault.end {
            FaultEnd::At(tick) => table.until = Some(unplaced(Time(tick as f64 * tick_s))),
            FaultEnd::After(wall_s) => table.lasting = Some(Time(wall_s)),
            FaultEnd::Never => {}
        }
        table
    }
}

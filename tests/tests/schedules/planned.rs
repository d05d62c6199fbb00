//! Faults that a scenario has in store, played in one process at every tick of a run: each record can be executed again, and
//! forked before, at and after the tick.

use std::collections::BTreeMap;

use environment::TickRecord;
use lab::run::Local;
use protocol::messages::FaultKind;
use protocol::{RobotName, RunName, Tick};
use record::Entry;
use scenario::{Fault, FaultEnd, OnLate, Scenario};

use crate::again::Again;
use crate::hall::{TICKS, halls};

/// A way to go and to come back, with the rule for late robots under which it is possible.
const WAYS: [(FaultKind, Back, OnLate); 8] = [
    (FaultKind::Crash, Back::For, OnLate::Wait),
    (FaultKind::Hang, Back::For, OnLate::Wait),
    (FaultKind::Restart, Back::AtOnce, OnLate::Wait),
    (FaultKind::Restart, Back::AtOnce, OnLate::Continue),
    (FaultKind::Crash, Back::After(1), OnLate::Continue),
    (FaultKind::Crash, Back::After(7), OnLate::Continue),
    (FaultKind::Hang, Back::After(2), OnLate::Continue),
    (FaultKind::Hang, Back::After(7), OnLate::Continue),
];

/// When a robot comes back.
#[derive(Debug, Clone, Copy)]
enum Back {
    AtOnce,
    For,
    After(Tick),
}

/// Every sixth tick of each robot and way, and with `CARS_SCHEDULES` every tick.
fn ticks(index: usize) -> impl Iterator<Item = Tick> {
    let every = if crate::number("CARS_SCHEDULES").is_some() {
        1
    } else {
        6
    };
    (1 + index as Tick % every..TICKS).step_by(every as usize)
}

#[test]
fn every_fault_of_a_scenario_is_executed_again_and_forked() {
    let halls = halls();
    let mut forks = 0;
    let mut returns = 0;
    for (index, (kind, back, on_late)) in WAYS.into_iter().enumerate() {
        let base = halls.scenario(index % 2, 1);
        for robot in base.roster() {
            for at in ticks(index) {
                let scenario = with_fault(base, &robot, kind, at, back, on_late);
                let what = format!("{kind:?} of {robot} at {at}, back {back:?}, {on_late:?}");
                let recorded = play(scenario.clone());
                let digest = digest_of(&recorded);
                returns += recorded
                    .iter()
                    .filter(|entry| entry.has_joined(&robot))
                    .count();
                let again = Again {
                    scenario: &scenario,
                    epoch: 1,
                    digest,
                    recorded,
                };
                match again.check() {
                    Ok(count) => forks += count,
                    Err(wrong) => panic!("{what}: {wrong}"),
                }
            }
        }
    }

    println!("{returns} returns, {forks} forks");
    assert!(returns > 0 && forks > 0);
}

fn with_fault(
    base: &Scenario,
    robot: &RobotName,
    kind: FaultKind,
    at: Tick,
    back: Back,
    on_late: OnLate,
) -> Scenario {
    let mut scenario = base.clone();
    scenario.lateness.on_late = on_late;
    scenario.faults.push(Fault {
        robot: robot.clone(),
        kind,
        at,
        end: match back {
            Back::AtOnce => FaultEnd::Never,
            Back::For => FaultEnd::After(1.0),
            Back::After(ticks) => FaultEnd::At(at + ticks),
        },
    });
    scenario
}

/// The record of a run in one process.
fn play(scenario: Scenario) -> Vec<Entry> {
    let run = RunName::new("planned").expect("a legal name");
    let mut local = Local::new(scenario, &run).expect("robots of this process");
    let mut recorded = Vec::new();
    let record = local.simulation.init(&mut local.robots);
    recorded.push(entry(&local, &record.expect("the parameters are good")));

    for _ in 0..TICKS {
        local
            .carry_out_faults(&run)
            .expect("robots of this process");
        let record = local.simulation.step(&mut local.robots);
        recorded.push(entry(&local, &record.expect("no robot gives up")));
    }
    recorded
}

fn entry(local: &Local, record: &TickRecord) -> Entry {
    let mut reports = BTreeMap::new();
    for name in local.simulation.names() {
        let report = local.simulation.report(name);
        if let Some(report) = report.filter(|report| report.tick == record.tick) {
            reports.insert(name.clone(), report.clone());
        }
    }
    Entry {
        tick: record.tick,
        events: record.events.to_vec(),
        reports: Some(reports),
        ..Entry::default()
    }
}

/// Digest at the last tick.
fn digest_of(recorded: &[Entry]) -> String {
    let events = recorded.iter().flat_map(|entry| &entry.events);
    let mut digests = events.filter_map(|event| match event {
        environment::Event::Tick { digest, .. } => Some(digest.clone()),
        _ => None,
    });
    digests.next_back().expect("a tick is complete")
}

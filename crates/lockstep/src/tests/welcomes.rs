//! The clock that comes again behind a welcome.

use std::collections::BTreeSet;
use std::time::Duration;

use protocol::messages::{FaultKind, OnLate};

use super::barrier::{Outputs, Simulator, gathered, granted, lateness, open, report};
use super::{joined, name};
use crate::{Barrier, BarrierOutput, IncarnationNotice, Timer, Timing};

/// After how long the clock is put again, if the timer was set.
fn repeated_after(out: &Outputs) -> Option<Duration> {
    out.iter().rev().find_map(|output| match output {
        BarrierOutput::SetTimer(Timer::Repeat, after) => Some(*after),
        _ => None,
    })
}

/// What the timer of the clock puts, and after how long it fires again.
fn repeat(barrier: &mut Simulator) -> (Outputs, Option<Duration>) {
    let mut out = Vec::new();
    barrier.timer(&Timer::Repeat, &mut out);
    let after = repeated_after(&out);

    (out, after)
}

fn join(barrier: &mut Simulator, robot: &str) -> Outputs {
    let mut out = Vec::new();
    barrier.join(&name(robot), robot, &mut out).expect("joins");
    out
}

#[test]
fn in_a_new_epoch_the_clock_comes_again_behind_each_welcome() {
    let usual = Timing::default().repeat;
    let quick = Timing::default().repeat_for_newcomers;
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    // Both are connected, so tick 0 is opened at once: robots get to know by its clock that they have to join again.
    let mut out = Vec::new();
    barrier.gather(2, lateness(OnLate::Wait, 1), &mut out);
    let granted = open(&mut barrier, 0);
    assert_eq!(repeated_after(&granted), Some(usual));

    let welcomed = join(&mut barrier, "A");
    assert_eq!(repeated_after(&welcomed), Some(Duration::ZERO));
    let no_grant = |output: &BarrierOutput<_, _>| !matches!(output, BarrierOutput::Grant { .. });
    assert!(welcomed.iter().all(no_grant), "not before the welcome");

    let (repeated, after) = repeat(&mut barrier);
    assert_eq!(repeated.first(), granted.first());
    assert_eq!(after, Some(quick));
    // The one that is due comes behind this welcome as well.
    assert_eq!(repeated_after(&join(&mut barrier, "B")), None);
    let (repeated, after) = repeat(&mut barrier);
    assert_eq!(repeated.first(), granted.first());
    assert_eq!(after, Some(2 * quick));
    // That is too far for a robot that asks now.
    assert_eq!(
        repeated_after(&join(&mut barrier, "B")),
        Some(Duration::ZERO)
    );

    let mut longest = Duration::ZERO;
    for _ in 0..20 {
        longest = repeat(&mut barrier).1.expect("while the tick is open");
    }
    assert_eq!(longest, usual);
}

#[test]
fn a_robot_that_is_not_awaited_makes_no_clock_come_again() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    assert_eq!(repeated_after(&join(&mut barrier, "A")), None);

    report(&mut barrier, "B", 0);
    assert_eq!(repeated_after(&join(&mut barrier, "B")), None);
    assert_eq!(repeat(&mut barrier), (vec![], None), "the tick is complete");

    // Without a token nothing that it subscribes to need be in effect: it gets the clock when it declares it.
    open(&mut barrier, 1);
    barrier.token(&name("B"), false, &mut Vec::new());
    assert_eq!(repeated_after(&join(&mut barrier, "B")), None);
}

#[test]
fn a_tick_with_a_further_incarnation_is_repeated_soon() {
    let usual = Timing::default().repeat;
    let quick = Timing::default().repeat_for_newcomers;
    let mut barrier = gathered(lateness(OnLate::Continue, 1));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    report(&mut barrier, "B", 0);
    barrier.fault(&name("B"), Some(FaultKind::Hang));
    assert_eq!(repeated_after(&open(&mut barrier, 1)), Some(usual));
    report(&mut barrier, "A", 1);
    barrier.fault(&name("B"), None);
    assert_eq!(repeated_after(&join(&mut barrier, "B")), None);

    let back = open(&mut barrier, 2);
    let named = (name("B"), joined(2));
    assert!(granted(&back).0.contains(&named), "{back:?}");
    assert_eq!(repeated_after(&back), Some(quick));
    let (again, _) = repeat(&mut barrier);
    assert_eq!(granted(&again), granted(&back));
}

#[test]
fn a_token_that_is_seen_before_its_robot_asks_to_join_holds_nothing_up() {
    let policy = lateness(OnLate::Wait, 1);
    let mut barrier = Barrier::new([name("A")], policy.clone(), Timing::default(), 4);
    let mut out = Outputs::new();
    barrier.gather(1, policy, &mut out);
    barrier.token(&name("A"), true, &mut out);
    assert!(!out.contains(&BarrierOutput::Gathered), "{out:?}");

    let welcomed = join(&mut barrier, "A");
    assert_eq!(welcomed.last(), Some(&BarrierOutput::Gathered));
    let news = BTreeSet::from([name("A")]);
    let mut out = Outputs::new();
    barrier.open(0, news, &mut out);
    assert_eq!(granted(&out).0, [(name("A"), IncarnationNotice::default())]);
}

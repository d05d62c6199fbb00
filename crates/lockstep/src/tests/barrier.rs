//! The simulator's side.

use std::collections::BTreeSet;
use std::time::Duration;

use protocol::RobotName;
use protocol::messages::{End, FaultKind, NEWS_FLAGS, OnLate, Presence, Reason};

use super::{clock, joined, name};
use crate::{
    Attendance, Barrier, BarrierOutput, Ignored, IncarnationNotice, LatePolicy, Membership,
    Refused, Sent, Stamp, TickOutcome, Timer, Timing,
};

pub(super) type Simulator = Barrier<&'static str, &'static str>;
pub(super) type Outputs = Vec<BarrierOutput<&'static str, &'static str>>;
pub(super) fn lateness(on_late: OnLate, lose_after: u32) -> LatePolicy {
    LatePolicy {
        on_late,
        own: Default::default(),
        deadline: Duration::from_secs(1),
        lose_after,
    }
}

/// A barrier with A and B, both connected, before tick 0.
pub(super) fn gathered(lateness: LatePolicy) -> Simulator {
    let mut out = Vec::new();
    let roster = [name("A"), name("B")];
    let mut barrier = Barrier::new(roster, lateness.clone(), Timing::default(), 4);
    barrier.gather(1, lateness, &mut out);
    for robot in ["A", "B"] {
        barrier.join(&name(robot), robot, &mut out).expect("joins");
        barrier.token(&name(robot), true, &mut out);
    }

    assert!(out.contains(&BarrierOutput::Gathered), "{out:?}");
    barrier
}

pub(super) fn report(barrier: &mut Simulator, robot: &str, tick: u64) -> Outputs {
    let mut out = Vec::new();
    let stamp = Stamp {
        epoch: 1,
        tick,
        generation: 1,
    };
    barrier.report(&name(robot), stamp, 0, "report", &mut out);
    out
}

pub(super) fn open(barrier: &mut Simulator, tick: u64) -> Outputs {
    let mut out = Vec::new();
    barrier.open(tick, BTreeSet::new(), &mut out);
    out
}

pub(super) fn outcome(out: Outputs) -> Option<TickOutcome<&'static str, &'static str>> {
    out.into_iter().find_map(|output| match output {
        BarrierOutput::Complete(outcome) => Some(outcome),
        _ => None,
    })
}

#[test]
fn a_place_is_taken_until_its_token_goes() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    let mut out = Vec::new();

    let again = barrier.join(&name("A"), "A", &mut out);
    let other = barrier.join(&name("A"), "other", &mut out);
    let unknown = barrier.join(&name("C"), "C", &mut out);
    barrier.token(&name("A"), false, &mut out);
    let after = barrier.join(&name("A"), "other", &mut out);

    assert_eq!(again.map(|admission| admission.generation), Ok(1));
    assert_eq!(other, Err(Refused::NameTaken));
    assert_eq!(unknown, Err(Refused::UnknownName));
    assert_eq!(after.map(|admission| admission.generation), Ok(2));
}

#[test]
fn a_place_is_reserved_until_the_timer_fires() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    let mut out = Vec::new();
    barrier.token(&name("A"), false, &mut out);
    let timer = Timer::Token(name("A"));

    barrier.join(&name("A"), "second", &mut out).expect("joins");
    let early = barrier.join(&name("A"), "third", &mut out);
    barrier.timer(&timer, &mut out);
    let late = barrier.join(&name("A"), "third", &mut out);

    assert!(out.contains(&BarrierOutput::SetTimer(timer, Timing::default().token)));
    assert_eq!(early, Err(Refused::NameTaken));
    assert_eq!(late.map(|admission| admission.generation), Ok(3));
}

#[test]
fn a_held_clock_is_announced_once_and_released() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    assert_eq!(barrier.awaited(), [(name("B"), Reason::Silent)]);
    let mut first = Vec::new();
    let mut second = Vec::new();

    barrier.timer(&Timer::Announce, &mut first);
    barrier.timer(&Timer::Announce, &mut second);
    let complete = report(&mut barrier, "B", 0);

    assert_eq!(first, [BarrierOutput::Held]);
    assert_eq!(second, []);
    assert_eq!(complete.first(), Some(&BarrierOutput::Released));
}

#[test]
fn a_clock_is_repeated_while_its_tick_is_open() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    let mut before = Vec::new();
    barrier.repeat(&mut before);
    let granted = open(&mut barrier, 0);
    let mut repeated = Vec::new();
    barrier.timer(&Timer::Repeat, &mut repeated);
    report(&mut barrier, "A", 0);
    report(&mut barrier, "B", 0);
    let mut after = Vec::new();
    barrier.timer(&Timer::Repeat, &mut after);

    assert_eq!(before, [], "nothing was granted");
    assert_eq!(repeated.first(), granted.first());
    assert_eq!(after, [], "the tick is complete");

    let next = open(&mut barrier, 1);
    let Some(BarrierOutput::Grant { clock, .. }) = next.first() else {
        panic!("{next:?}")
    };
    assert_eq!((clock.epoch, clock.tick), (1, 1));
}

#[test]
fn a_deadline_does_what_the_scenario_wants() {
    for (on_late, expected) in [
        (OnLate::Wait, vec![]),
        (OnLate::Abort, vec![BarrierOutput::Aborted]),
    ] {
        let mut barrier = gathered(lateness(on_late, 1));
        open(&mut barrier, 0);
        let mut out = Vec::new();
        barrier.timer(&Timer::Deadline, &mut out);
        assert_eq!(out, expected, "{on_late:?}");
    }

    let mut barrier = gathered(lateness(OnLate::Continue, 1));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    let mut out = Vec::new();
    barrier.timer(&Timer::Deadline, &mut out);
    let outcome = outcome(out).expect("the tick is complete");
    assert_eq!(outcome.membership, [Membership::Lost(name("B"))]);
    assert_eq!(outcome.reports.len(), 1);
}

#[test]
fn the_state_of_a_robot_that_is_given_up_is_put_on_its_behalf() {
    let own = [(name("B"), OnLate::Continue)].into();
    let mut barrier = gathered(LatePolicy {
        own,
        ..lateness(OnLate::Wait, 3)
    });
    open(&mut barrier, 0);
    let stands_in = |out: &Outputs| out.contains(&BarrierOutput::StandIn(name("B")));

    let mut early = Vec::new();
    barrier.waiting(&name("A"), 1, 0, &name("B"), &mut early);
    let mut given_up = Vec::new();
    barrier.timer(&Timer::Deadline, &mut given_up);
    let mut late = Vec::new();
    barrier.waiting(&name("A"), 1, 0, &name("B"), &mut late);
    let mut again = Vec::new();
    barrier.timer(&Timer::Repeat, &mut again);

    assert!(!stands_in(&early), "it may still answer");
    assert!(stands_in(&given_up));
    assert!(stands_in(&late));
    assert!(stands_in(&again));
}

#[test]
fn a_robot_whose_token_goes_is_lost_at_once_where_the_clock_goes_on() {
    let mut barrier = gathered(lateness(OnLate::Continue, 3));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    let mut out = Vec::new();

    barrier.token(&name("B"), false, &mut out);

    let outcome = outcome(out).expect("the tick is complete");
    assert_eq!(outcome.membership, [Membership::Lost(name("B"))]);
}

#[test]
fn a_hang_is_lost_at_the_tick_of_the_scenario_whatever_its_token_does() {
    // Before which ticks the token goes and comes back.
    for (goes, returns) in [(9, 9), (1, 9), (2, 9), (1, 2), (2, 3), (3, 9)] {
        let mut barrier = gathered(lateness(OnLate::Continue, 3));
        open(&mut barrier, 0);
        report(&mut barrier, "A", 0);
        report(&mut barrier, "B", 0);
        barrier.fault(&name("B"), Some(FaultKind::Hang));

        let mut lost = Vec::new();
        for tick in 1..5 {
            let mut out = Vec::new();
            if tick == goes {
                barrier.token(&name("B"), false, &mut out);
            }
            if tick == returns {
                barrier.token(&name("B"), true, &mut out);
            }
            out.extend(open(&mut barrier, tick));
            out.extend(report(&mut barrier, "A", tick));
            let outcome = outcome(out).expect("B is not awaited");
            if outcome.membership == [Membership::Lost(name("B"))] {
                lost.push(tick);
            }
        }

        assert_eq!(lost, [3], "gone before {goes}, back before {returns}");
    }
}

#[test]
fn a_robot_is_back_after_a_hang_when_it_has_joined_again() {
    let mut barrier = gathered(lateness(OnLate::Continue, 3));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    report(&mut barrier, "B", 0);
    barrier.fault(&name("B"), Some(FaultKind::Hang));
    open(&mut barrier, 1);
    report(&mut barrier, "A", 1);
    barrier.fault(&name("B"), None);
    assert!(!barrier.is_back(&name("B")));

    let late = report(&mut barrier, "B", 1);
    assert!(!barrier.is_back(&name("B")));
    let again = barrier.join(&name("B"), "B", &mut Vec::new());

    assert_eq!(late, [BarrierOutput::Ignored(Ignored::Stale, name("B"))]);
    assert_eq!(again.map(|admission| admission.generation), Ok(2));
    assert!(barrier.is_back(&name("B")));
    let outcome = {
        let mut out = open(&mut barrier, 2);
        out.extend(report(&mut barrier, "A", 2));
        let stamp = Stamp {
            epoch: 1,
            tick: 2,
            generation: 2,
        };
        barrier.report(&name("B"), stamp, 0, "report", &mut out);
        outcome(out).expect("both have reported")
    };
    assert_eq!(outcome.membership, [Membership::Joined(name("B"), 2)]);
    assert_eq!(outcome.reports.len(), 2);
}

#[test]
fn a_report_that_states_fewer_commands_than_arrived_counts() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    let stamp = Stamp {
        epoch: 1,
        tick: 0,
        generation: 1,
    };
    let stray = Sent {
        to: name("B").into(),
        command: "stray",
    };
    barrier.command(&name("A"), stamp, 1, stray, &mut Vec::new());
    report(&mut barrier, "A", 0);

    let outcome = outcome(report(&mut barrier, "B", 0)).expect("the tick is complete");

    assert_eq!(outcome.reports[&name("A")], ("report", vec![]));
}
/// The news and the clock's flags of the tick that was granted.
pub(super) fn granted(out: &Outputs) -> (Vec<(RobotName, IncarnationNotice)>, u32) {
    let granted = out.iter().find_map(|output| match output {
        BarrierOutput::Grant { news, clock } => Some((news.clone(), clock.news)),
        _ => None,
    });
    granted.expect("a tick is granted")
}

#[test]
fn in_a_tick_that_is_executed_again_its_record_decides_who_takes_part() {
    let mut barrier = gathered(lateness(OnLate::Continue, 1));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    report(&mut barrier, "B", 0);

    // A has news that do not come, so that it does not run the tick. It is not lost, whatever the rule says.
    barrier.recall(Some(Attendance {
        absent: [name("A")].into(),
        ..Attendance::default()
    }));
    let out = open(&mut barrier, 1);
    assert_eq!(granted(&out), (Vec::new(), 1));
    let complete = outcome(report(&mut barrier, "B", 1)).expect("complete without A");
    assert!(complete.membership.is_empty(), "{complete:?}");
    let mut again = Vec::new();
    barrier.repeat(&mut again);
    assert_eq!(granted(&again), (Vec::new(), 1));

    // Who has reported is awaited, whatever the time and the tokens say.
    barrier.recall(Some(Attendance::default()));
    open(&mut barrier, 2);
    report(&mut barrier, "B", 2);
    let mut out = Vec::new();
    barrier.token(&name("A"), false, &mut out);
    barrier.timer(&Timer::Deadline, &mut out);
    assert_eq!(outcome(out), None);
    barrier.token(&name("A"), true, &mut Vec::new());
    let complete = outcome(report(&mut barrier, "A", 2)).expect("complete");
    assert_eq!(complete.reports.len(), 2);
}

#[test]
fn a_robot_that_is_lost_in_a_record_takes_part_again_where_the_record_has_it() {
    let mut barrier = gathered(lateness(OnLate::Continue, 5));
    let lost = Attendance {
        absent: [name("A")].into(),
        lost: [name("A")].into(),
        ..Attendance::default()
    };
    barrier.recall(Some(lost));
    let out = open(&mut barrier, 0);
    let (news, _) = granted(&out);
    assert_eq!(news[0].1.rejoin, Some(1));
    let complete = outcome(report(&mut barrier, "B", 0)).expect("complete without A");
    assert_eq!(complete.membership, [Membership::Lost(name("A"))]);
    let admission = barrier.join(&name("A"), "A", &mut Vec::new());
    assert_eq!(admission.map(|admission| admission.generation), Ok(2));
    assert!(barrier.is_back(&name("A")));

    barrier.recall(Some(Attendance {
        absent: [name("A")].into(),
        ..Attendance::default()
    }));
    open(&mut barrier, 1);
    let complete = outcome(report(&mut barrier, "B", 1)).expect("complete without A");
    assert!(complete.membership.is_empty(), "{complete:?}");

    barrier.recall(Some(Attendance {
        joined: [name("A")].into(),
        ..Attendance::default()
    }));
    open(&mut barrier, 2);
    assert_eq!(outcome(report(&mut barrier, "B", 2)), None);
    let stamp = Stamp {
        epoch: 1,
        tick: 2,
        generation: 2,
    };
    let mut out = Vec::new();
    barrier.report(&name("A"), stamp, 0, "report", &mut out);
    let complete = outcome(out).expect("complete");
    assert_eq!(complete.membership, [Membership::Joined(name("A"), 2)]);
}

#[test]
fn a_robot_is_asked_to_join_again_once() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    report(&mut barrier, "B", 0);

    barrier.ask_to_rejoin(&name("A"));
    assert!(!barrier.is_back(&name("A")));
    barrier
        .join(&name("A"), "A", &mut Vec::new())
        .expect("joins again");
    barrier.ask_to_rejoin(&name("A"));
    assert!(barrier.is_back(&name("A")));
    assert!(!barrier.is_behind(&name("A"), 2));
}

pub(super) fn stamp(tick: u64, generation: u32) -> Stamp {
    Stamp {
        epoch: 1,
        tick,
        generation,
    }
}

pub(super) fn sent() -> Sent<&'static str> {
    Sent {
        to: name("B").into(),
        command: "command",
    }
}

#[test]
fn a_message_that_does_not_count_says_why() {
    let mut barrier = gathered(lateness(OnLate::Continue, 1));
    open(&mut barrier, 0);
    let why = |out: &mut Outputs| match out.pop() {
        Some(BarrierOutput::Ignored(why, _)) => why.as_str(),
        other => panic!("{other:?}"),
    };
    let out = &mut Vec::new();

    for (number, expected) in [
        (0, "too many commands"),
        (5, "too many commands"),
        (1, "stale"),
    ] {
        barrier.command(&name("A"), stamp(1, 1), number, sent(), out);
        assert_eq!(why(out), expected, "{number}");
    }
    barrier.command(&name("C"), stamp(0, 1), 1, sent(), out);
    assert_eq!(why(out), "unknown robot");
    barrier.report(&name("C"), stamp(0, 1), 0, "report", out);
    assert_eq!(why(out), "unknown robot");
    barrier.report(&name("A"), stamp(0, 1), 5, "report", out);
    assert_eq!(why(out), "too many commands");
    barrier.report(&name("A"), stamp(0, 2), 0, "report", out);
    assert_eq!(why(out), "stale");
    barrier.token(&name("C"), true, out);
    assert_eq!(why(out), "unknown robot");
    barrier.waiting(&name("C"), 1, 0, &name("B"), out);
    assert_eq!(why(out), "unknown robot");

    // As many commands as it may send are not too many, and nothing is said about what counts.
    for number in 1..=4 {
        barrier.command(&name("A"), stamp(0, 1), number, sent(), out);
    }
    barrier.report(&name("A"), stamp(0, 1), 4, "report", out);
    assert_eq!(*out, []);

    // Lost is what the seated incarnation is, and not its successor, which is not taken in yet.
    barrier.token(&name("B"), false, out);
    out.clear();
    barrier.report(&name("B"), stamp(0, 1), 9, "report", out);
    assert_eq!(why(out), "lost");
    barrier.join(&name("B"), "other", out).expect("joins");
    out.clear();
    barrier.report(&name("B"), stamp(0, 1), 0, "report", out);
    assert_eq!(why(out), "stale");
}

#[test]
fn what_others_ask_about_a_robot() {
    let mut barrier = gathered(lateness(OnLate::Continue, 3));
    let presence = |barrier: &Simulator| barrier.presence(&name("B"));
    assert_eq!(barrier.presence(&name("C")), (0, Presence::Gone));
    assert_eq!(presence(&barrier), (1, Presence::Here));
    assert!(barrier.has(&name("B")) && !barrier.has(&name("C")));
    assert!(barrier.roster().eq(&[name("A"), name("B")]));
    assert_eq!(barrier.lateness().lose_after, 3);
    assert!(!barrier.is_open() && !barrier.is_stopped(&name("B")));
    assert!(!barrier.is_reserved(&name("B")) && barrier.is_present(&name("B")));

    open(&mut barrier, 0);
    assert!(barrier.is_open());
    report(&mut barrier, "B", 0);
    assert_eq!(barrier.open_report(&name("B")), Some(&"report"));
    assert_eq!(barrier.open_report(&name("A")), None);
    report(&mut barrier, "A", 0);
    for fault in [FaultKind::Crash, FaultKind::Hang] {
        barrier.fault(&name("B"), Some(fault));
        assert!(barrier.is_stopped(&name("B")));
    }
    open(&mut barrier, 1);
    assert!(barrier.is_behind(&name("B"), 1) && !barrier.is_behind(&name("B"), 2));
    assert!(!barrier.is_behind(&name("A"), 1));
    report(&mut barrier, "A", 1);
    barrier.token(&name("B"), false, &mut Vec::new());
    assert_eq!(presence(&barrier), (1, Presence::Gone));
    assert!(!barrier.is_present(&name("B")));
    barrier
        .join(&name("B"), "other", &mut Vec::new())
        .expect("joins");
    assert!(barrier.is_reserved(&name("B")) && !barrier.is_back(&name("B")));
    assert_eq!(presence(&barrier), (2, Presence::Gone));
    open(&mut barrier, 2);
    report(&mut barrier, "A", 2);
    open(&mut barrier, 3);
    assert_eq!(presence(&barrier), (2, Presence::Lost));
    barrier.token(&name("B"), true, &mut Vec::new());
    assert!(barrier.is_back(&name("B")) && !barrier.is_reserved(&name("B")));
}

#[test]
fn for_whom_the_clock_waits_is_said_again_when_it_changes() {
    let mut out = Vec::new();
    let roster = [name("A"), name("B")];
    let mut barrier: Simulator =
        Barrier::new(roster, lateness(OnLate::Wait, 1), Timing::default(), 4);
    barrier.gather(1, lateness(OnLate::Wait, 1), &mut out);
    assert_eq!(
        out,
        [BarrierOutput::SetTimer(
            Timer::Announce,
            Timing::default().announce
        )]
    );
    barrier.timer(&Timer::Announce, &mut out);
    for robot in ["A", "B"] {
        assert_eq!(barrier.awaited()[0], (name(robot), Reason::NotJoined));
        // A token alone is not enough, nor is joining.
        barrier.token(&name(robot), true, &mut out);
        assert_eq!(barrier.awaited()[0], (name(robot), Reason::NotJoined));
        out.clear();
        barrier.join(&name(robot), robot, &mut out).expect("joins");
        barrier.token(&name(robot), true, &mut out);
    }
    assert!(barrier.awaited().is_empty() && !barrier.is_announced());
    assert_eq!(out[1..], [BarrierOutput::Released, BarrierOutput::Gathered]);

    open(&mut barrier, 0);
    let silent = |robot: &str| (name(robot), Reason::Silent);
    assert_eq!(barrier.awaited(), [silent("A"), silent("B")]);
    out.clear();
    barrier.waiting(&name("A"), 1, 1, &name("B"), &mut out);
    barrier.waiting(&name("A"), 2, 0, &name("B"), &mut out);
    assert_eq!(barrier.awaited(), [silent("A"), silent("B")]);
    barrier.waiting(&name("A"), 1, 0, &name("B"), &mut out);
    assert_eq!(out, [], "people have not been told");
    let waits = (name("A"), Reason::WaitsFor(name("B")));
    assert_eq!(barrier.awaited(), [waits.clone(), silent("B")]);
    barrier.timer(&Timer::Announce, &mut out);
    assert!(barrier.is_announced());
    barrier.waiting(&name("A"), 1, 0, &name("B"), &mut out);
    barrier.token(&name("B"), false, &mut out);
    assert_eq!(
        out,
        [
            BarrierOutput::Held,
            BarrierOutput::Held,
            BarrierOutput::Held
        ]
    );
    assert_eq!(barrier.awaited(), [waits, (name("B"), Reason::Gone)]);

    // The next epoch is not announced yet, and nobody is told that a clock goes on that was given up.
    out.clear();
    barrier.gather(2, lateness(OnLate::Wait, 1), &mut out);
    assert_eq!(out.len(), 1);
    assert!(!barrier.is_announced());
    barrier.token(&name("B"), true, &mut out);
    assert_eq!(out[1..], [BarrierOutput::Gathered]);
}

#[test]
fn a_deadline_is_set_where_a_robot_does_not_wait() {
    let has_deadline = |out: &Outputs| {
        let deadline = BarrierOutput::SetTimer(Timer::Deadline, Duration::from_secs(1));
        out.contains(&deadline)
    };
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    let own = LatePolicy {
        own: [(name("B"), OnLate::Continue)].into(),
        ..lateness(OnLate::Wait, 1)
    };

    let mut closed = Vec::new();
    barrier.set_lateness(own.clone(), &mut closed);
    assert_eq!(closed, []);
    barrier.set_lateness(lateness(OnLate::Wait, 1), &mut closed);
    let granted = open(&mut barrier, 0);
    assert!(granted.len() == 3 && !has_deadline(&granted));
    let mut changed = Vec::new();
    barrier.set_lateness(own, &mut changed);
    assert!(has_deadline(&changed));
    // A robot that waits is waited for.
    changed.clear();
    barrier.timer(&Timer::Deadline, &mut changed);
    assert_eq!(changed, [BarrierOutput::StandIn(name("B"))]);
}

#[test]
fn a_tick_stops_waiting_for_a_robot_that_cannot_report_when_the_clock_is_to_go_on() {
    for is_stopped in [false, true] {
        let mut barrier = gathered(lateness(OnLate::Wait, 3));
        open(&mut barrier, 0);
        report(&mut barrier, "A", 0);
        report(&mut barrier, "B", 0);
        open(&mut barrier, 1);
        report(&mut barrier, "A", 1);
        if !is_stopped {
            barrier.token(&name("B"), false, &mut Vec::new());
        }

        let mut out = Vec::new();
        barrier.note_stopped(&name("B"), &mut out);
        assert!(out.is_empty() && barrier.is_open());
        barrier.set_lateness(lateness(OnLate::Continue, 3), &mut out);
        if is_stopped {
            assert!(barrier.is_open());
            barrier.note_stopped(&name("B"), &mut out);
        }
        assert!(!barrier.is_open());
        let lost = |output: &BarrierOutput<_, _>| match output {
            BarrierOutput::Complete(outcome) => Some(outcome.membership.clone()),
            _ => None,
        };
        let lost: Vec<_> = out.iter().filter_map(lost).collect();
        assert_eq!(lost, [vec![Membership::Lost(name("B"))]]);
    }
}

#[test]
fn a_run_that_is_over_admits_no_robot() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    report(&mut barrier, "B", 0);
    open(&mut barrier, 1);
    report(&mut barrier, "A", 1);

    let end = barrier.end(End::Finished);
    let refused = barrier.join(&name("A"), "A", &mut Vec::new());

    assert_eq!((end.epoch, end.tick, end.end), (1, 1, Some(End::Finished)));
    assert_eq!(refused, Err(Refused::Ended));
    assert_eq!(barrier.open_report(&name("A")), None);
    for timer in [Timer::Announce, Timer::Repeat, Timer::Deadline] {
        let mut out = Vec::new();
        barrier.timer(&timer, &mut out);
        barrier.repeat(&mut out);
        assert_eq!(out, [], "{timer:?}");
    }
}

#[test]
#[should_panic(expected = "a tick is granted when the one before is complete")]
fn a_tick_is_not_granted_while_another_one_is_open() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    open(&mut barrier, 1);
}

#[test]
fn robots_that_share_a_flag_all_get_news() {
    let roster: Vec<RobotName> = (0..NEWS_FLAGS + 2)
        .map(|number| name(&format!("R{number:02}")))
        .collect();
    let mut barrier: Simulator = Barrier::new(
        roster.clone(),
        lateness(OnLate::Wait, 1),
        Timing::default(),
        4,
    );
    let mut out = Vec::new();
    barrier.gather(1, lateness(OnLate::Wait, 1), &mut out);
    let mut flags = Vec::new();
    for robot in &roster {
        let admission = barrier.join(robot, "first", &mut out).expect("joins");
        flags.push(admission.news_flag);
        barrier.token(robot, true, &mut out);
    }
    out.clear();
    barrier.open(0, [roster[1].clone()].into(), &mut out);

    assert_eq!(flags[..2], [1, 2]);
    assert_eq!(flags[NEWS_FLAGS..], [1, 2]);
    let both = [&roster[1], &roster[NEWS_FLAGS + 1]];
    let (news, clock) = granted(&out);
    assert!(news.iter().map(|(robot, _)| robot).eq(both));
    assert_eq!(clock, 2);
}

#[test]
fn an_incarnation_that_is_replaced_in_its_first_tick_leaves_no_trace() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    let mut out = Vec::new();
    for (generation, instance) in [(2, "second"), (3, "third")] {
        barrier.token(&name("B"), false, &mut out);
        barrier.join(&name("B"), instance, &mut out).expect("joins");
        out.clear();
        barrier.token(&name("B"), true, &mut out);
        assert_eq!(granted(&out).0, [(name("B"), joined(generation))]);
    }

    barrier.report(&name("B"), stamp(0, 3), 0, "report", &mut out);

    let complete = outcome(out).expect("both have reported");
    assert_eq!(complete.membership, [Membership::Joined(name("B"), 3)]);
}

#[test]
fn a_complete_answer_counts_when_its_process_is_replaced() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    let mut out = Vec::new();
    barrier.command(&name("B"), stamp(0, 1), 1, sent(), &mut out);
    barrier.report(&name("B"), stamp(0, 1), 1, "of the first", &mut out);
    barrier.token(&name("B"), false, &mut out);
    barrier.join(&name("B"), "other", &mut out).expect("joins");

    let complete = outcome(report(&mut barrier, "A", 0)).expect("both have reported");

    assert_eq!(complete.reports[&name("B")], ("of the first", vec![sent()]));
    assert_eq!(complete.membership, []);
    // Its own first tick is the next one, whatever came for the one before.
    barrier.token(&name("B"), true, &mut out);
    assert_eq!(granted(&open(&mut barrier, 1)).0, [(name("B"), joined(2))]);
}

#[test]
fn where_a_record_has_a_replacement_in_tick_0_the_first_incarnation_is_noted() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    barrier.recall(Some(Attendance {
        joined: [name("A")].into(),
        ..Attendance::default()
    }));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);

    let complete = outcome(report(&mut barrier, "B", 0)).expect("both have reported");

    assert_eq!(complete.membership, [Membership::Joined(name("A"), 1)]);
}

#[test]
fn in_tick_0_the_clock_waits_for_a_robot_that_is_not_connected() {
    let mut barrier = gathered(lateness(OnLate::Continue, 1));
    barrier.token(&name("B"), false, &mut Vec::new());
    open(&mut barrier, 0);
    assert_eq!(barrier.awaited()[1], (name("B"), Reason::Gone));
    // A first incarnation is named only where it may have missed the beginning.
    let mut out = Vec::new();
    barrier.token(&name("B"), true, &mut out);
    assert_eq!(granted(&out), (Vec::new(), 0));
}

#[test]
fn a_tick_that_is_given_up_leaves_nothing_in_the_next_epoch() {
    let mut barrier = gathered(lateness(OnLate::Continue, 1));
    open(&mut barrier, 0);
    let mut out = Vec::new();
    barrier.fault(&name("B"), Some(FaultKind::Hang));
    barrier.token(&name("B"), false, &mut out);
    barrier.recall(Some(Attendance {
        absent: [name("A")].into(),
        ..Attendance::default()
    }));
    barrier.gather(2, lateness(OnLate::Wait, 1), &mut out);
    // Until then the robot is shown as it was.
    assert_eq!(barrier.presence(&name("B")), (1, Presence::Lost));
    barrier.token(&name("B"), true, &mut out);
    assert!(!barrier.is_stopped(&name("B")));
    let again = barrier.join(&name("B"), "B", &mut out);
    assert_eq!(again.map(|admission| admission.generation), Ok(1));

    let begun = open(&mut barrier, 0);

    assert_eq!(granted(&begun), (Vec::new(), 0));
    assert_eq!(barrier.awaited().len(), 2);
    let of_epoch = |tick| Stamp {
        epoch: 2,
        tick,
        generation: 1,
    };
    barrier.report(&name("A"), of_epoch(0), 0, "report", &mut out);
    out.clear();
    barrier.report(&name("B"), of_epoch(0), 0, "report", &mut out);
    assert_eq!(outcome(out).expect("complete").membership, []);
    assert_eq!(clock(2, 0).end, None);
}

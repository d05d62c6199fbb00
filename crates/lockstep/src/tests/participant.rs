//! A robot's side.

use std::time::Duration;

use protocol::messages::{Clock, End, OnLate, Refusal};

use super::barrier::{Simulator, gathered, lateness, open, outcome, report};
use super::{ADMISSION, clock, joined, name};
use crate::{
    Admission, BarrierOutput, Begin, IncarnationNotice, Leave, Membership, NoState, Participant,
    ParticipantOutput, RobotTimer, Stamp, StateQuery, Timeouts, Turn,
};

pub(super) type Robot = Participant<(), &'static str, (), ()>;
pub(super) fn robot() -> Robot {
    let timeouts = Timeouts {
        join: Duration::from_secs(1),
        gone: Duration::from_secs(1),
    };
    Robot::new(timeouts, &mut Vec::new())
}
#[test]
fn a_newcomer_asks_again_while_its_name_is_taken() {
    let mut robot = robot();
    let mut out = Vec::new();

    robot.refused(Refusal::NameTaken, &mut out);
    assert!(matches!(
        out[..],
        [ParticipantOutput::SetTimer(RobotTimer::Join, _)]
    ));
    out.clear();
    robot.timer(RobotTimer::Join, &mut out);
    assert_eq!(out, [ParticipantOutput::Join]);
    out.clear();
    robot.timer(RobotTimer::JoinPatience, &mut out);
    assert_eq!(
        out,
        [ParticipantOutput::Leave(Leave::Refused(Refusal::NameTaken))]
    );
}

#[test]
fn a_robot_whose_name_is_taken_in_a_further_epoch_has_been_replaced() {
    let mut robot = robot();
    robot.admitted(ADMISSION, [], &mut Vec::new());
    let mut out = Vec::new();

    robot.clock(clock(2, 0), &mut out);
    robot.refused(Refusal::NameTaken, &mut out);

    assert_eq!(
        out,
        [
            ParticipantOutput::Join,
            ParticipantOutput::Leave(Leave::Replaced)
        ]
    );
}

#[test]
fn states_of_the_epoch_before_are_no_answer() {
    let mut robot = robot();
    let mut out = Vec::new();
    robot.admitted(ADMISSION, [], &mut out);
    robot.clock(clock(1, 0), &mut out);
    robot.done(Vec::new(), "of epoch 1", (), &mut out);
    assert_eq!(robot.query(StateQuery::default()), Ok("of epoch 1"));

    robot.clock(clock(2, 0), &mut out);
    let admission = Admission {
        epoch: 2,
        ..ADMISSION
    };
    robot.admitted(admission, [], &mut out);

    assert_eq!(robot.query(StateQuery::default()), Err(NoState::NotYet));
}

#[test]
fn a_simulator_that_is_back_in_time_is_not_gone() {
    let mut robot = robot();
    let mut out = Vec::new();
    robot.admitted(ADMISSION, [], &mut Vec::new());

    robot.simulator(false, &mut out);
    robot.simulator(true, &mut out);
    robot.timer(RobotTimer::Gone, &mut out);
    assert!(!robot.has_left());
    robot.simulator(false, &mut out);
    robot.timer(RobotTimer::Gone, &mut out);

    assert_eq!(
        out.last(),
        Some(&ParticipantOutput::Leave(Leave::SimulatorGone))
    );
}

/// A robot that runs tick 1 of epoch 1, after it has answered tick 0.
pub(super) fn running() -> Robot {
    let mut robot = robot();
    robot.admitted(ADMISSION, [], &mut Vec::new());
    robot.clock(clock(1, 0), &mut Vec::new());
    robot.done(Vec::new(), "of tick 0", (), &mut Vec::new());
    robot.clock(clock(1, 1), &mut Vec::new());

    robot
}

#[test]
fn a_state_of_a_later_tick_does_not_take_the_place_of_the_one_that_is_asked_for() {
    let mut robot = running();
    for (tick, state) in [(0, "of tick 0"), (1, "of tick 1"), (2, "of tick 2")] {
        robot.heard(name("B"), 1, tick, state);
    }
    assert_eq!(robot.ask(&name("B"), &mut Vec::new()), Some("of tick 0"));

    robot.done(Vec::new(), "of tick 1", (), &mut Vec::new());
    robot.heard(name("B"), 1, 2, "of tick 2");
    robot.clock(clock(1, 2), &mut Vec::new());
    assert_eq!(robot.ask(&name("B"), &mut Vec::new()), Some("of tick 1"));
}

pub(super) fn run(
    epoch: u32,
    tick: u64,
    begin: Begin,
) -> ParticipantOutput<(), &'static str, (), ()> {
    let has_news = begin == Begin::TakeOver;

    ParticipantOutput::Run(Turn {
        epoch,
        tick,
        begin,
        news: has_news.then_some(()),
    })
}
#[test]
fn a_clock_of_an_epoch_that_has_not_begun_costs_a_welcome_and_nothing_else() {
    let mut robot = running();
    let mut out = Vec::new();

    for tick in 0..8 {
        robot.clock(clock(9, tick), &mut out);
        robot.news(9, tick, IncarnationNotice::default(), (), &mut out);
    }
    assert_eq!(out, [ParticipantOutput::Join]);
    assert!(!robot.is_interrupted(), "its tick may count");
    out.clear();
    robot.done(Vec::new(), "of tick 1", (), &mut out);
    robot.news(1, 2, IncarnationNotice::default(), (), &mut out);
    let flagged = Clock {
        news: ADMISSION.news_flag,
        ..clock(1, 2)
    };
    robot.clock(flagged, &mut out);
    assert_eq!(out, []);

    robot.admitted(ADMISSION, [(0, "of the welcome")], &mut out);

    assert!(matches!(&out[0], ParticipantOutput::Put(answer) if answer.tick == 1));
    let turn = Turn {
        epoch: 1,
        tick: 2,
        begin: Begin::GoOn,
        news: Some(()),
    };
    assert_eq!(out[1..], [ParticipantOutput::Run(turn)]);
    assert_eq!(robot.query(StateQuery::default()), Ok("of tick 1"));
}

#[test]
fn a_robot_that_joins_again_forgets_the_tick_that_it_runs() {
    let mut robot = running();
    let mut out = Vec::new();
    let asked = IncarnationNotice {
        joined: None,
        rejoin: Some(1),
    };
    let further = Admission {
        generation: 2,
        ..ADMISSION
    };

    robot.news(1, 5, asked, (), &mut out);
    robot.news(1, 5, asked, (), &mut out);
    assert_eq!(out, [ParticipantOutput::Join]);
    out.clear();
    // Its next incarnation may be named before the answer arrives.
    robot.news(1, 6, joined(2), (), &mut out);
    robot.clock(clock(1, 6), &mut out);
    robot.admitted(further, [(0, "of the welcome")], &mut out);
    assert_eq!(out, []);
    assert!(robot.is_interrupted());
    assert_eq!(robot.query(StateQuery::default()), Ok("of the welcome"));
    robot.done(Vec::new(), "of an incarnation that is over", (), &mut out);

    assert_eq!(out, [run(1, 6, Begin::TakeOver)]);
    assert_eq!(robot.query(StateQuery::default()), Ok("of the welcome"));
    out.clear();
    robot.news(1, 7, asked, (), &mut out);
    assert_eq!(out, [], "it has joined again already");
}

#[test]
fn news_that_are_faster_than_the_welcome_of_a_lost_incarnation_make_it_join_again_once() {
    let mut robot = running();
    let mut out = Vec::new();
    let lost = |generation| IncarnationNotice {
        joined: Some(generation),
        rejoin: Some(generation),
    };
    let admitted = |generation| Admission {
        generation,
        ..ADMISSION
    };
    robot.done(Vec::new(), "of tick 1", (), &mut out);
    robot.news(1, 5, lost(1), (), &mut out);
    out.clear();

    // The second incarnation is lost in tick 7, and its news and their clock are here before its welcome.
    robot.news(1, 7, lost(2), (), &mut out);
    robot.clock(clock(1, 7), &mut out);
    robot.admitted(admitted(2), [], &mut out);
    assert_eq!(
        out,
        [ParticipantOutput::Join],
        "no tick is run as the second one"
    );
    out.clear();
    robot.admitted(admitted(2), [], &mut out);
    assert_eq!(out, [], "a welcome that was repeated makes it ask no more");

    robot.news(1, 8, lost(2), (), &mut out);
    robot.admitted(admitted(3), [], &mut out);
    robot.news(1, 9, joined(3), (), &mut out);
    robot.clock(clock(1, 9), &mut out);
    assert_eq!(out, [ParticipantOutput::Join, run(1, 9, Begin::TakeOver)]);
}

#[test]
fn a_robot_that_is_cut_off_where_an_epoch_begins_returns_as_a_further_incarnation() {
    let mut barrier = gathered(lateness(OnLate::Continue, 3));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    report(&mut barrier, "B", 0);
    let mut out = Vec::new();
    barrier.gather(2, lateness(OnLate::Continue, 3), &mut out);
    open(&mut barrier, 0);
    barrier.token(&name("B"), false, &mut out);

    // Tick 0 is not repeated: the first clock that it sees is of a later one.
    let complete = |barrier: &mut Simulator, tick: u64| {
        let mut out = open(barrier, tick);
        let stamp = Stamp {
            epoch: 2,
            tick,
            generation: 1,
        };
        barrier.report(&name("A"), stamp, 0, "report", &mut out);
        out
    };
    let stamp = Stamp {
        epoch: 2,
        tick: 0,
        generation: 1,
    };
    barrier.report(&name("A"), stamp, 0, "report", &mut out);
    complete(&mut barrier, 1);
    barrier.token(&name("B"), true, &mut out);
    let asked = IncarnationNotice {
        joined: None,
        rejoin: Some(1),
    };
    let granted = complete(&mut barrier, 2);
    assert!(
        matches!(&granted[0], BarrierOutput::Grant { news, .. } if news[..] == [(name("B"), asked)])
    );

    let mut robot = running();
    let mut actions = Vec::new();
    robot.done(Vec::new(), "of epoch 1", (), &mut actions);
    actions.clear();
    robot.news(2, 2, asked, (), &mut actions);
    robot.clock(clock(2, 2), &mut actions);
    assert_eq!(actions, [ParticipantOutput::Join]);
    let admission = barrier.join(&name("B"), "B", &mut out).expect("joins");
    assert_eq!((admission.epoch, admission.generation), (2, 2));
    robot.admitted(admission, [], &mut actions);
    let taken_in = complete(&mut barrier, 3);
    let joins = Membership::Joined(name("B"), 2);
    assert!(
        matches!(&taken_in[0], BarrierOutput::Grant { news, .. } if news[..] == [(name("B"), joined(2))])
    );
    actions.clear();
    robot.news(2, 3, joined(2), (), &mut actions);
    robot.clock(clock(2, 3), &mut actions);
    assert_eq!(actions, [run(2, 3, Begin::TakeOver)]);

    let stamp = Stamp {
        epoch: 2,
        tick: 3,
        generation: 2,
    };
    barrier.report(&name("B"), stamp, 0, "report", &mut out);
    let last = out
        .into_iter()
        .rev()
        .find_map(|output| outcome(vec![output]));
    assert_eq!(last.expect("both have reported").membership, [joins]);
}

#[test]
fn a_robot_that_waits_for_another_one_says_so_once_and_asks_again() {
    let mut robot = running();
    let mut out = Vec::new();
    let query = |of: &str| ParticipantOutput::Query {
        of: name(of),
        tick: 1,
        epoch: 1,
    };
    let is_set = |action: &ParticipantOutput<(), &'static str, (), ()>, timer| matches!(action, ParticipantOutput::SetTimer(set, _) if *set == timer);

    assert_eq!(robot.ask(&name("B"), &mut out), None);
    assert_eq!(robot.ask(&name("B"), &mut out), None);
    assert_eq!(out[0], query("B"));
    assert!(is_set(&out[1], RobotTimer::Query) && is_set(&out[2], RobotTimer::Waiting));
    assert_eq!(out.len(), 3);
    out.clear();
    robot.timer(RobotTimer::Query, &mut out);
    assert!(out[0] == query("B") && is_set(&out[1], RobotTimer::Query));
    out.clear();
    robot.timer(RobotTimer::Waiting, &mut out);
    robot.timer(RobotTimer::Waiting, &mut out);
    let waiting = ParticipantOutput::PutWaiting {
        tick: 1,
        epoch: 1,
        on: name("B"),
    };
    assert_eq!(out, [waiting]);

    // The answer of one, and a question to another one.
    out.clear();
    assert_eq!(robot.ask(&name("C"), &mut out), None);
    assert_eq!(out[0], query("C"));
    robot.heard(name("C"), 1, 0, "of C");
    assert_eq!(robot.ask(&name("C"), &mut out), Some("of C"));
    out.clear();
    robot.timer(RobotTimer::Query, &mut out);
    robot.timer(RobotTimer::Waiting, &mut out);
    assert_eq!(out, [], "it waits for none");
    robot.done(Vec::new(), "of tick 1", (), &mut Vec::new());
    assert_eq!(robot.ask(&name("C"), &mut out), None);
    assert_eq!(out, [], "no tick runs");
}

#[test]
fn states_far_from_the_present_tick_are_not_kept() {
    for (epoch, tick) in [(1, 2), (2, 0), (0, 1)] {
        let mut robot = running();
        robot.heard(name("B"), epoch, tick, "far");
        robot.heard(name("B"), 1, 0, "of tick 0");
        assert_eq!(robot.ask(&name("B"), &mut Vec::new()), Some("of tick 0"));
    }

    // Between two ticks: those around the one that was answered.
    for (tick, is_near) in [(0, true), (1, true), (2, true), (3, false)] {
        let mut robot = running();
        robot.done(Vec::new(), "of tick 1", (), &mut Vec::new());
        robot.heard(name("B"), 1, tick, "heard");
        robot.clock(clock(1, tick + 1), &mut Vec::new());
        let found = robot.ask(&name("B"), &mut Vec::new());
        // The clock of tick 1 was answered, and does not run again.
        assert_eq!(found.is_some(), is_near && tick > 0, "{tick}");
    }
}

#[test]
fn a_robot_that_is_not_asked_any_more_is_followed_no_more() {
    let mut robot = running();
    robot.ask(&name("B"), &mut Vec::new());
    let mut run_at = |tick| {
        let mut out = Vec::new();
        robot.done(Vec::new(), "state", (), &mut Vec::new());
        robot.clock(clock(1, tick), &mut out);
        out
    };

    assert_eq!(run_at(64), [run(1, 64, Begin::GoOn)]);
    let unfollow = ParticipantOutput::Unfollow(name("B"));
    assert_eq!(run_at(65), [unfollow, run(1, 65, Begin::GoOn)]);
    assert_eq!(run_at(200), [run(1, 200, Begin::GoOn)]);
}

#[test]
fn the_newest_news_are_kept_until_their_clock_is_here() {
    let flagged = |tick| Clock {
        news: ADMISSION.news_flag,
        ..clock(1, tick)
    };
    for (tick, runs) in [(2, false), (3, true), (6, true)] {
        let mut robot = running();
        robot.done(Vec::new(), "of tick 1", (), &mut Vec::new());
        for tick in [1, 2, 3, 4, 5, 6] {
            robot.news(1, tick, IncarnationNotice::default(), (), &mut Vec::new());
        }
        let mut out = Vec::new();
        robot.clock(flagged(tick), &mut out);
        assert_eq!(!out.is_empty(), runs, "{tick}");
        // Those that were not needed go with those before.
        out.clear();
        robot.clock(flagged(7), &mut out);
        assert_eq!(out, []);
    }
}

#[test]
fn a_robot_runs_the_newest_clock() {
    let mut robot = running();
    let mut out = Vec::new();
    assert!(!robot.is_interrupted());
    for tick in [1, 3, 2, 1, 0] {
        robot.clock(clock(1, tick), &mut out);
    }
    assert!(robot.is_interrupted());
    assert_eq!(out, []);
    robot.done(Vec::new(), "of tick 1", (), &mut out);
    assert_eq!(out[1..], [run(1, 3, Begin::GoOn)]);

    // What was answered last is repeated, and nothing older is run.
    robot.done(Vec::new(), "of tick 3", (), &mut out);
    out.clear();
    robot.clock(clock(1, 2), &mut out);
    assert_eq!(out, []);
    robot.clock(clock(1, 3), &mut out);
    assert!(matches!(&out[..], [ParticipantOutput::Put(answer)] if answer.tick == 3));
    out.clear();
    robot.clock(clock(0, 9), &mut out);
    assert_eq!(out, [], "of an epoch that is over");
}

#[test]
fn the_newest_clock_of_a_later_epoch_waits_for_its_welcome() {
    let mut robot = running();
    robot.done(Vec::new(), "of tick 1", (), &mut Vec::new());
    let mut out = Vec::new();
    for tick in [0, 3, 1] {
        robot.clock(clock(2, tick), &mut out);
        robot.news(2, tick, joined(1), (), &mut out);
    }
    assert_eq!(out, [ParticipantOutput::Join]);
    out.clear();

    let admission = Admission {
        epoch: 2,
        ..ADMISSION
    };
    robot.admitted(admission, [], &mut out);

    assert_eq!(out, [run(2, 3, Begin::TakeOver)]);
}

#[test]
fn a_clock_of_the_epoch_before_is_not_run_as_one_of_the_next() {
    let mut robot = running();
    let mut out = Vec::new();
    robot.clock(clock(1, 2), &mut out);
    robot.clock(clock(2, 0), &mut out);
    robot.clock(clock(3, 0), &mut out);
    let admission = Admission {
        epoch: 2,
        ..ADMISSION
    };
    out.clear();

    // It was a stray clock of the third epoch that made it join again: there is none of the second to run.
    robot.admitted(admission, [], &mut out);
    robot.done(Vec::new(), "of epoch 1", (), &mut out);

    assert_eq!(out, []);
    assert!(!robot.is_interrupted());
    robot.clock(clock(1, 2), &mut out);
    assert_eq!(out, []);
    robot.clock(clock(2, 0), &mut out);
    assert_eq!(out, [run(2, 0, Begin::Init)]);
}

#[test]
fn a_request_to_join_is_repeated_until_it_is_answered() {
    let mut out = Vec::new();
    let mut robot = robot();
    assert!(robot.is_unanswered());
    robot.unanswered(&mut out);
    assert!(matches!(
        out[..],
        [ParticipantOutput::SetTimer(RobotTimer::Join, _)]
    ));
    out.clear();
    robot.timer(RobotTimer::Join, &mut out);
    assert_eq!(out, [ParticipantOutput::Join]);
    let mut patient = robot.clone();
    out.clear();
    patient.timer(RobotTimer::JoinPatience, &mut out);
    assert_eq!(out, [ParticipantOutput::Leave(Leave::NoSimulator)]);
    assert!(patient.has_left() && patient.is_interrupted());
    let mut taken = robot.clone();
    taken.refused(Refusal::NameTaken, &mut out);
    assert!(!taken.is_unanswered());

    out.clear();
    robot.admitted(ADMISSION, [], &mut out);
    assert_eq!(out, [ParticipantOutput::DeclareToken]);
    assert!(!robot.is_unanswered());
    out.clear();
    robot.timer(RobotTimer::Join, &mut out);
    robot.timer(RobotTimer::JoinPatience, &mut out);
    robot.timer(RobotTimer::Gone, &mut out);
    robot.unanswered(&mut out);
    robot.refused(Refusal::Ended, &mut out);
    let other = Admission {
        generation: 7,
        ..ADMISSION
    };
    robot.admitted(other, [], &mut out);
    assert_eq!(out, [], "it is admitted");
    assert_eq!(robot.admission(), Some(ADMISSION));
}

#[test]
fn a_robot_that_has_left_does_nothing_more() {
    let asked = IncarnationNotice {
        joined: None,
        rejoin: Some(1),
    };
    let end = Clock {
        end: Some(End::Finished),
        ..clock(1, 0)
    };
    let mut out = Vec::new();
    let mut early = robot();
    early.clock(end, &mut out);
    assert_eq!(out, [ParticipantOutput::Leave(Leave::End(End::Finished))]);
    assert_eq!(early.admission(), None);

    let mut robot = running();
    out.clear();
    robot.stop(&mut out);
    robot.stop(&mut out);
    assert_eq!(out, [ParticipantOutput::Leave(Leave::Stopped)]);
    assert_eq!(robot.admission(), Some(ADMISSION));
    out.clear();
    robot.clock(clock(1, 2), &mut out);
    robot.clock(end, &mut out);
    robot.news(1, 2, asked, (), &mut out);
    robot.timer(RobotTimer::Join, &mut out);
    robot.unanswered(&mut out);
    robot.refused(Refusal::Ended, &mut out);
    robot.done(Vec::new(), "of tick 1", (), &mut out);
    assert_eq!(out, []);
    assert_eq!(robot.query(StateQuery::default()), Ok("of tick 0"));

    let mut refused = self::robot();
    refused.refused(Refusal::UnknownName, &mut out);
    assert_eq!(
        out,
        [ParticipantOutput::Leave(Leave::Refused(
            Refusal::UnknownName
        ))]
    );
}

#[test]
fn a_process_ends_when_a_later_incarnation_is_named() {
    let mut robot = running();
    let mut out = Vec::new();
    // In another epoch it may be its own.
    robot.news(2, 0, joined(2), (), &mut out);
    robot.news(1, 2, joined(1), (), &mut out);
    robot.news(0, 2, joined(2), (), &mut out);
    assert_eq!(out, []);
    robot.news(1, 2, joined(2), (), &mut out);
    assert_eq!(out, [ParticipantOutput::Leave(Leave::Replaced)]);
}

#[test]
fn only_the_first_incarnation_begins_without_being_named() {
    for (generation, tick, names, begins) in [
        (1, 0, None, Some(Begin::Init)),
        (2, 0, None, None),
        (2, 0, Some(1), None),
        (2, 0, Some(2), Some(Begin::Init)),
        (1, 3, None, None),
        (1, 3, Some(1), Some(Begin::TakeOver)),
    ] {
        let mut robot = robot();
        let admission = Admission {
            generation,
            ..ADMISSION
        };
        robot.admitted(admission, [], &mut Vec::new());
        let mut out = Vec::new();
        if let Some(named) = names {
            robot.news(1, tick, joined(named), (), &mut out);
        }
        robot.clock(clock(1, tick), &mut out);

        let begun = out.iter().find_map(|action| match action {
            ParticipantOutput::Run(turn) => Some(turn.begin),
            _ => None,
        });
        assert_eq!(
            begun, begins,
            "{generation} in tick {tick}, named {names:?}"
        );
    }
}

#[test]
fn a_simulator_that_is_gone_twice_is_timed_from_the_first_time() {
    let mut robot = running();
    let mut out = Vec::new();
    robot.simulator(false, &mut out);
    robot.simulator(false, &mut out);
    assert_eq!(out.len(), 1);
}

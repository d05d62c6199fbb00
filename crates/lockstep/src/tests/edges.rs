//! The edges of rules: each was found by a change of one expression that no other test noticed (`.ci/mutants`).

use std::time::Duration;

use protocol::RobotName;
use protocol::messages::{NEWS_FLAGS, OnLate};

use super::barrier::{Outputs, Simulator, gathered, granted, lateness, open, report};
use super::participant::{Robot, robot, run, running};
use super::{clock, joined, name};
use crate::{
    Admission, Barrier, Begin, IncarnationNotice, ParticipantOutput, RobotTimer, Timer, Timing,
};

#[test]
fn a_robot_that_has_missed_tick_0_is_named_until_it_reports() {
    let mut barrier = gathered(lateness(OnLate::Continue, 9));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    barrier.timer(&Timer::Deadline, &mut Vec::new());

    let out = open(&mut barrier, 1);

    assert_eq!(granted(&out).0, [(name("B"), joined(1))]);
}

#[test]
fn two_robots_with_news_and_one_flag_do_not_clear_it() {
    let roster: Vec<RobotName> = (0..=NEWS_FLAGS)
        .map(|number| name(&format!("R{number:02}")))
        .collect();
    let policy = lateness(OnLate::Wait, 1);
    let mut barrier: Simulator = Barrier::new(roster.clone(), policy.clone(), Timing::default(), 4);
    let mut out = Outputs::new();
    barrier.gather(1, policy, &mut out);
    for robot in &roster {
        barrier.join(robot, "first", &mut out).expect("joins");
        barrier.token(robot, true, &mut out);
    }
    out.clear();

    let both = [roster[0].clone(), roster[NEWS_FLAGS].clone()];
    barrier.open(0, both.into(), &mut out);

    assert_eq!(granted(&out).1, 1);
}

/// How soon the clock is put again, and where the search for a robot that is awaited begins, decide nothing: states of the model that
/// differ in no more are one.
#[test]
fn barriers_that_decide_the_same_are_equal() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    let mut other = barrier.clone();
    other.timer(&Timer::Repeat, &mut Vec::new());
    assert!(barrier == other);

    report(&mut other, "A", 0);
    assert!(barrier != other);
}

fn admitted_to_epoch_2() -> Robot {
    let mut robot = robot();
    let admission = Admission {
        epoch: 2,
        generation: 1,
        news_flag: 1,
    };
    robot.admitted(admission, [], &mut Vec::new());
    robot
}

#[test]
fn what_is_of_an_epoch_before_the_first_one_leaves_no_trace() {
    let mut robot = admitted_to_epoch_2();
    let before = robot.clone();
    let mut out = Vec::new();

    robot.clock(clock(1, 0), &mut out);
    robot.news(1, 0, IncarnationNotice::default(), (), &mut out);

    assert_eq!(out, []);
    assert!(robot == before);
}

#[test]
fn the_clock_of_the_tick_that_runs_does_not_interrupt_it() {
    let mut robot = running();

    robot.clock(clock(1, 1), &mut Vec::new());
    robot.clock(clock(1, 0), &mut Vec::new());

    assert!(!robot.is_interrupted());
}

#[test]
fn news_of_a_later_tick_stay_when_their_predecessors_are_used() {
    let mut robot = running();
    let with_news = |tick| protocol::messages::Clock {
        news: 1,
        ..clock(1, tick)
    };
    for tick in [2, 3] {
        robot.news(1, tick, IncarnationNotice::default(), (), &mut Vec::new());
        robot.done(Vec::new(), "done", (), &mut Vec::new());
    }
    robot.clock(with_news(2), &mut Vec::new());
    robot.done(Vec::new(), "of tick 2", (), &mut Vec::new());

    let mut out = Vec::new();
    robot.clock(with_news(3), &mut out);

    let ran = out.iter().any(|action| match action {
        ParticipantOutput::Run(turn) => turn.tick == 3 && turn.news.is_some(),
        _ => false,
    });
    assert!(ran, "{out:?}");
    assert_ne!(out[0], run(1, 3, Begin::GoOn), "with its news");
}

#[test]
fn the_first_time_counts() {
    let mut robot = running();
    let mut out = Vec::new();
    robot.simulator(false, &mut out);
    let gone = ParticipantOutput::SetTimer(RobotTimer::Gone, Duration::from_secs(1));
    assert_eq!(out, [gone]);

    robot.ask(&name("B"), &mut out);
    out.clear();
    robot.timer(RobotTimer::Waiting, &mut out);
    assert!(matches!(out[..], [ParticipantOutput::PutWaiting { .. }]));
}

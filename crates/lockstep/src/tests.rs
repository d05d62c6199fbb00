//! Rules that are local to one of the two types.

use std::collections::BTreeSet;
use std::time::Duration;

use protocol::RobotName;
use protocol::messages::{Clock, FaultKind, OnLate, Refusal};

use crate::states::States;
use crate::{
    Action, Admission, Attendance, Barrier, Begin, Ignored, IncarnationNotice, Lateness, Leave,
    Membership, NoState, Outcome, Output, Participant, Refused, RobotTimer, Sent, Stamp,
    StateQuery, Timeouts, Timer, Timing, Turn,
};

type Simulator = Barrier<&'static str, &'static str>;
type Outputs = Vec<Output<&'static str, &'static str>>;

fn name(name: &str) -> RobotName {
    RobotName::new(name).expect("a name")
}

fn lateness(on_late: OnLate, lose_after: u32) -> Lateness {
    Lateness {
        on_late,
        own: Default::default(),
        deadline: Duration::from_secs(1),
        lose_after,
    }
}

/// A barrier with A and B, both connected, before tick 0.
fn gathered(lateness: Lateness) -> Simulator {
    let mut out = Vec::new();
    let roster = [name("A"), name("B")];
    let mut barrier = Barrier::new(roster, lateness.clone(), Timing::default(), 4);
    barrier.gather(1, lateness, &mut out);
    for robot in ["A", "B"] {
        barrier.join(&name(robot), robot, &mut out).expect("joins");
        barrier.token(&name(robot), true, &mut out);
    }

    assert!(out.contains(&Output::Gathered), "{out:?}");
    barrier
}

fn report(barrier: &mut Simulator, robot: &str, tick: u64) -> Outputs {
    let mut out = Vec::new();
    let stamp = Stamp {
        epoch: 1,
        tick,
        generation: 1,
    };
    barrier.report(&name(robot), stamp, 0, "report", &mut out);
    out
}

fn open(barrier: &mut Simulator, tick: u64) -> Outputs {
    let mut out = Vec::new();
    barrier.open(tick, BTreeSet::new(), &mut out);
    out
}

fn outcome(out: Outputs) -> Option<Outcome<&'static str, &'static str>> {
    out.into_iter().find_map(|output| match output {
        Output::Complete(outcome) => Some(outcome),
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

    assert!(out.contains(&Output::SetTimer(timer, Timing::default().token)));
    assert_eq!(early, Err(Refused::NameTaken));
    assert_eq!(late.map(|admission| admission.generation), Ok(3));
}

#[test]
fn a_held_clock_is_announced_once_and_released() {
    let mut barrier = gathered(lateness(OnLate::Wait, 1));
    open(&mut barrier, 0);
    report(&mut barrier, "A", 0);
    let mut first = Vec::new();
    let mut second = Vec::new();

    barrier.timer(&Timer::Announce, &mut first);
    barrier.timer(&Timer::Announce, &mut second);
    let complete = report(&mut barrier, "B", 0);

    assert_eq!(first, [Output::Held]);
    assert_eq!(second, []);
    assert_eq!(complete.first(), Some(&Output::Released));
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
}

#[test]
fn a_deadline_does_what_the_scenario_wants() {
    for (on_late, expected) in [
        (OnLate::Wait, vec![]),
        (OnLate::Abort, vec![Output::Aborted]),
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
    let mut barrier = gathered(Lateness {
        own,
        ..lateness(OnLate::Wait, 3)
    });
    open(&mut barrier, 0);
    let stands_in = |out: &Outputs| out.contains(&Output::StandIn(name("B")));

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

    assert_eq!(late, [Output::Ignored(Ignored::Stale, name("B"))]);
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
        to: name("B"),
        command: "stray",
    };
    barrier.command(&name("A"), stamp, 1, stray, &mut Vec::new());
    report(&mut barrier, "A", 0);

    let outcome = outcome(report(&mut barrier, "B", 0)).expect("the tick is complete");

    assert_eq!(outcome.reports[&name("A")], ("report", vec![]));
}

#[test]
fn the_last_two_states_are_kept() {
    let at = |epoch: Option<u32>, tick: Option<u64>| StateQuery { tick, epoch };
    let mut states = States::default();
    assert_eq!(states.answer(at(None, None)), Err(NoState::NotYet));

    for (epoch, tick) in [(1, 9), (2, 4), (2, 3), (2, 5), (1, 10)] {
        states.add(epoch, tick, (epoch, tick));
    }
    states.add(2, 5, (0, 0));

    assert_eq!(states.answer(at(None, None)), Ok((2, 5)));
    assert_eq!(states.answer(at(Some(2), Some(5))), Ok((2, 4)));
    assert_eq!(states.answer(at(Some(2), Some(6))), Ok((2, 5)));
    assert_eq!(states.answer(at(Some(2), Some(7))), Err(NoState::NotYet));
    assert_eq!(
        states.answer(at(Some(2), Some(8))),
        Err(NoState::OutOfRange)
    );
    assert_eq!(states.answer(at(Some(2), Some(4))), Err(NoState::Over));
    assert_eq!(
        states.answer(at(Some(2), Some(0))),
        Err(NoState::OutOfRange)
    );
    assert_eq!(states.answer(at(Some(1), Some(5))), Err(NoState::Over));
    assert_eq!(states.answer(at(Some(3), Some(1))), Err(NoState::NotYet));
}

type Robot = Participant<(), &'static str, (), ()>;

const ADMISSION: Admission = Admission {
    epoch: 1,
    generation: 1,
    news_flag: 1,
};

fn robot() -> Robot {
    let timeouts = Timeouts {
        join: Duration::from_secs(1),
        gone: Duration::from_secs(1),
    };
    Robot::new(timeouts, &mut Vec::new())
}

fn clock(epoch: u32, tick: u64) -> Clock {
    Clock {
        epoch,
        tick,
        ..Clock::default()
    }
}

#[test]
fn a_newcomer_asks_again_while_its_name_is_taken() {
    let mut robot = robot();
    let mut out = Vec::new();

    robot.refused(Refusal::NameTaken, &mut out);
    assert!(matches!(out[..], [Action::SetTimer(RobotTimer::Join, _)]));
    out.clear();
    robot.timer(RobotTimer::Join, &mut out);
    assert_eq!(out, [Action::Join]);
    out.clear();
    robot.timer(RobotTimer::JoinPatience, &mut out);
    assert_eq!(out, [Action::Leave(Leave::Refused(Refusal::NameTaken))]);
}

#[test]
fn a_robot_whose_name_is_taken_in_a_further_epoch_has_been_replaced() {
    let mut robot = robot();
    robot.admitted(ADMISSION, [], &mut Vec::new());
    let mut out = Vec::new();

    robot.clock(clock(2, 0), &mut out);
    robot.refused(Refusal::NameTaken, &mut out);

    assert_eq!(out, [Action::Join, Action::Leave(Leave::Replaced)]);
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

    assert_eq!(out.last(), Some(&Action::Leave(Leave::SimulatorGone)));
}

/// A robot that runs tick 1 of epoch 1, after it has answered tick 0.
fn running() -> Robot {
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

fn run(epoch: u32, tick: u64, begin: Begin) -> Action<(), &'static str, (), ()> {
    let has_news = begin == Begin::TakeOver;

    Action::Run(Turn {
        epoch,
        tick,
        begin,
        news: has_news.then_some(()),
    })
}

fn joined(generation: u32) -> IncarnationNotice {
    IncarnationNotice {
        joined: Some(generation),
        rejoin: None,
    }
}

#[test]
fn a_clock_of_an_epoch_that_has_not_begun_costs_a_welcome_and_nothing_else() {
    let mut robot = running();
    let mut out = Vec::new();

    for tick in 0..8 {
        robot.clock(clock(9, tick), &mut out);
        robot.news(9, tick, IncarnationNotice::default(), (), &mut out);
    }
    assert_eq!(out, [Action::Join]);
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

    assert!(matches!(&out[0], Action::Put(answer) if answer.tick == 1));
    let turn = Turn {
        epoch: 1,
        tick: 2,
        begin: Begin::GoOn,
        news: Some(()),
    };
    assert_eq!(out[1..], [Action::Run(turn)]);
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
    assert_eq!(out, [Action::Join]);
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
    assert!(matches!(&granted[0], Output::Grant { news, .. } if news[..] == [(name("B"), asked)]));

    let mut robot = running();
    let mut actions = Vec::new();
    robot.done(Vec::new(), "of epoch 1", (), &mut actions);
    actions.clear();
    robot.news(2, 2, asked, (), &mut actions);
    robot.clock(clock(2, 2), &mut actions);
    assert_eq!(actions, [Action::Join]);
    let admission = barrier.join(&name("B"), "B", &mut out).expect("joins");
    assert_eq!((admission.epoch, admission.generation), (2, 2));
    robot.admitted(admission, [], &mut actions);
    let taken_in = complete(&mut barrier, 3);
    let joins = Membership::Joined(name("B"), 2);
    assert!(
        matches!(&taken_in[0], Output::Grant { news, .. } if news[..] == [(name("B"), joined(2))])
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

/// The news and the clock's flags of the tick that was granted.
fn granted(out: &Outputs) -> (Vec<(RobotName, IncarnationNotice)>, u32) {
    let granted = out.iter().find_map(|output| match output {
        Output::Grant { news, clock } => Some((news.clone(), clock.news)),
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

//! A robot that talks too much does not hold the run: its report stays within what a message may hold. One that cannot go
//! on says so.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use protocol::Message;
use protocol::messages::{Clock, JoinAnswer};
use robot::{Action, BadParameters, Cars, LocalHost, Percept, Point, Robot};

/// Whether it has a variable that is too long.
struct Chatterbox(bool);

/// The tick in which it has nothing more to say.
const SILENT_AT: u64 = 3;

impl Robot for Chatterbox {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        (0..5000).for_each(|_| cars.log("\u{e9}".repeat(5000)));
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        if cars.tick() == SILENT_AT {
            cars.give_up("there is nothing left to say");
            cars.give_up("the first reason counts");
        }

        let secret = "s".repeat(if self.0 { 5000 } else { 0 });
        let action = Action {
            proposal: Point::new(f64::NAN, 1.0),
            speed_mps: f64::NAN,
            ..Action::stay(cars)
        };
        action
            .emotion("CALM")
            .behavior("TALK")
            .variable("x", f64::INFINITY)
            .variable("secret", secret)
    }
}

/// One of them, in a run of its own.
fn chatterbox(is_endless: bool) -> LocalHost {
    let welcome = br#"{"answer":"welcome","protocol":1,"run":"r","name":"A","generation":1,"epoch":1,"tick":0,"seed":1,
        "stream":"robot/A","tick_s":0.5,"field_m":[9,9],"body_m":0.6,"sensing_range_m":2,"location":{"x":1,"y":1},
        "roster":["A"],"parameters":{}}"#;
    let JoinAnswer::Welcome(welcome) = protocol::decode("join", "simulator", welcome).unwrap()
    else {
        unreachable!("it is a welcome")
    };
    LocalHost::new(vec![(Box::new(Chatterbox(is_endless)), *welcome)])
}

#[test]
fn a_robot_that_gives_up_says_why_and_reports_nothing() {
    let mut host = chatterbox(false);
    for tick in 0..SILENT_AT {
        let clock = Clock {
            epoch: 1,
            tick,
            ..Clock::default()
        };
        host.exchange(&clock, &mut |_| Percept::default()).unwrap();
    }
    let clock = Clock {
        epoch: 1,
        tick: SILENT_AT,
        ..Clock::default()
    };
    let error = host
        .exchange(&clock, &mut |_| Percept::default())
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "A gives up: there is nothing left to say"
    );
}

#[test]
fn reports_stay_within_the_limits_of_a_message() {
    let mut host = chatterbox(false);
    let clock = Clock {
        epoch: 1,
        ..Clock::default()
    };
    let reports = host.exchange(&clock, &mut |_| Percept::default()).unwrap();
    let report = reports.values().next().unwrap();
    assert_eq!(report.check(), Ok(()));
    assert!(protocol::encode(report).len() < protocol::codec::MAX_MESSAGE_BYTES / 2);
    assert!(
        report
            .log
            .last()
            .unwrap()
            .contains("state variable x is not a finite number")
    );
    assert_eq!(report.proposal, Point::new(1.0, 1.0));
}

#[test]
fn what_cannot_be_sent_ends_the_robot_with_the_reason() {
    let clock = Clock {
        epoch: 1,
        ..Clock::default()
    };
    let error = chatterbox(true)
        .exchange(&clock, &mut |_| Percept::default())
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "A says too much: state_variables.secret: 5000 bytes of text, more than the 4096 allowed"
    );
}

//! A robot that talks too much does not hold the run: its report stays within what a message may hold. One that cannot go
//! on says so.

use std::collections::{BTreeMap, BTreeSet};

use lockstep::Exchange;
use protocol::messages::{Correction, JoinAnswer, MAX_PAYLOAD_BYTES, TickUpdate, Welcome};
use protocol::{Message, RobotName};
use robot::{Action, BadParameters, Cars, LocalHost, Payload, Point, Robot};

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

/// What a robot with this name is told when it joins.
fn welcome(name: &str) -> Welcome {
    let text = r#"{"answer":"welcome","protocol":2,"run":"r","name":"NAME","generation":1,"epoch":1,"tick":0,"seed":1,
        "stream":"robot/NAME","tick_s":0.5,"field_m":[9,9],"body_m":0.6,"sensing_range_m":2,"location":{"x":1,"y":1},
        "roster":["NAME"],"parameters":{},"news_flag":1}"#;
    let text = text.replace("NAME", name);
    let answer = protocol::decode("join", "simulator", text.as_bytes()).unwrap();
    let JoinAnswer::Welcome(welcome) = answer else {
        unreachable!("it is a welcome")
    };

    *welcome
}

/// One of them, in a run of its own.
fn chatterbox(is_endless: bool) -> LocalHost {
    LocalHost::new(vec![(Box::new(Chatterbox(is_endless)), welcome("A"))])
}

#[test]
fn a_robot_that_gives_up_says_why_and_reports_nothing() {
    let mut host = chatterbox(false);
    for tick in 0..SILENT_AT {
        host.exchange(tick, &BTreeMap::new()).unwrap();
    }
    let error = host.exchange(SILENT_AT, &BTreeMap::new()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "A gives up: there is nothing left to say"
    );
}

#[test]
fn reports_stay_within_the_limits_of_a_message() {
    let mut host = chatterbox(false);
    let outcome = host.exchange(0, &BTreeMap::new()).unwrap();
    let (report, _) = outcome.reports.values().next().unwrap();
    assert_eq!(report.check(), Ok(()));
    assert!(protocol::encode(report.as_ref()).len() < protocol::codec::MAX_MESSAGE_BYTES / 2);
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
    let error = chatterbox(true).exchange(0, &BTreeMap::new()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "A says too much: state_variables.secret: 5000 bytes of text, more than the 4096 allowed"
    );
}

/// Sends so many commands of so many bytes to itself.
struct Commander {
    count: usize,
    bytes: usize,
}

impl Robot for Commander {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        for _ in 0..self.count {
            cars.set_robot_command("A", "c".repeat(self.bytes)).unwrap();
        }
        Action::stay(cars)
    }
}

#[test]
fn commands_beyond_the_limits_end_the_robot_with_the_reason() {
    for (count, bytes, reason) in [
        (
            1,
            4097,
            Some("4097 bytes of text, more than the 4096 allowed"),
        ),
        (1025, 1, Some("1025 entries, more than the 1024 allowed")),
        (1024, 4096, None),
    ] {
        let commander = Commander { count, bytes };
        let mut host = LocalHost::new(vec![(Box::new(commander), welcome("A"))]);
        let outcome = host.exchange(0, &BTreeMap::new());
        match reason {
            Some(reason) => {
                let error = outcome.unwrap_err().to_string();
                assert!(
                    error.starts_with("A says too much: command") && error.ends_with(reason),
                    "{error}"
                );
            }
            None => assert_eq!(outcome.unwrap().reports["A"].1.len(), count),
        }
    }
}

/// Sends a payload of so many bytes of JSON to all others.
struct Broadcaster(usize);

impl Robot for Broadcaster {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        // With its quotation marks.
        let text = "p".repeat(self.0 - 2);
        cars.broadcast("map", Payload::new(text.into()));
        Action::stay(cars)
    }
}

#[test]
fn a_payload_has_64_kib_at_most_and_a_broadcast_is_one_command() {
    for (bytes, is_fit) in [(MAX_PAYLOAD_BYTES, true), (MAX_PAYLOAD_BYTES + 1, false)] {
        let robot = Box::new(Broadcaster(bytes));
        let mut host = LocalHost::new(vec![(robot, welcome("A"))]);
        match host.exchange(0, &BTreeMap::new()) {
            Ok(outcome) => {
                assert!(is_fit);
                let (report, commands) = &outcome.reports["A"];
                assert_eq!((report.commands, commands.len()), (1, 1));
            }
            Err(error) => {
                assert!(!is_fit);
                let expected =
                    "A says too much: payload: 65537 bytes of JSON, more than the 65536 allowed";
                assert_eq!(error.to_string(), expected);
            }
        }
    }
}

/// Stays where it is.
struct Idle;

impl Robot for Idle {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        Action::stay(cars)
    }
}

#[test]
fn robots_that_share_a_news_flag_all_run_also_if_only_one_has_news() {
    let names: BTreeSet<String> = (0..70).map(|index| format!("R{index:02}")).collect();
    let robots = names
        .iter()
        .map(|name| (Box::new(Idle) as Box<dyn Robot>, welcome(name)));
    let mut host = LocalHost::new(robots.collect());
    host.exchange(0, &BTreeMap::new()).unwrap();

    let moved = RobotName::new("R33").unwrap();
    let place = Point::new(5.0, 6.0);
    let news = TickUpdate {
        epoch: 1,
        tick: 1,
        correction: Some(Correction {
            location: place,
            blocked: false,
        }),
        ..TickUpdate::default()
    };
    let outcome = host
        .exchange(1, &BTreeMap::from([(moved.clone(), news)]))
        .unwrap();
    let proposals: Vec<(String, Point)> = outcome
        .reports
        .iter()
        .map(|(name, (report, _))| (name.to_string(), report.proposal))
        .collect();
    let expected: Vec<(String, Point)> = names
        .into_iter()
        .map(|name| {
            let is_moved = name == moved.as_str();
            let at = if is_moved {
                place
            } else {
                Point::new(1.0, 1.0)
            };
            (name, at)
        })
        .collect();
    assert_eq!(proposals, expected);
}

/// Publishes 300 texts of 4000 bytes.
struct Librarian;

impl Robot for Librarian {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let mut action = Action::stay(cars);
        for book in 0..300 {
            action = action.variable(format!("book{book}"), "x".repeat(4000));
        }
        action
    }
}

/// Over the bus it could not be sent.
#[test]
fn a_report_that_is_no_message_ends_the_robot_also_in_one_process() {
    let mut host = LocalHost::new(vec![(Box::new(Librarian), welcome("A"))]);
    let error = host.exchange(0, &BTreeMap::new()).unwrap_err().to_string();
    assert!(
        error.starts_with("A says too much: its report: 12")
            && error.ends_with("bytes, more than the 1048576 allowed"),
        "{error}"
    );
}

/// Writes so many lines in each tick.
struct Writer(usize);

impl Robot for Writer {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        (0..self.0).for_each(|line| cars.log(format!("line {line}")));
        Action::stay(cars)
    }
}

#[test]
fn lines_that_are_left_out_of_the_log_are_told_once() {
    let logs = |count: usize| {
        let mut host = LocalHost::new(vec![(Box::new(Writer(count)), welcome("A"))]);
        [0, 1].map(|tick| {
            let outcome = host.exchange(tick, &BTreeMap::new()).unwrap();
            outcome.reports["A"].0.log.clone()
        })
    };

    let [first, second] = logs(512);
    assert_eq!((first.len(), second.len()), (512, 512));

    let [first, second] = logs(600);
    assert_eq!(
        first.last().unwrap(),
        "warning: 88 lines of the log were dropped: the limits are 4096 bytes a line, and 512 lines and 262144 bytes a tick"
    );
    assert_eq!((first.len(), second.len()), (513, 512));
}

//! The contract on the wire, spoken by hand: what is refused and how, and that nothing breaks.

use std::process;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use bus::{Bus, Declared, Role};
use protocol::keys::Keys;
use protocol::messages::{
    Clock, Command, Control, ControlAnswer, Delivery, JoinAnswer, LogKind, LogRecord,
    MAX_PAYLOAD_BYTES, OnLate, Payload, Performative, Point, PublicState, Refusal, Report,
    StateVariables, Status, Target, TickUpdate, Welcome,
};
use protocol::{PROTOCOL_VERSION, RobotName, RunName, decode, encode};
use serde_json::{Value, json};
use system_tests::processes::Running;
use system_tests::{Lab, PATIENCE, eventually, free_port, programs};

/// A simulator with robots A and B, and a session of our own.
struct Wire {
    lab: Lab,
    simulator: Running,
    endpoint: String,
    run: RunName,
    bus: Bus,
    keys: Keys,
}

const SCENARIO: &str = "duration = \"20 s\"\n[[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n\
                        [[robot]]\nname = \"B\"\nat = [\"3 m\", \"2 m\"]\n";

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

impl Wire {
    fn new(run: &str) -> Self {
        Self::with(run, "")
    }

    /// The same with more at the top of its scenario.
    fn with(run: &str, more: &str) -> Self {
        let lab = Lab::new();
        let scenario = lab.write("two.toml", &format!("{more}\n{SCENARIO}"));
        let endpoint = format!("tcp/127.0.0.1:{}", free_port());
        let mut command = process::Command::new(programs().join("cars-sim"));
        command
            .arg(scenario)
            .args(["--run", run, "--listen", &endpoint, "--paused", "--out"])
            .arg(lab.out());
        let simulator = Running::start(command, run, lab.out().join(run));
        let role = Role::Client {
            connect: endpoint.clone(),
            patience: Duration::from_secs(20),
        };
        let bus = Bus::open(&role, None).unwrap();
        let run = RunName::new(run).unwrap();
        let keys = Keys::new(&run);

        Self {
            lab,
            simulator,
            endpoint,
            run,
            bus,
            keys,
        }
    }

    fn ask(&self, key: &str, parameters: &str, body: &[u8]) -> Result<Vec<u8>, String> {
        let answer = eventually("an answer", || {
            self.bus.get(key, parameters, Some(body.to_vec())).unwrap()
        });
        answer.result
    }

    fn join(&self, request: &Value) -> JoinAnswer {
        let bytes = self
            .ask(&self.keys.join(), "", request.to_string().as_bytes())
            .unwrap();
        decode("join", "simulator", &bytes).unwrap()
    }

    fn request(&self, robot: &str, instance: &str) -> Value {
        json!({ "protocol": PROTOCOL_VERSION, "run": self.run, "name": robot, "instance": instance })
    }

    fn refused(&self, request: &Value) -> (Refusal, String) {
        match self.join(request) {
            JoinAnswer::Refused {
                reason,
                explanation,
            } => (reason, explanation),
            JoinAnswer::Welcome(_) => panic!("welcomed: {request}"),
        }
    }

    fn control(&self, control: &Control) -> Result<Status, String> {
        let bytes = self
            .ask(&self.keys.control(), "", &encode(control))
            .unwrap();
        match decode("control", "simulator", &bytes).unwrap() {
            ControlAnswer::Done(status) => Ok(*status),
            other @ (ControlAnswer::Setup(_) | ControlAnswer::Log { .. }) => {
                panic!("not asked for: {other:?}")
            }
            ControlAnswer::Refused { explanation, .. } => Err(explanation),
        }
    }

    fn status(&self) -> Status {
        self.control(&Control::Status).unwrap()
    }

    /// Lets the clock run.
    fn start(&self) {
        self.control(&Control::Start).unwrap();
    }

    /// The counts of ignored messages, once they are so many.
    fn ignored(&self, expected: u64) -> Status {
        eventually("the counts", || {
            let status = self.status();
            (status.ignored.values().sum::<u64>() == expected).then_some(status)
        })
    }

    /// The events of this kind, once the record has a tick.
    fn recorded(&self, tick: u64, kind: &str) -> Vec<Value> {
        let run = self.run.as_str();
        let is_over = |event: &Value| event["event"] == "tick" && event["tick"] == tick;

        eventually("the record", || {
            let bytes = self.lab.bytes(run);
            let is_whole = bytes.ends_with(b"\n");
            let mut events = if is_whole {
                self.lab.events(run)
            } else {
                vec![]
            };
            let has_tick = events.iter().any(is_over);
            events.retain(|event| event["event"] == kind);
            has_tick.then_some(events)
        })
    }
}

/// A robot by hand: a session, a token, and the clocks and news it gets.
struct Hand {
    bus: Bus,
    keys: Keys,
    name: RobotName,
    welcome: Welcome,
    clocks: Receiver<Clock>,
    news: Receiver<TickUpdate>,
    _declared: Vec<Declared>,
}

impl Hand {
    fn join(wire: &Wire, robot: &str) -> Self {
        let role = Role::Client {
            connect: wire.endpoint.clone(),
            patience: Duration::from_secs(20),
        };
        let bus = Bus::open(&role, None).unwrap();
        let own = name(robot);
        let (sender, clocks) = channel();
        let clock = bus.subscribe(&wire.keys.clock(), move |key, bytes| {
            let _ = sender.send(decode(key, "simulator", bytes).unwrap());
        });
        let (sender, news) = channel();
        let subscribed = bus.subscribe(&wire.keys.news(&own), move |key, bytes| {
            let _ = sender.send(decode(key, "simulator", bytes).unwrap());
        });
        let JoinAnswer::Welcome(welcome) = wire.join(&wire.request(robot, &bus.id())) else {
            panic!("refused")
        };

        let token = bus.token(&wire.keys.alive_robot(&own)).unwrap();
        let declared = vec![clock.unwrap(), subscribed.unwrap(), token];

        Self {
            bus,
            keys: wire.keys.clone(),
            name: own,
            welcome: *welcome,
            clocks,
            news,
            _declared: declared,
        }
    }

    fn clock(&self) -> Clock {
        self.clocks.recv_timeout(PATIENCE).expect("a clock")
    }

    /// The clock of a tick. Clocks of ticks before may come first: one that is held for long is repeated.
    fn clock_of(&self, tick: u64) -> Clock {
        let mut clock = self.clock();
        while clock.tick < tick {
            clock = self.clock();
        }
        assert_eq!(clock.tick, tick);
        clock
    }

    /// The news that belong to a clock, if the clock says that there are some.
    fn news_of(&self, clock: &Clock) -> Option<TickUpdate> {
        if clock.news & self.welcome.news_flag == 0 {
            return None;
        }
        // They were put before the clock, and on the same session.
        let is_of_clock = |news: &TickUpdate| (news.epoch, news.tick) == (clock.epoch, clock.tick);
        let found = self.news.try_iter().find(is_of_clock);

        Some(found.expect("news come before their clock"))
    }

    /// The commands that come with a clock.
    fn commands_of(&self, clock: &Clock) -> Vec<Delivery> {
        self.news_of(clock)
            .map(|news| news.commands)
            .unwrap_or_default()
    }

    fn command(&self, tick: u64, number: u32, text: &str) -> Command {
        Command {
            epoch: self.welcome.epoch,
            tick,
            generation: self.welcome.generation,
            number,
            command: text.into(),
            ..Command::default()
        }
    }

    fn put_command(&self, to: &str, command: &Command) {
        let key = self.keys.command(&name(to), &self.name);
        self.bus.put(&key, encode(command)).unwrap();
    }

    fn report(&self, tick: u64) -> Report {
        standing(&self.welcome, tick)
    }

    fn put(&self, report: &Report) {
        self.bus
            .put(&self.keys.report(&self.name), encode(report))
            .unwrap();
    }
}

/// The report of a robot that stands where its welcome has placed it.
pub(crate) fn standing(welcome: &Welcome, tick: u64) -> Report {
    Report {
        epoch: welcome.epoch,
        tick,
        generation: welcome.generation,
        proposal: welcome.location,
        speed_mps: 0.0,
        direction_rad: 0.0,
        emotion_state: "CALM".into(),
        behavior_state: "IDLE".into(),
        state_variables: StateVariables::new(),
        commands: 0,
        log: vec![],
        site_actions: Vec::new(),
        layer_actions: Vec::new(),
        velocity: None,
    }
}

/// Both robots by hand, tick 0 done.
fn ready(run: &str) -> (Wire, Hand, Hand) {
    ready_with(run, "")
}

/// The same with more at the top of the scenario.
fn ready_with(run: &str, more: &str) -> (Wire, Hand, Hand) {
    let wire = Wire::with(run, more);
    let (a, b) = (Hand::join(&wire, "A"), Hand::join(&wire, "B"));
    for hand in [&a, &b] {
        hand.clock_of(0);
        hand.put(&hand.report(0));
    }

    eventually("tick 0", || {
        (wire.status().phase == protocol::messages::Phase::Ready).then_some(())
    });

    (wire, a, b)
}

#[test]
fn a_robot_is_refused_with_a_reason() {
    let wire = Wire::new("wire-refuse");
    let mut unknown = wire.request("Zed", "1");
    let (reason, text) = wire.refused(&unknown);
    assert!(
        reason == Refusal::UnknownName && text.contains("A, B"),
        "{text}"
    );
    unknown["name"] = "A/B".into();
    let (reason, text) = wire.refused(&unknown);
    assert!(
        reason == Refusal::Malformed && text.contains("field name"),
        "{text}"
    );

    let mut other = wire.request("A", "1");
    other["protocol"] = 99.into();
    let (reason, text) = wire.refused(&other);
    assert!(
        reason == Refusal::OtherProtocol && text.contains("99"),
        "{text}"
    );

    let mut other = wire.request("A", "1");
    other["run"] = "elsewhere".into();
    let (reason, text) = wire.refused(&other);
    assert!(
        reason == Refusal::OtherRun && text.contains("elsewhere"),
        "{text}"
    );

    let a = Hand::join(&wire, "A");
    assert_eq!(
        (a.welcome.location, a.welcome.generation),
        (Point::new(2.0, 2.0), 1)
    );
    let (reason, text) = wire.refused(&wire.request("A", "somebody else"));
    assert!(
        reason == Refusal::NameTaken && text.contains("another living process"),
        "{text}"
    );
}

#[test]
fn unknown_fields_of_a_join_are_ignored() {
    let wire = Wire::new("wire-unknown");
    let mut request = wire.request("A", "1");
    request["favorite_color"] = "red".into();
    assert!(matches!(wire.join(&request), JoinAnswer::Welcome(_)));
}

#[test]
fn malformed_stale_and_foreign_reports_are_counted_and_change_nothing() {
    let (wire, a, b) = ready("wire-malformed");
    wire.start();
    for hand in [&a, &b] {
        hand.clock_of(1);
    }
    let report = a.keys.report(&a.name);
    a.bus.put(&report, b"not json".to_vec()).unwrap();
    a.bus
        .put(&report, br#"{"epoch":1,"tick":1}"#.to_vec())
        .unwrap();
    a.put(&a.report(7));
    a.put(&Report {
        generation: 9,
        ..a.report(1)
    });
    a.put(&Report {
        epoch: 5,
        ..a.report(1)
    });
    a.bus
        .put(&a.keys.report(&name("Nobody")), encode(&a.report(1)))
        .unwrap();
    let status = wire.ignored(6);
    assert_eq!(status.tick, 0, "the tick is still open");
    assert_eq!(
        status.ignored,
        [
            ("malformed".into(), 2),
            ("stale".into(), 3),
            ("unknown robot".into(), 1)
        ]
        .into()
    );
    // The tick goes on as if nothing had happened.
    a.put(&a.report(1));
    b.put(&b.report(1));
    a.clock_of(2);
}

#[test]
fn a_second_report_for_the_same_tick_changes_nothing() {
    let (_wire, a, b) = ready("wire-twice");
    let wire = _wire;
    wire.start();
    a.clock_of(1);
    a.put(&a.report(1));
    a.put(&Report {
        proposal: Point::new(2.2, 2.0),
        ..a.report(1)
    });
    b.put(&b.report(1));
    let news = a.news_of(&a.clock_of(2));
    assert!(news.is_none_or(|news| news.correction.is_none()));

    let lines = eventually("tick 1", || {
        let text = std::fs::read_to_string(wire.lab.file("wire-twice", "events.jsonl")).unwrap();
        text.contains("\"tick\":1,").then_some(text)
    });
    assert!(!lines.contains("blocked"));
}

#[test]
fn malformed_stale_and_foreign_commands_are_counted_and_change_nothing() {
    let (wire, a, b) = ready("wire-commands");
    wire.start();
    for hand in [&a, &b] {
        hand.clock_of(1);
    }
    let key = a.keys.command(&b.name, &a.name);
    a.bus.put(&key, b"not json".to_vec()).unwrap();
    a.put_command("B", &a.command(1, 1, &"c".repeat(5000)));
    for (tick, number) in [(0, 1), (2, 1), (1, 0), (1, 1025)] {
        a.put_command("B", &a.command(tick, number, "stale"));
    }
    a.put_command(
        "B",
        &Command {
            generation: 9,
            ..a.command(1, 1, "stale")
        },
    );
    a.put_command(
        "B",
        &Command {
            epoch: 5,
            ..a.command(1, 1, "stale")
        },
    );
    let foreign = a.keys.command(&b.name, &name("Zed"));
    a.bus
        .put(&foreign, encode(&a.command(1, 1, "foreign")))
        .unwrap();
    let status = wire.ignored(9);
    assert_eq!(status.tick, 0, "the tick is still open");
    assert_eq!(
        status.ignored,
        [
            ("malformed".into(), 2),
            ("stale".into(), 4),
            ("too many commands".into(), 2),
            ("unknown robot".into(), 1)
        ]
        .into()
    );

    a.put(&a.report(1));
    b.put(&b.report(1));
    let clock = b.clock_of(2);
    assert_eq!(b.commands_of(&clock), []);
    assert_eq!(wire.recorded(1, "command_sent"), Vec::<Value>::new());
}

#[test]
fn an_outbox_takes_commands_to_one_and_to_all_others_with_payloads() {
    let (wire, a, b) = ready("wire-outbox");
    wire.start();
    a.clock_of(1);
    b.clock_of(1);
    b.put(&b.report(1));
    // With its quotation marks.
    let text = |bytes: usize| Payload::new("p".repeat(bytes - 2).into());
    let put = |number: u32, to: Option<Target>, payload: Option<Payload>| {
        let command = Command {
            to,
            payload,
            ..a.command(1, number, "map")
        };
        let outbox = a.keys.outbox(&a.name);
        a.bus.put(&outbox, encode(&command)).unwrap();
    };
    put(1, None, None);
    put(1, Some(Target::Others), text(MAX_PAYLOAD_BYTES + 1));
    put(1, Some(Target::Others), text(MAX_PAYLOAD_BYTES));
    put(
        2,
        Some(Target::Robot(b.name.clone())),
        Payload::new(serde_json::json!({ "bid": 0.1 })),
    );
    // Both keys have one series of numbers.
    a.put_command("B", &a.command(1, 3, "plain"));
    let status = wire.ignored(2);
    let ignored = [("malformed".into(), 1), ("unknown robot".into(), 1)];
    assert_eq!(status.ignored, ignored.into());
    a.put(&Report {
        commands: 3,
        ..a.report(1)
    });

    let clock = b.clock_of(2);
    let arrived = b.commands_of(&clock);
    let payloads: Vec<_> = arrived.iter().map(|one| one.payload.clone()).collect();
    let expected = [
        text(MAX_PAYLOAD_BYTES),
        Payload::new(serde_json::json!({ "bid": 0.1 })),
        None,
    ];
    assert_eq!(payloads, expected);
    let a_clock = a.clock_of(2);
    assert_eq!(a.commands_of(&a_clock), []);
}

#[test]
fn a_report_counts_when_all_its_commands_are_here_and_they_count_in_the_order_of_their_numbers() {
    let (wire, a, b) = ready("wire-numbers");
    wire.start();
    a.clock_of(1);
    b.clock_of(1);
    b.put(&b.report(1));
    a.put_command("B", &a.command(1, 3, "third"));
    a.put_command("B", &a.command(1, 1, "first"));
    let report = Report {
        commands: 3,
        ..a.report(1)
    };
    a.put(&report);

    // The second command is lost. The same clock comes again at once, and a repetition is the same message.
    assert_eq!(a.clock().tick, 1);
    assert_eq!(wire.status().tick, 0, "the tick is still open");
    for (number, text) in [(1, "changed"), (2, "second"), (3, "third")] {
        a.put_command("B", &a.command(1, number, text));
    }
    a.put(&report);
    let clock = b.clock_of(2);
    let commands = b.commands_of(&clock);
    assert_eq!(
        commands,
        ["first", "second", "third"].map(|text| Delivery {
            from: name("A"),
            performative: Performative::Achieve,
            command: text.into(),
            payload: None,
        })
    );
    let sent = wire.recorded(1, "command_sent");
    let numbers: Vec<_> = sent
        .iter()
        .map(|event| (&event["seq"], &event["command"]))
        .collect();
    assert_eq!(
        numbers,
        [
            (&json!(1), &json!("first")),
            (&json!(2), &json!("second")),
            (&json!(3), &json!("third"))
        ]
    );
}

#[test]
fn commands_that_never_arrive_as_their_report_counts_them_are_named() {
    let (wire, a, b) = ready("wire-missing");
    let (sender, lines) = channel::<LogRecord>();
    let log = wire.bus.subscribe(&wire.keys.log(), move |key, bytes| {
        let _ = sender.send(decode(key, "simulator", bytes).unwrap());
    });
    let _log = log.unwrap();
    let named = |robot: &str, number: u32| {
        let begin = format!(
            "{robot} counts 2 in `commands` of its report of tick 1, but no command with the number {number} has arrived"
        );
        let is_named = |line: LogRecord| line.text.starts_with(&begin);
        eventually("the line", || lines.try_iter().any(is_named).then_some(()));
    };
    wire.start();
    a.clock_of(1);
    b.clock_of(1);

    // A begins to count for each target; B's commands are of another incarnation than its report.
    for to in ["B", "A"] {
        a.put_command(to, &a.command(1, 1, "first"));
    }
    for number in [1, 2] {
        let command = Command {
            generation: 2,
            ..b.command(1, number, "foreign")
        };
        b.put_command("A", &command);
    }
    for hand in [&a, &b] {
        hand.put(&Report {
            commands: 2,
            ..hand.report(1)
        });
    }
    named("A", 2);
    // Lines come in the order of names, and the first look finds both.
    named("B", 1);
    assert_eq!(wire.status().tick, 0, "the tick is still open");

    // Corrected, they count: nothing was taken for what it is not.
    a.put_command("B", &a.command(1, 2, "second"));
    for number in [1, 2] {
        b.put_command("A", &b.command(1, number, "own"));
    }
    let clock = b.clock_of(2);
    let arrived = b.commands_of(&clock);
    let texts: Vec<_> = arrived.iter().map(|one| one.command.as_str()).collect();
    assert_eq!(texts, ["first", "second"]);
}

#[test]
fn an_operators_put_from_any_client_is_executed_and_recorded() {
    let (wire, a, b) = ready("wire-operator");
    let put = |to: &str, bytes: &[u8]| {
        let key = wire.keys.command(&name(to), &RobotName::operator());
        wire.bus.put(&key, bytes.to_vec()).unwrap();
    };
    put("B", br#"{"command":"refill"}"#);
    put("Zed", br#"{"command":"refill"}"#);
    put("B", br#"{"order":"refill"}"#);
    wire.start();
    assert_eq!(
        wire.ignored(2).ignored,
        [("malformed".into(), 1), ("unknown robot".into(), 1)].into()
    );
    let clocks = [a.clock_of(1), b.clock_of(1)];
    let delivery = Delivery {
        from: RobotName::operator(),
        performative: Performative::Achieve,
        command: "refill".into(),
        payload: None,
    };
    assert_eq!(a.commands_of(&clocks[0]), []);
    assert_eq!(b.commands_of(&clocks[1]), [delivery]);

    a.put(&a.report(1));
    b.put(&b.report(1));
    for (kind, rest) in [
        (
            "command_sent",
            json!({ "seq": 1, "performative": "achieve", "command": "refill" }),
        ),
        ("command_delivered", json!({ "seq": 1 })),
    ] {
        let mut expected = json!({ "tick": 1, "event": kind, "from": "operator", "to": "B" });
        expected
            .as_object_mut()
            .unwrap()
            .extend(rest.as_object().unwrap().clone());
        assert_eq!(wire.recorded(1, kind), [expected]);
    }
}

#[test]
fn a_command_to_a_robot_outside_the_roster_is_recorded_as_dropped() {
    let (wire, a, b) = ready("wire-unknown-target");
    wire.start();
    a.clock_of(1);
    b.clock_of(1);

    a.put_command("Zed", &a.command(1, 1, "come"));
    a.put(&Report {
        commands: 1,
        ..a.report(1)
    });
    b.put(&b.report(1));

    for hand in [&a, &b] {
        hand.clock_of(2);
        hand.put(&hand.report(2));
    }

    assert_eq!(
        wire.recorded(2, "command_dropped"),
        [
            json!({ "tick": 2, "event": "command_dropped", "from": "A", "to": "Zed", "seq": 1,
            "because": "unknown" })
        ]
    );

    assert_eq!(wire.recorded(2, "command_sent").len(), 1);
}

#[test]
fn a_command_to_a_robot_that_misses_the_tick_is_recorded_as_dropped() {
    let (wire, a, b) = ready_with("wire-missed", "lose_after = 100");
    wire.start();
    a.clock_of(1);
    b.clock_of(1);
    a.put_command("B", &a.command(1, 1, "late"));
    a.put(&Report {
        commands: 1,
        ..a.report(1)
    });
    b.put(&b.report(1));

    // B gets it in time, and does not answer.
    let clock = b.clock_of(2);
    assert_eq!(b.commands_of(&clock).len(), 1);
    let late = Control::Late {
        robot: Some(b.name.clone()),
        on_late: Some(OnLate::Continue),
        deadline_s: Some(1.0),
    };
    wire.control(&late).unwrap();
    a.clock_of(2);
    a.put(&a.report(2));
    a.clock_of(3);
    assert_eq!(
        wire.recorded(2, "command_dropped"),
        [
            json!({ "tick": 2, "event": "command_dropped", "from": "A", "to": "B", "seq": 1,
            "because": "missed" })
        ]
    );
    assert_eq!(wire.recorded(2, "command_delivered"), Vec::<Value>::new());
    let missed = wire.recorded(2, "missed");
    assert_eq!(
        missed,
        [json!({ "tick": 2, "event": "missed", "robot": "B" })]
    );
}

#[test]
fn more_commands_than_news_hold_are_recorded_as_dropped_and_the_run_goes_on() {
    const COUNT: u32 = 200;
    let (wire, a, b) = ready("wire-overflow");
    wire.start();
    a.clock_of(1);
    b.clock_of(1);
    let long = "c".repeat(4096);
    for number in 1..=COUNT {
        a.put_command("B", &a.command(1, number, &long));
    }
    a.put(&Report {
        commands: COUNT,
        ..a.report(1)
    });
    b.put(&b.report(1));

    let clock = b.clock_of(2);
    let arrived = b.commands_of(&clock).len();
    assert!((100..COUNT as usize).contains(&arrived), "{arrived}");
    a.put(&a.report(2));
    b.put(&b.report(2));
    b.clock_of(3);
    let dropped = wire.recorded(2, "command_dropped");
    assert_eq!(dropped.len() + arrived, COUNT as usize);
    assert!(
        dropped.iter().all(|event| event["because"] == "overflow"),
        "{dropped:?}"
    );
    assert_eq!(wire.recorded(2, "command_delivered").len(), arrived);
}

#[test]
fn the_last_lines_of_the_log_are_told_within_bounds() {
    let (wire, a, b) = ready("wire-log");
    let told = || {
        let request = encode(&Control::Log);
        let bytes = wire.ask(&wire.keys.control(), "", &request).unwrap();
        match decode("control", "simulator", &bytes).unwrap() {
            ControlAnswer::Log { lines } => lines,
            other => panic!("not asked for: {other:?}"),
        }
    };
    let count = |lines: &[LogRecord], text: &str| -> usize {
        lines.iter().filter(|line| line.text == text).count()
    };
    let is_late = |line: &&LogRecord| line.kind == LogKind::Late;
    assert!(
        told()
            .iter()
            .any(|line| line.text.starts_with("initialized"))
    );

    // Many short lines, then a few that are as long as they may be, and longer in JSON.
    let long = "\"".repeat(4096);
    let short = (0..6).map(|_| vec!["short".to_owned(); 250]);
    let ticks: Vec<Vec<String>> = short.chain([vec![long.clone(); 100]]).collect();
    wire.start();
    for (tick, log) in (1..).zip(ticks) {
        let clock = a.clock_of(tick);
        b.clock_of(clock.tick);
        if tick == 7 {
            let lines = told();
            let late = lines.iter().filter(is_late).count();
            assert_eq!((lines.len(), count(&lines, "short")), (1024, 1024 - late));
        }
        a.put(&Report {
            log,
            ..a.report(tick)
        });
        b.put(&b.report(tick));
    }

    a.clock_of(8);
    let lines = told();
    let late: usize = lines.iter().filter(is_late).count();
    assert!(late < 8, "{late} lines about late robots");
    assert!((31..=32).contains(&count(&lines, &long)));
    assert_eq!(count(&lines, "short"), 0);
}

#[test]
fn malformed_and_impossible_controls_are_refused_with_a_reason() {
    let (wire, ..) = ready("wire-control");
    let raw = |text: &str| {
        let bytes = wire.ask(&wire.keys.control(), "", text.as_bytes()).unwrap();
        match decode("control", "simulator", &bytes).unwrap() {
            ControlAnswer::Refused { explanation, .. } => explanation,
            other => panic!("{text}: {other:?}"),
        }
    };

    for (text, reason) in [
        ("", "EOF"),
        ("{\"do\":\"dance\"}", "unknown variant `dance`"),
        ("{\"do\":\"step\"}", "missing field `n`"),
        ("{\"do\":\"step\",\"n\":0}", "1 to"),
        ("{\"do\":\"step\",\"n\":10000000}", "1 to"),
        ("{\"do\":\"speed\",\"factor\":-1}", "more than zero"),
        (
            "{\"do\":\"init\",\"seed\":9007199254740992}",
            "a seed is at most",
        ),
        (
            "{\"do\":\"command\",\"to\":\"A\",\"command\":\"x\"}",
            "unknown variant `command`",
        ),
    ] {
        let explanation = raw(text);
        assert!(explanation.contains(reason), "{text}: {explanation}");
    }

    assert_eq!(wire.status().tick, 0);
}

#[test]
fn a_lost_report_is_asked_for_again_by_repeating_the_clock() {
    let (wire, a, b) = ready("wire-lost");
    wire.start();
    a.clock_of(1);
    b.clock_of(1);
    b.put(&b.report(1));
    // A's report is lost. The same clock comes again, and the tick is done when A repeats.
    assert_eq!(a.clock().tick, 1);
    a.put(&a.report(1));
    while b.clock().tick < 2 {}
}

#[test]
fn a_newcomer_is_told_all_that_others_may_still_ask_for() {
    let (wire, a, b) = ready("wire-return");
    wire.start();
    a.clock_of(1);
    b.clock_of(1);

    // A does tick 1 and is gone; B is still in it, and may ask for what A reported for tick 0.
    a.put(&a.report(1));
    drop(a);
    let welcome = eventually("the place of A to be free", || {
        match wire.join(&wire.request("A", "next")) {
            JoinAnswer::Welcome(welcome) => Some(welcome),
            JoinAnswer::Refused { .. } => None,
        }
    });
    let tick = |state: &Option<PublicState>| state.as_ref().map(|state| state.tick);
    assert_eq!(
        (tick(&welcome.last_state), tick(&welcome.state_before)),
        (Some(1), Some(0))
    );
    assert_eq!((welcome.generation, welcome.tick), (2, 0));

    drop(b);
}

#[test]
fn queries_answer_with_the_tick_before() {
    // A real robot asked by hand: Leguin, in a run that is stepped.
    let lab = Lab::new();
    let mut launch = lab.start(
        "wire-query",
        &["launch", "launch/hors_doeuvres.toml", "--paused"],
    );
    let endpoint = eventually("the endpoint", || {
        std::fs::read_to_string(lab.file("wire-query", "endpoint"))
            .ok()
            .map(|text| text.trim().to_owned())
    });
    let bus = Bus::open(
        &Role::Client {
            connect: endpoint,
            patience: PATIENCE,
        },
        None,
    )
    .unwrap();
    let keys = Keys::new(&RunName::new("wire-query").unwrap());
    lab.until_ready("wire-query");
    lab.step("wire-query", 7);

    let ask = |what: &str, parameters: &str| {
        let key = keys.query(&name("Leguin"), what);
        let answer = bus.get_within(&key, parameters, None, PATIENCE).unwrap();
        answer.expect("Leguin answers").result
    };
    let state = |parameters: &str| {
        decode::<PublicState>("state", "Leguin", &ask("state", parameters).unwrap()).unwrap()
    };
    assert_eq!(state("").tick, 7);
    assert_eq!(state("tick=8;epoch=1").tick, 7);
    assert_eq!(state("tick=7;epoch=1").tick, 6);
    assert!(ask("state", "tick=3;epoch=1").unwrap_err().contains("over"));

    // At once, and not when the tick has come: the one who asks asks again.
    for early in ["tick=9;epoch=1", "tick=8;epoch=2"] {
        let refused = ask("state", early).unwrap_err();
        assert!(refused.contains("not been reported yet"), "{refused}");
    }

    let refused = ask("state", "tick=10;epoch=1").unwrap_err();
    assert!(refused.contains("out of range"), "{refused}");
    assert!(
        ask("state", "tick=x")
            .unwrap_err()
            .contains("not a whole number")
    );

    for (what, expected) in [
        ("behavior_state", json!("WAIT")),
        ("emotion_state", json!("HAPPY")),
        ("speed", json!(0.0)),
    ] {
        let answer: Value = serde_json::from_slice(&ask(what, "").unwrap()).unwrap();
        assert_eq!((&answer["value"], &answer["tick"]), (&expected, &json!(7)));
    }

    // Together, each on its own key.
    for what in ["emotion_state", "state"] {
        let replies = bus.get_all(&keys.queries(what), "", PATIENCE).unwrap();
        let mut answered: Vec<String> = replies.into_iter().map(|reply| reply.key).collect();
        answered.sort();
        let own = ["Butler", "Leguin"].map(|robot| keys.query(&name(robot), what));
        assert_eq!(answered, own);
    }

    lab.ok(&["ctl", "stop", "--run", "wire-query"]);
    launch.finish();
}

#[test]
fn the_simulator_survives_rubbish_on_its_port() {
    let (mut wire, a, b) = ready("wire-rubbish");
    let address = wire.endpoint.trim_start_matches("tcp/").to_owned();

    for rubbish in [&b"GET / HTTP/1.1\r\n\r\n"[..], &[0; 4096], &[0xff; 4096]] {
        let mut stream = std::net::TcpStream::connect(&address).unwrap();
        let _ = std::io::Write::write_all(&mut stream, rubbish);
    }

    wire.start();

    for tick in 1..=40 {
        for hand in [&a, &b] {
            hand.clock_of(tick);
            hand.put(&hand.report(tick));
        }
    }

    let mut last = a.clock();
    while last.end.is_none() {
        last = a.clock();
    }
    assert_eq!(last.end, Some(protocol::messages::End::Finished));

    drop((a, b));
    wire.simulator.finish();
}

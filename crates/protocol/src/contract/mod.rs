//! The contract: what is written is read back, what is malformed is named, schemas are up to date.

mod asyncapi;
mod schema;

use std::path::{Path, PathBuf};

use protocol::messages::{
    Clock, Command, Control, Correction, Delivery, End, Face, JoinRequest, LayerAction,
    LayerRefusal, LayerResult, LogRecord, MAX_ENTRIES, MAX_LAYER_ACTIONS, MAX_SITE_ACTIONS,
    MAX_SITE_VARIABLES, MAX_TEXT_BYTES, NEWS_FLAGS, Panel, Payload, Performative, Point, Pose,
    Report, SensedBody, SensedKind, SensedLayer, SensedRobot, SensedRow, SensedSite, SiteAction,
    SiteRefusal, SiteResult, Target, TickPanel, TickUpdate, Tone, Variable, Velocity, Widget,
};
use protocol::{Message, RobotName, RunName, decode, encode};
use serde::Serialize;

use schema::{EVENT, MESSAGES, MessageSchema, RECORDED};

fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

fn report() -> Report {
    Report {
        epoch: 1,
        tick: 12,
        generation: 1,
        proposal: Point::new(0.1 + 0.2, 1e-300),
        speed_mps: 1.0 / 3.0,
        direction_rad: -3.0,
        emotion_state: "HAPPY".into(),
        behavior_state: "SERVE".into(),
        state_variables: [
            ("treats", 7.0.into()),
            ("need", true.into()),
            ("who", "x".into()),
        ]
        .into(),
        commands: 3,
        log: vec!["jokes".into()],
        site_actions: vec![
            SiteAction::set("T3", "done", true)
                .and_add("stock", -1.0)
                .only_if("done", false),
        ],
        layer_actions: vec![LayerAction::add("dust", Point::new(0.1, 0.2), 0.3, -0.1)],
        velocity: Some(Velocity {
            linear_mps: -0.1,
            angular_radps: 1.0 / 3.0,
        }),
    }
}

fn news() -> TickUpdate {
    TickUpdate {
        epoch: 2,
        tick: 7,
        joined: Some(2),
        rejoin: Some(1),
        correction: Some(Correction {
            location: Point::new(1.0, 2.0),
            blocked: true,
        }),
        pose: Some(Pose {
            location: Point::new(1.0, 2.0),
            heading_rad: -0.5,
            velocity: Velocity::default(),
        }),
        commands: vec![Delivery {
            from: name("Butler"),
            performative: Performative::Achieve,
            command: "refill".into(),
            payload: Payload::new(serde_json::json!({ "level": 0.1 })),
        }],
        in_range: Some(vec![name("Leguin")]),
        unreachable: vec![name("Vonda")],
        sensed: vec![SensedRobot {
            name: name("Vonda"),
            location: Point::new(0.3, 0.7),
        }],
        ranges: vec![0.75, 5.0],
        sites: vec![SensedSite {
            name: "T3".into(),
            kind: "task".into(),
            location: Point::new(0.1, 0.2),
            state: [("done", true.into()), ("stock", 29.0.into())].into(),
        }],
        site_results: vec![
            SiteResult {
                site: "T3".into(),
                refused: None,
            },
            SiteResult {
                site: "T4".into(),
                refused: Some(SiteRefusal::OutOfRange),
            },
        ],
        layers: vec![SensedLayer {
            name: "dust".into(),
            cell_m: 0.1,
            rows: vec![SensedRow {
                row: 3,
                column: 4,
                values: vec![0.1 + 0.2, 1e-300],
            }],
        }],
        layer_results: vec![LayerResult {
            layer: "mist".into(),
            change: 0.0,
            refused: Some(LayerRefusal::UnknownLayer),
        }],
        bodies: vec![SensedBody {
            kind: SensedKind::Guest,
            location: Point::new(0.1 + 0.2, 1e-300),
        }],
    }
}

fn round_trip<M: Message + PartialEq + std::fmt::Debug>(message: &M) {
    let bytes = encode(message);
    assert_eq!(
        &decode::<M>("key", "sender", &bytes).unwrap(),
        message,
        "{}",
        String::from_utf8_lossy(&bytes)
    );
}

#[test]
fn what_is_written_is_read_back_to_the_last_bit() {
    round_trip(&report());
    round_trip(&news());
    round_trip(&Clock {
        epoch: 2,
        tick: 7,
        news: 1 << 31,
        panels: true,
        end: Some(End::Finished),
    });
    round_trip(&Command {
        epoch: 1,
        tick: 2,
        generation: 3,
        number: 4,
        to: Some(Target::Others),
        performative: Performative::Tell,
        command: "hurry".into(),
        payload: Payload::new(serde_json::json!([1, 0.1, "a", null, { "b": false }])),
    });
    round_trip(&JoinRequest {
        protocol: 2,
        run: RunName::new("demo").unwrap(),
        name: name("Butler"),
        instance: "a".into(),
        bodies: true,
        ranges: true,
        sdk: "rust".into(),
    });
    round_trip(&Control::Step { n: 10 });
    let widgets = vec![
        Widget::Face {
            face: Face::Happy,
            intensity: 0.5,
        },
        Widget::Badge {
            label: "emotion".into(),
            text: "HAPPY".into(),
            tone: Tone::Good,
        },
        Widget::Button {
            label: "Refill".into(),
            command: "refill".into(),
        },
    ];
    let panel = Panel { widgets };
    round_trip(&panel);
    round_trip(&TickPanel::new(2, 7, panel));
}

#[test]
fn a_quiet_clock_is_small() {
    let clock = Clock {
        epoch: 1,
        tick: 123_456,
        ..Clock::default()
    };
    assert_eq!(encode(&clock), br#"{"epoch":1,"tick":123456}"#);
}

/// The clock of a tick in which every robot of a roster has news.
fn full_clock(robots: usize) -> Clock {
    let flags = (0..robots).map(|index| 1_u32 << (index % NEWS_FLAGS));

    Clock {
        epoch: 1,
        tick: 123_456,
        news: flags.fold(0, |all, flag| all | flag),
        ..Clock::default()
    }
}

#[test]
fn the_size_of_a_clock_does_not_depend_on_the_number_of_robots() {
    let one_robot = encode(&full_clock(1)).len();
    let many_robots = encode(&full_clock(64)).len();
    let digits_of_flags = u32::MAX.to_string().len() - 1;

    assert_eq!(one_robot + digits_of_flags, many_robots);
    assert_eq!(encode(&full_clock(10_000)).len(), many_robots);
    let largest = Clock {
        epoch: u32::MAX,
        tick: (1 << 53) - 1,
        news: u32::MAX,
        panels: true,
        end: Some(End::Finished),
    };
    assert!(encode(&largest).len() < 100);
}

#[test]
fn news_of_nothing_are_empty() {
    let nothing = TickUpdate {
        epoch: 2,
        tick: 7,
        ..TickUpdate::default()
    };
    assert_eq!(encode(&nothing), br#"{"epoch":2,"tick":7}"#);
    assert!(nothing.is_empty());
    assert!(!news().is_empty());
}

/// The command of an operator needs nothing but its text.
#[test]
fn a_command_may_be_its_text_alone() {
    let command: Command = decode("key", "operator", br#"{"command":"refill"}"#).unwrap();
    let expected = Command {
        command: "refill".into(),
        ..Command::default()
    };
    assert_eq!(command, expected);
    assert_eq!(command.performative, Performative::Achieve);
}

#[test]
fn unknown_fields_are_ignored_and_absent_lists_are_empty() {
    let text = br#"{"epoch":1,"tick":2,"generation":1,"proposal":{"x":1,"y":2,"z":3},"speed_mps":0,"direction_rad":0,
        "emotion_state":"","behavior_state":"","weather":"fine"}"#;
    let report: Report = decode("key", "sender", text).unwrap();
    assert!(report.log.is_empty() && report.state_variables.is_empty());
    assert_eq!(report.commands, 0);
    assert_eq!(report.proposal, Point::new(1.0, 2.0));

    let text = br#"{"epoch":1,"tick":2,"weather":"fine"}"#;
    let clock: Clock = decode("key", "sender", text).unwrap();
    assert_eq!((clock.news, clock.end), (0, None));
    let news: TickUpdate = decode("key", "sender", text).unwrap();
    assert!(news.is_empty());
}

#[test]
fn whole_numbers_and_fractions_are_the_same_kind() {
    let as_whole: Variable = serde_json::from_str("7").unwrap();
    assert_eq!(as_whole, Variable::Number(7.0));
}

/// What is wrong, and which field is blamed for it.
#[test]
fn malformed_messages_are_named_by_key_sender_and_field() {
    let good = String::from_utf8(encode(&report())).unwrap();
    let key = "cars/demo/robot/Butler/report";
    for (from, to, field) in [
        (r#""tick":12"#, r#""tick":"twelve""#, "tick"),
        (r#""tick":12"#, r#""tick":-1"#, "tick"),
        (r#""tick":12,"#, "", "."),
        (r#""x":0.30000000000000004"#, r#""x":null"#, "proposal.x"),
        (
            r#""speed_mps":0.3333333333333333"#,
            r#""speed_mps":1e999"#,
            "speed_mps",
        ),
        (
            r#""treats":7.0"#,
            r#""treats":[7]"#,
            "state_variables.treats",
        ),
        (r#""commands":3"#, r#""commands":3.5"#, "commands"),
        (r#""commands":3"#, r#""commands":3.0"#, "commands"),
        (r#""tick":12"#, r#""tick":12.0"#, "tick"),
        (r#""commands":3"#, r#""commands":4294967296"#, "commands"),
        (r#"{"epoch""#, r#"["epoch""#, "[0]"),
        (
            r#""proposal":{"x":0.30000000000000004,"y":1e-300}"#,
            r#""proposal":[0.3,-2.0]"#,
            "proposal",
        ),
        (r#"333}}"#, r#"333}} trailing"#, "."),
        (
            r#""linear_mps":-0.1"#,
            r#""linear_mps":null"#,
            "velocity.linear_mps",
        ),
        (
            r#""add":{"stock":-1.0}"#,
            r#""add":{"stock":"x"}"#,
            "site_actions[0].add.stock",
        ),
        (r#""site":"T3""#, r#""site":7"#, "site_actions[0].site"),
        (
            r#""radius_m":0.3"#,
            r#""radius_m":-0.3"#,
            "layer_actions.radius_m",
        ),
        (r#""add":-0.1"#, r#""add":1e999"#, "layer_actions[0].add"),
        (r#","add":-0.1"#, "", "layer_actions"),
    ] {
        assert!(good.contains(from), "{from} is not in {good}");
        let error = decode::<Report>(key, "Butler", good.replace(from, to).as_bytes()).unwrap_err();
        assert_eq!((error.key.as_str(), error.sender.as_str()), (key, "Butler"));
        assert_eq!(error.field, field, "{to}: {error}");
        assert!(error.to_string().contains(key), "{error}");
    }
}

#[test]
fn malformed_news_are_named_by_key_sender_and_field() {
    let good = String::from_utf8(encode(&news())).unwrap();
    let key = "cars/demo/robot/Butler/news";
    for (from, to, field) in [
        (r#""epoch":2"#, r#""epoch":2.5"#, "epoch"),
        (r#""tick":7"#, r#""tick":9007199254740992"#, "tick"),
        (r#""joined":2"#, r#""joined":"two""#, "joined"),
        (r#""rejoin":1"#, r#""rejoin":true"#, "rejoin"),
        (
            r#""from":"Butler""#,
            r#""from":"But/ler""#,
            "commands[0].from",
        ),
        (
            r#""command":"refill""#,
            r#""command":7"#,
            "commands[0].command",
        ),
        (
            r#""unreachable":["Vonda"]"#,
            r#""unreachable":[7]"#,
            "unreachable[0]",
        ),
        (
            r#""out_of_range""#,
            r#""out_of_luck""#,
            "site_results[1].refused",
        ),
        (r#""kind":"guest""#, r#""kind":"ghost""#, "bodies[0].kind"),
    ] {
        assert!(good.contains(from), "{from} is not in {good}");
        let damaged = good.replacen(from, to, 1);
        let error = decode::<TickUpdate>(key, "simulator", damaged.as_bytes()).unwrap_err();
        assert_eq!(
            (error.key.as_str(), error.sender.as_str()),
            (key, "simulator")
        );
        assert_eq!(error.field, field, "{to}: {error}");
    }
}

#[test]
fn actions_on_sites_are_bounded() {
    let check = |actions: Vec<SiteAction>| {
        let report = Report {
            site_actions: actions,
            ..report()
        };
        decode::<Report>("key", "Butler", &encode(&report)).map_err(|error| error.field)
    };
    let one = SiteAction::set("T", "done", true);
    assert!(check(vec![one.clone(); MAX_SITE_ACTIONS]).is_ok());
    let many = check(vec![one.clone(); MAX_SITE_ACTIONS + 1]);
    assert_eq!(many.unwrap_err(), "site_actions");

    let with = |variables: usize| {
        let all = 0..variables;
        vec![all.fold(one.clone(), |action, i| {
            action.and_add(format!("v{i}"), 1.0)
        })]
    };
    assert!(check(with(MAX_SITE_VARIABLES)).is_ok());
    assert_eq!(
        check(with(MAX_SITE_VARIABLES + 1)).unwrap_err(),
        "site_actions"
    );
    let long = SiteAction::set("T".repeat(65), "done", true);
    assert_eq!(check(vec![long]).unwrap_err(), "site_actions.site");
}

#[test]
fn actions_on_layers_are_bounded() {
    let check = |actions: Vec<LayerAction>| {
        let report = Report {
            layer_actions: actions,
            ..report()
        };
        decode::<Report>("key", "Butler", &encode(&report)).map_err(|error| error.field)
    };
    let one = LayerAction::set("dust", Point::new(1.0, 2.0), 0.0, 1.0);
    assert!(check(vec![one.clone(); MAX_LAYER_ACTIONS]).is_ok());
    let many = check(vec![one; MAX_LAYER_ACTIONS + 1]);
    assert_eq!(many.unwrap_err(), "layer_actions");
    let long = LayerAction::set("d".repeat(65), Point::new(1.0, 2.0), 0.0, 1.0);
    assert_eq!(check(vec![long]).unwrap_err(), "layer_actions.layer");
}

#[test]
fn news_are_bounded() {
    let with_text = |bytes: usize| {
        let mut long = news();
        long.commands[0].command = "x".repeat(bytes);
        decode::<TickUpdate>("key", "simulator", &encode(&long))
    };
    assert!(with_text(MAX_TEXT_BYTES).is_ok());
    let error = with_text(MAX_TEXT_BYTES + 1).unwrap_err();
    assert_eq!(error.field, "commands.command");

    // Many robots may send to one, so there may be more commands than one robot may send; the message is bounded.
    let with_commands = |count: usize| {
        let mut many = news();
        many.commands = vec![many.commands[0].clone(); count];
        decode::<TickUpdate>("key", "simulator", &encode(&many))
    };
    assert!(with_commands(MAX_ENTRIES + 1).is_ok());
    let error = with_commands(100_000).unwrap_err();
    assert!(error.reason.contains("bytes"), "{error}");
}

/// serde reads a list as the fields of a type in their order, and no schema allows that.
#[test]
fn a_list_is_no_message() {
    let error = decode::<Clock>("cars/demo/clock", "simulator", b" [1, 2]").unwrap_err();
    assert_eq!(error.field, ".");
    assert_eq!(error.reason, "a list; a message is a JSON object");
}

/// A robot without emotions says nothing of them; one that loses or finds them does.
#[test]
fn lines_of_the_log_name_states_without_a_name() {
    let text = |from: Option<&str>, to: &str| {
        let event = protocol::Event::Behavior {
            robot: protocol::RobotName::new("A").unwrap(),
            from: from.map(str::to_owned),
            to: to.to_owned(),
        };
        event.log_record(1, 1, 0.5).map(|record| record.text)
    };
    assert_eq!(text(None, ""), None);
    assert_eq!(text(None, "REST").unwrap(), "behavior REST");
    assert_eq!(text(Some("REST"), "").unwrap(), "behavior REST -> none");
    assert_eq!(text(Some(""), "REST").unwrap(), "behavior none -> REST");
}

/// Two texts within the limits are in one line: what an event tells can be put on the bus.
#[test]
fn the_lines_of_the_log_fit_into_messages() {
    let long = "\u{e9}".repeat(MAX_TEXT_BYTES / 2);
    let robot = protocol::RobotName::new("A").unwrap();
    let change = protocol::Event::Emotion {
        robot: robot.clone(),
        from: Some(long.clone()),
        to: long,
    };
    let record = change.log_record(1, 1, 0.5).unwrap();
    assert_eq!(record.text.len(), "emotion  -> ".len() + 2 * MAX_TEXT_BYTES);
    assert!(decode::<LogRecord>("log", "simulator", &encode(&record)).is_ok());

    let endless = protocol::Event::Say {
        robot,
        text: "\u{e9}".repeat(10_000),
    };
    let record = endless.log_record(1, 1, 0.5).unwrap();
    assert!(record.text.ends_with("\u{e9}..."));
    assert!(decode::<LogRecord>("log", "simulator", &encode(&record)).is_ok());
}

#[test]
fn sizes_are_bounded() {
    let mut long = report();
    long.emotion_state = "x".repeat(5000);
    let error = decode::<Report>("key", "Butler", &encode(&long)).unwrap_err();
    assert_eq!(error.field, "emotion_state");

    let mut many = report();
    many.log = vec!["\u{e9}".repeat(MAX_TEXT_BYTES / 2) + "x"; MAX_ENTRIES / 8];
    many.log.resize(MAX_ENTRIES + 1, "y".to_owned());
    let kept = decode::<Report>("key", "Butler", &encode(&many))
        .unwrap()
        .log;
    assert_eq!(kept.len(), MAX_ENTRIES);
    assert_eq!(kept[0], "\u{e9}".repeat(MAX_TEXT_BYTES / 2));
    assert_eq!(kept[MAX_ENTRIES - 1], "y");

    let mut sent = report();
    sent.commands = MAX_ENTRIES as u32;
    assert!(decode::<Report>("key", "Butler", &encode(&sent)).is_ok());
    sent.commands += 1;
    let error = decode::<Report>("key", "Butler", &encode(&sent)).unwrap_err();
    assert_eq!(error.field, "commands");

    let command = Command {
        command: "x".repeat(MAX_TEXT_BYTES + 1),
        ..Command::default()
    };
    let error = decode::<Command>("key", "Butler", &encode(&command)).unwrap_err();
    assert_eq!(error.field, "command");

    let huge = vec![b' '; 2 << 20];
    assert!(
        decode::<Report>("key", "Butler", &huge)
            .unwrap_err()
            .reason
            .contains("bytes")
    );
    assert!(
        decode::<Panel>(
            "key",
            "x",
            &encode(&Panel {
                widgets: vec![Widget::Table { rows: vec![] }; 100]
            })
        )
        .is_err()
    );
}

#[test]
fn garbage_never_panics() {
    for seed in 0..2000 {
        let mut stream = protocol::random::stream(seed, "garbage");
        let len = rand::RngExt::random_range(&mut stream, 0..200);
        let bytes: Vec<u8> = (0..len)
            .map(|_| rand::RngExt::random(&mut stream))
            .collect();
        assert!(decode::<Report>("key", "x", &bytes).is_err());
        assert!(decode::<JoinRequest>("key", "x", &bytes).is_err());
        assert!(decode::<Clock>("key", "x", &bytes).is_err());
        assert!(decode::<TickUpdate>("key", "x", &bytes).is_err());
    }
}

#[test]
fn a_name_that_breaks_keys_cannot_be_a_run() {
    assert!(RunName::new("a/b").is_err());
}

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs")
}

/// A file has this value; with `CARS_UPDATE=1` it is written anew.
#[track_caller]
fn is_on_file(file: &Path, value: &impl Serialize) {
    let text = serde_json::to_string_pretty(value).unwrap() + "\n";
    if std::env::var_os("CARS_UPDATE").is_some() {
        std::fs::write(file, &text).unwrap();
    }

    let on_file = std::fs::read_to_string(file).unwrap_or_default();
    assert!(
        on_file == text,
        "{} is out of date: run the test with CARS_UPDATE=1",
        file.display()
    );
}

#[test]
fn the_schemas_on_file_are_those_of_the_types() {
    let folder = docs().join("schemas");
    for MessageSchema { name, whole, .. } in MESSAGES.iter().chain([&EVENT]) {
        is_on_file(&folder.join(format!("{name}.json")), &whole());
    }
    for MessageSchema { name, whole, .. } in &RECORDED {
        is_on_file(&folder.join(format!("recording/{name}.json")), &whole());
    }
}

#[test]
fn the_asyncapi_document_on_file_is_that_of_the_types() {
    is_on_file(&docs().join("asyncapi.json"), &asyncapi::document());
}

/// All values of `$ref` in a document.
fn references(value: &serde_json::Value) -> Vec<&str> {
    match value {
        serde_json::Value::Object(fields) => fields
            .iter()
            .flat_map(|(name, field)| match field.as_str() {
                Some(reference) if name == "$ref" => vec![reference],
                _ => references(field),
            })
            .collect(),
        serde_json::Value::Array(values) => values.iter().flat_map(references).collect(),
        _ => Vec::new(),
    }
}

#[test]
fn the_asyncapi_document_holds_together() {
    let document = asyncapi::document();
    let references = references(&document);
    assert!(references.len() > 100, "{}", references.len());
    for reference in references {
        let path = reference.strip_prefix('#').unwrap();
        assert!(
            document.pointer(path).is_some(),
            "{reference} leads nowhere"
        );
    }
    for (name, channel) in document["channels"].as_object().unwrap() {
        let address = channel["address"].as_str().unwrap();
        let parameters = channel["parameters"].as_object().unwrap();
        let open: Vec<&str> = address
            .split('/')
            .filter_map(|chunk| chunk.strip_prefix('{'))
            .collect();
        assert_eq!(open.len(), parameters.len(), "{name}: {address}");
        assert!(
            open.iter()
                .all(|chunk| parameters.contains_key(chunk.trim_end_matches('}'))),
            "{address}"
        );
        assert!(!address.contains('-'), "a placeholder is left in {address}");
    }
    // Every message that has a schema on file and travels has one here, too.
    let messages = document["components"]["messages"].as_object().unwrap();
    for file in std::fs::read_dir(docs().join("schemas")).unwrap() {
        let file = file.unwrap().path();
        if file.is_dir() {
            continue;
        }
        let name = file.file_stem().unwrap().to_str().unwrap();
        if name != EVENT.name {
            assert!(messages.contains_key(name), "{name}");
        }
    }
}

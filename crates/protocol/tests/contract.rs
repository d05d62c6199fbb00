//! The contract: what is written is read back, what is malformed is named, schemas are up to date.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use protocol::messages::{
    Clock, Command, CommandId, Control, Correction, Face, JoinRequest, News, Panel, Performative,
    Point, Report, SensedRobot, SentCommand, Tone, Variable, Widget,
};
use protocol::{Message, RobotName, RunName, decode, encode, schema};

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
            ("treats".into(), 7.0.into()),
            ("need".into(), true.into()),
            ("who".into(), "x".into()),
        ]
        .into(),
        sent: vec![SentCommand {
            to: name("Leguin"),
            seq: 3,
            performative: Performative::Achieve,
            command: "refill".into(),
        }],
        missing: vec![CommandId {
            from: name("Vonda"),
            seq: 1,
        }],
        log: vec!["jokes".into()],
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
    let news = News {
        correction: Some(Correction {
            location: Point::new(1.0, 2.0),
            blocked: true,
        }),
        commands: vec![CommandId {
            from: name("Butler"),
            seq: 1,
        }],
        unreachable: vec![name("Vonda")],
        sensed: vec![SensedRobot {
            name: name("Vonda"),
            location: Point::new(0.3, 0.7),
        }],
        joined: Some(2),
    };
    round_trip(&Clock {
        epoch: 2,
        tick: 7,
        news: [(name("Leguin"), news)].into(),
        end: None,
    });
    round_trip(&Command {
        epoch: 1,
        tick: 2,
        seq: 3,
        performative: Performative::Tell,
        command: "hurry".into(),
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
    round_trip(&Panel { widgets });
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

#[test]
fn unknown_fields_are_ignored_and_absent_lists_are_empty() {
    let text = br#"{"epoch":1,"tick":2,"generation":1,"proposal":{"x":1,"y":2,"z":3},"speed_mps":0,"direction_rad":0,
        "emotion_state":"","behavior_state":"","weather":"fine"}"#;
    let report: Report = decode("key", "sender", text).unwrap();
    assert!(report.sent.is_empty() && report.state_variables.is_empty());
    assert_eq!(report.proposal, Point::new(1.0, 2.0));
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
        (r#""to":"Leguin""#, r#""to":"Le/guin""#, "sent[0].to"),
        (r#""seq":3"#, r#""seq":3.5"#, "sent[0].seq"),
        (r#"{"epoch""#, r#"["epoch""#, "[0]"),
        (r#""log":["jokes"]}"#, r#""log":["jokes"]} trailing"#, "."),
    ] {
        assert!(good.contains(from), "{from} is not in {good}");
        let error = decode::<Report>(key, "Butler", good.replace(from, to).as_bytes()).unwrap_err();
        assert_eq!((error.key.as_str(), error.sender.as_str()), (key, "Butler"));
        assert_eq!(error.field, field, "{to}: {error}");
        assert!(error.to_string().contains(key), "{error}");
    }
}

#[test]
fn sizes_are_bounded() {
    let mut long = report();
    long.emotion_state = "x".repeat(5000);
    let error = decode::<Report>("key", "Butler", &encode(&long)).unwrap_err();
    assert_eq!(error.field, "emotion_state");

    let mut many = report();
    many.log = vec![String::new(); 2000];
    assert_eq!(
        decode::<Report>("key", "Butler", &encode(&many))
            .unwrap_err()
            .field,
        "log"
    );

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
    }
}

#[test]
fn a_name_that_breaks_keys_cannot_be_a_run() {
    assert!(RunName::new("a/b").is_err());
}

/// Set `CARS_UPDATE=1` to write the files anew.
#[test]
fn the_schemas_on_file_are_those_of_the_types() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas");
    for (name, schema) in schema::all() {
        let file = folder.join(format!("{name}.json"));
        let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
        if std::env::var_os("CARS_UPDATE").is_some() {
            std::fs::write(&file, &text).unwrap();
        }
        let on_file = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(
            on_file == text,
            "{} is out of date: run the test with CARS_UPDATE=1",
            file.display()
        );
    }
}

/// Set `CARS_UPDATE=1` to write the file anew.
#[test]
fn the_asyncapi_document_on_file_is_that_of_the_types() {
    let document = protocol::asyncapi::document();
    let text = serde_json::to_string_pretty(&document).unwrap() + "\n";
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/asyncapi.json");
    if std::env::var_os("CARS_UPDATE").is_some() {
        std::fs::write(&file, &text).unwrap();
    }
    let on_file = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(
        on_file == text,
        "{} is out of date: run the test with CARS_UPDATE=1",
        file.display()
    );
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
    let document = protocol::asyncapi::document();
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
    let on_disk_only = ["event", "recorded_tick", "recording_header"];
    for name in schema::all()
        .keys()
        .filter(|name| !on_disk_only.contains(name))
    {
        assert!(messages.contains_key(*name), "{name}");
    }
}

//! Whatever comes over the network, decoding it gives a message that is within its limits or an error that names key and
//! field. Messages are made by damaging good ones, and from nothing.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use proptest::prelude::*;
use protocol::messages::{
    Answer, Clock, Command, Control, ControlAnswer, FaultOrder, JoinAnswer, JoinRequest, LogRecord,
    MAX_ENTRIES, MAX_TEXT_BYTES, MAX_WIDGETS, Panel, PublicState, Report, TickPanel, TickUpdate,
    Waiting, WorldFrame,
};
use protocol::{Message, RobotName, RunName, decode, encode};
use serde_json::Value;

/// Good messages, with which most kinds can be reached.
const GOOD: &[&str] = &[
    r#"{"epoch":1,"tick":12,"generation":1,"proposal":{"x":0.5,"y":1},"speed_mps":0.3,"direction_rad":-3,"emotion_state":"HAPPY","behavior_state":"SERVE","state_variables":{"treats":7,"need":true,"who":"x"},"commands":3,"log":["jokes"]}"#,
    r#"{"epoch":2,"tick":7,"news":2147483649,"end":"finished"}"#,
    r#"{"epoch":2,"tick":7,"joined":2,"correction":{"location":{"x":1,"y":2},"blocked":true},"commands":[{"from":"Butler","performative":"achieve","command":"refill"}],"unreachable":["Vonda"],"sensed":[{"name":"Vonda","location":{"x":0.3,"y":0.7}}],"bodies":[{"kind":"guest","location":{"x":0.3,"y":0.7}}]}"#,
    r#"{"epoch":1,"tick":2,"generation":1,"number":3,"performative":"tell","command":"hurry"}"#,
    r#"{"do":"init","seed":5,"setup":{"seed":1,"duration_s":60,"field_m":[15,15],"guests":100,"guest_speed_mps":{"min":0,"mode":1,"max":2},"guest_duration_s":{"min":1,"mode":2,"max":3},"obstacles":[{"x":1,"y":1}],"robots":{"A":{"x":2,"y":2}},"log_file":{"enabled":true,"name":"cars.log"}}}"#,
    r#"{"do":"late","robot":"A","on_late":"continue","deadline_s":0.5}"#,
    r#"{"widgets":[{"widget":"face","face":"happy","intensity":0.5},{"widget":"badge","label":"e","text":"H","tone":"good"},{"widget":"bar","label":"b","value":1,"min":0,"max":2},{"widget":"sparkline","label":"s","values":[1,2]},{"widget":"table","rows":[["a","b"]]},{"widget":"svg","label":"p","svg":"<svg/>"},{"widget":"button","label":"R","command":"refill"}]}"#,
    r#"{"protocol":1,"run":"demo","name":"Butler","instance":"x","bodies":true,"sdk":"rust"}"#,
    r#"{"epoch":1,"tick":5,"orders":[{"robot":"A","kind":"crash","begins":true,"for_s":1.5}]}"#,
];

/// Values that tend to be handled wrongly.
fn odd() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        prop_oneof![
            Just(0.0),
            Just(-0.0),
            Just(-1.0),
            Just(1e308),
            Just(-1e308),
            Just(0.5),
            Just(9_007_199_254_740_993.0)
        ]
        .prop_map(Value::from),
        prop_oneof![Just(u64::MAX), Just(1 << 53), any::<u64>()].prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        prop_oneof![
            Just(String::new()),
            "\\PC{0,40}",
            Just("x".repeat(5000)),
            Just("../../etc".to_owned())
        ]
        .prop_map(Value::from),
        Just(Value::Array(Vec::new())),
        Just(Value::Object(serde_json::Map::new())),
        (0_usize..3000).prop_map(|n| Value::Array(vec![Value::from("x"); n])),
    ]
}

/// Replaces what stands at the `at`-th place of a value, counted depth first.
fn replace(value: &mut Value, at: &mut usize, with: &Value) {
    if *at == 0 {
        *value = with.clone();
    }
    *at = at.wrapping_sub(1);
    match value {
        Value::Array(values) => values.iter_mut().for_each(|value| replace(value, at, with)),
        Value::Object(fields) => fields
            .values_mut()
            .for_each(|value| replace(value, at, with)),
        _ => {}
    }
}

/// Reads bytes as every kind of message; what is accepted can be written and read again.
fn survives(bytes: &[u8]) {
    fn one<M: Message + PartialEq + std::fmt::Debug>(bytes: &[u8]) {
        match decode::<M>("cars/demo/key", "a sender", bytes) {
            Ok(message) => {
                let again = decode::<M>("cars/demo/key", "a sender", &encode(&message));
                assert_eq!(again.unwrap(), message);
            }
            Err(error) => {
                let text = error.to_string();
                assert!(
                    text.contains("cars/demo/key") && text.contains("a sender"),
                    "{text}"
                );
                assert!(
                    text.len() < 2000,
                    "an error repeats no whole message: {} bytes",
                    text.len()
                );
            }
        }
    }
    one::<Answer>(bytes);
    one::<Clock>(bytes);
    one::<Command>(bytes);
    one::<Control>(bytes);
    one::<ControlAnswer>(bytes);
    one::<FaultOrder>(bytes);
    one::<JoinAnswer>(bytes);
    one::<JoinRequest>(bytes);
    one::<LogRecord>(bytes);
    one::<TickUpdate>(bytes);
    one::<Panel>(bytes);
    one::<TickPanel>(bytes);
    one::<PublicState>(bytes);
    one::<Report>(bytes);
    one::<Waiting>(bytes);
    one::<WorldFrame>(bytes);
}

/// What an accepted report, panel or list of news may hold at most.
fn is_bounded(bytes: &[u8]) {
    if let Ok(report) = decode::<Report>("key", "a sender", bytes) {
        assert!(report.log.len() <= MAX_ENTRIES && report.commands as usize <= MAX_ENTRIES);
        assert!(report.log.iter().all(|line| line.len() <= MAX_TEXT_BYTES));
        assert!(report.proposal.x.is_finite() && report.speed_mps.is_finite());
    }
    if let Ok(news) = decode::<TickUpdate>("key", "a sender", bytes) {
        let texts = news.commands.iter().map(|delivery| &delivery.command);
        assert!(texts.map(String::len).all(|bytes| bytes <= MAX_TEXT_BYTES));
        assert!(news.tick < 1 << 53);
    }
    if let Ok(panel) = decode::<TickPanel>("key", "a sender", bytes) {
        assert!(panel.widgets.len() <= MAX_WIDGETS && panel.tick < 1 << 53);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn damaged_messages_are_refused_or_harmless(
        which in 0..GOOD.len(), changes in prop::collection::vec((0_usize..60, odd()), 1..4)
    ) {
        let mut value: Value = serde_json::from_str(GOOD[which]).unwrap();
        for (at, with) in changes {
            replace(&mut value, &mut at.clone(), &with);
        }
        let bytes = serde_json::to_vec(&value).unwrap();
        survives(&bytes);
        is_bounded(&bytes);
    }

    #[test]
    fn bytes_flipped_and_cut_are_refused_or_harmless(
        which in 0..GOOD.len(), flips in prop::collection::vec((any::<usize>(), any::<u8>()), 0..6), cut in any::<usize>()
    ) {
        let mut bytes = GOOD[which].as_bytes().to_vec();
        for (at, with) in flips {
            let at = at % bytes.len();
            bytes[at] = with;
        }
        bytes.truncate(cut % (bytes.len() + 1));
        survives(&bytes);
    }

    #[test]
    fn noise_is_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        survives(&bytes);
    }

    #[test]
    fn names_are_plain_or_refused(text in "\\PC{0,80}") {
        let robot = RobotName::new(&text).map(|name| name.to_string());
        let run = RunName::new(&text).map(|name| name.to_string());
        for name in [robot, run].into_iter().flatten() {
            prop_assert!(name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte)), "{name}");
        }
    }
}

#[test]
fn deep_nesting_is_refused_and_not_followed() {
    let deep = "[".repeat(100_000);
    survives(deep.as_bytes());
    let wrapped = format!("{{\"widgets\":{}", "[".repeat(100_000));
    survives(wrapped.as_bytes());
}

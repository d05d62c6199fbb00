//! The WebSocket: its limits, and its end.

use std::io::{Read, Write};
use std::time::{Duration, Instant};

use proptest::prelude::*;
use proptest::sample::Index;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use serde_json::Value;
use tungstenite::Message;

use crate::client::{Console, PATIENCE, Page, Received};

fn control(id: u64, control: &str) -> String {
    format!(r#"{{"type":"control","id":{id},"control":{control}}}"#)
}

fn command(id: u64, text: &str) -> String {
    format!(r#"{{"type":"command","id":{id},"to":"Butler","command":"{text}"}}"#)
}

fn error(answer: &Value) -> &str {
    answer["error"]
        .as_str()
        .unwrap_or_else(|| panic!("no error: {answer}"))
}

#[test]
fn without_a_simulator_requests_are_answered_with_an_error() {
    let console = Console::live();
    let mut page = console.page();
    let hello = page.until("hello");
    assert_eq!(hello["run"], "absent");
    assert_eq!(hello["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(page.until("simulator")["present"], false);

    page.send_text(&control(7, r#"{"do":"start"}"#));

    let answer = page.until("answer");
    assert_eq!(answer["id"], 7);
    assert!(
        error(&answer).contains("no simulator of run absent answers"),
        "{answer}"
    );
}

#[test]
fn what_only_programs_say_to_each_other_is_refused() {
    let console = Console::live();
    let mut page = console.page();

    page.send_text(&control(7, r#"{"do":"faults_done","epoch":1,"tick":3}"#));

    let answer = page.until("answer");
    assert_eq!(answer["id"], 7);
    assert!(error(&answer).contains("only the launcher"), "{answer}");
}

#[test]
fn malformed_requests_are_answered_with_the_reason() {
    let console = Console::live();
    let mut page = console.page();

    for (text, id, reason) in [
        (
            r#"{"type":"control","id":1,"control":{"do":"dance"}}"#,
            Some(1),
            "unknown variant `dance`",
        ),
        (
            r#"{"type":"control","id":2,"control":{"do":"step"}}"#,
            Some(2),
            "missing field `n`",
        ),
        (
            r#"{"type":"control","id":3,"control":{"do":"speed","factor":1e999}}"#,
            Some(3),
            "number out of range",
        ),
        (r#"{"type":"dance","id":4}"#, Some(4), "unknown variant"),
        (
            r#"{"type":"command","id":5,"command":"refill"}"#,
            Some(5),
            "missing field `to`",
        ),
        (
            r#"{"type":"control","id":-5,"control":{"do":"start"}}"#,
            None,
            "invalid value",
        ),
        ("{", None, "EOF"),
        ("", None, "EOF"),
        ("[[[[", None, "malformed"),
    ] {
        page.send_text(text);
        let answer = page.until("answer");
        assert_eq!(answer["id"].as_u64(), id, "{answer}");
        assert!(error(&answer).contains(reason), "{answer}");
    }

    page.send_text(&command(6, &"x".repeat(5000)));
    let answer = page.until("answer");
    assert!(error(&answer).contains("command: 5000 bytes"), "{answer}");
}

/// Well-formed requests.
const GOOD: &[&str] = &[
    r#"{"type":"control","id":1,"control":{"do":"start"}}"#,
    r#"{"type":"control","id":2,"control":{"do":"step","n":3}}"#,
    r#"{"type":"control","id":3,"control":{"do":"speed","factor":2.5}}"#,
    r#"{"type":"command","id":4,"to":"Butler","command":"refill"}"#,
    r#"{"type":"control","id":5,"control":{"do":"late","robot":"A","on_late":"continue","deadline_s":0.5}}"#,
    r#"{"type":"control","id":6,"control":{"do":"init","seed":5,"setup":{"guests":3,"field_m":[15,15]}}}"#,
    r#"{"type":"control","id":7,"control":{"do":"load","scenario":"seed = 1"}}"#,
];

/// A well-formed request with up to three characters replaced, or any text.
fn any_message() -> impl Strategy<Value = String> {
    let replacement = (any::<Index>(), prop_oneof!["[0-9{}\\[\\]\",:.e-]", "\\PC"]);
    let replacements = prop::collection::vec(replacement, 0..4);
    let damaged = (prop::sample::select(GOOD), replacements).prop_map(damage);
    let number = any::<f64>().prop_map(|number| number.to_string());

    prop_oneof![4 => damaged, 1 => "\\PC{0,200}", 1 => number]
}

fn damage((good, replacements): (&str, Vec<(Index, String)>)) -> String {
    let mut characters: Vec<String> = good.chars().map(String::from).collect();
    for (at, with) in replacements {
        *at.get_mut(&mut characters) = with;
    }
    characters.concat()
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn every_message_is_answered() {
    let console = Console::live();
    let mut page = console.page();
    let mut runner = TestRunner::default();
    let strategy = any_message();

    for _ in 0..400 {
        let text = strategy.new_tree(&mut runner).unwrap().current();
        page.send_text(&text);

        let answer = page.until("answer");
        assert!(!error(&answer).is_empty(), "{text}: {answer}");
    }
}

fn load(scenario_bytes: usize) -> String {
    let scenario = "x".repeat(scenario_bytes);
    control(1, &format!(r#"{{"do":"load","scenario":"{scenario}"}}"#))
}

#[test]
fn a_scenario_may_have_a_megabyte_and_no_more() {
    let console = Console::live();
    let mut page = console.page();

    page.send_text(&load(1 << 20));
    let answer = page.until("answer");
    assert!(error(&answer).contains("no simulator"), "{answer}");

    page.send_text(&load(2 << 20));
    let code = page.until_closed().map(|(code, _)| code);
    assert_ne!(code, Some(1000));
}

#[test]
fn a_message_that_is_too_long_or_binary_closes_the_connection() {
    let console = Console::live();

    let mut page = console.page();
    page.send_text(&command(1, &"x".repeat(70_000)));
    let (code, reason) = page.until_closed().unwrap();
    assert_eq!(code, 1009, "{reason}");
    assert!(reason.contains("65536"), "{reason}");

    let mut page = console.page();
    page.send(Message::binary(vec![1, 2, 3]));
    let (code, reason) = page.until_closed().unwrap();
    assert_eq!(code, 1003, "{reason}");

    let mode = console.page().until("hello")["mode"].clone();
    assert_eq!(mode, "live", "other browsers are still served");
}

#[test]
fn requests_of_one_page_are_limited() {
    let console = Console::live();
    let mut page = console.page();
    let started = Instant::now();

    for id in 0..100 {
        page.send_text(&control(id, r#"{"do":"status"}"#));
    }
    for _ in 0..100 {
        page.until("answer");
    }

    let elapsed = started.elapsed();
    assert!(
        elapsed > Duration::from_millis(900),
        "100 requests in {elapsed:?}"
    );
}

#[test]
fn the_33rd_browser_is_refused_with_the_reason() {
    let console = Console::live();
    let mut pages: Vec<Page> = (0..32).map(|_| console.page()).collect();
    for page in &mut pages {
        page.until("hello");
    }

    let (code, reason) = console.page().until_closed().unwrap();
    assert_eq!(code, 1013, "{reason}");
    assert!(
        reason.contains("32 browsers are connected already"),
        "{reason}"
    );

    // There is room again when the console has noticed that one is disconnected.
    pages.pop();
    let started = Instant::now();
    while !matches!(console.page().receive(), Received::Message(_)) {
        assert!(
            started.elapsed() < PATIENCE,
            "there is no room for another browser"
        );
    }
}

#[test]
fn silent_connections_make_room_for_a_browser() {
    let console = Console::live();
    let mut silent = Vec::new();
    for number in 0..300 {
        let mut socket = console.connect();
        // Some have begun a request, which is never complete.
        if number % 3 == 0 {
            socket.write_all(b"GET / HTTP/1.1\r\nHost: ").unwrap();
        }
        silent.push(socket);
    }

    let started = Instant::now();
    let mut page = console.page();
    page.until("simulator");
    let elapsed = started.elapsed();
    assert!(elapsed < Duration::from_secs(5), "after {elapsed:?}");

    // The first to come are the first to go, and a browser that has been heard stays whoever comes.
    let first = &mut silent[0];
    first.set_read_timeout(Some(PATIENCE)).unwrap();
    assert_eq!(first.read(&mut [0]).unwrap_or(0), 0);
    silent.extend((0..300).map(|_| console.connect()));
    page.send_text(&control(1, r#"{"do":"status"}"#));
    page.until("answer");
}

#[test]
fn a_console_that_ends_closes_its_connections() {
    let mut console = Console::live();
    let mut page = console.page();
    page.until("simulator");

    console.terminate();

    let (code, reason) = page.until_closed().unwrap();
    assert_eq!(code, 1001);
    assert_eq!(reason, "the console ends");
    drop(page);
    assert!(console.wait().success());
}

#[test]
fn clients_that_do_not_close_their_connections_cannot_keep_the_console_running() {
    let mut console = Console::live();
    let _silent = console.connect();
    let _stalled = console.page();

    console.terminate();

    assert!(console.wait().success());
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_stalled_browser_and_an_incomplete_request_are_disconnected() {
    let console = Console::live();
    let mut stalled = console.page();
    let mut silent = console.connect();
    let mut page = console.page();
    let started = Instant::now();

    silent
        .set_read_timeout(Some(Duration::from_secs(40)))
        .unwrap();
    silent.read_to_end(&mut Vec::new()).unwrap();
    let elapsed = started.elapsed();
    assert!(elapsed > Duration::from_secs(15), "after {elapsed:?}");
    assert!(elapsed < Duration::from_secs(30), "after {elapsed:?}");

    page.send_text(&control(1, r#"{"do":"status"}"#));
    page.until("answer");

    // The limit is 30 s, and it is checked every 5 s. Reading earlier would answer pings, so a slow machine gets some more.
    let limit = Duration::from_secs(45);
    std::thread::sleep(limit.saturating_sub(started.elapsed()));
    assert_eq!(stalled.until_closed(), None, "there is no close frame");
    page.send_text(&control(2, r#"{"do":"status"}"#));
    let answer = page.until("answer");
    assert_eq!(answer["id"], 2, "a browser that answers stays connected");
}

//! The WebSocket: its limits, and its end.

use std::io::Read;
use std::time::{Duration, Instant};

use proptest::prelude::*;
use proptest::sample::Index;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use tungstenite::Message;

use crate::client::{Console, Page};

fn control(id: u64, control: &str) -> String {
    format!(r#"{{"type":"control","id":{id},"control":{control}}}"#)
}

#[test]
fn without_a_simulator_it_says_so() {
    let console = Console::live();
    let mut page = console.page();
    let hello = page.until("hello");
    assert_eq!(
        (&hello["run"], &hello["version"]),
        (&"nobody".into(), &env!("CARGO_PKG_VERSION").into())
    );
    assert_eq!(page.until("simulator")["present"], false);
    page.say(&control(7, r#"{"do":"start"}"#));
    let answer = page.until("answer");
    let error = answer["error"].as_str().unwrap();
    assert!(
        answer["id"] == 7 && error.contains("no simulator of run nobody answers"),
        "{error}"
    );
}

#[test]
fn what_cannot_be_understood_is_answered_with_the_reason() {
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
            r#"{"type":"control","id":-5,"control":{"do":"start"}}"#,
            None,
            "invalid value",
        ),
        ("{", None, "EOF"),
        ("", None, "EOF"),
        ("[[[[", None, "malformed"),
    ] {
        page.say(text);
        let answer = page.until("answer");
        assert_eq!(answer["id"].as_u64(), id, "{answer}");
        assert!(
            answer["error"].as_str().unwrap().contains(reason),
            "{answer}"
        );
    }
    let long = format!(
        r#"{{"do":"command","to":"Butler","command":"{}"}}"#,
        "x".repeat(5000)
    );
    page.say(&control(6, &long));
    let answer = page.until("answer");
    assert!(
        answer["error"]
            .as_str()
            .unwrap()
            .contains("command: 5000 bytes"),
        "{answer}"
    );
}

/// Requests that are understood.
const GOOD: &[&str] = &[
    r#"{"type":"control","id":1,"control":{"do":"start"}}"#,
    r#"{"type":"control","id":2,"control":{"do":"step","n":3}}"#,
    r#"{"type":"control","id":3,"control":{"do":"speed","factor":2.5}}"#,
    r#"{"type":"control","id":4,"control":{"do":"command","to":"Butler","command":"refill"}}"#,
    r#"{"type":"control","id":5,"control":{"do":"late","robot":"A","on_late":"continue","deadline_s":0.5}}"#,
    r#"{"type":"control","id":6,"control":{"do":"init","seed":5,"setup":{"guests":3,"field_m":[15,15]}}}"#,
    r#"{"type":"control","id":7,"control":{"do":"load","scenario":"seed = 1"}}"#,
];

/// A good request with a few characters replaced, or anything.
fn saying() -> impl Strategy<Value = String> {
    let slip = (any::<Index>(), prop_oneof!["[0-9{}\\[\\]\",:.e-]", "\\PC"]);
    let damaged = (
        prop::sample::select(GOOD),
        prop::collection::vec(slip, 0..4),
    )
        .prop_map(|(good, slips)| {
            let mut characters: Vec<String> = good.chars().map(String::from).collect();
            for (at, with) in slips {
                *at.get_mut(&mut characters) = with;
            }
            characters.concat()
        });
    prop_oneof![4 => damaged, 1 => "\\PC{0,200}", 1 => any::<f64>().prop_map(|number| number.to_string())]
}

#[test]
fn whatever_is_said_is_answered() {
    let console = Console::live();
    let mut page = console.page();
    let (mut runner, strategy) = (TestRunner::default(), saying());
    for _ in 0..400 {
        let text = strategy.new_tree(&mut runner).unwrap().current();
        page.say(&text);
        let answer = page.until("answer");
        assert!(
            answer["error"].as_str().is_some_and(|why| !why.is_empty()),
            "{text}: {answer}"
        );
    }
}

#[test]
fn what_is_too_long_ends_the_conversation() {
    let console = Console::live();
    let scenario = |bytes| {
        control(
            1,
            &format!(r#"{{"do":"load","scenario":"{}"}}"#, "x".repeat(bytes)),
        )
    };
    let mut page = console.page();
    page.say(&scenario(1 << 20));
    assert!(
        page.until("answer")["error"]
            .as_str()
            .unwrap()
            .contains("no simulator"),
        "a scenario may be long"
    );
    page.say(&scenario(2 << 20));
    assert_ne!(page.farewell().map(|(code, _)| code), Some(1000));

    let mut page = console.page();
    let long = format!(
        r#"{{"do":"command","to":"Butler","command":"{}"}}"#,
        "x".repeat(70_000)
    );
    page.say(&control(1, &long));
    let (code, reason) = page.farewell().unwrap();
    assert!(code == 1009 && reason.contains("65536"), "{code} {reason}");

    let mut page = console.page();
    page.send(Message::binary(vec![1, 2, 3]));
    assert_eq!(page.farewell().unwrap().0, 1003);
    assert_eq!(
        console.page().until("hello")["mode"],
        "live",
        "others are served"
    );
}

#[test]
fn a_page_may_not_have_any_number_of_requests() {
    let console = Console::live();
    let mut page = console.page();
    let begun = Instant::now();
    for id in 0..100 {
        page.say(&control(id, r#"{"do":"status"}"#));
    }
    for _ in 0..100 {
        page.until("answer");
    }
    assert!(
        begun.elapsed() > Duration::from_millis(900),
        "100 requests in {:?}",
        begun.elapsed()
    );
}

#[test]
fn the_33rd_browser_is_refused_with_the_reason() {
    let console = Console::live();
    let mut pages: Vec<Page> = (0..32).map(|_| console.page()).collect();
    for page in &mut pages {
        page.until("hello");
    }
    let (code, reason) = console.page().farewell().unwrap();
    assert!(
        code == 1013 && reason.contains("32 browsers watch already"),
        "{code} {reason}"
    );
    pages.pop();
    // Its place is free as soon as the console has noticed that it left.
    let begun = Instant::now();
    while !matches!(console.page().hear(), crate::client::Heard::Said(_)) {
        assert!(
            begun.elapsed() < Duration::from_secs(5),
            "its place is not free again"
        );
    }
}

#[test]
fn it_ends_when_told_to_and_says_goodbye() {
    let mut console = Console::live();
    let mut page = console.page();
    page.until("simulator");
    console.terminate();
    let (code, reason) = page.farewell().unwrap();
    assert_eq!((code, reason.as_str()), (1001, "the console ends"));
    drop(page);
    assert!(console.wait().success());
}

#[test]
fn somebody_who_never_says_goodbye_cannot_keep_it() {
    let mut console = Console::live();
    let (_silent, _stuck) = (console.connect(), console.page());
    console.terminate();
    assert!(console.wait().success());
}

#[test]
fn a_stuck_browser_and_a_request_that_never_ends_are_let_go() {
    let console = Console::live();
    let (stuck, mut silent, mut page) = (console.page(), console.connect(), console.page());
    silent
        .set_read_timeout(Some(Duration::from_secs(40)))
        .unwrap();
    let begun = Instant::now();
    silent.read_to_end(&mut Vec::new()).unwrap();
    let let_go = begun.elapsed();
    assert!(
        let_go > Duration::from_secs(15) && let_go < Duration::from_secs(30),
        "after {let_go:?}"
    );
    page.say(&control(1, r#"{"do":"status"}"#));
    page.until("answer");
    // 30 s, and up to 5 s until it is looked after.
    std::thread::sleep(Duration::from_secs(38).saturating_sub(begun.elapsed()));
    let mut stuck = stuck;
    assert_eq!(stuck.farewell(), None, "it was let go without a word");
    page.say(&control(2, r#"{"do":"status"}"#));
    assert_eq!(page.until("answer")["id"], 2, "who answers stays");
}

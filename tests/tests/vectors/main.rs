//! The test vectors in `docs/vectors`: what a robot hears and says, for authors who want to test without a simulator.
//!
//! Set `CARS_UPDATE=1` to write the files anew. They are transcripts of the real simulator and the real robots' loop over
//! a network in this process, and a run writes the same bytes whatever its schedule.

#![expect(clippy::unwrap_used, clippy::expect_used, reason = "a test that cannot set up its subject fails")]

mod caller;
mod echo;
mod stage;
mod transcript;

use protocol::messages::Control;
use protocol::random::{MAX_SEED, stream, unit};
use rand_xoshiro::rand_core::Rng;
use stage::{Stage, name};
use system_tests::root;

const ECHO: &str = "docs/vectors/echo.toml";

/// Demands that the file says this, or makes it so.
fn check(file: &str, text: &str) {
    let path = root().join("docs/vectors").join(file);
    if std::env::var_os("CARS_UPDATE").is_some() {
        std::fs::write(&path, text).unwrap();
    }
    let on_file = std::fs::read_to_string(&path).unwrap_or_default();
    let differs = on_file.lines().zip(text.lines()).position(|(old, new)| old != new);
    let at = differs.unwrap_or_else(|| on_file.lines().count().min(text.lines().count()));
    assert!(
        on_file == text,
        "{} is out of date from line {} on: run the test with CARS_UPDATE=1\n  on file: {}\n  now:     {}",
        path.display(),
        at + 1,
        on_file.lines().nth(at).unwrap_or("(end)"),
        text.lines().nth(at).unwrap_or("(end)"),
    );
}

/// The last clock of a story, as it was on the wire.
fn last_clock(story: &str) -> String {
    let is_clock = |line: &&str| line.contains(r#""key":"cars/vectors/clock""#);
    let line = story.lines().rev().find(is_clock).expect("a clock has come");
    let (_, message) = line.split_once(r#""message":"#).expect("a line with a message");
    message.strip_suffix('}').expect("a whole line").to_owned()
}

#[test]
fn leguin_in_the_hall() {
    // A hall in which something happens early: few treats, eager guests.
    let set = [
        "robot.Butler.params.treat_capacity=6",
        "robot.Butler.params.treat_mean_s=0.5 s",
        "robot.Butler.params.resend=on",
        "robot.Butler.params.resend_s=2 s",
    ];
    let mut stage = Stage::new("configs/hors_doeuvres.toml", &set, "Leguin");
    stage.seat("Butler", || robots::make("Butler").unwrap());
    stage.seat("Leguin", || robots::make("Leguin").unwrap());
    stage.begin(1);
    stage.step_to(60);
    check("leguin.jsonl", &stage.end());
}

#[test]
fn echo_through_everything_that_a_network_does() {
    let mut stage = Stage::new(ECHO, &[], "Echo");
    stage.seat_caller();
    stage.seat("Echo", || Box::<echo::Echo>::default());
    stage.begin(1);
    stage.step_to(28);
    for parameters in
        ["", "tick=29;epoch=1", "tick=28;epoch=1", "tick=27;epoch=1", "tick=99;epoch=1", "tick=x"]
    {
        stage.ask("state", parameters);
    }
    for what in protocol::keys::QUERIES {
        stage.ask(what, "tick=29;epoch=1");
    }
    let clock = last_clock(&stage.transcript.text());
    stage.repeat_clock(clock.as_bytes());
    stage.order(&Control::Command { to: name("Echo"), command: "hello".to_owned() });
    stage.step_to(30);
    stage.order(&Control::Init { seed: Some(8), setup: None });
    stage.begin(2);
    stage.step_to(4);
    check("echo.jsonl", &stage.end());
}

#[test]
fn echo_returns() {
    let mut stage = Stage::new(ECHO, &[], "Echo");
    stage.seat_caller();
    stage.seat("Echo", || Box::<echo::Echo>::default());
    stage.begin(1);
    stage.step_to(3);
    stage.kill();
    stage.seat("Echo", || Box::<echo::Echo>::default());
    stage.wait_for(2);
    stage.step_to(10);
    check("return.jsonl", &stage.end());
}

#[test]
fn streams() {
    let streams = [(0, "guests"), (42, "robot/Butler"), (2002, "robot/Leguin#2"), (MAX_SEED, "robot/Echo")];
    let vectors: Vec<_> = streams
        .into_iter()
        .map(|(seed, name)| {
            let (mut whole, mut units) = (stream(seed, name), stream(seed, name));
            let draws: Vec<String> = (0..4).map(|_| whole.next_u64().to_string()).collect();
            let units: Vec<f64> = (0..4).map(|_| unit(&mut units)).collect();
            serde_json::json!({ "seed": seed, "stream": name, "draws": draws, "units": units })
        })
        .collect();
    check("streams.json", &(serde_json::to_string_pretty(&vectors).unwrap() + "\n"));
}

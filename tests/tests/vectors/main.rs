//! The test vectors in `docs/vectors`: what a robot receives and puts, for authors who want to test without a simulator.
//!
//! Set `CARS_UPDATE=1` to write the files anew. They are transcripts of the real simulator and the real robots' loop over
//! a network in this process, and a run writes the same bytes whatever its schedule.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its subject fails"
)]

mod caller;
mod echo;
mod stage;
mod transcript;

use bus::{Bus, Role};
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer};
use protocol::random::{MAX_SEED, stream, unit};
use protocol::{RunName, decode, encode};
use rand_xoshiro::rand_core::Rng;
use stage::{Stage, name};
use system_tests::{Lab, PATIENCE, eventually, root};

const ECHO: &str = "docs/vectors/echo.toml";
/// Ticks of Leguin's story.
const LEGUIN_TICKS: u64 = 60;
/// A hall in which something happens early: few treats, eager guests.
const EARLY: [&str; 4] = [
    "robot.Butler.params.treat_capacity=6",
    "robot.Butler.params.treat_mean_s=0.5 s",
    "robot.Butler.params.resend=on",
    "robot.Butler.params.resend_s=2 s",
];

/// Demands that the file says this, or makes it so.
fn check(file: &str, text: &str) {
    let path = root().join("docs/vectors").join(file);
    if std::env::var_os("CARS_UPDATE").is_some() {
        std::fs::write(&path, text).unwrap();
    }
    let on_file = std::fs::read_to_string(&path).unwrap_or_default();
    let differs = on_file
        .lines()
        .zip(text.lines())
        .position(|(old, new)| old != new);
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
    let line = story
        .lines()
        .rev()
        .find(is_clock)
        .expect("a clock has come");
    let (_, message) = line
        .split_once(r#""message":"#)
        .expect("a line with a message");
    message.strip_suffix('}').expect("a whole line").to_owned()
}

#[test]
fn leguin_in_the_hall() {
    let mut stage = Stage::new("configs/hors_doeuvres.toml", &EARLY, "Leguin");
    stage.seat("Butler", || robots::make("Butler").unwrap());
    stage.seat("Leguin", || robots::make("Leguin").unwrap());
    stage.begin(1);
    stage.step_to(LEGUIN_TICKS);
    check("leguin.jsonl", &stage.end());
}

#[test]
fn echo_through_everything_that_a_network_does() {
    let mut stage = Stage::new(ECHO, &[], "Echo");
    stage.seat("Caller", || Box::new(caller::Caller));
    stage.seat("Echo", || Box::<echo::Echo>::default());
    stage.begin(1);
    stage.step_to(28);
    for parameters in [
        "",
        "tick=29;epoch=1",
        "tick=28;epoch=1",
        "tick=27;epoch=1",
        "tick=99;epoch=1",
        "tick=x",
    ] {
        stage.ask("state", parameters);
    }
    for what in protocol::keys::QUERIES {
        stage.ask(what, "tick=29;epoch=1");
    }
    let clock = last_clock(&stage.transcript.text());
    stage.repeat_clock(clock.as_bytes());
    stage.command_as_operator(r#"{"command":"hello"}"#);
    stage.step_to(30);
    stage.order(&Control::Init {
        seed: Some(8),
        setup: None,
    });
    stage.begin(2);
    stage.step_to(4);
    check("echo.jsonl", &stage.end());
}

#[test]
fn echo_returns() {
    let mut stage = Stage::new(ECHO, &[], "Echo");
    stage.seat("Caller", || Box::new(caller::Caller));
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
    let streams = [
        (0, "guests"),
        (42, "robot/Butler"),
        (2002, "robot/Leguin#2"),
        (MAX_SEED, "robot/Echo"),
    ];
    let vectors: Vec<_> = streams
        .into_iter()
        .map(|(seed, name)| {
            let (mut whole, mut units) = (stream(seed, name), stream(seed, name));
            let draws: Vec<String> = (0..4).map(|_| whole.next_u64().to_string()).collect();
            let units: Vec<f64> = (0..4).map(|_| unit(&mut units)).collect();
            serde_json::json!({ "seed": seed, "stream": name, "draws": draws, "units": units })
        })
        .collect();
    check(
        "streams.json",
        &(serde_json::to_string_pretty(&vectors).unwrap() + "\n"),
    );
}

/// What the transcript of the hall says is what goes over zenoh between processes, byte for byte.
#[test]
fn leguin_in_the_hall_as_processes() {
    let (lab, run) = (Lab::new(), "vectors");
    let mut args = vec![
        "launch",
        "launch/hors_doeuvres.toml",
        "--paused",
        "--speed",
        "max",
    ];
    args.extend(EARLY.iter().flat_map(|change| ["--set", *change]));
    let mut launch = lab.start(run, &args);
    let endpoint = eventually("the endpoint", || {
        std::fs::read_to_string(lab.file(run, "endpoint")).ok()
    });
    let role = Role::Client {
        connect: endpoint.trim().to_owned(),
        patience: PATIENCE,
    };
    let (bus, keys) = (
        Bus::open(&role, None).unwrap(),
        Keys::new(&RunName::new(run).unwrap()),
    );
    let leguin = name("Leguin");
    let (sender, heard) = std::sync::mpsc::channel();
    let listen = |key: &str| {
        let sender = sender.clone();
        let hear = move |key: &str, bytes: &[u8]| {
            let message = String::from_utf8(bytes.to_vec()).unwrap();
            let _ = sender.send(format!(r#""key":"{key}","message":{message}}}"#));
        };
        bus.subscribe(key, hear).unwrap()
    };
    let _listening = [
        listen(&keys.clock()),
        listen(&keys.news(&leguin)),
        listen(&keys.report(&leguin)),
        listen(&keys.command(&name("Butler"), &leguin)),
    ];
    // An answer shows that what was declared before the query is in effect.
    let step = encode(&Control::Step { n: LEGUIN_TICKS });
    eventually("tick 0", || {
        let answer = bus
            .get_within(&keys.control(), "", Some(step.clone()), PATIENCE)
            .unwrap()?
            .result
            .unwrap();
        let answer: ControlAnswer = decode("control", "simulator", &answer).unwrap();
        matches!(answer, ControlAnswer::Done(_)).then_some(())
    });
    let text = std::fs::read_to_string(root().join("docs/vectors/leguin.jsonl")).unwrap();
    let is_put = |line: &&str| {
        line.contains(r#""message":"#) && !line.contains("/join") && !line.contains("/state\"")
    };
    let from_tick_1 = text
        .lines()
        .skip_while(|line| !line.contains(r#""message":{"epoch":1,"tick":1"#));
    let wanted = from_tick_1
        .filter(is_put)
        .filter(|line| !line.contains(r#""end""#));
    let mut wanted: Vec<&str> = wanted.map(|line| line.split_once(',').unwrap().1).collect();
    assert!(wanted.len() > 2 * LEGUIN_TICKS as usize, "{}", wanted.len());
    while !wanted.is_empty() {
        let line = heard
            .recv_timeout(PATIENCE)
            .unwrap_or_else(|_| panic!("never came: {wanted:#?}"));
        // A clock that is repeated on a slow machine is there no more.
        wanted.retain(|wanted| *wanted != line);
    }
    lab.ok(&["ctl", "stop", "--run", run]);
    launch.finish();
}

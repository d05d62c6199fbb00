//! The test vectors in `docs/vectors`: what a robot receives and puts, for authors who want to test without a simulator.
//!
//! Set `CARS_UPDATE=1` to write the files again. They are transcripts of the real state machines of simulator and robots, joined
//! by function calls; a run over zenoh puts the same bytes.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its subject fails"
)]

mod caller;
mod echo;
mod process;
mod stage;
mod transcript;

use bus::{Bus, Role};
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer};
use protocol::random::{MAX_SEED, stream, unit};
use protocol::{RobotName, RunName, decode, encode};
use rand_xoshiro::rand_core::Rng;
use robot::Robot;
use stage::Stage;
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

/// Asserts that a file has this content; writes it first with `CARS_UPDATE`.
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

fn echo() -> Box<dyn Robot> {
    Box::<echo::Echo>::default()
}

fn caller() -> Box<dyn Robot> {
    Box::new(caller::Caller)
}

#[test]
fn leguin_in_the_hall() {
    let mut stage = Stage::new("configs/hors_doeuvres.toml", &EARLY, "Leguin");
    stage.start("Butler", "memory-2", || robots::make("Butler").unwrap());
    stage.start("Leguin", "memory-3", || robots::make("Leguin").unwrap());
    stage.step_to(LEGUIN_TICKS);

    check("leguin.jsonl", &stage.end());
}

#[test]
fn echo_through_everything_that_a_network_does() {
    let mut stage = Stage::new(ECHO, &[], "Echo");
    stage.start("Caller", "memory-2", caller);
    stage.start("Echo", "memory-3", echo);
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
    stage.repeat_clock();
    stage.command_as_operator("hello");
    stage.step_to(30);

    stage.init(8);
    stage.step_to(4);

    check("echo.jsonl", &stage.end());
}

#[test]
fn echo_returns() {
    let mut stage = Stage::new(ECHO, &[], "Echo");
    stage.start("Caller", "memory-2", caller);
    stage.start("Echo", "memory-3", echo);
    stage.step_to(3);

    stage.kill();
    stage.start("Echo", "memory-4", echo);
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
    let mut vectors = Vec::new();
    for (seed, name) in streams {
        let mut whole = stream(seed, name);
        let draws: Vec<String> = (0..4).map(|_| whole.next_u64().to_string()).collect();
        let mut fractions = stream(seed, name);
        let units: Vec<f64> = (0..4).map(|_| unit(&mut fractions)).collect();
        vectors.push(
            serde_json::json!({ "seed": seed, "stream": name, "draws": draws, "units": units }),
        );
    }

    check(
        "streams.json",
        &(serde_json::to_string_pretty(&vectors).unwrap() + "\n"),
    );
}

/// The messages of a transcript that are put once in every tick from tick 1 on, or less often: each line from its key on.
fn puts(file: &str) -> Vec<String> {
    let text = std::fs::read_to_string(root().join("docs/vectors").join(file)).unwrap();
    let mut puts = Vec::new();
    let from_tick_1 = text
        .lines()
        .skip_while(|line| !line.contains(r#""message":{"epoch":1,"tick":1"#));
    for line in from_tick_1 {
        // Joining is over, queries and states depend on who asks when, and the end comes with the test's own order.
        let is_put = line.contains(r#""message":"#);
        if is_put && !line.contains("/state\"") && !line.contains(r#""end""#) {
            let (_, rest) = line.split_once(',').unwrap();
            puts.push(rest.to_owned());
        }
    }

    puts
}

/// Steps a run that waits for `start`, once its robots have joined.
fn step(bus: &Bus, keys: &Keys, ticks: u64) {
    let step = encode(&Control::Step { n: ticks });
    eventually("tick 0", || {
        let reply = bus
            .get_within(&keys.control(), "", Some(step.clone()), PATIENCE)
            .unwrap()?;
        let answer = reply.result.unwrap();
        let answer: ControlAnswer = decode("control", "simulator", &answer).unwrap();
        matches!(answer, ControlAnswer::Done(_)).then_some(())
    });
}

/// What simulator and Leguin put over zenoh between processes is in the transcript of the hall, byte for byte.
#[test]
fn leguin_in_the_hall_as_processes() {
    let lab = Lab::new();
    let run = "vectors";
    let mut args = vec![
        "launch",
        "launch/hors_doeuvres.toml",
        "--paused",
        "--speed",
        "max",
    ];
    for change in EARLY {
        args.extend(["--set", change]);
    }
    let mut launch = lab.start(run, &args);
    let endpoint = eventually("the endpoint", || {
        std::fs::read_to_string(lab.file(run, "endpoint")).ok()
    });

    let role = Role::Client {
        connect: endpoint.trim().to_owned(),
        patience: PATIENCE,
    };
    let bus = Bus::open(&role, None).unwrap();
    let keys = Keys::new(&RunName::new(run).unwrap());
    let leguin = RobotName::new("Leguin").unwrap();
    let butler = RobotName::new("Butler").unwrap();
    let (sender, received) = std::sync::mpsc::channel();
    let mut subscribers = Vec::new();
    for key in [
        keys.clock(),
        keys.news(&leguin),
        keys.report(&leguin),
        keys.command(&butler, &leguin),
    ] {
        let sender = sender.clone();
        let subscriber = bus.subscribe(&key, move |key, bytes| {
            let message = String::from_utf8(bytes.to_vec()).unwrap();
            let _is_over = sender.send(format!(r#""key":"{key}","message":{message}}}"#));
        });
        subscribers.push(subscriber.unwrap());
    }
    // The reply shows that what was declared before the query is in effect.
    step(&bus, &keys, LEGUIN_TICKS);

    let mut wanted = puts("leguin.jsonl");
    assert!(wanted.len() > 2 * LEGUIN_TICKS as usize, "{}", wanted.len());
    while !wanted.is_empty() {
        let line = received
            .recv_timeout(PATIENCE)
            .unwrap_or_else(|_| panic!("not received: {wanted:#?}"));
        // On a slow machine a clock is repeated.
        wanted.retain(|wanted| *wanted != line);
    }

    lab.ok(&["ctl", "stop", "--run", run]);
    launch.finish();
}

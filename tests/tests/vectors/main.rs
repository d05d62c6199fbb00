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
mod witness;

use std::thread::JoinHandle;

use bus::{Bus, Role};
use protocol::messages::{Control, End};
use protocol::random::{MAX_SEED, stream, unit};
use protocol::{RobotName, RunName};
use rand_xoshiro::rand_core::Rng;
use record::RunFolder;
use robot::{Host, HostOptions, Robot};
use scenario::Changes;
use scenario::Scenario;
use simulator::server::{KeepAlive, REPEAT_AFTER, Server, ServerOptions};
use stage::Stage;
use system_tests::{Lab, PATIENCE, eventually, root};
use witness::Witness;

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

    let run_name = RunName::new(run).unwrap();
    let witness = Witness::new(endpoint.trim(), &run_name, "Leguin");
    witness.step(LEGUIN_TICKS);
    witness.assert_received("leguin.jsonl", 1);

    lab.ok(&["ctl", "stop", "--run", run]);
    launch.finish();
}

/// A robot that takes part over zenoh until the run ends.
fn join(run: &RunName, endpoint: &str, name: &str, robot: Box<dyn Robot>) -> JoinHandle<()> {
    let options = HostOptions {
        run: run.clone(),
        connect: endpoint.to_owned(),
        patience: PATIENCE,
        gone_patience: PATIENCE,
        zenoh_config: None,
    };
    let robots = vec![(RobotName::new(name).unwrap(), robot)];

    std::thread::spawn(move || {
        let host = Host::connect(robots, options).unwrap();
        assert_eq!(host.run().unwrap(), End::Stopped);
    })
}

/// What simulator and Echo put over zenoh is in its transcript, byte for byte, through both epochs.
#[test]
fn echo_over_zenoh() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("simulator.sock");
    let endpoint = format!("unixsock-stream/{}", socket.display());
    let role = Role::Router {
        listen: endpoint.clone(),
        trusts_network: false,
    };
    let run = RunName::new("vectors").unwrap();
    let options = ServerOptions {
        run: run.clone(),
        speed: None,
        is_paused: true,
        is_launched: false,
        stay: KeepAlive::Never,
        repeat_after: REPEAT_AFTER,
    };
    let scenario = Scenario::load(&root().join(ECHO), &Changes::default()).unwrap();
    let run_folder = RunFolder::new(folder.path(), &run);
    let lock = run_folder.create(&scenario).unwrap();
    let bus = Bus::open(&role, None).unwrap();
    let server = Server::open(bus, scenario, options, &run_folder, None).unwrap();
    let simulator = std::thread::spawn(move || {
        let _lock = lock;
        server.run().unwrap();
    });

    let witness = Witness::new(&endpoint, &run, "Echo");
    witness.control(&Control::Status);
    let caller = join(&run, &endpoint, "Caller", caller());
    let echo = join(&run, &endpoint, "Echo", echo());
    witness.step(28);
    witness.command_as_operator("hello");
    witness.step(2);
    witness.control(&Control::Init {
        seed: Some(8),
        setup: None,
        epoch: None,
    });
    witness.step(4);
    witness.assert_received("echo.jsonl", 0);

    witness.control(&Control::Stop);
    for thread in [caller, echo, simulator] {
        thread.join().unwrap();
    }
}

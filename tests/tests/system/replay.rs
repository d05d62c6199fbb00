//! `cars replay`: a recorded run on the keys of a run in progress, and observers that cannot tell the two apart.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use bus::{Bus, Declared, Role};
use nix::sys::signal::Signal;
use protocol::keys::Keys;
use protocol::messages::{
    Control, ControlAnswer, Phase, PublicState, Status, TickPanel, WorldFrame,
};
use protocol::{RobotName, RunName, decode, encode};
use serde_json::json;
use system_tests::processes::Running;
use system_tests::{Lab, eventually, free_port, programs};

const HALL: &str = "configs/hors_doeuvres.toml";
/// What makes frames interesting: lost commands, and links that are cut.
const NETWORK: [&str; 4] = [
    "--set",
    "network.commands={ loss = 0.3 }",
    "--set",
    "network.partition=[{ groups = [[\"Butler\"], [\"Leguin\"]], from = \"5 s\", until = \"9 s\" }]",
];

fn robot(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

/// Records a run of the hall in one process.
fn record(lab: &Lab, run: &str, duration: &str) {
    lab.ok(&["run", HALL, "--run", run, "--duration", duration, "--quiet"]);
}

/// Starts a replay at a free port and waits until it listens.
fn replay(lab: &Lab, run: &str, args: &[&str]) -> (Running, String) {
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let mut all = vec!["replay", "--listen", &endpoint];
    all.extend(args);
    let mut replay = lab.start(run, &all);
    replay.prints("replaying ");
    (replay, endpoint)
}

/// Ends a replay as a person does.
fn interrupt(replay: &mut Running) {
    replay.signal(Signal::SIGINT);
    replay.finish();
}

/// What a program prints, in one line.
fn flat(text: &str) -> String {
    let words = text.split_whitespace().filter(|word| *word != "│");
    words.collect::<Vec<_>>().join(" ")
}

/// Runs `cars`, which must fail; returns what it prints, in one line.
fn fails(lab: &Lab, args: &[&str]) -> String {
    let (code, text) = lab.fails(args);
    assert_eq!(code, 1, "{text}");
    flat(&text)
}

/// Runs `cars ctl`, which must be refused; returns what it prints, in one line.
fn refused(lab: &Lab, run: &str, args: &[&str]) -> String {
    fails(lab, &[&["ctl", "--run", run], args].concat())
}

/// A program that observes a run.
struct Observer {
    bus: Bus,
    keys: Keys,
    frames: Receiver<WorldFrame>,
    panels: Arc<Mutex<BTreeMap<String, TickPanel>>>,
    states: Arc<Mutex<BTreeMap<(String, u64), PublicState>>>,
    tokens: Arc<Mutex<BTreeSet<String>>>,
    clocks: Arc<Mutex<u64>>,
    _declared: Vec<Declared>,
}

impl Observer {
    fn connect(run: &str, endpoint: &str) -> Self {
        let role = Role::Client {
            connect: endpoint.to_owned(),
            patience: Duration::from_secs(60),
        };
        let bus = Bus::open(&role, None).unwrap();
        let keys = Keys::new(&RunName::new(run).unwrap());
        let states: Arc<Mutex<BTreeMap<_, _>>> = Arc::default();
        let panels: Arc<Mutex<BTreeMap<_, _>>> = Arc::default();
        let tokens: Arc<Mutex<BTreeSet<_>>> = Arc::default();
        let clocks: Arc<Mutex<u64>> = Arc::default();

        let (sender, frames) = channel();
        let world = bus.subscribe(&keys.world(), move |key, bytes| {
            let _is_over = sender.send(decode(key, "simulator", bytes).unwrap());
        });
        let seen = panels.clone();
        let of_panels = bus.subscribe(&keys.panels(), move |key, bytes| {
            let name = Keys::robot_of(key).unwrap().to_owned();
            let panel = decode(key, "a robot", bytes).unwrap();
            seen.lock().unwrap().insert(name, panel);
        });
        let seen = states.clone();
        let of_states = bus.subscribe(&format!("cars/{run}/robot/*/state"), move |key, bytes| {
            let name = Keys::robot_of(key).unwrap().to_owned();
            let state: PublicState = decode(key, "a robot", bytes).unwrap();
            seen.lock().unwrap().insert((name, state.tick), state);
        });
        let seen = clocks.clone();
        let of_clocks = bus.subscribe(&keys.clock(), move |_, _| *seen.lock().unwrap() += 1);
        let seen = tokens.clone();
        let of_tokens = bus.liveliness(&keys.alive(), move |key, is_declared| {
            let mut seen = seen.lock().unwrap();
            if is_declared {
                seen.insert(key.to_owned());
            } else {
                seen.remove(key);
            }
        });

        let declared = [world, of_panels, of_states, of_clocks, of_tokens];
        Self {
            _declared: declared.into_iter().map(Result::unwrap).collect(),
            bus,
            keys,
            frames,
            panels,
            states,
            tokens,
            clocks,
        }
    }

    fn control(&self, control: &Control) -> Result<Status, String> {
        let reply = eventually("an answer", || {
            let body = Some(encode(control));
            self.bus.get(&self.keys.control(), "", body).unwrap()
        });
        match decode("control", "simulator", &reply.result.unwrap()).unwrap() {
            ControlAnswer::Done(status) => Ok(*status),
            other @ (ControlAnswer::Setup(_) | ControlAnswer::Log { .. }) => {
                panic!("not asked for: {other:?}")
            }
            ControlAnswer::Refused { explanation, .. } => Err(explanation),
        }
    }

    /// Requests frames until one is of this tick, which is complete; returns it with the flights since the last call.
    fn frame(&self, tick: u64) -> WorldFrame {
        let mut flights = Vec::new();
        eventually("the frame of the tick", || {
            let status = self.control(&Control::Status).unwrap();
            let is_complete = status.tick == tick && status.awaiting.is_empty();
            let mut found = None;
            while let Ok(frame) = self.frames.recv_timeout(Duration::from_millis(200)) {
                flights.extend(frame.flights.clone());
                found = Some(frame);
                if is_complete {
                    break;
                }
            }

            let mut frame = found.filter(|frame| is_complete && frame.tick == tick)?;
            frame.flights.clone_from(&flights);
            Some(frame)
        })
    }

    /// The answer to a query for a robot's state, or the reason of the error reply.
    fn ask(&self, name: &str, what: &str, parameters: &str) -> Result<String, String> {
        let key = self.keys.query(&robot(name), what);
        let reply = eventually("an answer", || {
            self.bus.get(&key, parameters, None).unwrap()
        });
        let text = reply.result?;
        Ok(String::from_utf8(text).unwrap())
    }
}

/// What an observer gets of a run.
struct Observed {
    frames: Vec<WorldFrame>,
    answers: Vec<(String, Result<String, String>)>,
    states: BTreeMap<(String, u64), PublicState>,
}

/// From this tick on states are compared.
const FIRST_STATE: u64 = 5;

/// Steps through a run that is paused at tick 0, and notes all that observers get.
fn observe(observer: &Observer, ticks: u64) -> Observed {
    let mut frames = vec![observer.frame(0)];
    let mut answers = Vec::new();
    for tick in 1..=ticks {
        observer.control(&Control::Step { n: 1 }).unwrap();
        frames.push(observer.frame(tick));
        for what in ["state", "location", "state_variables", "emotion_state"] {
            for asked in [
                String::new(),
                format!("tick={};epoch=1", tick + 1),
                format!("tick={tick};epoch=1"),
                format!("tick={};epoch=1", tick + 9),
                format!("tick={tick};epoch=2"),
            ] {
                let query = format!("{what} at {tick}, {asked}");
                answers.push((query, observer.ask("Butler", what, &asked)));
            }
        }
    }

    let states = eventually("the states of all ticks", || {
        let states = observer.states.lock().unwrap();
        // Robots put states once they know of the subscriber.
        let newer = states.iter().filter(|((_, tick), _)| *tick >= FIRST_STATE);
        let newer: BTreeMap<_, _> = newer
            .map(|(key, state)| (key.clone(), state.clone()))
            .collect();
        (newer.len() as u64 == 2 * (ticks + 1 - FIRST_STATE)).then_some(newer)
    });
    Observed {
        frames,
        answers,
        states,
    }
}

#[test]
fn observers_get_what_they_get_of_the_run_itself() {
    let lab = Lab::new();
    let ticks = 24;
    let end = ["--duration", "20 s"];
    let launch = ["launch", "launch/hors_doeuvres.toml", "--no-console"];
    let paused = ["--paused", "--speed", "max"];
    let args = [&launch[..], &paused, &end, &NETWORK].concat();
    let mut running = lab.start("replay-live", &args);
    lab.until_ready("replay-live");
    let endpoint = std::fs::read_to_string(lab.file("replay-live", "endpoint")).unwrap();
    let live = observe(&Observer::connect("replay-live", endpoint.trim()), ticks);
    lab.ok(&["ctl", "stop", "--run", "replay-live"]);
    running.finish();

    let recorded = ["run", HALL, "--run", "recorded", "--quiet"];
    lab.ok(&[&recorded[..], &end, &NETWORK].concat());
    // Under the name of the launch.
    let folder = lab.out().join("recorded");
    let folder = folder.to_str().unwrap();
    let args = [&[folder], &paused[..]].concat();
    let (mut running, endpoint) = replay(&lab, "replay-live", &args);
    let observer = Observer::connect("replay-live", &endpoint);
    let replayed = observe(&observer, ticks);

    assert!(live.frames.iter().any(|frame| !frame.flights.is_empty()));
    assert!(live.frames.iter().any(|frame| !frame.cuts.is_empty()));
    for (mut frame, mut original) in replayed.frames.into_iter().zip(live.frames) {
        let run = frame.replay_of.take();
        assert_eq!(run.as_ref().map(RunName::as_str), Some("recorded"));
        assert_eq!(original.replay_of, None);
        // Guests are recorded in millimeters.
        let guests = std::mem::take(&mut frame.guests);
        let originals = std::mem::take(&mut original.guests);
        assert_eq!(guests.len(), originals.len());
        for (guest, original) in guests.iter().flatten().zip(originals.iter().flatten()) {
            assert!((guest - original).abs() < 0.000_501, "{guest} {original}");
        }
        assert_eq!(frame, original);
    }
    for (answer, original) in replayed.answers.iter().zip(&live.answers) {
        assert_eq!(answer, original);
    }
    assert_eq!(replayed.answers.len(), live.answers.len());
    assert_eq!(replayed.states, live.states);

    let tokens = observer.tokens.lock().unwrap().clone();
    let keys = &observer.keys;
    let expected = [
        keys.alive_sim(),
        keys.alive_robot(&robot("Butler")),
        keys.alive_robot(&robot("Leguin")),
    ];
    assert_eq!(tokens, expected.into());
    assert_eq!(*observer.clocks.lock().unwrap(), 0, "no clock is put");
    interrupt(&mut running);
}

#[test]
fn the_log_of_a_replay_is_that_of_the_run() {
    let lab = Lab::new();
    let run = "replay-log";
    record(&lab, run, "60 s");
    let (mut running, _) = replay(&lab, run, &[run, "--paused", "--speed", "max"]);

    let mut log = lab.start(run, &["log", "-f"]);
    eventually("the log to be followed", || {
        lab.ctl(run, &["seek", "0"]);
        log.printed().contains("the replay continues").then_some(())
    });
    lab.ctl(run, &["init"]);
    lab.ctl(run, &["start"]);
    log.prints("finished, digest");
    interrupt(&mut running);
    log.finish();

    let printed = log.printed();
    let begin = printed
        .rfind("      0.0 s  simulator    initialized")
        .unwrap();
    let recorded = std::fs::read_to_string(lab.file(run, "cars.log")).unwrap();
    assert_eq!(&printed[begin..], recorded);
    assert!(!lab.file(run, "endpoint").exists());
}

/// The layer loses a quarter in each tick.
#[test]
fn a_replay_shows_the_layers_of_each_tick() {
    const DUST: &str = "layer=[{ name = \"dust\", cell = \"2 ft\", decay = 0.5, value = 1, \
                        peaks = [{ at = [\"20 ft\", \"30 ft\"], radius = \"10 ft\", height = 15 }] }]";
    let lab = Lab::new();
    let run = "replay-layers";
    lab.ok(&[
        "run",
        HALL,
        "--run",
        run,
        "--duration",
        "10 s",
        "--quiet",
        "--set",
        DUST,
    ]);
    let (mut running, endpoint) = replay(&lab, run, &[run, "--paused"]);
    let observer = Observer::connect(run, &endpoint);

    let mut start = None;
    for tick in [0, 3, 20, 7, 8, 0, 19] {
        lab.ctl(run, &["seek", &tick.to_string()]);
        let frame = observer.frame(tick);
        let [dust] = &frame.layers[..] else {
            panic!("{:?}", frame.layers);
        };
        assert_eq!((dust.columns, dust.rows), (25, 25));
        let [min, max] = *start.get_or_insert([dust.min, dust.max]);
        assert_eq!(min, 1.0);
        // What was added at the peak is nearly all of 15, and the scale stays.
        assert!((14.0..=16.0).contains(&max), "{max}");
        let left = |number: f64| (0..tick).fold(number, |left, _| left * 0.75);
        assert_eq!([dust.min, dust.max], [min, max].map(left));
        assert_eq!(dust.scale[1], max);
    }
    interrupt(&mut running);
}

#[test]
fn a_replay_is_paused_stepped_and_sought_in_both_directions() {
    let lab = Lab::new();
    let run = "replay-control";
    record(&lab, run, "20 s");
    let ticks = lab.recorded(run);
    let (mut running, endpoint) = replay(&lab, run, &[run, "--paused"]);
    let observer = Observer::connect(run, &endpoint);

    let status = lab.ctl(run, &["status"]);
    assert_eq!(
        (&status["tick"], &status["phase"]),
        (&json!(0), &json!("ready"))
    );
    assert_eq!(status["replay_of"], run);
    assert_eq!(lab.ctl(run, &["step", "7"])["tick"], 7);
    assert_eq!(lab.ctl(run, &["seek", "30"])["tick"], 30);
    assert_eq!(lab.ctl(run, &["step"])["tick"], 31);
    let sought = lab.ctl(run, &["seek", "5"]);
    assert_eq!(
        (&sought["tick"], &sought["phase"]),
        (&json!(5), &json!("paused"))
    );
    let text = refused(&lab, run, &["seek", "41"]);
    assert!(
        text.contains("has no tick 41: its last one is 40"),
        "{text}"
    );
    assert_eq!(lab.ctl(run, &["status"])["tick"], 5);

    // What is shown of a tick does not depend on how it was reached.
    let mut frames = Vec::new();
    for ways in [
        &["seek 12", "step 8"][..],
        &["seek 33", "seek 20"],
        &["seek 20"],
    ] {
        for way in ways {
            lab.ctl(run, &way.split(' ').collect::<Vec<_>>());
        }
        let mut frame = observer.frame(20);
        frame.flights.clear();
        frames.push(frame);
        let report = &ticks[20].reports[&robot("Leguin")];
        let answer = observer.ask("Leguin", "behavior_state", "").unwrap();
        assert!(answer.contains(&report.behavior_state), "{answer}");
        let panel = TickPanel::new(1, 20, ticks[20].panels[&robot("Butler")].clone());
        eventually("the panel of the tick", || {
            let panels = observer.panels.lock().unwrap();
            (panels.get("Butler") == Some(&panel)).then_some(())
        });
    }
    assert!(frames.iter().all(|frame| *frame == frames[0]));
    let before = ticks[19].reports[&robot("Leguin")].clone();
    let state = observer.ask("Leguin", "state", "tick=20;epoch=1").unwrap();
    let state: PublicState = serde_json::from_str(&state).unwrap();
    assert_eq!(
        (state.tick, state.state_variables),
        (19, before.state_variables.clone())
    );

    // It plays to the last tick and stays there.
    assert_eq!(lab.ctl(run, &["speed", "0.001"])["speed"], 0.001);
    assert_eq!(lab.ctl(run, &["start"])["phase"], "running");
    let text = refused(&lab, run, &["step"]);
    assert!(text.contains("pause it to step"), "{text}");
    assert_eq!(lab.ctl(run, &["seek", "25"])["phase"], "running");
    assert_eq!(lab.ctl(run, &["pause"])["phase"], "paused");
    lab.ctl(run, &["speed", "max"]);
    lab.ctl(run, &["start"]);
    let last = observer.frame(40);
    assert_eq!(last.phase, Phase::Paused);
    for args in [&["start"][..], &["step"]] {
        let text = refused(&lab, run, args);
        assert!(
            text.contains("at the last tick of its recording, 40"),
            "{text}"
        );
    }
    let initialized = lab.ctl(run, &["init"]);
    assert_eq!(
        (&initialized["tick"], &initialized["phase"]),
        (&json!(0), &json!("ready"))
    );
    assert_eq!(lab.ctl(run, &["step", "100"])["tick"], 40);

    for args in [
        &["init", "--seed", "7"][..],
        &["load", HALL],
        &["late", "continue"],
    ] {
        let text = refused(&lab, run, args);
        assert!(
            text.contains(&format!("this is a replay of run {run}")),
            "{text}"
        );
    }
    let text = fails(&lab, &["ctl", "command", "Leguin", "refill", "--run", run]);
    assert!(text.contains("this is a replay"), "{text}");
    let scenario = lab.ok(&["ctl", "scenario", "--run", run]);
    assert_eq!(
        scenario,
        std::fs::read_to_string(lab.file(run, "scenario.toml")).unwrap()
    );

    lab.ok(&["ctl", "stop", "--run", run]);
    running.finish();
    assert!(!lab.file(run, "endpoint").exists());
}

#[test]
fn robots_cannot_join_a_replay_and_a_run_in_progress_cannot_be_sought() {
    let lab = Lab::new();
    let run = "replay-join";
    record(&lab, run, "10 s");
    let (mut running, endpoint) = replay(&lab, run, &[run, "--paused"]);
    let butler = Command::new(programs().join("cars-butler"))
        .env("CARS_RUN", run)
        .env("CARS_CONNECT", &endpoint)
        .output()
        .unwrap();
    let text = flat(&String::from_utf8_lossy(&butler.stderr));
    assert!(!butler.status.success(), "{text}");
    let reason = format!("this is a replay of run {run}: no robot can join");
    assert!(text.contains(&reason), "{text}");
    interrupt(&mut running);

    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let run = "replay-not";
    let mut simulator = Command::new(programs().join("cars-sim"));
    simulator
        .args([HALL, "--run", run, "--listen", &endpoint, "--out"])
        .arg(lab.out())
        .current_dir(system_tests::root());
    let mut simulator = Running::start(simulator, run, lab.out().join(run));
    let observer = Observer::connect(run, &endpoint);
    let text = observer.control(&Control::Seek { tick: 3 }).unwrap_err();
    assert!(
        text.contains("a run in progress cannot be sought"),
        "{text}"
    );
    assert!(text.contains("cars replay"), "{text}");
    observer.control(&Control::Stop).unwrap();
    simulator.finish();
}

#[test]
fn each_epoch_of_a_run_is_replayed() {
    let lab = Lab::new();
    let run = "replay-epochs";
    let launch = ["launch", "launch/hors_doeuvres.toml", "--no-console"];
    let mut running = lab.start(
        run,
        &[&launch[..], &["--paused", "--speed", "max"]].concat(),
    );
    lab.until_ready(run);
    lab.step(run, 10);
    lab.ctl(run, &["init", "--seed", "7"]);
    eventually("the second epoch", || {
        let status = lab.ctl(run, &["status"]);
        (status["phase"] == "ready" && status["epoch"] == 2).then_some(())
    });
    lab.step(run, 5);
    lab.ok(&["ctl", "stop", "--run", run]);
    running.finish();

    for (args, epoch, seed, last) in [(&["--epoch", "1"][..], 1, 2002, 10), (&[], 2, 7, 5)] {
        let (mut running, _) = replay(&lab, run, &[&[run, "--speed", "max"], args].concat());
        eventually("the last tick", || {
            let status = lab.ctl(run, &["status"]);
            assert_eq!(
                (&status["epoch"], &status["seed"]),
                (&json!(epoch), &json!(seed))
            );
            (status["tick"] == last && status["phase"] == "paused").then_some(())
        });
        interrupt(&mut running);
    }
    let text = fails(&lab, &["replay", run, "--epoch", "3"]);
    assert!(text.contains("has no epoch 3, the last one is 2"), "{text}");
}

#[test]
fn of_a_damaged_recording_all_is_replayed_that_is_complete() {
    let lab = Lab::new();
    let run = "replay-damaged";
    record(&lab, run, "600 s");
    let file = lab.file(run, "run.mcap");
    let bytes = std::fs::read(&file).unwrap();

    // Cut off, as by a crash.
    std::fs::write(&file, &bytes[..bytes.len() * 7 / 10]).unwrap();
    let (mut running, _) = replay(&lab, run, &[run, "--speed", "max"]);
    running.prints("has no end");
    let cut = lab.recorded(run).len() as u64 - 1;
    assert!((1..1200).contains(&cut), "{cut}");
    eventually("the last complete tick", || {
        let status = lab.ctl(run, &["status"]);
        (status["tick"] == cut && status["phase"] == "paused").then_some(())
    });
    interrupt(&mut running);

    // A byte in the content of a chunk in the middle, which begins with these bytes.
    let middle = bytes.len() / 2;
    let mut content = bytes[middle..].windows(4);
    let start = content
        .position(|bytes| bytes == [0x28, 0xb5, 0x2f, 0xfd])
        .unwrap();
    let mut damaged = bytes.clone();
    damaged[middle + start + 100] ^= 1;
    std::fs::write(&file, damaged).unwrap();
    let (mut running, _) = replay(&lab, run, &[run, "--speed", "max"]);
    let reached = eventually("the last tick before the damage", || {
        let status = lab.ctl(run, &["status"]);
        let tick = status["tick"].as_u64().unwrap();
        (tick > 0 && status["phase"] == "paused").then_some(tick)
    });
    assert!(reached < 1200, "{reached}");
    for args in [&["step"][..], &["seek", &(reached + 1).to_string()]] {
        let text = refused(&lab, run, args);
        assert!(text.contains("run.mcap: damaged at byte"), "{text}");
    }
    assert_eq!(lab.ctl(run, &["seek", "1200"])["tick"], 1200);
    assert_eq!(lab.ctl(run, &["seek", "3"])["tick"], 3);
    interrupt(&mut running);

    // Without a recording, or without a tick.
    std::fs::write(&file, &bytes[..100]).unwrap();
    let text = fails(&lab, &["replay", run]);
    assert!(text.contains("run.mcap is not a recording"), "{text}");
    std::fs::remove_file(&file).unwrap();
    let text = fails(&lab, &["replay", run]);
    assert!(
        text.contains("cannot read") && text.contains("frames = false"),
        "{text}"
    );
}

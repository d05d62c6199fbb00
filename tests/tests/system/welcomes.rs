//! A robot may throw away what arrives before its welcome: clock and news come again behind it.

use std::collections::BTreeMap;
use std::process::Command;
use std::sync::mpsc::{Receiver, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use bus::{Bus, Declared, Role};
use protocol::keys::Keys;
use protocol::messages::{Clock, Control, ControlAnswer, JoinAnswer, Report, TickUpdate, Welcome};
use protocol::{Epoch, PROTOCOL_VERSION, RobotName, RunName, Tick, decode, encode};
use serde_json::{Value, json};
use system_tests::processes::{Running, mark};
use system_tests::stalls::Stalls;
use system_tests::tools::has_modules;
use system_tests::{Lab, PATIENCE, eventually, free_port, programs, root};

use super::wire::standing;

/// Where the clock goes on after 0.3 s, which is much less than the 2 s after which a clock is usually repeated.
const SCENARIO: &str = "duration = \"20 s\"\non_late = \"continue\"\ndeadline = \"0.3 s\"\nlose_after = 2\n\
                        [[robot]]\nname = \"A\"\nat = [\"2 m\", \"2 m\"]\n\
                        [[robot]]\nname = \"B\"\nat = [\"3 m\", \"2 m\"]\n";
const LAST_TICK: Tick = 40;
/// From this tick of epoch 2 on A answers no clock, until it is asked to join again.
const HANG_FROM: (Epoch, Tick) = (2, 10);
/// A machine that stands still for so long makes robots late.
const LONGEST_STALL: Duration = Duration::from_millis(100);
const MAX_ATTEMPTS: usize = 5;

/// What a robot gets, in the order in which it arrives.
enum Arrived {
    Clock(Clock),
    Update(Box<TickUpdate>),
}

/// A robot that knows nothing of what arrived before it has read its welcome.
struct ForgetfulRobot {
    bus: Bus,
    keys: Keys,
    run: RunName,
    name: RobotName,
    arrived: Receiver<Arrived>,
    declared: Vec<Declared>,
    hangs_from: Option<(Epoch, Tick)>,
    is_hung: bool,
    welcome: Welcome,
    has_begun: bool,
    pending: Option<Clock>,
    updates: BTreeMap<(Epoch, Tick), TickUpdate>,
    answered: Option<Report>,
}

impl ForgetfulRobot {
    /// Plays a robot on a thread of its own, until the end of the run.
    fn start(
        endpoint: &str,
        run: &str,
        robot: &str,
        hangs_from: Option<(Epoch, Tick)>,
    ) -> JoinHandle<()> {
        let role = Role::Client {
            connect: endpoint.to_owned(),
            patience: Duration::from_secs(20),
        };
        let run = RunName::new(run).unwrap();
        let own = RobotName::new(robot).unwrap();

        thread::spawn(move || {
            let bus = Bus::open(&role, None).unwrap();
            let keys = Keys::new(&run);
            let (sender, arrived) = channel();
            let updates = sender.clone();
            let clock = bus.subscribe(&keys.clock(), move |key, bytes| {
                let clock = decode(key, "simulator", bytes).unwrap();
                let _ = sender.send(Arrived::Clock(clock));
            });
            let news = bus.subscribe(&keys.news(&own), move |key, bytes| {
                let update = decode(key, "simulator", bytes).unwrap();
                let _ = updates.send(Arrived::Update(Box::new(update)));
            });

            let welcome = welcome(&bus, &keys, &run, &own);
            let token = bus.token(&keys.alive_robot(&own)).unwrap();
            let robot = Self {
                bus,
                keys,
                run,
                name: own,
                arrived,
                declared: vec![clock.unwrap(), news.unwrap(), token],
                hangs_from,
                is_hung: false,
                welcome,
                has_begun: false,
                pending: None,
                updates: BTreeMap::new(),
                answered: None,
            };
            robot.play();
        })
    }

    fn play(mut self) {
        loop {
            match self.arrived.recv_timeout(PATIENCE).expect("a clock") {
                Arrived::Clock(Clock { end: Some(_), .. }) => break,
                Arrived::Clock(clock) => self.on_clock(clock),
                Arrived::Update(update) => self.on_update(*update),
            }
            self.run_if_possible();
        }

        self.declared.clear();
        self.bus.close();
    }

    fn join_again(&mut self) {
        self.welcome = welcome(&self.bus, &self.keys, &self.run, &self.name);
        // All that has come until the welcome was read, also what has come behind it.
        while self.arrived.try_recv().is_ok() {}
        self.is_hung = false;
        self.has_begun = false;
        self.pending = None;
        self.updates.clear();
        self.answered = None;
    }

    fn on_clock(&mut self, clock: Clock) {
        let at = (clock.epoch, clock.tick);
        if clock.epoch > self.welcome.epoch {
            self.join_again();
            return;
        }
        if self.hangs_from.is_some_and(|from| at >= from) {
            self.hangs_from = None;
            self.is_hung = true;
        }
        if clock.epoch < self.welcome.epoch || self.is_hung {
            return;
        }

        match &self.answered {
            Some(report) if (report.epoch, report.tick) == at => self.put(report),
            Some(report) if (report.epoch, report.tick) > at => {}
            _ => self.pending = Some(clock),
        }
    }

    fn on_update(&mut self, update: TickUpdate) {
        if update.epoch == self.welcome.epoch && update.rejoin == Some(self.welcome.generation) {
            self.join_again();
        } else {
            self.updates.insert((update.epoch, update.tick), update);
        }
    }

    fn run_if_possible(&mut self) {
        let Some(clock) = self.pending else { return };
        let update = self.updates.remove(&(clock.epoch, clock.tick));
        let has_news = clock.news & self.welcome.news_flag != 0;
        if has_news && update.is_none() {
            return;
        }
        self.pending = None;
        let joined = update.as_ref().and_then(|update| update.joined);
        let begins = clock.tick == 0 && self.welcome.generation == 1;
        if !self.has_begun && !begins && joined != Some(self.welcome.generation) {
            return;
        }

        self.has_begun = true;
        let corrected = update.and_then(|update| update.correction);
        let mut report = standing(&self.welcome, clock.tick);
        report.epoch = clock.epoch;
        if let Some(correction) = corrected {
            report.proposal = correction.location;
        }
        self.put(&report);
        self.answered = Some(report);
    }

    fn put(&self, report: &Report) {
        let key = self.keys.report(&self.name);
        self.bus.put(&key, encode(report)).unwrap();
    }
}

/// Asks until the simulator welcomes the robot.
fn welcome(bus: &Bus, keys: &Keys, run: &RunName, robot: &RobotName) -> Welcome {
    let request = json!({
        "protocol": PROTOCOL_VERSION, "run": run, "name": robot, "instance": bus.id(),
    });

    eventually("a welcome", || {
        let body = Some(request.to_string().into_bytes());
        let reply = bus.get(&keys.join_as(robot), "", body).unwrap()?;
        match decode("join", "simulator", &reply.result.unwrap()).unwrap() {
            JoinAnswer::Welcome(welcome) => Some(*welcome),
            JoinAnswer::Refused { explanation, .. } => panic!("{explanation}"),
        }
    })
}

/// A simulator whose two robots are forgetful.
struct ForgetfulRun {
    lab: Lab,
    simulator: Running,
    endpoint: String,
    run: &'static str,
}

impl ForgetfulRun {
    fn start(run: &'static str) -> Self {
        let lab = Lab::new();
        let scenario = lab.write("forgetful.toml", SCENARIO);
        let endpoint = format!("tcp/127.0.0.1:{}", free_port());
        let mut command = Command::new(programs().join("cars-sim"));
        command
            .arg(scenario)
            .args(["--run", run, "--listen", &endpoint, "--speed", "20"])
            .args(["--stay", "--out"])
            .arg(lab.out());
        let simulator = Running::start(command, run, lab.out().join(run));

        Self {
            lab,
            simulator,
            endpoint,
            run,
        }
    }

    fn control(&self, bus: &Bus, control: &Control) {
        let keys = Keys::new(&RunName::new(self.run).unwrap());
        let reply = eventually("an answer", || {
            bus.get(&keys.control(), "", Some(encode(control))).unwrap()
        });
        match decode("control", "simulator", &reply.result.unwrap()).unwrap() {
            ControlAnswer::Done(_) => {}
            other => panic!("{other:?}"),
        }
    }

    /// The ticks in which a robot joined and missed its turn, once the epoch is complete.
    fn events(&self) -> Vec<Value> {
        let is_last = |event: &Value| event["event"] == "tick" && event["tick"] == LAST_TICK;
        eventually("the last tick", || {
            let text = std::fs::read_to_string(self.lab.file(self.run, "events.jsonl")).ok()?;
            let events: Vec<Value> = text
                .lines()
                .filter_map(|line| serde_json::from_str(line).ok())
                .collect();
            events.iter().any(is_last).then_some(events)
        })
    }

    /// Plays two epochs, and returns why they are not as they must be. The robots put so many messages that are malformed.
    fn play(
        mut self,
        robots: impl FnOnce(&str, &str) -> Vec<JoinHandle<()>>,
        malformed: u64,
    ) -> Result<(), String> {
        let role = Role::Client {
            connect: self.endpoint.clone(),
            patience: Duration::from_secs(20),
        };
        let bus = Bus::open(&role, None).unwrap();
        let robots = robots(&self.endpoint, self.run);

        let first = self.events();
        let summary = self.lab.file(self.run, "summary.json");
        eventually("the summary", || summary.exists().then_some(()));
        let ignored = self.lab.summary(self.run)["wall"]["ignored"]["malformed"].clone();
        assert_eq!(ignored.as_u64().unwrap_or(0), malformed);
        self.control(
            &bus,
            &Control::Init {
                seed: None,
                setup: None,
                epoch: None,
            },
        );
        self.control(&bus, &Control::Start);
        // The record of an epoch that is over has its number.
        let kept = self.lab.file(self.run, "events-epoch1.jsonl");
        eventually("epoch 2", || kept.exists().then_some(()));
        let second = self.events();
        self.control(&bus, &Control::Stop);
        self.simulator.finish();
        for robot in robots {
            robot.join().expect("a robot ends when the run does");
        }

        judge(&first, &second)
    }
}

/// The ticks of the events of a kind that are about a robot.
fn ticks(events: &[Value], kind: &str, robot: &str) -> Vec<Tick> {
    events
        .iter()
        .filter(|event| event["event"] == kind && event["robot"] == robot)
        .map(|event| event["tick"].as_u64().unwrap())
        .collect()
}

/// Only A misses ticks: from its hang until it has joined again, once.
fn judge(first: &[Value], second: &[Value]) -> Result<(), String> {
    for robot in ["A", "B"] {
        let missed = ticks(first, "missed", robot);
        if !missed.is_empty() {
            return Err(format!("{robot} missed {missed:?} of epoch 1"));
        }
    }
    let missed = ticks(second, "missed", "B");
    if !missed.is_empty() {
        return Err(format!("B missed {missed:?} of epoch 2"));
    }

    let missed = ticks(second, "missed", "A");
    let joined = ticks(second, "joined", "A");
    let back = joined.last().copied().unwrap_or_default();
    let hung = HANG_FROM.1..back;
    if joined.iter().filter(|tick| **tick > 0).count() != 1
        || !missed.iter().all(|tick| hung.contains(tick))
    {
        return Err(format!(
            "A missed {missed:?} of epoch 2, and joined at {joined:?}"
        ));
    }
    Ok(())
}

/// A machine that stands still makes any robot late: then once more.
fn assert_in_time(
    run: &'static str,
    malformed: u64,
    robots: impl Fn(&str, &str) -> Vec<JoinHandle<()>>,
) {
    for attempt in 1.. {
        let stalls = Stalls::watch();
        let Err(reason) = ForgetfulRun::start(run).play(&robots, malformed) else {
            return;
        };
        let is_to_blame = stalls.longer_than(LONGEST_STALL) > 0;
        assert!(is_to_blame && attempt < MAX_ATTEMPTS, "{reason}");
    }
}

#[test]
fn what_comes_before_a_welcome_comes_again_behind_it() {
    assert_in_time("welcomes", 0, |endpoint, run| {
        vec![
            ForgetfulRobot::start(endpoint, run, "A", Some(HANG_FROM)),
            ForgetfulRobot::start(endpoint, run, "B", None),
        ]
    });
}

/// With a client that reads its welcome on another thread than clock and news: what comes right behind it may be dropped, too.
/// And what a client deletes is a malformed message.
#[test]
fn what_comes_before_a_welcome_comes_again_for_a_client_in_python() {
    const DELETED: u64 = 4;
    let install = "pip install eclipse-zenoh";
    if !has_modules("robots over eclipse-zenoh", "zenoh", install) {
        return;
    }
    let start = |endpoint: &str, run: &str, more: &[&str]| {
        let mut command = Command::new("python3");
        command
            .arg(root().join("tests/python/forgetful.py"))
            .args(["--run", run, "--connect", endpoint])
            .args(more);
        mark(&mut command);
        thread::spawn(move || {
            let status = command.status().unwrap();
            assert!(status.success(), "{status}");
        })
    };

    assert_in_time("welcomes-python", DELETED, |endpoint, run| {
        let (epoch, tick) = HANG_FROM;
        let from = [epoch.to_string(), tick.to_string()];
        let hangs = ["--name", "A", "--hangs-from", &from[0], &from[1]];
        vec![
            start(endpoint, run, &hangs),
            start(endpoint, run, &["--name", "B", "--deletes"]),
        ]
    });
}

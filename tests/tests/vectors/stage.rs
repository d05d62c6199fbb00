//! A run of the real simulator and the real robots' loop over a network in this process, stepped by hand, so that all
//! that is said in a tick can be told apart from the next.

use std::path::Path;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bus::{Bus, Declared, Faults, MemoryNetwork, Overheard, Reply};
use protocol::keys::{Keys, STATE};
use protocol::messages::{Control, ControlAnswer, Phase, Presence, Status};
use protocol::{RobotName, RunName, Tick, decode, encode};
use robot::{Host, HostError, HostOptions, Robot};
use simulator::scenario::Changes;
use simulator::server::{Options, Server};
use simulator::{RunFolder, Scenario};
use system_tests::{PATIENCE, eventually, root};

use crate::transcript::Transcript;

/// Longer than any step: the clock is repeated only where a test does it.
const NEVER: Duration = Duration::from_secs(600);

pub(super) fn name(name: &str) -> RobotName {
    RobotName::new(name).unwrap()
}

pub(super) struct Stage {
    network: MemoryNetwork,
    /// Sees everything and asks.
    observer: Bus,
    pub(super) keys: Keys,
    run: RunName,
    robot: RobotName,
    process: Option<Bus>,
    threads: Vec<JoinHandle<()>>,
    pub(super) transcript: Transcript,
    _watching: Vec<Declared>,
    _folder: tempfile::TempDir,
}

impl Stage {
    /// A run of a scenario of the project, before anybody has joined. `robot` is the one whose story is told.
    pub(super) fn new(scenario: &str, set: &[&str], robot: &str) -> Self {
        let (run, robot) = (RunName::new("vectors").unwrap(), name(robot));
        let keys = Keys::new(&run);
        let set = set
            .iter()
            .map(|change| change.parse().expect("a legal change"))
            .collect();
        let changes = Changes {
            set,
            ..Changes::default()
        };
        let loaded = Scenario::load(&root().join(Path::new(scenario)), &changes)
            .unwrap_or_else(|error| panic!("{error}"));
        let network = MemoryNetwork::new(0, Faults::default());
        let (folder, router) = (tempfile::tempdir().unwrap(), network.router());
        let options = Options {
            run: run.clone(),
            speed: None,
            is_paused: true,
            repeat_after: NEVER,
        };
        let server = Server::open(router, &loaded, options).unwrap();
        let run_folder = RunFolder::new(folder.path(), &run);
        let lock = run_folder.create(&loaded).unwrap();
        let simulator = std::thread::spawn(move || {
            let _lock = lock;
            server.run(loaded, &run_folder).unwrap();
        });
        let observer = network.client();
        // With a subscriber from the beginning, robots put all of their states: whatever a robot can query is overheard.
        let watch = |key: String| observer.subscribe(&key, |_, _| {}).unwrap();
        let watching = vec![watch(
            keys.query(&robot, STATE).replace(robot.as_str(), "*"),
        )];
        let transcript = Transcript::new(keys.clone(), robot.clone(), scenario);
        // Who is answered knows that the simulator is there, and that what it declared before it asked is in effect.
        let status = encode(&Control::Status);
        eventually("the simulator", || {
            observer
                .get(&keys.control(), "", Some(status.clone()))
                .unwrap()
        });
        let _ = network.overhear(); // The story begins here.
        Self {
            network,
            observer,
            keys,
            run,
            robot,
            process: None,
            threads: vec![simulator],
            transcript,
            _watching: watching,
            _folder: folder,
        }
    }

    /// A robot of the SDK takes part as a process of its own, as it would over a network.
    pub(super) fn seat(&mut self, who: &str, make: fn() -> Box<dyn Robot>) {
        let (bus, who) = (self.network.client(), name(who));
        if who == self.robot {
            self.process = Some(bus.clone());
        }
        let options = HostOptions {
            run: self.run.clone(),
            connect: "this process".to_owned(),
            patience: Duration::from_secs(20),
            gone_patience: Duration::from_secs(1),
            zenoh_config: None,
        };
        self.threads.push(std::thread::spawn(move || {
            match Host::join_over(bus, vec![(who, make())], options).and_then(Host::run) {
                // One that is killed here finds its link broken.
                Ok(_) | Err(HostError::SimulatorGone(_) | HostError::Bus(_)) => {}
                Err(error) => panic!("{error}"),
            }
        }));
    }

    /// Kills the process of the robot whose story is told, between two ticks.
    pub(super) fn kill(&mut self) {
        let process = self.process.take().expect("it has been seated");
        self.network.kill(&process);
        self.wait_until("it is gone", |status| {
            self.presence(status) == Presence::Gone
        });
        self.write();
    }

    /// Waits until the process of the robot is there, and as this incarnation.
    pub(super) fn wait_for(&self, generation: u32) {
        self.wait_until("it is there", |status| {
            let robot = status
                .robots
                .iter()
                .find(|robot| robot.name == self.robot)
                .expect("it is of the roster");
            (robot.generation, robot.presence) == (generation, Presence::Here)
        });
    }

    fn presence(&self, status: &Status) -> Presence {
        status
            .robots
            .iter()
            .find(|robot| robot.name == self.robot)
            .expect("it is of the roster")
            .presence
    }

    fn control(&self, control: &Control) -> Status {
        let answer = self
            .observer
            .get(&self.keys.control(), "", Some(encode(control)))
            .unwrap();
        let bytes = answer.expect("the simulator answers").result.unwrap();
        match decode("control", "simulator", &bytes).unwrap() {
            ControlAnswer::Done(status) => *status,
            other => panic!("{control:?}: {other:?}"),
        }
    }

    fn wait_until(&self, what: &str, is_so: impl Fn(&Status) -> bool) {
        eventually(what, || {
            is_so(&self.control(&Control::Status)).then_some(())
        });
    }

    /// Files what has been said since the last time.
    fn write(&mut self) {
        self.transcript.add(&self.network.overhear());
    }

    /// Waits for tick 0 of an epoch.
    pub(super) fn begin(&mut self, epoch: u32) {
        self.wait_until("tick 0", |status| {
            (status.epoch, status.phase) == (epoch, Phase::Ready)
        });
        self.write();
    }

    /// Steps to this tick.
    pub(super) fn step_to(&mut self, last: Tick) {
        loop {
            let tick = self.control(&Control::Status).tick;
            if tick >= last {
                return;
            }
            self.control(&Control::Step { n: 1 });
            self.wait_until("the step", |status| {
                status.tick == tick + 1 && status.pending_steps == 0
            });
            self.write();
        }
    }

    /// Does something at the simulator that is not part of the robot's story.
    pub(super) fn order(&self, control: &Control) {
        self.control(control);
    }

    /// Puts a command to the robot as an operator does, with any tool.
    pub(super) fn command_as_operator(&self, payload: &str) {
        let key = self.keys.command(&self.robot, &RobotName::operator());
        self.observer
            .put(&key, payload.as_bytes().to_vec())
            .unwrap();
    }

    /// Puts the last clock again, and waits for the robot's answer.
    pub(super) fn repeat_clock(&mut self, clock: &[u8]) {
        self.observer
            .put(&self.keys.clock(), clock.to_vec())
            .unwrap();
        let report = self.keys.report(&self.robot);
        let mut heard = Vec::new();
        eventually("the report again", || {
            heard.extend(self.network.overhear());
            let is_report =
                |one: &Overheard| matches!(one, Overheard::Put { key, .. } if *key == report);
            heard.iter().any(is_report).then_some(())
        });
        self.transcript.add(&heard);
    }

    /// Asks the robot, and files what it says.
    pub(super) fn ask(&mut self, what: &str, parameters: &str) {
        let key = self.keys.query(&self.robot, what);
        if let Some(Reply { result, .. }) = self.observer.get(&key, parameters, None).unwrap() {
            self.transcript.asked(&key, parameters, &result);
        }
    }

    /// Ends the run, and waits for everybody.
    pub(super) fn end(mut self) -> String {
        self.control(&Control::Stop);
        let begun = Instant::now();
        for thread in std::mem::take(&mut self.threads) {
            assert!(begun.elapsed() < PATIENCE, "it does not end");
            thread.join().unwrap();
        }
        self.write();
        self.transcript.text()
    }
}

//! A client that floods a run: with messages that mean nothing, that are old or that no participant puts, and with
//! connections that send nothing. In a secured run it has the certificate of one robot.
//!
//! In a run that is not secured, any client can put a message that is indistinguishable from a participant's
//! (`docs/security.md`). There it forges only what no participant would put: another epoch, tick or incarnation.

use std::net::TcpStream;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bus::{Bus, Role};
use protocol::keys::{Keys, STATE};
use protocol::messages::{
    Clock, Command, Control, ControlAnswer, End, JoinAnswer, Payload, Performative, Point, Report,
    StateVariables, Target, TickUpdate, Waiting,
};
use protocol::random::{Stream, stream};
use protocol::{Epoch, Generation, PROTOCOL_VERSION, RobotName, RunName, Tick, decode, encode};
use serde_json::{Value, json};

use super::plan::{Flood, below, milliseconds};

/// Bursts of a flood.
const BURSTS: usize = 4;
/// Connections that send nothing: fewer than keep participants out (`docs/security.md`).
const CONNECTIONS: usize = 60;
/// Messages that are recorded before a flood of stale ones.
const RECORDED: usize = 300;
/// How long they are recorded at most: a clock that is held is repeated every 2 s.
const RECORDING: Duration = Duration::from_secs(3);
/// How long to wait for the first one of them.
const PATIENCE: Duration = Duration::from_secs(30);
/// How long to wait for a reply to a query that may get none.
const REPLY: Duration = Duration::from_millis(300);
/// An epoch that never begins in these runs.
const OTHER_EPOCH: Epoch = 99;
/// A tick and an incarnation that these runs never reach.
const FAR: u32 = 1_000_000_000;

/// A key, and what is put on it.
type Message = (String, Vec<u8>);

/// Where a rogue client connects, and as what.
#[derive(Debug, Clone)]
pub(super) struct Rogue {
    /// Endpoint of the simulator.
    pub(super) endpoint: String,
    /// Zenoh configuration of the robot whose certificate it has, in a secured run: that of the first robot.
    pub(super) stolen: Option<PathBuf>,
    pub(super) run: RunName,
    pub(super) robots: Vec<RobotName>,
    /// Messages of a burst.
    pub(super) burst: usize,
}

impl Rogue {
    /// Floods the run. Returns how many messages it put, or how many connections it opened.
    pub(super) fn flood(&self, flood: Flood, seed: u64) -> usize {
        let mut chance = stream(seed, "rogue");
        if flood == Flood::Silent {
            return self.connect_silently(&mut chance);
        }

        let role = Role::Client {
            connect: self.endpoint.clone(),
            patience: Duration::from_secs(20),
        };
        let bus = Bus::open(&role, self.stolen.as_ref()).unwrap();
        let intruder = Intruder {
            rogue: self,
            keys: Keys::new(&self.run),
            bus,
        };
        let put = match flood {
            Flood::Rubbish => intruder.put_rubbish(&mut chance),
            Flood::Stale => intruder.put_stale(&mut chance),
            Flood::Forged => intruder.put_forged(&mut chance),
            Flood::Silent => 0,
        };
        intruder.bus.close();

        put
    }

    fn connect_silently(&self, chance: &mut Stream) -> usize {
        let (_, address) = self.endpoint.split_once('/').unwrap();
        let connections: Vec<TcpStream> = (0..CONNECTIONS)
            .map(|_| TcpStream::connect(address).unwrap())
            .collect();
        std::thread::sleep(milliseconds(chance, 500, 2500));

        connections.len()
    }
}

/// A session of the rogue client.
struct Intruder<'a> {
    rogue: &'a Rogue,
    keys: Keys,
    bus: Bus,
}

impl Intruder<'_> {
    fn is_secured(&self) -> bool {
        self.rogue.stolen.is_some()
    }

    fn robot(&self, chance: &mut Stream) -> &RobotName {
        &self.rogue.robots[below(chance, self.rogue.robots.len())]
    }

    /// Puts bursts of messages, with pauses between them.
    fn burst(&self, chance: &mut Stream, mut draw: impl FnMut(&mut Stream) -> Message) -> usize {
        for _ in 0..BURSTS {
            for _ in 0..self.rogue.burst {
                let (key, message) = draw(chance);
                self.bus.put(&key, message).unwrap();
            }
            std::thread::sleep(milliseconds(chance, 50, 200));
        }

        BURSTS * self.rogue.burst
    }

    fn put_rubbish(&self, chance: &mut Stream) -> usize {
        let put = self.burst(chance, |chance| (self.any_key(chance), rubbish(chance)));

        for key in [self.keys.control(), self.keys.join()] {
            self.is_refused(&key, rubbish(chance));
        }
        put
    }

    /// Any key of the run on which something is put.
    fn any_key(&self, chance: &mut Stream) -> String {
        let keys = &self.keys;
        let robot = self.robot(chance);
        let other = self.robot(chance);

        match below(chance, 16) {
            0 => keys.clock(),
            1 => keys.world(),
            2 => keys.log(),
            3 => keys.faults(),
            4 | 5 => keys.report(robot),
            6 => keys.waiting(robot),
            7 => keys.news(robot),
            8 => keys.panel(robot),
            9 => keys.query(robot, STATE),
            10 => keys.command(robot, other),
            11 => keys.command(robot, &RobotName::operator()),
            12 => keys.report(&unknown()),
            13 => keys.alive_robot(robot),
            14 => keys.reports(),
            _ => keys.all(),
        }
    }

    /// Records what is put in the run, then puts it again.
    fn put_stale(&self, chance: &mut Stream) -> usize {
        let thief = &self.rogue.robots[0];
        let allowed = if self.is_secured() {
            vec![self.keys.clock(), self.keys.news(thief)]
        } else {
            vec![self.keys.all()]
        };
        let recorded: Arc<Mutex<Vec<Message>>> = Arc::default();
        let recording: Vec<_> = allowed
            .iter()
            .map(|key| {
                let recorded = recorded.clone();
                let record = move |key: &str, message: &[u8]| {
                    let mut recorded = recorded.lock().expect("no panic");
                    if recorded.len() < RECORDED && is_of_run(message) {
                        recorded.push((key.to_owned(), message.to_vec()));
                    }
                };
                self.bus.subscribe(key, record).unwrap()
            })
            .collect();

        let begun = Instant::now();
        let goes_on = || {
            let count = recorded.lock().expect("no panic").len();
            // The machine may stand still as long as the recording lasts.
            let is_time_over = begun.elapsed() >= RECORDING && count > 0;
            count < RECORDED && !is_time_over && begun.elapsed() < PATIENCE
        };
        while goes_on() {
            std::thread::sleep(Duration::from_millis(10));
        }
        drop(recording);

        let recorded = recorded.lock().expect("no panic").clone();
        assert!(!recorded.is_empty(), "nothing was put for {PATIENCE:?}");
        self.burst(chance, |chance| {
            recorded[below(chance, recorded.len())].clone()
        })
    }

    fn put_forged(&self, chance: &mut Stream) -> usize {
        let put = self.burst(chance, |chance| {
            if self.is_secured() && below(chance, 2) == 0 {
                self.forged_in_the_open_tick(chance)
            } else {
                self.forged(chance)
            }
        });

        self.join_as_another();
        if self.is_secured() {
            let stop = encode(&Control::Stop);
            let reply = self
                .bus
                .get_within(&self.keys.control(), "", Some(stop), REPLY)
                .unwrap();
            assert!(
                reply.is_none(),
                "a robot may not control the run: {reply:?}"
            );
            let robot = &self.rogue.robots[1];
            drop(self.bus.token(&self.keys.alive_robot(robot)).unwrap());
        }
        drop(self.bus.token(&self.keys.alive_robot(&unknown())).unwrap());
        put
    }

    /// A message of an epoch, a tick or an incarnation that the run does not have.
    fn forged(&self, chance: &mut Stream) -> Message {
        let keys = &self.keys;
        let robot = self.robot(chance);
        let other = self.robot(chance);
        let epoch = if below(chance, 2) == 0 {
            0
        } else {
            OTHER_EPOCH
        };
        let tick = below(chance, 1000) as Tick;

        match below(chance, 8) {
            0 => {
                let clock = Clock {
                    epoch,
                    tick,
                    ..Clock::default()
                };
                (keys.clock(), encode(&clock))
            }
            1 => (keys.report(robot), encode(&report(epoch, tick, 1))),
            2 => {
                let report = report(1, Tick::from(FAR), 1);
                (keys.report(robot), encode(&report))
            }
            3 => (keys.report(robot), encode(&report(1, tick, FAR))),
            4 => (keys.report(&unknown()), encode(&report(1, tick, 1))),
            5 => {
                let command = Command {
                    epoch,
                    tick,
                    generation: 1,
                    number: below(chance, 1000) as u32,
                    to: Some(Target::Others),
                    performative: Performative::Achieve,
                    command: "refill".to_owned(),
                    payload: Payload::new(serde_json::json!({ "rogue": true })),
                };
                let key = if tick.is_multiple_of(2) {
                    keys.outbox(robot)
                } else {
                    keys.command(other, robot)
                };
                (key, encode(&command))
            }
            6 => {
                let news = TickUpdate {
                    epoch,
                    tick,
                    unreachable: vec![other.clone()],
                    ..TickUpdate::default()
                };
                (keys.news(robot), encode(&news))
            }
            _ => {
                let waiting = Waiting {
                    epoch,
                    tick,
                    on: other.clone(),
                };
                (keys.waiting(robot), encode(&waiting))
            }
        }
    }

    /// A message that would change the run if access control did not drop it.
    fn forged_in_the_open_tick(&self, chance: &mut Stream) -> Message {
        let keys = &self.keys;
        // Any robot but the one whose certificate it has.
        let robot = &self.rogue.robots[1 + below(chance, self.rogue.robots.len() - 1)];
        let tick = below(chance, 5000) as Tick;
        let clock = Clock {
            epoch: 1,
            tick: Tick::from(FAR),
            ..Clock::default()
        };

        match below(chance, 5) {
            0 => (keys.clock(), encode(&clock)),
            1 => {
                let end = Clock {
                    end: Some(End::Stopped),
                    ..clock
                };
                (keys.clock(), encode(&end))
            }
            2 => {
                let news = TickUpdate {
                    epoch: 1,
                    tick,
                    unreachable: self.rogue.robots.clone(),
                    ..TickUpdate::default()
                };
                (keys.news(robot), encode(&news))
            }
            3 => (keys.report(robot), encode(&report(1, tick, 1))),
            _ => {
                let command = Command {
                    command: "refill".to_owned(),
                    ..Command::default()
                };
                let operator = RobotName::operator();
                (keys.command(robot, &operator), encode(&command))
            }
        }
    }

    /// Asks to join as a robot that is not in the scenario, and by another protocol; with a stolen certificate also as the
    /// robot of another one.
    fn join_as_another(&self) {
        let request = |robot: &RobotName, protocol: u32| {
            let request = json!({
                "protocol": protocol,
                "run": self.rogue.run,
                "name": robot,
                "instance": "rogue",
            });
            request.to_string().into_bytes()
        };
        let robot = &self.rogue.robots[1];

        let as_unknown = request(&unknown(), PROTOCOL_VERSION);
        self.is_refused(&self.keys.join(), as_unknown);
        let as_other_protocol = request(robot, PROTOCOL_VERSION + 1);
        self.is_refused(&self.keys.join(), as_other_protocol);
        if self.is_secured() {
            let as_robot = request(robot, PROTOCOL_VERSION);
            self.is_refused(&self.keys.join_as(robot), as_robot);
        }
    }

    /// Sends a query that must be refused, or dropped.
    fn is_refused(&self, key: &str, body: Vec<u8>) {
        let reply = self.bus.get_within(key, "", Some(body), REPLY).unwrap();
        let Some(Ok(answer)) = reply.map(|reply| reply.result) else {
            return;
        };

        let is_refused = if key == self.keys.control() {
            let answer = decode(key, "simulator", &answer).unwrap();
            matches!(answer, ControlAnswer::Refused { .. })
        } else {
            let answer = decode(key, "simulator", &answer).unwrap();
            matches!(answer, JoinAnswer::Refused { .. })
        };
        assert!(
            is_refused,
            "{key} accepted: {}",
            String::from_utf8_lossy(&answer)
        );
    }
}

/// Whether a message is of a tick of the run, and not the rubbish of another flood.
fn is_of_run(message: &[u8]) -> bool {
    serde_json::from_slice::<Value>(message).is_ok_and(|message| message["epoch"] == 1)
}

/// A robot that is not in the scenario.
fn unknown() -> RobotName {
    RobotName::new("Zed").unwrap()
}

/// A report of a robot that wants to be elsewhere.
fn report(epoch: Epoch, tick: Tick, generation: Generation) -> Report {
    Report {
        epoch,
        tick,
        generation,
        proposal: Point { x: 1.0, y: 1.0 },
        speed_mps: 1.0,
        direction_rad: 0.0,
        emotion_state: "FORGED".into(),
        behavior_state: "FORGED".into(),
        state_variables: StateVariables::new(),
        commands: 0,
        log: Vec::new(),
        site_actions: Vec::new(),
        layer_actions: Vec::new(),
        velocity: None,
    }
}

/// Bytes that are no message.
fn rubbish(chance: &mut Stream) -> Vec<u8> {
    match below(chance, 8) {
        0 => Vec::new(),
        1 => b"{}".to_vec(),
        2 => b"[[[[[[[[".repeat(64),
        3 => br#"{"epoch":1,"tick":"#.to_vec(),
        4 => br#"{"epoch":-1,"tick":1e400,"generation":null}"#.to_vec(),
        5 => br#"{"epoch":1,"epoch":1,"tick":18446744073709551616}"#.to_vec(),
        6 if below(chance, 20) == 0 => vec![b'x'; 100_000],
        _ => {
            let bytes = below(chance, 2000);
            (0..bytes).map(|_| below(chance, 256) as u8).collect()
        }
    }
}

//! An observer of a run over zenoh: that what is put there is in a transcript, byte for byte.

use std::sync::mpsc::{Receiver, channel};

use bus::{Bus, Declared, Role};
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer};
use protocol::{RobotName, RunName, Tick, decode, encode};
use system_tests::{PATIENCE, eventually, root};

pub(super) struct Witness {
    bus: Bus,
    keys: Keys,
    robot: RobotName,
    received: Receiver<String>,
    _subscribers: Vec<Declared>,
}

impl Witness {
    /// Subscribes to what `robot` receives and puts.
    pub(super) fn new(endpoint: &str, run: &RunName, robot: &str) -> Self {
        let role = Role::Client {
            connect: endpoint.to_owned(),
            patience: PATIENCE,
        };
        let bus = Bus::open(&role, None).unwrap();
        let keys = Keys::new(run);
        let robot = RobotName::new(robot).unwrap();

        let (sender, received) = channel();
        let mut subscribers = Vec::new();
        for key in [
            keys.clock(),
            keys.news(&robot),
            keys.report(&robot),
            keys.outbox(&robot),
        ] {
            let sender = sender.clone();
            let subscriber = bus.subscribe(&key, move |key, bytes| {
                let message = String::from_utf8(bytes.to_vec()).unwrap();
                let _is_over = sender.send(format!(r#""key":"{key}","message":{message}}}"#));
            });
            subscribers.push(subscriber.unwrap());
        }

        Self {
            bus,
            keys,
            robot,
            received,
            _subscribers: subscribers,
        }
    }

    /// Waits until the simulator carries this out. Its reply shows that what was declared and put before is in effect.
    pub(super) fn control(&self, control: &Control) {
        let request = encode(control);
        eventually("the simulator", || {
            let reply = self
                .bus
                .get_within(&self.keys.control(), "", Some(request.clone()), PATIENCE)
                .unwrap()?;
            let answer = reply.result.unwrap();
            let answer: ControlAnswer = decode("control", "simulator", &answer).unwrap();
            matches!(answer, ControlAnswer::Done(_)).then_some(())
        });
    }

    /// Steps so many ticks, once all robots have joined.
    pub(super) fn step(&self, n: Tick) {
        self.control(&Control::Step { n });
    }

    /// Sends a command to the robot as an operator does.
    pub(super) fn command_as_operator(&self, command: &str) {
        let payload = serde_json::json!({ "command": command }).to_string();
        let key = self.keys.command(&self.robot, &RobotName::operator());
        self.bus.put(&key, payload.into_bytes()).unwrap();
    }

    /// Asserts that the messages of a transcript from this tick of epoch 1 on are received.
    pub(super) fn assert_received(&self, file: &str, from: Tick) {
        let mut wanted = messages(file, from);
        assert!(wanted.len() > 60, "{}", wanted.len());

        while !wanted.is_empty() {
            let line = self
                .received
                .recv_timeout(PATIENCE)
                .unwrap_or_else(|_| panic!("not received: {wanted:#?}"));
            // Which ticks observers are shown depends on the machine, and so do these flags of clocks.
            let line = line.replace(r#","panels":true"#, "");
            // On a slow machine a clock is repeated.
            wanted.retain(|wanted| *wanted != line);
        }
    }
}

/// The messages of a transcript from this tick of epoch 1 on, each line from its key on. Without states, which are put only for
/// subscribers, and without the end, which depends on when a test orders it.
fn messages(file: &str, from: Tick) -> Vec<String> {
    let text = std::fs::read_to_string(root().join("docs/vectors").join(file)).unwrap();
    let first = format!(r#""message":{{"epoch":1,"tick":{from},"#);
    let mut messages = Vec::new();
    for line in text.lines().skip_while(|line| !line.contains(&first)) {
        let is_message = line.starts_with(r#"{"way":"to""#) || line.starts_with(r#"{"way":"from""#);
        if is_message && !line.contains("/state\"") && !line.contains(r#""end""#) {
            let (_, rest) = line.split_once(',').unwrap();
            messages.push(rest.to_owned());
        }
    }

    messages
}

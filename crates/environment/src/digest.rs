//! Digests: runs are equal if and only if their digests are. They cover typed values in a fixed order, not the encoding in
//! which a robot sent them.

use protocol::messages::{Payload, Point, Report, StateVariables, Variable};
use protocol::{Event, RobotName, Tick};

use crate::medium::SentCommand;
use world::Pose;
use xxhash_rust::xxh3::xxh3_128;

/// A chain of digests, one for each tick; each covers all ticks before it.
#[derive(Clone, Default)]
pub struct Digest {
    last: u128,
}

impl std::fmt::Display for Digest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:032x}", self.last)
    }
}

/// The digest of one tick, in progress: what it covers so far. To hash it at once is faster than number by number.
pub struct TickDigest {
    bytes: Vec<u8>,
}

/// Bytes of a tick with two robots and a hundred guests.
const USUAL_BYTES: usize = 4096;

impl Digest {
    /// Begins a tick.
    #[must_use]
    pub fn tick(&self, tick: Tick) -> TickDigest {
        let mut next = TickDigest {
            bytes: Vec::with_capacity(USUAL_BYTES),
        };
        next.bytes.extend_from_slice(&self.last.to_le_bytes());
        next.integer(tick);
        next
    }

    /// Ends a tick.
    pub fn close(&mut self, tick: &TickDigest) {
        self.last = xxh3_128(&tick.bytes);
    }
}

impl TickDigest {
    fn integer(&mut self, value: u64) {
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }

    fn number(&mut self, value: f64) {
        // Minus zero and zero are equal.
        let value = if value == 0.0 { 0.0 } else { value };
        self.integer(value.to_bits());
    }

    fn text(&mut self, text: &str) {
        // With the length, different pairs of adjacent texts have different digests.
        self.integer(text.len() as u64);
        self.bytes.extend_from_slice(text.as_bytes());
    }

    /// Adds the location of a body.
    pub fn place(&mut self, x_m: f64, y_m: f64) {
        self.number(x_m);
        self.number(y_m);
    }

    /// Adds that a guest is on the field.
    pub fn guest(&mut self, guest: usize) {
        self.integer(guest as u64);
    }

    /// Adds heading and velocity of a robot with wheels.
    pub fn pose(&mut self, pose: &Pose) {
        self.number(pose.heading_rad);
        self.number(pose.velocity.linear_mps);
        self.number(pose.velocity.angular_radps);
    }

    fn point(&mut self, point: Point) {
        self.place(point.x, point.y);
    }

    /// A payload, by the digest of its canonical JSON. No text has this length, so a command without one is the same as ever.
    fn payload(&mut self, digest: u128) {
        self.integer(u64::MAX);
        self.bytes.extend_from_slice(&digest.to_le_bytes());
    }

    fn variables(&mut self, variables: &StateVariables) {
        self.integer(variables.len() as u64);
        for (name, value) in variables {
            self.text(name);
            self.variable(value);
        }
    }

    fn variable(&mut self, value: &Variable) {
        match value {
            Variable::Flag(flag) => self.integer(u64::from(*flag)),
            Variable::Number(number) => self.number(*number),
            Variable::Text(text) => self.text(text),
        }
    }

    /// Adds what became of the robots' actions on sites.
    pub fn sites(&mut self, events: &[Event]) {
        for event in events {
            match event {
                Event::SiteChanged {
                    robot,
                    site,
                    key,
                    from: _,
                    to,
                } => {
                    self.text(robot.as_str());
                    self.text(site);
                    self.text(key);
                    self.variable(to);
                }
                Event::SiteRefused {
                    robot,
                    site,
                    because,
                } => {
                    self.text(robot.as_str());
                    self.text(site);
                    self.text(because.name());
                }
                _ => {}
            }
        }
    }

    /// Adds what became of a robot's actions on layers.
    pub fn layer_actions(&mut self, events: &[Event]) {
        for event in events {
            match event {
                Event::LayerChanged {
                    robot,
                    layer,
                    cells,
                    change,
                } => {
                    self.text(robot.as_str());
                    self.text(layer);
                    self.integer(u64::from(*cells));
                    self.number(*change);
                }
                Event::LayerRefused {
                    robot,
                    layer,
                    because,
                } => {
                    self.text(robot.as_str());
                    self.text(layer);
                    self.text(because.name());
                }
                _ => {}
            }
        }
    }

    /// Adds the numbers of a layer, by their digest.
    pub fn layer(&mut self, name: &str, cells: u128) {
        self.text(name);
        self.bytes.extend_from_slice(&cells.to_le_bytes());
    }

    /// Adds the report of a robot and the commands that it sent; only its name if it did not report.
    pub fn report(&mut self, robot: &RobotName, report: Option<(&Report, &[SentCommand])>) {
        self.text(robot.as_str());
        let Some((report, commands)) = report else {
            return;
        };

        self.point(report.proposal);
        self.number(report.speed_mps);
        self.number(report.direction_rad);
        self.text(&report.emotion_state);
        self.text(&report.behavior_state);
        self.variables(&report.state_variables);
        let mut last: Option<(&Payload, u128)> = None;
        for command in commands {
            self.text(command.to.as_str());
            self.integer(command.seq);
            self.text(command.text.performative.name());
            self.text(&command.text.command);
            if let Some(payload) = &command.text.payload {
                // One that is sent to many robots is hashed once.
                let digest = match last {
                    Some((same, digest)) if same == payload => digest,
                    _ => xxh3_128(payload.as_json().as_bytes()),
                };
                last = Some((payload, digest));
                self.payload(digest);
            }
        }
        for line in &report.log {
            self.text(line);
        }
        // Only of robots that propose one, so that the digests of all others are as ever.
        if let Some(velocity) = report.velocity {
            self.text("velocity");
            self.number(velocity.linear_mps);
            self.number(velocity.angular_radps);
        }
    }
}

//! A run as a bag of ROS 2: a file of MCAP with the profile `ros2`, which `ros2 bag play`, rosbags, Foxglove and PlotJuggler read.
//!
//! Times are simulated. In every tick there are `/clock`, `/tf` (from `map` to `NAME/base_link`), `/NAME/odom` of every robot, and
//! `/guests`; when they change, `/NAME/emotion`, `/NAME/behavior` and `/NAME/variables` (a JSON object); `/NAME/command` has each
//! command that arrives (a JSON object), and `/events` each event as `events.jsonl` has it.

mod cdr;
mod messages;

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;

use protocol::messages::{Payload, Performative, Seq, StateVariables};
use protocol::{Event, RobotName};
use recording::mcap::{Channels, Chunk, McapFile, MessageHead};
use recording::{Header, RecordedTick, Recording, Ticks};
use serde::Serialize;

use crate::ExportError;
use messages::{MessageStamp, MessageType, PlanePose, PlaneVelocity, text};

/// The frame of all places.
const MAP: &str = "map";
/// A chunk is written when it has this many bytes.
const CHUNK_BYTES: usize = 1 << 20;

/// Writes an epoch.
///
/// # Errors
/// [`ExportError`] if the recording cannot be read to its end, or the bag cannot be written.
pub fn write(recording: Recording, out: &mut impl Write) -> Result<(), ExportError> {
    let header = recording.header().clone();
    let mut channels = Channels::default();
    let mut bag = Bag::begin(&header, &mut channels);
    let mut file = McapFile::begin(out, "ros2", channels.clone())?;
    file.add_chunk(&channels.chunk())?;

    let mut ticks = Ticks::of(recording);
    while let Some(tick) = ticks.next_tick()? {
        bag.add_tick(&header, &tick)?;
        if bag.chunk.len() >= CHUNK_BYTES {
            file.add_chunk(&bag.chunk)?;
            bag.chunk.clear();
        }
    }
    if !bag.chunk.is_empty() {
        file.add_chunk(&bag.chunk)?;
    }
    file.finish()?;
    Ok(())
}

/// The numbers of the channels, and what is written only when it changes.
struct Bag {
    clock: u16,
    transforms: u16,
    guests: u16,
    events: u16,
    robots: BTreeMap<RobotName, RobotTopics>,
    /// Commands on their way, by sender, target and number.
    commands: BTreeMap<(RobotName, RobotName, Seq), CommandOnWay>,
    chunk: Chunk,
}

/// Payloads by sender and number.
type Payloads = BTreeMap<(RobotName, Seq), Payload>;

/// A command that was sent, as its target gets it.
#[derive(Debug, Clone, Serialize)]
struct CommandOnWay {
    sender: RobotName,
    seq: Seq,
    performative: Performative,
    command: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    payload: Option<Payload>,
}

/// What is written of a robot.
struct RobotTopics {
    frame: String,
    odometry: u16,
    emotion: u16,
    behavior: u16,
    variables: u16,
    command: u16,
    last_pose: Option<PlanePose>,
    last_variables: StateVariables,
}

impl Bag {
    fn begin(header: &Header, channels: &mut Channels) -> Self {
        let mut add = |topic: &str, of: MessageType| {
            let schema = channels.add_schema(of.name(), "ros2msg", of.schema().as_bytes());
            channels.add_channel(topic, schema, "cdr")
        };
        let clock = add("/clock", MessageType::Clock);
        let transforms = add("/tf", MessageType::Transforms);
        let guests = add("/guests", MessageType::PoseArray);
        let events = add("/events", MessageType::Text);

        let mut robots = BTreeMap::new();
        for (robot, name) in topic_names(&header.robots) {
            let mut add_own = |topic: &str, of| add(&format!("/{name}/{topic}"), of);
            let topics = RobotTopics {
                frame: format!("{name}/base_link"),
                odometry: add_own("odom", MessageType::Odometry),
                emotion: add_own("emotion", MessageType::Text),
                behavior: add_own("behavior", MessageType::Text),
                variables: add_own("variables", MessageType::Text),
                command: add_own("command", MessageType::Text),
                last_pose: None,
                last_variables: StateVariables::default(),
            };
            robots.insert(robot.clone(), topics);
        }
        Self {
            clock,
            transforms,
            guests,
            events,
            robots,
            commands: BTreeMap::new(),
            chunk: Chunk::default(),
        }
    }

    fn add_tick(&mut self, header: &Header, tick: &RecordedTick) -> Result<(), ExportError> {
        let time_ns = header.time_ns(tick.tick());
        let stamp = MessageStamp {
            time_ns,
            frame: MAP,
        };
        // First, as a node expects it: the time, and then what there is at this time.
        self.add(time_ns, self.clock, |bytes| stamp.clock(bytes));
        self.add_robots(header.tick_s, stamp, tick);

        let guests: Vec<[f64; 2]> = tick.frame.guests().map(|(_, at_m)| at_m).collect();
        self.add(time_ns, self.guests, |bytes| stamp.poses(&guests, bytes));
        self.add_states(time_ns, tick)?;
        self.add_events(time_ns, tick)
    }

    fn add_robots(&mut self, tick_s: f64, stamp: MessageStamp<'_>, tick: &RecordedTick) {
        let mut poses = Vec::new();
        let mut odometry = Vec::new();
        for robot in &tick.frame.robots {
            let Some(topics) = self.robots.get_mut(&robot.name) else {
                continue;
            };
            let report = tick.reports.get(&robot.name);
            let last_rad = topics.last_pose.map(|last| last.heading_rad);
            // A robot that moves in any direction faces where it goes.
            let heading_rad = robot
                .heading_rad
                .or(report.map(|report| report.direction_rad));
            let pose = PlanePose {
                at_m: [robot.location.x, robot.location.y],
                heading_rad: heading_rad.or(last_rad).unwrap_or(0.0),
            };

            let last = topics.last_pose.replace(pose);
            let velocity = last.map_or_else(PlaneVelocity::default, |last| {
                velocity_between(last, pose, tick_s)
            });
            odometry.push((topics.odometry, topics.frame.clone(), pose, velocity));
            poses.push((topics.frame.clone(), pose));
        }

        let poses: Vec<(&str, PlanePose)> = poses
            .iter()
            .map(|(frame, pose)| (frame.as_str(), *pose))
            .collect();
        self.add(stamp.time_ns, self.transforms, |bytes| {
            stamp.transforms(&poses, bytes);
        });
        for (channel, frame, pose, velocity) in odometry {
            self.add(stamp.time_ns, channel, |bytes| {
                stamp.odometry(&frame, pose, velocity, bytes);
            });
        }
    }

    fn add_states(&mut self, time_ns: u64, tick: &RecordedTick) -> Result<(), ExportError> {
        for (robot, report) in &tick.reports {
            let Some(topics) = self.robots.get_mut(robot) else {
                continue;
            };
            if topics.last_variables == report.state_variables {
                continue;
            }

            topics.last_variables.clone_from(&report.state_variables);
            let channel = topics.variables;
            let json = to_json(&report.state_variables)?;
            self.add(time_ns, channel, |bytes| text(&json, bytes));
        }
        Ok(())
    }

    fn add_events(&mut self, time_ns: u64, tick: &RecordedTick) -> Result<(), ExportError> {
        let mut payloads = Payloads::new();
        let mut over = Vec::new();
        for event in tick.events.iter() {
            let json = to_json(event)?;
            self.add(time_ns, self.events, |bytes| text(&json, bytes));

            match event {
                Event::Emotion { robot, to, .. } => {
                    self.add_own(time_ns, robot, |topics| topics.emotion, to);
                }
                Event::Behavior { robot, to, .. } => {
                    self.add_own(time_ns, robot, |topics| topics.behavior, to);
                }
                Event::CommandSent { .. } => self.note_command(event, &mut payloads),
                Event::CommandDelivered { from, to, seq } => {
                    let key = (from.clone(), to.clone(), *seq);
                    if let Some(command) = self.commands.get(&key) {
                        let json = to_json(command)?;
                        self.add_own(time_ns, to, |topics| topics.command, &json);
                    }
                    over.push(key);
                }
                Event::CommandDropped { from, to, seq, .. } => {
                    over.push((from.clone(), to.clone(), *seq));
                }
                // Named one by one, so that a new event has to be decided about here. These have no topic of their own.
                Event::Init { .. }
                | Event::Joined { .. }
                | Event::Lost { .. }
                | Event::Missed { .. }
                | Event::DoneLate { .. }
                | Event::Blocked { .. }
                | Event::CommandDelayed { .. }
                | Event::CommandDuplicated { .. }
                | Event::QueryLost { .. }
                | Event::LinkCut { .. }
                | Event::LinkHealed { .. }
                | Event::Fault { .. }
                | Event::Changed { .. }
                | Event::Say { .. }
                | Event::Guest { .. }
                | Event::GuestEntered { .. }
                | Event::GuestLeft { .. }
                | Event::SiteChanged { .. }
                | Event::SiteRefused { .. }
                | Event::LayerChanged { .. }
                | Event::LayerRefused { .. }
                | Event::Warned { .. }
                | Event::Judged { .. }
                | Event::Tick { .. }
                | Event::End { .. } => {}
            }
        }

        // Only now: a command that was duplicated arrives twice in a tick.
        for key in over {
            self.commands.remove(&key);
        }
        Ok(())
    }

    /// Notes a command that was sent; `payloads` are those of the tick, which several commands may share.
    fn note_command(&mut self, event: &Event, payloads: &mut Payloads) {
        let Event::CommandSent {
            from,
            to,
            seq,
            performative,
            command,
            payload,
            payload_of,
        } = event
        else {
            return;
        };

        if let Some(payload) = payload {
            payloads.insert((from.clone(), *seq), payload.clone());
        }
        let with_payload = (from.clone(), payload_of.unwrap_or(*seq));
        let command = CommandOnWay {
            sender: from.clone(),
            seq: *seq,
            performative: *performative,
            command: command.clone(),
            payload: payloads.get(&with_payload).cloned(),
        };
        self.commands
            .insert((from.clone(), to.clone(), *seq), command);
    }

    fn add_own(
        &mut self,
        time_ns: u64,
        robot: &RobotName,
        topic: impl FnOnce(&RobotTopics) -> u16,
        said: &str,
    ) {
        if let Some(channel) = self.robots.get(robot).map(topic) {
            self.add(time_ns, channel, |bytes| text(said, bytes));
        }
    }

    fn add(&mut self, time_ns: u64, channel: u16, encode: impl FnOnce(&mut Vec<u8>)) {
        let head = MessageHead {
            channel,
            sequence: 0,
            time_ns,
        };
        self.chunk.add_message(head, encode);
    }
}

fn to_json(value: &impl serde::Serialize) -> Result<String, ExportError> {
    serde_json::to_string(value).map_err(|error| ExportError::Write(error.into()))
}

/// How something has moved and turned from one pose to the next one, as it sees it at the end.
fn velocity_between(from: PlanePose, to: PlanePose, tick_s: f64) -> PlaneVelocity {
    let x_mps = (to.at_m[0] - from.at_m[0]) / tick_s;
    let y_mps = (to.at_m[1] - from.at_m[1]) / tick_s;
    let (sin, cos) = libm::sincos(to.heading_rad);
    let turned_rad = to.heading_rad - from.heading_rad;
    // The shorter way around.
    let turned_rad = libm::remainder(turned_rad, std::f64::consts::TAU);
    PlaneVelocity {
        linear_mps: [x_mps * cos + y_mps * sin, y_mps * cos - x_mps * sin],
        angular_radps: turned_rad / tick_s,
    }
}

/// Names of robots as tokens of names in ROS 2, which have letters, digits and single underscores, and do not begin with a digit. Two
/// that would be the same get numbers.
fn topic_names(robots: &[RobotName]) -> Vec<(&RobotName, String)> {
    let mut taken = BTreeSet::new();
    let mut names = Vec::new();
    for robot in robots {
        let mut name = String::new();
        for letter in robot.as_str().chars() {
            let letter = if letter.is_ascii_alphanumeric() {
                letter
            } else {
                '_'
            };
            if letter != '_' || !name.ends_with('_') {
                name.push(letter);
            }
        }
        if !name.starts_with(|first: char| first.is_ascii_alphabetic()) {
            name = format!("robot_{}", name.trim_start_matches('_'));
        }

        let mut numbered = name.clone();
        let mut number = 2;
        while !taken.insert(numbered.clone()) {
            numbered = format!("{}_{number}", name.trim_end_matches('_'));
            number += 1;
        }
        names.push((robot, numbered));
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_tokens_of_ros_and_differ() {
        let robots = ["1st", "A-1", "A.1", "A_1", "__", "a--b", "Butler"];
        let robots: Vec<RobotName> = robots.iter().map(|name| name.parse().unwrap()).collect();
        let names: Vec<String> = topic_names(&robots)
            .into_iter()
            .map(|(_, name)| name)
            .collect();
        let expected = [
            "robot_1st",
            "A_1",
            "A_1_2",
            "A_1_3",
            "robot_",
            "a_b",
            "Butler",
        ];
        assert_eq!(names, expected);
    }

    #[test]
    fn a_velocity_is_seen_from_what_moves() {
        let from = PlanePose {
            at_m: [1.0, 1.0],
            heading_rad: 3.0,
        };
        let to = PlanePose {
            at_m: [1.0, 2.0],
            heading_rad: -3.0,
        };
        let velocity = velocity_between(from, to, 0.5);
        let [ahead, left] = velocity.linear_mps;
        assert!((ahead - 2.0 * libm::sin(-3.0)).abs() < 1e-12);
        assert!((left - 2.0 * libm::cos(-3.0)).abs() < 1e-12);
        let turned_rad = std::f64::consts::TAU - 6.0;
        assert!((velocity.angular_radps - turned_rad / 0.5).abs() < 1e-12);
    }
}

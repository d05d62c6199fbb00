//! The lines on the pipes: one JSON object each.

use std::collections::BTreeMap;

use protocol::Message;
use protocol::messages::{
    DriveLimits, End, KnownSite, LayerAction, LayerResult, MAX_TEXT_BYTES, Panel, Parameters,
    Payload, Performative, Point, Pose, PublicState, Rays, SensedLayer, SensedRobot, SensedSite,
    SiteAction, SiteResult, StateVariables, StreamReseed, Variable, Velocity,
};
use protocol::plain::escape_line;
use protocol::{RobotName, RunName, Tick};
use robot::Welcome;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Fields of a line `done`.
const DONE_FIELDS: &[&str] = &[
    "proposal",
    "speed_mps",
    "direction_rad",
    "emotion_state",
    "behavior_state",
    "state_variables",
    "site_actions",
    "layer_actions",
    "velocity",
];
/// Most unknown fields that are named.
const MAX_UNKNOWN: usize = 5;
/// Most characters of an unknown field that are shown.
const MAX_NAME_CHARS: usize = 40;
/// Most characters of a bad line in an error.
const QUOTED: usize = 200;
/// The byte order mark, with which some languages begin a stream in UTF-8.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();
/// The lines that a program may write, for errors.
const EXPECTED: &str = "expected is one JSON object a line with a \"type\" of query, percept, ranges, random, command, log, panel or \
                        done";

/// A line to the program.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum ToProgram<'a> {
    /// Begin of an epoch, or of an incarnation.
    Init {
        protocol: u32,
        run: &'a RunName,
        name: &'a RobotName,
        generation: u32,
        epoch: u32,
        tick: Tick,
        seed: u64,
        stream: &'a str,
        tick_s: f64,
        field_m: [f64; 2],
        body_m: f64,
        sensing_range_m: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        rays: Option<Rays>,
        #[serde(skip_serializing_if = "Option::is_none")]
        drive: Option<DriveLimits>,
        location: Point,
        #[serde(skip_serializing_if = "Option::is_none")]
        pose: Option<Pose>,
        roster: &'a [RobotName],
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        known_sites: &'a [KnownSite],
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        reseeds: &'a [StreamReseed],
        parameters: &'a Parameters,
        sensed: &'a [SensedRobot],
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        sites: &'a [SensedSite],
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        layers: &'a [SensedLayer],
        #[serde(skip_serializing_if = "Option::is_none")]
        last_state_variables: Option<&'a StateVariables>,
    },
    /// Begin of a tick.
    Tick {
        tick: Tick,
        location: Point,
        #[serde(skip_serializing_if = "Option::is_none")]
        pose: Option<Pose>,
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        blocked: bool,
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        commands: &'a [Arrived],
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        sensed: &'a [SensedRobot],
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        sites: &'a [SensedSite],
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        site_results: &'a [SiteResult],
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        layers: &'a [SensedLayer],
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        layer_results: &'a [LayerResult],
    },
    /// The answer to `query`, `percept`, `ranges` or `random`.
    Answer {
        #[serde(flatten)]
        result: Answered,
    },
    /// The last line.
    End { reason: EndReason },
}

/// A command that the robot has received.
#[derive(Debug, Serialize)]
pub(super) struct Arrived {
    pub(super) from: RobotName,
    pub(super) performative: Performative,
    pub(super) command: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) payload: Option<Payload>,
}

/// The value of an answer, or an error.
#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Answered {
    Value(Value),
    Error(&'static str),
}

/// Why a program has to exit.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum EndReason {
    /// The run is over.
    Finished,
    /// The run has been stopped.
    Stopped,
    /// The run has been aborted.
    Aborted,
    /// A signal ends this robot.
    Interrupted,
    /// This robot has failed.
    Failed,
}

impl From<End> for EndReason {
    fn from(end: End) -> Self {
        match end {
            End::Finished => Self::Finished,
            End::Stopped => Self::Stopped,
            End::Aborted => Self::Aborted,
        }
    }
}

impl<'a> ToProgram<'a> {
    /// The line `init` for a welcome.
    pub(super) fn init(
        welcome: &'a Welcome,
        tick: Tick,
        pose: Option<Pose>,
        sensed: &'a [SensedRobot],
        sites: &'a [SensedSite],
        layers: &'a [SensedLayer],
    ) -> Self {
        Self::Init {
            protocol: welcome.protocol,
            run: &welcome.run,
            name: &welcome.name,
            generation: welcome.generation,
            epoch: welcome.epoch,
            tick,
            seed: welcome.seed,
            stream: &welcome.stream,
            tick_s: welcome.tick_s,
            field_m: welcome.field_m,
            body_m: welcome.body_m,
            sensing_range_m: welcome.sensing_range_m,
            rays: welcome.rays,
            drive: welcome.drive,
            location: welcome.location,
            pose,
            roster: &welcome.roster,
            known_sites: &welcome.known_sites,
            reseeds: &welcome.reseeds,
            parameters: &welcome.parameters,
            sensed,
            sites,
            layers,
            last_state_variables: welcome
                .last_state
                .as_ref()
                .map(|state| &state.state_variables),
        }
    }

    /// The line, with its end.
    pub(super) fn line(&self) -> Vec<u8> {
        // All keys are texts, so serialization cannot fail.
        let line = serde_json::to_vec(self);
        let mut line = line.unwrap_or_else(|error| unreachable!("a line is always JSON: {error}"));
        line.push(b'\n');
        line
    }
}

/// A line from the program, as it was read.
#[derive(Debug)]
pub(super) struct ReadLine {
    pub(super) message: FromProgram,
    pub(super) unknown: Option<UnknownFields>,
}

/// Fields of a line that have no meaning, and are ignored.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct UnknownFields {
    /// The type of the line.
    pub(super) kind: &'static str,
    names: Vec<String>,
    known: &'static [&'static str],
}

impl std::fmt::Display for UnknownFields {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<String> = self.names.iter().map(|name| format!("`{name}`")).collect();
        let fields = if names.len() == 1 { "field" } else { "fields" };
        write!(
            f,
            "unknown {fields} {} of a line `{}` ignored; its fields are {}",
            names.join(", "),
            self.kind,
            self.known.join(", ")
        )
    }
}

/// A line from the program.
#[derive(Debug)]
pub(super) enum FromProgram {
    Query(QueryLine),
    Percept,
    Ranges,
    Random,
    Command(CommandRequest),
    Log(Log),
    Panel(Panel),
    Done(DoneLine),
}

/// A query to another robot.
#[derive(Debug, Deserialize)]
pub(super) struct QueryLine {
    pub(super) of: String,
    pub(super) what: String,
}

/// A command to another robot, or to all others.
#[derive(Debug, Deserialize)]
pub(super) struct CommandRequest {
    pub(super) to: String,
    pub(super) command: String,
    #[serde(default)]
    pub(super) payload: Option<Payload>,
}

/// A line for the log of the run.
#[derive(Debug, Deserialize)]
pub(super) struct Log {
    pub(super) text: String,
}

/// The line `done`, which ends a tick: the proposed location and the published state.
#[derive(Debug, Default, Clone)]
pub(super) struct DoneLine {
    /// Proposed location; `None` to stay.
    pub(super) proposal: Option<Point>,
    pub(super) speed_mps: f64,
    pub(super) direction_rad: f64,
    pub(super) emotion_state: String,
    pub(super) behavior_state: String,
    pub(super) state_variables: StateVariables,
    pub(super) site_actions: Vec<SiteAction>,
    pub(super) layer_actions: Vec<LayerAction>,
    pub(super) velocity: Option<Velocity>,
}

#[derive(Debug, Deserialize)]
#[serde(default)]
#[derive(Default)]
struct RawDone {
    proposal: Option<Point>,
    speed_mps: f64,
    direction_rad: f64,
    emotion_state: String,
    behavior_state: String,
    state_variables: BTreeMap<String, Value>,
    site_actions: Vec<SiteAction>,
    layer_actions: Vec<LayerAction>,
    velocity: Option<Velocity>,
}

impl ReadLine {
    /// Reads a line.
    ///
    /// # Errors
    /// A sentence that quotes the line and names what is expected.
    pub(super) fn of(line: &[u8]) -> Result<Self, String> {
        parse(line)
            .map_err(|reason| format!("its line {} is not understood: {reason}", quote(line)))
    }
}

impl FromProgram {
    /// Whether the line becomes part of the report of the tick.
    pub(super) fn is_reported(&self) -> bool {
        matches!(self, Self::Command(_) | Self::Log(_) | Self::Done(_))
    }
}

fn parse(line: &[u8]) -> Result<ReadLine, String> {
    if line.starts_with(BYTE_ORDER_MARK) {
        return Err("it begins with a byte order mark (U+FEFF): write UTF-8 without it".to_owned());
    }

    // In two steps, so that an error names the field within the line's own type.
    let value: Value = serde_json::from_slice(line)
        .map_err(|error| format!("it is not valid JSON ({error}); {EXPECTED}"))?;
    let Some(kind) = value.get("type").and_then(Value::as_str) else {
        return Err(format!("it has no type; {EXPECTED}"));
    };

    let message = match kind {
        "query" => FromProgram::Query(fields(&value)?),
        "percept" => FromProgram::Percept,
        "ranges" => FromProgram::Ranges,
        "random" => FromProgram::Random,
        "command" => FromProgram::Command(check_order(fields(&value)?)?),
        "log" => FromProgram::Log(fields(&value)?),
        "panel" => FromProgram::Panel(check(fields(&value)?)?),
        "done" => FromProgram::Done(check_done(fields(&value)?)?),
        unknown => return Err(format!("there is no type {unknown:?}; {EXPECTED}")),
    };
    let unknown = unknown_fields(&message, &value);
    Ok(ReadLine { message, unknown })
}

/// The fields of a line that have no meaning: mistakes in writing, or meant for a later version.
fn unknown_fields(message: &FromProgram, value: &Value) -> Option<UnknownFields> {
    let (kind, known): (_, &[_]) = match message {
        FromProgram::Query(_) => ("query", &["of", "what"]),
        FromProgram::Percept => ("percept", &["type"]),
        FromProgram::Ranges => ("ranges", &["type"]),
        FromProgram::Random => ("random", &["type"]),
        FromProgram::Command(_) => ("command", &["to", "command", "payload"]),
        FromProgram::Log(_) => ("log", &["text"]),
        FromProgram::Panel(_) => ("panel", &["widgets"]),
        FromProgram::Done(_) => ("done", DONE_FIELDS),
    };

    let mut names = Vec::new();
    for name in keys(value) {
        if name != "type" && !known.contains(&name) {
            names.push(shown(name));
        }
    }
    for name in value.get("proposal").into_iter().flat_map(keys) {
        if kind == "done" && !matches!(name, "x" | "y") {
            names.push(format!("proposal.{}", shown(name)));
        }
    }
    names.truncate(MAX_UNKNOWN);

    let is_any = !names.is_empty();
    is_any.then_some(UnknownFields { kind, names, known })
}

fn keys(value: &Value) -> impl Iterator<Item = &str> {
    let object = value.as_object().into_iter();
    object.flat_map(|object| object.keys().map(String::as_str))
}

/// A name for the log, in one line and not too long.
fn shown(name: &str) -> String {
    escape_line(&name.chars().take(MAX_NAME_CHARS).collect::<String>())
}

fn fields<T: DeserializeOwned>(value: &Value) -> Result<T, String> {
    serde_path_to_error::deserialize(value).map_err(|error| match error.path().to_string() {
        path if path == "." => error.inner().to_string(),
        path => format!("field {path}: {}", error.inner()),
    })
}

fn check<M: Message>(message: M) -> Result<M, String> {
    message
        .check()
        .map_err(|error| format!("field {}: {}", error.field, error.reason))?;
    Ok(message)
}

fn check_order(order: CommandRequest) -> Result<CommandRequest, String> {
    let length = order.command.len();
    if length > MAX_TEXT_BYTES {
        return Err(format!(
            "field command: {length} bytes, more than the {MAX_TEXT_BYTES} allowed"
        ));
    }
    if let Some(payload) = &order.payload {
        payload
            .check("payload")
            .map_err(|error| format!("field {}: {}", error.field, error.reason))?;
    }

    Ok(order)
}

fn check_done(raw: RawDone) -> Result<DoneLine, String> {
    let mut state_variables = StateVariables::new();
    for (name, value) in raw.state_variables {
        let variable = variable(&name, value)?;
        state_variables.insert(name, variable);
    }

    // The limits are those of the message that other robots receive.
    let state = check(PublicState {
        epoch: 0,
        tick: 0,
        location: raw.proposal.unwrap_or_default(),
        speed_mps: raw.speed_mps,
        direction_rad: raw.direction_rad,
        state_variables,
        emotion_state: raw.emotion_state,
        behavior_state: raw.behavior_state,
    })?;

    Ok(DoneLine {
        proposal: raw.proposal,
        speed_mps: state.speed_mps,
        direction_rad: state.direction_rad,
        emotion_state: state.emotion_state,
        behavior_state: state.behavior_state,
        state_variables: state.state_variables,
        site_actions: raw.site_actions,
        layer_actions: raw.layer_actions,
        velocity: raw.velocity,
    })
}

fn variable(name: &str, value: Value) -> Result<Variable, String> {
    match value {
        Value::Bool(flag) => Ok(Variable::Flag(flag)),
        Value::String(text) => Ok(text.into()),
        Value::Number(number) => Ok(Variable::Number(number.as_f64().unwrap_or(f64::NAN))),
        _ => Err(format!(
            "field state_variables.{name}: a number, a text, true or false is expected"
        )),
    }
}

/// The beginning of a line, in quotes and without control characters.
pub(super) fn quote(line: &[u8]) -> String {
    // A character has at most four bytes.
    let beginning = String::from_utf8_lossy(&line[..line.len().min(4 * QUOTED)]);
    let shown: String = beginning.trim_end().chars().take(QUOTED).collect();

    let is_whole = shown.len() >= String::from_utf8_lossy(line).trim_end().len();
    let rest = if is_whole { "" } else { "..." };
    format!("`{}{rest}`", escape_line(&shown))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(message: &ToProgram<'_>) -> String {
        String::from_utf8(message.line()).unwrap()
    }

    /// Programs without a JSON parser search these lines, so the order of the fields is part of the contract.
    #[test]
    fn the_line_init_is_that_of_the_contract() {
        let welcome = r#"{"answer":"welcome","protocol":2,"run":"r","name":"A","generation":2,"epoch":3,"tick":4,"seed":5,
            "stream":"robot/A#2","tick_s":0.5,"field_m":[9,8.5],"body_m":0.6,"sensing_range_m":2,"location":{"x":1,"y":2},
            "roster":["A","B"],"parameters":{"v_mps":1e-7}}"#;
        let mut welcome: Welcome = serde_json::from_str(welcome).unwrap();
        assert_eq!(
            line(&ToProgram::init(&welcome, 6, None, &[], &[], &[])),
            "{\"type\":\"init\",\"protocol\":2,\"run\":\"r\",\"name\":\"A\",\"generation\":2,\"epoch\":3,\"tick\":6,\"seed\":5,\
             \"stream\":\"robot/A#2\",\"tick_s\":0.5,\"field_m\":[9.0,8.5],\"body_m\":0.6,\"sensing_range_m\":2.0,\
             \"location\":{\"x\":1.0,\"y\":2.0},\"roster\":[\"A\",\"B\"],\"parameters\":{\"v_mps\":1e-7},\"sensed\":[]}\n"
        );

        welcome.known_sites.push(KnownSite {
            name: "T1".to_owned(),
            kind: "task".to_owned(),
            location: Point::new(3.0, 4.0),
        });
        let known = line(&ToProgram::init(&welcome, 6, None, &[], &[], &[]));
        let expected = "\"roster\":[\"A\",\"B\"],\"known_sites\":[{\"name\":\"T1\",\"kind\":\"task\",\
                        \"location\":{\"x\":3.0,\"y\":4.0}}],\"parameters\"";
        assert!(known.contains(expected), "{known}");
    }

    #[test]
    fn the_line_tick_is_that_of_the_contract() {
        let location = Point::new(1.0, 2.0);
        let quiet = ToProgram::Tick {
            tick: 6,
            location,
            pose: None,
            blocked: false,
            commands: &[],
            sensed: &[],
            sites: &[],
            site_results: &[],
            layers: &[],
            layer_results: &[],
        };
        assert_eq!(
            line(&quiet),
            "{\"type\":\"tick\",\"tick\":6,\"location\":{\"x\":1.0,\"y\":2.0}}\n"
        );

        let commands = [Arrived {
            from: RobotName::new("B").unwrap(),
            performative: Performative::Achieve,
            command: "say \"x\":\n".to_owned(),
            payload: Payload::new(serde_json::json!({ "bid": 0.1 })),
        }];
        let sensed = [SensedRobot {
            name: RobotName::new("B").unwrap(),
            location,
        }];
        let busy = ToProgram::Tick {
            tick: 6,
            location,
            pose: Some(Pose {
                location,
                heading_rad: 1.5,
                velocity: Velocity {
                    linear_mps: 0.25,
                    angular_radps: -1.0,
                },
            }),
            blocked: true,
            commands: &commands,
            sensed: &sensed,
            sites: &[],
            site_results: &[],
            layers: &[],
            layer_results: &[],
        };
        assert_eq!(
            line(&busy),
            "{\"type\":\"tick\",\"tick\":6,\"location\":{\"x\":1.0,\"y\":2.0},\"pose\":{\"location\":\
             {\"x\":1.0,\"y\":2.0},\"heading_rad\":1.5,\"velocity\":{\"linear_mps\":0.25,\"angular_radps\":-1.0}},\"blocked\":true,\"commands\":[{\"from\":\"B\",\
             \"performative\":\"achieve\",\"command\":\"say \\\"x\\\":\\n\",\"payload\":{\"bid\":0.1}}],\"sensed\":[{\"name\":\"B\",\"location\":\
             {\"x\":1.0,\"y\":2.0}}]}\n"
        );
    }

    #[test]
    fn the_lines_answer_and_end_are_those_of_the_contract() {
        let value = ToProgram::Answer {
            result: Answered::Value(0.1.into()),
        };
        assert_eq!(line(&value), "{\"type\":\"answer\",\"value\":0.1}\n");

        let error = ToProgram::Answer {
            result: Answered::Error("too early"),
        };
        assert_eq!(
            line(&error),
            "{\"type\":\"answer\",\"error\":\"too early\"}\n"
        );

        let end = ToProgram::End {
            reason: EndReason::Finished,
        };
        assert_eq!(line(&end), "{\"type\":\"end\",\"reason\":\"finished\"}\n");
    }

    #[test]
    fn a_tick_may_end_with_no_more_than_its_type() {
        let FromProgram::Done(done) = read(b"{\"type\":\"done\"}\n") else {
            panic!("it is done")
        };
        assert_eq!(
            (done.proposal, done.speed_mps, done.emotion_state.as_str()),
            (None, 0.0, "")
        );
        let text = br#"{"type":"done","new":1,"proposal":{"x":1,"y":-0.1},"state_variables":{"a":7,"b":true,"c":"d"}}"#;
        let FromProgram::Done(done) = read(text) else {
            panic!("it is done")
        };
        assert_eq!(done.proposal, Some(Point::new(1.0, -0.1)));
        let expected = [("a", 7.0.into()), ("b", true.into()), ("c", "d".into())];
        assert_eq!(
            done.state_variables,
            expected
                .map(|(name, value)| (name.to_owned(), value))
                .into()
        );
    }

    fn read(line: &[u8]) -> FromProgram {
        ReadLine::of(line).unwrap().message
    }

    #[test]
    fn unknown_fields_are_named_and_known_ones_are_not() {
        for (line, unknown) in [
            (
                r#"{"type":"done","propsal":{"x":1,"y":2}}"#,
                Some(
                    "unknown field `propsal` of a line `done` ignored; its fields are proposal, speed_mps",
                ),
            ),
            (
                r#"{"type":"done","proposal":{"x":1,"y":2,"z":3}}"#,
                Some("unknown field `proposal.z`"),
            ),
            (
                r#"{"type":"query","of":"A","what":"speed","a":1,"b":2}"#,
                Some("unknown fields `a`, `b` of a line `query`"),
            ),
            (
                r#"{"type":"percept","of":"A"}"#,
                Some("unknown field `of` of a line `percept`"),
            ),
            (
                r#"{"type":"random","\u001b":1}"#,
                Some(r"unknown field `\u{1b}` of a line `random`"),
            ),
            (
                r#"{"type":"done","proposal":{"x":1,"y":2},"speed_mps":1,"direction_rad":1,"emotion_state":"","behavior_state":"","state_variables":{"any":1}}"#,
                None,
            ),
            (r#"{"type":"command","to":"A","command":"go"}"#, None),
            (r#"{"type":"log","text":"proposal"}"#, None),
            (r#"{"type":"panel","widgets":[]}"#, None),
        ] {
            let found = ReadLine::of(line.as_bytes()).unwrap().unknown;
            let found = found.map(|unknown| unknown.to_string());
            match unknown {
                None => assert_eq!(found, None, "{line}"),
                Some(expected) => assert!(
                    found
                        .as_ref()
                        .is_some_and(|found| found.starts_with(expected)),
                    "{line}: {found:?}"
                ),
            }
        }
    }

    #[test]
    fn a_proposal_is_an_object() {
        let wrong = ReadLine::of(br#"{"type":"done","proposal":[1,2]}"#).unwrap_err();
        assert!(
            wrong.contains(
                "field proposal: invalid type: sequence, expected an object with the fields x and y"
            ),
            "{wrong}"
        );
    }

    #[test]
    fn a_byte_order_mark_is_named() {
        let wrong = ReadLine::of("\u{feff}{\"type\":\"done\"}\n".as_bytes()).unwrap_err();
        assert_eq!(
            wrong,
            "its line `\\u{feff}{\"type\":\"done\"}` is not understood: it begins with a byte order mark (U+FEFF): write UTF-8 \
             without it"
        );
    }

    #[test]
    fn a_bad_line_is_quoted_in_part_and_harmless() {
        let wrong =
            ReadLine::of(format!("\u{1b}[2J{}\r\n", "\u{e9}".repeat(300)).as_bytes()).unwrap_err();
        assert!(
            wrong.starts_with("its line `\\u{1b}[2J\u{e9}\u{e9}"),
            "{wrong}"
        );
        assert!(
            wrong.contains("\u{e9}...` is not understood: it is not valid JSON"),
            "{wrong}"
        );
        assert!(
            wrong.chars().filter(|c| *c == '\u{e9}').count() < QUOTED,
            "{wrong}"
        );
        assert_eq!(quote(b"short\r\n"), "`short`");
        assert_eq!(quote(&[0xff, b'x']), "`\u{fffd}x`");
    }
}

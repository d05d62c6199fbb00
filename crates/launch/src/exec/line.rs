//! What is said over the pipes: one JSON object a line.

use std::collections::BTreeMap;

use protocol::Message;
use protocol::messages::{
    End, MAX_TEXT_BYTES, Panel, Parameters, Performative, Point, PublicState, SensedRobot,
    StateVariables, Variable,
};
use protocol::{RobotName, RunName, Tick};
use robot::Welcome;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::lines::harmless;

/// Characters of a bad line that are quoted.
const QUOTED: usize = 200;
/// What a program may say.
const EXPECTED: &str = "expected is one JSON object a line with a \"type\" of query, percept, random, command, log, panel or \
                        done";

/// What the program is told.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Told<'a> {
    /// Back to the initial state.
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
        location: Point,
        roster: &'a [RobotName],
        parameters: &'a Parameters,
        sensed: &'a [SensedRobot],
        #[serde(skip_serializing_if = "Option::is_none")]
        last_state_variables: Option<&'a StateVariables>,
    },
    /// A tick.
    Tick {
        tick: Tick,
        location: Point,
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        blocked: bool,
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        commands: &'a [Arrived],
        #[serde(skip_serializing_if = "<[_]>::is_empty")]
        sensed: &'a [SensedRobot],
    },
    /// What became of a query.
    Answer {
        #[serde(flatten)]
        result: Answered,
    },
    /// The end.
    End { reason: EndReason },
}

/// A command that arrived.
#[derive(Debug, Serialize)]
pub(super) struct Arrived {
    pub(super) from: RobotName,
    pub(super) performative: Performative,
    pub(super) command: String,
}

/// An answer, or why there is none.
#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Answered {
    Value(Value),
    Error(&'static str),
}

/// Why a program is to end.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum EndReason {
    /// The run is over.
    Finished,
    /// Somebody stopped the run.
    Stopped,
    /// The run could not go on.
    Aborted,
    /// This robot is asked to end by a signal.
    Interrupted,
    /// This robot cannot go on.
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

impl<'a> Told<'a> {
    /// The line with which an epoch, or an incarnation, begins.
    pub(super) fn init(welcome: &'a Welcome, tick: Tick, sensed: &'a [SensedRobot]) -> Self {
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
            location: welcome.location,
            roster: &welcome.roster,
            parameters: &welcome.parameters,
            sensed,
            last_state_variables: welcome
                .last_state
                .as_ref()
                .map(|state| &state.state_variables),
        }
    }

    /// The line, with its end.
    pub(super) fn line(&self) -> Vec<u8> {
        // Structs of numbers, texts and maps with texts as keys: there is nothing that JSON cannot write.
        let line = serde_json::to_vec(self);
        let mut line = line.unwrap_or_else(|error| unreachable!("a line is always JSON: {error}"));
        line.push(b'\n');
        line
    }
}

/// What the program says.
#[derive(Debug)]
pub(super) enum Said {
    Query(Query),
    Percept,
    Random,
    Command(Order),
    Log(Log),
    Panel(Panel),
    Done(Done),
}

/// A query to another robot.
#[derive(Debug, Deserialize)]
pub(super) struct Query {
    pub(super) of: String,
    pub(super) what: String,
}

/// A command to another robot.
#[derive(Debug, Deserialize)]
pub(super) struct Order {
    pub(super) to: String,
    pub(super) command: String,
}

/// A line for the log of the run.
#[derive(Debug, Deserialize)]
pub(super) struct Log {
    pub(super) text: String,
}

/// The end of a tick: where it wants to be, and what others may learn.
#[derive(Debug, Default, Clone)]
pub(super) struct Done {
    /// `None`: it stays.
    pub(super) proposal: Option<Point>,
    pub(super) speed_mps: f64,
    pub(super) direction_rad: f64,
    pub(super) emotion_state: String,
    pub(super) behavior_state: String,
    pub(super) state_variables: StateVariables,
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
}

impl Said {
    /// Reads a line.
    ///
    /// # Errors
    /// What is wrong with the line, which is quoted, and what is expected.
    pub(super) fn read(line: &[u8]) -> Result<Self, String> {
        parse(line)
            .map_err(|reason| format!("its line {} is not understood: {reason}", quote(line)))
    }

    /// Whether what it says becomes part of the report of the tick.
    pub(super) fn is_reported(&self) -> bool {
        matches!(self, Self::Command(_) | Self::Log(_) | Self::Done(_))
    }
}

fn parse(line: &[u8]) -> Result<Said, String> {
    let value: Value = serde_json::from_slice(line)
        .map_err(|error| format!("it is no JSON ({error}); {EXPECTED}"))?;
    let Some(kind) = value.get("type").and_then(Value::as_str) else {
        return Err(format!("it has no type; {EXPECTED}"));
    };

    Ok(match kind {
        "query" => Said::Query(fields(&value)?),
        "percept" => Said::Percept,
        "random" => Said::Random,
        "command" => Said::Command(check_order(fields(&value)?)?),
        "log" => Said::Log(fields(&value)?),
        "panel" => Said::Panel(check(fields(&value)?)?),
        "done" => Said::Done(check_done(fields(&value)?)?),
        unknown => return Err(format!("there is no type {unknown:?}; {EXPECTED}")),
    })
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

fn check_order(order: Order) -> Result<Order, String> {
    match order.command.len() {
        0..=MAX_TEXT_BYTES => Ok(order),
        length => Err(format!(
            "field command: {length} bytes, more than the {MAX_TEXT_BYTES} allowed"
        )),
    }
}

fn check_done(raw: RawDone) -> Result<Done, String> {
    let variable = |(name, value): (String, Value)| match value {
        Value::Bool(flag) => Ok((name, Variable::Flag(flag))),
        Value::String(text) => Ok((name, Variable::Text(text))),
        Value::Number(number) => Ok((name, Variable::Number(number.as_f64().unwrap_or(f64::NAN)))),
        _ => Err(format!(
            "field state_variables.{name}: a number, a text, true or false is expected"
        )),
    };
    let state_variables: StateVariables = raw
        .state_variables
        .into_iter()
        .map(variable)
        .collect::<Result<_, _>>()?;

    // The limits are those of what others will read.
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

    Ok(Done {
        proposal: raw.proposal,
        speed_mps: state.speed_mps,
        direction_rad: state.direction_rad,
        emotion_state: state.emotion_state,
        behavior_state: state.behavior_state,
        state_variables: state.state_variables,
    })
}

/// The beginning of a line, to be shown.
pub(super) fn quote(line: &[u8]) -> String {
    // A character has at most four bytes.
    let beginning = String::from_utf8_lossy(&line[..line.len().min(4 * QUOTED)]);
    let shown: String = harmless(beginning.trim_end())
        .chars()
        .take(QUOTED)
        .collect();
    let is_whole = shown.len() >= String::from_utf8_lossy(line).trim_end().len();
    format!("`{shown}{}`", if is_whole { "" } else { "..." })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Programs without a JSON reader search these lines: the order of the fields is part of the contract.
    #[test]
    fn lines_are_as_the_contract_has_them() {
        let welcome = r#"{"answer":"welcome","protocol":2,"run":"r","name":"A","generation":2,"epoch":3,"tick":4,"seed":5,
            "stream":"robot/A#2","tick_s":0.5,"field_m":[9,8.5],"body_m":0.6,"sensing_range_m":2,"location":{"x":1,"y":2},
            "roster":["A","B"],"parameters":{"v_mps":1e-7}}"#;
        let welcome: Welcome = serde_json::from_str(welcome).unwrap();
        let line = |told: &Told<'_>| String::from_utf8(told.line()).unwrap();
        assert_eq!(
            line(&Told::init(&welcome, 6, &[])),
            "{\"type\":\"init\",\"protocol\":2,\"run\":\"r\",\"name\":\"A\",\"generation\":2,\"epoch\":3,\"tick\":6,\"seed\":5,\
             \"stream\":\"robot/A#2\",\"tick_s\":0.5,\"field_m\":[9.0,8.5],\"body_m\":0.6,\"sensing_range_m\":2.0,\
             \"location\":{\"x\":1.0,\"y\":2.0},\"roster\":[\"A\",\"B\"],\"parameters\":{\"v_mps\":1e-7},\"sensed\":[]}\n"
        );
        let (tick, location) = (6, Point::new(1.0, 2.0));
        let quiet = Told::Tick {
            tick,
            location,
            blocked: false,
            commands: &[],
            sensed: &[],
        };
        assert_eq!(
            line(&quiet),
            "{\"type\":\"tick\",\"tick\":6,\"location\":{\"x\":1.0,\"y\":2.0}}\n"
        );
        let (from, command) = (RobotName::new("B").unwrap(), "say \"x\":\n".to_owned());
        let commands = [Arrived {
            from,
            performative: Performative::Achieve,
            command,
        }];
        let sensed = [SensedRobot {
            name: RobotName::new("B").unwrap(),
            location,
        }];
        assert_eq!(
            line(&Told::Tick {
                tick,
                location,
                blocked: true,
                commands: &commands,
                sensed: &sensed
            }),
            "{\"type\":\"tick\",\"tick\":6,\"location\":{\"x\":1.0,\"y\":2.0},\"blocked\":true,\"commands\":[{\"from\":\"B\",\
             \"performative\":\"achieve\",\"command\":\"say \\\"x\\\":\\n\"}],\"sensed\":[{\"name\":\"B\",\"location\":\
             {\"x\":1.0,\"y\":2.0}}]}\n"
        );
        let answer = |result| line(&Told::Answer { result });
        assert_eq!(
            answer(Answered::Value(0.1.into())),
            "{\"type\":\"answer\",\"value\":0.1}\n"
        );
        assert_eq!(
            answer(Answered::Error("too early")),
            "{\"type\":\"answer\",\"error\":\"too early\"}\n"
        );
        assert_eq!(
            line(&Told::End {
                reason: EndReason::Finished
            }),
            "{\"type\":\"end\",\"reason\":\"finished\"}\n"
        );
    }

    #[test]
    fn a_tick_may_end_with_no_more_than_its_type() {
        let Said::Done(done) = Said::read(b"{\"type\":\"done\"}\n").unwrap() else {
            panic!("it is done")
        };
        assert_eq!(
            (done.proposal, done.speed_mps, done.emotion_state.as_str()),
            (None, 0.0, "")
        );
        let text = br#"{"type":"done","new":1,"proposal":{"x":1,"y":-0.1},"state_variables":{"a":7,"b":true,"c":"d"}}"#;
        let Said::Done(done) = Said::read(text).unwrap() else {
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

    #[test]
    fn a_bad_line_is_quoted_in_part_and_harmless() {
        let wrong =
            Said::read(format!("\u{1b}[2J{}\r\n", "\u{e9}".repeat(300)).as_bytes()).unwrap_err();
        assert!(
            wrong.starts_with("its line `\u{fffd}[2J\u{e9}\u{e9}"),
            "{wrong}"
        );
        assert!(
            wrong.contains("\u{e9}...` is not understood: it is no JSON"),
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

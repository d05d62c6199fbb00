//! The tables of a run: its events, the states of its robots, and what these publish.

use std::path::Path;

use config::FileError;
use protocol::event::Blocker;
use protocol::messages::{Report, Variable};
use protocol::time::time_s;
use protocol::{Epoch, Event, RobotName, Seq, Tick};
use record::EpochFiles;
use record::names::EVENTS as EVENTS_FILE;
use record::{Entry, Record};
use recording::{PlacedRobot, RecordedTick, Recording, RecordingError, Ticks};
use serde::Serialize;

use super::draft::Draft;
use super::sheet::{Column, Format, Sheet, Type, Value};

/// Columns with which the rows of every table begin.
const WHEN: [(&str, Type); 3] = [
    ("epoch", Type::Integer),
    ("tick", Type::Integer),
    ("time_s", Type::Real),
];

/// A row for each event.
const EVENTS: [(&str, Type); 31] = [
    ("event", Type::Text),
    ("robot", Type::Text),
    ("generation", Type::Integer),
    ("x_m", Type::Real),
    ("y_m", Type::Real),
    ("blocked_by", Type::Text),
    ("blocked_by_robot", Type::Text),
    ("state_before", Type::Text),
    ("state_after", Type::Text),
    ("from_robot", Type::Text),
    ("to_robot", Type::Text),
    ("seq", Type::Integer),
    ("performative", Type::Text),
    ("command", Type::Text),
    ("because", Type::Text),
    ("until_tick", Type::Integer),
    ("cuts_commands", Type::Flag),
    ("cuts_queries", Type::Flag),
    ("fault", Type::Text),
    ("begins", Type::Flag),
    ("set", Type::Text),
    ("by_hand", Type::Flag),
    ("expectation", Type::Text),
    ("verdict", Type::Text),
    ("text", Type::Text),
    ("seed", Type::Integer),
    ("version", Type::Text),
    ("protocol", Type::Integer),
    ("tick_s", Type::Real),
    ("reason", Type::Text),
    ("digest", Type::Text),
];

/// A row for each robot in each tick.
const STATES: [(&str, Type); 13] = [
    ("robot", Type::Text),
    ("generation", Type::Integer),
    ("x_m", Type::Real),
    ("y_m", Type::Real),
    ("speed_mps", Type::Real),
    ("direction_rad", Type::Real),
    ("emotion", Type::Text),
    ("behavior", Type::Text),
    ("blocked", Type::Flag),
    ("missed", Type::Flag),
    ("commands", Type::Integer),
    ("proposal_x_m", Type::Real),
    ("proposal_y_m", Type::Real),
];

/// A row for each state variable of each robot in each tick.
const VARIABLES: [(&str, Type); 5] = [
    ("robot", Type::Text),
    ("variable", Type::Text),
    ("type", Type::Text),
    ("value", Type::Text),
    ("number", Type::Real),
];

/// A cell of a row: the name of its column and the value.
type Cell<'a> = (&'a str, Value<'a>);

/// When something was so.
#[derive(Clone, Copy)]
struct When {
    epoch: Epoch,
    tick: Tick,
    time_s: f64,
}

impl When {
    fn cells(self) -> [Cell<'static>; 3] {
        [
            ("epoch", self.epoch.into()),
            ("tick", self.tick.into()),
            ("time_s", self.time_s.into()),
        ]
    }
}

/// Writes the events of some epochs. Adds what is left out to `notes`, a sentence each.
///
/// # Errors
/// [`FileError`] if a record cannot be read, or a file cannot be written.
pub(super) fn write_events(
    epochs: &[EpochFiles],
    folder: &Path,
    formats: &[Format],
    notes: &mut Vec<String>,
) -> Result<Vec<Draft>, FileError> {
    let mut sheet = Sheet::create(folder, "events", formats, columns(&EVENTS))?;
    for files in epochs {
        let last = add_events(&mut sheet, files)?;

        let path = files.events.display();
        match last {
            None => notes.push(format!("{path} has no complete tick")),
            // An epoch that `init` ended has no end of the run.
            Some(entry) if !entry.is_end() && is_last(files) => notes.push(format!(
                "{path} has no end of the run, which was killed or is in progress: events go to tick {}",
                entry.tick
            )),
            Some(_) => {}
        }
    }
    sheet.finish()
}

/// Adds the events of an epoch. Returns the last complete tick, or the end of the run.
fn add_events(sheet: &mut Sheet, files: &EpochFiles) -> Result<Option<Entry>, FileError> {
    let mut record = Record::of_events(&files.events)?;
    let mut next = record.next_entry()?;
    let tick_s = match next.as_ref().and_then(|entry| entry.events.first()) {
        None => return Ok(None),
        Some(Event::Init { tick_s, .. }) => *tick_s,
        Some(_) => {
            let path = files.events.display();
            return Err(FileError::new(format!("{path} does not begin with `init`")));
        }
    };

    let mut last = None;
    while let Some(entry) = next {
        let when = When {
            epoch: files.epoch,
            tick: entry.tick,
            time_s: time_s(entry.tick, tick_s),
        };
        for event in &entry.events {
            sheet.add(when.cells().into_iter().chain(event_cells(event)))?;
        }
        last = Some(entry);
        next = record.next_entry()?;
    }
    Ok(last)
}

/// Whether no epoch has followed.
fn is_last(files: &EpochFiles) -> bool {
    files
        .events
        .file_name()
        .is_some_and(|name| name == EVENTS_FILE)
}

/// Writes the states of the robots, and their state variables. Epochs without a recording have neither; those of a damaged one
/// end before the damage. Adds what is left out to `notes`, and damage to `damages`, a sentence each.
///
/// # Errors
/// [`FileError`] if a recording that is whole cannot be read, or a file cannot be written.
pub(super) fn write_states(
    epochs: &[EpochFiles],
    folder: &Path,
    formats: &[Format],
    notes: &mut Vec<String>,
    damages: &mut Vec<String>,
) -> Result<Vec<Draft>, FileError> {
    let mut recorded = Vec::new();
    for files in epochs {
        if files.recording.exists() {
            recorded.push(files);
            continue;
        }
        notes.push(format!(
            "{} is not there (`[record] frames = false`?): epoch {} has events, and no states and variables",
            files.recording.display(),
            files.epoch
        ));
    }
    if recorded.is_empty() {
        return Ok(Vec::new());
    }

    let mut states = Sheet::create(folder, "states", formats, columns(&STATES))?;
    let mut variables = Sheet::create(folder, "variables", formats, columns(&VARIABLES))?;
    for files in recorded {
        add_recording(&mut states, &mut variables, files, notes, damages)?;
    }

    let mut drafts = states.finish()?;
    drafts.extend(variables.finish()?);
    Ok(drafts)
}

/// Adds the robots of all ticks of an epoch, as far as its recording is undamaged.
fn add_recording(
    states: &mut Sheet,
    variables: &mut Sheet,
    files: &EpochFiles,
    notes: &mut Vec<String>,
    damages: &mut Vec<String>,
) -> Result<(), FileError> {
    let recording = match Recording::open(&files.recording) {
        Ok(recording) => recording,
        Err(error) => {
            let damage = damage(error)?;
            damages.push(format!(
                "{damage}: epoch {} has no states and variables",
                files.epoch
            ));
            return Ok(());
        }
    };
    if !recording.is_finished() {
        notes.push(format!(
            "{} was not finished: states go to the end of its last whole chunk, {} ticks",
            files.recording.display(),
            recording.len()
        ));
    }

    let tick_s = recording.header().tick_s;
    let mut ticks = Ticks::of(recording);
    let mut count: u64 = 0;
    loop {
        let tick = match ticks.next_tick() {
            Ok(Some(tick)) => tick,
            Ok(None) => return Ok(()),
            Err(error) => {
                let damage = damage(error)?;
                damages.push(format!(
                    "{damage}: states and variables of epoch {} end before it, after {count} ticks",
                    files.epoch
                ));
                return Ok(());
            }
        };
        let when = When {
            epoch: files.epoch,
            tick: tick.tick(),
            time_s: time_s(tick.tick(), tick_s),
        };
        add_states(states, variables, when, &tick)?;
        count += 1;
    }
}

/// The damage of a recording; an error if the recording could not be read at all, whatever is in it.
fn damage(error: RecordingError) -> Result<RecordingError, FileError> {
    match error {
        RecordingError::Unreadable { .. } => Err(FileError::new(error.to_string())),
        RecordingError::Damaged { .. }
        | RecordingError::Headless { .. }
        | RecordingError::NoSuchTick { .. } => Ok(error),
    }
}

/// Adds the robots of a tick.
fn add_states(
    states: &mut Sheet,
    variables: &mut Sheet,
    when: When,
    tick: &RecordedTick,
) -> Result<(), FileError> {
    for robot in &tick.frame.robots {
        let report = tick.reports.get(&robot.name);
        let cells = state_cells(robot, report);
        states.add(when.cells().into_iter().chain(cells))?;

        for (name, value) in report.iter().flat_map(|report| &report.state_variables) {
            let cells = variable_cells(&robot.name, name, value);
            variables.add(when.cells().into_iter().chain(cells))?;
        }
    }
    Ok(())
}

fn columns(own: &[(&str, Type)]) -> Vec<Column> {
    let mut columns = Vec::new();
    for (name, of) in WHEN.iter().chain(own) {
        columns.push(Column::new(*name, *of));
    }
    columns
}

fn state_cells<'a>(robot: &'a PlacedRobot, report: Option<&'a Report>) -> Vec<Cell<'a>> {
    let mut cells = vec![
        ("robot", robot.name.as_str().into()),
        ("x_m", robot.location.x.into()),
        ("y_m", robot.location.y.into()),
        ("blocked", robot.blocked.into()),
        ("missed", robot.missed.is_some().into()),
    ];
    if let Some(report) = report {
        cells.extend([
            ("generation", report.generation.into()),
            ("speed_mps", report.speed_mps.into()),
            ("direction_rad", report.direction_rad.into()),
            ("emotion", report.emotion_state.as_str().into()),
            ("behavior", report.behavior_state.as_str().into()),
            ("commands", report.commands.into()),
            ("proposal_x_m", report.proposal.x.into()),
            ("proposal_y_m", report.proposal.y.into()),
        ]);
    }

    cells
}

fn variable_cells<'a>(robot: &'a RobotName, name: &'a str, value: &'a Variable) -> [Cell<'a>; 5] {
    let (kind, text, number) = match value {
        Variable::Flag(flag) => ("flag", flag.to_string().into(), Some(f64::from(*flag))),
        Variable::Number(number) => ("number", format!("{number:?}").into(), Some(*number)),
        Variable::Text(text) => ("text", text.as_str().into(), None),
    };
    [
        ("robot", robot.as_str().into()),
        ("variable", name.into()),
        ("type", kind.into()),
        ("value", text),
        ("number", number.into()),
    ]
}

/// The cells of an event. Its fields have the names of `events.jsonl` where these are clear in a table of all events.
fn event_cells(event: &Event) -> Vec<Cell<'_>> {
    let mut cells = vec![("event", event.kind().into())];
    cells.extend(match event {
        Event::Joined { .. }
        | Event::Lost { .. }
        | Event::Missed { .. }
        | Event::DoneLate { .. }
        | Event::Blocked { .. }
        | Event::Emotion { .. }
        | Event::Behavior { .. }
        | Event::Fault { .. }
        | Event::Say { .. }
        | Event::Warned { .. } => robot_cells(event),
        Event::CommandSent { .. }
        | Event::CommandDelivered { .. }
        | Event::CommandDropped { .. }
        | Event::CommandDelayed { .. }
        | Event::CommandDuplicated { .. }
        | Event::QueryLost { .. }
        | Event::LinkCut { .. }
        | Event::LinkHealed { .. } => command_cells(event),
        Event::Init { .. }
        | Event::Changed { .. }
        | Event::Judged { .. }
        | Event::Tick { .. }
        | Event::End { .. } => run_cells(event),
    });

    cells
}

/// The cells of an event that is about one robot.
fn robot_cells(event: &Event) -> Vec<Cell<'_>> {
    match event {
        Event::Joined {
            robot,
            generation,
            at,
        } => vec![
            ("robot", robot.as_str().into()),
            ("generation", (*generation).into()),
            ("x_m", at.x.into()),
            ("y_m", at.y.into()),
        ],
        Event::Lost { robot } | Event::Missed { robot } | Event::DoneLate { robot, .. } => {
            vec![("robot", robot.as_str().into())]
        }
        Event::Blocked { robot, by, at } => vec![
            ("robot", robot.as_str().into()),
            ("x_m", at.x.into()),
            ("y_m", at.y.into()),
            ("blocked_by", blocker(by).into()),
            ("blocked_by_robot", blocking_robot(by).into()),
        ],
        Event::Emotion { robot, from, to } | Event::Behavior { robot, from, to } => vec![
            ("robot", robot.as_str().into()),
            ("state_before", from.as_deref().into()),
            ("state_after", to.as_str().into()),
        ],
        Event::Fault {
            robot,
            kind,
            begins,
        } => vec![
            ("robot", robot.as_str().into()),
            ("fault", json_name(kind)),
            ("begins", (*begins).into()),
        ],
        Event::Say { robot, text } | Event::Warned { robot, text } => vec![
            ("robot", robot.as_str().into()),
            ("text", text.as_str().into()),
        ],
        _ => Vec::new(),
    }
}

/// The cells of an event that is about two robots.
fn command_cells(event: &Event) -> Vec<Cell<'_>> {
    match event {
        Event::CommandSent {
            from,
            to,
            seq,
            performative,
            command,
        } => {
            let mut cells = message_cells(from, to, Some(*seq));
            cells.push(("performative", performative.name().into()));
            cells.push(("command", command.as_str().into()));
            cells
        }
        Event::CommandDelivered { from, to, seq } | Event::CommandDuplicated { from, to, seq } => {
            message_cells(from, to, Some(*seq))
        }
        Event::CommandDropped {
            from,
            to,
            seq,
            because,
        } => {
            let mut cells = message_cells(from, to, Some(*seq));
            cells.push(("because", json_name(because)));
            cells
        }
        Event::CommandDelayed {
            from,
            to,
            seq,
            until,
        } => {
            let mut cells = message_cells(from, to, Some(*seq));
            cells.push(("until_tick", (*until).into()));
            cells
        }
        Event::QueryLost { from, to, because } => {
            let mut cells = message_cells(from, to, None);
            cells.push(("because", json_name(because)));
            cells
        }
        Event::LinkCut {
            from,
            to,
            commands,
            queries,
        } => {
            let mut cells = message_cells(from, to, None);
            cells.push(("cuts_commands", (*commands).into()));
            cells.push(("cuts_queries", (*queries).into()));
            cells
        }
        Event::LinkHealed { from, to } => message_cells(from, to, None),
        _ => Vec::new(),
    }
}

/// The cells of an event that is about the run.
fn run_cells(event: &Event) -> Vec<Cell<'_>> {
    match event {
        Event::Init {
            seed,
            version,
            protocol,
            tick_s,
        } => vec![
            ("seed", (*seed).into()),
            ("version", version.as_str().into()),
            ("protocol", (*protocol).into()),
            ("tick_s", (*tick_s).into()),
        ],
        Event::Changed { set, by_hand } => {
            vec![("set", set.as_str().into()), ("by_hand", (*by_hand).into())]
        }
        Event::Judged {
            expectation,
            verdict,
            because,
        } => vec![
            ("expectation", expectation.as_str().into()),
            ("verdict", verdict.name().into()),
            ("because", because.as_str().into()),
        ],
        // A seal is about the bytes of events.jsonl.
        Event::Tick { digest, seal: _ } => vec![("digest", digest.as_str().into())],
        Event::End {
            reason,
            waited_for: _,
            digest,
            seal: _,
        } => vec![
            ("reason", json_name(reason)),
            ("digest", digest.as_str().into()),
        ],
        _ => Vec::new(),
    }
}

fn message_cells<'a>(from: &'a RobotName, to: &'a RobotName, seq: Option<Seq>) -> Vec<Cell<'a>> {
    vec![
        ("from_robot", from.as_str().into()),
        ("to_robot", to.as_str().into()),
        ("seq", seq.into()),
    ]
}

fn blocker(by: &Blocker) -> &'static str {
    match by {
        Blocker::Edge => "edge",
        Blocker::Obstacle => "obstacle",
        Blocker::Guest => "guest",
        Blocker::TooFast => "too_fast",
        Blocker::Robot(_) => "robot",
    }
}

fn blocking_robot(by: &Blocker) -> Option<&str> {
    match by {
        Blocker::Robot(name) => Some(name.as_str()),
        _ => None,
    }
}

/// The name of one of several kinds, as in `events.jsonl`.
fn json_name(kind: &impl Serialize) -> Value<'static> {
    match serde_json::to_value(kind) {
        Ok(serde_json::Value::String(name)) => name.into(),
        _ => unreachable!("a kind is written as its name"),
    }
}

//! The tables of a run: its events, the states of its robots, and what these publish.

use std::path::{Path, PathBuf};

use config::FileError;
use protocol::event::Blocker;
use protocol::messages::{Report, Variable};
use protocol::time::time_s;
use protocol::{Epoch, Event, RobotName, Seq, Tick};
use record::EpochFiles;
use record::names::EVENTS as EVENTS_FILE;
use record::{Entry, Record, RecordError};
use recording::{PlacedRobot, RecordedTick, Recording, RecordingError, Ticks};
use serde::Serialize;

use crate::ExportError;
use crate::csv::{CsvTable, FieldValue};
use crate::draft::{Draft, unwritable};

/// Names of the tables.
pub const FILES: [&str; 3] = ["events.csv", "states.csv", "variables.csv"];

/// Columns with which the rows of every table begin. `docs/exports.md` has the types of all columns.
const WHEN: &str = "epoch tick time_s";
/// A row for each event.
const EVENTS: &str = "event robot generation x_m y_m blocked_by blocked_by_robot state_before state_after from_robot \
                      to_robot seq performative command payload_bytes because until_tick cuts_commands cuts_queries fault begins guest mood \
                      site key value_before value_after layer cells change set by_hand expectation verdict text seed version protocol tick_s reason digest";
/// A row for each robot in each tick.
const STATES: &str = "robot generation x_m y_m speed_mps direction_rad emotion behavior blocked missed commands \
                      proposal_x_m proposal_y_m heading_rad";
/// A row for each state variable of each robot in each tick.
const VARIABLES: &str = "robot variable type value number";

/// A cell of a row: the name of its column and the value.
type Column<'a> = (&'a str, FieldValue<'a>);

/// The tables of a run.
#[derive(Debug, Default)]
pub struct Tables {
    /// The files.
    pub files: Vec<PathBuf>,
    /// What they leave out, for people, a sentence each.
    pub notes: Vec<String>,
    /// Damage of recordings, with what it leaves out, a sentence each. What could be read before it is in the files.
    pub damage: Vec<String>,
}

/// Writes the tables of epochs of a run to a folder, which is made if it does not exist. Files of an earlier export are
/// replaced. Epochs without a recording have events only, those of a damaged one end before the damage.
///
/// # Errors
/// [`ExportError`] if events are damaged, a file cannot be read, or one cannot be written. No file is written then. Damage of a
/// recording is no error here, but part of what is returned.
pub fn write(epochs: &[EpochFiles], folder: &Path) -> Result<Tables, ExportError> {
    let is_new = !folder.exists();
    std::fs::create_dir_all(folder).map_err(|error| unwritable(folder, &error))?;

    let mut tables = Tables::default();
    let published = tables.write_all(epochs, folder);
    if published.is_err() && is_new {
        // Nothing but drafts was in it, which are removed; if it cannot be removed, the error to report is the first one.
        let _empty = std::fs::remove_dir(folder);
    }
    published.map(|()| tables)
}

impl Tables {
    /// All files are complete before the first of them gets its name.
    fn write_all(&mut self, epochs: &[EpochFiles], folder: &Path) -> Result<(), ExportError> {
        let mut drafts = vec![self.write_events(epochs, folder)?];
        drafts.extend(self.write_states(epochs, folder)?);
        for draft in drafts {
            self.files.push(draft.publish()?);
        }
        Ok(())
    }

    fn write_events(&mut self, epochs: &[EpochFiles], folder: &Path) -> Result<Draft, ExportError> {
        let mut table = create(folder, FILES[0], EVENTS)?;
        for files in epochs {
            let last = add_events(&mut table, files)?;

            let path = files.events.display();
            match last {
                None => self.notes.push(format!("{path} has no complete tick")),
                // An epoch that `init` ended has no end of the run.
                Some(entry) if !entry.is_end() && is_last(files) => self.notes.push(format!(
                    "{path} has no end of the run, which was killed or is in progress: events go to tick {}",
                    entry.tick
                )),
                Some(_) => {}
            }
        }
        Ok(table.finish())
    }

    fn write_states(
        &mut self,
        epochs: &[EpochFiles],
        folder: &Path,
    ) -> Result<Vec<Draft>, ExportError> {
        let mut recorded = Vec::new();
        for files in epochs {
            if files.recording.exists() {
                recorded.push(files);
                continue;
            }
            self.notes.push(format!(
                "{} is not there (`[record] frames = false`?): epoch {} has events, and no states and variables",
                files.recording.display(),
                files.epoch
            ));
        }
        if recorded.is_empty() {
            return Ok(Vec::new());
        }

        let mut states = create(folder, FILES[1], STATES)?;
        let mut variables = create(folder, FILES[2], VARIABLES)?;
        for files in recorded {
            self.add_recording(&mut states, &mut variables, files)?;
        }
        Ok(vec![states.finish(), variables.finish()])
    }

    /// Adds the robots of all ticks of an epoch, as far as its recording is undamaged.
    fn add_recording(
        &mut self,
        states: &mut CsvTable,
        variables: &mut CsvTable,
        files: &EpochFiles,
    ) -> Result<(), ExportError> {
        let epoch = files.epoch;
        let recording = match Recording::open(&files.recording) {
            Ok(recording) => recording,
            Err(error) => {
                let damage = damage(error)?;
                self.damage.push(format!(
                    "{damage}: epoch {epoch} has no states and variables"
                ));
                return Ok(());
            }
        };
        if !recording.is_finished() {
            self.notes.push(format!(
                "{} was not finished: states go to the end of its last whole chunk, {} ticks",
                files.recording.display(),
                recording.len()
            ));
        }

        let tick_s = recording.header().tick_s;
        let mut ticks = Ticks::of(recording);
        let mut count: u64 = 0;
        loop {
            match ticks.next_tick() {
                Ok(Some(tick)) => {
                    let when = when(epoch, tick.tick(), tick_s);
                    add_states(states, variables, &when, &tick)?;
                    count += 1;
                }
                Ok(None) => return Ok(()),
                Err(error) => {
                    let damage = damage(error)?;
                    self.damage.push(format!(
                        "{damage}: states and variables of epoch {epoch} end before it, after {count} ticks"
                    ));
                    return Ok(());
                }
            }
        }
    }
}

fn create(folder: &Path, file: &str, own: &str) -> Result<CsvTable, FileError> {
    let columns = WHEN.split_whitespace().chain(own.split_whitespace());
    CsvTable::create(&folder.join(file), columns.map(str::to_owned).collect())
}

/// The cells with which a row begins.
fn when(epoch: Epoch, tick: Tick, tick_s: f64) -> [Column<'static>; 3] {
    [
        ("epoch", epoch.into()),
        ("tick", tick.into()),
        ("time_s", time_s(tick, tick_s).into()),
    ]
}

/// Adds the events of an epoch. Returns the last complete tick, or the end of the run.
fn add_events(table: &mut CsvTable, files: &EpochFiles) -> Result<Option<Entry>, ExportError> {
    let mut record = Record::of_events(&files.events)?;
    let mut next = record.next_entry()?;
    let tick_s = match next.as_ref().and_then(|entry| entry.events.first()) {
        None => return Ok(None),
        Some(Event::Init { tick_s, .. }) => *tick_s,
        Some(_) => {
            let path = files.events.display();
            return Err(RecordError::unusable(format!("{path} does not begin with `init`")).into());
        }
    };

    let mut last = None;
    while let Some(entry) = next {
        let when = when(files.epoch, entry.tick, tick_s);
        for event in &entry.events {
            let kind = ("event", event.kind().into());
            let cells = when.iter().cloned().chain([kind]).chain(event_cells(event));
            table.add(cells)?;
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

/// The damage of a recording; an error if the recording could not be read at all, whatever is in it.
fn damage(error: RecordingError) -> Result<RecordingError, ExportError> {
    match error {
        RecordingError::Unreadable { .. } => Err(error.into()),
        RecordingError::Damaged { .. }
        | RecordingError::Headless { .. }
        | RecordingError::NoSuchTick { .. } => Ok(error),
    }
}

/// Adds the robots of a tick.
fn add_states(
    states: &mut CsvTable,
    variables: &mut CsvTable,
    when: &[Column<'static>; 3],
    tick: &RecordedTick,
) -> Result<(), ExportError> {
    for robot in &tick.frame.robots {
        let report = tick.reports.get(&robot.name).map(AsRef::as_ref);
        let cells = state_cells(robot, report);
        states.add(when.iter().cloned().chain(cells))?;

        for (name, value) in report.iter().flat_map(|report| &report.state_variables) {
            let cells = variable_cells(&robot.name, name, value);
            variables.add(when.iter().cloned().chain(cells))?;
        }
    }
    Ok(())
}

fn state_cells<'a>(robot: &'a PlacedRobot, report: Option<&'a Report>) -> Vec<Column<'a>> {
    let mut cells = vec![
        ("robot", robot.name.as_str().into()),
        ("x_m", robot.location.x.into()),
        ("y_m", robot.location.y.into()),
        ("blocked", robot.blocked.into()),
        ("missed", robot.missed.is_some().into()),
        ("heading_rad", robot.heading_rad.into()),
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

fn variable_cells<'a>(robot: &'a RobotName, name: &'a str, value: &'a Variable) -> [Column<'a>; 5] {
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
fn event_cells(event: &Event) -> Vec<Column<'_>> {
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
        Event::Lost { robot } | Event::Missed { robot } | Event::DoneLate { robot, ticks: _ } => {
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
        Event::CommandSent {
            from,
            to,
            seq,
            performative,
            command,
            payload,
            payload_of: _,
        } => {
            let mut cells = message_cells(from, to, Some(*seq));
            cells.push(("performative", performative.name().into()));
            cells.push(("command", command.as_str().into()));
            let bytes = payload
                .as_ref()
                .map(|payload| payload.as_json().len() as u64);
            cells.push(("payload_bytes", bytes.into()));
            cells
        }
        Event::CommandDelivered { from, to, seq } => message_cells(from, to, Some(*seq)),
        Event::CommandDuplicated {
            from,
            to,
            seq,
            because,
        } => {
            let mut cells = message_cells(from, to, Some(*seq));
            cells.extend(because.map(|because| ("because", json_name(&because))));
            cells
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
            because,
        } => {
            let mut cells = message_cells(from, to, Some(*seq));
            cells.push(("until_tick", (*until).into()));
            cells.extend(because.map(|because| ("because", json_name(&because))));
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
        Event::Fault {
            robot,
            kind,
            begins,
        } => vec![
            ("robot", robot.as_str().into()),
            ("fault", json_name(kind)),
            ("begins", (*begins).into()),
        ],
        Event::Changed { set, by_hand } => {
            vec![("set", set.as_str().into()), ("by_hand", (*by_hand).into())]
        }
        Event::Say { robot, text } | Event::Warned { robot, text } => vec![
            ("robot", robot.as_str().into()),
            ("text", text.as_str().into()),
        ],
        Event::GuestEntered { guest, at } | Event::GuestLeft { guest, at } => vec![
            ("x_m", at.x.into()),
            ("y_m", at.y.into()),
            ("guest", (*guest).into()),
        ],
        Event::Guest { guest, mood } => {
            vec![("guest", (*guest).into()), ("mood", json_name(mood))]
        }
        Event::SiteChanged {
            robot,
            site,
            key,
            from,
            to,
        } => vec![
            ("robot", robot.as_str().into()),
            ("site", site.as_str().into()),
            ("key", key.as_str().into()),
            ("value_before", from.to_string().into()),
            ("value_after", to.to_string().into()),
        ],
        Event::SiteRefused {
            robot,
            site,
            because,
        } => vec![
            ("robot", robot.as_str().into()),
            ("site", site.as_str().into()),
            ("because", because.name().into()),
        ],
        Event::LayerChanged {
            robot,
            layer,
            cells,
            change,
        } => vec![
            ("robot", robot.as_str().into()),
            ("layer", layer.as_str().into()),
            ("cells", (*cells).into()),
            ("change", (*change).into()),
        ],
        Event::LayerRefused {
            robot,
            layer,
            because,
        } => vec![
            ("robot", robot.as_str().into()),
            ("layer", layer.as_str().into()),
            ("because", because.name().into()),
        ],
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
            because,
            waited_for: _,
            digest,
            seal: _,
        } => vec![
            ("reason", json_name(reason)),
            ("because", because.as_deref().into()),
            ("digest", digest.as_str().into()),
        ],
    }
}

fn message_cells<'a>(from: &'a RobotName, to: &'a RobotName, seq: Option<Seq>) -> Vec<Column<'a>> {
    vec![
        ("from_robot", from.as_str().into()),
        ("to_robot", to.as_str().into()),
        ("seq", seq.into()),
    ]
}

fn blocker(by: &Blocker) -> &'static str {
    match by {
        Blocker::Edge => "edge",
        Blocker::Wall => "wall",
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
fn json_name(kind: &impl Serialize) -> FieldValue<'static> {
    match serde_json::to_value(kind) {
        Ok(serde_json::Value::String(name)) => name.into(),
        _ => unreachable!("a kind is written as its name"),
    }
}

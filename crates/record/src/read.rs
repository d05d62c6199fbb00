//! The record of an epoch, read tick by tick.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lockstep::{Attendance, Sent};
use protocol::messages::{CommandText, Payload, Report, Target};
use protocol::{Event, Line, RobotName, Tick};
use recording::{Frame, Recording, RecordingError, Ticks};

use crate::error::RecordError;
use crate::folder::EpochFiles;
use crate::seal::RawLines;

/// The record of an epoch.
pub struct Record {
    path: PathBuf,
    lines: RawLines,
    /// Number of the line that was read last, from 1.
    number: usize,
    /// The tick of the next entry.
    tick: Tick,
    /// The recording, if there is one and it is read, too.
    recorded: Option<Ticks>,
    /// Events that the recording has with those of the last entry, and after them: at the last tick, those of the end of the run.
    events_after: Option<Vec<Event>>,
}

/// A complete tick of a record, or the end of the run.
#[derive(Debug, Clone, Default)]
pub struct Entry {
    /// The tick; at the end of the run, the last one.
    pub tick: Tick,
    /// What happened in it. Seals are left out.
    pub events: Vec<Event>,
    /// What each robot reported, if the record has it.
    pub reports: Option<BTreeMap<RobotName, Report>>,
    /// The field after the tick, if the record has it.
    pub frame: Option<Frame>,
    /// The events once more, as the recording has them, if it has the tick.
    pub recorded_events: Option<Vec<Event>>,
}

impl Entry {
    /// Whether it is the end of the run.
    #[must_use]
    pub fn is_end(&self) -> bool {
        matches!(self.events.last(), Some(Event::End { .. }))
    }

    /// The events and reports of the entry, without what follows from all ticks before: digest and field.
    #[must_use]
    pub fn without_past(&self) -> Self {
        let mut events = self.events.clone();
        events.retain(|event| !matches!(event, Event::Tick { .. } | Event::End { .. }));
        Self {
            tick: self.tick,
            events,
            reports: self.reports.clone(),
            ..Self::default()
        }
    }

    /// Whether a robot took part again from this tick on.
    #[must_use]
    pub fn has_joined(&self, name: &RobotName) -> bool {
        self.joined().any(|robot| robot == name)
    }

    /// Robots that take part again from this tick on.
    pub fn joined(&self) -> impl Iterator<Item = &RobotName> {
        self.events.iter().filter_map(|event| match event {
            Event::Joined {
                robot,
                generation: Some(_),
                ..
            } => Some(robot),
            _ => None,
        })
    }

    /// Who takes part in the tick.
    #[must_use]
    pub fn attendance(&self) -> Attendance {
        Attendance {
            joined: self.joined().cloned().collect(),
            absent: self.missed().cloned().collect(),
            lost: self.lost().cloned().collect(),
        }
    }

    /// Robots that are lost from this tick on.
    pub fn lost(&self) -> impl Iterator<Item = &RobotName> {
        self.events.iter().filter_map(|event| match event {
            Event::Lost { robot } => Some(robot),
            _ => None,
        })
    }

    /// The commands that a robot sent in the tick.
    #[must_use]
    pub fn commands_of(&self, name: &RobotName) -> Vec<Sent<CommandText>> {
        let mut commands = Vec::new();
        let mut payloads = BTreeMap::new();
        for event in &self.events {
            if let Event::CommandSent {
                from,
                to,
                seq,
                performative,
                command,
                payload,
                payload_of,
            } = event
                && from == name
            {
                if let Some(payload) = payload {
                    payloads.insert(*seq, payload);
                }
                let payload = payloads.get(&payload_of.unwrap_or(*seq));
                commands.push(Sent {
                    to: Target::Robot(to.clone()),
                    command: CommandText {
                        performative: *performative,
                        command: command.clone(),
                        payload: payload.map(|payload| Payload::clone(payload)),
                    },
                });
            }
        }

        commands
    }

    /// What was set by hand before the tick.
    #[must_use]
    pub fn changes_by_hand(&self) -> Vec<String> {
        let mut changes = Vec::new();
        for event in &self.events {
            if let Event::Changed { set, by_hand: true } = event {
                changes.push(set.clone());
            }
        }
        changes
    }

    /// Robots that took part again in the tick, with those of the ticks that they had missed which they did too late.
    pub fn done_late(&self) -> impl Iterator<Item = (&RobotName, &[Tick])> {
        self.events.iter().filter_map(|event| match event {
            Event::DoneLate { robot, ticks } => Some((robot, ticks.as_slice())),
            _ => None,
        })
    }

    /// Whether a robot's report of the tick is missing.
    #[must_use]
    pub fn has_missed(&self, name: &RobotName) -> bool {
        self.missed().any(|robot| robot == name)
    }

    /// Robots whose reports of the tick are missing.
    pub fn missed(&self) -> impl Iterator<Item = &RobotName> {
        self.events.iter().filter_map(|event| match event {
            Event::Missed { robot } => Some(robot),
            _ => None,
        })
    }
}

impl Record {
    /// Opens the record of an epoch: its events, and its recording if there is one.
    ///
    /// # Errors
    /// [`RecordError`] if a file cannot be read.
    pub fn open(files: &EpochFiles) -> Result<Self, RecordError> {
        let mut record = Self::of_events(&files.events)?;
        if files.recording.exists() {
            let recording = Recording::open(&files.recording);
            let recording = recording.map_err(|error| unreadable(&error))?;
            record.recorded = Some(Ticks::of(recording));
        }
        Ok(record)
    }

    /// Opens a file of events alone.
    ///
    /// # Errors
    /// [`RecordError`] if it cannot be read.
    pub fn of_events(path: &Path) -> Result<Self, RecordError> {
        Ok(Self {
            path: path.to_owned(),
            lines: RawLines::open(path)?,
            number: 0,
            tick: 0,
            recorded: None,
            events_after: None,
        })
    }

    /// The recording of the epoch, if there is one and it is read.
    #[must_use]
    pub fn recording(&self) -> Option<&Recording> {
        self.recorded.as_ref().map(Ticks::recording)
    }

    /// The next complete tick; `None` at the end of the record. Events of a tick that was not completed are left out.
    ///
    /// # Errors
    /// [`RecordError`] if the file cannot be read, or names a line that is not an event or is of another tick.
    pub fn next_entry(&mut self) -> Result<Option<Entry>, RecordError> {
        let mut entry = Entry {
            tick: self.tick,
            ..Entry::default()
        };
        while let Some(Line { tick, mut event }) = self.next_line()? {
            let is_end = matches!(event, Event::End { .. });
            // The end is of the last complete tick, and so is what is judged because of it.
            let is_judged = matches!(event, Event::Judged { .. });
            if is_end || (is_judged && entry.events.is_empty() && tick + 1 == self.tick) {
                entry.tick = self.tick.saturating_sub(1);
            }
            if tick != entry.tick {
                let expected = entry.tick;
                return Err(self.malformed(&format!("tick {tick} where tick {expected} is due")));
            }

            if let Event::Tick { seal, .. } | Event::End { seal, .. } = &mut event {
                // Seals are about bytes. Two records whose ticks are the same may have other bytes
                // before them.
                *seal = None;
            }
            let is_last = event.is_sealed();
            entry.events.push(event);
            if is_last && is_end {
                entry.recorded_events = self.events_after.take();
            } else if is_last {
                self.tick += 1;
                self.add_recorded(&mut entry)?;
            }
            if is_last {
                return Ok(Some(entry));
            }
        }

        Ok(None)
    }

    /// Adds what the recording has of a tick: nothing where it has ended earlier than the events.
    fn add_recorded(&mut self, entry: &mut Entry) -> Result<(), RecordError> {
        let Some(recorded) = &mut self.recorded else {
            return Ok(());
        };
        // Events of the recording beyond those of the tick are only right at the last one: no further
        // tick may follow.
        let after = self.events_after.take().unwrap_or_default();
        if !after.is_empty() {
            let before = entry.tick.saturating_sub(1);
            return Err(RecordError::unusable(format!(
                "the recording has events of tick {before} that {} does not have",
                self.path.display()
            )));
        }
        let tick = recorded.next_tick().map_err(|error| unreadable(&error))?;
        let Some(tick) = tick else {
            return Ok(());
        };

        // The recording has the events of the end with those of the last tick, the file of events has
        // them after it.
        let mut events = Arc::unwrap_or_clone(tick.events);
        let own = entry.events.len().min(events.len());
        self.events_after = Some(events.split_off(own));
        entry.recorded_events = Some(events);
        let reports = tick.reports.into_iter();
        let reports = reports.map(|(robot, report)| (robot, Arc::unwrap_or_clone(report)));
        entry.reports = Some(reports.collect());
        entry.frame = Some(tick.frame);
        Ok(())
    }

    fn next_line(&mut self) -> Result<Option<Line>, RecordError> {
        let Some(raw) = self.lines.next()? else {
            return Ok(None);
        };
        if !raw.is_whole && !raw.is_too_long() {
            return Ok(None); // A line that the simulator was about to write.
        }

        self.number += 1;
        let line = Line::from_json(&raw.bytes).map_err(|error| self.malformed(&error))?;
        Ok(Some(line))
    }

    fn malformed(&self, error: &dyn std::fmt::Display) -> RecordError {
        let path = self.path.display();
        RecordError::unusable(format!("{path}, line {}: {error}", self.number))
            .with_help("the record is damaged: `cars check` says how far it is good")
    }
}

fn unreadable(error: &RecordingError) -> RecordError {
    RecordError::unusable(error)
        .with_help("the recording is damaged: nothing can be said of what the robots reported")
}

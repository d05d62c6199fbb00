//! A robot that is played from its record, to study the others against its history.

use std::path::Path;

use protocol::messages::{CommandText, Report};
use protocol::{RobotName, Tick};
use record::EpochFiles;
use record::{Entry, Record, RecordError};
use robot::{Action, BadParameters, Cars, Robot};

use crate::error::LabError;
use crate::folder::NOT_RECORDED;

/// A robot that repeats, tick by tick, what a robot of a recorded run reported, sent and logged. It perceives nothing. Where the
/// record has nothing of it, and after the end of the record, it stays where it is and publishes what it published last.
pub struct Replayed {
    files: EpochFiles,
    name: RobotName,
    record: Record,
    /// The entry of the record that was read last.
    entry: Option<Entry>,
    /// The last report that was repeated.
    last: Option<Report>,
}

impl Replayed {
    /// The robot of a record.
    ///
    /// # Errors
    /// If the record cannot be read, or has no reports of this robot.
    pub fn open(files: EpochFiles, name: RobotName) -> Result<Self, LabError> {
        let record = Record::open(&files)?;
        let recording = record.recording();
        let is_known = recording.is_some_and(|file| file.header().robots.contains(&name));
        if !is_known {
            return Err(no_reports(
                &files.recording,
                &name,
                recording.map(|file| &file.header().robots[..]),
            ));
        }

        Ok(Self {
            files,
            name,
            record,
            entry: None,
            last: None,
        })
    }

    /// What the record has of a tick. Ticks are asked for in their order.
    fn entry(&mut self, tick: Tick) -> Result<Option<&Entry>, RecordError> {
        while self.entry.as_ref().is_none_or(|entry| entry.tick < tick) {
            match self.record.next_entry()? {
                Some(entry) if !entry.is_end() => self.entry = Some(entry),
                _ => return Ok(None),
            }
        }
        Ok(self.entry.as_ref().filter(|entry| entry.tick == tick))
    }

    /// Repeats what the record has of a tick.
    fn repeat(&mut self, cars: &mut Cars<'_>) -> Result<Option<Report>, RecordError> {
        let name = self.name.clone();
        let Some(entry) = self.entry(cars.tick())? else {
            return Ok(None);
        };

        for sent in entry.commands_of(&name) {
            let to = sent.to.as_str();
            let CommandText {
                command, payload, ..
            } = sent.command;
            if let Err(error) = cars.send(to, command, payload) {
                cars.log(format!("cannot repeat a command to {to}: {error}"));
            }
        }
        let report = entry.reports.as_ref();
        let report = report.and_then(|reports| reports.get(&name)).cloned();
        for line in report.iter().flat_map(|report| &report.log) {
            cars.log(line.clone());
        }
        Ok(report)
    }
}

impl Robot for Replayed {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.record = Record::open(&self.files).map_err(|error| cars.bad_parameters(error))?;
        self.entry = None;
        self.last = None;
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        match self.repeat(cars) {
            Ok(Some(report)) => {
                let action = action(&report);
                self.last = Some(report);
                action
            }
            Ok(None) => {
                let mut action = self.last.as_ref().map_or_else(Action::default, action);
                action.proposal = cars.location();
                action.speed_mps = 0.0;
                action.velocity = None;
                action.site_actions.clear();
                action
            }
            Err(error) => {
                cars.give_up(error.to_string());
                Action::stay(cars)
            }
        }
    }
}

/// What a robot did that reported this.
pub(crate) fn action(report: &Report) -> Action {
    Action {
        proposal: report.proposal,
        speed_mps: report.speed_mps,
        direction_rad: report.direction_rad,
        emotion_state: report.emotion_state.clone(),
        behavior_state: report.behavior_state.clone(),
        state_variables: report.state_variables.clone(),
        site_actions: report.site_actions.clone(),
        layer_actions: report.layer_actions.clone(),
        velocity: report.velocity,
    }
}

fn no_reports(recording: &Path, name: &RobotName, robots: Option<&[RobotName]>) -> LabError {
    let place = recording.display();
    match robots {
        None => LabError::record(format!(
            "{place} is not there: what {name} reported is unknown"
        ))
        .with_help(NOT_RECORDED),
        Some(robots) => {
            let mut names = Vec::new();
            for robot in robots {
                names.push(robot.as_str());
            }

            LabError::record(format!("{place} has no robot {name}"))
                .with_help(format!("its robots are {}", names.join(", ")))
        }
    }
}

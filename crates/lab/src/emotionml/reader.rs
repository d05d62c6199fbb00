//! Reads the states of a run's robots tick by tick, from its recording, or from its events if it has no recording.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use config::Changes;
use miette::{IntoDiagnostic, miette};
use protocol::messages::{Parameters, Report};
use protocol::{Epoch, Event, Line, RobotName, RunName, Tick};
use record::RunFolder;
use record::names::{EVENTS, RECORDING, SCENARIO};
use recording::{Recording, Ticks};
use scenario::Scenario;
use timeline::Timeline;

use super::episode::{Presence, RobotState};
use crate::folder::run_name;

/// Longest line of a record, bytes; a tick of a thousand robots that publish much takes a hundredth of it.
const MAX_LINE_BYTES: u64 = 1 << 28;

/// Facts that hold for the whole run.
#[derive(Debug, Clone)]
pub(super) struct Facts {
    pub(super) run: RunName,
    /// Epoch of the record; events do not contain it.
    pub(super) epoch: Option<Epoch>,
    pub(super) seed: u64,
    /// Length of a tick, simulated seconds.
    pub(super) tick_s: f64,
    /// Name of the file that was read.
    pub(super) file: &'static str,
    /// Parameters of each robot; empty if the scenario of the run cannot be read.
    pub(super) parameters: BTreeMap<RobotName, Parameters>,
}

/// The robots after a tick.
#[derive(Debug)]
pub(super) struct Snapshot {
    pub(super) tick: Tick,
    pub(super) robots: Vec<RobotState>,
}

/// A record that is being read.
pub(super) struct Reader {
    path: PathBuf,
    facts: Facts,
    source: Source,
    /// What the record lacks, for people.
    notes: Vec<String>,
}

/// What is read.
enum Source {
    Recording(Box<Playback>),
    Events {
        lines: Lines,
        replay: Replay,
        /// The tick that must come next.
        due: Tick,
    },
}

/// A recording that is read from its beginning to its end.
struct Playback {
    ticks: Ticks,
    /// The last report of each robot.
    reports: BTreeMap<RobotName, Report>,
    /// Who takes part.
    timeline: Timeline,
}

impl Reader {
    /// Opens the recording of a run, or its events.
    ///
    /// # Errors
    /// If neither exists, or it has no beginning.
    pub(super) fn open(folder: &RunFolder) -> miette::Result<Self> {
        let recording = folder.file(RECORDING);
        if recording.exists() {
            return Self::recording(folder, recording);
        }

        let events = folder.file(EVENTS);
        if events.exists() {
            return Self::events(folder, Lines::open(events)?);
        }

        let folder = folder.path().display();
        Err(miette!(
            help = "is it the folder of a run?",
            "{folder} has neither {RECORDING} nor {EVENTS}"
        ))
    }

    fn recording(folder: &RunFolder, path: PathBuf) -> miette::Result<Self> {
        let recording = Recording::open(&path).into_diagnostic()?;
        let mut notes = Vec::new();
        if !recording.is_finished() {
            let path = path.display();
            notes.push(format!(
                "{path} was not finished: what comes after tick {} is left out",
                recording.len().saturating_sub(1)
            ));
        }

        let header = recording.header().clone();
        let facts = Facts {
            run: header.run,
            epoch: Some(header.epoch),
            seed: header.seed,
            tick_s: header.tick_s,
            file: RECORDING,
            parameters: parameters(folder, &mut notes),
        };
        let playback = Playback {
            ticks: Ticks::of(recording),
            reports: BTreeMap::new(),
            timeline: Timeline::default(),
        };

        let source = Source::Recording(Box::new(playback));
        Self::begin(path, facts, source, notes)
    }

    fn events(folder: &RunFolder, mut lines: Lines) -> miette::Result<Self> {
        let path = lines.path.clone();
        let Line {
            event: Event::Init { seed, tick_s, .. },
            ..
        } = lines.first()?
        else {
            return Err(miette!("{} does not begin with `init`", path.display()));
        };

        let mut notes = vec![format!(
            "{} has no {RECORDING} (`[record] frames = false`?): read from {EVENTS}, without intensities",
            folder.path().display()
        )];
        let facts = Facts {
            run: run_name(folder),
            epoch: None,
            seed,
            tick_s,
            file: EVENTS,
            parameters: parameters(folder, &mut notes),
        };

        let source = Source::Events {
            lines,
            replay: Replay::default(),
            due: 0,
        };
        Self::begin(path, facts, source, notes)
    }

    fn begin(
        path: PathBuf,
        facts: Facts,
        source: Source,
        notes: Vec<String>,
    ) -> miette::Result<Self> {
        let tick_s = facts.tick_s;
        if !(tick_s > 0.0 && tick_s.is_finite()) {
            let path = path.display();
            return Err(miette!("{path}: a tick cannot last {tick_s} s"));
        }

        Ok(Self {
            path,
            facts,
            source,
            notes,
        })
    }

    /// Facts that hold for the whole run.
    pub(super) fn facts(&self) -> &Facts {
        &self.facts
    }

    /// The file that is read.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// What the record lacks, for people.
    pub(super) fn into_notes(mut self) -> Vec<String> {
        if let Source::Events { lines, .. } = &self.source
            && lines.is_incomplete
        {
            let path = self.path.display();
            let note = format!("the last line of {path} is incomplete and left out");
            self.notes.push(note);
        }
        self.notes
    }

    /// The next tick; `None` after the last complete one.
    ///
    /// # Errors
    /// If it cannot be decoded, or is another one than the next.
    pub(super) fn next(&mut self) -> miette::Result<Option<Snapshot>> {
        match &mut self.source {
            Source::Recording(playback) => playback.next(),
            Source::Events { lines, replay, due } => {
                let Some(snapshot) = next_of(lines, replay)? else {
                    return Ok(None);
                };
                if snapshot.tick != *due {
                    return Err(miette!(
                        "{}, line {}: tick {} where {} is due",
                        self.path.display(),
                        lines.number,
                        snapshot.tick,
                        due
                    ));
                }

                *due += 1;
                Ok(Some(snapshot))
            }
        }
    }
}

impl Playback {
    /// The next tick; `None` after the last complete one.
    fn next(&mut self) -> miette::Result<Option<Snapshot>> {
        let Some(mut tick) = self.ticks.next_tick().into_diagnostic()? else {
            return Ok(None);
        };

        for event in &tick.events {
            self.timeline.apply(tick.frame.tick, event);
        }
        self.reports.append(&mut tick.reports);
        let mut robots = Vec::new();
        for robot in &tick.frame.robots {
            // A robot has a state from its first report on.
            if let Some(report) = self.reports.get(&robot.name) {
                robots.push(RobotState {
                    name: robot.name.clone(),
                    presence: presence(&self.timeline, &robot.name, robot.missed.is_some()),
                    emotion: report.emotion_state.clone(),
                    behavior: report.behavior_state.clone(),
                    variables: Some(report.state_variables.clone()),
                });
            }
        }
        Ok(Some(Snapshot {
            tick: tick.frame.tick,
            robots,
        }))
    }
}

/// The next tick that the events tell of; `None` after the last complete one.
fn next_of(lines: &mut Lines, replay: &mut Replay) -> miette::Result<Option<Snapshot>> {
    while let Some(line) = lines.next()? {
        let tick = line.tick;
        if let Some(robots) = replay.apply(tick, line.event) {
            return Ok(Some(Snapshot { tick, robots }));
        }
    }

    Ok(None)
}

/// Whether a robot has reported in a tick, and else why not.
fn presence(timeline: &Timeline, robot: &RobotName, has_missed: bool) -> Presence {
    if timeline.lost_since(robot).is_some() {
        return Presence::Absent;
    }
    if has_missed {
        return Presence::Missed;
    }
    Presence::Reported
}

/// The states of the robots, restored from events, which contain only changes.
#[derive(Debug, Default)]
struct Replay {
    robots: BTreeMap<RobotName, RobotState>,
    timeline: Timeline,
}

impl Replay {
    /// Applies an event. Returns the robots if the event completes a tick.
    fn apply(&mut self, tick: Tick, event: Event) -> Option<Vec<RobotState>> {
        self.timeline.apply(tick, &event);
        match event {
            Event::Joined { robot, .. } => _ = self.state_of(robot),
            Event::Missed { robot } => self.state_of(robot).presence = Presence::Missed,
            Event::Emotion { robot, to, .. } => self.state_of(robot).emotion = to,
            Event::Behavior { robot, to, .. } => self.state_of(robot).behavior = to,
            Event::Tick { .. } => return Some(self.end_tick()),
            _ => {}
        }

        None
    }

    /// The robots of a complete tick. Misses do not carry over to the next one.
    fn end_tick(&mut self) -> Vec<RobotState> {
        let mut robots = Vec::new();
        for robot in self.robots.values_mut() {
            let mut shown = robot.clone();
            let has_missed = robot.presence == Presence::Missed;
            shown.presence = presence(&self.timeline, &robot.name, has_missed);
            robots.push(shown);
            robot.presence = Presence::Reported;
        }
        robots
    }

    /// The state of a robot; a new one is empty.
    fn state_of(&mut self, name: RobotName) -> &mut RobotState {
        let empty = RobotState {
            name: name.clone(),
            presence: Presence::Reported,
            emotion: String::new(),
            behavior: String::new(),
            variables: None,
        };
        self.robots.entry(name).or_insert(empty)
    }
}

/// The parameters of each robot, from the scenario of the run if it can be read.
fn parameters(folder: &RunFolder, notes: &mut Vec<String>) -> BTreeMap<RobotName, Parameters> {
    let mut parameters = BTreeMap::new();
    match Scenario::load(&folder.file(SCENARIO), &Changes::default()) {
        Ok(scenario) => {
            for (name, robot) in scenario.robots {
                parameters.insert(name, robot.parameters);
            }
        }
        Err(error) => {
            let reason = error.in_words();
            notes.push(format!("{reason}: goals are not known"));
        }
    }

    parameters
}

/// A file with one JSON value a line.
struct Lines {
    reader: BufReader<File>,
    path: PathBuf,
    /// Number of the line that was read last, from 1.
    number: u64,
    /// Whether the last line has no end: it is being written, or the run was interrupted while writing it.
    is_incomplete: bool,
}

impl Lines {
    fn open(path: PathBuf) -> miette::Result<Self> {
        let file = File::open(&path)
            .map_err(|error| miette!("cannot read {}: {error}", path.display()))?;
        Ok(Self {
            reader: BufReader::new(file),
            path,
            number: 0,
            is_incomplete: false,
        })
    }

    /// The first line, which must exist.
    fn first(&mut self) -> miette::Result<Line> {
        self.next()?
            .ok_or_else(|| miette!("{} holds no run yet", self.path.display()))
    }

    /// The next line; `None` at the end of the file or at an incomplete last line.
    fn next(&mut self) -> miette::Result<Option<Line>> {
        let mut bytes = Vec::new();
        let read = self
            .reader
            .by_ref()
            .take(MAX_LINE_BYTES)
            .read_until(b'\n', &mut bytes);
        read.map_err(|error| miette!("cannot read {}: {error}", self.path.display()))?;
        self.number += 1;
        let is_whole = bytes.ends_with(b"\n") || bytes.len() as u64 == MAX_LINE_BYTES;

        match Line::from_json(&bytes) {
            Ok(line) => Ok(Some(line)),
            Err(_) if bytes.is_empty() => Ok(None),
            Err(_) if !is_whole => {
                self.is_incomplete = true;
                Ok(None)
            }
            Err(error) => Err(miette!(
                "{}, line {}: {error}",
                self.path.display(),
                self.number
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Emotion of the only robot after each tick; `None` without a report.
    fn emotions(events: Vec<Event>) -> Vec<Option<String>> {
        let mut replay = Replay::default();
        let ticks = events
            .into_iter()
            .filter_map(|event| replay.apply(0, event));
        ticks
            .map(|robots| {
                let has_reported = robots[0].presence == Presence::Reported;
                has_reported.then(|| robots[0].emotion.clone())
            })
            .collect()
    }

    #[test]
    fn events_tell_ticks_with_and_without_a_report_apart() {
        let robot = || RobotName::new("Butler").unwrap();
        let tick = || Event::Tick {
            digest: String::new(),
            seal: None,
        };
        let emotion = |to: &str| Event::Emotion {
            robot: robot(),
            from: None,
            to: to.to_owned(),
        };
        let joined = |generation| Event::Joined {
            robot: robot(),
            generation,
            at: Default::default(),
        };
        let found = emotions(vec![
            joined(None),
            emotion("HAPPY"),
            tick(),
            tick(),
            Event::Missed { robot: robot() },
            tick(),
            tick(),
            Event::Lost { robot: robot() },
            tick(),
            tick(),
            joined(Some(2)),
            emotion("CONCERNED"),
            tick(),
        ]);

        let happy = Some("HAPPY".to_owned());
        let concerned = Some("CONCERNED".to_owned());
        assert_eq!(
            found,
            [
                happy.clone(),
                happy.clone(),
                None,
                happy,
                None,
                None,
                concerned
            ]
        );
    }
}

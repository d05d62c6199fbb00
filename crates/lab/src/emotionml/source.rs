//! What a run left of its robots' emotions, tick by tick: its recording, or, where it has none, its events.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use config::Changes;
use miette::{IntoDiagnostic, miette};
use protocol::messages::{Parameters, RecordedRobot, RecordedTick, RecordingHeader};
use protocol::{Epoch, Event, Line, RobotName, RunName, Tick};
use serde::de::DeserializeOwned;
use simulator::recorder::{EVENTS, RECORDING, SCENARIO};
use simulator::{RunFolder, Scenario};

use super::episode::Seen;
use super::notes::note;

/// Longest line of a record: a thousand robots and guests that publish much take a hundredth of it.
const MAX_LINE_BYTES: u64 = 1 << 28;

/// What holds for the whole run.
#[derive(Debug, Clone)]
pub(super) struct Facts {
    pub(super) run: RunName,
    /// Which of the run's epochs; events do not say it.
    pub(super) epoch: Option<Epoch>,
    pub(super) seed: u64,
    /// Length of a tick, simulated seconds.
    pub(super) tick_s: f64,
    /// Name of the file that was read.
    pub(super) file: &'static str,
    /// What each robot was told about itself, as far as the run's scenario is there.
    pub(super) parameters: BTreeMap<RobotName, Parameters>,
}

/// The robots after a tick.
#[derive(Debug)]
pub(super) struct Moment {
    pub(super) tick: Tick,
    pub(super) robots: Vec<Seen>,
}

/// A record that is being read.
pub(super) struct Source {
    lines: Lines,
    facts: Facts,
    /// The tick that must come next.
    due: Tick,
    /// Only where events are read.
    replay: Option<Replay>,
}

impl Source {
    /// Opens the recording of a run, or its events.
    ///
    /// # Errors
    /// Neither is there, or what is there does not begin as it should.
    pub(super) fn open(folder: &RunFolder) -> miette::Result<Self> {
        let [recording, events] = [RECORDING, EVENTS].map(|name| folder.file(name));
        if recording.exists() {
            return Self::recording(folder, Lines::open(recording)?);
        }

        if events.exists() {
            note(&format!(
                "{} has no {RECORDING} (`[record] frames = false`?): read from {EVENTS}, without intensities",
                folder.path().display()
            ));
            return Self::events(folder, Lines::open(events)?);
        }

        let folder = folder.path().display();

        Err(miette!(
            help = "is it the folder of a run?",
            "{folder} has neither {RECORDING} nor {EVENTS}"
        ))
    }

    fn recording(folder: &RunFolder, mut lines: Lines) -> miette::Result<Self> {
        let header: RecordingHeader = lines.first()?;
        let facts = Facts {
            run: header.run,
            epoch: Some(header.epoch),
            seed: header.seed,
            tick_s: header.tick_s,
            file: RECORDING,
            parameters: parameters(folder),
        };

        Self::begin(lines, facts, None)
    }

    fn events(folder: &RunFolder, mut lines: Lines) -> miette::Result<Self> {
        let Line {
            event: Event::Init { seed, tick_s, .. },
            ..
        } = lines.first()?
        else {
            return Err(miette!(
                "{} does not begin with `init`",
                lines.path.display()
            ));
        };

        let (run, file) = (name(folder)?, EVENTS);
        let facts = Facts {
            run,
            epoch: None,
            seed,
            tick_s,
            file,
            parameters: parameters(folder),
        };

        Self::begin(lines, facts, Some(Replay::default()))
    }

    fn begin(lines: Lines, facts: Facts, replay: Option<Replay>) -> miette::Result<Self> {
        if facts.tick_s > 0.0 && facts.tick_s.is_finite() {
            return Ok(Self {
                lines,
                facts,
                due: 0,
                replay,
            });
        }

        Err(miette!(
            "{}: a tick of {} s cannot be",
            lines.path.display(),
            facts.tick_s
        ))
    }

    /// What holds for the whole run.
    pub(super) fn facts(&self) -> &Facts {
        &self.facts
    }

    /// The file that is read.
    pub(super) fn path(&self) -> &Path {
        &self.lines.path
    }

    /// The next tick; `None` after the last complete one.
    ///
    /// # Errors
    /// A line that is no record, or a tick that is not the next one.
    pub(super) fn next(&mut self) -> miette::Result<Option<Moment>> {
        let Some(moment) = self.read()? else {
            return Ok(None);
        };

        if moment.tick != self.due {
            let (path, line) = (self.path().display(), self.lines.number);
            return Err(miette!(
                "{path}, line {line}: tick {} where {} is due",
                moment.tick,
                self.due
            ));
        }

        self.due += 1;
        Ok(Some(moment))
    }

    fn read(&mut self) -> miette::Result<Option<Moment>> {
        let Some(replay) = &mut self.replay else {
            let recorded: Option<RecordedTick> = self.lines.next()?;
            return Ok(recorded.map(|recorded| Moment {
                tick: recorded.tick,
                robots: recorded.robots.into_iter().map(Seen::from).collect(),
            }));
        };

        while let Some(line) = self.lines.next::<Line>()? {
            let tick = line.tick;
            if let Some(robots) = replay.take(line.event) {
                return Ok(Some(Moment { tick, robots }));
            }
        }

        Ok(None)
    }
}

impl From<RecordedRobot> for Seen {
    fn from(robot: RecordedRobot) -> Self {
        Self {
            name: robot.name,
            missed: robot.missed,
            emotion: robot.emotion_state,
            behavior: robot.behavior_state,
            variables: Some(robot.state_variables),
        }
    }
}

/// The states of the robots, from events that say only what changes.
#[derive(Debug, Default)]
struct Replay {
    robots: BTreeMap<RobotName, Seen>,
    lost: BTreeSet<RobotName>,
}

impl Replay {
    /// Takes in an event; returns the robots if it completes a tick.
    fn take(&mut self, event: Event) -> Option<Vec<Seen>> {
        match event {
            Event::Joined { robot, .. } => {
                self.lost.remove(&robot);
                self.of(robot);
            }
            Event::Lost { robot } => {
                self.lost.insert(robot);
            }
            Event::Missed { robot } => self.of(robot).missed = true,
            Event::Emotion { robot, to, .. } => self.of(robot).emotion = to,
            Event::Behavior { robot, to, .. } => self.of(robot).behavior = to,
            Event::Tick { .. } => {
                let lost = &self.lost;
                let shown = self.robots.values().map(|robot| Seen {
                    missed: robot.missed || lost.contains(&robot.name),
                    ..robot.clone()
                });
                let shown = shown.collect();
                self.robots
                    .values_mut()
                    .for_each(|robot| robot.missed = false);
                return Some(shown);
            }
            _ => {}
        }

        None
    }

    fn of(&mut self, name: RobotName) -> &mut Seen {
        let unknown = Seen {
            name: name.clone(),
            missed: false,
            emotion: String::new(),
            behavior: String::new(),
            variables: None,
        };
        self.robots.entry(name).or_insert(unknown)
    }
}

/// The run's name, which is that of its folder.
fn name(folder: &RunFolder) -> miette::Result<RunName> {
    let path = folder.path().canonicalize().into_diagnostic()?;
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    RunName::new(&name)
        .map_err(|error| miette!("{} has not the name of a run: {error}", path.display()))
}

/// What each robot was told about itself; a run without its scenario says less of its robots.
fn parameters(folder: &RunFolder) -> BTreeMap<RobotName, Parameters> {
    let file = folder.file(SCENARIO);
    match Scenario::load(&file, &Changes::default()) {
        Ok(scenario) => scenario
            .robots
            .into_iter()
            .map(|(name, robot)| (name, robot.parameters))
            .collect(),
        Err(error) => {
            note(&format!(
                "{}: goals and the scale of needs are not known",
                error.in_words()
            ));
            BTreeMap::new()
        }
    }
}

/// A file of one JSON value a line.
struct Lines {
    reader: BufReader<File>,
    path: PathBuf,
    number: u64,
}

impl Lines {
    fn open(path: PathBuf) -> miette::Result<Self> {
        let file = File::open(&path)
            .map_err(|error| miette!("cannot read {}: {error}", path.display()))?;
        Ok(Self {
            reader: BufReader::new(file),
            path,
            number: 0,
        })
    }

    /// The line with which the file has to begin.
    fn first<T: DeserializeOwned>(&mut self) -> miette::Result<T> {
        self.next()?
            .ok_or_else(|| miette!("{} holds no run yet", self.path.display()))
    }

    /// The next line; `None` at the end. A last line without its end was being written when the run broke off, or is
    /// being written now.
    fn next<T: DeserializeOwned>(&mut self) -> miette::Result<Option<T>> {
        let mut bytes = Vec::new();
        let read = self
            .reader
            .by_ref()
            .take(MAX_LINE_BYTES)
            .read_until(b'\n', &mut bytes);

        read.map_err(|error| miette!("cannot read {}: {error}", self.path.display()))?;
        self.number += 1;
        let is_whole = bytes.ends_with(b"\n") || bytes.len() as u64 == MAX_LINE_BYTES;

        match serde_json::from_slice(&bytes) {
            Ok(value) => Ok(Some(value)),
            Err(_) if bytes.is_empty() => Ok(None),
            Err(_) if !is_whole => {
                note(&format!(
                    "the last line of {} is incomplete and left out",
                    self.path.display()
                ));
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

    /// What is known of a robot's emotion after each tick; `None` where it was not heard.
    fn heard(events: Vec<Event>) -> Vec<Option<String>> {
        let mut replay = Replay::default();
        let ticks = events.into_iter().filter_map(|event| replay.take(event));
        ticks
            .map(|robots| (!robots[0].missed).then(|| robots[0].emotion.clone()))
            .collect()
    }

    #[test]
    fn events_say_who_was_heard_in_which_tick() {
        let robot = || RobotName::new("Butler").unwrap();
        let tick = || Event::Tick {
            digest: String::new(),
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
        let heard = heard(vec![
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
        let (happy, concerned) = (Some("HAPPY".to_owned()), Some("CONCERNED".to_owned()));

        assert_eq!(
            heard,
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

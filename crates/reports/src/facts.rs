//! What a report shows of a run: facts from its events, and from its recording where its robots were.

use std::collections::BTreeMap;
use std::path::Path;

use lab::LabError;
use pictures::{Band, Floor};
use protocol::messages::{End, Variable};
use protocol::time::time_s;
use protocol::{Event, RobotName, Tick};
use record::EpochFiles;
use record::Record;
use recording::{RecordedTick, Recording, RecordingError};
use timeline::{
    Counts, ExpectationSpan, LinkCounts, Period, RobotCounts, Span, StateKind, StateOrder,
    StateSpan, Timeline,
};

use super::loss::LossByDistance;

/// Parts of the floor along its longer side.
const PARTS: f64 = 50.0;
/// State variables that are shown over time.
pub(super) const COURSES: [&str; 2] = ["intensity", "treats"];
/// Ticks that are read from a recording in one go.
const AT_ONCE: Tick = 64;

/// The facts about an epoch of a run.
#[derive(Debug, Default)]
pub(super) struct RunFacts {
    /// Seed.
    pub(super) seed: u64,
    /// Version of the simulator.
    pub(super) version: String,
    /// Commit that the simulator was built from, if it is known.
    pub(super) commit: Option<String>,
    /// Length of a tick, simulated seconds.
    pub(super) tick_s: f64,
    /// The last complete tick.
    pub(super) last_tick: Tick,
    /// How the run ended; `None` if it has no end.
    pub(super) end: Option<End>,
    /// What of the scenario's `end_when` held, if that ended the run.
    pub(super) end_because: Option<String>,
    /// Digest up to the last complete tick.
    pub(super) digest: String,
    /// The robots.
    pub(super) robots: BTreeMap<RobotName, RobotFacts>,
    /// Commands by sender and target.
    pub(super) links: BTreeMap<(RobotName, RobotName), LinkCounts>,
    /// What the radio lost, by distance.
    pub(super) loss: LossByDistance,
    /// Faults, absences, cuts and changes, in the order of their beginnings.
    pub(super) disturbances: Vec<ScenarioEffect>,
    /// The verdicts about expectations, in the order in which they were decided.
    pub(super) judged: Vec<ExpectationSpan>,
    /// The emotions and behaviors of its robots.
    pub(super) names: StateOrder,
    /// Where the robots were, if it was recorded.
    pub(super) floors: BTreeMap<RobotName, Floor>,
    /// What is missing, a sentence each.
    pub(super) notes: Vec<String>,
}

/// The facts about a robot.
#[derive(Debug, Default)]
pub(super) struct RobotFacts {
    /// Its emotions over time.
    emotions: Vec<Band>,
    /// Its behaviors over time.
    behaviors: Vec<Band>,
    /// Its state variables over time that are shown, those of [`COURSES`] that it publishes. Each value holds from its time on.
    pub(super) courses: BTreeMap<&'static str, Vec<(f64, Option<f64>)>>,
    pub(super) counts: RobotCounts,
}

/// Something that the scenario did to the robots or their network.
#[derive(Debug)]
pub(super) struct ScenarioEffect {
    pub(super) what: String,
    pub(super) whom: String,
    pub(super) begin: Tick,
    /// `None` if it lasted to the end of the run.
    pub(super) end: Option<Tick>,
}

impl RunFacts {
    /// Reads the facts about an epoch.
    ///
    /// # Errors
    /// If its events cannot be read or have no complete tick.
    pub(super) fn read(files: &EpochFiles) -> Result<Self, LabError> {
        let mut facts = Self::default();
        let mut record = Record::of_events(&files.events)?;
        let mut timeline = Timeline::default();
        let mut counts = Counts::default();
        let mut is_empty = true;
        while let Some(entry) = record.next_entry()? {
            is_empty = false;
            facts.last_tick = entry.tick;
            facts.add_bounds(&entry.events);
            for event in &entry.events {
                counts.add(event);
            }
            for span in timeline.tick(entry.tick, &entry.events) {
                counts.add_span(&span, entry.tick);
                facts.add_span(span);
            }
        }
        if is_empty {
            let path = files.events.display();
            return Err(LabError::record(format!("{path} has no complete tick"))
                .with_help("a run that has just begun has nothing to report yet"));
        }

        for span in timeline.in_progress() {
            counts.add_span(&span, facts.last_tick);
            facts.add_span(span);
        }
        facts.disturbances.sort_by_key(|one| one.begin);
        facts.set_counts(&timeline, counts);
        if facts.end.is_none() {
            facts.notes.push(format!(
                "The record has no end: the run is in progress, or its simulator was killed. Numbers go up to tick {}.",
                facts.last_tick
            ));
        }
        facts.add_recording(&files.recording);
        Ok(facts)
    }

    /// Simulated time of the last complete tick, seconds.
    pub(super) fn time_s(&self) -> f64 {
        time_s(self.last_tick, self.tick_s)
    }

    /// Adds what the events say with which the run begins, and a tick or the run ends.
    fn add_bounds(&mut self, events: &[Event]) {
        if let Some(Event::Init {
            seed,
            version,
            tick_s,
            ..
        }) = events.first()
        {
            self.seed = *seed;
            self.version.clone_from(version);
            self.tick_s = *tick_s;
        }

        if let Some(Event::Tick { digest, .. }) = events.last() {
            self.digest.clone_from(digest);
        }
        if let Some(Event::End {
            reason, because, ..
        }) = events.last()
        {
            self.end = Some(*reason);
            self.end_because.clone_from(because);
        }
    }

    /// Adds a span that is over, or in progress at the end.
    fn add_span(&mut self, span: Span) {
        let (what, whom, period) = match span {
            Span::Stay(stay) => return self.add_stay(stay),
            Span::Command(command) => return self.loss.add(&command),
            Span::Judged(judged) => return self.judged.push(judged),
            Span::Absence(absence) => (
                "takes no part".to_owned(),
                absence.robot.to_string(),
                absence.period,
            ),
            Span::Fault(fault) => (
                format!("{:?}", fault.kind).to_lowercase(),
                fault.robot.to_string(),
                fault.period,
            ),
            Span::Cut(cut) => {
                let what = match (cut.commands, cut.queries) {
                    (true, true) => "cut",
                    (true, false) => "commands cut",
                    _ => "queries cut",
                };
                let whom = format!("{} → {}", cut.from, cut.to);
                (what.to_owned(), whom, cut.period)
            }
            Span::Change(change) => (
                "change of the scenario".to_owned(),
                change.set,
                Period::since(change.tick),
            ),
            Span::Missed(_) | Span::QueriesLost(_) | Span::Guest(_) | Span::Joined(_) => return,
        };

        self.disturbances.push(ScenarioEffect {
            what,
            whom,
            begin: period.begin,
            end: period.end,
        });
    }

    /// Adds a stay of a robot in a state. States last until the last tick.
    fn add_stay(&mut self, stay: StateSpan) {
        let ticks = stay.period.ticks(self.last_tick);
        if ticks == 0 {
            return;
        }

        let begin = stay.period.begin;
        let band = Band {
            name: stay.name,
            begin_s: begin as f64 * self.tick_s,
            end_s: (begin + ticks) as f64 * self.tick_s,
        };
        let robot = self.robots.entry(stay.robot).or_default();
        let bands = match stay.kind {
            StateKind::Emotion => &mut robot.emotions,
            StateKind::Behavior => &mut robot.behaviors,
        };
        bands.push(band);
    }

    fn set_counts(&mut self, timeline: &Timeline, mut counts: Counts) {
        for name in timeline.robots() {
            let robot = self.robots.entry(name.clone()).or_default();
            robot.counts = counts.robots.remove(name).unwrap_or_default();
        }
        self.links = counts.links;
        self.names = timeline.names().clone();
    }

    /// Adds what only a recording has. Without one, or with a damaged one, a note says what is missing.
    fn add_recording(&mut self, path: &Path) {
        if !path.exists() {
            self.notes.push(
                "There is no recording (`record.frames = false`?), so neither the course of state variables nor the occupancy of the floor is known.".to_owned(),
            );
            return;
        }
        if let Err(error) = self.read_recording(path) {
            self.notes.push(format!(
                "The course of state variables and the occupancy of the floor are incomplete: {error}."
            ));
        }
    }

    fn read_recording(&mut self, path: &Path) -> Result<(), RecordingError> {
        let recording = Recording::open(path)?;
        let header = recording.header();
        self.commit.clone_from(&header.commit);
        let [width_m, height_m] = header.field_m;
        let part_m = width_m.max(height_m) / PARTS;
        let empty = Floor {
            title: String::new(),
            field_m: header.field_m,
            body_m: header.body_m,
            obstacles: header.obstacles.clone(),
            static_world: header.static_world.clone(),
            part_m,
            times_s: BTreeMap::new(),
        };

        let mut next = 0;
        // Where a robot is after a tick it is until the next one: of the last tick there is no time.
        let last = recording.len().saturating_sub(1);
        while next < last {
            let ticks = recording.read(next, last.min(next + AT_ONCE))?;
            for tick in &ticks {
                self.add_courses(tick);
                self.loss.measure(tick.frame.tick, &tick.frame.robots);
                for robot in &tick.frame.robots {
                    let column = (robot.location.x / part_m).clamp(0.0, PARTS - 1.0);
                    let row = (robot.location.y / part_m).clamp(0.0, PARTS - 1.0);
                    let floor = self.floors.entry(robot.name.clone());
                    let floor = floor.or_insert_with(|| empty.clone());
                    let part = (column as u32, row as u32);
                    *floor.times_s.entry(part).or_insert(0.0) += header.tick_s;
                }
            }
            next += AT_ONCE;
        }
        Ok(())
    }
}

impl RunFacts {
    /// Adds the values of a tick that differ from those before.
    fn add_courses(&mut self, tick: &RecordedTick) {
        let time_s = time_s(tick.frame.tick, self.tick_s);
        for placed in &tick.frame.robots {
            let report = tick.reports.get(&placed.name);
            let robot = self.robots.entry(placed.name.clone()).or_default();
            for name in COURSES {
                let value = report.and_then(|report| report.state_variables.get(name));
                let value = match value {
                    Some(Variable::Number(number)) => Some(*number),
                    _ => None,
                };
                let values = robot.courses.entry(name).or_default();
                if values.last().and_then(|(_, last)| *last) != value {
                    values.push((time_s, value));
                }
            }
        }
    }
}

impl RobotFacts {
    /// Its states of a kind over time.
    pub(super) fn bands(&self, kind: StateKind) -> &Vec<Band> {
        match kind {
            StateKind::Emotion => &self.emotions,
            StateKind::Behavior => &self.behaviors,
        }
    }
}

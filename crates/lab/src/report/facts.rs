//! What a report shows of a run: facts from its events, and from its recording where its robots were.

use std::collections::BTreeMap;
use std::path::Path;

use config::FileError;
use protocol::messages::{End, Verdict};
use protocol::time::time_s;
use protocol::{Event, RobotName, Tick};
use record::EpochFiles;
use record::{Entry, Record};
use recording::{Recording, RecordingError};
use report::{Band, Floor};
use timeline::{Kind, Stay};

/// Parts of the floor along its longer side.
const PARTS: f64 = 50.0;
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
    /// Digest up to the last complete tick.
    pub(super) digest: String,
    /// The robots.
    pub(super) robots: BTreeMap<RobotName, RobotFacts>,
    /// Commands by sender and target.
    pub(super) links: BTreeMap<(RobotName, RobotName), LinkFacts>,
    /// Faults, absences, cuts and changes, in the order of their beginnings.
    pub(super) disturbances: Vec<Disturbance>,
    /// The verdicts about expectations, in the order in which they were decided.
    pub(super) judged: Vec<JudgedFacts>,
    /// Where the robots were, if it was recorded.
    pub(super) floors: BTreeMap<RobotName, Floor>,
    /// What is missing, a sentence each.
    pub(super) notes: Vec<String>,
    /// The states of the robots after the last event.
    states: timeline::States,
}

/// The facts about a robot.
#[derive(Debug, Default)]
pub(super) struct RobotFacts {
    pub(super) emotions: States,
    pub(super) behaviors: States,
    /// Moves that were refused.
    pub(super) blocked: u64,
    /// Ticks that it missed.
    pub(super) missed: u64,
    /// How often it took part again.
    pub(super) returns: u64,
}

/// The states of one kind that a robot was in.
#[derive(Debug, Default)]
pub(super) struct States {
    /// The states in their order.
    pub(super) bands: Vec<Band>,
    /// How often each state was entered, the first one included.
    pub(super) entered: BTreeMap<String, u64>,
    /// How often one state followed another.
    pub(super) transitions: BTreeMap<(String, String), u64>,
}

/// The facts about commands from one robot to another.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct LinkFacts {
    pub(super) sent: u64,
    /// A doubled command arrives twice.
    pub(super) delivered: u64,
    pub(super) dropped: u64,
    pub(super) delayed: u64,
    pub(super) duplicated: u64,
}

/// The verdict about an expectation.
#[derive(Debug)]
pub(super) struct JudgedFacts {
    pub(super) expectation: String,
    pub(super) verdict: Verdict,
    pub(super) tick: Tick,
    /// Why, in words.
    pub(super) because: String,
}

/// Something that the scenario did to the robots or their network.
#[derive(Debug)]
pub(super) struct Disturbance {
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
    /// [`FileError`] if its events cannot be read or have no complete tick.
    pub(super) fn read(files: &EpochFiles) -> Result<Self, FileError> {
        let mut facts = Self::default();
        let mut record = Record::of_events(&files.events)?;
        let mut is_empty = true;
        while let Some(entry) = record.next_entry()? {
            is_empty = false;
            facts.add(&entry);
        }
        if is_empty {
            let path = files.events.display();
            return Err(FileError::new(format!("{path} has no complete tick"))
                .with_help("a run that has just begun has nothing to report yet"));
        }

        facts.finish();
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

    /// The sum over all links.
    pub(super) fn commands(&self) -> LinkFacts {
        let mut sum = LinkFacts::default();
        for link in self.links.values() {
            sum.sent += link.sent;
            sum.delivered += link.delivered;
            sum.dropped += link.dropped;
            sum.delayed += link.delayed;
            sum.duplicated += link.duplicated;
        }
        sum
    }

    fn add(&mut self, entry: &Entry) {
        self.last_tick = entry.tick;
        for event in &entry.events {
            self.add_event(entry.tick, event);
        }
    }

    fn add_event(&mut self, tick: Tick, event: &Event) {
        let was_lost =
            matches!(event, Event::Joined { robot, .. } if self.states.lost_since(robot).is_some());
        for stay in self.states.apply(tick, event) {
            self.add_stay(stay);
        }

        match event {
            Event::Joined { robot, .. } if was_lost => {
                self.disturb(tick, "takes no part", robot.as_str(), false);
                self.add_of_robot(tick, event);
            }
            Event::Init {
                seed,
                version,
                tick_s,
                ..
            } => {
                self.seed = *seed;
                self.version.clone_from(version);
                self.tick_s = *tick_s;
            }
            Event::Tick { digest, .. } => self.digest.clone_from(digest),
            Event::End { reason, .. } => self.end = Some(*reason),
            Event::Joined { .. }
            | Event::Lost { .. }
            | Event::Missed { .. }
            | Event::Blocked { .. }
            | Event::Emotion { .. }
            | Event::Behavior { .. } => self.add_of_robot(tick, event),
            Event::CommandSent { .. }
            | Event::CommandDelivered { .. }
            | Event::CommandDropped { .. }
            | Event::CommandDelayed { .. }
            | Event::CommandDuplicated { .. } => self.add_of_link(event),
            Event::Fault {
                robot,
                kind,
                begins,
            } => {
                let what = format!("{kind:?}").to_lowercase();
                self.disturb(tick, &what, robot.as_str(), *begins);
            }
            Event::LinkCut {
                from,
                to,
                commands,
                queries,
            } => {
                let what = match (commands, queries) {
                    (true, true) => "cut",
                    (true, false) => "commands cut",
                    _ => "queries cut",
                };
                let whom = format!("{from} → {to}");

                self.heal(tick, &whom);
                self.disturb(tick, what, &whom, true);
            }
            Event::LinkHealed { from, to } => self.heal(tick, &format!("{from} → {to}")),
            Event::Judged {
                expectation,
                verdict,
                because,
            } => self.judged.push(JudgedFacts {
                expectation: expectation.clone(),
                verdict: *verdict,
                tick,
                because: because.clone(),
            }),
            Event::Changed { set, .. } => self.disturb(tick, "change of the scenario", set, true),
            _ => {}
        }
    }

    /// Adds a stay of a robot in a state.
    fn add_stay(&mut self, stay: Stay) {
        let tick_s = self.tick_s;
        let robot = self.robots.entry(stay.robot).or_default();
        let states = match stay.kind {
            Kind::Emotion => &mut robot.emotions,
            Kind::Behavior => &mut robot.behaviors,
        };
        states.bands.push(Band {
            name: stay.state,
            begin_s: stay.begin as f64 * tick_s,
            end_s: stay.end as f64 * tick_s,
        });
    }

    fn add_of_robot(&mut self, tick: Tick, event: &Event) {
        match event {
            Event::Joined {
                robot, generation, ..
            } => {
                let facts = self.robots.entry(robot.clone()).or_default();
                facts.returns += u64::from(generation.is_some());
            }
            Event::Lost { robot } => {
                self.disturb(tick, "takes no part", robot.as_str(), true);
            }
            Event::Missed { robot } => {
                self.robots.entry(robot.clone()).or_default().missed += 1;
            }
            Event::Blocked { robot, .. } => {
                self.robots.entry(robot.clone()).or_default().blocked += 1;
            }
            Event::Emotion { robot, from, to } => {
                let facts = self.robots.entry(robot.clone()).or_default();
                facts.emotions.enter(from.as_deref(), to);
            }
            Event::Behavior { robot, from, to } => {
                let facts = self.robots.entry(robot.clone()).or_default();
                facts.behaviors.enter(from.as_deref(), to);
            }
            _ => {}
        }
    }

    fn add_of_link(&mut self, event: &Event) {
        match event {
            Event::CommandSent { from, to, .. } => self.link(from, to).sent += 1,
            Event::CommandDelivered { from, to, .. } => self.link(from, to).delivered += 1,
            Event::CommandDropped { from, to, .. } => self.link(from, to).dropped += 1,
            Event::CommandDelayed { from, to, .. } => self.link(from, to).delayed += 1,
            Event::CommandDuplicated { from, to, .. } => self.link(from, to).duplicated += 1,
            _ => {}
        }
    }

    fn link(&mut self, from: &RobotName, to: &RobotName) -> &mut LinkFacts {
        self.links.entry((from.clone(), to.clone())).or_default()
    }

    /// Something begins, or what has begun last of its kind is over.
    fn disturb(&mut self, tick: Tick, what: &str, whom: &str, begins: bool) {
        if begins {
            self.disturbances.push(Disturbance {
                what: what.to_owned(),
                whom: whom.to_owned(),
                begin: tick,
                end: None,
            });
            return;
        }

        let mut open = self.disturbances.iter_mut().rev();
        let last = open.find(|one| one.what == what && one.whom == whom && one.end.is_none());
        if let Some(last) = last {
            last.end = Some(tick);
        }
    }

    /// The cut of a link is over, whatever it cut.
    fn heal(&mut self, tick: Tick, link: &str) {
        for one in &mut self.disturbances {
            if one.whom == link && one.end.is_none() {
                one.end = Some(tick);
            }
        }
    }

    /// States last until the last tick.
    fn finish(&mut self) {
        for stay in std::mem::take(&mut self.states).lasting(self.last_tick) {
            self.add_stay(stay);
        }
    }

    /// Adds what only a recording has. Without one, or with a damaged one, a note says what is missing.
    fn add_recording(&mut self, path: &Path) {
        if !path.exists() {
            self.notes.push(
                "There is no recording (`record.frames = false`?), so the occupancy of the floor is not known.".to_owned(),
            );
            return;
        }
        if let Err(error) = self.read_recording(path) {
            self.notes.push(format!(
                "The occupancy of the floor is incomplete: {error}."
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
            part_m,
            times_s: BTreeMap::new(),
        };

        let mut next = 0;
        // Where a robot is after a tick it is until the next one: of the last tick there is no time.
        let last = recording.len().saturating_sub(1);
        while next < last {
            let ticks = recording.read_raw(next, last.min(next + AT_ONCE))?;
            for tick in &ticks {
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

impl States {
    /// Time in each state, seconds, by name.
    pub(super) fn times_s(&self) -> BTreeMap<String, f64> {
        let mut times = BTreeMap::new();
        for band in &self.bands {
            *times.entry(band.name.clone()).or_insert(0.0) += band.end_s - band.begin_s;
        }
        times
    }

    fn enter(&mut self, from: Option<&str>, to: &str) {
        *self.entered.entry(to.to_owned()).or_insert(0) += 1;
        if let Some(from) = from {
            let transition = (from.to_owned(), to.to_owned());
            *self.transitions.entry(transition).or_insert(0) += 1;
        }
    }
}

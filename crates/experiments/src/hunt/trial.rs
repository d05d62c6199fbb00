//! Playing cases: what is asked of a run, and what came of it.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use config::{Changes, Source};
use observe::Observation;
use protocol::messages::{End, Verdict};
use protocol::{Event, RobotName, RunName, Tick};
use scenario::Scenario;
use simulator::Simulation;
use timeline::{CommandSpan, Counts, Span, StateKind, Timeline};

use super::case::FaultCase;
use super::coverage::{CommandFate, Feature};
use super::fault::Link;
use crate::follow::Follow;
use crate::launches::Launches;
use crate::own::{ByClass, RobotSource, RunRobots};
use crate::plan::LaunchText;
use lab::LabError;
use lab::run::{Local, check_faults, make_robots_with};

/// What is expected of every run beside the expectations of its scenario.
pub const RUNS: &str = "the run goes to its end";

/// What came of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TrialResult {
    /// The expectations that failed.
    pub failed: BTreeMap<String, FailedExpectation>,
    /// The expectations that the run has.
    pub expectations: BTreeSet<String>,
    /// Those that were not asked: what they are expected after did not happen.
    pub not_asked: BTreeSet<String>,
    /// The last tick.
    pub ticks: Tick,
    /// Commands between robots, in the order in which they were sent.
    pub sent: Vec<SentMessage>,
    /// What happened.
    pub features: BTreeSet<Feature>,
}

/// An expectation that failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailedExpectation {
    /// The tick in which that was certain.
    pub tick: Tick,
    /// Why.
    pub because: String,
}

/// A command that a robot sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SentMessage {
    /// When.
    pub tick: Tick,
    /// The link.
    pub link: Link,
    /// Its number on the link, from 1.
    pub number: u64,
    /// Its text.
    pub text: String,
    /// Whether it was lost, as a whole or in part.
    pub is_lost: bool,
}

/// Plays cases. The same case always has the same result.
pub trait Trial: Sync {
    /// Plays a case until one of the `wanted` expectations fails, or to its end.
    ///
    /// # Errors
    /// If the case cannot be played.
    fn play(&self, case: &FaultCase, wanted: &BTreeSet<String>) -> Result<TrialResult, LabError>;
}

/// A scenario in whose robots a hunt looks for defects.
#[derive(Debug)]
pub struct Subject {
    /// Its file, for messages.
    pub file: PathBuf,
    /// The content of the file.
    pub content: toml::Table,
    /// The folder to which the names of files in it are relative.
    pub folder: PathBuf,
    /// The scenario.
    pub scenario: Scenario,
    robots: HuntRobots,
}

/// How the robots of a hunt are played.
#[derive(Debug, Clone)]
pub enum HuntRobots {
    /// In this process, by what makes them.
    InProcess(Arc<dyn RobotSource>),
    /// As processes of their own: the programs of the project, or those of a launch file.
    Processes(Arc<Launches>, Option<LaunchText>),
}

impl Subject {
    /// Reads a scenario with the robots that ship with the project.
    ///
    /// # Errors
    /// If the scenario cannot be used, or cannot be played in one process.
    pub fn load(file: &Path, changes: &Changes) -> Result<Self, LabError> {
        Self::load_with(file, changes, HuntRobots::InProcess(ByClass::of_project()))
    }

    /// Reads a scenario with these robots.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_with(file: &Path, changes: &Changes, robots: HuntRobots) -> Result<Self, LabError> {
        // Errors show the lines of the file.
        Scenario::load(file, changes)?;

        let text = changes.apply(&Source::read(file)?)?;
        let folder = file.parent().unwrap_or(Path::new(".")).to_owned();
        let scenario = Scenario::parse(&text, &folder)?;

        if let HuntRobots::InProcess(source) = &robots {
            check_faults(&scenario, 0)?;
            check_made(&scenario, file, source.begin().as_ref())?;
        }

        // The file of a finding depends on no run.
        let mut content = text.parse()?;
        scenario::carry_moods_over(&mut content)?;
        Ok(Self {
            file: file.to_owned(),
            content,
            folder,
            scenario,
            robots,
        })
    }

    /// Another scenario with robots of the same makers.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn of_file(&self, file: &Path) -> Result<Self, LabError> {
        Self::load_with(file, &Changes::default(), self.robots.clone())
    }

    /// The content of the scenario file of a case.
    ///
    /// # Errors
    /// If the file has no place for a change.
    pub fn content_of(&self, case: &FaultCase) -> Result<toml::Table, LabError> {
        let changes = case.changes(&self.content, self.scenario.tick_s);
        let mut content = self.content.clone();
        for change in changes.map_err(LabError::refused)? {
            content = change.apply(content).map_err(LabError::refused)?;
        }
        Ok(content)
    }

    /// The scenario of a case.
    ///
    /// # Errors
    /// If it is not a scenario: bodies overlap, or a robot is missing that something else names.
    fn scenario_of(&self, case: &FaultCase) -> Result<Scenario, LabError> {
        let source = Source {
            name: format!("{} (with the faults of a plan)", self.file.display()),
            text: toml::to_string(&self.content_of(case)?).map_err(LabError::failed)?,
        };
        Ok(Scenario::parse(&source, &self.folder)?)
    }

    /// Plays a scenario in this process. Returns why it has not come to its end, if it has not.
    fn play_here(
        &self,
        scenario: Scenario,
        robots: &dyn RunRobots,
        wanted: &BTreeSet<String>,
        notes: &mut TrialNotes,
    ) -> Result<Option<String>, LabError> {
        let run = RunName::unknown();
        let make = |name: &_, class: &_| robots.make(name, class);
        let made = make_robots_with(&scenario, &self.file, &make)?;
        let mut local = Local::with_robots(scenario, 1, &run, made)?;
        let gone = catch_unwind(AssertUnwindSafe(|| {
            go(&mut local, &run, robots, wanted, notes)
        }));
        Ok(match gone {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(error.to_string()),
            Err(_) => Some("a robot panicked".to_owned()),
        })
    }
}

/// Plays a run in this process until a wanted expectation fails, or to its end.
fn go(
    local: &mut Local,
    run: &RunName,
    robots: &dyn RunRobots,
    wanted: &BTreeSet<String>,
    notes: &mut TrialNotes,
) -> Result<(), LabError> {
    let record = local.simulation.init(&mut local.robots)?;
    notes.note(record.tick, &record.events);
    while !local.simulation.is_over() {
        if notes.has_failed(wanted) {
            return Ok(());
        }
        local.carry_out_faults_with(run, &|name, class| robots.make(name, class))?;
        let record = local.simulation.step(&mut local.robots)?;
        notes.note(record.tick, &record.events);
    }

    let end = local.simulation.end(End::Finished);
    notes.note(end.tick, &end.events);
    Ok(())
}

/// Plays a scenario by processes. Returns why it has not come to its end, if it has not.
fn play_by_processes(
    scenario: Scenario,
    launches: &Launches,
    launch: Option<&LaunchText>,
    wanted: &BTreeSet<String>,
    notes: &mut TrialNotes,
) -> Result<Option<String>, LabError> {
    // What cannot be set up says nothing against the robots.
    Simulation::new(scenario.clone(), 1).map_err(LabError::refused)?;
    let mut notes = NotesUntilFailure { notes, wanted };
    let played = launches.follow(scenario, launch, &mut notes);
    let is_over = notes.notes.has_failed(wanted);
    Ok(played.err().filter(|_| !is_over).map(|error| {
        let text = error.to_string();
        let mut lines = text.lines().rev().map(str::trim);
        let last = lines.find(|line| !line.is_empty());
        last.unwrap_or("the launch failed").to_owned()
    }))
}

/// Notes on a recorded run, as far as it is played in this process.
struct NotesUntilFailure<'a> {
    notes: &'a mut TrialNotes,
    wanted: &'a BTreeSet<String>,
}

impl Follow for NotesUntilFailure<'_> {
    fn observe(&mut self, observation: &Observation<'_>) {
        let is_aborted = observation
            .events
            .iter()
            .any(|event| matches!(event, Event::End { reason, .. } if *reason != End::Finished));
        if !is_aborted && !self.notes.has_failed(self.wanted) {
            self.notes.note(observation.tick, observation.events);
        }
    }
}

/// Checks that robots can be made in this process.
fn check_made(scenario: &Scenario, file: &Path, robots: &dyn RunRobots) -> Result<(), LabError> {
    let made = make_robots_with(scenario, file, &|name, class| robots.make(name, class));
    match (made, robots.failure()) {
        (Ok(_), _) => Ok(()),
        (Err(_), Some(reason)) => Err(LabError::refused(reason)),
        (Err(error), None) => Err(error),
    }
}

impl Trial for Subject {
    fn play(&self, case: &FaultCase, wanted: &BTreeSet<String>) -> Result<TrialResult, LabError> {
        let scenario = self.scenario_of(case)?;
        let mut notes = TrialNotes::default();
        notes.played.expectations.insert(RUNS.to_owned());
        for expectation in &scenario.expectations {
            let name = expectation.name.clone();
            notes.played.expectations.insert(name);
        }
        for fault in &case.faults {
            let kind = fault.kind();
            notes.played.features.insert(Feature::Fault { kind });
        }

        // A robot that panics or ends the run is what a hunt looks for.
        let played = match &self.robots {
            HuntRobots::InProcess(source) => {
                self.play_here(scenario, source.begin().as_ref(), wanted, &mut notes)?
            }
            HuntRobots::Processes(launches, launch) => {
                play_by_processes(scenario, launches, launch.as_ref(), wanted, &mut notes)?
            }
        };
        let Some(because) = played else {
            return Ok(notes.finish());
        };
        let failure = FailedExpectation {
            tick: notes.played.ticks + 1,
            because,
        };
        notes.played.failed.insert(RUNS.to_owned(), failure);
        Ok(notes.finish())
    }
}

/// Notes on a run in progress.
#[derive(Default)]
struct TrialNotes {
    played: TrialResult,
    timeline: Timeline,
    counts: Counts,
    /// Commands between robots.
    commands: Vec<CommandSpan>,
}

impl TrialNotes {
    fn has_failed(&self, wanted: &BTreeSet<String>) -> bool {
        let mut failed = self.played.failed.keys();
        failed.any(|name| wanted.contains(name))
    }

    fn note(&mut self, tick: Tick, events: &[Event]) {
        self.played.ticks = tick;
        for event in events {
            self.counts.add(event);
            if let Event::Judged {
                expectation,
                verdict,
                because,
            } = event
            {
                self.note_verdict(tick, expectation, *verdict, because);
            }
        }
        for span in self.timeline.tick(tick, events) {
            self.note_span(span);
        }
    }

    fn note_verdict(&mut self, tick: Tick, expectation: &str, verdict: Verdict, because: &str) {
        let expectation = expectation.to_owned();
        match verdict {
            Verdict::NotAsked => _ = self.played.not_asked.insert(expectation),
            Verdict::Fail => {
                let because = because.to_owned();
                let failed = self.played.failed.entry(expectation);
                failed.or_insert(FailedExpectation { tick, because });
            }
            Verdict::Pass | Verdict::Undecided | Verdict::Unreached => {}
        }
    }

    fn note_span(&mut self, span: Span) {
        match span {
            Span::Command(command) if !command.from.is_operator() => self.commands.push(command),
            Span::QueriesLost(lost) => {
                let link = link(lost.from, lost.to);
                self.played.features.insert(Feature::QueryLost { link });
            }
            _ => {}
        }
    }

    /// What came of the run, with what is in progress at its end.
    fn finish(mut self) -> TrialResult {
        for span in self.timeline.in_progress() {
            self.note_span(span);
        }
        for (robot, counts) in &self.counts.robots {
            for kind in [StateKind::Emotion, StateKind::Behavior] {
                let transitions = counts.states(kind).transitions.keys();
                let features = transitions.map(|change| transition(robot, kind, change));
                self.played.features.extend(features);
            }
        }

        let mut numbers: BTreeMap<Link, u64> = BTreeMap::new();
        let mut commands = self.commands;
        commands.sort_by(|a, b| (a.sent, &a.from, a.seq).cmp(&(b.sent, &b.from, b.seq)));
        for command in commands {
            let fates = fates(&command);
            let is_lost = command.is_lost();
            let link = link(command.from, command.to);
            let number = numbers.entry(link.clone()).or_default();
            *number += 1;

            for fate in fates {
                self.played.features.insert(Feature::Message {
                    link: link.clone(),
                    text: command.text.clone(),
                    fate,
                });
            }
            self.played.sent.push(SentMessage {
                tick: command.sent,
                link,
                number: *number,
                text: command.text,
                is_lost,
            });
        }
        self.played
    }
}

fn transition(robot: &RobotName, kind: StateKind, (from, to): &(String, String)) -> Feature {
    let robot = robot.clone();
    let from = from.clone();
    let to = to.clone();
    match kind {
        StateKind::Emotion => Feature::Emotion { robot, from, to },
        StateKind::Behavior => Feature::Behavior { robot, from, to },
    }
}

/// What became of a command and its copies so far.
fn fates(command: &CommandSpan) -> Vec<CommandFate> {
    let mut fates = Vec::new();
    fates.extend(command.until.map(|_| CommandFate::Delayed));
    fates.extend(command.is_doubled.then_some(CommandFate::Duplicated));
    for end in &command.ends {
        fates.push(
            end.lost
                .map_or(CommandFate::Delivered, CommandFate::Dropped),
        );
    }
    fates
}

fn link(from: RobotName, to: RobotName) -> Link {
    Link { from, to }
}

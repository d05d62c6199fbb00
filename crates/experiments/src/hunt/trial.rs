//! Playing cases: what is asked of a run, and what came of it.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use config::{Changes, Source};
use protocol::messages::{End, Verdict};
use protocol::{Event, RobotName, RunName, Tick};
use robot::Robot;
use scenario::Scenario;
use simulator::TickRecord;
use timeline::{CommandSpan, Counts, Span, StateKind, Timeline};

use super::case::FaultCase;
use super::coverage::{CommandFate, Feature};
use super::fault::Link;
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

/// Makes a robot of a class; `None` if it makes no robots of that class.
pub type Maker = fn(&str) -> Option<Box<dyn Robot>>;

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
    maker: Maker,
}

impl Subject {
    /// Reads a scenario with the robots that ship with the project.
    ///
    /// # Errors
    /// If the scenario cannot be used, or cannot be played in one process.
    pub fn load(file: &Path, changes: &Changes) -> Result<Self, LabError> {
        Self::load_by(file, changes, robots::make)
    }

    /// Reads a scenario whose robots `maker` makes by their classes.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_by(file: &Path, changes: &Changes, maker: Maker) -> Result<Self, LabError> {
        // Errors show the lines of the file.
        Scenario::load(file, changes)?;

        let source = changes.apply(&Source::read(file)?)?;
        let folder = file.parent().unwrap_or(Path::new(".")).to_owned();
        let scenario = Scenario::parse(&source, &folder)?;

        check_faults(&scenario, 0)?;
        make_robots_with(&scenario, file, &|_, class| maker(class))?;

        // The file of a finding depends on no run.
        let mut content = source.parse()?;
        scenario::carry_moods_over(&mut content)?;
        Ok(Self {
            file: file.to_owned(),
            content,
            folder,
            scenario,
            maker,
        })
    }

    /// Another scenario with robots of the same makers.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn of_file(&self, file: &Path) -> Result<Self, LabError> {
        Self::load_by(file, &Changes::default(), self.maker)
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

    fn go(
        &self,
        local: &mut Local,
        run: &RunName,
        wanted: &BTreeSet<String>,
        notes: &mut TrialNotes,
    ) -> Result<(), LabError> {
        let record = local.simulation.init(&mut local.robots)?;
        notes.note(&record);
        while local.simulation.tick() < local.simulation.scenario().ticks {
            if notes.has_failed(wanted) {
                return Ok(());
            }
            local.carry_out_faults_with(run, &|_, class| (self.maker)(class))?;
            let record = local.simulation.step(&mut local.robots)?;
            notes.note(&record);
        }

        notes.note(&local.simulation.end(End::Finished));
        Ok(())
    }
}

impl Trial for Subject {
    fn play(&self, case: &FaultCase, wanted: &BTreeSet<String>) -> Result<TrialResult, LabError> {
        let scenario = self.scenario_of(case)?;
        let run = RunName::unknown();
        let robots = make_robots_with(&scenario, &self.file, &|_, class| (self.maker)(class))?;
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
        let mut local = Local::with_robots(scenario, 1, &run, robots)?;
        let gone = catch_unwind(AssertUnwindSafe(|| {
            self.go(&mut local, &run, wanted, &mut notes)
        }));
        let because = match gone {
            Ok(Ok(())) => return Ok(notes.finish()),
            Ok(Err(error)) => error.to_string(),
            Err(_) => "a robot panicked".to_owned(),
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

    fn note(&mut self, record: &TickRecord) {
        self.played.ticks = record.tick;
        for event in record.events.iter() {
            self.counts.add(event);
            if let Event::Judged {
                expectation,
                verdict,
                because,
            } = event
            {
                self.note_verdict(record.tick, expectation, *verdict, because);
            }
        }
        for span in self.timeline.tick(record.tick, &record.events) {
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
            Verdict::Pass | Verdict::Undecided => {}
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

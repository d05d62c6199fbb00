//! Playing cases: what is asked of a run, and what came of it.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use config::{Changes, Source};
use miette::{IntoDiagnostic, miette};
use protocol::messages::{End, Verdict};
use protocol::{Event, RobotName, RunName, Seq, Tick};
use robot::Robot;
use scenario::Scenario;
use simulator::TickRecord;

use super::case::Case;
use super::coverage::{Fate, Feature};
use super::fault::Link;
use crate::run::{Local, check_faults, make_robots_with};

/// What is expected of every run beside the expectations of its scenario.
pub const RUNS: &str = "the run goes to its end";

/// What came of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Played {
    /// The expectations that failed.
    pub failed: BTreeMap<String, Failure>,
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
pub struct Failure {
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
    fn play(&self, case: &Case, wanted: &BTreeSet<String>) -> miette::Result<Played>;
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
    pub fn load(file: &Path, changes: &Changes) -> miette::Result<Self> {
        Self::load_by(file, changes, robots::make)
    }

    /// Reads a scenario whose robots `maker` makes by their classes.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_by(file: &Path, changes: &Changes, maker: Maker) -> miette::Result<Self> {
        // Errors show the lines of the file.
        Scenario::load(file, changes)?;

        let source = changes.apply(&Source::read(file)?)?;
        let folder = file.parent().unwrap_or(Path::new(".")).to_owned();
        let scenario = Scenario::parse(&source, &folder)?;

        check_faults(&scenario, 0)?;
        make_robots_with(&scenario, file, &|_, class| maker(class))?;

        Ok(Self {
            file: file.to_owned(),
            content: source.parse()?,
            folder,
            scenario,
            maker,
        })
    }

    /// Another scenario with robots of the same makers.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn of_file(&self, file: &Path) -> miette::Result<Self> {
        Self::load_by(file, &Changes::default(), self.maker)
    }

    /// The content of the scenario file of a case.
    ///
    /// # Errors
    /// If the file has no place for a change.
    pub fn content_of(&self, case: &Case) -> miette::Result<toml::Table> {
        let changes = case.changes(&self.content, self.scenario.tick_s);
        let mut content = self.content.clone();
        for change in changes.map_err(|reason| miette!("{reason}"))? {
            content = change
                .apply(content)
                .map_err(|reason| miette!("{reason}"))?;
        }
        Ok(content)
    }

    /// The scenario of a case.
    ///
    /// # Errors
    /// If it is not a scenario: bodies overlap, or a robot is missing that something else names.
    fn scenario_of(&self, case: &Case) -> miette::Result<Scenario> {
        let source = Source {
            name: format!("{} (with the faults of a plan)", self.file.display()),
            text: toml::to_string(&self.content_of(case)?).into_diagnostic()?,
        };
        Ok(Scenario::parse(&source, &self.folder)?)
    }

    fn go(
        &self,
        local: &mut Local,
        run: &RunName,
        wanted: &BTreeSet<String>,
        notes: &mut Notes,
    ) -> miette::Result<()> {
        let record = local.simulation.init(&mut local.robots).into_diagnostic()?;
        notes.note(&record);
        while local.simulation.tick() < local.simulation.scenario().ticks {
            if notes.has_failed(wanted) {
                return Ok(());
            }
            local.carry_out_faults_with(run, &|_, class| (self.maker)(class))?;
            let record = local.simulation.step(&mut local.robots).into_diagnostic()?;
            notes.note(&record);
        }

        notes.note(&local.simulation.end(End::Finished));
        Ok(())
    }
}

impl Trial for Subject {
    fn play(&self, case: &Case, wanted: &BTreeSet<String>) -> miette::Result<Played> {
        let scenario = self.scenario_of(case)?;
        let run = RunName::new("hunt").into_diagnostic()?;
        let robots = make_robots_with(&scenario, &self.file, &|_, class| (self.maker)(class))?;
        let mut notes = Notes::default();
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
            Ok(Ok(())) => return Ok(notes.played),
            Ok(Err(error)) => error.to_string(),
            Err(_) => "a robot panicked".to_owned(),
        };
        let failure = Failure {
            tick: notes.played.ticks + 1,
            because,
        };
        notes.played.failed.insert(RUNS.to_owned(), failure);
        Ok(notes.played)
    }
}

/// Notes on a run in progress.
#[derive(Default)]
struct Notes {
    played: Played,
    /// Number of commands on each link.
    counts: BTreeMap<Link, u64>,
    /// Places of the commands in the list of those sent, by sender and number in the record.
    places: BTreeMap<(RobotName, Seq), usize>,
}

impl Notes {
    fn has_failed(&self, wanted: &BTreeSet<String>) -> bool {
        let mut failed = self.played.failed.keys();
        failed.any(|name| wanted.contains(name))
    }

    fn note(&mut self, record: &TickRecord) {
        self.played.ticks = record.tick;
        for event in record.events.iter() {
            self.note_event(record.tick, event);
        }
    }

    fn note_event(&mut self, tick: Tick, event: &Event) {
        match event {
            Event::CommandSent {
                from,
                to,
                seq,
                command,
                ..
            } if !from.is_operator() => {
                let link = link(from, to);
                let count = self.counts.entry(link.clone()).or_default();
                *count += 1;

                let place = self.played.sent.len();
                self.places.insert((from.clone(), *seq), place);
                self.played.sent.push(SentMessage {
                    tick,
                    link,
                    number: *count,
                    text: command.clone(),
                    is_lost: false,
                });
            }
            Event::CommandDelivered { from, seq, .. } => {
                self.note_fate(from, *seq, Fate::Delivered);
            }
            Event::CommandDelayed { from, seq, .. } => self.note_fate(from, *seq, Fate::Delayed),
            Event::CommandDuplicated { from, seq, .. } => {
                self.note_fate(from, *seq, Fate::Duplicated);
            }
            Event::CommandDropped {
                from, seq, because, ..
            } => self.note_fate(from, *seq, Fate::Dropped(*because)),
            Event::QueryLost { from, to, .. } => {
                let link = link(from, to);
                self.played.features.insert(Feature::QueryLost { link });
            }
            Event::Behavior {
                robot,
                from: Some(from),
                to,
            } => {
                self.played.features.insert(Feature::Behavior {
                    robot: robot.clone(),
                    from: from.clone(),
                    to: to.clone(),
                });
            }
            Event::Emotion {
                robot,
                from: Some(from),
                to,
            } => {
                self.played.features.insert(Feature::Emotion {
                    robot: robot.clone(),
                    from: from.clone(),
                    to: to.clone(),
                });
            }
            Event::Judged {
                expectation,
                verdict: Verdict::NotAsked,
                ..
            } => {
                self.played.not_asked.insert(expectation.clone());
            }
            Event::Judged {
                expectation,
                verdict: Verdict::Fail,
                because,
            } => {
                let failure = Failure {
                    tick,
                    because: because.clone(),
                };
                let failed = &mut self.played.failed;
                failed.entry(expectation.clone()).or_insert(failure);
            }
            _ => {}
        }
    }

    fn note_fate(&mut self, from: &RobotName, seq: Seq, fate: Fate) {
        let Some(place) = self.places.get(&(from.clone(), seq)) else {
            return;
        };

        let message = &mut self.played.sent[*place];
        message.is_lost |= matches!(fate, Fate::Dropped(_));
        self.played.features.insert(Feature::Message {
            link: message.link.clone(),
            text: message.text.clone(),
            fate,
        });
    }
}

fn link(from: &RobotName, to: &RobotName) -> Link {
    Link {
        from: from.clone(),
        to: to.clone(),
    }
}

//! Playing cases: what is asked of a run, and what came of it. A run in this process can be copied at a tick, and go on from there
//! as another case that is the same up to it.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use config::{Changes, Source};
use environment::Simulation;
use experiments::{ByClass, Follow, LaunchText, Launches, RobotSource, RunRobots};
use lab::LabError;
use lab::run::{Local, check_faults, make_robots_with};
use observe::Observation;
use protocol::messages::{End, Verdict};
use protocol::{Event, RobotName, RunName, Tick};
use scenario::Scenario;
use timeline::{CommandSpan, ExpectationSpan, Span, Timeline};

use super::case::FaultCase;
use super::coverage::{CommandFate, Feature};
use super::sent::{Link, SentMessage};

/// What is expected of every run beside the expectations of its scenario.
pub const RUNS: &str = "the run goes to its end";

/// Most copies of one run.
const MAX_COPIES: usize = 8;

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
    /// What happened, with the tick in which it was seen first.
    pub features: BTreeMap<Feature, Tick>,
}

impl TrialResult {
    /// Whether the run has reached a goal.
    pub(super) fn has_reached(&self, goal: &str) -> bool {
        let expectation = goal.to_owned();
        self.features
            .contains_key(&Feature::Reached { expectation })
    }
}

/// An expectation that failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailedExpectation {
    /// The tick in which that was certain.
    pub tick: Tick,
    /// Why.
    pub because: String,
}

/// A case, and the run that it goes on from.
#[derive(Debug, Clone, Default)]
pub(super) struct TrialPlan {
    /// The case.
    pub(super) case: FaultCase,
    /// The tick up to which it is the same as the run from which it goes on; 0 for a plan that was drawn anew.
    pub(super) after: Tick,
    /// That run at that tick. Without it the case is played from its beginning, with the same result.
    pub(super) saved: Option<Arc<SavedRun>>,
}

/// What came of a plan.
#[derive(Debug)]
pub(super) struct PlayedPlan {
    /// What came of its run.
    pub(super) result: TrialResult,
    /// Copies of the run, by the tick in which it was in a new state.
    pub(super) saved: BTreeMap<Tick, Arc<SavedRun>>,
}

/// A run in this process after a tick.
pub(super) struct SavedRun {
    /// A lock, because robots need not be usable by several threads at a time.
    local: Mutex<Local>,
    notes: TrialNotes,
}

impl std::fmt::Debug for SavedRun {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "SavedRun {{ tick: {} }}", self.notes.played.ticks)
    }
}

/// Copies of a run where it is in a new state.
struct Copies<'a> {
    is_new: &'a (dyn Fn(&Feature) -> bool + Sync),
    saved: BTreeMap<Tick, Arc<SavedRun>>,
    /// Whether a robot cannot be copied, or there are enough.
    is_over: bool,
}

impl Copies<'_> {
    /// Copies the run if it was the first to reach something in the last tick.
    fn note(&mut self, local: &Local, notes: &TrialNotes) {
        if self.is_over || !notes.seen.iter().any(self.is_new) {
            return;
        }
        match local.snapshot() {
            Ok(copy) => {
                let saved = SavedRun {
                    local: Mutex::new(copy),
                    notes: notes.clone(),
                };
                self.saved.insert(notes.played.ticks, Arc::new(saved));
                self.is_over = self.saved.len() >= MAX_COPIES;
            }
            Err(_) => self.is_over = true,
        }
    }
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

    /// Plays a plan until one of the `wanted` expectations fails, or to its end. Where it reaches something that `is_new`, it is
    /// copied, so that others can go on from there.
    ///
    /// # Errors
    /// If it cannot be played.
    pub(super) fn play_plan(
        &self,
        plan: &TrialPlan,
        wanted: &BTreeSet<String>,
        is_new: &(dyn Fn(&Feature) -> bool + Sync),
    ) -> Result<PlayedPlan, LabError> {
        let scenario = self.scenario_of(&plan.case)?;
        let mut copies = Copies {
            is_new,
            saved: BTreeMap::new(),
            is_over: false,
        };
        let mut notes = TrialNotes::new(&scenario);

        // A robot that panics or ends the run is what a hunt looks for.
        let played = match &self.robots {
            HuntRobots::InProcess(source) => {
                // With the run, what was noted of it is copied: a feature or a failure of before is part of the result.
                let saved = plan.saved.as_deref();
                if let Some(saved) = saved {
                    notes = saved.notes.clone();
                }
                let robots = source.begin();
                let mut local = self.local(scenario, robots.as_ref(), saved)?;
                let is_begun = saved.is_some();
                // After a panic the run is thrown away; the notes are changed only between two steps of it, so they are whole.
                let run = AssertUnwindSafe(|| {
                    play_here(
                        &mut local,
                        is_begun,
                        robots.as_ref(),
                        wanted,
                        &mut notes,
                        &mut copies,
                    )
                });
                match catch_unwind(run) {
                    Ok(Ok(())) => None,
                    Ok(Err(error)) => Some(error.to_string()),
                    Err(_) => Some("a robot panicked".to_owned()),
                }
            }
            HuntRobots::Processes(launches, launch) => {
                play_by_processes(scenario, launches, launch.as_ref(), wanted, &mut notes)?
            }
        };
        if let Some(because) = played {
            // In the tick after the last one that was noted.
            let tick = notes.played.ticks + 1;
            let failure = FailedExpectation { tick, because };
            notes.played.failed.insert(RUNS.to_owned(), failure);
        }

        let mut result = notes.finish();
        for fault in &plan.case.faults {
            let kind = fault.kind();
            result.features.insert(Feature::Fault { kind }, 0);
        }
        Ok(PlayedPlan {
            result,
            saved: copies.saved,
        })
    }

    /// A run of a scenario in this process: before its tick 0, or where a run is that was the same up to there.
    fn local(
        &self,
        scenario: Scenario,
        robots: &dyn RunRobots,
        saved: Option<&SavedRun>,
    ) -> Result<Local, LabError> {
        if let Some(saved) = saved {
            let copied = saved
                .local
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .snapshot();
            let mut local = copied.map_err(|robot| {
                LabError::failed(format!("{robot} could be copied once, and not again"))
            })?;
            local.go_on_as(scenario);
            return Ok(local);
        }

        let make = |name: &_, class: &_| robots.make(name, class);
        let made = make_robots_with(&scenario, &self.file, &make)?;
        Local::with_robots(scenario, 1, &RunName::unknown(), made)
    }
}

/// Plays a run in this process until a wanted expectation fails, or to its end.
fn play_here(
    local: &mut Local,
    is_begun: bool,
    robots: &dyn RunRobots,
    wanted: &BTreeSet<String>,
    notes: &mut TrialNotes,
    copies: &mut Copies<'_>,
) -> Result<(), LabError> {
    let run = RunName::unknown();

    if !is_begun {
        let record = local.simulation.init(&mut local.robots)?;
        notes.note(record.tick, &record.events);
        copies.note(local, notes);
    }

    while !local.simulation.is_over() {
        // Before the step: a copy that goes on may have failed already.
        if notes.has_failed(wanted) {
            return Ok(());
        }
        local.carry_out_faults_with(&run, &|name, class| robots.make(name, class))?;
        let record = local.simulation.step(&mut local.robots)?;
        notes.note(record.tick, &record.events);
        copies.note(local, notes);
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
    // A failed expectation is noted already: that the launch then ends with an error adds nothing.
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
        let plan = TrialPlan {
            case: case.clone(),
            ..TrialPlan::default()
        };
        Ok(self.play_plan(&plan, wanted, &|_| false)?.result)
    }
}

/// Notes on a run in progress.
#[derive(Debug, Clone, Default)]
struct TrialNotes {
    played: TrialResult,
    timeline: Timeline,
    /// Commands between robots.
    commands: Vec<CommandSpan>,
    /// Expectations that are goals.
    goals: BTreeSet<String>,
    /// What was seen for the first time in the last tick.
    seen: Vec<Feature>,
}

impl TrialNotes {
    fn new(scenario: &Scenario) -> Self {
        let mut notes = Self::default();
        notes.played.expectations.insert(RUNS.to_owned());
        for expectation in &scenario.expectations {
            let name = expectation.name.clone();
            if expectation.is_goal() {
                notes.goals.insert(name.clone());
            }
            notes.played.expectations.insert(name);
        }
        notes
    }

    fn has_failed(&self, wanted: &BTreeSet<String>) -> bool {
        let mut failed = self.played.failed.keys();
        failed.any(|name| wanted.contains(name))
    }

    fn note(&mut self, tick: Tick, events: &[Event]) {
        self.played.ticks = tick;
        self.seen.clear();
        for event in events {
            if let Some(transition) = Feature::transition(event) {
                self.see(tick, transition);
            }
        }
        for span in self.timeline.tick(tick, events) {
            self.note_span(tick, span);
        }
    }

    fn see(&mut self, tick: Tick, feature: Feature) {
        if !self.played.features.contains_key(&feature) {
            self.seen.push(feature.clone());
            self.played.features.insert(feature, tick);
        }
    }

    fn note_verdict(&mut self, judged: ExpectationSpan) {
        let ExpectationSpan {
            tick,
            expectation,
            verdict,
            because,
        } = judged;

        match verdict {
            Verdict::NotAsked => _ = self.played.not_asked.insert(expectation),
            Verdict::Fail => {
                // The first failure counts: to it the run is shortened.
                let failed = self.played.failed.entry(expectation);
                failed.or_insert(FailedExpectation { tick, because });
            }
            Verdict::Pass if self.goals.contains(&expectation) => {
                self.see(tick, Feature::Reached { expectation });
            }
            Verdict::Pass | Verdict::Undecided | Verdict::Unreached => {}
        }
    }

    fn note_span(&mut self, tick: Tick, span: Span) {
        match span {
            Span::Command(command) => self.note_command(tick, command),
            Span::QueriesLost(lost) => {
                let link = link(&lost.from, &lost.to);
                self.see(tick, Feature::QueryLost { link });
            }
            Span::Judged(judged) => self.note_verdict(judged),
            // Transitions are features, and not how long a robot stays. What the plan or the scenario does by itself is none.
            Span::Stay(_)
            | Span::Absence(_)
            | Span::Missed(_)
            | Span::Fault(_)
            | Span::Cut(_)
            | Span::Guest(_)
            | Span::Joined(_)
            | Span::Change(_) => {}
        }
    }

    fn note_command(&mut self, tick: Tick, command: CommandSpan) {
        if command.from.is_operator() {
            return;
        }

        for fate in fates(&command) {
            let feature = Feature::Message {
                link: link(&command.from, &command.to),
                text: command.text.clone(),
                fate,
            };
            self.see(tick, feature);
        }
        self.commands.push(command);
    }

    /// What came of the run, with what is in progress at its end.
    fn finish(mut self) -> TrialResult {
        let last = self.played.ticks;
        for span in self.timeline.in_progress() {
            self.note_span(last, span);
        }

        // Spans come when they end. Commands are numbered in the order in which they were sent, as a scenario names them.
        let mut numbers: BTreeMap<Link, u64> = BTreeMap::new();
        let mut commands = self.commands;
        commands.sort_by(|a, b| (a.sent, &a.from, a.seq).cmp(&(b.sent, &b.from, b.seq)));
        for command in commands {
            let link = link(&command.from, &command.to);
            let number = numbers.entry(link.clone()).or_default();
            *number += 1;
            self.played.sent.push(SentMessage {
                tick: command.sent,
                link,
                number: *number,
                is_lost: command.is_lost(),
                late: command.until.map_or(0, |until| until - command.sent - 1),
                is_doubled: command.is_doubled,
                text: command.text,
            });
        }
        self.played
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

fn link(from: &RobotName, to: &RobotName) -> Link {
    Link {
        from: from.clone(),
        to: to.clone(),
    }
}

#[cfg(test)]
mod tests {
    use protocol::random::stream;

    use super::*;
    use crate::draw::Ground;
    use crate::fault::FaultClass;
    use crate::sent::Onset;

    fn hall() -> Subject {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/hors_doeuvres.toml");
        let set = ["duration=90 s", "network.commands.loss=0.1"];
        let changes = Changes {
            set: set.iter().map(|one| one.parse().unwrap()).collect(),
            ..Changes::default()
        };
        Subject::load(&file, &changes).unwrap()
    }

    /// A plan that goes on from a copy of another run has the same result as one that is played from its beginning, and its copies
    /// are made in the same ticks: whatever faults the two have.
    #[test]
    fn a_copy_goes_on_as_a_run_from_the_beginning() {
        let subject = hall();
        let wanted = BTreeSet::new();
        let without = TrialPlan::default();
        let baseline = subject.play_plan(&without, &wanted, &|_| false).unwrap();
        let ground = Ground::new(&subject.scenario, &baseline.result, &FaultClass::ALL, 30.0);

        let mut gone_on = 0;
        for number in 0..24 {
            let mut chance = stream(1, &format!("test/{number}"));
            let plan = TrialPlan {
                case: FaultCase::of(ground.draw(&mut chance)),
                ..TrialPlan::default()
            };
            // Bodies of a plan may not fit.
            let Ok(played) = subject.play_plan(&plan, &wanted, &Feature::is_state) else {
                continue;
            };
            for (after, saved) in played.saved.into_iter().filter(|(after, _)| *after > 0) {
                let sent = &played.result.sent;
                let mut faults = plan.case.faults.clone();
                faults.retain(|fault| fault.has_begun(after, sent));
                let onset = Onset::of(sent, after);
                let case = FaultCase::of(ground.go_on(&faults, &onset, &mut chance));
                let [copied, whole] = [Some(saved), None].map(|saved| {
                    let plan = TrialPlan {
                        case: case.clone(),
                        after,
                        saved,
                    };
                    let played = subject.play_plan(&plan, &wanted, &Feature::is_state);
                    played.unwrap()
                });
                assert_eq!(copied.result, whole.result, "after {after}: {case:?}");
                gone_on += 1;
            }
        }
        assert!(gone_on > 50, "{gone_on}");
    }
}

//! Verification: a recorded epoch is executed again from its scenario and compared with its record, tick by tick.
//!
//! What depended on real time is taken from the record: the operator's commands, the ticks that a robot missed, and when it
//! returned. A robot whose state cannot be known (its class is not one of this process, or it went on after a tick that it had
//! missed) is not executed: what it reported then is taken from the record, too.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use config::{Changes, FileError};
use lockstep::{Exchange, Membership, Outcome};
use miette::{IntoDiagnostic, miette};
use protocol::messages::{CommandText, News, Report};
use protocol::{Event, RobotName, RunName, Tick};
use robot::{Action, BadParameters, Cars, LocalHost, Robot, RobotError};
use simulator::difference::{Difference, between};
use simulator::record::{Entry, Record};
use simulator::recorder::{EVENTS, SUMMARY};
use simulator::{EpochFiles, Scenario, TickRecord, seal};

use crate::run::Local;

/// What came of a verification.
#[derive(Debug)]
pub struct Verification {
    /// The last tick that was compared.
    pub ticks: Tick,
    /// Whether the record has the end of the run.
    pub has_end: bool,
    /// Digest of the run at that tick.
    pub digest: String,
    /// The last tick of which the record has the robots' reports, so that they were compared, too.
    pub reports_to: Option<Tick>,
    /// Robots that were not executed in some ticks, and the first of these.
    pub from_record: BTreeMap<RobotName, Tick>,
    /// The first difference: recorded, then executed again.
    pub difference: Option<Difference>,
}

/// Executes an epoch again and compares.
///
/// # Errors
/// If the record cannot be read or is damaged where nothing differs, the scenario cannot be set up, or a robot is to be taken
/// from the record and the record has no reports.
pub fn verify(files: &EpochFiles) -> miette::Result<Verification> {
    let mut record = Record::open(files)?;
    let scenario = Scenario::load(&files.scenario, &Changes::default())?;
    let has_recording = scenario.record.frames;
    check_scenario(files, &record)?;
    let mut again = Reexecution::new(scenario, files)?;
    let mut verification = Verification {
        ticks: 0,
        has_end: false,
        digest: String::new(),
        reports_to: None,
        from_record: BTreeMap::new(),
        difference: None,
    };

    let mut next = record.next_entry()?;
    if next.is_none() {
        let events = files.events.display();
        return Err(miette!("{events} has no complete tick"));
    }
    while let Some(recorded) = next {
        let executed = again.play(&recorded)?;
        verification.difference = between(&recorded, &executed);
        if verification.difference.is_some() {
            break;
        }
        verification.ticks = recorded.tick;
        verification.has_end = recorded.is_end();
        if recorded.reports.is_some() {
            verification.reports_to = Some(recorded.tick);
        }
        next = record.next_entry()?;
    }

    verification.digest = again.local.simulation.digest();
    verification.from_record = again.from_record;
    if verification.difference.is_none() {
        // What nothing depends on may be damaged, too.
        seal::check(&files.events)?;
        check_end(files, &record, &verification, has_recording)?;
    }
    Ok(verification)
}

/// Checks that the scenario beside the record is the one that the recording contains.
fn check_scenario(files: &EpochFiles, record: &Record) -> miette::Result<()> {
    let Some(recording) = record.recording() else {
        return Ok(());
    };

    let recorded = recording.scenario().into_diagnostic()?;
    let scenario = std::fs::read_to_string(&files.scenario)
        .map_err(|error| FileError::unreadable(&files.scenario, &error))?;
    if scenario != recorded {
        return Err(miette!(
            help =
                "the recording contains the scenario of the run, as the attachment scenario.toml",
            "{} was changed since the run",
            files.scenario.display()
        ));
    }
    Ok(())
}

/// Checks that the parts of the record end alike.
fn check_end(
    files: &EpochFiles,
    record: &Record,
    verification: &Verification,
    has_recording: bool,
) -> miette::Result<()> {
    let events = files.events.display();
    let recording = files.recording.display();
    let last = verification.ticks;

    let summary = files.events.with_file_name(SUMMARY);
    let is_last_epoch = files.events.file_name().is_some_and(|name| name == EVENTS);
    if !verification.has_end && is_last_epoch && summary.exists() {
        return Err(miette!(
            "{events} ends at tick {last} without an end of the run, and the run has ended: it has a summary"
        ));
    }
    match record.recording() {
        None if has_recording && verification.has_end => Err(miette!(
            "the run was recorded, and {recording} is not there"
        )),
        Some(file) if verification.has_end && (!file.is_finished() || file.len() != last + 1) => {
            Err(miette!(
                "{recording} is not whole: it has {} complete ticks, and the events go to the end at tick {last}",
                file.len()
            ))
        }
        Some(file) if file.len() > last + 1 => Err(miette!(
            "{events} ends at tick {last}, and {recording} has {} ticks",
            file.len()
        )),
        _ => Ok(()),
    }
}

/// An epoch that is executed again.
struct Reexecution {
    run: RunName,
    local: Local,
    /// What robots taken from the record do in the tick in progress.
    script: Script,
    /// Robots that are taken from the record.
    scripted: BTreeSet<RobotName>,
    /// Robots that do not take part.
    absent: BTreeSet<RobotName>,
    from_record: BTreeMap<RobotName, Tick>,
}

impl Reexecution {
    fn new(scenario: Scenario, files: &EpochFiles) -> miette::Result<Self> {
        // Robots learn the name of the run, and nothing of the record depends on it.
        let run = RunName::new("verify").into_diagnostic()?;
        let script = Script::default();
        let mut scripted = BTreeSet::new();
        let mut from_record = BTreeMap::new();
        let mut robots = BTreeMap::new();
        for (name, spec) in &scenario.robots {
            let robot = robots::make(&spec.class).unwrap_or_else(|| {
                scripted.insert(name.clone());
                from_record.insert(name.clone(), 0);
                script.robot()
            });
            robots.insert(name.clone(), robot);
        }

        Ok(Self {
            local: Local::with_robots(scenario, files.epoch, &run, robots)?,
            run,
            script,
            scripted,
            absent: BTreeSet::new(),
            from_record,
        })
    }

    /// Executes a tick that was recorded, or the end of the run.
    fn play(&mut self, recorded: &Entry) -> miette::Result<Entry> {
        if let Some(Event::End { reason, .. }) = recorded.events.last() {
            let record = self.local.simulation.end(*reason);
            return Ok(entry(record, None));
        }

        if recorded.tick > 0 {
            self.repeat_inputs(recorded);
        }
        self.repeat_membership(recorded);
        self.check_script(recorded)?;

        let mut reports = BTreeMap::new();
        let mut exchange = Repeated {
            robots: &mut self.local.robots,
            recorded,
            scripted: &self.scripted,
            reports: &mut reports,
        };
        let simulation = &mut self.local.simulation;
        let record = if recorded.tick == 0 {
            simulation.init(&mut exchange)
        } else {
            simulation.step(&mut exchange)
        };
        let record = record.into_diagnostic()?;
        Ok(entry(record, recorded.reports.is_some().then_some(reports)))
    }

    /// What the simulation was given between this tick and the one before: faults that were due, and the operator's commands.
    fn repeat_inputs(&mut self, recorded: &Entry) {
        let simulation = &mut self.local.simulation;
        let orders = simulation.faults_due();
        let lateness = simulation.scenario().lateness.clone();
        simulation.note_faults(&orders, |robot| lateness.of(robot));

        for sent in recorded.commands_of(&RobotName::operator()) {
            simulation.command(&sent.to, &sent.command.command);
        }
    }

    /// Lets robots go and come as they did.
    fn repeat_membership(&mut self, recorded: &Entry) {
        self.script.set(recorded);
        let names = self.local.simulation.names().to_vec();
        for name in &names {
            let is_missing = recorded.has_missed(name);
            let has_joined = recorded.has_joined(name);
            if is_missing || has_joined {
                self.local.robots.crash(name);
                self.absent.insert(name.clone());
            }
            if !is_missing && self.absent.remove(name) {
                self.bring_back(name, has_joined, recorded.tick);
            }
        }
    }

    /// Lets a robot take part again. Without having joined again it goes on from a state that the record does not have.
    fn bring_back(&mut self, name: &RobotName, has_joined: bool, tick: Tick) {
        let simulation = &self.local.simulation;
        let class = &simulation.scenario().robots[name].class;
        let robot = robots::make(class).filter(|_| has_joined);
        if robot.is_some() {
            self.scripted.remove(name);
        } else {
            self.scripted.insert(name.clone());
            self.from_record.entry(name.clone()).or_insert(tick);
        }

        let robot = robot.unwrap_or_else(|| self.script.robot());
        self.local.robots.bring_back(name, robot, |generation| {
            simulation.welcome(&self.run, name, generation, None)
        });
    }

    /// Checks that the record has what robots that are not executed have reported.
    fn check_script(&self, recorded: &Entry) -> miette::Result<()> {
        for name in &self.scripted {
            let report = recorded
                .reports
                .as_ref()
                .and_then(|reports| reports.get(name));
            if report.is_none() && !recorded.has_missed(name) {
                return Err(miette!(
                    help = "a run is recorded with reports unless its scenario has `frames = false` under [record]",
                    "{name} cannot be executed in this process, and the record has no report of it for tick {}",
                    recorded.tick
                ));
            }
        }
        Ok(())
    }
}

fn entry(record: TickRecord, reports: Option<BTreeMap<RobotName, Report>>) -> Entry {
    Entry {
        tick: record.tick,
        events: record.events,
        reports,
    }
}

/// The robots of this process, in the place of those that were recorded.
struct Repeated<'a> {
    robots: &'a mut LocalHost,
    recorded: &'a Entry,
    scripted: &'a BTreeSet<RobotName>,
    /// What the robots that are executed report.
    reports: &'a mut BTreeMap<RobotName, Report>,
}

impl Exchange<News, Arc<Report>, CommandText> for Repeated<'_> {
    type Error = RobotError;

    fn exchange(
        &mut self,
        tick: Tick,
        news: BTreeMap<RobotName, News>,
    ) -> Result<Outcome<Arc<Report>, CommandText>, RobotError> {
        let mut outcome = self.robots.exchange(tick, news)?;
        outcome.membership = self.membership(&outcome.membership);

        for (name, report) in self.recorded.reports.iter().flatten() {
            if self.scripted.contains(name) {
                let commands = self.recorded.commands_of(name);
                let report = Arc::new(report.clone());
                outcome.reports.insert(name.clone(), (report, commands));
            }
        }
        for (name, (report, _)) in &outcome.reports {
            self.reports.insert(name.clone(), report.as_ref().clone());
        }
        Ok(outcome)
    }
}

impl Repeated<'_> {
    /// The changes of membership that were recorded, with the generations of this process.
    fn membership(&self, executed: &[Membership]) -> Vec<Membership> {
        let mut membership = Vec::new();
        for event in &self.recorded.events {
            match event {
                Event::Lost { robot } => membership.push(Membership::Lost(robot.clone())),
                Event::Joined {
                    robot,
                    generation: Some(_),
                    ..
                } => membership.extend(executed.iter().find(|change| {
                    matches!(change, Membership::Joined(joined, _) if joined == robot)
                }).cloned()),
                _ => {}
            }
        }
        membership
    }
}

/// What robots that are not executed reported for the tick in progress.
#[derive(Clone, Default)]
struct Script(Arc<Mutex<BTreeMap<RobotName, Report>>>);

impl Script {
    fn set(&self, recorded: &Entry) {
        let reports = recorded.reports.clone().unwrap_or_default();
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = reports;
    }

    /// A robot that does what is recorded of it. It sends no commands: they are taken from the record where they count.
    fn robot(&self) -> Box<dyn Robot> {
        Box::new(Scripted(self.clone()))
    }
}

/// A robot that publishes what is recorded of it, for the robots that query it.
struct Scripted(Script);

impl Robot for Scripted {
    fn init(&mut self, _cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let reports = self.0.0.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(report) = reports.get(cars.name()) else {
            return Action::stay(cars);
        };

        Action {
            proposal: report.proposal,
            speed_mps: report.speed_mps,
            direction_rad: report.direction_rad,
            emotion_state: report.emotion_state.clone(),
            behavior_state: report.behavior_state.clone(),
            state_variables: report.state_variables.clone(),
        }
    }
}

//! An epoch that is executed again from its scenario and its record, tick by tick.
//!
//! What depended on real time is taken from the record: the operator's commands, the ticks that a robot missed, and when it
//! returned. A robot whose state cannot be known (its class is not one of this process, or it went on after a tick that it had
//! missed) is not executed: what it reported then is taken from the record, too.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use environment::TickRecord;
use lockstep::{Bulletin, Exchange, TickOutcome};
use protocol::messages::{CommandText, FaultKind, Report, TickUpdate};
use protocol::{Epoch, Event, RobotName, RunName, Tick};
use record::Entry;
use record::difference::{Difference, between};
use recording::Frame;
use robot::{Action, BadParameters, Cars, LocalHost, Robot, RobotError};
use scenario::Scenario;

use crate::error::LabError;
use crate::folder::NOT_RECORDED;
use crate::replayed::action;
use crate::run::{Local, RobotMaker, go_on, project_robots};

/// An epoch that is executed again.
pub(crate) struct Reexecution {
    run: RunName,
    pub(crate) local: Local,
    /// What robots taken from the record do in the tick in progress.
    script: RecordedReports,
    /// Robots that are taken from the record.
    pub(crate) scripted: BTreeSet<RobotName>,
    /// Robots that missed the last tick.
    absent: BTreeSet<RobotName>,
    /// Robots that were taken from the record in some ticks, and the first of these.
    pub(crate) from_record: BTreeMap<RobotName, Tick>,
    make: RobotMaker,
}

/// A tick that was executed again.
pub(crate) struct Executed {
    pub(crate) record: TickRecord,
    /// What each robot reported, if the record has it, too.
    reports: Option<BTreeMap<RobotName, Report>>,
    /// The field after the tick, if the record has it, too.
    frame: Option<Frame>,
}

impl Executed {
    /// The tick as the record has it.
    pub(crate) fn into_entry(self) -> Entry {
        Entry {
            tick: self.record.tick,
            events: Arc::unwrap_or_clone(self.record.events),
            reports: self.reports,
            frame: self.frame,
            recorded_events: None,
        }
    }
}

impl Reexecution {
    /// The beginning of an epoch.
    ///
    /// # Errors
    /// If the scenario cannot be set up.
    pub(crate) fn new(scenario: Scenario, epoch: Epoch) -> Result<Self, LabError> {
        Self::with_robots(scenario, epoch, project_robots())
    }

    /// The beginning of an epoch whose robots are made by `make`, as far as it makes them.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(crate) fn with_robots(
        scenario: Scenario,
        epoch: Epoch,
        make: RobotMaker,
    ) -> Result<Self, LabError> {
        // Robots learn the name of the run, and nothing of the record depends on it.
        let run = RunName::unknown();
        let script = RecordedReports::default();
        let mut scripted = BTreeSet::new();
        let mut from_record = BTreeMap::new();
        let mut robots = BTreeMap::new();
        for (name, spec) in &scenario.robots {
            let robot = make(name, &spec.class).unwrap_or_else(|| {
                scripted.insert(name.clone());
                from_record.insert(name.clone(), 0);
                script.robot()
            });
            robots.insert(name.clone(), robot);
        }

        Ok(Self {
            local: Local::recorded(scenario, epoch, &run, robots)?,
            run,
            script,
            scripted,
            absent: BTreeSet::new(),
            from_record,
            make,
        })
    }

    /// A copy after a tick; `None` if a robot cannot be copied.
    ///
    /// # Errors
    /// If a robot is taken from the record.
    pub(crate) fn snapshot(&self) -> Result<Option<Self>, LabError> {
        if let Some(robot) = self.scripted.first() {
            return Err(cannot_go_on(robot));
        }
        let Ok(local) = self.local.snapshot() else {
            return Ok(None);
        };
        Ok(Some(Self {
            run: self.run.clone(),
            local,
            script: RecordedReports::default(),
            scripted: BTreeSet::new(),
            absent: self.absent.clone(),
            from_record: self.from_record.clone(),
            make: self.make.clone(),
        }))
    }

    /// Executes a tick that was recorded, or the end of the run.
    ///
    /// # Errors
    /// If a robot ends the run, or is to be taken from the record and the record has no reports.
    pub(crate) fn play(&mut self, recorded: &Entry) -> Result<Executed, LabError> {
        if let Some(Event::End {
            reason, waited_for, ..
        }) = recorded.events.last()
        {
            let simulation = &mut self.local.simulation;
            let record = simulation.end_waiting(*reason, waited_for.clone());
            return Ok(Executed {
                record,
                reports: None,
                frame: None,
            });
        }

        if recorded.tick > 0 {
            self.repeat_inputs(recorded)?;
        }
        self.repeat_membership(recorded);
        self.check_script(recorded)?;

        let mut reports = BTreeMap::new();
        let mut exchange = ReexecutedRobots {
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
        let record = record?;
        let frame = recorded.frame.is_some();
        Ok(Executed {
            frame: frame.then(|| environment::recorded::frame(simulation, &record)),
            record,
            reports: recorded.reports.is_some().then_some(reports),
        })
    }

    /// What the simulation was given between this tick and the one before: what was changed by hand, faults that were due, the
    /// operator's commands, and answers that came too late.
    fn repeat_inputs(&mut self, recorded: &Entry) -> Result<(), LabError> {
        let simulation = &mut self.local.simulation;
        let changes = recorded.changes_by_hand();
        simulation.repeat_changes(&changes).map_err(|reason| {
            LabError::record(format!(
                "what was changed by hand before tick {} cannot be changed again: {reason}",
                recorded.tick
            ))
        })?;
        let orders = simulation.faults_due();
        let lateness = simulation.scenario().lateness_at(recorded.tick).clone();
        simulation.note_faults(&orders, |robot| lateness.of(robot));

        for sent in recorded.commands_of(&RobotName::operator()) {
            simulation.command(sent);
        }
        for (robot, ticks) in recorded.done_late() {
            for tick in ticks {
                simulation.done_late(robot, *tick);
            }
        }
        Ok(())
    }

    /// Lets robots go and come as they did.
    fn repeat_membership(&mut self, recorded: &Entry) {
        self.script.set(recorded);

        for name in self.local.simulation.names().to_vec() {
            // Before tick 0 every robot is here, and the first incarnation.
            if recorded.tick > 0 && recorded.has_joined(&name) {
                self.absent.remove(&name);
                self.join(&name, recorded.tick);
            }
            if recorded.has_missed(&name) {
                self.absent.insert(name);
            } else if self.absent.remove(&name) {
                self.play_from_record(&name, recorded.tick);
            }
        }
        self.local.robots.recall(recorded.attendance());
    }

    /// Lets a robot take part as a further incarnation.
    fn join(&mut self, name: &RobotName, tick: Tick) {
        let simulation = &self.local.simulation;
        let class = &simulation.scenario().robots[name].class;
        let robot = match (self.make)(name, class) {
            Some(robot) => {
                self.scripted.remove(name);
                robot
            }
            None => {
                self.scripted.insert(name.clone());
                self.from_record.entry(name.clone()).or_insert(tick);
                self.script.robot()
            }
        };
        self.local.robots.join(name, robot, |generation| {
            simulation.welcome(&self.run, name, generation, None)
        });
    }

    /// A robot goes on after ticks that it has missed, from a state that the record does not have.
    fn play_from_record(&mut self, name: &RobotName, tick: Tick) {
        if self.scripted.insert(name.clone()) {
            self.from_record.entry(name.clone()).or_insert(tick);
            self.local.robots.replace_runner(name, self.script.robot());
        }
    }

    /// Ends the repetition after a tick: the run goes on from there with what the scenario has in store for it.
    ///
    /// # Errors
    /// The first robot that cannot go on, because only its process knew its state.
    pub(crate) fn end(self) -> Result<Local, RobotName> {
        let mut local = self.local;
        local.robots.end_recall();
        if let Some(robot) = self.scripted.into_iter().next() {
            return Err(robot);
        }

        let tick = local.simulation.tick();
        for robot in self.absent {
            let faults = local.simulation.scenario().faults_at(tick);
            let mut lasting = faults.iter().filter(|fault| fault.holds(tick, true));
            let kind = lasting
                .find(|fault| fault.robot == robot)
                .map(|fault| fault.kind);
            match kind {
                Some(FaultKind::Hang) => {
                    let lose_after = local.simulation.scenario().lateness_at(tick).lose_after;
                    local.robots.hang(&robot, lose_after);
                }
                Some(FaultKind::Crash) => local.robots.crash(&robot),
                _ if local.robots.is_lost(&robot) => local.robots.crash(&robot),
                _ => return Err(robot),
            }
        }
        Ok(local)
    }

    /// The first robot that is not executed and of whose report of this tick the record has nothing.
    pub(crate) fn unreported(&self, recorded: &Entry) -> Option<&RobotName> {
        let reports = recorded.reports.as_ref();
        self.scripted.iter().find(|name| {
            let report = reports.and_then(|reports| reports.get(*name));
            report.is_none() && !recorded.has_missed(name)
        })
    }

    /// Checks that the record has what robots that are not executed have reported.
    fn check_script(&self, recorded: &Entry) -> Result<(), LabError> {
        match self.unreported(recorded) {
            None => Ok(()),
            Some(name) => Err(LabError::record(format!(
                "{name} cannot be executed in this process, and the record has no report of it for tick {}",
                recorded.tick
            ))
            .with_help(NOT_RECORDED)),
        }
    }
}

/// Executes recorded ticks again, from tick 0 on. Returns the first difference, if there is one.
///
/// # Errors
/// If the scenario cannot be set up, or a robot is to be taken from the record and the record has no reports.
pub fn first_difference(
    scenario: Scenario,
    epoch: Epoch,
    recorded: &[Entry],
) -> Result<Option<Difference>, LabError> {
    let mut again = Reexecution::new(scenario, epoch)?;
    for entry in recorded {
        let executed = again.play(entry)?.into_entry();
        let difference = between(entry, &executed);
        if difference.is_some() {
            return Ok(difference);
        }
    }
    Ok(None)
}

/// Executes recorded ticks again, from tick 0 on, and then the rest of the scenario. Returns the digest of the run at its end.
///
/// # Errors
/// As [`first_difference`], and if a robot cannot go on.
pub fn digest_from(
    scenario: Scenario,
    epoch: Epoch,
    recorded: &[Entry],
) -> Result<String, LabError> {
    let mut again = Reexecution::new(scenario, epoch)?;
    for entry in recorded {
        again.play(entry)?;
    }

    let run = again.run.clone();
    let make = again.make.clone();
    let mut local = again.end().map_err(|robot| cannot_go_on(&robot))?;
    go_on(&mut local, &run, &*make, |_, _, _| Ok(()))?;
    Ok(local.simulation.digest())
}

/// Why a run cannot go on from its record.
pub(crate) fn cannot_go_on(robot: &RobotName) -> LabError {
    LabError::refused(format!(
        "{robot} cannot go on: it cannot be executed in this process"
    ))
    .with_help(
        "a run is forked in one process; robots in other languages, and robots that went on after a tick that they had \
         missed, have a state that only their processes knew. Classes of Python go on in Python: cars.why(run, robots={…})",
    )
}

/// Why a run cannot branch.
pub(crate) fn cannot_copy(robot: &RobotName) -> LabError {
    LabError::refused(format!("{robot} cannot be copied in the middle of a run")).with_help(
        "a robot of Rust that implements `Robot::snapshot` can; the robots of the project do",
    )
}

/// The robots of this process, in the place of those that were recorded.
struct ReexecutedRobots<'a> {
    robots: &'a mut LocalHost,
    recorded: &'a Entry,
    scripted: &'a BTreeSet<RobotName>,
    /// What the robots that are executed report.
    reports: &'a mut BTreeMap<RobotName, Report>,
}

impl Exchange<TickUpdate, Arc<Report>, CommandText> for ReexecutedRobots<'_> {
    type Error = RobotError;

    fn exchange(
        &mut self,
        tick: Tick,
        news: &dyn Bulletin<TickUpdate>,
    ) -> Result<TickOutcome<Arc<Report>, CommandText>, RobotError> {
        let mut outcome = self.robots.exchange(tick, news)?;
        for (name, report) in self.recorded.reports.iter().flatten() {
            if self.scripted.contains(name) {
                let commands = self.recorded.commands_of(name);
                let mut report = report.clone();
                // Generations count processes: those of this process are others than those that were recorded.
                if let Some((executed, _)) = outcome.reports.get(name) {
                    report.generation = executed.generation;
                }
                outcome
                    .reports
                    .insert(name.clone(), (Arc::new(report), commands));
            }
        }
        for (name, (report, _)) in &outcome.reports {
            self.reports.insert(name.clone(), report.as_ref().clone());
        }
        Ok(outcome)
    }
}

/// What robots that are not executed reported for the tick in progress.
#[derive(Clone, Default)]
struct RecordedReports(Arc<Mutex<BTreeMap<RobotName, Report>>>);

impl RecordedReports {
    fn set(&self, recorded: &Entry) {
        let reports = recorded.reports.clone().unwrap_or_default();
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = reports;
    }

    /// A robot that does what is recorded of it. It sends no commands: they are taken from the record where they count.
    fn robot(&self) -> Box<dyn Robot> {
        Box::new(PublishedRobot(self.clone()))
    }
}

/// A robot that publishes what is recorded of it, for the robots that query it.
struct PublishedRobot(RecordedReports);

impl Robot for PublishedRobot {
    fn init(&mut self, _cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let reports = self.0.0.lock().unwrap_or_else(PoisonError::into_inner);
        match reports.get(cars.name()) {
            Some(report) => action(report),
            None => Action::stay(cars),
        }
    }
}

//! An epoch that is executed again from its scenario and its record, tick by tick.
//!
//! What depended on real time is taken from the record: the operator's commands, the ticks that a robot missed, and when it
//! returned. A robot whose state cannot be known (its class is not one of this process, or it went on after a tick that it had
//! missed) is not executed: what it reported then is taken from the record, too.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use lockstep::{Exchange, Membership, Outcome};
use miette::{IntoDiagnostic, miette};
use protocol::messages::{CommandText, News, Report};
use protocol::{Epoch, Event, RobotName, RunName, Tick};
use recording::Frame;
use robot::{Action, BadParameters, Cars, LocalHost, Robot, RobotError};
use scenario::Scenario;
use simulator::TickRecord;
use simulator::record::Entry;

use crate::replayed::action;
use crate::run::Local;

/// An epoch that is executed again.
pub(crate) struct Reexecution {
    run: RunName,
    pub(crate) local: Local,
    /// What robots taken from the record do in the tick in progress.
    script: Script,
    /// Robots that are taken from the record.
    pub(crate) scripted: BTreeSet<RobotName>,
    /// Robots that do not take part.
    absent: BTreeSet<RobotName>,
    /// Robots that were taken from the record in some ticks, and the first of these.
    pub(crate) from_record: BTreeMap<RobotName, Tick>,
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
    pub(crate) fn new(scenario: Scenario, epoch: Epoch) -> miette::Result<Self> {
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
            local: Local::recorded(scenario, epoch, &run, robots)?,
            run,
            script,
            scripted,
            absent: BTreeSet::new(),
            from_record,
        })
    }

    /// Executes a tick that was recorded, or the end of the run.
    ///
    /// # Errors
    /// If a robot ends the run, or is to be taken from the record and the record has no reports.
    pub(crate) fn play(&mut self, recorded: &Entry) -> miette::Result<Executed> {
        if let Some(Event::End { reason, .. }) = recorded.events.last() {
            let record = self.local.simulation.end(*reason);
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
        let frame = recorded.frame.is_some();
        Ok(Executed {
            frame: frame.then(|| simulator::recorder::frame(simulation, &record)),
            record,
            reports: recorded.reports.is_some().then_some(reports),
        })
    }

    /// What the simulation was given between this tick and the one before: what was changed by hand, faults that were due, the
    /// operator's commands, and answers that came too late.
    fn repeat_inputs(&mut self, recorded: &Entry) -> miette::Result<()> {
        let simulation = &mut self.local.simulation;
        let changes = recorded.changes_by_hand();
        simulation.repeat_changes(&changes).map_err(|reason| {
            miette!(
                "what was changed by hand before tick {} cannot be changed again: {reason}",
                recorded.tick
            )
        })?;
        let orders = simulation.faults_due();
        let lateness = simulation.scenario().lateness_at(recorded.tick).clone();
        simulation.note_faults(&orders, |robot| lateness.of(robot));

        for sent in recorded.commands_of(&RobotName::operator()) {
            simulation.command(&sent.to, &sent.command.command);
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
        match reports.get(cars.name()) {
            Some(report) => action(report),
            None => Action::stay(cars),
        }
    }
}

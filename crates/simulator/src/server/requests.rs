//! Requests of control that only a run in progress can meet.

use std::time::Duration;

use bus::Query;
use protocol::messages::{Control, ControlAnswer, FaultKind, Intervention, OnLate, Phase, Setup};
use protocol::{Epoch, RobotName};

use super::control::{execute, on_control};
use super::event::EpochStop;
use super::faults::POLL_INTERVAL;
use super::frontend::{Frontend, answer, refuse, refused};
use super::live::{LiveRun, WaitsFor};
use super::source::TickSource;
use config::diagnostic::Source;
use scenario::{Scenario, kind_in_words};

/// Why a run in progress does not go to another tick.
const NOT_SOUGHT: &str = "a run in progress cannot be sought: its ticks take place once, in order; `cars replay RUN` shows a \
                          recorded run, which can";

/// Most requests that wait for the next tick.
const MAX_DEFERRED: usize = 64;

impl LiveRun {
    /// A request to which no robot objects.
    pub(super) fn on_accepted(
        &mut self,
        query: Query,
        control: &Control,
        frontend: &mut Frontend,
    ) -> Result<(), EpochStop> {
        let simulation = &self.epoch.simulation;
        match control {
            Control::Init { seed, setup, epoch } => {
                let next = check_epoch(*epoch, simulation.epoch())
                    .and_then(|()| next_scenario(&simulation.planned(), *seed, setup.as_deref()));
                self.on_init(next, query, frontend)
            }
            Control::Load { scenario } => {
                self.on_init(load(scenario, simulation.scenario()), query, frontend)
            }

            // The faults before the next tick are being carried out: it waits for that tick.
            Control::Intervene { .. } if matches!(self.epoch.waits_for, WaitsFor::Faults(_)) => {
                self.defer(query);
                Ok(())
            }
            Control::Intervene { what } if self.awaits_launcher(what) => {
                self.orders.early.push(query);
                Ok(())
            }
            other => execute(query, other, self, frontend),
        }
    }

    /// Whether a request is for a launcher that has started this simulator, and that has not subscribed yet.
    fn awaits_launcher(&self, what: &Intervention) -> bool {
        let is_to_come =
            self.orders.is_launcher_to_come() && self.orders.early.len() < MAX_DEFERRED;
        is_to_come && concerns_processes(what) && self.check_interventions().is_ok()
    }

    /// Handles the requests that have waited for the launcher, if they need not wait any more. Returns how long to wait before
    /// looking again; `None` if there are none.
    pub(super) fn handle_early(
        &mut self,
        frontend: &mut Frontend,
    ) -> Result<Option<Duration>, EpochStop> {
        if self.orders.early.is_empty() || self.orders.is_launcher_to_come() {
            return Ok((!self.orders.early.is_empty()).then_some(POLL_INTERVAL));
        }
        for query in std::mem::take(&mut self.orders.early) {
            on_control(query, self, frontend)?;
        }
        Ok(None)
    }

    pub(super) fn on_action(&mut self, control: &Control) -> Result<(), String> {
        match control {
            Control::Seek { .. } => Err(NOT_SOUGHT.to_owned()),
            Control::FaultsDone { epoch, tick } => {
                self.orders.done(*epoch, *tick);
                Ok(())
            }
            Control::ProcessEnded { robots, because } => self.note_departed(robots, because),
            Control::Intervene { what } => self.intervene(what),

            Control::Late {
                robot,
                on_late,
                deadline_s,
            } => self.change_lateness(robot.as_ref(), *on_late, *deadline_s),
            Control::Status
            | Control::Start
            | Control::Pause
            | Control::Speed { .. }
            | Control::Step { .. }
            | Control::Setup
            | Control::Log
            | Control::Stop
            | Control::Init { .. }
            | Control::Load { .. } => unreachable!("handled before"),
        }
    }

    /// The launcher starts no further process for these robots.
    fn note_departed(&mut self, robots: &[RobotName], because: &str) -> Result<(), String> {
        self.check_known(robots)?;
        for robot in robots {
            self.departed.ended(robot, because);
        }
        Ok(())
    }

    fn check_known<'a>(
        &self,
        robots: impl IntoIterator<Item = &'a RobotName>,
    ) -> Result<(), String> {
        let mut robots = robots.into_iter();
        match robots.find(|robot| !self.barrier.has(robot)) {
            Some(unknown) => Err(format!("no robot of this run is called {unknown}")),
            None => Ok(()),
        }
    }

    fn change_lateness(
        &mut self,
        robot: Option<&RobotName>,
        on_late: Option<OnLate>,
        deadline_s: Option<f64>,
    ) -> Result<(), String> {
        self.check_known(robot)?;
        if deadline_s.is_some_and(|deadline_s| deadline_s <= 0.0) {
            return Err("a deadline is more than zero".to_owned());
        }

        if let Some(on_late) = on_late {
            // What it does to the open tick is in the record anyway: who missed it.
            self.check_interventions()?;
            let simulation = &mut self.epoch.simulation;
            simulation.change_by_hand(&[Scenario::words_of_lateness(robot, on_late)?])?;
        }

        // At once as well, and not only from the next tick on: the clock may be held because of the
        // robot.
        let mut lateness = self.barrier.lateness().clone();
        match (robot, on_late) {
            (Some(robot), Some(on_late)) => {
                lateness.own.insert(robot.clone(), on_late);
            }
            (None, Some(on_late)) => lateness.on_late = on_late,
            (_, None) => {}
        }
        if let Some(deadline_s) = deadline_s {
            lateness.deadline = Duration::try_from_secs_f64(deadline_s).unwrap_or(Duration::MAX);
        }
        self.barrier.set_lateness(lateness, &mut self.outputs);
        for robot in self.robots_held_for_a_time() {
            self.barrier.note_stopped(&robot, &mut self.outputs);
        }
        Ok(())
    }

    /// Keeps a request until the next tick has begun.
    fn defer(&mut self, query: Query) {
        if self.epoch.deferred.len() < MAX_DEFERRED {
            self.epoch.deferred.push(query);
        } else {
            refuse(&query, "too many requests wait for the next tick");
        }
    }

    /// Does something to the run, from the next tick on.
    fn intervene(&mut self, what: &Intervention) -> Result<(), String> {
        // Refused before anything is looked at: while the record is executed again, nothing may differ
        // from it.
        self.check_interventions()?;
        if concerns_processes(what) && !self.orders.publisher.has_subscribers() {
            return Err(
                "no launcher is connected that could stop or start processes: start the run by `cars launch`"
                    .to_owned(),
            );
        }

        // The clock is held because of the fault, so no further tick comes at which a change could end
        // it.
        if let Intervention::Recover { robot } = what
            && let Some(kind) = self.fault_that_holds_clock(robot)
        {
            let order = self.recover_now(robot, kind);
            return order.map_err(|error| error.to_string());
        }
        if let Intervention::Fault { robot, .. } = what
            && let Some(kind) = self
                .fault_that_holds_clock(robot)
                .or_else(|| self.fault_for_a_time(robot))
        {
            let kind = kind_in_words(kind);
            return Err(format!("{robot} {kind} already: let it go on first"));
        }
        // The clock has gone on without the robot, so for the scenario its fault may be over: its process knows nothing of that.
        if let Intervention::Recover { robot } = what
            && self.fault_for_a_time(robot).is_some()
        {
            return self.epoch.simulation.end_fault_for_a_time(robot);
        }
        self.epoch.simulation.intervene(what)
    }

    /// Robots whose processes the launcher keeps killed or stopped for a time, and that are not back.
    pub(super) fn robots_held_for_a_time(&self) -> Vec<RobotName> {
        let roster = self.barrier.roster();
        roster
            .filter(|robot| self.fault_for_a_time(robot).is_some())
            .cloned()
            .collect()
    }

    fn fault_for_a_time(&self, robot: &RobotName) -> Option<FaultKind> {
        let fault = self.orders.holding_for_a_time(robot)?;
        let is_awaited = self.barrier.awaited().iter().any(|(name, _)| name == robot);
        (is_awaited || !self.barrier.is_back(robot)).then_some(fault)
    }

    /// The fault of a robot because of which the clock waits for it: only the wall clock, or a person, ends that.
    fn fault_that_holds_clock(&self, robot: &RobotName) -> Option<FaultKind> {
        let is_awaited = self.barrier.awaited().iter().any(|(name, _)| name == robot);
        let fault = self.epoch.simulation.held_by_wall_clock(robot);
        fault.filter(|_| is_awaited)
    }

    /// Refuses what is done by hand while the run is executed again, and after its last tick.
    fn check_interventions(&self) -> Result<(), String> {
        let simulation = &self.epoch.simulation;
        if self.epoch.record.is_repeating() {
            return Err(
                "the run is executed again up to the end of its record: wait until it goes on from there"
                    .to_owned(),
            );
        }
        if simulation.is_over() {
            return Err("the run has no further tick".to_owned());
        }
        Ok(())
    }

    fn on_init(
        &mut self,
        next: Result<Scenario, ControlAnswer>,
        query: Query,
        frontend: &mut Frontend,
    ) -> Result<(), EpochStop> {
        match next {
            Err(refusal) => answer(&query, &refusal),
            Ok(_) if frontend.pace.phase == Phase::Gathering => {
                refuse(&query, &format!("the run is {}", frontend.pace.phase));
            }
            Ok(next) => {
                // Answered now: the epoch that it steps in is over when the next one begins.
                self.answer_stepping(frontend);
                return Err(EpochStop::Init {
                    scenario: Box::new(next),
                    query: Box::new(query),
                });
            }
        }

        self.show(frontend);
        Ok(())
    }
}

/// Whether the launcher may have to do something for an intervention.
fn concerns_processes(what: &Intervention) -> bool {
    match what {
        Intervention::Fault { .. } | Intervention::Recover { .. } => true,
        Intervention::Set { set } => {
            let mut set = set.iter();
            set.any(|one| one.starts_with("fault") || one.starts_with("robot"))
        }
        Intervention::Cut { .. }
        | Intervention::Heal { .. }
        | Intervention::Lose { .. }
        | Intervention::Delay { .. }
        | Intervention::Duplicate { .. } => false,
    }
}

/// Checks that an epoch is the one in progress, if it is named.
fn check_epoch(epoch: Option<Epoch>, now: Epoch) -> Result<(), ControlAnswer> {
    match epoch {
        Some(epoch) if epoch != now => Err(refused(format!(
            "epoch {now} has begun meanwhile, perhaps with another set-up: look at that first"
        ))),
        _ => Ok(()),
    }
}

/// The scenario of the next epoch.
fn next_scenario(
    running: &Scenario,
    seed: Option<u64>,
    setup: Option<&Setup>,
) -> Result<Scenario, ControlAnswer> {
    if let Some(seed) = seed {
        config::seed::check(seed).map_err(|error| refused(error.to_string()))?;
    }

    let next = setup.map_or_else(|| Ok(running.clone()), |setup| running.with_setup(setup));
    let next = next.map_err(|fields| ControlAnswer::Refused {
        explanation: fields
            .iter()
            .map(|e| format!("{}: {}", e.field, e.reason))
            .collect::<Vec<_>>()
            .join("\n"),
        fields,
    })?;
    match seed {
        Some(seed) => next
            .with_seed(seed)
            .map_err(|error| refused(error.in_words())),
        None => Ok(next),
    }
}

/// The scenario that a text from outside describes, for the robots that are there.
pub(super) fn load(text: &str, running: &Scenario) -> Result<Scenario, ControlAnswer> {
    let source = Source {
        name: "the scenario".to_owned(),
        text: text.to_owned(),
    };
    let loaded = Scenario::parse_alone(&source).map_err(|error| refused(error.in_words()))?;
    loaded.with_roster_of(running).map_err(refused)
}

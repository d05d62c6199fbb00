//! Control: the CD-player buttons of the paper.

use std::time::Duration;

use bus::Query;
use protocol::messages::{
    Awaited, Control, ControlAnswer, End, FaultKind, Intervention, Phase, RobotStatus, Setup,
    SetupAnswer, Status,
};
use protocol::{Epoch, RobotName, decode, encode};

use super::answer::{Refusal, refuse};
use super::process::{Interrupt, Server, Stage};
use crate::simulation::Simulation;
use config::diagnostic::Source;
use scenario::{OnLate, Scenario, kind_in_words};

/// Why a run in progress does not go to another tick.
const NOT_SOUGHT: &str = "a run in progress cannot be sought: its ticks take place once, in order; `cars replay RUN` shows a \
                          recorded run, which can";

/// Most requests that wait for the next tick.
const MAX_DEFERRED: usize = 64;

impl Server {
    /// People ask for something; they are answered at once.
    pub(super) fn on_control(
        &mut self,
        query: Query,
        simulation: &mut Simulation,
    ) -> Result<(), Interrupt> {
        let control = match decode::<Control>(query.key(), "an operator", &query.body()) {
            Ok(control) => control,
            Err(error) => {
                refuse(&query, &error.to_string());
                return Ok(());
            }
        };

        let offers = Self::offers(&control, simulation);
        if offers.is_empty() {
            return self.on_request(query, control, simulation);
        }
        self.offer(query, control, offers);
        Ok(())
    }

    /// Robots have been asked about the parameters that a request sets.
    pub(super) fn on_offered(
        &mut self,
        query: Query,
        control: Control,
        refusal: Option<String>,
        simulation: &mut Simulation,
    ) -> Result<(), Interrupt> {
        match refusal {
            None => self.on_request(query, control, simulation),
            Some(reason) => {
                refuse(&query, &reason);
                Ok(())
            }
        }
    }

    fn on_request(
        &mut self,
        query: Query,
        control: Control,
        simulation: &mut Simulation,
    ) -> Result<(), Interrupt> {
        match control {
            Control::Step { n } => {
                self.on_step(n, query, simulation);
                return Ok(());
            }
            Control::Init { seed, setup, epoch } => {
                let next = check_epoch(epoch, simulation)
                    .and_then(|()| next_scenario(&simulation.planned(), seed, setup.as_deref()));
                self.on_init(next, &query, simulation)?;
            }
            Control::Load { scenario } => {
                self.on_init(load(&scenario, simulation.scenario()), &query, simulation)?;
            }
            // The faults before the next tick are being carried out: it waits for that tick.
            Control::Intervene { .. } if matches!(self.stage, Stage::Faults(_)) => {
                self.defer(query);
                return Ok(());
            }
            Control::Setup => {
                answer_setup(&query, simulation.scenario());
                return Ok(());
            }
            Control::Log => {
                self.observers.answer_log(&query);
                return Ok(());
            }
            Control::Stop => {
                self.answer_status(&query, simulation);
                return Err(Interrupt::End(End::Stopped));
            }
            other => match self.act(&other, simulation) {
                Ok(()) => {
                    if matches!(other, Control::Pause)
                        && let Some(stepping) = self.pace.give_up_stepping()
                    {
                        self.answer_status(&stepping, simulation);
                    }
                    self.answer_status(&query, simulation);
                }
                Err(explanation) => refuse(&query, &explanation),
            },
        }

        if self.observers.has_subscribers() {
            self.observers.frame(simulation, &self.status(simulation));
        }

        Ok(())
    }

    fn act(&mut self, control: &Control, simulation: &mut Simulation) -> Result<(), String> {
        match control {
            Control::Start => self.pace.start()?,
            Control::Pause => self.pace.pause()?,
            Control::Speed { factor } => self.pace.set_speed(*factor)?,
            Control::Seek { .. } => return Err(NOT_SOUGHT.to_owned()),
            Control::FaultsDone { epoch, tick } => self.orders.done(*epoch, *tick),
            Control::ProcessEnded { robots, because } => self.note_departed(robots, because)?,
            Control::Intervene { what } => self.intervene(what, simulation)?,
            Control::Late {
                robot,
                on_late,
                deadline_s,
            } => {
                self.change_lateness(robot.as_ref(), *on_late, *deadline_s, simulation)?;
            }
            Control::Status => {}
            Control::Init { .. }
            | Control::Load { .. }
            | Control::Setup
            | Control::Log
            | Control::Step { .. }
            | Control::Stop => {
                unreachable!("handled by on_control")
            }
        }

        Ok(())
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
        simulation: &mut Simulation,
    ) -> Result<(), String> {
        self.check_known(robot)?;
        if deadline_s.is_some_and(|deadline_s| deadline_s <= 0.0) {
            return Err("a deadline is more than zero".to_owned());
        }

        if let Some(on_late) = on_late {
            // What it does to the open tick is in the record anyway: who missed it.
            self.check_interventions(simulation)?;
            simulation.change_by_hand(&[Scenario::words_of_lateness(robot, on_late)?])?;
        }

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
        Ok(())
    }

    /// Keeps a request until the next tick has begun.
    fn defer(&mut self, query: Query) {
        if self.deferred.len() < MAX_DEFERRED {
            self.deferred.push(query);
        } else {
            refuse(&query, "too many requests wait for the next tick");
        }
    }

    /// Does something to the run, from the next tick on.
    fn intervene(
        &mut self,
        what: &Intervention,
        simulation: &mut Simulation,
    ) -> Result<(), String> {
        self.check_interventions(simulation)?;
        let concerns_processes = match what {
            Intervention::Fault { .. } | Intervention::Recover { .. } => true,
            Intervention::Set { set } => {
                let mut set = set.iter();
                set.any(|one| one.starts_with("fault") || one.starts_with("robot"))
            }
            Intervention::Cut { .. } | Intervention::Heal { .. } | Intervention::Lose { .. } => {
                false
            }
        };
        if concerns_processes && !self.orders.publisher.has_subscribers() {
            return Err(
                "no launcher is connected that could stop or start processes: start the run by `cars launch`"
                    .to_owned(),
            );
        }

        if let Intervention::Recover { robot } = what
            && let Some(kind) = self.fault_that_holds_clock(robot, simulation)
        {
            let order = self.recover_now(robot, kind, simulation);
            return order.map_err(|error| error.to_string());
        }
        if let Intervention::Fault { robot, .. } = what
            && let Some(kind) = self.fault_that_holds_clock(robot, simulation)
        {
            let kind = kind_in_words(kind);
            return Err(format!("{robot} {kind} already: let it go on first"));
        }
        simulation.intervene(what)
    }

    /// The fault of a robot because of which the clock waits for it: only the wall clock, or a person, ends that.
    fn fault_that_holds_clock(
        &self,
        robot: &RobotName,
        simulation: &Simulation,
    ) -> Option<FaultKind> {
        let is_awaited = self.barrier.awaited().iter().any(|(name, _)| name == robot);
        simulation.held_by_wall_clock(robot).filter(|_| is_awaited)
    }

    /// Refuses what is done by hand while the run is executed again, and after its last tick.
    fn check_interventions(&self, simulation: &Simulation) -> Result<(), String> {
        if self.is_repeating() {
            return Err(
                "the run is executed again up to the end of its record: wait until it goes on from there"
                    .to_owned(),
            );
        }
        if simulation.tick() >= simulation.scenario().ticks {
            return Err("the run has no further tick".to_owned());
        }
        Ok(())
    }

    fn on_init(
        &mut self,
        next: Result<Scenario, Refusal>,
        query: &Query,
        simulation: &Simulation,
    ) -> Result<(), Interrupt> {
        let next = match next {
            Ok(next) => next,
            Err(refusal) => {
                query.reply(query.key(), encode(&ControlAnswer::from(refusal)));
                return Ok(());
            }
        };

        match self.pace.phase {
            Phase::Gathering => {
                refuse(query, &format!("the run is {}", self.pace.phase));
                Ok(())
            }
            _ => {
                if let Some(stepping) = self.pace.give_up_stepping() {
                    self.answer_status(&stepping, simulation);
                }
                self.answer_status(query, simulation);
                Err(Interrupt::Init(Box::new(next)))
            }
        }
    }

    fn on_step(&mut self, n: u64, query: Query, simulation: &Simulation) {
        if let Err(explanation) = self.pace.step(n) {
            return refuse(&query, &explanation);
        }
        if self.barrier.is_announced() {
            return self.answer_status(&query, simulation);
        }

        // Only the last client that steps is kept waiting; the one before gets the status as it is.
        let until = simulation.tick() + self.pace.pending_steps + u64::from(self.barrier.is_open());
        if let Some((earlier, _)) = self
            .pace
            .stepping
            .replace((query, until.min(simulation.scenario().ticks)))
        {
            self.answer_status(&earlier, simulation);
        }
    }

    pub(super) fn answer_status(&self, query: &Query, simulation: &Simulation) {
        let answer = ControlAnswer::Done(Box::new(self.status(simulation)));
        query.reply(query.key(), encode(&answer));
    }

    /// How things stand.
    pub(super) fn status(&self, simulation: &Simulation) -> Status {
        let scenario = simulation.scenario();
        let lateness = self.barrier.lateness();
        let mut robots = Vec::new();
        for name in self.barrier.roster() {
            let (generation, presence) = self.presence(name);
            robots.push(RobotStatus {
                name: name.clone(),
                generation,
                on_late: lateness.of(name),
                presence,
            });
        }

        Status {
            run: self.options.run.clone(),
            epoch: simulation.epoch(),
            tick: simulation.tick(),
            pending_steps: self.pace.pending_steps,
            time_s: simulation.time_s(simulation.tick()),
            duration_s: scenario.duration_s(),
            tick_s: scenario.tick_s,
            seed: scenario.seed,
            replay_of: None,
            phase: self.pace.phase,
            speed: self.pace.speed,
            on_late: lateness.on_late,
            deadline_s: lateness.deadline.as_secs_f64(),
            awaiting: self.awaiting(),
            robots,
            ignored: self.wall.ignored.clone(),
        }
    }

    /// The robots for which the clock waits now, and what is known of them.
    fn awaiting(&self) -> Vec<Awaited> {
        let since_s = self.waiting_since.elapsed().as_secs_f64();
        let mut awaiting = Vec::new();
        for (name, because) in self.barrier.awaited() {
            awaiting.push(Awaited {
                name,
                since_s,
                because,
            });
        }

        awaiting
    }
}

/// Checks that an epoch is the one in progress, if it is named.
fn check_epoch(epoch: Option<Epoch>, simulation: &Simulation) -> Result<(), Refusal> {
    let now = simulation.epoch();
    match epoch {
        Some(epoch) if epoch != now => Err(Refusal::from(format!(
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
) -> Result<Scenario, Refusal> {
    if let Some(seed) = seed {
        config::seed::check(seed).map_err(|error| error.to_string())?;
    }

    let next = setup.map_or_else(|| Ok(running.clone()), |setup| running.with_setup(setup));
    let next = next.map_err(|fields| Refusal {
        explanation: fields
            .iter()
            .map(|e| format!("{}: {}", e.field, e.reason))
            .collect::<Vec<_>>()
            .join("\n"),
        fields,
    })?;
    Ok(Scenario {
        seed: seed.unwrap_or(next.seed),
        ..next
    })
}

/// The scenario that a text from outside describes, for the robots that are there.
pub(super) fn load(text: &str, running: &Scenario) -> Result<Scenario, Refusal> {
    let source = Source {
        name: "the scenario".to_owned(),
        text: text.to_owned(),
    };
    let loaded = Scenario::parse_alone(&source).map_err(|error| error.in_words())?;
    Ok(loaded.with_roster_of(running)?)
}

pub(super) fn answer_setup(query: &Query, scenario: &Scenario) {
    match scenario.to_toml() {
        Ok(text) => {
            let answer = SetupAnswer {
                setup: scenario.setup(),
                scenario: text,
            };
            query.reply(query.key(), encode(&ControlAnswer::Setup(Box::new(answer))));
        }
        Err(error) => refuse(query, &error.to_string()),
    }
}

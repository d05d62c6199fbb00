//! Control: the CD-player buttons of the paper.

use std::time::Duration;

use bus::Query;
use protocol::messages::{
    Awaited, Control, ControlAnswer, End, FieldError, Phase, RobotStatus, Setup, SetupAnswer,
    Status,
};
use protocol::{RobotName, decode, encode};

use super::process::{Interrupt, Server};
use crate::diagnostic::Source;
use crate::scenario::{OnLate, Scenario};
use crate::simulation::Simulation;

/// Why a run in progress does not go to another tick.
const NOT_SOUGHT: &str = "a run in progress cannot be sought: its ticks take place once, in order; `cars replay RUN` shows a \
                          recorded run, which can";

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
        match control {
            Control::Step { n } => {
                self.on_step(n, query, simulation);
                return Ok(());
            }
            Control::Init { seed, setup } => {
                let next = next_scenario(simulation.scenario(), seed, setup.as_deref());
                self.on_init(next, &query, simulation)?;
            }
            Control::Load { scenario } => {
                self.on_init(load(&scenario, simulation.scenario()), &query, simulation)?;
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
            other => match self.act(&other) {
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

    fn act(&mut self, control: &Control) -> Result<(), String> {
        match control {
            Control::Start => self.pace.start()?,
            Control::Pause => self.pace.pause()?,
            Control::Speed { factor } => self.pace.set_speed(*factor)?,
            Control::Seek { .. } => return Err(NOT_SOUGHT.to_owned()),
            Control::FaultsDone { epoch, tick } => self.orders.done(*epoch, *tick),
            Control::Late {
                robot,
                on_late,
                deadline_s,
            } => {
                self.change_lateness(robot.as_ref(), *on_late, *deadline_s)?;
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

    fn change_lateness(
        &mut self,
        robot: Option<&RobotName>,
        on_late: Option<OnLate>,
        deadline_s: Option<f64>,
    ) -> Result<(), String> {
        if let Some(unknown) = robot.filter(|robot| !self.barrier.has(robot)) {
            return Err(format!("no robot of this run is called {unknown}"));
        }
        if deadline_s.is_some_and(|deadline_s| deadline_s <= 0.0) {
            return Err("a deadline is more than zero".to_owned());
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
            Phase::Gathering | Phase::Ended => {
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
        // Only the last one to step is kept waiting; whoever came before is told how far things are.
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

/// Why something is not done.
struct Refusal {
    explanation: String,
    fields: Vec<FieldError>,
}

impl From<String> for Refusal {
    fn from(explanation: String) -> Self {
        Self {
            explanation,
            fields: Vec::new(),
        }
    }
}

impl From<Refusal> for ControlAnswer {
    fn from(
        Refusal {
            explanation,
            fields,
        }: Refusal,
    ) -> Self {
        Self::Refused {
            explanation,
            fields,
        }
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
fn load(text: &str, running: &Scenario) -> Result<Scenario, Refusal> {
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

pub(super) fn refuse(query: &Query, explanation: &str) {
    let answer = ControlAnswer::from(Refusal::from(explanation.to_owned()));
    query.reply(query.key(), encode(&answer));
}

//! A run that is played step by step from outside: what a learner needs. Robots whose actions are chosen outside, the agents, take part
//! among others; the caller sees what they perceive, says what they do, and the tick goes on. There is no lag: what an agent perceives in
//! a tick and what it does in it are one step.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use environment::Simulation;
use protocol::RobotName;
use protocol::messages::{StateVariables, Variable};
use record::NewRun;
use recorder::Recorder;
use robot::{Action, BadParameters, Cars, Robot, SiteAction};
use scenario::Scenario;

use crate::branch::Branch;
use crate::error::LabError;
use crate::run::{RobotMaker, observe};

/// The class of agents in the scenario of a record. No program has such robots: executed again, they do what they reported.
pub const CLASS: &str = "agent";
/// The state variable that counts what an agent has served.
const SERVED: &str = "served";

/// What agents are.
#[derive(Debug, Clone, Default)]
pub struct AgentKind {
    /// Whether they sense all bodies around them.
    pub senses_bodies: bool,
    /// Whether they measure distances along the rays of the scenario.
    pub senses_ranges: bool,
    /// In every tick an agent takes one off this variable of the nearest site that it senses and where it is above 0, and counts it as
    /// its state variable `served`.
    pub serves: Option<String>,
}

/// What an agent is told to do in a tick.
#[derive(Debug, Clone, Default)]
pub struct AgentStep {
    /// Its motion, and what it shows.
    pub action: Action,
    /// Commands that it sends: to whom, and their texts.
    pub commands: Vec<(String, String)>,
}

/// What an agent is told to do in the tick that is open, if it has been told.
type StepSlot = Arc<Mutex<Option<AgentStep>>>;

/// A run that is played step by step.
pub struct SteppedRun {
    branch: Branch,
    agents: BTreeMap<RobotName, StepSlot>,
    record: Option<SteppedRecord>,
    opened: Instant,
}

/// The record of the run, if there is one.
struct SteppedRecord {
    recorder: Recorder,
    /// Holds the lock of its folder.
    _run: NewRun,
}

impl SteppedRun {
    /// Begins a run of a scenario as [`Self::scenario_of`] gives it: it stands in tick 0, in which no robot has acted. `record` is the
    /// folder of its record, made for that scenario.
    ///
    /// # Errors
    /// If the scenario cannot be played in this process, or the record cannot be begun.
    pub fn begin(
        scenario: Scenario,
        agents: &BTreeSet<RobotName>,
        kind: &AgentKind,
        others: RobotMaker,
        record: Option<NewRun>,
    ) -> Result<Self, LabError> {
        let steps: BTreeMap<RobotName, StepSlot> = agents
            .iter()
            .map(|name| (name.clone(), Arc::default()))
            .collect();
        let (kind, of_agents) = (kind.clone(), steps.clone());
        let make: RobotMaker = Arc::new(move |name, class| match of_agents.get(name) {
            Some(step) => Some(Box::new(Agent::new(kind.clone(), step.clone()))),
            None => others(name, class),
        });

        let run = record.as_ref().map(|record| record.run.clone());
        let run = run.unwrap_or_else(protocol::RunName::unknown);
        let opened = Instant::now();
        let branch = Branch::begin(scenario, &run, make)?;
        let record = record.map(|new| {
            let recorder = Recorder::begin(&new.folder, &run, branch.simulation())?;
            Ok::<_, LabError>(SteppedRecord {
                recorder,
                _run: new,
            })
        });
        Ok(Self {
            branch,
            agents: steps,
            record: record.transpose()?,
            opened,
        })
    }

    /// The scenario of a run with these agents: a re-execution knows by their class that it cannot make them.
    #[must_use]
    pub fn scenario_of(mut scenario: Scenario, agents: &BTreeSet<RobotName>) -> Scenario {
        for (name, robot) in &mut scenario.robots {
            if agents.contains(name) {
                CLASS.clone_into(&mut robot.class);
            }
        }
        scenario
    }

    /// Shows what an agent perceives in this tick. `None` if it takes no part in it, because of a fault of the scenario.
    pub fn perceive<T>(
        &self,
        agent: &RobotName,
        see: impl FnOnce(&mut Cars<'_>) -> T,
    ) -> Option<T> {
        self.branch.perceive(agent, see)
    }

    /// Says what an agent does in this tick. Without it, it stays where it is.
    pub fn act(&mut self, agent: &RobotName, step: AgentStep) {
        if let Some(slot) = self.agents.get(agent) {
            *lock(slot) = Some(step);
        }
    }

    /// Ends the tick, in which all robots act, and begins the next one. Returns whether there is one: otherwise the run is over, and its
    /// record is complete.
    ///
    /// # Errors
    /// If a robot ends the run, or the record cannot be written.
    pub fn step(&mut self) -> Result<bool, LabError> {
        self.end_tick()?;
        self.opened = Instant::now();
        if self.branch.begin_tick()? {
            return Ok(true);
        }

        self.end_tick()?;
        Ok(false)
    }

    fn end_tick(&mut self) -> Result<(), LabError> {
        let Some(ended) = self.branch.end_tick()? else {
            return Ok(());
        };
        let Some(SteppedRecord { recorder, .. }) = &mut self.record else {
            return Ok(());
        };

        observe(recorder, self.branch.local(), self.opened);
        recorder.write(self.branch.simulation(), &ended)?;
        if self.branch.is_ended() {
            recorder.finish(self.branch.simulation())?;
            self.record = None;
        }
        Ok(())
    }

    /// The simulation after the last tick that has ended.
    #[must_use]
    pub fn simulation(&self) -> &Simulation {
        self.branch.simulation()
    }

    /// Whether the run is over.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.branch.is_ended()
    }
}

/// A robot that does what it is told.
struct Agent {
    kind: AgentKind,
    step: StepSlot,
    served: u32,
}

impl Agent {
    fn new(kind: AgentKind, step: StepSlot) -> Self {
        Self {
            kind,
            step,
            served: 0,
        }
    }

    /// Takes one off the nearest site where there is something, and counts what was taken in the tick before.
    fn serve(&mut self, cars: &Cars<'_>, variable: &str, action: &mut Action) {
        let taken = cars.site_results();
        let taken = taken.iter().filter(|result| result.refused.is_none());
        self.served = self.served.saturating_add(taken.count() as u32);

        let here = cars.location();
        let mut nearest: Option<(f64, &str)> = None;
        for site in cars.sites() {
            let left = site.state.get(variable).and_then(Variable::as_f64);
            let distance_m = here.distance_m(site.location);
            let is_nearer = nearest.is_none_or(|(least_m, _)| distance_m < least_m);
            if left.is_some_and(|left| left > 0.0) && is_nearer {
                nearest = Some((distance_m, &site.name));
            }
        }
        if let Some((_, site)) = nearest {
            action
                .site_actions
                .push(SiteAction::add(site, variable, -1.0));
        }
    }
}

impl Robot for Agent {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.served = 0;
        Ok(())
    }

    fn resume(&mut self, _: &mut Cars<'_>, last: &StateVariables) {
        let served = last.get(SERVED).and_then(Variable::as_f64);
        self.served = served.unwrap_or(0.0) as u32;
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let told = lock(&self.step).take();
        let AgentStep {
            mut action,
            commands,
        } = told.unwrap_or_else(|| AgentStep {
            action: Action::stay(cars),
            commands: Vec::new(),
        });
        for (to, text) in commands {
            if let Err(error) = cars.set_robot_command(&to, text) {
                cars.warn(&error.to_string());
            }
        }
        if let Some(variable) = self.kind.serves.clone() {
            self.serve(cars, &variable, &mut action);
            action = action.variable(SERVED, f64::from(self.served));
        }
        action
    }

    fn senses_bodies(&self) -> bool {
        self.kind.senses_bodies
    }

    fn senses_ranges(&self) -> bool {
        self.kind.senses_ranges
    }
}

/// What an agent is told is whole whenever the lock is free.
fn lock(step: &StepSlot) -> std::sync::MutexGuard<'_, Option<AgentStep>> {
    step.lock().unwrap_or_else(PoisonError::into_inner)
}

//! The run that a schedule must come to: the same simulation and the same robots, called directly. Where an incarnation joins
//! in the schedule's record, a new robot takes over here; nothing else of the schedule comes in.

use std::collections::BTreeMap;
use std::sync::Arc;

use environment::{Simulation, TickRecord};
use lockstep::{Begin, IncarnationNotice, Membership, Sent, TickOutcome, Turn};
use protocol::messages::{CommandText, PublicState, Report};
use protocol::{Generation, RobotName, RunName, Tick};
use robot::{PeerNetwork, Runner, TickResult, Undelivered};
use scenario::Scenario;

use crate::hall::make;

/// What a tick comes to.
pub(crate) type Reports = TickOutcome<Arc<Report>, CommandText>;

pub(crate) struct Reference {
    simulation: Simulation,
    run: RunName,
    runners: BTreeMap<RobotName, Runner>,
    /// States as of the tick before.
    states: BTreeMap<RobotName, Arc<PublicState>>,
}

struct Others<'a>(&'a BTreeMap<RobotName, Arc<PublicState>>);

impl PeerNetwork for Others<'_> {
    fn state_of(&mut self, target: &RobotName) -> Result<Arc<PublicState>, Undelivered> {
        self.0.get(target).cloned().ok_or(Undelivered::Lost)
    }
}

impl Reference {
    pub(crate) fn new(scenario: &Scenario, epoch: protocol::Epoch) -> Self {
        Self {
            simulation: Simulation::new(scenario.clone(), epoch).expect("the hall can be set up"),
            run: RunName::new("schedule").expect("a legal name"),
            runners: BTreeMap::new(),
            states: BTreeMap::new(),
        }
    }

    /// A command from outside, as the simulator passes it on before a tick.
    pub(crate) fn command(&mut self, command: Sent<CommandText>) {
        self.simulation.command(command);
    }

    /// A tick, in which those join that joined in `outcome`.
    pub(crate) fn tick(&mut self, tick: Tick, outcome: &Reports) -> TickRecord {
        if tick == 0 {
            self.simulation.begin_init();
        } else {
            self.simulation.begin_tick();
        }

        let mut reports = BTreeMap::new();
        let mut states = BTreeMap::new();
        for name in self.simulation.names().to_vec() {
            let TickResult {
                commands,
                state,
                report,
            } = self.run(&name, tick, outcome);
            states.insert(name.clone(), state);
            let commands: Vec<Sent<CommandText>> = commands;
            reports.insert(name, (report, commands));
        }
        self.states = states;
        self.simulation.end_tick(TickOutcome {
            reports,
            membership: outcome.membership.clone(),
        })
    }

    fn run(&mut self, name: &RobotName, tick: Tick, outcome: &Reports) -> TickResult {
        let mut joined = None;
        for change in &outcome.membership {
            if let Membership::Joined(robot, generation) = change
                && robot == name
            {
                joined = Some(*generation);
            }
        }
        let first = outcome
            .reports
            .get(name)
            .map_or(1, |(report, _)| report.generation);
        if tick == 0 {
            self.runner(name, first);
        } else if let Some(generation) = joined {
            self.runner(name, generation);
        }

        let notice = IncarnationNotice {
            joined,
            rejoin: None,
        };
        let has_news = self.simulation.robots_with_news().contains(name) || joined.is_some();
        let turn = Turn {
            epoch: self.simulation.epoch(),
            tick,
            begin: match (tick, joined) {
                (0, _) => Begin::Init,
                (_, Some(_)) => Begin::TakeOver,
                (_, None) => Begin::GoOn,
            },
            news: has_news.then(|| self.simulation.news(name, notice)),
        };
        let runner = self
            .runners
            .get_mut(name)
            .expect("every robot is seated at tick 0");
        runner
            .run(&turn, &mut Others(&self.states))
            .expect("the parameters are good")
    }

    fn runner(&mut self, name: &RobotName, generation: Generation) {
        let robot = make(&self.simulation.scenario().robots[name].class);
        self.simulation.list_bodies(name, robot.senses_bodies());
        let welcome = self.simulation.welcome(&self.run, name, generation, None);
        let welcome = welcome.expect("it is of the roster");

        self.runners
            .insert(name.clone(), Runner::new(robot, welcome));
    }
}

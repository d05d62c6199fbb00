//! Agents as learners want them: what each perceives is a row of numbers of fixed length, and so is what it does.
//!
//! Rows do not depend on the order of anything but the scenario: bodies and sites are the nearest ones, robots and words have the places
//! that their names have in the [`Design`].

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

use protocol::RobotName;
use protocol::messages::{Point, SensedKind, Variable};
use record::NewRun;
use robot::{Action, Cars};
use scenario::Scenario;
use serde::Deserialize;

use crate::error::LabError;
use crate::run::RobotMaker;
use crate::stepped::{AgentKind, AgentStep, SteppedRun};

/// Most numbers of a row of observations.
pub const MAX_ROW: usize = 65_536;
/// Numbers of a row that all agents have.
const OWN: [&str; 10] = [
    "takes_part",
    "x",
    "y",
    "cos_heading",
    "sin_heading",
    "linear",
    "angular",
    "blocked",
    "served",
    "time",
];

/// What agents perceive, and what they can do.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Design {
    /// The agents, in the order of rows.
    pub agents: Vec<RobotName>,
    /// How many of the nearest bodies an agent perceives.
    pub bodies: usize,
    /// How many of the nearest sites.
    pub sites: usize,
    /// The variable of sites whose value it perceives.
    pub site_variable: Option<String>,
    /// Whether it perceives the distances along the rays of the scenario.
    pub ranges: bool,
    /// The robots whose states it queries in every tick, as of the tick before.
    pub peers: Vec<RobotName>,
    /// The commands that it understands.
    pub hears: Vec<String>,
    /// The emotions that it knows of peers.
    pub emotions: Vec<String>,
    /// The behaviors that it knows of peers.
    pub behaviors: Vec<String>,
    /// What it can say: to whom, and which command. Its third number chooses one; 0 is nothing.
    pub says: Vec<(String, String)>,
    /// Speed at which 1 moves a robot without wheels, m/s.
    pub speed_mps: f64,
    /// As [`AgentKind::serves`].
    pub serves: Option<String>,
    /// A run ends after so many steps, if it has not ended before.
    #[serde(default)]
    pub max_steps: Option<u64>,
    /// What is rewarded: the change of a measure of the scenario in a step, times a weight, for an agent.
    pub rewards: Vec<(RobotName, String, f64)>,
}

/// Makes the folder of a record for a scenario.
pub type RecordMaker<'a> = dyn Fn(&Scenario) -> Result<NewRun, LabError> + Sync + 'a;

/// How a run stands after a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StepEnd {
    /// The scenario's `end_when` holds.
    pub is_terminated: bool,
    /// The run is at its last tick.
    pub is_truncated: bool,
}

/// A scenario that is played again and again, with another seed each time.
pub struct Environment {
    scenario: Scenario,
    design: Design,
    names: BTreeSet<RobotName>,
    kind: AgentKind,
    others: RobotMaker,
    session: Option<SteppedRun>,
    /// The measures that are rewarded, as they stood at the step before.
    measured: BTreeMap<String, f64>,
}

impl Environment {
    /// Checks a design.
    ///
    /// # Errors
    /// If it names robots, peers or measures that the scenario does not have, or a row would be too long.
    pub fn new(
        mut scenario: Scenario,
        design: Design,
        others: RobotMaker,
    ) -> Result<Self, LabError> {
        let roster: Vec<&str> = scenario.robots.keys().map(RobotName::as_str).collect();
        let named = design.agents.iter().chain(&design.peers);
        let named = named.chain(design.rewards.iter().map(|(agent, ..)| agent));
        let told = design.says.iter().map(|(to, _)| to.as_str());
        for robot in named.map(RobotName::as_str).chain(told) {
            if !roster.contains(&robot) {
                return Err(LabError::refused(format!("no robot is called {robot}"))
                    .with_help(format!("its robots are {}", roster.join(", "))));
            }
        }
        let names: BTreeSet<RobotName> = design.agents.iter().cloned().collect();
        if names.is_empty() || names.len() != design.agents.len() {
            return Err(LabError::refused("agents are one robot or more, each once"));
        }
        for (agent, measure, weight) in &design.rewards {
            let mut measures = scenario.measures.iter();
            if !measures.any(|known| known.name == *measure) {
                return Err(
                    LabError::refused(format!("the scenario has no measure {measure:?}"))
                        .with_help("add it with [[measure]]: docs/expectations.md"),
                );
            }
            if !names.contains(agent) || !weight.is_finite() {
                return Err(LabError::refused(format!(
                    "a reward is for an agent and has a number as its weight: {agent}, {measure}, {weight}"
                )));
            }
        }
        if !(design.speed_mps.is_finite() && design.speed_mps > 0.0) {
            return Err(LabError::refused("the speed is a number above 0, in m/s"));
        }

        if let Some(most) = design.max_steps {
            scenario.ticks = scenario.ticks.min(most);
        }
        let kind = AgentKind {
            senses_bodies: design.bodies > 0,
            senses_ranges: design.ranges,
            serves: design.serves.clone(),
        };
        let environment = Self {
            scenario: SteppedRun::scenario_of(scenario, &names),
            design,
            names,
            kind,
            others,
            session: None,
            measured: BTreeMap::new(),
        };
        if environment.ray_count() == 0 && environment.design.ranges {
            return Err(LabError::refused("the scenario has no rays")
                .with_help("add `rays` to [sensing]: docs/scenario-files.md"));
        }
        let row = environment.row();
        if row > MAX_ROW {
            return Err(LabError::refused(format!(
                "a row of observations has {row} numbers, more than {MAX_ROW}"
            )));
        }
        Ok(environment)
    }

    /// How many agents there are.
    #[must_use]
    pub fn agent_count(&self) -> usize {
        self.design.agents.len()
    }

    /// How many numbers an agent perceives.
    #[must_use]
    pub fn row(&self) -> usize {
        let design = &self.design;
        let peer = 4 + design.emotions.len() + design.behaviors.len() + design.hears.len();
        OWN.len()
            + 6 * design.bodies
            + 4 * design.sites
            + self.ray_count()
            + peer * design.peers.len()
    }

    fn ray_count(&self) -> usize {
        let rays = self.scenario.sensing.rays;
        let count = rays.map_or(0, |rays| rays.count as usize);
        if self.design.ranges { count } else { 0 }
    }

    /// How many numbers say what an agent does.
    #[must_use]
    pub fn action_len(&self) -> usize {
        if self.design.says.is_empty() { 2 } else { 3 }
    }

    /// What the numbers of a row are.
    #[must_use]
    pub fn labels(&self) -> Vec<String> {
        let design = &self.design;
        let mut labels: Vec<String> = OWN.iter().map(|own| (*own).to_owned()).collect();
        for body in 0..design.bodies {
            let parts = [
                "is_there",
                "dx",
                "dy",
                "is_guest",
                "is_robot",
                "is_obstacle",
            ];
            labels.extend(parts.map(|part| format!("body{body}.{part}")));
        }
        for site in 0..design.sites {
            let parts = ["is_there", "dx", "dy", "value"];
            labels.extend(parts.map(|part| format!("site{site}.{part}")));
        }
        labels.extend((0..self.ray_count()).map(|ray| format!("ray{ray}")));
        for peer in &design.peers {
            let parts = ["is_known", "x", "y", "speed"];
            labels.extend(parts.map(|part| format!("{peer}.{part}")));
            let names = design.emotions.iter().chain(&design.behaviors);
            labels.extend(names.map(|name| format!("{peer}.{name}")));
            labels.extend(
                design
                    .hears
                    .iter()
                    .map(|said| format!("{peer}.says.{said}")),
            );
        }
        labels
    }

    /// Begins a run with a seed. `record` makes the folder of its record for the scenario that it gets. Fills in what the agents perceive, a row for each.
    ///
    /// # Errors
    /// If the run cannot be begun.
    pub fn reset(
        &mut self,
        seed: u64,
        record: Option<&RecordMaker>,
        observations: &mut [f32],
    ) -> Result<(), LabError> {
        config::seed::check(seed).map_err(LabError::refused)?;
        let scenario = self.scenario.clone();
        let scenario = scenario.with_seed(seed).map_err(LabError::from)?;
        self.session = None;
        let record = record.map(|make| make(&scenario)).transpose()?;
        let session = SteppedRun::begin(
            scenario,
            &self.names,
            &self.kind,
            self.others.clone(),
            record,
        )?;
        self.measured = session.simulation().measurements().numbers();
        self.perceive(&session, observations);
        self.session = Some(session);
        Ok(())
    }

    /// Has the agents do something, [`Self::action_len`] numbers each, and plays on to the next tick. Fills in what they perceive then;
    /// after the end of the run it is what they perceived in the last tick. `rewards` has a number for each agent.
    ///
    /// # Errors
    /// If no run has begun, it is over, or an action is not a number.
    pub fn step(
        &mut self,
        actions: &[f32],
        observations: &mut [f32],
        rewards: &mut [f32],
    ) -> Result<StepEnd, LabError> {
        let session = self.session.take();
        let Some(mut session) = session.filter(|session| !session.is_over()) else {
            return Err(LabError::refused("no run is in progress").with_help("call reset() first"));
        };
        if let Some(index) = actions.iter().position(|number| !number.is_finite()) {
            let agent = &self.design.agents[index / self.action_len()];
            self.session = Some(session);
            return Err(LabError::refused(format!(
                "an action of {agent} is not a finite number"
            )));
        }

        for (agent, action) in self
            .design
            .agents
            .iter()
            .zip(actions.chunks(self.action_len()))
        {
            let step = session.perceive(agent, |cars| self.agent_step(cars, action));
            if let Some(step) = step {
                session.act(agent, step);
            }
        }
        let goes_on = session.step()?;
        rewards.fill(0.0);
        self.add_rewards(&session, rewards);

        let is_last = goes_on && session.simulation().tick() + 1 >= self.scenario.ticks;
        if goes_on {
            self.perceive(&session, observations);
        }
        if is_last {
            // Nothing that is done in the last tick has an effect: no body moves after it.
            session.step()?;
            self.add_rewards(&session, rewards);
        }
        self.session = Some(session);
        Ok(StepEnd {
            is_terminated: !goes_on,
            is_truncated: is_last,
        })
    }

    /// The run, if one has begun.
    #[must_use]
    pub fn session(&self) -> Option<&SteppedRun> {
        self.session.as_ref()
    }

    /// Whether a robot is an agent.
    #[must_use]
    pub fn is_agent(&self, robot: &RobotName) -> bool {
        self.names.contains(robot)
    }

    fn add_rewards(&mut self, session: &SteppedRun, rewards: &mut [f32]) {
        if self.design.rewards.is_empty() {
            return;
        }
        let now = session.simulation().measurements().numbers();
        for (agent, measure, weight) in &self.design.rewards {
            let Some(index) = self.design.agents.iter().position(|own| own == agent) else {
                continue;
            };
            let number = |of: &BTreeMap<String, f64>| of.get(measure).copied();
            // A measure that has no number yet has not changed.
            if let Some(number_now) = number(&now) {
                let change = number_now - number(&self.measured).unwrap_or(0.0);
                rewards[index] += (change * weight) as f32;
            }
        }
        self.measured = now;
    }

    fn perceive(&self, session: &SteppedRun, observations: &mut [f32]) {
        let rows = observations.chunks_mut(self.row());
        for (agent, row) in self.design.agents.iter().zip(rows) {
            row.fill(0.0);
            let mut numbers = row.iter_mut();
            let _absent = session.perceive(agent, |cars| {
                self.observe(cars, &mut |number| {
                    if let Some(place) = numbers.next() {
                        *place = number as f32;
                    }
                });
            });
        }
    }

    /// Gives the numbers of a row one after the other, as [`Self::labels`] names them.
    fn observe(&self, cars: &mut Cars<'_>, add: &mut dyn FnMut(f64)) {
        let welcome = cars.welcome();
        let [width_m, height_m] = welcome.field_m;
        let here = cars.location();
        add(1.0);
        add(here.x / width_m);
        add(here.y / height_m);
        if let Some(pose) = cars.pose() {
            add(libm::cos(pose.heading_rad));
            add(libm::sin(pose.heading_rad));
            add(pose.velocity.linear_mps);
            add(pose.velocity.angular_radps);
        } else {
            (0..4).for_each(|_| add(0.0));
        }
        add(f64::from(u8::from(cars.was_blocked())));
        let taken = cars.site_results().iter();
        add(taken.filter(|result| result.refused.is_none()).count() as f64);
        add(cars.tick() as f64 / self.scenario.ticks.max(1) as f64);

        let range_m = welcome.sensing_range_m;
        self.observe_bodies(cars, here, range_m, add);
        self.observe_sites(cars, here, range_m, add);
        if let (true, Some(rays)) = (self.design.ranges, welcome.rays) {
            for distance_m in cars.ranges() {
                add(distance_m / rays.range_m);
            }
        }
        self.observe_peers(cars, add);
    }

    fn observe_bodies(&self, cars: &Cars<'_>, here: Point, range_m: f64, add: &mut dyn FnMut(f64)) {
        if self.design.bodies == 0 {
            return;
        }
        let mut bodies: Vec<(f64, Point, SensedKind)> = Vec::new();
        for body in cars.bodies() {
            bodies.push((here.distance_m(body.location), body.location, body.kind));
        }
        // Those at the same distance stay in the order in which they are sensed, which is fixed.
        bodies.sort_by(|one, other| one.0.total_cmp(&other.0));
        for index in 0..self.design.bodies {
            let Some((_, at, kind)) = bodies.get(index) else {
                (0..6).for_each(|_| add(0.0));
                continue;
            };
            add(1.0);
            add((at.x - here.x) / range_m);
            add((at.y - here.y) / range_m);
            for is in [SensedKind::Guest, SensedKind::Robot, SensedKind::Obstacle] {
                add(f64::from(u8::from(*kind == is)));
            }
        }
    }

    fn observe_sites(&self, cars: &Cars<'_>, here: Point, range_m: f64, add: &mut dyn FnMut(f64)) {
        let variable = self.design.site_variable.as_ref();
        let mut sites: Vec<(f64, Point, f64)> = Vec::new();
        for site in cars.sites() {
            let value = variable.and_then(|variable| site.state.get(variable));
            let value = value.and_then(Variable::as_f64).unwrap_or(0.0);
            sites.push((here.distance_m(site.location), site.location, value));
        }
        sites.sort_by(|one, other| one.0.total_cmp(&other.0));
        for index in 0..self.design.sites {
            let Some((_, at, value)) = sites.get(index) else {
                (0..4).for_each(|_| add(0.0));
                continue;
            };
            add(1.0);
            add((at.x - here.x) / range_m);
            add((at.y - here.y) / range_m);
            add(*value);
        }
    }

    fn observe_peers(&self, cars: &mut Cars<'_>, add: &mut dyn FnMut(f64)) {
        let design = &self.design;
        let [width_m, height_m] = cars.welcome().field_m;
        for peer in &design.peers {
            // One that cannot be reached in this tick is unknown, as for any robot that queries.
            let state = cars.get_robot_state(peer.as_str()).ok();
            let state = state.as_deref();
            add(f64::from(u8::from(state.is_some())));
            add(state.map_or(0.0, |state| state.location.x / width_m));
            add(state.map_or(0.0, |state| state.location.y / height_m));
            add(state.map_or(0.0, |state| state.speed_mps));
            for emotion in &design.emotions {
                let feels = state.is_some_and(|state| state.emotion_state == *emotion);
                add(f64::from(u8::from(feels)));
            }
            for behavior in &design.behaviors {
                let does = state.is_some_and(|state| state.behavior_state == *behavior);
                add(f64::from(u8::from(does)));
            }
            for said in &design.hears {
                let mut commands = cars.commands().iter();
                let has_said = commands.any(|one| one.from == *peer && one.text == *said);
                add(f64::from(u8::from(has_said)));
            }
        }
    }

    /// What an agent does that is told these numbers: its velocity, and what it says. With wheels that is how fast it goes and turns, as
    /// parts of its limits; half a turn in a second where it has none.
    fn agent_step(&self, cars: &Cars<'_>, action: &[f32]) -> AgentStep {
        let [one, other] = [action[0], action[1]].map(|part| f64::from(part).clamp(-1.0, 1.0));
        let moved = match cars.welcome().drive {
            Some(limits) => Action::drive(
                cars,
                one * limits.max_speed_mps,
                other * limits.max_turn_radps.unwrap_or(PI),
            ),
            None => self.go(cars, one, other),
        };

        let mut commands = Vec::new();
        // 0 says nothing; what is between two numbers is the nearer one.
        let said = action.get(2).map_or(0.0, |number| number.round());
        if said >= 1.0
            && let Some(command) = self.design.says.get(said as usize - 1)
        {
            commands.push(command.clone());
        }
        AgentStep {
            action: moved,
            commands,
        }
    }

    fn go(&self, cars: &Cars<'_>, x: f64, y: f64) -> Action {
        // A corner of the square is no faster than its sides.
        let longer = (x * x + y * y).sqrt().max(1.0);
        let [x_mps, y_mps] = [x, y].map(|part| part / longer * self.design.speed_mps);
        let here = cars.location();
        let goal = Point::new(
            here.x + x_mps * cars.tick_s(),
            here.y + y_mps * cars.tick_s(),
        );
        Action::go(cars, goal, (x_mps * x_mps + y_mps * y_mps).sqrt())
    }
}

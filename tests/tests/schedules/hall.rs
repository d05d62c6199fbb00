//! The scenarios of the schedules, and the same runs without a network.

use std::path::Path;
use std::sync::Arc;

use environment::Simulation;
use protocol::messages::StateVariables;
use protocol::random::unit;
use protocol::{Epoch, RobotName, RunName, Tick};
use robot::{Action, BadParameters, Cars, LocalHost, Payload, Robot, Variable};
use scenario::Changes;
use scenario::Scenario;
use scenario::diagnostic::Source;

/// Ticks of every epoch.
pub(crate) const TICKS: Tick = 40;
/// Text of a state variable that makes a state large, bytes.
const BALLAST: usize = 4_000;

/// The scenarios: each with the seed of its first epoch, and another one for those that follow.
pub(crate) struct Halls {
    scenarios: Vec<[Scenario; 2]>,
    digests: Vec<[String; 2]>,
}

impl Halls {
    pub(crate) fn new() -> Self {
        let makers: [fn(u64) -> Scenario; 4] = [two, two, three, gossips];
        let mut scenarios = Vec::new();
        for (index, make) in (0..).zip(makers) {
            scenarios.push([make(index), make(index + 100)]);
        }
        let digests = scenarios
            .iter()
            .map(|[first, next]| [digest_of(first), digest_of(next)])
            .collect();

        Self { scenarios, digests }
    }

    pub(crate) fn count(&self) -> usize {
        self.scenarios.len()
    }

    pub(crate) fn scenario(&self, hall: usize, epoch: Epoch) -> &Scenario {
        &self.scenarios[hall][usize::from(epoch > 1)]
    }

    /// The digest of the run whose robots are called directly.
    pub(crate) fn digest(&self, hall: usize, epoch: Epoch) -> &str {
        &self.digests[hall][usize::from(epoch > 1)]
    }
}

/// A shipped scenario with changes.
fn scenario(file: &str, seed: u64, set: &[&str]) -> Scenario {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut changes = Changes {
        seed: Some(seed),
        ..Changes::default()
    };
    for change in set {
        changes.set.push(change.parse().expect("a legal change"));
    }

    Scenario::load(&root.join(file), &changes).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// Something happens within [`TICKS`]: few treats, eager guests, commands that are repeated.
const EAGER: [&str; 8] = [
    "duration=20 s",
    "guests.count=10",
    "record.log=false",
    "record.frames=false",
    "robot.Butler.params.treat_capacity=6",
    "robot.Butler.params.treat_mean_s=0.5 s",
    "robot.Butler.params.resend=on",
    "robot.Butler.params.resend_s=2 s",
];

fn two(seed: u64) -> Scenario {
    scenario("configs/hors_doeuvres.toml", seed, &EAGER)
}

fn three(seed: u64) -> Scenario {
    scenario("configs/three_robots.toml", seed, &EAGER)
}

/// Robots that command and query all others in every tick, over a network that is cut and loses some of it.
fn gossips(seed: u64) -> Scenario {
    let mut text = format!("seed = {seed}\ntick = \"0.5 s\"\nduration = \"20 s\"\n");
    text += "[field]\nsize = [\"20 m\", \"20 m\"]\nbody = \"0.5 m\"\n[guests]\ncount = 3\n";
    for (index, name) in ["Ada", "Bo", "Cyd", "Dee"].iter().enumerate() {
        text += &format!(
            "[[robot]]\nname = \"{name}\"\nclass = \"Gossip\"\nat = [\"{} m\", \"3 m\"]\n",
            3 * index + 3
        );
    }
    let source = Source {
        name: "gossips".to_owned(),
        text,
    };

    Scenario::parse(&source, Path::new(".")).unwrap_or_else(|error| panic!("{error}"))
}

/// A robot of a class.
pub(crate) fn make(class: &str) -> Box<dyn Robot> {
    if class == "Gossip" {
        return Box::new(Gossip::default());
    }

    robots::make(class).expect("a shipped class")
}

/// Commands and queries all others, counts what it perceives, and has a state that is sometimes large.
#[derive(Default)]
struct Gossip {
    known: f64,
}

impl Robot for Gossip {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::default();
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let own = cars.welcome().name.clone();
        let others: Vec<RobotName> = cars
            .welcome()
            .roster
            .iter()
            .filter(|name| **name != own)
            .cloned()
            .collect();
        for command in cars.commands() {
            self.known += command.text.len() as f64;
            let payload: Option<f64> = command.payload.as_ref().and_then(|sum| sum.read().ok());
            self.known += payload.unwrap_or_default() % 3.0;
        }
        for other in &others {
            if let Ok(state) = cars.get_robot_state(other.as_str()) {
                self.known += state
                    .state_variables
                    .get("known")
                    .and_then(Variable::as_f64)
                    .unwrap_or_default()
                    % 7.0;
            }
            if unit(cars.random()) < 0.5 {
                let text = format!("{} knows {}", own, self.known);
                cars.set_robot_command(other.as_str(), text)
                    .expect("it is of the roster");
            }
        }

        if unit(cars.random()) < 0.2 {
            cars.broadcast("sum", Payload::new(self.known.into()));
        }

        let mut action = Action::stay(cars)
            .emotion(if self.known % 2.0 < 1.0 {
                "CALM"
            } else {
                "CURIOUS"
            })
            .behavior("GOSSIP")
            .variable("known", self.known);
        if unit(cars.random()) < 0.05 {
            for index in 0..8 {
                action = action.variable(format!("ballast {index}"), "x".repeat(BALLAST));
            }
        }
        action.proposal.x += unit(cars.random()) * 0.2 - 0.1;
        action
    }

    fn resume(&mut self, _: &mut Cars<'_>, last: &StateVariables) {
        self.known = last
            .get("known")
            .and_then(Variable::as_f64)
            .unwrap_or_default();
    }
}

/// The digest of a run whose robots are called directly.
fn digest_of(scenario: &Scenario) -> String {
    assert_eq!(scenario.ticks, TICKS);
    let run = RunName::new("schedule").expect("a legal name");
    let mut simulation = Simulation::new(scenario.clone(), 1).expect("the hall can be set up");
    let mut runners = Vec::new();
    for (name, spec) in &scenario.robots {
        let robot = make(&spec.class);
        simulation.list_bodies(name, robot.senses_bodies());
        runners.push((
            robot,
            simulation
                .welcome(&run, name, 1, None)
                .expect("it is of the roster"),
        ));
    }
    let mut robots = LocalHost::new(runners);

    simulation
        .init(&mut robots)
        .expect("the parameters are good");
    let mut delivered = 0;
    for _ in 0..TICKS {
        let record = simulation.step(&mut robots).expect("only tick 0 can fail");
        for event in record.events.iter() {
            delivered += u32::from(matches!(event, environment::Event::CommandDelivered { .. }));
        }
    }
    assert!(
        delivered > 0,
        "nothing would be shown by a run without commands"
    );
    simulation.digest()
}

/// Shared by all schedules of a test.
pub(crate) fn halls() -> Arc<Halls> {
    Arc::new(Halls::new())
}

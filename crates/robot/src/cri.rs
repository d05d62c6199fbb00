//! What a robot implements: one method from what it perceives to what it does.

use std::f64::consts::PI;

use protocol::messages::{
    LayerAction, Panel, Point, SiteAction, StateVariables, Variable, Velocity,
};

use crate::cars::Cars;
use crate::error::{BadParameters, ParametersCheck};

/// A robot.
///
/// The SDK calls [`init`](Robot::init), then [`tick`](Robot::tick) once for every tick of the run, beginning with
/// tick 0. Everything a robot perceives is in [`Cars`]; everything it does is in the [`Action`] that it returns and in
/// the commands it sent on the way. Its state between ticks is its own.
///
/// A robot with emotions implements [`CarsRobotInterface`](crate::CarsRobotInterface) as well, in which emotion and behavior
/// have a method each, and its `tick` is [`control_cycle`](crate::control_cycle).
pub trait Robot: Send {
    /// Returns to the initial state. Called before tick 0, at every start of a new epoch, and in the middle of an epoch
    /// when the robot takes part again after it was lost, in the same process or in another one.
    ///
    /// # Errors
    /// [`BadParameters`] if the robot cannot work with the parameters of the scenario. At the beginning of an epoch that ends
    /// the run. In the middle of one, where parameters have changed, the error becomes a line of the log, and `init` is called
    /// again with those before.
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters>;

    /// Runs one tick. At tick 0 the robot stands at its start, no command has arrived, and other robots cannot be
    /// queried yet.
    fn tick(&mut self, cars: &mut Cars<'_>) -> Action;

    /// Continues from the state variables that the robot published last, before it was lost. Called after
    /// [`init`](Robot::init). By default the robot starts afresh.
    fn resume(&mut self, _cars: &mut Cars<'_>, _last: &StateVariables) {}

    /// A copy of the robot that goes on as it does, so that a run in one process can branch without being executed again
    /// from its start. By default `None`: there is no copy.
    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        None
    }

    /// The robot's stream ([`Cars::random`]) is another one from this tick on, because the run is re-seeded. Called before
    /// [`tick`](Robot::tick). A robot that keeps streams which it has split from it splits them anew; any other one has
    /// nothing to do, which is the default.
    fn reseed(&mut self, _cars: &mut Cars<'_>) {}

    /// Whether the robot perceives all bodies around it ([`Cars::bodies`]): its news are larger then.
    fn senses_bodies(&self) -> bool {
        false
    }

    /// Whether the robot perceives the distances along the rays of the scenario ([`Cars::ranges`]): its news are larger then.
    fn senses_ranges(&self) -> bool {
        false
    }

    /// Whether `init`, `resume` and every tick take some milliseconds at most. Then they may run on the thread on which messages
    /// arrive, which gives up to twice the ticks per second. That thread also keeps the process connected: one that is held
    /// for more than a second may be taken for lost. By default not: robots run on a thread of their own and may take any time.
    ///
    /// A robot that waits for another robot's answer holds nothing up in either case.
    fn is_quick(&self) -> bool {
        false
    }

    /// How parameters are checked before they change: a change by hand, or one that the scenario plans, is then refused before
    /// anything happens. Called on any thread. By default not at all: `init` finds out.
    fn parameters_check(&self) -> Option<ParametersCheck> {
        None
    }

    /// What the console shows of the robot (the paper's `paintComponent`). By default nothing.
    fn panel(&self) -> Panel {
        Panel::default()
    }
}

/// What a robot does in a tick, and what it publishes: other robots receive it when they query the robot during the
/// next tick.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Action {
    /// Where the robot wants to stand at the next tick, meters. If the place is taken, it stays where it is, and
    /// [`Cars::was_blocked`] holds in the next tick.
    pub proposal: Point,
    /// Magnitude of its velocity, m/s.
    pub speed_mps: f64,
    /// Direction of motion, radians counter-clockwise from the x axis.
    pub direction_rad: f64,
    /// Name of its emotion.
    pub emotion_state: String,
    /// Name of its behavior.
    pub behavior_state: String,
    /// Further variables that it publishes.
    pub state_variables: StateVariables,
    /// What it does to sites, in this order. What became of it is in [`Cars::site_results`] in the next tick.
    pub site_actions: Vec<SiteAction>,
    /// What it does to layers, in this order. What became of it is in [`Cars::layer_results`] in the next tick.
    pub layer_actions: Vec<LayerAction>,
    /// The velocity that the robot wants, if the scenario has it drive like wheels: it counts in the place of the proposal. See
    /// [`Action::drive`].
    pub velocity: Option<Velocity>,
}

impl Action {
    /// Stay here. Emotion and behavior have no name yet, and no variable is published: see [`Action::emotion`],
    /// [`Action::behavior`] and [`Action::variable`].
    #[must_use]
    pub fn stay(cars: &Cars<'_>) -> Self {
        Self {
            proposal: cars.location(),
            ..Self::default()
        }
    }

    /// Go straight toward `goal` and stop there. The published speed is `speed_mps` also in the last step, which may be
    /// shorter; at the goal it is 0.
    #[must_use]
    pub fn go(cars: &Cars<'_>, goal: Point, speed_mps: f64) -> Self {
        let here = cars.location();
        let distance_m = here.distance_m(goal);
        if distance_m == 0.0 {
            return Self::stay(cars);
        }

        let toward = (
            (goal.x - here.x) / distance_m,
            (goal.y - here.y) / distance_m,
        );
        let step_m = speed_mps * cars.tick_s();
        let proposal = if distance_m <= step_m {
            goal
        } else {
            Point::new(here.x + toward.0 * step_m, here.y + toward.1 * step_m)
        };

        Self {
            proposal,
            speed_mps,
            direction_rad: libm::atan2(toward.1, toward.0),
            ..Self::default()
        }
    }

    /// Drive: forward at `linear_mps` (backward if it is negative), and turn counter-clockwise at `angular_radps`. For robots that
    /// the scenario gives a `drive`, which have a [`Cars::pose`]: the simulator applies the robot's limits, and moves it. The
    /// published speed is the one that is wanted.
    #[must_use]
    pub fn drive(cars: &Cars<'_>, linear_mps: f64, angular_radps: f64) -> Self {
        let heading_rad = cars.pose().map_or(0.0, |pose| pose.heading_rad);
        let direction_rad = if linear_mps >= 0.0 {
            heading_rad
        } else if heading_rad > 0.0 {
            heading_rad - PI
        } else {
            heading_rad + PI
        };

        Self {
            speed_mps: linear_mps.abs(),
            direction_rad,
            velocity: Some(Velocity {
                linear_mps,
                angular_radps,
            }),
            ..Self::stay(cars)
        }
    }

    /// Publishes this emotion.
    #[must_use]
    pub fn emotion(mut self, name: impl Into<String>) -> Self {
        self.emotion_state = name.into();
        self
    }

    /// Publishes this behavior.
    #[must_use]
    pub fn behavior(mut self, name: impl Into<String>) -> Self {
        self.behavior_state = name.into();
        self
    }

    /// Does this to a site.
    #[must_use]
    pub fn on_site(mut self, action: SiteAction) -> Self {
        self.site_actions.push(action);
        self
    }

    /// Does this to a layer.
    #[must_use]
    pub fn on_layer(mut self, action: LayerAction) -> Self {
        self.layer_actions.push(action);
        self
    }

    /// Publishes this state variable. A number must be finite: JSON has no NaN, so another one is dropped and logged.
    #[must_use]
    pub fn variable(mut self, name: impl AsRef<str>, value: impl Into<Variable>) -> Self {
        self.state_variables.insert(name, value.into());
        self
    }
}

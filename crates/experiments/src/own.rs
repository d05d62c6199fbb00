//! Robots of the caller's own, which play in this process beside those of the project.

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::Arc;

use robot::{Robot, RobotName};

/// Makes robots for one run after another, also for several at the same time.
pub trait RobotSource: Debug + Send + Sync {
    /// What makes the robots of one run.
    fn begin(&self) -> Box<dyn RunRobots + '_>;
}

/// Makes the robots of one run.
pub trait RunRobots {
    /// Makes a robot of a name and a class; `None` if there are no such robots, or it cannot be made.
    fn make(&self, name: &RobotName, class: &str) -> Option<Box<dyn Robot>>;

    /// Why a robot of the run could not be made or has failed, for people, where that says more than the error of the run.
    fn failure(&self) -> Option<String> {
        None
    }
}

/// Makes a robot of a class; `None` if it makes no robots of that class.
pub type Maker = fn(&str) -> Option<Box<dyn Robot>>;

/// Makes robots by their classes alone.
#[derive(Debug, Clone, Copy)]
pub struct ByClass(pub Maker);

impl ByClass {
    /// The robots of the project.
    #[must_use]
    pub fn of_project() -> Arc<dyn RobotSource> {
        Arc::new(Self(robots::make))
    }
}

impl RobotSource for ByClass {
    fn begin(&self) -> Box<dyn RunRobots + '_> {
        Box::new(*self)
    }
}

impl RunRobots for ByClass {
    fn make(&self, _: &RobotName, class: &str) -> Option<Box<dyn Robot>> {
        (self.0)(class)
    }
}

/// Robots of the caller's own.
#[derive(Debug, Clone)]
pub struct OwnRobots {
    /// Digests of their programs, by the names or patterns of the robots. They are a part of the identity of a unit: an edited
    /// robot plays again.
    pub digests: BTreeMap<String, String>,
    /// What makes them, and all other robots of the scenario.
    pub source: Arc<dyn RobotSource>,
}

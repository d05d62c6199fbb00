//! What a tick comes to, and the seam between a simulation and its robots.

use std::collections::{BTreeMap, BTreeSet};

use protocol::messages::Target;
use protocol::{Generation, RobotName, Tick};

/// A tick as the simulation sees it: news go out, reports come back.
///
/// In one process it is a function call. Over the bus the same two steps are spread over time.
pub trait Exchange<N, R, C> {
    /// Why a tick was given up.
    type Error;

    /// Grants a tick with its news, and returns what it came to when every robot has answered.
    ///
    /// # Errors
    /// The reason, if the tick cannot be completed.
    fn exchange(
        &mut self,
        tick: Tick,
        news: &dyn Bulletin<N>,
    ) -> Result<TickOutcome<R, C>, Self::Error>;
}

/// The incarnations that a robot's news name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct IncarnationNotice {
    /// The incarnation that takes part from this tick on.
    pub joined: Option<Generation>,
    /// The incarnation that takes part no more, and whose process is to join again.
    pub rejoin: Option<Generation>,
}

/// The news of a tick. Those of a robot are composed when it is known which incarnations they name.
pub trait Bulletin<N> {
    /// The robots for which something is new, whatever their incarnations.
    fn robots(&self) -> BTreeSet<RobotName>;

    /// The news of a robot, with the incarnations that they name.
    fn compose(&self, robot: &RobotName, notice: IncarnationNotice) -> N;
}

impl<N: Clone + Default> Bulletin<N> for BTreeMap<RobotName, N> {
    fn robots(&self) -> BTreeSet<RobotName> {
        self.keys().cloned().collect()
    }

    fn compose(&self, robot: &RobotName, _: IncarnationNotice) -> N {
        self.get(robot).cloned().unwrap_or_default()
    }
}

/// What a complete tick came to.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct TickOutcome<R, C> {
    /// Reports with the commands of the tick, by robot; a robot that missed the tick has none.
    pub reports: BTreeMap<RobotName, (R, Vec<Sent<C>>)>,
    /// Robots that began or ceased to take part, in a fixed order.
    pub membership: Vec<Membership>,
}

impl<R, C> Default for TickOutcome<R, C> {
    fn default() -> Self {
        Self {
            reports: BTreeMap::new(),
            membership: Vec::new(),
        }
    }
}

/// A command that a robot sent.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Sent<C> {
    /// The target, as the sender named it. A broadcast is one command here.
    pub to: Target,
    /// The content.
    pub command: C,
}

/// A robot began or ceased to take part.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Membership {
    /// An incarnation takes part from this tick on.
    Joined(RobotName, Generation),
    /// A robot takes part no more from this tick on.
    Lost(RobotName),
}

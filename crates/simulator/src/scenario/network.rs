//! `[network]`: the network between the robots as an experimental variable.

use protocol::{RobotName, Tick};
use world::Triangular;

/// The network between robots. Its chance is drawn from the seed, message by message.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Network {
    /// What befalls commands on links that no entry of `links` says something else about.
    pub commands: Channel,
    /// What befalls queries; delay and duplication mean nothing for them.
    pub queries: Channel,
    /// What befalls messages on one link; a later entry for the same link counts.
    pub links: Vec<Link>,
    /// When who is cut off from whom.
    pub partitions: Vec<Partition>,
}

/// What befalls messages of one kind on a link, message by message.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Channel {
    /// Probability that a message is lost, 0 to 1.
    pub loss: f64,
    /// Probability that a message arrives twice, 0 to 1.
    pub duplication: f64,
    /// How much later than at the next tick a message arrives, seconds; `None` is not at all.
    pub delay_s: Option<Triangular>,
    /// Times in which more is lost than at others.
    pub burst: Option<Burst>,
}

/// Bursts of loss: a link is good or bad, and changes with these probabilities from one tick to the next (Gilbert 1960,
/// Elliott 1963).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Burst {
    /// Probability that a good link turns bad at a tick.
    pub enter: f64,
    /// Probability that a bad link turns good at a tick.
    pub leave: f64,
    /// Probability that a message on a bad link is lost.
    pub loss: f64,
}

/// One directed link.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// The sender, or who asks.
    pub from: RobotName,
    /// The target, or who is asked.
    pub to: RobotName,
    /// What befalls commands on it; as everywhere else if nothing is said.
    pub commands: Option<Channel>,
    /// What befalls queries on it; as everywhere else if nothing is said.
    pub queries: Option<Channel>,
}

/// A time in which nothing passes between groups of robots. Robots of no group are not concerned.
#[derive(Debug, Clone, PartialEq)]
pub struct Partition {
    /// Who can still reach one another.
    pub groups: Vec<Vec<RobotName>>,
    /// First tick of it.
    pub from: Tick,
    /// First tick after it; `None` if it lasts to the end.
    pub until: Option<Tick>,
    /// Whether only earlier groups are cut off from later ones, and not the other way.
    pub one_way: bool,
    /// Whether commands are cut.
    pub commands: bool,
    /// Whether queries are cut.
    pub queries: bool,
}

impl Network {
    /// What befalls commands from one robot to another.
    #[must_use]
    pub fn commands(&self, from: &RobotName, to: &RobotName) -> Channel {
        self.last_said(from, to, |link| link.commands)
            .unwrap_or(self.commands)
    }

    /// What befalls queries of one robot to another.
    #[must_use]
    pub fn queries(&self, from: &RobotName, to: &RobotName) -> Channel {
        self.last_said(from, to, |link| link.queries)
            .unwrap_or(self.queries)
    }

    fn last_said(
        &self,
        from: &RobotName,
        to: &RobotName,
        what: impl Fn(&Link) -> Option<Channel>,
    ) -> Option<Channel> {
        let on_link = self
            .links
            .iter()
            .rev()
            .filter(|link| link.from == *from && link.to == *to);

        on_link.filter_map(what).next()
    }

    /// Whether anything is ever said about queries, so that a verdict on them is worth its cost.
    #[must_use]
    pub fn touches_queries(&self) -> bool {
        let own = self.queries != Channel::default();
        own || self.links.iter().any(|link| link.queries.is_some())
    }

    /// Whether any link has bursts, so that their coming and going is worth its cost.
    #[must_use]
    pub fn has_bursts(&self) -> bool {
        let on_links = self
            .links
            .iter()
            .flat_map(|link| [link.commands, link.queries])
            .flatten();
        on_links
            .chain([self.commands, self.queries])
            .any(|channel| channel.burst.is_some())
    }

    /// How long a command may be on its way, ticks.
    #[must_use]
    pub fn longest_delay(&self, tick_s: f64) -> Tick {
        let channels = self
            .links
            .iter()
            .filter_map(|link| link.commands)
            .chain([self.commands]);
        let longest_s = channels
            .filter_map(|channel| Some(channel.delay_s?.max()))
            .fold(0.0, f64::max);
        ticks(longest_s, tick_s)
    }
}

impl Partition {
    /// Whether it lasts at a tick.
    #[must_use]
    pub fn lasts_at(&self, tick: Tick) -> bool {
        self.from <= tick && self.until.is_none_or(|until| tick < until)
    }

    /// Whether it stands between two robots, in this direction.
    #[must_use]
    pub fn separates(&self, from: &RobotName, to: &RobotName) -> bool {
        let group = |robot| self.groups.iter().position(|group| group.contains(robot));
        match (group(from), group(to)) {
            (Some(own), Some(other)) if self.one_way => own < other,
            (Some(own), Some(other)) => own != other,
            _ => false,
        }
    }
}

/// A time as whole ticks, the nearest ones.
pub(crate) fn ticks(time_s: f64, tick_s: f64) -> Tick {
    (time_s / tick_s).round() as Tick
}

//! `[network]`: loss, delay and partitions of the network between the robots.

use protocol::{RobotName, Tick};
use radio::{RadioModel, Transmitter};
use world::Triangular;

/// The network between the robots. Every message draws its own random numbers from the seed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Network {
    /// Loss and delay of commands on links without a rule in `links`.
    pub commands: Channel,
    /// Loss of queries on links without a rule in `links`. Queries have no delay and no duplication.
    pub queries: Channel,
    /// Rules of single links; of two rules for the same link, the later one holds.
    pub links: Vec<LinkRule>,
    /// Partitions of the network.
    pub partitions: Vec<Partition>,
    /// Single commands of which the scenario says what becomes of them.
    pub named: Vec<NamedCommand>,
    /// The robots' radios; `None` where distance and the length of messages do not matter.
    pub radio: Option<Radio>,
}

/// The radios of the robots, which are all the same.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Radio {
    /// Greatest distance between the centers of two robots at which a message passes, whatever its power, meters; `None` for any.
    pub range_m: Option<f64>,
    /// What power messages arrive with; `None` if all have enough.
    pub model: Option<RadioModel>,
    /// How fast commands are sent; `None` if that takes no time.
    pub transmitter: Option<Transmitter>,
}

impl Radio {
    /// The distance up to which messages pass without anything in their way, shadowing and fading, meters; `None` for any distance.
    #[must_use]
    pub fn reach_m(&self) -> Option<f64> {
        let nominal_m = self.model.as_ref().map(RadioModel::nominal_range_m);
        match (self.range_m, nominal_m) {
            (Some(range_m), Some(nominal_m)) => Some(range_m.min(nominal_m)),
            (range_m, nominal_m) => range_m.or(nominal_m),
        }
    }
}

/// A single command to which something happens, whatever chance decides. Commands are counted over the epoch, whatever incarnation
/// of the sender sent them and whatever became of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedCommand {
    /// Which commands are counted.
    pub counted: Counted,
    /// Number of the named one among them, from 1.
    pub number: u64,
    /// What happens to it.
    pub fate: NamedFate,
}

/// What happens to a command that the scenario names. Of the fates of a command, `Lost` is the strongest, then the longest delay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NamedFate {
    /// It is lost.
    Lost,
    /// It arrives this much later than without the entry, ticks.
    Late(Tick),
    /// It arrives twice.
    Doubled,
}

/// A set of commands.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Counted {
    /// Their sender.
    pub from: RobotName,
    /// Their target.
    pub to: RobotName,
    /// Their text; `None` for all texts.
    pub text: Option<String>,
}

/// Loss, duplication and delay of messages of one kind on a link.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Channel {
    /// Probability that a message is lost, 0 to 1.
    pub loss: f64,
    /// Probability that a message arrives twice, 0 to 1.
    pub duplication: f64,
    /// Additional delay after the next tick, seconds; `None` for no delay.
    pub delay_s: Option<Triangular>,
    /// Bursts of loss.
    pub burst: Option<Burst>,
}

/// Bursts of loss: a link is good or bad, and changes with these probabilities at every tick (Gilbert 1960, Elliott 1963).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Burst {
    /// Probability that a good link turns bad at a tick.
    pub enter: f64,
    /// Probability that a bad link turns good at a tick.
    pub leave: f64,
    /// Probability that a message on a bad link is lost.
    pub loss: f64,
}

/// Rules of one directed link.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkRule {
    /// Sender of commands and queries.
    pub from: RobotName,
    /// Target of commands and queries.
    pub to: RobotName,
    /// Loss and delay of commands, instead of those of the network.
    pub commands: Option<Channel>,
    /// Loss of queries, instead of that of the network.
    pub queries: Option<Channel>,
}

/// A partition: for some time no messages pass between groups of robots. Robots in no group are not affected.
#[derive(Debug, Clone, PartialEq)]
pub struct Partition {
    /// Groups of robots that can reach each other.
    pub groups: Vec<Vec<RobotName>>,
    /// First tick of the partition.
    pub from: Tick,
    /// First tick after the partition; `None` if it lasts to the end of the run.
    pub until: Option<Tick>,
    /// Whether only messages from earlier to later groups are cut.
    pub one_way: bool,
    /// Whether commands are cut.
    pub commands: bool,
    /// Whether queries are cut.
    pub queries: bool,
}

impl Network {
    /// Loss and delay of commands from one robot to another.
    #[must_use]
    pub fn commands(&self, from: &RobotName, to: &RobotName) -> Channel {
        let rule = self.rules(from, to).find_map(|rule| rule.commands);
        rule.unwrap_or(self.commands)
    }

    /// Loss of queries from one robot to another.
    #[must_use]
    pub fn queries(&self, from: &RobotName, to: &RobotName) -> Channel {
        let rule = self.rules(from, to).find_map(|rule| rule.queries);
        rule.unwrap_or(self.queries)
    }

    /// The rules of a link, the last one first.
    fn rules(&self, from: &RobotName, to: &RobotName) -> impl Iterator<Item = &LinkRule> {
        let last_first = self.links.iter().rev();
        last_first.filter(move |rule| rule.from == *from && rule.to == *to)
    }

    /// Whether any link can lose queries. If not, the medium need not decide about them.
    #[must_use]
    pub fn touches_queries(&self) -> bool {
        let own = self.queries != Channel::default();
        own || self.links.iter().any(|link| link.queries.is_some())
    }

    /// Whether any link has bursts.
    #[must_use]
    pub fn has_bursts(&self) -> bool {
        self.channels().any(|channel| channel.burst.is_some())
    }

    /// All that is said of commands and of queries, of single links and of the others.
    pub fn channels(&self) -> impl Iterator<Item = &Channel> {
        let links = self.links.iter();
        let own = links.flat_map(|link| [&link.commands, &link.queries]);
        own.flatten().chain([&self.commands, &self.queries])
    }
}

impl Partition {
    /// Whether it lasts at a tick.
    #[must_use]
    pub fn lasts_at(&self, tick: Tick) -> bool {
        self.from <= tick && self.until.is_none_or(|until| tick < until)
    }

    /// Whether it cuts messages from one robot to another.
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

/// A time in ticks, rounded to the nearest.
pub fn ticks(time_s: f64, tick_s: f64) -> Tick {
    (time_s / tick_s).round() as Tick
}

//! The faults of a plan: what each is, in types and in words.

use protocol::messages::Point;
use protocol::{RobotName, Tick};
use serde::Serialize;

use super::sent::{Link, SentMessage};

/// Steps of a probability: files do not show digits that mean nothing.
const CHANCE_STEPS: f64 = 100.0;

/// A kind of faults that a hunt draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultClass {
    /// One command is lost.
    Lose,
    /// One command is late.
    Late,
    /// One command arrives twice.
    Double,
    /// Messages are lost by chance.
    Loss,
    /// Messages are lost by chance in bursts.
    Burst,
    /// Commands are delayed.
    Delay,
    /// Commands arrive twice by chance.
    Duplication,
    /// No messages pass between two groups of robots.
    Partition,
    /// No messages pass from one group of robots to another.
    OneWay,
    /// A robot crashes and comes back.
    Crash,
    /// A robot hangs for a time.
    Hang,
    /// A row of obstacles stands in the way.
    Wall,
    /// There are more guests.
    Crowd,
    /// Chance is another one.
    Reseed,
}

impl FaultClass {
    /// All kinds.
    pub const ALL: [Self; 14] = [
        Self::Lose,
        Self::Late,
        Self::Double,
        Self::Loss,
        Self::Burst,
        Self::Delay,
        Self::Duplication,
        Self::Partition,
        Self::OneWay,
        Self::Crash,
        Self::Hang,
        Self::Wall,
        Self::Crowd,
        Self::Reseed,
    ];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Lose => "lose",
            Self::Late => "late",
            Self::Double => "double",
            Self::Loss => "loss",
            Self::Burst => "burst",
            Self::Delay => "delay",
            Self::Duplication => "duplication",
            Self::Partition => "partition",
            Self::OneWay => "one-way",
            Self::Crash => "crash",
            Self::Hang => "hang",
            Self::Wall => "wall",
            Self::Crowd => "crowd",
            Self::Reseed => "reseed",
        }
    }

    /// Whether it can begin in the middle of a run.
    pub(super) fn can_begin_later(self) -> bool {
        !matches!(self, Self::Wall | Self::Crowd)
    }
}

impl std::str::FromStr for FaultClass {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = Self::ALL.into_iter().find(|kind| kind.name() == text);
        named.ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|kind| kind.name()).collect();
            format!("a hunt draws {}", names.join(", "))
        })
    }
}

/// A time of a run, ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct TickSpan {
    /// First tick of the fault.
    pub from: Tick,
    /// First tick after the fault; it may be after the end of the run.
    pub until: Tick,
}

/// The messages that a fault of the network concerns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Messages {
    /// Commands.
    Commands,
    /// Queries.
    Queries,
}

impl Messages {
    /// Its name in scenario files.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Commands => "commands",
            Self::Queries => "queries",
        }
    }
}

/// What the network does to messages by chance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// Messages are lost with this probability, in hundredths.
    Loss(u64),
    /// Bursts, in which all is lost, begin and end at a tick with these probabilities, in hundredths.
    Burst(u64, u64),
    /// Commands are up to this much late, seconds.
    Delay(u64),
    /// Commands arrive twice with this probability, in hundredths.
    Duplication(u64),
}

/// Why a robot takes no part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AbsenceReason {
    /// Its process is killed, and starts again.
    Crash,
    /// Its process stands still, and goes on.
    Hang,
}

impl AbsenceReason {
    /// Its name in scenario files.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Crash => "crash",
            Self::Hang => "hang",
        }
    }
}

/// A fault of a plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "fault", rename_all = "snake_case")]
pub enum PlannedFault {
    /// One command is lost.
    Lose {
        /// The link.
        link: Link,
        /// Number of the command among those on the link, from 1.
        number: u64,
    },
    /// One command is late.
    Late {
        /// The link.
        link: Link,
        /// Number of the command among those on the link, from 1.
        number: u64,
        /// How much later it arrives, ticks.
        by: Tick,
    },
    /// One command arrives twice.
    Double {
        /// The link.
        link: Link,
        /// Number of the command among those on the link, from 1.
        number: u64,
    },
    /// The network does something by chance.
    Channel {
        /// Only on this link; `None` for all.
        link: Option<Link>,
        /// The messages that it concerns.
        of: Messages,
        /// What happens to them.
        effect: Effect,
        /// When.
        span: TickSpan,
    },
    /// A partition of two groups.
    Partition {
        /// The first group.
        one: Vec<RobotName>,
        /// The second group.
        other: Vec<RobotName>,
        /// Whether only messages from the first to the second group are cut.
        one_way: bool,
        /// What is cut, at least one.
        cuts: Vec<Messages>,
        /// When.
        span: TickSpan,
    },
    /// A robot takes no part, and is back at the end of the time.
    Absence {
        /// The robot.
        robot: RobotName,
        /// Whether it crashes or hangs.
        why: AbsenceReason,
        /// When.
        span: TickSpan,
    },
    /// Further fixed obstacles.
    Wall {
        /// Their centers, meters.
        at: Vec<Point>,
    },
    /// Another number of guests.
    Crowd {
        /// The number.
        guests: usize,
    },
    /// Chance is another one from a tick on.
    Reseed {
        /// The first tick that draws from the other streams.
        at: Tick,
        /// Their seed.
        seed: u64,
        /// The kinds of chance, as scenario files have them; empty for all.
        of: Vec<String>,
    },
}

impl PlannedFault {
    /// Its kind.
    #[must_use]
    pub fn kind(&self) -> FaultClass {
        match self {
            Self::Lose { .. } => FaultClass::Lose,
            Self::Late { .. } => FaultClass::Late,
            Self::Double { .. } => FaultClass::Double,
            Self::Channel { effect, .. } => match effect {
                Effect::Loss(_) => FaultClass::Loss,
                Effect::Burst(..) => FaultClass::Burst,
                Effect::Delay(_) => FaultClass::Delay,
                Effect::Duplication(_) => FaultClass::Duplication,
            },
            Self::Partition { one_way: true, .. } => FaultClass::OneWay,
            Self::Partition { .. } => FaultClass::Partition,
            Self::Absence { why, .. } => match why {
                AbsenceReason::Crash => FaultClass::Crash,
                AbsenceReason::Hang => FaultClass::Hang,
            },
            Self::Wall { .. } => FaultClass::Wall,
            Self::Crowd { .. } => FaultClass::Crowd,
            Self::Reseed { .. } => FaultClass::Reseed,
        }
    }

    /// The link and the number of the command, if it concerns exactly one.
    pub(super) fn command(&self) -> Option<(&Link, u64)> {
        match self {
            Self::Lose { link, number }
            | Self::Late { link, number, .. }
            | Self::Double { link, number } => Some((link, *number)),
            Self::Channel { .. }
            | Self::Partition { .. }
            | Self::Absence { .. }
            | Self::Wall { .. }
            | Self::Crowd { .. }
            | Self::Reseed { .. } => None,
        }
    }

    /// The same for another command of the link, if it concerns exactly one.
    pub(super) fn of_command(&self, other: u64) -> Self {
        let mut fault = self.clone();
        if let Self::Lose { number, .. } | Self::Late { number, .. } | Self::Double { number, .. } =
            &mut fault
        {
            *number = other;
        }
        fault
    }

    /// Whether it has begun by the end of a tick, in a run in which these commands were sent.
    pub(super) fn has_begun(&self, tick: Tick, sent: &[SentMessage]) -> bool {
        if let Some((link, number)) = self.command() {
            // The network decides on a command in the tick after it was sent.
            let mut sent = sent.iter();
            return sent.any(|message| message.is(link, number) && message.tick < tick);
        }
        match self {
            Self::Channel { span, .. }
            | Self::Partition { span, .. }
            | Self::Absence { span, .. } => span.from <= tick,
            Self::Reseed { at, .. } => *at <= tick,
            // Those before are of single commands; walls and guests are there from the beginning.
            Self::Lose { .. }
            | Self::Late { .. }
            | Self::Double { .. }
            | Self::Wall { .. }
            | Self::Crowd { .. } => true,
        }
    }

    /// The fault in a roster without a robot; `None` if nothing of it is left.
    pub(super) fn without(&self, robot: &RobotName) -> Option<Self> {
        let has = |link: &Link| link.from == *robot || link.to == *robot;
        let is_gone = match self {
            Self::Lose { link, .. } | Self::Late { link, .. } | Self::Double { link, .. } => {
                has(link)
            }
            Self::Channel { link, .. } => link.as_ref().is_some_and(has),
            Self::Absence { robot: own, .. } => own == robot,
            Self::Reseed { of, .. } => *of == [robot_chance(robot)],
            Self::Partition { .. } | Self::Wall { .. } | Self::Crowd { .. } => false,
        };
        if is_gone {
            return None;
        }

        let mut fault = self.clone();
        match &mut fault {
            Self::Partition { one, other, .. } => {
                one.retain(|name| name != robot);
                other.retain(|name| name != robot);
                if one.is_empty() || other.is_empty() {
                    return None;
                }
            }
            Self::Reseed { of, .. } => of.retain(|kind| *kind != robot_chance(robot)),
            _ => {}
        }
        Some(fault)
    }

    /// The fault at another time. Only what lasts for a time has one.
    pub(super) fn at(&self, time: TickSpan) -> Self {
        let mut fault = self.clone();
        match &mut fault {
            Self::Channel { span, .. }
            | Self::Partition { span, .. }
            | Self::Absence { span, .. } => *span = time,
            Self::Lose { .. }
            | Self::Late { .. }
            | Self::Double { .. }
            | Self::Wall { .. }
            | Self::Crowd { .. }
            | Self::Reseed { .. } => {}
        }
        fault
    }

    /// The fault in words, for people; times in simulated seconds.
    #[must_use]
    pub fn in_words(&self, tick_s: f64) -> String {
        match self {
            Self::Lose { link, number } => {
                format!("command {number} from {} to {} is lost", link.from, link.to)
            }
            Self::Late { link, number, by } => {
                let by = seconds(*by, tick_s);
                let Link { from, to } = link;
                format!("command {number} from {from} to {to} arrives {by} later")
            }
            Self::Double { link, number } => {
                let Link { from, to } = link;
                format!("command {number} from {from} to {to} arrives twice")
            }
            Self::Channel {
                link,
                of,
                effect,
                span,
            } => {
                let effect = effect.in_words(*of, link.as_ref());
                format!("{effect}, {}", span.in_words(tick_s))
            }
            Self::Partition {
                one,
                other,
                one_way,
                cuts,
                span,
            } => {
                let cuts: Vec<&str> = cuts.iter().map(|of| of.name()).collect();
                let cuts = cuts.join(" and ");
                let span = span.in_words(tick_s);
                let one = names(one);
                let other = names(other);

                if *one_way {
                    format!("no {cuts} pass from {one} to {other}, {span}")
                } else {
                    format!("no {cuts} pass between {one} and {other}, {span}")
                }
            }
            Self::Absence { robot, why, span } => {
                let state = match why {
                    AbsenceReason::Crash => "is crashed",
                    AbsenceReason::Hang => "hangs",
                };
                format!("{robot} {state}, {}", span.in_words(tick_s))
            }
            Self::Wall { at } => {
                let mut places = Vec::new();
                for at in at {
                    places.push(format!("{:.2} m, {:.2} m", at.x, at.y));
                }

                format!("further obstacles stand at {}", places.join("; "))
            }
            Self::Crowd { guests } => format!("there are {guests} guests"),
            Self::Reseed { at, seed, of } => {
                let what = match &of[..] {
                    [] => "chance".to_owned(),
                    kinds => format!("chance of {}", kinds.join(" and ")),
                };
                let at = seconds(*at, tick_s);
                format!("{what} is drawn anew from {at} on, with the seed {seed}")
            }
        }
    }
}

impl Effect {
    fn in_words(self, of: Messages, link: Option<&Link>) -> String {
        let mut messages = of.name().to_owned();
        if let Some(Link { from, to }) = link {
            messages += &format!(" from {from} to {to}");
        }

        match self {
            Self::Loss(chance) => format!("{chance} % of the {messages} are lost"),
            Self::Burst(enter, leave) => format!(
                "{messages} are lost in bursts, which begin with {enter} % and end with {leave} % at a tick"
            ),
            Self::Delay(most_s) => format!("{messages} are up to {most_s} s late"),
            Self::Duplication(chance) => format!("{chance} % of the {messages} arrive twice"),
        }
    }
}

impl TickSpan {
    fn in_words(self, tick_s: f64) -> String {
        format!(
            "from {} until {}",
            seconds(self.from, tick_s),
            seconds(self.until, tick_s)
        )
    }
}

/// The chance of a robot, as scenario files have it.
pub(super) fn robot_chance(robot: &RobotName) -> String {
    format!("robot.{robot}")
}

fn names(robots: &[RobotName]) -> String {
    let names: Vec<&str> = robots.iter().map(RobotName::as_str).collect();
    names.join(", ")
}

/// A simulated time as scenario files have it.
pub(super) fn seconds(ticks: Tick, tick_s: f64) -> String {
    let micros = (ticks as f64 * tick_s * 1e6).round();
    format!("{} s", micros / 1e6)
}

/// A probability from hundredths.
pub(super) fn chance(hundredths: u64) -> f64 {
    hundredths as f64 / CHANCE_STEPS
}

//! `[[reseed]]`: from a tick on, chance is another one. What was drawn before stays as it is.

use std::fmt::{self, Display};
use std::str::FromStr;

use protocol::messages::StreamReseed;
use protocol::pattern::RobotPattern;
use protocol::random::reseeded;
use protocol::{RobotName, Tick};
use serde::{Deserialize, Serialize};

/// What chance decides: each kind has random streams of its own, and can be drawn anew by itself.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum ChanceKind {
    /// Fates of commands, verdicts on queries, bursts.
    Network,
    /// Where guests walk.
    Guests,
    /// What robots miss, and where they err.
    Sensing,
    /// What robots draw that have this name, or match this pattern.
    Robot(RobotPattern),
}

impl FromStr for ChanceKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "network" => Ok(Self::Network),
            "guests" => Ok(Self::Guests),
            "sensing" => Ok(Self::Sensing),
            _ => match text.strip_prefix("robot.") {
                Some(name) => RobotPattern::new(name)
                    .map(Self::Robot)
                    .map_err(|error| error.to_string()),
                None => Err(format!(
                    "{text:?} is no kind of chance; the kinds are network, guests, sensing, and robot.NAME (a name or a pattern)"
                )),
            },
        }
    }
}

impl Display for ChanceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Network => f.write_str("network"),
            Self::Guests => f.write_str("guests"),
            Self::Sensing => f.write_str("sensing"),
            Self::Robot(name) => write!(f, "robot.{}", name.as_str()),
        }
    }
}

impl TryFrom<String> for ChanceKind {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<ChanceKind> for String {
    fn from(kind: ChanceKind) -> Self {
        kind.to_string()
    }
}

/// From a tick on, the random streams of some kinds are those of another seed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reseed {
    /// The first tick that draws from them.
    pub at: Tick,
    /// What they are derived from.
    pub seed: u64,
    /// The kinds; without any, all.
    pub of: Vec<ChanceKind>,
}

impl Reseed {
    fn is_of(&self, kind: &ChanceKind) -> bool {
        self.of.is_empty() || self.of.contains(kind)
    }

    /// Seed of the streams that exist for one tick only, if the network is re-seeded, and of those that last.
    #[must_use]
    pub fn of_network(&self) -> Option<[u64; 2]> {
        let lasting = format!("bursts/{}", self.at);
        let seeds = ["network", &lasting].map(|of| reseeded(self.seed, of));
        self.is_of(&ChanceKind::Network).then_some(seeds)
    }

    /// Seed of the guests' stream, if guests are re-seeded.
    #[must_use]
    pub fn of_guests(&self) -> Option<u64> {
        let of = format!("guests/{}", self.at);
        self.is_of(&ChanceKind::Guests)
            .then(|| reseeded(self.seed, &of))
    }

    /// Seed of what robots miss, if sensing is re-seeded.
    #[must_use]
    pub fn of_sensing(&self) -> Option<u64> {
        self.is_of(&ChanceKind::Sensing)
            .then(|| reseeded(self.seed, "sensing"))
    }

    /// What a robot is told, if it is re-seeded. Robots draw different numbers from the same seed, as their streams have their names.
    #[must_use]
    pub fn of_robot(&self, robot: &RobotName) -> Option<StreamReseed> {
        let mut named = self.of.iter();
        let is_named = named.any(|kind| match kind {
            ChanceKind::Robot(pattern) => pattern.matches(robot),
            _ => false,
        });
        (is_named || self.of.is_empty()).then(|| StreamReseed {
            tick: self.at,
            seed: reseeded(self.seed, &format!("robots/{}", self.at)),
        })
    }
}

/// As the record has it among what changes.
impl Display for Reseed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "reseed={{ seed = {}", self.seed)?;
        if !self.of.is_empty() {
            let of: Vec<String> = self.of.iter().map(|kind| format!("\"{kind}\"")).collect();
            write!(f, ", of = [{}]", of.join(", "))?;
        }
        f.write_str(" }")
    }
}

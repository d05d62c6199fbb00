//! `[network]`: the network between the robots as an experimental variable.

use protocol::RobotName;
use serde::{Deserialize, Serialize};

/// The network between robots. Its chance is drawn from the seed, message by message.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Network {
    /// What befalls commands on links that no entry of `links` is about.
    pub commands: Channel,
    /// What befalls commands on one link, by sender and target.
    pub links: Vec<Link>,
}

/// What befalls messages of one kind on a link.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// Probability that a message is lost, 0 to 1.
    #[serde(default)]
    pub loss: f64,
}

/// One directed link.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// The sender.
    pub from: RobotName,
    /// The target.
    pub to: RobotName,
    /// What befalls commands on it.
    pub commands: Channel,
}

impl Network {
    /// What befalls commands from one robot to another.
    #[must_use]
    pub fn commands(&self, from: &RobotName, to: &RobotName) -> Channel {
        let link = self.links.iter().rev().find(|link| link.from == *from && link.to == *to);
        link.map_or(self.commands, |link| link.commands)
    }
}

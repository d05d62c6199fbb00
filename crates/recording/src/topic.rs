//! The channels of a recording, by topic.

use std::fmt;

use protocol::RobotName;

/// A channel with messages in JSON, which the reader knows.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Topic {
    Header,
    Frame,
    Events,
    Wall,
    Report(RobotName),
    Panel(RobotName),
}

/// A channel that viewers draw.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum View {
    Field,
    Robots,
    Guests,
    Transforms,
    Log,
    Pose(RobotName),
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Field => f.write_str("/view/field"),
            Self::Robots => f.write_str("/view/robots"),
            Self::Guests => f.write_str("/view/guests"),
            Self::Transforms => f.write_str("/view/transforms"),
            Self::Log => f.write_str("/view/log"),
            Self::Pose(robot) => write!(f, "/view/pose/{robot}"),
        }
    }
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Header => f.write_str("/header"),
            Self::Frame => f.write_str("/frame"),
            Self::Events => f.write_str("/events"),
            Self::Wall => f.write_str("/wall"),
            Self::Report(robot) => write!(f, "/robot/{robot}/report"),
            Self::Panel(robot) => write!(f, "/robot/{robot}/panel"),
        }
    }
}

impl Topic {
    /// Whether what happened in a tick is on it.
    pub(crate) fn is_of_events(&self) -> bool {
        matches!(self, Self::Events | Self::Wall)
    }

    /// Parses a topic; `None` for one of the channels that only viewers read.
    pub(crate) fn parse(topic: &str) -> Option<Self> {
        match topic {
            "/header" => return Some(Self::Header),
            "/frame" => return Some(Self::Frame),
            "/events" => return Some(Self::Events),
            "/wall" => return Some(Self::Wall),
            _ => {}
        }

        let (robot, kind) = topic.strip_prefix("/robot/")?.split_once('/')?;
        let robot = RobotName::new(robot).ok()?;
        match kind {
            "report" => Some(Self::Report(robot)),
            "panel" => Some(Self::Panel(robot)),
            _ => None,
        }
    }
}

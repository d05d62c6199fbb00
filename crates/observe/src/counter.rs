//! State variables that rise with progress, each with the robots that have it: `Butler.served`, `S*.trips`, `S{1..20}.trips`.

use protocol::pattern::path_parts;
use protocol::{RobotName, RobotPattern};
use serde::Deserialize;

/// A state variable of a robot, or of all robots that a pattern matches; in a file `ROBOT.VARIABLE`.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Counter {
    /// The robots.
    pub robots: RobotPattern,
    /// Name of the variable.
    pub variable: String,
}

/// A text that is not `ROBOT.VARIABLE`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "\"{0}\" is not a state variable of a robot, such as \"Butler.served\", or of several, such as \"S*.served\""
)]
pub struct NoCounter(String);

impl TryFrom<String> for Counter {
    type Error = NoCounter;

    fn try_from(text: String) -> Result<Self, NoCounter> {
        let counter = match path_parts(&text)[..] {
            [robots, _, ..] => RobotPattern::new(robots).ok().map(|pattern| Self {
                robots: pattern,
                variable: text[robots.len() + 1..].to_owned(),
            }),
            _ => None,
        };

        counter.ok_or(NoCounter(text))
    }
}

impl std::fmt::Display for Counter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.robots, self.variable)
    }
}

/// Each variable of each robot of a roster, in the order of the counters and then of the roster.
pub(crate) fn each(counters: &[Counter], roster: &[RobotName]) -> Vec<(RobotName, String)> {
    let mut each = Vec::new();
    for counter in counters {
        let robots = roster.iter().filter(|robot| counter.robots.matches(robot));
        each.extend(robots.map(|robot| (robot.clone(), counter.variable.clone())));
    }
    each
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_counter_has_a_robot_or_a_pattern_of_robots() {
        let roster: Vec<RobotName> = ["A", "S1", "S2", "S3"]
            .iter()
            .map(|name| name.parse().unwrap())
            .collect();
        for (text, robots) in [
            ("A.v", &["A"][..]),
            ("S*.v", &["S1", "S2", "S3"]),
            ("S{1..2}.v", &["S1", "S2"]),
            ("*.v", &["A", "S1", "S2", "S3"]),
        ] {
            let counter = Counter::try_from(text.to_owned()).unwrap();
            assert_eq!(counter.to_string(), text);
            let each = each(&[counter], &roster);
            let names: Vec<&str> = each.iter().map(|(robot, _)| robot.as_str()).collect();
            assert_eq!(names, robots, "{text}");
            assert!(each.iter().all(|(_, variable)| variable == "v"));
        }
        for text in ["v", "S{1..2}v", "A/B.v", ".v", "{1..2.v"] {
            assert!(Counter::try_from(text.to_owned()).is_err(), "{text}");
        }
        let dotted = Counter::try_from("A.x.y".to_owned()).unwrap();
        assert_eq!(dotted.variable, "x.y");
    }
}

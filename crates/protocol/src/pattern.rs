//! Patterns of robots' names: a name in which each `*` stands for any number of characters, also for none.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::name::{BadName, RobotName};

/// What stands for any number of characters.
const ANY: char = '*';

/// A set of robots: one by its name, or all whose names match, as in `S*`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct RobotPattern(String);

impl RobotPattern {
    /// A pattern of the characters that names have, and `*`.
    ///
    /// # Errors
    /// [`BadName`] says what is wrong with it.
    pub fn new(text: &str) -> Result<Self, BadName> {
        // A star stands for characters of names, so a name is left where each is a letter.
        RobotName::new(&text.replace(ANY, "x"))
            .map(|_| Self(text.to_owned()))
            .map_err(|error| error.of(text))
    }

    /// Whether it is one of the robots.
    #[must_use]
    pub fn matches(&self, robot: &RobotName) -> bool {
        overlap(&self.0, robot.as_str())
    }

    /// Whether it can match several names.
    #[must_use]
    pub fn is_open(&self) -> bool {
        is_pattern(&self.0)
    }

    /// The pattern as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for RobotPattern {
    type Error = BadName;

    fn try_from(text: String) -> Result<Self, BadName> {
        Self::new(&text)
    }
}

impl From<RobotPattern> for String {
    fn from(pattern: RobotPattern) -> Self {
        pattern.0
    }
}

impl From<RobotName> for RobotPattern {
    /// The pattern that matches this robot alone.
    fn from(name: RobotName) -> Self {
        Self(name.into())
    }
}

impl fmt::Display for RobotPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// Whether a text has a part that stands for any number of characters.
#[must_use]
pub fn is_pattern(text: &str) -> bool {
    text.contains(ANY)
}

/// Whether two patterns match a common text. A text without a star is a pattern that matches itself alone.
#[must_use]
pub fn overlap(one: &str, other: &str) -> bool {
    let one: Vec<char> = one.chars().collect();
    let other: Vec<char> = other.chars().collect();

    // Row by row from the ends: whether the rest of the one and the rest of the other have a common text. The time is bounded by
    // the product of the lengths, however many stars there are.
    let mut below: Vec<bool> = Vec::new();
    for i in (0..=one.len()).rev() {
        let mut row = vec![false; other.len() + 1];
        for j in (0..=other.len()).rev() {
            row[j] = match (one.get(i), other.get(j)) {
                (None, None) => true,
                (Some(&ANY), _) => below[j] || (j < other.len() && row[j + 1]),
                (_, Some(&ANY)) => row[j + 1] || (i < one.len() && below[j]),
                (Some(own), Some(others)) => own == others && below[j + 1],
                _ => false,
            };
        }
        below = row;
    }
    below[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_match_what_they_should() {
        for (pattern, name, matches) in [
            ("S*", "S1", true),
            ("S*", "S", true),
            ("S*", "T1", false),
            ("*", "Butler", true),
            ("*1", "S11", true),
            ("S*2", "S12", true),
            ("S*2", "S21", false),
            ("S1", "S1", true),
            ("S1", "S11", false),
            ("*a*b*", "xxaxxbxx", true),
            ("*a*b*", "xxbxxaxx", false),
            ("", "", true),
            ("*", "", true),
        ] {
            assert_eq!(overlap(pattern, name), matches, "{pattern} and {name}");
            assert_eq!(overlap(name, pattern), matches, "{name} and {pattern}");
        }
    }

    #[test]
    fn two_patterns_overlap_where_a_name_matches_both() {
        for (one, other, overlaps) in [
            ("S*", "*1", true),
            ("S*", "T*", false),
            ("*1", "*2", false),
            ("S*1", "S1*", true),
            ("a*c", "a*b*", true),
            ("a*c", "*b", false),
        ] {
            assert_eq!(overlap(one, other), overlaps, "{one} and {other}");
            assert_eq!(overlap(other, one), overlaps, "{other} and {one}");
        }
        // Many stars take no longer than few.
        let many = "*a".repeat(500);
        assert!(!overlap(&many, &"*b".repeat(500)));
    }

    #[test]
    fn a_pattern_has_the_characters_of_names() {
        assert!(RobotPattern::new("S*").unwrap().is_open());
        assert!(!RobotPattern::new("Leguin").unwrap().is_open());
        for bad in ["", "S *", "a/*", "-*", &"x".repeat(65)] {
            let refused = RobotPattern::new(bad).unwrap_err().to_string();
            assert!(refused.contains("is not a usable name"), "{refused}");
        }
    }
}

//! Patterns of names of robots and sites: a name in which each `*` stands for any number of characters, also for none, and which
//! may end with a range of numbers, as in `S{1..20}`.

use std::fmt;
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use crate::name::{BadName, RobotName};

/// What stands for any number of characters.
const ANY: char = '*';
/// How a range of numbers begins.
const OPEN: char = '{';
/// How it ends.
const CLOSE: char = '}';
/// Most numbers of a range that are compared one by one with another pattern.
const MAX_TRIED: usize = 10_000;
/// Largest number of a range.
const MAX_NUMBER: usize = 1_000_000;

/// A set of robots or sites: one by its name, or all whose names match, as in `S*` and `S{1..20}`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(try_from = "String", into = "String")]
#[cfg_attr(test, schemars(with = "String"))]
pub struct RobotPattern(String);

impl RobotPattern {
    /// A pattern of the characters that names have, `*`, and a range of numbers at the end.
    ///
    /// # Errors
    /// [`BadName`] says what is wrong with it.
    pub fn new(text: &str) -> Result<Self, BadName> {
        let longest = match split_range(text) {
            Ok(Some((base, numbers))) => format!("{base}{}", numbers.end()),
            _ => text.to_owned(),
        };
        // A star stands for characters of names, so a name is left where each is a letter.
        RobotName::new(&longest.replace(ANY, "x"))
            .map(|_| Self(text.to_owned()))
            .map_err(|error| error.of(text))
    }

    /// Whether it is one of the robots.
    #[must_use]
    pub fn matches(&self, robot: &RobotName) -> bool {
        matches(&self.0, robot.as_str())
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

/// Whether a text may stand for several names: it has a star or a range.
#[must_use]
pub fn is_pattern(text: &str) -> bool {
    text.contains([ANY, OPEN])
}

/// The parts of a path that is joined by dots, as in `robots.S{1..20}.received`; the dots of a range join nothing.
#[must_use]
pub fn path_parts(path: &str) -> Vec<&str> {
    let mut is_in_range = false;
    let is_joint = |letter: char| {
        match letter {
            OPEN => is_in_range = true,
            CLOSE => is_in_range = false,
            _ => {}
        }
        letter == '.' && !is_in_range
    };
    path.split(is_joint).collect()
}

/// Splits a name such as `S{1..20}` into what comes before the range and its numbers, the last one among them; `None` for a name
/// without braces.
///
/// # Errors
/// In words, what is wrong with the braces.
pub fn split_range(name: &str) -> Result<Option<(&str, RangeInclusive<usize>)>, String> {
    let Some((base, braces)) = name.split_once(OPEN) else {
        return Ok(None);
    };
    let numbers = braces
        .strip_suffix(CLOSE)
        .and_then(|range| range.split_once(".."));
    let numbers = numbers.and_then(|(first, last)| {
        let number = |text: &str| plain_number(text).filter(|number| *number <= MAX_NUMBER);
        Some(number(first)?..=number(last)?)
    });
    let numbers = numbers.ok_or_else(|| {
        format!(
            "{name:?} is not a name with a range of numbers at its end, such as \"S{{1..20}}\"; the largest number is {MAX_NUMBER}"
        )
    })?;
    if numbers.is_empty() {
        let (first, last) = (numbers.start(), numbers.end());
        return Err(format!(
            "{name:?}: the range ends with {last}, before {first}"
        ));
    }
    Ok(Some((base, numbers)))
}

/// A number as names have them: of digits only, without zeros before it.
fn plain_number(text: &str) -> Option<usize> {
    let is_plain = text == "0" || !text.starts_with(['0', '+']);
    text.parse().ok().filter(|_| is_plain)
}

/// Whether a pattern matches a name. A pattern without stars and range is a name that matches itself alone.
#[must_use]
pub fn matches(pattern: &str, name: &str) -> bool {
    let Ok(Some((base, numbers))) = split_range(pattern) else {
        return match is_pattern(pattern) {
            true => overlap(pattern, name),
            false => pattern == name,
        };
    };

    // Where the base ends with a star, the digits before the number may belong to it.
    let digits = name.bytes().rev().take_while(u8::is_ascii_digit).count();
    (name.len() - digits..name.len()).any(|from| {
        let number = plain_number(&name[from..]);
        number.is_some_and(|number| numbers.contains(&number)) && matches(base, &name[..from])
    })
}

/// Whether two patterns match a common text. A pattern without stars and range matches itself alone. A range of more than
/// 10,000 numbers counts as a star.
#[must_use]
pub fn overlap(one: &str, other: &str) -> bool {
    for (ranged, other) in [(one, other), (other, one)] {
        if let Ok(Some((base, numbers))) = split_range(ranged) {
            if numbers.clone().count() > MAX_TRIED {
                return overlap(&format!("{base}{ANY}"), other);
            }
            return match is_pattern(other) {
                true => numbers
                    .into_iter()
                    .any(|number| overlap(&format!("{base}{number}"), other)),
                false => matches(ranged, other),
            };
        }
    }

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
        for bad in [
            "S{1}",
            "S{3..2}",
            "S{1..2}x",
            "{",
            &format!("{}{{1..10}}", "x".repeat(63)),
        ] {
            let refused = RobotPattern::new(bad).unwrap_err().to_string();
            assert!(refused.contains("is not a usable name"), "{refused}");
        }
    }

    #[test]
    fn a_range_overlaps_what_matches_one_of_its_numbers() {
        for (one, other, overlaps) in [
            ("S{2..3}", "S3", true),
            ("S{2..3}", "S4", false),
            ("S{2..3}", "*3", true),
            ("S{2..3}", "S*4", false),
            ("S{2..3}", "S{3..9}", true),
            ("S{2..3}", "S{4..9}", false),
            ("S{2..13}", "S1{0..9}", true),
            ("S{2..10000}", "S{9999..20000}", true),
            ("S{1..20000}", "S{30000..30001}", true),
            ("S{1..20000}", "T{1..2}", false),
            ("S*{1..2}", "T2", false),
        ] {
            assert_eq!(overlap(one, other), overlaps, "{one} and {other}");
            assert_eq!(overlap(other, one), overlaps, "{other} and {one}");
        }
    }

    #[test]
    fn ranges_in_paths_stay_whole() {
        for (path, parts) in [
            ("ticks", &["ticks"][..]),
            (
                "robots.S{1..20}.sent.*",
                &["robots", "S{1..20}", "sent", "*"],
            ),
            ("a..b", &["a", "", "b"]),
        ] {
            assert_eq!(path_parts(path), parts);
        }
    }

    #[test]
    fn a_range_matches_its_numbers() {
        for (pattern, name, is_matched) in [
            ("S{1..3}", "S1", true),
            ("S{1..3}", "S3", true),
            ("S{1..3}", "S4", false),
            ("S{1..30}", "S12", true),
            ("S{1..30}", "S012", false),
            ("S{0..3}", "S0", true),
            ("S{1..3}", "S", false),
            ("S{1..3}", "T1", false),
            ("S{1..3}", "S+1", false),
            ("*{1..3}", "T2", true),
            ("*{1..3}", "T22", true),
            ("S*{12..13}", "S12", true),
            ("S*{12..13}", "Sx112", true),
            ("S*{12..13}", "S2", false),
            ("S{1..1000000}", "S999999999999999999999999", false),
        ] {
            assert_eq!(matches(pattern, name), is_matched, "{pattern} and {name}");
            assert!(RobotPattern::new(pattern).unwrap().is_open());
        }
    }
}

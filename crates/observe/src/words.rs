//! Words of measures and expectations that robots choose: names of emotions and behaviors, and texts of commands. No file declares
//! them, so a misspelled one shows only after a run: it did not occur.

use std::collections::{BTreeMap, BTreeSet};

use protocol::pattern::matches;
use protocol::{Event, RobotName};
use serde::{Deserialize, Serialize};

use crate::{Expectation, Measure, Observation};

/// Most words of a kind that are remembered of a robot, because robots choose them freely.
const MAX_HEARD: usize = 1_000;

/// What a word is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WordKind {
    /// The name of an emotion.
    Emotion,
    /// The name of a behavior.
    Behavior,
    /// The text of a command.
    Command,
}

/// A word that a measure or an expectation names.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Word {
    /// What it is.
    pub kind: WordKind,
    /// The robots one of which may say it, or patterns of them; empty for any robot.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub robots: Vec<String>,
    /// The word.
    pub word: String,
}

/// A word that did not occur in a run.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct MissingWord {
    /// The word.
    #[serde(flatten)]
    pub word: Word,
    /// One that occurred and is spelled almost alike.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub like: Option<String>,
}

/// The words that are named, and those that occur in a run.
#[derive(Debug, Clone, Default)]
pub struct Words {
    named: BTreeSet<Word>,
    heard: BTreeMap<(WordKind, RobotName), BTreeSet<String>>,
}

impl Words {
    /// The words that these measures and expectations name, before a run.
    #[must_use]
    pub fn of(measures: &[Measure], expectations: &[Expectation]) -> Self {
        let mut named = BTreeSet::new();
        for measure in measures {
            named.extend(measure.words());
        }
        for expectation in expectations {
            named.extend(expectation.words());
        }
        Self {
            named,
            heard: BTreeMap::new(),
        }
    }

    /// Takes a tick into account.
    pub fn observe(&mut self, observation: &Observation<'_>) {
        if self.named.is_empty() {
            return;
        }
        for event in observation.events {
            match event {
                Event::Emotion { robot, to, .. } => self.hear(WordKind::Emotion, robot, to),
                Event::Behavior { robot, to, .. } => self.hear(WordKind::Behavior, robot, to),
                Event::CommandSent { from, command, .. } => {
                    self.hear(WordKind::Command, from, command);
                }
                _ => {}
            }
        }
    }

    fn hear(&mut self, kind: WordKind, robot: &RobotName, word: &str) {
        let heard = self.heard.entry((kind, robot.clone())).or_default();
        if heard.len() < MAX_HEARD && !heard.contains(word) {
            heard.insert(word.to_owned());
        }
    }

    /// The words that are named and have not occurred.
    #[must_use]
    pub fn unheard(&self) -> Vec<MissingWord> {
        let mut unheard = Vec::new();
        for word in &self.named {
            let heard = self.heard_of(word);
            if heard.contains(word.word.as_str()) {
                continue;
            }

            let like = heard
                .into_iter()
                .map(|other| (distance(&word.word, other), other))
                .min()
                .filter(|(_, other)| is_almost(&word.word, other));
            unheard.push(MissingWord {
                word: word.clone(),
                like: like.map(|(_, other)| other.to_owned()),
            });
        }
        unheard
    }

    /// What the robots that may say a word have said.
    fn heard_of(&self, word: &Word) -> BTreeSet<&str> {
        let mut all = BTreeSet::new();
        for ((kind, robot), heard) in &self.heard {
            let may_say = word.robots.is_empty()
                || word.robots.iter().any(|one| matches(one, robot.as_str()));
            if *kind == word.kind && may_say {
                all.extend(heard.iter().map(String::as_str));
            }
        }
        all
    }
}

impl std::fmt::Display for Word {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let kind = match self.kind {
            WordKind::Emotion => "emotion",
            WordKind::Behavior => "behavior",
            WordKind::Command => "command",
        };
        write!(
            f,
            "the {kind} \"{}\"",
            protocol::plain::escape_line(&self.word)
        )?;
        if !self.robots.is_empty() {
            write!(f, " of {}", self.robots.join(" or "))?;
        }
        Ok(())
    }
}

/// Whether a word may be meant by another one: a third of its characters are wrong at the most.
fn is_almost(word: &str, meant: &str) -> bool {
    3 * distance(word, meant) <= word.chars().count().max(3)
}

/// How many characters of a word have to be changed, added, left out, or exchanged with their neighbor to make another one.
fn distance(one: &str, other: &str) -> usize {
    let one: Vec<char> = one.to_lowercase().chars().collect();
    let other: Vec<char> = other.to_lowercase().chars().collect();
    let mut rows = vec![(0..=other.len()).collect::<Vec<usize>>()];
    for (above, left) in one.iter().enumerate() {
        let mut row = vec![above + 1];
        for (before, right) in other.iter().enumerate() {
            let mut least = rows[above][before] + usize::from(left != right);
            least = least.min(rows[above][before + 1] + 1).min(row[before] + 1);
            let is_exchanged =
                above > 0 && before > 0 && one[above - 1] == *right && other[before - 1] == *left;
            if is_exchanged {
                least = least.min(rows[above - 1][before - 1] + 1);
            }
            row.push(least);
        }
        rows.push(row);
    }
    rows[one.len()][other.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measure(text: &str) -> Measure {
        toml::from_str(&format!("name = 'x'\n{text}")).unwrap()
    }

    fn expectation(text: &str) -> Expectation {
        toml::from_str(&format!("name = 'x'\n{text}")).unwrap()
    }

    fn robot(name: &str) -> RobotName {
        RobotName::new(name).unwrap()
    }

    fn after_a_run(measures: &[Measure], expectations: &[Expectation]) -> Vec<String> {
        let mut words = Words::of(measures, expectations);
        let events = [
            Event::Emotion {
                robot: robot("A"),
                from: None,
                to: "HAPPY".to_owned(),
            },
            Event::Behavior {
                robot: robot("B"),
                from: Some("WAIT".to_owned()),
                to: "SERVE".to_owned(),
            },
            Event::CommandSent {
                from: robot("A"),
                to: robot("B"),
                seq: 1,
                performative: Default::default(),
                command: "refill".to_owned(),
                payload: None,
                payload_of: None,
            },
        ];
        words.observe(&Observation {
            tick: 0,
            tick_s: 0.5,
            events: &events,
            state: &|_| None,
            site: &|_| None,
            layer: &|_| None,
        });

        let unheard = words.unheard().into_iter();
        let shown = unheard.map(|unheard| match unheard.like {
            Some(like) => format!("{}: {like}", unheard.word),
            None => unheard.word.to_string(),
        });
        shown.collect()
    }

    #[test]
    fn words_that_do_not_occur_are_named_with_those_that_are_almost_alike() {
        let measures = [
            measure("share = { robot = 'A', emotion = ['HAPY', 'HAPPY'] }"),
            measure("share = { robot = 'B', emotion = 'HAPPY' }"),
            measure("count = { event = 'behavior', to = 'SERVE', from = 'REST' }"),
            measure("count = { event = 'command_sent', command = ['refill', 'reifll'] }"),
            measure("time = { to = { event = 'emotion', robot = '*', to = 'HAPPY' } }"),
            measure("summary = 'robots.A.emotions_s.HAPYP'"),
            measure("summary = 'robots.*.sent.reffil'"),
            measure("summary = 'robots.*.entered.*'"),
            measure("summary = 'robots.B.entered.SERVE'"),
        ];
        let expectations = [
            expectation("never = { robot = 'B', behavior = 'SREVE' }"),
            expectation(
                "after = { event = 'behavior', robot = 'B', to = 'SERVES' }\n\
                 eventually = { event = 'emotion', robot = 'A', to = 'SAD' }\nwithin = '1 s'",
            ),
        ];
        assert_eq!(
            after_a_run(&measures, &expectations),
            [
                "the emotion \"HAPY\" of A: HAPPY",
                "the emotion \"HAPYP\" of A: HAPPY",
                "the emotion \"SAD\" of A",
                "the emotion \"HAPPY\" of B",
                "the behavior \"REST\"",
                "the behavior \"SERVES\" of B: SERVE",
                "the behavior \"SREVE\" of B: SERVE",
                "the command \"reffil\": refill",
                "the command \"reifll\": refill",
            ]
        );
    }
}

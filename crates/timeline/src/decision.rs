//! What decided a run, as `cars why` has written it: of the answer, what is shown.

use protocol::Tick;
use protocol::time::time_s;
use serde::{Deserialize, Serialize};

/// Most points of a curve.
const MAX_POINTS: usize = 4096;
/// Most jumps.
const MAX_JUMPS: usize = 200;
/// Most events of a jump.
const MAX_EVENTS: usize = 1000;
/// Most bytes of a text.
const MAX_TEXT: usize = 8192;

/// What decided a run: how the outcome that was to be expected changed over the run. Fields of the file that are not shown are ignored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunDecision {
    /// Digest of the run at its last tick.
    pub digest: String,
    /// What was asked.
    pub question: DecisionQuestion,
    /// Whether outcomes are 1 or 0, so that their means are probabilities.
    pub is_share: bool,
    /// Length of a tick, simulated seconds.
    pub tick_s: f64,
    /// The last tick of the run.
    pub last: Tick,
    /// The answer in a sentence.
    pub sentence: String,
    /// The expected outcome after ticks, in their order.
    pub curve: Vec<DecisionPoint>,
    /// The ticks in which it jumps, in their order.
    pub jumps: Vec<DecisionJump>,
}

/// What was asked of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DecisionQuestion {
    /// `expectation`, `condition`, `measure` or `summary`.
    pub kind: String,
    /// Its words: a name, a condition, or the path of a number of the summary.
    #[serde(alias = "condition", alias = "path")]
    pub name: String,
}

/// The expected outcome of a number of forks, with its interval of 95 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ForkOutcomes {
    /// The forks with an outcome.
    pub n: u64,
    /// Their mean; `None` without one.
    pub value: Option<f64>,
    /// Lower end, if there is an interval.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// Forks in which a robot failed; they have no outcome.
    #[serde(default)]
    pub failed: u64,
}

/// The expected outcome after a tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DecisionPoint {
    /// The tick.
    pub tick: Tick,
    /// The outcomes of forks after it.
    #[serde(flatten)]
    pub outcome: ForkOutcomes,
}

/// A tick in which the expected outcome jumps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DecisionJump {
    /// The tick.
    pub tick: Tick,
    /// The expected outcome after the tick before.
    pub before: ForkOutcomes,
    /// The expected outcome after the tick.
    pub after: ForkOutcomes,
    /// What happened in the tick, in words.
    pub events: Vec<String>,
    /// What caused it, if one event or one kind of chance did.
    pub cause: Option<DecisionCause>,
}

/// The cause of a jump.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DecisionCause {
    /// In words.
    pub what: String,
    /// Whether it is an event; else it is a kind of chance.
    pub is_event: bool,
    /// The expected outcome without it.
    pub without: ForkOutcomes,
}

impl RunDecision {
    /// Checks what a program that draws it relies on.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check(&self) -> Result<(), String> {
        if !(self.tick_s.is_finite() && self.tick_s > 0.0) {
            return Err(format!("tick_s is {}, not a time", self.tick_s));
        }
        check_ticks(
            "curve",
            self.curve.iter().map(|point| point.tick),
            self.last,
        )?;
        check_ticks("jumps", self.jumps.iter().map(|jump| jump.tick), self.last)?;
        check_count("points", self.curve.len(), MAX_POINTS)?;
        check_count("jumps", self.jumps.len(), MAX_JUMPS)?;

        check_text("the sentence", &self.sentence)?;
        check_text("the question", &self.question.name)?;
        check_text("the digest", &self.digest)?;
        for point in &self.curve {
            point.outcome.check(point.tick)?;
        }
        for jump in &self.jumps {
            jump.check()?;
        }
        Ok(())
    }

    /// What the curve is of, for its axis.
    #[must_use]
    pub fn axis(&self) -> String {
        match self.question.kind.as_str() {
            "expectation" => "probability that it fails".to_owned(),
            "condition" => "probability that it holds".to_owned(),
            _ if self.is_share => "probability".to_owned(),
            _ => format!("expected {}", self.question.name),
        }
    }

    /// Ends of the axis of the curve: 0 and 1 of a probability, else those of all intervals.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        if self.is_share {
            return (0.0, 1.0);
        }
        let outcomes = self.curve.iter().map(|point| point.outcome);
        let ends = outcomes.flat_map(|outcome| [outcome.value, outcome.low, outcome.high]);
        let (least, most) = ends
            .flatten()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), end| {
                (least.min(end), most.max(end))
            });
        if least < most {
            (least, most)
        } else if least.is_finite() {
            (least - 0.5, least + 0.5)
        } else {
            (0.0, 1.0)
        }
    }

    /// Outcomes in words: a share in percent.
    #[must_use]
    pub fn amount(&self, outcomes: &ForkOutcomes) -> String {
        outcomes.value.map_or_else(none, |value| self.number(value))
    }

    /// An outcome in words: a share in percent.
    #[must_use]
    pub fn number(&self, value: f64) -> String {
        outcome_in_words(value, self.is_share)
    }

    /// A jump in words.
    #[must_use]
    pub fn told(&self, jump: &DecisionJump) -> String {
        let time = outcome_in_words(time_s(jump.tick, self.tick_s), false);
        let (before, after) = (self.amount(&jump.before), self.amount(&jump.after));
        let mut text = format!("{time} s, tick {}: {before} → {after}", jump.tick);
        if let Some(cause) = &jump.cause {
            let without = self.amount(&cause.without);
            text += &format!(", because {}; without it {without}", cause.what);
        }
        text
    }
}

impl ForkOutcomes {
    /// Both ends of the interval, or the value twice; `None` without a value.
    #[must_use]
    pub fn ends(&self) -> Option<(f64, f64)> {
        let value = self.value?;
        Some((
            self.low.unwrap_or(value).min(value),
            self.high.unwrap_or(value).max(value),
        ))
    }

    /// In words: the value and its interval, `12 % (8 to 16)` of shares.
    #[must_use]
    pub fn in_words(&self, is_share: bool) -> String {
        let Some(value) = self.value else {
            return none();
        };
        let value = outcome_in_words(value, is_share);
        let end = |end| in_unit(end, is_share);
        match self.low.zip(self.high) {
            Some((low, high)) => format!("{value} ({} to {})", end(low), end(high)),
            None => value,
        }
    }

    /// In words, with the number of forks: `12 % (8 to 16), n = 180, and a robot failed in 20`.
    #[must_use]
    pub fn in_words_with_count(&self, is_share: bool) -> String {
        let mut text = format!("{}, n = {}", self.in_words(is_share), self.n);
        if self.failed > 0 {
            text += &format!(", and a robot failed in {}", self.failed);
        }
        text
    }

    fn check(&self, tick: Tick) -> Result<(), String> {
        let numbers = [self.value, self.low, self.high];
        if numbers.into_iter().flatten().all(f64::is_finite) {
            Ok(())
        } else {
            Err(format!("tick {tick} has a number that is not finite"))
        }
    }
}

impl DecisionJump {
    fn check(&self) -> Result<(), String> {
        self.before.check(self.tick)?;
        self.after.check(self.tick)?;
        check_count("events", self.events.len(), MAX_EVENTS)?;
        for event in &self.events {
            check_text("an event", event)?;
        }
        if let Some(cause) = &self.cause {
            check_text("a cause", &cause.what)?;
            cause.without.check(self.tick)?;
        }
        Ok(())
    }
}

/// An outcome in words: a share in percent, any other number with at most three decimals.
#[must_use]
pub fn outcome_in_words(value: f64, is_share: bool) -> String {
    let unit = if is_share { " %" } else { "" };
    in_unit(value, is_share) + unit
}

fn in_unit(value: f64, is_share: bool) -> String {
    if is_share {
        return format!("{:.0}", value * 100.0);
    }
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}

fn none() -> String {
    "no number".to_owned()
}

fn check_count(what: &str, count: usize, most: usize) -> Result<(), String> {
    if count <= most {
        Ok(())
    } else {
        Err(format!("{count} {what}, and at most {most} are shown"))
    }
}

fn check_text(what: &str, text: &str) -> Result<(), String> {
    check_count(&format!("bytes in {what}"), text.len(), MAX_TEXT)
}

fn check_ticks(of: &str, ticks: impl Iterator<Item = Tick>, last: Tick) -> Result<(), String> {
    let mut before = None;
    for tick in ticks {
        if before.is_some_and(|before| before >= tick) {
            return Err(format!("{of}: tick {tick} is out of order"));
        }
        if tick > last {
            return Err(format!(
                "{of}: tick {tick} comes after the last one, {last}"
            ));
        }
        before = Some(tick);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcomes(value: f64) -> ForkOutcomes {
        ForkOutcomes {
            n: 200,
            value: Some(value),
            low: Some(value - 0.04),
            high: Some(value + 0.04),
            failed: 0,
        }
    }

    fn decision() -> RunDecision {
        RunDecision {
            digest: "d".to_owned(),
            question: DecisionQuestion {
                kind: "expectation".to_owned(),
                name: "a call is answered".to_owned(),
            },
            is_share: true,
            tick_s: 0.5,
            last: 100,
            sentence: String::new(),
            curve: [(0, 0.12), (60, 0.94)]
                .map(|(tick, value)| DecisionPoint {
                    tick,
                    outcome: outcomes(value),
                })
                .to_vec(),
            jumps: vec![DecisionJump {
                tick: 60,
                before: outcomes(0.12),
                after: outcomes(0.94),
                events: Vec::new(),
                cause: Some(DecisionCause {
                    what: "command 9 was lost".to_owned(),
                    is_event: true,
                    without: outcomes(0.1),
                }),
            }],
        }
    }

    #[test]
    fn what_is_told_has_its_units() {
        let mut decision = decision();
        let told = decision.told(&decision.jumps[0]);
        let expected = "30 s, tick 60: 12 % → 94 %, because command 9 was lost; without it 10 %";
        assert_eq!(told, expected);
        let outcome = decision.jumps[0].before;
        assert_eq!(outcome.in_words_with_count(true), "12 % (8 to 16), n = 200");

        decision.is_share = false;
        let words = outcome.in_words_with_count(false);
        assert_eq!(words, "0.12 (0.08 to 0.16), n = 200");
        let (low, high) = decision.range();
        assert!((low - 0.08).abs() < 1e-9 && (high - 0.98).abs() < 1e-9);
    }

    #[test]
    fn what_cannot_be_drawn_is_refused_in_words() {
        type Spoil = fn(&mut RunDecision);

        assert_eq!(decision().check(), Ok(()));
        let wrong: [(&str, Spoil); 6] = [
            ("out of order", |one| one.curve.reverse()),
            ("after the last", |one| one.last = 59),
            ("not a time", |one| one.tick_s = 0.0),
            ("not finite", |one| {
                one.curve[0].outcome.low = Some(f64::NAN);
            }),
            ("at most", |one| one.sentence = "x".repeat(MAX_TEXT + 1)),
            ("at most", |one| {
                one.last = Tick::MAX;
                let point = one.curve[0];
                let points = (0..=MAX_POINTS as Tick).map(|tick| DecisionPoint { tick, ..point });
                one.curve = points.collect();
            }),
        ];
        for (words, change) in wrong {
            let mut decision = decision();
            change(&mut decision);
            let error = decision.check().expect_err(words);
            assert!(error.contains(words), "{error}");
        }
    }
}

//! The answer in a sentence.

use protocol::time::time_s;

use timeline::{DecisionJump, ForkOutcomes, outcome_in_words};

use super::answer::{FailedForks, WhyAnswer};
use super::question::Question;

/// How near the expected outcome after tick 0 must be to that of the run, so that the run was decided from the start.
const NEAR: f64 = 0.1;

impl WhyAnswer {
    /// The answer in a sentence or two.
    pub(super) fn in_words(&self) -> String {
        let mut text = format!("{}. ", self.outcome_in_words());
        let planned: Vec<String> = self
            .planned
            .iter()
            .filter(|effect| effect.matters)
            .map(|effect| {
                format!(
                    "Without {} it is {}, with it {}. ",
                    effect.what,
                    self.amount(&effect.without),
                    self.amount(&effect.with)
                )
            })
            .collect();

        if self.jumps.is_empty() && !planned.is_empty() {
            text += "It was decided by what the scenario plans. ";
        } else if self.jumps.is_empty() {
            text += &self.without_jumps();
        } else {
            // The largest change first: that is what decided it.
            let mut jumps: Vec<&DecisionJump> = self.jumps.iter().map(|jump| &jump.shown).collect();
            jumps.sort_by(|one, other| size(other).total_cmp(&size(one)));
            text += "It was decided ";
            let told: Vec<String> = jumps.iter().take(3).map(|jump| self.told(jump)).collect();
            text += &told.join("; and ");
            text += ". ";
        }
        text += &planned.concat();
        if let Some(failed) = &self.failed {
            text += &self.failed_in_words(failed);
        }
        if !self.is_complete {
            text += "The budget ended before all of the curve was looked at. ";
        }
        text.trim_end().to_owned()
    }

    fn without_jumps(&self) -> String {
        let start = self.curve.first().map(|point| point.outcome);
        let Some(start) = start.filter(|start| start.value.is_some()) else {
            return "No fork was played. ".to_owned();
        };

        let is_near = match (start.value, self.recorded) {
            (Some(value), Some(recorded)) if self.is_share => (value - recorded).abs() <= NEAR,
            _ => self.least_jump == 0.0,
        };
        if is_near {
            return format!(
                "It was decided from the start: with other chance from the first tick on it is {}. ",
                self.amount(&start)
            );
        }

        let least = if self.is_share {
            format!("{:.0} points", self.least_jump * 100.0)
        } else {
            format!("{:.3}", self.least_jump)
        };
        format!(
            "Nothing decided it: it is {} at the start, and no tick changes that by {least} or more; it was chance throughout. ",
            self.amount(&start)
        )
    }

    fn outcome_in_words(&self) -> String {
        let is_one = self.recorded == Some(1.0);

        match &self.question {
            Question::Expectation {
                name, or_undecided, ..
            } => {
                let verdict = match (is_one, or_undecided) {
                    (true, true) => "does not pass",
                    (true, false) => "fails",
                    (false, _) => "does not fail",
                };
                format!("\"{name}\" {verdict}")
            }
            Question::Condition { condition } => {
                let holds = if is_one {
                    "holds in some tick"
                } else {
                    "holds in no tick"
                };
                format!("{condition} {holds}")
            }
            Question::Measure { name } => self.number_in_words(name),
            Question::Summary { path } => self.number_in_words(path),
        }
    }

    fn number_in_words(&self, name: &str) -> String {
        match self.recorded {
            Some(value) => format!("{name} is {}", outcome_in_words(value, false)),
            None => format!("{name} has no number"),
        }
    }

    /// What the answer leaves out because robots failed.
    fn failed_in_words(&self, failed: &FailedForks) -> String {
        let FailedForks {
            forks,
            first,
            because,
            ..
        } = failed;
        format!(
            "In {forks} of {} forks a robot failed: they are left out, so this is about runs in which none does (the first of them \
             goes on from tick {}: {because}). ",
            self.forks,
            first.shared()
        )
    }

    /// What happened in a tick.
    fn told(&self, jump: &DecisionJump) -> String {
        let mut text = format!(
            "at {} s (tick {}): {} -> {}",
            outcome_in_words(time_s(jump.tick, self.tick_s), false),
            jump.tick,
            self.amount(&jump.before),
            self.amount(&jump.after)
        );

        match &jump.cause {
            Some(cause) if cause.is_event => {
                text += &format!(
                    ", because {}; without that it is {}",
                    cause.what,
                    self.amount(&cause.without)
                );
            }
            Some(cause) => {
                text += &format!(
                    ", by {}; with another one in this tick it is {}",
                    cause.what,
                    self.amount(&cause.without)
                );
            }
            None => text += ", by no single event of the tick and no single kind of chance",
        }
        text
    }

    /// Outcomes with their interval.
    fn amount(&self, outcomes: &ForkOutcomes) -> String {
        match outcomes.value {
            Some(_) => outcomes.in_words(self.is_share),
            None => "unknown".to_owned(),
        }
    }
}

fn size(jump: &DecisionJump) -> f64 {
    let change = jump.after.value.zip(jump.before.value);
    change.map_or(0.0, |(after, before)| (after - before).abs())
}

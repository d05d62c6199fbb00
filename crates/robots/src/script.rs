//! Emotions that are given instead of generated: the yoked control of an experiment, in which a robot has the emotions of
//! another run, and not their causes.

use affect::{Feeling, StandardEmotion, Urgency};
use serde::{Deserialize, Serialize};

/// A feeling from a time on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scripted {
    /// When it begins, simulated seconds.
    pub at_s: f64,
    /// The emotion.
    pub emotion: StandardEmotion,
    /// How pressing the need is, from which follows how strongly the emotion is felt.
    #[serde(default)]
    pub urgency: Urgency,
}

/// In the place of what the feelings of a script are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScriptRole {
    /// Of what the robot feels: it acts by them, and shows them.
    #[default]
    Felt,
    /// Of what it shows to others: it acts by its own.
    Shown,
}

/// Feelings in the order in which they begin. An empty script leaves a robot its own emotions.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Script(Vec<Scripted>);

impl Script {
    /// A script of these feelings.
    #[must_use]
    pub fn new(feelings: Vec<Scripted>) -> Self {
        Self(feelings)
    }

    /// Whether it leaves a robot its own emotions.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Checks that the times ascend from 0 on.
    ///
    /// # Errors
    /// The first entry that is not later than the one before it.
    pub fn check(&self) -> Result<(), String> {
        let mut before_s = -1.0;
        for (index, scripted) in self.0.iter().enumerate() {
            let at_s = scripted.at_s;
            if !(at_s >= 0.0 && at_s.is_finite() && at_s > before_s) {
                return Err(format!(
                    "script: entry {index} begins at {at_s} s; times begin at 0 and ascend"
                ));
            }
            before_s = at_s;
        }
        Ok(())
    }

    /// The feeling at a time, in simulated seconds; `None` before the first one.
    #[must_use]
    pub fn feeling_at(&self, time_s: f64) -> Option<Feeling<StandardEmotion>> {
        let begun = self
            .0
            .partition_point(|scripted| scripted.at_s <= time_s + SLACK_S);
        let scripted = self.0.get(begun.checked_sub(1)?)?;
        Some(Feeling {
            emotion: scripted.emotion,
            urgency: scripted.urgency,
        })
    }
}

/// Allowance for the rounding of times that are multiples of a tick, seconds.
const SLACK_S: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;

    fn scripted(at_s: f64, emotion: StandardEmotion) -> Scripted {
        Scripted {
            at_s,
            emotion,
            urgency: Urgency::MAX,
        }
    }

    #[test]
    fn a_feeling_lasts_until_the_next_one() {
        let script = Script::new(vec![
            scripted(1.0, StandardEmotion::Happy),
            scripted(2.5, StandardEmotion::Concerned),
        ]);
        let at = |time_s: f64| script.feeling_at(time_s).map(|feeling| feeling.emotion);

        assert_eq!(at(0.5), None);
        assert_eq!(at(1.0), Some(StandardEmotion::Happy));
        assert_eq!(at(2.0), Some(StandardEmotion::Happy));
        assert_eq!(at(2.5), Some(StandardEmotion::Concerned));
        assert_eq!(at(1e9), Some(StandardEmotion::Concerned));
        assert_eq!(Script::default().feeling_at(1.0), None);
    }

    #[test]
    fn times_that_do_not_ascend_are_refused() {
        let happy = scripted(1.0, StandardEmotion::Happy);
        assert!(Script::new(vec![happy]).check().is_ok());
        assert!(Script::new(vec![happy, happy]).check().is_err());
        assert!(
            Script::new(vec![scripted(-1.0, StandardEmotion::Happy)])
                .check()
                .is_err()
        );
        assert!(
            Script::new(vec![scripted(f64::NAN, StandardEmotion::Happy)])
                .check()
                .is_err()
        );
    }
}

//! Action tendencies: the small suite of actions that an emotion makes ready.

use crate::label::StandardEmotion;
use serde::{Deserialize, Serialize};

/// What an emotion inclines an agent to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ActionTendency {
    /// Keep away (Table 1).
    Avoid,
    /// Come nearer (Table 1).
    Approach,
    /// Fight for control (Table 1). The seed prints "agnostic", taken for a misprint \[I\].
    Agonistic,
    /// Push away (Table 1).
    Reject,
    /// Get ready (Table 1).
    Prepare,
    /// Rest (Table 1).
    Inactivity,
    /// Do as one likes (Table 2).
    FreeActivate,
    /// Go on as usual (Table 2).
    ContinueNormalActivity,
    /// Watch closely how it goes (Table 2).
    MonitorProgressClosely,
    /// Try something else (Table 2).
    ChangeCurrentStrategy,
    /// Give the goal up. In no table; the seed names it as what the loss of a goal signals [D: S], and this
    /// crate gives it to DISCOURAGED \[I\].
    Disengage,
}

impl ActionTendency {
    /// What the tendency is good for, as in Table 1; none for the others.
    pub fn function(self) -> Option<&'static str> {
        TABLE_1
            .iter()
            .find(|row| row.tendency == self)
            .map(|row| row.function)
    }

    /// The item of EmotionML's vocabulary `frijda-action-tendencies` that means this [D: W]; none where that
    /// vocabulary has no such item, so that an export needs one of its own.
    pub fn emotionml(self) -> Option<&'static str> {
        TABLE_1.iter().find(|row| row.tendency == self)?.emotionml
    }

    /// The name, as files and logs spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Avoid => "avoid",
            Self::Approach => "approach",
            Self::Agonistic => "agonistic",
            Self::Reject => "reject",
            Self::Prepare => "prepare",
            Self::Inactivity => "inactivity",
            Self::FreeActivate => "free-activate",
            Self::ContinueNormalActivity => "continue-normal-activity",
            Self::MonitorProgressClosely => "monitor-progress-closely",
            Self::ChangeCurrentStrategy => "change-current-strategy",
            Self::Disengage => "disengage",
        }
    }
}

/// A row of Table 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PrimaryTendency {
    /// What the emotion inclines to.
    pub tendency: ActionTendency,
    /// What that is good for.
    pub function: &'static str,
    /// The emotion, in words: these are not emotions of the robots.
    pub emotion: &'static str,
    /// Its name in EmotionML's `frijda-action-tendencies`.
    pub emotionml: Option<&'static str>,
}

/// Table 1 of the seed [D: S]. EmotionML names are those of its vocabulary [D: W]; that `attending` is
/// nearest to preparation is a choice \[I\].
pub const TABLE_1: [PrimaryTendency; 6] = {
    use ActionTendency::{Agonistic, Approach, Avoid, Inactivity, Prepare, Reject};
    [
        row_1(Avoid, "protect", "fear", Some("avoidance")),
        row_1(
            Approach,
            "permit consummatory activity",
            "desire",
            Some("approach"),
        ),
        row_1(Agonistic, "regain control", "anger", Some("agonistic")),
        row_1(Reject, "protect", "disgust", Some("rejecting")),
        row_1(Prepare, "caution", "anxiety", Some("attending")),
        row_1(Inactivity, "recuperation", "contentment", None),
    ]
};

const fn row_1(
    tendency: ActionTendency,
    function: &'static str,
    emotion: &'static str,
    emotionml: Option<&'static str>,
) -> PrimaryTendency {
    PrimaryTendency {
        tendency,
        function,
        emotion,
        emotionml,
    }
}

/// A row of Table 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaskTendency {
    /// What the emotion inclines to.
    pub tendency: ActionTendency,
    /// What that means for the robot others depend on, the waiter.
    pub waiter: &'static [&'static str],
    /// What that means for the robot that supports it, the refiller.
    pub refiller: &'static [&'static str],
    /// The emotion.
    pub emotion: StandardEmotion,
}

/// Table 2 of the seed [D: S].
///
/// The seed prints "serve/joke" for HAPPY, which may also mean that the waiter does both; read here, as the
/// other rows, as waiter/refiller \[I\].
pub const TABLE_2: [TaskTendency; 4] = {
    use ActionTendency::{
        ChangeCurrentStrategy, ContinueNormalActivity, FreeActivate, MonitorProgressClosely,
    };
    use StandardEmotion::{Concerned, Confident, Frustrated, Happy};
    [
        row_2(FreeActivate, &["serve"], &["joke"], Happy),
        row_2(
            ContinueNormalActivity,
            &["serve", "call for refill"],
            &["serve"],
            Confident,
        ),
        row_2(
            MonitorProgressClosely,
            &["ask to hurry"],
            &["increase speed"],
            Concerned,
        ),
        row_2(
            ChangeCurrentStrategy,
            &["intercept"],
            &["go home"],
            Frustrated,
        ),
    ]
};

const fn row_2(
    tendency: ActionTendency,
    waiter: &'static [&'static str],
    refiller: &'static [&'static str],
    emotion: StandardEmotion,
) -> TaskTendency {
    TaskTendency {
        tendency,
        waiter,
        refiller,
        emotion,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_is_the_serialized_form() {
        for row in TABLE_1
            .iter()
            .map(|row| row.tendency)
            .chain(TABLE_2.iter().map(|row| row.tendency))
        {
            assert_eq!(
                serde_json::to_string(&row).unwrap(),
                format!("\"{}\"", row.name())
            );
        }
    }

    #[test]
    fn tendencies_of_table_1_have_a_function() {
        assert_eq!(ActionTendency::Agonistic.function(), Some("regain control"));
        assert_eq!(ActionTendency::Prepare.emotionml(), Some("attending"));
        assert_eq!(ActionTendency::Inactivity.emotionml(), None);
        assert_eq!(ActionTendency::FreeActivate.function(), None);
    }
}

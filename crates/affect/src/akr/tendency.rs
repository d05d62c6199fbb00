//! Action tendencies: the small set of actions that an emotion prepares.

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
    /// Fight for control (Table 1). The paper prints "agnostic", assumed to be a misprint \[I\].
    Agonistic,
    /// Push away (Table 1).
    Reject,
    /// Get ready (Table 1).
    Prepare,
    /// Rest (Table 1).
    Inactivity,
    /// Act freely (Table 2).
    FreeActivate,
    /// Continue as usual (Table 2).
    ContinueNormalActivity,
    /// Watch progress closely (Table 2).
    MonitorProgressClosely,
    /// Try another strategy (Table 2).
    ChangeCurrentStrategy,
    /// Give up the goal. Not in the tables: the paper mentions it as the signal of a lost goal [D: S], and this
    /// crate assigns it to DISCOURAGED \[I\].
    Disengage,
}

impl ActionTendency {
    /// Every tendency.
    pub const ALL: [Self; 11] = [
        Self::Avoid,
        Self::Approach,
        Self::Agonistic,
        Self::Reject,
        Self::Prepare,
        Self::Inactivity,
        Self::FreeActivate,
        Self::ContinueNormalActivity,
        Self::MonitorProgressClosely,
        Self::ChangeCurrentStrategy,
        Self::Disengage,
    ];

    /// The tendency with this name, if there is one.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|tendency| tendency.name() == name)
    }

    /// The function of the tendency according to Table 1, or `None` if it is not in that table.
    pub fn function(self) -> Option<&'static str> {
        TABLE_1
            .iter()
            .find(|row| row.tendency == self)
            .map(|row| row.function)
    }

    /// The corresponding item of EmotionML's vocabulary `frijda-action-tendencies` [D: W].
    ///
    /// `None` if that vocabulary has no such item, so that an export must define its own.
    pub fn emotionml(self) -> Option<&'static str> {
        TABLE_1.iter().find(|row| row.tendency == self)?.emotionml
    }

    /// The name used in files and logs.
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
    /// The tendency.
    pub tendency: ActionTendency,
    /// The function of the tendency.
    pub function: &'static str,
    /// The emotion in words; these are not emotions of the robots.
    pub emotion: &'static str,
    /// The tendency's name in EmotionML's `frijda-action-tendencies`.
    pub emotionml: Option<&'static str>,
}

/// Table 1 of the paper [D: S].
///
/// The EmotionML names are those of its vocabulary [D: W]. Mapping preparation to `attending` is a choice \[I\].
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
    /// The tendency.
    pub tendency: ActionTendency,
    /// What it means for the waiter, the robot that is supported.
    pub waiter: &'static [&'static str],
    /// What it means for the refiller, the robot that supports the waiter.
    pub refiller: &'static [&'static str],
    /// The emotion.
    pub emotion: StandardEmotion,
}

/// Table 2 of the paper [D: S].
///
/// The paper prints "serve/joke" for HAPPY. This could mean that the waiter does both; here it is read as
/// waiter/refiller, like the other rows \[I\].
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
        for tendency in ActionTendency::ALL {
            let json = serde_json::to_string(&tendency).unwrap();
            assert_eq!(json, format!("\"{}\"", tendency.name()));
            assert_eq!(ActionTendency::named(tendency.name()), Some(tendency));
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

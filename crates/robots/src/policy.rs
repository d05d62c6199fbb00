//! What the actions of the robots follow from: emotions, or what an experiment puts in their place.

use affect::StandardEmotion;
use serde::{Deserialize, Serialize};

/// What decides when a robot calls, hurries, intercepts or gives up. Robots of all policies can do the same, but for
/// [`Self::Neither`], and know the same; they differ in what they go by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// Emotions \[D\]. Where they are switched off, this is [`Self::Neither`].
    #[default]
    Emotion,
    /// Rules written by hand: thresholds of the same measures of progress, without filter or hysteresis \[I\].
    Rules,
    /// The time since the need arose \[I\].
    Timer,
    /// The waiter calls once when the need presses. Nothing makes a robot hurry, intercept or give up \[I\].
    Neither,
}

impl Policy {
    /// What a robot acts by, with regard to whether it has emotions that act on its behavior.
    #[must_use]
    pub fn given(self, has_emotions: bool) -> Self {
        if self == Self::Emotion && !has_emotions {
            Self::Neither
        } else {
            self
        }
    }
}

/// How far the waiter goes to be refilled: the action tendencies of the paper's Table 2, in its order \[D\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Urge {
    /// To serve.
    None,
    /// To call the refiller.
    Call,
    /// To ask her to hurry.
    Hurry,
    /// To change the strategy, and meet her.
    Intercept,
}

impl Urge {
    /// Every urge.
    pub const ALL: [Self; 4] = [Self::None, Self::Call, Self::Hurry, Self::Intercept];

    /// The action tendency of an emotion. ANGRY is beyond FRUSTRATED \[I\]; the emotions of beliefs urge to nothing \[I\].
    #[must_use]
    pub fn of(emotion: StandardEmotion) -> Self {
        match emotion {
            StandardEmotion::Happy | StandardEmotion::Discouraged | StandardEmotion::Hopeful => {
                Self::None
            }
            StandardEmotion::Confident => Self::Call,
            StandardEmotion::Concerned => Self::Hurry,
            StandardEmotion::Frustrated | StandardEmotion::Angry => Self::Intercept,
        }
    }

    /// The greatest urge whose threshold a pressure reaches; `thresholds` are those of CALL, HURRY and INTERCEPT.
    #[must_use]
    pub fn at(pressure: f64, thresholds: [f64; 3]) -> Self {
        let reached = thresholds.iter().filter(|least| pressure >= **least);
        Self::ALL[reached.count()]
    }
}

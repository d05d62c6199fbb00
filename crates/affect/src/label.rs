//! Labels for emotions, and the feeling of a robot at one moment.
//!
//! Dynamics and generators work with any set of emotions. A robot with emotions of its own declares an enum and
//! implements [`EmotionLabel`]; other robots use [`StandardEmotion`].

use crate::affect::{Affect, Valence};
use crate::scalar::{Intensity, Urgency};
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// A set of emotions, with one value for each.
///
/// Logs, panels, other robots and the schemata refer to emotions by name. By convention, names are in capitals
/// [D: S].
pub trait EmotionLabel: Copy + Eq + Debug {
    /// The name under which the emotion is published and its schema is looked up.
    fn name(self) -> &'static str;

    /// Whether the emotion is pleasant. The sensory-motor level sees only this and the felt intensity.
    fn valence(self) -> Valence;
}

/// The emotions of the documented robots.
///
/// The waiter and the refiller have HAPPY, CONFIDENT, CONCERNED and FRUSTRATED, the paper's example of the dynamics
/// has HAPPY, CONCERNED, FRUSTRATED and ANGRY, and its example of beliefs has DISCOURAGED and HOPEFUL [D: S]. The
/// valences are chosen here \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum StandardEmotion {
    /// Everything goes well. The initial emotion of both documented state sets.
    Happy,
    /// Help will be needed and is expected to arrive.
    Confident,
    /// Progress is too slow.
    Concerned,
    /// The current strategy does not work.
    Frustrated,
    /// Another agent has been to blame for the lack of progress for a long time.
    Angry,
    /// The robot believes that it cannot achieve its goal.
    Discouraged,
    /// The robot believes that it can achieve its goal after all.
    Hopeful,
}

impl StandardEmotion {
    /// Every standard emotion.
    pub const ALL: [Self; 7] = [
        Self::Happy,
        Self::Confident,
        Self::Concerned,
        Self::Frustrated,
        Self::Angry,
        Self::Discouraged,
        Self::Hopeful,
    ];

    /// The emotion with this name, if there is one.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|emotion| emotion.name() == name)
    }

    /// Whether this emotion is at least as serious as `other`.
    ///
    /// The scale is HAPPY, CONFIDENT, CONCERNED, FRUSTRATED, ANGRY: the order of the paper's Table 2, with ANGRY
    /// added at the end \[I\]. DISCOURAGED and HOPEFUL come from beliefs and are not on the scale; if either emotion is
    /// one of them, the result is `false`.
    pub fn reaches(self, other: Self) -> bool {
        match (self.severity(), other.severity()) {
            (Some(mine), Some(others)) => mine >= others,
            _ => false,
        }
    }

    fn severity(self) -> Option<u8> {
        match self {
            Self::Happy => Some(0),
            Self::Confident => Some(1),
            Self::Concerned => Some(2),
            Self::Frustrated => Some(3),
            Self::Angry => Some(4),
            Self::Discouraged | Self::Hopeful => None,
        }
    }
}

impl EmotionLabel for StandardEmotion {
    fn name(self) -> &'static str {
        match self {
            Self::Happy => "HAPPY",
            Self::Confident => "CONFIDENT",
            Self::Concerned => "CONCERNED",
            Self::Frustrated => "FRUSTRATED",
            Self::Angry => "ANGRY",
            Self::Discouraged => "DISCOURAGED",
            Self::Hopeful => "HOPEFUL",
        }
    }

    fn valence(self) -> Valence {
        match self {
            Self::Happy | Self::Confident | Self::Hopeful => Valence::Positive,
            Self::Concerned | Self::Frustrated | Self::Angry | Self::Discouraged => {
                Valence::Negative
            }
        }
    }
}

/// An emotion, and how urgent the need is with which it comes; the intensity follows from both.
///
/// The published taxonomy has a node of this name, the experience of an emotion [D: F2]. A feeling is a copy, so
/// code that receives one cannot change what the robot feels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Feeling<E> {
    /// The emotion.
    pub emotion: E,
    /// How pressing the need is.
    pub urgency: Urgency,
}

impl<E: EmotionLabel> Feeling<E> {
    /// Valence and intensity, without the particular emotion.
    pub fn affect(&self) -> Affect {
        Affect::new(self.emotion.valence(), self.urgency)
    }

    /// How strongly the emotion is felt.
    pub fn intensity(&self) -> Intensity {
        self.affect().intensity
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use StandardEmotion::{Angry, Concerned, Confident, Discouraged, Frustrated, Happy, Hopeful};

    #[test]
    fn severity_follows_table_2() {
        let scale = [Happy, Confident, Concerned, Frustrated, Angry];
        for (i, lower) in scale.iter().enumerate() {
            for (j, upper) in scale.iter().enumerate() {
                assert_eq!(upper.reaches(*lower), j >= i);
            }
        }

        assert!(!Discouraged.reaches(Happy));
        assert!(!Hopeful.reaches(Happy));
        assert!(!Angry.reaches(Hopeful));
    }

    #[test]
    fn happy_is_better_than_confident_and_frustrated_worse_than_concerned() {
        let felt = |emotion: StandardEmotion, urgency| {
            let urgency = Urgency::saturating(urgency);
            Feeling { emotion, urgency }.affect().signed()
        };

        assert_eq!(felt(Happy, 0.0), 1.0);
        // The urgencies at which the standard ladder changes the emotion.
        assert!(felt(Happy, 0.24) > felt(Confident, 0.25));
        assert!(felt(Confident, 0.44) > 0.0);
        assert!(felt(Concerned, 0.45) < 0.0);
        assert!(felt(Concerned, 0.74) > felt(Frustrated, 0.75));
        assert_eq!(felt(Frustrated, 1.0), -1.0);
    }

    #[test]
    fn the_name_is_the_serialized_form() {
        for emotion in StandardEmotion::ALL {
            let json = serde_json::to_string(&emotion).unwrap();
            assert_eq!(json, format!("\"{}\"", emotion.name()));
            assert_eq!(StandardEmotion::named(emotion.name()), Some(emotion));
        }
    }
}

//! What an emotion is called, and what a robot feels at one moment.
//!
//! The dynamics and the generators work with any set of emotions. A robot that needs an emotion nobody
//! else has declares an enum and implements [`EmotionLabel`]; the others take [`StandardEmotion`].

use crate::akr::{Affect, Valence};
use crate::scalar::Intensity;
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// A set of emotions, one value for each.
///
/// Names are what logs, panels, peers and the schemata use; they are spelled in capitals by custom [D: S].
pub trait EmotionLabel: Copy + Eq + Debug {
    /// The name under which the emotion is published and its schema is found.
    fn name(self) -> &'static str;

    /// Pleasant or unpleasant: all that the sensory-motor level learns of an emotion besides its intensity.
    fn valence(self) -> Valence;
}

/// The emotions of the documented robots.
///
/// HAPPY, CONFIDENT, CONCERNED, FRUSTRATED are those of the waiter and refiller, HAPPY, CONCERNED,
/// FRUSTRATED, ANGRY those of the dynamics example, DISCOURAGED and HOPEFUL those of the belief example
/// [D: S]. The valence of each is chosen here \[I\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum StandardEmotion {
    /// All goes as wished; the start of both documented state sets.
    Happy,
    /// Help will be needed, and is expected to come.
    Confident,
    /// Progress is too slow.
    Concerned,
    /// The present strategy does not work.
    Frustrated,
    /// Somebody else is to blame for it, and has been for long.
    Angry,
    /// Convinced of being unable.
    Discouraged,
    /// Convinced of being able after all.
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

    /// Whether this emotion is at least as serious as `other` on the scale HAPPY, CONFIDENT, CONCERNED,
    /// FRUSTRATED, ANGRY (the order of the seed's Table 2, with ANGRY above \[I\]).
    ///
    /// DISCOURAGED and HOPEFUL come from beliefs and have no place on that scale: the answer is then no.
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

/// What is felt now: an emotion, experienced with an intensity.
///
/// The published taxonomy has a node of this name, the experience of an emotion [D: F2]. It is a copy:
/// whoever holds one can read it, and cannot change what the robot feels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Feeling<E> {
    /// Which emotion.
    pub emotion: E,
    /// How strongly.
    pub intensity: Intensity,
}

impl<E: EmotionLabel> Feeling<E> {
    /// The coarse part of it, valence and intensity.
    pub fn affect(&self) -> Affect {
        Affect {
            valence: self.emotion.valence(),
            intensity: self.intensity,
        }
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
        assert!(!Discouraged.reaches(Happy) && !Hopeful.reaches(Happy) && !Angry.reaches(Hopeful));
    }

    #[test]
    fn the_name_is_the_serialized_form() {
        for emotion in StandardEmotion::ALL {
            let json = serde_json::to_string(&emotion).unwrap();
            assert_eq!(json, format!("\"{}\"", emotion.name()));
        }
    }
}

//! Where a robot starts, as written in the file: `["4 ft", "4 ft"]`, or `"random"`.

use config::FixedList;
use config::units::Length;
use protocol::messages::Point;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::super::checked::RobotSpec;

/// The word for a place that follows from the seed.
const RANDOM: &str = "random";

/// A place of a robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum StartPlace {
    /// A given one.
    Given {
        at: FixedList<Length, 2>,
        /// Whether it follows from the seed, which a file does not say.
        is_drawn: bool,
    },
    /// Any free one, by the seed.
    Random,
}

impl StartPlace {
    /// The place of a robot, written out.
    pub(super) fn of(spec: &RobotSpec) -> Self {
        Self::Given {
            at: FixedList([Length(spec.at.x), Length(spec.at.y)]),
            is_drawn: spec.is_at_random,
        }
    }

    /// Makes a place that follows from the seed any place again.
    pub(super) fn forget(&mut self) {
        if matches!(self, Self::Given { is_drawn: true, .. }) {
            *self = Self::Random;
        }
    }

    /// The place; the corner of the field while it is not known.
    pub(super) fn point(self) -> Point {
        match self {
            Self::Given {
                at: FixedList([x, y]),
                ..
            } => Point::new(x.0, y.0),
            Self::Random => Point::default(),
        }
    }
}

impl<'de> Deserialize<'de> for StartPlace {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(StartPlaceVisitor)
    }
}

impl Serialize for StartPlace {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Given { at, .. } => at.serialize(serializer),
            Self::Random => serializer.serialize_str(RANDOM),
        }
    }
}

struct StartPlaceVisitor;

impl<'de> Visitor<'de> for StartPlaceVisitor {
    type Value = StartPlace;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "a place such as [\"4 ft\", \"4 ft\"], a list of exactly 2 elements, or \"{RANDOM}\""
        )
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<StartPlace, E> {
        if text == RANDOM {
            return Ok(StartPlace::Random);
        }
        Err(E::invalid_value(serde::de::Unexpected::Str(text), &self))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<StartPlace, A::Error> {
        let at = FixedList::deserialize(SeqAccessDeserializer::new(list))?;
        Ok(StartPlace::Given {
            at,
            is_drawn: false,
        })
    }
}

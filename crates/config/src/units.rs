//! Quantities with units, such as `"50 ft"`, `"2 ft/s"` and `"0.5 s"`, which are converted to SI.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Units with their dimensions and their values in SI units.
const UNITS: [(&str, Dimension, f64); 27] = [
    ("m", Dimension::Length, 1.0),
    ("cm", Dimension::Length, 0.01),
    ("km", Dimension::Length, 1000.0),
    // The international foot, exact by definition (1959).
    ("ft", Dimension::Length, 0.3048),
    ("m/s", Dimension::Speed, 1.0),
    ("km/h", Dimension::Speed, 1.0 / 3.6),
    ("ft/s", Dimension::Speed, 0.3048),
    ("ms", Dimension::Time, 0.001),
    ("s", Dimension::Time, 1.0),
    ("min", Dimension::Time, 60.0),
    ("h", Dimension::Time, 3600.0),
    ("rad", Dimension::Angle, 1.0),
    ("deg", Dimension::Angle, std::f64::consts::PI / 180.0),
    ("rad/s", Dimension::TurnRate, 1.0),
    ("deg/s", Dimension::TurnRate, std::f64::consts::PI / 180.0),
    ("m/s2", Dimension::Acceleration, 1.0),
    ("ft/s2", Dimension::Acceleration, 0.3048),
    ("rad/s2", Dimension::TurnAcceleration, 1.0),
    (
        "deg/s2",
        Dimension::TurnAcceleration,
        std::f64::consts::PI / 180.0,
    ),
    ("Hz", Dimension::Frequency, 1.0),
    ("kHz", Dimension::Frequency, 1e3),
    ("MHz", Dimension::Frequency, 1e6),
    ("GHz", Dimension::Frequency, 1e9),
    ("bit/s", Dimension::BitRate, 1.0),
    ("kbit/s", Dimension::BitRate, 1e3),
    ("Mbit/s", Dimension::BitRate, 1e6),
    ("Gbit/s", Dimension::BitRate, 1e9),
];

/// What a quantity measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// Meters.
    Length,
    /// Meters per second.
    Speed,
    /// Seconds.
    Time,
    /// Radians.
    Angle,
    /// Radians per second.
    TurnRate,
    /// Meters per second squared.
    Acceleration,
    /// Radians per second squared.
    TurnAcceleration,
    /// Hertz.
    Frequency,
    /// Bits per second.
    BitRate,
}

impl Dimension {
    /// What a name with a unit measures, such as `patience_s`; `None` if it does not end in a unit.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        let (_, unit) = name.rsplit_once('_')?;

        Some(match unit {
            "m" => Self::Length,
            "mps" => Self::Speed,
            "s" => Self::Time,
            "rad" => Self::Angle,
            "radps" => Self::TurnRate,
            "mps2" => Self::Acceleration,
            "radps2" => Self::TurnAcceleration,
            "hz" => Self::Frequency,
            "bps" => Self::BitRate,
            _ => return None,
        })
    }

    /// What it is, with examples of how it is written.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Length => "a length such as \"50 ft\" or \"15 m\"",
            Self::Speed => "a speed such as \"2 ft/s\" or \"0.5 m/s\"",
            Self::Time => "a time such as \"0.5 s\" or \"10 min\"",
            Self::Angle => "an angle such as \"90 deg\"",
            Self::TurnRate => "a turn rate such as \"90 deg/s\"",
            Self::Acceleration => "an acceleration such as \"0.5 m/s2\"",
            Self::TurnAcceleration => "a turn acceleration such as \"180 deg/s2\"",
            Self::Frequency => "a frequency such as \"2.4 GHz\"",
            Self::BitRate => "a bit rate such as \"250 kbit/s\"",
        }
    }
}

/// Parses a number with a unit. Returns its value in SI units and its dimension; `None` if the text is not a quantity.
#[must_use]
pub fn quantity(text: &str) -> Option<(f64, Dimension)> {
    let text = text.trim();
    let split =
        text.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e' | 'E')))?;
    let (number, unit) = text.split_at(split);
    let number: f64 = number.parse().ok()?;

    let unit = unit.trim();
    let (_, dimension, factor) = UNITS.iter().find(|(name, ..)| *name == unit)?;
    let value = number * factor;
    value.is_finite().then_some((value, *dimension))
}

macro_rules! quantity_type {
    ($(#[$doc:meta])* $type:ident, $dimension:expr, $unit:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
        pub struct $type(pub f64);

        impl From<$type> for f64 {
            /// The number in SI units.
            fn from(value: $type) -> Self {
                value.0
            }
        }

        impl std::str::FromStr for $type {
            type Err = String;
            fn from_str(text: &str) -> Result<Self, String> {
                match quantity(text) {
                    Some((value, dimension)) if dimension == $dimension => Ok(Self(value)),
                    _ => Err(format!("{text:?} is not {}", $dimension.name())),
                }
            }
        }

        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                struct Visitor;

                impl serde::de::Visitor<'_> for Visitor {
                    type Value = $type;
                    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                        f.write_str($dimension.name())
                    }

                    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<$type, E> {
                        text.parse().map_err(E::custom)
                    }
                }

                deserializer.deserialize_str(Visitor)
            }
        }

        impl Serialize for $type {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.collect_str(&format_args!("{} {}", self.0, $unit))
            }
        }
    };
}

quantity_type! {
    /// A length, meters.
    Length, Dimension::Length, "m"
}
quantity_type! {
    /// A speed, meters per second.
    Speed, Dimension::Speed, "m/s"
}
quantity_type! {
    /// An angle, radians.
    Angle, Dimension::Angle, "rad"
}
quantity_type! {
    /// A time, seconds.
    Time, Dimension::Time, "s"
}
quantity_type! {
    /// A turn rate, radians per second.
    TurnRate, Dimension::TurnRate, "rad/s"
}
quantity_type! {
    /// An acceleration, meters per second squared.
    Acceleration, Dimension::Acceleration, "m/s2"
}
quantity_type! {
    /// A turn acceleration, radians per second squared.
    TurnAcceleration, Dimension::TurnAcceleration, "rad/s2"
}
quantity_type! {
    /// A frequency, hertz.
    Frequency, Dimension::Frequency, "Hz"
}
quantity_type! {
    /// A bit rate, bits per second.
    BitRate, Dimension::BitRate, "bit/s"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_and_anything_else_is_not() {
        assert_eq!(quantity("50 ft"), Some((15.24, Dimension::Length)));
        assert_eq!(quantity("2ft/s"), Some((0.6096, Dimension::Speed)));
        assert_eq!(quantity("1e-1 s"), Some((0.1, Dimension::Time)));
        assert_eq!(quantity("2 m/s2"), Some((2.0, Dimension::Acceleration)));
        assert_eq!(
            quantity("180 deg/s"),
            Some((std::f64::consts::PI, Dimension::TurnRate))
        );
        for other in [
            "50",
            "ft",
            "50 furlong",
            "Leguin",
            "",
            "5 m5",
            "inf m",
            "1e309 m",
            "1e308 h",
        ] {
            assert_eq!(quantity(other), None, "{other:?}");
        }
        assert!("2 s".parse::<Length>().is_err());
    }

    #[test]
    fn what_is_written_is_read_back_to_the_bit() {
        for text in ["50 ft", "0.1 ft", "33.333 cm"] {
            let length: Length = text.parse().unwrap();
            let again: Length = format!("{} m", length.0).parse().unwrap();
            assert_eq!(length.0.to_bits(), again.0.to_bits());
        }
    }
}

//! Numbers that mean something: intensity and caution, both in `[0, 1]`.
//!
//! A bare `f64` would let a robot author pass a distance where a degree of feeling is meant. These two
//! types cannot hold anything outside their interval, and not a NaN either.

use serde::{Deserialize, Serialize};

/// A number that does not belong to the interval its type stands for.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{what} must lie in [0, 1], not {value}")]
pub struct OutOfRange {
    /// Which quantity was meant.
    pub what: &'static str,
    /// The number that was refused.
    pub value: f64,
}

/// Whether `elapsed_s` seconds make up `needed_s`. Sums of steps such as 0.1 s fall short of what they mean by
/// far less than the slack, and no step is as short as it.
pub(crate) fn has_elapsed(elapsed_s: f64, needed_s: f64) -> bool {
    const SLACK_S: f64 = 1e-9;
    elapsed_s + SLACK_S >= needed_s
}

macro_rules! unit_interval {
    ($(#[$doc:meta])* $name:ident, $what:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize, Deserialize)]
        #[serde(try_from = "f64", into = "f64")]
        pub struct $name(f64);

        impl $name {
            /// The lower end, 0.
            pub const MIN: Self = Self(0.0);
            /// The upper end, 1.
            pub const MAX: Self = Self(1.0);

            /// Takes a number of `[0, 1]` and refuses every other, NaN included.
            pub fn new(value: f64) -> Result<Self, OutOfRange> {
                if (0.0..=1.0).contains(&value) {
                    Ok(Self(value))
                } else {
                    Err(OutOfRange { what: $what, value })
                }
            }

            /// Takes any number and moves it to the nearest end of the interval; NaN becomes 0.
            pub fn saturating(value: f64) -> Self {
                if value > 0.0 { Self(value.min(1.0)) } else { Self(0.0) }
            }

            /// The plain number.
            pub fn value(self) -> f64 {
                self.0
            }
        }

        impl TryFrom<f64> for $name {
            type Error = OutOfRange;

            fn try_from(value: f64) -> Result<Self, OutOfRange> {
                Self::new(value)
            }
        }

        impl From<$name> for f64 {
            fn from(value: $name) -> f64 {
                value.0
            }
        }
    };
}

unit_interval! {
    /// How strongly something is felt, 0 (not at all) to 1 (as strongly as possible).
    ///
    /// That intensity may be a scalar inside and one of five labels outside is documented [D: S]; the
    /// interval is chosen here \[I\].
    Intensity, "intensity"
}

unit_interval! {
    /// The one personality trait that the documented robots have: how fast their feelings rise.
    ///
    /// Name and direction (more caution, faster rise) are documented [D: S]; the interval is chosen here \[I\].
    Caution, "caution"
}

impl Intensity {
    /// The label, by the cut points of [`IntensityLabel::CUTS`].
    pub fn label(self) -> IntensityLabel {
        self.label_by(&IntensityLabel::CUTS)
    }

    /// The label, by cut points of one's own, in ascending order.
    pub fn label_by(self, cuts: &[f64; 4]) -> IntensityLabel {
        let reached = cuts.iter().filter(|cut| self.0 >= **cut).count();
        IntensityLabel::ALL[reached]
    }
}

impl Default for Intensity {
    fn default() -> Self {
        Self::MIN
    }
}

impl Default for Caution {
    /// The middle of the interval \[I\].
    fn default() -> Self {
        Self(0.5)
    }
}

/// The five degrees of intensity [D: S], weakest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IntensityLabel {
    /// Below the first cut.
    VeryLow,
    /// From the first cut.
    Low,
    /// From the second cut.
    Medium,
    /// From the third cut.
    High,
    /// From the fourth cut.
    VeryHigh,
}

impl IntensityLabel {
    /// Lower ends of low, medium, high and very high \[I\]: five equal parts.
    pub const CUTS: [f64; 4] = [0.2, 0.4, 0.6, 0.8];

    /// Every label, weakest first.
    pub const ALL: [Self; 5] = [
        Self::VeryLow,
        Self::Low,
        Self::Medium,
        Self::High,
        Self::VeryHigh,
    ];

    /// The label in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::VeryLow => "very low",
            Self::Low => "low",
            Self::Medium => "medium",
            Self::High => "high",
            Self::VeryHigh => "very high",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_outside_the_interval_are_refused_or_saturated() {
        assert!(Intensity::new(1.0).is_ok() && Intensity::new(0.0).is_ok());
        for wrong in [-0.1, 1.1, f64::NAN, f64::INFINITY] {
            assert!(
                Intensity::new(wrong).is_err() && Caution::new(wrong).is_err(),
                "{wrong}"
            );
        }
        assert_eq!(Intensity::saturating(7.0), Intensity::MAX);
        assert_eq!(Intensity::saturating(-7.0), Intensity::MIN);
        assert_eq!(Intensity::saturating(f64::NAN), Intensity::MIN);
        assert_eq!(
            Caution::new(2.0).map_err(|error| error.to_string()),
            Err("caution must lie in [0, 1], not 2".to_owned())
        );
    }

    #[test]
    fn a_cut_point_belongs_to_the_stronger_label() {
        let label = |value| Intensity::saturating(value).label().name();
        assert_eq!(label(0.0), "very low");
        assert_eq!(label(0.199), "very low");
        assert_eq!(label(0.2), "low");
        assert_eq!(label(0.4), "medium");
        assert_eq!(label(0.6), "high");
        assert_eq!(label(0.8), "very high");
        assert_eq!(label(1.0), "very high");
    }
}

//! Urgency, intensity and caution, the types for numbers in `[0, 1]`.
//!
//! Separate types prevent mixing up these quantities with others, such as distances. Their values are never NaN or
//! outside the interval.

use serde::{Deserialize, Serialize};

/// A number outside the interval of its type.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{what} must lie in [0, 1], not {value}")]
pub struct OutOfRange {
    /// The quantity.
    pub what: &'static str,
    /// The rejected number.
    pub value: f64,
}

/// Whether at least `needed_s` seconds have elapsed, with an allowance for rounding errors.
///
/// The slack is much larger than the rounding errors in sums of steps such as 0.1 s, and shorter than any step.
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

            /// Creates a value from a number in `[0, 1]`.
            ///
            /// # Errors
            ///
            /// Returns [`OutOfRange`] for any other number, including NaN.
            pub fn new(value: f64) -> Result<Self, OutOfRange> {
                if (0.0..=1.0).contains(&value) {
                    Ok(Self(value))
                } else {
                    Err(OutOfRange { what: $what, value })
                }
            }

            /// Creates a value from any number, clamped to `[0, 1]`. NaN becomes 0.
            pub fn saturating(value: f64) -> Self {
                if value > 0.0 { Self(value.min(1.0)) } else { Self(0.0) }
            }

            /// The value as a number.
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
    /// How pressing a need is, from 0 (not at all) to 1: the variable of the dynamics, from which the emotion and its
    /// intensity follow.
    ///
    /// The paper says that the intensity of an emotion "is relevant to the importance, relevance and urgency of the
    /// message that the state carries" [D: S]. That it is a variable of its own is chosen here \[I\].
    Urgency, "urgency"
}

unit_interval! {
    /// How strongly something is felt, from 0 (not at all) to 1 (as strongly as possible).
    ///
    /// It is documented that intensity can be a scalar internally and one of five labels externally [D: S]. The
    /// interval is chosen here \[I\].
    Intensity, "intensity"
}

unit_interval! {
    /// The only personality trait of the documented robots: how fast the urgency of their emotions rises.
    ///
    /// The name and the direction (more caution, faster rise) are documented [D: S]. The interval is chosen here \[I\].
    Caution, "caution"
}

impl Intensity {
    /// The label for this intensity, by cut points in ascending order.
    pub fn label(self, cuts: &[f64; 4]) -> IntensityLabel {
        let reached = cuts.iter().filter(|cut| self.0 >= **cut).count();
        IntensityLabel::ALL[reached]
    }
}

impl Default for Urgency {
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

/// The five labels of intensity [D: S], weakest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IntensityLabel {
    /// Below the first cut point.
    VeryLow,
    /// From the first cut point.
    Low,
    /// From the second cut point.
    Medium,
    /// From the third cut point.
    High,
    /// From the fourth cut point.
    VeryHigh,
}

impl IntensityLabel {
    /// Lower bounds of low, medium, high and very high, which give five equal intervals \[I\].
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
    fn numbers_outside_the_interval_are_rejected_or_clamped() {
        assert!(Intensity::new(1.0).is_ok());
        assert!(Intensity::new(0.0).is_ok());

        for wrong in [-0.1, 1.1, f64::NAN, f64::INFINITY] {
            assert!(Intensity::new(wrong).is_err(), "{wrong}");
            assert!(Caution::new(wrong).is_err(), "{wrong}");
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
        for (value, label) in [
            (0.0, "very low"),
            (0.199, "very low"),
            (0.2, "low"),
            (0.4, "medium"),
            (0.6, "high"),
            (0.8, "very high"),
            (1.0, "very high"),
        ] {
            assert_eq!(
                Intensity::saturating(value)
                    .label(&IntensityLabel::CUTS)
                    .name(),
                label
            );
        }
    }
}

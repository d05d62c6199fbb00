//! Speed of the clock.

use std::str::FromStr;

/// Simulated seconds per second of wall clock; `None` is as fast as the barrier allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speed(pub Option<f64>);

/// A text is not a speed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is neither a number above zero nor `max`")]
pub struct SpeedError(String);

impl FromStr for Speed {
    type Err = SpeedError;

    /// Parses `max`, or a finite number above zero, which may end in `x`.
    fn from_str(text: &str) -> Result<Self, SpeedError> {
        if text == "max" {
            return Ok(Self(None));
        }

        let factor = text.trim_end_matches('x').parse::<f64>();
        match factor {
            Ok(factor) if factor > 0.0 && factor.is_finite() => Ok(Self(Some(factor))),
            _ => Err(SpeedError(text.to_owned())),
        }
    }
}

impl std::fmt::Display for Speed {
    /// Formats the speed so that [`Speed::from_str`] can parse it.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            Some(factor) => write!(f, "{factor}"),
            None => f.write_str("max"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_read_back_as_they_are_written() {
        for (text, speed) in [
            ("max", Speed(None)),
            ("2", Speed(Some(2.0))),
            ("0.5x", Speed(Some(0.5))),
        ] {
            assert_eq!(text.parse(), Ok(speed));
            assert_eq!(speed.to_string().parse(), Ok(speed));
        }

        for text in ["0", "-1", "inf", "NaN", "fast", ""] {
            assert!(text.parse::<Speed>().is_err(), "{text:?}");
        }
    }
}

//! A moment of a run, as people name it.

use std::str::FromStr;

use config::units::Time;
use protocol::Tick;

/// A moment of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Moment {
    /// A tick.
    Tick(Tick),
    /// A simulated time.
    Time(Time),
}

impl FromStr for Moment {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(tick) = text.parse() {
            return Ok(Self::Tick(tick));
        }
        match text.parse() {
            Ok(time @ Time(seconds)) if seconds >= 0.0 => Ok(Self::Time(time)),
            _ => Err(format!(
                "{text:?} is neither a tick nor a time, such as 240 or \"120 s\""
            )),
        }
    }
}

impl Moment {
    /// The tick that is in progress at the moment, where a tick lasts `tick_s` seconds.
    #[must_use]
    pub fn tick(self, tick_s: f64) -> Tick {
        match self {
            Self::Tick(tick) => tick,
            // A time that is a whole number of ticks is that tick, also where the division is not exact.
            Self::Time(Time(seconds)) => (seconds / tick_s + 1e-6).floor() as Tick,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_is_a_tick_or_a_time() {
        for (text, tick) in [("240", 240), ("120 s", 240), ("2 min", 240), ("0.7s", 1)] {
            let moment: Moment = text.parse().unwrap();
            assert_eq!(moment.tick(0.5), tick, "{text}");
        }
        assert_eq!("0.3 s".parse::<Moment>().unwrap().tick(0.1), 3);
        for text in ["", "-1", "-1 s", "3 m", "soon"] {
            assert!(text.parse::<Moment>().is_err(), "{text}");
        }
    }
}

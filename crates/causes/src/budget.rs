//! How much is spent on an answer.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use config::units::Time;

/// How much is spent on an answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WhyBudget {
    /// About as many forks. The same number gives the same answer.
    Forks(u64),
    /// No fork is begun after this time of wall clock. The answer depends on it.
    Time(Duration),
}

impl FromStr for WhyBudget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(forks) = text.trim().parse() {
            return match forks {
                0 => Err("a budget is at least 1 fork".to_owned()),
                forks => Ok(Self::Forks(forks)),
            };
        }

        let time: Time = text.parse().map_err(|_| {
            format!("{text:?} is neither a number of forks nor a time such as \"5 min\"")
        })?;
        if time.0 <= 0.0 {
            return Err("a budget is more than 0 s".to_owned());
        }

        // A number of seconds that no duration can hold is refused, not cut off: the answer would end at another time than asked.
        Duration::try_from_secs_f64(time.0)
            .map(Self::Time)
            .map_err(|_| {
                format!(
                    "{text:?} is too long; without a budget an answer takes as long as it needs"
                )
            })
    }
}

impl fmt::Display for WhyBudget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Forks(forks) => write!(f, "{forks}"),
            Self::Time(time) => write!(f, "{} s", time.as_secs_f64()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_a_number_of_forks_or_a_time() {
        let read = |text: &str| text.parse::<WhyBudget>();
        assert_eq!(read("2000"), Ok(WhyBudget::Forks(2000)));
        let time = WhyBudget::Time(Duration::from_secs(300));
        assert_eq!(read("5 min"), Ok(time));
        assert_eq!(read(&time.to_string()), Ok(time));
        for wrong in ["", "0", "-1", "1.5", "0 s", "-1 s", "1e30 s", "soon", "5 m"] {
            assert!(read(wrong).is_err(), "{wrong:?}");
        }
    }
}

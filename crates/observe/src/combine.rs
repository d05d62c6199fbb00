//! How several numbers become one: those of robots, of sites, of the cells of a layer.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::comparison::ValueTest;

/// How the numbers of several robots become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum By {
    /// Their sum, in the order of the robots' names.
    Sum,
    /// Their mean.
    Mean,
    /// The largest.
    Max,
    /// The least.
    Min,
    /// The largest less the least.
    Spread,
    /// Jain's index of fairness: (Σx)² / (n Σx²) (Jain, Chiu and Hawe 1984).
    Jain,
    /// 1 if none of them is 0, otherwise 0.
    All,
    /// 1 if one of them is not 0, otherwise 0.
    Any,
    /// How many of them are not 0.
    Count,
}

/// How the cells of a layer become one number, in words.
const WAYS: &str = "\"sum\", \"mean\", \"max\" or \"min\"";
/// The same if each cell passes a test or not.
const WAYS_OF_TESTED: &str = "\"mean\", \"count\", \"all\" or \"any\"";

impl fmt::Display for By {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Sum => "sum",
            Self::Mean => "mean",
            Self::Max => "max",
            Self::Min => "min",
            Self::Spread => "spread",
            Self::Jain => "jain",
            Self::All => "all",
            Self::Any => "any",
            Self::Count => "count",
        })
    }
}

/// Checks how the cells become one number; `is_tested`: whether each passes a test or not.
///
/// # Errors
/// The ways that there are, in words.
pub(crate) fn check_cells(by: Option<By>, is_tested: bool) -> Result<By, &'static str> {
    match (by, is_tested) {
        (Some(by @ (By::Sum | By::Mean | By::Max | By::Min)), false)
        | (Some(by @ (By::Mean | By::Count | By::All | By::Any)), true) => Ok(by),
        (_, false) => Err(WAYS),
        (_, true) => Err(WAYS_OF_TESTED),
    }
}

/// The number of the cells of a layer, in their order; `None` without a cell. With a test, the number of each is 1 if it passes, and
/// otherwise 0.
pub(crate) fn combine_cells(cells: &[f64], by: By, test: Option<&ValueTest>) -> Option<f64> {
    by.combine(cells.iter().map(|cell| match test {
        Some(test) => truth(test.hold_number(*cell)),
        None => *cell,
    }))
}

/// 1 for what holds, otherwise 0.
pub(crate) fn truth(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

impl By {
    /// The number of some numbers, in their order; `None` without one.
    pub(crate) fn combine(self, numbers: impl IntoIterator<Item = f64>) -> Option<f64> {
        let mut numbers = numbers.into_iter();
        let first = numbers.next()?;
        let (mut sum, mut squares) = (first, first * first);
        let (mut max, mut min) = (first, first);
        let mut count = 1.0;
        let mut not_zero = truth(first != 0.0);
        for number in numbers {
            sum += number;
            squares += number * number;
            max = max.max(number);
            min = min.min(number);
            count += 1.0;
            not_zero += truth(number != 0.0);
        }

        Some(match self {
            Self::Sum => sum,
            Self::Mean => sum / count,
            Self::Max => max,
            Self::Min => min,
            Self::Spread => max - min,
            Self::Jain => sum * sum / (count * squares),
            Self::All => truth(not_zero == count),
            Self::Any => truth(not_zero > 0.0),
            Self::Count => not_zero,
        })
    }
}

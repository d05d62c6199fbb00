//! One number of the cells of a layer.

use crate::comparison::ValueTest;
use crate::quantity::By;

/// How the cells of a layer become one number, in words.
const WAYS: &str = "\"sum\", \"mean\", \"max\" or \"min\"";
/// The same if each cell passes a test or not.
const WAYS_OF_TESTED: &str = "\"mean\", \"count\", \"all\" or \"any\"";

/// Checks how the cells become one number; `is_tested`: whether each passes a test or not.
///
/// # Errors
/// The ways that there are, in words.
pub(crate) fn check(by: Option<By>, is_tested: bool) -> Result<By, &'static str> {
    match (by, is_tested) {
        (Some(by @ (By::Sum | By::Mean | By::Max | By::Min)), false)
        | (Some(by @ (By::Mean | By::Count | By::All | By::Any)), true) => Ok(by),
        (_, false) => Err(WAYS),
        (_, true) => Err(WAYS_OF_TESTED),
    }
}

/// The number of the cells of a layer, in their order; `None` without a cell. With a test, the number of each is 1 if it passes, and
/// otherwise 0.
pub(crate) fn combine(cells: &[f64], by: By, test: Option<&ValueTest>) -> Option<f64> {
    let first = cells.first()?;
    let number = |cell: &f64| match test {
        Some(test) => f64::from(u8::from(test.hold_number(*cell))),
        None => *cell,
    };

    let mut sum = 0.0;
    let mut max = number(first);
    let mut min = max;
    for cell in cells {
        let number = number(cell);
        sum += number;
        max = max.max(number);
        min = min.min(number);
    }
    Some(match by {
        By::Mean => sum / cells.len() as f64,
        By::Max | By::Any => max,
        By::Min | By::All => min,
        _ => sum,
    })
}

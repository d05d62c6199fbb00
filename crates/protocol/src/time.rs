//! Simulated times as numbers and as texts. Every table has the same number for the same tick, and every text has the decimals
//! that the length of a tick needs.

use crate::Tick;

/// Most decimals of a time, which are nanoseconds.
const MAX_DECIMALS: usize = 9;
/// Below it a product of two numbers is off by less than half, so that rounding gives the right integer.
const EXACT: f64 = (1u64 << 50) as f64;

/// The simulated time of a tick, seconds: the shortest decimal number that is right. A product of floating-point numbers alone
/// is not (3 * 0.025 = 0.07500000000000001).
#[must_use]
pub fn time_s(tick: Tick, tick_s: f64) -> f64 {
    let product_s = tick as f64 * tick_s;
    for parts_per_s in [1e9, 1e6, 1e3] {
        let parts = (product_s * parts_per_s).round();
        if parts < EXACT {
            return parts / parts_per_s;
        }
    }

    product_s
}

/// How much later one simulated time is than another, seconds: without the error of a difference of floating-point numbers.
#[must_use]
pub fn between_s(earlier_s: f64, later_s: f64) -> f64 {
    time_s(1, later_s - earlier_s)
}

/// How many decimals a text needs to tell the times of two ticks apart, at least 1.
#[must_use]
pub fn decimals(tick_s: f64) -> usize {
    let nanos = (tick_s * 1e9).round();
    let mut unit_nanos = 1.0;
    for decimals in (2..=MAX_DECIMALS).rev() {
        unit_nanos *= 10.0;
        if nanos % unit_nanos != 0.0 {
            return decimals;
        }
    }

    1
}

/// A time as a text in seconds, without the unit, of a run whose ticks last `tick_s`.
#[must_use]
pub fn seconds(time_s: f64, tick_s: f64) -> String {
    let decimals = decimals(tick_s);
    format!("{time_s:.decimals$}")
}

/// The time of a tick as a text in seconds, without the unit.
#[must_use]
pub fn tick_seconds(tick: Tick, tick_s: f64) -> String {
    seconds(time_s(tick, tick_s), tick_s)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_difference_of_times_is_the_shortest_decimal_that_is_right() {
        assert_eq!(between_s(0.1, 0.4), 0.3);
        assert_eq!(between_s(1.7, 1.8), 0.1);
        assert_eq!(between_s(3.0, 3.0), 0.0);
    }

    #[test]
    fn the_time_of_a_tick_is_the_shortest_decimal_that_is_right() {
        for (tick, tick_s, text) in [
            (3, 0.025, "0.075"),
            (3, 0.1, "0.3"),
            (1_000_000_000, 0.025, "25000000"),
            (999_999_999, 0.1, "99999999.9"),
            (7, 1e-6, "0.000007"),
            (0, 0.5, "0"),
            (18446, 1e6, "18446000000"),
            (18_446_744_072, 1.0, "18446744072"),
        ] {
            assert_eq!(time_s(tick, tick_s).to_string(), text, "{tick} * {tick_s}");
        }
    }

    #[test]
    fn a_text_has_the_decimals_that_the_tick_needs() {
        for (tick_s, expected) in [
            (0.5, 1),
            (0.1, 1),
            (2.0, 1),
            (1e6, 1),
            (0.25, 2),
            (0.025, 3),
            (1.0 / 64.0, 6),
            (1e-6, 6),
            (1.0 / 3.0, 9),
            (0.0, 1),
        ] {
            assert_eq!(decimals(tick_s), expected, "{tick_s}");
        }
        assert_eq!(seconds(23.45, 0.025), "23.450");
        assert_eq!(tick_seconds(3, 0.025), "0.075");
        assert_eq!(tick_seconds(3, 0.5), "1.5");
    }

    proptest! {
        /// Against the arithmetic of integers.
        #[test]
        fn times_are_those_of_decimal_arithmetic(tick in 0u64..1_000_000_000, millis in 1u64..18_000) {
            let tick_s: f64 = format!("{}.{:03}", millis / 1000, millis % 1000).parse().unwrap();
            let product = u128::from(tick) * u128::from(millis);
            let right: f64 = format!("{}.{:03}", product / 1000, product % 1000).parse().unwrap();
            prop_assert_eq!(time_s(tick, tick_s), right);
        }
    }
}

//! Numbers as people read them: with as many digits as their intervals support.

/// Most decimals.
const MAX_DECIMALS: f64 = 12.0;
/// Digits of a number without an interval.
const DIGITS: i32 = 4;
/// Numbers from this on are written with an exponent.
const LARGE: f64 = 1e15;

/// Decimals with which the half width of an interval has two significant digits.
#[must_use]
pub fn decimals(half_width: f64) -> usize {
    decimals_of(half_width, 2)
}

/// A number with so many decimals; zero has no sign.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if value.abs() >= LARGE {
        return format!("{value:.3e}");
    }

    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    match text.strip_prefix('-') {
        Some(positive) if is_zero => positive.to_owned(),
        _ => text,
    }
}

/// The same with a plus sign if it is more than zero.
#[must_use]
pub fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    if value > 0.0 && text.bytes().any(|byte| matches!(byte, b'1'..=b'9')) {
        return format!("+{text}");
    }
    text
}

/// Decimals of a number that has no interval: four digits, without zeros at the end.
pub(super) fn decimals_alone(value: f64) -> usize {
    let text = fixed(value, decimals_of(value, DIGITS));
    match text.split_once('.') {
        Some((_, decimals)) => decimals.trim_end_matches('0').len(),
        None => 0,
    }
}

/// Decimals with which a number has so many significant digits.
fn decimals_of(value: f64, digits: i32) -> usize {
    let size = value.abs();
    if size == 0.0 || !size.is_finite() {
        return 0;
    }
    let magnitude = libm::floor(libm::log10(size));
    (f64::from(digits - 1) - magnitude).clamp(0.0, MAX_DECIMALS) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_width_has_two_digits() {
        for (half_width, expected) in [
            (123.0, 0),
            (12.3, 0),
            (9.97, 1),
            (1.0, 1),
            (0.5, 2),
            (0.0043, 4),
            (0.0, 0),
            (f64::INFINITY, 0),
            (f64::NAN, 0),
        ] {
            assert_eq!(decimals(half_width), expected, "{half_width}");
        }
    }

    #[test]
    fn zero_has_no_sign() {
        assert_eq!(fixed(-0.04, 1), "0.0");
        assert_eq!(signed(-0.04, 1), "0.0");
        assert_eq!(signed(0.04, 1), "0.0");
        assert_eq!(signed(0.06, 1), "+0.1");
        assert_eq!(signed(-0.06, 1), "-0.1");
        assert_eq!(fixed(1.7e308, 1), "1.700e308");
    }

    #[test]
    fn a_number_alone_has_four_digits_at_most() {
        for (value, expected) in [
            (3.0, "3"),
            (0.1, "0.1"),
            (0.004_312_9, "0.004313"),
            (12_345.6, "12346"),
        ] {
            assert_eq!(fixed(value, decimals_alone(value)), expected);
        }
    }
}

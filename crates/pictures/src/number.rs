//! Numbers as people read them.

/// Decimals with which numbers of this range are told apart: about three digits of it.
#[must_use]
pub fn decimals_for(range: f64) -> usize {
    match range.abs() {
        range if range >= 500.0 => 0,
        range if range >= 20.0 => 1,
        range if range >= 2.0 => 2,
        range if range >= 0.2 => 3,
        range if range > 0.0 => 4,
        _ => 0,
    }
}

/// A number with so many decimals. An en dash stands for what is not a number, ∞ for infinity.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if value.is_nan() {
        return "–".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "∞" } else { "-∞" }.to_owned();
    }

    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    match text.strip_prefix('-') {
        Some(positive) if is_zero => positive.to_owned(),
        _ => text,
    }
}

/// A number with so many decimals and a typographic minus sign, for charts.
pub(crate) fn typeset(value: f64, decimals: usize) -> String {
    fixed(value, decimals).replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_one_form() {
        assert_eq!(fixed(-0.04, 1), "0.0");
        assert_eq!(fixed(-0.06, 1), "-0.1");
        assert_eq!(fixed(1234.5, 0), "1234");
        assert_eq!(fixed(f64::NAN, 2), "–");
        assert_eq!(typeset(-3.0, 1), "−3.0");
    }

    #[test]
    fn smaller_ranges_have_more_decimals() {
        let ranges = [1000.0, 100.0, 10.0, 1.0, 0.1, 0.0, f64::NAN];
        let decimals: Vec<usize> = ranges.into_iter().map(decimals_for).collect();
        assert_eq!(decimals, [0, 1, 2, 3, 4, 0, 0]);
    }
}

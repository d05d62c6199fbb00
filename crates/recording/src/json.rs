//! JSON, the same bytes as `serde_json` writes, in less time: most numbers of a recording have few digits.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::Serializer;
use serde_json::ser::{CompactFormatter, Formatter};

/// Appends a value to bytes.
pub(crate) fn append(bytes: &mut Vec<u8>, value: &impl Serialize) {
    let mut serializer = Serializer::with_formatter(bytes, ShortNumbers);
    value
        .serialize(&mut serializer)
        .unwrap_or_else(|error| unreachable!("a record is always JSON: {error}"));
}

/// Writes digit by digit what most numbers of a recording are: places of guests in millimeters, and numbers below ten with one
/// or two decimals. The general way looks for the fewest digits that are read as the same number, and copies a text of any length.
struct ShortNumbers;

impl Formatter for ShortNumbers {
    #[inline]
    fn write_i64<W: ?Sized + Write>(&mut self, writer: &mut W, value: i64) -> io::Result<()> {
        match value {
            1_000..10_000 => writer.write_all(&digits::<4>(value as u32)),
            10_000..100_000 => writer.write_all(&digits::<5>(value as u32)),
            _ => CompactFormatter.write_i64(writer, value),
        }
    }

    #[inline]
    fn write_f64<W: ?Sized + Write>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        let Some(hundredths) = hundredths(value.abs()) else {
            return CompactFormatter.write_f64(writer, value);
        };

        if value.is_sign_negative() {
            writer.write_all(b"-")?;
        }
        match digits(hundredths) {
            [whole, tenth, b'0'] => writer.write_all(&[whole, b'.', tenth]),
            [whole, tenth, hundredth] => writer.write_all(&[whole, b'.', tenth, hundredth]),
        }
    }
}

/// A number from 0 up to 10 in hundredths, if it is the one that is nearest to a whole number of them: no fewer digits are read
/// as the same number then.
fn hundredths(value: f64) -> Option<u32> {
    if value >= 9.995 {
        return None;
    }
    let hundredths = (value * 100.0 + 0.5) as u32;
    (f64::from(hundredths) / 100.0 == value).then_some(hundredths)
}

/// The last `N` digits of a number.
fn digits<const N: usize>(mut number: u32) -> [u8; N] {
    let mut digits = [b'0'; N];
    // By pairs: half the divisions.
    for pair in digits.rchunks_mut(2) {
        let last = (number % 100) as u8;
        number /= 100;
        if let [tens, ones] = pair {
            *tens = b'0' + last / 10;
            *ones = b'0' + last % 10;
        } else {
            pair[0] = b'0' + last % 10;
        }
    }
    digits
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(value: &(impl Serialize + std::fmt::Debug)) {
        let mut bytes = Vec::new();
        append(&mut bytes, value);
        let expected = serde_json::to_string(value).unwrap();
        assert_eq!(String::from_utf8(bytes).unwrap(), expected, "{value:?}");
    }

    #[test]
    fn numbers_are_written_as_serde_json_writes_them() {
        for hundredths in 0..2_000 {
            let value = f64::from(hundredths) / 100.0;
            for value in [value, value.next_up(), value.next_down(), value + 0.005] {
                check(&value);
                check(&-value);
            }
        }
        for value in [1e-9, 0.1 + 0.2, 9.994, 9.995, 9.9999, 123.25, 1e16] {
            check(&value);
            check(&-value);
        }
        for value in [f64::MAX, f64::MIN_POSITIVE, f64::NAN, f64::INFINITY] {
            check(&value);
        }

        for value in (-20_000..120_000).step_by(7) {
            check(&value);
        }
        for value in [
            999,
            1_000,
            9_999,
            10_000,
            99_999,
            100_000,
            i64::MIN,
            i64::MAX,
        ] {
            check(&value);
        }
    }
}

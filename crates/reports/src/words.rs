//! Words and paths in reports.

/// A number of things in words.
pub(super) fn counted(count: usize, thing: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {thing}{plural}")
}

/// A text that begins with a capital letter.
pub(super) fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

/// A time in UTC, of which the seconds since 1970 are given.
pub(super) fn utc(unix_s: u64) -> String {
    let days = unix_s / 86_400;
    let second = unix_s % 86_400;

    // Years that begin in March, so that a leap day is the last day of its year, in cycles of 400 years.
    let day = days + 719_468;
    let cycle = day / 146_097;
    let day = day % 146_097;
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let is_next_year = month >= 10;
    let month = if is_next_year { month - 9 } else { month + 3 };

    format!(
        "{}-{month:02}-{day:02} {:02}:{:02}:{:02} UTC",
        400 * cycle + year + u64::from(is_next_year),
        second / 3_600,
        second / 60 % 60,
        second % 60
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_dates() {
        let times = [
            (0, "1970-01-01 00:00:00 UTC"),
            (951_782_399, "2000-02-28 23:59:59 UTC"),
            (951_782_400, "2000-02-29 00:00:00 UTC"),
            (1_709_251_199, "2024-02-29 23:59:59 UTC"),
            (1_767_225_600, "2026-01-01 00:00:00 UTC"),
            (4_107_542_400, "2100-03-01 00:00:00 UTC"),
        ];
        for (unix_s, date) in times {
            assert_eq!(utc(unix_s), date);
        }
    }

    #[test]
    fn words_begin_with_a_capital_letter() {
        assert_eq!(capitalized("tray empty"), "Tray empty");
        assert_eq!(capitalized("éxit"), "Éxit");
        assert_eq!(capitalized(""), "");
    }
}

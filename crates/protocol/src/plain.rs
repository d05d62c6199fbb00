//! Escapes text from robots, files and other processes before people read it: control characters steer a terminal or forge
//! lines, and bidirectional controls show text in another order than it is written in.
//!
//! Messages and records are data and keep their text.

/// A text in one line: control characters are escaped, line breaks and tabs too.
#[must_use]
pub fn escape_line(text: &str) -> String {
    escape(text, |_| false)
}

/// A text of several lines: control characters are escaped, except line breaks and tabs.
#[must_use]
pub fn escape_text(text: &str) -> String {
    escape(text, |c| c == '\n' || c == '\t')
}

/// A report of several lines with colors of our own: as [`escape_text`], and sequences that set colors (`ESC [ … m`) stay.
#[must_use]
pub fn escape_report(text: &str) -> String {
    let mut escaped = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('\u{1b}') {
        escaped += &escape_text(&rest[..at]);
        let length = color_length(&rest[at..]);
        if length == 0 {
            escaped += &escape_text("\u{1b}");
            rest = &rest[at + 1..];
        } else {
            escaped += &rest[at..at + length];
            rest = &rest[at + length..];
        }
    }

    escaped + &escape_text(rest)
}

/// Number of bytes of the color sequence at the beginning of a text; 0 if there is none.
fn color_length(text: &str) -> usize {
    let Some(parameters) = text.strip_prefix("\u{1b}[") else {
        return 0;
    };
    let end = parameters.find(|c: char| !c.is_ascii_digit() && c != ';');
    match end {
        Some(end) if parameters[end..].starts_with('m') => "\u{1b}[".len() + end + "m".len(),
        _ => 0,
    }
}

/// Cuts a text to at most so many bytes, between two characters. Returns whether it was longer.
pub fn cut(text: &mut String, max_bytes: usize) -> bool {
    if text.len() <= max_bytes {
        return false;
    }

    let mut boundaries = (0..=max_bytes).rev();
    let end = boundaries.find(|at| text.is_char_boundary(*at));
    text.truncate(end.unwrap_or(0));
    true
}

fn escape(text: &str, is_kept: impl Fn(char) -> bool) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        if is_control(c) && !is_kept(c) {
            escaped.extend(c.escape_default());
        } else {
            escaped.push(c);
        }
    }
    escaped
}

/// Whether a character is a control character (C0, DEL, C1), a line or paragraph separator, a bidirectional control, or the byte
/// order mark, which cannot be seen.
fn is_control(c: char) -> bool {
    let is_separator = matches!(c, '\u{2028}' | '\u{2029}');
    let is_bidirectional = matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || is_separator || is_bidirectional || c == '\u{feff}'
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_control_character_is_escaped() {
        let controls = [
            0..=0x1f,
            0x7f..=0x9f,
            0x2028..=0x2029,
            0x202a..=0x202e,
            0x2066..=0x2069,
            0xfeff..=0xfeff,
        ];
        for code in controls.into_iter().flatten() {
            let c = char::from_u32(code).unwrap();
            let escaped = escape_line(&format!("a{c}b"));
            assert!(
                escaped.starts_with("a\\") && escaped.ends_with('b'),
                "{code:x}"
            );
            assert!(escaped.chars().all(|c| !is_control(c)), "{code:x}");
        }
        assert_eq!(escape_line("\u{1b}[2J\n\u{202e}"), r"\u{1b}[2J\n\u{202e}");
        assert_eq!(escape_line("Büchse №1 “\\n” 🤖"), "Büchse №1 “\\n” 🤖");
    }

    #[test]
    fn lines_and_colors_stay_where_they_are_ours() {
        assert_eq!(escape_text("a\n\tb\r\u{7}"), "a\n\tb\\r\\u{7}");
        assert_eq!(
            escape_report("\u{1b}[1;31mred\u{1b}[0m\n"),
            "\u{1b}[1;31mred\u{1b}[0m\n"
        );
        for forged in [
            "\u{1b}[2J",
            "\u{1b}]0;title\u{7}",
            "\u{1b}[31",
            "\u{1b}",
            "\u{1b}\u{1b}c",
        ] {
            let escaped = escape_report(forged);
            assert!(!escaped.chars().any(is_control), "{escaped}");
        }
    }

    #[test]
    fn an_escaped_text_does_not_change() {
        let once = escape_line("\u{1b}\n\\");
        assert_eq!(escape_line(&once), once);
    }
}

//! Reasons of the middleware's errors.

use std::fmt::Display;

/// The text of an error of the middleware, without the places in its sources (` at /home/…/file.rs:12.`): they are paths of
/// the machine that built the program.
pub(crate) fn reason(error: &dyn Display) -> String {
    let text = error.to_string();
    let mut parts = text.split(" at ");
    let mut reason = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        match after_place(part) {
            Some(rest) => reason += rest,
            None => {
                reason += " at ";
                reason += part;
            }
        }
    }

    reason
}

/// What follows a place in a source file; `None` if the text does not begin with one.
fn after_place(text: &str) -> Option<&str> {
    let (file, rest) = text.split_once(".rs:")?;
    let is_path = !file.contains(char::is_whitespace);
    let after_line = rest.trim_start_matches(|c: char| c.is_ascii_digit());
    let has_line = after_line.len() < rest.len();
    if is_path && has_line {
        Some(after_line.strip_prefix('.').unwrap_or(after_line))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_in_sources_are_left_out() {
        let text = "Unable to open listener at /root/.cargo/registry/src/io-1/src/net/mod.rs:217. - Caused by \
                    Address in use (os error 98) at src/link/unicast.rs:9.";
        assert_eq!(
            reason(&text),
            "Unable to open listener - Caused by Address in use (os error 98)"
        );
        for text in [
            "cannot listen at tcp/127.0.0.1:1",
            "a look at main.rs: nothing",
            "",
        ] {
            assert_eq!(reason(&text), text);
        }
    }
}

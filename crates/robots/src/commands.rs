//! The commands that the robots send each other.

/// The command that sends the refiller out \[D\].
pub const REFILL: &str = "refill";
/// The command that makes the refiller hurry; it also sends her out \[D\].
pub const HURRY: &str = "hurry";
/// The command that sends the refiller home after an exchange \[D\].
pub const GO_HOME: &str = "go home";
/// The waiter's call for any refiller \[D\]. [`REFILL`] then assigns one of those who offer \[I\].
pub const HELP: &str = "help";
/// The answer of a refiller who would come \[I\].
pub const OFFER: &str = "offer";
/// The answer of a refiller who has been assigned \[I\].
pub const ACCEPT: &str = "accept";

/// The text of a received command, truncated for a log line.
pub(crate) fn shortened(text: &str) -> String {
    const MAX_CHARS: usize = 60;
    match text.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

//! Names of the files in a run's folder.

/// The scenario of the epoch in progress, complete.
pub const SCENARIO: &str = "scenario.toml";
/// What happened, for machines.
pub const EVENTS: &str = "events.jsonl";
/// What happened, for people.
pub const LOG: &str = "cars.log";
/// Where everything was after every tick, for the console to play again.
pub const RECORDING: &str = "recording.jsonl";
/// What came of it.
pub const SUMMARY: &str = "summary.json";
/// What each process printed.
pub const LOGS: &str = "logs";
/// Where the simulator of a run in progress listens.
pub const ENDPOINT: &str = "endpoint";
/// Path of the file with which an operator may control a secured run in progress.
pub const OPERATOR_CONFIG: &str = "operator_config";
/// Link under which the last run is found again, beside the run folders.
pub const LATEST: &str = "latest";
/// Held by the process that writes the record, as long as it lives.
pub(crate) const LOCK: &str = ".lock";

/// A name cannot be that of the readable log.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum LogNameError {
    /// It could lead out of the run's folder, or is hard to type.
    #[error("{0:?} is no file name of letters, digits, `.`, `_` and `-`")]
    NotPlain(String),
    /// Another file of the run's folder has it.
    #[error("the run keeps something else in {0}")]
    Taken(String),
}

/// Checks that a name can be that of the readable log.
///
/// # Errors
/// [`LogNameError`] if it is not a plain file name, or if another file of the run's folder has it.
pub(crate) fn check_log_name(name: &str) -> Result<(), LogNameError> {
    let is_plain = !name.is_empty()
        && name.len() <= 100
        && !name.starts_with('.')
        && name
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte));

    if !is_plain {
        return Err(LogNameError::NotPlain(name.to_owned()));
    }

    let is_taken = [EVENTS, RECORDING, SUMMARY, LOGS, ENDPOINT, OPERATOR_CONFIG].contains(&name)
        || name.starts_with("scenario")
        || name.starts_with("events")
        || name.starts_with("recording");
    if is_taken {
        Err(LogNameError::Taken(name.to_owned()))
    } else {
        Ok(())
    }
}

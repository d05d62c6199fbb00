//! Names of the files in the folder of a run.

/// Where the folders of runs are, unless a command names another place.
pub const RUNS: &str = "runs";
/// The scenario of the epoch in progress, complete.
pub const SCENARIO: &str = "scenario.toml";
/// The events, for programs.
pub const EVENTS: &str = "events.jsonl";
/// The log, for people.
pub const LOG: &str = "cars.log";
/// Everything about every tick, to look at it again and to compare it.
pub const RECORDING: &str = recording::FILE;
/// The summary at the end of the run.
pub const SUMMARY: &str = "summary.json";
/// How the run was launched, to resume it.
pub const LAUNCHED: &str = "launched.json";
/// Lock file of the process that writes the record.
pub const LOCK: &str = ".lock";
/// Folder with the output of each process.
pub const LOGS: &str = "logs";
/// Endpoint of the simulator during the run.
pub const ENDPOINT: &str = "endpoint";
/// Path of the operator's configuration file, during a secured run.
pub const OPERATOR_CONFIG: &str = "operator_config";
/// The changes of real links that `cars net play` made.
pub const LINKS: &str = "links.jsonl";
/// Folder with the answers of `cars why`, and with the outcomes of forks from which they are made.
pub const WHY: &str = recording::ANSWERS;
pub use protocol::name::LATEST;

/// Why a name cannot be that of the log.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LogNameError {
    /// It is not a plain file name, and so might be a path out of the folder.
    #[error("{0:?} is not a file name of letters, digits, `.`, `_` and `-`")]
    NotPlain(String),
    /// It is the name of another file of the folder.
    #[error("the run keeps something else in {0}")]
    Taken(String),
}

/// Checks that a name can be that of the log.
///
/// # Errors
/// [`LogNameError`] if it is not a plain file name, or the name of another file of the folder.
pub fn check_log_name(name: &str) -> Result<(), LogNameError> {
    if !is_plain(name) {
        Err(LogNameError::NotPlain(name.to_owned()))
    } else if is_taken(name) {
        Err(LogNameError::Taken(name.to_owned()))
    } else {
        Ok(())
    }
}

fn is_plain(name: &str) -> bool {
    let mut bytes = name.bytes();
    let has_plain_bytes = bytes.all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte));
    has_plain_bytes && (1..=100).contains(&name.len()) && !name.starts_with('.')
}

/// Whether another file has the name, or an earlier epoch's file could have it.
fn is_taken(name: &str) -> bool {
    let names = [
        SUMMARY,
        LOGS,
        ENDPOINT,
        OPERATOR_CONFIG,
        LAUNCHED,
        RECORDING,
        LINKS,
        WHY,
    ];
    let prefixes = ["scenario", "events", "run-epoch"];
    names.contains(&name) || prefixes.iter().any(|prefix| name.starts_with(prefix))
}

//! The kinds of files that the project reads, by what is in them.

use std::path::Path;

use config::{FileError, Source};
use lab::experiment::is_experiment_file;
use launch::is_launch_file;
use observe::words::is_almost;

/// Tables and keys that only scenarios have.
const OF_SCENARIO: [&str; 16] = [
    "seed",
    "tick",
    "duration",
    "on_late",
    "deadline",
    "lose_after",
    "field",
    "sensing",
    "guests",
    "network",
    "record",
    "fault",
    "change",
    "expect",
    "obstacle",
    "robot",
];
/// The list of a plan of faults of real links.
const OF_LINKS: &str = "link_fault";

/// What a file is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// An environment and its robots.
    Scenario,
    /// The processes of a run.
    Launch,
    /// Arms, conditions and measures.
    Experiment,
    /// Faults of real links.
    Links,
    /// Parameters of a robot.
    Parameters,
    /// Classes of robots, one a line.
    Roster,
}

impl Kind {
    /// The kind of a file.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be read, or is neither TOML nor a roster.
    pub(crate) fn of(path: &Path) -> Result<Self, FileError> {
        let source = Source::read(path)?;
        if !is_toml(path) && is_roster(&source.text) {
            return Ok(Self::Roster);
        }
        if is_experiment_file(path)? {
            return Ok(Self::Experiment);
        }
        if is_launch_file(path)? {
            return Ok(Self::Launch);
        }

        let table: toml::Table = source.parse()?;
        // A misspelled key of a scenario is no parameter.
        let is_of_scenario = |key: &String| OF_SCENARIO.iter().any(|known| is_almost(key, known));
        Ok(if table.contains_key(OF_LINKS) {
            Self::Links
        } else if table.is_empty() || table.keys().any(is_of_scenario) {
            Self::Scenario
        } else {
            Self::Parameters
        })
    }
}

fn is_toml(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension == "toml")
}

/// Whether each line is one word, as the classes of a roster are. TOML has no such lines but the heads of tables.
fn is_roster(text: &str) -> bool {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text.lines().map(str::trim);
    let mut words = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
    words.all(|word| !word.contains(['=', '[']))
}

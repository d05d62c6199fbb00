//! The kinds of files that the project reads, by what is in them.

use std::path::Path;

use config::{FileError, Source};
use experiments::is_experiment_file;
use launch::is_launch_file;

/// The folder of parameters of robots, beside the scenarios that name them.
const OF_PARAMETERS: &str = "robots";
/// The list of a scenario.
const OF_SCENARIO: &str = "robot";
/// The list of a plan of faults of real links.
const OF_LINKS: &str = "link_fault";

/// What a file is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FileKind {
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

impl FileKind {
    /// The kind of a file.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be read, is empty, or is neither TOML nor a roster.
    pub(crate) fn of(path: &Path) -> Result<Self, FileError> {
        let source = Source::read(path)?;
        let is_blank = source.text.trim().is_empty();
        if !is_blank && !is_toml(path) && is_roster(&source.text) {
            return Ok(Self::Roster);
        }
        if is_experiment_file(path)? {
            return Ok(Self::Experiment);
        }
        if is_launch_file(path)? {
            return Ok(Self::Launch);
        }

        let table: toml::Table = source.parse()?;
        if table.is_empty() {
            return Err(FileError::new(format!(
                "{} is empty: it is neither a scenario nor a launch file nor an experiment",
                path.display()
            )));
        }

        Ok(if table.contains_key(OF_LINKS) {
            Self::Links
        } else if table.contains_key(OF_SCENARIO) {
            Self::Scenario
        } else if class_of(path).is_some() || is_in(path, OF_PARAMETERS) {
            Self::Parameters
        } else {
            Self::Scenario
        })
    }
}

/// The class that comes with the programs and whose parameters a file has by its name.
pub(crate) fn class_of(path: &Path) -> Option<&'static str> {
    let stem = path.file_stem()?.to_str()?;
    let mut classes = robots::CLASSES.iter();
    classes
        .find(|class| class.eq_ignore_ascii_case(stem))
        .copied()
}

fn is_in(path: &Path, folder: &str) -> bool {
    let parent = path.parent().and_then(Path::file_name);
    parent.is_some_and(|parent| parent == folder)
}

fn is_toml(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension == "toml")
}

/// Whether each line is of words, as the classes and names of a roster are. TOML has no such lines but the heads of tables.
fn is_roster(text: &str) -> bool {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text.lines().map(str::trim);
    let mut words = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
    words.all(|word| !word.contains(['=', '[']))
}

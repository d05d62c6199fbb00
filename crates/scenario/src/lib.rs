//! Scenarios. A file is read as written (module `raw`), then checked and converted ([`Scenario`]).

mod by_hand;
pub mod change;
mod checked;
pub mod fault;
pub mod files;
pub mod guests;
mod lateness;
mod layers;
pub mod network;
mod over_time;
mod placing;
mod raw;
pub mod reseed;
pub mod roster;
mod sensing;
mod setup;
mod sites;

use std::path::Path;

/// Source texts and their errors, which [`Scenario::parse`] takes and returns.
pub use config::diagnostic;
pub use config::{Changes, Override};
use config::{FileError, Source};
use observe::{Expectation, RunSetting};
pub use protocol::messages::OnLate;

pub use by_hand::kind_in_words;
pub use change::{Change, Parent};
pub use checked::{
    DEFAULT_SEED, MAX_GUESTS, Obstacle, RecordContents, RobotSpec, Scenario, SyncPoint,
};
pub use checked::{to_wire, to_world};
pub use fault::{Fault, FaultEnd, Interruption};
pub use guests::{GuestMotion, GuestRules, GuestWant, ModeledGuests, RecordedGuests, WantGoal};
pub use lateness::Lateness;
pub use layers::{LayerSpec, Peak};
pub use network::Network;
pub use reseed::{ChanceKind, Reseed};
pub use sensing::Sensing;
pub use sites::{OnConflict, SiteSpec, SiteVariable};

/// Reads the expectations of a file, for a run. Other tables of the file are of no concern.
///
/// # Errors
/// [`FileError`] with file, line and caret; if there are none.
pub fn expectations(source: &Source, setting: &RunSetting) -> Result<Vec<Expectation>, FileError> {
    let file: raw::Expectations = source.parse()?;
    let expectations = file.check(source, setting)?;
    if expectations.is_empty() {
        return Err(FileError::new(format!("{} has no [[expect]]", source.name)));
    }
    Ok(expectations)
}

/// Puts the mood that a robot had at the end of a run in the place of the run's name, in the content of a scenario file.
///
/// # Errors
/// [`FileError`] if there is no such run, it is not over, or the robot has no mood in it.
pub fn carry_moods_over(content: &mut toml::Table) -> Result<(), FileError> {
    raw::mood::carry_all_over(content).map_err(FileError::new)
}

impl Scenario {
    /// Reads, changes and checks a scenario file.
    ///
    /// # Errors
    /// [`FileError`] with file, line and caret; for a change that cannot be made, with its path.
    pub fn load(path: &Path, changes: &Changes) -> Result<Self, FileError> {
        let source = Source::read(path)?;
        let folders = raw::folders::Folders {
            files: path.parent().unwrap_or(Path::new(".")),
            runs: changes.runs.as_deref().unwrap_or(Path::new(files::RUNS)),
        };
        // Parsed before it is changed, so that errors show the lines of the file.
        let raw: raw::ScenarioFile = source.parse()?;
        if changes.is_empty() {
            return raw.check(&source, Some(folders));
        }

        let source = changes.apply(&source)?;
        let raw: raw::ScenarioFile = source.parse()?;
        let mut scenario = raw.check(&source, Some(folders))?;
        scenario.parent = None; // It is no fork of that run any more.
        Ok(scenario)
    }

    /// What people may want to know of a scenario file that can be used: times that are not those of ticks, and what never
    /// begins, with file, line and caret.
    ///
    /// # Errors
    /// [`FileError`] as [`Self::load`].
    pub fn remarks(path: &Path, changes: &Changes) -> Result<Vec<FileError>, FileError> {
        let mut source = Source::read(path)?;
        if !changes.is_empty() {
            source = changes.apply(&source)?;
        }
        source.parse::<raw::ScenarioFile>()?.remarks(&source)
    }

    /// Reads and checks the text of a scenario. Files that it names are relative to `folder`.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn parse(source: &Source, folder: &Path) -> Result<Self, FileError> {
        let folders = raw::folders::Folders {
            files: folder,
            runs: Path::new(files::RUNS),
        };
        source
            .parse::<raw::ScenarioFile>()?
            .check(source, Some(folders))
    }

    /// Reads and checks an untrusted text of a scenario, which must not name files.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn parse_alone(source: &Source) -> Result<Self, FileError> {
        source.parse::<raw::ScenarioFile>()?.check(source, None)
    }

    /// The same scenario with another seed: robots at random places stand elsewhere.
    ///
    /// # Errors
    /// [`FileError`] if a robot has no free place with this seed.
    pub fn with_seed(mut self, seed: u64) -> Result<Self, FileError> {
        self.seed = seed;
        let placed = placing::place_at_random(&mut self);
        placed.map_err(|error| FileError::new(format!("with the seed {seed}, {error}")))?;
        placing::place_sites_at_random(&mut self)
            .and_then(|()| placing::place_peaks_at_random(&mut self))
            .map_err(|(_, error)| FileError::new(format!("with the seed {seed}, {error}")))?;
        Ok(self)
    }

    /// The scenario as a file without defaults, which gives the same run. Places that follow from the seed are written out.
    ///
    /// # Errors
    /// [`FileError`] if a parameter cannot be written as TOML (a JSON `null`).
    pub fn to_toml(&self) -> Result<String, FileError> {
        raw::ScenarioFile::from(self).to_toml()
    }

    /// The scenario as a file for any seed: without the seed, and without the places that follow from it.
    ///
    /// # Errors
    /// [`FileError`] as [`Self::to_toml`].
    pub fn to_toml_without_seed(&self) -> Result<String, FileError> {
        raw::ScenarioFile::from(self).without_seed().to_toml()
    }
}

//! What is simulated. A file is read as it is written (module `raw`), then checked and turned into what it means
//! ([`Scenario`]).

mod checked;
pub mod fault;
pub mod network;
mod placing;
mod raw;
mod setup;

use std::path::Path;

pub use config::{Changes, Override};
use config::{FileError, Source};
pub use protocol::messages::OnLate;

pub(crate) use checked::to_wire;
pub use checked::{DEFAULT_SEED, Lateness, Record, RobotSpec, Scenario};
pub use fault::{Fault, FaultEnd};
pub use network::Network;

impl Scenario {
    /// Reads, changes and checks a scenario file.
    ///
    /// # Errors
    /// [`FileError`] with file, line and caret, or naming the change that cannot be made.
    pub fn load(path: &Path, changes: &Changes) -> Result<Self, FileError> {
        let source = Source::read(path)?;
        let folder = path.parent().unwrap_or(Path::new("."));
        // First as it is, so that its own errors are shown at their own lines.
        let raw: raw::Scenario = source.parse()?;
        if changes.is_empty() {
            return raw.check(&source, folder);
        }
        let source = changes.apply(&source)?;
        source.parse::<raw::Scenario>()?.check(&source, folder)
    }

    /// Reads and checks a scenario text; `folder` is where files that it names are looked for.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn parse(source: &Source, folder: &Path) -> Result<Self, FileError> {
        source.parse::<raw::Scenario>()?.check(source, folder)
    }

    /// Reads and checks a scenario text that comes from outside: it may name no other file.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn parse_alone(source: &Source) -> Result<Self, FileError> {
        source
            .parse::<raw::Scenario>()?
            .refuse_files(source)?
            .check(source, Path::new("."))
    }

    /// The scenario as a file that says everything and gives the same run.
    ///
    /// # Errors
    /// [`FileError`] if a parameter cannot be written as TOML (a JSON `null`).
    pub fn to_toml(&self) -> Result<String, FileError> {
        toml::to_string(&raw::Scenario::from(self))
            .map_err(|error| FileError::new(error.to_string()))
    }
}

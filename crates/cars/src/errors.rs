//! Why a command fails, and how it is shown: the one place where errors of the libraries become text for people.

use std::error::Error;
use std::iter::successors;

use config::FileError;
use export::ExportError;
use lab::LabError;
use launch::LaunchError;
use record::RecordError;

/// The result of a command. `?` takes the errors of all libraries.
pub(crate) type Result<T, E = Box<dyn Error + Send + Sync>> = std::result::Result<T, E>;

/// What the command line itself refuses, or what it was about when a library failed.
#[derive(Debug, thiserror::Error)]
#[error("{reason}")]
pub(crate) struct RefusedCommand {
    pub(crate) reason: String,
    pub(crate) help: Option<String>,
    pub(crate) source: Option<Box<dyn Error + Send + Sync>>,
}

/// An error of the command line: a text as for `format!`, after `help = …,` if something can be done about it.
macro_rules! refusal {
    (help = $help:expr, $($reason:tt)+) => {
        Box::<dyn std::error::Error + Send + Sync>::from($crate::errors::RefusedCommand {
            reason: format!($($reason)+),
            help: Some($help.to_string()),
            source: None,
        })
    };
    ($($reason:tt)+) => {
        Box::<dyn std::error::Error + Send + Sync>::from(format!($($reason)+))
    };
}
pub(crate) use refusal;

/// Says what an error was about.
pub(crate) trait Context<T> {
    /// The result, whose error gets a line above it.
    fn context(self, reason: impl Into<String>) -> Result<T>;
}

impl<T, E: Into<Box<dyn Error + Send + Sync>>> Context<T> for Result<T, E> {
    fn context(self, reason: impl Into<String>) -> Result<T> {
        self.map_err(|source| {
            let refusal = RefusedCommand {
                reason: reason.into(),
                help: None,
                source: Some(source.into()),
            };
            refusal.into()
        })
    }
}

/// An error as people see it: the message, its causes, what helps, and the place in a file.
pub(crate) fn render(error: &(dyn Error + 'static)) -> String {
    if let Some(file) = file_of(error) {
        return config::render(file, None);
    }
    let help = successors(Some(error), |&error| error.source()).find_map(help_of);
    config::render(error, help)
}

/// The file that an error of a library is about.
fn file_of<'a>(error: &'a (dyn Error + 'static)) -> Option<&'a FileError> {
    if let Some(error) = error.downcast_ref::<LabError>() {
        return error.file();
    }
    match (error.downcast_ref(), error.downcast_ref()) {
        (Some(LaunchError::File(file)), _) | (_, Some(ExportError::File(file))) => Some(file),
        _ => None,
    }
}

/// The help of one error, without those of its causes. A [`config::FileError`] shows its own.
fn help_of<'a>(error: &'a (dyn Error + 'static)) -> Option<&'a str> {
    let refusal = error.downcast_ref::<RefusedCommand>();
    let launch = error.downcast_ref::<LaunchError>();
    let lab = error.downcast_ref::<LabError>();
    let record = match error.downcast_ref() {
        Some(ExportError::Read(error)) => Some(error),
        _ => error.downcast_ref::<RecordError>(),
    };
    refusal
        .and_then(|error| error.help.as_deref())
        .or_else(|| launch.and_then(LaunchError::help))
        .or_else(|| lab.and_then(LabError::help))
        .or_else(|| record.and_then(RecordError::help))
}

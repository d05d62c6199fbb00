//! Errors as exceptions, with the text that the command line prints.

use std::fmt::Display;
use std::str::FromStr;

use config::render_plain;
use lab::LabError;
use pyo3::{PyErr, PyResult, import_exception};

import_exception!(cars._errors, Error);
import_exception!(cars._errors, BadArgument);
import_exception!(cars._errors, FileError);
import_exception!(cars._errors, RecordError);
import_exception!(cars._errors, RefusedError);
import_exception!(cars._errors, RobotError);
import_exception!(cars._errors, HostError);
import_exception!(cars._errors, UnknownRobot);
import_exception!(cars._errors, Unreachable);
import_exception!(cars._errors, TooEarly);
import_exception!(cars._errors, Interrupted);

/// Columns of an error: those of the command line where its standard error is a file.
const COLUMNS: usize = 80;

/// The exception of an error of the libraries, with its causes, its help, and the place in a file with line and caret.
pub(crate) fn reported(error: impl Into<LabError>) -> PyErr {
    let error = error.into();
    let text = match error.file() {
        Some(file) => render_plain(file, None, COLUMNS),
        None => render_plain(&error, error.help(), COLUMNS),
    };
    match error {
        LabError::File(_) | LabError::Record(record::RecordError::Folder { .. }) => {
            FileError::new_err(text)
        }
        LabError::Record(_) => RecordError::new_err(text),
        LabError::Robot(_) => RobotError::new_err(text),
        LabError::Refused { .. } => RefusedError::new_err(text),
        LabError::Failed(_) | LabError::Interrupted => Error::new_err(text),
    }
}

/// The exception of an error in words.
pub(crate) fn plain(error: impl Display) -> PyErr {
    Error::new_err(error.to_string())
}

/// The exception of an argument whose text is not understood.
pub(crate) fn argument(name: &str, error: impl Display) -> PyErr {
    BadArgument::new_err(format!("{name}: {error}"))
}

/// Reads an argument that is a text.
pub(crate) fn read<T: FromStr<Err: Display>>(
    name: &str,
    text: Option<&str>,
) -> PyResult<Option<T>> {
    let read = text.map(str::parse).transpose();
    read.map_err(|error: T::Err| argument(name, error))
}

//! Errors as exceptions, with the text that the command line prints.

use std::fmt::Display;
use std::str::FromStr;

use miette::{MietteHandlerOpts, Report};
use pyo3::{PyErr, PyResult, import_exception};

import_exception!(cars._errors, Error);
import_exception!(cars._errors, BadArgument);
import_exception!(cars._errors, HostError);
import_exception!(cars._errors, UnknownRobot);
import_exception!(cars._errors, Unreachable);
import_exception!(cars._errors, TooEarly);
import_exception!(cars._errors, Interrupted);

/// Has errors written as on the command line where its standard error is a file: no colors, no links.
pub(crate) fn print_without_colors() {
    let hook = miette::set_hook(Box::new(|_| {
        let handler = MietteHandlerOpts::new().color(false).terminal_links(false);
        Box::new(handler.build())
    }));
    // Set before by an earlier import in the same process, with the same effect.
    drop(hook);
}

/// The exception of an error with file, line and caret.
pub(crate) fn reported(error: impl Into<Report>) -> PyErr {
    let report: Report = error.into();
    Error::new_err(format!("{report:?}"))
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

//! Standard output and standard error of every program of the project.
//!
//! `println!` panics when it cannot write, so no program uses it (a lint holds that). Printing to the standard output returns an
//! error, which [`conclude`] turns into an exit status: 0 if the reader has closed the pipe (`cars log | head`), 1 with a
//! message for any other failure, such as a full disk. The standard error is written as far as possible: a run goes on when
//! its terminal is closed. Text for people is escaped, because robots, files and other processes write parts of it.

mod table;

use std::error::Error;
use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::process::ExitCode;

use clap::error::Error as UsageError;
use clap::{Command, Parser};
use clap_mangen::Man;
use protocol::plain::{escape_report, escape_text};

pub use table::{table, wrapped};

/// Exit status of a simulator that cannot listen because another process does at its address.
pub const ADDRESS_TAKEN: u8 = 3;
/// Exit status of a console in which a person has asked that a failed run be resumed.
pub const RESUME: u8 = 75;
/// The only argument of a program that is to print its manual page.
pub const MAN_PAGE: &str = "--man-page";

/// The standard output cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write to the standard output: {0}")]
pub struct OutputError(std::io::Error);

impl From<std::io::Error> for OutputError {
    fn from(error: std::io::Error) -> Self {
        Self(error)
    }
}

impl OutputError {
    /// Whether the reader has closed its end of the pipe, as `head` does. It wants no more output, which is not a failure.
    #[must_use]
    pub fn is_closed_pipe(&self) -> bool {
        self.0.kind() == ErrorKind::BrokenPipe
    }

    /// The failure, unless the reader has closed its end of the pipe.
    ///
    /// # Errors
    /// The failure itself.
    pub fn unless_closed(result: Result<(), Self>) -> Result<(), Self> {
        match result {
            Err(error) if !error.is_closed_pipe() => Err(error),
            _ => Ok(()),
        }
    }
}

/// Prints text for people to the standard output, escaped, without a line break at its end.
///
/// # Errors
/// [`OutputError`] if it cannot be written.
pub fn print(text: impl Display) -> Result<(), OutputError> {
    data(escape_text(&text.to_string()))
}

/// Prints text for people and a line break to the standard output, escaped.
///
/// # Errors
/// [`OutputError`] if it cannot be written.
pub fn print_line(text: impl Display) -> Result<(), OutputError> {
    print(format_args!("{text}\n"))
}

/// Prints data to the standard output as they are, for other programs.
///
/// # Errors
/// [`OutputError`] if they cannot be written.
pub fn data(text: impl Display) -> Result<(), OutputError> {
    let text = text.to_string();
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()?;
    Ok(())
}

/// Prints text for people and a line break to the standard error, escaped except for colors. A standard error that cannot be
/// written is ignored: there is no other place to report it.
pub fn note(text: impl Display) {
    let text = escape_report(&format!("{text}\n"));
    let _unwritable = std::io::stderr().write_all(text.as_bytes());
}

/// The exit status of a program, whose error is printed as `render` shows it. A reader that has closed its pipe is not an error.
#[must_use]
pub fn conclude(
    result: Result<ExitCode, Box<dyn Error + Send + Sync>>,
    render: impl FnOnce(&(dyn Error + 'static)) -> String,
) -> ExitCode {
    let error = match result {
        Ok(code) => return code,
        Err(error) => error,
    };

    let output = error.downcast_ref::<OutputError>();
    if output.is_some_and(OutputError::is_closed_pipe) {
        return ExitCode::SUCCESS;
    }
    note(format_args!("Error: {}", render(error.as_ref())));
    ExitCode::FAILURE
}

/// The arguments of this program.
///
/// # Errors
/// The exit status with which to end, after help, version, the manual page or a usage error has been printed.
pub fn arguments<Args: Parser>() -> Result<Args, ExitCode> {
    if std::env::args_os().skip(1).eq([MAN_PAGE]) {
        return Err(conclude_printing(print_man_page(Args::command())));
    }
    Args::try_parse().map_err(|error| print_usage(&error))
}

fn print_man_page(command: Command) -> Result<(), OutputError> {
    let own = std::env::args_os().next().unwrap_or_default();
    let name = Path::new(&own).file_name().unwrap_or_default().display();
    let command = command
        .display_name(name.to_string())
        .bin_name(name.to_string());

    let mut page = Vec::new();
    Man::new(command).render(&mut page)?;
    data(String::from_utf8_lossy(&page))
}

fn conclude_printing(printed: Result<(), OutputError>) -> ExitCode {
    let result = printed.map(|()| ExitCode::SUCCESS).map_err(Into::into);
    conclude(result, |error| format!("  × {error}"))
}

fn print_usage(error: &UsageError) -> ExitCode {
    let printed = error.print();
    if error.use_stderr() {
        return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(1));
    }

    let printed = printed.and_then(|()| std::io::stdout().flush());
    conclude_printing(printed.map_err(OutputError))
}

/// Prints diagnostics to the standard error. `RUST_LOG` replaces the default filter.
pub fn print_diagnostics(default_filter: &str) {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| default_filter.into());

    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(|| Diagnostics)
        // The subscriber would report a failed write by `eprintln!`, which panics.
        .log_internal_errors(false)
        // Escape sequences of the subscriber and of the text could not be told apart.
        .with_ansi(false)
        .without_time()
        .with_target(false)
        .init();
}

/// Writes each diagnostic to the standard error, escaped; further lines of one are indented.
struct Diagnostics;

impl Write for Diagnostics {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let text = String::from_utf8_lossy(bytes);
        let text = escape_text(text.trim_end_matches('\n')).replace('\n', "\n  ");
        note(text);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

//! Errors as people see them: the message, its causes, what helps, and the place in a file with line and caret.

use std::error::Error;
use std::fmt::{self, Display, Formatter};

use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme, MietteHandler, ReportHandler};

use crate::FileError;

/// An error for the terminal of this process. A [`FileError`], be it the error itself or its cause, is shown with its place.
#[must_use]
pub fn render(error: &(dyn Error + 'static), help: Option<&str>) -> String {
    rendered(error, help, &MietteHandler::default())
}

/// An error without colors and links, whatever the terminal, in lines of this width.
#[must_use]
pub fn render_plain(error: &(dyn Error + 'static), help: Option<&str>, columns: usize) -> String {
    let look = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor());
    rendered(error, help, &look.with_links(false).with_width(columns))
}

fn rendered(
    error: &(dyn Error + 'static),
    help: Option<&str>,
    handler: &dyn ReportHandler,
) -> String {
    let report = ErrorWithHelp { error, help };
    let diagnostic: &dyn Diagnostic = match error.downcast_ref::<FileError>() {
        Some(error) => error,
        None => &report,
    };
    let rendered = Rendered {
        diagnostic,
        handler,
    };
    rendered.to_string()
}

/// An error of any type with its help.
#[derive(Debug)]
struct ErrorWithHelp<'a> {
    error: &'a (dyn Error + 'static),
    help: Option<&'a str>,
}

impl Display for ErrorWithHelp<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        Display::fmt(self.error, f)
    }
}

impl Error for ErrorWithHelp<'_> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.error.source()
    }
}

impl ErrorWithHelp<'_> {
    /// The cause, if it is an error of a file.
    fn cause(&self) -> Option<&FileError> {
        self.error.source()?.downcast_ref()
    }
}

impl Diagnostic for ErrorWithHelp<'_> {
    fn help<'a>(&'a self) -> Option<Box<dyn Display + 'a>> {
        if let Some(help) = self.help {
            return Some(Box::new(help));
        }
        // A cause with a place shows its help there.
        self.cause().filter(|cause| !cause.has_place())?.help()
    }

    fn diagnostic_source(&self) -> Option<&dyn Diagnostic> {
        let cause = self.cause().filter(|cause| cause.has_place())?;
        Some(cause)
    }
}

struct Rendered<'a> {
    diagnostic: &'a dyn Diagnostic,
    handler: &'a dyn ReportHandler,
}

impl Display for Rendered<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.handler.debug(self.diagnostic, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;

    #[derive(Debug, thiserror::Error)]
    #[error("the unit cannot be played")]
    struct Outer(#[source] FileError);

    fn wrong_file() -> FileError {
        let source = Source {
            name: "hall.toml".to_owned(),
            text: "tick = 0\n".to_owned(),
        };
        FileError::at(&source, Some(7..8), "a tick has a length").with_help("try 0.5 s")
    }

    #[test]
    fn a_wrong_file_is_shown_with_its_place_also_as_a_cause() {
        for shown in [
            render_plain(&wrong_file(), None, 80),
            render_plain(&Outer(wrong_file()), None, 80),
        ] {
            for words in ["[hall.toml:1:8]", "╰── a tick has a length", "tick = 0"] {
                assert!(shown.contains(words), "{words:?} is not in:\n{shown}");
            }
        }
    }

    #[test]
    fn any_error_is_shown_with_its_causes_and_its_help() {
        let expected = "  × the unit cannot be played\n  ╰─▶ no file\n  help: look elsewhere\n";
        let helped = Outer(FileError::new("no file").with_help("look elsewhere"));
        assert_eq!(render_plain(&helped, None, 80), expected);

        let unhelped = Outer(FileError::new("no file"));
        assert_eq!(
            render_plain(&unhelped, Some("look elsewhere"), 80),
            expected
        );
    }
}

//! Errors in configuration files: file, line, caret, and help.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::ops::Range;
use std::path::Path;

use miette::{Diagnostic, LabeledSpan, NamedSource, Severity, SourceCode};
use protocol::plain::{escape_line, escape_text};
use protocol::wording::without_type_names;

use crate::shipped;

/// The byte order mark with which some editors begin a file in UTF-8. It is no part of the text.
const BYTE_ORDER_MARK: char = '\u{feff}';
/// Longest file, bytes, so that an endless one cannot exhaust the memory.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// A file that cannot be used, with the place of the error.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct FileError {
    message: String,
    is_warning: bool,
    help: Option<String>,
    place: Option<Box<ErrorLocation>>,
}

/// The place of an error in a text.
#[derive(Debug)]
struct ErrorLocation {
    source: NamedSource<String>,
    label: LabeledSpan,
}

impl Diagnostic for FileError {
    fn severity(&self) -> Option<Severity> {
        self.is_warning.then_some(Severity::Warning)
    }

    fn help<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        self.help
            .as_ref()
            .map(|help| Box::new(help) as Box<dyn std::fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.place
            .as_ref()
            .map(|place| &place.source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let label = self.place.as_ref().map(|place| place.label.clone());
        label.map(|label| Box::new(std::iter::once(label)) as Box<dyn Iterator<Item = LabeledSpan>>)
    }
}

impl FileError {
    /// An error without a place in a text.
    #[must_use]
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: escape_text(&message.into()),
            is_warning: false,
            help: None,
            place: None,
        }
    }

    /// A file that cannot be read.
    #[must_use]
    pub fn unreadable(path: &Path, error: &std::io::Error) -> Self {
        let message = format!("cannot read {}: {error}", path.display());
        if error.kind() == ErrorKind::NotFound && path.extension().is_none() {
            Self::new(message).with_help(known_names())
        } else {
            Self::new(message)
        }
    }

    /// An error at a place in a text. Control characters of the text are shown escaped.
    #[must_use]
    pub fn at(source: &Source, span: Option<Range<usize>>, message: &str) -> Self {
        let name = escape_line(&source.name);
        let (text, span) = escaped_with_span(&source.text, span.unwrap_or(0..0));
        let place = ErrorLocation {
            source: NamedSource::new(&name, text).with_language("toml"),
            label: LabeledSpan::at(span, escape_text(message)),
        };
        Self {
            message: format!("{name} cannot be used"),
            is_warning: false,
            help: None,
            place: Some(Box::new(place)),
        }
    }

    /// A remark about a place in a text that can be used.
    #[must_use]
    pub fn warning(source: &Source, span: Option<Range<usize>>, message: &str) -> Self {
        Self {
            message: format!("{} may not mean what it says", escape_line(&source.name)),
            is_warning: true,
            ..Self::at(source, span, message)
        }
    }

    /// Whether it is about a place in a text.
    pub(crate) fn has_place(&self) -> bool {
        self.place.is_some()
    }

    /// The error in one line, without the file: the number of the line and the reason.
    #[must_use]
    pub fn in_words(&self) -> String {
        let Some(place) = &self.place else {
            return self.message.clone();
        };

        let text = place.source.inner();
        let before = text.get(..place.label.offset()).unwrap_or_default();
        let line = before.bytes().filter(|byte| *byte == b'\n').count() + 1;

        format!("line {line}: {}", self.reason())
    }

    /// What is wrong, without the place.
    #[must_use]
    pub fn reason(&self) -> &str {
        let label = self.place.as_ref().and_then(|place| place.label.label());
        label.unwrap_or(&self.message)
    }

    /// The error of a file that another file names.
    #[must_use]
    pub fn named_by(mut self, name: &str) -> Self {
        let name = escape_line(name);
        self.message = format!("{}, named by {name}", self.message);
        self
    }

    /// The error with a help text.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(escape_text(&help.into()));
        self
    }
}

/// What can be named without a file.
fn known_names() -> String {
    let list = |folder| shipped::names(folder).collect::<Vec<_>>().join(", ");
    format!(
        "without a file there are the launches {}, the scenarios {}, and the experiments {}; `cars init DIR` writes them to files",
        list(shipped::LAUNCHES),
        list(shipped::SCENARIOS),
        list(shipped::EXPERIMENTS)
    )
}

/// A text with its control characters escaped, and the place in it that a span of the text becomes.
fn escaped_with_span(text: &str, span: Range<usize>) -> (String, Range<usize>) {
    let text = text.replace("\r\n", " \n"); // As long, so that the span stays.
    let before = text.get(..span.start);
    let within = text.get(span.clone());
    let after = text.get(span.end..);
    let (Some(before), Some(within), Some(after)) = (before, within, after) else {
        return (escape_text(&text), 0..0);
    };

    let mut escaped = escape_text(before);
    let start = escaped.len();
    escaped += &escape_text(within);
    let end = escaped.len();
    escaped += &escape_text(after);
    (escaped, start..end)
}

/// Most tables of a file that are looked at to find the one that an error is about.
const MAX_ENTRIES: usize = 1000;

/// A text and its name.
#[derive(Debug, Clone)]
pub struct Source {
    /// Name in errors, usually a path.
    pub name: String,
    /// The text.
    pub text: String,
}

impl Source {
    /// Reads a file, from the disk or of those that come with the programs. A byte order mark at its beginning is left out.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be read, or is longer than 16 MiB.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let name = path.display().to_string();
        if let Some(text) = shipped::text(path) {
            let text = text.to_owned();
            return Ok(Self { name, text });
        }

        let mut text = read_limited(path).map_err(|error| FileError::unreadable(path, &error))?;
        if text.starts_with(BYTE_ORDER_MARK) {
            text.drain(..BYTE_ORDER_MARK.len_utf8());
        }
        if text.len() as u64 > MAX_FILE_BYTES {
            let reason = format!("it is longer than {MAX_FILE_BYTES} bytes");
            return Err(FileError::new(format!("cannot read {name}: {reason}")));
        }

        Ok(Self { name, text })
    }

    /// Checks a file that this text names at `span`: it must be a regular one, because reading another one, such as a pipe or
    /// a terminal, might never end.
    ///
    /// # Errors
    /// [`FileError`] at `span`.
    pub fn check_named(&self, span: Range<usize>, path: &Path) -> Result<(), FileError> {
        if shipped::contains(path) {
            return Ok(());
        }

        let name = path.display();
        let reason = match path.metadata() {
            Ok(metadata) if metadata.is_file() => return Ok(()),
            Ok(_) => format!("{name} is not a regular file"),
            Err(error) => format!("cannot read {name}: {error}"),
        };
        Err(FileError::at(self, Some(span), &reason))
    }

    /// Reads a TOML text into a type that refuses unknown keys.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn parse<T: serde::de::DeserializeOwned>(&self) -> Result<T, FileError> {
        toml::from_str(&self.text).map_err(|error: toml::de::Error| {
            let span = self.entry_of::<T>(&error).or(error.span());
            FileError::at(self, span, &without_type_names(error.message()))
        })
    }

    /// The head of the entry that an error is about, where the error points to the first entry of a list of tables: a list as a
    /// whole has the place of its first entry. The entry is the last one of the shortest begin of the text, up to a head, that
    /// has the same error.
    fn entry_of<T: serde::de::DeserializeOwned>(
        &self,
        error: &toml::de::Error,
    ) -> Option<Range<usize>> {
        let start = error.span()?.start;
        let text = &self.text;
        let line = text.get(start..)?.lines().next()?;
        let head = line.trim_end();
        if !head.starts_with("[[") {
            return None;
        }

        let mut place = start + line.len();
        let mut entry = start..start + head.len();
        for _ in 0..MAX_ENTRIES {
            let next = text.get(place..)?.find("\n[")?;
            let end = place + next + 1;
            let begin = toml::from_str::<T>(&text[..end]);
            if begin.is_err_and(|found| found.message() == error.message()) {
                break;
            }
            let line = text[end..].lines().next()?;
            if line.starts_with(head) {
                entry = end..end + head.len();
            }
            place = end + 1;
        }
        Some(entry)
    }
}

/// Reads one byte more than allowed, so that a longer file is noticed.
fn read_limited(path: &Path) -> std::io::Result<String> {
    let mut text = String::new();
    let mut limited = File::open(path)?.take(MAX_FILE_BYTES + 1);
    limited.read_to_string(&mut text)?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_byte_order_mark_at_the_beginning_is_no_part_of_the_text() {
        let path = std::env::temp_dir().join(format!("byte-order-mark-{}", std::process::id()));
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Source::read(&path).unwrap().text
        };
        let marked = read("\u{feff}a = 1\n");
        let twice = read("\u{feff}\u{feff}a");
        let inside = read("a\u{feff}");
        let empty = read("\u{feff}");
        std::fs::remove_file(&path).unwrap();

        assert_eq!(marked, "a = 1\n");
        assert_eq!(twice, "\u{feff}a");
        assert_eq!(inside, "a\u{feff}");
        assert_eq!(empty, "");
    }
}

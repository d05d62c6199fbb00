//! Errors in files that people write: file, line, caret, and what to do.

use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::Path;

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};

/// Longest file that is read: an endless one must not fill the memory.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// A file that cannot be used, and where in it the reason stands.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct FileError {
    message: String,
    help: Option<String>,
    place: Option<Box<Place>>,
}

/// Where in a text an error stands.
#[derive(Debug)]
struct Place {
    source: NamedSource<String>,
    label: LabeledSpan,
}

impl Diagnostic for FileError {
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
    /// An error that has no place in a text.
    #[must_use]
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            help: None,
            place: None,
        }
    }

    /// A file that cannot be read.
    #[must_use]
    pub fn unreadable(path: &Path, error: &std::io::Error) -> Self {
        Self::new(format!("cannot read {}: {error}", path.display()))
    }

    /// An error at a place of a text.
    #[must_use]
    pub fn at(source: &Source, span: Option<Range<usize>>, message: &str) -> Self {
        let place = Place {
            source: NamedSource::new(&source.name, source.text.clone()).with_language("toml"),
            label: LabeledSpan::at(span.unwrap_or(0..0), message),
        };
        Self {
            message: format!("{} cannot be used", source.name),
            help: None,
            place: Some(Box::new(place)),
        }
    }

    /// The error in one line, for where no file can be shown: the line it is at, and the reason.
    #[must_use]
    pub fn in_words(&self) -> String {
        let Some(place) = &self.place else {
            return self.message.clone();
        };

        let before = place
            .source
            .inner()
            .get(..place.label.offset())
            .unwrap_or_default();
        let line = before.bytes().filter(|byte| *byte == b'\n').count() + 1;
        let reason = place.label.label().unwrap_or(&self.message);

        format!("line {line}: {reason}")
    }

    /// The same about a file that another one names.
    #[must_use]
    pub fn named_by(mut self, name: &str) -> Self {
        self.message = format!("{}, named by {name}", self.message);
        self
    }

    /// What to do about it.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// A text with the name under which people know it.
#[derive(Debug, Clone)]
pub struct Source {
    /// Usually a path.
    pub name: String,
    /// What it says.
    pub text: String,
}

impl Source {
    /// Reads a file.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be read, or is longer than anybody writes.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let unreadable = |error: std::io::Error| FileError::unreadable(path, &error);
        let mut text = String::new();
        let file = File::open(path).map_err(unreadable)?;
        file.take(MAX_FILE_BYTES + 1)
            .read_to_string(&mut text)
            .map_err(unreadable)?;

        if text.len() as u64 > MAX_FILE_BYTES {
            let text = format!(
                "cannot read {}: it is longer than {MAX_FILE_BYTES} bytes",
                path.display()
            );
            return Err(FileError::new(text));
        }

        Ok(Self {
            name: path.display().to_string(),
            text,
        })
    }

    /// Reads a TOML text into a type that refuses unknown keys.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn parse<T: serde::de::DeserializeOwned>(&self) -> Result<T, FileError> {
        toml::from_str(&self.text)
            .map_err(|error| FileError::at(self, error.span(), error.message()))
    }
}
